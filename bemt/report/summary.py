"""The report in short, as Markdown."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from bemt.base.tables import number_text
from bemt.report.diagnosis_block import diagnosis_verdict, page_verdict
from bemt.report.verdicts import headline

__all__ = ["plain_markdown", "summary"]


def plain_markdown(value: Any, limit: int = 500) -> str:
    r"""Make a text that Markdown shows as it is, on one line.

    >>> plain_markdown("a|b <script> [x](y)")
    'a\\|b &lt;script&gt; \\[x\\](y)'
    """
    text = " ".join("".join(c for c in str(value) if c.isprintable() or c.isspace()).split())
    text = text if len(text) <= limit else text[: limit - 1] + "…"
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([\\`*_{}\[\]#|!~])", r"\\\1", text)


def _n(value: Any, digits: int = 4) -> str:
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return number_text(float(value), digits) if good else "-"


def summary(book: Mapping[str, Any]) -> str:
    """Write the summary."""
    out = ["# Validation report", "", f"bemt {plain_markdown(book['version'])}. Figures and tables: `report.html`.", ""]
    out += [
        "| case | BEMT T [N] | u [N] | K1/K2 T [N] | CFD T [N] | bench T [N] | vendor T [N] | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for page in book["cases"]:
        r = page["result"]
        first: dict[str, Any] = {}
        for row in r.get("rows", []):
            first.setdefault(row["source"], row)
        cells = [_n(first.get("bemt", {}).get("thrust_N")), _n(first.get("bemt", {}).get("u"), 2)]
        cells += [_n(first.get(s, {}).get("thrust_N")) for s in ("k1k2", "cfd", "bench", "vendor")]
        out.append(
            "| " + " | ".join([plain_markdown(r["name"], 80), *cells, plain_markdown(page_verdict(page)[1])]) + " |"
        )
    for page in book["cases"]:
        r = page["result"]
        out += ["", f"## {plain_markdown(headline(r), 140)}", "", plain_markdown(page_verdict(page)[2], 1500)]
        for audit in r.get("audit", []):
            for status in ("fault", "doubtful", "not stated"):
                topics = [line["topic"] for line in audit["lines"] if line["status"] == status]
                if topics:
                    out += [
                        "",
                        f"Audit of {plain_markdown(audit['reference'], 80)}, {status}: "
                        f"{plain_markdown(', '.join(topics))}.",
                    ]
        item = page.get("diagnosis")
        if item:
            out += [
                "",
                f"Diagnosis: {plain_markdown(diagnosis_verdict(item)[1], 80)}. "
                f"{plain_markdown(diagnosis_verdict(item)[2], 800)}",
            ]
        out += [f"- {plain_markdown(fault)}" for fault in r.get("faults", [])[:20]]
        out += ["", *(f"Note: {plain_markdown(note)}" for note in page["problems"])] if page["problems"] else []
    return "\n".join(out) + "\n"

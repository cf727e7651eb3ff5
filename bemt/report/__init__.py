"""The validation report as one self-contained HTML file and a summary.

What the pages show is gathered as plain values (:mod:`bemt.report.gather`), then written; no value of a file reaches a
page unescaped, no file outside of DIR is written, and the HTML lets no script run but its own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault, InputError

__all__ = ["HTML_NAME", "MARKDOWN_NAME", "book_html", "write"]

HTML_NAME, MARKDOWN_NAME = "report.html", "report.md"


def book_html(book: Mapping[str, Any]) -> str:
    """Write the HTML of a report."""
    from bemt.report.case_page import case_page, reproduction_table
    from bemt.report.cfd_page import cfd_page
    from bemt.report.diagnosis_block import diagnosis_parts
    from bemt.report.front import front_page
    from bemt.report.markup import document, esc, section
    from bemt.report.trend_page import trend_page

    ids = {
        i: f"case-{i + 1}-" + re.sub(r"[^A-Za-z0-9_-]+", "-", str(page["result"]["name"]))[:60]
        for i, page in enumerate(book["cases"])
    }
    pages = [("front", "Front page", front_page(book, ids))]
    for i, page in enumerate(book["cases"]):
        pages.append((ids[i], str(page["result"]["name"])[:40], case_page(page, book["reproduction"])))
    pages.append(("trends", "Trends", trend_page(book)))
    pages.append(("cfd", "Own CFD", cfd_page(book["cfd"])))
    told = "".join(section(item["name"], diagnosis_parts(item)) for item in book["diagnoses"])
    pages.append(("diagnoses", "Diagnoses", f"<h2>Diagnoses</h2>{told}" if told else ""))
    numbers = reproduction_table(book["reproduction"])
    about = book.get("about", {})
    words = (
        "<p>T. Cahill, MS thesis, Northeastern University, April 2025. Statistics of the UIUC database are checked by "
        f"<code>{esc('python -m bemt reproduce')}</code> where those data are.</p>"
    )
    pages.append(
        (
            "reproduction",
            "Reproduction",
            f"<h2>Every number of the source thesis</h2>{words}{numbers}" if numbers else "",
        )
    )
    lead = (
        "Propellers and ducted fans: blade element momentum theory beside the K1/K2 formula, CFD, bench and vendor. "
        "Nothing here is fitted to the value it is compared with."
    )
    foot = (
        f"bemt {book['version']}. Thrust in newtons, CT = T/(ρ n² D⁴), CP = P/(ρ n³ D⁵). Colours after Okabe and Ito. "
        "This file loads nothing from the network."
    )
    made = " · ".join(filter(None, (about.get("author"), about.get("date"), about.get("revision"))))
    title = about.get("title") or "Validation report"
    return document(title, " ".join(filter(None, (made + "." if made else "", lead))), [p for p in pages if p[2]], foot)


def write(
    paths: Sequence[str | Path],
    out: str | Path,
    progress: Callable[[str], None],
    about: Mapping[str, str] | None = None,
) -> tuple[Mapping[str, Any], tuple[Path, Path]]:
    """Sweep the cases into a folder and write the report beside; returns what it shows, and its two files.

    ``about`` holds title, author, date and revision for the head of the page, each as far as wanted.
    """
    from bemt.base.tables import write_atomic
    from bemt.report.gather import gather
    from bemt.report.summary import summary

    folder = Path(out)
    book = {**gather(paths, folder, progress), "about": dict(about or {})}
    files = folder / HTML_NAME, folder / MARKDOWN_NAME
    try:
        write_atomic(files[0], book_html(book))
        write_atomic(files[1], summary(book))
    except OSError as error:
        raise InputError(Fault(str(out), "", error.strerror or "no file", "a folder that can be written")) from error
    return book, files

"""The score of a proof for people: a table on the terminal, one HTML file."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bemt.base.page import Cell, render, table
from bemt.base.tables import text_table
from bemt.judge.proof.rows import Proof, ScoreRow


def _percent(value: float) -> str:
    return f"{100 * value:.1f} %" if math.isfinite(value) else "-"


def _rows(rows: Sequence[ScoreRow]) -> list[list[str]]:
    out = []
    for r in rows:
        share, value = math.isfinite(r.low), r.value
        words = f"{value:.3g}" if math.isfinite(value) else "-"
        interval = f"{_percent(r.low)} to {_percent(r.high)}" if share and r.n else ""
        count = f"{r.hits}/{r.n}" if share else str(r.n)
        state = {True: "yes", False: "NO", None: "no data"}[r.met] if r.target else ""
        out.append([r.what, count, _percent(value) if share else words, interval, r.target, state])
    return out


MET = {"yes": "fine", "NO": "fault", "no data": "unknown"}
_HEADER = ["metric", "count", "value", "95 % (Wilson)", "target", "met"]


def _tables(found: Proof) -> list[tuple[str, list[str], list[list[str]]]]:
    strata = [[f"above {s.low:g}" if math.isnan(s.high) else f"{s.low:g} to {s.high:g}", str(s.n),
               str(s.top1), str(s.claims), str(s.right)] for s in found.strata]  # fmt: skip
    risk = [[_percent(r.coverage), f"{r.n:.0f}", _percent(r.risk), f"{r.probability:.3f}"]
            for r in found.risk_coverage]  # fmt: skip
    confusion = [[there, ", ".join(f"{said} {n}" for said, n in sorted(row.items(), key=lambda kv: -kv[1]))]
                 for there, row in found.confusion.items()]  # fmt: skip
    kinds = ("found", "class", "none", "unknown", "insufficient", "wrong", "failed")
    answers = [[kind, *(str(row.get(k, 0)) for k in kinds)] for kind, row in found.answers.items()]
    misses = [
        [m.folder, m.set, "+".join(m.causes) or "-", m.plan, f"{m.separation:.1f}",
         "class: " + ", ".join(m.effects) if m.verdict == "class" else m.said]
        for m in found.misses
    ]  # fmt: skip
    tables = [
        ("Score", _HEADER, _rows(found.score)),
        ("Answers by set", ["set", *kinds], answers),
        ("Simpler rules on the same data", _HEADER, _rows(found.baselines)),
        ("Single causes by separation", ["sigma", "items", "top 1", "claims", "right claims"], strata),
        ("Wrong claims against claims listened to", ["share", "claims", "wrong", "down to probability"], risk),
        ("What was there, and what was said", ["there", "said"], confusion),
        ("Misses", ["item", "set", "there", "plan", "sigma", "said"], misses),
    ]
    return [t for t in tables if t[2] or t[0] == "Misses"]


def text(found: Proof) -> str:
    """Give the tables for a terminal."""
    parts = [f"{found.items} concealed items ({found.size}), seed {found.seed}, "
             f"commit {found.commit or 'unknown'}\nkey SHA-256 {found.key_sha256}"]  # fmt: skip
    for title, header, rows in _tables(found):
        left = (0, 1, 2, 3, 5) if title == "Misses" else (0, 1) if "said" in header else (0,)
        parts.append(f"{title}\n" + text_table(header, rows, left=left, indent="  ") if rows else f"{title}: none")
    return "\n\n".join(parts)


def html(found: Proof) -> str:
    """Give one HTML file with the same tables."""
    tables = [(title, table(header, [[Cell(c, badge=MET[c]) if c in MET else c for c in row] for row in rows]))
              for title, header, rows in _tables(found)]  # fmt: skip
    lead = f"{found.items} items ({found.size}), seed {found.seed}, commit {found.commit or 'unknown'}."
    title = "Proof on concealed causes"
    return render("bemt.judge.proof", "proof.html", ["page.js"], title=title, lead=lead, key=found.key_sha256,
                  tables=tables)  # fmt: skip

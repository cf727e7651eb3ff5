"""The front page: an answer per case, all sources side by side, the numbers, and the same as Markdown."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from bemt.base.page import Cell, PageTable, num, table
from bemt.base.tables import number_text, speed_text
from bemt.results.report.book import Book, CasePage, Part, ShownAnswer, uri
from bemt.results.report.diagnosis_block import (
    answer,
    diagnosis_verdict,
    headline,
    lead,
    page_verdict,
    sentences,
    verdict,
)
from bemt.results.report.plot import Figure, Mark, Plot, figure, points
from bemt.results.sweep.rows import beside

SOURCES = {
    "bemt": ("BEMT", "circle", 0.28), "cfd": ("CFD, recorded", "diamond", 0.06), "bench": ("bench", "cross", 0.06),
    "vendor": ("vendor", "triangle", 0.06), "openfoam": ("CFD, own", "star", -0.14),
    "k1k2": ("K1/K2", "square", -0.34),
}  # fmt: skip
"""Name, marker, and lane in the row of a case, so that no bar lies under another source's mark."""
SHOWN = (0.4, 2.0)
"""Ratios that the chart holds; others stand at its edge with their value."""
NOTE = (
    "Bars: one standard uncertainty (BEMT: inputs, model and numerics; K1/K2: scatter against static UIUC "
    "data; own CFD: grid study). No bar: unknown. Reference: the first recorded CFD value, "
    "else bench, else vendor. A triangle at the edge points to a value beyond it."
)
NEEDS = {
    "needs u_D": "“Needs u_D ≥ 8 %”: the recording states no uncertainty, and the two agree only if its own is at "
    "least that large.",
    "inside the model's band": "“Inside the model's band”: the two differ by less than BEMT's own uncertainty, so "
    "they agree however uncertain the recording is.",
}
"""Explanations of badges, by how their words begin."""
OF_TABLE = (
    "Thrust at one point of each case: its own operating point, or where the first recording is if there is none at "
    "that; first value of each source. Click a heading to sort."
)

_MOST = 800  # characters of a diagnosis in the summary, in whole sentences
NO_NUMBER = "No case has a thrust, neither solved nor recorded: its page says what it lacks."


def answers(book: Book, ids: Sequence[str]) -> list[ShownAnswer]:
    """Give one sentence per case."""
    out = []
    for page, key in zip(book.cases, ids, strict=True):
        kind, word, told = page_verdict(page)
        words = answer(page.result) if verdict(page.result)[1] == word else told
        picture = uri(page.picture) if page.picture else ""
        out.append(ShownAnswer(key, headline(page.result), kind, word, words, picture))
    return out


def _values(page: CasePage) -> dict[str, list[tuple[str, float, float]]]:
    """Thrusts at the point that is shown, by source: (label, thrust, standard uncertainty)."""
    out: dict[str, list[tuple[str, float, float]]] = {}
    at, own = lead(page.result), page.result.first("bemt")
    for row in page.result.rows:
        if math.isfinite(row.thrust_N) and at and beside(row, at):
            out.setdefault(row.source, []).append((row.label, row.thrust_N, row.u))
    for source, label, T, u in page.own_points if at is own else ():
        out.setdefault(source, []).append((label, T, u))
    return out


def _comparison_plot(book: Book) -> Figure | None:
    """Thrust of every case and source over that of the first recording."""
    names: list[str] = []
    found: dict[str, list[tuple[float, float, float, str]]] = {source: [] for source in SOURCES}
    for page in reversed(book.cases):
        values = _values(page)
        base = next((values[s][0][1] for s in ("cfd", "bench", "vendor", "openfoam") if values.get(s)), math.nan)
        if not base > 0:
            continue
        for source, (_, _, lane) in SOURCES.items():
            for label, T, u in values.get(source, []):
                found[source].append((T / base, len(names) + lane, u / base, f"{label}: {T:.4g} N"))
        names.append(page.result.name)
    traces = [points(word, found[source], source, shape, True) for source, (word, shape, _) in SOURCES.items()]
    return figure(Plot("Thrust of all sources over the recorded value", "thrust / recorded thrust [-]", "", traces,
                       [Mark(1.0, "recorded")], NOTE, names, wide=True, x_limits=SHOWN))  # fmt: skip


COLUMNS = ("case", "rev/min", "tip Mach", "BEMT [N]", "u [N]", "BEMT torque [N m]", "K1/K2 [N]", "CFD [N]",
           "own CFD [N]", "bench [N]", "vendor [N]", "BEMT − CFD [%]", "K1/K2 − CFD [%]", "agreement")  # fmt: skip


def _comparison(page: CasePage, key: str) -> list[Cell]:
    """Row of a case, with all of `COLUMNS`."""
    kind, word, _ = page_verdict(page)
    v = {source: items[0][1:] for source, items in _values(page).items()}
    own = lead(page.result)
    T, simple, cfd = (v.get(source, (None,))[0] for source in ("bemt", "k1k2", "cfd"))
    off = [100 * (x / cfd - 1) if x is not None and cfd else None for x in (T, simple)]
    return [
        Cell(page.result.name, link=key), num(own and own.rpm, 6), num(own and own.M_tip, 3), num(T),
        num(v.get("bemt", (0, None))[1], 2), num(own and own.torque_Nm), num(simple), num(cfd),
        *(num(v.get(source, (None,))[0]) for source in ("openfoam", "bench", "vendor")),
        *(num(x, signed=True) for x in off), Cell(word, badge=kind),
    ]  # fmt: skip


def _comparison_table(book: Book, ids: Sequence[str]) -> PageTable | None:
    rows = [_comparison(page, key) for page, key in zip(book.cases, ids, strict=True)]
    if all(row[k].value is None for row in rows for k in (3, *range(6, 11))):
        return None
    used = [k for k in range(len(COLUMNS)) if k < 4 or any(not r[k].number or r[k].value is not None for r in rows)]
    return table([COLUMNS[k] for k in used], [[r[k] for k in used] for r in rows])


def front_parts(book: Book, ids: Sequence[str]) -> list[Part]:
    """Give the chart and the table of all cases."""
    plot = _comparison_plot(book)
    badges = [page_verdict(page)[1] for page in book.cases]
    told = [text for lead, text in NEEDS.items() if any(badge.startswith(lead) for badge in badges)]
    numbers = _comparison_table(book, ids)
    return [
        ("words", " ".join(told) if plot else ""), ("figures", [plot] if plot else []),
        ("words", OF_TABLE if numbers else NO_NUMBER), ("table", numbers),
    ]  # fmt: skip


def plain_markdown(value: Any, limit: int = 500) -> str:
    r"""Make a text that Markdown shows as it is, on one line; addresses do not become links.

    >>> plain_markdown("a|b <script> [x](y)"), plain_markdown("see https://x.org, www.y.org, me@z.org")
    ('a\\|b &lt;script&gt; \\[x\\](y)', 'see https:&#47;&#47;x.org, www&#46;y.org, me&#64;z.org')
    """
    text = " ".join("".join(c for c in str(value) if c.isprintable() or c.isspace()).split())
    text = text if len(text) <= limit else text[: limit - 1].rpartition(" ")[0] + " …"
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    text = re.sub(r"([\\`*_{}\[\]#|!~])", r"\\\1", text)
    return re.sub(r"\bwww\.", "www&#46;", text.replace("://", ":&#47;&#47;").replace("@", "&#64;"), flags=re.IGNORECASE)


def _n(value: Any, digits: int = 4) -> str:
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return number_text(float(value), digits) if good else "-"


def heading(book: Book) -> tuple[str, str]:
    """Title, and who made the report when and of what."""
    about, names = book.about, [headline(page.result) for page in book.cases]
    made = " · ".join(filter(None, (about.author, about.date, about.revision)))
    return about.title or (names[0] if len(names) == 1 else "Validation report"), made


def _numbers(book: Book) -> list[str]:
    """Table of all cases, its columns those that hold a number; a sentence where none does."""
    rows = []
    for page in book.cases:
        own, v = lead(page.result), {source: items[0][1] for source, items in _values(page).items()}
        others = [_n(v.get(source)) for source in ("k1k2", "cfd", "bench", "vendor")]
        cells = [_n(own and own.thrust_N), _n(own and own.u, 2), *others, speed_text(own.rpm if own else None)]
        rows.append([plain_markdown(page.result.name, 80), *cells, plain_markdown(page_verdict(page)[1])])
    heads = ["case", "BEMT T [N]", "u [N]", "K1/K2 T [N]", *(f"{k} T [N]" for k in ("CFD", "bench", "vendor")),
             "rev/min", "verdict"]  # fmt: skip
    last = len(heads) - 1
    used = [k for k in range(last + 1) if k in (0, last) or any(row[k] != "-" for row in rows)]
    if not any(0 < k < last - 1 for k in used):
        return [NO_NUMBER]
    head, *lines = (f"| {' | '.join(row[k] for k in used)} |" for row in (heads, *rows))
    return [head, "|" + "---|" * len(used), *lines]


def summary(book: Book) -> str:
    """Write the summary."""
    title, made = (plain_markdown(words, 300) for words in heading(book))
    by = f"Made by bemt {plain_markdown(book.version)}. Figures and tables: `report.html`."
    out = [f"# {title}", "", f"{made}. {by}" if made else by, "", *_numbers(book)]
    for page in book.cases:
        r = page.result
        out += ["", f"## {plain_markdown(headline(r), 140)}", "", plain_markdown(page_verdict(page)[2], 1500)]
        for audit in r.audit:
            for status in ("fault", "doubtful", "not stated"):
                topics = [line.topic for line in audit.lines if line.status == status]
                if topics:
                    out += [
                        "",
                        f"Audit of {plain_markdown(audit.reference, 80)}, {status}: "
                        f"{plain_markdown(', '.join(topics))}.",
                    ]
        item = page.diagnosis
        if item:
            _, word, why = diagnosis_verdict(item)
            new = [said for said in sentences(why) if said not in page_verdict(page)[2]]
            short = [said for k, said in enumerate(new) if len(" ".join(new[: k + 1])) <= _MOST]
            why = plain_markdown(" ".join(short or new), _MOST)
            out += ["", f"Diagnosis: {plain_markdown(word, 140)}. {why}".strip()]
        out += [f"- {plain_markdown(fault)}" for fault in r.faults[:20]]
        out += ["", *(f"Note: {plain_markdown(note)}" for note in page.problems)] if page.problems else []
    return "\n".join(out) + "\n"

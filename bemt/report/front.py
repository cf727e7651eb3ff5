"""The front page: a verdict per case, all sources side by side, pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bemt.report.markup import Cell, badge, esc, image, num, section, table
from bemt.report.plot import COLOURS, Mark, Plot, Trace, figure
from bemt.report.verdicts import answer, headline, verdict

__all__ = ["front_page"]

SOURCES = (
    ("bemt", "BEMT", "circle"),
    ("k1k2", "K1/K2", "square"),
    ("cfd", "CFD, recorded", "diamond"),
    ("openfoam", "CFD, own", "star"),
    ("bench", "bench", "cross"),
    ("vendor", "vendor", "triangle"),
)
OFFSET = {"bemt": 0.17, "k1k2": -0.17}
"""Of bars that would cover each other, in rows."""


def _cards(book: Mapping[str, Any], ids: Mapping[int, str]) -> str:
    out = []
    for i, page in enumerate(book["cases"]):
        result = page["result"]
        kind, word, _ = verdict(result)
        title = headline(result)
        picture = image(page["pictures"]["rotor"], f"{title}: rotor") if "rotor" in page["pictures"] else ""
        out.append(
            f'<article class="card"><h3><a href="#{ids[i]}">{esc(title)}</a></h3>{picture}{badge(kind, word)}'
            f"<p>{esc(answer(result))}</p></article>"
        )
    return f'<div class="cards">{"".join(out)}</div>'


def _values(page: Mapping[str, Any]) -> dict[str, list[tuple[str, float, float]]]:
    """Thrusts by source: (label, thrust, standard uncertainty)."""
    result = page["result"]
    own = result.get("conditions", {})
    out: dict[str, list[tuple[str, float, float]]] = {}
    for row in result.get("rows", []):
        T, u = row.get("thrust_N"), row.get("u")
        here = abs(row["rpm"] - own["rpm"]) <= 1e-6 * own["rpm"] and row["airspeed_m_s"] == own["airspeed_m_s"]
        if T is not None and math.isfinite(T) and here:
            out.setdefault(row["source"], []).append((row["label"], float(T), math.nan if u is None else float(u)))
    run = page.get("own_cfd")
    if run:
        words = f"{run['campaign']}, {run['solver']}, {run['cells']:.0f} cells"
        out.setdefault("openfoam", []).append((words, run["thrust_N"], run["u_thrust_N"]))
    return out


def _comparison_plot(book: Mapping[str, Any]) -> str:
    """Thrust of every case and source over that of the first recording."""
    names: list[str] = []
    points: dict[str, list[tuple[float, float, float, str]]] = {}
    for page in reversed(book["cases"]):
        values = _values(page)
        base = next((values[s][0][1] for s in ("cfd", "bench", "vendor", "openfoam") if values.get(s)), math.nan)
        if not base > 0:
            continue
        for source, items in values.items():
            for label, T, u in items:
                points.setdefault(source, []).append(
                    (T / base, len(names) + OFFSET.get(source, 0.0), u / base, f"{label}: {T:.4g} N")
                )
        names.append(str(page["result"]["name"]))
    traces = []
    for source, word, shape in SOURCES:
        p = points.get(source, [])
        traces.append(
            Trace(
                word,
                [a[0] for a in p],
                [a[1] for a in p],
                [a[2] for a in p],
                COLOURS[source],
                "",
                shape,
                True,
                [a[3] for a in p],
                True,
            )
        )
    note = (
        "Bars: one standard uncertainty where one is known; of BEMT that of its inputs and of the model, of K1/K2 that "
        "found against the UIUC database. Reference is the first recorded CFD value, else bench, else vendor."
    )
    return figure(
        Plot(
            "Thrust of all sources over the recorded CFD value",
            "thrust / recorded thrust [-]",
            "",
            traces,
            [Mark(1.0, "recorded")],
            note,
            names,
            x_zero=True,
            wide=True,
        )
    )


def _comparison_table(book: Mapping[str, Any], ids: Mapping[int, str]) -> str:
    rows = []
    for i, page in enumerate(book["cases"]):
        result = page["result"]
        name = Cell(str(result["name"]), markup=f'<a href="#{ids[i]}">{esc(result["name"])}</a>')
        if not result.get("rows"):
            rows.append([name, *[num(None)] * 11, badge_cell("fault", "not solved")])
            continue
        v = _values(page)

        def first(source: str, v: Mapping[str, list[tuple[str, float, float]]] = v) -> float | None:
            return v[source][0][1] if v.get(source) else None

        T, base = first("bemt"), first("cfd")
        error = 100 * (T / base - 1) if T is not None and base else None
        simple = 100 * (first("k1k2") / base - 1) if first("k1k2") is not None and base else None  # type: ignore[operator]
        row = next(r for r in result["rows"] if r["source"] == "bemt")
        kind, word, _ = verdict(result)
        u = v["bemt"][0][2] if v.get("bemt") else math.nan
        rows.append(
            [
                name,
                num(row["M_tip"], 3),
                num(T),
                num(u, 2),
                num(row.get("torque_Nm")),
                num(first("k1k2")),
                num(base),
                num(first("openfoam")),
                num(first("bench")),
                num(first("vendor")),
                num(error, signed=True),
                num(simple, signed=True),
                badge_cell(kind, word),
            ]
        )
    header = [
        "case",
        "tip Mach",
        "BEMT [N]",
        "u [N]",
        "BEMT torque [N m]",
        "K1/K2 [N]",
        "CFD [N]",
        "own CFD [N]",
        "bench [N]",
        "vendor [N]",
        "BEMT − CFD [%]",
        "K1/K2 − CFD [%]",
        "verdict",
    ]
    keep = [
        k
        for k in range(len(header))
        if k < 3 or any(isinstance(r[k], Cell) and (r[k].value is not None or not r[k].number) for r in rows)
    ]  # noqa: E501
    return table([header[k] for k in keep], [[r[k] for k in keep] for r in rows])


def badge_cell(kind: str, words: str) -> Cell:
    """Make a cell of a badge."""
    return Cell(words, markup=badge(kind, words))


def front_page(book: Mapping[str, Any], ids: Mapping[int, str]) -> str:
    """Write the front page."""
    plot = _comparison_plot(book)
    return "".join(
        [
            "<h2>Verdicts</h2>",
            _cards(book, ids),
            section(
                "All sources side by side",
                f'<div class="figures">{plot}</div>' if plot else "",
                '<p class="soft">Thrust at the operating point of each case; the first value of each source. Headings '
                "sort.</p>",
                _comparison_table(book, ids),
            ),
        ]
    )

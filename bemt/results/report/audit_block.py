"""An audit of a CFD result, and its grid study, as parts of a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.page import Cell, num, table
from bemt.data.recordings.audit import Audit
from bemt.data.recordings.grid_study import LOADS, LoadStudy
from bemt.results.report.book import Part
from bemt.results.report.plot import COLOURS, DASHES, Plot, Trace, figure

KIND = {"fine": "fine", "doubtful": "doubtful", "fault": "fault", "not stated": "unknown"}


def _share(value: float) -> str:
    return "unknown" if value != value else f"{100 * value:.1f} %"


def audit_parts(audit: Audit) -> list[Part]:
    """Say what an audit comes to, and give its lines."""
    rows = []
    for line in audit.lines:
        rows.append([line.topic, Cell(line.status, badge=KIND.get(line.status, "unknown")), line.finding,
                     line.consequence, num(100 * line.u_relative, 2, none="unknown")])  # fmt: skip
    known = audit.u_relative_known
    rest = f"the known parts make {_share(known)} together" if known else "no part of it is known"
    words = f"{audit.reference}: uncertainty of the thrust {_share(audit.u_relative)}; {rest}."
    head = ["setting", "status", "what is known", "consequence for the thrust", "u %"]
    return [("words", words), ("table", table(head, rows))]


def study_parts(studies: Sequence[Mapping[str, Any]]) -> list[Part]:
    """Grid studies: a picture each, values over the size of the cells down to zero, and what they say."""
    figures = []
    for s in map(LoadStudy.from_document, studies):
        h = [(s.cells[0] / n) ** (1.0 / 3.0) for n in s.cells]
        unit = f" [{LOADS[s.channel]}]" if LOADS[s.channel] else ""
        u = [s.u_relative * abs(s.values[0]), *[math.nan] * (len(h) - 1)]
        words = [f"{n:,.0f} cells" for n in s.cells]
        grids = Trace("grids; on the finest its u", h, s.values, u, COLOURS["cfd"], points=True, labels=words)
        traces = [grids]
        if s.order is not None and s.extrapolated is not None:
            x = [k * max(h) / 40 for k in range(41)]
            y = [s.extrapolated + (s.values[0] - s.extrapolated) * v**s.order for v in x]
            traces.append(Trace(f"order {s.order:.3g}", x, y, dash=DASHES[1]))
        title, label = f"Grid study: {s.name} at {s.rpm:g} rev/min", "cell size over the finest grid's"
        plot = Plot(title, label, s.name + unit, traces, note=f"{s.sentence()}.", zero=False, x_zero=True)
        figures.append(figure(plot))
    return [("figures", figures)] if figures else []

"""The page of this project's own CFD."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.page import num, table
from bemt.report.audit_block import audit_parts
from bemt.report.plot import DASHES, SERIES, SHAPES, Plot, Trace, figure
from bemt.report.values import Section, picture, sections

__all__ = ["CFD_WORDS", "cfd_sections"]

CFD_WORDS = (
    "OpenFOAM runs on the solids of the cases: rotating frame, wall functions, forces integrated over the blades. "
    "Each run is audited like any other CFD result."
)

VARIED = (("J", "J [-]"), ("wall_distance_m", "distance of the plate [m]"), ("tip_gap_mm", "tip gap [mm]"),
          ("sideslip_deg", "angle of the inflow [deg]"), ("pitch_offset_deg", "offset of the blade angle [deg]"),
          ("cells", "cells [-]"))  # fmt: skip
COLUMNS = (("rpm", "rpm", 6), ("airspeed_m_s", "V [m/s]", 4), ("J", "J", 3), ("thrust_N", "T [N]", 4),
           ("u_thrust_N", "u [N]", 2), ("torque_Nm", "Q [N m]", 4), ("wall_distance_m", "plate [m]", 3),
           ("tip_gap_mm", "gap [mm]", 3), ("sideslip_deg", "skew [deg]", 3), ("pitch_offset_deg", "dβ [deg]", 3),
           ("cells", "cells", 6), ("yplus_avg", "y+", 3), ("drift_thrust", "drift", 2))  # fmt: skip


def _plots(item: Mapping[str, Any]) -> list[dict[str, Any] | None]:
    """Thrust and torque over the quantity that was varied most, one line per group of the others."""
    runs = [r for r in item["runs"] if r["converged"] == 1]

    def values(key: str) -> set[float]:
        return {round(r[key], 6) for r in runs if math.isfinite(r[key])}

    name, label = max(VARIED, key=lambda v: (len(values(v[0])), -VARIED.index(v)))
    if len(values(name)) < 2:
        return []
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        words = [run["solver"], run["domain"], f"{run['rpm']:g} rev/min"]
        if name != "J" and len(values("J")) > 1:
            words.append(f"J {run['J']:.2g}")
        if len({r["turbulence"] for r in runs}) > 1:
            words.append(run["turbulence"])
        groups.setdefault(", ".join(words), []).append(run)
    if name == "cells" and len(values(name)) < 3:
        return []
    plots = []
    for key, word in (("thrust_N", "thrust [N]"), ("torque_Nm", "torque [N m]")):
        traces = []
        for i, (group, rows) in enumerate(groups.items()):
            rows = sorted(rows, key=lambda r: float(r[name]))
            x, y, u = [r[name] for r in rows], [r[key] for r in rows], [r[f"u_{key}"] for r in rows]
            look = SERIES[i % len(SERIES)], DASHES[i % len(DASHES)], SHAPES[i % len(SHAPES)]
            traces.append(Trace(group, x, y, u, *look, points=len(rows) == 1))
        plots.append(figure(Plot(f"{word.split(' [')[0].capitalize()}: {item['title']}", label, word, traces)))
    return plots


def _runs(item: Mapping[str, Any]) -> dict[str, Any] | None:
    used = [
        c
        for c in COLUMNS
        if any(math.isfinite(r[c[0]]) and (r[c[0]] != 0 or c[0] in ("J", "airspeed_m_s")) for r in item["runs"])
    ]
    rows = []
    for run in item["runs"]:
        audit = run.get("audit")
        u = None if not audit or audit["u_relative"] is None else 100 * audit["u_relative"]
        state = "settled" if run["converged"] == 1 else "did not settle"
        rows.append([run["run"][:6], run["solver"], run["domain"], *(num(run[key], digits) for key, _, digits in used),
                     num(u, 2, none="unknown"), state])  # fmt: skip
    return table(["run", "flow", "domain", *(label for _, label, _ in used), "u of T by audit [%]", "state"], rows)


def cfd_sections(found: Sequence[Mapping[str, Any]]) -> list[Section]:
    """Give the figures of all campaigns of this project's own CFD, then the runs and an audit of each."""
    figures, tables = [], []
    for item in found:
        figures += [*_plots(item), *(picture(name, data) for name, data in item["figures"])]
        first = next((run["audit"] for run in item["runs"] if run.get("audit")), None)
        parts = [("table", _runs(item)), *(audit_parts(first) if first else [])]
        tables.append(("more", (f"{item['title']}: {len(item['runs'])} runs, audit of the first", parts)))
    return sections(("Figures", [("figures", figures)]), ("Campaigns", tables))

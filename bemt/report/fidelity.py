"""One rotor by blade elements, as a disk in a flow solver and with its blades resolved: loads, wake, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bemt.base.page import num, table
from bemt.report.cfd import read_rows, value
from bemt.report.plot import DASHES, SERIES, Plot, Trace, figure
from bemt.report.values import Section, sections

__all__ = ["FIDELITY_WORDS", "fidelities", "fidelity_sections"]

FIDELITY_WORDS = (
    "The disk prescribes BEMT's load and shows what the wake does with it; resolved blades compute their own. "
    "The far wake of BEMT is drawn without contraction. CPU seconds; other work ran at the same time."
)


def fidelities(out: Path, cases: Sequence[str]) -> dict[str, Any]:
    """Loads (``disk/loads.csv``) and axial speeds behind the rotor (``disk/wake.csv``) of the report's own cases."""
    loads = [row for row in read_rows(out / "disk" / "loads.csv") if row.get("case") in cases]
    runs = {row.get("run"): row.get("source") for row in loads if row.get("run")}
    wake: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in read_rows(out / "disk" / "wake.csv"):
        if name := runs.get(row.get("run")):
            point = value(row.get("r_over_R")), value(row.get("axial_speed_m_s"))
            wake.setdefault((name, row.get("z_over_R", "")), []).append(point)
    return {"loads": loads, "wake": wake}


def fidelity_sections(found: Mapping[str, Any]) -> list[Section]:
    """Table of loads, and the axial speed at two distances behind."""
    rows = [[row["source"], num(value(row.get("J")), 2), num(value(row.get("thrust_N")), 4),
             num(value(row.get("torque_Nm")), 3), num(value(row.get("seconds")), 2), row.get("what", "")]
            for row in found["loads"]]  # fmt: skip
    heads = ["source", "J", "thrust [N]", "torque [N m]", "CPU [s]", "how"]
    plots = []
    places = {"0": " at the disk", "-inf": " far behind"}
    for behind in ("0.5", "2"):
        traces: list[Trace] = []
        for (name, at), points in found["wake"].items():
            if at == f"-{behind}" or at in places:
                i = len(traces)
                x, y = zip(*points, strict=True)
                traces.append(
                    Trace(name + places.get(at, ""), x, y, None, SERIES[i % len(SERIES)], DASHES[i % len(DASHES)])
                )
        if len(traces) > 1:
            title = f"Axial speed {behind} R behind the rotor, compared with BEMT"
            plots.append(figure(Plot(title, "r/R [-]", "axial speed [m/s]", traces)))
    return sections(("Loads and cost", [("table", table(heads, rows))] if rows else []), ("Wake", [("figures", plots)]))

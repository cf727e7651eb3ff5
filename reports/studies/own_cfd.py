"""All campaigns of a folder beside BEMT, a row a run: ``python reports/studies/own_cfd.py reports/cfd [--json]``.

Below the rows stand the loads along the radius in bands, of the plain runs at full speed.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, number_text, text_table
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model
from bemt.rotors.case import Case
from bemt.rotors.case.oblique import parted
from bemt.rotors.case.prepare import prepare_case
from bemt.tools.cfd.record import csv_rows, studies_of
from bemt.tools.cfd.schema import Campaign, RunRow, Study, load_campaign, run_of

BANDS = (0.15, 0.30, 0.45, 0.60, 0.75, 0.90, 1.0)
"""Edges of the bands. [R]"""
MACH_EFFECTS = ["compressibility", "drag_divergence"]


class Bemt:
    """BEMT of the cases of the runs; without effects of Mach number beside incompressible flow."""

    def __init__(self) -> None:
        self.ready: dict[str, Model] = {}

    def solve(self, campaign: Campaign, row: RunRow) -> solver.Solution:
        """Solution of the rotor that a run is of."""
        case = _case_of(campaign, row)
        overrides: dict[str, object] = {}
        if row.solver == "incompressible":
            overrides["model.effects_off"] = sorted({*case.file.model.effects_off, *MACH_EFFECTS})
        vanes = case.get("duct.stator.blades")
        if vanes and row.sector == "blade" and vanes % case.rotor().B:
            overrides["duct.stator.recovery"] = 0.0  # left out of the grid
        changed = case.replaced(overrides)
        key = changed.file.model_dump_json()
        if key not in self.ready:
            self.ready[key] = prepare_case(changed)
        skew = 0.0 if math.isnan(row.sideslip_deg) else row.sideslip_deg
        V, side = parted(np.array(row.airspeed_m_s), np.array(skew))
        return solver.solve(self.ready[key].prep, row.rpm, V, case.air(), radial=True, side=side)


def _case_of(campaign: Campaign, row: RunRow) -> Case:
    """Case with the changes of the point that a run belongs to: blade angle, duct, gap; the plain one where none is."""
    pitch, gap = row.pitch_offset_deg, row.tip_gap_mm
    for point in campaign.points:
        own = point.case.get("duct.tip_gap_mm") if point.case.ducted else math.nan
        alike = math.isnan(gap) and math.isnan(own) or math.isclose(gap, own, rel_tol=1e-3)
        if alike and math.isclose(point.values.get("pitch_offset_deg", 0.0), 0.0 if math.isnan(pitch) else pitch):
            return point.case
    return campaign.case


def _bands(R: float, edges: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Share out loads of pieces between edges over the bands, evenly within each piece."""
    limits = np.array(BANDS) * R
    limits[-1] = max(limits[-1], edges[-1])
    total = np.concatenate([[0.0], np.cumsum(load)])
    return np.diff(np.interp(limits, edges, total))


def _edges(r: np.ndarray) -> np.ndarray:
    middle = 0.5 * (r[1:] + r[:-1])
    return np.concatenate([[2 * r[0] - middle[0]], middle, [2 * r[-1] - middle[-1]]])


class Bands(Documented):
    """Loads of the blades in bands of the radius, and where BEMT's sections stand [deg]."""

    edges_over_R: tuple[float, ...]
    cfd_thrust_N: tuple[float, ...]
    bemt_thrust_N: tuple[float, ...]
    cfd_torque_Nm: tuple[float, ...]
    bemt_torque_Nm: tuple[float, ...]
    bemt_alpha_deg: tuple[float, ...]


class Compared(Documented):
    """A run beside BEMT."""

    cells: Mapping[str, str]  # Line of the recording as written
    run: RunRow
    bemt_thrust_N: float
    bemt_torque_Nm: float
    radial: Bands | None

    def document(self) -> dict[str, Any]:
        """Line of the summary."""
        return {**self.cells, "bemt_thrust_N": self.bemt_thrust_N, "bemt_torque_Nm": self.bemt_torque_Nm,
                "radial": self.radial and self.radial.document()}  # fmt: skip


class CampaignSummary(Documented):
    """One campaign."""

    name: str
    title: str
    points: int
    recorded: int
    converged: int
    balanced: int
    grid_studies: tuple[Study, ...]
    rows: tuple[Compared, ...]


class Summary(Documented):
    """All campaigns of a folder."""

    schema: str
    campaigns: tuple[CampaignSummary, ...]


def _radial(campaign: Campaign, run: str, found: solver.Solution) -> Bands | None:
    rows = [row for row in csv_rows(campaign.path.parent / "radial.csv") if row["run"] == run]
    if not rows:
        return None
    names = ("r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m")
    r, dT, dQ = (np.array([float(row[name]) for row in rows]) for name in names)
    R = 0.5 * campaign.case.diameter_m
    at = solver.Radial(*(v[0] for v in found.radial))
    edges = _edges(at.r)
    a, b, c, d = (
        tuple(_bands(R, ends, load).tolist())
        for recorded, solved in ((dT, at.dT), (dQ, at.dQ))
        for ends, load in ((_edges(r), recorded * np.diff(_edges(r))), (edges, solved))
    )
    alpha = (
        float(np.degrees(np.interp((a + b) * R / 2, at.r, at.alpha))) for a, b in zip(BANDS, BANDS[1:], strict=False)
    )
    return Bands(BANDS, a, b, c, d, tuple(alpha))


def summary(folder: str | Path) -> Summary:
    """Collect the recordings of all campaigns in a folder and solve their points by BEMT."""
    folder = Path(folder)
    paths = sorted(folder.glob("*/campaign.toml"))
    if not paths:
        raise InputError(Fault(folder.as_posix(), "", "no campaign", "campaign.toml, or folders with one each"))
    model, out = Bemt(), []
    for path in paths:
        campaign = load_campaign(path)
        rows = []
        for cells in csv_rows(path.parent / "recording.csv"):
            run = run_of(cells)
            found = model.solve(campaign, run)
            radial = _radial(campaign, run.run, found)
            rows.append(Compared(cells, run, float(found.T[0]), float(found.Q[0]), radial))
        settled = [row.run for row in rows if row.run.settled]
        balanced = sum(not math.isnan(run.balance_mass) for run in settled)
        out.append(CampaignSummary(campaign.name, campaign.title, len(campaign.points), len(rows), len(settled),
                                   balanced, studies_of(path.parent), tuple(rows)))  # fmt: skip
    return Summary("bemt.cfd-summary/1", tuple(out))


def _leak(run: RunRow) -> str:
    sizes = [abs(size) for size in (run.balance_mass, run.balance_momentum, run.balance_angular_momentum)]
    known = [size for size in sizes if not math.isnan(size)]
    return number_text(100 * max(known), 2) if known else "-"


def summary_text(found: Summary) -> str:
    """Give the summary as tables."""
    lines = []
    counts = [[c.name, *map(str, (c.points, c.recorded, c.converged, c.balanced))] for c in found.campaigns]
    counts.append(["all", *(str(sum(int(row[k]) for row in counts)) for k in (1, 2, 3, 4))])
    lines.append(text_table(["campaign", "points", "run", "converged", "and balanced"], counts))
    head = ["run", "solver", "level", "cells", "rpm", "J", "other", "T [N]", "u", "BEMT", "Q [N m]", "u", "BEMT", "y+",
            "leak [%]"]  # fmt: skip
    # leak: the largest residual of mass, momentum and angular momentum; empty where none was written
    for campaign in found.campaigns:
        rows = []
        for row in campaign.rows:
            r = row.run
            other = [f"{word} {value:.7g}" for value, word in (
                (r.wall_distance_m, "plate m"), (r.tip_gap_mm, "gap mm"), (r.sideslip_deg, "wind deg"),
                (r.pitch_offset_deg, "pitch deg")) if value and not math.isnan(value)]  # fmt: skip
            other += [r.domain] if r.domain != "free" else []
            other += [r.turbulence] if r.turbulence != "kOmegaSST" else []
            other += ["energy equation"] if r.gas == "perfect" else []
            rows.append([r.run[:6], r.solver, f"{r.level:g}", f"{r.cells:.0f}", f"{r.rpm:.7g}", number_text(r.J, 3),
                         ", ".join(other), number_text(r.thrust_N), number_text(r.u_thrust_N, 2),
                         number_text(row.bemt_thrust_N), number_text(r.torque_Nm), number_text(r.u_torque_Nm, 2),
                         number_text(row.bemt_torque_Nm), number_text(r.yplus_avg, 3), _leak(r)])  # fmt: skip
        lines += ["", f"{campaign.name}: {campaign.title}"]
        lines.append(text_table(head, rows, left=(0, 1, 6)) if rows else "  nothing has run yet")
        for study in campaign.grid_studies:
            words = []
            for key in ("thrust_N", "torque_Nm"):
                of = study.of(key)
                gci = number_text(math.nan if of.gci_fine is None else 100 * of.gci_fine, 2)
                said = f": {'; '.join(of.flags)}" if of.flags else ""
                order, limit = number_text(of.order, 3), number_text(of.extrapolated)
                words.append(f"{key} order {order}, limit {limit}, GCI {gci} %{said}")
            levels = ", ".join(f"{level:g}" for level in study.levels)
            lines.append(f"  grid study {study.solver} levels {levels}: {' | '.join(words)}")
    return "\n".join([*lines, *_radial_text(found)]) + "\n"


def _radial_text(found: Summary) -> list[str]:
    lines = ["", "Loads along the radius, CFD / BEMT, in bands of r/R"]
    rows, seen = [], set()
    for campaign in found.campaigns:
        for row in campaign.rows:
            r, table = row.run, row.radial
            plain = r.domain == "free" and math.isnan(r.wall_distance_m) and math.isnan(r.tip_gap_mm)
            if table is None or not plain or r.run in seen or r.rpm < 20000:
                continue
            seen.add(r.run)
            for key, ours, theirs in (("thrust_N", table.cfd_thrust_N, table.bemt_thrust_N),
                                      ("torque_Nm", table.cfd_torque_Nm, table.bemt_torque_Nm)):  # fmt: skip
                cells = [f"{number_text(a, 3)} / {number_text(b, 3)}" for a, b in zip(ours, theirs, strict=True)]
                rows.append([campaign.name, r.solver, f"{r.level:g}", number_text(r.J, 2), key, *cells])
            angles = [f"{a:.1f}" for a in table.bemt_alpha_deg]
            rows.append(["", "", "", "", "BEMT alpha [deg]", *angles])
    heads = [f"{a:.2f}-{b:.2f}" for a, b in zip(BANDS, BANDS[1:], strict=False)]
    lines.append(text_table(["campaign", "solver", "level", "J", "load", *heads], rows, left=(0, 1, 4)))
    return lines


def main(words: list[str] | None = None) -> int:
    """Print the tables or the document."""
    parser = argparse.ArgumentParser(description="All campaigns of a folder beside BEMT.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", action="store_true", help="print bemt.cfd-summary/1")
    asked = parser.parse_args(words)
    found = summary(asked.folder)
    print(json_text(found.document()) if asked.json else summary_text(found), end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""All campaigns of a folder beside BEMT: one row a run, and the loads along the radius in bands."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text, text_table
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model
from bemt.rotors.case import Case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import parted
from bemt.tools.cfd.record import csv_rows
from bemt.tools.cfd.schema import Campaign, load_campaign

BANDS = (0.15, 0.30, 0.45, 0.60, 0.75, 0.90, 1.0)
"""Edges of the bands. [R]"""
MACH_EFFECTS = ["compressibility", "drag_divergence"]


class _Bemt:
    """BEMT of the cases of the runs; without effects of Mach number beside incompressible flow."""

    def __init__(self) -> None:
        self.ready: dict[str, Model] = {}

    def solve(self, campaign: Campaign, row: dict[str, str]) -> solver.Solution:
        case = _case_of(campaign, row)
        overrides: dict[str, Any] = {}
        if row["solver"] == "incompressible":
            overrides["model.effects_off"] = sorted({*case.file.model.effects_off, *MACH_EFFECTS})
        vanes = case.get("duct.stator.blades")
        if vanes and row["sector"] == "blade" and vanes % case.rotor().B:
            overrides["duct.stator.recovery"] = 0.0  # left out of the grid
        changed = case.replaced(overrides)
        key = changed.file.model_dump_json()
        if key not in self.ready:
            self.ready[key] = prepare_case(changed)
        V, side = parted(np.array(float(row["airspeed_m_s"])), np.array(float(row["sideslip_deg"] or 0)))
        return solver.solve(self.ready[key].prep, float(row["rpm"]), V, case.air(), radial=True, side=side)


def _case_of(campaign: Campaign, row: Mapping[str, str]) -> Case:
    """Case with the changes of the point that a run belongs to: blade angle, duct, gap; the plain one where none is."""
    pitch, gap = _number(row["pitch_offset_deg"]), _number(row["tip_gap_mm"])
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


def _radial(campaign: Campaign, run: str, found: solver.Solution) -> dict[str, Any] | None:
    rows = [row for row in csv_rows(campaign.path.parent / "radial.csv") if row["run"] == run]
    if not rows:
        return None
    names = ("r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m")
    r, dT, dQ = (np.array([float(row[name]) for row in rows]) for name in names)
    R = 0.5 * campaign.case.diameter_m
    s, edges = found.radial, _edges(found.radial["r"][0])
    out: dict[str, Any] = {"edges_over_R": list(BANDS)}
    for key, ours, theirs in (("thrust_N", dT, "dT"), ("torque_Nm", dQ, "dQ")):
        out[f"cfd_{key}"] = _bands(R, _edges(r), ours * np.diff(_edges(r))).tolist()
        out[f"bemt_{key}"] = _bands(R, edges, s[theirs][0]).tolist()
    out["bemt_alpha_deg"] = [
        float(np.degrees(np.interp((a + b) * R / 2, s["r"][0], s["alpha"][0])))
        for a, b in zip(BANDS, BANDS[1:], strict=False)
    ]
    return out


def summary(folder: str | Path) -> dict[str, Any]:
    """Collect the recordings of all campaigns in a folder and solve their points by BEMT."""
    folder = Path(folder)
    paths = sorted(folder.glob("*/campaign.toml"))
    if not paths:
        raise InputError(Fault(folder.as_posix(), "", "no campaign", "campaign.toml, or folders with one each"))
    model, out = _Bemt(), []
    for path in paths:
        campaign = load_campaign(path)
        manifest_path = path.parent / "manifest.json"
        manifest = json.loads(manifest_path.read_text(encoding="utf-8")) if manifest_path.is_file() else {}
        rows = []
        for row in csv_rows(path.parent / "recording.csv"):
            found = model.solve(campaign, row)
            rows.append({**row, "bemt_thrust_N": float(found.T[0]), "bemt_torque_Nm": float(found.Q[0]),
                         "radial": _radial(campaign, row["run"], found)})  # fmt: skip
        out.append({"name": campaign.name, "title": campaign.title, "points": len(campaign.points),
                    "recorded": len(rows), "converged": sum(row["converged"] == "1" for row in rows),
                    "balanced": sum(row["converged"] == "1" and row["balance_mass"] != "" for row in rows),
                    "grid_studies": manifest.get("grid_studies", []), "rows": rows})  # fmt: skip
    return {"schema": "bemt.cfd-summary/1", "campaigns": out}


def _leak(row: Mapping[str, str]) -> str:
    sizes = [abs(_number(row[f"balance_{name}"])) for name in ("mass", "momentum", "angular_momentum")]
    known = [size for size in sizes if not math.isnan(size)]
    return number_text(100 * max(known), 2) if known else "-"


def _number(text: str) -> float:
    return float(text) if text else math.nan


def summary_text(document: dict[str, Any]) -> str:
    """Give the summary as tables."""
    lines = []
    keys = ("points", "recorded", "converged", "balanced")
    counts = [[c["name"], *(str(c[key]) for key in keys)] for c in document["campaigns"]]
    counts.append(["all", *(str(sum(int(row[k]) for row in counts)) for k in (1, 2, 3, 4))])
    lines.append(text_table(["campaign", "points", "run", "converged", "and balanced"], counts))
    head = ["run", "solver", "level", "cells", "rpm", "J", "other", "T [N]", "u", "BEMT", "Q [N m]", "u", "BEMT", "y+",
            "leak [%]"]  # fmt: skip
    # leak: the largest residual of mass, momentum and angular momentum; empty where none was written
    for campaign in document["campaigns"]:
        rows = []
        for row in campaign["rows"]:
            other = [f"{word} {row[key]}" for key, word in (
                ("wall_distance_m", "plate m"), ("tip_gap_mm", "gap mm"), ("sideslip_deg", "wind deg"),
                ("pitch_offset_deg", "pitch deg")) if row[key] not in ("", "0", "0.0")]  # fmt: skip
            other += [row["domain"]] if row["domain"] != "free" else []
            other += [row["turbulence"]] if row["turbulence"] != "kOmegaSST" else []
            other += ["energy equation"] if row["gas"] == "perfect" else []
            values = [number_text(_number(row[key])) for key in ("thrust_N", "torque_Nm")]
            us = [number_text(_number(row[key]), 2) for key in ("u_thrust_N", "u_torque_Nm")]
            rows.append([row["run"][:6], row["solver"], row["level"], row["cells"], row["rpm"],
                         number_text(_number(row["J"]), 3), ", ".join(other), values[0], us[0],
                         number_text(row["bemt_thrust_N"]), values[1], us[1], number_text(row["bemt_torque_Nm"]),
                         number_text(_number(row["yplus_avg"]), 3), _leak(row)])  # fmt: skip
        lines += ["", f"{campaign['name']}: {campaign['title']}"]
        lines.append(text_table(head, rows, left=(0, 1, 6)) if rows else "  nothing has run yet")
        for study in campaign["grid_studies"]:
            words = []
            for key in ("thrust_N", "torque_Nm"):
                found = study[key]
                gci = number_text(_percent(found["gci_fine"]), 2)
                said = f": {'; '.join(found['flags'])}" if found["flags"] else ""
                order, limit = number_text(found["order"], 3), number_text(found["extrapolated"])
                words.append(f"{key} order {order}, limit {limit}, GCI {gci} %{said}")
            levels = ", ".join(f"{level:g}" for level in study["levels"])
            lines.append(f"  grid study {study['solver']} levels {levels}: {' | '.join(words)}")
    return "\n".join([*lines, *_radial_text(document)]) + "\n"


def _percent(value: float | None) -> float:
    return math.nan if value is None else 100 * value


def _radial_text(document: dict[str, Any]) -> list[str]:
    lines = ["", "Loads along the radius, CFD / BEMT, in bands of r/R"]
    rows, seen = [], set()
    for campaign in document["campaigns"]:
        for row in campaign["rows"]:
            table = row["radial"]
            plain = row["domain"] == "free" and not row["wall_distance_m"] and not row["tip_gap_mm"]
            if table is None or not plain or row["run"] in seen or _number(row["rpm"]) < 20000:
                continue
            seen.add(row["run"])
            for key in ("thrust_N", "torque_Nm"):
                cells = [f"{number_text(a, 3)} / {number_text(b, 3)}"
                         for a, b in zip(table[f"cfd_{key}"], table[f"bemt_{key}"], strict=True)]  # fmt: skip
                rows.append(
                    [campaign["name"], row["solver"], row["level"], number_text(_number(row["J"]), 2), key, *cells]
                )
            angles = [f"{a:.1f}" for a in table["bemt_alpha_deg"]]
            rows.append(["", "", "", "", "BEMT alpha [deg]", *angles])
    heads = [f"{a:.2f}-{b:.2f}" for a, b in zip(BANDS, BANDS[1:], strict=False)]
    lines.append(text_table(["campaign", "solver", "level", "J", "load", *heads], rows, left=(0, 1, 4)))
    return lines

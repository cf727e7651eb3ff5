"""One case of a sweep: BEMT and K1/K2 beside the recorded values, with uncertainties, as a plain document.

Uncertainty after ASME V&V 20: E = S - D, u_val^2 = u_num^2 + u_input^2 + u_model^2 + u_D^2; the model's three parts are
those of `bemt.rotors.case.propagate`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt import __version__
from bemt.base import plugins, units
from bemt.base.arrays import Array
from bemt.data.readers import references as reference_file
from bemt.data.recordings import audit_remarks
from bemt.data.recordings.cfd_setup import references_of
from bemt.data.recordings.cfd_study import merged
from bemt.data.recordings.load import import_file
from bemt.physics import effects
from bemt.physics.bem.coaxial import LOADS, RATIOS, PairModel
from bemt.physics.dataset import Dataset
from bemt.results.sweep.comparison import Comparison
from bemt.rotors.case import Case
from bemt.rotors.case.propagate import BANDED, Moved, Points, prepared, propagate, vary
from bemt.rotors.validity import serious

if TYPE_CHECKING:
    from bemt.physics.bem.model import Model

ROW_SOURCES = ("bemt", "k1k2", "cfd", "bench", "vendor")
COMPARED = {
    "thrust_N": "N", "torque_Nm": "N m", "power_W": "W", "exhaust_speed_m_s": "m/s", "duct_share": "-", "CT": "-",
    "CP": "-",
}  # fmt: skip
"""Channels that are compared, with their units."""


def _points(case: Case, refs: Sequence[reference_file.Reference]) -> list[tuple[float, float, float]]:
    """Distinct operating points (rpm, airspeed, density): the case's own first, then those of its references."""
    own = (case.rpm, case.airspeed_m_s, case.air().rho)
    return list(dict.fromkeys([own, *((r.rpm, r.airspeed_m_s, r.density_kg_m3) for r in refs)]))


def _runs(case: Case) -> list[tuple[str, Dataset]]:
    """CFD runs of a case; those of one condition on several grids as one study."""
    found = [import_file(path) for path in case.run_paths]
    return [(str(d.provenance["file"]), d) for d in merged(found)]


def _references(case: Case, runs: Sequence[tuple[str, Dataset]]) -> list[reference_file.Reference]:
    """Recorded values: references and CFD runs in the case's folder; open conditions filled in from the case."""
    own = {"rpm": case.rpm, "airspeed_m_s": case.airspeed_m_s, "density_kg_m3": case.air().rho}
    read = [] if case.references_path is None else reference_file.read(case.references_path)
    for path, run in runs:
        read += references_of(run, path)
    return [replace(r, **{k: v for k, v in own.items() if math.isnan(getattr(r, k))}) for r in read]  # type: ignore[arg-type]


def _row(source: str, label: str, thrust_N: float, **more: Any) -> dict[str, Any]:
    head = {"source": source, "label": label, "thrust_N": thrust_N, "thrust_kgf": thrust_N / units.KGF}
    names = ("torque_Nm", "power_W", "CT", "CP", "rpm", "airspeed_m_s", "density_kg_m3", "M_tip", "Re", "u")
    rest: dict[str, Any] = {**dict.fromkeys(names), "flags": []}
    return head | rest | more


def _part(values: Dataset, origin: str, channel: str, at: int) -> float:
    """Standard uncertainty from one origin at a point, zero where the model has none."""
    found = values.u_by.get(origin, {}).get(channel)
    return 0.0 if found is None else float(found[at])


def _compare(
    model: str, values: Dataset, at: int, channel: str, row: Mapping[str, Any], u_D: float
) -> Comparison | None:
    """One model at a point against one recorded value."""
    recorded = row.get(channel)
    if channel not in values or recorded is None or math.isnan(recorded):
        return None
    S = float(values[channel][at])
    if model == "k1k2" and math.isnan(S):  # oblique flow
        return None
    u_num, u_input, u_model = (_part(values, origin, channel, at) for origin in ("numerics", "input", "model"))
    doubts = tuple(serious(values.flags[at]))
    return Comparison(model, row["label"], row["source"], channel, COMPARED[channel], S, recorded, u_num, u_input,
                      u_model, u_D, doubts)  # fmt: skip


def _formula(case: Case, at: Points) -> tuple[Dataset, Dataset]:
    """K1/K2 at the points, and its thrust with the band over the declared unknowns."""
    from bemt.rotors.case.prepare import k1k2_case

    def area(changed: Case, _: str = "") -> dict[str, Array]:
        found = k1k2_case(changed, None, *at.conditions(changed), at.angles(changed))
        return {"thrust_N": found.thrust_N, "CT": found.CT}

    simple = k1k2_case(case, None, *at.conditions(case), at.angles(case))
    nominal = {"thrust_N": simple.thrust_N, "CT": simple.CT}
    moved = vary(case, nominal, area)
    u = simple.u["thrust_N"]  # unknown in flight and in a duct
    parts = {
        "input": {key: np.sqrt(np.sum([one.u[key] ** 2 for one in moved] or [0.0 * v], axis=0))
                  for key, v in nominal.items()},
        "model": {"thrust_N": u, "CT": u * simple.CT / simple.thrust_N},
    }  # fmt: skip
    return simple, Dataset("k1k2", case.name, nominal, flags=simple.flags, u_by=parts)


def solve_case(case: Case, threads: int = 1, progress: Callable[[int, int, str], None] | None = None) -> dict[str, Any]:
    """Solve one case at its operating points and put everything recorded beside it."""
    computed = _runs(case)
    refs = _references(case, computed)
    points = _points(case, refs)
    at = Points.of(case, *np.array(points).T)
    found = propagate(case, at.rpm, at.airspeed_m_s, at.density_kg_m3, threads=threads, progress=progress)
    nominal, ready = found.points, found.model
    simple, fit = _formula(case, at)
    without = case.file.model.also_without
    less = None
    if without:
        off = case.replaced({"model.effects_off": (*case.file.model.effects_off, *without)})
        conditions = at.conditions(off)
        less = at.solve(prepared(off).at_speeds(*conditions), off, threads)

    rows: list[dict[str, Any]] = []
    variants: list[dict[str, Any]] = []
    for i, (w, v, rho) in enumerate(points):
        state = {"rpm": w, "airspeed_m_s": v, "density_kg_m3": rho, "M_tip": nominal.M_tip[i], "Re": nominal.Re75[i],
                 "angle_deg": case.angle_deg}  # fmt: skip
        runs = [nominal.thrust_N[i], *(run["thrust_N"][i] for one in found.moved for run in one.runs)]
        rows.append(_row(
            "bemt", "bemt", nominal.thrust_N[i], torque_Nm=nominal.torque_Nm[i], power_W=nominal.power_W[i],
            CT=nominal.CT[i], CP=nominal.CP[i], u=nominal.u["thrust_N"][i],
            u_num=_part(nominal, "numerics", "thrust_N", i), u_input=_part(nominal, "input", "thrust_N", i),
            u_model=_part(nominal, "model", "thrust_N", i), thrust_N_range=[np.fmin.reduce(runs), np.fmax.reduce(runs)],
            exhaust_speed_m_s=nominal.exhaust_speed_m_s[i] if case.ducted else None,
            duct_share=nominal.duct_share[i] if case.ducted else None, converged=bool(nominal.converged[i]),
            H_force_N=nominal["H_force_N"][i] if "H_force_N" in nominal else None,
            upper_thrust_N=nominal["upper_thrust_N"][i] if case.paired else None,
            lower_thrust_N=nominal["lower_thrust_N"][i] if case.paired else None,
            J=nominal.J[i], flags=list(nominal.flags[i]), **state,
        ))  # fmt: skip
        rows.append(_row(
            "k1k2", "k1k2", simple.thrust_N[i], CT=simple.CT[i], u=simple.u["thrust_N"][i], J=simple.J[i],
            u_input=_part(fit, "input", "thrust_N", i), flags=list(simple.flags[i]), **(state | {"Re": None}),
        ))  # fmt: skip
        if less is not None:
            variants.append(_row(
                "bemt", "bemt variant", less.thrust_N[i], torque_Nm=less.torque_Nm[i],
                power_W=less.power_W[i], CT=less.CT[i], CP=less.CP[i], J=less.J[i],
                converged=bool(less.converged[i]),
                flags=[f"variant without {', '.join(without)}", *less.flags[i]], **state,
            ))  # fmt: skip
    recorded = _recorded_rows(case, refs, ready.diameter_m, points, nominal)
    models = {"bemt": nominal, "k1k2": fit}
    if less is not None:
        flags = tuple(tuple(dict.fromkeys((*a, *b))) for a, b in zip(less.flags, nominal.flags, strict=True))
        models["bemt variant"] = replace(less, u={}, flags=flags, u_by={"numerics": {k: math.nan for k in BANDED}})
    comparisons = _comparisons(recorded, models)
    return {
        "name": case.name, "title": case.title, "kind": case.kind, "origin": case.file.origin, "version": __version__,
        "rows": rows + [r for r in recorded if r["source"] in ROW_SOURCES],
        "variants": variants,
        "other_rows": [r for r in recorded if r["source"] not in ROW_SOURCES],
        "comparisons": comparisons,
        "audit": audit_remarks.audit_rows(recorded, ready.diameter_m, ready.pitch_m, case.ducted),
        "grid_studies": [s for _, d in computed for s in d.provenance.get("studies", ())],
        "conditions": _description(case, ready, case.file.model.stations),
        "assumptions": [_assumption(moved) for moved in found.moved],
        "references": [{"quantity": r.quantity, "kind": r.kind, "printed": r.printed, "value": r.value, "u": r.u,
                        "channel": r.channel, "source": r.source, "remark": r.remark} for r in refs],
        "drive": plugins.part("drive", case),
        "fan": None if isinstance(ready, PairModel) or not case.ducted else _fan(case, ready, nominal),
        "pair": _pair(case, nominal) if case.paired else None,
        "notes": [*([case.file.notes.strip()] if case.file.notes else []), *ready.notes],
        "faults": [],
    }  # fmt: skip


def _recorded_rows(
    case: Case,
    refs: list[reference_file.Reference],
    diameter: float,
    points: list[tuple[float, float, float]],
    nominal: Dataset,
) -> list[dict[str, Any]]:
    """Rows of all recorded values, coefficients derived."""
    rows = []
    printed = {r.where: r.printed for r in reversed(refs)}  # thrust comes first
    for group in reference_file.to_series(refs, case.name):
        full = group.derive(diameter)
        for i in range(len(full)):
            get = {k: float(full[k][i]) for k in full.values}
            at = points.index((get["rpm"], get["airspeed_m_s"], get["density_kg_m3"]))
            u = {k: float(full.u[k][i]) for k in full.values}
            name = f"{group.kind} {printed[full.labels[i]]}" if full.labels else group.kind
            rows.append(_row(
                group.kind, name, get.get("thrust_N", math.nan), torque_Nm=get.get("torque_Nm"),
                power_W=get.get("power_W"), CT=get.get("CT"), CP=get.get("CP"), rpm=get["rpm"],
                airspeed_m_s=get["airspeed_m_s"], density_kg_m3=get["density_kg_m3"], M_tip=nominal.M_tip[at],
                Re=nominal.Re75[at], u=u.get("thrust_N"), exhaust_speed_m_s=get.get("exhaust_speed_m_s"),
                duct_share=get.get("duct_share"), origin=str(full.provenance.get("source", "")),
                remark=str(full.provenance.get("remark", "")), u_by_quantity=u, condition=at,
            ))  # fmt: skip
    return rows


def _comparisons(recorded: list[dict[str, Any]], models: Mapping[str, Dataset]) -> list[dict[str, Any]]:
    """Every model against every recorded value; the error on thrust also goes into the recorded row."""
    out = []
    for row in recorded:
        at, u_D = row.pop("condition"), row.pop("u_by_quantity")
        measured = {r for r in COMPARED if row.get(r) is not None}
        measured -= {"CT"} if "thrust_N" in measured else set()
        measured -= {"CP", "power_W"} if "torque_Nm" in measured else set()
        for name, model in models.items():
            for channel in COMPARED:
                if channel in measured:
                    line = _compare(name, model, at, channel, row, u_D.get(channel, math.nan))
                    if line is not None:
                        out.append(line.document())
                        if channel == "thrust_N" and name in ROW_SOURCES:
                            row[f"{name}_error_pct"] = out[-1]["E_pct"]
                            row[f"{name}_u_val"] = line.u_val
    return out


def _assumption(moved: Moved) -> dict[str, Any]:
    """One assumption with its effect at the case's own operating point."""
    item = moved.unknown
    loads = {key: [float(run[key][0]) for run in moved.runs] for key in ("thrust_N", "torque_Nm")}
    us = {f"u_{key}": float(moved.u[key][0]) for key in loads}
    return {
        "key": item.key, "nominal": item.nominal, "values": list(item.values), "discrete": item.discrete,
        "range": item.range_text, "why": item.why, **loads, **us,
    }  # fmt: skip


def _description(case: Case, ready: Model | PairModel, stations: int) -> dict[str, Any]:
    air = case.air()
    return {
        "rpm": case.rpm, "airspeed_m_s": case.airspeed_m_s, "angle_deg": case.angle_deg, "density_kg_m3": air.rho,
        "temperature_C": air.temperature_K - 273.15, "a_sound_m_s": air.a_sound, "air": air.source,
        "diameter_m": ready.diameter_m, "hub_diameter_m": ready.hub_diameter_m, "blades": case.file.rotor.blades,
        "pitch_075R_m": ready.pitch_m, "solidity": ready.solidity, "stations": stations,
        "effects": [effects.to_text(effect) for effect in ready.effects], "n_crit": case.file.model.n_crit,
        "drag_level": case.file.model.drag_level,
        "convention": "CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5)",
    }  # fmt: skip


def _pair(case: Case, nominal: Dataset) -> dict[str, Any]:
    """What a second rotor adds, at the case's own operating point."""
    told = case.file.second_rotor
    assert told is not None  # the caller asks for a pair
    names = ("lower_rpm", *LOADS, *RATIOS)
    return {
        "z_over_D": told.spacing_m(case.diameter_m) / case.diameter_m, "turns": told.turns,
        "rotor": told.label or told.case or "as the first",
    } | {key: nominal[key][0] for key in names} | {f"u_{key}": nominal.u[key][0] for key in names[1:]}  # fmt: skip


def _fan(case: Case, ready: Model, nominal: Dataset) -> dict[str, Any]:
    """What a duct adds, at the case's own operating point."""
    rho, v = float(nominal.density_kg_m3[0]), float(nominal.exhaust_speed_m_s[0])
    annulus = math.pi / 4.0 * (ready.diameter_m**2 - ready.hub_diameter_m**2)
    return {
        "rotor_thrust_N": nominal.rotor_thrust_N[0],
        "duct_thrust_N": nominal.duct_thrust_N[0],
        "stator_thrust_N": nominal.stator_thrust_N[0],
        "duct_share": nominal.duct_share[0],
        "exhaust_speed_m_s": v,
        "u_exhaust_speed_m_s": nominal.u["exhaust_speed_m_s"][0],
        "mass_flow_kg_s": nominal.mass_flow_kg_s[0],
        "annulus_area_m2": annulus,
        "exit_area_m2": ready.exit_area_m2,
        "exit_momentum_N": rho * ready.exit_area_m2 * v * (v - case.airspeed_m_s),
        "annulus_solidity": ready.solidity * (math.pi / 4.0 * ready.diameter_m**2) / annulus,
        "geometric_pitch_speed_m_s": ready.pitch_m * case.rpm / 60.0,
    }

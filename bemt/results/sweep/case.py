"""One case of a sweep: BEMT and K1/K2 beside the recorded values, with uncertainties.

Uncertainty after ASME V&V 20: E = S - D, u_val^2 = u_num^2 + u_input^2 + u_model^2 + u_D^2; the model's three parts are
those of `bemt.rotors.case.propagate`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bemt import __version__
from bemt.base import plugins, units
from bemt.base.arrays import Array
from bemt.physics import effects
from bemt.physics.dataset import Dataset
from bemt.results.sweep.rows import (
    ROW_SOURCES,
    AssumptionRow,
    CaseConditions,
    Comparison,
    Fan,
    FullThrottle,
    PairResult,
    Result,
    Row,
    Stated,
)
from bemt.rotors.case import Case
from bemt.rotors.case.propagate import BANDED, Moved, Points, Propagated, prepared, propagate, vary
from bemt.rotors.validity import serious

if TYPE_CHECKING:
    from bemt.data.readers.references import Reference
    from bemt.data.recordings.audit import Audit
    from bemt.physics.bem.coaxial import PairModel
    from bemt.physics.bem.model import Model

COMPARED = {
    "thrust_N": "N", "torque_Nm": "N m", "power_W": "W", "exhaust_speed_m_s": "m/s", "duct_share": "-", "CT": "-",
    "CP": "-",
}  # fmt: skip
"""Channels that are compared, with their units."""


def _points(case: Case, refs: Sequence[Reference]) -> list[tuple[float, float, float]]:
    """Distinct operating points (rpm, airspeed, density): the case's own first, then those of its references."""
    own = (case.rpm, case.airspeed_m_s, case.air().rho)
    return list(dict.fromkeys([own, *((r.rpm, r.airspeed_m_s, r.density_kg_m3) for r in refs)]))


def _runs(case: Case) -> list[tuple[str, Dataset]]:
    """CFD runs of a case; those of one condition on several grids as one study."""
    if not case.run_paths:
        return []
    from bemt.data.recordings.grids import merged
    from bemt.data.recordings.load import import_file

    return [(d.file, d) for d in merged([import_file(path) for path in case.run_paths])]


def _studies(runs: Sequence[tuple[str, Dataset]]) -> tuple[dict[str, Any], ...]:
    if not runs:
        return ()
    from bemt.data.recordings.cfd_run import is_run

    return tuple(s.document() for _, d in runs if is_run(d) for s in d.studies)


def _references(case: Case, runs: Sequence[tuple[str, Dataset]]) -> list[Reference]:
    """Recorded values: references and CFD runs in the case's folder; open conditions filled in from the case."""
    own = {"rpm": case.rpm, "airspeed_m_s": case.airspeed_m_s, "density_kg_m3": case.air().rho}
    read: list[Reference] = []
    if case.references_path is not None:
        from bemt.data.readers import references

        read += references.read(case.references_path)
    for path, run in runs:
        from bemt.data.recordings.cfd_setup import references_of

        read += references_of(run, path)
    return [replace(r, **{k: v for k, v in own.items() if math.isnan(getattr(r, k))}) for r in read]  # type: ignore[arg-type]


def _row(source: str, label: str, thrust_N: float, **more: Any) -> Row:
    return Row(source, label, thrust_N, thrust_N / units.KGF, **more)


def _part(values: Dataset, origin: str, channel: str, at: int) -> float:
    """Standard uncertainty from one origin at a point, zero where the model has none."""
    found = values.u_by.get(origin, {}).get(channel)
    return 0.0 if found is None else float(found[at])


def _compare(model: str, values: Dataset, at: int, channel: str, row: Row, u_D: float) -> Comparison | None:
    """One model at a point against one recorded value."""
    recorded = getattr(row, channel)
    if channel not in values or recorded is None or math.isnan(recorded):
        return None
    S = float(values[channel][at])
    if model == "k1k2" and math.isnan(S):  # oblique flow
        return None
    u_num, u_input, u_model = (_part(values, origin, channel, at) for origin in ("numerics", "input", "model"))
    doubts = tuple(serious(values.flags[at]))
    return Comparison(model, row.label, row.source, channel, COMPARED[channel], S, recorded, u_num, u_input,
                      u_model, u_D, doubts, row.rpm, row.airspeed_m_s, row.density_kg_m3)  # fmt: skip


def _formula(case: Case, at: Points) -> tuple[Dataset, Dataset]:
    """K1/K2 at the points, and its thrust with the band over the declared unknowns."""
    from bemt.rotors.case.prepare import k1k2_case

    def area(changed: Case, _: str = "") -> dict[str, Array]:
        found = k1k2_case(changed, None, *at.conditions(changed), at.angles(changed))
        return {"thrust_N": found.thrust_N, "CT": found.CT}

    simple = k1k2_case(case, None, *at.conditions(case), at.angles(case))
    nominal = {"thrust_N": simple.thrust_N, "CT": simple.CT}
    moved = vary(case, nominal, area)
    u = simple.u_thrust_N  # unknown in flight and in a duct
    parts = {
        "input": {key: np.sqrt(np.sum([one.u[key] ** 2 for one in moved] or [0.0 * v], axis=0))
                  for key, v in nominal.items()},
        "model": {"thrust_N": u, "CT": u * simple.CT / simple.thrust_N},
    }  # fmt: skip
    return simple, Dataset("k1k2", case.name, nominal, flags=simple.flags, u_by=parts)


def _bemt_row(case: Case, found: Propagated, i: int, state: Mapping[str, float]) -> Row:
    """Row of the rotor's own model at point `i`."""
    nominal, nan = found.points, math.nan
    runs = [nominal.thrust_N[i], *(run["thrust_N"][i] for one in found.moved for run in one.runs)]
    return _row(
        "bemt", "bemt", nominal.thrust_N[i], torque_Nm=nominal.torque_Nm[i], power_W=nominal.power_W[i],
        CT=nominal.CT[i], CP=nominal.CP[i], u=nominal.u_thrust_N[i],
        u_num=_part(nominal, "numerics", "thrust_N", i), u_input=_part(nominal, "input", "thrust_N", i),
        u_model=_part(nominal, "model", "thrust_N", i), thrust_N_range=(np.fmin.reduce(runs), np.fmax.reduce(runs)),
        exhaust_speed_m_s=nominal.exhaust_speed_m_s[i] if case.ducted else nan,
        duct_share=nominal.duct_share[i] if case.ducted else nan, converged=bool(nominal.converged[i]),
        H_force_N=nominal.H_force_N[i] if "H_force_N" in nominal else nan,
        upper_thrust_N=nominal.upper_thrust_N[i] if case.paired else nan,
        lower_thrust_N=nominal.lower_thrust_N[i] if case.paired else nan,
        J=nominal.J[i], flags=tuple(nominal.flags[i]), **state,
    )  # fmt: skip


def solve_case(case: Case, threads: int = 1, progress: Callable[[int, int, str], None] | None = None) -> Result:
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
        model = prepared(off).at_speeds(*at.conditions(off))
        less = model.dataset(*at.solve(model, off, threads))

    rows: list[Row] = []
    variants: list[Row] = []
    for i, (w, v, rho) in enumerate(points):
        state = {"rpm": w, "airspeed_m_s": v, "density_kg_m3": rho, "M_tip": nominal.M_tip[i], "Re": nominal.Re75[i],
                 "angle_deg": case.angle_deg}  # fmt: skip
        rows.append(_bemt_row(case, found, i, state))
        rows.append(_row(
            "k1k2", "k1k2", simple.thrust_N[i], CT=simple.CT[i], u=simple.u_thrust_N[i], J=simple.J[i],
            u_input=_part(fit, "input", "thrust_N", i), flags=tuple(simple.flags[i]), **(state | {"Re": math.nan}),
        ))  # fmt: skip
        if less is not None:
            variants.append(_row(
                "bemt", "bemt variant", less.thrust_N[i], torque_Nm=less.torque_Nm[i],
                power_W=less.power_W[i], CT=less.CT[i], CP=less.CP[i], J=less.J[i],
                converged=bool(less.converged[i]),
                flags=(f"variant without {', '.join(without)}", *less.flags[i]), **state,
            ))  # fmt: skip
    recorded = _recorded_rows(case, refs, ready.diameter_m, points, nominal)
    models = {"bemt": nominal, "k1k2": fit}
    if less is not None:
        flags = tuple(tuple(dict.fromkeys((*a, *b))) for a, b in zip(less.flags, nominal.flags, strict=True))
        models["bemt variant"] = replace(less, u={}, flags=flags, u_by={"numerics": {k: math.nan for k in BANDED}})
    beside, comparisons = _comparisons(recorded, models)
    drive = plugins.part("drive", case)
    return Result(
        case.name, case.title, case.kind, case.file.origin, __version__,
        rows=(*rows, *(r for r in beside if r.source in ROW_SOURCES)), variants=tuple(variants),
        other_rows=tuple(r for r in beside if r.source not in ROW_SOURCES), comparisons=tuple(comparisons),
        audit=_audits(recorded, beside, ready, case.ducted),
        grid_studies=_studies(computed),
        conditions=_description(case, ready, case.file.model.stations),
        assumptions=tuple(map(_assumption, found.moved)),
        references=tuple(Stated(r.quantity, r.kind, r.printed, r.value, r.u, r.channel, r.source, r.remark)
                         for r in refs),
        drive=None if drive is None else FullThrottle.from_document(drive),
        fan=None if case.paired or not case.ducted else _fan(case, cast("Model", ready), nominal),
        pair=_pair(case, nominal) if case.paired else None,
        no_check=case.as_built().no_check or None,
        notes=(*([case.file.notes.strip()] if case.file.notes else []), *ready.notes,
               *plugins.missing_for(case)),
    )  # fmt: skip


Recorded = tuple[Row, int, dict[str, float], Mapping[str, Any]]
"""Recorded value, its operating point, the standard uncertainty of each channel, and the set-up of a CFD run."""


def _recorded_rows(
    case: Case, refs: list[Reference], diameter: float, points: list[tuple[float, float, float]], nominal: Dataset,
) -> list[Recorded]:  # fmt: skip
    """Rows of all recorded values, coefficients derived."""
    if not refs:
        return []
    from bemt.data.readers.references import to_series

    rows = []
    known_by = {r.where: r for r in reversed(refs)}  # thrust comes first
    for group in to_series(refs, case.name):
        full = group.derive(diameter)
        for i in range(len(full)):
            get = {k: float(full[k][i]) for k in full.values}
            at = points.index((full.rpm[i], full.airspeed_m_s[i], full.density_kg_m3[i]))
            u = {k: float(full.u[k][i]) for k in full.values}
            first = known_by[full.labels[i]]
            known = {k: get.get(k, math.nan) for k in (*COMPARED, "rpm", "airspeed_m_s", "density_kg_m3")}
            file = f" {first.source}" if first.setup else ""  # a CFD run
            row = _row(group.kind, f"{group.kind}{file} {first.printed}", known.pop("thrust_N"), **known,
                       M_tip=nominal.M_tip[at], Re=nominal.Re75[at], u=u.get("thrust_N", math.nan),
                       origin=str(full.provenance.get("source", "")),
                       remark=str(full.provenance.get("remark", "")))  # fmt: skip
            rows.append((row, at, u, first.setup))
    return rows


def _comparisons(recorded: list[Recorded], models: Mapping[str, Dataset]) -> tuple[list[Row], list[Comparison]]:
    """Every model against every recorded value; the error on thrust also goes into the recorded row."""
    rows, out = [], []
    for row, at, u_D, _ in recorded:
        errors: dict[str, Any] = {}
        measured = {r for r in COMPARED if not math.isnan(getattr(row, r))}
        measured -= {"CT"} if "thrust_N" in measured else set()
        measured -= {"CP", "power_W"} if "torque_Nm" in measured else set()
        for name, model in models.items():
            for channel in COMPARED:
                if channel in measured:
                    line = _compare(name, model, at, channel, row, u_D.get(channel, math.nan))
                    if line is not None:
                        out.append(line)
                        if channel == "thrust_N" and name in ROW_SOURCES:
                            errors |= {f"{name}_error_pct": line.E_pct, f"{name}_u_val": line.u_val}
        rows.append(replace(row, **errors))
    return rows, out


def _audits(
    recorded: Sequence[Recorded], rows: Sequence[Row], ready: Model | PairModel, ducted: bool
) -> tuple[Audit, ...]:  # fmt: skip
    """Audit of every recorded CFD value; points of one run that say the same are told once, by its file."""
    out: dict[tuple[str, ...], Audit] = {}
    for row, (*_, setup) in zip(rows, recorded, strict=True):
        if row.source == "cfd":
            found = _audit(row, setup, ready, ducted)
            file = f"{row.source} {row.origin}"
            key = (file, *(f"{line.topic} {line.status}" for line in found.lines)) if setup else (str(len(out)),)
            out.setdefault(key, replace(found, reference=file) if setup and not _named(out.values(), file) else found)
    return tuple(out.values())


def _named(audits: Iterable[Audit], reference: str) -> bool:
    return any(a.reference == reference for a in audits)


def _audit(row: Row, setup: Mapping[str, Any], ready: Model | PairModel, ducted: bool) -> Audit:
    """Audit of a recorded CFD value by its set-up, else by its remark."""
    from bemt.data.recordings.audit import Audit, facts_of, setup_in

    D = ready.diameter_m
    stated = setup or setup_in(row.remark or "")
    facts = facts_of(stated.get, False, M_tip=float(row.M_tip), CT=row.CT, ducted=ducted,
                     J=row.airspeed_m_s / (row.rpm / 60.0 * D), pitch_over_D=ready.pitch_m / D)  # fmt: skip
    return Audit.of(row.label, facts)


def _assumption(moved: Moved) -> AssumptionRow:
    """One assumption with its effect at the case's own operating point."""
    item = moved.unknown
    T, Q = (tuple(float(run[key][0]) for run in moved.runs) for key in ("thrust_N", "torque_Nm"))
    us = (float(moved.u[key][0]) for key in ("thrust_N", "torque_Nm"))
    return AssumptionRow(item.key, item.nominal, item.values, item.discrete, item.range_text, item.why, T, Q, *us)


def _description(case: Case, ready: Model | PairModel, stations: int) -> CaseConditions:
    air = case.air()
    return CaseConditions(
        rpm=case.rpm, airspeed_m_s=case.airspeed_m_s, angle_deg=case.angle_deg, density_kg_m3=air.rho,
        temperature_C=air.temperature_K - 273.15, a_sound_m_s=air.a_sound, air=air.source,
        diameter_m=ready.diameter_m, hub_diameter_m=ready.hub_diameter_m, blades=case.file.rotor.blades,
        pitch_075R_m=ready.pitch_m, solidity=ready.solidity, stations=stations,
        effects=tuple(effects.to_text(effect) for effect in ready.effects), n_crit=case.file.model.n_crit,
        drag_level=case.file.model.drag_level,
    )  # fmt: skip


def _pair(case: Case, nominal: Dataset) -> PairResult:
    """What a second rotor adds, at the case's own operating point."""
    from bemt.physics.bem.coaxial import LOADS, RATIOS

    told = case.file.second_rotor
    assert told is not None  # the caller asks for a pair
    names = ("lower_rpm", *LOADS, *RATIOS)
    loads = {key: nominal[key][0] for key in names} | {f"u_{key}": nominal.u[key][0] for key in names[1:]}
    z_over_D = told.spacing_m(case.diameter_m) / case.diameter_m
    return PairResult(z_over_D, told.turns, told.label or told.case or "as the first", **loads)


def _fan(case: Case, ready: Model, nominal: Dataset) -> Fan:
    """What a duct adds, at the case's own operating point."""
    rho, v = float(nominal.density_kg_m3[0]), float(nominal.exhaust_speed_m_s[0])
    annulus = math.pi / 4.0 * (ready.diameter_m**2 - ready.hub_diameter_m**2)
    loads = ("rotor_thrust_N", "duct_thrust_N", "stator_thrust_N", "duct_share", "mass_flow_kg_s")
    return Fan(
        **{name: float(nominal[name][0]) for name in loads}, exhaust_speed_m_s=v,
        u_exhaust_speed_m_s=nominal.u_exhaust_speed_m_s[0], annulus_area_m2=annulus,
        exit_area_m2=ready.exit_area_m2, exit_momentum_N=rho * ready.exit_area_m2 * v * (v - case.airspeed_m_s),
        annulus_solidity=ready.solidity * (math.pi / 4.0 * ready.diameter_m**2) / annulus,
        geometric_pitch_speed_m_s=ready.pitch_m * case.rpm / 60.0,
    )  # fmt: skip

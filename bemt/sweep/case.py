"""One case of a sweep: BEMT and K1/K2 beside the recorded values, with uncertainties, as a plain document.

Uncertainty after ASME V&V 20: E = S - D, u_val^2 = u_num^2 + u_input^2 + u_model^2 + u_D^2. u_num is the change of the
result when the blade elements are doubled. u_input moves one declared assumption at a time through its range, taken as
uniform: with the results at both ends and in the middle on a parabola, the variance is s^2/3 + 4 q^2/45 (half
difference s, sagitta q), which is (high - low)/sqrt(12) times the slope when the response is straight. u_model is what
measured propellers of such a description differ from the solver by (`bemt.rotors`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt import __version__, effects
from bemt.air import air_arrays
from bemt.base import units
from bemt.case import Assumption, Case
from bemt.drive.drive_result import full_document
from bemt.readers import references as reference_file
from bemt.recordings import audit_remarks
from bemt.sweep.agreement import agreement
from bemt.sweep.model_error import beyond, u_model

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.dataset import Dataset

ROW_SOURCES = ("bemt", "k1k2", "cfd", "bench", "vendor")
COMPARED = {
    "thrust_N": "N", "torque_Nm": "N m", "power_W": "W", "exhaust_speed_m_s": "m/s", "duct_share": "-", "CT": "-",
    "CP": "-",
}  # fmt: skip
"""Channels that are compared, with their units."""
PROPAGATED = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "exhaust_speed_m_s", "duct_share")

Array = NDArray[np.float64]
Conditions = tuple[Array, Array, "Air"]


def _points(case: Case, refs: Sequence[reference_file.Reference]) -> list[tuple[float, float, float]]:
    """Distinct operating points (rpm, airspeed, density): the case's own first, then those of its references."""
    own = (case.rpm, case.airspeed_m_s, case.air().rho)
    return list(dict.fromkeys([own, *((r.rpm, r.airspeed_m_s, r.density_kg_m3) for r in refs)]))


def _conditions(case: Case, points: Sequence[tuple[float, float, float]], changed: Case) -> Conditions:
    """Conditions of the points in a changed case: what a point shares with the case follows the change."""
    own = (case.rpm, case.airspeed_m_s, case.air().rho)
    now, air = (changed.rpm, changed.airspeed_m_s), changed.air()
    rpm, speed = (np.array([now[i] if p[i] == own[i] else p[i] for p in points]) for i in (0, 1))
    airs = [air if p[2] == own[2] else changed.air({"air.density_kg_m3": p[2]}) for p in points]
    return rpm, speed, air_arrays(airs, np.arange(len(airs)))


def _references(case: Case) -> list[reference_file.Reference]:
    """Recorded values, open conditions filled in from the case."""
    if case.references_path is None:
        return []
    own = {"rpm": case.rpm, "airspeed_m_s": case.airspeed_m_s, "density_kg_m3": case.air().rho}
    read = reference_file.read(case.references_path)
    return [replace(r, **{k: v for k, v in own.items() if math.isnan(getattr(r, k))}) for r in read]  # type: ignore[arg-type]


def spread(discrete: bool, nominal: Array, at: Sequence[Array]) -> Array:
    """Give the standard uncertainty from one assumption, (P,)."""
    if discrete:
        return np.asarray(np.std(np.subtract(at, nominal), axis=0))  # equal values have no spread, to the last bit
    low, high = at
    slope, sag = 0.5 * (high - low), 0.5 * (high + low) - nominal
    return np.asarray(np.sqrt(slope**2 / 3.0 + 4.0 * sag**2 / 45.0))


class _Model:
    """Nominal, refined and assumption runs of one model over all conditions."""

    def __init__(
        self, nominal: dict[str, Array], refined: dict[str, Array] | None, u_model: Mapping[str, Array] | None = None
    ) -> None:
        self.nominal = nominal
        zero = {k: np.zeros_like(v) for k, v in nominal.items()}
        self.u_num = zero if refined is None else {k: np.abs(refined[k] - v) for k, v in nominal.items()}
        self.u_model = {k: (u_model or {}).get(k, zero[k]) for k in nominal}
        self.low = {k: v.copy() for k, v in nominal.items()}
        self.high = {k: v.copy() for k, v in nominal.items()}
        self.variance = {k: np.zeros_like(v) for k, v in nominal.items()}
        self.by_assumption: list[dict[str, Any]] = []

    def add(self, assumption: Assumption, runs: Sequence[dict[str, Array] | None]) -> None:
        """Take in the runs at the values of one assumption (None at the nominal value)."""
        at = {k: [v if run is None else run[k] for run in runs] for k, v in self.nominal.items()}
        u = {k: spread(assumption.discrete, v, at[k]) for k, v in self.nominal.items()}
        for k in self.nominal:
            self.variance[k] = self.variance[k] + u[k] ** 2
            for values in at[k]:
                self.low[k] = np.fmin(self.low[k], values)
                self.high[k] = np.fmax(self.high[k], values)
        self.by_assumption.append({"u": u, "at": at})

    def u_input(self, channel: str) -> Array:
        """Give the standard uncertainty from all assumptions together."""
        return np.asarray(np.sqrt(self.variance[channel]))

    def u(self, channel: str) -> Array:
        """Give the standard uncertainty of the result: inputs, numerics, the model's own error."""
        return np.asarray(np.sqrt(self.variance[channel] + self.u_num[channel] ** 2 + self.u_model[channel] ** 2))


def _channels(points: Dataset) -> dict[str, Array]:
    return {name: np.asarray(getattr(points, name), dtype=float) for name in PROPAGATED}


def _row(source: str, label: str, thrust_N: float, **more: Any) -> dict[str, Any]:
    head = {"source": source, "label": label, "thrust_N": thrust_N, "thrust_kgf": thrust_N / units.KGF}
    names = ("torque_Nm", "power_W", "CT", "CP", "rpm", "airspeed_m_s", "density_kg_m3", "M_tip", "Re", "u")
    rest: dict[str, Any] = {**dict.fromkeys(names), "flags": []}
    return head | rest | more


def _compare(
    model: str, values: _Model, at: int, channel: str, row: Mapping[str, Any], u_D: float
) -> dict[str, Any] | None:
    """One line of the validation: model minus recording, beside its uncertainty."""
    recorded = row.get(channel)
    if channel not in values.nominal or recorded is None or math.isnan(recorded):
        return None
    S = float(values.nominal[channel][at])
    E, u_num, u_input = S - recorded, float(values.u_num[channel][at]), float(values.u_input(channel)[at])
    u_model = float(values.u_model[channel][at])
    u_val = math.sqrt(u_num**2 + u_input**2 + u_model**2 + u_D**2)
    line = {
        "model": model, "reference": row["label"], "source": row["source"], "quantity": channel,
        "unit": COMPARED[channel], "S": S, "D": recorded, "E": E, "E_pct": 100.0 * E / recorded if recorded else None,
        "u_num": u_num, "u_input": u_input, "u_model": u_model, "u_D": u_D, "u_val": u_val,
    }  # fmt: skip
    return line | {"verdict": agreement(line)}


def _tip_flags(mach: float) -> list[str]:
    return [f"tip Mach {mach:.2f}: supersonic, beyond what section theory covers"] if mach >= 1.0 else []


def solve_case(case: Case, threads: int = 1, progress: Callable[[int, int, str], None] | None = None) -> dict[str, Any]:
    """Solve one case at its operating points and put everything recorded beside it."""
    from bemt.case.prepare import k1k2_case, prepare_case

    refs = _references(case)
    points = _points(case, refs)
    steps = 3 + sum(len(a.values) for a in case.assumptions)
    done = 0

    def run(changed: Case, stations: int | None = None, what: str = "") -> tuple[Any, Dataset]:
        nonlocal done
        at = _conditions(case, points, changed)
        ready = prepare_case(changed, None, stations).at_speeds(*at)
        result = ready.solve(*at, threads)
        done += 1
        if progress is not None:
            progress(done, steps, what)
        return ready, result

    def formula(changed: Case) -> Dataset:
        return k1k2_case(changed, None, *_conditions(case, points, changed))

    ready, nominal = run(case, what="nominal")
    stations = case.file.model.stations
    _, refined = run(case, 2 * stations, "twice the stations")
    extrapolated = beyond(case, nominal)[1]
    own_error = u_model(case, ready, nominal, _conditions(case, points, case)[2])
    bemt = _Model(_channels(nominal), _channels(refined), own_error)
    simple = formula(case)
    area = {"thrust_N": simple.thrust_N, "CT": simple.CT}
    u = simple.u["thrust_N"]  # unknown in flight and in a duct
    fit = _Model(area, None, {"thrust_N": u, "CT": u * simple.CT / simple.thrust_N})
    for assumption in case.assumptions:
        runs: list[dict[str, Array] | None] = []
        fits: list[dict[str, Array] | None] = []
        for option in assumption.values:
            if option == assumption.nominal:
                runs.append(None)
                fits.append(None)
                continue
            changed = case.replaced({assumption.key: option})
            runs.append(_channels(run(changed, what=assumption.key)[1]))
            other = formula(changed)
            fits.append({"thrust_N": other.thrust_N, "CT": other.CT})
        bemt.add(assumption, runs)
        fit.add(assumption, fits)
    without = case.file.model.also_without
    off = {"model.effects_off": (*case.file.model.effects_off, *without)}
    less = run(case.replaced(off))[1] if without else None

    rows: list[dict[str, Any]] = []
    variants: list[dict[str, Any]] = []
    for i, (w, v, rho) in enumerate(points):
        state = {"rpm": w, "airspeed_m_s": v, "density_kg_m3": rho, "M_tip": nominal.M_tip[i], "Re": nominal.Re75[i]}
        flags = [*nominal.flags[i], *_tip_flags(float(nominal.M_tip[i])), *filter(None, [extrapolated[i]])]
        if np.isnan(bemt.u("thrust_N")[i]) and nominal.converged[i]:
            flags.append("unconverged somewhere in the range of the assumptions: u unknown")
        rows.append(_row(
            "bemt", "bemt", nominal.thrust_N[i], torque_Nm=nominal.torque_Nm[i], power_W=nominal.power_W[i],
            CT=nominal.CT[i], CP=nominal.CP[i], u=bemt.u("thrust_N")[i], u_num=bemt.u_num["thrust_N"][i],
            u_input=bemt.u_input("thrust_N")[i], u_model=bemt.u_model["thrust_N"][i],
            thrust_N_range=[bemt.low["thrust_N"][i], bemt.high["thrust_N"][i]],
            exhaust_speed_m_s=nominal.exhaust_speed_m_s[i] if case.ducted else None,
            duct_share=nominal.duct_share[i] if case.ducted else None, converged=bool(nominal.converged[i]),
            J=nominal.J[i], flags=flags, **state,
        ))  # fmt: skip
        rows.append(_row(
            "k1k2", "k1k2", simple.thrust_N[i], CT=simple.CT[i], u=simple.u["thrust_N"][i], J=simple.J[i],
            u_input=fit.u_input("thrust_N")[i], flags=list(simple.flags[i]), **(state | {"Re": None}),
        ))  # fmt: skip
        if less is not None:
            variants.append(_row(
                "bemt", "bemt variant", less.thrust_N[i], torque_Nm=less.torque_Nm[i],
                power_W=less.power_W[i], CT=less.CT[i], CP=less.CP[i], J=less.J[i],
                converged=bool(less.converged[i]),
                flags=[f"variant without {', '.join(without)}", *less.flags[i]], **state,
            ))  # fmt: skip
    recorded = _recorded_rows(case, refs, ready.diameter_m, points, nominal)
    models = {"bemt": bemt, "k1k2": fit}
    if less is not None:
        models["bemt variant"] = _Model(_channels(less), {k: np.full(len(points), np.nan) for k in PROPAGATED})
    comparisons = _comparisons(recorded, models)
    return {
        "name": case.name, "title": case.title, "kind": case.kind, "origin": case.file.origin, "version": __version__,
        "rows": rows + [r for r in recorded if r["source"] in ROW_SOURCES],
        "variants": variants,
        "other_rows": [r for r in recorded if r["source"] not in ROW_SOURCES],
        "comparisons": comparisons,
        "audit": audit_remarks.audit_rows(recorded, ready.diameter_m, ready.pitch_m, case.ducted),
        "conditions": _description(case, ready, stations),
        "assumptions": [_assumption(a, m) for a, m in zip(case.assumptions, bemt.by_assumption, strict=True)],
        "references": [{"quantity": r.quantity, "kind": r.kind, "printed": r.printed, "value": r.value, "u": r.u,
                        "channel": r.channel, "source": r.source, "remark": r.remark} for r in refs],
        "drive": full_document(case),
        "fan": _fan(case, ready, nominal, bemt) if case.ducted else None,
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
    printed = {r.where: r.printed for r in refs}
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


def _comparisons(recorded: list[dict[str, Any]], models: Mapping[str, _Model]) -> list[dict[str, Any]]:
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
                        out.append(line)
                        if channel == "thrust_N" and name in ROW_SOURCES:
                            row[f"{name}_error_pct"] = line["E_pct"]
                            row[f"{name}_u_val"] = line["u_val"]
    return out


def _assumption(assumption: Assumption, model: Mapping[str, Any]) -> dict[str, Any]:
    """One assumption with its effect at the case's own operating point."""
    return {
        "key": assumption.key, "nominal": assumption.nominal, "values": list(assumption.values),
        "discrete": assumption.discrete, "range": assumption.range_text, "why": assumption.why,
        "thrust_N": [float(v[0]) for v in model["at"]["thrust_N"]], "u_thrust_N": float(model["u"]["thrust_N"][0]),
        "torque_Nm": [float(v[0]) for v in model["at"]["torque_Nm"]], "u_torque_Nm": float(model["u"]["torque_Nm"][0]),
    }  # fmt: skip


def _description(case: Case, ready: Any, stations: int) -> dict[str, Any]:
    air = case.air()
    return {
        "rpm": case.rpm, "airspeed_m_s": case.airspeed_m_s, "density_kg_m3": air.rho,
        "temperature_C": air.temperature_K - 273.15, "a_sound_m_s": air.a_sound, "air": air.source,
        "diameter_m": ready.diameter_m, "hub_diameter_m": ready.hub_diameter_m, "blades": case.file.rotor.blades,
        "pitch_075R_m": ready.pitch_m, "solidity": ready.solidity, "stations": stations,
        "effects": [effects.to_text(effect) for effect in ready.effects], "n_crit": case.file.model.n_crit,
        "drag_level": case.file.model.drag_level,
        "convention": "CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5)",
    }  # fmt: skip


def _fan(case: Case, ready: Any, nominal: Dataset, bemt: _Model) -> dict[str, Any]:
    """What a duct adds, at the case's own operating point."""
    rho, v = float(nominal.density_kg_m3[0]), float(nominal.exhaust_speed_m_s[0])
    annulus = math.pi / 4.0 * (ready.diameter_m**2 - ready.hub_diameter_m**2)
    return {
        "rotor_thrust_N": nominal.rotor_thrust_N[0],
        "duct_thrust_N": nominal.duct_thrust_N[0],
        "stator_thrust_N": nominal.stator_thrust_N[0],
        "duct_share": nominal.duct_share[0],
        "exhaust_speed_m_s": v,
        "u_exhaust_speed_m_s": bemt.u("exhaust_speed_m_s")[0],
        "mass_flow_kg_s": nominal.mass_flow_kg_s[0],
        "annulus_area_m2": annulus,
        "exit_area_m2": ready.exit_area_m2,
        "exit_momentum_N": rho * ready.exit_area_m2 * v * (v - case.airspeed_m_s),
        "annulus_solidity": ready.solidity * (math.pi / 4.0 * ready.diameter_m**2) / annulus,
        "geometric_pitch_speed_m_s": ready.pitch_m * case.rpm / 60.0,
    }

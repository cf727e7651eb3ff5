"""From a recording to an honest `Dataset`: steady points with uncertainties, and everything that was left out.

In this order: the rows are told to be samples or points (``points``); samples are cut into ``plateaus`` (start-up,
settling, outliers); rows at rest give the zero that is subtracted, linear in time, whose uncertainty all points of a
run share; the air is found (a density, else pressure and temperature; nothing is assumed); coefficients follow where
diameter and density are known; ``scatter`` comes from plateaus, stated errors, repeats.

The uncertainties of the series are the UNCORRELATED part, independent from point to point. What all points share is in
`Reduction.correlated`: ``gain`` [1], ``zero`` [unit of the channel], ``session`` [1] (between runs of one condition).
Nothing is corrected but the zero, and that is said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of, some
from bemt.base.units import ZERO_CELSIUS
from bemt.data.recordings.channels import (
    LOADS,
    DroppedCells,
    asks,
    dropped,
    file_name,
    in_one_step,
    lost,
    named,
    shaft_power,
    stated,
)
from bemt.data.recordings.points import (
    TARED,
    Found,
    Point,
    command_of,
    from_rows,
    from_samples,
    is_samples,
)
from bemt.data.recordings.scatter import Hysteresis, hysteresis, repeats, session
from bemt.data.recordings.zero import TareZero, from_rest
from bemt.physics import coefficients as co
from bemt.physics.air import AIR_C, GAMMA, R_DRY, Air
from bemt.physics.dataset import Dataset


@dataclass(frozen=True, eq=False)
class Reduction:
    """How points were made of rows; `provenance["reduction"]` of what `reduce` gives."""

    mode: str  # ``samples`` or ``points``
    # By channel: ``gain`` [1], ``zero`` [unit of the channel], ``session`` [1], as far as known
    correlated: Mapping[str, Mapping[str, float]]
    dropped: tuple[DroppedCells, ...]  # Line, channel ("" for the whole row) and reason of everything that was left out
    rows: tuple[NDArray[np.intp], ...]  # (M,) rows of the recording in each point
    directions: tuple[str, ...]  # ``first``, ``up`` or ``down`` per point
    hysteresis: Mapping[str, Hysteresis]  # By channel, where both branches were recorded


def reduction(points: Dataset) -> Reduction:
    """How the points of a reduced recording were made."""
    how: Reduction = points.provenance["reduction"]
    return how


def _no_load(recording: Dataset) -> Fault:
    """Fault of a recording without a load, with what would make one of its columns a load."""
    got = "no thrust, torque, power, current or coefficient with a unit"
    got += f"; columns {some(map(repr, recording.headings.values()), 12)}" * bool(recording.headings)
    hint = "Name units in the headings or in a recording.toml" + in_one_step(recording)
    if recording.kind == "flight":
        hint = "Nothing on board weighs the thrust: give a table with thrust_N, mass times acceleration per propeller"
    elif near := [fix for q, (_, _, fix) in asks(recording).items() if q in ("thrust", "torque")]:
        hint = "; ".join([near[0][0].upper() + near[0][1:], *near[1:]])
    return Fault(recording.file or recording.name, "", got, "one of them", hint)


@np.errstate(all="ignore")  # a damaged file may hold any number; what is not finite becomes NaN or a refusal
def reduce(recording: Dataset, *, diameter_m: float | None = None, steady: bool | None = None) -> Dataset:
    """Reduce a recording to steady points: kind ``bench``, uncertainties the uncorrelated part, `reduction` of them.

    >>> values = {"rpm": [5000.0, 6000.0], "thrust_N": [4.0, 5.8], "density_kg_m3": [1.225, 1.225]}
    >>> got = reduce(Dataset("bench", "table", values), diameter_m=0.254)
    >>> reduction(got).mode, got["CT"].round(3).tolist()
    ('points', [0.113, 0.114])
    """
    name, constants = recording.file or recording.name, recording.constants
    rec = _trusted(named(recording))
    if not set(LOADS) & rec.values.keys():
        raise InputError(_no_load(recording))
    samples, reason = not steady, f"rows are taken as {'points' if steady else 'samples'}"
    if steady is None:
        samples, reason = is_samples(rec)
    found = from_samples(rec, name) if samples else from_rows(rec)
    _outliers(rec, found)
    if not found.points:
        reasons = ", ".join(sorted({gone.reason for gone in found.lost if not gone.channel}))
        got = f"no steady point in {number_of(len(rec), 'row')} ({reasons or 'no rows'})"
        raise InputError(Fault(name, "", got, "one or more"))
    values, u = _columns(found.points)
    notes = [reason, *rec.notes, *found.notes, *_shared(values, stated(rec))]
    for key, constant in (("tip_gap_m", "gap_m"), ("wall_distance_m", "wall_distance_m")):
        if key not in values and constant in constants:
            values[key] = np.full(len(found.points), constants[constant])
    correlated = _instrument(recording, rec, values, u)
    _subtract(found, values, correlated, notes)
    surroundings = air_of(values, len(found.points), constants)
    notes += surroundings.notes
    _fill_scatter(found, values, u, correlated, notes)
    diameter = diameter_m if diameter_m is not None else constants.get("diameter_m")
    series = _series(recording, found, rec, values, u, surroundings, diameter)
    loops = _hysteresis(found, values, rec, notes)
    how = Reduction(
        "samples" if samples else "points", {k: dict(v) for k, v in correlated.items() if v},
        (*dropped(rec), *found.lost), tuple(p.rows for p in found.points), tuple(p.direction for p in found.points),
        loops,
    )  # fmt: skip
    return replace(series, provenance={**series.provenance, "reduction": how}, notes=tuple(notes))


def _trusted(rec: Dataset) -> Dataset:
    """Leave out sensors that saw nothing, and a computed shaft power that its factors contradict."""
    values, notes = dict(rec.values), list(rec.notes)
    for name in ("rpm", "power_W", "electrical_power_W", "voltage_V", "current_A", "density_kg_m3"):
        v = values.get(name)
        if v is not None and np.any(np.isfinite(v)) and not np.any(np.nan_to_num(v)):
            del values[name]
            notes.append(f"{file_name(rec, name)} is 0 in every row: not measured, ignored")
    product, told = shaft_power(values), values.get("power_W")
    if product is not None and told is not None:
        size = np.abs(product)
        good = np.isfinite(size) & np.isfinite(told) & (told != 0.0)
        good &= size > 0.2 * (np.percentile(size[good], 95) if np.any(good) else 0.0)
        ratio = float(np.median(np.abs(told[good]) / size[good])) if np.count_nonzero(good) >= 3 else 1.0
        if abs(ratio - 1.0) > 0.05:
            own = file_name(rec, "power_W")
            words = f"{own} is {ratio:.4g} times torque x speed"
            if own == "mechanical_power_W":  # computed by the stand's software, no sensor of its own
                del values["power_W"]
                notes.append(f"{words}: left out; the power is taken from torque and speed")
            else:
                notes.append(f"{words}: kept as recorded, one of them is wrong")
    u = {k: v for k, v in rec.u.items() if k in values}
    return replace(rec, values=values, u=u, notes=tuple(notes))


def _columns(points: Sequence[Point]) -> tuple[dict[str, Array], dict[str, Array]]:
    keys = list(dict.fromkeys(k for p in points for k in p.values))
    values = {k: np.array([p.values.get(k, math.nan) for p in points]) for k in keys}
    u = {k: np.array([p.u.get(k, math.nan) for p in points]) for k in keys}
    return {k: v for k, v in values.items() if np.any(np.isfinite(v))}, u


def _flow(values: Mapping[str, Array]) -> Array | None:
    """Airspeed over speed; None at rest."""
    v = values.get("airspeed_m_s")
    if v is None or not np.any(np.abs(np.nan_to_num(v)) > 0.0):
        return values.get("J")
    return np.nan_to_num(v / values["rpm"] * 60.0) if "rpm" in values else None


def _outliers(rec: Dataset, found: Found) -> None:
    """Drop points that stand apart from four or more repeats of their own condition."""
    values, _ = _columns(found.points)
    if (rpm := values.get("rpm")) is None:
        return
    group = np.array([p.run for p in found.points])
    out: dict[int, str] = {}
    for name in TARED:
        if name in values:
            for i, far, n in repeats(values[name], rpm, group, _flow(values)).outliers:
                words = f"outlier: {name} is {far:.3g} robust standard deviations from the median of its {n} repeats"
                out.setdefault(i, words)
    found.lost += [entry for i, reason in out.items() for entry in lost(rec, found.points[i].rows, "", reason)]
    found.points = [p for i, p in enumerate(found.points) if i not in out]


def _shared(values: Mapping[str, Array], u: Mapping[str, Array]) -> list[str]:
    """Note stated errors that are the same at any load: they look like a zero that all rows share."""
    out = []
    for name in set(TARED) & u.keys() & values.keys():
        e, v = u[name][np.isfinite(u[name])], np.abs(values[name])
        if len(e) >= 5 and e.min() > 0.8 * e.max() > 0.0 and np.nanmax(v) > 3.0 * np.nanmin(v):
            unit = name.rsplit("_", 1)[1]
            out.append(
                f"{name}: the stated error is {np.median(e):.3g} {unit} at any load: it looks like a zero "
                "that all rows share; kept as independent"
            )
    return sorted(out)


def _instrument(
    recording: Dataset, rec: Dataset, values: Mapping[str, Array], u: dict[str, Array]
) -> dict[str, dict[str, float]]:
    """Correlated parts as stated; the sample part goes into `u` where it is larger than what is there."""
    out: dict[str, dict[str, float]] = {}
    for key in values:
        told = recording.provenance.get("instrument", {}).get(file_name(rec, key), {})
        out[key] = {part: told[part] for part in ("gain", "zero") if part in told}
        if "sample" in told:
            u[key] = np.fmax(u[key], told["sample"])
    return out


def _subtract(
    found: Found, values: dict[str, Array], correlated: dict[str, dict[str, float]], notes: list[str]
) -> None:
    """Subtract the zero of the load cells."""
    loads = [name for name in TARED if name in values]
    if not loads:
        return
    top = {name: float(np.nanmax(np.abs(values[name]))) for name in loads}

    def take(zero: TareZero, rows: NDArray[np.intp]) -> None:
        for name in loads:
            if name in zero.value:
                values[name] = values[name].copy()
                values[name][rows] -= zero.value[name]
                part = correlated[name]
                part["zero"] = math.hypot(part.get("zero", 0.0), zero.u[name])
        notes.extend(n for n in zero.notes if n.split(":")[0] in loads)

    runs = np.array([p.run for p in found.points])
    when = np.array([p.when for p in found.points])
    for run, rests in found.rests.items():
        rows = np.flatnonzero(runs == run)
        if rows.size:
            take(from_rest(when[rows], rests, top), rows)
    if not found.rests:
        notes.append("no rows with the motor off: the zero of the load cells is unknown, nothing was subtracted")
    elif bare := sorted(set(runs.tolist()) - found.rests.keys()):
        notes.append(f"runs without a motor stop, nothing subtracted: {', '.join(f'{r:g}' for r in bare)}")


def _fill_scatter(
    found: Found, values: Mapping[str, Array], u: dict[str, Array], correlated: dict[str, dict[str, float]],
    notes: list[str],
) -> None:  # fmt: skip
    """Uncertainty from repeats where a point has none, and the scatter between runs."""
    if (rpm := values.get("rpm")) is None:
        return
    run = np.array([p.run for p in found.points])
    for name in TARED:
        if name not in values:
            continue
        again = repeats(values[name], rpm, run, _flow(values))
        if again.dof >= 3 and again.scatter > 0.0:
            missing = ~np.isfinite(u[name])
            u[name] = np.where(missing, again.scatter * np.abs(values[name]), u[name])
            use = f"; taken as the uncertainty of {number_of(missing.sum(), 'point')} that state none"
            told = f"{name}: repeats scatter by {again.scatter:.2%} ({again.dof} degrees of freedom)"
            notes.append(told + (use if np.any(missing) else ""))
        between = session(values[name], rpm, run, _flow(values))
        if math.isfinite(between.scatter):
            correlated[name]["session"] = between.scatter
            words = f"{name}: runs differ by {between.scatter:.2%} at equal speed"
            notes.append(f"{words} ({number_of(between.runs, 'run')}, {number_of(between.pairs, 'common point')})")


def _with_power(series: Dataset) -> Dataset:
    """With the power of the shaft by torque and speed, which needs no diameter."""
    if "power_W" in series or not {"torque_Nm", "rpm"} <= series.values.keys():
        return series
    made = series.derive(1.0, np.full(len(series), np.nan))
    return replace(series, values={**series.values, "power_W": made["power_W"]},
                   u={**series.u, "power_W": made.u["power_W"]})  # fmt: skip


def _series(
    recording: Dataset, found: Found, rec: Dataset, values: Mapping[str, Array], u: Mapping[str, Array],
    air: AirOfPoints, diameter: float | None,
) -> Dataset:  # fmt: skip
    """Channels and derived ones, as a `Dataset`."""
    shown = {k: v for k, v in values.items() if k not in ("humidity", "electrical_rpm", "optical_rpm")}
    if len({p.run for p in found.points}) > 1 or "run" in rec.values:
        shown["run"] = np.array([p.run for p in found.points])
    if np.any(np.isfinite(air.rho)):
        shown["density_kg_m3"] = air.rho
    said = recording.provenance
    file = str(said.get("file", recording.name))
    short = file.replace("\\", "/").rsplit("/", 1)[-1]
    ends = [[rec.lines[row] for row in dict.fromkeys((p.rows[0], p.rows[-1]))] for p in found.points]
    labels = [f"{short}:{'-'.join(map(str, lines))}" for lines in ends]
    provenance = {k: v for k, v in said.items() if isinstance(v, str)}
    series = Dataset("bench", str(said.get("run_name", short)), shown, {k: v for k, v in u.items() if k in shown},
                    tuple(p.flags for p in found.points), provenance, tuple(labels))  # fmt: skip
    if diameter is None:
        return _with_power(series)
    series = series.derive(diameter, air.rho if np.any(np.isfinite(air.rho)) else None)
    return _numbers(series, air, diameter)


def _numbers(series: Dataset, air: AirOfPoints, D: float) -> Dataset:
    """Tip Mach number, figure of merit at rest, thrust per shaft power."""
    more: dict[str, Array] = {}
    u_more: dict[str, Array] = {}
    rpm = series.values.get("rpm")
    V = series.values.get("airspeed_m_s", np.zeros(len(series)))
    if rpm is not None and np.any(np.isfinite(air.a_sound)):
        more["M_tip"] = np.asarray(co.M_tip(rpm / 60.0, D, air.a_sound), dtype=float)
    if {"CT", "CP"} <= series.values.keys():
        fm = np.asarray(co.FM(series.CT, series.CP, np.nan_to_num(V)), dtype=float)
        share = np.hypot(1.5 * series.u_CT / series.CT, series.u_CP / series.CP)
        more["FM"], u_more["FM"] = fm, np.abs(fm * share)
    if {"thrust_N", "power_W"} <= series.values.keys():
        ratio = np.where(series.power_W > 0, series.thrust_N / series.power_W, np.nan)
        share = np.hypot(series.u_thrust_N / series.thrust_N, series.u_power_W / series.power_W)
        more["efficacy_N_W"], u_more["efficacy_N_W"] = ratio, np.abs(ratio * share)
    u_more = {k: np.where(np.isfinite(v), v, np.nan) for k, v in u_more.items()}
    return replace(series, values={**series.values, **more}, u={**series.u, **u_more})


def _hysteresis(found: Found, values: Mapping[str, Array], rec: Dataset, notes: list[str]) -> dict[str, Hysteresis]:
    """Down against up, for a sweep that goes up and comes down; a table in any order has no branches."""
    ways = [p.direction for p in found.points]
    turns = sum(a != b for a, b in zip(ways[1:-1], ways[2:], strict=True)) if len(ways) > 2 else 0
    if turns > 2 * len({p.run for p in found.points}) or "down" not in ways:
        return {}
    command = command_of(rec)
    key, power = ("rpm", 2.0) if "rpm" in values else (command[0] if command is not None else "", 0.0)
    if key not in values:
        return {}
    down = np.array([w == "down" for w in ways])
    top = int(np.nanargmax(np.where(np.isfinite(values[key]), values[key], -np.inf)))
    out = {}
    for name in TARED:
        if name in values:
            loop = hysteresis(values[name], values[key], ~down | (np.arange(len(ways)) == top), down, power)
            if loop is not None:
                out[name] = loop
                unit = name.rsplit("_", 1)[1]
                notes.append(
                    f"{name}: down is {loop.difference:+.3g} +- {loop.u:.2g} {unit} from up at equal {key} "
                    f"({loop.share:+.2%} of the largest, {loop.points} points)"
                )
    return out


@dataclass(frozen=True, eq=False)
class AirOfPoints:
    """Density [kg/m3] and speed of sound [m/s] of N points, NaN unknown; notes."""

    rho: Array
    a_sound: Array
    notes: tuple[str, ...] = ()


def air_of(values: Mapping[str, Array], n: int, constants: Mapping[str, float]) -> AirOfPoints:
    """Find the air of every point."""
    temperature = values.get("temperature_K", np.full(n, constants.get("temperature_K", np.nan)))
    found = None
    if "density_kg_m3" in values or "density_kg_m3" in constants:
        rho = values.get("density_kg_m3", np.full(n, constants.get("density_kg_m3", np.nan)))
        found = AirOfPoints(np.where(rho > 0.0, rho, np.nan), _sound(temperature))
    elif "pressure_Pa" in values and np.any(np.isfinite(temperature)):
        found = _moist(values, temperature)
    if found is not None and np.any(np.isfinite(found.rho)):
        return found
    ways = "give a column of it, or of pressure and temperature, or [air] in recording.toml"
    notes = (*(found.notes if found else ()), f"no density: no coefficients; {ways}")
    return AirOfPoints(np.full(n, np.nan), _sound(temperature), notes)


def _sound(temperature: Array) -> Array:
    """Speed of sound of dry air; NaN without a temperature that air of a laboratory can have."""
    low, high = (c + ZERO_CELSIUS for c in AIR_C)
    T = np.where((temperature >= low) & (temperature <= high), temperature, np.nan)
    return np.asarray(np.sqrt(GAMMA * R_DRY * T))


def _moist(values: Mapping[str, Array], temperature: Array) -> AirOfPoints:
    n = len(temperature)
    humidity = values.get("humidity", np.full(n, np.nan))
    rho, a_sound = np.full((2, n), np.nan)
    bad: list[str] = []
    for i in range(n):
        p, T, h = (float(x[i]) for x in (values["pressure_Pa"], temperature, humidity))
        if not (np.isfinite(p) and np.isfinite(T)):
            continue
        try:
            state = Air.from_state(p, T - ZERO_CELSIUS, 100.0 * h if np.isfinite(h) else 0.0)
        except InputError as error:
            bad.append(str(error.faults[0]))
            continue
        rho[i], a_sound[i] = state.rho, state.a_sound
    notes = [
        "density from pressure and temperature" + (" and humidity" if np.any(np.isfinite(humidity)) else ", dry air")
    ]
    if bad:
        notes.append(f"no density in {number_of(len(bad), 'point')}: {bad[0]}")
    return AirOfPoints(rho, a_sound, tuple(notes))

"""A series of measured or computed points becomes what a diagnosis works on: channels, conditions, covariates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.units import ZERO_CELSIUS
from bemt.data.recordings.cfd_setup import Conditions
from bemt.data.recordings.channels import without_unit
from bemt.judge.diagnose.repeats import conditions, fell, spread_sizes
from bemt.physics.air import Air
from bemt.physics.effects.base import follows
from bemt.rotors.model import air_fields, air_of_points

if TYPE_CHECKING:
    from bemt.data.recordings.findings import Finding
    from bemt.physics.dataset import Dataset
    from bemt.rotors.case import Case

T = TypeVar("T")
CHANNELS = ("thrust_N", "torque_Nm", "rpm")
"""Readings that may be explained; the speed only where a pulse width was recorded."""
STILL = 0.02
"""Advance ratio up to which a rotor is at rest: a draught is no wind [1]."""

COVARIATES = (
    "time_s", "temperature_K", "pressure_Pa", "voltage_V", "current_A", "electrical_power_W", "pwm_s", "tip_gap_m",
    "wall_distance_m", "sideslip_rad", "second_rotor_rad_s", "run",
)  # fmt: skip
"""Channels of a series, besides the conditions, that an effect may know."""

# Pulse widths from here on are the end of the range, whatever was asked for [s].
_FULL_THROTTLE = 1.9995e-3
# Share of the rows from which on exact copies are copies, not repeats that came out the same.
_COPIED = 0.2
# Speeds that differ by less are one speed, share.
_SAME_SPEED = 0.02
# Channel, lowest and highest value of a room, a sky or a pressure tunnel, hint.
_AIR_LIMITS = (
    ("temperature_K", 150.0, 400.0, "Celsius under a heading in kelvin, or no sensor connected?"),
    ("pressure_Pa", 1e3, 2.5e6, "Wrong unit in the heading?"),
)
# Noise of a thermometer: rows of a run that show it, von Neumann's ratio (2 of noise, 0 of a curve), largest size [K].
_AIR_ROWS, _AIR_RATIO, _AIR_NOISE = 12, 1.5, 0.5
# More points than this tell no more of their scatter.
_MOST_COMPARED = 2000
MAX_POINTS = 160
"""Points beyond this number are averaged with alike ones: they would cost time and add nothing. [1]"""


@dataclass(frozen=True, eq=False)
class Record:
    """P points of one recording."""

    name: str  # What was recorded
    # (P,) Speed of rotation [rev/min], axial onset speed [m/s]
    rpm: Array
    V: Array
    air: Air  # Its fields are (P,) arrays
    measured: dict[str, Array]  # (P,) thrust_N, torque_Nm, and rpm where a pulse width was recorded; NaN: not measured
    u: dict[str, Array]  # (P,) Standard uncertainty of each, uncorrelated part; NaN: unknown
    extra: dict[str, Array] = field(default_factory=dict)  # (P,) Covariates of :data:`COVARIATES` that were recorded
    # Correlated standard uncertainty of a channel: share of the value [1], in its unit
    gain: Mapping[str, float] = field(default_factory=dict)
    zero: Mapping[str, float] = field(default_factory=dict)
    air_recorded: bool = False  # Whether density, or pressure and temperature, came with the recording
    notes: tuple[str, ...] = ()  # What was assumed or dropped
    # Known to be without the cause that is looked for: shows how far model and stand differ anyway
    reference: bool = False
    # What looks wrong in the file before any physics, the file named in front; nothing was corrected
    findings: tuple[str, ...] = ()
    contradictions: tuple[Finding, ...] = ()  # Those of them that cannot be so
    # Standard deviation of what runs of this stand differ by, a share, as stated; NaN: not stated [1]
    repeatability: float = np.nan
    electrical: bool = False  # Whether torque is electrical power over the indicated speed
    top_rpm: float = np.inf  # Fastest that the stand may run [rev/min]
    computed: bool = False  # Whether the points are those of CFD
    setup: Conditions = field(default_factory=dict)  # How they were computed, as far as it is stated
    declared: Mapping[str, float] = field(default_factory=dict)  # Unit of the heading, by channel [its own unit]
    unitless: frozenset[str] = frozenset()  # Loads that are known by their coefficients alone
    whole: Dataset | None = None  # As it was read, for a comparison of two recordings; None: not of one file

    def __len__(self) -> int:
        """Give the number of points."""
        return int(self.rpm.size)

    def take(self, index: NDArray[Any]) -> Record:
        """Give some of the points."""

        def cut(values: Mapping[str, Array]) -> dict[str, Array]:
            return {key: v[index] for key, v in values.items()}

        return replace(
            self, rpm=self.rpm[index], V=self.V[index],
            air=air_of_points(cut(air_fields(self.air))), measured=cut(self.measured), u=cut(self.u),
            extra=cut(self.extra),
        )  # fmt: skip

    def only(self, channels: Sequence[str]) -> Record:
        """Record with some of its channels, as far as they were measured."""
        kept = [c for c in self.measured if c in channels]
        return replace(self, measured={c: self.measured[c] for c in kept}, u={c: self.u[c] for c in kept})


_STATE = ("density_kg_m3", "pressure_Pa", "temperature_K")
NO_SPEED = "rpm: not recorded"
"""Start of the note of a recording that takes the speed of the case."""
POWER_OPEN = "electrical power is left out: it needs a run of the same motor and controller, --reference RUN"
DROPPED = " were dropped"
"""What the note of points that do not count holds."""


def from_series(series: Dataset, case: Case, correlated: Mapping[str, Mapping[str, float]] | None = None) -> Record:
    """Points of a series with the conditions that the case adds."""
    notes: list[str] = []
    n = len(series)
    series = _without_flicker(series, notes)
    values = {key: np.asarray(v, dtype=float) for key, v in series.values.items()}
    if "rpm" not in values:
        values["rpm"] = np.full(n, case.rpm)
        notes.append(f"{NO_SPEED}; {case.rpm:g} rev/min of the case")
    air, recorded = _states(values, case, notes, series.name)
    turning = series if "rpm" in series else replace(series, values={**series.values, "rpm": values["rpm"]})
    filled = turning.derive(case.diameter_m, air.rho)
    got = {key: np.asarray(v, dtype=float) for key, v in filled.values.items()}
    loads = _loads_of(series, got, notes)
    measured: dict[str, Array] = {k: got[k].copy() for k in loads}
    rpm = filled.rpm.copy()
    if "airspeed_m_s" in got:
        V = filled.airspeed_m_s.copy()
    else:
        V = np.full(n, case.airspeed_m_s)
        notes.append(f"airspeed: not recorded; {case.airspeed_m_s:g} m/s of the case")
    if "sideslip_deg" in got:
        got["sideslip_rad"] = np.radians(got["sideslip_deg"])
    extra = {k: got[k].copy() for k in COVARIATES if k in got and np.isfinite(got[k]).all()}
    if "pwm_s" in extra and "rpm" in series:
        measured["rpm"] = rpm.copy()
        full = extra["pwm_s"] > _FULL_THROTTLE
        if full.any() and not full.all():
            measured["rpm"][full] = np.nan
            notes.append(f"{int(full.sum())} speeds at full throttle left out: the pulse width does not set them")
    u = {k: np.array(filled.u[k], dtype=float) for k in measured}
    keep = np.isfinite(rpm) & (rpm > 0) & np.isfinite(V) & np.any([np.isfinite(measured[k]) for k in loads], axis=0)
    kinks = _kinks(rpm, extra)
    if kinks.any():
        notes.append(f"{int(kinks.sum())} points where the rotor starts or stops{DROPPED}: no acceleration there")
        for reading in measured.values():
            reading[kinks] = np.nan
    if (~keep).any():
        notes.append(f"{int((~keep).sum())} of {n} points without speed or load{DROPPED}")
    again = _repeated(keep, [rpm, V, *measured.values(), *(v for k, v in extra.items() if k != "run")])
    if again.any():
        notes.append(f"{int(again.sum())} rows repeat others digit by digit: counted once")
        keep &= ~again
    if not keep.any():
        if np.any(rpm < 0.0) and not np.any(rpm > 0.0):
            no_speed = f"a speed that is negative in all rows, down to {np.nanmin(rpm):g}"
            raise InputError(Fault(series.name, "rpm", no_speed, "a speed above 0", "Turn its sign in the file"))
        raise InputError(Fault(series.name, "", "no point with a speed and a load", "one or more"))
    gain, zero = ({k: float(v[of]) for k, v in (correlated or {}).items() if v.get(of)} for of in ("gain", "zero"))
    record = Record(series.name, rpm, V, air, measured, u, extra, gain, zero, recorded, tuple(notes),
                    unitless=without_unit(series))  # fmt: skip
    return thinned(record.take(np.flatnonzero(keep)))


def _loads_of(series: Dataset, got: Mapping[str, Array], notes: list[str]) -> list[str]:
    """Loads that were measured; refused where there is none."""
    told = [k for k in ("thrust_N", "torque_Nm") if k in got and np.isfinite(got[k]).any()]
    loads = [k for k in told if np.any(np.nan_to_num(got[k]))]
    notes += [f"{k} is 0 in every row: not measured, ignored" for k in told if k not in loads]
    if not loads and (empty := [k for k in ("thrust_N", "torque_Nm") if k in got and k not in told]):
        raise InputError(Fault(series.name, " and ".join(empty), "no number in any row", "one row or more"))
    if not loads:
        channels = ", ".join(series.values) + "".join(f"; {n}" for n in notes if n.endswith("left out"))
        raise InputError(
            Fault(series.name, "", f"channels {channels}", "a thrust, a torque or a power, or coefficients",
                  "`bemt import` shows how each column was read and what names one")
        )  # fmt: skip
    return loads


def _without_flicker(series: Dataset, notes: list[str]) -> Dataset:
    """Series whose air has no noise of the thermometer, which would enter every predicted load by the density."""
    T, t = series.values.get("temperature_K"), series.values.get("time_s")
    if T is None or t is None or not (np.isfinite(T).all() and np.isfinite(t).all()):
        return series
    T = np.array(T, dtype=float)
    run = np.asarray(series.values.get("run", np.zeros(T.size)))
    largest = 0.0
    for label in np.unique(run):
        rows = np.flatnonzero(run == label)
        rows = rows[np.argsort(t[rows], kind="stable")]
        x = t[rows] - t[rows[0]]
        if rows.size < _AIR_ROWS or not x[-1] > 0.0:
            continue
        slow = np.polynomial.Polynomial.fit(x, T[rows], 2)(x)
        rest = T[rows] - slow
        if np.std(rest) < _AIR_NOISE and np.sum(np.diff(rest) ** 2) > _AIR_RATIO * np.sum(rest**2):
            T[rows] = slow
            largest = max(largest, float(np.std(rest)))
    if not largest > 0.0:
        return series
    notes.append(f"temperature: scatter of {largest:.2g} K is the thermometer's; the slow course of each run is used")
    return replace(series, values={**series.values, "temperature_K": T})


def _repeated(keep: NDArray[np.bool_], columns: Sequence[Array]) -> NDArray[np.bool_]:
    """Rows that are copies of earlier ones, where copies are no accident of coarse digits."""
    out = np.zeros(keep.size, dtype=bool)
    rows = np.flatnonzero(keep)
    if rows.size:
        _, first = np.unique(np.column_stack(columns)[rows], axis=0, return_index=True)
        copies = np.setdiff1d(rows, rows[first])
        out[copies] = copies.size >= max(3, _COPIED * rows.size)
    return out


def _kinks(rpm: Array, extra: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Samples at which a dense record of the speed bends so sharply that its acceleration has no value."""
    out = np.zeros(rpm.size, dtype=bool)
    if "time_s" not in extra or rpm.size < 5:
        return out
    step, rise = np.diff(extra["time_s"]), np.diff(rpm)
    dense = follows(extra["time_s"])
    rate = np.where(dense, rise / np.where(dense, step, 1.0), 0.0)
    left, right = rate[:-1], rate[1:]
    size = np.maximum(np.abs(left), np.abs(right))
    large = np.abs(rise) > 0.01 * np.abs(rpm[1:])
    out[1:-1] = dense[:-1] & dense[1:] & (np.abs(right - left) > 0.6 * size) & (large[:-1] | large[1:])
    return out


def _states(values: Mapping[str, Array], case: Case, notes: list[str], file: str) -> tuple[Air, bool]:
    """Air per point: density, or pressure and temperature, of the recording; else of the case."""
    n = len(values["rpm"])
    default = case.air()
    _plausible(values, file)
    fields = {key: np.full(n, float(v[0])) for key, v in air_fields(default).items()}
    made = cache(lambda of, value, kelvin: of(value, kelvin - ZERO_CELSIUS))
    recorded = False
    for i in range(n):
        told = {k: float(values[k][i]) for k in _STATE if k in values and np.isfinite(values[k][i])}
        T = told.get("temperature_K", float(default.temperature_K))
        if "density_kg_m3" in told:
            air = made(Air.from_density, told["density_kg_m3"], T)
        elif "pressure_Pa" in told:
            air = made(Air.from_state, told["pressure_Pa"], T)
        elif told:  # pressure of the case, temperature of the recording
            air = made(Air.from_density, float(default.rho) * (float(default.temperature_K) / T), T)
        else:
            continue
        recorded = recorded or len(told) > ("temperature_K" in told)
        for name, column in fields.items():
            column[i] = float(getattr(air, name))
    if not recorded:
        notes.append(f"density: not recorded; {float(default.rho):.4g} kg/m3 of the case")
    return air_of_points(fields), recorded


def _plausible(values: Mapping[str, Array], file: str) -> None:
    """Refuse air that nobody has measured in, all rows at once."""
    faults = []
    for key, low, high, hint in _AIR_LIMITS:
        v = values.get(key)
        bad = np.flatnonzero(np.isfinite(v) & ((v < low) | (v > high))) if v is not None else np.zeros(0, dtype=int)
        if bad.size and v is not None:
            rows = ", ".join(str(i + 1) for i in bad[:5]) + (" ..." if bad.size > 5 else "")
            faults.append(Fault(file, f"{key}, point {rows}", f"{v[bad[0]]:.4g}", f"{low:g} to {high:g}", hint))
    refuse(faults)


def thinned(record: Record, most: int = MAX_POINTS) -> Record:
    """Average alike points when there are too many, never over the ends of a run.

    Samples close in time stay with their neighbours; anything else with points of the same speed and wind, so that the
    order of the rows does not matter; where a clock tells it, rising and falling loads are two conditions.  Loads are
    averaged as coefficients: they go with the square of the speed.
    """
    P = len(record)
    if P <= most:
        return record
    size = -(-P // most)
    run = record.extra.get("run", np.zeros(P))
    if dense(record):
        block = _blocks(np.arange(P), record.rpm, run, size, np.inf)
    else:
        if "time_s" in record.extra:
            load = next(np.abs(record.measured[c]) for c in CHANNELS if c in record.measured)
            run = 2.0 * run + (fell(load, run, record.extra["time_s"]) == 1.0)
        order = _alike(record, run)
        loose = [(same * _SAME_SPEED, size) for same in (1, 3, 10)] + [(np.inf, size * k) for k in (1, 2, 4)]
        for same, largest in loose:
            block = _blocks(order, record.rpm, run, largest, same)
            if block.max() < 1.5 * most:
                break
    # in the order of the rows: noise may be correlated along it
    _, block = np.unique(block, return_inverse=True)
    place = np.argsort(np.argsort(np.bincount(block, np.arange(P)) / np.bincount(block), kind="stable"))
    block = place[block]

    def mean(values: Array) -> Array:
        good = np.isfinite(values)
        count = np.bincount(block, good)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.bincount(block, np.where(good, values, 0.0)) / np.where(count > 0, count, np.nan))

    density = np.asarray(record.air.rho, dtype=float)
    rpm, rho = mean(record.rpm), mean(density)
    unit = {c: density * record.rpm**2 for c in ("thrust_N", "torque_Nm")}
    seen = {} if dense(record) else {c: _scatter(record, c, unit[c], block) for c in unit if c in record.measured}
    record = replace(record, u=dict(record.u) | {c: v for c, v in seen.items() if v is not None})
    # neighbours share slow errors: their mean is taken to be no better than one of them
    note = f"{P} points averaged to {rpm.size} of similar conditions"
    return replace(
        record, rpm=rpm, V=mean(record.V), air=air_of_points({k: mean(v) for k, v in air_fields(record.air).items()}),
        measured={k: mean(v / unit[k]) * rho * rpm**2 if k in unit else mean(v) for k, v in record.measured.items()},
        u={k: mean(v) for k, v in record.u.items()}, extra={k: mean(v) for k, v in record.extra.items()},
        notes=(*record.notes, note),
    )  # fmt: skip


def _scatter(record: Record, channel: str, unit: Array, block: NDArray[np.intp]) -> Array | None:
    """Uncertainty of points that state none, from their scatter within blocks of one condition."""
    y, u = record.measured[channel], record.u[channel]
    good = np.flatnonzero(np.isfinite(y))
    if not good.size or np.isfinite(u[good]).any():
        return None
    good = good[:: -(-good.size // _MOST_COMPARED)]
    advance = record.V[good] / record.rpm[good]
    size = max(float(np.max(np.abs(advance))), 1e-12)
    at = conditions(record.rpm[good], advance / size, np.asarray(record.air.rho)[good])
    together = np.unique(np.column_stack([block[good], at]), axis=0, return_inverse=True)[1].ravel()
    sizes = spread_sizes(y[good], unit[good], together)
    return None if sizes is None else np.hypot(sizes[0] * y, sizes[1] * float(np.max(np.abs(y[good]))))


def _blocks(order: NDArray[np.intp], rpm: Array, run: Array, size: int, same: float) -> NDArray[np.intp]:
    """Block of each point: up to ``size`` that follow each other in this order, of one run and one speed."""
    block = np.empty(order.size, dtype=np.intp)
    current, first = -1, 0
    for k in range(order.size):
        new = k == 0 or k - first == size or run[order[k]] != run[order[k - 1]]
        if new or abs(rpm[order[k]] / rpm[order[first]] - 1.0) > same:
            current, first = current + 1, k
        block[order[k]] = current
    return block


def dense(record: Record) -> bool:
    """Whether most samples follow each other closely enough to show how loads follow the speed."""
    time, run = record.extra.get("time_s"), record.extra.get("run", np.zeros(len(record)))
    if time is None:
        return False
    close = follows(time)[np.diff(run) == 0]
    return bool(close.size) and bool(np.mean(close) > 0.5)


def _alike(record: Record, run: Array) -> NDArray[np.intp]:
    """Order of the points that brings like conditions together, whatever the order of the rows."""
    bins = np.round(np.log(record.rpm) / _SAME_SPEED)
    beside = record.extra.get("second_rotor_rad_s", np.zeros(len(record)))
    return np.lexsort((record.rpm, beside, record.V / record.rpm, np.asarray(record.air.rho, dtype=float), bins, run))


def merged(records: Sequence[Record]) -> Record:
    """Join recordings of one rotor into one, with their runs numbered through."""
    if len(records) == 1:
        return records[0]
    join = np.concatenate
    (measured, u), whole = (_columns(records, of) for of in ("measured", "u")), records[0]
    return thinned(replace(
        whole, name=", ".join(r.name for r in records), rpm=join([r.rpm for r in records]),
        V=join([r.V for r in records]), measured=measured, u=u, extra=concatenated(records),
        air=air_of_points({k: join([getattr(r.air, k) for r in records]) for k in air_fields(whole.air)}),
        gain=_largest(r.gain for r in records), zero=_largest(r.zero for r in records),
        air_recorded=all(r.air_recorded for r in records), notes=_once(r.notes for r in records),
        findings=_once(r.findings for r in records), contradictions=_once(r.contradictions for r in records),
        repeatability=float(np.fmax.reduce([r.repeatability for r in records])), electrical=False,
        top_rpm=min(r.top_rpm for r in records), computed=all(r.computed for r in records), setup=setup_of(records),
        declared={k: v for k, v in whole.declared.items() if all(r.declared.get(k) == v for r in records)},
        unitless=frozenset.union(*(r.unitless for r in records)), whole=None,
    ))  # fmt: skip


def setup_of(records: Sequence[Record]) -> Conditions:
    """Conditions that all computed runs state, with the values of all."""
    stated = [r.setup for r in records]
    names = [k for k in stated[0] if all(k in one for one in stated)] if stated else []
    return {k: tuple(sorted({v for one in stated for v in one[k]})) for k in names}


def _columns(records: Sequence[Record], of: str) -> dict[str, Array]:
    """Channels of all records under each other; NaN where one has not measured."""
    names = dict.fromkeys(n for r in records for n in r.measured)
    return {n: np.concatenate([getattr(r, of).get(n, np.full(len(r), np.nan)) for r in records]) for n in names}


def _largest(told: Iterable[Mapping[str, float]]) -> dict[str, float]:
    out: dict[str, float] = {}
    for one in told:
        out |= {n: max(v, out.get(n, v)) for n, v in one.items()}
    return out


def _once(told: Iterable[tuple[T, ...]]) -> tuple[T, ...]:
    return tuple(dict.fromkeys(one for some in told for one in some))


def owners(records: Sequence[Record], whole: Record) -> NDArray[np.intp]:
    """Tell which of the recordings that were joined each point comes from, (P,)."""
    if len(records) == 1:
        return np.zeros(len(whole), dtype=np.intp)
    runs = [np.unique(r.extra.get("run", np.zeros(1))).size for r in records]
    return np.searchsorted(np.cumsum(runs), whole.extra["run"], side="right")


def concatenated(records: Sequence[Record]) -> dict[str, Array]:
    """Covariates of all records that are judged, joined, with runs numbered through.

    A reference may lack one, as a run without a wall has no distance of it: there it is the median of the others.
    """
    judged = [r for r in records if not r.reference] or records
    names = [n for n in COVARIATES if all(n in r.extra for r in judged)]
    joined = {}
    for n in names:
        usual = np.median(np.concatenate([r.extra[n] for r in records if n in r.extra]))
        joined[n] = np.concatenate([r.extra.get(n, np.full(len(r), usual)) for r in records])
    runs, offset = [], 0.0
    for r in records:
        own = r.extra.get("run", np.zeros(len(r)))
        _, index = np.unique(own, return_inverse=True)
        runs.append(index + offset)
        offset += float(index.max()) + 1.0
    joined["run"] = np.concatenate(runs).astype(float)
    return joined

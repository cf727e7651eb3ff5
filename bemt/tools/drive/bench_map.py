"""Bench map: pulse width to rpm, thrust, current and power, monotone, with battery voltage where it can be told apart.

Each quantity is a monotone smooth curve over the pulse width: values at equidistant nodes whose increments are not
negative (non-negative least squares) with a penalty on second differences, the discrete form of a cubic smoothing
spline (Whittaker 1923; Eilers and Marx 1996). Leave-one-level-out decides how smooth. Between nodes stands a monotone
cubic (Fritsch and Carlson 1980). With voltage, q = q_ref(pulse) (V / V_ref)^m; m is fitted when the voltage varies by
itself, not only as the sag that belongs to a pulse width.

References
----------
F. N. Fritsch, R. E. Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17 (1980) 238-246,
doi:10.1137/0717021. P. H. C. Eilers, B. D. Marx, "Flexible smoothing with B-splines and penalties", Statistical
Science 11 (1996) 89-121, doi:10.1214/ss/1038425655. (Not checked against the papers.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of
from bemt.data.readers.recording import FULL_THROTTLE
from bemt.data.recordings import plateaus
from bemt.data.recordings.channels import THROTTLE_IS_PULSE, named, pulse_of
from bemt.data.recordings.zero import tared
from bemt.physics.dataset import Dataset, concat

# From a recording to the points of a bench map: pulse width, thrust, rpm, current, power, voltage when steady.

CHANNELS = {"thrust": "thrust_N", "rpm": "rpm", "current": "current_A", "power": "electrical_power_W"}
"""What a map gives beside the pulse width, and the channel it is fitted to."""
_RECORDED = (*CHANNELS.values(), "voltage_V")
RAMP = 40
"""Distinct commands, one sample each, from which a recording is a ramp and not a table of steps."""


def map_points(
    pulse_us: Array, recorded: Mapping[str, ArrayLike], run: int = 0, notes: Sequence[str] = (), ramp: bool = False
) -> Dataset:
    """Steady points over the pulse width [us]; NaN for what is not recorded. `ramp`: the command moved all the time."""
    nothing = np.full(len(pulse_us), np.nan)
    values = {
        "pulse_us": pulse_us,
        **{k: recorded.get(k, nothing) for k in _RECORDED},
        "run": np.full(len(pulse_us), run),
    }
    return Dataset("bench", "map", values, units={"pulse_us": "us"}, notes=tuple(notes), provenance={"ramp": ramp})


def _channel(got: Dataset, *names: str) -> Array | None:
    for name in names:
        v = got.values.get(name)
        if v is not None and got.unit(name) and np.any(np.isfinite(v) & (v != 0.0)):
            return v  # type: ignore[no-any-return]
    return None


def _command(got: Dataset, name: str, notes: list[str]) -> Array:
    pulse = _channel(got, "pulse_width_s")
    if pulse is not None:
        return pulse * 1e6
    throttle = _channel(got, "throttle")
    if throttle is not None:
        full = float(np.nanmax(throttle, initial=0.0))
        if full > FULL_THROTTLE:
            told = f"throttle up to {full:g} without a unit"
            raise InputError(Fault(name, "throttle", told, "a fraction of 0 to 1", "In percent? Head it throttle (%)"))
        notes.append(THROTTLE_IS_PULSE)
        return 1e6 * pulse_of(throttle)
    hint = "Log the ESC signal, or name its column as pulse_width or throttle in a recording.toml"
    raise InputError(Fault(name, "pulse_width_s", "no pulse width and no throttle", "a command per row", hint))


def _without_zero(got: Dataset, name: str, thrust: Array) -> tuple[Array, tuple[str, ...]]:
    """The thrust less the zero of the stand, and what was subtracted, as `bemt import` reads the recording."""
    turned = named(replace(got, values={**got.values, "thrust_N": thrust}))
    values, notes = tared(turned, name)
    return values["thrust_N"], tuple(n for n in notes if n.startswith("thrust_N"))


def points(got: Dataset, name: str = "", sign: int = 1, run: int = 0) -> Dataset:
    """Find the steady points of one recording."""
    notes: list[str] = []
    command = _command(got, name, notes)
    thrust = _channel(got, "thrust_N")
    if thrust is None:
        hint = "Name its column and unit in a recording.toml"
        raise InputError(Fault(name, "thrust_N", "no thrust with a unit", "a channel of thrust", hint))
    thrust, zeros = _without_zero(got, name, sign * thrust)
    notes += zeros
    rpm = _channel(got, "rpm", "optical_rpm", "electrical_rpm")
    if rpm is not None and _channel(got, "rpm", "optical_rpm") is None:
        notes.append("rpm is the electrical reading of the stand, with the pole pairs set in its software")
    current, voltage = _channel(got, "current_A"), _channel(got, "voltage_V")
    power = _channel(got, "electrical_power_W")
    if power is None and current is not None and voltage is not None:
        power = current * voltage
    raw = (thrust, rpm, current, power, voltage)
    data = {key: np.full(len(command), np.nan) if v is None else v for key, v in zip(_RECORDED, raw, strict=True)}
    full = float(np.nanmax(np.abs(thrust)))
    silent = (data["rpm"] == 0.0) & (np.abs(thrust) > 0.05 * full)
    if np.any(silent):
        notes.append(f"rpm of 0 under thrust in {number_of(silent.sum(), 'row')}: no rpm there")
        data["rpm"] = np.where(silent, np.nan, data["rpm"])
    out = _below_limit(_reduced(got, command, data, notes, run))
    if len(out) < 4 or np.ptp(out.pulse_us) <= 0.0:
        got_text = f"{len(out)} steady points"
        raise InputError(Fault(name, "", got_text, "4 points or more at different pulse widths"))
    top = out.pulse_us >= np.max(out.pulse_us) - 0.2 * np.ptp(out.pulse_us)
    if np.nanmean(out.thrust_N[top]) <= 0.0:
        shown = f"{np.nanmean(out.thrust_N[top]):.3g} N at the greatest pulse widths"
        hint = "Give --sign -1 if the stand counts thrust the other way"
        raise InputError(Fault(name, "thrust_N", shown, "positive thrust", hint))
    return out


def _reduced(got: Dataset, command: Array, data: dict[str, Array], notes: list[str], run: int) -> Dataset:
    used = np.isfinite(command) & np.isfinite(data["thrust_N"])
    stays = np.mean(np.isclose(np.diff(command[used]), 0.0)) if np.count_nonzero(used) > 1 else 0.0
    if stays < 0.4:  # one row per step, or a ramp
        ramp = len(np.unique(command[used])) > RAMP
        if ramp:
            notes.append("the command moves all the time: lag of the drive is part of the map")
        return map_points(command[used], {key: v[used] for key, v in data.items()}, run, notes, ramp)
    found = plateaus.find(got.values.get("time_s"), data, "thrust_N", command)
    kept = [p for p in found.plateaus if "not settled" not in p.flags]
    if lost := len(found.plateaus) - len(kept):
        notes.append(f"{lost} plateaus that do not settle were dropped")
    pulse = np.array([p.command for p in kept], dtype=float)
    return map_points(pulse, {key: np.array([p.mean.get(key, np.nan) for p in kept]) for key in data}, run, notes)


LIMITED = 0.03
"""Fall of the voltage, with more pulse width and no more current, from which the supply is in its limit. [1]"""


def _below_limit(points: Dataset) -> Dataset:
    """Points of one recording at which the supply holds its voltage.

    A source of one resistance gives less voltage only with more current. Where the voltage falls and the current does
    not rise, the supply limits its current: such a point says nothing about the drive at the voltage of the map.
    """
    current, voltage, pulse = points.current_A, points.voltage_V, points.pulse_us
    inside = np.zeros(len(points), dtype=bool)
    for way in (1, -1):  # commands that rise, and those that fall, read from the end
        first = 0
        order = np.arange(len(points))[::way]
        for i, row in enumerate(order):
            if i and pulse[row] <= pulse[order[i - 1]]:
                first = i
            before = order[first:i]
            held = voltage[row] < (1.0 - LIMITED) * voltage[before]
            inside[row] |= bool(np.any(held & (current[row] <= (1.0 + 0.5 * LIMITED) * current[before])))
    inside &= current > 0.5 * np.nanmax(current, initial=0.0)
    if not np.any(inside):
        return points
    limit = float(np.median(current[inside]))
    inside |= current >= (1.0 - 0.5 * LIMITED) * limit
    left = points.select(~inside)
    top = f", from {np.min(pulse[inside]):.0f} us on" if len(left) else ""
    note = f"{number_of(inside.sum(), 'point')}{top}, left out: at {limit:.3g} A the supply is in its current limit "
    return replace(left, notes=(*left.notes, f"{note}(down to {np.min(voltage[inside]):.4g} V)"))


def join(parts: Sequence[Dataset]) -> Dataset:
    """Put recordings of one drive together."""
    notes = dict.fromkeys(note for part in parts for note in part.notes)
    return replace(concat(parts), notes=tuple(notes), provenance={"ramp": any(p.provenance["ramp"] for p in parts)})


NODES = 49
SMOOTHNESS = 10.0 ** np.arange(-10.0, 0.1, 2.0)
OWN_VOLTAGE = 0.01
"""Spread of ln V beside a line over current from which the voltage is a parameter. [1]"""
REPEAT_VOLTAGE = 0.005
"""The same at equal pulse widths, where half as much tells it (runs on one emptying battery). [1]"""


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity over pulse width."""

    # (K,) nodes [us] and values in the unit of the quantity, not falling
    pulse_us: Array
    values: Array
    exponent: float = 0.0  # power of V / V_ref; 0 when the voltage is no parameter. [-]
    smoothness: float = 0.0  # penalty chosen. [-]

    def at(self, pulse_us: ArrayLike) -> Array:
        """Evaluate at the reference voltage; NaN outside the recorded pulse widths, (N,)."""
        return np.asarray(self._cubic(np.asarray(pulse_us, dtype=float)))

    @cached_property
    def _cubic(self) -> Callable[[Array], Array]:
        from scipy.interpolate import PchipInterpolator

        cubic: Callable[[Array], Array] = PchipInterpolator(self.pulse_us, self.values, extrapolate=False)
        return cubic


@dataclass(frozen=True, eq=False)
class BenchMap:
    """Map of one drive."""

    curves: dict[str, Curve]  # thrust [N], rpm [rev/min], current [A], power [W], as recorded
    voltage: Curve | None  # voltage that belongs to a pulse width, as minus its value (it falls). [V]
    voltage_ref: float  # V_ref, NaN when no voltage was recorded. [V]
    voltage_range: tuple[float, float]  # least and greatest voltage recorded. [V]
    notes: tuple[str, ...] = ()  # what was assumed
    points: Dataset | None = field(default=None, repr=False)  # what it was fitted to

    @property
    def thrust(self) -> Curve:
        """Curve of the thrust, which every map has."""
        return self.curves["thrust"]

    @property
    def with_voltage(self) -> bool:
        """Whether the voltage is a parameter."""
        return any(curve.exponent != 0.0 for curve in self.curves.values())

    @property
    def pulse_range_us(self) -> tuple[float, float]:
        """Recorded range of the pulse width. [us]"""
        nodes = self.thrust.pulse_us
        return float(nodes[0]), float(nodes[-1])

    @property
    def full_thrust_N(self) -> float:
        """Thrust at the greatest pulse width and the reference voltage. [N]"""
        return float(self.thrust.values[-1])

    def voltage_at(self, pulse_us: ArrayLike) -> Array:
        """Voltage recorded with a pulse width (battery sag); NaN without a record, (N,) [V]."""
        pulse = np.asarray(pulse_us, dtype=float)
        return np.full(pulse.shape, np.nan) if self.voltage is None else -self.voltage.at(pulse)

    def at(self, quantity: str, pulse_us: ArrayLike, voltage_V: ArrayLike | None = None) -> Array:
        """Read the map, (N,)."""
        if quantity not in self.curves:
            raise InputError(Fault("", "quantity", repr(quantity), f"one of {', '.join(self.curves)}"))
        curve = self.curves[quantity]
        out = curve.at(pulse_us)
        return out if voltage_V is None else out * self._scale(curve, voltage_V)

    def _scale(self, curve: Curve, voltage_V: ArrayLike) -> Array:
        if not self.with_voltage:
            hint = "Add a recording of the same drive at another battery voltage"
            raise InputError(Fault("", "voltage_V", "a voltage", "none: the recording cannot tell its effect", hint))
        v = np.asarray(voltage_V, dtype=float)
        return np.asarray((v / self.voltage_ref) ** curve.exponent)

    def pulse_for(self, thrust_N: ArrayLike, voltage_V: ArrayLike | None = None) -> Array:
        """Inverse map: the least pulse width that gives a thrust, (N,) [us]."""
        curve = self.thrust
        wanted = np.atleast_1d(np.asarray(thrust_N, dtype=float))
        scale = np.ones(wanted.shape)
        if voltage_V is not None:
            scale = np.broadcast_to(self._scale(curve, voltage_V), wanted.shape)
        wanted = wanted / scale
        lo = np.full(wanted.shape, curve.pulse_us[0])
        hi = np.full(wanted.shape, curve.pulse_us[-1])
        for _ in range(60):  # monotone: bisection cannot fail and finds the left end of a flat stretch
            mid = 0.5 * (lo + hi)
            reached = curve.at(mid) >= wanted
            lo, hi = np.where(reached, lo, mid), np.where(reached, mid, hi)
        out = np.where(wanted <= curve.values[0], curve.pulse_us[0], hi)
        missing = (wanted > curve.values[-1]) | ~np.isfinite(wanted)
        return np.where(missing, np.nan, out).reshape(np.shape(thrust_N))


def _monotone(x: Array, y: Array, grid: Array, smoothness: float) -> Array:
    """Values at the grid: non-negative increments, penalised second differences; y is of the order of 1."""
    from scipy.optimize import nnls

    step = grid[1] - grid[0]
    k = np.clip(((x - grid[0]) / step).astype(int), 0, len(grid) - 2)
    f = (x - grid[k]) / step
    rows = np.arange(len(x))
    to_data = np.zeros((len(x), len(grid)))
    to_data[rows, k], to_data[rows, k + 1] = 1.0 - f, f
    second = np.diff(np.eye(len(grid)), n=2, axis=0) * len(grid) ** 1.5 * np.sqrt(smoothness)
    sums = np.tril(np.ones((len(grid), len(grid))))  # value = start + sum of increments
    root = np.sqrt(1.0 / len(x))
    a = np.vstack([(root * to_data) @ sums, second @ sums])
    b = np.concatenate([root * y, np.zeros(len(second))])
    # the start is free: its column enters with both signs
    solution, _ = nnls(np.hstack([a, -a[:, :1]]), b, maxiter=50 * len(grid))
    solution[0] -= solution[-1]
    return np.asarray(sums @ solution[:-1])


def _levels(pulse: Array) -> NDArray[np.intp]:
    """Number of the level of each point; pulse widths within 1 us, or within a fortieth of the range of a ramp."""
    near = np.round(pulse).astype(int)
    found, index = np.unique(near, return_inverse=True)
    if len(found) <= 40:
        return np.asarray(index)
    bins = np.linspace(pulse.min(), pulse.max(), 31)[1:-1]
    return np.asarray(np.digitize(pulse, bins))


def _curve(pulse: Array, y: Array, smoothness: float | None, grid: Array) -> Curve:
    ok = np.isfinite(y)
    x, v = pulse[ok], y[ok]
    size = float(np.max(np.abs(v))) or 1.0
    if smoothness is None:
        smoothness = _chosen(x, v / size, grid)
    return Curve(grid, size * _monotone(x, v / size, grid, smoothness), 0.0, smoothness)


def _chosen(x: Array, y: Array, grid: Array) -> float:
    level = _levels(x)
    inner = [k for k in np.unique(level) if np.min(x) < np.mean(x[level == k]) < np.max(x)]
    if len(inner) < 2:
        return float(SMOOTHNESS[0])
    folds = [inner[i::6] for i in range(min(6, len(inner)))]
    best = []
    for smoothness in SMOOTHNESS:
        error = 0.0
        for fold in folds:
            out = np.isin(level, fold)
            values = _monotone(x[~out], y[~out], grid, float(smoothness))
            error += float(np.sum((np.interp(x[out], grid, values) - y[out]) ** 2))
        best.append(error)
    return float(SMOOTHNESS[int(np.argmin(best))])


def _own_voltage(pulse: Array, voltage: Array, current: Array, sag: Curve, ramp: bool) -> float:
    """Spread of ln V that is not the sag of one battery, over what tells it: above 1 the voltage is a parameter. [1]"""
    repeats = float(np.std(np.log(voltage) - np.log(-sag.at(pulse))))
    ok = np.isfinite(current)
    if np.count_nonzero(ok) < 4:
        return repeats / OWN_VOLTAGE
    line = np.polyval(np.polyfit(current[ok], voltage[ok], 1), current[ok])
    own = float(np.std(np.log(voltage[ok]) - np.log(np.maximum(line, 1e-3))))
    return max(own / OWN_VOLTAGE, 0.0 if ramp else repeats / REPEAT_VOLTAGE)  # in a ramp the lag moves it too


def fit(
    points: Dataset, smoothness: float | None = None, nodes: int = NODES, quantities: Iterable[str] = tuple(CHANNELS),
) -> BenchMap:  # fmt: skip
    """Fit the map of one drive."""
    if len(points) < 4:
        raise InputError(Fault("", "points", f"{len(points)}", "4 or more"))
    pulse = points.pulse_us
    grid = np.linspace(pulse.min(), pulse.max(), nodes)
    notes = list(points.notes)
    voltage = points.voltage_V
    known = np.isfinite(voltage) & (voltage > 0.0)
    sag, ref, limits, own = None, float("nan"), (float("nan"), float("nan")), 0.0
    if np.count_nonzero(known) >= 4:
        sag = _curve(pulse[known], -voltage[known], 1e-6, grid)
        ref = float(np.median(voltage[known]))
        limits = float(voltage[known].min()), float(voltage[known].max())
        own = _own_voltage(pulse[known], voltage[known], points.current_A[known], sag, points.provenance["ramp"])
        if own < 1.0:
            notes.append("voltage varies only with the sag of this battery: the map holds for it, not for others")
    curves: dict[str, Curve] = {}
    for name in quantities:
        y = points[CHANNELS[name]]
        ok = np.isfinite(y)
        if np.count_nonzero(ok) < 4:
            continue
        if own < 1.0:
            curves[name] = _curve(pulse[ok], y[ok], smoothness, grid)
            continue
        ok &= known
        curves[name] = _with_voltage(pulse[ok], y[ok], voltage[ok] / ref, smoothness, grid)
    return BenchMap(curves, sag, ref, limits, tuple(notes), points)


def _with_voltage(x: Array, y: Array, ratio: Array, smoothness: float | None, grid: Array) -> Curve:
    from scipy.optimize import minimize_scalar

    def misfit(m: float) -> float:
        values = _curve(x, y / ratio**m, 1e-3, grid).values
        return float(np.sum((np.interp(x, grid, values) * ratio**m - y) ** 2))

    m = float(minimize_scalar(misfit, bounds=(0.0, 4.0), method="bounded", options={"xatol": 1e-3}).x)
    curve = _curve(x, y / ratio**m, smoothness, grid)
    return Curve(curve.pulse_us, curve.values, m, curve.smoothness)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Round trip on plateaus that the map was not fitted to."""

    thrust_N: Array  # (M,) wanted: the thrust recorded there [N]
    pulse_us: Array  # (M,) pulse width at which it was recorded [us]
    pulse_found_us: Array  # (M,) what the inverse map asks for [us]
    # (M,) thrust that the drive gives there minus the wanted one, over full thrust [1]; what the drive gives is read
    # from the record between its neighbouring levels
    error: Array

    @property
    def worst(self) -> float:
        """Greatest error, over full thrust. [1]"""
        return float(np.nanmax(np.abs(self.error)))

    @property
    def rms(self) -> float:
        """Root mean square error, over full thrust. [1]"""
        return float(np.sqrt(np.nanmean(self.error**2)))


def misfit(points: Dataset, chart: BenchMap) -> float:
    """How far the points lie from a map that may not fall. [1]"""
    volts = points.voltage_V if chart.with_voltage else None
    rest = chart.at("thrust", points.pulse_us, volts) - points.thrust_N
    return float(np.sqrt(np.nanmean(rest**2))) / float(np.nanmax(np.abs(points.thrust_N)))


def repeat_spread(points: Dataset, chart: BenchMap) -> float:
    """How far the recording itself differs at one pulse width: a map of pulse width alone cannot be nearer. [1]"""
    near, thrust = np.round(points.pulse_us), points.thrust_N
    if chart.with_voltage:
        thrust = thrust / (points.voltage_V / chart.voltage_ref) ** chart.thrust.exponent
    spans = [float(np.ptp(thrust[near == u])) for u in np.unique(near) if np.count_nonzero(near == u) > 1]
    return max(spans) / float(np.max(thrust)) if spans else float("nan")


def held_out(points: Dataset, folds: int = 5, smoothness: float | None = None) -> HeldOut:
    """Leave levels out in turn, fit to the rest, and make the round trip on what was left out.

    A plateau was recorded at pulse p with thrust T. The inverse map gives p' for T. The drive gives T at p, so the
    round trip misses by map(p) - T up to the slope's change between p and p'; that is the error stated.
    """
    level = _levels(points.pulse_us)
    inner = np.unique(level)[1:-1]
    wanted, pulses, found, errors = [], [], [], []
    for k in range(min(folds, len(inner))):
        out = np.isin(level, inner[k::folds])
        chart = fit(points.select(~out), smoothness, quantities=("thrust",))
        test = points.select(out)
        thrust, pulse = test.thrust_N, test.pulse_us
        volts = test.voltage_V if chart.with_voltage else None
        full = chart.full_thrust_N if volts is None else chart.at("thrust", chart.pulse_range_us[1], volts)
        wanted.append(thrust)
        pulses.append(pulse)
        found.append(chart.pulse_for(thrust, volts))
        errors.append((chart.at("thrust", pulse, volts) - thrust) / full)
    if not wanted:
        raise InputError(Fault("", "points", f"{len(np.unique(level))} levels", "3 or more to leave one out"))
    return HeldOut(*(np.concatenate(part) for part in (wanted, pulses, found, errors)))

"""Recordings of a stand as points, and two of them channel by channel at equal speed.

A recording becomes steady loads over speed, and the drive over its command. A load divided by its own power of the
speed (thrust by n^2, torque by n^2, power by n^3) hardly changes with speed, so that its logarithm is a smooth curve
over ln n and advance ratio.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.data.recordings import cfd_setup
from bemt.data.recordings.channels import THROTTLE_IS_PULSE, in_one_step, moves, named, throttle_of
from bemt.data.recordings.reduce import reduce, reduction
from bemt.judge.compare.selection import COLD, HOT, LOAD_CHANNELS, conditions_of, one_rotor, speed_in_doubt, wind_of
from bemt.physics.dataset import DIMENSIONLESS, Dataset

_WANTED = (
    *LOAD_CHANNELS, "rpm", "airspeed_m_s", "J", "density_kg_m3", "electrical_power_W", "voltage_V", "throttle", "run",
    "temperature_K", "time_s", "tip_gap_m", "wall_distance_m", "sideslip_rad", "sideslip_deg", "second_rotor_rad_s",
)  # fmt: skip
# A ramp instead of plateaus: fewest points and rows, rows that must agree, ln of a misreading, 1/s of a slow ramp.
_ENOUGH, _ROWS, _WINDOW, _JUMP, _RATE = 8, 20, 7, 0.03, 0.25
# Load of a ramp over full scale that a lag of 0.2 s leaves when it takes ten seconds.
_LAG = 0.02
# Times that a speed may exceed those at higher commands; readings to compare with, fewest and most.
_ODD, _FEWEST, _MOST = 1.5, 6, 500
# What airspeeds of one wind differ by [m/s], and as a share.
_STEADY_WIND, _LIKE_WIND = 0.5, 0.1


@dataclass(frozen=True, eq=False)
class StandRun:
    """Steady points of one recording, and what holds for all of it."""

    points: Dataset  # Channels in SI, rpm in rev/min; ``command`` is the pulse width [s] or the throttle [1]
    command: str  # ``pwm_s``, ``throttle`` or "" without one
    density: float  # Mean recorded density, or that of recorded pressure and temperature [kg/m3]; NaN: not recorded
    diameter_m: float  # As the recording or the label says [m]; NaN: unknown
    temperature_K: float = math.nan  # Mean of the air [K]; NaN: not recorded
    # Scatter between the runs of this recording at equal speed, share, by channel, where it shows
    session: Mapping[str, float] = field(default_factory=dict)
    # Columns that tell rows apart and are no channel of the rotor, as conditions may name them
    conditions: tuple[str, ...] = ()
    # What lag or hysteresis shifts a load by, standard deviation as a share of its largest value, by channel [1]
    shift: Mapping[str, float] = field(default_factory=dict)
    misread: tuple[int, int] = (0, 0)  # Speeds that no rotor can have at their command or load, and all
    # Speed below which thrust is negative as in a wind that is not recorded [rev/min]; NaN: no such wind
    zero_thrust_rpm: float = math.nan
    by_throttle: bool = False  # Whether the pulse width is only what a throttle stands for
    setup: cfd_setup.Conditions = field(default_factory=dict)  # How a run of CFD was computed, as far as it says

    def __len__(self) -> int:
        """Give the number of points."""
        return len(self.points)


def stand_run(imported: Dataset, name: str, diameter_m: float | None = None) -> StandRun:
    """Reduce one recording for a comparison."""
    # a throttle has no unit
    imported = replace(imported, units={k: u for k, u in imported.units.items() if u or k not in DIMENSIONLESS})
    one_rotor(imported, name)
    speed_in_doubt(imported, name)
    series, ramp = _reduced(imported, diameter_m)
    values = {k: series[k] for k in _WANTED if k in series}
    _comparable(values, imported, name)
    command = next((k for k in ("pwm_s", "throttle") if k in series and moves(series[k])), "")
    values |= {"command": series[command]} if command else {}
    if "torque_Nm" in values:
        values.pop("power_W", None)
    false = _misread(values)
    gone = sum(x.channel == "rpm" and x.reason.startswith("misread") for x in reduction(series).dropped)
    every = int(np.isfinite(series.values.get("rpm", np.nan)).sum())
    if false.any():
        values["rpm"] = np.where(false, np.nan, values["rpm"])
    constant = {k: float(imported.constants.get(k, math.nan)) for k in ("density_kg_m3", "diameter_m", "temperature_K")}
    rho, warm = (values.get(k, np.array([constant[k]])) for k in ("density_kg_m3", "temperature_K"))
    warm = warm[(warm > COLD) & (warm < HOT)]
    points = Dataset(
        series.kind, name, values, {k: series.u[k] for k in values if k in series}, labels=series.labels,
        notes=(*ramp, *(n for n in series.notes if "no density" not in n)),
        units={"command": "s" if command == "pwm_s" else "-"}, lines=_lines(series, imported),
    )  # fmt: skip
    return StandRun(
        points, command, float(np.nanmean(rho)) if np.isfinite(rho).any() else constant["density_kg_m3"],
        constant["diameter_m"] if diameter_m is None else diameter_m, float(warm.mean()) if warm.size else math.nan,
        {k: float(v["session"]) for k, v in reduction(series).correlated.items() if v.get("session")},
        conditions_of(imported), _shifts(series, bool(ramp)), (int(false.sum()) + gone, every + gone),
        math.nan if (zero := wind_of(imported)) is None else zero,
        command == "pwm_s" and any(note.endswith(THROTTLE_IS_PULSE) for note in series.notes),
        cfd_setup.stated_setup(imported),
    )  # fmt: skip


def _lines(series: Dataset, imported: Dataset) -> tuple[int, ...]:
    """Line of the file of each point; none where a point is made of many."""
    how = reduction(series)
    return tuple(imported.lines[int(rows[0])] for rows in how.rows) if how.mode == "points" and imported.lines else ()


def _comparable(values: Mapping[str, Array], imported: Dataset, name: str) -> None:
    """Refuse a recording in which nothing can be compared."""
    if {"thrust_N", "torque_Nm", "power_W", "rpm", "J"} & values.keys():
        return
    if {"CT", "CP", "CQ"} & values.keys():
        raise InputError(Fault(name, "", "coefficients without a speed", "J or rpm beside them"))
    expected = f"thrust, torque or shaft power, with its unit{in_one_step(imported)}"
    raise InputError(Fault(name, "", "no load and no speed", expected))


def _misread(values: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Speeds that no rotor can have: much faster than most at the same or higher command, with less load.

    A change of battery or propeller moves speed and load in other ways; only readings at one airspeed are compared.
    A slow one may be a rotor that has just set off.

    >>> table = {"command": [1.0, 1.0, *[2.0] * 8], "rpm": [9e3, 3e3, *[5e3] * 8], "thrust_N": [1.0, 1.0, *[4.0] * 8]}
    >>> _misread({k: np.array(v) for k, v in table.items()}).tolist()[:3]
    [True, False, False]
    """
    load = next((np.abs(values[k]) for k in ("electrical_power_W", "torque_Nm", "thrust_N") if k in values), None)
    none = np.zeros(max((v.size for v in values.values()), default=0), dtype=bool)
    if load is None or not {"rpm", "command"} <= values.keys():
        return none
    good = np.isfinite(values["command"]) & (values["rpm"] > 0.0) & np.isfinite(load)
    rows = np.flatnonzero(good)
    if rows.size < _FEWEST:
        return none
    command, speed, load = values["command"][rows], np.log(values["rpm"][rows]), load[rows]
    every = np.unique(np.linspace(0, rows.size - 1, min(rows.size, _MOST)).astype(int))
    some = np.argsort(command, kind="stable")[every]
    V = np.nan_to_num(values.get("airspeed_m_s", np.zeros(none.size)))[rows]
    one_wind = np.abs(V[some] - V[:, None]) <= _STEADY_WIND + _LIKE_WIND * np.abs(V[:, None])
    beyond = one_wind & (command[some] >= command[:, None])
    contradict = beyond & (speed[:, None] - speed[some] > math.log(_ODD)) & (load[some] > load[:, None])
    votes = contradict.sum(axis=1)
    none[rows] = (votes >= _FEWEST) & (votes > 0.5 * beyond.sum(axis=1))
    return none


def _shifts(points: Dataset, ramp: bool) -> dict[str, float]:
    """Half of what a load differs by on the way up and down, and the lag of a ramp, over its largest value."""
    out = dict.fromkeys(LOAD_CHANNELS, _LAG) if ramp else {}
    for name, loop in reduction(points).hysteresis.items():
        top = float(np.nanmax(np.abs(points[name])))
        out[name] = max(out.get(name, 0.0), 0.5 * abs(loop.difference) / top if top > 0.0 else 0.0)
    return out


def _reduced(imported: Dataset, diameter_m: float | None) -> tuple[Dataset, tuple[str, ...]]:
    """Steady points; for a slow ramp, which has hardly any, its rows."""
    try:
        steady = reduce(imported, diameter_m=diameter_m)
    except InputError:
        steady = None
    points = steady is not None and (reduction(steady).mode == "points" or _useful(steady) >= _ENOUGH)
    if steady is not None and (points or _stairs(steady, imported)):
        return steady, ()
    slow = _ramp(imported)
    if slow is not None:
        rows = reduce(slow, diameter_m=diameter_m, steady=True)
        if steady is None or _useful(rows) > 2 * _useful(steady):
            words = f"few steady points: {len(slow)} of {len(imported)} rows of a slow ramp are used as they are"
            return rows, (words,)
    return steady or reduce(imported, diameter_m=diameter_m), ()


def _stairs(steady: Dataset, imported: Dataset) -> bool:
    """Whether most samples, and most of the speeds, are those of the steady points: few plateaus, and no ramp."""
    how, rpm = reduction(steady), named(imported).values.get("rpm")
    if rpm is None or "rpm" not in steady:
        return False
    kept, seen = sum(map(len, how.rows)), (np.log(v[v > 0.0]) for v in (steady.rpm, rpm))
    still, every = (float(np.ptp(v)) if v.size else 0.0 for v in seen)
    return still > 0.5 * every and kept > sum(len(gone.lines) for gone in how.dropped if not gone.channel)


def _useful(points: Dataset) -> int:
    """Points with a speed and a load."""
    v = points.values
    loads = [np.isfinite(v[k]) for k in LOAD_CHANNELS if k in v]
    speed = np.isfinite(v["rpm"]) & (v["rpm"] > 0.0) if "rpm" in v else np.ones(len(points), dtype=bool)
    return int(np.sum(np.any(loads, axis=0) & speed)) if loads else 0


def _ramp(imported: Dataset) -> Dataset | None:
    """Rows of a record of samples at which the speed changes slowly and reads what its neighbours read."""
    seen = named(imported).values
    t, rpm = seen.get("time_s"), seen.get("rpm")
    if rpm is None or len(imported) < _ROWS:
        return None
    if t is None:
        return imported
    speed, half = np.where(rpm > 0.0, np.log(np.where(rpm > 0.0, rpm, 1.0)), np.nan), _WINDOW // 2
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(speed, half, constant_values=np.nan), _WINDOW)
    with np.errstate(all="ignore"):
        full = np.isfinite(windows).sum(axis=1) > half
        middle = np.array([np.nanmedian(w) if ok else np.nan for w, ok in zip(windows, full, strict=True)])
        rest = np.abs(windows - middle[:, None])
        far = np.array([np.nanmedian(w) if ok else np.nan for w, ok in zip(rest, full, strict=True)])
        rate = np.abs(np.gradient(middle, t))
    keep = np.isfinite(middle) & (np.abs(speed - middle) < _JUMP) & (far < _JUMP) & (rate < _RATE)
    return imported.select(keep) if keep.sum() >= _ROWS else None


LOADS = {"thrust": ("thrust_N", "CT"), "torque": ("torque_Nm", "power_W", "CP", "CQ", "electrical_power_W")}
"""Loads of the rotor: first what a cell reads, then what stands for it; electrical power only at like voltage."""
DRIVE = {"speed": ("rpm",), "electrical": ("electrical_power_W",), "voltage": ("voltage_V",)}
"""Drive behind the rotor: speed and voltage at equal command, electrical power at equal speed."""
WITHOUT_SPEED = {"at_power": "electrical power", "at_command": "command"}
"""What thrust is compared at where no speed is recorded: electrical power first, which leaves the battery out; at rest
T ~ P^(2/3) of an ideal rotor."""
OVER_COMMAND = ("speed", "voltage", "at_command")
POWER_OF_SPEED = {"thrust_N": 2.0, "torque_Nm": 2.0, "power_W": 3.0, "electrical_power_W": 3.0}
_COEFFICIENTS = ("CT", "CP", "CQ")

# Readings below this share of the channel's largest say more of the zero than of the rotor.
_SMALL = 0.04
# A motor that has just set off, and a controller that idles, follow no law.
_STARTED = {"rpm": 0.3, "electrical_power_W": 0.1}
# A coefficient below this share of its largest is near zero thrust: a ratio means nothing there.
_NEAR_ZERO = 0.15
MOST = 60
"""Points of a recording in the fit; more are averaged with their neighbours in speed. [1]"""
SESSION = {"thrust": 0.007, "torque": 0.010, "speed": 0.015, "electrical": 0.02, "voltage": 0.02,
           "at_power": math.hypot(0.007, 0.02 / 1.5), "at_command": math.hypot(0.007, 2.0 * 0.015)}  # fmt: skip
"""Standard deviation of the level of one run where the recordings do not show it, share: two runs differ by 1.4 times
this. Repeated runs of one stand that were set up anew differ by 1 % in thrust and 1.4 % in torque (runs of the UIUC
Propeller Database and of J. Majewski's stand, seen here); electrical power at equal speed by 2.6 %, its losses with it
(68 pairs of runs of that stand: 1.8 % per run, and as much along the speed)."""
FOLLOWS_LOAD = 0.25
"""Standard deviation of the power with which electrical power at one speed follows the torque, about 1: 0.78 +- 0.12 of
119 pairs of runs of six motors with two propellers (J. Majewski's stand) [1]."""
# Level of the speed where the voltage is known.
_AT_KNOWN_VOLTAGE = 0.01
BY_THERMOMETER = 0.012
"""Standard deviation of the density ratio of two days at one site where temperatures alone are known: pressures of days
differ by 8 hPa. [1]"""
_LIKE = 0.1
MARGIN = 0.06
"""What a range of speed (natural logarithm) or of advance (share of its width) may be exceeded by. [1]"""
# Runs whose speeds of rotation are this close, natural logarithm, are runs at one speed.
_ONE_SPEED = 0.02


class LeftOut(NamedTuple):
    """Readings of one channel of one recording that are not compared."""

    why: str
    letter: str  # A or B
    where: tuple[str, ...]  # Lines of the file, or a range


@dataclass(frozen=True, eq=False)
class MatchedChannel:
    """One channel of both recordings."""

    name: str  # thrust, torque, speed, electrical or voltage
    channel: str  # Name of the reading
    # (N,) logarithm of the reading over its power of the speed, and over the density where both recordings tell it [1]
    y: Array
    x: Array  # (N, 2) ln rpm or pulse width [s] or throttle [1], and advance ratio or advance per turn [m]
    second: NDArray[np.bool_]  # (N,) whether a point is of B
    run: NDArray[np.intp]  # (N,) runs, numbered through
    floor: Array  # (N,) largest reading over this one [1]
    u: Array  # (N,) stated relative uncertainty [1]; 0: none
    log_density: float  # ln of B's density over A's that was taken out of y [1]
    session: float  # Standard deviation of the level of a run, share [1]
    notes: tuple[str, ...] = ()  # What was left out
    # (N,) standard deviation of the shift of a run by lag or hysteresis, share of full scale [1]
    shift: Array | None = None
    turned: bool = False  # Whether B has the other sign
    left: tuple[LeftOut, ...] = ()  # What is not compared

    def common(self) -> tuple[float, float]:
        """Range of the first coordinate that both recordings have; low above high: none."""
        a, b = self.x[~self.second, 0], self.x[self.second, 0]
        low, high = max(float(a.min()), float(b.min())), min(float(a.max()), float(b.max()))
        if self.name not in OVER_COMMAND and high < low < high + _ONE_SPEED:
            return high, low
        return low, high

    def common_advance(self) -> tuple[float, float]:
        """Range of the second coordinate that both recordings have; low above high: none."""
        a, b = self.x[~self.second, 1], self.x[self.second, 1]
        return max(float(a.min()), float(b.min())), min(float(a.max()), float(b.max()))

    def advance_moves(self) -> bool:
        """Whether advance ratio differs between points."""
        return bool(np.ptp(self.x[:, 1]) > 1e-9)


def like_voltage(a: StandRun, b: StandRun) -> bool:
    """Whether motor and controller work at like voltages, so that electrical power may stand for torque."""
    v = [float(np.nanmedian(r.points.voltage_V)) if "voltage_V" in r.points else math.nan for r in (a, b)]
    return like_volts(v[0], v[1])


def like_volts(a: float, b: float) -> bool:
    """Whether two voltages [V] are alike; not where one is unknown."""
    return a > 0.0 and b > 0.0 and abs(math.log(b / a)) < _LIKE


def advance(run: StandRun, diameter: float) -> Array:
    """V/(n D), or V/n [m] without a diameter; zero where no airspeed was recorded."""
    if "J" in run.points:
        return np.asarray(np.nan_to_num(run.points.J))
    V = np.nan_to_num(run.points.values.get("airspeed_m_s", np.zeros(len(run))))
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = V / (run.points.rpm / 60.0)
    return np.asarray(np.nan_to_num(turn / (diameter if math.isfinite(diameter) else 1.0)))


@dataclass(frozen=True)
class _Readings:
    """N points of one channel in one recording, as in `MatchedChannel`."""

    y: Array
    x: Array
    floor: Array
    u: Array
    run: Array
    sign: float
    left: Mapping[str, tuple[str, ...]]  # Lines that are not compared, by the reason


def _readings(run: StandRun, name: str, channel: str, diameter: float) -> _Readings | None:
    v = run.points.values.get(channel)
    if v is None or np.isfinite(v).sum() < 2:
        return None
    rpm = run.points.values.get("rpm")
    over_command = name in OVER_COMMAND
    if over_command and "command" not in run.points:
        return None
    if rpm is None and channel not in _COEFFICIENTS and name not in WITHOUT_SPEED:
        return None
    if name == "at_power":
        if "electrical_power_W" not in run.points:
            return None
        speed, to = run.points.electrical_power_W, 1.0 / 1.5
    else:
        speed = rpm if rpm is not None else np.ones(len(run))
        to = 0.0 if name == "at_command" else POWER_OF_SPEED.get(channel, 0.0)
    first = run.points.command if over_command else np.log(np.where(speed > 0.0, speed, np.nan))
    sign = float(np.sign(np.nansum(v)))
    size = np.where(v * sign > 0.0, v * sign, np.nan)
    top = float(np.nanmax(size)) if np.isfinite(size).any() else math.nan
    scaled = size / speed**to
    good = np.isfinite(scaled) & np.isfinite(first) & (size > _STARTED.get(channel, _SMALL) * top) & (speed > 0.0)
    if name in LOADS:
        level = np.nanpercentile(np.where(good, scaled, np.nan), 90) if good.any() else math.nan
        good &= scaled > _NEAR_ZERO * level
    if good.sum() < 2:
        return None
    missing = ~(np.isfinite(v) & np.isfinite(speed) & (np.isfinite(run.points.command) if over_command else True))
    lines = [label.rpartition(":")[2] for label in run.points.labels] or [f"{k + 1}" for k in range(len(run))]
    left = {why: tuple(lines[k] for k in np.flatnonzero(here))
            for why, here in (("none", missing), ("zero", ~good & ~missing))}  # fmt: skip
    stated = run.points.u[channel] / size
    still = over_command or name in WITHOUT_SPEED
    x = np.column_stack([first, np.zeros(len(run)) if still else advance(run, diameter)])
    runs = run.points.values.get("run", np.zeros(len(run)))
    return _Readings(np.log(scaled[good]), x[good], top / size[good], np.nan_to_num(stated[good]), runs[good], sign,
                     left)  # fmt: skip


def _averaged(part: _Readings) -> _Readings:
    """Fewer points where there are many: means of neighbours in speed within a run."""
    n = part.y.size
    if n <= MOST:
        return part
    order = np.lexsort((part.x[:, 0], np.round(part.x[:, 1], 2), part.run))
    block = np.empty(n, dtype=np.intp)
    block[order] = np.arange(n) * MOST // n
    starts = np.r_[True, np.diff(part.run[order]) != 0]
    block[order] += np.cumsum(starts)
    _, block = np.unique(block, return_inverse=True)
    count = np.bincount(block)

    def mean(v: Array) -> Array:
        return np.asarray(np.bincount(block, v) / count)

    x = np.column_stack([mean(part.x[:, k]) for k in (0, 1)])
    return replace(part, y=mean(part.y), x=x, floor=mean(part.floor), u=mean(part.u), run=mean(part.run))


def matched(a: StandRun, b: StandRun, name: str, diameter: float) -> MatchedChannel | None:
    """Bring one channel of two recordings together."""
    if name in OVER_COMMAND and (a.command != b.command or not a.command):
        return None
    for channel in {**LOADS, **DRIVE}.get(name, ("thrust_N",)):
        one, two = (_readings(run, name, channel, diameter) for run in (a, b))
        alike = name not in LOADS or channel != "electrical_power_W" or like_voltage(a, b)
        if one and two and alike:
            break
    else:
        return None
    turned = one.sign != two.sign
    notes = [f"{channel}: changed sign between A and B; sizes are compared"] if turned else []
    left = [LeftOut(why, letter, where) for letter, part in (("A", one), ("B", two))
            for why, where in part.left.items() if where]  # fmt: skip
    one, two = _averaged(one), _averaged(two)
    if name in OVER_COMMAND and a.by_throttle and b.by_throttle:  # as both were typed
        one, two = (replace(part, x=np.column_stack([throttle_of(part.x[:, 0]), part.x[:, 1]])) for part in (one, two))
    log_density, unsure = density_change(a, b) if name in LOADS and channel not in _COEFFICIENTS else (0.0, 0.0)
    runs, more = (np.unique(part.run, return_inverse=True)[1] for part in (one, two))
    seen = [run.session.get(channel, 0.0) for run in (a, b)]
    x, floor, u = (np.concatenate([getattr(part, k) for part in (one, two)]) for k in ("x", "floor", "u"))
    shift = np.repeat([run.shift.get(channel, 0.0) for run in (a, b)], [one.y.size, two.y.size])
    return MatchedChannel(
        name, channel, np.concatenate([one.y, two.y - log_density]), x,
        np.repeat([False, True], [one.y.size, two.y.size]), np.concatenate([runs, more + runs.max() + 1]), floor, u,
        log_density, math.hypot(max(_set_up(name, channel, a, b), *seen), unsure), tuple(notes), shift, turned,
        tuple(left),
    )  # fmt: skip


def density_change(a: StandRun, b: StandRun) -> tuple[float, float]:
    """Logarithm of the density of B over that of A as recorded, and what a thermometer alone leaves open.

    >>> from bemt.physics.dataset import Dataset
    >>> none = Dataset("bench", "none", {"rpm": []})
    >>> warm, cold = (StandRun(none, "", math.nan, math.nan, T) for T in (300.0, 285.0))
    >>> round(density_change(warm, cold)[0], 3)
    0.051
    """
    if math.isfinite(a.density) and math.isfinite(b.density):
        return math.log(b.density / a.density), 0.0
    if math.isfinite(a.temperature_K) and math.isfinite(b.temperature_K):
        return math.log(a.temperature_K / b.temperature_K), BY_THERMOMETER
    return 0.0, 0.0


def _set_up(name: str, channel: str, a: StandRun, b: StandRun) -> float:
    """Standard deviation of the level of one run where the recordings do not show it."""
    if channel == "electrical_power_W":
        return SESSION["electrical"]
    if name == "speed" and all("voltage_V" in r.points for r in (a, b)):
        return _AT_KNOWN_VOLTAGE
    return SESSION[name]


def losses_differ(change: Array | float) -> Array:
    """What a torque from electrical power is off by, share, where the power at one speed changed by ln ``change``.

    One motor in both runs: its losses are those of the other run but for what moves them, the day and the load.
    """
    return np.hypot(SESSION["electrical"], FOLLOWS_LOAD * np.asarray(change))


def taken(c: MatchedChannel, keep: NDArray[np.bool_]) -> MatchedChannel:
    """Some of the points."""
    columns = ("y", "x", "second", "run", "floor", "u", "shift")
    return replace(c, **{k: v[keep] for k in columns if (v := getattr(c, k)) is not None})


def in_common(c: MatchedChannel) -> MatchedChannel:
    """Points where both recordings were, with a margin; all where they have no range in common."""
    low, high = c.common()
    margin = MARGIN if c.name not in OVER_COMMAND else MARGIN * float(np.ptp(c.x[:, 0]))
    keep = (c.x[:, 0] >= low - margin) & (c.x[:, 0] <= high + margin)
    slow, fast = c.common_advance()
    if slow < fast:
        margin = MARGIN * float(np.ptp(c.x[:, 1]))
        keep &= (c.x[:, 1] >= slow - margin) & (c.x[:, 1] <= fast + margin)
    enough = min(keep[c.second].sum(), keep[~c.second].sum()) >= 2
    if low > high or not enough:
        return c
    return replace(taken(c, keep), left=(*c.left, *_beyond(c, keep)))


def _beyond(c: MatchedChannel, keep: NDArray[np.bool_]) -> Iterator[LeftOut]:
    """Speeds and advance ratios at which one of two recordings alone was."""
    if c.name not in (*LOADS, "electrical"):
        return
    low, high = c.common()
    for letter, mine in (("A", ~c.second), ("B", c.second)):
        x = c.x[mine & ~keep]
        slow, fast = x[:, 0] < low, x[:, 0] > high
        for some_, k, unit in ((slow, 0, " rev/min"), (fast, 0, " rev/min"), (~slow & ~fast, 1, " of advance")):
            if some_.any():
                v = np.exp(x[some_, k]) if k == 0 else x[some_, k]
                ends = dict.fromkeys(f"{end:.{0 if k == 0 else 2}f}" for end in (v.min(), v.max()))
                yield LeftOut("beyond", letter, (f"{' to '.join(ends)}{unit}",))

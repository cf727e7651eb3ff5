"""Two recordings of one stand, channel by channel at equal speed.

A load divided by its own power of the speed (thrust by n^2, torque by n^2, power by n^3) hardly changes with speed,
so that its logarithm is a smooth curve over ln n and advance ratio.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.compare.stand_run import StandRun

LOADS = {"thrust": ("thrust_N", "CT"), "torque": ("torque_Nm", "power_W", "CP", "CQ", "electrical_power_W")}
"""Loads of the rotor: first what a cell reads, then what stands for it; electrical power only at like voltage."""
DRIVE = {"speed": ("rpm",), "electrical": ("electrical_power_W",), "voltage": ("voltage_V",)}
"""Drive behind the rotor: speed and voltage at equal command, electrical power at equal speed."""
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
SESSION = {"thrust": 0.007, "torque": 0.010, "speed": 0.015, "electrical": 0.02, "voltage": 0.02}
"""Standard deviation of the level of one run where the recordings do not show it, share: two runs differ by 1.4 times
this. Repeated runs of one stand that were set up anew differ by 1 % in thrust and 1.4 % in torque (runs of the UIUC
Propeller Database and of J. Majewski's stand, seen here)."""
BY_POWER = 0.03
"""What the losses of a motor differ by from run to run, where electrical power stands for torque, share."""
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


@dataclass(frozen=True, eq=False)
class MatchedChannel:
    """One channel of both recordings."""

    name: str  # thrust, torque, speed, electrical or voltage
    channel: str  # Name of the reading
    # (N,) logarithm of the reading over its power of the speed, and over the density where both recordings tell it [1]
    y: Array
    x: Array  # (N, 2) ln rpm or the command, and advance ratio or advance per turn [m]
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

    def common(self) -> tuple[float, float]:
        """Range of the first coordinate that both recordings have; low above high: none."""
        a, b = self.x[~self.second, 0], self.x[self.second, 0]
        low, high = max(float(a.min()), float(b.min())), min(float(a.max()), float(b.max()))
        if self.name not in ("speed", "voltage") and high < low < high + _ONE_SPEED:
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
    v = [np.nanmedian(r.points["voltage_V"]) if "voltage_V" in r.points else math.nan for r in (a, b)]
    return bool(abs(math.log(v[1] / v[0])) < _LIKE) if all(x > 0.0 for x in v) else False


def advance(run: StandRun, diameter: float) -> Array:
    """V/(n D), or V/n [m] without a diameter; zero where no airspeed was recorded."""
    if "J" in run.points:
        return np.asarray(np.nan_to_num(run.points["J"]))
    V = np.nan_to_num(run.points.values.get("airspeed_m_s", np.zeros(len(run))))
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = V / (run.points["rpm"] / 60.0)
    return np.asarray(np.nan_to_num(turn / (diameter if math.isfinite(diameter) else 1.0)))


def _readings(run: StandRun, name: str, channel: str, diameter: float) -> dict[str, Array] | None:
    """Points of one channel in one recording."""
    v = run.points.values.get(channel)
    if v is None or np.isfinite(v).sum() < 2:
        return None
    rpm = run.points.values.get("rpm")
    over_command = name in ("speed", "voltage")
    if over_command and "command" not in run.points:
        return None
    if rpm is None and (name not in LOADS or channel not in _COEFFICIENTS):
        return None
    speed = rpm if rpm is not None else np.ones(len(run))
    first = run.points["command"] if over_command else np.log(np.where(speed > 0.0, speed, np.nan))
    sign = float(np.sign(np.nansum(v)))
    size = np.where(v * sign > 0.0, v * sign, np.nan)
    top = float(np.nanmax(size)) if np.isfinite(size).any() else math.nan
    scaled = size / speed ** POWER_OF_SPEED.get(channel, 0.0)
    good = np.isfinite(scaled) & np.isfinite(first) & (size > _STARTED.get(channel, _SMALL) * top) & (speed > 0.0)
    if name in LOADS:
        level = np.nanpercentile(np.where(good, scaled, np.nan), 90) if good.any() else math.nan
        good &= scaled > _NEAR_ZERO * level
    if good.sum() < 2:
        return None
    stated = run.points.u[channel] / size
    return {
        "y": np.log(scaled[good]),
        "x": np.column_stack([first, advance(run, diameter) if not over_command else np.zeros(len(run))])[good],
        "floor": top / size[good],
        "u": np.nan_to_num(stated[good]),
        "sign": np.full(int(good.sum()), sign),
        "run": run.points.values.get("run", np.zeros(len(run)))[good],
        "lost": np.full(int(good.sum()), float((~good).sum())),
    }


def _averaged(part: dict[str, Array]) -> dict[str, Array]:
    """Fewer points where there are many: means of neighbours in speed within a run."""
    n = part["y"].size
    if n <= MOST:
        return part
    order = np.lexsort((part["x"][:, 0], np.round(part["x"][:, 1], 2), part["run"]))
    block = np.empty(n, dtype=np.intp)
    block[order] = np.arange(n) * MOST // n
    starts = np.r_[True, np.diff(part["run"][order]) != 0]
    block[order] += np.cumsum(starts)
    _, block = np.unique(block, return_inverse=True)
    count = np.bincount(block)

    def mean(v: Array) -> Array:
        return np.asarray(np.bincount(block, v) / count)

    out = {k: mean(v) for k, v in part.items() if v.ndim == 1}
    return {**out, "x": np.column_stack([mean(part["x"][:, k]) for k in (0, 1)])}


def matched(a: StandRun, b: StandRun, name: str, diameter: float = math.nan) -> MatchedChannel | None:
    """Bring one channel of two recordings together."""
    choices = {**LOADS, **DRIVE}[name]
    if name in ("speed", "voltage") and (a.command != b.command or not a.command):
        return None
    for channel in choices:
        if name in LOADS and channel == "electrical_power_W" and not like_voltage(a, b):
            continue
        one, two = _readings(a, name, channel, diameter), _readings(b, name, channel, diameter)
        if one is not None and two is not None:
            break
    else:
        return None
    notes = []
    turned = bool(one["sign"][0] != two["sign"][0])
    if turned:
        notes.append(f"{channel}: changed sign between A and B; sizes are compared")
    parts = [_averaged(one), _averaged(two)]
    for part, run, letter in zip(parts, (a, b), "AB", strict=True):
        if part["lost"][0] > 0.5 * len(run):
            notes.append(f"{channel}: {part['lost'][0]:.0f} of {len(run)} points of {letter} left out: near zero")
    log_density, unsure = density_change(a, b) if name in LOADS and channel not in _COEFFICIENTS else (0.0, 0.0)
    shift = [0.0, log_density]
    codes = [np.unique(p["run"], return_inverse=True)[1] for p in parts]
    codes[1] = codes[1] + codes[0].max() + 1
    seen = [r.session.get(channel, 0.0) for r in (a, b)]
    return MatchedChannel(
        name,
        channel,
        np.concatenate([p["y"] - s for p, s in zip(parts, shift, strict=True)]),
        np.concatenate([p["x"] for p in parts]),
        np.repeat([False, True], [p["y"].size for p in parts]),
        np.concatenate(codes),
        np.concatenate([p["floor"] for p in parts]),
        np.concatenate([p["u"] for p in parts]),
        log_density,
        math.hypot(max(_set_up(name, channel, a, b), *seen), unsure),
        tuple(notes),
        np.repeat([a.shift.get(channel, 0.0), b.shift.get(channel, 0.0)], [p["y"].size for p in parts]),
        turned,
    )


def log_range(x: Array, margin: float) -> tuple[float, float]:
    """Range of a coordinate, widened by a margin of its width."""
    wider = margin * max(float(np.ptp(x)), 1e-12)
    return float(x.min()) - wider, float(x.max()) + wider


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
    if name in LOADS and channel == "electrical_power_W":
        return BY_POWER
    if name == "speed" and all("voltage_V" in r.points for r in (a, b)):
        return _AT_KNOWN_VOLTAGE
    return SESSION[name]


def taken(c: MatchedChannel, keep: NDArray[np.bool_]) -> MatchedChannel:
    """Some of the points."""
    columns = ("y", "x", "second", "run", "floor", "u", "shift")
    return replace(c, **{k: v[keep] for k in columns if (v := getattr(c, k)) is not None})


def in_common(c: MatchedChannel) -> MatchedChannel:
    """Points where both recordings were, with a margin; all where they have no range in common."""
    low, high = c.common()
    margin = MARGIN if c.name not in ("speed", "voltage") else MARGIN * float(np.ptp(c.x[:, 0]))
    keep = (c.x[:, 0] >= low - margin) & (c.x[:, 0] <= high + margin)
    slow, fast = c.common_advance()
    if slow < fast:
        margin = MARGIN * float(np.ptp(c.x[:, 1]))
        keep &= (c.x[:, 1] >= slow - margin) & (c.x[:, 1] <= fast + margin)
    enough = min(keep[c.second].sum(), keep[~c.second].sum()) >= 2
    return taken(c, keep) if low <= high and enough else c

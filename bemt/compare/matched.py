"""Two recordings of one stand, channel by channel at equal speed: a smooth fit and what it leaves between them.

A load divided by its own power of the speed (thrust by n^2, torque by n^2, power by n^3) hardly changes with speed,
so that its logarithm is a smooth curve g over ln n and advance ratio. Both recordings follow the same curve; the second
lies ``d`` above it. All of it is one Gaussian model,

    y = g(x) + [second] d(x) + s(run, x) + e,

with a wide prior for g (linear, plus a Gaussian process), a session term s (level, slow bend and a shift of the zero
of every run), and scatter e of a share and a part of full scale, which is as large as the readings make likeliest
(Rasmussen and Williams, Gaussian Processes for Machine Learning, MIT Press 2006, eq. 2.30 and 2.37 to 2.42).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.compare.stand_run import StandRun

Array = NDArray[np.float64]

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
# Electrical power for torque: efficiency of a drive that is warm or cold; speed where the voltage is known.
_BY_POWER, _AT_KNOWN_VOLTAGE = 0.03, 0.01
_BEND, _ZERO, _STEEP = 0.7, 0.0015, 0.15
BY_THERMOMETER = 0.012
"""Standard deviation of the density ratio of two days at one site where temperatures alone are known: pressures of days
differ by 8 hPa. [1]"""
_LENGTH_SPEED, _LENGTH_ADVANCE = 0.5, 0.35
_SHARES = (0.001, 0.002, 0.004, 0.008, 0.015, 0.03, 0.06, 0.1)
_FLOORS = (0.0, 0.0007, 0.002, 0.005, 0.012)
_WIGGLES = (0.0, 0.004, 0.01, 0.02)
_BENDS = (0.02, 0.1, 0.3, 1.0)
_FAR, _MARGIN, _LIKE = 3.5, 0.06, 0.1
# Runs whose speeds of rotation are this close, natural logarithm, are runs at one speed.
_ONE_SPEED = 0.02
_LOCAL = 3.0


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


@dataclass(frozen=True)
class Scatter:
    """Of single readings: ``share`` of the reading, ``floor`` of full scale.

    ``wiggle`` is what neighbours in speed share within a run, ``bend`` the size of the bends of the common curve.
    """

    share: float
    floor: float
    wiggle: float
    bend: float


def _like_voltage(a: StandRun, b: StandRun) -> bool:
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
        if name in LOADS and channel == "electrical_power_W" and not _like_voltage(a, b):
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


def density_change(a: StandRun, b: StandRun) -> tuple[float, float]:
    """Logarithm of the density of B over that of A as recorded, and what a thermometer alone leaves open.

    >>> from bemt.dataset import Dataset
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
        return _BY_POWER
    if name == "speed" and all("voltage_V" in r.points for r in (a, b)):
        return _AT_KNOWN_VOLTAGE
    return SESSION[name]


def _lengths(c: MatchedChannel) -> Array:
    """Length scales of the curve, in the coordinates of the channel."""
    first = _LENGTH_SPEED if c.name not in ("speed", "voltage") else 0.4 * max(float(np.ptp(c.x[:, 0])), 1e-12)
    return np.array([first, _LENGTH_ADVANCE * max(float(np.ptp(c.x[:, 1])), 1e-9)])


def unit_coordinates(c: MatchedChannel) -> Array:
    """First and second coordinate from their means, in length scales, (N, 2)."""
    return np.asarray((c.x - c.x.mean(axis=0)) / _lengths(c))


def smooth_kernel(c: MatchedChannel, shorter: float = 1.0) -> Array:
    """Squared-exponential kernel of unit variance over the coordinates, (N, N)."""
    z = unit_coordinates(c) * shorter
    return np.asarray(np.exp(-0.5 * ((z[:, None, :] - z[None, :, :]) ** 2).sum(axis=2)))


def covariance(c: MatchedChannel, s: Scatter) -> Array:
    """Covariance of y where nothing was changed: curve, sessions, zeros, scatter, (N, N)."""
    z = unit_coordinates(c)
    K = smooth_kernel(c)
    same = (c.run[:, None] == c.run[None, :]).astype(float)
    # a coefficient changes little with speed (Reynolds, Mach), anyhow with advance; the drive changes anyhow
    steep = _STEEP**2 if c.name in LOADS else 4.0
    wide = 100.0 + steep * np.outer(z[:, 0], z[:, 0]) + 4.0 * np.outer(z[:, 1], z[:, 1])
    wide += 4.0 * np.outer(z[:, 1] ** 2, z[:, 1] ** 2)
    side = (c.second[:, None] == c.second[None, :]).astype(float)
    # the level is the stand's, set up once per recording; half of its variance goes with the single run
    level = c.session**2 * (0.7 * side + 0.3 * same + _BEND**2 * same * K)
    shift = c.floor * (_ZERO if c.shift is None else np.maximum(c.shift, _ZERO))
    zero = same * np.outer(shift, shift) if c.name in LOADS else 0.0
    spread = s.share**2 + (s.floor * c.floor) ** 2 + c.u**2
    local = s.wiggle**2 * same * smooth_kernel(c, _LOCAL) if s.wiggle else 0.0
    return np.asarray(wide + s.bend**2 * K + level + zero + local + np.diag(spread))


def _level(c: MatchedChannel) -> float:
    """Prior standard deviation of ln B/A: wider where levels are far apart, or a large ratio would pass for scatter."""
    return max(0.3, 0.5 * abs(float(c.y[c.second].mean() - c.y[~c.second].mean())))


def change_of_any_kind(c: MatchedChannel, level: float = 1.0, bend: float = 0.1, local: float = 0.06) -> Array:
    """Prior covariance of a change d at all points, whichever recording they are of, (N, N)."""
    z = unit_coordinates(c)
    line = (level * _level(c)) ** 2 + 0.2**2 * (np.outer(z[:, 0], z[:, 0]) + np.outer(z[:, 1], z[:, 1]))
    wave = local**2 * smooth_kernel(c, _LOCAL) if local else 0.0
    return np.asarray(line + bend**2 * smooth_kernel(c) + wave)


def free_change(c: MatchedChannel, level: float = 1.0, bend: float = 0.1, local: float = 0.06) -> Array:
    """Covariance of a change of any smooth kind between the recordings, (N, N)."""
    b = c.second.astype(float)
    return np.asarray(change_of_any_kind(c, level, bend, local) * np.outer(b, b))


def log_likelihood(K: Array, y: Array) -> float:
    """Logarithm of the Gaussian density (Rasmussen and Williams, eq. 2.30)."""
    from scipy.linalg import cho_solve, cholesky

    L = cholesky(K, lower=True, check_finite=False)
    alpha = cho_solve((L, True), y, check_finite=False)
    return float(-0.5 * y @ alpha - np.log(np.diag(L)).sum() - 0.5 * y.size * math.log(2.0 * math.pi))


def steady_change(c: MatchedChannel) -> Array:
    """Covariance of a change by one factor, or nearly so, between the recordings, (N, N)."""
    z, b = unit_coordinates(c), c.second.astype(float)
    line = _level(c) ** 2 + 0.03**2 * (np.outer(z[:, 0], z[:, 0]) + np.outer(z[:, 1], z[:, 1]))
    return np.asarray(line * np.outer(b, b))


def scatter_of(c: MatchedChannel, change: Array | None = None) -> tuple[Scatter, float]:
    """Scatter and bend that make the readings likeliest with such a change, and the logarithm of that likelihood."""
    change, y = free_change(c) if change is None else change, c.y - c.y.mean()
    ways = {
        "share": _SHARES if not c.u.any() else (0.0005, *_SHARES),
        "bend": _BENDS,
        "wiggle": _WIGGLES,
        "floor": _FLOORS if c.name in LOADS else (0.0,),
    }
    best, score = Scatter(0.008, 0.0, 0.0, 0.1), -math.inf
    for _ in range(2):
        for name, values in ways.items():
            for value in values:
                tried = replace(best, **{name: value})
                z = log_likelihood(covariance(c, tried) + change, y)
                if z > score:
                    best, score = tried, z
    return best, score


def without_strays(c: MatchedChannel) -> tuple[MatchedChannel, int]:
    """Leave out readings that all others contradict (left-one-out, Rasmussen and Williams, eq. 5.12)."""
    n = 0
    for _ in range(3):
        s, _ = scatter_of(c)
        y = c.y - c.y.mean()
        inverse = np.linalg.inv(covariance(c, s) + free_change(c))
        z = (inverse @ y) / np.sqrt(np.diag(inverse))
        worst = np.abs(z) > _FAR
        if not worst.any() or worst.sum() > max(1, 0.1 * y.size) or y.size - worst.sum() < 6:
            break
        n += int(worst.sum())
        keep = ~worst
        if min(keep[c.second].sum(), keep[~c.second].sum()) < 2:
            break
        c = taken(c, keep)
    return c, n


def taken(c: MatchedChannel, keep: NDArray[np.bool_]) -> MatchedChannel:
    """Some of the points."""
    columns = ("y", "x", "second", "run", "floor", "u", "shift")
    return replace(c, **{k: v[keep] for k in columns if (v := getattr(c, k)) is not None})


def ratio_of(c: MatchedChannel, s: Scatter) -> dict[str, Any]:
    """Ratio of B to A at equal speed."""
    from scipy.linalg import cho_factor, cho_solve

    free, y = free_change(c), c.y - c.y.mean()
    C = covariance(c, s) + free
    factor = cho_factor(C, lower=True)
    low, high = c.common()
    apart = low > high
    if apart:
        low, high = high, low
    inside = (c.x[:, 0] >= low - 0.01) & (c.x[:, 0] <= high + 0.01)
    at = np.flatnonzero(inside) if inside.any() else np.arange(y.size)
    b = c.second.astype(float)
    shape = change_of_any_kind(c)
    cross = shape[at] * b[None, :]
    d = cross @ cho_solve(factor, y)
    cov = shape[np.ix_(at, at)] - cross @ cho_solve(factor, cross.T)
    n = at.size
    weight = np.full(n, 1.0 / n)
    mean, sd = float(weight @ d), math.sqrt(max(float(weight @ cov @ weight), 0.0))
    out: dict[str, Any] = {"ratio": math.exp(mean)}
    for name, q in (("68", 1.0), ("95", 1.96)):
        out[f"low{name}"], out[f"high{name}"] = math.exp(mean - q * sd), math.exp(mean + q * sd)
    out |= _slopes(c, at, d, cov)
    order = at[np.argsort(c.x[at, 0])]
    back = {int(i): k for k, i in enumerate(at)}
    keep = order[np.unique(np.linspace(0, n - 1, min(n, 25)).round().astype(int))]
    e = np.sqrt(np.maximum(np.diag(cov), 0.0))
    rows = [back[int(i)] for i in keep]
    ends = [np.exp(d[rows] + q * e[rows]) for q in (0.0, -1.96, 1.96)]
    out["curve"] = np.column_stack([c.x[keep], *ends]).tolist()
    slow, fast = c.common_advance()
    out["apart"] = bool(slow > fast + _MARGIN * float(np.ptp(c.x[:, 1])))
    out["extrapolated"] = apart or out["apart"]
    out["range"] = [low, high]
    out["advance_range"] = [slow, fast]
    out["scatter"] = s.share
    out["points"] = [int((~c.second).sum()), int(c.second.sum())]
    return out


def _slopes(c: MatchedChannel, at: NDArray[np.intp], d: Array, cov: Array) -> dict[str, float]:
    """Least-squares slopes of d over ln n (per doubling) or the command, and over advance, with their errors."""
    out: dict[str, float] = {}
    names = ("slope", "advance_slope")
    unit = (
        math.log(2.0) if c.name not in ("speed", "voltage") else max(float(np.ptp(c.x[at, 0])), 1e-12),
        max(float(np.ptp(c.x[at, 1])), 1e-12),
    )
    columns = [k for k in (0, 1) if np.ptp(c.x[at, k]) > 1e-6]
    X = np.column_stack([np.ones(at.size), *((c.x[at, k] - c.x[at, k].mean()) / unit[k] for k in columns)])
    back = np.linalg.pinv(X)
    for j, k in enumerate(columns, 1):
        out[names[k]] = float(back[j] @ d)
        out[f"{names[k]}_error"] = math.sqrt(max(float(back[j] @ cov @ back[j]), 0.0))
    return out


def in_common(c: MatchedChannel) -> MatchedChannel:
    """Points where both recordings were, with a margin; all where they have no range in common."""
    low, high = c.common()
    margin = _MARGIN if c.name not in ("speed", "voltage") else _MARGIN * float(np.ptp(c.x[:, 0]))
    keep = (c.x[:, 0] >= low - margin) & (c.x[:, 0] <= high + margin)
    slow, fast = c.common_advance()
    if slow < fast:
        margin = _MARGIN * float(np.ptp(c.x[:, 1]))
        keep &= (c.x[:, 1] >= slow - margin) & (c.x[:, 1] <= fast + margin)
    enough = min(keep[c.second].sum(), keep[~c.second].sum()) >= 2
    return taken(c, keep) if low <= high and enough else c


@dataclass(frozen=True, eq=False)
class MatchedRuns:
    """Channels of one kind that both recordings have."""

    channels: Mapping[str, MatchedChannel]  # By name
    # Likeliest scatter if anything smooth, or one factor, changed between the recordings
    free: Mapping[str, Scatter]
    steady: Mapping[str, Scatter]
    likelier: Mapping[str, Scatter]  # The better of the two
    strays: Mapping[str, int]  # Readings that were left out
    bent: Mapping[str, float]  # Logarithm of the likelihood of any smooth change over that of one factor


def prepared(a: StandRun, b: StandRun, names: Sequence[str], diameter: float) -> MatchedRuns:
    """Match channels, and find their scatter."""
    channels: dict[str, MatchedChannel] = {}
    free: dict[str, Scatter] = {}
    steady: dict[str, Scatter] = {}
    likelier: dict[str, Scatter] = {}
    strays: dict[str, int] = {}
    bent: dict[str, float] = {}
    for name in names:
        found = matched(a, b, name, diameter)
        if found is not None:
            channels[name], n = without_strays(in_common(found))
            free[name], loose = scatter_of(channels[name])
            steady[name], stiff = scatter_of(channels[name], steady_change(channels[name]))
            likelier[name] = free[name] if loose > stiff else steady[name]
            bent[name] = loose - stiff
            if n:
                strays[name] = n
    return MatchedRuns(channels, free, steady, likelier, strays, bent)

"""What two recordings differ by: a smooth curve through both, and what it leaves between them.

Both recordings follow the same curve g; the second lies ``d`` above it. All of it is one Gaussian model,

    y = g(x) + [second] d(x) + s(run, x) + e,

with a wide prior for g (linear, plus a Gaussian process), a session term s (level, slow bend and a shift of the zero
of every run), and scatter e of a share and a part of full scale, which is as large as the readings make likeliest
(Rasmussen and Williams, Gaussian Processes for Machine Learning, MIT Press 2006, eq. 2.30 and 2.37 to 2.42).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.base.gaussian.kernels import alike, smooth
from bemt.base.gaussian.whitening import leave_one_out, log_density, whitener
from bemt.judge.compare.matched import LOADS, MARGIN, OVER_COMMAND, MatchedChannel, StandRun, in_common, matched, taken

BEND = 0.7
"""Slow bend of what a run differs by from others, over its level [1]."""
_ZERO, _STEEP = 0.0015, 0.15
_LENGTH_SPEED, _LENGTH_ADVANCE = 0.5, 0.35
_SHARES = (0.001, 0.002, 0.004, 0.008, 0.015, 0.03, 0.06, 0.1)
_FLOORS = (0.0, 0.0007, 0.002, 0.005, 0.012)
_WIGGLES = (0.0, 0.004, 0.01, 0.02)
_BENDS = (0.02, 0.1, 0.3, 1.0)
_FAR, _LOCAL = 3.5, 3.0
_MOVED = 2.5  # Errors from which a slope is said


@dataclass(frozen=True)
class Scatter:
    """Of single readings: ``share`` of the reading, ``floor`` of full scale.

    ``wiggle`` is what neighbours in speed share within a run, ``bend`` the size of the bends of the common curve.
    """

    share: float
    floor: float
    wiggle: float
    bend: float


def _lengths(c: MatchedChannel) -> Array:
    """Length scales of the curve, in the coordinates of the channel."""
    first = _LENGTH_SPEED if c.name not in OVER_COMMAND else 0.4 * max(float(np.ptp(c.x[:, 0])), 1e-12)
    return np.array([first, _LENGTH_ADVANCE * max(float(np.ptp(c.x[:, 1])), 1e-9)])


def unit_coordinates(c: MatchedChannel) -> Array:
    """First and second coordinate from their means, in length scales, (N, 2)."""
    return np.asarray((c.x - c.x.mean(axis=0)) / _lengths(c))


def smooth_kernel(c: MatchedChannel, shorter: float = 1.0) -> Array:
    """Squared-exponential kernel of unit variance over the coordinates, (N, N)."""
    return smooth(*((z, 1.0 / shorter) for z in unit_coordinates(c).T))


def covariance(c: MatchedChannel, s: Scatter) -> Array:
    """Covariance of y where nothing was changed: curve, sessions, zeros, scatter, (N, N)."""
    return _covariances(c)(s)


def _covariances(c: MatchedChannel) -> Callable[[Scatter], Array]:
    """The same for any scatter: what does not depend on it is worked out once."""
    z = unit_coordinates(c)
    K, short = smooth_kernel(c), smooth_kernel(c, _LOCAL)
    same, side = (alike(label).astype(float) for label in (c.run, c.second))
    # a coefficient changes little with speed (Reynolds, Mach), anyhow with advance; the drive changes anyhow
    steep = _STEEP**2 if c.name in LOADS else 4.0
    wide = 100.0 + steep * np.outer(z[:, 0], z[:, 0]) + 4.0 * np.outer(z[:, 1], z[:, 1])
    wide += 4.0 * np.outer(z[:, 1] ** 2, z[:, 1] ** 2)
    # the level is the stand's, set up once per recording; half of its variance goes with the single run
    level = c.session**2 * (0.7 * side + 0.3 * same + BEND**2 * same * K)
    shift = c.floor * (_ZERO if c.shift is None else np.maximum(c.shift, _ZERO))
    zero = same * np.outer(shift, shift) if c.name in LOADS else 0.0

    def of(s: Scatter) -> Array:
        spread = s.share**2 + (s.floor * c.floor) ** 2 + c.u**2
        local = s.wiggle**2 * same * short if s.wiggle else 0.0
        return np.asarray(wide + s.bend**2 * K + level + zero + local + np.diag(spread))

    return of


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


def steady_change(c: MatchedChannel) -> Array:
    """Covariance of a change by one factor, or nearly so, between the recordings, (N, N)."""
    z, b = unit_coordinates(c), c.second.astype(float)
    line = _level(c) ** 2 + 0.03**2 * (np.outer(z[:, 0], z[:, 0]) + np.outer(z[:, 1], z[:, 1]))
    return np.asarray(line * np.outer(b, b))


def scatter_of(c: MatchedChannel, change: Array | None = None) -> tuple[Scatter, float]:
    """Scatter and bend that make the readings likeliest with such a change, and the logarithm of that likelihood."""
    change, y = free_change(c) if change is None else change, c.y - c.y.mean()
    ways = {
        "share": _SHARES if not c.u.any() else (0.0005, *_SHARES), "bend": _BENDS, "wiggle": _WIGGLES,
        "floor": _FLOORS if c.name in LOADS else (0.0,),
    }  # fmt: skip
    best, score = Scatter(0.008, 0.0, 0.0, 0.1), -math.inf
    of, tried = _covariances(c), set[Scatter]()
    for _ in range(2):
        for name, values in ways.items():
            for value in values:
                way = replace(best, **{name: value})
                if way in tried:
                    continue
                tried.add(way)
                z = log_density(of(way) + change, y)
                if z > score:
                    best, score = way, z
    return best, score


def without_strays(c: MatchedChannel) -> tuple[MatchedChannel, MatchedChannel, tuple[Scatter, float]]:
    """Leave out readings that all others contradict (each predicted by the rest); gives these too.

    Last the scatter of the others, as of :func:`scatter_of`.
    """
    whole, left, found = c, np.ones(c.y.size, dtype=bool), scatter_of(c)
    for _ in range(3):
        y = c.y - c.y.mean()
        worst = np.abs(leave_one_out(covariance(c, found[0]) + free_change(c), y)) > _FAR
        if not worst.any() or worst.sum() > max(1, 0.1 * y.size) or y.size - worst.sum() < 6:
            break
        keep = ~worst
        if min(keep[c.second].sum(), keep[~c.second].sum()) < 2:
            break
        c = taken(c, keep)
        left[left] = keep
        found = scatter_of(c)
    return c, taken(whole, ~left), found


class Ratio(Documented):
    """B over A of one channel at equal speed, or equal command for the drive."""

    kind: str  # thrust, torque, speed, voltage or electrical; at_power, at_command: thrust without a speed
    ratio: float
    low68: float
    high68: float
    low95: float
    high95: float
    density_ratio: float  # Recorded density of B over A, by which loads as measured differ besides
    curve: tuple[tuple[float, ...], ...]  # Both coordinates, ratio, its 95 % interval
    apart: bool  # No common advance
    extrapolated: bool
    range: tuple[float, float]  # Of the first coordinate, ln(rev/min) or the command
    advance_range: tuple[float, float]
    scatter: float
    points: tuple[int, int]
    depends_on: tuple[str, ...] = ()  # speed, advance
    # Per doubling of speed, or over the range of a command; over the range of advance
    slope: float | None = None
    slope_error: float | None = None
    advance_slope: float | None = None
    advance_slope_error: float | None = None


def ratio_of(c: MatchedChannel, s: Scatter) -> Ratio:
    """Ratio of B to A at equal speed."""
    y = c.y - c.y.mean()
    white = whitener(covariance(c, s) + free_change(c))
    low, high = c.common()
    apart = low > high
    if apart:
        low, high = high, low
    inside = (c.x[:, 0] >= low - 0.01) & (c.x[:, 0] <= high + 0.01)
    at = np.flatnonzero(inside) if inside.any() else np.arange(y.size)
    b = c.second.astype(float)
    shape = change_of_any_kind(c)
    cross = shape[at] * b[None, :]
    d = cross @ white.solve(y)
    known = white(cross.T)
    cov = shape[np.ix_(at, at)] - known.T @ known
    n = at.size
    weight = np.full(n, 1.0 / n)
    mean, sd = float(weight @ d), math.sqrt(max(float(weight @ cov @ weight), 0.0))
    slopes = _slopes(c, at, d, cov)
    moved = [
        abs(slopes.get(k, 0.0)) / max(slopes.get(f"{k}_error", math.inf), 1e-9) for k in ("slope", "advance_slope")
    ]
    order = at[np.argsort(c.x[at, 0])]
    back = {int(i): k for k, i in enumerate(at)}
    keep = order[np.unique(np.linspace(0, n - 1, min(n, 25)).round().astype(int))]
    e = np.sqrt(np.maximum(np.diag(cov), 0.0))
    rows = [back[int(i)] for i in keep]
    ends = [np.exp(d[rows] + q * e[rows]) for q in (0.0, -1.96, 1.96)]
    slow, fast = c.common_advance()
    ratio, low68, high68, low95, high95 = (math.exp(mean + q * sd) for q in (0.0, -1.0, 1.0, -1.96, 1.96))
    far = bool(slow > fast + MARGIN * float(np.ptp(c.x[:, 1])))
    return Ratio(
        c.name, ratio, low68, high68, low95, high95, math.exp(c.log_density),
        tuple(map(tuple, np.column_stack([c.x[keep], *ends]).tolist())), far, apart or far, (low, high), (slow, fast),
        s.share, (int((~c.second).sum()), int(c.second.sum())),
        tuple(n for n, z in zip(("speed", "advance"), moved, strict=True) if z > _MOVED), **slopes,
    )  # fmt: skip


def _slopes(c: MatchedChannel, at: NDArray[np.intp], d: Array, cov: Array) -> dict[str, float]:
    """Least-squares slopes of d over ln n (per doubling) or the command, and over advance, with their errors."""
    out: dict[str, float] = {}
    names = ("slope", "advance_slope")
    unit = (
        math.log(2.0) if c.name not in OVER_COMMAND else max(float(np.ptp(c.x[at, 0])), 1e-12),
        max(float(np.ptp(c.x[at, 1])), 1e-12),
    )
    columns = [k for k in (0, 1) if np.ptp(c.x[at, k]) > 1e-6]
    X = np.column_stack([np.ones(at.size), *((c.x[at, k] - c.x[at, k].mean()) / unit[k] for k in columns)])
    back = np.linalg.pinv(X)
    for j, k in enumerate(columns, 1):
        out[names[k]] = float(back[j] @ d)
        out[f"{names[k]}_error"] = math.sqrt(max(float(back[j] @ cov @ back[j]), 0.0))
    return out


@dataclass(frozen=True, eq=False)
class MatchedRuns:
    """Channels of one kind that both recordings have."""

    channels: dict[str, MatchedChannel]  # By name
    # Likeliest scatter if anything smooth, or one factor, changed between the recordings
    free: dict[str, Scatter]
    steady: dict[str, Scatter]
    likelier: dict[str, Scatter]  # The better of the two
    strays: dict[str, MatchedChannel]  # Readings that were left out


def prepared(a: StandRun, b: StandRun, names: Sequence[str], diameter: float) -> MatchedRuns:
    """Match channels, and find their scatter."""
    out = MatchedRuns({}, {}, {}, {}, {})
    for name in names:
        found = matched(a, b, name, diameter)
        if found is not None:
            out.channels[name], stray, (out.free[name], loose) = without_strays(in_common(found))
            out.steady[name], stiff = scatter_of(out.channels[name], steady_change(out.channels[name]))
            out.likelier[name] = out.free[name] if loose > stiff else out.steady[name]
            if stray.y.size:
                out.strays[name] = stray
    return out

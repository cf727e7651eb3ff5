"""Scatter that single points do not show: repeats, sessions, and the difference between going up and coming down.

All of it is judged at equal speed: loads are compared as load / rpm^2, so that a small difference in speed does not
count as scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array

Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
SAME_SPEED = 0.005
"""Relative difference in speed up to which points are repeats."""
NEAR_SPEED = 0.03
"""Relative difference in speed up to which points of two runs are compared."""
MOST_RUNS = 64
"""Runs that are compared, each with each; of more every second, third, ... Their scatter is known to 9 % then."""
MOST_NOISE = 0.2
"""Scatter of single comparisons above which nothing is said of the runs. [1]"""
OUTLIER = 6.0
"""Robust standard deviations from which one of five or more repeats is an outlier."""


@dataclass(frozen=True, eq=False)
class Repeats:
    """`scatter` relative standard deviation [1] with `dof` degrees of freedom; `outliers`: rows and their distance."""

    scatter: float
    dof: int
    outliers: tuple[tuple[int, float, int], ...]


@dataclass(frozen=True)
class Session:
    """`scatter` between runs, relative [1]; `runs` and `pairs` of points that it rests on."""

    scatter: float
    runs: int
    pairs: int


@dataclass(frozen=True)
class Hysteresis:
    """Down minus up: `difference` [unit of the channel], its standard error `u`, compared `points`, `share` of top."""

    difference: float
    u: float
    points: int
    share: float


def _scaled(load: Array, rpm: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rpm > 0.0, load / rpm**2, np.nan)


def repeats(load: Array, rpm: Array, group: Array, flow: Array | None = None) -> Repeats:
    """Scatter among points of one speed (and advance) within one run.

    >>> rng = np.random.default_rng(0)
    >>> rpm = np.repeat([4000.0, 6000.0], 50)
    >>> got = repeats(1e-7 * rpm**2 * (1 + 0.01 * rng.standard_normal(100)), rpm, np.ones(100))
    >>> 0.008 < got.scatter < 0.012, got.dof
    (True, 98)
    """
    k = _scaled(load, rpm)
    good = np.flatnonzero(np.isfinite(k))
    order = good[np.lexsort((rpm[good], group[good]))]
    clusters: list[list[int]] = []
    for i in order:
        first = clusters[-1][0] if clusters else i
        alike = group[first] == group[i] and rpm[i] <= rpm[first] * (1.0 + SAME_SPEED)
        if clusters and alike and (flow is None or _same(flow[first], flow[i])):
            clusters[-1].append(int(i))
        else:
            clusters.append([int(i)])
    squares, dof = 0.0, 0
    outliers: list[tuple[int, float, int]] = []
    for rows in clusters:
        v = k[rows]
        if len(rows) >= 5:
            centre = float(np.median(v))
            sd = max(1.4826 * float(np.median(np.abs(v - centre))), 1e-3 * abs(centre))
            far = np.abs(v - centre) > OUTLIER * sd
            outliers += [(rows[j], float(abs(v[j] - centre) / sd), len(rows)) for j in np.flatnonzero(far)]
            v = v[~far]
        if len(v) > 1 and abs(float(v.mean())) > 0.0:
            squares += float(np.sum((v / v.mean() - 1.0) ** 2))
            dof += len(v) - 1
    return Repeats(math.sqrt(squares / dof) if dof else math.nan, dof, tuple(outliers))


def _same(one: Any, two: Any) -> Any:
    """Whether airspeeds or advance ratios are the same to 1 %."""
    return np.abs(one - two) <= 0.01 * np.maximum(np.maximum(np.abs(one), np.abs(two)), 1e-4)


def session(load: Array, rpm: Array, run: Array, flow: Array | None = None) -> Session:
    """Scatter between runs of the same conditions: what a gain or a set-up changes from run to run.

    Each point is compared with the points of every other run whose speed differs by less than 3 %, interpolated to its
    own speed where two enclose it; the runs' levels follow from all differences by least squares.
    """
    k = _scaled(load, rpm)
    finite = k[np.isfinite(k)]
    if finite.size == 0 or abs(float(np.mean(np.sign(finite)))) < 0.9:  # loads about zero have no ratio
        return Session(math.nan, 0, 0)
    k = k * np.sign(np.median(finite))
    labels = np.unique(run)
    labels = labels[:: -(-len(labels) // MOST_RUNS)]
    good = np.isfinite(k) & (k > 0.0)
    own = [np.flatnonzero(good & (run == label)) for label in labels]
    rows: list[tuple[int, int, float]] = []
    for a, b in combinations(range(len(labels)), 2):
        rows += [(a, b, d) for d in _differences(k, rpm, own[a], own[b], flow)]
    seen = sorted({i for row in rows for i in row[:2]})
    if len(rows) < 3 or len(seen) < 2:
        return Session(math.nan, len(seen), len(rows))
    A = np.zeros((len(rows) + 1, len(seen)))
    for i, (a, b, _) in enumerate(rows):
        A[i, seen.index(a)], A[i, seen.index(b)] = -1.0, 1.0
    A[-1] = 1.0
    d = np.array([row[2] for row in rows] + [0.0])
    levels = np.linalg.lstsq(A, d, rcond=None)[0]
    rest = d[:-1] - A[:-1] @ levels
    if float(np.std(rest)) > MOST_NOISE:
        return Session(math.nan, len(seen), len(rows))
    noise = 0.5 * float(np.mean(rest**2)) * len(seen) / len(rows)
    between = float(np.var(levels, ddof=1)) - noise
    return Session(math.sqrt(max(between, 0.0)), len(seen), len(rows))


def _differences(k: Array, rpm: Array, one: Indices, two: Indices, flow: Array | None) -> list[float]:
    """Log ratios of the second run over the first, at speeds of the first."""
    at = np.stack([rpm[two], np.zeros(len(two)) if flow is None else flow[two]])
    two = two[np.unique(at, axis=1, return_index=True)[1]]  # by speed; of equal points the first
    speeds, theirs = rpm[two], None if flow is None else flow[two]
    out = []
    for i in one:
        low, middle = np.searchsorted(speeds, rpm[i] * np.array([1.0 - NEAR_SPEED, 1.0]), "right")
        high = np.searchsorted(speeds, rpm[i] * (1.0 + NEAR_SPEED))
        near = np.arange(low, high)
        if theirs is not None:
            near = near[_same(theirs[low:high], float(flow[i]))]  # type: ignore[index]
        below, above = near[near < middle], near[near >= middle]
        if not near.size:
            continue
        nearest = ((side, speeds[side[end]]) for side, end in ((below, -1), (above, 0)) if side.size)
        ends = [int(two[side[speeds[side] == speed]].min()) for side, speed in nearest]
        value = float(np.interp(rpm[i], rpm[ends], k[ends]))
        out.append(math.log(value / k[i]))
    return out


def hysteresis(load: Array, x: Array, up: Mask, down: Mask, power: float = 2.0) -> Hysteresis | None:
    """Compare the branch reached from above with the one reached from below.

    >>> x = np.array([1.0, 2, 3, 4, 5, 4, 3, 2, 1])
    >>> up = np.arange(9) < 5
    >>> got = hysteresis(x**2 + 0.1 * ~up, x, up, ~up)
    >>> round(got.difference, 3), got.points
    (0.1, 4)
    """
    good = np.isfinite(load) & np.isfinite(x) & (x > 0.0)
    a, b = np.flatnonzero(good & up), np.flatnonzero(good & down)
    if len(a) < 3 or len(b) < 3:
        return None
    with np.errstate(all="ignore"):
        k = load / x**power
    order = a[np.argsort(x[a])]
    inside = b[(x[b] >= x[order[0]]) & (x[b] <= x[order[-1]])]
    span = float(np.ptp(x[good]))
    if len(inside) < 3 or span <= 0.0 or float(np.ptp(x[inside])) < span / 3.0:
        return None
    difference = load[inside] - np.interp(x[inside], x[order], k[order]) * x[inside] ** power
    top = float(np.max(np.abs(load[good])))
    centre = float(np.mean(difference))
    u = float(np.std(difference, ddof=1)) / math.sqrt(len(inside))
    return Hysteresis(centre, u, len(inside), centre / top if top > 0.0 else math.nan)

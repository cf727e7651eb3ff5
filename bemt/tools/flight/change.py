"""A change within one flight: a rotor that suddenly, or more and more, needs another drive than the others.

The readings of :mod:`bemt.tools.flight.judge` over time, in blocks, are regressed on a step at each possible time, or
on a slope, beside a level and the mean velocity of the block where it was logged (a rotor meets other air in flight).
What the regression leaves is correlated in time, so its variance is that of means over batches (e.g. Law, Simulation
Modeling and Analysis, ch. 9). The bar is Student's, divided by causes and by independent times (Bonferroni).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.flight.balance import ALARM, LARGEST, axes_of, directions
from bemt.tools.flight.log import FlightLog

_BLOCK_S, _EDGE_S, _BATCHES, _LONGEST = 0.5, 1.0, 10, 600  # block; least time on both sides [s]; batches; blocks
_ALIKE = 2.0 * float(np.log(0.95 / 0.05))  # chi squares that differ by less leave a name open
_SMALL = 0.05  # a change below this is not worth a word [1]


@dataclass(frozen=True)
class FlightChange:
    """A change within a flight."""

    kind: str  # "step" or "growth"
    at_s: float  # Time of a step from the first sample; NaN for a growth [s]
    causes: tuple[str, ...]  # What explains its direction, best first
    # Change of that rotor's drive, over the whole flight for a growth, and the half width of its 95 % interval [1]
    size: float
    half: float
    odds: tuple[float, ...] = ()  # Natural logarithm of the odds of each cause over no change [1]


def change_in(log: FlightLog, layout: Array | None) -> FlightChange | None:
    """The clearest change within a flight; None where there is none, or under 20 blocks in the air."""
    from scipy import stats

    drive = log.drive
    if drive is None or log.rotors < 3:
        return None
    found = _blocks(log, drive)
    if found is None:
        return None
    t, mean, other = found
    axes = axes_of(layout, log.rotors)
    y = np.log(mean) @ axes.T
    N, k = y.shape
    ways = directions(log.rotors, layout)
    D = np.stack([axes @ w for w in ways.values()])
    plain = np.column_stack([np.ones(N), other])
    edge = max(int(round(_EDGE_S / (t[1] - t[0]))), 2)
    ramp = (t - t[0]) / (t[-1] - t[0])
    tries = [("step", float(t[c]), (np.arange(N) >= c).astype(float)) for c in range(edge, N - edge)]
    fits = [(*_regressed(y, np.column_stack([column, plain])), kind, at)
            for kind, at, column in [*tries, ("growth", float("nan"), ramp)]]  # fmt: skip
    change, s2, _, kind, at = min(fits, key=lambda f: f[2])
    d = D / np.sqrt(s2)
    length = np.linalg.norm(d, axis=1)
    z = change / np.sqrt(s2)
    T = d / length[:, None] @ z
    free = k * (_BATCHES - 1 - plain.shape[1])
    bar = float(stats.t.ppf(1.0 - ALARM / (len(ways) * (_BATCHES + 1)), free))
    i = int(np.argmax(T))
    misfit = float(z @ z) - T**2
    size, half = float(T[i] / length[i]), float(stats.t.ppf(0.975, free) / length[i])
    # What no listed cause explains to three quarters is another manoeuvre.
    if T[i] < bar or size < _SMALL or misfit[i] > 0.25 * float(z @ z):
        return None
    order = np.argsort(misfit)
    near = [j for j in order if T[j] > 0.0 and misfit[j] - misfit[i] < _ALIKE]
    # Student's density of what is left, times the share of the sizes and of the independent times that fit.
    tried = np.log(np.sqrt(2.0 * np.pi) / (length * LARGEST)) - np.log(_BATCHES + 1)
    odds = 0.5 * (free + k) * (np.log1p(float(z @ z) / free) - np.log1p(misfit / free)) + tried
    return FlightChange(kind, at, tuple(list(ways)[j] for j in near), size, half, tuple(float(odds[j]) for j in near))


def _regressed(y: Array, X: Array) -> tuple[Array, float, float]:
    """Change of the readings with the first column, (k,), its variance by batches, and the squares that are left."""
    gram = np.linalg.pinv(X.T @ X)
    b = gram @ X.T @ y
    rest = y - X @ b
    N, k = y.shape
    batches = np.array([p.mean(axis=0) for p in np.array_split(rest, _BATCHES)])
    # One variance for all readings; independent samples are the least that it can be.
    long = N / _BATCHES * float(np.sum(batches**2)) / max(_BATCHES - X.shape[1], 3)
    short = float(np.sum(rest**2)) / max(N - X.shape[1], 1)
    return b[0], max(long / k, short / k, 1e-6) * float(gram[0, 0]), float(np.sum(rest**2))


def _blocks(log: FlightLog, drive: Array) -> tuple[Array, Array, Array] | None:
    """Times, mean drives and velocities of the blocks in the air."""
    on = log.flying
    if on.sum() < 100:
        return None
    t = log.t[on]
    width = max(_BLOCK_S, float(t[-1] - t[0]) / _LONGEST)
    number = np.floor((t - t[0]) / width).astype(int)
    count = np.bincount(number)
    full = count >= max(0.5 * np.median(count[count > 0]), 2)

    def mean(v: Array) -> Array:
        return np.stack([np.bincount(number, weights=c)[full] / count[full] for c in v[on].T], axis=1)

    values = mean(drive)
    if full.sum() < 20 or not np.all(values > 0.0):
        return None
    other = np.zeros((int(full.sum()), 0))
    if log.velocity is not None:
        v = mean(log.velocity)
        other = v - v.mean(axis=0)
        other = other[:, np.ptp(other, axis=0) > 0.2]
    return t[0] + width * (np.flatnonzero(full) + 0.5), values, other

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
from bemt.tools.flight.repeat import block_means

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
    moving = np.zeros((log.t.size, 0)) if log.velocity is None else log.velocity
    full, (values, other) = block_means(t, width, drive[on], moving[on])
    if full.size < 20 or not np.all(values > 0.0):
        return None
    other = other - other.mean(axis=0)
    return t[0] + width * (full + 0.5), values, other[:, np.ptp(other, axis=0) > 0.2]


# Evidence of a cause in the balance: Student's density of what it leaves, over all sizes that it may have.
#
# Readings z are in units of the standard deviation of a healthy flight; a cause of size s moves them by s d. Sizes
# are alike beforehand from 0 to :data:`bemt.tools.flight.balance.LARGEST`; what healthy flights hide is part of
# nothing. Along a line Student's density is Student's again (Kotz and Nadarajah 2004, Multivariate t Distributions
# and Their Applications, ch. 1; not checked), so the integral over the sizes of one cause is exact, and that of two a
# mean over quantiles of one of them.
SMALL = 0.05
"""Change of a rotor's drive below which a cause is nothing to look for: not worth a word [1]."""
_HIDDEN = 2.0  # standard deviations of a size between healthy flights up to which they hide it
_ALONG = 100.0  # condition number from which two rotors load the body along one line
_SAME = 0.5  # pairs whose rotors lost the same, as in one crash; the others are independent (declared) [1]
_NODES = (np.arange(24) + 0.5) / 24
_LEAST = 1e-300


@dataclass(frozen=True)
class FlightEvidence:
    """One explanation: how the readings have it."""

    # Change of that rotor's drive (of two, of the smaller one), and half the width of its 95 % interval [1]
    size: float
    half: float
    # Natural logarithm of its density, and of the part of it that healthy flights hide
    log: float
    log_small: float = float("-inf")


@dataclass(frozen=True, eq=False)
class FlightReadings:
    """The readings beside one prediction of a healthy flight."""

    z: Array  # (k,) Over the standard deviation
    sd: Array  # (k,) Standard deviation [1]
    free: float  # Degrees of freedom behind it

    def density(self, chi2: float, wide: float = 0.0) -> float:
        """Logarithm of the density, `wide` by so much wider in all [log]."""
        from scipy.special import gammaln

        k, v = self.z.size, self.free
        level = gammaln(0.5 * (v + k)) - gammaln(0.5 * v) - 0.5 * k * np.log(v * np.pi) - np.log(self.sd).sum()
        return float(level - 0.5 * (v + k) * np.log1p(chi2 / v)) - wide

    def one(self, d: Array) -> FlightEvidence:
        """Evidence of a cause that moves the readings by d, (k,), for each unit of its size."""
        from scipy.special import gammaln, stdtrit

        square = float(d @ d)
        best = float(d @ self.z) / square
        left = max(float(self.z @ self.z) - best**2 * square, 0.0)
        m = self.free + self.z.size - 1.0
        width = float(np.sqrt((self.free + left) / (m * square)))
        whole = self.density(left) + np.log(width * np.sqrt(m * np.pi) / LARGEST)
        whole += gammaln(0.5 * m) - gammaln(0.5 * (m + 1.0))
        limit = min(max(SMALL, _HIDDEN / np.sqrt(square)), LARGEST)
        small, large = (_within(m, best, width, low, high) for low, high in ((0.0, limit), (limit, LARGEST)))
        return FlightEvidence(best, float(stdtrit(m, 0.975) * width), float(whole + np.log(large)),
                              float(whole + np.log(small)))  # fmt: skip

    def two(self, a: Array, b: Array) -> FlightEvidence | None:
        """Evidence of two rotors, (k,) each; None where they load the body along one line."""
        from scipy.special import stdtr, stdtrit

        D = np.stack([a, b], axis=1)
        if np.linalg.cond(D) > _ALONG:
            return None
        inverse = np.linalg.inv(D.T @ D)
        best = inverse @ D.T @ self.z
        left = max(float(np.sum((self.z - D @ best) ** 2)), 0.0)
        m = self.free + self.z.size - 2.0
        spread = inverse * (self.free + left) / m
        u = np.sqrt(np.diag(spread))
        part = _within(m, best[1], u[1], SMALL, LARGEST)
        low, high = (stdtr(m, (v - best[1]) / u[1]) for v in (SMALL, LARGEST))
        v = stdtrit(m, np.clip(low + (high - low) * _NODES, 1e-12, 1.0 - 1e-12))
        rest = spread[0, 0] - spread[0, 1] ** 2 / spread[1, 1]
        width = np.sqrt(rest * (m + v**2) / (m + 1.0))
        inside = _within(m + 1.0, best[0] + spread[0, 1] / u[1] * v, width, SMALL, LARGEST).mean()
        area = 2.0 * np.pi * u[1] * np.sqrt(rest) / LARGEST**2
        free = self.density(left) + float(np.log(area * part * inside + _LEAST))
        same = self.one(a + b).log
        k = int(np.argmin(best))
        return FlightEvidence(float(best[k]), float(stdtrit(m, 0.975) * u[k]),
                              float(np.logaddexp(np.log(1.0 - _SAME) + free, np.log(_SAME) + same)))  # fmt: skip


def _within(free: float, best: Array | float, width: Array | float, low: float, high: float) -> Array:
    """Probability of Student's variable about `best` between two values, exact in both tails."""
    from scipy.special import stdtr

    a, b = (low - np.asarray(best)) / width, (high - np.asarray(best)) / width
    turn = a > 0.0
    a, b = np.where(turn, -b, a), np.where(turn, -a, b)
    inside: Array = np.maximum(np.asarray(stdtr(free, b) - stdtr(free, a), dtype=float), _LEAST)
    return inside

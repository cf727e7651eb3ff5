"""Evidence of a cause in the balance: Student's density of what it leaves, over all sizes that it may have.

Readings z are in units of the standard deviation of a healthy flight; a cause of size s moves them by s d. Sizes are
alike beforehand from 0 to :data:`bemt.tools.flight.balance.LARGEST`; what healthy flights hide is part of nothing.
Along a line Student's density is Student's again (Kotz and Nadarajah 2004, Multivariate t Distributions and Their
Applications, ch. 1; not checked), so the integral over the sizes of one cause is exact, and that of two a mean over
quantiles of one of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.flight.balance import LARGEST

__all__ = ["SMALL", "FlightEvidence", "FlightReadings"]

SMALL = 0.05
"""Change of a rotor's drive below which a cause is nothing to look for: not worth a word [1]."""
_HIDDEN = 2.0  # standard deviations of a size between healthy flights up to which they hide it
_ALONG = 100.0  # condition number from which two rotors load the body along one line
_ALIKE = 0.5  # pairs whose rotors lost the same, as in one crash; the others are independent (declared) [1]
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

    def document(self) -> dict[str, float]:
        """What JSON gives of it."""
        return {"size": self.size, "half": self.half}


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
                              float(np.logaddexp(np.log(1.0 - _ALIKE) + free, np.log(_ALIKE) + same)))  # fmt: skip


def _within(free: float, best: Array | float, width: Array | float, low: float, high: float) -> Array:
    """Probability of Student's variable about `best` between two values, exact in both tails."""
    from scipy.special import stdtr

    a, b = (low - np.asarray(best)) / width, (high - np.asarray(best)) / width
    turn = a > 0.0
    a, b = np.where(turn, -b, a), np.where(turn, -a, b)
    inside: Array = np.maximum(np.asarray(stdtr(free, b) - stdtr(free, a), dtype=float), _LEAST)
    return inside

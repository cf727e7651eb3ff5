"""One covariance, factored once: whitened vectors, densities, and some readings given all others."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array

_JITTER = 1e-4  # of the stated standard deviation, so that a covariance of tangents alone has a factor


def triangular(factor: Array, vectors: Array, transposed: bool = False) -> Array:
    """Solve with a lower triangular factor (M, M), or its transpose, for vectors (M,) or columns (M, n).

    LAPACK's own entry: the checks of ``scipy.linalg.solve_triangular`` take longer than a solve of this size.

    >>> triangular(np.array([[2.0, 0.0], [1.0, 4.0]]), np.array([2.0, 5.0])).tolist()
    [1.0, 1.0]
    """
    from scipy.linalg.lapack import dtrtrs

    if not vectors.size:
        return np.zeros(vectors.shape)
    if factor.flags.f_contiguous:
        x, info = dtrtrs(factor, vectors, lower=1, trans=int(transposed))
    else:  # LAPACK sees the transpose
        x, info = dtrtrs(factor.T, vectors, lower=0, trans=int(not transposed))
    if info:
        raise np.linalg.LinAlgError(f"singular factor: diagonal {info}")
    return np.asarray(x)


@dataclass(frozen=True, eq=False)
class Whitener:
    """Cholesky factor of one covariance C = L L^T."""

    factor: Array  # (M, M) L, lower triangular [units of the readings]
    log_det: float  # Sum of the logarithms of its diagonal, half of ln det C [1]

    def __call__(self, vectors: Array) -> Array:
        """Whiten vectors (M,) or columns (M, n): L^-1 x."""
        return triangular(self.factor, vectors)

    def back(self, vectors: Array) -> Array:
        """L^-T x of whitened vectors or columns."""
        return triangular(self.factor, vectors, transposed=True)

    def solve(self, vectors: Array) -> Array:
        """C^-1 x of vectors or columns."""
        return self.back(self(vectors))

    def log_density(self, x: Array, constant: bool = True) -> float:
        """Logarithm of the normal density of a vector; without its constant -M/2 ln 2 pi if so asked [1].

        Rasmussen and Williams, Gaussian Processes for Machine Learning, MIT Press 2006, eq. 2.30.

        >>> one = whitener(np.array([[4.0]]))
        >>> round(one.log_density(np.array([2.0])), 6) == round(-0.5 - math.log(2.0) - 0.5 * math.log(2 * math.pi), 6)
        True
        """
        w = self(x)
        out = -0.5 * float(w @ w) - self.log_det
        return out - 0.5 * x.size * math.log(2.0 * math.pi) if constant else out


def whitener(covariance: Array, u: Array | None = None) -> Whitener:
    """Factor a covariance, (M, M), symmetric and positive definite, else numpy.linalg.LinAlgError.

    1e-4 of the standard deviations of the readings `u` (M,) is added, so that a singular one has a factor.
    """
    if u is not None:
        covariance = covariance + np.diag((_JITTER * u) ** 2)
    factor = np.asarray(np.linalg.cholesky(covariance), dtype=float)
    return Whitener(factor, float(np.sum(np.log(np.diag(factor)))))


def log_density(covariance: Array, x: Array, constant: bool = True) -> float:
    """Logarithm of the normal density of one vector; see `Whitener.log_density`."""
    return whitener(covariance).log_density(x, constant)


def leave_one_out(covariance: Array, x: Array) -> Array:
    """What each value differs by from its prediction by all others, over the standard deviation of that, (M,) [1].

    Rasmussen and Williams 2006, eq. 5.12.

    >>> leave_one_out(np.diag([1.0, 4.0]), np.array([2.0, 2.0])).tolist()
    [2.0, 1.0]
    """
    inverse = np.linalg.inv(covariance)
    return np.asarray((inverse @ x) / np.sqrt(np.diag(inverse)))


@dataclass(frozen=True, eq=False)
class Conditional:
    """Some readings given all others: causes change only these, so the others enter once and not with every cause."""

    # (N,), (M - N,) The readings, and those that are given
    rows: NDArray[np.intp]
    others: NDArray[np.intp]
    gain: Array  # (N, M - N) Expected change of the readings for one of the others [unit/unit]
    covariance: Array  # (N, N) Of what remains [square of the units of the readings]
    white: Whitener  # Its factor
    outside: Whitener  # Factor of the covariance of the others

    @property
    def log_det(self) -> float:
        """Sum of the logarithms of the diagonal of the factor of all readings [1]."""
        return self.white.log_det + self.outside.log_det

    def rest(self, vectors: Array) -> Array:
        """What the others leave of vectors or columns."""
        return np.asarray(vectors[self.rows] - self.gain @ vectors[self.others])

    def __call__(self, vectors: Array) -> Array:
        """Whiten what the others leave of vectors or columns."""
        return self.white(self.rest(vectors))

    def changes(self, vectors: Array) -> Array:
        """Whiten vectors or columns that are zero but in these rows."""
        return self.white(vectors[self.rows])

    def misfit(self, vectors: Array) -> Array:
        """Half the squared whitened length of the others."""
        w = self.outside(vectors[self.others])
        return np.asarray(0.5 * np.sum(w * w, axis=0))


def conditional(covariance: Array, u: Array, mine: NDArray[np.bool_]) -> Conditional:
    """Condition some readings on the others, jointly normal (Rasmussen and Williams 2006, eq. A.6)."""
    rows, others = np.flatnonzero(mine), np.flatnonzero(~mine)
    rest, gain = covariance[np.ix_(rows, rows)], np.zeros((rows.size, others.size))
    outside = whitener(covariance[np.ix_(others, others)], u[others])
    if others.size:
        cross = outside(covariance[np.ix_(others, rows)])
        rest = rest - cross.T @ cross
        gain = outside.back(cross).T
    return Conditional(rows, others, gain, rest, whitener(rest, u[rows]), outside)


# Restricted maximum likelihood: the likelihood of what is left once all that is not of interest is projected out.
#
# Patterson and Thompson, Biometrika 58 (1971) 545, eq. 6.
_RANK, _TINY = 1e-8, 1e-9


def contrasts(fixed: Array) -> Array:
    """Orthonormal combinations of readings that columns (N, k) of any size do not change, (N, N - rank)."""
    norm = np.linalg.norm(fixed, axis=0)
    q, s, _ = np.linalg.svd(fixed[:, norm > 0] / norm[norm > 0], full_matrices=True)
    return np.asarray(q[:, int(np.sum(s > _RANK * s[0])) if s.size else 0 :])


@dataclass(frozen=True, eq=False)
class Restricted:
    """Contrasts of readings whose variance is a sum of independent parts."""

    z: Array  # (n,) Contrasts [units of the readings]
    base: Array  # (n, n) Their covariance by what is known
    parts: tuple[Array, ...]  # Covariance by each part of standard deviation 1

    @staticmethod
    def of(e: Array, fixed: Array, known: Array | None, *parts: Array) -> Restricted | None:
        """Readings (N,) with ``fixed`` columns projected out; ``known`` and ``parts``: standard deviations, (N,).

        None if nothing is left.
        """
        K = contrasts(fixed)
        if not K.shape[1]:
            return None
        z = K.T @ e
        tiny = (_TINY * max(float(np.max(p)) for p in parts)) ** 2 * np.eye(z.size)
        base = tiny if known is None else tiny + K.T @ (known[:, None] ** 2 * K)
        return Restricted(z, base, tuple(K.T @ (p[:, None] ** 2 * K) for p in parts))

    def misfit(self, *sizes: float) -> float:
        """Minus the logarithm of the restricted likelihood, but for a constant; infinite without a factor. [1]"""
        C = self.base + sum(s**2 * part for s, part in zip(sizes, self.parts, strict=True))
        try:
            return -whitener(C).log_density(self.z, constant=False)
        except np.linalg.LinAlgError:
            return np.inf

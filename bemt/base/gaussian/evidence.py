"""Evidence of linear terms on top of white noise, and sums and shares of evidences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import triangular


def log_sum(log_values: ArrayLike, log_weights: ArrayLike = 0.0, axis: int = -1) -> Array:
    """Logarithm of a weighted sum of exponentials; minus infinity for a sum of nothing.

    >>> bool(np.isclose(log_sum(np.log([1.0, 2.0]), np.log([3.0, 4.0])), np.log(11.0)))
    True
    """
    total = np.asarray(log_values) + np.asarray(log_weights)
    if not total.shape[axis]:
        return np.full(np.delete(total.shape, axis), -np.inf)
    top = np.max(total, axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.squeeze(top, axis) + np.log(np.sum(np.exp(total - top), axis=axis)))


def shares(log_values: ArrayLike) -> Array:
    """Probabilities of which these are the logarithms, but for a constant, (N,) [1].

    >>> shares([1000.0, 1000.0]).tolist()
    [0.5, 0.5]
    """
    log_p = np.asarray(log_values, dtype=float)
    p = np.exp(log_p - log_p.max())
    return np.asarray(p / p.sum())


@dataclass(frozen=True, eq=False)
class LinearTerms:
    """Terms B x with x ~ N(0, 1) on top of white noise of unit variance: covariance 1 + B B^T.

    Everything follows from the small matrix 1 + B^T B (Woodbury; Rasmussen and Williams 2006, eq. A.9 and A.10): no
    factor of the readings' size is needed for another set of terms.
    """

    B: Array  # (M, q) Whitened columns, each of the size that its coefficient has beforehand [1]
    root: Array  # (q, q) Cholesky factor of 1 + B^T B [1]

    @staticmethod
    def of(B: Array) -> LinearTerms:
        """Terms of whitened columns."""
        return LinearTerms(B, np.asarray(np.linalg.cholesky(np.eye(B.shape[1]) + B.T @ B), dtype=float))

    def project(self, x: Array) -> Array:
        """Part of whitened vectors (M,) or (M, n) that the terms may explain, (q,) or (q, n)."""
        return triangular(self.root, self.B.T @ x)

    @property
    def half_log_det(self) -> float:
        """Half the logarithm of the determinant of 1 + B B^T [1]."""
        return float(np.sum(np.log(np.diag(self.root))))

    def gain(self, x: Array) -> Array:
        """Log evidence of whitened vectors, (M,) or (M, n), over that without the terms: () or (n,) [1]."""
        p = self.project(x)
        return np.asarray(0.5 * np.sum(p * p, axis=0) - self.half_log_det)

    def posterior(self, x: Array) -> tuple[Array, Array]:
        """Mean and standard deviation of the coefficients given a whitened vector, (q,), (q,) [prior size]."""
        inverse = triangular(self.root, np.eye(self.root.shape[0]))
        return triangular(self.root, self.project(x), transposed=True), np.sqrt(np.sum(inverse**2, axis=0))

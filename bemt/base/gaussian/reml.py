"""Restricted maximum likelihood: the likelihood of what is left once all that is not of interest is projected out.

Patterson and Thompson, Biometrika 58 (1971) 545, eq. 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import whitener

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

"""Error of the form of an effect: published laws of one effect differ, and so may the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt import effects
from bemt.diagnose import noise

if TYPE_CHECKING:
    from bemt.diagnose.noise import Whitener
    from bemt.diagnose.problem import Problem
    from bemt.diagnose.signatures import Candidate

__all__ = ["FORM", "Form", "form_modes"]

Array = NDArray[np.float64]

FORM = {0.15: 0.7, 0.45: 0.3}
"""Standard deviation of the form of an effect, share of its size, with its prior weight: published laws of one effect
differ by that, of some by half [1]."""


@dataclass(frozen=True, eq=False)
class Form:
    """Error of the form of one effect, whitened: published laws of one effect differ by a share of its own size.

    Adds B B^T to the whitened covariance; everything follows from the projection of :meth:`project` (Woodbury).

    Attributes
    ----------
    B : (M, q) float
        Whitened modes, none for instruments, whose laws are exact [1].
    root : (q, q) float
        Cholesky factor of 1 + B^T B [1].
    size : float
        Standard deviation of the form, share of the effect's size [1].
    """

    B: Array
    root: Array
    size: float = 0.0

    @classmethod
    def of(
        cls, white: Whitener, candidate: Candidate, g: int, modes: Array, r: Array | None = None, size: float = 0.0
    ) -> Form:
        """Modes times the size of a signature, and what lies between it and its neighbours on the grid, whitened.

        Parameters
        ----------
        white : Whitener
            Covariance of the readings.
        candidate : Candidate
            Effect.
        g : int
            Its setting.
        modes : (M, q) float
            Of :func:`form_modes` [1].
        r : (M,) float, optional
            Whitened residual; the size of the form is then that which explains it best [1].
        size : float
            Standard deviation of the form without a residual, 0 for the smallest, share of the effect's size [1].

        Returns
        -------
        Form
            Whitened.
        """
        signature = candidate.signatures[:, g]
        shape, between = white(signature[:, None] * modes), white(candidate.between(g))

        def sized(f: float) -> Form:
            B = np.column_stack([f * shape, between])
            return cls(B, np.asarray(np.linalg.cholesky(np.eye(B.shape[1]) + B.T @ B), dtype=float), f)

        if r is None or not shape.shape[1]:
            return sized(size or min(FORM))
        d = r - white(signature)
        forms = [sized(f) for f in FORM]
        return max(forms, key=lambda f: 0.5 * float(np.sum(f.project(d) ** 2)) - f.half_log_det)

    def project(self, x: Array) -> Array:
        """Part of whitened vectors (M,) or (M, n) that the form may explain, (q,) or (q, n)."""
        from scipy.linalg import solve_triangular

        if not self.B.shape[1]:
            return np.zeros((0, *x.shape[1:]))
        return np.asarray(solve_triangular(self.root, self.B.T @ x, lower=True, check_finite=False))

    @property
    def half_log_det(self) -> float:
        """Half the logarithm of the determinant of 1 + B^T B, less that of the prior weight of the size."""
        return float(np.sum(np.log(np.diag(self.root)))) - float(np.log(FORM.get(self.size, 1.0)))


def form_modes(problem: Problem, candidates: Sequence[Candidate]) -> dict[str, Array]:
    """Modes of the error of each effect's form: smooth ones for physics, none for instruments.

    Parameters
    ----------
    problem : Problem
        Readings.
    candidates : sequence of Candidate
        Effects.

    Returns
    -------
    dict
        Id to (M, q), to be multiplied by the effect's signature [1].
    """
    out: dict[tuple[tuple[str, ...], tuple[str, ...]], Array] = {}
    laws = {}
    for c in candidates:
        effect = effects.catalogue()[c.id]
        laws[c.id] = key = (effect.along, noise.law_of(effect))
        if key not in out:
            modes = noise.smooth_modes(problem, *key)
            # instruments are exact but for what they say themselves that they follow: a drift the clock
            out[key] = modes if any(key) else modes[:, :0]
    return {name: out[key] for name, key in laws.items()}

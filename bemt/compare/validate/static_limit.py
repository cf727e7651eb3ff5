"""What a rotor's static run can tell of its thrust in flight at best: a yardstick for conditioning.

The error of the solver over measured CT in flight is written as a sum of nine terms: 1, J/J0 and its square, times 1,
the rotor's mean error of static CT and that of static CP, all over CT / CT at rest.  The coefficients minimise the sum
of absolute errors (iteratively reweighted least squares) over the very points they are judged on: a rule that knows
the answers. Beside it the same rule with each rotor left out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.asbuilt.fit import MeasuredRotor
from bemt.compare.validate.points import statistics

Array = NDArray[np.float64]

_ROUNDS = 30
_SMALL = 0.01
_RIDGE = 1e-6


def _terms(m: MeasuredRotor) -> tuple[Array, Array]:
    """Terms of one rotor at its forward points, (P, 9), and the relative error of CT there, (P,)."""
    error = (m.y - m.f) / m.y
    static, fast = m.static, ~m.static
    known = np.array([1.0, error[0][static].mean(), error[1][static].mean()])
    shape = np.vander(m.x[fast], 3) * (np.abs(m.top[0]) / m.y[0])[fast][:, None]
    return np.einsum("pi,j->pij", shape, known).reshape(-1, 9), error[0][fast]


def _line(A: Array, y: Array) -> Array:
    """Coefficients of least absolute error."""
    weight = np.ones(y.size)
    for _ in range(_ROUNDS):
        B = A * weight[:, None]
        c = np.linalg.solve(B.T @ A + _RIDGE * np.eye(A.shape[1]), B.T @ y)
        weight = 1.0 / np.maximum(np.abs(y - A @ c), _SMALL)
    return np.asarray(c)


def from_static(rotors: Sequence[MeasuredRotor]) -> dict[str, Any]:
    """Errors of forward CT left by the best line from a rotor's static run: ``seen`` and ``left_out``."""
    parts = [_terms(m) for m in rotors if m.static.any() and not m.static.all()]
    if len(parts) < 2:
        none = statistics(np.empty(0))
        return {"rotors": len(parts), "seen": none, "left_out": none}
    A, y = np.concatenate([a for a, _ in parts]), np.concatenate([b for _, b in parts])
    own = np.repeat(np.arange(len(parts)), [b.size for _, b in parts])
    left = [y[own == i] - A[own == i] @ _line(A[own != i], y[own != i]) for i in range(len(parts))]
    return {
        "rotors": len(parts),
        "seen": statistics(y - A @ _line(A, y)),
        "left_out": statistics(np.concatenate(left)),
    }

"""What a rotor's static run can tell of its flight at best: a yardstick for conditioning.

The error of the solver over measured CT (or CP) in flight is written as a sum of nine terms: 1, J/J0 and its square,
times 1, the rotor's mean error of static CT and that of static CP, all over the coefficient at rest over the measured
one.  The error of the zero-thrust J is written as a sum of five: 1, those two errors and their slopes with ln Re.  The
coefficients minimise the sum of absolute errors (iteratively reweighted least squares) over the very points they are
judged on: a rule that knows the answers.  Beside it the same rule with each rotor left out of it, and ``constant``: the
first terms alone (those without an error at rest), which know no static run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.validate.points import statistics

if TYPE_CHECKING:
    from bemt.rotors.fit import MeasuredRotor

Array = NDArray[np.float64]

_ROUNDS = 30
_SMALL = 0.01
_RIDGE = 1e-6


def _terms(m: MeasuredRotor, q: int) -> tuple[Array, Array]:
    """Terms of one rotor at its forward points, (P, 9), and the relative error of CT (q 0) or CP (q 1) there, (P,)."""
    error = (m.y - m.f) / m.y
    static, fast = m.static, ~m.static
    known = np.array([1.0, error[0][static].mean(), error[1][static].mean()])
    shape = np.vander(m.x[fast], 3) * (np.abs(m.top[q]) / m.y[q])[fast][:, None]
    return np.einsum("j,pi->pji", known, shape).reshape(-1, 9), error[q][fast]


def _zero_thrust(m: MeasuredRotor, error: float) -> tuple[Array, Array]:
    """Terms of one rotor, (1, 5), and the relative error of its zero-thrust J, (1,); none where it is not known."""
    if not np.isfinite(error):
        return np.empty((0, 5)), np.empty(0)
    at_rest = ((m.y - m.f) / m.y)[:, m.static]
    around = np.log(m.Re[m.static])
    around -= around.mean()
    slopes = at_rest @ around / max(float(around @ around), _RIDGE)
    return np.r_[1.0, at_rest.mean(axis=1), slopes][None, :], np.array([error])


def _line(A: Array, y: Array) -> Array:
    """Coefficients of least absolute error."""
    weight = np.ones(y.size)
    for _ in range(_ROUNDS):
        B = A * weight[:, None]
        c = np.linalg.solve(B.T @ A + _RIDGE * np.eye(A.shape[1]), B.T @ y)
        weight = 1.0 / np.maximum(np.abs(y - A @ c), _SMALL)
    return np.asarray(c)


def _judged(parts: Sequence[tuple[Array, Array]], blind: int) -> dict[str, Any]:
    """Errors left by the line: ``seen``, ``left_out``, and ``constant`` by its first ``blind`` terms."""
    parts = [(a, b) for a, b in parts if b.size]
    if len(parts) < 2:
        none = statistics(np.empty(0))
        return {"rotors": len(parts), "constant": none, "seen": none, "left_out": none}
    A, y = np.concatenate([a for a, _ in parts]), np.concatenate([b for _, b in parts])
    own = np.repeat(np.arange(len(parts)), [b.size for _, b in parts])
    left = [y[own == i] - A[own == i] @ _line(A[own != i], y[own != i]) for i in range(len(parts))]
    return {
        "rotors": len(parts),
        "constant": statistics(y - A[:, :blind] @ _line(A[:, :blind], y)),
        "seen": statistics(y - A @ _line(A, y)),
        "left_out": statistics(np.concatenate(left)),
    }


def from_static(rotors: Sequence[MeasuredRotor], J0_errors: Sequence[float]) -> dict[str, Any]:
    """Errors of forward ``CT`` and ``CP`` and of the zero-thrust J, ``J0``, left by the best line from a static run.

    ``J0_errors`` are relative errors of the solver's zero-thrust J, NaN where it was not measured [1].
    """
    both = [(m, e) for m, e in zip(rotors, J0_errors, strict=True) if m.static.any() and not m.static.all()]
    return {
        "CT": _judged([_terms(m, 0) for m, _ in both], 3),
        "CP": _judged([_terms(m, 1) for m, _ in both], 3),
        "J0": _judged([_zero_thrust(m, e) for m, e in both], 1),
    }

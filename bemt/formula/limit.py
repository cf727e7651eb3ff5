"""How much of static thrust any formula of the same few numbers could know: an estimate from the data themselves.

ln CT at rest is taken as a Gaussian process [1]_ of ln D, P/D, blades, ln Re and, where given, ln (B c) and measured
pitch, plus an offset of each propeller (what these numbers do not say: section, label, planform) and of each reading.
Length scales and spreads maximise the marginal likelihood with a weak prior, on all the data. Three answers: the share
within 13 and 26 % with each propeller predicted from all the others of the SAME data, with its maker left out, and what
normal scatter between propellers alike in these numbers would leave to a perfect function of them. A formula from other
data is to be held against the second.

References
----------
.. [1] C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning", MIT Press, 2006, eqs. 2.23, 2.30
       and 5.1 (ARD squared exponential). Not checked against the book.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.formula.points import FitPoints
from bemt.formula.refit import MIN_PROPELLERS, has
from bemt.formula.score import FAR, NEAR
from bemt.gaussian.kernels import alike, smooth
from bemt.gaussian.whitening import log_density

Array = NDArray[np.float64]

READINGS = 4
"""Readings of a propeller that are used, spread over its Reynolds numbers."""
_START = np.log([0.2, 0.1, 0.03])
_PRIOR = 2.0
_JITTER = 1e-6


def _features(points: FitPoints, given: str) -> Array:
    D, B, chord = points.of("diameter_m"), points.of("blades"), points.of("chord_m")
    # without a chord Re is that of a chord in proportion to D
    Re = points.Re(D if given == "label" else chord)
    columns = [np.log(D), points.P_D, np.log(B), np.log(Re)]
    if given != "label":
        columns.append(np.log(B * chord / D))
    if given == "pitch":
        columns.append(points.of("measured_pitch_m") / D)
    X = np.column_stack(columns)
    spread = X.std(axis=0)
    X = X[:, spread > 1e-9]
    return np.asarray((X - X.mean(axis=0)) / X.std(axis=0))


def _kernel(A: Array, B: Array, h: Array) -> Array:
    return float(np.exp(2.0 * h[0])) * smooth(*zip(A.T, np.exp(h[3:]), strict=True), to=tuple(B.T))


def _covariance(X: Array, group: NDArray[np.intp], h: Array) -> Array:
    own = np.exp(2.0 * h[1]) * alike(group)
    return np.asarray(_kernel(X, X, h) + own + (np.exp(2.0 * h[2]) + _JITTER) * np.eye(group.size))


def _thinned(points: FitPoints) -> NDArray[np.intp]:
    rows = []
    for k in np.unique(points.index):
        own = np.flatnonzero(points.index == k)
        own = own[np.argsort(points.rpm[own], kind="stable")]
        rows.append(own[np.unique(np.linspace(0, own.size - 1, min(READINGS, own.size)).round().astype(int))])
    return np.concatenate(rows)


def limit(points: FitPoints, given: str) -> dict[str, Any] | None:
    """What the inputs carry at rest. [-]"""
    from scipy.optimize import minimize
    from scipy.special import erf
    from threadpoolctl import threadpool_limits

    used = points.select((points.J == 0) & (points.CT > 0) & ~points.ducted & has(points, given))
    K = np.unique(used.index).size
    if K < MIN_PROPELLERS:
        return None
    X, y, rows = _features(used, given), np.log(used.CT), _thinned(used)
    group = used.index
    mean = float(np.mean(y[rows]))
    train, target = X[rows], y[rows] - mean

    def cost(h: Array) -> float:
        # the diagonal makes the matrix positive definite; a failure of arithmetic counts as the worst
        try:
            likely = log_density(_covariance(train, group[rows], h), target, constant=False)
        except np.linalg.LinAlgError:
            return 1e9
        return float(0.5 * np.sum((h / _PRIOR) ** 2) - likely)

    start = np.concatenate([_START, np.full(X.shape[1], np.log(2.0))])
    with threadpool_limits(1):  # small matrices: threads only wait for each other
        h = np.asarray(minimize(cost, start, method="L-BFGS-B", options={"maxiter": 40}).x)

    def left_out(part: NDArray[np.intp]) -> Array:
        made = np.full_like(y, np.nan)
        for k in np.unique(part):
            own, rest = part == k, part[rows] != k
            if np.any(rest):
                weights = np.linalg.solve(_covariance(train[rest], group[rows][rest], h), target[rest])
                made[own] = _kernel(X[own], train[rest], h) @ weights + mean
        return np.asarray(np.abs(np.exp(made - y) - 1.0))

    makers = np.unique([p.maker for p in used.propellers], return_inverse=True)[1][group]
    errors = {"within": left_out(group), "maker_out": left_out(makers)}
    scatter = float(np.hypot(np.exp(h[1]), np.exp(h[2])))
    found: dict[str, Any] = {"propellers": int(K), "scatter": scatter}
    for share, width in (("13", NEAR), ("26", FAR)):
        for name, e in errors.items():
            found[f"{name}_{share}"] = float(np.mean(e <= width))
        # |exp(z) - 1| <= w: z from ln(1 - w) to ln(1 + w)
        ends = np.log([1.0 - width, 1.0 + width]) / (np.sqrt(2.0) * scatter)
        found[f"ideal_{share}"] = float(0.5 * (erf(ends[1]) - erf(ends[0])))
    return found

"""K1 and K2 from measured points: robust regression in logarithms, bootstrap over propellers, the thesis's goal-seek.

With F = (pi/4) rho n^2 D^4 ((P/D)^2 - J P/D) (K1 D/P)^K2, the logarithm of measured CT over (pi/4)((P/D)^2 - J P/D) is
K2 ln K1 - K2 ln(P/D): a straight line in ln(P/D). FitPoints of one propeller are no independent evidence, so each
propeller weighs one and the bootstrap draws propellers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.physics import k1k2 as empirical
from bemt.rotors.k1k2_points import FitPoints

HUBER = 1.345
"""Huber's threshold in robust standard deviations (95 % efficiency on normal errors) [-]."""
X_FLIGHT = 0.8
"""J/(P/D) up to which flight enters the fit of ``refit_flight`` [-]."""
SEED = 20240617
DRAWS = 1000


@dataclass(frozen=True)
class K1K2:
    """Constants with their 95 % intervals."""

    # Constants [-]
    K1: float
    K2: float
    # Bootstrap percentiles over propellers; NaN where not estimated [-]
    K1_95: tuple[float, float] = (float("nan"), float("nan"))
    K2_95: tuple[float, float] = (float("nan"), float("nan"))
    # What they were fitted on
    points: int = 0
    propellers: int = 0


THESIS = K1K2(empirical.K1, empirical.K2)


def CT_k1k2(points: FitPoints, K1: float, K2: float) -> Array:
    """Thrust coefficient of the K1/K2 formula, (N,) [-]."""
    pd = points.P_D
    return np.pi / 4.0 * (pd**2 - points.J * pd) * (K1 / pd) ** K2


def usable(points: FitPoints, flight: bool = False) -> NDArray[np.bool_]:
    """Which points the regression may use: open rotors with thrust, at rest (or up to `X_FLIGHT` as well), (N,)."""
    x = points.x
    moving = (x > 0) & (x < X_FLIGHT) & flight
    return np.asarray((points.CT > 0) & ~points.ducted & ((points.J == 0) | moving))


def weights(index: NDArray[np.intp]) -> Array:
    """Weights that make each propeller count once, (N,) [-]."""
    return 1.0 / np.bincount(index)[index]


def huber_line(t: Array, y: Array, w: Array, scale: float | None = None) -> tuple[float, float]:
    """Weighted robust straight line y = a + b t. [-]

    P. J. Huber, "Robust Estimation of a Location Parameter", Annals of Mathematical Statistics 35, 1964, 73-101,
    doi:10.1214/aoms/1177703732. Not checked against the paper.

    >>> t = np.arange(10.0)
    >>> y = 1.0 + 2.0 * t
    >>> y[3] = 50.0
    >>> a, b = huber_line(t, y, np.ones(10))
    >>> round(a, 2), round(b, 2)
    (1.0, 2.0)
    """
    v = w
    a, b = float("nan"), float("nan")
    for _ in range(100):
        before = (a, b)
        total = v.sum()
        mean_t, mean_y = v @ t / total, v @ y / total
        from_mean = t - mean_t
        spread = v @ from_mean**2
        if not spread > 1e-12 * total:
            return float(mean_y), float("nan")
        b = float((v * from_mean) @ (y - mean_y) / spread)
        a = float(mean_y - b * mean_t)
        if abs(a - before[0]) + abs(b - before[1]) < 1e-9:
            break
        e = np.abs(y - a - b * t)
        width = robust_scale(e, w) if scale is None else scale
        v = w * np.minimum(1.0, HUBER * max(width, 1e-12) / np.maximum(e, 1e-12))
    return a, b


def robust_scale(e: Array, w: Array) -> float:
    """Standard deviation by the weighted median of deviations, as if they were normal. [-]

    >>> round(robust_scale(np.array([1.0, 2.0, 3.0, 100.0]), np.ones(4)), 4)
    3.7065
    """
    order = np.argsort(e)
    share = np.cumsum(w[order]) / w.sum()
    # where the share is just one half, the middle of two, however it was rounded
    at = np.minimum(np.searchsorted(share, [0.5 - 1e-9, 0.5 + 1e-9]), e.size - 1)
    return float(1.4826 * np.mean(e[order[at]]))


def _line_data(points: FitPoints) -> tuple[Array, Array]:
    pd = points.P_D
    return np.log(pd), np.log(points.CT / (np.pi / 4.0 * (pd**2 - points.J * pd)))


def _constants(a: float, b: float) -> tuple[float, float]:
    """K1, K2 of the line; both NaN where the line has no slope (K1 = exp(a/K2))."""
    K2 = -b
    return (float(np.exp(a / K2)), K2) if np.isfinite(K2) and abs(K2) > 1e-9 else (float("nan"), float("nan"))


def fit(points: FitPoints, flight: bool = False, draws: int = DRAWS) -> K1K2:
    """Fit both constants."""
    used = points.select(usable(points, flight))
    present = np.unique(used.index)
    if present.size < 3 or np.ptp(np.log(used.P_D)) < 0.05:
        got = f"{present.size} open propellers at rest with thrust" + (" and one P/D" if present.size >= 3 else "")
        raise InputError(Fault("", "points", got, "three or more, of different P/D", "Name more files"))
    t, y = _line_data(used)
    w = weights(used.index)
    a, b = huber_line(t, y, w)
    K1, K2 = _constants(a, b)
    scale = robust_scale(np.abs(y - a - b * t), w)
    rng = np.random.default_rng(SEED)
    rows_of = [np.flatnonzero(used.index == k) for k in present]
    found = []
    for _ in range(draws):
        rows = np.concatenate([rows_of[k] for k in rng.integers(present.size, size=present.size)])
        one = _constants(*huber_line(t[rows], y[rows], w[rows], scale))
        if np.isfinite(one[0]):
            found.append(one)
    out = K1K2(K1, K2, points=used.rpm.size, propellers=present.size)
    if len(found) < max(20, 0.9 * draws):
        return out
    low, high = np.percentile(np.array(found), [2.5, 97.5], axis=0)
    return K1K2(K1, K2, (float(low[0]), float(high[0])), (float(low[1]), float(high[1])), out.points, out.propellers)


def goal_seek(points: FitPoints) -> K1K2:
    """K1 as the thesis's source found it: K2 fixed, mean relative error of the static points zero."""
    used, K2 = points.select(usable(points)), empirical.K2
    mean = float(np.mean(CT_k1k2(used, 1.0, K2) / used.CT))
    return K1K2(mean ** (-1.0 / K2), K2, points=used.rpm.size, propellers=np.unique(used.index).size)


def left_out(points: FitPoints, flight: bool = False) -> Array:
    """CT of every point by constants that were fitted without its propeller, (N,) [-]."""
    mask = usable(points, flight)
    out = np.full(points.rpm.size, np.nan)
    used = points.select(mask)
    t, y = _line_data(used)
    w = weights(used.index)
    for k in np.unique(points.index):
        keep = used.index != k
        own = points.index == k
        K1, K2 = _constants(*huber_line(t[keep], y[keep], w[keep]))
        out[own] = CT_k1k2(points.select(own), K1, K2)
    return out

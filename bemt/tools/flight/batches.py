"""Uncertainty of a time series from pieces of it: samples of one flight are not independent, its tenths nearly are.

Batch means (Law, Simulation Modeling and Analysis, ch. 9), and for a regression the delete-a-group jackknife (Kott, J.
Official Statistics 17, 2001; neither checked there).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array

BATCHES = 10
"""Pieces of a flight."""


def u_of_mean(values: ArrayLike) -> float:
    """Standard uncertainty of the mean of a series in order of time, 10 values or more.

    >>> u_of_mean(np.ones(40))
    0.0
    """
    means = [b.mean() for b in np.array_split(np.asarray(values, dtype=float), BATCHES)]
    return float(np.std(means, ddof=1) / np.sqrt(BATCHES))


def half_width(of_batches: ArrayLike) -> float:
    """Half width of the 95 % interval of a mean, from its value in each batch.

    >>> round(half_width([1.0, 2.0, 3.0]), 3)
    2.484
    """
    from scipy import stats

    v = np.asarray(of_batches, dtype=float)
    return float(stats.t.ppf(0.975, v.size - 1) * v.std(ddof=1) / np.sqrt(v.size))


def jackknifed(X: Array, y: Array) -> tuple[Array, Array]:
    """Least squares of readings in order of time, with standard uncertainties from ten fits that each lack a tenth.

    >>> x = np.linspace(0.0, 1.0, 50)
    >>> jackknifed(x[:, None], 2.0 * x)[0]
    array([2.])
    """

    def fitted(keep: NDArray[np.bool_]) -> Array:
        return np.asarray(np.linalg.lstsq(X[keep], y[keep], rcond=None)[0], dtype=float)

    every = np.ones(y.size, dtype=bool)
    parts = []
    for p in np.array_split(np.arange(y.size), BATCHES):
        keep = every.copy()
        keep[p] = False
        parts.append(fitted(keep))
    spread = np.array(parts) - np.mean(parts, axis=0)
    return fitted(every), np.asarray(np.sqrt((BATCHES - 1) * np.mean(spread**2, axis=0)))

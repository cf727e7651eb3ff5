"""Covariance kernels: what is alike at points that are near, or of one group."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array


def smooth(*axes: tuple[Array, float], to: tuple[Array, ...] | None = None) -> Array:
    """Squared-exponential kernel of unit variance (Rasmussen and Williams 2006, eq. 4.9), (N, N), or (N, P) to others.

    exp(-sum of squared distances over lengths / 2); each axis is a coordinate (N,) and its length scale, of the same
    unit.

    >>> np.round(smooth((np.array([0.0, 2.0]), 2.0)), 6).tolist()
    [[1.0, 0.606531], [0.606531, 1.0]]
    """
    apart = sum(
        ((x[:, None] - (x if to is None else to[k])[None, :]) / length) ** 2 for k, (x, length) in enumerate(axes)
    )
    return np.asarray(np.exp(-0.5 * np.asarray(apart)))


def alike(*labels: ArrayLike) -> NDArray[np.bool_]:
    """Whether two points have all labels in common, (N, N).

    >>> alike([0, 0, 1]).astype(int).tolist()
    [[1, 1, 0], [1, 1, 0], [0, 0, 1]]
    """
    return np.asarray(np.logical_and.reduce([np.equal.outer(np.asarray(x), np.asarray(x)) for x in labels]))


def modes(kernel: Array, least: float) -> Array:
    """Columns whose products with themselves add up to a kernel, but for directions below a share of the largest.

    (N, q), the largest last; ``columns @ columns.T`` is the kernel where ``least`` is 0.
    """
    value, vector = np.linalg.eigh(kernel)
    keep = value > least * value[-1]
    return np.asarray(vector[:, keep] * np.sqrt(value[keep]))

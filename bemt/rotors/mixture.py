"""Mixtures of normal laws with one centre: probabilities and quantiles."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEVELS = (math.erf(math.sqrt(0.5)), math.erf(math.sqrt(2.0)))
"""Probabilities within one and two standard deviations of a normal law; called 68 and 95 % [1]."""


def inside(distance: Array, sds: Array, weights: Array) -> Array:
    """Probability of lying nearer to the centre than a distance, (P,) of (P,) and (P, S)."""
    from scipy.special import erf

    share = np.abs(distance)[..., None] / np.maximum(sds, 1e-300) / math.sqrt(2.0)
    return np.asarray((erf(share) * weights).sum(-1))


def half_width(level: float, sds: Array, weights: Array) -> Array:
    """Half width of the central interval of a probability, (P,) of (P, S).

    >>> one = half_width(LEVELS[0], np.array([[2.0]]), np.ones(1))
    >>> bool(abs(one[0] - 2.0) < 1e-6)
    True
    """
    low = np.zeros(sds.shape[:-1])
    high = 8.0 * sds.max(axis=-1)
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = inside(middle, sds, weights) < level
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))

"""Mixtures of normal laws with one centre: probabilities and quantiles."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from bemt.base.arrays import Array

LEVELS = (math.erf(math.sqrt(0.5)), math.erf(math.sqrt(2.0)))
"""Probabilities within one and two standard deviations of a normal law; called 68 and 95 % [1]."""


def inside(distance: Array, sds: Array, weights: Array) -> Array:
    """Probability of lying nearer to the centre than a distance, (P,) of (P,) and (P, S)."""
    from scipy.special import erf

    share = np.abs(distance)[..., None] / np.maximum(sds, 1e-300) / math.sqrt(2.0)
    return np.asarray((erf(share) * weights).sum(-1))


def half_width(level: float, sds: Array, weights: Array) -> Array:
    """Half width of the central interval of a probability, (P,) of (P, S), to rounding.

    Newton's steps for all points at once. The probability is concave in the distance: after the first step every
    iterate lies below the root and the next one between the two.

    >>> one = half_width(LEVELS[0], np.array([[2.0]]), np.ones(1))
    >>> bool(abs(one[0] - 2.0) < 1e-12)
    True
    """
    from scipy.special import erf, erfinv

    sds = np.asarray(sds, dtype=float)
    spread = np.maximum(sds, np.maximum(1e-12 * sds.max(axis=-1, keepdims=True), 1e-150))  # 0: all of it at the centre
    weights = np.broadcast_to(weights, spread.shape)
    unit = float(erfinv(level)) * math.sqrt(2.0)
    width = np.asarray(unit * np.sqrt((weights * spread**2).sum(-1) / weights.sum(-1)))
    least = unit * spread.min(axis=-1)
    for _ in range(_MOST_STEPS):
        share = width[..., None] / spread / math.sqrt(2.0)
        slope = (weights / spread * np.exp(-(share**2))).sum(-1) * math.sqrt(2.0 / math.pi)
        miss = level - (erf(share) * weights).sum(-1)
        step = np.divide(miss, slope, out=np.zeros_like(width), where=slope > 0.0)
        width = np.maximum(width + step, least)
        if not np.any(np.abs(step) > _CLOSE * width):
            break
    return width


_NODES = 48
_MOST_STEPS, _CLOSE = 60, 1e-9  # a step behind one so short is lost in rounding


def pair_half_width(
    level: float, first: Array, second: Array, sizes: tuple[Array, Array], weights: tuple[Array, Array]
) -> Array:
    """Half width where two standard deviations, each with sizes of its own, add up: (P,) of (P,) and (P,).

    Of equal degree in both, so that it is their root sum of squares times a smooth function of their ratio: solved at
    the nodes of a polynomial, which meets it to 1e-9.

    >>> one = np.ones(1)
    >>> bool(abs(pair_half_width(LEVELS[0], 3.0 * one, 4.0 * one, (one, one), (one, one))[0] - 5.0) < 1e-9)
    True
    """
    coefficients = _by_ratio(level, *(np.asarray(v, dtype=float).tobytes() for v in (*sizes, *weights)))
    angle = np.arctan2(first, second)
    unit = np.polynomial.chebyshev.chebval(angle * (4.0 / math.pi) - 1.0, coefficients)
    return np.asarray(np.hypot(first, second) * unit)


@lru_cache(maxsize=64)
def _by_ratio(level: float, sizes: bytes, other: bytes, weights: bytes, other_weights: bytes) -> Array:
    """Chebyshev coefficients of the half width over the angle between the two, 0 to pi/2."""
    s, t, v, w = (np.frombuffer(b) for b in (sizes, other, weights, other_weights))
    angle = 0.25 * math.pi * (1.0 + np.cos(math.pi * (np.arange(_NODES) + 0.5) / _NODES))
    sds = np.hypot((np.sin(angle)[:, None] * s)[:, :, None], (np.cos(angle)[:, None] * t)[:, None, :])
    found = half_width(level, sds.reshape(_NODES, -1), np.outer(v, w).reshape(-1))
    basis = np.polynomial.chebyshev.chebvander(angle * (4.0 / math.pi) - 1.0, _NODES - 1)
    return np.asarray(np.linalg.solve(basis, found))

"""What the solver says of a rotor as built: expectation and interval at operating points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.rotors.conditioning import CAMPAIGN, ReferenceRun, apart, gains_at, tangents
from bemt.rotors.latents import NAMES, Prior, Sensed, inflow_angle_deg
from bemt.rotors.population import WEIGHTS, Population

# Mixtures of normal laws with one centre: probabilities and quantiles.

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


Solve = Callable[[Array, Array, Array, NDArray[np.intp]], Array]
"""(K,) latent numbers, (P,) rpm, (P,) advance ratio and the points whose air holds, (P,), to (2, P) CT and CP."""

_SCAN = np.linspace(0.05, 2.5, 50)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Expectation and scatter of CT and CP of a rotor as built."""

    mean: Array  # (2, P) Expectation of CT and CP [1]
    # (2, P) Standard deviations from the latent numbers at size 1, from the solver's rest, from single readings [1]
    latent_sd: Array
    rest_sd: Array
    noise_sd: Array
    # (S,), (S,), (R,), (R,) Heavy tails of the latent part and of rest and readings
    sizes: Array
    weights: Array
    rest_sizes: Array
    rest_weights: Array
    campaign_sd: Array | float = 0.0  # (2, P) From one campaign to the next [1]

    @property
    def chances(self) -> Array:
        """Probabilities of the pairs of sizes, in the order of `sds`."""
        return np.outer(self.weights, self.rest_weights).reshape(-1)

    def sds(self, noise: bool) -> Array:
        """Standard deviations of the mixture, (2, P, all pairs of sizes)."""
        still = self.rest_sd**2 + (self.noise_sd**2 if noise else 0.0)
        latent = (self.sizes * self.latent_sd[..., None]) ** 2
        pairs = latent[..., None] + (self.rest_sizes * np.sqrt(still)[..., None])[..., None, :] ** 2
        return np.asarray(np.sqrt(pairs).reshape(*still.shape, -1))

    def log_density(self, y: Array) -> Array:
        """Logarithm of the probability density of readings, (2, P)."""
        from scipy.special import logsumexp

        sds = self.sds(noise=True)
        logs = -0.5 * ((y - self.mean)[..., None] / sds) ** 2 - np.log(sds) - 0.5 * math.log(2.0 * math.pi)
        return np.asarray(logsumexp(logs, axis=-1, b=self.chances))

    def half_width(self, level: float = LEVELS[0], noise: bool = False, campaigns: float = 0.0) -> Array:
        """Half width of the interval that holds the rotor's own coefficient (with noise: a reading), (2, P) [1].

        ``campaigns``: how many times the difference between two campaigns counts, as a variance; 1 for a rotor as its
        own run showed it.
        """
        still = np.hypot(self.rest_sd, self.noise_sd) if noise else self.rest_sd
        still = np.hypot(still, math.sqrt(campaigns) * self.campaign_sd)
        sizes, weights = (self.sizes, self.rest_sizes), (self.weights, self.rest_weights)
        return pair_half_width(level, self.latent_sd, still, sizes, weights)


def zero_thrust(solve: Solve, z: Array, rpm: float) -> float:
    """Advance ratio at which the solver's thrust vanishes; that of the largest one tried where it never does [1]."""
    at = np.zeros(_SCAN.size, dtype=np.intp)
    CT = solve(z, np.full(_SCAN.size, rpm), _SCAN, at)[0]
    down = np.flatnonzero((CT[:-1] > 0.0) & (CT[1:] <= 0.0))
    if not down.size:
        return float(_SCAN[-1])
    i = int(down[0])
    return float(_SCAN[i] + (_SCAN[i + 1] - _SCAN[i]) * CT[i] / (CT[i] - CT[i + 1]))


def sense(
    solve: Solve, diameter_m: float, beta75_deg: float, rpm: Array, J: Array, Re: Array, z: Array | None = None,
    f: Array | None = None,
) -> Sensed:  # fmt: skip
    """Solve points, unless that was done (``f``), and take the slopes; ``beta75_deg`` is the blade angle as drawn."""
    z = np.zeros(len(NAMES)) if z is None else z
    points = np.arange(rpm.size)
    f = solve(z, rpm, J, points) if f is None else f
    top = solve(z, rpm, np.zeros_like(J), points)
    slopes = tangents(lambda at: solve(at, rpm, J, points).reshape(-1), z)
    T = slopes.reshape(2, rpm.size, -1).transpose(0, 2, 1)
    alpha = beta75_deg + z[NAMES.index("angle_deg")] - inflow_angle_deg(J, f[0])
    return Sensed(diameter_m, J, alpha, Re, f, top, T)


def predict(
    p: Population, prior: Prior, at: Sensed, mean: Array | None = None, reference: ReferenceRun | None = None
) -> Prediction:
    """Expectation and scatter at points."""
    T = at.T
    if mean is None:
        mean = at.f + np.einsum("ckp,k->cp", T, prior.mean)
    mean = mean + p.bias(at)
    rest = p.rest_sd(at)
    if reference is not None:
        shift, T, left = reference.near(p, at)
        # near the run the rest is as large as it was there, if that is more than usual; far from it, as large as is
        # usual
        usual = float(np.sqrt(WEIGHTS @ p.rest_sizes**2))
        told = 1.0 - np.divide(left, rest, out=np.ones_like(rest), where=rest > 0.0) ** 2
        mean, rest = mean + shift, left * np.sqrt(told * max(reference.size / usual, 1.0) ** 2 + 1.0 - told)
    latent = np.sqrt(np.maximum(np.einsum("ckp,kj,cjp->cp", T, prior.cov, T), 0.0))
    gains = apart(at.diameter_m) if prior.known_from == "measured" else CAMPAIGN
    return Prediction(
        mean, latent, rest, p.noise_sd(at), prior.sizes, prior.weights, p.rest_sizes, WEIGHTS,
        gains_at(gains, at.J) * np.abs(mean),
    )  # fmt: skip

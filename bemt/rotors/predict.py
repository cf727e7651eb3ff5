"""What the solver says of a rotor as built: expectation and interval at operating points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.rotors.conditioning import tangents
from bemt.rotors.latents import NAMES, Prior, Sensed, inflow_angle_deg
from bemt.rotors.mixture import LEVELS, pair_half_width
from bemt.rotors.population import WEIGHTS, Population
from bemt.rotors.reference import CAMPAIGN, ReferenceRun, apart, gains_at

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
    solve: Solve, diameter_m: float, beta75_deg: float, rpm: Array, J: Array, Re: Array, z: Array | None = None
) -> Sensed:
    """Solve points and take the slopes there, 2 K + 2 calls; ``beta75_deg`` is the blade angle as drawn."""
    z = np.zeros(len(NAMES)) if z is None else z
    points = np.arange(rpm.size)
    f = solve(z, rpm, J, points)
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

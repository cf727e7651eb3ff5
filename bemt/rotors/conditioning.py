"""A rotor from a run of its own: the posterior of its latent numbers by Gauss-Newton on the real solver."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.rotors.latents import STEP, Prior, Sensed, arrays_of
from bemt.rotors.population import AT_REST_J, SMALL_IN, Population

Readings = Callable[[Array], Array]

TOLERANCE = 0.25
"""Steps shorter than this share of a posterior standard deviation end the search [1]."""
BIRGE = 1.5
"""Mean square of the residuals, over that of the roughest noise, beyond which the noise is taken for larger [1]."""
RARE = 0.02
"""Probability below which a size of the noise is too rare to be believed of a run [1]."""
MOST_STEPS = 8
"""Tangents are taken so often at most [1]."""


@dataclass(frozen=True, eq=False)
class Conditioned:
    """Outcome of `condition`."""

    # (K,), (K, K) Posterior of the latent numbers, in the units of the prior
    mean: Array
    cov: Array
    at: Array  # (K,) Where the tangents were taken, within `TOLERANCE` of the mean when converged [units of the prior]
    # (M,), (M, K) The solver and its tangents there [unit of the readings]
    f: Array
    T: Array
    # (S,) Heavy tail: factors on the prior's standard deviations and their posterior probabilities [1]
    sizes: Array
    weights: Array
    steps: int  # Tangents taken [1]
    converged: bool  # Whether the point stood still to within `TOLERANCE` posterior standard deviations
    noise_size: float  # Root mean square of the factor on the noise, posterior [1]
    log_evidence: float  # Laplace's logarithm of the evidence of the reference [1]
    # Factor on the covariance of the noise, above 1 for readings that no rotor of the prior could give [1]
    excess: float = 1.0


def condition(
    solve: Readings, prior: Prior, y: Array, noise: Array, noise_sizes: Array | None = None,
    noise_weights: Array | None = None, tolerance: float = TOLERANCE, most: int = MOST_STEPS,
    start: Array | None = None,
) -> Conditioned:  # fmt: skip
    """Posterior of a rotor's latent numbers from readings of a reference run; the search begins at ``start``.

    Notes
    -----
    DIAGNOSIS section 7. With L L^T = noise, A = L^-1 T and the prior whitened, z+ = (I + A^T A)^-1 A^T L^-1 (y - f0),
    f0 = f(c) - T (c - prior mean); a step is accepted by the misfit plus the log-determinant at every size of the heavy
    tail, with what `tolerance` in every number is worth, else halved. The heavy tail is a mixture of sizes: the
    posterior weights take the place of s^2 = (nu s0^2 + x^2)/(nu + 1). Readings that lie further off than the largest
    of the noise's usual sizes bears are believed less, by Birge's ratio (R. T. Birge, Physical Review 40, 1932, p. 207,
    not checked): a run that fits no rotor moves none. The ratio is of readings to each other, so one alone has none: it
    is this rotor's.
    """
    z = np.array(prior.mean if start is None else start, dtype=float)
    f = np.asarray(solve(z), dtype=float)
    kept = np.isfinite(f) & np.isfinite(y)
    if not kept.any() or noise.shape != (y.size, y.size) or f.shape != y.shape:
        raise ValueError(f"got {int(kept.sum())} usable of {y.size} readings and noise {noise.shape}; expected some")
    white: Array = np.linalg.cholesky(noise[np.ix_(kept, kept)]).astype(np.float64)
    target = np.asarray(y, dtype=float)[kept]
    steps, converged = 0, False
    tail = (np.ones(1), np.ones(1)) if noise_sizes is None or noise_weights is None else (noise_sizes, noise_weights)
    free = prior.sd > 0.0
    T = tangents(solve, z, free)
    here = _linear(prior, white, tail, target, f[kept], T[kept], z)
    while steps < most and not converged:
        steps += 1
        move, taken = here.mean - z, False
        for share in (1.0, 0.5, 0.25, 0.125):
            at = z + share * move
            f_new = np.asarray(solve(at), dtype=float)
            if not np.isfinite(f_new[kept]).all():
                continue
            T_new = tangents(solve, at, free)
            if not np.isfinite(T_new[kept]).all():
                continue
            there = _linear(prior, white, tail, target, f_new[kept], T_new[kept], at)
            if there.score >= here.score - 0.5 * free.sum() * tolerance**2:  # what is within the tolerance
                taken = True
                break
        if not taken:
            break
        z, f, T, here = at, f_new, T_new, there
        converged = bool(np.all(np.abs(here.mean - z) <= tolerance * np.sqrt(np.diag(here.cov))))
    if noise_sizes is not None and noise_weights is not None and target.size > 1:
        largest = float(noise_sizes[noise_weights >= RARE].max())
        left = np.linalg.solve(white, target - f[kept] - T[kept] @ (here.mean - z))
        excess = float(left @ left) / (left.size * largest**2)
        if excess > BIRGE:
            again = condition(solve, prior, y, excess * noise, noise_sizes, noise_weights, tolerance, most, z)
            return replace(again, excess=excess * again.excess)
    return Conditioned(
        here.mean, here.cov, z, f, T, prior.sizes, here.weights, steps, converged, here.noise_size, here.log_evidence
    )


@dataclass(frozen=True, eq=False)
class _Linear:
    """Posterior of the linearised solver, and how good the point of the tangents is."""

    mean: Array
    cov: Array
    weights: Array
    noise_size: float
    score: float
    log_evidence: float


def _linear(prior: Prior, white: Array, tail: tuple[Array, Array], y: Array, f: Array, T: Array, z: Array) -> _Linear:
    """Mixture over the sizes of prior and noise, exact for a solver that is linear around z."""
    A, r = np.linalg.solve(white, T), np.linalg.solve(white, y - f + T @ (z - prior.mean))
    at = np.linalg.solve(white, y - f)
    # a number that is known exactly has no variance and no direction
    values, directions = np.linalg.eigh(prior.cov)
    free = values > 1e-12 * values.max()
    root = directions[:, free] * np.sqrt(values[free])
    away = np.linalg.lstsq(root, z - prior.mean, rcond=None)[0]
    B = A @ root
    vectors, singular, _ = np.linalg.svd(B.T, full_matrices=False)
    gain, seen = singular**2, vectors.T @ (B.T @ r)
    fixed = -np.log(np.diag(white)).sum() - 0.5 * y.size * np.log(2.0 * np.pi)
    means, covs, evidence, scores, noisy = [], [], [], [], []
    for size, weight in zip(prior.sizes, prior.weights, strict=True):
        for rough, chance in zip(*tail, strict=True):
            s2, t2 = size * size, rough * rough
            shrunk = s2 / (1.0 + s2 / t2 * gain)
            means.append(prior.mean + root @ (vectors @ (shrunk / t2 * seen)))
            inner = vectors * np.sqrt(shrunk)
            cov = s2 * (np.eye(root.shape[1]) - vectors @ vectors.T) + inner @ inner.T
            covs.append(root @ cov @ root.T)
            half = 0.5 * np.log1p(s2 / t2 * gain).sum() + y.size * np.log(rough)
            chances = np.log(weight * chance) + fixed - half
            evidence.append(chances - 0.5 * (r @ r - seen @ (shrunk / t2 * seen)) / t2)
            # misfit of the real solver at the point itself, with the same determinant: steps are judged by it
            scores.append(chances - 0.5 * (at @ at / t2 + away @ away / s2))
            noisy.append(t2)
    logs = np.array(evidence)
    top = logs.max()
    weights = np.exp(logs - top)
    total = float(top + np.log(weights.sum()))
    weights /= weights.sum()
    mean = np.einsum("s,sk->k", weights, np.array(means))
    spread = np.array(means) - mean
    cov = np.einsum("s,sij->ij", weights, np.array(covs)) + np.einsum("s,si,sj->ij", weights, spread, spread)
    best = float(np.max(scores) + np.log(np.exp(np.array(scores) - np.max(scores)).sum()))
    by_size = weights.reshape(prior.sizes.size, -1).sum(axis=1)
    return _Linear(mean, cov, by_size, float(np.sqrt(weights @ np.array(noisy))), best, total)


def tangents(solve: Readings, z: Array, free: NDArray[np.bool_] | None = None) -> Array:
    """Central differences of the readings, (M, K); zero where a number is not free."""
    columns: list[Array] = []
    for k, h in enumerate(STEP):
        step = np.zeros_like(z)
        if free is not None and not free[k]:
            columns.append(np.zeros(1))
            continue
        step[k] = h
        columns.append((solve(z + step) - solve(z - step)) / (2.0 * h))
    return np.stack(np.broadcast_arrays(*columns), axis=1)


# What a reference run says of the solver's rest near its points.
SESSION = 0.01
"""Gain of a stand that all points of a run share, where the recording does not state it: retests of a propeller in one
tunnel repeat CT to about a percent (Brandt and Selig 2011, AIAA 2011-1255, not checked) [1]."""
CAMPAIGN = np.array([[0.057, 0.013], [0.027, 0.024]])
"""Gain on CT and CP that all readings of a campaign share, at rest and in flight: a rotor put on another stand, or
mounted anew.  Two volumes of UIUC give one propeller static CT that differ by 5.2 to 5.6 % in the median, CP by 0.9 to
1.6, in flight by 2.4 to 2.7 and 1.4 to 3.2 %; a median difference d of two is a standard deviation of d / 0.954 of
each [1]."""
SPECIMEN = np.array([[0.037, 0.068], [0.10, 0.068]])
"""The same from one piece to the next of propellers below 7 in: medians of eight pairs of GWS 2.5x0.8 and 5x4.3 and of
Crazyflie propellers in UIUC volume 2, which differ by up to 13, 45, 37 and 42 %.  Of larger ones no second piece was
measured, unless in another campaign [1]."""
STAND = np.array([0.05, 0.15])
"""Gain on thrust and torque of a stand that nobody calibrated: fifty propellers of Drive Calculator lie 4.6 and 9.4 %
in the median, 9 and 28 % at the 90th percentile, from the shipped fit of what UIUC measured under the same name [1]."""
IN_FLIGHT_J = 0.1
"""Advance ratio beyond which a point is in flight: none of the part of the rest that belongs to hover is left [1]."""
_BLIND = 1e6
_FEWEST = 5


def apart(diameter_m: float) -> Array:
    """Gains on CT and CP, (2, 2) at rest and in flight, by which another piece in another campaign differs [1]."""
    return np.hypot(CAMPAIGN, SPECIMEN) if diameter_m < SMALL_IN * 0.0254 * (1.0 - 1e-9) else CAMPAIGN


def gains_at(gains: Array, J: Array) -> Array:
    """Gains at rest and in flight, (2, 2), at advance ratios (P,): of CT and CP, (2, P) [1]."""
    still = np.exp(-((J / AT_REST_J) ** 2))
    return np.asarray(still * gains[0][:, None] + (1.0 - still) * gains[1][:, None])


def scatter(values: Array, order: Array) -> float:
    """Scatter of single readings along a smooth run: root mean square of second differences over the square root of 6.

    Zero with fewer than five. A smooth curve leaves next to none, so that what differs from reading to reading is not
    taken for the solver's rest (von Neumann et al., Annals of Mathematical Statistics 12, 1941, for first differences;
    not checked).
    """
    along = values[np.argsort(order)]
    along = along[np.isfinite(along)]
    return 0.0 if along.size < _FEWEST else float(np.sqrt(np.mean(np.diff(along, 2) ** 2) / 6.0))


def noise_of_run(
    p: Population, at: Sensed, y: Array, single: Array, gain: tuple[float, float] = (SESSION, SESSION),
    others: Array | None = None, theirs: NDArray[np.bool_] | None = None,
) -> Array:  # fmt: skip
    """Covariance of a run's readings without the latent numbers: rest, single readings, what a session shares.

    ``y`` and ``single`` (2, P) are readings (NaN: not taken) and their standard deviations.  The result is (2 P, 2 P),
    CT first; a reading that is missing keeps its row, with a variance beyond all others.  ``others``, (2, 2) as
    `apart`: gains that the points ``theirs`` (all by default) share, of another piece or another campaign.
    """
    noise = p.rest(at) + np.diag(single.reshape(-1) ** 2)
    for i, g in enumerate(gain):
        common = np.zeros_like(y)
        common[i] = g * np.nan_to_num(y[i])
        noise += np.outer(common.reshape(-1), common.reshape(-1))
    still, foreign = np.abs(at.J) < IN_FLIGHT_J, np.ones(at.J.size, bool) if theirs is None else theirs
    for kind, there in zip(() if others is None else others, (still & foreign, ~still & foreign), strict=False):
        for i, g in enumerate(kind):
            common = np.zeros_like(y)
            common[i] = g * there * np.nan_to_num(y[i])
            noise += np.outer(common.reshape(-1), common.reshape(-1))
    good = np.isfinite(y.reshape(-1)) & np.isfinite(at.f.reshape(-1)) & np.isfinite(noise.diagonal())
    return np.asarray(np.where(np.outer(good, good), noise, 0.0) + np.diag(np.where(good, 0.0, _BLIND)))


@dataclass(frozen=True, eq=False)
class ReferenceRun:
    """Rows of a reference run after conditioning, M points (or bins), CT rows first."""

    at: Sensed  # The solver at the points of the run, its slopes at the posterior
    left: Array  # (2 M,) Readings less the solver at the posterior mean; zero where nothing was read [1]
    noise: Array  # (2 M, 2 M) Covariance without the latent numbers: rest, instrument [1]
    # Size of the rest of this rotor, as `Population.rest_sizes` count it; predictions are never narrower for it [1]
    size: float = 1.0

    @property
    def in_flight(self) -> bool:
        """Whether the run has a point in flight; at rest alone it tells little of it, as hover and flight differ."""
        return bool(np.any(np.abs(self.at.J) > IN_FLIGHT_J))

    def near(self, p: Population, at: Sensed) -> tuple[Array, Array, Array]:
        """Shift of the expectation, slopes and remaining rest at other points: (2, P), (2, K, P), (2, P).

        The Gaussian process given the run: with k the covariance to its rows and N theirs, k N^-1 left, T - k N^-1 T_r
        and sd^2 - k N^-1 k^T (Rasmussen and Williams 2006, eq. 2.23 and 2.24; the slopes as their eq. 2.41).
        """
        P = at.J.size
        k = p.rest(at, self.at)
        gain = np.linalg.solve(self.noise, k.T).T
        shift = (gain @ self.left).reshape(2, P)
        run = self.at.T.transpose(0, 2, 1).reshape(self.left.size, -1)
        slopes = at.T - (gain @ run).reshape(2, P, -1).transpose(0, 2, 1)
        variance = p.rest_sd(at).reshape(-1) ** 2 - np.einsum("ij,ij->i", gain, k)
        return shift, slopes, np.sqrt(np.maximum(variance, 0.0)).reshape(2, P)

    def rest(self, p: Population, at: Sensed, other: Sensed | None = None) -> Array:
        """Covariance of the rest between points once the run is known, (2 P, 2 Q)."""
        k = p.rest(at, self.at)
        q = k if other is None else p.rest(other, self.at)
        return np.asarray(p.rest(at, other) - k @ np.linalg.solve(self.noise, q.T))

    @staticmethod
    def given(at: Sensed, noise: Array, y: Array, found: Conditioned) -> ReferenceRun:
        """Reference of a conditioned rotor; rows that are not finite tell nothing."""
        good = np.isfinite(y) & np.isfinite(found.f)
        left = np.where(good, y - found.f - found.T @ (found.mean - found.at), 0.0)
        T = np.where(good[:, None], found.T, 0.0).reshape(2, at.J.size, -1).transpose(0, 2, 1)
        f, top = (np.where(np.isfinite(v), v, 0.0) for v in (at.f, at.top))
        return ReferenceRun(replace(at, f=f, top=top, T=T), left, found.excess * noise, found.noise_size)

    def document(self) -> dict[str, Any]:
        """Plain values for the file."""
        at = {name: np.asarray(value).tolist() for name, value in vars(self.at).items()}
        return {"at": at, "left": self.left.tolist(), "noise": self.noise.tolist(), "size": self.size}

    @staticmethod
    def of(document: Mapping[str, Any]) -> ReferenceRun:
        """Reference of a file."""
        at = Sensed(**arrays_of(document["at"]))
        left, noise = (np.array(document[name], dtype=float) for name in ("left", "noise"))
        return ReferenceRun(at, left, noise, float(document["size"]))

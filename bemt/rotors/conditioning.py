"""A rotor from a run of its own: the posterior of its latent numbers by Gauss-Newton on the real solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.rotors.latents import STEP, Prior

Readings = Callable[[Array], Array]

TOLERANCE = 0.25
"""Steps shorter than this share of a posterior standard deviation end the search [1]."""
BIRGE = 1.5
"""Mean square of the residuals, over that of the roughest noise, beyond which the noise is taken for larger [1]."""
RARE = 0.02
"""Probability below which a size of the noise is too rare to be believed of a run [1]."""
MOST_STEPS = 8
"""Tangents are taken so often at most [1]."""
_SLACK = 1e-6


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
    # (M,) ``f - T (at - prior mean)``: the baseline for which a prior centred at the case counts nothing twice [of the
    # readings]
    f0: Array
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
) -> Conditioned:  # fmt: skip
    """Posterior of a rotor's latent numbers from readings of a reference run.

    Notes
    -----
    DIAGNOSIS section 7.  With L L^T = noise, A = L^-1 T and the prior whitened, z+ = (I + A^T A)^-1 A^T L^-1 (y - f0),
    f0 = f(c) - T (c - prior mean); a step is accepted by the misfit plus the log-determinant at every size of the heavy
    tail, else halved.  The heavy tail is a mixture of sizes: the posterior weights take the place of
    s^2 = (nu s0^2 + x^2)/(nu + 1).  Readings that lie further off than the largest of the noise's usual sizes bears are
    believed less, by Birge's ratio (R. T. Birge, Physical Review 40, 1932, p. 207, not checked): a run that fits no
    rotor moves none.
    """
    z = np.array(prior.mean, dtype=float)
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
            if there.score >= here.score - _SLACK:
                taken = True
                break
        if not taken:
            break
        z, f, T, here = at, f_new, T_new, there
        converged = bool(np.all(np.abs(here.mean - z) <= tolerance * np.sqrt(np.diag(here.cov))))
    if noise_sizes is not None and noise_weights is not None:
        largest = float(noise_sizes[noise_weights >= RARE].max())
        left = np.linalg.solve(white, target - f[kept] - T[kept] @ (here.mean - z))
        excess = float(left @ left) / (left.size * largest**2)
        if excess > BIRGE:
            again = condition(solve, prior, y, excess * noise, noise_sizes, noise_weights, tolerance, most)
            return replace(again, excess=excess * again.excess)
    return Conditioned(
        here.mean, here.cov, z, f, T, f - T @ (z - prior.mean), prior.sizes, here.weights, steps, converged,
        here.noise_size, here.log_evidence,
    )  # fmt: skip


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

"""The blade of a reference, found on the real solver by the steps of `bemt.rotors`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import log_density
from bemt.judge.diagnose import noise
from bemt.judge.diagnose.blade import AsLabelled, CalibratedBlade
from bemt.rotors.conditioning import condition, tangents
from bemt.rotors.latents import NAMES, UNITS, AsBuilt, Prior

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem

FARTHEST_DEG = 11.0
"""A blade that a reference turns further than this is another rotor, or the recording is wrong [deg]."""
# With more error of the solver than this it would take what belongs to the blade; every reading has this noise more,
# shares of the largest coefficient, so that no detail of a curve drives the blade anywhere.
_SMALL, _ROUGH = 0.03, 0.01
# Loads that a blade is sought on.
_FEWEST = 3
# Rounds of choosing covariance and point.
_ROUNDS = 3
_WORTH_SAYING = 0.5


def _covariances(problem: Problem) -> Iterator[Array]:
    """Covariances without the blade under which it may be chosen: solver errors of 3 % or less."""
    for h, C in noise.covariances(problem):
        if h.model <= _SMALL:
            yield C + np.diag((_ROUGH * problem.scale) ** 2)


def _misfit(C: Array, r: Array) -> float:
    return float(r @ np.linalg.solve(C, r))


def _likeliest(tables: Sequence[Array], r: Array, B: Array) -> int:
    """Covariance under which a residual is likeliest when the blade is free."""
    return int(np.argmax([log_density(C + B @ B.T, r, constant=False) for C in tables]))


def calibrated(problem: Problem, prior: Prior) -> tuple[CalibratedBlade | None, str, str]:
    """Find the blade on the reference readings."""
    rows = ~problem.free
    if np.count_nonzero(problem.channel[rows] < 2) < _FEWEST:
        return None, "", ""
    kind = AsLabelled if prior.known_from == "label" else AsBuilt
    parts = [p for p in problem.parts if p.record.reference]
    ends = np.cumsum([0, *(len(p.channels) * len(p.record) for p in problem.parts)])
    kept = [problem.kept[a:b] for p, a, b in zip(problem.parts, ends, ends[1:], strict=False) if p.record.reference]

    def solve(z: Array) -> Array:
        blade = kind(*map(float, z))
        return np.concatenate([p.predict(p.turned(blade))[k] for p, k in zip(parts, kept, strict=True)])

    y = problem.y[rows]
    whole = problem.with_tangents(np.array([not name.startswith("blade ") for name in problem.names]))
    tables = [C[np.ix_(rows, rows)] for C in _covariances(whole)]
    root = np.asarray(np.linalg.cholesky(prior.cov), dtype=float)
    at, chosen = prior.mean, -1
    for _ in range(_ROUNDS):
        best = _likeliest(tables, y - solve(at), tangents(solve, at) @ root)
        if best == chosen:
            break
        chosen, found = best, condition(solve, prior, y, tables[best])
        at = found.mean
    words = ", ".join(
        f"{name.removesuffix('_deg').replace('_', ' ')} {value:+.2g}{' deg' if UNITS[name] == 'deg' else ''}"
        for name, value, sd in zip(NAMES, found.mean, np.sqrt(np.diag(prior.cov)), strict=True)
        if abs(value) > _WORTH_SAYING * sd
    )
    if abs(found.mean[0]) > FARTHEST_DEG:
        return None, "", (
            f"the reference fits a blade turned by {found.mean[0]:+.0f} deg: another rotor, or a wrong "
            "diameter, number of blades or unit. The blade of the case was kept"
        )  # fmt: skip
    rest, start = y - solve(found.mean), y - solve(prior.mean)
    if not np.isfinite(rest).all() or _misfit(tables[chosen], rest) > _misfit(tables[chosen], start):
        return None, "no blade fits the reference better than that of the case, which was kept", ""
    size = float(np.sqrt(found.weights @ found.sizes**2))
    note = f"blade fitted to the reference, starting from its {prior.known_from}: {words or 'no change worth stating'}"
    return CalibratedBlade(found.mean, prior.mean, size * root, kind), note, ""

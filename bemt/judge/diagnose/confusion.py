"""Which effects look alike in a test plan: classes that no algorithm can tell apart with these points.

With the covariance C of noise, nuisances and solver error, the distance of an effect from another is the length of what
is left of its whitened signature after the best setting of the other one (and, free in sign and size, the same with the
principal angle of their signatures: d^2 sin^2(phi), Eriksson, Frisk and Krysander 2013, Automatica 49:1591, in the
Gaussian case).  Below :data:`ALIKE` standard deviations two effects are one class.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.judge.diagnose.form import Form, LawError, columns, form_modes

if TYPE_CHECKING:
    from bemt.judge.diagnose.form import State
    from bemt.judge.diagnose.posterior import Evidence

ALIKE = 3.0
"""Distance below which two effects are one class [1]."""


@dataclass(frozen=True, eq=False)
class Confusion:
    """Distances between effects in a plan."""

    ids: tuple[str, ...]  # Effects
    size: Array  # (N,) Length of each effect's whitened signature at the setting that was used [1]
    distance: Array  # (N, N) Row effect from the nearest setting of the column effect [1]

    def classes(self) -> list[list[str]]:
        """Effects that are seen but not told apart: connected groups of two or more."""
        seen = [i for i in range(len(self.ids)) if self.size[i] >= ALIKE]
        groups: list[set[int]] = []
        for i in seen:
            near = {j for j in seen if j != i and min(self.distance[i, j], self.distance[j, i]) < ALIKE} | {i}
            touching = [g for g in groups if g & near]
            for g in touching:
                near |= g
                groups.remove(g)
            groups.append(near)
        return [[self.ids[i] for i in sorted(g)] for g in groups if len(g) > 1]


def distance(state: State, s: Array, span: slice, form: Form | None = None) -> float:
    """Distance of a whitened signature from a candidate, over its settings. [1]"""
    square = _squares(s[:, None] - state.S[:, span], form)
    return float(np.sqrt(max(float(np.min(square)), 0.0)))


def _squares(d: Array, form: Form | None) -> Array:
    """Squared lengths of whitened differences (M, n), less what the form of an effect may be, (n,)."""
    square = np.sum(d * d, axis=0)
    if form is not None:
        p = form.project(d)
        square = square - np.sum(p * p, axis=0)
    return np.asarray(square)


def confusion(found: Evidence, settings: dict[str, int] | None = None) -> Confusion:
    """Distances between all candidates."""
    state = found.states[0]
    ids = tuple(c.id for c in found.candidates)
    chosen = [state.S[:, found.spans[c.id].start + (settings or {}).get(c.id, c.middle)] for c in found.candidates]
    size = np.array([float(np.sqrt(s @ s)) for s in chosen])
    settings = settings or {}
    modes = form_modes(found.problem, found.candidates)
    at = [settings.get(c.id, c.middle) for c in found.candidates]
    matrix = np.zeros((len(ids), len(ids)))
    if ids:
        own = [columns(found.problem, c, g, modes[c.id]) for c, g in zip(found.candidates, at, strict=True)]
        forms = [LawError.of(state.white.changes(x), width).at(np.zeros(state.r.size)) for width, x in own]
        starts = [found.spans[i].start for i in ids]
        for k, s in enumerate(chosen):
            square = _squares(s[:, None] - state.S, forms[k])
            matrix[k] = np.sqrt(np.maximum(np.minimum.reduceat(square, starts), 0.0))
        np.fill_diagonal(matrix, 0.0)
    return Confusion(ids, size, matrix)


def nearest(found: Evidence) -> str:
    """Effect whose signature is most nearly parallel to the mismatch: what a look at the curves would say."""
    problem = found.problem
    r = (problem.y - problem.f0) / problem.u

    def cosine(signatures: Array) -> float:
        s = signatures / problem.u[:, None]
        length = np.sqrt(np.sum(s * s, axis=0))
        return float(np.max(s.T @ r / np.where(length > 0, length, np.inf)))

    return max(((cosine(c.signatures), c.id) for c in found.candidates), default=(0.0, ""))[1]

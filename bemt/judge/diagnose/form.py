"""Error of the law of an effect, and which effects look alike in a test plan.

Published laws of one effect differ, and so may the truth. With the covariance C of noise, nuisances and solver error,
the distance of an effect from another is the length of what is left of its whitened signature after the best setting of
the other one (and, free in sign and size, the same with the principal angle of their signatures: d^2 sin^2(phi),
Eriksson, Frisk and Krysander 2013, Automatica 49:1591, in the Gaussian case).  Below :data:`ALIKE` standard deviations
two effects are one class: no algorithm can tell them apart with these points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import LinearTerms, log_sum
from bemt.judge.diagnose import noise
from bemt.judge.explanation import Explanation
from bemt.physics import effects
from bemt.physics.effects.base import FORM

if TYPE_CHECKING:
    from bemt.base.gaussian.whitening import Conditional
    from bemt.judge.diagnose.noise import Hyper
    from bemt.judge.diagnose.posterior import Evidence
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate

_TORQUE = 0.5


@dataclass(frozen=True, eq=False)
class Form(LinearTerms):
    """Error of the law of one effect at its likeliest size, whitened."""

    size: float = 0.0  # Standard deviation, share of the effect's size; columns for instruments: none [1]

    @property
    def half_log_det(self) -> float:
        """Half the logarithm of the determinant of 1 + B B^T, less that of the prior weight of the size."""
        return super().half_log_det - float(np.log(FORM.get(self.size, 1.0)))


@dataclass(frozen=True, eq=False)
class LawError:
    """Whitened columns of the error of one law or of two, of which those of the modes come in several sizes."""

    B: Array  # (M, Q) Of unit size [1]
    mode: NDArray[np.bool_]  # (Q,) Whether a column is a mode
    roots: tuple[tuple[float, Array, Array], ...]  # Size, scale of the columns, Cholesky factor of 1 + B^T B

    @classmethod
    def of(cls, B: Array, *widths: int) -> LawError:
        """Columns of which blocks of these widths are in turn modes and others, which have their own size."""
        kinds: list[bool] = []
        for k, width in enumerate(widths):
            kinds += [k % 2 == 0] * width
        mode = np.array(kinds + [len(widths) % 2 == 0] * (B.shape[1] - len(kinds)), dtype=bool)
        gram = B.T @ B
        roots: list[tuple[float, Any, Any]] = []
        for size in FORM if mode.any() else (min(FORM),):
            scale = np.where(mode, size, 1.0)
            roots.append((size, scale, np.linalg.cholesky(np.eye(scale.size) + scale[:, None] * gram * scale)))
        return cls(B, mode, tuple(roots))

    def _levels(self) -> list[float]:
        weights = [np.log(FORM[size]) if self.mode.any() else 0.0 for size, *_ in self.roots]
        return [float(w - np.sum(np.log(np.diag(root)))) for w, (*_, root) in zip(weights, self.roots, strict=True)]

    def gain(self, rest: Array) -> Array:
        """What the error adds to the log likelihood of what settings leave (M, n), all sizes summed, (n,)."""
        if not self.B.shape[1]:
            return np.zeros(rest.shape[1])
        x = self.B.T @ rest
        out = [0.5 * np.sum(np.linalg.solve(root, scale[:, None] * x) ** 2, axis=0) for _, scale, root in self.roots]
        return log_sum(np.array(out), np.array(self._levels())[:, None], axis=0)

    def gain_of_two(self, r: Array, a: Array, b: Array) -> Array:
        """The same for readings (M,) less each of some signatures (M, A) and each of others (M, B), (A, B)."""
        if not self.B.shape[1]:
            return np.zeros((a.shape[1], b.shape[1]))
        x, out = self.B.T @ np.column_stack([r, a, b]), []
        for _, scale, root in self.roots:
            q = np.linalg.solve(root, scale[:, None] * x)
            left, second = q[:, :1] - q[:, 1 : 1 + a.shape[1]], q[:, 1 + a.shape[1] :]
            out.append(0.5 * np.sum(left**2, axis=0)[:, None] + 0.5 * np.sum(second**2, axis=0) - left.T @ second)
        return log_sum(np.array(out), np.array(self._levels())[:, None, None], axis=0)

    def at(self, rest: Array) -> Form:
        """Error at the size that explains most of what is left, (M,)."""
        forms = [Form(self.B * scale, root, size if self.mode.any() else 0.0) for size, scale, root in self.roots]
        return max(forms, key=lambda f: float(f.gain(rest)) if f.B.shape[1] else 0.0)


def columns(problem: Problem, candidate: Candidate, setting: int, modes: Array) -> tuple[int, Array]:
    """How many modes there are; modes times the signature, and what else the law leaves open."""
    signature = candidate.signatures[:, setting]
    more = [signature[:, None] * modes, candidate.other_laws(setting), candidate.within(setting)]
    if effects.catalogue()[candidate.id].torque_open:
        more.append(_torque_share(problem, signature)[:, None])
    return modes.shape[1], np.concatenate(more, axis=1)


def _torque_share(problem: Problem, signature: Array) -> Array:
    """Torque that changes by half the share that thrust changes by, either way: one standard deviation, (M,)."""
    thrust, torque = problem.channel == 0, problem.channel == 1
    share = np.zeros(int(problem.point.max()) + 1)
    loaded = thrust & (np.abs(problem.f0) > 0.2 * problem.scale)
    share[problem.point[loaded]] = signature[loaded] / problem.f0[loaded]
    return np.where(torque, _TORQUE * share[problem.point] * problem.f0, 0.0)


def form_modes(problem: Problem, candidates: Sequence[Candidate]) -> dict[str, Array]:
    """Modes of the error of each effect's law: smooth ones for physics, none for instruments. [1]"""
    out: dict[tuple[tuple[str, ...], tuple[str, ...]], Array] = {}
    laws = {}
    for c in candidates:
        effect = effects.catalogue()[c.id]
        laws[c.id] = key = (effect.along, noise.law_of(effect, not problem.by_laws))
        if key not in out:
            modes = noise.smooth_modes(problem, *key)
            # instruments are exact but for what they say themselves that they follow: a drift the clock
            out[key] = modes if any(key) else modes[:, :0]
    return {name: out[key] for name, key in laws.items()}


# Readings and signatures under one setting of the covariance, whitened, and what they are worth there.
@dataclass(eq=False)
class State:
    """Readings and signatures whitened by one setting of the covariance, those of the test given the reference."""

    hyper: Hyper  # The setting
    white: Conditional  # Its factors
    r: Array  # (M,) Whitened residual [1]
    S: Array  # (M, G) Whitened signatures of all settings of all candidates [1]
    half: Array  # (G,) Half of their squared lengths [1]
    forms: dict[str, Form] = field(default_factory=dict)  # Error of the form of each candidate, at its best setting
    log_z: dict[Explanation, float] = field(default_factory=dict)  # Logarithm of the evidence per explanation
    small: dict[Explanation, float] = field(default_factory=dict)  # The same of what is too small to count
    best: dict[str, int] = field(default_factory=dict)  # Best setting of each candidate
    best_rival: str = ""  # Unknown smooth effect of largest evidence

    def scores(self, what: Explanation, spans: Mapping[str, slice], log_w: Array) -> Array:
        """Log likelihood over that of "none" of every setting of an effect, priors included, (A,), or of two, (A, B).

        Signatures of two are added, and their forms left out.
        """
        if not what.pair:
            (name,) = what
            return self.gains(name, spans[name], self.r[:, None])[:, 0] + log_w[spans[name]]
        A, B = (spans[i] for i in what)
        a, b = (self.S[:, x].T @ self.r - self.half[x] + log_w[x] for x in (A, B))
        total = a[:, None] + b[None, :] - self.S[:, A].T @ self.S[:, B]
        return np.asarray(total)

    def gains(self, name: str, span: slice, R: Array) -> Array:
        """Log likelihood over that of "none" of every setting of a candidate for whitened residuals. [1]"""
        S = self.S[:, span]
        out = S.T @ R - self.half[span][:, None]
        form = self.forms.get(name)
        if form is not None and form.B.shape[1]:
            pS, pR = form.project(S), form.project(R)
            out += (
                0.5 * np.sum(pS * pS, axis=0)[:, None] - pS.T @ pR + 0.5 * np.sum(pR * pR, axis=0) - form.half_log_det
            )
        return np.asarray(out)


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
            d = s[:, None] - state.S  # less what the form of the effect may be
            square = np.sum(d * d, axis=0) - np.sum(forms[k].project(d) ** 2, axis=0)
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

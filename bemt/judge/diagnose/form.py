"""Error of the form of an effect: published laws of one effect differ, and so may the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import LinearTerms
from bemt.judge.diagnose import noise
from bemt.physics import effects
from bemt.physics.effects.base import FORM

if TYPE_CHECKING:
    from bemt.base.gaussian.whitening import Conditional
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate


@dataclass(frozen=True, eq=False)
class Form(LinearTerms):
    """Error of the form of one effect, whitened: published laws of one effect differ by a share of its own size."""

    # Standard deviation of the form, share of the effect's size; columns for instruments: none, they are exact [1]
    size: float = 0.0

    @property
    def half_log_det(self) -> float:
        """Half the logarithm of the determinant of 1 + B B^T, less that of the prior weight of the size."""
        return super().half_log_det - float(np.log(FORM.get(self.size, 1.0)))


@dataclass(frozen=True, eq=False)
class LawError:
    """Errors of the forms of several effects at a time, side by side: columns that an effect does not have are zero."""

    # (C, M, Q) Whitened modes of unit size, then what lies between a setting and its neighbours on the grid [1]
    B: Array
    size: Array  # (C,) Standard deviation of each form, share of the effect's size [1]
    # (C, Q) Size of each column: that of the form, 1 for what lies between settings and for columns that are not there
    # [1]
    scale: Array
    gram: Array  # (C, Q, Q) 1 + B^T B with the columns scaled [1]
    width: NDArray[np.intp]  # (C,) Columns that each effect has
    half_log_det: Array  # (C,) As that of :class:`Form`, 0 where an effect has no column [1]

    @classmethod
    def of(cls, white: Conditional, columns: Sequence[tuple[int, Array]], d: Array | None = None) -> LawError:
        """Whitened columns of each effect, as :func:`columns` gives them; ``d`` chooses the sizes."""
        q = np.array([n for n, _ in columns], dtype=np.intp)
        width = np.array([x.shape[1] for _, x in columns], dtype=np.intp)
        flat = white.changes(np.concatenate([x for _, x in columns], axis=1))
        C, Q = len(columns), int(width.max(initial=0))
        there = np.arange(Q) < width[:, None]
        B = np.zeros((C, Q, flat.shape[0]))
        B[there] = flat.T
        plain = B @ B.transpose(0, 2, 1)
        sizes, half, gram, scale = _sizes(plain, q, width)
        if d is None:
            best = np.zeros(C, dtype=np.intp)
        else:
            x = scale[..., None] * np.matmul(B, d.T[:, :, None])
            gain = 0.5 * np.sum(x * np.linalg.solve(gram, x), axis=(2, 3)) - half
            best = np.where(q > 0, np.argmax(gain, axis=0), 0)
        k = np.arange(C)
        return cls(B.transpose(0, 2, 1), sizes[best], scale[best, k], gram[best, k], width,
                   np.where(width > 0, half[best, k], 0.0))  # fmt: skip

    def gains(self, rest: Sequence[Array]) -> list[Array]:
        """What each form adds to the log likelihood of its effect's settings, for what these leave, (M, n) each."""
        C, _, Q = self.B.shape
        x = np.zeros((C, Q, max((r.shape[1] for r in rest), default=0)))
        for k, r in enumerate(rest):
            x[k, :, : r.shape[1]] = self.B[k].T @ r
        x *= self.scale[:, :, None]
        total = 0.5 * np.sum(x * np.linalg.solve(self.gram, x), axis=1) - self.half_log_det[:, None]
        return [t[: r.shape[1]] for t, r in zip(total, rest, strict=True)]

    def replaced(self, where: NDArray[np.intp], other: LawError) -> LawError:
        """The same with some effects taken from another one that has only these."""
        Q, Qo = self.B.shape[2], other.B.shape[2]
        if Qo < Q:
            other = other._padded(Q)
        mine = self._padded(Qo) if Qo > Q else self

        def put(a: Array, b: Array) -> Array:
            out = a.copy()
            out[where] = b
            return out

        return LawError(*(put(getattr(mine, n), getattr(other, n)) for n in
                       ("B", "size", "scale", "gram", "width", "half_log_det")))  # type: ignore[arg-type]  # fmt: skip

    def _padded(self, Q: int) -> LawError:
        C, M, q = self.B.shape
        B, scale, gram = np.zeros((C, M, Q)), np.ones((C, Q)), np.tile(np.eye(Q), (C, 1, 1))
        B[:, :, :q], scale[:, :q], gram[:, :q, :q] = self.B, self.scale, self.gram
        return LawError(B, self.size, scale, gram, self.width, self.half_log_det)

    def __getitem__(self, k: int) -> Form:
        """Form of one effect."""
        w = int(self.width[k])
        B = self.B[k, :, :w] * self.scale[k, :w]
        return Form(B, np.asarray(np.linalg.cholesky(self.gram[k, :w, :w]), dtype=float), float(self.size[k]))


def columns(candidate: Candidate, setting: int, modes: Array) -> tuple[int, Array]:
    """How many modes there are; modes times the signature, and what lies between it and its neighbours on the grid."""
    shape = candidate.signatures[:, setting, None] * modes
    return modes.shape[1], np.concatenate([shape, candidate.between(setting)], axis=1)


def _sizes(plain: Array, q: NDArray[np.intp], width: NDArray[np.intp]) -> tuple[Array, Array, Array, Array]:
    """Sizes of a form, smallest first, and for each: half log determinant (F, C), 1 + B^T B, scale of the columns."""
    sizes = np.array(sorted(FORM))
    C, Q = plain.shape[:2]
    shape = np.arange(Q) < q[:, None]
    scale = np.where(shape, sizes[:, None, None], 1.0)
    gram = np.eye(Q) + scale[..., None] * plain * scale[:, :, None, :]
    root = np.linalg.cholesky(gram)
    half = np.sum(np.log(np.diagonal(root, axis1=2, axis2=3)), axis=2)
    return sizes, half - np.log([FORM[float(f)] for f in sizes])[:, None], gram, scale


def form_modes(problem: Problem, candidates: Sequence[Candidate]) -> dict[str, Array]:
    """Modes of the error of each effect's form: smooth ones for physics, none for instruments. [1]"""
    out: dict[tuple[tuple[str, ...], tuple[str, ...]], Array] = {}
    laws = {}
    for c in candidates:
        effect = effects.catalogue()[c.id]
        laws[c.id] = key = (effect.along, noise.law_of(effect))
        if key not in out:
            modes = noise.smooth_modes(problem, *key)
            # instruments are exact but for what they say themselves that they follow: a drift the clock
            out[key] = modes if any(key) else modes[:, :0]
    return {name: out[key] for name, key in laws.items()}

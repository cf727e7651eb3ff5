"""Readings and signatures under one setting of the covariance, whitened, and what they are worth there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.judge.diagnose.form import Form
from bemt.judge.explanation import Explanation

if TYPE_CHECKING:
    from bemt.base.gaussian.whitening import Conditional
    from bemt.judge.diagnose.noise import Hyper


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

    def both(self, pair: Explanation, spans: Mapping[str, slice], log_w: Array) -> Array:
        """Log likelihood over that of "none" of all settings of two effects, priors included, forms left out, (A, B).

        Signatures are added.
        """
        A, B = (spans[i] for i in pair)
        a, b = (self.S[:, x].T @ self.r - self.half[x] + log_w[x] for x in (A, B))
        total = a[:, None] + b[None, :] - self.S[:, A].T @ self.S[:, B]
        return np.asarray(total)

    def best_of(self, pair: Explanation, spans: Mapping[str, slice], log_w: Array) -> tuple[int, int]:
        """Columns of the best setting of two effects."""
        total = self.both(pair, spans, log_w)
        i, j = np.unravel_index(int(np.argmax(total)), total.shape)
        A, B = (spans[k] for k in pair)
        return A.start + int(i), B.start + int(j)

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

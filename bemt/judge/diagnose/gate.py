"""Is there a mismatch at all: a p-value of the whole weighing, from bootstrapped nulls.

Nulls are drawn from what the recording would be if nothing were left out: noise with its correlation, nuisances and the
solver's own error, at the setting of the covariance that the readings prefer.  Each null goes through the same weighing
of all effects and of the unknown one, so the number of candidates and their correlation are in the p-value.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import log_sum
from bemt.base.gaussian.whitening import whitener
from bemt.judge.diagnose import evidence as ev
from bemt.judge.diagnose import noise, prior
from bemt.judge.diagnose.explanation import UNKNOWN, Explanation

if TYPE_CHECKING:
    from bemt.judge.diagnose.evidence import Evidence

NULLS = 400
"""Bootstrapped nulls of one diagnosis [1]."""


def p_value(found: Evidence, nulls: int = NULLS, seed: int = 0) -> float:
    """Share of nulls that look at least as much like a cause as the recording does. [1]"""
    rng = np.random.default_rng(seed)
    source = found.states[0]
    problem, M = found.problem, found.problem.y.size
    factor = whitener(noise.covariance(problem, source.hyper), problem.u).factor
    draws = factor @ rng.standard_normal((M, nulls))
    return float((1 + np.sum(statistic(found, draws) >= float(statistic(found, found.problem.residual[:, None])[0])))
                 / (1 + nulls))  # fmt: skip


def statistic(found: Evidence, residuals: Array) -> Array:
    """Log odds of any cause over none for residuals (M, B), all settings of the covariance added up."""
    before = prior.log_priors(prior.prior_weights(found.problem, list(found.spans)), pairs=False)
    some, none = [], []
    for s in found.states[: ev.FOR_NULLS]:
        r = s.white(residuals)
        w = np.log(s.hyper.weight) - s.white.log_det - 0.5 * np.sum(r * r, axis=0) - s.white.misfit(residuals)
        gains = [g + before[Explanation.of(name)] for name, g in ev.singles(s, r, found.spans, found.log_w).items()]
        if s.rivals:
            rival = ev.unknown(s.rivals, residuals)
            gains.append(log_sum(rival, axis=0) - np.log(len(rival)) + before[UNKNOWN])
        some.append(log_sum(gains, axis=0) + w)
        none.append(w)
    return np.asarray(log_sum(some, axis=0) - log_sum(none, axis=0))

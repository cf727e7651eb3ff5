"""Physics that the case leaves out and a reference shows as well: what every rotor has is in both runs.

The runs do not differ in it, yet it is why the case fits neither. The reference alone is asked whether it shows it: the
recording may have another cause, which must not answer for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bemt.judge.diagnose import posterior
from bemt.judge.diagnose.prior import ALWAYS

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate


def ask_reference(problem: Problem, candidates: Sequence[Candidate]) -> tuple[Problem, tuple[Candidate, ...]]:
    """Problem that knows what its runs share; candidates were solved in both.

    Of what a reference clearly lacks (a code that can switch it off made it) only the recording's part stays.
    """
    asked = [c for c in candidates if c.id in problem.missing]
    if not asked:
        return replace(problem, shared=frozenset()), tuple(candidates)
    rows = ~problem.free
    shows = posterior.log_odds(problem.of(rows), [c.seen_as(c.signatures[rows]) for c in asked])
    both = frozenset(i for i, odds in shows.items() if odds + np.log(ALWAYS) > 0.0)
    alone = problem.missing - both
    kept = (c.seen_as(np.where(rows[:, None], 0.0, c.signatures)) if c.id in alone else c for c in candidates)
    return replace(problem, shared=both, predicted={}), tuple(kept)

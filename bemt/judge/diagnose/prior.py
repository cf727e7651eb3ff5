"""How likely each explanation is before a reading is looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bemt.judge.compare import drive_laws
from bemt.judge.diagnose import record
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.physics import effects
from bemt.physics.effects.air_density import AirDensity
from bemt.physics.effects.duct import DuctEffect

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem

__all__ = ["ALWAYS", "LEFT_OUT", "PRIOR", "kinds", "log_priors", "present", "prior_weights"]

PRIOR = {"none": 0.4, "single": 0.45, "pair": 0.1, "unknown": 0.05}
"""Prior probability of the kinds of explanation; shared within a kind by the weights of the effects. [1]"""
LEFT_OUT, PRESENT = 10.0, 0.01
"""Weight of an effect of every real rotor that the baseline leaves out, and of one that the baseline has, with other
parameters, beside 1 for all others, where no reference shows the rotor [1]."""
BOTH, ELSE = 0.01, 0.2
"""Beside a reference: weight of what blade and air do in every run and the baseline has, in which two runs do not
differ, and of other physics that it has [1]."""
ALWAYS = 9.0
"""Odds that physics of every rotor is at work, in every run, where the case leaves it out: nobody takes it away [1]."""
# Recorded conditions that differ by less are the same, share.
_SAME = 0.1
EVIDENT = 0.2
"""Weight of what anybody at the stand would see: a second rotor is seldom overlooked [1]."""
RECORDED = 0.3
"""Weight of a wrong density where thermometer and barometer stand in every file: declared [1]."""
CHANGED = 50.0
"""Weight of what the user says he changed: said, weighed, checked [1]."""


def prior_weights(problem: Problem, ids: Sequence[str]) -> dict[str, float]:
    """Weight of each effect: physics that every rotor has is likelier to be missing than a fault is to be there. [1]"""
    usual = {e.id for e in effects.standard()} | {i for p in problem.parts for i in p.left_out}
    shown = any(p.record.reference for p in problem.parts)
    on, everywhere = present(problem), {e.id for e in effects.standard() if not e.along}

    def weight(i: str) -> float:
        cls = effects.catalogue()[i]
        if i in problem.told:
            return CHANGED
        if recorded_change(problem, i):
            return LEFT_OUT
        if i in on and not cls.evident:
            return PRESENT if not shown else BOTH if i in everywhere else ELSE
        if i == AirDensity.id and all(p.record.air_recorded for p in problem.parts):
            return RECORDED
        # between two recordings the change is often one that was made and is known
        rest = EVIDENT if cls.evident and not shown else 1.0
        return LEFT_OUT if i in usual and (not shown or i in problem.shared) else rest

    return {i: weight(i) for i in ids}


def recorded_change(problem: Problem, name: str) -> bool:
    """Whether recording and reference tell themselves that what an effect follows differs between them."""
    if problem.free.all():
        return False
    test, known = ([p.record.extra for p in problem.parts if p.record.reference is which] for which in (False, True))
    for v in (v for v in effects.catalogue()[name].along if v != "time_s"):
        now = [float(np.median(x[v])) for x in test if v in x]
        before = [float(np.median(x[v])) for x in known if v in x]
        if now and (not before or abs(now[0] - before[0]) > _SAME * max(abs(now[0]), abs(before[0]))):
            return True
    return False


def present(problem: Problem) -> set[str]:
    """Effects that the baseline of every recording has; the case's own duct is one."""
    ducts = [{DuctEffect.id} if p.model.duct is not None else set() for p in problem.parts]
    return set.intersection(*({e.id for e in p.baseline} | d for p, d in zip(problem.parts, ducts, strict=True)))


def kinds(problem: Problem) -> Mapping[str, float]:
    """Prior of the kinds of explanation: a drive shows in the speed alone."""
    return drive_laws.PRIOR if np.all(problem.channel == record.CHANNELS.index("rpm")) else PRIOR


def log_priors(
    weights: dict[str, float], pairs: bool = True, of: Mapping[str, float] = PRIOR
) -> dict[Explanation, float]:  # fmt: skip
    """Logarithm of the prior probability of every explanation; `of`: of their kinds."""
    total = sum(weights.values()) or 1.0
    out = {NONE: of["none"], UNKNOWN: of["unknown"]}
    out |= {Explanation.of(i): of["single"] * w / total for i, w in weights.items()}
    if pairs:
        names = list(weights)
        both = {Explanation.of(a, b): weights[a] * weights[b] for k, a in enumerate(names) for b in names[k + 1 :]}
        total = sum(both.values()) or 1.0
        out |= {k: of["pair"] * w / total for k, w in both.items()}
    return {k: float(np.log(v)) for k, v in out.items()}

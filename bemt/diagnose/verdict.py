"""The decision: none, a named effect, a class of look-alikes, the stand, something unknown, or not enough data.

The order of the questions is the order of caution.  Is there a mismatch that nulls do not show?  Does an unknown smooth
effect explain it better, or is something smooth left after the best listed effect?  Which effects are in nearly all
of the probability?  Are there look-alikes of these in this plan, or a second effect that may be there, too?  Only then
is a name given; with a few explanations left, these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt import effects
from bemt.diagnose import blocks, prior
from bemt.diagnose import confusion as look
from bemt.diagnose import fit as fitting

if TYPE_CHECKING:
    from bemt.diagnose.evidence import Evidence

__all__ = ["GATE", "Decision", "decide"]

Array = NDArray[np.float64]

GATE = 0.01
"""Largest p-value at which a mismatch counts as one [1]."""
SURE = 0.85
"""Probability from which an effect, or a class of them, is named [1]."""
LEFT_OVER = 4.0
"""Log odds of a smooth rest beside the best listed effect over no rest, from which the cause is unknown [1]."""
SMALL = 0.1
"""A rest this small beside what the effect explains (both as log odds) is a detail of it, not another cause [1]."""
EARNED = 8.0
"""Log odds that each effect of a pair must add to the other alone: small model errors are not a second cause [1]."""
ENOUGH, EXPECTED = 8.0, 2.5
"""Log odds over none from which a name is given at all (about 4 sigma); of physics known to be left out [1]."""
PROVEN, FORETELLS = 20.0, 0.9
"""Below the first (log odds) an explanation must lower the error on left-out blocks to the second, a ratio; physics
that is on already needs the first in any case, to be on differently [1]."""
PARTNER, MOST = 0.1, 3
"""Probability from which a second effect beside a sure one is mentioned; most members of an open answer [1]."""
NEAR = 5.0
"""Effects of a class may be this far (natural logarithm of the evidence) behind the best one [1]."""


@dataclass(frozen=True)
class Decision:
    """What is said, and why.

    Attributes
    ----------
    verdict : str
        none, named, class, sensor, unknown or insufficient.
    effects : tuple of str
        Effects of the verdict; of a class all members.
    leading : str
        Explanation that is shown: an id, a pair "a+b", or "none".
    probability : float
        Of the verdict [1].
    left_over : float
        Logarithm of the odds of a smooth rest beside the leading explanation [1].
    classes : tuple of tuple of str
        Effects that this plan cannot tell from the leading ones.
    why : str
        The rule that decided.
    """

    verdict: str
    effects: tuple[str, ...]
    leading: str
    probability: float
    left_over: float
    classes: tuple[tuple[str, ...], ...]
    why: str


def inclusion(found: Evidence) -> dict[str, float]:
    """Probability that an effect is at work, alone or in a pair, by id.

    Parameters
    ----------
    found : Evidence
        Outcome of the weighing.

    Returns
    -------
    dict
        Id to probability, largest first.
    """
    out = dict.fromkeys(found.spans, 0.0)
    for name, p in found.probability.items():
        if name not in (prior.NONE, prior.UNKNOWN):
            for i in name.split("+"):
                out[i] += p
    return dict(sorted(out.items(), key=lambda kv: -kv[1]))


def alike(found: Evidence, name: str) -> tuple[str, ...]:
    """Single effects that explain what an explanation explains, within noise and evidence, itself left out."""
    state = found.states[0]
    best = fitting.fit(found, name)
    s = state.white(best.signature)
    forms = [state.forms[i] for i in best.ids]
    form = forms[0] if len(forms) == 1 else None
    limit = found.log_bayes(name) - NEAR
    return tuple(
        i for i, span in found.spans.items()
        if i not in best.ids and look.distance(state, s, span, form) < look.ALIKE and found.log_bayes(i) > limit
    )  # fmt: skip


def decide(found: Evidence, p_value: float) -> Decision:
    """Decide.

    Parameters
    ----------
    found : Evidence
        Outcome of the weighing.
    p_value : float
        Of the gate [1].

    Returns
    -------
    Decision
        What is said.
    """
    P = found.probability
    listed = {k: v for k, v in P.items() if k not in (prior.NONE, prior.UNKNOWN)}
    if not listed:
        return Decision("insufficient", (), prior.NONE, 1.0, -np.inf, (), "no effect can be seen in these readings")
    leading = max(listed, key=lambda k: listed[k])
    if p_value > GATE:
        why = f"nulls of the same plan look as much like a cause in {p_value:.0%} of draws"
        word = "none" if p_value > 5.0 * GATE or P[prior.NONE] > 0.5 else "insufficient"
        return Decision(word, (), prior.NONE, P[prior.NONE], -np.inf, (), why)
    if P[prior.NONE] > 0.5:
        return Decision(
            "none", (), prior.NONE, P[prior.NONE], -np.inf, (), "nothing explains the readings better than the noise"
        )
    rest = fitting.left_over(found, leading)
    if P[prior.UNKNOWN] > 0.5 or rest > max(LEFT_OVER, SMALL * found.log_bayes(leading)):
        why = "a smooth mismatch remains when the best listed effect is taken away"
        if P[prior.UNKNOWN] > 0.5:
            why = "a smooth effect that is not in the library explains the readings better than any that is"
        return Decision("unknown", (), leading, max(P[prior.UNKNOWN], 1.0 - listed[leading]), rest, (), why)
    share = inclusion(found)
    if "+" in leading and not _twins(leading.split("+")):
        leading, share = _earned(found, leading, share, rest)
    weight = prior.prior_weights(found.problem, leading.split("+"))
    expected = min(weight.values()) > 1.0
    needed = PROVEN if min(weight.values()) < 1.0 else EXPECTED if expected else ENOUGH
    if found.log_bayes(leading) < needed:
        why = "the best explanation is not much better than none"
        return Decision("insufficient", (), leading, listed[leading], rest, (), why)
    if not expected and found.log_bayes(leading) < PROVEN and not _foretells(found, leading):
        why = "the best explanation does not foretell what it has not seen"
        return Decision("insufficient", (), leading, listed[leading], rest, (), why)
    if needed == PROVEN and "+" not in leading and _leaves_its_range(found, leading):
        why = f"{leading}, which is on, would have to leave its range: its law is off, not its parameter"
        return Decision("unknown", (), leading, listed[leading], rest, (), why)
    if _twins(leading.split("+")):
        why = "two instruments with the same fault at once: one cause that is not in the library is likelier"
        return Decision("unknown", (), leading, listed.get(leading, 0.0), rest, (), why)
    in_pair = "+" in leading and sum(v for k, v in listed.items() if "+" in k) > 0.5
    sure = tuple(i for i, p in share.items() if p >= SURE)
    if len(sure) > 1:
        return _named(found, sure, min(share[i] for i in sure), rest)
    if sure and not in_pair:
        group = _class(found, sure[0], share)
        beside = tuple(i for i in inclusion(found) if _together(P, sure[0], i) >= PARTNER and i not in group)
        if len(group) <= 1 and not beside:
            return _named(found, sure, share[sure[0]], rest)
        if len(group) <= 1:
            why = f"{sure[0]} is at work; whether another effect is, too, is left open"
            return Decision("class", (*sure, *beside[: MOST - 1]), leading, share[sure[0]], rest, (), why)
    if in_pair:
        return _pair(found, leading, share, rest)
    group = _class(found, leading.split("+")[0], share)
    total = _mass(found, group)
    if len(group) > 1 and total >= SURE:
        return Decision("class", group, leading, total, rest, (group,), "these look alike in this plan")
    if total >= SURE:
        return _named(found, group, total, rest)
    some = tuple(share)
    groups = (group,) if len(group) > 1 else ()
    for n in range(2, MOST + 1):
        total = _mass(found, some[:n])
        if total >= SURE:
            return Decision("class", some[:n], leading, total, rest, groups, "the readings leave these open")
    why = "several explanations are left that are not alike"
    return Decision("insufficient", (), leading, listed[leading], rest, groups, why)


def _together(probability: Mapping[str, float], a: str, b: str) -> float:
    """Probability that two effects are at work."""
    return probability.get(f"{a}+{b}", 0.0) + probability.get(f"{b}+{a}", 0.0)


def _mass(found: Evidence, group: Sequence[str]) -> float:
    """Probability that at least one of some effects is at work."""
    return sum(v for k, v in found.probability.items() if set(k.split("+")) & set(group))


def _foretells(found: Evidence, leading: str) -> bool:
    """Whether an explanation brings left-out blocks nearer than calibration alone does, along some variable.

    What does not change along a variable is learnt from the other lines of it without any cause.
    """
    problem = found.problem
    u = problem.u[problem.free]

    def error(name: str, split: tuple[str, NDArray[np.intp]]) -> float:
        d = (problem.y - blocks.held_out(found, name, split)[1])[problem.free] / u
        return float(np.sqrt(np.mean(d**2)))

    return any(error(leading, s) < FORETELLS * error(prior.NONE, s) for s in blocks.partitions(problem))


def _earned(found: Evidence, pair: str, share: dict[str, float], rest: float) -> tuple[str, dict[str, float]]:
    """Leading explanation without the effect that adds too little to the other one, and the probabilities to match."""
    ids = pair.split("+")
    weight = prior.prior_weights(found.problem, ids)
    for other, one in (ids, ids[::-1]):
        price = PROVEN if weight[other] < 1.0 else EARNED
        adds = found.log_bayes(pair) - found.log_bayes(one)
        # beside the thousands of a slip every rest is small: what is named next to it must explain its own
        vague = one == "unit_slip" and rest > max(LEFT_OVER, SMALL * adds)
        if (adds < price or vague) and share[one] >= share[other]:
            return one, {i: (0.0 if i == other else p) for i, p in share.items()}
    return pair, share


def _leaves_its_range(found: Evidence, leading: str) -> bool:
    """Whether physics that is on explains the readings best at the end of the range of a parameter, not as it is on."""
    on = {e.id: e for e in found.problem.baseline}
    best = fitting.fit(found, leading).settings[0]
    for p in effects.catalogue()[leading].parameters:
        value = best.get(p.name)
        if value is not None and value not in (getattr(on[leading], p.name), p.off) and not p.low < value < p.high:
            return True
    return False


def _twins(ids: Sequence[str]) -> bool:
    """Whether two instruments are said to have the same fault: offsets that stay or creep, or gains."""
    faults = [("zero" if i.endswith("_drift") else i.partition("_")[2]) for i in ids]
    return len(ids) > 1 and len(set(faults)) == 1 and all(effects.catalogue()[i].kind == "stand" for i in ids)


def _class(found: Evidence, first: str, share: dict[str, float]) -> tuple[str, ...]:
    others = [i for i in alike(found, first) if found.probability[i] > 0.02 * found.probability[first]]
    return (first, *sorted(others, key=lambda i: -share[i]))


def _pair(found: Evidence, leading: str, share: dict[str, float], rest: float) -> Decision:
    """Two effects at work: name those that are sure, and the look-alikes of the other."""
    ids = list(leading.split("+")) if "+" in leading else [leading]
    sure = [i for i in ids if share[i] >= SURE]
    unsure = [i for i in ids if i not in sure]
    pairs = {k: v for k, v in found.probability.items() if "+" in k and (not sure or set(k.split("+")) & set(sure))}
    total = sum(pairs.values())
    members: list[str] = list(sure)
    for _ in unsure:
        partner = {j: 0.0 for j in found.spans if j not in sure}
        for k, v in pairs.items():
            for j in set(k.split("+")) & set(partner):
                partner[j] += v
        near, mass = [], 0.0
        for j in sorted(partner, key=lambda j: -partner[j]):
            near.append(j)
            mass += partner[j]
            if mass >= SURE * total:
                break
        members += [j for j in near if j not in members][:5]
    if not unsure:
        return _named(found, tuple(sure), min(share[i] for i in sure), rest)
    if len(sure) == len(ids) - 1 and len(members) <= 5:
        return Decision("class", tuple(members), leading, total, rest, (tuple(m for m in members if m not in sure),),
                        "two effects are at work; one of them has look-alikes")  # fmt: skip
    return Decision(
        "insufficient", (), leading, found.probability[leading], rest, (), "two effects or more, not told apart"
    )


def _named(found: Evidence, ids: tuple[str, ...], probability: float, rest: float) -> Decision:
    stand = all(effects.catalogue()[i].kind == "stand" for i in ids)
    leading = "+".join(i for i in found.spans if i in ids)
    why = "nearly all of the probability is on it" if len(ids) == 1 else "nearly all of the probability is on both"
    return Decision("sensor" if stand else "named", ids, leading, probability, rest, (), why)

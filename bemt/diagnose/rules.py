"""Rules of the verdict, in the order of caution: the first that holds answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt import effects
from bemt.diagnose import blocks
from bemt.diagnose import fit as fitting
from bemt.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.diagnose.suggest import LEVEL
from bemt.diagnose.thresholds import (
    BESIDE,
    END,
    ENOUGH,
    GATE,
    LARGEST,
    LEAST,
    LEFT_OVER,
    NAMED,
    PREDICTS,
    PROVEN,
    ROUGH,
    SMALL,
    SURE,
    VAGUE,
)
from bemt.diagnose.verdict import Asked, Decision, holds_off, levels_only, mass, twins, unsettled

__all__ = ["BESIDE_IT", "RULES", "Rule", "decide"]

BESIDE_IT = "one is sure, another may be there"
"""Rule after which the second cause may as well be absent."""


@dataclass(frozen=True)
class Rule:
    """One row of the table.

    Attributes
    ----------
    name : str
        What it asks.
    holds : callable
        Whether it applies.
    answer : callable
        What is said then.
    threshold : str
        Names of the numbers it asks with.
    source : str
        Where it comes from.
    """

    name: str
    holds: Callable[[Asked], bool]
    answer: Callable[[Asked], Decision]
    threshold: str
    source: str


def decide(asked: Asked) -> Decision:
    """Decide."""
    for rule in RULES:
        if rule.holds(asked):
            return replace(rule.answer(asked), rule=rule.name)
    raise AssertionError("the last rule always holds")


def _leaves_its_range(a: Asked) -> bool:
    """Whether physics that is on explains the readings best at the end of the range of a parameter, not as it is on."""
    (name,) = a.leading
    on = {e.id: e for e in a.found.problem.baseline}
    best = fitting.fit(a.found, a.leading).settings[0]
    for p in effects.catalogue()[name].parameters:
        value = best.get(p.name)
        own = getattr(on.get(name), p.name, p.off)  # the case's own duct is on and no effect
        if value is not None and value not in (own, p.off) and not p.low < value < p.high:
            return True
    return False


def _predicts(a: Asked) -> bool:
    """Whether an explanation brings left-out blocks nearer than calibration alone does, along some variable.

    What does not change along a variable is learnt from the other lines of it without any cause.
    """
    problem = a.found.problem
    u = problem.u[problem.free]

    def error(what: Explanation, split: tuple[str, NDArray[np.intp]]) -> float:
        d = (problem.y - blocks.held_out(a.found, what, split)[1])[problem.free] / u
        return float(np.sqrt(np.mean(d**2)))

    return any(error(a.leading, s) < PREDICTS * error(NONE, s) for s in blocks.partitions(problem))


def at_end(name: str, told: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether the size of an effect, or the first number of one without a size, is pinned to an end of its range."""
    cls = effects.catalogue()[name]
    numbers = [p for p in cls.parameters if p.name in told and p.name not in cls.discrete and p.steps > 0]
    sizes = [p for p in numbers if p.off is not None] or numbers[:1]
    for p in sizes:
        near = END * (p.high - p.low)
        if told[p.name]["high"] - told[p.name]["low"] > 0.5 * (p.high - p.low):
            continue  # the readings do not say where it is
        if p.off is not None and told[p.name]["low"] <= p.off <= told[p.name]["high"]:
            continue  # nor whether it is there
        ends = [e for e in (p.low, p.high) if e != p.off]
        if any(abs(float(told[p.name]["value"]) - e) < near for e in ends):
            return True
    return False


def _sizes(name: str, told: Mapping[str, Mapping[str, Any]]) -> int:
    return sum(p.off is not None and p.name in told for p in effects.catalogue()[name].parameters)


def _pair(a: Asked) -> Decision:
    """Two effects at work: a set for each cause; names where the sets have one member."""
    known = a.known_sets
    total = sum(v for k, v in a.P.items() if k.pair)
    inside = sum(a.P.get(Explanation.of(i, j), 0.0) for i in known[0] for j in known[-1])
    members = tuple(dict.fromkeys(i for s in known for i in s))
    if len(members) <= LARGEST and inside >= SURE * total:
        open_sets = tuple(s for s in known if len(s) > 1)
        words = ("two effects are present; one of them has look-alikes" if a.sure
                 else "two effects are present, each with look-alikes")  # fmt: skip
        why = words if open_sets else "two effects are present, most likely these, but not for sure"
        return replace(a.says("class", why, members, inside, open_sets), sets=known)
    return a.says("insufficient", "two or more effects that cannot be distinguished")


def _nothing(a: Asked, why: str, verdict: str = "none") -> Decision:
    return a.says(verdict, why, leading=NONE)


def _by_chance(a: Asked) -> str:
    return f"a mismatch as large occurs by chance in {a.p_value:.0%} of simulated recordings without a cause"


def _too_little(a: Asked) -> str:
    needed = f"{a.needed:g} needed" + (", as no reference shows this rotor" if a.real else "")
    return f"the best explanation is not much better than none (ln odds {a.odds:.1f}; {needed})"


def _left(a: Asked) -> Decision:
    return a.says("unknown", "a smooth residual is left after the best listed effect",
                  probability=max(a.P[UNKNOWN], 1.0 - a.P[a.first]), leading=a.first)  # fmt: skip


RULES: tuple[Rule, ...] = (
    Rule(
        "no effect can be seen",
        lambda a: not a.first,
        lambda a: a.says("insufficient", "no effect is visible in these readings", probability=1.0, leading=NONE),
        "",
        "by definition",
    ),
    Rule(
        "nulls look like it",
        lambda a: (
            a.p_value > GATE
            and (a.P[NONE] > 0.5 or (a.p_value > 5.0 * GATE and a.level < LEVEL) or (not a.alone and a.likeliest_none))
        ),
        lambda a: _nothing(a, _by_chance(a)),
        "GATE, LEVEL",
        "DIAGNOSIS 2.3: p-value of the whole chain, 1 in 100; a reference has the level in it",
    ),
    Rule(
        "nulls nearly look like it",
        lambda a: a.p_value > GATE,
        lambda a: _nothing(a, _by_chance(a), "insufficient"),
        "GATE",
        "the same, between 1 and 5 in 100, or where all loads are far off the case",
    ),
    Rule(
        "nothing is likelier than anything",
        lambda a: a.P[NONE] > 0.5,
        lambda a: _nothing(a, "nothing explains the readings better than the noise"),
        "0.5",
        "posterior odds",
    ),
    Rule(
        "unknown, and not much better than nothing",
        lambda a: a.P[UNKNOWN] > 0.5 and a.vague < (ENOUGH if a.real else LEAST),
        lambda a: a.says("insufficient", "a smooth effect that is not in the library fits best, but not by enough"),
        "0.5, ENOUGH, LEAST",
        "as of a name; the first of a real rotor that no reference shows: stands differed from cases of a label by 5 "
        "and were called unknown",
    ),
    Rule(
        "unknown is likelier than all",
        lambda a: a.P[UNKNOWN] > 0.5,
        lambda a: a.says(
            "unknown",
            "a smooth effect that is not in the library explains the readings better than any listed effect",
            probability=max(a.P[UNKNOWN], 1.0 - a.P[a.first]),
            leading=a.first,
        ),
        "0.5",
        "DIAGNOSIS 2.6: the second rival",
    ),
    Rule(
        "a smooth rest is left",
        lambda a: (
            a.rest > max(LEFT_OVER, (1.0 if a.factor else SMALL) * a.found.log_bayes(a.first))
            and a.rest + a.found.log_bayes(a.first) >= ENOUGH
        ),
        _left,
        "LEFT_OVER, SMALL, ENOUGH",
        "declared; the same rival beside the best effect, as sure as a name has to be; a real rotor leaves one beside "
        "a proven slip of a unit, too",
    ),
    Rule(
        "not much better than nothing",
        lambda a: a.odds < a.needed,
        lambda a: a.says("insufficient", _too_little(a)),
        "ENOUGH, LEAST, EXPECTED, PROVEN",
        "declared: 8 nats are 4 sigma; 5 where no error of the solver looks like it (in a proof these were all at "
        "work); of a real rotor that no reference shows, 8 to 16 named what was not there",
    ),
    Rule(
        "does not predict",
        lambda a: not a.expected and a.odds < PROVEN and a.vague > VAGUE and not _predicts(a),
        lambda a: a.says("insufficient", "the best explanation does not predict held-out readings"),
        "PROVEN, VAGUE, PREDICTS",
        "declared; left-out blocks, DIAGNOSIS 2.9; in any case it cost right names (7)",
    ),
    Rule(
        "on, and out of its range",
        lambda a: a.on and not a.leading.pair and _leaves_its_range(a),
        lambda a: a.says(
            "unknown", f"{a.leading} is in the model already and would have to leave its range, so its law does not fit"
        ),
        "range of the parameter",
        "declared with the effect",
    ),
    Rule(
        "twin faults",
        lambda a: twins(a.leading),
        lambda a: a.says(
            "unknown", "two instruments with the same fault at once; one cause outside the library is more likely"
        ),
        "",
        "declared: two independent faults of one kind are rare",
    ),
    Rule(
        "two levels",
        lambda a: levels_only(a.leading),
        lambda a: a.says(
            "insufficient",
            "thrust and torque are off by two different factors at all points: two faults at once, or a rotor other "
            "than that of the case or the reference",
        ),
        "",
        "declared: two shares fit any two levels; density moves both alike, one gain moves one",
    ),
    Rule(
        "unknown is nearly as likely",
        lambda a: a.unlisted > BESIDE * mass(a.found, (*a.group, *a.leading, *a.few)),
        lambda a: a.says("insufficient", "an effect that is not in the library explains the readings nearly as well"),
        "BESIDE",
        "DIAGNOSIS 7: lost no right name and stopped the wrong ones",
    ),
    Rule(
        "far rougher than stated",
        lambda a: a.roughness > ROUGH and a.alone,
        lambda a: a.says(
            "insufficient",
            f"the readings scatter {a.roughness:g} times as much as the recording states; no effect explains that",
        ),
        "ROUGH",
        "declared: end of the prior; hysteresis and resonance show so, and beside a reference they would be in both",
    ),
    Rule(
        "may as well be absent",
        lambda a: not a.leading.pair and len(a.group) <= 1 and holds_off(*next(iter(a.parameters.items()))),
        lambda a: a.says("insufficient", f"{a.leading} fits best, but the interval of its size includes zero"),
        "90 % interval",
        "DIAGNOSIS 7: 4 of 5 wrong names, 0 of 42 right ones",
    ),
    Rule(
        "a wrong unit, but which",
        lambda a: not a.leading.pair and len(a.group) <= 1 and unsettled(*next(iter(a.parameters.items()))),
        lambda a: a.says(
            "insufficient",
            "a wrong unit of the airspeed fits best, but the readings do not say which one; oblique inflow looks alike",
        ),
        "SETTLED",
        "declared after a proof: a slip of the airspeed by 3.3 or 3.6 was wind from the side",
    ),
    Rule(
        "another blade, or anything that scales all loads",
        lambda a: a.another_blade and len(a.group) <= 1,
        lambda a: a.says(
            "insufficient",
            f"all loads are far off; {a.leading} would explain that, but density, speed of rotation or "
            "diameter nearly as well",
        ),
        "ANOTHER",
        "declared: real recordings at another density than the case's were named section",
    ),
    Rule(
        "at the end of its range",
        lambda a: any(at_end(i, told) and (a.leading.pair or _sizes(i, told) > 1) for i, told in a.parameters.items()),
        lambda a: a.says(
            "insufficient", f"{' and '.join(a.leading)}: fits only with a parameter at the end of its physical range"
        ),
        "END",
        "declared: where one number cannot go further, another makes up for something else",
    ),
    Rule(
        "on already, and no reference",
        lambda a: a.on and a.alone,
        lambda a: a.says(
            "insufficient",
            f"{a.leading} fits best, but is in the model already; without a reference an error of its law looks alike",
        ),
        "",
        "declared after a proof named the law of a duct, and of stall delay, where only the solver was another",
    ),
    Rule(
        "two in the air, and no reference",
        lambda a: a.real and a.leading.pair and all(effects.catalogue()[i].kind == "air" for i in a.leading),
        lambda a: a.says(
            "insufficient",
            f"{' and '.join(a.leading)} together fit best; without a reference run the model's own error on this rotor "
            "looks alike",
        ),
        "",
        "declared: the label case of a propeller without a cause was named oblique inflow and untwist (0.99)",
    ),
    Rule(
        "several are sure",
        lambda a: len(a.sure) > 1,
        lambda a: a.names(a.sure, min(a.share[i] for i in a.sure)),
        "SURE, BOTH",
        "declared; of two each must be surer, so that both are",
    ),
    Rule(
        "one is sure",
        lambda a: bool(a.sure) and not a.paired and len(a.group) <= 1 and not a.beside and len(a.likely) <= 1,
        lambda a: a.names(a.sure, a.share[a.sure[0]]),
        "NAMED, PARTNER",
        "declared after a proof: names below it were wrong in four of ten",
    ),
    Rule(
        "one is nearly sure",
        lambda a: bool(a.sure) and not a.paired and len(a.group) <= 1 and not a.beside,
        lambda a: a.says(
            "class", f"{a.leading} is likely, but not sure enough to be named alone", a.likely, mass(a.found, a.likely)
        ),
        "SURE, NAMED, MOST",
        "the same",
    ),
    Rule(
        BESIDE_IT,
        lambda a: (
            not a.paired
            and (len(a.group) <= 1 if a.sure else bool(a.beside) and not a.on and mass(a.found, a.group) >= SURE)
        ),
        lambda a: replace(
            a.says(
                "class",
                f"{' or '.join(a.group)} is present; whether another effect is also present is left open",
                (*a.group, *a.beside),
                mass(a.found, a.group),
            ),
            sets=(a.group, a.beside),
        ),
        "SURE, PARTNER, LIKE, LARGEST",
        "declared",
    ),
    Rule("two at work", lambda a: a.paired, _pair, "SURE", "declared"),
    Rule(
        "on already, among others",
        lambda a: a.on and not a.sure,
        lambda a: a.says(
            "insufficient",
            f"{a.leading} fits best, but is in the model already: its law may be off for this blade, or another cause "
            "looks similar",
        ),
        "PRESENT, SURE",
        "declared: what is on is a cause only where nothing else is left",
    ),
    Rule(
        "look-alikes",
        lambda a: len(a.group) > 1 and mass(a.found, a.group) >= SURE,
        lambda a: replace(
            a.says(
                "class",
                "these look alike in this plan" + ("" if a.wide == a.group else ", or are not much less likely"),
                a.wide,
                mass(a.found, a.wide),
                (a.group,),
            ),
            sets=(a.wide,),
        ),
        "SURE, NEAR, ALIKE, NAMED, PARTNER",
        "DIAGNOSIS 2.7: distance below 3 sigma",
    ),
    Rule(
        "sure with its pairs",
        lambda a: mass(a.found, a.group) >= NAMED,
        lambda a: a.names(a.group, mass(a.found, a.group)),
        "NAMED",
        "declared",
    ),
    Rule(
        "a few are left",
        lambda a: bool(a.few),
        lambda a: a.says(
            "class",
            "the readings leave these open",
            a.few,
            mass(a.found, a.few),
            (a.group,) if len(a.group) > 1 else (),
        ),
        "SURE, MOST",
        "declared",
    ),
    Rule(
        "many are left",
        lambda a: True,
        lambda a: a.says(
            "insufficient",
            "several different explanations are possible",
            classes=(a.group,) if len(a.group) > 1 else (),
        ),
        "",
        "the rest",
    ),
)

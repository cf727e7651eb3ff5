"""Rules of the verdict in one ordered list: the first that holds answers, the last ones see that and may revise it.

Nothing alters a verdict after the list. The docstring of a rule says where it comes from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.judge.diagnose import blocks, ratio_check, wrong_rotor_check
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import rule as ruling
from bemt.judge.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.diagnose.revisions import REVISIONS
from bemt.judge.diagnose.rule import Rule, appended
from bemt.judge.diagnose.suggest import LEVEL
from bemt.judge.diagnose.thresholds import (
    BESIDE,
    END,
    ENOUGH,
    EXACT,
    GATE,
    LARGEST,
    LEAST,
    LEFT_OVER,
    NAMED,
    NEAR,
    NEARLY,
    PARTNER,
    PREDICTS,
    PROVEN,
    ROUGH,
    SMALL,
    SURE,
    VAGUE,
)
from bemt.judge.diagnose.verdict import (
    BESIDE_IT,
    Decision,
    VerdictQuery,
    interval_includes_off,
    levels_only,
    mass,
    rough,
    twins,
    unsettled,
)
from bemt.physics import effects
from bemt.physics.effects.base import FORM

MOTOR = "motor"
"""Another motor, controller or setting, as the scaling laws name it: no effect of the catalogue describes it."""

RULES: list[Rule] = []
"""The rules, in the order in which they are asked: cautious ones first, and at the end those that revise."""
_rule = appended(RULES)


def _leaves_its_range(a: VerdictQuery) -> bool:
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


# Range of a share over what it is at most, within which it is the same everywhere.
_SAME = 0.2


def _predicts(a: VerdictQuery) -> bool:
    """Whether an explanation brings left-out blocks nearer than calibration alone does, along some variable.

    What does not change along a variable is learnt from the other lines of it without any cause.
    """
    problem = a.found.problem
    u = problem.u[problem.free]

    def error(what: Explanation, split: tuple[str, NDArray[np.intp]]) -> float:
        d = (problem.y - blocks.held_out(a.found, what, split)[1])[problem.free] / u
        return float(np.sqrt(np.mean(d**2)))

    return any(error(a.leading, s) < PREDICTS * error(NONE, s) for s in blocks.partitions(problem))


def _level(a: VerdictQuery) -> bool:
    """Whether the leading explanation changes each channel by the same share everywhere, to a fifth of that share."""
    problem = a.found.problem
    seen = problem.free & (problem.centre != 0.0)
    share = fitting.fit(a.found, a.leading).signature[seen] / problem.centre[seen]
    of = problem.channel[seen]
    largest = float(np.max(np.abs(share), initial=0.0))
    return all(np.ptp(share[of == c]) <= _SAME * largest for c in np.unique(of))


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


def _pair(a: VerdictQuery) -> Decision:
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


def _nothing(a: VerdictQuery, why: str, verdict: str = "none") -> Decision:
    return a.says(verdict, why, leading=NONE)


def _by_chance(a: VerdictQuery) -> str:
    return f"a mismatch as large occurs by chance in {a.p_value:.0%} of simulated recordings without a cause"


def _too_little(a: VerdictQuery) -> str:
    needed = f"{a.needed:g} needed" + (", as no reference shows this rotor" if a.real else "")
    return f"the best explanation is not much better than none (ln odds {a.odds:.1f}; {needed})"


def _left(a: VerdictQuery) -> Decision:
    return a.says("unknown", "a smooth residual is left after the best listed effect",
                  probability=max(a.P[UNKNOWN], 1.0 - a.P[a.first]), leading=a.first)  # fmt: skip


@_rule("no effect can be seen")
def _no_effect_can_be_seen(a: VerdictQuery) -> Decision | None:
    """By definition."""
    if not a.first:
        return a.says("insufficient", "no effect is visible in these readings", probability=1.0, leading=NONE)
    return None


@_rule("an exact relation in the file", "EXACT")
def _exact_relation(a: VerdictQuery) -> Decision | None:
    """By definition: power is torque times speed, two counters of one shaft agree, thrust of a rotor pulls one way."""
    for name, finding in wrong_rotor_check.exact_faults(a.found.problem):
        what = Explanation.of(name)
        if name in a.found.spans and a.found.log_bayes(what) > -NEAR:
            odds = EXACT * a.P[what] / max(1.0 - a.P[what], 1e-12)
            if odds > 1.0:
                chance = odds / (1.0 + odds)
                said = a.says("sensor", f"{finding.evidence}, by definition", (name,), chance, leading=what)
                return replace(said, sets=((name,),))
    return None


@_rule("as large a mismatch occurs without a cause", "GATE, LEVEL")
def _nulls_look_like_it(a: VerdictQuery) -> Decision | None:
    """DIAGNOSIS 2.3: p-value of the whole chain, 1 in 100; a reference has the level in it.

    Of two recordings without a case a load that clearly changed is not said to be none.
    """
    small = (a.p_value > NEARLY * GATE and a.level < LEVEL) or (not a.alone and a.likeliest_none)
    moved = a.pair is not None and ratio_check.clear_changes(a.pair)
    if a.p_value > a.gate and (a.P[NONE] > 0.5 or (small and not moved)):
        return _nothing(a, _by_chance(a))
    return None


@_rule("nearly as large a mismatch occurs without a cause", "GATE")
def _nulls_nearly_look_like_it(a: VerdictQuery) -> Decision | None:
    """The same, between 1 and 5 in 100, or where all loads are far off the case."""
    if a.p_value > a.gate:
        return _nothing(a, _by_chance(a), "insufficient")
    return None


@_rule("nothing is likelier than anything", "0.5")
def _nothing_is_likelier_than_anything(a: VerdictQuery) -> Decision | None:
    """Posterior odds."""
    if a.P[NONE] > 0.5:
        return _nothing(a, "nothing explains the readings better than the noise")
    return None


@_rule("a drive that changed smoothly", "PROVEN, NEAR, BESIDE")
def _drive_changed_smoothly(a: VerdictQuery) -> Decision | None:
    """By definition: beside a reference only supply, heat, motor and controller change the speed at a pulse width."""
    if a.alone or not a.drive_only or not a.P[UNKNOWN] > BESIDE * (1.0 - a.P[NONE]):
        return None
    if a.found.log_bayes(a.first) < max(PROVEN, a.vague - NEAR):
        return None
    chance = 1.0 - a.P[NONE]
    return a.says("class", "these look alike in the speed over pulse width", (*a.first, MOTOR), chance, leading=a.first)


@_rule("unknown, and not much better than nothing", "0.5, ENOUGH, LEAST")
def _unknown_and_not_much_better_than_nothing(a: VerdictQuery) -> Decision | None:
    """As of a name; the first of a real rotor that no reference shows: stands differed from cases of a label by 5 and
    were called unknown.
    """
    if a.P[UNKNOWN] > 0.5 and a.vague < (ENOUGH if a.real else LEAST):
        return a.says("insufficient", "a smooth effect that is not in the library fits best, but not by enough")
    return None


@_rule("unknown is likelier than all", "0.5")
def _unknown_is_likelier_than_all(a: VerdictQuery) -> Decision | None:
    """DIAGNOSIS 2.6: the second rival."""
    if a.P[UNKNOWN] > 0.5:
        return a.says(
            "unknown",
            "a smooth effect that is not in the library explains the readings better than any listed effect",
            probability=max(a.P[UNKNOWN], 1.0 - a.P[a.first]),
            leading=a.first,
        )
    return None


@_rule("a smooth residual remains", "LEFT_OVER, SMALL, ENOUGH")
def _a_smooth_rest_is_left(a: VerdictQuery) -> Decision | None:
    """Declared; the same rival beside the best effect, as sure as a name has to be; a real rotor leaves one beside a
    proven slip of a unit, too. Without a case a rest is rather the law's: what is behind by no more is not ruled out.
    """
    if (
        a.rest > max(LEFT_OVER, (1.0 if a.factor else SMALL) * a.found.log_bayes(a.first))
        and a.rest + a.found.log_bayes(a.first) >= ENOUGH
    ):
        if not a.found.problem.by_laws or a.P[UNKNOWN] > BESIDE or not all(map(rough, a.first)):
            return _left(a)
        least = a.found.log_bayes(a.first) - max(NEAR, a.rest)
        members = [i for i in a.found.spans if i in a.first or a.found.log_bayes(Explanation.of(i)) > least]
        if 1 < len(members) <= LARGEST:
            why = "these are near, and the best of them leaves a smooth residual"
            return replace(a.says("class", why, members, mass(a.found, members), leading=a.first), sets=())
    return None


@_rule("not much better than nothing", "ENOUGH, LEAST, EXPECTED, PROVEN")
def _not_much_better_than_nothing(a: VerdictQuery) -> Decision | None:
    """Declared: 8 nats are 4 sigma; 5 where no error of the solver looks like it (in a proof these were all at work);
    of a real rotor that no reference shows, 8 to 16 named what was not there.
    """
    if a.odds < a.needed:
        return a.says("insufficient", _too_little(a))
    return None


@_rule("does not predict", "PROVEN, VAGUE, PREDICTS")
def _does_not_predict(a: VerdictQuery) -> Decision | None:
    """Declared; left-out blocks, DIAGNOSIS 2.9; in any case it cost right names (7).

    Without a case, a share that is the same everywhere is learnt from any block as the session's gain: it is not asked.
    """
    level = a.found.problem.by_laws and _level(a)
    if not a.expected and a.odds < PROVEN and a.vague > VAGUE and not level and not _predicts(a):
        return a.says("insufficient", "the best explanation does not predict held-out readings")
    return None


@_rule("on, and out of its range", "range of the parameter")
def _on_and_out_of_its_range(a: VerdictQuery) -> Decision | None:
    """Declared with the effect."""
    if a.on and not a.leading.pair and _leaves_its_range(a):
        return a.says(
            "unknown", f"{a.leading} is in the model already and would have to leave its range, so its law does not fit"
        )
    return None


@_rule("twin faults")
def _twin_faults(a: VerdictQuery) -> Decision | None:
    """Declared: two independent faults of one kind are rare."""
    if twins(a.leading):
        return a.says(
            "unknown", "two instruments with the same fault at once; one cause outside the library is more likely"
        )
    return None


@_rule("two levels")
def _two_levels(a: VerdictQuery) -> Decision | None:
    """Declared: two shares fit any two levels; density moves both alike, one gain moves one."""
    if levels_only(a.leading):
        return a.says(
            "insufficient",
            "thrust and torque are off by two different factors at all points: two faults at once, or a rotor other "
            "than that of the case or the reference",
        )
    return None


@_rule("unknown is nearly as likely", "BESIDE")
def _unknown_is_nearly_as_likely(a: VerdictQuery) -> Decision | None:
    """DIAGNOSIS 7: lost no right name and stopped the wrong ones."""
    if a.unlisted > BESIDE * mass(a.found, (*a.group, *a.leading, *a.few)):
        return a.says("insufficient", "an effect that is not in the library explains the readings nearly as well")
    return None


@_rule("far rougher than stated", "ROUGH")
def _far_rougher_than_stated(a: VerdictQuery) -> Decision | None:
    """Declared: end of the prior; hysteresis and resonance show so, and beside a reference they would be in both."""
    if a.roughness > ROUGH and a.alone:
        return a.says(
            "insufficient",
            f"the readings scatter {a.roughness:g} times as much as the recording states; no effect explains that",
        )
    return None


@_rule("may as well be absent", "90 % interval")
def _may_as_well_be_absent(a: VerdictQuery) -> Decision | None:
    """DIAGNOSIS 7: 4 of 5 wrong names, 0 of 42 right ones."""
    if not a.leading.pair and len(a.group) <= 1 and interval_includes_off(*next(iter(a.parameters.items()))):
        return a.says("insufficient", f"{a.leading} fits best, but the interval of its size includes zero")
    return None


@_rule("a wrong unit, but which", "SETTLED")
def _a_wrong_unit_but_which(a: VerdictQuery) -> Decision | None:
    """Declared after a proof: a slip of the airspeed by 3.3 or 3.6 was wind from the side."""
    if not a.leading.pair and len(a.group) <= 1 and unsettled(*next(iter(a.parameters.items()))):
        return a.says(
            "insufficient",
            "a wrong unit of the airspeed fits best, but the readings do not say which one; oblique inflow looks alike",
        )
    return None


@_rule("a wrong unit of the airspeed, or the wind", "SMALL, NEAR")
def _a_wrong_unit_or_the_wind(a: VerdictQuery) -> Decision | None:
    """Declared after a proof: three winds at 56 to 66 deg were named a wrong unit of the airspeed and untwist.

    A unit is exact, and the law of a flow is off by a share of what it explains: what explains nearly as much is not
    ruled out. True slips were never explained by half as much.
    """
    slips = [i for i in a.leading if effects.catalogue()[i].fault == "unit"]
    if not slips or a.parameters[slips[0]]["channel"]["value"] != "airspeed_m_s":
        return None
    laws = {i: a.found.log_bayes(Explanation.of(i)) for i in a.found.spans if rough(i)}
    best = max(laws.values(), default=-np.inf)
    if best < (1.0 - SMALL) * a.odds:
        return None
    members = (*slips, *(i for i in laws if laws[i] > best - NEAR))[:LARGEST]
    why = "a wrong unit fits best, but physics whose law may be off explains nearly as much"
    return replace(a.says("class", why, members, mass(a.found, members)), sets=(members,))


@_rule("another blade, or anything that scales all loads", "ANOTHER")
def _another_blade_or_anything_that_scales_all_loads(a: VerdictQuery) -> Decision | None:
    """Declared: real recordings at another density than the case's were named section."""
    if a.another_blade and len(a.group) <= 1:
        return a.says(
            "insufficient",
            f"all loads are far off; {a.leading} would explain that, but density, speed of rotation or "
            "diameter nearly as well",
        )
    return None


@_rule("at the end of its range", "END, NAMED")
def _at_the_end_of_its_range(a: VerdictQuery) -> Decision | None:
    """Declared: where one number cannot go further, another makes up for something else.

    Among several that look alike under rough laws the number is as rough as they are. Of two that are each as sure as a
    name one may be at an end: something is there.
    """
    if a.found.problem.by_laws and len(a.group) > 1:
        return None
    ends = [i for i, told in a.parameters.items() if at_end(i, told) and (a.leading.pair or _sizes(i, told) > 1)]
    if not ends:
        return None
    if a.leading.pair and not a.on and min(a.share[i] for i in a.leading) >= NAMED:
        why = f"two effects are present; {' and '.join(ends)} at the end of its physical range may stand for another"
        return replace(a.says("class", why, tuple(a.leading), a.P[a.leading]), sets=tuple((i,) for i in a.leading))
    return a.says(
        "insufficient", f"{' and '.join(a.leading)}: fits only with a parameter at the end of its physical range"
    )


@_rule("on already, and no reference")
def _on_already_and_no_reference(a: VerdictQuery) -> Decision | None:
    """Declared after a proof named the law of a duct, and of stall delay, where only the solver was another."""
    if a.on and a.alone:
        return a.says(
            "insufficient",
            f"{a.leading} fits best, but is in the model already; without a reference an error of its law looks alike",
        )
    return None


@_rule("two in the air, and no reference", "BOTH")
def _two_in_the_air_and_no_reference(a: VerdictQuery) -> Decision | None:
    """Declared: the label case of a propeller without a cause was named oblique inflow and untwist (0.99).

    Of two laws without a case one that is in nearly all of the probability stays: what the other explains may be its
    error.
    """
    laws = a.found.problem.by_laws
    if not (a.real or laws) or not a.leading.pair or any(effects.catalogue()[i].kind != "air" for i in a.leading):
        return None
    if laws and a.sure:
        first = max(a.sure, key=lambda i: a.found.log_bayes(Explanation.of(i)))
        others = [k.without(first).ids for k in sorted(a.P, key=lambda k: -a.P[k]) if k.pair and first in k.ids]
        members = (first, *(i for ids in others for i in ids if a.share[i] >= PARTNER))[:LARGEST]
        why = f"{first} is present; the error of its law looks like a second effect"
        return replace(a.says("class", why, members, a.share[first]), sets=((first,), members[1:]))
    whose = "their laws" if laws else "the model on this rotor, without a reference run,"
    return a.says("insufficient", f"{' and '.join(a.leading)} together fit best; the error of {whose} looks alike")


@_rule("another propeller, or what changes this one", "FORM, LARGEST")
def _another_propeller_or_a_change(a: VerdictQuery) -> Decision | None:
    """Declared after two proofs named a duct so: two free shares fit what any change does whose law is off by half."""
    if tuple(a.leading) != ("propeller",) or a.found.problem.by_laws:
        return None
    least = (1.0 - max(FORM)) * a.odds
    laws = {i: v for i in a.found.spans if rough(i) and (v := a.found.log_bayes(Explanation.of(i))) > least}
    members = tuple(sorted(laws, key=lambda i: -laws[i]))[:LARGEST]
    if len(members) < 2:
        return None
    why = "two free shares fit whatever changes a rotor; these explain nearly as much by a law"
    return replace(a.says("class", why, members, mass(a.found, members)), sets=(members,))


@_rule("several are sure", "SURE, BOTH")
def _several_are_sure(a: VerdictQuery) -> Decision | None:
    """Declared; of two each must be surer, so that both are."""
    if len(a.sure) > 1:
        return a.names(a.sure, min(a.share[i] for i in a.sure))
    return None


@_rule("one is sure", "NAMED, PARTNER")
def _one_is_sure(a: VerdictQuery) -> Decision | None:
    """Declared after a proof: names below it were wrong in four of ten."""
    if bool(a.sure) and not a.paired and len(a.group) <= 1 and not a.beside and len(a.likely) <= 1:
        return a.names(a.sure, a.share[a.sure[0]])
    return None


@_rule("one is nearly sure", "SURE, NAMED, MOST")
def _one_is_nearly_sure(a: VerdictQuery) -> Decision | None:
    """The same."""
    if bool(a.sure) and not a.paired and len(a.group) <= 1 and not a.beside:
        return a.says(
            "class", f"{a.leading} is likely, but not sure enough to be named alone", a.likely, mass(a.found, a.likely)
        )
    return None


@_rule(BESIDE_IT, "SURE, PARTNER, LIKE, LARGEST")
def _one_is_sure_another_may_be_there(a: VerdictQuery) -> Decision | None:
    """Declared."""
    if not a.paired and (
        len(a.group) <= 1 if a.sure else bool(a.beside) and not a.on and mass(a.found, a.group) >= SURE
    ):
        rest = ("a second effect would explain more, by no more than this rotor may be off" if a.dropped
                else "whether another effect is also present is left open")  # fmt: skip
        why = f"{' or '.join(a.group)} is present; {rest}"
        said = a.says("class", why, (*a.group, *a.beside), mass(a.found, a.group))
        return replace(said, sets=(a.group, a.beside))
    return None


@_rule("two at work", "SURE")
def _two_at_work(a: VerdictQuery) -> Decision | None:
    """Declared."""
    if a.paired:
        return _pair(a)
    return None


@_rule("on already, among others", "PRESENT, SURE")
def _on_already_among_others(a: VerdictQuery) -> Decision | None:
    """Declared: what is on is a cause only where nothing else is left."""
    if a.on and not a.sure:
        return a.says(
            "insufficient",
            f"{a.leading} fits best, but is in the model already: its law may be off for this blade, or another cause "
            "looks similar",
        )
    return None


@_rule("look-alikes", "SURE, NEAR, ALIKE, NAMED, PARTNER")
def _look_alikes(a: VerdictQuery) -> Decision | None:
    """DIAGNOSIS 2.7: distance below 3 sigma."""
    if len(a.group) > 1 and mass(a.found, a.group) >= SURE:
        return replace(
            a.says(
                "class",
                "these look alike in this plan" + ("" if a.wide == a.group else ", or are not much less likely"),
                a.wide,
                mass(a.found, a.wide),
                (a.group,),
            ),
            sets=(a.wide,),
        )
    return None


@_rule("sure with its pairs", "NAMED")
def _sure_with_its_pairs(a: VerdictQuery) -> Decision | None:
    """Declared."""
    if mass(a.found, a.group) >= NAMED:
        return a.names(a.group, mass(a.found, a.group))
    return None


@_rule("a few are left", "SURE, MOST")
def _a_few_are_left(a: VerdictQuery) -> Decision | None:
    """Declared."""
    if bool(a.few):
        return a.says(
            "class",
            "the readings leave these open",
            a.few,
            mass(a.found, a.few),
            (a.group,) if len(a.group) > 1 else (),
        )
    return None


@_rule("many are left")
def _many_are_left(a: VerdictQuery) -> Decision | None:
    """The rest."""
    return a.says(
        "insufficient",
        "several different explanations are possible",
        classes=(a.group,) if len(a.group) > 1 else (),
    )


RULES += REVISIONS


def decide(query: VerdictQuery) -> Decision:
    """Go through the list."""
    return ruling.decide(query, RULES)

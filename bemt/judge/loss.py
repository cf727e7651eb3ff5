"""What is said is the answer of least expected loss: one posterior, one table of costs, no rule beside.

A cause is a set of effects. The answer is "none", a name (one or two causes), a class (one of these), "unknown" (none
of the library) or "insufficient". A loss is counted in units of one "insufficient" where there is a cause.  Decisions
of least expected loss: Berger 1985, Statistical Decision Theory and Bayesian Analysis, ch. 1 and 4 (not checked).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace

from bemt.base.action import Answered
from bemt.judge.explanation import DOUBT, NONE, UNKNOWN, Explanation
from bemt.physics import effects

CLAIMS = ("named", "sensor", "class")
"""Verdicts that give a cause."""


@dataclass(frozen=True)
class Costs:
    """The table: what a wrong answer costs, chosen on half of the concealed recordings and shown on the others."""

    wrong: float = 8.0  # A cause is given, and it is another one, none, or not in the library: work on a sound part
    half: float = 8.0 / 3.0  # One of two causes is given right, or one too many: the next run shows the rest
    phantom: float = 4.0  # "Something unknown" where nothing is wrong: a search without an end
    missed: float = 2.5  # "None" where there is a cause, or "unknown" where it is a listed one: nobody looks on
    silent: float = 1.0  # "Insufficient" where there is a cause: another run, the unit of the table
    timid: float = 0.7  # "Insufficient" where nothing is wrong: another run for nothing
    member: float = 0.12  # Each member of a class that is not a cause: one more thing to look at


COSTS = Costs()
SPREAD = "the spread of rotors and runs alone is likeliest"
"""Start of the reason where "none" is likeliest, and not sure."""
BESIDE = "whether another is, too, is left open"
"""End of the reason where one of two causes is sure."""
ON_ONE = "nearly all of the probability is on "
"""Start of the reason of a name that has no better one."""
SECOND = 0.1
"""Where loads and drive are measured apart, each with a prior of its own: odds that one of them changed over those,
where the other did; few pairs are of both (declared) [1]."""
# Likeliest explanations that are tried as a name, and most members of a class.
_NAMES, _MEMBERS = 6, 6
# Explanations below this are not counted; shares of a class from which its first member is in all of it, and may be
# alone.
_NOTHING, _NEARLY_ALL, _ALONE = 1e-5, 0.9, 0.1


@dataclass(frozen=True)
class Decision:
    """What is said, and why."""

    verdict: str  # none, named, class, sensor, unknown or insufficient
    effects: tuple[str, ...]  # Effects of the verdict; of a class all members
    leading: Explanation  # What is shown
    probability: float  # Of the verdict [1]
    why: str  # Reason, in words
    sets: tuple[tuple[str, ...], ...] = ()  # One set of effects per cause: one of each is at work
    beside: bool = False  # Whether the second of two sets may as well be empty
    loss: Mapping[str, float] = field(default_factory=dict)  # Least expected loss of each kind of answer [1]
    # Whose evidence it is: of the "model", of the "drive", of "both", or what the "files" say themselves
    by: str = "model"

    def reasoned_as(self, other: Decision) -> Decision:
        """The same, with the reason of another decision where both say the same."""
        same = (self.verdict, self.effects) == (other.verdict, other.effects)
        return replace(self, why=other.why) if same else self


class VerdictAnswer(Answered):
    """Answer with a verdict."""

    @property
    def verdict(self) -> str:
        """One of none, named, class, sensor, unknown, insufficient."""
        return str(self.document["verdict"])

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the verdict; for a class, all members."""
        return tuple(self.document["effects"])

    @property
    def probability(self) -> float | None:
        """How sure the verdict is, as the first line says it; None where nothing was weighed. [1]"""
        found: float | None = self.document.get("probability")
        return found


def expected(
    said: frozenset[str], named: bool, P: Mapping[Explanation, float], c: Costs = COSTS,
    still: frozenset[str] = frozenset(),
) -> float:  # fmt: skip
    """Expected loss of a name or of a class."""
    total = 0.0
    for truth, p in P.items():
        if truth.ids & still:
            total += p * (c.half if truth.ids <= said else c.wrong)
        elif truth.ids and not truth.smooth and (said == truth.ids if named else truth.ids <= said):
            total += p * c.member * (len(said) - len(truth.ids))
        else:
            total += p * (c.half if truth.ids & said else c.wrong)
    return total


def decide(P: Mapping[Explanation, float], costs: Costs = COSTS, still: frozenset[str] = frozenset()) -> Decision:
    """Answer of least expected loss; `still` are effects that move the readings where nothing is wrong.

    These are no cause: they stand in a class beside one at most.

    Examples
    --------
    >>> gain, zero = Explanation.of("thrust_gain"), Explanation.of("thrust_zero")
    >>> decide({gain: 0.97, NONE: 0.03}).verdict, decide({gain: 0.5, zero: 0.48, NONE: 0.02}).verdict
    ('sensor', 'class')
    >>> decide({NONE: 0.9, gain: 0.1}).verdict, decide({NONE: 0.5, gain: 0.5}).verdict
    ('none', 'insufficient')
    """
    none, unknown, doubt = (P.get(k, 0.0) for k in (NONE, UNKNOWN, DOUBT))
    listed = dict(sorted(((k, p) for k, p in P.items() if k.ids and p > _NOTHING), key=lambda kv: -kv[1]))
    verdict, said, least = _least({**listed, NONE: none, UNKNOWN: unknown, DOUBT: doubt}, costs, still)
    decision = Decision(verdict, said, next(iter(listed), NONE), 0.0, "", loss=least)
    if verdict == "named":
        what, known = Explanation.of(*said), effects.catalogue()
        stand = all(i in known and known[i].kind == "stand" for i in said)
        why = ON_ONE + ("it" if len(said) == 1 else "both")
        return replace(decision, verdict="sensor" if stand else verdict, leading=what, probability=P.get(what, 0.0),
                       why=why, sets=tuple((i,) for i in said))  # fmt: skip
    if verdict == "class":
        return _of_class(decision, {k: p for k, p in listed.items() if k.ids <= set(said)})
    if verdict == "none":
        return replace(decision, leading=NONE, probability=none, why="nothing explains the readings as well as noise")
    if verdict == "unknown":
        return replace(decision, probability=unknown, why="something smooth that is not in the library fits best")
    if doubt >= 0.5:
        return replace(decision, probability=doubt, by="files", why="rotor, unit or file is not what is stated")
    most = max(none, unknown, *listed.values(), 0.0)
    return replace(decision, probability=1.0 - most, why=_open(none, unknown, listed))


def _least(
    counted: Mapping[Explanation, float], c: Costs, still: frozenset[str]
) -> tuple[str, tuple[str, ...], dict[str, float]]:
    """Answer of least expected loss, and the least of each kind of answer."""
    none, unknown, doubt = (counted[k] for k in (NONE, UNKNOWN, DOUBT))
    listed = [k for k in counted if k.ids]
    moved = sum(counted[k] for k in listed if k.ids & still)
    cause, calm = sum(counted[k] for k in listed) - moved, none + moved
    answers: dict[tuple[str, tuple[str, ...]], float] = {
        ("none", ()): c.missed * (cause + unknown + doubt),
        ("unknown", ()): c.phantom * calm + c.missed * (cause + doubt),
        ("insufficient", ()): c.silent * (cause + unknown) + c.timid * calm,
    }
    for k in [k for k in listed if not k.ids & still][:_NAMES]:
        answers["named", tuple(k)] = expected(k.ids, True, counted, c, still)
    for pool in (listed, [k for k in listed if not k.pair]):
        members: tuple[str, ...] = ()
        for k in pool:
            members += tuple(i for i in k if i not in members)
            if len(members) > _MEMBERS:
                break
            if len(members) > 1 and not still.issuperset(members):
                answers["class", members] = expected(frozenset(members), False, counted, c, still)
    least: dict[str, float] = {}
    for (kind, _), v in answers.items():
        least[kind] = min(v, least.get(kind, v))
    return *min(answers, key=lambda k: answers[k]), least


def _of_class(decision: Decision, inside: Mapping[Explanation, float]) -> Decision:
    """Answer that is a class, with the probability of what lies in it."""
    surest, sets = _sets(decision.effects, inside)
    total, alone = sum(inside.values()), inside.get(Explanation.of(surest), 0.0)
    beside = len(sets) > 1 and alone > _ALONE * total
    why = "these readings do not tell them apart"
    if len(sets) > 1:
        why = f"{surest} is present; {BESIDE}" if beside else "two causes are present"
    return replace(decision, probability=total, why=why, sets=sets, beside=beside)


def _sets(said: tuple[str, ...], inside: Mapping[Explanation, float]) -> tuple[str, tuple[tuple[str, ...], ...]]:
    """Effect of the largest probability, and one set of effects per cause: that one if it is in nearly all of it."""
    share = {i: sum(p for k, p in inside.items() if i in k) for i in said}
    first = max(said, key=lambda i: share[i])
    rest = tuple(i for i in said if i != first)
    total, pairs = sum(inside.values()), sum(p for k, p in inside.items() if k.pair)
    # the others are likelier beside it than in its place
    sure = share[first] > _NEARLY_ALL * total and pairs > total - share[first]
    return first, ((first,), rest) if sure else (said,)


def ways(said: Collection[str], likeliest: Iterable[Explanation]) -> list[Explanation]:
    """Explanations that a class stands for, in the order given: two, then those with a member that is in none yet.

    >>> zero, both = Explanation.of("thrust_zero"), Explanation.of("air_density", "section")
    >>> [str(k) for k in ways(("thrust_zero", "air_density", "section"), [zero, NONE, both, Explanation.of("section")])]
    ['thrust_zero', 'section+air_density']
    """
    out: list[Explanation] = []
    seen: set[str] = set()
    for k in (*likeliest, *map(Explanation.of, said)):  # those that none of these has stand alone
        if k.ids and k.ids <= {*said} and not k.smooth and (not k.ids <= seen or (len(out) == 1 and k not in out)):
            out.append(k)
            seen |= k.ids
    return out


def _open(none: float, unknown: float, listed: Mapping[Explanation, float]) -> str:
    """Why nothing is said."""
    if none >= max(unknown, *listed.values(), 0.0):
        return f"{SPREAD} ({none:.0%}), but not sure enough"
    if unknown >= max(listed.values(), default=0.0):
        return f"something that is not in the library is likeliest ({unknown:.0%}), but not sure enough"
    return "several different explanations are possible"


def parts(
    P: Mapping[Explanation, float], Q: Mapping[Explanation, float]
) -> tuple[dict[Explanation, float], dict[Explanation, float]]:  # fmt: skip
    """What each of two posteriors of different parts is beside the other.

    >>> cause = Explanation.of("battery_sag")
    >>> loads, drive = parts({NONE: 0.9, UNKNOWN: 0.1}, {NONE: 0.2, cause: 0.8})
    >>> round(loads[NONE], 3), round(drive[cause], 3)
    (0.97, 0.784)
    """

    def beside(P: Mapping[Explanation, float], same: float) -> dict[Explanation, float]:
        out = {k: p if k == NONE else p * (same + SECOND * (1.0 - same)) for k, p in P.items()}
        total = sum(out.values())
        return {k: p / total for k, p in out.items()}

    return beside(P, Q.get(NONE, 0.0)), beside(Q, P.get(NONE, 0.0))


def joined(loads: Decision, drive: Decision, same: float, costs: Costs = COSTS) -> Decision:
    """Answer on both parts: causes of both where both have any, else of the one that has; ``same``: loads unchanged."""
    if loads.verdict in CLAIMS and drive.verdict in CLAIMS:
        verdict = "class" if "class" in (loads.verdict, drive.verdict) else "named"
        return replace(loads, verdict=verdict, effects=(*loads.effects, *drive.effects), by="both",
                       sets=(*loads.sets, *drive.sets), probability=min(loads.probability, drive.probability),
                       why=loads.why if loads.verdict == "class" else drive.why)  # fmt: skip
    if loads.verdict == "none" and drive.verdict != "none":
        return replace(drive, by="drive")
    # the drive's cause is half of an answer if a load changed as well
    if drive.verdict in CLAIMS and loads.verdict not in CLAIMS and costs.half * (1.0 - same) < costs.silent:
        return replace(drive, by="drive")
    return loads


def minutes(kind: str, points: int) -> float:
    """Time that a stand needs for a step [min]; declared, by experience with benches: a reference undoes the cause."""
    return {"run": 4.0, "reference": 15.0, "look": 10.0}[kind] + 0.2 * points


def checks_by_worth(P: Mapping[Explanation, float], again: float = math.inf) -> list[str]:
    """Causes in the order of checks that finds the one at fault soonest, by probability over time; "": another run.

    That order has the least expected time (Mitten 1960, J. Industrial Engineering 11:17; not checked). A run as before
    takes ``again`` minutes and tells a cause from none. What anyone at the stand would see, a second rotor or a duct,
    needs no check: whoever reads the answer knows it.

    >>> P = {Explanation.of("section"): 0.6, Explanation.of("propeller"): 0.1, Explanation.of("duct"): 0.2, NONE: 0.1}
    >>> checks_by_worth(P), checks_by_worth(P, 16.0)
    (['propeller', 'section'], ['propeller', '', 'section'])
    >>> checks_by_worth({Explanation.of("thrust_gain"): 0.77, Explanation.of("diameter"): 0.05, NONE: 0.18})
    ['thrust_gain', 'diameter']
    """
    known = effects.catalogue()
    names = {i for k in P for i in k.ids if i in known and known[i].check and not known[i].evident}
    odds = {i: (sum(p for k, p in P.items() if i in k.ids), known[i].check_minutes) for i in sorted(names)}
    if math.isfinite(again):
        odds[""] = P.get(NONE, 0.0), again
    worth = {i: p / time for i, (p, time) in odds.items()}
    return sorted(worth, key=lambda i: -worth[i])

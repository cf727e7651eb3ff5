"""The decision: none, a named effect, a class of look-alikes, the stand, something unknown, or not enough data.

The rules (:mod:`bemt.judge.diagnose.rules`) are asked in the order of caution; the first that holds answers.  Is there
a mismatch that nulls do not show?  Does an unknown smooth effect explain it better, or is something smooth left after
the best listed effect?  Which effects are in nearly all of the probability?  Are there look-alikes of these in this
plan, or a second effect that may be there, too?  Only then is a name given; with a few explanations left, these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.judge.diagnose import confusion as look
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import prior
from bemt.judge.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.diagnose.thresholds import (
    ANOTHER,
    BOTH,
    EARNED,
    ENOUGH,
    EXPECTED,
    GATE,
    IN_SET,
    LARGEST,
    LEAST,
    LEFT_OVER,
    LIKE,
    MOST,
    NAMED,
    NEAR,
    NEARLY,
    PARTNER,
    PROVEN,
    RARE,
    SETTLED,
    SMALL,
    SURE,
)
from bemt.physics import effects
from bemt.physics.effects.base import FORM, Effect

if TYPE_CHECKING:
    from bemt.judge.compare.recordings import RunChange
    from bemt.judge.diagnose.evidence import Evidence

BESIDE_IT = "one is sure, another may be there"
"""Rule after which the second cause may as well be absent."""
CLAIMS = ("named", "sensor", "class")
"""Verdicts that give a cause."""

_BALANCE = ("thrust_N", "torque_Nm")
# Faults of a cell that shift its reading: one stays, the other creeps.
_SHIFTS = ("zero", "drift")
# Faults of a cell that multiply its reading.
_SHARES = ("gain", "cross-talk")


@dataclass(frozen=True)
class Decision:
    """What is said, and why."""

    verdict: str  # none, named, class, sensor, unknown or insufficient
    effects: tuple[str, ...]  # Effects of the verdict; of a class all members
    leading: Explanation  # What is shown
    probability: float  # Of the verdict [1]
    left_over: float  # Logarithm of the odds of a smooth rest beside the leading explanation [1]
    classes: tuple[tuple[str, ...], ...]  # Effects that this plan cannot tell from the leading ones
    why: str  # Reason, in words
    rule: str = ""  # Name of the rule that decided
    sets: tuple[tuple[str, ...], ...] = ()  # One set of effects per cause: one of each is at work
    # Whose evidence it is: of the "model", of the "drive", of "both", or of the "ratios" to the reference
    by: str = "model"


@dataclass(eq=False)
class VerdictQuery:
    """What the rules ask of an outcome, each worked out when it is first asked."""

    found: Evidence  # Outcome of the weighing
    p_value: float  # Of the gate [1]
    drive: Decision | None = None  # On the speed over pulse width, where it was recorded
    # Gives the change from the reference, where there is one recording and one reference
    ratios: Callable[[], RunChange | None] | None = None
    pair: RunChange | None = None  # The two recordings themselves, where there is no case
    steps: list[Decision] = field(default_factory=list)  # Answers of the rules so far, the last one in force
    _refined: dict[Explanation, tuple[fitting.Fit, dict[str, dict[str, dict[str, Any]]]]] = field(default_factory=dict)

    @property
    def said(self) -> Decision | None:
        """Answer so far."""
        return self.steps[-1] if self.steps else None

    @property
    def answer(self) -> Decision:
        """The same, for rules that revise it."""
        return self.steps[-1]

    @property
    def of_loads(self) -> Decision:
        """Answer of the model alone, before drive and ratios."""
        return next(d for d in reversed(self.steps) if d.by == "model")

    @cached_property
    def change(self) -> RunChange | None:
        """Change from the reference."""
        return None if self.ratios is None else self.ratios()

    @property
    def of_label(self) -> bool:
        """Whether the case was made from a label. A blade that is better known speaks for itself, silent or not."""
        built = [p.as_built for p in self.found.problem.parts]
        return any(b is not None and b.prior.known_from == "label" for b in built)

    @property
    def load_moves(self) -> bool:
        """Whether the loads are likelier to change with time than not, by a cause that is named or by one left open."""

        def moves(ids: Iterable[str]) -> bool:
            return any("time_s" in effects.catalogue()[i].along and effects.catalogue()[i].kind == "air" for i in ids)

        own = self.of_loads
        if own.effects or own.verdict == "none":
            return moves(own.effects)
        listed = {k: p for k, p in self.P.items() if k}
        return sum(p for k, p in listed.items() if moves(k)) > 0.5 * sum(listed.values())

    @property
    def P(self) -> Mapping[Explanation, float]:
        """Probability of every explanation."""
        return self.found.probability

    @cached_property
    def first(self) -> Explanation:
        """Likeliest explanation that has effects; that of nothing where there is none."""
        return max((k for k in self.P if k), key=lambda k: self.P[k], default=NONE)

    @cached_property
    def rest(self) -> float:
        """Log odds of something smooth beside it; if the settings are too coarse, beside the best one between them."""
        if not self.first:
            return -np.inf
        rest = fitting.left_over(self.found, fitting.fit(self.found, self.first))
        return rest if rest <= LEFT_OVER else min(rest, fitting.left_over(self.found, self.refined(self.first)[0]))

    @cached_property
    def _kept(self) -> tuple[Explanation, dict[str, float]]:
        share = inclusion(self.found)
        if not self.first.pair or twins(self.first):
            return self.first, share
        leading, share = _earned(self.found, self.first, share, self.rest)
        idle = [i for i in leading if leading.pair and interval_includes_off(i, self._parameters(leading)[i])]
        if len(idle) == 1:
            leading, share = leading.without(idle[0]), {i: (0.0 if i in idle else p) for i, p in share.items()}
        return leading, share

    def _parameters(self, what: Explanation) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
        return self.refined(what)[1]

    def refined(self, what: Explanation) -> tuple[fitting.Fit, dict[str, dict[str, dict[str, Any]]]]:
        """An explanation at its best setting, and what its parameters may be."""
        if what not in self._refined:
            self._refined[what] = fitting.refined(self.found, fitting.fit(self.found, what))
        return self._refined[what]

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
        """What the parameters of the leading explanation may be."""
        return self._parameters(self.leading)

    @property
    def leading(self) -> Explanation:
        """The same without an effect that has not earned its place beside another one."""
        return self._kept[0]

    @cached_property
    def share(self) -> dict[str, float]:
        """Probability that each effect is at work, largest first; see :attr:`always_there`."""
        return {i: p / (self._doubt if self.always_there else 1.0) for i, p in self._kept[1].items()}

    @property
    def _doubt(self) -> float:
        """Probability that is left when nothing at all is as unlikely as that a rotor lacks what every rotor has."""
        return 1.0 - self.P[NONE] * (1.0 - 1.0 / prior.ALWAYS)

    @cached_property
    def always_there(self) -> bool:
        """Whether the cause is one effect that every rotor has and the case leaves out, surely beside all others."""
        lacks = set.intersection(*(set(p.missing) for p in self.found.problem.parts))
        one = bool(self.leading) and not self.leading.pair and set(self.leading) <= lacks
        return one and sum(self._kept[1][i] for i in self.leading) >= SURE * self._doubt

    @property
    def gate(self) -> float:
        """Largest p-value at which a mismatch counts; it need only nearly where the cause is there beforehand."""
        return GATE * (NEARLY if self.always_there else 1.0)

    @property
    def dropped(self) -> bool:
        """Whether two effects are likelier than one, but one of them has not earned its place."""
        return self.first.pair and not self.leading.pair

    @cached_property
    def odds(self) -> float:
        """Log odds of the leading explanation over nothing."""
        return self.found.log_bayes(self.leading)

    @cached_property
    def level(self) -> float:
        """Largest median of a load over what the case gives, less 1, either way [1]."""
        return max((abs(v) for v in self.found.problem.level.values()), default=0.0)

    @cached_property
    def another_blade(self) -> bool:
        """Whether another shape of the blade leads, all loads are far off, and there is no reference."""
        problem = self.found.problem
        classes = [effects.catalogue()[i] for i in self.leading]
        shape = all(not c.on_by_default and (c.blade is not Effect.blade or c.section is not Effect.section)
                    for c in classes)  # fmt: skip
        shown = any(p.record.reference for p in problem.parts)
        return shape and not shown and min((abs(v) for v in problem.level.values()), default=0.0) > ANOTHER

    @cached_property
    def vague(self) -> float:
        """Log odds of something unknown over nothing."""
        return self.found.log_bayes(UNKNOWN)

    @cached_property
    def _weight(self) -> float:
        return min(prior.prior_weights(self.found.problem, tuple(self.leading)).values(), default=1.0)

    @cached_property
    def _present(self) -> set[str]:
        return prior.present(self.found.problem)

    @property
    def on(self) -> bool:
        """Whether the leading explanation has physics that is on already."""
        return any(i in self._present for i in self.leading)

    @property
    def expected(self) -> bool:
        """Whether the leading explanation is physics that every rotor has and that is off."""
        return self._weight > 1.0

    @property
    def needed(self) -> float:
        """Log odds over nothing from which it counts."""
        if self.always_there:
            return float(np.log(NAMED / (1.0 - NAMED) / prior.ALWAYS))
        if self.on or self.expected:
            return PROVEN if self.on else EXPECTED
        recorded = self.found.problem.covariates
        chosen = [effects.catalogue()[i] for i in self.leading]
        apart = all(any(v in recorded for v in e.along) for e in chosen)
        if self.real:
            return ENOUGH if apart else PROVEN
        if self.found.problem.by_laws and any(map(rough, self.leading)):  # the error of such a law may look like it
            return ENOUGH
        # noise with a memory looks like a drift
        creeps = any(e.fault == "drift" for e in chosen)
        return LEAST if not self.alone or (apart and not creeps) else ENOUGH

    @cached_property
    def unlisted(self) -> float:
        """Probability that the cause is not in the library: two cells with one fault are one cause, too."""
        return self.P[UNKNOWN] + sum(v for k, v in self.P.items() if k.pair and twins(k))

    @property
    def likeliest_none(self) -> bool:
        """Whether no explanation is likelier than nothing at all."""
        return self.P[NONE] >= max(self.P.values())

    @property
    def alone(self) -> bool:
        """Whether there is no reference."""
        return bool(self.found.problem.free.all())

    @property
    def drive_only(self) -> bool:
        """Whether the readings are those of the speed over pulse width."""
        return bool(np.all(self.found.problem.channel == CHANNELS.index("rpm")))

    @property
    def real(self) -> bool:
        """Whether there is no reference, and the readings are those of a rotor as far off as real ones are."""
        return self.alone and self.found.states[0].hyper.real > 0.0

    @property
    def factor(self) -> bool:
        """Whether a slip of a unit is in the lead, proven, of a rotor that no reference shows."""
        slips = [i for i in self.first if effects.catalogue()[i].fault == "unit"]
        return self.alone and any(self.found.log_bayes(Explanation.of(i)) > PROVEN for i in slips)

    @cached_property
    def roughness(self) -> float:
        """Noise over what the recording states, where it does [1]."""
        return self.found.states[0].hyper.scale if self.found.problem.u_known else 1.0

    @cached_property
    def paired(self) -> bool:
        """Whether two effects are likelier to be at work than one."""
        return self.leading.pair and sum(v for k, v in self.P.items() if k.pair) > 0.5

    @cached_property
    def sure(self) -> tuple[str, ...]:
        """Effects that are in nearly all of the probability."""
        least = BOTH if self.paired else SURE
        return tuple(i for i, p in self.share.items() if p >= least)

    @cached_property
    def group(self) -> tuple[str, ...]:
        """The surest effect, or the first of the leading ones, and its look-alikes."""
        first = self.sure[0] if self.sure else next(iter(self.leading))
        return _class(self.found, first, self.share)

    @cached_property
    def wide(self) -> tuple[str, ...]:
        """The group and, while it is not as sure as a name, what is as likely as a second effect has to be."""
        if mass(self.found, self.group) >= NAMED:
            return self.group
        others = (i for i, p in self.share.items() if i not in self.group and p >= PARTNER)
        return (*self.group, *others)[:LARGEST]

    @cached_property
    def beside(self) -> tuple[str, ...]:
        """Effects one of which may be at work beside the one that is sure, or one of its look-alikes."""
        others = [i for i in inclusion(self.found) if i not in self.group]
        together = {i: sum(self.P.get(Explanation.of(g, i), 0.0) for g in self.group) for i in others}
        ranked = sorted(together, key=lambda i: -together[i])
        if not ranked or together[ranked[0]] < (PARTNER if self.sure else LIKE):
            return ()
        likely = [i for i in ranked if together[i] >= LIKE * together[ranked[0]]]
        return tuple(likely[: max(LARGEST - len(self.group), 1)])

    @cached_property
    def known_sets(self) -> tuple[tuple[str, ...], ...]:
        """One set of effects per cause of the leading pair; a sure effect is a set of its own."""
        return credible_sets(self.P, self.leading, next((i for i in self.leading if i in self.sure), ""))

    @cached_property
    def few(self) -> tuple[str, ...]:
        """Fewest of the likeliest effects that are as sure as a name, or :data:`MOST` as sure as a class; or none."""
        some = tuple(self.share)
        found = next((some[:n] for n in range(2, MOST) if mass(self.found, some[:n]) >= NAMED), some[:MOST])
        return found if mass(self.found, found) >= SURE else ()

    @cached_property
    def likely(self) -> tuple[str, ...]:
        """The likeliest effect, alone where it is sure enough for a name, else with what it may be mistaken for."""
        share = list(self.share.items())[:MOST]
        if not share or share[0][1] >= NAMED:
            return tuple(i for i, _ in share[:1])
        return tuple(i for i, p in share if p > RARE * share[0][1])

    def says(
        self, verdict: str, why: str, effects: Sequence[str] = (), probability: float | None = None,
        classes: tuple[tuple[str, ...], ...] = (), leading: Explanation | None = None,
    ) -> Decision:  # fmt: skip
        """Decision about the leading explanation."""
        what = self.leading if leading is None else leading
        p = self.P.get(what, 0.0) if probability is None else probability
        return Decision(verdict, tuple(effects), what, p, self.rest if what else -np.inf, classes, why)

    def names(self, ids: Sequence[str], probability: float) -> Decision:
        """Decision that names effects."""
        stand = all(effects.catalogue()[i].kind == "stand" for i in ids)
        why = "nearly all of the probability is on " + ("it" if len(ids) == 1 else "both")
        said = self.says("sensor" if stand else "named", why, ids, probability, leading=Explanation.of(*ids))
        return replace(said, sets=tuple((i,) for i in ids))


def inclusion(found: Evidence) -> dict[str, float]:
    """Probability that an effect is at work, alone or in a pair, by id."""
    out = dict.fromkeys(found.spans, 0.0)
    for what, p in found.probability.items():
        for i in what.ids:
            out[i] += p
    return dict(sorted(out.items(), key=lambda kv: -kv[1]))


def alike(found: Evidence, name: str) -> tuple[str, ...]:
    """Single effects that explain what an effect explains, within noise and evidence, itself left out.

    Without a case the laws of flow and blade are rougher than any noise: what they miss by as small a share as
    published laws differ by is a detail.
    """
    state, what = found.states[0], Explanation.of(name)
    s = state.white.changes(fitting.fit(found, what).signature)
    best = found.log_bayes(what)

    def near(i: str) -> bool:
        behind = best - found.log_bayes(Explanation.of(i))
        if found.problem.by_laws and rough(i) and rough(name):
            return behind < max(NEAR, min(FORM) * best)
        return behind < NEAR and look.distance(state, s, found.spans[i], state.forms[name]) < look.ALIKE

    return tuple(i for i in found.spans if i != name and near(i))


def rough(name: str) -> bool:
    """Whether the law of an effect may be off, as that of no instrument is."""
    cls = effects.catalogue()[name]
    return cls.kind != "stand" and not cls.exact


def twins(what: Explanation) -> bool:
    """Whether both cells of the balance are said to have the same fault: shifts, or gains."""
    chosen = [effects.catalogue()[i] for i in what]
    faults = {"shift" if e.fault in _SHIFTS else e.fault for e in chosen}
    return len(chosen) > 1 and len(faults) == 1 and "" not in faults and all(e.sensor in _BALANCE for e in chosen)


def levels_only(what: Explanation) -> bool:
    """Whether two effects each move whole channels by one share: together they fit any two levels."""
    chosen = [effects.catalogue()[i] for i in what]
    shares = [e.exact or (e.fault in _SHARES and e.sensor in ("", *_BALANCE)) for e in chosen]
    return len(chosen) > 1 and all(shares)


def interval_includes_off(name: str, told: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether an effect may as well be absent: the interval of its size holds the value at which it is.

    Of several sizes that stand for each other (zero and temperature of a drift) each may hold it and all together not.
    """
    sizes = [p for p in effects.catalogue()[name].parameters if p.off is not None and p.name in told]
    discrete = effects.catalogue()[name].discrete
    free = [p for p in sizes if p.name not in discrete]
    if len(free) != 1:
        return False
    return all(told[p.name]["low"] <= p.off <= told[p.name]["high"] for p in sizes if p.off is not None)


def unsettled(name: str, told: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether a wrong unit of the airspeed fits, but the readings do not say which one.

    Wind from the side divides the airspeed along the axis by any number; no cause does that to a load.
    """
    if effects.catalogue()[name].fault != "unit" or told["channel"]["value"] != "airspeed_m_s":
        return False
    return bool(max(p for _, p in told["factor"]["odds"]) < SETTLED)


def mass(found: Evidence, group: Sequence[str]) -> float:
    """Probability that at least one of some effects is at work."""
    return sum(v for k, v in found.probability.items() if k.ids & set(group))


def _earned(
    found: Evidence, pair: Explanation, share: dict[str, float], rest: float
) -> tuple[Explanation, dict[str, float]]:
    """Leading explanation without the effect that adds too little to the other one, and the probabilities to match."""
    ids = tuple(pair)
    on = prior.present(found.problem)
    for other, one in (ids, ids[::-1]):
        price = PROVEN if other in on else EARNED
        adds = found.log_bayes(pair, Explanation.of(one), real=True)
        # next to a unit error any residual is small: what is named beside it must explain its own
        vague = effects.catalogue()[one].fault == "unit" and rest > max(LEFT_OVER, SMALL * adds)
        if (adds < price or vague) and share[one] >= share[other]:
            return Explanation.of(one), {i: (0.0 if i == other else p) for i, p in share.items()}
    return pair, share


def _class(found: Evidence, first: str, share: Mapping[str, float]) -> tuple[str, ...]:
    P = {i: found.probability[Explanation.of(i)] for i in found.spans}
    others = [
        i
        for i in alike(found, first)
        if P[i] > RARE * P[first] or (found.problem.by_laws and rough(i) and rough(first))
    ]
    return (first, *sorted(others, key=lambda i: -share[i]))


def credible_sets(
    probability: Mapping[Explanation, float], pair: Explanation, sure: str = ""
) -> tuple[tuple[str, ...], ...]:
    """One set of effects per cause of a pair, likeliest first: with one effect of each set nearly all pairs are there.

    Credible sets of causes as Wang, Sarkar, Carbonetto and Stephens (2020, J. R. Statist. Soc. B 82:1273) have them,
    of the pairs together: from the leading pair the sets grow by what adds most per member, on one side or on both.
    The set of an effect that is sure does not.
    """
    pairs = {k: v for k, v in probability.items() if k.pair and (not sure or sure in k.ids)}
    ids = sorted({i for k in pairs for i in k})
    P = np.zeros((len(ids), len(ids)))
    for k, v in pairs.items():
        i, j = (ids.index(name) for name in k)
        P[i, j] = P[j, i] = v
    A, B = ([ids.index(i)] for i in pair)
    if sure:
        A, B = sorted((A, B), key=lambda side: ids[side[0]] != sure)
    while P[np.ix_(A, B)].sum() < IN_SET * sum(pairs.values()) and len(A) + len(B) < LARGEST:
        free = np.ones(len(ids), dtype=bool)
        free[[*A, *B]] = False
        to_a, to_b = (np.where(free, P[:, side].sum(axis=1), 0.0) for side in (B, A))
        i, j = int(np.argmax(to_a)), int(np.argmax(to_b))
        steps = [(to_b[j], [], [j])] if sure else [(to_b[j], [], [j]), (to_a[i], [i], [])]
        if not sure and len(A) + len(B) + 2 <= LARGEST:
            both = np.where(np.outer(free, free), 0.5 * (to_a[:, None] + to_b[None, :] + P), 0.0)
            at = np.unravel_index(int(np.argmax(both)), both.shape)
            steps.append((both[at], [int(at[0])], [int(at[1])]))
        gain, a, b = max(steps, key=lambda step: step[0])
        if gain < RARE * probability[pair]:
            break
        A, B = A + a, B + b
    return tuple(ids[i] for i in A), tuple(ids[i] for i in B)

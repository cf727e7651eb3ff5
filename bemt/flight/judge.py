"""What is wrong with a flight: the judge of :mod:`bemt.diagnose` on the balance of a body in the air.

Its decision, prior, thresholds, words and way of asking (one ordered list, the first that holds answers, the last ones
may revise it) are those of the diagnosis; the signatures are those of :mod:`bemt.flight.balance`.

The evidence of a cause is Student's density of what it leaves, at the size that fits best, times the share of the
sizes that fit as well (Laplace's approximation; MacKay, Information Theory, Inference and Learning Algorithms, ch. 28;
not checked there). That of something unlisted has sizes of its own in roll, pitch and yaw.

The gate is the p-value of the largest statistic over all causes when a healthy flight is drawn from its prediction, so
many causes are paid for once, by what they have in common (max-T; Westfall and Young, Resampling-Based Multiple
Testing, 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from bemt.base.arrays import Array
from bemt.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.diagnose.prior import LEFT_OUT, log_priors
from bemt.diagnose.rules import Rule, decide
from bemt.diagnose.suggest import Suggestion
from bemt.diagnose.thresholds import (
    EARNED,
    GATE,
    LARGEST,
    LEFT_OVER,
    LIKE,
    MOST,
    NAMED,
    NEAR,
    RARE,
    SMALL,
    SURE,
)
from bemt.diagnose.verdict import BESIDE_IT, CLAIMS, Decision, credible_sets
from bemt.flight.balance import BLADE, WEIGHT, WIND, axes_of, blade, directions, healthy_flight
from bemt.flight.change import FlightChange
from bemt.flight.next_flight import next_flight

__all__ = [
    "BUILD", "FALSE_ALARM", "IN_FLIGHT", "RULES", "BesideBalance", "FlightEvidence", "FlightQuery", "FlightVerdict",
    "judge", "weighed",
]  # fmt: skip

FALSE_ALARM = GATE
"""Usual probability that a healthy flight is accused, over all causes together: the gate of the diagnosis."""
BUILD, WIDE = "an uneven build of this vehicle", "flights of this vehicle differ more than usual"
IN_FLIGHT = "a change within the flight"
"""Rule whose size is that of the change, not of the whole flight."""
_LEAST = 3  # healthy flights from which a cause is named
_ALONG = 100.0  # condition number from which two rotors load the body along one line
_OTHER = 0.1  # share of the false alarms that is left to what no single cause explains [1]
_POSITIVE = 1.0  # log odds from which evidence is positive (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995) [1]
_LARGEST = 0.5  # change of a rotor's drive up to which sizes are alike beforehand: beyond, a motor has no more [1]


@dataclass(frozen=True)
class FlightEvidence:
    """One explanation: how the readings have it."""

    # Change of that rotor's drive (of two, of the smaller one), and half the width of its 95 % interval [1]
    size: float
    half: float
    # Size over its standard deviation; misfit that remains [1]
    t: float
    chi2: float
    log_bayes: float  # Natural logarithm of the odds over nothing, before the prior [1]


@dataclass(frozen=True)
class BesideBalance:
    """What else the log shows of the rotors."""

    # Motors, from one, that turn faster or slower at their drive, or shake more, than in healthy flights; 0: a rotor
    faster: tuple[int, ...] = ()
    slower: tuple[int, ...] = ()
    shaken: tuple[int, ...] = ()
    change: FlightChange | None = None  # A change of the balance within the flight
    healthy: tuple[bool, ...] = ()  # Of each healthy flight, whether a rotor shakes or the balance changes within it


@dataclass(eq=False)
class FlightQuery:
    """What the rules ask of a flight."""

    found: dict[Explanation, FlightEvidence]  # All that is listed
    P: dict[Explanation, float]  # Their probabilities, with those of nothing and of something unlisted [1]
    log_bayes: dict[Explanation, float]  # Log odds over nothing, of these [1]
    # Share of healthy flights that look as bad, and the one that is accepted [1]
    p_value: float
    alarm: float
    given: int  # Healthy flights to compare with
    beside: BesideBalance = field(default_factory=BesideBalance)  # What else the log shows
    steps: list[Decision] = field(default_factory=list)  # Answers of the rules so far, the last one in force

    @property
    def said(self) -> Decision | None:
        """Answer so far."""
        return self.steps[-1] if self.steps else None

    @property
    def few(self) -> bool:
        """Whether there are too few healthy flights for a name."""
        return self.given < _LEAST

    @property
    def leading(self) -> Explanation:
        """Likeliest listed explanation; a pair only where it earned its second member."""
        first = max(self.found, key=lambda e: self.P[e])
        single = max((e for e in self.found if not e.pair), key=lambda e: self.P[e])
        earned = first.pair and self.log_bayes[first] - self.log_bayes[single] >= EARNED
        return first if earned else single

    @property
    def same(self) -> tuple[Explanation, ...]:
        """Pairs of damaged rotors that the balance cannot tell from a leading weight: two that turn against each other.

        The law makes them alike, so their prior does not decide.
        """
        lead = self.leading
        if not any(name.startswith(WEIGHT) for name in lead):
            return ()
        alike = [e for e, v in self.found.items() if e.pair and v.chi2 <= self.found[lead].chi2 and v.t > 2.0]
        return tuple(sorted(alike, key=lambda e: -self.P[e])[:MOST])

    @property
    def partners(self) -> tuple[str, ...]:
        """Rotors one of which may be damaged beside the leading one, likeliest first."""
        lead = self.leading
        least = self.log_bayes[lead] + _POSITIVE
        both = {e: self.P[e] for e in self.found if e.pair and lead.ids < e.ids and self.log_bayes[e] >= least}
        ranked = sorted(both, key=lambda e: -both[e])
        kept = [e for e in ranked if both[e] >= LIKE * both[ranked[0]]][:MOST]
        return tuple(name for e in kept for name in e.ids - lead.ids)

    @property
    def as_good(self) -> tuple[Explanation, ...]:
        """The leading explanation and those that are as good, or the next one where none is, likeliest first."""
        lead = self.leading
        least, low = RARE * self.P[lead], self.log_bayes[lead] - NEAR
        rest = sorted((e for e in self.found if e != lead and e.pair == lead.pair), key=lambda e: -self.P[e])
        near = (*(e for e in rest if self.P[e] > least and self.log_bayes[e] > low), *self.same)
        return (lead, *(near or rest[:1]))

    def says(
        self, verdict: str, why: str, of: Sequence[Explanation] = (), more: tuple[str, ...] = (),
        sets: tuple[tuple[str, ...], ...] = (),
    ) -> Decision:  # fmt: skip
        """Decision that gives the effects of some explanations, and more."""
        lead = of[0] if of else self.leading if verdict != "none" else NONE
        names = tuple(dict.fromkeys(i for e in of for i in e)) + more
        chance = self.share(of) if of else self.P[NONE] if verdict == "none" else self.P[lead]
        rest = self.log_bayes[UNKNOWN] - self.log_bayes[lead]
        return Decision(verdict, names, lead, chance, rest, (), why, sets=sets)

    def share(self, of: Sequence[Explanation]) -> float:
        """Probability of some explanations among those of their kind, once something moved."""
        lead = self.leading
        kind = [e for e in self.found if lead.pair or not e.pair or e in of]
        return sum(self.P[e] for e in of) / sum(self.P[e] for e in kind)


def _within(a: FlightQuery) -> Decision | None:
    """DIAGNOSIS 2.3: the p-value of the gate."""
    if a.p_value <= a.alarm or a.few:
        return None
    return a.says("none", "no more than healthy flights differ")


def _few_and_within(a: FlightQuery) -> Decision | None:
    """Declared: without healthy flights of one vehicle nobody knows its trim."""
    if a.p_value <= a.alarm:
        return None
    why = "no motor stands out by more than in healthy vehicles; give three or more healthy flights with --healthy"
    return a.says("insufficient", why)


def _few(a: FlightQuery) -> Decision | None:
    """The same."""
    if not a.few:
        return None
    why = "more than healthy vehicles show; three or more healthy flights of this one (--healthy) would tell"
    left = a.log_bayes[UNKNOWN] - a.log_bayes[a.leading] > LEFT_OVER
    return a.says("class", why, () if left else a.as_good, (WIDE if a.given else BUILD,))


def _rest(a: FlightQuery) -> Decision | None:
    """As of a smooth rest in the diagnosis: a small share of what is explained is a detail of it."""
    rest = a.log_bayes[UNKNOWN] - a.log_bayes[a.leading]
    if rest <= max(LEFT_OVER, SMALL * a.log_bayes[a.leading]):
        return None
    return a.says("unknown", "the balance moved, but not as one or two rotors or one weight move it")


def _another(a: FlightQuery) -> Decision | None:
    """As in the diagnosis: one is sure, another may be there."""
    lead = a.leading
    if len(lead) != 1 or a.share((lead,)) < NAMED or a.same or not a.partners:
        return None
    (name,) = lead
    why = "the first is present; whether another is also present is left open"
    return a.says("class", why, (lead,), a.partners, sets=((name,), a.partners))


def _one(a: FlightQuery) -> Decision | None:
    """As of a name in the diagnosis."""
    lead = a.leading
    if len(lead) != 1 or a.share((lead,)) < NAMED or a.same:
        return None
    return a.says("named", "one cause explains the balance, the others do not", (lead,), sets=(tuple(lead),))


def _both(a: FlightQuery) -> Decision | None:
    """The same, of two: they are tried as one explanation, so their probability is that of both."""
    lead = a.leading
    if not lead.pair or a.share((lead,)) < NAMED:
        return None
    why = "no single cause explains the balance; two damaged rotors do"
    return a.says("named", why, (lead,), sets=tuple((i,) for i in lead))


def _two(a: FlightQuery) -> Decision | None:
    """As of two at work in the diagnosis: a set for each."""
    lead = a.leading
    if not lead.pair:
        return None
    sets = credible_sets(a.P, lead)
    inside = [e for e in a.found if e.pair and any(e == Explanation.of(i, j) for i in sets[0] for j in sets[1])]
    if a.share(inside) < SURE:
        return None
    of = sorted(inside, key=lambda e: -a.P[e])
    return a.says("class", "two damaged rotors, each with look-alikes", of, sets=sets)


def _alike(a: FlightQuery) -> Decision | None:
    """As of look-alikes in the diagnosis."""
    members = a.as_good[:LARGEST]
    if a.leading.pair or a.share(members) < SURE:
        return None
    well = all(a.P[e] > RARE * a.P[a.leading] for e in members)
    why = "these explain the balance nearly as well" if well else "the first is likely, but not sure enough for a name"
    if a.same:
        why = "a weight between two rotors and damage to both of them load the body alike"
    more = tuple(i for i in a.partners if all(i not in e for e in members))
    return a.says("class", why, members, more)


def _many(a: FlightQuery) -> Decision | None:
    """The rest."""
    return a.says("insufficient", "several different explanations are possible")


def _speed(a: FlightQuery) -> Decision | None:
    """By definition: of the causes that look alike in the balance a damaged blade alone unloads its motor."""
    said = a.steps[-1]
    turned = [blade(k) for k in a.beside.faster if blade(k) in said.effects]
    if said.verdict != "class" or len(turned) != 1 or len(a.beside.faster) != 1 or said.leading.pair:
        return None
    why = f"{said.why}; that motor alone turns faster at its drive, as with less blade"
    return replace(said, verdict="named", effects=(turned[0],), leading=Explanation.of(turned[0]), why=why,
                   sets=((turned[0],),))  # fmt: skip


def _slow(a: FlightQuery) -> Decision | None:
    """By definition: a blade that lost area does not load its motor more."""
    said = a.steps[-1]
    weak = [k for k in a.beside.slower if blade(k) in said.effects]
    if said.verdict not in ("class", "named") or not weak:
        return None
    gone = {blade(k) for k in weak}
    names = tuple(f"weak motor, bearing or controller, motor {i.removeprefix(BLADE)}" if i in gone else i
                  for i in said.effects)  # fmt: skip
    return replace(said, effects=names, why=f"{said.why}; motor {weak[0]} turns slower at its drive")


def _changed(a: FlightQuery) -> Decision | None:
    """By definition: the flight before the change is the healthy one."""
    said, change = a.steps[-1], a.beside.change
    if said.verdict not in ("none", "insufficient") or change is None:
        return None
    names = change.causes[:LARGEST]
    when = f" at {change.at_s:.1f} s" if change.kind == "step" else ", steadily"
    why = f"the balance changed in flight{when}, by {100 * change.size:.0f} ± {100 * change.half:.0f} % drive"
    return replace(said, verdict="named" if len(names) == 1 else "class", effects=names, sets=(names,), why=why,
                   leading=Explanation.of(names[0]), probability=1.0 - GATE)  # fmt: skip


def _shake(a: FlightQuery) -> Decision | None:
    """Declared: what shakes and does not move the balance is an imbalance or a small damage."""
    said = a.steps[-1]
    if said.verdict != "none" or len(a.beside.shaken) != 1:
        return None
    which = f"motor {a.beside.shaken[0]}" if a.beside.shaken[0] else "a rotor"
    why = "the balance did not move, but it shakes more at its shaft frequency than in healthy flights"
    return replace(said, verdict="class", effects=(f"imbalance or tape, {which}", f"damaged blade, {which}"), why=why)


RULES: list[Rule] = [
    Rule("healthy flights look like it", _within, "GATE"),
    Rule("too few healthy flights", _few_and_within, "GATE"),
    Rule("beyond other healthy vehicles", _few, "GATE, NEAR, RARE"),
    Rule("a rest is left", _rest, "LEFT_OVER, SMALL"),
    Rule(BESIDE_IT, _another, "NAMED, LIKE, MOST"),
    Rule("one is sure", _one, "NAMED"),
    Rule("both are sure", _both, "EARNED, NAMED"),
    Rule("two at work", _two, "EARNED, IN_SET, SURE"),
    Rule("look-alikes", _alike, "NEAR, RARE, LARGEST, SURE"),
    Rule("many are left", _many),
    Rule(IN_FLIGHT, _changed, "GATE", revises=True),
    Rule("speed at equal drive tells a blade", _speed, "GATE", revises=True),
    Rule("speed at equal drive tells a motor", _slow, "GATE", revises=True),
    Rule("one rotor shakes", _shake, "GATE", revises=True),
]
"""In order: the first that holds answers, those that revise see the answer."""


@dataclass(frozen=True, eq=False)
class FlightVerdict:
    """The answer of the judge on a flight."""

    said: Decision  # As of a diagnosis
    readings: Array  # (B,) Change of the log of each rotor's share of the drive [1]
    next: Suggestion  # What would decide, or confirm
    found: dict[Explanation, FlightEvidence] = field(default_factory=dict)  # All that is listed
    # Of these, of nothing and of something unlisted [1]
    probability: dict[Explanation, float] = field(default_factory=dict)
    p_value: float = float("nan")  # Share of healthy flights that look as bad [1]
    # Standard deviation of a share between healthy flights, or between vehicles where none is given [1]
    scatter: float = float("nan")
    visible: float = float("nan")  # Smallest change of one rotor's drive that would be named here [1]
    # Healthy flights accused when each is judged by the others, of how many
    accused: int = 0
    healthy: int = 0
    rate95: tuple[float, float] = (0.0, 1.0)  # 95 % interval of that rate (Clopper and Pearson) [1]
    # Change of the total drive against the healthy mean, and its 95 % half width from the healthy scatter [1]
    total: float = float("nan")
    total_half: float = float("nan")
    given: int = 0  # Healthy flights to compare with


def judge(
    flight: Array,
    healthy: Sequence[Array],
    layout: Array | None,
    false_alarm: float = FALSE_ALARM,
    windy: bool = False,
    beside: BesideBalance | None = None,
) -> FlightVerdict:
    """Judge the features of a flight, (B,), by those of healthy flights of the same vehicle [1].

    Without a layout no weights are tried, and every rotor stands for itself. `false_alarm` is the accepted probability
    that a healthy flight is accused [1]. `windy`: the rotors met wind that they do not meet in the healthy flights; it
    tilts the body, so roll and pitch may change in any way, and yaw does not. `beside` is what else the log shows.
    """
    from scipy import stats

    calm = np.array(healthy).reshape(-1, flight.size)
    query, out = weighed(flight, calm, layout, false_alarm, windy)
    query.beside = beside or BesideBalance()
    said = decide(query, RULES)
    out = replace(out, said=said, next=next_flight(said, layout, query.given))
    if query.few:
        return out
    bad = []
    for k, h in enumerate(calm):
        other, _ = weighed(h, np.delete(calm, k, axis=0), layout, false_alarm)
        moved = any(query.beside.healthy[k : k + 1])
        bad.append(moved or decide(other, RULES).verdict in (*CLAIMS, "unknown"))
    interval = stats.binomtest(sum(bad), len(bad)).proportion_ci(method="exact")
    return replace(out, accused=sum(bad), healthy=len(bad), rate95=(float(interval.low), float(interval.high)))


def weighed(
    flight: Array, calm: Array, layout: Array | None, alarm: float, windy: bool = False
) -> tuple[FlightQuery, FlightVerdict]:
    """Weigh all explanations; gives what the rules ask, and the answer that has no decision yet."""
    from scipy import stats

    B, n = flight.size, len(calm)
    change = flight - (calm.mean(axis=0) if n else flight.mean())
    axes, ways = axes_of(layout, B), directions(B, layout)
    p = healthy_flight(calm, axes, layout is not None)
    z = (flight @ axes.T - p.mean) / p.sd
    D = np.stack([axes @ way for way in ways.values()]) / p.sd
    length = np.linalg.norm(D, axis=1)
    T, null = D / length[:, None] @ z, p.draws @ (D / length[:, None]).T
    most, square = null.max(axis=1), np.sum(p.draws**2, axis=1)
    # Both tests share the false alarms; a cause pays for the larger part.
    best = float(np.mean(most >= T.max())) / (1.0 - _OTHER)
    any_way = float(np.mean(square >= float(z @ z))) / _OTHER
    wide = np.quantile(np.abs(null), 0.95, axis=0) / stats.norm.ppf(0.975)  # a sd as the draws have it

    def density(chi2: float) -> float:
        return -0.5 * (p.free + z.size) * float(np.log1p(chi2 / p.free))

    def over_nothing(chi2: float, share: float) -> float:
        return density(chi2) - density(float(z @ z)) + float(np.log(min(share, 1.0)))

    found = {}
    names = list(ways)
    for name, t, size, w in zip(names, T, length, wide, strict=True):
        left = float(z @ z) - max(float(t), 0.0) ** 2
        fits = float(np.sqrt(2.0 * np.pi) * w / size / _LARGEST)
        found[Explanation.of(name)] = FlightEvidence(
            float(t / size), float(1.96 * w / size), float(t), left, over_nothing(left, fits)
        )
    blades = [i for i, name in enumerate(names) if name.startswith(BLADE)]
    for i, j in combinations(blades, 2):
        pair = D[[i, j]].T
        sizes, *_ = np.linalg.lstsq(pair, z, rcond=None)
        if np.linalg.cond(pair) > _ALONG or sizes.min() <= 0.0:
            continue
        inverse = np.linalg.inv(pair.T @ pair)
        u, w = np.sqrt(np.diag(inverse)), float(np.sqrt(wide[i] * wide[j]))
        k, left = int(np.argmin(sizes)), float(np.sum((z - pair @ sizes) ** 2))
        fits = float(2.0 * np.pi * w**2 * np.sqrt(np.linalg.det(inverse)) / _LARGEST**2)
        found[Explanation.of(names[i], names[j])] = FlightEvidence(
            float(sizes[k]), float(1.96 * w * u[k]), float(sizes[k] / u[k]), left, over_nothing(left, fits)
        )
    # Readings as wide as those of damaged blades of any size.
    scale = np.sqrt(np.mean(D[blades] ** 2, axis=0) * _LARGEST**2 / 3.0)
    free = np.log1p(scale**2)
    if windy:
        still = float(z[2] ** 2) if layout is not None and z.size == 3 else 0.0
        tilt = float(np.exp(-0.5 * np.sum(free[:2])))
        found[Explanation.of(WIND)] = FlightEvidence(0.0, float("nan"), 0.0, still, over_nothing(still, tilt))
    unlisted = float(np.sum(z**2 / (1.0 + scale**2)))
    log_bayes = {e: v.log_bayes for e, v in found.items()}
    log_bayes |= {NONE: 0.0, UNKNOWN: over_nothing(unlisted, float(np.exp(-0.5 * np.sum(free))))}
    # Wind is only listed where the log shows it, so it is as likely as physics that every rotor has.
    prior = log_priors({i: LEFT_OUT if i == WIND else 1.0 for e in found if not e.pair for i in e})
    weight = {e: v + prior[e] for e, v in log_bayes.items()}
    top = max(weight.values())
    total = sum(float(np.exp(v - top)) for v in weight.values())
    P = {e: float(np.exp(v - top)) / total for e, v in weight.items()}
    query = FlightQuery(found, P, log_bayes, min(best, any_way, 1.0), alarm, n)

    totals = calm.mean(axis=1)
    spread = float(stats.t.ppf(0.975, n - 1) * totals.std(ddof=1) * np.sqrt(1.0 + 1.0 / n)) if n > 1 else float("nan")
    bar = float(np.quantile(most, 1.0 - (1.0 - _OTHER) * alarm))
    nothing = Suggestion("", (), (), 0.0, 0.0, "")
    answer = FlightVerdict(
        query.says("none", ""), change - change.mean(), nothing, found, P, query.p_value,
        float(np.sqrt(np.sum(p.sd**2))), bar / float(length[blades].min()),
        total=float(change.mean()) if n else float("nan"), total_half=spread, given=n,
    )  # fmt: skip
    return query, answer

"""The rules by which a flight is judged: one ordered list; the first that holds answers, those that revise see it.

Thresholds and words are those of :mod:`bemt.judge.diagnose.rules`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bemt.base.arrays import Array
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.tools.flight.balance import BLADE, DAY, WEIGHT, axes_of, blade, directions
from bemt.tools.flight.decision import (
    BESIDE_IT,
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
    FlightDecision,
    Rule,
    credible_sets,
)
from bemt.tools.flight.log import FlightLog

# A change within one flight: a rotor that suddenly, or more and more, needs another drive than the others.
#
# The readings of :mod:`bemt.tools.flight.judge` over time, in blocks, are regressed on a step at each possible time, or
# on a slope, beside a level and the mean velocity of the block where it was logged (a rotor meets other air in flight).
# What the regression leaves is correlated in time, so its variance is that of means over batches (e.g. Law, Simulation
# Modeling and Analysis, ch. 9). The bar is Student's, divided by causes and by independent times (Bonferroni).

_BLOCK_S, _EDGE_S, _BATCHES, _LONGEST = 0.5, 1.0, 10, 600  # block; least time on both sides [s]; batches; blocks
_ALIKE = 2.0 * float(np.log(NAMED / (1.0 - NAMED)))  # chi squares that differ by less leave a name open
_SMALL = 0.05  # a change below this is not worth a word [1]


@dataclass(frozen=True)
class FlightChange:
    """A change within a flight."""

    kind: str  # "step" or "growth"
    at_s: float  # Time of a step from the first sample; NaN for a growth [s]
    causes: tuple[str, ...]  # What explains its direction, best first
    # Change of that rotor's drive, over the whole flight for a growth, and the half width of its 95 % interval [1]
    size: float
    half: float


def change_in(log: FlightLog, layout: Array | None) -> FlightChange | None:
    """The clearest change within a flight; None where there is none, or under 20 blocks in the air."""
    from scipy import stats

    drive = log.drive
    if drive is None or log.rotors < 3:
        return None
    found = _blocks(log, drive)
    if found is None:
        return None
    t, mean, other = found
    axes = axes_of(layout, log.rotors)
    y = np.log(mean) @ axes.T
    N, k = y.shape
    ways = directions(log.rotors, layout)
    D = np.stack([axes @ w for w in ways.values()])
    plain = np.column_stack([np.ones(N), other])
    edge = max(int(round(_EDGE_S / (t[1] - t[0]))), 2)
    ramp = (t - t[0]) / (t[-1] - t[0])
    tries = [("step", float(t[c]), (np.arange(N) >= c).astype(float)) for c in range(edge, N - edge)]
    fits = [(*_regressed(y, np.column_stack([column, plain])), kind, at)
            for kind, at, column in [*tries, ("growth", float("nan"), ramp)]]  # fmt: skip
    change, s2, _, kind, at = min(fits, key=lambda f: f[2])
    d = D / np.sqrt(s2)
    length = np.linalg.norm(d, axis=1)
    z = change / np.sqrt(s2)
    T = d / length[:, None] @ z
    free = k * (_BATCHES - 1 - plain.shape[1])
    bar = float(stats.t.ppf(1.0 - GATE / (len(ways) * (_BATCHES + 1)), free))
    i = int(np.argmax(T))
    misfit = float(z @ z) - T**2
    size, half = float(T[i] / length[i]), float(stats.t.ppf(0.975, free) / length[i])
    # What no listed cause explains to three quarters is another manoeuvre.
    if T[i] < bar or size < _SMALL or misfit[i] > 0.25 * float(z @ z):
        return None
    order = np.argsort(misfit)
    alike = tuple(list(ways)[j] for j in order if T[j] > 0.0 and misfit[j] - misfit[i] < _ALIKE)
    return FlightChange(kind, at, alike, size, half)


def _regressed(y: Array, X: Array) -> tuple[Array, float, float]:
    """Change of the readings with the first column, (k,), its variance by batches, and the squares that are left."""
    gram = np.linalg.pinv(X.T @ X)
    b = gram @ X.T @ y
    rest = y - X @ b
    N, k = y.shape
    batches = np.array([p.mean(axis=0) for p in np.array_split(rest, _BATCHES)])
    # One variance for all readings; independent samples are the least that it can be.
    long = N / _BATCHES * float(np.sum(batches**2)) / max(_BATCHES - X.shape[1], 3)
    short = float(np.sum(rest**2)) / max(N - X.shape[1], 1)
    return b[0], max(long / k, short / k, 1e-6) * float(gram[0, 0]), float(np.sum(rest**2))


def _blocks(log: FlightLog, drive: Array) -> tuple[Array, Array, Array] | None:
    """Times, mean drives and velocities of the blocks in the air."""
    on = log.flying
    if on.sum() < 100:
        return None
    t = log.t[on]
    width = max(_BLOCK_S, float(t[-1] - t[0]) / _LONGEST)
    number = np.floor((t - t[0]) / width).astype(int)
    count = np.bincount(number)
    full = count >= max(0.5 * np.median(count[count > 0]), 2)

    def mean(v: Array) -> Array:
        return np.stack([np.bincount(number, weights=c)[full] / count[full] for c in v[on].T], axis=1)

    values = mean(drive)
    if full.sum() < 20 or not np.all(values > 0.0):
        return None
    other = np.zeros((int(full.sum()), 0))
    if log.velocity is not None:
        v = mean(log.velocity)
        other = v - v.mean(axis=0)
        other = other[:, np.ptp(other, axis=0) > 0.2]
    return t[0] + width * (np.flatnonzero(full) + 0.5), values, other


__all__ = ["BUILD", "DAYS", "IN_FLIGHT", "RULES", "WIDE", "BesideBalance", "FlightEvidence", "FlightQuery"]

BUILD, WIDE = "an uneven build of this vehicle", "flights of this vehicle differ more than usual"
IN_FLIGHT = "a change within the flight"
"""Rule whose size is that of the change, not of the whole flight."""
_EVEN = 0.5  # probability from which another day is the reason, once something moved [1]
DAYS = "days differ"
"""Rule of a flight that another day explains."""
_LEAST = 3  # healthy flights from which a cause is named
_POSITIVE = 1.0  # log odds from which evidence is positive (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995) [1]


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
    steps: list[FlightDecision] = field(default_factory=list)  # Answers of the rules so far, the last one in force

    @property
    def said(self) -> FlightDecision | None:
        """Answer so far."""
        return self.steps[-1] if self.steps else None

    @property
    def few(self) -> bool:
        """Whether there are too few healthy flights for a name."""
        return self.given < _LEAST

    @property
    def leading(self) -> Explanation:
        """Likeliest listed explanation; a pair only where it earned its second member."""
        day = Explanation.of(DAY)
        first = max(self.found, key=lambda e: self.P[e])
        single = max((e for e in self.found if not e.pair and e != day), key=lambda e: self.P[e])
        earned = first.pair and self.log_bayes[first] - self.log_bayes[single] >= EARNED
        lead = first if earned else single
        return day if self.P.get(day, 0.0) > _EVEN * (1.0 - self.P[NONE]) else lead

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
    ) -> FlightDecision:  # fmt: skip
        """Decision that gives the effects of some explanations, and more."""
        lead = of[0] if of else self.leading if verdict != "none" else NONE
        names = tuple(dict.fromkeys(i for e in of for i in e)) + more
        chance = self.share(of) if of else self.P[NONE] if verdict == "none" else self.P[lead]
        rest = self.log_bayes[UNKNOWN] - self.log_bayes[lead]
        return FlightDecision(verdict, names, lead, chance, rest, why, sets=sets)

    def share(self, of: Sequence[Explanation]) -> float:
        """Probability of some explanations among those of their kind, once something moved."""
        lead = self.leading
        kind = [e for e in self.found if lead.pair or not e.pair or e in of]
        return sum(self.P[e] for e in of) / sum(self.P[e] for e in kind)


def _within(a: FlightQuery) -> FlightDecision | None:
    """DIAGNOSIS 2.3: the p-value of the gate."""
    if a.p_value <= a.alarm or a.few:
        return None
    return a.says("none", "no more than healthy flights differ")


def _few_and_within(a: FlightQuery) -> FlightDecision | None:
    """Declared: without healthy flights of one vehicle nobody knows its trim."""
    if a.p_value <= a.alarm:
        return None
    why = "no motor stands out by more than in healthy vehicles; give three or more healthy flights with --healthy"
    return a.says("insufficient", why)


def _few(a: FlightQuery) -> FlightDecision | None:
    """The same."""
    if not a.few:
        return None
    why = "more than healthy vehicles show; three or more healthy flights of this one (--healthy) would tell"
    left = a.log_bayes[UNKNOWN] - a.log_bayes[a.leading] > LEFT_OVER
    return a.says("class", why, () if left else a.as_good, (WIDE if a.given else BUILD,))


def _day(a: FlightQuery) -> FlightDecision | None:
    """Declared: what days do to a trim is no fault, and only a flight of the same day tells."""
    day = Explanation.of(DAY)
    if a.leading != day:
        return None
    why = "the shares moved as they do from one day to another; three healthy flights of the same day would tell"
    return a.says("insufficient", why)


def _rest(a: FlightQuery) -> FlightDecision | None:
    """As of a smooth rest in the diagnosis: a small share of what is explained is a detail of it."""
    rest = a.log_bayes[UNKNOWN] - a.log_bayes[a.leading]
    if rest <= max(LEFT_OVER, SMALL * a.log_bayes[a.leading]):
        return None
    return a.says("unknown", "the balance moved, but not as one or two rotors or one weight move it")


def _another(a: FlightQuery) -> FlightDecision | None:
    """As in the diagnosis: one is sure, another may be there."""
    lead = a.leading
    if len(lead) != 1 or a.share((lead,)) < NAMED or a.same or not a.partners:
        return None
    (name,) = lead
    why = "the first is present; whether another is also present is left open"
    return a.says("class", why, (lead,), a.partners, sets=((name,), a.partners))


def _one(a: FlightQuery) -> FlightDecision | None:
    """As of a name in the diagnosis."""
    lead = a.leading
    if len(lead) != 1 or a.share((lead,)) < NAMED or a.same:
        return None
    return a.says("named", "one cause explains the balance, the others do not", (lead,), sets=(tuple(lead),))


def _both(a: FlightQuery) -> FlightDecision | None:
    """The same, of two: they are tried as one explanation, so their probability is that of both."""
    lead = a.leading
    if not lead.pair or a.share((lead,)) < NAMED:
        return None
    why = "no single cause explains the balance; two damaged rotors do"
    return a.says("named", why, (lead,), sets=tuple((i,) for i in lead))


def _two(a: FlightQuery) -> FlightDecision | None:
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


def _alike(a: FlightQuery) -> FlightDecision | None:
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


def _many(a: FlightQuery) -> FlightDecision | None:
    """The rest."""
    return a.says("insufficient", "several different explanations are possible")


def _speed(a: FlightQuery) -> FlightDecision | None:
    """By definition: of the causes that look alike in the balance a damaged blade alone unloads its motor."""
    said = a.steps[-1]
    turned = [blade(k) for k in a.beside.faster if blade(k) in said.effects]
    if said.verdict != "class" or len(turned) != 1 or len(a.beside.faster) != 1 or said.leading.pair:
        return None
    why = f"{said.why}; that motor alone turns faster at its drive, as with less blade"
    return replace(said, verdict="named", effects=(turned[0],), leading=Explanation.of(turned[0]), why=why,
                   sets=((turned[0],),))  # fmt: skip


def _slow(a: FlightQuery) -> FlightDecision | None:
    """By definition: a blade that lost area does not load its motor more."""
    said = a.steps[-1]
    weak = [k for k in a.beside.slower if blade(k) in said.effects]
    if said.verdict not in ("class", "named") or not weak:
        return None
    gone = {blade(k) for k in weak}
    names = tuple(f"weak motor, bearing or controller, motor {i.removeprefix(BLADE)}" if i in gone else i
                  for i in said.effects)  # fmt: skip
    return replace(said, effects=names, why=f"{said.why}; motor {weak[0]} turns slower at its drive")


def _changed(a: FlightQuery) -> FlightDecision | None:
    """By definition: the flight before the change is the healthy one."""
    said, change = a.steps[-1], a.beside.change
    if said.verdict not in ("none", "insufficient") or change is None:
        return None
    names = change.causes[:LARGEST]
    when = f" at {change.at_s:.1f} s" if change.kind == "step" else ", steadily"
    why = f"the balance changed in flight{when}, by {100 * change.size:.0f} ± {100 * change.half:.0f} % drive"
    return replace(said, verdict="named" if len(names) == 1 else "class", effects=names, sets=(names,), why=why,
                   leading=Explanation.of(names[0]), probability=1.0 - GATE)  # fmt: skip


def _shake(a: FlightQuery) -> FlightDecision | None:
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
    Rule(DAYS, _day),
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

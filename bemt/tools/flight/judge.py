"""What is wrong with a flight: one posterior, and the costs of the diagnosis, on the balance of a body in the air.

Explanations: nothing; a damaged blade, or two; a weight; wind where the log shows it; another day than the healthy
flights; an uneven build, where there are none; flights that scatter more than those of other vehicles; something
unlisted. What else the log shows (speeds at their drive, shaking, a change within the flight) are factors of their
evidence. :func:`bemt.judge.loss.decide` says the answer; one that names only a day or a build is that nobody can tell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.diagnose.knowledge import LEFT_OUT, PRIOR
from bemt.judge.diagnose.suggest import Suggestion
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.loss import CLAIMS, Decision, decide
from bemt.tools.flight.balance import (
    ALARM,
    BLADE,
    BUILD,
    DAY,
    IMBALANCE,
    LARGEST,
    LOADED,
    SCATTER,
    TOTAL,
    TOTAL_FREE,
    WEAK,
    WEIGHT,
    WIDE,
    WIND,
    axes_of,
    blade,
    differ,
    directions,
    healthy_flight,
)
from bemt.tools.flight.change import FlightChange, FlightEvidence, FlightReadings
from bemt.tools.flight.vibration import level_odds

ELSEWHERE = (DAY, BUILD, WIDE)
"""Explanations that say nothing of a fault: the healthy flights are of another day, or the vehicle is of its own."""
_USUAL = 50.0  # weight of wind where the log shows it beside 1 for every fault: it is there in most flights [1]
_WIDER, _ODD = 3.0, 0.1  # a vehicle out of the common: factor of its scatter, and how many are (declared) [1]
_UNEVEN = 0.5  # the same of the build, where four vehicles are all that is known (declared) [1]
_SEEN = 0.5  # faults of a rotor that a speed at its drive or an accelerometer shows (declared) [1]
_LOADED = 0.5  # flights whose mass, battery or air is another, so their total drive tells nothing (declared) [1]
_RIVAL = 0.015  # probability from which an explanation is told beside a likelier one [1]
_OPEN = 0.5  # flights that are of another day, and healthy flights that are of many, where nobody says [1]


@dataclass(frozen=True)
class BesideBalance:
    """What else the log shows of the rotors."""

    # Motors, from one, that turn faster or slower at their drive, or shake more, than in healthy flights; 0: a rotor
    faster: tuple[int, ...] = ()
    slower: tuple[int, ...] = ()
    shaken: tuple[int, ...] = ()
    change: FlightChange | None = None  # A change of the balance within the flight
    healthy: tuple[bool, ...] = ()  # Of each healthy flight, whether a rotor shakes or the balance changes within it
    # Log of the level of vibration, and of each healthy flight where it is of the same kind [1]
    level: float = float("nan")
    levels: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class FlightVerdict:
    """The answer of the judge on a flight."""

    said: Decision  # As of a diagnosis
    readings: Array  # (B,) Change of the log of each rotor's share of the drive [1]
    next: Suggestion  # What would decide, or confirm
    found: dict[Explanation, FlightEvidence] = field(default_factory=dict)  # All that has a size
    probability: dict[Explanation, float] = field(default_factory=dict)  # Of all [1]
    # Standard deviation of a share between healthy flights, or between vehicles where none is given [1]
    scatter: float = float("nan")
    # Healthy flights accused when each is judged by the others, of how many
    accused: int = 0
    healthy: int = 0
    rate95: tuple[float, float] = (0.0, 1.0)  # 95 % interval of that rate (Clopper and Pearson) [1]
    # Change of the total drive against the healthy mean, and its 95 % half width from the healthy scatter [1]
    total: float = float("nan")
    total_half: float = float("nan")
    given: int = 0  # Healthy flights to compare with
    sessions: int = 1  # Sessions of them that are known
    in_flight: bool = False  # Whether what is said changed within the flight
    _shows: Callable[[], float] = field(default=lambda: float("nan"), repr=False)

    @property
    def visible(self) -> float:
        """Smallest change of any one rotor's drive that would be said here; found when it is asked for [1]."""
        return self._shows()

    @property
    def total_moved(self) -> bool:
        """Whether the total drive is further from the healthy mean than healthy flights are."""
        return abs(self.total) > self.total_half


def judge(
    flight: Array, healthy: Sequence[Array], layout: Array | None, windy: bool = False,
    beside: BesideBalance | None = None, days: Sequence[int] = (), day: int | None | str = "",
) -> FlightVerdict:  # fmt: skip
    """Judge the features of a flight, (B,), by those of healthy flights of the same vehicle [1].

    Without a layout no weights are tried, and every rotor stands for itself. `windy`: the rotors met wind that they do
    not meet in the healthy flights; it tilts the body, so roll and pitch may change in any way, and yaw does not.
    `beside` is what else the log shows. `days` numbers the session of each healthy flight, `day` is that of this one:
    None where it is known to be another, empty where nobody knows; then another day is as likely as not.
    """
    from scipy import stats

    calm, beside = np.array(healthy).reshape(-1, flight.size), beside or BesideBalance()
    n = len(calm)
    label = np.array(days if len(days) == n else [0] * n, dtype=int)
    sure = posterior(flight, calm, layout, windy, beside, label, day)
    change = flight - (calm.mean(axis=0) if n else flight.mean())
    half = float("nan")
    if n > 1:
        # What the healthy flights show, and no less than what flights of other vehicles differ by at one voltage.
        own = float(stats.t.ppf(0.975, n - 1) * calm.mean(axis=1).std(ddof=1) * np.sqrt(1.0 + 1.0 / n))
        half = max(own, float(stats.t.ppf(0.975, n - 1 + TOTAL_FREE)) * total_sd(calm))
    cause = beside.change.causes if beside.change is not None else ()
    out = FlightVerdict(
        sure.said, change - change.mean(), next_flight(sure.said, layout, n, day == ""), sure.found, sure.P,
        sure.scatter, total=float(change.mean()) if n else float("nan"), total_half=half, given=n,
        in_flight=bool(sure.said.effects) and set(sure.said.effects) <= set(cause),
        _shows=partial(_visible, tuple(map(tuple, calm)), None if layout is None else tuple(map(tuple, layout)),
                       flight.size, tuple(label), day),
    )  # fmt: skip
    if sure.said.verdict == "none" and out.total_moved:
        step = "weigh the vehicle and charge the battery, then hover 30 s; --healthy-mass-kg, the mass of the " \
               "healthy flights, gives that of this one"  # fmt: skip
        said = replace(sure.said, why="the motors share the work as in healthy flights")
        out = replace(out, said=said, next=Suggestion(step, "run"))
    if n < 3:
        return out
    bad, several = [], np.unique(label).size > 1
    levels = np.array(beside.levels) if len(beside.levels) == n else np.full(n, np.nan)
    for k, h in enumerate(calm):
        # Of several sessions each is left out; of one, each flight, and its day is as open as that of this one.
        keep = label != label[k] if several else np.arange(n) != k
        left_out = None if several else "" if isinstance(day, str) else int(label[k])
        shake = BesideBalance(level=levels[k], levels=tuple(levels[keep]))
        other = posterior(h, calm[keep], layout, False, shake, label[keep], left_out).said
        bad.append(any(beside.healthy[k : k + 1]) or other.verdict in (*CLAIMS, "unknown"))
    interval = stats.binomtest(sum(bad), len(bad)).proportion_ci(method="exact")
    return replace(out, accused=sum(bad), healthy=len(bad), rate95=(float(interval.low), float(interval.high)),
                   sessions=int(np.unique(label).size))  # fmt: skip


@lru_cache(maxsize=64)
def _visible(
    healthy: tuple[tuple[float, ...], ...], places: tuple[tuple[float, ...], ...] | None, B: int,
    days: tuple[int, ...], day: int | None | str,
) -> float:  # fmt: skip
    """Smallest change of one rotor's drive from which any would be said, in a flight that is healthy but for it [1]."""
    calm, layout = np.array(healthy).reshape(-1, B), None if places is None else np.array(places)
    ways, axes = directions(B, layout), axes_of(layout, B)
    D = np.array([axes @ ways[blade(k + 1)] for k in range(B)])
    hidden, base = int(np.argmin(np.linalg.norm(D, axis=1))), calm.mean(axis=0) if len(calm) else np.zeros(B)
    for size in np.geomspace(0.02, 2.0 * LARGEST, 24):
        x = base + size * ways[blade(hidden + 1)]
        if blade(hidden + 1) in posterior(x, calm, layout, days=days, day=day).said.effects:
            return float(size)
    return float("nan")


@dataclass(frozen=True, eq=False)
class FlightPosterior:
    """What is sure of a flight, and what is said."""

    P: dict[Explanation, float]  # Probability of each explanation [1]
    found: dict[Explanation, FlightEvidence]  # Of those that have a size
    said: Decision
    scatter: float  # Standard deviation of a share between healthy flights [1]


@dataclass(frozen=True, eq=False)
class _World:
    """One way in which the healthy flights may bear on this one."""

    log: float  # Natural logarithm of its prior
    still: Explanation  # What it is where nothing else is at work
    mean: Array  # (k,) Of the readings [1]
    sd: Array
    free: float
    usual: bool = True  # Whether causes are tried in it
    total: float = float("inf")  # Standard deviation of the total drive; infinite where it is not asked [1]


def _worlds(calm: Array, axes: Array, known: bool, days: Array, day: int | None | str) -> list[_World]:
    """Predictions of a healthy flight: of this day or another, of flights that differ as usual or more."""
    label = [int(v) for v in days]
    latest = label[-1] if label else None
    p = healthy_flight(calm, axes, known, label, latest if isinstance(day, str) else day)
    if not len(calm):
        wide = _World(np.log(_UNEVEN), Explanation.of(BUILD), p.mean, _WIDER * p.sd, p.free, False)
        return [_World(np.log(1.0 - _UNEVEN), Explanation.of(BUILD), p.mean, p.sd, p.free), wide]
    here = [_World(0.0, NONE, p.mean, p.sd, p.free)]
    apart = _World(0.0, NONE if day is None else Explanation.of(DAY), p.other_mean, p.other_sd, p.other_free)
    if isinstance(day, str):
        here = [replace(here[0], log=np.log(1.0 - _OPEN)), replace(apart, log=np.log(_OPEN))]
    one = np.unique(days).size < 2
    if one and len(calm) > 1 and (day is None or isinstance(day, str)):
        # Flights that differ as days do are of many days; then another one is nothing new.
        q = healthy_flight(calm, axes, known, range(len(calm)), None)
        a, b = (differ(calm, axes, known, days=v) for v in (False, True))
        here = [replace(w, log=w.log + np.log(1.0 - _OPEN) + a) for w in here]
        here.append(_World(float(np.log(_OPEN) + b), NONE, q.mean, q.sd, q.free))
    if one:
        w = healthy_flight(calm, axes, known, label, latest, _WIDER * SCATTER)
        more = differ(calm, axes, known, _WIDER * SCATTER) - differ(calm, axes, known)
        top = max(v.log for v in here)
        here.append(_World(top + np.log(_ODD) + more, Explanation.of(WIDE), w.mean, w.sd, w.free, False))
    return [part for w in here for part in _totals(w, calm)]


def _totals(w: _World, calm: Array) -> list[_World]:
    """The same where the total drive repeats as between flights, and where mass, battery or air are others."""
    return [replace(w, log=w.log + float(np.log(share)), total=float(np.hypot(total_sd(calm), more)))
            for share, more in ((1.0 - _LOADED, 0.0), (_LOADED, LOADED))]  # fmt: skip


def total_sd(calm: Array) -> float:
    """Standard deviation of the total drive of the next flight about the mean of the healthy ones, pooled [1]."""
    n, totals = len(calm), calm.mean(axis=1)
    square = (float(np.sum((totals - totals.mean()) ** 2)) + TOTAL_FREE * TOTAL**2) / (n - 1 + TOTAL_FREE)
    return float(np.sqrt(square * (1.0 + 1.0 / n)))


def posterior(
    flight: Array, calm: Array, layout: Array | None, windy: bool = False, beside: BesideBalance | None = None,
    days: Sequence[int] | Array = (), day: int | None | str = 0,
) -> FlightPosterior:  # fmt: skip
    """Weigh all explanations of the features of a flight, (B,), and say the answer; arguments as of :func:`judge`."""
    B, n, beside = flight.size, len(calm), beside or BesideBalance()
    axes, ways = axes_of(layout, B), directions(B, layout)
    label = np.array(days if len(days) == n else [0] * n, dtype=int)
    worlds = _worlds(calm, axes, layout is not None, label, day)
    prior = _priors(ways, windy, beside)
    seen = _factors([NONE, UNKNOWN, *prior], beside)
    weight: dict[Explanation, list[float]] = {}
    found: dict[Explanation, tuple[float, FlightEvidence]] = {}
    for w in worlds:
        sd, z = w.sd, (flight @ axes.T - w.mean) / w.sd
        moved = {name: axes @ way for name, way in ways.items()}
        if np.isfinite(w.total):
            sd, z = np.append(sd, w.total), np.append(z, (flight.mean() - calm.mean()) / w.total)
            moved = {name: np.append(v, ways[name].mean()) for name, v in moved.items()}
        yaw = (np.arange(z.size) == 2) & (layout is not None and len(axes) == 3)
        units = {name: v / sd for name, v in moved.items()}
        for e, log, size in _weighed(w, FlightReadings(z, sd, w.free), units, prior, beside, yaw):
            weight.setdefault(e, []).append(w.log + log + seen[NONE if e == w.still else e])
            if size is not None and (e not in found or w.log + size.log > found[e][0]):
                found[e] = w.log + size.log, size
    logs = {e: float(np.logaddexp.reduce(v)) for e, v in weight.items()}
    top = float(np.logaddexp.reduce(list(logs.values())))
    P = {e: float(np.exp(v - top)) for e, v in logs.items()}
    said = _said(decide(P, still=frozenset(ELSEWHERE)), P, n)
    return FlightPosterior(P, {e: v for e, (_, v) in found.items()}, said, float(np.sqrt(np.sum(worlds[0].sd ** 2))))


def _priors(ways: Mapping[str, Array], windy: bool, beside: BesideBalance) -> dict[Explanation, float]:
    """Prior of every single and every pair of damaged blades."""
    blades = [i for i in ways if i.startswith(BLADE)]
    loads = [i for i in ways if i.startswith(WEIGHT)]
    # A damaged blade is as likely as a weight, wherever each is.
    singles = {Explanation.of(i): 1.0 if i in blades else len(blades) / len(loads) for i in ways}
    singles |= {Explanation.of(WIND): _USUAL} if windy else {}
    singles |= {Explanation.of(WEAK + str(k)): LEFT_OUT for k in beside.slower}
    singles |= {Explanation.of(_shaking(k)): LEFT_OUT for k in beside.shaken}
    singles |= {Explanation.of(_worn(k)): 1.0 for k in beside.shaken}
    total = sum(singles.values())
    prior = {e: PRIOR.single * w / total for e, w in singles.items()}
    both = [Explanation.of(i, j) for i, j in combinations(blades, 2)]
    return prior | {e: PRIOR.pair / len(both) for e in both}


def _weighed(
    w: _World, r: FlightReadings, D: Mapping[str, Array], prior: Mapping[Explanation, float],
    beside: BesideBalance, yaw: NDArray[np.bool_],
) -> Iterator[tuple[Explanation, float, FlightEvidence | None]]:  # fmt: skip
    """Explanations in one world, each with the logarithm of prior times evidence, and its size where it has one.

    ``D`` are the readings per unit of each cause, in standard deviations; ``yaw`` marks the reading that wind spares.
    """
    chi2 = float(r.z @ r.z)
    yield w.still, float(np.log(PRIOR.none)) + r.density(chi2), None
    if not w.usual:
        return
    scale = np.sqrt(np.mean([v**2 for i, v in D.items() if i.startswith(BLADE)], axis=0) * LARGEST**2 / 3.0)
    free = 0.5 * np.log1p(scale**2)
    shakes = {Explanation.of(i) for k in beside.shaken for i in (_shaking(k), _worn(k))}
    for e, p in prior.items():
        names, size, log = [_as_blade(i) for i in e], None, float(np.log(p))
        if e == Explanation.of(WIND):
            # Wind tilts the body and loads it; of yaw it knows nothing.
            yield e, log + r.density(float(np.sum(r.z[yaw] ** 2)), float(np.sum(free[~yaw]))), None
        elif e.pair:
            size = r.two(*(D[i] for i in names))
        elif names[0] in D and np.any(D[names[0]]):
            size = r.one(D[names[0]])
        if e in shakes:
            # What shakes need not move the balance.
            yield e, log + (0.0 if size is None else float(np.log(0.5))) + r.density(chi2), None
        if size is None:
            continue
        yield e, log + size.log, size
        if not e.pair:
            yield w.still, log + size.log_small, None
    unlisted = r.density(float(np.sum(r.z**2 / (1.0 + scale**2))), float(free.sum()))
    yield UNKNOWN, float(np.log(PRIOR.unknown)) + unlisted, None


def _shaking(motor: int) -> str:
    return IMBALANCE + (f"motor {motor}" if motor else "a rotor")


def _worn(motor: int) -> str:
    return blade(motor) if motor else "damaged blade, a rotor"


def _as_blade(cause: str) -> str:
    """A weak motor is driven harder as one with a damaged blade is."""
    return cause.replace(WEAK, BLADE)


def _factors(of: Sequence[Explanation], beside: BesideBalance) -> dict[Explanation, float]:
    """Logarithm of how likely what else the log shows is under each explanation, less a factor of all.

    A flag is raised for no reason in ALARM of the flights, and by the fault that it is a sign of in half of them. Where
    none is raised for a shake, the level of vibration counts: a weight leaves it, all else may raise it.
    """
    out = dict.fromkeys(of, 0.0)
    level = 0.0 if beside.shaken else level_odds(beside.level, beside.levels, _SEEN)
    flags = [{blade(k)} for k in beside.faster] + [{WEAK + str(k)} for k in beside.slower]
    blades = {i for e in of for i in e if i.startswith(BLADE)}  # each may be the rotor that is not known
    flags += [{_shaking(k), _worn(k)} | (set() if k else blades) for k in beside.shaken]
    for e in out:
        out[e] = sum(float(np.log(_SEEN if signs & e.ids else ALARM)) for signs in flags)
        out[e] += level if e == UNKNOWN or any(not i.startswith(WEIGHT) for i in e) else 0.0
        if beside.change is not None:
            odds = dict(zip(beside.change.causes, beside.change.odds, strict=True))
            out[e] += max((odds[i] for i in e if i in odds), default=0.0)
    return out


def _said(said: Decision, P: Mapping[Explanation, float], given: int) -> Decision:
    """The decision in the words of a flight: faults first, and no claim that names none."""
    faults = [i for i in said.effects if i not in ELSEWHERE]
    if said.verdict in CLAIMS:
        return _claimed(said, faults)
    if said.verdict == "unknown":
        return replace(said, why="the balance moved, but not as one or two rotors or one weight move it")
    elsewhere = max((Explanation.of(i) for i in ELSEWHERE), key=lambda e: P.get(e, 0.0))
    nothing = P.get(NONE, 0.0)
    if said.verdict == "none" and nothing >= P.get(elsewhere, 0.0):
        return replace(said, probability=nothing, why="no more than healthy flights differ")
    said = replace(said, verdict="insufficient", effects=(), sets=())
    if elsewhere == Explanation.of(DAY) and P.get(elsewhere, 0.0) >= max(v for e, v in P.items() if e != UNKNOWN):
        why = "the shares moved as they do from one day to another; three healthy flights of the same day would tell"
        return replace(said, leading=elsewhere, why=why)
    if not given:
        return replace(said, why="no motor stands out by more than in healthy vehicles")
    likely = sorted((k for k in P if P[k] > _RIVAL), key=lambda k: -P[k])[:4]
    told = [f"{_words(k)} ({100.0 * P[k]:.0f} %)" for k in likely]
    why = f"several explanations fit, none well enough: {', '.join(told)}"
    if P[likely[0]] > 0.5:
        why = ": ".join([f"most likely {told[0]}, but that is not sure enough", ", ".join(told[1:])]).rstrip(": ")
    return replace(said, leading=likely[0], why=why)


def _words(e: Explanation) -> str:
    """An explanation in a sentence."""
    if e in (NONE, UNKNOWN):
        return "flights merely differ so" if e == NONE else "a cause that is not listed"
    return " and ".join(e).replace(", motor ", " at motor ")


def _claimed(said: Decision, faults: Sequence[str]) -> Decision:
    """A claim with its faults before what only says that the flights differ."""
    sets = tuple(tuple(sorted(s, key=ELSEWHERE.__contains__)) for s in said.sets)
    lead = said.leading if any(i in faults for i in said.leading) else Explanation.of(faults[0])
    between = any(i.startswith(f"{WEIGHT}between") for i in faults)
    alike = said.verdict == "class" and between and sum(i.startswith(BLADE) for i in faults) > 1
    why = "a weight between two rotors and damage to both of them load the body alike" if alike else said.why
    effects = (*faults, *(i for i in said.effects if i in ELSEWHERE))
    return replace(said, effects=effects, sets=sets, leading=lead, why=why)


# What to do next with the vehicle: the step that tells the causes apart which a flight leaves open.
_HOVER = "hover 30 s in still air and judge that flight"


def next_flight(said: Decision, layout: NDArray[np.float64] | None, given: int, ask_day: bool = False) -> Suggestion:
    """Choose the next step after a decision that compared with so many `given` healthy flights.

    `ask_day`: nobody knows whether the flight is of their day.
    """
    # Where nothing is sure, what is likelier than all else is still the first to look at.
    open_ = said.verdict == "insufficient" and said.probability < 0.5
    causes = tuple(said.leading) if open_ else said.effects
    motors = [int(i.removeprefix(BLADE)) for i in causes if i.startswith(BLADE) and i[len(BLADE) :].isdigit()]
    several = "s" if len(motors) > 1 else ""
    looked = f"look at the propeller{several} of motor{several} {' and '.join(map(str, motors))}"
    needed = _flight_needed(said, given, looked if motors else "", ask_day)
    text, kind = needed or _look_needed(said, motors, looked, layout)
    return Suggestion(text, kind, separates=said.effects[:2])


def _flight_needed(said: Decision, given: int, looked: str, ask_day: bool) -> tuple[str, str] | None:
    """Step and its kind where another flight, or none, is what is needed; None where the vehicle is to be looked at."""
    if said.verdict == "none":
        return "no further flight is needed; more healthy flights with --healthy would show smaller damage", ""
    if said.effects[:1] == (WIND,):
        return _HOVER, "run"
    if said.verdict == "insufficient" and said.leading == Explanation.of(DAY):
        return "three flights of this day that are known to be healthy, with --healthy and --healthy-day same; " \
               "else check propellers and arms by hand", "reference"  # fmt: skip
    if given < 3 and said.verdict != "named":
        text = "three or more healthy flights of this vehicle, in still air, with --healthy"
        return f"{looked}, and give {text}" if looked else text, "reference"
    if said.verdict in ("unknown", "insufficient"):
        day = "say whether it was flown on the day of the healthy flights (--healthy-day same or other); " \
            if ask_day else ""  # fmt: skip
        check = f"{looked}, and {_HOVER}" if looked else f"{_HOVER}; check arms, motor tilt and propellers by hand"
        return day + check, "run"
    return None


def _look_needed(
    said: Decision, motors: Sequence[int], looked: str, layout: NDArray[np.float64] | None
) -> tuple[str, str]:  # fmt: skip
    """Step and its kind where something is named, or a few things are."""
    others = [i for i in said.effects if not i.startswith(BLADE)]
    weight = any(i.startswith(WEIGHT) for i in others)
    if any(i.startswith("imbalance") for i in others):
        return "look for tape, dirt and nicks on the blades and balance the propeller", "look"
    if weight and len(motors) > 1:
        return f"weigh the vehicle, look where battery and payload sit, and {looked}", "look"
    if weight and motors:
        swap = _partner(motors[0], layout)
        return f"{looked}; if it looks right, exchange it {swap} and fly again: damage moves with it, a weight " \
               "stays", "run"  # fmt: skip
    if motors:
        return f"{looked} and replace what is damaged; the next flight should be within the healthy ones", "look"
    if weight:
        return "look where battery and payload sit", "look"
    return (_HOVER, "run") if others else ("no further flight is needed", "")


def _partner(motor: int, layout: NDArray[np.float64] | None) -> str:
    """With which propeller it can be exchanged: one that turns the same way, far from it."""
    if layout is None:
        return "with one that turns the same way"
    angle, turn, _ = layout.T
    away = np.where(turn == turn[motor - 1], -np.cos(angle - angle[motor - 1]), -np.inf)
    away[motor - 1] = -np.inf
    return f"with that of motor {int(np.argmax(away)) + 1}" if np.isfinite(away).any() else "with a new one"

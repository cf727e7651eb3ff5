"""What is wrong with a flight: the judge of :mod:`bemt.diagnose` on the balance of a body in the air.

Its decision, prior, thresholds, words and way of asking (one ordered list, the first that holds answers, the last ones
may revise it) are those of the diagnosis; the signatures are those of :mod:`bemt.tools.flight.balance`.

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
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.diagnose.prior import log_priors
from bemt.judge.diagnose.suggest import Suggestion
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.loss import CLAIMS
from bemt.tools.flight.balance import BLADE, DAY, WEIGHT, WIND, axes_of, directions, healthy_flight
from bemt.tools.flight.decision import GATE, FlightDecision, decide
from bemt.tools.flight.rules import DAYS, RULES, BesideBalance, FlightEvidence, FlightQuery

# What to do next with the vehicle: the step that tells the causes apart which a flight leaves open.

_HOVER = "hover 30 s in still air and judge that flight"


def next_flight(said: FlightDecision, layout: NDArray[np.float64] | None, given: int) -> Suggestion:
    """Choose the next step after a decision that compared with so many `given` healthy flights."""
    motors = [int(i.removeprefix(BLADE)) for i in said.effects if i.startswith(BLADE) and i[len(BLADE) :].isdigit()]
    others = [i for i in said.effects if not i.startswith(BLADE)]
    several = "s" if len(motors) > 1 else ""
    looked = f"look at the propeller{several} of motor{several} {' and '.join(map(str, motors))}"
    text, kind = "no further flight is needed", ""
    if said.verdict == "none":
        text = "no further flight is needed; more healthy flights with --healthy would show smaller damage"
    elif said.effects[:1] == (WIND,):
        text, kind = _HOVER, "run"
    elif said.rule == DAYS:
        text, kind = "three flights of this day that are known to be healthy, with --healthy and --healthy-day same; " \
                     "else check propellers and arms by hand", "reference"  # fmt: skip
    elif given < 3 and said.verdict != "named":
        text, kind = "three or more healthy flights of this vehicle, in still air, with --healthy", "reference"
        if motors:
            text = f"{looked}, and give {text}"
    elif said.verdict in ("unknown", "insufficient"):
        text, kind = f"{_HOVER}; check arms, motor tilt and propellers by hand", "run"
    elif any(i.startswith("imbalance") for i in others):
        text, kind = "look for tape, dirt and nicks on the blades and balance the propeller", "look"
    elif len(motors) > 1 and any(i.startswith(WEIGHT) for i in others):
        text, kind = f"weigh the vehicle, look where battery and payload sit, and {looked}", "look"
    elif motors and any(i.startswith(WEIGHT) for i in others):
        swap = _partner(motors[0], layout)
        text, kind = f"{looked}; if it looks right, exchange it {swap} and fly again: damage moves with it, a weight " \
                     "stays", "run"  # fmt: skip
    elif motors:
        text, kind = f"{looked} and replace what is damaged; the next flight should be within the healthy ones", "look"
    elif any(i.startswith(WEIGHT) for i in others):
        text, kind = "look where battery and payload sit", "look"
    elif others:
        text, kind = _HOVER, "run"
    return Suggestion(text, (), said.effects[:2], 0.0, 0.0, kind)


def _partner(motor: int, layout: NDArray[np.float64] | None) -> str:
    """With which propeller it can be exchanged: one that turns the same way, far from it."""
    if layout is None:
        return "with one that turns the same way"
    angle, turn, _ = layout.T
    away = np.where(turn == turn[motor - 1], -np.cos(angle - angle[motor - 1]), -np.inf)
    away[motor - 1] = -np.inf
    return f"with that of motor {int(np.argmax(away)) + 1}" if np.isfinite(away).any() else "with a new one"


__all__ = ["FALSE_ALARM", "FlightVerdict", "judge", "weighed"]

FALSE_ALARM = GATE
"""Usual probability that a healthy flight is accused, over all causes together: the gate of the diagnosis."""
_USUAL = 50.0  # weight of wind beside 1 for every fault: it is there in most flights [1]
_ALONG = 100.0  # condition number from which two rotors load the body along one line
_OTHER = 0.1  # share of the false alarms that is left to what no single cause explains [1]
_LARGEST = 0.5  # change of a rotor's drive up to which sizes are alike beforehand: beyond, a motor has no more [1]


@dataclass(frozen=True, eq=False)
class FlightVerdict:
    """The answer of the judge on a flight."""

    said: FlightDecision  # As of a diagnosis
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
    sessions: int = 1  # Sessions of them that are known


def judge(
    flight: Array,
    healthy: Sequence[Array],
    layout: Array | None,
    false_alarm: float = FALSE_ALARM,
    windy: bool = False,
    beside: BesideBalance | None = None,
    days: Sequence[int] = (),
    day: int | None | str = "",
) -> FlightVerdict:
    """Judge the features of a flight, (B,), by those of healthy flights of the same vehicle [1].

    Without a layout no weights are tried, and every rotor stands for itself. `false_alarm` is the accepted probability
    that a healthy flight is accused [1]. `windy`: the rotors met wind that they do not meet in the healthy flights; it
    tilts the body, so roll and pitch may change in any way, and yaw does not. `beside` is what else the log shows.
    `days` numbers the session of each healthy flight, `day` is that of this one: None where it is known to be another,
    empty where nobody knows; then another day is an explanation, as likely as not.
    """
    from scipy import stats

    calm = np.array(healthy).reshape(-1, flight.size)
    query, out = weighed(flight, calm, layout, false_alarm, windy, days, day)
    query.beside = beside or BesideBalance()
    said = decide(query, RULES)
    out = replace(out, said=said, next=next_flight(said, layout, query.given))
    if query.few:
        return out
    bad, label = [], np.array(days if len(days) == len(calm) else [0] * len(calm))
    several = np.unique(label).size > 1
    for k, h in enumerate(calm):
        # Of several sessions each is left out; of one, each flight.
        keep = label != label[k] if several else np.arange(len(calm)) != k
        other, _ = weighed(h, calm[keep], layout, false_alarm, days=label[keep], day=None if several else label[k])
        moved = any(query.beside.healthy[k : k + 1])
        bad.append(moved or decide(other, RULES).verdict in (*CLAIMS, "unknown"))
    interval = stats.binomtest(sum(bad), len(bad)).proportion_ci(method="exact")
    return replace(out, accused=sum(bad), healthy=len(bad), rate95=(float(interval.low), float(interval.high)),
                   sessions=int(np.unique(label).size))  # fmt: skip


def _latest(days: Sequence[int]) -> int:
    return int(days[-1]) if len(days) else 0


def weighed(
    flight: Array,
    calm: Array,
    layout: Array | None,
    alarm: float,
    windy: bool = False,
    days: Sequence[int] = (),
    day: int | None | str = 0,
) -> tuple[FlightQuery, FlightVerdict]:
    """Weigh all explanations; gives what the rules ask, and the answer that has no decision yet."""
    from scipy import stats

    B, n = flight.size, len(calm)
    change = flight - (calm.mean(axis=0) if n else flight.mean())
    axes, ways = axes_of(layout, B), directions(B, layout)
    unknown = isinstance(day, str)
    p = healthy_flight(calm, axes, layout is not None, days, _latest(days) if isinstance(day, str) else day)
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
    if unknown and n:
        moved = float(np.sum(((flight @ axes.T - p.other_mean) / p.other_sd) ** 2))
        found[Explanation.of(DAY)] = FlightEvidence(
            0.0, float("nan"), 0.0, moved, over_nothing(moved, float(np.prod(p.sd / p.other_sd)))
        )
    unlisted = float(np.sum(z**2 / (1.0 + scale**2)))
    log_bayes = {e: v.log_bayes for e, v in found.items()}
    log_bayes |= {NONE: 0.0, UNKNOWN: over_nothing(unlisted, float(np.exp(-0.5 * np.sum(free))))}
    # Wind is only listed where the log shows it, so it is as likely as physics that every rotor has.
    names_ = (i for e in found if not e.pair for i in e if i != DAY)
    prior = log_priors({i: _USUAL if i == WIND else 1.0 for i in names_})
    prior[Explanation.of(DAY)] = prior[NONE]  # as likely as not
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

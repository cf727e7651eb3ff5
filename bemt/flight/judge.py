"""What is wrong with a flight, beside healthy ones: a rigid body that flies steadily balances its loads.

A rotor that lost thrust at equal drive is driven harder until the loads balance again; of all commands that the mixer
can give these are P e_k, P = A+ A, A the matrix of the layout (for a quadrotor e_k itself: one rotor, and so roll,
pitch, yaw and total at once). A weight under an arm needs roll, pitch and total but no yaw:
A+ diag(1, 1, 0, 1) A e_k.

Readings: roll, pitch and yaw parts of the logs of the motors' mean drives. A flight x and the healthy ones x_i share
the trim m of their vehicle: x_i ~ N(m, s^2), m ~ N(0, w^2). s^2 of a reading is the healthy flights' own, pooled with
that of all readings and of other vehicles (scaled inverse chi-squared; Gelman et al., Bayesian Data Analysis, 3rd ed.,
section 2.6); w is that of :mod:`bemt.flight.population` and hardly matters once there is a healthy flight. How much the
readings share was chosen by the log score of left-out healthy flights of three vehicles (docs/flight_logs.md).

The bar is the quantile of the largest statistic over all causes when a healthy flight is drawn from that prediction, so
many causes are paid for once, by what they have in common (max-T; Westfall and Young, Resampling-Based Multiple
Testing, 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bemt.diagnose.thresholds import EARNED, GATE, NAMED
from bemt.flight.layout import effect_matrix
from bemt.flight.log import FlightLog
from bemt.flight.population import SCATTER, SCATTER_FREE, TRIM, TRIM_FREE

__all__ = [
    "ALIKE",
    "WIND",
    "FALSE_ALARM",
    "FlightEvidence",
    "FlightVerdict",
    "axes_of",
    "directions",
    "features",
    "judge",
]

Array = NDArray[np.float64]

FALSE_ALARM = GATE
"""Usual probability that a healthy flight is accused, over all causes together: the gate of the diagnosis."""
ALIKE = 2.0 * float(np.log(NAMED / (1.0 - NAMED)))
"""Explanations whose chi squares differ by less cannot be told apart: the odds at which the diagnosis gives a name."""
_LEAST = 3  # healthy flights from which a cause is named
_COMMON = 6  # flights as which the common scatter weighs against that of a reading (docs/flight_logs.md)
WIND = "wind or forward flight"
_DRAWS = 10_000
_ALONG = 100.0  # condition number from which two rotors load the body along one line
_OTHER = 0.1  # share of the false alarms that is left to what no single cause explains [1]
_BUILD, _WIDE = "an uneven build of this vehicle", "flights of this vehicle differ more than usual"


@dataclass(frozen=True, eq=False)
class FlightEvidence:
    """One explanation: its direction in the readings, its size and misfit."""

    cause: str
    size: float  # change of that rotor's drive [1]
    half: float  # half width of its 95 % interval [1]
    t: float  # size over its standard deviation [1]
    chi2: float  # misfit that remains [1]


@dataclass(frozen=True, eq=False)
class FlightVerdict:
    """Verdict in the words of the diagnosis: none, named, class, unknown or insufficient.

    Attributes
    ----------
    verdict : str
        As above.
    effects : tuple of str
        Causes; of a class all members.
    why : str
        The rule that answered.
    explanations : tuple of FlightEvidence
        All, best first.
    readings : (B,) float
        Change of the log of each rotor's share of the drive [1].
    scatter : float
        Standard deviation of a share between healthy flights, or between vehicles where none is given [1].
    visible : float
        Smallest change of one rotor's drive that would be named here [1].
    accused, healthy : int
        Healthy flights accused when each is judged by the others, of how many.
    rate95 : (float, float)
        95 % interval of that rate (Clopper and Pearson) [1].
    total : float
        Change of the total drive against the healthy mean [1].
    total_half : float
        Its 95 % half width from the healthy scatter [1].
    rule : str
        Name of the rule that answered.
    given : int
        Healthy flights to compare with.
    """

    verdict: str
    effects: tuple[str, ...]
    why: str
    explanations: tuple[FlightEvidence, ...]
    readings: Array
    scatter: float = float("nan")
    visible: float = float("nan")
    accused: int = 0
    healthy: int = 0
    rate95: tuple[float, float] = (0.0, 1.0)
    total: float = float("nan")
    total_half: float = float("nan")
    rule: str = ""
    given: int = 0


def features(log: FlightLog) -> Array | None:
    """Log of the mean drive of each rotor in flight.

    Parameters
    ----------
    log : FlightLog
        The flight.

    Returns
    -------
    (B,) float or None
        Of commands (the same in every log), or of squared speeds where there is no command; None without a flight [1].
    """
    on = log.flying
    if on.sum() < 50:
        return None
    drive = log.command if log.command is not None else None if log.rpm is None else log.rpm**2
    if drive is None:
        return None
    mean = drive[on].mean(axis=0)
    return np.log(mean) if np.all(mean > 0.0) else None


def axes_of(layout: Array | None, rotors: int) -> Array:
    """Rows that take roll, pitch and yaw from the logs of the drives.

    Parameters
    ----------
    layout : (B, 3) float or None
        As :func:`bemt.flight.layout.layout_of` gives it; None: any rows without the total.
    rotors : int
        Number of rotors.

    Returns
    -------
    (k, B) float
        Orthogonal to the total; the root mean square of a row is 1/B [1].
    """
    inner = np.eye(rotors) - 1.0 / rotors
    if layout is None:
        free: Array = np.linalg.svd(inner)[2][: rotors - 1] / np.sqrt(rotors)
        return free
    rows = effect_matrix(layout)[:3] @ inner
    q, r = np.linalg.qr(rows.T)
    found: Array = (q * np.sign(np.diag(r))).T[np.abs(np.diag(r)) > 1e-9] / np.sqrt(rotors)
    return found


def judge(
    flight: Array,
    healthy: Sequence[Array],
    layout: Array | None,
    false_alarm: float = FALSE_ALARM,
    windy: bool = False,
) -> FlightVerdict:
    """Judge a flight by healthy ones.

    Parameters
    ----------
    flight : (B,) float
        Features of the flight [1].
    healthy : sequence of (B,) float
        Features of healthy flights of the same vehicle [1].
    layout : (B, 3) float or None
        Angles [rad], turning [1] and arms; None: no weights are tried, and every rotor stands for itself.
    false_alarm : float
        Accepted probability that a healthy flight is accused [1].
    windy : bool
        Whether the rotors met wind that they do not meet in the healthy flights: it tilts the body, so roll and pitch
        may change in any way, and yaw does not.

    Returns
    -------
    FlightVerdict
        With the error rate of the same rule on the healthy flights.
    """
    from scipy import stats

    calm = np.array(healthy).reshape(-1, flight.size)
    said = _decide(flight, calm, layout, false_alarm, windy)
    if len(healthy) < _LEAST:
        return said
    rest = [_decide(h, np.delete(calm, k, axis=0), layout, false_alarm) for k, h in enumerate(calm)]
    accused = sum(r.verdict in ("named", "class", "unknown") for r in rest)
    interval = stats.binomtest(accused, len(rest)).proportion_ci(method="exact")
    return replace(said, accused=accused, healthy=len(rest), rate95=(float(interval.low), float(interval.high)))


@dataclass(frozen=True, eq=False)
class _Prediction:
    """A healthy flight as the others predict it: mean and standard deviation of the readings, and draws, whitened."""

    mean: Array  # (k,)
    sd: Array  # (k,)
    draws: Array  # (draws, k), over sd


def _predicted(calm: Array, axes: Array, known: bool) -> _Prediction:
    n, k = len(calm), len(axes)
    x = calm @ axes.T
    own = np.sum((x - x.mean(axis=0)) ** 2, axis=0) if n else np.zeros(k)
    common = (float(own.sum()) + SCATTER_FREE * SCATTER**2) / (k * max(n - 1, 0) + SCATTER_FREE)
    free = max(n - 1, 0) + _COMMON
    s2 = (own + _COMMON * common) / free
    trim = np.array(TRIM)[:k] if known and k == 3 else np.full(k, max(TRIM))
    rng = np.random.default_rng(20)
    drawn = s2 * free / rng.chisquare(free, (_DRAWS, k))
    width = trim**2 * TRIM_FREE / rng.chisquare(TRIM_FREE, (_DRAWS, 1))

    def variance(s: Array, w: Array) -> Array:
        return s + 1.0 / (n / s + 1.0 / w)

    sd = np.sqrt(variance(s2, trim**2))
    mean = x.sum(axis=0) / s2 / (n / s2 + 1.0 / trim**2) if n else np.zeros(k)
    return _Prediction(mean, sd, rng.normal(size=(_DRAWS, k)) * np.sqrt(variance(drawn, width)) / sd)


@dataclass(frozen=True, eq=False)
class _Query:
    """What the rules ask of a flight."""

    said: FlightVerdict  # the answer without a verdict
    best: FlightEvidence
    alike: tuple[str, ...]  # causes that explain it as well as the best
    pairs: list[FlightEvidence]
    blown: float  # misfit of wind; infinite where none is known of
    square: float  # of the whitened readings
    bar: float  # of the best cause's statistic
    gate: float  # of the square
    most: float  # misfit that a cause may leave
    few: bool

    @property
    def accused(self) -> bool:
        """Whether a single cause stands out."""
        return self.best.t >= self.bar

    @property
    def fits(self) -> bool:
        """Whether the best single cause leaves little."""
        return self.best.chi2 < self.most or self.best.chi2 < 0.25 * self.best.t**2

    @property
    def two(self) -> tuple[str, ...]:
        """Pairs of rotors that explain what no single cause does."""
        good = [e for e in self.pairs if e.chi2 < self.most and e.chi2 < self.best.chi2 - 2.0 * EARNED]
        return tuple(e.cause for e in good if e.chi2 - good[0].chi2 < ALIKE)

    def answer(self, verdict: str, effects: tuple[str, ...], why: str, rule: str) -> FlightVerdict:
        """The answer with a verdict."""
        return replace(self.said, verdict=verdict, effects=effects, why=why, rule=rule)


def _within(q: _Query) -> FlightVerdict | None:
    if q.accused or (q.square >= q.gate and q.best.chi2 >= q.most):
        return None
    if not q.few:
        return q.answer("none", (), "no more than healthy flights differ", "within the healthy scatter")
    why = "no motor stands out by more than in healthy vehicles; give three or more healthy flights with --healthy"
    return q.answer("insufficient", (), why, "too few healthy flights")


def _few(q: _Query) -> FlightVerdict | None:
    if not q.few:
        return None
    causes = (*(q.alike if q.accused else ()), *(() if q.fits else q.two))
    why = "more than healthy vehicles show; three or more healthy flights of this one (--healthy) would tell"
    rest = _WIDE if q.said.given else _BUILD
    return q.answer("class", (*causes, rest), why, "beyond other healthy vehicles")


def _single(q: _Query) -> FlightVerdict | None:
    if not (q.accused and q.fits):
        return None
    causes = q.alike
    # Two damaged rotors side by side that turn against each other load the body as a weight between them.
    if q.best.cause.startswith("weight"):
        causes += tuple(e.cause for e in q.pairs if e.chi2 <= q.best.chi2 and e.t > 2.0)
    if len(causes) == 1:
        return q.answer("named", causes, "one cause explains the balance, the others do not", "one cause")
    return q.answer("class", causes, "these explain the balance equally well", "causes that look alike")


def _wind(q: _Query) -> FlightVerdict | None:
    return (
        q.answer("named", (WIND,), "roll and pitch changed as wind changes them", "wind") if q.blown < q.most else None
    )


def _two(q: _Query) -> FlightVerdict | None:
    if not q.two:
        return None
    why = "no single cause explains the balance; two damaged rotors do"
    said = q.answer("named" if len(q.two) == 1 else "class", q.two, why, "two rotors")
    return replace(said, explanations=(*(e for e in q.pairs if e.cause in q.two), *said.explanations))


def _unlisted(q: _Query) -> FlightVerdict | None:
    why = "the balance moved, but not as one or two rotors or one weight move it"
    return q.answer("unknown", (), why, "no listed cause")


_RULES = (_within, _few, _single, _wind, _two, _unlisted)
"""In order: the first that holds answers."""


def _decide(flight: Array, calm: Array, layout: Array | None, alarm: float, windy: bool = False) -> FlightVerdict:
    query = _weighed(flight, calm, layout, alarm, windy)
    return next(said for rule in _RULES if (said := rule(query)) is not None)


def _weighed(flight: Array, calm: Array, layout: Array | None, alarm: float, windy: bool) -> _Query:
    from scipy import stats

    B, n = flight.size, len(calm)
    change = flight - (calm.mean(axis=0) if n else flight.mean())
    axes, ways = axes_of(layout, B), directions(B, layout)
    p = _predicted(calm, axes, layout is not None)
    z = (flight @ axes.T - p.mean) / p.sd
    D = np.stack([axes @ way for way in ways.values()]) / p.sd
    length = np.linalg.norm(D, axis=1)
    T, null = D / length[:, None] @ z, p.draws @ (D / length[:, None]).T
    bar = float(np.quantile(null.max(axis=1), 1.0 - (1.0 - _OTHER) * alarm))
    half = np.quantile(np.abs(null), 0.95, axis=0) / length
    found = [
        FlightEvidence(cause, float(t / w), float(h), float(t), float(z @ z - t * t))
        for cause, t, w, h in zip(ways, T, length, half, strict=True)
    ]
    found.sort(key=lambda e: (e.t <= 0.0, e.chi2))
    square = np.sum(p.draws**2, axis=1)
    rest = square - np.max(null, axis=1).clip(0.0) ** 2
    totals = calm.mean(axis=1)
    spread = float(stats.t.ppf(0.975, n - 1) * totals.std(ddof=1) * np.sqrt(1.0 + 1.0 / n)) if n > 1 else float("nan")
    weakest = min(w for cause, w in zip(ways, length, strict=True) if cause.startswith("damaged"))
    said = FlightVerdict("none", (), "", tuple(found), change - change.mean(), float(np.sqrt(np.sum(p.sd**2))),
                         bar / float(weakest), total=float(change.mean()) if n else float("nan"), total_half=spread,
                         given=n)  # fmt: skip
    alike = tuple(e.cause for e in found if e.t > 0.0 and e.chi2 - found[0].chi2 < ALIKE)
    # What wind leaves: yaw, where the layout says which reading that is.
    blown = (float(z[2] ** 2) if layout is not None and z.size == 3 else 0.0) if windy else float("inf")
    if blown - found[0].chi2 < ALIKE:
        alike = (WIND, *alike)  # it is known to be there
    return _Query(said, found[0], alike, _pairs(D, z, list(ways), half * length), blown, float(z @ z), bar,
                  float(np.quantile(square, 1.0 - _OTHER * alarm)), float(np.quantile(rest, 1.0 - GATE)),
                  n < _LEAST)  # fmt: skip


def _pairs(D: Array, z: Array, names: list[str], half: Array) -> list[FlightEvidence]:
    """Two damaged rotors, both with a loss, best first; the size is that of the smaller one."""
    out = []
    blades = [i for i, name in enumerate(names) if name.startswith("damaged")]
    for i, j in combinations(blades, 2):
        pair = D[[i, j]].T
        if np.linalg.cond(pair) > _ALONG:
            continue
        size, *_ = np.linalg.lstsq(pair, z, rcond=None)
        if size.min() <= 0.0:
            continue
        u = np.sqrt(np.diag(np.linalg.inv(pair.T @ pair)))
        k = int(np.argmin(size))
        a, b = (name.rsplit(" ", 1)[1] for name in (names[i], names[j]))
        misfit = float(np.sum((z - pair @ size) ** 2))
        out.append(FlightEvidence(f"damaged blades, motors {a} and {b}", float(size[k]), float(half[i] * u[k]),
                                  float(size[k] / u[k]), misfit))  # fmt: skip
    return sorted(out, key=lambda e: e.chi2)


def _neighbours(motors: list[int], angle: Array) -> list[tuple[int, int]]:
    """Motors side by side with more than 50 degrees between them."""
    order = sorted(motors, key=lambda k: float(angle[k]) % (2.0 * np.pi))
    pairs = list(zip(order, [*order[1:], order[0]], strict=True))
    return [(i, j) for i, j in pairs if np.radians(50.0) < (angle[j] - angle[i]) % (2.0 * np.pi) < np.radians(170.0)]


def directions(B: int, layout: Array | None) -> dict[str, Array]:
    """Change of the log shares of each cause, (B,), for unit change of that rotor's drive."""
    out = {f"damaged blade, motor {k + 1}": np.eye(B)[k] for k in range(B)}
    if layout is not None:
        A = effect_matrix(layout)
        back = np.linalg.pinv(A)
        out = {name: back @ A @ d for name, d in out.items()}
        places: dict[tuple[float, ...], list[int]] = {}
        for k in range(B):
            places.setdefault(tuple(np.round(A[:2, k], 6)), []).append(k + 1)
        level = back @ np.diag([1.0, 1.0, 0.0, 1.0])
        for motors in places.values():
            where = f"motor {motors[0]}" if len(motors) == 1 else f"motors {' and '.join(map(str, motors))}"
            out[f"weight near {where}"] = level @ A[:, motors[0] - 1]
        for i, j in _neighbours([motors[0] - 1 for motors in places.values()], layout[:, 0]):
            a, b = sorted((i + 1, j + 1))
            out[f"weight between motors {a} and {b}"] = level @ (A[:, i] + A[:, j]) / 2.0
    return {cause: d - d.mean() for cause, d in out.items()}

"""The answer of the judge, of which text, JSON, figures and report are views, and where its mismatch sits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.compare.sentences import WORD
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.explanation import UNKNOWN, Explanation, Sizes
from bemt.judge.loss import CLAIMS, Decision
from bemt.physics import effects

if TYPE_CHECKING:
    from bemt.judge.compare.recordings import RunChange
    from bemt.judge.diagnose import form
    from bemt.judge.diagnose import suggest as suggestion
    from bemt.judge.diagnose.posterior import Evidence
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate

_BINS = 12
# Variables that explain the mismatch this nearly as well as the best one are ties: many of them move together.
_TIE = 0.04
# The one along which the preferred effect acts by its nature may explain less by this: groups are not as fine for all.
_TIE_NATURAL = 0.1
_ORDER = ("J", "M_tip", "Re", "rpm", "wall_distance_m", "tip_gap_m", "sideslip_rad", "time_s", "temperature_K",
          "density_kg_m3", "voltage_V", "current_A", "pwm_s", "run")  # fmt: skip
CHANNEL_WORDS = {"thrust_N": "thrust", "torque_Nm": "torque", "rpm": "speed of rotation"}
POWER = "electrical_power_W"
VARIABLES = {
    "J": ("advance ratio", "", 2), "M_tip": ("tip Mach number", "", 2), "Re": ("Reynolds number", "", 0),
    "rpm": ("speed of rotation", " rev/min", 0), "time_s": ("time", " s", 0), "temperature_K": ("temperature", " K", 1),
    "wall_distance_m": ("wall distance", " m", 3), "tip_gap_m": ("tip gap", " m", 5),
    "sideslip_rad": ("sideslip", " rad", 2), "density_kg_m3": ("density", " kg/m3", 3),
    "voltage_V": ("voltage", " V", 2), "current_A": ("current", " A", 1), "pwm_s": ("pulse width", " s", 6),
    "pressure_Pa": ("pressure", " Pa", 0), "run": ("run", "", 0),
}  # fmt: skip
"""Words, unit and digits."""
_PERCENT = (0.5, 2.0)  # ratios between these are said in percent


def share(v: float) -> str:
    """Change of a load, less 1: in percent, as a factor where it is large.

    >>> share(0.123), share(1.5), share(-0.9), share(-2.4)
    ('+12.3 %', 'x2.5', 'x0.1', 'x-1.4')
    """
    return f"{v:+.1%}".replace("%", " %") if _PERCENT[0] < 1.0 + v < _PERCENT[1] else f"x{1.0 + v:.3g}"


@dataclass(frozen=True)
class Stretch:
    """Part of an interval over which a channel is off to one side."""

    # Ends of the covariate, in its unit, and of the speed [rev/min]
    low: float
    high: float
    rpm: tuple[float, float]
    # Median there, or the farthest, and True, where most are far nearer [1]; and its standard uncertainty [1]
    size: float
    wide: bool
    u: float


@dataclass(frozen=True)
class Location:
    """An interval of one variable in one channel."""

    # Reading and covariate
    channel: str
    variable: str
    # Interval of the covariate, in its unit
    low: float
    high: float
    size: float  # Mean mismatch in the interval, share of the largest value of the channel at the speeds there [1]
    z: float  # Sum of the standardised mismatch over the root of the number of readings [1]
    ties: tuple[str, ...]  # Other variables that explain it as well in this plan
    # Median of the recording over the case there, over that of a reference, less 1, as a headline says it; NaN where
    # loads are near zero [1]
    ratio: float = field(default=float("nan"), compare=False)
    shared: float = field(default=0.0, compare=False)  # Standard uncertainty that all readings share, as stated [1]
    mismatch: Array = field(
        repr=False, compare=False, default_factory=lambda: np.empty(0)
    )  # (M,) Of every reading, in its unit; what `size` is the mean of
    # What the recording shows there beside the case, like `ratio`, or as a share of the largest value where that is NaN
    shown: tuple[Stretch, ...] = field(default=(), repr=False, compare=False)
    # The mismatch there, as a share of the largest value
    left: tuple[Stretch, ...] = field(default=(), repr=False, compare=False)

    def document(self) -> Mapping[str, object]:
        """Plain values for JSON."""
        return {k: (list(v) if isinstance(v, tuple) else v) for k, v in vars(self).items()
                if k not in ("mismatch", "ratio", "shown", "left")}  # fmt: skip

    @property
    def one_sided(self) -> bool:
        """Whether the recording is off to the side of the mismatch all over the interval."""
        return all((s.size > 0.0) == (self.size > 0.0) for s in self.shown)

    def sentence(self, words: Mapping[str, str]) -> str:
        """Which channel of the recording is off by how much and where, with ``words`` for the channels."""
        return self._told(words, self.shown, not np.isfinite(self.ratio))

    def rest(self, words: Mapping[str, str]) -> str:
        """The same of the mismatch, which is what an explanation leaves."""
        return self._told(words, self.left, True)

    def _told(self, words: Mapping[str, str], stretches: Sequence[Stretch], of_largest: bool) -> str:
        """How far off each stretch is, and where."""
        most = " of its largest value" if of_largest else ""
        most += " at that speed" if of_largest and (self.variable != "rpm" or self.high == self.low) else ""
        by_place: dict[str, list[str]] = {}
        for s in stretches:
            error = max(float(np.hypot(s.u, self.shared * (1.0 + s.size))), 1e-3)
            up = "up to " if s.wide else ""
            spread = "" if s.wide or not np.isfinite(error) else f" ± {100.0 * error:.1f}"
            told = f"{'high' if s.size > 0 else 'low'} by {up}{100.0 * abs(s.size):.1f}{spread} %{most}"
            if not of_largest and not _PERCENT[0] < 1.0 + s.size < _PERCENT[1]:
                ends = {True: "up to ", False: "down to "}[s.size > 0.0] if s.wide else ""
                told = f"{ends}{share(s.size)} of what the case gives"
            by_place.setdefault(self._place(s), []).append(told)
        name = "" if self.by_speed else f"{VARIABLES.get(self.variable, (self.variable,))[0]} "
        each = [f"{' and '.join(told)}, at {'' if k else name}{place}"
                for k, (place, told) in enumerate(by_place.items())]  # fmt: skip
        return f"{words[self.channel].capitalize()} is {', '.join(each[:-1])}{', and ' * (len(each) > 1)}{each[-1]}."

    def _place(self, s: Stretch) -> str:
        """Where a stretch is."""
        _, unit, digits = VARIABLES.get(self.variable, (self.variable, "", 3))
        ends = " to ".join(dict.fromkeys(f"{x:.{digits}f}" for x in (s.low, s.high))) + unit
        speeds = f"{' to '.join(dict.fromkeys(f'{n:.0f}' for n in s.rpm))} rev/min"
        return speeds if self.by_speed else f"{ends} ({speeds})" if self.variable in ("M_tip", "Re") else ends

    @property
    def by_speed(self) -> bool:
        """Whether the mismatch follows the speed of rotation as well as it follows what goes with it."""
        return self.variable == "rpm" or (self.variable in ("M_tip", "Re") and "rpm" in self.ties)


def locate(found: Evidence, best: fitting.Fit) -> Location:
    """Find channel, variable and interval of the mismatch."""
    natural = tuple(v for i in best.ids for v in effects.catalogue()[i].along)
    free_of_nuisances = np.asarray(found.problem.residual - fitting.smooth(found, best))
    return _largest(found, free_of_nuisances, natural)


def bare(found: Evidence) -> Location:
    """Find channel, variable and interval in which the recording itself is farthest from the case."""
    seen = _largest(found, found.problem.y - found.problem.f0, ())
    return replace(seen, shared=max(p.record.gain.get(seen.channel, 0.0) for p in found.problem.parts))


def _largest(found: Evidence, d: Array, natural: tuple[str, ...]) -> Location:
    """Largest scan statistic of a mismatch, (M,) in the unit of each reading."""
    problem = found.problem
    e = d / (problem.u * found.states[0].hyper.scale)
    free = problem.free
    channel = max(np.unique(problem.channel), key=lambda c: float(np.sum(e[(problem.channel == c) & free] ** 2)))
    here = (problem.channel == channel) & free
    scores = {}
    for name in _ORDER:
        if name not in problem.covariates:
            continue
        x = problem.covariates[name][problem.point][here]
        if np.ptp(x) > 1e-6 * max(float(np.max(np.abs(x))), 1e-12):
            scores[name] = _explained(x, e[here])
    if not scores:
        name = "rpm"
        ties: tuple[str, ...] = ()
    else:
        top = max(scores.values())
        tied = [n for n, s in scores.items() if s >= top - _TIE]
        name = next((n for n in natural if scores.get(n, -np.inf) >= top - _TIE_NATURAL), tied[0])
        ties = tuple(n for n in tied if n != name)
    x = problem.covariates[name][problem.point][here]
    low, high, z = _scan(x, e[here])
    inside = (x >= low) & (x <= high)
    size = float(np.mean((d / problem.largest)[here][inside]))
    f0 = problem.f0[here][inside]
    largest = problem.largest[here][inside]
    known = np.abs(problem.f0) > _NEAR_ZERO * problem.largest_computed
    loaded = bool(np.all(known[here][inside]))
    known = known & (problem.channel == channel) & ~free
    usual = float(np.median(problem.y[known] / problem.f0[known])) if known.any() else 1.0
    beside = problem.y[here][inside] / usual - f0
    ratio = float(np.median(beside / f0)) if loaded else float("nan")
    n = problem.covariates["rpm"][problem.point][here][inside]
    u = problem.u[here][inside] * found.states[0].hyper.scale
    shown = stretches(x[inside], n, beside / (f0 if loaded else largest), u / np.abs(f0 if loaded else largest))
    left = stretches(x[inside], n, d[here][inside] / largest, u / largest)
    return Location(CHANNELS[int(channel)], name, low, high, size, z, ties, ratio, 0.0, d, shown, left)


def stretches(x: Array, rpm: Array, off: Array, u: Array) -> tuple[Stretch, ...]:
    """Stretches of x over which ``off`` is on one side, in order; both sides over all of x where they alternate."""
    group = _groups(x)
    each = [group == g for g in np.unique(group)]
    middle = np.array([np.median(off[here]) for here in each])
    noise = np.array([np.median(u[here]) / np.sqrt(here.sum()) for here in each])
    side = np.where(np.abs(middle) > _SEEN * noise, np.sign(middle), 0.0)
    # what is on neither side goes with what is before it, and at the start with what comes
    first = np.flatnonzero(side)[:1]
    before = np.maximum.accumulate(np.where(side != 0.0, np.arange(side.size), first if first.size else 0))
    turns = np.diff(side[before]) != 0.0
    parts = np.split(np.arange(side.size), np.flatnonzero(turns) + 1)
    everywhere = np.ones(x.size, dtype=bool)
    if len(parts) > _MOST_STRETCHES:
        parts = [np.flatnonzero(np.sign(middle) == s) for s in side[before[:1]] * [1.0, -1.0]]
    out = []
    for part in parts:
        here = everywhere if len(parts) == 1 or turns.sum() >= _MOST_STRETCHES else np.isin(group, part)
        size, wide = _typical(middle[part], 1.0)
        if not wide:
            size = float(np.median(off[np.isin(group, part)]))
        ends = float(x[here].min()), float(x[here].max())
        of = float(rpm[here].min()), float(rpm[here].max())
        out.append(Stretch(*ends, of, size, wide, float(np.median(u[here]) / np.sqrt(here.sum()))))
    return tuple(out)


def _typical(off: Array, most: float = 0.9) -> tuple[float, bool]:
    """Median; or how far this share of them goes at most, and True, where the median says too little [1]."""
    order = np.argsort(np.abs(off))
    median, far = float(np.median(off)), float(off[order[int(most * (off.size - 1))]])
    wide = abs(far) > _FAR and abs(median) < 0.5 * abs(far)
    return (far if wide else median), wide


def _groups(x: Array) -> NDArray[np.intp]:
    """Group of each value: distinct values where there are few, quantiles otherwise."""
    order = np.argsort(x, kind="stable")
    step = np.diff(x[order]) > 0.01 * float(np.ptp(x))
    group = np.empty(x.size, dtype=np.intp)
    group[order] = np.cumsum(np.r_[0, step])
    if group.max() + 1 > _BINS:
        rank = np.empty(x.size, dtype=np.intp)
        rank[order] = np.arange(x.size)
        group = rank * _BINS // x.size
    return group


def _explained(x: Array, e: Array) -> float:
    """Share of the squares of e that its means over groups of x explain, less what chance would give."""
    group = _groups(x)
    count = np.bincount(group).astype(float)
    mean = np.bincount(group, e) / np.maximum(count, 1.0)
    total = float(e @ e)
    explained = float(np.sum(count * mean**2))
    k = int(np.sum(count > 0))
    return (explained - k) / max(total, 1e-12)


def _scan(x: Array, e: Array) -> tuple[float, float, float]:
    """Interval of the groups of x with the largest sum of e over the root of its size."""
    group = _groups(x)
    labels = np.unique(group)
    best = (float(x.min()), float(x.max()), 0.0)
    for i in range(labels.size):
        for j in range(i, labels.size):
            inside = (group >= labels[i]) & (group <= labels[j])
            z = float(np.sum(e[inside]) / np.sqrt(inside.sum()))
            if abs(z) > abs(best[2]):
                best = (float(x[inside].min()), float(x[inside].max()), z)
    return best


# Computed loads below this share of the largest have no ratio; departures above it are said where the median is small.
_NEAR_ZERO, _FAR = 0.1, 0.05
# Standard uncertainties from which on a side is seen, and stretches that are told one by one.
_SEEN, _MOST_STRETCHES = 2.0, 3


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of all recordings, stacked: (M,) values, with (P,) variables of the points that they belong to."""

    channels: tuple[str, ...]
    values: Array  # (M,) [units of the channel]
    u: Array  # (M,) standard uncertainty [units of the channel]
    channel: NDArray[np.intp]  # (M,) place in CHANNELS
    point: NDArray[np.intp]  # (M,) place in the variables
    tested: NDArray[np.bool_]  # (M,) False: of a reference
    variables: dict[str, Array]  # (P,) each
    notes: tuple[str, ...]
    findings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Baseline:
    """Model of the case without any cause."""

    effects: tuple[effects.Effect, ...]
    values: Array  # (M,) [units of the channel]
    level: dict[str, float]  # Median of each load over what the case gives, less 1 [1]


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the readings say of the explanations."""

    probability: dict[Explanation, float]  # Adds up to 1 [1]
    log_bayes: dict[Explanation, float]  # Natural logarithm of the odds over nothing, of each effect and the unknown
    inclusion: dict[str, float]  # That an effect is present, alone or in a pair [1]
    parameters: Sizes  # Of the leading explanation
    p_value: float  # Of as large a misfit without a cause [1]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is wrong, in named groups; text, JSON, figures and report are views of it."""

    found: Evidence  # Outcome of the weighing, with the problem in it
    decision: Decision  # Verdict of the evidence in the case
    said: Decision  # What is said in the end: with what the drive says
    best: fitting.Fit  # Leading explanation at its best setting
    parameters: Sizes  # Of the leading explanation
    p_value: float  # Of the gate [1]
    where: Location  # Of the mismatch; of the largest scatter when the verdict is none
    # Channel to RMSE in its unit: before, after, noise, gp_only, holdout_before, holdout_after; mean and largest
    # magnitude of the readings
    scores: dict[str, dict[str, float]]
    blocks: str  # What was left out in turn for the held-out scores
    # (M,) Readings as the improved model gives them: fitted, and each block from the others [units of the readings]
    after: Array
    held: Array
    settling: Callable[[], suggestion.Suggestion]  # Finds what would decide
    alike: form.Confusion  # Distances of effects in this plan
    absent: dict[str, str]  # Effects that could not be tried, and why
    # Of the motor's speed over pulse width, a problem of its own; None where it was not recorded
    drive: Diagnosis | None = None
    loads: Diagnosis | None = None  # Of thrust and torque, where they name nothing and the answer is that of the drive
    change: RunChange | None = None  # Change from the references, where there is one recording beside them

    @property
    def next(self) -> suggestion.Suggestion:
        """What would decide; found when it is asked for, as a run is planned by many solutions."""
        return self.settling()

    @property
    def readings(self) -> Readings:
        """What was measured."""
        p = self.problem
        channels = tuple(CHANNELS[c] for c in np.unique(p.channel))
        return Readings(channels, p.y, p.u, p.channel, p.point, p.free, p.covariates, p.notes, p.findings)

    @property
    def baseline(self) -> Baseline:
        """What the case gives there."""
        return Baseline(self.problem.baseline, self.problem.f0, self.problem.level)

    @property
    def prior(self) -> dict[Explanation, float]:
        """Probability of every explanation before a reading was looked at [1]."""
        return self.found.prior

    @property
    def explanations(self) -> tuple[Candidate, ...]:
        """Effects that were tried, with what each changes in the readings."""
        return self.found.candidates

    @property
    def posterior(self) -> Posterior:
        """What the readings say of them."""
        odds = {e: self.found.log_bayes(e) for e in (*map(Explanation.of, self.found.spans), UNKNOWN)}
        return Posterior(self.found.probability, odds, self.found.inclusion, self.parameters, self.p_value)

    @property
    def systems(self) -> dict[str, Mapping[str, object]]:
        """Verdict and effects of air, stand and drive, each for itself."""
        said = self.said
        listed = said.verdict in CLAIMS
        known = effects.catalogue()
        kinds = {i: known[i].kind if i in known else "drive" for i in said.effects}  # a law of the drive is no effect
        out: dict[str, Mapping[str, object]] = {}
        for system in ("air", "stand", "drive"):
            mine = [i for i, kind in kinds.items() if kind == system]
            word = ("none" if not mine else said.verdict) if listed else said.verdict
            if self.loads is not None and system != "drive":
                word = self.loads.decision.verdict
            out[system] = {"verdict": word, "effects": mine}
        if self.drive is not None and self.drive is not self:
            out["drive"] = {"verdict": self.drive.decision.verdict, "effects": list(self.drive.decision.effects)}
        elif not any("rpm" in p.channels for p in self.problem.parts):
            out["drive"] = {"verdict": "not recorded", "effects": []}
        return out

    @property
    def problem(self) -> Problem:
        """Readings, baseline, nuisances."""
        return self.found.problem

    @property
    def words(self) -> Mapping[str, str]:
        """What each channel is called: electrical power where that is all that stands for a torque."""
        electrical = any(p.record.electrical for p in self.problem.parts)
        return {**CHANNEL_WORDS, "torque_Nm": WORD[POWER]} if electrical else CHANNEL_WORDS

    @property
    def in_reference(self) -> tuple[str, ...]:
        """Effects of the answer that the case leaves out and the reference shows as well."""
        return tuple(i for i in self.said.effects if i in self.problem.shared)

    @property
    def off(self) -> dict[str, tuple[float, bool]]:
        """How far each channel is from the case: median of the ratio, less 1 [1]; or how far most go, and True."""
        p, out = self.problem, {}
        for c, name in enumerate(CHANNELS):
            here = (p.channel == c) & p.free
            here &= np.abs(p.f0) > _NEAR_ZERO * np.max(np.abs(p.f0), where=here, initial=0.0)
            if here.any():
                out[name] = _typical(p.y[here] / p.f0[here] - 1.0)
        return out

    @property
    def marked(self) -> Location | None:
        """Location of the mismatch; None without one."""
        return None if self.decision.verdict == "none" else self.where

"""The next measurement: of runs that one can afford, the one that separates the surviving explanations best."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import whitener
from bemt.base.units import ZERO_CELSIUS, suffixes
from bemt.data.readers.left_open import kept_beside
from bemt.data.readers.recording_toml import QUANTITIES
from bemt.data.recordings.shown import options_of
from bemt.judge.compare.change_document import AIR_OF_BOTH, DAYS
from bemt.judge.compare.drive_laws import title_of
from bemt.judge.compare.slips import other_fluid
from bemt.judge.diagnose import noise
from bemt.judge.diagnose.assemble import assemble
from bemt.judge.diagnose.form import ALIKE
from bemt.judge.diagnose.problem import Part, Problem
from bemt.judge.diagnose.record import CHANNELS, STILL, Record
from bemt.judge.diagnose.repeats import conditions
from bemt.judge.diagnose.signatures import actual_unit, effect_of
from bemt.judge.loss import minutes
from bemt.physics import effects
from bemt.physics.air import R_DRY
from bemt.physics.bem import model as bem
from bemt.physics.effects.unit_slip import LOADS
from bemt.rotors.model import air_of_points

if TYPE_CHECKING:
    from bemt.judge.diagnose.posterior import Evidence

REFERENCE = (
    "a reference run: the same stand and points with the rotor before the change, or with another one of this type "
    "that is known to be right"
)
"""The run that settles most: it shows how far model and stand differ anyway."""

WHOSE = "state the rotor that was measured: its label, or its diameter, pitch and blades in the case"
"""Where another rotor fits the readings better than that of the case."""

# Tip Mach number from which incompressible flow is some per cent off.
_COMPRESSIBLE = 0.3
# Loads of a run and its reference that differ by such a share may be of days of different density.
_DAYS = 0.03, 0.15

LEVEL = 0.1
"""A load off the case by more than this, at usual, is no agreement, even if calibration may be that far off [1]."""

_NOTHING = "nothing"  # what a run separates an effect from where no cause is the rival
_POINTS = 4
_FASTER = 1.1  # A run less fast than that shows little that the recording does not: declared [1]
# Speed over the highest below which a controller stalls and a cell reads a twenty-fifth of its load: declared [1]
_SLOWEST = 0.2
_ENOUGH = ALIKE
# A run is worth its time if it takes away this much doubt; no explanation counts less than the least.
_WORTH, _LEAST = 0.02, 1e-6


@dataclass(frozen=True)
class Given:
    """What was asked, as a command line has it."""

    # Files
    recordings: tuple[str, ...] = ("RECORDING",)
    references: tuple[str, ...] = ()
    case: str = "--case CASE"
    rest: str = ""  # Other options
    ruled_out: tuple[str, ...] = ()  # Effects that a check has ruled out
    changed: tuple[str, ...] = ()  # Effects that the user says he changed
    stated: Mapping[str, Sequence[str]] = field(default_factory=dict)  # Of the columns: unit, column and sign

    def command(self, run: str = "", reference: str = "", ruled_out: str = "") -> str:
        """Command that diagnoses the same again, with one more file or one effect less."""
        said = {"--reference": (*self.references, reference), "": (self.case, self.rest, *options_of(self.stated)),
                "--changed": tuple(k for k in self.changed if k != ruled_out),
                "--ruled-out": (*self.ruled_out, ruled_out)}  # fmt: skip
        words = (word for option, own in said.items() if any(own) for word in (option, *own))
        return " ".join(filter(None, ["bemt diagnose", *self.recordings, run, *words]))

    def comparison(self, reference: str) -> str:
        """Command that sets the first recording beside a reference."""
        return " ".join(["bemt compare", reference, self.recordings[0], *options_of(self.stated)])

    def kept(self, option: str, fact: str) -> tuple[str, ...]:
        """Commands that keep what is stated of each table, and one more fact, in a file, and diagnose that instead."""
        facts = [f for f in self.stated.get(option, ()) if f.partition("=")[0] != fact.partition("=")[0]]
        told = " ".join(options_of({**self.stated, option: [*facts, fact]}))
        paths = [Path(shlex.split(f)[0]) for f in self.recordings]
        if any(p.suffix == ".toml" for p in paths):
            return ()  # whose lines are to be changed by hand
        files = kept_beside(paths)
        imports = (f"bemt import {f} {told} --out {k}" for f, k in zip(self.recordings, files, strict=True))
        return *imports, replace(self, recordings=tuple(files), stated={}).command()

    def of_days(self) -> tuple[str, ...]:
        """Command that compares with each reference in the air of both days."""
        return tuple(f"{self.comparison(file)} {AIR_OF_BOTH}" for file in self.references or ("REFERENCE",))


@dataclass(frozen=True)
class Suggestion:
    """A run, and what it would do."""

    text: str  # What to do
    # "run", "reference" (a run without the cause), "look" (a check or a correction without a run), "mend" (the
    # recording), "case" (state the rotor), "air" (write it down), "cfd" (compute again), or "" for nothing
    kind: str
    points: tuple[dict[str, float], ...] = ()  # Operating points: rpm, airspeed_m_s and what else is set
    separates: tuple[str, ...] = ()  # The two explanations
    # Distance of the two in standard deviations, now and with the run [1]
    before: float = 0.0
    after: float = 0.0
    commands: tuple[str, ...] = ()  # What to type then; after a check, if the effect is not there
    checks: str = ""  # Effect that a check looks for
    minutes: float = 0.0  # Time that it takes on a stand [min]
    gain: float = 0.0  # Expected share of the doubt between the explanations that it takes away [1]
    otherwise: Suggestion | None = None  # What to do if there can be no such reference or run, or nothing to mend

    @property
    def tells(self) -> str:
        """What it separates, in words; "" for nothing."""
        names = ("no cause" if k == _NOTHING else title_of(k) for k in self.separates)
        return f"tells {' from '.join(names)}" if self.separates else ""

    def document(self) -> Mapping[str, object]:
        """Plain values for JSON."""
        return {"text": self.text, "points": [dict(p) for p in self.points], "separates": list(self.separates),
                "distance_before": self.before, "distance_after": self.after, "kind": self.kind,
                "commands": list(self.commands), "checks": self.checks, "minutes": self.minutes, "gain": self.gain,
                "otherwise": None if self.otherwise is None else self.otherwise.document()}  # fmt: skip


@dataclass(frozen=True)
class _Option:
    text: str
    rpm: Array
    V: Array
    change: dict[str, float]
    extra: dict[str, Array]


def _options(part: Part) -> list[_Option]:
    """Runs that this stand can do, around what was recorded: one that never had wind is a bench without a tunnel."""
    record, f = part.record, part.flow
    D = 2.0 * f.R
    low, high = float(record.rpm.min()), min(float(record.rpm.max()), record.top_rpm)
    middle = float(np.median(record.rpm))
    top_J = float(np.max(f.J))
    tip = float(np.max(f.M_tip))
    spread = np.linspace(low, high, _POINTS) if high > 1.05 * low else np.full(_POINTS, middle)
    now = {k: float(np.median(v)) for k, v in record.extra.items()}
    J0 = max(top_J, 0.6)

    def at(text: str, rpm: Array, V: Array, change: dict[str, float] | None = None, **extra: float) -> _Option:
        return _Option(text, rpm, V, change or {}, {k: np.full(rpm.size, v) for k, v in {**now, **extra}.items()})

    static, same = np.zeros(_POINTS), np.full(_POINTS, middle)
    again = f"repeat {low:.0f} to {high:.0f} rev/min"
    out = [
        at(f"static runs (no airspeed) at {low:.0f} to {high:.0f} rev/min", spread, static),
        at(f"{again} in air 15 % thinner (altitude, or a hot day)", spread, static, {"rho": 0.85}),
        at(f"{again} at 5 C instead of 35 C (cold air, same density)", spread, static,
           {"a_sound": (278.15 / 308.15) ** 0.5}),
        at("repeat the first points after 30 minutes of running", spread, static,
           time_s=now.get("time_s", 0.0) + 1800.0),
    ]  # fmt: skip
    slow = max(0.4 * low, _SLOWEST * high)
    if slow < 0.6 * low:
        slower = np.linspace(slow, 0.8 * low, _POINTS)
        out.append(at(f"slower: static at {slow:.0f} to {0.8 * low:.0f} rev/min", slower, static))
    if top_J > STILL:
        wind = np.linspace(0.2, 1.15 * J0, _POINTS) * middle / 60.0 * D
        out.append(at(f"runs in wind at {middle:.0f} rev/min, J 0.2 to {1.15 * J0:.2f}", same, wind))
    up = min(1.3, 0.85 / max(tip, 1e-6), record.top_rpm / high)
    if tip < 0.75 and up >= _FASTER:
        faster = np.linspace(1.0, up, _POINTS) * high
        out.append(at(f"faster: static at {high:.0f} to {up * high:.0f} rev/min", faster, static))
    if "wall_distance_m" in record.extra:
        text = f"the same static runs with the wall {8 * f.R:.2f} m away"
        out.append(at(text, spread, static, wall_distance_m=8 * f.R))
    if f.ducted and "tip_gap_m" in record.extra:
        text = "the same static runs with twice the tip gap"
        out.append(at(text, spread, static, tip_gap_m=2 * now["tip_gap_m"]))
    once = _once_each(part)
    own = {k: v[once] for k, v in record.extra.items() if k not in ("run", "time_s")}
    return [*out, _Option(f"the same {once.size} points once more", record.rpm[once], record.V[once], {}, own)]


def _once_each(part: Part) -> NDArray[np.intp]:
    """One point of each condition of a recording, in their order."""
    record = part.record
    lengths = [v for k, v in record.extra.items() if k in ("wall_distance_m", "tip_gap_m")]
    label = conditions(record.rpm, part.flow.J, np.broadcast_to(record.air.rho, record.rpm.shape), lengths)
    first = np.unique(np.where(label < 0, -1 - np.arange(label.size), label), return_index=True)[1]
    return np.sort(first)


def _extended(alone: Problem, option: _Option) -> Problem:
    """Plan with the option's points appended to a recording; readings are those of the baseline."""
    (part,) = alone.parts
    old = part.record
    air_now = {k: float(np.median(getattr(old.air, k))) for k in ("rho", "mu", "a_sound", "temperature_K")}
    air = {k: np.full(option.rpm.size, v * option.change.get(k, 1.0)) for k, v in air_now.items()}
    if "a_sound" in option.change:
        air["temperature_K"] = air["temperature_K"] * option.change["a_sound"] ** 2
    join = np.concatenate
    extra = {k: join([v, option.extra.get(k, np.full(option.rpm.size, float(v[-1])))]) for k, v in old.extra.items()}
    if "run" in extra:
        extra["run"][-option.rpm.size :] = extra["run"].max() + 1.0
    rpm, V = join([old.rpm, option.rpm]), join([old.V, option.V])
    both = air_of_points({k: join([getattr(old.air, k), air[k]]) for k in air})
    plain = [e for e in part.baseline if not bem.acts_on_points(e)]
    flow = bem.flow_of(part.model.prepared(plain), rpm, V, both, extra, part.flow.chord)
    new = {"thrust_N": flow.T0, "torque_Nm": flow.Q0}
    filled = {c: join([old.measured[c], v[-option.rpm.size :]]) for c, v in new.items() if c in old.measured}
    u = {c: join([old.u[c], np.full(option.rpm.size, np.nan)]) for c in filled}
    record = Record(old.name, rpm, V, both, filled, u, extra, old.gain, old.zero, old.air_recorded)
    return assemble((replace(part, record=record, flow=flow, _solved={}),), like=alone)


def _of_cfd(found: Evidence) -> Suggestion:
    """What a study of CFD has for a next run: no stand, no other specimen, a set-up that may move the loads itself."""
    part = found.problem.parts[0]
    if not part.record.air_recorded and (fluid := _other_fluid(found.problem)):
        return Suggestion(fluid, "cfd")
    steps = ["a finer grid (cells x 2 or more)", "a larger domain"]
    steps += ["compressible air"] if float(np.max(part.flow.M_tip)) > _COMPRESSIBLE else []
    fastest = int(np.argmax(part.record.rpm))
    point = {"rpm": float(part.record.rpm[fastest]), "airspeed_m_s": float(part.record.V[fastest])}
    text = (
        f"one point again, {point['rpm']:.0f} rev/min, with {', with '.join(steps)}: what moves the loads is the set-up"
    )
    return Suggestion(text, "cfd", (point,))


def _other_fluid(problem: Problem) -> str:
    """Another fluid in which the loads would be those of the case, as far as rotors are known; "" where none is."""
    off, u = [], []
    for k, name in enumerate(CHANNELS[:2]):
        mine = np.flatnonzero((problem.channel == k) & problem.free)
        if problem.level.get(name, -1.0) > -1.0:
            off.append(np.log1p(problem.level[name]))
            shares = problem.of_real_rotors[np.ix_(mine, mine)] / np.outer(problem.f0[mine], problem.f0[mine])
            u.append(float(np.sqrt(np.mean(shares))))
    return other_fluid(off, u, float(np.median(problem.parts[0].flow.rho)))


def _points(record: Record, option: _Option) -> tuple[dict[str, float], ...]:
    """Operating points of a run, with what has to be set besides speed and airspeed."""
    rho = float(np.median(record.air.rho)) * option.change.get("rho", 1.0)
    T = float(np.median(record.air.temperature_K)) * option.change.get("a_sound", 1.0) ** 2
    changed = {}
    if option.change:
        changed = {"density_kg_m3": rho, "temperature_C": T - ZERO_CELSIUS, "pressure_Pa": rho * R_DRY * T}
    units = {"time_s": ("time_s", 1.0), "wall_distance_m": ("wall_distance_m", 1.0), "tip_gap_m": ("tip_gap_mm", 1e3)}
    more = {new: option.extra[old] * f for old, (new, f) in units.items() if old in option.extra}
    return tuple({"rpm": float(rpm), "airspeed_m_s": float(V), **changed, **{k: float(v[i]) for k, v in more.items()}}
                 for i, (rpm, V) in enumerate(zip(option.rpm, option.V, strict=True)))  # fmt: skip


def nothing_called_for(found: Evidence, rivals: Sequence[Rival], unknown: float) -> Suggestion:
    """What is left to say after "none": nothing to do, and what would show fainter causes.

    Nobody can take friction or compressibility away for a reference: a run that removes doubt is the other way.
    """
    if found.problem.parts[0].record.computed:
        return Suggestion("no further run is needed", "")
    if _referenced(found):
        return weather(found) or Suggestion("no further run is needed", "")
    best = suggest(found, rivals, unknown, reference=True)
    run = next((s for s in (best, best.otherwise) if s and s.kind == "run" and s.gain), None)
    level = max((abs(v) for v in found.problem.level.values()), default=0.0)
    text = "a reference run (the same rotor before the change): only that shows what the model's uncertainty hides"
    if level > LEVEL:
        text = f"{REFERENCE}; it shows whether the level comes from blade, stand or model"
    return Suggestion(text, "reference", otherwise=run)


def mended(found: Evidence, what: str, kind: str = "mend") -> Suggestion:
    """Put the recording right; where nothing is wrong with it, only a reference shows what else it may be."""
    known = _referenced(found) or found.problem.parts[0].record.computed
    reference = None if known else Suggestion(REFERENCE, "reference")
    return Suggestion(what, kind, otherwise=reference)


def weather(found: Evidence) -> Suggestion | None:
    """Air to be written down, where a run differs from its reference and nobody knows the air of both."""
    known = all(p.record.air_recorded for p in found.problem.parts)
    apart = 0.0 if known else _apart(found.problem)
    return Suggestion(DAYS, "air") if _DAYS[0] < apart < _DAYS[1] else None


def _apart(problem: Problem) -> float:
    """Largest share by which a load of the test differs from its reference, what the model changes taken out."""
    out = [0.0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = problem.y / problem.f0
    for c in np.unique(problem.channel):
        test, known = (ratio[(problem.channel == c) & (problem.free == free)] for free in (True, False))
        if test.size and known.size:
            out.append(abs(float(np.median(test) / np.median(known)) - 1.0))
    return max(out)


def _referenced(found: Evidence) -> bool:
    return any(p.record.reference for p in found.problem.parts)


def _with_reference(part: Part) -> Problem:
    """Plan with the same points measured once more without the cause; readings are those of the baseline.

    What every rotor has and the case leaves out is in both: such a run does not show it by itself.
    """
    f = part.flow
    own = {"thrust_N": f.T0, "torque_Nm": f.Q0}
    measured = {k: own.get(k, v) for k, v in part.record.measured.items()}
    both = assemble((part, replace(part, record=replace(part.record, measured=measured, reference=True))))
    return replace(both, shared=both.missing)


@dataclass(frozen=True)
class Rival:
    """An explanation that a run may tell from others: effect ("" for nothing), settings, probability [1]."""

    effect: str
    settings: Mapping[str, Any]
    probability: float


def suggest(found: Evidence, rivals: Sequence[Rival], unknown: float = 0.0, reference: bool = False) -> Suggestion:
    """Choose the run that takes away most doubt between explanations a minute, or a check where no run is worth it.

    With ``reference`` a run without the cause is one of the choices. ``unknown`` is the probability that nothing listed
    explains the readings: only a reference tells that from the listed ones.

    Notes
    -----
    The doubt is the probability that two draws of the explanation differ, sum over pairs of 2 p_i p_j. A run that takes
    the pair d standard deviations further apart leaves the share 2 Phi(-d/2) of it, the error of the best test (the
    pairwise bound on Bayes' error; discrimination of rival models: Hunter and Reiner, Technometrics 7, 1965, p. 307;
    Box and Hill, Technometrics 9, 1967, p. 57; neither checked). That a reference settles the unknown is an assumption.
    """
    if found.problem.parts[0].record.computed:
        return _of_cfd(found)
    lacking = reference and not _referenced(found)
    choices, total, before = _choices(found, rivals, unknown, lacking)
    # a run that leaves the two leading explanations alike is not worth it; what is told apart is rather looked at
    worth = [c for c in choices if c.gain * total >= _WORTH]
    able = [c for c in worth if c.kind == "reference" or c.after >= _ENOUGH]
    able.sort(key=lambda c: -c.gain / c.minutes)
    certain = before >= _ENOUGH and not reference
    # without doubt there is no rival to rule out
    names = [r.effect or _NOTHING for r in rivals[: 2 if total >= _WORTH else 1]]
    looked = look(names, found.problem.parts[0].record)
    # where no run is able to, one that tells only the others apart is better than nothing
    runs = [c for c in worth if c.kind == "run"]
    instead = looked or max(runs, key=lambda c: c.gain / c.minutes, default=None)
    if able and not (looked and certain):
        other = next((c for c in able if c.kind != able[0].kind), instead if able[0].kind == "reference" else None)
        return replace(able[0], otherwise=other)
    if looked:
        return replace(looked, before=before, after=before)
    if certain:
        return Suggestion("no further run is needed; none would tell more", "", before=before, after=before)
    if lacking:
        return replace(choices[-1], otherwise=instead)
    nothing = "no run that this stand can make separates them; the same points once more would not, either"
    return instead or Suggestion(nothing, "", before=before, after=before)


def _choices(
    found: Evidence, rivals: Sequence[Rival], unknown: float, lacking: bool
) -> tuple[list[Suggestion], float, float]:  # fmt: skip
    """Runs with what each takes away, the doubt that there is, and the distance of the two leading explanations."""
    from scipy.special import ndtr

    hyper, part = found.states[0].hyper, found.problem.parts[0]
    effect = [None if not r.effect else effect_of(r.effect, dict(r.settings)) for r in rivals]
    names = tuple(r.effect or _NOTHING for r in rivals[:2])
    p = np.array([max(r.probability, _LEAST) for r in rivals])
    share = p / (p.sum() + unknown)
    doubt = np.outer(share, share) - np.diag(share**2)
    of_unknown = 2.0 * float(share.sum()) * unknown / (p.sum() + unknown)
    total = float(doubt.sum()) + of_unknown
    alone = found.problem if len(found.problem.parts) == 1 else assemble(found.problem.parts[:1])
    now = _distances(alone, effect, hyper)

    def choice(text: str, kind: str, plan: Problem, points: int, at: tuple[dict[str, float], ...] = ()) -> Suggestion:
        there = _distances(plan, effect, hyper)
        told = np.sqrt(np.maximum(there**2 - now**2, 0.0))
        taken = float(np.sum(doubt * (1.0 - 2.0 * ndtr(-0.5 * told))))
        gain = (taken + (of_unknown if kind == "reference" else 0.0)) / total if total > 0.0 else 0.0
        return Suggestion(text, kind, at, names, float(now[0, 1]), float(there[0, 1]), minutes=minutes(kind, points),
                          gain=gain)  # fmt: skip

    choices = []
    for run in _options(part):
        with suppress(ValueError, FloatingPointError):
            plan = _extended(alone, run)
            choices.append(choice(run.text, "run", plan, run.rpm.size, _points(part.record, run)))
    if lacking:
        choices.append(choice(REFERENCE, "reference", _with_reference(part), len(part.record)))
    return choices, total, float(now[0, 1])


def _distances(plan: Problem, of: Sequence[effects.Effect | None], hyper: noise.Hyper) -> Array:
    """Distances between explanations in a plan, in standard deviations, (N, N); zero where one has no solution."""
    shown = [np.zeros(plan.y.size) if e is None else plan.signature((e,)) for e in of]
    white = whitener(noise.covariance(plan, hyper), plan.u)
    y = np.array([white(s) if np.isfinite(s).all() else np.full(s.size, np.nan) for s in shown])
    return np.asarray(np.nan_to_num(np.linalg.norm(y[:, None] - y[None], axis=-1)))


def look(names: Sequence[str], record: Record) -> Suggestion | None:
    """The quicker check by hand: that confirms the first explanation, or rules out the second; seldom what all see."""
    aims = [(check, aim, name) for aim, name in zip(("confirm", "rule out"), names, strict=False)
            if (check := _check(name, record))]  # fmt: skip
    if not aims:
        return None
    known = effects.catalogue()
    check, aim, name = min(aims, key=lambda one: (known[one[2]].evident, known[one[2]].check_minutes))
    return Suggestion(f"to {aim} {title_of(name)}, {check}", "look", checks=name, minutes=known[name].check_minutes)


def correction(names: Sequence[str], settings: Mapping[str, Mapping[str, Any]], record: Record) -> Suggestion | None:
    """What to put right in the stand or the file, where effects of the stand were found at such settings."""
    for name in names:
        cls = effects.catalogue().get(name)
        if cls is None or cls.kind != "stand" or not _check(name, record):
            continue
        text, found = _check(name, record), settings.get(name, {})
        if float(found.get("factor", 1.0)) < 0.0 and "channel" in found:
            what = "both loads" if found["channel"] == LOADS else found["channel"]
            text = f"reverse the sign of {what} (sign = -1 in a recording.toml), or turn the sensor round"
        return Suggestion(text, "look", commands=_restated(found, record))
    return None


def _restated(found: Mapping[str, Any], record: Record) -> tuple[str, ...]:
    """Option of `bemt import` and what it states of a channel, where a setting of unit_slip leaves a unit or a sign.

    It is the unit of the heading over the factor of the slip: km/h under which 0.278 of the speed is recorded are m/s.
    """
    channel = str(found.get("channel", ""))
    quantity = next((q for q, d in QUANTITIES.items() if channel in (q, f"{q}_{suffixes(d)[0]}")), "")
    if channel == LOADS:  # one sign without a name turns all
        return "sign", "-1"
    if not quantity or "unit" not in found:
        return ()
    if found["factor"] < 0.0:
        return "sign", f"{quantity}=-1"
    unit = actual_unit(channel, float(found["factor"]), record.declared)
    return ("unit", f"{quantity}={unit}") if unit else ()


def _check(name: str, record: Record) -> str:
    """How to check an effect without a run, on the stand of a recording."""
    cls = effects.catalogue().get(name)
    if cls is not None and cls.check_in_room and np.all(record.V > 0.0):
        return ""
    return "" if cls is None else cls.check

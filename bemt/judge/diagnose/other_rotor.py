"""The rotor of a recording: its blade as a reference shows it, and whether it is this rotor at all.

The blade is found on the real solver and kept in the baseline: y = f(c) + T (z - c), c the calibrated rotor, T its
tangents there.  The prior stays at the case: residuals refer to f(c) - T (c - mean of the prior), signatures of effects
to f(c) itself, and nothing counts twice (`bemt.rotors`).

A recording that is off by a factor of three in thrust is not one whose physics was left out: diameter, pitch, number of
blades, a unit or the speed is another one.  That question comes before the physics, with the likely slips in order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import log_density
from bemt.base.tables import number_text
from bemt.base.units import INCH
from bemt.judge.diagnose import noise
from bemt.judge.diagnose.record import CHANNELS
from bemt.physics.effects.base import Effect, RotorBuild
from bemt.rotors.as_measured import FACTOR
from bemt.rotors.case.as_built import known_from
from bemt.rotors.conditioning import condition, tangents
from bemt.rotors.latents import NAMES, UNITS, AsBuilt, Prior

if TYPE_CHECKING:
    from bemt.data.recordings.findings import Finding
    from bemt.judge.diagnose.problem import Problem
    from bemt.physics.effects.base import Effect, RotorBuild
    from bemt.rotors.case import Case

# Standard deviations without a reference, in the order of NAMES: angle [deg], lift, drag [1], camber [deg].  Working
# calibrations; a wide blade without a reference would swallow slips of speed and unit.
_PLAIN = (0.3, 0.03, 0.10, 0.0)
# With a reference, by how the blade is known.  One degree and more between published stations and blades (zero-thrust
# advance ratios of UIUC volumes 1 and 2); a label leaves the section and the law of the blade angle open as well.
_SD = {
    "cad": (0.1, 0.02, 0.05, 0.1), "scan": (0.5, 0.05, 0.12, 0.5), "stations": (1.0, 0.06, 0.15, 0.7),
    "label": (4.0, 0.08, 0.15, 1.0), "reference": (0.3, 0.03, 0.10, 0.3),
}  # fmt: skip
# Heavy tail: factors on all of them, with their probabilities.
_SIZES, _WEIGHTS = (0.8, 1.2, 2.2), (0.5, 0.4, 0.1)
# CalibratedBlade angles within which a pitch means something [rad].
_FLAT, _STEEP = 0.02, 1.45
FARTHEST_DEG = 11.0
"""A blade that a reference turns further than this is another rotor, or the recording is wrong [deg]."""
# With more error of the solver than this it would take what belongs to the blade; every reading has this noise more,
# shares of the largest coefficient, so that no detail of a curve drives the blade anywhere.
_SMALL, _ROUGH = 0.03, 0.01
# Loads that a blade is sought on.
_FEWEST_LOADS = 3
# Rounds of choosing covariance and point.
_ROUNDS = 3
_WORTH_SAYING = 0.5


@dataclass(frozen=True)
class AsLabelled(AsBuilt):
    """Rotor whose pitch is what the label may have wrong: the angle holds at 0.75 R, the twist is that of the pitch."""

    def blade(self, bake: RotorBuild) -> None:
        """Change the pitch, beta = atan(pitch / (2 pi r)) at every station."""
        at75 = float(np.interp(0.75 * bake.R, bake.r, bake.beta))
        steeper = math.tan(np.clip(at75 + math.radians(self.angle_deg), _FLAT, _STEEP)) / math.tan(max(at75, _FLAT))
        lawful = np.clip(bake.beta, _FLAT, _STEEP)
        bake.beta = bake.beta + np.arctan(steeper * np.tan(lawful)) - lawful


@dataclass(frozen=True, eq=False)
class CalibratedBlade:
    """What is believed of the rotor's blade."""

    at: Array  # (K,) Point of the tangents, in the order and units of `NAMES`
    mean: Array  # (K,) Centre of the prior, in the units of `NAMES`
    # (K, K) Square root of the prior's covariance: its columns are one standard deviation each, in the units of `NAMES`
    root: Array
    kind: type[AsBuilt] = AsBuilt  # What an angle means: a turn, or another pitch
    # Median of each load of the reference over that of the case as stated, less 1 [1]
    moved: Mapping[str, float] = field(default_factory=dict)

    @property
    def effect(self) -> AsBuilt:
        """Blade at the point of the tangents."""
        return self.kind(*map(float, self.at))

    @property
    def used(self) -> NDArray[np.intp]:
        """Latent numbers that are not certain."""
        return np.flatnonzero(np.any(self.root != 0.0, axis=1))

    def changed(self, k: int, step: float) -> Effect:
        """Blade with one latent number changed."""
        z = self.at.copy()
        z[k] += step
        return self.kind(*map(float, z))


PLAIN = CalibratedBlade(np.zeros(len(NAMES)), np.zeros(len(NAMES)), np.diag(_PLAIN))
"""Blade of the case as it is written."""


def prior_of(case: Case) -> Prior:
    """What is known of the blade of a case before a run of it, wide enough for a label that was guessed."""
    blade, told = case.file.blade, case.file.blade.as_built
    source = known_from(blade)
    if source in ("reference", "measured"):
        return case.as_built().prior
    sd, mean = dict(zip(NAMES, _SD[source], strict=True)), np.zeros(len(NAMES))
    for k, name in enumerate(NAMES):
        mean[k] = getattr(told, name, None) or 0.0
        stated = getattr(told, f"{name.removesuffix('_deg')}_sd{'_deg' if name.endswith('_deg') else ''}", None)
        sd[name] = sd[name] if stated is None else max(float(stated), 1e-3)
    return Prior(mean, np.diag(np.array(list(sd.values())) ** 2), np.array(_SIZES), np.array(_WEIGHTS), source)


def _covariances(problem: Problem) -> Iterator[Array]:
    """Covariances without the blade under which it may be chosen: solver errors of 3 % or less."""
    for h, C in noise.covariances(problem):
        if h.model <= _SMALL:
            yield C + np.diag((_ROUGH * problem.scale) ** 2)


def _misfit(C: Array, r: Array) -> float:
    return float(r @ np.linalg.solve(C, r))


def _likeliest(tables: Sequence[Array], r: Array, B: Array) -> int:
    """Covariance under which a residual is likeliest when the blade is free."""
    return int(np.argmax([log_density(C + B @ B.T, r, constant=False) for C in tables]))


def calibrated(problem: Problem, prior: Prior) -> tuple[CalibratedBlade | None, str, str]:
    """Find the blade on the reference readings."""
    rows = ~problem.free
    if np.count_nonzero(problem.channel[rows] < 2) < _FEWEST_LOADS:
        return None, "", ""
    kind = AsLabelled if prior.known_from == "label" else AsBuilt
    parts = [p for p in problem.parts if p.record.reference]
    ends = np.cumsum([0, *(len(p.channels) * len(p.record) for p in problem.parts)])
    kept = [problem.kept[a:b] for p, a, b in zip(problem.parts, ends, ends[1:], strict=False) if p.record.reference]

    def solve(z: Array) -> Array:
        blade = kind(*map(float, z))
        return np.concatenate([p.predict(p.turned(blade))[k] for p, k in zip(parts, kept, strict=True)])

    y = problem.y[rows]
    whole = problem.with_tangents(np.array([not name.startswith("blade ") for name in problem.names]))
    tables = [C[np.ix_(rows, rows)] for C in _covariances(whole)]
    root = np.asarray(np.linalg.cholesky(prior.cov), dtype=float)
    at, chosen = prior.mean, -1
    for _ in range(_ROUNDS):
        best = _likeliest(tables, y - solve(at), tangents(solve, at) @ root)
        if best == chosen:
            break
        chosen, found = best, condition(solve, prior, y, tables[best])
        at = found.mean
    words = ", ".join(
        f"{name.removesuffix('_deg').replace('_', ' ')} {value:+.2g}{' deg' if UNITS[name] == 'deg' else ''}"
        for name, value, sd in zip(NAMES, found.mean, np.sqrt(np.diag(prior.cov)), strict=True)
        if abs(value) > _WORTH_SAYING * sd
    )
    if abs(found.mean[0]) > FARTHEST_DEG:
        return None, "", (
            f"the reference fits a blade turned by {found.mean[0]:+.0f} deg: another rotor, or a wrong "
            "diameter, number of blades or unit. The blade of the case was kept"
        )  # fmt: skip
    rest, start = y - solve(found.mean), solve(prior.mean)
    if not np.isfinite(rest).all() or _misfit(tables[chosen], rest) > _misfit(tables[chosen], y - start):
        return None, "no blade fits the reference better than that of the case, which was kept", ""
    size = float(np.sqrt(found.weights @ found.sizes**2))
    note = f"blade fitted to the reference, starting from its {prior.known_from}: {words or 'no change worth stating'}"
    at_first = [problem.channel[rows] == k for k in range(2)]
    moved = {
        name: float(np.median(y[own] / start[own])) - 1.0
        for name, own in zip(CHANNELS[:2], at_first, strict=True)
        if own.any() and np.all(start[own] != 0.0)
    }
    return CalibratedBlade(found.mean, prior.mean, size * root, kind, moved), note, ""


UNREPEATABLE = 0.10
"""Scatter of repeats, share of the reading, that no stand has: something that is not recorded changes [1]."""
# What loads of the right rotor may be off by, natural logarithm; how unusual a slip is adds to its square.
_OFF = 0.25
_SHOWN = 3
_ANGLES_DEG = (-12.0, -9.0, -6.0, -3.0, 3.0, 6.0, 9.0, 12.0, 16.0)
# Kinds of slips that are another rotor.
_ROTORS = ("pitch", "chord", "diameter", "blades")
_CHORDS = (0.6, 0.7, 0.8, 0.9, 1.1, 1.2, 1.35, 1.5, 1.7)
_BLADES = (1, 2, 3, 4, 5, 6, 8, 12)
_ERROR = ": error: "
# Kind, words, logarithm of the loads over those of the case by channel, rarity.
_Slip = tuple[str, str, dict[str, float], float]
SLIPS = ("unit_slip", "rpm_scale")
"""Effects that are such a slip themselves."""


@dataclass(frozen=True)
class Suspect:
    """A slip: its kind, in words, and how far it leaves the loads (root of a chi-square) [1]."""

    kind: str
    words: str
    distance: float


@dataclass(frozen=True)
class _Blades(Effect):
    """The same blades in another number."""

    count: int = 2

    id = "blades"

    def blade(self, bake: RotorBuild) -> None:
        """Change the solidity."""
        bake.sigma = bake.sigma * self.count / bake.B
        bake.B = self.count


@dataclass(frozen=True)
class _Chord(Effect):
    """Blades wider or narrower by one factor."""

    factor: float = 1.0

    id = "chord"

    def blade(self, bake: RotorBuild) -> None:
        """Change chord and solidity."""
        bake.chord = bake.chord * self.factor
        bake.sigma = bake.sigma * self.factor


def levels(problem: Problem) -> dict[str, float]:
    """Median of each load of the test over that of the case [1]."""
    return {channel: 1.0 + level for channel, level in problem.level.items()}


def foreign(problem: Problem) -> bool:
    """Whether the loads are too far off to be those of the case's rotor."""
    return _suspicious(levels(problem))


def _suspicious(found: dict[str, float]) -> bool:
    return any(not 1.0 / FACTOR < abs(found[c]) < FACTOR for c in CHANNELS[:2] if c in found)


def suspects(problem: Problem) -> list[Suspect]:
    """Rank the slips that would explain the level of the loads."""
    found = {c: math.log(abs(v)) for c, v in levels(problem).items() if v}
    return _ranked(found, _slips(problem, found))


def _ranked(found: dict[str, float], slips: Iterable[_Slip]) -> list[Suspect]:
    """The nearest of each kind, nearest kind first."""
    out: dict[str, Suspect] = {}
    for kind, words, shift, rarity in slips:
        square = sum((found[c] - shift.get(c, 0.0)) ** 2 for c in found) / _OFF**2 + rarity
        if kind not in out or square < out[kind].distance ** 2:
            out[kind] = Suspect(kind, words, math.sqrt(square))
    return sorted(out.values(), key=lambda s: s.distance)


def odds(problem: Problem) -> float:
    """Odds of another rotor over a slip of a unit or of the speed, by the level of the loads alone [1]."""
    rotor, slip = (min((s.distance for s in suspects(problem) if (s.kind in _ROTORS) is which), default=math.inf)
                   for which in (True, False))  # fmt: skip
    return math.exp(min(0.5 * (slip**2 - rotor**2), 50.0)) if math.isfinite(rotor) else 0.0


def nearest_rotors(problem: Problem) -> str:
    """Rotors that would fit the level of the loads, nearest first: another pitch, chord, diameter or blade count."""
    found = {c: math.log(abs(v)) for c, v in levels(problem).items() if v}
    chords = [("chord", f"chord {100.0 * (k - 1.0):+.0f} %", _Chord(k), 0.5) for k in _CHORDS]
    slips = [s for s in _slips(problem, found) if s[0] in _ROTORS]
    return " or ".join(s.words for s in _ranked(found, [*slips, *_shapes(problem, found, chords)]))


def _slips(problem: Problem, found: dict[str, float]) -> Iterator[_Slip]:
    """Kind, words, logarithm of the loads over those of the case, rarity of each slip."""
    T, Q = CHANNELS[:2]
    part = next(p for p in problem.parts if not p.record.reference)
    D = 2.0 * part.flow.R
    # loads go with D^4 and D^5 (coefficients stay): least squares over what was measured
    powers = {c: p for c, p in ((T, 4.0), (Q, 5.0)) if c in found}
    k = sum(p * found[c] for c, p in powers.items()) / sum(p * p for p in powers.values())
    twice, half = abs(k - math.log(2.0)) < 0.1, abs(k + math.log(2.0)) < 0.1
    hint = ", the case has the radius as diameter" if twice else ", the case has twice the diameter" if half else ""
    size = math.exp(k) * D
    yield "diameter", f"diameter {size:.3g} m ({size / INCH:.3g} in){hint}", {c: p * k for c, p in powers.items()}, 0.5
    for miscount in unit_errors.speed_ratios(rarest=1.0):
        if 1 in (miscount.true, miscount.set):
            off = -2.0 * math.log(miscount.ratio)
            yield (
                "poles" if miscount.set == 1 else "divided twice", miscount.words, dict.fromkeys(found, off),
                0.5 + miscount.rarity,
            )  # fmt: skip
    for error in unit_errors.errors("rotation"):
        yield "speed", f"rpm: {error.words}", dict.fromkeys(found, -2.0 * math.log(error.factor)), 1.0 + error.rarity
    for channel, kind in ((T, "force"), (Q, "torque")):
        for error in unit_errors.errors(kind) if channel in found else ():
            yield channel, f"{channel}: {error.words}", {channel: math.log(error.factor)}, 1.0 + error.rarity
    changes: list[tuple[str, str, Effect, float]] = [
        ("pitch", f"blade angle {a:+.0f} deg (different pitch)", AsLabelled(angle_deg=a), 0.5) for a in _ANGLES_DEG
    ]
    blades = part.flow.B
    changes += [("blades", f"{n} blades for {blades}", _Blades(n), 0.5 + math.log(n / blades) ** 2)
                for n in _BLADES if n != blades]  # fmt: skip
    yield from _shapes(problem, found, changes)


def _shapes(
    problem: Problem, found: dict[str, float], changes: Iterable[tuple[str, str, Effect, float]]
) -> Iterator[_Slip]:
    """The same of other blades, solved."""
    part = next(p for p in problem.parts if not p.record.reference)
    f0 = part.predict(part.baseline).reshape(len(part.channels), -1)
    for kind, words, change, rarity in changes:
        f = part.predict(part.turned(change)).reshape(len(part.channels), -1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = dict(zip(part.channels, np.nanmedian(f / f0, axis=1), strict=True))
        if all(ratio.get(c, np.nan) > 0.0 for c in found):
            yield kind, words, {c: math.log(ratio[c]) for c in found}, rarity


def unrepeatable(problem: Problem) -> dict[str, float]:
    """Channels whose repeats differ by more than any stand's, with their scatter [1]."""
    return {c: s for c, s in problem.scatter.items() if s > UNREPEATABLE}


def impossible(problem: Problem) -> tuple[str, ...]:
    """What recordings show that cannot be so; what a reference shows as well is no change from it."""
    wrong = [p.record.findings for p in problem.parts if p.record.reference]
    shared = {_kind(f) for found in wrong for f in found if _ERROR in f}
    return tuple(f for f in problem.findings if _ERROR in f and _kind(f) not in shared)


def _kind(finding: str) -> str:
    """Kind and channel of what cannot be so, without its file and its numbers."""
    return finding.partition(_ERROR)[2].partition(":")[0]


def exact_faults(problem: Problem) -> Iterator[tuple[str, Finding]]:
    """Effects that broken relations inside a recording of the test stand for, and the findings."""
    for part in problem.parts:
        for f in () if part.record.reference else part.record.contradictions:
            if f.id in ("sign_flipped", "thrust_unit", "torque_unit", "rpm_unit"):
                yield "unit_slip", f
            elif f.id.startswith("rpm_"):
                yield "rpm_scale", f


def finding(problem: Problem) -> str:
    """Question to the user, "" where the loads may be those of the case's rotor, at rest but for what is recorded."""
    found, names = levels(problem), {"thrust_N": "thrust", "torque_Nm": "torque"}
    if not _suspicious(found):
        told = " and ".join(f"{names[c]} by {s:.0%}" for c, s in unrepeatable(problem).items())
        return f"at one speed the readings differ, {told}: what changes between them is not recorded" if told else ""
    turned = {c: " of the other sign," if v < 0.0 else "" for c, v in found.items()}
    off = " and ".join(f"{names[c]} is{turned[c]} {number_text(abs(v), 3)} times" for c, v in found.items())
    ranked = "; ".join(f"{k}. {s.words}" for k, s in enumerate(suspects(problem)[:_SHOWN], 1))
    return f"{off} what the case gives. Is it this rotor? Most likely: {ranked}"


def to_mend(problem: Problem) -> str:
    """What comes before any run: whose rotor it is, or what cannot be so; "" where nothing is wrong."""
    if _suspicious(levels(problem)):
        slips = "; ".join(f"{k}. {s.words}" for k, s in enumerate(suspects(problem)[:_SHOWN], 1))
        return f"check that the case describes this rotor; other explanations for the loads: {slips}"
    file, _, correction = contradiction(problem)
    return f"correct {file} before any run: {correction}" if file else ""


def contradiction(problem: Problem) -> tuple[str, str, str]:
    """File that cannot be so, what in it and the correction; empty elsewhere."""
    wrong = impossible(problem)
    if not wrong:
        return "", "", ""
    file, _, said = wrong[0].partition(_ERROR)
    what, _, correction = said.partition(". Correction: ")
    _, _, channel = what.partition(" (")
    return file, channel.replace("): ", ": ", 1) or what, correction or said

"""Is it this rotor at all: another rotor as a hypothesis, and which slip explains loads that no such rotor can have.

A rotor of another size, pitch and section is weighed beside the effects.  Off by a factor of three in thrust is not one
whose physics was left out: that question comes before the physics, with the likely slips in order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import LinearTerms, log_sum
from bemt.base.tables import number_of, number_text
from bemt.base.units import INCH
from bemt.data.recordings.check import LEFT_OUT
from bemt.judge.diagnose.blade import AS_BUILT, LABELLED, AsLabelled
from bemt.judge.diagnose.form import ALIKE
from bemt.judge.diagnose.nuisance import blade_tangents
from bemt.judge.diagnose.record import CHANNELS, STILL
from bemt.judge.explanation import DOUBT, Explanation
from bemt.physics.coefficients import CP, CT, FM
from bemt.physics.effects.base import Effect, RotorBuild
from bemt.physics.effects.propeller import AnotherPropeller
from bemt.physics.effects.rpm_scale import RpmScale
from bemt.rotors.as_measured import FACTOR

if TYPE_CHECKING:
    from bemt.base.gaussian.whitening import Conditional
    from bemt.data.recordings.findings import Finding
    from bemt.judge.diagnose.problem import Part, Problem
    from bemt.judge.loss import Decision

UNREPEATABLE = 0.10
"""Scatter of repeats, share of the reading, that no stand has: something that is not recorded changes [1]."""
# What loads of the right rotor may be off by, natural logarithm; how unusual a slip is adds to its square.
_OFF = 0.25
_SHOWN = 3
# Diameters of propellers that a stand takes, 5 to 15 in: standard deviation of the natural logarithm.
_SIZES = 0.35
# Powers of the diameter with which thrust and torque of similar rotors go.
_POWERS = (4.0, 5.0)
# Diameters differ from their labels by a share of this.
_ROUNDED = 0.01
# Fewest advance ratios that a curve is drawn through.
_NODES = 4
# Blade area of propellers of one diameter, two blades or three: the same.
_AREA = 0.2
_ANGLES_DEG = (-12.0, -9.0, -6.0, -3.0, 3.0, 6.0, 9.0, 12.0, 16.0)
# Kinds of slips that are another rotor.
_ROTORS = ("pitch", "chord", "diameter", "blades")
_COUNTS = ("poles", "divided twice")
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


def unlike(off: Mapping[str, float]) -> bool:
    """Whether loads, over those of the case less 1, are farther off than those of the right rotor are."""
    return any(v <= -1.0 or abs(math.log1p(v)) > 2.0 * _OFF for v in off.values())


def suspects(problem: Problem) -> list[Suspect]:
    """Rank the slips that would explain the level of the loads."""
    found = {c: math.log(abs(v)) for c, v in levels(problem).items() if v}
    return _ranked(found, _slips(problem, found))


def _ranked(found: dict[str, float], slips: Iterable[_Slip]) -> list[Suspect]:
    """The nearest of each kind, nearest kind first."""
    out: dict[str, Suspect] = {}
    for kind, words, shift, rarity in slips:
        square = _square(found, shift, rarity)
        if kind not in out or square < out[kind].distance ** 2:
            out[kind] = Suspect(kind, words, math.sqrt(square))
    return sorted(out.values(), key=lambda s: s.distance)


def units_by_level(problem: Problem) -> list[tuple[str, float]]:
    """Channel and what its reading is times the truth [1], of the slips of units that leave the loads nearest."""
    found = {c: math.log(abs(v)) for c, v in levels(problem).items() if v}
    powers = {CHANNELS[0]: 1.0, CHANNELS[1]: 1.0, "speed": -0.5}
    some = [
        (_square(found, shift, rarity), "rpm" if kind == "speed" else kind, powers[kind] * next(iter(shift.values())))
        for kind, _, shift, rarity in _slips(problem, found) if kind in powers
    ]  # fmt: skip
    least = min((square for square, *_ in some), default=0.0)
    return [(channel, math.exp(size)) for square, channel, size in some if square < least + ALIKE**2]


def _square(found: dict[str, float], shift: dict[str, float], rarity: float) -> float:
    """How far a slip leaves the loads, as a chi-square, and how unusual it is."""
    return sum((found[c] - shift.get(c, 0.0)) ** 2 for c in found) / _OFF**2 + rarity


def by_level(problem: Problem) -> dict[str, float]:
    """Likelihood of each effect that is a slip, and "" of another rotor, by the level of the loads alone [1]."""
    out: dict[str, float] = {}
    ranked = suspects(problem)
    nearest = min((s.distance for s in ranked), default=0.0)
    for s in ranked:
        effect = "" if s.kind in _ROTORS else "rpm_scale" if s.kind in _COUNTS else "unit_slip"
        out[effect] = max(out.get(effect, 0.0), math.exp(0.5 * (nearest**2 - s.distance**2)))
    return out


@dataclass(frozen=True, eq=False)
class Another:
    """Another rotor in the place of the case's: what its size changes, and what else is not known of it."""

    changes: Array  # (M, G) Of the readings, by diameter [units of the readings]
    size: Array  # (G,) Logarithm of the diameter over the case's [1]
    # One standard deviation each of blade area, pitch and section, of the case's size, (M, K) [units of the readings];
    # and the diameters that go with it, (H,): any other rotor has any, one of the same make another one
    families: tuple[tuple[Array, NDArray[np.intp]], ...]

    @classmethod
    def of(cls, problem: Problem) -> tuple[Explanation, Another] | None:
        """What it is, another propeller than the reference's or doubt of the case, and its signatures; None by laws.

        Similar rotors have one CT(J) and one CP(J), so that loads go with D^4 and D^5 at V/(n D); what Reynolds and
        Mach number change with the size is less than what else is open.
        """
        solved = all(p.instead is None for p in problem.parts)
        if problem.by_laws or np.any(problem.channel > 1) or not solved:
            return None
        size = _sizes(problem)
        if not size.size:
            return None
        base = np.tile(problem.f0, (size.size, 1))
        if any(np.any(p.flow.V != 0.0) for p in problem.parts):
            from scipy.interpolate import CubicSpline

            nodes = 0.25 * _SIZES * np.arange(-12.0, 13.0)
            table = np.stack([_at_other_advance(problem, k) for k in nodes])
            good = np.isfinite(table).all(axis=1)
            nodes, table = nodes[good], table[good]
            if nodes.size < _NODES:
                return None
            size = size[(size >= nodes[0]) & (size <= nodes[-1])]
            base = CubicSpline(nodes, table)(size)
        free = problem.free
        scale = np.exp(np.array(_POWERS)[problem.channel][:, None] * size)
        blade = np.where(free[:, None], np.nan_to_num(blade_tangents(problem)), 0.0)
        area = np.where(free, _AREA * problem.f0, 0.0)[:, None]
        # beside a reference: the solver is off for its rotor as it is for the case's, for another one as it may be
        shared = problem.own & (not free.all())
        own = np.where(free[:, None], problem.tangents[:, shared], 0.0)
        other, make = np.arange(size.size), np.flatnonzero(np.abs(size) > 1.5 * _ROUNDED)
        families = ((np.concatenate([area, blade * LABELLED, own], axis=1), other),
                    (blade * (LABELLED[0], *AS_BUILT[1:]), make))  # fmt: skip
        changes = np.where(free[:, None], scale * base.T - problem.f0[:, None], 0.0)
        another = cls(changes, size, tuple(f for f in families if f[1].size))
        return DOUBT if free.all() else Explanation.of(AnotherPropeller.id), another

    def log_bayes(self, white: Conditional, residual: Array, channel: NDArray[np.intp]) -> float:
        """Natural logarithm of the odds over none for whitened readings (N,) of ``channel`` (M,) [1]."""
        left, each = residual[:, None] - white.changes(self.changes), []
        loads = [(channel == c, np.exp(_POWERS[c] * self.size)) for c in np.unique(channel)]
        log_w = -0.5 * (self.size / _SIZES) ** 2
        for columns, sizes in self.families:
            # one size scales all of a load alike: its columns are whitened once
            parts = [(white.changes(np.where(mine[:, None], columns, 0.0)), k) for mine, k in loads]
            gain = [float(LinearTerms.of(sum((k[g] * x for x, k in parts), np.zeros(()))).gain(left[:, g]))
                    - 0.5 * float(left[:, g] @ left[:, g]) for g in sizes]  # fmt: skip
            each.append(float(log_sum(gain, log_w[sizes]) - log_sum(log_w[sizes])))
        return float(log_sum(each)) - math.log(len(each)) + 0.5 * float(residual @ residual)


def _sizes(problem: Problem) -> Array:
    """Logarithm of diameters over the case's: half inches from it, as propellers come, about as true as labels are.

    In a duct there is room for one diameter. No open rotor needs less power at rest than an ideal one of its size.
    """
    part = next(p for p in problem.parts if not p.record.reference)
    D = 2.0 * part.flow.R
    steps = 1.0 + 0.5 * INCH / D * np.arange(-200.0, 201.0)
    sizes = np.log(steps[(steps > math.exp(-3.0 * _SIZES)) & (steps < math.exp(3.0 * _SIZES))])
    sizes = np.zeros(1) if part.model.duct is not None else sizes[np.exp(sizes) > _merit(part)]
    return np.sort((sizes[:, None] + _ROUNDED * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])).ravel())


def _merit(part: Part) -> float:
    """Figure of merit at rest of a rotor of the case's diameter with these readings; 0 where they do not tell [1]."""
    still, read = np.abs(part.flow.J) <= STILL, part.record.measured
    if not np.any(still) or not {*CHANNELS[:2]} <= read.keys():
        return 0.0
    n, D = part.flow.n[still], 2.0 * part.flow.R
    T, P = read[CHANNELS[0]][still], 2.0 * np.pi * n * read[CHANNELS[1]][still]
    with np.errstate(invalid="ignore"):
        found = FM(CT(T, part.flow.rho[still], n, D), CP(P, part.flow.rho[still], n, D))
    return float(np.nanmedian(found)) if np.isfinite(found).any() else 0.0


def _at_other_advance(problem: Problem, size: float) -> Array:
    """Readings of the baseline at the advance ratio of a rotor whose diameter is exp(size) times the case's, (M,)."""
    slower = (replace(p, flow=replace(p.flow, V=p.flow.V * math.exp(-size)), _solved={}) for p in problem.parts)
    return np.concatenate([p.predict(p.baseline) for p in slower])[problem.kept]


def doubted(problem: Problem, said: Decision) -> bool:
    """Whether it is the rotor of the case that is in doubt, and not a file."""
    elsewhere = contradiction(problem)[0] or unrepeatable(problem) or problem.other_setup
    return said.by == "files" and not elsewhere


def nearest_rotors(problem: Problem) -> str:
    """Rotors that would fit the level of the loads, nearest first: another pitch, chord, diameter or blade count."""
    found = {c: math.log(abs(v)) for c, v in levels(problem).items() if v}
    chords = [("chord", f"chord {100.0 * (k - 1.0):+.0f} %", _Chord(k), 0.5) for k in _CHORDS]
    slips = [s for s in _slips(problem, found) if s[0] in _ROTORS]
    as_it_is = math.sqrt(_square(found, {}, 0.0))  # farther off than the case is no rotor that would fit
    every = _ranked(found, [*slips, *_shapes(problem, found, chords)])
    return " or ".join(s.words for s in every if s.distance < as_it_is)


def _slips(problem: Problem, found: dict[str, float]) -> Iterator[_Slip]:
    """Kind, words, logarithm of the loads over those of the case, rarity of each slip."""
    T, Q = CHANNELS[:2]
    part = next(p for p in problem.parts if not p.record.reference)
    D = 2.0 * part.flow.R
    # loads go with D^4 and D^5 (coefficients stay): least squares over what was measured
    powers = {c: p for c, p in zip((T, Q), _POWERS, strict=True) if c in found}
    k = sum(p * found[c] for c, p in powers.items()) / sum(p * p for p in powers.values())
    twice, half = abs(k - math.log(2.0)) < 0.1, abs(k + math.log(2.0)) < 0.1
    hint = ", the case has the radius as diameter" if twice else ", the case has twice the diameter" if half else ""
    size = math.exp(k) * D
    rarity = 0.5 if hint else 0.5 + (k / _SIZES) ** 2
    words = f"diameter {size:.3g} m ({size / INCH:.3g} in){hint}"
    yield "diameter", words, {c: p * k for c, p in powers.items()}, rarity
    # near ones are solved: at a false speed the tips are at another Mach and Reynolds number
    for m in unit_errors.speed_ratios(rarest=1.0):
        near = all(abs(v + 2.0 * math.log(m.ratio)) < math.log(FACTOR) for v in found.values())
        if near and 1 in (m.true, m.set):
            kind, words = "divided twice", m.words
            if m.set == 1:  # no model knows its loads to a pair
                about = f"about {m.true} pole pairs (half the magnets of the motor; --pole-pairs N)"
                kind, words = "poles", f"{words.partition(':')[0]}: divide by {about}"
            true = RpmScale(factor=m.ratio, eps=0.0)
            yield from _shapes(problem, found, [(kind, words, true, 0.5 + m.rarity)])
    for error in unit_errors.errors("rotation"):
        yield "speed", f"rpm: {error.words}", dict.fromkeys(found, -2.0 * math.log(error.factor)), 1.0 + error.rarity
    for channel, kind in ((T, "force"), (Q, "torque")):
        errors = unit_errors.errors(kind) if channel in found.keys() - part.record.unitless else ()
        # what a figure of merit or a coefficient tells already
        told = [e for e in errors if any(f"{channel}: {e.words}" in f for f in part.record.findings)]
        for error in told or errors:
            yield channel, f"{channel}: {error.words}", {channel: math.log(error.factor)}, 1.0 + error.rarity
    changes: list[tuple[str, str, Effect, float]] = [
        ("pitch", f"blade angle {a:+.0f} deg (different pitch)", AsLabelled(angle_deg=a), 0.5) for a in _ANGLES_DEG
    ]
    blades = part.flow.B
    changes += [("blades", f"{number_of(n, 'blade')} for {blades}", _Blades(n), 0.5 + math.log(n / blades) ** 2)
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
    return f"{off} what the case gives. Is it this rotor? Most likely: {nearest_slips(problem)}"


def nearest_slips(problem: Problem) -> str:
    """Slips that would explain the level of the loads, the likeliest first, in words."""
    return "; ".join(f"{k}. {s.words}" for k, s in enumerate(suspects(problem)[:_SHOWN], 1))


def to_mend(problem: Problem) -> str:
    """What comes before any run: whose rotor it is, or what cannot be so; "" where nothing is wrong."""
    if _suspicious(levels(problem)):
        return "check that the case describes this rotor, and look at the file"
    file, _, correction = contradiction(problem)
    # rows that were left out are why the rest looks impossible
    odd = next((f.partition(". Correction: ")[2] for f in problem.findings if f": {LEFT_OUT[0]} (" in f), "")
    return f"correct {file} before any run: {odd.partition('; ')[0] or correction}" if file else ""


def contradiction(problem: Problem) -> tuple[str, str, str]:
    """File that cannot be so, what in it and the correction; empty elsewhere."""
    wrong = impossible(problem)
    if not wrong:
        return "", "", ""
    file, _, said = wrong[0].partition(_ERROR)
    what, _, correction = said.partition(". Correction: ")
    _, _, channel = what.partition(" (")
    return file, channel.replace("): ", ": ", 1) or what, correction or said

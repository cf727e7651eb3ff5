"""The baseline beside the recording: all channels of all recordings stacked into one vector of M readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.data.recordings import cfd_setup
from bemt.judge.diagnose.blade import PLAIN, CalibratedBlade
from bemt.judge.diagnose.record import CHANNELS, Record, setup_of
from bemt.physics import effects
from bemt.physics.bem import model as bem
from bemt.physics.effects.base import Effect, Flow, Reading
from bemt.rotors.model import air_of_points, beta75_deg, coefficients
from bemt.rotors.population import population
from bemt.rotors.predict import sense

if TYPE_CHECKING:
    from bemt.rotors.case.as_built import CaseAsBuilt

# Readings further than this factor from the baseline are in other units.
_SLIPPED = 3.0
# Speeds over the recorded ones beyond which the tables of these do not reach.
_SLOWER, _FASTER = 0.7, 1.1


BY_LAWS = "laws"
"""Key of a rotor that is known by its reference alone (:mod:`bemt.judge.diagnose.law_rotor`)."""


@dataclass(frozen=True, eq=False)
class SpeedCurve:
    """Speed over the pulse width, which is a parabola over the speed.

    The voltage of a motor is omega/K_v + R I, and its current goes with omega^2 (Drela 2007, "First-Order DC Electric
    Motor Model", eqs 1 and 2; not checked). More terms would follow what drifts within a few pulse widths, as steps.
    """

    coefficients: Array  # of the pulse width over the speed over the largest one, from the constant on [s]
    top: float  # largest speed [rev/min]

    @classmethod
    def of(cls, pulse: Array, rpm: Array) -> SpeedCurve:
        """Fit readings (N,) [s], [rev/min]."""
        good = np.isfinite(rpm)
        degree = min(2, np.unique(np.round(pulse[good], 6)).size - 1)
        top = float(np.max(rpm[good]))
        found = np.polynomial.polynomial.polyfit(rpm[good] / top, pulse[good], max(degree, 1))
        return cls(np.pad(found, (0, 3 - found.size)), top)

    def __call__(self, pulse: Array) -> Array:
        """Speed [rev/min]."""
        c0, c1, c2 = self.coefficients
        root = np.sqrt(np.maximum(c1**2 + 4.0 * c2 * (pulse - c0), 0.0))
        return np.asarray(self.top * 2.0 * (pulse - c0) / (c1 + root))


@dataclass(frozen=True, eq=False)
class Part:
    """One recording with the rotor that made it."""

    record: Record  # Points
    model: bem.Model  # Rotor
    baseline: tuple[Effect, ...]  # Physics that the case has on
    flow: Flow  # Recorded conditions with the baseline's loads
    key: str = ""  # Rotor: parts of one rotor share the error of its model
    left_out: tuple[str, ...] = ()  # Effects that the case switches off
    # How well the rotor is known; None where the population of real rotors says nothing of the baseline
    as_built: CaseAsBuilt | None = None
    # (C P,) Baseline of another model, to which effects add what share they change in ours [N], [N m], [rev/min]
    instead: Array | None = None
    # Speed over pulse width as the reference shows it; None: as this recording itself does
    drive: SpeedCurve | None = None
    _solved: dict[tuple[Effect, ...], tuple[Array, Array, Flow]] = field(default_factory=dict, repr=False)

    @cached_property
    def _same_flow(self) -> dict[Any, Any]:
        """Solutions of the model at the recorded flow."""
        return {}

    @cached_property
    def missing(self) -> frozenset[str]:
        """Physics of every rotor that the case switches off: no run is without it, a reference neither."""
        return frozenset(self.left_out) & {e.id for e in effects.standard()}

    def predict(self, effects: Sequence[Effect]) -> Array:
        """Readings with a set of effects, around the baseline of another model where there is one, (C P,)."""
        ours = self._ours(effects)
        if self.instead is None:
            return ours
        base = self._ours(self.baseline)
        return self.instead * (ours / base)

    def _ours(self, effects: Sequence[Effect]) -> Array:
        """Readings of the blade element model with a set of effects, (C P,)."""
        # instruments do not change the flow: what they show of the same flow needs no new solution
        key = tuple(e for e in effects if not bem.only_reads(e))
        if key not in self._solved:
            self._solved[key] = self._respond(key)
        T, Q, met = self._solved[key]
        values = {"thrust_N": T.copy(), "torque_Nm": Q.copy()}
        if "rpm" in self.record.measured:
            values["rpm"] = self.steady_rpm.copy()
        reading = Reading(values, self.full_scale)
        for e in effects:
            e.reading(reading, met)
        return np.concatenate([reading.values[c] for c in self.channels])

    def _respond(self, effects: Sequence[Effect]) -> tuple[Array, Array, Flow]:
        """Thrust [N] and torque [N m] with a set of effects, NaN where not converged, and the flow that is met."""
        model = self._whole if self._far(effects) else self.model
        loads, met, ok = bem.respond(
            model.prepared, effects, self.flow, self._same_flow if model is self.model else None
        )
        nan = np.where(ok, 1.0, np.nan)
        taught_T, taught_Q = model.taught(met.rpm, met.V, met.rho, met.mu)
        return (loads.T + taught_T) * nan, (loads.Q + taught_Q) * nan, met

    @cached_property
    def _whole(self) -> bem.Model:
        """Model with the tables of all speeds."""
        return replace(self.model, re_range=None, mach_max=bem.Model.mach_max)

    def _far(self, effects: Sequence[Effect]) -> bool:
        """Whether what an instrument got wrong takes the rotor to speeds that the tables of the recorded ones lack."""
        wrong = [e for e in effects if e.kind == "stand" and not bem.only_reads(e)]
        if not wrong:
            return False
        flow = self.flow
        met = replace(flow, rpm=flow.rpm.copy(), V=flow.V.copy(), rho=flow.rho.copy())
        for e in wrong:
            e.flow(met)
        recorded, real = (np.hypot(f.omega * f.R, f.V) for f in (flow, met))
        return bool(np.max(real) > _FASTER * np.max(recorded) or np.min(real) < _SLOWER * np.min(recorded))

    def turned(self, blade: Effect) -> tuple[Effect, ...]:
        """Baseline with another blade."""
        return (*(e for e in self.baseline if e.id != blade.id), blade)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that were measured, in the order of :data:`CHANNELS`."""
        return tuple(c for c in CHANNELS if c in self.record.measured)

    @cached_property
    def steady_rpm(self) -> Array:
        """Baseline of the drive: speed over the pulse width, of the reference where there is one [rev/min].

        NaN at pulses too short for the reference's motor to turn.
        """
        pulse = self.record.extra["pwm_s"]
        speed = (self.drive or SpeedCurve.of(pulse, self.record.measured["rpm"]))(pulse)
        return np.where(speed > 0.0, speed, np.nan)

    @cached_property
    def full_scale(self) -> dict[str, float]:
        """Largest magnitude of the readings per channel; of the baseline where there are none."""
        out = {}
        for name, computed in (("thrust_N", self.flow.T0), ("torque_Nm", self.flow.Q0)):
            read = self.record.measured.get(name, computed)
            out[name] = float(np.nanmax(np.abs(read if np.isfinite(read).any() else computed)))
        if "rpm" in self.record.measured:
            out["rpm"] = float(self.record.rpm.max())
        return out


@dataclass(frozen=True, eq=False)
class Problem:
    """Stacked readings of all parts."""

    parts: tuple[Part, ...]  # Recordings
    # (M,) Readings, baseline, standard uncertainty, and the size that shares refer to (the largest coefficient in the
    # recording at the point's speed and density), each in the unit of its channel
    y: Array
    f0: Array
    u: Array
    scale: Array
    u_known: bool  # Whether the recording states its uncertainties
    # (M,) Index into :data:`CHANNELS`, into all P points, into the parts
    channel: NDArray[np.intp]
    point: NDArray[np.intp]
    part: NDArray[np.intp]
    kept: NDArray[np.bool_]  # (M0,) Which of all stacked readings were used (measured and converged)
    covariates: dict[str, Array]  # (P,) rpm, J, M_tip, Re and what was recorded besides
    tangents: Array  # (M, K) Change of the readings for one standard deviation of each nuisance [units of the readings]
    names: tuple[str, ...]  # Names of the nuisances
    own: NDArray[np.bool_]  # (K,) Which of them are errors of the solver itself
    notes: tuple[str, ...] = ()  # What was assumed or left out
    # Where the recording leaves what the solver was measured against, or its method, in the words of every command
    validity: tuple[str, ...] = ()
    no_check: tuple[str, ...] = ()  # Readings that the rotor of a case was fitted to
    between: tuple[str, ...] = ()  # What looks wrong in a recording beside the others, its file named in front
    # Scatter of repeats as a share of the median reading, by channel, where there are enough of them [1]
    scatter: dict[str, float] = field(default_factory=dict)
    blade: CalibratedBlade = PLAIN  # What is believed of the rotor's blade, and the point of its tangents
    # (M,) Change of the readings from the centre of the blade's prior to that point [units of the readings]
    offset: Array = field(default_factory=lambda: np.zeros(0))
    # The parts under other laws, each off by about its uncertainty in one number
    variants: tuple[tuple[Part, ...], ...] = ()
    # Physics that a reference shows as well as the recording (:mod:`bemt.judge.diagnose.chain`)
    shared: frozenset[str] = frozenset()
    told: frozenset[str] = frozenset()  # Effects that the user says he changed between reference and recording
    # Readings that were solved already, by the effects added
    predicted: dict[Any, Array] = field(default_factory=dict, repr=False)

    @property
    def by_laws(self) -> bool:
        """Whether there is no case, and signatures are those of scaling laws."""
        return any(p.key == BY_LAWS for p in self.parts)

    @property
    def findings(self) -> tuple[str, ...]:
        """What looks wrong in the recordings before any physics."""
        return (*self.between, *(f for p in self.parts for f in p.record.findings))

    @cached_property
    def other_setup(self) -> str:
        """How recordings were computed otherwise than their references, in words; "" where nothing says so."""
        known, tested = ([p.record for p in self.parts if p.record.reference is which] for which in (True, False))
        return cfd_setup.other_setup(setup_of(tested), setup_of(known))

    @property
    def level(self) -> dict[str, float]:
        """Median of each load over what the case gives, less 1 [1]."""
        out = {}
        for k, name in enumerate(CHANNELS[:2]):
            mine = (self.channel == k) & self.free & (np.abs(self.f0) > 0.0)
            if mine.any():
                out[name] = float(np.median(self.y[mine] / self.f0[mine])) - 1.0
        return out

    @property
    def largest(self) -> Array:
        """Largest value of the channel at the point's speed and density, read or computed, (M,)."""
        return np.maximum(self.scale, self.largest_computed)

    @cached_property
    def largest_computed(self) -> Array:
        """The same of the baseline alone: a reading in another unit makes no computed load small, (M,)."""
        out = self.scale.copy()
        for k in np.unique(self.part):
            for c in np.unique(self.channel):
                mine = (self.part == k) & (self.channel == c)
                if mine.any():
                    out[mine] *= float(np.quantile(np.abs(self.f0 / self.scale)[mine], 0.9))
        return out

    @cached_property
    def stretch(self) -> Array:
        """Readings over the baseline for channels in another unit or of the other sign, else 1, (M,).

        Errors are shares of what is read.
        """
        out = np.ones_like(self.y)
        for k in np.unique(self.part):
            for c in np.unique(self.channel):
                mine = (self.part == k) & (self.channel == c)
                if mine.any():
                    size = float(np.median(np.abs(self.y[mine]) / np.maximum(np.abs(self.f0[mine]), 1e-12)))
                    turned = float(np.median(np.sign(self.y[mine]) * np.sign(self.f0[mine]))) < 0.0
                    out[mine] = (1.0 if 1.0 / _SLIPPED < size < _SLIPPED else size) * (-1.0 if turned else 1.0)
        return out

    @property
    def free(self) -> NDArray[np.bool_]:
        """Readings in which a cause may be at work, (M,): all but those of reference recordings."""
        return np.array([not p.record.reference for p in self.parts])[self.part]

    @property
    def missing(self) -> frozenset[str]:
        """Physics of every rotor that a reference may show and its case switches off."""
        return frozenset().union(*(p.missing for p in self.parts if p.record.reference))

    @property
    def changed(self) -> NDArray[np.bool_]:
        """Readings that some explanation changes, (M,): the free ones, and a reference's by what both runs share."""
        in_both = np.array([bool(self.shared & p.missing) for p in self.parts])[self.part]
        return np.asarray(self.free | in_both)

    def of(self, rows: NDArray[np.bool_]) -> Problem:
        """Some of the readings, to weigh solved signatures by; nothing is solved for these alone."""
        cut = {k: getattr(self, k)[rows] for k in ("y", "f0", "u", "scale", "channel", "point", "part", "offset")}
        return replace(self, **cut, tangents=self.tangents[rows], predicted={}, variants=())

    @property
    def rotor(self) -> NDArray[np.intp]:
        """Index of the rotor of each reading, (M,)."""
        keys = list(dict.fromkeys(p.key for p in self.parts))
        return np.array([keys.index(p.key) for p in self.parts])[self.part]

    @cached_property
    def of_real_rotors(self) -> Array:
        """Covariance of the readings over real rotors of which as much is known as of the case's, (M, M)."""
        return covariance_of_real_rotors(self)

    @property
    def centre(self) -> Array:
        """Baseline for the blade at the centre of its prior, to which all nuisances refer, (M,)."""
        return self.f0 - self.offset

    @property
    def residual(self) -> Array:
        """Recording minus baseline at the centre of all nuisances, (M,)."""
        return self.y - self.centre

    def with_tangents(self, keep: NDArray[np.bool_]) -> Problem:
        """Problem with some of the nuisances only."""
        names = tuple(n for n, k in zip(self.names, keep, strict=True) if k)
        return replace(self, tangents=self.tangents[:, keep], names=names, own=self.own[keep])

    @property
    def baseline(self) -> tuple[Effect, ...]:
        """Physics that the (first) case has on."""
        return self.parts[0].baseline

    def predict(self, extra: Sequence[Effect]) -> Array:
        """Readings with effects added to the baseline, in place of those of the same id."""
        key = tuple(extra)
        if key not in self.predicted:
            full = []
            for p in self.parts:
                mine = tuple(e for e in extra if not p.record.reference or e.id in self.shared & p.missing)
                ids = {e.id for e in mine}
                full.append(p.predict((*(e for e in p.baseline if e.id not in ids), *mine)))
            self.predicted[key] = np.concatenate(full)[self.kept]
        return self.predicted[key]

    def directions(self, effect: Effect) -> Array:
        """What the signature of an effect is off by in each of the other laws, (M, D) [units of the readings]."""
        if not self.variants or effect.kind == "stand" or effect.exact:
            return np.zeros((self.y.size, 0))
        mine = self.signature((effect,))
        return np.stack([other.predict((effect,)) - other.predict(()) - mine for other in self._under_variants], axis=1)

    @cached_property
    def _under_variants(self) -> tuple[Problem, ...]:
        return tuple(replace(self, parts=parts, predicted={}, variants=()) for parts in self.variants)

    def signature(self, extra: Sequence[Effect]) -> Array:
        """Change of the readings when effects are added: solve(with) - solve(without), (M,)."""
        return self.predict(extra) - self.f0


# What real rotors differ by from the solver, as the population of measured propellers shows it (`bemt.rotors`).
#
# Without a reference nothing else says how far blade and solver may be off: of 26 propellers of UIUC, flown as
# published, calibration alone called 14 unknown and named a cause of 5.
_AIR = ("rho", "mu", "a_sound", "temperature_K")
# Coefficient at rest of a rotor that has none, so that shares of it are finite.
_NOTHING = 1e-12


def covariance_of_real_rotors(problem: Problem) -> Array:
    """Covariance of the readings over rotors of which as much is known as of the case's, (M, M)."""
    out, X = np.zeros((problem.y.size, problem.y.size)), problem.covariates
    first = np.cumsum([0, *(len(p.record) for p in problem.parts)])
    for key in dict.fromkeys(p.key for p in problem.parts):
        mine = [i for i, p in enumerate(problem.parts) if p.key == key]
        points = np.concatenate([np.arange(first[i], first[i + 1]) for i in mine])
        C = _of_points([problem.parts[i] for i in mine], *(X[k][points] for k in ("rpm", "J", "Re")))
        place = np.full(first[-1], -1)
        place[points] = np.arange(points.size)
        rows = np.flatnonzero((place[problem.point] >= 0) & (problem.channel < CHANNELS.index("rpm")))
        column = problem.channel[rows] * points.size + place[problem.point[rows]]
        out[np.ix_(rows, rows)] = C[np.ix_(column, column)]
    return out * problem.stretch[:, None] * problem.stretch[None, :]


def _of_points(parts: Sequence[Part], rpm: Array, J: Array, Re: Array) -> Array:
    """Of one rotor at the points of some recordings, thrust [N] first, then torque [N m], (2 P, 2 P)."""
    p, known, model = population(), parts[0].as_built, parts[0].model
    assert known is not None
    state = {k: np.concatenate([getattr(q.record.air, k) for q in parts]) for k in _AIR}
    here = sense(
        coefficients(model, air_of_points(state)), model.diameter_m, beta75_deg(model), rpm, J, Re, known.drawn
    )
    f, top, T = (np.nan_to_num(v) for v in (here.f, here.top, here.T))
    here = replace(here, f=f, top=np.where(top == 0.0, _NOTHING, top), T=T)
    # that the population is not centred at the case is one more thing that is not known of this rotor
    usual = p.bias(here).reshape(-1) if model.learned is None else np.zeros(2 * rpm.size)  # a run has told it
    C = p.rest(here)
    if not any(q.record.reference for q in parts):  # it shows the blade itself
        slopes = T.transpose(0, 2, 1).reshape(2 * rpm.size, -1)
        C += slopes @ known.prior.cov @ slopes.T
        usual += slopes @ (known.prior.mean - known.drawn)
    C += np.outer(usual, usual)
    thrust = state["rho"] * (rpm / 60.0) ** 2 * model.diameter_m**4
    unit = np.concatenate([thrust, thrust * model.diameter_m / (2.0 * np.pi)])
    return np.asarray(C * unit[:, None] * unit[None, :])

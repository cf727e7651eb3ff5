"""The baseline beside the recording, and everything that may differ without being a cause: nuisances.

All channels of all recordings are stacked into one vector of M readings.  Calibration freedom (section drag and lift,
pitch, gains, zeros, speed, density, sessions) enters as tangents with stated priors and is marginalised, never fitted
first: fitting it first would absorb the physics.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt import evaluate, forward
from bemt.diagnose.noise import smooth_modes
from bemt.diagnose.record import Record, concatenated, merged
from bemt.effects.base import Baking, Effect, Flow, Reading
from bemt.errors import Fault, InputError

if TYPE_CHECKING:
    from bemt.case import Case

__all__ = ["CHANNELS", "PRIORS", "Part", "Problem", "assemble", "build"]

Array = NDArray[np.float64]

CHANNELS = ("thrust_N", "torque_Nm", "rpm")

PRIORS = {
    "section drag": 0.10, "lift slope": 0.03, "pitch": 0.3, "thrust gain": 0.01, "torque gain": 0.01,
    "thrust zero": 0.002, "torque zero": 0.002, "speed of rotation": 0.003, "density": 0.005,
    "density not recorded": 0.015, "airspeed": 0.005, "session": 0.01, "parameter of the model": 0.25,
    "level of thrust": 0.06, "level of torque": 0.08, "slope over J": 0.05, "bend over J": 0.02,
    "form of the model": 0.2,
}  # fmt: skip
"""Standard deviations: shares [1], pitch in [deg], zeros of full scale [1], parameters of active effects as a share of
their published range [1].  Drag, lift, pitch, gains and zeros are working calibrations; level, slope
and bend are errors of the solver itself, declared after volume 1 of the UIUC database; the rest is declared."""

_STATIONS = 24
_FEWEST = 3
# Readings further than this factor from the baseline are in other units.
_SLIPPED = 3.0
# Speed over pulse width at rest of everything else: terms of the polynomial.
_PULSE_POWERS = 6
_U_DEFAULT = 0.01
_U_RPM = 0.01
_U_FLOOR = 0.002
# Effects whose whole size is below this share of the largest coefficient need no error of their form.
_FORM_FLOOR = 0.005


@dataclass(frozen=True)
class _Calibration(Effect):
    """Small changes of blade and section that stand for what nobody measured."""

    pitch_deg: float = 0.0
    drag: float = 0.0
    lift: float = 0.0

    id = "calibration"
    order = 15

    def blade(self, bake: Baking) -> None:
        """Turn the blade."""
        bake.beta += np.radians(self.pitch_deg)

    def section(self, bake: Baking) -> None:
        """Scale drag and lift."""
        bake.cd *= 1.0 + self.drag
        bake.cl *= 1.0 + self.lift


@dataclass(frozen=True, eq=False)
class Part:
    """One recording with the rotor that made it.

    Attributes
    ----------
    record : Record
        Points.
    model : Model
        Rotor.
    baseline : tuple of Effect
        Physics that the case has on.
    flow : Flow
        Recorded conditions with the baseline's loads.
    key : str
        Rotor: parts of one rotor share the error of its model.
    left_out : tuple of str
        Effects that the case switches off.
    instead : (C P,) float or None
        Baseline of another model, to which effects add what share they change in ours [N], [N m], [rev/min].
    """

    record: Record
    model: forward.Model
    baseline: tuple[Effect, ...]
    flow: Flow
    key: str = ""
    left_out: tuple[str, ...] = ()
    instead: Array | None = None
    _solved: dict[tuple[Effect, ...], tuple[Array, Array, Flow]] = field(default_factory=dict, repr=False)

    def predict(self, effects: Sequence[Effect]) -> Array:
        """Readings with a set of effects, around the baseline of another model where there is one.

        Parameters
        ----------
        effects : sequence of Effect
            All physics that is on.

        Returns
        -------
        (C P,) float
            Channels of :attr:`channels`, one after the other; NaN where not converged [N], [N m], [rev/min].
        """
        ours = self._ours(effects)
        if self.instead is None:
            return ours
        base = self._ours(self.baseline)
        return self.instead * (ours / base)

    def _ours(self, effects: Sequence[Effect]) -> Array:
        """Readings of the blade element model with a set of effects.

        Parameters
        ----------
        effects : sequence of Effect
            All physics that is on.

        Returns
        -------
        (C P,) float
            Channels of :attr:`channels`, one after the other; NaN where not converged [N], [N m], [rev/min].
        """
        # instruments do not change the flow: what they show of the same flow needs no new solution
        key = tuple(e for e in effects if not forward.only_reads(e))
        if key not in self._solved:
            loads, met, ok = forward.respond(self.model.prepared, key, self.flow)
            nan = np.where(ok, 1.0, np.nan)
            self._solved[key] = loads.T * nan, loads.Q * nan, met
        T, Q, met = self._solved[key]
        values = {"thrust_N": T.copy(), "torque_Nm": Q.copy()}
        if "rpm" in self.record.measured:
            values["rpm"] = self.steady_rpm.copy()
        reading = Reading(values, self.full_scale)
        for e in effects:
            e.reading(reading, met)
        return np.concatenate([reading.values[c] for c in self.channels])

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that were measured, in the order of :data:`CHANNELS`."""
        return tuple(c for c in CHANNELS if c in self.record.measured)

    @cached_property
    def steady_rpm(self) -> Array:
        """Speed as a smooth function of the pulse width, the baseline of the drive [rev/min]."""
        p, rpm = self.record.extra["pwm_s"], self.record.measured["rpm"]
        degree = min(_PULSE_POWERS - 1, np.unique(np.round(p, 6)).size - 1)
        x = (p - p.mean()) / max(float(np.ptp(p)), 1e-12)
        return np.asarray(np.polyval(np.polyfit(x, rpm, degree), x))

    @cached_property
    def full_scale(self) -> dict[str, float]:
        """Largest magnitude of the baseline per channel."""
        scale = {
            "thrust_N": float(np.nanmax(np.abs(self.flow.T0))),
            "torque_Nm": float(np.nanmax(np.abs(self.flow.Q0))),
        }
        if "rpm" in self.record.measured:
            scale["rpm"] = float(self.record.rpm.max())
        return scale


@dataclass(frozen=True, eq=False)
class Problem:
    """Stacked readings of all parts.

    Attributes
    ----------
    parts : tuple of Part
        Recordings.
    y, f0, u, scale : (M,) float
        Readings, baseline, standard uncertainty, and the size that shares refer to (the largest coefficient in the
        recording at the point's speed and density), each in the unit of its channel.
    u_known : bool
        Whether the recording states its uncertainties.
    channel, point, part : (M,) int
        Index into :data:`CHANNELS`, into all P points, into the parts.
    kept : (M0,) bool
        Which of all stacked readings were used (measured and converged).
    covariates : dict of str to (P,) float
        rpm, J, M_tip, Re and what was recorded besides.
    tangents : (M, K) float
        Change of the readings for one standard deviation of each nuisance [units of the readings].
    names : tuple of str
        Names of the nuisances.
    notes : tuple of str
        What was assumed or left out.
    predicted : dict
        Readings that were solved already, by the effects added.
    """

    parts: tuple[Part, ...]
    y: Array
    f0: Array
    u: Array
    scale: Array
    u_known: bool
    channel: NDArray[np.intp]
    point: NDArray[np.intp]
    part: NDArray[np.intp]
    kept: NDArray[np.bool_]
    covariates: dict[str, Array]
    tangents: Array
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()
    predicted: dict[Any, Array] = field(default_factory=dict, repr=False)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Readings in which a cause may be at work, (M,): all but those of reference recordings."""
        return np.array([not p.record.reference for p in self.parts])[self.part]

    @property
    def rotor(self) -> NDArray[np.intp]:
        """Index of the rotor of each reading, (M,)."""
        keys = list(dict.fromkeys(p.key for p in self.parts))
        return np.array([keys.index(p.key) for p in self.parts])[self.part]

    @property
    def residual(self) -> Array:
        """Recording minus baseline, (M,)."""
        return self.y - self.f0

    @property
    def baseline(self) -> tuple[Effect, ...]:
        """Physics that the (first) case has on."""
        return self.parts[0].baseline

    def predict(self, extra: Sequence[Effect]) -> Array:
        """Readings with effects added to the baseline, in place of those of the same id.

        Parameters
        ----------
        extra : sequence of Effect
            Effects.

        Returns
        -------
        (M,) float
            Kept readings; NaN where not converged [units of the readings].
        """
        key = tuple(extra)
        if key not in self.predicted:
            ids = {e.id for e in extra}
            full = [
                p.predict(p.baseline if p.record.reference else (*(e for e in p.baseline if e.id not in ids), *extra))
                for p in self.parts
            ]
            self.predicted[key] = np.concatenate(full)[self.kept]
        return self.predicted[key]

    def signature(self, extra: Sequence[Effect]) -> Array:
        """Change of the readings when effects are added: solve(with) - solve(without), (M,)."""
        return self.predict(extra) - self.f0


def _part(record: Record, case: Case, baseline: str) -> Part:
    ready = evaluate.prepare(case, None, _STATIONS)
    model, R = ready.model, ready.diameter_m / 2.0
    omega = record.rpm * np.pi / 30.0
    speed = np.hypot(omega * R, record.V)
    top = min(1.25, float(np.max(speed / record.air.a_sound)) * 1.12 + 0.03)
    chord = model.rotor.blade.chord
    ratio = record.air.rho / record.air.mu
    re_low = 0.15 * float(np.min(speed * ratio)) * float(np.min(chord))
    re_high = 1.3 * float(np.max(speed * ratio)) * float(np.max(chord))
    model = replace(model, mach_max=top, re_range=(re_low, re_high), _kept={})
    plain = [e for e in ready.effects if not forward.acts_on_points(e)]
    flow = forward.flow_of(model.prepared(plain), record.rpm, record.V, record.air, record.extra, ready.chord75_m)
    part = Part(record, model, ready.effects, flow, case.content_hash(), tuple(case.get("model.effects_off")))
    if baseline == "bemt":
        return part
    thrust = evaluate.k1k2(case, None, record.rpm, record.V, record.air).thrust_N
    nothing = np.full_like(thrust, np.nan)
    return replace(part, instead=np.concatenate([thrust if c == "thrust_N" else nothing for c in part.channels]))


def build(records: Sequence[Record], cases: Sequence[Case], baseline: str = "bemt") -> Problem:
    """Put recordings beside the baselines of their cases.

    Parameters
    ----------
    records : sequence of Record
        One or more.
    cases : sequence of Case
        One for all, or one each.
    baseline : str
        Model that is compared: "bemt", or "k1k2" for its thrust.

    Returns
    -------
    Problem
        Everything that follows needs no case any more.

    Raises
    ------
    InputError
        If there are fewer than three readings.
    """
    chosen = list(cases) * len(records) if len(cases) == 1 else list(cases)
    # recordings of one case share the errors of its model
    groups: dict[tuple[bool, str], tuple[Case, list[Record]]] = {}
    for r, c in zip(records, chosen, strict=True):
        groups.setdefault((r.reference, c.content_hash()), (c, []))[1].append(r)
    order = sorted(groups, key=lambda k: k[0])
    problem = assemble(tuple(_part(merged(groups[k][1]), groups[k][0], baseline) for k in order))
    if problem.y.size < _FEWEST:
        got = f"{problem.y.size} readings beside a converged baseline"
        raise InputError(Fault(records[0].name, "", got, f"{_FEWEST} or more"))
    return problem


def assemble(parts: tuple[Part, ...]) -> Problem:
    """Stack the readings of parts and add the nuisances.

    Parameters
    ----------
    parts : tuple of Part
        Recordings with their rotors.

    Returns
    -------
    Problem
        Everything that follows needs no case any more.
    """
    full = [p.predict(p.baseline) for p in parts]
    y = np.concatenate([np.concatenate([p.record.measured[c] for c in p.channels]) for p in parts])
    u = np.concatenate([np.concatenate([p.record.u[c] for c in p.channels]) for p in parts])
    f0 = np.concatenate(full)
    kept = np.isfinite(y) & np.isfinite(f0)
    sizes = [len(p.record) for p in parts]
    first = np.cumsum([0, *sizes])
    channel = np.concatenate(
        [np.repeat([CHANNELS.index(c) for c in p.channels], n) for p, n in zip(parts, sizes, strict=True)]
    )
    point = np.concatenate(
        [np.tile(np.arange(n) + f, len(p.channels)) for p, n, f in zip(parts, sizes, first, strict=False)]
    )
    part = np.repeat(np.arange(len(parts)), [len(p.channels) * n for p, n in zip(parts, sizes, strict=True)])
    notes = [f"{p.record.name}: {note}" for p in parts for note in p.record.notes]
    lost = int(np.isfinite(y).sum() - kept.sum())
    if lost:
        notes.append(f"{lost} readings left out: the baseline does not converge there")
    scale = np.concatenate([_scale(p) for p in parts])
    known = np.isfinite(u[kept])
    share = np.where(channel == CHANNELS.index("rpm"), _U_RPM, _U_DEFAULT)
    fallback = np.maximum(share * np.abs(y), np.minimum(share, _U_FLOOR) * scale)
    sigma = np.where(np.isfinite(u) & (u > 0), u, fallback)
    problem = Problem(
        parts, y[kept], f0[kept], sigma[kept], scale[kept], bool(known.mean() > 0.5), channel[kept], point[kept],
        part[kept], kept, _covariates(parts), np.zeros((int(kept.sum()), 0)), (), tuple(notes),
    )  # fmt: skip
    columns, names = _nuisances(problem)
    return replace(problem, tangents=columns, names=names)


def _scale(part: Part) -> Array:
    """Size of each reading that relative errors refer to: it does not vanish where the load does."""
    f, out = part.flow, []
    unit = {"thrust_N": f.rho * f.n**2, "torque_Nm": f.rho * f.n**2}
    for c in part.channels:
        y = part.record.measured[c]
        if c == "rpm":
            out.append(np.abs(part.steady_rpm))
        else:
            coefficient = np.abs(y / unit[c])
            out.append(unit[c] * float(np.nanquantile(coefficient, 0.9)))
    return np.concatenate(out)


def _covariates(parts: Sequence[Part]) -> dict[str, Array]:
    def join(f: Callable[[Part], Array]) -> Array:
        return np.concatenate([f(p) for p in parts])

    found = {
        "rpm": join(lambda p: p.flow.rpm),
        "J": join(lambda p: p.flow.J),
        "M_tip": join(lambda p: p.flow.M_tip),
        "Re": join(
            lambda p: p.flow.rho * p.flow.chord * np.hypot(0.75 * p.flow.omega * p.flow.R, p.flow.V) / p.flow.mu
        ),
        "density_kg_m3": join(lambda p: p.flow.rho),
    }
    return found | concatenated([p.record for p in parts])


def _stretch(problem: Problem) -> Array:
    """Size of the readings over the baseline for channels in other units, else 1: errors are shares of what is read."""
    out = np.ones_like(problem.y)
    for k in np.unique(problem.rotor):
        for c in np.unique(problem.channel):
            mine = (problem.rotor == k) & (problem.channel == c) & problem.free
            if mine.any():
                ratio = float(np.median(np.abs(problem.y[mine]) / np.maximum(np.abs(problem.f0[mine]), 1e-12)))
                out[mine] = 1.0 if 1.0 / _SLIPPED < ratio < _SLIPPED else ratio
    return out


def _nuisances(problem: Problem) -> tuple[Array, tuple[str, ...]]:
    """Tangents of the calibration, one standard deviation each."""
    columns: list[Array] = []
    names: list[str] = []
    y, f0, channel = problem.y, problem.f0, problem.channel

    stretch = _stretch(problem)

    def add(name: str, column: Array, of_reading: bool = False) -> None:
        column = column if of_reading else column * stretch
        if np.isfinite(column).all() and np.any(column != 0.0):
            columns.append(column)
            names.append(name)

    def everywhere(extra: Effect) -> Array:
        """Readings with an effect that reference recordings have too."""
        full = [p.predict((*(e for e in p.baseline if e.id != extra.id), extra)) for p in problem.parts]
        return np.concatenate(full)[problem.kept]

    def calibrated(name: str, **change: float) -> None:
        up, down = (everywhere(_Calibration(**{k: s * v for k, v in change.items()})) for s in (1.0, -1.0))
        add(name, 0.5 * (up - down))

    calibrated("pitch", pitch_deg=PRIORS["pitch"])
    calibrated("section drag", drag=PRIORS["section drag"])
    calibrated("lift slope", lift=PRIORS["lift slope"])
    rows = [(i, p) for i, p in enumerate(problem.parts)]
    for c, name in ((0, "thrust"), (1, "torque")):
        here = channel == c
        for i, p in rows:
            mine = here & (problem.part == i)
            key = CHANNELS[c]
            gain = p.record.gain.get(key, PRIORS[f"{name} gain"])
            zero = p.record.zero.get(key, PRIORS[f"{name} zero"] * p.full_scale.get(key, 0.0))
            tag = f" ({p.record.name})" if len(rows) > 1 else ""
            add(f"{name} gain{tag}", np.where(mine, gain * y, 0.0), of_reading=True)
            add(f"{name} zero{tag}", np.where(mine, zero, 0.0))
    load = channel < 2
    slope_V = np.concatenate([np.concatenate([_slope(p, c) for c in p.channels]) for p in problem.parts])[problem.kept]
    V = np.concatenate([p.flow.V for p in problem.parts])[problem.point]
    # at fixed V a speed error moves loads by 2 and by the change of J; at J = 0 only by 2
    add("speed of rotation", np.where(load, PRIORS["speed of rotation"] * (2.0 * f0 - V * slope_V), 0.0))
    J = problem.covariates["J"]
    x = ((J - 0.5 * (J.max() + J.min())) / max(0.5 * float(np.ptp(J)), 0.25))[problem.point]
    rotor = problem.rotor
    for k in np.unique(rotor):
        for c, name in ((0, "thrust"), (1, "torque")):
            mine = (rotor == k) & (channel == c)
            if not mine.any():
                continue
            own = np.where(mine, f0, 0.0)
            tag = f" (rotor {k})" if rotor.max() else ""
            add(f"level of {name}{tag}", PRIORS[f"level of {name}"] * own)
            size = np.where(own != 0.0, problem.scale, 0.0)
            if np.ptp(J) > 0.05:
                add(f"slope of {name} over J{tag}", PRIORS["slope over J"] * x * size, of_reading=True)
                add(f"bend of {name} over J{tag}", PRIORS["bend over J"] * (1.5 * x**2 - 0.5) * size, of_reading=True)
    recorded = all(p.record.air_recorded for p in problem.parts)
    add("density", np.where(load, PRIORS["density" if recorded else "density not recorded"] * f0, 0.0))
    add("airspeed", np.where(load, PRIORS["airspeed"] * V * slope_V, 0.0))
    run = problem.covariates["run"][problem.point]
    labels = np.unique(run)
    if 1 < labels.size <= 20:
        for label in labels:
            for c, name in ((0, "thrust"), (1, "torque")):
                mine = (run == label) & (channel == c)
                add(f"session {label:g} {name}", np.where(mine, PRIORS["session"] * y, 0.0), of_reading=True)
    for i, p in rows:
        if "rpm" in p.channels:
            x = p.record.extra["pwm_s"]
            x = (x - x.mean()) / max(float(np.ptp(x)), 1e-12)
            basis = np.concatenate([np.zeros(len(p.record) * (len(p.channels) - 1)), np.ones(len(p.record))])
            for k in range(_PULSE_POWERS):
                power = np.concatenate([np.zeros(len(p.record) * (len(p.channels) - 1)), x**k]) * basis
                whole = np.concatenate(
                    [power if j == i else np.zeros(len(q.record) * len(q.channels)) for j, q in rows]
                )
                add(f"pulse width^{k}", 0.05 * whole[problem.kept] * p.full_scale["rpm"])
    for e in problem.baseline:
        for parameter in e.parameters:
            if not e.diagnosed:
                continue
            step = PRIORS["parameter of the model"] * (parameter.high - parameter.low)
            value = float(getattr(e, parameter.name))
            value = value + step if value + step <= parameter.high else value - step
            add(f"{e.id} {parameter.name}", everywhere(replace(e, **{parameter.name: value})) - f0)  # type: ignore[type-var]
    modes = PRIORS["form of the model"] * smooth_modes(problem)
    for e in problem.baseline:
        without = [p.predict([b for b in p.baseline if b.id != e.id]) for p in problem.parts]
        own = f0 - np.concatenate(without)[problem.kept]
        # the published law of an effect that is on is no better known than that of one that is left out
        if np.isfinite(own).all() and float(np.max(np.abs(own) / problem.scale)) > _FORM_FLOOR:
            for k in range(modes.shape[1]):
                add(f"form of {e.id}", own * modes[:, k])
    matrix = np.stack(columns, axis=1) if columns else np.zeros((y.size, 0))
    return matrix, tuple(names)


def _slope(part: Part, channel: str) -> Array:
    by_name = {"thrust_N": part.flow.dT_dV, "torque_Nm": part.flow.dQ_dV}
    return by_name.get(channel, np.zeros(len(part.record)))

"""What may differ without being a cause: calibration of stand and blade, errors of the solver itself.

Nuisances enter as tangents with stated priors and are marginalised together with any effect, never fitted first:
fitting them first would absorb the physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.compare.drive_laws import BY_LOAD, TOLD_VOLTAGE
from bemt.judge.compare.matched import SESSION
from bemt.judge.compare.smooth_change import BEND
from bemt.judge.diagnose.noise import law_of, smooth_modes
from bemt.judge.diagnose.record import CHANNELS
from bemt.physics.effects.base import Effect
from bemt.physics.effects.duct import DuctEffect
from bemt.rotors.latents import NAMES, STEP, AsBuilt

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Part, Problem

PRIORS = {
    "thrust gain": 0.01, "torque gain": 0.01,
    "thrust zero": 0.002, "torque zero": 0.002, "speed of rotation": 0.003, "density": 0.005,
    "density not recorded": 0.015, "airspeed": 0.005, "parameter of the model": 0.25,
    "level of thrust": 0.06, "level of torque": 0.08, "slope over J": 0.05, "bend over J": 0.02,
    "jet area of a duct": 0.15,
    "form of the model": 0.2, "form in a variable of its own": 0.45,
}  # fmt: skip
"""Standard deviations: shares [1], zeros of full scale [1], parameters of active effects as a share of their published
range [1].  Gains and zeros are working calibrations; level, slope and bend are errors of the solver itself, declared
after volume 1 of the UIUC database; the jet area of a duct after DFDC, from whose thrust ours differs by 6 %, a
sixth of the area; the speed at a pulse width after a lithium cell charged to 4.15 instead of 4.20 V (declared); the
rest is declared."""

# Speed over pulse width at rest of everything else: terms of the polynomial.
PULSE_POWERS = 6
# Effects whose whole size is below this share of the largest coefficient need no error of their form.
_FORM_FLOOR = 0.005


Add = Callable[..., None]
"""Takes the name of a nuisance and its column."""


def nuisances(problem: Problem) -> tuple[Array, tuple[str, ...], NDArray[np.bool_], Array]:
    """Tangents of everything that may differ without being a cause."""
    columns: list[Array] = []
    names: list[str] = []
    solver: list[bool] = []

    def add(name: str, column: Array, of_reading: bool = False, own: bool = False) -> None:
        column = column if of_reading else column * problem.stretch
        if np.isfinite(column).all() and np.any(column != 0.0):
            columns.append(column)
            names.append(name)
            solver.append(own)

    offset = _of_blade(problem, add)
    _of_stand(problem, add)
    _of_flow_and_level(problem, add)
    _of_drives(problem, add)
    _of_model(problem, add)
    matrix = np.stack(columns, axis=1) if columns else np.zeros((problem.y.size, 0))
    return matrix, tuple(names), np.array(solver, dtype=bool), offset


def _everywhere(problem: Problem, extra: Effect, where_on: bool = False) -> Array:
    """Readings with an effect that reference recordings have too, or only in the parts whose case has it."""
    full = []
    for p in problem.parts:
        others = [e for e in p.baseline if e.id != extra.id]
        off = where_on and len(others) == len(p.baseline)
        full.append(p.predict(p.baseline if off else (*others, extra)))
    return np.concatenate(full)[problem.kept]


def blade_tangents(problem: Problem) -> Array:
    """Change of the readings for each latent number of the blade that is not certain, (M, K) [unit/unit of `NAMES`]."""
    tangents = np.zeros((problem.y.size, problem.blade.at.size))
    for k in problem.blade.used:
        up, down = (_everywhere(problem, problem.blade.changed(int(k), s * STEP[k])) for s in (1.0, -1.0))
        tangents[:, k] = (up - down) / (2.0 * STEP[k]) * problem.stretch
    return tangents


def _of_blade(problem: Problem, add: Add) -> Array:
    """What is open of the blade; gives the offset of the readings from its mean."""
    blade, offset = problem.blade, np.zeros_like(problem.y)
    tangents = blade_tangents(problem)
    if np.isfinite(tangents).all():
        offset = tangents @ (blade.at - blade.mean)
        for j in range(blade.root.shape[1]):
            add(f"blade {NAMES[j]}", tangents @ blade.root[:, j], of_reading=True)
    return offset


def _of_stand(problem: Problem, add: Add) -> None:
    """Gains and zeros."""
    y, channel = problem.y, problem.channel
    rows = [(i, p) for i, p in enumerate(problem.parts)]
    for c, name in ((0, "thrust"), (1, "torque")):
        here, key = channel == c, CHANNELS[c]
        # one stand, one gain: what it differs by from run to run is that of the runs, and the readings show it
        gain = max((p.record.gain[key] for p in problem.parts if key in p.record.gain), default=PRIORS[f"{name} gain"])
        add(f"{name} gain", np.where(here, gain * y, 0.0), of_reading=True)
        for i, p in rows:
            zero = p.record.zero.get(key, PRIORS[f"{name} zero"] * p.full_scale.get(key, 0.0))
            tag = f" ({p.record.name})" if len(rows) > 1 else ""
            add(f"{name} zero{tag}", np.where(here & (problem.part == i), zero, 0.0))
            if c == 1 and p.record.electrical:
                mine = here & (problem.part == i)
                add(f"losses of the motor{tag}", np.where(mine, SESSION["electrical"] * y, 0.0), of_reading=True)


def _of_flow_and_level(problem: Problem, add: Add) -> None:
    """Speed, air, and the level of the model over the advance ratio."""
    f0, channel = problem.f0, problem.channel
    load = channel < 2
    slopes = [{"thrust_N": p.flow.dT_dV, "torque_Nm": p.flow.dQ_dV, "rpm": 0.0 * p.flow.V} for p in problem.parts]
    slope_V = np.concatenate([of[c] for p, of in zip(problem.parts, slopes, strict=True) for c in p.channels])
    slope_V = slope_V[problem.kept]
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
            tag = f" (rotor {k})" if rotor.max() else ""
            add(f"level of {name}{tag}", PRIORS[f"level of {name}"] * np.where(mine, f0, 0.0))
            size = np.where(mine, problem.scale, 0.0)
            if np.ptp(J) > 0.05:
                for word, shape in (("slope", x), ("bend", 1.5 * x**2 - 0.5)):
                    column = PRIORS[f"{word} over J"] * shape * size
                    add(f"{word} of {name} over J{tag}", column, of_reading=True, own=True)
    recorded = all(p.record.air_recorded for p in problem.parts)
    add("density", np.where(load, PRIORS["density" if recorded else "density not recorded"] * f0, 0.0))
    add("airspeed", np.where(load, PRIORS["airspeed"] * V * slope_V, 0.0))


def _of_drives(problem: Problem, add: Add) -> None:
    y, f0, channel = problem.y, problem.f0, problem.channel
    for tag, drives in _drives(problem):
        pulse = np.concatenate([drives[i].record.extra["pwm_s"] for i in drives])
        middle, span = pulse.mean(), max(float(np.ptp(pulse)), 1e-12)
        top = max(p.full_scale["rpm"] for p in drives.values())
        at_pulse = np.zeros_like(y)
        turning = np.isin(problem.part, list(drives)) & (channel == CHANNELS.index("rpm"))
        every = np.concatenate([p.record.extra.get("pwm_s", np.zeros(len(p.record))) for p in problem.parts])
        at_pulse[turning] = 2.0 * (every[problem.point[turning]] - middle) / span
        for k in range(PULSE_POWERS):
            add(f"pulse width^{k}{tag}", np.where(turning, 0.05 * at_pulse**k * top, 0.0))
        for i, part in drives.items():
            if part.drive is not None and not part.record.reference:
                # two runs differ, and their speeds bend against each other: no battery empties twice alike
                varies = math.sqrt(2.0) * SESSION["speed"] * f0
                bend = BEND * (2.0 * at_pulse**2 - 1.0)
                mine = turning & (problem.part == i)
                for word, shape in (("", 1.0), (" (slope)", BEND * at_pulse), (" (bend)", bend)):
                    add(f"supply of the run{tag}{word}", np.where(mine, varies * shape, 0.0))
                follows = np.concatenate(
                    [_by_volts(p) if p is part else np.zeros(len(p.record)) for p in problem.parts]
                )
                add(f"voltage as recorded{tag}", np.where(mine, follows[problem.point] * f0, 0.0))


def _of_model(problem: Problem, add: Add) -> None:
    """Parameters and forms of the effects that are on."""
    f0 = problem.f0
    for wake in {p.model.duct.wake_ratio for p in problem.parts if p.model.duct is not None}:
        wider = DuctEffect(wake_ratio=(1.0 + PRIORS["jet area of a duct"]) * wake)
        add("jet area of a duct", _everywhere(problem, wider) - f0, own=True)
    for e in problem.baseline:
        for parameter in e.parameters:
            if not e.diagnosed:
                continue
            step = PRIORS["parameter of the model"] * (parameter.high - parameter.low)
            value = float(getattr(e, parameter.name))
            value = value + step if value + step <= parameter.high else value - step
            changed = _everywhere(problem, replace(e, **{parameter.name: value}), where_on=True) - f0  # type: ignore[type-var]
            add(f"{e.id} {parameter.name}", changed, own=True)
        for form in _other_forms(e):
            changed = _everywhere(problem, replace(e, form=form), where_on=True) - f0  # type: ignore[type-var]
            add(f"{e.id} as {form}", changed, own=True)
    for e in (e for e in problem.baseline if e.id != AsBuilt.id):
        without = [p.predict([b for b in p.baseline if b.id != e.id]) for p in problem.parts]
        share = f0 - np.concatenate(without)[problem.kept]
        # the published law of an effect that is on is no better known than that of one that is left out
        if np.isfinite(share).all() and float(np.max(np.abs(share) / problem.scale)) > _FORM_FLOOR:
            alone = any(k in problem.covariates for k in e.along)
            spread = PRIORS["form in a variable of its own" if alone else "form of the model"]
            modes = spread * smooth_modes(problem, e.along, law_of(e))
            size = _fading(problem, share) if alone else share
            for k in range(modes.shape[1]):
                add(f"form of {e.id}", size * modes[:, k], own=not alone)


def _fading(problem: Problem, change: Array) -> Array:
    """What a law may err by that fades by another power: geometric mean of its change and of the largest, as shares.

    A third of the vortex tube and image of Knight and Hefner (1941, NACA TN 835; not checked) is what Cheeseman and
    Bennett have near a wall, and three times as much at four radii.  (M,) [units of the readings]
    """
    share = np.abs(np.divide(change, problem.f0, out=np.zeros_like(change), where=problem.f0 != 0.0))
    for c in np.unique(problem.channel):
        mine = problem.channel == c
        share[mine] = np.sqrt(share[mine] * np.max(share[mine]))
    return problem.f0 * share


def _other_forms(e: Effect) -> list[str]:
    """Published laws of an effect beside its own: nobody knows which of them holds for this rotor."""
    mine = getattr(e, "form", None)
    return sorted({*e.words.get("form", ())} - {mine}) if mine and e.diagnosed else []


def _by_volts(part: Part) -> Array:
    """What the speed at a pulse width follows from the voltage as recorded, as far as that is no cause yet, (P,) ln."""
    extra = part.flow.extra
    if not {"voltage_V", "usual_voltage_V"} <= extra.keys():
        return np.zeros(len(part.record))
    change = np.nan_to_num(np.log(extra["voltage_V"] / extra["usual_voltage_V"]))
    return np.asarray(np.clip(change, -TOLD_VOLTAGE, TOLD_VOLTAGE))


def _drives(problem: Problem) -> Iterator[tuple[str, dict[int, Part]]]:
    """Parts with a speed over pulse width by index: together where a reference shows the curve, else one by one."""
    turning = {i: p for i, p in enumerate(problem.parts) if "rpm" in p.channels}
    if any(p.drive is not None for p in turning.values()):
        yield "", turning
    else:
        for i, p in turning.items():
            yield f" ({p.record.name})" if len(turning) > 1 else "", {i: p}


def following(problem: Problem, loads: Problem) -> Problem:
    """Problem of a drive with what its speed follows from loads that changed, by as much as they did over the run."""
    change = _torque_change(loads)
    here = np.flatnonzero(problem.free & (problem.channel == CHANNELS.index("rpm")))
    if not here.size or not change.size:
        return problem
    level, power, unsure = float(np.median(change)), *BY_LOAD["speed"]
    bent = abs(power) * float(np.quantile(np.abs(change - level), 0.9)) + unsure * abs(level)
    pulse = problem.covariates["pwm_s"][problem.point[here]]
    x = (pulse - pulse.mean()) / max(float(np.ptp(pulse)), 1e-12)
    follows = abs(power) + unsure
    shapes = [np.full(here.size, follows * level), 2.0 * bent * x, bent * (8.0 * x**2 - 1.0)]
    if "time_s" in problem.covariates and "time_s" in loads.covariates:  # what changes a load with time, the motor, too
        t = loads.covariates["time_s"][loads.point[_torque(loads)]]
        order = np.argsort(t, kind="stable")
        now = np.interp(problem.covariates["time_s"][problem.point[here]], t[order], change[order] - level)
        shapes.append(follows * now)
    columns = np.zeros((problem.y.size, len(shapes)))
    columns[here] = np.stack(shapes, axis=1) * problem.f0[here, None]
    names = tuple(f"load of the motor ({k})" for k in ("level", "slope", "bend", "time")[: len(shapes)])
    return replace(
        problem, tangents=np.concatenate([problem.tangents, columns], axis=1), names=(*problem.names, *names),
        own=np.concatenate([problem.own, np.zeros(len(shapes), dtype=bool)]),
    )  # fmt: skip


def _torque(loads: Problem) -> NDArray[np.bool_]:
    """Readings of the test that show its torque: thrust where nothing else does, (M,)."""
    for c in (1, 0):
        mine = np.asarray(loads.free & (loads.channel == c) & (loads.y * loads.f0 > 0.0))
        if mine.any():
            return mine
    return np.zeros(loads.y.size, dtype=bool)


def _torque_change(loads: Problem) -> Array:
    """How much more torque than before at one speed, natural logarithm: than the reference where there is one."""
    mine = _torque(loads)
    if not mine.any():
        return np.zeros(0)
    off, rpm = np.zeros(loads.y.size), loads.covariates["rpm"][loads.point]
    valid = loads.y * loads.f0 > 0.0
    off[valid] = np.log(loads.y[valid] / loads.f0[valid])
    before = valid & ~loads.free & (loads.channel == loads.channel[mine][0])
    order = np.argsort(rpm[before], kind="stable")
    usual = np.interp(rpm[mine], rpm[before][order], off[before][order]) if before.any() else 0.0
    return np.asarray(off[mine] - usual)

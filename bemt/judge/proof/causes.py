"""What is tested (rotor, duct, points in their order) and what an item may conceal, by the ids of the effects.

A cause is a change of the truth's `World`, of its sections or of the `StandErrors`.  ``without`` is the same truth with
the cause taken away, for the causes that every real rotor has (Reynolds number, Mach number, duct ...); the others are
absent by default.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.judge.proof.stand import StandErrors, StandMotor
from bemt.judge.proof.truth import TruthRotor
from bemt.judge.proof.truth_section import TrueSection
from bemt.judge.proof.truth_world import Conditions, TruthDuct, World, torsion

OPEN_PLANS = ("static_sweep", "grid_shuffled", "grid_ordered", "two_air", "wall", "endurance", "transient")
DUCTED_PLANS = ("static_sweep", "grid_shuffled", "two_air", "gap", "endurance")
UNDERPOWERED = ("static_narrow", "single_line")
HUB_OPEN, HUB_DUCTED, WALL = 0.15, 0.35, 1.01
_SOUND = 343.0


@dataclass(frozen=True)
class Rig:
    """A rotor on its stand."""

    name: str  # Fit for a folder
    rotor: TruthRotor  # Blades
    duct: TruthDuct | None  # Duct around it
    pitch_ratio: float  # Geometric pitch over diameter. [-]
    tip_mach: float  # Rotational tip Mach number at the top of its speed range, 20 C. [-]
    motor: StandMotor  # Drive

    @property
    def top_rpm(self) -> float:
        """Highest speed. [rev/min]"""
        return self.tip_mach * _SOUND / self.rotor.radius * 60.0 / (2.0 * np.pi)


def draw_rig(name: str, ducted: bool, rng: np.random.Generator, code: str = "vortex") -> Rig:
    """Draw a rotor from the ranges of small propellers and fans."""
    hub = HUB_DUCTED if ducted else HUB_OPEN
    blades = int(rng.choice((3, 4, 5, 6) if ducted else (2, 2, 2, 3, 4)))
    radius = float(rng.uniform(0.035, 0.12) if ducted else rng.uniform(0.09, 0.22))
    pitch = float(rng.uniform(0.7, 1.1) if ducted else rng.uniform(0.45, 0.85))
    mach = float(rng.uniform(0.5, 0.85))
    x = np.linspace(hub, 1.0, 21)
    widest = float(rng.uniform(0.18, 0.30) if ducted else rng.uniform(0.14, 0.23))
    peak = float(rng.uniform(0.35, 0.55))
    if ducted:
        chord = widest * (1.0 + float(rng.uniform(-0.2, 0.2)) * (x - peak))
    else:
        inner = 0.55 + 0.45 * np.sin(0.5 * np.pi * np.clip((x - hub) / (peak - hub), 0.0, 1.0))
        chord = widest * np.where(x < peak, inner, np.sqrt(np.maximum(1.0 - ((x - peak) / (1.04 - peak)) ** 2, 0.05)))
    section = TrueSection(float(rng.uniform(0.02, 0.05)), 0.4, float(rng.uniform(0.07, 0.12)))
    beta = np.arctan(pitch / (np.pi * x))
    rotor = TruthRotor(
        radius, blades, tuple(map(float, x)), tuple(map(float, chord)), tuple(map(float, beta)), section,
        wall=WALL if ducted else float("nan"), code=code,
    )  # fmt: skip
    duct = None
    if ducted:
        length = float(rng.uniform(0.8, 1.8))
        duct = TruthDuct(length, length * float(rng.uniform(0.25, 0.45)), float(rng.uniform(0.006, 0.012)),
                         float(rng.uniform(0.92, 1.05)), float(rng.uniform(0.08, 0.2)))  # fmt: skip
    top = mach * _SOUND / radius * 60.0 / (2.0 * np.pi)
    # torque at full speed, roughly, sets current and resistance of a motor that fits
    torque = 0.006 * 1.2 * (top / 60.0) ** 2 * (2.0 * radius) ** 5 * blades / 2.0
    volts = 22.2 if radius < 0.15 else 44.4
    kv = top / (0.75 * volts)
    amps = torque * 2.0 * np.pi * kv / 60.0
    return Rig(
        name, rotor, duct, pitch, mach, StandMotor(kv, 0.06 * volts / amps, 0.02 * amps, volts, 0.03 * volts / amps)
    )


def conditions(plan: str, rig: Rig, rng: np.random.Generator) -> Conditions:
    """Rows of a test plan, in the order in which they are taken."""
    top, R = rig.top_rpm, rig.rotor.radius
    T0, p0 = float(rng.uniform(12.0, 26.0)), float(rng.uniform(97e3, 102.5e3))
    jmax = (0.9 if rig.duct is None else 0.6) * rig.pitch_ratio
    nan = float("nan")

    def rows(
        rpm: Array, j: Array, T: Array | float = T0, p: Array | float = p0, wall: Array | float = nan,
        gap: Array | float = nan, run: Array | int = 0, dwell: float = 12.0, shuffle: bool = False, start: bool = False,
    ) -> Conditions:  # fmt: skip
        parts = list(np.broadcast_arrays(*(np.asarray(v, float) for v in (rpm, j, T, p, wall, gap, run))))
        if shuffle:
            order = np.lexsort((rng.random(parts[0].size), parts[6]))
            parts = [v[order] for v in parts]
        n = parts[0].size
        label = parts[6].astype(np.int64)
        time = dwell * np.arange(n) * (1.0 + 0.1 * rng.random()) + 240.0 * np.cumsum(
            np.diff(label, prepend=label[0]) != 0
        )
        first = np.array([np.flatnonzero(label == k)[0] for k in label])
        since = time - time[first] + dwell if start else np.full(n, 600.0)
        drift = 0.3 * np.sin(time / 900.0)  # a hall warms and cools
        return Conditions(parts[0], parts[1] * parts[0] / 60.0 * 2.0 * R, parts[2] + drift, parts[3], time, since,
                          parts[4], parts[5], label)  # fmt: skip

    def grid(speeds: Array, advances: Array) -> tuple[Array, Array]:
        a, b = np.meshgrid(speeds, advances, indexing="ij")
        return a.ravel(), b.ravel()

    if plan == "static_sweep":
        up = np.linspace(0.25, 1.0, 12) * top
        once = np.concatenate((up, up[::-1]))
        return rows(np.tile(once, 2), np.zeros(48), run=np.repeat([0, 1], 24))
    if plan in ("grid_shuffled", "grid_ordered"):
        n, j = grid(np.linspace(0.3, 1.0, 6) * top, np.linspace(0.0, jmax, 9))
        return rows(n, j, run=np.repeat([0, 1, 2, 3, 4, 5], 9) // 2, shuffle=plan == "grid_shuffled")
    if plan == "two_air":
        n, j = grid(np.linspace(0.35, 1.0, 5) * top, np.linspace(0.0, jmax, 6))
        cold = np.repeat([0, 1], n.size)
        return rows(np.tile(n, 2), np.tile(j, 2), T=np.where(cold, T0 - 22.0, T0), p=np.where(cold, 0.80 * p0, p0),
                    run=cold, shuffle=True)  # fmt: skip
    if plan == "wall":
        n, z = grid(np.linspace(0.35, 0.9, 6) * top, np.array([0.6, 0.8, 1.1, 1.6, 2.5, 4.0, 8.0]) * R)
        return rows(n, np.zeros(n.size), wall=z, run=0, shuffle=True)
    if plan == "gap":
        span = (1.0 - rig.rotor.hub) * R
        n, g = grid(np.linspace(0.4, 1.0, 6) * top, np.array([0.006, 0.012, 0.02, 0.03, 0.045]) * span)
        return rows(np.tile(n, 2), np.repeat([0.0, 0.5 * jmax], n.size), gap=np.tile(g, 2),
                    run=np.repeat([0, 1], n.size), shuffle=True)  # fmt: skip
    if plan == "endurance":
        levels = np.tile(np.array([0.45, 0.7, 0.95, 0.6, 0.85]) * top, 12)
        return rows(levels, np.zeros(60), run=np.repeat([0, 1, 2], 20), dwell=30.0, start=True)
    if plan == "transient":
        t = np.asarray(np.arange(160) * 0.025, dtype=np.float64)
        corners = [0.0, 0.5, 0.51, 1.5, 1.51, 2.5, 2.51, 3.2, 3.21, 4.0]
        target = np.interp(t, corners, np.repeat([0.4, 0.8, 0.55, 0.95, 0.5], 2))
        n = np.empty(t.size)
        n[0] = target[0]
        for i in range(1, t.size):
            n[i] = n[i - 1] + (1.0 - np.exp(-0.025 / 0.12)) * (target[i] - n[i - 1])
        still = np.full(t.size, nan)
        state = (np.full(t.size, T0), np.full(t.size, p0), t, np.full(t.size, 600.0), still, still)
        return Conditions(np.asarray(n * top), 0.0 * t, *state, np.zeros(t.size, dtype=np.int64), True)
    if plan == "static_narrow":
        return rows(np.tile(np.linspace(0.45, 0.55, 4) * top, 3), np.zeros(12))
    if plan == "single_line":
        return rows(np.full(9, 0.5 * top), np.linspace(0.0, jmax, 9))
    raise ValueError(f"unknown plan {plan!r}")


def extended(rows: Conditions, points: Sequence[Mapping[str, float]]) -> Conditions:
    """Rows of a plan with recommended points behind them, as a run of its own."""

    def column(name: str, key: str, usual: float, scale: float = 1.0) -> np.ndarray[Any, np.dtype[np.float64]]:
        new = [float(p[key]) * scale if key in p else usual for p in points]
        return np.concatenate((getattr(rows, name), new))

    last = float(rows.time[-1]) + 240.0
    moment = np.concatenate((rows.time, [float(p.get("time_s", last + 12.0 * k)) for k, p in enumerate(points)]))
    wall, gap = (float(np.median(v)) for v in (rows.wall, rows.gap))
    return Conditions(
        column("rpm", "rpm", float(np.median(rows.rpm))), column("airspeed", "airspeed_m_s", 0.0),
        column("temperature_C", "temperature_C", float(np.median(rows.temperature_C))),
        column("pressure_Pa", "pressure_Pa", float(np.median(rows.pressure_Pa))), moment,
        np.concatenate((rows.since_start, np.full(len(points), 600.0))), column("wall", "wall_distance_m", wall),
        column("gap", "tip_gap_mm", gap, 1e-3), np.concatenate((rows.run, np.full(len(points), rows.run.max() + 1))),
        rows.transient,
    )  # fmt: skip


_FLIGHT = ("grid_shuffled", "grid_ordered", "two_air", "single_line")
_SETTLED = tuple(p for p in (*OPEN_PLANS, *DUCTED_PLANS, *UNDERPOWERED) if p not in ("transient", "wall", "gap"))
_ANY = tuple(dict.fromkeys((*_SETTLED, "wall", "gap")))


@dataclass(frozen=True)
class Change:
    """What a cause changes."""

    # Fields of `World`, `SectionPhysics` and `StandErrors` with their values
    world: Mapping[str, Any] = field(default_factory=dict)
    section: Mapping[str, Any] = field(default_factory=dict)
    stand: Mapping[str, Any] = field(default_factory=dict)
    ducted: bool | None = None  # False takes the duct away
    # Size in the terms that a report may use: name to value and unit
    parameters: Mapping[str, tuple[float, str]] = field(default_factory=dict)


Make = Callable[[float, Rig, Conditions, np.random.Generator], Change]


@dataclass(frozen=True)
class Cause:
    """One thing that may be concealed."""

    id: str  # Effect, or a name of an unlisted cause
    make: Make  # Change for a relative strength (1 is ordinary), a rig, its conditions and a source of signs
    kind: str = "air"  # air, stand, drive or unlisted
    plans: tuple[str, ...] = _SETTLED  # Plans in which it can be at work
    ducted: bool | None = None  # Whether it needs a duct (True), an open rotor (False) or neither
    off: tuple[str, ...] = ()  # Effects that the baseline leaves out
    without: Change = field(default_factory=Change)  # The truth less the cause
    variables: tuple[str, ...] = ()  # Covariates along which it shows; any of them is a right answer of the location

    @property
    def removable(self) -> bool:
        """Whether a stand can run without it: nobody can take friction or compressibility away."""
        return not self.without.section


def applied(world: World, stand: StandErrors, change: Change) -> tuple[World, StandErrors]:
    """World and stand with a change."""
    section = replace(world.section, **dict(change.section)) if change.section else world.section
    return replace(world, section=section, **dict(change.world)), replace(stand, **dict(change.stand))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice((-1.0, 1.0)))


def _field(
    of: str, name: str, size: float, parameter: str = "", unit: str = "1", signed: bool = True, scale: float = 1.0
) -> Make:  # fmt: skip
    """Make one field of world, section or stand of this size; ``scale`` turns our value into that of the library.

    Full scale of its cells is the largest load, ours 1.2 of it; its airspeed is the recorded one plus an offset.
    """

    def make(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
        value = f * size * (_sign(rng) if signed else 1.0)
        return Change(**{of: {name: value}, "parameters": {parameter: (value * scale, unit)} if parameter else {}})  # type: ignore[arg-type]

    return make


_world, _section = (partial(_field, of, signed=False) for of in ("world", "section"))
_stand = partial(_field, "stand")


def _untwist(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    turn = 1.4 * f * _sign(rng)
    kelvin = c.temperature_C + 273.15
    at = float(np.max(c.pressure_Pa / (287.05 * kelvin) * (c.rpm * np.pi / 30.0) ** 2))
    there = float(np.interp(0.75, rig.rotor.x, torsion(rig.rotor)))
    return Change(world={"untwist": turn, "untwist_at": at}, parameters={"turn_deg": (-turn * there, "deg")})


def _inertia(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    omega = c.rpm * (np.pi / 30.0)
    kick = float(np.max(np.abs(np.gradient(omega, c.time))))
    torque = 0.005 * 1.2 * (c.rpm.max() / 60.0) ** 2 * (2.0 * rig.rotor.radius) ** 5 * rig.rotor.blades / 2.0
    return Change(world={"inertia": 0.25 * f * torque / kick})


def _unit(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    channel, of, units = [("thrust", "N", ("kgf", "lbf", "gf")),
                          ("torque", "Nm", ("Ncm", "mNm", "kgf_m", "lbf_in"))][int(rng.integers(2))]  # fmt: skip
    factor = float(rng.choice([unit_errors.named(unit, of).factor for unit in units]))
    return Change(stand={"unit_slip": factor, "unit_channel": channel}, parameters={"factor": (factor, "1")})


def _density(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    value = f * 0.03 if rng.random() < 0.4 else -f * 0.12
    return Change(world={"density_error": value}, parameters={"change": (value, "1")})


def _recirculation(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    return Change(world={"recirculation": 0.08 * f, "recirculation_time": float(rng.uniform(5.0, 60.0))},
                  parameters={"k": (0.08 * f, "1")})  # fmt: skip


def _drift(name: str) -> Make:
    def make(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
        return Change(stand={name: 0.02 * f * _sign(rng), "drift_time": float(rng.uniform(120.0, 900.0))})

    return make


def _resonance(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    at = float(np.quantile(c.rpm, rng.uniform(0.35, 0.8)))
    return Change(world={"resonance": 0.08 * f, "resonance_rpm": at})


def _bearing(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    top = float(c.rpm.max())
    torque = 0.005 * 1.2 * (top / 60.0) ** 2 * (2.0 * rig.rotor.radius) ** 5 * rig.rotor.blades / 2.0
    return Change(world={"bearing": 0.05 * f * torque * 1e4 / top})


def _bubble(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    speed = 0.75 * np.median(c.rpm) * np.pi / 30.0 * rig.rotor.radius
    re = 1.2 * speed * float(np.interp(0.75, rig.rotor.r_R, rig.rotor.c_R)) * rig.rotor.radius / 1.8e-5
    return Change(section={"bubble_cl": 0.12 * f, "bubble_re": re * float(rng.uniform(0.8, 1.2))})


_SPEED = ("rpm", "re", "m_tip", "mach")
_FLOW = ("j", "airspeed")
_CLOCK = ("time", "temperature", "run")
_ALL: tuple[Cause, ...] = (
    Cause("reynolds", _section("reynolds", 1.0), off=("reynolds",), without=Change(section={"reynolds": 0.0}),
          variables=_SPEED),
    Cause("compressibility", _section("compressibility", 1.0, "amplitude"), off=("compressibility",),
          without=Change(section={"compressibility": 0.0}), variables=_SPEED),
    Cause("drag_divergence", _section("drag_divergence", 1.0), off=("drag_divergence",),
          without=Change(section={"drag_divergence": 0.0}), variables=_SPEED),
    Cause("stall_delay", _section("stall_delay", 1.5), off=("stall_delay",),
          without=Change(section={"stall_delay": 0.0}), variables=(*_FLOW, *_SPEED)),
    Cause("section", _section("camber", 0.008, "camber", signed=True), variables=(*_FLOW, *_SPEED)),
    Cause("duct", lambda f, rig, c, rng: Change(), ducted=True, plans=tuple(p for p in DUCTED_PLANS if p != "gap"),
          off=("duct",), without=Change(ducted=False), variables=_FLOW),
    Cause("tip_gap", _world("leak", 1.0), ducted=True, plans=("gap",), off=("tip_gap",),
          without=Change(world={"leak": 0.0}), variables=("tip_gap",)),
    Cause("lip_separation", _world("lip", 0.5), ducted=True, plans=tuple(p for p in DUCTED_PLANS if p != "gap"),
          variables=(*_FLOW, *_SPEED)),
    Cause("ground_effect", _world("ground", 1.0), ducted=False, plans=("wall",), without=Change(world={"ground": 0.0}),
          variables=("wall",)),
    Cause("recirculation", _recirculation, plans=("endurance",), variables=_CLOCK),
    Cause("tunnel_blockage", _world("blockage", 0.06, "area_ratio"), ducted=False, plans=_FLIGHT, variables=_FLOW),
    Cause("untwist", _untwist, variables=_SPEED),
    Cause("nacelle", lambda f, rig, c, rng: Change(world={"nacelle": 0.45 * f, "nacelle_cd": 0.015 * f}), ducted=False,
          plans=_FLIGHT, variables=_FLOW),
    Cause("pitch_offset", _world("pitch_offset", 1.1, "offset_deg", "deg", signed=True), plans=_SETTLED,
          variables=(*_FLOW, *_SPEED)),
    Cause("oblique_inflow", _world("oblique", 35.0, "angle_deg", "deg"), ducted=False, plans=_FLIGHT, variables=_FLOW),
    Cause("air_density", _density, plans=tuple(p for p in _ANY if p != "two_air"), variables=(*_SPEED, *_FLOW)),
    Cause("rpm_scale", _stand("rpm_scale", 0.012, "eps"), "stand", _ANY, variables=(*_SPEED, *_FLOW)),
    Cause("airspeed_offset", _stand("airspeed_offset", 0.45, "offset_m_s", "m/s", scale=-1.0), "stand", _FLIGHT,
          variables=_FLOW),
    Cause("airspeed_gain", _stand("airspeed_gain", 0.08, "gain"), "stand", _FLIGHT, variables=_FLOW),
    Cause("thrust_gain", _stand("thrust_gain", 0.05, "gain"), "stand", _ANY),
    Cause("torque_gain", _stand("torque_gain", 0.05, "gain"), "stand", _ANY),
    Cause("thrust_zero", _stand("thrust_zero", 0.02, "zero", scale=1.2), "stand", _ANY, variables=_SPEED),
    Cause("torque_zero", _stand("torque_zero", 0.02, "zero", scale=1.2), "stand", _ANY, variables=_SPEED),
    Cause("cross_talk", _stand("cross_talk", 0.06, "k"), "stand", _SETTLED, variables=_FLOW),
    Cause("thrust_drift", _drift("thrust_drift"), "stand", ("grid_shuffled", "grid_ordered", "endurance"),
          variables=_CLOCK),
    Cause("torque_drift", _drift("torque_drift"), "stand", ("grid_shuffled", "grid_ordered", "endurance"),
          variables=_CLOCK),
    Cause("unit_slip", _unit, "stand", _ANY),
    Cause("rotor_inertia", _inertia, plans=("transient",), variables=_CLOCK),
    Cause("inflow_lag", _world("inflow_lag", 0.08, "tau_s", "s"), plans=("transient",), ducted=False, variables=_CLOCK),
    Cause("motor_heating", lambda f, rig, c, rng: Change(stand={"motor_heating": 45.0 * f},
                                                         parameters={"rise_K": (45.0 * f, "K")}),
          "drive", ("endurance",), variables=_CLOCK),
    Cause("battery_sag", lambda f, rig, c, rng: Change(stand={"battery_sag": 0.10 * f},
                                                       parameters={"discharge": (0.10 * f, "1")}),
          "drive", ("endurance",), variables=(*_CLOCK, *_SPEED, "voltage")),
    Cause("resonance", _resonance, "unlisted", ("static_sweep", "grid_shuffled", "grid_ordered", "two_air")),
    Cause("bearing_drag", _bearing, "unlisted", ("static_sweep", "grid_shuffled", "grid_ordered", "two_air")),
    Cause("hysteresis", lambda f, rig, c, rng: Change(stand={"hysteresis": 0.03 * f}), "unlisted",
          ("static_sweep", "grid_ordered")),
    Cause("bubble_step", _bubble, "unlisted", ("static_sweep", "grid_shuffled", "grid_ordered", "two_air")),
)  # fmt: skip

CAUSES: dict[str, Cause] = {cause.id: cause for cause in _ALL}
"""All causes by id."""
LISTED = tuple(cause.id for cause in _ALL if cause.kind != "unlisted")
"""Ids of the effects that a diagnosis may name."""
UNLISTED = tuple(cause.id for cause in _ALL if cause.kind == "unlisted")
"""Names of causes that no effect describes."""

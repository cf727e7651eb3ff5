"""Causes that an item may conceal, by the ids of the effects; how strong, in which plans, what the baseline leaves out.

A cause is a change of the truth's `World`, of its sections or of the `StandErrors`.  ``without`` is the same truth with
the cause taken away, for the causes that every real rotor has (Reynolds number, Mach number, duct ...); the others are
absent by default.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bemt.base import unit_errors
from bemt.judge.proof.rigs import DUCTED_PLANS, OPEN_PLANS, UNDERPOWERED, Rig
from bemt.judge.proof.stand import StandErrors
from bemt.judge.proof.truth_world import Conditions, World

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


def _world(name: str, size: float, parameter: str = "", unit: str = "1", signed: bool = False) -> Make:
    """Make a field of the world of this size."""

    def make(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
        value = f * size * (_sign(rng) if signed else 1.0)
        said = {parameter: (value, unit)} if parameter else {}
        return Change(world={name: value}, parameters=said)

    return make


def _section(name: str, size: float, parameter: str = "", signed: bool = False) -> Make:
    def make(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
        value = f * size * (_sign(rng) if signed else 1.0)
        return Change(section={name: value}, parameters={parameter: (value, "1")} if parameter else {})

    return make


def _stand(name: str, size: float, parameter: str, unit: str = "1", scale: float = 1.0) -> Make:
    """Make a fault of the stand; ``scale`` turns our value into that of the library.

    Its full scale is the largest load, ours 1.2 of it; its airspeed is the recorded one plus an offset.
    """

    def make(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
        value = f * size * _sign(rng)
        return Change(stand={name: value}, parameters={parameter: (value * scale, unit)} if parameter else {})

    return make


def _untwist(f: float, rig: Rig, c: Conditions, rng: np.random.Generator) -> Change:
    turn = 1.4 * f * _sign(rng)
    kelvin = c.temperature_C + 273.15
    at = float(np.max(c.pressure_Pa / (287.05 * kelvin) * (c.rpm * np.pi / 30.0) ** 2))
    return Change(world={"untwist": turn, "untwist_at": at}, parameters={"tip_deg": (-turn, "deg")})


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
    Cause("lip_separation", _world("lip", 0.8), ducted=True, plans=tuple(p for p in DUCTED_PLANS if p != "gap"),
          variables=(*_FLOW, *_SPEED)),
    Cause("ground_effect", _world("ground", 1.0), ducted=False, plans=("wall",), variables=("wall",)),
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

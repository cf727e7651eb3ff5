"""The best propeller on sale for the same points: standard labels, each at whatever speed gives the thrust."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import INCH
from bemt.rotors.case import Case
from bemt.rotors.case.load import with_changes
from bemt.tools.design import rotor_loads
from bemt.tools.design.requirement import Requirement
from bemt.tools.design.rotor_loads import RotorLoads
from bemt.tools.design.search import DIAMETERS, pitches_in

SMALLEST = 0.6
"""Diameters tried, over that of the design, from here to 1 [1]."""
FAN_RATIOS = (0.6, 0.8, 1.0, 1.2, 1.45, 1.7, 2.0)
FAN_CHORDS = (0.3, 0.45)


@dataclass(frozen=True, eq=False)
class Label:
    """A propeller at points: speeds [rev/min], thrusts [N] and powers [W], (P,) each, and mean power [W]."""

    name: str
    case: Case
    rpm: Array
    thrust_N: Array
    power_W: Array
    mean_W: float


def standard(need: Requirement) -> list[str]:
    """Labels on sale up to the diameter, and of the diameter itself; two blades, and as many as asked for."""
    D = 2.0 * need.R / INCH
    sizes = [float(d) for d in DIAMETERS if SMALLEST * D <= d < D * (1.0 - 1e-6)] + [round(D, 2)]
    flying = any(p.airspeed_m_s for p in need.points)
    blades = dict.fromkeys((2, min(max(need.blades, 2), 8)))
    return [f"{d:g}x{P:g}" + (f"x{B}" if B != 2 else "") for d in sizes for P in pitches_in(d, flying) for B in blades]


def rivals(need: Requirement, ducted: Case | None) -> Iterator[tuple[str, Case]]:
    """Names and cases of what is on sale; in a duct, blades of constant pitch and the chord of fans."""
    if ducted is None:
        yield from ((label, rotor_loads.case_of_label(label)) for label in standard(need))
        return
    section = ducted.written["blade"].get("section")
    for chord in FAN_CHORDS:
        for ratio in FAN_RATIOS:
            blade = {"chord_law": "fan", "max_chord_over_R": chord, "pitch_ratio": ratio, "section": section}
            name = f"fan blade, pitch {ratio:g} D, chord {chord:g} R"
            yield name, with_changes(ducted, {"blade": blade, "assumptions": [], "polars": []})


def best_labels(need: Requirement, ducted: Case | None = None) -> tuple[Label | None, Label | None]:
    """Those with the least mean power that meet every point: at the speed that suits each, and at the speeds asked for.

    The second has at least the thrust at those speeds; None if no speed is asked for, or none has the thrust.
    """
    own, same = [], []
    for name, case in rivals(need, ducted):
        loads = _loads(name, case, need)
        own += [one for one in (_at_points(name, case, need, loads, fixed=False),) if one is not None]
        if all(p.rpm is not None for p in need.points if p.weight > 0.0):
            same += [one for one in (_at_points(name, case, need, loads, fixed=True),) if one is not None]
    return min(own, key=lambda one: one.mean_W, default=None), min(same, key=lambda one: one.mean_W, default=None)


def _loads(name: str, case: Case, need: Requirement) -> dict[float, RotorLoads | None]:
    """Thrust and torque over speed, up to the tip Mach number, by airspeed."""
    fast = {p.airspeed_m_s: 60.0 * tip / (math.pi * case.diameter_m) for p in need.points
            if (tip := _tip_speed(need, p.airspeed_m_s)) > 0.0}  # fmt: skip
    return {V: rotor_loads.loads_of_case(name, case, rpm, V, need.air) for V, rpm in fast.items()}


def _at_points(
    name: str, case: Case, need: Requirement, loads: dict[float, RotorLoads | None], fixed: bool
) -> Label | None:
    rows = []
    for p in need.points:
        one = loads.get(p.airspeed_m_s)
        if one is None:
            return None
        n = p.rpm if fixed and p.rpm is not None else float(one.speed_for(np.array([p.thrust_N]))[0])
        T = float(np.interp(n, one.rpm, one.thrust_N, right=math.nan))
        P = float(one.torque_at(np.array([n]))[0]) * n * math.pi / 30.0
        if not (math.isfinite(n + P) and T >= (1.0 - 1e-3) * p.thrust_N and P > 0.0):
            return None
        rows.append((n, T, P))
    rpm, thrust, power = np.array(rows).T
    weight = np.array([p.weight for p in need.points])
    return Label(name, case, rpm, thrust, power, float(weight @ power / weight.sum()))


def _tip_speed(need: Requirement, airspeed_m_s: float) -> float:
    """Speed of the tip in the disk at the limit of the tip Mach number [m/s]."""
    return math.sqrt(max((need.limits.max_tip_mach * float(need.air.a_sound)) ** 2 - airspeed_m_s**2, 0.0))

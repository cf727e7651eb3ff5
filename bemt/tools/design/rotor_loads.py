"""Loads of a label over speed, and how far a real rotor with this label is from them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.physics.air import Air
from bemt.physics.cavitation import WET, keller_N
from bemt.rotors.case import Case, case_of, fresh
from bemt.rotors.case.lattice import SPEEDS
from bemt.rotors.case.load import with_changes
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import propagate
from geometry.common import pchip

FINE = 481
SPEED_STEP = 1.2
"""Ratio of neighbouring speeds at which bands are computed [1]."""


@dataclass(frozen=True, eq=False)
class RotorLoads:
    """Thrust and torque of a rotor over speed, (FINE,) each, up to where the solver converges."""

    label: str
    diameter_m: float
    pitch_m: float
    blades: int
    rpm: Array  # rising [rev/min]
    thrust_N: Array
    torque_Nm: Array
    a_sound: float  # [m/s]
    # Thrust above which the blades are too narrow not to cavitate in water at 1 m of depth [N]
    keller_N: float = math.inf
    rest: RotorLoads | None = None  # The same at rest, where this is in flight

    def speed_for(self, thrust_N: Array) -> Array:
        """Speed that gives a thrust, NaN where none in the table does. [rev/min]"""
        first = int(np.argmax(np.r_[np.diff(self.thrust_N) > 0.0, True] & (self.thrust_N > 0.0)))
        T, n = np.maximum.accumulate(self.thrust_N[first:]), self.rpm[first:]
        found = np.interp(np.sqrt(thrust_N), np.sqrt(T), n, right=math.nan)
        return np.where(thrust_N < T[0], math.nan, found)

    def torque_at(self, rpm: Array) -> Array:
        """Torque, NaN above the table; with the square of the speed below it. [N m]"""
        q = np.interp(rpm, self.rpm, self.torque_Nm / self.rpm**2, right=math.nan)
        return np.asarray(q * rpm**2)

    def tip_mach(self, rpm: Array, airspeed_m_s: float) -> Array:
        """Helical tip Mach number [1]."""
        return np.hypot(math.pi * self.diameter_m * rpm / 60.0, airspeed_m_s) / self.a_sound


@dataclass(frozen=True)
class LoadScatter:
    """Relative standard uncertainties of thrust and torque of a label at a speed, and their correlation."""

    log_diameter: float
    pitch_ratio: float
    u_thrust: float
    u_torque: float
    correlation: float


FAN = "fan "
"""A label of a ducted fan of which the diameter is known: ``fan 70 mm``."""
PAIR_SPACING = 0.2
"""Distance of the disks of a coaxial pair over the diameter: declared [1]."""


@dataclass(frozen=True)
class Use:
    """What a label turns in, whether a second one turns downstream, and what it was read to do."""

    fluid: str = "air"
    coaxial: bool = False
    reading: str | None = None  # As `bemt.rotors.case.reading.parse_reading` takes it


ALONE = Use()


@lru_cache(maxsize=512)
def case_of_label(label: str, use: Use = ALONE) -> Case:
    """Case of a label, or of a fan, with its declared unknowns."""
    fan = label.startswith(FAN)
    text = fresh.fan_text(size_in(label) * INCH) if fan else fresh.label_text(label, reading=use.reading)
    case = case_of(text, ends=False)
    changes: dict[str, Any] = {}
    if use.fluid == "water":
        kept = case.declared(lambda key: not key.startswith("air."))
        changes = {"air": {"fluid": "water"}, "assumptions": kept, "operating.rpm": 1000.0}
    if use.coaxial:
        changes |= {"second_rotor": {"z_over_D": PAIR_SPACING}}
    return with_changes(case, changes) if changes else case


def rotor_loads(
    label: str, rpm_max: float, airspeed_m_s: float, air: Air | None = None, use: Use = ALONE
) -> RotorLoads | None:
    """Solve a label over speed; None where too few speeds converge. Of a coaxial pair each rotor has half."""
    case = case_of_label(label, use)
    found = loads_of_case(label, case, rpm_max, airspeed_m_s, air)
    if found is None or not airspeed_m_s:
        return found
    return dataclasses.replace(found, rest=loads_of_case(label, case, rpm_max, 0.0, air))


def loads_of_case(
    label: str, case: Case, rpm_max: float, airspeed_m_s: float, air: Air | None = None
) -> RotorLoads | None:
    """Solve a case over speed, in its own air unless told; None where too few speeds converge."""
    air = case.air() if air is None else air
    rpm = SPEEDS * rpm_max
    if case.paired:
        pair = propagate(case, rpm, np.full(rpm.size, airspeed_m_s), bands=False).nominal
        T, Q = (0.5 * np.asarray(pair[key]) for key in ("thrust_N", "torque_Nm"))
    else:
        points = prepare_case(case).at_speeds(rpm, airspeed_m_s, air).solve(rpm, airspeed_m_s, air)
        T, Q = np.asarray(points.thrust_N), np.asarray(points.torque_Nm)
    good = np.isfinite(T) & np.isfinite(Q)
    if np.count_nonzero(good) < 4:
        return None
    n = rpm[good]
    fine = np.linspace(n[0], n[-1], FINE)
    thrust, torque = (pchip(n, v[good] / n**2, fine) * fine**2 for v in (T, Q))
    pitch, blades = case.stated_pitch_m, int(case.file.rotor.blades)
    keller = keller_N(case.rotor()) if float(air.rho) > WET else math.inf
    return RotorLoads(label, case.diameter_m, pitch, blades, fine, thrust, torque, float(air.a_sound), keller)


def scatter(label: str, rpm: float, airspeed_m_s: float, use: Use = ALONE) -> LoadScatter:
    """Bands of a label near a speed, by `bemt.rotors.case.propagate`: declared unknowns, model and numerics.

    Relative bands hardly depend on the speed: it is taken to the next power of `SPEED_STEP`, and the band kept.
    """
    return _scatter(label, SPEED_STEP ** round(math.log(rpm, SPEED_STEP)), airspeed_m_s, use)


@lru_cache(maxsize=512)
def _scatter(label: str, rpm: float, airspeed_m_s: float, use: Use) -> LoadScatter:
    case = case_of_label(label, use)
    found = propagate(case, rpm, airspeed_m_s)
    T, Q = (float(found.nominal[key][0]) for key in ("thrust_N", "torque_Nm"))
    u = [float(found.points.u[key][0]) for key in ("thrust_N", "torque_Nm")]
    together = 0.0
    for one in found.moved:
        runs = [[float(run[key][0]) for run in one.runs] for key in ("thrust_N", "torque_Nm")]
        half = [0.5 * (r[-1] - r[0]) for r in runs]
        together += half[0] * half[1] / 3.0
    rho = min(max(together / (u[0] * u[1]), -0.99), 0.99)
    return LoadScatter(
        math.log(case.diameter_m / INCH), case.stated_pitch_m / case.diameter_m, u[0] / abs(T), u[1] / abs(Q), rho
    )


def size_in(label: str) -> float:
    """Diameter that a label states [in].

    >>> size_in("9x4.5x3")
    9.0
    >>> round(size_in("fan 70 mm"), 2)
    2.76
    """
    if label.startswith(FAN):
        return float(label.split()[1]) / 25.4
    return float(fresh.read_label(label).diameter_in)


SCATTERS = 4  # labels whose bands are computed; others take the nearest


def scatters(loads: Sequence[RotorLoads], thrust_N: float, airspeed_m_s: float, use: Use) -> list[LoadScatter]:
    """Bands of a few labels spread over the sizes that reach the target."""
    good = [one for one in loads if np.isfinite(one.speed_for(np.array([thrust_N]))[0])] or list(loads)
    order = sorted(good, key=lambda one: (one.diameter_m, one.pitch_m))
    picked = {round(i) for i in np.linspace(0, len(order) - 1, min(SCATTERS, len(order)))}
    out = []
    for i in sorted(picked):
        rpm = float(order[i].speed_for(np.array([thrust_N]))[0])
        found = scatter(order[i].label, rpm if math.isfinite(rpm) else float(order[i].rpm[-1]), airspeed_m_s, use)
        if np.isfinite([found.u_thrust, found.u_torque]).all():
            out.append(found)
    if not out:
        raise InputError(Fault("", "--labels", "no band converges", "sizes that the solver can judge at this thrust"))
    return out


def nearest(one: RotorLoads, spreads: Sequence[LoadScatter]) -> LoadScatter:
    """Band of the label that is nearest in size."""
    x, p = math.log(one.diameter_m / INCH), one.pitch_m / one.diameter_m
    return min(spreads, key=lambda s: math.hypot(s.log_diameter - x, s.pitch_ratio - p))

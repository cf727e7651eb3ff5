"""Thrust and torque of a rotor over speed, for the drive: from a case by BEMT, or from coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.rotors.case import Case
from bemt.rotors.case.lattice import SPEEDS


@dataclass(frozen=True, eq=False)
class RotorMap:
    """Loads of a rotor over speed."""

    omega_max: float  # greatest speed of the table. [rad/s]
    # speed [rad/s] to thrust [N], torque [N m] and thrust per induced speed at fixed rotation [N s/m]
    thrust_law: Callable[[Array], Array]
    torque_law: Callable[[Array], Array]
    slope_law: Callable[[Array], Array] | None
    # of the rotor [m]; swept area that carries the thrust [m2]
    radius_m: float
    area_m2: float
    rho: float  # density of the air. [kg/m3]
    airspeed_m_s: float = 0.0  # of flight. [m/s]
    inertia_kg_m2: float = 0.0  # of the rotor alone. [kg m2]
    notes: tuple[str, ...] = ()  # what was left out

    def thrust(self, omega: ArrayLike) -> Array:
        """Steady thrust, (N,) [N]."""
        return np.asarray(self.thrust_law(np.maximum(np.asarray(omega, dtype=float), 0.0)))

    def torque(self, omega: ArrayLike) -> Array:
        """Steady shaft torque, (N,) [N m]."""
        return np.asarray(self.torque_law(np.maximum(np.asarray(omega, dtype=float), 0.0)))

    def induced(self, thrust_N: ArrayLike) -> Array:
        """Induced speed of momentum theory, 2 rho A v (V + v) = T, (N,) [m/s]."""
        load = np.maximum(np.asarray(thrust_N, dtype=float), 0.0) / (2.0 * self.rho * self.area_m2)
        half = 0.5 * self.airspeed_m_s
        return np.asarray(np.sqrt(half**2 + load) - half)

    @property
    def apparent_mass_kg(self) -> float:
        """Air that follows the rotor, 8/3 rho R^3 (Carpenter and Fridovich, NACA TN 3044, 1953; not checked). [kg]"""
        return 8.0 / 3.0 * self.rho * self.radius_m**3


def quadratic(
    kT: float,
    kQ: float,
    diameter_m: float,
    rho: float = 1.225,
    inertia_kg_m2: float = 0.0,
    solidity: float | None = None,
) -> RotorMap:
    """Rotor whose loads go with the square of the speed.

    With a lift slope a of 5.7 per radian, dT/dw = -rho sigma a A Omega R / 4 (blade element, uniform inflow; J. G.
    Leishman, "Principles of Helicopter Aerodynamics", 2006, ch. 3; not checked).
    """
    R, A = 0.5 * diameter_m, math.pi * diameter_m**2 / 4.0
    slope = None if solidity is None else (lambda w: -0.25 * rho * solidity * 5.7 * A * R * w)
    return RotorMap(math.inf, lambda w: kT * w**2, lambda w: kQ * w**2, slope, R, A, rho, 0.0, inertia_kg_m2)


def points(diameter_m: float, rpm_max: float, airspeed_m_s: float) -> tuple[Array, Array]:
    """Speeds [rev/min] and airspeeds [m/s] of which `from_loads` makes a table: each speed twice, the second faster."""
    rpm = SPEEDS * rpm_max
    step = 0.02 * math.pi * diameter_m * rpm[-1] / 60.0
    return np.tile(rpm, 2), airspeed_m_s + np.repeat([0.0, step], rpm.size)


def from_loads(
    case: Case,
    rpm: Array,
    airspeed_m_s: Array,
    thrust_N: Array,
    torque_Nm: Array,
    rho: float,
    inertia_kg_m2: float = 0.0,
) -> RotorMap:
    """Rotor of a case from its loads at `points`; loads that are NaN are dropped."""
    from scipy.interpolate import PchipInterpolator

    half = rpm.size // 2
    step = airspeed_m_s[-1] - airspeed_m_s[0]
    known = np.isfinite(thrust_N) & np.isfinite(torque_Nm)
    ok, both = known[:half], known[:half] & known[half:]
    if np.count_nonzero(ok) < max(4, half // 2):
        got_text = f"{np.count_nonzero(ok)} of {half} speeds up to {rpm[-1]:.0f} rev/min converge"
        raise InputError(Fault(case.path.as_posix(), "", got_text, "a rotor that can be solved over its speed range"))
    notes = [] if np.all(ok) else [f"{half - np.count_nonzero(ok)} of {half} speeds do not converge: dropped"]
    omega = rpm[:half][ok] * math.pi / 30.0
    area = math.pi / 4.0 * (case.diameter_m**2 - (case.hub_diameter_m**2 if case.ducted else 0.0))
    T, Q = thrust_N[:half], torque_Nm[:half]
    tT, tQ = PchipInterpolator(omega, T[ok] / omega**2), PchipInterpolator(omega, Q[ok] / omega**2)
    table = RotorMap(
        float(omega[-1]), lambda w: tT(np.clip(w, omega[0], omega[-1])) * w**2,
        lambda w: tQ(np.clip(w, omega[0], omega[-1])) * w**2, None, 0.5 * case.diameter_m, area, rho,
        float(airspeed_m_s[0]), inertia_kg_m2, tuple(notes),
    )  # fmt: skip
    if case.ducted or np.count_nonzero(both) < 4:
        why = "the inflow of a duct follows the fan at once here" if case.ducted else "no slope of thrust over airspeed"
        return _with(table, None, (*notes, f"{why}: no lag of the inflow"))
    # slope at fixed induced speed from the solver's, whose induced speed follows (bemt.physics.effects.inflow_lag)
    w = rpm[:half][both] * math.pi / 30.0
    dT_dV = (thrust_N[half:][both] - T[both]) / step
    v = table.induced(T[both])
    follow = (dT_dV / (2.0 * rho * area) - v) / np.maximum(airspeed_m_s[0] + 2.0 * v, 1e-9)
    law = PchipInterpolator(w, dT_dV / np.maximum(1.0 + follow, 0.1) / w)
    return _with(table, lambda x: law(np.clip(x, w[0], w[-1])) * x, tuple(notes))


def _with(table: RotorMap, slope: Callable[[Array], Array] | None, notes: tuple[str, ...]) -> RotorMap:
    return RotorMap(**{**vars(table), "slope_law": slope, "notes": notes})

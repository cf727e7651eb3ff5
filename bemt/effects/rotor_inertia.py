"""Inertia of the rotor in the torque reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Array, Effect, Flow, Parameter, Reading

# Blade of chord 0.75 R all along, section area of a 10 % thick aerofoil (0.68 t c), fibre-filled nylon.
_SECTION, _DENSITY = 0.068, 1300.0
# Points further apart than this are no transient [s].
LONGEST_STEP_S = 1.0


@dataclass(frozen=True)
class RotorInertia(Effect):
    """The torque cell shows Q + ratio I dOmega/dt while the speed changes.

    Notes
    -----
    Euler's law of a rotating body (Euler 1765).  I = B rho_b 0.068 c^2 R^3 / 3 from the chord at 0.75 R with 1300
    kg/m3 (declared); ``ratio`` takes in what that misses, above all the bell of the motor: 0 to 10.  Slopes by central
    differences within runs whose points are less than 1 s apart.
    """

    ratio: float = 1.0

    id = "rotor_inertia"
    title = "inertia of the rotor"
    sign = "torque only and in transients only: it leads while the speed rises, lags while it falls, zero on plateaus"
    needs = ("time_s",)
    parameters = (Parameter("ratio", "1", 0.0, 10.0, "declared, blades alone to heavy bell", 3, 0.0),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """Only transients show it."""
        return super().applies(flow) or ("" if np.any(slope(flow) != 0.0) else "the speed never changes within 1 s")

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Add the accelerating torque."""
        inertia = flow.B * _DENSITY * _SECTION * flow.chord**2 * flow.R**3 / 3.0
        reading.values["torque_Nm"] = reading.values["torque_Nm"] + self.ratio * inertia * slope(flow)


def slope(flow: Flow) -> Array:
    """Angular acceleration, zero where the points are too far apart to show one.

    Parameters
    ----------
    flow : Flow
        Points with time.

    Returns
    -------
    (P,) float
        dOmega/dt [rad/s2].
    """
    out = np.zeros_like(flow.rpm)
    for run in flow.runs:
        t, omega = flow.extra["time_s"][run], flow.omega[run]
        step = np.diff(t)
        good = (step > 0.0) & (step < LONGEST_STEP_S)
        rate = np.where(good, np.diff(omega) / np.where(good, step, 1.0), 0.0)
        # mean of the slopes on both sides, weighted with their steps; of one side at the end of a dense stretch
        weight = np.where(good, step, 0.0)
        total = np.r_[weight, 0.0] + np.r_[0.0, weight]
        both = np.r_[weight * rate, 0.0] + np.r_[0.0, weight * rate]
        out[run] = both / np.where(total > 0.0, total, 1.0)
    return out

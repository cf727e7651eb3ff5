"""Inertia of the rotor in the torque reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, Reading, follows

# Blade of chord 0.75 R all along, section area of a 10 % thick aerofoil (0.68 t c), fibre-filled nylon.
_SECTION, _DENSITY = 0.068, 1300.0
# Change of the slope across a point, over the larger slope, from which it may be a kink.
_KINK = 0.5


@dataclass(frozen=True)
class RotorInertia(Effect):
    """The torque cell shows Q + ratio I dOmega/dt while the speed changes.

    Notes
    -----
    Euler's law of a rotating body (Euler 1765). I = B rho_b 0.068 c^2 R^3 / 3 from the chord at 0.75 R with 1300 kg/m3
    (declared); ``ratio`` covers what this misses, mainly the bell of the motor: 0 to 10. Slopes by central differences,
    one-sided at kinks, within runs whose points are less than 1 s apart.
    """

    ratio: float = 1.0

    id = "rotor_inertia"
    title = "rotor inertia"
    along = ("time_s",)
    transient = True
    sign = "only torque and only in transients: high while the speed rises, low while it falls, zero on plateaus"
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
    """Angular acceleration, zero where the points are too far apart to show one, (P,) [rad/s2]."""
    out = np.zeros_like(flow.rpm)
    for run in flow.transients:
        t, omega = flow.time_s[run], flow.omega[run]
        step = np.diff(t)
        good = follows(t)
        rate = np.where(good, np.diff(omega) / np.where(good, step, 1.0), 0.0)
        out[run] = _kinked(np.where(good, rate, 0.0))
    return out


def _kinked(rate: Array) -> Array:
    """Slope at points from those of the K-1 intervals between them, (K,): centred, or the smoothest side of a kink.

    A step of the throttle is a kink of the speed; a centred slope would smear it over two points (essentially
    non-oscillatory choice of the stencil: Harten, Engquist, Osher and Chakravarthy 1987, J. Comput. Phys. 71:231).
    """
    if rate.size < 3:
        return np.repeat(rate, 2)[: rate.size + 1]
    padded = np.r_[rate[0], rate[0], rate, rate[-1], rate[-1]]
    far_left, left, right, far_right = (padded[k : k + rate.size + 1] for k in range(4))
    bend = np.abs([left - far_left, right - left, far_right - right])
    bend[0, :2] = bend[2, -2:] = np.inf  # there are not two intervals on that side
    bend[1, [0, -1]] = np.inf
    # a centred slope is the most accurate one wherever the slope changes by little from one interval to the next
    bend[1, 1:-1][bend[1, 1:-1] < _KINK * np.maximum(np.abs(left), np.abs(right))[1:-1]] = 0.0
    slopes = np.array([left + 0.5 * (left - far_left), 0.5 * (left + right), right - 0.5 * (far_right - right)])
    return np.asarray(np.take_along_axis(slopes, np.argmin(bend, axis=0)[None], axis=0)[0])

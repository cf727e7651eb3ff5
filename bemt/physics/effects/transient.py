"""Readings before the rotor is steady: lag of the inflow, inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Loads, Parameter, Reading, follows


@dataclass(frozen=True)
class InflowLag(Effect):
    """Induced speed that follows its steady value with a lag: thrust overshoots when the speed rises.

    Notes
    -----
    tau dv/dt + v = v_steady, first-order dynamic inflow (Carpenter and Fridovich 1953, NACA TN 3044; Pitt and Peters
    1981, Vertica 5:21; not checked).  The slope dT/dw of the blades at fixed induced speed follows from the slope
    dT/dV of the solver, whose induced speed follows: with T = 2 rho A v (V + v), dv/dV = (dT/dV / (2 rho A) - v) / (V
    + 2 v) and dT/dw = dT/dV / (1 + dv/dV), the same for torque.  Acts within runs whose points are less than 1 s
    apart.
    """

    tau_s: float = 0.05

    id = "inflow_lag"
    title = "lag of the induced flow"
    along = ("time_s",)
    transient = True
    sign = "thrust and torque overshoot when the speed rises and undershoot when it falls; no change on plateaus"
    needs = ("time_s",)
    parameters = (Parameter("tau_s", "s", 0.01, 0.2, "apparent mass of the disk, Carpenter and Fridovich", 5, 0.0),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """Only transients show it."""
        late = self._late(flow)
        return super().applies(flow) or ("" if np.any(late != 0.0) else "the speed never changes within 1 s")

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Add what the missing induced speed is worth."""
        late = self._late(flow)
        v, disk = flow.induced, 2.0 * flow.rho * flow.area
        follow = (flow.dT_dV / disk - v) / np.maximum(np.abs(flow.V) + 2.0 * v, 1e-9)
        fixed = 1.0 / np.maximum(1.0 + follow, 0.1)
        loads.T = loads.T + flow.dT_dV * fixed * late
        loads.Q = loads.Q + flow.dQ_dV * fixed * late

    def _late(self, flow: Flow) -> Array:
        """Lagging less steady induced speed, (P,) [m/s]."""
        v, out = flow.induced, np.zeros_like(flow.rpm)
        if self.tau_s <= 0.0:
            return out
        for run in flow.transients:
            time = flow.extra["time_s"][run]
            step, dense = np.diff(time), follows(time)
            late = 0.0
            for i, (dt, good, dv) in enumerate(zip(step, dense, np.diff(v[run]), strict=True)):
                # steady value linear between points: exact solution of the first-order equation
                x = dt / self.tau_s if good else np.inf
                late = late * np.exp(-x) + dv * np.expm1(-x) / x if good else 0.0
                out[run[i + 1]] = late
        return out


# Inertia of the rotor in the torque reading.

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
        t, omega = flow.extra["time_s"][run], flow.omega[run]
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

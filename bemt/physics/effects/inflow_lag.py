"""Air that needs time to follow the rotor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Loads, Parameter, follows


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
            time = flow.time_s[run]
            step, dense = np.diff(time), follows(time)
            late = 0.0
            for i, (dt, good, dv) in enumerate(zip(step, dense, np.diff(v[run]), strict=True)):
                # steady value linear between points: exact solution of the first-order equation
                x = dt / self.tau_s if good else np.inf
                late = late * np.exp(-x) + dv * np.expm1(-x) / x if good else 0.0
                out[run[i + 1]] = late
        return out

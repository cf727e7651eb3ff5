"""Walls of a closed wind tunnel around a propeller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Parameter

# Advance ratio up to which the air is at rest.
_STILL = 0.03


@dataclass(frozen=True)
class TunnelBlockage(Effect):
    """Closed test section: the thrust is that of a lower free airspeed V' than the tunnel's.

    Notes
    -----
    V'/V = 1 - tau alpha / (2 sqrt(1 + 2 tau)), tau = T / (rho A V^2), alpha disk over test-section area (Glauert 1935,
    Airplane Propellers, ch. VIII; in this form in Barlow, Rae and Pope 1999, Low-Speed Wind Tunnel Testing; not checked
    against the books). A static test has no free airspeed to correct; below J = 0.03 an airspeed is the noise of its
    sensor (declared), and the correction would be largest there.
    """

    area_ratio: float = 0.05

    id = "tunnel_blockage"
    inviscid = True
    title = "wind tunnel blockage"
    check = (
        "compare disk area and test section: above 5 % state their ratio in the case, [model] effects_on = "
        '["tunnel_blockage(area_ratio=0.1)"]'
    )
    sign = "thrust and torque rise with loading at airspeed: the shift of J grows with thrust, not with V"
    parameters = (Parameter("area_ratio", "1", 0.0, 0.25, "disk over test-section area", 5, 0.0),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """Only airspeed can be corrected."""
        return "" if np.any(flow.J > _STILL) else "no point has airspeed"

    def flow(self, flow: Flow) -> None:
        """Lower the airspeed to the equivalent free one."""
        load = flow.T0 / (flow.rho * flow.area)
        root = np.sqrt(np.maximum(flow.V**2 + 2.0 * load, 0.25 * flow.V**2 + 1e-12))
        flow.V = flow.V - np.where(flow.J > _STILL, 0.5 * self.area_ratio * load / root, 0.0)

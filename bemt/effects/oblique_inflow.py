"""Wind that does not come along the shaft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class ObliqueInflow(Effect):
    """Airspeed at an angle to the shaft: less of it goes through the disk, and the blades meet more and less of it.

    Notes
    -----
    Momentum in skewed flow: T = 2 rho A v sqrt((Vx + v)^2 + Vy^2), Vx = V cos, Vy = V sin (Glauert 1926, ARC R&M 1111;
    Johnson 1980, Helicopter Theory, sec. 4-1.1). At the baseline's thrust it gives the flow w = Vx + v through the
    disk; the rotor sees the axial onset speed that gives the same w, w - T / (2 rho A w). The mean square of the
    tangential speed raises the thrust by 1 + 3/2 mu^2, mu = Vy / (Omega R) (blade-element thrust at constant pitch,
    Johnson 1980, sec. 5-2; equation numbers not checked), modelled as a higher speed of rotation. A recorded
    ``sideslip_rad`` replaces ``angle_deg``.
    """

    angle_deg: float = 20.0

    id = "oblique_inflow"
    geometric = True
    inviscid = True
    title = "inflow at an angle to the shaft"
    check = "check with a laser that shaft and tunnel axis are parallel"
    along = ("sideslip_rad",)
    sign = (
        "thrust and torque rise with airspeed as if J were lower, with a force in the plane of the disk; no change "
        "in static runs; a pitot that reads high by 1 / cos(angle) looks the same"
    )
    parameters = (Parameter("angle_deg", "deg", 0.0, 90.0, "full turn of the stand", 7, 0.0),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """At rest there is no direction."""
        return "" if np.any(flow.V > 0.0) else "no point has airspeed"

    def flow(self, flow: Flow) -> None:
        """Replace the airspeed by the axial one of the same flow through the disk."""
        angle = (
            np.nan_to_num(flow.extra["sideslip_rad"]) if "sideslip_rad" in flow.extra else np.radians(self.angle_deg)
        )
        angle = np.broadcast_to(angle, flow.V.shape)
        Vx, Vy = flow.V * np.cos(angle), flow.V * np.sin(angle)
        load = np.maximum(flow.T0, 0.0) / (2.0 * flow.rho * flow.area)
        # v falls from the hover value as the wind grows; the fixed point v = load / |W| is bracketed, so bisect
        low, high = np.zeros_like(load), np.sqrt(load) + np.abs(flow.V)
        for _ in range(60):
            v = 0.5 * (low + high)
            above = v * np.hypot(Vx + v, Vy) > load
            low, high = np.where(above, low, v), np.where(above, v, high)
        w = Vx + 0.5 * (low + high)
        skewed = (angle != 0.0) & (flow.V > 0.0) & (load > 0.0)
        axial = w - load / np.where(np.abs(w) > 1e-9, w, 1.0)
        mu = Vy / (flow.omega * flow.R)
        flow.V = np.where(skewed, axial, Vx)
        flow.rpm = flow.rpm * np.sqrt(1.0 + 1.5 * mu**2)

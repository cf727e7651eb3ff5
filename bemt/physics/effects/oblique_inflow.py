"""Wind that does not come along the shaft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class ObliqueInflow(Effect):
    """Airspeed at an angle to the shaft: less of it goes through the disk, and the blades meet more and less of it.

    Notes
    -----
    The rotor is solved in oblique flow (:mod:`bemt.physics.bem.oblique`): skewed mass flow (Glauert 1926, ARC R&M
    1111), linear inflow gradient (Pitt and Peters 1981, Vertica 5:21), blade loads round the azimuth. A recorded
    ``sideslip_rad`` replaces ``angle_deg``. Open rotors only.
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
    in_duct = "oblique flow is solved for open rotors only"
    flies = True
    parameters = (
        Parameter("angle_deg", "deg", 0.0, 90.0, "full turn of the stand; seldom unnoticed (declared)", 7, 0.0, 20.0),
    )
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Part the airspeed into its share along the shaft and in the plane of the disk."""
        if flow.ducted:
            return
        angle = (
            np.nan_to_num(flow.extra["sideslip_rad"]) if "sideslip_rad" in flow.extra else np.radians(self.angle_deg)
        )
        flow.V, flow.side = flow.V * np.cos(angle), np.abs(flow.V * np.sin(angle))

"""Elastic twist of the blade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, RotorBuild

FORMS = ("centrifugal", "aerodynamic")


@dataclass(frozen=True)
class Untwist(Effect):
    """Blade that twists under load as a rod, by ``turn_deg`` nose down at 0.75 R at the hardest point.

    Notes
    -----
    d/dr (GJ d theta/dr) = -m, held at the hub and free at the tip (J. C. Houbolt and G. W. Brooks, NACA Report 1346,
    1957; not checked against the report): the turn levels off where the load ends. Thin sections of one material: GJ ~
    c^4 (t/c)^3. ``form = "centrifugal"``: m ~ c^4 (t/c) sin beta cos beta, the "propeller moment", towards flat pitch;
    the larger one in a solid plastic blade. ``form = "aerodynamic"``: m ~ r^2 c^2, of camber (nose down) or of lift
    ahead of the elastic axis (nose up).

    Both grow as Omega^2; so does the turn, and its proportion to rho Omega^2 is declared. It is told where loads show
    it: tips of UIUC's blades turn 1.0 to 1.1 times that by the one moment, 1.1 to 1.8 by the other. Parameters refer to
    the point with the largest rho Omega^2 of a recording; see :meth:`share`; without a recording they apply directly.
    """

    turn_deg: float = 0.6
    form: str = "centrifugal"

    id = "untwist"
    geometric = True
    title = "elastic blade twist"
    check = "film the tip from the side, stopped and at full speed"
    check_minutes = 30.0
    sign = (
        "thrust coefficient falls (or rises) with rho Omega^2 and not with Mach number: depends on density at the "
        "same speed, not on air temperature"
    )
    words = {"form": FORMS}
    parameters = (Parameter("turn_deg", "deg", -2.5, 3.0, "declared; tips of plastic blades 1 to 3 deg", 7, 0.0, 0.85),)
    on_by_default = False

    def blade(self, bake: RotorBuild) -> None:
        """Twist the blade."""
        c, thin = bake.chord, bake.thickness
        m = bake.r**2 * c**2 if self.form == "aerodynamic" else c**4 * thin * np.sin(bake.beta) * np.cos(bake.beta)
        torque = np.cumsum((m * bake.dr)[::-1])[::-1]
        turn = np.cumsum(torque / (c**4 * thin**3) * bake.dr)
        there = np.interp(0.75 * bake.R, bake.r, turn)
        bake.beta = bake.beta - np.radians(self.turn_deg) * bake.level * turn / there
        bake.level = 1.0  # it was meant for this effect, not for one that comes later

    def share(self, flow: Flow) -> Array:
        """Rho Omega^2 over its largest value."""
        load = flow.rho * flow.omega**2
        return np.asarray(load / np.max(load))

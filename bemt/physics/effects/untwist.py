"""Elastic twist of the blade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, RotorBuild


@dataclass(frozen=True)
class Untwist(Effect):
    """Blade that twists under load: d beta = -tip_deg (r/R)^2 at the hardest point, in proportion to rho Omega^2.

    Notes
    -----
    Centrifugal and aerodynamic moments twist a flexible blade as the square of the speed (Sodja, Drazumeric, Kosel and
    Marzocca 2014, J. Aircraft 51:117, not checked); shape and proportion to rho Omega^2 are declared. The centrifugal
    ("propeller") moment turns sections towards flat pitch, that of cambered sections the nose down, lift ahead of the
    elastic axis the nose up. Positive: nose down (untwist). Parameters refer to the point with the
    largest rho Omega^2 of a recording; see :meth:`share`; without a recording they apply directly.
    """

    tip_deg: float = 1.0

    id = "untwist"
    geometric = True
    title = "elastic blade twist"
    check = "film the tip from the side, stopped and at full speed"
    check_minutes = 30.0
    sign = (
        "thrust coefficient falls (or rises) with rho Omega^2 and not with Mach number: depends on density at the "
        "same speed, not on air temperature"
    )
    parameters = (
        Parameter("tip_deg", "deg", -4.0, 5.0, "declared; plastic blades 1 to 3 deg either way", 7, 0.0, 1.5),
    )
    on_by_default = False

    def blade(self, bake: RotorBuild) -> None:
        """Twist the blade."""
        bake.beta = bake.beta - np.radians(self.tip_deg) * bake.level * (bake.r / bake.R) ** 2
        bake.level = 1.0  # it was meant for this effect, not for one that comes later

    def share(self, flow: Flow) -> Array:
        """Rho Omega^2 over its largest value."""
        load = flow.rho * flow.omega**2
        return np.asarray(load / np.max(load))

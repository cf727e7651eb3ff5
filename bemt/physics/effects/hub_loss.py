"""Prandtl hub loss."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class HubLoss(Effect):
    """Trailing vortex at the blade root: F = (2/pi) acos(exp(-f)), f = strength B (r - Rhub) / (2 Rhub |sin phi|).

    Notes
    -----
    Ning (2014), Wind Energy 17:1327, eq. 4 and 6, doi:10.1002/we.1636.  Multiplies the tip factor.  A ducted rotor has
    none: its hub is one wall of an annulus, and the blade's lift goes on to it.
    """

    strength: float = 1.0

    id = "hub_loss"
    inviscid = True
    title = "hub loss (lift loss at the blade root)"
    sign = "less thrust and torque by constant shares, growing with loading; the root is so slow that it barely shows"
    parameters = (Parameter("strength", "1", 0.5, 1.3, "shared effect table of the project; 1 is Prandtl", 3),)

    def momentum(self, bake: RotorBuild) -> None:
        """Switch the hub factor on."""
        if not bake.ducted:
            bake.num.hub = self.strength

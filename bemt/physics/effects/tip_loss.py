"""Prandtl tip loss."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class TipLoss(Effect):
    """Finite number of blades at the tip: F = (2/pi) acos(exp(-f)), f = strength B (R - r) / (2 r |sin phi_w|).

    Notes
    -----
    Prandtl's factor belongs to the vortex sheets of the far wake (appendix to Betz 1919; Glauert 1935, "Airplane
    Propellers", in Durand, Aerodynamic Theory IV, eq. VII 4.13). With ``sheets = "wake"`` phi_w is the pitch angle of
    the sheets there: axial speed V + 2 v on a contracted radius, which momentum theory gives as tan(phi_w) = tan(phi)
    q^1.5 with q = (V + 2 v) / (V + v). It equals the usual form in fast flight (q -> 1) and makes the sheets 2.8 times
    as steep in static operation (q = 2), where the usual form (``sheets = "disk"``, phi_w = phi: Ning 2014, Wind Energy
    17:1327, eq. 4-5, doi:10.1002/we.1636) overpredicts thrust. The combination with q is our own reading of the theory;
    reports/validation shows its effect. ``strength`` multiplies the exponent: a larger value means a smaller loss. Off
    means F = 1.
    """

    strength: float = 1.0
    sheets: str = "wake"

    id = "tip_loss"
    inviscid = True
    title = "tip loss (finite number of blades)"
    sign = (
        "less thrust, and less torque by a smaller share; grows with loading; depends on J and blade count, not on "
        "speed"
    )
    words = {"sheets": ("wake", "disk")}
    parameters = (Parameter("strength", "1", 0.5, 1.3, "shared effect table of the project; 1 is Prandtl"),)

    def momentum(self, bake: RotorBuild) -> None:
        """Switch the tip factor on."""
        bake.num.tip = self.strength
        bake.num.far_wake = float(self.sheets == "wake")

"""Tip gap other than stated."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class WiderGap(Effect):
    """Gap between blade tip and wall that is longer, or shorter, than the case says.

    Notes
    -----
    Geometry only: the gap grows by a length, and `tip_gap` gives the loss (Wisler 1985 and Cumpsty 1989 there). A
    worn or cut tip, a printed duct that shrank or went oval, a rotor that grows under load. The gap is never below
    zero.
    """

    extra_mm: float = 0.5

    id = "wider_gap"
    law = "tip_gap"
    torque_open = True
    inviscid = True
    title = "wrong tip gap"
    sign = "thrust of a ducted rotor drops at every speed, torque by less; no change on an open rotor"
    check = "measure the gap with a feeler gauge"
    needs_duct = True
    parameters = (Parameter("extra_mm", "mm", -1.0, 4.0, "declared; printed and moulded ducts", 6, 0.0, 0.5),)
    on_by_default = False

    def blade(self, bake: RotorBuild) -> None:
        """Lengthen the gap."""
        if bake.ducted:
            bake.gap = max(bake.gap + 1e-3 * self.extra_mm, 0.0)

"""A duct around the rotor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bemt.physics.effects.base import Effect, Flow, Parameter

_RATIOS = (0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3)


@dataclass(frozen=True)
class DuctEffect(Effect):
    """Jet that leaves through a duct of given exit area instead of contracting freely.

    Notes
    -----
    T / T_rotor = 2 sigma_w at rest, sigma_w exit over disk area; fades with speed (McCormick 1967, Aerodynamics of
    V/STOL Flight, ch. 9; Pereira 2008, PhD thesis Univ. of Maryland, eq. 2.20-2.40; see :mod:`bemt.physics.bem.duct`).
    A case with a duct takes it from its geometry, not from this effect; ``effects_off = ["duct"]`` removes it, and so
    does ``state`` = "gone". The duct of a case keeps its lip, walls and gap. An unstated duct may have any lip and
    wall: an inlet from well rounded to sharp-edged loses 0.04 to 0.5 of 1/2 rho w^2 (Crane TP-410, p. A-29, not
    checked), which takes the duct's share from a half of the thrust to a quarter; the outer wall has friction drag
    only, or up to the drag of a blunt ring with a thickness of a tenth of the radius (Hoerner 1965, Fluid-Dynamic Drag,
    ch. 3, not checked).
    """

    wake_ratio: float = 1.0
    lip_loss: float = 0.0
    outer_drag: float = 0.0
    state: str = "fitted"

    id = "duct"
    torque_open = True
    inviscid = True
    evident = True
    title = "duct thrust"
    sign = "more thrust for the same torque, fading with advance ratio"
    parameters = (
        Parameter("wake_ratio", "1", 0.8, 1.3, "exit over disk area; Pereira 2008", 3),
        Parameter("lip_loss", "1", 0.0, 0.5, "over 1/2 rho w^2, frictionless to sharp-edged; Crane TP-410, p. A-29", 3),
        Parameter("outer_drag", "1", 0.0, 0.2, "drag area over disk area; Hoerner 1965, not checked", 2),
    )
    words = {"state": ("fitted", "gone")}
    on_by_default = False

    def duct(self, R: float, stated: bool) -> Mapping[str, float] | None:
        """Exit area ratio of the duct, and what a case would state of it."""
        if self.state == "gone":
            return None
        if stated:
            return {"wake_ratio": self.wake_ratio}
        drag_area = self.outer_drag * math.pi * R**2
        return {"wake_ratio": self.wake_ratio, "lip_loss": self.lip_loss, "drag_area": drag_area}

    def settings(self, flow: Flow) -> tuple[dict[str, Any], ...] | None:
        """Beside the duct of a case: another exit, or no duct at all."""
        return (*({"wake_ratio": k, "state": "fitted"} for k in _RATIOS), {"state": "gone"}) if flow.ducted else None

    def odds(self) -> float:
        """No duct is as likely as any other exit."""
        return 1.0 if self.state == "gone" else 1.0 / len(_RATIOS)

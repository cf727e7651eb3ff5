"""Gap between blade tip and duct wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bemt.effects.base import Baking, Effect, Parameter


@dataclass(frozen=True)
class TipGap(Effect):
    """Leakage over the tip of a ducted rotor.

    Notes
    -----
    Two parts.  The wall mirrors the tip vortex, so Prandtl's deficit 1 - F is scaled by 1 - exp(-gap / (scale R)): none
    when sealed, whole when the wall is far (declared rule, between two limits that are known).  Leakage costs pressure
    rise in proportion to gap over span, ``loss`` points per point: 1 to 2 in Wisler (1985), J. Turbomach. 107:372, and
    Cumpsty (1989), Compressor Aerodynamics, ch. 8 (not checked against the books).  Off means a sealed tip.
    """

    loss: float = 1.5
    scale: float = 0.05

    id = "tip_gap"
    title = "leakage through the tip gap of a ducted rotor"
    parameters = (
        Parameter("loss", "1", 1.0, 2.0, "Wisler 1985; Cumpsty 1989, not checked"),
        Parameter("scale", "1", 0.02, 0.10, "declared"),
    )

    def momentum(self, bake: Baking) -> None:
        """Open the tip."""
        if not bake.ducted:
            return
        bake.num["gap_share"] = 1.0 - math.exp(-max(bake.gap, 0.0) / (self.scale * bake.R))
        bake.num["gap_loss"] = min(self.loss * max(bake.gap, 0.0) / (bake.R - bake.Rhub), 0.5)

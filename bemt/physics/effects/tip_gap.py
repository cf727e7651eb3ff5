"""Gap between blade tip and duct wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, RotorBuild

GAP_LOSS = 1.0, 2.0
"""Points of pressure rise lost per point of gap over span, as measured on compressor rotors [1]."""


@dataclass(frozen=True)
class TipGap(Effect):
    """Leakage over the tip of a ducted rotor.

    Notes
    -----
    A tip gap has two parts (Wisler 1985; Cumpsty 1989, ch. 8; not checked against the books). The wall mirrors the tip
    vortex, so Prandtl's deficit 1 - F is scaled by 1 - exp(-gap / (scale R)): zero if sealed, full if the wall is far
    away (declared rule between two known limits). Leakage costs pressure rise in proportion to gap over span, ``loss``
    points per point: 1 to 2 in Wisler (1985), J. Eng. Gas Turbines Power 107:354, and Cumpsty (1989), Compressor
    Aerodynamics; a case states it as ``duct.gap_loss``. Off means a sealed tip. In a recording with ``tip_gap_m`` the
    gap of the case corresponds to the largest recorded one, the others are in proportion; see :meth:`share`.
    """

    loss: float = 1.5
    scale: float = 0.05

    id = "tip_gap"
    inviscid = True
    title = "tip gap leakage in a duct"
    check = "measure the gap with a feeler gauge, hot and at speed if possible"
    along = ("tip_gap_m",)
    torque_open = True
    sign = "thrust and pressure rise drop in proportion to gap over span; no change on an open rotor"
    needs_duct = True
    parameters = (
        Parameter("loss", "1", *GAP_LOSS, "Wisler 1985; Cumpsty 1989, not checked", 3),
        Parameter("scale", "1", 0.02, 0.10, "declared", 0),
    )

    def momentum(self, bake: RotorBuild) -> None:
        """Open the tip."""
        if not bake.ducted:
            return
        gap, bake.level = bake.level * max(bake.gap, 0.0), 1.0
        bake.num.gap_share = 1.0 - math.exp(-gap / (self.scale * bake.R))
        bake.num.gap_loss = min(self.loss * gap / (bake.R - bake.Rhub), 0.5)

    def share(self, flow: Flow) -> Array | None:
        """Recorded gap over the largest recorded one."""
        gap = flow.extra.get("tip_gap_m")
        if gap is None or not np.nanmax(gap) > 0.0:
            return None
        return np.asarray(np.nan_to_num(gap / np.nanmax(gap), nan=1.0))

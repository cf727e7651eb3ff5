"""Tangential induction."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, RotorBuild


@dataclass(frozen=True)
class Swirl(Effect):
    """Angular momentum of the wake: half of the slipstream's rotation acts at the disk.

    Notes
    -----
    Glauert (1935), Airplane Propellers, ch. VII; Ning (2014) eq. 12. Off means no tangential induction (axial momentum
    theory).
    """

    id = "swirl"
    inviscid = True
    title = "slipstream swirl"
    sign = (
        "thrust and torque off by constant shares at heavy loading; their ratio distinguishes it from density or speed"
    )

    def momentum(self, bake: RotorBuild) -> None:
        """Switch the tangential balance on."""
        bake.num.swirl = 1.0

"""Rotational augmentation of lift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Baking, Effect, Parameter


@dataclass(frozen=True)
class StallDelay(Effect):
    """Snel's rotational lift: cl_3D = cl_2D + coefficient (c/r)^2 (cl_pot - cl_2D).

    Notes
    -----
    Snel, Houwink and Bosschers (1994), ECN-C--93-052, eq. 6.2 (not checked against the report); the coefficient is
    their 3.  cl_pot is the straight line through the zero-lift angle with the table's own slope.  Faded out between
    30 and 50 deg and applied to positive stall only.  What rotation adds is a force normal to the chord (Lindenburg
    2003, ECN-C--03-025; not checked against the report), so drag grows by ``normal`` times gain times tan(alpha).
    """

    coefficient: float = 3.0
    normal: float = 1.0

    id = "stall_delay"
    title = "rotational stall delay"
    parameters = (
        Parameter("coefficient", "1", 1.0, 4.0, "Snel et al. 1994 give 3"),
        Parameter("normal", "1", 0.0, 1.0, "1: the gain is a force normal to the chord; 0: lift only"),
    )
    order = 20

    def section(self, bake: Baking) -> None:
        """Lift the stalled part of the tables."""
        weight = np.minimum(self.coefficient * (bake.chord / bake.r) ** 2, 1.0)[:, None, None, None]
        a = bake.alpha_col
        a0 = bake.alpha0[:, None, :, None]
        pot = np.minimum(bake.cla[:, None, :, None], 2.0 * np.pi) * (a - a0)
        fade = np.clip((np.radians(50.0) - a) / np.radians(20.0), 0.0, 1.0) * (a > a0)
        gain = weight * fade * np.maximum(pot - bake.cl, 0.0)
        bake.cl += gain
        bake.cd += self.normal * gain * np.tan(np.clip(a, 0.0, np.radians(60.0)))

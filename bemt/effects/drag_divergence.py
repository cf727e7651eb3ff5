"""Wave drag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Baking, Effect, Parameter


@dataclass(frozen=True)
class DragDivergence(Effect):
    """Wave drag of the sections above their critical Mach number.

    Notes
    -----
    Korn's drag-divergence Mach number M_dd = kappa - t/c - cl/10 and Lock's fourth-power law cd_w = 20 (M - M_cr)^4
    with M_cr = M_dd - (0.1/80)^(1/3); Mason (1990), AIAA 90-3029, as quoted in Malone and Mason (1995), J. Aircraft
    32:1045 (not checked against the papers).  Above M = 1 the law is capped at Ackeret's supersonic level
    4 (alpha^2 + (t/c)^2) / sqrt(M^2 - 1) evaluated not closer to M = 1 than 1.05.
    """

    kappa: float = 0.87

    id = "drag_divergence"
    title = "drag divergence near sonic speed"
    parameters = (Parameter("kappa", "1", 0.80, 0.95, "0.87 NACA sections, 0.95 supercritical (Mason 1990)"),)
    uses_mach = True
    order = 45

    def section(self, bake: Baking) -> None:
        """Add wave drag."""
        if bake.M2.size == 1:
            return
        M = np.sqrt(bake.M2)[None, :, None, None]
        tc = bake.thickness[:, None, None, None]
        cl0 = np.clip(np.abs(bake.cl[:, :1, bake.fast]), 0.0, 1.2)
        m_cr = self.kappa - tc - 0.1 * cl0 - (0.1 / 80.0) ** (1.0 / 3.0)
        wave = 20.0 * np.maximum(M - m_cr, 0.0) ** 4
        a = bake.alpha_col
        small = np.abs(a) < np.radians(30.0)
        cap = 4.0 * (np.minimum(np.abs(a), 0.2) ** 2 + tc**2) / np.sqrt(np.maximum(M**2, 1.1025) - 1.0)
        bake.cd += np.where(small, np.minimum(wave, cap), 0.0) * (1.0 - bake.own_mach[:, None, None, None])

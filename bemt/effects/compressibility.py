"""Lift at subsonic Mach numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Baking, Effect, Parameter


@dataclass(frozen=True)
class Compressibility(Effect):
    """Prandtl-Glauert growth of lift below the lift-divergence Mach number, decay above it.

    Notes
    -----
    cl = cl_0 / sqrt(1 - M^2) (Glauert 1928, Proc. R. Soc. A 118:113) up to ``m_lift``; beyond, the factor falls
    linearly in M to 1 at M = 1 and on to the supersonic slope ratio 4 / (2 pi sqrt(M^2 - 1)), never above 1 (Ackeret
    1925).  The decay between is a declared rule in the manner of the C81 tables of NACA 0012, not a fit.  Acts on the
    attached part; fully separated flow (beyond 30 deg) is left alone.
    """

    amplitude: float = 1.0
    m_lift: float = 0.80

    id = "compressibility"
    title = "compressible lift"
    parameters = (
        Parameter("amplitude", "1", 0.8, 1.2, "1 is Prandtl-Glauert"),
        Parameter("m_lift", "1", 0.7, 0.9, "lift divergence of thin sections at moderate lift"),
    )
    uses_mach = True
    order = 40

    def section(self, bake: Baking) -> None:
        """Scale lift by Mach number."""
        if bake.M2.size == 1:
            return
        factor = self.factor(np.sqrt(bake.M2))
        a = np.abs(bake.alpha_col)
        fade = np.clip((np.radians(40.0) - a) / np.radians(15.0), 0.0, 1.0)
        own = bake.own_mach[:, None, None, None]
        bake.cl *= 1.0 + (factor[None, :, None, None] - 1.0) * fade * (1.0 - own)

    def factor(self, M: np.ndarray) -> np.ndarray:
        """Lift ratio cl(M) / cl(0).

        Parameters
        ----------
        M : (N,) float
            Mach number [1].

        Returns
        -------
        (N,) float
            Ratio [1].
        """
        M = np.asarray(M, dtype=float)
        pg = 1.0 / np.sqrt(1.0 - np.minimum(M, self.m_lift) ** 2)
        fall = pg + (1.0 - pg) * np.clip((M - self.m_lift) / (1.0 - self.m_lift), 0.0, 1.0)
        sup = np.minimum(1.0, 4.0 / (2.0 * np.pi * np.sqrt(np.maximum(M**2 - 1.0, 1e-6))))
        return 1.0 + self.amplitude * (np.where(M <= 1.0, fall, sup) - 1.0)

"""Lift at subsonic, transonic and low supersonic Mach numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.effects.base import Baking, Effect, Parameter

Array = NDArray[np.float64]

# Lift grows a little beyond drag divergence, then the shock stalls the section within this span of Mach number.
_AFTER_DIVERGENCE = 0.04
_STALL_SPAN = 0.12


@dataclass(frozen=True)
class Compressibility(Effect):
    """Prandtl-Glauert growth of lift up to lift divergence, shock stall behind it, recovery above M = 1.

    Notes
    -----
    cl = cl_0 / sqrt(1 - M^2) (Glauert 1928, Proc. R. Soc. A 118:113) up to the lift-divergence Mach number, set 0.04
    above Korn's drag divergence M_dd = kappa - t/c - cl/10 (Mason 1990, AIAA 90-3029; not checked).  Behind it lift
    falls within 0.12 in M to ``shock_stall`` times the incompressible one and recovers between M = 1 and 1.1 to at
    most 1 or Ackeret's 4 / (2 pi sqrt(M^2 - 1)).  The fall is a declared rule with the shape of published NACA 0012
    tables, not a fit to rotor data.  Acts on the attached part; separated flow (beyond 40 deg) is left alone.
    """

    amplitude: float = 1.0
    kappa: float = 0.87
    shock_stall: float = 0.75

    id = "compressibility"
    title = "compressible lift"
    parameters = (
        Parameter("amplitude", "1", 0.8, 1.2, "1 is Prandtl-Glauert"),
        Parameter("kappa", "1", 0.80, 0.95, "0.87 NACA sections, 0.95 supercritical (Mason 1990)"),
        Parameter("shock_stall", "1", 0.6, 0.9, "declared; NACA 0012 tables at M 0.85-0.95"),
    )
    uses_mach = True
    order = 40

    def section(self, bake: Baking) -> None:
        """Scale lift by Mach number."""
        if bake.M2.size == 1:
            return
        M = np.sqrt(bake.M2)[None, :, None, None]
        # lift divergence hardly knows the Reynolds number: one of them, where Mach numbers matter, keeps this cheap
        limit = self.lift_divergence(bake.thickness[:, None, None, None], bake.cl[:, :1, bake.fast])
        a = np.abs(bake.alpha_col)
        fade = np.clip((np.radians(40.0) - a) / np.radians(15.0), 0.0, 1.0)
        own = bake.own_mach[:, None, None, None]
        bake.cl *= 1.0 + (self.factor(M, limit) - 1.0) * fade * (1.0 - own)

    def lift_divergence(self, thickness: ArrayLike, cl: ArrayLike) -> Array:
        """Mach number of the largest lift.

        Parameters
        ----------
        thickness : float or array
            Thickness over chord [1].
        cl : float or array
            Incompressible lift coefficient [1].

        Returns
        -------
        array
            Mach number, 0.4 to 0.95 [1].
        """
        m_dd = self.kappa - np.asarray(thickness) - 0.1 * np.minimum(np.abs(np.asarray(cl)), 1.2)
        return np.asarray(np.clip(m_dd + _AFTER_DIVERGENCE, 0.4, 0.95))

    def factor(self, M: ArrayLike, limit: ArrayLike) -> Array:
        """Lift ratio cl(M) / cl(0).

        Parameters
        ----------
        M : float or array
            Mach number [1].
        limit : float or array
            Lift-divergence Mach number, see :meth:`lift_divergence` [1].

        Returns
        -------
        array
            Ratio [1].

        >>> e = Compressibility()
        >>> [round(float(e.factor(m, 0.75)), 3) for m in (0.0, 0.6, 0.9, 1.2)]
        [1.0, 1.25, 0.75, 0.96]
        """
        M, limit = np.asarray(M, dtype=float), np.asarray(limit, dtype=float)
        pg = 1.0 / np.sqrt(1.0 - np.minimum(M, limit) ** 2)
        fall = np.clip((M - limit) / _STALL_SPAN, 0.0, 1.0)
        sub = pg + (self.shock_stall - pg) * fall
        ackeret = np.minimum(1.0, 4.0 / (2.0 * np.pi * np.sqrt(np.maximum(M**2 - 1.0, 1e-6))))
        rise = np.clip((M - 1.0) / 0.1, 0.0, 1.0)
        ratio = np.where(M < 1.0, sub, sub + (ackeret - sub) * rise)
        return np.asarray(1.0 + self.amplitude * (ratio - 1.0))

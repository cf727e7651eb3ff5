"""Lift at subsonic, transonic and low supersonic Mach numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.physics.effects.base import Array, Effect, Parameter, RotorBuild

FORMS = ("prandtl_glauert", "karman_tsien")
# Lift grows a little beyond drag divergence, then the shock stalls the section within this span of Mach number.
_AFTER_DIVERGENCE = 0.04
_STALL_SPAN = 0.12


@dataclass(frozen=True)
class Compressibility(Effect):
    """Growth of lift with Mach number up to lift divergence, shock stall behind it, recovery above M = 1.

    Notes
    -----
    ``form = "prandtl_glauert"``: cl = cl_0 / sqrt(1 - M^2) (Glauert 1928, Proc. R. Soc. A 118:113). ``form =
    "karman_tsien"``: cp = cp_0 / (b + k cp_0), b = sqrt(1 - M^2), k = M^2 / (2 (1 + b)) (von Karman 1941, Journal of
    the Aeronautical Sciences 8:337; Tsien 1939, Journal of the Aeronautical Sciences 6:399), on both sides of a section
    whose mean pressures are -2 t/c (thin ellipse) -+ cl/2.

    Either holds up to the lift-divergence Mach number, set 0.04 above Korn's drag divergence M_dd = kappa - t/c - cl/10
    (Mason 1990, AIAA 90-3262; not checked). Above it, lift falls within 0.12 in M to ``shock_stall`` times the
    incompressible one and recovers between M = 1 and 1.1 to at most 1 or Ackeret's 4 / (2 pi sqrt(M^2 - 1)). The fall
    is a declared rule with the shape of published NACA 0012 tables, not a fit to rotor data. Acts on the attached part;
    separated flow (beyond 40 deg) is not changed.
    """

    amplitude: float = 1.0
    kappa: float = 0.87
    shock_stall: float = 0.75
    form: str = "prandtl_glauert"

    id = "compressibility"
    title = "compressibility (lift)"
    sign = (
        "thrust coefficient grows by about M^2/6 of the tip; depends on air temperature at the same speed, not on "
        "density"
    )
    words = {"form": FORMS}
    parameters = (
        Parameter("amplitude", "1", 0.6, 1.4, "1 is the published form; those differ by a fifth", 5, 0.0),
        Parameter("kappa", "1", 0.80, 0.95, "0.87 NACA sections, 0.95 supercritical (Mason 1990)", 0),
        Parameter("shock_stall", "1", 0.6, 0.9, "declared; NACA 0012 tables at M 0.85-0.95", 0),
    )
    tried = {"form": FORMS, "amplitude": (0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0, 1.1, 1.2, 1.3, 1.4)}
    uses_mach = True
    order = 40

    def section(self, bake: RotorBuild) -> None:
        """Scale lift by Mach number."""
        if bake.M2.size == 1:
            return
        M = np.sqrt(bake.M2)[None, :, None, None]
        # lift divergence hardly knows the Reynolds number: one of them, where Mach numbers matter, keeps this cheap
        near = slice(*np.searchsorted(bake.alpha, np.radians([-40.0, 40.0])))  # where it does not fade to nothing
        thickness, cl = bake.thickness[:, None, None, None], bake.cl[:, :1, bake.fast, near]
        limit = self.lift_divergence(thickness, cl)
        growth = self.growth(np.minimum(M, limit), cl, thickness)
        fade = np.clip((np.radians(40.0) - np.abs(bake.alpha[near])) / np.radians(15.0), 0.0, 1.0)
        own = bake.own_mach[:, None, None, None]
        factor = np.ones((bake.r.size, bake.M2.size, 1, bake.alpha.size))
        factor[..., near] += (self.factor(M, limit, growth) - 1.0) * fade * (1.0 - own)
        bake.scale_lift(factor)

    def lift_divergence(self, thickness: ArrayLike, cl: ArrayLike) -> Array:
        """Mach number of the largest lift. [1]"""
        m_dd = self.kappa - np.asarray(thickness) - 0.1 * np.minimum(np.abs(np.asarray(cl)), 1.2)
        return np.asarray(np.clip(m_dd + _AFTER_DIVERGENCE, 0.4, 0.95))

    def growth(self, M: ArrayLike, cl: ArrayLike = 0.0, thickness: ArrayLike = 0.0) -> Array:
        """Lift ratio cl(M) / cl(0) of subsonic flow by the chosen form."""
        M = np.asarray(M, dtype=float)
        b = np.sqrt(1.0 - M**2)
        if self.form == "prandtl_glauert":
            return np.asarray(1.0 / b)
        k = M**2 / (2.0 * (1.0 + b))
        # with p the pressure of thickness: (l - p) / (b + k (l - p)) + (l + p) / (b - k (l + p)) over 2 l, l = cl / 2
        lift, p = 0.5 * np.minimum(np.abs(np.asarray(cl, dtype=float)), 1.5), 2.0 * np.asarray(thickness, dtype=float)
        upper, lower = b - k * (p + lift), b - k * (p - lift)
        return np.asarray(np.minimum(b / (np.maximum(upper, 0.1 * b) * np.maximum(lower, 0.1 * b)), 1.5 / b))

    def factor(self, M: ArrayLike, limit: ArrayLike, growth: ArrayLike | None = None) -> Array:
        """Lift ratio cl(M) / cl(0)."""
        M, limit = np.asarray(M, dtype=float), np.asarray(limit, dtype=float)
        pg = 1.0 / np.sqrt(1.0 - np.minimum(M, limit) ** 2) if growth is None else np.asarray(growth)
        fall = np.clip((M - limit) / _STALL_SPAN, 0.0, 1.0)
        sub = pg + (self.shock_stall - pg) * fall
        ackeret = np.minimum(1.0, 4.0 / (2.0 * np.pi * np.sqrt(np.maximum(M**2 - 1.0, 1e-6))))
        rise = np.clip((M - 1.0) / 0.1, 0.0, 1.0)
        ratio = np.where(M < 1.0, sub, sub + (ackeret - sub) * rise) if np.any(M >= 1.0) else sub
        return np.asarray(1.0 + self.amplitude * (ratio - 1.0))

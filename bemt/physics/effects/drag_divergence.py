"""Wave drag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.physics.effects.base import Array, Effect, Parameter, RotorBuild

FORMS = ("lock", "cubic")


@dataclass(frozen=True)
class DragDivergence(Effect):
    """Wave drag of the sections above their critical Mach number.

    Notes
    -----
    Korn's drag-divergence Mach number is M_dd = kappa - t/c - cl/10 (Mason 1990, AIAA 90-3262, not checked). ``form =
    "lock"``: fourth-power law cd_w = 20 (M - M_cr)^4 with M_cr = M_dd - (0.1/80)^(1/3); Mason (1990), as quoted in
    Malone and Mason (1995), J. Aircraft 32:431 (not checked against the papers). ``form = "cubic"``: cd_w = 10 (M -
    M_cr)^3 with M_cr = M_dd - (0.002/10)^(1/3), which gives 0.002 at M_dd, as in XROTOR (Drela and Youngren 2003; read
    from memory of its source).

    Above M = 1 the law is capped at Ackeret's supersonic level 4 (alpha^2 + (t/c)^2) / sqrt(M^2 - 1) evaluated not
    closer to M = 1 than 1.05.
    """

    kappa: float = 0.87
    form: str = "lock"

    id = "drag_divergence"
    title = "transonic drag divergence"
    sign = (
        "torque rises sharply above one tip Mach number, thrust barely moves; Reynolds number would act at every speed"
    )
    words = {"form": FORMS}
    parameters = (Parameter("kappa", "1", 0.80, 0.95, "0.87 NACA sections, 0.95 supercritical (Mason 1990)", 5),)
    tried = {"form": FORMS, "kappa": (0.80, 0.825, 0.85, 0.87, 0.89, 0.92, 0.95)}
    uses_mach = True
    order = 45

    def section(self, bake: RotorBuild) -> None:
        """Add wave drag."""
        if bake.M2.size == 1:
            return
        M = np.sqrt(bake.M2)[None, :, None, None]
        tc = bake.thickness[:, None, None, None]
        small = np.flatnonzero(np.abs(bake.alpha) < np.radians(30.0))
        near = slice(int(small[0]), int(small[-1]) + 1)
        cl0 = np.clip(np.abs(bake.cl[:, :1, bake.fast, near]), 0.0, 1.2)
        wave = self.rise(M, self.kappa - tc - 0.1 * cl0)
        cap = 4.0 * (np.minimum(np.abs(bake.alpha[near]), 0.2) ** 2 + tc**2) / np.sqrt(np.maximum(M**2, 1.1025) - 1.0)
        drag = np.zeros((bake.r.size, bake.M2.size, 1, bake.alpha.size))
        drag[..., near] = np.minimum(wave, cap) * (1.0 - bake.own_mach[:, None, None, None])
        bake.add_drag(drag)

    def rise(self, M: ArrayLike, M_dd: ArrayLike) -> Array:
        """Wave drag coefficient by the chosen law."""
        above = np.asarray(M, dtype=float) - np.asarray(M_dd, dtype=float)
        if self.form == "lock":
            square = np.maximum(above + (0.1 / 80.0) ** (1.0 / 3.0), 0.0) ** 2
            return np.asarray(20.0 * square**2)
        excess = np.maximum(above + (0.002 / 10.0) ** (1.0 / 3.0), 0.0)
        return np.asarray(10.0 * excess * excess**2)

"""Rotational augmentation of lift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Parameter, RotorBuild

FORMS = ("chaviaropoulos", "snel", "du_selig")
# Du and Selig's weight turns back at wider roots than wind turbines have, and below zero at chord = r.
_WIDEST = 0.75


@dataclass(frozen=True)
class StallDelay(Effect):
    """Rotational lift of stalled sections: cl_3D = cl_2D + weight (cl_pot - cl_2D).

    Notes
    -----
    ``form = "chaviaropoulos"``: weight = 2.2 (c/r) cos^4(beta), beta the blade angle, times coefficient / 3
    (Chaviaropoulos and Hansen 2000, J. Fluids Eng. 122:330; not checked). Its a = 2.2, h = 1, n = 4 come from
    quasi-three-dimensional Navier-Stokes solutions. It acts further outboard than the other two. ``form = "snel"``:
    weight = coefficient (c/r)^2, 3 in Snel, Houwink and Bosschers (1994), ECN-C--93-052, eq. 6.2. ``form =
    "du_selig"``: weight = (1.6 (c/r)/0.1267 (1 - (c/r)^e) / (1 + (c/r)^e) - 1) / (2 pi), e = R/r, times coefficient / 3
    and not below zero (Du and Selig 1998, AIAA-98-0021, with a = b = d = 1 and Lambda = 1, the limit of a tip speed
    well above the airspeed; c/r held at 0.75, declared).

    Checked against public codes, not against the reports. cl_pot is the straight line through the zero-lift angle with
    the table's own slope. Faded out between 30 and 50 deg and applied to positive stall only. What rotation adds is a
    force normal to the chord (Lindenburg 2003, ECN-C--03-025; not checked against the report), so drag grows by
    ``normal`` times gain times tan(alpha).
    """

    coefficient: float = 3.0
    normal: float = 1.0
    form: str = "chaviaropoulos"

    id = "stall_delay"
    title = "rotational stall delay"
    sign = (
        "more thrust than the tables give where the root stalls: low advance ratio and high pitch, inboard; no "
        "change unstalled"
    )
    words = {"form": FORMS}
    parameters = (
        Parameter("coefficient", "1", 1.0, 4.0, "3 is the published strength of each form", 5, 0.0),
        Parameter("normal", "1", 0.0, 1.0, "1: the gain is a force normal to the chord; 0: lift only", 0),
    )
    tried = {"form": FORMS, "coefficient": (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)}
    order = 20

    def section(self, bake: RotorBuild) -> None:
        """Lift the stalled part of the tables."""
        weight = np.clip(self.weight(bake.chord / bake.r, bake.r / bake.R, bake.beta), 0.0, 1.0)[:, None, None, None]
        # elsewhere the gain is zero; most of the table need not be touched
        some = slice(*np.searchsorted(bake.alpha, [float(np.min(bake.alpha0)), np.radians(50.0)]))
        a = bake.alpha_col[..., some]
        a0 = bake.alpha0[:, None, :, None]
        pot = np.minimum(bake.cla[:, None, :, None], 2.0 * np.pi) * (a - a0)
        fade = np.clip((np.radians(50.0) - a) / np.radians(20.0), 0.0, 1.0) * (a > a0)
        gain = np.maximum(pot - bake.cl[..., some], 0.0)
        gain *= weight * fade
        bake.cl[..., some] += gain
        bake.cd[..., some] += self.normal * gain * np.tan(np.clip(a, 0.0, np.radians(60.0)))

    def weight(self, chord_over_r: Array, r_over_R: Array, beta: Array) -> Array:
        """Share of the way to potential-flow lift, before it is held between 0 and 1."""
        if self.form == "chaviaropoulos":
            return np.asarray(self.coefficient / 3.0 * 2.2 * chord_over_r * np.cos(beta) ** 4)
        if self.form == "snel":
            return np.asarray(self.coefficient * chord_over_r**2)
        wide = np.minimum(chord_over_r, _WIDEST)
        power = wide ** (1.0 / r_over_R)
        lead = 1.6 * wide / 0.1267 * (1.0 - power) / (1.0 + power) - 1.0
        return np.asarray(self.coefficient / 3.0 * lead / (2.0 * np.pi))

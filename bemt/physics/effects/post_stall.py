"""Lift and drag of stalled sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Parameter, RotorBuild
from bemt.physics.sections.polars import first_stall

FORMS = ("viterna", "plate")
# Stall is looked for up to here; the plate takes over within the span behind it [rad].
_STALL_LAST, _PLATE_SPAN = np.radians(25.0), np.radians(10.0)
# Lift of the reversed section over that of the same angle in normal flow (as in bemt.physics.sections.polars).
_REVERSED = 0.7


@dataclass(frozen=True)
class PostStall(Effect):
    """Drag at 90 deg of the blade, and the curve that leads there from the stall.

    Notes
    -----
    ``form = "viterna"``: cl = cd_max/2 sin 2a + A2 cos^2 a / sin a and cd = cd_max sin^2 a + B2 cos a with A2, B2 from
    the stall point (Viterna and Janetzke 1982, NASA TM-82944; equation numbers not checked). They are linear in cd_max,
    so the change from the table's own drag at 90 deg is added and vanishes at the stall. ``form = "plate"``: beyond the
    stall the section becomes a separated flat plate within 10 deg, force normal to the chord, cl = cd_max sin a cos a
    and cd = cd_max sin^2 a (Hoerner 1965, Fluid-Dynamic Drag, ch. 3; not checked).

    cd_max = 1.11 + 0.018 AR (Viterna and Janetzke 1982) to 2.0 for an infinite plate. Off: post-stall data of the
    tables.
    """

    form: str = "viterna"
    cd_max: float = 1.6

    id = "post_stall"
    title = "lift and drag of stalled sections"
    sign = (
        "only where the blade stalls (low advance ratio, high pitch): more torque, thrust on a plateau; no change "
        "unstalled"
    )
    words = {"form": FORMS}
    parameters = (Parameter("cd_max", "1", 1.1, 2.0, "1.11 + 0.018 AR to flat plate, Viterna 1982"),)
    tried = {"form": FORMS, "cd_max": (1.1, 1.25, 1.4, 1.55, 1.7, 1.85, 2.0)}
    order = 12
    on_by_default = False

    def section(self, bake: RotorBuild) -> None:
        """Change the tables beyond the stall, on both sides."""
        least = bake.cd.min(axis=-1, keepdims=True)
        for sign in (1.0, -1.0):
            stall = _stall(bake, sign)[:, None, :, None]
            a = sign * bake.alpha_col
            right = np.abs(bake.alpha - sign * 0.5 * np.pi).argmin()
            if self.form == "viterna":
                self._viterna(bake, a, stall, sign, bake.cd[..., right : right + 1].copy())
            else:
                self._plate(bake, a, stall, sign)
        np.maximum(bake.cd, least, out=bake.cd)

    def _viterna(self, bake: RotorBuild, a: Array, stall: Array, sign: float, cd_90: Array) -> None:
        more = self.cd_max - cd_90
        front = np.clip(np.where(a > 0.5 * np.pi, np.pi - a, a), stall, 0.5 * np.pi)
        side = np.where(a > 0.5 * np.pi, -_REVERSED, 1.0)
        on = (a > stall) & (np.pi - a > stall)
        lead = np.sin(stall) ** 2 / np.cos(stall)
        bake.cl += on * sign * side * more * (0.5 * np.sin(2.0 * front) - lead * np.cos(front) ** 2 / np.sin(front))
        bake.cd += on * more * (np.sin(front) ** 2 - lead * np.cos(front))

    def _plate(self, bake: RotorBuild, a: Array, stall: Array, sign: float) -> None:
        t = np.clip((np.minimum(a, np.pi - a) - stall) / _PLATE_SPAN, 0.0, 1.0)
        w = t * t * (3.0 - 2.0 * t)
        bake.cl += w * (sign * self.cd_max * np.sin(a) * np.cos(a) - bake.cl)
        bake.cd += w * (self.cd_max * np.sin(a) ** 2 - bake.cd)


def _stall(bake: RotorBuild, sign: float) -> Array:
    """Angle of the stall of each station and Reynolds number, incompressible, (N, Nr) [rad]."""
    a = sign * bake.alpha
    window = np.flatnonzero((a > 0.0) & (a <= _STALL_LAST))[:: int(sign)]
    return np.asarray(a[window][first_stall(np.moveaxis(sign * bake.cl[:, 0][..., window], -1, 0))])

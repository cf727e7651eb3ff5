"""Section of the blade that is not the one assumed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class Section(Effect):
    """Camber and drag level other than assumed: another section, rough surface, early or late transition.

    Notes
    -----
    Thin-aerofoil theory gives a parabolic camber line of height f (share of the chord) the zero-lift angle -2 f
    (Glauert 1926, Elements of Aerofoil and Airscrew Theory, ch. 7); the lift of the attached section changes by its
    slope times 2 camber and its stall angle stays, unlike a pitch error, which moves both. ``drag`` multiplies the drag
    of the attached section: about 2 with standard roughness, 0.7 with laminar flow kept (Abbott and von Doenhoff 1959,
    Theory of Wing Sections, ch. 7; not checked). Both fade out between 15 and 30 deg.
    """

    camber: float = 0.01
    drag: float = 1.2

    id = "section"
    geometric = True
    title = "camber and drag level of the blade section"
    check = (
        "copy the section at 0.75 R from the blade (a cast, or a cut through a broken one) and compare it with the case"
    )
    check_minutes = 120.0
    sign = (
        "lift changes by a constant amount at every advance ratio and drag by one factor, at any speed; neither "
        "depends on Reynolds number, Mach number or time"
    )
    parameters = (
        Parameter("camber", "1", -0.02, 0.02, "camber of small propellers is known to about 2 % of chord", 5, 0.0),
        Parameter("drag", "1", 0.7, 2.0, "laminar to rough, Abbott and von Doenhoff 1959", 3, 1.0),
    )
    order = 10
    on_by_default = False

    def section(self, bake: RotorBuild) -> None:
        """Shift lift and scale drag of the attached section."""
        attached = np.clip((np.radians(30.0) - np.abs(bake.alpha_col)) / np.radians(15.0), 0.0, 1.0)
        bake.cl += bake.cla[:, None, :, None] * 2.0 * self.camber * attached
        bake.cd *= 1.0 + (self.drag - 1.0) * attached
        bake.alpha0 = bake.alpha0 - 2.0 * self.camber

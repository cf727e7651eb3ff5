"""Blades that end before the stated radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class TipCut(Effect):
    """Tips cut, broken or worn: the blades end at (1 - cut) R.

    Notes
    -----
    Geometry only: beyond the new radius there is no blade, and the tip vortex leaves there (Prandtl's F takes the new
    radius). Blade elements are those of the shorter blade, each with the section of the element that it replaces.
    Thrust falls faster than any section drag or gain explains, about as the fourth power of the radius, torque as the
    fifth (Buckingham 1914 for similar blades; a cut blade keeps its chord at the new tip and loses less). Range up to
    15 % (declared): cut to fit a frame, or damaged. Open rotors only: in a duct shorter blades are a wider gap.
    """

    cut: float = 0.05

    id = "tip_cut"
    geometric = True
    evident = True
    title = "blades shorter than stated"
    sign = "less thrust and even less torque at every speed; the advance ratio of zero thrust barely moves"
    check = "measure the diameter"
    in_duct = "in a duct shorter blades are a wider tip gap"
    check_minutes = 2.0
    parameters = (Parameter("cut", "1", 0.0, 0.15, "declared, share of the radius", 4, 0.0),)
    on_by_default = False

    def blade(self, bake: RotorBuild) -> None:
        """End the blades at the new radius."""
        R = (1.0 - self.cut) * bake.R
        share = (R - bake.Rhub) / (bake.R - bake.Rhub)
        r = bake.Rhub + (bake.r - bake.Rhub) * share
        chord, beta = (np.interp(r, bake.r, values) for values in (bake.chord, bake.beta))
        bake.sigma = bake.B * chord / (2.0 * np.pi * r)
        bake.r, bake.dr, bake.chord, bake.beta, bake.R = r, bake.dr * share, chord, beta, R

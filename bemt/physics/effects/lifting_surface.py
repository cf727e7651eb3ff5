"""Lift that a blade near its tip lacks against a lifting line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.physics.effects.base import Array, Effect, Parameter, RotorBuild

# Rate of the closed form: least squares on the lattice of tests/test_lifting_surface.py, c/R 0.15 to 0.2 [1].
RATE = 1.36


def slope_ratio(distance: ArrayLike) -> Array:
    """Lift slope of a section of a flat blade over that of the same section in a lifting line."""
    return np.asarray(np.sqrt(-np.expm1(-RATE * np.maximum(np.asarray(distance, dtype=float), 0.0))))


@dataclass(frozen=True)
class LiftingSurface(Effect):
    """Blade as a surface: alpha - alpha_0 of a section shrinks by sqrt(1 - exp(-1.36 d)), d = (R - r) / chord.

    Notes
    -----
    Near the tip the downwash grows along the chord, which costs lift (Helmbold 1942; Morgan, Silovic and Denny 1968;
    neither checked against the paper). Blade elements see one downwash for the whole chord, that of a lifting line. The
    loss is on wings 2 pi / sqrt(1 + (2/AR)^2) for 2 pi (Helmbold 1942, Jahrbuch der deutschen Luftfahrtforschung
    I:111), on marine screws the camber and angle corrections of Morgan, Silovic and Denny (1968), Trans. SNAME 76.
    Along the blade it depends only on the distance to the tip in chords: a vortex lattice on helicoids of advance 0.05
    to 0.25 R per radian, 2 to 4 blades, c/R 0.1 to 0.33, over a lifting line with the same wake gives one curve, which
    the closed form meets within 0.01 to 0.07 (our own computation; a part of it is a test). At given wake and angle
    thrust falls by 5 % (c/R 0.1) to 11 % (c/R 0.33). Mach number enters as in the rule of Goethert (1940): d times
    sqrt(1 - M^2), M held at 0.95. Drag follows the smaller angle. Full below 20 deg, zero beyond 40 deg. Not applied at
    a duct wall, which mirrors the tip.

    Off by default: rotors with known sections and Re above 1e5 agree better with measurements (Caradonna and Tung at 8
    and 12 deg +16 to +26 % becomes +5 to +13 %, 28 in propeller +5.4 to +0.9 %), small propellers, for which the
    section rule was calibrated without it, agree less. With the population of rotors fitted anew, families left out
    whole, thrust at rest is off by 7.7 % in the median instead of 5.6, and the log score falls from 0.573 to 0.469
    (``reports/README.md``): our interpretation is two errors that cancel there.
    """

    strength: float = 1.0

    id = "lifting_surface"
    inviscid = True
    title = "lift loss at wide tips (lifting surface)"
    sign = "less thrust and torque by nearly the same share at every advance ratio, more for wider tips"
    diagnosed = False
    parameters = (Parameter("strength", "1", 0.0, 1.2, "1 is the closed form", 0, 0.0),)
    order = 46
    on_by_default = False

    def section(self, bake: RotorBuild) -> None:
        """Read the tables at the smaller angle."""
        if bake.ducted:
            return
        chords = (bake.R - bake.r) / np.maximum(bake.chord, 1e-9)
        stretch = np.sqrt(1.0 - np.minimum(bake.M2, 0.95**2))
        loss = self.strength * (1.0 - slope_ratio(chords[:, None] * stretch))[:, :, None, None]
        # angles that change, with a neighbour on either side
        held = np.flatnonzero(np.abs(bake.alpha) < np.radians(40.0))
        near = slice(max(int(held[0]) - 1, 0), int(held[-1]) + 2)
        alpha = bake.alpha[near]
        x = np.clip((np.radians(40.0) - np.abs(alpha)) / np.radians(20.0), 0.0, 1.0)
        fade = x * x * (3.0 - 2.0 * x)
        seen = alpha - loss * (alpha - bake.alpha0[:, None, :, None]) * fade
        i = np.clip(np.searchsorted(alpha, seen, side="right") - 1, 0, alpha.size - 2)
        weight = (seen - alpha[i]) / (alpha[i + 1] - alpha[i])
        for table in (bake.cl, bake.cd):
            low, high = (np.take_along_axis(table[..., near], j, -1) for j in (i, i + 1))
            table[..., near] = low + weight * (high - low)

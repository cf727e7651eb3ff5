"""Propeller put on the shaft the wrong way round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class MountedBackwards(Effect):
    """Rear face in front: a screw turned over still pushes the same way, its sections meet the air tail first.

    Notes
    -----
    Blade angles stay. Each section is turned by half a turn in its own plane, so that its camber is upside down and the
    sharp edge leads: cl(alpha) becomes -cl(-alpha), which moves the zero-lift angle by twice itself. ``drag``
    multiplies the drag of the attached section: a NACA 0012 tail first has two to three times its usual least drag
    (Critzos, Heyson and Boswinkle 1955, NACA TN 3361; not checked); for thinner and cambered sections declared.
    """

    drag: float = 2.0

    id = "mounted_backwards"
    title = "propeller mounted backwards"
    check = "look at the propeller: the side with the label, and the rounded edges, lead"
    check_minutes = 1.0
    sign = "half of the thrust is lost at every speed and torque at rest rises; no thrust from a lower airspeed on"
    parameters = (Parameter("drag", "1", 1.0, 3.0, "Critzos et al. 1955, declared for cambered sections", 3),)
    order = -10
    on_by_default = False

    def section(self, bake: RotorBuild) -> None:
        """Turn the tables upside down and scale the drag of the attached section."""
        attached = np.clip((np.radians(30.0) - np.abs(bake.alpha_col)) / np.radians(15.0), 0.0, 1.0)
        bake.cl = -_mirrored(bake.cl, bake.alpha)
        bake.cd = _mirrored(bake.cd, bake.alpha) * (1.0 + (self.drag - 1.0) * attached)
        bake.alpha0 = -bake.alpha0


def _mirrored(table: Array, alpha: Array) -> Array:
    """Table at the opposite angles of attack, linear between those of the grid."""
    k = np.clip(np.searchsorted(alpha, -alpha) - 1, 0, alpha.size - 2)
    w = np.clip((-alpha - alpha[k]) / (alpha[k + 1] - alpha[k]), 0.0, 1.0)
    return np.asarray((1.0 - w) * table[..., k] + w * table[..., k + 1])

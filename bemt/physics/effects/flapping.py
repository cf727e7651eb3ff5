"""Blades on flapping hinges."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class Flapping(Effect):
    """Blades that flap freely about hinges on the shaft, as on helicopters, autogiros and teetering rotors.

    Notes
    -----
    Only in oblique flow, where :func:`bemt.physics.bem.oblique.flap` finds the tilt of the path of the tips at which
    the hub takes no roll and pitch moment: first harmonic, hinges at the shaft, so that inertia and centrifugal moments
    cancel (Wheatley 1934, NACA Report 487; Leishman 2006, Principles of Helicopter Aerodynamics, sec. 4.5 to 4.7;
    equation numbers not checked). The coning angle follows from the mass of the blades and is declared: 0 if teetering
    without precone, some 4 to 8 deg on helicopters and autogiros.
    """

    coning_deg: float = 0.0

    id = "flapping"
    title = "blades on flapping hinges"
    sign = "in wind from the side the disk tilts back: more H, no hub moments; no change in axial flow"
    parameters = (Parameter("coning_deg", "deg", 0.0, 15.0, "0 teetering to heavily loaded light blades", 4),)
    on_by_default = False
    diagnosed = False

    def momentum(self, bake: RotorBuild) -> None:
        """Hinge the blades."""
        bake.num.cone = math.radians(self.coning_deg)

"""Another blade than stated: diameter, pitch, cut tips, another propeller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Loads, Parameter, RotorBuild


@dataclass(frozen=True)
class Diameter(Effect):
    """A similar propeller of another size: T ~ D^4 and Q ~ D^5 at equal speed, V/(n D) with its own D.

    Notes
    -----
    Dimensional analysis: CT and CQ of similar propellers are functions of J alone (Buckingham 1914, Phys. Rev. 4:345).
    Loads follow J by the slopes of the baseline. The solver has a blade to scale (`tip_cut`) and needs no such effect:
    it is for recordings without a case.
    """

    change: float = 0.05

    id = "diameter"
    title = "different diameter"
    check = "measure the diameter"
    sign = "torque changes a little more than thrust, both at every speed; V/(n D) shifts"
    geometric = True
    parameters = (Parameter("change", "1", -0.4, 1.0, "declared; propellers that one motor turns", 9, 0.0, 0.1),)
    diagnosed = False
    on_by_default = False

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Scale both loads at the advance ratio of the other diameter."""
        larger = 1.0 + self.change
        slower = flow.V * (1.0 / larger - 1.0)
        loads.T = larger**4 * (loads.T + flow.dT_dV * slower)
        loads.Q = larger**5 * (loads.Q + flow.dQ_dV * slower)


# Another propeller than that of the reference.


@dataclass(frozen=True)
class AnotherPropeller(Effect):
    """Blades of another make: both loads change by shares of their own.

    Notes
    -----
    CT and CP of two propellers of one size have no common law; they differ by a share each, bent a little over speed
    and advance ratio (declared). The solver has a blade to change and needs no such effect: it is for recordings
    without a case.
    """

    thrust: float = 0.2
    torque: float = 0.2

    id = "propeller"
    title = "another propeller"
    check = "compare label, blade count and weight"
    sign = "both loads change by large, different shares: pitch, blades, chord and section at once"
    parameters = (
        Parameter("thrust", "1", -0.8, 4.0, "declared; propellers that one motor turns", 3, 0.0, 0.4),
        Parameter("torque", "1", -0.8, 4.0, "the same", 3, 0.0, 0.4),
    )
    diagnosed = False
    on_by_default = False

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Scale both loads."""
        loads.T = (1.0 + self.thrust) * loads.T
        loads.Q = (1.0 + self.torque) * loads.Q


# Blade angle other than stated.


@dataclass(frozen=True)
class PitchOffset(Effect):
    """All blade angles differ by the same amount: manufacture, setting of the hub, wrong reference line.

    Notes
    -----
    beta + offset at every station. Manual settings and moulded blades are off by about a degree, a wrong label or
    reference line (chord or underside) by several. Hence a heavy-tailed prior; both declared.
    """

    offset_deg: float = 1.0

    id = "pitch_offset"
    geometric = True
    title = "wrong blade angle"
    check = "measure the blade angle at 0.75 R relative to the plane of rotation"
    sign = "shifts the advance ratio of zero thrust equally at every speed; a gain or density error does not shift it"
    parameters = (Parameter("offset_deg", "deg", -8.0, 8.0, "declared: workshop, or another label", 9, 0.0, 1.0),)
    on_by_default = False

    def blade(self, bake: RotorBuild) -> None:
        """Turn the blade."""
        bake.beta = bake.beta + np.radians(self.offset_deg)


# Blades that end before the stated radius.


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
    title = "blades shorter than stated"
    sign = "less thrust and even less torque at every speed; the advance ratio of zero thrust barely moves"
    check = "measure the diameter"
    parameters = (Parameter("cut", "1", 0.0, 0.15, "declared, share of the radius", 4, 0.0),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """In a duct the gap is what changes."""
        return "in a duct shorter blades are a wider tip gap" if flow.ducted else ""

    def blade(self, bake: RotorBuild) -> None:
        """End the blades at the new radius."""
        R = (1.0 - self.cut) * bake.R
        share = (R - bake.Rhub) / (bake.R - bake.Rhub)
        r = bake.Rhub + (bake.r - bake.Rhub) * share
        chord, beta = (np.interp(r, bake.r, values) for values in (bake.chord, bake.beta))
        bake.sigma = bake.B * chord / (2.0 * np.pi * r)
        bake.r, bake.dr, bake.chord, bake.beta, bake.R = r, bake.dr * share, chord, beta, R

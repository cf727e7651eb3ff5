"""Turbulent windmill and vortex-ring states."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, RotorBuild


@dataclass(frozen=True)
class HighInduction(Effect):
    """Momentum balance where momentum theory fails: the flow through the disk nearly stops or turns back.

    Notes
    -----
    From the vortex-ring state to the windmill state of a rotor in descent the disk follows the induced velocity
    measured on helicopter rotors, Leishman (2006), Principles of Helicopter Aerodynamics, sec. 2.14.3 (book not
    checked; :func:`bemt.physics.bem.residual.mass_flow`), and so does its mirror image, a propeller that brakes in wind
    from the front. Never acts in normal propeller operation.
    """

    id = "high_induction"
    inviscid = True
    title = "turbulent windmill and vortex-ring state"
    sign = "only in windmilling and descent, never in normal propeller operation"
    diagnosed = False

    def momentum(self, bake: RotorBuild) -> None:
        """Switch the bridge on."""
        bake.num.bridge = 1.0

"""Another propeller than that of the reference."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Loads, Parameter


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
    check = "measure the diameter; compare label, blade count and weight"
    check_minutes = 2.0
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

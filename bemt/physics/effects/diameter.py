"""Another diameter than that of the case or of the reference."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Loads, Parameter


@dataclass(frozen=True)
class Diameter(Effect):
    """A similar propeller of another size at equal speed: T ~ D^4 and Q ~ D^5, at its own V/(n D) and Re.

    Notes
    -----
    Dimensional analysis: CT and CQ of similar propellers are functions of J, Re and tip Mach number alone (Buckingham
    1914, Phys. Rev. 4:345). A rotor k times as large at V is the same rotor at V/k, viscosity mu/k^2 and speed of sound
    a/k, with k^4 times the thrust and k^5 times the torque. Sold sizes are not quite similar: that is the error of this
    law.
    """

    change: float = 0.05

    id = "diameter"
    title = "different diameter"
    check = "measure the diameter"
    sign = "torque changes a little more than thrust, both at every speed; V/(n D) shifts"
    geometric = True
    parameters = (Parameter("change", "1", -0.4, 1.0, "declared; propellers that one motor turns", 9, 0.0, 0.1),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """A duct fits one diameter."""
        return "blades of another diameter do not fit the duct" if flow.ducted else ""

    def plausible(self, flow: Flow) -> bool:
        """Sizes on sale are 4 % apart or more (half an inch at 12 in)."""
        return abs(self.change) >= 0.04

    def flow(self, flow: Flow) -> None:
        """Conditions at which the rotor is similar to the larger one."""
        larger = 1.0 + self.change
        flow.V, flow.mu, flow.a_sound = flow.V / larger, flow.mu / larger**2, flow.a_sound / larger
        flow.side = None if flow.side is None else flow.side / larger

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Scale both loads."""
        larger = 1.0 + self.change
        loads.T = larger**4 * loads.T
        loads.Q = larger**5 * loads.Q

"""Another diameter than that of the reference."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Loads, Parameter


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
    check_minutes = 2.0
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

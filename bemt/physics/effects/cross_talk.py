"""Cells that feel each other's load."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Parameter, Reading

FORMS = ("torque_in_thrust", "thrust_in_torque")


@dataclass(frozen=True)
class CrossTalk(Effect):
    """One cell shows a share of the other load: thrust + k Q / R, or torque + k T R.

    Notes
    -----
    Off-diagonal term of a balance's calibration matrix (AIAA R-091A-2020; Barlow, Rae and Pope 1999, Low-Speed Wind
    Tunnel Testing, ch. 7; not checked). The lever R makes k a pure number; 5 % is declared: an axis that misses the
    cell by R/20, seldom much more. Its sign reverses with the direction of rotation.
    """

    form: str = "torque_in_thrust"
    k: float = 0.02

    id = "cross_talk"
    title = "cross-talk between thrust and torque cell"
    check = "hang a dead weight on each cell separately and read both"
    sign = "one channel follows the load of the other over advance ratio; the sign reverses with the sense of rotation"
    kind = "stand"
    fault = "cross-talk"
    sensor = "torque_Nm"
    words = {"form": FORMS}
    parameters = (Parameter("k", "1", -0.2, 0.2, "declared, arm error of R/20, seldom R/5", off=0.0, usual=0.05),)
    tried = {"form": FORMS, "k": tuple(k / 100.0 for k in range(-20, 21) if k)}
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Add the share of the other load."""
        T, Q = reading.values["thrust_N"], reading.values["torque_Nm"]
        if self.form == "torque_in_thrust":
            reading.values["thrust_N"] = T + self.k * Q / flow.R
        else:
            reading.values["torque_Nm"] = Q + self.k * T * flow.R

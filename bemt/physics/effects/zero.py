"""Zero of a load cell."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Parameter, Reading


@dataclass(frozen=True)
class Zero(Effect):
    """The cell shows its load plus a constant share of full scale.

    Notes
    -----
    Zero error of a load cell (ISO 376:2011; not checked): falls as 1/n^2 in the coefficient. Full scale is the largest
    reading of the recording. No tare, cable pull, weight of the motor: typically a few percent, sometimes far more.
    Hence a heavy-tailed prior; declared.
    """

    zero: float = 0.01

    kind = "stand"
    fault = "zero"
    parameters = (Parameter("zero", "1", -0.25, 0.25, "declared, of full scale; a weight not tared", 3, 0.0, 0.02),)
    check = "hang dead weights on the cell before and after a run"
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Shift the channel."""
        reading.values[self.sensor] = reading.values[self.sensor] + self.zero * reading.full_scale[self.sensor]


class ThrustZero(Zero):
    """The thrust cell shows the thrust plus a constant share of full scale."""

    id = "thrust_zero"
    title = "zero offset of the thrust cell"
    sign = "thrust off by a constant, which falls as 1/n^2 in the coefficient, at any airspeed; torque is right"
    sensor = "thrust_N"


class TorqueZero(Zero):
    """The torque cell shows the torque plus a constant share of full scale."""

    id = "torque_zero"
    title = "zero offset of the torque cell"
    sign = "torque off by a constant, which falls as 1/n^2 in the coefficient, at any airspeed; thrust is right"
    sensor = "torque_Nm"
    check = (
        "hang dead weights on the cell before and after a run; if it reads right, a bearing or cable drags: turn the "
        "motor without its propeller"
    )

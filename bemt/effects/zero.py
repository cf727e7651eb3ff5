"""Zero of a load cell."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.effects.base import Effect, Flow, Parameter, Reading


@dataclass(frozen=True)
class Zero(Effect):
    """The cell shows its load plus a constant share of full scale.

    Notes
    -----
    Zero error of a load cell (ISO 376:2011; not checked): falls as 1/n^2 in the coefficient.  Full scale is the largest
    reading of the recording.  The range of +-5 % is declared: no tare, cable pull, weight of the motor.
    """

    zero: float = 0.01

    kind = "stand"
    fault = "zero"
    parameters = (Parameter("zero", "1", -0.05, 0.05, "declared, share of full scale", 3, 0.0),)
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Shift the channel."""
        reading.values[self.sensor] = reading.values[self.sensor] + self.zero * reading.full_scale[self.sensor]


class ThrustZero(Zero):
    """The thrust cell shows the thrust plus a constant share of full scale."""

    id = "thrust_zero"
    title = "zero of the thrust cell"
    sign = "thrust off by a constant, which falls as 1/n^2 in the coefficient, whatever airspeed; torque is right"
    sensor = "thrust_N"


class TorqueZero(Zero):
    """The torque cell shows the torque plus a constant share of full scale."""

    id = "torque_zero"
    title = "zero of the torque cell"
    sign = "torque off by a constant, which falls as 1/n^2 in the coefficient, whatever airspeed; thrust is right"
    sensor = "torque_Nm"

"""Zero of the thrust cell."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.effects.base import Effect, Flow, Parameter, Reading


@dataclass(frozen=True)
class ThrustZero(Effect):
    """The cell shows the thrust plus a constant share of full scale.

    Notes
    -----
    Zero error of a load cell (ISO 376:2011; not checked): falls as 1/n^2 in the coefficient.  Full scale is the largest
    thrust of the recording.  The range of +-5 % is declared: no tare, cable pull, weight of the motor.
    """

    zero: float = 0.01

    id = "thrust_zero"
    title = "zero of the thrust cell"
    sign = "thrust off by a constant, which falls as 1/n^2 in the coefficient, whatever airspeed; torque is right"
    kind = "stand"
    fault = "zero"
    sensor = "thrust_N"
    parameters = (Parameter("zero", "1", -0.05, 0.05, "declared, share of full scale", 3, 0.0),)
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Shift the channel."""
        reading.values["thrust_N"] = reading.values["thrust_N"] + self.zero * reading.full_scale["thrust_N"]

"""Calibration factor of a load cell."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Parameter, Reading


@dataclass(frozen=True)
class Gain(Effect):
    """The cell shows (1 + gain) times its load.

    Notes
    -----
    Linear calibration error of a load cell (ISO 376:2011 states it as a relative error; not checked). Typically a few
    percent, sometimes far more (wrong arm, wrong calibration mass, factor of another cell). Hence a heavy-tailed prior;
    declared.
    """

    gain: float = 0.03

    kind = "stand"
    fault = "gain"
    parameters = (Parameter("gain", "1", -0.4, 0.4, "declared, workshop calibration; seldom far more", 3, 0.0, 0.05),)
    check = "hang dead weights on the cell before and after a run"
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Scale the channel."""
        reading.values[self.sensor] = reading.values[self.sensor] * (1.0 + self.gain)


class ThrustGain(Gain):
    """The thrust cell shows (1 + gain) times the thrust."""

    id = "thrust_gain"
    title = "gain error of the thrust cell"
    sign = "thrust off by one factor at every speed and airspeed while torque is right; air density would move both"
    sensor = "thrust_N"


class TorqueGain(Gain):
    """The torque cell shows (1 + gain) times the torque."""

    id = "torque_gain"
    title = "gain error of the torque cell"
    sign = "torque off by one factor at every speed and airspeed while thrust is right; air density would move both"
    sensor = "torque_Nm"

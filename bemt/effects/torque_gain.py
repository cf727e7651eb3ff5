"""Calibration factor of the torque cell."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.effects.base import Effect, Flow, Parameter, Reading


@dataclass(frozen=True)
class TorqueGain(Effect):
    """The cell shows (1 + gain) times the torque.

    Notes
    -----
    Linear calibration error of a load cell (ISO 376:2011 states it as a relative error; not checked).  The range of
    +-10 % is declared: wrong arm, wrong calibration mass or another cell's factor.
    """

    gain: float = 0.03

    id = "torque_gain"
    title = "calibration factor of the torque cell"
    sign = "torque off by one factor at every speed and airspeed while thrust is right; air would move both"
    kind = "stand"
    fault = "gain"
    sensor = "torque_Nm"
    parameters = (Parameter("gain", "1", -0.10, 0.10, "declared, workshop calibration", 3, 0.0),)
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Scale the channel."""
        reading.values["torque_Nm"] = reading.values["torque_Nm"] * (1.0 + self.gain)

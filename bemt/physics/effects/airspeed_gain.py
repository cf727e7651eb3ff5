"""Calibration factor of the airspeed meter."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class AirspeedGain(Effect):
    """The rotor meets the recorded airspeed over (1 + gain).

    Notes
    -----
    A pitot tube gives V = C sqrt(2 q / rho), C within 1 % of 1 for a standard tube aligned with the flow (ISO
    3966:2020; not checked); a tube near the rotor or the wall, a transducer gain or a manually entered density are off
    by more. +-20 % is declared, as is the usual 5 %. Static points stay static.
    """

    gain: float = 0.1

    id = "airspeed_gain"
    title = "gain error of the airspeed sensor"
    sign = (
        "scales J by one factor at every speed of rotation, no change in static runs; wind at an angle of acos(1 / "
        "factor) looks the same, an offset would fade as 1/n"
    )
    kind = "stand"
    fault = "gain"
    sensor = "airspeed_m_s"
    check = "compare the pitot with a second one, or run with the wind tunnel empty"
    flies = True
    parameters = (Parameter("gain", "1", -0.2, 0.2, "declared, pitot and transducer", 5, 0.0, 0.05),)
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Scale the airspeed."""
        flow.V = flow.V / (1.0 + self.gain)

"""Errors of the airspeed meter: gain and zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class AirspeedGain(Effect):
    """The rotor meets the recorded airspeed over (1 + gain).

    Notes
    -----
    A pitot tube gives V = C sqrt(2 q / rho), C within 1 % of 1 for a standard tube aligned with the flow (ISO
    3966:2020; not checked); a tube near the rotor or the wall, a transducer gain or a manually entered density are off
    by more. +-20 % is declared. Static points stay static.
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
    parameters = (Parameter("gain", "1", -0.2, 0.2, "declared, pitot and transducer", 5, 0.0),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """Static points have no airspeed to be wrong."""
        return "" if np.any(flow.V > 0.0) else "no point has airspeed"

    def flow(self, flow: Flow) -> None:
        """Scale the airspeed."""
        flow.V = flow.V / (1.0 + self.gain)


# Zero of the airspeed meter.

# Air that may blow back at a rotor at rest [m/s].
_DRAUGHT = 0.3


@dataclass(frozen=True)
class AirspeedOffset(Effect):
    """The rotor meets the recorded airspeed plus a constant, where there is airspeed.

    Notes
    -----
    Draught in the hall or zero of the pitot transducer: 0.15 Pa is 0.5 m/s in still air. The range is declared.
    Points recorded at V = 0 are treated as static and stay so; a wind does not turn round. A live sensor that reads
    nearly nothing at rest does not read too much.
    """

    offset_m_s: float = 0.5

    id = "airspeed_offset"
    title = "airspeed offset"
    check = "read the pitot with the tunnel fan off, and compare it with a second one"
    sign = "shift of J that fades as 1/n at high speed of rotation; a wrong blade angle shifts every speed equally"
    kind = "stand"
    fault = "zero"
    sensor = "airspeed_m_s"
    parameters = (Parameter("offset_m_s", "m/s", -3.0, 3.0, "declared, pitot zero", 7, 0.0, 0.5),)
    on_by_default = False

    def applies(self, flow: Flow) -> str:
        """Static points have no airspeed to be wrong."""
        return "" if np.any(flow.V > 0.0) else "no point has airspeed"

    def flow(self, flow: Flow) -> None:
        """Shift the airspeed."""
        shifted = flow.V + self.offset_m_s
        flow.V = np.select([flow.V > 0.0, flow.V < 0.0], [np.maximum(shifted, 0.0), shifted], flow.V)

    def plausible(self, flow: Flow) -> bool:
        """No live reading becomes a wind against the rotor."""
        live = flow.V[flow.V != 0.0]
        return live.size == 0 or self.offset_m_s >= -max(float(np.min(live)), 0.0) - _DRAUGHT

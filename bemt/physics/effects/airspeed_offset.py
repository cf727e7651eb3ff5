"""Zero of the airspeed meter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Parameter

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
    flies = True
    parameters = (Parameter("offset_m_s", "m/s", -3.0, 3.0, "declared, pitot zero", 7, 0.0, 0.5),)
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Shift the airspeed."""
        shifted = flow.V + self.offset_m_s
        flow.V = np.select([flow.V > 0.0, flow.V < 0.0], [np.maximum(shifted, 0.0), shifted], flow.V)

    def plausible(self, flow: Flow) -> bool:
        """No live reading becomes a wind against the rotor."""
        live = flow.V[flow.V != 0.0]
        return live.size == 0 or self.offset_m_s >= -max(float(np.min(live)), 0.0) - _DRAUGHT

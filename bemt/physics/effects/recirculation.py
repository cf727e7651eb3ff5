"""Slipstream that comes back through the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class Recirculation(Effect):
    """Room that is too small: the slipstream returns and the rotor meets V + k v (1 - exp(-t/tau)).

    Notes
    -----
    First-order growth from the start of each run, ``before_s`` before its first point, v the induced speed of the
    baseline; ventilated by airspeed as 1 / (1 + (V/v)^2). Small rotors in closed rooms change within seconds of the
    start: Stephenson, Weitsman and Zawodny (2019), J. Acoust. Soc. Am. 145:1153 (not checked); form and ranges are
    declared. Needs time: permanent recirculation cannot be distinguished from lower thrust.
    """

    k: float = 0.05
    tau_s: float = 10.0
    before_s: float = 0.0

    id = "recirculation"
    title = "recirculation in the room"
    check = "release smoke behind the propeller, or repeat with a door open and after a pause"
    check_in_room = True
    along = ("time_s",)
    sign = (
        "thrust decays within seconds of each start, only at low advance ratio; drift of a cell does not depend on "
        "speed"
    )
    needs = ("time_s",)
    parameters = (
        Parameter("k", "1", 0.0, 0.25, "declared; share of the induced speed", 4, 0.0),
        Parameter("tau_s", "s", 1.0, 60.0, "declared; room length over jet speed", 4),
        Parameter("before_s", "s", 0.0, 600.0, "declared; the rotor ran before the recording began", 0),
    )
    discrete = ("before_s",)
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Add the returning flow."""
        v = flow.induced
        fade = v**2 / np.maximum(v**2 + flow.V**2, 1e-12)
        flow.V = flow.V + self.k * v * fade * -np.expm1(-(flow.clock + self.before_s) / self.tau_s)

    def variants(self) -> tuple[dict[str, float], ...]:
        """Eleven sizes at six times, the times in ratio, from the start; and sizes of a room long stirred up."""
        sizes = (0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.125, 0.15, 0.2, 0.25)
        times = (1.0, 2.5, 6.0, 13.0, 28.0, 60.0)
        grown = tuple({"k": k, "tau_s": t, "before_s": 0.0} for k in sizes for t in times)
        late = tuple({"k": k, "tau_s": 60.0, "before_s": 20.0} for k in sizes)
        return (*grown, *late, *({"k": k, "tau_s": 1.0, "before_s": 600.0} for k in sizes))

"""Slipstream that comes back through the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class Recirculation(Effect):
    """Room that is too small: the slipstream returns and the rotor meets V + k v (1 - exp(-t/tau)).

    Notes
    -----
    First-order growth from the start of each run, v the induced speed of the baseline; ventilated by airspeed as
    1 / (1 + (V/v)^2).  That small rotors in closed rooms change within seconds of the start: Stephenson, Weitsman and
    Zawodny (2019), J. Acoust. Soc. Am. 145:1153 (not checked); form and ranges are declared.  Needs time: recirculation
    that is always there cannot be told from a smaller thrust.
    """

    k: float = 0.05
    tau_s: float = 10.0

    id = "recirculation"
    title = "slipstream that returns through the room"
    check = "let smoke out behind the propeller, or repeat with a door open and after a pause"
    along = ("time_s",)
    sign = "thrust decays within seconds of each start and at low advance ratio only; a drifting cell knows no speed"
    needs = ("time_s",)
    parameters = (
        Parameter("k", "1", 0.0, 0.15, "declared; share of the induced speed", 4, 0.0),
        Parameter("tau_s", "s", 1.0, 60.0, "declared; room length over jet speed", 4),
    )
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Add the returning flow."""
        v = flow.induced
        fade = v**2 / np.maximum(v**2 + flow.V**2, 1e-12)
        flow.V = flow.V + self.k * v * fade * -np.expm1(-flow.clock / self.tau_s)

    def variants(self) -> tuple[dict[str, float], ...]:
        """Fifteen sizes at seven times, the times in ratio."""
        return tuple({"k": k / 100.0, "tau_s": t} for k in range(1, 16) for t in (1.0, 2.0, 4.0, 8.0, 16.0, 31.0, 60.0))

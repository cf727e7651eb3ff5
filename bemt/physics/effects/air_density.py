"""Density other than written down."""

from __future__ import annotations

from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Flow, Parameter


@dataclass(frozen=True)
class AirDensity(Effect):
    """Air of another density: barometer not read, other altitude, warm or humid room.

    Notes
    -----
    rho (1 + change). +-3 % is weather (CIPM-2007, Picard et al. 2008, Metrologia 45:149: 1 % per 3 K or 10 hPa); -30 %
    is 3500 m of the U.S. Standard Atmosphere (1976). Viscosity and speed of sound stay the same: they depend on
    temperature only.
    """

    change: float = -0.10

    id = "air_density"
    exact = True
    title = "wrong air density"
    check = "read barometer and thermometer at the stand and compute the density"
    check_minutes = 3.0
    sign = (
        "thrust and torque off by the same share at every speed and advance ratio; a cell gain moves only one of them"
    )
    parameters = (
        Parameter("change", "1", -0.35, 0.5, "weather +-3 %; altitude to 3500 m, forgotten or wrongly stated", 7, 0.0),
    )
    on_by_default = False

    def plausible(self, flow: Flow) -> bool:
        """Whether there is such air: 0.66 kg/m3 at 6000 m (U.S. Standard Atmosphere), 1.42 at sea level and -25 C."""
        rho = flow.rho * (1.0 + self.change)
        return bool(rho.min() > 0.66 and rho.max() < 1.42)

    def flow(self, flow: Flow) -> None:
        """Change the density."""
        flow.rho = flow.rho * (1.0 + self.change)

"""Number written down in another unit than its label says."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bemt.effects.base import Effect, Flow, Parameter, Reading, choice

_SIGNED = ("thrust_N", "torque_Nm", "airspeed_m_s")
CHANNELS = ("thrust_N", "torque_Nm", "rpm", "airspeed_m_s", "density_kg_m3")
_G, _LB, _INCH = 9.80665, 0.45359237, 0.0254
_LBF, _OZF = _G * _LB, _G * _LB / 16.0

# What one SI unit is in each of the units that get mixed up with it; the slip may go either way.
# A ratio nearer to 1 than this (natural logarithm) is a gain, not a slip.
_LARGE = 0.25
_UNITS: dict[str, dict[str, float]] = {
    "thrust_N": {
        "kgf": 1.0 / _G, "gf": 1000.0 / _G, "lbf": 1.0 / _LBF, "ozf": 1.0 / _OZF, "kN": 1e-3, "lb for kg": _LB,
    },
    "torque_Nm": {
        "kgf m": 1.0 / _G, "kgf cm": 100.0 / _G, "gf cm": 1e5 / _G, "ozf in": 1.0 / (_OZF * _INCH),
        "lbf in": 1.0 / (_LBF * _INCH), "lbf ft": 1.0 / (_LBF * 12.0 * _INCH), "N mm": 1000.0, "N cm": 100.0,
        "N in": 1.0 / _INCH, "power over rev/s": 2.0 * math.pi, "power over rev/min": math.pi / 30.0,
        "rev/min for rev/s": 60.0, "mm for in": 25.4, "lb for kg": _LB, "lbf for N": 1.0 / _LBF,
    },
    "rpm": {"rad/s": math.pi / 30.0, "rev/s": 1.0 / 60.0, "deg/s": 6.0, "1000 rpm": 1e-3},
    "airspeed_m_s": {"km/h": 3.6, "mph": 1.0 / 0.44704, "kn": 3600.0 / 1852.0, "ft/s": 1.0 / 0.3048, "cm/s": 100.0},
    "density_kg_m3": {"lb/ft3": 0.3048**3 / _LB, "slug/ft3": 0.3048**4 / _LBF, "g/cm3": 1e-3},
}  # fmt: skip


@dataclass(frozen=True)
class UnitSlip(Effect):
    """One channel is recorded as ``factor`` times its true value, the ratio of two units, or with the other sign.

    Notes
    -----
    Exact ratios of units by definition (pound, inch and standard gravity: BIPM 2019, SI Brochure 9th ed., and NIST SP
    811, 2008, appendix B). Thrust and torque are read in another unit; true speed, airspeed and density are the
    recorded value over the factor. ``unit`` names the pair for the reader and has no effect.
    """

    channel: str = "thrust_N"
    factor: float = 1.0 / _G
    unit: str = "kgf"

    id = "unit_slip"
    title = "wrong unit or sign"
    check = "check the unit in the settings of the stand and in the heading of the file"
    sign = "one channel off by exactly the ratio of two units, or by -1, at every point; no physics gives such a factor"
    kind = "stand"
    fault = "unit"
    discrete = ("factor",)
    parameters = (Parameter("factor", "1", -1e5, 1e5, "ratios of units by definition; -1: the other sign", 0, 1.0),)
    on_by_default = False

    def __post_init__(self) -> None:
        """Refuse unknown channels."""
        choice("channel", self.channel, CHANNELS)

    def flow(self, flow: Flow) -> None:
        """Undo the slip in what the rotor met."""
        if self.channel == "rpm":
            flow.rpm = flow.rpm / self.factor
        elif self.channel == "airspeed_m_s":
            flow.V = flow.V / self.factor
        elif self.channel == "density_kg_m3":
            flow.rho = flow.rho / self.factor

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Show the slip in what was measured."""
        if self.channel in ("thrust_N", "torque_Nm"):
            reading.values[self.channel] = reading.values[self.channel] * self.factor

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Every pair of units of every channel, both ways, and the sign of what a stand may count the other way."""
        signs: tuple[dict[str, str | float], ...] = tuple(
            {"channel": c, "factor": -1.0, "unit": "the other sign"} for c in _SIGNED
        )
        slips: tuple[dict[str, str | float], ...] = tuple(
            {"channel": channel, "factor": f, "unit": words}
            for channel, units in _UNITS.items()
            for unit, factor in units.items()
            for f, words in ((factor, unit), (1.0 / factor, f"taken for {unit}"))
            if abs(math.log(f)) > _LARGE
        )
        return slips + signs

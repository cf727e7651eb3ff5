"""What was entered wrongly: density, blades seen by the speed sensor, units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from bemt.base import unit_errors
from bemt.physics.effects.base import Effect, Flow, Parameter, Reading, choice


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


# Speed of rotation that is not the indicated one.

_EPS = tuple(e / 400.0 for e in range(-16, 17) if e)
# Rarer ones are left to the scaling laws; nearer ones (11 : 12) are within what the level of a model may be off.
_RATIOS = unit_errors.speed_ratios(rarest=1.0, nearest=Fraction(8, 7))


@dataclass(frozen=True)
class RpmScale(Effect):
    """The indicated speed is factor (1 + eps) times the true one.

    Notes
    -----
    Electronic speed controllers count electrical revolutions (pole pairs times mechanical), optical tachometers count
    blades. A wrong setting gives a rational factor (`bemt.base.unit_errors`, declared). ``eps``: clock error of cheap
    counters, +-1 % (declared). The rotor turns at the indicated speed over the factor.
    """

    factor: float = 1.0
    eps: float = 0.01

    id = "rpm_scale"
    title = "wrong speed of rotation"
    check = "count the revolutions with an optical tachometer; check the pole pairs or blades set in the counter"
    sign = (
        "thrust and torque off by the same square, and airspeed effects appear at another J; a rational ratio of "
        "pole or blade counts; density does not change J"
    )
    kind = "stand"
    fault = "scale"
    sensor = "rpm"
    discrete = ("factor",)
    parameters = (
        Parameter("factor", "1", 1.0 / 24.0, 24.0, "pole pairs and blade counts", 0, 1.0),
        Parameter("eps", "1", -0.04, 0.04, "declared, clock of a counter", 0, 0.0, 0.01),
    )
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Turn the rotor at its true speed."""
        flow.rpm = flow.rpm / (self.factor * (1.0 + self.eps))

    def variants(self) -> tuple[dict[str, float], ...]:
        """Small errors, then the rational factors."""
        small = [{"factor": 1.0, "eps": e} for e in _EPS]
        return (*small, *({"factor": f, "eps": 0.0} for f in sorted(r.ratio for r in _RATIOS)))

    def odds(self) -> float:
        """Relative frequency of the ratio."""
        return next((r.weight for r in _RATIOS if r.ratio == self.factor), 1.0)


# Number written down in another unit than its label says.

_SIGNED = ("thrust_N", "torque_Nm", "airspeed_m_s")
_KINDS = {"thrust_N": "force", "torque_Nm": "torque", "rpm": "rotation", "airspeed_m_s": "airspeed",
          "density_kg_m3": "density"}  # fmt: skip
CHANNELS = tuple(_KINDS)
_KGF = unit_errors.named("kgf", "N")
_Setting = dict[str, str | float]


@cache
def _settings() -> dict[tuple[str, float], tuple[_Setting, float]]:
    """Setting and relative frequency by channel and factor; units of one size are one."""
    out: dict[tuple[str, float], tuple[_Setting, float]] = {}
    for channel, kind in _KINDS.items():
        for e in unit_errors.errors(kind):
            factor = next((f for c, f in out if c == channel and math.isclose(f, e.factor, rel_tol=1e-9)), e.factor)
            first, weight = out.get((channel, factor), ({"channel": channel, "factor": factor, "unit": e.short}, 0.0))
            out[channel, factor] = first, max(weight, e.weight)
    signs: list[_Setting] = [{"channel": c, "factor": -1.0, "unit": "the other sign"} for c in _SIGNED]
    return out | {(str(s["channel"]), -1.0): (s, 1.0) for s in signs}


@dataclass(frozen=True)
class UnitSlip(Effect):
    """One channel is recorded as ``factor`` times its true value, the ratio of two units, or with the other sign.

    Notes
    -----
    Exact ratios of units by definition (pound, inch and standard gravity: BIPM 2019, SI Brochure 9th ed., and NIST SP
    811, 2008, appendix B), all in `bemt.base.unit_errors`. Thrust and torque are read in another unit; true speed,
    airspeed and density are the recorded value over the factor. ``unit`` names the pair for the reader and has no
    effect. How common each error is, is declared.
    """

    channel: str = "thrust_N"
    factor: float = _KGF.factor
    unit: str = _KGF.short

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
        return tuple(setting for setting, _ in _settings().values())

    def odds(self) -> float:
        """Relative frequency of the error."""
        return _settings().get((self.channel, self.factor), ({}, 1.0))[1]

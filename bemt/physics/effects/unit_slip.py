"""Number written down in another unit than its label says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from bemt.base import unit_errors
from bemt.physics.effects.base import Effect, Flow, Parameter, Reading

_SIGNED = ("thrust_N", "torque_Nm", "airspeed_m_s")
_KINDS = {"thrust_N": "force", "torque_Nm": "torque", "rpm": "rotation", "airspeed_m_s": "airspeed",
          "density_kg_m3": "density"}  # fmt: skip
LOADS = "loads"
"""Thrust and torque, along an axis that points the other way."""
CHANNELS = (*_KINDS, LOADS)
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
    signs: list[_Setting] = [{"channel": c, "factor": -1.0, "unit": "the other sign"} for c in (*_SIGNED, LOADS)]
    return out | {(str(s["channel"]), -1.0): (s, 1.0) for s in signs}


@dataclass(frozen=True)
class UnitSlip(Effect):
    """One channel is recorded as ``factor`` times its true value, the ratio of two units, or with the other sign.

    Both loads have the other sign where the axis of the balance points the other way (``channel`` "loads").

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
    check_minutes = 3.0
    sign = "one channel off by exactly the ratio of two units, or by -1, at every point; no physics gives such a factor"
    kind = "stand"
    fault = "unit"
    discrete = ("factor",)
    words = {"channel": CHANNELS}
    parameters = (Parameter("factor", "1", -1e5, 1e5, "ratios of units by definition; -1: the other sign", 0, 1.0),)
    on_by_default = False

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
        loads = ("thrust_N", "torque_Nm")
        for load in loads if self.channel == LOADS else {self.channel}.intersection(loads):
            if load in reading.values:
                reading.values[load] = reading.values[load] * self.factor

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Every pair of units of every channel, both ways, and the sign of what a stand may count the other way."""
        return tuple(setting for setting, _ in _settings().values())

    def odds(self) -> float:
        """Relative frequency of the error."""
        return _settings().get((self.channel, self.factor), ({}, 1.0))[1]

"""Battery whose voltage gives way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, Reading

# Readings for each number of the circuit, and the largest scatter about it that is a meter's noise, a share [1].
_ROWS, _METER = 4, 0.003


@dataclass(frozen=True)
class BatterySag(Effect):
    """Bus voltage Voc - I R that falls with current and discharge, so that the same pulse width gives less speed.

    Notes
    -----
    Equivalent circuit of a battery with one resistance (Tremblay and Dessaint 2009, World Electric Vehicle J. 3:289,
    without its exponential zone; not checked). Recorded ``voltage_V`` is taken relative to ``usual_voltage_V``, that of
    the known speed at the pulse width, or else to its largest value. If that circuit fits it over a run, the fit is
    used, without the noise of the meter; otherwise the voltage as recorded.
    Otherwise the lost share is ``sag`` at the largest current (recorded ``current_A``, else power of shaft and copper),
    in proportion, plus ``discharge`` in proportion to the charge drawn, whole at the end of the run. The speed follows
    from (1 - lost) (1 + u) = y + u y^2, the motor at constant duty with torque as speed squared and copper drop u over
    back-EMF, ``copper`` at the largest Q / Omega. Loads at the measured speed are unchanged.
    """

    sag: float = 0.08
    discharge: float = 0.05
    copper: float = 0.15

    id = "battery_sag"
    title = "battery voltage sag"
    along = ("time_s",)
    sign = (
        "speed at one pulse width drops most at full power and late in a run; thrust at the measured speed is unchanged"
    )
    kind = "drive"
    needs = ("pwm_s",)
    parameters = (
        Parameter("sag", "1", 0.0, 0.25, "declared; 10 to 30 mOhm packs at full current", 3, 0.0),
        Parameter("discharge", "1", 0.0, 0.2, "lithium cell, 4.2 to 3.4 V", 3, 0.0),
        Parameter("copper", "1", 0.03, 0.4, "declared, share of the back-EMF at full load", 3),
    )
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change the speed that the pulse width gives."""
        if "rpm" not in reading.values:
            return
        lever = np.maximum(np.nan_to_num(flow.Q0), 0.0) / flow.omega
        u = self.copper * lever / max(float(np.max(lever)), 1e-30)
        c = (1.0 - self._lost(flow, u)) * (1.0 + u)
        y = 2.0 * c / (1.0 + np.sqrt(1.0 + 4.0 * u * c))
        reading.values["rpm"] = reading.values["rpm"] * y

    def _lost(self, flow: Flow, u: Array) -> Array:
        """Share of the voltage that is lost, (P,) [1]."""
        # the battery gives what the shaft takes and what the copper loses
        power = np.nan_to_num(np.maximum(flow.extra.get("current_A", flow.Q0 * flow.omega * (1.0 + u)), 0.0))
        power = power / max(float(np.max(power)), 1e-30)
        charge = np.zeros_like(power)
        for run in flow.runs:
            t = flow.time_s[run]
            drawn = np.r_[0.0, np.cumsum(np.diff(t) * 0.5 * (power[run][1:] + power[run][:-1]))]
            charge[run] = drawn / max(float(drawn[-1]), 1e-30)
        if "voltage_V" not in flow.extra:
            return np.asarray(self.sag * power + self.discharge * charge)
        volts = flow.extra["voltage_V"].copy()
        for run in flow.runs:
            volts[run] = _circuit(volts[run], power[run], charge[run])
        return np.nan_to_num(1.0 - volts / flow.extra.get("usual_voltage_V", np.nanmax(volts)))


def _circuit(volts: Array, current: Array, charge: Array) -> Array:
    """Voltage of an open-circuit voltage over charge and one resistance, where that fits the recorded one. [V]"""
    x = np.column_stack([np.ones_like(charge), current, charge, charge**2, charge**3])
    if len(volts) < _ROWS * x.shape[1] or not np.isfinite(volts).all():
        return volts
    fit = x @ np.linalg.lstsq(x, volts, rcond=None)[0]
    return fit if float(np.std(fit - volts)) < _METER * float(np.mean(volts)) else volts

"""Supply and motor during a run: sag, a wrong voltage, heating."""

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
            t = flow.extra["time_s"][run]
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


# Supply at another voltage.


@dataclass(frozen=True)
class SupplyVoltage(Effect):
    """Battery or supply whose voltage differs by one share at every load.

    Notes
    -----
    Direct-current motor at constant duty: V = Omega / k + R I, I = k Q (Drela 2007, First-Order DC Electric Motor
    Model, MIT, eq. 1 and 2; not checked), Q as the square of the speed. With u the copper drop over the back-EMF the
    speed changes by y of (1 + change) (1 + u) = y + u y^2; u is ``copper`` at the largest Q / Omega of the recording,
    elsewhere in proportion. Voltage sag under load is `battery_sag`. Loads at the measured speed are unchanged.
    """

    change: float = 0.1
    copper: float = 0.15

    id = "supply_voltage"
    title = "different supply voltage"
    sign = (
        "speed at one pulse width changes by nearly the same share at light and full load; thrust at the measured "
        "speed is unchanged"
    )
    kind = "drive"
    needs = ("pwm_s",)
    check = "read the voltage at the controller"
    parameters = (
        Parameter("change", "1", -0.45, 0.8, "declared; two to four cells in place of three", 7, 0.0, 0.1),
        Parameter("copper", "1", 0.03, 0.4, "declared, share of the back-EMF at full load", 2),
    )
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change the speed that the pulse width gives."""
        if "rpm" not in reading.values:
            return
        lever = np.maximum(np.nan_to_num(flow.Q0), 0.0) / flow.omega
        u = self.copper * lever / max(float(np.max(lever)), 1e-30)
        c = (1.0 + self.change) * (1.0 + u)
        reading.values["rpm"] = reading.values["rpm"] * 2.0 * c / (1.0 + np.sqrt(1.0 + 4.0 * u * c))


# Motor that gets hot.

COPPER, MAGNET = 0.0039, 0.001  # per kelvin


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding and magnets warm up, so that the same pulse width turns the rotor at another speed.

    Notes
    -----
    Direct-current motor at constant duty: d V = k Omega + (R/k) Q, Q proportional to Omega^2. R grows by 0.39 %/K
    (copper, IEC 60034-1), k falls by 0.1 %/K (NdFeB remanence, typical data sheet; not checked). With u the copper drop
    over the back-EMF when cold, b = 1 - 0.001 dT and r = 1 + 0.0039 dT the speed changes by y of (1 + u) = b y + (u r /
    b) y^2. u is ``copper`` at the largest Q / Omega of the recording, elsewhere in proportion. One heat capacity, one
    time constant (declared): tau d(dT)/dt = c (Q / Qmax)^2 - dT, from cold, with c such that the warmest point of the
    recording is warmer by ``rise_K``. Between runs on one clock the motor is stopped and cools; a restarted clock
    starts cold. Loads at the measured speed are unchanged.
    """

    rise_K: float = 40.0
    tau_s: float = 120.0
    copper: float = 0.15

    id = "motor_heating"
    title = "motor heating (winding and magnets)"
    along = ("time_s",)
    sign = "speed at the same pulse width drifts with time under load; thrust at the measured speed is unchanged"
    kind = "drive"
    needs = ("pwm_s", "time_s")
    parameters = (
        Parameter("rise_K", "K", 0.0, 120.0, "insulation class H, IEC 60034-1", 3, 0.0),
        Parameter("tau_s", "s", 20.0, 1800.0, "declared, small outrunner to large", 4),
        Parameter("copper", "1", 0.03, 0.4, "declared, share of the back-EMF at full load", 0),
    )
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change the speed that the pulse width gives."""
        if "rpm" not in reading.values:
            return
        Q = np.maximum(np.nan_to_num(flow.Q0), 0.0)
        lever = Q / flow.omega
        u = self.copper * lever / max(float(np.max(lever)), 1e-30)
        warm = self.rise_K * self._warmth(flow, (Q / max(float(np.max(Q)), 1e-30)) ** 2)
        b, r = 1.0 - MAGNET * warm, 1.0 + COPPER * warm
        y = 2.0 * (1.0 + u) / (b + np.sqrt(b**2 + 4.0 * (u * r / b) * (1.0 + u)))
        reading.values["rpm"] = reading.values["rpm"] * y

    def _warmth(self, flow: Flow, heat: Array) -> Array:
        """Warming over that of the warmest point, (P,) [1]."""
        out = np.zeros_like(heat)
        warm, last = 0.0, np.inf
        for run in flow.runs:
            t = flow.extra["time_s"][run]
            warm = warm * float(np.exp(-(t[0] - last) / self.tau_s)) if t[0] > last else 0.0
            out[run[0]] = warm
            for i in range(1, run.size):
                left = float(np.exp(-(t[i] - t[i - 1]) / self.tau_s))
                warm = warm * left + 0.5 * (heat[run[i]] + heat[run[i - 1]]) * (1.0 - left)
                out[run[i]] = warm
            last = float(t[-1])
        return np.asarray(out / max(float(np.max(out)), 1e-30))

    def variants(self) -> tuple[dict[str, float], ...]:
        """Ten temperatures at six times, the times in ratio, for motors from efficient to hard-driven."""
        times = (20.0, 50.0, 120.0, 300.0, 750.0, 1800.0)
        rises = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0, 105.0, 120.0)
        return tuple(
            {"rise_K": k, "tau_s": t, "copper": c} for c in (0.05, 0.1, 0.2, 0.35) for k in rises for t in times
        )

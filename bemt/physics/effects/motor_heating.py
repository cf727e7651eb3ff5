"""Motor that gets hot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, Reading

COPPER, MAGNET = 0.0039, 0.001  # per kelvin


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding and magnets warm up, so that the same pulse width turns the rotor at another speed.

    Notes
    -----
    Direct-current motor at constant duty: d V = k Omega + (R/k) Q, Q proportional to Omega^2. R grows by 0.39 %/K
    (copper, IEC 60034-1), k falls by 0.1 %/K (NdFeB remanence, typical data sheet; not checked). With u the copper drop
    over the back-EMF when cold, b = 1 - 0.001 dT and r = 1 + 0.0039 dT the speed changes by y of (1 + u) = b y + (u r /
    b) y^2. u is ``copper`` at the largest Q / Omega of the recording, elsewhere in proportion. One heat capacity and
    time constant (declared): tau d(dT)/dt = c (Q / Qmax)^2 - dT, from cold, with c such that the warmest point of the
    recording is warmer by ``rise_K``. The magnets are another body (thermal networks: Mellor, Roberts and Turner 1991,
    IEE Proc. B 138:205; not checked) that warms as much, ``magnets`` times as slowly (declared). Between runs on one
    clock the motor is stopped and cools; a restarted clock starts cold. Loads at the measured speed are unchanged.
    """

    rise_K: float = 40.0
    tau_s: float = 120.0
    copper: float = 0.15
    magnets: float = 1.0

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
        Parameter("magnets", "1", 1.0, 10.0, "declared; their time constant over the winding's", 0),
    )
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change the speed that the pulse width gives."""
        if "rpm" not in reading.values:
            return
        Q = np.maximum(np.nan_to_num(flow.Q0), 0.0)
        lever = Q / flow.omega
        u = self.copper * lever / max(float(np.max(lever)), 1e-30)
        heat = (Q / max(float(np.max(Q)), 1e-30)) ** 2
        winding = self._warmth(flow, heat, self.tau_s)
        magnets = winding if self.magnets == 1.0 else self._warmth(flow, heat, self.magnets * self.tau_s)
        b, r = 1.0 - MAGNET * self.rise_K * magnets, 1.0 + COPPER * self.rise_K * winding
        y = 2.0 * (1.0 + u) / (b + np.sqrt(b**2 + 4.0 * (u * r / b) * (1.0 + u)))
        reading.values["rpm"] = reading.values["rpm"] * y

    def _warmth(self, flow: Flow, heat: Array, tau: float) -> Array:
        """Warming over that of the warmest point, (P,) [1]."""
        out = np.zeros_like(heat)
        warm, last = 0.0, np.inf
        for run in flow.runs:
            t = flow.time_s[run]
            warm = warm * float(np.exp(-(t[0] - last) / tau)) if t[0] > last else 0.0
            out[run[0]] = warm
            for i in range(1, run.size):
                left = float(np.exp(-(t[i] - t[i - 1]) / tau))
                warm = warm * left + 0.5 * (heat[run[i]] + heat[run[i - 1]]) * (1.0 - left)
                out[run[i]] = warm
            last = float(t[-1])
        return np.asarray(out / max(float(np.max(out)), 1e-30))

    def variants(self) -> tuple[dict[str, float], ...]:
        """Ten temperatures, six times and three of the magnets in ratio, for motors from efficient to hard-driven."""
        times = (20.0, 50.0, 120.0, 300.0, 750.0, 1800.0)
        rises = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0, 105.0, 120.0)
        return tuple(
            {"rise_K": k, "tau_s": t, "copper": c, "magnets": m}
            for m in (1.0, 3.0, 10.0)
            for c in (0.05, 0.1, 0.2, 0.35)
            for k in rises
            for t in times
        )

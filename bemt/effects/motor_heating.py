"""Motor that gets hot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Effect, Flow, Parameter, Reading

COPPER, MAGNET = 0.0039, 0.001  # per kelvin


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding and magnets warm up, so that the same pulse width turns the rotor at another speed.

    Notes
    -----
    Direct-current motor at constant duty: d V = k Omega + (R/k) Q, Q proportional to Omega^2.  R grows by 0.39 %/K
    (copper, IEC 60034-1), k falls by 0.1 %/K (NdFeB remanence, typical data sheet; not checked).  With u the copper
    drop over the back-EMF when cold, b = 1 - 0.001 dT and r = 1 + 0.0039 dT the speed changes by y of (1 + u) = b y +
    (u r / b) y^2. u is ``copper`` at the largest Q / Omega of the recording, elsewhere in proportion.  dT = rise (Q /
    Qmax)^2 (1 - exp(-t/tau)), copper loss of the load and one thermal time constant (declared).  Loads at the measured
    speed stay.
    """

    rise_K: float = 40.0
    tau_s: float = 120.0
    copper: float = 0.15

    id = "motor_heating"
    title = "winding and magnets of the motor get warm"
    sign = "speed at the same pulse width creeps with time under load; thrust at the measured speed does not change"
    kind = "drive"
    needs = ("pwm_s", "time_s")
    parameters = (
        Parameter("rise_K", "K", 0.0, 80.0, "insulation class B, IEC 60034-1", 3, 0.0),
        Parameter("tau_s", "s", 20.0, 900.0, "declared, small outrunner to large", 4),
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
        warm = self.rise_K * (Q / max(float(np.max(Q)), 1e-30)) ** 2 * -np.expm1(-flow.clock / self.tau_s)
        b, r = 1.0 - MAGNET * warm, 1.0 + COPPER * warm
        y = 2.0 * (1.0 + u) / (b + np.sqrt(b**2 + 4.0 * (u * r / b) * (1.0 + u)))
        reading.values["rpm"] = reading.values["rpm"] * y

    def variants(self) -> tuple[dict[str, float], ...]:
        """Eight temperatures at six times, the times in ratio, for an efficient and a hard-driven motor."""
        times = (20.0, 43.0, 92.0, 196.0, 420.0, 900.0)
        rises = tuple(10.0 * k for k in range(1, 9))
        return tuple({"rise_K": k, "tau_s": t, "copper": c} for c in (0.1, 0.35) for k in rises for t in times)

"""Supply at another voltage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Parameter, Reading


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

    def applies(self, flow: Flow) -> str:
        """Not where the voltage is recorded beside the usual one: what it says is `battery_sag`."""
        known = "the recording has voltage_V" if {"voltage_V", "usual_voltage_V"} <= flow.extra.keys() else ""
        return super().applies(flow) or known

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change the speed that the pulse width gives."""
        if "rpm" not in reading.values:
            return
        lever = np.maximum(np.nan_to_num(flow.Q0), 0.0) / flow.omega
        u = self.copper * lever / max(float(np.max(lever)), 1e-30)
        c = (1.0 + self.change) * (1.0 + u)
        reading.values["rpm"] = reading.values["rpm"] * 2.0 * c / (1.0 + np.sqrt(1.0 + 4.0 * u * c))

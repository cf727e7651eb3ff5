"""The motor that turns the rotor of an exported model: that of the case's drive, else one as large as the rotor needs.

A direct-current machine behind a battery, as in `bemt.tools.drive.drive_model`: at the duty d and the EMF E = n / K_v,

    I = (d V - E) / (R + d^2 R_b),  Q = k (I - I_0),  k = 30 / (pi K_v)

Programs have one resistance, so d is passed on as d' = (E + R I) / V, which is the same current without R_b.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import plugins
from bemt.base.arrays import Array
from bemt.tools.exports.parts import inertia_estimate

if TYPE_CHECKING:
    from bemt.tools.exports.base import Job

STAND_IN_V = 14.8
"""Voltage of the motor that stands in: any would do, for its current follows from the rotor's power [V]."""
DROP, IDLE = 0.20, 0.073
"""Shares of voltage and current that it loses at full throttle: medians of 859 and 1088 recorded motors with a
propeller, see `bemt.rotors.case.drive_schema` [1]."""
STAND_IN_INERTIA = 0.3
"""Inertia of that motor over the rotor's, as `drive` takes it [1]."""


@dataclass(frozen=True)
class Motor:
    """Motor, controller and battery of one rotor, and the inertia of what turns."""

    kv_rpm_V: float
    volts: float  # At no load [V]
    ohm: float  # Of winding, controller and leads [ohm]
    battery_ohm: float
    no_load_A: float
    exponent: float  # Duty is throttle to this power [1]
    limit_A: float | None  # Of the battery's current
    inertia_kg_m2: float  # Of motor and rotor together
    known: bool  # Whether the case says which motor it is

    @property
    def k(self) -> float:
        """Torque per current. [N m/A]"""
        return 30.0 / (math.pi * self.kv_rpm_V)

    def duty(self, throttle: Array, rpm: Array) -> Array:
        """Duty at a throttle, below the limit of the current [1]."""
        d, emf = np.asarray(throttle, dtype=float) ** self.exponent, np.asarray(rpm, dtype=float) / self.kv_rpm_V
        if self.limit_A is None:
            return d
        rest = self.volts - self.limit_A * self.battery_ohm  # d I(d) = limit, a quadratic in d
        most = (emf + np.sqrt(emf**2 + 4.0 * rest * self.limit_A * self.ohm)) / (2.0 * rest)
        return np.minimum(d, most)

    def torque(self, throttle: Array, rpm: Array) -> Array:
        """Torque on the shaft, above the friction [N m]."""
        d = self.duty(throttle, rpm)
        amps = (d * self.volts - np.asarray(rpm) / self.kv_rpm_V) / (self.ohm + d**2 * self.battery_ohm)
        return np.asarray(self.k * (amps - self.no_load_A))

    def throttle_for(self, rpm: float, torque_Nm: float) -> float:
        """Throttle that holds a speed against a torque, NaN where none does [1]."""
        amps, emf = torque_Nm / self.k + self.no_load_A, rpm / self.kv_rpm_V
        # d^2 R_b I - d V + E + R I = 0, the smaller root
        root = self.volts**2 - 4.0 * self.battery_ohm * amps * (emf + self.ohm * amps)
        d = 2.0 * (emf + self.ohm * amps) / (self.volts + math.sqrt(root)) if root >= 0.0 else math.nan
        return d ** (1.0 / self.exponent) if 0.0 <= d <= 1.0 else math.nan

    def largest_step_s(self, job: Job) -> float:
        """Step of an explicit Euler that settles without overshoot at any speed up to full throttle [s]."""
        t = job.performance
        W, Q = t.rpm * math.pi / 30.0, t.torque_Nm[:, t.at_rest]
        steepest = float(np.max(np.gradient(Q, W)))
        return self.inertia_kg_m2 / (self.k**2 / self.ohm + steepest)


def motor_of(job: Job) -> Motor:
    """Motor of the case's drive; without one, a motor that turns the rotor at the greatest speed of the tables."""
    t, blades = job.performance, inertia_estimate(job)
    c: dict[str, Any] | None = plugins.part("circuit", job.case)
    if c is not None:
        rotor = blades if c["rotor_inertia_kg_m2"] is None else c["rotor_inertia_kg_m2"]
        return Motor(c["kv_rpm_V"], c["volts"], c["ohm"], c["battery_ohm"], c["no_load_A"], c["exponent"],
                     c["limit_A"], rotor + c["motor_inertia_kg_m2"], True)  # fmt: skip
    kv = float(t.rpm[-1]) / (STAND_IN_V * (1.0 - DROP))
    amps = float(t.torque_Nm[-1, t.at_rest]) * math.pi * kv / 30.0 / (1.0 - IDLE)
    return Motor(kv, STAND_IN_V, DROP * STAND_IN_V / amps, 0.0, IDLE * amps, 1.0, None,
                 (1.0 + STAND_IN_INERTIA) * blades, False)  # fmt: skip

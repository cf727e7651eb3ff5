"""Generated trials of a motor constant, labelled as generated: a known constant, noise, and planted errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bemt.tools.drive import motor_constant as mc


@dataclass(frozen=True)
class MotorBench:
    """The truth behind generated trials; defaults follow the thesis's joint motor."""

    name: str = "T-Motor MN4006 KV380"  # of the motor
    # data sheet. [rev/min/V], [%]
    kv_rpm_V: float = 380.0
    kv_tolerance_pct: float = 5.0
    Kt: float = 0.0311  # true q-axis, power-invariant constant. [N m/A]
    # trials
    emf_trials: int = 10
    torque_trials: int = 28
    sd_trial: float = 0.015  # relative scatter of a trial's slope. [1]
    # noise of a reading. [V], [N m]
    sd_volt: float = 0.03
    sd_torque: float = 0.004
    # gains common to all trials are drawn with these. [%]
    u_gain_emf_pct: float = 0.5
    u_gain_torque_pct: float = 0.3
    u_shunt_pct: float = 0.1
    shunt_ohm: float = 250.0  # resistor as assumed. [ohm]


def generate(seed: int, planted: Mapping[str, float] | None = None, bench: MotorBench | None = None) -> dict[str, str]:
    """Generate trials and the motor.toml that describes them.

    The readings carry the error, the motor.toml does not know of it. The data sheet's K_v is drawn within its tolerance
    of what belongs to the true constant only when a seed other than 0 asks for it; seed 0 keeps the printed K_v.
    """
    b, error = bench or MotorBench(), dict(planted or {})
    rng = np.random.default_rng(seed)
    winding = "delta"
    ke = b.Kt / mc.ke_to_kt(1.0, "q_power_invariant", "phase", winding)
    kv = b.kv_rpm_V
    if seed:
        true_kv = 60.0 / (2.0 * math.pi * ke)
        kv = true_kv * (1.0 + b.kv_tolerance_pct / 100.0 * rng.uniform(-1.0, 1.0))
    kv /= error.get("data_sheet.factor", 1.0)
    gain_emf = 1.0 + b.u_gain_emf_pct / 100.0 * rng.standard_normal()
    gain_torque = 1.0 + b.u_gain_torque_pct / 100.0 * rng.standard_normal()
    shunt = b.shunt_ohm * error.get("torque.shunt", 1.0) * (1.0 + b.u_shunt_pct / 100.0 * rng.standard_normal())
    label = f"# generated, not measured: seed {seed}"
    rows = [label, "trial,rpm,peak_to_peak_V"]
    for k in range(b.emf_trials):
        slope = 2.0 * ke * gain_emf * error.get("back_emf.factor", 1.0) * (1.0 + b.sd_trial * rng.standard_normal())
        for rpm in np.linspace(500.0, 4000.0, 8):
            v = slope * rpm * math.pi / 30.0 + error.get("back_emf.offset", 0.0) + b.sd_volt * rng.standard_normal()
            rows.append(f"{k + 1},{rpm:.0f},{v:.4f}")
    torque = [label, "trial,current_A,shunt_V"]
    for k in range(b.torque_trials):
        slope = b.Kt * gain_torque * error.get("torque.factor", 1.0) * (1.0 + b.sd_trial * rng.standard_normal())
        for amps in np.linspace(0.0, 20.0, 11):
            q = slope * amps + error.get("torque.offset", 0.0) + b.sd_torque * rng.standard_normal()
            mA = 4.0 + 8.0 * q
            torque.append(f"{k + 1},{amps:.2f},{mA * 1e-3 * shunt:.5f}")
    toml = _TOML.format(b=b, kv=f"{kv:.6g}", seed=seed, label=label)
    return {"motor.toml": toml, "back_emf.csv": "\n".join(rows) + "\n", "torque.csv": "\n".join(torque) + "\n"}


_TOML = """{label}
schema = "bemt.motor/1"

[motor]
name = "{b.name}"
winding = "delta"
kv_rpm_V = {kv}
kv_tolerance_pct = {b.kv_tolerance_pct}
data = "generated trials, seed {seed}: not measured"

[result]
current = "q_power_invariant"
between = "phase"

[back_emf]
file = "back_emf.csv"
measure = "peak_to_peak"
between = "phase"
u_gain_pct = {b.u_gain_emf_pct}

[torque]
file = "torque.csv"
shunt_ohm = {b.shunt_ohm}
u_shunt_pct = {b.u_shunt_pct}
low_mA = 4.0
high_mA = 20.0
torque_low_Nm = 0.0
torque_high_Nm = 2.0
current = "q_power_invariant"
between = "phase"
u_gain_pct = {b.u_gain_torque_pct}

[[stated]]
name = "thesis, data sheet"
Kt_Nm_A = 0.0308

[[stated]]
name = "thesis, adopted (28 trials)"
Kt_Nm_A = 0.0311
"""

"""The stand of the proof: what a load cell, a tachometer and a tired battery make of real loads.

Nothing of this is shared with the measurement effects of the solver's library.  Noise is correlated in time
(first-order autoregressive plus white), every run has its own gain (a session is taken down and set up again), readings
are rounded to the cell's steps.  Faults are off unless a concealed item switches them on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.proof.truth_world import Conditions, TrueLoads


@dataclass(frozen=True)
class StandMotor:
    """Motor, ESC and battery of the stand."""

    kv: float  # Speed constant. [rev/min/V]
    # Winding and ESC resistance [ohm], no-load current [A]
    resistance: float
    idle_A: float
    # Open-circuit voltage when full [V], inner resistance [ohm]
    cells_V: float
    battery_ohm: float


@dataclass(frozen=True)
class StandErrors:
    """Quality of the stand, and its faults."""

    # Relative noise of a reading, and noise over full scale. [-]
    noise: float = 0.005
    floor: float = 0.001
    # Share of correlated noise in the variance, and its correlation from row to row. [-]
    share: float = 0.6
    memory: float = 0.7
    session: float = 0.002  # Standard deviation of the gain from run to run. [-]
    step: float = 0.0002  # Smallest step of a reading over full scale. [-]
    # Relative noise of the tachometer [-], noise of the pitot [m/s]
    rpm_noise: float = 0.0005
    airspeed_noise: float = 0.05
    # Gain error [-]; zero error over full scale [-]
    thrust_gain: float = 0.0
    torque_gain: float = 0.0
    thrust_zero: float = 0.0
    torque_zero: float = 0.0
    cross_talk: float = 0.0  # Thrust reading per torque over R. [-]
    # Zero that grows in time, over full scale [-]; time to half of it [s]
    thrust_drift: float = 0.0
    torque_drift: float = 0.0
    drift_time: float = 300.0
    hysteresis: float = 0.0  # Reading that stays behind when the load falls, over full scale. [-]
    # Tachometer reading over the truth, less 1 [-]; pitot error [m/s]; pitot reading over the truth, less 1 [-]
    rpm_scale: float = 0.0
    airspeed_offset: float = 0.0
    airspeed_gain: float = 0.0
    unit_slip: float = 1.0  # Factor of the slipped unit on ``unit_channel``. [-]
    unit_channel: str = "thrust"  # thrust or torque
    motor_heating: float = 0.0  # Warming of the winding at the end of a long run. [K]
    battery_sag: float = 0.0  # Share of the open-circuit voltage lost at the end of a long run. [-]


def _sigma(true: Array, scale: float, stand: StandErrors) -> Array:
    return np.asarray(np.hypot(stand.noise * np.abs(true), stand.floor * scale))


def covariance(true: Array, run: NDArray[np.int64], scale: float, stand: StandErrors) -> Array:
    """Covariance of the readings of one channel, (P, P)."""
    s = _sigma(true, scale, stand)
    i = np.arange(true.size)
    same = run[:, None] == run[None, :]
    memory = stand.share * stand.memory ** np.abs(i[:, None] - i[None, :]) * same
    both = np.outer(s, s) * (memory + (1.0 - stand.share) * np.eye(true.size))
    step = (stand.step * scale) ** 2 / 12.0
    return np.asarray(both + np.outer(true, true) * stand.session**2 * same + step * np.eye(true.size))


def _noise(s: Array, run: NDArray[np.int64], stand: StandErrors, rng: np.random.Generator) -> Array:
    """First-order autoregressive noise within a run, plus white noise."""
    kick = rng.standard_normal(s.size)
    out = np.empty(s.size)
    for i in range(s.size):
        fresh = i == 0 or run[i] != run[i - 1]
        out[i] = kick[i] if fresh else stand.memory * out[i - 1] + np.sqrt(1.0 - stand.memory**2) * kick[i]
    return np.asarray(s * (np.sqrt(stand.share) * out + np.sqrt(1.0 - stand.share) * rng.standard_normal(s.size)))


def _channel(
    true: Array, c: Conditions, scale: float, stand: StandErrors, drift: float, gain: float, zero: float,
    rng: np.random.Generator | None,
) -> Array:  # fmt: skip
    out = (1.0 + gain) * true + zero * scale + drift * scale * c.time / (c.time + stand.drift_time)
    if stand.hysteresis:
        falling = np.concatenate(([0.0], np.diff(true))) < 0.0
        out = out + stand.hysteresis * scale * falling * (1.0 - (true / scale) ** 2)
    if rng is not None:
        _, where = np.unique(c.run, return_inverse=True)
        out = out * (1.0 + stand.session * rng.standard_normal(where.max() + 1)[where])
        out = out + _noise(_sigma(true, scale, stand), c.run, stand, rng)
        out = np.round(out / (stand.step * scale)) * (stand.step * scale)
    return np.asarray(out)


def record(
    loads: TrueLoads, c: Conditions, radius: float, motor: StandMotor | None, stand: StandErrors,
    rng: np.random.Generator | None, scales: tuple[float, float] | None = None,
) -> dict[str, Array]:  # fmt: skip
    """Readings of all instruments."""
    full = scales or full_scales(loads)
    thrust = _channel(loads.thrust, c, full[0], stand, stand.thrust_drift, stand.thrust_gain, stand.thrust_zero, rng)
    thrust = thrust + stand.cross_talk * loads.torque / radius
    torque = _channel(loads.torque, c, full[1], stand, stand.torque_drift, stand.torque_gain, stand.torque_zero, rng)
    if stand.unit_channel == "thrust":
        thrust = thrust * stand.unit_slip
    else:
        torque = torque * stand.unit_slip
    draw = rng.standard_normal((4, c.rpm.size)) if rng is not None else np.zeros((4, c.rpm.size))
    flying = bool(np.any(c.airspeed > 0.0))  # a static stand has no pitot
    out = {
        "rpm": c.rpm * (1.0 + stand.rpm_scale) * (1.0 + stand.rpm_noise * draw[0]),
        "airspeed_m_s": c.airspeed * (1.0 + stand.airspeed_gain)
        + (stand.airspeed_offset + stand.airspeed_noise * draw[1]) * flying,
        "thrust_N": thrust,
        "torque_Nm": torque,
        "time_s": c.time,
    }
    if motor is not None:
        late = c.time / max(float(c.time[-1]), 1.0)
        k_t = 60.0 / (2.0 * np.pi * motor.kv) * (1.0 - 0.001 * stand.motor_heating * late)
        current = np.maximum(loads.torque, 0.0) / k_t + motor.idle_A
        volts = motor.cells_V * (1.0 - stand.battery_sag * (0.6 * late + 0.4 * late**3)) - current * motor.battery_ohm
        hot = motor.resistance * (1.0 + 0.0039 * stand.motor_heating * np.sqrt(late))
        duty = (c.rpm * k_t * 2.0 * np.pi / 60.0 + current * hot) / volts
        out |= {
            "voltage_V": volts * (1.0 + 0.001 * draw[2]),
            "current_A": current * (1.0 + 0.004 * draw[3]),
            "pwm_us": 1000.0 + 1000.0 * np.clip(duty, 0.0, 1.0),
        }
    return out


def full_scales(loads: TrueLoads) -> tuple[float, float]:
    """Full scales of the two load cells: 1.2 times the largest load."""
    return 1.2 * float(np.nanmax(np.abs(loads.thrust))), 1.2 * float(np.nanmax(np.abs(loads.torque)))

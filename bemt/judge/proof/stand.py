"""x"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import Whitener, whitener
from bemt.judge.proof.truth_world import Conditions, TrueLoads, World


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


@dataclass(frozen=True)
class _Freedom:
    """One standard deviation of what nobody knows of a blade and a stand (DIAGNOSIS 2.2), share where nothing else."""

    pitch: float = 0.3  # [deg]
    drag: float = 0.10
    slope: float = 0.03  # Of the lift
    gain: float = 0.01
    zero: float = 0.003  # Of full scale
    rpm: float = 0.003
    density: float = 0.01
    drive: float = 0.10  # Constants of motor and controller: no case states them


FREEDOM = _Freedom()
_RELATIVE = {"voltage_V": 0.001, "current_A": 0.004, "pwm_us": 0.002}


@dataclass(frozen=True)
class Yardstick:
    """Whitening by noise alone, and by noise and nuisances."""

    channels: tuple[str, ...]  # Columns in the order of the stacked signature
    # Of the covariance: noise; noise and nuisances
    noise: Whitener
    whole: Whitener

    def stack(self, columns: Mapping[str, Array]) -> Array:
        """Signature as one vector, (M,)."""
        return np.asarray(np.nan_to_num(np.concatenate([columns[name] for name in self.channels])))

    def separation(self, signature: Array) -> tuple[float, float]:
        """Length of a signature over noise, and over noise and nuisances. [1]"""
        return float(np.linalg.norm(self.noise(signature))), float(np.linalg.norm(self.whole(signature)))

    def alike(self, own: Array, others: Mapping[str, Array], limit: float = 3.0) -> list[str]:
        """Causes whose signature this one cannot be told from: its part across theirs is shorter than ``limit``."""
        a = self.whole(own)
        found = []
        for name, signature in others.items():
            b = self.whole(signature)
            length = float(np.linalg.norm(b))
            if length > 1e-9:
                across = a - (a @ b) / length**2 * b
                if float(np.linalg.norm(across)) < limit:
                    found.append(name)
        return found


def freedom(world: World) -> dict[str, World]:
    """Worlds with one thing off by a standard deviation of what nobody knows."""
    section = world.section
    return {
        "pitch": replace(world, pitch_offset=world.pitch_offset + FREEDOM.pitch),
        "drag": replace(world, section=replace(section, drag_level=section.drag_level * (1.0 + FREEDOM.drag))),
        "slope": replace(world, section=replace(section, slope_level=section.slope_level * (1.0 + FREEDOM.slope))),
        "density": replace(world, density_error=world.density_error + FREEDOM.density),
    }


def yardstick(
    loads: TrueLoads, run: NDArray[np.int64], stand: StandErrors, tangents: Sequence[Mapping[str, Array]],
    electric: Mapping[str, Array],
) -> Yardstick:  # fmt: skip
    """Build the yardstick of a recording."""
    n = loads.thrust.size
    scales = full_scales(loads)
    channels = ("thrust_N", "torque_Nm", *electric)
    size = n * len(channels)
    cov = np.zeros((size, size))
    for k, (value, scale) in enumerate(zip((loads.thrust, loads.torque), scales, strict=True)):
        cov[k * n : (k + 1) * n, k * n : (k + 1) * n] = covariance(np.nan_to_num(value), run, scale, stand)
    for k, (name, value) in enumerate(electric.items(), start=2):
        cov[k * n : (k + 1) * n, k * n : (k + 1) * n] = np.diag((_RELATIVE[name] * value) ** 2 + 1e-12)
    noise = whitener(cov)
    wide = cov.copy()
    rows = [np.concatenate([np.nan_to_num(t[c]) if c in t else np.zeros(n) for c in channels]) for t in tangents]
    for k, (value, scale) in enumerate(zip((loads.thrust, loads.torque), scales, strict=True)):
        for vector in (FREEDOM.gain * np.nan_to_num(value), np.full(n, FREEDOM.zero * scale)):
            row = np.zeros(size)
            row[k * n : (k + 1) * n] = vector
            rows.append(row)
    for k, value in enumerate(electric.values(), start=2):
        row = np.zeros(size)
        row[k * n : (k + 1) * n] = FREEDOM.drive * value
        rows.append(row)
    for row in rows:
        wide += np.outer(row, row)
    return Yardstick(channels, noise, whitener(wide))

"""The drive against recordings: what was fitted, what was predicted, and how far it is off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import drive_identify as identify
import numpy as np
from numpy.typing import NDArray

from bemt.physics.dataset import Dataset
from bemt.tools.drive.drive_model import Battery, Drive, Esc, Motor, quadratic

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MapCheck:
    """Thrust over pulse width, model beside recording."""

    # recording; what of the model was fitted to it
    name: str
    how: str
    # (N,) pulse width [us]; thrust recorded and of the model [N]
    pulse_us: Array
    thrust_N: Array
    model_N: Array
    # error over full scale. [1]
    worst: float
    rms: float
    fitted: Mapping[str, float]  # constants fitted, in the unit of their names


def check_map(name: str, how: str, drive: Drive, points: Dataset, fitted: Mapping[str, float]) -> MapCheck:
    """Compare a drive with a thrust map."""
    thrust = points.thrust_N
    model = drive.steady(points.pulse_us).thrust_N
    error = np.abs(model - thrust) / float(np.nanmax(thrust))
    return MapCheck(name, how, points.pulse_us, thrust, model, float(np.nanmax(error)),
                    float(np.sqrt(np.nanmean(error**2))), dict(fitted))  # fmt: skip


def other_battery(drive: Drive, points: Dataset) -> Drive:
    """The drive on the battery of another recording."""
    voc, rb = identify.battery_of(points)
    return replace(drive, battery=Battery(1, rb, soc_table=(0.0, 1.0), ocv_V=(voc, voc)))


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a log."""

    log: str  # which log
    pulse_us: tuple[float, float]  # commands before and after. [us]
    # (N,) samples from before the step until it has settled: time [s], thrust [N]
    time_s: Array
    thrust_N: Array


@dataclass(frozen=True)
class StepCheck:
    """One step of a log, model beside recording."""

    log: str  # which log
    # commands. [us]
    from_us: float
    to_us: float
    # time of the step [s], levels [N]
    at_s: float
    before_N: float
    after_N: float
    # time constant recorded, its standard uncertainty, and of the model. [s]
    tau_s: float
    u_tau_s: float
    model_s: float
    sample_s: float  # between samples: what is faster than two of them is not resolved. [s]

    @property
    def resolved(self) -> bool:
        """Whether the recording holds the time constant: scatter below 30 % of it."""
        return self.u_tau_s < 0.3 * self.tau_s

    @property
    def ratio(self) -> float:
        """Model over recording. [1]"""
        return self.model_s / self.tau_s


def step_drive(
    voltage_V: float,
    full_thrust_N: float,
    drop: float,
    skew: float,
    inertia_kg_m2: float = 0.0,
    diameter_m: float = 0.127,
    tip_m_s: float = 170.0,
    brake_on_stop: float = 1.0,
) -> Drive:
    """Drive of logs that state neither motor nor propeller, by what their thrust over duty says of it."""
    omega = tip_m_s / (0.5 * diameter_m)
    kT = full_thrust_N / omega**2
    kQ = 0.1 * diameter_m * kT
    k = voltage_V * (1.0 - drop * (1.0 + skew**2)) / omega
    ohm = drop * voltage_V * k / (kQ * omega**2)
    motor = Motor(30.0 / (np.pi * k), ohm, 0.0, inertia_kg_m2, reactance_ohm_s=skew * ohm / omega)
    battery = Battery(1, 0.0, soc_table=(0.0, 1.0), ocv_V=(voltage_V, voltage_V))
    return Drive(battery, Esc(brake_on_stop=brake_on_stop), motor, quadratic(kT, kQ, diameter_m, solidity=0.1))


def check_steps(
    voltage_V: float, levels: tuple[Array, Array], steps: Sequence[Step], u_level: float = 0.02, u_tau: float = 0.1
) -> tuple[list[StepCheck], Drive]:
    """Fit drop, reactance, inertia and brake force to levels and steps of logs, and compare the time constants."""
    from scipy.optimize import least_squares
    from scipy.special import expit

    seen = [identify.first_order(s.time_s, s.thrust_N) for s in steps]
    held = [i for i, got in enumerate(seen) if got.u_tau_s < 0.3 * got.tau_s]
    pulse, thrust = levels

    def drive_of(x: Array) -> Drive:
        full, lost, skew, inertia = np.exp(x[:4])
        lost = 1.0 / (1.0 + 1.0 / lost)  # of the voltage, below 1
        return step_drive(voltage_V, float(full), float(lost / (1.0 + skew**2)), float(skew), float(inertia),
                          brake_on_stop=float(expit(x[4])))  # fmt: skip

    def constants(drive: Drive) -> Array:
        return np.array([identify.step_constant(drive, drive.motor.inertia_kg_m2, steps[i].time_s, seen[i].delay_s,
                                                *steps[i].pulse_us) for i in held])  # fmt: skip

    def misfit(x: Array) -> Array:
        drive = drive_of(x)
        omega = np.sqrt(np.maximum(thrust, 0.0) / drive.rotor.thrust(1.0))
        k, ohm = drive.motor.k(), drive.motor.resistance_ohm
        ohms = ohm + (drive.motor.reactance_ohm_s * omega) ** 2 / ohm
        duty = (k * omega + ohms * drive.rotor.torque(omega) / k) / voltage_V
        gaps = [
            np.log(m / seen[i].tau_s) / np.hypot(u_tau, seen[i].u_tau_s / seen[i].tau_s)
            for i, m in zip(held, constants(drive), strict=True)
        ]
        return np.concatenate([(duty - drive.esc.duty(pulse)) / u_level, gaps])

    start = np.append(np.log([1.05 * float(np.max(thrust)), 0.5, 1.0, 4e-6]), 1.0)
    found = least_squares(misfit, start, loss="soft_l1", diff_step=1e-2, xtol=1e-3, ftol=1e-3)
    drive = drive_of(found.x)
    model = np.full(len(steps), np.nan)
    model[held] = constants(drive)
    return [
        StepCheck(s.log, *s.pulse_us, got.delay_s, got.before, got.after, got.tau_s, got.u_tau_s, float(m),
                  float(np.median(np.diff(s.time_s)))) for s, got, m in zip(steps, seen, model, strict=True)
    ], drive  # fmt: skip

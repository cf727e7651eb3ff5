"""The drive against recordings: what was fitted, what was predicted, and how far it is off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.drive import identify, transient
from bemt.drive.drive_model import Battery, Drive, Esc, Motor
from bemt.drive.map_points import MapPoints
from bemt.drive.rotor_table import quadratic

__all__ = ["MapCheck", "StepCheck", "check_map", "check_steps", "other_battery", "step_drive"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MapCheck:
    """Thrust over pulse width, model beside recording.

    Attributes
    ----------
    name, how : str
        Recording; what of the model was fitted to it.
    pulse_us, thrust_N, model_N : (N,) float
        Pulse width [us]; thrust recorded and of the model [N].
    worst, rms : float
        Error over full scale. [1]
    fitted : mapping of str to float
        Constants fitted, in the unit of their names.
    """

    name: str
    how: str
    pulse_us: Array
    thrust_N: Array
    model_N: Array
    worst: float
    rms: float
    fitted: Mapping[str, float]


def check_map(name: str, how: str, drive: Drive, points: MapPoints, fitted: Mapping[str, float]) -> MapCheck:
    """Compare a drive with a thrust map.

    Parameters
    ----------
    name, how : str
        Words for the result.
    drive : Drive
        The drive.
    points : MapPoints
        The recording.
    fitted : mapping of str to float
        What was fitted, in the unit of its name.

    Returns
    -------
    MapCheck
        Full scale is the greatest thrust recorded.
    """
    thrust = points.values["thrust"]
    model = drive.steady(points.pulse_us).thrust_N
    error = np.abs(model - thrust) / float(np.nanmax(thrust))
    return MapCheck(name, how, points.pulse_us, thrust, model, float(np.nanmax(error)),
                    float(np.sqrt(np.nanmean(error**2))), dict(fitted))  # fmt: skip


def other_battery(drive: Drive, points: MapPoints) -> Drive:
    """The drive on the battery of another recording.

    Parameters
    ----------
    drive : Drive
        The drive.
    points : MapPoints
        The recording, with voltage and current.

    Returns
    -------
    Drive
        Same ESC, motor and rotor; voltage at rest and resistance from the recording.
    """
    voc, rb = identify.battery_of(points)
    return replace(drive, battery=Battery(1, rb, soc_table=(0.0, 1.0), ocv_V=(voc, voc)))


@dataclass(frozen=True)
class StepCheck:
    """One step of a log, model beside recording.

    Attributes
    ----------
    log, how : str
        Which log; fitted or predicted.
    at_s, before_N, after_N : float
        Time of the step [s], levels [N].
    tau_s, u_tau_s, model_s : float
        Time constant recorded, its standard uncertainty, and of the model. [s]
    sample_s : float
        Between samples: what is faster than two of them is not resolved. [s]
    """

    log: str
    how: str
    at_s: float
    before_N: float
    after_N: float
    tau_s: float
    u_tau_s: float
    model_s: float
    sample_s: float

    @property
    def resolved(self) -> bool:
        """Whether the recording holds the time constant: scatter below 30 % of it."""
        return self.u_tau_s < 0.3 * self.tau_s

    @property
    def ratio(self) -> float:
        """Model over recording. [1]"""
        return self.model_s / self.tau_s


def step_drive(
    voltage_V: float, full_thrust_N: float, diameter_m: float = 0.127, tip_m_s: float = 170.0, loaded: float = 0.8,
    drop: float = 0.15,
) -> Drive:  # fmt: skip
    """Drive of a log that states neither motor nor propeller: an ordinary one of that thrust, its inertia unknown.

    Parameters
    ----------
    voltage_V : float
        Of the battery. [V]
    full_thrust_N : float
        Greatest thrust of the log. [N]
    diameter_m, tip_m_s : float
        Assumed: diameter [m] and tip speed at full thrust [m/s].
    loaded, drop : float
        Assumed: speed at full thrust over that at no load, and the share of the voltage that the resistance takes. [1]

    Returns
    -------
    Drive
        With Q/(T D) = 0.1. The inertia that is fitted afterwards takes up most of what is assumed here.
    """
    omega = tip_m_s / (0.5 * diameter_m)
    kT = full_thrust_N / omega**2
    kQ = 0.1 * diameter_m * kT
    kv = omega * 30.0 / np.pi / (loaded * voltage_V)
    k = 30.0 / (np.pi * kv)
    motor = Motor(float(kv), drop * voltage_V / float(kQ * omega**2 / k), 0.5)
    return Drive(Battery(1, 0.02, soc_table=(0.0, 1.0), ocv_V=(voltage_V, voltage_V)), Esc(), motor,
                 quadratic(kT, kQ, diameter_m, solidity=0.1))  # fmt: skip


def check_steps(
    drive: Drive, logs: Mapping[str, list[tuple[Array, Array]]], fit_to: tuple[str, int]
) -> tuple[list[StepCheck], float]:
    """Fit the inertia to one step and predict all others.

    Parameters
    ----------
    drive : Drive
        The drive.
    logs : mapping of str to list of (time_s, thrust_N)
        Steps of each log, from `bemt.drive.identify.find_steps`.
    fit_to : (str, int)
        Log and number of the step that the inertia is fitted to.

    Returns
    -------
    list of StepCheck
        All steps.
    float
        The inertia. [kg m2]
    """

    def ends(y: Array) -> tuple[float, float]:
        k = max(3, len(y) // 8)
        low = 1e-3 * float(np.max(np.abs(y)))
        before, after = (drive.pulse_for(max(float(np.median(part)), low)) for part in (y[:k], y[-k:]))
        return before, after

    t, y = logs[fit_to[0]][fit_to[1]]
    inertia, _ = identify.fit_inertia(drive, t, y, *ends(y))
    out = []
    for name, steps in logs.items():
        for i, (t, y) in enumerate(steps):
            step = transient.first_order(t, y)
            if not step.u_tau_s < 0.3 * step.tau_s:
                out.append(StepCheck(name, "not resolved by the recording", step.delay_s, step.before, step.after,
                                     step.tau_s, step.u_tau_s, float("nan"), float(np.median(np.diff(t)))))  # fmt: skip
                continue
            before, after = ends(y)
            model = identify.step_constant(drive, inertia, t, step.delay_s, before, after)
            how = "inertia fitted to it" if (name, i) == fit_to else "predicted"
            out.append(StepCheck(name, how, step.delay_s, step.before, step.after, step.tau_s, step.u_tau_s, model,
                                 float(np.median(np.diff(t)))))  # fmt: skip
    return out, inertia

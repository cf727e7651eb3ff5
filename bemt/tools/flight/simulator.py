"""What a flight gives a simulator: constants in rad/s, each with a band, and the lag of the motors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.tools.flight.identify import Constant, Identified
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.repeat import BATCHES, flight_scatter, half_width

_RAD_S = np.pi / 30.0  # rad/s of one rev/min
_SLOWEST_S, _LEAST_SEEN = 0.5, 0.5  # longest lag tried [s]; share of the variance that it must explain


def simulator_constants(log: FlightLog, found: Identified) -> dict[str, Constant]:
    """Constants in the units of simulators, those that the flight shows.

    Thrust constant [N/(rad/s)^2], hover speed [rad/s], hover command, torque constant over yaw inertia
    [(rad/s^2)/(rad/s)^2], motor time constant [s]. The band of the thrust constant holds what flights of one vehicle
    differ by; the others are of this flight.
    """
    out: dict[str, Constant] = {}
    k = found.constants.get("thrust constant")
    if k is not None:
        sd, factor = flight_scatter([])
        scale = _RAD_S**-2
        half = float(np.hypot(k.half, factor * sd * k.value))
        out["thrust constant"] = Constant(scale * k.value, scale * half, k.unit.replace("rpm^2", "(rad/s)^2"))
    command = found.constants.get("thrust per command")
    if command is not None:
        sd, factor = flight_scatter([])
        out["thrust per command"] = replace(command, half=float(np.hypot(command.half, factor * sd * command.value)))
    if log.rpm is not None and "mean rpm" in found.rotors:
        speed = np.sqrt(np.mean(log.rpm[log.flying] ** 2, axis=1))
        blocks = np.array([b.mean() for b in np.array_split(speed, BATCHES)])
        out["hover speed"] = Constant(_RAD_S * float(speed.mean()), _RAD_S * half_width(blocks), "rad/s")
    if "hover command" in found.constants:
        out["hover command"] = found.constants["hover command"]
    yaw = found.constants.get("torque constant over yaw inertia")
    if yaw is not None:
        scale = _RAD_S**-2 if log.rpm is not None else 1.0
        unit = yaw.unit.replace("rpm^2", "(rad/s)^2")
        out["torque constant over yaw inertia"] = Constant(scale * yaw.value, scale * yaw.half, unit)
    lag = motor_lag(log)
    if lag is not None:
        out["motor time constant"] = lag
    return out


def motor_lag(log: FlightLog) -> Constant | None:
    """Time constant of a first-order lag from command (times voltage) to speed, all motors together [s].

    The lag whose response to the logged command fits the logged speed best (output error, Ljung, System Identification,
    2nd ed., section 4.2), apart from level, gain and trend of each motor. The 95 % half width is from ten blocks. None
    where the log does not show it: no speeds, sampled too slowly, hardly any motion, or another cause of most of the
    change of speed.
    """
    from scipy.optimize import minimize_scalar

    if log.rpm is None or log.command is None or not log.sound:
        return None
    on = np.flatnonzero(log.flying)
    if on.size < 50 * BATCHES:
        return None
    # From the first sample in flight to the last: a lag needs unbroken time.
    whole = slice(on[0], on[-1] + 1)
    t, rpm = log.t[whole], log.rpm[whole][:, log.sound]
    drive = log.command[whole] if log.voltage is None else log.command[whole] * log.voltage[whole, None]
    drive = drive[:, log.sound]
    step = float(np.median(np.diff(t)))
    if np.ptp(drive) == 0.0 or not step > 0.0:
        return None

    def left(tau: float, part: NDArray[np.intp]) -> float:
        return float(sum(_misfit(t, drive[:, i], rpm[:, i], tau, step, part) for i in range(rpm.shape[1])))

    def best(part: NDArray[np.intp]) -> float:
        edges = (np.log(0.2 * step), np.log(_SLOWEST_S))
        return float(np.exp(minimize_scalar(lambda x: left(float(np.exp(x)), part), bounds=edges, method="bounded",
                                            options={"xatol": 1e-3}).x))  # fmt: skip

    every = np.arange(t.size)
    tau = best(every)
    late = max(log.join_s.get("rpm", 0.0), log.join_s.get("command", 0.0), step)
    moved = sum(_misfit(t, None, rpm[:, i], tau, step, every) for i in range(rpm.shape[1]))
    if not late < tau < 0.9 * _SLOWEST_S or left(tau, every) > (1.0 - _LEAST_SEEN) * moved:
        return None
    half = half_width(np.array([best(p) for p in np.array_split(every, BATCHES)]))
    return Constant(tau, half, "s") if half < 0.5 * tau else None


def _misfit(t: Array, drive: Array | None, rpm: Array, tau: float, step: float, part: NDArray[np.intp]) -> float:
    """Sum of squares that the lagged drive leaves of the speed, with its own level, gain and trend."""
    from scipy.signal import lfilter

    columns = [np.ones(part.size), t[part] - t[part[0]]]
    if drive is not None:
        keep = float(np.exp(-step / tau))
        lagged, _ = lfilter([1.0 - keep], [1.0, -keep], drive, zi=[keep * drive[0]])
        columns.append(lagged[part])
    X = np.column_stack(columns)
    scale = np.maximum(np.abs(X).max(axis=0), 1e-12)
    fit = (X / scale) @ np.linalg.lstsq(X / scale, rpm[part], rcond=None)[0]
    return float(np.sum((rpm[part] - fit) ** 2))

"""The curve from command to thrust, as autopilots ask for it: MOT_THST_EXPO, MOT_THST_HOVER, THR_MDL_FAC.

Both autopilots take thrust = (1 - e) x + e x^2 of full, x the share of the command's range: ArduPilot as MOT_THST_EXPO
(AP_MotorsMulticopter::apply_thrust_curve_and_volt_scaling), PX4 as THR_MDL_FAC (parameter reference); by memory, not
checked. A flight near hover shows the slope s = d ln thrust / d ln x, so e = (s - 1) / (s - 1 + x (2 - s)). Thrust goes
with the squared speed of each rotor where speeds are logged, else with the specific force along the axis, in means of
a quarter of a second, in which the motors follow. Each rotor has a level of its own, and the battery sags along time.
The band is that of another flight: in eight flights each of a brushless and a brushed Crazyflie 2.1 e lies between 0.92
and 0.96 and between 0.33 and 0.93, so flights differ by 0.14 (pooled), which no tenth of one flight shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.flight.identify import Constant, Identified
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.repeat import BATCHES, block_means, flight_scatter, half_width, jackknifed, regressed

_BLOCK_S, _WIDE, _SCATTER = 0.25, 0.5, 0.14
"""Length of a mean [s]; half width of e, and of the hover throttle over it, from which it is not given; standard
deviation of e between flights [1]."""
_NAMES = {"ArduPilot DataFlash": ("MOT_THST_EXPO", "MOT_THST_HOVER"), "PX4 ULog": ("THR_MDL_FAC", "MPC_THR_HOVER")}


def thrust_curve(log: FlightLog) -> dict[str, Constant]:
    """Parameters of the thrust curve that an autopilot asks for, by its names where it has them.

    The hover throttle is that of the curve that the flight shows, else of the one that is set; left out where its band
    is half of it. Empty where the log has
    no commands as shares, or less than 6 s in the air.
    """
    from scipy import stats

    x, on = _share(log), log.flying
    if x is None or on.sum() < 200 or float(np.ptp(log.t[on])) < 6.0:
        return {}
    curve, hover = _NAMES.get(log.format, ("thrust curve, share of the square", "hover throttle"))
    out, t, x = {}, log.t[on], x[on]
    e = log.parameters.get("MOT_THST_EXPO", log.parameters.get("THR_MDL_FAC", 0.0))
    found = _slope(log, t, x)
    if found is not None:
        s, u = found
        at = float(x.mean())

        def share(slope: float) -> float:
            return (slope - 1.0) / (slope - 1.0 + at * (2.0 - slope))

        u_share = u * abs(share(s + 1e-3) - share(s - 1e-3)) / 2e-3
        half = float(stats.t.ppf(0.975, BATCHES - 1) * np.hypot(u_share, _SCATTER))
        if half < _WIDE and -0.5 < share(s) < 1.0 + half:
            e = share(s)
            out[curve] = Constant(e, half, "1")
    lift = ((1.0 - e) * x + e * x**2).mean(axis=1)
    if log.upright is not None:
        lift = lift * log.upright[on]
    blocks = [b.mean() for b in np.array_split(lift, BATCHES)]
    known = out.get(curve)
    turned = 0.0 if known is None else known.half * float(np.mean(x - x**2))
    half = float(np.hypot(half_width(blocks), turned))
    if half < _WIDE * lift.mean():
        out[hover] = Constant(float(lift.mean()), half, "1")
    return out


def _share(log: FlightLog) -> Array | None:
    """Commands as shares of the range that the curve acts on; None where they are not."""
    if log.command is None or log.command_unit != "1" or log.mixed:
        return None
    set_ = log.parameters
    if log.format == "ArduPilot DataFlash":
        low, high = set_.get("MOT_SPIN_MIN", 0.15), set_.get("MOT_SPIN_MAX", 0.95)
        return np.clip((log.command - low) / max(high - low, 0.1), 0.0, 1.0)
    e = set_.get("THR_MDL_FAC", 0.0)
    if set_.get("demanded") and 0.0 < e <= 1.0:  # actuator_motors is the thrust asked for, before the curve
        return (e - 1.0 + np.sqrt((1.0 - e) ** 2 + 4.0 * e * np.clip(log.command, 0.0, 1.0))) / (2.0 * e)
    return log.command


def _slope(log: FlightLog, t: Array, x: Array) -> tuple[float, float] | None:
    """Logarithmic slope of thrust over command, and its standard uncertainty."""
    on = log.flying
    if log.rpm is not None and log.sound and log.rpm.shape == log.command.shape:  # type: ignore[union-attr]
        lift, x = log.rpm[on][:, log.sound] ** 2, x[:, log.sound]
    elif log.acceleration is not None:
        lift, x = log.acceleration[on, 2:3] / G0, x.mean(axis=1, keepdims=True)
    else:
        return None
    volts = np.ones((t.size, 1)) if log.voltage is None else log.voltage[on][:, None]
    full, (y, z, u) = block_means(t, _BLOCK_S, lift, x, volts)
    if len(y) < 2 * BATCHES or not (np.all(y > 0.0) and np.all(z > 0.0)):
        return None
    late = np.log(np.maximum(u[:, 0], 0.1)) if np.ptp(volts) > 0.0 else full / (full[-1] + 1) - 0.5
    # A level for each rotor; rows in order of time, so that a tenth of them is a tenth of the flight.
    y, z = np.log(y), np.log(z)
    Y, Z = y - y.mean(axis=0), z - z.mean(axis=0)
    X = np.stack([Z.reshape(-1), np.repeat(late - late.mean(), Z.shape[1])], axis=1)
    if np.ptp(X[:, 1]) == 0.0:
        X = X[:, :1]
    found, sd = jackknifed(X, Y.reshape(-1))
    return float(found[0]), float(sd[0])


# How thrust moves with the air that meets the rotor: along its axis (climb, descent) and in its plane (advance).
#
# The specific force along the thrust axis over the sum of squared speeds is regressed, as a logarithm, on V_axial / n
# and (V_inplane / n)^2, n in turns a second: linear and even in the flow, as blade elements in oblique flow are to
# first order (:mod:`bemt.physics.bem.oblique`). The velocity is that over the ground: calm air. Lift and drag of the
# body along the axis count as the rotors' own. Bands are from ten pieces of the flight
# (:mod:`bemt.tools.flight.repeat`).
_BINS, _LEAST_M_S = 7, 0.5  # bins of the picture; least span of a velocity [m/s]


@dataclass(frozen=True, eq=False)
class Inflow:
    """Change of the thrust constant with the flow."""

    # Relative change of the thrust constant at the end of the range, at constant speed, and the half width of its 95 %
    # band; None where the flight hardly moves that way [1]
    axial: tuple[float, float] | None
    inplane: tuple[float, float] | None
    axial_m_s: tuple[float, float]  # Range along the axis, above zero in a climb [m/s]
    inplane_m_s: float  # Largest velocity in the plane of the rotors [m/s]
    turns: float  # Mean speed of the rotors [1/s]
    # Velocity [m/s], change of the thrust constant and its standard deviation [1]: along the axis, in the plane
    bins: tuple[Array, Array]


def inflow(log: FlightLog) -> Inflow | None:
    """Regress the thrust constant on the flow; None where a channel is missing or the flight is short."""
    on = log.flying
    if log.rpm is None or log.acceleration is None or log.velocity is None or log.axis is None or on.sum() < 200:
        return None
    v, axis = log.velocity[on], log.axis[on]
    along = np.sum(v * axis, axis=1)
    across = np.linalg.norm(v - along[:, None] * axis, axis=1)
    square = np.mean(log.rpm[on] ** 2, axis=1) / 3600.0
    lift = log.acceleration[on, 2]
    good = (lift > 1.0) & (square > 0.0)
    if good.sum() < 200:
        return None
    along, across, n = along[good], across[good], np.sqrt(square[good])
    y = np.log(lift[good] / n**2)
    X = np.column_stack([along / n, (across / n) ** 2, np.ones(n.size)])
    moves = np.array([np.ptp(along) > _LEAST_M_S, across.max() > _LEAST_M_S, True])
    X = X * moves
    size = np.maximum(np.abs(X).max(axis=0), 1e-12)
    X = X / size
    whole, half = regressed(X, y)
    rest = y - X @ whole
    return Inflow(
        (float(whole[0]), float(half[0])) if moves[0] else None,
        (float(whole[1]), float(half[1])) if moves[1] else None,
        (float(along.min()), float(along.max())),
        float(across.max()),
        float(n.mean()),
        (_binned(along, rest + X[:, 0] * whole[0]), _binned(across, rest + X[:, 1] * whole[1])),
    )


def _binned(x: Array, y: Array) -> Array:
    """Means of bins of equal width, with the standard deviation of a mean of as many independent pieces."""
    edges = np.linspace(x.min(), x.max() + 1e-9, _BINS + 1)
    which = np.digitize(x, edges) - 1
    out = [(x[which == k].mean(), y[which == k].mean(), y[which == k].std() / np.sqrt(BATCHES))
           for k in range(_BINS) if np.sum(which == k) > 10]  # fmt: skip
    return np.array(out).reshape(-1, 3).T


# What a flight gives a simulator: constants in rad/s, each with a band, and the lag of the motors.
_RAD_S = np.pi / 30.0  # rad/s of one rev/min
_SLOWEST_S, _LEAST_SEEN = 0.5, 0.5  # longest lag tried [s]; share of the variance that it must explain


def simulator_constants(log: FlightLog, found: Identified) -> dict[str, Constant]:
    """Constants in the units of simulators, those that the flight shows.

    Thrust constant [N/(rad/s)^2], the speed at which it carries the weight in still air [rad/s], mean command, torque
    constant over yaw inertia [(rad/s^2)/(rad/s)^2], motor time constant [s]. The band of the thrust constant holds what
    flights of one vehicle differ by; the others are of this flight.
    """
    out: dict[str, Constant] = {}
    sd, factor = flight_scatter([])
    for name, scale in (("thrust constant", _RAD_S**-2), ("thrust per command", 1.0)):
        if (k := found.constants.get(name)) is not None:
            half = float(np.hypot(k.half, factor * sd * k.value))
            out[name] = Constant(scale * k.value, scale * half, k.unit.replace("rpm^2", "(rad/s)^2"))
    if log.rpm is not None and (k := found.weight_per_drive) is not None:
        # The speed that carries the weight with this constant; in flight tilt, climbs and air across the disks move it.
        hover = _RAD_S * float(np.sqrt(G0 / (log.rotors * k.value)))
        out["hover speed"] = Constant(hover, 0.5 * hover * k.half / k.value, "rad/s")
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
    X /= np.maximum(np.abs(X).max(axis=0), 1e-12)
    found = np.linalg.lstsq(X.T @ X, X.T @ rpm[part], rcond=None)[0]  # the long matrix takes seconds
    return float(np.sum((rpm[part] - X @ found) ** 2))

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

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.flight.batches import BATCHES, half_width, jackknifed
from bemt.tools.flight.identify import Constant
from bemt.tools.flight.log import FlightLog

__all__ = ["thrust_curve"]

_BLOCK_S, _WIDE, _SCATTER = 0.25, 0.5, 0.14
"""Length of a mean [s]; half width of e from which it is not given; standard deviation of e between flights [1]."""
_NAMES = {"ArduPilot DataFlash": ("MOT_THST_EXPO", "MOT_THST_HOVER"), "PX4 ULog": ("THR_MDL_FAC", "MPC_THR_HOVER")}


def thrust_curve(log: FlightLog) -> dict[str, Constant]:
    """Parameters of the thrust curve that an autopilot asks for, by its names; of other logs by both.

    The hover throttle is that of the curve that the flight shows, else of the one that is set. Empty where the log has
    no commands as shares, or less than 6 s in the air.
    """
    from scipy import stats

    x, on = _share(log), log.flying
    if x is None or on.sum() < 200 or float(np.ptp(log.t[on])) < 6.0:
        return {}
    curve, hover = _NAMES.get(log.format, ("MOT_THST_EXPO or THR_MDL_FAC", "MOT_THST_HOVER or MPC_THR_HOVER"))
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
    out[hover] = Constant(float(lift.mean()), float(np.hypot(half_width(blocks), turned)), "1")
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
    number = np.floor((t - t[0]) / _BLOCK_S).astype(int)
    count = np.bincount(number)
    full = count >= 0.5 * np.median(count[count > 0])

    def means(v: Array) -> Array:
        return np.stack([np.bincount(number, weights=c)[full] / count[full] for c in v.T], axis=1)

    on = log.flying
    if log.rpm is not None and log.sound and log.rpm.shape == log.command.shape:  # type: ignore[union-attr]
        y, z = means(log.rpm[on][:, log.sound] ** 2), means(x[:, log.sound])
    elif log.acceleration is not None:
        y, z = means(log.acceleration[on, 2:3] / G0), means(x.mean(axis=1, keepdims=True))
    else:
        return None
    if len(y) < 2 * BATCHES or not (np.all(y > 0.0) and np.all(z > 0.0)):
        return None
    late = np.flatnonzero(full) / full.size - 0.5
    if log.voltage is not None and np.ptp(log.voltage[on]) > 0.0:
        late = np.log(np.maximum(means(log.voltage[on][:, None])[:, 0], 0.1))
        late = late - late.mean()
    # A level for each rotor; rows in order of time, so that a tenth of them is a tenth of the flight.
    y, z = np.log(y), np.log(z)
    Y, Z = y - y.mean(axis=0), z - z.mean(axis=0)
    X = np.stack([Z.reshape(-1), np.repeat(late - late.mean(), Z.shape[1])], axis=1)
    if np.ptp(X[:, 1]) == 0.0:
        X = X[:, :1]
    found, u = jackknifed(X, Y.reshape(-1))
    return float(found[0]), float(u[0])

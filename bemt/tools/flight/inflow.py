"""How thrust moves with the air that meets the rotor: along its axis (climb, descent) and in its plane (advance).

The specific force along the thrust axis over the sum of squared speeds is regressed, as a logarithm, on V_axial / n and
(V_inplane / n)^2, n in turns a second: linear and even in the flow, as blade elements in oblique flow are to first
order (:mod:`bemt.physics.bem.oblique`). The velocity is that over the ground: calm air. Lift and drag of the body along
the axis count as the rotors' own. Bands are from ten pieces of the flight (:mod:`bemt.tools.flight.identify`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault
from bemt.base.tables import number_text
from bemt.base.units import G0
from bemt.tools.flight.identify import BATCHES, jackknifed, u_of_mean
from bemt.tools.flight.log import FlightLog

# Whether a stated mass can hover on what the log shows: momentum theory against the power of the battery.
#
# A disk that carries T takes T sqrt(T/(2 rho A)) without any loss (Glauert, "Airplane Propellers", in Durand,
# "Aerodynamic Theory" IV, 1935). The disks are taken as large as the speed of the rotors allows, so that only an
# impossible mass is refused.

LEAST_KG, MOST_KG = 0.005, 1000.0
_TIP, _LARGEST = 170.0, 2.0  # fastest tip in hover, Mach 0.5 [m/s]; largest rotor where no speed is logged [m]
_MOST_A = 300.0  # battery current in hover where none is logged [A]
_RHO = 1.225  # logs hold no density [kg/m3]
_MARGIN = 2.0  # of a logged power: a current sensor that nobody calibrated


def mass_faults(log: FlightLog, mass_kg: float | None, name: str) -> list[Fault]:
    """Why a flight cannot have had a mass [kg] that is stated by `name`; nothing where the log does not tell."""
    if mass_kg is None:
        return []
    if not LEAST_KG <= mass_kg <= MOST_KG:
        hint = "In grams? Divide by 1000" if mass_kg > MOST_KG else ""
        return [Fault("", name, f"{mass_kg:g} kg", f"{LEAST_KG:g} to {MOST_KG:g} kg", hint)]
    amps = _current(log)
    volts = math.nan if log.voltage is None else _mean(log, log.voltage)
    most = volts * (_MARGIN * amps if amps > 0.0 else _MOST_A)
    if not most > 0.0 or not log.rotors:
        return []
    D = _LARGEST
    if log.rpm is not None:
        D = min(D, 60.0 * _TIP / (math.pi * _mean(log, log.rpm)))
    area = log.rotors * 0.25 * math.pi * D**2
    least = mass_kg * G0 * math.sqrt(mass_kg * G0 / (2.0 * _RHO * area))
    if not least > most:
        return []
    lifted = (2.0 * _RHO * area * most**2) ** (1.0 / 3.0) / G0
    source = f"{_MARGIN:g} times the {number_text(amps, 2)} A logged" if amps > 0.0 else f"{_MOST_A:g} A"
    got = f"{mass_kg:g} kg, which takes {number_text(least, 2)} W to hover on rotors of {D:.2g} m"
    expected = f"less than {number_text(lifted, 2)} kg, hovering on the battery's voltage and {source}"
    return [Fault(log.file, name, got, expected, "In grams? Divide by 1000")]


def _current(log: FlightLog) -> float:
    """Mean current of the battery in the air, else of all speed controllers; NaN where none is logged. [A]"""
    battery = math.nan if log.battery_current is None else _mean(log, log.battery_current)
    if battery > 0.0 or log.current is None:  # an autopilot without the sensor writes -1
        return battery
    return _mean(log, log.current.sum(axis=1))


def _mean(log: FlightLog, values: Array) -> float:
    """Mean in the air of the readings that are numbers; NaN without one."""
    found = values[log.flying]
    found = found[np.isfinite(found)]
    return float(found.mean()) if found.size else math.nan


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
    from scipy import stats

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
    whole, sd = jackknifed(X, y)
    half = float(stats.t.ppf(0.975, BATCHES - 1)) * sd
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


# Wind from the horizontal force that is not thrust: the rotors' own in-plane force and the drag of the body.
#
# It is what the tilt holds against: thrust carries the weight, so its horizontal part follows from the attitude alone.
# Where that is not logged it is the residual force that a controller estimated, which holds the error of its thrust
# curve times the tilt.
#
# Along the wind the force on the body is F = c w (1 + r |w|), w the wind less the body's velocity: the rotors' in-plane
# force (c, linear: rotor drag as in Faessler, Franchi and Scaramuzza, IEEE RA-L 3, 2018; not checked here) and the drag
# of the body, a share r |w| of it. Readings are the mean force, its slope over the body's own velocity, which is
# c (1 + 2 r |w|), and c, the slope of the calm flights. The unit of the force cancels.
#
# r is known beforehand, too: the mean forces of four flights of the quadrotor of Neural-Fly at known wind (4.2, 8.5,
# 8.5 with gusts, 12.1 m/s), over c of its calm flight, make r 0.128, 0.044, 0.060 and 0.078 s/m, mean of the
# logarithms 0.072; PX4's estimator of the wind has the same law, and its usual constants (EKF2_MCOEF 0.15 1/s,
# EKF2_BCOEF 100 kg/m2) make it 0.041. Taken: 0.066, within a factor of 1.6 (one standard deviation). So a hovering
# flight has a wind, too, if a wide one. With one r the law misses those mean forces by 10 to 20 %, so 10 % of force
# and slope count as its own error.
#
# Gusts that beat with the motion look like drag. Their phase is not known, so they are as large in the slope as they
# are a quarter of a period away from it: what the force shows there (over the Hilbert transform of the velocity)
# counts as an uncertainty of the slope.
#
# The zero of the force is the mean of the calm flights. Whether it stays, one calm flight cannot show: half of it is
# taken as its standard uncertainty (an assumption); of several, their scatter.

_SMOOTH_S = 0.2
_SHARE, _FACTOR = 0.066, 0.45  # r [s/m] and the standard deviation of its logarithm
_LAW = 0.10  # standard deviation of the law, a share of force and slope [1]
_GRID, _LOG_C = (401, 31, 41), 1.1  # points over wind, r and c; half the range of log c


@dataclass(frozen=True)
class Wind:
    """Wind along the mean force: speed, 95 % half width [m/s], heading from x [deg]; why it is missing."""

    speed: float
    half: float
    heading_deg: float
    missing: str = ""


def wind(log: FlightLog, calm: Sequence[FlightLog]) -> Wind:
    """Estimate the mean wind from velocity and a residual force or the attitude, against flights without wind.

    Median and interval of the posterior [m/s]; NaN with the reason where the log does not show it.
    """
    by_force = any(one.axis is None for one in (log, *calm))
    mine = _horizontal(log, by_force)
    still = [found for one in calm if (found := _horizontal(one, by_force)) is not None]
    if mine is None:
        return Wind(np.nan, np.nan, np.nan, "no velocity, or neither attitude nor residual force")
    if not still:
        return Wind(np.nan, np.nan, np.nan, "give a calm flight of the same vehicle with --healthy; move to and fro")
    force, velocity = mine
    mean = force.mean(axis=0) - np.mean([f.mean(axis=0) for f, _ in still], axis=0)
    size = float(np.hypot(*mean))
    axis = mean / size if size > 0.0 else np.array([1.0, 0.0])
    heading = float(np.degrees(np.arctan2(axis[1], axis[0])))
    own = [_slope(f @ axis, v @ axis) for f, v in still]
    weight = np.array([u**-2.0 for _, u in own])
    total = max(float(weight.sum()), 1e-300)
    c, u_c = float(weight @ [s for s, _ in own]) / total, total**-0.5
    if not c > 2.0 * u_c:
        why = "the force does not depend on the velocity in the calm flights: fly one to and fro along the wind"
        return Wind(np.nan, np.nan, heading, why)
    zeros = np.array([f.mean(axis=0) @ axis for f, _ in still])
    u_zero = 0.5 * abs(float(zeros[0])) if zeros.size == 1 else float(zeros.std(ddof=1) / np.sqrt(zeros.size))
    u_still = float(np.mean([u_of_mean(f @ axis) for f, _ in still]))
    u_size = float(np.sqrt(u_of_mean(force @ axis) ** 2 + u_still**2 + u_zero**2))
    return Wind(*_posterior((size, u_size), _slope(force @ axis, velocity @ axis), (c, u_c)), heading)


def _posterior(
    force: tuple[float, float], slope: tuple[float, float], calm: tuple[float, float]
) -> tuple[float, float]:
    """Median of the wind and half width of its 95 % interval, from readings with their standard uncertainties."""
    from scipy import stats

    wider = float(stats.t.ppf(0.975, BATCHES - 1) / stats.norm.ppf(0.975))
    top = (force[0] + 4.0 * wider * force[1]) / (calm[0] * np.exp(-0.5 * _LOG_C))
    w, x, log_c = np.meshgrid(np.linspace(-top, top, _GRID[0]), np.linspace(-3.0, 3.0, _GRID[1]),
                              np.linspace(-_LOG_C, _LOG_C, _GRID[2]), indexing="ij", sparse=True)  # fmt: skip
    drag = _SHARE * np.exp(_FACTOR * x) * np.abs(w)
    c = calm[0] * np.exp(log_c)
    force, slope = ((y, float(np.hypot(u, _LAW * abs(y)))) for y, u in (force, slope))
    told = ((force, c * w * (1.0 + drag)), (slope, c * (1.0 + 2.0 * drag)), (calm, c))
    misfit = x**2 + sum(((y - f) / (wider * u)) ** 2 for (y, u), f in told)
    density = np.exp(-0.5 * (misfit - misfit.min())).sum(axis=(1, 2))
    share = np.cumsum(density) / density.sum()
    low, middle, high = np.interp([0.025, 0.5, 0.975], share, w[:, 0, 0])
    return float(max(middle, 0.0)), float(0.5 * (high - low))


def _horizontal(log: FlightLog, by_force: bool) -> tuple[Array, Array] | None:
    """Horizontal force that is not thrust along the body's axis, and velocity, in flight: (N, 2) each.

    By the tilt it is dv/dt - (g + dv_z/dt) axis / axis_z per unit mass [m/s2].
    """
    from scipy.ndimage import uniform_filter1d

    on = log.flying if log.rotors else np.ones(log.t.size, dtype=bool)
    if log.velocity is None or on.sum() < 10 * BATCHES:
        return None
    if by_force:
        return None if log.force is None else (log.force[on, :2], log.velocity[on, :2])
    if log.axis is None or np.any(log.axis[on, 2] < 0.2):
        return None
    width = max(int(_SMOOTH_S / float(np.median(np.diff(log.t)))), 1)
    gain = np.gradient(uniform_filter1d(log.velocity, width, axis=0, mode="nearest"), log.t, axis=0)
    tilt = log.axis[:, :2] / np.maximum(log.axis[:, [2]], 0.2)
    force = gain[:, :2] - (G0 + gain[:, [2]]) * tilt
    return force[on], log.velocity[on, :2]


def _slope(force: Array, velocity: Array) -> tuple[float, float]:
    """Less the slope of the force over the velocity, and its standard uncertainty; infinite for a hovering flight."""
    from scipy.signal import hilbert

    v = velocity - velocity.mean()
    if not np.any(v):
        return 0.0, float("inf")
    beside = np.imag(hilbert(v))
    found, u = jackknifed(np.column_stack([v, beside, np.ones(v.size)]), force)
    return -float(found[0]), float(max(np.hypot(u[0], found[1]), 1e-9))

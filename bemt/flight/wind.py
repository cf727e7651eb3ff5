"""Wind from the horizontal force that is not thrust: the rotors' own in-plane force and the drag of the body.

It is what the tilt holds against: thrust carries the weight, so its horizontal part follows from the attitude alone.
Where that is not logged it is the residual force that a controller estimated, which holds the error of its thrust curve
times the tilt.

Along the wind the force on the body is F = c w + b w |w|, w the wind less the body's velocity: the rotors' in-plane
force (c, linear: rotor drag as in Faessler, Franchi and Scaramuzza, IEEE RA-L 3, 2018; not checked here) and the drag
of the body (b). The slope over the body's own velocity is -(c + 2 b |w|), so the mean force and the slopes with and
without wind give it: w = 2 F / (c + slope). The unit of the force cancels.

The zero of the force is the mean of the calm flights. Whether it stays, one calm flight cannot show: half of it is
taken as its standard uncertainty (an assumption); of several, their scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base.units import G0
from bemt.flight.log import FlightLog

__all__ = ["Wind", "wind"]

Array = NDArray[np.float64]
_BLOCKS, _SMOOTH_S = 10, 0.2


@dataclass(frozen=True)
class Wind:
    """Wind along the mean force: speed, 95 % half width [m/s], heading from x [deg]; why it is missing."""

    speed: float
    half: float
    heading_deg: float
    missing: str = ""


def wind(log: FlightLog, calm: Sequence[FlightLog]) -> Wind:
    """Estimate the mean wind.

    Parameters
    ----------
    log : FlightLog
        With velocity, and a residual force or the attitude.
    calm : sequence of FlightLog
        Flights of the same vehicle without wind.

    Returns
    -------
    Wind
        NaN with the reason where the log does not show it [m/s].
    """
    from scipy import stats

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
    slope, u_slope = _slope(force @ axis, velocity @ axis)
    own = [_slope(f @ axis, v @ axis) for f, v in still]
    c = float(np.mean([s for s, _ in own]))
    u_c = float(np.sqrt(np.mean([u**2 for _, u in own]) / len(own)))
    heading = float(np.degrees(np.arctan2(axis[1], axis[0])))
    total = c + slope
    if not total > 2.0 * np.hypot(u_slope, u_c):
        return Wind(np.nan, np.nan, heading, "the force does not depend on the velocity: fly to and fro along the wind")
    u_force = _u_of_mean(force @ axis)
    u_still = float(np.mean([_u_of_mean(f @ axis) for f, _ in still]))
    zeros = np.array([f.mean(axis=0) @ axis for f, _ in still])
    u_zero = 0.5 * abs(float(zeros[0])) if zeros.size == 1 else float(zeros.std(ddof=1) / np.sqrt(zeros.size))
    speed = 2.0 * size / total
    u_size = np.sqrt(u_force**2 + u_still**2 + u_zero**2)
    relative = np.hypot(u_size / max(size, 1e-9), np.hypot(u_slope, u_c) / total)
    return Wind(speed, float(stats.t.ppf(0.975, _BLOCKS - 1)) * speed * float(relative), heading)


def _horizontal(log: FlightLog, by_force: bool) -> tuple[Array, Array] | None:
    """Horizontal force that is not thrust along the body's axis, and velocity, in flight: (N, 2) each.

    By the tilt it is dv/dt - (g + dv_z/dt) axis / axis_z per unit mass [m/s2].
    """
    on = log.flying if log.rotors else np.ones(log.t.size, dtype=bool)
    if log.velocity is None or on.sum() < 10 * _BLOCKS:
        return None
    if by_force:
        return None if log.force is None else (log.force[on, :2], log.velocity[on, :2])
    if log.axis is None or np.any(log.axis[on, 2] < 0.2):
        return None
    width = max(int(_SMOOTH_S / float(np.median(np.diff(log.t)))), 1)
    smooth = np.stack([np.convolve(v, np.ones(width) / width, "same") for v in log.velocity.T], axis=1)
    gain = np.gradient(smooth, log.t, axis=0)
    tilt = log.axis[:, :2] / np.maximum(log.axis[:, [2]], 0.2)
    force = gain[:, :2] - (G0 + gain[:, [2]]) * tilt
    return force[on], log.velocity[on, :2]


def _u_of_mean(force: Array) -> float:
    """Standard deviation of the mean, from blocks."""
    return float(np.std([b.mean() for b in np.array_split(force, _BLOCKS)], ddof=1)) / float(np.sqrt(_BLOCKS))


def _slope(force: Array, velocity: Array) -> tuple[float, float]:
    """Less the slope of the force over the velocity, and its standard deviation from blocks."""

    def one(p: NDArray[np.intp]) -> float:
        v = velocity[p] - velocity[p].mean()
        return -float(v @ force[p] / max(float(v @ v), 1e-12))

    parts = [one(p) for p in np.array_split(np.arange(force.size), _BLOCKS)]
    return one(np.arange(force.size)), float(np.std(parts, ddof=1)) / np.sqrt(_BLOCKS)

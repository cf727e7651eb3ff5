"""Wind from the horizontal force that is not thrust: the rotors' own in-plane force and the drag of the body.

It is what the tilt holds against: thrust carries the weight, so its horizontal part follows from the attitude alone.
Where that is not logged it is the residual force that a controller estimated, which holds the error of its thrust curve
times the tilt.

Along the wind the force on the body is F = c w (1 + r |w|), w the wind less the body's velocity: the rotors' in-plane
force (c, linear: rotor drag as in Faessler, Franchi and Scaramuzza, IEEE RA-L 3, 2018; not checked here) and the drag
of the body, a share r |w| of it. Readings are the mean force, its slope over the body's own velocity, which is
c (1 + 2 r |w|), and c, the slope of the calm flights. The unit of the force cancels.

r is known beforehand, too: the mean forces of four flights of the quadrotor of Neural-Fly at known wind (4.2, 8.5, 8.5
with gusts, 12.1 m/s), over c of its calm flight, make r 0.128, 0.044, 0.060 and 0.078 s/m, mean of the logarithms
0.072; PX4's estimator of the wind has the same law, and its usual constants (EKF2_MCOEF 0.15 1/s, EKF2_BCOEF 100 kg/m2)
make it 0.041. Taken: 0.066, within a factor of 1.35 (one standard deviation). So a hovering flight has a wind, too, if
a wide one. 5 % of force and slope count as the law's own error: both were chosen by the log score of twelve thirds of
those flights, r from the other three (-0.39; with 1.57 and 10 %, which count one spread twice, -0.51).

Gusts that beat with the motion look like drag. Their phase is not known, so they are as large in the slope as they are
a quarter of a period away from it: what the force shows there (over the Hilbert transform of the velocity) counts as
an uncertainty of the slope.

The zero of the force is the mean of the calm flights. Whether it stays, one calm flight cannot show: half of it is
taken as its standard uncertainty (an assumption); of several, their scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.repeat import BATCHES, jackknifed, u_of_mean

BREEZE = 2.0
"""Wind, or speed over ground beyond that of healthy flights, that may move the trim [m/s]."""
_SMOOTH_S = 0.2
_SHARE, _FACTOR = 0.066, 0.3  # r [s/m] and the standard deviation of its logarithm
_LAW = 0.05  # standard deviation of the law, a share of force and slope [1]
_GRID, _LOG_C = (401, 31, 41), 1.1  # points over wind, r and c; half the range of log c


@dataclass(frozen=True)
class Wind:
    """Wind along the mean force: speed, 95 % half width [m/s], heading from x [deg]; why it is missing."""

    speed: float = float("nan")
    half: float = float("nan")
    heading_deg: float = float("nan")
    missing: str = ""

    @property
    def sure(self) -> bool:
        """Whether it is there: three standard deviations from none, of a half width of 1.96."""
        return self.speed > 3.0 / 1.96 * self.half


def wind(log: FlightLog, calm: Sequence[FlightLog]) -> Wind:
    """Estimate the mean wind from velocity and a residual force or the attitude, against flights without wind.

    Median and interval of the posterior [m/s]; NaN with the reason where the log does not show it.
    """
    by_force = any(one.axis is None for one in (log, *calm))
    mine = _horizontal(log, by_force)
    still = [found for one in calm if (found := _horizontal(one, by_force)) is not None]
    if mine is None:
        return Wind(missing="no velocity, or neither attitude nor residual force")
    if not still:
        return Wind(missing="give a calm flight of the same vehicle with --healthy; move to and fro")
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
        return Wind(heading_deg=heading, missing=why)
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

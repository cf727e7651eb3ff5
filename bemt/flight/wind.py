"""Wind from the residual force and the rotors' own in-plane force.

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

from bemt.flight.log import FlightLog

__all__ = ["Wind", "wind"]

Array = NDArray[np.float64]
_BLOCKS = 10


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
        With residual force and velocity.
    calm : sequence of FlightLog
        Flights of the same vehicle without wind.

    Returns
    -------
    Wind
        NaN with the reason where the log does not show it [m/s].
    """
    from scipy import stats

    still = [c for c in calm if c.force is not None and c.velocity is not None]
    if log.force is None or log.velocity is None:
        return Wind(np.nan, np.nan, np.nan, "no residual force in the log")
    if not still:
        return Wind(np.nan, np.nan, np.nan, "give a calm flight of the same vehicle with --healthy; move to and fro")
    F0 = np.mean([c.force.mean(axis=0) for c in still if c.force is not None], axis=0)
    mean = (log.force.mean(axis=0) - F0)[:2]
    size = float(np.hypot(*mean))
    axis = mean / size if size > 0.0 else np.array([1.0, 0.0])
    slope, u_slope = _slope(log.force[:, :2] @ axis, log.velocity[:, :2] @ axis)
    own = [
        _slope(c.force[:, :2] @ axis, c.velocity[:, :2] @ axis)
        for c in still  # fmt: skip
        if c.force is not None and c.velocity is not None
    ]
    c = float(np.mean([s for s, _ in own]))
    u_c = float(np.sqrt(np.mean([u**2 for _, u in own]) / len(own)))
    heading = float(np.degrees(np.arctan2(axis[1], axis[0])))
    total = c + slope
    if not total > 2.0 * np.hypot(u_slope, u_c):
        return Wind(np.nan, np.nan, heading, "the force does not depend on the velocity: fly to and fro along the wind")
    blocks = np.array([b.mean(axis=0) for b in np.array_split(log.force[:, :2] @ axis, _BLOCKS)])
    u_force = float(blocks.std(ddof=1)) / np.sqrt(_BLOCKS)
    u_still = float(np.mean([np.std([b.mean() for b in np.array_split(k.force[:, :2] @ axis, _BLOCKS)])
                             for k in still if k.force is not None])) / np.sqrt(_BLOCKS)  # fmt: skip
    zeros = np.array([k.force[:, :2].mean(axis=0) @ axis for k in still if k.force is not None])
    u_zero = 0.5 * abs(float(zeros[0])) if zeros.size == 1 else float(zeros.std(ddof=1) / np.sqrt(zeros.size))
    speed = 2.0 * size / total
    u_size = np.sqrt(u_force**2 + u_still**2 + u_zero**2)
    relative = np.hypot(u_size / max(size, 1e-9), np.hypot(u_slope, u_c) / total)
    return Wind(speed, float(stats.t.ppf(0.975, _BLOCKS - 1)) * speed * float(relative), heading)


def _slope(force: Array, velocity: Array) -> tuple[float, float]:
    """Less the slope of the force over the velocity, and its standard deviation from blocks."""

    def one(p: NDArray[np.intp]) -> float:
        v = velocity[p] - velocity[p].mean()
        return -float(v @ force[p] / max(float(v @ v), 1e-12))

    parts = [one(p) for p in np.array_split(np.arange(force.size), _BLOCKS)]
    return one(np.arange(force.size)), float(np.std(parts, ddof=1)) / np.sqrt(_BLOCKS)

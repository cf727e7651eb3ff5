"""How thrust moves with the air that meets the rotor: along its axis (climb, descent) and in its plane (advance).

The specific force along the thrust axis over the sum of squared speeds is regressed, as a logarithm, on V_axial / n and
(V_inplane / n)^2, n in turns a second: linear and even in the flow, as blade elements in oblique flow are to first
order (:mod:`bemt.physics.bem.oblique`). The velocity is that over the ground: calm air. Lift and drag of the body along
the axis count as the rotors' own. Bands are from ten pieces of the flight (:mod:`bemt.tools.flight.batches`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.flight.batches import BATCHES, jackknifed
from bemt.tools.flight.log import FlightLog

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

r"""Thrusters on a body: which thrust each must give for a force and a roll moment, and what is beyond them.

Axes: x forward, y to the left, z up, origin in the centre of mass. A thruster at (y, z), canted by gamma from the
vertical to the left, gives

    F_z = T cos(gamma),   M_x = T (y cos(gamma) - z sin(gamma)),   T_min <= T <= T_max.

Within the limits the thrusts of least sum of squares are taken. Beyond them, what has priority is met first, as nearly
as the limits allow, and then the other one.

References
----------
T. A. Johansen, T. I. Fossen, "Control allocation - a survey", Automatica 49 (2013) 1087-1103,
doi:10.1016/j.automatica.2013.01.035 (constrained allocation with priorities; not checked against the paper).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError


@dataclass(frozen=True)
class Thruster:
    """One thruster."""

    y_m: float  # Position, to the left and up [m]
    # Limits [N]
    thrust_max_N: float
    thrust_min_N: float = 0.0
    z_m: float = 0.0  # Position, to the left and up [m]
    cant_rad: float = 0.0  # Tilt of the thrust from the vertical to the left [rad]
    name: str = ""  # Of the thruster


@dataclass(frozen=True)
class Allocation:
    """Thrusts for a command."""

    thrust_N: Array  # (N,) of each thruster. [N]
    # what they give together. [N], [N m]
    force_N: float
    moment_Nm: float
    # the command. [N], [N m]
    wanted_force_N: float
    wanted_moment_Nm: float
    saturated: NDArray[np.bool_]  # (N,) at a limit
    met: bool  # whether the command is met within 1e-6 of the greatest force and moment


def effectiveness(thrusters: Sequence[Thruster]) -> Array:
    """Force and moment per thrust."""
    c = np.cos([t.cant_rad for t in thrusters])
    s = np.sin([t.cant_rad for t in thrusters])
    y, z = np.array([t.y_m for t in thrusters]), np.array([t.z_m for t in thrusters])
    return np.vstack([c, y * c - z * s])


def allocate(thrusters: Sequence[Thruster], force_N: float, moment_Nm: float, priority: str = "moment") -> Allocation:
    """Share a command among thrusters.

    >>> pair = [Thruster(0.2, 27.0), Thruster(-0.2, 27.0)]
    >>> got = allocate(pair, 27.0, 5.4)
    >>> got.thrust_N.round(6), got.met
    (array([27.,  0.]), True)
    """
    from scipy.optimize import linprog, lsq_linear

    faults = [] if thrusters else [Fault("", "thrusters", "none", "one or more")]
    faults += [
        Fault("", t.name or f"thruster {i + 1}", f"{t.thrust_min_N:g} to {t.thrust_max_N:g} N", "min below max")
        for i, t in enumerate(thrusters)
        if not t.thrust_min_N < t.thrust_max_N
    ]
    wishes = {"force_N": force_N, "moment_Nm": moment_Nm}
    faults += [Fault("", name, f"{v}", "a finite number") for name, v in wishes.items() if not math.isfinite(v)]
    if priority not in ("moment", "force"):
        faults.append(Fault("", "priority", repr(priority), "moment or force"))
    if faults:
        raise InputError(faults)
    b = effectiveness(thrusters)
    low, high = np.array([t.thrust_min_N for t in thrusters]), np.array([t.thrust_max_N for t in thrusters])
    most = np.maximum(np.abs(low), np.abs(high))
    low = np.where(np.abs(low) < 1e-12 * most, 0.0, low)
    limit = np.abs(b) @ most  # greatest force and moment
    none = limit < 1e-9 * most.sum()  # arms that are rounding: the solver must not see them
    b[none], limit[none] = 0.0, 1e-2 * most.sum()
    b, wanted = b / limit[:, None], np.array([force_N, moment_Nm]) / limit
    bounds = list(zip(low, high, strict=True))

    def nearest(row: int, fixed: list[tuple[int, float]]) -> float:
        """Attainable value of one row that is nearest to the wanted one."""
        a_eq, b_eq = np.array([b[i] for i, _ in fixed]), np.array([v for _, v in fixed])
        ends = []
        for sign in (1.0, -1.0):
            extra = {"A_eq": a_eq, "b_eq": b_eq} if fixed else {}
            end = linprog(sign * b[row], bounds=bounds, **extra)
            if not end.success:  # the row before lies on the edge of what is attainable: its own rounding
                extra = {"A_ub": np.vstack([a_eq, -a_eq]), "b_ub": np.concatenate([b_eq, -b_eq]) + 1e-7}
                end = linprog(sign * b[row], bounds=bounds, **extra)
            ends.append(float(b[row] @ end.x))
        return float(np.clip(wanted[row], min(ends), max(ends)))

    first, second = (1, 0) if priority == "moment" else (0, 1)
    given = {first: nearest(first, [])}
    given[second] = nearest(second, [(first, given[first])])
    goal = np.array([given[0], given[1]])
    size = float(np.max(high - low))
    matrix = np.vstack([1e5 * b, np.eye(len(low)) / size])
    found = lsq_linear(matrix, np.concatenate([1e5 * goal, np.zeros(len(low))]), bounds=(low, high), method="bvls")
    thrust = np.clip(found.x, low, high)
    force, moment = effectiveness(thrusters) @ thrust
    near = 1e-6 * (high - low)
    met = bool(np.all(np.abs(b @ thrust - wanted) <= 1e-6))
    return Allocation(thrust, float(force), float(moment), force_N, moment_Nm,
                      (thrust <= low + near) & (low != 0.0) | (thrust >= high - near), met)  # fmt: skip


def attainable(thrusters: Sequence[Thruster]) -> Array:
    """Corner points of what force and moment can be together, (M, 2)."""
    b = effectiveness(thrusters)
    at = b @ np.array([t.thrust_min_N for t in thrusters])
    # a zonogon: its edges are the thrusters' vectors, sorted by angle, once forward and once back
    edges = (b * np.array([t.thrust_max_N - t.thrust_min_N for t in thrusters])).T
    down = (edges[:, 1] < 0.0) | ((edges[:, 1] == 0.0) & (edges[:, 0] < 0.0))
    start = at + edges[down].sum(axis=0)
    up = np.where(down[:, None], -edges, edges)
    up = up[np.argsort(np.arctan2(up[:, 1], up[:, 0]), kind="stable")]
    return np.vstack([start, start + np.cumsum(np.vstack([up, -up]), axis=0)])


def moment_at(distance_m: ArrayLike, thrust_N: float, total_force_N: float | None = None) -> Array:
    """Roll moment of a pair of thrusters over the distance at which they are mounted, (N,) [N m].

    >>> round(float(moment_at(0.2, 27.0)), 6), round(float(moment_at(0.2, 27.0, 40.0)), 6)
    (5.4, 2.8)
    """
    difference = thrust_N if total_force_N is None else min(total_force_N, 2.0 * thrust_N - total_force_N)
    return np.asarray(distance_m, dtype=float) * (difference if difference >= 0.0 else math.nan)

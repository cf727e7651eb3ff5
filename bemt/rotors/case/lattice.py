"""Many points of a case with bands: solved one by one, their uncertainties interpolated from a fixed lattice.

A band takes some thirty solutions of the rotor; in coefficients it is a smooth function of the inflow angle and of the
speed. The lattice does not depend on the points, so that neither does a point's band on its neighbours.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, RangeWarning, gathered, refuse
from bemt.base.given import numbers
from bemt.base.tables import number_of
from bemt.rotors.case.load import Case
from bemt.rotors.case.propagate import propagate

if TYPE_CHECKING:
    from bemt.physics.dataset import Dataset


# Operating points that a caller asks of a case, checked.

STOPPED, UNKNOWN = "stands still: no load is computed", "speed unknown: no load is computed"
"""Flags of points that do not turn."""
FAST = 150.0
"""Airspeed from which on a unit is asked about: declared [m/s]."""
RPM_MAX, AIRSPEED_MAX = 300000.0, 300.0  # as in a case file [rev/min], [m/s]


def conditions(
    case: Case, rpm: Any, airspeed_m_s: Any, J: Any, stopped: bool = False
) -> tuple[Array, Array]:  # fmt: skip
    """Speeds [rev/min] and airspeeds [m/s] of the points that a caller means, by default those of the case.

    With `stopped` a point may stand still, and among others have no speed, NaN: :func:`solve` computes no loads there.
    """
    faults = []
    if J is not None and airspeed_m_s is not None:
        faults.append(Fault("", "J, airspeed_m_s", "both", "one of them"))
    given = {"rpm": rpm, "airspeed_m_s": airspeed_m_s, "J": J}
    found: dict[str, Array] = {}
    for name, value in given.items():
        if value is None:
            continue
        with gathered(faults):
            found[name] = numbers(name, value, finite=not (stopped and name == "rpm"))
    n = found.get("rpm", np.asarray(case.rpm, dtype=float))
    if np.all(np.isnan(n)):
        faults.append(Fault("", "rpm", "a number that is not finite", "finite numbers"))
    elif np.any((n < 0.0) if stopped else (n <= 0.0)):
        least = float(np.nanmin(n))
        expected = f"speeds {'of 0 rev/min or more' if stopped else 'above 0 rev/min'}"
        faults.append(Fault("", "rpm", f"{least:g}", expected, "Drop the sign?" if least < 0.0 else ""))
    elif np.any(n > RPM_MAX):
        faults.append(Fault("", "rpm", f"{np.nanmax(n):g}", f"up to {RPM_MAX:g} rev/min"))
    shapes = {name: value.shape for name, value in found.items()}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        got = ", ".join(f"{value.size} of {name}" for name, value in found.items())
        faults.append(Fault("", ", ".join(shapes), got, "as many of each, or one", "curve() takes every pair"))
        raise InputError(faults) from None
    V = found.get("airspeed_m_s", np.asarray(case.airspeed_m_s, dtype=float))
    if "J" in found:
        V = found["J"] * n / 60.0 * case.diameter_m
    if (fast := np.max(np.abs(np.nan_to_num(V)))) > AIRSPEED_MAX:
        name, hint = ("J", "V = J n D") if "J" in found else ("airspeed_m_s", "km/h? Divide by 3.6")
        faults.append(Fault("", name, f"{fast:g} m/s", f"up to {AIRSPEED_MAX:g} m/s", hint))
    elif "airspeed_m_s" in found and fast > FAST:
        told = f"airspeed_m_s: {fast:g} m/s is faster than propellers fly. In km/h? Divide by 3.6"
        warnings.warn(told, RangeWarning, stacklevel=5)
    refuse(faults)
    n, V = np.broadcast_arrays(n, V)
    return np.atleast_1d(n).astype(float).ravel(), np.atleast_1d(V).astype(float).ravel()


def turned(case: Case, n: Array, V: Array, angle_deg: Any) -> tuple[Array, Array, Array]:
    """Points with their angle between wind and shaft [deg]."""
    given = case.angle_deg if angle_deg is None else angle_deg
    angle = np.atleast_1d(numbers("angle_deg", given)).astype(float)
    if np.any((angle < 0.0) | (angle > 180.0)):
        odd = float(angle[(angle < 0.0) | (angle > 180.0)][0])
        raise InputError(Fault("", "angle_deg", f"{odd:g}", "0 (climb) to 180 deg (descent)"))
    if case.ducted and np.any(angle):
        raise InputError(Fault("", "angle_deg", f"{angle.max():g} deg on a ducted rotor", "0 deg"))
    try:
        n, V, angle = np.broadcast_arrays(n, V, angle.ravel())
    except ValueError:
        got = f"{angle.size} of angle_deg for {number_of(n.size, 'point')}"
        raise InputError(Fault("", "angle_deg", got, "as many of each, or one")) from None
    return n, V, angle


SPEEDS = np.linspace(0.04, 1.0, 33)
"""Speeds of the table of a rotor over the greatest [1]."""
FEW = 300
"""Up to so many points each has its band solved for itself."""
ANGLE_STEP, SPEED_STEP = 0.01, 0.1
"""Steps of the lattice: inflow angle at 0.75 R without induction [rad], ln(rev/min) [1]. Bands are met within 1 %."""
_ROW = 1 << 20  # more speeds than there are
_UNEVEN = 1.6  # largest over smallest band around a cell that is interpolated
_POWERS = {"thrust_N": 2, "torque_Nm": 2, "power_W": 3, "exhaust_speed_m_s": 1}  # of the speed that bands grow with


def solve(
    case: Case, rpm: Array, airspeed_m_s: Array, density_kg_m3: float | None, bands: bool = True,
    angle_deg: Array | float | None = None,
) -> Dataset:  # fmt: skip
    """Solve points [rev/min], [m/s], [deg] between wind and shaft, (P,), in one air [kg/m3], with bands and flags.

    A point that stands still, or whose speed is NaN, is NaN and flagged.
    """
    turning = rpm > 0.0
    if not np.all(turning):
        return _with_stopped(case, rpm, airspeed_m_s, density_kg_m3, bands, angle_deg)
    if case.angle_deg or np.any(0.0 if angle_deg is None else angle_deg):
        return propagate(case, rpm, airspeed_m_s, density_kg_m3, angle_deg=angle_deg, bands=bands).points
    if case.paired:
        return propagate(case, rpm, airspeed_m_s, density_kg_m3, bands=bands).points
    own = any(item.key.startswith("operating.") for item in case.assumptions)
    if not bands or own or rpm.size <= FEW:
        return propagate(case, rpm, airspeed_m_s, density_kg_m3, bands=bands).points
    per_angle = 0.75 * math.pi * case.diameter_m / 60.0  # V = per_angle rpm tan(angle)
    x = np.arctan2(airspeed_m_s, per_angle * rpm) / ANGLE_STEP
    y = np.log(rpm) / SPEED_STEP
    i, j = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    cells, cell = np.unique(i * _ROW + j, return_inverse=True)  # one number a cell
    nodes, at = np.unique(cells[:, None] + np.array([0, 1, _ROW, _ROW + 1]), return_inverse=True)
    if nodes.size > rpm.size // 2:  # scattered: nothing is saved
        return propagate(case, rpm, airspeed_m_s, density_kg_m3).points
    at = at.reshape(-1, 4)  # nodes of each cell
    along, speed = np.divmod(nodes, _ROW)
    n = np.exp(speed * SPEED_STEP)
    V = per_angle * n * np.tan(along * ANGLE_STEP)
    around = propagate(case, n, V, density_kg_m3).points
    found = propagate(case, rpm, airspeed_m_s, density_kg_m3, bands=False).points
    a, b = x - i, y - j
    share = np.stack([(1.0 - a) * (1.0 - b), (1.0 - a) * b, a * (1.0 - b), a * b], axis=1)
    u_by = {origin: {key: _between(key, u, n, rpm, at[cell], share) for key, u in part.items()}
            for origin, part in around.u_by.items()}  # fmt: skip
    found = replace(found, u={}, u_by=u_by)
    rough = np.any([_rough(u / n ** _POWERS.get(key, 0), at) for key, u in around.u.items()], axis=0)
    rough = np.flatnonzero(rough[cell] | (found.converged & np.isnan(found.u_thrust_N)))
    return _exact(case, found, rough, density_kg_m3) if rough.size else found


def _with_stopped(
    case: Case, rpm: Array, airspeed_m_s: Array, density_kg_m3: float | None, bands: bool,
    angle_deg: Array | float | None,
) -> Dataset:  # fmt: skip
    """Points of which some do not turn: those are NaN, the others solved; the case's own speed where none turns."""
    turning = rpm > 0.0
    rows = np.flatnonzero(turning) if np.any(turning) else np.zeros(1, dtype=int)
    angle = None if angle_deg is None else np.broadcast_to(angle_deg, rpm.shape)[rows]
    n = np.where(turning, rpm, case.rpm)[rows]
    found = solve(case, n, np.nan_to_num(airspeed_m_s[rows]), density_kg_m3, bands, angle)

    def spread(part: Array) -> Array:
        out = np.full(rpm.size, np.nan)
        if np.any(turning):
            out[rows] = part
        return out

    values = {key: spread(v) for key, v in found.values.items()}
    values |= {"rpm": rpm, "airspeed_m_s": airspeed_m_s}
    values["density_kg_m3"] = np.full(rpm.size, found["density_kg_m3"][0])
    u_by = {origin: {key: spread(v) for key, v in part.items()} for origin, part in found.u_by.items()}
    flags: list[tuple[str, ...]] = [(UNKNOWN if np.isnan(x) else STOPPED,) for x in rpm]
    for row, words in zip(rows, found.flags if np.any(turning) else (), strict=False):
        flags[row] = words
    return replace(found, values=values, u={}, u_by=u_by, flags=tuple(flags), lines=())


def _between(key: str, u: Array, n: Array, rpm: Array, at: NDArray[np.int64], share: Array) -> Array:
    """Standard uncertainty of one channel at points: its square over the loads' own scale, linear between the nodes."""
    power = _POWERS.get(key, 0)
    return np.asarray(np.sqrt(((u / n**power)[at] ** 2 * share).sum(axis=1)) * rpm**power)


def _rough(u: Array, at: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Cells with nodes of which some have no band, or much larger ones than others: efficiency near zero torque."""
    corners = u[at]
    missing = np.isnan(corners)
    uneven = np.fmax.reduce(corners, axis=1) > _UNEVEN * np.fmin.reduce(corners, axis=1)
    return np.asarray((missing.any(axis=1) & ~missing.all(axis=1)) | (uneven & ~missing.any(axis=1)))


def _exact(case: Case, found: Dataset, which: NDArray[np.int64], density_kg_m3: float | None) -> Dataset:
    """The same, with some points solved with bands of their own."""
    own = propagate(case, found.rpm[which], found.airspeed_m_s[which], density_kg_m3).points
    u_by = {origin: {key: u.copy() for key, u in part.items()} for origin, part in found.u_by.items()}
    for origin, part in own.u_by.items():
        for key, u in part.items():
            u_by[origin][key][which] = u
    flags = list(found.flags)
    for k, words in zip(which.tolist(), own.flags, strict=True):
        flags[k] = words
    return replace(found, u={}, u_by=u_by, flags=tuple(flags))

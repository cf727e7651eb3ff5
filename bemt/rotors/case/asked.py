"""Operating points that a caller asks of a case, checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.given import numbers
from bemt.base.tables import number_of
from bemt.rotors.case.load import Case

RPM_MAX, AIRSPEED_MAX = 300000.0, 300.0  # as in a case file [rev/min], [m/s]


def conditions(case: Case, rpm: Any, airspeed_m_s: Any, J: Any) -> tuple[Array, Array]:
    """Speeds [rev/min] and airspeeds [m/s] of the points that a caller means, by default those of the case."""
    faults = []
    if J is not None and airspeed_m_s is not None:
        faults.append(Fault("", "J, airspeed_m_s", "both", "one of them"))
    given = {"rpm": rpm, "airspeed_m_s": airspeed_m_s, "J": J}
    found: dict[str, Array] = {}
    for name, value in given.items():
        if value is None:
            continue
        try:
            found[name] = numbers(name, value)
        except InputError as error:
            faults += error.faults
    if "rpm" in found and np.any(found["rpm"] <= 0.0):
        faults.append(Fault("", "rpm", f"{np.min(found['rpm']):g}", "speeds above 0 rev/min", "Drop the sign?"))
    elif "rpm" in found and np.any(found["rpm"] > RPM_MAX):
        faults.append(Fault("", "rpm", f"{np.max(found['rpm']):g}", f"up to {RPM_MAX:g} rev/min"))
    fast = np.max(np.abs(found.get("airspeed_m_s", np.zeros(1))))
    if fast > AIRSPEED_MAX:
        hint = "km/h? Divide by 3.6"
        faults.append(Fault("", "airspeed_m_s", f"{fast:g}", f"up to {AIRSPEED_MAX:g} m/s", hint))
    shapes = {name: value.shape for name, value in found.items()}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        got = ", ".join(f"{value.size} of {name}" for name, value in found.items())
        faults.append(Fault("", ", ".join(shapes), got, "as many of each, or one", "curve() takes every pair"))
    if faults:
        raise InputError(faults)
    n = found.get("rpm", np.asarray(case.rpm, dtype=float))
    if J is not None:
        V = found["J"] * n / 60.0 * case.diameter_m
    else:
        V = found.get("airspeed_m_s", np.asarray(case.airspeed_m_s, dtype=float))
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

"""Checks of numbers, paths and operating points that callers pass in."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of

if TYPE_CHECKING:
    from bemt.rotors.case import Case

__all__ = ["conditions", "in_words_of_the_library", "number", "numbers", "path_text", "turned"]

RPM_MAX, AIRSPEED_MAX = 300000.0, 300.0  # as in a case file [rev/min], [m/s]

ARGUMENTS = {
    "--airspeed": "airspeed_m_s", "--density": "density_kg_m3", "--format": "formats", "--out": "folder",
    "--case": "propeller", "--plan": "points", "--thrust": "thrust_N", "--static-thrust": "static_thrust_N",
    "--mass": "mass_kg", "--capacity": "capacity_Ah", "--hover-time": "minutes",
}  # fmt: skip
"""Arguments whose name is not the option's."""


def argument(option: str) -> str:
    """Name of the argument for an option of the command line; other words stay.

    >>> argument("--chord-mm"), argument("--airspeed"), argument("LABEL"), argument("case.toml")
    ('chord_mm', 'airspeed_m_s', 'label', 'case.toml')
    """
    if option == "LABEL":
        return "label"
    return ARGUMENTS.get(option, option[2:].replace("-", "_")) if option.startswith("--") else option


def arguments(sentence: str) -> str:
    """A sentence with arguments in place of options; a whole line for the shell stays.

    >>> arguments("As in --thrust 27 --cells 6"), arguments("Try bemt new --scan FILE")
    ('As in thrust_N=27, cells=6', 'Try bemt new --scan FILE')
    """
    if re.search(r"\bbemt [a-z]", sentence):
        return sentence
    valued = re.sub(r"(--[a-z][a-z-]*) (\d[\d.]*)", lambda m: f"{argument(m[1])}={m[2]}", sentence)
    return re.sub(r"(=[\d.]+) (?=[a-zA-Z_]+=)", r"\1, ", re.sub(r"--[a-z][a-z-]*", lambda m: argument(m[0]), valued))


@contextmanager
def in_words_of_the_library(keys: Mapping[str, str] | None = None, file: str = "") -> Iterator[None]:
    """Name arguments, not options, in the faults of what runs inside.

    Parameters
    ----------
    keys : mapping, optional
        Keys of the case that a caller gave as arguments, to their names: a fault there is the argument's.
    file : str
        File of that case.
    """
    try:
        yield
    except InputError as error:
        faults = [_named(fault, keys or {}, file) for fault in error.faults]
        if faults == list(error.faults):
            raise
        raise InputError(faults) from error


def _named(fault: Fault, keys: Mapping[str, str], file: str) -> Fault:
    if fault.file == file and fault.where in keys:
        fault = replace(fault, file="", where=keys[fault.where])
    expected, hint = arguments(fault.expected), arguments(fault.hint)
    return replace(fault, file=argument(fault.file), where=argument(fault.where), expected=expected, hint=hint)


def numbers(name: str, value: Any) -> Array:
    """One or more finite numbers from a caller."""
    wrong = Fault("", name, f"{type(value).__name__} {value!r:.60}", "a number, or several")
    try:
        raw = np.asarray(value)
        text = raw.dtype.kind in "USTbM"
        text |= raw.dtype.kind == "O" and any(isinstance(v, (str, bytes, bool)) for v in raw.flat)
        found = np.asarray(raw, dtype=float)
    except (TypeError, ValueError):
        raise InputError(wrong) from None
    if text:  # numpy would read "6000" and True as numbers
        raise InputError(wrong)
    if not found.size:
        raise InputError(Fault("", name, "no number", "one or more"))
    if not np.all(np.isfinite(found)):
        raise InputError(Fault("", name, "a number that is not finite", "finite numbers"))
    return found


def path_text(name: str, value: Any) -> str:
    """Path as text; anything else is an error."""
    if isinstance(value, (str, os.PathLike)) and os.fspath(value):
        return os.fspath(value)
    raise InputError(Fault("", name, f"{type(value).__name__} {value!r:.40}", "the path of a file or folder"))


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


def number(name: str, value: Any) -> float:
    """One finite number from a caller."""
    found = numbers(name, value)
    if found.size != 1:
        raise InputError(Fault("", name, f"{found.size} numbers", "one number"))
    return float(found.ravel()[0])

"""Checks of numbers and paths that callers pass in."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError

__all__ = ["in_words_of_the_library", "number", "numbers", "path_text"]

ARGUMENTS = {
    "--airspeed": "airspeed_m_s", "--density": "density_kg_m3", "--format": "formats", "--out": "folder",
    "--case": "propeller", "--plan": "points", "--thrust": "thrust_N", "--static-thrust": "static_thrust_N",
    "--mass": "mass_kg", "--capacity": "capacity_Ah",
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


def numbers(name: str, value: Any) -> NDArray[np.float64]:
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


def number(name: str, value: Any) -> float:
    """One finite number from a caller."""
    found = numbers(name, value)
    if found.size != 1:
        raise InputError(Fault("", name, f"{found.size} numbers", "one number"))
    return float(found.ravel()[0])

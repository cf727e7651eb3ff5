"""Checks of numbers and paths that callers pass in."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError

__all__ = ["in_words_of_the_library", "numbers", "path_text"]

ARGUMENTS = {
    "--airspeed": "airspeed_m_s", "--density": "density_kg_m3", "--format": "formats", "--out": "folder",
    "--case": "propeller", "--plan": "points", "--thrust": "thrust_N", "--static-thrust": "static_thrust_N",
}  # fmt: skip
"""Arguments whose name is not the option's."""


def argument(option: str) -> str:
    """Name of the argument for an option of the command line; other words stay.

    >>> argument("--chord-mm"), argument("--airspeed"), argument("case.toml")
    ('chord_mm', 'airspeed_m_s', 'case.toml')
    """
    return ARGUMENTS.get(option, option[2:].replace("-", "_")) if option.startswith("--") else option


@contextmanager
def in_words_of_the_library() -> Iterator[None]:
    """Name arguments, not options, in the faults of what runs inside."""
    try:
        yield
    except InputError as error:
        faults = [replace(f, file=argument(f.file), where=argument(f.where)) for f in error.faults]
        if faults == list(error.faults):
            raise
        raise InputError(faults) from error


def numbers(name: str, value: Any) -> NDArray[np.float64]:
    """One or more finite numbers from a caller."""
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(Fault("", name, repr(value), "a number, or several")) from None
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

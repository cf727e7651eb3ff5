"""Checks of numbers and paths that callers pass in."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError

__all__ = ["numbers", "path_text"]


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

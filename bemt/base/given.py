"""Checks of numbers and paths that callers pass in."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.cache import cache_dir
from bemt.base.errors import Fault, InputError

__all__ = ["number", "numbers", "path_text"]


def numbers(name: str, value: Any, finite: bool = True) -> Array:
    """One or more numbers from a caller; unless finite, infinite ones are left to who knows the range."""
    hint = "One column of it, as frame['rpm']" if hasattr(value, "columns") else ""
    wrong = Fault("", name, f"{type(value).__name__} {' '.join(repr(value).split()):.60}", "a number, or several", hint)
    try:
        raw = np.asarray(value)
        kind, words = raw.dtype.kind, (str, bytes, bool)
        if hint or kind in "USTbMc" or (kind == "O" and any(isinstance(v, words) for v in raw.flat)):
            raise TypeError  # numpy would read "6000" and True as numbers, and 6000+1j as 6000
        found = np.asarray(raw, dtype=float)
    except (TypeError, ValueError):
        raise InputError(wrong) from None
    if not found.size:
        raise InputError(Fault("", name, "no number", "one or more"))
    if finite and not np.all(np.isfinite(found)):
        raise InputError(Fault("", name, "a number that is not finite", "finite numbers"))
    return found


def path_text(name: str, value: Any) -> str:
    """Path as text; anything else is an error."""
    if isinstance(value, (str, os.PathLike)) and os.fspath(value):
        return os.fspath(value)
    hint = "A table is read already: compare and diagnose take it" if hasattr(value, "columns") else ""
    got = f"{type(value).__name__} {' '.join(repr(value).split()):.40}"
    raise InputError(Fault("", name, got, "the path of a file or folder", hint))


def number(name: str, value: Any, finite: bool = True) -> float:
    """One number from a caller."""
    found = numbers(name, value, finite)
    if found.size != 1:
        raise InputError(Fault("", name, f"{found.size} numbers", "one number"))
    return float(found.ravel()[0])


def paths_text(name: str, value: Any, least: int = 0) -> list[str]:
    """Paths as text: one, or several.

    >>> paths_text("files", "a.csv"), paths_text("files", ("a.csv", "b.csv"))
    (['a.csv'], ['a.csv', 'b.csv'])
    """
    several = value if isinstance(value, (list, tuple)) else [value]
    if len(several) < least:
        raise InputError(Fault("", name, "none", "one or more"))
    return [path_text(name, one) for one in several]


# Where published data are found, and whether a name stays in its folder.
def data_roots() -> list[Path]:
    """Folders that may hold databases, first to last."""
    named = os.environ.get("BEMT_DATA")
    first = Path(named).expanduser() if named else Path(__file__).resolve().parents[3] / "shared" / "data"
    cache = cache_dir()
    return [first] if cache is None else [first, cache / "data"]


def find_data(kind: str) -> Path | None:
    """Folder of one database.

    >>> find_data("no such database") is None
    True
    """
    return next((root / kind for root in data_roots() if (root / kind).is_dir()), None)


def inside(folder: Path, name: str) -> bool:
    """Whether a file that a case names lies in its folder, links followed.

    >>> inside(Path("case"), "sections/root.dat"), inside(Path("case"), "../other.dat"), inside(Path("case"), "/etc/x")
    (True, False, False)
    """
    try:
        return (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a loop of links, a name that is none
        return False

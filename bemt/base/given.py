"""Checks of numbers and paths that callers pass in."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Set
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.cache import cache_dir
from bemt.base.errors import Fault, InputError

__all__ = ["declared", "number", "numbers", "path_text"]


_PATHS = ("Path", "File", "StrPath", "str | os.PathLike[str]")
"""Annotations of the path of a file or folder."""


def declared(name: str, kind: str, value: Any) -> Any:
    """Argument of a parameter as its annotation has it, or a refusal; what an annotation leaves open stays.

    >>> declared("off", "Sequence[str]", "duct"), declared("rpm", "float | None", np.array(6000.0))
    (['duct'], 6000.0)
    >>> declared("label", "str | None", 5)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: label: got int 5; expected text.
    """
    one, many, _ = kind.partition("Sequence[")
    plain = kind.removesuffix(" | None")
    if value is None and (plain != kind or plain not in (*_PATHS, "float", "int", "str")):
        return value
    if many:
        value = _several(one, value)
    if plain in ("float", "int", "Count", "Cells", "tuple[float, float] | float"):
        value = value.tolist() if hasattr(value, "tolist") and np.size(value) == 1 else value
        value = value[0] if isinstance(value, list) and len(value) == 1 else value
    expected, fits = "", True
    if plain in ("float", "int"):
        expected, fits = "a number", isinstance(value, Real) and not isinstance(value, bool)
    elif "tuple[float, float]" in plain and not many:
        pair = value.tolist() if hasattr(value, "tolist") else value
        expected, fits = "a number, or two", _numbers(pair if isinstance(pair, (list, tuple)) else [pair])
        value = tuple(pair) if fits and isinstance(pair, list) else pair
    elif plain in _PATHS and not isinstance(value, str):
        path_text(name, value)
    elif plain == "str":
        expected, fits = "text", isinstance(value, str)
    elif plain in ("Sequence[str]", "str | Sequence[str]"):
        each = value if isinstance(value, (list, tuple)) else [value]
        expected, fits = "text, or several", all(isinstance(v, str) for v in each)
    elif "Mapping[str," in plain and "Recording" not in plain:
        # a line of the shell is one as well: thrust=N
        each = value if isinstance(value, (list, tuple)) else [value]
        expected = "a mapping, as {'thrust': 'N'}" if plain == "Mapping[str, str]" else "text or a mapping"
        fits = isinstance(value, Mapping) or all(isinstance(v, str) for v in each)
        value = [value] if plain == "Mapping[str, str]" and isinstance(value, str) else value
    if not fits:
        raise InputError(Fault("", name, _shown(value), expected))
    return value


def _several(one: str, value: Any) -> Any:
    """What stands for a sequence as a list; text and paths that the annotation allows alone stay."""
    if isinstance(value, (list, tuple)) or (one and isinstance(value, (str, os.PathLike))):
        return value
    if hasattr(value, "tolist") and not hasattr(value, "columns"):
        value = value.tolist()
        return value if isinstance(value, list) else [value]
    return list(value) if isinstance(value, (Set, Iterator, range)) else [value]


def _numbers(values: Any) -> bool:
    return len(values) in (1, 2) and all(isinstance(v, Real) and not isinstance(v, bool) for v in values)


def _shown(value: Any) -> str:
    """Type and start of a value."""
    return f"{type(value).__name__} {' '.join(repr(value).split()):.40}"


def numbers(name: str, value: Any, finite: bool = True) -> Array:
    """One or more numbers from a caller; unless finite, infinite ones are left to who knows the range."""
    wrong = Fault("", name, f"{type(value).__name__} {value!r:.60}", "a number, or several")
    try:
        raw = np.asarray(value)
        kind, words = raw.dtype.kind, (str, bytes, bool)
        if kind in "USTbMc" or (kind == "O" and any(isinstance(v, words) for v in raw.flat)):
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
    raise InputError(Fault("", name, _shown(value), "the path of a file or folder", hint))


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

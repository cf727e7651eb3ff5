"""Arguments of an action as its annotations declare them: what people have at hand is made that, or refused by name."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping, Set
from numbers import Real
from typing import Any

from bemt.base.action import did_you_mean
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.given import number, path_text

__all__ = ["as_declared", "check_choices", "declared"]

_NUMBERS = ("float", "int")
_PATHS = ("Path", "File", "StrPath", "str | os.PathLike[str]")
"""Annotations of the path of a file or folder."""


def as_declared(
    given: Mapping[str, Any], kinds: Mapping[str, str], function: Callable[..., Any]
) -> dict[str, Any]:  # fmt: skip
    """Arguments of a function by name, as its annotations have them, None as the default; all faults at once."""
    faults: list[Fault] = []
    out = dict(given)
    usual = {k: p.default for k, p in inspect.signature(function).parameters.items() if p.default is not p.empty}
    for name in (k for k in kinds if k in given):
        with gathered(faults):
            out[name] = (
                usual[name] if given[name] is None and name in usual else declared(name, kinds[name], given[name])
            )
    refuse(faults)
    return out


def declared(name: str, kind: str, value: Any) -> Any:
    """One of them; what an annotation leaves open stays.

    >>> import numpy as np
    >>> declared("off", "Sequence[str]", "duct"), declared("rpm", "float | None", np.array(6000.0))
    (['duct'], 6000.0)
    >>> declared("label", "str | None", 5)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: label: got int 5; expected text.
    """
    one, many, inner = kind.partition("Sequence[")
    plain = kind.removesuffix(" | None")
    paths = one.removesuffix(" | ") in _PATHS or inner.startswith("StrPath")
    if value is None and (plain != kind or not (paths or plain in (*_PATHS, *_NUMBERS, "str"))):
        return value
    if many:
        value = _several(one, value)
    elif hasattr(value, "tolist") and not hasattr(value, "columns") and plain not in (*_PATHS, "str"):
        value = _alone(value.tolist()) if plain in (*_NUMBERS, "Count", "Cells") or "tuple[" in plain else value
    each = value if isinstance(value, (list, tuple)) else [value]
    words = all(isinstance(v, str) for v in each)
    expected = ""
    if plain in _NUMBERS and not _is_number(value):
        value = number(name, value, finite=False)
    elif plain in _PATHS and not isinstance(value, str):
        path_text(name, value)
    elif many and paths and "KnownMotor" not in inner:
        for path in (p for v in each for p in (v if isinstance(v, (list, tuple)) else [v])):
            path_text(name, path)
    elif plain == "str" and not isinstance(value, str):
        expected = "text"
    elif plain in ("Sequence[str]", "str | Sequence[str]") and not words:
        expected = "text, or several"
    elif plain in ("tuple[float, float]", "tuple[float, float] | float"):
        expected = "" if len(each) in (1, 2) and all(map(_is_number, each)) else "a number, or two"
        value = tuple(value) if isinstance(value, list) else value
    elif plain == "Mapping[str, str]" and not isinstance(value, Mapping):
        expected = "" if words else "a mapping, as {'thrust': 'N'}"
        value = each  # lines of the shell: thrust=N
    elif plain == "str | Mapping[str, float]" and not isinstance(value, (str, Mapping)):
        expected = "text or a mapping"
    if expected:
        raise InputError(Fault("", name, f"{type(value).__name__} {' '.join(repr(value).split()):.40}", expected))
    return value


def check_choices(choices: Mapping[str, tuple[str, ...]], given: Mapping[str, Any]) -> None:
    """Refuse words that are none of those declared."""
    faults = []
    for name, known in choices.items():
        value = given.get(name)
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if one is not None and not (isinstance(one, str) and one in known):
                near = did_you_mean(str(one), known).strip()
                faults.append(Fault("", name, repr(one), f"one of {', '.join(filter(None, known))}", near))
    if faults:
        raise InputError(faults)


def _several(one: str, value: Any) -> Any:
    """What stands for a sequence as a list; text and paths that the annotation allows alone stay."""
    if isinstance(value, (list, tuple)) or (one and isinstance(value, (str, os.PathLike))):
        return value
    if hasattr(value, "tolist") and not hasattr(value, "columns"):
        value = value.tolist()
        return value if isinstance(value, list) else [value]
    return list(value) if isinstance(value, (Set, Iterator, range)) else [value]


def _alone(value: Any) -> Any:
    return value[0] if isinstance(value, list) and len(value) == 1 else value


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)

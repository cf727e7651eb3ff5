"""Typed rows and their documents: frozen dataclasses to values that JSON holds, and back.

NaN and None come from the type of a field. A float is NaN where a document has null; a field that is None by default is
left out of the document while it is None.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Self, TypeVar, Union, dataclass_transform, get_args, get_origin, get_type_hints

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Documented:
    """A row that knows its document; every class made from it is a frozen dataclass.

    >>> class Load(Documented):
    ...     thrust_N: float
    ...     flags: tuple[str, ...] = ()
    ...     u: float | None = None
    >>> Load.from_document({"thrust_N": None, "flags": ["stall"]})
    Load(thrust_N=nan, flags=('stall',), u=None)
    >>> Load(1.5, ("stall",)).document()
    {'thrust_N': 1.5, 'flags': ['stall']}
    """

    def __init_subclass__(cls, **options: Any) -> None:
        """Make the class a dataclass."""
        dataclass(frozen=True, **options)(cls)

    def document(self) -> dict[str, Any]:
        """Plain values by name; NaN as it is."""
        shown = ((f, getattr(self, f.name)) for f in fields(self))  # type: ignore[arg-type]
        return {f.name: _told(value) for f, value in shown if value is not None or f.default is not None}

    @classmethod
    def from_document(cls, document: Any, lenient: bool = False) -> Self:
        """Row of a document; TypeError where a value has another type or is missing.

        ``lenient``: such a value is the default of its field, and left out of a list; unknown names always are.
        """
        if not isinstance(document, Mapping):
            raise TypeError(f"{cls.__name__}: got {type(document).__name__}; expected a mapping")
        found = {}
        for name, kind, optional in _fields(cls):  # type: ignore[arg-type]
            if name in document:
                try:
                    found[name] = typed(kind, document[name], lenient)
                except TypeError as error:
                    if not (lenient and optional):
                        raise TypeError(f"{cls.__name__}.{name}: {error}") from None
        return cls(**found)


@cache
def _fields(cls: Any) -> tuple[tuple[str, Any, bool], ...]:
    """Name, type and whether it may be missing, of every field."""
    kinds = get_type_hints(cls)
    return tuple(
        (f.name, kinds[f.name], f.default is not MISSING or f.default_factory is not MISSING) for f in fields(cls)
    )


def _told(value: Any) -> Any:
    if isinstance(value, Documented):
        return value.document()
    if isinstance(value, Mapping):
        return {key: _told(item) for key, item in value.items()}
    return [_told(item) for item in value] if isinstance(value, list | tuple) else value


def rows_of(kind: type[T], found: Any, lenient: bool = False) -> tuple[T, ...]:
    """Rows of a list; ``lenient`` leaves out what is none, and takes anything but a list for an empty one."""
    if not isinstance(found, list | tuple):
        if lenient:
            return ()
        raise TypeError(f"got {type(found).__name__}; expected a list")
    return tuple(item for _, item in _each(kind, enumerate(found), lenient))


def _each(kind: Any, found: Iterable[tuple[Any, Any]], lenient: bool) -> Iterator[tuple[Any, Any]]:
    for key, item in found:
        try:
            yield key, typed(kind, item, lenient)
        except TypeError:
            if not lenient:
                raise


def _is_plain(kind: type, value: Any) -> bool:
    """Whether a value is of a plain type: a whole number is also a float, true and false are no numbers."""
    if kind in (int, float) and isinstance(value, bool):
        return False
    return isinstance(value, int | float if kind is float else kind)


def typed(kind: Any, value: Any, lenient: bool = False) -> Any:
    """Value of a document as its type says; TypeError where it is another."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return _of_union(kind, value, lenient)
    if kind is float and value is None:
        return math.nan
    elif kind is Any or (origin is Literal and value in inner):
        return value
    elif origin is tuple and inner[1:] == (...,):
        return rows_of(inner[0], value, lenient)
    elif origin is tuple and isinstance(value, list | tuple) and len(value) == len(inner):
        return tuple(typed(one, item, lenient) for one, item in zip(inner, value, strict=True))
    elif origin is Mapping and isinstance(value, Mapping):
        return {str(key): item for key, item in _each(inner[1], value.items(), lenient)}
    elif origin is None and issubclass(kind, Documented):
        return kind.from_document(value, lenient)
    elif origin is None and _is_plain(kind, value):
        return value
    raise _another(kind, value)


def _of_union(kind: Any, value: Any, lenient: bool) -> Any:
    """Value of the first type of a union that it is of."""
    inner = get_args(kind)
    if value is None and NoneType in inner and float not in inner:
        return None
    for one in inner:
        with suppress(TypeError):
            return typed(one, value, lenient)
    raise _another(kind, value)


def _another(kind: Any, value: Any) -> TypeError:
    return TypeError(f"got {value!r:.80}; expected {getattr(kind, '__name__', kind)}")

"""Physical effects, one file each; see :mod:`bemt.physics.effects.base` for what an effect is.

>>> from bemt.physics.effects import catalogue, standard
>>> "tip_loss" in catalogue()
True
>>> [e.id for e in standard()][:2]
['reynolds', 'stall_delay']
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterable
from functools import lru_cache

from bemt.physics.effects.base import Effect, Parameter, RotorBuild

__all__ = [
    "RotorBuild", "Effect", "Parameter", "catalogue", "from_text", "places", "source_of", "standard", "to_text",
    "without",
]  # fmt: skip


@lru_cache(maxsize=1)
def catalogue() -> dict[str, type[Effect]]:
    """All effects by id, found by scanning this folder."""
    found: dict[str, type[Effect]] = {}
    for info in pkgutil.iter_modules(__path__):
        if info.name == "base":
            continue
        module = importlib.import_module(f"{__name__}.{info.name}")
        own = [obj for obj in vars(module).values() if isinstance(obj, type) and issubclass(obj, Effect)]
        own = [obj for obj in own if obj.__module__ == module.__name__]
        for obj in own:
            if not obj.id and any(obj in other.__mro__[1:] for other in own):
                continue  # what the effects of this file have in common
            if not obj.id or obj.id in found:
                raise ValueError(f"{obj.__module__}.{obj.__name__}: id {obj.id!r} is empty or taken; give it its own")
            found[obj.id] = obj
    return dict(sorted(found.items(), key=lambda kv: (kv[1].order, kv[0])))


@lru_cache(maxsize=1)
def places() -> dict[str, int]:
    """Position of each effect in the catalogue, by id."""
    return {name: k for k, name in enumerate(catalogue())}


def source_of(cls: type[Effect], form: str = "") -> str:
    """Law of an effect, of one form or all, and where it comes from: the notes of its docstring, in one line."""
    text = inspect.cleandoc(cls.__doc__ or "").partition("Notes\n-----\n")[2]
    text = re.sub(rf'``form =\s"(?!{form}).*?(?=``form =|\n\n|\Z)', "", text, flags=re.DOTALL)
    return re.sub(r":\w+:`([^`]+)`|``([^`]+)``", r"`\1\2`", " ".join(text.split()))


def standard() -> tuple[Effect, ...]:
    """The physics that is on unless somebody turns it off."""
    return tuple(cls() for cls in catalogue().values() if cls.on_by_default)


def without(effects: Iterable[Effect], ids: Iterable[str]) -> tuple[Effect, ...]:
    """Effects less those named."""
    ids = tuple(ids)
    unknown = [i for i in ids if i not in catalogue()]
    if unknown:
        raise ValueError(f"unknown effect {', '.join(unknown)}; known: {', '.join(catalogue())}")
    return tuple(e for e in effects if e.id not in ids)


def from_text(text: str) -> Effect:
    """Effect as a case file writes it: its id, with parameters in brackets where they are not the default."""
    name, _, rest = text.partition("(")
    cls = catalogue().get(name.strip())
    if cls is None:
        raise ValueError(f"{name.strip()!r}; expected one of {', '.join(catalogue())}")
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    lawful = ", ".join(fields) or "none"
    if not rest:
        return cls()
    try:
        call = ast.parse(f"f({rest}", mode="eval").body
        assert isinstance(call, ast.Call) and not call.args
        given = {str(k.arg): ast.literal_eval(k.value) for k in call.keywords}
    except (SyntaxError, ValueError, AssertionError):
        raise ValueError(f"{text!r}; expected {name}(parameter=value, ...) with parameters: {lawful}") from None
    ranges = {p.name: p for p in cls.parameters}
    for key, value in given.items():
        if key not in fields:
            raise ValueError(f"parameter {key!r} of {name}; expected one of: {lawful}")
        default = fields[key].default
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if isinstance(default, str) is not isinstance(value, str) or not (number or isinstance(value, str)):
            raise ValueError(f"{key}={value!r} of {name}; expected a value like {default!r}")
        if key in ranges and not ranges[key].low <= value <= ranges[key].high:
            p = ranges[key]
            raise ValueError(f"{key}={value!r} of {name}; expected {p.low:g} to {p.high:g} {p.unit}".rstrip("1 "))
    try:
        return cls(**given)
    except (ValueError, KeyError) as error:
        raise ValueError(f"{text!r}; {error}") from None


def to_text(effect: Effect) -> str:
    """Write an effect as :func:`from_text` reads it."""
    given = [
        f"{f.name}={getattr(effect, f.name)!r}"
        for f in dataclasses.fields(effect)  # type: ignore[arg-type]
        if getattr(effect, f.name) != f.default
    ]
    return f"{effect.id}({', '.join(given)})" if given else effect.id

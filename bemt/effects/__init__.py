"""Physical effects, one file each; see :mod:`bemt.effects.base` for what an effect is.

>>> from bemt.effects import catalogue, standard
>>> "tip_loss" in catalogue()
True
>>> [e.id for e in standard()][:2]
['stall_delay', 'cascade']
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from functools import lru_cache

from bemt.effects.base import Baking, Effect, Parameter

__all__ = ["Baking", "Effect", "Parameter", "catalogue", "standard", "without"]


@lru_cache(maxsize=1)
def catalogue() -> dict[str, type[Effect]]:
    """All effects by id, found by scanning this folder.

    Returns
    -------
    dict
        Id to effect class, in the order of the section hooks, then of the ids.
    """
    found: dict[str, type[Effect]] = {}
    for info in pkgutil.iter_modules(__path__):
        if info.name == "base":
            continue
        module = importlib.import_module(f"{__name__}.{info.name}")
        for obj in vars(module).values():
            if not (isinstance(obj, type) and issubclass(obj, Effect)):
                continue
            if obj is not Effect and obj.__module__ == module.__name__:
                if obj.id in found:
                    raise ValueError(f"two effects share the id {obj.id!r}")
                found[obj.id] = obj
    return dict(sorted(found.items(), key=lambda kv: (kv[1].order, kv[0])))


def standard() -> tuple[Effect, ...]:
    """The physics that is on unless somebody turns it off.

    Returns
    -------
    tuple of Effect
        Effects with their default parameters, in the order in which they are applied.
    """
    return tuple(cls() for cls in catalogue().values() if cls.on_by_default)


def without(effects: Iterable[Effect], ids: Iterable[str]) -> tuple[Effect, ...]:
    """Effects less those named.

    Parameters
    ----------
    effects : iterable of Effect
        What is on.
    ids : iterable of str
        Ids to take out.

    Returns
    -------
    tuple of Effect
        The rest, in the same order.

    Raises
    ------
    ValueError
        If an id is not in the catalogue.
    """
    ids = tuple(ids)
    unknown = [i for i in ids if i not in catalogue()]
    if unknown:
        raise ValueError(f"unknown effect {', '.join(unknown)}; known: {', '.join(catalogue())}")
    return tuple(e for e in effects if e.id not in ids)

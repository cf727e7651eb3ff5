"""Exports of a case, one file per target, found by scanning this folder: the file ``rotor_disk.py`` is ``rotor-disk``
and ``_3mf.py`` is ``3mf``.

An export is a class of :class:`bemt.tools.exports.base.Export` whose ``id`` is the name of its file with ``-`` for
``_``.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bemt.tools.exports.base import Export

__all__ = ["exports", "target_ids"]

_SHARED = {"base", "blades", "folder", "hub", "manifest", "motor", "offers", "parts", "performance", "printing"}
"""Files of this folder that are no targets."""


def target_ids() -> list[str]:
    """Words of ``--format``, sorted; imports no target.

    >>> {"stl", "openfoam", "jsbsim"} <= set(target_ids())
    True
    """
    names = (i.name.lstrip("_") for i in pkgutil.iter_modules(__path__) if i.name not in _SHARED)
    return sorted(name.replace("_", "-") for name in names)


@cache
def exports() -> Mapping[str, Export]:
    """Targets of this folder by id, sorted; TypeError when a file holds no export of its own name."""
    from bemt.tools.exports.base import Export

    found = {}
    for word in target_ids():
        first = "_" if word[0].isdigit() else ""
        module = importlib.import_module(f"{__name__}.{first}{word.replace('-', '_')}")
        own = [
            c
            for c in vars(module).values()
            if isinstance(c, type) and issubclass(c, Export) and getattr(c, "id", None) == word
        ]
        if len(own) != 1:
            raise TypeError(f"{module.__name__} is no export: it needs one class of Export with id = {word!r}")
        found[word] = own[0]()
    return MappingProxyType(found)

"""Rooms that are also functions of the public face: ``bemt.diagnose(...)`` and ``from bemt.diagnose import plan``."""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

__all__ = ["CallableRoom"]


class CallableRoom(ModuleType):
    """Package whose call is that of the function of its name in ``bemt.library``."""

    def __call__(self, *args: Any, **more: Any) -> Any:
        """Call the function of the public face."""
        return getattr(importlib.import_module("bemt.library"), self.__name__.rpartition(".")[2])(*args, **more)

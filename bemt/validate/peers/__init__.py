"""Other solvers on the same propellers: one adapter per file, found by its name.

An adapter has ``TITLE`` and ``solve(rotor, tables, rpm, J, air)``: rotor, section tables at r/R, (P,) points at
sea level; it gives (2, P) CT and CP in the propeller convention, NaN where it gives none. It raises InputError when its
package is not installed.
"""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

from bemt.base.errors import Fault, InputError


def peers() -> tuple[str, ...]:
    """Names of the adapters."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__)))


def peer(name: str) -> ModuleType:
    """Adapter by name; InputError for an unknown one."""
    if name not in peers():
        raise InputError(Fault("--peer", name, "an unknown solver", f"one of {', '.join(peers())}"))
    return importlib.import_module(f"{__name__}.{name}")

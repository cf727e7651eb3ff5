"""Exports of a case, found by scanning this folder: the file ``rotor_disk.py`` is the target ``rotor-disk``. Targets
that share a file, and those of other tools, are offered (``EXPORTS`` of :mod:`bemt.base.plugins`).

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

from bemt.base.plugins import load, offered

if TYPE_CHECKING:
    from bemt.tools.exports.base import Export

__all__ = ["exports", "target_ids"]

ACTIONS = {"export": "bemt.tools.exports.actions:export"}
EXPORTS = {
    "c81": "bemt.tools.exports.blades:C81Export",
    "table": "bemt.tools.exports.tables:TableExport",
    "fmu": "bemt.tools.exports.tables:FmuExport",
    "stl": "bemt.tools.exports.printing:StlExport",
    "obj": "bemt.tools.exports.printing:ObjExport",
    "step": "bemt.tools.exports.printing:StepExport",
    "3mf": "bemt.tools.exports.printing:ThreeMfExport",
    "flow": "bemt.tools.exports.printing:FlowExport",
    "zone": "bemt.tools.exports.printing:ZoneExport",
    "px4": "bemt.tools.exports.autopilots:Px4Export",
    "ardupilot": "bemt.tools.exports.autopilots:ArdupilotExport",
    "xrotor": "bemt.tools.exports.design_codes:XrotorExport",
    "qprop": "bemt.tools.exports.design_codes:QpropExport",
    "dfdc": "bemt.tools.exports.design_codes:DfdcExport",
    "su2-disk": "bemt.tools.exports.flow_solvers:Su2DiskExport",
    "flow360": "bemt.tools.exports.flow_solvers:Flow360Export",
    "fan": "bemt.tools.exports.flow_solvers:FanExport",
    "vbm": "bemt.tools.exports.flow_solvers:VbmExport",
    "gazebo": "bemt.tools.exports.simulators:GazeboExport",
    "rotorpy": "bemt.tools.exports.simulators:RotorpyExport",
    "mujoco": "bemt.tools.exports.simulators:MujocoExport",
}

_SHARED = {
    "actions", "autopilots", "base", "blades", "design_codes", "flow_solvers", "folder", "parts",
    "performance", "printing", "simulators", "solids", "tables",
}  # fmt: skip
"""Files of this folder that are no target of their own; those with several have them in `EXPORTS`."""


def _own() -> dict[str, str]:
    """Targets of this folder with their modules."""
    names = [i.name for i in pkgutil.iter_modules(__path__) if i.name not in _SHARED]
    return {name.lstrip("_").replace("_", "-"): f"{__name__}.{name}" for name in names}


def target_ids() -> list[str]:
    """Words of ``--format``, sorted; imports no target.

    >>> {"stl", "jsbsim"} <= set(target_ids())
    True
    """
    return sorted({**_own(), **offered("EXPORTS")})


@cache
def exports() -> Mapping[str, Export]:
    """Targets by id, sorted; TypeError when a file holds no export of its own name."""
    from bemt.tools.exports.base import Export

    found = {word: load(where)() for word, where in offered("EXPORTS").items()}
    for word, name in _own().items():
        kinds = [c for c in vars(importlib.import_module(name)).values() if isinstance(c, type)]
        own = [c for c in kinds if issubclass(c, Export) and getattr(c, "id", None) == word]
        if len(own) != 1:
            raise TypeError(f"{name} is no export: it needs one class of Export with id = {word!r}")
        found[word] = own[0]()
    return MappingProxyType(dict(sorted(found.items())))

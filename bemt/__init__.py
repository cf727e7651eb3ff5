"""Propeller and ducted-fan aerodynamics: blade element momentum theory, compared with CFD, bench and empirical data.

>>> import bemt
>>> bemt.propeller("10x5").solve(rpm=6000).thrust_N.round(1)
array([4.8])

Names are loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.3.0"

if TYPE_CHECKING:
    from bemt.base.errors import InputError as InputError
    from bemt.dataset import Dataset as Dataset
    from bemt.library import Answer as Answer
    from bemt.library import Propeller as Propeller
    from bemt.library import calibrate_rotor as calibrate_rotor
    from bemt.library import cite as cite
    from bemt.library import compare as compare
    from bemt.library import design as design
    from bemt.library import diagnose as diagnose
    from bemt.library import drive as drive
    from bemt.library import estimate as estimate
    from bemt.library import export as export
    from bemt.library import load as load
    from bemt.library import plan as plan
    from bemt.library import propeller as propeller
    from bemt.library import read as read
    from bemt.library import report as report
    from bemt.library import validate as validate
    from bemt.library.choices import choose as choose

_HOMES = {"InputError": "bemt.base.errors", "Dataset": "bemt.dataset", "choose": "bemt.library.choices"}
_ROOMS = ("compare", "design", "diagnose", "drive", "report", "validate")  # packages that can be called like functions
_NAMES = (
    "Answer", "Dataset", "InputError", "Propeller", "calibrate_rotor", "choose", "cite", "compare", "design",
    "diagnose", "drive", "estimate", "export", "load", "plan", "propeller", "read", "report", "validate",
)  # fmt: skip
__all__ = ["__version__", *_NAMES]


def __getattr__(name: str) -> Any:
    """Load a name of the public API on first use."""
    if name == "library":  # the home of most names, as their help says
        import bemt.library

        return bemt.library
    if name not in _NAMES:
        raise AttributeError(f"module 'bemt' has no attribute {name!r}; it offers {', '.join(_NAMES)}")
    import importlib

    if name in _ROOMS:
        return importlib.import_module(f"bemt.{name}")
    return getattr(importlib.import_module(_HOMES.get(name, "bemt.library")), name)


def __dir__() -> list[str]:
    return sorted(__all__)

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
    from bemt.app.library import Answer as Answer
    from bemt.app.library import Propeller as Propeller
    from bemt.app.library import calibrate_rotor as calibrate_rotor
    from bemt.app.library import cite as cite
    from bemt.app.library import compare as compare
    from bemt.app.library import design as design
    from bemt.app.library import diagnose as diagnose
    from bemt.app.library import drive as drive
    from bemt.app.library import estimate as estimate
    from bemt.app.library import export as export
    from bemt.app.library import load as load
    from bemt.app.library import plan as plan
    from bemt.app.library import propeller as propeller
    from bemt.app.library import read as read
    from bemt.app.library import report as report
    from bemt.app.library import validate as validate
    from bemt.app.library.choices import choose as choose
    from bemt.base.errors import InputError as InputError
    from bemt.physics.dataset import Dataset as Dataset

_HOMES = {"InputError": "bemt.base.errors", "Dataset": "bemt.physics.dataset", "choose": "bemt.app.library.choices"}
_NAMES = (
    "Answer", "Dataset", "InputError", "Propeller", "calibrate_rotor", "choose", "cite", "compare", "design",
    "diagnose", "drive", "estimate", "export", "load", "plan", "propeller", "read", "report", "validate",
)  # fmt: skip
__all__ = ["__version__", *_NAMES]


def __getattr__(name: str) -> Any:
    """Load a name of the public API on first use."""
    if name == "library":  # the home of most names, as their help says
        import bemt.app.library

        return bemt.app.library
    if name not in _NAMES:
        raise AttributeError(f"module 'bemt' has no attribute {name!r}; it offers {', '.join(_NAMES)}")
    import importlib

    return getattr(importlib.import_module(_HOMES.get(name, "bemt.app.library")), name)


def __dir__() -> list[str]:
    return sorted(__all__)

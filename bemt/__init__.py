"""Propeller and ducted-fan aerodynamics: blade element momentum theory, compared with CFD, bench and empirical data.

>>> import bemt
>>> bemt.propeller("10x5").solve(rpm=6000).thrust_N.round(1)
array([4.8])

Names are loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.4.0"

if TYPE_CHECKING:
    from bemt.app.actions import completion as completion
    from bemt.app.actions import ui as ui
    from bemt.base.errors import InputError as InputError
    from bemt.data.actions import fetch as fetch
    from bemt.data.actions import read as read
    from bemt.judge.actions import calibrate_rotor as calibrate_rotor
    from bemt.judge.actions import compare as compare
    from bemt.judge.actions import diagnose as diagnose
    from bemt.judge.actions import plan as plan
    from bemt.judge.actions import prove as prove
    from bemt.judge.diagnose.ask import Answer as Answer
    from bemt.judge.import_files import import_ as import_
    from bemt.physics.dataset import Dataset as Dataset
    from bemt.results.actions import effects as effects
    from bemt.results.actions import report as report
    from bemt.results.actions import sweep as sweep
    from bemt.rotors.actions import calibrate as calibrate
    from bemt.rotors.actions import cite as cite
    from bemt.rotors.actions import estimate as estimate
    from bemt.rotors.actions import measured_rotors as measured_rotors
    from bemt.rotors.actions import new as new
    from bemt.rotors.actions import stations as stations
    from bemt.rotors.actions import validate as validate
    from bemt.rotors.propeller import Propeller as Propeller
    from bemt.rotors.propeller import load as load
    from bemt.rotors.propeller import propeller as propeller
    from bemt.tools.cfd.actions import cfd as cfd
    from bemt.tools.design.actions import choose as choose
    from bemt.tools.design.actions import design as design
    from bemt.tools.drive.actions import drive as drive
    from bemt.tools.drive.actions import map as map
    from bemt.tools.drive.actions import motor as motor
    from bemt.tools.drive.actions import thrusters as thrusters
    from bemt.tools.exports.actions import export as export
    from bemt.tools.flight.actions import fly as fly

_OBJECTS = {
    "Answer": "bemt.judge.diagnose.ask", "Dataset": "bemt.physics.dataset", "InputError": "bemt.base.errors",
    "Propeller": "bemt.rotors.propeller", "load": "bemt.rotors.propeller", "propeller": "bemt.rotors.propeller",
    "read": "bemt.data.actions",
}  # fmt: skip
"""Classes, and what makes them; every other name is an action, which is a command, too."""


def _homes() -> dict[str, str]:
    """Where each public name is, ``module:name``."""
    from bemt.app import registry

    actions = {where.rpartition(":")[2]: where for where in registry.homes().values()}
    return actions | {name: f"{module}:{name}" for name, module in _OBJECTS.items()}


def __getattr__(name: str) -> Any:
    """Load a name of the public API on first use."""
    if name == "__all__":
        return sorted(_homes())
    if name.startswith("__"):
        raise AttributeError(name)
    found = _homes()
    if name not in found:
        from bemt.base.action import did_you_mean

        near = did_you_mean(name, found) or f" It offers {', '.join(sorted(found))}."
        raise AttributeError(f"module 'bemt' has no attribute {name!r}.{near}")
    from bemt.base.plugins import load

    return load(found[name])


def __dir__() -> list[str]:
    return sorted(["__version__", *_homes()])

"""Every action by the name of its command: those of the house, and those that tools offer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bemt.base.plugins import load, offered

_HOME = {
    "estimate": "bemt.rotors", "new": "bemt.rotors", "stations": "bemt.rotors", "cite": "bemt.rotors",
    "validate": "bemt.rotors", "calibrate": "bemt.rotors", "fetch": "bemt.data", "diagnose": "bemt.judge",
    "compare": "bemt.judge", "plan": "bemt.judge", "calibrate-rotor": "bemt.judge", "prove": "bemt.judge",
    "sweep": "bemt.results", "report": "bemt.results", "effects": "bemt.results", "ui": "bemt.app",
    "completion": "bemt.app",
}  # fmt: skip
ORDER = (
    "new", "estimate", "drive", "choose", "design", "sweep", "report", "import", "diagnose", "compare", "fly", "export",
    "cfd", "ui",
)  # fmt: skip
"""Commands of ``bemt --help``; the others stand under ``bemt lab``."""


def homes() -> dict[str, str]:
    """Where each action is, ``module:function``, by the name of its command."""
    own = {name: f"{wing}.actions:{name.replace('-', '_')}" for name, wing in _HOME.items()}
    own |= {"import": "bemt.judge.import_files:import_", "rotors": "bemt.rotors.actions:measured_rotors"}
    return own | {name.replace("_", "-"): where for name, where in offered("ACTIONS").items()}


def find(name: str) -> Callable[..., Any]:
    """Action of a command; KeyError where there is none."""
    found: Callable[..., Any] = load(homes()[name])
    return found


def python_name(command: str) -> str:
    """Name of an action in the library, that of its function.

    >>> python_name("calibrate-rotor"), python_name("import"), python_name("rotors")
    ('calibrate_rotor', 'import_', 'measured_rotors')
    """
    return homes()[command].rpartition(":")[2]

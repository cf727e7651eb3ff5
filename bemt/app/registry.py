"""Every action by the name of its command: those of the house, and those that tools offer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

from bemt.base.plugins import load, offered

# Options of version 0.3 that have another name now: they answer for this version, and a line names the new one.

COMMANDS = {"data": "fetch"}
"""Old command to the new one."""
EVERYWHERE = {
    "--airspeed": "--airspeed-m-s", "--density": "--density-kg-m3", "--angle": "--angle-deg", "--mass": "--mass-kg",
    "--capacity": "--capacity-Ah", "--thrust": "--thrust-N", "--static-thrust": "--static-thrust-N",
    "--hover-time": "--minutes", "--force": "--force-N", "--moment": "--moment-Nm", "--tolerance": "--tolerance-pct",
    "--repeatability": "--repeatability-pct", "--period": "--period-s", "--dir": "--out", "--from": "--source",
    "--compressible": "--solver compressible", "--incompressible": "--solver incompressible", "--plan": "",
    "--polar": "--reynolds", "--point": "--points",
    "--csv": "--out-csv", "--healthy-mass": "--healthy-mass-kg", "--out": "--picture",
}  # fmt: skip
"""Old option to the new words; nothing where the value is a bare word now."""


def renamed(command: str, argv: Sequence[str], known: Collection[str], say: Callable[[str], None]) -> list[str]:
    """Words of a command with today's options.

    >>> told = []
    >>> renamed("estimate", ["10x5", "--airspeed=5"], {"--airspeed-m-s"}, told.append), told
    (['10x5', '--airspeed-m-s', '5'], ['estimate: --airspeed is now --airspeed-m-s'])
    """
    out: list[str] = []
    for k, word in enumerate(argv):
        if k and argv[k - 1] == "--polar":
            word = word.removeprefix("fixed:")
        name, mark, value = word.partition("=")
        new = None if name in known else EVERYWHERE.get(name)
        if new is None:
            out.append(word)
            continue
        say(f"{command}: {name} is now {new or 'a word without an option'}")
        out += new.split() + ([value.removeprefix("fixed:")] if mark else [])
    return out


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

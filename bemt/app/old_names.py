"""Options of version 0.3 that have another name now: they answer for this version, and a line names the new one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

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

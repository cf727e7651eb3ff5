"""Every action by the name of its command: those of the house, and those that tools offer."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from bemt.base.plugins import load, offered

# What a terminal shows: progress in one line of stderr, and colour for verdicts, warnings and refusals.

GREEN, YELLOW, RED = "32", "33", "31"
SAID = (
    (GREEN, r"^verdict: (?:named|none)\b.*"),
    (YELLOW, r"^verdict: .*"),
    (GREEN, r"(?<=  )agrees$"),
    (YELLOW, r"(?<=  )(?:differs|u > \S+)$"),
    (RED, r"^ *! error\b:?"),
    (YELLOW, r"^ *! (?:warning\b:?)?"),
)
"""Colour and the part of an output line that gets it; the first match wins."""
REFUSED = ((YELLOW, r"^\S*[Ww]arning: "), (RED, r"^.*?: (?=got )|^.*?: error: |^internal error.*|^interrupted$"))
"""The same for stderr."""

SILENT_S = 5.0
"""Time after which work is long: declared [s]."""


@contextmanager
def progress(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Give a function that shows a line; does nothing if quiet.

    A line that ends with a line feed stays, on every stream. Where stderr is no terminal, which takes lines back, the
    others show only that long work goes on: after `SILENT_S`, then ever more rarely.
    """
    shown = sys.stderr.isatty() and not quiet
    width = shutil.get_terminal_size().columns - 1  # a wrapped line could not be taken back
    last, done = "working", threading.Event()

    def say(line: str) -> None:
        nonlocal last
        if line.endswith("\n"):
            complain(("\r\x1b[2K" if shown else "") + line.rstrip("\n"))
            return
        last = line
        if shown:
            sys.stderr.write(f"\r\x1b[2K{line[:width]}")
            sys.stderr.flush()

    def live() -> None:
        pause = SILENT_S
        while not done.wait(pause):
            complain(f"{last} ...")
            pause *= 2.0

    if not shown and not quiet:
        threading.Thread(target=live, daemon=True).start()
    try:
        yield say
    finally:
        done.set()
        if shown:
            sys.stderr.write("\r\x1b[2K")
            sys.stderr.flush()


def complain(what: object) -> None:
    """Print one line on stderr."""
    print(what, file=sys.stderr, flush=True)


def folded(text: str, width: int) -> str:
    r"""Text with sentences folded at a width, at the indent of their line; tables are left as they are.

    >>> print(folded("  one sentence that is too long\na   table   of   cells   stays", 20))
      one sentence that
        is too long
    a   table   of   cells   stays
    """
    out = []
    for line in text.split("\n"):
        indent = len(line) - len(line.lstrip(" "))
        if len(line) > width > indent + 20 and "  " not in line[indent:] and "\r" not in line:  # no line of progress
            first, more = " " * indent, " " * (indent + 2)
            out += textwrap.wrap(
                line.strip(), width, initial_indent=first, subsequent_indent=more, break_long_words=False,
                break_on_hyphens=False,
            )  # fmt: skip
        else:
            out.append(line)
    return "\n".join(out)


class _Painted:
    """Stream of a terminal: folds sentences at its width, and colours what the patterns match."""

    def __init__(self, stream: Any, patterns: tuple[tuple[str, str], ...]) -> None:
        self._stream, self._colours = stream, [colour for colour, _ in patterns]
        self._any = re.compile("|".join(f"({pattern})" for _, pattern in patterns), re.M)

    def write(self, text: str) -> int:
        """Write, folded and coloured."""
        if self._colours:  # first, for a fold could split what a pattern matches
            text = self._any.sub(lambda f: f"\x1b[{self._colours[(f.lastindex or 1) - 1]}m{f[0]}\x1b[0m", text)
        self._stream.write(folded(text, shutil.get_terminal_size().columns))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def coloured() -> Iterator[None]:
    """Fold long lines on a terminal, and colour them unless NO_COLOR is set (https://no-color.org)."""
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    before = sys.stdout, sys.stderr
    try:
        if sys.stdout.isatty():
            sys.stdout = _Painted(sys.stdout, () if plain else SAID)
        if sys.stderr.isatty():
            sys.stderr = _Painted(sys.stderr, () if plain else REFUSED)
        yield
    finally:
        sys.stdout, sys.stderr = before


# Options of version 0.3 that have another name now: they answer for this version, and a line names the new one.

COMMANDS = {"data": "fetch"}
"""Old command to the new one."""
EVERYWHERE = {
    "--airspeed": "--airspeed-m-s", "--density": "--density-kg-m3", "--angle": "--angle-deg", "--mass": "--mass-kg",
    "--capacity": "--capacity-Ah", "--thrust": "--thrust-N", "--static-thrust": "--static-thrust-N",
    "--hover-time": "--minutes", "--force": "--force-N", "--moment": "--moment-Nm", "--tolerance": "--tolerance-pct",
    "--repeatability": "--repeatability-pct", "--period": "--period-s", "--dir": "--out", "--from": "--source",
    "--compressible": "--solver compressible", "--incompressible": "--solver incompressible", "--plan": "",
    "--point": "--points",
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
        if new is None or (new and new.split()[0] not in known):  # another command's
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

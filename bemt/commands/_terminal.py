"""What a terminal shows: progress in one line of stderr, and colour for verdicts, warnings and refusals."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

WIDTH = 110
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


@contextmanager
def progress(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Give a function that shows a line; does nothing if quiet, or if stderr is not a terminal."""
    shown = sys.stderr.isatty() and not quiet

    def say(line: str) -> None:
        if shown:
            sys.stderr.write(f"\r\x1b[2K{line[:WIDTH]}")
            sys.stderr.flush()

    try:
        yield say
    finally:
        if shown:
            sys.stderr.write("\r\x1b[2K")
            sys.stderr.flush()


def complain(what: object) -> None:
    """Print one line on stderr."""
    print(what, file=sys.stderr, flush=True)


def called() -> str:
    """How the user called this program."""
    name = os.path.basename(sys.argv[0] if sys.argv else "").removesuffix(".exe")
    return "bemt" if name == "bemt" else "python -m bemt"


class _Painted:
    """Stream that colours what the patterns match."""

    def __init__(self, stream: Any, patterns: tuple[tuple[str, str], ...]) -> None:
        self._stream, self._colours = stream, [colour for colour, _ in patterns]
        self._any = re.compile("|".join(f"({pattern})" for _, pattern in patterns), re.M)

    def write(self, text: str) -> int:
        """Write, coloured."""
        self._stream.write(
            self._any.sub(lambda found: f"\x1b[{self._colours[(found.lastindex or 1) - 1]}m{found[0]}\x1b[0m", text)
        )
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def coloured() -> Iterator[None]:
    """Colour stdout and stderr on a terminal, unless NO_COLOR is set (https://no-color.org)."""
    plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
    before = sys.stdout, sys.stderr
    try:
        if not plain and sys.stdout.isatty():
            sys.stdout = _Painted(sys.stdout, SAID)
        if not plain and sys.stderr.isatty():
            sys.stderr = _Painted(sys.stderr, REFUSED)
        yield
    finally:
        sys.stdout, sys.stderr = before

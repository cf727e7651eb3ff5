"""What a terminal shows: progress in one line of stderr, and colour for verdicts, warnings and refusals."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

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
    """Give a function that shows a line; does nothing if quiet, or if stderr is not a terminal.

    A line that ends with a line feed stays, on every stream.
    """
    shown = sys.stderr.isatty() and not quiet
    width = shutil.get_terminal_size().columns - 1  # a wrapped line could not be taken back

    def say(line: str) -> None:
        if line.endswith("\n"):
            complain(("\r\x1b[2K" if shown else "") + line.rstrip("\n"))
        elif shown:
            sys.stderr.write(f"\r\x1b[2K{line[:width]}")
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

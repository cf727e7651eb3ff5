"""Progress on stderr: one line, written over and wiped at the end."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

WIDTH = 110


@contextmanager
def progress(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Give a function that shows a line; it does nothing when told to be quiet or when nobody watches."""
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
    """Print one line of trouble on stderr."""
    print(what, file=sys.stderr, flush=True)


def called() -> str:
    """How the user called this program."""
    name = os.path.basename(sys.argv[0] if sys.argv else "").removesuffix(".exe")
    return "bemt" if name == "bemt" else "python -m bemt"

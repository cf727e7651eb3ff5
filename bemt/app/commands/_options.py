"""Options shared by several subcommands, and their types."""

from __future__ import annotations

import argparse
from contextlib import suppress
from typing import Any

# Options with several values: `--case A B` and `--case A --case B` are equivalent; no value is dropped silently.
MANY: dict[str, Any] = {"action": "extend", "nargs": "+"}
REPEATABLE: dict[str, Any] = {"action": "append", "default": []}


def not_negative(text: str) -> float:
    """Finite number of 0 or more."""
    with suppress(ValueError):
        if 0.0 <= float(text) < float("inf"):
            return float(text)
    raise argparse.ArgumentTypeError(f"got {text}; expected a finite number of 0 or more")


def seed(text: str) -> int:
    """Whole number of 0 or more."""
    with suppress(ValueError):
        if int(text) >= 0:
            return int(text)
    raise argparse.ArgumentTypeError(f"got {text}; expected a whole number of 0 or more")


def is_case(path: str) -> bool:
    """Whether a path is a case: case.toml, or a folder with it or with folders of it."""
    from pathlib import Path

    file = Path(path)
    if file.is_dir():
        return (file / "case.toml").is_file() or any(file.glob("*/case.toml"))
    return file.name == "case.toml" or (file.suffix == ".toml" and file.is_file() and b"[rotor]" in file.read_bytes())


def sorted_out(cases: list[str], recordings: list[str]) -> tuple[list[str], list[str]]:
    """Cases and recordings of words that stand in any order: an existing file among the cases that is none is a
    recording, and a case among the recordings is a case.
    """
    from pathlib import Path

    stray = [w for w in cases if Path(w).exists() and not is_case(w)]
    moved = [w for w in recordings if is_case(w)]
    return [*(w for w in cases if w not in stray), *moved], [*(w for w in recordings if w not in moved), *stray]


def positive(text: str) -> int:
    """Whole number of 1 or more."""
    with suppress(ValueError):
        if int(text) >= 1:
            return int(text)
    raise argparse.ArgumentTypeError(f"got {text}; expected a whole number of 1 or more")


def add_json(parser: Any, schema: str) -> None:
    """Add ``--json``, which prints one document."""
    parser.add_argument("--json", action="store_true", help=f"print one JSON document ({schema})")


def add_quiet(parser: argparse.ArgumentParser, what: str = "neither progress nor tables") -> None:
    """Add ``--quiet``."""
    parser.add_argument("--quiet", action="store_true", help=f"print {what}")


def add_cases(parser: argparse.ArgumentParser) -> None:
    """Add the cases to solve."""
    what = "case files, or folders of <name>/case.toml (default: this folder)"
    parser.add_argument("paths", nargs="*", default=["."], metavar="CASES", help=what)


def add_motor(parser: argparse.ArgumentParser) -> None:
    """Add the motor and battery that a label tells."""
    kv = "speed constant of the motor [rev/min/V]"
    parser.add_argument("--kv", type=float, metavar="KV", help=kv)
    parser.add_argument("--cells", type=positive, metavar="S", help="LiPo cells in series, with --kv")

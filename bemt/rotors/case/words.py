"""Words that may be cases or recordings, in any order."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any


def is_case(path: str) -> bool:
    """Whether a path is a case: case.toml, or a folder with it or with folders of it."""
    file = Path(path)
    if file.is_dir():
        return (file / "case.toml").is_file() or any(file.glob("*/case.toml"))
    return file.name == "case.toml" or (file.suffix == ".toml" and file.is_file() and _of_rotor(file))


def _of_rotor(file: Path) -> bool:
    """Whether a TOML file describes a rotor, and not what was recorded of one."""
    text = file.read_text(encoding="utf-8", errors="replace")
    try:
        keys = set(tomllib.loads(text))
    except tomllib.TOMLDecodeError:  # said where it is read
        keys = set(re.findall(r"^\s*\[*(\w+)", text, re.MULTILINE))
    return "rotor" in keys and not {"recording", "run", "grids"} & keys


def sorted_out(cases: list[Any], recordings: list[Any]) -> tuple[list[Any], list[Any]]:
    """Cases and recordings of words that stand in any order: an existing file among the cases that is none is a
    recording, and a case among the recordings is a case.
    """
    stray = [w for w in cases if isinstance(w, str) and Path(w).exists() and not is_case(w)]
    moved = [w for w in recordings if isinstance(w, str) and is_case(w)]
    return (
        [*(w for w in cases if not _among(w, stray)), *moved],
        [*(w for w in recordings if not _among(w, moved)), *stray],
    )


def _among(one: Any, words: list[str]) -> bool:
    return isinstance(one, str) and one in words

"""Files that somebody else wrote into the folder of the results: read with limits, nothing outside of it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

FIGURE_BYTES = 600_000
FIGURES = 12
JSON_BYTES = 20_000_000
_FIGURE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}\.(png|svg)")


def read_json(path: Path) -> Any:
    """Read a JSON file that somebody else wrote."""
    try:
        if path.stat().st_size > JSON_BYTES:
            return None
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=lambda name: None)
    except (OSError, ValueError, RecursionError):
        return None


def safe_files(folder: Path) -> list[tuple[str, bytes]]:
    """Figures in a folder: plain names, no links, PNG or SVG by content, of a moderate size.

    Of two pictures with one stem the smaller is taken.
    """
    found: dict[str, tuple[str, bytes]] = {}
    for path in sorted(folder.glob("*")):
        if not _FIGURE.fullmatch(path.name) or path.is_symlink() or not path.is_file():
            continue
        if path.stat().st_size > FIGURE_BYTES:
            continue
        data = path.read_bytes()
        good = data.startswith(b"\x89PNG\r\n") if path.suffix == ".png" else b"<svg" in data[:1000]
        if good and (path.stem not in found or len(data) < len(found[path.stem][1])):
            found[path.stem] = (path.name, data)
    return list(found.values())[:FIGURES]

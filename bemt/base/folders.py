"""Where published data are found, and whether a name stays in its folder."""

from __future__ import annotations

import os
from pathlib import Path

from bemt.base.cache import cache_dir


def data_roots() -> list[Path]:
    """Folders that may hold databases, first to last."""
    named = os.environ.get("BEMT_DATA")
    first = Path(named).expanduser() if named else Path(__file__).resolve().parents[3] / "shared" / "data"
    cache = cache_dir()
    return [first] if cache is None else [first, cache / "data"]


def find_data(kind: str) -> Path | None:
    """Folder of one database.

    >>> find_data("no such database") is None
    True
    """
    return next((root / kind for root in data_roots() if (root / kind).is_dir()), None)


def inside(folder: Path, name: str) -> bool:
    """Whether a file that a case names lies in its folder, links followed.

    >>> inside(Path("case"), "sections/root.dat"), inside(Path("case"), "../other.dat"), inside(Path("case"), "/etc/x")
    (True, False, False)
    """
    try:
        return (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a loop of links, a name that is none
        return False

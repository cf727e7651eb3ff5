"""Where published data are found: the one place that knows."""

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

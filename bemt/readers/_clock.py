"""Columns of clock times, as loggers on a computer write them: seconds since the first one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_CLOCK = re.compile(r"(?:(\d{4})-(\d\d)-(\d\d)[ T])?(\d{1,2}):(\d\d):(\d\d)(?:\.(\d+))?(?:Z|[+-]\d\d:?\d\d)?")
DAY = 86400.0


def clock_seconds(cells: Sequence[str]) -> Array | None:
    """Read ``12:30:05.25`` or ``2024-05-01T12:30:05``; other orders of day and month are ambiguous and stay text, (N,)
    [s].

    >>> clock_seconds(["23:59:59.5", "", "00:00:01.0"]), clock_seconds(["1:2", "x"]) is None
    (array([0. , nan, 1.5]), True)
    """
    out = np.full(len(cells), np.nan)
    dated: set[bool] = set()
    for i, cell in enumerate(cells):
        if not cell:
            continue
        match = _CLOCK.fullmatch(cell)
        if match is None:
            return None
        year, month, day, hour, minute, second = (int(part or 0) for part in match.groups()[:6])
        dated.add(bool(match[1]))
        try:
            date = datetime(year, month, day) if match[1] else datetime(2000, 1, 1)
        except ValueError:
            return None
        if hour > 23 or minute > 59 or second > 60:
            return None
        at = date - datetime(2000, 1, 1) + timedelta(hours=hour, minutes=minute, seconds=second)
        out[i] = at.total_seconds() + float(f"0.{match[7] or 0}")
    known = np.flatnonzero(np.isfinite(out))
    if not known.size or len(dated) > 1:
        return None
    if not dated.pop():
        out[known[1:]] += DAY * np.cumsum(np.diff(out[known]) < -0.5 * DAY)
    out -= out[known[0]]
    return out

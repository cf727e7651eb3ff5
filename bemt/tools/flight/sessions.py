"""Which healthy flights belong to one session, and whether the judged flight does: as stated, or by date.

A battery taken out and put back, or a propeller exchanged, moves the trim; within a session it stays.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bemt.tools.flight.log import FlightLog

__all__ = ["Sessions", "sessions"]

_DATE = re.compile(r"(?<!\d)(20\d\d)[-_.]?(0?[1-9]|1[0-2])[-_.]?(0?[1-9]|[12]\d|3[01])(?!\d)")


@dataclass(frozen=True)
class Sessions:
    """Session of each flight."""

    days: tuple[int, ...]  # Of the healthy flights, numbered
    day: int | None | str  # Of the judged one; None: another; empty: nobody knows
    by: str  # What tells: "stated", "date", or empty where nothing does


def sessions(flight: FlightLog, healthy: Sequence[FlightLog], stated: Sequence[str] = (), day: str = "") -> Sessions:
    """Group healthy flights, and place the judged one.

    Parameters
    ----------
    flight, healthy : FlightLog and sequence of FlightLog
        The judged flight and the healthy ones.
    stated : sequence of str
        Session of each healthy flight as the user groups them; empty for none, then dates tell where all have one.
    day : str
        "same": the judged flight is of the last session; "other": of none; or a session of `stated`; empty where the
        user does not say: then its date tells.
    """
    dates, mine = [_date(h) for h in healthy], ""
    if len(stated) == len(healthy) and len(set(stated)) > 1:
        labels, by = list(stated), "stated"
    elif healthy and all(dates):
        labels, by, mine = dates, "date", _date(flight)
    else:
        labels, by = list(stated) if len(stated) == len(healthy) else [""] * len(healthy), ""
    names = list(dict.fromkeys(labels))
    days = tuple(names.index(x) for x in labels)
    if day == "same" and days:
        return Sessions(days, days[-1], by or "stated")
    if day and day in names:
        return Sessions(days, names.index(day), by or "stated")
    if day == "other" or (mine and mine not in names):
        return Sessions(days, None, by or "stated")
    return Sessions(days, names.index(mine) if mine else "", by)


def _date(log: FlightLog) -> str:
    """Day by the log, or by the name of the file or its folder."""
    if log.date:
        return log.date
    path = Path(log.file)
    found = _DATE.search(path.name) or _DATE.search(path.parent.name)
    return f"{found[1]}-{int(found[2]):02}-{int(found[3]):02}" if found else ""

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


def sessions(
    flight: FlightLog, healthy: Sequence[FlightLog], stated: Sequence[str] = (), day: str | None = ""
) -> Sessions:
    """Group healthy flights, and place the judged one.

    Parameters
    ----------
    flight, healthy : FlightLog and sequence of FlightLog
        The judged flight and the healthy ones.
    stated : sequence of str
        Session of each healthy flight as the user groups them; empty for none, then dates tell where all have one.
    day : str or None
        Session of the judged flight; None: another than all; empty where the user does not say, then its date does.
    """
    dates = [_date(h) for h in healthy]
    if len(stated) == len(healthy) and (len(set(stated)) > 1 or day != ""):
        labels, mine, by = list(stated), day, "stated"
    elif healthy and all(dates):
        labels, by = dates, "date"
        mine = day if day is None else (dates[-1] if day else _date(flight))
    else:
        labels, by, mine = [""] * len(healthy), "" if day == "" else "stated", None if day is None else ""
    names = list(dict.fromkeys(labels))
    if mine is None or (mine and mine not in names):
        return Sessions(tuple(names.index(x) for x in labels), None, by)
    return Sessions(tuple(names.index(x) for x in labels), names.index(mine) if mine else "", by)


def _date(log: FlightLog) -> str:
    """Day by the log, or by the name of the file or its folder."""
    if log.date:
        return log.date
    path = Path(log.file)
    found = _DATE.search(path.name) or _DATE.search(path.parent.name)
    return f"{found[1]}-{int(found[2]):02}-{int(found[3]):02}" if found else ""

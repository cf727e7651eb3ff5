"""The reader of a flight log, by its content."""

from __future__ import annotations

import os
from pathlib import Path

from bemt.base.errors import Fault, InputError, system_fault
from bemt.tools.flight import ardupilot, crazyflie, px4, table
from bemt.tools.flight.log import FlightLog

_READERS = (crazyflie, px4, ardupilot, table)


def read_log(path: str | os.PathLike[str]) -> FlightLog:
    """Read a flight log by its content: Crazyflie, PX4 ULog, ArduPilot DataFlash, Betaflight or other CSV.

    InputError for a file that is no flight log, or damaged before its first twenty samples.
    """
    if Path(path).is_dir():
        raise InputError(Fault(os.fspath(path), "", "a folder", "one flight log", "Name the file in it"))
    try:
        with Path(path).open("rb") as file:
            head = file.read(4096)
        reader = next((r for r in _READERS if r.sniff(head)), None)
        if reader is None:
            raise InputError(Fault(os.fspath(path), "", "unknown first bytes", "a usdlog, ULog, DataFlash or CSV"))
        found: FlightLog = reader.read(Path(path))
        return found
    except OSError as error:
        raise InputError(system_fault(error)) from error

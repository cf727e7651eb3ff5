"""The reader of a flight log, by its content."""

from __future__ import annotations

import contextlib
import os
import tempfile
import zlib
from dataclasses import replace
from pathlib import Path

from bemt.base.errors import Fault, InputError, system_fault
from bemt.base.packed import GZIP, gunzip_stream
from bemt.tools.flight import ardupilot, crazyflie, px4, table
from bemt.tools.flight.log import FlightLog

_READERS = (crazyflie, px4, ardupilot, table)
_BETAFLIGHT = b"H Product:Blackbox"


def read_log(path: str | os.PathLike[str]) -> FlightLog:
    """Read a flight log by its content, gzipped or not.

    Crazyflie, PX4 ULog, ArduPilot DataFlash, Betaflight or other CSV. InputError for a file that is no flight log,
    damaged before its first twenty samples, or larger than :data:`bemt.base.packed.MAX_BYTES` once
    unpacked.
    """
    name = os.fspath(path)
    if Path(path).is_dir():
        raise InputError(Fault(name, "", "a folder", "one flight log", "Name the file in it"))
    try:
        with Path(path).open("rb") as file:
            head = file.read(4096)
        if head[:2] != GZIP:
            return _read(Path(path), head)
        with tempfile.TemporaryDirectory() as folder:
            inside = Path(folder) / "log"
            with Path(path).open("rb") as file, inside.open("wb") as out:
                damage = gunzip_stream(file, out, name)
            with inside.open("rb") as file:
                head = file.read(4096)
            try:
                found = _read(inside, head)
            except InputError as error:
                raise InputError([replace(f, file=name) for f in error.faults]) from error
        ends = f"damaged gzip ({damage}); read as far as it goes" if damage else found.ends
        return replace(found, file=name, ends=ends)
    except OSError as error:
        raise InputError(system_fault(error)) from error


def kind_of(path: str | os.PathLike[str]) -> str:
    """Format of a file that only this tool reads (ULog, DataFlash, Betaflight, packed or not); empty for others.

    So that whoever meets such a file can hand it over.
    """
    try:
        with Path(path).open("rb") as file:
            head = file.read(1 << 16)
    except OSError:
        return ""
    if head[:2] == GZIP:
        with contextlib.suppress(zlib.error):
            head = zlib.decompressobj(31).decompress(head, 4096)
    if head.startswith(_BETAFLIGHT):
        return "Betaflight blackbox"
    if all(word in head for word in table.BETAFLIGHT):
        return "Betaflight log as CSV"
    return next((r.KIND for r in (px4, ardupilot) if r.sniff(head)), "")


def _read(path: Path, head: bytes) -> FlightLog:
    if head.startswith(_BETAFLIGHT):
        hint = f"Decode it: blackbox_decode {path.name} (or Blackbox Explorer, Export CSV), then fly the CSV"
        raise InputError(Fault(str(path), "", "a Betaflight log as the flight controller packs it", "its CSV", hint))
    reader = next((r for r in _READERS if r.sniff(head)), None)
    if reader is None:
        raise InputError(Fault(str(path), "", "unknown first bytes", "a usdlog, ULog, DataFlash or CSV"))
    try:
        found: FlightLog = reader.read(path)
    except InputError as error:
        named = _NAMED.get(path.suffix.lower())
        if reader is not table or named is None:
            raise
        hint = "Is it the file that the autopilot wrote? Download it again"
        got = f"first bytes that no {named.KIND} has"
        raise InputError(Fault(str(path), "", got, f"a {named.KIND}, as its name says", hint)) from error
    return found


_NAMED = {".ulg": px4, ".ulog": px4, ".bin": ardupilot}
"""Readers of names that only their files have."""

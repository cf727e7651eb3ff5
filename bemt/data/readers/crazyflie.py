"""Crazyflie: flight logs, the binary files of its micro-SD card (``.usdlog``); its bench is among the stands.

Magic 0xBC, version, number of event types, their names and variables with a type letter, then records: id (u16), time
(us; version 1: u32, version 2: u64), packed little-endian values; the last four bytes are a CRC32 of all
before (Bitcraze, crazyflie-firmware, tools/usdlog/cfusdlog.py). The four speeds are joined to their root mean square,
since thrust goes with the square. No thrust is measured in flight: accelerations are kept, the mass is the user's.
"""

from __future__ import annotations

import hashlib
import os
import re
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.packed import unpacked
from bemt.base.toml_text import Collector
from bemt.base.units import G0
from bemt.data.readers import Reader, load_bytes
from bemt.data.readers.samples import Channel, dataset
from bemt.physics.dataset import Dataset

CRAZYFLIE_LOG = "crazyflie_log"
MAGIC = 0xBC
_TIMES = {1: struct.Struct("<HI"), 2: struct.Struct("<HQ")}
_LETTERS = dict(zip("bBhHiIlLqQefd", "i1 u1 <i2 <u2 <i4 <u4 <i4 <u4 <i8 <u8 <f2 <f4 <f8".split(), strict=True))
_UNITS = {
    "stateEstimate.x": ("x_m", 1.0), "stateEstimate.y": ("y_m", 1.0), "stateEstimate.z": ("height_m", 1.0),
    "stateEstimate.vx": ("velocity_x_m_s", 1.0), "stateEstimate.vy": ("velocity_y_m_s", 1.0),
    "stateEstimate.vz": ("velocity_z_m_s", 1.0), "acc.x": ("acceleration_x_m_s2", G0),
    "acc.y": ("acceleration_y_m_s2", G0), "acc.z": ("acceleration_z_m_s2", G0), "pm.vbatMV": ("voltage_V", 1e-3),
    "pm.vbat": ("voltage_V", 1.0),
}  # fmt: skip
_SPEED, _COMMAND = re.compile(r"rpm\.m[1-4]"), re.compile(r"pwm\.m[1-4]_pwm|motor\.m[1-4]")


def sniff_crazyflie_log(head: bytes | str) -> bool:
    """Tell whether the first bytes are those of such a log."""
    if isinstance(head, str) or len(head) < 5 or head[0] != MAGIC:
        return False
    version, events = struct.unpack_from("<HH", head, 1)
    return version in _TIMES and 0 < events < 1000


def read_crazyflie_log(path: str | os.PathLike[str]) -> Dataset:
    """Read a log."""
    raw, log = load_bytes(path), Collector(os.fspath(path))
    data = unpacked(raw, log.file)
    if not sniff_crazyflie_log(data):
        log.refuse("", "other first bytes", "a Crazyflie log, which begins with 0xBC")
    if zlib.crc32(data[:-4]) != struct.unpack("<I", data[-4:])[0]:
        log.refuse("", "a wrong checksum", "the CRC32 of all bytes before it", "Copy the file again")
    try:
        tables, _ = log_tables(data[:-4])
    except (struct.error, KeyError, ValueError, UnicodeDecodeError) as error:
        log.refuse("", f"a damaged log ({error})", "whole records", "Copy the file again")
    tables = {k: v for k, v in tables.items() if v["time_s"].size > 1}
    if not tables:
        log.refuse("", "no records", "two or more")
    return _made(log.file, hashlib.sha256(raw).hexdigest(), tables)


def _text(data: bytes | memoryview, at: int) -> tuple[str, int]:
    text, end, _ = bytes(data[at : at + 256]).partition(b"\0")
    if not end:
        raise ValueError("a name without an end")
    return text.decode("utf-8"), at + len(text) + 1


def log_tables(data: bytes | memoryview, partly: bool = False) -> tuple[dict[str, dict[str, NDArray[Any]]], int]:
    """Event to variable to (N,) values in the units and type of the log, and the place at which reading ended.

    `data` is the file without its checksum; `time_s` is in seconds of the log's clock. `partly`: keep what stands
    before a damaged record instead of raising.
    """
    version, events = struct.unpack_from("<HH", data, 1)
    at, known, stamp = 5, {}, _TIMES[version]
    for _ in range(events):
        (number,) = struct.unpack_from("<H", data, at)
        name, at = _text(data, at + 2)
        (count,) = struct.unpack_from("<H", data, at)
        at += 2
        names, form = [], ""
        for _ in range(count):
            variable, at = _text(data, at)
            if variable[-2] not in _LETTERS:
                raise ValueError(f"type {variable[-2]!r}")
            names.append(variable[:-3])
            form += variable[-2]
        row = np.dtype([("", _LETTERS[c]) for c in "H" + stamp.format[-1] + form])
        known[number] = (name, names, row, bytearray())
    while at < len(data):
        try:
            _, _, row, rows = known[stamp.unpack_from(data, at)[0]]
        except (struct.error, KeyError):
            if not partly:
                raise
            break
        if at + row.itemsize > len(data):
            if not partly:
                raise ValueError("the last record is cut")
            break
        rows += data[at : at + row.itemsize]
        at += row.itemsize
    out = {}
    for name, names, row, rows in known.values():
        table = np.frombuffer(rows, dtype=row)
        time, *values = list(table.dtype.names or ())[1:]
        out[name] = {"time_s": 1e-6 * table[time]} | {n: table[v] for n, v in zip(names, values, strict=True)}
    return out, at


def _made(name: str, sha256: str, tables: dict[str, dict[str, NDArray[Any]]]) -> Dataset:
    main = max(tables, key=lambda k: tables[k]["time_s"].size)
    t = tables[main]["time_s"]
    columns: dict[str, NDArray[np.float64]] = {}
    for table in tables.values():
        for key, v in table.items():
            if key != "time_s":
                same = table is tables[main]
                columns.setdefault(key, v.astype(float) if same else np.interp(t, table["time_s"], v))
    channels = {"time_s": Channel(t - t[0], "s")}
    for key, v in columns.items():
        if key in _UNITS:
            label, factor = _UNITS[key]
            unit = "m/s2" if label.endswith("_s2") else "m/s" if label.endswith("_s") else label.rsplit("_", 1)[1]
            channels[label] = Channel(v * factor, unit)
    warnings = [f"event {main} with {t.size} records; others are interpolated to its times"] if len(tables) > 1 else []
    speeds = [v for key, v in columns.items() if _SPEED.fullmatch(key)]
    if len(speeds) == 4:
        channels["rpm"] = Channel(np.sqrt(np.mean(np.square(speeds), axis=0)), "rpm")
        warnings.append("rpm is the root mean square of four propellers")
    commands = [v for key, v in columns.items() if _COMMAND.fullmatch(key)][:4]
    if len(commands) == 4:
        channels["throttle"] = Channel(np.mean(commands, axis=0) / 65535.0, "-")
    text = "a flight: no thrust is measured; mass times acceleration gives it, and the mass is not in the file"
    warnings.append(text)
    said = {"file": name, "sha256": sha256}
    return dataset(CRAZYFLIE_LOG, "flight", channels, warnings, said)


READERS = (Reader(CRAZYFLIE_LOG, sniff_crazyflie_log, read_crazyflie_log),)

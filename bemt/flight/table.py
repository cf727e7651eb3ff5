"""Flights as CSV, plain or gzipped: Betaflight blackbox, variables of a Crazyflie, arrays in cells (t, v, R, pwm, fa).

Betaflight (blackbox_decode): time in us, motor[i] 1000 to 2000 or DShot, eRPM[i] in hundreds of electrical rev/min,
accSmooth counts, vbatLatest in V. Mechanical speed needs the pole count, so eRPM is used only with motor_poles.
"""

from __future__ import annotations

import gzip
import io
import json
import re
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.flight import crazyflie
from bemt.flight.log import FlightLog, joined

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
KIND = "CSV"


def sniff(head: bytes) -> bool:
    """Whether it is gzip or begins as text."""
    return head[:2] == b"\x1f\x8b" or (bool(head) and b"\0" not in head)


def read(path: Path) -> FlightLog:
    """Read a table; its headings decide what it is."""
    import pandas as pd

    name, raw, ends = str(path), path.read_bytes(), ""
    if raw[:2] == b"\x1f\x8b":
        try:
            raw = gzip.decompress(raw)
        except (OSError, EOFError, zlib.error):
            raw, ends = _partly(raw), "damaged gzip; read as far as it goes"
    lines = raw.decode("utf-8", errors="replace").splitlines()
    start = next((k for k, line in enumerate(lines[:400]) if re.search(r"\btime\b|\bt\b|\bt_s\b|loopIteration", line)
                  and re.search(r"motor|pwm|rpm", line)), None)  # fmt: skip
    if start is None:
        raise InputError(Fault(name, "", "no row of headings with a time and motors", "a flight log"))
    poles = next((int(m.group(1)) for line in lines[:start] if (m := re.search(r"motor_poles\"?,\"?(\d+)", line))), 0)
    try:
        frame = pd.read_csv(io.StringIO("\n".join(lines[start:])), on_bad_lines="skip", low_memory=False)
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(Fault(name, "", f"a damaged table ({error})", "rows of equal length")) from error
    frame.columns = [re.sub(r"\s*\(.*\)$", "", str(c)).strip() for c in frame.columns]
    if {"pwm", "v", "R", "t"} <= set(frame.columns):
        return _cells(name, frame, ends)
    if "t_s" in frame and any(c.startswith(("motor.m", "pwm.m")) for c in frame.columns):
        numbers = frame.apply(pd.to_numeric, errors="coerce").dropna()
        t = numbers["t_s"].to_numpy(float)
        columns = {c: (t, numbers[c].to_numpy(float)) for c in numbers.columns if c != "t_s"}
        return crazyflie.from_columns(name, "Crazyflie CSV", columns, ends)
    if any(c.startswith("motor[") for c in frame.columns):
        return _betaflight(name, frame, poles, ends)
    raise InputError(Fault(name, "", "unknown headings", "Betaflight, Crazyflie, or t, v, R, pwm"))


def _partly(raw: bytes) -> bytes:
    """What of a damaged gzip can be unpacked."""
    stream, out = zlib.decompressobj(31), bytearray()
    try:
        for k in range(0, len(raw), 256):
            out += stream.decompress(raw[k : k + 256])
    except zlib.error:
        pass
    return bytes(out)


def _cells(name: str, frame: pd.DataFrame, ends: str) -> FlightLog:
    """Arrays as JSON in the cells; rows that cannot be read are dropped."""
    keys = [k for k in ("p", "v", "R", "w", "fa", "pwm") if k in frame]
    rows, times = [], []
    shapes: tuple[tuple[int, ...], ...] | None = None
    for t, *cells in zip(frame["t"], *(frame[k] for k in keys), strict=True):
        try:
            row = [np.asarray(json.loads(c), dtype=float) for c in cells]
            shape = tuple(r.shape for r in row)
            shapes = shapes or shape
            if shape == shapes:
                times.append(float(t))
                rows.append(row)
        except (ValueError, TypeError, OverflowError, RecursionError):
            continue
    if not rows:
        raise InputError(Fault(name, "", "no row that can be read", "arrays in the cells"))
    if len(rows) < len(frame):
        ends = ends or f"{len(frame) - len(rows)} damaged rows are left out"
    time = np.array(times)
    got = {k: (time, np.array([r[i] for r in rows])) for i, k in enumerate(keys)}
    wide = {"p": (3,), "v": (3,), "R": (3, 3), "w": (3,), "fa": (3,)}
    for key, (_, v) in got.items():
        if v.shape[1:] != wide.get(key, v.shape[1:]) or (key == "pwm" and v.ndim != 2):
            raise InputError(Fault(name, key, f"arrays of {v.shape[1:]}", "vectors of three, R of 3 x 3, pwm of a row"))
    sources = {
        "command": got["pwm"],
        "rates": got.get("w"),
        "upright": (time, got["R"][1][:, 2, 2]),
        "velocity": got["v"],
        "position": got.get("p"),
        "force": got.get("fa"),
    }
    return joined(name, "CSV of arrays", sources, "command", command_unit="pwm", ends=ends)


def _betaflight(name: str, frame: pd.DataFrame, poles: int, ends: str) -> FlightLog:
    import pandas as pd

    numbers = frame.apply(pd.to_numeric, errors="coerce")
    if "time" not in numbers:
        raise InputError(Fault(name, "time", "no such column", "time in us", "Decode with blackbox_decode"))
    t = 1e-6 * numbers["time"].to_numpy(float)

    def many(stem: str, factor: float = 1.0) -> tuple[Array, Array] | None:
        keys = [c for c in numbers.columns if re.fullmatch(rf"{stem}\[\d+\]", c)]
        return (t, factor * numbers[keys].to_numpy(float)) if keys else None

    volt = next((k for k in ("vbatLatest", "vbat") if k in numbers), "")
    amp = next((k for k in ("amperageLatest", "amperage") if k in numbers), "")
    command = many("motor")
    low, high = (0.0, 1.0) if command is None else (np.nanmin(command[1]), np.nanmax(command[1]))
    unit = "us" if low >= 900.0 and high <= 2100.0 else "DShot"
    sources = {
        "command": command,
        "rpm": many("eRPM", 200.0 / poles) if poles else None,
        "rates": many("gyroADC", np.pi / 180.0),
        "voltage": (t, numbers[volt].to_numpy(float)) if volt else None,
        "battery_current": (t, numbers[amp].to_numpy(float)) if amp else None,
    }
    B = command[1].shape[1] if command else 0
    layout = "betaflight-x" if B == 4 else ""
    return joined(name, "Betaflight CSV", sources, "command", command_unit=unit, layout=layout, ends=ends)

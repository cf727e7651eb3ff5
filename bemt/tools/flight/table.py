"""Flights as CSV, plain or gzipped: Betaflight blackbox, variables of a Crazyflie, arrays in cells (t, v, R, pwm, fa).

Betaflight (blackbox_decode): time in us, motor[i] 1000 to 2000 or DShot, eRPM[i] in hundreds of electrical rev/min,
accSmooth counts, vbatLatest in V. Mechanical speed needs the pole count and acceleration the counts of 1 g: eRPM is
used only with a row motor_poles before the headings, accSmooth with acc_1G.
"""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.packed import gunzip
from bemt.base.units import G0
from bemt.tools.flight import crazyflie
from bemt.tools.flight.log import SPARSE, FlightLog, Stretches, joined

if TYPE_CHECKING:
    import pandas as pd

KIND = "CSV"


def sniff(head: bytes) -> bool:
    """Whether it is gzip or begins as text."""
    return head[:2] == b"\x1f\x8b" or (bool(head) and b"\0" not in head)


_CELLS, _TIMES = ("p", "v", "R", "w", "fa", "pwm"), ("t", "t_s", "time")
_USED = re.compile(r"t|t_s|time|p|v|R|w|fa|pwm|(motor|pwm|rpm|acc|gyro|pm|stateEstimate)\..+|(vbat|amperage)(Latest)?"
                   r"|(motor|eRPM|gyroADC|gyroUnfilt|accSmooth)\[\d+\]")  # fmt: skip
_HEAD_BYTES = 1 << 18  # within which the headings stand
_ROWS = 20_000  # of a piece


def read(path: Path) -> FlightLog:
    """Read a table, in pieces; its headings decide what it is."""
    import pandas as pd

    name, ends = str(path), ""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    source: Path | io.BytesIO = path
    if head[:2] == b"\x1f\x8b":
        raw, damage = gunzip(path.read_bytes(), name)
        ends = f"damaged gzip ({damage}); read as far as it goes" if damage else ""
        source, head = io.BytesIO(raw), raw[:_HEAD_BYTES]
    lines = head.decode("utf-8", errors="replace").split("\n")
    start = next((k for k, line in enumerate(lines[:400]) if re.search(r"\btime\b|\bt\b|\bt_s\b|loopIteration", line)
                  and re.search(r"motor\[|motor\.|pwm|rpm", line)), None)  # fmt: skip
    if start is None:
        raise InputError(Fault(name, "", "no row of headings with a time and motors", "a flight log"))
    said = {m[1]: m[2] for line in lines[:start] if (m := re.match(r'"?(\w+)"?,"?([^"]*)"?\s*$', line))}
    try:
        with path.open("rb") if isinstance(source, Path) else source as rows:
            for _ in range(start):
                rows.readline()
            frame = _frame(rows)
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(Fault(name, "", f"a damaged table ({error})", "rows of equal length")) from error
    if {"pwm", "v", "R", "t"} <= set(frame.columns):
        return _cells(name, frame, ends)
    if "t_s" in frame and any(c.startswith(("motor.m", "pwm.m")) for c in frame.columns):
        numbers = frame.apply(pd.to_numeric, errors="coerce").dropna()
        t = numbers["t_s"].to_numpy(float)
        columns = {c: (t, numbers[c].to_numpy(float)) for c in numbers.columns if c != "t_s"}
        return crazyflie.from_columns(name, "Crazyflie CSV", columns, ends)
    if any(c.startswith("motor[") for c in frame.columns):
        return _betaflight(name, frame, said, ends)
    raise InputError(Fault(name, "", "unknown headings", "Betaflight, Crazyflie, or t, v, R, pwm"))


def _label(heading: str) -> str:
    """Heading without its unit."""
    return re.sub(r"\s*\(.*\)\s*$", "", heading).strip()


def _frame(rows: BinaryIO) -> pd.DataFrame:
    """The columns that are used. Numbers are kept in single precision, times in double."""
    import pandas as pd

    kept: Stretches[pd.DataFrame] = Stretches(lambda piece: piece.iloc[::SPARSE].copy())
    pieces = pd.read_csv(rows, on_bad_lines="skip", encoding_errors="replace", chunksize=_ROWS, low_memory=False,
                         usecols=lambda c: bool(_USED.fullmatch(_label(str(c)))))  # fmt: skip
    for piece in pieces:
        piece.columns = [_label(str(c)) for c in piece.columns]
        for c in piece.columns:
            if c not in _CELLS:
                numbers = pd.to_numeric(piece[c], errors="coerce")
                piece[c] = numbers if c in _TIMES else numbers.astype(np.float32)
        kept.add(piece)
    return pd.concat(kept.parts, ignore_index=True)


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
        "axis": (time, got["R"][1][:, :, 2]),
        "velocity": got["v"],
        "position": got.get("p"),
        "force": got.get("fa"),
    }
    return joined(name, "CSV of arrays", sources, "command", command_unit="pwm", ends=ends)


def _betaflight(name: str, numbers: pd.DataFrame, said: dict[str, str], ends: str) -> FlightLog:
    if "time" not in numbers:
        raise InputError(Fault(name, "time", "no such column", "time in us", "Decode with blackbox_decode"))
    t = 1e-6 * numbers["time"].to_numpy(float)

    def many(stem: str, factor: float = 1.0) -> tuple[Array, Array] | None:
        keys = [c for c in numbers.columns if re.fullmatch(rf"{stem}\[\d+\]", c)]
        return (t, factor * numbers[keys].to_numpy(float)) if keys else None

    volt = next((k for k in ("vbatLatest", "vbat") if k in numbers), "")
    amp = next((k for k in ("amperageLatest", "amperage") if k in numbers), "")
    command, poles, per_g = many("motor"), _number(said.get("motor_poles")), _number(said.get("acc_1G"))
    if command is not None:
        low, high = _range(command[1], said.get("motorOutput", ""))
        command = (t, np.clip((command[1] - low) / (high - low), 0.0, None))
    gyro, unfiltered = many("gyroADC", np.pi / 180.0), many("gyroUnfilt", np.pi / 180.0)
    acceleration = many("accSmooth", G0 / per_g) if per_g > 0.0 else None
    sources = {
        "command": command,
        "rpm": many("eRPM", 200.0 / poles) if poles > 0.0 else None,
        "acceleration": acceleration,
        "rates": gyro,
        "voltage": (t, numbers[volt].to_numpy(float)) if volt else None,
        "battery_current": (t, numbers[amp].to_numpy(float)) if amp else None,
    }
    B = command[1].shape[1] if command else 0
    turned = "-rev" if _number(said.get("yaw_motors_reversed")) else ""
    layout = f"betaflight-x{turned}" if B == 4 else ""
    raw = unfiltered or gyro
    raw = raw if raw is not None and raw[1].shape[1] == 3 else None
    return joined(name, "Betaflight CSV", sources, "command", raw=raw, raw_unit="rad/s", layout=layout, ends=ends)


def _number(text: str | None) -> float:
    try:
        value = float(text or 0.0)
    except ValueError:
        return 0.0
    return value if np.isfinite(value) else 0.0


def _range(command: Array, stated: str) -> tuple[float, float]:
    """Commands at rest and at full drive: as the header says, or 1000 to 2000 us, or DShot's 48 to 2047."""
    parts = [_number(p) for p in stated.split(",")]
    if len(parts) == 2 and parts[1] - parts[0] >= 100.0:
        return parts[0], parts[1]
    found = command[np.isfinite(command)]
    pulses = found.size and found.min() >= 900.0 and found.max() <= 2100.0
    return (1000.0, 2000.0) if pulses else (48.0, 2047.0)

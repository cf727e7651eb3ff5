"""Flights as CSV, plain or gzipped: Betaflight blackbox, variables of a Crazyflie, arrays in cells (t, v, R, pwm, fa).

Betaflight (blackbox_decode): time in us, motor[i] 1000 to 2000 or DShot, eRPM[i] in hundreds of electrical rev/min,
accSmooth counts, vbatLatest and amperageLatest as `_electric` says. Mechanical speed needs the pole count and
acceleration the counts of 1 g: eRPM is used only with a row motor_poles before the headings, accSmooth with acc_1G.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import G0
from bemt.tools.flight import crazyflie
from bemt.tools.flight.log import SPARSE, FlightLog, Stretches, joined

if TYPE_CHECKING:
    import pandas as pd

KIND = "CSV"


def sniff(head: bytes) -> bool:
    """Whether it begins as text."""
    return bool(head) and b"\0" not in head


_CELLS = ("p", "v", "R", "w", "fa", "pwm")
_USED = re.compile(r"p|v|R|w|fa|pwm"
                   r"|(motor|pwm|rpm|acc|gyro|pm|stateEstimate|controller)\..+|(vbat|amperage)(Latest)?"
                   r"|(motor|eRPM|gyroADC|gyroUnfilt|accSmooth)\[\d+\]")  # fmt: skip
_ROTOR_WORDS = {"rpm", "motor", "esc", "rotor", "prop", "propeller", "m", "speed"}
_TIME = re.compile(r"(t|time|timestamp)(?:[ _]*[(\[]?(s|ms|us|µs)[)\]]?)?", re.IGNORECASE)
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
_READ = ("a time (t_s, time_ms, Time [s]) with the speed of each motor (rpm1, esc1_rpm, Motor 1 [RPM]); "
         "or a log of Betaflight or of a Crazyflie; or t, v, R, pwm")  # fmt: skip


def _rotor(heading: str) -> int | None:
    """Number of the rotor whose speed a heading says.

    >>> [_rotor(h) for h in ("rpm1", "Motor 1 [RPM]", "esc.rpm[0]", "eRPM[0]", "motor[1]")]
    [1, 1, 0, None, None]
    """
    words = re.findall(r"[a-z]+|\d+", heading.lower())
    number = [int(w) for w in words if w.isdigit()]
    said = {w for w in words if not w.isdigit()}
    return number[0] if "rpm" in said and len(number) == 1 and said <= _ROTOR_WORDS else None


BETAFLIGHT = (b"loopIteration", b"motor[0]")
"""Headings that every CSV of blackbox_decode and of Blackbox Explorer has."""
_CLOCK = re.compile(r"\b(time|t|timestamp)(_(s|ms|us))?\b|loopIteration", re.IGNORECASE)
_MOTORS = re.compile(r"motor\[|motor\.|pwm|rpm|controller\.cmd", re.IGNORECASE)
_HEAD_BYTES = 1 << 18  # within which the headings stand
_ROWS = 20_000  # of a piece


def _headings(name: str, lines: Sequence[str]) -> tuple[int, dict[str, str]]:
    """Number of the line of headings; what the lines above and units behind the headings say."""
    start = next((k for k, line in enumerate(lines[:400]) if _CLOCK.search(line) and _MOTORS.search(line)), None)
    if start is None:
        raise InputError(Fault(name, "", "no row of headings with a time and motors", _READ))
    said = {m[1]: m[2] for line in lines[:start] if (m := re.match(r'"?([\w ]+)"?,"?([^"]*)"?\s*$', line))}
    return start, said | dict(re.findall(r"(\w+) \((\w+)\)", lines[start]))  # vbatLatest (V)


def read(path: Path) -> FlightLog:
    """Read a table, in pieces; its headings decide what it is."""
    import pandas as pd

    name = str(path)
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    start, said = _headings(name, head.decode("utf-8", errors="replace").split("\n"))
    try:
        with path.open("rb") as rows:
            for _ in range(start):
                rows.readline()
            frame = _frame(rows)
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(Fault(name, "", f"a damaged table ({error})", "rows of equal length")) from error
    if {"pwm", "v", "R", "t"} <= set(frame.columns):
        return _cells(name, frame)
    clock = next((c for c in ("t_s", "timestamp") if c in frame), "")
    if clock and any(c.startswith(("motor.m", "pwm.m", "rpm.m", "controller.cmd")) for c in frame.columns):
        numbers = frame.apply(pd.to_numeric, errors="coerce").dropna()
        t = numbers[clock].to_numpy(float) * (1.0 if clock == "t_s" else 1e-3)  # CrazyPAD's stamps are in ms
        columns = {c: (t, numbers[c].to_numpy(float)) for c in numbers.columns if c != clock}
        return crazyflie.from_columns(name, "Crazyflie CSV", columns)
    if any(c.startswith(("motor[", "eRPM[")) for c in frame.columns):
        return _betaflight(name, frame, said)
    if any(_rotor(c) is not None for c in frame.columns):
        return _speeds(name, frame)
    raise InputError(Fault(name, "", f"no speed of a motor beside {', '.join(map(str, frame.columns[:8]))}", _READ))


def _label(heading: str) -> str:
    """Heading without its unit, unless it is the speed of a rotor or a time with its unit."""
    if _rotor(heading) is not None or _TIME.fullmatch(heading.strip()):
        return heading.strip()
    return re.sub(r"\s*\(.*\)\s*$", "", heading).strip()


def _wanted(label: str) -> bool:
    return _rotor(label) is not None or bool(_USED.fullmatch(label) or _TIME.fullmatch(label))


def _frame(rows: BinaryIO) -> pd.DataFrame:
    """The columns that are used. Numbers are kept in single precision, times in double."""
    import pandas as pd

    kept: Stretches[pd.DataFrame] = Stretches(lambda piece: piece.iloc[::SPARSE].copy())
    pieces = pd.read_csv(rows, on_bad_lines="skip", encoding_errors="replace", chunksize=_ROWS, low_memory=False,
                         usecols=lambda c: _wanted(_label(str(c))))  # fmt: skip
    for piece in pieces:
        piece.columns = [_label(str(c)) for c in piece.columns]
        for c in piece.columns:
            if c not in _CELLS:
                numbers = pd.to_numeric(piece[c], errors="coerce")
                piece[c] = numbers if _TIME.fullmatch(c) else numbers.astype(np.float32)
        kept.add(piece)
    return pd.concat(kept.parts, ignore_index=True)


def _cells(name: str, frame: pd.DataFrame) -> FlightLog:
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
    ends = f"{len(frame) - len(rows)} damaged rows are left out" if len(rows) < len(frame) else ""
    time = np.array(times)
    got = {k: (time, np.array([r[i] for r in rows])) for i, k in enumerate(keys)}
    wide = {"p": (3,), "v": (3,), "R": (3, 3), "w": (3,), "fa": (3,)}
    for key, (_, v) in got.items():
        if v.shape[1:] != wide.get(key, v.shape[1:]) or (key == "pwm" and v.ndim != 2):
            raise InputError(Fault(name, key, f"arrays of {v.shape[1:]}", "vectors of three, R of 3 x 3, pwm of a row"))
    sources = {
        "command": got["pwm"], "rates": got.get("w"), "upright": (time, got["R"][1][:, 2, 2]),
        "axis": (time, got["R"][1][:, :, 2]), "velocity": got["v"], "position": got.get("p"), "force": got.get("fa"),
    }  # fmt: skip
    return joined(name, "CSV of arrays", sources, "command", command_unit="pwm", ends=ends)


def _speeds(name: str, frame: pd.DataFrame) -> FlightLog:
    """A table of time and speeds alone: hovering gives the thrust constant."""
    clock, unit = next(((c, m[2]) for c in frame.columns if (m := _TIME.fullmatch(c))), ("", None))
    if not clock:
        raise InputError(Fault(name, "", "no column of time", "t_s, time_ms, Time [s] or timestamp"))
    number = {c: n for c in frame.columns if (n := _rotor(c)) is not None}
    t = frame[clock].to_numpy(float)
    step = float(np.nanmedian(np.diff(t))) if t.size > 1 else 1.0
    # A clock without a unit: logs of flights are taken 2 to 20,000 times a second.
    guess = 1.0 if step < 0.5 else 1e-3 if step < 500.0 else 1e-6
    scale = _SECONDS[unit.lower()] if unit else guess
    if not 5e-5 <= scale * step <= 0.5:
        expected = "2 to 20,000 rows a second"
        raise InputError(Fault(name, clock, f"rows {step:.3g} {unit or ''} apart", expected, "Is the unit right?"))
    rpm = frame[sorted(number, key=lambda c: number[c])].to_numpy(float)
    return joined(name, "CSV of speeds", {"rpm": (scale * t, rpm)}, "rpm")


def _betaflight(name: str, numbers: pd.DataFrame, said: dict[str, str]) -> FlightLog:
    clock = next((c for c in numbers.columns if _TIME.fullmatch(c)), "")
    if not clock.startswith("time"):
        raise InputError(Fault(name, "time", "no such column", "time in us", "Decode with blackbox_decode"))
    t = 1e-6 * numbers[clock].to_numpy(float)

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
    sources = {
        "command": command, "rpm": many("eRPM", 200.0 / poles) if poles > 0.0 else None, "rates": gyro,
        "acceleration": many("accSmooth", G0 / per_g) if per_g > 0.0 else None,
        "voltage": (t, _electric(volt, said) * numbers[volt].to_numpy(float)) if volt else None,
        "battery_current": (t, _electric(amp, said) * numbers[amp].to_numpy(float)) if amp else None,
    }  # fmt: skip
    B = command[1].shape[1] if command else 0
    turned = "-rev" if _number(said.get("yaw_motors_reversed")) else ""
    layout = f"betaflight-x{turned}" if B == 4 else ""
    raw = unfiltered or gyro
    raw = raw if raw is not None and raw[1].shape[1] == 3 else None
    main = "command" if command else "rpm"
    return joined(name, "Betaflight CSV", sources, main, raw=raw, raw_unit="rad/s", layout=layout)


def _electric(column: str, said: dict[str, str]) -> float:
    """Volts or amperes of one count: as the heading says, else as the firmware counts (Blackbox Explorer, presenter).

    >>> [_electric("vbatLatest", {"Firmware revision": f"Betaflight {v}"}) for v in ("4.4.2 (2cf7d0a1d)", "3.5.7")]
    [0.01, 0.1]
    """
    if unit := said.get(column):
        return {"V": 1.0, "A": 1.0, "mV": 1e-3, "mA": 1e-3}.get(unit, np.nan)
    version = re.match(r"Betaflight (\d+)\.(\d+)", said.get("Firmware revision", ""))
    if version is None:
        return 1.0
    counts = (int(version[1]), int(version[2]))
    return 0.01 if counts >= (4, 0) or column.startswith("amperage") else 0.1 if counts >= (3, 1) else np.nan


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

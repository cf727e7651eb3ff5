"""ArduPilot: DataFlash (``.BIN``). Messages as in ArduPilot's log documentation; NED and FRD axes.

The file is walked once, by the lengths that its own FMT messages give; of the messages in `_WANTED` only the columns
that are used are kept, so memory follows what is kept and not the size of the file (pymavlink's reader keeps an index
of every message; its table of format letters is used).

Motors are the outputs whose SERVOn_FUNCTION is 33 to 40 (motors 1 to 8) or 82 to 85 (9 to 12); commands are shares of
MOT_PWM_MIN to MOT_PWM_MAX; the layout is that of FRAME_CLASS and FRAME_TYPE. Raw bursts of the accelerometer are ISBH
and ISBD messages.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.recfunctions import repack_fields
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, needs
from bemt.tools.flight.layout import LAYOUTS, layout_of, mixed
from bemt.tools.flight.log import SPARSE, FlightLog, Source, Stretches, column, joined, scaled

KIND = "ArduPilot DataFlash"
_HEAD, _FORMATS, _FORMAT_SIZE, _CHUNK = b"\xa3\x95", 128, 89, 1 << 20
_IMU = ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")
_WANTED: dict[str, tuple[str, ...]] = {
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "ESC": ("Instance", "RPM", "Curr"),
    "IMU": ("I", *_IMU),
    "ATT": ("Roll", "Pitch", "Yaw"),
    "BAT": ("Instance", "Inst", "Volt", "Curr"),
    "XKF1": ("C", "VN", "VE", "VD", "PN", "PE", "PD"),
    "NKF1": ("C", "VN", "VE", "VD", "PN", "PE", "PD"),
    "ISBH": ("N", "type", "instance", "mul", "smp_cnt", "SampleUS", "smp_rate"),
    "ISBD": ("N", "seqno", "x", "y", "z"),
    "RATE": ("ROut", "POut", "YOut", "AOut"),
    "VIBE": ("IMU", "VibeX", "VibeY", "VibeZ"),
    "MOTB": ("ThrAvMx",),
    "CTUN": ("ThO",),
    "GPS": ("I", "GMS", "GWk"),
    "PARM": ("Name", "Value"),
}
# Of these the first instance is read.
_FIRST = {"IMU": ("I",), "VIBE": ("IMU",), "GPS": ("I",), "BAT": ("Instance", "Inst"), "XKF1": ("C",), "NKF1": ("C",)}
_FLIP = np.array([1.0, -1.0, -1.0])
_IDLE = 0.5  # share of the hover throttle below which nothing flies [1]
_FUNCTIONS = {**{33 + i: i for i in range(8)}, **{82 + i: 8 + i for i in range(4)}}
_FRAMES = {
    (1, 0): "quad-plus", (1, 1): "quad-x", (1, 2): "quad-x", (1, 3): "quad-h", (1, 12): "betaflight-x",
    (1, 13): "quad-x-dji", (1, 14): "quad-x-cw", (1, 18): "betaflight-x-rev", (2, 0): "hexa-plus", (2, 1): "hexa-x",
    (2, 13): "hexa-x-dji", (2, 14): "hexa-x-cw", (3, 0): "octo-plus", (3, 1): "octo-x", (3, 13): "octo-x-dji",
    (3, 14): "octo-x-cw", (4, 0): "x8-plus", (4, 1): "x8", (4, 2): "x8", (4, 3): "x8-h", (4, 14): "x8-cw",
    (5, 0): "y6", (5, 1): "y6", (5, 10): "y6b", (5, 11): "y6f", (12, 0): "dodeca-hexa-plus", (12, 1): "dodeca-hexa",
}  # fmt: skip


def sniff(head: bytes) -> bool:
    """Whether the first bytes are those of such a log: a format message of formats."""
    return head[:4] == b"\xa3\x95\x80\x80"


@dataclass(eq=False)
class _MessageTable:
    """Messages of one kind: their layout, bytes not yet unpacked, and columns."""

    name: str
    row: np.dtype[Any]
    scale: dict[str, float]
    raw: bytearray = field(default_factory=bytearray)
    kept: Stretches[NDArray[Any]] = field(default_factory=lambda: Stretches(lambda rows: rows[::SPARSE].copy()))

    def unpack(self) -> None:
        """Keep the used columns of what was gathered."""
        rows = np.frombuffer(bytes(self.raw), dtype=self.row)
        self.raw.clear()
        for key in _FIRST.get(self.name, ()):
            if key in (self.row.names or ()):
                rows = rows[rows[key] == 0]
        keep = [n for n in self.row.names or () if n in ("TimeUS", *_WANTED[self.name])]
        self.kept.add(repack_fields(rows[keep]))  # a copy without the other columns

    def columns(self) -> dict[str, NDArray[Any]]:
        """Column by name, in the unit of the log."""
        if self.raw:
            self.unpack()
        if not self.kept.parts:
            return {}
        whole = np.concatenate(self.kept.parts)
        self.kept.parts.clear()
        return {n: whole[n] * self.scale[n] if n in self.scale else whole[n] for n in whole.dtype.names or ()}


def read(path: Path) -> FlightLog:
    """Read a log, as far as it is whole."""
    name = str(path)
    letters = needs("pymavlink.DFReader", "flight").FORMAT_TO_STRUCT
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            tables, ends = _tables(data, letters)
        found = {k: t.columns() for k, t in tables.items()}
        return _made(name, {k: v for k, v in found.items() if v}, ends)
    except InputError:
        raise
    except (ValueError, TypeError, KeyError, MemoryError) as error:
        raise InputError(Fault(name, "", f"a damaged log ({error})", "whole DataFlash messages")) from error


def _tables(
    data: mmap.mmap, letters: Mapping[str, tuple[str, float | None, type]]
) -> tuple[dict[str, _MessageTable], str]:
    """Walk the messages; where they cannot be read, skip to the next mark."""
    sizes: dict[int, int] = {_FORMATS: _FORMAT_SIZE}
    kinds: dict[int, _MessageTable] = {}
    tables: dict[str, _MessageTable] = {}
    at, end, skipped, cut = 0, len(data), 0, 0
    while at + 3 <= end:
        size = sizes.get(data[at + 2]) if data[at : at + 2] == _HEAD else None
        if size is None or at + size > end:
            nearest = data.find(_HEAD, at + 1)
            stop = end if nearest < 0 else nearest
            if size is not None and nearest < 0:
                cut = stop - at
            elif any(data[at : min(stop, at + 4096)]):  # zeros fill up a file
                skipped += stop - at
            at = stop
            continue
        kind = data[at + 2]
        if kind == _FORMATS:
            number, made, table = _format(data[at + 3 : at + size], letters)
            if made >= 3:
                sizes[number] = made
                if table is not None:
                    known = tables.setdefault(table.name, table)
                    if known.row == table.row:
                        kinds[number] = known
        elif (wanted := kinds.get(kind)) is not None:
            wanted.raw += data[at + 3 : at + size]
            if len(wanted.raw) > _CHUNK:
                wanted.unpack()
        at += size
    if skipped:
        return tables, f"damaged; {skipped} bytes that cannot be read were skipped"
    return tables, f"ends within a message, {cut} bytes before its end" if cut else ""


def _format(
    body: bytes, letters: Mapping[str, tuple[str, float | None, type]]
) -> tuple[int, int, _MessageTable | None]:
    """Number and length of the messages that a FMT message describes; their table when they are wanted."""
    number, size = body[0], body[1]
    name, form, labels = (part.rstrip(b"\0").decode("latin-1") for part in (body[2:6], body[6:22], body[22:86]))
    names = labels.split(",")
    if name not in _WANTED or len(names) != len(form) or len(set(names)) != len(names):
        return number, size, None
    fields, scale = [], {}
    for label, letter in zip(names, form, strict=True):
        if letter not in letters:
            return number, size, None
        code, factor, _ = letters[letter]
        shape = (32,) if letter == "a" else ()
        fields.append((label, "<i2" if letter == "a" else f"S{code[:-1]}" if code.endswith("s") else f"<{code}", shape))
        if factor is not None:
            scale[label] = factor
    row = np.dtype([(a, np.dtype((b, c))) for a, b, c in fields])
    return (number, size, _MessageTable(name, row, scale)) if row.itemsize == size - 3 else (number, size, None)


def _made(name: str, found: dict[str, dict[str, NDArray[Any]]], ends: str) -> FlightLog:
    parm = found.get("PARM", {"Name": np.zeros(0, "S16"), "Value": np.zeros(0)})
    params = {n.decode("latin-1"): float(v) for n, v in zip(parm["Name"], parm["Value"], strict=True)}

    def take(kind: str, keys: tuple[str, ...], rows: NDArray[np.bool_] | None = None) -> Source | None:
        columns = found.get(kind, {})
        if any(k not in columns for k in ("TimeUS", *keys)):
            return None
        pick = slice(None) if rows is None else rows
        t = 1e-6 * columns["TimeUS"][pick].astype(float)
        return (t, np.stack([columns[k][pick].astype(float) for k in keys], axis=1)) if t.size > 1 else None

    def whole(key: str, usual: float) -> float:
        value = params.get(key, usual)
        return value if np.isfinite(value) else usual

    layout = _FRAMES.get((int(whole("FRAME_CLASS", 1.0)), int(whole("FRAME_TYPE", 1.0))), "")
    places = len(LAYOUTS[layout].split()) if layout else 0
    stated = places if "FRAME_CLASS" in params else 0
    rate = take("RATE", ("ROut", "POut", "YOut", "AOut"))
    command, channels, said = _command(found.get("RCOU", {}), take, whole, rate, layout if stated else "")
    thrust = column(rate, slice(3, None)) or take("CTUN", ("ThO",)) or take("MOTB", ("ThrAvMx",))
    if thrust is not None and not np.nanmax(thrust[1], initial=0.0) > _IDLE * whole("MOT_THST_HOVER", 0.0):
        thrust = scaled(thrust, 0.0)
    speeds, currents = _of_escs(found.get("ESC", {}), channels, take)
    att, battery = take("ATT", ("Roll", "Pitch", "Yaw")), take("BAT", ("Volt", "Curr"))
    axis = (att[0], _thrust_axis(np.radians(att[1]))) if att else None
    state = "XKF1" if "XKF1" in found else "NKF1"
    acceleration = scaled(take("IMU", _IMU[3:]), _FLIP)
    sources = {
        "command": command, "rpm": speeds, "current": currents, "acceleration": acceleration,
        "rates": scaled(take("IMU", _IMU[:3]), _FLIP), "upright": column(axis, 2), "axis": axis,
        "velocity": scaled(take(state, ("VN", "VE", "VD")), _FLIP),
        "position": scaled(take(state, ("PN", "PE", "PD")), _FLIP),
        "voltage": column(battery, 0), "battery_current": column(battery, 1), "thrust": column(thrust, 0),
        "torque": column(rate, slice(3)), "vibe": take("VIBE", ("VibeX", "VibeY", "VibeZ")),
    }  # fmt: skip
    main = next((k for k in ("command", "rpm", "acceleration") if sources[k]), "vibe")
    curve = ("MOT_THST_EXPO", "MOT_THST_HOVER", "MOT_SPIN_MIN", "MOT_SPIN_MAX")
    kept = {k: params[k] for k in curve if np.isfinite(params.get(k, np.nan))}
    return joined(name, KIND, sources, main, raw=_bursts(found) or acceleration, ends=ends, mixed=said,
                  layout=layout if places == len(channels) else "", date=_date(found), parameters=kept,
                  stated_rotors=stated)  # fmt: skip


def _command(
    outputs: dict[str, NDArray[Any]], take: Callable[..., Source | None], whole: Callable[[str, float], float],
    rate: Source | None, layout: str,
) -> tuple[Source | None, list[int], str]:  # fmt: skip
    """Commands of the motors, shares of full; their channels; RATE where they are mixed from its demands."""
    motors = sorted(
        (i, n) for n in range(1, 15) if (i := _FUNCTIONS.get(int(whole(f"SERVO{n}_FUNCTION", 0.0)), -1)) >= 0
    )
    channels = [n for _, n in motors] or _moving(outputs)
    command = take("RCOU", tuple(f"C{n}" for n in channels)) if channels else None
    if command is not None:
        low, high = whole("MOT_PWM_MIN", 1000.0), whole("MOT_PWM_MAX", 2000.0)
        low, high = (low, high) if high - low >= 100.0 else (1000.0, 2000.0)
        return (command[0], np.clip((command[1] - low) / (high - low), 0.0, None)), channels, ""
    if rate is None or not layout:
        return None, channels, ""
    count = len(LAYOUTS[layout].split())
    placed = layout_of(layout, count)
    assert placed is not None
    mix = mixed(placed, rate[1][:, 3], rate[1][:, :3], (0.5, 0.5, 0.5))
    return (rate[0], mix), list(range(1, count + 1)), "RATE"


def _of_escs(
    esc: Mapping[str, NDArray[Any]], channels: list[int], take: Callable[..., Source | None]
) -> tuple[Source | None, Source | None]:
    """Speeds and currents of the motors on these channels."""
    if "Instance" not in esc:
        return None, None
    there = [int(i) for i in np.unique(esc["Instance"])]
    own = [n - 1 for n in channels] if {n - 1 for n in channels} <= set(there) else there
    if channels and len(own) != len(channels):
        return None, None
    speeds, currents = (_together([take("ESC", (key,), esc["Instance"] == i) for i in own]) for key in ("RPM", "Curr"))
    return speeds if speeds is not None and np.any(speeds[1]) else None, currents


def _date(found: Mapping[str, Mapping[str, NDArray[Any]]]) -> str:
    """Day by the satellites (weeks from 6 January 1980), or nothing."""
    gps = found.get("GPS", {})
    if any(k not in gps for k in ("GMS", "GWk")):
        return ""
    weeks = gps["GWk"].astype(float)
    good = np.flatnonzero((weeks > 1000.0) & (weeks < 5000.0))
    if not good.size:
        return ""
    days = int(7 * weeks[good[0]] + float(gps["GMS"][good[0]]) // 86_400_000)
    return str(np.datetime64("1980-01-06") + np.timedelta64(days, "D"))


def _thrust_axis(angles: Array) -> Array:
    """Thrust in north-west-up, from roll, pitch and yaw of front-right-down in NED [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles).T, np.cos(angles).T
    return np.stack([-(cr * sp * cy + sr * sy), cr * sp * sy - sr * cy, cr * cp], axis=1)


def _moving(outputs: Mapping[str, NDArray[Any]]) -> list[int]:
    """Leading outputs that move within the range of a motor, for a log without parameters."""
    used: list[int] = []
    for n in range(1, 15):
        v = outputs.get(f"C{n}")
        if v is None or not v.size or v.max() > 2500 or v.max() < 1000 or v.max() - v.min() < 20:
            break
        used.append(n)
    return used


def _bursts(found: Mapping[str, Mapping[str, NDArray[Any]]]) -> Source | None:
    """Raw accelerations of the batch sampler, in order of time; z up."""
    heads, blocks = found.get("ISBH", {}), found.get("ISBD", {})
    if any(k not in heads for k in _WANTED["ISBH"]) or any(k not in blocks for k in _WANTED["ISBD"]):
        return None
    times, values = [], []
    number, place, *axes = (blocks[k] for k in _WANTED["ISBD"])
    for burst, kind, instance, mul, count, start, rate in zip(*(heads[k] for k in _WANTED["ISBH"]), strict=True):
        rows = np.flatnonzero(number == burst)
        if kind != 0 or instance != 0 or not mul > 0.0 or not rate > 0.0 or not rows.size:
            continue
        rows = rows[np.argsort(place[rows])]
        xyz = np.stack([a[rows].reshape(-1).astype(float) for a in axes], axis=1)[: int(count)]
        step = place[rows][:, None] * 32 + np.arange(32)
        times.append(1e-6 * float(start) + step.reshape(-1)[: len(xyz)] / float(rate))
        values.append(xyz / float(mul) * _FLIP)
    return (np.concatenate(times), np.concatenate(values)) if times else None


def _together(every: list[Source | None]) -> Source | None:
    """Rotors with clocks of their own, on that of the first."""
    whole = [p for p in every if p is not None]
    if len(whole) < max(len(every), 1) or not whole:
        return None
    t = whole[0][0]
    return t, np.stack([np.interp(t, at, v[:, 0]) for at, v in whole], axis=1)

"""PX4: ULog (``.ulg``), read by pyulog; topics and units as in PX4's msg/*.msg; NED and FRD axes.

Only the topics that are used are kept, so memory does not follow the size of the file. The layout is that of the
parameters CA_ROTORn_PX, PY (ahead, to the right) and KM (above zero: turns to the left, seen from above); before
version 1.13 that of the airframe, whose number is SYS_AUTOSTART (airframes reference). Pulse widths are shares of
PWM_MIN to PWM_MAX. Raw bursts of the accelerometer are sensor_accel_fifo.
"""

from __future__ import annotations

import contextlib
import io
import mmap
import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, needs
from bemt.tools.flight.layout import LAYOUTS, layout_of, layout_text, mixed
from bemt.tools.flight.log import SPARSE, FlightLog, Source, Stretches, column, held, joined, scaled, thrust_axis

KIND = "PX4 ULog"
_TOPICS = ["actuator_motors", "actuator_outputs", "esc_status", "sensor_combined", "vehicle_attitude",
           "vehicle_local_position", "battery_status", "sensor_accel_fifo", "actuator_controls_0",
           "vehicle_torque_setpoint", "vehicle_thrust_setpoint", "vehicle_gps_position", "sensor_gps",
           "vehicle_land_detected", "vehicle_status"]  # fmt: skip
_STRETCH = 16_384  # samples
_KINDS, _DATA, _SYNC = b"BFIMPQADLSOCR", ord("D"), bytes.fromhex("2f731320250cbb12")
_AIRFRAMES = {5: "quad-plus", 6: "hexa-x", 7: "hexa-plus", 8: "octo-x", 9: "octo-plus", 12: "x8"}  # by thousands
_X = float(np.sqrt(0.5))
_ARMED = 2  # arming_state (vehicle_status.msg)
_AXIS = np.array([-1.0, 1.0, 1.0])  # the thrust is along -z of the body; NED to north-west-up
_FLIP = np.array([1.0, -1.0, -1.0])  # forward-right-down to forward-left-up; north-east-down to north-west-up


def sniff(head: bytes) -> bool:
    """Whether the first bytes are those of such a log."""
    return head[:7] == b"ULog\x01\x12\x35"


def read(path: Path) -> FlightLog:
    """Read a log, as far as it is whole."""
    name = str(path)
    ulog = needs("pyulog", "flight").ULog
    try:
        with (path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
              contextlib.redirect_stdout(io.StringIO()), np.errstate(all="ignore")):  # fmt: skip
            head, topics, damaged, cut = _gathered(data)
            # pyulog knows the formats; of all messages it would take 4 us each.
            found = ulog(io.BytesIO(head), _TOPICS, disable_str_exceptions=True)
        log = _made(name, found, topics)
        if damaged or found.file_corruption:
            return replace(log, ends=f"damaged; readable up to {log.t[-1]:.1f} s")
        return replace(log, ends=f"ends within a message, after {log.t[-1]:.1f} s") if cut else log
    except InputError:
        raise
    except Exception as error:  # a parser meets any damage: struct, key, value, index, memory, its own
        got = f"a damaged log ({type(error).__name__}: {error})"
        raise InputError(Fault(name, "", got, "whole ULog messages", "Download the log again")) from error


def _gathered(data: mmap.mmap) -> tuple[bytearray, dict[int, _Messages], bool, bool]:
    """What tells the formats, with one message of each used topic; those topics by number; whether there is damage.

    Last, whether the file ends within a message.

    ULog file format, PX4 user guide. Behind damage the log goes on from the next mark, or byte.
    """
    head, topics, at, damaged, short = bytearray(data[:16]), dict[int, _Messages](), 16, False, False
    start = struct.Struct("<HBH").unpack_from  # size, kind and, of data, the number of the topic
    stops, marked = [len(data)], True  # data may be appended behind what was cut
    while stops:
        stop = stops.pop(0)
        while at + 5 <= stop:
            size, kind, number = start(data, at)
            after = at + 3 + size
            if kind not in _KINDS or after > stop:
                mark = data.find(_SYNC, at + 1, stop) if marked else -1
                marked, cut = mark >= 0, kind in _KINDS
                short = cut and not marked and stop == len(data)
                damaged, at = damaged or not cut, mark + len(_SYNC) if marked else stop if cut else at + 1
                continue
            topic = topics.get(number) if kind == _DATA else None
            if topic is not None and size == topic.size:
                topic.add(data[at + 5 : after])
            elif topic is not None and (topic.size or size < 3):
                damaged = True
            elif topic is not None:
                topic.begin(data[at + 5 : after])
                head += data[at:after]
            elif kind == ord("A") and (name := data[at + 6 : after].decode("latin-1")) in _TOPICS:
                topics[struct.unpack_from("<H", data, at + 4)[0]] = _Messages(32 if name == "sensor_accel_fifo" else 1)
                head += data[at:after]
            elif kind == ord("B"):
                head += data[at : at + 3] + bytes(size)  # without the places of appended data
                places = struct.unpack_from("<3Q", data, at + 19) if size >= 40 else ()
                stops[:0] = sorted(p for p in places if after < p < stop)
            elif kind in b"FPQ":
                head += data[at:after]
            at = after
        short |= at < stop == len(data)
        at = stop
    return head, topics, damaged, short


class _Messages:
    """Messages of one topic, in stretches; `each` of them holds so many samples."""

    def __init__(self, each: int) -> None:
        # Single bursts are too short for a spectrum; of the others every 20th message stays.
        step = SPARSE if each == 1 else _STRETCH // each
        self.kept = Stretches[NDArray[Any]](lambda part: part[::step].copy(), each)
        self.begun, self.size, self.full, self._each = bytearray(), 0, 0, each

    def begin(self, first: bytes) -> None:
        """Take the first message: all of a topic have one length, else they are damaged."""
        self.begun += first
        self.size, self.full = len(first) + 2, _STRETCH // self._each * len(first)

    def add(self, message: bytes) -> None:
        """Take another message."""
        self.begun += message
        if len(self.begun) >= self.full:
            self.keep()

    def keep(self) -> None:
        """Keep a stretch."""
        self.kept.add(np.frombuffer(bytes(self.begun), dtype=f"V{self.size - 2}"))
        self.begun.clear()

    def columns(self, first: Mapping[str, Array]) -> dict[str, Array]:
        """All messages, in the formats of the columns of the first."""
        self.keep()
        formats = [(key, v.dtype) for key, v in first.items()]
        rest = self.size - 2 - np.dtype(formats).itemsize
        rows = np.concatenate(self.kept.parts).view([*formats, ("rest of a message", f"V{rest}")])
        self.kept.parts.clear()
        return {key: rows[key] for key in first}


def _tables(found: Any, topics: Mapping[int, _Messages]) -> dict[str, dict[str, Array]]:
    """Columns of each topic; of several instances that which moves most."""
    tables: dict[str, dict[str, Array]] = {}
    for d in found.data_list:
        data, known = topics[d.msg_id].columns(d.data), tables.get(d.name)
        if known is None or _moves(data) > _moves(known):
            tables[d.name] = data
    return tables


def _made(name: str, found: Any, topics: Mapping[int, _Messages]) -> FlightLog:
    tables = _tables(found, topics)

    def take(topic: str, keys: list[str]) -> Source | None:
        data = tables.get(topic, {})
        if not keys or any(k not in data for k in ["timestamp", *keys]):
            return None
        return 1e-6 * np.asarray(data["timestamp"], dtype=float), np.stack(
            [np.asarray(data[k], dtype=float) for k in keys], axis=1
        )

    params = {k: float(v) for k, v in found.initial_parameters.items() if isinstance(v, int | float)}
    thrust, torque = _demand(take)
    command = _command(tables, params, take, thrust, torque)
    B = 0 if command.source is None else command.source[1].shape[1]
    escs = _escs(tables.get("esc_status", {}), B)
    speeds = take("esc_status", [f"esc[{i}].esc_rpm" for i in escs])
    # the sign is the turning in a simulator
    speeds = (speeds[0], np.abs(speeds[1])) if speeds is not None and np.any(speeds[1]) else None
    speeds = _active(speeds) if B == 0 else speeds
    q = take("vehicle_attitude", [f"q[{i}]" for i in range(4)])
    axis = (q[0], thrust_axis(q[1]) * _AXIS) if q else None
    acceleration = scaled(take("sensor_combined", [f"accelerometer_m_s2[{i}]" for i in range(3)]), _FLIP)
    sources: dict[str, Source | None] = {
        "command": command.source, "rpm": speeds,
        "current": take("esc_status", [f"esc[{i}].esc_current" for i in escs]),
        "acceleration": acceleration, "axis": axis, "upright": column(axis, 2),
        "rates": scaled(take("sensor_combined", [f"gyro_rad[{i}]" for i in range(3)]), _FLIP),
        "velocity": scaled(take("vehicle_local_position", ["vx", "vy", "vz"]), _FLIP),
        "position": scaled(take("vehicle_local_position", list("xyz")), _FLIP),
        "voltage": column(take("battery_status", ["voltage_v"]), 0),
        "battery_current": column(take("battery_status", ["current_a"]), 0), "thrust": thrust, "torque": torque,
        "airborne": _airborne(take),
    }  # fmt: skip
    main = next((k for k in ("command", "rpm", "acceleration") if sources[k]), "thrust")
    kept = {k: params[k] for k in ("THR_MDL_FAC", "MPC_THR_HOVER") if np.isfinite(params.get(k, np.nan))}
    kept |= {"demanded": 1.0} if command.demanded else {}
    return joined(name, KIND, sources, main, raw=_bursts(tables.get("sensor_accel_fifo", {})) or acceleration,
                  command_unit=command.unit, layout=_layout(params, B), mixed=command.mixed, date=_date(take),
                  parameters=kept, stated_rotors=_stated(params))  # fmt: skip


class _Command(NamedTuple):
    """Commands of the motors."""

    source: Source | None
    unit: str = "1"  # Shares of full, or microseconds
    demanded: bool = False  # Whether they are the demands of the control allocation
    mixed: str = ""  # Topic of the demanded torques that they were mixed from


def _command(
    tables: dict[str, dict[str, Array]], params: dict[str, float], take: Callable[[str, list[str]], Source | None],
    thrust: Source | None, torque: Source | None,
) -> _Command:  # fmt: skip
    """Commands as logged: demands, outputs, else what the demands of a quadrotor come to."""
    command = _active(take("actuator_motors", _numbered(tables, "actuator_motors", "control")))
    if command is not None:
        return _Command(command, demanded=True)
    there = _numbered(tables, "actuator_outputs", "output")
    command = _active(take("actuator_outputs", _assigned(params, there) or there))
    if command is not None:
        low, high = params.get("PWM_MIN", 1000.0), params.get("PWM_MAX", 2000.0)
        if np.nanmin(command[1]) >= 700.0 and np.nanmax(command[1]) <= 2300.0 < high + 800.0:
            return _Command((command[0], np.clip((command[1] - low) / max(high - low, 100.0), 0.0, None)))
        return _Command(command, "us")
    # The older mixers scale each geometry in a way of its own; that of four rotors is known.
    four = "actuator_controls_0" in tables and params.get("CA_ROTOR_COUNT", 4.0) == 4.0
    placed = layout_of(_layout(params, 4), 4) if four else None
    if thrust is None or torque is None or placed is None:
        return _Command(None, "us")
    mix = mixed(placed, thrust[1], torque[1], (_X, _X, 1.0))
    return _Command((thrust[0], mix), mixed="actuator_controls_0")


def _demand(take: Callable[[str, list[str]], Source | None]) -> tuple[Source | None, Source | None]:
    """Thrust and torque demanded, shares of full: thrust along the axis, torque in roll, pitch and yaw."""
    both = take("actuator_controls_0", [f"control[{i}]" for i in range(4)])
    if both is not None:
        return (both[0], both[1][:, 3]), (both[0], both[1][:, :3])
    xyz = [f"xyz[{i}]" for i in range(3)]
    thrust, torque = take("vehicle_thrust_setpoint", xyz), take("vehicle_torque_setpoint", xyz)
    return (thrust[0], -thrust[1][:, 2]) if thrust else None, torque


def _airborne(take: Callable[[str, list[str]], Source | None]) -> Source | None:
    """Whether the vehicle is off the ground by its land detector, which a disarmed one never is; else whether armed."""
    landed, state = take("vehicle_land_detected", ["landed"]), take("vehicle_status", ["arming_state"])
    if landed is not None:
        return held((landed[0], 1.0 - landed[1][:, 0]))
    return None if state is None else held((state[0], (state[1][:, 0] == _ARMED).astype(float)))


def _date(take: Callable[[str, list[str]], Source | None]) -> str:
    """Day by the satellites, or nothing."""
    for topic in ("vehicle_gps_position", "sensor_gps"):
        found = take(topic, ["time_utc_usec"])
        seconds = 1e-6 * found[1][found[1] > 1e15] if found is not None else np.zeros(0)
        if seconds.size and seconds[0] < 1e11:
            return str(np.datetime64(int(seconds[0]), "s"))[:10]
    return ""


def _stated(params: dict[str, float]) -> int:
    """Rotors by the parameters."""
    count, frame = params.get("CA_ROTOR_COUNT", 0.0), params.get("SYS_AUTOSTART", 0.0)
    if 0.0 < count < 13.0:
        return int(count)
    usual = _AIRFRAMES.get(int(frame // 1000), "px4-x" if frame // 1000 == 4 else "") if np.isfinite(frame) else ""
    return len(LAYOUTS[usual].split()) if usual else 0


def _assigned(params: dict[str, float], there: list[str]) -> list[str]:
    """Outputs in the order of the motors, by the functions of the port that has most of them (101 is motor 1)."""
    ports = []
    for port in ("MAIN", "AUX"):
        motors = {int(v): n for n in range(16) if 101.0 <= (v := params.get(f"PWM_{port}_FUNC{n + 1}", 0.0)) <= 112.0}
        ports.append([f"output[{n}]" for _, n in sorted(motors.items())])
    found = max(ports, key=len)
    return found if set(found) <= set(there) else []


def _escs(data: dict[str, Array], B: int) -> list[int]:
    """Speed controllers in the order of the motors: by the function of each where it is logged (101 is motor 1)."""
    count = min(B or 8, 8)
    known = {}
    for i in range(8):
        function = data.get(f"esc[{i}].actuator_function", np.zeros(0))
        if function.size and 101 <= function[-1] <= 112:
            known[int(function[-1]) - 101] = i
    return [known[k] for k in range(count)] if set(range(count)) <= set(known) else list(range(count))


def _layout(params: dict[str, float], B: int) -> str:
    """Layout by the parameters of the control allocation, or that of the airframe; empty where neither says it."""
    frame = params.get("SYS_AUTOSTART", 0.0)
    usual = _AIRFRAMES.get(int(frame // 1000), "px4-x") if np.isfinite(frame) else "px4-x"
    usual = usual if len(LAYOUTS[usual].split()) == (B or 4) else ""
    if B < 2 or params.get("CA_ROTOR_COUNT") != B:
        return usual
    x, y, turn = ([params.get(f"CA_ROTOR{i}_{k}", 0.0) for i in range(B)] for k in ("PX", "PY", "KM"))
    if not (np.all(np.isfinite([x, y, turn])) and np.all(turn) and np.all(np.hypot(x, y) > 1e-3)):
        return usual
    return layout_text(x, -np.array(y), turn)


def _bursts(data: dict[str, Array]) -> Source | None:
    """Raw accelerations, in order of time; z up."""
    if any(k not in data for k in ("timestamp_sample", "dt", "scale", "samples", "x[0]", "y[31]", "z[31]")):
        return None
    count = np.clip(np.asarray(data["samples"], dtype=int), 0, 32)
    step = np.asarray(data["dt"], dtype=float)
    k = np.arange(32)
    # The stamp is that of the last sample.
    t = 1e-6 * (np.asarray(data["timestamp_sample"], dtype=float)[:, None] - step[:, None] * (count[:, None] - 1 - k))
    used = k < count[:, None]
    scale = np.asarray(data["scale"], dtype=float)[:, None]
    xyz = [np.stack([np.asarray(data[f"{a}[{i}]"], dtype=float) for i in k], axis=1) * scale for a in "xyz"]
    return t[used], np.stack([a[used] for a in xyz], axis=1) * _FLIP


def _moves(data: dict[str, Array]) -> int:
    """How many columns of a topic change: of two sets of outputs, the motors are on the one that moves."""
    return sum(bool(len(v)) and bool(np.any(v != v[0])) for k, v in data.items() if k != "timestamp")


def _numbered(tables: dict[str, dict[str, Array]], topic: str, key: str) -> list[str]:
    form = re.compile(rf"{key}\[(\d+)\]")
    found = [m for m in map(form.fullmatch, tables.get(topic, {})) if m]
    return [m.group(0) for m in sorted(found, key=lambda m: int(m.group(1)))]


def _active(source: Source | None) -> Source | None:
    """Leading columns that are used: finite, and not at one value throughout."""
    if source is None or not source[1].size:
        return None
    used = [bool(np.isfinite(c).any() and np.nanmax(c) > np.nanmin(c)) for c in source[1].T]
    count = used.index(False) if False in used else len(used)
    return (source[0], source[1][:, :count]) if count >= 2 else None

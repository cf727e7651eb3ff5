"""Crazyflie: binary logs of its micro-SD card (``.usdlog``); the records are read in the readers' room.

Units of the firmware's log variables (Bitcraze, crazyflie-firmware): acc g; gyro deg/s; pwm and motor 0 to 65535;
vbatMV mV.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import G0
from bemt.data.readers import crazyflie
from bemt.tools.flight.layout import layout_of, mixed
from bemt.tools.flight.log import MOST, FlightLog, joined, thrust_axis

KIND = "Crazyflie usdlog"


def sniff(head: bytes) -> bool:
    """Whether the first bytes are those of such a log."""
    return crazyflie.sniff_crazyflie_log(head)


def read(path: Path) -> FlightLog:
    """Read a log, as far as it is whole."""
    data, name = path.read_bytes(), str(path)
    whole = len(data) > 8 and zlib.crc32(data[:-4]) == struct.unpack("<I", data[-4:])[0]
    body, size = memoryview(data)[: -4 if whole else None], len(data)
    try:
        tables, end = crazyflie.log_tables(body, partly=True)
    except (struct.error, KeyError, ValueError, IndexError, MemoryError) as error:
        got = f"a header that cannot be read ({error})"
        raise InputError(Fault(name, "header", got, "a whole header", "Copy the file again")) from error
    del body, data
    columns = {k: (v["time_s"], v[k]) for v in tables.values() for k in v if k != "time_s"}
    ends = ""
    if not whole:
        where = f"records end at byte {end} of {size}" if end < size - 4 else "all records can be read"
        ends = f"wrong checksum; {where}"
    return from_columns(name, KIND, columns, ends)


_STATES = (("stateEstimate", 1.0), ("stateEstimateZ", 1e-3))  # the packed ones are in millimetres


def from_columns(name: str, kind: str, columns: dict[str, tuple[Array, Array]], ends: str = "") -> FlightLog:
    """Log from the firmware's variables, each with its times [s]."""

    def many(*keys: str, factor: float = 1.0, whole: bool = False) -> tuple[Array, Array] | None:
        if not all(k in columns for k in keys):
            return None
        t = columns[keys[0]][0]
        step = 1 if whole else max(t.size // MOST, 1)  # what is thinned later need not be copied
        return t[::step], factor * np.stack([columns[k][1][::step] for k in keys], axis=1, dtype=float)

    def one(key: str, factor: float) -> tuple[Array, Array] | None:
        found = many(key, factor=factor)
        return None if found is None else (found[0], found[1][:, 0])

    def first(*choices: tuple[Sequence[str], float]) -> tuple[Array, Array] | None:
        return next((found for keys, factor in choices if (found := many(*keys, factor=factor))), None)

    share = 1 / 65535.0
    command = first(
        *(([form.format(i) for i in "1234"], share) for form in ("motor.m{}", "pwm.m{}_pwm", "motor.m{}req"))
    )
    asked, sent = many(*(f"motor.m{i}" for i in "1234")), many(*(f"pwm.m{i}_pwm" for i in "1234"))
    # With both, the first is thrust, before the firmware divides by the battery's voltage (motors.c).
    duty = 0.5 if asked and not sent else 0.0 if asked and sent and not np.array_equal(asked[1], sent[1]) else 1.0
    demand, said = many("controller.cmd_roll", "controller.cmd_pitch", "controller.cmd_yaw", factor=share), ""
    thrust = one("controller.cmd_thrust", share)
    if command is None and demand is not None and thrust is not None:
        placed = layout_of("crazyflie", 4)
        assert placed is not None
        command, said = (thrust[0], mixed(placed, thrust[1], demand[1], (0.5, 0.5, 1.0))), "controller.cmd_*"
    q = many(*(f"stateEstimate.q{a}" for a in "wxyz"))
    # the controller's is what it is held to
    groups = ("stateEstimate", "stabilizer", "controller")
    roll = first(*(([f"{group}.roll", f"{group}.pitch"], np.pi / 180.0) for group in groups))
    axis = (q[0], thrust_axis(q[1])) if q else None
    upright = (axis[0], axis[1][:, 2]) if axis else (roll[0], np.prod(np.cos(roll[1]), axis=1)) if roll else None
    acc = [f"acc.{a}" for a in "xyz"]
    sources = {
        "command": command, "rpm": many(*(f"rpm.m{i}" for i in "1234")), "acceleration": many(*acc, factor=G0),
        "rates": many(*(f"gyro.{a}" for a in "xyz"), factor=np.pi / 180.0), "upright": upright, "axis": axis,
        **{what: first(*(([f"{group}.{v}{a}" for a in "xyz"], factor) for group, factor in _STATES))
           for what, v in (("velocity", "v"), ("position", ""))},
        "voltage": one("pm.vbatMV", 1e-3) or one("pm.vbat", 1.0), "thrust": thrust, "torque": demand,
    }  # fmt: skip
    main = "command" if command else "rpm"
    # The estimator's is the accelerometer's reading turned into axes of the world, less 1 g (kalman_core.c).
    turned = [f"stateEstimate.a{a}" for a in "xyz"]
    raw = many(*acc, factor=G0, whole=True) or many(*turned, factor=G0, whole=True)
    return joined(name, kind, sources, main, raw=raw, layout="crazyflie", ends=ends, mixed=said, duty=duty)

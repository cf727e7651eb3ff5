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
from bemt.tools.flight.log import MOST, FlightLog, Source, joined, thrust_axis

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


_SHARE = 1 / 65535.0
_STATES = (("stateEstimate", 1.0), ("stateEstimateZ", 1e-3))  # the packed ones are in millimetres


class _Columns(dict[str, tuple[Array, Array]]):
    """The firmware's variables, each with its times [s]."""

    def many(self, *keys: str, factor: float = 1.0, whole: bool = False) -> Source | None:
        """Some variables side by side, thinned unless `whole`; None where one lacks."""
        if not all(k in self for k in keys):
            return None
        t = self[keys[0]][0]
        step = 1 if whole else max(t.size // MOST, 1)  # what is thinned later need not be copied
        return t[::step], factor * np.stack([self[k][1][::step] for k in keys], axis=1, dtype=float)

    def one(self, key: str, factor: float) -> Source | None:
        """One variable."""
        found = self.many(key, factor=factor)
        return None if found is None else (found[0], found[1][:, 0])

    def first(self, *choices: tuple[Sequence[str], float]) -> Source | None:
        """The first of several choices that is there."""
        return next((found for keys, factor in choices if (found := self.many(*keys, factor=factor))), None)

    def motors(self) -> tuple[Source | None, float, str]:
        """Commands of the motors as shares, the part of the battery's voltage in them, and what they were mixed of."""
        forms = ("motor.m{}", "pwm.m{}_pwm", "motor.m{}req")
        asked, sent, _ = (self.many(*(form.format(i) for i in "1234")) for form in forms)
        # With both, the first is thrust, before the firmware divides by the battery's voltage (motors.c).
        duty = 0.5 if asked and not sent else 0.0 if asked and sent and not np.array_equal(asked[1], sent[1]) else 1.0
        command = self.first(*(([form.format(i) for i in "1234"], _SHARE) for form in forms))
        thrust, demand = self.demand()
        if command is not None or demand is None or thrust is None:
            return command, duty, ""
        placed = layout_of("crazyflie", 4)
        assert placed is not None
        return (thrust[0], mixed(placed, thrust[1], demand[1], (0.5, 0.5, 1.0))), duty, "controller.cmd_*"

    def demand(self) -> tuple[Source | None, Source | None]:
        """Thrust and torques that the controller asks for, as shares."""
        torques = (f"controller.cmd_{axis}" for axis in ("roll", "pitch", "yaw"))
        return self.one("controller.cmd_thrust", _SHARE), self.many(*torques, factor=_SHARE)

    def attitude(self) -> tuple[Source | None, Source | None]:
        """Axis of the thrust in the world, and its upward part alone."""
        if q := self.many(*(f"stateEstimate.q{a}" for a in "wxyz")):
            axis = thrust_axis(q[1])
            return (q[0], axis), (q[0], axis[:, 2])
        # the controller's is what it is held to
        groups = ("stateEstimate", "stabilizer", "controller")
        roll = self.first(*(([f"{group}.roll", f"{group}.pitch"], np.pi / 180.0) for group in groups))
        return None, (roll[0], np.prod(np.cos(roll[1]), axis=1)) if roll else None


def from_columns(name: str, kind: str, columns: dict[str, tuple[Array, Array]], ends: str = "") -> FlightLog:
    """Log from the firmware's variables, each with its times [s]."""
    of = _Columns(columns)
    (command, duty, said), (thrust, torque), (axis, upright) = of.motors(), of.demand(), of.attitude()
    acc = [f"acc.{a}" for a in "xyz"]
    sources = {
        "command": command, "rpm": of.many(*(f"rpm.m{i}" for i in "1234")), "acceleration": of.many(*acc, factor=G0),
        "rates": of.many(*(f"gyro.{a}" for a in "xyz"), factor=np.pi / 180.0), "upright": upright, "axis": axis,
        **{what: of.first(*(([f"{group}.{v}{a}" for a in "xyz"], factor) for group, factor in _STATES))
           for what, v in (("velocity", "v"), ("position", ""))},
        "voltage": of.one("pm.vbatMV", 1e-3) or of.one("pm.vbat", 1.0), "thrust": thrust, "torque": torque,
    }  # fmt: skip
    main = "command" if command else "rpm"
    # The estimator's is the accelerometer's reading turned into axes of the world, less 1 g (kalman_core.c).
    turned = [f"stateEstimate.a{a}" for a in "xyz"]
    raw = of.many(*acc, factor=G0, whole=True) or of.many(*turned, factor=G0, whole=True)
    return joined(name, kind, sources, main, raw=raw, layout="crazyflie", ends=ends, mixed=said, duty=duty)

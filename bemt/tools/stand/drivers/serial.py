"""Open stands on a serial line: one format string says what goes out and what comes in.

``S{pulse_us} -> {time_ms},{thrust_gf},{torque_mNm},{rpm},{current_A}``: left of the arrow the command, right of it a
row. A name is a channel and its unit. The board must stop the motor by itself when the line is silent.
"""

from __future__ import annotations

import math
import re
import time
from typing import Any

from bemt.base.errors import Fault, InputError, needs, refuse
from bemt.tools.stand.drivers import CHANNELS, factor, parts

LINE = "S{pulse_us} -> {time_ms},{thrust_gf},{torque_mNm},{rpm},{current_A}"
ROWS = f"rows like {LINE}"
_LONGEST = 4096


def read_format(line: str) -> tuple[str, re.Pattern[str], list[tuple[str, float]]]:
    """Command, pattern of a row, and its channels with their factors to SI.

    >>> command, row, channels = read_format("S{pulse_us} -> {rpm};{thrust_gf}")
    >>> command.format(pulse_us=1200), bool(row.fullmatch("5100;-3.2e2")), channels[0]
    ('S1200', True, ('rpm', 1.0))
    """
    out, arrow, back = line.partition(" -> ")
    faults, channels = [], []
    if not arrow or out.count("{pulse_us}") != 1:
        faults.append(Fault("", "line", repr(line), f"a command with {{pulse_us}}, an arrow, a row, as in {LINE}"))
    for name in re.findall(r"\{(\w+)\}", back):
        what, _, unit = name.partition("_")
        known = factor(what, unit or what) if what in CHANNELS else math.nan
        if math.isnan(known):
            expected = f"a channel and its unit: {', '.join(CHANNELS)}"
            faults.append(Fault("", "line", f"{{{name}}}", expected, "As thrust_gf"))
        else:
            channels.append((CHANNELS[what][0], known))
    missing = [c for c in ("thrust_N", "rpm") if c not in dict(channels)]
    if missing and not faults:
        faults.append(Fault("", "line", f"no {', no '.join(missing)}", "speed and thrust among the channels"))
    refuse(faults)
    pattern = re.sub(r"\\\{\w+\\\}", r"\\s*([-+.\\deE]+|nan|NaN)\\s*", re.escape(back))
    return out, re.compile(pattern), channels


class _Line:
    def __init__(self, port: Any, command: str, pattern: re.Pattern[str], channels: list[tuple[str, float]]) -> None:
        self.port, self.command, self.pattern, self.channels = port, command, pattern, channels
        self.text, self.row = "", dict[str, float]()

    def write(self, pulse_us: float) -> None:
        self.port.write(self.command.format(pulse_us=round(pulse_us)).encode() + b"\n")

    def read(self) -> dict[str, float]:
        waiting = self.port.in_waiting
        self.text += self.port.read(waiting).decode("ascii", "replace") if waiting else ""
        *lines, self.text = self.text[-_LONGEST:].split("\n")
        for found in filter(None, map(self.pattern.fullmatch, map(str.strip, lines))):
            row = {name: float(v) * f for (name, f), v in zip(self.channels, found.groups(), strict=True)}
            self.row = {**row, "stamp_s": row.get("stamp_s", time.monotonic())}
        return self.row

    def close(self) -> None:
        self.port.close()


def connect(address: str, line: str) -> _Line:
    """Open device@baud."""
    device, baud = parts(address, r"(\S+)@(\d+)", "device@baud, such as /dev/ttyUSB0@115200")
    form = read_format(line or LINE)
    serial = needs("serial", "stand")
    try:
        return _Line(serial.serial_for_url(device, int(baud), timeout=0.0, write_timeout=0.2), *form)
    except serial.SerialException as error:
        raise InputError(Fault("", "address", f"{address}: {error}", "a serial device that can be opened")) from error

"""RCbenchmark 1520, 1580, 1585: JSON over UDP, from the script ``rcbenchmark.js`` in the stand's own program.

Each datagram is a whole result of its sensors: name -> workingValue, workingUnit. The unit is taken as it is told.
"""

from __future__ import annotations

import json
import math
import socket
import time

from bemt.base.errors import Fault, InputError
from bemt.base.units import UNITS
from bemt.tools.stand.drivers import parts, silent

_CHANNELS = {
    "thrust": "thrust_N", "torque": "torque_Nm", "motorOpticalSpeed": "rpm", "current": "current_A",
    "voltage": "voltage_V", "vibration": "vibration_m_s2", "airspeed": "airspeed_m_s",
}  # fmt: skip
_THEIRS = {"N·m": "Nm", "N.m": "Nm", "g": "gf", "kg": "kgf", "m/s": "m_s"}
_OTHER = {("vibration_m_s2", "g"): 9.80665, ("vibration_m_s2", "m/s²"): 1.0, ("rpm", "RPM"): 1.0}
_FIRST_S = 2.0


class _Script:
    def __init__(self, host: str, there: int, here: int) -> None:
        self.to = (host, there)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        try:
            self.socket.bind(("", here))
        except OSError as error:
            self.socket.close()
            got = f"port {here}: {error.strerror}"
            raise InputError(Fault("", "address", got, "a port that nobody has", "Is another sitting open?")) from error
        self.row: dict[str, float] = {}

    def write(self, pulse_us: float) -> None:
        self.socket.sendto(f"{pulse_us:.0f}".encode(), self.to)

    def read(self) -> dict[str, float]:
        while True:
            try:
                data, sender = self.socket.recvfrom(65536)
            except (BlockingIOError, ConnectionError):
                return self.row
            if sender[0] == socket.gethostbyname(self.to[0]) and data[:1] == b"{":  # the script also says hello
                self.row = {**_row(json.loads(data)), "stamp_s": time.monotonic()}

    def close(self) -> None:
        self.socket.close()


def _row(told: dict[str, dict[str, object]]) -> dict[str, float]:
    """Channels of a result in SI; NaN where the unit is not known."""
    row = {}
    for theirs, ours in _CHANNELS.items():
        cell = told.get(theirs)
        if not isinstance(cell, dict):
            continue
        value, unit = cell.get("workingValue"), str(cell.get("workingUnit", ""))
        known = UNITS.get(_THEIRS.get(unit, unit))
        factor = _OTHER.get((ours, unit), known.factor if known else math.nan)
        row[ours] = float(value) * factor if isinstance(value, int | float) else math.nan
    return row


def connect(address: str, line: str) -> _Script:
    """Open host:port-of-the-script:own-port, and wait for the first result."""
    host, there, here = parts(address, r"(\S+):(\d+):(\d+)", "host:port:own port, such as 127.0.0.1:55047:64126")
    wire, until = _Script(host, int(there), int(here)), time.monotonic() + _FIRST_S
    while not wire.read():
        if time.monotonic() > until:
            wire.close()
            raise silent(address, "rows from rcbenchmark.js")
        wire.write(1000.0)
        time.sleep(0.02)
    return wire

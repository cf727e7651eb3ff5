"""RCbenchmark 1520, 1580, 1585: JSON over UDP, from the script ``rcbenchmark.js`` in the stand's own program.

Each datagram is a whole result of its sensors: name -> workingValue, workingUnit. The unit is taken as it is told.
"""

from __future__ import annotations

import json
import math
import socket
import time
from collections.abc import Mapping

from bemt.base.errors import Fault, InputError
from bemt.tools.stand.drivers import CHANNELS, factor, parts

ROWS = "rows from rcbenchmark.js"
_THEIRS = {"rpm": "motorOpticalSpeed"}  # Names that are not ours


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


def _row(told: Mapping[str, Mapping[str, object]]) -> dict[str, float]:
    """Channels of a result in SI; NaN where the unit is not known."""
    row = {}
    for name, (ours, _) in CHANNELS.items():
        cell = told.get(_THEIRS.get(name, name))
        if isinstance(cell, Mapping):
            value = cell.get("workingValue")
            known = factor(name, str(cell.get("workingUnit", "")))
            row[ours] = float(value) * known if isinstance(value, int | float) else math.nan
    return row


def connect(address: str, line: str) -> _Script:
    """Open host:port-of-the-script:own-port."""
    host, there, here = parts(address, r"(\S+):(\d+):(\d+)", "host:port:own port, such as 127.0.0.1:55047:64126")
    return _Script(host, int(there), int(here))

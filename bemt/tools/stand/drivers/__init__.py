"""Wires to stands, a file each: ``connect(address, line)`` gives a :class:`Wire`.

``flightstand`` (Tyto's client, gRPC), ``rcbenchmark`` (JSON over UDP, a script in its own program) and ``serial``
(lines). The simulated stand is behind one of these, too.
"""

from __future__ import annotations

import importlib
import re
import time
from functools import cache
from typing import Protocol

from bemt.base.errors import Fault, InputError
from bemt.base.units import RPM

DEFAULTS = {"flightstand": "localhost:50051", "rcbenchmark": "127.0.0.1:55047:64126", "serial": "/dev/ttyUSB0@115200"}
"""Addresses where the makers' programs and most boards are."""
CHANNELS = {
    "thrust": ("thrust_N", "force"), "torque": ("torque_Nm", "torque"), "rpm": ("rpm", "angular_speed"),
    "current": ("current_A", "current"), "voltage": ("voltage_V", "voltage"), "time": ("stamp_s", "time"),
    "vibration": ("vibration_m_s2", "acceleration"), "airspeed": ("airspeed_m_s", "speed"),
}  # fmt: skip
"""What a wire may tell: our channel, and the dimension of its unit."""
PATIENCE_S = 0.2
"""Longest wait for the other end; the guard sets it."""
_STOP_US, _FIRST_S = 1000.0, 3.0  # What is written until the first row has come, and how long that may take


class Wire(Protocol):
    """The other end of a wire; OSError where it is lost."""

    def write(self, pulse_us: float) -> None:
        """Set the pulse width. [us]"""

    def read(self) -> dict[str, float]:
        """Give the latest row: thrust_N, torque_Nm, rpm, what else there is, and stamp_s of the other end's clock."""

    def close(self) -> None:
        """Let go of the wire."""


def connect(driver: str, address: str = "", line: str = "") -> Wire:
    """Open a wire at an address, by default that of :data:`DEFAULTS`, and wait for the first row.

    ``line`` is the format of a serial line. InputError where nothing answers, and for a library that is missing.
    """
    address = address or DEFAULTS[driver]
    driven = importlib.import_module(f"bemt.tools.stand.drivers.{driver}")
    wire: Wire = driven.connect(address, line)
    until = time.monotonic() + _FIRST_S
    try:
        while not wire.read() and time.monotonic() < until:
            wire.write(_STOP_US)
            time.sleep(0.02)
        if wire.read():
            return wire
    except OSError:
        pass
    wire.close()
    raise silent(address, f"rows like {line}" if line else driven.ROWS)


@cache
def factor(name: str, unit: str) -> float:
    """Factor of a unit, as people write it, to that of the channel; NaN where it is none.

    >>> factor("thrust", "gf"), factor("rpm", "RPM"), factor("thrust", "V")
    (0.00980665, 1.0, nan)
    """
    from bemt.data.readers.unit_text import unit_for  # not of every guard: it starts sooner

    dimension = CHANNELS[name][1]
    known = unit_for(dimension, unit) or unit_for(dimension, unit.replace("_", "/"))
    return known[0].factor / (RPM if name == "rpm" else 1.0) if known else float("nan")


def parts(address: str, pattern: str, expected: str) -> tuple[str, ...]:
    r"""Parts of an address.

    >>> parts("127.0.0.1:55047:64126", r"(.+):(\d+):(\d+)", "host:port:port")
    ('127.0.0.1', '55047', '64126')
    """
    found = re.fullmatch(pattern, address)
    if found is None:
        raise InputError(Fault("", "address", repr(address), expected))
    return found.groups()


def silent(address: str, what: str) -> InputError:
    """Nothing answers there."""
    return InputError(Fault("", "address", f"no answer from {address}", what, "Is the stand's own program running?"))

"""Wires to stands, a file each: ``connect(address, line)`` gives a :class:`Wire`.

``flightstand`` (Tyto's client, gRPC), ``rcbenchmark`` (JSON over UDP, a script in its own program) and ``serial``
(lines). The simulated stand is behind one of these, too.
"""

from __future__ import annotations

import importlib
import re
from typing import Protocol

from bemt.base.errors import Fault, InputError

NAMES = ("flightstand", "rcbenchmark", "serial")
"""Drivers, one file each."""
DEFAULTS = {"flightstand": "localhost:50051", "rcbenchmark": "127.0.0.1:55047:64126", "serial": "/dev/ttyUSB0@115200"}
"""Addresses where the makers' programs and most boards are."""
PATIENCE_S = 0.2
"""Longest wait for the other end; the guard sets it."""


class Wire(Protocol):
    """The other end of a wire; OSError where it is lost."""

    def write(self, pulse_us: float) -> None:
        """Set the pulse width. [us]"""
        ...

    def read(self) -> dict[str, float]:
        """Give the latest row: thrust_N, torque_Nm, rpm, what else there is, and stamp_s of the other end's clock."""
        ...

    def close(self) -> None:
        """Let go of the wire."""
        ...


def connect(driver: str, address: str = "", line: str = "") -> Wire:
    """Open a wire.

    Parameters
    ----------
    driver : str
        One of :data:`NAMES`.
    address : str
        Where the stand is; :data:`DEFAULTS` where it is empty.
    line : str
        Format of a serial line.

    Raises
    ------
    InputError
        For an address where nothing answers, and for a library that is missing.
    """
    wire: Wire = importlib.import_module(f"bemt.tools.stand.drivers.{driver}").connect(
        address or DEFAULTS[driver], line
    )
    return wire


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

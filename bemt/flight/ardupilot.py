"""ArduPilot: DataFlash (``.BIN``), read by pymavlink. Messages as in ArduPilot's log documentation; NED and FRD axes.

Motors are the outputs whose SERVOn_FUNCTION is 33 to 40 (motors 1 to 8) or 82 to 85 (9 to 12).
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError, needs
from bemt.flight.log import FlightLog, Source, joined

Array = NDArray[np.float64]
KIND = "ArduPilot DataFlash"
_TYPES = ("RCOU", "RCO2", "ESC", "IMU", "ATT", "BAT", "XKF1", "NKF1")
_FLIP = np.array([1.0, -1.0, -1.0])
_FUNCTIONS = {**{33 + i: i for i in range(8)}, **{82 + i: 8 + i for i in range(4)}}


def sniff(head: bytes) -> bool:
    """Whether the first bytes are those of such a log: a format message of formats."""
    return head[:4] == b"\xa3\x95\x80\x80"


def read(path: Path) -> FlightLog:
    """Read a log, as far as it is whole; messages stream, so the size does not matter."""
    name = str(path)
    base = needs("pymavlink.DFReader", "flight").DFReader_binary
    # The compiled index prints past Python's streams; the other one tells of damage where it can be heard.
    slow = {"init_arrays_fast": lambda self, progress_callback=None: self.init_arrays(progress_callback)}

    def made(self: Any, file: str) -> None:
        try:
            base.__init__(self, file)
        except Exception:
            # The library leaves the file open when it cannot index it.
            for held in ("data_map", "filehandle"):
                if hasattr(self, held):
                    getattr(self, held).close()
            raise

    reader = type("DataFlash", (base,), {"__init__": made, **slow})
    rows: dict[tuple[str, int], list[dict[str, Any]]] = {}
    noise = io.StringIO()
    stopped, params = "", {}
    try:
        with (
            contextlib.redirect_stdout(noise),
            contextlib.redirect_stderr(noise),
            contextlib.closing(reader(name)) as log,
        ):
            try:
                while (m := log.recv_match(type=list(_TYPES))) is not None:
                    row = m.to_dict()
                    kind = row.pop("mavpackettype")
                    which = row.get("Instance", row.get("I", row.get("C", 0)))
                    rows.setdefault((kind, int(which)), []).append(row)
            except Exception as error:  # a parser meets any damage
                stopped = f"damaged; reading ended ({type(error).__name__})"
            params = dict(log.params)
    except Exception as error:
        got = f"a damaged log ({type(error).__name__}: {error})"
        raise InputError(Fault(name, "", got, "whole DataFlash messages", "Download the log again")) from error
    if noise.getvalue() and not stopped:
        stopped = "damaged; unreadable bytes were skipped"
    try:
        return _made(name, rows, params, stopped)
    except (TypeError, ValueError, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(Fault(name, "", f"a damaged log ({error})", "whole DataFlash messages")) from error


def _made(name: str, rows: dict[tuple[str, int], list[dict[str, Any]]], params: dict[str, Any], ends: str) -> FlightLog:
    def take(kind: str, keys: tuple[str, ...], which: int = 0) -> Source | None:
        found = [r for r in rows.get((kind, which), []) if all(k in r for k in ("TimeUS", *keys))]
        if len(found) < 2:
            return None
        t = 1e-6 * np.array([r["TimeUS"] for r in found], dtype=float)
        return t, np.array([[r[k] for k in keys] for r in found], dtype=float)

    def flipped(source: Source | None) -> Source | None:
        return None if source is None else (source[0], source[1] * _FLIP)

    motors = sorted(
        (i, n) for n in range(1, 15) if (i := _FUNCTIONS.get(int(params.get(f"SERVO{n}_FUNCTION", 0)), -1)) >= 0
    )
    outputs = tuple(f"C{n}" for _, n in motors) or ("C1", "C2", "C3", "C4")
    speeds = [take("ESC", ("RPM",), i) for i in range(len(outputs))]
    currents = [take("ESC", ("Curr",), i) for i in range(len(outputs))]
    att, battery = take("ATT", ("Roll", "Pitch")), take("BAT", ("Volt", "Curr"))
    state = "XKF1" if ("XKF1", 0) in rows else "NKF1"
    command = take("RCOU", outputs)
    sources = {
        "command": command,
        "rpm": _together(speeds),
        "current": _together(currents),
        "acceleration": flipped(take("IMU", ("AccX", "AccY", "AccZ"))),
        "rates": flipped(take("IMU", ("GyrX", "GyrY", "GyrZ"))),
        "upright": (att[0], np.prod(np.cos(np.radians(att[1])), axis=1)) if att else None,
        "velocity": flipped(take(state, ("VN", "VE", "VD"))),
        "position": flipped(take(state, ("PN", "PE", "PD"))),
        "voltage": (battery[0], battery[1][:, 0]) if battery else None,
        "battery_current": (battery[0], battery[1][:, 1]) if battery else None,
    }
    layout = "px4-x" if len(outputs) == 4 and int(params.get("FRAME_TYPE", 1)) == 1 else ""
    main = "command" if command else "rpm" if sources["rpm"] else "acceleration"
    return joined(name, KIND, sources, main, command_unit="us", layout=layout, ends=ends)


def _together(parts: list[Source | None]) -> Source | None:
    """Rotors with clocks of their own, on that of the first."""
    whole = [p for p in parts if p is not None]
    if len(whole) < max(len(parts), 1) or not whole:
        return None
    t = whole[0][0]
    return t, np.stack([np.interp(t, at, v[:, 0]) for at, v in whole], axis=1)

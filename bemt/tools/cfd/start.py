"""Start of a run from the flow of another on the same grid: internal fields, scaled by similarity.

Velocities go with the speed of rotation, pressures with its square; the change of the wind is added. Boundary
conditions are those of the new run.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

_FIELD = re.compile(rb"internalField\s+nonuniform\s+List<(scalar|vector)>\s*(\d+)\s*\(")
_UNIFORM = re.compile(rb"internalField\s+uniform[^;]*;")
POWERS = {"U": 1, "p": 2, "k": 2, "omega": 1, "epsilon": 3, "nut": 1}


@dataclass(frozen=True)
class StartField:
    """What a flow was computed for."""

    rpm: float  # Speed [rev/min]
    wind: tuple[float, float, float]  # Velocity far away [m/s]
    pressure: float  # Static pressure far away; 0 for kinematic pressures [Pa]
    compressible: bool  # Whether pressures are absolute


def splice(name: str, source: bytes, target: bytes, old: StartField, new: StartField) -> bytes | None:
    """Put the internal field of one file, scaled, into another."""
    found, place = _FIELD.search(source), _UNIFORM.search(target)
    power = POWERS.get(name)
    if found is None or place is None or power is None or (name == "p" and old.compressible != new.compressible):
        return None
    width = 3 if found[1] == b"vector" else 1
    count = int(found[2])
    data = source[found.end() : found.end() + 8 * width * count]
    if len(data) != 8 * width * count:
        return None
    values = np.frombuffer(data, dtype="<f8").reshape(count, width)
    ratio = (new.rpm / old.rpm) ** power
    if name == "p":
        values = new.pressure + (values - old.pressure) * ratio
    else:
        values = values * ratio
    if name == "U":
        values = values + (np.array(new.wind) - np.array(old.wind) * ratio)
    if not np.all(np.isfinite(values)):
        return None
    head = b"internalField   nonuniform List<" + found[1] + b">\n" + str(count).encode() + b"\n("
    body = head + np.ascontiguousarray(values, dtype="<f8").tobytes() + b")\n;"
    text = target[: place.start()] + body + target[place.end() :]
    return re.sub(rb"format\s+ascii;", b"format binary;", text, count=1)

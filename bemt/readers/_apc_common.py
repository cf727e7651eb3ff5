"""What both APC files share: sizes from the designation, and provenance; see :mod:`bemt.readers.apc`."""

from __future__ import annotations

import math
import re

from bemt.base.errors import Fault
from bemt.readers import SourceText

SOURCE = "APC Propellers (Landing Products), published data file"


def _readings(token: str, low: float, high: float) -> float | None:
    """Largest reading of a size within limits; a printed decimal point is final."""
    tries = [float(token)] if "." in token else [float(token) / 10**k for k in range(len(token))]
    return next((value for value in tries if low <= value <= high), None)


def parse_designation(text: str) -> tuple[float, float, int] | None:
    """Read diameter, pitch and blade number from an APC designation.

    >>> parse_designation("134x135-3"), parse_designation("10x47SF"), parse_designation("525x475")
    ((13.4, 13.5, 3), (10.0, 4.7, 2), (5.25, 4.75, 2))
    >>> parse_designation("propeller") is None
    True
    """
    match = re.match(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)(.*)$", text.strip(), re.IGNORECASE)
    diameter = _readings(match[1], 4.0, 28.0) if match else None
    if match is None or diameter is None:
        return None
    pitch = _readings(match[2], 0.25 * diameter, 1.7 * diameter) or _readings(match[2], 0.25 * diameter, 2.5 * diameter)
    blades = re.search(r"-B?([2-8])(?![0-9A-Za-z])", match[3])
    return None if pitch is None else (diameter, pitch, int(blades[1]) if blades else 2)


def designation(source: SourceText, faults: list[Fault]) -> tuple[str, tuple[float, float, int]]:
    """Name and sizes from the first line with text, which reads ``10x4.7SF   (10x47SF.dat)``."""
    at, line = next(((i, s) for i, s in enumerate(source.lines, 1) if s.strip()), (1, ""))
    name = re.split(r"\s{2,}|\(", line.strip())[0].strip()
    for text in (name, *re.findall(r"\((.*?)\.dat\)", line)):
        if sizes := parse_designation(text):
            return name or text, sizes
    hint = "The first line should name the propeller"
    faults.append(Fault(source.name, str(at), repr(line.strip()[:60]), "a designation such as 10x4.7SF", hint))
    return name, (math.nan, math.nan, 2)


def provenance(source: SourceText, remark: str) -> dict[str, str]:
    """Provenance of what one file gave."""
    return {"source": SOURCE, "file": source.name, "sha256": source.sha256, "remark": remark}

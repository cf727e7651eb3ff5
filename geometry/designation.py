"""Propeller designations such as 8x5: diameter x pitch in inches."""

from __future__ import annotations

import math
import re

from geometry.common import Faults, GeometryError


def parse_designation(text: str) -> tuple[float, float, int | None]:
    """Read a propeller designation: diameter x pitch in inches, with an optional blade count.

    >>> parse_designation("10x4.7"), parse_designation("8x5x3")
    ((10.0, 4.7, None), (8.0, 5.0, 3))
    >>> parse_designation("10x47")
    Traceback (most recent call last):
        ...
    geometry.common.GeometryError: '10x47': got pitch/diameter 4.7; expected a ratio from 0.1 to 2.5. Meant 10x4.7?
    """
    number = r"(\d+(?:\.\d*)?|\.\d+)"
    match = re.fullmatch(rf"\s*{number}\s*[x×*]\s*{number}(?:\s*[x×*-]\s*(\d+))?\s*([A-Za-z]*)\s*", text, re.IGNORECASE)
    expected = "diameter x pitch in inches, such as 8x5, 10x4.7 or 8x5x3"
    where = repr(text)
    if match is None:
        hint = "Decimal point, not comma" if "," in text else ""
        raise GeometryError([(where, "unreadable text", expected, hint)])
    if match[4]:
        raise GeometryError([(where, f"a suffix '{match[4]}'", expected, "Leave the letters out")])
    faults = Faults()
    d, p, blades = float(match[1]), float(match[2]), int(match[3]) if match[3] else None
    lost = "." not in match[1] and d > 120
    faults.number(where, d, 0.5, 120.0, "in", f"Meant {d / 10:g}? Millimetres need division by 25.4" if lost else "")
    ratio = p / d if d > 0 else math.inf
    if not 0.1 <= ratio <= 2.5:
        meant = "." not in match[2] and 0.1 <= ratio / 10 <= 2.5
        hint = f"Meant {d:g}x{p / 10:g}?" if meant else "Diameter comes first"
        faults.add(where, f"pitch/diameter {ratio:.3g}", "a ratio from 0.1 to 2.5", hint)
    if blades is not None:
        faults.number(where, blades, 1, 16, "blades")
    faults.check()
    return d, p, blades

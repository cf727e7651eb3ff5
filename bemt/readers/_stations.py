"""Tables of blade stations as people write them: r, chord and blade angle, lengths or shares of R or D."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.readers import SourceText, load_text, number
from bemt.readers._headings import unit_of
from bemt.readers._split import decimal_mark, find_delimiter, split_line, split_table

Array = NDArray[np.float64]

EXPECTED = "r_over_R, chord_over_R and beta_deg; r and chord may be lengths, such as r_mm"
WIDEST = 0.8
"""Largest chord over the tip radius that a blade has: that of the Kaplan propeller Ka 4-70 is 0.78 [1]."""
_NAMES = {
    "r": r"r|radius|radial position|station|x",
    "chord": r"c|chord|chord length|width|blade width",
    "beta": r"beta|blade angle|pitch angle|theta|b",
}
_SHARES = {"R": 1.0, "Rtip": 1.0, "R tip": 1.0, "D": 2.0, "radius": 1.0, "diameter": 2.0}
_TWIST = "An angle to the plane of rotation is beta_deg; twist may count from elsewhere"


def _column(text: str, R: float) -> tuple[str, float] | None:
    """Quantity of a heading, and what makes shares of the tip radius or degrees of its values; None for another."""
    plain = " ".join(text.replace("_", " ").split())
    share = re.fullmatch(r"(.+?) ?(?:/| over ) ?(.+?)(?: ?[\[(] ?-? ?[\])])?", plain)
    if share and share[2] in _SHARES:
        for name in ("r", "chord"):
            if re.fullmatch(_NAMES[name], share[1], re.IGNORECASE):
                return name, _SHARES[share[2]]
    parts = re.fullmatch(r"(.+?) ?[\[(] ?(.+?) ?[\])]|(.+) (\w+)", plain)
    if not parts:
        return None
    base, unit = parts[1] or parts[3], unit_of(parts[2] or parts[4])
    if not isinstance(unit, units.Unit):
        return None
    for name, pattern in _NAMES.items():
        wanted = "angle" if name == "beta" else "length"
        if unit.dimension == wanted and re.fullmatch(pattern, base, re.IGNORECASE):
            return name, unit.factor / units.DEG if name == "beta" else unit.factor / R
    return None


def read_stations(path: Path, R: float) -> tuple[Array, Array, Array]:
    """Columns r/R, c/R and beta [rad] of a table for a tip radius [m], others are left; faults carry line and column.

    Cells are parted by commas, semicolons, tabs or blanks; decimal commas are read where they can be nothing else.
    """
    source = load_text(path)
    file = path.as_posix()
    bare = SourceText(source.name, "\n".join(line.split("#", 1)[0] for line in source.lines), source.sha256)
    used = [(i, line) for i, line in enumerate(bare.lines, 1) if line.strip()]
    if not used:
        raise InputError(Fault(file, "", "0 stations", "two or more"))
    mark = find_delimiter([line for _, line in used[:5]])
    header = split_line(used[0][1], mark)
    found: dict[str, list[tuple[int, float]]] = {"r": [], "chord": [], "beta": []}
    for j, cell in enumerate(header):
        if (column := _column(cell, R)) is not None:
            found[column[0]].append((j, column[1]))
    if not all(found.values()):
        raise InputError(Fault(file, f"{used[0][0]}", f"the header {used[0][1].strip()!r}", EXPECTED, _TWIST))
    faults = [
        Fault(file, f"{used[0][0]}", " and ".join(header[j] for j, _ in columns), "one of them")
        for columns in found.values() if len(columns) > 1
    ]  # fmt: skip
    places = [columns[0] for columns in found.values()]
    decimal = "."
    if mark == ";" and len(used) > 1:
        decimal = decimal_mark(split_table(SourceText(bare.name, "\n".join(t for _, t in used), ""), mark, True))
    rows: list[list[float]] = []
    for i, line in used[1:]:
        cells = split_line(line, mark)
        if len(cells) != len(header):
            faults.append(Fault(file, f"{i}", f"{len(cells)} values", f"{len(header)}, as the header has"))
            continue
        read = [number(cells[j].replace(",", ".") if decimal == "," else cells[j]) for j, _ in places]
        faults += [
            Fault(file, f"{i}:{j + 1}", repr(cells[j]), "a number")
            for value, (j, _) in zip(read, places, strict=True) if value is None
        ]  # fmt: skip
        if None not in read:
            rows.append([float(v) * scale for v, (_, scale) in zip(read, places, strict=True) if v is not None])
    if not faults and len(rows) < 2:
        faults.append(Fault(file, "", f"{len(rows)} stations", "two or more"))
    if faults:
        raise InputError(faults)
    x, c, beta = np.array(rows).T
    faults += _limits(file, header, places, (x, c, beta), R)
    if faults:
        raise InputError(faults)
    return np.minimum(x, 1.0), c, np.radians(beta)


def _limits(
    file: str, header: list[str], places: list[tuple[int, float]], columns: tuple[Array, Array, Array], R: float
) -> list[Fault]:
    """What no blade has, each with the likely reason."""
    x, c, beta = columns
    is_length = places[0][1] not in _SHARES.values()
    limits = ((x.max(), 0.75 if is_length else 0.0, 1.001), (c.max(), 0.0, WIDEST), (np.abs(beta).max(), 0.0, 90.0))
    radius = f"Is the tip radius {1e3 * R:g} mm?" if is_length else "Divide the radius by the tip radius"
    share = places[1][1] in _SHARES.values()
    chord = "Divide the chord by the tip radius; one over the diameter is chord_over_D" if share else radius
    hints = (radius, chord if c.max() > WIDEST else "", "")
    faults = []
    for (at, scale), (value, low, high), hint in zip(places, limits, hints, strict=True):
        if not low <= value <= high:
            expected = f"at most {high / scale:.4g}" if value > high else f"{low / scale:.4g} or more at the outermost"
            faults.append(Fault(file, header[at], f"{value / scale:.4g}", expected, hint))
    if places[2][1] == 1.0 and np.abs(beta).max() < 1.6:
        got = f"angles up to {np.abs(beta).max():g}"
        faults.append(Fault(file, header[places[2][0]], got, "degrees", "Looks like radians"))
    return faults

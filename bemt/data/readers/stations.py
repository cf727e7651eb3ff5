"""Tables of blade stations as people write them: r, chord, blade angle and thickness, lengths or shares."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, load_text, number
from bemt.data.readers._words import english, in_any_language, plain
from bemt.data.readers.split import SplitTable, decimal_mark, odd_mark, split_table
from bemt.data.readers.unit_text import splits, unit_for

EXPECTED = "r_over_R, chord_over_R and beta_deg; r and chord may be lengths, such as r_mm"
LEAST_REACH, USUAL_WIDTH = 0.75, 0.08
"""Radius of the outermost station, and largest chord that a blade hardly goes below, over the tip radius [1]."""
WIDEST = 0.8
"""Largest chord over the tip radius that a blade has: that of the Kaplan propeller Ka 4-70 is 0.78 [1]."""
_HEADS: dict[str, tuple[set[str], set[str]]] = {  # column: its own words, words that change nothing
    "r": ({"r", "radius", "station", "x"}, {"radial", "position", "blade", "local", "of"}),
    "chord": ({"c", "chord", "width"}, {"blade", "length", "local", "section", "of"}),
    "beta": ({"beta", "β", "theta", "θ", "b", "angle"}, {"blade", "pitch", "setting", "section", "local", "of"}),
    "pitch": ({"pitch", "p"}, {"blade", "local", "geometric", "of"}),
    "thickness": ({"thickness", "t"}, {"blade", "local", "section", "relative", "maximum", "max", "ratio", "of"}),
}
_ANGLE = in_any_language("angle")
_TIPS = {"r": 1.0, "rtip": 1.0, "r tip": 1.0, "radius": 1.0, "d": 2.0, "diameter": 2.0}
"""What lengths are shares of, in tip radii."""
_TWIST = "Rename it to beta_deg if it is the angle to the plane of rotation; twist may count from elsewhere"
_NO_HEADINGS = "Add a line of headings, such as r_mm,chord_mm,beta_deg"
LONE_DEG, LONE_TIMES = 20.0, 4.0
"""Angle [deg], and times the chord, by which no station lies off the lines of chord and pitch between its neighbours:
blades of UIUC reach 6 deg and 1.8 times, 12 deg by every fifth of their stations."""
THICKNESSES = (0.01, 0.5)
"""Thicknesses that a case takes, of the chord."""


class BladeStations(NamedTuple):
    """Stations of a blade, ascending; (N,) each. `left` says of each column that is not used why."""

    r_R: Array
    c_R: Array
    beta_rad: Array
    t_c: Array | None = None
    left: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Column:
    """Column of a table of stations: `scale` makes shares of the tip radius, or degrees, of its values."""

    at: int
    name: str
    scale: float
    share: bool
    heading: str


def _meaning(text: str) -> str:
    """Column that the words of a heading mean; empty for another.

    >>> [_meaning(t) for t in ("Rayon", "chord_c", "Einstellwinkel β", "local pitch", "angle", "twist angle")]
    ['r', 'chord', 'beta', 'pitch', '', '']
    """
    said = set(english(text))
    return next((n for n, (own, harmless) in _HEADS.items() if said & own and said <= own | harmless
                 and said != {"angle"}), "")  # fmt: skip


def _share(text: str) -> tuple[str, float] | None:
    """Column and scale of a length over the tip radius or the diameter: ``r/R``, ``2 c/D``."""
    found = re.fullmatch(r"(2 ?)?(.+?) ?/ ?(.+)", text.strip())
    if not found:
        return None
    name = _meaning(found[2])
    if name == "thickness" and _meaning(found[3]) == "chord":
        return name, 1.0
    if plain(found[3]) not in _TIPS or name not in ("r", "chord", "pitch"):
        return None
    return name, _TIPS[plain(found[3])] * (0.5 if found[1] else 1.0)


def _of_hundred(unit: str) -> float:
    return 0.01 if "%" in unit else 1.0


def column_of(at: int, text: str, R: float) -> _Column | None:
    """What a heading stands for; None for another. An angle without a unit is in degrees, or refused as too small."""
    bare = re.sub(r"[ _]over[ _]", "/", " ".join(text.split()))
    ways = [*splits(bare), *([(tail[1], "in")] if (tail := re.fullmatch(r"(.+) in", bare)) else [])]
    for base, unit in ways:
        if unit in ("", "-", "1", "%") and (share := _share(base)):
            return _Column(at, share[0], share[1] * _of_hundred(unit), True, text)
        name = _meaning(base)
        if name == "thickness" and (of_chord := re.fullmatch(r"(%?) ?(?:of )?(?:c|chord)|%|-|", unit)):
            return _Column(at, name, _of_hundred(of_chord[0]), True, text)
        if (share := _share(unit)) and share[0] == name:  # radius [r/R]
            return _Column(at, name, share[1], True, text)
        of_tip = re.fullmatch(r"(%?) ?(?:of )?R|-", unit)
        if of_tip and (name == "r" or (name == "chord" and unit != "-")):
            return _Column(at, name, _of_hundred(unit), True, text)
        if name in ("beta", "pitch") and (angle := unit_for("angle", unit)):
            return _Column(at, "beta", angle[0].factor / units.DEG, False, text)
        if name in ("r", "chord", "pitch", "thickness") and (length := unit_for("length", unit)):
            return _Column(at, name, length[0].factor / R, False, text)
    return _Column(at, "beta", 1.0, False, text) if _meaning(bare) == "beta" else None


def _hint(headings: Sequence[str], lacking: Sequence[str]) -> str:
    """Reason why a table of stations lacks a column."""
    if any(h.rstrip(" )]").endswith("%") for h in headings):
        return "Write what a share is of: r/R %, c/R % or c/D %"
    if bare := [h for h in headings if _meaning(h) in lacking]:
        return f"Write the units, such as {', '.join(f'{h} (mm)' for h in bare)}; shares of the tip radius are r/R, c/R"
    if all(number(h) is not None for h in headings):
        return _NO_HEADINGS
    if "beta" in lacking and any("twist" in plain(h).split() for h in headings):
        return _TWIST
    read = [f"{h!r} as {column.name}" for h in headings if (column := column_of(0, h, 1.0))]
    return f"Understood: {', '.join(read)}" if read else ""


def read_stations(path: Path, R: float) -> BladeStations:
    """Stations of a table for a tip radius [m], other columns are named; faults carry line and column.

    Cells are parted by commas, semicolons, tabs or blanks; decimal commas are read where they can be nothing else. A
    column of local pitch (``pitch_mm``, ``P/D``) stands for the angle, beta = arctan(pitch / 2 pi r).
    """
    whole = load_text(path)
    source = SourceText(path.as_posix(), "\n".join(line.split("#", 1)[0] for line in whole.lines), whole.sha256)
    if not source.text.strip():
        source.refuse("", "0 stations", "two or more")
    table = split_table(source, header=True, most_misfits=1.0)
    by_name, told = _by_name(table, R)
    places = _places(source, table, by_name)
    decimal = decimal_mark(table)
    if decimal == "." and (odd := odd_mark(table)):
        source.refuse("", odd, "one decimal mark")
    columns = _numbers(source, table, places, decimal)
    rows = _rootwards(source, table, places[0], columns[0])
    x, chord, beta = (values[rows] for values in columns)
    if places[2].name == "pitch":
        beta = np.degrees(np.arctan2(beta, 2.0 * np.pi * x))
    _limits(source, places, (x, chord, beta), R)
    source.check()
    _mistyped(source, table, rows, places, (x, chord, beta))
    source.check()
    thick, left = _thickness(table, by_name["thickness"], decimal, rows, chord)
    used = {c.at for c in (*places, *by_name["thickness"])}
    left += [f"column {h!r} not used" for j, h in enumerate(table.headings) if j not in used and h.strip()]
    return BladeStations(np.minimum(x, 1.0), chord, np.radians(beta), thick, (*told, *left))


def _by_name(table: SplitTable, R: float) -> tuple[dict[str, list[_Column]], list[str]]:
    """Columns by what they stand for; where no other is, the one angle of a table is the blade's, which is told."""
    found = [column for j, text in enumerate(table.headings) if (column := column_of(j, text, R))]
    angles = [(j, h) for j, h in enumerate(table.headings) if _ANGLE.search(plain(h))]
    told = []
    if len(angles) == 1 and not {"beta", "pitch"} & {column.name for column in found}:
        (j, h), *_ = angles
        if column := column_of(j, _ANGLE.sub("blade angle", plain(h)), R):
            found.append(column)
            told = [f"column {h!r} read as beta_deg, the angle to the plane of rotation"]
    return {name: [c for c in found if c.name == name] for name in _HEADS}, told


def _places(source: SourceText, table: SplitTable, by_name: Mapping[str, list[_Column]]) -> list[_Column]:
    """Columns of radius, chord, and angle or pitch; refused where one lacks, faults where one is there twice."""
    top = table.headings_line
    wanted = ("r", "chord", "beta" if by_name["beta"] or not by_name["pitch"] else "pitch")
    if lacking := [name for name in wanted if not by_name[name]]:
        got = f"the header {source.lines[top - 1].strip()!r} without {' and '.join(lacking)}"
        source.refuse(top, got, EXPECTED, _hint(table.headings, lacking))
    for name in wanted:
        if len(by_name[name]) > 1:
            source.add(top, " and ".join(c.heading for c in by_name[name]), "one of them")
    return [by_name[name][0] for name in wanted]


def _numbers(source: SourceText, table: SplitTable, places: Sequence[_Column], decimal: str) -> list[Array]:
    """Values of the columns as shares of the tip radius, or degrees, (N,) each; all faults of the cells at once."""
    for i in table.misfits:
        source.add(table.lines[i], "another number of cells", f"{table.width}, as in line {table.headings_line}")
    columns = [table.numbers(place.at, decimal)[0] for place in places]
    for place, values in zip(places, columns, strict=True):
        for i in np.flatnonzero(np.isnan(values)).tolist():
            if i not in table.misfits:
                source.add(f"{table.lines[i]}:{place.at + 1}", repr(table.cell(i, place.at)), "a number")
    source.faults.sort(key=lambda fault: int(fault.where.split(":")[0]))
    if not source.faults and len(table) < 2:
        source.add("", number_of(len(table), "station"), "two or more")
    source.check()
    return [values * place.scale for place, values in zip(places, columns, strict=True)]


def _rootwards(source: SourceText, table: SplitTable, place: _Column, r: Array) -> NDArray[np.intp]:
    """Rows of the table from root to tip, (N,); it may begin at either end."""
    rows = np.arange(len(r))
    if np.all(np.diff(r) < 0.0):
        return rows[::-1]
    for i in np.flatnonzero(np.diff(r) <= 0.0)[:1].tolist():
        got = f"{table.cell(i + 1, place.at)} after {table.cell(i, place.at)}"
        source.add(f"{table.lines[i + 1]}:{place.at + 1}", got, "radii that ascend from line to line")
    source.check()
    return rows


def _mistyped(
    source: SourceText, table: SplitTable, rows: NDArray[np.intp], places: Sequence[_Column],
    columns: tuple[Array, Array, Array],
) -> None:  # fmt: skip
    """Faults of a chord and of an angle that lie far off the line between their neighbours."""
    x, chord, beta = columns
    pitch = _between(x, x * np.tan(np.radians(beta)))  # a screw's is the same everywhere
    width, angle = _between(x, chord), np.degrees(np.arctan2(pitch, x[1:-1]))
    for place, usual, off, far in (
        (places[1], width, np.abs(np.log(chord[1:-1] / width)), np.log(LONE_TIMES)),
        (places[2], 2.0 * np.pi * pitch if places[2].name == "pitch" else angle, np.abs(beta[1:-1] - angle), LONE_DEG),
    ):
        if off.size and off.max() > far:
            k = int(np.argmax(off))
            row = int(rows[k + 1])
            expected = f"about {usual[k] / place.scale:.3g}, as its neighbours have it"
            source.add(f"{table.lines[row]}:{place.at + 1}", table.cell(row, place.at), expected, "Mistyped?")


def _thickness(
    table: SplitTable, columns: Sequence[_Column], decimal: str, rows: NDArray[np.intp], chord: Array
) -> tuple[Array | None, list[str]]:
    """Thickness over chord, (N,), if one column says it for every station; else why not."""
    if not columns:
        return None, []
    column = columns[0]
    thick = table.numbers(column.at, decimal)[0][rows] * column.scale
    if len(columns) > 1 or not np.all(np.isfinite(thick)):
        why = "two of thickness" if len(columns) > 1 else "not a number at every station"
        return None, [f"column {c.heading!r} not used: {why}" for c in columns]
    thick = thick if column.share else thick / chord
    if THICKNESSES[0] <= thick.min() and thick.max() <= THICKNESSES[1]:
        return thick, []
    why = f"{thick.min():.3g} to {thick.max():.3g} of the chord; a section has 0.01 to 0.5"
    return None, [f"column {column.heading!r} not used: {why}. Per cent is t/c %, a length t_mm"]


def _between(x: Array, values: Array) -> Array:
    """Line between the neighbours of each inner station, there, (N - 2,)."""
    share = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
    return np.asarray(values[:-2] * (1.0 - share) + values[2:] * share)


def _other_unit(place: _Column, value: float, low: float, high: float, R: float) -> str:
    """Units of a column, or of the diameter, that bring a share of the tip radius between two bounds, as questions."""
    size, D, length = place.scale * R, 2e3 * R, {u: units.UNITS[u].factor for u in ("mm", "cm", "in", "m")}
    said = [f"Numbers in {u} under {place.heading}?" for u, f in length.items() if low <= value * f / size <= high]
    for u, f in length.items():
        if u != "mm" and low <= value * 1e-3 / f <= high:
            option = f"--diameter-in {D:g}" if u == "in" else f"--diameter-mm {1e3 * f * D:g}"
            said.append(f"A diameter of {D:g} mm? {D:g} {u} is {option}")
    return " ".join([f"Is the tip radius {1e3 * R:g} mm?", *said[:2]])


def _limits(source: SourceText, places: list[_Column], columns: tuple[Array, Array, Array], R: float) -> None:
    """What no blade has, each with the likely reason."""
    x, c, beta = columns
    is_length = not places[0].share
    limits = (
        (x.max(), LEAST_REACH if is_length else 0.0, 1.001),
        (c.max(), 0.0, WIDEST),
        (np.abs(beta).max(), 0.0, 90.0),
    )
    radius = "Divide the radius by the tip radius"
    if is_length:
        radius = _other_unit(places[0], x.max(), LEAST_REACH, 1.001, R)
    chord = "Divide the chord by the tip radius; one over the diameter is chord_over_D"
    if not places[1].share:
        chord = radius if is_length else _other_unit(places[1], c.max(), USUAL_WIDTH, WIDEST, R)
    hints = (radius, chord if c.max() > WIDEST else "", "")
    for place, (value, low, high), hint in zip(places, limits, hints, strict=True):
        if not low <= value <= high:
            expected = f"at most {high / place.scale:.4g}"
            expected = expected if value > high else f"{low / place.scale:.4g} or more at the outermost"
            source.add(place.heading, f"{value / place.scale:.4g}", expected, hint)
    if places[2].name == "beta" and places[2].scale == 1.0 and np.abs(beta).max() < 1.6:
        source.add(places[2].heading, f"angles up to {np.abs(beta).max():g}", "degrees", "Looks like radians")

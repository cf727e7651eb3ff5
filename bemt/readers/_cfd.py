r"""What the readers of CFD exports share: text of any encoding, and tables that may be damaged.

The rules, once for all formats: columns are matched by the header; a row whose cells do not fit the header is never
shifted into place but left out with a warning, and a file in which more than a few rows do not fit is refused; text
for NaN becomes NaN with a warning; a last row that may be cut is left out; nothing is joined, scaled or turned round.
"""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.readers import WIDE, SourceText, decode, number
from bemt.readers._packed import GZIP

Array = NDArray[np.float64]

_NAN = re.compile(r"[+-]?(nan|n/a|-?1\.#(qnan|snan|ind|inf)\w*|inf(inity)?|null|\*+)(\(\w*\))?", re.IGNORECASE)
_COMMA = re.compile(r"[+-]?\d+,\d+([eEdD][+-]?\d+)?")
_HUGE = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)[eEdD]\+?\d+")
_FIXED = re.compile(r"\d\.\d+[eEdD][+-]\d\d+")
_UNITS = {
    "n": "N", "newton": "N", "nm": "Nm", "pa": "Pa", "pascal": "Pa", "m": "m", "s": "s", "k": "K", "w": "W", "j": "Nm",
    "rad": "rad", "kg": "kg", "rpm": "rpm", "kn": "kN", "kgf": "kgf", "lbf": "lbf", "hz": "rev_s", "u/min": "rpm",
    "lb-f": "lbf", "lbf-ft": "lbf_ft", "lbf-in": "lbf_in", "lb-ft": "lbf_ft", "lb-in": "lbf_in",
}  # fmt: skip
"""Units as programs write them, without blanks, in small letters."""
_POWERS = re.compile(r"(?<=[a-z])\^?(-?[1-9])$")
_TURNS = {"rev": "rev", "revolution": "rev", "u": "rev", "r": "rev", "": "rev", "radian": "rad", "meter": "m"}


@dataclass(frozen=True)
class Column:
    """One column of a header: name as it will appear, unit ("" when none is stated), and its part."""

    name: str
    unit: str = ""
    role: str = "value"
    """value, step (counts), time (seconds) or index (a number of a node)."""


@dataclass(frozen=True)
class ExportRow:
    """Cells of one line."""

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ExportTable:
    """Numbers of a table."""

    values: Array  # (N, K) naN where the file says so
    lines: tuple[int, ...]  # Line of each row
    warnings: tuple[str, ...] = field(default=())  # Rows left out and why


def head_lines(head: bytes | str, count: int = 40) -> list[str]:
    r"""First lines of a file that are not blank, stripped, for sniffers; none for binary data.

    >>> head_lines(b"\n a \r\n\r\nb")
    ['a', 'b']
    """
    if isinstance(head, bytes):
        if head[:2] == GZIP:
            try:
                head = zlib.decompressobj(31).decompress(head, 1 << 16)
            except zlib.error:
                return []
        if b"\0" in head and head[:2] not in WIDE:
            return []
        head = decode(head)
    lines = (line.strip() for line in head.removeprefix("\ufeff").splitlines())
    return [line for line in lines if line][:count]


def cells_of(line: str, separator: str | None) -> tuple[str, ...]:
    """Cells of a line, stripped of blanks and quotes; ``None`` separates by blanks.

    A separator at the end of the line makes no cell.
    """
    if separator is None:
        return tuple(line.split())
    cells = [cell.strip().strip('"').strip() for cell in line.split(separator)]
    return tuple(cells[:-1] if len(cells) > 1 and not cells[-1] else cells)


def unit_of(text: str) -> units.Unit | None:
    """Unit as programs write it, None for one that is unknown.

    >>> [unit_of(t).suffix for t in ("N m", "n-m", " m s^-1 ", "rev min^-1", "radian s^-1", "lbf", "kg m^-3", "m^2")]
    ['Nm', 'Nm', 'm_s', 'rpm', 'rad_s', 'lbf', 'kg_m3', 'm2']
    >>> unit_of("furlong") is None and unit_of("") is None
    True
    """
    plain = " ".join(text.strip().strip("[]()").split())
    if plain in units.UNITS:
        return units.UNITS[plain]
    low = plain.lower()
    word = _UNITS.get(low.replace(" ", "")) or _UNITS.get(low.replace("-", "").replace(" ", ""))
    if word is None:
        over: list[str] = []
        under: list[str] = []
        for k, part in enumerate(re.split(r"[ *.·]|(?=/)", low)):
            below, part = part.startswith("/"), part.lstrip("/")
            power = _POWERS.search(part)
            size = int(power[1]) if power else 1
            base = _TURNS.get(_POWERS.sub("", part), _POWERS.sub("", part)) if part not in ("1",) or k else "rev"
            tail = str(abs(size)) if abs(size) > 1 else ""
            (under if below or size < 0 else over).append(base + tail)
        word = "_".join(["".join(over), "".join(under)]) if under else "".join(over)
        word = {"rev_min": "rpm", "n_m": "Nm", "nm": "Nm", "m_s": "m_s", "pas": "Pa_s"}.get(word, word)
    return units.UNITS.get(word)


def si_unit(text: str) -> str | None:
    """Suffix of an SI unit (or rpm) as programs write it, None for one that is unknown or not SI.

    >>> si_unit("N m"), si_unit(" m s^-1 "), si_unit("n-m"), si_unit("lbf"), si_unit("rev min^-1")
    ('Nm', 'm_s', 'Nm', None, 'rpm')
    """
    found = unit_of(text)
    si = found is not None and (found.suffix == "rpm" or (found.factor == 1.0 and not found.offset))
    return found.suffix if found is not None and si else None


def slug(text: str) -> str:
    """Name in small letters with underscores.

    >>> slug("Wall Shear X")
    'wall_shear_x'
    """
    return re.sub(r"\W+", "_", text.strip().lower()).strip("_") or "unnamed"


def unique(names: Sequence[str]) -> list[str]:
    """Make names unique by ``#2``, ``#3``.

    >>> unique(["x", "y", "x"])
    ['x', 'y', 'x#2']
    """
    taken = set(names)
    out: list[str] = []
    for name in names:
        new, k = name, 2
        while new in out or (k > 2 and new in taken):
            new, k = f"{name}#{k}", k + 1
        out.append(new)
    return out


def _value(text: str, commas: bool) -> float | None:
    """Number of a cell: NaN for what says so or overflows, None when it is no number."""
    value = number(text.replace(",", ".") if commas and _COMMA.fullmatch(text) else text)
    if value is None and (_NAN.fullmatch(text) or _HUGE.fullmatch(text)):
        return float("nan")
    return value


def _maybe_cut(source: SourceText, rows: Sequence[ExportRow]) -> bool:
    """Whether the last row may have lost its end: no line end, and not of the fixed format of the rows before it."""
    if not rows or source.text.endswith(("\n", "\r")) or rows[-1].line != len(source.lines) or not rows[-1].cells:
        return False
    last = rows[-1].cells[-1].lstrip("+-")
    before = [row.cells[-1].lstrip("+-") for row in rows[-50:-1] if row.cells]
    fixed = before and all(_FIXED.fullmatch(cell) and len(cell) == len(before[0]) for cell in before)
    return not (fixed and _FIXED.fullmatch(last) and len(last) == len(before[0]))


def numeric_table(
    source: SourceText, columns: Sequence[Column], rows: Sequence[ExportRow], commas: bool = True
) -> ExportTable:
    """Turn the cells of a table into numbers, by its header."""
    width = len(columns)
    warnings: list[str] = []
    cut = _maybe_cut(source, rows)
    if cut and len(rows) > 1:
        warnings.append(f"line {rows[-1].line}: last row has no line end and may be cut; left out")
        rows = rows[:-1]
    elif cut:
        warnings.append(f"line {rows[-1].line}: the only row has no line end and may be cut")
    has_comma = commas and any(_COMMA.fullmatch(cell) for row in rows for cell in row.cells)
    has_point = has_comma and any("." in cell and _value(cell, False) is not None for row in rows for cell in row.cells)
    comma = has_comma and not has_point
    good: list[list[float]] = []
    lines: list[int] = []
    bad: list[Fault] = []
    widths: Counter[int] = Counter()
    for k, row in enumerate(rows):
        values = [_value(cell, comma) for cell in row.cells]
        fault: Fault | None = None
        if len(values) != width:
            widths[len(values)] += 1
            names = ", ".join(column.name for column in columns[:8])
            fault = Fault(source.name, str(row.line), f"{len(values)} columns", f"{width} as in the header ({names})")
        elif None in values:
            at = values.index(None)
            fault = Fault(source.name, f"{row.line}:{at + 1}", repr(row.cells[at][:40]), "a number")
        if fault is None:
            good.append([v for v in values if v is not None])
            lines.append(row.line)
        elif k == len(rows) - 1 and len(rows) > 1 and not cut:
            warnings.append(f"line {row.line}: last row is cut or damaged ({fault.got}); left out")
        else:
            bad.append(fault)
    if not good or len(bad) > max(2, 0.05 * len(rows)):
        if not bad:
            bad.append(Fault(source.name, "", "no rows of numbers", "one row or more", "Is the file cut?"))
        if widths and widths.most_common(1)[0][1] > 0.5 * len(rows):
            got = f"rows of {widths.most_common(1)[0][0]} columns"
            hint = "A column was dropped or added; export the file again"
            raise InputError(Fault(source.name, str(rows[0].line), got, f"{width} as in the header", hint))
        raise InputError([*bad[:5], *_more(source.name, len(bad) - 5)])
    warnings += [f"line {f.where}: got {f.got}, expected {f.expected}; row left out" for f in bad[:10]]
    if len(bad) > 10:
        warnings.append(f"{len(bad) - 10} more damaged rows left out")
    if comma:
        warnings.append("decimal commas read as decimal points")
    array = np.array(good, dtype=float)
    for k, column in enumerate(columns):
        missing = int(np.count_nonzero(np.isnan(array[:, k])))
        if missing:
            warnings.append(f"{column.name}: {missing} of {len(array)} values are not finite numbers in the file")
    return ExportTable(array, tuple(lines), tuple(warnings))


def _more(name: str, count: int) -> list[Fault]:
    return [Fault(name, "", f"{count} more damaged rows", "rows as in the header")] if count > 0 else []

"""Splitting the text of a table into cells: delimiter, headings, lines of another length.

No line vanishes in silence: what is neither heading nor row is a fault, or a warning that names it.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.readers import SourceText, number
from bemt.readers._headings import unit_of

DELIMITERS = (";", "\t", ",", "|")
MAX_FAULTS = 20
SHEET_ERRORS = frozenset({"#div/0!", "#n/a", "#value!", "#ref!", "#num!", "#name?", "#null!"})
"""What a spreadsheet writes into a cell that it could not compute."""
NO_VALUE = frozenset({"", "nan", "na", "n/a", "-", "--", "\u2013", "\u2014", "null", "none"}) | SHEET_ERRORS
"""Cells that say "no value", in lower case."""
MOST_ODD = 0.1
"""Share of cells that are no numbers from which a column is text."""
MISFIT_SHARE = 0.05
"""Share of lines of another length from which a file is refused."""
_COMMA = re.compile(r"[+-]?(0|[1-9]\d{0,8}),\d+([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_EXCEL = re.compile(r'\s*"?sep=(.)"?\s*', re.IGNORECASE)


@dataclass(frozen=True)
class SplitTable:
    """Cells of a delimited file: headings (empty when it has none), rows of equal length with their line numbers."""

    source: SourceText
    delimiter: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    warnings: tuple[str, ...] = ()
    cut: int | None = None  # index of a row that the end of the file cut off
    misfits: tuple[int, ...] = ()  # rows of another number of cells: kept, without values

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.rows[0]) if self.rows else 0

    def cell(self, row: int, column: int) -> str:
        """One cell."""
        return self.rows[row][column]

    def cells(self, column: int) -> Sequence[str]:
        """Cells of a column."""
        return [row[column] for row in self.rows]

    def numbers(self, column: int, decimal: str = ".") -> tuple[NDArray[np.float64], list[int], int]:
        """Numbers of a column, rows whose cell is none, number of empty cells."""
        return column_numbers(self.cells(column), decimal)


def column_numbers(cells: Sequence[str], decimal: str = ".") -> tuple[NDArray[np.float64], list[int], int]:
    """Numbers of a column."""
    values = np.full(len(cells), np.nan)
    bad: list[int] = []
    empty = 0
    for i, cell in enumerate(cells):
        value = number(cell.replace(",", ".") if decimal == "," and "." not in cell else cell)
        if value is not None:
            values[i] = value
        elif cell.lower() in NO_VALUE:
            empty += 1
        else:
            bad.append(i)
    return values, bad, empty


def split_line(line: str, mark: str) -> list[str]:
    """Cells of one line, quotes taken off."""
    if mark == " ":
        return line.split()
    if '"' in line:
        return [c.strip() for c in next(csv.reader([line], delimiter=mark))]
    return [c.strip() for c in line.split(mark)]


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a line below the headings holds nothing but units."""
    stated = [unit_of(c.strip("()[]")) for c in cells if c.strip("-()[]")]
    return bool(stated) and all(isinstance(u, units.Unit) or u for u in stated)


def some(items: Iterable[object], limit: int = 5) -> str:
    """First few of many, in words.

    >>> some([1, 2]), some(range(9), 3)
    ('1, 2', '0, 1, 2 and 6 more')
    """
    found = list(items)
    more = f" and {len(found) - limit} more" if len(found) > limit else ""
    return ", ".join(map(str, found[:limit])) + more


def find_delimiter(lines: Sequence[str]) -> str:
    """Delimiter of some lines: the first of ``; tab , |`` that all of them have, else blanks.

    >>> find_delimiter(["r;mm,x", "1,2"]), find_delimiter(["a;b", "1,5;2,5"]), find_delimiter(["1 2", "3 4"])
    (',', ';', ' ')
    """
    plain = [re.sub(r'"[^"]*"', "", line) for line in lines]
    everywhere = [mark for mark in DELIMITERS if plain and all(mark in line for line in plain)]
    return everywhere[0] if everywhere else " "


def find_start(lines: Sequence[str]) -> tuple[int, str]:
    """Line of the headings and delimiter of a table that may have lines of text above it.

    Lines above count as such only when they have fewer cells than the rows, and a line of headings without numbers,
    as long as the rows, follows: a damaged line of headings is none.

    >>> find_start(["Run 7", "rpm;T_N", "1;2", "3;4"]), find_start(["sep=;", "rpm;T_N", "1;2"])
    ((1, ';'), (1, ';'))
    """
    excel = _EXCEL.fullmatch(lines[0]) if lines else None
    if excel:
        return 1, excel[1]
    for start in range(1, min(31, len(lines) - 2)):
        mark = find_delimiter(lines[start : start + 3])
        if mark == " ":
            continue
        above = [split_line(line, mark) for line in lines[:start]]
        names, *body = ([c for c in split_line(line, mark)] for line in lines[start : start + 3])
        width = len(names)
        if any(len(cells) >= width for cells in above):
            break
        said = not any(number(c) is not None for c in names) and sum(map(bool, names)) >= max(2, width - 1)
        rows = all(len(cells) == width and any(number(c) is not None for c in cells) for cells in body)
        if said and rows and not _is_units(names):
            return start, mark
    return 0, find_delimiter(lines[:5])


def decimal_mark(table: SplitTable) -> str:
    """Decimal mark of a table: a comma only where it can be nothing else."""
    if table.delimiter == "," or not table.headings:
        return "."
    cells = [cell for row in table.rows for cell in row]
    commas = [cell for cell in cells if re.fullmatch(r"[\d,eE+-]*\d,\d[\d,eE+-]*", cell)]
    pointed = any("." in cell and number(cell) is not None for cell in cells)
    plain = all(_COMMA.fullmatch(cell) for cell in commas)
    return "," if plain and not pointed and any(not _THOUSANDS.fullmatch(cell) for cell in commas) else "."


def split_table(source: SourceText, delimiter: str | None = None, header: bool | None = None) -> SplitTable:
    """Split a file into rows of equal length."""
    lines = source.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    used = [(i, t) for i, t in enumerate(lines, 1) if t.strip() and not t.lstrip().startswith(("#", "%"))]
    comments = sum(1 for t in lines if t.lstrip().startswith(("#", "%")))
    bare = [i for i, t in used if not t.strip(" \t;,|")]
    used = [(i, t) for i, t in used if t.strip(" \t;,|")]
    if not used:
        raise InputError(Fault(source.name, "", "no data", "a heading line and rows of numbers"))
    notes = [f"{comments} comment lines left out"] if comments else []
    notes += [f"{len(bare)} lines of empty cells left out (line {some(bare)})"] if bare else []
    start, mark = find_start([t for _, t in used[:60]]) if delimiter is None and header is not False else (0, delimiter)
    mark = mark or find_delimiter([t for _, t in used[:5]])
    if start:
        above = some((repr(t.strip()[:60]) for _, t in used[:start]), 3)
        notes += [] if _EXCEL.fullmatch(used[0][1]) else [f"{start} lines above the headings left out: {above}"]
        used = used[start:]
    if any(len(t) > 100_000 for _, t in used):
        raise InputError(Fault(source.name, "", "a line of more than 100000 characters", "a table of short lines"))
    split = [(i, split_line(t, mark)) for i, t in used]
    first = split[0][1]
    if header is None:
        header = not any(number(c) is not None for c in first)
    width = len(first)
    while header and width > 1 and not first[width - 1]:  # a heading line that ends in the delimiter
        width -= 1
    if not header:
        width = max((len(c) for _, c in split[:2]), default=width)
    if header and len(split) > 2 and _is_units(split[1][1]):
        stated = [*split[1][1], *[""] * width]
        stated = [unit.strip("-()[]") for unit in stated]
        first = [f"{name} ({unit})" if unit else name for name, unit in zip(first, stated, strict=False)]
        notes.append(f"line {split[1][0]} holds units")
        del split[1]
    rows: list[tuple[str, ...]] = []
    faults: list[Fault] = []
    misfits: list[int] = []
    cut = None
    body = split[1:] if header else split
    for k, (i, cells) in enumerate(body):
        over = cells[width:]
        if any(over):
            got, hint = f"{len(cells)} cells", "A delimiter inside a value, or a decimal comma?"
            faults.append(Fault(source.name, str(i), got, f"{width} as in line {split[0][0]}", hint))
            misfits.append(len(rows))
            rows.append(("",) * width)
        elif len(cells) < width and k == len(body) - 1 and not lines[-1] == "" and k > 0:
            cut = k
            rows.append(tuple(cells) + ("",) * (width - len(cells)))
        elif len(cells) < width:
            hint = "Was a line cut?"
            faults.append(Fault(source.name, str(i), f"{len(cells)} cells", f"{width} as in line {split[0][0]}", hint))
            misfits.append(len(rows))
            rows.append(("",) * width)
        else:
            rows.append(tuple(cells[:width]))
    if len(faults) > MISFIT_SHARE * len(body):
        extra = len(faults) - MAX_FAULTS
        faults = faults[:MAX_FAULTS]
        if extra > 0:
            faults.append(Fault(source.name, "", f"{extra} more lines of another length", f"{width} cells"))
        raise InputError(faults)
    if not rows:
        raise InputError(Fault(source.name, "", "no rows", "a heading line and rows of numbers"))
    names = tuple(first[:width]) if header else ()
    return SplitTable(source, mark, names, tuple(rows), tuple(i for i, _ in (split[1:] if header else split)),
                 tuple(notes), cut, tuple(misfits))  # fmt: skip

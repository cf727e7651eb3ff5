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
from bemt.base.errors import Fault
from bemt.base.tables import number_of, some
from bemt.data.readers import SourceText, number
from bemt.data.readers._words import english, quantities
from bemt.data.readers.unit_text import unit_of

DELIMITERS = (";", "\t", ",", "|")
MAX_FAULTS = 20
LONGEST = 100_000
"""Characters that a line may have: less than the largest cell of the csv module."""
SHEET_ERRORS = frozenset({"#div/0!", "#n/a", "#value!", "#ref!", "#num!", "#name?", "#null!"})
"""What a spreadsheet writes into a cell that it could not compute."""
NO_VALUE = frozenset({"", "nan", "na", "n/a", "-", "--", "\u2013", "\u2014", "null", "none"}) | SHEET_ERRORS
"""Cells that say "no value", in lower case."""
MOST_ODD, MOST_ODD_OF_UNIT = 0.1, 0.5
"""Share of cells that are no numbers from which a column is text; one whose heading states a unit."""
MISFIT_SHARE = 0.05
"""Share of lines of another length from which a file is refused."""
_COMMA = re.compile(r"[+-]?(0|[1-9]\d{0,8}),\d+([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:([,. '\u2019\u00a0\u202f])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")
"""Digits in groups of three."""
_ONE_POINT = re.compile(r"[+-]?\d{1,3}\.\d{3}")
_SUMMARY = re.compile(
    r"(mean|average|avg\.?|max(imum)?|min(imum)?|total|sum|std\.?( ?dev\.?)?|median|mittelwert|durchschnitt|summe"
    r"|moyenne|moy\.?|promedio|media|prom\.?|massimo|minimo|\u5e73\u5747\u503c?|\u6700\u5927\u503c?|\u6700\u5c0f\u503c?)\W*",
    re.IGNORECASE,
)
"""First cells of rows that sum up the others."""
_LABVIEW = "***End_of_Header***"
_COMMENT = re.compile(r"\s*[#%](?!\s*[,;|])")
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
    headings_line: int = 1
    misfits: tuple[int, ...] = ()  # rows of another number of cells: kept, without values
    above: tuple[tuple[int, str], ...] = ()  # lines above the headings, with their numbers

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
        commas, point = decimal == ",", "." in cell
        value = _ungrouped(cell, ",") if commas and point else None
        value = number(cell.replace(",", ".") if commas and not point else cell) if value is None else value
        value = _ungrouped(cell, decimal) if value is None and cell else value
        if value is not None:
            values[i] = value
        elif cell.lower() in NO_VALUE:
            empty += 1
        else:
            bad.append(i)
    return values, bad, empty


def _ungrouped(cell: str, decimal: str) -> float | None:
    """Number whose digits are in groups of three, where the marks leave one reading.

    >>> _ungrouped("1 234,5", ","), _ungrouped("1,234.5", "."), _ungrouped("1,234", ".")
    (1234.5, 1234.5, None)
    """
    grouped = _GROUPED.fullmatch(cell)
    if not grouped or grouped[1] == decimal[0]:
        return None
    bare = cell.replace(grouped[1], "")
    alone = grouped[1] in ",." and bare.lstrip("+-").isdigit() and cell.count(grouped[1]) == 1
    return None if alone and decimal == "." else number(bare.replace(",", "."))


def lone_points(cells: Sequence[str]) -> list[int]:
    """Rows of a column with decimal commas whose cell may be thousands, or a decimal point: 5.910 beside 6,669.

    >>> lone_points(["2,085", "5.910"]), lone_points(["985,5", "1.234,5", "2.000"]), lone_points(["4.000", "5.910"])
    ([1], [], [])
    """
    if any("." in cell and _GROUPED.fullmatch(cell) and not _ONE_POINT.fullmatch(cell) for cell in cells):
        return []  # points between thousands are usual in it
    return [i for i, cell in enumerate(cells) if _ONE_POINT.fullmatch(cell)] if any("," in c for c in cells) else []


def split_line(line: str, mark: str) -> list[str]:
    """Cells of one line, quotes taken off."""
    if mark == " ":
        return line.split()
    if '"' in line:
        return [c.strip() for c in next(csv.reader([line], delimiter=mark))]
    return [c.strip() for c in line.split(mark)]


def heading_cells(line: str, mark: str, width: int) -> list[str]:
    """Cells of a line of headings; between blanks, parted by two or more if that makes as many as the rows have."""
    cells = split_line(line, mark)
    apart = re.split(r"\s{2,}", line.strip()) if mark == " " and len(cells) != width else cells
    return apart if len(apart) == width else cells


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a line below the headings holds nothing but units."""
    stated = [unit_of(c.strip("()[]")) for c in cells if c.strip("-()[]")]
    return bool(stated) and all(isinstance(u, units.Unit) or u for u in stated)


def is_comment(line: str) -> bool:
    """Whether a line is a comment; ``%,A,V`` holds units.

    >>> is_comment("# day 2"), is_comment("%;1/min;N")
    (True, False)
    """
    return bool(_COMMENT.match(line))


def find_delimiter(lines: Sequence[str]) -> str:
    """Delimiter of some lines: the first of ``; tab , |`` that all of them have, else blanks.

    Without any blank it is the first that the first line and most others have: some are damaged.

    >>> find_delimiter(["r;mm,x", "1,2"]), find_delimiter(["a;b", "1,5;2,5"]), find_delimiter(["1 2", "3 4"])
    (',', ';', ' ')
    >>> find_delimiter(["4000,5 1,10", "6000,1 2,40"]), find_delimiter(["4000, 1", "6000, 2"])
    (' ', ',')
    """
    plain = [re.sub(r'"[^"]*"', "", line) for line in lines]
    least = len(plain) if any(" " in line.strip() for line in plain) else len(plain) // 2 + 1
    usual = [mark for mark in DELIMITERS if plain and mark in plain[0] and sum(mark in t for t in plain) >= least]
    found = max(usual, key=lambda mark: all(mark in t for t in plain), default=" ")
    blanks = [line.split() for line in lines]
    decimal = found == "," and all(len(cells) > 1 and all(map(is_number, cells)) for cells in blanks)
    return " " if decimal else found


def _heads(names: Sequence[str], rows: Iterable[Sequence[str]]) -> bool:
    """Whether cells are the headings of rows with numbers that are as long."""
    if any(number(c) is not None for c in names) or sum(map(bool, names)) < max(2, len(names) - 1) or _is_units(names):
        return False
    return all(len(cells) == len(names) and any(number(c) is not None for c in cells) for cells in rows)


def find_start(lines: Sequence[str]) -> tuple[int, str]:
    """Line of the headings and delimiter of a table that may have lines of text above it.

    Lines above count as such only when they have fewer cells than the rows, and a line of headings without numbers,
    as long as the rows, follows: a damaged line of headings is none.

    >>> find_start(["Run 7", "rpm;T_N", "1;2", "3;4"]), find_start(["sep=;", "rpm;T_N", "1;2"])
    ((1, ';'), (1, ';'))
    """
    ends = [k for k, line in enumerate(lines) if line.startswith(_LABVIEW)]
    if ends and ends[-1] + 2 < len(lines):
        return ends[-1] + 1, find_delimiter(lines[ends[-1] + 1 : ends[-1] + 4])
    excel = _EXCEL.fullmatch(lines[0]) if lines else None
    if excel:
        return 1, excel[1]
    for start in range(1, min(31, len(lines) - 2)):
        mark = find_delimiter(lines[start : start + 3])
        if mark == " ":
            continue
        names, *body = (split_line(line, mark) for line in lines[start : start + 3])
        if any(len(split_line(line, mark)) >= len(names) for line in lines[:start]):
            break
        if _heads(names, body):
            return start, mark
    usual = find_delimiter(lines[:5])
    return _below_a_block(lines, usual) or (0, usual)


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a point or a comma."""
    return number(cell) is not None or _COMMA.fullmatch(cell) is not None


def _reads(cell: str) -> bool:
    """Whether a cell is a number, in whatever way it is written."""
    return is_number(cell) or bool(cell and (_GROUPED.fullmatch(cell) or with_unit(cell)))


def with_unit(cell: str) -> tuple[str, str] | None:
    """Number and unit of a cell that holds both, such as ``50 %`` or ``11.0V``."""
    found = re.fullmatch(r"([+-]?\d[\d.,]*)\s*([^\W\d_][^\s\d]{0,7}|%|\u00b0[CF])", cell)
    return (found[1], found[2]) if found and unit_of(found[2]) != "" else None


def _is_row(cells: Sequence[str]) -> bool:
    numbers, full = sum(map(_reads, cells)), sum(map(bool, cells))
    return numbers >= 2 and 2 * numbers >= full


def _named(cells: Sequence[str]) -> float:
    """Share of headings that are words of a quantity."""
    full = [cell for cell in cells if cell]
    return sum(bool(quantities(english(re.split(r"[(\[]", cell)[0]))) for cell in full) / max(len(full), 1)


def _headings_above(split: Sequence[Sequence[str]], first: int, wide: float) -> list[int]:
    """Lines of words right above a row that are as wide: four at most, from the first that names quantities."""
    top = first
    while top and first - top < 4 and sum(map(bool, split[top - 1])) >= wide and not any(map(_reads, split[top - 1])):
        top -= 1
    told = [k for k in range(top, first) if not _is_units(split[k])]
    while len(told) > 1 and _named(split[told[0]]) < 0.5 <= max(_named(split[k]) for k in told[1:]):
        del told[0]
    return told


def _below_a_block(lines: Sequence[str], usual: str) -> tuple[int, str] | None:
    """Headings right above the first two rows of numbers, below titles as wide as the table; None: as usual."""
    for mark in dict.fromkeys((usual, *DELIMITERS, " ")):
        split = [split_line(line, mark) for line in lines]
        if mark == " ":  # headings of several words
            split = [c if _is_row(c) else re.split(r"\s{2,}", t.strip()) for c, t in zip(split, lines, strict=True)]
        first = next((k for k in range(len(split) - 1) if _is_row(split[k]) and _is_row(split[k + 1])), 0)
        if not first:
            continue
        wide = max(2.0, 0.6 * sum(map(bool, split[first])))
        told = _headings_above(split, first, wide)
        whole = told and all(len(split[k]) >= len(split[first]) for k in told)  # a cut line of headings is none
        if whole and not any(_is_row(row) and sum(map(bool, row)) >= wide for row in split[: told[0]]):
            return told[0], mark
    return None


def _marks(table: SplitTable) -> tuple[list[str], list[str]]:
    """Distinct cells with commas, and numbers with points."""
    cells = list(dict.fromkeys(cell for row in table.rows for cell in row))
    commas = [cell for cell in cells if re.fullmatch(r"[\d,eE+-]*\d,\d[\d,eE+-]*", cell)]
    return commas, [cell for cell in cells if "." in cell and number(cell) is not None]


def decimal_mark(table: SplitTable) -> str:
    """Decimal mark of a table: a comma only where it can be nothing else; ``.,`` if commas stand between thousands.

    Where commas part the cells, those inside one were quoted.
    """
    commas, points = _marks(table)
    thousands = all(_THOUSANDS.fullmatch(cell) for cell in commas)
    if commas and thousands and any(not re.fullmatch(r"[+-]?\d{1,3}\.\d{3}", cell) for cell in points):
        return ".,"
    if thousands or (points and table.delimiter == ","):
        return "."
    grouped = all(_GROUPED.fullmatch(cell) for cell in points)
    return "," if grouped and all(_COMMA.fullmatch(cell) for cell in commas) else "."


def odd_mark(table: SplitTable) -> str:
    """Numbers with a decimal point among many more with a decimal comma, and where they are; "" for none."""
    commas, points = _marks(table)
    if len(points) * 4 > len(commas):
        return ""
    at = [(i, j) for i, row in enumerate(table.rows) for j, cell in enumerate(row) if cell in points]
    told = some((f"{table.cell(i, j)!r} at {table.lines[i]}:{j + 1}" for i, j in at), 3)
    return f"{told} among decimal commas" if at else ""


def _in_a_comment(
    lines: Sequence[str], split: Sequence[tuple[int, list[str]]], mark: str
) -> tuple[int, list[str]] | None:
    """Headings in the comment right above the first row of numbers."""
    at, cells = split[0]
    above = lines[at - 2] if at > 1 else ""
    if not _is_row(cells) or not is_comment(above):
        return None
    names = split_line(re.sub(r"^\s*[#%]+[ \t]*(?=\w)|^\s*[#%]", "", above), mark)
    return (at - 1, names) if len(names) == len(cells) and not any(map(_reads, names)) else None


def _without_ends(
    body: list[tuple[int, list[str]]], names: Sequence[str], notes: list[str]
) -> list[tuple[int, list[str]]]:
    """Rows without headings that come again, sums of the rows above, and remarks at the end, all named in notes."""
    again = [i for i, cells in body if cells == list(names)]
    sums = [(i, word) for i, cells in body if _SUMMARY.fullmatch(word := next(filter(None, cells), ""))]
    out = {*again, *(i for i, _ in sums)}
    kept = [(i, cells) for i, cells in body if i not in out]
    ends: list[tuple[int, list[str]]] = []
    few = max(1, len(names) // 3)
    while len(kept) > 1 and not any(map(_reads, kept[-1][1])) and sum(map(bool, kept[-1][1])) <= few:
        ends.append(kept.pop())
    named = some((f"{word!r} in line {i}" for i, word in sums), 3)
    last = some((f"{' '.join(filter(None, c))[:60]!r} in line {i}" for i, c in ends[::-1]), 3)
    told: tuple[tuple[Sequence[object], str], ...] = (
        (again, f"the headings again (line {some(again)})"), (sums, f"sums of others ({named})"),
        (ends, f"remarks at the end ({last})"),
    )  # fmt: skip
    notes += [f"{number_of(len(found), 'line')} left out: {what}" for found, what in told if found]
    return kept


def _used_lines(source: SourceText, lines: Sequence[str]) -> tuple[list[tuple[int, str]], list[str]]:
    """Lines of a table with their numbers, without comments and empty ones, and notes on these; none is refused."""
    text = [(i, t) for i, t in enumerate(lines, 1) if t.strip() and not is_comment(t)]
    used = [(i, t) for i, t in text if t.strip(" \t;,|")]
    if not used:
        source.refuse("", "no data", "a heading line and rows of numbers")
    longest = max(used, key=lambda line: len(line[1]))
    if len(longest[1]) > LONGEST:
        source.refuse(longest[0], f"a line of {len(longest[1])} characters", f"a table of lines of at most {LONGEST}")
    comments, bare = sum(map(is_comment, lines)), [i for i, t in text if not t.strip(" \t;,|")]
    notes = [f"{comments} comment lines left out"] if comments else []
    notes += [f"{number_of(len(bare), 'line')} of empty cells left out (line {some(bare)})"] if bare else []
    return used, notes


def _note_of(above: Sequence[tuple[int, str]]) -> list[str]:
    """Note of the lines above the headings, unless they are Excel's word for the delimiter."""
    if not above or _EXCEL.fullmatch(above[0][1]):
        return []
    shown = some((repr(t.strip()[:60]) for _, t in above), 3)
    return [f"{number_of(len(above), 'line')} above the headings left out: {shown}"]


def split_table(
    source: SourceText, delimiter: str | None = None, header: bool | None = None, most_misfits: float = MISFIT_SHARE
) -> SplitTable:
    """Split a file into rows of equal length; refused where more lines than a share of them have another length."""
    lines = source.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    used, notes = _used_lines(source, lines)
    start, mark = find_start([t for _, t in used[:60]]) if delimiter is None and header is not False else (0, delimiter)
    mark = mark or find_delimiter([t for _, t in used[:5]])
    above, used = tuple(used[:start]), used[start:]
    notes += _note_of(above)
    split = [(i, split_line(t, mark)) for i, t in used]
    if header is None and (said := _in_a_comment(lines, split, mark)):
        split.insert(0, said)
        comments = sum(map(is_comment, lines)) - 1
        notes[:1] = [f"{comments} comment lines left out"] if comments else []
        notes.append(f"the headings are the comment in line {said[0]}")
    top, first = split[0]
    header = not any(map(is_number, first)) if header is None else header
    if header and len(split) > 1 and top == used[0][0]:
        first = heading_cells(used[0][1], mark, len(split[1][1]))
    first = _of_labview(first, above, mark)
    closed = not lines[-1]
    names, body = _below(first, split, closed, notes) if header else ([], split)
    width = len(names) or max((len(c) for _, c in split[:2]), default=len(first))
    rows, cut, misfits = _rows(source, body, width, top, closed, most_misfits)
    numbers = tuple(i for i, _ in body)
    return SplitTable(source, mark, tuple(names), rows, numbers, tuple(notes), cut, top, misfits, above)


def _with_units(names: Sequence[str], units_: Sequence[str]) -> list[str]:
    """Headings with the units that another line has for them."""
    filled = [*units_, *[""] * len(names)]
    return [f"{name} ({unit})" if unit else name for name, unit in zip(names, filled, strict=False)]


def _of_labview(names: list[str], above: Sequence[tuple[int, str]], mark: str) -> list[str]:
    """Headings with the units of the channels, which stand behind the time; as they are without such a line."""
    labels = next((split_line(t, mark) for _, t in above if t.startswith("Y_Unit_Label")), [])
    if not labels:
        return names
    first, *others = _with_units(names, [*["s"][: len(names)], *labels[1:]])
    return [first.replace("X_Value", "Time"), *others]


def _below(
    first: list[str], split: list[tuple[int, list[str]]], closed: bool, notes: list[str]
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Headings, with what further lines of headings and units say, and the rows below them."""
    width = len(first)
    while width > 1 and not first[width - 1]:  # a heading line that ends in the delimiter
        width -= 1
    top, *body = split
    while len(body) > 1:
        line, below = body[0]
        if _is_units(below):
            first = _with_units(first, [unit.strip("-()[]") for unit in below])
            notes.append(f"line {line} holds units")
        elif sum(a == b for a, b in zip(first, below, strict=False)) > 0.5 * width:
            notes.append(f"1 lines left out: the headings again (line {line})")
        elif not any(map(_reads, below)) and sum(map(bool, below)) >= max(2.0, 0.6 * width) and _named(below) >= 0.5:
            first = [" ".join(filter(None, pair)) for pair in zip(first, [*below, *[""] * width], strict=False)]
            notes.append(f"line {line} holds more headings")
        else:
            break
        del body[0]
    last = [body.pop()] if not closed and len(body) > 1 else []  # the end of the file cut it off: no remark
    body = [*_without_ends(body, top[1], notes), *last]
    usual = {len(c) for _, c in body}
    if len(usual) == 1 and (most := usual.pop()) < width and len(body) > 1:  # columns that no row fills
        body = [(i, [*c, *[""] * (width - most)]) for i, c in body]
    return first[:width], body


def _rows(
    source: SourceText, body: Sequence[tuple[int, list[str]]], width: int, top: int, closed: bool, most_misfits: float
) -> tuple[tuple[tuple[str, ...], ...], int | None, tuple[int, ...]]:
    """Rows of equal length, which of them the end of the file cut off, and those of another length, kept empty."""
    rows: list[tuple[str, ...]] = []
    faults: list[Fault] = []
    misfits: list[int] = []
    cut = None
    for k, (i, cells) in enumerate(body):
        short = len(cells) < width
        if short and k == len(body) - 1 and not closed and k > 0:
            cut = k
            rows.append((*cells, *[""] * (width - len(cells))))
        elif short or any(cells[width:]):
            hint = "Was a line cut?" if short else "A delimiter inside a value, or a decimal comma?"
            faults.append(source.fault(i, number_of(len(cells), "cell"), f"{width} as in line {top}", hint))
            misfits.append(k)
            rows.append(("",) * width)
        else:
            rows.append(tuple(cells[:width]))
    if len(faults) > most_misfits * len(body):
        source.faults += faults[:MAX_FAULTS]
        if len(faults) > MAX_FAULTS:
            source.add("", f"{number_of(len(faults) - MAX_FAULTS, 'more line')} of another length", f"{width} cells")
        source.check()
    if not rows:
        source.refuse("", "no rows", "a heading line and rows of numbers")
    return tuple(rows), cut, tuple(misfits)

"""Large tables of numbers, read in blocks by pandas: the cells of a log with millions of rows are never all strings.

Taken only where every line has the same number of cells and every column is of numbers; whatever else a file holds is
read cell by cell (:mod:`bemt.data.readers.split`), with the same outcome. Odd cells are kept as text beside the
numbers.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import InputError
from bemt.data.readers import SourceText
from bemt.data.readers.split import MOST_ODD, SplitTable, column_numbers, decimal_mark, split_line, split_table

LARGE = 4 << 20
"""Size of a file from which it is read in blocks. [bytes]"""
BLOCK = 4 << 20
HEAD = 1 << 16
"""Bytes of a block, and of the head that tells delimiter and headings."""


@dataclass(frozen=True, eq=False)
class NumberTable:
    """Columns of a large table, with the contract of a `SplitTable`; `odd` has the cells that are no numbers."""

    source: SourceText
    headings: tuple[str, ...]
    columns: NDArray[np.float64]
    odd: tuple[dict[int, str], ...]
    lines: range
    warnings: tuple[str, ...] = ()
    cut: int | None = None
    misfits: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.columns)

    def cell(self, row: int, column: int) -> str:
        """One cell."""
        value = self.columns[column][row]
        return self.odd[column].get(row, "" if np.isnan(value) else f"{value:g}")

    def cells(self, column: int) -> Sequence[str]:
        """Cells of a column."""
        return [self.cell(row, column) for row in range(len(self))]

    def numbers(self, column: int, decimal: str = ".") -> tuple[NDArray[np.float64], list[int], int]:  # noqa: ARG002
        """Numbers of a column, rows whose cell is none, number of empty cells."""
        values, bad = self.columns[column], sorted(self.odd[column])
        return values, bad, int(np.isnan(values).sum()) - len(bad)


def large_table(path: str | os.PathLike[str]) -> tuple[NumberTable, str] | None:
    """Table and its decimal mark; None: a small file, or one that must be read cell by cell."""
    file = Path(path)
    if not file.is_file() or file.stat().st_size < LARGE:
        return None
    with file.open("rb") as stream:
        raw = stream.read(HEAD)
    raw = raw[: raw.rfind(b"\n") + 1]
    if b"\0" in raw or b"\r" in raw.replace(b"\r\n", b"\n"):
        return None
    try:
        text = raw.decode("utf-8-sig")
        head = split_table(SourceText(os.fspath(path), text, ""))
    except (UnicodeDecodeError, InputError):
        return None
    first = head.lines[0]
    if head.misfits or tuple(head.lines) != tuple(range(first, first + len(head.rows))):
        return None
    decimal = decimal_mark(head)
    if decimal == ".," or any(len(head.numbers(k, decimal)[1]) > MOST_ODD * len(head) for k in range(head.width)):
        return None
    start = 0
    for _ in range(first - 1):
        start = raw.index(b"\n", start) + 1
    marks = raw[start : raw.index(b"\n", start)].count(head.delimiter.encode())
    return _read(file, head, decimal, start, marks)


def _read(file: Path, head: SplitTable, decimal: str, start: int, marks: int) -> tuple[NumberTable, str] | None:
    """All blocks, checked for lines of another shape."""
    rows, sha256, closed = _counted(file, start)
    columns = np.empty((head.width, rows))
    odd: tuple[dict[int, str], ...] = tuple({} for _ in range(head.width))
    at, cut = 0, None
    for block in _blocks(file, start):
        n = block.count(b"\n") + (not block.endswith(b"\n"))
        if not closed and at + n == rows:
            last = block.rpartition(b"\n")[2]
            if head.delimiter != " " and last.count(head.delimiter.encode()) < marks:
                cut, block = rows - 1, block + head.delimiter.encode() * (marks - last.count(head.delimiter.encode()))
        values = _numbers(block, head, decimal, marks, n)
        if values is None:
            values = _cells(block, head, decimal, n, at, odd)
        if values is None or any(len(cells) > MOST_ODD * rows for cells in odd):
            return None
        columns[:, at : at + n] = values
        at += n
    columns.setflags(write=False)
    lines = range(head.lines[0], head.lines[0] + rows)
    source = SourceText(head.source.name, "", sha256)
    return NumberTable(source, head.headings, columns, odd, lines, head.warnings, cut), decimal


def _counted(file: Path, start: int) -> tuple[int, str, bool]:
    """Lines from a place on, hash of the whole file, whether its last line is closed."""
    digest, lines, last = hashlib.sha256(), 0, b"\n"
    with file.open("rb") as stream:
        digest.update(stream.read(start))
        while block := stream.read(1 << 20):
            digest.update(block)
            lines, last = lines + block.count(b"\n"), block[-1:]
    return lines + (last != b"\n"), digest.hexdigest(), last == b"\n"


def _blocks(file: Path, start: int) -> Iterator[bytes]:
    """Whole lines."""
    with file.open("rb") as stream:
        stream.seek(start)
        while block := stream.read(BLOCK):
            yield block + stream.readline()


def _numbers(block: bytes, head: SplitTable, decimal: str, marks: int, n: int) -> NDArray[np.float64] | None:
    """Numbers of a block whose cells are all numbers, (K, n)."""
    import pandas as pd

    blank = head.delimiter == " "
    if b'"' in block or (not blank and block.count(head.delimiter.encode()) != marks * n):
        return None
    names = range(head.width if blank else marks + 1)
    try:
        table = pd.read_csv(
            BytesIO(block), sep=r"\s+" if blank else head.delimiter, header=None, names=names, index_col=False,
            usecols=range(head.width), dtype=np.float64, decimal=decimal, skipinitialspace=True, engine="c",
        )  # fmt: skip
    except (ValueError, pd.errors.ParserError):
        return None
    values = table.to_numpy().T
    whole = values.shape == (head.width, n) and not (blank and np.isnan(values[-1]).any())
    return values if whole and not np.isinf(values).any() else None


def _cells(
    block: bytes, head: SplitTable, decimal: str, n: int, at: int, odd: Sequence[dict[int, str]]
) -> NDArray[np.float64] | None:
    """Numbers of a block with odd cells, which are kept; None: a line of another shape."""
    try:
        lines = block.decode("utf-8").removesuffix("\n").replace("\r\n", "\n").split("\n")
    except UnicodeDecodeError:
        return None
    split = [split_line(line, head.delimiter) for line in lines]
    if len(split) != n or any(len(c) < head.width or any(c[head.width :]) or c[0][:1] in ("#", "%") for c in split):
        return None
    if any(not any(cells) for cells in split):
        return None
    values = np.empty((head.width, n))
    for k in range(head.width):
        cells = [row[k] for row in split]
        values[k], bad, _ = column_numbers(cells, decimal)
        odd[k].update({at + i: cells[i] for i in bad})
    return values

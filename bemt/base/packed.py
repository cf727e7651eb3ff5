"""Files that hold their text packed: gzip, a zip of one file, the sheets of a workbook. One limit for every door."""

from __future__ import annotations

import csv
import datetime
import io
import os
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO, Any
from xml.parsers import expat

from bemt.base.errors import Fault, InputError

MAX_BYTES = 1 << 29
"""Largest text that is held at once, unpacked. [bytes]"""
MAX_CELLS = 1 << 24
"""Largest sheet: rows times columns between its outermost cells; all rows of a sheet with 16 columns."""
GZIP, ZIP, OLE = b"\x1f\x8b", b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
_BLOCK = 1 << 16
_FEWEST_ROWS = 2
_SHOWN = 6  # names in a message
_DEEPEST = 2  # a packed file in a zip
_ODS = "application/vnd.oasis.opendocument.spreadsheet"
_REFERENCE = re.compile(r"([A-Z]{1,3})(\d{1,7})")


def part_of(path: str | os.PathLike[str]) -> tuple[str, str]:
    """File, and the sheet or packed file that is named in it: ``book.xlsx#Sheet 2``; a file of the whole name is that.

    >>> part_of("bench.csv")
    ('bench.csv', '')
    """
    name = os.fspath(path)
    file, mark, part = name.rpartition("#")
    return (file, part) if mark and not os.path.exists(name) and os.path.isfile(file) else (name, "")


def packed(head: bytes) -> bool:
    """Tell whether the first bytes of a file are those of a packed one.

    >>> packed(b"PK" + bytes([3, 4])), packed(b"rpm,T (N)")
    (True, False)
    """
    return head[:2] == GZIP or head[:4] in (ZIP, OLE)


def gunzip(raw: bytes, name: str, most: int | None = None) -> tuple[bytes, str]:
    """Unpack gzip piece by piece: what could be unpacked, and what is damaged, empty for a whole file.

    It stops after `most` bytes; without it, more than :data:`MAX_BYTES` are refused.
    """
    out = io.BytesIO()
    damage = gunzip_stream(io.BytesIO(raw), out, name, most)
    return out.getvalue()[:most], damage


def gunzip_stream(source: IO[bytes], out: IO[bytes], name: str, most: int | None = None) -> str:
    """Unpack gzip from one open file to another, for what need not be held at once; else as :func:`gunzip`."""
    size, limit, stream = 0, MAX_BYTES if most is None else most, zlib.decompressobj(31)
    block = source.read(_BLOCK)
    try:
        while block:
            if stream.eof:
                block += source.read(1)  # a member may start on the last byte of a block
                if block[:2] != GZIP:
                    break  # zeros of a tape behind the last member
                stream = zlib.decompressobj(31)
            some = stream.decompress(block, _BLOCK)
            size += len(some)
            out.write(some)
            if size > limit:
                if most is None:
                    raise InputError(_too_large(name, f"more than {MAX_BYTES} bytes of gzip data, unpacked"))
                return ""
            block = (stream.unused_data if stream.eof else stream.unconsumed_tail) or source.read(_BLOCK)
        return "" if stream.eof else "it ends early"
    except zlib.error as error:
        return str(error)


def unpacked(raw: bytes, name: str, most: int | None = None, depth: int = 0) -> bytes:
    """Text of a packed file, or its first `most` bytes; other files as they are.

    Of a workbook the sheet that `name` names counts (:func:`part_of`), else the one that holds a table of numbers, as
    comma-separated values; so of a zip. Refused: damaged files, more than :data:`MAX_BYTES` or :data:`MAX_CELLS`, a zip
    of several files, workbooks with no such sheet or several.
    """
    if most is None and len(raw) > MAX_BYTES:
        raise InputError(_too_large(name, f"{len(raw)} bytes"))
    if depth > _DEEPEST or not packed(raw[:4]):
        if not depth and part_of(name)[1]:
            raise InputError(Fault(name, "", "a sheet of a file that has none", "a workbook or a zip before the #"))
        return raw
    if raw[:2] == GZIP:
        text, damage = gunzip(raw, name, None if packed(gunzip(raw, name, 4)[0]) else most)
        if damage:
            fault = Fault(name, "", f"damaged gzip data ({damage})", "a whole gzip file", "Copy it again")
            raise InputError(fault)
        return unpacked(text, name, most, depth + 1)
    if raw[:4] == OLE:
        return _workbook(raw, name, most)
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            return _of_zip(archive, raw, name, most, depth)
    except zipfile.BadZipFile as error:
        if not any(mark in raw[:16384] for mark in (b"xl/", b"[Content_Types].xml", _ODS.encode())):
            return raw
        raise InputError(_damaged(name, error)) from error
    except (zlib.error, EOFError, RuntimeError, NotImplementedError, UnicodeDecodeError) as error:
        # RuntimeError: encrypted; NotImplementedError: compressed in a way that zipfile does not know
        raise InputError(Fault(name, "", f"a zip that cannot be read ({error})", "a plain zip file")) from error


def _too_large(name: str, got: str) -> Fault:
    return Fault(name, "", got, f"at most {MAX_BYTES} bytes, unpacked", "Export less, or part it")


def _damaged(name: str, error: object) -> Fault:
    return Fault(name, "", f"a damaged workbook ({error})", "a whole .xlsx, .xls or .ods file", "Save it as CSV")


def _of_zip(archive: zipfile.ZipFile, raw: bytes, name: str, most: int | None, depth: int) -> bytes:
    """Text of what a zip holds, by its directory, which stands at its end."""
    files = {item.filename: item for item in archive.infolist() if not item.is_dir()}
    if (size := sum(item.file_size for item in files.values())) > MAX_BYTES:
        raise InputError(_too_large(name, f"{size} bytes, unpacked"))
    if "xl/workbook.bin" in files:
        raise InputError(Fault(name, "", "a binary workbook (.xlsb)", "a text file or .xlsx", "Save it as CSV"))
    is_ods = "content.xml" in files and _ODS.encode() in archive.read("mimetype") if "mimetype" in files else False
    if is_ods or "xl/workbook.xml" in files:
        for item in files.values():  # sizes and checksums as the directory says, or an error
            sheet = item.filename == "content.xml" if is_ods else item.filename.startswith("xl/worksheets/")
            with archive.open(item) as stream:
                blocks = _blocks(stream)
                if sheet:
                    _Extent(name, item.filename, is_ods).check(blocks)
                else:
                    sum(map(len, blocks))
        return _workbook(raw, name, most)
    shown = [f for f in files if not f.startswith("__MACOSX/") and not f.rpartition("/")[2].startswith(".")]
    file, _ = part_of(name)
    return unpacked(archive.read(_chosen(name, shown, shown, "files")), file, most, depth + 1)


def _chosen(name: str, tables: Sequence[str], every: Sequence[str], what: str) -> str:
    """Sheet or file that `name` names, else the only one that can be meant."""
    file, part = part_of(name)
    named = [one for one in every if part and part.lower() in (one.lower(), one.rpartition("/")[2].lower())]
    found = named if part else tables
    if len(found) == 1:
        return found[0]
    names = found or every
    among = ", ".join(map(repr, names[:_SHOWN])) + (", ..." if len(names) > _SHOWN else "")
    kind = what if what == "files" else f"{what} with a table of numbers"
    got = f"no {part!r} among the {what} {among}" if part else f"{len(found) or 'no'} {kind} ({among})"
    hint = f'Name it behind the file: "{file}#{(names or ["NAME"])[0]}"'
    raise InputError(Fault(name, "", got, f"one of its {what}", hint, choices=tuple(names)))


def _blocks(stream: IO[bytes]) -> Iterator[bytes]:
    while block := stream.read(_BLOCK):
        yield block


@dataclass
class _Extent:
    """Outermost cells of a sheet, before anything makes room for them."""

    name: str
    part: str
    is_ods: bool
    row: int = 0
    column: int = 0
    span: int = 1
    at: str = ""
    first: tuple[int, int] | None = None
    last: tuple[int, int] = field(default=(0, 0))

    def check(self, blocks: Iterator[bytes]) -> None:
        """Refuse a sheet with more cells than are read."""
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._ods if self.is_ods else self._xlsx
        parser.StartDoctypeDeclHandler = self._doctype
        try:
            for block in blocks:
                parser.Parse(block, False)
            parser.Parse(b"", True)
        except (expat.ExpatError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(_damaged(self.name, error)) from error

    def _doctype(self, *_: object) -> None:
        raise ValueError("XML with a document type")

    def _xlsx(self, tag: str, given: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        if tag == "row":
            self.row, self.column = int(given.get("r", self.row + 1)), 0
        elif tag == "c":
            self.column += 1
            if found := _REFERENCE.fullmatch(given.get("r", "")):
                self.row, self.column = int(found[2]), 0
                for letter in found[1]:
                    self.column = 26 * self.column + ord(letter) - 64
            self._filled(self.row, self.column)

    def _ods(self, tag: str, given: dict[str, str]) -> None:
        if tag == "table:table":
            self.row, self.span, self.first, self.last = 0, 1, None, (0, 0)
        elif tag == "table:table-row":
            self.row, self.column = self.row + self.span, 1
            self.span = int(given.get("table:number-rows-repeated", 1))
        elif tag in ("table:table-cell", "table:covered-table-cell"):
            wide = int(given.get("table:number-columns-repeated", 1))
            if "office:value-type" in given:
                self._filled(self.row, self.column)
                self._filled(self.row + self.span - 1, self.column + wide - 1)
            self.column += wide

    def _filled(self, row: int, column: int) -> None:
        top, left = self.first or (row, column)
        self.first = min(top, row), min(left, column)
        self.last = max(self.last[0], row), max(self.last[1], column)
        cells = (self.last[0] - self.first[0] + 1) * (self.last[1] - self.first[1] + 1)
        if cells > MAX_CELLS:
            got = f"{cells} cells up to row {self.last[0]}, column {self.last[1]}"
            raise InputError(Fault(self.name, self.part, got, f"at most {MAX_CELLS}", "Delete cells far away"))


def _workbook(raw: bytes, name: str, most: int | None) -> bytes:
    """One sheet as comma-separated values; lines keep their number in the sheet."""
    from python_calamine import CalamineError, CalamineWorkbook

    try:
        book = CalamineWorkbook.from_filelike(io.BytesIO(raw))
        wanted = [_chosen(name, (), book.sheet_names, "sheets")] if part_of(name)[1] else book.sheet_names
        sheets = {title: _csv(book.get_sheet_by_name(title).iter_rows(), name, most) for title in wanted}
    except (CalamineError, zipfile.BadZipFile, OSError) as error:
        raise InputError(_damaged(name, error)) from error
    tables = [title for title, sheet in sheets.items() if sheet.is_table]
    tables = tables or [title for title, sheet in sheets.items() if sheet.text.count("\n") > 1]  # numbers typed as text
    title = _chosen(name, tables, list(sheets), "sheets")
    if most is None and (cell := sheets[title].doubt):
        hint = "Thousands or decimals? Turn the column into numbers in the spreadsheet"
        where = f"sheet {title!r}, cell {cell[0]}"
        raise InputError(Fault(part_of(name)[0], where, f"{cell[1]!r} as text", "a number", hint))
    return sheets[title].text.encode()[:most]


_COMMA = re.compile(r"[+-]?(\d+|[1-9]\d{0,2}(\.\d{3})+),\d+([eE][+-]?\d+)?")
_POINTS = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+,\d+|[+-]?[1-9]\d{0,2}(\.\d{3}){2,}")
_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+\.\d*|[+-]?[1-9]\d{0,2}(,\d{3}){2,}")
_ONE_GROUP = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
"""Digits that are thousands or decimals, by the country."""


@dataclass(frozen=True)
class _Sheet:
    text: str  # as comma-separated values
    is_table: bool  # whether two rows or more have two numbers
    doubt: tuple[str, str] | None = None  # place, as B2, and text of a cell that may be either of two numbers


def _csv(rows: Iterator[list[Any]], name: str, most: int | None) -> _Sheet:
    """Cells as text; numbers that a workbook has as text keep no mark but the point."""
    out, numbers = io.StringIO(), 0
    writer = csv.writer(out, lineterminator="\n")
    typed: dict[tuple[int, int], str] = {}
    for at, row in enumerate(rows):
        count = sum(isinstance(cell, float) for cell in row)
        numbers += count > 1
        writer.writerow(map(_cell, row))
        if count:
            texts = ((k, cell.strip()) for k, cell in enumerate(row) if isinstance(cell, str))
            typed |= {(at, k): cell for k, cell in texts if "," in cell or _ONE_GROUP.fullmatch(cell)}
        if out.tell() > (MAX_BYTES if most is None else most):
            if most is None:
                raise InputError(_too_large(name, f"more than {MAX_BYTES} bytes of cells"))
            if numbers >= _FEWEST_ROWS:
                break
    text, doubt = _with_points(out.getvalue(), typed)
    return _Sheet(text, numbers >= _FEWEST_ROWS, doubt)


def _with_points(text: str, typed: Mapping[tuple[int, int], str]) -> tuple[str, tuple[str, str] | None]:
    """Comma-separated values whose cells of text have a point for a decimal comma; place and text of one in doubt.

    `typed`: cells of text beside numbers, by row and column. A spreadsheet keeps a number without a mark, so such a
    cell was typed or pasted in the manner of another country.
    """
    commas = {at: cell for at, cell in typed.items() if _COMMA.fullmatch(cell)}
    if not commas or any(map(_GROUPS.fullmatch, typed.values())):
        return text, None
    known = "," * any(not _ONE_GROUP.fullmatch(cell) for cell in commas.values())
    known += "." * any(map(_POINTS.fullmatch, typed.values()))
    columns = {k for _, k in commas}
    of_group = {at: cell for at, cell in typed.items() if at[1] in columns and _ONE_GROUP.fullmatch(cell)}
    doubt = next((at for at, cell in of_group.items() if not any(mark in cell for mark in known)), None)
    if doubt:
        return text, (f"{_letters(doubt[1])}{doubt[0] + 1}", typed[doubt])
    typed = commas | of_group
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    for i, cells in enumerate(csv.reader(io.StringIO(text))):
        plain = (cell.replace(".", "").replace(",", ".") if (i, k) in typed else cell for k, cell in enumerate(cells))
        writer.writerow(plain)
    return out.getvalue(), None


def _letters(column: int) -> str:
    """Name of a column from 0.

    >>> _letters(0), _letters(25), _letters(26)
    ('A', 'Z', 'AA')
    """
    head, last = divmod(column, 26)
    return (_letters(head - 1) if head else "") + chr(65 + last)


def _cell(value: Any) -> str:
    """One cell as text; a clock stays a clock."""
    if isinstance(value, float):
        return repr(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    return str(value)

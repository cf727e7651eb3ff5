"""Files that hold their text packed: gzip, and the sheets of a workbook."""

from __future__ import annotations

import csv
import datetime
import gzip
import io
import zipfile
import zlib
from typing import Any

from bemt.base.errors import Fault, InputError

MAX_BYTES = 1 << 30
"""Largest text, unpacked."""
GZIP, ZIP, OLE = b"\x1f\x8b", b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
_BOOKS = (b"xl/workbook", b"[Content_Types].xml", b"application/vnd.oasis.opendocument.spreadsheet")
_FEWEST_ROWS = 2


def packed(head: bytes) -> bool:
    """Tell whether the first bytes of a file are those of a packed text."""
    return head[:2] == GZIP or head[:4] == OLE or (head[:4] == ZIP and any(mark in head for mark in _BOOKS))


def unpacked(raw: bytes, name: str, most: int = MAX_BYTES + 1) -> bytes:
    """Text of a packed file, at most so many bytes; other files as they are.

    Of a workbook it is the sheet that holds a table of numbers, as comma-separated values. Raises `InputError` for
    damaged files and for workbooks in which no sheet, or more than one, holds a table.
    """
    if raw[:2] == GZIP:
        try:
            with gzip.open(io.BytesIO(raw), "rb") as stream:
                return stream.read(most)
        except (OSError, EOFError, zlib.error) as error:
            fault = Fault(name, "", f"damaged gzip data ({error})", "a whole gzip file", "Copy it again")
            raise InputError(fault) from error
    if not packed(raw[:16384]):
        return raw
    sheets = _sheets(raw, name)
    tables = {title: rows for title, rows in sheets.items() if _is_table(rows)}
    if len(tables) != 1:
        among = ", ".join(tables or sheets)
        got = f"{len(tables)} sheets with a table of numbers ({among})" if tables else f"no table of numbers ({among})"
        hint = "Keep one of them in the file, or save it as CSV"
        raise InputError(Fault(name, "", got, "a workbook with one sheet of measurements", hint))
    return _csv(next(iter(tables.values()))).encode()[:most]


def _sheets(raw: bytes, name: str) -> dict[str, list[list[Any]]]:
    """Cells of every sheet of a workbook."""
    from python_calamine import CalamineError, CalamineWorkbook

    try:
        if raw[:4] == ZIP:
            with zipfile.ZipFile(io.BytesIO(raw)) as archive:
                size = sum(item.file_size for item in archive.infolist())
            if size > MAX_BYTES:
                raise InputError(Fault(name, "", f"{size} bytes unpacked", f"at most {MAX_BYTES}", "Export less"))
        book = CalamineWorkbook.from_filelike(io.BytesIO(raw))
        return {title: book.get_sheet_by_name(title).to_python(skip_empty_area=False) for title in book.sheet_names}
    except (CalamineError, zipfile.BadZipFile, ValueError, OSError) as error:
        fault = Fault(name, "", f"a damaged workbook ({error})", "a whole .xlsx, .xls or .ods file", "Save it as CSV")
        raise InputError(fault) from error


def _is_table(rows: list[list[Any]]) -> bool:
    """Tell whether a sheet has two columns of numbers below each other."""
    return sum(sum(isinstance(cell, float) for cell in row) > 1 for row in rows) >= _FEWEST_ROWS


def _cell(value: Any) -> str:
    """One cell as text; a clock stays a clock."""
    if isinstance(value, float):
        return repr(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    return str(value)


def _csv(rows: list[list[Any]]) -> str:
    """Rows as comma-separated values; lines keep their number in the sheet."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([[_cell(cell) for cell in row] for row in rows])
    return out.getvalue()

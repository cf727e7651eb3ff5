"""Tables: aligned text for terminals, CSV rows, a fast CSV block for large grids, JSON, and files that appear whole."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, SupportsInt

import numpy as np
from numpy.typing import NDArray

DIGITS = 7
_POWERS = 10.0 ** np.arange(0, 23)


def number_text(value: float | None, digits: int = 4, none: str = "-") -> str:
    """Show a number with some significant digits, without exponent where that is short.

    >>> number_text(24.0851), number_text(0.110419), number_text(123456.0), number_text(None), number_text(0.0)
    ('24.09', '0.1104', '123500', '-', '0')
    """
    if value is None or math.isnan(value):
        return none
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    magnitude = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if not -4 <= magnitude <= 8:
        return f"{value:.{digits - 1}e}"
    rounded = round(value, digits - 1 - magnitude)
    return f"{rounded:.{max(digits - 1 - magnitude, 0)}f}"


def speed_text(rpm: float | None) -> str:
    """Show a speed of rotation: six digits at most, no zeros behind the point.

    >>> speed_text(6000.0), speed_text(24000.5), speed_text(math.nan)
    ('6000', '24000.5', '-')
    """
    return "-" if rpm is None or math.isnan(rpm) else f"{rpm:.6g}"


def some(items: Iterable[object], limit: int = 5) -> str:
    """First few of many, in words.

    >>> some([1, 2]), some(range(9), 3)
    ('1, 2', '0, 1, 2 and 6 more')
    """
    found = list(items)
    more = f" and {len(found) - limit} more" if len(found) > limit else ""
    return ", ".join(map(str, found[:limit])) + more


def few(items: Sequence[str], limit: int = 4) -> str:
    """First few of many, and dots for the others."""
    return ", ".join(items[:limit]) + (", ..." if len(items) > limit else "")


def number_of(count: SupportsInt, noun: str) -> str:
    """Count things in words, singular for one.

    >>> number_of(1, "row"), number_of(0, "row"), number_of(12, "row")
    ('1 row', '0 rows', '12 rows')
    """
    n = int(count)
    return f"{n} {noun}" + ("" if n == 1 else "s")


def plain(value: Any, digits: int = 10) -> Any:
    """Make a value fit for JSON: NaN and infinities become None, floats keep some significant digits.

    >>> plain({"a": (1, 0.1 + 0.2, float("nan"))})
    {'a': [1, 0.3, None]}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item, digits) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), digits)
    if isinstance(value, (list, tuple)):
        return [plain(item, digits) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if math.isfinite(value) else None
    return value


def or_null(value: float) -> float | None:
    """None, which JSON has, for a number that it has not."""
    return float(value) if math.isfinite(value) else None


def json_text(document: Any) -> str:
    """Give a JSON text that depends on nothing but the document."""
    return json.dumps(plain(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def text_table(
    header: Sequence[str], rows: Iterable[Sequence[str]], left: Iterable[int] = (0,), indent: str = ""
) -> str:
    """Align columns.

    >>> print(text_table(["source", "T [N]"], [["bemt", "31.2"], ["cfd", "5"]]))
    source  T [N]
    bemt     31.2
    cfd         5
    """
    body = [list(map(str, header)), *[list(map(str, row)) for row in rows]]
    widths = [max(len(row[i]) for row in body) for i in range(len(header))]
    to_left = set(left)
    lines = []
    for row in body:
        cells = [c.ljust(w) if i in to_left else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        lines.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(lines)


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    r"""Give rows as CSV; lists are joined by "; ", missing values are empty.

    A text that a spreadsheet would calculate, one that begins with = + - @, begins with an apostrophe instead (OWASP,
    CSV Injection); numbers stay numbers.

    >>> csv_text(["name", "T"], [{"name": "=1+1", "T": -1.5}])
    "name,T\n'=1+1,-1.5\n"
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([_inert(name) for name in columns])
    for row in rows:
        cells = []
        for name in columns:
            value = plain(row.get(name))
            value = "; ".join(map(str, value)) if isinstance(value, list) else value
            cells.append("" if value is None else _inert(value) if isinstance(value, str) else value)
        writer.writerow(cells)
    return out.getvalue()


def _inert(text: str) -> str:
    """Text that no spreadsheet evaluates; a carriage return would begin a row of its own."""
    text = text.replace("\r", " ")
    if not text.startswith(("=", "+", "-", "@", "\t", " =", " +", " -", " @")):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def _axis_cells(values: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Cells of a column that takes few values, in their shortest form, (n, width) bytes padded by zeros."""
    texts = np.array([f"{v:.12g}".encode() for v in values])
    cells: NDArray[np.uint8] = texts[index].view(np.uint8).reshape(index.size, -1)
    return cells


def _value_cells(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Cells of real numbers with 7 significant digits, d.dddddde+dd, (n, 13) bytes padded by zeros."""
    v = np.asarray(values, dtype=float)
    size = np.abs(v)
    odd = ~np.isfinite(v)
    zero = ~odd & (size < 1e-99)
    safe = np.where(odd | zero, 1.0, size)
    exponent = np.floor(np.log10(safe)).astype(np.int64)

    def mantissa(e: NDArray[np.int64]) -> NDArray[np.int64]:
        shift = DIGITS - 1 - e
        near = np.abs(shift) <= 22
        power = np.where(near, _POWERS[np.minimum(np.abs(shift), 22)], 10.0 ** np.abs(shift).astype(float))
        return np.rint(np.where(shift >= 0, safe * power, safe / power)).astype(np.int64)

    m = mantissa(exponent)
    top = 10**DIGITS
    exponent += np.where(m >= top, 1, np.where(m < top // 10, -1, 0))
    m = np.minimum(mantissa(exponent), top - 1)
    m = np.where(zero, 0, m).astype(np.int32)
    exponent = np.where(zero, 0, exponent)
    out = np.zeros((v.size, DIGITS + 6), dtype=np.uint8)
    out[:, 0] = np.where((v < 0) & ~zero, ord("-"), 0)
    for k in range(DIGITS):
        m, digit = np.divmod(m, 10)
        out[:, 1 if k == DIGITS - 1 else DIGITS + 1 - k] = digit + 48
    out[:, 2] = ord(".")
    out[:, DIGITS + 2] = ord("e")
    out[:, DIGITS + 3] = np.where(exponent < 0, ord("-"), ord("+"))
    tens, ones = np.divmod(np.minimum(np.abs(exponent), 99), 10)
    out[:, DIGITS + 4] = tens + 48
    out[:, DIGITS + 5] = ones + 48
    if odd.any():
        out[odd] = 0
        out[odd, :3] = np.frombuffer(b"nan", dtype=np.uint8)
        out[np.isinf(v), :3] = np.frombuffer(b"inf", dtype=np.uint8)
        out[np.isneginf(v), :4] = np.frombuffer(b"-inf", dtype=np.uint8)
    return out


def csv_block(columns: Sequence[NDArray[Any] | tuple[NDArray[np.float64], NDArray[np.intp]]]) -> bytes:
    """Format many rows of numbers as CSV, about ten times faster than a loop.

    >>> axis = (np.array([5000.0, 20000.0]), np.array([0, 1]))
    >>> print(csv_block([axis, np.array([-1.5, np.nan]), np.array([True, False])]).decode(), end="")
    5000,-1.500000e+00,1
    20000,nan,0
    """
    blocks: list[NDArray[np.uint8]] = []
    for i, column in enumerate(columns):
        if isinstance(column, tuple):
            cells = _axis_cells(*column)
        elif column.dtype == np.bool_:
            cells = (column[:, None] + 48).astype(np.uint8)
        else:
            cells = _value_cells(column)
        mark = ord("\n") if i == len(columns) - 1 else ord(",")
        blocks += [cells, np.full((len(cells), 1), mark, dtype=np.uint8)]
    page = np.hstack(blocks).ravel()
    return bytes(page[page != 0])


def write_atomic(path: Path, data: bytes | str) -> None:
    """Write a file under a temporary name and rename it, so that no half file is ever seen."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        # a file name that is no UTF-8 may be quoted in a text
        temporary.write_bytes(data.encode(errors="backslashreplace") if isinstance(data, str) else data)
        os.replace(temporary, path)
    except OSError as error:  # a full disk names no file; the temporary one nobody knows
        error.filename = str(path)
        raise
    finally:
        temporary.unlink(missing_ok=True)


def remove_stale(folder: Path) -> None:
    """Remove what an interrupted run left behind."""
    for leftover in folder.glob(".*.tmp"):
        leftover.unlink(missing_ok=True)


def file_hash(path: Path) -> str:
    """SHA-256 of a file of any size."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

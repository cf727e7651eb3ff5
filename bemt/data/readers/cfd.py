r"""What the readers of CFD exports share: tables that may be damaged, and histories with a clock.

The rules, once for all formats: columns are matched by the header; a row whose cells do not fit the header is never
shifted into place but left out with a warning, and a file in which more than a few rows do not fit is refused; text
for NaN becomes NaN with a warning; a last row that may be cut is left out; nothing is joined, scaled or turned round.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.base.arrays import Array
from bemt.base.averaging import Mean, keep_last, steady_average
from bemt.base.errors import Fault
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, head_text, number, unit_text
from bemt.data.readers.samples import Channel, dataset
from bemt.physics.dataset import Dataset

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
_MADE_OF = {"rev_min": "rpm", "n_m": "Nm", "nm": "Nm", "pas": "Pa_s", "kgm_s2": "N", "kgm2_s2": "Nm", "kgm2_s3": "W",
            "kg_ms2": "Pa"}  # fmt: skip
"""Units by the units that make them."""
_TURNS = {"rev": "rev", "revolution": "rev", "u": "rev", "r": "rev", "": "rev", "radian": "rad", "meter": "m"}


@dataclass(frozen=True)
class Column:
    """One column of a header: name as it will appear, unit ("" when none is stated), and its part."""

    name: str
    unit: str = ""
    role: str = "value"
    """value, step (counts) or time (seconds)."""


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
    lines = (line.strip() for line in head_text(head).splitlines())
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

    >>> [unit_of(t).suffix for t in ("N m", "n-m", "rev min^-1", "radian s^-1", "kg m^-3", "m^2", "kg m s^-2")]
    ['Nm', 'Nm', 'rpm', 'rad_s', 'kg_m3', 'm2', 'N']
    >>> [unit_of(t).suffix for t in ("N mm", "mN m", "lbf ft", "ft-lbf")]
    ['Nmm', 'mNm', 'lbf_ft', 'lbf_ft']
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
        word = _MADE_OF.get(word, word)
    other = units.UNITS.get(word) or unit_text.unit_of(plain)
    return other if isinstance(other, units.Unit) else None


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
    taken, used = set(names), set[str]()
    next_number: dict[str, int] = {}
    out: list[str] = []
    for name in names:
        new, k = name, next_number.get(name, 2)
        while new in used or (new != name and new in taken):
            new, k = f"{name}#{k}", k + 1
        next_number[name] = k
        used.add(new)
        out.append(new)
    return out


def made_of(columns: Sequence[Column], values: Iterable[Array], over: str = "") -> dict[str, Channel]:
    """Channels of columns, each under a name of its own; the last value of each is its mean, of what `over` says."""
    out: dict[str, Channel] = {}
    for name, column, v in zip(unique([c.name for c in columns]), columns, values, strict=True):
        out[name] = Channel(v, column.unit, Mean(float(v[-1]), over) if over else None)
    return out


def no_units(columns: Sequence[Column]) -> list[str]:
    """Note on columns without a unit, if any."""
    bare = [column.name for column in columns if not column.unit]
    return [f"no unit stated for {', '.join(bare[:6])}"] if bare else []


def _value(text: str, commas: bool) -> float | None:
    """Number of a cell: NaN for what says so or overflows, None when it is no number."""
    value = number(text.replace(",", ".") if commas and _COMMA.fullmatch(text) else text)
    if value is None and (_NAN.fullmatch(text) or _HUGE.fullmatch(text)):
        return float("nan")
    return value


def _maybe_cut(source: SourceText, rows: Sequence[ExportRow]) -> bool:
    """Whether the last row may have lost its end: no line end, and not of the fixed format of the rows before it."""
    if not rows or not rows[-1].cells or not source.may_be_cut(rows[-1].line):
        return False
    last = rows[-1].cells[-1].lstrip("+-")
    before = [row.cells[-1].lstrip("+-") for row in rows[-50:-1] if row.cells]
    fixed = before and all(_FIXED.fullmatch(cell) and len(cell) == len(before[0]) for cell in before)
    return not (fixed and _FIXED.fullmatch(last) and len(last) == len(before[0]))


def numeric_table(
    source: SourceText, columns: Sequence[Column], rows: Sequence[ExportRow], commas: bool = True
) -> ExportTable:
    """Turn the cells of a table into numbers, by its header."""
    warnings: list[str] = []
    cut = _maybe_cut(source, rows)
    if cut and len(rows) > 1:
        warnings.append(f"line {rows[-1].line}: last row has no line end and may be cut; left out")
        rows = rows[:-1]
    elif cut:
        warnings.append(f"line {rows[-1].line}: the only row has no line end and may be cut")
    comma = commas and _decimal_commas(rows)
    good: dict[int, list[float | None]] = {}
    bad: list[Fault] = []
    for row in rows:
        values = [_value(cell, comma) for cell in row.cells]
        if len(values) == len(columns) and None not in values:
            good[row.line] = values
            continue
        fault = _misfit(source, columns, row, values)
        if row is rows[-1] and len(rows) > 1 and not cut:
            warnings.append(f"line {row.line}: last row is cut or damaged ({fault.got}); left out")
        else:
            bad.append(fault)
    if not good or len(bad) > max(2, 0.05 * len(rows)):
        _refuse_rows(source, columns, rows, bad)
    warnings += [f"line {f.where}: got {f.got}, expected {f.expected}; row left out" for f in bad[:10]]
    if len(bad) > 10:
        warnings.append(f"{len(bad) - 10} more damaged rows left out")
    if comma:
        warnings.append("decimal commas read as decimal points")
    array = np.array([*good.values()], dtype=float)
    for column, missing in zip(columns, np.isnan(array).sum(axis=0).tolist(), strict=True):
        if missing:
            lost = f"{missing} of {len(array)} values are not finite numbers in the file: diverged?"
            warnings.append(f"{column.name}: {lost}")
    return ExportTable(array, tuple(good), tuple(warnings))


def _decimal_commas(rows: Sequence[ExportRow]) -> bool:
    """Whether numbers of a table have decimal commas, and none a point."""
    if not any(_COMMA.fullmatch(cell) for row in rows for cell in row.cells):
        return False
    return not any("." in cell and _value(cell, False) is not None for row in rows for cell in row.cells)


def _misfit(source: SourceText, columns: Sequence[Column], row: ExportRow, values: list[float | None]) -> Fault:
    """What is wrong with a row: it has too many or few cells, or one that is no number."""
    if len(values) != len(columns):
        names = ", ".join(column.name for column in columns[:8])
        return source.fault(row.line, number_of(len(values), "column"), f"{len(columns)} as in the header ({names})")
    at = values.index(None)
    return source.fault(f"{row.line}:{at + 1}", repr(row.cells[at][:40]), "a number")


def _refuse_rows(source: SourceText, columns: Sequence[Column], rows: Sequence[ExportRow], bad: list[Fault]) -> None:
    """Refuse a table most of whose rows have one other width, or that has no good rows or too many bad ones."""
    widths = Counter(len(row.cells) for row in rows if len(row.cells) != len(columns))
    most, often = widths.most_common(1)[0] if widths else (0, 0)
    if often > 0.5 * len(rows):
        hint = "A column was dropped or added; export the file again"
        source.refuse(rows[0].line, f"rows of {most} columns", f"{len(columns)} as in the header", hint)
    source.faults += bad[:5] or [source.fault("", "no rows of numbers", "one row or more", "Is the file cut?")]
    if len(bad) > 5:
        source.add("", f"{len(bad) - 5} more damaged rows", "rows as in the header")
    source.check()


def _spikes(column: Column, values: Array) -> list[str]:
    size = np.abs(values[np.isfinite(values)])
    typical = float(np.median(size)) if size.size else 0.0
    if size.size < 10 or typical == 0.0 or float(np.max(size)) <= 1e3 * typical:
        return []
    at = int(np.nanargmax(np.abs(values)))
    note = f"{column.name}: {values[at]:.6g} in row {at + 1} is over 1000 times the usual size ({typical:.3g})"
    return [note + (": start-up or damage" if at < 0.1 * values.size else ": damage?")]


def _in_order(
    columns: Sequence[Column], values: Array, time: int | None, step: int | None, notes: list[str]
) -> NDArray[np.intp]:
    """Rows of a history in the order of its clocks, of what a restart repeats the last, (N,)."""
    index: NDArray[np.intp] = np.arange(len(values))
    alive = np.isfinite(values[:, [column.role == "value" for column in columns]]).any(axis=1)
    at = time if time is not None else step
    if at is not None and alive.any() and np.any(np.diff(values[:, at]) < 0):  # no value, no order
        index = index[alive]
    for k in (k for k in (time, step) if k is not None):
        if time not in (None, k) and np.any(np.diff(values[index, k]) < 0):
            notes.append(f"{columns[k].name} goes back while {columns[at or 0].name} goes on: a restart")
            continue
        kept, more = keep_last(values[index, k], columns[k].name)
        index, notes[len(notes) :] = index[kept], more
    return index


def history(
    format: str, source: SourceText, columns: Sequence[Column], table: ExportTable,  # noqa: A002
    warnings: Sequence[str] = (), provenance: Mapping[str, str] | None = None,
) -> Dataset:  # fmt: skip
    """Make the record of a history: repeated rows resolved, means of the channels with what they were taken over.

    A history by time gets the mean of all rows (whole revolutions need the speed, which the file does not say), one
    by iterations that of its last fifth.
    """
    roles = [column.role for column in columns]
    time, step = _clock(table.values, roles, "time"), _clock(table.values, roles, "step")
    notes = [*warnings, *table.warnings]
    index = _in_order(columns, table.values, time, step, notes)
    clock = "time" if time is not None else "iteration"
    names = unique([column.name for column in columns])
    channels: dict[str, Channel] = {}
    for k, (name, column) in enumerate(zip(names, columns, strict=True)):
        values = table.values[index, k]
        channels[name] = Channel(values, column.unit)
        if column.role != "value":
            continue
        average = steady_average(values, 1.0) if clock == "time" else steady_average(values)
        over = f"all {average.rows} rows, start-up included" if clock == "time" else f"last {average.rows} rows"
        notes += _spikes(column, values)
        if average.mean is not None:
            channels[name] = Channel(values, column.unit, Mean(average.mean, over, average.drift))
        elif average.problem:
            notes.append(f"{name}: no mean: {average.problem}")
    about = {**source.about, **(provenance or {}), "clock": clock}
    about["clock_channels"] = "\t".join(n for n, c in zip(names, columns, strict=True) if c.role in ("time", "step"))
    if time is not None:
        about["time_channel"] = names[time]
    if "value" not in roles:
        notes.append("the file has no column of values, only its clock")
    elif len(index) > 1 and not any(np.any(table.values[index, k]) for k, r in enumerate(roles) if r == "value"):
        notes.append("every value is 0: did the function object, or the report, find its surfaces?")
    return dataset(format, "cfd", channels, notes, about)


def _clock(values: Array, roles: Sequence[str], role: str) -> int | None:
    """First column of a role that really counts (a steady file may carry a time that stands still)."""
    for k, own in enumerate(roles):
        if own == role and (len(values) == 1 or len(np.unique(values[np.isfinite(values[:, k]), k])) > 1):
            return k
    return None

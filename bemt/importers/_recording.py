"""What importers of recordings share: splitting text into cells, and rows that need a flag.

Nothing is dropped: every line below the heading becomes a row or a fault, every cell a number, a text, or NaN with a
flag on its row. Headings are read in :mod:`bemt.importers._headings`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bemt import units
from bemt.errors import Fault, InputError
from bemt.imported import Channel, Imported
from bemt.importers import SourceText, number
from bemt.importers._headings import Heading, slug, unit_of

__all__ = [
    "Builder", "Table", "column_numbers", "find_delimiter", "slip", "some", "spikes", "split_line", "split_table",
]  # fmt: skip

Array = NDArray[np.float64]
NO_VALUE = frozenset({"", "nan", "na", "n/a", "-", "--", "null", "none"})
"""Cells that say "no value", in lower case."""
DELIMITERS = (";", "\t", ",", "|")
MAX_FAULTS = 20
_WITH_UNIT = re.compile(r"[+-]?[\d.]+\s*([^\W\d][\w/·]{0,6}|%)")
BAD_SHARE = 0.1
"""Share of cells that are no numbers from which a column is text."""


@dataclass(frozen=True)
class Table:
    """Cells of a delimited file: headings (empty when it has none), rows of equal length with their line numbers."""

    source: SourceText
    delimiter: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    warnings: tuple[str, ...] = ()
    cut: int | None = None  # index of a row that the end of the file cut off


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

    Parameters
    ----------
    items : iterable
        Things to name.
    limit : int
        How many to name.

    Returns
    -------
    str
        Such as ``3, 4, 7 and 12 more``.

    Examples
    --------
    >>> some([1, 2]), some(range(9), 3)
    ('1, 2', '0, 1, 2 and 6 more')
    """
    words = [str(item) for item in items]
    more = f" and {len(words) - limit} more" if len(words) > limit else ""
    return ", ".join(words[:limit]) + more


def find_delimiter(lines: Sequence[str]) -> str:
    """Delimiter of some lines: the first of ``; tab , |`` that all of them have, else blanks.

    Parameters
    ----------
    lines : sequence of str
        The first lines of a table.

    Returns
    -------
    str
        One character.

    Examples
    --------
    >>> find_delimiter(["r;mm,x", "1,2"]), find_delimiter(["a;b", "1,5;2,5"]), find_delimiter(["1 2", "3 4"])
    (',', ';', ' ')
    """
    plain = [re.sub(r'"[^"]*"', "", line) for line in lines]
    everywhere = [mark for mark in DELIMITERS if plain and all(mark in line for line in plain)]
    return everywhere[0] if everywhere else " "


def split_table(source: SourceText, delimiter: str | None = None, header: bool | None = None) -> Table:
    """Split a file into rows of equal length.

    Parameters
    ----------
    source : SourceText
        The file.
    delimiter : str or None
        One of ``; tab , |`` or a blank; None finds it in the first line.
    header : bool or None
        Whether the first line names the columns; None: it does when no cell of it is a number.

    Returns
    -------
    Table
        Lines that are blank or begin with ``#`` or ``%`` are left out and counted in its warnings.

    Raises
    ------
    InputError
        With the lines whose number of cells differs from the first one's; a last line that is cut off is kept.
    """
    lines = source.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    used = [(i, t) for i, t in enumerate(lines, 1) if t.strip() and not t.lstrip().startswith(("#", "%"))]
    comments = sum(1 for t in lines if t.lstrip().startswith(("#", "%")))
    if not used:
        raise InputError(Fault(source.name, "", "no data", "a heading line and rows of numbers"))
    mark = delimiter or find_delimiter([t for _, t in used[:5]])
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
    notes = [f"{comments} comment lines left out"] if comments else []
    if header and len(split) > 2 and _is_units(split[1][1]):
        stated = [*split[1][1], *[""] * width]
        stated = [unit.strip("-()[]") for unit in stated]
        first = [f"{name} ({unit})" if unit else name for name, unit in zip(first, stated, strict=False)]
        notes.append(f"line {split[1][0]} holds units")
        del split[1]
    rows: list[tuple[str, ...]] = []
    faults: list[Fault] = []
    cut = None
    body = split[1:] if header else split
    for k, (i, cells) in enumerate(body):
        over = cells[width:]
        if any(over):
            got, hint = f"{len(cells)} cells", "A delimiter inside a value, or a decimal comma?"
            faults.append(Fault(source.name, str(i), got, f"{width} as in line {split[0][0]}", hint))
        elif len(cells) < width and k == len(body) - 1 and not lines[-1] == "" and k > 0:
            cut = k
            rows.append(tuple(cells) + ("",) * (width - len(cells)))
        elif len(cells) < width:
            hint = "Was a line cut?"
            faults.append(Fault(source.name, str(i), f"{len(cells)} cells", f"{width} as in line {split[0][0]}", hint))
        else:
            rows.append(tuple(cells[:width]))
    if faults:
        extra = len(faults) - MAX_FAULTS
        faults = faults[:MAX_FAULTS]
        if extra > 0:
            faults.append(Fault(source.name, "", f"{extra} more lines of another length", f"{width} cells"))
        raise InputError(faults)
    if not rows:
        raise InputError(Fault(source.name, "", "no rows", "a heading line and rows of numbers"))
    names = tuple(first[:width]) if header else ()
    return Table(source, mark, names, tuple(rows), tuple(i for i, _ in (split[1:] if header else split)),
                 tuple(notes), cut)  # fmt: skip


def column_numbers(cells: Sequence[str], decimal: str = ".") -> tuple[Array, list[int], int]:
    """Numbers of a column.

    Parameters
    ----------
    cells : sequence of str
        Its cells.
    decimal : str
        Decimal mark, ``.`` or ``,``.

    Returns
    -------
    values : (N,) float
        NaN where a cell is empty or no number.
    bad : list of int
        Rows whose cell is neither a number nor empty.
    empty : int
        How many cells say "no value".
    """
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


def spikes(values: Array, half: int = 3, times: float = 2.0) -> NDArray[np.bool_]:
    """Single samples that jump away from all their neighbours and back.

    Parameters
    ----------
    values : (N,) float
        One channel in order of time, NaN where it has no value.
    half : int
        Neighbours on each side that count.
    times : float
        How many times the spread of the whole channel (5 % to 95 %) a jump must be, after the spread of the neighbours.

    Returns
    -------
    (N,) bool
        True at spikes.

    Notes
    -----
    A sample is a spike when it lies outside the range of its neighbours by more than `times` that range and by more
    than a quarter of the spread of the whole channel. At an end, one side has no neighbours; there the jump must exceed
    the spread of the whole channel, since a start-up looks like one.

    Examples
    --------
    >>> spikes(np.array([1.0, 1.1, 1.2, 9.0, 1.4, 1.5, 1.6, 1.7])).nonzero()[0]
    array([3])
    """
    out = np.zeros(values.shape, dtype=bool)
    rows = np.flatnonzero(np.isfinite(values))
    if len(rows) < 6:
        return out
    v = values[rows]
    low, high = np.percentile(v, [5.0, 95.0])
    spread = max(float(high - low), 1e-12 * float(np.max(np.abs(v))))
    padded = np.full(len(v) + 2 * half, np.nan)
    padded[half:-half] = v
    near = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1).copy()
    near[:, half] = np.nan
    lo, hi = np.nanmin(near, axis=1), np.nanmax(near, axis=1)
    away = np.maximum(v - hi, lo - v)
    edge = np.zeros(len(v), dtype=bool)
    edge[:1] = edge[-1:] = True
    need = np.maximum(times * (hi - lo), np.where(edge, 1.0, 0.25) * spread)
    out[rows[away > need]] = True
    return out


@dataclass
class Builder:
    """Gathers the channels, texts, flags and warnings of one table and makes the `Imported`."""

    table: Table
    format: str
    kind: str = "bench"
    channels: dict[str, Channel] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    flags: list[list[str]] = field(init=False)
    headings: dict[str, str] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    unitless: list[str] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.flags = [[] for _ in self.table.rows]
        self.warnings.extend(self.table.warnings)
        if self.table.cut is not None:
            self.flag([self.table.cut], "line cut off at the end of the file")

    def line(self, row: int) -> int:
        """Line in the file of a row."""
        return self.table.lines[row]

    def flag(self, rows: Iterable[int], what: str, why: str = "") -> None:
        """Flag rows and warn once; rows are kept."""
        hit = [int(r) for r in rows]
        for r in hit:
            self.flags[r].append(what)
        if hit:
            where = f"{len(hit)} row{'s' if len(hit) > 1 else ''} (line {some(self.line(r) for r in hit)})"
            self.warnings.append(f"{what} in {where}, kept and flagged{why}")

    def free(self, name: str) -> str:
        """Name that no channel or text has yet."""
        k, out = 2, name
        while out in self.channels or out in self.texts:
            out, k = f"{name}_{k}", k + 1
        return out

    def add(self, index: int, head: Heading, decimal: str = ".", sign: float = 1.0) -> str:
        """Add column `index` as a channel or a text; gives its name ("" when the column is empty)."""
        cells = [row[index] for row in self.table.rows]
        values, bad, empty = column_numbers(cells, decimal)
        label = head.text or f"column {index + 1}"
        if empty == len(cells):
            self.empty.append(repr(label))
            return ""
        comma = [i for i in bad if re.fullmatch(r"[+-]?\d+,\d*|[+-]?\d{1,3}(,\d{3})*\.\d*", cells[i])]
        if comma and decimal == ".":
            where = f"{self.line(comma[0])}:{index + 1}"
            got = f"{cells[comma[0]]!r} ({len(comma)} such cells of {label!r})"
            hint = 'State decimal = "," in a recording.toml beside the file, or export with decimal points'
            self.faults.append(Fault(self.table.source.name, where, got, "a number with a decimal point", hint))
            return ""
        name = self.free(head.name)
        if len(bad) > BAD_SHARE * (len(cells) - empty):
            name = self.free(slug(head.text) or head.name)
            self.texts[name] = tuple(cells)
            if len(bad) < len(cells) - empty:
                self.warnings.append(f"column {label!r} mixes numbers and text: kept as text")
            elif sum(bool(_WITH_UNIT.fullmatch(cells[i])) for i in bad) > len(bad) / 2:
                self.warnings.append(f"column {label!r} has units in its cells ({cells[bad[0]][:20]!r}): kept as text")
            return ""
        if bad:
            words = some((f"{cells[i][:20]!r} at {self.line(i)}:{index + 1}" for i in bad), 3)
            self.flag(bad, f"{name}: no number", f": {words}; NaN there")
        if head.unit is None:
            self.unitless.append(f"{label!r}" + (f" ({head.doubt})" if head.doubt else ""))
        elif head.unit.suffix != "rpm":
            with np.errstate(over="ignore"):
                values = values * head.unit.factor + head.unit.offset
            over = np.isinf(values)
            self.flag(np.flatnonzero(over), f"{name}: too large a number", "; NaN there")
            values[over] = np.nan
        if head.name != name:
            self.warnings.append(f"column {label!r} has the name of another column: kept as {name}")
        self.channels[name] = Channel(values * sign, head.unit_name)
        self.headings[name] = head.text
        return name

    def check_magnitudes(self) -> None:
        """Warn of magnitudes that look like a slip of units; nothing is converted."""
        for name, (low, high, hint) in _PLAUSIBLE.items():
            for key, channel in self.channels.items():
                if not (key == name or key.endswith("_" + name)) or not channel.unit:
                    continue
                if {"err", "u"} & {*key.split("_")}:  # an uncertainty has no usual magnitude
                    continue
                v = np.abs(channel.values[np.isfinite(channel.values)])
                if v.size and not low <= float(np.max(v)) <= high and float(np.max(v)) > 0.0:
                    text = f"{key}: greatest magnitude {np.max(v):.4g} is outside {low:g} to {high:g}. {hint}"
                    self.warnings.append(text + "; nothing was converted")
        self._same_twice()

    def _same_twice(self) -> None:
        """Compare columns of one quantity in two units; a disagreement is a slip of one of them."""
        for key, channel in self.channels.items():
            first = self.channels.get(re.sub(r"_\d+$", "", key))
            if first is None or first is channel or channel.unit != first.unit or not channel.unit:
                continue
            both = np.isfinite(channel.values) & np.isfinite(first.values) & (first.values != 0.0)
            ratio = float(np.median(channel.values[both] / first.values[both])) if np.any(both) else np.nan
            if np.isfinite(ratio) and abs(ratio - 1.0) > 0.01:
                self.warnings.append(
                    f"{self.headings[key]!r} is {ratio:.5g} times {self.headings[re.sub(r'_[0-9]+$', '', key)]!r} "
                    f"once both are in {channel.unit}{slip(ratio)}; nothing was converted"
                )

    def flag_time(self, name: str = "time_s") -> None:
        """Flag rows where time does not advance."""
        if name in self.channels:
            t = self.channels[name].values
            rows = np.flatnonzero(np.isfinite(t))
            step = np.diff(t[rows])
            self.flag(rows[1:][step < 0.0], "time goes backwards")
            same = rows[1:][step == 0.0]
            if same.size:
                self.warnings.append(f"{same.size} rows repeat the time of the row before (lines "
                                     f"{some(self.line(int(r)) for r in same)})")  # fmt: skip

    def finish(self, provenance: Mapping[str, str] | None = None, **more: object) -> Imported:
        """Make the `Imported`, or raise all faults."""
        if not self.channels and not self.faults:
            columns = f"{len(self.texts)} columns of text" if self.texts else "empty columns"
            expected = "one column of numbers or more"
            self.faults.append(Fault(self.table.source.name, "", f"no column of numbers ({columns})", expected))
        if self.faults:
            raise InputError(self.faults)
        if self.empty:
            self.warnings.append(f"no values in {len(self.empty)} columns: {some(self.empty, 8)}")
        if self.unitless:
            hint = "Name units in the headings or in a recording.toml"
            self.warnings.append(f"no unit known, none assumed, for {some(self.unitless, 8)}. {hint}")
        said = {"file": self.table.source.name, "sha256": self.table.source.sha256, **(provenance or {})}
        return Imported(
            self.format, self.kind, len(self.table.rows), self.channels, tuple(self.warnings), said,
            flags=tuple(tuple(f) for f in self.flags), lines=self.table.lines, texts=self.texts,
            headings=self.headings, **more,  # type: ignore[arg-type]
        )  # fmt: skip


_PLAUSIBLE: dict[str, tuple[float, float, str]] = {
    "rpm": (150.0, 3e5, "rev/s, rad/s or electrical revolutions?"),
    "pulse_width_s": (5e-4, 3e-3, "Microseconds against milliseconds?"),
    "voltage_V": (0.5, 1000.0, "mV?"), "current_A": (1e-3, 2000.0, "mA?"), "throttle": (1e-3, 1.5, "Percent?"),
    "temperature_K": (220.0, 450.0, "Celsius, Fahrenheit or Kelvin?"),
    "pressure_Pa": (3e4, 1.2e5, "Pa, hPa or mbar?"), "thrust_N": (1e-4, 2e4, "gf, kgf or N?"),
    "torque_Nm": (1e-6, 5e3, "Nm, mNm or gf cm?"), "airspeed_m_s": (0.0, 340.0, "km/h?"),
}  # fmt: skip


def slip(ratio: float, within: float = 0.02) -> str:
    """Slip of units that a ratio looks like, as words to append; "" when none fits."""
    for name, factor in units.SLIP_FACTORS.items():
        for value in (factor, 1.0 / factor):
            if abs(abs(ratio) / value - 1.0) < within:
                return f" (the factor of {name})"
    return " (the sign differs)" if abs(ratio + 1.0) < within else ""

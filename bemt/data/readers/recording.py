"""What importers of recordings share: cells that become channels, and rows that need a flag.

Nothing is dropped: every line below the heading becomes a row or a fault (:mod:`bemt.data.readers.split`), every cell
a number, a text, or NaN with a flag on its row. Headings are read in :mod:`bemt.data.readers.headings`.
"""

from __future__ import annotations

import os
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.tables import number_of, some
from bemt.data.readers import load_text
from bemt.data.readers._large import NumberTable
from bemt.data.readers._words import english
from bemt.data.readers.headings import CELLS, Heading, heading, in_usual_unit, slug
from bemt.data.readers.left_open import NEEDED, OWN, asked, nearest, one_step
from bemt.data.readers.samples import Channel, clock_seconds, dataset, spikes
from bemt.data.readers.split import (
    MOST_ODD,
    MOST_ODD_OF_UNIT,
    SHEET_ERRORS,
    SplitTable,
    column_numbers,
    decimal_mark,
    lone_points,
    odd_mark,
    split_table,
    with_unit,
)
from bemt.physics.dataset import Dataset

FULL_THROTTLE, LEAST_PERCENT = 1.05, 5.0
"""Throttle beyond which it is no fraction; greatest one from which it is percent. [1]"""
HOTTEST_AIR, MOST_AIR_VARIES, COLDEST_PART = 323.0, 20.0, 200.0
"""Temperature above which, and range over which, no air around a stand is; below which no part of it is. [K]"""
_WITH_UNIT = re.compile(r"[+-]?[\d.]+\s*([^\W\d][\w/·]{0,6}|%)")
SLIP = 0.02
"""Share that a ratio is near a unit error by. [1]"""
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+(\.\d*)?")


class Remark(str):
    """A note on what was found or done, with nothing to do about it."""

    __slots__ = ()


@dataclass
class Builder:
    """Gathers the channels, texts, flags and warnings of one table and makes the `Dataset`."""

    table: SplitTable | NumberTable
    format: str
    kind: str = "bench"
    channels: dict[str, Channel] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    flags: dict[int, list[str]] = field(default_factory=dict)
    headings: dict[str, str] = field(default_factory=dict)
    declared: dict[str, float] = field(default_factory=dict)  # Units of what was converted, in that of the channel
    unitless: list[str] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    clocks: list[str] = field(default_factory=list)
    units_stated: set[str] = field(default_factory=set)
    stated: list[str] | None = field(default_factory=list)  # Options of what is stated; None: options cannot say it
    asks: list[str] = field(default_factory=list)
    asked: dict[str, str] = field(default_factory=dict)  # Channel that may be it, by quantity
    decimal: str = "."  # As `decimal_mark` gives it

    def __post_init__(self) -> None:
        self.warnings.extend(self.table.warnings)
        if self.decimal == ".,":
            self.warnings.append(Remark("commas between thousands left out"))
        if self.decimal == ",":
            self.warnings.append(Remark("decimal commas read as decimal points"))
        if self.table.cut is not None:
            self.flag([self.table.cut], "line cut off at the end of the file")
        self.flag(self.table.misfits, f"not {self.table.width} cells", "; no value of them is taken")

    @classmethod
    def of_stand(cls, path: str | os.PathLike[str], format: str) -> Builder:  # noqa: A002
        """Begin with the table of a stand, whose headings are known and stand once each."""
        table = split_table(load_text(path), header=True)
        for name in sorted(h for h, times in Counter(table.headings).items() if h and times > 1):
            table.source.add("1", f"a second column {name!r}", "each column once")
        return cls(table, format, decimal=decimal_mark(table))

    def add_usual(self, index: int, base: str, unit: str) -> None:
        """Add a stand's own column in its usual unit or in the one that its heading states; no such unit is a fault."""
        head = in_usual_unit(self.table.headings[index].strip(), base, unit)
        if head.unit is None:
            line = getattr(self.table, "headings_line", 1)
            self.table.source.add(f"{line}:{index + 1}", repr(head.text), f"a unit such as {unit}", head.doubt)
        else:
            self.add(index, head)

    def need(self, *names: str) -> None:
        """Note channels that are not there."""
        for name in names:
            if name not in self.channels:
                self.table.source.add("1", f"no numbers for {name}", "a column of numbers")

    def at(self, name: str) -> Array | None:
        """Values of a channel, None without it."""
        channel = self.channels.get(name)
        return None if channel is None else channel.values

    def rename(self, old: str, new: str) -> str:
        """Give a channel another name, in its place; gives its heading."""
        self.channels = {new if k == old else k: c for k, c in self.channels.items()}
        self.headings[new] = self.headings.pop(old)
        self.declared = {new if k == old else k: size for k, size in self.declared.items()}
        return self.headings[new]

    def line(self, row: int) -> int:
        """Line in the file of a row."""
        return self.table.lines[row]

    def flag(self, rows: Iterable[int], what: str, why: str = "") -> None:
        """Flag rows and warn once; rows are kept, what a reduction leaves of them is its own remark."""
        hit = [int(r) for r in rows]
        for r in hit:
            self.flags.setdefault(r, []).append(what)
        if hit:
            where = f"{len(hit)} row{'s' if len(hit) > 1 else ''} (line {some(map(self.line, hit))})"
            self.warnings.append(f"{what} in {where}: flagged{why}")

    def flag_speeds(self, *names: str) -> None:
        """Flag speeds of 0 and below, of those that are there."""
        for name in names:
            if (values := self.at(name)) is not None:
                self.flag(np.flatnonzero(values == 0.0), f"{name} is 0")
                self.flag(np.flatnonzero(values < 0.0), f"{name} is negative")

    def flag_spikes(self, *names: str) -> None:
        """Flag single samples that jump, in the channels of these that are there."""
        for name in names:
            if (values := self.at(name)) is not None:
                self.flag(np.flatnonzero(spikes(values)), f"spike of {name}")

    def ask(self, quantity: str, names: Sequence[str]) -> str:
        """Ask whether the largest of some channels is this quantity; gives its heading."""
        most = max(names, key=lambda k: np.nanmax(np.abs(self.channels[k].values), initial=0.0))
        self.asked[quantity] = most
        self.asks.append(f"--column {quantity}={shlex.quote(self.headings[most])}")
        return self.headings[most]

    def free(self, name: str) -> str:
        """Name that no channel or text has yet."""
        k, out = 2, name
        while out in self.channels or out in self.texts:
            out, k = f"{name}_{k}", k + 1
        return out

    def _warn_of_sheet_errors(self, index: int, label: str) -> None:
        if errors := sum(cell.lower() in SHEET_ERRORS for cell in self.table.cells(index)):
            note = f"column {label!r}: {number_of(errors, 'cell')} with an error of the spreadsheet, taken as empty"
            self.warnings.append(note)

    def add(self, index: int, head: Heading, sign: float = 1.0) -> str:
        """Add column `index` as a channel or a text; gives its name ("" when the column is empty)."""
        values, bad, empty = self.table.numbers(index, self.decimal)
        label, filled = head.text or f"column {index + 1}", len(values) - empty
        if empty:
            self._warn_of_sheet_errors(index, label)
        if not filled:
            self.empty.append(repr(label))
            return ""
        if self._other_mark(index, label, bad):
            return ""
        if bad and (stated := self._one_unit(index, bad)):
            cells = [(with_unit(c) or (c, ""))[0] for c in self.table.cells(index)]
            values, bad, _ = column_numbers(cells, self.decimal)
            head = heading(f"{head.text} ({stated})") if head.unit is None or head.name == "throttle" else head
            head = replace(head, text=label)
            self.warnings.append(f"column {label!r}: its cells say the unit, {stated}")
        known = head.unit is not None and head.unit_name not in ("", "-")
        if len(bad) > (MOST_ODD_OF_UNIT if known else MOST_ODD) * filled:
            return self._add_text(index, head, label, bad, filled)
        name = self.free(head.name)
        if bad:
            odd = some((f"{self.table.cell(i, index)[:20]!r} at {self.line(i)}:{index + 1}" for i in bad), 3)
            self.flag(bad, f"{name}: no number", f": {odd}; NaN there")
        if head.told:
            self.warnings.append(Remark(head.told))
        values = self._in_si(name, head, label, values)
        if head.name != name:
            self.warnings.append(f"column {label!r} has the name of another column: kept as {name}")
        self.channels[name] = Channel(values if sign == 1.0 else values * sign, head.unit_name)
        self.headings[name] = head.text
        return name

    def _in_si(self, name: str, head: Heading, label: str, values: Array) -> Array:
        """Values of a channel in SI, (N,); as they are, and told, without a unit; rev/min of a speed."""
        unit = head.unit
        if unit is None:
            running = not head.text and np.array_equal(values, values[0] + np.arange(len(values)))  # as pandas writes
            if not (running or CELLS.search(label.partition("[")[0].strip())):  # a count needs none
                self.unitless.append(f"{label!r}" + (f" ({head.doubt})" if head.doubt else ""))
            return values
        if unit.dimension == "fraction":
            self.units_stated.add(name)
        if unit.suffix == "rpm" or (unit.factor, unit.offset) == (1.0, 0.0):
            return values
        with np.errstate(over="ignore"):
            values = values * unit.factor + unit.offset
        self.declared[name] = unit.factor
        over = np.isinf(values)
        self.flag(np.flatnonzero(over), f"{name}: too large a number", "; NaN there")
        values[over] = np.nan
        return values

    def _other_mark(self, index: int, label: str, bad: Sequence[int]) -> bool:
        """Faults of cells with another decimal mark than the table's; whether the column is lost by commas."""
        split = self.table if isinstance(self.table, SplitTable) else None
        if self.decimal == "," and split is not None:
            for i in lone_points(split.cells(index))[:1]:
                got = f"{split.cell(i, index)!r} among the decimal commas of {label!r}"
                hint = "Thousands or decimals? Write it with a comma, or without a mark"
                self.table.source.add(f"{self.line(i)}:{index + 1}", got, "one decimal mark", hint)
        if self.decimal != ".":
            return False
        cells = {i: self.table.cell(i, index) for i in bad}
        comma = [i for i in bad if re.fullmatch(r"[+-]?\d+,\d*|[+-]?\d{1,3}(,\d{3})*\.\d*", cells[i])]
        if comma:
            got = f"{cells[comma[0]]!r} ({len(comma)} such cells of {label!r})"
            hint = 'State decimal = "," in a recording.toml in the same folder, or export with decimal points'
            hint += f"; {odd}" if split is not None and (odd := odd_mark(split)) else ""
            if all(_THOUSANDS.fullmatch(cells[i]) for i in comma):
                hint = f"A comma between thousands? Export without. If not: {hint[0].lower()}{hint[1:]}"
            self.table.source.add(f"{self.line(comma[0])}:{index + 1}", got, "a number with a decimal point", hint)
        return bool(comma)

    def _add_text(self, index: int, head: Heading, label: str, bad: Sequence[int], filled: int) -> str:
        """Add a column of text, or of clock times; gives the name of the latter."""
        column, base = self.table.cells(index), slug(head.text) or head.name
        if (seconds := clock_seconds(column)) is not None:
            name = self.free(f"{base}_s")
            self.channels[name], self.headings[name] = Channel(seconds, "s"), head.text
            self.clocks.append(name)
            self.warnings.append(Remark(f"column {label!r} is a clock: seconds since {column[0] or 'its first time'}"))
            return name
        self.texts[self.free(base)] = tuple(column)
        if len(bad) < filled:
            self.warnings.append(f"column {label!r} mixes numbers and text: kept as text")
        elif sum(bool(_WITH_UNIT.fullmatch(column[i])) for i in bad) > len(bad) / 2:
            self.warnings.append(f"column {label!r} has units in its cells ({column[bad[0]][:20]!r}): kept as text")
        else:
            self.words.append(repr(label))
        return ""

    def _one_unit(self, index: int, bad: Sequence[int]) -> str:
        """Unit that the cells of a column say, all of them the same; "" for any other column."""
        stated = {found[1] if (found := with_unit(self.table.cell(i, index))) else "" for i in bad}
        return stated.pop() if len(stated) == 1 and len(bad) > 1 else ""

    def check_command(self) -> None:
        """A throttle without a unit: percent where it can be nothing else, else no unit; either is said."""
        channel = self.channels.get("throttle")
        top = float(np.nanmax(channel.values, initial=0.0)) if channel is not None else 0.0
        if channel is None or top <= FULL_THROTTLE or "throttle" in self.units_stated:
            return
        label = self.headings["throttle"]
        if LEAST_PERCENT <= top <= 100.0 * FULL_THROTTLE and float(np.nanmin(channel.values)) >= 0.0:
            self.channels["throttle"] = Channel(channel.values / 100.0, "-")
            self.warnings.append(f"{label!r} goes up to {top:g} without a unit: read as percent")
        else:
            self.channels["throttle"] = Channel(channel.values, "")
            self.unitless.append(f"{label!r} (up to {top:g}: head it throttle (%), or PWM (us) for a pulse width)")

    def check_air(self) -> None:
        """A temperature that only a part reaches is not that of the air, whatever its heading leaves open."""
        channel = self.channels.get("temperature_K")
        words = set(english(self.headings.get("temperature_K", "air")))
        if channel is None or self.format == "recording" or words & {"ambient", "air"}:
            return
        known = np.isfinite(channel.values)
        v = channel.values[known]
        slip = v.size and np.min(v) < COLDEST_PART  # degrees Celsius under a heading of kelvin, say
        # runs on a cold day and on a warm one are two airs; what warms within a run is a part
        run = self.channels["run"].values[known] if "run" in self.channels else np.zeros(v.size)
        varies = max((float(np.ptp(v[run == k])) for k in np.unique(run[np.isfinite(run)])), default=0.0)
        if v.size and not slip and (np.max(v) > HOTTEST_AIR or varies > MOST_AIR_VARIES):
            label = self.rename("temperature_K", self.free("part_temperature_K"))
            span = f"{np.min(v) - 273.15:.0f} to {np.max(v) - 273.15:.0f} C"
            told = f"{label!r} goes from {span}: a part's, not the air's"
            self.warnings.append(told + "; head that of the air Ambient temperature (C)")

    def check_magnitudes(self) -> None:
        """Warn of magnitudes that look like a slip of units; nothing is converted."""
        self.check_command()
        self.check_air()
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

    def flag_time(self) -> None:
        """Flag rows where time does not advance; the only clock is the time of a file that has no other."""
        if "time_s" not in self.channels and len(self.clocks) == 1:
            self.rename(self.clocks.pop(), "time_s")
        if "time_s" in self.channels:
            t = self.channels["time_s"].values
            rows = np.flatnonzero(np.isfinite(t))
            step = np.diff(t[rows])
            self.flag(rows[1:][step < 0.0], "time goes backwards")
            same = rows[1:][step == 0.0]
            if same.size:
                where = some(self.line(int(r)) for r in same)
                self.warnings.append(f"{number_of(same.size, 'row')} with the time of the row before (lines {where})")

    def finish(self, provenance: Mapping[str, str] | None = None, **more: Any) -> Dataset:
        """Make the `Dataset`, or raise all faults."""
        if not self.channels and not self.table.source.faults:
            columns = f"{number_of(len(self.texts), 'column')} of text" if self.texts else "empty columns"
            self.table.source.add("", f"no column of numbers ({columns})", "one column of numbers or more")
        self.table.source.check()
        if self.empty:
            self.warnings.append(Remark(f"no values in {number_of(len(self.empty), 'column')}: {some(self.empty, 8)}"))
        if self.words:
            note = f"text, kept as such, in {number_of(len(self.words), 'column')}: {some(self.words, 8)}"
            self.warnings.append(Remark(note))
        if self.unitless:
            hint = "Name units in the headings or in a recording.toml" + nearest(self.unitless, self.channels)
            self.warnings.append(f"no unit known, none assumed, for {some(self.unitless, 8)}. {hint}")
        said = {**self.table.source.about, "declared": self.declared, "asked": self.asked, **(provenance or {})}
        open_units = asked(self.unitless, self.channels)
        if self.stated is not None and (asks := [*self.asks, *open_units.values()]):
            step = one_step(Path(self.table.source.name).as_posix(), [*self.stated, *asks])
            own = " and ".join(f"your {what} in place of {mark}" for mark, what in OWN.items() if mark in step)
            self.warnings.append(f"in one step, with {own}: {step}" if own else step)
            if self.asks or NEEDED & open_units.keys():
                said["step"] = f"{step}   ({own})" if own else step
        flags: list[tuple[str, ...]] = [()] * len(self.table) if self.flags else []
        for row, words in self.flags.items():
            flags[row] = tuple(words)
        return dataset(
            self.format, self.kind, self.channels, self.warnings, said, flags=flags, lines=self.table.lines,
            texts=self.texts, headings=self.headings, **more,
        )  # fmt: skip


_PLAUSIBLE: dict[str, tuple[float, float, str]] = {
    "rpm": (150.0, 3e5, "rev/s, rad/s or electrical revolutions?"),
    "pulse_width_s": (5e-4, 3e-3, "Microseconds against milliseconds?"),
    "voltage_V": (0.5, 1000.0, "mV?"), "current_A": (1e-3, 2000.0, "mA?"), "throttle": (1e-3, 1.5, "Percent?"),
    "temperature_K": (220.0, 450.0, "Celsius, Fahrenheit or Kelvin?"),
    "pressure_Pa": (3e4, 1.2e5, "Pa, hPa or mbar?"), "thrust_N": (1e-4, 2e4, "gf, kgf or N?"),
    "torque_Nm": (1e-6, 5e3, "Nm, mNm or gf cm?"), "airspeed_m_s": (0.0, 340.0, "km/h?"),
}  # fmt: skip


def plausible(name: str, values: Array) -> bool:
    """Whether a channel can be this one of the air, by its size and what it varies by."""
    (low, high, _), v = _PLAUSIBLE[name], values[np.isfinite(values)]
    if name == "temperature_K":
        high = min(HOTTEST_AIR, v.min(initial=np.inf) + MOST_AIR_VARIES)
    return bool(v.any() and np.all((v >= low) & (v <= high)))


def slip(ratio: float) -> str:
    """Slip of units that a ratio looks like, as words to append; "" when none fits."""
    for name, factor in unit_errors.symmetric().items():
        for value in (factor, 1.0 / factor):
            if abs(abs(ratio) / value - 1.0) < SLIP:
                return f" (the factor of {name})"
    return " (the sign differs)" if abs(ratio + 1.0) < SLIP else ""

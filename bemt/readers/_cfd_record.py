"""Records of CFD exports: histories with a clock, and values at points."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.averaging import Average, Mean, keep_last, steady_average
from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset
from bemt.readers import SourceText, load_text
from bemt.readers._cfd import Column, ExportRow, ExportTable, numeric_table, unique
from bemt.readers._columns import Channel, dataset

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Layout:
    """How one program writes a history; reading it is the same for all."""

    kind: str  # of the reader
    example: str  # of a header, for messages
    header: Callable[[str], Sequence[str] | None]  # names on a line of headings; None on any other line
    cells: Callable[[str], tuple[str, ...]]  # of a row
    column: Callable[[str], Column]  # of a name
    skip: Callable[[str], bool] = lambda line: False  # lines that are neither headings nor rows
    notes: tuple[str, ...] = ()
    commas: bool = True  # whether a decimal comma is possible
    hint: str = "Is the header damaged?"  # where a row comes before the headings
    finish: Callable[[list[Column], ExportTable, list[str]], tuple[list[Column], ExportTable]] | None = None


def read_history(path: str | os.PathLike[str], layout: Layout) -> Dataset:
    """Read a history: headings that may be repeated by a restart, rows, lines to skip."""
    source = load_text(path)
    names: list[str] | None = None
    title, rows, repeated = "", list[ExportRow](), list[int]()
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        found = layout.header(text) if text else None
        if found is not None:
            if names is not None and list(found) != names:
                got, expected = f"another header ({', '.join(found)})", f"the first one ({', '.join(names)})"
                raise InputError(Fault(source.name, str(line), got, expected, "Split the file there"))
            repeated += [line] if names is not None else []
            names = list(found)
        elif not text or layout.skip(text):
            title = title or text.strip('"# ')
        elif names is None:
            expected = f"a header such as {layout.example}"
            raise InputError(Fault(source.name, str(line), repr(text[:60]), expected, layout.hint))
        else:
            rows.append(ExportRow(line, layout.cells(text)))
    if names is None:
        raise InputError(Fault(source.name, "", "no header", f"a line such as {layout.example}"))
    if not rows:
        got = f"a header ({', '.join(names)}) and no rows"
        raise InputError(Fault(source.name, "", got, "one row or more", "Did the run write a step?"))
    columns = [layout.column(name) for name in names]
    table = numeric_table(source, columns, rows, layout.commas)
    notes = [f"header repeated in line {', '.join(map(str, repeated[:5]))}: the run was restarted"] if repeated else []
    notes += layout.notes
    if layout.finish is not None:
        columns, table = layout.finish(columns, table, notes)
    return history(layout.kind, source, columns, table, notes, {"title": title})


def outermost(columns: list[Column], table: ExportTable, notes: list[str]) -> tuple[list[Column], ExportTable]:
    """Let the outermost counter that counts be the step; rows of inner iterations of one time step repeat it."""
    counters = [k for k, c in enumerate(columns) if c.role == "counter"]
    counting = [k for k in counters if len(np.unique(table.values[:, k])) > 1]
    steps = counting[:1] or counters[-1:]
    if len(counting) > 1:
        notes.append(f"the last {columns[counting[-1]].name} of each {columns[counting[0]].name} is taken")
    for k in counters:
        columns[k] = Column(columns[k].name, "", "step" if k in steps else "counter")
    return columns, table


def _spikes(column: Column, values: Array) -> list[str]:
    size = np.abs(values[np.isfinite(values)])
    typical = float(np.median(size)) if size.size else 0.0
    if size.size < 10 or typical == 0.0 or float(np.max(size)) <= 1e3 * typical:
        return []
    at = int(np.nanargmax(np.abs(values)))
    note = f"{column.name}: {values[at]:.6g} in row {at + 1} is over 1000 times the usual size ({typical:.3g})"
    return [note + (": start-up or damage" if at < 0.1 * values.size else ": damage?")]


def _channel(values: Array, unit: str, average: Average, over: str) -> Channel:
    """Make a channel with its average."""
    if average.mean is None:
        return Channel(values, unit)
    return Channel(values, unit, Mean(average.mean, over, average.drift))


def history(
    format: str,  # noqa: A002 - field of the record
    source: SourceText,
    columns: Sequence[Column],
    table: ExportTable,
    warnings: Sequence[str] = (),
    provenance: Mapping[str, str] | None = None,
) -> Dataset:
    """Make the record of a history: repeated rows resolved, means of the channels with what they were taken over.

    A history by time gets the mean of all rows (whole revolutions need the speed, which the file does not say), one
    by iterations that of its last fifth.
    """
    roles = [column.role for column in columns]
    time = _clock(table.values, roles, "time")
    step = _clock(table.values, roles, "step")
    notes = [*warnings, *table.warnings]
    index: NDArray[np.intp] = np.arange(len(table.values))
    if time is not None:
        index, more = keep_last(table.values[:, time], columns[time].name)
        notes += more
    if step is not None:
        steps = table.values[index, step]
        if time is None or not np.any(np.diff(steps) < 0):
            kept, more = keep_last(steps, columns[step].name)
            index = index[kept]
            notes += more
        else:
            notes.append(f"{columns[step].name} goes back while {columns[time].name} goes on: a restart")
    clock = "time" if time is not None else "iteration"
    names = unique([column.name for column in columns])
    channels: dict[str, Channel] = {}
    for k, (name, column) in enumerate(zip(names, columns, strict=True)):
        values = table.values[index, k]
        if column.role != "value":
            channels[name] = Channel(values, column.unit)
            continue
        average = steady_average(values, 1.0) if clock == "time" else steady_average(values)
        over = f"all {average.rows} rows, start-up included" if clock == "time" else f"last {average.rows} rows"
        channels[name] = _channel(values, column.unit, average, over)
        notes += _spikes(column, values)
        if average.mean is None and average.problem:
            notes.append(f"{name}: no mean: {average.problem}")
    about = {"file": source.name, "sha256": source.sha256, **(provenance or {}), "clock": clock}
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


def fields(
    format: str,  # noqa: A002 - field of the record
    source: SourceText,
    columns: Sequence[Column],
    table: ExportTable,
    warnings: Sequence[str] = (),
    provenance: Mapping[str, str] | None = None,
) -> Dataset:
    """Make the record of values at points: no means, since points carry no area; equal repeated columns appear once."""
    notes = [*warnings, *table.warnings]
    channels: dict[str, Channel] = {}
    first: dict[str, Array] = {}
    kept: list[Column] = []
    for k, column in enumerate(columns):
        values = table.values[:, k]
        twin = first.setdefault(column.name, values)
        if twin is not values and np.array_equal(twin, values, equal_nan=True):
            notes.append(f"column {column.name} is repeated with the same values: taken once")
            continue
        kept.append(replace(column, name=f"{column.name}\t{k}"))
    names = unique([column.name.split("\t")[0] for column in kept])
    for name, column in zip(names, kept, strict=True):
        channels[name] = Channel(table.values[:, int(column.name.split("\t")[1])], column.unit)
        if "#" in name:
            notes.append(f"two columns are named {name.split('#')[0]} and differ: the later one is {name}")
    notes.append("values at points: no mean is taken, since points carry no areas")
    about = {"file": source.name, "sha256": source.sha256, **(provenance or {}), "clock": "none"}
    return dataset(format, "cfd", channels, notes, about)

r"""Fluent transcripts (``*.trn``) and copied console text: residuals, flow time, computed reports, force reports.

::

      iter  continuity  x-velocity           k     time/iter
     11795  1.8226e-04  1.1633e-05  1.1935e-04  0:01:28   15
    Flow time = 4.417132770176977s, time step = 2371
                              Moment               [N m]
    -------------------------------- -------------------
                            tornillo         -0.18741116

A transcript tells what somebody computed at some moment: each such number is a channel by quantity and zone, the last
computation standing for it. Its channels differ in length (residuals by iterations, flow time by steps).
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping

import numpy as np

from bemt.base.averaging import Mean, keep_last
from bemt.data.readers import SourceText, load_text, number
from bemt.data.readers.cfd import head_lines, si_unit, slug
from bemt.data.readers.columns import Channel, dataset
from bemt.data.readers.fluent_forces import blocks
from bemt.physics.dataset import Dataset

KIND = "fluent_transcript"

_FLOW = re.compile(r"\s*Flow time = (\S+?)s?, time step = (\d+)\s*")
_ITER = re.compile(r"\s*iter\s+(\S.*)")
_ROW = re.compile(r"\s*\d+\s+\S.*\s\d+:\d\d:\d\d\s+\d+\s*")
_RULE = re.compile(r"\s*-{8,}\s+-{8,}\s*")
_HEAD = re.compile(r"\s*(\S.*?)\s+[\[(]([^\[\]()]*)[\])]\s*")
_MARKS = re.compile(r"Auto-Transcript|Welcome to ANSYS Fluent|ANSYS FLUENT|ansys fluent|iter\s+continuity\b")
_LOUD = (
    ("divergence detected", "divergence was detected"),
    ("floating point exception", "a floating point exception"),
    ("turbulent viscosity limited", "turbulent viscosity was limited"),
    ("reversed flow", "reversed flow at an outlet"),
)
_AVERAGE = re.compile(r"\(Average Over\)\"?\s+(\d+)")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a text shows marks of a Fluent console.

    >>> sniff("  iter  continuity  x-velocity  time/iter\n 1 1.0 1.0 0:00:01 9"), sniff("iteration,continuity")
    (True, False)
    >>> sniff("  Moment   [N m]\n------------ ----------\n  blade   -0.18\n")
    True
    """
    lines = head_lines(head, 400)
    if any(_MARKS.search(line) for line in lines):
        return True
    return any(_RULE.fullmatch(b) and _HEAD.fullmatch(a) for a, b in zip(lines, lines[1:], strict=False))


def _computed(source: SourceText, notes: list[str]) -> Iterator[tuple[str, str, float]]:
    """Quantity(zone), unit and value of every computed table, in their order."""
    lines = source.lines
    for k in range(1, len(lines)):
        head = _HEAD.fullmatch(lines[k - 1])
        if not head or not _RULE.fullmatch(lines[k]):
            continue
        before = lines[k - 2].strip() if k > 1 else ""
        phase = f"[{before}]" if before and " " not in before and not before.startswith(("(", "-")) else ""
        si = si_unit(head[2])
        name = slug(head[1]) + phase + (f"_{si}" if si else "")
        for at in range(k + 1, len(lines)):
            text = lines[at]
            if not text.strip() or text.startswith("("):
                break
            if re.fullmatch(r"[-\s]+", text):
                continue
            cells = text.rsplit(None, 1)
            value = number(cells[1]) if len(cells) == 2 else None
            last = at == len(lines) - 1 and not source.text.endswith(("\n", "\r"))
            if value is None or len(cells[0].split()) != 1 or last:
                why = "no line end, may be cut" if last else repr(text.strip()[:40])
                notes.append(f"line {at + 1}: computed {head[1]}: {why}; left out")
                break
            yield f"{name}({cells[0].strip()})", si or head[2].strip(), value


def _residuals(source: SourceText) -> tuple[dict[str, list[float]], list[float], int]:
    """Columns of the residual tables, their iterations, and the number of damaged rows."""
    names: list[str] = []
    columns: dict[str, list[float]] = {}
    steps: list[float] = []
    damaged = 0
    for text in source.lines:
        match = _ITER.fullmatch(text)
        if match and "time/iter" in match[1]:
            names = match[1].split()[:-1]
            for name in names:
                columns.setdefault(name, [float("nan")] * len(steps))
        elif names and _ROW.fullmatch(text):
            cells = text.split()
            values = [number(cell) for cell in cells[:-2]]
            step = values[0]
            if len(values) != len(names) + 1 or step is None:
                damaged += 1
                continue
            steps.append(step)
            row = dict(zip(names, values[1:], strict=True))
            for name, column in columns.items():
                value = row.get(name)
                column.append(float("nan") if value is None else value)
    return columns, steps, damaged


def _history(columns: Mapping[str, list[float]], steps: list[float]) -> dict[str, Channel]:
    keep, _ = keep_last(steps, "iteration")
    channels = {"Iteration": Channel(np.array(steps)[keep])}
    for name, column in columns.items():
        values = np.array(column)[keep]
        last = float(values[-1]) if np.isfinite(values[-1]) else None
        channels[name] = Channel(values, "", None if last is None else Mean(last, "last iteration"))
    return channels


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a transcript."""
    source = load_text(path)
    notes: list[str] = []
    channels: dict[str, Channel] = {}
    columns, steps, damaged = _residuals(source)
    if steps:
        channels |= _history(columns, steps)
    if damaged:
        notes.append(f"{damaged} damaged rows of residuals left out")
    flow = [(number(m[1]), float(m[2])) for line in source.lines if (m := _FLOW.fullmatch(line))]
    times = [(t, s) for t, s in flow if t is not None]
    if times:
        keep, dropped = keep_last([t for t, _ in times], "time_s")
        notes += dropped
        channels["time_s"] = Channel(np.array([t for t, _ in times])[keep], "s")
        channels["Time Step"] = Channel(np.array([s for _, s in times])[keep])
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    for name, unit, value in _computed(source, notes):
        found[name, unit].append(value)
    for line, entries, more, faults in blocks(source):
        notes += more
        notes += [f"line {f.where}: force report of line {line}: got {f.got}; left out" for f in faults]
        for entry in entries:
            found[f"{entry.name}({entry.zone})", entry.unit].append(entry.value)
    for (name, unit), values in found.items():
        times_text = "" if len(values) == 1 else f", last of {len(values)}"
        channels[name] = Channel(np.array(values), unit, Mean(values[-1], f"one computed value{times_text}"))
        if max(values) != min(values):
            notes.append(f"{name}: computed {len(values)} times with different values; the last one holds")
    if not channels:
        source.refuse("", "no residuals, flow times or computed values", "a Fluent transcript")
    notes += _remarks(source)
    about = {**source.about, "clock": "none"}
    version = re.search(r"Welcome to (ANSYS Fluent[^\r\n]*)", source.text)
    cells = re.findall(r"^\s*(\d+)\s+(?:\w+ )?cells,", source.text, re.MULTILINE)
    if version:
        about["solver"] = version[1].strip()
    if cells:
        about["cells"] = cells[0]
    return dataset(KIND, "cfd", channels, notes, about)


def _remarks(source: SourceText) -> list[str]:
    """What the solver complained of, and averages that were asked for."""
    low = source.text.lower()
    notes = [f"{text} ({low.count(mark)} times)" for mark, text in _LOUD if mark in low]
    wide = [m for m in _AVERAGE.findall(source.text) if m.strip("0") not in ("", "1")]
    if wide:
        text = ", ".join(dict.fromkeys(wide))
        notes.append(f"average-over {text} was set: from then on its report file holds running averages")
    return notes

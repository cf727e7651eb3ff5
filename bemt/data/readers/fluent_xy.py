r"""Fluent XY plots: ``(title ...)``, ``(labels "x" "y")``, then one list of pairs for each zone.

::

    (title "Axial Velocity")
    (labels "Position" "Axial Velocity")

    ((xy/key/label "inlet")
    0	0.2
    )
"""

from __future__ import annotations

import os
import re
from dataclasses import replace

from bemt.data.readers import SourceText, load_text
from bemt.data.readers.cfd import Column, ExportRow, head_lines, history, numeric_table, unique
from bemt.data.readers.columns import Channel, channels_of, dataset
from bemt.data.readers.histories import column_of
from bemt.physics.dataset import Dataset

KIND = "fluent_xy"

_LABELS = re.compile(r'\(labels\s+"([^"]*)"\s+"([^"]*)"\s*\)')
_ZONE = re.compile(r'\(\(xy/key/label\s+("[^"]*"|[^\s"()]+)\s*\)(?:\s*\((?:xy/key/visible\?|[\w/?-]+)[^)]*\))*')
_UNIT = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the file begins with a title and labels in parentheses.

    >>> sniff('(title "a")\n(labels "x" "y")\n'), sniff('("Iteration" "drag")')
    (True, False)
    """
    lines = head_lines(head, 6)
    return any(line.startswith("(labels ") for line in lines) and lines[0].startswith(("(title", "(labels"))


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read an XY plot."""
    source = load_text(path)
    title = ""
    labels: list[str] = []
    zones: list[tuple[str, list[ExportRow]]] = []
    closed = True
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        match = _LABELS.fullmatch(text)
        zone = _ZONE.fullmatch(text)
        if not text:
            continue
        if match:
            labels = [match[1].strip() or "x", match[2].strip() or "y"]
        elif text.startswith("(title"):
            title = text[6:].strip().strip(')"').strip()
        elif zone:
            zones.append((zone[1].strip('"'), []))
            closed = False
        elif text == ")":
            closed = True
        elif closed:
            expected = '(labels "x" "y") and lists that begin with ((xy/key/label "zone")'
            source.refuse(line, repr(text[:60]), expected, "Is the file damaged?")
        else:
            zones[-1][1].append(ExportRow(line, tuple(text.split())))
    if not labels or not zones:
        got = "no (labels ...)" if not labels else "no list of points"
        source.refuse("", got, 'labels and a list ((xy/key/label "zone") ... )')
    return _record(source, title, labels, zones, closed)


def _column(label: str) -> Column:
    """Column of an axis label; a label may end in its unit."""
    match = _UNIT.search(label)
    name = label[: match.start()].strip() if match else label
    column = column_of(name or label)
    if column.role == "time" and match and match[1] not in ("s", "sec", "seconds", ""):  # no clock in seconds
        return Column(label, match[1])
    return column if column.role != "value" else replace(column, name=label)


def _record(
    source: SourceText, title: str, labels: list[str], zones: list[tuple[str, list[ExportRow]]], closed: bool
) -> Dataset:
    columns = [_column(label) for label in labels]
    counts = columns[0].role in ("step", "time")
    channels: dict[str, Channel] = {}
    notes: list[str] = [] if closed else ["the last list is not closed: the file may be cut"]
    names = unique([zone for zone, _ in zones])
    clocks: list[str] = []
    for name, (_, data) in zip(names, zones, strict=True):
        if not data:
            notes.append(f"{name}: no points")
            continue
        table = numeric_table(source, columns, data)
        record = history(KIND, source, columns, table)
        keys = unique([c.name for c in columns])
        for k, (key, channel) in enumerate(zip(keys, channels_of(record).values(), strict=True)):
            if counts:
                channels[f"{key}({name})"] = channel
                if k == 0:
                    clocks.append(f"{key}({name})")
            else:
                channels[f"{key}({name})"] = Channel(table.values[:, k], columns[k].unit)
        notes += [f"{name}: {text}" for text in (record.notes if counts else table.warnings)]
    if not channels:
        source.refuse("", "no points", "one pair of numbers or more")
    if not counts:
        notes.append("a curve over a position or frequency: no mean is taken")
    about = {**source.about, "title": title, "clock": "none"}
    if counts:
        about |= {"clock": "time" if columns[0].role == "time" else "iteration", "clock_channels": "\t".join(clocks)}
        if columns[0].role == "time" and len(clocks) == 1:
            about["time_channel"] = clocks[0]
    return dataset(KIND, "cfd", channels, notes, about)

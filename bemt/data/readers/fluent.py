r"""Text of Fluent's console: force reports and transcripts.

Forces, moments and centres of pressure by zone::

    Forces - Direction Vector (1 0 0)
                      Forces (n)                        Coefficients
    Zone              Pressure   Viscous    Total       Pressure   Viscous    Total
    blade             -12.6      -7.7e-05   -12.6       -0.0142    -8.7e-08   -0.0142
    ----------------- ---------- ---------- ---------- ...
    Net               -253.2     -159.3     -412.5      -0.28      -0.18      -0.46

Cells are numbers, or vectors in parentheses when no direction is given. Every zone is a channel of its own
(``force_total_x_N(blade)``), Net too: which zones count is the user's choice. Numbers along a direction carry it in
their name (``force_total_N along (1 0 0) (blade)``).
"""

from __future__ import annotations

import os
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.averaging import Mean, keep_last
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of
from bemt.data.readers import Reader, SourceText, load_text, number
from bemt.data.readers.cfd import head_lines, si_unit, slug, unique
from bemt.data.readers.samples import Channel, dataset
from bemt.physics.dataset import Dataset

FLUENT_FORCES = "fluent_forces"

_TITLE = re.compile(r"(Forces|Moments|Center of Pressure)\b(?!\s*[\[(])(.*)")
_CELL = re.compile(r"\([^()]*\)|\S+")
_GROUP = re.compile(r"(\S(?:.*?\S)?)\s*(?:[\[(]([^\])]*)[\])])?\s*$")
_BASE = {"forces": "force", "moments": "moment", "coefficients": "coefficient"}
_SI = {"force": "N", "moment": "Nm"}


@dataclass(frozen=True)
class ForceEntry:
    """One number of a force report: name without its zone, unit, zone, value."""

    name: str
    unit: str
    zone: str
    value: float


def sniff_fluent_forces(head: bytes | str) -> bool:
    r"""Tell whether a title of forces is followed by a line of zones, and this is no transcript.

    >>> sniff_fluent_forces("Forces\n      Forces (n)\nZone  Pressure  Viscous  Total\n")
    True
    >>> sniff_fluent_forces("Zone,Pressure")
    False
    """
    lines = head_lines(head, 60)
    titles = [k for k, line in enumerate(lines) if _TITLE.fullmatch(line)]
    first = bool(lines) and (lines[0] == '"Force Report"' or (bool(titles) and titles[0] == 0))
    return first and any(line.startswith("Zone ") for k in titles for line in lines[k + 1 : k + 3])


def _vector(cell: str) -> list[float] | None:
    inner = cell.strip("()").split() if cell.startswith("(") else [cell]
    values = [number(part) for part in inner]
    return None if None in values or not values else [v for v in values if v is not None]


def _names(title: str, rest: str, groups_line: str, zone_line: str) -> list[tuple[str, str]] | str:
    """Name and unit of each column, or what is wrong with the header."""
    columns = zone_line.split()[1:]
    if title == "Center of Pressure":
        unit = re.search(r"\(([^()]*)\)\s*$", rest)
        si = si_unit(unit[1]) if unit else None
        suffix = f"_{si}" if si else ""
        return [(f"center_of_pressure_{c}{suffix}", si or (unit[1] if unit else "")) for c in columns]
    groups = [m for part in re.split(r"\s{3,}", groups_line.strip()) if (m := _GROUP.fullmatch(part))]
    if not columns or not groups or len(columns) % len(groups):
        return f"{number_of(len(columns), 'column')} under {len(groups)} groups"
    each = len(columns) // len(groups)
    if any(columns[k * each : (k + 1) * each] != columns[:each] for k in range(len(groups))):
        return f"groups of unlike columns ({' '.join(columns)})"
    along = re.search(r"(?:Direction Vector|Moment Axis)\s*(\([^()]*\))", rest)
    out: list[tuple[str, str]] = []
    for k, column in enumerate(columns):
        group = groups[k // each]
        word = group[1].split()[0].lower()
        base = _BASE.get(word, slug(group[1]))
        if base == "coefficient":
            base = "moment_coefficient" if title == "Moments" else "force_coefficient"
        si = si_unit(group[2]) if group[2] else None
        if si is not None and _SI.get(base, si) != si:
            si = None
        tail = f" along {along[1]} " if along else ""
        out.append((f"{base}_{column.lower()}" + (f"_{si}" if si else "") + tail, si or group[2] or ""))
    return out


def blocks(source: SourceText) -> Iterator[tuple[int, list[ForceEntry], list[str], list[Fault]]]:
    """Find the force tables of a text."""
    lines = source.lines
    k = 0
    while k < len(lines):
        match = _TITLE.fullmatch(lines[k].strip())
        ahead = [i for i in range(k + 1, min(k + 3, len(lines))) if lines[i].startswith("Zone ")]
        if not match or not ahead:
            k += 1
            continue
        names = _names(match[1], match[2], lines[ahead[0] - 1] if ahead[0] - 1 > k else "", lines[ahead[0]])
        if isinstance(names, str):
            yield k + 1, [], [], [source.fault(ahead[0] + 1, names, "a header of a force report")]
            k = ahead[0] + 1
            continue
        start, k = k, ahead[0] + 1
        entries: list[ForceEntry] = []
        notes: list[str] = []
        faults: list[Fault] = []
        shape: set[int] = set()
        while k < len(lines) and lines[k].strip() and not lines[k].startswith("("):
            if not re.fullmatch(r"[-\s]+", lines[k]):
                cells = _CELL.findall(lines[k])
                vectors = [_vector(cell) for cell in cells[1:]]
                sizes = {len(v) for v in vectors if v is not None}
                cut = k == len(lines) - 1 and not source.text.endswith(("\n", "\r")) and lines[k][-1] not in " )"
                # along a direction there are no vectors
                right = ({1},) if " along " in names[0][0] else ({1}, {2}, {3})
                shape = shape or (sizes if sizes in right else set())
                if len(vectors) != len(names) or None in vectors or sizes not in right or sizes != shape or cut:
                    got = f"{number_of(len(vectors), 'column')}, or text among them" + (
                        " (no line end: cut?)" if cut else ""
                    )
                    faults.append(source.fault(k + 1, got, f"a zone and {len(names)} numbers or vectors"))
                else:
                    entries += _entries(cells[0], names, [v for v in vectors if v is not None])
            k += 1
        notes += _sums(entries, bool(faults), start + 1)
        yield start + 1, entries, notes, faults


def _entries(zone: str, names: Sequence[tuple[str, str]], vectors: Sequence[list[float]]) -> Iterator[ForceEntry]:
    for (name, unit), vector in zip(names, vectors, strict=True):
        for axis, value in zip("xyz" if len(vector) > 1 else ("",), vector, strict=False):
            head, along, tail = name.partition(" along ")
            suffix = f"_{unit}" if unit and head.endswith(f"_{unit}") else ""
            stem = head.removesuffix(suffix) if suffix else head
            yield ForceEntry(stem + (f"_{axis}" if axis else "") + suffix + along + tail, unit, zone, value)


def _sums(entries: Sequence[ForceEntry], damaged: bool, line: int) -> list[str]:
    """Check Net against the zones and Total against its parts: a shifted or damaged column shows here."""
    notes: list[str] = []
    table = {(e.name, e.zone): e.value for e in entries}
    if len(table) < len(entries):
        count = Counter((e.name, e.zone) for e in entries)
        repeated = {zone for (_, zone), n in count.items() if n > 1}
        return [f"line {line}: zone {', '.join(sorted(repeated))} is repeated; sums not checked"]
    zones = list(dict.fromkeys(e.zone for e in entries))
    names = list(dict.fromkeys(e.name for e in entries))
    for name in names:
        if name.startswith("center_of_pressure") or damaged:
            continue
        parts = [table[name, zone] for zone in zones if zone != "Net" and (name, zone) in table]
        net = table.get((name, "Net"))
        if net is not None and parts and abs(net - sum(parts)) > 1e-4 * max(1e-300, sum(map(abs, parts))):
            notes.append(f"line {line}: {name}: Net is {net:.6g}, its zones add up to {sum(parts):.6g}")
    for name in (n for n in names if "_total" in n):
        for zone in zones:
            found = [table.get((name.replace("_total", f"_{part}"), zone)) for part in ("pressure", "viscous")]
            values = [v for v in found if v is not None]
            total = table.get((name, zone))
            if total is None or len(values) < 2:
                continue
            if abs(total - sum(values)) > 1e-4 * max(1e-300, sum(map(abs, values))):
                notes.append(f"line {line}: {name}({zone}) is {total:.6g}, its parts add up to {sum(values):.6g}")
    return notes


def _channels(entries: Sequence[ForceEntry]) -> dict[str, Channel]:
    """Make one channel of each number, its mean being the number."""
    names = unique([f"{e.name}({e.zone})" for e in entries])
    return {
        name: Channel(np.array([e.value]), e.unit, Mean(e.value, "one value of a report"))
        for name, e in zip(names, entries, strict=True)
    }


def read_fluent_forces(path: str | os.PathLike[str]) -> Dataset:
    """Read a force report."""
    source = load_text(path)
    entries: list[ForceEntry] = []
    notes: list[str] = []
    faults: list[Fault] = []
    zones: set[tuple[int, str]] = set()
    for line, found, more, bad in blocks(source):
        entries += found
        notes += more
        faults += bad
        zones |= {(line, entry.zone) for entry in found}
    if not entries or len(faults) > max(1, 0.1 * len(zones)):
        raise InputError(faults[:6] or [source.fault("", "no table of zones", "a Fluent force report")])
    notes += [f"line {f.where}: got {f.got}; row left out" for f in faults]
    notes.append("choose the zones that count: Net holds all that were selected in the report")
    titles = [text.strip() for text in source.lines if _TITLE.fullmatch(text.strip())]
    about = {**source.about, "tables": "; ".join(titles), "clock": "none"}
    return dataset(FLUENT_FORCES, "cfd", _channels(entries), notes, about)


# Fluent transcripts (``*.trn``) and copied console text: residuals, flow time, computed reports, force reports.
#
# ::
#
#       iter  continuity  x-velocity           k     time/iter
#      11795  1.8226e-04  1.1633e-05  1.1935e-04  0:01:28   15
#     Flow time = 4.417132770176977s, time step = 2371
#                               Moment               [N m]
#     -------------------------------- -------------------
#                             tornillo         -0.18741116
#
# A transcript tells what somebody computed at some moment: each such number is a channel by quantity and zone, the last
# computation standing for it. Its channels differ in length (residuals by iterations, flow time by steps).

FLUENT_TRANSCRIPT = "fluent_transcript"

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


def sniff_fluent_transcript(head: bytes | str) -> bool:
    r"""Tell whether a text shows marks of a Fluent console.

    >>> sniff_fluent_transcript("  iter  continuity  x-velocity  time/iter\n 1 1.0 1.0 0:00:01 9")
    True
    >>> sniff_fluent_transcript("iteration,continuity")
    False
    >>> sniff_fluent_transcript("  Moment   [N m]\n------------ ----------\n  blade   -0.18\n")
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


def read_fluent_transcript(path: str | os.PathLike[str]) -> Dataset:
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
    return dataset(FLUENT_TRANSCRIPT, "cfd", channels, notes, about)


def _remarks(source: SourceText) -> list[str]:
    """What the solver complained of, and averages that were asked for."""
    low = source.text.lower()
    notes = [f"{text} ({low.count(mark)} times)" for mark, text in _LOUD if mark in low]
    wide = [m for m in _AVERAGE.findall(source.text) if m.strip("0") not in ("", "1")]
    if wide:
        text = ", ".join(dict.fromkeys(wide))
        notes.append(f"average-over {text} was set: from then on its report file holds running averages")
    return notes


READERS = (
    Reader(FLUENT_FORCES, sniff_fluent_forces, read_fluent_forces),
    Reader(FLUENT_TRANSCRIPT, sniff_fluent_transcript, read_fluent_transcript),
)

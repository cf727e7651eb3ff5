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
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from typing import NamedTuple

import numpy as np

from bemt.base.averaging import Mean
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of
from bemt.data.readers import Reader, SourceText, load_text, number
from bemt.data.readers.cfd import Column, head_lines, made_of, si_unit, slug
from bemt.data.readers.marks import EXPORT
from bemt.data.readers.samples import Channel, dataset
from bemt.physics.dataset import Dataset

FLUENT_FORCES = "fluent_forces"

_TITLE = re.compile(r"(Forces|Moments|Center of Pressure)\b(?!\s*[\[(])(.*)")
_RULES = re.compile(r"[-\s]+")
_CELL = re.compile(r"\([^()]*\)|\S+")
_GROUP = re.compile(r"(\S(?:.*?\S)?)\s*(?:[\[(]([^\])]*)[\])])?\s*$")
_BASE = {"forces": "force", "moments": "moment", "coefficients": "coefficient"}
_SI = {"force": "N", "moment": "Nm"}


class ForceEntry(NamedTuple):
    """One number of a force report: name without its zone, unit, zone, value."""

    name: str
    unit: str
    zone: str
    value: float


class _Named(NamedTuple):
    """A column: an axis stands between `stem` and `end`, which is the unit in SI and the direction."""

    stem: str
    end: str
    unit: str


def sniff_fluent_forces(head: bytes | str) -> bool:
    r"""Tell whether a title of forces is followed by a line of zones, and this is no transcript.

    >>> [sniff_fluent_forces(t) for t in ("Forces\n  Forces (n)\nZone  Pressure  Viscous  Total\n", "Zone,Pressure")]
    [True, False]
    """
    lines = head_lines(head, 60)
    titles = [k for k, line in enumerate(lines) if _TITLE.fullmatch(line)]
    first = bool(lines) and (lines[0] == '"Force Report"' or (bool(titles) and titles[0] == 0))
    return first and any(line.startswith("Zone ") for k in titles for line in lines[k + 1 : k + 3])


def _vector(cell: str) -> list[float]:
    """Numbers of a cell; none if one of its parts is no number."""
    values = [number(part) for part in (cell.strip("()").split() if cell.startswith("(") else [cell])]
    return [] if None in values else [v for v in values if v is not None]


def _names(title: str, rest: str, groups_line: str, zone_line: str) -> list[_Named] | str:
    """Names and units of the columns, or what is wrong with the header."""
    columns = zone_line.split()[1:]
    if title == "Center of Pressure":
        stated = (re.findall(r"\(([^()]*)\)\s*$", rest) or [""])[0]
        si = si_unit(stated)
        return [_Named(f"center_of_pressure_{c}", f"_{si}" if si else "", si or stated) for c in columns]
    groups = [(m[1], m[2] or "") for m in map(_GROUP.fullmatch, re.split(r"\s{3,}", groups_line.strip())) if m]
    if not columns or not groups or len(columns) % len(groups):
        return f"{number_of(len(columns), 'column')} under {len(groups)} groups"
    each = len(columns) // len(groups)
    if columns != columns[:each] * len(groups):
        return f"groups of unlike columns ({' '.join(columns)})"
    along = re.search(r"(?:Direction Vector|Moment Axis)\s*(\([^()]*\))", rest)
    tail, coefficient = f" along {along[1]} " if along else "", f"{_BASE.get(title.lower(), 'force')}_coefficient"
    out = []
    for words, unit in groups:
        base = _BASE.get(words.split()[0].lower(), slug(words))
        si = si_unit(unit)
        end = f"_{si}" if si and _SI.get(base, si) == si else ""
        base = coefficient if base == "coefficient" else base
        out += [_Named(f"{base}_{c.lower()}", end + tail, end[1:] or unit) for c in columns[:each]]
    return out


def blocks(source: SourceText) -> Iterator[tuple[int, list[ForceEntry], list[str], list[Fault]]]:
    """Find the force tables of a text."""
    lines, end = source.lines, 0
    for k, text in enumerate(lines):
        match = _TITLE.fullmatch(text.strip())
        top = next((i for i in range(k + 1, min(k + 3, len(lines))) if lines[i].startswith("Zone ")), 0)
        if k < end or not match or not top:
            continue
        names = _names(match[1], match[2], lines[k + 1] if top > k + 1 else "", lines[top])
        if isinstance(names, str):
            yield k + 1, [], [], [source.fault(top + 1, names, "a header of a force report")]
            end = top + 1
            continue
        end = next((i for i in range(top + 1, len(lines)) if not lines[i].strip() or lines[i][0] == "("), len(lines))
        entries, faults = _rows(source, names, [i for i in range(top + 1, end) if not _RULES.fullmatch(lines[i])])
        yield k + 1, entries, _sums(entries, bool(faults), k + 1), faults


def _rows(source: SourceText, names: Sequence[_Named], at: Iterable[int]) -> tuple[list[ForceEntry], list[Fault]]:
    """Numbers of the lines of a table, all of them single ones or vectors of one size; along a direction no vectors."""
    entries: list[ForceEntry] = []
    faults: list[Fault] = []
    right, shape = ({1},) if " along " in names[0].end else ({1}, {2}, {3}), set[int]()
    for k in at:
        text = source.lines[k]
        zone, *cells = _CELL.findall(text)
        vectors = [_vector(cell) for cell in cells]
        sizes = {len(v) for v in vectors if v}
        cut = source.may_be_cut(k + 1) and text[-1] not in " )"
        shape = shape or (sizes if sizes in right else set())
        if len(vectors) != len(names) or [] in vectors or sizes not in right or sizes != shape or cut:
            got = f"{number_of(len(vectors), 'column')}, or text among them" + (" (no line end: cut?)" if cut else "")
            faults.append(source.fault(k + 1, got, f"a zone and {len(names)} numbers or vectors"))
            continue
        axes = [f"_{a}" for a in "xyz"] if sizes != {1} else [""]
        entries += [ForceEntry(n.stem + axis + n.end, n.unit, zone, value) for n, vector in
                    zip(names, vectors, strict=True) for axis, value in zip(axes, vector, strict=False)]  # fmt: skip
    return entries, faults


def _sums(entries: Sequence[ForceEntry], damaged: bool, line: int) -> list[str]:
    """Check Net against the zones and Total against its parts: a shifted or damaged column shows here."""
    count = Counter((e.name, e.zone) for e in entries)
    if repeated := {zone for (_, zone), n in count.items() if n > 1}:
        return [f"line {line}: zone {', '.join(sorted(repeated))} is repeated; sums not checked"]
    table: dict[str, dict[str, float]] = defaultdict(dict)
    for e in entries:
        table[e.name][e.zone] = e.value
    notes: list[str] = []
    for name, own in [] if damaged else table.items():
        if "Net" in own and not name.startswith("center_of_pressure"):
            notes += _off(line, f"{name}: Net", own["Net"], "zones", [v for zone, v in own.items() if zone != "Net"])
    for name in [name for name in table if "_total" in name]:
        pressure, viscous = (table.get(name.replace("_total", f"_{part}"), {}) for part in ("pressure", "viscous"))
        for zone in [zone for zone in table[name] if zone in pressure and zone in viscous]:
            notes += _off(line, f"{name}({zone})", table[name][zone], "parts", [pressure[zone], viscous[zone]])
    return notes


_SHORT = 20.0  # Of the rounding of a number: below, it has two digits or fewer


def _off(line: int, what: str, whole: float, of: str, parts: Sequence[float]) -> list[str]:
    """Note on a sum that is not that of its parts."""
    rounded = 0.5 * sum(10.0 ** int(Decimal(repr(v)).as_tuple().exponent) for v in (whole, *parts))  # as printed
    limit = max(1e-4 * sum(map(abs, parts)), rounded if abs(whole) < _SHORT * rounded else 0.0, 1e-300)
    if not parts or abs(whole - sum(parts)) <= limit:
        return []
    return [f"line {line}: {what} is {whole:.6g}, its {of} add up to {sum(parts):.6g}"]


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
    columns = [Column(f"{e.name}({e.zone})", e.unit) for e in entries]
    channels = made_of(columns, (np.array([e.value]) for e in entries), "one value of a report")
    return dataset(FLUENT_FORCES, "cfd", channels, notes, about)


# Fluent transcripts (``*.trn``) and copied console text: computed reports, force reports.
#
# ::
#
#                               Moment               [N m]
#     -------------------------------- -------------------
#                             tornillo         -0.18741116
#
# A transcript tells what somebody computed at some moment: each such number is a channel by quantity and zone, the last
# computation standing for it. Residuals and flow times between them say nothing of a load.

FLUENT_TRANSCRIPT = "fluent_transcript"

_RULE = re.compile(r"\s*-{8,}\s+-{8,}\s*")
_HEAD = re.compile(r"\s*(\S.*?)\s+[\[(]([^\[\]()]*)[\])]\s*")
_MARKS = re.compile(r"Auto-Transcript|Welcome to ANSYS Fluent|ANSYS FLUENT|ansys fluent|iter\s+continuity\b")
_LOUD = (
    ("divergence detected", "divergence was detected"),
    ("floating point exception", "a floating point exception"),
    ("turbulent viscosity limited", "turbulent viscosity was limited"),
    ("reversed flow", "reversed flow at an outlet"),
)
_ABOUT = {
    "solver": re.compile(r"Welcome to (ANSYS Fluent[^\r\n]*)"),
    "cells": re.compile(r"^\s*(\d+)\s+(?:\w+ )?cells,", re.MULTILINE),
}
_AVERAGE = re.compile(r"\(Average Over\)\"?\s+(\d+)")


def sniff_fluent_transcript(head: bytes | str) -> bool:
    r"""Tell whether a text shows marks of a Fluent console.

    >>> told = "  iter  continuity  time/iter\n 1 1.0 0:0:1 9", "  Moment   [N m]\n-------- --------\n  blade   -0.18\n"
    >>> [sniff_fluent_transcript(text) for text in (*told, "iteration,continuity")]
    [True, True, False]
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
            if _RULES.fullmatch(text):
                continue
            cells = text.rsplit(None, 1)
            value = number(cells[1]) if len(cells) == 2 else None
            last = source.may_be_cut(at + 1)
            if value is None or len(cells[0].split()) != 1 or last:
                why = "no line end, may be cut" if last else repr(text.strip()[:40])
                notes.append(f"line {at + 1}: computed {head[1]}: {why}; left out")
                break
            yield f"{name}({cells[0].strip()})", si or head[2].strip(), value


def read_fluent_transcript(path: str | os.PathLike[str]) -> Dataset:
    """Read a transcript."""
    source, channels, notes = load_text(path), dict[str, Channel](), list[str]()
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    for name, unit, value in _computed(source, notes):
        found[name, unit].append(value)
    for line, entries, more, faults in blocks(source):
        notes += [*more, *(f"line {f.where}: force report of line {line}: got {f.got}; left out" for f in faults)]
        for entry in entries:
            found[f"{entry.name}({entry.zone})", entry.unit].append(entry.value)
    for (name, unit), values in found.items():
        times_text = "" if len(values) == 1 else f", last of {len(values)}"
        channels[name] = Channel(np.array(values), unit, Mean(values[-1], f"one computed value{times_text}"))
        if max(values) != min(values):
            notes.append(f"{name}: computed {len(values)} times with different values; the last one holds")
    if not channels:
        source.refuse("", "no computed values", "a Fluent transcript with a report of forces or moments", EXPORT)
    told = {key: m[1].strip() for key, mark in _ABOUT.items() if (m := mark.search(source.text))}
    return dataset(FLUENT_TRANSCRIPT, "cfd", channels, [*notes, *_remarks(source)],
                   {**source.about, "clock": "none", **told})  # fmt: skip


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

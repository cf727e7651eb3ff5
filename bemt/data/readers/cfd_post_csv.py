r"""CSV of CFD-Post: blocks of ``[Name]`` and ``[Data]``, units in the headings; or expressions with their values.

::

    [Name]
    Blade

    [Data]
    X [ m ], Y [ m ], Z [ m ], Wall Shear [ Pa ]
    7.69e-02, 5.98e-02, 8.56e-02, 3.79

A table of expressions (of CFD-Post and CFX) has one on each line, under a heading or none::

    Expression, Value
    Thrust, 2.61 [kg m s^-2]
"""

from __future__ import annotations

import os
import re
from collections import Counter
from dataclasses import replace

import numpy as np

from bemt.base.averaging import Mean
from bemt.data.readers import SourceText, load_text, number
from bemt.data.readers.cfd import (
    Column,
    ExportRow,
    cells_of,
    fields,
    head_lines,
    history,
    no_units,
    numeric_table,
    si_unit,
    slug,
    unique,
)
from bemt.data.readers.columns import Channel, channels_of, dataset
from bemt.data.readers.headings import may_be_shaft_speed
from bemt.physics.dataset import Dataset

KIND = "cfd_post_csv"

_SECTION = re.compile(r"\[(\w[\w ]*)\]")
_HEADING = re.compile(r"(.*?)\s*\[([^\]]*)\]\s*")
_EXPRESSION = re.compile(
    r'\s*"?([A-Za-z][^",;\t=]*?)"?\s*[,;\t=]\s*"?\s*([-+\d.][\d.eE+-]*)\s*\[([^\]]*)\]\s*"?[,;\s]*'
)
_VALUES = re.compile(r'\s*"?[\w ]+"?\s*[,;\t=]\s*"?values?"?[,;\s]*', re.IGNORECASE)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the file begins with the section Name or Data, or with an expression and its value.

    >>> sniff("[Name]\nBlade\n\n[Data]\nX [ m ], Y [ m ]"), sniff("[propeller]\nname = 1")
    (True, False)
    >>> sniff("Expression, Value\nThrust, 2.61 [kg m s^-2]\n"), sniff("rpm,thrust [N]\n6000,2.61\n")
    (True, False)
    """
    lines = [line for line in head_lines(head) if not line.startswith("#")]
    return bool(lines) and (lines[0].rstrip(",;") in ("[Name]", "[Data]") or _lists_expressions(lines[:2]))


def _lists_expressions(lines: list[str]) -> bool:
    """Whether lines begin as a table of expressions."""
    body = lines[1:] if _VALUES.fullmatch(lines[0]) else lines[:1]
    return any(_EXPRESSION.fullmatch(line) for line in body)


def _heading(text: str) -> Column:
    """Column of a heading: unit in the name when it is SI, else the heading as it stands."""
    match = _HEADING.fullmatch(text)
    if not match:
        return Column(text or "unnamed")
    unit = si_unit(match[2])
    if unit is None:
        return Column(text if match[2].strip() else slug(match[1]), match[2].strip())
    role = "time" if unit == "s" and slug(match[1]) in ("time", "flow_time", "physical_time") else "value"
    if unit == "rpm" and may_be_shaft_speed(match[1]):
        return Column("rpm", unit)
    return Column(f"{slug(match[1])}_{unit}", unit, role)


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a CSV of CFD-Post."""
    source = load_text(path)
    lines = [(k, text.strip()) for k, text in enumerate(source.lines, 1) if text.strip()]
    lines = [(k, text) for k, text in lines if not text.startswith("#")]
    if lines and _lists_expressions([text for _, text in lines[:2]]):
        return _expressions(source, lines)
    data: list[tuple[str, list[ExportRow]]] = []
    section, name = "", ""
    skipped: set[str] = set()
    mark = ","
    for line, text in lines:
        match = _SECTION.fullmatch(text.rstrip(",;"))
        if match and match[1] in ("Name", "Data", "Lines", "Faces", "Spatial Fields", "Parameters"):
            section = match[1]
            if section == "Data":
                data.append((name or "data", []))
        elif section == "Name":
            name = text.rstrip(",;")
        elif section == "Data":
            if not data[-1][1]:
                mark = ";" if ";" in text else "\t" if "\t" in text and "," not in text else ","
            data[-1][1].append(ExportRow(line, cells_of(text, mark)))
        elif section:
            skipped.add(section)
        else:
            source.refuse(line, repr(text[:60]), "[Name] or [Data]", "Is the head cut?")
    if not any(rows for _, rows in data):
        source.refuse("", "no data", "a section [Data] with headings and rows")
    notes = [f"section {', '.join(sorted(skipped))} not read"] if skipped else []
    records = [(block, _block(source, rows, mark != ",")) for block, rows in data if rows]
    if len(records) == 1:
        block, record = records[0]
        return replace(record, provenance={**record.provenance, "name": block}, notes=(*notes, *record.notes))
    channels: dict[str, Channel] = {}
    often = Counter(block for block, _ in records)
    for k, (block, record) in enumerate(records):
        label = block if often[block] == 1 else f"{block} {k + 1}"
        channels |= {f"{key}({label})": channel for key, channel in channels_of(record).items()}
        notes += [f"{label}: {text}" for text in record.notes]
    return dataset(KIND, "cfd", channels, notes, {**source.about, "clock": "none"})


def _expressions(source: SourceText, lines: list[tuple[int, str]]) -> Dataset:
    """Values of expressions, one a line."""
    found: list[tuple[Column, float]] = []
    for line, text in lines[1:] if _VALUES.fullmatch(lines[0][1]) else lines:
        match = _EXPRESSION.fullmatch(text)
        value = number(match[2]) if match else None
        if match is None or value is None:
            source.add(line, repr(text[:60]), "an expression, its value and unit, such as Thrust, 2.61 [N]")
        else:
            unit = si_unit(match[3]) or match[3].strip()
            found.append((_heading(f"{match[1]} [{match[3]}]") if unit else Column(match[1]), value))
    source.check()
    columns = [column for column, _ in found]
    channels = {
        name: Channel(np.array([value]), column.unit, Mean(value, "one value of an expression"))
        for name, (column, value) in zip(unique([c.name for c in columns]), found, strict=True)
    }
    return dataset(KIND, "cfd", channels, no_units(columns), {**source.about, "clock": "none"})


def _block(source: SourceText, rows: list[ExportRow], commas: bool) -> Dataset:
    columns = [_heading(cell) for cell in rows[0].cells]
    if all(re.fullmatch(r"[-+.\deE]+", cell) for cell in rows[0].cells):
        got = f"numbers ({', '.join(rows[0].cells[:4])})"
        source.refuse(rows[0].line, got, "headings such as X [ m ]", "Is the head cut?")
    body = [row for row in rows[1:] if row.cells != rows[0].cells]
    table = numeric_table(source, columns, body, commas=commas)
    notes = [f"headings repeated {len(rows) - 1 - len(body)} times"] if len(body) < len(rows) - 1 else []
    build = history if columns[0].role == "time" else fields
    return build(KIND, source, columns, table, [*notes, *no_units(columns)])

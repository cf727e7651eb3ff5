r"""Tables that ANSYS exports: CSV of CFD-Post, design points of Workbench.

CFD-Post writes blocks of ``[Name]`` and ``[Data]``, units in the headings; or expressions with their values.

::

    [Name]
    Thrust

    [Data]
    Time [ s ], Thrust [ N ]
    1.25e-02, 3.79

A table of expressions (of CFD-Post and CFX) has one on each line, under a heading or none::

    Expression, Value
    Thrust, 2.61 [kg m s^-2]
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import Reader, SourceText, load_text, number
from bemt.data.readers.cfd import (
    Column,
    ExportRow,
    cells_of,
    head_lines,
    history,
    made_of,
    no_units,
    numeric_table,
    si_unit,
    slug,
)
from bemt.data.readers.headings import may_be_shaft_speed
from bemt.data.readers.samples import Channel, channels_of, dataset
from bemt.physics.dataset import Dataset

CFD_POST_CSV = "cfd_post_csv"

_SECTION = re.compile(r"\[(\w[\w ]*)\]")
_HEADING = re.compile(r"(.*?)\s*\[([^\]]*)\]\s*")
_EXPRESSION = re.compile(
    r'\s*"?([A-Za-z][^",;\t=]*?)"?\s*[,;\t=]\s*"?\s*([-+\d.][\d.eE+-]*)\s*\[([^\]]*)\]\s*"?[,;\s]*'
)
_VALUES = re.compile(r'\s*"?[\w ]+"?\s*[,;\t=]\s*"?values?"?[,;\s]*', re.IGNORECASE)


def sniff_cfd_post_csv(head: bytes | str) -> bool:
    r"""Tell whether the file begins with the section Name or Data, or with an expression and its value.

    >>> sniff_cfd_post_csv("[Name]\nBlade\n\n[Data]\nX [ m ], Y [ m ]"), sniff_cfd_post_csv("[propeller]\nname = 1")
    (True, False)
    >>> [sniff_cfd_post_csv(t) for t in ("Expression, Value\nThrust, 2.6 [kg m s^-2]\n", "rpm,thrust [N]\n6,2.6\n")]
    [True, False]
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
    unit, stated = si_unit(match[2]), match[2].strip(" -")
    if unit is None:
        return Column(text if stated else match[1], stated)
    role = "time" if unit == "s" and slug(match[1]) in ("time", "flow_time", "physical_time") else "value"
    if unit == "rpm" and may_be_shaft_speed(match[1]):
        return Column("rpm", unit)
    return Column(f"{slug(match[1])}_{unit}", unit, role)


def read_cfd_post_csv(path: str | os.PathLike[str]) -> Dataset:
    """Read a CSV of CFD-Post."""
    source = load_text(path)
    lines = [(k, text.strip()) for k, text in enumerate(source.lines, 1) if text.strip()]
    lines = [(k, text) for k, text in lines if not text.startswith("#")]
    if lines and _lists_expressions([text for _, text in lines[:2]]):
        return _expressions(source, lines)
    data, skipped = _data_blocks(source, lines)
    if not any(rows for _, rows in data):
        source.refuse("", "no data", "a section [Data] with headings and rows")
    notes = [f"section {', '.join(sorted(skipped))} not read"] if skipped else []
    records = [(block, _block(source, rows)) for block, rows in data if rows]
    if len(records) == 1:
        block, record = records[0]
        return replace(record, provenance={**record.provenance, "name": block}, notes=(*notes, *record.notes))
    channels: dict[str, Channel] = {}
    often = Counter(block for block, _ in records)
    for k, (block, record) in enumerate(records):
        label = block if often[block] == 1 else f"{block} {k + 1}"
        channels |= {f"{key}({label})": channel for key, channel in channels_of(record).items()}
        notes += [f"{label}: {text}" for text in record.notes]
    return dataset(CFD_POST_CSV, "cfd", channels, notes, {**source.about, "clock": "none"})


def _expressions(source: SourceText, lines: list[tuple[int, str]]) -> Dataset:
    """Values of expressions, one a line."""
    columns, values = list[Column](), list[Array]()
    for line, text in lines[1:] if _VALUES.fullmatch(lines[0][1]) else lines:
        match = _EXPRESSION.fullmatch(text)
        value = number(match[2]) if match else None
        if match is None or value is None:
            source.add(line, repr(text[:60]), "an expression, its value and unit, such as Thrust, 2.61 [N]")
        else:
            unit = si_unit(match[3]) or match[3].strip()
            columns.append(_heading(f"{match[1]} [{match[3]}]") if unit else Column(match[1]))
            values.append(np.array([value]))
    source.check()
    channels = made_of(columns, values, "one value of an expression")
    return dataset(CFD_POST_CSV, "cfd", channels, no_units(columns), {**source.about, "clock": "none"})


def _data_blocks(
    source: SourceText, lines: list[tuple[int, str]]
) -> tuple[list[tuple[str, list[tuple[int, str]]]], set[str]]:
    """Lines of each section [Data], under the name of the section [Name] before it; sections that are not read."""
    data: list[tuple[str, list[tuple[int, str]]]] = []
    section, name = "", ""
    skipped: set[str] = set()
    for line, text in lines:
        match = _SECTION.fullmatch(text.rstrip(",;"))
        if match and match[1] in ("Name", "Data", "Lines", "Faces", "Spatial Fields", "Parameters"):
            section = match[1]
            data += [(name or "data", [])] if section == "Data" else []
        elif section == "Name":
            name = text.rstrip(",;")
        elif section == "Data":
            data[-1][1].append((line, text))
        elif section:
            skipped.add(section)
        else:
            source.refuse(line, repr(text[:60]), "[Name] or [Data]", "Is the head cut?")
    return data, skipped


def _block(source: SourceText, lines: list[tuple[int, str]]) -> Dataset:
    head = lines[0][1]
    mark = ";" if ";" in head else "\t" if "\t" in head and "," not in head else ","
    names = cells_of(head, mark)
    if all(re.fullmatch(r"[-+.\deE]+", cell) for cell in names):
        got = f"numbers ({', '.join(names[:4])})"
        source.refuse(lines[0][0], got, "headings such as X [ m ]", "Is the head cut?")
    columns = [_heading(cell) for cell in names]
    rows = [ExportRow(line, cells_of(text, mark)) for line, text in lines[1:] if cells_of(text, mark) != names]
    again = len(lines) - 1 - len(rows)
    told = [f"headings repeated {number_of(again, 'time')}: several surfaces in one file"] if again else []
    table, notes = numeric_table(source, columns, rows, commas=mark != ","), [*told, *no_units(columns)]
    if columns[0].role == "time":
        return history(CFD_POST_CSV, source, columns, table, notes)
    about = {**source.about, "clock": "none"}
    return dataset(CFD_POST_CSV, "cfd", made_of(columns, table.values.T), [*notes, *table.warnings], about)


# Design points of Ansys Workbench as CSV: one operating point a row.
#
# ::
#
#     # The parameters defined in the project are:
#     # ,P1 - rpm [rev min^-1],P2 - thrust [N]
#     # The following header line defines the name of the columns by reference to the parameters.
#     Name,P1,P2
#     DP 0,8000,3.6
#
# or, as the parametric study of Fluent saves it, ``Design Points,rpm,thrust-op``. A unit stands in the heading, or in a
# row ``Units``.

DESIGN_POINTS = "design_points"

_HEAD = re.compile(r"(Name\s*[,;]\s*\"?P\d|Design Points?\s*[,;])", re.IGNORECASE)
_NAMED = re.compile(r"\"?Name\"?\s*[,;]", re.IGNORECASE)
_POINT = re.compile(r"\"?DP ?\d+\"?\s*[,;]|Units\s*[,;]", re.IGNORECASE)
_PARAMETER = re.compile(r"\s*(?:(P\d+) - )?(.*?)\s*(?:\[[\s-]*([^\]]*?)\s*\])?\s*")


def sniff_design_points(head: bytes | str) -> bool:
    r"""Tell whether the first line that is no comment heads a table of design points.

    >>> heads = "# ,P1 - rpm [rev min^-1]\nName,P1\nDP 0,8", "Design Points,rpm,T-op\nDP1,1,2", "Name,rpm [rpm]\nDP0,6"
    >>> [sniff_design_points(head) for head in (*heads, "Name,a")]
    [True, True, True, False]
    """
    lines = [line for line in head_lines(head) if not line.startswith("#")]
    labelled = len(lines) > 1 and _NAMED.match(lines[0]) and _POINT.match(lines[1])
    return bool(lines) and bool(_HEAD.match(lines[0]) or labelled)


def _column(name: str, told: Mapping[str, tuple[str, str]], units: Mapping[str, str]) -> Column:
    """Column of a parameter, by what a comment or its heading says; its unit also by the line of units."""
    words, unit = told.get(name) or _headed(name)
    unit = unit or units.get(name, "")
    return Column(words, si_unit(unit) or unit)


def read_design_points(path: str | os.PathLike[str]) -> Dataset:
    """Read design points; one that failed is NaN."""
    source = load_text(path)
    told: dict[str, tuple[str, str]] = {}
    units: dict[str, str] = {}
    names: tuple[str, ...] = ()
    rows: list[ExportRow] = []
    labels: list[str] = []
    mark = ","
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        if text.startswith("#"):
            found = (m for m in map(_PARAMETER.fullmatch, text.lstrip("# ").split(",")) if m and m[1])
            told |= {m[1]: (m[2], m[3] or "") for m in found}
        elif text and not names:
            mark = ";" if ";" in text and "," not in text else ","
            names = cells_of(text, mark)[1:]
        elif text:
            label, *cells = cells_of(text, mark) if not text.endswith(mark) else (*cells_of(text, mark), "")
            if label.lower() == "units":
                units = dict(zip(names, cells, strict=False))
                continue
            labels.append(label)
            rows.append(ExportRow(line, tuple(cell or "nan" for cell in cells)))
    if not names:
        source.refuse("", "no header", "a line such as Name,P1,P2")
    columns = [_column(name, told, units) for name in names]
    table = numeric_table(source, columns, rows, mark != ",")
    texts = {"name": tuple(labels)} if len(labels) == len(table.values) else {}
    about = {**source.about, "clock": "none"}
    notes = (*table.warnings, *no_units(columns))
    return dataset(DESIGN_POINTS, "cfd", made_of(columns, table.values.T), notes, about, lines=table.lines, texts=texts)


def _headed(name: str) -> tuple[str, str]:
    """Words and unit of a parameter's heading.

    >>> _headed("P3 - thrust-op [N]"), _headed("thrust [lbf]"), _headed("rpm")
    (('thrust-op', 'N'), ('thrust', 'lbf'), ('rpm', ''))
    """
    found = _PARAMETER.fullmatch(name)
    return (found[2] or name, found[3] or "") if found else (name, "")


READERS = (
    Reader(CFD_POST_CSV, sniff_cfd_post_csv, read_cfd_post_csv),
    Reader(DESIGN_POINTS, sniff_design_points, read_design_points),
)

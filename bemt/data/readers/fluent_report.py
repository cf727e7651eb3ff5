r"""Fluent report files (``thrust-rfile.out``): three header lines, then rows separated by blanks.

::

    "thrust-rfile"
    "Time Step" "thrust etc.."                       abbreviated: ignored
    ("Time Step" "thrust" "torque" "flow-time")      the names and their order
    101 9.81 0.12 0.0519

Steady files count "Iteration" and have no flow-time. Columns of several zones are ``"name(zone)"`` and stay apart. The
file states no units, except that flow-time is in seconds. Rows of a report definition with average-over above 1 are
running averages already; the file does not say so. Forces are projected on the vector the user gave: the sign is
that of the file.
"""

from __future__ import annotations

import re

from bemt.data.readers.cfd import Column, ExportTable, Layout, head_lines, si_unit

KIND = "fluent_report"

_QUOTED = re.compile(r'"([^"]*)"')
_HEADER = re.compile(r'\(\s*(?:"[^"]*"\s*)+\)')
_UNIT = re.compile(r"(.+?)\s*\[\s*([^\[\]]+?)\s*\]")
_STEPS = {"time step", "time-step", "iteration", "iterations"}
_TIMES = {"flow time", "flow-time", "physical-time", "time"}


def column_of(name: str) -> Column:
    """Make the column of a name in Fluent's words; times are in seconds.

    >>> column_of("flow-time").name, column_of("Iteration").role, column_of("thrust(blade:1)").role
    ('time_s', 'step', 'value')
    """
    stated = _UNIT.fullmatch(name.strip())
    word = (stated[1] if stated else name).strip().lower()
    if word in _STEPS:
        return Column(name.strip(), "", "step")
    if word in _TIMES and (stated is None or stated[2] == "s"):
        return Column("time_s", "s", "time")
    if word == "delta-time" and stated is None:
        return Column("delta_time_s", "s", "step_size")
    unit = (si_unit(stated[2]) or stated[2].strip()) if stated else ""
    return Column(name.strip() or "unnamed", unit)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether one of the first lines is a parenthesised list of quoted names under a quoted title.

    >>> sniff('"t-rfile"\n"Iteration" "t"\n("Iteration" "t")\n1 0.3'), sniff('(title "a")\n(labels "x" "y")')
    (True, False)
    """
    lines = head_lines(head, 4)
    if not lines or not lines[0].startswith('"') or '",' in lines[0]:
        return False
    return any(line.startswith('("') or line.endswith(' etc.."') for line in lines[1:])


def _checked(columns: list[Column], table: ExportTable, notes: list[str]) -> tuple[list[Column], ExportTable]:
    if any(c.role == "value" and not c.unit for c in columns):
        notes.append("report files state no units, reference values, sector or sign convention: check them")
    if not any(c.role in ("step", "time") for c in columns):
        notes.append("no column counts steps or time: rows are taken in their order")
    return columns, table


_LAYOUT = Layout(
    KIND, '("Time Step" "thrust" "flow-time") in line 3',
    lambda line: [name.strip() for name in _QUOTED.findall(line)] if _HEADER.fullmatch(line) else None,
    lambda line: tuple(line.split()), column_of, lambda line: line.startswith('"'),
    hint="Line 3 of a report file lists all names; line 2 is abbreviated", finish=_checked,
)  # fmt: skip
read = _LAYOUT.read

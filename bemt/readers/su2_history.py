r"""SU2 convergence history: quoted names padded with blanks, commas between cells (CSV, or its Tecplot form).

::

    "Time_Iter","Outer_Iter","Inner_Iter",     "rms[Rho]"     ,       "CD"       , ...
              0,           0,           0,       -1.56427034,      0.2293788208, ...

Coefficients rest on reference values (``RefForce`` when it is written). A dual-time run keeps the last inner iteration
of each time step; with ``Cur_Time`` it is a history by time.
"""

from __future__ import annotations

import os
import re

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset
from bemt.readers import load_text
from bemt.readers._cfd import Column, ExportRow, ExportTable, cells_of, head_lines, numeric_table
from bemt.readers._cfd_record import history

KIND = "su2_history"

_STEPS = ("Time_Iter", "Outer_Iter", "Inner_Iter", "Iteration")
_START = re.compile(r'(VARIABLES\s*=\s*)?"\s*(Time_Iter|Outer_Iter|Inner_Iter|Iteration)\s*"\s*,', re.IGNORECASE)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether one of the first lines is a list of quoted names that begins with an iteration.

    >>> sniff('"Time_Iter","Inner_Iter", "CD"\n0,0,0.2'), sniff('"Iteration" "drag"')
    (True, False)
    """
    return any(_START.match(line) for line in head_lines(head, 4))


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a history."""
    source = load_text(path)
    names: tuple[str, ...] | None = None
    rows: list[ExportRow] = []
    repeated = 0
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        if not text or re.match(r"(TITLE|ZONE)\b", text):
            continue
        if _START.match(text):
            found = cells_of(re.sub(r"^VARIABLES\s*=\s*", "", text), ",")
            if names is not None and found != names:
                raise InputError(Fault(source.name, str(line), "another header", "the first one", "Split the file"))
            repeated += names is not None
            names = found
        elif names is None:
            expected = 'quoted names such as "Time_Iter","Inner_Iter","CD"'
            raise InputError(Fault(source.name, str(line), repr(text[:60]), expected, "Is the header damaged?"))
        else:
            rows.append(ExportRow(line, cells_of(text, ",")))
    if names is None:
        raise InputError(Fault(source.name, "", "no header", 'quoted names such as "Time_Iter","Inner_Iter"'))
    columns = [_column(name) for name in names]
    table = numeric_table(source, columns, rows, commas=False)
    notes = [f"header repeated {repeated} times: the run was restarted"] if repeated else []
    notes.append("coefficients rest on reference values that the history does not state")
    columns, table = _count(columns, table, notes)
    return history(KIND, source, columns, table, notes)


def _column(name: str) -> Column:
    if name == "Cur_Time":
        return Column("time_s", "s", "time")
    if name.startswith("Time("):  # wall time
        return Column(name, "", "wall")
    return Column(name or "unnamed", "", "counter" if name in _STEPS else "value")


def _count(columns: list[Column], table: ExportTable, notes: list[str]) -> tuple[list[Column], ExportTable]:
    """Let the outermost counter that counts be the step; rows of inner iterations of one time step repeat it."""
    counters = [k for k, c in enumerate(columns) if c.role == "counter"]
    counting = [k for k in counters if len(np.unique(table.values[:, k])) > 1]
    steps = counting[:1] or counters[-1:]
    if len(counting) > 1:
        notes.append(f"the last {columns[counting[-1]].name} of each {columns[counting[0]].name} is taken")
    for k in counters:
        columns[k] = Column(columns[k].name, "", "step" if k in steps else "counter")
    return columns, table

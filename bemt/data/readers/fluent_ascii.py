r"""Fluent's ASCII export of a surface or zone: ``nodenumber, x-coordinate, ...``, comma or blanks between cells.

::

    nodenumber,    x-coordinate,    y-coordinate,        pressure
             1, 8.427639012E-17,-7.500000000E-01,-3.011805813E-01

Fluent exports in SI whatever units it displays, but the file does not say so; units stay open. Coordinates and fields
are values at points, which carry no areas: forces cannot be summed from them.
"""

from __future__ import annotations

import os

from bemt.base.tables import number_of
from bemt.data.readers import load_text
from bemt.data.readers.cfd import Column, ExportRow, cells_of, fields, head_lines, numeric_table
from bemt.physics.dataset import Dataset

KIND = "fluent_ascii"

_FIRST = ("nodenumber", "cellnumber")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line names node or cell numbers and a coordinate.

    >>> sniff("nodenumber,  x-coordinate, pressure\n 1, 0.1, 3"), sniff("node,x\n1,2")
    (True, False)
    """
    return any(line.lower().lstrip('"').startswith(_FIRST) for line in head_lines(head, 1))


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read an ASCII export."""
    source = load_text(path)
    lines = [(k, text.strip()) for k, text in enumerate(source.lines, 1) if text.strip()]
    if not lines or not sniff(lines[0][1]):
        got = repr(lines[0][1][:60]) if lines else "no text"
        source.refuse(1, got, "a header that begins with nodenumber or cellnumber")
    mark = next((m for m in (",", ";") if m in lines[0][1]), None)
    names = cells_of(lines[0][1], mark)
    columns = [Column(name or "unnamed", "", "value" if k else "index") for k, name in enumerate(names)]
    rows = [ExportRow(k, cells_of(text, mark)) for k, text in lines[1:]]
    body = [row for row in rows if row.cells != names]
    table = numeric_table(source, columns, body, commas=mark != ",")
    repeated = len(rows) - len(body)
    notes = [f"header repeated {number_of(repeated, 'time')}: several surfaces in one file"] if repeated else []
    return fields(KIND, source, columns, table, [*notes, "no units stated (Fluent exports SI)"])

r"""Design points of Ansys Workbench as CSV: one operating point a row.

::

    # The parameters defined in the project are:
    # ,P1 - rpm [rev min^-1],P2 - thrust [N]
    # The following header line defines the name of the columns by reference to the parameters.
    Name,P1,P2
    DP 0,8000,3.6

or, as the parametric study of Fluent saves it, ``Design Points,rpm,thrust-op`` without units.
"""

from __future__ import annotations

import os
import re

from bemt.data.readers import load_text
from bemt.data.readers.cfd import Column, ExportRow, cells_of, head_lines, no_units, numeric_table, si_unit, unique
from bemt.data.readers.columns import Channel, dataset
from bemt.physics.dataset import Dataset

KIND = "design_points"

_HEAD = re.compile(r"(Name\s*[,;]\s*P\d|Design Points?\s*[,;])", re.IGNORECASE)
_PARAMETER = re.compile(r"\s*(P\d+) - (.*?)\s*(?:\[([^\]]*)\])?\s*")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line that is no comment heads a table of design points.

    >>> sniff("# ,P1 - rpm [rev min^-1]\nName,P1\nDP 0,8000"), sniff("Design Points,rpm,T-op\nDP1,1,2"), sniff("Name,a")
    (True, True, False)
    """
    lines = [line for line in head_lines(head) if not line.startswith("#")]
    return bool(lines) and _HEAD.match(lines[0]) is not None


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read design points; one that failed is NaN."""
    source = load_text(path)
    told: dict[str, tuple[str, str]] = {}
    names: tuple[str, ...] = ()
    rows: list[ExportRow] = []
    labels: list[str] = []
    mark = ","
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        if text.startswith("#"):
            found = map(_PARAMETER.fullmatch, text.lstrip("# ").split(","))
            told |= {m[1]: (m[2], m[3] or "") for m in found if m}
        elif text and not names:
            mark = ";" if ";" in text and "," not in text else ","
            names = cells_of(text, mark)[1:]
        elif text:
            label, *cells = cells_of(text, mark) if not text.endswith(mark) else (*cells_of(text, mark), "")
            labels.append(label)
            rows.append(ExportRow(line, tuple(cell or "nan" for cell in cells)))
    if not names:
        source.refuse("", "no header", "a line such as Name,P1,P2")
    columns = [Column(words, si_unit(unit) or unit) for words, unit in (told.get(n, (n, "")) for n in names)]
    table = numeric_table(source, columns, rows, mark != ",")
    keys = unique([c.name for c in columns])
    channels = {key: Channel(v, c.unit) for key, c, v in zip(keys, columns, table.values.T, strict=True)}
    texts = {"name": tuple(labels)} if len(labels) == len(table.values) else {}
    about = {**source.about, "clock": "none"}
    notes = (*table.warnings, *no_units(columns))
    return dataset(KIND, "cfd", channels, notes, about, lines=table.lines, texts=texts)

r"""Old Fluent monitors (``cd-1-history``): a title, a line of quoted names, rows; no third header line.

::

    "Drag Convergence"
    "Flow Time" "cd"
    5.00000e-03     7.61066e-02
"""

from __future__ import annotations

import os
import re

from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset
from bemt.readers import load_text
from bemt.readers._cfd import ExportRow, head_lines, numeric_table
from bemt.readers._cfd_record import history
from bemt.readers.fluent_report import column_of

KIND = "fluent_monitor"

_TITLE = re.compile(r'"[^"]*"')
_NAMES = re.compile(r'"[^"]*"(?:\s+"[^"]*")+')


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a quoted title is followed by a line of quoted names and then by a number.

    >>> sniff('"Drag Convergence"\r\n"Flow Time" "cd"\r\n5e-03 7e-02'), sniff('"a","b"\n1,2')
    (True, False)
    """
    lines = head_lines(head, 3)
    return (
        len(lines) > 1
        and _TITLE.fullmatch(lines[0]) is not None
        and _NAMES.fullmatch(lines[1]) is not None
        and not lines[1].endswith(' etc.."')
        and (len(lines) < 3 or re.match(r"[-+.\d]", lines[2]) is not None)
    )


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a monitor."""
    source = load_text(path)
    title: str | None = None
    names: list[str] | None = None
    rows: list[ExportRow] = []
    repeated = 0
    for line, raw in enumerate(source.lines, 1):
        text = raw.strip()
        if not text:
            continue
        if _NAMES.fullmatch(text):
            found = re.findall(r'"([^"]*)"', text)
            if names is not None and found != names:
                got, expected = f"another header ({', '.join(found)})", f"the first one ({', '.join(names)})"
                raise InputError(Fault(source.name, str(line), got, expected, "Split the file there"))
            repeated += names is not None
            names = found
        elif _TITLE.fullmatch(text) and (title is None or text.strip('"') == title):
            title = text.strip('"')
        elif names is None:
            expected = 'names such as "Flow Time" "cd"'
            raise InputError(Fault(source.name, str(line), repr(text[:60]), expected, "Is the header damaged?"))
        else:
            rows.append(ExportRow(line, tuple(text.split())))
    if names is None:
        raise InputError(Fault(source.name, "", "no names", 'a second line such as "Flow Time" "cd"'))
    if any(name.rstrip().endswith("etc..") for name in names):
        hint = "This is the second line of a report file whose third line is missing"
        raise InputError(Fault(source.name, "2", f"abbreviated names {', '.join(names)}", "all names", hint))
    columns = [column_of(name) for name in names]
    table = numeric_table(source, columns, rows)
    notes = [f"header repeated {repeated} times: the run was restarted"] if repeated else []
    notes.append("monitors state no units, reference values, sector or sign convention: check them")
    return history(KIND, source, columns, table, notes, {"title": title or ""})

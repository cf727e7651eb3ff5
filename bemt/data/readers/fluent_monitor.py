r"""Old Fluent monitors (``cd-1-history``): a title, a line of quoted names, rows; no third header line.

::

    "Drag Convergence"
    "Flow Time" "cd"
    5.00000e-03     7.61066e-02
"""

from __future__ import annotations

import re

from bemt.data.readers.cfd import Layout, head_lines
from bemt.data.readers.fluent_report import column_of

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


_LAYOUT = Layout(
    KIND, '"Flow Time" "cd"', lambda line: re.findall(r'"([^"]*)"', line) if _NAMES.fullmatch(line) else None,
    lambda line: tuple(line.split()), column_of, lambda line: _TITLE.fullmatch(line) is not None,
    ("monitors state no units, reference values, sector or sign convention: check them",),
)  # fmt: skip
read = _LAYOUT.read

"""Polar save files of XFOIL (``PACC``), of XFLR5 and XOptFoil that write the same layout, and the CSV of airfoiltools.

One file holds one Reynolds number::

    Calculated polar for: NACA 4412
    1 1 Reynolds number fixed          Mach number fixed
    xtrf =   1.000 (top)        1.000 (bottom)
    Mach =   0.000     Re =     0.100 e 6     Ncrit =   9.000
     alpha    CL        CD       CDp       CM     Top_Xtr  Bot_Xtr
    ------ -------- --------- --------- -------- -------- --------

XFLR5 may put commas between the cells. The CSV of airfoiltools.com says the same in other words::

    Xfoil polar. Reynolds number fixed. Mach  number fixed
    Airfoil,n0012-il
    Reynolds number,100000
    Ncrit,9
    Mach,0
    Alpha,Cl,Cd,Cdp,Cm,Top_Xtr,Bot_Xtr

Several such files make one polar with `read_many`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

from bemt.base.errors import Fault, InputError
from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.data.readers.polar_csv import PolarRow, assemble, row_of
from bemt.physics.sections.polars import Polar

KIND = "polar_xfoil"

_TITLE = re.compile(r"Calculated polar for:[ \t]*(.*?)[ \t]*$", re.M)
_STATE = re.compile(r"Mach\s*=\s*(\S+)\s+Re\s*=\s*(\S+)\s*e\s*(\d+)\s+Ncrit\s*=\s*(\S+)", re.I)
_TYPE = re.compile(r"^\s*\d+\s+\d+\s+Reynolds number\s+(.*?)\s{2,}Mach number\s+(.*?)\s*$", re.M)
_HEADER = re.compile(r"\s*alpha\s*[,;\s]\s*CL\s*[,;\s]\s*CD\b", re.I)
_SITE = re.compile(r"\s*Xfoil polar\. Reynolds number (\w+)\. Mach\s+number (\w+)", re.I)
_FACT = re.compile(r"^(Airfoil|Reynolds number|Ncrit|Mach)\s*[,;]\s*(.*?)[,;\s]*$", re.M)
_TRIP = re.compile(r"xtrf\s*=\s*(\S+)\s*\(top\)\s*(\S+)\s*\(bottom\)")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file begins like an XFOIL polar.

    >>> sniff("       XFOIL         Version 6.99\n\n Calculated polar for: NACA 4412\n"), sniff("alpha,cl,cd")
    (True, False)
    """
    text = head_text(head)
    return _TITLE.search(text) is not None or _SITE.match(text) is not None


def read(path: str | os.PathLike[str]) -> Polar:
    """Read one XFOIL polar file."""
    return read_many([path])


def read_many(paths: Iterable[str | os.PathLike[str]]) -> Polar:
    """Read XFOIL polar files of one section at several Reynolds numbers."""
    sources = [load_text(path) for path in paths]
    if not sources:
        raise InputError(Fault("", "", "no files", "one XFOIL polar or more"))
    first, rows, notes, names = sources[0], list[PolarRow](), list[str](), list[str]()
    for source in sources:
        source.faults = first.faults
        name, more, said = _parse(source)
        names.append(name)
        if name != names[0]:
            source.add("", f"section {name!r}", f"section {names[0]!r} as in the first file")
        rows += more
        notes += said
    return assemble(first, rows, name=names[0], kind="XFOIL polar", notes=tuple(dict.fromkeys(notes)))


def _rewritten(text: str) -> str:
    """Head of the CSV of airfoiltools in the words of XFOIL, on as many lines."""
    site = _SITE.match(text)
    if site is None:
        return text
    facts = dict(_FACT.findall(text))
    re_number = number(facts.get("Reynolds number", ""))
    if re_number is None:
        return text
    kind = f" 1 1 Reynolds number {site[1]}          Mach number {site[2]}"
    state = f"Mach = {facts.get('Mach', '0')} Re = {re_number / 1e6!r} e 6 Ncrit = {facts.get('Ncrit', '?')}"
    lines = text.splitlines()
    head = next((i for i, line in enumerate(lines) if _HEADER.match(line)), 0)
    if head < 3:
        return text
    return "\n".join(
        [f"Calculated polar for: {facts.get('Airfoil', '')}", kind, state, *[""] * (head - 3), *lines[head:]]
    )


def _parse(source: SourceText) -> tuple[str, list[PolarRow], list[str]]:
    """Name, rows and notes of one file."""
    text = _rewritten(source.text)
    title, state, kind, trip = (p.search(text) for p in (_TITLE, _STATE, _TYPE, _TRIP))
    notes = []
    if title is None:
        source.add("", "no line 'Calculated polar for:'", "an XFOIL polar save file")
    if kind and (kind.group(1).lower() != "fixed" or kind.group(2).lower() != "fixed"):
        got = f"Reynolds number {kind.group(1)}, Mach number {kind.group(2)}"
        line = str(text.count("\n", 0, kind.end()) + 1)
        source.add(line, got, "a polar of type 1 (both fixed)", "Run XFOIL with TYPE 1")
    reynolds, mach = None, 0.0
    if state is None:
        got, hint = "no line 'Mach = ... Re = ... e 6 Ncrit = ...'", "Save the polar with viscous mode on"
        source.add("", got, "the state of the run", hint)
    else:
        values = [number(state.group(k)) for k in (1, 2, 4)]
        line = str(text.count("\n", 0, state.start()) + 1)
        if any(v is None for v in values):
            source.add(line, repr(state.group(0)), "numbers for Mach, Re and Ncrit")
        else:
            mach, reynolds = float(values[0] or 0.0), float(values[1] or 0.0) * 10.0 ** int(state.group(3))
            notes.append(f"Ncrit {values[2]:g}")
            if reynolds == 0.0:
                reynolds = None
                hint = "XFOIL prints three decimals of millions: set Re by hand if it is below 500"
                source.add(line, "Re = 0", "a Reynolds number above 0 (viscous run)", hint)
    if trip and (trip.group(1), trip.group(2)) != ("1.000", "1.000"):
        notes.append(f"forced transition at x/c {trip.group(1)} (top), {trip.group(2)} (bottom)")
    rows: list[PolarRow] = []
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if _HEADER.match(line)), len(lines))
    mark = re.search("[,;]", lines[start]) if start < len(lines) else None
    for i, line in enumerate(lines[start + 1 :], start + 2):
        cells = [c.strip() for c in line.split(mark[0])] if mark else line.split()
        if any(cells) and not set(line.strip()) <= {"-", " "}:
            rows += row_of(source, i, cells, reynolds, mach, ("alpha", "CL", "CD"))
    if not rows:
        source.add("", "no rows", "rows under the header 'alpha CL CD ...'", "Empty polar?")
    return (title.group(1) if title else ""), rows, notes

"""Airfoil files of AeroDyn: version 15 (``AirfoilInfo``), and 13/14 as AirfoilPrep, CCBlade and QBlade write them.

Version 15: ``!`` begins a comment, ``value  Name`` sets a value; each of ``NumTabs`` tables gives ``Re`` in millions
and ``NumAlf`` rows of alpha [deg], cl, cd and further columns.

Version 13: two or three title lines, ``n  Number of airfoil tables in this file``; each table gives, in lines of a
number and a text, its Reynolds number in millions (or a table id instead) and stall parameters, then rows of alpha
[deg], cl, cd and cm, then ``EOT``.
"""

from __future__ import annotations

import os
import re

from bemt.base.tables import number_of
from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.data.readers.polar_csv import PolarRow, assemble, row_of
from bemt.physics.sections.polars import Polar

KIND = "polar_aerodyn"

_V15 = re.compile(r"^\s*\S+\s+NumTabs\b", re.M)
_V13 = re.compile(r"^\s*(\S+)\s+Number of airfoil tables", re.M | re.I)
_MILLION = 1e6


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file is an AeroDyn airfoil file of version 13 to 15.

    >>> sniff("! AirfoilInfo v1.01.x Input File\n  1  NumTabs  ! Number of tables\n"), sniff("alpha,cl,cd")
    (True, False)
    """
    text = head_text(head)
    return _V15.search(text) is not None or _V13.search(text) is not None


def read(path: str | os.PathLike[str]) -> Polar:
    """Read an AeroDyn airfoil file with one or several Reynolds numbers."""
    source = load_text(path)
    if _V15.search(source.text):
        rows, version = _read_v15(source), "15"
    elif _V13.search(source.text):
        rows, version = _read_v13(source), "13"
    else:
        source.refuse("", "no number of tables", "'NumTabs' (version 15) or 'Number of airfoil tables' (version 13)")
    return assemble(source, rows, kind=f"AeroDyn {version}")


def _reynolds(source: SourceText, line: int, text: str, several: bool) -> float | None:
    """Reynolds number from millions; None for 0, which many files write for "not stated"."""
    value = number(text)
    if value is None or value < 0.0 or value > 1e3:
        hint = "The format counts in millions" if value is not None and value > 1e3 else ""
        source.add(line, f"Re = {text}", "a Reynolds number in millions", hint)
        return None
    if value == 0.0 and several:
        source.add(line, "Re = 0", "its own Reynolds number for each table")
    return value * _MILLION or None


def _count(source: SourceText, line: int, text: str, name: str) -> int:
    """Read a count of one or more; 0 with a fault otherwise."""
    if text.isdigit() and int(text) > 0:
        return int(text)
    source.add(line, f"{name} = {text}", "a whole number from 1")
    return 0


def _read_v15(source: SourceText) -> list[PolarRow]:
    """Rows of all tables of an AirfoilInfo file."""
    rows: list[PolarRow] = []
    tables = found = 0
    reynolds: float | None = None
    controls: dict[float | None, str] = {}
    lines = [(i, text.split("!")[0].split()) for i, text in enumerate(source.lines, 1)]
    lines = [(i, cells) for i, cells in lines if cells]
    at = 0
    while at < len(lines):
        i, cells = lines[at]
        at += 1
        key = cells[1].rstrip(":").split("_")[0] if len(cells) > 1 else ""
        if key == "NumTabs":
            tables = _count(source, i, cells[0], key)
        elif key == "Re":
            reynolds = _reynolds(source, i, cells[0], tables > 1)
        elif key in ("UserProp", "Ctrl"):
            if reynolds in controls and controls[reynolds] != cells[0]:
                got = f"{key} = {cells[0]} beside {controls[reynolds]} at one Re"
                source.add(i, got, "one control setting", "Keep the tables of one setting")
            controls.setdefault(reynolds, cells[0])
        elif key == "NumAlf":
            found += 1
            count = _count(source, i, cells[0], key)
            block = lines[at : at + count]
            stop = next((k for k, (_, c) in enumerate(block) if len(c) > 1 and c[1][:1].isalpha()), len(block))
            if stop < count:
                source.add(
                    i, f"{number_of(stop, 'row')} after NumAlf = {count}", number_of(count, "row"), "Correct NumAlf"
                )
            for j, row in block[:stop]:
                rows += row_of(source, j, row, reynolds)
            at += stop
    if tables and found != tables:
        source.add("", f"{found} tables after NumTabs = {tables}", f"{tables} tables")
    return rows


def _read_v13(source: SourceText) -> list[PolarRow]:
    """Rows of all tables of a version 13 or 14 file."""
    rows: list[PolarRow] = []
    tables = found = 0
    reynolds: float | None = None
    stated = inside = False
    for i, text in enumerate(source.lines, 1):
        cells = text.split("!")[0].split()
        head = _V13.match(text)
        if head:
            tables = _count(source, i, head.group(1), "Number of airfoil tables")
        elif not tables or not cells:
            continue
        elif cells[0].upper() == "EOT":
            reynolds, stated, inside = None, False, False
        elif all(number(c) is not None for c in cells[:3]) and len(cells) > 2:
            if not inside:
                found += 1
                inside = True
                if tables > 1 and not stated:
                    hint = "Tables distinguished by an id are not supported"
                    source.add(i, "a table without Re", "Reynolds number in millions", hint)
            if len(cells) > 5:
                source.add(i, number_of(len(cells), "column"), "alpha, cl, cd, cm", "Give several tables one by one")
            rows += row_of(source, i, cells, reynolds)
        elif inside and len(cells) > 1 and not cells[1][:1].isalpha():
            rows += row_of(source, i, cells, reynolds)
        elif "reynolds" in text.lower():
            reynolds, stated, inside = _reynolds(source, i, cells[0], tables > 1), True, False
    if tables and found != tables:
        source.add("", f"{found} tables", f"{tables} as stated", "Is EOT missing?")
    return rows

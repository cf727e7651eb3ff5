"""AeroDyn 15: driver file with the primary, blade and airfoil files that it names (NREL, AeroDyn user guide).

A value stands before its name. The driver holds blade count and hub radius, the primary file the list of airfoils, the
blade file the nodes: span from the hub, twist from the plane of rotation to feather, chord, number of the airfoil.

AeroDyn is for turbines: lift of its sections drives the rotor. For the propeller convention sections are turned over,
``cl(alpha) = -cl_turbine(-alpha)``, so that a rotor that brakes the flow has negative thrust and torque.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bemt.base.tables import number_of
from bemt.data.readers import SourceText, head_text, load_text, number, polar_aerodyn
from bemt.data.readers.blade import BladeFile, Cursor, as_count
from bemt.physics.sections.polars import Polar

KIND = "aerodyn"
BLADE = True

_DRIVER = re.compile(r"\bAeroDyn\b[^\n]*\bDriver\b|\bNumBlades(\(1\))?\b", re.I)
_POINT = ("HWindSpeed", "RotSpeed", "FldDens")
_PART = re.compile(r"\b(ADBlFile|NumBlNds)\b")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file is a driver, primary or blade file of AeroDyn 15.

    >>> sniff("--- AeroDyn Driver Input File ---\nRotor\n"), sniff("3 NumBlNds - nodes\n"), sniff("1 NumTabs\n")
    (True, True, False)
    """
    text = head_text(head)
    return _DRIVER.search(text) is not None or _PART.search(text) is not None


def read(path: str | os.PathLike[str]) -> BladeFile:
    """Read the first rotor of a driver file."""
    driver = load_text(path)
    if not _DRIVER.search(driver.text):
        got = "a part of an AeroDyn model, without blade count and hub radius"
        driver.refuse("", got, "the driver file that names it", "It holds NumBlades and HubRad")
    count, hub = (_number(driver, key) for key in ("NumBlades", "HubRad"))
    model = ("AeroFile", "AD_InputFile", "InputFile")
    primary = _part(driver, model, Path(path).parent)
    folder = Path(path).parent / Path(_text(driver, model)).parent
    blade = _part(primary, ("ADBlFile(1)", "ADBlFile"), folder)
    polars = [_turned(polar_aerodyn.read(folder / name)) for name in _airfoils(primary)]
    rows = _nodes(blade)
    nodes = [rows.take(7, "a node", 7) for _ in rows.rows]
    ids = [as_count(row[6]) for row in nodes]
    for bad in sorted({i for i in ids if not 1 <= i <= len(polars)}):
        rows.add("BlAFID", f"{bad}", f"1 to {len(polars)}, as {primary.name} lists")
    rows.check()
    span, chord, twist = (np.array([row[k] for row in nodes]) for k in (0, 5, 4))
    r = hub + span
    notes = ["sections are turned over for the propeller convention: braking the flow is negative thrust"]
    if any(abs(v) > 1e-9 for row in nodes for v in row[1:4]):
        notes.append("prebend, sweep and cant of the blade are left out")
    V, rpm, rho = (None if (v := _value(driver, key)) is None else number(v[1]) for key in _POINT)
    found = BladeFile(
        Path(path).stem, "AeroDyn", as_count(count), float(r[-1]), hub, r, chord, np.radians(twist),
        _anchors(r / r[-1], ids, polars), rpm, V, rho, tuple(notes),
    )  # fmt: skip
    return rows.finish(found)


def _value(source: SourceText, key: str) -> tuple[int, str] | None:
    """Line and text in front of a name; quoted texts may hold blanks."""
    name = re.compile(r'^\s*("[^"]*"|\S+)\s+' + re.escape(key) + r"(?:\(1\))?(?=\s|$)")
    found = ((i, name.match(line)) for i, line in enumerate(source.lines, 1))
    return next(((i, m[1].strip('"')) for i, m in found if m), None)


def _number(source: SourceText, key: str) -> float:
    found = _value(source, key)
    value = None if found is None else number(found[1])
    if value is None:
        where, got = (key, "nothing") if found is None else (found[0], repr(found[1]))
        source.add(where, got, f"a number for {key}")
    return math.nan if value is None else value


def _text(source: SourceText, keys: Sequence[str]) -> str:
    return next((found[1] for key in keys if (found := _value(source, key))), "")


def _part(source: SourceText, keys: Sequence[str], folder: Path) -> SourceText:
    """The file that one of the names stands for; faults of the whole model are gathered in one list."""
    name = _text(source, keys)
    if not name:
        source.refuse(keys[0], "nothing", "the name of a file")
    part = load_text(folder / name)
    part.faults = source.faults
    return part


def _airfoils(source: SourceText) -> list[str]:
    """Files of ``AFNames``: a quoted name on each of ``NumAFfiles`` lines."""
    count = as_count(_number(source, "NumAFfiles"))
    first = next((i for i, line in enumerate(source.lines) if re.search(r'"\s+AFNames\b', line)), None)
    lines = [] if first is None else source.lines[first : first + count]
    names = [m[1] for line in lines if (m := re.match(r'\s*"([^"]+)"', line))]
    if len(names) < max(count, 1):
        source.add("AFNames", number_of(len(names), "file"), f"{max(count, 1)} in quotes")
    return names


def _nodes(source: SourceText) -> Cursor:
    """Rows of span, three shapes of the axis, twist, chord and airfoil."""
    count = as_count(_number(source, "NumBlNds"))
    begin = (_value(source, "NumBlNds") or (0, ""))[0] + 2
    rows = Cursor(source, "")
    rows.faults = source.faults
    rows.rows = [(i + 1, source.lines[i]) for i in range(begin, min(begin + count, len(source.lines)))]
    if len(rows.rows) < max(count, 2):
        rows.refuse("NumBlNds", f"{len(rows.rows)} nodes", f"{max(count, 2)}")
    return rows


def _anchors(rR: np.ndarray, ids: Sequence[int], polars: Sequence[Polar]) -> list[tuple[float, Polar]]:
    """First and last node of each run of one airfoil."""
    ends = [k for k in range(len(ids)) if k in (0, len(ids) - 1) or ids[k] != ids[k - 1] or ids[k] != ids[k + 1]]
    return [(float(rR[k]), polars[ids[k] - 1]) for k in ends]


def _turned(polar: Polar) -> Polar:
    """The section upside down."""
    return replace(polar, alpha=-polar.alpha[::-1], cl=-polar.cl[::-1], cd=polar.cd[::-1], confidence=None)

"""DFDC: case files with a bladed rotor in a duct (the centre body gives the hub)."""

from __future__ import annotations

import os
import re

import numpy as np

from bemt.base.tables import number_of
from bemt.data.readers import head_text
from bemt.data.readers.blade import BladeFile, Cursor, as_count
from bemt.data.readers.xrotor import read_section

KIND = "dfdc"
BLADE = True
_HEAD = re.compile(r"\s*DFDC\s+Version", re.I)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file begins as a DFDC case.

    >>> sniff("DFDC Version 0.55\nduct\n"), sniff("XROTOR VERSION: 7.55\n")
    (True, False)
    """
    return _HEAD.match(head_text(head)) is not None


def read(path: str | os.PathLike[str]) -> BladeFile:
    """Read the rotor of one case."""
    rows = Cursor(path, "!#")
    words = [text.split()[0].split("!")[0].upper() for _, text in rows.rows]
    if "ROTOR" not in words:
        got = "an actuator disk without blades" if "ACTDISK" in words else "no ROTOR"
        rows.refuse("", got, "a case with a ROTOR block", "A disk has no blade to read")
    notes = ["the blade ends at the wall: the file has no tip gap"]
    name = rows.rows[1][1].strip() if len(rows.rows) > 1 else ""
    V = rpm = rho = None
    if "OPER" in words:
        rows.at = words.index("OPER") + 1
        V, _, turning = rows.take(3, "Vinf Vref RPM")
        air, *_ = rows.take(4, "Rho Vso Rmu Alt")
        rpm, rho = abs(turning) or None, air if 0.01 < air < 10.0 else None
    sections = []
    if "AERO" in words:
        rows.at = words.index("AERO") + 1
        sections = [read_section(rows) for _ in range(as_count(rows.take(1, "#sections")[0]))]
    else:
        rows.add("AERO", "nothing", "sections of the blade")
    rows.at = words.index("ROTOR") + 1
    if words.count("ROTOR") > 1:
        notes.append("the file has several rotors: the first is read")
    x_disk, blades, _ = rows.take(3, "Xdisk Nblds NRsta")
    n = as_count(rows.take(1, "#stations")[0])
    body = rows.table(n, 3, "r chord beta")
    if len(body) < n:
        rows.add("ROTOR", number_of(len(body), "station"), f"{n}")
    rows.check()
    r, c, b = body.T
    hub, tip, duct = _walls(rows, words, x_disk)
    if hub is None or not 0.0 < hub <= r[0]:
        hub = float(r[0])
        notes.append("no centre body at the rotor: the hub is that of the first station")
    if tip is None or tip < r[-1]:
        tip = float(r[-1])
        notes.append("no duct at the rotor: the tip is that of the last station")
    blade = BladeFile(
        name, "DFDC", as_count(blades), tip, hub, r, c, np.radians(b), sections, rpm, V, rho, tuple(notes), duct
    )
    return rows.finish(blade)


def _walls(rows: Cursor, words: list[str], x: float) -> tuple[float | None, float | None, dict[str, float] | None]:
    """Radii of centre body and bore at the rotor, None where there is no outline; the duct's keys of a case."""
    if "GEOM" not in words or "ENDGEOM" not in words:
        return None, None, None
    parts: list[list[list[float]]] = [[]]
    rows.at = words.index("GEOM") + 2
    while rows.at < words.index("ENDGEOM"):
        pair = rows.take(2, "x r")
        if pair[0] > 900.0:
            parts.append([])
        else:
            parts[-1].append(pair)
    outlines = [np.array(part).reshape(-1, 2) for part in parts]
    body = max(_crossings(outlines[0], x), default=None)
    if len(outlines) < 2 or not (bores := _crossings(outlines[1], x)):
        return body, None, None
    wall, bore = outlines[1], min(bores)
    lip = int(np.argmin(wall[:, 0]))
    inside = wall[lip:] if wall[lip:, 1].mean() < wall[: lip + 1, 1].mean() else wall[lip::-1]
    x_lip, (x_exit, r_exit) = wall[lip, 0], inside[-1]
    duct = {
        "inner_diameter_mm": 2e3 * bore,
        "length_mm": 1e3 * (x_exit - x_lip),
        "lip_radius_mm": 1e3 * max(wall[lip, 1] - bore, 0.0),
        "rotor_position_mm": 1e3 * (x - x_lip),
        "exit_diameter_mm": 2e3 * r_exit,
        "exit_hub_diameter_mm": 2e3 * max(_crossings(outlines[0], x_exit - 1e-6 * abs(x_exit)), default=0.0),
    }
    return body, bore, duct


def _crossings(outline: np.ndarray, x: float) -> list[float]:
    """Radii at which an outline passes an axial position."""
    out = []
    for (x0, r0), (x1, r1) in zip(outline[:-1], outline[1:], strict=True):
        if min(x0, x1) <= x <= max(x0, x1) and x0 != x1:
            out.append(float(abs(r0 + (x - x0) / (x1 - x0) * (r1 - r0))))
    return out

"""XROTOR: saved rotors of version 6.9 and later."""

from __future__ import annotations

import math
import os
import re

import numpy as np

from bemt.base.tables import number_of
from bemt.data.readers import head_text
from bemt.data.readers.blade import BladeFile, Cursor, as_count
from bemt.physics.sections.parametric import XrotorSection

KIND = "xrotor"
BLADE = True
_HEAD = re.compile(r"\s*XROTOR\s+VERSION", re.I)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file begins as XROTOR's SAVE writes it.

    >>> sniff("XROTOR VERSION:  7.55\nblade\n"), sniff("DFDC Version 0.55\n")
    (True, False)
    """
    return _HEAD.match(head_text(head)) is not None


_SECTION = (
    (1, "r/R of a section"), (4, "A0deg dCLdA CLmax CLmin"), (4, "dCLdAstall dCLstall Cmconst Mcrit"),
    (3, "CDmin CLCDmin dCDdCL^2"), (2, "REref REexp"),
)  # fmt: skip


def read_section(rows: Cursor) -> tuple[float, XrotorSection]:
    """Five lines of a section, of XROTOR and of DFDC: r/R, lift, stall, drag, Reynolds number."""
    line = rows.rows[min(rows.at, len(rows.rows) - 1)][0]
    (x,), (a0, slope, top, bottom), (stall, span, cm, mcrit), (least, middle, bend), (reref, reexp) = (
        rows.take(*what) for what in _SECTION
    )
    if not 0.5 <= slope <= 15.0:
        rows.add(line, f"a lift slope of {slope:g}", "0.5 to 15 per radian", "Per degree?")
    if not (span > 0.0 and reref > 0.0 and least > 0.0):
        rows.add(line, f"dCLstall {span:g}, REref {reref:g}, CDmin {least:g}", "values above 0")
    numbers = (slope, top, bottom, stall, span, least, middle, bend, reref, reexp, cm, mcrit)
    return x, XrotorSection(math.radians(a0), *numbers)


def read(path: str | os.PathLike[str]) -> BladeFile:
    """Read one saved rotor."""
    rows = Cursor(path, "!#")
    if len(rows.rows) < 9 or not sniff(rows.text):
        rows.refuse(1, repr(rows.text[:30]), "XROTOR VERSION, a title and the rotor")
    name, rows.at = rows.rows[1][1].strip(), 2
    rho, *_ = rows.take(4, "Rho Vso Rmu Alt")
    R, V, adv, rake = rows.take(4, "Rad Vel Adv Rake")
    hub, _ = rows.take(2, "XI0 XIW")
    (count,) = rows.take(1, "Naero")
    rows.check()
    if not 1 <= count <= 50:
        rows.refuse(rows.rows[5][0], f"{count:g} sections", "1 to 50")
    sections = [read_section(rows) for _ in range(as_count(count))]
    if rows.at + 1 >= len(rows.rows):
        rows.refuse("", "the end of the file", "flags, stations")
    flags = rows.rows[rows.at][1].split()
    rows.at += 1
    n, blades = rows.take(2, "II Nblds")
    left = len(rows.rows) - rows.at
    if min(left, as_count(n)) < n:
        rows.add(rows.rows[-1][0], number_of(min(left, as_count(n)), "station"), f"{n:g}")
    table = rows.table(as_count(n), 4, "r/R C/R Beta0deg Ubody")
    rows.check()
    notes = ["compressibility: effects of the case instead of XROTOR's Mcrit"]
    if len(flags) > 1 and flags[1].upper().startswith("T"):
        notes.append("the file has XROTOR's duct option on: read as an open rotor")
    if rake != 0.0:
        notes.append(f"rake {rake:g} is left out")
    if np.any(table[:, 3] != 0.0):
        notes.append("the velocity of a body (Ubody) is left out")
    rpm = V / (R * adv) * 30.0 / math.pi if adv > 0.0 and V > 0.0 else None
    air = rho if 0.01 < rho < 10.0 else None
    x = np.array([s[0] for s in sections])
    if np.any(np.diff(x) <= 0.0):
        rows.add("sections", f"r/R {x.tolist()}", "ascending")
    r, c, beta = table[:, 0] * R, table[:, 1] * R, np.radians(table[:, 2])
    point = (rpm, V if rpm else None, air)
    return rows.finish(
        BladeFile(name, "XROTOR", as_count(blades), R, hub * R, r, c, beta, sections, *point, tuple(notes))
    )

"""XROTOR: saved rotors of version 6.9 and later."""

from __future__ import annotations

import math
import os
import re

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.readers import SourceText, head_text, load_text
from bemt.readers._blade import BladeFile, checked, lines_of, values, whole
from bemt.sections.parametric import XrotorSection

KIND = "xrotor"
BLADE = True
_HEAD = re.compile(r"\s*XROTOR\s+VERSION", re.I)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file begins as XROTOR's SAVE writes it.

    >>> sniff("XROTOR VERSION:  7.55\nblade\n"), sniff("DFDC Version 0.55\n")
    (True, False)
    """
    return _HEAD.match(head_text(head)) is not None


def read_section(
    source: SourceText, rows: list[tuple[int, str]], at: int, faults: list[Fault]
) -> tuple[float, XrotorSection]:
    """Five lines of a section, of XROTOR and of DFDC: r/R, lift, stall, drag, Reynolds number."""
    got = []
    for k, (count, what) in enumerate(
        (
            (1, "r/R of a section"),
            (4, "A0deg dCLdA CLmax CLmin"),
            (4, "dCLdAstall dCLstall Cmconst Mcrit"),
            (3, "CDmin CLCDmin dCDdCL^2"),
            (2, "REref REexp"),
        )
    ):
        if at + k >= len(rows):
            raise InputError([*faults, Fault(source.name, str(len(source.lines)), "the end of the file", what)])
        got.append(values(source, *rows[at + k], count, what, faults))
    (x,), (a0, slope, top, bottom), (stall, span, cm, mcrit), (least, middle, bend), (reref, reexp) = got
    line = str(rows[at][0])
    if not 0.5 <= slope <= 15.0:
        faults.append(Fault(source.name, line, f"a lift slope of {slope:g}", "0.5 to 15 per radian", "Per degree?"))
    if not (span > 0.0 and reref > 0.0 and least > 0.0):
        faults.append(
            Fault(source.name, line, f"dCLstall {span:g}, REref {reref:g}, CDmin {least:g}", "values above 0")
        )
    return x, XrotorSection(
        math.radians(a0), slope, top, bottom, stall, span, least, middle, bend, reref, reexp, cm, mcrit
    )


def read(path: str | os.PathLike[str]) -> BladeFile:
    """Read one saved rotor."""
    source = load_text(path)
    rows = lines_of(source, "!#")
    faults: list[Fault] = []
    if len(rows) < 9 or not sniff(source.text):
        raise InputError(Fault(source.name, "1", repr(source.text[:30]), "XROTOR VERSION, a title and the rotor"))
    name = rows[1][1].strip()
    rho, vso, rmu, alt = values(source, *rows[2], 4, "Rho Vso Rmu Alt", faults)
    R, V, adv, rake = values(source, *rows[3], 4, "Rad Vel Adv Rake", faults)
    hub, _ = values(source, *rows[4], 2, "XI0 XIW", faults)
    count = values(source, *rows[5], 1, "Naero", faults)[0]
    if faults or not 1 <= count <= 50:
        raise InputError(faults or [Fault(source.name, str(rows[5][0]), f"{count:g} sections", "1 to 50")])
    at, sections = 6, []
    for _ in range(whole(count)):
        sections.append(read_section(source, rows, at, faults))
        at += 5
    if at + 1 >= len(rows):
        raise InputError([*faults, Fault(source.name, "", "the end of the file", "flags, stations")])
    flags = rows[at][1].split()
    n, blades = values(source, *rows[at + 1], 2, "II Nblds", faults)
    body = rows[at + 2 : at + 2 + whole(n)]
    if len(body) < n:
        faults.append(Fault(source.name, str(rows[-1][0]), f"{len(body)} stations", f"{n:g}"))
    table = np.array([values(source, *row, 4, "r/R C/R Beta0deg Ubody", faults) for row in body]).reshape(-1, 4)
    if faults:
        raise InputError(faults)
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
        faults.append(Fault(source.name, "sections", f"r/R {x.tolist()}", "ascending"))
    blade = BladeFile(
        name,
        "XROTOR",
        whole(blades),
        R,
        hub * R,
        table[:, 0] * R,
        table[:, 1] * R,
        np.radians(table[:, 2]),
        sections,
        rpm,
        V if rpm else None,
        air,
        tuple(notes),
    )
    return checked(source, blade, faults)

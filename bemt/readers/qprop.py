"""QPROP: propeller files."""

from __future__ import annotations

import math
import os

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.readers import head_text, load_text
from bemt.readers._blade import BladeFile, checked, lines_of, values, whole
from bemt.sections.parametric import QpropSection

KIND = "qprop"
BLADE = True
HEAD = (
    (1, "Nblades R"),
    (2, "CL0 CL_a"),
    (2, "CLmin CLmax"),
    (4, "CD0 CD2u CD2l CLCD0"),
    (2, "REref REexp"),
    (3, "Rfac Cfac Bfac"),
    (3, "Radd Cadd Badd"),
)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file has a title and the seven lines of numbers of a propeller file, then stations.

    >>> head = "6x3\n 2 .0762\n0.5 5.8\n-0.4 1.2\n.028 .05 .05 .5\n70000 -.7\n.0254 .0254 1\n0 0 0\n"
    >>> sniff(head + ".75 .66 27.5\n1 .69 22\n")
    True
    """
    rows = [t for t in head_text(head).splitlines() if t.strip() and t.lstrip()[0] not in "#!"]
    if len(rows) < 10:
        return False

    def count(text: str) -> int:
        words = text.split("!")[0].replace(",", " ").split()
        try:
            [float(w.replace("D", "e").replace("d", "e")) for w in words]
        except ValueError:
            return -1
        return len(words)

    wanted = [count(t) for t in rows[1:10]]
    fits = ((1, 2, 3), (2,), (2,), (3, 4), (2,), (3,), (3,))  # a short line of drag is told by `read`
    titled = not 1 <= count(rows[0]) <= 3
    return titled and all(n in fit for n, fit in zip(wanted, fits, strict=False)) and min(wanted[7:]) >= 3


def read(path: str | os.PathLike[str]) -> BladeFile:
    """Read one propeller file."""
    source = load_text(path)
    rows = lines_of(source, "#!")
    faults: list[Fault] = []
    if len(rows) < 10:
        raise InputError(Fault(source.name, "", f"{len(rows)} lines", "a title, seven lines of numbers, two stations"))
    got = [
        values(source, *row, n, what, faults, most=max(n, 2)) for row, (n, what) in zip(rows[1:8], HEAD, strict=True)
    ]
    body, widths = [], set()
    for line, text in rows[8:]:
        row = values(source, line, text, 3, "r c beta", faults, most=13)
        widths.add(len(row))
        body.append(row)
    if faults:
        raise InputError(faults)
    (blades, *given), (cl0, cla), (low, high), (cd0, cd2u, cd2l, clcd0), (reref, reexp), factor, offset = got
    basic = [cl0, cla, low, high, cd0, cd2u, cd2l, clcd0, reref, reexp]
    columns = np.array([row[:3] for row in body]) * factor + offset
    r, c, b = columns.T
    R = given[0] if given and given[0] > 0.0 else float(r[-1])
    if not given or given[0] <= 0.0:
        notes = ["no tip radius in the file: that of the last station"]
    else:
        notes = []
    notes.append("the file has no hub radius: that of the first station; compressibility: effects of the case")
    full = [row[3:] + basic[len(row) - 3 :] for row in body]
    sections: list[tuple[float, QpropSection]] = [(0.0, QpropSection(*basic))]
    if widths != {3}:
        sections = [(float(x / R), QpropSection(*row)) for x, row in zip(r, full, strict=True)]
    for k, (_, s) in enumerate(sections):
        if not (0.5 <= s.cla <= 15.0 and s.reref > 0.0 and s.cd0 > 0.0 and s.clmin < s.clmax):
            faults.append(
                Fault(
                    source.name,
                    f"section {k + 1}",
                    f"CL_a {s.cla:g}, CD0 {s.cd0:g}, CLmin {s.clmin:g}, CLmax {s.clmax:g}",
                    "a slope per radian from 0.5 to 15, drag above 0, CLmin < CLmax",
                )
            )
    if math.isfinite(R) and R > 1.5 * r[-1]:
        beside = f"R = {R:g} m with a last radius of {r[-1]:g} m"
        faults.append(Fault(source.name, str(rows[1][0]), beside, "a tip near it", "R takes no Rfac: metres"))
    if blades != whole(blades):
        faults.append(Fault(source.name, str(rows[1][0]), f"{blades:g} blades", "a whole number"))
    if math.isfinite(R) and not R * (1 + 1e-9) >= r[-1]:
        faults.append(
            Fault(
                source.name,
                str(rows[1][0]),
                f"R = {R:g}",
                f"at least the last radius, {r[-1]:g} m",
                "R is in metres, whatever Rfac is",
            )
        )
    blade = BladeFile(
        rows[0][1].strip(), "QPROP", whole(blades), R, float(r[0]), r, c, np.radians(b), sections, notes=tuple(notes)
    )
    return checked(source, blade, faults)

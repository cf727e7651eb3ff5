"""QPROP: propeller files."""

from __future__ import annotations

import math
import os

import numpy as np

from bemt.base.tables import number_of
from bemt.data.readers import head_text
from bemt.data.readers.blade import BladeFile, Cursor, as_count
from bemt.physics.sections.parametric import QpropSection

KIND = "qprop"
BLADE = True
HEAD = (
    (1, "Nblades R"), (2, "CL0 CL_a"), (2, "CLmin CLmax"), (4, "CD0 CD2u CD2l CLCD0"), (2, "REref REexp"),
    (3, "Rfac Cfac Bfac"), (3, "Radd Cadd Badd"),
)  # fmt: skip


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
    rows = Cursor(path, "#!")
    if len(rows.rows) < 10:
        rows.refuse("", number_of(len(rows.rows), "line"), "a title, seven lines of numbers, two stations")
    rows.at, line = 1, rows.rows[1][0]
    got = [rows.take(n, what, max(n, 2)) for n, what in HEAD]
    body = [rows.take(3, "r c beta", 13) for _ in rows.rows[8:]]
    rows.check()
    (blades, *given), (cl0, cla), (low, high), drag, reynolds, factor, offset = got
    basic = [cl0, cla, low, high, *drag, *reynolds]
    r, c, b = (np.array([row[:3] for row in body]) * factor + offset).T
    stated = bool(given and given[0] > 0.0)
    R = given[0] if stated else float(r[-1])
    notes = [] if stated else ["no tip radius in the file: that of the last station"]
    notes.append("the file has no hub radius: that of the first station; compressibility: effects of the case")
    sections: list[tuple[float, QpropSection]] = [(0.0, QpropSection(*basic))]
    if {len(row) for row in body} != {3}:
        full = [row[3:] + basic[len(row) - 3 :] for row in body]
        sections = [(float(x / R), QpropSection(*row)) for x, row in zip(r, full, strict=True)]
    for k, (_, s) in enumerate(sections):
        if not (0.5 <= s.cla <= 15.0 and s.reref > 0.0 and s.cd0 > 0.0 and s.clmin < s.clmax):
            told = f"CL_a {s.cla:g}, CD0 {s.cd0:g}, CLmin {s.clmin:g}, CLmax {s.clmax:g}"
            rows.add(f"section {k + 1}", told, "a slope per radian from 0.5 to 15, drag above 0, CLmin < CLmax")
    last = f"{r[-1]:g} m"
    if math.isfinite(R) and R > 1.5 * r[-1]:
        rows.add(line, f"R = {R:g} m with a last radius of {last}", "a tip near it", "R takes no Rfac: metres")
    if blades != as_count(blades):
        rows.add(line, f"{blades:g} blades", "a whole number")
    if math.isfinite(R) and not R * (1 + 1e-9) >= r[-1]:
        rows.add(line, f"R = {R:g}", f"at least the last radius, {last}", "R is in metres, whatever Rfac is")
    name, beta = rows.rows[0][1].strip(), np.radians(b)
    return rows.finish(
        BladeFile(name, "QPROP", as_count(blades), R, float(r[0]), r, c, beta, sections, notes=tuple(notes))
    )

"""C81 airfoil tables: lift and drag over angle of attack and Mach number, fixed width.

Layout, as written in the format notes of its users (Fortran edit descriptors)::

    name, NML NAL NMD NAD NMM NAM           A30, 6I2
    Mach numbers of the lift table          7X, 9F7.0   (more than nine continue on lines of the same form)
    alpha, cl at each Mach number           10F7.0 / (7X, 9F7.0)
    ... the same for drag and for the pitching moment

NM is the count of Mach numbers and NA that of angles [deg]. The pitching moment is not used.
"""

from __future__ import annotations

import math
import os

import numpy as np
from numpy.typing import NDArray

from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.data.readers.polars import PolarRow, assemble
from bemt.physics.sections.polars import Polar

KIND = "polar_c81"

WIDTH = 7
_PER_LINE = 9
_HINT = "C81 fields are 7 characters wide, nine values after the first field"


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a file begins with a name, six counts of two digits and a line of Mach numbers.

    >>> sniff("NACA 0012".ljust(30) + " 2 3 2 3 0 0\n" + 7 * " " + "   0.00   0.50\n")
    True
    >>> sniff("alpha,cl,cd")
    False
    """
    lines = head_text(head).splitlines()
    if len(lines) < 2 or _counts(lines[0]) is None or lines[1][:WIDTH].strip():
        return False
    mach = [number(lines[1][k : k + WIDTH]) for k in range(WIDTH, len(lines[1].rstrip()), WIDTH)]
    return bool(mach) and all(m is not None and 0.0 <= m <= 2.0 for m in mach)


def resembles(text: str) -> bool:
    """Whether a text begins as a C81 table does and goes on in columns of another width."""
    lines = text.splitlines()
    mach = [number(cell) for cell in lines[1].split()] if len(lines) > 1 else []
    return bool(lines) and _counts(lines[0]) is not None and len(mach) > 1 and None not in mach


def read(path: str | os.PathLike[str]) -> Polar:
    """Read a C81 table."""
    source = load_text(path)
    lines = source.lines
    counts = _counts(lines[0]) if lines else None
    if counts is None:
        got = repr(lines[0][30:42]) if lines else "an empty file"
        source.refuse("1:31", got, "six counts of two digits in columns 31 to 42", _HINT)
    at = 1
    tables = []
    for name, n_mach, n_alpha in (("lift", counts[0], counts[1]), ("drag", counts[2], counts[3])):
        table, at = _table(source, name, at, n_mach, n_alpha)
        tables.append(table)
    source.check()
    (a_l, m_l, cl, rows_l), (a_d, m_d, cd, _) = tables
    mach = np.union1d(m_l, m_d)
    alpha = np.union1d(a_l, a_d)
    alpha = alpha[(alpha >= max(a_l[0], a_d[0])) & (alpha <= min(a_l[-1], a_d[-1]))]
    cl, cd = _spread(a_l, m_l, cl, alpha, mach), _spread(a_d, m_d, cd, alpha, mach)
    line = {a: n for a, n in zip(a_l.tolist(), rows_l, strict=True)}
    rows = [
        PolarRow(line.get(a, rows_l[0]), math.radians(a), float(cl[i, j]), float(cd[i, j]), None, float(m))
        for j, m in enumerate(mach.tolist())
        for i, a in enumerate(alpha.tolist())
    ]
    notes = [] if np.array_equal(a_l, a_d) and np.array_equal(m_l, m_d) else ["lift and drag interpolated to one grid"]
    return assemble(source, rows, name=lines[0][:30].strip(), kind="C81", notes=notes)


def _counts(line: str) -> tuple[int, ...] | None:
    """Six counts of the first line, or None."""
    fields = [line[30 + 2 * k : 32 + 2 * k].strip() for k in range(6)]
    if len(line) < 38 or any(f and not f.isdigit() for f in fields) or line[42:].strip():
        return None
    counts = tuple(int(f or "0") for f in fields)
    return counts if min(counts[:4]) >= 1 else None


_Table = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], list[int]]


def _table(source: SourceText, name: str, at: int, n_mach: int, n_alpha: int) -> tuple[_Table, int]:
    """Angles, Mach numbers, values (Na, Nm) and line numbers of one table, and the index of the line behind it."""
    mach, _, at = _record(source, name, at, n_mach, False)
    alpha, values, numbers = [], [], []
    for _ in range(n_alpha):
        numbers.append(at + 1)
        row, first, at = _record(source, name, at, n_mach, True)
        alpha.append(first)
        values.append(row)
    for axis, label in ((mach, "Mach numbers"), (alpha, "angles")):
        fresh = np.diff(axis)
        if not np.any(np.isnan(axis)) and np.any(fresh <= 0.0):
            k = int(np.flatnonzero(fresh <= 0.0)[0])
            got = f"{label} {axis[k]:g}, {axis[k + 1]:g}"
            where = str(numbers[k + 1] if label == "angles" else numbers[0] - 1)
            source.add(where, got, f"ascending {label} in the {name} table")
    return (np.array(alpha), np.array(mach), np.array(values).reshape(n_alpha, n_mach), numbers), at


def _record(source: SourceText, name: str, at: int, count: int, leading: bool) -> tuple[list[float], float, int]:
    """Values of one record with its continuation lines, its first field, and the index of the next line."""
    end, last = at + -(-count // _PER_LINE), len(source.lines)
    first = _field(source, at, 0, "an angle in degrees") if leading and at < last else math.nan
    places = [(at + k // _PER_LINE, 1 + k % _PER_LINE) for k in range(count)]
    values = [_field(source, line, k, "a number") if line < last else math.nan for line, k in places]
    cut = source.fault(last, f"the end of the file in the {name} table", "more lines", _HINT)
    source.faults += [cut] if end > last and cut not in source.faults else []
    return values, first, min(end, last)


def _field(source: SourceText, at: int, k: int, expected: str) -> float:
    """One fixed-width number; NaN and a fault when it is none."""
    text = source.lines[at][k * WIDTH : (k + 1) * WIDTH]
    value = number(text)
    if value is None:
        source.add(f"{at + 1}:{k * WIDTH + 1}", repr(text), expected, _HINT)
        return math.nan
    return value


def _spread(
    a0: NDArray[np.float64], m0: NDArray[np.float64], table: NDArray[np.float64], alpha: NDArray[np.float64],
    mach: NDArray[np.float64],
) -> NDArray[np.float64]:  # fmt: skip
    """Table (Na0, Nm0) on other axes, linear, held at the ends."""
    on_alpha = np.stack([np.interp(alpha, a0, table[:, j]) for j in range(m0.size)], axis=1)
    return np.stack([np.interp(mach, m0, on_alpha[i]) for i in range(alpha.size)], axis=0)

"""Section polars as delimited text, and the checks that all polar importers share.

The header line names the columns with their units: ``alpha_deg`` or ``alpha_rad``, ``cl``, ``cd``, and optionally
``Re`` and ``Mach`` (any case, any order; comma, semicolon or tab). Lines that begin with ``#`` are comments. Rows of
several Reynolds or Mach numbers may be mixed; together they fill a rectangle of Re x Mach.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.physics.sections.extrapolation import ExtrapolatedTable, from_tables
from bemt.physics.sections.polars import Polar

KIND = "polar_csv"

NO_RE = 1e5
"""Stands in for the Reynolds number of a source that states none (a polar of one Re ignores it)."""
MIN_SPAN_DEG = 5.0
"""Positive angles that a polar must reach."""
_NAMES = {"alpha_deg": "alpha_deg", "alpha_rad": "alpha_rad", "cl": "cl", "cd": "cd", "re": "Re", "reynolds": "Re",
          "mach": "Mach", "m": "Mach"}  # fmt: skip


@dataclass(frozen=True)
class PolarRow:
    """One line of polar data."""

    line: int  # Line in the file, from 1
    # Angle of attack [rad], lift and drag coefficients [-]
    alpha: float
    cl: float
    cd: float
    Re: float | None = None  # Chord Reynolds number; None when the source states none [-]
    M: float = 0.0  # Mach number [-]


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line that is no comment is a header of alpha, cl and cd.

    >>> sniff("alpha_deg,cl,cd"), sniff("# polar\nRe;alpha;CL;CD"), sniff("rpm,thrust_N")
    (True, True, False)
    """
    for line in head_text(head).splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            cells = [c.lower() for c in _cells(line)]
            return len(cells) > 2 and {"cl", "cd"} <= set(cells) and any(c.startswith("alpha") for c in cells)
    return False


def read(path: str | os.PathLike[str]) -> Polar:
    """Read a delimited polar file."""
    source = load_text(path)
    lines = [(i, text) for i, text in enumerate(source.lines, 1) if text.strip() and not text.lstrip().startswith("#")]
    if not lines:
        source.refuse("", "no data", "a header line and rows")
    columns, ignored = _header(source, *lines[0])
    source.check()
    rows = []
    for line, text in lines[1:]:
        cells = _cells(text)
        value: dict[str, float] = {}
        for name, k in columns.items():
            got = cells[k] if k < len(cells) else ""
            if (found := number(got)) is not None:
                value[name] = found
                continue
            hint = "Write the decimal point as ." if re.fullmatch(r"[+-]?\d+,\d+", got) else ""
            source.add(f"{line}:{k + 1}", repr(got), f"a number for {name}", hint)
        if len(value) == len(columns):
            alpha = value["alpha_rad"] if "alpha_rad" in value else math.radians(value["alpha_deg"])
            rows.append(PolarRow(line, alpha, value["cl"], value["cd"], value.get("Re"), value.get("Mach", 0.0)))
    notes = [f"column ignored: {c}" for c in ignored]
    return assemble(source, rows, radians="alpha_rad" in columns, notes=notes)


def row_of(
    source: SourceText, line: int, cells: Sequence[str], Re: float | None, M: float = 0.0,
    names: tuple[str, str, str] = ("alpha", "cl", "cd"),
) -> list[PolarRow]:  # fmt: skip
    """One row that begins with alpha [deg], cl, cd as a list of one, or of none with a fault."""
    values = [number(c) for c in cells[:3]]
    bad = next((k for k, v in enumerate(values) if v is None), len(values))
    if bad < 3:
        got = repr(cells[bad]) if bad < len(cells) else "the end of the line"
        source.add(f"{line}:{bad + 1}", got, f"{names[bad]} as a number")
        return []
    alpha, cl, cd = (float(v or 0.0) for v in values)
    return [PolarRow(line, math.radians(alpha), cl, cd, Re, M)]


def _cells(line: str) -> list[str]:
    """Cells of a line; the first of ; tab , that occurs separates."""
    mark = next((m for m in (";", "\t", ",") if m in line), ",")
    return [c.strip().strip('"') for c in line.split(mark)]


def _header(source: SourceText, line: int, text: str) -> tuple[dict[str, int], list[str]]:
    """Columns by their meaning, and ignored names."""
    columns: dict[str, int] = {}
    ignored = []
    for k, cell in enumerate(_cells(text)):
        where, key = f"{line}:{k + 1}", cell.lower()
        name = _NAMES.get(key)
        if name is None and (key.startswith("alpha") or key in ("aoa", "angle")):
            source.add(where, repr(cell), "alpha_deg or alpha_rad", "Name the unit of the angle")
        elif name is None and (key.startswith(("re_", "re ", "reynolds")) or key == "re(million)"):
            source.add(where, repr(cell), "Re", "Give the plain Reynolds number")
        elif name is None:
            ignored.append(cell)
        elif name in columns:
            source.add(where, f"a second {name}", "each column once")
        else:
            columns[name] = k
    angles = [c for c in columns if c.startswith("alpha")]
    if len(angles) > 1:
        source.add(line, "alpha_deg and alpha_rad", "one of them", "Drop one column")
    if not angles and not source.faults:
        source.add(line, "no angle of attack", "a column alpha_deg or alpha_rad")
    for name in ("cl", "cd"):
        if name not in columns:
            source.add(line, f"no column {name}", f"a column {name}")
    return columns, ignored


def assemble(
    source: SourceText, rows: Sequence[PolarRow], *, name: str = "", kind: str = "CSV", radians: bool = False,
    notes: Sequence[str] = (),
) -> Polar:  # fmt: skip
    """Check rows of any polar format and make the Polar."""
    said = list(notes)
    _doubts(source, rows, radians)
    groups: dict[tuple[float, float], dict[float, PolarRow]] = {}
    for row in rows:
        group = groups.setdefault((NO_RE if row.Re is None else row.Re, row.M), {})
        old = group.setdefault(round(row.alpha, 9), row)
        if old is not row and (old.cl, old.cd) != (row.cl, row.cd):
            got = f"another row at {math.degrees(row.alpha):.6g} deg (line {old.line} has other values)"
            source.add(row.line, got, "each angle once per Reynolds and Mach number")
        elif old is not row:
            said.append(f"line {row.line} repeats line {old.line}")
    tables = []
    for (reynolds, mach), group in sorted(groups.items()):
        used = [group[a] for a in sorted(group)]
        lo, hi = (math.degrees(used[k].alpha) for k in (0, -1))
        label = f" at Re {reynolds:.4g}, Mach {mach:g}" if len(groups) > 1 else ""
        if not rows or lo > 0.0 or hi < MIN_SPAN_DEG or len(used) < 3:
            got = f"{len(used)} angles from {lo:.4g} to {hi:.4g} deg{label}"
            source.add("", got, f"three or more that hold 0 and reach {MIN_SPAN_DEG:g} deg")
        columns = np.array([(r.alpha, r.cl, r.cd) for r in used])
        columns[0, 0], columns[-1, 0] = (_snap(columns[k, 0]) for k in (0, -1))
        tables.append(ExtrapolatedTable(columns[:, 0], columns[:, 1], columns[:, 2], reynolds, mach))
    if not rows and not source.faults:
        source.add("", "no rows", "rows of alpha, cl and cd")
    sizes = len({r for r, _ in groups}), len({m for _, m in groups})
    if len(groups) != sizes[0] * sizes[1]:
        got = f"{len(groups)} pairs of {sizes[0]} Reynolds and {sizes[1]} Mach numbers"
        source.add("", got, "every pair", "Give one file per Mach number")
    source.check()
    if rows[0].Re is None:
        said.append("the source states no Reynolds number")
    label = f"{kind} {Path(source.name).name} (sha256 {source.sha256[:12]})"
    return from_tables(tables, name=name or Path(source.name).stem, source=label, notes=said)


def _snap(alpha: float) -> float:
    """Exactly +-pi for 180 deg that lost its last digits."""
    return math.copysign(math.pi, alpha) if abs(abs(alpha) - math.pi) < 1e-4 else alpha


def _doubts(source: SourceText, rows: Sequence[PolarRow], radians: bool) -> None:
    """Faults of magnitude: units are never converted on suspicion, but refused with a hint."""
    for row in rows:
        if row.cd <= 0.0:
            source.add(row.line, f"cd = {row.cd:g}", "a drag coefficient above 0")
        if abs(row.cl) > 5.0:
            source.add(row.line, f"cl = {row.cl:g}", "a lift coefficient within +-5", "Are columns swapped?")
        if row.Re is not None and not 1e3 <= row.Re <= 1e9:
            hint = "Millions? Write 0.1 million as 1e5" if 0.0 < row.Re < 1e3 else ""
            source.add(row.line, f"Re = {row.Re:g}", "a Reynolds number from 1e3 to 1e9", hint)
        if not 0.0 <= row.M <= 1.5:
            source.add(row.line, f"Mach = {row.M:g}", "a Mach number from 0 to 1.5")
    if not rows:
        return
    alpha = np.array([r.alpha for r in rows])
    lo, hi = (float(v) for v in (alpha.min(), alpha.max()))
    if radians and max(-lo, hi) > math.pi + 1e-4:
        got, hint = f"alpha_rad from {lo:.4g} to {hi:.4g}", "The span looks like degrees: name the column alpha_deg"
        source.add("", got, "angles within +-pi rad", hint)
    elif not radians and max(-lo, hi) > math.pi * (1.0 + 1e-6):
        got = f"angles from {math.degrees(lo):.6g} to {math.degrees(hi):.6g} deg"
        source.add("", got, "angles within +-180 deg", "Give angles above 180 deg as negative ones")
    elif not radians and math.degrees(max(-lo, hi)) <= math.pi + 1e-3:
        got = f"angles from {math.degrees(lo):.4g} to {math.degrees(hi):.4g} in a column of degrees"
        source.add("", got, f"degrees that reach {MIN_SPAN_DEG:g}", "The span looks like radians")
    least, bluff = min(r.cd for r in rows), all(abs(r.cl) < 1e-3 for r in rows)  # a round blade root has no lift
    if least > (2.0 if bluff else 0.2):
        got = f"a least cd of {least:g}"
        source.add("", got, "a least cd below 0.2", "Drag counts, or columns swapped? cd is not scaled")

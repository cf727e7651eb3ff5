"""Section polars: delimited text, files of XFOIL and C81, and the checks that they share.

The header line names the columns with their units: ``alpha_deg`` or ``alpha_rad``, ``cl``, ``cd``, and optionally
``Re`` and ``Mach`` (any case, any order; comma, semicolon or tab). Lines that begin with ``#`` are comments. Rows of
several Reynolds or Mach numbers may be mixed; together they fill a rectangle of Re x Mach.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.data.readers import Reader, SourceText, head_text, load_text, number, slices
from bemt.physics.sections.polars import ExtrapolatedTable, Polar, from_tables

POLAR_CSV = "polar_csv"

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


def sniff_polar_csv(head: bytes | str) -> bool:
    r"""Tell whether the first line that is no comment is a header of alpha, cl and cd.

    >>> sniff_polar_csv("alpha_deg,cl,cd"), sniff_polar_csv("# polar\nRe;alpha;CL;CD"), sniff_polar_csv("rpm,thrust_N")
    (True, True, False)
    """
    for line in head_text(head).splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            cells = [c.lower() for c in _cells(line)]
            known = len(cells) > 2 and {"cl", "cd"} <= set(cells) and any(c.startswith("alpha") for c in cells)
            return known and not slices.sniff(line)  # sections along a blade are no polar
    return False


def read_polar_csv(path: str | os.PathLike[str]) -> Polar:
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


def _by_condition(
    source: SourceText, rows: Sequence[PolarRow], said: list[str]
) -> dict[tuple[float, float], dict[float, PolarRow]]:
    """Rows by Reynolds and Mach number and by angle; an angle that comes again is told, or a fault."""
    groups: dict[tuple[float, float], dict[float, PolarRow]] = {}
    for row in rows:
        old = groups.setdefault((NO_RE if row.Re is None else row.Re, row.M), {}).setdefault(round(row.alpha, 9), row)
        if (old.cl, old.cd) != (row.cl, row.cd):
            got = f"another row at {math.degrees(row.alpha):.6g} deg (line {old.line} has other values)"
            source.add(row.line, got, "each angle once per Reynolds and Mach number")
        elif old is not row:
            said.append(f"line {row.line} repeats line {old.line}")
    return groups


def assemble(
    source: SourceText, rows: Sequence[PolarRow], *, name: str = "", kind: str = "CSV", radians: bool = False,
    notes: Sequence[str] = (),
) -> Polar:  # fmt: skip
    """Check rows of any polar format and make the Polar."""
    said = list(notes)
    _doubts(source, rows, radians)
    groups = _by_condition(source, rows, said)
    tables = []
    for (reynolds, mach), group in sorted(groups.items()):
        used = [group[a] for a in sorted(group)]
        lo, hi = (math.degrees(used[k].alpha) for k in (0, -1))
        label = f" at Re {reynolds:.4g}, Mach {mach:g}" if len(groups) > 1 else ""
        if lo > 0.0 or hi < MIN_SPAN_DEG or len(used) < 3:
            got = f"{len(used)} angles from {lo:.4g} to {hi:.4g} deg{label}"
            source.add("", got, f"three or more that hold 0 and reach {MIN_SPAN_DEG:g} deg")
        alpha, cl, cd = np.array([(r.alpha, r.cl, r.cd) for r in used]).T
        # 180 deg that lost its last digits is exactly +-pi
        alpha[[0, -1]] = [math.copysign(math.pi, a) if abs(abs(a) - math.pi) < 1e-4 else a for a in alpha[[0, -1]]]
        tables.append(ExtrapolatedTable(alpha, cl, cd, reynolds, mach))
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


_EACH: tuple[tuple[str, str, float, float, str, str], ...] = (
    ("cd", "cd", 5e-324, math.inf, "a drag coefficient above 0", ""),
    ("cl", "cl", -5.0, 5.0, "a lift coefficient within +-5", "Are columns swapped?"),
    ("Re", "Re", 1e3, 1e9, "a Reynolds number from 1e3 to 1e9", "Millions? Write 0.1 million as 1e5"),
    ("M", "Mach", 0.0, 1.5, "a Mach number from 0 to 1.5", ""),
)
"""Of each row: attribute, its name, least and largest value, words, hint (of Re: below 1000)."""


def _doubts(source: SourceText, rows: Sequence[PolarRow], radians: bool) -> None:
    """Faults of magnitude: units are never converted on suspicion, but refused with a hint."""
    for row in rows:
        for attribute, word, low, high, expected, hint in _EACH:
            value = getattr(row, attribute)
            if value is not None and not low <= value <= high:
                why = hint if word != "Re" or 0.0 < value < low else ""
                source.add(row.line, f"{word} = {value:g}", expected, why)
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


# Polar save files of XFOIL (``PACC``), of XFLR5 and XOptFoil that write the same layout, and the CSV of airfoiltools.
#
# One file holds one Reynolds number::
#
#     Calculated polar for: NACA 4412
#     1 1 Reynolds number fixed          Mach number fixed
#     xtrf =   1.000 (top)        1.000 (bottom)
#     Mach =   0.000     Re =     0.100 e 6     Ncrit =   9.000
#      alpha    CL        CD       CDp       CM     Top_Xtr  Bot_Xtr
#     ------ -------- --------- --------- -------- -------- --------
#
# XFLR5 may put commas between the cells. The CSV of airfoiltools.com says the same in other words::
#
#     Xfoil polar. Reynolds number fixed. Mach  number fixed
#     Airfoil,n0012-il
#     Reynolds number,100000
#     Ncrit,9
#     Mach,0
#     Alpha,Cl,Cd,Cdp,Cm,Top_Xtr,Bot_Xtr
#
# Several such files make one polar with `read_many`.

POLAR_XFOIL = "polar_xfoil"

_TITLE = re.compile(r"Calculated polar for:[ \t]*(.*?)[ \t]*$", re.M)
_STATE = re.compile(r"Mach\s*=\s*(\S+)\s+Re\s*=\s*(\S+)\s*e\s*(\d+)\s+Ncrit\s*=\s*(\S+)", re.I)
_TYPE = re.compile(r"^\s*\d+\s+\d+\s+Reynolds number\s+(.*?)\s{2,}Mach number\s+(.*?)\s*$", re.M)
_HEADER = re.compile(r"\s*alpha\s*[,;\s]\s*CL\s*[,;\s]\s*CD\b", re.I)
_SITE = re.compile(r"\s*Xfoil polar\. Reynolds number (\w+)\. Mach\s+number (\w+)", re.I)
_FACT = re.compile(r"^(Airfoil|Reynolds number|Ncrit|Mach)\s*[,;]\s*(.*?)[,;\s]*$", re.M)
_TRIP = re.compile(r"xtrf\s*=\s*(\S+)\s*\(top\)\s*(\S+)\s*\(bottom\)")


def sniff_polar_xfoil(head: bytes | str) -> bool:
    r"""Tell whether a file begins like an XFOIL polar.

    >>> [sniff_polar_xfoil(t) for t in ("  XFOIL  Version 6.99\n\n Calculated polar for: NACA 4412\n", "alpha,cl,cd")]
    [True, False]
    """
    text = head_text(head)
    return _TITLE.search(text) is not None or _SITE.match(text) is not None


def read_polar_xfoil(path: str | os.PathLike[str]) -> Polar:
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


def _state(source: SourceText, text: str) -> tuple[float | None, float, list[str]]:
    """Reynolds and Mach number of the run, and a note."""
    state = _STATE.search(text)
    if state is None:
        got, hint = "no line 'Mach = ... Re = ... e 6 Ncrit = ...'", "Save the polar with viscous mode on"
        source.add("", got, "the state of the run", hint)
        return None, 0.0, []
    mach, millions, ncrit = (number(state[k]) for k in (1, 2, 4))
    line = text.count("\n", 0, state.start()) + 1
    if mach is None or millions is None or ncrit is None:
        source.add(line, repr(state[0]), "numbers for Mach, Re and Ncrit")
        return None, 0.0, []
    if millions == 0.0:
        hint = "XFOIL prints three decimals of millions: set Re by hand if it is below 500"
        source.add(line, "Re = 0", "a Reynolds number above 0 (viscous run)", hint)
    return millions * 10.0 ** int(state[3]) or None, mach, [f"Ncrit {ncrit:g}"]


def _parse(source: SourceText) -> tuple[str, list[PolarRow], list[str]]:
    """Name, rows and notes of one file."""
    text = _rewritten(source.text)
    title, kind, trip = (p.search(text) for p in (_TITLE, _TYPE, _TRIP))
    if title is None:
        source.add("", "no line 'Calculated polar for:'", "an XFOIL polar save file")
    if kind and {kind[1].lower(), kind[2].lower()} != {"fixed"}:
        got = f"Reynolds number {kind[1]}, Mach number {kind[2]}"
        source.add(text.count("\n", 0, kind.end()) + 1, got, "a polar of type 1 (both fixed)", "Run XFOIL with TYPE 1")
    reynolds, mach, notes = _state(source, text)
    if trip and trip.groups() != ("1.000", "1.000"):
        notes.append(f"forced transition at x/c {trip[1]} (top), {trip[2]} (bottom)")
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
    return (title[1] if title else ""), rows, notes


READERS = (
    Reader(POLAR_CSV, sniff_polar_csv, read_polar_csv),
    Reader(POLAR_XFOIL, sniff_polar_xfoil, read_polar_xfoil),
)

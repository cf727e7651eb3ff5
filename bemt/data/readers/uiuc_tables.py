"""Tables of the UIUC Propeller Database: one reader per header, see :mod:`bemt.data.readers.uiuc`."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.data.readers.uiuc_names import parse_file_name

NO_SPEED = "no rpm in the file name"
"""What is missing where a line over advance ratio has no name of the database."""
_COLUMNS = {
    "geom": ("r/R", "c/R", "beta"), "static": ("RPM", "CT", "CP"), "line": ("J", "CT", "CP", "eta"),
    "thick": ("r/R", "t/c"),
}  # fmt: skip
_RANGES: dict[str, tuple[float, float, str]] = {  # outside: a wrong column or unit, refused with this hint
    "r/R": (0.0, 1.05, "Is this a radius in mm or in?"),
    "c/R": (0.0, 1.5, "Is this a chord in mm or in?"),
    "beta": (-30.0, 90.0, "Blade angles are in degrees"),
    "t/c": (0.0, 1.0, "Is this in percent?"),
    "RPM": (100.0, 200000.0, "Is this in rev/s or rad/s?"),
    "J": (-2.0, 5.0, "Are the columns J CT CP eta?"),
    "CT": (-1.0, 2.0, "Is this a rotor-convention or dimensional value?"),
    "CP": (-1.0, 2.0, "Is this a rotor-convention or dimensional value?"),
}


@dataclass(frozen=True, eq=False)
class _UiucTable:
    """One file as arrays: ``file``, ``sha256``, ``rows`` (line numbers from 1), ``flags`` (per row, may be empty)."""

    file: str
    sha256: str
    rows: tuple[int, ...]
    flags: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class UiucGeometry(_UiucTable):
    """Blade stations: ``r_R``, ``c_R`` (N,), ``beta_deg`` (N,) [deg]; ``origin`` and ``rotation_deg`` as above."""

    r_R: Array
    c_R: Array
    beta_deg: Array
    origin: str = "own"
    rotation_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class UiucStatic(_UiucTable):
    """Static run: ``rpm`` (N,) [rev/min], ``CT``, ``CP`` (N,)."""

    rpm: Array
    CT: Array
    CP: Array
    run: str = ""


@dataclass(frozen=True, eq=False)
class UiucLine(_UiucTable):
    """Run over advance ratio at one nominal ``rpm`` [rev/min]: ``J``, ``CT``, ``CP``, ``eta`` (N,)."""

    rpm: float
    J: Array
    CT: Array
    CP: Array
    eta: Array
    run: str = ""


@dataclass(frozen=True, eq=False)
class UiucThickness(_UiucTable):
    """Thickness ratio ``t_c`` (N,) over ``r_R`` (N,)."""

    r_R: Array
    t_c: Array


def _plain(line: str) -> str:
    """Header without units in brackets."""
    return re.sub(r"\(.*?\)|\[.*?\]", " ", line)


def _header(text: str) -> tuple[int, str | None]:
    """Line number of the header and the role it announces (None: not a table of this archive)."""
    for index, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        names = _plain(line).lower().split()
        for role, columns in _COLUMNS.items():
            wanted = [c.lower() for c in columns]
            if names == wanted or (role == "line" and names == wanted[:3]):
                return index, role
        return index, None
    return 0, None


def role_of(head: bytes | str) -> str | None:
    r"""Tell which table the head of a file announces.

    >>> role_of("RPM    CT       CP\n")
    'static'
    """
    return _header(head_text(head))[1]


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the head of a file is a table of this archive.

    >>> sniff(b"J       CT       CP       eta\n0.1 0.1 0.05 0.2\n"), sniff("quantity,value,unit")
    (True, False)
    """
    return role_of(head) is not None


def _parse(source: SourceText, role: str) -> tuple[tuple[Array, ...], tuple[int, ...]]:
    """Columns of a file, lines of its rows; every row that is not exactly its columns of finite numbers is a fault."""
    at, found = _header(source.text)
    columns = _COLUMNS[role]
    if found != role:
        got = repr(source.lines[at - 1].strip()[:60]) if at else "no header"
        hint = f"This is a {found} table" if found else "Is the header line missing?"
        source.refuse(at or 1, got, f"the header {' '.join(columns)}", hint)
    columns = columns[: len(_plain(source.lines[at - 1]).split())]
    rows: dict[int, list[float | None]] = {}
    for index, line in enumerate(source.lines[at:], at + 1):
        tokens = line.split()
        if not tokens or tokens[0].startswith("#"):
            continue
        if len(tokens) != len(columns):
            hint = "Remove the trailing text" if len(tokens) > len(columns) else "The row is cut short"
            source.add(index, repr(line.strip()[:60]), f"{len(columns)} numbers ({' '.join(columns)})", hint)
            continue
        rows[index] = list(map(number, tokens))
        for column, (name, token, value) in enumerate(zip(columns, tokens, rows[index], strict=True), 1):
            low, high, hint = _RANGES.get(name, (-1e9, 1e9, ""))
            expected = f"{name} from {low:g} to {high:g}"
            if value is None:
                expected = "a finite number"
                hint = "Use a decimal point" if "," in token else "Delete the row or repair the value"
            if value is None or not low <= value <= high:
                source.add(f"{index}:{column}", f"{name} = {token}", expected, hint)
    if not rows and not source.faults:
        source.add("", "no rows", "one row or more")
    source.check()
    data = np.array([*rows.values()], dtype=float)
    return tuple(data.T.copy()), tuple(rows)


def _order_flags(x: Array, name: str) -> tuple[tuple[str, ...], ...]:
    """Flag rows that repeat or go back; real runs do (kept as recorded)."""
    step = np.diff(x, prepend=x[0] - 1.0)
    return tuple((f"{name} repeated",) if d == 0 else (f"{name} goes back",) if d < 0 else () for d in step)


def read_geometry(path: str | os.PathLike[str]) -> UiucGeometry:
    """Read one geometry file."""
    source = load_text(path)
    (r_R, c_R, beta), rows = _parse(source, "geom")
    for i in np.flatnonzero(np.diff(r_R) <= 0):
        source.add(f"{rows[i + 1]}:1", f"r/R = {r_R[i + 1]:g} after {r_R[i]:g}", "ascending r/R", "Sort rows")
    if len(r_R) < 3 or r_R[-1] < 0.9:
        got = f"{number_of(len(r_R), 'station')} to r/R = {r_R[-1]:g}"
        source.add("", got, "three stations or more up to r/R = 0.9", "Is the file cut off?")
    if np.max(np.abs(beta)) < 1.6:
        got = f"blade angles of at most {np.max(np.abs(beta)):g}"
        source.add("", got, "blade angles in degrees", "Are these radians?")
    source.check()
    return UiucGeometry(source.name, source.sha256, rows, ((),) * len(rows), r_R, c_R, beta)


def read_static(path: str | os.PathLike[str]) -> UiucStatic:
    """Read one static run (header ``RPM CT CP``); rows stay in the recorded order, flagged where rpm goes back."""
    source = load_text(path)
    (rpm, CT, CP), rows = _parse(source, "static")
    name = parse_file_name(Path(path).stem)
    run = name.run if name and name.role == "static" else ""
    return UiucStatic(source.name, source.sha256, rows, _order_flags(rpm, "rpm"), rpm, CT, CP, run)


def read_line(path: str | os.PathLike[str], rpm: float | None = None) -> UiucLine:
    """Read one advance-ratio run (header ``J CT CP eta``)."""
    source = load_text(path)
    name = parse_file_name(Path(path).stem)
    speed = rpm if rpm is not None else (name.rpm if name and name.role == "line" else None)
    if speed is None or not 100.0 <= speed <= 200000.0:
        got = NO_SPEED if speed is None else f"rpm {speed:g}"
        hint = "Name the file <family>_<size>_<run>_<rpm>.txt"
        source.add("", got, "rpm from 100 to 200000 as the last number of the name", hint)
    (J, CT, CP, *more), rows = _parse(source, "line")
    assert speed is not None  # told by _parse
    with np.errstate(divide="ignore", invalid="ignore"):
        ideal = np.where(CP != 0, J * CT / CP, np.nan)
        # four times the rounding of the printed digits (J 0.001, CT and CP 0.0001)
        slack = 4 * (0.0005 + np.abs(J / CP) * 5e-5 + np.abs(ideal) * 5e-5 / np.abs(CP) + np.abs(CT / CP) * 5e-4)
    eta = more[0] if more else ideal
    odd = np.abs(eta - ideal) > slack
    bad = np.flatnonzero(odd & (np.abs(eta - ideal) > 0.05 + 0.1 * np.abs(ideal)))
    if len(bad) > max(2, len(J) // 4):
        got = f"eta = {eta[bad[0]]:g} where J CT/CP = {ideal[bad[0]]:.3g}"
        hint = f"{len(bad)} of {len(J)} rows disagree: are columns exchanged?"
        source.refuse(rows[bad[0]], got, "eta = J CT/CP", hint)
    order = _order_flags(J, "J")
    flags = tuple(f + (("eta is not J CT/CP",) if o else ()) for f, o in zip(order, odd, strict=True))
    run = name.run if name and name.role == "line" else ""
    return UiucLine(source.name, source.sha256, rows, flags, float(speed), J, CT, CP, eta, run)


def read_thickness(path: str | os.PathLike[str]) -> UiucThickness:
    """Read one thickness file (header ``r/R t/c``)."""
    source = load_text(path)
    (r_R, t_c), rows = _parse(source, "thick")
    return UiucThickness(source.name, source.sha256, rows, _order_flags(r_R, "r/R"), r_R, t_c)

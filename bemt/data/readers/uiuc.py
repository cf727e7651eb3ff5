r"""UIUC Propeller Database: geometry, static runs and advance-ratio runs (volumes 1-4).

Every file is a table under one header line, blank separated::

    r/R c/R beta        geometry: radius and chord over tip radius, blade angle [deg]
    RPM CT CP           static run
    J CT CP eta         run over the advance ratio; the rpm is the last number of the file name
    r/R t/c             thickness ratio (``nr640_thick.txt``)

Coefficients are in the propeller convention: CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5), n in rev/s, J = V/(n D).
What the names say, and by which rules, is in :mod:`bemt.data.readers.uiuc_names`.

Geometry of a propeller, first rule that applies (``geometry.origin``):

* ``own``: its ``_geom`` file;
* ``shared``: 3- and 4-blade variants (``_3b``) carry the blades of the 2-blade propeller of the same name;
* ``rotated``: pitch variants of the 3D-printed families (``da4002``, ``da4022``, ``da4052``, ``nr640``) are the tested
  blade of the same family and diameter, nearest in nominal angle at r/R = 0.75 and turned by the difference (the site
  heads ``da4052_9x4.76`` as "-5 deg" of 9x6.75, and ``nr640_9_20deg`` beside 15 deg);
* ``design``: the family's design file (``da4002_geom``), turned likewise; its stations begin at r/R = 0.30.

Other families never lend geometry: their sizes are other moulds.

References
----------
J.B. Brandt, R.W. Deters, G.K. Ananda, O.D. Dantsker, M.S. Selig, UIUC Propeller Database, Vols 1-4, University of
Illinois at Urbana-Champaign, archive of 27 June 2022. R.W. Deters, G.K. Ananda, M.S. Selig, "Reynolds Number Effects on
the Performance of Small-Scale Propellers", AIAA 2014-2151, 2014.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of
from bemt.data.readers import HEAD_BYTES, SourceText, head_text, load_text, number
from bemt.data.readers.uiuc_names import VARIABLE_PITCH, UiucFile, UiucName, parse_file_name

KIND = "uiuc"
SOURCE = "UIUC Propeller Database (Brandt, Deters, Ananda, Dantsker, Selig), archive of 27 June 2022"

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


@dataclass(frozen=True, eq=False)
class UiucLine(_UiucTable):
    """Run over advance ratio at one nominal ``rpm`` [rev/min]: ``J``, ``CT``, ``CP``, ``eta`` (N,)."""

    rpm: float
    J: Array
    CT: Array
    CP: Array
    eta: Array


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
    return UiucStatic(source.name, source.sha256, rows, _order_flags(rpm, "rpm"), rpm, CT, CP)


def read_line(path: str | os.PathLike[str]) -> UiucLine:
    """Read one advance-ratio run (header ``J CT CP eta``)."""
    source = load_text(path)
    name = parse_file_name(Path(path).stem)
    speed = name.rpm if name else None
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
    return UiucLine(source.name, source.sha256, rows, flags, float(speed), J, CT, CP, eta)


def read_thickness(path: str | os.PathLike[str]) -> UiucThickness:
    """Read one thickness file (header ``r/R t/c``)."""
    source = load_text(path)
    (r_R, t_c), rows = _parse(source, "thick")
    return UiucThickness(source.name, source.sha256, rows, _order_flags(r_R, "r/R"), r_R, t_c)


_READERS: dict[str, Callable[[Path], Any]] = {
    "geom": read_geometry, "static": read_static, "line": read_line, "thick": read_thickness,
}  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class UiucPropeller(UiucName):
    """One propeller of the archive with all its data, beside what its name says."""

    diameter_in: float
    folder: str  # That holds the files
    geometry: UiucGeometry | None  # Stations, from this or a related propeller (``geometry.origin``)
    thickness: UiucThickness | None  # Thickness of its family, if published
    # Static runs; advance-ratio runs ascending in rpm
    statics: tuple[UiucStatic, ...]
    lines: tuple[UiucLine, ...]

    @property
    def diameter_m(self) -> float:
        """Nominal diameter. [m]."""
        return self.diameter_in * 0.0254

    @property
    def static(self) -> UiucStatic | None:
        """All static points as one table, or None; files joined by ``+``."""
        if len(self.statics) < 2:
            return self.statics[0] if self.statics else None
        tables = self.statics
        rpm, CT, CP = (np.concatenate([getattr(t, name) for t in tables]) for name in ("rpm", "CT", "CP"))
        file, sha256 = ("+".join(getattr(t, name) for t in tables) for name in ("file", "sha256"))
        rows, flags = sum((t.rows for t in tables), ()), sum((t.flags for t in tables), ())
        return UiucStatic(file, sha256, rows, flags, rpm, CT, CP)


@dataclass(frozen=True, eq=False)
class UiucFolder:
    """Outcome of a scan: propellers, what was refused (``faults``), and other files with the reason (``ignored``)."""

    propellers: tuple[UiucPropeller, ...]
    faults: tuple[Fault, ...]
    ignored: tuple[tuple[str, str], ...]


def _files(path: Path) -> Iterator[Path]:
    """Files below a folder in a fixed order, hidden ones left out."""
    for file in sorted(path.rglob("*")):
        if file.is_file() and not any(part.startswith(".") for part in file.relative_to(path).parts):
            yield file


def _head(file: Path) -> bytes:
    with file.open("rb") as stream:
        return stream.read(HEAD_BYTES)


def sniff_folder(path: Path) -> bool:
    """Tell whether a folder, or one below it, holds a table of this archive."""
    return any(sniff(_head(file)) for file in _files(path))


def _choose_geometry(name: UiucName, own: Mapping[str, tuple[UiucName, UiucGeometry]]) -> UiucGeometry | None:
    """Geometry of one propeller by the four rules of the module notes."""
    if name.name in own:
        return own[name.name][1]
    two_blade = re.sub(r"_\d+b(l|lades?)?(?=_|$)", "", name.name, flags=re.IGNORECASE)
    if two_blade in own and two_blade != name.family:
        return replace(own[two_blade][1], origin="shared")
    if name.family.lower() not in VARIABLE_PITCH or name.angle_deg is None:
        return None
    tested = [
        (abs(other.angle_deg - name.angle_deg), other.name, name.angle_deg - other.angle_deg, geometry)
        for other, geometry in own.values()
        if other.family == name.family and other.angle_deg is not None and other.diameter_in == name.diameter_in
    ]
    if tested:
        _, _, turn, geometry = min(tested, key=lambda row: row[:2])
        origin = "rotated"
    elif name.family in own:
        geometry, origin = own[name.family][1], "design"
        turn = name.angle_deg - float(np.interp(0.75, geometry.r_R, geometry.beta_deg))
    else:
        return None
    return replace(geometry, beta_deg=geometry.beta_deg + turn, origin=origin, rotation_deg=turn)


_Tables = dict[str, dict[str, list[Any]]]
"""Tables of each propeller by the role of their file, and under ``refused`` the roles whose file was refused."""


def _tables(files: list[tuple[Path, UiucFile]], faults: list[Fault]) -> _Tables:
    """Read the files of one folder whose names are in order; faults are appended."""
    parts: _Tables = defaultdict(lambda: defaultdict(list))
    for file, told in files:
        if told.propeller.faults:
            continue
        own = parts[told.propeller.name]
        try:
            table = _READERS[told.role](file)
        except InputError as error:
            faults.extend(error.faults)
            own["refused"].append(told.role)
            continue
        if told.role in ("geom", "thick") and (first := own[told.role]):
            got = f"a second {told.role} table for {told.propeller.name}"
            faults.append(Fault(os.fspath(file), "", got, "one", f"{first[0].file} is used"))
        else:
            own[told.role].append(table)
    return parts


def _collect(files: list[tuple[Path, UiucFile]], faults: list[Fault]) -> Iterator[UiucPropeller]:
    """Join the files of one folder to propellers; faults are appended."""
    parts = _tables(files, faults)
    names = {told.propeller.name: told.propeller for _, told in files}
    own = {key: (names[key], found["geom"][0]) for key, found in parts.items() if found["geom"]}
    for key, name in sorted(names.items()):
        its = [file for file, told in files if told.propeller.name == key]
        folder = os.fspath(its[0].parent)
        if name.faults:
            where = f"{folder}/{key}_* ({number_of(len(its), 'file')})"
            faults += [Fault(where, "name", *fault) for fault in name.faults]
            continue
        if key == name.family or name.diameter_in is None:  # the design of a family is no propeller of its own
            continue
        found = parts[key]
        if not (found["geom"] or found["static"] or found["line"]):
            continue
        thickness = found["thick"] or (parts[name.family]["thick"] if name.family in parts else [])
        yield UiucPropeller(
            **vars(name), folder=folder,
            # a refused geometry is not quietly replaced by another
            geometry=None if "geom" in found["refused"] else _choose_geometry(name, own),
            thickness=thickness[0] if thickness else None, statics=tuple(found["static"]),
            lines=tuple(sorted(found["line"], key=lambda line: (line.rpm, line.file))),
        )  # fmt: skip


def scan_folder(path: str | os.PathLike[str]) -> UiucFolder:
    """Import a folder in the archive's layout, keeping what is sound and naming what is not."""
    root = Path(path)
    if not root.is_dir():
        raise InputError(Fault(os.fspath(path), "", "no folder", "a folder in UIUC layout", "Check the path"))
    faults: list[Fault] = []
    ignored: list[tuple[str, str]] = []
    folders: dict[Path, list[tuple[Path, UiucFile]]] = defaultdict(list)
    for file in _files(root):
        head, told = _head(file), parse_file_name(file.stem)
        if b"\0" in head or head.startswith((b"%PDF", b"%!PS")):
            ignored.append((os.fspath(file), "binary"))
        elif told is not None:
            folders[file.parent].append((file, told))
        elif role_of(head) is not None:
            expected = "a name such as apce_10x5_geom, apce_10x5_static_kt0827 or apce_10x5_kt0828_4014"
            hint = "Diameter and rpm are read from the name"
            faults.append(Fault(os.fspath(file), "", f"name {file.stem!r}", expected, hint))
        else:
            ignored.append((os.fspath(file), "neither name nor header of this archive"))
    propellers = [p for folder in sorted(folders) for p in _collect(folders[folder], faults)]
    return UiucFolder(tuple(propellers), tuple(faults), tuple(ignored))


def read(path: str | os.PathLike[str]) -> Any:
    """Read one table of the archive, by its header."""
    source = load_text(path)
    if (role := role_of(source.text)) is None:
        expected = "one of the headers r/R c/R beta, RPM CT CP, J CT CP eta, r/R t/c"
        source.refuse("1", "no header of this archive", expected)
    return _READERS[role](Path(path))

"""Measured points gathered for a calibration: diameter, pitch, speed and thrust.

UIUC folders and files, and any table with the columns (or ``recording.toml`` constants) diameter, pitch, rpm and thrust
or CT; further columns are airspeed or J, density, blades, ducted (0 or 1), name.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.given import find_data
from bemt.base.tables import number_of
from bemt.base.units import INCH
from bemt.data import readers as importers
from bemt.data.readers import uiuc
from bemt.data.readers.uiuc_names import parse_file_name
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.dataset import Dataset

RHO = 1.225
"""Density where a source states none [kg/m3]; coefficients do not depend on it."""


@dataclass(frozen=True)
class MeasuredPropeller:
    """One propeller of the data."""

    # As the data name it; the family that is left out together; where it comes from
    name: str
    maker: str
    source: str
    # Nominal [m]
    diameter_m: float
    pitch_m: float
    blades: int = 2  # Number of blades
    ducted: bool = False  # In a duct: scored, never fitted


@dataclass(frozen=True, eq=False)
class FitPoints:
    """N measured points of K propellers."""

    propellers: tuple[MeasuredPropeller, ...]  # K propellers
    index: NDArray[np.intp]  # (N,) propeller of each point
    rpm: Array  # (N,) rotational speed [rev/min]
    # (N,) propeller convention [-]
    J: Array
    CT: Array
    refused: tuple[str, ...] = ()  # Files or propellers left out, with the reason
    notes: tuple[str, ...] = ()  # What a user has to know of the sources

    def of(self, name: str) -> Array:
        """Number of the propeller at each point, by field name, (N,)."""
        return np.array([float(getattr(p, name)) for p in self.propellers])[self.index]

    @property
    def P_D(self) -> Array:
        """Pitch over diameter. [-]"""
        return self.of("pitch_m") / self.of("diameter_m")

    @property
    def x(self) -> Array:
        """J/(P/D). [-]"""
        return self.J / self.P_D

    @property
    def ducted(self) -> NDArray[np.bool_]:
        """Whether the rotor runs in a duct."""
        return np.array([p.ducted for p in self.propellers])[self.index]

    @property
    def M_tip(self) -> Array:
        """Rotational tip Mach number in standard air. [-]"""
        return np.asarray(co.M_tip(self.rpm / 60.0, self.of("diameter_m"), Air.from_density().a_sound))

    def select(self, where: NDArray[np.bool_]) -> FitPoints:
        """Part of the points, propellers kept."""
        arrays = {name: getattr(self, name)[where] for name in ("index", "rpm", "J", "CT")}
        return replace(self, **arrays)


Rows = tuple[MeasuredPropeller, Array, Array, Array]
"""Propeller, speed [rev/min], advance ratio and thrust coefficient of a run."""


def join(rows: Sequence[Rows], refused: Sequence[str] = (), notes: Sequence[str] = ()) -> FitPoints:
    """Make points of rows per propeller and run; rows of equal propellers are joined."""
    numbers: dict[str, int] = {}
    unique: list[MeasuredPropeller] = []
    parts: list[tuple[Array, ...]] = []
    for made, *arrays in rows:
        k = numbers.setdefault(repr(made), len(unique))
        if k == len(unique):
            unique.append(made)
        rpm, J, CT = (np.asarray(a, dtype=float) for a in arrays)
        ok = np.isfinite(rpm) & (rpm > 0) & np.isfinite(J) & np.isfinite(CT)
        parts.append((np.full(int(ok.sum()), k), rpm[ok], J[ok], CT[ok]))
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.empty(0)] * 4
    if joined[0].size == 0:
        raise InputError(Fault("", "", "no finite point", "rows with rpm, J and CT"))
    rpm, J, CT = joined[1:]
    return FitPoints(tuple(unique), joined[0].astype(np.intp), rpm, J, CT, tuple(refused), tuple(notes))


def _from_uiuc(p: uiuc.UiucPropeller) -> tuple[list[Rows], list[str]]:
    if p.pitch_in is None:
        return [], [f"{p.name}: no nominal pitch"]
    made = MeasuredPropeller(p.name, p.family, "UIUC", p.diameter_m, p.pitch_in * INCH, p.blades)
    rows: list[Rows] = [(made, s.rpm, np.zeros_like(s.rpm), s.CT) for s in p.statics]
    rows += [(made, np.full_like(line.J, line.rpm), line.J, line.CT) for line in p.lines]
    return rows, [] if rows else [f"{p.name}: geometry only"]


def _from_uiuc_table(path: Path, table: Any) -> tuple[list[Rows], list[str]]:
    told = parse_file_name(path.stem)
    if told is None or told.propeller.faults or told.propeller.diameter_in is None or told.propeller.pitch_in is None:
        return [], [f"{path}: the name says no diameter and pitch"]
    name = told.propeller
    assert name.diameter_in is not None and name.pitch_in is not None
    made = MeasuredPropeller(name.name, name.family, "UIUC", name.diameter_in * INCH, name.pitch_in * INCH, name.blades)
    if isinstance(table, uiuc.UiucStatic):
        return [(made, table.rpm, np.zeros_like(table.rpm), table.CT)], []
    if isinstance(table, uiuc.UiucLine):
        return [(made, np.full_like(table.J, table.rpm), table.J, table.CT)], []
    return [], [f"{path}: geometry only"]


def _groups(
    names: Sequence[str], D: Array, pitch: Array, B: Array, duct: Array
) -> tuple[dict[tuple[Any, ...], list[int]], int]:
    """Rows of each propeller, by name, diameter, pitch, blades and whether it is in a duct; how many rows have none."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    bad = 0
    for i, name in enumerate(names):
        values = (D[i], pitch[i], B[i])
        if not (all(np.isfinite(v) and v > 0 for v in values) and B[i] == round(B[i])):
            bad += 1
            continue
        key = (name, *values, bool(duct[i] > 0))
        groups.setdefault(key, []).append(i)
    return groups, bad


def _from_table(path: Path, found: Dataset) -> tuple[list[Rows], list[str], list[str]]:
    """Any table with the columns of the module notes."""
    N, constants = len(found), found.constants

    def column(*names: str) -> Array | None:
        for name in names:
            if name in found:
                return found[name]
            if name in constants:
                return np.full(N, float(constants[name]))
        return None

    D, pitch, rpm = column("diameter_m", "D_m"), column("pitch_m"), column("rpm")
    T, CT = column("thrust_N", "T_N"), column("CT")
    missing = [name for name, values in (("diameter (with its unit)", D), ("pitch (with its unit)", pitch),
               ("rpm", rpm), ("thrust (with its unit) or CT", T if CT is None else CT)) if values is None]  # fmt: skip
    if missing or D is None or pitch is None or rpm is None:
        return [], [f"{path}: no column {', '.join(missing)}"], []
    notes = []
    n = rpm / 60.0
    rho = column("density_kg_m3", "rho_kg_m3")
    if rho is None:
        rho = np.full(N, RHO)
        if CT is None:
            notes.append(f"{path}: no density, {RHO:g} kg/m3 assumed")
    if CT is None:
        assert T is not None
        CT = np.asarray(co.CT(T, rho, n, D))
    J, V = column("J"), column("airspeed_m_s", "V_m_s")
    if J is None:
        J = np.zeros(N) if V is None else np.asarray(co.J(V, n, D))
    B, duct = column("blades", "B"), column("ducted")
    if B is None:
        B = np.full(N, 2.0)
        notes.append(f"{path}: no column blades, 2 assumed")
    duct = np.zeros(N) if duct is None else duct
    names = found.texts.get("name") or found.texts.get("propeller") or (path.stem,) * N
    groups, bad = _groups(names, D, pitch, B, duct)
    rows: list[Rows] = []
    for (name, d, p, b, inside), at in groups.items():
        maker = str(name).split("_")[0].split(" ")[0]
        made = MeasuredPropeller(str(name), maker, path.name, float(d), float(p), int(b), inside)
        rows.append((made, rpm[at], J[at], CT[at]))
    return (
        rows,
        [f"{path}: {number_of(bad, 'row')} without a positive diameter, pitch and blade count"] if bad else [],
        notes,
    )


def _file(path: Path) -> tuple[list[Rows], list[str], list[str]]:
    """Rows, refusals and notes of one file."""
    try:
        found = importers.read(path)
    except InputError as error:
        return [], [str(fault) for fault in error.faults], []
    if isinstance(found, (uiuc.UiucStatic, uiuc.UiucLine, uiuc.UiucGeometry, uiuc.UiucThickness)):
        return *_from_uiuc_table(path, found), []
    if isinstance(found, Dataset):
        return _from_table(path, found)
    return [], [f"{path}: a {type(found).__name__} says nothing of diameter, pitch, rpm and thrust"], []


def files(path: Path) -> list[Path]:
    """All files that a name stands for."""
    if not path.is_dir():
        return [path] if path.exists() else []
    return [f for f in sorted(path.rglob("*")) if f.is_file() and not f.name.startswith(".")]


def _folder(path: Path, without: frozenset[Path]) -> tuple[list[Rows], list[str], list[str]]:
    """Rows, refusals and notes of a folder: the UIUC files as an archive, every other file for itself."""
    rows: list[Rows] = []
    refused: list[str] = []
    notes: list[str] = []
    found = files(path)
    if uiuc.sniff_folder(path):
        scan = uiuc.scan_folder(path)
        refused += [str(fault) for fault in scan.faults]
        for p in scan.propellers:
            if any(Path(table.file).resolve() in without for table in (*p.statics, *p.lines)):
                continue  # the whole propeller: its other runs would tell of the one held out
            made, why = _from_uiuc(p)
            rows += made
            refused += why
        others = {name for name, _ in scan.ignored}
        found = [f for f in found if os.fspath(f) in others]
    for file in found:
        if file.resolve() in without:
            continue
        made, why, note = _file(file)
        rows += made
        refused += why
        notes += note
    return rows, refused, notes


def load(paths: Iterable[str | os.PathLike[str]], without: frozenset[Path] = frozenset()) -> FitPoints:
    """Gather the points of files and folders."""
    rows: list[Rows] = []
    refused: list[str] = []
    notes: list[str] = []
    faults: list[Fault] = []
    for item in paths:
        path = Path(item)
        if not path.exists():
            faults.append(Fault(os.fspath(item), "", "no such file or folder", "a file or folder", "Check the path"))
            continue
        made, why, note = _folder(path, without) if path.is_dir() else _file(path)
        if not made:
            more = f" ({'; '.join(why[:3])})" if why else ""
            hint = "Needed are diameter, pitch, rpm and thrust or CT"
            faults.append(Fault(os.fspath(item), "", f"no usable point{more}", "measured propellers", hint))
        rows += made
        refused += why
        notes += note
    refuse(faults)
    return join(rows, refused, notes)


def _found(name: str) -> str:
    """Path as given, or the database of this name (``uiuc/volume-2``)."""
    return name if Path(name).exists() else str(find_data(name) or name)


def _resolved(name: str) -> frozenset[Path]:
    """Files that a name stands for, each under its one true name."""
    return frozenset(file.resolve() for file in files(Path(_found(name))))


def _twice(option: str, names: Iterable[str], seen: dict[Path, str]) -> list[Fault]:
    """Names that stand for files seen before; what they stand for is added to those."""
    faults = []
    hint = "Held-out data must not be fitted" if option == "--test" else "FitPoints that count twice weigh twice"
    for name in names:
        own = _resolved(name)
        again = sorted(own & seen.keys())
        if again:
            some = ", ".join(file.name for file in again[:3]) + (", ..." if len(again) > 3 else "")
            got = f"files that {seen[again[0]]} holds too ({len(again)}: {some})"
            faults.append(Fault(option, name, got, "every file once", hint))
        seen |= {file: f"{option} {name}" for file in own if file not in seen}
    return faults


def read(given: Sequence[str], test: Sequence[str] = ()) -> tuple[FitPoints, FitPoints | None]:
    """FitPoints to fit (of the data found when none are named) and held-out points; all faults of both at once."""
    if not given and find_data("uiuc") is None:
        hint = "Name files, or fetch a database: bemt lab fetch uiuc"
        raise InputError(Fault("FILES", "", "none, and no UIUC data found", "measured propellers", hint))
    seen: dict[Path, str] = {}
    faults = _twice("FILES", given, seen)
    faults += _twice("--test", test, seen)
    found = frozenset[Path]() if given else _resolved("uiuc")
    held = found & seen.keys()  # of the data that nobody named
    names = given or ["uiuc"]
    if held and held == found:
        faults.append(Fault("--test", "", "all of the data found", "less than all", "Or name other FILES to fit"))
        names = []
    read: list[FitPoints] = []
    for which, without in ((names, held), (test, frozenset[Path]())):
        with gathered(faults):
            read += [load(map(_found, which), without)] if which else []
    refuse(faults)
    points = read[0]
    if held:
        note = f"{len(held)} files of --test are left out of uiuc before the fit, with all runs of their propellers"
        points = replace(points, notes=(note, *points.notes))
    return points, read[1] if test else None

"""Measured points gathered for a calibration: diameter, pitch, speed and thrust.

UIUC folders and files, and every recording that another command reads, as steady points: a speed of rotation, thrust
or CT, and diameter and pitch as columns, constants of a ``recording.toml``, or labels in a column of text (10x4.5);
further columns are airspeed or J, density or the state of the air, blades, ducted (0 or 1), name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.given import find_data, path_text
from bemt.base.tables import number_of, some
from bemt.base.units import INCH
from bemt.data import readers as importers
from bemt.data.readers import uiuc
from bemt.data.readers.uiuc_names import parse_file_name
from bemt.data.recordings.channels import file_name, in_one_step, named
from bemt.data.recordings.check import check, left_out
from bemt.data.recordings.reduce import reduce, reduction
from bemt.data.recordings.shown import dropped_words
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.make import from_pandas
from bemt.rotors.case.fresh import read_label

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
    gone = [*refused]
    for made, *arrays in rows:
        k = numbers.setdefault(repr(made), len(unique))
        if k == len(unique):
            unique.append(made)
        rpm, J, CT = (np.asarray(a, dtype=float) for a in arrays)
        ok = np.isfinite(rpm) & (rpm > 0) & np.isfinite(J) & np.isfinite(CT)
        gone += [f"{made.name}: {number_of(int(lost), 'point')} without rpm, J or CT"] if (lost := np.sum(~ok)) else []
        parts.append((np.full(int(ok.sum()), k), rpm[ok], J[ok], CT[ok]))
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.empty(0)] * 4
    if joined[0].size == 0:
        raise InputError(Fault("", "", "no finite point", "rows with rpm, J and CT"))
    rpm, J, CT = joined[1:]
    return FitPoints(tuple(unique), joined[0].astype(np.intp), rpm, J, CT, tuple(gone), tuple(notes))


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


Gathered = tuple[list[Rows], list[str], list[str]]
"""Rows of propellers, what was left out, notes."""


def _sizes(found: Dataset, label: str | None) -> tuple[list[Any], tuple[str, ...]]:
    """Diameter and pitch [m], blades and duct of every row, (N,), None where nothing tells it; names of propellers."""
    N, told, names = len(found), found.constants, found.texts.get("name")

    def column(*channels: str) -> Array | None:
        known = next((k for k in channels if k in found or k in told), None)
        return None if known is None else found[known] if known in found else np.full(N, float(told[known]))

    sizes = [column("diameter_m", "D_m"), column("pitch_m"), column("blades", "B"), column("ducted")]
    for cells in ((label,) * N,) if label else found.texts.values():
        with suppress(InputError):
            labels = {cell: read_label(cell) for cell in {*cells} if cell.strip()}
            if not labels:
                continue
            of_rows = [(d.diameter_in * INCH, d.pitch_in * INCH, d.blades) if (d := labels.get(cell)) else (np.nan,) * 3
                       for cell in cells]  # fmt: skip
            of_label = [*np.array(of_rows, dtype=float).T, None]
            sizes = [a if a is not None and (label or b is None) else b for a, b in zip(of_label, sizes, strict=True)]
            names = names or tuple(cells)
            break
    return sizes, names or found.texts.get("propeller") or (Path(found.file or found.name).stem,) * N


def _checked(
    found: Dataset, D: float | None, pitch: float | None, ducted: bool
) -> tuple[Dataset, list[str], list[str]]:
    """The rows that the checks of recordings leave; what contradicts a whole column of a fit, and some of its rows."""
    findings = check(found, diameter_m=D, pitch_m=pitch, ducted=ducted)
    loaded = named(found)
    used = {"diameter_m", "pitch_m", *(file_name(loaded, k) for k in _USED)}
    told = [f for f in findings if f.severity != "note" and used & {*f.channel.split("+")}]
    whole, rows = ([f"{f.channel}: {f.evidence}. {f.correction}" for f in told if bool(f.rows) == part]
                   for part in (False, True))  # fmt: skip
    return left_out(found, findings), whole, rows


_USED = ("rpm", "thrust_N", "CT", "J", "airspeed_m_s", "density_kg_m3", "temperature_K", "pressure_Pa")


_Key = tuple[str, float, float, float, bool]
"""Name, diameter and pitch [m], blades and duct of a propeller."""


def _by_propeller(keys: Iterable[_Key]) -> tuple[dict[_Key, list[int]], list[int]]:
    """Rows of each propeller; those without a positive diameter, pitch and blade count."""
    groups: dict[_Key, list[int]] = {}
    bad: list[int] = []
    for i, key in enumerate(keys):
        known = all(np.isfinite(v) and v > 0 for v in key[1:4]) and key[3] == round(key[3])
        (groups.setdefault(key, []) if known else bad).append(i)
    return groups, bad


def _of_propeller(file: str, key: _Key, part: Dataset, wrong: list[str], doubtful: list[str]) -> Gathered:
    """Steady points of the rows of one propeller; refused where they are `wrong`."""
    name, D, pitch, B, inside = key
    try:
        points = None if wrong else reduce(part, diameter_m=D)
    except InputError as error:
        points, wrong = None, [fault.got for fault in error.faults]
    if points is None:
        return [], [f"{file}: {name}: {words}" for words in wrong], []
    refused = [f"{file}: {name}: {words}" for words in dropped_words(reduction(points))]
    notes = [f"{file}: {name}: {words}" for words in doubtful]
    if "CT" not in points and "thrust_N" in points:
        points = points.derive(D, RHO)
        notes.append(f"{file}: no density, {RHO:g} kg/m3 assumed")
    if not {"rpm", "CT"} <= points.values.keys():
        return [], [*refused, f"{file}: {name}: no row with a speed and a thrust"], notes
    made = MeasuredPropeller(str(name), re.split("[_ ]", str(name))[0], Path(file).name, D, pitch, int(B), bool(inside))
    return [(made, points.rpm, points["J"] if "J" in points else np.zeros(len(points)), points["CT"])], refused, notes


def _from_table(file: str, found: Dataset, label: str | None = None) -> Gathered:
    """Steady points of each propeller of a recording, or of any table with the columns of the module notes."""
    (D, pitch, B, duct), names = _sizes(found, label)
    loaded = named(found)
    needed = {"diameter (with its unit)": D is not None, "pitch (with its unit)": pitch is not None,
              "rpm": "rpm" in loaded,
              "thrust (with its unit) or CT": bool({"thrust_N", "CT"} & {*loaded.values})}  # fmt: skip
    missing = [what for what, there in needed.items() if not there]
    if missing:
        return [], [f"{file}: no column {', '.join(missing)}{in_one_step(found)}"], []
    notes = [] if B is not None else [f"{file}: no column blades, 2 assumed"]
    B, duct = np.full(len(found), 2.0) if B is None else B, np.zeros(len(found)) if duct is None else duct
    sized = replace(found, values={**found.values, "diameter_m": D, "pitch_m": pitch}, lines=loaded.lines)
    groups, bad = _by_propeller(zip(names, D, pitch, B, duct > 0, strict=True))
    lines = some([sized.lines[i] for i in bad])
    refused = [f"{file}: no positive diameter, pitch and blade count (lines {lines})"] if bad else []
    if not groups:
        return [], refused, notes
    checked = {key: _checked(sized.select(np.array(at)), key[1], key[2], key[4]) for key, at in groups.items()}
    sound = [key for key, (_, wrong, _) in checked.items() if not wrong]
    # of few rows each, or all alike: together they say more
    rest = sized.select(np.sort(np.concatenate([groups[key] for key in sound or groups])))
    _, wrong, _ = _checked(rest, None, None, bool(np.any(duct > 0)))
    if wrong:
        checked, refused = {}, [*refused, *(f"{file}: {words}" for words in wrong)]
    rows: list[Rows] = []
    for key, (part, wrong, doubtful) in checked.items():
        made, gone, told = _of_propeller(file, key, part, wrong, doubtful)
        rows, refused, notes = rows + made, refused + gone, notes + told
    return rows, refused, list(dict.fromkeys(notes))


def _file(path: Path, label: str | None = None) -> Gathered:
    """Rows, refusals and notes of one file."""
    try:
        found = importers.read(path)
    except InputError as error:
        return [], [str(fault) for fault in error.faults], []
    if isinstance(found, (uiuc.UiucStatic, uiuc.UiucLine, uiuc.UiucGeometry, uiuc.UiucThickness)):
        return *_from_uiuc_table(path, found), []
    if isinstance(found, Dataset):
        return _from_table(os.fspath(path), found, label)
    return [], [f"{path}: a {type(found).__name__} says nothing of diameter, pitch, rpm and thrust"], []


def files(path: Path) -> list[Path]:
    """All files that a name stands for."""
    if not path.is_dir():
        return [path] if path.exists() else []
    return [f for f in sorted(path.rglob("*")) if f.is_file() and not f.name.startswith(".")]


def _folder(path: Path, without: frozenset[Path], label: str | None) -> Gathered:
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
        made, why, note = _file(file, label)
        rows += made
        refused += why
        notes += note
    return rows, refused, notes


def load(
    given: Iterable[str | os.PathLike[str] | Dataset], without: frozenset[Path] = frozenset(), label: str | None = None
) -> FitPoints:
    """Gather the points of files, folders and tables; ``label``: the propeller of tables that do not say theirs."""
    rows: list[Rows] = []
    refused: list[str] = []
    notes: list[str] = []
    faults: list[Fault] = []
    for one in given:
        item = one.name if isinstance(one, Dataset) else os.fspath(one)
        path = Path(item)
        if isinstance(one, Dataset):
            made, why, note = _from_table(item, one, label)
        elif not path.exists():
            faults.append(Fault(item, "", "no such file or folder", "a file or folder", "Check the path"))
            continue
        else:
            made, why, note = _folder(path, without, label) if path.is_dir() else _file(path, label)
        if not made:
            more = f" ({'; '.join(why[:3])})" if why else ""
            hint = "Needed are diameter and pitch (--label 10x4.5 states them), rpm and thrust or CT"
            faults.append(Fault(item, "", f"no usable point{more}", "measured propellers", hint))
        rows += made
        refused += why
        notes += note
    refuse(faults)
    return join(rows, refused, notes)


def given(name: str, value: Any) -> list[str | Dataset]:
    """Paths and tables of a caller: one, or several."""
    several = value if isinstance(value, (list, tuple)) else [value]
    return [v if isinstance(v, Dataset) else from_pandas(v) if hasattr(v, "columns") else path_text(name, v)
            for v in several]  # fmt: skip


def _found(name: str | Dataset) -> str | Dataset:
    """Table or path as given, or the database of this name (``uiuc/volume-2``)."""
    return name if isinstance(name, Dataset) or Path(name).exists() else str(find_data(name) or name)


def _resolved(name: str | Dataset) -> frozenset[Path]:
    """Files that a name stands for, each under its one true name."""
    found = _found(name)
    return frozenset() if isinstance(found, Dataset) else frozenset(file.resolve() for file in files(Path(found)))


def _twice(option: str, names: Iterable[str | Dataset], seen: dict[Path, str]) -> list[Fault]:
    """Names that stand for files seen before; what they stand for is added to those."""
    faults = []
    hint = "Held-out data must not be fitted" if option == "--test" else "FitPoints that count twice weigh twice"
    for name in names:
        own = _resolved(name)
        again = sorted(own & seen.keys())
        if again:
            names_of = ", ".join(file.name for file in again[:3]) + (", ..." if len(again) > 3 else "")
            got = f"files that {seen[again[0]]} holds too ({len(again)}: {names_of})"
            faults.append(Fault(option, str(name), got, "every file once", hint))
        seen |= {file: f"{option} {name}" for file in own if file not in seen}
    return faults


def read(
    given: Sequence[str | Dataset], test: Sequence[str | Dataset] = (), label: str | None = None
) -> tuple[FitPoints, FitPoints | None]:
    """FitPoints to fit (of the data found when none are named) and held-out points; all faults of both at once."""
    if label is not None:
        read_label(label)
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
            read += [load(map(_found, which), without, label)] if which else []
    refuse(faults)
    points = read[0]
    if held:
        note = f"{len(held)} files of --test are left out of uiuc before the fit, with all runs of their propellers"
        points = replace(points, notes=(note, *points.notes))
    return points, read[1] if test else None

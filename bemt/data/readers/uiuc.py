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
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError, system_fault
from bemt.base.tables import number_of
from bemt.data.readers import HEAD_BYTES
from bemt.data.readers.uiuc_names import FAMILIES, VARIABLE_PITCH, UiucFile, UiucName, parse_file_name
from bemt.data.readers.uiuc_tables import (
    UiucGeometry,
    UiucLine,
    UiucStatic,
    UiucThickness,
    read_geometry,
    read_line,
    read_static,
    read_thickness,
    role_of,
    sniff,
)

__all__ = [
    "KIND", "SOURCE", "UiucFolder", "UiucGeometry", "UiucLine", "UiucPropeller", "UiucStatic", "UiucThickness",
    "read", "read_geometry", "read_line", "read_static", "read_thickness", "scan_folder", "sniff", "sniff_folder",
]  # fmt: skip

KIND = "uiuc"
SOURCE = "UIUC Propeller Database (Brandt, Deters, Ananda, Dantsker, Selig), archive of 27 June 2022"

_READERS: dict[str, Callable[[Path], Any]] = {
    "geom": read_geometry, "static": read_static, "line": read_line, "thick": read_thickness,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class UiucPropeller:
    """One propeller of the archive with all its data."""

    # ``apce_10x5``, ``apce``, "APC Thin Electric", folder that holds the files
    name: str
    family: str
    label: str
    folder: str
    # Nominal, see the module notes [in]
    diameter_in: float
    pitch_in: float | None
    angle_deg: float | None  # Nominal blade angle at r/R = 0.75 [deg]
    blades: int
    blades_from: str  # ``name``, ``family`` or ``default`` (2)
    rotation: int  # +1 tractor or -1 pusher
    specimen: int
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


@dataclass
class _Parts:
    """Tables of a propeller by the role of their file, and the roles whose file was refused."""

    geom: list[Any] = field(default_factory=list)
    thick: list[Any] = field(default_factory=list)
    static: list[Any] = field(default_factory=list)
    line: list[Any] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


def _collect(files: list[tuple[Path, UiucFile]], faults: list[Fault]) -> Iterator[UiucPropeller]:
    """Read the files of one folder and join them to propellers; faults are appended."""
    parts: dict[str, _Parts] = defaultdict(_Parts)
    names: dict[str, UiucName] = {}
    counts: dict[str, int] = defaultdict(int)
    for file, told in files:
        name = told.propeller
        names[name.name] = name
        counts[name.name] += 1
        if name.faults:
            continue
        own_part = parts[name.name]
        try:
            table = _READERS[told.role](file)
        except InputError as error:
            faults.extend(error.faults)
            own_part.refused.append(told.role)
            continue
        tables: list[Any] = getattr(own_part, told.role)
        if told.role in ("geom", "thick") and tables:
            got = f"a second {told.role} table for {name.name}"
            faults.append(Fault(os.fspath(file), "", got, "one", f"{tables[0].file} is used"))
            continue
        tables.append(table)
    own = {key: (names[key], found.geom[0]) for key, found in parts.items() if found.geom}
    for key, name in sorted(names.items()):
        folder = os.fspath(next(file for file, told in files if told.propeller.name == key).parent)
        if name.faults:
            faults.extend(
                Fault(f"{folder}/{key}_* ({number_of(counts[key], 'file')})", "name", *fault) for fault in name.faults
            )
            continue
        if key == name.family or name.diameter_in is None:  # the design of a family is no propeller of its own
            continue
        found = parts[key]
        if not (found.geom or found.static or found.line):
            continue
        thickness = found.thick or (parts[name.family].thick if name.family in parts else [])
        yield UiucPropeller(
            name=key, family=name.family, label=FAMILIES.get(name.family.lower(), name.family), folder=folder,
            diameter_in=name.diameter_in, pitch_in=name.pitch_in, angle_deg=name.angle_deg, blades=name.blades,
            blades_from=name.blades_from, rotation=name.rotation, specimen=name.specimen,
            # a refused geometry is not quietly replaced by another
            geometry=None if "geom" in found.refused else _choose_geometry(name, own),
            thickness=thickness[0] if thickness else None, statics=tuple(found.static),
            lines=tuple(sorted(found.line, key=lambda line: (line.rpm, line.file))),
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
    target = Path(path)
    try:
        role = role_of(_head(target))
    except OSError as error:
        raise InputError(system_fault(error, os.fspath(path), "a readable file")) from error
    if role is None:
        expected = "one of the headers r/R c/R beta, RPM CT CP, J CT CP eta, r/R t/c"
        raise InputError(Fault(os.fspath(path), "1", "no header of this archive", expected))
    return _READERS[role](target)

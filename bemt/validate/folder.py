"""A folder of measured propellers: who can be compared, on which stations, and why others cannot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.validate.points import Stations

if TYPE_CHECKING:
    from bemt.readers.uiuc import UiucPropeller

# UIUC family of an APC blade series, by the suffix of the PE0 file's designation.
_APC_SERIES = {"E": "apce", "SF": "apcsf", "": "apcsp", "F": "apcff", "MR": "apcmr"}


@dataclass(frozen=True)
class Folder:
    """What a folder holds."""

    # (UiucPropeller, Stations) measured propellers with their stations: r/R [1], c/R [1], beta [rad]
    propellers: tuple[tuple[UiucPropeller, Stations], ...]
    skipped: tuple[tuple[str, str], ...]  # Name and reason of those that cannot be compared
    faults: tuple[str, ...]  # What could not be read


def read_folders(folders: Sequence[Path]) -> Folder:
    """Several folders as one."""
    found = [read_folder(folder) for folder in folders]
    parts = zip(*((one.propellers, one.skipped, one.faults) for one in found), strict=True)
    return Folder(*(tuple(item for part in parts_ for item in part) for parts_ in parts))


def read_folder(folder: Path) -> Folder:
    """Read a folder in UIUC layout; APC PE0 files in it supply stations for propellers without their own."""
    from bemt.readers import uiuc

    if not folder.is_dir():
        got = "a file" if folder.exists() else "no such folder"
        raise InputError([Fault(str(folder), "", got, "a folder in UIUC layout", "Check the path")])
    scan = uiuc.scan_folder(folder)
    pe0, notes = _pe0_stations(folder)
    usable, skipped = [], []
    for p in scan.propellers:
        stations = _own(p) or pe0.get((p.family, round(p.diameter_in, 2), round(p.pitch_in or 0.0, 2)))
        if stations is None:
            skipped.append((p.name, "no stations"))
        elif not p.statics and not p.lines:
            skipped.append((p.name, "no measurements"))
        else:
            usable.append((p, stations))
    if not usable:
        raise InputError(
            [*scan.faults, Fault(str(folder), "propellers", f"{len(scan.propellers)} propellers, none with stations "
             "and measurements", "at least one of each", "Stations are in NAME_geom.txt or an APC PE0 file.")]
        )  # fmt: skip
    return Folder(tuple(usable), tuple(skipped), (*(str(f) for f in scan.faults), *notes))


def _own(p: UiucPropeller) -> Stations | None:
    g = p.geometry
    return None if g is None else (g.r_R, g.c_R, np.radians(g.beta_deg))


def _pe0_stations(folder: Path) -> tuple[dict[tuple[str, float, float], Stations], list[str]]:
    from bemt.readers import apc

    found: dict[tuple[str, float, float], Stations] = {}
    notes: list[str] = []
    for file in sorted(folder.rglob("*")):
        if file.suffix.upper() != ".PE0":
            continue
        try:
            blade = apc.read_pe0(file)
        except InputError as err:
            notes.extend(str(f) for f in err.faults)
            continue
        series = "".join(ch for ch in file.name.split("-")[0].upper().partition("X")[2] if ch.isalpha())
        family = _APC_SERIES.get(series)
        if family is None:
            notes.append(f"{file.name}: series {series!r} has no UIUC family; stations not used")
            continue
        R = blade.radius_m
        found[family, round(blade.diameter_m / INCH, 2), round(blade.pitch_m / INCH, 2)] = (
            blade.r_m / R,
            blade.chord_m / R,
            blade.beta_rad,
        )
    return found, notes

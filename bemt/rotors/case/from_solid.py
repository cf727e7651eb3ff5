"""Stations of somebody's CAD model or scan, as a case that can be solved."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text, text_table, write_atomic
from bemt.data.readers import HEAD_BYTES, importers
from bemt.data.readers.blade import case_text
from bemt.rotors.case.fresh import case_name
from bemt.rotors.case.unknowns import AIR, SURFACE
from geometry.common import GeometryError
from geometry.export import UNITS, read_solid
from geometry.slicing import FoundRotor, find_rotor

if TYPE_CHECKING:
    from bemt.data.readers.blade import BladeFile


# A design tool's blade (XROTOR, QPROP, DFDC) as a case.


def read_blade(path: Path, unit: str | None = None) -> BladeFile | None:
    """Blade of a design tool's file, None when no reader of blades claims it."""
    if not path.is_file():
        return None
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    for module in importers().values():
        if getattr(module, "BLADE", False) and module.sniff(head):
            if unit is not None:
                raise InputError(Fault(path.as_posix(), "unit", f"--unit {unit}", "none: the format fixes its units"))
            found: BladeFile = module.read(path)
            return found
    return None


def write_blade(blade: BladeFile, path: Path, out: Path) -> None:
    """Write ``case.toml``, ``stations.csv`` and a table per section."""
    files = case_text(blade, case_name(out.resolve().name), path.name)
    refuse_other(out / "case.toml", files["case.toml"])
    for name in sorted(files, key=lambda n: n == "case.toml"):  # the case last: what it names is there
        write_atomic(out / name, files[name])


def blade_document(blade: BladeFile, path: Path) -> dict[str, Any]:
    """Plain values of what was found."""
    return {
        "schema": SCHEMA, "file": path.name, "program": blade.source, "blades": blade.blades,
        "diameter_m": 2 * blade.R_m, "hub_diameter_m": 2 * blade.Rhub_m, "warnings": list(blade.notes),
        "stations": {"r_m": blade.r_m, "chord_m": blade.chord_m, "beta_deg": np.degrees(blade.beta_rad)},
    }  # fmt: skip


def blade_text(blade: BladeFile, path: Path, out: str | None) -> str:
    """Lay the stations out for a terminal."""
    beta = np.degrees(blade.beta_rad)
    rows = [
        [number_text(v) for v in row]
        for row in zip(blade.r_m / blade.R_m, blade.r_m * 1e3, blade.chord_m * 1e3, beta, strict=True)
    ]
    lines = [
        f"{path.name}: {blade.source}, {blade.blades} blades, diameter {number_text(2e3 * blade.R_m, 5)} mm, "
        f"{len(blade.sections)} sections"
    ]
    lines += [f"note: {note}" for note in blade.notes]
    lines.append(text_table(["r/R", "r mm", "chord mm", "beta deg"], rows, left=()).rstrip())
    if out is not None:
        lines.append(f"case in {Path(out) / 'case.toml'}")
    return "\n".join(lines) + "\n"


SCHEMA = "bemt.stations/1"
TIP_SPEED = 120.0  # of the rpm that is put into the case: geometry says nothing about it [m/s]
ANCHORS = (0.2, 0.35, 0.5, 0.65, 0.8, 0.95)


def find_stations(path: Path, unit: str | None = None) -> tuple[FoundRotor, float, str]:
    """Find the rotor in a file."""
    file = path.as_posix()
    try:
        if path.suffix.lower() in (".txt", ".csv", ".dat", ".pe0"):
            hint = "A table of stations becomes a case with: bemt new --stations FILE --diameter-mm D"
            raise InputError(Fault(file, "", f"a {path.suffix} file", "a solid: STL, OBJ or STEP", hint))
        vertices, faces, said = read_solid(path)
        kind = "STEP" if path.suffix.lower() in (".step", ".stp") else "the file"
        if said is None and unit is None:
            size = float(np.ptp(vertices, axis=0).max())
            looks = f"The largest extent is {size:.4g}: as mm, in or m? Give --unit"
            raise InputError(Fault(file, "unit", "none in the file", "--unit mm, m or in", looks))
        if said is not None and unit is not None and said != unit and kind != "STEP":
            raise InputError(Fault(file, "unit", f"--unit {unit}", f"{said}, which the file states", "Leave it out"))
        found = find_rotor(vertices, faces)
    except GeometryError as error:
        raise InputError([Fault("" if at == file else file, at, *rest) for at, *rest in error.faults]) from error
    name = said or unit or "m"
    words = "STEP files carry their unit" if kind == "STEP" else f"{name}, {'as the file says' if said else 'as told'}"
    scale = UNITS[name]
    if not 0.005 <= found.R * scale <= 5:
        raise InputError(Fault(file, "unit", f"{name}, which makes a rotor of {2 * found.R * scale:.4g} m diameter",
                               "a diameter from 0.01 to 10 m", "Another --unit?"))  # fmt: skip
    return found, scale, words


def _csv(header: str, rows: list[list[str]]) -> str:
    return "".join(f"{line}\n" for line in [header, *(",".join(row) for row in rows)])


def case_files(
    found: FoundRotor, scale: float, name: str, source: str, known_from: str | None = None, rpm: float | None = None,
    airspeed_m_s: float = 0.0,
) -> dict[str, str]:  # fmt: skip
    """Write the found rotor as a case."""
    x = found.r / found.R
    files: dict[str, str] = {}
    rows = [
        [f"{a:.6f}", f"{b:.6f}", f"{c:.5f}"]
        for a, b, c in zip(x, found.chord / found.R, np.degrees(found.beta), strict=True)
    ]
    files["stations.csv"] = _csv("r_over_R,chord_over_R,beta_deg", rows)
    files["sections.csv"] = _csv(
        "r_m,chord_m,beta_deg,thickness,camber,camber_position",
        [[f"{v:.7g}" for v in row] for row in
         zip(found.r * scale, found.chord * scale, np.degrees(found.beta), found.thickness, found.camber,
             found.camber_position, strict=True)],
    )  # fmt: skip
    hub = found.Rhub / found.R
    anchors: dict[int, float] = {}
    for want in ANCHORS:
        k = int(np.argmin(np.abs(x - max(want, hub + 0.05 * (1 - hub)))))
        anchors.setdefault(k, float(x[k]))
    names = []
    for k, at in anchors.items():
        section = found.sections[k]
        title = f"section_{round(1000 * at):04d}"
        names.append(f"{title}.dat")
        pairs = "".join(f"{a:.6f} {b:.6f}\n" for a, b in zip(section.x, section.y, strict=True))
        files[f"{title}.dat"] = f"{title}\n{pairs}"
    told = float(f"{TIP_SPEED / (found.R * scale) * 30 / math.pi:.2g}") if rpm is None else rpm
    known = f'\nknown_from = "{known_from}"' if known_from else ""
    quoted = ", ".join(f'"{n}"' for n in names)
    files["case.toml"] = f"""# Blade stations cut from {source}.
# Not in the geometry: rpm (a tip speed near {TIP_SPEED:g} m/s unless given), speed, and what [[assumptions]] declare.
schema = "bemt.case/1"
name = "{name}"
title = "{found.B} blades, {2e3 * found.R * scale:.4g} mm, from {source}"

[rotor]
kind = "propeller"
blades = {found.B}
diameter_mm = {2e3 * found.R * scale:.6g}
hub_diameter_mm = {2e3 * found.Rhub * scale:.6g}
rotation = "{"right" if found.rotation > 0 else "left"}"

[blade]
stations = "stations.csv"{known}

[blade.section]
dat = [{quoted}]
r_over_R = [{", ".join(f"{at:.4f}" for at in anchors.values())}]

[operating]
rpm = {told:.6g}
airspeed_m_s = {airspeed_m_s:g}

[air]
density_kg_m3 = {AIR.value}
{"".join(unknown.block() for unknown in (*SURFACE, AIR))}"""
    return files


def refuse_other(path: Path, content: str) -> None:
    """Refuse to replace a case that somebody has changed or written."""
    if path.is_file() and path.read_bytes() != content.encode():
        raise InputError(Fault("--out", "", f"a folder with another case, {path.as_posix()}", "a folder without one",
                               "Its case.toml would be replaced"))  # fmt: skip


def document(found: FoundRotor, scale: float, path: Path, words: str) -> dict[str, Any]:
    """Give what was found as ``bemt.stations/1``."""
    return {
        "schema": SCHEMA, "file": path.name, "unit": words, "blades": found.B,
        "rotation": "right" if found.rotation > 0 else "left", "diameter_m": 2 * found.R * scale,
        "hub_diameter_m": 2 * found.Rhub * scale, "axis": found.axis, "origin_m": found.origin * scale,
        "spread": found.spread, "warnings": list(found.notes),
        "stations": {"r_m": found.r * scale, "chord_m": found.chord * scale, "beta_deg": np.degrees(found.beta),
                     "thickness": found.thickness, "camber": found.camber, "camber_position": found.camber_position},
    }  # fmt: skip


def text(found: FoundRotor, scale: float, path: Path, words: str, out: str | None) -> str:
    """Lay what was found out for a terminal."""
    rows = [[number_text(v) for v in row] for row in
            zip(found.r / found.R, found.r * scale * 1e3, found.chord * scale * 1e3, np.degrees(found.beta),
                100 * found.thickness, 100 * found.camber, strict=True)]  # fmt: skip
    hand = "right" if found.rotation > 0 else "left"
    head = (
        f"{path.name}: {found.B} blades, {hand}-hand, diameter {number_text(2e3 * found.R * scale, 5)} mm, hub "
        f"{number_text(2e3 * found.Rhub * scale)} mm ({words})"
    )
    axis = ", ".join(f"{v + 0.0:.4f}" for v in found.axis)
    lines = [head, f"thrust along ({axis})", *(f"note: {note}" for note in found.notes)]
    lines.append(text_table(["r/R", "r mm", "chord mm", "beta deg", "t/c %", "camber %"], rows, left=()).rstrip())
    if out is not None:
        lines.append(f"case in {Path(out) / 'case.toml'}: the rpm is not from the geometry: set it")
    return "\n".join(lines)


def write(found: FoundRotor, scale: float, path: Path, out: Path) -> None:
    """Write the case; refused where it would replace another one."""
    files = case_files(found, scale, case_name(out.resolve().name), re.sub(r'["\\\n]', "_", path.name))
    refuse_other(out / "case.toml", files["case.toml"])
    for name in sorted(files, key=lambda n: n == "case.toml"):  # the case last: what it names is there
        write_atomic(out / name, files[name])

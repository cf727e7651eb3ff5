"""APC blade geometry (PE0), see :mod:`bemt.readers.apc`."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.readers import SourceText, load_text, number
from bemt.readers._apc_common import designation, provenance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ApcBlade:
    """Blade of a PE0 file, in SI units and radians."""

    # Designation (``10x5E``) and version line
    name: str
    version: str
    # Nominal diameter and pitch, tip radius, radius of the hub transition [m]
    diameter_m: float
    pitch_m: float
    radius_m: float
    hub_radius_m: float
    blades: int  # Number of blades
    # (N,) stations ascending in radius [m], chord [m], twist between the LE and TE parting lines [rad]
    r_m: Array
    chord_m: Array
    beta_rad: Array
    t_c: Array  # (N,) thickness over chord
    # (N,) leading edge ahead of the radial line; highest point of the upper surface [m]
    sweep_m: Array
    z_high_m: Array
    # (N,) pitch as quoted, and as a gauge on the lower surface reads it [m]
    pitch_quoted_m: Array
    pitch_prather_m: Array
    # Radius [m] where the transition from the first to the last section starts and ends, with the section names
    airfoils: tuple[tuple[float, str], ...]
    notes: tuple[str, ...]  # Remarks of the file, such as "APC12 airfoil is equivalent to NACA 4412"
    provenance: Mapping[str, Any]  # source, file, sha256, remark


def _pe0_columns(source: SourceText) -> tuple[int, list[str]]:
    """Line number of the unit line and the column names, the three pitches told apart by it."""
    for at, line in enumerate(source.lines, 1):
        names = line.lower().split()
        if names[:2] == ["station", "chord"]:
            below = source.lines[at].lower() if at < len(source.lines) else ""
            kinds = iter(re.findall(r"\((quoted|le-te|prather)\)", below))
            return at + 1, [f"pitch {next(kinds, '?')}" if name == "pitch" else name for name in names]
    hint = "Is this the PERF.PE0 file?"
    raise InputError(Fault(source.name, "", "no station table", "a header line that begins STATION CHORD", hint))


def _pe0_rows(source: SourceText, at: int, names: list[str], faults: list[Fault]) -> dict[str, Array]:
    """Station table up to the first blank line after it."""
    rows: list[list[float]] = []
    lines: list[int] = []
    for index, line in enumerate(source.lines[at:], at + 1):
        tokens = line.split()
        if not tokens:
            if rows:
                break
            continue
        values = [number(token) for token in tokens]
        bad = [i for i, value in enumerate(values) if value is None]
        if bad:
            where = f"{index}:{bad[0] + 1}"
            faults.append(Fault(source.name, where, tokens[bad[0]], "a finite number", "Repair or delete the row"))
        elif len(tokens) not in (len(names), len(names) + 1):
            expected = f"{len(names)} numbers ({' '.join(names)})"
            faults.append(Fault(source.name, str(index), f"{len(tokens)} numbers", expected, ""))
        else:
            rows.append([v for v in values[: len(names)] if v is not None])
            lines.append(index)
    if len(rows) < 3:
        if not faults:
            got = f"{len(rows)} stations"
            faults.append(Fault(source.name, str(at), got, "three or more", "Is the file cut off?"))
        return {}
    data = np.array(rows)
    table = {name: data[:, i] for i, name in enumerate(names)}
    wanted = ("station", "chord", "pitch quoted", "pitch le-te", "sweep", "thickness", "twist", "max-thick")
    missing = [name for name in wanted if name not in table]
    if missing:
        got = f"no column {', '.join(missing)}"
        faults.append(Fault(source.name, str(at), got, f"columns {', '.join(wanted)}", ""))
        return {}
    r, chord = table["station"], table["chord"]
    twist = np.degrees(np.arctan2(table["pitch le-te"], 2 * math.pi * r))
    tests = [
        (np.diff(r, prepend=0.0) <= 0, "radii that do not ascend", "ascending radii [in]"),
        (chord <= 0, "a chord that is not positive", "positive chords [in]"),
        (np.abs(table["thickness"] * chord - table["max-thick"]) > 0.002, "MAX-THICK", "thickness ratio x chord"),
        (np.abs(twist - table["twist"]) > 0.5, "TWIST", "atan(LE-TE pitch/(2 pi r)) [deg]"),
    ]
    for bad_rows, got, expected in tests:
        for i in np.flatnonzero(bad_rows)[:1]:
            faults.append(Fault(source.name, str(lines[i]), got, expected, "Have columns shifted, or units changed?"))
    return table


def read_pe0(path: str | os.PathLike[str]) -> ApcBlade:
    """Read a blade geometry file."""
    source = load_text(path)
    faults: list[Fault] = []
    name, (diameter_in, pitch_in, blades_named) = designation(source, faults)
    at, names = _pe0_columns(source)
    table = _pe0_rows(source, at, names, faults)
    tail: dict[str, float] = {}
    for key, low, high in (("RADIUS", 1.0, 30.0), ("HUBTRA", 0.0, 15.0), ("BLADES", 2, 12)):
        match = re.search(rf"^\s*{key}:\s*(\S+)", source.text, re.MULTILINE)
        value = number(match[1]) if match else None
        if value is None or not low <= value <= high:
            got = f"{key}: {match[1]}" if match else f"no line {key}:"
            faults.append(Fault(source.name, key, got, f"a number from {low:g} to {high:g}", "Is the file cut off?"))
        tail[key] = math.nan if value is None else value
    R = tail["RADIUS"]
    if abs(2 * R - diameter_in) > 0.03 * diameter_in:
        got, expected = f"{2 * R:g} in", f"the diameter of {name}, {diameter_in:g} in"
        faults.append(Fault(source.name, "RADIUS", got, expected, "Do name and data belong together?"))
    if table and table["station"][-1] > 1.01 * R:
        got, expected = f"a station at {table['station'][-1]:g} in", f"stations up to {R:g} in"
        faults.append(Fault(source.name, "RADIUS", got, expected, "Have units changed?"))
    if faults:
        raise InputError(faults)
    inch, zero = units.INCH, np.zeros_like(table["station"])
    version = re.search(r"^\s*(v\d{4}\S*)", source.text, re.MULTILINE)
    sections = re.findall(r"^\s*AIRFOIL\d+:\s*([\d.]+)\s*,\s*(\S.*?)\s*(?:\(|$)", source.text, re.MULTILINE)
    notes = tuple(re.findall(r"^\s*NOTE:\s*(.*?)\s*$", source.text, re.MULTILINE))
    remark = f"{len(names)} columns; blade number by the name {blades_named}" if blades_named != tail["BLADES"] else ""
    return ApcBlade(
        name=name, version=version[1] if version else "", diameter_m=diameter_in * inch, pitch_m=pitch_in * inch,
        radius_m=R * inch, hub_radius_m=tail["HUBTRA"] * inch, blades=int(tail["BLADES"]), r_m=table["station"] * inch,
        chord_m=table["chord"] * inch, beta_rad=np.radians(table["twist"]), t_c=table["thickness"],
        sweep_m=table["sweep"] * inch, z_high_m=table.get("zhigh", zero) * inch,
        pitch_quoted_m=table["pitch quoted"] * inch, pitch_prather_m=table.get("pitch prather", zero * math.nan) * inch,
        airfoils=tuple((float(r) * inch, section) for r, section in sections), notes=notes,
        provenance=provenance(source, remark),
    )  # fmt: skip

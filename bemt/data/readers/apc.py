r"""APC files: blade geometry (``*-PERF.PE0``) and computed performance (``PER3_*.dat``).

PE0 holds about 40 stations in inches and degrees, then radius, hub transition, blade number and sections. The columns
are found by their names, so that the 13-column form and forms with further columns read alike; each row is checked
against itself (maximum thickness = ratio x chord, twist = atan(pitch/(2 pi r)) with the LE-TE pitch), so that a shifted
column cannot pass.

PER3 holds blocks of constant rpm: V [mph], J, Pe, Ct, Cp, PWR [hp], Torque [in lbf], Thrust [lbf]; newer files add
W, N m, N, g/W, Mach, Reynolds number, figure of merit. It is APC's own vortex code, NOT measured, so the series is of
kind ``vendor``. Points at which that code failed are printed as ``-NaN`` and glued to the column before (``0.34-NaN``),
or end after V and J; they stay in the series as NaN with a flag. Coefficients are in the propeller convention.

Sizes come from the designation printed in the first line. Where it drops the decimal point (``134x135-3`` is 13.4x13.5
with 3 blades), the largest reading with a diameter of 4 to 28 in and pitch/diameter of 0.25 to 1.7 is taken, and then
checked against the radius (PE0) or against D = V/(n J) of the rows (PER3).
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.base import units
from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.physics.dataset import Dataset

KIND = "apc"
SOURCE = "APC Propellers (Landing Products), published data file"
_PE0_COLUMNS = ("station", "chord", "pitch quoted", "pitch le-te", "sweep", "thickness", "twist", "max-thick")
_PER3_COLUMNS = "v j pe ct cp pwr torque thrust pwr torque thrust thr/pwr mach reyn fom".split()
_TOKEN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:NaN|Inf(?:inity)?)|\*+", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class ApcBlade:
    """Blade of a PE0 file, in SI units and radians."""

    # Designation (``10x5E``) and version line
    name: str
    version: str
    # Nominal diameter and pitch, tip radius [m]
    diameter_m: float
    pitch_m: float
    radius_m: float
    blades: int  # Number of blades
    # (N,) stations ascending in radius [m], chord [m], twist between the LE and TE parting lines [rad]
    r_m: Array
    chord_m: Array
    beta_rad: Array
    t_c: Array  # (N,) thickness over chord
    notes: tuple[str, ...]  # Remarks of the file, such as "APC12 airfoil is equivalent to NACA 4412"
    provenance: Mapping[str, Any]  # source, file, sha256, remark


@dataclass(frozen=True, eq=False)
class ApcPerformance:
    """Performance of a PER3 file."""

    name: str  # Designation
    # Nominal [m]
    diameter_m: float
    pitch_m: float
    blades: int  # Number of blades
    series: Dataset  # Kind ``vendor``; channels rpm, airspeed_m_s, J, eta, CT, CP, power_W, torque_Nm, thrust_N


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the head of a file is an APC PE0 or PER3 file.

    >>> sniff("10x5E (10x5E.dat)\n ----- AIRFOIL SUMMARY DATA -----"), sniff("RPM CT CP")
    (True, False)
    """
    return _form(head_text(head)) is not None


def _form(text: str) -> str | None:
    if "AIRFOIL SUMMARY DATA" in text and ".dat" in text:
        return "pe0"
    return "per3" if "PERFORMANCE DATA (versus advance ratio" in text else None


def read(path: str | os.PathLike[str]) -> ApcBlade | ApcPerformance:
    """Read either APC file by its content."""
    source = load_text(path)
    form = _form(source.text)
    if form is None:
        expected = "AIRFOIL SUMMARY DATA (PE0) or PERFORMANCE DATA (PER3)"
        source.refuse("", "neither form of an APC file", expected, "Is it an APC file?")
    return read_pe0(path) if form == "pe0" else read_per3(path)


def _readings(token: str, low: float, high: float) -> float | None:
    """Largest reading of a size within limits; a printed decimal point is final."""
    tries = [float(token)] if "." in token else [float(token) / 10**k for k in range(len(token))]
    return next((value for value in tries if low <= value <= high), None)


def parse_designation(text: str) -> tuple[float, float, int] | None:
    """Read diameter, pitch and blade number from an APC designation.

    >>> parse_designation("134x135-3"), parse_designation("10x47SF"), parse_designation("525x475")
    ((13.4, 13.5, 3), (10.0, 4.7, 2), (5.25, 4.75, 2))
    >>> parse_designation("propeller") is None
    True
    """
    match = re.match(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)(.*)$", text.strip(), re.IGNORECASE)
    diameter = _readings(match[1], 4.0, 28.0) if match else None
    if match is None or diameter is None:
        return None
    pitch = _readings(match[2], 0.25 * diameter, 1.7 * diameter) or _readings(match[2], 0.25 * diameter, 2.5 * diameter)
    blades = re.search(r"-B?([2-8])(?![0-9A-Za-z])", match[3])
    return None if pitch is None else (diameter, pitch, int(blades[1]) if blades else 2)


def _designation(source: SourceText) -> tuple[str, tuple[float, float, int]]:
    """Name and sizes from the first line with text, which reads ``10x4.7SF   (10x47SF.dat)``."""
    at, line = next(((i, s) for i, s in enumerate(source.lines, 1) if s.strip()), (1, ""))
    name = re.split(r"\s{2,}|\(", line.strip())[0].strip()
    for text in (name, *re.findall(r"\((.*?)\.dat\)", line)):
        if sizes := parse_designation(text):
            return name or text, sizes
    hint = "The first line should name the propeller"
    source.add(at, repr(line.strip()[:60]), "a designation such as 10x4.7SF", hint)
    return name, (math.nan, math.nan, 2)


def _pe0_columns(source: SourceText) -> tuple[int, list[str]]:
    """Line number of the unit line and the column names, the three pitches told apart by it."""
    for at, line in enumerate(source.lines, 1):
        names = line.lower().split()
        if names[:2] == ["station", "chord"]:
            below = source.lines[at].lower() if at < len(source.lines) else ""
            kinds = iter(re.findall(r"\((quoted|le-te|prather)\)", below))
            return at + 1, [f"pitch {next(kinds, '?')}" if name == "pitch" else name for name in names]
    source.refuse("", "no station table", "a header line that begins STATION CHORD", "Is this the PERF.PE0 file?")


def _pe0_rows(source: SourceText, at: int, names: list[str]) -> list[Array]:
    """Radii, chords, thickness ratios and twists of the station table up to the first blank line after it."""
    rows: dict[int, list[float]] = {}
    for index, line in enumerate(source.lines[at:], at + 1):
        tokens = line.split()
        if not tokens and rows:
            break
        values = [number(token) for token in tokens]
        if None in values:
            bad = values.index(None)
            source.add(f"{index}:{bad + 1}", tokens[bad], "a finite number", "Repair or delete the row")
        elif tokens and len(tokens) not in (len(names), len(names) + 1):
            source.add(index, f"{len(tokens)} numbers", f"{len(names)} numbers ({' '.join(names)})")
        elif tokens:
            rows[index] = [v for v in values[: len(names)] if v is not None]
    lines, data = list(rows), np.array([*rows.values()])
    if len(rows) < 3:
        if not source.faults:
            source.add(at, number_of(len(rows), "station"), "three or more", "Is the file cut off?")
        return []
    table = {name: data[:, i] for i, name in enumerate(names)}
    if missing := [name for name in _PE0_COLUMNS if name not in table]:
        source.add(at, f"no column {', '.join(missing)}", f"columns {', '.join(_PE0_COLUMNS)}")
        return []
    r, chord, _, le_te, _, t_c, twist_deg, thickness = [table[name] for name in _PE0_COLUMNS]
    twist = np.degrees(np.arctan2(le_te, 2 * math.pi * r))
    tests = [
        (np.diff(r, prepend=0.0) <= 0, "radii that do not ascend", "ascending radii [in]"),
        (chord <= 0, "a chord that is not positive", "positive chords [in]"),
        (np.abs(t_c * chord - thickness) > 0.002, "MAX-THICK", "thickness ratio x chord"),
        (np.abs(twist - twist_deg) > 0.5, "TWIST", "atan(LE-TE pitch/(2 pi r)) [deg]"),
    ]
    for bad_rows, got, expected in tests:
        for i in np.flatnonzero(bad_rows)[:1]:
            source.add(lines[i], got, expected, "Have columns shifted, or units changed?")
    return [r, chord, t_c, twist_deg]


def read_pe0(path: str | os.PathLike[str]) -> ApcBlade:
    """Read a blade geometry file."""
    source = load_text(path)
    name, (diameter_in, pitch_in, blades_named) = _designation(source)
    at, names = _pe0_columns(source)
    columns = _pe0_rows(source, at, names)
    tail = []
    for key, low, high in (("RADIUS", 1.0, 30.0), ("HUBTRA", 0.0, 15.0), ("BLADES", 2, 12)):
        match = re.search(rf"^\s*{key}:\s*(\S+)", source.text, re.MULTILINE)
        value = number(match[1]) if match else None
        if value is None or not low <= value <= high:
            got = f"{key}: {match[1]}" if match else f"no line {key}:"
            source.add(key, got, f"a number from {low:g} to {high:g}", "Is the file cut off?")
        tail.append(math.nan if value is None else value)
    R, _, blades = tail
    if abs(2 * R - diameter_in) > 0.03 * diameter_in:
        expected = f"the diameter of {name}, {diameter_in:g} in"
        source.add("RADIUS", f"{2 * R:g} in", expected, "Do name and data belong together?")
    if columns and columns[0][-1] > 1.01 * R:
        got = f"a station at {columns[0][-1]:g} in"
        source.add("RADIUS", got, f"stations up to {R:g} in", "Have units changed?")
    source.check()
    r, chord, t_c, twist_deg = columns
    inch = units.INCH
    version = re.search(r"^\s*(v\d{4}\S*)", source.text, re.MULTILINE)
    notes = tuple(re.findall(r"^\s*NOTE:\s*(.*?)\s*$", source.text, re.MULTILINE))
    other = f"{number_of(len(names), 'column')}; blade number by the name {blades_named}"
    remark = other if blades_named != blades else ""
    return ApcBlade(
        name=name, version=version[1] if version else "", diameter_m=diameter_in * inch, pitch_m=pitch_in * inch,
        radius_m=R * inch, blades=int(blades), r_m=r * inch, chord_m=chord * inch, beta_rad=np.radians(twist_deg),
        t_c=t_c, notes=notes, provenance={"source": SOURCE, **source.about, "remark": remark},
    )  # fmt: skip


def _per3_row(source: SourceText, index: int, width: int, rpm: float | None) -> tuple[float, ...]:
    """One line as (rpm, columns...); empty where it is no row, which is a fault of the file."""
    line = source.lines[index - 1]
    tokens, rest = _TOKEN.findall(line), _TOKEN.sub("", line).strip()
    if len(tokens) == 2 and rpm is not None:  # V and J of a point at which the code failed
        tokens, rest = tokens + ["NaN"] * (width - 2), ""
    if len(tokens) != width or rest:
        expected = f"{width} numbers ({' '.join(_PER3_COLUMNS[:width])})"
        source.add(index, repr(line.strip()[:60]), expected, "Repair or delete the row")
    elif rpm is None:
        source.add(index, "a row before any rpm", "PROP RPM = ... above it")
    else:
        values = [math.nan if v is None else v for v in map(number, tokens)]
        if math.isnan(values[0]) or math.isnan(values[1]):
            source.add(index, "no V or J", "numbers", "Repair or delete the row")
        return (rpm, *values)
    return ()


def _per3_rows(source: SourceText) -> dict[int, tuple[float, ...]]:
    """Rows as (rpm, columns...) by their line; NaN where the file says so."""
    rpm: float | None = None
    width = 0
    rows: dict[int, tuple[float, ...]] = {}
    for index, line in enumerate(source.lines, 1):
        words = line.lower().split()
        if match := re.search(r"PROP RPM\s*=\s*(\S+)", line):
            rpm = number(match[1])
            if rpm is None or rpm <= 0:
                source.add(index, f"PROP RPM = {match[1]}", "a positive number")
        elif words[:3] == _PER3_COLUMNS[:3]:
            width = len(words)
            if width not in (8, 15) or words != _PER3_COLUMNS[:width]:
                expected = f"{' '.join(_PER3_COLUMNS[:8])}, or 15 columns"
                source.add(index, " ".join(words), expected, "An unknown form of this file")
        elif width and words and (words[0][0].isdigit() or words[0][0] in "+-.*"):
            if row := _per3_row(source, index, width, rpm):
                rows[index] = row
    if not rows and not source.faults:
        source.add("", "no rows", "blocks under PROP RPM = ...", "Is the file cut off?")
    return rows


def read_per3(path: str | os.PathLike[str]) -> ApcPerformance:
    """Read a performance file."""
    source = load_text(path)
    name, (diameter_in, pitch_in, blades) = _designation(source)
    rows = _per3_rows(source)
    source.check()
    data = np.array([*rows.values()])
    rpm, V, J, eta, CT, CP = data.T[:6]
    if data.shape[1] > 9:
        power, torque, thrust = data.T[9:12]
    else:
        power, torque, thrust = data[:, 6] * units.HP, data[:, 7] * units.LBF * units.INCH, data[:, 8] * units.LBF
    V = V * units.MPH
    fast = (np.abs(J) > 0.3) & (V > 5.0)  # where rounding (0.1 mph, 0.01 in J) is small
    if np.any(fast):
        implied = float(np.median(V[fast] / (rpm[fast] / 60 * J[fast]))) / units.INCH
        if abs(implied - diameter_in) > 0.03 * diameter_in:
            expected = f"the diameter of {name}, {diameter_in:g} in"
            source.refuse("J", f"V/(n J) = {implied:.2f} in", expected, "Is a decimal point missing from the name?")
    missing = np.isnan(data[:, 1:9]).any(axis=1)
    flags = tuple(("NaN in the file",) if bad else () for bad in missing)
    values = {
        "rpm": rpm, "airspeed_m_s": V, "J": J, "eta": eta, "CT": CT, "CP": CP, "power_W": power, "torque_Nm": torque,
        "thrust_N": thrust,
    }  # fmt: skip
    remark = "computed by APC's vortex code, not measured; dimensional columns are rounded (use CT, CP at low rpm)"
    about = {"source": SOURCE, **source.about, "remark": remark}
    labels = tuple(f"{os.path.basename(source.name)}:{line}" for line in rows)
    series = Dataset("vendor", f"APC {name}", values, {}, flags, about, labels)
    return ApcPerformance(name, diameter_in * units.INCH, pitch_in * units.INCH, blades, series)

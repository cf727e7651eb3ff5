r"""APC files: blade geometry (``*-PERF.PE0``) and computed performance (``PER3_*.dat``).

PE0 holds about 40 stations in inches and degrees, then radius, hub transition, blade number and sections. The columns
are found by their names, so that the 13-column form and forms with further columns read alike; each row is checked
against itself (maximum thickness = ratio x chord, twist = atan(pitch/(2 pi r)) with the LE-TE pitch), so that a shifted
column cannot pass.

PER3 holds blocks of constant rpm: V [mph], J, Pe, Ct, Cp, PWR [hp], Torque [in lbf], Thrust [lbf]; newer files add
W, N m, N, g/W, Mach, Reynolds number, figure of merit (that form: not checked against a file). It is APC's own vortex
code, NOT measured, so the series is of kind ``vendor``. Points at which that code failed are printed as ``-NaN`` and
glued to the column before (``0.34-NaN``); they stay in the series as NaN with a flag. Coefficients are in the propeller
convention.

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
from numpy.typing import NDArray

from bemt import units
from bemt.errors import Fault, InputError
from bemt.importers import SourceText, head_text, load_text, number
from bemt.series import Series

__all__ = ["KIND", "ApcBlade", "ApcPerformance", "parse_designation", "read", "read_pe0", "read_per3", "sniff"]

KIND = "apc"
SOURCE = "APC Propellers (Landing Products), published data file"
Array = NDArray[np.float64]

_PER3_COLUMNS = "V J Pe Ct Cp PWR Torque Thrust PWR Torque Thrust THR/PWR Mach Reyn FOM".lower().split()
_TOKEN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:NaN|Inf(?:inity)?)|\*+", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class ApcBlade:
    """Blade of a PE0 file, in SI units and radians.

    Parameters
    ----------
    name, version : str
        Designation (``10x5E``) and version line.
    diameter_m, pitch_m, radius_m, hub_radius_m : float
        Nominal diameter and pitch, tip radius, radius of the hub transition. [m]
    blades : int
        Number of blades.
    r_m, chord_m, beta_rad : (N,) array
        Stations ascending in radius [m], chord [m], twist between the LE and TE parting lines [rad].
    t_c : (N,) array
        Thickness over chord.
    sweep_m, z_high_m : (N,) array
        Leading edge ahead of the radial line; highest point of the upper surface. [m]
    pitch_quoted_m, pitch_prather_m : (N,) array
        Pitch as quoted, and as a gauge on the lower surface reads it. [m]
    airfoils : tuple of (float, str)
        Radius [m] where the transition from the first to the last section starts and ends, with the section names.
    notes : tuple of str
        Remarks of the file, such as "APC12 airfoil is equivalent to NACA 4412".
    provenance : mapping
        source, file, sha256, remark.
    """

    name: str
    version: str
    diameter_m: float
    pitch_m: float
    radius_m: float
    hub_radius_m: float
    blades: int
    r_m: Array
    chord_m: Array
    beta_rad: Array
    t_c: Array
    sweep_m: Array
    z_high_m: Array
    pitch_quoted_m: Array
    pitch_prather_m: Array
    airfoils: tuple[tuple[float, str], ...]
    notes: tuple[str, ...]
    provenance: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class ApcPerformance:
    """Performance of a PER3 file.

    Parameters
    ----------
    name : str
        Designation.
    diameter_m, pitch_m : float
        Nominal. [m]
    blades : int
        Number of blades.
    series : Series
        Kind ``vendor``; channels rpm, airspeed_m_s, J, eta, CT, CP, power_W, torque_Nm, thrust_N.
    """

    name: str
    diameter_m: float
    pitch_m: float
    blades: int
    series: Series


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the head of a file is an APC PE0 or PER3 file.

    Parameters
    ----------
    head : bytes or str
        First bytes of a file.

    Returns
    -------
    bool
        True for either.

    Examples
    --------
    >>> sniff("10x5E (10x5E.dat)\n ----- AIRFOIL SUMMARY DATA -----"), sniff("RPM CT CP")
    (True, False)
    """
    return _form(head_text(head)) is not None


def _form(text: str) -> str | None:
    if "AIRFOIL SUMMARY DATA" in text and ".dat" in text:
        return "pe0"
    return "per3" if "PERFORMANCE DATA (versus advance ratio" in text else None


def _readings(token: str, low: float, high: float) -> float | None:
    """Largest reading of a size within limits; a printed decimal point is final."""
    tries = [float(token)] if "." in token else [float(token) / 10**k for k in range(len(token))]
    return next((value for value in tries if low <= value <= high), None)


def parse_designation(text: str) -> tuple[float, float, int] | None:
    """Read diameter, pitch and blade number from an APC designation.

    Parameters
    ----------
    text : str
        Such as ``10x4.7SF``, ``11x7E-3`` or, without decimal points, ``134x135-3``.

    Returns
    -------
    (diameter_in, pitch_in, blades) or None
        In inches; None when there is no plausible reading.

    Examples
    --------
    >>> parse_designation("134x135-3"), parse_designation("10x47SF"), parse_designation("525x475")
    ((13.4, 13.5, 3), (10.0, 4.7, 2), (5.25, 4.75, 2))
    >>> parse_designation("propeller") is None
    True
    """
    match = re.match(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)(.*)$", text.strip(), re.IGNORECASE)
    diameter = _readings(match[1], 4.0, 28.0) if match else None
    if match is None or diameter is None:
        return None
    pitch = _readings(match[2], 0.25 * diameter, 1.7 * diameter)
    blades = re.search(r"-B?([2-8])(?![0-9A-Za-z])", match[3])
    return None if pitch is None else (diameter, pitch, int(blades[1]) if blades else 2)


def _designation(source: SourceText, faults: list[Fault]) -> tuple[str, tuple[float, float, int]]:
    """Name and sizes from the first line with text, which reads ``10x4.7SF   (10x47SF.dat)``."""
    at, line = next(((i, s) for i, s in enumerate(source.lines, 1) if s.strip()), (1, ""))
    name = re.split(r"\s{2,}|\(", line.strip())[0].strip()
    for text in (name, *re.findall(r"\((.*?)\.dat\)", line)):
        if sizes := parse_designation(text):
            return name or text, sizes
    hint = "The first line should name the propeller"
    faults.append(Fault(source.name, str(at), repr(line.strip()[:60]), "a designation such as 10x4.7SF", hint))
    return name, (math.nan, math.nan, 2)


def _provenance(source: SourceText, remark: str) -> dict[str, str]:
    return {"source": SOURCE, "file": source.name, "sha256": source.sha256, "remark": remark}


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
    """Read a blade geometry file.

    Parameters
    ----------
    path : str or path
        PE0 file, of 13 columns or with more.

    Returns
    -------
    ApcBlade
        In SI units and radians.

    Raises
    ------
    InputError
        With all faults found.
    """
    source = load_text(path)
    faults: list[Fault] = []
    name, (diameter_in, pitch_in, blades_named) = _designation(source, faults)
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
        provenance=_provenance(source, remark),
    )  # fmt: skip


def _per3_rows(source: SourceText, faults: list[Fault]) -> tuple[list[tuple[float, ...]], list[int]]:
    """Rows as (rpm, columns...); NaN where the file says so."""
    rpm: float | None = None
    width = 0
    rows: list[tuple[float, ...]] = []
    lines: list[int] = []
    for index, line in enumerate(source.lines, 1):
        if match := re.search(r"PROP RPM\s*=\s*(\S+)", line):
            rpm = number(match[1])
            if rpm is None or rpm <= 0:
                faults.append(Fault(source.name, str(index), f"PROP RPM = {match[1]}", "a positive number", ""))
            continue
        words = line.lower().split()
        if words[:3] == _PER3_COLUMNS[:3]:
            width = len(words)
            if width not in (8, 15) or words != _PER3_COLUMNS[:width]:
                expected = f"{' '.join(_PER3_COLUMNS[:8])}, or 15 columns"
                faults.append(Fault(source.name, str(index), " ".join(words), expected, "An unknown form of this file"))
            continue
        if not width or not words or not (words[0][0].isdigit() or words[0][0] in "+-.*"):
            continue
        tokens = _TOKEN.findall(line)
        if len(tokens) != width or _TOKEN.sub("", line).strip():
            expected = f"{width} numbers ({' '.join(_PER3_COLUMNS[:width])})"
            faults.append(Fault(source.name, str(index), repr(line.strip()[:60]), expected, "Repair or delete the row"))
        elif rpm is None:
            faults.append(Fault(source.name, str(index), "a row before any rpm", "PROP RPM = ... above it", ""))
        else:
            values = [math.nan if v is None else v for v in map(number, tokens)]
            if math.isnan(values[0]) or math.isnan(values[1]):
                faults.append(Fault(source.name, str(index), "no V or J", "numbers", "Repair or delete the row"))
            rows.append((rpm, *values))
            lines.append(index)
    if not rows and not faults:
        faults.append(Fault(source.name, "", "no rows", "blocks under PROP RPM = ...", "Is the file cut off?"))
    return rows, lines


def read_per3(path: str | os.PathLike[str]) -> ApcPerformance:
    """Read a performance file.

    Parameters
    ----------
    path : str or path
        PER3 file, of 8 or 15 columns.

    Returns
    -------
    ApcPerformance
        All rpm blocks in one series.

    Raises
    ------
    InputError
        With all faults found; also when the rows contradict the diameter in the name by more than 3 %.
    """
    source = load_text(path)
    faults: list[Fault] = []
    name, (diameter_in, pitch_in, blades) = _designation(source, faults)
    rows, lines = _per3_rows(source, faults)
    if faults:
        raise InputError(faults)
    data = np.array(rows)
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
            got, expected = f"V/(n J) = {implied:.2f} in", f"the diameter of {name}, {diameter_in:g} in"
            raise InputError(Fault(source.name, "J", got, expected, "Is a decimal point missing from the name?"))
    missing = np.isnan(data[:, 1:9]).any(axis=1)
    flags = tuple(("NaN in the file",) if bad else () for bad in missing)
    values = {
        "rpm": rpm, "airspeed_m_s": V, "J": J, "eta": eta, "CT": CT, "CP": CP, "power_W": power, "torque_Nm": torque,
        "thrust_N": thrust,
    }  # fmt: skip
    remark = "computed by APC's vortex code, not measured; dimensional columns are rounded (use CT, CP at low rpm)"
    labels = tuple(f"{os.path.basename(source.name)}:{line}" for line in lines)
    series = Series("vendor", f"APC {name}", values, {}, flags, _provenance(source, remark), labels)
    return ApcPerformance(name, diameter_in * units.INCH, pitch_in * units.INCH, blades, series)


def read(path: str | os.PathLike[str]) -> ApcBlade | ApcPerformance:
    """Read either APC file by its content.

    Parameters
    ----------
    path : str or path
        PE0 or PER3 file.

    Returns
    -------
    ApcBlade or ApcPerformance
        What it holds.

    Raises
    ------
    InputError
        With all faults found.
    """
    source = load_text(path)
    form = _form(source.text)
    if form is None:
        expected = "AIRFOIL SUMMARY DATA (PE0) or PERFORMANCE DATA (PER3)"
        raise InputError(Fault(source.name, "", "neither form of an APC file", expected, "Is it an APC file?"))
    return read_pe0(path) if form == "pe0" else read_per3(path)

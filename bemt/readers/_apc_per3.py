"""APC computed performance (PER3), see :mod:`bemt.readers.apc`."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass

import numpy as np

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset
from bemt.readers import SourceText, load_text, number
from bemt.readers._apc_common import designation, provenance

_PER3_COLUMNS = "V J Pe Ct Cp PWR Torque Thrust PWR Torque Thrust THR/PWR Mach Reyn FOM".lower().split()
_TOKEN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:NaN|Inf(?:inity)?)|\*+", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class ApcPerformance:
    """Performance of a PER3 file."""

    name: str  # Designation
    # Nominal [m]
    diameter_m: float
    pitch_m: float
    blades: int  # Number of blades
    series: Dataset  # Kind ``vendor``; channels rpm, airspeed_m_s, J, eta, CT, CP, power_W, torque_Nm, thrust_N


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
        if len(tokens) == 2 and rpm is not None:  # V and J of a point at which the code failed
            tokens += ["NaN"] * (width - 2)
            line = " ".join(tokens)
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
    """Read a performance file."""
    source = load_text(path)
    faults: list[Fault] = []
    name, (diameter_in, pitch_in, blades) = designation(source, faults)
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
    series = Dataset("vendor", f"APC {name}", values, {}, flags, provenance(source, remark), labels)
    return ApcPerformance(name, diameter_in * units.INCH, pitch_in * units.INCH, blades, series)

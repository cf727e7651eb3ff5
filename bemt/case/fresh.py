"""Case files for what little a user knows: a label, stations in a file, a ducted fan; unknowns become assumptions."""

from __future__ import annotations

import math
import re
from pathlib import Path

from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.case.unknowns import AIR, FAN, HUB, OFFSET, SECTION, SURFACE, Unknown, label_chord
from geometry.common import GeometryError
from geometry.designation import parse_designation

__all__ = ["case_name", "fan_text", "label_parts", "label_text", "of_stations", "stations_text"]

TIP_SPEED = 120.0
"""Speed of the blade tips at the operating point of a new case, for want of a better one. [m/s]"""

FAN_RANGES = """
[[assumptions]]
key = "rotor.blades"
values = [{blades_low}, {blades}, {blades_high}]
why = "blade count not certain; count the blades and delete this entry"

[[assumptions]]
key = "blade.pitch_in"
low = {pitch_low:.4g}
high = {pitch_high:.4g}
why = "pitch not known; such fans have about 1.2 to 1.7 diameters per turn"

[[assumptions]]
key = "duct.tip_gap_mm"
low = {gap_low:.3g}
high = {gap_high:.3g}
why = "gap not known; typically 0.3 to 1 % of the diameter"

[[assumptions]]
key = "duct.exit_area_ratio"
low = 0.85
high = 1.0
why = "nozzle not known; 85 to 100 % of the swept annulus"
"""


def _blocks(*unknowns: Unknown) -> str:
    return "".join(item.block() for item in unknowns)


def label_parts(label: str, blades: int | None = None) -> tuple[float, float, int]:
    """Diameter and pitch [in] and blades (2 unless told) of ``10x5``, ``8x4.5x3``."""
    try:
        D, pitch, marked = parse_designation(label)
    except GeometryError as error:
        raise InputError([Fault("LABEL", *fault) for fault in error.faults]) from None
    if blades and marked and blades != marked:
        raise InputError(Fault("--blades", "", str(blades), f"{marked}, as in {label}"))
    return D, pitch, blades or marked or 2


def case_name(text: str) -> str:
    """Name of a case, fit for a folder, from a label or a file."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", text).strip("._-") or "rotor"


def _rpm(diameter_m: float, rpm: float | None, tip_speed: float = TIP_SPEED) -> float:
    """Speed as told, else that of the tip speed, in two digits. [rev/min]"""
    return float(f"{60.0 * tip_speed / (math.pi * diameter_m):.2g}") if rpm is None else rpm


def _operating(rpm: float, airspeed_m_s: float, told: bool) -> str:
    why = "" if told else "  # gives a tip speed near 120 m/s; replace it with yours"
    return f"""
[operating]
rpm = {rpm:.6g}{why}
airspeed_m_s = {airspeed_m_s:g}  # 0: static

[air]
density_kg_m3 = 1.225  # or temperature_C and pressure_hPa
"""


def label_text(label: str, blades: int | None = None, rpm: float | None = None, airspeed_m_s: float = 0.0) -> str:
    """Write the case of a label such as ``10x5``."""
    D, pitch, B = label_parts(label, blades)
    name = case_name(f"prop_{D:g}x{pitch:g}" + (f"x{B}" if B != 2 else ""))
    chord = label_chord(D * INCH)
    unknowns = _blocks(HUB, OFFSET, chord, *SECTION, *SURFACE, AIR)
    return f"""# A {D:g}x{pitch:g} propeller from its label. Each [[assumptions]] entry is an unknown with a range.
# `bemt sweep --details` prints its effect on the thrust. When you measure a value, enter it and delete the assumption.
schema = "bemt.case/1"
name = "{name}"
title = "{D:g}x{pitch:g} propeller, {B} blades"
# references = "references.csv"  # measured values in this folder: quantity,value,unit,uncertainty,kind,source,...

[rotor]
kind = "propeller"
blades = {B}
diameter_in = {D:g}
hub_ratio = 0.15

[blade]
pitch_in = {pitch:g}
beta_offset_deg = 0.7
chord_law = "apc_like"
max_chord_over_R = {chord.value:.3g}

[blade.section]
camber = 0.035
thickness = 0.09
{_operating(_rpm(D * INCH, rpm), airspeed_m_s, rpm is not None)}{unknowns}"""


def stations_text(
    file: str,
    diameter_m: float,
    blades: int,
    rpm: float | None = None,
    airspeed_m_s: float = 0.0,
    hub_ratio: float = 0.15,
    key: str = "stations",
) -> str:
    """Write the case of a blade whose chord and angle stand in a file beside it."""
    return f"""# A propeller with the stations of {file}. Each unknown is an assumption with a range.
schema = "bemt.case/1"
name = "{case_name(Path(file).stem)}"
title = "{blades} blades, {1e3 * diameter_m:.4g} mm, stations of {file}"

[rotor]
kind = "propeller"
blades = {blades}
diameter_mm = {1e3 * diameter_m:.6g}
hub_ratio = {hub_ratio:.4g}

[blade]
{key} = "{file}"

[blade.section]
camber = 0.035
thickness = 0.09
{_operating(_rpm(diameter_m, rpm), airspeed_m_s, rpm is not None)}{_blocks(*SECTION, *SURFACE, AIR)}"""


def fan_text(
    diameter_m: float, pitch_in: float | None = None, blades: int | None = None, rpm: float | None = None
) -> str:
    """Write the case of a ducted fan of which the diameter is known."""
    D, B = diameter_m / INCH, blades or 11
    P = pitch_in or 1.45 * D
    mm = 1e3 * diameter_m
    ranges = FAN_RANGES.format(
        blades=B,
        blades_low=max(B - 2, 2),
        blades_high=B + 2,
        pitch_low=0.85 * P,
        pitch_high=1.15 * P,
        gap_low=3e-3 * mm,
        gap_high=1e-2 * mm,
    )
    if blades:  # counted: no assumption
        ranges = "\n[[assumptions]]" + ranges.split("[[assumptions]]", 2)[2]
    told = _rpm(diameter_m, rpm, 180.0)
    return f"""# A ducted fan of {mm:.4g} mm. Each entry [[assumptions]] is an unknown with a range.
schema = "bemt.case/1"
name = "fan_{mm:.0f}"
title = "ducted fan, {mm:.4g} mm, {B} blades"

[rotor]
kind = "fan"
blades = {B}
diameter_mm = {mm:.6g}
hub_ratio = 0.37

[blade]
pitch_in = {P:.4g}
chord_law = "fan"
max_chord_over_R = 0.45

[blade.section]
camber = 0.05
thickness = 0.09

[duct]
tip_gap_mm = {6e-3 * mm:.3g}
length_mm = {0.87 * mm:.4g}
lip_radius_mm = {0.058 * mm:.3g}
exit_area_ratio = 0.925

[duct.stator]
blades = 5
chord_mm = {0.29 * mm:.3g}
recovery = 0.8
{_operating(told, 0.0, rpm is not None).replace("120", "180")}{ranges}{_blocks(*FAN, *SURFACE, AIR)}"""


def of_stations(file: Path, diameter_m: float) -> tuple[float, str]:
    """Hub ratio and key of a file of stations: our own CSV, a geometry file of UIUC, or an APC PE0 file."""
    from bemt.readers import load_text

    head = load_text(file).text[:4000]
    first = head.lstrip().partition("\n")[0]
    if "," in first:
        from bemt.readers._stations import read_stations

        return max(min(float(read_stations(file, 0.5 * diameter_m)[0].min()), 0.3), 0.05), "stations"
    if re.match(r"\s*r/R\b", first):
        rows = [float(row.split()[0]) for row in head.splitlines()[1:] if row.split()]
        return max(min(min(rows, default=0.15), 0.3), 0.05), "uiuc"
    if "STATION" in head and "CHORD" in head:
        return 0.15, "apc"
    got, expected = repr(first.strip()[:60]), "r_over_R,chord_over_R,beta_deg, a UIUC geometry file or an APC PE0 file"
    raise InputError(Fault(file.as_posix(), "1", got, expected, "Read recordings with `bemt import`"))

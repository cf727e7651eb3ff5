"""Case files for what little a user knows: a label, stations in a file, a ducted fan; unknowns become assumptions."""

from __future__ import annotations

import math
import os
import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.data.readers.uiuc_names import FAMILIES, class_of, family_of
from bemt.rotors.case.drive_schema import LIPO_SOC, LIPO_V
from bemt.rotors.case.reading import parse_reading
from bemt.rotors.case.unknowns import (
    AIR,
    CLASS_CHORD,
    DRIVE,
    FAN,
    HUB,
    SURFACE,
    THICKNESS,
    Unknown,
    label_chord,
    offset_of,
    section_of,
    surface_of,
)
from bemt.rotors.measured import MeasuredRotor, find, records
from geometry.common import GeometryError
from geometry.designation import ENDINGS, Designation, blade_class, parse_designation

if TYPE_CHECKING:
    from bemt.data.readers.stations import BladeStations

TIP_SPEED = 120.0
"""Speed of the blade tips at the operating point of a new case, for want of a better one. [m/s]"""

SOC = 0.5
"""Charge at which a new case states full throttle and hover: the middle of a flight."""

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


def is_path(text: str) -> bool:
    """Whether a word can only be a path: ``cases/prop_8x5`` is no label of an 8x5."""
    return text.endswith(".toml") or "/" in text or os.sep in text


def looks_like_label(text: str) -> bool:
    """Whether a word has the sizes of a label, right or wrong, or is all digits."""
    return not is_path(text) and (text.strip().isdigit() or _LABEL.search(text) is not None)


def own_name(text: str) -> str:
    """Size in a name that somebody or `case_name` gave a case: a word that no maker has is glued to it; else "".

    >>> [own_name(t) for t in ("my12x6", "b_12x6", "12x6", "my 12x6", "APC12x6", "HQ5x4.3x3", "prop_12x6")]
    ['12x6', '12x6', '', '', '', '', '12x6']
    """
    glued = re.fullmatch(r"([A-Za-z]+)[_-]?(\d.*)", text.strip())
    if not glued or not _LABEL.search(glued[2]) or glued[1].casefold() in _MAKERS or blade_class(glued[1]):
        return ""
    return glued[2]


def _case_for_label(path: str) -> Fault:
    hint = f"A path is a case: bemt sweep {path} solves it, and so does bemt.load({path!r})"
    return Fault("label", "", repr(path), "a label, such as 10x5", hint)


def or_a_fan(error: InputError, label: object) -> InputError:
    """Faults of a label with the command that begins a ducted fan, where the label holds one size, or none."""
    if not isinstance(label, str) or is_path(label) or re.search(r"\d\D+\d", label):
        return error
    size = re.search(r"\d+(?:\.\d+)?\s*(?:mm|in)\b", label)
    fan = f"A ducted fan? bemt new {size[0].replace(' ', '') if size else '70mm'} --fan, with its diameter"
    return InputError([replace(f, hint=". ".join(filter(None, (f.hint.rstrip("."), fan)))) for f in error.faults])


def read_as(label: str, diameter_in: float, pitch_in: float) -> str:
    """A label, and how it was read where it writes its size in another way.

    >>> read_as("10x47", 10.0, 4.7), read_as("APC 10 x 4.7SF", 10.0, 4.7)
    ('10x47 read as 10x4.7', 'APC 10 x 4.7SF')
    """
    size = f"{diameter_in:g}x{pitch_in:g}"
    plain = re.sub(r"\s*[x\u00d7*]\s*|\s+by\s+", "x", label.casefold())
    return label if size in plain else f"{label} read as {size}"


def read_label(label: str, blades: int | None = None) -> Designation:
    """What a label such as ``10x5`` or ``APC 8x4.5x3`` says, with the blades filled in: as told, else two."""
    if not isinstance(label, str):
        raise InputError(Fault("", "label", f"{type(label).__name__} {label!r:.40}", "a label, such as 10x5"))
    if is_path(label):
        raise InputError(_case_for_label(label))
    try:
        one = records().get(label.strip())
        found = parse_designation(label, blades) if one is None else one.designation
    except GeometryError as error:
        if Path(label).exists():
            raise InputError(_case_for_label(label)) from None
        raise InputError([Fault("label", *fault) for fault in error.faults]) from None
    if blades and found.blades and blades != found.blades:
        raise InputError(Fault("--blades", "", str(blades), f"{found.blades}, as in {label}"))
    return replace(found, blades=blades or found.blades or 2)


OPEN_ENDINGS = tuple(sorted(letters.upper() for letters, kind in ENDINGS.items() if kind in CLASS_CHORD))
"""Endings of a label that tell the kind of blade."""


def open_kind(label: str, blades: int | None = None) -> str:
    """What a label leaves open that states no kind of blade, and which series were measured in its size; else empty.

    >>> open_kind("APC 10x5E"), open_kind("APC 10x5").rpartition(": ")[2]
    ('', 'APC Thin Electric')
    >>> open_kind("Foobar 10x5").rpartition("; ")[2], "known" in open_kind("10x5")
    ("of a maker 'Foobar' nothing is known", False)
    """
    told = read_label(label, blades)
    if told.blade_class or class_of(family_of(told.maker, None, told.blades)):
        return ""
    same = {FAMILIES.get(one.family, one.family) for one in records().values() if one.has_size(told)}
    kin = sorted({name for name in same if told.maker.casefold() in name.casefold()} or same)
    measured = f"; measured in this size (--series): {', '.join(kin)}" if kin else ""
    known = any(told.maker.casefold() in name.casefold() for name in (*FAMILIES, *FAMILIES.values()))
    measured += "" if known else f"; of a maker {told.maker!r} nothing is known"
    return f"no ending ({', '.join(OPEN_ENDINGS)}): the kind of blade is open and changes the answer{measured}"


def case_name(text: str) -> str:
    """Name of a case, fit for a folder, from a label or a file."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", text).strip("._-") or "rotor"


def _rpm(diameter_m: float, rpm: float | None, tip_speed: float = TIP_SPEED) -> float:
    """Speed as told, else that of the tip speed, in two digits. [rev/min]"""
    return float(f"{60.0 * tip_speed / (math.pi * diameter_m):.2g}") if rpm is None else rpm


def _operating(rpm: float, airspeed_m_s: float, why: str) -> str:
    return f"""
[operating]
rpm = {rpm:.6g}{f"  # {why}" if why else ""}
airspeed_m_s = {airspeed_m_s:g}  # 0: static

[air]
density_kg_m3 = 1.225  # or temperature_C and pressure_hPa
"""


def drive_text(kv: float, cells: int) -> str:
    """Table [drive] of a motor of which the label is known."""
    sag, size, idle = (item.value for item in DRIVE)
    return f"""
[drive]
kv = {kv:g}  # rev/min/V
cells = {cells}
soc = {SOC:g}  # charge at which full throttle and hover are stated

[drive.battery]
sag = {sag:g}  # or resistance_mohm, of the pack with leads
# capacity_Ah = 2.2  # for the flight time

[drive.motor]
size = {size:g}  # a winding usual for its current. Better: replace this line by resistance_mohm, mass_g or stator
idle_share = {idle:g}  # of the current. Better: replace this line by no_load_A, from the motor's sheet

# [drive.vehicle]  # for hover
# mass_kg = 1.4
# rotors = 4
"""


def full_rpm(kv: float, cells: int) -> float:
    """Speed at full throttle of a motor with a propeller that suits it, by its typical losses. [rev/min]"""
    sag, drop = DRIVE[0].value, 0.20  # the median of 859 motors
    return float(f"{kv * cells * float(np.interp(SOC, LIPO_SOC, LIPO_V)) * (1.0 - sag) * (1.0 - drop):.5g}")


def _tail(
    diameter_m: float, rpm: float | None, airspeed_m_s: float, motor: tuple[float, int] | None, *unknowns: Unknown
) -> str:
    """Operating point, air, drive and assumptions."""
    drive, more = ("", ()) if motor is None else (drive_text(*motor), DRIVE)
    full = rpm is None and motor is not None
    why = (
        ""
        if rpm is not None
        else "full throttle; see [drive]"
        if full
        else f"gives a tip speed near {TIP_SPEED:g} m/s; "
    )
    why += "" if rpm is not None or full else "replace it with yours"
    n = full_rpm(*motor) if full and motor is not None else _rpm(diameter_m, rpm)
    return _operating(n, airspeed_m_s, why) + drive + _blocks(*unknowns, *more)


def label_text(
    label: str, blades: int | None = None, rpm: float | None = None, airspeed_m_s: float = 0.0,
    family: str | None = None, motor: tuple[float, int] | None = None, measured: bool = True,
    reading: str | None = None,
) -> str:  # fmt: skip
    """Write the case of a label such as ``10x5``, with its maker's series and K_v and cells of a motor if known.

    A label that names a measured propeller is that propeller, unless ``measured`` is False. A ``reading``
    (`bemt.rotors.case.reading`) makes it the rotor that gave it.
    """
    told = read_label(label, blades)
    if reading is not None:
        parse_reading(reading)
    D, B = told.diameter_in, told.blades
    family = family or family_of(told.maker, told.blade_class, told.blades)
    told = told if told.blade_class else replace(told, blade_class=class_of(family))
    chord, section = label_chord(D * INCH, told.blade_class, B, told.width), section_of(told.blade_class)
    offset = offset_of(family)
    known = find(told, family) if measured else None
    surface = surface_of(told.blade_class, B)
    open_ = (HUB, offset, chord, *section, *surface, AIR)
    values = (chord.value, section[0].value, offset.value)
    source = f"from its label. {_UNKNOWN}"
    drag = "" if surface is SURFACE else f"\n[model]\ndrag_level = {surface[1].value:g}\n"
    if known is not None:
        open_, values = (AIR,), (known.chord, known.camber, known.offset_deg)
        source = f"fitted to its measurement in the {known.source}."
    return f"""# A {told.size} propeller {source}
schema = "bemt.case/1"
name = "{_label_name(told)}"
title = "{_title(told)}"
# references = "references.csv"  # measured values in this folder: quantity,value,unit,uncertainty,kind,source,...

[rotor]
kind = "propeller"
blades = {B}
diameter_in = {D:g}
hub_ratio = 0.15
{_sense(told)}
[blade]
pitch_in = {told.pitch_in:g}
beta_offset_deg = {values[2]:.3g}
chord_law = "apc_like"
max_chord_over_R = {values[0]:.3g}
{_series(told, family)}{_as_built(known, reading)}
[blade.section]
camber = {values[1]:g}
thickness = 0.09
{drag}{_tail(D * INCH, rpm, airspeed_m_s, motor, *open_)}"""


_UNKNOWN = (
    "Each [[assumptions]] entry is an unknown with a range.\n# `bemt sweep --details` prints its effect on the thrust. "
    "When you measure a value, enter it and delete the assumption."
)


def _as_built(known: MeasuredRotor | None, reading: str | None) -> str:
    if known is None and reading is None:
        return ""
    rows = ([f'measured = "{known.name}"'] if known else []) + ([f'reading = "{reading}"'] if reading else [])
    return f'known_from = "{"measured" if known else "reference"}"\n\n[blade.as_built]\n' + "\n".join(rows) + "\n"


def _label_name(told: Designation) -> str:
    kind = f"_{told.blade_class}" if told.blade_class else ""
    return case_name(f"{_OWN}_{told.size}{kind}")


def _title(told: Designation) -> str:
    kind = f", {told.blade_class.replace('_', ' ')}" if told.blade_class else ""
    return f"{told.maker} {told.size} propeller, {told.blades} blades{kind}".replace('"', "").strip()


def _sense(told: Designation) -> str:
    return 'rotation = "left"\n' if told.reverse else ""


def _series(told: Designation | None, family: str | None) -> str:
    """Keys of [blade] that say of which kind a blade is."""
    kind = told.blade_class if told else None
    family = family or (family_of(told.maker, kind, told.blades) if told else None)
    return (f'class = "{kind}"\n' if kind else "") + (f'family = "{family}"\n' if family else "")


def stations_text(
    file: str, diameter_m: float, blades: int, rpm: float | None = None, airspeed_m_s: float = 0.0,
    hub_ratio: float = 0.15, key: str = "stations", label: Designation | None = None, family: str | None = None,
    motor: tuple[float, int] | None = None, name: str = "", found: BladeStations | None = None,
) -> str:  # fmt: skip
    """Write the case of a blade whose chord and angle stand in a file beside it, with what its label says if known.

    The population of measured rotors weighs the pitch of the label against the angles of the stations. Of few stations
    the shape between them is a guess, as that of a label is: the chord is an unknown, too. A measured thickness is the
    section's, at eight radii at most.
    """
    few = found is not None and found.r_R.size < _FEW
    thick, at, left = "0.09", "", "" if found is None else "".join(f"# {note}\n" for note in found.left)
    section = section_of((label.blade_class if label else None) or class_of(family))
    if found is not None and found.t_c is not None:
        x = found.r_R if found.r_R.size <= 8 else np.linspace(found.r_R[0], found.r_R[-1], 8)
        thick = f"[{', '.join(f'{v:.4g}' for v in np.interp(x, found.r_R, found.t_c))}]  # measured"
        at = f"r_over_R = [{', '.join(f'{v:.4g}' for v in x)}]\n"
        section = tuple(u for u in section if u is not THICKNESS)
    pitch = f"label_pitch_in = {label.pitch_in:g}\n" if label else ""
    name = _label_name(label) if label else name or case_name(Path(file).stem)
    title = _title(label) if label else f"{blades} blades, {1e3 * diameter_m:.4g} mm"
    return f"""# A propeller with the stations of {file}. Each unknown is an assumption with a range.
{left}schema = "bemt.case/1"
name = "{name}"
title = "{title}, stations of {file}"

[rotor]
kind = "propeller"
blades = {blades}
diameter_mm = {1e3 * diameter_m:.6g}
hub_ratio = {hub_ratio:.4g}
{_sense(label) if label else ""}
[blade]
{key} = "{file}"
{pitch}{_series(label, family)}
[blade.section]
camber = {section[0].value:g}
thickness = {thick}
{at}{_tail(diameter_m, rpm, airspeed_m_s, motor, *([_between(diameter_m)] if few else []), *section, *SURFACE, AIR)}"""


def _between(diameter_m: float) -> Unknown:
    """Chord of a shape between few stations: as wide as that of a label."""
    chord, why = label_chord(diameter_m), f"fewer than {_FEW} stations: the shape between them is a guess"
    return Unknown("blade.chord_scale", 1.0, chord.low / chord.value, chord.high / chord.value, why)


def fan_text(
    diameter_m: float, pitch_in: float | None = None, blades: int | None = None, rpm: float | None = None,
    motor: tuple[float, int] | None = None,
) -> str:  # fmt: skip
    """Write the case of a ducted fan of which the diameter is known."""
    D, B = diameter_m / INCH, blades or 11
    P = pitch_in or 1.45 * D
    mm = 1e3 * diameter_m
    ranges = FAN_RANGES.format(
        blades=B, blades_low=max(B - 2, 2), blades_high=B + 2, pitch_low=0.85 * P, pitch_high=1.15 * P,
        gap_low=3e-3 * mm, gap_high=1e-2 * mm,
    )  # fmt: skip
    if blades:  # counted: no assumption
        ranges = "\n[[assumptions]]" + ranges.split("[[assumptions]]", 2)[2]
    drive, more = ("", ()) if motor is None else (drive_text(*motor), DRIVE)
    if motor is not None and rpm is None:
        rpm = full_rpm(*motor)
    told, why = _rpm(diameter_m, rpm, 180.0), "" if rpm else "gives a tip speed near 180 m/s; replace it with yours"
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
{_operating(told, 0.0, why)}{drive}{ranges}{_blocks(*FAN, *SURFACE, AIR, *more)}"""


_FEW = 5


def of_stations(file: Path, diameter_m: float) -> tuple[float, str, BladeStations]:
    """Hub ratio, key of [blade] of a file of stations (a table in any dialect, or one of UIUC or APC), and them."""
    from bemt.rotors.case.build import key_of, stations_in

    key = key_of(file)
    found = stations_in(file, 0.5 * diameter_m, key)
    return max(float(found.r_R.min()), 0.05), key, found


_OWN = "prop"
"""What names of new cases begin with; no word of a label."""
_MAKERS = {"t", "q", *FAMILIES, *(word.casefold() for name in FAMILIES.values() for word in name.split())} - {_OWN}
_LABEL = re.compile(r"\d\s*[xX\u00d7*]\s*\d")


def label_or_name(text: str | None, blades: int | None, file: Path) -> tuple[Designation | None, str]:
    """What the word beside a file of stations is: a label, such as ``10x5``, or the name of the case."""
    if text is not None:
        with suppress(GeometryError):
            parse_designation(text)
            return read_label(text, blades), ""
        if _LABEL.search(text):
            read_label(text)  # says what is wrong with it
    return None, case_name(text or file.stem)

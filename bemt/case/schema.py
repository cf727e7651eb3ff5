"""What a case file may hold: the typed models of ``bemt.case/1``, units in the key names, ranges, suspicious values.

A length that may be written in several units is one property in metres (``rotor.diameter_m``); whichever key the file
uses, exactly one of :data:`GROUPS` is given.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bemt.air import LIQUID
from bemt.asbuilt.latents import KNOWN_FROM
from bemt.base.toml import Key, Table, entry
from bemt.sections.rule import DRAG_LEVEL, N_CRIT
from geometry.laws import CHORD_LAWS as GEOMETRY_CHORD_LAWS

__all__ = [
    "AIRSPEED",
    "AXES",
    "GROUPS",
    "INCH",
    "RPM",
    "TEMPERATURE",
    "AirTable",
    "AsBuiltTable",
    "AssumptionTable",
    "BladeTable",
    "CaseFile",
    "DuctTable",
    "ModelTable",
    "OperatingTable",
    "PolarTable",
    "RotorTable",
    "SectionTable",
    "StatorTable",
    "SweepTable",
]

SCHEMA_NAME = "bemt.case/1"
CHORD_LAWS = tuple(GEOMETRY_CHORD_LAWS)
INCH = 0.0254
Suspect = Callable[[float], str]


def _looks(*rules: tuple[float, float, str, Callable[[float], float], str]) -> Suspect:
    """Build a hint maker from (low, high, unit that it looks like, conversion, key) rules."""

    def suspect(value: float) -> str:
        for low, high, unit, convert, key in rules:
            if low <= value <= high:
                return f"Looks like {unit}: write {key} = {convert(value):.6g}"
        return ""

    return suspect


def _inch(key: str, limit: float) -> Suspect:
    return _looks((limit, 1e5, "millimetres", lambda v: v / 25.4, key))


def _metres(key: str, limit: float) -> Suspect:
    return _looks((1e-9, limit, "metres", lambda v: v * 1e3, key))


def _percent(key: str, low: float = 1.0) -> Suspect:
    return _looks((low, 1000.0, "percent", lambda v: v / 100.0, key))


RPM = Key(unit="rev/min", low=10, high=300_000, required=True,
           suspect=_looks((1e-9, 9.999, "rev/s", lambda v: v * 60, "rpm")))  # fmt: skip
AIRSPEED = Key(unit="m/s", low=-100, high=300, suspect=_looks((300.1, 1100, "km/h", lambda v: v / 3.6, "airspeed_m_s")))
_DENSITY = Key(unit="kg/m3", low=0.01, high=LIQUID[1], suspect=_looks(
    (1100.01, 1500, "g/m3", lambda v: v / 1000, "density_kg_m3"),
    (0.0755, 0.0775, "lb/ft3", lambda v: v * 16.018463, "density_kg_m3"),
    (0.00235, 0.0024, "slug/ft3", lambda v: v * 515.37882, "density_kg_m3")))  # fmt: skip
_ALTITUDE = Key(unit="m", low=-500, high=20_000,
                suspect=_looks((20_000.1, 70_000, "feet", lambda v: v * 0.3048, "altitude_m")))  # fmt: skip
TEMPERATURE = Key(unit="C", low=-60, high=60, suspect=_looks(
    (180, 340, "kelvin", lambda v: v - 273.15, "temperature_C"),
    (60.1, 140, "degrees Fahrenheit", lambda v: (v - 32) / 1.8, "temperature_C")))  # fmt: skip
_PITCH_IN = Key(unit="in", low=0.1, high=120, suspect=_inch("pitch_in", 120.1))
_DIAMETER_IN = Key(unit="in", low=0.5, high=200, suspect=_inch("diameter_in", 200.1))
_GAP = Key(unit="mm", low=0, high=50, suspect=_metres("tip_gap_mm", 0.005))

_PRESSURE = Key(unit="hPa", low=50, high=1200, suspect=_looks(
    (5000, 120_000, "pascals", lambda v: v / 100, "pressure_hPa"),
    (0.5, 1.2, "bar", lambda v: v * 1000, "pressure_hPa"),
    (25, 32, "inches of mercury", lambda v: v * 33.86389, "pressure_hPa")))  # fmt: skip
_FRACTION_OF_HUMIDITY = _looks((1e-9, 0.999, "a fraction", lambda v: v * 100, "humidity_pct"))

KnownFrom = Literal["cad", "scan", "stations", "label", "reference"]
Rotations = Literal["right", "left"]
Numbers = float | tuple[float, ...] | None
Texts = str | tuple[str, ...] | None


def _metres_of(inch: float | None, millimetre: float | None, metre: float | None = None) -> float:
    """Length in metres of whichever unit is given, else NaN."""
    for value, factor in ((inch, INCH), (millimetre, 1e-3), (metre, 1.0)):
        if value is not None:
            return value * factor
    return math.nan


class RotorTable(Table):
    """[rotor]: what turns."""

    kind: Literal["propeller", "fan"] = entry("choice", choices=("propeller", "fan"), required=True)
    blades: int = entry("integer", low=1, high=64, required=True)
    diameter_in: float | None = entry(key=_DIAMETER_IN)
    diameter_mm: float | None = entry(unit="mm", low=10, high=6000, suspect=_metres("diameter_mm", 6.0))
    diameter_m_: float | None = entry(unit="m", low=0.01, high=6, alias="diameter_m")
    hub_ratio: float | None = entry(low=0.01, high=0.95, suspect=_percent("hub_ratio"))
    hub_diameter_mm: float | None = entry(unit="mm", low=0.5, high=3000, suspect=_metres("hub_diameter_mm", 0.499))
    hub_diameter_in: float | None = entry(unit="in", low=0.02, high=120)
    rotation: Rotations = entry("choice", choices=("right", "left"), default="right")

    @property
    def diameter_m(self) -> float:
        """Tip diameter. [m]"""
        return _metres_of(self.diameter_in, self.diameter_mm, self.diameter_m_)

    @property
    def hub_diameter_m(self) -> float:
        """Hub diameter. [m]"""
        if self.hub_ratio is not None:
            return self.hub_ratio * self.diameter_m
        return _metres_of(self.hub_diameter_in, self.hub_diameter_mm)


class SectionTable(Table):
    """[blade.section]: one section, or one per r_over_R."""

    naca: Texts = entry("text_or_texts")
    dat: Texts = entry("text_or_texts")
    camber: float | tuple[float, ...] = entry(
        "scalar_or_list", "of the chord", -0.2, 0.2, suspect=_percent("camber", 0.9), default=0.0
    )
    camber_position: float | tuple[float, ...] = entry(
        "scalar_or_list", "of the chord", 0.1, 0.8, suspect=_percent("camber_position"), default=0.4
    )
    thickness: Numbers = entry("scalar_or_list", "of the chord", 0.01, 0.5, suspect=_percent("thickness", 1.5))
    camber_scale: float = entry(low=0, high=5, default=1.0)
    thickness_scale: float = entry(low=0.1, high=5, default=1.0)
    r_over_R: tuple[float, ...] | None = entry("numbers", low=0, high=1, suspect=_percent("r_over_R", 2.0))


class AsBuiltTable(Table):
    """[blade.as_built]: what is known of this very rotor beyond its drawing, expectations and standard deviations."""

    angle_deg: float | None = entry(unit="deg", low=-20, high=20)
    angle_sd_deg: float | None = entry(unit="deg", low=0, high=20)
    camber_deg: float | None = entry(unit="deg", low=-20, high=20)
    camber_sd_deg: float | None = entry(unit="deg", low=0, high=20)
    lift: float | None = entry(low=-1, high=1)
    lift_sd: float | None = entry(low=0, high=1, suspect=_percent("lift_sd"))
    drag: float | None = entry(low=-2, high=2)
    drag_sd: float | None = entry(low=0, high=2, suspect=_percent("drag_sd", 2.0))
    file: str | None = entry("file")


class BladeTable(Table):
    """[blade]: pitch and chord by a law, or stations from a file; how well it is known."""

    pitch_in: float | None = entry(key=_PITCH_IN)
    pitch_mm: float | None = entry(unit="mm", low=2.5, high=3000, suspect=_metres("pitch_mm", 2.0))
    pitch_ratio: float | None = entry(low=0.01, high=10)
    pitch_law: Literal["helix", "tip_relieved"] = entry("choice", choices=("helix", "tip_relieved"), default="helix")
    tip_relief: float | None = entry(low=0, high=0.6, suspect=_percent("tip_relief"))
    chord_law: str | None = entry("choice", choices=CHORD_LAWS)
    max_chord_over_R: float | None = entry(
        unit="of the tip radius", low=0.005, high=2, suspect=_percent("max_chord_over_R", 3.0)
    )
    taper: float | None = entry(low=0.05, high=3)
    chord_scale: float = entry(low=0.1, high=10, suspect=_percent("chord_scale", 20.0), default=1.0)
    stations: str | None = entry("file")
    uiuc: str | None = entry("file")
    apc: str | None = entry("file")
    beta_offset_deg: float = entry(unit="deg", low=-45, high=45, default=0.0)
    known_from: KnownFrom | None = entry("choice", choices=KNOWN_FROM)
    label_pitch_in: float | None = entry(unit="in", low=0.1, high=120, suspect=_inch("label_pitch_in", 120.1))
    family: str | None = entry("text")
    as_built: AsBuiltTable | None = None
    section: SectionTable | None = None

    def pitch_m(self, diameter_m: float) -> float:
        """Advance per turn that the case states, NaN where it states none. [m]"""
        if self.pitch_ratio is not None:
            return self.pitch_ratio * diameter_m
        return _metres_of(self.pitch_in, self.pitch_mm)


class StatorTable(Table):
    """[duct.stator]: vanes behind the rotor."""

    blades: int = entry("integer", low=1, high=64, required=True)
    chord_mm: float = entry(unit="mm", low=1, high=1000, required=True, suspect=_metres("chord_mm", 0.999))
    recovery: float | None = entry(low=0, high=1, suspect=_percent("recovery", 1.5))


class DuctTable(Table):
    """[duct]: the wall around the rotor."""

    inner_diameter_mm: float | None = entry(unit="mm", low=10, high=6000, suspect=_metres("inner_diameter_mm", 6.0))
    inner_diameter_in: float | None = entry(unit="in", low=0.5, high=240)
    tip_gap_mm: float | None = entry(key=_GAP)
    length_mm: float = entry(unit="mm", low=1, high=10_000, required=True, suspect=_metres("length_mm", 0.999))
    lip_radius_mm: float = entry(unit="mm", low=0, high=1000, default=0.0)
    lip_loss: float | None = entry(low=0, high=1, suspect=_percent("lip_loss", 1.5))
    rotor_position_mm: float | None = entry(unit="mm", low=-1000, high=10_000)
    exit_area_ratio: float | None = entry(low=0.3, high=3, suspect=_percent("exit_area_ratio", 20.0))
    exit_diameter_mm: float | None = entry(unit="mm", low=5, high=6000, suspect=_metres("exit_diameter_mm", 4.9))
    exit_hub_diameter_mm: float = entry(unit="mm", low=0, high=6000, default=0.0)
    stator: StatorTable | None = None

    @property
    def inner_diameter_m(self) -> float:
        """Bore, NaN where the gap is given. [m]"""
        return _metres_of(self.inner_diameter_in, self.inner_diameter_mm)


class OperatingTable(Table):
    """[operating]: the case's own point."""

    rpm: float = entry(key=RPM)
    airspeed_m_s: float = entry(key=AIRSPEED, default=0.0)


class AirTable(Table):
    """[air]: density, or altitude, or pressure with temperature and humidity; or water."""

    density_kg_m3: float | None = entry(key=_DENSITY)
    altitude_m: float | None = entry(key=_ALTITUDE)
    pressure_hPa: float | None = entry(key=_PRESSURE)
    temperature_C: float | None = entry(key=TEMPERATURE)
    humidity_pct: float | None = entry(unit="%", low=0, high=100, suspect=_FRACTION_OF_HUMIDITY)
    fluid: Literal["water"] | None = entry("choice", choices=("water",))
    salinity_g_kg: float | None = entry(unit="g/kg", low=0, high=45)


class ModelTable(Table):
    """[model]: physics that is on, section tables, blade elements."""

    effects_on: tuple[str, ...] = entry("texts", default=())
    effects_off: tuple[str, ...] = entry("texts", default=())
    also_without: tuple[str, ...] = entry("texts", default=())
    n_crit: float = entry(low=0.1, high=14, default=N_CRIT)
    drag_level: float = entry(low=0.3, high=3, suspect=_percent("drag_level", 20.0), default=DRAG_LEVEL)
    stations: int = entry("integer", low=5, high=1000, default=40)


Axis = tuple[float, ...] | dict[str, float] | None


def _axis(key: Key) -> Any:
    return entry("axis", unit=key.unit, low=key.low, high=key.high, suspect=key.suspect)


class SweepTable(Table):
    """[sweep]: axes of a parameter grid, lists or {start, stop, num}."""

    rpm: Axis = _axis(RPM)
    airspeed_m_s: Axis = _axis(AIRSPEED)
    altitude_m: Axis = _axis(_ALTITUDE)
    density_kg_m3: Axis = _axis(_DENSITY)
    temperature_C: Axis = _axis(TEMPERATURE)
    pitch_in: Axis = _axis(_PITCH_IN)
    diameter_in: Axis = _axis(_DIAMETER_IN)
    tip_gap_mm: Axis = _axis(_GAP)

    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Axes in the order of the file: name (with its unit) to values, (N,)."""
        out: dict[str, NDArray[np.float64]] = {}
        for name, axis in self.model_dump(exclude_unset=True).items():
            if isinstance(axis, dict):
                out[name] = np.linspace(axis["start"], axis["stop"], int(axis["num"]))
            elif axis is not None:
                out[name] = np.array(axis, dtype=float)
        return out


class AssumptionTable(Table):
    """[[assumptions]]: a value that the source does not give, with its range."""

    key: str = entry("text", required=True)
    low: float | None = entry()
    high: float | None = entry()
    values: tuple[Any, ...] | None = entry("list")
    why: str = entry("text", required=True)


class PolarTable(Table):
    """[[polars]]: a section table of the user's own."""

    file: str = entry("file", required=True)
    r_over_R: float = entry(low=0, high=1, required=True, suspect=_percent("r_over_R", 2.0))
    format: Literal["csv", "xfoil", "c81", "aerodyn"] | None = entry(
        "choice", choices=("csv", "xfoil", "c81", "aerodyn")
    )


class CaseFile(Table):
    """A whole case file."""

    schema_: Literal["bemt.case/1"] = entry("choice", choices=(SCHEMA_NAME,), required=True, alias="schema")
    name: str = entry("text", required=True)
    title: str = entry("text", default="")
    notes: str = entry("text", default="")
    origin: str = entry("text", default="")
    references: str | None = entry("file")
    rotor: RotorTable
    blade: BladeTable
    duct: DuctTable | None = None
    operating: OperatingTable
    air: AirTable
    model: ModelTable = ModelTable()
    sweep: SweepTable = SweepTable()
    assumptions: tuple[AssumptionTable, ...] = ()
    polars: tuple[PolarTable, ...] = ()


AXES = {
    "rpm": "operating.rpm",
    "airspeed_m_s": "operating.airspeed_m_s",
    "altitude_m": "air.altitude_m",
    "density_kg_m3": "air.density_kg_m3",
    "temperature_C": "air.temperature_C",
    "pitch_in": "blade.pitch_in",
    "diameter_in": "rotor.diameter_in",
    "tip_gap_mm": "duct.tip_gap_mm",
}
"""Sweep axis to the dotted key that it changes."""

GROUPS: tuple[tuple[str, tuple[str, ...], bool], ...] = (
    ("rotor", ("diameter_in", "diameter_mm", "diameter_m"), True),
    ("rotor", ("hub_ratio", "hub_diameter_mm", "hub_diameter_in"), True),
    ("blade", ("chord_law", "stations", "uiuc", "apc"), True),
    ("blade", ("pitch_in", "pitch_mm", "pitch_ratio"), False),
    ("blade.section", ("naca", "dat", "thickness"), True),
    ("duct", ("tip_gap_mm", "inner_diameter_mm", "inner_diameter_in"), True),
    ("duct", ("exit_area_ratio", "exit_diameter_mm"), True),
    ("air", ("density_kg_m3", "altitude_m", "pressure_hPa", "fluid"), True),
)
"""(table, keys, required): at most one of the keys may be given, exactly one when required."""

"""What a case file may hold: the schema ``bemt.case/1``, units in the key names, ranges and suspicious values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bemt.base.toml import Key
from bemt.sections.rule import DRAG_LEVEL, N_CRIT
from geometry.laws import CHORD_LAWS as GEOMETRY_CHORD_LAWS

__all__ = ["ASSUMPTION", "AXES", "DEFAULTS", "GROUPS", "INCH", "POLAR", "SCHEMA", "TEMPERATURE"]

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
_DENSITY = Key(unit="kg/m3", low=0.01, high=10, suspect=_looks(
    (800, 1500, "g/m3", lambda v: v / 1000, "density_kg_m3"),
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

SCHEMA: dict[str, dict[str, Key]] = {
    "": {
        "schema": Key("choice", required=True, choices=(SCHEMA_NAME,)),
        "name": Key("text", required=True),
        "title": Key("text"),
        "notes": Key("text"),
        "references": Key("file"),
    },
    "rotor": {
        "kind": Key("choice", required=True, choices=("propeller", "fan")),
        "blades": Key("integer", low=1, high=64, required=True),
        "diameter_in": _DIAMETER_IN,
        "diameter_mm": Key(unit="mm", low=10, high=6000, suspect=_metres("diameter_mm", 6.0)),
        "diameter_m": Key(unit="m", low=0.01, high=6),
        "hub_ratio": Key(low=0.01, high=0.95, suspect=_percent("hub_ratio")),
        "hub_diameter_mm": Key(unit="mm", low=0.5, high=3000, suspect=_metres("hub_diameter_mm", 0.499)),
        "hub_diameter_in": Key(unit="in", low=0.02, high=120),
        "rotation": Key("choice", choices=("right", "left")),
    },
    "blade": {
        "pitch_in": _PITCH_IN,
        "pitch_mm": Key(unit="mm", low=2.5, high=3000, suspect=_metres("pitch_mm", 2.0)),
        "pitch_ratio": Key(low=0.01, high=10),
        "pitch_law": Key("choice", choices=("helix", "tip_relieved")),
        "tip_relief": Key(low=0, high=0.6, suspect=_percent("tip_relief")),
        "chord_law": Key("choice", choices=CHORD_LAWS),
        "max_chord_over_R": Key(unit="of the tip radius", low=0.005, high=2, suspect=_percent("max_chord_over_R", 3.0)),
        "taper": Key(low=0.05, high=3),
        "chord_scale": Key(low=0.1, high=10, suspect=_percent("chord_scale", 20.0)),
        "stations": Key("file"),
        "uiuc": Key("file"),
        "apc": Key("file"),
        "beta_offset_deg": Key(unit="deg", low=-45, high=45),
    },
    "blade.section": {
        "naca": Key("text_or_texts"),
        "dat": Key("text_or_texts"),
        "camber": Key("scalar_or_list", unit="of the chord", low=-0.2, high=0.2, suspect=_percent("camber", 0.9)),
        "camber_position": Key("scalar_or_list", unit="of the chord", low=0.1, high=0.8,
                               suspect=_percent("camber_position")),
        "thickness": Key("scalar_or_list", unit="of the chord", low=0.01, high=0.5,
                         suspect=_percent("thickness", 1.5)),
        "camber_scale": Key(low=0, high=5),
        "thickness_scale": Key(low=0.1, high=5),
        "r_over_R": Key("numbers", low=0, high=1, suspect=_percent("r_over_R", 2.0)),
    },
    "duct": {
        "inner_diameter_mm": Key(unit="mm", low=10, high=6000, suspect=_metres("inner_diameter_mm", 6.0)),
        "inner_diameter_in": Key(unit="in", low=0.5, high=240),
        "tip_gap_mm": _GAP,
        "length_mm": Key(unit="mm", low=1, high=10_000, required=True, suspect=_metres("length_mm", 0.999)),
        "lip_radius_mm": Key(unit="mm", low=0, high=1000),
        "rotor_position_mm": Key(unit="mm", low=-1000, high=10_000),
        "exit_area_ratio": Key(low=0.3, high=3, suspect=_percent("exit_area_ratio", 20.0)),
        "exit_diameter_mm": Key(unit="mm", low=5, high=6000, suspect=_metres("exit_diameter_mm", 4.9)),
        "exit_hub_diameter_mm": Key(unit="mm", low=0, high=6000),
    },
    "duct.stator": {
        "blades": Key("integer", low=1, high=64, required=True),
        "chord_mm": Key(unit="mm", low=1, high=1000, required=True, suspect=_metres("chord_mm", 0.999)),
        "recovery": Key(low=0, high=1, suspect=_percent("recovery", 1.5)),
    },
    "operating": {"rpm": RPM, "airspeed_m_s": AIRSPEED},
    "air": {
        "density_kg_m3": _DENSITY,
        "altitude_m": _ALTITUDE,
        "pressure_hPa": Key(unit="hPa", low=50, high=1200, suspect=_looks(
            (5000, 120_000, "pascals", lambda v: v / 100, "pressure_hPa"),
            (0.5, 1.2, "bar", lambda v: v * 1000, "pressure_hPa"),
            (25, 32, "inches of mercury", lambda v: v * 33.86389, "pressure_hPa"))),
        "temperature_C": TEMPERATURE,
        "humidity_pct": Key(unit="%", low=0, high=100,
                            suspect=_looks((1e-9, 0.999, "a fraction", lambda v: v * 100, "humidity_pct"))),
    },
    "model": {
        "effects_on": Key("texts"),
        "effects_off": Key("texts"),
        "also_without": Key("texts"),
        "n_crit": Key(low=0.1, high=14),
        "drag_level": Key(low=0.3, high=3, suspect=_percent("drag_level", 20.0)),
        "stations": Key("integer", low=5, high=1000),
    },
    "sweep": {
        "rpm": Key("axis", unit="rev/min", low=RPM.low, high=RPM.high, suspect=RPM.suspect),
        "airspeed_m_s": Key("axis", unit="m/s", low=AIRSPEED.low, high=AIRSPEED.high, suspect=AIRSPEED.suspect),
        "altitude_m": Key("axis", unit="m", low=-500, high=20_000, suspect=_ALTITUDE.suspect),
        "density_kg_m3": Key("axis", unit="kg/m3", low=0.01, high=10, suspect=_DENSITY.suspect),
        "temperature_C": Key("axis", unit="C", low=-60, high=60, suspect=TEMPERATURE.suspect),
        "pitch_in": Key("axis", unit="in", low=0.1, high=120, suspect=_PITCH_IN.suspect),
        "diameter_in": Key("axis", unit="in", low=0.5, high=200, suspect=_DIAMETER_IN.suspect),
        "tip_gap_mm": Key("axis", unit="mm", low=0, high=50, suspect=_GAP.suspect),
    },
}  # fmt: skip

ASSUMPTION = {
    "key": Key("text", required=True),
    "low": Key(),
    "high": Key(),
    "values": Key("list"),
    "why": Key("text", required=True),
}
POLAR = {
    "file": Key("file", required=True),
    "r_over_R": Key(low=0, high=1, required=True, suspect=_percent("r_over_R", 2.0)),
    "format": Key("choice", choices=("csv", "xfoil", "c81", "aerodyn")),
}

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
    ("air", ("density_kg_m3", "altitude_m", "pressure_hPa"), True),
)
"""(table, keys, required): at most one of the keys may be given, exactly one when required."""

DEFAULTS: dict[str, dict[str, Any]] = {
    "": {"title": "", "notes": ""},
    "rotor": {"rotation": "right"},
    "blade": {"beta_offset_deg": 0.0, "chord_scale": 1.0, "pitch_law": "helix"},
    "blade.section": {"camber": 0.0, "camber_position": 0.4, "camber_scale": 1.0, "thickness_scale": 1.0},
    "operating": {"airspeed_m_s": 0.0},
    "model": {
        "effects_on": [],
        "effects_off": [],
        "also_without": [],
        "n_crit": N_CRIT,
        "drag_level": DRAG_LEVEL,
        "stations": 40,
    },
}

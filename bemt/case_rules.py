"""What a case file may hold: the schema ``bemt.case/1`` and the rules that join several keys."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bemt.schema import Collector, Key, check_table, check_value, shown
from geometry.blade import CHORD_LAWS as GEOMETRY_CHORD_LAWS

__all__ = ["ASSUMPTION", "AXES", "DEFAULTS", "GROUPS", "POLAR", "SCHEMA", "check_case"]

SCHEMA_NAME = "bemt.case/1"
CHORD_LAWS = tuple(GEOMETRY_CHORD_LAWS)
INCH = 0.0254
A_SOUND = 340.3  # only to refuse impossible tip speeds
MAX_TIP_MACH = 2.0
MAX_GRID = 50_000_000
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


_RPM = Key(unit="rev/min", low=10, high=300_000, required=True,
           suspect=_looks((1e-9, 9.999, "rev/s", lambda v: v * 60, "rpm")))  # fmt: skip
_AIRSPEED = Key(unit="m/s", low=-100, high=300, suspect=_looks((300.1, 1100, "km/h", lambda v: v / 3.6, "airspeed_m_s")))
_DENSITY = Key(unit="kg/m3", low=0.01, high=10, suspect=_looks(
    (800, 1500, "g/m3", lambda v: v / 1000, "density_kg_m3"),
    (0.0755, 0.0775, "lb/ft3", lambda v: v * 16.018463, "density_kg_m3"),
    (0.00235, 0.0024, "slug/ft3", lambda v: v * 515.37882, "density_kg_m3")))  # fmt: skip
_ALTITUDE = Key(unit="m", low=-500, high=20_000,
                suspect=_looks((20_000.1, 70_000, "feet", lambda v: v * 0.3048, "altitude_m")))  # fmt: skip
_TEMPERATURE = Key(unit="C", low=-60, high=60, suspect=_looks(
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
    "operating": {"rpm": _RPM, "airspeed_m_s": _AIRSPEED},
    "air": {
        "density_kg_m3": _DENSITY,
        "altitude_m": _ALTITUDE,
        "pressure_hPa": Key(unit="hPa", low=50, high=1200, suspect=_looks(
            (5000, 120_000, "pascals", lambda v: v / 100, "pressure_hPa"),
            (0.5, 1.2, "bar", lambda v: v * 1000, "pressure_hPa"),
            (25, 32, "inches of mercury", lambda v: v * 33.86389, "pressure_hPa"))),
        "temperature_C": _TEMPERATURE,
        "humidity_pct": Key(unit="%", low=0, high=100,
                            suspect=_looks((1e-9, 0.999, "a fraction", lambda v: v * 100, "humidity_pct"))),
    },
    "model": {
        "effects_on": Key("texts"),
        "effects_off": Key("texts"),
        "n_crit": Key(low=0.1, high=14),
        "stations": Key("integer", low=5, high=1000),
    },
    "sweep": {
        "rpm": Key("axis", unit="rev/min", low=10, high=300_000, suspect=_RPM.suspect),
        "airspeed_m_s": Key("axis", unit="m/s", low=-100, high=300, suspect=_AIRSPEED.suspect),
        "altitude_m": Key("axis", unit="m", low=-500, high=20_000, suspect=_ALTITUDE.suspect),
        "density_kg_m3": Key("axis", unit="kg/m3", low=0.01, high=10, suspect=_DENSITY.suspect),
        "temperature_C": Key("axis", unit="C", low=-60, high=60, suspect=_TEMPERATURE.suspect),
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
    "model": {"effects_on": [], "effects_off": [], "n_crit": 9.0, "stations": 40},
}

_TABLES = ("rotor", "blade", "duct", "operating", "air", "model", "sweep")
_OPTIONAL = ("duct", "model", "sweep")
_ARRAYS = ("assumptions", "polars")


def check_case(out: Collector, document: Mapping[str, Any], folder: Path) -> None:
    """Check a whole case document; add every fault to the collector.

    Parameters
    ----------
    out : Collector
        Receives the faults.
    document : mapping
        The document as tomllib returned it.
    folder : Path
        Folder of the case file; named files are looked for there.

    Examples
    --------
    >>> out = Collector("case.toml")
    >>> check_case(out, {"schema": "bemt.case/1", "name": "x", "rotr": {}}, Path("."))
    >>> print(out.faults[0])  # doctest: +ELLIPSIS
    case.toml: rotr: got an unknown key; expected one of schema, ... Did you mean rotor?
    """
    check_table(out, "", document, SCHEMA, subtables=(*_TABLES, *_ARRAYS))
    for name in _TABLES:
        if name in document:
            inner = {"blade": ("section",), "duct": ("stator",)}.get(name, ())
            check_table(out, name, document[name], SCHEMA, subtables=inner)
            for sub in inner:
                if isinstance(document[name], Mapping) and sub in document[name]:
                    check_table(out, f"{name}.{sub}", document[name][sub], SCHEMA)
        elif name not in _OPTIONAL:
            out.add(name, "nothing", f"a table [{name}]")
    for name, schema in (("assumptions", ASSUMPTION), ("polars", POLAR)):
        items = document.get(name, [])
        if not isinstance(items, list):
            out.add(name, shown(items), f"tables [[{name}]]", f"Write [[{name}]] with two brackets")
            continue
        for i, item in enumerate(items):
            check_table(out, name, item, {name: schema}, where=f"{name}[{i}]", homes={})
    _check_groups(out, document)
    _check_files(out, document, folder)
    if not out.faults:  # the rules below need sound values
        for rule in (_check_rotor, _check_blade, _check_duct, _check_air, _check_sweep, _check_assumptions):
            rule(out, document)


def _table(document: Mapping[str, Any], name: str) -> Mapping[str, Any] | None:
    value: Any = document
    for part in name.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value if isinstance(value, Mapping) else None


def _check_groups(out: Collector, document: Mapping[str, Any]) -> None:
    for name, keys, required in GROUPS:
        table = _table(document, name)
        if table is None:
            continue
        given = [key for key in keys if key in table]
        if len(given) > 1:
            out.add(name, " and ".join(given), f"only one of {', '.join(keys)}", f"Drop all but {given[0]}")
        elif required and not given:
            out.add(name, f"none of {', '.join(keys)}", "exactly one of them")


def _check_files(out: Collector, document: Mapping[str, Any], folder: Path) -> None:
    places = [("references", document.get("references"))]
    for name in ("blade.stations", "blade.uiuc", "blade.apc", "blade.section.dat"):
        table, key = name.rsplit(".", 1)
        value = (_table(document, table) or {}).get(key)
        places += [(name, v) for v in (value if isinstance(value, list) else [value])]
    polars = document.get("polars", [])
    if isinstance(polars, list):
        places += [(f"polars[{i}].file", p.get("file")) for i, p in enumerate(polars) if isinstance(p, Mapping)]
    for where, value in places:
        if isinstance(value, str) and value.strip() and not (folder / value).is_file():
            out.add(where, f"{value!r}, which does not exist", "the name of a file beside the case", "Check the name")


def _length_m(table: Mapping[str, Any], stem: str) -> float:
    for suffix, factor in (("_in", INCH), ("_mm", 1e-3), ("_m", 1.0)):
        if stem + suffix in table:
            return float(table[stem + suffix]) * factor
    return math.nan


def _check_rotor(out: Collector, document: Mapping[str, Any]) -> None:
    rotor = document["rotor"]
    diameter = _length_m(rotor, "diameter")
    hub = _length_m(rotor, "hub_diameter")
    if hub >= diameter:
        key = "hub_diameter_mm" if "hub_diameter_mm" in rotor else "hub_diameter_in"
        out.add(f"rotor.{key}", shown(rotor[key]), f"less than the diameter, {diameter * 1e3:.6g} mm")
    mach = math.pi * diameter * document["operating"]["rpm"] / 60 / A_SOUND
    if mach > MAX_TIP_MACH:
        got = f"{shown(document['operating']['rpm'])} with a diameter of {diameter:.4g} m, a tip Mach number of {mach:.3g}"
        out.add("operating.rpm", got, f"a tip Mach number of {MAX_TIP_MACH:g} or less", "Are both units right?")
    if rotor["kind"] == "fan" and "duct" not in document:
        out.add("duct", "nothing", "a table [duct], because rotor.kind is fan", "A fan without a duct is a propeller")


def _check_blade(out: Collector, document: Mapping[str, Any]) -> None:
    blade = document["blade"]
    diameter = _length_m(document["rotor"], "diameter")
    pitches = [key for key in ("pitch_in", "pitch_mm", "pitch_ratio") if key in blade]
    if "chord_law" in blade:
        if not pitches:
            out.add("blade", "chord_law without a pitch", "one of pitch_in, pitch_mm, pitch_ratio")
        if "taper" in blade and blade["chord_law"] != "linear_taper":
            out.add("blade.taper", shown(blade["taper"]), "nothing, because chord_law is not linear_taper")
        if "tip_relief" in blade and blade.get("pitch_law") != "tip_relieved":
            out.add("blade.tip_relief", shown(blade["tip_relief"]), "nothing, because pitch_law is not tip_relieved")
    else:
        source = next(key for key in ("stations", "uiuc", "apc") if key in blade)
        for key in (*pitches, "max_chord_over_R", "taper", "pitch_law", "tip_relief"):
            if key in blade:
                hint = "Use beta_offset_deg to turn the blade" if key in pitches else ""
                out.add(f"blade.{key}", shown(blade[key]), f"nothing beside {source}, which gives it", hint)
    if "section" not in blade:
        out.add("blade.section", "nothing", "a table [blade.section]", "Tables [[polars]] replace only its aerodynamics")
    pitch = _length_m(blade, "pitch")
    if not math.isnan(pitch) and not 0.05 <= pitch / diameter <= 5:
        key = pitches[0]
        metric = blade[key] / 25.4
        hint = ""
        if key == "pitch_in" and 0.1 <= metric * INCH / diameter <= 3:
            hint = f"Looks like millimetres: write pitch_mm = {blade[key]:g} or pitch_in = {metric:.4g}"
        out.add(f"blade.{key}", shown(blade[key]), "a pitch of 0.05 to 5 diameters", hint)
    _check_section(out, blade.get("section", {}))


def _check_section(out: Collector, section: Mapping[str, Any]) -> None:
    lists = {k: len(v) for k, v in section.items() if isinstance(v, list) and k != "r_over_R"}
    radii = section.get("r_over_R", [])
    for key, count in lists.items():
        if count != len(radii):
            out.add(f"blade.section.{key}", f"a list of {count}", f"as many values as r_over_R has, {len(radii)}")
    if any(b <= a for a, b in zip(radii, radii[1:], strict=False)):
        out.add("blade.section.r_over_R", "radii that do not ascend", "ascending radii")
    if radii and not lists:
        out.add("blade.section.r_over_R", f"a list of {len(radii)}", "nothing, because the section is the same everywhere")
    for key in ("camber", "camber_position"):
        if key in section and "thickness" not in section:
            out.add(f"blade.section.{key}", shown(section[key]), "nothing without thickness")


def _check_duct(out: Collector, document: Mapping[str, Any]) -> None:
    duct = document.get("duct")
    if duct is None:
        return
    inner, diameter = _length_m(duct, "inner_diameter"), _length_m(document["rotor"], "diameter")
    if inner < diameter:
        key = "inner_diameter_mm" if "inner_diameter_mm" in duct else "inner_diameter_in"
        out.add(f"duct.{key}", shown(duct[key]), f"at least the rotor diameter, {diameter * 1e3:.6g} mm")
    if duct.get("tip_gap_mm", 0) > 0.1 * diameter / 2 * 1e3:
        out.add("duct.tip_gap_mm", shown(duct["tip_gap_mm"]), f"at most a tenth of the radius, {diameter * 50:.4g} mm")
    if duct.get("rotor_position_mm", 0) > duct["length_mm"]:
        out.add("duct.rotor_position_mm", shown(duct["rotor_position_mm"]), f"at most length_mm, {duct['length_mm']:g}")


def _check_air(out: Collector, document: Mapping[str, Any]) -> None:
    air = document["air"]
    if "pressure_hPa" in air and "temperature_C" not in air:
        out.add("air.temperature_C", "nothing", f"{_TEMPERATURE.expected}, because pressure_hPa is given")
    if "humidity_pct" in air and "pressure_hPa" not in air:
        out.add("air.humidity_pct", shown(air["humidity_pct"]), "nothing without pressure_hPa")


def _check_sweep(out: Collector, document: Mapping[str, Any]) -> None:
    sweep = document.get("sweep", {})
    air = document["air"]
    if "density_kg_m3" in sweep and ("altitude_m" in sweep or "temperature_C" in sweep):
        other = "altitude_m" if "altitude_m" in sweep else "temperature_C"
        out.add("sweep.density_kg_m3", f"an axis beside {other}", f"density_kg_m3 or {other}, not both")
    if "temperature_C" in sweep and "density_kg_m3" in air and "altitude_m" not in sweep:
        out.add("sweep.temperature_C", "an axis with air.density_kg_m3", "air.altitude_m or air.pressure_hPa",
                "Temperature changes nothing when the density is fixed")  # fmt: skip
    if "pitch_in" in sweep and "chord_law" not in document["blade"]:
        out.add("sweep.pitch_in", "an axis", "nothing, because the blade comes from stations")
    if "tip_gap_mm" in sweep and "duct" not in document:
        out.add("sweep.tip_gap_mm", "an axis", "nothing, because there is no duct")
    points = 1
    for axis in sweep.values():
        points *= int(axis["num"]) if isinstance(axis, Mapping) else len(axis)
    if points > MAX_GRID:
        out.add("sweep", f"a grid of {points} points", f"{MAX_GRID} points or fewer", "Take fewer values")


def _check_assumptions(out: Collector, document: Mapping[str, Any]) -> None:
    seen: set[str] = set()
    for i, item in enumerate(document.get("assumptions", [])):
        where, key = f"assumptions[{i}]", item["key"]
        table, _, name = key.rpartition(".")
        values = _table(document, table) if table else None
        if values is None or name not in values or name not in SCHEMA.get(table, {}):
            out.add(f"{where}.key", repr(key), "the dotted key of a value in this file")
            continue
        if key in seen:
            out.add(f"{where}.key", f"{key!r} again", "each key once")
        seen.add(key)
        _check_assumption(out, where, item, values[name], SCHEMA[table][name])


def _check_assumption(out: Collector, where: str, item: Mapping[str, Any], nominal: Any, key: Key) -> None:
    if "values" in item:
        if "low" in item or "high" in item:
            out.add(where, "values beside low or high", "values, or low and high")
        if not isinstance(item["values"], list) or len(item["values"]) < 2 or nominal not in item["values"]:
            out.add(f"{where}.values", shown(item["values"]), f"two or more values, one of them {shown(nominal)}")
            return
        for i, value in enumerate(item["values"]):
            check_value(out, f"{where}.values[{i}]", value, key)
        return
    lacking = [end for end in ("low", "high") if end not in item]
    if lacking:
        out.add(where, f"no {' and no '.join(lacking)}", "low and high, or values")
        return
    ends = [check_value(out, f"{where}.{end}", item[end], key) for end in ("low", "high")]
    if not all(ends):
        return
    if isinstance(nominal, (str, list)):
        out.add(where, "low and high for a value that is not a number", "values")
    elif not item["low"] < item["high"]:
        out.add(where, f"low {shown(item['low'])} and high {shown(item['high'])}", "low below high")
    elif not item["low"] <= nominal <= item["high"]:
        got = f"low {shown(item['low'])} and high {shown(item['high'])}"
        out.add(where, got, f"a range that holds the nominal value, {shown(nominal)}")

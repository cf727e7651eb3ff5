"""Rules of a case file that join several keys, and the check of a whole document."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bemt.base.toml import Collector, Key, check_table, check_value, shown
from bemt.case.schema import ASSUMPTION, GROUPS, INCH, POLAR, SCHEMA, TEMPERATURE

__all__ = ["check_case", "check_shape"]

A_SOUND = 340.3  # only to refuse impossible tip speeds
MAX_TIP_MACH = 2.0
MAX_GRID = 50_000_000

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
        for rule in (check_shape, _check_blade, _check_air, _check_sweep, _check_assumptions):
            rule(out, document)


def check_shape(out: Collector, document: Mapping[str, Any]) -> None:
    """Check what joins the sizes of rotor, blade and duct.

    Parameters
    ----------
    out : Collector
        Receives the faults.
    document : mapping
        A document whose single values are sound.
    """
    for rule in (_check_rotor, _check_pitch, _check_duct):
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
        rpm = shown(document["operating"]["rpm"])
        got = f"{rpm} with a diameter of {diameter:.4g} m, a tip Mach number of {mach:.3g}"
        out.add("operating.rpm", got, f"a tip Mach number of {MAX_TIP_MACH:g} or less", "Are both units right?")
    if rotor["kind"] == "fan" and "duct" not in document:
        out.add("duct", "nothing", "a table [duct], because rotor.kind is fan", "A fan without a duct is a propeller")


def _check_blade(out: Collector, document: Mapping[str, Any]) -> None:
    blade = document["blade"]
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
        out.add(
            "blade.section", "nothing", "a table [blade.section]", "Tables [[polars]] replace only its aerodynamics"
        )
    _check_section(out, blade.get("section", {}))


def _check_pitch(out: Collector, document: Mapping[str, Any]) -> None:
    blade = document["blade"]
    pitch, diameter = _length_m(blade, "pitch"), _length_m(document["rotor"], "diameter")
    if not math.isnan(pitch) and not 0.05 <= pitch / diameter <= 5:
        key = next(key for key in ("pitch_in", "pitch_mm") if key in blade)
        metric = blade[key] / 25.4
        hint = ""
        if key == "pitch_in" and 0.1 <= metric * INCH / diameter <= 3:
            hint = f"Looks like millimetres: write pitch_mm = {blade[key]:g} or pitch_in = {metric:.4g}"
        out.add(f"blade.{key}", shown(blade[key]), "a pitch of 0.05 to 5 diameters", hint)


def _check_section(out: Collector, section: Mapping[str, Any]) -> None:
    lists = {k: len(v) for k, v in section.items() if isinstance(v, list) and k != "r_over_R"}
    radii = section.get("r_over_R", [])
    for key, count in lists.items():
        if count != len(radii):
            out.add(f"blade.section.{key}", f"a list of {count}", f"as many values as r_over_R has, {len(radii)}")
    names = section.get("naca", [])
    for name in [names] if isinstance(names, str) else names:
        if not re.fullmatch(r"\d{4,5}", name):
            hint = "Leave the word NACA out" if name.upper().startswith("NACA") else ""
            out.add("blade.section.naca", repr(name), "four or five digits, such as 4412 or 23012", hint)
    if any(b <= a for a, b in zip(radii, radii[1:], strict=False)):
        out.add("blade.section.r_over_R", "radii that do not ascend", "ascending radii")
    if radii and not lists:
        out.add(
            "blade.section.r_over_R", f"a list of {len(radii)}", "nothing, because the section is the same everywhere"
        )
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
    if duct.get("lip_radius_mm", 0) > duct["length_mm"]:
        out.add("duct.lip_radius_mm", shown(duct["lip_radius_mm"]), f"at most length_mm, {duct['length_mm']:g}")
    if duct.get("rotor_position_mm", 0) > duct["length_mm"]:
        out.add("duct.rotor_position_mm", shown(duct["rotor_position_mm"]), f"at most length_mm, {duct['length_mm']:g}")


def _check_air(out: Collector, document: Mapping[str, Any]) -> None:
    air = document["air"]
    if "pressure_hPa" in air and "temperature_C" not in air:
        out.add("air.temperature_C", "nothing", f"{TEMPERATURE.expected}, because pressure_hPa is given")
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

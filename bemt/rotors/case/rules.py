"""Rules of a case file that join several keys; single values are checked by their models."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bemt.base.errors import InputError
from bemt.base.given import inside
from bemt.base.toml import Table, check_field, shown, validated
from bemt.base.toml_text import Collector
from bemt.rotors.case.reading import parse_reading
from bemt.rotors.case.schema import GROUPS, INCH, AsBuiltTable, AssumptionTable, BladeTable, CaseFile, SectionTable
from bemt.rotors.measured import records

A_SOUND = 340.3  # only to refuse impossible tip speeds
MAX_TIP_MACH = 2.0
MAX_GRID = 50_000_000
_USUAL = (0.03, 3.0)  # diameters of propellers; only to tell which of two lengths has the wrong unit [m]


def check_case(out: Collector, document: Mapping[str, Any], folder: Path) -> CaseFile | None:
    """Check a whole case document; add every fault to the collector.

    >>> out = Collector("case.toml")
    >>> check_case(out, {"schema": "bemt.case/1", "name": "x", "rotr": {}}, Path("."))
    >>> print(out.faults[0])  # doctest: +ELLIPSIS
    case.toml: rotr: got an unknown key; expected one of schema, ... Did you mean rotor?
    """
    case = validated(CaseFile, document, out)
    _check_groups(out, document)
    _check_files(out, document, folder)
    if case is not None and not out.faults:  # the rules below need sound values
        for rule in (check_shape, _check_blade, _check_sweep, _check_assumptions):
            rule(out, case)
    return None if out.faults else case


def check_shape(out: Collector, case: CaseFile) -> None:
    """Check what joins the sizes of rotor, blade and duct."""
    for rule in (_check_rotor, _check_pitch, _check_duct, _check_pair):
        rule(out, case)


def table_at(case: CaseFile, name: str) -> Table | None:
    """Table of a case by dotted name, "" for the file itself; None when it is not there."""
    table: Any = case
    for part in name.split(".") if name else ():
        table = getattr(table, part, None)
    return table if isinstance(table, Table) else None


def value_at(case: CaseFile, key: str) -> Any:
    """Value at a dotted key, None when the case does not hold it."""
    home, _, name = key.rpartition(".")
    table = table_at(case, home)
    if table is None or name not in table.named():
        return None
    field = next(field for field, info in type(table).model_fields.items() if (info.alias or field) == name)
    value = getattr(table, field)
    return list(value) if isinstance(value, tuple) else value


def _inner(document: Mapping[str, Any], name: str) -> Mapping[str, Any] | None:
    value: Any = document
    for part in name.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value if isinstance(value, Mapping) else None


def _check_groups(out: Collector, document: Mapping[str, Any]) -> None:
    for name, keys, required in GROUPS:
        table = _inner(document, name)
        if table is None:
            continue
        given = [key for key in keys if key in table]
        if len(given) > 1:
            out.add(name, " and ".join(given), f"only one of {', '.join(keys)}", f"Drop all but {given[0]}")
        elif required and not given:
            out.add(name, f"none of {', '.join(keys)}", "exactly one of them")


def _check_files(out: Collector, document: Mapping[str, Any], folder: Path) -> None:
    places = [("references", document.get("references"))]
    for name in ("blade.stations", "blade.uiuc", "blade.apc", "blade.section.dat", "blade.as_built.file"):
        table, key = name.rsplit(".", 1)
        value = (_inner(document, table) or {}).get(key)
        places += [(name, v) for v in (value if isinstance(value, list) else [value])]
    polars = document.get("polars", [])
    if isinstance(polars, list):
        places += [(f"polars[{i}].file", p.get("file")) for i, p in enumerate(polars) if isinstance(p, Mapping)]
    for where, value in places:
        if not isinstance(value, str) or not value.strip():
            continue
        expected = "the name of a file in the folder of the case"
        if where == "references" and not inside(folder, value):  # what is printed and put into reports
            out.add(where, f"{value!r}, which lies outside it", expected, "Copy the file there")
        elif not (folder / value).is_file():
            out.add(where, f"{value!r}, which does not exist", expected, "Check the name")


def _given(table: Table, *names: str) -> list[str]:
    """Those of some keys that a table states."""
    fields = {(info.alias or field): field for field, info in type(table).model_fields.items()}
    return [n for n in names if n in fields and fields[n] in table.model_fields_set]


def _check_rotor(out: Collector, case: CaseFile) -> None:
    rotor = case.rotor
    if rotor.hub_diameter_m >= rotor.diameter_m:
        (key,) = _given(rotor, "hub_diameter_mm", "hub_diameter_in", "hub_ratio")
        out.add(f"rotor.{key}", shown(getattr(rotor, key)), f"less than the diameter, {rotor.diameter_m * 1e3:.6g} mm")
    label = re.search(r"(?<![A-Za-z\d.])(\d{1,2}(?:\.\d+)?)x\d{1,2}(?:\.\d+)?(?![\dp.])", case.name)
    told = float(label[1]) * INCH / rotor.diameter_m if label else 0.0
    if abs(told - 2.0) < 0.01:
        got = f"a diameter of {rotor.diameter_m * 1e3:.5g} mm in the case {case.name}"
        out.add("rotor", got, f"{told * rotor.diameter_m * 1e3:.5g} mm, as its name says", "Is that the radius?")
    size = _given(rotor, "diameter_in", "diameter_mm", "diameter_m")[0]
    for unit, factor in (("in", 25.4), ("mm", 1.0 / 25.4)):
        if abs(told / factor - 1.0) < 0.01 and size == {"in": "diameter_mm", "mm": "diameter_in"}[unit]:
            value = getattr(rotor, size)
            expected = f"{value * factor:.4g}, as the name of the case says, {case.name}"
            looks = {"in": "inches", "mm": "millimetres"}[unit]
            out.add(f"rotor.{size}", shown(value), expected, f"Looks like {looks}: write diameter_{unit} = {value:g}")
    mach = math.pi * rotor.diameter_m * case.operating.rpm / 60 / A_SOUND
    if mach > MAX_TIP_MACH:
        rpm = shown(case.operating.rpm)
        got = f"{rpm} with a diameter of {rotor.diameter_m:.4g} m, a tip Mach number of {mach:.3g}"
        out.add("operating.rpm", got, f"a tip Mach number of {MAX_TIP_MACH:g} or less", "Are both units right?")
    if rotor.kind == "fan" and case.duct is None:
        out.add("duct", "nothing", "a table [duct], because rotor.kind is fan", "A fan without a duct is a propeller")


def _check_blade(out: Collector, case: CaseFile) -> None:
    blade = case.blade
    pitches = _given(blade, "pitch_in", "pitch_mm", "pitch_ratio")
    if blade.chord_law is not None:
        if not pitches:
            out.add("blade", "no pitch", "one of pitch_in, pitch_mm, pitch_ratio")
        if blade.taper is not None and blade.chord_law != "linear_taper":
            out.add("blade.taper", shown(blade.taper), "nothing, because chord_law is not linear_taper")
        if blade.tip_relief is not None and blade.pitch_law != "tip_relieved":
            out.add("blade.tip_relief", shown(blade.tip_relief), "nothing, because pitch_law is not tip_relieved")
    else:
        (source,) = _given(blade, "stations", "uiuc", "apc")
        for key in (*pitches, *_given(blade, "max_chord_over_R", "taper", "pitch_law", "tip_relief")):
            hint = "Use beta_offset_deg to turn the blade" if key in pitches else ""
            out.add(f"blade.{key}", shown(getattr(blade, key)), f"nothing, because {source} gives it", hint)
    _check_as_built(out, blade)
    if blade.section is not None:
        _check_section(out, blade.section)


def _check_as_built(out: Collector, blade: BladeTable) -> None:
    """Check that what tells of the rotor as built goes together."""
    told = AsBuiltTable() if blade.as_built is None else blade.as_built
    measured, posterior = told.measured, told.file is not None or (told.reading is not None and told.measured is None)
    if blade.known_from is not None and (blade.known_from == "reference") != posterior:
        got = 'known_from = "reference" without as_built.file or reading' if not posterior else repr(blade.known_from)
        expected = 'known_from = "reference" and blade.as_built.file or reading together'
        hint = "Write [blade.as_built] with reading, or take the case that bemt lab calibrate-rotor writes"
        out.add("blade.known_from", got, expected, hint if not posterior else "as_built says it: delete known_from")
    if told.file is not None and (told.reading is not None or measured is not None):
        out.add("blade.as_built.file", repr(told.file), "nothing else that tells of the rotor beside it")
    if told.reading is not None:
        try:
            parse_reading(told.reading)
        except InputError as error:
            for fault in error.faults:
                out.add("blade.as_built.reading", fault.got, fault.expected, fault.hint)
    if blade.known_from is not None and (blade.known_from == "measured") != (measured is not None):
        expected = 'known_from = "measured" and blade.as_built.measured together'
        out.add("blade.known_from", f"{blade.known_from!r}, as_built.measured {measured!r}", expected)
    if measured is not None and measured not in records():
        close = difflib.get_close_matches(measured, records(), n=1)
        out.add("blade.as_built.measured", repr(measured), "a measured propeller that bemt knows",
                f"Did you mean {close[0]}?" if close else "")  # fmt: skip


def _check_pitch(out: Collector, case: CaseFile) -> None:
    blade, diameter = case.blade, case.rotor.diameter_m
    given = _given(blade, "pitch_in", "pitch_mm")
    pitch = blade.pitch_m(diameter)
    if not given or 0.05 <= pitch / diameter <= 5 or any(f.where.startswith("rotor.diameter") for f in out.faults):
        return
    (key,), (size,) = given, _given(case.rotor, "diameter_in", "diameter_mm", "diameter_m")
    fixes = []  # what one other unit makes of it: key, value, hint, diameter then
    for where, name, value, other in (
        ("rotor", size, float(getattr(case.rotor, size if size != "diameter_m" else "diameter_m_")), pitch),
        ("blade", key, float(getattr(blade, key)), diameter),
    ):
        stem, _, unit = name.rpartition("_")
        swapped = {"in": "mm", "mm": "in"}.get(unit)
        if swapped is None:
            continue
        length = value * (1e-3 if swapped == "mm" else INCH)
        ratio = other / length if where == "rotor" else length / other
        if 0.1 <= ratio <= 3:
            converted = length / (INCH if unit == "in" else 1e-3)
            looks = {"in": "inches", "mm": "millimetres"}[swapped]
            hint = f"Looks like {looks}: write {stem}_{swapped} = {value:g} or {name} = {converted:.4g}"
            fixes.append((f"{where}.{name}", shown(value), hint, length if where == "rotor" else diameter))
    fixes = [fix for fix in fixes if _USUAL[0] <= fix[3] <= _USUAL[1]]
    place, got = f"blade.{key}", shown(getattr(blade, key))
    if len(fixes) == 1:
        place, got, hint, _ = fixes[0]
    else:
        hint = "; or ".join(f"{where.rpartition('.')[2]}: {text[0].lower()}{text[1:]}" for where, _, text, _ in fixes)
    expected = "a pitch of 0.05 to 5 diameters"
    if place.startswith("rotor"):
        expected = f"a diameter that goes with the pitch, {pitch * 1e3:.4g} mm: 0.2 to 20 times it"
    out.add(place, got, expected, hint)


def _check_section(out: Collector, section: SectionTable) -> None:
    stated = {name: getattr(section, name) for name in section.model_fields_set}
    lists = {k: len(v) for k, v in stated.items() if isinstance(v, tuple) and k != "r_over_R"}
    radii = section.r_over_R or ()
    for key, count in lists.items():
        if count != len(radii):
            out.add(f"blade.section.{key}", f"a list of {count}", f"as many values as r_over_R has, {len(radii)}")
    names = section.naca or ()
    for name in (names,) if isinstance(names, str) else names:
        if not re.fullmatch(r"\d{4,5}", name):
            hint = "Leave the word NACA out" if name.upper().startswith("NACA") else ""
            out.add("blade.section.naca", repr(name), "four or five digits, such as 4412 or 23012", hint)
    if any(b <= a for a, b in zip(radii, radii[1:], strict=False)):
        out.add("blade.section.r_over_R", "radii that do not ascend", "ascending radii")
    if radii and not lists:
        got, expected = f"a list of {len(radii)}", "nothing, because the section is the same everywhere"
        out.add("blade.section.r_over_R", got, expected)
    for key in ("camber", "camber_position"):
        if key in stated and "thickness" not in stated:
            out.add(f"blade.section.{key}", shown(stated[key]), "nothing without thickness")


def _check_axial(out: Collector, case: CaseFile, what: str, why: str) -> None:
    angles = [case.operating.angle_deg, *case.sweep.axes().get("angle_deg", ())]
    if any(angles):
        where = "operating.angle_deg" if angles[0] else "sweep.angle_deg"
        out.add(where, f"{max(angles):g} deg on {what}", "0 deg", why)


def _check_duct(out: Collector, case: CaseFile) -> None:
    duct, diameter = case.duct, case.rotor.diameter_m
    if duct is None:
        return
    _check_axial(out, case, "a ducted rotor", "Oblique flow is solved for open rotors only")
    if duct.inner_diameter_m < diameter:
        (key,) = _given(duct, "inner_diameter_mm", "inner_diameter_in")
        out.add(f"duct.{key}", shown(getattr(duct, key)), f"at least the rotor diameter, {diameter * 1e3:.6g} mm")
    if (duct.tip_gap_mm or 0.0) > 0.1 * diameter / 2 * 1e3:
        out.add("duct.tip_gap_mm", shown(duct.tip_gap_mm), f"at most a tenth of the radius, {diameter * 50:.4g} mm")
    stated = duct.inner_diameter_m > 0.0
    bore = 1e3 * (duct.inner_diameter_m if stated else diameter) + (0.0 if stated else 2.0 * (duct.tip_gap_mm or 0.0))
    least = bore + 2.0 * (duct.lip_radius_mm or 0.0)
    if duct.outer_diameter_mm is not None and duct.outer_diameter_mm < least:
        out.add("duct.outer_diameter_mm", shown(duct.outer_diameter_mm), f"at least bore and lip, {least:.6g} mm")
    for key in ("lip_radius_mm", "lip_length_mm", "rotor_position_mm"):
        value = getattr(duct, key) or 0.0
        if value > duct.length_mm:
            out.add(f"duct.{key}", shown(value), f"at most length_mm, {duct.length_mm:g}")


def _check_pair(out: Collector, case: CaseFile) -> None:
    second = case.second_rotor
    if second is None:
        return
    if case.duct is not None:
        out.add("second_rotor", "a second rotor with a duct", "two open rotors")
    if case.drive is not None:
        out.add("second_rotor", "a second rotor with [drive]", "one of them", "A drive turns one rotor")
    _check_axial(out, case, "a coaxial pair", "A pair is solved in axial flow only")
    speeds = [case.operating.airspeed_m_s, *case.sweep.axes().get("airspeed_m_s", ())]
    if min(speeds) < 0.0:
        where = "operating.airspeed_m_s" if speeds[0] < 0.0 else "sweep.airspeed_m_s"
        got = f"{min(speeds):g} m/s on a coaxial pair"
        out.add(where, got, "0 m/s or more", "The wake of the first rotor has to reach the second")
    whole = second.spacing_m(case.rotor.diameter_m) / case.rotor.diameter_m
    if second.spacing_mm is not None and whole > 20.0:
        out.add("second_rotor.spacing_mm", shown(second.spacing_mm), "at most 20 diameters of the first rotor")


def _check_sweep(out: Collector, case: CaseFile) -> None:
    sweep = case.sweep.axes()
    if "density_kg_m3" in sweep and ("altitude_m" in sweep or "temperature_C" in sweep):
        other = "altitude_m" if "altitude_m" in sweep else "temperature_C"
        out.add("sweep.density_kg_m3", f"an axis together with {other}", f"density_kg_m3 or {other}, not both")
    if "temperature_C" in sweep and case.air.density_kg_m3 is not None and "altitude_m" not in sweep:
        out.add(
            "sweep.temperature_C", "an axis with air.density_kg_m3", "air.altitude_m or air.pressure_hPa",
            "Temperature changes nothing when the density is fixed",
        )  # fmt: skip
    if "pitch_in" in sweep and case.blade.chord_law is None:
        out.add("sweep.pitch_in", "an axis", "nothing, because the blade comes from stations")
    if "tip_gap_mm" in sweep and case.duct is None:
        out.add("sweep.tip_gap_mm", "an axis", "nothing, because there is no duct")
    if "z_over_D" in sweep and case.second_rotor is None:
        out.add("sweep.z_over_D", "an axis", "nothing, because there is no second rotor")
    points = math.prod(axis.size for axis in sweep.values())
    if points > MAX_GRID:
        out.add("sweep", f"a grid of {points} points", f"{MAX_GRID} points or fewer", "Take fewer values")


def _check_assumptions(out: Collector, case: CaseFile) -> None:
    seen: set[str] = set()
    for i, item in enumerate(case.assumptions):
        where, key = f"assumptions[{i}]", item.key
        home, _, name = key.rpartition(".")
        table, nominal = table_at(case, home), value_at(case, key)
        if not home or table is None or nominal is None or table.inner(name) is not None:
            out.add(f"{where}.key", repr(key), "the dotted key of a value in this file")
            continue
        if key in seen:
            out.add(f"{where}.key", f"{key!r} again", "each key once")
        seen.add(key)
        _check_assumption(out, where, item, nominal, type(table), name)


def _check_assumption(
    out: Collector, where: str, item: AssumptionTable, nominal: Any, table: type[Table], name: str
) -> None:
    low, high = item.low, item.high
    if item.values is not None:
        if low is not None or high is not None:
            out.add(where, "values together with low or high", "values, or low and high")
        if len(item.values) < 2 or nominal not in item.values:
            out.add(f"{where}.values", shown(item.values), f"two or more values, one of them {shown(nominal)}")
            return
        for i, value in enumerate(item.values):
            check_field(out, f"{where}.values[{i}]", table, name, value)
        return
    if low is None or high is None:
        lacking = " and no ".join(end for end, value in (("low", low), ("high", high)) if value is None)
        out.add(where, f"no {lacking}", "low and high, or values")
        return
    ends = [check_field(out, f"{where}.{end}", table, name, value) for end, value in (("low", low), ("high", high))]
    if not all(ends):
        return
    if isinstance(nominal, (str, list)):
        out.add(where, "low and high for a value that is not a number", "values")
    elif not low < high:
        out.add(where, f"low {shown(low)} and high {shown(high)}", "low below high")
    elif not low <= nominal <= high:
        got = f"low {shown(low)} and high {shown(high)}"
        out.add(where, got, f"a range that holds the nominal value, {shown(nominal)}")

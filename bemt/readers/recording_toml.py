"""``recording.toml``: what a table of measurements does not say of itself, in a small file beside it.

::

    [recording]
    file = "run1.csv"              # or a list, in the order in which the runs were made
    session = "2024-05-03"         # runs of one session share their zero and gain
    decimal = "."                  # or ","
    header = true                  # false: the first line is data

    [columns]                      # channel = where it stands, unit, sign, uncertainty of the instrument
    time = { column = "t", unit = "ms" }
    thrust = { column = 2, unit = "gf", sign = -1, u_gain_pct = 0.5, u_zero = 1.0, u_sample = 2.0 }
    electrical_rpm = { column = "eRPM", unit = "rpm" }

    [rotor]
    pole_pairs = 7                 # needed by electrical_rpm, refused without it
    diameter_in = 10.0
    gap_mm = 0.5

    [air]                          # a density, or pressure and temperature (and humidity), or an altitude
    pressure_hPa = 1002.0
    temperature_C = 21.0
    humidity_pct = 45.0

    [stand]
    wall_distance_m = 1.2
    name = "home-made"

Keys are strict, and all faults of the file are reported at once. ``u_zero`` and ``u_sample`` are standard uncertainties
in the unit of the column. Columns that are not named keep what their headings say.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.air import Air
from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.base.toml import Collector, Key, check_table, load_toml, shown
from bemt.dataset import Dataset
from bemt.readers import head_text, load_text
from bemt.readers._columns import Channel, dataset
from bemt.readers._headings import Heading, heading
from bemt.readers._large import large_table
from bemt.readers._recording import Builder, spikes
from bemt.readers._split import some, split_table

__all__ = ["KIND", "QUANTITIES", "read", "sniff"]

KIND = "recording"
QUANTITIES: dict[str, str] = {
    "time": "time", "pulse_width": "time", "throttle": "fraction", "thrust": "force", "duct_thrust": "force",
    "torque": "torque", "rpm": "angular_speed", "electrical_rpm": "angular_speed", "optical_rpm": "angular_speed",
    "voltage": "voltage", "current": "current", "electrical_power": "power", "power": "power", "airspeed": "speed",
    "temperature": "temperature", "pressure": "pressure", "humidity": "fraction", "density": "density",
}  # fmt: skip
"""Channels that ``[columns]`` may name, and their dimension."""


def _lengths(name: str, low_m: float, high_m: float) -> dict[str, Key]:
    """The same length in m, mm and in."""
    scale = {"m": 1.0, "mm": 1e-3, "in": units.INCH}
    return {f"{name}_{u}": Key(unit=u, low=low_m / f, high=high_m / f) for u, f in scale.items()}


SCHEMA: dict[str, dict[str, Key]] = {
    "recording": {
        "file": Key("text_or_texts", required=True), "session": Key("text"), "remark": Key("text"),
        "decimal": Key("choice", choices=(".", ",")), "delimiter": Key("choice", choices=(",", ";", "\t", "|", " ")),
        "uncertainty_source": Key("text"),
    },
    "column": {
        "unit": Key("choice", choices=(*sorted(units.UNITS), "-"), required=True),
        "sign": Key("integer", low=-1, high=1), "u_gain_pct": Key(unit="%", low=0.0, high=50.0),
        "u_zero": Key(low=0.0), "u_sample": Key(low=0.0),
    },
    "rotor": {
        "pole_pairs": Key("integer", low=1, high=60), "blades": Key("integer", low=1, high=64), "name": Key("text"),
        "motor": Key("text"), "ducted": Key("choice", choices=("yes", "no")),
        **_lengths("diameter", 0.005, 12.0), **_lengths("pitch", 0.001, 20.0), **_lengths("gap", 0.0, 0.2),
    },
    "air": {
        "density_kg_m3": Key(unit="kg/m3", low=0.2, high=2.0), "pressure_hPa": Key(unit="hPa", low=300.0, high=1100.0),
        "temperature_C": Key(unit="C", low=-60.0, high=60.0), "humidity_pct": Key(unit="%", low=0.0, high=100.0),
        "altitude_m": Key(unit="m", low=-500.0, high=11000.0),
    },
    "stand": {
        "name": Key("text"), **_lengths("wall_distance", 0.01, 100.0), **_lengths("ground_distance", 0.01, 100.0),
    },
}  # fmt: skip


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a text has the tables of a recording.toml. [recording]

    Examples
    --------
    >>> sniff('[recording]\nfile = "a.csv"\n'), sniff("[rotor]\n")
    (True, False)
    """
    return any(line.split("#")[0].strip() == "[recording]" for line in head_text(head).splitlines())


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a recording.toml and the tables that it names."""
    out = Collector(os.fspath(path))
    document = load_toml(Path(path), out)
    if document is None:
        raise InputError(out.faults)
    _check(out, document)
    constants = _constants(out, document)
    if out.faults:
        raise InputError(out.faults)
    head = document["recording"]
    files = [head["file"]] if isinstance(head["file"], str) else list(head["file"])
    runs: list[Dataset] = []
    faults: list[Fault] = []
    for name in files:
        try:
            runs.append(_run(out.file, Path(path).with_name(name), document))
        except InputError as error:
            faults.extend(error.faults)
    if faults:
        raise InputError(faults)
    joined = _join(runs, files)
    warnings = list(joined.notes)
    if "density_kg_m3" not in constants and "density_kg_m3" not in joined:
        warnings.append("no air state: coefficients need a density ([air] in the recording)")
    said = {"recording": out.file, **{k: str(v) for k, v in head.items() if isinstance(v, str) and k != "file"}}
    for table in ("rotor", "stand"):
        said |= {f"{table}_{k}": v for k, v in document.get(table, {}).items() if isinstance(v, str)}
    told = {"constants": constants, "instrument": _instrument(document["columns"])}
    about = {**joined.provenance, **said, **{k: v for k, v in told.items() if v}, "format": KIND}
    return replace(joined, kind="bench", notes=tuple(dict.fromkeys(warnings)), provenance=about)


def _check(out: Collector, document: Mapping[str, Any]) -> None:
    """All faults of the TOML document."""
    tables = ("recording", "columns", "rotor", "air", "stand")
    for name in document:
        if name not in tables:
            close = difflib.get_close_matches(name, tables, n=1)
            hint = f"Did you mean {close[0]}?" if close else ""
            out.add(name, "an unknown table", f"one of {', '.join(tables)}", hint)
    head = document.get("recording", {})
    plain = {k: v for k, v in head.items() if k != "header"} if isinstance(head, Mapping) else head
    check_table(out, "recording", plain, SCHEMA)
    if isinstance(head, Mapping) and not isinstance(head.get("header", True), bool):
        out.add("recording.header", shown(head["header"]), "true or false")
    for name in _names(head):
        if Path(name).is_absolute() or ".." in Path(name).parts:
            out.add("recording.file", repr(name), "the name of a file beside this one")
    for name in ("rotor", "air", "stand"):
        if name in document:
            check_table(out, name, document[name], SCHEMA)
    columns = document.get("columns")
    if not isinstance(columns, Mapping) or not columns:
        out.add("columns", "nothing" if columns is None else shown(columns), "a table with one channel or more")
        return
    for name, column in columns.items():
        _check_column(out, name, column)
    _check_poles(out, document, columns)


def _names(head: Any) -> list[str]:
    value = head.get("file") if isinstance(head, Mapping) else None
    found = value if isinstance(value, list) else [value]
    return [name for name in found if isinstance(name, str)]


def _check_column(out: Collector, name: str, column: Any) -> None:
    where = f"columns.{name}"
    if name not in QUANTITIES:
        close = difflib.get_close_matches(name, QUANTITIES, n=1)
        hint = f"Did you mean {close[0]}?" if close else ""
        out.add(where, "an unknown channel", f"one of {', '.join(QUANTITIES)}", hint)
        return
    if not isinstance(column, Mapping):
        out.add(where, shown(column), '{ column = "heading or number", unit = "..." }')
        return
    check_table(out, "column", {k: v for k, v in column.items() if k != "column"}, SCHEMA, where=where)
    place = column.get("column")
    if isinstance(place, bool) or not (isinstance(place, int) and place >= 1 or isinstance(place, str) and place):
        got = "nothing" if place is None else shown(place)
        out.add(f"{where}.column", got, "a heading, or the number of a column from 1")
    if column.get("sign") == 0:
        out.add(f"{where}.sign", "0", "1 or -1")
    unit, dimension = column.get("unit"), QUANTITIES[name]
    lawful = units.suffixes(dimension) + (("-",) if dimension == "fraction" else ())
    if isinstance(unit, str) and (unit in units.UNITS or unit == "-") and unit not in lawful:
        mass = unit in units.UNITS and units.UNITS[unit].dimension == "mass" and dimension == "force"
        hint = f"{unit} is a mass: write {unit}f for the force" if mass else ""
        out.add(f"{where}.unit", repr(unit), f"one of {', '.join(lawful)}", hint)


def _check_poles(out: Collector, document: Mapping[str, Any], columns: Mapping[str, Any]) -> None:
    rotor = document.get("rotor")
    poles = isinstance(rotor, Mapping) and "pole_pairs" in rotor
    if "electrical_rpm" in columns and not poles:
        hint = "An outrunner with 14 magnets has 7; a stand that divided already gives rpm, not electrical_rpm"
        out.add("rotor.pole_pairs", "nothing", "the pole pairs of the motor, since electrical_rpm is given", hint)
    if poles and "electrical_rpm" not in columns:
        out.add("rotor.pole_pairs", shown(rotor["pole_pairs"]) if rotor else "", "no pole_pairs without electrical_rpm",
                "Name the column electrical_rpm if it counts electrical revolutions")  # fmt: skip


def _constants(out: Collector, document: Mapping[str, Any]) -> dict[str, float]:
    """Numbers that hold for all rows, in SI."""
    found: dict[str, float] = {}
    if out.faults:
        return found
    for table in ("rotor", "stand"):
        for key, value in document.get(table, {}).items():
            if isinstance(value, str):
                continue
            name, unit = units.split_suffix(key)
            label = f"{name}_m" if unit is not None else key
            if label in found:
                out.add(f"{table}.{key}", "a second unit of the same length", "each length once")
            found[label] = float(units.to_si(float(value), unit.suffix)) if unit is not None else float(value)
    air = document.get("air", {})
    ways = [key for key in ("density_kg_m3", "pressure_hPa", "altitude_m") if key in air]
    if air and len(ways) != 1:
        out.add("air", " and ".join(ways) or "no density", "one of density_kg_m3, pressure_hPa, altitude_m")
    elif ways == ["pressure_hPa"] and "temperature_C" not in air:
        out.add("air.temperature_C", "nothing", "the temperature that goes with pressure_hPa")
    elif "humidity_pct" in air and ways != ["pressure_hPa"]:
        out.add("air.humidity_pct", shown(air["humidity_pct"]), "no humidity without pressure_hPa")
    elif ways:
        found |= {"density_kg_m3": _density(air, ways[0])}
        if "temperature_C" in air:
            found["temperature_K"] = float(air["temperature_C"]) + units.ZERO_CELSIUS
    return found


def _density(air: Mapping[str, Any], way: str) -> float:
    if way == "density_kg_m3":
        return float(air[way])
    if way == "pressure_hPa":
        pressure, humidity = float(air[way]) * 100.0, float(air.get("humidity_pct", 0.0))
        return float(Air.from_state(pressure, float(air["temperature_C"]), humidity).rho)
    standard = Air.isa(float(air[way]))
    rho, T = float(standard.rho), float(standard.temperature)
    return rho * T / (float(air["temperature_C"]) + units.ZERO_CELSIUS) if "temperature_C" in air else rho


def _instrument(columns: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Uncertainties by channel: gain [1], zero and sample in the unit of the channel."""
    out: dict[str, dict[str, float]] = {}
    for name, column in columns.items():
        head = _heading(name, column["unit"], "")
        factor = 1.0 if head.unit is None or head.unit.suffix == "rpm" else head.unit.factor
        own = {"gain": column["u_gain_pct"] / 100.0} if "u_gain_pct" in column else {}
        own |= {k[2:]: column[k] * factor for k in ("u_zero", "u_sample") if k in column}
        if own:
            out[head.name] = own
    return out


def _heading(name: str, unit: str, text: str) -> Heading:
    if unit == "-":
        return Heading(text, name, units.Unit("", "none", 1.0))
    if QUANTITIES[name] == "angular_speed":
        u = units.UNITS[unit]
        return Heading(text, name, u if unit == "rpm" else units.Unit("", "angular_speed", u.factor / units.RPM))
    return Heading(text, heading(f"{name}_{unit}").name, units.UNITS[unit])


def _run(file: str, path: Path, document: Mapping[str, Any]) -> Dataset:
    """One table with the map applied."""
    head, columns = document["recording"], document["columns"]
    large = large_table(path) if not {"delimiter", "header", "decimal"} & head.keys() else None
    told = (head.get("delimiter"), head.get("header"))
    table = large[0] if large is not None and large[1] == "." else split_table(load_text(path), *told)
    source, width = table.source, table.width
    places: dict[int, str] = {}
    faults = []
    for name, column in columns.items():
        place = column["column"]
        if isinstance(place, int):
            index = place - 1 if place <= width else None
        else:
            hits = [k for k, h in enumerate(table.headings) if h == place]
            index = hits[0] if len(hits) == 1 else None
        if index is None or index in places:
            known = some((repr(h) for h in table.headings if h), 12) or f"columns 1 to {width}"
            got = f"{place!r} again" if index is not None else f"{place!r}, which {source.name} has not (or twice)"
            faults.append(Fault(file, f"columns.{name}.column", got, f"one of {known}"))
        else:
            places[index] = name
    if faults:
        raise InputError(faults)
    build = Builder(table, KIND)
    decimal = head.get("decimal", ".")
    for k in sorted(range(width), key=lambda k: k not in places):
        text = table.headings[k] if table.headings else ""
        if k in places:
            column = columns[places[k]]
            at = _heading(places[k], column["unit"], text or f"column {k + 1}")
            rows = len(build.unitless)
            name = build.add(k, at, decimal, float(column.get("sign", 1)))
            if not name and not build.faults:
                where = f"columns.{places[k]}.column"
                build.faults.append(Fault(file, where, f"column {k + 1} without numbers", "a column of numbers"))
            del build.unitless[rows:]
        else:
            build.add(k, heading(text) if text else Heading("", f"column_{k + 1}", None), decimal)
    if not build.faults:
        _derive(build, document)
    return build.finish()


def _derive(build: Builder, document: Mapping[str, Any]) -> None:
    """Mechanical speed from the electrical one, and the flags."""
    for name in ("rpm", "electrical_rpm", "optical_rpm"):
        if name in build.channels:
            values = build.channels[name].values
            build.channels[name] = Channel(values, "rpm")
            build.flag(np.flatnonzero(values == 0.0), f"{name} is 0")
            build.flag(np.flatnonzero(values < 0.0), f"{name} is negative")
    if "electrical_rpm" in build.channels:
        pairs = int(document["rotor"]["pole_pairs"])
        label = build.free("rpm") if "rpm" not in build.channels else "rpm_from_electrical_rpm"
        build.channels[label] = Channel(build.channels["electrical_rpm"].values / pairs, "rpm")
        build.warnings.append(f"{label} is electrical_rpm over {pairs} pole pairs, as the recording says")
    build.flag_time()
    if "time_s" in build.channels:
        for name in ("thrust_N", "torque_Nm", "rpm", "electrical_rpm", "optical_rpm"):
            if name in build.channels:
                build.flag(np.flatnonzero(spikes(build.channels[name].values)), f"spike of {name}")
    build.check_magnitudes()


def _join(runs: list[Dataset], files: list[str]) -> Dataset:
    """Runs in their order; a channel that a run lacks is NaN there."""
    if len(runs) == 1:
        return runs[0]
    names = list(dict.fromkeys(name for run in runs for name in run.values))
    channels = {}
    for name in names:
        found = {run.unit(name) for run in runs if name in run}
        parts = [run.values.get(name, np.full(len(run), np.nan)) for run in runs]
        channels[name] = Channel(np.concatenate(parts), found.pop() if len(found) == 1 else "")
    channels["run"] = Channel(np.concatenate([np.full(len(run), float(k)) for k, run in enumerate(runs, 1)]), "-")
    texts = {name: sum((run.texts.get(name, ("",) * len(run)) for run in runs), ())
             for name in dict.fromkeys(n for run in runs for n in run.texts)}  # fmt: skip
    warnings = [f"{file}: {text}" for file, run in zip(files, runs, strict=True) for text in run.notes]
    said = {"file": "+".join(files), "sha256": "+".join(run.provenance["sha256"] for run in runs)}
    return dataset(KIND, "bench", channels, warnings, said, flags=sum((run.flags for run in runs), ()),
                   lines=sum((tuple(run.lines) for run in runs), ()), texts=texts,
                   headings={k: v for run in runs for k, v in run.provenance.get("headings", {}).items()})  # fmt: skip

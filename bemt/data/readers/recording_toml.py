"""``recording.toml``: what a table of measurements does not say of itself, in a small file beside it.

Keys are strict, and all faults of the file are reported at once. ``u_zero`` and ``u_sample`` are standard uncertainties
in the unit of the column. Columns that are not named keep what their headings say.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import create_model

from bemt.base import units
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.tables import some
from bemt.base.toml import Table, entry, shown, validated
from bemt.base.toml_text import Collector, load_toml
from bemt.data.readers import head_text, load_text
from bemt.data.readers._large import NumberTable, large_table
from bemt.data.readers.generic_csv import electrical, heads_of, only_ones
from bemt.data.readers.headings import Heading, in_rpm, known, meanings
from bemt.data.readers.recording import Builder
from bemt.data.readers.samples import Channel
from bemt.data.readers.split import SplitTable, decimal_mark, split_table
from bemt.physics.air import Air
from bemt.physics.dataset import Dataset, concat

__all__ = ["KIND", "QUANTITIES", "RecordingToml", "read", "sniff"]

KIND = "recording"
QUANTITIES: dict[str, str] = {
    "time": "time", "pulse_width": "time", "throttle": "fraction", "thrust": "force", "duct_thrust": "force",
    "torque": "torque", "rpm": "angular_speed", "electrical_rpm": "angular_speed", "optical_rpm": "angular_speed",
    "voltage": "voltage", "current": "current", "electrical_power": "power", "power": "power", "airspeed": "speed",
    "temperature": "temperature", "pressure": "pressure", "humidity": "fraction", "density": "density",
}  # fmt: skip
"""Channels that ``[columns]`` may name, and their dimension."""


def _mass_for_force(unit: Any) -> str:
    mass = unit in units.UNITS and units.UNITS[unit].dimension == "mass"
    return f"{unit} is a mass: write {unit}f for the force" if mass else ""


class ColumnTable(Table):
    """[columns]: column, unit, sign and instrument uncertainty of each channel."""

    column: int | str = entry(
        "column of the channel", low=1, required=True, words="a heading, or the number of a column from 1"
    )
    unit: str = entry("unit of the column", required=True)
    sign: int = entry(
        "factor on every value", "", -1, 1, lambda v: "" if v else "Nothing would be left", default=1, words="1 or -1"
    )
    u_gain_pct: float | None = entry("standard uncertainty of the scale", "%", 0.0, 50.0)
    u_zero: float | None = entry("standard uncertainty of the zero, in the unit of the column", low=0.0)
    u_sample: float | None = entry("standard uncertainty of one sample, in the unit of the column", low=0.0)


def _column_of(dimension: str) -> type[ColumnTable]:
    choices = units.suffixes(dimension) + (("-",) if dimension == "fraction" else ())
    suspect = _mass_for_force if dimension == "force" else None
    unit = entry("unit of the column", suspect=suspect, required=True, choices=choices)
    return create_model("ColumnTable", __base__=ColumnTable, unit=(str, unit))


_OF = {dimension: _column_of(dimension) for dimension in set(QUANTITIES.values())}
_COLUMNS: Any = {name: (_OF[dimension] | None, entry(dimension, words='{ column = "heading or number", unit = "..." }'))
                 for name, dimension in QUANTITIES.items()}  # fmt: skip
ColumnsTable: Any = create_model("ColumnsTable", __base__=Table, **_COLUMNS)


class RecordingHead(Table):
    """[recording]: the tables and their format."""

    file: str | tuple[str, ...] = entry(
        "table in the folder of this file, or several in the order of the runs", required=True
    )
    session: str | None = entry("name of the session; its runs share zero and gain")
    remark: str | None = entry("anything")
    decimal: Literal[".", ","] = entry("decimal separator", default=".", words='"." or ","')
    delimiter: Literal[",", ";", "\t", "|", " "] | None = entry(
        "cell separator; detected if omitted", words='one of ",", ";", "|", tab, space'
    )
    header: bool | None = entry("false: the first line is data; detected if omitted")
    uncertainty_source: str | None = entry("source of the uncertainties")
    ignore: tuple[str, ...] = entry("headings that count for nothing", default=())
    rpm: float | None = entry("speed of rotation, if no column has it", "rev/min", 1.0, 1e6)
    airspeed_m_s: float | None = entry("speed of flight, if no column has it", "m/s", 0.0, 400.0)

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the tables."""
        return (self.file,) if isinstance(self.file, str) else self.file

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Tables lie beside this file."""
        for name in self.files:
            if Path(name).is_absolute() or ".." in Path(name).parts:
                yield "file", repr(name), "the name of a file in the same folder"


class _Constants(Table):
    """Numbers that hold for all rows."""

    def constants(self) -> dict[str, float]:
        """By name, lengths in m."""
        found = {}
        for key, value in self.given().items():
            if isinstance(value, (int, float)):
                name, unit = units.split_suffix(key)
                found[f"{name}_m" if unit else key] = float(units.to_si(value, unit.suffix) if unit else value)
        return found

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Each length once."""
        names = [units.split_suffix(key)[0] for key in self.given()]
        for key, name in zip(self.given(), names, strict=True):
            if names.count(name) > 1 and key != list(self.given())[names.index(name)]:
                yield key, "a second unit of the same length", "each length once"


class RotorFacts(_Constants):
    """[rotor]: the tested rotor."""

    pole_pairs: int | None = entry(
        "pole pairs of the motor; required with electrical_rpm, refused otherwise", low=1, high=60
    )
    blades: int | None = entry("number of blades", low=1, high=64)
    name: str | None = entry("name of the rotor")
    motor: str | None = entry("name of the motor")
    ducted: Literal["yes", "no"] | None = entry("whether the rotor was ducted")
    diameter_in: float | None = entry("tip diameter", "in", 0.2, 480)
    diameter_mm: float | None = entry("tip diameter", "mm", 5, 12_000)
    diameter_m: float | None = entry("tip diameter", "m", 0.005, 12.0)
    pitch_in: float | None = entry("advance per revolution", "in", 0.04, 800)
    pitch_mm: float | None = entry("advance per revolution", "mm", 1, 20_000)
    pitch_m: float | None = entry("advance per revolution", "m", 0.001, 20.0)
    gap_in: float | None = entry("tip gap", "in", 0, 8)
    gap_mm: float | None = entry("tip gap", "mm", 0, 200)
    gap_m: float | None = entry("tip gap", "m", 0.0, 0.2)


class AirFacts(Table):
    """[air]: a density, or pressure and temperature (and humidity), or an altitude."""

    density_kg_m3: float | None = entry("density", "kg/m3", 0.2, 2.0)
    pressure_hPa: float | None = entry("static pressure", "hPa", 300.0, 1100.0)
    temperature_C: float | None = entry("temperature", "C", -60.0, 60.0)
    humidity_pct: float | None = entry("relative humidity, with pressure", "%", 0.0, 100.0)
    altitude_m: float | None = entry("altitude in the standard atmosphere", "m", -500.0, 11000.0)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One way to a density."""
        ways = [key for key in ("density_kg_m3", "pressure_hPa", "altitude_m") if key in self.given()]
        if self.given() and len(ways) != 1:
            yield "", " and ".join(ways) or "no density", "one of density_kg_m3, pressure_hPa, altitude_m"
        elif ways == ["pressure_hPa"] and self.temperature_C is None:
            yield "temperature_C", "nothing", "the temperature that goes with pressure_hPa"
        elif self.humidity_pct is not None and ways != ["pressure_hPa"]:
            yield "humidity_pct", shown(self.humidity_pct), "no humidity without pressure_hPa"

    def constants(self) -> dict[str, float]:
        """Density and temperature in SI; nothing when nothing is stated."""
        if not self.given():
            return {}
        warm = {} if self.temperature_C is None else {"temperature_K": self.temperature_C + units.ZERO_CELSIUS}
        if self.density_kg_m3 is not None:
            return {"density_kg_m3": self.density_kg_m3, **warm}
        if self.pressure_hPa is not None and self.temperature_C is not None:
            air = Air.from_state(self.pressure_hPa * 100.0, self.temperature_C, self.humidity_pct or 0.0)
            return {"density_kg_m3": float(air.rho), **warm}
        standard = Air.isa(self.altitude_m or 0.0)
        factor = float(standard.temperature) / warm["temperature_K"] if warm else 1.0
        return {"density_kg_m3": float(standard.rho) * factor, **warm}


class StandFacts(_Constants):
    """[stand]: the surroundings."""

    name: str | None = entry("name of the stand")
    wall_distance_in: float | None = entry("distance from the rotor to the wall behind it", "in", 0.4, 4000)
    wall_distance_mm: float | None = entry("distance from the rotor to the wall behind it", "mm", 10, 100_000)
    wall_distance_m: float | None = entry("distance from the rotor to the wall behind it", "m", 0.01, 100.0)
    ground_distance_in: float | None = entry("distance from the axis to the ground", "in", 0.4, 4000)
    ground_distance_mm: float | None = entry("distance from the axis to the ground", "mm", 10, 100_000)
    ground_distance_m: float | None = entry("distance from the axis to the ground", "m", 0.01, 100.0)


class RecordingToml(Table):
    """recording.toml: what a table of measurements does not say of itself."""

    recording: RecordingHead
    columns: ColumnsTable = entry("channels whose headings do not say all", default=ColumnsTable())
    rotor: RotorFacts = RotorFacts()
    air: AirFacts = AirFacts()
    stand: StandFacts = StandFacts()

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Something that the table does not say itself."""
        head = self.recording
        said = head.ignore or head.rpm is not None or head.airspeed_m_s is not None
        if not (said or any(p.given() for p in (self.columns, self.rotor, self.air, self.stand))):
            yield "columns", "a table without channels", "a table with one channel or more, [air], [rotor] or [stand]"

    def options(self) -> list[str] | None:
        """Options of ``bemt import`` that state the same; None where no option says all of it."""
        head, rotor, air = self.recording.given(), self.rotor.given(), self.air.given()
        said = {**head, **rotor, **air}
        known = {"file", "decimal", "ignore", "rpm", "airspeed_m_s", "pole_pairs", "density_kg_m3"}
        columns = self.columns.given()
        plain = all({*c.given()} <= {"column", "unit", "sign"} for c in columns.values())
        if not (plain and known >= said.keys()) or self.stand.given() or len(self.recording.files) > 1:
            return None
        told: dict[str, Sequence[object]] = {"ignore": self.recording.ignore}
        own = {q: meanings(str(c.column)) == [q] for q, c in columns.items()}  # the heading says which quantity
        told["column"] = [f"{q}={c.column}" for q, c in columns.items() if not own[q]]
        told["unit"] = [f"{c.column if own[q] else q}={c.unit}" for q, c in columns.items()]
        told["sign"] = [f"{q}={c.sign}" for q, c in columns.items() if c.sign != 1]
        told |= {name.replace("_", "-"): [said[name]] for name in said.keys() & known - {"file", "decimal", "ignore"}}
        return [f"--{name} {shlex.quote(str(v))}" for name, values in told.items() for v in values]


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a text has the tables of a recording.toml. [recording]

    >>> sniff('[recording]\nfile = "a.csv"\n'), sniff("[rotor]\n")
    (True, False)
    """
    return any(line.split("#")[0].strip() == "[recording]" for line in head_text(head).splitlines())


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a recording.toml and the tables that it names."""
    out = Collector(os.fspath(path))
    document = load_toml(Path(path), out)
    made = None if document is None else validated(RecordingToml, document, out)
    _check_poles(out, document or {})
    if made is None or out.faults:
        raise InputError(out.faults)
    return joined(made, Path(path).parent, out.file)


def joined(made: RecordingToml, folder: Path, file: str) -> Dataset:
    """Tables of a recording in a folder with its map applied; `file` is what its faults and provenance name."""
    head, constants = made.recording, made.rotor.constants() | made.stand.constants() | made.air.constants()
    runs: list[Dataset] = []
    faults: list[Fault] = []
    for name in head.files:
        with gathered(faults):
            runs.append(_run(file, folder / name, made))
    refuse(faults)
    joined = _join(runs, head.files)
    warnings = list(joined.notes)
    for name in ("rpm", "airspeed_m_s"):
        own = next((k for k in (name, "J") if k in joined and (k, name) != ("J", "rpm")), None)
        if (value := getattr(head, name)) is not None and own:
            warnings.append(f"{name}: ignored, the file has {own}")
        elif value is not None:
            joined = replace(joined, values={**joined.values, name: np.full(len(joined), value)})
    air = {"pressure_Pa", "temperature_K"} <= joined.values.keys() or "density_kg_m3" in joined
    if "density_kg_m3" not in constants and not air:
        warnings.append("no air state: coefficients need a density ([air] in the recording)")
    said = {"recording": file, **{k: v for k, v in head.given().items() if isinstance(v, str) and k != "file"}}
    for name, facts in (("rotor", made.rotor), ("stand", made.stand)):
        said |= {f"{name}_{k}": v for k, v in facts.given().items() if isinstance(v, str)}
    told = {"constants": constants, "instrument": _instrument(made.columns)}
    about = {**joined.provenance, **said, **{k: v for k, v in told.items() if v}, "format": KIND}
    return replace(joined, kind="bench", notes=tuple(dict.fromkeys(warnings)), provenance=about)


def _check_poles(out: Collector, document: Mapping[str, Any]) -> None:
    """Pole pairs and electrical_rpm come together; said also where other values are wrong."""
    rotor, columns = document.get("rotor"), document.get("columns")
    poles = isinstance(rotor, Mapping) and "pole_pairs" in rotor
    electrical = isinstance(columns, Mapping) and "electrical_rpm" in columns
    if electrical and not poles:
        hint = "An outrunner with 14 magnets has 7; a stand that divided already gives rpm, not electrical_rpm"
        out.add("rotor.pole_pairs", "nothing", "the pole pairs of the motor, since electrical_rpm is given", hint)
    if poles and not electrical and isinstance(columns, Mapping):
        got = shown(rotor["pole_pairs"]) if rotor else ""
        hint = "Name the column electrical_rpm if it counts electrical revolutions"
        out.add("rotor.pole_pairs", got, "no pole_pairs without electrical_rpm", hint)


def _instrument(columns: Any) -> dict[str, dict[str, float]]:
    """Uncertainties by channel: gain [1], zero and sample in the unit of the channel."""
    out: dict[str, dict[str, float]] = {}
    for name, column in columns.given().items():
        head = _heading(name, column.unit, "")
        factor = 1.0 if head.unit is None or head.unit.suffix == "rpm" else head.unit.factor
        stated = ("gain", column.u_gain_pct, 0.01), ("zero", column.u_zero, factor), ("sample", column.u_sample, factor)
        own = {key: value * scale for key, value, scale in stated if value is not None}
        if own:
            out[head.name] = own
    return out


def _heading(name: str, unit: str, text: str) -> Heading:
    if QUANTITIES[name] == "angular_speed":
        return Heading(text, name, in_rpm(units.UNITS[unit]))
    return known(text, name, unit)


def _places(file: str, table: SplitTable | NumberTable, columns: Mapping[str, ColumnTable]) -> dict[int, str]:
    """Quantity of each column that is named, by its heading or its number."""
    width = table.width
    places, out = dict[int, str](), Collector(file)
    for name, column in columns.items():
        place = column.column
        if isinstance(place, int):
            index = place - 1 if place <= width else None
        else:
            hits = [k for k, h in enumerate(table.headings) if h == place]
            index = hits[0] if len(hits) == 1 else None
        if index is None or index in places:
            known = some((repr(h) for h in table.headings if h), 12) or f"columns 1 to {width}"
            got = " again" if index is not None else f", which {table.source.name} has not (or twice)"
            out.add(f"columns.{name}.column", f"{place!r}{got}", f"one of {known}")
        else:
            places[index] = name
    out.check()
    return places


def _run(file: str, path: Path, made: RecordingToml) -> Dataset:
    """One table with the map applied."""
    head, columns = made.recording, made.columns.given()
    large = large_table(path) if not {"delimiter", "header", "decimal"} & head.model_fields_set else None
    told = (head.delimiter, head.header)
    table = large[0] if large is not None and large[1] == "." else split_table(load_text(path), *told)
    places = _places(file, table, columns)
    stated = "decimal" in head.model_fields_set
    decimal = decimal_mark(table) if isinstance(table, SplitTable) and not stated else head.decimal
    build = Builder(table, KIND, decimal=decimal, stated=made.options())
    heads = heads_of(table)
    known = f"one of {some((repr(h) for h in table.headings if h), 12)}"
    refuse(Fault(file, "recording.ignore", repr(h), known) for h in head.ignore if h not in table.headings)
    for k in sorted(range(table.width), key=lambda k: k not in places):
        text = table.headings[k] if table.headings else ""
        if k in places:
            column = columns[places[k]]
            at = _heading(places[k], column.unit, text or f"column {k + 1}")
            rows = len(build.unitless)
            name = build.add(k, at, float(column.sign))
            if not name and not table.source.faults:
                where = f"columns.{places[k]}.column"
                table.source.faults.append(Fault(file, where, f"column {k + 1} without numbers", "a column of numbers"))
            del build.unitless[rows:]
        elif text not in head.ignore:
            build.add(k, heads[k])
    if not table.source.faults:
        only_ones(build)
        if "power" not in columns:
            electrical(build)
        _derive(build, made.rotor.pole_pairs or 1)
    return build.finish()


def _derive(build: Builder, pairs: int) -> None:
    """Mechanical speed from the electrical one, and the flags."""
    build.flag_speeds("rpm", "electrical_rpm", "optical_rpm")
    if "electrical_rpm" in build.channels:
        label = build.free("rpm") if "rpm" not in build.channels else "rpm_from_electrical_rpm"
        build.channels[label] = Channel(build.channels["electrical_rpm"].values / pairs, "rpm")
        less, more = (f"{100.0 * ((pairs + step) / pairs) ** 2 - 100.0:+.0f} %" for step in (-1, 1))
        other = f"; were it {pairs - 1} or {pairs + 1}, CT would be {less} or {more}: count the magnets"
        told = f"{label} is electrical_rpm over {pairs} pole pairs, as the recording says"
        build.warnings.append(told + (other if pairs > 1 else ""))
    build.flag_time()
    if "time_s" in build.channels:
        build.flag_spikes("thrust_N", "torque_Nm", "rpm", "electrical_rpm", "optical_rpm")
    build.check_magnitudes()


def _join(runs: list[Dataset], files: Sequence[str]) -> Dataset:
    """Runs in their order; a channel that a run lacks is NaN there, one in two units has none."""
    if len(runs) == 1:
        return runs[0]
    whole = concat(runs, "+".join(files))
    about = {
        "file": whole.name, "sha256": "+".join(run.sha256 for run in runs), "format": KIND,
        "headings": {k: v for run in runs for k, v in run.headings.items()},
    }  # fmt: skip
    number = np.repeat(np.arange(1.0, len(runs) + 1.0), [len(run) for run in runs])
    notes = tuple(f"{file}: {text}" for file, run in zip(files, runs, strict=True) for text in run.notes)
    return replace(whole, values={**whole.values, "run": number}, provenance=about, notes=notes)

r"""Recorded values of a case: ``references.csv``.

A comma-separated table with a header line; lines that begin with ``#`` are comments::

    quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3
    thrust,2.60,kgf,unknown,cfd,"Cahill 2025, table 1",Fluent; set-up in FACTS,20000,0,1.225

* ``unit`` must be given; ``-`` for dimensionless quantities. Mass units for a force (``kg``, ``g``) are refused.
* ``uncertainty`` is the standard uncertainty (one sigma) in the unit of the value, or the word ``unknown``.
* ``kind`` is one of :data:`KINDS`.
* ``remark``, ``rpm``, ``airspeed_m_s``, ``density_kg_m3`` are optional columns; an empty condition means "as the case
  says".

Nothing suspicious is converted: out-of-range values, an uncertainty larger than its value, and two rows of the same
quantity and condition that differ by just the factor between kgf and N are refused with a hint.
"""

from __future__ import annotations

import csv
import difflib
import io
import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bemt.base import units
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, head_text, load_text, number
from bemt.data.readers.unit_text import unit_of, weighs
from bemt.physics.dataset import Dataset

KIND = "references"
KINDS = ("cfd", "bench", "vendor", "k1k2_printed", "k1k2", "bemt", "flight", "other")
COLUMNS = ("quantity", "value", "unit", "uncertainty", "kind", "source")

QUANTITIES: dict[str, tuple[str, str, float, float]] = {
    "thrust": ("force", "thrust_N", 1e-3, 1e5), "duct_thrust": ("force", "duct_thrust_N", 1e-3, 1e5),
    "torque": ("torque", "torque_Nm", 1e-6, 1e4), "power": ("power", "power_W", 1e-3, 1e6),
    "electrical_power": ("power", "electrical_power_W", 1e-3, 1e6),
    "exhaust_speed": ("speed", "exhaust_speed_m_s", 0.1, 500.0), "airspeed": ("speed", "airspeed_m_s", -100.0, 400.0),
    "rpm": ("angular_speed", "rpm", 10.0, 300000.0),
    "CT": ("", "CT", -1.0, 2.0), "CP": ("", "CP", -1.0, 2.0), "CQ": ("", "CQ", -0.2, 0.4), "J": ("", "J", -2.0, 5.0),
    "eta": ("", "eta", -10.0, 1.0), "FM": ("", "FM", 0.0, 1.5), "duct_share": ("", "duct_share", -1.0, 1.0),
}  # fmt: skip
"""Quantity -> dimension (empty: none), channel of a series, plausible range in SI (rpm for rpm)."""

CONDITIONS: dict[str, tuple[float, float, str]] = {
    "rpm": (10.0, 300000.0, "Is this in rev/s or rad/s?"),
    "airspeed_m_s": (-100.0, 400.0, "Is this in km/h or mph?"),
    "density_kg_m3": (0.01, 1100.0, "Is this in g/cm3?"),
}
"""Optional column -> lowest, highest, hint."""


@dataclass(frozen=True)
class Reference:
    """One recorded value."""

    quantity: str  # As in the file
    value: float  # In SI units (rpm for a rotational speed)
    u: float  # Standard uncertainty in the unit of ``value``; NaN means unknown
    channel: str  # Channel of a series, with its unit: ``thrust_N``
    kind: str  # As in the file
    source: str  # As in the file
    remark: str  # As in the file
    printed: str  # Value and unit as written, for reports: ``2.60 kgf``
    # Condition [rev/min], [m/s], [kg/m3]; NaN means as the case says
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    density_kg_m3: float = math.nan
    where: str = ""  # ``file:line``
    sha256: str = field(default="", repr=False)  # Hash of the file
    setup: Mapping[str, Any] = field(default_factory=dict, repr=False)  # Conditions of a CFD run, by name

    @property
    def condition(self) -> tuple[float | None, float | None, float | None]:
        """Condition (rpm, airspeed, density) with None for NaN, so that equal conditions compare equal."""
        values = (self.rpm, self.airspeed_m_s, self.density_kg_m3)
        rpm, airspeed, density = (None if math.isnan(x) else x for x in values)
        return (rpm, airspeed, density)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the head of a file is a table of references.

    >>> sniff("# case 8x5\nquantity,value,unit,uncertainty,kind,source,remark\n"), sniff("J CT CP eta\n")
    (True, False)
    """
    for line in head_text(head).splitlines():
        if line.strip() and not line.startswith("#"):
            return {"quantity", "value", "unit"} <= {cell.strip().strip('"').lower() for cell in line.split(",")}
    return False


def _near(word: str, known: Iterable[str]) -> str:
    match = difflib.get_close_matches(word, list(known), 1)
    return f"Did you mean {match[0]}?" if match else ""


def _unit_factor(quantity: str, written: str) -> tuple[float, tuple[str, str, str] | None]:
    """Factor to SI (to rpm for a rotational speed), or the fault (got, expected, hint)."""
    dimension, key = QUANTITIES[quantity][0], written.strip()
    known = units.suffixes(dimension) if dimension else ("-", "pct")
    if not key:
        return math.nan, ("no unit", f"one of {', '.join(known)}", "")
    if not dimension:
        factor = {"-": 1.0, "1": 1.0, "pct": 0.01, "%": 0.01}.get(key, math.nan)
        return factor, (f"unit {written!r}", "- (dimensionless)", "") if math.isnan(factor) else None
    parts = re.sub(r"[/ ·*-]", "_", key)
    for form in (parts, parts.replace("_", " "), parts.replace("_", "/")):
        unit = unit_of(form)
        if isinstance(unit, units.Unit) and unit.dimension == dimension:
            return (unit.factor / units.RPM if quantity == "rpm" else unit.factor), None
    weight = weighs(key) if dimension == "force" else ""
    hint = f"A mass is not a force: write {weight}" if weight else _near(parts, known)
    return math.nan, (f"unit {written!r}", f"one of {', '.join(known)}", hint)


@dataclass
class _Row:
    """One line of the table: typed cells, faults with line and column."""

    source: SourceText
    line: int
    header: list[str]
    cells: dict[str, str]

    def fault(self, column: str, got: str, expected: str, hint: str = "") -> None:
        self.source.add(f"{self.line}:{self.header.index(column) + 1}", got, expected, hint)

    def number(self, column: str, expected: str) -> float:
        text = self.cells[column]
        value = number(text)
        if value is not None:
            return value
        unit = bool(text) and number(text.split()[0]) is not None
        hint = "Use a decimal point" if "," in text else "Put the unit into its own column" if unit else ""
        self.fault(column, f"{column} = {text or 'nothing'}", expected, hint)
        return math.nan


def _reference(row: _Row) -> Reference | None:
    """Read one row; None with faults appended when it cannot be used."""
    before = len(row.source.faults)
    quantity, text, unit, uncertainty, kind, source = (row.cells[column] for column in COLUMNS)
    value = row.number("value", "a finite number")
    factor = math.nan
    if quantity not in QUANTITIES:
        row.fault("quantity", f"quantity {quantity!r}", f"one of {', '.join(QUANTITIES)}", _near(quantity, QUANTITIES))
    else:
        factor, fault = _unit_factor(quantity, unit)
        if fault:
            row.fault("unit", *fault)
        _, _, low, high = QUANTITIES[quantity]
        if not math.isnan(value * factor) and not low <= value * factor <= high:
            got = f"{quantity} = {value:g} {unit}"
            row.fault("value", got, f"{low:g} to {high:g} in SI units", "Is the unit right?")
    u = math.nan
    if uncertainty.lower() != "unknown":
        u = row.number("uncertainty", 'a standard uncertainty in the unit of the value, or "unknown"')
        if u <= 0:
            row.fault("uncertainty", f"uncertainty = {u:g}", "a positive number", 'Write "unknown" if nobody stated it')
        elif abs(value) > 0 and u > abs(value):
            hint = "Is it in percent? Give it in the unit of the value"
            row.fault("uncertainty", f"uncertainty = {u:g}", f"less than the value, {abs(value):g}", hint)
    if kind not in KINDS:
        row.fault("kind", f"kind {kind!r}", f"one of {', '.join(KINDS)}", _near(kind, KINDS))
    if not source:
        row.fault("source", "no source", "where the value comes from", "")
    conditions: dict[str, float] = {}
    for column, (low, high, hint) in CONDITIONS.items():
        if row.cells.get(column):
            conditions[column] = row.number(column, f"a number from {low:g} to {high:g}, or an empty cell")
            if not math.isnan(conditions[column]) and not low <= conditions[column] <= high:
                row.fault(column, f"{column} = {conditions[column]:g}", f"{low:g} to {high:g}", hint)
    if len(row.source.faults) > before:
        return None
    return Reference(
        quantity, value * factor, u * factor, QUANTITIES[quantity][1], kind, source, row.cells.get("remark", ""),
        f"{text} {unit}".removesuffix(" -"), where=f"{row.source.name}:{row.line}",
        sha256=row.source.sha256,
        **conditions,  # type: ignore[arg-type]
    )  # fmt: skip


def _compare(source: SourceText, references: list[Reference]) -> None:
    """Rows of the same quantity and condition: repeats, and slips between kgf and N."""
    for i, one in enumerate(references):
        for other in references[:i]:
            if (one.quantity, one.condition) != (other.quantity, other.condition):
                continue
            line, earlier = (r.where.rsplit(":", 1)[1] for r in (one, other))
            if (one.kind, one.source, one.value) == (other.kind, other.source, other.value):
                source.add(line, f"the row of line {earlier} again", "each value once", "Delete one of them")
            elif QUANTITIES[one.quantity][0] == "force" and min(abs(one.value), abs(other.value)) > 0:
                ratio = abs(one.value / other.value)
                if abs(max(ratio, 1 / ratio) / units.KGF - 1) < 0.005:
                    got = f"{one.printed} where line {earlier} has {other.printed}"
                    source.add(line, got, "values in their own units", "They differ by 9.81: is one kgf and one N?")


def _header(source: SourceText, line: int, cells: list[str]) -> list[str]:
    """Names of the columns, all of them there and known."""
    header = [cell.strip() for cell in cells]
    known = (*COLUMNS, "remark", *CONDITIONS)
    hint = "Separate columns by commas" if ";" in "".join(cells) or "\t" in "".join(cells) else ""
    for name in COLUMNS:
        if name not in header:
            source.add(line, f"no column {name}", f"the columns {', '.join(COLUMNS)}", hint)
    for index, name in enumerate(header):
        twice = name in header[:index]
        if name not in known or twice:
            got, expected = f"column {name!r}" + (" twice" if twice else ""), f"one of {', '.join(known)}"
            source.add(f"{line}:{index + 1}", got, expected, hint or _near(name, known))
    source.check()
    return header


def read(path: str | os.PathLike[str]) -> list[Reference]:
    """Read a table of references."""
    source = load_text(path)
    if not source.text.strip():
        source.refuse("", "an empty file", f"a table with the columns {', '.join(COLUMNS)}")
    # comments become empty lines, so that line numbers stay those of the file
    text = "\n".join("" if line.startswith("#") else line for line in source.lines)
    reader = csv.reader(io.StringIO(text), skipinitialspace=True)
    references: list[Reference] = []
    header: list[str] = []
    try:
        rows = [(reader.line_num, cells) for cells in reader]
    except csv.Error as error:
        source.refuse(reader.line_num, str(error), "cells of some words")
    for line, cells in rows:
        if not any(cell.strip() for cell in cells):
            continue
        if not header:
            header = _header(source, line, cells)
        elif len(cells) != len(header):
            hint = "Quote cells that hold a comma" if len(cells) > len(header) else "Write empty cells too"
            source.add(line, number_of(len(cells), "cell"), number_of(len(header), "cell"), hint)
        else:
            row = dict(zip(header, (cell.strip() for cell in cells), strict=True))
            if reference := _reference(_Row(source, line, header, row)):
                references.append(reference)
    _compare(source, references)
    if not references and not source.faults:
        source.add("", "no rows", "one recorded value or more")
    source.check()
    return references


def to_series(references: Iterable[Reference], name: str) -> list[Dataset]:
    """Group references into series, one per kind and source."""
    groups: dict[tuple[str, str], list[dict[str, Reference]]] = {}
    for ref in references:
        points = groups.setdefault((ref.kind, ref.source), [])
        fit = (p for p in points if ref.channel not in p and next(iter(p.values())).condition == ref.condition)
        if (point := next(fit, None)) is None:
            points.append(point := {})
        point[ref.channel] = ref
    return [_series(kind, name, source, points) for (kind, source), points in groups.items()]


def _series(kind: str, name: str, source: str, points: list[dict[str, Reference]]) -> Dataset:
    """Points of one kind and source, each its references by channel, as a series."""
    firsts = [next(iter(point.values())) for point in points]
    channels = dict.fromkeys(channel for point in points for channel in point)
    values = {c: np.array([p[c].value if c in p else math.nan for p in points]) for c in channels}
    u = {c: np.array([p[c].u if c in p else math.nan for p in points]) for c in channels}
    stated = {c: np.array([getattr(first, c) for first in firsts]) for c in CONDITIONS if c not in values}
    values |= {c: v for c, v in stated.items() if not np.all(np.isnan(v))}
    remarks = dict.fromkeys(ref.remark for point in points for ref in point.values() if ref.remark)
    file = firsts[0].where.rsplit(":", 1)[0]
    provenance = {"source": source, "file": file, "sha256": firsts[0].sha256, "remark": "; ".join(remarks)}
    return Dataset(kind, name, values, u, (), provenance, tuple(first.where for first in firsts))

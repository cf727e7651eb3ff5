r"""OpenFOAM ``postProcessing`` tables: forces and moments of both layouts, coefficients, other named columns.

New layout (``force.dat``, ``moment.dat``)::

    # Force
    # CofR          : (0 0 0)
    # Time          total_x total_y total_z  pressure_x pressure_y pressure_z  viscous_x viscous_y viscous_z

Old layout (``forces.dat``), no totals, which are added here over pressure, viscous and porous::

    # Time       forces(pressure viscous porous) moments(pressure viscous porous)
    10  ((-222 119 0) (2.1 -1.4 0) (0 0 0)) ((0 0 -263) (0 0 0.4) (0 0 0))

Forces are in newtons if ``rhoInf`` was the density (incompressible solvers multiply by what the user gave). ``Time``
counts iterations in a steady run; whole-number times are taken for that, with a warning.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field, replace

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, load_text
from bemt.data.readers.cfd import Column, ExportRow, ExportTable, head_lines, history, numeric_table
from bemt.physics.dataset import Dataset

KIND = "openfoam_forces"

_TIME = re.compile(r"#\s*Time\b(?!\s+patch\b)(.*)")
_NESTED = re.compile(r"(\w+)\(([^()]*)\)")
_SETTING = re.compile(r"#\s*(\w+)\s*:\s*(.+)")
_PROPELLER: dict[str, tuple[str, str, float]] = {
    "n": ("rpm", "rpm", 60.0), "URef": ("airspeed_m_s", "m_s", 1.0), "J": ("J", "-", 1.0), "KT": ("CT", "-", 1.0),
    "10*KQ": ("CQ", "-", 0.1), "eta0": ("eta", "-", 1.0),
}  # fmt: skip
"""Columns of ``propellerInfo``: channel, unit, factor."""
_PART = re.compile(r"(\w+)_(\w+)_([xyz])_(Nm?)")
_EXPECTED = "a header such as # Time total_x total_y total_z"
_VECTOR = re.compile(r"\(\s*((?:\w+_[xyz]\s*){3})\)")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a comment line begins with Time and names columns.

    >>> sniff("# Force\n# Time  total_x total_y\n1 2 3"), sniff("# Time\n"), sniff("#  Time  forces(pressure viscous)")
    (True, False, True)
    """
    lines = [line for line in head_lines(head) if line.startswith("#")]
    return any((m := _TIME.fullmatch(line)) and m[1].strip() for line in lines)


@dataclass
class _Head:
    """Comment lines: title, settings, the line of columns."""

    source: SourceText
    title: str = ""
    columns: str = ""
    repeated: int = 0
    settings: dict[str, str] = field(default_factory=dict)

    def take(self, line: int, text: str) -> None:
        """Read one of them."""
        if (time := _TIME.fullmatch(text)) and (found := " ".join(time[1].split())):
            if self.columns not in ("", found):
                self.source.refuse(line, "another header", "the first one", "Split the file there")
            self.repeated += bool(self.columns)
            self.columns = found
        elif setting := _SETTING.fullmatch(text):
            self.settings[setting[1]] = setting[2].strip()
        elif not self.title:
            self.title = text.strip("# \t")


def _columns(top: _Head) -> tuple[list[Column], str]:
    """Columns of a header, and the parentheses of a row with one mark for each cell; "" for a row that needs none."""
    time, header = Column("Time", "", "time"), top.columns
    nested = _NESTED.findall(header)
    if nested and all(re.fullmatch(r"(local)?(forces?|moments?)", name, re.IGNORECASE) for name, _ in nested):
        groups = [(name.lower().removesuffix("s"), re.split(r"[,\s]+", parts.strip())) for name, parts in nested]
        names = [f"{name}_{part}_{axis}" for name, parts in groups for part in parts for axis in "xyz"]
        return [time, *map(_load, names)], "n" + "".join(f"({'(nnn)' * len(parts)})" for _, parts in groups)
    names = _VECTOR.sub(r"\1", header).split()
    kind = top.title.strip().lower().removesuffix("s")
    if kind in ("force", "moment") and all(re.fullmatch(r"\w+_[xyz]", name) for name in names):
        return [time, *(_load(f"{kind}_{name}") for name in names)], ""
    return [time, *map(Column, names)], ""


def _load(name: str) -> Column:
    unit = "Nm" if name.partition("_")[0].endswith("moment") else "N"
    return Column(f"{name}_{unit}", unit)


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a table of ``postProcessing``."""
    source = load_text(path)
    top = _Head(source)
    rows: list[tuple[int, str]] = []
    for line, text in ((k, raw.strip()) for k, raw in enumerate(source.lines, 1)):
        if text.startswith("#"):
            top.take(line, text)
        elif text and not top.columns:
            source.refuse(line, repr(text[:60]), _EXPECTED, "Is the header damaged?")
        elif text:
            rows.append((line, text))
    header, about = top.columns, {"title": top.title, **top.settings}
    if not header:
        source.refuse("", "no header", _EXPECTED)
    if "bins" in about or re.search(r"\[\d+\]\(|_\d+_[xyz]\b", header):
        hint = "Their sum is in the forces (or force and moment) file in the same folder"
        source.refuse("", "forces in bins along a direction", "forces of the whole", hint)
    notes = [f"header repeated {number_of(top.repeated, 'time')}: the run was restarted"] if top.repeated else []
    columns, shape = _columns(top)
    table = numeric_table(source, columns, [_row(line, text, shape, len(columns)) for line, text in rows], commas=False)
    if {"KT", "10*KQ"} <= {c.name for c in columns}:
        own = [_PROPELLER.get(c.name, (c.name, c.unit, 1.0)) for c in columns]
        table = replace(table, values=table.values * np.array([factor for _, _, factor in own]))
        columns = [replace(c, name=name, unit=unit) for c, (name, unit, _) in zip(columns, own, strict=True)]
    return _record(source, columns, table, about, notes)


def _row(line: int, text: str, shape: str, width: int) -> ExportRow:
    """Cells of a row; one with other parentheses than its header has is damaged, so that it is not shifted."""
    parts = re.findall(r"[()]|[^()\s]+", text)
    cells = tuple(p for p in parts if p not in "()")
    own = "".join(p if p in "()" else "n" for p in parts)
    right = own == shape if shape else own.replace("(nnn)", "nnn") == "n" * len(cells)
    return ExportRow(line, cells if right or len(cells) != width else (*cells[:-1], "damaged parentheses"))


def _record(
    source: SourceText, columns: list[Column], table: ExportTable, about: dict[str, str], notes: list[str]
) -> Dataset:
    times = table.values[:, 0]
    known = times[np.isfinite(times)]
    if known.size and np.all(known == np.round(known)):
        columns = [replace(columns[0], role="step"), *columns[1:]]
        notes.append("whole-number times are taken for iterations of a steady run")
    else:
        columns = [Column("time_s", "s", "time"), *columns[1:]]
    if any(c.unit in ("N", "Nm") for c in columns):
        notes.append("newtons only if rhoInf was the density; if not: --reference density=RHOINF --density-kg-m3 RHO")
        notes.append("of the patches of the function object: of one of N sectors, --sector N")
        columns, table = _totals(columns, table, notes)
    elif "magUInf" in about or any(c.name in ("Cd", "Cl", "CmPitch") for c in columns):
        settings = ", ".join(f"{k} {about[k]}" for k in ("magUInf", "lRef", "Aref") if k in about)
        told = f": {settings}" if settings else " that the file does not state"
        notes.append(f"coefficients rest on reference values{told}")
    return history(KIND, source, columns, table, notes, about)


def _totals(columns: list[Column], table: ExportTable, notes: list[str]) -> tuple[list[Column], ExportTable]:
    """Sums over pressure, viscous and porous: added in the old layout, compared with the totals of the new one."""
    loads = [(m.groups(), table.values[:, k]) for k, c in enumerate(columns) if (m := _PART.fullmatch(c.name))]
    more: dict[Column, Array] = {}
    for base, axis, unit in dict.fromkeys((base, axis, unit) for (base, _, axis, unit), _ in loads):
        own = {part: v for (of, part, along, _), v in loads if (of, along) == (base, axis)}
        total, name = own.pop("total", None), f"{base}_total_{axis}_{unit}"
        with np.errstate(over="ignore", invalid="ignore"):
            whole = np.sum([*own.values()], axis=0) if own else np.nan
            if total is None:
                more[Column(name, unit)] = np.where(np.isfinite(whole), whole, np.nan)
            elif {"pressure", "viscous"} <= own.keys():
                size = np.abs(own["pressure"]) + np.abs(own["viscous"])
                off = np.flatnonzero(np.abs(total - whole) > 1e-4 * size)
                where = f"{number_of(off.size, 'row')} (first: line {table.lines[off[0]]})" if off.size else ""
                notes += [f"{name} is not the sum of its parts in {where}"] if where else []
    return [*columns, *more], replace(table, values=np.column_stack([table.values, *more.values()]))

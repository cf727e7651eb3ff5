r"""OpenFOAM ``postProcessing`` tables: forces and moments of both layouts, coefficients, y+, other named columns.

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
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bemt.base.averaging import Mean
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, load_text
from bemt.data.readers.cfd import Column, ExportRow, ExportTable, head_lines, history, numeric_table
from bemt.data.readers.samples import Channel, dataset
from bemt.physics.dataset import Dataset

KIND = "openfoam_forces"

_TIME = re.compile(r"#\s*Time\b(.*)")
_PROBE = re.compile(r"#\s*Probe\s+(\d+)\s+\(([^()]*)\)")
_NESTED = re.compile(r"(\w+)\(([^()]*)\)")
_SETTING = re.compile(r"#\s*(\w+)\s*:\s*(.+)")
_PROPELLER: dict[str, tuple[str, str, float]] = {
    "n": ("rpm", "rpm", 60.0), "URef": ("airspeed_m_s", "m_s", 1.0), "J": ("J", "-", 1.0), "KT": ("CT", "-", 1.0),
    "10*KQ": ("CQ", "-", 0.1), "eta0": ("eta", "-", 1.0),
}  # fmt: skip
"""Columns of ``propellerInfo``: channel, unit, factor."""
_PARTS = ("total", "pressure", "viscous", "porous", "internal")
_DAMAGED = "damaged parentheses"
_VECTOR = re.compile(r"\(\s*((?:\w+_[xyz]\s*){3})\)")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a comment line begins with Time and names columns.

    >>> sniff("# Force\n# Time  total_x total_y\n1 2 3"), sniff("# Time\n"), sniff("#  Time  forces(pressure viscous)")
    (True, False, True)
    """
    lines = [line for line in head_lines(head) if line.startswith("#")]
    return any(_PROBE.match(line) or ((m := _TIME.fullmatch(line)) and m[1].strip()) for line in lines)


@dataclass
class _Head:
    """Comment lines: title, settings, probes and their places, the line of columns."""

    source: SourceText
    title: str = ""
    columns: str = ""
    repeated: int = 0
    settings: dict[str, str] = field(default_factory=dict)
    probes: dict[str, str] = field(default_factory=dict)

    def take(self, line: int, text: str) -> None:
        """Read one of them."""
        if probe := _PROBE.match(text):
            self.probes[probe[1]] = probe[2]
        elif (time := _TIME.fullmatch(text)) and (time[1].strip() or self.probes):
            found = " ".join(time[1].split())
            if found and self.columns not in ("", found):
                self.source.refuse(line, "another header", "the first one", "Split the file there")
            self.repeated += bool(found and self.columns)
            self.columns = found or f"probes {' '.join(self.probes)}"
        elif setting := _SETTING.fullmatch(text):
            self.settings[setting[1]] = setting[2].strip()
        elif not self.title:
            self.title = text.strip("# \t")


def _columns(header: str, title: str) -> tuple[list[Column], list[tuple[str, list[str]]]]:
    """Columns of a header, and in the old layout its groups with their parts."""
    time, nested = Column("Time", "", "time"), _NESTED.findall(header)
    if nested and all(re.fullmatch(r"(local)?(forces?|moments?)", name, re.IGNORECASE) for name, _ in nested):
        groups = [(name.lower().removesuffix("s"), re.split(r"[,\s]+", parts.strip())) for name, parts in nested]
        names = [f"{name}_{part}_{axis}" for name, parts in groups for part in parts for axis in "xyz"]
        return [time, *map(_load, names)], groups
    names = _VECTOR.sub(r"\1", header).split()
    kind = title.strip().lower().removesuffix("s")
    if kind in ("force", "moment") and all(re.fullmatch(r"\w+_[xyz]", name) for name in names):
        return [time, *(_load(f"{kind}_{name}") for name in names)], []
    return [time, *map(Column, names)], []


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
            expected = "a header such as # Time total_x total_y total_z"
            source.refuse(line, repr(text[:60]), expected, "Is the header damaged?")
        elif text:
            rows.append((line, text))
    header, about, probes = top.columns, {"title": top.title, **top.settings}, top.probes
    if not header:
        source.refuse("", "no header", "a header such as # Time total_x total_y total_z")
    if "bins" in about or re.search(r"\[\d+\]\(|_\d+_[xyz]\b", header):
        hint = "Their sum is in the forces (or force and moment) file in the same folder"
        source.refuse("", "forces in bins along a direction", "forces of the whole", hint)
    notes = [f"header repeated {number_of(top.repeated, 'time')}: the run was restarted"] if top.repeated else []
    if header.split()[0] == "patch":
        return _by_patch(source, header.split(), rows, about, notes)
    if probes:
        return _probes(source, probes, rows, notes)
    columns, groups = _columns(header, top.title)
    table = numeric_table(source, columns, _rows(rows, len(columns), groups), commas=False)
    if groups:
        columns, table = _totals(columns, table, groups)
    if {"KT", "10*KQ"} <= {c.name for c in columns}:
        own = [_PROPELLER.get(c.name, (c.name, c.unit, 1.0)) for c in columns]
        table = replace(table, values=table.values * np.array([factor for _, _, factor in own]))
        columns = [replace(c, name=name, unit=unit) for c, (name, unit, _) in zip(columns, own, strict=True)]
    return _record(source, columns, table, about, notes)


def _rows(rows: Sequence[tuple[int, str]], width: int, groups: list[tuple[str, list[str]]]) -> list[ExportRow]:
    """Cells of the rows; a row with other parentheses than its header has gets none, so that it is not shifted."""
    out = []
    wanted = "n" + "".join(f"({'(nnn)' * len(parts)})" for _, parts in groups)
    for line, text in rows:
        cells, shape = _cells(text)
        if (shape != wanted if groups else shape.replace("(nnn)", "nnn") != "n" * len(cells)) and len(cells) == width:
            cells = (*cells[:-1], _DAMAGED)
        out.append(ExportRow(line, cells))
    return out


def _totals(
    columns: list[Column], table: ExportTable, groups: list[tuple[str, list[str]]]
) -> tuple[list[Column], ExportTable]:
    """Add the totals that the old layout does not have."""
    new: list[Column] = []
    sums = []
    at = 1
    for name, parts in groups:
        block = table.values[:, at : at + 3 * len(parts)].reshape(len(table.values), len(parts), 3)
        unit = columns[at].unit
        for k, axis in enumerate("xyz"):
            new.append(Column(f"{name}_total_{axis}_{unit}", unit))
            with np.errstate(over="ignore", invalid="ignore"):
                total = block[:, :, k].sum(axis=1)
            sums.append(np.where(np.isfinite(total), total, np.nan))
        at += 3 * len(parts)
    return [*columns, *new], replace(table, values=np.column_stack([table.values, *sums]))


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
        for axis in "xyz":
            notes += _balance(columns, table, axis)
    elif "magUInf" in about or any(c.name in ("Cd", "Cl", "CmPitch") for c in columns):
        settings = ", ".join(f"{k} {about[k]}" for k in ("magUInf", "lRef", "Aref") if k in about)
        told = f": {settings}" if settings else " that the file does not state"
        notes.append(f"coefficients rest on reference values{told}")
    return history(KIND, source, columns, table, notes, about)


def _balance(columns: list[Column], table: ExportTable, axis: str) -> list[str]:
    """Total against the sum of its parts, where all are recorded: shows swapped or damaged columns."""
    notes = []
    by_name = {c.name: table.values[:, k] for k, c in enumerate(columns)}
    for base, unit in (("force", "N"), ("moment", "Nm")):
        total, pressure, viscous, porous, internal = (by_name.get(f"{base}_{part}_{axis}_{unit}") for part in _PARTS)
        if total is None or pressure is None or viscous is None:
            continue
        third = internal if porous is None else porous
        with np.errstate(over="ignore", invalid="ignore"):
            sums = pressure + viscous + (0.0 if third is None else third)
            off = np.flatnonzero(np.abs(total - sums) > 1e-4 * (np.abs(pressure) + np.abs(viscous)))
        if off.size:
            where = f"{number_of(off.size, 'row')} (first: line {table.lines[off[0]]})"
            notes.append(f"{base}_total_{axis}_{unit} is not the sum of its parts in {where}")
    return notes


def _by_patch(
    source: SourceText, names: list[str], rows: Sequence[tuple[int, str]], about: dict[str, str], notes: list[str]
) -> Dataset:
    """Table with a patch in the second column (yPlus): one channel for each patch and column."""
    columns = [Column("Time", "", "step"), *(Column(name) for name in names[1:])]
    patches: dict[str, list[ExportRow]] = {}
    for line, text in rows:
        cells = text.split()
        patches.setdefault(cells[1] if len(cells) > 1 else "?", []).append(ExportRow(line, (cells[0], *cells[2:])))
    channels: dict[str, Channel] = {}
    prefix = "y_plus" if "y+" in about.get("title", "") else about.get("title", "").strip() or "value"
    for patch, data in patches.items():
        record = history(KIND, source, columns, numeric_table(source, columns, data, commas=False))
        notes += [f"{patch}: {text}" for text in record.notes]
        for name in names[1:]:
            values = record[name]
            mean = Mean(float(values[-1]), "last row") if np.isfinite(values[-1]) else None
            channels[f"{prefix}_{name}({patch})"] = Channel(values, "", mean)
    if not channels:
        source.refuse("", "no rows", "one patch or more")
    about = {**source.about, **about, "clock": "none"}
    return dataset(KIND, "cfd", channels, notes, about)


def _probes(source: SourceText, probes: dict[str, str], rows: Sequence[tuple[int, str]], notes: list[str]) -> Dataset:
    """Field at points over time: one channel for each probe and component; the field is named by the file's name."""
    vector = bool(rows) and "(" in rows[0][1]
    parts = ("_x", "_y", "_z") if vector else ("",)
    columns = [Column("Time", "", "time"), *(Column(f"value{p}(probe {k})") for k in probes for p in parts)]
    wanted = "n" + ("(nnn)" if vector else "n") * len(probes)
    cells = []
    for line, text in rows:
        row, shape = _cells(text)
        cells.append(ExportRow(line, row if shape == wanted else (*row[:-1], _DAMAGED)))
    table = numeric_table(source, columns, cells, commas=False)
    where = "; ".join(f"probe {k} at ({at})" for k, at in probes.items())
    return _record(source, columns, table, {"title": "probes", "probes": where}, [*notes, "the file states no unit"])


def _cells(text: str) -> tuple[tuple[str, ...], str]:
    """Cells of a row, and its parentheses with one mark for each cell."""
    parts = re.findall(r"[()]|[^()\s]+", text)
    return tuple(p for p in parts if p not in "()"), "".join(p if p in "()" else "n" for p in parts)

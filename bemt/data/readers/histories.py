r"""Histories that CFD programs write while they run: one row of :data:`READERS` for each program.

Fluent report files (``thrust-rfile.out``) have three header lines, the second abbreviated. Steady files count
"Iteration" and have no flow-time; columns of several zones are ``"name(zone)"`` and stay apart. No units, except that
flow-time is in seconds. Rows of a report definition with average-over above 1 are running averages already; the file
does not say so. Forces are projected on the vector the user gave: the sign is that of the file::

    "thrust-rfile"
    "Time Step" "thrust etc.."
    ("Time Step" "thrust" "torque" "flow-time")
    101 9.81 0.12 0.0519

Old Fluent monitors (``cd-1-history``) have a title, a line of quoted names, rows; no third header line::

    "Drag Convergence"
    "Flow Time" "cd"
    5.00000e-03     7.61066e-02

STAR-CCM+ monitors and plots as CSV have quoted headings with the unit in parentheses. Steady runs count "Iteration";
implicit unsteady ones have "Physical Time: Physical Time (s)". What stands before " Monitor:" is the name::

    "Iteration","Thrust 1 Monitor: Thrust (N)","Torque 1 Monitor: Moment (N-m)"

SU2 pads quoted names with blanks (CSV, or its Tecplot form). Coefficients rest on reference values (``RefForce`` when
it is written). A dual-time run keeps the last inner iteration of each time step; with ``Cur_Time`` it is a history by
time. Older versions head the first column "Iteration", as STAR-CCM+ does; coefficients and residuals tell them apart::

    "Time_Iter","Outer_Iter","Inner_Iter",     "rms[Rho]"     ,       "CD"       , ...

Flow360 (``total_forces_v2.csv``) has coefficients by physical and pseudo step: a steady run counts pseudo steps, of a
transient one the last pseudo step of each physical step holds. They rest on reference values of the case::

    physical_step, pseudo_step, CL, CD, CFx, CFy, CFz, CMx, CMy, CMz, CLPressure, ...

OpenFOAM (``postProcessing``) names columns in a comment, below a title and settings: forces and moments, coefficients,
propellerInfo, other named columns. The old layout has no totals, which are added over pressure, viscous and porous.
Forces are in newtons if ``rhoInf`` was the density (incompressible solvers multiply by what the user gave). ``Time``
counts iterations in a steady run; whole-number times are taken for that, with a warning::

    # Force
    # CofR          : (0 0 0)
    # Time          total_x total_y total_z  pressure_x pressure_y pressure_z  viscous_x viscous_y viscous_z

    # Time       forces(pressure viscous porous) moments(pressure viscous porous)
    10  ((-222 119 0) (2.1 -1.4 0) (0 0 0)) ((0 0 -263) (0 0 0.4) (0 0 0))
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import SourceText, load_text
from bemt.data.readers.cfd import Column, ExportRow, ExportTable, cells_of, head_lines, history, numeric_table, si_unit
from bemt.physics.dataset import Dataset

Cells = Callable[[str], tuple[str, ...]]
Read = tuple[list[Column], ExportTable]


@dataclass(frozen=True)
class Layout:
    """How one program writes a history: a reader of that program."""

    KIND: str
    example: str  # of a header, for messages
    header: Callable[[str], Sequence[str] | None]  # names on a line of headings; None on any other line
    mark: str | None = None  # between the cells of a row; None: blanks, and a decimal comma is possible
    brackets: str = "["  # of the unit in a heading; "": none has one
    skip: str = "(?!)"  # lines that are neither headings nor rows; the first is a title
    notes: tuple[str, ...] = ()
    hint: str = "Is the header damaged?"  # where a row comes before the headings
    finish: Callable[[list[Column], ExportTable, list[str], dict[str, str]], Read] | None = None
    setting: str = "(?!)"  # lines to skip that state something: its name, its value
    columns: Callable[[SourceText, Sequence[str], dict[str, str]], list[Column]] | None = None  # not each by its words
    cells: Callable[[Sequence[str]], Cells] | None = None  # of rows under these headings, where no mark parts them
    within: int = 1  # first lines that may be the header, for the sniffer
    told: Callable[[list[str]], bool] | None = None  # by its first lines, where a header alone does not tell

    def sniff(self, head: bytes | str) -> bool:
        """Tell whether one of the first lines is a header of this program."""
        lines = head_lines(head, self.within)
        return self.told(lines) if self.told else any(self.header(line) is not None for line in lines)

    def read(self, path: str | os.PathLike[str]) -> Dataset:
        """Read a history: headings that may be repeated by a restart, rows, lines to skip; all faults at once."""
        source, about = load_text(path), {"title": ""}
        names, rows, repeated = self._parted(source, about)
        if names and not rows:
            source.add("", f"a header ({', '.join(names)}) and no rows", "one row or more", "Did the run write a step?")
        if not rows:
            source.check()
        own = self.columns(source, names, about) if self.columns else None
        columns = own or [column_of(name, self.brackets) for name in names]
        table = numeric_table(source, columns, rows, commas=self.mark is None and self.cells is None)
        source.check()
        again = f"header repeated in line {', '.join(map(str, repeated[:5]))}: the run was restarted"
        notes = [*([again] if repeated else []), *self.notes]
        if self.finish is not None:
            columns, table = self.finish(columns, table, notes, about)
        return history(self.KIND, source, columns, table, notes, about)

    def _parted(self, source: SourceText, about: dict[str, str]) -> tuple[list[str], list[ExportRow], list[int]]:
        """Names of the columns, rows, and lines that repeat the header; what other lines state goes into `about`."""
        names, rows, repeated, early = list[str](), list[ExportRow](), list[int](), False
        cells: Cells = lambda text: cells_of(text, self.mark)  # noqa: E731
        for line, raw in enumerate(source.lines, 1):
            text = raw.strip()
            found = self.header(text) if text else None
            if found is not None and not names:
                names = list(found)
                cells = self.cells(names) if self.cells else cells
            elif found is not None and list(found) == names:
                repeated.append(line)
            elif found is not None:
                got, expected = f"another header ({', '.join(found)})", f"the first one ({', '.join(names)})"
                source.add(line, got, expected, "Split the file there")
                break
            elif not text or re.match(self.skip, text):
                if setting := re.fullmatch(self.setting, text):
                    about[setting[1]] = setting[2].strip()
                else:
                    about["title"] = about["title"] or text.strip('"# \t')
            elif names:
                rows.append(ExportRow(line, cells(text)))
            elif not early:
                early = True
                source.add(line, repr(text[:60]), f"a header such as {self.example}", self.hint)
        if not names and not early:
            source.add("", "no header", f"a line such as {self.example}")
        return names, rows, repeated


# ---------------------------------------------------------------- Fluent

_QUOTED = re.compile(r'"([^"]*)"')
_REPORT = re.compile(r'\(\s*(?:"[^"]*"\s*)+\)')
_MONITOR = re.compile(r'"[^"]*"(?:\s+"[^"]*")+')
_NAMED = {"[": r"(?P<name>.+?)\s*\[\s*(?P<unit>[^\[\]]+?)\s*\]",
          "(": r"(?P<name>.*?)( Monitor(: [^()]*?)?)?( ?\((?P<unit>[^()]*)\))?"}  # fmt: skip
"""Name and unit of a heading, by the brackets of its unit; STAR-CCM+ has what it is of after the name."""
_ROLES = {
    **dict.fromkeys(("time step", "time-step", "iteration", "iterations"), "step"),
    **dict.fromkeys(("flow time", "flow-time", "physical time", "physical-time", "time", "cur_time"), "time"),
    **dict.fromkeys(("time_iter", "outer_iter", "inner_iter", "physical_step", "pseudo_step"), "counter"),
    "delta-time": "step_size", "time(min)": "wall", "time(sec)": "wall",
}  # fmt: skip


def column_of(text: str, brackets: str = "[") -> Column:
    """Make the column of a heading in any program's words; times are in seconds, "" is for headings without a unit.

    >>> column_of("flow-time").name, column_of("Iteration").role, column_of("thrust(blade:1)").role
    ('time_s', 'step', 'value')
    >>> column_of("Thrust 1 Monitor: Thrust (N)", "("), column_of("Time_Iter", "").role
    (Column(name='Thrust 1', unit='N', role='value'), 'counter')
    """
    text = text.strip()
    found = re.fullmatch(_NAMED[brackets], text) if brackets else None
    name, unit = (found["name"], found["unit"] or "") if found else (text, "")
    first, _, again = name.partition(": ")
    role = _ROLES.get((first if again == first else name).lower(), "value")
    if role in ("time", "step_size") and unit in ("", "s"):
        return Column("time_s" if role == "time" else "delta_time_s", "s", role)
    if role not in ("time", "step_size", "value"):
        return Column(first, "", role)
    return Column((name if brackets == "(" else text) or "unnamed", si_unit(unit) or unit)


def _report(lines: list[str]) -> bool:
    """A parenthesised list of quoted names, or an abbreviated one, under a quoted title."""
    if not lines or not lines[0].startswith('"') or '",' in lines[0]:
        return False
    return any(line.startswith('("') or line.endswith(' etc.."') for line in lines[1:])


def _monitor(lines: list[str]) -> bool:
    """A quoted title, a line of quoted names, and then a number."""
    return (
        len(lines) > 1
        and re.fullmatch(r'"[^"]*"', lines[0]) is not None
        and _MONITOR.fullmatch(lines[1]) is not None
        and not lines[1].endswith(' etc.."')
        and (len(lines) < 3 or re.match(r"[-+.\d]", lines[2]) is not None)
    )


def _checked(columns: list[Column], table: ExportTable, notes: list[str], _: dict[str, str]) -> Read:
    if any(c.role == "value" and not c.unit for c in columns):
        notes.append("report files state no units, reference values, sector or sign convention: check them")
    if not any(c.role in ("step", "time") for c in columns):
        notes.append("no column counts steps or time: rows are taken in their order")
    return columns, table


# ---------------------------------------------------------------- STAR-CCM+, SU2, Flow360

_SU2 = re.compile(
    r'(VARIABLES\s*=\s*)?"\s*((Time|Outer|Inner)_Iter\s*"\s*,|Iteration\s*",(?=.*"\s*(C[DL]|Res_|rms\[)))',
    re.IGNORECASE,
)


def _commas(line: str) -> tuple[str, ...]:
    return cells_of(line, ",")


def _star_names(line: str) -> tuple[str, ...] | None:
    """Headings of monitors under a clock of STAR-CCM+.

    >>> _star_names('"Iteration","Thrust 1 Monitor: Thrust (N)"'), _star_names('"Iteration","CL","CD"')
    (('Iteration', 'Thrust 1 Monitor: Thrust (N)'), None)
    """
    own = line.startswith(("Physical Time: ", '"Physical Time: ')) or " Monitor" in line
    return _commas(line) if own and any(column_of(cell, "(").role != "value" for cell in _commas(line)) else None


def _outermost(columns: list[Column], table: ExportTable, notes: list[str], _: dict[str, str]) -> Read:
    """Let the outermost counter that counts be the step; rows of inner iterations of one time step repeat it."""
    counters = [k for k, c in enumerate(columns) if c.role == "counter"]
    counting = [k for k in counters if len(np.unique(table.values[:, k])) > 1]
    steps = counting[:1] or counters[-1:]
    if len(counting) > 1:
        notes.append(f"the last {columns[counting[-1]].name} of each {columns[counting[0]].name} is taken")
    for k in counters:
        columns[k] = Column(columns[k].name, "", "step" if k in steps else "counter")
    return columns, table


# ---------------------------------------------------------------- OpenFOAM

_TIME = re.compile(r"#\s*Time\b(?!\s+patch\b)(.*)")
_NESTED = re.compile(r"(\w+)\(([^()]*)\)")
_LOAD = re.compile(r"(local)?(forces?|moments?)", re.IGNORECASE)
_VECTOR = re.compile(r"\(\s*((?:\w+_[xyz]\s*){3})\)")
_PROPELLER: dict[str, tuple[str, str, float]] = {
    "n": ("rpm", "rpm", 60.0), "URef": ("airspeed_m_s", "m_s", 1.0), "J": ("J", "-", 1.0), "KT": ("CT", "-", 1.0),
    "10*KQ": ("CQ", "-", 0.1), "eta0": ("eta", "-", 1.0),
}  # fmt: skip
"""Columns of ``propellerInfo``: channel, unit, factor."""
_PART = re.compile(r"(\w+)_(\w+)_([xyz])_(Nm?)")


def _foam_header(line: str) -> list[str] | None:
    """Time, and the columns or groups of columns that a comment names; None for any other line.

    >>> _foam_header("# Time total_x total_y"), _foam_header("# Time"), _foam_header("# Time forces(pressure viscous)")
    (['Time', 'total_x', 'total_y'], None, ['Time', 'forces(pressure viscous)'])
    """
    time = _TIME.fullmatch(line)
    header = " ".join(time[1].split()) if time else ""
    groups = _NESTED.findall(header)
    if groups and all(_LOAD.fullmatch(name) for name, _ in groups):
        return ["Time", *(f"{name}({parts})" for name, parts in groups)]
    return ["Time", *_VECTOR.sub(r"\1", header).split()] if header else None


def _foam_groups(names: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Load and its parts of each group of vectors; [] for columns that stand alone."""
    found = [_NESTED.fullmatch(name) for name in names[1:]]
    return [
        (m[1].lower().removesuffix("s"), re.split(r"[,\s]+", m[2].strip()))
        for m in found
        if m and _LOAD.fullmatch(m[1])
    ]


def _foam_columns(source: SourceText, names: Sequence[str], about: dict[str, str]) -> list[Column]:
    """Columns of a header: parts of a load along the axes, with their unit."""
    if "bins" in about or any(re.search(r"\[\d+\]\(|_\d+_[xyz]\b", name) for name in names):
        hint = "Their sum is in the forces (or force and moment) file in the same folder"
        source.refuse("", "forces in bins along a direction", "forces of the whole", hint)
    loads = [f"{name}_{part}_{axis}" for name, parts in _foam_groups(names) for part in parts for axis in "xyz"]
    kind = about["title"].strip().lower().removesuffix("s")
    if not loads and kind in ("force", "moment") and all(re.fullmatch(r"\w+_[xyz]", name) for name in names[1:]):
        loads = [f"{kind}_{name}" for name in names[1:]]
    units = ["Nm" if name.partition("_")[0].endswith("moment") else "N" for name in loads]
    own = [Column(f"{name}_{unit}", unit) for name, unit in zip(loads, units, strict=True)]
    return [Column("Time", "", "time"), *(own or map(Column, names[1:]))]


def _foam_cells(names: Sequence[str]) -> Cells:
    """Cells of a row; one with other parentheses than its header has is damaged, so that it is not shifted."""
    groups = _foam_groups(names)
    shape = "n" + "".join(f"({'(nnn)' * len(parts)})" for _, parts in groups) if groups else ""
    width = shape.count("n") if shape else len(names)

    def cells(text: str) -> tuple[str, ...]:
        parts = re.findall(r"[()]|[^()\s]+", text)
        found = tuple(p for p in parts if p not in "()")
        own = "".join(p if p in "()" else "n" for p in parts)
        right = own == shape if shape else own.replace("(nnn)", "nnn") == "n" * len(found)
        return found if right or len(found) != width else (*found[:-1], "damaged parentheses")

    return cells


def _foam(columns: list[Column], table: ExportTable, notes: list[str], about: dict[str, str]) -> Read:
    """Clock, units and totals, as far as the columns are loads; coefficients of propellerInfo in the usual names."""
    if {"KT", "10*KQ"} <= {c.name for c in columns}:
        own = [_PROPELLER.get(c.name, (c.name, c.unit, 1.0)) for c in columns]
        table = replace(table, values=table.values * np.array([factor for _, _, factor in own]))
        columns = [replace(c, name=name, unit=unit) for c, (name, unit, _) in zip(columns, own, strict=True)]
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
    return columns, table


def _totals(columns: list[Column], table: ExportTable, notes: list[str]) -> Read:
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


READERS = (
    Layout(
        "fluent_report", '("Time Step" "thrust" "flow-time") in line 3',
        lambda line: [name.strip() for name in _QUOTED.findall(line)] if _REPORT.fullmatch(line) else None, skip='"',
        hint="Line 3 of a report file lists all names; line 2 is abbreviated", finish=_checked, within=4, told=_report,
    ),
    Layout(
        "fluent_monitor", '"Flow Time" "cd"', lambda line: _QUOTED.findall(line) if _MONITOR.fullmatch(line) else None,
        skip=r'"[^"]*"$', within=3, told=_monitor,
        notes=("monitors state no units, reference values, sector or sign convention: check them",),
    ),
    Layout(
        "star_monitor", '"Iteration","Thrust 1 Monitor: Thrust (N)"', _star_names, ",", "(",
        notes=("monitors state neither sector nor sign convention",),
    ),
    Layout(
        "su2_history", '"Time_Iter","Inner_Iter","CD"',
        lambda line: _commas(re.sub(r"^VARIABLES\s*=\s*", "", line)) if _SU2.match(line) else None, ",", "",
        r"(TITLE|ZONE)\b", ("coefficients rest on reference values that the history does not state",),
        finish=_outermost, within=4,
    ),
    Layout(
        "flow360_forces", "physical_step, pseudo_step, CL, CD",
        lambda line: _commas(line) if _commas(line)[:2] == ("physical_step", "pseudo_step") else None, ",", "",
        notes=("coefficients rest on reference values that the file does not state",), finish=_outermost,
    ),
    Layout(
        "openfoam_forces", "# Time total_x total_y total_z", _foam_header, skip="#", setting=r"#\s*(\w+)\s*:\s*(.+)",
        within=40, columns=_foam_columns, cells=_foam_cells, finish=_foam,
    ),
)  # fmt: skip

"""``run.toml``: the files of one CFD run, and what they do not say of themselves.

``bemt import FILES --out run.toml`` writes it; every command takes it in place of the files. A reader that is given one
returns the checked document; `bemt.data.recordings.cfd_run` makes the points of it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

from bemt.base.toml import Table, entry, read_model
from bemt.data.readers import head_text
from bemt.data.readers.cfd import unit_of

KIND = "cfd_run"
QUANTITIES: dict[str, tuple[str, str]] = {
    "thrust": ("force", "N"), "duct_thrust": ("force", "N"), "torque": ("torque", "N m"), "power": ("power", "W"),
    "rpm": ("angular_speed", "rpm"), "airspeed": ("speed", "m/s"), "density": ("density", "kg/m3"),
    "cells": ("none", "-"),
}  # fmt: skip
"""What a column of a run may be: dimension, usual unit."""


class RunColumn(Table):
    """[columns]: where a quantity stands, its unit and sign."""

    column: str | None = entry("heading in the files; found by its words if omitted")
    unit: str | None = entry("unit, if the file states none", words='a unit such as "N", "lbf", "N m", "rev/min"')
    sign: int | None = entry(
        "factor on every value; turned to positive, and said, if omitted", "", -1, 1, lambda v: "" if v else "1 or -1",
        words="1 or -1",
    )  # fmt: skip

    def rules(self) -> Iterable[tuple[str, ...]]:
        """A unit that is known."""
        if self.unit is not None and unit_of(self.unit) is None:
            yield "unit", repr(self.unit), "a known unit", "As in N, kN, lbf, N m, N mm, lbf in, rpm, rad/s, m/s, kg/m3"


class RunColumns(Table):
    """[columns]: the quantities of the run."""

    thrust: RunColumn | None = entry("thrust of all that is on the mount")
    duct_thrust: RunColumn | None = entry("part of the thrust that the duct carries")
    torque: RunColumn | None = entry("shaft torque")
    power: RunColumn | None = entry("shaft power")
    rpm: RunColumn | None = entry("speed of rotation")
    airspeed: RunColumn | None = entry("speed of flight")
    density: RunColumn | None = entry("density of the fluid")
    cells: RunColumn | None = entry("cells of the grid: rows of one condition are a grid study")

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Units of the right dimension."""
        for name, column in self.given().items():
            unit = unit_of(column.unit) if column is not None and column.unit else None
            dimension, usual = QUANTITIES[name]
            if unit is not None and unit.dimension != dimension:
                hint = f"{unit.suffix} is a mass: write {unit.suffix}f" if unit.dimension == "mass" else ""
                expected = f"a unit of {dimension.replace('_', ' ')} such as {usual}"
                yield f"{name}.unit", repr(column.unit), expected, hint


class RunHead(Table):
    """[run]: files and operating point."""

    files: tuple[str, ...] = entry("exports of the run, relative to this file", default=())
    rpm: float | None = entry("speed of rotation, if no column has it", "rev/min", 1.0, 1e6)
    airspeed_m_s: float | None = entry("speed of flight", "m/s", 0.0, 400.0)
    density_kg_m3: float | None = entry("density of the fluid", "kg/m3", 0.01, 1100.0)
    revolutions: int | None = entry(
        "last revolutions to average; 4, or half of the run, if omitted", low=1, high=100_000
    )
    sector: int | None = entry("the model is one of so many equal sectors: loads are multiplied", low=1, high=100)
    axis: Literal["x", "y", "z"] | None = entry("axis of the shaft; the largest force if omitted")
    zones: tuple[str, ...] | None = entry("zones whose loads count, duct included")
    duct_zones: tuple[str, ...] | None = entry("those of the zones that are the duct; by their names if omitted")
    rotor_zones: tuple[str, ...] | None = entry("those that turn: their moment is the torque; by name if omitted")
    ignore: tuple[str, ...] | None = entry("headings that count for nothing")


class GridTable(Table):
    """[[grids]]: one grid of a study, in place of run.files."""

    files: tuple[str, ...] = entry("exports of the run on it, a folder of them, or its run.toml", required=True)
    cells: float | None = entry("cells of the grid; as its run.toml states if omitted", low=10, high=1e12)


class ReferenceTable(Table):
    """[reference]: what coefficients rest on, and the density by which a program made its forces."""

    area_m2: float | None = entry("area", "m2", 1e-8, 1e6)
    length_m: float | None = entry("length of moments", "m", 1e-6, 1e4)
    speed_m_s: float | None = entry("speed", "m/s", 1e-3, 2000.0)
    density_kg_m3: float | None = entry("density; loads in units go with that of the run", "kg/m3", 0.01, 1100.0)


class SetupTable(Table):
    """[setup]: how the run was computed; no load depends on it, only the two gci set an uncertainty."""

    program: str | None = entry("program")
    solver: str | None = entry("solver")
    turbulence: str | None = entry("turbulence model")
    steady: bool | None = entry("true: frozen rotor; false: the mesh turns")
    compressible: bool | None = entry("whether the density followed the pressure")
    grid_level: str | None = entry("name of the grid")
    cells: float | None = entry("cells of the grid", low=10, high=1e12)
    grids: int | None = entry("grids of the grid study; 0 or 1 is none", low=0, high=20)
    gci_pct: float | None = entry("grid convergence index of the thrust", "%", 0.0, 200.0)
    gci_torque_pct: float | None = entry("that of the torque", "%", 0.0, 200.0)
    domain_over_D: float | None = entry("diameter of the domain over that of the disk", low=0.5, high=1000)
    wall: Literal["function", "scalable", "automatic", "resolved"] | None = entry("wall treatment")
    y_plus: float | None = entry("mean distance of the first cell in wall units", low=0.0, high=1e5)
    balance_mass: float | None = entry("residual of mass over the flow through the disk", low=-1.0, high=1.0)
    balance_momentum: float | None = entry("of momentum over the thrust", low=-1.0, high=1.0)


class RunToml(Table):
    """run.toml: one CFD run, or one condition on several grids: a study."""

    run: RunHead = RunHead()
    grids: tuple[GridTable, ...] = ()
    columns: RunColumns = RunColumns()
    reference: ReferenceTable = ReferenceTable()
    setup: SetupTable = SetupTable()

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Files of one grid, or grids."""
        if bool(self.run.files) == bool(self.grids):
            got = "files and [[grids]]" if self.grids else "no files"
            yield "run.files", got, "the exports of one run, or [[grids]] with two grids or more"
        elif len(self.grids) == 1:
            yield "grids", "one grid", "two or more"

    @property
    def files(self) -> tuple[str, ...]:
        """All files, of the run or of its grids."""
        return self.run.files + tuple(f for g in self.grids for f in g.files)


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a text has the table of a run, or of the grids of a study.

    >>> sniff('[run]\nfiles = ["thrust.out"]\n'), sniff("[recording]\n")
    (True, False)
    """
    return any(line.split("#")[0].strip() in ("[run]", "[[grids]]") for line in head_text(head).splitlines())


def read(path: str | os.PathLike[str]) -> RunToml:
    """Read a run.toml; its files are not opened."""
    return read_model(RunToml, Path(path))


def toml_text(tables: Mapping[str, Any], comment: str) -> str:
    """Write the tables of a run, or of a recording, as TOML; a column stands on one line.

    >>> print(toml_text({"columns": {"rpm": {"column": "n", "unit": "rpm"}}, "setup": {}}, "One run").strip())
    # One run
    [columns]
    rpm = {column = "n", unit = "rpm"}
    """
    import tomlkit

    inline = {name: tomlkit.inline_table() for name in tables.get("columns", {})}
    for name, column in inline.items():
        column.update(tables["columns"][name])
    return f"# {comment}\n" + tomlkit.dumps({k: inline if k == "columns" else v for k, v in tables.items() if v})

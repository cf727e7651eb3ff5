"""C81 tables per station, with a case that reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import BladeExport, Files, Job
from bemt.tools.exports.blades import Frozen, baked
from bemt.tools.exports.parts import plain_name

if TYPE_CHECKING:
    from pathlib import Path

    from bemt.rotors.case import Case

WIDTH, PER_LINE = 7, 9
NEAR = np.radians(10.0)
"""Angles around the working point that keep every node of the solver's tables [rad]."""


class C81Export(BladeExport):
    """One C81 file per blade element: lift, drag and an empty moment over angle of attack and Mach number."""

    id = "c81"
    title = "C81 airfoil tables along the blade"
    holds = "cl, cd over angle of attack and Mach number; one Reynolds number per station"
    features = frozenset({"torque", "airspeed", "windmill", "mach", "density", "rest", "sections", "rotation"})
    conventions = "degrees, -180 to 180; 7-character columns, nine values per line; the moment block is zero"
    source = "C81 format as its users write it: A30,6I2 / 7X,9F7.0 / 10F7.0"

    def write(self, job: Job) -> Files:
        """Tables, stations and ``case.toml``."""
        f = baked(job, count=10_000)
        p = job.loading
        files: dict[str, str | bytes] = {}
        tables = []
        for k in range(f.r.size):
            name = f"station_{k:02d}.c81"
            files[name] = c81_text(f, k, f"{job.case.name} {f.r[k] / p.R:.3f}")
            tables.append(f'[[polars]]\nfile = "{name}"\nr_over_R = {f.r[k] / p.R:.12g}\nformat = "c81"\n')
        rows = [
            f"{a:.15g},{c:.15g},{b:.15g}" for a, c, b in zip(p.r / p.R, p.chord / p.R, np.degrees(p.beta), strict=True)
        ]
        files["stations.csv"] = "r_over_R,chord_over_R,beta_deg\n" + "\n".join(rows) + "\n"
        model = job.case.file.model
        off = sorted({*model.effects_off, "stall_delay", "cascade", "compressibility", "drag_divergence"})
        quoted = ", ".join(f'"{word}"' for word in off)
        on = ", ".join(f'"{word}"' for word in model.effects_on if word.partition("(")[0] not in off)
        files[
            "case.toml"
        ] = f"""# C81 tables of {job.case.name}: the sections as the solver used them, so effects on sections are off.
schema = "bemt.case/1"
name = "{plain_name(job.case.name)}_c81"

[rotor]
kind = "{job.case.kind}"
blades = {p.blades}
diameter_m = {2.0 * p.R:.15g}
hub_diameter_mm = {2e3 * p.Rhub:.15g}
rotation = "{"right" if p.sense > 0 else "left"}"

[blade]
stations = "stations.csv"

[blade.section]
thickness = 0.12

[operating]
rpm = {p.rpm:.12g}
airspeed_m_s = {p.airspeed_m_s:.12g}

[air]
density_kg_m3 = {p.rho:.12g}

[model]
effects_on = [{on}]
effects_off = [{quoted}]
stations = {model.stations}

{chr(10).join(tables)}"""
        return files

    def notes(self, job: Job) -> list[str]:
        """What was frozen."""
        p = job.loading
        return [
            f"each table holds the Reynolds number of its station at {p.rpm:g} rev/min, {p.airspeed_m_s:g} m/s: "
            f"{p.Re.min():.3g} to {p.Re.max():.3g}",
            "stall delay, cascade and Mach effects of the case are inside the tables",
            "at most 99 angles fit: every node within 10 degrees of the working angle, fewer elsewhere",
            "the moment block is zero: the project has no moments",
        ]

    def read_back(self, job: Job, files: Files, folder: Path) -> Case:
        """The written case."""
        from bemt.base.tables import write_atomic
        from bemt.rotors.case import load_case

        for name, data in files.items():
            write_atomic(folder / name, data)
        return load_case(folder / "case.toml")


def c81_text(f: Frozen, k: int, name: str) -> str:
    """One table."""
    near = np.abs(f.alpha - f.at_alpha[k]) <= NEAR
    degrees = np.round(np.degrees(f.alpha), 6)
    fine = (degrees > -30.0) & (degrees < 40.0)
    keep = near | (fine & (degrees % 4.0 == 0.0)) | (~fine & ((degrees % 15.0 == 0.0) | (np.abs(degrees) == 180.0)))
    keep[[0, -1]] = True
    alpha = degrees[keep]
    if alpha.size > 99:  # pragma: no cover - 41 + 17 + 22 angles at most
        raise AssertionError(f"{alpha.size} angles do not fit into C81")
    n_m, n_a = f.M.size, alpha.size
    lines = [f"{name[:30]:<30}" + f"{n_m:2d}{n_a:2d}" * 2 + " 2 2"]

    def block(mach: Array, angles: Array, values: Array) -> None:
        def rows(head: str, cells: list[str]) -> None:
            for i in range(0, len(cells), PER_LINE):
                lines.append((head if i == 0 else " " * WIDTH) + "".join(cells[i : i + PER_LINE]))

        rows(" " * WIDTH, [cell(m) for m in mach])
        for a, row in zip(angles, values, strict=True):
            rows(cell(a), [cell(v) for v in row])

    for table in (f.cl[k], f.cd[k]):
        block(f.M, alpha, table[keep])
    block(np.array([0.0, 1.0]), np.array([-180.0, 180.0]), np.zeros((2, 2)))
    return "\n".join(lines) + "\n"


def cell(value: float) -> str:
    """A number in seven characters, with as many digits as fit."""
    for digits in range(6, -1, -1):
        text = f"{value:.{digits}f}"
        text = text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text
        if len(text) <= WIDTH:
            return text.rjust(WIDTH)
    raise ValueError(f"{value:g} does not fit into {WIDTH} characters")

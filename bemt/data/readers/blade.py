"""A blade from the file of another program: stations, sections of few numbers, an operating point; and as a case."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.data.readers import SourceText, load_text, number
from bemt.physics.sections.parametric import QpropSection, XrotorSection
from bemt.physics.sections.polars import DEFAULT_RE, Polar

SPAN_DEG = (-20.0, 25.0)
"""Angles of the written tables; beyond them flat-plate laws continue."""
RE_RANGE = (5e3, 3e6)


@dataclass(frozen=True, eq=False)
class BladeFile:
    """One rotor of a file."""

    # Title in the file; program
    name: str
    source: str
    blades: int  # Number
    # Tip and hub radius [m]
    R_m: float
    Rhub_m: float
    # (N,) stations [m], [rad]
    r_m: Array
    chord_m: Array
    beta_rad: Array
    # At r/R, ascending; linear between, held outside
    sections: Sequence[tuple[float, XrotorSection | QpropSection | Polar]]
    # Operating point, where the file states one
    rpm: float | None = None
    airspeed_m_s: float | None = None
    rho: float | None = None
    notes: tuple[str, ...] = ()  # What was left out
    duct: Mapping[str, float] | None = None  # Keys of a case's ``[duct]``; None: an open rotor


class Cursor(SourceText):
    """Lines of numbers of a blade file, taken one after the other; faults are gathered.

    Lines are neither blank nor begin with one of the characters of `comment`.
    """

    def __init__(self, file: str | os.PathLike[str] | SourceText, comment: str) -> None:
        source = file if isinstance(file, SourceText) else load_text(file)
        super().__init__(source.name, source.text, source.sha256)
        self.rows = [(i, t) for i, t in enumerate(self.lines, 1) if t.strip() and t.lstrip()[0] not in comment]
        self.at = 0

    def take(self, count: int, what: str, most: int | None = None) -> list[float]:
        """Numbers of the next line in list-directed form (blanks or commas); NaN and a fault for what is none."""
        if self.at >= len(self.rows):
            self.refuse(len(self.lines), "the end of the file", what)
        line, text = self.rows[self.at]
        self.at += 1
        words = [w for w in re.split(r"[\s,]+", text.split("!")[0].strip()) if w]
        out: list[float] = []
        for k, word in enumerate(words[: most or count]):
            value = number(word)
            if value is None:
                self.add(f"{line}:{k + 1}", repr(word[:30]), f"a number for {what}")
            out.append(math.nan if value is None else value)
        if len(out) < count:
            self.add(line, f"{len(out)} numbers", f"{count} for {what}")
            out += [math.nan] * (count - len(out))
        return out

    def table(self, rows: int, columns: int, what: str) -> Array:
        """The next rows, fewer at the end of the file, (n, columns)."""
        n = min(rows, len(self.rows) - self.at)
        return np.array([self.take(columns, what) for _ in range(max(n, 0))]).reshape(-1, columns)

    def finish(self, blade: BladeFile) -> BladeFile:
        """The blade, if its numbers can be one; lengths in other units are refused, not converted."""
        r, c, b = blade.r_m, blade.chord_m, np.degrees(blade.beta_rad)
        steepest = np.abs(b).max() if b.size else 0.0
        if not 1 <= blade.blades <= 64:
            self.add("blades", f"{blade.blades}", "1 to 64")
        if not 0.002 <= blade.R_m <= 50.0:
            self.add("radius", f"{blade.R_m:g} m", "0.002 to 50 m", "Other units?")
        if r.size < 2 or np.any(np.diff(r) <= 0.0):
            self.add("stations", f"{r.size} radii that do not rise", "two or more rising radii")
        elif r[-1] > blade.R_m * (1.0 + 1e-6):
            self.add("stations", f"a radius of {r[-1]:g} m", f"radii up to R = {blade.R_m:g} m")
        if np.any(c <= 0.0) or np.any(c > 2.0 * blade.R_m):
            self.add("stations", f"chords from {np.min(c):g} to {np.max(c):g} m", "chords above 0, below the diameter")
        if np.any(np.abs(b) > 90.0):
            self.add("stations", f"blade angles up to {steepest:g}", "within 90 degrees")
        elif np.all(np.abs(b) < 1.6) and np.any(b != 0.0):
            self.add("stations", f"blade angles up to {steepest:g}", "degrees", "Radians? They are not converted")
        self.check()
        return blade


def as_count(value: float) -> int:
    """A count; 0 for what is none (its fault is told already)."""
    return int(value) if value == value and 0.0 <= value <= 1e4 else 0


def _polar_csv(section: XrotorSection | QpropSection | Polar) -> str:
    if isinstance(section, Polar):
        rows = [
            f"{math.degrees(a):.9g},{section.cl[i, j, 0]:.9g},{section.cd[i, j, 0]:.9g},{Re:.9g}"
            for j, Re in enumerate(section.Re)
            for i, a in enumerate(section.alpha)
        ]
        return "\n".join(["alpha_deg,cl,cd,Re", *rows]) + "\n"
    alpha = np.arange(SPAN_DEG[0], SPAN_DEG[1] + 0.25, 0.5)
    Re = DEFAULT_RE[(DEFAULT_RE >= RE_RANGE[0]) & (DEFAULT_RE <= RE_RANGE[1])]
    Re = Re if section.reexp != 0.0 else Re[:1]
    lines = ["alpha_deg,cl,cd,Re"]
    for one in Re:
        cl, cd = section.cl_cd(np.radians(alpha), one)
        lines += [f"{a:.1f},{x:.12g},{max(y, 1e-6):.12g},{one:.12g}" for a, x, y in zip(alpha, cl, cd, strict=True)]
    return "\n".join(lines) + "\n"


def case_text(blade: BladeFile, name: str, file: str) -> dict[str, str]:
    """The blade as a case: ``case.toml``, ``stations.csv`` and a table per section."""
    rows = [
        f"{a:.12g},{b:.12g},{c:.12g}"
        for a, b, c in zip(blade.r_m / blade.R_m, blade.chord_m / blade.R_m, np.degrees(blade.beta_rad), strict=True)
    ]
    files = {"stations.csv": "r_over_R,chord_over_R,beta_deg\n" + "\n".join(rows) + "\n"}
    tables = []
    for k, (x, section) in enumerate(blade.sections):
        files[f"section_{k}.csv"] = _polar_csv(section)
        tables.append(f'[[polars]]\nfile = "section_{k}.csv"\nr_over_R = {x:.12g}\nformat = "csv"\n')
    title = re.sub(r'["\\\x00-\x1f]', " ", blade.name).strip() or name
    rpm = blade.rpm if blade.rpm is not None else float(f"{120.0 / blade.R_m * 30 / math.pi:.2g}")
    remark = "" if blade.rpm is not None else "  # not in the file: a tip speed near 120 m/s, set yours"
    rho = blade.rho if blade.rho is not None and blade.rho > 0.0 else 1.225
    notes = "".join(f"# {note}\n" for note in blade.notes)
    walls = "".join(f"{key} = {value:.9g}\n" for key, value in (blade.duct or {}).items())
    walls = f"\n[duct]\n{walls}" if walls else ""
    files["case.toml"] = f"""# From {blade.source}, {re.sub(r"[^ -~]", "_", file)}.
{notes}schema = "bemt.case/1"
name = "{name}"
title = "{title}"

[rotor]
kind = "{"propeller" if blade.duct is None else "fan"}"
blades = {blade.blades}
diameter_m = {2.0 * blade.R_m:.12g}
hub_diameter_mm = {2e3 * blade.Rhub_m:.12g}

[blade]
stations = "stations.csv"

[blade.section]
thickness = 0.12  # not in the file; only wave drag looks at it
{walls}
[operating]
rpm = {rpm:.12g}{remark}
airspeed_m_s = {blade.airspeed_m_s or 0.0:.12g}

[air]
density_kg_m3 = {rho:.9g}

{chr(10).join(tables)}"""
    return files

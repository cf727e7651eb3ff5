"""Blade and sections as design tools and disks take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.sections.polars import Polar
from bemt.tools.exports.base import BladeExport, Files, Job
from bemt.tools.exports.parts import plain_name

if TYPE_CHECKING:
    from pathlib import Path

    from bemt.rotors.case import Case


MOST_STATIONS = 60
"""Stations that QPROP (81) and XROTOR (60 to 100, by compilation) take."""


def stations(job: Job, most: int = MOST_STATIONS) -> tuple[Array, Array, Array, bool]:
    """Radius [m], chord [m] and angle [rad] of the stations, with what effects do to the blade; whether thinned."""
    blade, p = job.case.rotor().blade, job.loading
    r, thin = blade.r, blade.r.size > most
    if thin:
        r = np.linspace(blade.r[0], blade.r[-1], most)
    chord, beta = blade.at(r)
    turned = p.beta - blade.at(p.r)[1]  # by effects such as pitch_offset
    return r, chord, beta + np.interp(r, p.r, turned), thin


def anchors_of(job: Job) -> list[tuple[float, Polar, float]]:
    """Section tables of the case: r/R, table, Reynolds number there at the operating point."""
    from bemt.rotors.case.prepare import prepare_case

    point = job.loading
    found = prepare_case(job.case).polars
    many = len(found) > 1
    at = [np.clip(x, point.r[0] / point.R, point.r[-1] / point.R) if many else 0.75 for x, _ in found]
    return [
        (x, polar, float(np.interp(where, point.r / point.R, point.Re)))
        for (x, polar), where in zip(found, at, strict=True)
    ]


def section_errors(job: Job, sections: list[Any]) -> list[dict[str, float]]:
    """Greatest error of cl and of cd relative to cd, from the negative to the positive stall, per anchor."""
    out = []
    for (x, polar, Re), s in zip(anchors_of(job), sections, strict=True):
        a = polar.alpha[(polar.alpha >= polar.stall(Re, side=-1)[0]) & (polar.alpha <= polar.stall(Re)[0])]
        cl, cd = polar.lookup(a, Re)
        got_l, got_d = s.cl_cd(a, Re)
        out.append(
            {
                "r_over_R": float(x), "Re": Re, "cl": float(np.abs(got_l - cl).max()),
                "cd_pct": float(100.0 * np.abs(got_d / cd - 1.0).max()),
            }
        )  # fmt: skip
    return out


@dataclass(frozen=True, eq=False)
class Frozen:
    """Tables at radii with Reynolds number held at that of the operating point."""

    # (S,) stations [m], [rad]
    r: Array
    chord: Array
    beta: Array
    alpha: Array  # (Na,) angles of attack [rad]
    M: Array  # (Nm,) Mach numbers [1]
    # (S, Na, Nm) coefficients [1]
    cl: Array
    cd: Array
    Re: Array  # (S,) Reynolds numbers that were held [1]
    # (S,) angle of attack [rad] and Mach number of the operating point
    at_alpha: Array
    at_M: Array


def baked(job: Job, count: int = 20) -> Frozen:
    """Section tables as the solver uses them, all effects on sections included, at some of its stations."""
    from bemt.physics.bem.packing import M2_STEP
    from bemt.physics.sections.polars import ALPHA_GRID
    from bemt.rotors.case.prepare import prepare_case

    point = job.loading
    prep = prepare_case(job.case).prep
    keep = np.unique(np.round(np.linspace(0, point.r.size - 1, min(count, point.r.size))).astype(int))
    tab = prep.tables[keep]  # (S, Nm, Nr, Na, 2)
    Re_axis = _re_axis(prep.grid, tab.shape[2])
    mixed = np.empty((keep.size, tab.shape[1], tab.shape[3], 2))
    for k, Re in enumerate(point.Re[keep]):
        if tab.shape[2] == 1:
            mixed[k] = tab[k, :, 0]
            continue
        x = np.log(np.clip(Re, Re_axis[0], Re_axis[-1]))
        j = int(np.clip(np.searchsorted(np.log(Re_axis), x, side="right") - 1, 0, Re_axis.size - 2))
        w = (x - np.log(Re_axis[j])) / np.log(Re_axis[j + 1] / Re_axis[j])
        mixed[k] = (1.0 - w) * tab[k, :, j] + w * tab[k, :, j + 1]
    M = np.sqrt(M2_STEP * np.arange(tab.shape[1]))
    cl, cd = (np.swapaxes(mixed[..., i], 1, 2) for i in (0, 1))
    return Frozen(
        point.r[keep], point.chord[keep], point.beta[keep], np.asarray(ALPHA_GRID), M, cl, cd, point.Re[keep],
        point.alpha[keep], point.M[keep],
    )  # fmt: skip


def _re_axis(grid: Array, count: int) -> Array:
    """Reynolds numbers of the solver's tables (see `bemt.physics.bem.packing.pack_grid`): uniform in the logarithm."""
    first, inverse = float(grid[7]), float(grid[8])
    return np.asarray(np.exp(first + np.arange(count) / (inverse or 1.0)))


# C81 tables per station, with a case that reads them.

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


def kept_angles(f: Frozen, k: int) -> Array:
    """Angles of a table that is to be short, (Na,): all near the working point, few elsewhere; 80 at most."""
    near = np.abs(f.alpha - f.at_alpha[k]) <= NEAR
    degrees = np.round(np.degrees(f.alpha), 6)
    fine = (degrees > -30.0) & (degrees < 40.0)
    keep = near | (fine & (degrees % 4.0 == 0.0)) | (~fine & ((degrees % 15.0 == 0.0) | (np.abs(degrees) == 180.0)))
    keep[[0, -1]] = True
    return np.asarray(keep)


def c81_text(f: Frozen, k: int, name: str) -> str:
    """One table."""
    keep = kept_angles(f, k)
    alpha = np.round(np.degrees(f.alpha), 6)[keep]
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

"""Blade and section tables for disks that solve the inflow themselves: Fluent's VBM and STAR-CCM+'s virtual disk.

Both march the blade elements of a rotor through the flow of their mesh, so they want what BEMT has at each station:
chord, twist, and lift and drag over the angle of attack. The tables here are those that the solver reads, with stall
delay, cascade and Mach effects of the case inside, each at the Reynolds number of its station.

An airfoil file of the VBM is a name, the number of tables, and per table its label, Reynolds number, Mach number,
number of rows, and rows of angle [deg] and coefficient (Ansys Fluent User's Guide 2024 R2, table 18.1). The UDF before
Fluent had it built in (rotor_model, version 9) takes 80 rows, 20 stations and names of 30 characters, and between
tables it goes by the smallest and the largest Reynolds and Mach number alone: one pair of tables a file leaves it no
choice. STAR-CCM+ takes columns of angle, lift, drag and Mach number (its guide, Setting Up the Blade Element Method).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.bem.packing import M2_STEP
from bemt.tools.exports.base import DiskExport, Files, Job
from bemt.tools.exports.blades import Frozen, baked, kept_angles

MOST_SECTIONS, MOST_ROWS, MOST_TABLES, MOST_LETTERS = 20, 80, 25, 30
"""Of a rotor, of a table, of a file, of a name."""
SECTIONS = "sections.csv"
HEAD = ["r_over_R", "radius_m", "chord_m", "twist_deg", "airfoil"]


class VbmExport(DiskExport):
    """Stations, one VBM airfoil file and one STAR-CCM+ table each, and the disk in words."""

    id = "vbm"
    title = "Fluent VBM and STAR-CCM+ blade-element disk"
    holds = "stations and cl, cd over angle of attack (and Mach number in STAR-CCM+); the disk solves the inflow itself"
    features = frozenset({"torque", "airspeed", "windmill", "density", "rest", "sections", "duct", "rotation"})
    conventions = (
        "SI; angles in degrees, -180 to 180; twist from the plane of rotation, positive for thrust along +z; "
        "right-handed rotors turn counter-clockwise seen from +z"
    )
    source = "Ansys Fluent User's Guide 2024 R2, table 18.1; STAR-CCM+ guide, Setting Up the Blade Element Method"

    def write(self, job: Job) -> Files:
        """Two tables a station, the stations, and what to type besides."""
        p, f = job.loading, baked(job, count=MOST_SECTIONS)
        names = [f"s{k:02d}" for k in range(f.r.size)]
        files: dict[str, str | bytes] = {}
        for k, name in enumerate(names):
            files[f"{name}.dat"] = vbm_text(f, k, name)
            files[f"{name}.csv"] = star_text(f, k, 1.15 * float(p.M.max()))
        blade = job.case.rotor().blade
        r = np.concatenate([[p.Rhub], f.r[1:-1], [p.R]])  # the solver's ends lie close to hub and tip
        chord, beta = blade.at(r)
        beta = beta + np.interp(r, p.r, p.beta - blade.at(p.r)[1])  # by effects such as pitch_offset
        rows = [f"{x / p.R:.6f},{x:.8g},{c:.8g},{math.degrees(b):.6f},{name}"
                for x, c, b, name in zip(r, chord, beta, names, strict=True)]  # fmt: skip
        files[SECTIONS] = "\n".join([",".join(HEAD), *rows]) + "\n"
        side = "counter-clockwise" if p.sense > 0 else "clockwise"
        files["disk.txt"] = "\n".join([
            f"{job.case.name}: tables of {p.rpm:.9g} rev/min, {p.airspeed_m_s:.9g} m/s, {p.rho:.9g} kg/m3",
            f"blades {p.blades}, radius {p.R:.9g} m, cut-out {p.Rhub:.9g} m ({p.Rhub / p.R:.6g} R)",
            f"speed {p.sense * p.omega:.9g} rad/s, {side} seen from +z; thrust along +z, the air goes along -z",
            "VBM: tip effect 100 %, collective and cyclic pitch 0; type the rows of sections.csv; airfoils: the .dat",
            "STAR-CCM+: sections at r_over_R; tables are the .csv files, angles in degrees",
            f"BEMT at this point: thrust of the rotor {p.thrust_N:.6g} N, torque {p.torque_Nm:.6g} N m",
            "",
        ])  # fmt: skip
        return files

    def notes(self, job: Job) -> list[str]:
        """What was frozen, and what the programs leave out."""
        p = job.loading
        tip = (
            "no gap and no duct: both belong into your mesh"
            if job.case.ducted
            else "neither has a tip loss like BEMT's"
        )
        return [
            f"each table holds the Reynolds number of its station at {p.rpm:g} rev/min, {p.airspeed_m_s:g} m/s: "
            f"{p.Re.min():.3g} to {p.Re.max():.3g}; those of the VBM its Mach number, too",
            f"stall delay, cascade and Mach effects of the case are inside the tables; {tip}",
            "not run: neither program is free; the tables are read back by their grammar, and give the loads of the "
            "rotor at the angles of this point",
        ]

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Loads of the written VBM tables at the angles and speeds of the point, linear between stations."""
        p = job.loading
        lines = str(files[SECTIONS]).splitlines()[1:]
        x, _, chord, twist = np.array([line.split(",")[:4] for line in lines], dtype=float).T
        r = p.r / p.R
        cl, cd = np.empty((2, x.size, r.size))
        for k, line in enumerate(lines):
            for table in read_vbm(str(files[f"{line.split(',')[4]}.dat"])):
                (cl if table.label == "cl" else cd)[k] = np.interp(np.degrees(p.alpha), table.alpha_deg, table.value)
        at = np.clip(np.searchsorted(x, r, side="right") - 1, 0, x.size - 2)
        share, i = (r - x[at]) / np.diff(x)[at], np.arange(r.size)
        lift, drag = ((1.0 - share) * c[at, i] + share * c[at + 1, i] for c in (cl, cd))
        phi = np.radians(np.interp(r, x, twist)) - p.alpha
        force = 0.5 * p.rho * p.W**2 * np.interp(r, x, chord) * p.blades * p.dr
        thrust = force * (lift * np.cos(phi) - drag * np.sin(phi))
        torque = force * (lift * np.sin(phi) + drag * np.cos(phi)) * p.r
        return float(thrust.sum()), float(torque.sum())


def vbm_text(f: Frozen, k: int, name: str) -> str:
    """Airfoil file of a station: lift and drag at its Reynolds and Mach number."""
    place = float(np.clip(f.at_M[k] ** 2 / M2_STEP, 0.0, f.M.size - 1.0))
    low = min(int(place), max(f.M.size - 2, 0))
    high, share = min(low + 1, f.M.size - 1), place - low
    keep = kept_angles(f, k)
    lines = [name, "2"]
    for label, table in (("cl", f.cl[k]), ("cd", f.cd[k])):
        value = ((1.0 - share) * table[:, low] + share * table[:, high])[keep]
        lines += [label, f"{f.Re[k]:.1f}", f"{f.at_M[k]:.5f}", f"{value.size}"]
        lines += [f"{a:10.3f} {v:12.6f}" for a, v in zip(np.degrees(f.alpha[keep]), value, strict=True)]
    return "\n".join(lines) + "\n"


def star_text(f: Frozen, k: int, M_max: float) -> str:
    """Table of a station: angle, lift, drag and Mach number, each Mach number after the other."""
    keep, lines = kept_angles(f, k), ['"AoA (deg)","Cl","Cd","Mach"']
    last = min(int(np.searchsorted(f.M, M_max)), f.M.size - 1)
    for m in range(last + 1):
        rows = zip(np.degrees(f.alpha[keep]), f.cl[k][keep, m], f.cd[k][keep, m], strict=True)
        lines += [f"{a:.3f},{cl:.6f},{cd:.6f},{f.M[m]:.5f}" for a, cl, cd in rows]
    return "\n".join(lines) + "\n"


class VbmTable(NamedTuple):
    """One table of an airfoil file."""

    label: str  # cl or cd
    Re: float
    M: float
    alpha_deg: Array  # (N,) rising from -180 to 180
    value: Array  # (N,)


def read_vbm(text: str) -> list[VbmTable]:
    r"""Tables of a VBM airfoil file by its grammar; ValueError says what breaks it.

    >>> read_vbm("a\n1\ncl\n1e5\n0.1\n2\n-180 0\n180 0\n")[0].Re
    100000.0
    """
    words = iter(text.split())
    name, count = next(words), int(next(words))
    if len(name) > MOST_LETTERS or count > MOST_TABLES:
        raise ValueError(f"{name}: {len(name)} letters, {count} tables; expected {MOST_LETTERS}, {MOST_TABLES} at most")
    out = []
    for _ in range(count):
        label, Re, M, rows = next(words), float(next(words)), float(next(words)), int(next(words))
        if label not in ("cl", "cd") or rows > MOST_ROWS:
            raise ValueError(f"{name}: {label} of {rows} rows; expected cl or cd, {MOST_ROWS} rows at most")
        alpha, value = np.array([[float(next(words)) for _ in range(2)] for _ in range(rows)]).T
        if np.any(np.diff(alpha) <= 0.0) or alpha[0] != -180.0 or alpha[-1] != 180.0:
            raise ValueError(f"{name}: {label}: angles do not rise from -180 to 180")
        out.append(VbmTable(label, Re, M, alpha, value))
    if next(words, None) is not None:
        raise ValueError(f"{name}: more than {count} tables")
    return out

"""Disks for flow solvers: SU2, Flow360, a fan table and blade-element tables for Fluent and STAR-CCM+."""

from __future__ import annotations

import json
import math
import re
from typing import Any, NamedTuple

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.bem.packing import M2_STEP
from bemt.tools.exports.base import DiskExport, Files, Job
from bemt.tools.exports.blades import Frozen, baked, kept_angles
from bemt.tools.exports.rotor_disk import tables

_SU2_WAY = "AXIS points downstream: stream and wake along +x, DISK to DISK_BACK; thrust on the rotor along -x"


class Su2DiskExport(DiskExport):
    """``ActuatorDisk.dat`` for ACTDISK_TYPE= VARIABLE_LOAD."""

    id = "su2-disk"
    title = "SU2 actuator disk, variable load"
    holds = "dCT/dr(r/R), dCP/dr(r/R) of one operating point with a free stream (ADV_RATIO > 0)"
    features = frozenset({"torque", "reynolds", "mach", "duct"})
    at_rest = False
    conventions = (
        "Renard: CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5); AXIS points backward; radius in grid units, here m"
    )
    source = "SU2 TestCases/rans/actuatordisk_variable_load (ActuatorDisk.dat)"
    told = (
        "the load does not answer to the flow; the radial force is zero",
        "not run: SU2 installs from neither PyPI nor Debian; the format is that of its test case",
    )

    def write(self, job: Job) -> Files:
        """One row per blade element; scaled so that the rows integrate (trapezoid) to the loads."""
        p = job.loading
        n, D = p.rpm / 60.0, 2.0 * p.R
        scale = p.rho * n**2 * D**4
        r, thrust, torque = tables(p)
        x, ct, cp = r / p.R, thrust * p.R / scale, 2.0 * np.pi * torque * p.R / (scale * D)
        body = "\n".join(f" {a:.8f} {t:.9e} {q:.9e} 0.0" for a, t, q in zip(x, ct, cp, strict=True))
        text = f"""# {job.case.name}: {p.rpm:.9g} rev/min, {p.airspeed_m_s:.9g} m/s, {p.rho:.9g} kg/m3; load by BEMT
# {job.rotation}; {_SU2_WAY}
# CT = {p.thrust_N / scale:.9g}, CP = {2 * np.pi * p.torque_Nm / (scale * D):.9g} (rotor alone)
MARKER_ACTDISK= DISK DISK_BACK
CENTER= 0.0 0.0 0.0
AXIS= 1.0 0.0 0.0
RADIUS= {p.R:.9g}
ADV_RATIO= {p.J:.12g}
NROW= {x.size}
# rs=r/R    dCT/drs     dCP/drs     dCR/drs
{body}
"""
        config = f"""% In the configuration of SU2; {_SU2_WAY}
MARKER_ACTDISK= ( DISK, DISK_BACK, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 )
ACTDISK_TYPE= VARIABLE_LOAD
ACTDISK_FILENAME= ActuatorDisk.dat
"""
        return {"ActuatorDisk.dat": text, "actuator_disk.cfg": config}

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Trapezoid over the written rows."""
        p = job.loading
        text = str(files["ActuatorDisk.dat"])
        rows = np.array([line.split() for line in text.splitlines() if line.startswith(" ")], dtype=float)
        n, D = p.rpm / 60.0, 2.0 * p.R
        CT, CP = (float(np.trapezoid(rows[:, k], rows[:, 0])) for k in (1, 2))
        scale = p.rho * n**2 * D**4
        return CT * scale, CP * scale * D / (2.0 * np.pi)


# Flow360: a BET disk.


class Flow360Export(DiskExport):
    """``BETDisks`` of the solver's JSON; lengths in metres as grid unit."""

    id = "flow360"
    title = "Flow360 BET disk"
    holds = "stations and cl, cd over angle of attack, Reynolds and Mach number"
    features = frozenset(
        {"torque", "airspeed", "windmill", "reynolds", "mach", "density", "rest", "sections", "duct", "rotation"}
    )
    conventions = (
        "grid unit 1 m: lengths in m, omega = Omega (1 m)/a; twist in degrees from the plane of rotation; axis "
        "along the thrust; polars [Mach][Re][alpha], alpha from -180 to 180"
    )
    source = "Flow360 solver JSON, BETDisks; examples of flexcompute/Flow360 tests/simulation/converter"

    def write(self, job: Job) -> Files:
        """Two files: the disk as the solver reads it, and the scales."""
        p = job.loading
        f, Re, cl, cd = _tables(job)
        degrees = np.round(np.degrees(f.alpha), 6)
        disk = {
            "rotationDirectionRule": "rightHand" if p.sense > 0 else "leftHand", "axisOfRotation": [0, 0, 1],
            "centerOfRotation": [0, 0, 0], "numberOfBlades": p.blades, "radius": p.R,
            "omega": p.omega / p.a_sound, "chordRef": float(np.interp(0.75 * p.R, p.r, p.chord)),
            "thickness": 0.05 * p.R, "nLoadingNodes": 40, "tipGap": "inf", "bladeLineChord": 0.0,
            "initialBladeDirection": [1, 0, 0],
            "twists": [{"radius": float(r), "twist": float(np.degrees(b))} for r, b in zip(p.r, p.beta, strict=True)],
            "chords": [{"radius": 0.0, "chord": 0.0}, {"radius": p.Rhub * 0.999, "chord": 0.0}]
            + [{"radius": float(r), "chord": float(c)} for r, c in zip(p.r, p.chord, strict=True)],
            "sectionalRadiuses": f.r.tolist(),
            "sectionalPolars": [
                {"liftCoeffs": np.round(a, 7).tolist(), "dragCoeffs": np.round(b, 7).tolist()}
                for a, b in zip(cl, cd, strict=True)
            ],
            "MachNumbers": f.M.tolist(),
            "ReynoldsNumbers": Re.tolist(),
            "alphas": degrees.tolist(),
        }  # fmt: skip
        scales = {
            "grid_unit_m": 1.0, "a_sound_m_s": p.a_sound, "density_kg_m3": p.rho, "viscosity_Pa_s": p.mu,
            "rpm": p.rpm, "airspeed_m_s": p.airspeed_m_s, "rotor_thrust_N": p.thrust_N, "torque_Nm": p.torque_Nm,
        }  # fmt: skip
        return {
            "bet_disk.json": json.dumps({"BETDisks": [disk]}) + "\n",
            "scales.json": json.dumps(scales, indent=1) + "\n",
        }

    def notes(self, job: Job) -> list[str]:
        """What the disk has of the case."""
        tip = "set tipGap to your duct's gap" if job.case.ducted else "tip loss is Flow360's (tipGap inf: an open tip)"
        return [
            f"stall delay, cascade and Mach effects of the case are inside the polars; {tip}",
            "omega and lengths are for a mesh in metres: divide by your grid unit",
            "not run: the solver is a service; the JSON is built into a BETDisk by the flow360 package in the tests",
        ]


def _tables(job: Job) -> tuple[Any, Array, list[Array], list[Array]]:
    """Sections, Reynolds numbers, and per section cl and cd as (Nm, Nr, Na)."""
    from dataclasses import replace

    from bemt.rotors.case.prepare import prepare_case
    from bemt.tools.exports.blades import _re_axis

    f = baked(job, count=10)
    p = job.loading
    prep = prepare_case(job.case).prep
    axis = _re_axis(prep.grid, prep.tables.shape[2])
    low, high = np.searchsorted(axis, [0.4 * p.Re.min(), 2.5 * p.Re.max()])
    use = np.arange(max(int(low) - 1, 0), min(int(high) + 1, axis.size))
    tip = 1.15 * float(p.M.max())
    mach = np.arange(min(int(np.searchsorted(f.M, tip)) + 1, f.M.size))
    cl, cd = [], []
    for r in f.r:
        k = int(np.argmin(np.abs(p.r - r)))
        table = prep.tables[k][mach][:, use]
        cl.append(table[..., 0])
        cd.append(table[..., 1])
    return replace(f, M=f.M[mach]), axis[use], cl, cd


# Fluent and STAR-CCM+: the load of one operating point over the radius, for a fan boundary or a body force.

PROFILE, TABLE = "fan.prof", "fan_star.csv"
COLUMNS = {
    "pressure-jump": ("Pressure Jump (Pa)", "thrust over area, dT/(2 pi r dr); pushes the air downstream"),
    "tangential-stress": ("Tangential Stress (Pa)", "dQ/(2 pi r^2 dr); pushes the air the way the rotor turns"),
    "tangential-velocity": ("Tangential Velocity (m/s)", "behind the rotor: what that stress does to the air"),
}
"""Fields of the profile, the headings that they have in the table, and what they are."""


class FanExport(DiskExport):
    """A radial profile for Fluent, the same as a table for STAR-CCM+, and which way they point."""

    id = "fan"
    title = "Fluent profile and STAR-CCM+ table of a fan"
    holds = "pressure jump, tangential stress and swirl over the radius at one operating point"
    features = frozenset({"torque", "rest", "reynolds", "mach", "duct", "rotation"})
    conventions = (
        "SI: m, Pa, m/s; origin in the disk, +z along the thrust, air goes along -z; right-handed rotors turn "
        "counter-clockwise seen from +z"
    )
    source = "Ansys Fluent User's Guide, Profiles: ((name radial n) (field values) ...)"
    told = (
        "the load does not answer to the flow",
        "not run: neither program is free; the profile is read back by its grammar",
    )

    def write(self, job: Job) -> Files:
        """Three files: profile, table, and axis, direction and units in words."""
        p = job.loading
        r, columns = fields(job)
        rows = {"r": r, **columns}
        body = "".join(f"({name}\n" + "\n".join(f"{x:.9e}" for x in v) + ")\n" for name, v in rows.items())
        head = ["Radius (m)", *(heading for heading, _ in COLUMNS.values())]
        table = [",".join(f'"{text}"' for text in head)]
        table += [",".join(f"{x:.9e}" for x in row) for row in zip(*rows.values(), strict=True)]
        side = "counter-clockwise" if p.sense > 0 else "clockwise"
        momentum = "of momentum over each ring, w (w - V) = pressure-jump / (2 rho)"
        speed = "of the prediction, losses of the duct included" if job.case.ducted else momentum
        words = [
            f"{job.case.name}: {p.rpm:.9g} rev/min, {p.airspeed_m_s:.9g} m/s, {p.rho:.9g} kg/m3; load by BEMT",
            f"thrust of the rotor {p.thrust_N:.6g} N, torque {p.torque_Nm:.6g} N m",
            f"disk: origin (0 0 0), normal +z, from r = {p.Rhub:.9g} to {p.R:.9g} m",
            "thrust along +z, on the rotor; the air is pushed along -z: a fan boundary whose flow goes along -z",
            f"turns {side} seen from +z, looking along -z; the air behind turns the same way",
            "units: m, Pa, m/s",
            f"axial speed behind that swirl: {speed}",
            *(f"{name}: {what}" for name, (_, what) in COLUMNS.items()),
            "body force of a layer of thickness t: pressure-jump / t and tangential-stress / t [N/m3]",
        ]
        return {
            PROFILE: f"((fan radial {r.size})\n{body})\n",
            TABLE: "\n".join(table) + "\n",
            "fan.txt": "\n".join(words) + "\n",
        }

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Loads of the profile, linear between radii in 2 pi r times the field."""
        found = read_profile(str(files[PROFILE]))
        r, jump, stress = (found[k] for k in ("r", "pressure-jump", "tangential-stress"))
        thrust, torque = 2.0 * math.pi * r * jump, 2.0 * math.pi * r**2 * stress
        return float(np.trapezoid(thrust, r)), float(np.trapezoid(torque, r))


def fields(job: Job) -> tuple[Array, dict[str, Array]]:
    """Radii [m] and the fields of the profile: pressures [Pa] and the velocity of the swirl [m/s].

    The swirl is what the torque of a ring leaves in the mass that passes it, v_t = dQ / (r dm), with the speed through
    the disk of a momentum balance, w (w - V) = dp / (2 rho) for an open rotor; in a duct with that of the prediction.
    """
    p = job.loading
    r, thrust, torque = tables(p)
    jump, stress = thrust / (2.0 * math.pi * r), torque / (2.0 * math.pi * r**2)
    V = p.airspeed_m_s
    if job.case.ducted:
        w = np.interp(r, p.r, p.w)
    else:
        w = 0.5 * (V + np.sqrt(np.maximum(V**2 + 2.0 * jump / p.rho, 0.0)))
    swirl = np.divide(stress, p.rho * w, out=np.zeros_like(r), where=w > 0.0)
    return r, dict(zip(COLUMNS, (jump, stress, swirl), strict=True))


def read_profile(text: str) -> dict[str, Array]:
    r"""Fields of a radial profile of Fluent by its grammar.

    >>> read_profile("((fan radial 2)\n(r\n0.1\n0.2)\n(p\n5\n6)\n)")["p"]
    array([5., 6.])
    """
    head = re.match(r"\s*\(\((\S+) radial (\d+)\)(.*)\)\s*$", text, re.DOTALL)
    if head is None:
        raise ValueError("no radial profile")
    out = {}
    for name, body in re.findall(r"\(\s*([A-Za-z][\w-]*)\s+([^()]*)\)", head[3]):
        out[name] = np.array(body.split(), dtype=float)
        if out[name].size != int(head[2]):
            raise ValueError(f"{name}: {out[name].size} values, {head[2]} in the head")
    return out


# Blade and section tables for disks that solve the inflow themselves: Fluent's VBM and STAR-CCM+'s virtual disk.
#
# Both march the blade elements of a rotor through the flow of their mesh, so they want what BEMT has at each station:
# chord, twist, and lift and drag over the angle of attack. The tables here are those that the solver reads, with stall
# delay, cascade and Mach effects of the case inside, each at the Reynolds number of its station.
#
# An airfoil file of the VBM is a name, the number of tables, and per table its label, Reynolds number, Mach number,
# number of rows, and rows of angle [deg] and coefficient (Ansys Fluent User's Guide 2024 R2, table 18.1). The UDF
# before Fluent had it built in (rotor_model, version 9) takes 80 rows, 20 stations and names of 30 characters, and
# between tables it goes by the smallest and the largest Reynolds and Mach number alone: one pair of tables a file
# leaves it no choice. STAR-CCM+ takes columns of angle, lift, drag and Mach number (its guide, Setting Up the Blade
# Element Method).

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

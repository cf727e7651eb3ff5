"""Fluent and STAR-CCM+: the load of one operating point over the radius, for a fan boundary or a body force."""

from __future__ import annotations

import math
import re

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import DiskExport, Files, Job
from bemt.tools.exports.rotor_disk import tables

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
        words = [
            f"{job.case.name}: {p.rpm:.9g} rev/min, {p.airspeed_m_s:.9g} m/s, {p.rho:.9g} kg/m3; load by BEMT",
            f"thrust of the rotor {p.thrust_N:.6g} N, torque {p.torque_Nm:.6g} N m",
            f"disk: origin (0 0 0), normal +z, from r = {p.Rhub:.9g} to {p.R:.9g} m",
            "thrust along +z, on the rotor; the air is pushed along -z: a fan boundary whose flow goes along -z",
            f"turns {side} seen from +z, looking along -z; the air behind turns the same way",
            "units: m, Pa, m/s",
            *(f"{name}: {what}" for name, (_, what) in COLUMNS.items()),
            "body force of a layer of thickness t: pressure-jump / t and tangential-stress / t [N/m3]",
        ]
        return {
            PROFILE: f"((fan radial {r.size})\n{body})\n",
            TABLE: "\n".join(table) + "\n",
            "fan.txt": "\n".join(words) + "\n",
        }

    def notes(self, job: Job) -> list[str]:
        """What is prescribed."""
        return [
            "the load does not answer to the flow",
            "not run: neither program is free; the profile is read back by its grammar",
            *(["the load is the rotor's alone: duct and stator belong into your mesh"] if job.case.ducted else []),
        ]

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Loads of the profile, linear between radii in 2 pi r times the field."""
        found = read_profile(str(files[PROFILE]))
        r, jump, stress = (found[k] for k in ("r", "pressure-jump", "tangential-stress"))
        thrust, torque = 2.0 * math.pi * r * jump, 2.0 * math.pi * r**2 * stress
        return float(np.trapezoid(thrust, r)), float(np.trapezoid(torque, r))


def fields(job: Job) -> tuple[Array, dict[str, Array]]:
    """Radii [m] and the fields of the profile: pressures [Pa] and the velocity of the swirl [m/s].

    The swirl is what the torque of a ring leaves in the mass that passes it, v_t = dQ / (r dm), with the speed through
    the disk of a momentum balance, w (w - V) = dp / (2 rho) for an open rotor; in a duct that of the whole thrust.
    """
    p = job.loading
    r, thrust, torque = tables(p)
    jump, stress = thrust / (2.0 * math.pi * r), torque / (2.0 * math.pi * r**2)
    V = p.airspeed_m_s
    if job.case.ducted:
        area = math.pi * (p.R**2 - p.Rhub**2)
        jet = math.sqrt(max(V**2 + 2.0 * p.thrust_N / (p.rho * area), 0.0))
        total = p.thrust_N + p.duct_thrust_N
        w = np.full_like(r, total / (p.rho * area * (jet - V)) if jet > V else max(V, 1e-9))
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

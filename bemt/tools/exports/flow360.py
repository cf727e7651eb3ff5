"""Flow360: a BET disk."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import DiskExport, Files, Job
from bemt.tools.exports.blades import baked


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
            "rotationDirectionRule": "rightHand" if p.sense > 0 else "leftHand",
            "axisOfRotation": [0, 0, 1],
            "centerOfRotation": [0, 0, 0],
            "numberOfBlades": p.blades,
            "radius": p.R,
            "omega": p.omega / p.a_sound,
            "chordRef": float(np.interp(0.75 * p.R, p.r, p.chord)),
            "thickness": 0.05 * p.R,
            "nLoadingNodes": 40,
            "tipGap": "inf",
            "bladeLineChord": 0.0,
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
        }
        scales = {
            "grid_unit_m": 1.0,
            "a_sound_m_s": p.a_sound,
            "density_kg_m3": p.rho,
            "viscosity_Pa_s": p.mu,
            "rpm": p.rpm,
            "airspeed_m_s": p.airspeed_m_s,
            "rotor_thrust_N": p.thrust_N,
            "torque_Nm": p.torque_Nm,
        }
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

"""SU2: blade-element disk with section polars."""

from __future__ import annotations

import numpy as np

from bemt.tools.exports.base import DiskExport, Files, Job
from bemt.tools.exports.blades import baked

LOW, HIGH = -30.0, 90.0


class Su2BemExport(DiskExport):
    """Propeller data for ACTDISK_TYPE= BLADE_ELEMENT."""

    id = "su2-bem"
    title = "SU2 blade-element disk"
    holds = "stations and cl, cd over angle of attack; no Reynolds or Mach number: frozen at one operating point"
    features = frozenset({"torque", "airspeed", "density", "sections", "duct"})
    at_rest = False
    conventions = "radius, chord in m, set angle in degrees from the plane of rotation; polar rows alpha [deg] cl cd"
    source = "SU2 TestCases/rans/actuatordisk_bem (prop_geom_alfclcd_data.txt)"

    def write(self, job: Job) -> Files:
        """One file: head, stations, a polar per station."""
        p, f = job.loading, baked(job, count=22)
        cl, cd = f.at_mach()
        degrees = np.degrees(f.alpha)
        keep = (degrees >= LOW) & (degrees <= HIGH) & (np.isclose(degrees % 1.0, 0.0) | np.isclose(degrees % 1.0, 1.0))
        alpha = degrees[keep]
        angle = float(np.degrees(job.case.rotor().blade.at(0.75 * p.R)[1]))
        rows = [
            f"# Geometric parameters of propeller: {job.rotation}",
            f"{p.blades}           : number of blades",
            f"{2.0 * p.R:.9g}       : diameter (m)",
            f"{p.Rhub:.9g}     : radius of hub  (m)",
            f"{angle:.9g}        : angle at 75% radius, has to be consistent with section data",
            "# Nsection, Nalf",
            f"     {f.r.size}       {alpha.size}",
            "#section,radius,chord,set angle",
        ]
        rows += [
            f"{k}\t{a:.9g}\t{c:.9g}\t{np.degrees(b):.9g}"
            for k, (a, c, b) in enumerate(zip(f.r, f.chord, f.beta, strict=True), 1)
        ]
        for k in range(f.r.size):
            rows.append(f"#Sec_{k + 1}, alpha,cl,cd")
            rows += [f"{a:.3f}\t{x:.8g}\t{y:.8g}" for a, x, y in zip(alpha, cl[k][keep], cd[k][keep], strict=True)]
        return {"propeller.txt": "\n".join(rows) + "\n"}

    def notes(self, job: Job) -> list[str]:
        """What was frozen."""
        p = job.loading
        return [
            f"each polar holds Reynolds and Mach number of its station at {p.rpm:g} rev/min, {p.airspeed_m_s:g} m/s",
            "stall delay and cascade of the case are inside the polars; tip loss is not",
            "not run: SU2 installs from neither PyPI nor Debian; the format is that of its test case",
        ]

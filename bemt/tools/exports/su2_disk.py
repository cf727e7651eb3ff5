"""SU2: an actuator disk of variable load."""

from __future__ import annotations

import numpy as np

from bemt.tools.exports.base import DiskExport, Files, Job


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

    def write(self, job: Job) -> Files:
        """One row per blade element; scaled so that the rows integrate (trapezoid) to the loads."""
        p = job.loading
        n, D = p.rpm / 60.0, 2.0 * p.R
        x, ct, cp = _rows(job)
        body = "\n".join(f" {a:.8f} {t:.9e} {q:.9e} 0.0" for a, t, q in zip(x, ct, cp, strict=True))
        scale = p.rho * n**2 * D**4
        text = f"""# {job.case.name}: {p.rpm:.9g} rev/min, {p.airspeed_m_s:.9g} m/s, {p.rho:.9g} kg/m3; load by BEMT
# {job.rotation}
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
        config = """% In the configuration of SU2
MARKER_ACTDISK= ( DISK, DISK_BACK, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 )
ACTDISK_TYPE= VARIABLE_LOAD
ACTDISK_FILENAME= ActuatorDisk.dat
"""
        return {"ActuatorDisk.dat": text, "actuator_disk.cfg": config}

    def notes(self, job: Job) -> list[str]:
        """What is prescribed."""
        return [
            "the load does not answer to the flow; the radial force is zero",
            "not run: SU2 installs from neither PyPI nor Debian; the format is that of its test case",
            *(["the load is the rotor's alone: duct and stator belong into your mesh"] if job.case.ducted else []),
        ]

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Trapezoid over the written rows."""
        p = job.loading
        text = str(files["ActuatorDisk.dat"])
        rows = np.array([line.split() for line in text.splitlines() if line.startswith(" ")], dtype=float)
        n, D = p.rpm / 60.0, 2.0 * p.R
        CT, CP = (float(np.trapezoid(rows[:, k], rows[:, 0])) for k in (1, 2))
        scale = p.rho * n**2 * D**4
        return CT * scale, CP * scale * D / (2.0 * np.pi)


def _rows(job: Job) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    from bemt.tools.exports.rotor_disk import tables

    p = job.loading
    r, thrust, torque = tables(p)
    n, D = p.rpm / 60.0, 2.0 * p.R
    scale = p.rho * n**2 * D**4
    return r / p.R, thrust * p.R / scale, 2.0 * np.pi * torque * p.R / (scale * D)

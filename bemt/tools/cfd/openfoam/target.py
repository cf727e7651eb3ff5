"""OpenFOAM surfaces and a case that runs."""

from __future__ import annotations

import tempfile
from pathlib import Path

from bemt.tools.exports.base import Files, Job, SolidExport


class OpenfoamExport(SolidExport):
    """Blades resolved: surfaces, dictionaries and ``Allrun``."""

    id = "openfoam"
    title = "OpenFOAM case with resolved blades"
    holds = "shape and an operating point; the flow solver finds the loads"
    conventions = "z along the shaft towards thrust, metres; thrust and torque as in functionObjects of the case"
    source = "OpenFOAM 1912; bemt.tools.cfd.openfoam"
    uses = frozenset({"rpm", "airspeed_m_s", "sideslip_deg", "level", "domain", "sector", "turbulence", "solver"})

    def write(self, job: Job) -> Files:
        """The whole case."""
        from bemt.tools.cfd.openfoam.write import Run, write_openfoam

        with tempfile.TemporaryDirectory() as folder:
            home = Path(folder)
            write_openfoam(job.case, home, Run(rpm=job.rpm, airspeed_m_s=job.airspeed_m_s))
            return {
                path.relative_to(home).as_posix(): path.read_bytes()
                for path in sorted(home.rglob("*"))
                if path.is_file() and path.name != "manifest.json"
            }

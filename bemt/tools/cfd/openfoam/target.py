"""OpenFOAM surfaces and a case that runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bemt.tools.cfd.openfoam.write import Run, RunTable, write_openfoam
from bemt.tools.exports.base import Job, Manifest, SolidExport


class OpenfoamExport(SolidExport):
    """Blades resolved: surfaces, dictionaries and ``Allrun``; the folder itself becomes the case."""

    id = "openfoam"
    title = "OpenFOAM case with resolved blades"
    holds = "shape and an operating point; the flow solver finds the loads"
    conventions = "z along the shaft towards thrust, metres; thrust and torque as in functionObjects of the case"
    source = "OpenFOAM 1912; bemt.tools.cfd.openfoam"
    options = RunTable
    uses = frozenset(RunTable.named())
    turn = 2

    def put(self, job: Job, out: Path) -> Manifest:
        """The whole case, whose faults come before anything is written."""
        given = {"rpm": job.rpm, "airspeed_m_s": job.airspeed_m_s, **job.own}
        run = Run(**{key: value for key, value in given.items() if key in self.uses and value is not None})
        return write_openfoam(job.case, out, run, job.solid)

    def text(self, part: Mapping[str, Any]) -> list[str]:
        """How the case is run."""
        solver, turbulence, domain, sector, level, notes = (
            part[key] for key in ("solver", "turbulence", "domain", "sector", "level", "notes")
        )
        words = f"{solver}, {turbulence}, {domain}, {sector}, level {level:g}"
        return [f"OpenFOAM case: {words}; run it with ./Allrun", *notes]

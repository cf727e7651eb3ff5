"""All files of a case but its surfaces."""

from __future__ import annotations

from bemt.exports.openfoam.flow import constants, fields, schemes, solution
from bemt.exports.openfoam.grid import block_mesh, create_patch, lines, set_fields, snappy, topo_set
from bemt.exports.openfoam.run import all_run, control
from bemt.exports.openfoam.settings import Settings

__all__ = ["case_files"]


def case_files(s: Settings, title: str = "") -> dict[str, str]:
    """Write every file of a case, the surfaces in ``constant/triSurface`` aside."""
    title = title or f"rotor of {2e3 * s.R:g} mm, {s.B} blades, {s.rpm:g} rev/min, {s.V:g} m/s"
    out = {
        "system/blockMeshDict": block_mesh(s), "system/snappyHexMeshDict": snappy(s), "system/topoSetDict": topo_set(s),
        "system/createPatchDict": create_patch(s), "system/setFieldsDict": set_fields(s),
        "system/controlDict": control(s),
        "system/fvSchemes": schemes(s), "system/fvSolution": solution(s), "Allrun": all_run(s, title),
        "constant/triSurface/lines.obj": lines(s),
    }  # fmt: skip
    out |= {f"0.orig/{name}": text for name, text in fields(s).items()}
    return out | {f"constant/{name}": text for name, text in constants(s).items()}

"""Air round a rotor and its duct, in STEP with named faces, for a mesher."""

from __future__ import annotations

from bemt.tools.exports.base import SolidExport


class FlowExport(SolidExport):
    """A box less rotor, duct and vanes; boundaries are picked by name."""

    id = "flow"
    title = "STEP of the air around, boundaries named"
    source = "geometry.cad.flow_domain; read by gmsh with Geometry.OCCImportLabels"

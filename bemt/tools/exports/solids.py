"""Solids: STL, OBJ, STEP, 3MF, and the air around a fan."""

from __future__ import annotations

from bemt.tools.exports.base import SolidExport


class StlExport(SolidExport):
    """STL, triangles."""

    id = "stl"
    title = "STL, triangles"
    source = "geometry.export"


# OBJ solids.


class ObjExport(SolidExport):
    """OBJ, triangles."""

    id = "obj"
    title = "OBJ, triangles"
    source = "geometry.export"


# STEP solids.


class StepExport(SolidExport):
    """STEP, surfaces of CAD."""

    id = "step"
    title = "STEP, surfaces of CAD"
    source = "geometry.export"


# 3MF solids.


class ThreeMfExport(SolidExport):
    """3MF, triangles in millimetres for slicers."""

    id = "3mf"
    title = "3MF, triangles for slicers"
    source = "geometry.export"


# Air round a rotor and its duct, in STEP with named faces, for a mesher.


class FlowExport(SolidExport):
    """A box less rotor, duct and vanes; boundaries are picked by name."""

    id = "flow"
    title = "STEP of the air around, boundaries named"
    source = "geometry.cad.flow_domain; read by gmsh with Geometry.OCCImportLabels"

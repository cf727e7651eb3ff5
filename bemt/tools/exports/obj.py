"""OBJ solids."""

from __future__ import annotations

from bemt.tools.exports.base import SolidExport


class ObjExport(SolidExport):
    """OBJ, triangles."""

    id = "obj"
    title = "OBJ, triangles"
    source = "geometry.export"

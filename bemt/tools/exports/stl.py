"""STL solids."""

from __future__ import annotations

from bemt.tools.exports.base import SolidExport


class StlExport(SolidExport):
    """STL, triangles."""

    id = "stl"
    title = "STL, triangles"
    source = "geometry.export"

"""3MF solids."""

from __future__ import annotations

from bemt.tools.exports.base import SolidExport


class ThreeMfExport(SolidExport):
    """3MF, triangles in millimetres for slicers."""

    id = "3mf"
    title = "3MF, triangles for slicers"
    source = "geometry.export"

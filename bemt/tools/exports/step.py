"""STEP solids."""

from __future__ import annotations

from bemt.tools.exports.base import SolidExport


class StepExport(SolidExport):
    """STEP, surfaces of CAD."""

    id = "step"
    title = "STEP, surfaces of CAD"
    source = "geometry.export"

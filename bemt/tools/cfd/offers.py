"""What campaigns of CFD offer to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"cfd": "bemt.tools.cfd.actions:cfd"}
REPORT_PARTS = {"cfd": "bemt.tools.cfd.report:report_pages"}
EXPORTS = {"openfoam": "bemt.tools.cfd.openfoam.target:OpenfoamExport"}

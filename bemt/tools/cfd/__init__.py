"""Campaigns of OpenFOAM runs: what to run, running it, recording it, summing it up (`command` joins them)."""

ACTIONS = {"cfd": "bemt.tools.cfd.actions:cfd"}
REPORT_PARTS = {"cfd": "bemt.tools.cfd.report:report_pages"}
EXPORTS = {"openfoam": "bemt.tools.cfd.openfoam.target:OpenfoamExport"}

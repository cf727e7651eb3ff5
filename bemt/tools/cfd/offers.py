"""What the CFD campaigns offer to the house (:mod:`bemt.base.plugins`)."""

REPORT_PARTS = {"cfd": "bemt.tools.cfd.report:report_pages"}

"""An audit of a CFD result as part of a page."""

from __future__ import annotations

from bemt.base.page import Cell, num, table
from bemt.data.recordings.audit import Audit
from bemt.results.report.values import Part

KIND = {"fine": "fine", "doubtful": "doubtful", "fault": "fault", "not stated": "unknown"}


def _share(value: float) -> str:
    return "unknown" if value != value else f"{100 * value:.1f} %"


def audit_parts(audit: Audit) -> list[Part]:
    """Say what an audit comes to, and give its lines."""
    rows = []
    for line in audit.lines:
        rows.append([line.topic, Cell(line.status, badge=KIND.get(line.status, "unknown")), line.finding,
                     line.consequence, num(100 * line.u_relative, 2, none="unknown")])  # fmt: skip
    known = audit.u_relative_known
    rest = f"the known parts make {_share(known)} together" if known else "no part of it is known"
    words = f"{audit.reference}: uncertainty of the thrust {_share(audit.u_relative)}; {rest}."
    head = ["setting", "status", "what is known", "consequence for the thrust", "u %"]
    return [("words", words), ("table", table(head, rows))]

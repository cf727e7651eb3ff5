"""An audit of a CFD result as part of a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bemt.base.page import Cell, num, table
from bemt.results.report.values import Part

KIND = {"fine": "fine", "doubtful": "doubtful", "fault": "fault", "not stated": "unknown"}


def _share(value: Any) -> str:
    return "unknown" if value is None or value != value else f"{100 * value:.1f} %"


def audit_parts(audit: Mapping[str, Any]) -> list[Part]:
    """Say what an audit comes to, and give its lines."""
    rows = []
    for line in audit["lines"]:
        u, status = line["u_relative"], str(line["status"])
        rows.append([str(line["topic"]), Cell(status, badge=KIND.get(status, "unknown")), str(line["finding"]),
                     str(line["consequence"]), num(None if u is None else 100 * u, 2, none="unknown")])  # fmt: skip
    known = audit["u_relative_known"]
    rest = f"the known parts make {_share(known)} together" if known else "no part of it is known"
    words = f"{audit['reference']}: uncertainty of the thrust {_share(audit['u_relative'])}; {rest}."
    head = ["setting", "status", "what is known", "consequence for the thrust", "u %"]
    return [("words", words), ("table", table(head, rows))]

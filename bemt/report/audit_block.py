"""Audits of CFD numbers as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bemt.report.markup import Cell, badge, esc, num, section, table

__all__ = ["audit_block", "audit_table"]

KIND = {"fine": "fine", "doubtful": "doubtful", "fault": "fault", "not stated": "unknown"}


def _share(value: Any) -> str:
    return "unknown" if value is None or value != value else f"{100 * value:.1f} %"


def audit_table(audit: Mapping[str, Any]) -> str:
    """Make the table of one audit."""
    rows = []
    for line in audit["lines"]:
        u = line["u_relative"]
        share = num(None if u is None else 100 * u, 2, none="unknown")
        status = str(line["status"])
        rows.append(
            [
                str(line["topic"]),
                Cell(status, markup=badge(KIND.get(status, "unknown"), status)),
                str(line["finding"]),
                str(line["consequence"]),
                share,
            ]
        )
    known = audit["u_relative_known"]
    rest = f"the parts that are known make {_share(known)} together" if known else "no part of it is known"
    words = (
        f"<p><strong>{esc(audit['reference'])}</strong>: uncertainty of the thrust {_share(audit['u_relative'])};"
        f" {rest}.</p>"
    )
    return words + table(["setting", "status", "what is known", "consequence for the thrust", "u %"], rows)


def audit_block(audits: Sequence[Mapping[str, Any]]) -> str:
    """Make the section of the audits of a case."""
    return section("Audit of the CFD", *(audit_table(audit) for audit in audits))

"""Ten targets designed, next to the best label: ``python docs/design_targets.py`` fills the table of design.md.

A row is a request; what it gives is printed in the page and checked by tests/test_design_targets.py.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bemt.base.units import INCH
from bemt.rotors.case import load_case
from bemt.tools.design.blade_design import Design, design_blade
from bemt.tools.design.requirement import DesignPoint

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "design.md"


@dataclass(frozen=True)
class Target:
    """A request in words, as points and as options."""

    words: str
    points: tuple[DesignPoint, ...]
    diameter_in: float | None
    more: dict[str, Any] = field(default_factory=dict)


TARGETS = (
    Target("6 N at 15 m/s, 10 in", (DesignPoint(6.0, 15.0),), 10.0),
    Target("6 N static, 10 in", (DesignPoint(6.0, 0.0),), 10.0),
    Target("1.5 N at 10 m/s, 5 in, 3 blades", (DesignPoint(1.5, 10.0),), 5.0, {"blades": 3}),
    Target("27 N static, 18 in", (DesignPoint(27.0, 0.0),), 18.0),
    Target("20 N at 25 m/s, 14 in", (DesignPoint(20.0, 25.0),), 14.0),
    Target("8 N at 30 m/s, 9 in", (DesignPoint(8.0, 30.0),), 9.0),
    Target("60 N at 20 m/s, 22 in, 3 blades", (DesignPoint(60.0, 20.0),), 22.0, {"blades": 3}),
    Target("4 N at 12 m/s, 10.5 in, at 5000 rev/min", (DesignPoint(4.0, 12.0, 5000.0),), 10.5),
    Target("6 N at 15 m/s for 80 % of the time, 10 N static for 20 %, 11 in",
           (DesignPoint(6.0, 15.0, None, 0.8), DesignPoint(10.0, 0.0, None, 0.2)), 11.0),
    Target("10 N static in the duct of `cases/ds30`", (DesignPoint(10.0, 0.0),), None, {"duct": "ds30"}),
)  # fmt: skip
LIKE_A_LABEL = {"material": "pa6_gf", "stall_margin": 0.0}
"""What propellers on sale are made of, and the only limit of lift that they keep."""


def designed(target: Target, **limits: Any) -> Design:
    """Design of a target."""
    more = target.more | limits
    if "duct" in more:
        more["duct"] = load_case(DOCS.parent / "cases" / more["duct"])
    diameter = None if target.diameter_in is None else target.diameter_in * INCH
    return design_blade(target.points, diameter, **more)


def saved(d: Design) -> float:
    """Power saved over the best label [1]."""
    return float("nan") if d.label is None else 1.0 - d.mean_W / d.label.mean_W


def row(target: Target, d: Design, strict: Design) -> str:
    """Line of the table: within the limits of the label, and within the usual ones."""
    assert d.label is not None
    ideal = d.disk_W if d.ducted else d.betz_W
    first = (target.words, f"{d.mean_W:.4g}", d.label.name, f"{d.label.mean_W:.4g}", f"{saved(d):.1%}", f"{ideal:.4g}")
    cells = (*first, f"{saved(strict):.1%}", "; ".join(strict.active) or "none")
    return f"| {' | '.join(cells)} |"


HEAD = (
    "| target | design W | best label | its W | saved | ideal W | saved within the usual limits | limits reached then "
    "|\n"
    "|---|---|---|---|---|---|---|---|\n"
)


def main() -> None:
    """Rewrite the table."""
    rows = []
    for target in TARGETS:
        rows.append(row(target, designed(target, **LIKE_A_LABEL), designed(target)))
        print(rows[-1], flush=True)
    text = PAGE.read_text(encoding="utf-8")
    found = re.sub(re.escape(HEAD) + r"(\|.*\n)*", lambda _: HEAD + "\n".join(rows) + "\n", text)
    PAGE.write_text(found, encoding="utf-8")


if __name__ == "__main__":
    main()

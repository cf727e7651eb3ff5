"""What a short case leaves open: the value that is taken and its range, one rule for case files and for `bemt new`."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bemt.sections.rule import DRAG_LEVEL, N_CRIT

__all__ = ["AIR", "FAN", "HUB", "LABEL", "SECTION", "SURFACE", "Unknown", "completed"]


@dataclass(frozen=True)
class Unknown:
    """A value that nobody stated: dotted key, what is taken, its range, and where that comes from."""

    key: str
    value: Any
    low: Any
    high: Any
    why: str

    def block(self) -> str:
        """Entry of a case file."""
        return (
            f'\n[[assumptions]]\nkey = "{self.key}"\nlow = {self.low:.4g}\nhigh = {self.high:.4g}\nwhy = "{self.why}"\n'
        )


HUB = Unknown("rotor.hub_ratio", 0.15, 0.10, 0.20, "hub not known; hubs and spinners of small propellers")
LABEL = (
    Unknown("blade.beta_offset_deg", 0.7, 0.0, 1.4,
            "a label's pitch is that of the chord line (0) or of the flat underside (up to 1.4 deg more)"),
    Unknown("blade.max_chord_over_R", 0.195, 0.15, 0.24,
            "chord not known, law apc_like; measured two blades of 8 to 14 in. Measure it: nothing narrows more"),
)  # fmt: skip
THICKNESS = Unknown("blade.section.thickness", 0.09, 0.06, 0.12, "section not known")
SECTION = (
    Unknown(
        "blade.section.camber",
        0.035,
        0.02,
        0.05,
        "section not known; measured families of propellers have 3 to 5 %, slow flyers more",
    ),
    THICKNESS,
)
SURFACE = (
    Unknown("model.n_crit", N_CRIT, 1.0, 5.0, "transition not known; 3 is the rule for disturbed flow"),
    Unknown(
        "model.drag_level",
        DRAG_LEVEL,
        1.0,
        1.2,
        "surface not known; smooth (1.0) to twice the excess of moulded blades (1.1)",
    ),
)
AIR = Unknown("air.density_kg_m3", 1.225, 1.16, 1.29, "air not stated; 30 to 0 C at sea level")
FAN = (
    Unknown("rotor.hub_ratio", 0.37, 0.30, 0.45, "hub not known; hubs of ducted fans"),
    Unknown("blade.max_chord_over_R", 0.45, 0.30, 0.60, "chord not known, law fan; range of that law"),
    Unknown("blade.section.camber", 0.05, 0.03, 0.07, "section not known; cambered compressor-like sections"),
    THICKNESS,
)
HUBS = ("hub_ratio", "hub_diameter_mm", "hub_diameter_in")
CHORDS = ("chord_law", "stations", "uiuc", "apc")


def completed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Document with what a short case leaves out: kind, hub, chord law, section and air, each with its assumption.

    Examples
    --------
    >>> short = {"rotor": {"blades": 2, "diameter_in": 10}, "blade": {"pitch_in": 5}, "operating": {"rpm": 6000}}
    >>> full = completed(short)
    >>> full["rotor"]["kind"], full["rotor"]["hub_ratio"], full["blade"]["chord_law"], full["air"]["density_kg_m3"]
    ('propeller', 0.15, 'apc_like', 1.225)
    """
    made: dict[str, Any] = copy.deepcopy(dict(document))
    rotor, blade, declared = made.get("rotor"), made.get("blade"), made.get("assumptions", [])
    fan = "duct" in made
    unknowns: list[Unknown] = []
    if isinstance(rotor, dict):
        fan = rotor.setdefault("kind", "fan" if fan else "propeller") == "fan"
        if not any(key in rotor for key in HUBS):
            unknowns.append(FAN[0] if fan else HUB)
    if isinstance(blade, dict):
        if not any(key in blade for key in CHORDS):
            blade["chord_law"] = "fan" if fan else "apc_like"
            unknowns += FAN[1:2] if fan else LABEL
        if "section" not in blade:
            unknowns += [*(FAN[2:] if fan else SECTION), *SURFACE]
    if "air" not in made:
        unknowns.append(AIR)
    if not isinstance(declared, list):
        return made
    named = {item.get("key") for item in declared if isinstance(item, dict)}
    for unknown in unknowns:
        home, _, name = unknown.key.rpartition(".")
        table = made
        for part in home.split("."):
            table = table.setdefault(part, {})
        if isinstance(table, dict) and name not in table:
            table[name] = unknown.value
            if unknown.key not in named:
                item = {"key": unknown.key, "low": unknown.low, "high": unknown.high, "why": unknown.why}
                made.setdefault("assumptions", []).append(item)
    return made

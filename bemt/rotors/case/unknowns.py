"""What a short case leaves open: the value that is taken and its range, one rule for case files and for `bemt new`."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from bemt.base.units import INCH
from bemt.physics.sections.rule import DRAG_LEVEL, N_CRIT
from bemt.physics.wake import MOUNT_DRAG, SWIRL, WAKE_RADIUS
from bemt.rotors.population import chord_sd, population

CHORD, CHORD_EXPONENT = 0.2, -0.2
"""Largest chord over tip radius of the usual 10 in propeller and its exponent over the diameter, calibrated: of twelve
pairs the one that predicts 87 propellers of UIUC from their labels best in the median, at rest and in flight.  Their
chords alone give 0.218 and -0.4 with families alike in weight, which is 13 to 31 % too much thrust and power below 9 in
[1]."""
CLASS_CHORD: dict[str | None, tuple[float, float | None]] = {
    "electric": (1.0, 0.09), "sport": (1.0, 0.09), "folding": (0.95, 0.12), "slow_flyer": (1.4, None),
    "multirotor": (1.25, 0.10), "reversible": (0.75, 0.15), "fpv": (0.9, 0.15),
}  # fmt: skip
"""Chord of a class of blades over the usual, and the scatter of its logarithm where that is known.

Fitted to readings at rest and in flight through the solver's slopes, beside blade angle and camber
(`reports/studies/label_classes.py`): electric, sport and folding to UIUC volumes 1 to 3 (19, 27 and 21 propellers;
their own scatter is 0.05, 0.04 and 0.10, between makers 0.07), fpv to 16 of Drive Calculator and two stands.
Multirotor and reversible are APC's computed tables (20 and 8), with the spread of a computation; eight multirotor
propellers that Drive Calculator measured have 1.10 +- 0.09. Slow flyers: eleven of two makers have 1.5 times the law's
chord; 1.4 moves the mean log score of 175 propellers known from their labels from 0.042 to 0.086 [1]."""
WIDTH_CHORD = {1: 1.08, 0: 1.0, -1: 0.86, -2: 0.79}
"""Chord of wide (W) and narrow blades (N, NN) over others', from APC's computed tables of 21, 18 and 7 [1]."""
BLADES_EXPONENT = 0.2
"""Chord of B blades is (2/B) to this power that of two: three- and four-bladed DA4052 and NR640 against their own two
blades (0.18), 57 and 19 of Drive Calculator's against its two-bladed ones (0.1 to 0.2), FPV (0.4 +- 0.2) [1]."""
CLASS_DRAG: dict[str | None, tuple[float, float]] = {"sport": (0.43, 0.11)}
"""ln(profile drag) of a class of blades over the usual and its scatter, fitted beside angle, chord and camber: 27 APC
Sport of UIUC (0.49 from flight alone, 0.54 at rest alone), 42 sport propellers of Drive Calculator 0.30 +- 0.17.
Electric, folding and slow flyers are within 0.1 of none (57) [1]."""
SPORT_DEG = 0.97
"""Further zero-lift angle of sport propellers from the same fit, +- 0.26 [deg]."""
BLADES_DRAG = (0.23, 0.13)
"""The same of three and more blades: 40 of Drive Calculator's and 7 of UIUC, eight makers alike in weight (0.16 to 0.30
with one left out). The same blade on two, three and four arms differs by 0.04 (each fit +- 0.2): blades on sale [1]."""
DEG_PER_CAMBER = 104.0
"""Zero-lift angle over camber of a NACA four-digit mean line, camber at 40 % chord: thin-airfoil theory [deg]."""
_CHORD_LAW = (0.05, 1.0)  # chords over the radius that a propeller may have


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


HUB = Unknown("rotor.hub_ratio", 0.15, 0.10, 0.20, "hub not known; typical of hubs and spinners of small propellers")
_UNDERSIDE = "a label states the pitch of the chord line (0) or of the flat underside (up to 1.4 deg more)"
OFFSET = Unknown("blade.beta_offset_deg", 0.7, 0.0, 1.4, _UNDERSIDE)
THICKNESS = Unknown("blade.section.thickness", 0.09, 0.06, 0.12, "section not known")
_CAMBER = "section not known; measured propeller families have 3 to 5 %, slow flyers more"
SECTION = (Unknown("blade.section.camber", 0.035, 0.02, 0.05, _CAMBER), THICKNESS)
SURFACE = (
    Unknown("model.n_crit", N_CRIT, 1.0, 5.0, "transition not known; 3 is the rule for disturbed flow"),
    Unknown(
        "model.drag_level", DRAG_LEVEL, 1.0, 1.2,
        "surface not known; smooth (1.0) to twice the excess of moulded blades (1.1)",
    ),
)  # fmt: skip
AIR = Unknown("air.density_kg_m3", 1.225, 1.16, 1.29, "air not stated; 30 to 0 C at sea level")
_MOTORS = " in two of three of 1088 measured motors with a propeller"
FAN = (
    Unknown("rotor.hub_ratio", 0.37, 0.30, 0.45, "hub not known; typical of ducted fans"),
    Unknown("blade.max_chord_over_R", 0.45, 0.30, 0.60, "chord not known; range of the chord law fan"),
    Unknown("blade.section.camber", 0.05, 0.03, 0.07, "section not known; typical of cambered compressor sections"),
    THICKNESS,
)
DRIVE = (
    Unknown(
        "drive.battery.sag", 0.06, 0.01, 0.13, "battery not known; loses 3 to 10 % of its voltage at full throttle"
    ),
    Unknown(
        "drive.motor.size", 0.0, -0.78, 0.78,
        "motor not known; resistance with controller and leads is 0.64 to 1.6 times the usual for its current in two "
        "of three of 494 motors. Its mass_g narrows that to 0.7 to 1.4",
    ),
    Unknown(
        "drive.motor.idle_share", 0.073, 0.03, 0.14, f"motor not known; losses take 5 to 11 % of the current{_MOTORS}"
    ),
)  # fmt: skip
PAIR = (
    Unknown(
        "second_rotor.wake_radius", WAKE_RADIUS, 0.7071, 0.85,
        "wake not measured; 0.707 by momentum theory, 0.78 to 0.82 measured",
    ),
    Unknown(
        "second_rotor.interference", 1.0, 0.8, 1.2,
        "declared; blades that pass each other and mixing with the air outside are not modelled",
    ),
    Unknown(
        "second_rotor.swirl", SWIRL, 0.0, 1.0,
        "not known; 1 without anything between the rotors, less behind motors and arms, which straighten the flow",
    ),
    Unknown(
        "second_rotor.mount_drag", MOUNT_DRAG, 0.0, 0.06,
        "declared; motor and arm cover 2 to 6 % of the disk. A stand reads it while the first rotor turns alone",
    ),
)  # fmt: skip
ESC_DROP = Unknown(
    "drive.esc.drop", 0.07, 0.0, 0.18,
    "controller not known; it, leads and a warm winding take 2 to 13 % of the voltage in two of three of 859 motors",
)  # fmt: skip
_STATED = {"drive.battery.sag": ("resistance_mohm",), "drive.motor.size": ("resistance_mohm", "winding_drop"),
           "drive.motor.idle_share": ("no_load_A",)}  # fmt: skip
HUBS = ("hub_ratio", "hub_diameter_mm", "hub_diameter_in")
CHORDS = ("chord_law", "stations", "uiuc", "apc")


def section_of(blade_class: str | None) -> tuple[Unknown, ...]:
    """Section of a class of blades: slow flyers and sport propellers are cambered as measured, reversible ones not."""
    if blade_class == "reversible":
        return Unknown("blade.section.camber", 0.0, 0.0, 0.01, "turns both ways: symmetric, or nearly so"), THICKNESS
    more_deg = {"slow_flyer": population().slow_flyer_deg, "sport": SPORT_DEG}.get(blade_class or "")
    if more_deg is None:
        return SECTION
    camber = round(SECTION[0].value + more_deg / DEG_PER_CAMBER, 3)
    ends = round(camber - 0.015, 3), round(camber + 0.015, 3)
    kind = str(blade_class).replace("_", " ")
    why = f"section not known; {kind} propellers have {100 * ends[0]:.2g} to {100 * ends[1]:.2g} %"
    return Unknown("blade.section.camber", camber, *ends, why), THICKNESS


def surface_of(blade_class: str | None, blades: int | None) -> tuple[Unknown, ...]:
    """Transition and profile drag of a propeller that is known by its label.

    >>> [surface_of(kind, blades)[1].value for kind, blades in ((None, 2), ("sport", 2), (None, 3))]
    [1.1, 1.69, 1.38]
    """
    many = BLADES_DRAG if (blades or 2) > 2 else (0.0, 0.0)
    kind = CLASS_DRAG.get(blade_class, (0.0, 0.0))
    more, scatter = many[0] + kind[0], math.sqrt(3.0) * math.hypot(many[1], kind[1])
    if not more:
        return SURFACE
    level = DRAG_LEVEL * math.exp(more)
    of = " and ".join([f"{blade_class} propellers"] * bool(kind[0]) + ["three and more blades"] * bool(many[0]))
    low, high = (round(level * math.exp(sign * scatter), 2) for sign in (-1.0, 1.0))
    return SURFACE[0], Unknown("model.drag_level", round(level, 2), low, high, f"profile drag not known; range of {of}")


def offset_of(family: str | None) -> Unknown:
    """Blade angle over the label's: that of a maker's measured series, else of any."""
    kin = population().families.get(family or "")
    if kin is None:
        return OFFSET
    far = math.sqrt(3.0) * math.hypot(kin.offset_sd_deg, population().label_deg)
    value = round(kin.offset_deg, 2)
    why = f"blade angle over the label's, as stations of the series {family} have it, and what labels err by"
    return Unknown(OFFSET.key, value, round(value - far, 2), round(value + far, 2), why)


def label_chord(
    diameter_m: float, blade_class: str | None = None, blades: int | None = None, width: int = 0
) -> Unknown:
    """Largest chord of a propeller that is known by its label."""
    low, high = _CHORD_LAW
    wider, scatter = CLASS_CHORD.get(blade_class, (1.0, None))
    wider *= WIDTH_CHORD[min(max(width, -2), 1)] * (2.0 / max(blades or 2, 2)) ** BLADES_EXPONENT
    far = math.exp(math.sqrt(3.0) * (scatter or chord_sd(diameter_m)))
    chord = min(max(wider * CHORD * (diameter_m / INCH / 10.0) ** CHORD_EXPONENT, low), high)
    least, most = (float(f"{value:.2g}") for value in (max(chord / far, low), min(chord * far, high)))
    of = f"{blade_class} propellers" if scatter else "87 measured propellers, 2.2 to 19 in"
    why = f"chord not known; range of {of}. Measuring it narrows the band most"
    return Unknown("blade.max_chord_over_R", float(f"{chord:.3g}"), least, most, why)


def replaced(changes: Iterable[str]) -> set[str]:
    """Keys of typical values that have to go where the values themselves come, by dotted key.

    >>> sorted(replaced(["drive.motor.resistance_mohm", "drive.kv"]))
    ['drive.motor.size', 'drive.motor.winding_drop']
    """
    homes = [(key, key.rpartition(".")[0], names) for key, names in _STATED.items()]
    found = {(key, home, name) for key, home, names in homes for name in names if f"{home}.{name}" in set(changes)}
    others = {f"{home}.{name}" for key, home, _ in found for name in _STATED[key]} - set(changes)
    return {key for key, _, _ in found} | others


def out_of_place(document: Mapping[str, Any]) -> dict[str, str]:
    """Declared assumptions about typical values that are not in the document, as it states the values: key and which.

    >>> out_of_place({"drive": {"motor": {"no_load_A": 0.6}}, "assumptions": [{"key": "drive.motor.idle_share"}]})
    {'drive.motor.idle_share': 'no_load_A'}
    """
    drive, declared = document.get("drive"), document.get("assumptions")
    if not isinstance(drive, dict) or not isinstance(declared, list):
        return {}
    found: dict[str, str] = {}
    for key in (str(item.get("key")) for item in declared if isinstance(item, dict)):
        _, home, name = key.split(".") if key in _STATED else ("", "", "")
        if home and isinstance(table := drive.get(home), dict) and name not in table:
            found.update((key, said) for said in _STATED[key] if said in table)
    return found


ESC = ("resistance_mohm", "drop", "name")
"""Keys by which a case says which controller it has."""


def _states(drive: Mapping[str, Any], name: str, keys: tuple[str, ...]) -> bool:
    """Whether a table of [drive] has one of these keys."""
    table = drive.get(name, {})
    return isinstance(table, dict) and any(key in table for key in keys)


def _diameter_m(rotor: Any) -> float:
    """What a document states of it, sound or not; 10 in where it states nothing."""
    for key, factor in (("diameter_in", INCH), ("diameter_mm", 1e-3), ("diameter_m", 1.0)):
        value = rotor.get(key) if isinstance(rotor, dict) else None
        if isinstance(value, (int, float)) and 1e-3 < value * factor < 100.0:
            return value * factor
    return 10.0 * INCH


def _sized(item: Unknown, drive: Mapping[str, Any]) -> Unknown:
    """Range of a motor's size, narrower where its mass or stator is stated."""
    if item.key != "drive.motor.size" or not _states(drive, "motor", ("mass_g", "stator")):
        return item
    why = "winding not known; resistance is 0.7 to 1.4 times the usual for K_v and mass in two of three of 584 motors"
    return replace(item, low=-0.55, high=0.55, why=why)


def _blades(rotor: Any) -> int | None:
    blades = rotor.get("blades") if isinstance(rotor, dict) else None
    return blades if isinstance(blades, int) else None


def _of_drive(drive: Mapping[str, Any]) -> list[Unknown]:
    """What a motor and its controller leave out."""
    out = [_sized(u, drive) for u in DRIVE if not _states(drive, u.key.split(".")[1], _STATED[u.key])]
    known = _states(drive, "motor", ("resistance_mohm",)) and not _states(drive, "esc", ESC)
    return [*out, ESC_DROP] if known else out


def completed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Document with what a short case leaves out: kind, hub, chord law, section and air, each with its assumption.

    >>> short = {"rotor": {"blades": 2, "diameter_in": 10}, "blade": {"pitch_in": 5}, "operating": {"rpm": 6000}}
    >>> full = completed(short)
    >>> full["rotor"]["kind"], full["rotor"]["hub_ratio"], full["blade"]["chord_law"], full["air"]["density_kg_m3"]
    ('propeller', 0.15, 'apc_like', 1.225)
    """
    made: dict[str, Any] = copy.deepcopy(dict(document))
    if gone := out_of_place(made):
        made["assumptions"] = [x for x in made["assumptions"] if not (isinstance(x, dict) and x.get("key") in gone)]
    unknowns, declared = _left_out(made), made.get("assumptions", [])
    if not isinstance(declared, list):
        return made
    named = {str(item.get("key")): item for item in declared if isinstance(item, dict)}
    for unknown in unknowns:
        home, _, name = unknown.key.rpartition(".")
        table = made
        for part in home.split("."):
            table = table.setdefault(part, {})
        if not isinstance(table, dict) or name in table:
            continue
        table[name] = unknown.value
        own = named.get(unknown.key)
        if own is None:
            item = {"key": unknown.key, "low": unknown.low, "high": unknown.high, "why": unknown.why}
            made.setdefault("assumptions", []).append(item)
        elif all(isinstance(own.get(end), (int, float)) for end in ("low", "high")):
            table[name] = 0.5 * (own["low"] + own["high"])  # the user's range, in the middle of it
    return made


def _left_out(made: dict[str, Any]) -> list[Unknown]:
    """What a short document leaves out; its kind of rotor and of chord are written into it."""
    rotor, blade = made.get("rotor"), made.get("blade")
    fan = "duct" in made
    unknowns: list[Unknown] = []
    if isinstance(rotor, dict):
        fan = rotor.setdefault("kind", "fan" if fan else "propeller") == "fan"
        if not any(key in rotor for key in HUBS):
            unknowns.append(FAN[0] if fan else HUB)
    if isinstance(blade, dict):
        surface: tuple[Unknown, ...] = SURFACE
        if not any(key in blade for key in CHORDS):
            surface = SURFACE if fan else surface_of(blade.get("class"), _blades(rotor))
            blade["chord_law"] = "fan" if fan else "apc_like"
            chord = label_chord(_diameter_m(rotor), blade.get("class"), _blades(rotor))
            unknowns += FAN[1:2] if fan else [OFFSET, chord]
        if "section" not in blade:
            unknowns += [*(FAN[2:] if fan else section_of(blade.get("class"))), *surface]
    if "air" not in made:
        unknowns.append(AIR)
    if isinstance(made.get("second_rotor"), dict):
        unknowns += PAIR
    if isinstance(drive := made.get("drive"), dict):
        unknowns += _of_drive(drive)
    return unknowns

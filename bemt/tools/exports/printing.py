"""A case as a printable rotor: what the options of ``export --printable`` ask for, as shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from bemt.base.errors import Fault, InputError
from bemt.rotors.case import Case
from geometry.common import GeometryError
from geometry.duct import Duct
from geometry.mesh import MeshModel, Options, build
from geometry.printed import ADAPTERS, Printed
from geometry.rotor import Rotor

OPEN_TIP, DUCTED_TIP = 0.5, 0.1
"""Length of the rounded tip over the chord there: in a duct a round tip would open the gap [1]."""
SOLIDS = ("stl", "step", "3mf", "obj")
THICKNESS_MM = 0.8
"""Two lines of a 0.4 mm nozzle [mm]."""


@dataclass(frozen=True)
class Print:
    """What is asked for, in the units of the command; None is a rule or nothing."""

    min_thickness_mm: float | None = None
    trailing_edge_mm: float | None = None
    tip_round: float | None = None  # over the chord at the tip [-]
    flare_mm: float | None = None
    hub_diameter_mm: float | None = None
    hub_height_mm: float | None = None
    adapter: str | None = None
    bore_mm: float | None = None
    recess_mm: tuple[float, float] | None = None  # diameter and depth
    hex_mm: tuple[float, float] | None = None  # across flats and depth
    hand: str | None = None  # right, left or both; None is that of the case


def asked(request: Print) -> list[str]:
    """Options that were given."""
    return [f"--{f.name.replace('_', '-')}" for f in fields(request) if getattr(request, f.name) is not None]


def request_of(printable: bool, **given: Any) -> Print | None:
    """What the options ask of a printer, None without ``printable``; InputError where one of its own comes alone."""
    request = Print(**given)
    if printable:
        return request
    alone = asked(replace(request, min_thickness_mm=None, flare_mm=None))  # those are options of any solid
    if alone:
        raise InputError([Fault("", name, "given", "nothing without --printable") for name in alone])
    return None


def faults_of(request: Print, formats: Sequence[str]) -> list[Fault]:
    """What the options alone say that cannot be printed."""
    wrong = [word for word in formats if word not in SOLIDS]
    found = [Fault("", "--printable", f"the format {word}", f"one of {', '.join(SOLIDS)}") for word in wrong]
    if request.adapter is not None and request.adapter not in ADAPTERS:
        return [*found, Fault("", "--adapter", request.adapter, f"one of {', '.join(sorted(ADAPTERS))}")]
    try:
        _printed(request, ducted=False)
    except GeometryError as error:
        found += [Fault("", *fault) for fault in error.faults]
    return found


def _printed(request: Print, ducted: bool) -> Printed:
    holes: dict[str, Any] = dict(ADAPTERS[request.adapter]) if request.adapter else {}
    if request.bore_mm is not None:
        holes["bore"] = request.bore_mm * 1e-3
    for name, pair in (("recess", request.recess_mm), ("hexagon", request.hex_mm)):
        if pair is not None:
            holes = {key: value for key, value in holes.items() if key == "bore"}  # instead of the adapter's
            holes[name] = (pair[0] * 1e-3, pair[1] * 1e-3)
    thickness = THICKNESS_MM if request.min_thickness_mm is None else request.min_thickness_mm
    return Printed(
        thickness * 1e-3,
        None if request.trailing_edge_mm is None else request.trailing_edge_mm * 1e-3,
        (DUCTED_TIP if ducted else OPEN_TIP) if request.tip_round is None else request.tip_round,
        None if request.flare_mm is None else request.flare_mm * 1e-3,
        **holes,
    )


@dataclass(frozen=True)
class Shape:
    """A solid to write: what its file name ends in, the rotor and its duct, how it is made, its mesh."""

    end: str
    rotor: Rotor
    duct: Duct | None
    options: Options | None
    model: MeshModel


def shapes(case: Case, options: Options | None, request: Print | None) -> list[Shape]:
    """Solids of a case, as its sections say or for a printer; GeometryError where one cannot be made."""
    rotor, duct = case.rotor(), case.duct()
    if request is None:
        return [Shape("", rotor, duct, options, build(rotor, duct, options))]
    if request.hub_diameter_mm is not None:
        rotor = replace(rotor, blade=replace(rotor.blade, Rhub=0.5e-3 * request.hub_diameter_mm))
    if request.hub_height_mm is not None:
        rotor = replace(rotor, hub_length=1e-3 * request.hub_height_mm)
    made = {"right": ("_right", replace(rotor, rotation=1)), "left": ("_left", replace(rotor, rotation=-1))}
    rotors = [("", rotor)] if request.hand is None else [made[h] for h in made if request.hand in (h, "both")]
    options = Options(printed=_printed(request, duct is not None))
    return [Shape(end, rotor, None, options, build(rotor, None, options)) for end, rotor in rotors]

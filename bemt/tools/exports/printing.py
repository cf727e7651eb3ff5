"""A case as a printable rotor: what the options of ``export --printable`` ask for, as shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from bemt.base.document import Documented
from bemt.base.errors import Fault
from bemt.base.toml import Table, entry
from bemt.rotors.case import Case
from bemt.tools.exports.base import SolidExport
from geometry.common import GeometryError
from geometry.duct import Duct
from geometry.mesh import MeshModel, Options, build
from geometry.printed import ADAPTERS, Printed
from geometry.rotor import Rotor

OPEN_TIP, DUCTED_TIP = 0.5, 0.1
"""Length of the rounded tip over the chord there: in a duct a round tip would open the gap [1]."""
SOLIDS = ("stl", "step", "3mf", "obj")
NOZZLE_MM, FINE_MM = 0.4, 0.25
"""Nozzles that printers have, the usual one and a fine one [mm]."""
LINES = 2.0
"""Least thickness over the width of a line, which is that of the nozzle [1]."""
TIP_CHORD = 6.0
"""Chord to which a narrower tip is widened, over the least thickness: its round edges then leave a middle of that
thickness. Of the blades tried, 5.5 was enough and 5 was not [1]."""


@dataclass(frozen=True)
class Print:
    """What is asked for, in the units of the command; None is a rule or nothing."""

    min_thickness_mm: float | None = None
    nozzle_mm: float | None = None
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


def faults_of(request: Print, formats: Sequence[str]) -> list[Fault]:
    """What the options alone say that cannot be printed."""
    wrong = [word for word in formats if word not in SOLIDS]
    found = [Fault("", "--printable", f"the format {word}", f"one of {', '.join(SOLIDS)}") for word in wrong]
    if request.nozzle_mm is not None and not 0.05 <= request.nozzle_mm <= 2.0:
        return [*found, Fault("", "--nozzle-mm", f"{request.nozzle_mm:g}", "a number from 0.05 to 2 mm")]
    if request.nozzle_mm is not None and request.min_thickness_mm is not None:
        found.append(Fault("", "--nozzle-mm", "given", "nothing with --min-thickness-mm", "It says the thickness"))
    if request.adapter is not None and request.adapter not in ADAPTERS:
        return [*found, Fault("", "--adapter", request.adapter, f"one of {', '.join(sorted(ADAPTERS))}")]
    try:
        _printed(request, ducted=False)
    except GeometryError as error:
        found += [Fault("", *fault) for fault in error.faults]
    return found


def thickness_mm(request: Print) -> float:
    """Least thickness: two lines of the nozzle unless told. [mm]

    >>> thickness_mm(Print()), thickness_mm(Print(nozzle_mm=0.25)), thickness_mm(Print(min_thickness_mm=0.6))
    (0.8, 0.5, 0.6)
    """
    if request.min_thickness_mm is not None:
        return request.min_thickness_mm
    return LINES * (NOZZLE_MM if request.nozzle_mm is None else request.nozzle_mm)


def _printed(request: Print, ducted: bool) -> Printed:
    holes: dict[str, Any] = dict(ADAPTERS[request.adapter]) if request.adapter else {}
    if request.bore_mm is not None:
        holes["bore"] = request.bore_mm * 1e-3
    for name, pair in (("recess", request.recess_mm), ("hexagon", request.hex_mm)):
        if pair is not None:
            holes = {key: value for key, value in holes.items() if key == "bore"}  # instead of the adapter's
            holes[name] = (pair[0] * 1e-3, pair[1] * 1e-3)
    return Printed(
        1e-3 * thickness_mm(request),
        None if request.trailing_edge_mm is None else request.trailing_edge_mm * 1e-3,
        (DUCTED_TIP if ducted else OPEN_TIP) if request.tip_round is None else request.tip_round,
        None if request.flare_mm is None else request.flare_mm * 1e-3,
        **holes,
    )


class AsPrinted(Documented):
    """How a blade was made for a printer."""

    least_thickness_mm: float
    hub_by_ratio_mm: float | None = field(default=None, kw_only=True)  # Hub of which the case states but a ratio
    bore_mm: float | None = field(default=None, kw_only=True)  # Hole for the shaft; None is a solid hub
    recess_mm: tuple[float, float] | None = field(default=None, kw_only=True)  # Round one in the back: width and depth
    hex_mm: tuple[float, float] | None = field(default=None, kw_only=True)  # For a nut: across flats and depth
    hand: str = field(default="right", kw_only=True)  # right, left or both


class Widened(AsPrinted):
    """The same with a wider tip: chord there before and after, and what it costs in thrust and torque."""

    tip_chord_mm: tuple[float, float]
    wider_from_r_over_R: float
    thrust_pct: float
    torque_pct: float


@dataclass(frozen=True)
class Shape:
    """A solid to write: what its file name ends in, the rotor and its duct, how it is made, its mesh."""

    end: str
    rotor: Rotor
    duct: Duct | None
    options: Options | None
    model: MeshModel
    printed: AsPrinted | None = None


def shapes(case: Case, options: Options | None, request: Print | None) -> list[Shape]:
    """Solids of a case, as its sections say or for a printer; GeometryError where one cannot be made.

    A tip too narrow for the least thickness is widened; the hint of a refusal names a nozzle that would do.
    """
    rotor, duct = case.rotor(), case.duct()
    if request is None:
        return [Shape("", rotor, duct, options, build(rotor, duct, options))]
    if request.hub_diameter_mm is not None:
        rotor = replace(rotor, blade=replace(rotor.blade, Rhub=0.5e-3 * request.hub_diameter_mm))
    if request.hub_height_mm is not None:
        rotor = replace(rotor, hub_length=1e-3 * request.hub_height_mm)
    made = {"right": ("_right", replace(rotor, rotation=1)), "left": ("_left", replace(rotor, rotation=-1))}
    rotors = [("", rotor)] if request.hand is None else [made[h] for h in made if request.hand in (h, "both")]
    made_so = _printed(request, duct is not None)
    options, out = Options(printed=made_so), []
    for end, rotor in rotors:
        guessed = request.hub_diameter_mm is None and case.file.rotor.hub_ratio is not None
        told = AsPrinted(
            thickness_mm(request), hub_by_ratio_mm=2e3 * rotor.Rhub if guessed else None, **_mount(made_so),
            hand=request.hand or ("right" if rotor.rotation > 0 else "left"),
        )  # fmt: skip
        try:
            model = build(rotor, None, options)
        except GeometryError as error:
            if not any(fault[0] in ("thickness", "chord") for fault in error.faults):
                raise
            wider = widened(rotor, 1e-3 * thickness_mm(request))
            try:
                model = build(wider, None, options)
            except GeometryError as still:
                raise GeometryError([(*f[:3], _fine(rotor, case, request)) for f in still.faults]) from None
            told = _changes(case, rotor, wider, told)
            rotor = wider
        # A slicer takes each named solid for a part, and blade and hub alone are open.
        whole = replace(model.rotor, group=np.zeros_like(model.rotor.group), names=("rotor",))
        out.append(Shape(end, rotor, None, options, replace(model, rotor=whole), told))
    return out


def widened(rotor: Rotor, thickness_m: float) -> Rotor:
    """The rotor with a chord of `TIP_CHORD` times a thickness where its tip is narrower; smooth, from r/R 0.6 on."""
    blade, least = rotor.blade, TIP_CHORD * thickness_m
    r = np.unique(np.r_[blade.r, np.linspace(0.6, 1.0, 41) * blade.R])
    chord, beta, sweep, rake = blade._at(r).T
    wide = np.where(r < 0.6 * blade.R, chord, (chord**12 + least**12) ** (1.0 / 12.0))
    return replace(rotor, blade=replace(blade, r=r, chord=wide, beta=beta, sweep=sweep, rake=rake))


def _fine(rotor: Rotor, case: Case, request: Print) -> str:
    """Nozzle with which the rotor can be made, else what else to change."""
    fine = replace(request, min_thickness_mm=LINES * FINE_MM, nozzle_mm=None)
    if thickness_mm(fine) < thickness_mm(request):
        for one in (rotor, widened(rotor, 1e-3 * thickness_mm(fine))):
            try:
                build(one, None, Options(printed=_printed(fine, case.duct() is not None)))
            except GeometryError:
                continue
            return f"A {FINE_MM:g} mm nozzle does it: --nozzle-mm {FINE_MM:g}, {thickness_mm(fine):g} mm"
    return "A wider blade, or a larger rotor"


def _changes(case: Case, before: Rotor, after: Rotor, told: AsPrinted) -> Widened:
    """What the wider tip is, and what it costs at the case's point, in per cent of thrust and torque."""
    from bemt.rotors.case.prepare import prepare_case

    R = before.blade.R
    x = np.linspace(0.6, 1.0, 401)
    old, new = (rotor.blade.at(x * R)[0] for rotor in (before, after))
    where = float(x[int(np.argmax(new > 1.02 * old))])
    model, own = prepare_case(case), case.rotor()
    loads = []
    for rotor in (own, replace(after, blade=replace(after.blade, Rhub=own.blade.Rhub), rotation=own.rotation)):
        found = replace(model, rotor=rotor).solve(case.rpm, case.airspeed_m_s, case.air())
        loads.append((float(found.thrust_N[0]), float(found.torque_Nm[0])))
    thrust, torque = (100.0 * (b / a - 1.0) for a, b in zip(*loads, strict=True))
    tip = (1e3 * float(old[-1]), 1e3 * float(new[-1]))
    return Widened(tip_chord_mm=tip, wider_from_r_over_R=where, thrust_pct=thrust, torque_pct=torque, **vars(told))


def _mount(made: Printed) -> dict[str, Any]:
    """Hole and recess of the hub in mm."""
    pairs = {"recess_mm": made.recess, "hex_mm": made.hexagon}
    known = {name: (1e3 * width, 1e3 * depth) for name, (width, depth) in pairs.items() if width > 0.0}
    return {"bore_mm": 1e3 * made.bore if made.bore > 0.0 else None, **known}


def _mount_text(printed: AsPrinted) -> str:
    """The hole for the shaft, or how to get one."""
    if printed.bore_mm is None:
        return f"! the hub is solid, without a hole for the shaft: --bore-mm 5, or --adapter {', '.join(ADAPTERS)}"
    more = ""
    for what, pair in (("a recess", printed.recess_mm), ("a hexagon for a nut", printed.hex_mm)):
        more += "" if pair is None else f"; {what} in the back, {pair[0]:.3g} mm wide and {pair[1]:.3g} mm deep"
    return f"hole for the shaft: {printed.bore_mm:.3g} mm{more}"


HANDS = {
    "right": "right hand: counterclockwise (CCW) seen from the front, as from above a multirotor; --hand left turns CW",
    "left": "left hand: clockwise (CW) seen from the front, as from above a multirotor; --hand right turns CCW",
    "both": "both hands: _right turns counterclockwise (CCW) seen from the front, as from above a multirotor, _left CW",
}


def printed_text(printed: AsPrinted) -> list[str]:
    """Lines for the terminal."""
    lines = [
        f"printed with a least thickness of {printed.least_thickness_mm:g} mm",
        _mount_text(printed),
        HANDS[printed.hand],
        "strength and highest speed are not judged: bemt design keeps a blade within the strength of its material",
    ]
    if (hub := printed.hub_by_ratio_mm) is not None:
        lines.insert(1, f"its hub of {hub:.3g} mm follows from hub_ratio in the case; yours: --hub-diameter-mm")
    if isinstance(printed, Widened):
        old, new = printed.tip_chord_mm
        finer = f". A finer nozzle keeps it: --nozzle-mm {FINE_MM:g}" if old >= TIP_CHORD * LINES * FINE_MM else ""
        lines.append(
            f"the tip was too narrow for that: its chord is {new:.2g} mm instead of {old:.2g}, wider from r/R "
            f"{printed.wider_from_r_over_R:.2f}; thrust {printed.thrust_pct:+.1f} %, torque "
            f"{printed.torque_pct:+.1f} %{finer}"
        )
    return lines


# Solids: STL, OBJ, STEP, 3MF, and the air around a fan.
class StlExport(SolidExport):
    """STL, triangles."""

    id = "stl"
    title = "STL, triangles"
    source = "geometry.export"


class ObjExport(SolidExport):
    """OBJ, triangles."""

    id = "obj"
    title = "OBJ, triangles"
    source = "geometry.export"


class StepExport(SolidExport):
    """STEP, surfaces of CAD."""

    id = "step"
    title = "STEP, surfaces of CAD"
    source = "geometry.export"


class ThreeMfExport(SolidExport):
    """3MF, triangles in millimetres for slicers."""

    id = "3mf"
    title = "3MF, triangles for slicers"
    source = "geometry.export"


class FlowTable(Table):
    """What may be asked of the air around a rotor."""

    far_field_over_D: float | None = entry("width of the box over the diameter of the rotor", "", 3, 200)


class FlowExport(SolidExport):
    """A box less rotor, duct and vanes; boundaries are picked by name."""

    id = "flow"
    title = "STEP of the air around, boundaries named"
    source = "geometry.cad.flow_domain; read by gmsh with Geometry.OCCImportLabels"
    options = FlowTable
    uses = frozenset(FlowTable.named())


class ZoneExport(SolidExport):
    """A cylinder round the rotor for a rotating zone: MRF, sliding mesh."""

    id = "zone"
    title = "STEP and STL of the zone that turns, faces named"
    source = "geometry.cad.rotating_zone"

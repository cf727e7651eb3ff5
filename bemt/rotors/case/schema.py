"""What a case file may hold: the typed models of ``bemt.case/1``, units in the key names, ranges, suspicious values.

A length that may be written in several units is one property in metres (``rotor.diameter_m``); whichever key the file
uses, exactly one of :data:`GROUPS` is given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bemt.base.toml import Axis, FieldLimits, Table, axis_values, entry, expected, shown
from bemt.physics import k1k2
from bemt.physics.air import LIQUID
from bemt.physics.sections.rule import DRAG_LEVEL, N_CRIT
from bemt.physics.wake import MOUNT_DRAG, SWIRL, WAKE_RADIUS
from bemt.rotors.case.drive_schema import DriveTable
from bemt.rotors.latents import KNOWN_FROM
from geometry.laws import CHORD_LAWS as GEOMETRY_CHORD_LAWS

CHORD_LAWS = tuple(GEOMETRY_CHORD_LAWS)
INCH = 0.0254
_HEAVIEST = 10.0  # of a gas [kg/m3]
Suspect = Callable[[float], str]


def _looks(*rules: tuple[float, float, str, Callable[[float], float], str]) -> Suspect:
    """Build a hint maker from (low, high, unit that it looks like, conversion, key) rules."""

    def suspect(value: float) -> str:
        for low, high, unit, convert, key in rules:
            if low <= value <= high:
                return f"Looks like {unit}: write {key} = {convert(value):.6g}"
        return ""

    return suspect


def _inch(key: str, limit: float) -> Suspect:
    return _looks((limit, 1e5, "millimetres", lambda v: v / 25.4, key))


def _metres(key: str, limit: float) -> Suspect:
    return _looks((1e-9, limit, "metres", lambda v: v * 1e3, key))


def _percent(key: str, low: float = 1.0) -> Suspect:
    return _looks((low, 1000.0, "percent", lambda v: v / 100.0, key))


RPM = FieldLimits("rev/min", 10, 300_000, _looks((1e-9, 9.999, "rev/s", lambda v: v * 60, "rpm")))
AIRSPEED = FieldLimits("m/s", -100, 300, _looks((300.1, 1100, "km/h", lambda v: v / 3.6, "airspeed_m_s")))
ANGLE = FieldLimits("deg", 0, 180)
_DENSITY = FieldLimits("kg/m3", 0.01, LIQUID[1], _looks(
    (1100.01, 1500, "g/m3", lambda v: v / 1000, "density_kg_m3"),
    (0.0755, 0.0775, "lb/ft3", lambda v: v * 16.018463, "density_kg_m3"),
    (0.00235, 0.0024, "slug/ft3", lambda v: v * 515.37882, "density_kg_m3")))  # fmt: skip
_ALTITUDE = FieldLimits("m", -500, 20_000, _looks((20_000.1, 70_000, "feet", lambda v: v * 0.3048, "altitude_m")))
_TEMPERATURE = FieldLimits("C", -60, 60, _looks(
    (180, 340, "kelvin", lambda v: v - 273.15, "temperature_C"),
    (60.1, 140, "degrees Fahrenheit", lambda v: (v - 32) / 1.8, "temperature_C")))  # fmt: skip
_PRESSURE = FieldLimits("hPa", 50, 1200, _looks(
    (5000, 120_000, "pascals", lambda v: v / 100, "pressure_hPa"),
    (0.5, 1.2, "bar", lambda v: v * 1000, "pressure_hPa"),
    (25, 32, "inches of mercury", lambda v: v * 33.86389, "pressure_hPa")))  # fmt: skip
_PITCH_IN = FieldLimits("in", 0.1, 120, _inch("pitch_in", 120.1))
_DIAMETER_IN = FieldLimits("in", 0.5, 200, _inch("diameter_in", 200.1))
_GAP = FieldLimits("mm", 0, 50, _metres("tip_gap_mm", 0.005))
_FRACTION_OF_HUMIDITY = _looks((1e-9, 0.999, "a fraction", lambda v: v * 100, "humidity_pct"))
FILE = "the name of a file in the folder of the case"

BladeClass = Literal["electric", "slow_flyer", "multirotor", "folding", "sport", "fpv", "reversible", "pattern"]
KnownFrom = Literal["cad", "scan", "stations", "label", "measured", "reference"]
Rotations = Literal["right", "left"]
Numbers = float | tuple[float, ...] | None
Texts = str | tuple[str, ...] | None


def _metres_of(inch: float | None, millimetre: float | None, metre: float | None = None) -> float:
    """Length in metres of whichever unit is given, else NaN."""
    for value, factor in ((inch, INCH), (millimetre, 1e-3), (metre, 1.0)):
        if value is not None:
            return value * factor
    return math.nan


class RotorTable(Table):
    """[rotor]: rotor and hub."""

    kind: Literal["propeller", "fan"] = entry("open rotor or fan; fan if there is a duct table", default="propeller")
    blades: int = entry("number of blades", low=1, high=64, required=True)
    diameter_in: float | None = entry("tip diameter", _DIAMETER_IN)
    diameter_mm: float | None = entry("tip diameter", "mm", 10, 6000, _metres("diameter_mm", 6.0))
    diameter_m_: float | None = entry("tip diameter", "m", 0.01, 6, alias="diameter_m")
    hub_ratio: float | None = entry("hub radius over tip radius", "", 0.01, 0.95, _percent("hub_ratio", 5.0))
    hub_diameter_mm: float | None = entry("hub diameter", "mm", 0.5, 3000, _metres("hub_diameter_mm", 0.499))
    hub_diameter_in: float | None = entry("hub diameter", "in", 0.02, 120)
    spinner_mm: float = entry("length of the nose ahead of the hub; 0: flat face", "mm", 0, 3000, default=0.0)
    rotation: Rotations = entry("sense of rotation, seen from behind", default="right")

    @property
    def diameter_m(self) -> float:
        """Tip diameter. [m]"""
        return _metres_of(self.diameter_in, self.diameter_mm, self.diameter_m_)

    @property
    def hub_diameter_m(self) -> float:
        """Hub diameter. [m]"""
        if self.hub_ratio is not None:
            return self.hub_ratio * self.diameter_m
        return _metres_of(self.hub_diameter_in, self.hub_diameter_mm)


class SectionTable(Table):
    """[blade.section]: one section, or one per r_over_R."""

    naca: Texts = entry("NACA digits, such as 4412")
    dat: Texts = entry("coordinate files in the folder of the case")
    camber: float | tuple[float, ...] = entry(
        "maximum camber", "of the chord", -0.2, 0.2, _percent("camber", 0.9), default=0.0
    )
    camber_position: float | tuple[float, ...] = entry(
        "position of maximum camber", "of the chord", 0.1, 0.8, _percent("camber_position"), default=0.4
    )
    thickness: Numbers = entry("maximum thickness", "of the chord", 0.01, 0.5, _percent("thickness", 1.5))
    camber_scale: float = entry("factor on the camber", "", 0, 5, default=1.0)
    thickness_scale: float = entry("factor on the thickness", "", 0.1, 5, default=1.0)
    r_over_R: tuple[float, ...] | None = entry("radii of the lists above", "", 0, 1, _percent("r_over_R", 2.0))


class AsBuiltTable(Table):
    """[blade.as_built]: what is known about this rotor beyond its drawing: expected values and standard deviations."""

    angle_deg: float | None = entry("expected blade angle minus the drawn one", "deg", -20, 20)
    angle_sd_deg: float | None = entry("its standard deviation", "deg", 0, 20)
    camber_deg: float | None = entry("expected reduction of the zero-lift angle", "deg", -20, 20)
    camber_sd_deg: float | None = entry("its standard deviation", "deg", 0, 20)
    lift: float | None = entry("expected change of ln(cl)", "", -1, 1)
    lift_sd: float | None = entry("its standard deviation", "", 0, 1, _percent("lift_sd"))
    drag: float | None = entry("expected change of ln(cd)", "", -2, 2)
    drag_sd: float | None = entry("its standard deviation", "", 0, 2, _percent("drag_sd", 2.0))
    file: str | None = entry("posterior that calibrate-rotor wrote", words=FILE)
    measured: str | None = entry("measured propeller that bemt knows, such as gwsdd_9x5")
    reading: str | None = entry("reading of this rotor, such as rpm=5400, thrust_g=410; more behind semicolons")


class BladeTable(Table):
    """[blade]: pitch and chord from a law or a station file, and how well they are known."""

    pitch_in: float | None = entry("advance per revolution", _PITCH_IN)
    pitch_mm: float | None = entry("advance per revolution", "mm", 2.5, 3000, _metres("pitch_mm", 2.0))
    pitch_ratio: float | None = entry("advance per revolution over diameter", "", 0.01, 10)
    pitch_law: Literal["helix", "tip_relieved"] = entry("pitch law along the radius", default="helix")
    tip_relief: float | None = entry(
        "share by which the pitch is reduced at the tip, with tip_relieved", "", 0, 0.6, _percent("tip_relief")
    )
    chord_law: str | None = entry("chord law along the radius", choices=CHORD_LAWS)
    max_chord_over_R: float | None = entry(
        "maximum chord", "of the tip radius", 0.005, 2, _percent("max_chord_over_R", 3.0)
    )
    taper: float | None = entry("tip over root chord, with linear_taper", "", 0.05, 3)
    chord_scale: float = entry("factor on every chord", "", 0.1, 10, _percent("chord_scale", 20.0), default=1.0)
    stations: str | None = entry(
        "CSV r_over_R,chord_over_R,beta_deg; r and chord may be lengths, such as r_mm", words=FILE
    )
    uiuc: str | None = entry("UIUC geometry file", words=FILE)
    apc: str | None = entry("APC PE0 file", words=FILE)
    beta_offset_deg: float = entry("rotation of the whole blade", "deg", -45, 45, default=0.0)
    tip_sweep_mm: float = entry(
        "offset of the tip in the plane of rotation, positive backwards; for geometry, not for loads",
        "mm", -2000, 2000, default=0.0,
    )  # fmt: skip
    tip_rake_mm: float = entry(
        "offset of the tip along the shaft, positive downstream; for geometry, not for loads",
        "mm", -2000, 2000, default=0.0,
    )  # fmt: skip
    sweep_from: float = entry("r/R from which sweep and rake grow, with the square of the distance", "", 0, 0.95,
                              default=0.3)  # fmt: skip
    known_from: KnownFrom | None = entry("source of the blade shape; sets its uncertainty", choices=KNOWN_FROM)
    label_pitch_in: float | None = entry(
        "pitch printed on the propeller", "in", 0.1, 120, _inch("label_pitch_in", 120.1)
    )
    family: str | None = entry("maker's series, such as apce or gwssf")
    class_: BladeClass | None = entry("kind of blade, as its label says", alias="class")
    as_built: AsBuiltTable | None = None
    section: SectionTable | None = None

    def pitch_m(self, diameter_m: float) -> float:
        """Advance per turn that the case states, NaN where it states none. [m]"""
        if self.pitch_ratio is not None:
            return self.pitch_ratio * diameter_m
        return _metres_of(self.pitch_in, self.pitch_mm)


class StatorTable(Table):
    """[duct.stator]: vanes behind the rotor."""

    blades: int = entry("number of vanes", low=1, high=64, required=True)
    chord_mm: float = entry("chord", "mm", 1, 1000, _metres("chord_mm", 0.999), required=True)
    angle_deg: float = entry("vane angle from the axis, for geometry and CFD", "deg", 0, 60, default=0.0)
    recovery: float | None = entry("share of the swirl that is recovered", "", 0, 1, _percent("recovery", 1.5))


class DuctTable(Table):
    """[duct]: the wall around the rotor."""

    inner_diameter_mm: float | None = entry("bore", "mm", 10, 6000, _metres("inner_diameter_mm", 6.0))
    inner_diameter_in: float | None = entry("bore", "in", 0.5, 240)
    tip_gap_mm: float | None = entry("gap between blade tip and wall", _GAP)
    length_mm: float = entry("length from inlet to exit", "mm", 1, 10_000, _metres("length_mm", 0.999), required=True)
    lip_radius_mm: float | None = entry("radius of the inlet lip; sharp if omitted", "mm", 0, 1000)
    lip_length_mm: float | None = entry("axial length of the lip's ellipse; its radius if omitted", "mm", 0.1, 10_000)
    outer_diameter_mm: float | None = entry(
        "largest diameter of the outer wall; a lip as thick outside as inside if omitted", "mm", 10, 8000
    )
    trailing_edge_mm: float | None = entry(
        "thickness of the wall at the exit; 2 % of the bore's radius if omitted", "mm", 0, 500
    )
    lip_loss: float | None = entry("loss coefficient of the inlet lip", "", 0, 1, _percent("lip_loss", 1.5))
    wall_friction: float | None = entry("skin friction coefficient of the walls", "", 0, 0.05)
    gap_loss: float | None = entry("pressure rise lost over itself, per tip gap over blade height", "", 0, 5)
    rotor_position_mm: float | None = entry(
        "distance of the rotor behind the inlet; a third of the length if omitted", "mm", -1000, 10_000
    )
    exit_area_ratio: float | None = entry(
        "exit area over swept annulus area", "", 0.3, 3, _percent("exit_area_ratio", 20.0)
    )
    exit_diameter_mm: float | None = entry("diameter of the exit", "mm", 5, 6000, _metres("exit_diameter_mm", 4.9))
    exit_hub_diameter_mm: float | None = entry(
        "diameter of the centre body at the exit; it ends there if omitted", "mm", 0, 6000
    )
    stator: StatorTable | None = None

    @property
    def inner_diameter_m(self) -> float:
        """Bore, NaN where the gap is given. [m]"""
        return _metres_of(self.inner_diameter_in, self.inner_diameter_mm)


class SecondRotorTable(Table):
    """[second_rotor]: a rotor downstream on the same axis, solved together with the first; both are open.

    Its blades are those of the first unless label or case says otherwise.
    """

    label: str | None = entry("label of another propeller, such as 10x5")
    case: str | None = entry("case file of another propeller, or its folder")
    spacing_mm: float | None = entry("distance of the two disks", "mm", 0, 20_000, _metres("spacing_mm", 0.999))
    z_over_D: float | None = entry("distance of the two disks over the diameter of the first", "", 0, 20)
    turns: Literal["opposite", "same"] = entry("sense of rotation against that of the first", default="opposite")
    rpm_ratio: float | None = entry("its speed over that of the first; 1 if no speed is given", "", 0.1, 10)
    rpm: float | None = entry("its speed, whatever that of the first", RPM)
    torque_balance: bool = entry("let it turn at the speed at which both torques are equal", default=False)
    wake_radius: float = entry(
        "radius of the developed wake of the first rotor in hover over its own", "", 0.7071, 1, default=WAKE_RADIUS
    )
    interference: float = entry("factor on what the rotors induce at each other", "", 0, 2, default=1.0)
    swirl: float = entry(
        "share of the first rotor's swirl that reaches it", "", 0, 1, _percent("swirl", 1.5), default=SWIRL
    )

    mount_drag: float = entry(
        "drag of what carries it in the wake of the first rotor, over the thrust of that one",
        "",
        0,
        0.5,
        default=MOUNT_DRAG,
    )

    def spacing_m(self, diameter_m: float) -> float:
        """Distance of the disks, for the diameter of the first rotor [m]. [m]"""
        return 1e-3 * self.spacing_mm if self.spacing_mm is not None else (self.z_over_D or 0.0) * diameter_m

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One geometry, one speed; balanced torques need opposite senses."""
        if self.label is not None and self.case is not None:
            yield "label", "a label and a case", "one of them"
        speeds = [k for k in ("rpm_ratio", "rpm") if getattr(self, k) is not None] + ["torque_balance"] * (
            self.torque_balance
        )
        if len(speeds) > 1:
            yield speeds[0], " and ".join(speeds), "only one of rpm_ratio, rpm, torque_balance"
        if self.torque_balance and self.turns == "same":
            yield "torque_balance", "true for rotors that turn alike", 'false, or turns = "opposite"'


class OperatingTable(Table):
    """[operating]: operating point of the case."""

    rpm: float = entry("speed of rotation", RPM, required=True)
    airspeed_m_s: float = entry("flight speed, along the shaft unless angle_deg is given", AIRSPEED, default=0.0)
    angle_deg: float = entry("angle between wind and shaft: 0 climb, 90 edgewise, 180 descent", ANGLE, default=0.0)


class PointTable(Table):
    """An operating point that is asked for beside that of the case."""

    rpm: float | None = entry("speed of rotation", RPM)
    airspeed_m_s: float | None = entry("speed of flight", replace(AIRSPEED, low=0.0))  # backward flight has no inlet


class AirTable(Table):
    """[air]: density, or altitude, or pressure with temperature and humidity; or water."""

    density_kg_m3: float | None = entry("density", _DENSITY)
    altitude_m: float | None = entry("altitude in the standard atmosphere", _ALTITUDE)
    pressure_hPa: float | None = entry("static pressure", _PRESSURE)
    temperature_C: float | None = entry("temperature", _TEMPERATURE)
    humidity_pct: float | None = entry("relative humidity, with pressure", "%", 0, 100, _FRACTION_OF_HUMIDITY)
    fluid: Literal["water"] | None = entry("a liquid instead of air; with temperature_C")
    salinity_g_kg: float | None = entry("salt, with fluid", "g/kg", 0, 45)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Pressure goes with temperature, humidity with pressure, salt with water."""
        if self.pressure_hPa is not None and self.temperature_C is None:
            yield "temperature_C", "nothing", f"{expected(float, _TEMPERATURE)}, because pressure_hPa is given"
        if self.salinity_g_kg is not None and self.fluid is None:
            yield "salinity_g_kg", shown(self.salinity_g_kg), 'nothing without fluid = "water"'
        if self.density_kg_m3 is not None and _HEAVIEST < self.density_kg_m3 < LIQUID[0]:
            yield "density_kg_m3", shown(self.density_kg_m3), "0.01 to 10 kg/m3, or 900 to 1100 for water"
        if self.fluid is not None and (self.temperature_C or 0.0) < 0.0:
            yield "temperature_C", shown(self.temperature_C), "0 to 60 C, water"
        if self.humidity_pct is not None and self.pressure_hPa is None:
            yield "humidity_pct", shown(self.humidity_pct), "nothing without pressure_hPa"


class ModelTable(Table):
    """[model]: active effects, section tables, blade elements."""

    effects_on: tuple[str, ...] = entry("effects to switch on, as name or name(parameter=value)", default=())
    effects_off: tuple[str, ...] = entry("effects to switch off", default=())
    also_without: tuple[str, ...] = entry("effects that the sweep also shows switched off", default=())
    n_crit: float = entry("critical amplification factor (e^N transition)", "", 0.1, 14, default=N_CRIT)
    drag_level: float = entry(
        "factor on the profile drag of the section rule", "", 0.3, 3, _percent("drag_level", 20.0), default=DRAG_LEVEL
    )
    stations: int = entry("number of blade elements", low=5, high=1000, default=40)
    K1: float = entry("of the K1/K2 column", "", 0.01, 10, default=k1k2.K1)
    K2: float = entry("its exponent", "", 0.1, 5, default=k1k2.K2)
    u_K1K2: float = entry("its relative u", "", 0, 5, default=k1k2.U_MEASURED)


class SweepTable(Table):
    """[sweep]: axes of a parameter grid, as lists or {start, stop, num}."""

    rpm: Axis = entry("speeds of rotation", RPM)
    airspeed_m_s: Axis = entry("flight speeds", AIRSPEED)
    angle_deg: Axis = entry("angles between wind and shaft", ANGLE)
    altitude_m: Axis = entry("altitudes", _ALTITUDE)
    density_kg_m3: Axis = entry("densities", _DENSITY)
    temperature_C: Axis = entry("temperatures", _TEMPERATURE)
    pitch_in: Axis = entry("pitches", _PITCH_IN)
    diameter_in: Axis = entry("diameters", _DIAMETER_IN)
    tip_gap_mm: Axis = entry("tip gaps", _GAP)
    z_over_D: Axis = entry("distances of a second rotor over the diameter", FieldLimits("", 0, 20))

    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Axes: name (with its unit) to values, (N,)."""
        return {name: axis_values(axis) for name, axis in self.given().items() if axis is not None}


class AssumptionTable(Table):
    """[[assumptions]]: a value that the source does not give, with its range."""

    key: str = entry("dotted key of the value, such as rotor.hub_ratio", required=True)
    low: float | None = entry("lower limit, in the unit of the key")
    high: float | None = entry("upper limit")
    values: tuple[Any, ...] | None = entry("all possible values, instead of low and high")
    why: str = entry("source of value and range", required=True)


class PolarTable(Table):
    """[[polars]]: your own section table."""

    file: str = entry("table of lift and drag", required=True, words=FILE)
    r_over_R: float = entry("radius of the section", "", 0, 1, _percent("r_over_R", 2.0), required=True)
    format: Literal["csv", "xfoil", "c81"] | None = entry("file format; detected from the content if omitted")


class CaseFile(Table):
    """A whole case file."""

    schema_: Literal["bemt.case/1"] = entry("version of the format", required=True, alias="schema")
    name: str = entry("name of the result folder: letters, digits, dot, dash, underscore", required=True)
    title: str = entry("one-line title", default="")
    notes: str = entry("free text", default="")
    origin: str = entry("source of the case", default="")
    references: str | None = entry("recorded values", words=FILE)
    rotor: RotorTable
    blade: BladeTable
    duct: DuctTable | None = None
    operating: OperatingTable
    air: AirTable
    second_rotor: SecondRotorTable | None = None
    drive: DriveTable | None = None
    model: ModelTable = ModelTable()
    sweep: SweepTable = SweepTable()
    assumptions: tuple[AssumptionTable, ...] = ()
    polars: tuple[PolarTable, ...] = ()


AXES = {
    "rpm": "operating.rpm", "airspeed_m_s": "operating.airspeed_m_s", "angle_deg": "operating.angle_deg",
    "altitude_m": "air.altitude_m", "density_kg_m3": "air.density_kg_m3", "temperature_C": "air.temperature_C",
    "pitch_in": "blade.pitch_in", "diameter_in": "rotor.diameter_in", "tip_gap_mm": "duct.tip_gap_mm",
    "z_over_D": "second_rotor.z_over_D",
}  # fmt: skip
"""Sweep axis to the dotted key that it changes."""

GROUPS: tuple[tuple[str, tuple[str, ...], bool], ...] = (
    ("rotor", ("diameter_in", "diameter_mm", "diameter_m"), True),
    ("rotor", ("hub_ratio", "hub_diameter_mm", "hub_diameter_in"), True),
    ("blade", ("chord_law", "stations", "uiuc", "apc"), True),
    ("blade", ("pitch_in", "pitch_mm", "pitch_ratio"), False),
    ("blade.section", ("naca", "dat", "thickness"), True),
    ("duct", ("tip_gap_mm", "inner_diameter_mm", "inner_diameter_in"), True),
    ("duct", ("exit_area_ratio", "exit_diameter_mm"), True),
    ("second_rotor", ("spacing_mm", "z_over_D"), True),
    ("air", ("density_kg_m3", "altitude_m", "pressure_hPa", "fluid"), True),
)
"""(table, keys, required): at most one of the keys may be given, exactly one when required."""

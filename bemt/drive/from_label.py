"""What a motor makes of a propeller when its K_v and the battery are all that is known, each number with its band.

The motor's resistance and no-load current are not on its label. What is known of them is how loaded motors are in use:
the share of the voltage that the winding takes, and the share of the current that friction and iron take, both near
full throttle. Their medians and 68 % ranges are of 3582 points with a propeller, measured on 1088 motors and collected
by Drive Calculator (direct drive, 4 to 20 in, more than 0.5 A). The propeller's unknowns are those of its case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.face import as_html
from bemt.base.tables import number_text
from bemt.base.units import INCH, KGF
from bemt.case import Case
from bemt.case.propagate import spread
from bemt.drive import mission, rotor_table
from bemt.drive.drive_model import Battery, Drive, Esc, Motor

SCHEMA = "bemt.drive.estimate/1"
TIPS = (126.0, 190.0, 218.0, 310.0)
"""Tip speed of K_v times the loaded voltage, without load: 68 % of those 1088 motors; 95 % and 99 % below. [m/s]"""
HOVER_SHARE = 0.5
"""Hover point as a share of full thrust where no mass is given: a thrust-to-weight ratio of 2."""
SOC, SOC_MIN = 0.5, 0.2
"""Charge at which full throttle and hover are stated, and charge at which a flight ends. [-]"""


@dataclass(frozen=True)
class DriveUnknown:
    """Number that a label does not give, with the range that holds 68 % of a population, or was declared."""

    nominal: float
    low: float
    high: float
    what: str
    source: str


_USED = "3582 points of 1088 motors with a propeller, Drive Calculator"
POPULATION: Mapping[str, DriveUnknown] = {
    "winding_drop": DriveUnknown(0.14, 0.07, 0.24, "share of the voltage lost in the winding of the motor", _USED),
    "idle_share": DriveUnknown(0.073, 0.049, 0.11, "share of the current lost to friction and iron losses", _USED),
    "battery_sag": DriveUnknown(
        0.06, 0.03, 0.10, "share of its voltage that the pack loses at full throttle", "declared"
    ),
    "model_thrust": DriveUnknown(1.0, 0.93, 1.07, "thrust of a real propeller over BEMT", "UIUC volume 1, static"),
    "model_torque": DriveUnknown(1.0, 0.90, 1.10, "torque of a real propeller over BEMT", "UIUC volume 1, static"),
}
MOTOR = ("winding_drop", "idle_share")
"""What a motor sheet tells."""


@dataclass(frozen=True)
class Band:
    """Value with its standard uncertainty, and that which would be left with a motor sheet."""

    value: float
    u: float
    u_with_sheet: float


@dataclass(frozen=True, eq=False)
class DriveEstimate:
    """Full throttle and hover of one rotor; NaN where the drive does not get there.

    Parameters
    ----------
    label : str
        Name of the case.
    given : mapping
        What was told.
    full, hover : mapping of str to Band
        ``rpm``, ``thrust_N``, ``battery_A``, ``power_W``, ``g_per_W`` and, in hover, ``throttle`` [-] and
        ``minutes`` (of the capacity, or per A h where none is given).
    unknowns : mapping of str to str
        What was varied, and how far.
    notes : tuple of str
        What does not fit.

    Examples
    --------
    >>> import bemt
    >>> found = bemt.drive("10x5", kv=1000, cells=3, mass_kg=1.2, rotors=4)
    >>> found.reached, 0.3 < found.hover["throttle"].value < 0.8, found.to_dict()["schema"]
    (True, True, 'bemt.drive.estimate/1')
    >>> print(found.text.splitlines()[0])
    prop_10x5, 1000 rev/min/V, 3S at 50% charge, ± one standard deviation
    """

    label: str
    given: Mapping[str, Any]
    full: Mapping[str, Band]
    hover: Mapping[str, Band]
    unknowns: Mapping[str, str]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Say what is known in a line."""
        given, thrust = self.given, self.full["thrust_N"]
        return f"<drive of {self.label}: {given['kv_rpm_V']:g} rev/min/V, {given['cells']}S, {_shown(thrust, 'N')}>"

    def _repr_html_(self) -> str:
        """Show the estimate in a notebook."""
        return as_html(repr(self)[1:-1], self.text)

    @property
    def text(self) -> str:
        """The estimate for a terminal."""
        return text(self)

    @property
    def reached(self) -> bool:
        """Whether the hover point is within the drive."""
        return math.isfinite(self.hover["power_W"].value)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ``bemt.drive.estimate/1``; thrust over power in gf/W."""
        parts = {name: {k: vars(b) for k, b in getattr(self, name).items()} for name in ("full", "hover")}
        return {"schema": SCHEMA, "case": self.label, "given": dict(self.given), **parts,
                "unknowns": dict(self.unknowns), "notes": list(self.notes)}  # fmt: skip


def _check(
    kv: float, cells: int, mass_kg: float | None, rotors: int, capacity_Ah: float | None, airspeed_m_s: float
) -> None:
    rows: tuple[tuple[str, float | None, float, float, str, str], ...] = (
        ("--kv", kv, 20.0, 30000.0, "rev/min/V", "That is rev/min per volt, as printed on the motor"),
        ("--cells", cells, 1, 24, "LiPo cells in series", "4S is --cells 4"),
        ("--mass", mass_kg, 0.005, 1000.0, "kg", "In grams? Divide by 1000"),
        ("--rotors", rotors, 1, 64, "rotors", ""),
        ("--capacity", capacity_Ah, 0.05, 200.0, "A h", "In mAh? Divide by 1000"),
        ("--airspeed", airspeed_m_s, 0.0, 150.0, "m/s", ""),
    )
    faults = [
        Fault("", name, f"{value:g}", f"{low:g} to {high:g} {unit}", hint)
        for name, value, low, high, unit, hint in rows
        if value is not None and not low <= value <= high
    ]
    for name, count in (("--cells", cells), ("--rotors", rotors)):
        if math.isfinite(count) and count != int(count):
            faults.append(Fault("", name, f"{count:g}", "a whole number"))
    if faults:
        raise InputError(faults)


def estimate(
    case: Case,
    kv: float,
    cells: int,
    mass_kg: float | None = None,
    rotors: int = 1,
    capacity_Ah: float | None = None,
    airspeed_m_s: float = 0.0,
) -> DriveEstimate:
    """Solve the drive at the middle of every unknown and at its ends; impossible numbers are refused."""
    _check(kv, cells, mass_kg, rotors, capacity_Ah, airspeed_m_s)
    open_V = float(Battery(cells, 0.0).voc(1.0))

    def table(changed: Case) -> rotor_table.RotorMap:
        return rotor_table.from_case(changed, 1.02 * kv * open_V, airspeed_m_s, changed.air())

    rotor = table(case)
    middle = {name: u.nominal for name, u in POPULATION.items()}
    nominal = _answers(_drive(rotor, kv, cells, rotors, capacity_Ah, middle), mass_kg, rotors, capacity_Ah)
    variance = {key: 0.0 for key in nominal}
    with_sheet = dict(variance)

    def add(name: str, discrete: bool, runs: list[dict[str, float]]) -> None:
        for key, value in nominal.items():
            u = float(spread(discrete, np.array(value), [np.array(run[key]) for run in runs]))
            variance[key] += u**2
            with_sheet[key] += 0.0 if name in MOTOR else u**2

    for name, unknown in POPULATION.items():
        runs = []
        for end in (unknown.low, unknown.high):
            drive = _drive(rotor, kv, cells, rotors, capacity_Ah, {**middle, name: end})
            runs.append(_answers(drive, mass_kg, rotors, capacity_Ah))
        # the ends are those of 68 %: half their difference is the standard uncertainty, not that of a uniform range
        add(name, True, runs)
    motor = _drive(rotor, kv, cells, rotors, capacity_Ah, middle)
    for item in case.assumptions:
        drives = [
            motor if v == item.nominal else replace(motor, rotor=table(case.replaced({item.key: v})))
            for v in item.values
        ]
        add(item.key, item.discrete, [_answers(d, mass_kg, rotors, capacity_Ah) for d in drives])
    bands = {key: Band(value, math.sqrt(variance[key]), math.sqrt(with_sheet[key])) for key, value in nominal.items()}
    given = {"kv_rpm_V": kv, "cells": cells, "mass_kg": mass_kg, "rotors": rotors, "capacity_Ah": capacity_Ah,
             "airspeed_m_s": airspeed_m_s, "soc": SOC, "resistance_mohm": 1e3 * motor.motor.resistance_ohm,
             "no_load_A": motor.motor.no_load_A, "battery_mohm": 1e3 * motor.battery.resistance_ohm}  # fmt: skip
    parts = {
        head: {key.partition(".")[2]: b for key, b in bands.items() if key.startswith(head)}
        for head in ("full", "hover")
    }
    unknowns = {name: f"{u.low:g} to {u.high:g} ({u.what}; {u.source})" for name, u in POPULATION.items()}
    unknowns |= {item.key: item.range_text for item in case.assumptions}
    return DriveEstimate(case.name, given, parts["full"], parts["hover"], unknowns, _notes(case, kv, cells, nominal))


def _drive(
    rotor: rotor_table.RotorMap,
    kv: float,
    cells: int,
    rotors: int,
    capacity_Ah: float | None,
    unknown: Mapping[str, float],
) -> Drive:
    """Drive whose losses at full throttle are the shares that are assumed."""
    scaled = replace(
        rotor,
        thrust_law=_times(rotor.thrust_law, unknown["model_thrust"]),
        torque_law=_times(rotor.torque_law, unknown["model_torque"]),
    )
    volts = float(Battery(cells, 0.0).voc(SOC))
    loaded = volts * (1.0 - unknown["battery_sag"])
    speed = kv * loaded * (1.0 - unknown["winding_drop"]) * math.pi / 30.0
    # of the propeller that BEMT gives: the motor is what it is, whatever the model's error
    amps = float(rotor.torque(speed)) * kv * math.pi / 30.0 / (1.0 - unknown["idle_share"])
    amps = max(amps, 1e-3)
    capacity = math.nan if capacity_Ah is None else capacity_Ah / rotors
    return Drive(
        Battery(cells, volts * unknown["battery_sag"] / amps, capacity),
        Esc(),
        Motor(kv, loaded * unknown["winding_drop"] / amps, unknown["idle_share"] * amps),
        scaled,
    )


def _times(law: Callable[[Any], Any], factor: float) -> Callable[[Any], Any]:
    return lambda w: factor * law(w)


def _answers(drive: Drive, mass_kg: float | None, rotors: int, capacity_Ah: float | None) -> dict[str, float]:
    """Full throttle and hover."""
    full = drive.steady(drive.esc.pulse_max_us, SOC)
    out = {f"full.{key}": float(getattr(full, key)[0]) for key in ("rpm", "thrust_N", "battery_A", "power_W")}
    out["full.g_per_W"] = 1e3 * out["full.thrust_N"] / KGF / out["full.power_W"]
    mass = HOVER_SHARE * out["full.thrust_N"] / KGF if mass_kg is None else mass_kg / rotors
    h = mission.hover(drive, mass, 1, SOC)
    out |= {
        "hover.thrust_N": h.wanted_N,
        "hover.rpm": h.rpm,
        "hover.battery_A": h.battery_A,
        "hover.power_W": h.power_W,
        "hover.g_per_W": h.g_per_W,
        "hover.throttle": (h.pulse_us - drive.esc.pulse_min_us) / 1000.0,
    }
    if capacity_Ah is None:
        out["hover.minutes"] = 60.0 * (1.0 - SOC_MIN) / (h.battery_A * rotors)
    else:
        out["hover.minutes"] = mission.endurance(drive, mass, 1, 1.0, SOC_MIN)[0] / 60.0
    return out


def _notes(case: Case, kv: float, cells: int, nominal: Mapping[str, float]) -> tuple[str, ...]:
    notes = []
    loaded = float(Battery(cells, 0.0).voc(SOC)) * (1.0 - POPULATION["battery_sag"].nominal)
    per_m = math.pi * kv * loaded / 60.0
    tips = case.diameter_m * per_m
    if tips > TIPS[2] and not case.ducted:
        fit = [v / per_m / INCH for v in TIPS[:2]]
        rare = tips > TIPS[3]
        slower = [v / (math.pi * case.diameter_m * loaded) * 60.0 for v in TIPS[:2]]
        first = "unusual combination" if rare else "fast combination"
        notes.append(
            f"{first}: without load the tip speed would be {tips:.0f} m/s; 95 % of 1088 recorded motors are below "
            f"{TIPS[2]:.0f}.\n  {kv:g} rev/min/V on {cells}S suits propellers of {fit[0]:.1f} to {fit[1]:.1f} in; a "
            f"propeller of {case.diameter_m / INCH:.3g} in suits {slower[0]:.0f} to {slower[1]:.0f} rev/min/V.\n  "
            + (
                "A typical motor would overload and burn out; the numbers assume a motor that is large enough."
                if rare
                else "This is common for racing; the motor gets hot at full throttle."
            )
        )
    mach = math.pi * case.diameter_m * nominal["full.rpm"] / 60.0 / case.air().a_sound
    if mach > 0.8:
        notes.append(f"tip Mach number {mach:.2f}: beyond the range of the section tables")
    return tuple(notes)


def _shown(band: Band, unit: str, scale: float = 1.0) -> str:
    value, u = band.value * scale, band.u * scale
    if not math.isfinite(value):
        return "-"
    if u == 0.0:
        return f"{number_text(value)} {unit}"
    digits = max(0, 1 - math.floor(math.log10(u)))
    digits = min(digits, 2)
    if u >= 100.0:
        value, u, digits = round(value, -1), round(u, -1), 0
    return f"{value:.{digits}f} ± {u:.{digits}f} {unit}"


def text(found: DriveEstimate) -> str:
    """Lay an estimate out: one screen."""
    given, full, hover = found.given, found.full, found.hover
    pack = f"{given['cells']}S at {found.given['soc']:.0%} charge"
    lines = [f"{found.label}, {given['kv_rpm_V']:g} rev/min/V, {pack}, ± one standard deviation"]
    lines += [*(f"! {note}" for note in found.notes), ""]
    told = given["mass_kg"] is not None
    where = f"hover of {given['mass_kg']:g} kg" if told else "half of that thrust"
    one = " (one rotor)" if given["rotors"] > 1 else ""
    lines.append(f"{'':<12}{'full throttle' + one:<28}{where + one}")
    rows = (
        ("speed", "rpm", "rev/min", 1.0),
        ("thrust", "thrust_N", "N", 1.0),
        ("", "thrust_N", "gf", 1e3 / KGF),
        ("current", "battery_A", "A", 1.0),
        ("power", "power_W", "W", 1.0),
        ("", "g_per_W", "gf/W", 1.0),
    )
    lines += [f"{name:<12}{_shown(full[key], unit, k):<28}{_shown(hover[key], unit, k)}" for name, key, unit, k in rows]
    lines.append(f"{'throttle':<12}{'100 %':<28}{_shown(hover['throttle'], '%', 100.0)}")
    if not found.reached:
        lines.append(
            f"no hover: each rotor needs {hover['thrust_N'].value:.1f} N; its maximum is {full['thrust_N'].value:.1f} N"
        )
    else:
        aloft = "min" if given["capacity_Ah"] is not None else "min per A h of capacity"
        lines.append(f"{'flight time':<12}{'':<28}{_shown(hover['minutes'], aloft)}")
    a, b = (1e2 * v / full["battery_A"].value for v in (full["battery_A"].u, full["battery_A"].u_with_sheet))
    lines += [
        "",
        f"assumed: winding {given['resistance_mohm']:.0f} mohm, no-load current {given['no_load_A']:.2g} A: typical of "
        "such motors.",
        f"With both from the motor's sheet the current is known to {b:.0f} % instead of {a:.0f} %: write a",
        "case with `bemt new`, enter them in its drive.toml and run `bemt drive` on it.",
    ]
    ask = [name for key, name in (("mass_kg", "--mass"), ("capacity_Ah", "--capacity")) if given[key] is None]
    if ask:
        lines.append(f"for more results give {' and '.join(ask)}")
    return "\n".join(lines) + "\n"

"""Real motors: a CSV of name, kv, resistance and no-load current, or those on sale; and what the parts weigh."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.base.given import path_text
from bemt.data.readers import load_text
from bemt.data.readers.split import decimal_mark, split_table
from bemt.rotors.case.motor import NamedMotor, motors_on_sale, named_motor, resistance_of_mass

# What a rotor's motor, propeller, controller and arm weigh: declared laws with their spread.
#
# * Motor from its greatest torque: 1341 direct-drive motors recorded by Drive Calculator with weight and three points
#   or more; torque (I - I_0)/K_v with the typical share of idle current. Scaling laws have an exponent of 3/3.5
#   (M. Budinger, A. Reysset, A. Ochotorena, S. Delbecq, Aerospace Sci. Technol. 98 (2020) 105658,
#   doi:10.1016/j.ast.2019.105658).
# * Propeller from its diameter: 17 APC propellers of 8 to 14 in, weights in APC's PE0 files; beyond them extrapolated.
#   Slow flyers weigh a half, glow-engine blades twice as much. More blades: 11x7 with three over that with two.
# * Controller from its input: 115 g at 3108 W (the reference of Budinger et al.; spread declared).
# * Arm: a carbon tube that bends under full thrust at a quarter of 280 MPa, and 347/140 of it as frame (the references
#   of S. Delbecq, M. Budinger et al., Aerospace Sci. Technol. 102 (2020) 105873, doi:10.1016/j.ast.2020.105873;
#   numbers as in the authors' public notebooks, the papers were not checked). Tubes from 10 mm with a wall of 1 mm:
#   declared.

MOTOR = (0.335, 0.79)
"""Mass at 1 N m [kg], and exponent of the torque [1]."""
PROPELLER = (0.336, 2.0)
"""Two blades: mass at 1 m [kg], and exponent of the diameter [1]."""
BLADES = 0.65  # Exponent of the number of blades [1]
ESC = 0.115 / 3108.0  # [kg/W]
ARM_PA, ARM_DENSITY, ARM_HOLLOW, FRAME = 70e6, 1700.0, 0.8, 0.347 / 0.14
ARM_LEAST_M = 0.01
SPREAD = {"motor": 0.25, "propeller": 0.33, "esc": 0.3, "arm": 0.5}
"""Standard deviations of the logarithms [1]."""
CLEARANCE = 1.05
"""Distance of neighbouring shafts over the diameter, at least: declared [1]."""
SHARE = 0.4
"""Share of a vehicle's mass with which the search for what is left of it begins: declared, 35 to 45 % of multirotors by
the laws above [1]."""


@dataclass(frozen=True)
class Masses:
    """Mass of one rotor's parts, (M,) each [kg]."""

    motor: Array
    propeller: Array
    esc: Array
    arm: Array

    @property
    def total(self) -> Array:
        """All parts. [kg]"""
        return self.motor + self.propeller + self.esc + self.arm

    @property
    def u(self) -> Array:
        """Standard uncertainty of the sum. [kg]"""
        return np.asarray(np.sqrt(sum((s * getattr(self, part)) ** 2 for part, s in SPREAD.items())))


def masses(
    torque_Nm: ArrayLike, power_W: ArrayLike, thrust_N: ArrayLike, diameter_m: float, blades: int, arm_m: float
) -> Masses:
    """Parts of one rotor from what it has at full throttle: torque, electrical power and thrust, (M,) each.

    >>> one = masses(0.3, 300.0, 12.0, 0.3, 2, 0.22)
    >>> [round(float(1e3 * v)) for v in (one.motor, one.propeller, one.esc, one.arm)]
    [129, 30, 11, 26]
    """
    Q, P, T = (np.maximum(np.nan_to_num(np.asarray(v, dtype=float)), 0.0) for v in (torque_Nm, power_W, thrust_N))
    propeller = PROPELLER[0] * diameter_m ** PROPELLER[1] * (blades / 2.0) ** BLADES
    strong = (32.0 * T * arm_m / (math.pi * ARM_PA * (1.0 - ARM_HOLLOW**4))) ** (1.0 / 3.0)
    tube = 0.25 * math.pi * np.maximum(strong, ARM_LEAST_M) ** 2 * (1.0 - ARM_HOLLOW**2) * ARM_DENSITY * arm_m
    return Masses(MOTOR[0] * Q ** MOTOR[1], np.full(Q.shape, propeller), ESC * P, FRAME * tube)


def arm_for(diameter_m: float, arms: int) -> float:
    """Least distance of the shafts from the middle; no arm for one rotor. [m]"""
    return 0.0 if arms < 2 else 0.5 * CLEARANCE * diameter_m / math.sin(math.pi / arms)


def diameter_on(arm_m: float, arms: int) -> float:
    """Largest diameter that `arm_m` leaves room for: between neighbours, or between the shaft and what is next to it.

    >>> round(diameter_on(0.110, 4) / 0.0254, 2)
    5.83
    """
    return (2.0 * arm_m * math.sin(math.pi / arms) if arms > 1 else 2.0 * arm_m) / CLEARANCE


COLUMNS = ("name", "kv", "resistance_mohm", "no_load_A")
LIMITS = {
    "kv": (20.0, 50_000.0, "In thousands? Write rev/min/V", ""),
    "resistance_mohm": (1.0, 50_000.0, "In ohm? Write milliohm", "In microohm? Divide by 1000"),
    "no_load_A": (0.0, 30.0, "", "In mA? Divide by 1000"),
}
"""Least and greatest values [rev/min/V], [mohm], [A], and what to ask below and above; hardly a winding of those that
Drive Calculator has recorded is below 1 mohm."""


@dataclass(frozen=True)
class KnownMotor:
    """A motor; NaN: not known."""

    name: str
    kv: float  # [rev/min/V]
    resistance_ohm: float = math.nan  # between two leads [ohm]
    no_load_A: float = math.nan  # [A]
    mass_g: float = math.nan  # [g]
    max_current_A: float = math.nan  # that the maker allows [A]
    maker: str = ""
    max_power_W: float = math.nan  # that the maker allows [W]


def _known(one: NamedMotor) -> KnownMotor:
    told = (one.resistance_mohm, one.no_load_A, one.mass_g, one.max_current_A, one.max_power_W)
    mohm, idle, mass, most, power = (math.nan if v is None else v for v in told)
    return KnownMotor(one.name, one.kv, 1e-3 * mohm, idle, mass, most, one.maker, power)


def motors_of(given: str | os.PathLike[str] | KnownMotor) -> tuple[KnownMotor, ...]:
    """Motors as told: one, a CSV of them, or the name of one on sale, such as ``T-Motor MN2212 920``."""
    if isinstance(given, KnownMotor):
        return (given,)
    text = path_text("motors", given)
    if Path(text).suffix or Path(text).exists() or "/" in text or os.sep in text:
        return read_motors(text)
    return (_known(named_motor(text, "--motors")),)


NEAR_KV, NEAR_MASS = (0.75, 1.4), (0.4, 1.65)
"""Motors that are tried, over the K_v with an even chance and over the mass of the law [1]. At the current that its
maker allows a tenth of 7,243 motors on sale weigh less than 0.42 of the law (racing ones), inrunners without a gear 1.4
to 2.7 times as much: 1.65 is two standard deviations of the law."""
TRIED = 48
WINDING = 0.44
"""Winding of those on sale over `resistance_of_mass`, which holds all losses: median of 7,880, 0.24 to 1.2 for 80 %."""


def on_sale(kv: float, mass_g: float, current_A: float) -> list[KnownMotor]:
    """Motors on sale near a K_v [rev/min/V] and a mass [g] that stand a current, the nearest first, `TRIED` at most.

    Near is the winding too, to what is usual: the best of many sheets would be the one with the largest mistake.
    """
    far = []
    for one in motors_on_sale():
        if None in (one.mass_g, one.resistance_mohm, one.no_load_A, one.max_current_A):
            continue
        assert one.mass_g is not None and one.resistance_mohm is not None and one.max_current_A is not None
        by, heavier = one.kv / kv, one.mass_g / mass_g
        near = NEAR_KV[0] <= by <= NEAR_KV[1] and NEAR_MASS[0] <= heavier <= NEAR_MASS[1]
        if near and one.max_current_A >= current_A:
            usual = 1e3 * WINDING * float(resistance_of_mass(one.kv, one.mass_g))
            far.append((math.hypot(4.0 * math.log(by), math.log(heavier), math.log(one.resistance_mohm / usual)), one))
    return [_known(one) for _, one in sorted(far, key=lambda pair: pair[0])[:TRIED]]


HEAD_HINT = f"The first line is {','.join(COLUMNS)}"


def read_motors(path: str | os.PathLike[str]) -> tuple[KnownMotor, ...]:
    """Read a CSV with the columns ``name, kv, resistance_mohm, no_load_A``; an empty cell is unknown.

    Semicolons or tabs may stand between the cells, then also decimal commas; other columns are left alone.

    Raises
    ------
    InputError
        With every fault of the file.
    """
    table, file = split_table(load_text(path), header=True), Path(path).as_posix()
    place = {key.casefold(): i for i, key in enumerate(table.headings)}
    missing = [key for key in COLUMNS if key.casefold() not in place]
    refuse(Fault(file, f"column {key}", "none", "this column", HEAD_HINT) for key in missing)
    decimal, faults, found = decimal_mark(table), list[Fault](), dict[str, Array]()
    for key, (low, high, below, above) in LIMITS.items():
        found[key], _, _ = table.numbers(place[key.casefold()], decimal)
        for line, cell, value in zip(table.lines, table.cells(place[key.casefold()]), found[key], strict=True):
            if not low <= value <= high and (cell or key == "kv"):
                hint = below if 0.0 < value < low else above if value > high else ""
                expected = f"a number from {low:g} to {high:g}"
                faults.append(Fault(file, f"line {line}, {key}", cell or "nothing", expected, hint))
    refuse(faults)
    names = [name or f"line {line}" for name, line in zip(table.cells(place["name"]), table.lines, strict=True)]
    kv, mohm, idle = (values.tolist() for values in found.values())
    return tuple(KnownMotor(name, k, 1e-3 * m, i) for name, k, m, i in zip(names, kv, mohm, idle, strict=True))

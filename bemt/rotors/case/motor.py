"""The motor of a drive that states no winding: a class by K_v, cells and, if given, mass or stator; motors by name.

What Drive Calculator's motors lose with a propeller acts as one resistance, (U - n/K_v)/I: the warm winding, switches
and leads together. Its median for each of 611 motors (every other one, by a checksum of the maker's name) was fitted
to K_v and voltage, or to K_v and mass; of 491 others it gives the current with a median error of 21 % (no mass) and
11 % (with it), where a motor as large as the propeller needs gave 21 % with a bias of 14 %.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.rotors.case.drive_schema import LIPO_SOC, LIPO_V, DriveTable

if TYPE_CHECKING:
    from bemt.rotors.case.load import Case

# ln R = a + b ln K_v + c ln U, and with the mass instead, ln R = a + b ln K_v + c ln m [ohm, rev/min/V, V, g].
_BY_VOLTAGE, _BY_MASS = (1.492, -0.095, -1.153), (9.169, -0.907, -1.076)
SCATTER, SCATTER_MASS, SCATTER_STATOR = 0.75, 0.31, 0.33
"""Scatter of ln R around the class by voltage, by mass and by stator size [1]."""
# Mass of a motor by its stator, m = exp(a) (d^2 h)^b [g, mm]: 640 motors of T-Motor, SunnySky, iFlight, EMAX and
# Scorpion in setuav-pythrust, scatter 0.1.
_STATOR = (-3.9, 0.91)
_SPEEDS = np.linspace(0.2, 1.0, 65)
"""Speeds over that without load between which full throttle is sought [1]."""


def stator_mass_g(stator: str) -> float:
    """Mass of a motor by the size of its stator, four digits as in MN2212 [g].

    >>> round(stator_mass_g("2212"))
    54
    """
    d, h = float(stator[:2]), float(stator[2:])
    return math.exp(_STATOR[0] + _STATOR[1] * math.log(d * d * h))


def resistance_of_mass(kv: Array | float, mass_g: Array | float) -> Array:
    """Usual resistance of winding, controller and leads of motors by K_v and mass [ohm].

    >>> round(1e3 * float(resistance_of_mass(900.0, 54.0)))
    274
    """
    a, b, c = _BY_MASS
    return np.asarray(np.exp(a + b * np.log(kv) + c * np.log(mass_g)))


def class_resistance(table: DriveTable) -> float:
    """Resistance of winding, controller and leads together, of the class of a motor [ohm].

    >>> round(1e3 * class_resistance(DriveTable(kv=900, cells=3)))
    139
    """
    m = table.motor
    mass = m.mass_g if m.mass_g is not None else None if m.stator is None else stator_mass_g(m.stator)
    if mass is not None:
        a, b, c = _BY_MASS
        usual = a + b * math.log(table.kv) + c * math.log(mass)
    else:
        volts = table.cells * float(np.interp(table.soc, LIPO_SOC, LIPO_V)) * (1.0 - (table.battery.sag or 0.0))
        usual = math.log(float(usual_resistance(table.kv, volts)))
    return math.exp(usual + m.size)


def usual_resistance(kv: Array | float, volts: Array | float) -> Array:
    """Resistance of motors of which only K_v [rev/min/V] and the loaded voltage are known [ohm]."""
    a, b, c = _BY_VOLTAGE
    return np.asarray(np.exp(a + b * np.log(kv) + c * np.log(volts)))


def full_speed(case: Case) -> float:
    """Speed at full throttle of a case with a table [drive] whose battery states its sag [rev/min].

    Where the motor's torque k I (1 - idle share), I = (U - n/K_v)/R, meets the rotor's.
    """
    from bemt.rotors.case.prepare import prepare_case

    t = case.file.drive
    assert t is not None  # the caller asks for a drive
    volts = t.cells * float(np.interp(t.soc, LIPO_SOC, LIPO_V)) * (1.0 - (t.battery.sag or 0.0))
    free, k = t.kv * volts, 30.0 / (math.pi * t.kv)
    rpm = free * _SPEEDS
    V = np.full(rpm.size, case.airspeed_m_s)
    air = case.air()
    load = prepare_case(case, alone=True).at_speeds(rpm, V, air).solve(rpm, V, air).torque_Nm
    amps = (volts - rpm / t.kv) / class_resistance(t)
    more = k * (1.0 - (t.motor.idle_share or 0.0)) * amps - load
    drives = np.flatnonzero(more > 0.0)
    if not drives.size or drives[-1] + 1 == rpm.size:
        return float(rpm[0] if not drives.size else free)
    i = drives[-1]
    return float(rpm[i] + (rpm[i + 1] - rpm[i]) * more[i] / (more[i] - np.nan_to_num(more[i + 1])))


@dataclass(frozen=True)
class NamedMotor:
    """A motor of a maker's sheet."""

    name: str
    kv: float  # [rev/min/V]
    resistance_mohm: float | None  # Of the winding
    no_load_A: float | None
    mass_g: float | None
    source: str
    maker: str = ""
    max_current_A: float | None = None

    @property
    def keys(self) -> dict[str, float | str]:
        """What it sets in a case."""
        given: dict[str, float | str | None] = {
            "kv": self.kv, "motor.name": self.name, "motor.resistance_mohm": self.resistance_mohm,
            "motor.no_load_A": self.no_load_A, "motor.mass_g": self.mass_g,
        }  # fmt: skip
        return {f"drive.{key}": value for key, value in given.items() if value is not None}


LIST = "setuav-pythrust"
"""List of motors by name (Karakaya, Apache-2.0), extra ``motors``; its numbers are the makers' own."""


@cache
def motors_on_sale() -> tuple[NamedMotor, ...]:
    """Motors of the list, by file name; none where it is not installed."""
    try:
        from pythrust import __version__, dataset_dir
    except ImportError:
        return ()
    out = []
    for file in sorted((Path(dataset_dir()) / "motors").glob("*.json")):
        one = json.loads(file.read_text(encoding="utf-8"))
        ohm, idle, mass, most = (
            float(v) if isinstance(v := one.get(key), (int, float)) and v > 0 else None
            for key in ("resistance", "io", "weight_g", "max_current")
        )
        source = f"{LIST} {__version__} (Karakaya, Apache-2.0), makers' numbers: {one['id']}"
        mohm = None if ohm is None else 1e3 * ohm
        maker = str(one["manufacturer"])
        out.append(NamedMotor(f"{maker} {one['name']}", float(one["kv"]), mohm, idle, mass, source, maker, most))
    return tuple(out)


def named_motor(name: str, where: str = "--motor") -> NamedMotor:
    """Motor by its name, such as ``T-Motor MN2212 920``: words of the name in any order, and its K_v as a number."""
    known = motors_on_sale()
    if not known:
        hint = 'Install it: pip install "bemt[motors]"'
        raise InputError(Fault(where, "", repr(name), f"the list of motors, {LIST}", hint))
    words, found = [word for word in _words(name) if len(word) > 1], []
    for one in known:
        stem = _words(one.source.rpartition(": ")[2])
        numbers = [w for w in words if not any(w in s for s in stem)]  # a K_v that the name rounds
        if all(re.fullmatch(r"\d{2,5}(?:\.\d+)?", w) for w in numbers) and len(numbers) < len(words):
            if all(abs(float(w) / one.kv - 1.0) < 0.02 for w in numbers):
                found.append((len(stem), one))
    fewest = [one for size, one in found if size == min(n for n, _ in found)]
    if len(fewest) != 1:
        names = ", ".join(one.name for _, one in found[:8])
        got = f"{name!r}, which {'no motor has' if not found else f'{len(found)} motors have'}"
        hint = f"Such as {names}" if names else "How many there are: --rotors" if name.isdigit() else ""
        raise InputError(Fault(where, "", got, "the name of one motor", hint))
    return fewest[0]


def _words(name: str) -> set[str]:
    return set(re.findall(r"[a-z]*\d+(?:\.\d+)?[a-z]*|[a-z]+", re.sub(r"kv(?=\d)|(?<=\d)kv", " ", name.casefold())))

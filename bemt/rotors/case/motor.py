"""The motor of a drive that states no winding: as large as its propeller asks, or of its mass; motors by name.

What Drive Calculator's motors lose with a propeller acts as one resistance, (U - n/K_v)/I: the warm winding, switches
and leads together. It goes with the current of full throttle alone, I^-0.70: to K_v and voltage nothing is left. The
exponent was fitted to 612 motors (every other one, by a checksum of the maker's name). On 494 others the current is off
by 12.9 % in the median; a law of K_v and voltage gave 16.9 %, the mass that the torque asks for 16.7 % with a bias of
-11 %. Where the mass is known it tells more, 6.8 %, and is the same motor whatever it turns: propellers on one motor
are compared by that.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.rotors.case.drive_schema import LIPO_SOC, LIPO_V, MotorTable

if TYPE_CHECKING:
    from bemt.rotors.case.load import Case

_BY_CURRENT = -0.70
"""Exponent of the current at full throttle, at rest; 1 A: 1.00 ohm [1]."""
_BY_MASS = (9.169, -0.907, -1.076)  # ln R = a + b ln K_v + c ln m [ohm, rev/min/V, g]
SCATTER, SCATTER_MASS = 0.45, 0.31
"""Scatter of ln R around the law by current, and by mass or stator: 69 and 92 % of the currents of motors that were not
fitted lie within one and two [1]."""
# Mass of a motor by its stator, m = exp(a) (d^2 h)^b [g, mm]: 640 motors of T-Motor, SunnySky, iFlight, EMAX and
# Scorpion in setuav-pythrust, scatter 0.1.
_STATOR = (-3.9, 0.91)
_SPEEDS = np.linspace(0.2, 1.0, 65)
"""Speeds over K_v times the voltage between which full throttle is sought [1]."""


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


def class_resistance(amps: Array | float, kv: Array | float = math.nan, mass_g: Array | float = math.nan) -> Array:
    """Resistance of winding, controller and leads together of a motor of which the winding is not known [ohm].

    By K_v and mass where that is known, else by the current at full throttle and rest [A].

    >>> [round(1e3 * float(class_resistance(*known))) for known in ((10.0,), (10.0, 900.0, 54.0))]
    [200, 274]
    """
    usual = np.asarray(amps, dtype=float) ** _BY_CURRENT
    return np.asarray(np.where(np.isnan(mass_g), usual, resistance_of_mass(kv, mass_g)))


def known_mass_g(motor: MotorTable) -> float:
    """Mass that a case states of its motor, by itself or by its stator; NaN: not known [g]."""
    if motor.mass_g is not None:
        return motor.mass_g
    return math.nan if motor.stator is None else stator_mass_g(motor.stator)


def full_speed(case: Case) -> float:
    """Speed at full throttle of a case with a table [drive] that states none of its losses in ohm [rev/min].

    At rest U (1 - sag) - n/K_v = R I with I = Q/(k (1 - idle share)) tells motor and battery, which it keeps in flight.
    """
    from bemt.rotors.case.prepare import prepare_case

    t = case.file.drive
    assert t is not None  # the caller asks for a drive
    volts, k = t.cells * float(np.interp(t.soc, LIPO_SOC, LIPO_V)), 30.0 / (math.pi * t.kv)
    sag, idle = t.battery.sag or 0.0, t.motor.idle_share or 0.0
    rpm, air, prepared = t.kv * volts * _SPEEDS, case.air(), prepare_case(case, alone=True)

    def load(airspeed_m_s: float) -> Array:
        V = np.full(rpm.size, airspeed_m_s)
        return np.asarray(prepared.at_speeds(rpm, V, air).solve(rpm, V, air).torque_Nm / k)

    amps = np.maximum(load(0.0), 1e-9) / (1.0 - idle)
    lost = math.exp(t.motor.size) * amps * class_resistance(amps, t.kv, known_mass_g(t.motor))
    n = _last_above(rpm, (1.0 - sag) * volts - rpm / t.kv - lost)
    if not case.airspeed_m_s:
        return n
    full_A = float(np.interp(n, rpm, amps))
    ohm = (sag * volts + float(np.interp(n, rpm, lost))) / full_A
    return _last_above(rpm, volts - rpm / t.kv - ohm * (load(case.airspeed_m_s) + idle * full_A))


def _last_above(x: Array, y: Array) -> float:
    """Where y leaves its last positive value for zero; an end of x where it has none, or ends with it."""
    above = np.flatnonzero(y > 0.0)
    if not above.size or above[-1] + 1 == x.size:
        return float(x[-1 if above.size else 0])
    i = above[-1]
    return float(x[i] + (x[i + 1] - x[i]) * y[i] / (y[i] - np.nan_to_num(y[i + 1])))


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
    max_power_W: float | None = None

    @property
    def keys(self) -> dict[str, float | str]:
        """What it sets in a case."""
        given: dict[str, float | str | None] = {
            "kv": self.kv, "motor.name": self.name, "motor.resistance_mohm": self.resistance_mohm,
            "motor.no_load_A": self.no_load_A, "motor.mass_g": self.mass_g,
        }  # fmt: skip
        return {f"drive.{key}": value for key, value in given.items() if value is not None}

    @property
    def words(self) -> set[str]:
        """Words of its file in the list."""
        return _words(self.source.rpartition(": ")[2])

    def is_called(self, words: Sequence[str]) -> bool:
        """Whether words are parts of its name, but for numbers near its K_v, which the name rounds."""
        own = self.words
        numbers = [w for w in words if not any(w in s for s in own)]
        return len(numbers) < len(words) and all(
            re.fullmatch(r"\d{2,5}(?:\.\d+)?", w) and abs(float(w) / self.kv - 1.0) < 0.02 for w in numbers
        )


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
        ohm, idle, mass, most, power = (
            float(v) if isinstance(v := one.get(key), (int, float)) and v > 0 else None
            for key in ("resistance", "io", "weight_g", "max_current", "max_power")
        )
        source = f"{LIST} {__version__} (Karakaya, Apache-2.0), makers' numbers: {one['id']}"
        mohm = None if ohm is None else 1e3 * ohm
        maker = str(one["manufacturer"])
        name = f"{maker} {one['name']}"
        out.append(NamedMotor(name, float(one["kv"]), mohm, idle, mass, source, maker, most, power))
    return tuple(out)


def named_motor(name: str, where: str = "--motor") -> NamedMotor:
    """Motor by its name, such as ``T-Motor MN2212 920``: words of the name in any order, and its K_v as a number."""
    known = motors_on_sale()
    if not known:
        hint = 'Install it: pip install "bemt[motors]"'
        raise InputError(Fault(where, "", repr(name), f"the list of motors, {LIST}", hint))
    words = [word for word in _words(name) if len(word) > 1]
    found = [one for one in known if one.is_called(words)]
    least = min((len(one.words) for one in found), default=0)
    fewest = [one for one in found if len(one.words) == least]
    if len(fewest) != 1:
        names = ", ".join(one.name for one in found[:8])
        got = f"{name!r}, which {'no motor has' if not found else f'{len(found)} motors have'}"
        hint = f"Such as {names}" if names else "How many there are: --rotors" if name.isdigit() else ""
        raise InputError(Fault(where, "", got, "the name of one motor", hint))
    return fewest[0]


def _words(name: str) -> set[str]:
    return set(re.findall(r"[a-z]*\d+(?:\.\d+)?[a-z]*|[a-z]+", re.sub(r"kv(?=\d)|(?<=\d)kv", " ", name.casefold())))

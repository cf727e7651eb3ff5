"""Units: SI and radians inside, every other unit named by a suffix.

The suffix of a key says its unit (``diameter_in``, ``thrust_kgf``, ``temperature_C``), and the table `UNITS` is the
only place that knows the factors.  Nothing here guesses: an unknown suffix is an error, never a silent conversion.

References
----------
.. [1] A. Thompson, B. N. Taylor, "Guide for the Use of the International System of Units", NIST SP 811, 2008,
       appendix B (factors in bold there are exact; inch, pound, standard gravity and horsepower follow from them).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from bemt.base.errors import Fault, InputError

if TYPE_CHECKING:  # numpy is not needed here, and its import would slow `bemt --help`
    import numpy as np
    from numpy.typing import NDArray

Numeric = TypeVar("Numeric", float, "NDArray[np.float64]")

G0 = 9.80665
"""Standard gravity [m/s2], exact; also newtons per kilogram-force."""
KGF = 9.80665
"""Newtons per kilogram-force [N/kgf], exact."""
INCH = 0.0254
"""Metres per inch [m/in], exact."""
FOOT = 0.3048
"""Metres per foot [m/ft], exact."""
POUND = 0.45359237
"""Kilograms per avoirdupois pound [kg/lb], exact."""
LBF = POUND * G0
"""Newtons per pound-force [N/lbf], exact."""
OZF = LBF / 16.0
"""Newtons per ounce-force [N/ozf], exact."""
HP = 550.0 * FOOT * LBF
"""Watts per mechanical horsepower, 550 ft lbf/s [W/hp]."""
KNOT = 1852.0 / 3600.0
"""Metres per second in a knot [(m/s)/kt], exact."""
MPH = 1609.344 / 3600.0
"""Metres per second in a mile per hour [(m/s)/mph], exact."""
RPM = 2.0 * math.pi / 60.0
"""Radians per second in one revolution per minute [(rad/s)/rpm]."""
DEG = math.pi / 180.0
"""Radians per degree [rad/deg]."""
ZERO_CELSIUS = 273.15
"""Kelvin at zero degrees Celsius [K], exact."""


@dataclass(frozen=True)
class Unit:
    """One unit: ``si = value * factor + offset``."""

    suffix: str  # As written at the end of a key
    dimension: str  # Kind of quantity, such as ``length`` or ``force``
    factor: float  # SI units per one of this unit
    offset: float = 0.0  # Added after the factor; non-zero for temperatures only [K]


def _table() -> dict[str, Unit]:
    groups: dict[str, dict[str, float]] = {
        "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "in": INCH, "ft": FOOT},
        "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6, "in2": INCH**2},
        "angle": {"rad": 1.0, "deg": DEG},
        "speed": {"m_s": 1.0, "km_h": 1.0 / 3.6, "kt": KNOT, "mph": MPH, "ft_s": FOOT},
        "angular_speed": {"rad_s": 1.0, "rpm": RPM, "krpm": 1e3 * RPM, "rev_s": 2.0 * math.pi},
        "mass": {"kg": 1.0, "g": 1e-3, "lb": POUND, "oz": POUND / 16.0},
        "density": {"kg_m3": 1.0, "g_cm3": 1e3},
        "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": KGF, "gf": KGF * 1e-3, "lbf": LBF, "ozf": OZF},
        "torque": {
            "Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "Nmm": 1e-3, "kNm": 1e3, "kgf_m": KGF, "kgf_cm": KGF * 1e-2,
            "gf_cm": KGF * 1e-5, "lbf_in": LBF * INCH, "lbf_ft": LBF * FOOT, "ozf_in": OZF * INCH,
        },
        "power": {"W": 1.0, "kW": 1e3, "hp": HP},
        "pressure": {
            "Pa": 1.0, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "bar": 1e5, "inHg": 3386.389, "mmHg": 133.3224,
            "psi": LBF / INCH**2,
        },
        "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
        "voltage": {"V": 1.0, "mV": 1e-3},
        "current": {"A": 1.0, "mA": 1e-3},
        "fraction": {"pct": 1e-2},
        "viscosity": {"Pa_s": 1.0},
    }  # fmt: skip
    out = {s: Unit(s, dim, f) for dim, units in groups.items() for s, f in units.items()}
    out["K"] = Unit("K", "temperature", 1.0)
    out["C"] = Unit("C", "temperature", 1.0, ZERO_CELSIUS)
    out["F"] = Unit("F", "temperature", 5.0 / 9.0, ZERO_CELSIUS - 32.0 * 5.0 / 9.0)
    return out


UNITS: dict[str, Unit] = _table()
"""Every known suffix and its `Unit`."""


def _get(unit: str) -> Unit:
    try:
        return UNITS[unit]
    except KeyError:
        raise InputError(Fault("", "unit", repr(unit), f"one of {', '.join(sorted(UNITS))}")) from None


def to_si(value: Numeric, unit: str) -> Numeric:
    """Convert a value to SI.

    >>> to_si(10.0, "in")
    0.254
    >>> to_si(15.0, "C")
    288.15
    """
    u = _get(unit)
    return value * u.factor + u.offset


def from_si(value: Numeric, unit: str) -> Numeric:
    """Convert an SI value to a unit.

    >>> round(from_si(27.0, "kgf"), 4)
    2.7532
    """
    u = _get(unit)
    return (value - u.offset) / u.factor


def convert(value: Numeric, unit: str, to: str) -> Numeric:
    """Convert between two units of the same dimension.

    >>> round(convert(1.0, "kgf", "lbf"), 5)
    2.20462
    >>> convert(1.0, "kgf", "kg")
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: unit: got 'kgf' (force) -> 'kg' (mass); expected two units of the same dimension.
    """
    u, v = _get(unit), _get(to)
    if u.dimension != v.dimension:
        got = f"{unit!r} ({u.dimension}) -> {to!r} ({v.dimension})"
        raise InputError(Fault("", "unit", got, "two units of the same dimension"))
    return from_si(to_si(value, unit), to)


def split_suffix(key: str) -> tuple[str, Unit | None]:
    """Split a key into its name and its unit.

    The longest suffix wins, so ``speed_m_s`` is metres per second and not seconds.

    >>> name, unit = split_suffix("airspeed_m_s")
    >>> name, unit.dimension
    ('airspeed', 'speed')
    >>> split_suffix("blades")
    ('blades', None)
    """
    parts = key.split("_")
    for start in range(1, len(parts)):
        suffix = "_".join(parts[start:])
        if suffix in UNITS:
            return "_".join(parts[:start]), UNITS[suffix]
    return (key, UNITS[key]) if key == "rpm" else (key, None)


def suffixes(dimension: str) -> tuple[str, ...]:
    """List the suffixes of a dimension, SI first.

    >>> suffixes("angle")
    ('rad', 'deg')
    """
    return tuple(s for s, u in UNITS.items() if u.dimension == dimension)


SAID = {
    "in": "inches", "rpm": "rev/min", "rad_s": "rad/s", "rev_s": "rev/s", "m_s": "m/s", "km_h": "km/h", "ft_s": "ft/s",
    "pct": "%", "kg_m3": "kg/m3", "g_cm3": "g/cm3", "Pa_s": "Pa s", "kgf_cm": "kgf cm", "gf_cm": "gf cm",
}  # fmt: skip
_WRITTEN = {
    "1/min": "rpm", "r/min": "rpm", "u/min": "rpm", "rps": "rev_s", '"': "in", "''": "in", "inch": "in", "degc": "C",
    "celsius": "C", "degf": "F", "kelvin": "K", "knots": "kt", "kn": "kt", "percent": "pct", "degrees": "deg",
    "degree": "deg", "kph": "km_h", "kg/m^3": "kg_m3", "metres": "m", "meters": "m", "kmh": "km_h", "kts": "kt",
    "mps": "m_s", "fps": "ft_s", "inches": "in", "feet": "ft",
}  # fmt: skip
"""Units as we say them, and as others write them; by suffix, and to it."""


def suffix_of(text: str) -> str:
    """Suffix of a unit as somebody writes it; "" for an unknown one.

    >>> suffix_of("km/h"), suffix_of("kmh"), suffix_of("furlong")
    ('km_h', 'km_h', '')
    """
    t = text.strip().replace("°", "deg").replace("³", "3").replace("%", "pct")
    known = {said: suffix for suffix, said in SAID.items()}
    for way in (t, known.get(t, ""), t.replace("/", "_").replace(" ", "_"), _WRITTEN.get(t.lower(), ""), t.lower()):
        if way in UNITS:
            return way
    return ""

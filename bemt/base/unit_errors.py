"""The list of unit errors: units taken for one another, and ratios by which a speed of rotation is miscounted.

Import, the judge, the wrong-rotor check, the motor constants and the proof take their views from here. A unit error is
one exact ratio by definition; the sizes of the units are those of :mod:`bemt.base.units` (BIPM 2019, SI Brochure 9th
ed.; NIST SP 811, 2008, appendix B). How common an error is, is declared: ``rarity`` is -2 ln of its frequency over that
of the commonest ones, so it adds to a chi-square, and ``weight`` = exp(-rarity / 2) is its share of a prior.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from bemt.base.units import DEG, FOOT, INCH, LBF, POUND, RPM, UNITS


@dataclass(frozen=True)
class UnitError:
    """A number written in the unit ``actual`` whose label says ``stated``."""

    kind: str  # Of quantity: force, torque, power, length ...
    actual: str  # Unit of the number
    stated: str  # Unit that its label names
    factor: float  # Recorded over true value [1]
    offset: float  # Added to the repaired value, for temperatures [K]
    rarity: float  # -2 ln of its relative frequency, declared [1]

    @property
    def repair(self) -> float:
        """Factor that makes the recorded value the true one [1]."""
        return 1.0 / self.factor

    @property
    def weight(self) -> float:
        """Share of a prior [1]."""
        return math.exp(-0.5 * self.rarity)

    @property
    def words(self) -> str:
        """The error and its repair.

        >>> named("kgf", "N").words, named("C", "K").words
        ('kgf taken for N: multiply by 9.80665', 'Celsius taken for kelvin: add 273.15')
        """
        error = f"{self.actual} taken for {self.stated}"
        if not self.offset:
            return f"{error}: multiply by {self.repair:.6g}"
        step = f"{'add' if self.offset > 0.0 else 'subtract'} {abs(self.offset):.6g}"
        return f"{error}: {step}" if self.factor == 1.0 else error

    @property
    def short(self) -> str:
        """The unit that is not SI, as one setting of an effect names it.

        >>> named("kgf", "N").short, named("N", "kgf").short, named("kgf", "gf").short
        ('kgf', 'taken for kgf', 'kgf taken for gf')
        """
        if self.stated == _SI.get(self.kind):
            return self.actual
        return (
            f"taken for {self.stated}"
            if self.actual == _SI.get(self.kind)
            else f"{self.actual} taken for {self.stated}"
        )


@dataclass(frozen=True)
class SpeedRatio:
    """A speed of rotation that is indicated as ``true`` / ``set`` times what it is."""

    true: int  # Pole pairs, blades or marks that there are; revolutions counted for each turn
    set: int  # Those that the counter divides by
    cause: str
    rarity: float  # -2 ln of its relative frequency, declared [1]

    @property
    def ratio(self) -> float:
        """Indicated over true speed [1]."""
        return self.true / self.set

    @property
    def weight(self) -> float:
        """Share of a prior [1]."""
        return math.exp(-0.5 * self.rarity)

    @property
    def words(self) -> str:
        """The error and its repair.

        >>> next(r.words for r in speed_ratios() if r.ratio == 7.0)
        'electrical revolutions taken for mechanical: divide by 7 pole pairs'
        """
        if self.set == 1:
            return f"electrical revolutions taken for mechanical: divide by {self.true} pole pairs"
        if self.true == 1:
            return f"divided twice by {self.set} pole pairs: multiply by {self.set}"
        return f"counter set to {self.set} instead of {self.true} {self.cause}: multiply by {self.set}/{self.true}"


# Display of units, where it is not the suffix with blanks.
_SHOWN = {"rad_s": "rad/s", "rev_s": "rev/s (Hz)", "rpm": "rev/min", "m_s": "m/s", "km_h": "km/h", "ft_s": "ft/s",
          "kt": "kn", "kg_m3": "kg/m3", "g_cm3": "g/cm3", "K": "kelvin", "C": "Celsius", "F": "Fahrenheit",
          "pct": "percent"}  # fmt: skip
# Size of what no file of ours is written in [SI].
_SIZES = {
    "deg/s": DEG, "1000 rev/min": 1e3 * RPM, "cm/s": 1e-2, "lb/ft3": POUND / FOOT**3, "slug/ft3": LBF / FOOT**4,
    "g/m3": 1e-3, "N in": INCH, "lbf m": LBF, "kg": 1.0, "inHg": 3386.389, "fraction": 1.0,
    "torque x rad/s": 1.0, "torque x rev/s": 2.0 * math.pi, "torque x rev/min": RPM,
    "power over rad/s": 1.0, "power over rev/s": 0.5 / math.pi, "power over rev/min": 1.0 / RPM,
    "diameter": 1.0, "radius": 2.0,
    "1": 1.0, "2": 2.0, "sqrt(3)": math.sqrt(3.0), "sqrt(3/2)": math.sqrt(1.5),
}  # fmt: skip
_SI = {"force": "N", "torque": "Nm", "rotation": "rev/min", "airspeed": "m/s", "density": "kg/m3"}
# By kind of quantity: actual and stated unit, rarity. Each may go either way.
_TABLE: dict[str, tuple[tuple[str, str, float], ...]] = {
    "force": (
        ("kgf", "N", 0.0), ("lbf", "N", 0.0), ("gf", "N", 0.0), ("kgf", "gf", 0.0), ("kgf", "lbf", 1.0),
        ("lbf", "gf", 1.0), ("ozf", "N", 2.0), ("ozf", "gf", 2.0),
    ),
    "length": (("mm", "m", 0.5), ("in", "m", 0.5), ("in", "mm", 0.5), ("cm", "m", 1.0)),
    "rotation": (
        ("rad_s", "rpm", 0.0), ("rev_s", "rpm", 0.0), ("rev_s", "rad_s", 2.0), ("1000 rev/min", "rpm", 2.0),
        ("deg/s", "rpm", 3.0),
    ),
    "torque": (
        ("mNm", "Nm", 0.0), ("kgf_cm", "Nm", 0.0), ("gf_cm", "Nm", 0.0), ("kgf_m", "Nm", 0.0), ("lbf_in", "Nm", 0.0),
        ("lbf_ft", "Nm", 1.0), ("ozf_in", "Nm", 1.0), ("Ncm", "Nm", 1.0), ("N in", "Nm", 2.0), ("lbf m", "Nm", 2.0),
        ("kg", "lb", 2.0), ("mm", "in", 2.0), ("power over rev/s", "power over rad/s", 2.0),
        ("power over rev/min", "power over rad/s", 2.0), ("power over rev/s", "power over rev/min", 2.0),
    ),
    "airspeed": (
        ("km_h", "m_s", 0.0), ("mph", "m_s", 0.0), ("kt", "m_s", 0.0), ("ft_s", "m_s", 0.5), ("cm/s", "m_s", 2.0),
    ),
    "density": (("lb/ft3", "kg_m3", 0.5), ("slug/ft3", "kg_m3", 1.0), ("g_cm3", "kg_m3", 1.0), ("g/m3", "kg_m3", 1.0)),
    "power": (
        ("kW", "W", 0.5), ("hp", "W", 0.5), ("torque x rev/s", "torque x rad/s", 0.5),
        ("torque x rev/min", "torque x rad/s", 0.5),
    ),
    "electrical_power": (("kW", "W", 1.0),),
    "current": (("A", "mA", 0.5),),
    "voltage": (("V", "mV", 0.5),),
    "diameter": (("radius", "diameter", 1.0),),
    "efficacy": (("kgf", "N", 5.0), ("lbf", "N", 5.0), ("gf", "N", 5.0), ("kgf", "gf", 5.0)),  # thrust over power
    "pressure": (("hPa", "Pa", 0.0), ("kPa", "Pa", 0.5), ("bar", "Pa", 1.0), ("inHg", "Pa", 1.0)),
    "temperature": (("C", "K", 0.0), ("F", "K", 1.0), ("F", "C", 0.5)),
    "time": (("ms", "s", 0.0), ("us", "s", 0.5)),
    "angle": (("deg", "rad", 0.5),),
    "fraction": (("pct", "fraction", 0.0),),
    # of line or phase, of amplitude or effective value, of a turn through one phase or the power-invariant transform
    "motor_constant": (("1", "sqrt(3/2)", 0.0), ("1", "sqrt(3)", 0.0), ("1", "2", 0.0)),
}  # fmt: skip


def _size(unit: str) -> tuple[float, float]:
    known = UNITS.get(unit)
    return (_SIZES[unit], 0.0) if known is None else (known.factor, known.offset)


def _error(kind: str, actual: str, stated: str, rarity: float) -> UnitError:
    (a, a0), (s, s0) = _size(actual), _size(stated)
    x, y = (_SHOWN.get(u, u if u in _SIZES else u.replace("_", " ")) for u in (actual, stated))
    return UnitError(kind, x, y, s / a, a0 - s0 * a / s, rarity)


@cache
def errors(kind: str, rarest: float = math.inf) -> tuple[UnitError, ...]:
    """Unit errors of a kind of quantity, each both ways, up to a rarity.

    >>> [e.words for e in errors("voltage")]
    ['V taken for mV: multiply by 1000', 'mV taken for V: multiply by 0.001']
    """
    rows = [row for row in _TABLE[kind] if row[2] <= rarest]
    return tuple(_error(kind, *pair, rarity) for a, s, rarity in rows for pair in ((a, s), (s, a)))


def named(actual: str, stated: str) -> UnitError:
    """One unit error, by the suffixes of its units.

    >>> round(named("gf", "N").factor, 3)
    101.972
    """
    found = _error("", actual, stated, 0.0)
    return next(e for kind in _TABLE for e in errors(kind) if (e.actual, e.stated) == (found.actual, found.stated))


def symmetric() -> dict[str, float]:
    """Names and factors above 1 of all errors that are a bare ratio.

    >>> symmetric()["kgf <-> N"]
    9.80665
    """
    out: dict[str, float] = {}
    for e in (e for kind in _TABLE for e in errors(kind)[::2] if not e.offset and kind != "motor_constant"):
        factor = max(e.factor, e.repair)
        if all(abs(factor / other - 1.0) > 1e-9 for other in out.values()):
            out["kilo" if math.isclose(factor, 1e3) else f"{e.actual} <-> {e.stated}"] = factor
    return out


# Pole pairs: 12, 14, 22, 24 and 28 magnets are the usual windings of outrunners; the next are sold; others hardly.
_USUAL_PAIRS, _SOLD_PAIRS = (6, 7, 11, 12, 14), (2, 3, 4, 5, 8, 9, 10, 16, 18, 20, 21)
_FIRMWARE = 7  # Pairs that flight controllers assume if nobody sets them: 14 magnets
_PAIRS, _MARKS = "pole pairs", "blades or marks"


def _ratios() -> Iterator[SpeedRatio]:
    for p in range(2, 31):
        rarity = 0.0 if p in _USUAL_PAIRS else 0.5 if p in _SOLD_PAIRS else 2.0
        yield SpeedRatio(p, 1, _PAIRS, rarity)
        yield SpeedRatio(1, p, _PAIRS, rarity + 0.5)
    for pair, rarity in (((6, 7), 0.0), ((7, 8), 0.5), ((8, 9), 1.0), ((11, 12), 1.0)):  # the next winding
        yield from (SpeedRatio(*way, _PAIRS, rarity) for way in (pair, pair[::-1]))
    for p in range(1, 7):  # an optical counter
        yield from (SpeedRatio(p, q, _MARKS, 0.5 if {p, q} == {2, 3} else 1.0) for q in range(1, 7) if p != q)
    yield from (SpeedRatio(p, _FIRMWARE, _PAIRS, 1.5) for p in (*_USUAL_PAIRS, *_SOLD_PAIRS) if p % _FIRMWARE)


@cache
def speed_ratios(rarest: float = math.inf, nearest: Fraction = Fraction(1)) -> tuple[SpeedRatio, ...]:
    """Miscounted speeds, one for each ratio, the commonest first: pole pairs, blades, marks; ratio and inverse.

    Left out: rarer ones than `rarest`, and ratios nearer to 1 than `nearest`, which a reading of the level cannot tell.

    >>> [f"{r.true}/{r.set}" for r in speed_ratios(rarest=0.0)]
    ['6/1', '7/1', '11/1', '12/1', '14/1', '6/7', '7/6']
    """
    found: dict[Fraction, SpeedRatio] = {}
    for r in sorted(_ratios(), key=lambda r: r.rarity):
        found.setdefault(Fraction(r.true, r.set), r)
    far = {f: r for f, r in found.items() if max(f, 1 / f) >= nearest}
    return tuple(r for r in far.values() if r.rarity <= rarest)

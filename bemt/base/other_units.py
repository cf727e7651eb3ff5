"""A quantity in another unit that its suffix names: ``--diameter-in 10`` where an action counts in ``diameter_m``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, MutableMapping, Sequence
from contextlib import suppress
from typing import Any

from bemt.base.units import UNITS, Unit, convert, split_suffix, suffix_of


def own_name(name: str, names: Iterable[str]) -> str | None:
    """Parameter that has the quantity of a name in another unit.

    >>> own_name("diameter_in", ["rpm", "diameter_m"]), own_name("diameter_kg", ["diameter_m"])
    ('diameter_m', None)
    >>> own_name("thrust_g", ["thrust_N"])
    'thrust_N'
    """
    stem, unit = split_suffix(name)
    for own in () if unit is None or name in names else names:
        of, known = split_suffix(own)
        if of == stem and known is not None and unit is not None and known.dimension == _weight(unit, known).dimension:
            return own
    return None


def respelled(name: str, names: Iterable[str]) -> str:
    """Name of a quantity with the suffix of its unit, where the unit is written in another way; "" for any other.

    >>> respelled("airspeed_kmh", ["rpm", "airspeed_m_s"]), respelled("airspeed_inch", ["airspeed_m_s"])
    ('airspeed_km_h', '')
    """
    for of, unit in map(split_suffix, names):
        written = name.removeprefix(f"{of}_")
        suffix = suffix_of(written) if unit and written != name else ""
        if suffix not in ("", written) and own_name(f"{of}_{suffix}", [f"{of}_{unit.suffix}"] if unit else []):
            return f"{of}_{suffix}"
    return ""


def _weight(unit: Unit, known: Unit) -> Unit:
    """Unit of mass as the force that it weighs, where a force is meant; any other as it is."""
    return UNITS.get(f"{unit.suffix}f", unit) if (unit.dimension, known.dimension) == ("mass", "force") else unit


def converted(value: Any, name: str, own: str) -> Any:
    """Number or numbers in the unit of one parameter in that of another; TypeError for a word.

    >>> converted([10, 20], "diameter_in", "diameter_m")
    [0.254, 0.508]
    >>> round(converted(650, "thrust_g", "thrust_N"), 3)
    6.374
    """
    unit, to = (split_suffix(word)[1] for word in (name, own))
    assert unit is not None and to is not None
    if value is None or isinstance(value, (list, tuple)):
        return value and [converted(one, name, own) for one in value]
    if isinstance(value, str):
        raise TypeError(f"{name}: got {value!r}; expected a number")
    return convert(value, _weight(unit, to).suffix, to.suffix)


def in_own_units(given: MutableMapping[str, Any], names: Sequence[str]) -> None:
    """Turn keywords into those of a function, in place.

    >>> given = {"airspeed_km_h": 36.0}
    >>> in_own_units(given, ["airspeed_m_s"])
    >>> given
    {'airspeed_m_s': 10.0}
    """
    for name in [name for name in given if name not in names]:
        if (own := own_name(name, names)) is not None and own not in given:
            given[own] = converted(given.pop(name), name, own)


def words_in_own_units(argv: Sequence[str], known: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """Words of a command line, and what was converted; ``known`` are its options of numbers, with their parameters.

    >>> words_in_own_units(["A", "--diameter-in", "10", "--json"], {"--diameter-m": "diameter_m"})
    (['A', '--diameter-m', '0.254', '--json'], ['--diameter-in 10 is --diameter-m 0.254'])
    """
    out, read, told, own = list[str](), list[str](), "", None
    for word in argv:
        head, mark, value = word.partition("=")
        if word.startswith("--"):
            told = head[2:].replace("-", "_")
            own = next((option for option, name in known.items() if name == own_name(told, known.values())), None)
            if own is not None:
                out.append(own)
                word = value
                if not mark:
                    continue
        with suppress(ValueError):
            if own is not None:
                number = converted(float(word), told, known[own])
                read.append(f"--{told.replace('_', '-')} {word} is {own} {number:.6g}")
                word = repr(number)
        out.append(word)
    return out, read

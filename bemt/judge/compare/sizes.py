"""Causes with their sizes, as a person says them: one home for the words of every answer."""

from __future__ import annotations

import math
from collections.abc import Mapping

from bemt.base.unit_errors import SpeedRatio, speed_ratios
from bemt.judge.compare.drive_laws import title_of
from bemt.judge.explanation import Size
from bemt.physics import effects
from bemt.physics.effects import Parameter

Found = Mapping[str, Size]
"""Parameters of one effect, by name."""
READ = {"thrust_N": "thrust", "torque_Nm": "torque", "rpm": "speed", "airspeed_m_s": "airspeed",
        "density_kg_m3": "density", "loads": "thrust and torque"}  # fmt: skip
"""What a sensor reads, in a word."""
_UNIT = {"thrust_N": "N", "torque_Nm": "N m", "rpm": "rev/min"}
_SEEN, _NEARLY = 0.05, 0.5  # least probability of a value that is listed, and share of the likeliest that is as likely


def titled(name: str, found: Found, largest: Mapping[str, float] | None = None) -> str:
    """Title of an effect, and in brackets its state if that is not the usual one, else its size where one number is it.

    ``largest``: largest reading by channel [SI], of which a shifted cell is a share.
    """
    title, cls = title_of(name), effects.catalogue().get(name)
    if cls is None or title != cls.title:  # of a law of the drive
        return title
    told = _stated(name, found) or _likeliest(found)
    sizes = [p for p in cls.parameters if p.off is not None and (p.steps or p.name == "eps") and p.name in found]
    p, size = (sizes[0], found[sizes[0].name]) if len(sizes) == 1 else (None, None)
    shown = not told and p and size and isinstance(size.value, float) and (p.unit != "1" or _is_share(p))
    if p and size and shown and not size.low < p.off < size.high:
        told = sized(p, size.value, "+.3g" if p.low < 0.0 else ".3g")
        told += of_largest(name, p.name, size.value, largest or {})
    return f"{title} ({told})" if told else title


def _stated(name: str, found: Found) -> str:
    """State of an effect, if it was found in another than the usual one; else ""."""
    state = str(found["state"].value) if "state" in found else ""
    usual = getattr(effects.catalogue()[name](), "state", "")
    return "" if state == usual else state


def in_words(found: Found) -> str:
    """The unit that a channel is in, or the miscount of a speed; with the others that are left, and all probabilities.

    >>> of = {"factor": Size(7 / 6, 8 / 7, 7 / 6, "1", ((7 / 6, 0.77), (8 / 7, 0.21)))}
    >>> in_words(of)
    'x7/6: 6 pole pairs set instead of 7 (0.77), or x8/7: 7 pole pairs set instead of 8 (0.21)'
    """
    each = [(words, p) for words, p in _values(found) if p >= _SEEN]
    return ", or ".join(f"{words} ({p:.2f})" for words, p in each) if len(each) > 1 else _likeliest(found)


def _likeliest(found: Found) -> str:
    """What is likeliest of them, and what is nearly as likely; "" without a factor, and for a factor of 1."""
    each = _values(found)
    near = [words for words, p in each if p > _NEARLY * each[0][1]]
    return ", or ".join([*near[:2], *([f"{len(near) - 2} others"] if len(near) > 2 else [])])


def _values(found: Found) -> list[tuple[str, float]]:
    """What a factor may be, in words, and how likely, the likeliest first."""
    if "factor" not in found:
        return []
    told = found.get("unit", found["factor"])
    each = sorted(told.odds or ((told.value, 1.0),), key=lambda one: (one[0] != told.value, -one[1]))
    words = ((_of_unit(found, v) if "unit" in found else _of_speed(v), p) for v, p in each)
    return [(w, p) for w, p in words if w]


def _of_unit(found: Found, unit: str) -> str:
    joint = " " if unit.startswith("taken") else " of " if unit.startswith("the other") else " in "
    return f"{READ[found['channel'].value]}{joint}{unit}"


def _of_speed(factor: float) -> str:
    known = next((r for r in speed_ratios() if math.isclose(r.ratio, factor, rel_tol=1e-6)), None)
    return "" if factor == 1.0 else f"x{factor:.3g}" if known is None else _miscount(known)


def of_largest(name: str, parameter: str, value: float, largest: Mapping[str, float]) -> str:
    """The same of a shifted cell, in the unit of its channel; "" for any other parameter."""
    cls = effects.catalogue()[name]
    if parameter != "zero" or cls.sensor not in largest:
        return ""
    return f" of the largest reading, {value * largest[cls.sensor]:.3g} {_UNIT[cls.sensor]}"


def _is_share(p: Parameter) -> bool:
    """Whether a number without a unit is a share of something."""
    return p.unit == "1" and p.off == 0.0 and max(abs(p.low), abs(p.high)) <= 1.0


def sized(p: Parameter, value: float, form: str = ".3g") -> str:
    """Number with its unit; a share in percent."""
    if _is_share(p):
        return f"{100.0 * value:{form}} %"
    return f"{value:{form}}" if p.unit in ("1", "") else f"{value:{form}} {p.unit}"


def _miscount(r: SpeedRatio) -> str:
    """The ratio and what makes it.

    >>> [_miscount(r) for r in speed_ratios(rarest=0.5) if r.ratio in (7.0, 7.0 / 6.0)]
    ['x7: electrical revolutions of 7 pole pairs', 'x7/6: 6 pole pairs set instead of 7']
    """
    if r.set == 1:
        return f"x{r.true}: electrical revolutions of {r.true} pole pairs"
    if r.true == 1:
        return f"x1/{r.set}: divided twice by {r.set} pole pairs"
    return f"x{r.true}/{r.set}: {r.set} {r.cause} set instead of {r.true}"

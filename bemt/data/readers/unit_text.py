"""Units as people write them in headings and cells: ``N·m``, ``1/min``, a mass for the force that it weighs.

A text with two meanings (``Hz``, ``g``) is no unit: nothing is assumed.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator

from bemt.base import units

_SAME = {
    "sec": "s", "seconds": "s", "msec": "ms", "rev/min": "rpm", "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
    "r/min": "rpm", "u/min": "rpm", "rad/s": "rad_s", "rev/s": "rev_s", "rps": "rev_s", "m/s": "m_s", "km/h": "km_h",
    "kn": "kt", "knots": "kt", "ft/s": "ft_s", "%": "pct", "degc": "C", "celsius": "C", "degf": "F",
    "kg/m3": "kg_m3", "kg/m^3": "kg_m3", "inch": "in", "inches": "in", "degrees": "deg", "degree": "deg",
    "volts": "V", "amps": "A", "watts": "W", "pa s": "Pa_s", "m^2": "m2", "n m": "Nm", "n-m": "Nm", "n cm": "Ncm",
    "n mm": "Nmm", "mn m": "mNm", "kn m": "kNm", "kgf cm": "kgf_cm", "gf cm": "gf_cm", "lbf in": "lbf_in",
    "in lbf": "lbf_in", "in-lbf": "lbf_in", "lbf ft": "lbf_ft", "ft lbf": "lbf_ft", "ft-lbf": "lbf_ft",
    "ozf in": "ozf_in", "in ozf": "ozf_in", "kgf m": "kgf_m", "microseconds": "us", "rpm": "rpm", "volt": "V",
    "watt": "W", "amp": "A", "newton": "N", "newtons": "N", "newton metre": "Nm", "newton meter": "Nm",
    "gram force": "gf", "milliseconds": "ms", "kilogram force": "kgf", "pound force": "lbf",
    "g f": "gf", "kg f": "kgf", "second": "s", "ampere": "A",
    "amperes": "A", "rad/sec": "rad_s", "m/sec": "m_s", "rev/sec": "rev_s", "percent": "pct", "tr/min": "rpm",
    "t/min": "rpm", "rad/seg": "rad_s", "vueltas/min": "rpm", "umdr/min": "rpm", "upm": "rpm", "tr mn": "rpm",
    "rev/minute": "rpm", "revs/min": "rpm", "k rpm": "krpm", "krpm": "krpm", "in hg": "inHg", "inhg": "inHg",
    "mm hg": "mmHg", "mmhg": "mmHg", "torr": "mmHg", "millibar": "mbar", "mb": "mbar",
    "giri/min": "rpm", "giri/1'": "rpm", "об/мин": "rpm", "转/分": "rpm", "轉/分": "rpm", "r/m": "rpm",
    "omw/min": "rpm",
    "obr/min": "rpm", "ot/min": "rpm", "tours/min": "rpm", "trs/min": "rpm", "rpm/min": "rpm", "rot/min": "rpm",
    "per minute": "rpm", "pro minute": "rpm", "par minute": "rpm", "por minuto": "rpm", "al minuto": "rpm",
    "min -1": "rpm", "kts": "kt", "fps": "ft_s", "kph": "km_h", "kmh": "km_h", "kilowatt": "kW", "millivolt": "mV",
    "sek": "s", "seg": "s", "secondes": "s", "sekunden": "s", "segundos": "s", "secondi": "s", "秒": "s", "с": "s",
    "в": "V", "а": "A", "вт": "W", "н": "N", "нм": "Nm", "н м": "Nm", "安": "A", "伏": "V", "瓦": "W", "牛": "N",
    "zoll": "in", "pouce": "in", "pouces": "in", "pulgadas": "in", "pollici": "in", "дюйм": "in", "英寸": "in",
    "мм": "mm", "毫米": "mm", "millimeter": "mm", "millimetre": "mm", "grad": "deg", "gradi": "deg", "grados": "deg",
    "degrés": "deg", "degres": "deg", "度": "deg",
    "pct.": "pct", "prozent": "pct", "kg/cubic metre": "kg_m3", "kp cm": "kgf_cm", "kpcm": "kgf_cm", "kgcm": "kgf_cm",
}  # fmt: skip
TWO_MEANINGS = {
    "g": "gram-force, gram or standard gravity: write gf, or say it in recording.toml",
    "G": "gram-force or standard gravity: write gf, or say it in recording.toml",
    "kg": "a mass: write kgf for a force",
    "lb": "a mass: write lbf for a force", "lbs": "a mass: write lbf for a force",
    "oz": "a mass: write ozf for a force", "Hz": "revolutions, blades or electrical periods: say it in recording.toml",
    "kg cm": "a mass times a length: write kgf_cm", "g cm": "a mass times a length: write gf_cm",
    "G cm": "a mass times a length: write gf_cm", "oz in": "a mass times a length: write ozf_in",
    "lb in": "a mass times a length: write lbf_in", "in lb": "a mass times a length: write lbf_in",
    "lb ft": "a mass times a length: write lbf_ft", "ft lb": "a mass times a length: write lbf_ft",
    "in oz": "a mass times a length: write ozf_in", "kg m": "a mass times a length: write kgf_m",
    "1/s": "revolutions or radians per second: write rev/s or rad/s", "grams": "a mass: write gf for a force",
    "s-1": "revolutions or radians per second: write rev/s or rad/s", "pounds": "a mass: write lbf for a force",
    "s^-1": "revolutions or radians per second: write rev/s or rad/s",
    "g/W": "a mass per power: write gf/W", "G/W": "a mass per power: write gf/W",
}  # fmt: skip
_COMPOUND = {
    "gf/W": units.Unit("N_W", "efficacy", units.KGF * 1e-3), "kgf/W": units.Unit("N_W", "efficacy", units.KGF),
    "N/W": units.Unit("N_W", "efficacy", 1.0), "lbf/W": units.Unit("N_W", "efficacy", units.LBF),
    "m/s2": units.Unit("m_s2", "acceleration", 1.0), "m/s^2": units.Unit("m_s2", "acceleration", 1.0),
    "daN": units.Unit("", "force", 10.0), "cN": units.Unit("", "force", 0.01), "kp": units.UNITS["kgf"],
    "uNm": units.Unit("", "torque", 1e-6), "PS": units.Unit("", "power", 75.0 * units.KGF),
    "ch": units.Unit("", "power", 75.0 * units.KGF),
}  # fmt: skip
_MOJIBAKE = (("Âµ", "µ"), ("Âμ", "µ"), ("Î¼", "µ"), ("Â·", "·"), ("â‹…", "·"), ("Â°", "°"), ("Â²", "²"), ("Â³", "³"))
"""UTF-8 that a program took for Latin-1 or its Windows form."""
WEIGHTS = {
    "g": "gf", "grams": "gf", "gram": "gf", "gr": "gf", "gramm": "gf", "kg": "kgf", "kgs": "kgf", "kilograms": "kgf",
    "kilogram": "kgf", "kilogramm": "kgf", "lb": "lbf", "lbs": "lbf", "pounds": "lbf", "oz": "ozf", "ounces": "ozf",
    "gramme": "gf", "grammes": "gf", "grammi": "gf", "gramos": "gf", "gramas": "gf", "г": "gf", "гр": "gf", "克": "gf",
    "кг": "kgf", "公斤": "kgf",
}  # fmt: skip
"""Units of mass in which stands state a force, that which the mass weighs: in small letters, as `weighs` takes them."""
FORCES = {"gf": "gram-force", "kgf": "kilogram-force", "lbf": "pound-force", "ozf": "ounce-force"}
_ANY_CASE = {"v": "V", "a": "A", "w": "W", "n": "N", "nm": "Nm", "gf": "gf", "kgf": "kgf", "lbf": "lbf", "s": "s",
             "kw": "kW", "pa": "Pa", "hpa": "hPa", "kpa": "kPa", "c": "C", "f": "F", "k": "K", "ncm": "Ncm", "hp": "hp",
             "us": "us", "kn": "kN", "m/s": "m_s", "mm": "mm", "cm": "cm", "m": "m", "in": "in", "deg": "deg",
             "rad": "rad"}  # fmt: skip
"""Units that capitals do not change where the quantity is known."""


BY_THE_CASE = "a coefficient becomes a load by density, speed and diameter of the case, or the stated ones"


def si_name(unit: units.Unit) -> str:
    """Unit after conversion: SI, ``rpm``, "-" without dimension."""
    if unit.dimension in ("none", "fraction"):
        return "-"
    if unit.dimension in ("efficacy", "acceleration"):
        return {"efficacy": "N/W", "acceleration": "m/s2"}[unit.dimension]
    if unit.dimension == "angular_speed" and unit.suffix in ("rpm", ""):  # "": already made to give rev/min
        return "rpm"
    return units.suffixes(unit.dimension)[0]


def unit_of(text: str) -> units.Unit | str:
    """Unit that a text states.

    >>> unit_of("N·m").suffix, unit_of("µs").suffix, unit_of("1/min").suffix
    ('Nm', 'us', 'rpm')
    >>> unit_of("kg")
    'a mass: write kgf for a force'
    """
    t = text.strip()
    for wrong, right in _MOJIBAKE:
        t = t.replace(wrong, right)
    t = unicodedata.normalize("NFKC", t.replace("º", "°").replace("⁻", "^-", 1)).replace("\u2212", "-")
    t = re.sub(r"[·⋅∙•×*]|(?<=[A-Za-z])[.-](?=[A-Za-z])", " ", t).replace("µ", "u").replace("μ", "u")
    t = " ".join(re.sub("[°˚]", "deg", t).split()).replace("^^", "^")
    power = re.fullmatch(r"(\w+) (\w+)\^?-([123])", t)  # m s^-1
    if power:
        t = f"{power[1]}/{power[2]}" + (power[3] if power[3] != "1" else "")
    if t in _COMPOUND:
        return _COMPOUND[t]
    if t in TWO_MEANINGS:
        return TWO_MEANINGS[t]
    if t in units.UNITS:
        return units.UNITS[t]
    key = _SAME.get(t.lower())
    if key is not None:
        return units.UNITS[key]
    return ""


def weighs(text: str) -> str:
    """Force that a unit of mass stands for, in any letters; "" for any other text.

    >>> weighs("Gramm"), weighs("KG"), weighs("N")
    ('gf', 'kgf', '')
    """
    return WEIGHTS.get(unicodedata.normalize("NFKC", text).lower(), "")


def unit_for(dimension: str, text: str) -> tuple[units.Unit, str] | None:
    """Unit of a quantity of known dimension ("": any), and what was taken for granted."""
    found = unit_of(text)
    if not dimension:
        return (found, "") if isinstance(found, units.Unit) else None
    if dimension == "force" and (weight := weighs(text)):
        return units.UNITS[weight], f"{FORCES[weight]}: 1 {text} weighs {units.UNITS[weight].factor:.4g} N"
    if dimension == "torque" and isinstance(found, str) and (weight := weight_of(text)):
        made = unit_of(weight)
        assert isinstance(made, units.Unit)
        return made, f"{weight.replace(' ', ' times ')}: a weight, as stands mean it"
    if dimension == "acceleration" and text == "g":
        return units.Unit("m_s2", dimension, units.G0), ""
    if not isinstance(found, units.Unit):
        found = units.UNITS.get(_ANY_CASE.get(text.lower(), ""), "")
    return (found, "") if isinstance(found, units.Unit) and found.dimension == dimension else None


def weight_of(text: str) -> str:
    """Unit of a torque that is written as a mass times a length, with the weight for the mass; "" for any other."""
    words = re.split(r"[\s·⋅*.\-/]+", text.strip())
    if len(words) != 2:
        return ""
    masses = [w for w in words if weighs(w)]
    lengths = [w for w in words if w in ("cm", "m", "in", "ft", "mm")]
    unit = f"{weighs(masses[0])} {lengths[0]}" if len(masses) == 1 == len(lengths) else ""
    return unit if isinstance(unit_of(unit), units.Unit) else ""


def splits(text: str) -> Iterator[tuple[str, str]]:
    """Ways to take a heading for words and a unit: in brackets, else at its end, else all words."""
    for found in re.finditer(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]", text):
        yield text[: found.start()] + " " + text[found.end() :], found[1].strip()
    if not re.search(r"[(\[]", text):
        for mark in (r"\s+(?:in|en|em)\s+", r"\s+[-\u2013\u2014:]\s+", r"\s*[,;:]\s*", r"\s*/\s*", r"[\s_-]+"):
            for found in re.finditer(mark, text):
                unit = text[found.end() :]
                if not (mark.startswith("[") and found[0] != "_" and unit in ("A", "in", "a")):
                    yield text[: found.start()], unit
    yield text, ""


def _unit_at_end(text: str) -> str:
    """Longest end of a text that is a unit, or a mass or the like that stands for one; "" without one."""
    parts = re.split(r"[_ (\[]+", text.strip(" )]"))
    ends = ("_".join(parts[k:]) for k in range(len(parts)))
    return next((end for end in ends if unit_of(end) != ""), "")


def either(text: str) -> str:
    """Doubt about a heading that names two units with an "or" between them; "" for any other.

    >>> either("value_N_or_Nm")
    'N or Nm: one column holds one unit; give each quantity a column of its own'
    >>> either("CT_or_CP")
    ''
    """
    first, *rest = (_unit_at_end(part) for part in re.split(r"[_ ]or[_ ]", text, flags=re.IGNORECASE))
    if not rest or not first or not all(rest):
        return ""
    return f"{' or '.join([first, *rest])}: one column holds one unit; give each quantity a column of its own"

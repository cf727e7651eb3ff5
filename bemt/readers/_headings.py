"""Headings of columns: the name of the channel and the unit, from the text alone.

A heading without a unit, or with one that has two meanings (``Hz``), gives unit None: nothing is assumed. A mass in a
column of thrust is the force that it weighs, and a line says so.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace

from bemt.base import units
from bemt.readers._words import english, plain, quantities

_SAME = {
    "sec": "s", "seconds": "s", "msec": "ms", "rev/min": "rpm", "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
    "r/min": "rpm", "u/min": "rpm", "rad/s": "rad_s", "rev/s": "rev_s", "rps": "rev_s", "m/s": "m_s", "km/h": "km_h",
    "kn": "kt", "knots": "kt", "ft/s": "ft_s", "%": "pct", "degc": "C", "celsius": "C", "degf": "F",
    "kg/m3": "kg_m3", "kg/m^3": "kg_m3", "inch": "in", "inches": "in", "degrees": "deg", "degree": "deg",
    "volts": "V", "amps": "A", "watts": "W", "pa s": "Pa_s", "m^2": "m2", "n m": "Nm", "n-m": "Nm", "n cm": "Ncm",
    "n mm": "Nmm", "mn m": "mNm", "kgf cm": "kgf_cm", "gf cm": "gf_cm", "lbf in": "lbf_in", "in lbf": "lbf_in",
    "in-lbf": "lbf_in", "lbf ft": "lbf_ft", "ft lbf": "lbf_ft", "ft-lbf": "lbf_ft", "ozf in": "ozf_in",
    "in ozf": "ozf_in", "kgf m": "kgf_m", "microseconds": "us", "rpm": "rpm", "volt": "V", "watt": "W", "amp": "A",
    "newton": "N", "newtons": "N", "newton metre": "Nm", "newton meter": "Nm", "gram force": "gf", "milliseconds": "ms",
    "kilogram force": "kgf", "pound force": "lbf", "g f": "gf", "kg f": "kgf", "second": "s", "ampere": "A",
    "amperes": "A", "rad/sec": "rad_s", "m/sec": "m_s", "rev/sec": "rev_s", "percent": "pct", "tr/min": "rpm",
    "t/min": "rpm", "rad/seg": "rad_s", "vueltas/min": "rpm", "umdr/min": "rpm", "upm": "rpm", "tr mn": "rpm",
    "rev/minute": "rpm", "revs/min": "rpm", "k rpm": "krpm", "krpm": "krpm", "in hg": "inHg", "inhg": "inHg",
    "mm hg": "mmHg", "mmhg": "mmHg", "torr": "mmHg", "millibar": "mbar", "mb": "mbar",
    "giri/min": "rpm", "giri/1'": "rpm", "об/мин": "rpm", "转/分": "rpm", "轉/分": "rpm", "r/m": "rpm",
    "omw/min": "rpm",
    "obr/min": "rpm", "ot/min": "rpm", "tours/min": "rpm", "trs/min": "rpm", "rpm/min": "rpm", "rot/min": "rpm",
    "min -1": "rpm", "kts": "kt", "fps": "ft_s", "kph": "km_h", "kmh": "km_h", "kilowatt": "kW", "millivolt": "mV",
    "sek": "s", "seg": "s", "secondes": "s", "sekunden": "s", "segundos": "s", "secondi": "s", "秒": "s", "с": "s",
    "в": "V", "а": "A", "вт": "W", "н": "N", "нм": "Nm", "н м": "Nm", "安": "A", "伏": "V", "瓦": "W", "牛": "N",
    "pct.": "pct", "prozent": "pct", "kg/cubic metre": "kg_m3", "kp cm": "kgf_cm", "kpcm": "kgf_cm", "kgcm": "kgf_cm",
}  # fmt: skip
_TWO_MEANINGS = {
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
_PURE = re.compile(
    r"(CT|CP|CQ|KT|KQ|10KQ|CT_total|KT_total|KT_nozzle|KT_propeller|J|eta0?|FM|Re|M_tip|run|tip_Mach|Mach|throttle|sigma"
    r"|[A-Za-z]\w*?/(?![NAVWKCF]\b)[A-Z]|[A-Za-z]\w*_over_[A-Za-z]|[xyz]/c|\w+_ratio|CT_rotor|CP_rotor|CQ_rotor"
    r"|C_[TPQ]|C[tpq])"
)
_PURE_NAMES = {"Ct": "CT", "C_T": "CT", "C_P": "CP", "C_Q": "CQ"}  # Cp may be that of a pressure: the table tells
_ALONE = {  # a heading that is the name of a unit
    "volts": ("voltage", "V"), "volt": ("voltage", "V"), "amps": ("current", "A"), "amp": ("current", "A"),
    "amperes": ("current", "A"), "watts": ("P", "W"), "newtons": ("F", "N"),
}  # fmt: skip
_WORDS = {  # heading in lower case that `_words` has no quantity for, or leaves open -> name, dimension
    "time": ("time", "time"), "airspeed": ("airspeed", "speed"), "throttle": ("throttle", "fraction"),
    "esc signal": ("pulse_width", "time"), "esc": ("pulse_width", "time"), "pwm": ("pulse_width", "time"),
    "motor optical speed": ("optical", "angular_speed"), "motor electrical speed": ("electrical", "angular_speed"),
    "elapsed": ("time", "time"), "elapsed time": ("time", "time"), "time since start": ("time", "time"),
    "timestamp": ("time", "time"), "air speed": ("airspeed", "speed"), "throttle input": ("throttle", "fraction"),
    "pressure": ("pressure", "pressure"), "temperature": ("temperature", "temperature"),
    "rotation speed": ("speed", "angular_speed"), "rotational speed": ("speed", "angular_speed"),
    "motor speed": ("speed", "angular_speed"), "rotor speed": ("speed", "angular_speed"),
    "propeller speed": ("speed", "angular_speed"), "force fz (thrust)": ("thrust", "force"),
    "torque mz (torque)": ("torque", "torque"), "electrical speed": ("electrical", "angular_speed"),
    "optical speed": ("optical", "angular_speed"), "vibration": ("vibration", "acceleration"),
    "accx": ("acceleration_x", "acceleration"), "accy": ("acceleration_y", "acceleration"),
    "accz": ("acceleration_z", "acceleration"),
}  # fmt: skip
WEIGHTS = {
    "g": "gf", "G": "gf", "grams": "gf", "gram": "gf", "gr": "gf", "gramm": "gf", "kg": "kgf", "Kg": "kgf", "KG": "kgf",
    "kgs": "kgf", "kilograms": "kgf", "lb": "lbf", "lbs": "lbf", "pounds": "lbf", "oz": "ozf", "ounces": "ozf",
    "grammes": "gf", "grammi": "gf", "gramos": "gf", "gramas": "gf", "г": "gf", "гр": "gf", "克": "gf", "кг": "kgf",
    "公斤": "kgf", "GRAMS": "gf", "GRAM": "gf", "LB": "lbf", "LBS": "lbf", "OZ": "ozf", "kilogram": "kgf",
}  # fmt: skip
"""Units of mass in which stands state a force: that which the mass weighs."""
_FORCES = {"gf": "gram-force", "kgf": "kilogram-force", "lbf": "pound-force", "ozf": "ounce-force"}
_THRUSTS = re.compile(
    r"((motor|propeller|prop|rotor|static|max|mean|average|avg|measured|total) )*"
    r"(thrust|lift|pull|force|load|load ?cell)( (static|force|mean|average|measured))*|t|f"
)
_GOES: dict[str, tuple[str, ...]] = {  # what a suffix may be: T_A is rotor A's thrust, not a current
    "thrust": ("force",), "lift": ("force",), "torque": ("torque",), "power": ("power",), "rpm": ("angular_speed",),
    "voltage": ("voltage",), "current": ("current",), "T": ("force", "temperature", "time"), "F": ("force",),
    "Q": ("torque",), "M": ("torque",), "P": ("power", "pressure", "length"), "I": ("current",), "U": ("voltage",),
    "V": ("voltage", "speed"), "n": ("angular_speed",), "D": ("length",), "R": ("length",), "r": ("length",),
}  # fmt: skip
_QUALIFIED = re.compile(
    r"(?:(?:static|measured|mean|average|avg|propeller|prop|motor|rotor|output) )*(thrust|torque)"
    r"(?: (?:force|static|mean|average|avg|measured))*|(?:f|t) (thrust)|(?:q|m) (torque)|(thrust) t|(torque) q"
)
"""Words that a thrust or a torque goes with and that make no other quantity of it."""
_SEPARATORS = (r"\s+[-–—]\s+", r"\s*,\s*", r"\s+in\s+", r"\s*/\s*", r"\s+")
_MOJIBAKE = (("Âµ", "µ"), ("Î¼", "µ"), ("Â·", "·"), ("â‹…", "·"), ("Â°", "°"), ("Â²", "²"), ("Â³", "³"))
"""UTF-8 that a program took for Latin-1 or its Windows form."""
_SHAFT_LETTERS = {"n", "ω"}
_SHAFT_WORDS = set("speed omega rotation rotational rev revs revolution revolutions rps rpm krpm".split())
_SHAFT_PARTS = {"motor", "rotor", "shaft", "prop", "propeller", "fan"}
_OTHER_SPEEDS = {
    "air", "airspeed", "wind", "flow", "tip", "sound", "stream", "freestream", "tunnel", "flight", "ground", "vehicle",
    "climb", "err", "error", "u", "std", "sd",
}  # fmt: skip
"""Words of a heading that make it a speed of rotation, and of other speeds or of an uncertainty."""
_THOUSANDS = re.compile(
    r"(?P<of>.*?)[\s_]*(?:[\[(]?\s*k[ -]?rpm\s*[\])]?"
    r"|rpm\s*(?:[\[(]\s*[x×*/]?|[x×*/])\s*(?:1000|1e3|10\^3|10³|k|thousands?)\s*[\])]?"
    r"|[\[(]?\s*(?:1000|1e3|10\^3|10³)\s*[x×*]?\s*rpm\s*[\])]?)",
    re.IGNORECASE,
)
"""Speeds in thousands: ``kRPM``, ``RPM x1000``, ``rpm (k)``, ``Speed [1000 rpm]``."""
_TURNS = {
    "rotation", "rotational", "rev", "revs", "revolution", "revolutions", "shaft", "prop", "propeller", "rotor", "fan",
}  # fmt: skip
"""Words with which a frequency counts revolutions; that of a motor may count electrical periods."""
_AROUND = {
    "ambient", "amb", "tamb", "pamb", "air", "room", "lab", "laboratory", "outside", "outdoor", "oat", "atmospheric",
    "atmosphere", "atm", "baro", "barometer", "barometric", "environment", "environmental", "tunnel", "tair",
    "umgebung", "umgebungstemperatur", "umgebungsdruck", "raumtemperatur", "ambiante", "ambiente",
}  # fmt: skip
"""Words that make a temperature, pressure, humidity or density that of the air around the rotor."""
_SEA_LEVEL = "a pressure reduced to sea level: give that of the station (QFE)"


@dataclass(frozen=True)
class Heading:
    """What a heading says.

    ``text``, ``name`` of the channel, ``unit`` (None: unknown), ``doubt`` about the unit, ``told`` what was taken for
    granted.
    """

    text: str
    name: str
    unit: units.Unit | None
    doubt: str = ""
    told: str = ""

    @property
    def unit_name(self) -> str:
        """Unit of the channel after conversion: SI, ``rpm``, "-" without dimension, "" unknown."""
        if self.unit is None:
            return ""
        return _si_name(self.unit)


def _si_name(unit: units.Unit) -> str:
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
    if t in _TWO_MEANINGS:
        return _TWO_MEANINGS[t]
    if t in units.UNITS:
        return units.UNITS[t]
    key = _SAME.get(t.lower())
    if key is not None:
        return units.UNITS[key]
    return ""


def known(text: str, base: str, unit: str) -> Heading:
    """Heading of a column that a reader knows: its name without the unit, and the unit ("-": none).

    >>> known("th", "thrust", "gf").name, known("Speed", "", "rpm").name, known("out", "throttle", "pct").name
    ('thrust_N', 'rpm', 'throttle')
    """
    found = units.Unit("", "none", 1.0) if unit == "-" else unit_of(unit)
    assert isinstance(found, units.Unit), unit
    return Heading(text, _channel(base, found).lstrip("_"), found)


def _channel(base: str, unit: units.Unit) -> str:
    """Name of a channel with its unit in SI."""
    si = _si_name(unit).replace("/", "_")
    return base if si == "-" else f"{base}_{si}"


def _tail(core: str) -> tuple[str, units.Unit | str] | None:
    """Name and unit of a heading that ends in its unit without brackets: ``Thrust - gf``, ``T/N``, ``torque Nm``.

    A bar or a blank alone counts only where the name asks for such a unit: ``c/R`` is a ratio, ``Thrust A`` a rotor.
    """
    for separator in _SEPARATORS:
        for found in reversed(list(re.finditer(separator, core))):
            name, tail = core[: found.start()], core[found.end() :]
            unit = unit_of(tail)
            if not name or unit == "":
                continue
            if isinstance(unit, str):
                if separator in _SEPARATORS[:3]:
                    return name, f"{tail!r} is {unit}"
                continue
            word = _WORDS.get(name.lower().replace("_", " "))
            last = re.split(r"[\s_]+", name)[-1]
            goes = _GOES.get(last if len(last) == 1 else last.lower(), (word[1],) if word else ())
            loose = separator in _SEPARATORS[:3] and not goes
            letter = separator == _SEPARATORS[4] and tail in ("A", "C", "F", "in")
            if (unit.dimension in goes or loose) and not letter:
                return name, unit
    return None


def slug(text: str) -> str:
    """Name of a channel made of words: blanks and signs become underscores."""
    return re.sub(r"_+", "_", re.sub(r"[^\w/]+", "_", text.strip())).strip("_")


def _spoken(text: str) -> tuple[str, set[str]]:
    """What stands before the unit of a heading, in plain English, and its words."""
    base = re.split(r"[(\[]", plain(text))[0].strip()
    return base, set(english(base))


def meanings(text: str) -> list[str]:
    """Quantities of a recording.toml that the words of a heading may mean.

    >>> meanings("Schub"), meanings("speed"), meanings("wibble")
    (['thrust'], ['rpm', 'airspeed'], [])
    """
    found = [name for name, _ in quantities(english(re.split(r"[(\[]", text)[0]))]
    return ["power" if name == "mechanical power" else name.replace(" ", "_") for name in found]


def may_be_shaft_speed(text: str) -> bool:
    """Tell whether the words of a heading fit a speed of rotation; its unit is not looked at.

    >>> [may_be_shaft_speed(t) for t in ("speed", "n (1/s)", "Drehzahl", "motor speed [Hz]", "wind speed", "thrust")]
    [True, True, True, True, False, False]
    """
    base, words = _spoken(text)
    turning = words & _SHAFT_PARTS and words & {"hz", "freq", "frequency"}
    return base in _SHAFT_LETTERS or bool((words & _SHAFT_WORDS or turning) and not words & _OTHER_SPEEDS)


def surely_shaft_speed(text: str) -> bool:
    """Tell whether such a heading names no airspeed.

    >>> surely_shaft_speed("omega"), surely_shaft_speed("speed")
    (True, False)
    """
    base, words = _spoken(text)
    named = base in _SHAFT_LETTERS or words & (_SHAFT_PARTS | _SHAFT_WORDS) - {"speed"}
    return may_be_shaft_speed(text) and bool(named)


def heading(text: str) -> Heading:
    """Read one heading, in English, German, French or Spanish.

    >>> heading("Thrust (gf)").name, heading("Q(Nm)").name, heading("RPM").name, heading("chord_mm").name
    ('thrust_N', 'Q_Nm', 'rpm', 'chord_m')
    >>> heading("omega").name, heading("omega").unit is None
    ('omega', True)
    >>> heading("Drehzahl [1/min]").name, heading("Poussée (N)").name, heading("Thrust (g)").name
    ('rpm', 'thrust_N', 'thrust_N')
    >>> heading("thrust_g").name, heading("thrust_g").told
    ('thrust_N', "'thrust_g' is read as gram-force: 1 g weighs 0.009807 N")
    >>> heading("Ambient Temp (C)").name, heading("RPM x1000").name, heading("Prop RPM").name
    ('temperature_K', 'rpm', 'rpm')
    """
    text = " ".join(text.split())
    if re.fullmatch(r"[a-z]{2,}[A-Z]\w*", text):  # thrustGrams
        return replace(heading(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)), text=text)
    if thousands := _THOUSANDS.fullmatch(text):
        found = _heading(f"{thousands['of']} (rpm)" if thousands["of"] else "rpm")
        told = f"{text!r} is read as thousands of revolutions per minute"
        return replace(found, text=text, unit=units.Unit("", "angular_speed", 1e3), told=told)
    parts = re.fullmatch(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*", text)
    if not parts and (loose := re.fullmatch(r"(.+?)(?:[_ ]| - |, ?)(\w+)", text)) and loose[2] in WEIGHTS:
        parts = loose  # thrust_g, Thrust kg
    if (by_words := _by_words(text)) is not None:
        return by_words
    unit = WEIGHTS.get(parts[2]) if parts else None
    if parts and unit and _THRUSTS.fullmatch(plain(parts[1])):
        found = heading(f"{parts[1]} ({unit})")
        told = f"{text!r} is read as {_FORCES[unit]}: 1 {parts[2]} weighs {units.UNITS[unit].factor:.4g} N"
        return replace(found, text=text, told=told)
    if parts and parts[2] in ("Hz", "1/s") and (said := _spoken(parts[1])[1]) & _TURNS and "electrical" not in said:
        turns = units.Unit("", "angular_speed", 60.0)
        return Heading(text, "rpm", turns, told=f"{text!r} is read as revolutions per second")
    if parts and re.fullmatch(r"[gG]/W", parts[2]):
        return replace(_heading(f"{parts[1]} (gf/W)"), text=text, told=f"{text!r} is read as gf/W")
    if parts and (qualified := _QUALIFIED.fullmatch(plain(parts[1]))):
        name = next(word for word in qualified.groups() if word)
        unit = _weight(parts[2]) if name == "torque" else ""
        found = _heading(f"{name} ({unit or parts[2]})")
        if found.unit is not None and unit:
            told = f"{text!r} is read as {unit.replace(' ', ' times ')}: a weight, as stands mean it"
            return replace(found, text=text, told=told)
        if found.unit is not None:
            return replace(found, text=text)
    found = _heading(text)
    if found.unit is None and not found.doubt and not text.isascii() and quantities(words := english(text)):
        return replace(found, name=slug(" ".join(dict.fromkeys(words))))
    return found


def _splits(text: str) -> Iterator[tuple[str, str]]:
    """Ways to take a heading for words and a unit: in brackets, else at its end, else all words."""
    for found in re.finditer(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]", text):
        yield text[: found.start()] + " " + text[found.end() :], found[1].strip()
    if not re.search(r"[(\[]", text):
        for mark in (r"\s+(?:in|en|em)\s+", r"\s+[-\u2013\u2014:]\s+", r"\s*[,;:]\s*", r"\s*/\s*", r"[\s_-]+"):
            for found in re.finditer(mark, text):
                unit = text[found.end() :]
                if not (mark.startswith("[") and found[0] != "_" and unit in ("A", "C", "F", "in", "a", "c", "f")):
                    yield text[: found.start()], unit
    yield text, ""


_ANY_CASE = {"v": "V", "a": "A", "w": "W", "n": "N", "nm": "Nm", "gf": "gf", "kgf": "kgf", "lbf": "lbf", "s": "s",
             "kw": "kW", "pa": "Pa", "hpa": "hPa", "kpa": "kPa", "c": "C", "f": "F", "k": "K", "ncm": "Ncm", "hp": "hp",
             "us": "us", "kn": "kN", "m/s": "m_s"}  # fmt: skip
"""Units that capitals do not change where the quantity is known."""


def unit_for(dimension: str, text: str) -> tuple[units.Unit, str] | None:
    """Unit of a quantity of known dimension ("": any), and what was taken for granted."""
    found = unit_of(text)
    if not dimension:
        return (found, "") if isinstance(found, units.Unit) else None
    if dimension == "force" and (weight := WEIGHTS.get(unicodedata.normalize("NFKC", text))):
        return units.UNITS[weight], f"{_FORCES[weight]}: 1 {text} weighs {units.UNITS[weight].factor:.4g} N"
    if dimension == "torque" and isinstance(found, str) and (weight := _weight(text)):
        made = unit_of(weight)
        assert isinstance(made, units.Unit)
        return made, f"{weight.replace(' ', ' times ')}: a weight, as stands mean it"
    if not isinstance(found, units.Unit):
        found = units.UNITS.get(_ANY_CASE.get(text.lower(), ""), "")
    return (found, "") if isinstance(found, units.Unit) and found.dimension == dimension else None


_COEFFICIENT = re.compile(r"(thrust|power|torque) coeff(?:icient)?(?: c ?[tpq]| c[tpq])?|(adv(?:ance)? ratio)(?: j)?")
_LETTER = {"thrust": "CT", "power": "CP", "torque": "CQ"}


def _by_words(text: str) -> Heading | None:
    """Heading whose words are one quantity, in any of the languages, with a unit that goes with it; None: another."""
    bare = unicodedata.normalize("NFKC", text.replace("⁻", "^-")).replace("\u2212", "-")
    words = english(re.sub(r"[(\[] ?-? ?[)\]]", " ", bare))
    if found := _COEFFICIENT.fullmatch(" ".join(words)):
        return Heading(text, "J" if found[2] else _LETTER[found[1]], units.Unit("", "none", 1.0))
    if re.fullmatch(r"t\s*[(\[]\s*\w+\s*[)\]]", bare) and isinstance(
        unit := unit_of(bare[1:].strip(" ()[]")), units.Unit
    ):
        if unit.dimension == "time":
            return Heading(text, "time_s", unit)
    for base, unit in _splits(bare):
        words = english(base)
        for name, dimension in quantities(words):
            if not unit:
                if name == "rpm" and "rpm" in words:
                    return Heading(text, "rpm", units.UNITS["rpm"])
                if set(words) == {"throttle"} and not re.search(r"[\s_]", bare):
                    return Heading(text, "throttle", units.Unit("", "none", 1.0))
                continue
            if (goes := unit_for(dimension, unit)) is None:
                continue
            made, told = goes
            if dimension == "angular_speed":
                if made.suffix == "rad_s":  # an angular speed is the reduction's to convert
                    turns = units.Unit("", "angular_speed", 1.0 / units.RPM)
                    return Heading(text, "rpm", turns) if words == ["rotation", "speed"] else None
                made = made if made.suffix == "rpm" else units.Unit("", "angular_speed", made.factor / units.RPM)
                return Heading(text, "rpm", made)
            return Heading(text, _channel(slug(name), made), made, told=f"{text!r} is read as {told}" if told else "")
    return None


def _weight(text: str) -> str:
    """Unit of a torque that is written as a mass times a length, with the weight for the mass; "" for any other."""
    words = re.split(r"[\s·⋅*.\-/]+", text.strip())
    if len(words) != 2:
        return ""
    masses = [w for w in words if w in WEIGHTS]
    lengths = [w for w in words if w in ("cm", "m", "in", "ft", "mm")]
    unit = f"{WEIGHTS[masses[0]]} {lengths[0]}" if len(masses) == 1 == len(lengths) else ""
    return unit if isinstance(unit_of(unit), units.Unit) else ""


def _unit_at_end(text: str) -> str:
    """Longest end of a text that is a unit, or a mass or the like that stands for one; "" without one."""
    parts = re.split(r"[_ (\[]+", text.strip(" )]"))
    ends = ("_".join(parts[k:]) for k in range(len(parts)))
    return next((end for end in ends if unit_of(end) != ""), "")


def _either(text: str) -> str:
    """Doubt about a heading that names two units with an "or" between them; "" for any other.

    >>> _either("value_N_or_Nm")
    'N or Nm: one column holds one unit; give each quantity a column of its own'
    >>> _either("CT_or_CP")
    ''
    """
    first, *rest = (_unit_at_end(part) for part in re.split(r"[_ ]or[_ ]", text, flags=re.IGNORECASE))
    if not rest or not first or not all(rest):
        return ""
    return f"{' or '.join([first, *rest])}: one column holds one unit; give each quantity a column of its own"


def _of_the_air(base: str, unit: units.Unit) -> str:
    """Quantity of the air around the rotor that a heading names; "qnh" for a pressure that is no local one; "" none."""
    words = set(re.findall(r"[^\W\d_]+", plain(base)))
    if unit.dimension == "pressure" and words & {"qnh", "slp"}:
        return "qnh"
    if unit.dimension == "fraction" and (words & {"humidity", "rh", "luftfeuchte", "luftfeuchtigkeit", "humedad"}):
        return "humidity"
    if unit.dimension in ("temperature", "pressure") and (words & _AROUND or words in ({"t", "inf"}, {"p", "inf"})):
        return unit.dimension
    if unit.dimension == "density" and words & {"rho", "density", "luftdichte"}:
        return "density"
    return ""


def _without_brackets(core: str, text: str) -> tuple[str, units.Unit | None, str]:
    """Name, unit and doubt of a heading that has no unit in brackets."""
    if alone := _ALONE.get(core.lower()):
        return alone[0], units.UNITS[alone[1]], ""
    if (ending := _tail(core)) is not None:
        name, stated = ending
        return (name, stated, "") if isinstance(stated, units.Unit) else (name, None, stated)
    name, suffix = units.split_suffix(core)
    goes = _GOES.get(name.split("_")[-1].lower() if len(name) > 1 else name)
    if re.fullmatch(r"(e[_ ]?)?rpm(_\w)?", core, re.IGNORECASE):  # before suffixes: rpm_A is no current
        return core, units.UNITS["rpm"], ""
    if suffix is not None and goes is not None and suffix.dimension not in (*goes, "mass"):
        return text, None, f"{suffix.suffix!r} does not go with {name}"
    if suffix is not None and suffix.dimension == "mass" and not re.search(r"weight|mass", name, re.IGNORECASE):
        return text, None, f"{suffix.suffix!r} is {_TWO_MEANINGS[suffix.suffix]}"
    if suffix is not None and (name or suffix.dimension == "mass"):
        return name, suffix, ""
    pure = units.Unit("", "none", 1.0)
    if _PURE.fullmatch(core) and ("rotor convention" not in text or core.endswith("_rotor")):
        return _PURE_NAMES.get(core, core), pure, ""
    if re.fullmatch(r"\w+/[NAVWKCF]", core):
        return text, None, f"{core!r} is a ratio, or a quantity and its unit: write the unit in brackets"
    if "rotor convention" in text and core in ("CT", "CP", "CQ"):
        return f"{core}_rotor", pure, ""
    if re.fullmatch(r"rpm([_ ]\w+)?|\w+[_ ]rpm", core, re.IGNORECASE):
        return core, units.UNITS["rpm"], ""
    return text, None, ""


def _heading(text: str) -> Heading:
    if either := _either(text):
        return Heading(text, slug(text), None, either)
    base, unit, doubt = text, None, ""
    found = re.fullmatch(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*", text)
    if found:
        stated = unit_of(found[2])
        if isinstance(stated, units.Unit):
            base, unit = found[1], stated
        elif stated:
            base, doubt = found[1], f"{found[2]!r} is {stated}"
    core = re.split(r"[(\[=]", base)[0].strip() if unit is None and not doubt else base
    if found and (found[2].strip().lower() in ("erpm", "electrical") and "rpm" in text.lower()):
        return Heading(text, "electrical_rpm", units.UNITS["rpm"])
    if unit is None and not doubt:
        base, unit, doubt = _without_brackets(core, text)
    word = _WORDS.get(base.lower().replace("_", " "))
    if word and word[1] == "acceleration" and doubt.startswith("'g'"):
        unit, doubt = units.Unit("m_s2", "acceleration", units.G0), ""
    if unit is None and not doubt and unit_of(core) == units.UNITS["rpm"]:
        base, unit = "rpm", units.UNITS["rpm"]  # U/min, 1/min
    if unit is None:
        return Heading(text, slug(text) or "column", None, doubt)
    if around := _of_the_air(base, unit):
        if around == "qnh":
            return Heading(text, slug(text), None, _SEA_LEVEL)
        base, word = around, None
    if unit.offset and base.startswith("u_"):  # an uncertainty in Celsius is one in kelvin
        unit = units.Unit(unit.suffix, unit.dimension, unit.factor)
    if word and word[1] == unit.dimension:
        base = word[0]
        if unit.dimension == "angular_speed" and unit.suffix != "rpm":
            unit = units.Unit("", "angular_speed", unit.factor / units.RPM)
    if unit.dimension == "angular_speed" and unit.suffix in ("rpm", ""):
        flat = re.sub(r"^(speed|n)$|_?rpm_?", "", slug(base), flags=re.IGNORECASE)
        flat = re.sub(r"^[A-Z][a-z]{2,}$", lambda word: word[0].lower(), flat)
        flat = "electrical" if flat.lower() == "e" else flat
        return Heading(text, f"{flat}_rpm" if flat else "rpm", unit)
    base = re.sub(r"\b[A-Z][a-z]{2,}", lambda word: word[0].lower(), base)
    return Heading(text, _channel(slug(base), unit), unit)

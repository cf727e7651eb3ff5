"""Headings of columns: the name of the channel and the unit, from the text alone.

A heading without a unit, or with one that has two meanings (``Hz``), gives unit None: nothing is assumed. A mass in a
column of thrust is the force that it weighs, and a line says so.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass, replace
from functools import lru_cache

from bemt.base import units
from bemt.data.readers._words import english, of_others, plain, quantities
from bemt.data.readers.unit_text import (
    FORCES,
    TWO_MEANINGS,
    either,
    si_name,
    splits,
    unit_for,
    unit_of,
    weighs,
)

_RPM = units.UNITS["rpm"]
_PURE = re.compile(
    r"(CT_total|KT_nozzle|KT_propeller|J|eta_?[0Oo]?|FM|Re|M_tip|run|tip_Mach|Mach|throttle|sigma"
    r"|[A-Za-z]\w*?/(?![NAVWKCF]\b)[A-Z]|[A-Za-z]\w*_over_[A-Za-z]|[xyz]/c|\w+_ratio|CT_rotor|CP_rotor|CQ_rotor|Cp)"
)
_OF_PROPELLER = re.compile(
    r"(?P<ten>10 ?[*x·]? ?)?(?:C_?(?P<air>[TPQtq])|(?:K_?|k_)(?P<ship>[TQtq](?:[ _]total)?))"
    r"(?(ship)(?!\s*[(\[]\s*[^\W\d]))(?:\s*[(\[].*)?"
)
"""Coefficients as propellers and ships have them, K_T = CT and K_Q = CQ, but a motor's Kt has a unit; Cp may be that of
a pressure: the table tells."""
_ALONE = {"voltage": "voltage", "current": "current", "power": "P", "force": "F"}
"""Name of a channel whose heading is the name of a unit, by the dimension of the unit."""
USUAL: dict[str, str] = {
    "T_N": "thrust_N", "F_N": "thrust_N", "Q_Nm": "torque_Nm", "M_Nm": "torque_Nm", "U_V": "voltage_V",
    "I_A": "current_A", "pulse_width_s": "pwm_s", "V_m_s": "airspeed_m_s", "gap_m": "tip_gap_m",
    "mechanical_power_W": "power_W", "shaft_power_W": "power_W", "T_K": "temperature_K", "P_Pa": "pressure_Pa",
    "air_temperature_K": "temperature_K", "air_pressure_Pa": "pressure_Pa", "rho_kg_m3": "density_kg_m3",
    "air_density_kg_m3": "density_kg_m3", "P_el_W": "electrical_power_W", "P_in_W": "electrical_power_W",
    "input_power_W": "electrical_power_W", "P_mech_W": "power_W", "P_shaft_W": "power_W",
    "speed_m_s": "airspeed_m_s", "velocity_m_s": "airspeed_m_s", "U_inf_m_s": "airspeed_m_s",
    "V_inf_m_s": "airspeed_m_s", "Vinf_m_s": "airspeed_m_s", "wind_speed_m_s": "airspeed_m_s",
    "wind_m_s": "airspeed_m_s", "tunnel_speed_m_s": "airspeed_m_s", "freestream_velocity_m_s": "airspeed_m_s",
    "freestream_m_s": "airspeed_m_s", "pull_N": "thrust_N", "force_N": "thrust_N", "load_N": "thrust_N",
    "load_cell_N": "thrust_N", "loadcell_N": "thrust_N",
}  # fmt: skip
"""Usual name of a channel that headings of benches and of CFD name in another way."""
_THRUSTS = re.compile(
    r"((motor|propeller|prop|rotor|static|max|mean|average|avg|measured|total) )*"
    r"(thrust|lift|pull|force|load|load ?cell|scale|balance)( (static|force|mean|average|measured))*|t|f"
)
_GOES: dict[str, tuple[str, ...]] = {  # what a suffix may be: T_A is rotor A's thrust, not a current
    "thrust": ("force",), "lift": ("force",), "torque": ("torque",), "power": ("power",), "rpm": ("angular_speed",),
    "voltage": ("voltage",), "current": ("current",), "T": ("force", "temperature", "time"), "F": ("force",),
    "Q": ("torque",), "M": ("torque",), "P": ("power", "pressure", "length"), "p": ("pressure",),
    "I": ("current",), "U": ("voltage",),
    "V": ("voltage", "speed"), "n": ("angular_speed",), "D": ("length",), "R": ("length",), "r": ("length",),
}  # fmt: skip
_SEPARATORS = (r"\s+[-–—]\s+", r"\s*,\s*", r"\s+in\s+", r"\s*/\s*", r"\s+")
_SHAFT_LETTERS = {"n", "ω"}
_SHAFT_WORDS = set("speed omega rotation rotational rev revs revolution revolutions rps rpm krpm".split())
_SHAFT_PARTS = {"motor", "rotor", "shaft", "prop", "propeller", "fan"}
_NOT_OF_AIR = {"tip", "sound", "ground", "vehicle", "climb", "exit", "wake", "induced", "err", "error", "std", "sd"}
_OTHER_SPEEDS = {"air", "airspeed", "wind", "flow", "stream", "freestream", "tunnel", "flight", "u"} | _NOT_OF_AIR
"""Words of a heading that make it a speed of rotation, and of other speeds or of an uncertainty."""
_COMPONENT = re.compile(
    r"\b([xyz]|axial|radial|tangential|swirl)[-_ ](velocity|speed)\b|\b(velocity|speed)[-_ ]([xyz]|magnitude)\b",
    re.IGNORECASE,
)
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
_ELECTRICAL = re.compile(r"(?=.*rpm).*[(\[]\s*(erpm|electrical)\s*[)\]]\s*", re.IGNORECASE)
_SEA_LEVEL = re.compile(r"\b(qnh|slp)\b")


CELLS = re.compile(
    r"^((number|no\.?)[-_ ]of[-_ ]|n[-_ ]?|mesh[-_ ]|grid[-_ ])*(cells|elements)$|^(cell|element)s?[-_ ]count$",
    re.IGNORECASE,
)
"""Heading of the count of cells of a grid, which has no unit."""


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
        return si_name(self.unit)


def known(text: str, base: str, unit: str) -> Heading:
    """Heading of a column that a reader knows: its name without the unit, and the unit ("-": none).

    >>> known("th", "thrust", "gf").name, known("Speed", "", "rpm").name, known("out", "throttle", "pct").name
    ('thrust_N', 'rpm', 'throttle')
    """
    found = units.Unit("", "none", 1.0) if unit == "-" else unit_of(unit)
    assert isinstance(found, units.Unit), unit
    return Heading(text, _channel(base, found).lstrip("_"), found)


def in_usual_unit(text: str, base: str, unit: str) -> Heading:
    """Heading of a stand's own column: its usual unit, or the one that it states; unit None if that does not fit.

    >>> [in_usual_unit(f"Torque Left {u}", "torque", "Nm").unit.factor for u in ("", "[Nm]", "[Nmm]")]
    [1.0, 1.0, 0.001]
    >>> in_usual_unit("Thrust [g]", "thrust", "gf").unit.suffix, in_usual_unit("Torque [V]", "torque", "Nm").unit
    ('gf', None)
    """
    found, said = known(text, base, unit), re.search(r"[\[(]([^()\[\]]*)[)\]]\s*$", text)
    if not said or said[1].lower().strip(" -") in ("", unit.replace("gf", "g").lower()) or found.unit is None:
        return found
    goes = unit_for(found.unit.dimension, said[1].strip())
    if goes is None:
        return replace(found, unit=None, doubt=f"{said[1].strip()!r} is no unit of it")
    return replace(found, unit=in_rpm(goes[0]))


def in_rpm(unit: units.Unit) -> units.Unit:
    """Unit of a speed of rotation that gives rev/min; any other as it is."""
    if unit.dimension != "angular_speed" or unit.suffix == "rpm":
        return unit
    return units.Unit("", "angular_speed", unit.factor / units.RPM)


def _channel(base: str, unit: units.Unit) -> str:
    """Name of a channel with its unit in SI."""
    si = si_name(unit).replace("/", "_")
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
            last = re.split(r"[\s_]+", name)[-1]
            goes = _GOES.get(last if len(last) == 1 else last.lower()) or [d for _, d in quantities(english(name))]
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

    A weight alone is what a scale reads of a thrust, or the mass of a part: it is asked for, never taken.

    >>> meanings("Gewicht [g]"), meanings("Motor weight (g)")
    (['thrust'], [])
    """
    words = english(re.split(r"[(\[]|\s(?:in|en|em)\s", text)[0])
    known = [("thrust", "force")] if words == ["weight"] else quantities(words)
    found = [name for name, dimension in known if dimension != "acceleration"]
    return ["power" if name == "mechanical power" else name.replace(" ", "_") for name in found]


def other_dimension(heading: str, dimension: str) -> str:
    """Dimension that a word of a heading names, where none names the wanted one; "" for any other heading.

    >>> other_dimension("total-to-static-pressure-op", "force"), other_dimension("report-def-0", "force")
    ('pressure', '')
    """
    named = [d for word in english(heading) for _, d in quantities([word])]
    return "" if dimension in named else next(iter(named), "")


def counts_electrical(text: str) -> bool:
    """Tell whether a heading is a speed in electrical revolutions, over no pole pairs yet.

    >>> [counts_electrical(t) for t in ("eRPM", "ESC speed (eRPM)", "Motor Electrical Speed (RPM)", "serpm")]
    [True, True, False, False]
    """
    return re.search(r"(?<![a-z])e[-_ ]?rpm", text, re.IGNORECASE) is not None


def may_be_shaft_speed(text: str) -> bool:
    """Tell whether the words of a heading fit a speed of rotation; its unit is not looked at.

    >>> [may_be_shaft_speed(t) for t in ("speed", "n (1/s)", "Drehzahl", "motor speed [Hz]")]
    [True, True, True, True]
    >>> [may_be_shaft_speed(t) for t in ("wind speed", "x-velocity", "thrust")]
    [False, False, False]
    """
    base, words = _spoken(text)
    turning = words & _SHAFT_PARTS and words & {"hz", "freq", "frequency"}
    other = words & _OTHER_SPEEDS or _COMPONENT.search(text)
    return base in _SHAFT_LETTERS or bool((words & _SHAFT_WORDS or turning) and not other)


def may_be(quantity: str, text: str) -> bool:
    """Tell whether no word of a heading is one of another quantity; its unit is not looked at.

    >>> may_be("airspeed", "v Kanal (m/s)"), may_be("airspeed", "tip speed (m/s)"), may_be("temperature", "ESC (C)")
    (True, False, False)
    """
    _, words = _spoken(text)
    return not words & (of_others(quantity) | _NOT_OF_AIR) and not _COMPONENT.search(text)


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
    if not parts and (loose := re.fullmatch(r"(.+?)(?:[_ ]| - |, ?)(\w+)", text)) and weighs(loose[2]):
        parts = loose  # thrust_g, Thrust kg
    uncertainty = text.startswith("u_") and _by_words(text[2:]) is not None  # u_inf is none
    if not uncertainty and (by_words := _by_words(text)) is not None:
        return by_words
    if parts and (as_stands := _as_stands_mean(text, parts[1], parts[2])) is not None:
        return as_stands
    found = _heading(text)
    if found.unit is None and not found.doubt and not text.isascii() and quantities(words := english(text)):
        return replace(found, name=slug(" ".join(dict.fromkeys(words))))
    return found


def _as_stands_mean(text: str, base: str, stated: str) -> Heading | None:
    """Heading with a unit as stands mean it: a mass for its weight, hertz for turns; None: any other."""
    unit = weighs(stated)
    if unit and _THRUSTS.fullmatch(" ".join(english(base))):
        told = f"{text!r} is read as {FORCES[unit]}: 1 {stated} weighs {units.UNITS[unit].factor:.4g} N"
        return replace(heading(f"{base} ({unit})"), text=text, told=told)
    if stated in ("Hz", "1/s") and (said := _spoken(base)[1]) & _TURNS and "electrical" not in said:
        turns = units.Unit("", "angular_speed", 60.0)
        return Heading(text, "rpm", turns, told=f"{text!r} is read as revolutions per second")
    if stated in ("g/W", "G/W"):
        return replace(_heading(f"{base} (gf/W)"), text=text, told=f"{text!r} is read as gf/W")
    return None


def unit_alone(text: str) -> units.Unit | None:
    """Unit that a heading is the name of, as instruments show it; None: any other, and letters (``A`` is a rotor too).

    >>> [unit.suffix if (unit := unit_alone(text)) else "" for text in ("Watt", "Grams", "Amps", "A", "Thrust", "rpm")]
    ['W', 'gf', 'A', '', '', '']
    """
    found = unit_for("force", text) if weighs(text) else unit_for("", text)
    known = found is not None and found[0].dimension in _ALONE and len(text) > 2
    return found[0] if found is not None and known else None


@lru_cache(maxsize=4096)
def channel_of(text: str, unit: str = "") -> str:
    """Usual name of the channel that a heading means, whatever wrote it: a bench, a CFD program.

    >>> channel_of("V", "m s^-1"), channel_of("U [m/s]"), channel_of("T", "N"), channel_of("Q", "N m"), channel_of("J")
    ('airspeed_m_s', 'airspeed_m_s', 'thrust_N', 'torque_Nm', 'J')
    """
    name = heading(f"{text} [{unit}]" if unit else text).name
    return USUAL.get(name, name)


_COEFFICIENT = re.compile(
    r"(thrust|power|torque) coeff(?:icient)?(?: (10 ?)?[ck] ?[tpq])?|(adv(?:ance)? (?:ratio|coefficient))(?: j)?"
)
_LETTER = {"thrust": "CT", "power": "CP", "torque": "CQ"}


def _by_words(text: str) -> Heading | None:
    """Heading whose words are one quantity, in any of the languages, with a unit that goes with it; None: another."""
    bare = unicodedata.normalize("NFKC", text.replace("⁻", "^-")).replace("\u2212", "-")
    words = english(re.sub(r"[(\[] ?-? ?[)\]]", " ", bare))
    if found := _COEFFICIENT.fullmatch(" ".join(words)):
        name, factor = "J" if found[3] else _LETTER[found[1]], 0.1 if found[2] else 1.0
        return Heading(text, name, units.Unit("", "none", factor))
    if re.fullmatch(r"t\s*[(\[]\s*\w+\s*[)\]]", bare) and isinstance(
        unit := unit_of(bare[1:].strip(" ()[]")), units.Unit
    ):
        if unit.dimension == "time":
            return Heading(text, "time_s", unit)
    for base, unit in splits(bare):
        words = english(base)
        for name, dimension in quantities(words):
            if not unit:
                if name == "rpm" and "rpm" in words:
                    return Heading(text, "rpm", _RPM)
                if set(words) == {"throttle"} and not re.search(r"[\s_]", bare):
                    return Heading(text, "throttle", units.Unit("", "none", 1.0))
                continue
            if (goes := unit_for(dimension, unit)) is None:
                continue
            made, told = goes
            if dimension == "angular_speed":
                if made.suffix == "rad_s" and name == "rpm" and words != ["rotation", "speed"]:
                    return None  # an angular speed is the reduction's to convert
                return Heading(text, slug(name), in_rpm(made))
            return Heading(text, _channel(slug(name), made), made, told=f"{text!r} is read as {told}" if told else "")
    return None


def _name_and_unit(text: str) -> tuple[str, units.Unit | None, str]:
    """Name, unit and doubt of a heading, from its brackets if they hold a unit."""
    found = re.fullmatch(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*", text)
    stated = unit_of(found[2]) if found else ""
    if not found or stated == "":
        return _without_brackets(re.split(r"[(\[=]", text)[0].strip(), text)
    return (found[1], stated, "") if isinstance(stated, units.Unit) else (found[1], None, f"{found[2]!r} is {stated}")


def _by_suffix(core: str, text: str) -> tuple[str, units.Unit | None, str] | None:
    """Name, unit and doubt of a heading that ends in the suffix of a unit; None without one."""
    name, suffix = units.split_suffix(core)
    if suffix is None:
        return None
    mass = suffix.dimension == "mass"
    goes = _GOES.get(name.split("_")[-1].lower() if len(name) > 1 else name)
    if goes is not None and not mass and suffix.dimension not in goes:
        return text, None, f"{suffix.suffix!r} does not go with {name}"
    if mass and not re.search(r"weight|mass", name, re.IGNORECASE):
        return text, None, f"{suffix.suffix!r} is {TWO_MEANINGS[suffix.suffix]}"
    return (name, suffix, "") if name or mass else None


def _without_brackets(core: str, text: str) -> tuple[str, units.Unit | None, str]:
    """Name, unit and doubt of a heading that has no unit in brackets."""
    if unit := unit_alone(core):
        return _ALONE[unit.dimension], unit, ""
    if (ending := _tail(core)) is not None:
        name, stated = ending
        return (name, stated, "") if isinstance(stated, units.Unit) else (name, None, stated)
    if re.fullmatch(r"(e[_ ]?)?rpm(_\w)?", core, re.IGNORECASE):  # before suffixes: rpm_A is no current
        return core, _RPM, ""
    if (by_suffix := _by_suffix(core, text)) is not None:
        return by_suffix
    rotor, pure = "rotor convention" in text, units.Unit("", "none", 1.0)
    if rotor and core in ("CT", "CP", "CQ"):
        return f"{core}_rotor", pure, ""
    if (said := _OF_PROPELLER.fullmatch(text)) and not rotor:
        return f"C{(said['air'] or said['ship'])[0].upper()}", units.Unit("", "none", 0.1 if said["ten"] else 1.0), ""
    if _PURE.fullmatch(core) and (not rotor or core.endswith("_rotor")):
        return core.replace("eta_", "eta"), pure, ""
    if re.fullmatch(r"\w+/[NAVWKCF]", core):
        return text, None, f"{core!r} is a ratio, or a quantity and its unit: write the unit in brackets"
    if re.fullmatch(r"rpm([_ ]\w+)?|\w+[_ ]rpm", core, re.IGNORECASE):
        return core, _RPM, ""
    return ("rpm", _RPM, "") if unit_of(core) == _RPM else (text, None, "")  # U/min, 1/min


def _small(first: str, text: str) -> str:
    """Text with a small letter where a word as in `first` begins."""
    return re.sub(first, lambda word: word[0].lower(), text)


def _heading(text: str) -> Heading:
    if doubt := either(text):
        return Heading(text, slug(text), None, doubt)
    if _ELECTRICAL.fullmatch(text):
        return Heading(text, "electrical_rpm", _RPM)
    base, unit, doubt = _name_and_unit(text)
    if unit is not None and unit.dimension == "pressure" and _SEA_LEVEL.search(plain(base)):
        unit, doubt = None, "a pressure reduced to sea level: give that of the station (QFE)"
    if unit is None:
        return Heading(text, slug(text) or "column", None, doubt)
    if unit.offset and base.startswith("u_"):  # an uncertainty in Celsius is one in kelvin
        unit = units.Unit(unit.suffix, unit.dimension, unit.factor)
    if unit.dimension == "angular_speed" and unit.suffix in ("rpm", ""):
        flat = _small(r"^[A-Z][a-z]{2,}$", re.sub(r"^((motor_)?speed|n)$|_?rpm_?", "", slug(base), flags=re.IGNORECASE))
        flat = "electrical" if flat.lower() == "e" else flat
        return Heading(text, f"{flat}_rpm" if flat else "rpm", unit)
    return Heading(text, _channel(slug(_small(r"\b[A-Z][a-z]{2,}", base)), unit), unit)

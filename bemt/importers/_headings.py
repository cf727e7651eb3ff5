"""Headings of columns: the name of the channel and the unit, from the text alone.

A heading without a unit, or with one that has two meanings (``g``), gives unit None: nothing is assumed.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from bemt import units

__all__ = ["Heading", "heading", "slug", "unit_of"]

_SAME = {
    "sec": "s", "seconds": "s", "msec": "ms", "rev/min": "rpm", "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
    "r/min": "rpm", "u/min": "rpm", "rad/s": "rad_s", "rev/s": "rev_s", "rps": "rev_s", "m/s": "m_s", "km/h": "km_h",
    "kn": "kt", "knots": "kt", "ft/s": "ft_s", "%": "pct", "degc": "C", "celsius": "C", "degf": "F",
    "kg/m3": "kg_m3", "kg/m^3": "kg_m3", "inch": "in", "inches": "in", "degrees": "deg", "degree": "deg",
    "volts": "V", "amps": "A", "watts": "W", "pa s": "Pa_s", "m^2": "m2", "n m": "Nm", "n-m": "Nm", "n cm": "Ncm",
    "n mm": "Nmm", "mn m": "mNm", "kgf cm": "kgf_cm", "gf cm": "gf_cm", "lbf in": "lbf_in", "in lbf": "lbf_in",
    "in-lbf": "lbf_in", "lbf ft": "lbf_ft", "ft lbf": "lbf_ft", "ft-lbf": "lbf_ft", "ozf in": "ozf_in",
    "in ozf": "ozf_in", "kgf m": "kgf_m", "microseconds": "us", "rpm": "rpm", "volt": "V", "watt": "W", "amp": "A",
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
    "g/W": "a mass per power: write gf/W", "G/W": "a mass per power: write gf/W",
}  # fmt: skip
_COMPOUND = {
    "gf/W": units.Unit("N_W", "efficacy", units.KGF * 1e-3), "kgf/W": units.Unit("N_W", "efficacy", units.KGF),
    "N/W": units.Unit("N_W", "efficacy", 1.0), "lbf/W": units.Unit("N_W", "efficacy", units.LBF),
}  # fmt: skip
_PURE = re.compile(
    r"(CT|CP|CQ|KT|KQ|10KQ|CT_total|KT_total|KT_nozzle|KT_propeller|J|eta0?|FM|Re|M_tip|run|tip_Mach|Mach|throttle|sigma"
    r"|[A-Za-z]\w*?/[A-Z]|[A-Za-z]\w*_over_[A-Za-z]|[xyz]/c|\w+_ratio|CT_rotor|CP_rotor|CQ_rotor)"
)
_WORDS = {  # heading in lower case -> name and dimension it must have
    "time": ("time", "time"), "thrust": ("thrust", "force"), "torque": ("torque", "torque"),
    "voltage": ("voltage", "voltage"), "current": ("current", "current"), "airspeed": ("airspeed", "speed"),
    "electrical power": ("electrical_power", "power"), "mechanical power": ("mechanical_power", "power"),
    "throttle": ("throttle", "fraction"), "esc signal": ("pulse_width", "time"), "esc": ("pulse_width", "time"),
    "pwm": ("pulse_width", "time"),
    "motor optical speed": ("optical", "angular_speed"), "motor electrical speed": ("electrical", "angular_speed"),
    "vibration": ("vibration", "acceleration"), "accx": ("acceleration_x", "acceleration"),
    "accy": ("acceleration_y", "acceleration"), "accz": ("acceleration_z", "acceleration"),
}  # fmt: skip
_GOES: dict[str, tuple[str, ...]] = {  # what a suffix may be: T_A is rotor A's thrust, not a current
    "thrust": ("force",), "lift": ("force",), "torque": ("torque",), "power": ("power",), "rpm": ("angular_speed",),
    "voltage": ("voltage",), "current": ("current",), "T": ("force", "temperature", "time"), "F": ("force",),
    "Q": ("torque",), "M": ("torque",), "P": ("power", "pressure", "length"), "I": ("current",), "U": ("voltage",),
    "V": ("voltage", "speed"), "n": ("angular_speed",), "D": ("length",), "R": ("length",), "r": ("length",),
}  # fmt: skip
_GRAVITY = units.Unit("m_s2", "acceleration", units.G0)


@dataclass(frozen=True)
class Heading:
    """What a heading says: ``text``, ``name`` of the channel, ``unit`` (None: unknown), ``doubt`` about the unit."""

    text: str
    name: str
    unit: units.Unit | None
    doubt: str = ""

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

    Parameters
    ----------
    text : str
        As written in a heading, without brackets.

    Returns
    -------
    Unit or str
        The unit; else why none is taken ("" when the text is no unit at all).

    Examples
    --------
    >>> unit_of("N·m").suffix, unit_of("µs").suffix, unit_of("1/min").suffix
    ('Nm', 'us', 'rpm')
    >>> unit_of("kg")
    'a mass: write kgf for a force'
    """
    t = re.sub(r"[·⋅*]", " ", text.strip()).replace("µ", "u").replace("μ", "u").replace("³", "3").replace("²", "2")
    t = " ".join(t.replace("°", "deg").split())
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


def slug(text: str) -> str:
    """Name of a channel made of words: blanks and signs become underscores."""
    return re.sub(r"_+", "_", re.sub(r"[^\w/]+", "_", text.strip())).strip("_")


def heading(text: str) -> Heading:
    """Read one heading.

    Parameters
    ----------
    text : str
        Such as ``Thrust (gf)``, ``torque_Nm`` or ``RPM``.

    Returns
    -------
    Heading
        With the channel's name, which ends in the SI unit where the unit is known.

    Examples
    --------
    >>> heading("Thrust (gf)").name, heading("Q(Nm)").name, heading("RPM").name, heading("chord_mm").name
    ('thrust_N', 'Q_Nm', 'rpm', 'chord_m')
    >>> heading("omega").name, heading("omega").unit is None
    ('omega', True)
    """
    text = " ".join(text.split())
    base, unit, doubt = text, None, ""
    found = re.fullmatch(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*", text)
    if found:
        stated = unit_of(found[2])
        if isinstance(stated, units.Unit):
            base, unit = found[1], stated
        elif stated:
            base, doubt = found[1], f"{found[2]!r} is {stated}"
    core = re.split(r"[(\[=]", base)[0].strip() if unit is None and not doubt else base
    if unit is None and not doubt:
        name, suffix = units.split_suffix(core)
        goes = _GOES.get(name.split("_")[-1].lower() if len(name) > 1 else name)
        if re.fullmatch(r"(e[_ ]?)?rpm(_\w)?", core, re.IGNORECASE):  # before suffixes: rpm_A is no current
            base, unit = core, units.UNITS["rpm"]
        elif suffix is not None and goes is not None and suffix.dimension not in (*goes, "mass"):
            doubt = f"{suffix.suffix!r} does not go with {name}"
        elif suffix is not None and name and suffix.dimension != "mass":
            base, unit = name, suffix
        elif suffix is not None and suffix.dimension == "mass" and re.search(r"weight|mass", name, re.IGNORECASE):
            base, unit = name, suffix
        elif suffix is not None and suffix.dimension == "mass":
            doubt = f"{suffix.suffix!r} is {_TWO_MEANINGS[suffix.suffix]}"
        elif _PURE.fullmatch(core) and ("rotor convention" not in text or core.endswith("_rotor")):
            base, unit = core, units.Unit("", "none", 1.0)
        elif "rotor convention" in text and core in ("CT", "CP", "CQ"):
            base, unit = f"{core}_rotor", units.Unit("", "none", 1.0)
        elif re.fullmatch(r"rpm(_\w+)?|\w+_rpm", core, re.IGNORECASE):
            base, unit = core, units.UNITS["rpm"]
    word = _WORDS.get(base.lower().replace("_", " "))
    if word and word[1] == "acceleration" and doubt.startswith("'g'"):
        unit, doubt = _GRAVITY, ""
    if unit is None:
        return Heading(text, slug(text) or "column", None, doubt)
    if unit.offset and base.startswith("u_"):  # an uncertainty in Celsius is one in kelvin
        unit = units.Unit(unit.suffix, unit.dimension, unit.factor)
    if word and word[1] == unit.dimension:
        base = word[0]
        if unit.dimension == "angular_speed" and unit.suffix != "rpm":
            unit = units.Unit("", "angular_speed", unit.factor / units.RPM)
    if unit.dimension == "angular_speed" and unit.suffix in ("rpm", ""):
        flat = re.sub(r"^(speed|n)$|_?rpm_?", "", slug(base), flags=re.IGNORECASE)
        if flat.lower() == "e":
            flat = "electrical"
        return Heading(text, f"{flat}_rpm" if flat else "rpm", unit)
    si = _si_name(unit)
    base = re.sub(r"\b[A-Z][a-z]{2,}", lambda word: word[0].lower(), base)
    tail = "" if si == "-" else "_" + {"N/W": "N_W", "m/s2": "m_s2"}.get(si, si)
    return Heading(text, slug(base) + tail, unit)

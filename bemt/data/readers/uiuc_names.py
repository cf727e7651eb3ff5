"""File names of the UIUC Propeller Database: the only place where it keeps diameter, pitch, blades and rpm.

Grammar (``_`` separates the parts)::

    <family>_<size>[_<angle>deg][_<n>b][_spec<n>]_geom            tested geometry of one propeller
    <family>_geom, <family>_thick                                 design geometry, thickness of a 3D-printed family
    <family>_<size>[...]_static_<run>                             static run
    <family>_<size>[...]_<run>_<rpm>                              advance-ratio run ("J line") at one rpm

Rules for ``<size>``
    * ``DxP``: diameter and pitch, in inches; a diameter above 40 means that both are in millimetres (volume 2 writes
      "140 mm X 45 mm" for ``140x45``).
    * family ``ancf`` (volume 3) drops the decimal point: ``125x75`` is 12.5 x 7.5, ``12x65`` is 12 x 6.5.
    * ``D`` with ``<angle>deg`` (family ``nr640``): diameter in inches and blade angle at r/R = 0.75.
    * ``45t1``, ``45p2`` (family ``cfnq``): tractor or pusher, specimen.
    * model names (``triturbo``, ``u80``): diameters that the site prints, see :data:`NAMED_DIAMETERS_IN`.

Blades: ``_3b`` in the name, ``DxPx3``, a 3-blade family (``mit``, which the site heads "3-Blade"), else 2: the site
names the blade number wherever it is another. ``pl_triturbo`` has 2: it belongs to an airship with three fans, and by
blade element theory on its stations 2 blades agree with its measured power within 5 %, where 3 need 43 % too much
(inferred, not read from the site).

Diameters are the nominal ones. The site bases its coefficients on the true diameter, which it gives in pictures only.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from bemt.base.errors import Fault, InputError

MM_ABOVE = 40.0
"""A diameter in a name above this is in millimetres: the archive's largest propeller has 21 in, the smallest 45 mm."""

VARIABLE_PITCH = frozenset({"da4002", "da4022", "da4052", "nr640"})
"""3D-printed families whose pitch and blade-number variants are the same blade set otherwise in the hub."""

NAMED_DIAMETERS_IN = {"pl_triturbo": 2.55, "union_u80": 3.15, "cfnq_45": 1.85}
"""Diameters that the site of volume 2 prints for sizes without ``DxP``. [in]"""

DROPPED_POINT = frozenset({"ancf"})
THREE_BLADES = frozenset({"mit"})

FAMILIES = {
    "ance": "Aeronaut Carbon Electric", "ancf": "Aeronaut CAM Folding", "apc29ff": "APC 29 Free Flight",
    "apccf": "APC Carbon Fiber", "apce": "APC Thin Electric", "apcff": "APC Free Flight", "apcsf": "APC Slow Flyer",
    "apcsp": "APC Sport", "cfnq": "Crazyflie", "da4002": "DA4002 (3D-printed)", "da4022": "DA4022 (3D-printed)",
    "da4052": "DA4052 (3D-printed)", "ef": "E-Flite", "grcp": "Graupner CAM Prop", "grcsp": "Graupner CAM Slim",
    "grsn": "Graupner Super Nylon", "gwsdd": "GWS Direct Drive", "gwssf": "GWS Slow Flyer", "kavfk": "Kavon FK",
    "kpf": "KP Folding", "kyosho": "Kyosho", "ma": "Master Airscrew", "mae": "Master Airscrew Electric",
    "magf": "Master Airscrew G/F", "mas": "Master Airscrew Scimitar", "mi": "Micro Invent 2-Blade",
    "mit": "Micro Invent 3-Blade", "nr640": "NR640 (3D-printed)", "pl": "Plantraco", "rusp": "Rev Up Special Prop",
    "union": "Union", "vp": "Vapor", "zin": "Zingali",
}  # fmt: skip
"""Maker and series by family, as the site heads them; other families import too."""


_SHORT = {"ma": "master airscrew", "hd": "direct drive", "rs": "", "aerocam": "aeronaut cam",
          "aerocarbon": "aeronaut carbon", "grp": "graupner", "thin": "", "prop": "", "electric": "",
          "folding": "", "folder": "", "sport": "", "pusher": "", "series": "", "g/f": "gf"}  # fmt: skip
"""Words of makers' series as shops and databases write them; words of a class tell by the class."""


def _words(name: str) -> frozenset[str]:
    split = re.findall(r"[a-z0-9/]+", re.sub(r"slow fly(?:er)?|\d-blade", "", name.casefold()))
    return frozenset(" ".join(_SHORT.get(word, word) for word in split).split())


def families_of(maker: str, kind: str | None, blades: int | None = None) -> list[str]:
    """Families that a maker's words and a class of blades may mean: those of just these words, else of these and more.

    >>> families_of("GWS Direct Drive", None), families_of("GWS HD", None), families_of("APC", "electric")
    (['gwsdd'], ['gwsdd'], ['apce'])
    >>> families_of("Graupner CAM", None), families_of("Graupner CAM Slim", None), families_of("Nobody", None)
    (['grcp'], ['grcsp'], [])
    """
    said, kind = _words(maker), None if kind == "fpv" else kind  # which size and blades told, not the maker
    if not said:
        return []
    own = [key for key in FAMILIES if key == maker.casefold()]
    kin = own or [key for key in FAMILIES if said <= _words(FAMILIES[key]) and (kind is None or class_of(key) == kind)]
    if THREE_BLADES & set(kin):  # a series of its own
        kin = [key for key in kin if (key in THREE_BLADES) == (blades == 3)]
    exact = [key for key in kin if said == _words(FAMILIES[key]) and class_of(key) == kind]
    return exact if len(exact) == 1 else kin


def family_of(maker: str, kind: str | None, blades: int | None = None) -> str | None:
    """Family of a maker's class of blades, None where the label does not say which series it is.

    >>> family_of("APC", "electric"), family_of("gws", "slow_flyer"), family_of("APC", None)
    ('apce', 'gwssf', None)
    """
    found = families_of(maker, kind, blades)
    return found[0] if len(found) == 1 else None


def find_family(series: str) -> str:
    """Family of a maker's series, by its short or its long name.

    >>> find_family("GWS Slow Flyer"), find_family("apce")
    ('gwssf', 'apce')
    """
    for key, name in FAMILIES.items():
        if series.casefold() in (key, name.casefold()):
            return key
    known = ", ".join(f"{key} ({name})" for key, name in FAMILIES.items())
    raise InputError(Fault("", "--series", repr(series), f"one of {known}", "Leave it out if it is none of them"))


def class_of(family: str | None) -> str | None:
    """Class of blade (:data:`geometry.designation.BLADE_CLASSES`) that the name of a family states.

    >>> class_of("gwssf"), class_of("ancf"), class_of("grcsp")
    ('slow_flyer', 'folding', None)
    """
    from geometry.designation import blade_class

    return blade_class(FAMILIES.get((family or "").lower(), ""))


_N = r"(\d+(?:\.\d+)?)"
_SIZE = re.compile(rf"{_N}x{_N}(?:[x-](\d))?([a-z]*)", re.IGNORECASE)
_RUN = re.compile(r"[a-z]{0,3}\d{3,5}[a-z]{0,3}", re.IGNORECASE)
_FILE = re.compile(r"[a-z][a-z0-9]*(?:-[a-z0-9]+)*", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class UiucName:
    """What the name of a propeller says."""

    # ``apce_10x5`` and ``apce``
    name: str
    family: str
    # Nominal [in]
    diameter_in: float | None = None
    pitch_in: float | None = None
    angle_deg: float | None = None  # Nominal blade angle at r/R = 0.75, given or from the pitch [deg]
    blades: int = 2  # Number of blades
    rotation: int = 1  # +1 tractor, -1 pusher
    faults: tuple[tuple[str, str, str], ...] = ()  # Why the name cannot be used; empty when it can


@dataclass(frozen=True)
class UiucFile:
    """What the name of a file says: ``role`` is geom, thick, static or line; ``rpm`` only for a line. [rev/min]."""

    role: str
    propeller: UiucName
    rpm: float | None = None


def _size(token: str, family: str) -> dict[str, object]:
    """Diameter, pitch and more from the size part of a name."""
    if match := _SIZE.fullmatch(token):
        diameter, pitch = float(match[1]), float(match[2])
        if family in DROPPED_POINT:
            diameter, pitch = diameter / (10 if diameter > 60 else 1), pitch / (10 if pitch > 30 else 1)
        elif diameter > MM_ABOVE:
            diameter, pitch = diameter / 25.4, pitch / 25.4
        found: dict[str, object] = {"diameter_in": diameter, "pitch_in": pitch}
        if match[3]:
            found["blades"] = int(match[3])
        return found
    if match := re.fullmatch(r"(\d+)([tp])(\d)", token):
        named = NAMED_DIAMETERS_IN.get(f"{family}_{match[1]}")
        return {"diameter_in": named, "rotation": -1 if match[2] == "p" else 1}
    if match := re.fullmatch(_N, token):
        value = float(token)
        return {"diameter_in": value / 25.4 if value > MM_ABOVE else value}
    return {"diameter_in": NAMED_DIAMETERS_IN.get(f"{family}_{token}")}


def _propeller(family: str, middle: list[str]) -> UiucName:
    """Read the propeller's part of a file name; ``middle`` is empty for the design of a family."""
    name, key = "_".join([family, *middle]), family.lower()
    found: dict[str, object] = {"blades": 3} if key in THREE_BLADES else {}
    if not middle:
        return UiucName(name, family)
    found |= _size(middle[0].lower(), key)
    for token in (part.lower() for part in middle[1:]):
        if match := re.fullmatch(rf"{_N}deg", token):
            found["angle_deg"] = float(match[1])
        elif match := re.fullmatch(r"(\d)b(?:l|lades?)?", token):
            found["blades"] = int(match[1])
    diameter, pitch, angle = found.get("diameter_in"), found.get("pitch_in"), found.get("angle_deg")
    faults: list[tuple[str, str, str]] = []
    if not isinstance(diameter, float):
        hint = "Rename the files to <family>_<diameter>x<pitch>_..."
        faults.append((f"size {middle[0]!r}", "a size such as 10x5 (in) or 140x45 (mm)", hint))
    else:
        if not 0.5 <= diameter <= MM_ABOVE:
            faults.append((f"diameter {diameter:g} in", "0.5 to 40 in", "Is the unit or the decimal point missing?"))
        if isinstance(pitch, float) and not 0.1 <= pitch / diameter <= 2.5:
            hint = "Is a decimal point missing from the name (65 for 6.5), or are these mixed units?"
            faults.append((f"pitch/diameter {pitch / diameter:.3g}", "0.1 to 2.5", hint))
        if isinstance(pitch, float) and angle is None:
            found["angle_deg"] = math.degrees(math.atan2(pitch, 0.75 * math.pi * diameter))
        elif isinstance(angle, float) and pitch is None:
            found["pitch_in"] = 0.75 * math.pi * diameter * math.tan(math.radians(angle))
    blades = found.get("blades", 2)
    if isinstance(blades, int) and not 2 <= blades <= 8:
        faults.append((f"{blades} blades", "2 to 8 blades", "Correct the blade number in the name"))
    return UiucName(name, family, faults=tuple(faults), **found)  # type: ignore[arg-type]


def parse_file_name(stem: str) -> UiucFile | None:
    """Read a file name of the archive.

    >>> file = parse_file_name("nr640_9_15deg_3b_0725rd_3025")
    >>> file.role, file.rpm, file.propeller.name, file.propeller.blades
    ('line', 3025.0, 'nr640_9_15deg_3b', 3)
    >>> round(parse_file_name("vp_140x45_geom").propeller.diameter_in, 3)
    5.512
    >>> parse_file_name("ancf_125x75_static_0914od").propeller.pitch_in
    7.5
    >>> parse_file_name("README") is None
    True
    """
    family, *rest = stem.split("_")
    if not rest or not _FILE.fullmatch(family):
        return None
    last = rest[-1].lower()
    if last in ("geom", "thick"):
        return UiucFile(last, _propeller(family, rest[:-1]))
    lower = [part.lower() for part in rest]
    if "static" in lower and lower.index("static") > 0:
        return UiucFile("static", _propeller(family, rest[: lower.index("static")]))
    if len(rest) >= 2 and re.fullmatch(r"\d{3,6}(\.\d+)?", last):
        of_run = len(rest) >= 3 and _RUN.fullmatch(rest[-2])
        return UiucFile("line", _propeller(family, rest[: -2 if of_run else -1]), float(last))
    return None

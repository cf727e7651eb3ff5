"""Propeller labels as people type them: 8x5, APC 10x4.5MR, HQ5x4.3x3, 5045, Gemfan 51466, T-Motor 28x9.2."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from geometry.common import Faults, GeometryError

BLADE_CLASSES = ("electric", "slow_flyer", "multirotor", "folding", "sport", "fpv", "reversible", "pattern")
"""Kinds of blades that a label tells apart; sport is for glow engines, reversible turns both ways, pattern is F3A."""

# Letters behind the size, in any combination (APC: 20.5x13.5EPN, 9x4.5MRF-RH, 8x3.7SFR), the longer first.
ENDINGS = {"sf": "slow_flyer", "mr": "multirotor", "pn": "pattern", "bn": "fpv", "e": "electric", "f": "folding"}
_LETTERS = re.compile(r"(?:sf|mr|pn|bn|cf|[efwncpsr])+(?:-[rl]h)?|[rl]h|ccw|cw", re.IGNORECASE)
_PART = re.compile(r"sf|mr|pn|bn|cf|ccw|cw|[rl]h|[efwncpsr]", re.IGNORECASE)
_VERSION = re.compile(r"(?<![A-Za-z])V\d\w*$|(?<=[A-Za-z])V\d\w*$", re.IGNORECASE)  # of a mould
# Words before or behind the size; the first that matches.
_WORDS: tuple[tuple[str, str], ...] = (
    (r"slow\W?fl(?:y|i)(?:er)?\b|\bslo\W?fly|\bsf\b|\bgws rs\b", "slow_flyer"), (r"multi\W?rotor|\bmr\b", "multirotor"),
    (r"\bfold", "folding"), (r"\breversible\b", "reversible"), (r"\bpattern\b", "pattern"),
    (r"thin electric|\belectric\b|\be\W?prop", "electric"), (r"\bsport\b|\bglow\b", "sport"),
    (r"\b(?:hq|hqprop|gemfan|dalprop|dal|hurricane|ethix|azure|fpv)\b|bull\W?nose", "fpv"),
)  # fmt: skip
_FPV_LARGEST = 7.0  # diameter of FPV propellers; more blades than two on one this small are of that class [in]
_RATIO = (0.1, 2.5)  # pitch over diameter of any propeller
_USUAL_RATIO = (0.2, 1.6)  # of those whose label has no point
_EXPECTED = "diameter x pitch in inches, such as 8x5, 10x4.7SF, 8x5x3 or 5045"
_INCHES = re.compile(r"(?<=[\d.])\s*(?:\"|\u201d|\u2033|''|in(?:ch(?:es)?)?\b\.?)(?=\s|[x\u00d7*]|$)", re.IGNORECASE)
_MILLIMETRES = re.compile(r"(\d+(?:\.\d+)?)\s*(?:mm)?\s*[x\u00d7*]\s*(\d+(?:\.\d+)?)\s*mm\b", re.IGNORECASE)
_BLADES = re.compile(
    r"(?<![\w.])[\s(,-]*\b(\d)\s*-?\s*(?:bl?|blades?|blatt|bl\u00e4tter|pales?|palas?)\b\)?", re.IGNORECASE
)
"""Number of blades in words, before or behind the size."""
_NUMBER = r"(\d{1,3}(?:\.\d*)?|\.\d+)(?!\d)"
_SIZE = re.compile(
    rf"(?<![\d.,])(?<!^-){_NUMBER}\s*[x×*]\s*{_NUMBER}(?!,\d)(?:\s*[x×*-]\s*B?(?P<blades>\d+))?", re.IGNORECASE
)
_DIGITS = re.compile(r"(?<![\d.,])(?P<digits>\d{4,5})(?![\d.,])(?:\s*[x×*-]\s*B?(?P<blades>\d))?", re.IGNORECASE)


@dataclass(frozen=True)
class Designation:
    """What a label says; None where it says nothing."""

    # Size. [in]
    diameter_in: float
    pitch_in: float
    blades: int | None = None
    blade_class: str | None = None  # One of `BLADE_CLASSES`
    maker: str = ""  # Words beside the size, empty without any
    reverse: bool = False  # Whether it is the pusher or counter-rotating one of a pair
    width: int = 0  # Wide blades (1), narrow ones (-1), narrower ones (-2)

    @property
    def size(self) -> str:
        """Diameter x pitch, with the blades where they are not two.

        >>> parse_designation("HQ5x4.3x3").size
        '5x4.3x3'
        """
        blades = f"x{self.blades}" if self.blades not in (None, 2) else ""
        return f"{self.diameter_in:g}x{self.pitch_in:g}{blades}"


def blade_class(text: str) -> str | None:
    """Class of blade that words such as a maker's series state, None where they state none.

    >>> blade_class("GWS Slow Flyer"), blade_class("APC Thin Electric"), blade_class("Graupner CAM Slim")
    ('slow_flyer', 'electric', None)
    """
    return next((name for pattern, name in _WORDS if re.search(pattern, text, re.IGNORECASE)), None)


def parse_designation(text: str, blades_told: int | None = None) -> Designation:
    """Read a propeller label: diameter x pitch in inches, with maker, blade count and kind of blade where it has them.

    A pitch without a point that no propeller has is tenths of an inch (``13x65``), and four or five digits are both
    sizes without points (``5045``, ``51466``); five digits mean an FPV propeller, which has three blades. How many
    blades were told elsewhere counts as in the label: ``5x4.3`` with three is ``5x4.3x3``.

    >>> parse_designation("10x4.7").size, parse_designation("8x5x3").blades, parse_designation("13x65").pitch_in
    ('10x4.7', 3, 6.5)
    >>> found = parse_designation("APC 10x4.5MR")
    >>> found.maker, found.size, found.blade_class
    ('APC', '10x4.5', 'multirotor')
    >>> [(p.blade_class, p.width) for p in map(parse_designation, ("20.5x10.5WPN", "8x3.7SFR", "APC E V2 12x6"))]
    [('pattern', 1), ('reversible', 0), ('electric', 0)]
    >>> parse_designation("5045").size, parse_designation("1045").size, parse_designation("Gemfan 51466").size
    ('5x4.5', '10x4.5', '5.1x4.66x3')
    >>> parse_designation("10x100")
    Traceback (most recent call last):
        ...
    geometry.common.GeometryError: '10x100': got pitch/diameter 10; expected a ratio from 0.1 to 2.5. Meant 10x10?
    """
    where = repr(text)
    plain = _INCHES.sub("", re.sub(r"(?<=\d)\s+by\s+(?=\d)", "x", text.strip(), flags=re.IGNORECASE)).strip()
    plain = _MILLIMETRES.sub(lambda mm: f"{float(mm[1]) / 25.4:.4g}x{float(mm[2]) / 25.4:.4g}", plain)
    in_words = _BLADES.search(plain)
    plain = _BLADES.sub(" ", plain, 1).strip()
    named = _sizes(plain, where)
    match, in_digits = named[-1], named[-1].re is _DIGITS
    before, after = plain[: named[0].start()].strip(" -_("), plain[match.end() :]
    count = re.search(r"-\s*B?(\d)$", after, re.IGNORECASE)  # 5152S-3
    after = after[: count.start()] if count else after
    told = match["blades"] or (count[1] if count else None) or (in_words[1] if in_words else None)
    blades = int(told) if told else None
    suffix = _Suffix.read(after, where)
    maker, letters = _maker(before)
    kind = suffix.kind or letters.kind or blade_class(f"{maker} {suffix.words}")
    if not in_digits:
        D, pitch = _sized(match[1], match[2], where, blades)
    else:
        D, pitch = _from_digits(match["digits"], where, bool(blades or kind == "fpv"))
        if blades is None and D <= _FPV_LARGEST:
            blades = _fpv_blades(before, match["digits"])
    if kind is None and D <= _FPV_LARGEST and (in_digits or (blades or blades_told or 2) > 2):
        kind = "fpv"
    maker = f"{maker} {suffix.words}".strip()
    return Designation(D, pitch, blades, kind, maker, suffix.reverse, suffix.width or letters.width)


def _sizes(plain: str, where: str) -> list[re.Match[str]]:
    """Where a label states its size: with an x, else in digits; it may repeat it, but not state another."""
    sizes = list(_SIZE.finditer(plain))
    named = sizes or list(_DIGITS.finditer(plain))
    if len({match[0].casefold() for match in named}) != 1:
        got = " and ".join(match[0] for match in named) + ", several sizes" if named else "unreadable text"
        raise GeometryError([(where, got, _EXPECTED, "" if sizes else _meant(plain))])
    return named


def _fpv_blades(before: str, digits: str) -> int | None:
    """Blades of an FPV propeller whose label does not count them: T5143S has the makers' mark of three."""
    if glued := re.search(r"(?:^|[\s-])([TQ])-?$", before):
        return {"T": 3, "Q": 4}[glued[1]]
    return 3 if len(digits) == 5 else None


@dataclass(frozen=True)
class _Suffix:
    """Letters and words behind the size."""

    kind: str | None = None
    reverse: bool = False
    width: int = 0
    words: str = ""  # A maker or series behind the size

    @staticmethod
    def of(letters: str) -> _Suffix:
        """Read letters such as ``WSF`` or ``MRF-RH``; an R behind others, or with a hand, is a reversible blade."""
        parts = [part.lower() for part in _PART.findall(letters)]
        kinds = [ENDINGS[part] for part in parts if part in ENDINGS]
        both_ways = "r" in parts and (parts.index("r") > 0 or bool({"rh", "lh"} & set(parts)))
        kind = "reversible" if both_ways else "pattern" if "pattern" in kinds else kinds[0] if kinds else None
        reverse = bool({"p", "lh", "ccw"} & set(parts)) or ("r" in parts and not both_ways)
        return _Suffix(kind, reverse and "ccw" not in parts, parts.count("w") - parts.count("n"))

    @staticmethod
    def read(after: str, where: str) -> _Suffix:
        """Read what stands behind a size; letters glued to it that mean nothing are refused."""
        found, words = _Suffix(), []
        glued = bool(after) and (after[0].isalnum() or after[0] in "-_")
        for i, word in enumerate(re.split(r"[\s(),]+", after.strip(" -_(),"))):
            word = _VERSION.sub("", word)
            if _LETTERS.fullmatch(word):
                own = _Suffix.of(word)
                found = _Suffix(found.kind or own.kind, found.reverse or own.reverse, found.width or own.width)
            elif word.casefold() == "pusher":
                found = _Suffix(found.kind, True, found.width)
            elif word.casefold() in _MATERIALS:
                continue
            elif word and ((glued and i == 0) or not re.match(r"[^\W\d_]{3}|\W", word)) and blade_class(word) is None:
                known = "E, SF, MR, PN, F, W, N, C, P, R, BN, CW, CCW and their combinations"
                raise GeometryError([(where, f"a suffix {word!r}", f"{known}, or nothing", "Leave the letters out")])
            else:
                words.append(word)
        return _Suffix(found.kind, found.reverse, found.width, " ".join(words))


_MATERIALS = frozenset({"", "carbon", "wood", "nylon", "pair", "tractor", "prop", "props", "propeller", "blade"})


def _maker(before: str) -> tuple[str, _Suffix]:
    """Maker and what letters behind its name say: ``APC E V2`` is APC's electric."""
    words, letters = before.replace("_", " ").split(), _Suffix()
    while len(words) > 1:
        word = _VERSION.sub("", words[-1])
        if word and not re.fullmatch(r"E|SF|MR|PN|F|W|WE|WSF|N|C", word):
            break
        own = _Suffix.of(word)
        letters = _Suffix(letters.kind or own.kind, False, letters.width or own.width)
        words.pop()
    return " ".join(words), letters


def _sized(diameter: str, pitch: str, where: str, blades: int | None) -> tuple[float, float]:
    """Diameter and pitch of ``DxP``; all faults at once. [in]"""
    faults = Faults()
    D, p = float(diameter), float(pitch)
    lost = "." not in diameter and D > 120
    faults.number(
        where,
        D,
        0.5,
        120.0,
        "in",
        f"Meant {D / 10:g}? Millimetres need division by 25.4, or write {diameter}x{pitch}mm" if lost else "",
    )
    low, high = _RATIO
    ratio = p / D if D > 0 else math.inf
    tenths = "." not in pitch and low <= ratio / 10 <= high
    if ratio > high and tenths and len(pitch) == 2 and not pitch.endswith("0"):
        p /= 10.0
    elif not low <= ratio <= high:
        first = blades is not None and 1 <= D <= 6 and low <= blades / p <= high  # 3x10x5
        hint = f"Meant {D:g}x{p / 10:g}?" if tenths else "Diameter comes first"
        hint = f"Meant {p:g}x{blades}x{D:g}? The number of blades comes last" if first else hint
        faults.add(where, f"pitch/diameter {ratio:.3g}", f"a ratio from {low:g} to {high:g}", hint)
    if blades is not None:
        faults.number(where, blades, 1, 16, "blades")
    faults.check()
    return D, p


def _meant(text: str) -> str:
    """What a text that is no label may mean, as a label."""
    if sizes := re.search(r"(?<!\d)(\d{1,2}(?:[.,]\d+)?)\s*[x\u00d7*/ -]\s*(\d{1,2}(?:[.,]\d+)?)(?!\d)", text):
        comma = "Decimal point, not comma. " if "," in text else ""
        return f"{comma}Meant {sizes[1].replace(',', '.')}x{sizes[2].replace(',', '.')}?"
    if re.fullmatch(r"\d+(?:\.\d+)?(?:\s*mm)?", text):
        return "A diameter alone: give the pitch too"
    return ""


def _from_digits(digits: str, where: str, fpv: bool) -> tuple[float, float]:
    """Diameter and pitch of ``5045`` or ``51466``: the one reading that is a propeller. [in]

    Of four digits, ``2211`` is 2.2x1.1 of a racer, `fpv`, or 22x11 of a lifter: only words tell.
    """
    a, b = float(digits[:2]), float(digits[2:])
    small, large = (a / 10.0, b / 10.0 ** (len(digits) - 3)), (a, b / 10.0)
    if len(digits) == 5:
        large = (float(digits[:3]) / 10.0, float(digits[3:]) / 10.0)
    low, high = _USUAL_RATIO
    found = [(D, p) for D, p in (small, large) if 1.5 <= D <= 40.0 and low <= p / D <= high]
    whole = [(a, b)] if len(digits) == 4 and 8.0 <= a <= 40.0 and low <= b / a <= 1.0 else []
    if len(found) != 1 or (whole and not fpv):
        found = list(dict.fromkeys([*found, *whole]))
        got = f"digits that fit {('no propeller', 'only whole inches', 'several propellers')[min(len(found), 2)]}"
        names = " or ".join(f"{D:g}x{p:g}" for D, p in found)
        raise GeometryError([(where, got, _EXPECTED, f"Write {names}" if names else "Write diameter x pitch")])
    return found[0]

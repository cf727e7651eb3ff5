"""A small declarative schema for TOML documents: types, units, ranges, suspicious values, all faults at once.

A schema is a mapping of table name to a mapping of key name to :class:`Key`. Units live in the key names
(``diameter_in``); a suspicious value (127 in a key that ends in ``_in``) is refused with a hint, never converted.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault

__all__ = ["AXIS", "Collector", "Key", "check_table", "check_value", "load_toml", "shown"]

AXIS = "a list of distinct numbers, or {start, stop, num}"
_UNIT_TAIL = re.compile(r"_(in|mm|cm|m|m_s|kg_m3|hPa|C|pct|deg)$")


@dataclass(frozen=True)
class Key:
    """What one key of a table may hold.

    Parameters
    ----------
    kind : str
        ``number``, ``integer``, ``text``, ``choice``, ``file``, ``numbers`` (a list), ``scalar_or_list``, ``texts``,
        ``text_or_texts``, ``list`` or ``axis`` (list or start/stop/num).
    unit : str
        Unit, for messages.
    low, high : float
        Closed range of a number, in the unit of the key.
    required : bool
        Whether the key must be there.
    choices : tuple of str
        Lawful texts of a ``choice``.
    suspect : callable, optional
        ``suspect(value) -> hint`` (empty when the value is plausible); called for numbers only.
    """

    kind: str = "number"
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    required: bool = False
    choices: tuple[str, ...] = ()
    suspect: Callable[[float], str] | None = None

    @property
    def expected(self) -> str:
        """What a value must be, in words."""
        if self.kind == "choice":
            return ("one of " if len(self.choices) > 1 else "") + ", ".join(self.choices)
        plain = {
            "text": "a text that is not empty", "file": "the name of a file beside the case", "axis": AXIS,
            "texts": "a list of texts", "text_or_texts": "a text or a list of texts", "list": "a list",
        }  # fmt: skip
        if self.kind in plain:
            return plain[self.kind]
        noun = {"integer": "a whole number", "numbers": "a list of numbers"}.get(self.kind, "a number")
        if self.kind == "scalar_or_list":
            noun = "a number or a list of numbers"
        if math.isfinite(self.low) and math.isfinite(self.high):
            noun += f" from {self.low:g} to {self.high:g}"
        elif math.isfinite(self.low):
            noun += f" of {self.low:g} or more"
        return noun + (f" {self.unit}" if self.unit else "")


class Collector:
    """Gathers the faults of one file.

    Parameters
    ----------
    file : str
        Name that every fault starts with.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self.faults: list[Fault] = []

    def add(self, where: str, got: str, expected: str, hint: str = "") -> None:
        """Add one fault.

        Parameters
        ----------
        where, got, expected, hint : str
            As in :class:`bemt.base.errors.Fault`.
        """
        self.faults.append(Fault(self.file, where, got, expected, hint))


def shown(value: Any) -> str:
    """Show a TOML value shortly, as a user wrote it.

    Parameters
    ----------
    value : object
        Anything that tomllib returns.

    Returns
    -------
    str
        At most about 60 characters.

    Examples
    --------
    >>> shown("eight"), shown(True), shown([1, 2]), shown({"a": 1}), shown(0.5)
    ("'eight'", 'true', 'a list of 2', 'a table', '0.5')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, str):
        return repr(value if len(value) <= 60 else value[:57] + "...")
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _check_number(out: Collector, where: str, value: Any, key: Key) -> bool:
    if not _is_number(value) or not math.isfinite(value):
        out.add(where, shown(value), key.expected, "Drop the quotes" if _quoted_number(value) else "")
        return False
    if key.kind == "integer" and value != int(value):
        out.add(where, shown(value), key.expected)
        return False
    hint = key.suspect(float(value)) if key.suspect else ""
    if hint or not key.low <= value <= key.high:
        out.add(where, shown(value), key.expected, hint)
        return False
    return True


def _quoted_number(value: Any) -> bool:
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def _check_axis(out: Collector, where: str, value: Any, key: Key) -> bool:
    if isinstance(value, Mapping):
        extra = sorted(set(value) - {"start", "stop", "num"})
        lacking = [name for name in ("start", "stop", "num") if name not in value]
        if extra or lacking:
            got = f"{{{', '.join(value)}}}"
            out.add(where, got, AXIS, f"Missing: {', '.join(lacking)}" if lacking else f"Drop {', '.join(extra)}")
            return False
        number = Key(unit=key.unit, low=key.low, high=key.high, suspect=key.suspect)
        fine = [_check_number(out, f"{where}.{end}", value[end], number) for end in ("start", "stop")]
        fine.append(_check_number(out, f"{where}.num", value["num"], Key("integer", low=2, high=1e7)))
        if all(fine) and value["start"] == value["stop"]:
            out.add(where, "start equal to stop", "two different ends")
            return False
        return all(fine)
    if not isinstance(value, list) or not value:
        out.add(where, shown(value), AXIS, f"Write [{shown(value)}]" if _is_number(value) else "")
        return False
    number = Key(unit=key.unit, low=key.low, high=key.high, suspect=key.suspect)
    if not all([_check_number(out, f"{where}[{i}]", item, number) for i, item in enumerate(value)]):
        return False
    if len(set(value)) < len(value):
        out.add(where, "a list with repeated values", AXIS)
        return False
    return True


def check_value(out: Collector, where: str, value: Any, key: Key) -> bool:
    """Check one value; add what is wrong to the collector.

    Parameters
    ----------
    out : Collector
        Receives the faults.
    where : str
        Dotted key.
    value : object
        Value as tomllib returned it.
    key : Key
        What it must be.

    Returns
    -------
    bool
        True when nothing was wrong.

    Examples
    --------
    >>> out = Collector("case.toml")
    >>> check_value(out, "rotor.blades", 2.5, Key("integer", low=1, high=64))
    False
    >>> print(out.faults[0])
    case.toml: rotor.blades: got 2.5; expected a whole number from 1 to 64.
    """
    if key.kind in ("number", "integer"):
        return _check_number(out, where, value, key)
    if key.kind == "axis":
        return _check_axis(out, where, value, key)
    if key.kind == "scalar_or_list" and not isinstance(value, list):
        return _check_number(out, where, value, key)
    if key.kind in ("numbers", "scalar_or_list"):
        if not isinstance(value, list) or not value:
            out.add(where, shown(value), key.expected)
            return False
        number = Key(unit=key.unit, low=key.low, high=key.high, suspect=key.suspect)
        return all([_check_number(out, f"{where}[{i}]", item, number) for i, item in enumerate(value)])
    if key.kind == "list":
        fine = isinstance(value, list)
    elif key.kind == "texts" or (key.kind == "text_or_texts" and isinstance(value, list)):
        fine = isinstance(value, list) and all(isinstance(item, str) and item for item in value)
    elif key.kind == "choice":
        fine = isinstance(value, str) and value in key.choices
    else:
        fine = isinstance(value, str) and bool(value.strip())
    if not fine:
        hint = _did_you_mean(value, key.choices) if key.kind == "choice" and isinstance(value, str) else ""
        out.add(where, shown(value), key.expected, hint)
    return fine


def _did_you_mean(word: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"Did you mean {close[0]}?" if close else ""


def _unknown_key_hint(name: str, table: str, keys: Mapping[str, Key], schema: Mapping[str, Mapping[str, Key]]) -> str:
    stem = _UNIT_TAIL.sub("", name)
    same = [key for key in keys if _UNIT_TAIL.sub("", key) == stem and key != stem]
    if same:
        return f"State the unit in the name: {' or '.join(same)}"
    homes = [other for other, known in schema.items() if name in known and other != table]
    if homes and not name.startswith("_"):
        home = f"[{homes[0]}]" if homes[0] else "the top of the file"
        return f"{name} belongs in {home}"
    return _did_you_mean(name, keys)


def check_table(
    out: Collector,
    table: str,
    value: Any,
    schema: Mapping[str, Mapping[str, Key]],
    where: str | None = None,
    subtables: Iterable[str] = (),
    homes: Mapping[str, Mapping[str, Key]] | None = None,
) -> None:
    """Check one table against its schema: unknown keys, missing keys, each value.

    Parameters
    ----------
    out : Collector
        Receives the faults.
    table : str
        Name of the table in the schema ("" for the top of the file).
    value : object
        The table as tomllib returned it.
    schema : mapping
        Table name to (key name to Key).
    where : str, optional
        Dotted place for messages; the table's name by default.
    subtables : iterable of str
        Names of tables inside this one that are checked elsewhere.
    homes : mapping, optional
        Tables that "belongs in" hints may name; the whole schema by default.

    Examples
    --------
    >>> out = Collector("case.toml")
    >>> check_table(out, "rotor", {"blads": 2}, {"rotor": {"blades": Key("integer", low=1, high=64, required=True)}})
    >>> for fault in out.faults: print(fault)
    case.toml: rotor.blads: got an unknown key; expected one of blades. Did you mean blades?
    case.toml: rotor.blades: got nothing; expected a whole number from 1 to 64.
    """
    keys = schema[table]
    where = table if where is None else where
    if not isinstance(value, Mapping):
        out.add(where, shown(value), f"a table [{table}]")
        return
    prefix = f"{where}." if where else ""
    names = [*keys, *subtables]
    for name, item in value.items():
        if name in keys:
            check_value(out, prefix + name, item, keys[name])
        elif name not in names:
            hint = _unknown_key_hint(name, table, keys, homes if homes is not None else schema)
            hint = hint or _did_you_mean(name, names)
            out.add(prefix + name, "an unknown key", "one of " + ", ".join(names), hint)
    for name, key in keys.items():
        if key.required and name not in value:
            out.add(prefix + name, "nothing", key.expected)


def load_toml(path: str | Path, out: Collector) -> dict[str, Any] | None:
    """Read a TOML file; faults carry line and column.

    Parameters
    ----------
    path : str or Path
        File to read (UTF-8, a byte-order mark is accepted).
    out : Collector
        Receives the faults.

    Returns
    -------
    dict or None
        The document, or None when it could not be read.
    """
    try:
        raw = Path(path).read_bytes()
    except FileNotFoundError:
        out.add("", "no such file", "a TOML file", "Check the path")
        return None
    except OSError as error:
        out.add("", f"an unreadable file ({error.strerror})", "a TOML file")
        return None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - raw.rfind(b"\n", 0, error.start)
        out.add(f"{line}:{column}", f"byte 0x{raw[error.start]:02x}", "UTF-8 text", "Save the file as UTF-8")
        return None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        out.add(*_syntax_fault(str(error), text))
        return None


_SYNTAX = {
    "Cannot overwrite": "a repeated key or table",
    "Cannot declare": "a repeated key or table",
    "Cannot mutate": "a repeated key or table",
    "Invalid value": "no value that TOML knows",
    "Illegal character": "an open quote or an illegal character",
    "Unterminated string": "an open quote or an illegal character",
    "Expected newline": "more text after a value",
    "Unescaped": "a backslash that starts no escape",
    "Expected '='": "a key without =",
}
"""Start of tomllib's message to words that do not change with the version of Python."""


def _syntax_fault(message: str, text: str) -> tuple[str, str, str, str]:
    found = re.match(r"(.*?)\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", message, re.S)
    lines = text.splitlines() or [""]
    if found is None:
        return "", f"invalid TOML ({message})", "valid TOML 1.0", ""
    what = next((words for start, words in _SYNTAX.items() if found[1].startswith(start)), "invalid TOML")
    line, column = (int(found[2]), int(found[3])) if found[2] else (len(lines), len(lines[-1]) + 1)
    source = lines[line - 1].strip() if line <= len(lines) else ""
    hint = ""
    if what == "a repeated key or table":
        hint = "Write each key and each table once"
    elif re.search(r"\d,\d", source) and "[" not in source:
        hint = "Use a decimal point"
    elif re.search(r"=\s*[A-Za-z]", source) and not re.search(r"=\s*(true|false|inf|nan)\b", source):
        hint = "Put text in quotes"
    elif re.search(r"=\s*(#.*)?$", source):
        hint = "Give the key a value"
    return f"{line}:{column}", what + (f" in `{source[:60]}`" if source else ""), "valid TOML 1.0", hint

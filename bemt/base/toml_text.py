"""A TOML file read: what is no TOML is told with line and column, in words that no version of Python changes."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from typing import Any, NoReturn

from bemt.base.errors import Fault, InputError, refuse
from bemt.base.units import SAID, UNITS, convert, split_suffix, suffix_of


class Collector:
    """Gathers the faults of one file."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.faults: list[Fault] = []

    def fault(self, where: object, got: str, expected: str, hint: str = "") -> Fault:
        """Make a fault of this file; `where` is a key, a line or "line:column"."""
        return Fault(self.file, str(where), got, expected, hint)

    def add(self, where: object, got: str, expected: str, hint: str = "") -> None:
        """Add one fault."""
        self.faults.append(self.fault(where, got, expected, hint))

    def check(self) -> None:
        """Raise the faults so far, if any."""
        refuse(self.faults)

    def refuse(self, where: object, got: str, expected: str, hint: str = "") -> NoReturn:
        """Raise the faults so far, with this one as the last."""
        self.add(where, got, expected, hint)
        raise InputError(self.faults)


def load_toml(path: str | Path, out: Collector) -> dict[str, Any] | None:
    """Read a TOML file; faults carry line and column."""
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
        fault = _too_long(text) or _too_large(found := tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        fault = _syntax_fault(str(error), text)
        for told in _units_in(text, int(fault[0].partition(":")[0] or 0)) or [fault]:
            out.add(*told)
        return None
    except RecursionError:
        fault = "", "tables or arrays nested too deep to read", f"at most {_DEEPEST} levels", ""
    except ValueError:  # Python reads no integer of thousands of digits
        fault = "", "an integer of thousands of digits", "numbers up to 1e308", ""
    if fault:
        out.add(*fault)
        return None
    return found


_DEEPEST = 40
"""Levels of tables and arrays that a file may have, and parts that a dotted key may have."""
_LONG_KEY = re.compile(rf"^[ \t]*\[*[ \t]*[\w\"'-]+(?:[ \t]*\.[ \t]*[\w\"'-]+){{{_DEEPEST}}}", re.M)


def _too_long(text: str) -> tuple[str, str, str, str] | None:
    """Refuse a key of so many parts that reading it takes for ever."""
    found = _LONG_KEY.search(text)
    if found is None:
        return None
    line = text.count("\n", 0, found.start()) + 1
    return f"{line}:1", f"a key of more than {_DEEPEST} parts", f"at most {_DEEPEST} parts", ""


def _too_large(document: dict[str, Any]) -> tuple[str, str, str, str] | None:
    """Refuse what no model holds: values nested too deep, integers that no float is as large as."""
    todo: list[tuple[str, Any, int]] = [("", document, 0)]
    while todo:
        where, value, level = todo.pop()
        if level > _DEEPEST:
            key = where.split(".")[0].partition("[")[0]
            return key, "tables or arrays nested too deep", f"at most {_DEEPEST} levels", ""
        if isinstance(value, dict):
            todo += [(f"{where}.{k}" if where else str(k), v, level + 1) for k, v in value.items()]
        elif isinstance(value, list):
            todo += [(f"{where}[{i}]", v, level + 1) for i, v in enumerate(value)]
        elif isinstance(value, int) and abs(value) > sys.float_info.max:
            return where, f"an integer of {value.bit_length() * 3 // 10} digits", "numbers up to 1e308", ""
    return None


_QUANTITY = re.compile(r"([+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s.,][^#,]*?)\s*")
_LINE = re.compile(rf"\s*([\w.-]+?)\s*=\s*{_QUANTITY.pattern}(?:#.*)?")


def unit_hint(key: str, value: str) -> tuple[str, str] | None:
    """What a key with a unit wants in place of a number with a unit behind it, and the number; None for any other.

    >>> unit_hint("rpm", "942 rad/s")
    ('the number alone, in rev/min', '942 rad/s = 8995 rev/min: write rpm = 8995')
    >>> unit_hint("diameter_in", "10 in")
    ('the number alone, in inches', 'Write diameter_in = 10')
    >>> unit_hint("blades", "2 mm") is unit_hint("rpm", "fast") is None
    True
    """
    name, unit = split_suffix(key)
    found = _QUANTITY.fullmatch(value.strip())
    if unit is None or found is None:
        return None
    said, expected = SAID.get(unit.suffix, unit.suffix), "the number alone, in {}"
    other = suffix_of(found[2])
    if not other or UNITS[other].dimension != unit.dimension:
        return expected.format(said), f"The unit of {name} is {said}, as its key says" if name != key else ""
    if other == unit.suffix:
        return expected.format(said), f"Write {key} = {found[1]}"
    number = f"{convert(float(found[1]), other, unit.suffix):.4g}"
    return expected.format(said), f"{found[1]} {found[2]} = {number} {said}: write {key} = {number}"


def _units_in(text: str, line: int) -> list[tuple[str, str, str, str]]:
    """Faults of a line with a unit behind its number and of all such lines below; none if it is otherwise faulty."""
    out: list[tuple[str, str, str, str]] = []
    for k, source in enumerate(text.splitlines(), 1):
        found = _LINE.fullmatch(source) if k >= line > 0 else None
        told = unit_hint(found[1].rpartition(".")[2], f"{found[2]} {found[3]}") if found else None
        if found and told:
            out.append((f"{k}:{found.start(3) + 1}", f"a unit behind the number in `{source.strip()[:60]}`", *told))
        if not out and k >= line or '"""' in text or "'''" in text:
            break
    return out


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

"""TOML documents as typed models: types, units, ranges, suspicious values, all faults at once.

A file is a :class:`Table` (a pydantic model) whose fields say in a :class:`Key` what they may hold; :func:`validated`
gives the model or every fault. Units live in the key names (``diameter_in``); a suspicious value (127 in a key that
ends in ``_in``) is refused with a hint, never converted. Files that are no cases use tables of Keys
(:func:`check_table`).
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from bemt.base.errors import Fault

__all__ = [
    "AXIS",
    "Collector",
    "Key",
    "Table",
    "check_table",
    "check_value",
    "entry",
    "load_toml",
    "shown",
    "validated",
]

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
        """Add one fault."""
        self.faults.append(Fault(self.file, where, got, expected, hint))


def shown(value: Any) -> str:
    """Show a TOML value shortly, as a user wrote it.

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


def _slip_of_length(where: str, value: float, key: Key) -> str:
    """Hint for a length in m or mm that would be possible in the other unit."""
    if key.unit == "m" and where.endswith("_m") and key.low <= value / 1e3 <= key.high:
        return f"In mm? Divide by 1000, or write {where.rpartition('.')[2].removesuffix('_m')}_mm"
    if key.unit == "mm" and where.endswith("_mm") and key.low <= value * 1e3 <= key.high and value < 1.0:
        return "In m? Times 1000"
    return ""


def _check_number(out: Collector, where: str, value: Any, key: Key) -> bool:
    if not _is_number(value) or not math.isfinite(value):
        out.add(where, shown(value), key.expected, "Drop the quotes" if _quoted_number(value) else "")
        return False
    if key.kind == "integer" and value != int(value):
        out.add(where, shown(value), key.expected)
        return False
    hint = key.suspect(float(value)) if key.suspect else ""
    if hint or not key.low <= value <= key.high:
        out.add(where, shown(value), key.expected, hint or _slip_of_length(where, float(value), key))
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


_FAULTS = "bemt_faults"


def entry(
    kind: str = "number",
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[str, ...] = (),
    suspect: Callable[[float], str] | None = None,
    default: Any = None,
    required: bool = False,
    key: Key | None = None,
    alias: str | None = None,
) -> Any:
    """Declare one field of a :class:`Table`: a :class:`Key`, and its default (none when ``required``)."""
    held = key or Key(kind, unit, low, high, required, choices, suspect)
    extra: Any = {"key": held}
    return Field(... if held.required else default, json_schema_extra=extra, alias=alias)


class Table(BaseModel):
    """A TOML table with typed keys; frozen, unknown keys refused. Fields are declared by :func:`entry`."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    @classmethod
    def declared(cls, name: str) -> Key | None:
        """What a key may hold; None for a table inside this one."""
        extra: Any = cls.named()[name].json_schema_extra
        return extra["key"] if extra else None

    @classmethod
    def named(cls) -> dict[str, Any]:
        """Fields by the names that a file uses."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}

    @field_validator("*", mode="before")
    @classmethod
    def _sound(cls, value: Any, info: ValidationInfo) -> Any:
        name = cls.model_fields[str(info.field_name)].alias or str(info.field_name)
        key, out = cls.declared(name), Collector("")
        if key is not None:
            check_value(out, "", value, key)
        elif isinstance(value, list) and not _is_array(cls, name):
            out.add("", shown(value), f"a table [{name}]")
        elif not isinstance(value, (Mapping, BaseModel)) and not _is_array(cls, name):
            out.add("", shown(value), f"a table [{name}]")
        elif _is_array(cls, name) and not isinstance(value, (list, tuple)):
            out.add("", shown(value), f"tables [[{name}]]", f"Write [[{name}]] with two brackets")
        if out.faults:
            found = [(f.where, f.got, f.expected, f.hint) for f in out.faults]
            raise PydanticCustomError(_FAULTS, "not as declared", {"faults": found})
        return tuple(value) if isinstance(value, list) else value


def _is_array(model: type[Table], name: str) -> bool:
    return str(model.named()[name].annotation).startswith("tuple[")


T = TypeVar("T", bound=Table)


def validated(model: type[T], document: Mapping[str, Any], out: Collector) -> T | None:
    """Make a typed model of a document; add what is wrong to the collector.

    Examples
    --------
    >>> class Rotor(Table):
    ...     blades: int = entry("integer", low=1, high=64, required=True)
    >>> out = Collector("case.toml")
    >>> validated(Rotor, {"blads": 2}, out)
    >>> for fault in out.faults: print(fault)
    case.toml: blads: got an unknown key; expected one of blades. Did you mean blades?
    case.toml: blades: got nothing; expected a whole number from 1 to 64.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        found = [(_rank(document, e["loc"]), fault) for e in error.errors() for fault in _faults_of(model, e)]
    for _, fault in sorted(found, key=lambda pair: pair[0]):
        out.add(*fault)
    return None


def _rank(document: Any, loc: tuple[int | str, ...]) -> tuple[int, ...]:
    """Place of a value in its document: by depth of the table, order of the keys; absent ones last."""
    ranks = []
    for part in loc:
        if isinstance(document, Mapping):
            names = list(document)
            ranks.append(names.index(part) if part in names else len(names))
            document = document.get(part)
        elif isinstance(part, int) and isinstance(document, (list, tuple)):
            ranks.append(part)
            document = document[part] if part < len(document) else None
    return (len(loc) > 1, *ranks)


def _faults_of(model: type[Table], error: Any) -> Iterable[tuple[str, str, str, str]]:
    """Our words for one error of pydantic."""
    loc = tuple(error["loc"])
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc).removeprefix(".")
    if error["type"] == _FAULTS:
        owner, value = _model_at(model, loc[:-1]), error["input"]
        held = owner.declared(str(loc[-1])) if loc and str(loc[-1]) in owner.named() else None
        slip = _slip_of_length(where, float(value), held) if held is not None and _is_number(value) else ""
        for at, got, expected, hint in error["ctx"]["faults"]:
            yield where + at, got, expected, hint or slip
        return
    owner = _model_at(model, loc[:-1])
    name = str(loc[-1]) if loc else ""
    if error["type"] == "extra_forbidden":
        known = list(owner.named())
        yield where, "an unknown key", "one of " + ", ".join(known), _stray_hint(name, owner, model)
    elif error["type"] == "missing":
        key = owner.declared(name)
        yield where, "nothing", f"a table [{name}]" if key is None else key.expected, ""
    else:
        key = owner.declared(name) if name in owner.named() else None
        yield where, shown(error["input"]), error["msg"] if key is None else key.expected, ""


def _model_at(model: type[Table], loc: tuple[int | str, ...]) -> type[Table]:
    """Model of the table at a place."""
    for part in loc:
        if isinstance(part, str) and part in model.named():
            model = next((m for m in _models(model.named()[part].annotation)), model)
    return model


def _models(annotation: Any) -> Iterable[type[Table]]:
    """Models that an annotation holds."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def _tables(model: type[Table], where: str = "") -> Iterable[tuple[str, dict[str, Key]]]:
    """All tables of a model by dotted name, with their keys; arrays of tables are left out."""
    yield where, {name: key for name in model.named() if (key := model.declared(name)) is not None}
    for name, field in model.named().items():
        if not _is_array(model, name):
            for inner in _models(field.annotation):
                yield from _tables(inner, f"{where}.{name}".removeprefix("."))


def _stray_hint(name: str, owner: type[Table], root: type[Table]) -> str:
    schema = dict(_tables(root))
    keys = {n: key for n in owner.named() if (key := owner.declared(n)) is not None}
    mine = next((where for where, known in schema.items() if known == keys), None)
    homes = {} if mine is None else schema
    return _unknown_key_hint(name, mine or "", keys, homes) or _did_you_mean(name, owner.named())

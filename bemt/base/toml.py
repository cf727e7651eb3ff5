"""TOML documents as typed models: types, units, ranges, suspicious values, all faults at once.

A file is a :class:`Table` (a pydantic model); each field states its meaning, unit and range by :func:`entry`.
:func:`read_model` gives the model of a file, or every fault as ``file: dotted.key: got X; expected Y. Hint.``
Units live in the key names (``diameter_in``); a suspicious value (127 in a key that ends in ``_in``) is refused with a
hint, never converted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Self, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    Strict,
    StringConstraints,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from bemt.base.action import did_you_mean
from bemt.base.errors import InputError
from bemt.base.toml_text import Collector, load_toml, unit_hint

AXIS = "a list of distinct numbers, or {start, stop, num}"
_UNIT_TAIL = re.compile(r"_(in|mm|cm|m|m_s|kg_m3|hPa|C|pct|deg)$")
_FAULTS = "bemt_faults"
_NOT_EMPTY = StringConstraints(pattern=r"\S")


@dataclass(frozen=True)
class FieldLimits:
    """What the numbers or texts of a field may be; as metadata of the field it builds pydantic's own checks."""

    unit: str = ""  # for messages
    low: float = -math.inf  # closed range of every number, in the unit of the key
    high: float = math.inf
    suspect: Callable[[Any], str] | None = None  # hint for a value that is not plausible, else empty
    choices: tuple[str, ...] = ()  # lawful texts, where the annotation is not a Literal
    words: str = ""  # what a value must be, where type and range do not say it

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Check every number and text that an annotation holds."""
        return handler.generate_schema(self._within(source))

    def _within(self, kind: Any) -> Any:
        origin, inner = get_origin(kind), get_args(kind)
        if origin in (Union, UnionType):
            made: Any = Union[tuple(self._within(part) for part in inner)]  # noqa: UP007
            return Annotated[made, AfterValidator(self._axis)] if Span in inner else made
        if origin is tuple and inner[0] in (float, int):
            one: Any = self._within(inner[0])
            return Annotated[tuple[one, ...], Field(min_length=1)]
        if origin is tuple and inner[0] is str:
            text: Any = self._within(str)
            return tuple[text, ...]
        if kind is str and self.choices:
            return Literal[self.choices]
        if kind in (float, int):
            return Annotated[kind, _Number(self)]
        return {str: Annotated[str, _NOT_EMPTY], bool: Annotated[bool, Strict()]}.get(kind, kind)

    def _axis(self, value: Any) -> Any:
        if isinstance(value, Span):
            for end in ("start", "stop"):
                number = getattr(value, end)
                hint = self.suspect(number) if self.suspect else ""
                if hint or not self.low <= number <= self.high:
                    raise _refusal(f".{end}", shown(number), expected(float, self), hint)
        elif value is not None and len(set(value)) < len(value):
            raise _refusal("", "a list with repeated values", AXIS)
        return value


@dataclass(frozen=True)
class _Number:
    """A finite number within limits: no text, no truth value; 4.0 is a whole number."""

    limits: FieldLimits

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        low, high = ((None if math.isinf(v) else v) for v in (self.limits.low, self.limits.high))
        if source is int:
            made: Any = core_schema.int_schema(ge=low, le=high, strict=True)  # type: ignore[arg-type]
        else:
            made = core_schema.float_schema(ge=low, le=high, strict=True, allow_inf_nan=False)
        made = core_schema.no_info_before_validator_function(_own if source is float else _whole, made)
        return core_schema.no_info_after_validator_function(self._plausible, made) if self.limits.suspect else made

    def _plausible(self, value: float) -> float:
        if self.limits.suspect and self.limits.suspect(value):
            raise PydanticCustomError("suspect", "not plausible")
        return value


def _own(value: Any) -> Any:
    """A number of numpy as one of Python."""
    return value.item() if isinstance(value, np.generic) else value


def _whole(value: Any) -> Any:
    """The same, and 4.0 as a whole number."""
    value = _own(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value


def entry(
    meaning: str, unit: str | FieldLimits = "", low: float = -math.inf, high: float = math.inf,
    suspect: Callable[[Any], str] | None = None, *, default: Any = None, required: bool = False,
    choices: Iterable[str] = (), words: str = "", alias: str | None = None,
) -> Any:  # fmt: skip
    """Declare one field of a :class:`Table`: what it means, its unit and range (or those of another), its default."""
    made = Field(... if required else default, description=meaning, alias=alias)
    made.metadata.append(
        unit if isinstance(unit, FieldLimits) else FieldLimits(unit, low, high, suspect, tuple(choices), words)
    )
    return made


class Table(BaseModel):
    """A TOML table with typed keys; frozen, unknown keys refused. Fields are declared by :func:`entry`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="after")
    def _ruled(self) -> Self:
        found = [(where and f".{where}", *rest, *[""] * (3 - len(rest))) for where, *rest in self.rules()]
        if found:
            raise PydanticCustomError(_FAULTS, "not as declared", {"faults": found})
        return self

    def rules(self) -> Iterable[tuple[str, ...]]:
        """What joins several sound values: (where in this table, got, expected[, hint]) of each fault."""
        return ()

    @classmethod
    def named(cls) -> dict[str, FieldInfo]:
        """Fields by the names that a file uses."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}

    @classmethod
    def inner(cls, name: str) -> type[Table] | None:
        """Model of a table inside this one, or of each of an array of tables; None for a plain value."""
        return next((model for model in _models(cls.named()[name].annotation) if model is not Span), None)

    def given(self) -> dict[str, Any]:
        """What the file states of this table."""
        return {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}


class Span(Table):
    """{start, stop, num}: equal steps."""

    start: float = entry("first value", required=True)
    stop: float = entry("last value", required=True)
    num: int = entry("how many", low=2, high=10_000_000, required=True)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Two ends."""
        if self.start == self.stop:
            yield "", "start equal to stop", "two different ends"


Axis = tuple[float, ...] | Span | None


def axis_values(axis: tuple[float, ...] | Span) -> NDArray[np.float64]:
    """Values of an axis, (N,)."""
    return np.linspace(axis.start, axis.stop, axis.num) if isinstance(axis, Span) else np.array(axis, dtype=float)


def limits_of(field: FieldInfo) -> FieldLimits:
    """What the values of a field may be."""
    return next((item for item in field.metadata if isinstance(item, FieldLimits)), FieldLimits())


def expected(kind: Any, limits: FieldLimits, name: str = "") -> str:
    """What a value must be, in words.

    >>> expected(float | None, FieldLimits("mm", 0, 5)), expected(Literal["a", "b"], FieldLimits())
    ('a number from 0 to 5 mm', 'one of a, b')
    """
    if limits.words:
        return limits.words
    parts = [part for part in _parts(kind) if part is not NoneType]
    if Span in parts:
        return AXIS
    choices = limits.choices or (get_args(parts[0]) if get_origin(parts[0]) is Literal else ())
    if choices:
        return ("one of " if len(choices) > 1 else "") + ", ".join(choices)
    lists = [get_args(part)[0] for part in parts if get_origin(part) is tuple]
    first: Any = next((part for part in parts if get_origin(part) is not tuple), None)
    models = list(_models(kind))
    if models:
        return f"tables [[{name}]]" if lists else f"a table [{name}]"
    one = {str: "a text", bool: "true or false", int: "a whole number", float: "a number"}.get(first, "")
    many = {str: "a list of texts", float: "a list of numbers"}.get(lists[0], "a list") if lists else ""
    if first is str and not many:
        return "a text that is not empty"
    return " or ".join(word for word in (one, many) if word) + _within(limits)


def _within(limits: FieldLimits) -> str:
    """Range and unit of a number, in words that follow it."""
    unit = f" {limits.unit}" if limits.unit else ""
    if not math.isfinite(limits.low):
        return unit
    if math.isfinite(limits.high):
        return f" from {limits.low:g} to {limits.high:g}{unit}"
    return f" of {limits.low:g} or more{unit}"


def shown(value: Any) -> str:
    """Show a TOML value shortly, as a user wrote it.

    >>> shown("eight"), shown(True), shown([1, 2]), shown({"a": 1}), shown(0.5)
    ("'eight'", 'true', 'a list of 2', 'a table', '0.5')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, str):
        return repr(value if len(value) <= 60 else value[:57] + "...")
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _hint(where: str, value: Any, kind: Any, limits: FieldLimits) -> str:
    """How to repair a value that is not what its field holds."""
    parts, name = _parts(kind), where.rpartition(".")[2]
    if isinstance(value, str):
        return _text_hint(name, value, parts, limits)
    if isinstance(value, Mapping) and next(_models(parts[0]), None) and get_origin(parts[0]) is tuple:
        return f"Write [[{name}]] with two brackets"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return ""
    if Span in parts:
        return f"Write [{shown(value)}]"
    low, high = limits.low, limits.high
    if limits.suspect and (hint := limits.suspect(float(value))):
        return hint
    if limits.unit == "m" and where.endswith("_m") and low <= value / 1e3 <= high:
        return f"In mm? Divide by 1000, or write {name.removesuffix('_m')}_mm"
    if limits.unit == "mm" and where.endswith("_mm") and low <= value * 1e3 <= high and value < 1.0:
        return "In m? Times 1000"
    return ""


def _text_hint(name: str, value: str, parts: Sequence[Any], limits: FieldLimits) -> str:
    if choices := limits.choices or next((get_args(k) for k in parts if get_origin(k) is Literal), ()):
        return (limits.suspect(value) if limits.suspect else "") or did_you_mean(value, choices, 1).strip()
    if not {int, float} & set(parts):
        return ""
    told = unit_hint(name, value)
    return "Drop the quotes" if _quoted_number(value) else told[1] if told else ""


def _parts(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)


def _quoted_number(value: str) -> bool:
    try:
        return math.isfinite(float(value))
    except ValueError:
        return False


def _refusal(where: str, got: str, expected: str, hint: str = "") -> PydanticCustomError:
    """Error of a validator in our words; `where` is what follows the place of the value, such as ``.unit``."""
    return PydanticCustomError(_FAULTS, "not as declared", {"faults": [(where, got, expected, hint)]})


T = TypeVar("T", bound=Table)


def validated(model: type[T], document: Mapping[str, Any], out: Collector) -> T | None:
    """Make a typed model of a document; add what is wrong to the collector.

    >>> class Rotor(Table):
    ...     blades: int = entry("number", low=1, high=64, required=True)
    >>> out = Collector("case.toml")
    >>> validated(Rotor, {"blads": 2}, out)
    >>> for fault in out.faults: print(fault)
    case.toml: blads: got an unknown key; expected one of blades. Did you mean blades?
    case.toml: blades: got nothing; expected a whole number from 1 to 64.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        found: dict[str, tuple[Any, tuple[str, str, str, str]]] = {}
        for item in error.errors(include_url=False):
            place = _Place(model, item["loc"], item["type"] == "extra_forbidden")
            for fault in _faults_of(model, item, place):
                found.setdefault(fault[0], (_rank(document, place.path), fault))
    for where, (_, fault) in sorted(found.items(), key=lambda pair: pair[1][0]):
        if not any(other.startswith((f"{where}.", f"{where}[")) for other in found):  # else a branch that was not meant
            out.add(*fault)
    return None


def read_model(model: type[T], path: Path) -> T:
    """Model of a TOML file; all its faults in one InputError."""
    out = Collector(path.as_posix())
    document = load_toml(path, out)
    made = None if document is None else validated(model, document, out)
    if made is None:
        raise InputError(out.faults)
    return made


def check_field(out: Collector, where: str, model: type[Table], name: str, value: Any) -> bool:
    """Check one value as the field of that name; add what is wrong to the collector.

    >>> class Rotor(Table):
    ...     blades: int = entry("number", low=1, high=64, required=True)
    >>> out = Collector("case.toml")
    >>> check_field(out, "assumptions[0].low", Rotor, "blades", 2.5)
    False
    >>> print(out.faults[0])
    case.toml: assumptions[0].low: got 2.5; expected a whole number from 1 to 64.
    """
    own = Collector(out.file)
    validated(_alone(model, name), {name: value}, own)
    for fault in own.faults:
        out.add(where + fault.where.removeprefix(name), fault.got, fault.expected, fault.hint)
    return not own.faults


@cache
def _alone(model: type[Table], name: str) -> type[Table]:
    field = model.named()[name]
    own = next(key for key, value in model.model_fields.items() if value is field)
    alone: Any = create_model("Alone", __base__=Table, **{own: (field.annotation, field)})  # type: ignore[call-overload]
    return alone  # type: ignore[no-any-return]


class _Place:
    """Where an error of pydantic is: its path without the names of union branches, and the field there."""

    def __init__(self, model: type[Table], loc: tuple[int | str, ...], undeclared: bool) -> None:
        self.path: list[int | str] = []
        self.owner: type[Table] | None = model
        self.field: FieldInfo | None = None
        self.name = ""
        inner: type[Table] | None = model
        for k, part in enumerate(loc):
            if isinstance(part, int):
                self.path.append(part)
            elif inner is not None and part in inner.named():
                self.path.append(part)
                self.owner, self.name, self.field = inner, part, inner.named()[part]
                inner = next(_models(self.field.annotation), None)
            elif inner is not None and undeclared and k == len(loc) - 1:
                self.path.append(part)
                self.owner, self.name, self.field = inner, part, None
        self.where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in self.path)[1:]
        self.indexed = bool(self.path) and isinstance(self.path[-1], int)


def _rank(document: Any, path: list[int | str]) -> tuple[int, ...]:
    """Place of a value in its document: by depth of the table, order of the keys; absent ones last."""
    ranks = []
    for part in path:
        if isinstance(document, Mapping):
            names = list(document)
            ranks.append(names.index(part) if part in names else len(names))
            document = document.get(part)
        elif isinstance(part, int) and isinstance(document, (list, tuple)):
            ranks.append(part)
            document = document[part] if part < len(document) else None
    return (len(path) > 1, *ranks)


def _faults_of(model: type[Table], error: Any, at: _Place) -> Iterable[tuple[str, str, str, str]]:
    """Our words for one error of pydantic."""
    kind = None if at.field is None else at.field.annotation
    what, value = error["type"], error["input"]
    if what == _FAULTS:
        for where, got, wanted, hint in error["ctx"]["faults"]:
            yield (at.where + where).removeprefix("."), got, wanted, hint
    elif what == "extra_forbidden" and at.owner is not None:
        known = "one of " + ", ".join(at.owner.named())
        yield at.where, "an unknown key", known, _stray_hint(str(at.path[-1]), at.owner, model)
    elif at.field is None:
        yield at.where, shown(value), error["msg"], ""
    elif what == "missing":
        yield at.where, "nothing", expected(kind, limits_of(at.field), at.name), ""
    elif at.indexed:
        kind = next(get_args(part)[0] for part in _parts(kind) if get_origin(part) is tuple)
        limits, table = limits_of(at.field), f"a table [[{at.name}]]"
        wanted = table if next(_models(kind), None) else expected(kind, limits)
        yield at.where, shown(value), wanted, _hint(at.where, value, kind, limits)
    else:
        limits = limits_of(at.field)
        hint = _hint(at.where, value, kind, limits)
        yield at.where, shown(value), expected(kind, limits, at.name), hint


def _models(annotation: Any) -> Iterator[type[Table]]:
    """Models that an annotation holds."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def _tables(model: type[Table], where: str = "") -> Iterable[tuple[str, type[Table]]]:
    """All tables of a model by dotted name; arrays of tables are left out."""
    yield where, model
    for name, field in model.named().items():
        inner = model.inner(name)
        if inner is not None and get_origin(field.annotation) is not tuple:
            yield from _tables(inner, f"{where}.{name}".removeprefix("."))


def _stray_hint(name: str, owner: type[Table], root: type[Table]) -> str:
    """What an unknown key was meant to be: one with a unit, one of another table, or a slip of the pen."""
    keys = [key for key in owner.named() if owner.inner(key) is None]
    stem = _UNIT_TAIL.sub("", name)
    same = [key for key in keys if _UNIT_TAIL.sub("", key) == stem and key != stem]
    if same:
        return f"State the unit in the name: {' or '.join(same)}"
    tables = dict(_tables(root))
    homes = [
        where
        for where, other in tables.items()
        if other is not owner and name in other.named() and other.inner(name) is None
    ]
    if homes and owner in tables.values() and not name.startswith("_"):
        home = f"[{homes[0]}]" if homes[0] else "the top of the file"
        return f"{name} belongs in {home}"
    return (did_you_mean(name, keys, 1) or did_you_mean(name, owner.named(), 1)).strip()

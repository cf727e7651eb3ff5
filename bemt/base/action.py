"""One declaration per action: a public function with numpydoc is the library's function and the command.

``@action(...)`` adds to the function only what a signature cannot say: the group and example of the help, which
parameters are bare words on the command line, and which options people use. :mod:`bemt.app.face` makes the command,
its help and its completion from that. A parameter and its option have one name: ``airspeed_m_s`` is
``--airspeed-m-s``; hints are written with options, and the library reads them as parameters.
"""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from bemt.base.errors import EXIT_OK, Fault, InputError, refuse, system_fault

__all__ = [
    "Answered", "Declaration", "Cells", "Count", "Told", "about", "action", "choices_of", "did_you_mean", "in_words",
    "in_words_of_the_library", "options_of", "worded",
]  # fmt: skip

P = ParamSpec("P")
T = TypeVar("T")
Count = int
Cells = int
"""Whole number of 1 or more, in a signature."""


@dataclass(frozen=True)
class Declaration:
    """What the command line adds to a function."""

    command: str  # name of the command
    group: str  # heading of the help
    example: str  # a line to type, without the program's name
    words: tuple[str, ...] = ()  # parameters that are bare words
    common: tuple[str, ...] = ()  # parameters that people use; the rest stands in --help-all
    shown: bool = False  # among the commands of `bemt --help`; the others stand under `bemt lab`
    elsewhere: Mapping[str, str] = field(
        default_factory=dict
    )  # quantities, options or, as "", words too many that are looked for here, and where they are


class Answered:
    """What every answer has: ``str()`` is its ``text`` in the words of the library, and a notebook shows it.

    ``to_dict()`` gives what ``--json`` prints, None where a number is not known; ``to_pandas()`` the rows of an answer
    that has a table.
    """

    text: Any  # text for a terminal, with options
    document: Any  # plain values, for answers that have them at hand

    def __str__(self) -> str:
        """Text with parameters in place of options."""
        return in_words(self.text)

    def _repr_html_(self) -> str:
        """Show the answer in a notebook."""
        from bemt.base.notebook import as_html

        head = repr(self)[1:-1] if type(self).__repr__ is not object.__repr__ else ""
        return as_html(head, str(self))

    def to_dict(self) -> Mapping[str, Any]:
        """Plain values; None where a number is not known."""
        from bemt.base.tables import plain

        found: Mapping[str, Any] = plain(self._document())
        return found

    def _document(self) -> Mapping[str, Any]:
        """What `to_dict` makes plain."""
        found: Mapping[str, Any] = self.document
        return found


@dataclass(frozen=True, eq=False)
class Told(Answered):
    """Answer of an action that has no object of its own: a document, its text, and how it ended."""

    document: dict[str, Any]
    text: str
    details: str = ""  # everything, where the text is one screen
    exit_code: int = EXIT_OK
    complaints: tuple[str, ...] = ()  # lines of the error stream
    files: tuple[Path, ...] = ()  # what was written


def action(
    group: str, example: str, *, words: tuple[str, ...] = (), common: tuple[str, ...] = (), shown: bool = False,
    command: str = "", elsewhere: Mapping[str, str] | None = None,
) -> Callable[[Callable[P, T]], Callable[P, T]]:  # fmt: skip
    """Declare a public function as an action."""

    def declare(function: Callable[P, T]) -> Callable[P, T]:
        name = command or function.__name__.replace("_", "-")
        found = worded(function, checked=True)
        setattr(found, "about", Declaration(name, group, example, words, common, shown, elsewhere or {}))  # noqa: B010
        return found

    return declare


def about(function: Callable[..., Any]) -> Declaration:
    """What an action declares."""
    found: Declaration = getattr(function, "about")  # noqa: B009
    return found


def worded(function: Callable[P, T], checked: bool = False) -> Callable[P, T]:
    """Function that suggests the right keyword, checks counts and choices, and names parameters in its faults.

    >>> @worded
    ... def solve(rpm, airspeed_m_s=0.0): return rpm
    >>> solve(1, airspeed=2)
    Traceback (most recent call last):
        ...
    TypeError: solve() got 'airspeed'. Did you mean airspeed_m_s?

    A quantity may be given in another unit that its suffix names: ``airspeed_km_h=72``. Where arguments are ``checked``
    by their annotations, one thing counts as a sequence of it, and None as the default.
    """
    code = function.__code__
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    kinds = {name: str(kind) for name, kind in function.__annotations__.items() if name in names}
    cells = tuple(name for name, kind in kinds.items() if "Cells" in kind)
    counts = (*cells, *(name for name, kind in kinds.items() if "Count" in kind))
    choices = {name: found for name, kind in kinds.items() if (found := choices_of(kind))}

    @functools.wraps(function)
    def call(*args: P.args, **more: P.kwargs) -> T:
        from bemt.base.arguments import as_declared, check_choices

        if any(name not in names for name in more):
            from bemt.base.other_units import in_own_units

            in_own_units(more, names)
        if unknown := [name for name in more if name not in names]:
            near = did_you_mean(unknown[0], names) or f" It takes {', '.join(n for n in names if n != 'self')}."
            raise TypeError(f"{function.__name__}() got {unknown[0]!r}.{near}")
        given = dict(zip(names, args, strict=False)) | more
        given |= {name: cells_of(given[name]) for name in cells if name in given}
        given = as_declared(given, kinds, function) if checked else given
        first: Any = (*(given[name] for name in names[: len(args)]), *args[len(names) :])
        named: Any = {name: given[name] for name in more}
        check_counts(counts, given)
        check_choices(choices, given)
        with in_words_of_the_library():
            return function(*first, **named)

    return call


def cells_of(value: Any) -> Any:
    """Cells in series of a battery as people write them; what is none stays, to be refused.

    >>> tuple(cells_of(value) for value in ("3S", "4", 6, "3x"))
    (3, 4, 6, '3x')
    """
    found = re.fullmatch(r"\s*(\d+)\s*[sS]?\s*", value) if isinstance(value, str) else None
    return int(found[1]) if found else value


def check_counts(names: Iterable[str], given: dict[str, Any]) -> None:
    """Refuse what is not a whole number of 1 or more."""
    faults = []
    for name in names:
        value = given.get(name)
        for one in value if isinstance(value, (list, tuple)) else [value]:
            whole = one is None or isinstance(one, bool) is False and hasattr(one, "__index__") and one >= 1
            if not whole:
                faults.append(Fault("", name, repr(one), "a whole number of 1 or more"))
    refuse(faults)


def choices_of(kind: str) -> tuple[str, ...]:
    """Words of an annotation's Literal.

    >>> choices_of("Sequence[Literal['thrust', 'torque']]"), choices_of("float | None")
    (('thrust', 'torque'), ())
    """
    found = re.search(r"Literal\[(.*?)\]", kind)
    return tuple(re.findall(r"[\"']([^\"']*)[\"']", found[1])) if found else ()


def did_you_mean(got: str, known: Iterable[str], most: int = 2) -> str:
    """`` Did you mean X?`` when a known word is near, else nothing; a unit at the end makes no word near.

    >>> did_you_mean("swep", ["sweep", "report"]), did_you_mean("x", ["sweep"])
    (' Did you mean sweep?', '')
    >>> did_you_mean("--pitch-in", ["--diameter-in", "--chord-mm"]), did_you_mean("chord_cm", ["duct_mm", "chord_mm"])
    ('', ' Did you mean chord_mm?')
    >>> did_you_mean("--airspeed-kmh", ["--airspeed-m-s"])
    ' Did you mean --airspeed-km-h?'
    """
    from bemt.base.other_units import respelled
    from bemt.base.units import split_suffix

    name, names = _plain(got), {word: _plain(word) for word in known}
    if right := respelled(name, names.values()):
        return f" Did you mean {'--' + right.replace('_', '-') if got.startswith('--') else right}?"
    stem, unit = split_suffix(name)
    near = {word: (_alike(stem, split_suffix(own)[0]), _alike(name, own)) for word, own in names.items()}
    if unit is None:
        near = {word: (max(both), both[1]) for word, both in near.items()}
    best = sorted((word for word in near if near[word][0] >= 0.6), key=lambda word: near[word], reverse=True)[:most]
    return f" Did you mean {' or '.join(best)}?" if best else ""


def _plain(word: str) -> str:
    """Option or parameter as a name."""
    return word.lstrip("-").replace("-", "_").strip("_")


def _alike(a: str, b: str) -> float:
    """Share of the letters of two words that match in order."""
    return difflib.SequenceMatcher(None, b, a).ratio()


def in_words(sentence: str) -> str:
    """Lines with parameters in place of options; a whole line for the shell stays.

    >>> in_words("As in --thrust-N 27 --cells 6"), in_words("Try bemt new --scan FILE")
    ('As in thrust_N=27, cells=6', 'Try bemt new --scan FILE')
    >>> in_words("--rpm N; or --case /tmp/a.toml."), in_words("--chord-mm (at 0.75 R)")
    ('rpm=N; or case=/tmp/a.toml.', 'chord_mm (at 0.75 R)')
    >>> in_words("Add --out recording.toml."), in_words("more flights with --healthy would show; --details tells")
    ('Add out=recording.toml.', 'more flights with healthy= would show; .details tells')
    """
    if "\n" in sentence:
        return "\n".join(map(in_words, sentence.split("\n")))
    if "--" not in sentence or re.search(r"\bbemt [a-z]", sentence):
        return sentence
    valued = re.sub(r"(--[a-z][\w-]*) ((?:[\d/'\"]|[A-Z]{1,2}|\w+=)[^\s;`]*[^\s;`.,)]|[A-Z\d](?![\w])|[\w./-]+\.toml)",
                    lambda m: f"{_name(m[1])}={m[2]}", sentence)  # fmt: skip
    bare = re.sub(r"--[a-z][\w-]*", lambda m: _ALONE.get(m[0]) or _word(_name(m[0])), valued)
    return re.sub(r"(=[\d.]+) (?=[a-zA-Z_]+=)", r"\1, ", bare)


_ALONE = {"--details": ".details", "--json": ".to_dict()"}
"""Options of the command line that are no parameters, as an answer has them."""


def _word(name: str) -> str:
    """A parameter in a sentence: one of a single plain word is marked as such."""
    return name if "_" in name else f"{name}="


def _name(option: str) -> str:
    return option.removeprefix("--").replace("-", "_")


@contextmanager
def in_words_of_the_library(keys: dict[str, str] | None = None, file: str = "") -> Iterator[None]:
    """Name parameters, not options, in the faults of what runs inside.

    `keys` are keys of the case `file` that a caller gave as parameters, to their names: a fault there is the
    parameter's.
    """
    try:
        yield
    except InputError as error:
        faults = [_named(fault, keys or {}, file) for fault in error.faults]
        if faults == list(error.faults):
            raise
        raise InputError(faults) from None
    except OSError as error:  # a folder that is a file; libraries have no word of the system
        if error.strerror:
            raise InputError(system_fault(error)) from error
        raise


def _named(fault: Fault, keys: dict[str, str], file: str) -> Fault:
    if fault.file == file and fault.where in keys:
        fault = replace(fault, file="", where=keys[fault.where])
    file, where = (re.sub(r"--[a-z][\w-]*", lambda m: _name(m[0]), words) for words in (fault.file, fault.where))
    return replace(fault, file=file, where=where, expected=in_words(fault.expected), hint=in_words(fault.hint))


def options_of(fault: Fault) -> Fault:
    """A fault with the option in place of a parameter that was typed without a file.

    >>> print(options_of(Fault("", "airspeed_m_s", "x", "a number")))
    --airspeed-m-s: got x; expected a number.
    """
    words = fault.where if not fault.file else ""
    if not words or not re.fullmatch(r"[a-z]\w*(, [a-z]\w*)*", words) or words in ("label", "recordings", "points"):
        return fault
    return replace(fault, where=re.sub(r"\w+", lambda m: "--" + m[0].replace("_", "-"), words))

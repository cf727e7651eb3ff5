"""The command line made from the actions: a signature gives the options, numpydoc the help, the answer the output.

An answer has ``text`` and ``to_dict()``; where it has them, ``details`` (all of it, where the text is one screen),
``exit_code`` and ``complaints`` (lines for the error stream) are used, too.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, cast

from bemt.app import registry
from bemt.app.registry import complain, progress
from bemt.base.action import Declaration, about, cells_of, check_counts, choices_of, did_you_mean
from bemt.base.errors import EXIT_OK

PROGRESS = "progress"
"""Parameter that takes lines of text while the work goes on; no option."""


@dataclass(frozen=True)
class Option:
    """One parameter of an action, as both doors know it."""

    name: str
    kind: str  # flag, choice, mapping, pair, number, count, cells or text
    many: bool
    default: Any  # inspect.Parameter.empty where it is required
    choices: tuple[str, ...]
    help: str

    @property
    def required(self) -> bool:
        """Whether it must be given."""
        return self.default is inspect.Parameter.empty

    @property
    def option(self) -> str:
        """Option of the command line; a flag that is on by default is switched off."""
        head = "--no-" if self.kind == "flag" and self.default is True else "--"
        return head + self.name.replace("_", "-")

    def value(self, text: str) -> Any:
        """Value of a word; argparse says what is wrong with it."""
        if self.kind == "number":
            return float(text)
        if self.kind == "count":
            return [int(part) for part in text.split(",")] if self.many else int(text)
        if self.kind == "cells":
            return int(cells_of(text))
        if self.kind == "choice":
            return {c.lower(): c for c in self.choices}.get(text.lower(), text)
        return text


def described(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Summary of an action, and what numpydoc says of each parameter.

    >>> def f(a, b):
    ...     '''Do it.
    ...
    ...     Parameters
    ...     ----------
    ...     a, b : int
    ...         Numbers. [N]
    ...     '''
    >>> described(f)
    ('Do it.', {'a': 'Numbers. [N]', 'b': 'Numbers. [N]'})
    """
    doc = inspect.getdoc(function) or ""
    part = re.search(r"Parameters\n-+\n(.*?)(?=\n\n\w[\w ]*\n-+\n|\Z)", doc, re.S)
    rows = re.findall(r"^(\w[\w, ]*) : [^\n]*\n((?:    .*\n?|\n(?=    ))+)", (part[1] if part else "") + "\n", re.M)
    told = {name.strip(): " ".join(text.replace("``", "").split()) for names, text in rows for name in names.split(",")}
    return doc.partition("\n")[0], told


def parameters(function: Callable[..., Any]) -> tuple[Option, ...]:
    """Parameters of an action in the order of its signature."""
    told = described(function)[1]
    found = []
    for name, given in inspect.signature(function).parameters.items():
        if name == PROGRESS:
            continue
        kind = str(given.annotation)
        words = tuple(filter(None, choices_of(kind)))
        what = (
            "flag" if kind == "bool" else "choice" if words else "mapping" if "Mapping[str, str]" in kind
            else "pair" if "tuple[float, float]" in kind else "text" if re.search(r"\bstr\b(?!, Array)", kind)
            else "number" if re.search(r"float|(?<!str, )ArrayLike", kind)
            else "cells" if "Cells" in kind else "count" if re.search(r"\bint\b|Count", kind) else "text"
        )  # fmt: skip
        many = re.search(r"Sequence|(?<!str, )ArrayLike", kind) is not None
        found.append(Option(name, what, many, given.default, words, told.get(name, "")))
    return tuple(found)


class _Once(argparse.Action):
    """Option with one value; a second one is refused, because the last would silently win."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        given = namespace.__dict__.setdefault("_given", set())
        if self.dest in given and self.option_strings:
            parser.error(f"argument {option}: got it twice; expected it once")
        given.add(self.dest)
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """Parser that takes full option names, each once, and suggests a correction for a typo."""

    def __init__(self, **more: Any) -> None:
        super().__init__(**{**more, "allow_abbrev": False})
        self.register("action", None, _Once)
        self.register("action", "store", _Once)
        self._words: list[str] = []
        self.like = ""
        self.elsewhere: Mapping[str, str] = {}

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; an unknown option is answered with the nearest."""
        self._words = list(args or ())
        known, extra = self.parse_known_args(args, namespace)
        if extra:
            unknown = dict.fromkeys(word.partition("=")[0] for word in extra if word.startswith("-"))
            hints = self._hints(unknown)
            words = [f" {', '.join(of)}: {hint}" if len(unknown) > 1 else f" {hint}" for hint, of in hints if hint]
            bare = self.elsewhere.get("", "Quotes keep words together.")
            words += [f" {bare}"] if not extra[0].startswith("-") else []
            self.error(f"unrecognized arguments: {' '.join(extra)}." + "".join(words))
        return known

    def _hints(self, unknown: Iterable[str]) -> list[tuple[str, list[str]]]:
        """What to say of unknown options, a hint once with all that it is for; "" where there is none."""
        hints: dict[str, list[str]] = {}
        for word in unknown:
            hints.setdefault(self._meant(word), []).append(word)
        return list(hints.items())

    def _meant(self, word: str) -> str:
        """Where the quantity of an unknown option is given, else the nearest option."""
        from bemt.base.units import split_suffix

        of = split_suffix(word[2:].replace("-", "_"))[0]
        options = [option for action in self._actions for option in action.option_strings]
        return self.elsewhere.get(word) or self.elsewhere.get(of) or did_you_mean(word, options, 1).strip()

    def error(self, message: str) -> Any:
        """Say what is wrong in the words of the project, with the nearest option."""
        if message.startswith("the following arguments are required"):
            options = [option for action in self._actions for option in action.option_strings]
            typed = [word.partition("=")[0] for word in self._words if word.startswith("--")]
            hints = self._hints(w for w in typed if w not in options)
            lacking = {self.elsewhere.get(option, "") for option in re.findall(r"--[\w-]+", message)}
            message += "".join(f". {hint}".rstrip(" .") for hint in sorted(filter(None, lacking)))
            message += "".join(f". Got {', '.join(of)}. {hint}".rstrip(" .") for hint, of in hints)
            message += f"{'.'[message.endswith('?') :]} As in: {self.like}" if self.like else ""
        number = re.match(r"argument (.+?): invalid (number|count|cells) value: '(.*)'$", message)
        if number:
            of_cells = "a whole number, as 3 or 3S"
            expected = (
                of_cells if number[2] == "cells" else f"a {'whole ' * (number[2] == 'count')}number, without its unit"
            )
            listed = re.search("[,:]", number[3]) is not None
            hint = " Several are separated by spaces, the decimal mark is a point." if listed else ""
            message = f"{number[1]}: got {number[3] or 'nothing'}; expected {expected}.{hint}"
        wrong = re.match(r"argument (.+?): invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if wrong:
            name, got, known = wrong.groups()
            choices = [word.strip(" '") for word in known.split(",")]
            message = f"{name}: got {got}; expected one of {', '.join(choices)}.{did_you_mean(got, choices)}"
        super().error(message)


def parser_of(function: Callable[..., Any], prog: str = "bemt", everything: bool = False) -> Parser:
    """Parser of one action; unless `everything`, its help shows the options that people use."""
    told, all_of_it = about(function), parameters(function)
    common = set(told.common) or {p.name for p in all_of_it[:8]}
    hidden = [p for p in all_of_it if p.name not in common and p.name not in told.words and not p.required]
    more = "" if everything or not hidden else f"{len(hidden)} more options: {prog} {told.command} --help-all\n"
    parser = Parser(
        prog=f"{prog} {told.command}", description=described(function)[0], add_help=False,
        epilog=f"{more}example: {prog} {told.example}", formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.like, parser.elsewhere = f"{prog} {told.example}", told.elsewhere
    for one in all_of_it:
        _add(parser, one, told, everything or one not in hidden)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--quiet", action="store_true", help="print neither progress nor answer")
    parser.add_argument("--details", action="store_true", help="print all of the answer")
    parser.add_argument("-h", "--help", action="help", help="show the options that people use")
    parser.add_argument("--help-all", action="store_true", help="show all options")
    return parser


def _add(parser: Parser, one: Option, told: Declaration, visible: bool) -> None:
    """Option or bare word of a parameter."""
    on = one.kind == "flag" and one.default is True
    said = f"Do not {one.help[:1].lower()}{one.help[1:]}" if on else one.help
    words = said.replace("%", "%%") if visible else argparse.SUPPRESS
    metavar = one.name.split("_")[0].upper()
    if one.kind == "flag":
        parser.add_argument(one.option, dest=one.name, action="store_const", const=one.default is not True, help=words)
        return

    def value(text: str) -> Any:
        return one.value(text)

    value.__name__ = one.kind
    more: dict[str, Any] = {"type": value, "help": words}
    if one.choices:
        more |= {"choices": one.choices, "metavar": None if len(one.choices) < 5 else metavar}
    if one.name in told.words:
        needed = one.required
        more["nargs"] = "*" if one.many else None if needed else "?"  # an option before them may have taken them
        more["help"] = one.help.replace("%", "%%")
        if one.choices:
            more.pop("metavar")
        parser.add_argument(one.name, metavar=one.name.upper(), **{k: v for k, v in more.items() if k != "metavar"})
        return
    names = list(dict.fromkeys((one.option, one.option.lower())))
    if one.many or one.kind in ("mapping", "pair"):
        more |= {"action": "extend", "nargs": "+"}
    if not one.choices:
        more["metavar"] = metavar
    action = parser.add_argument(*names[:1], dest=one.name, required=one.required, **more)
    for name in names[1:]:  # --thrust-n is --thrust-N
        parser._option_string_actions[name] = action


def values(function: Callable[..., Any], args: argparse.Namespace) -> dict[str, Any]:
    """Arguments of the call: what was typed; the rest keeps the function's default."""
    out = {}
    for one in parameters(function):
        given = getattr(args, one.name, None)
        if given is None or (one.name in about(function).words and given == [] and not one.required):
            continue
        if one.kind == "mapping":
            given = _mapping(one, given)
        elif one.kind == "count" and one.many:
            given = [count for word in given for count in word]
        elif one.kind == "pair":
            given = _pair(one, given)
        out[one.name] = given
    return out


def _mapping(one: Option, given: Sequence[str]) -> dict[str, str]:
    """``NAME=VALUE ...`` as a mapping; a word without a name belongs to the empty one."""
    out: dict[str, str] = {}
    for word in given:
        name, mark, value = word.rpartition("=") if "=" in word else ("", "=", word)
        if name in out:
            raise _fault(one, f"{name or value} twice", "each name once")
        out[name] = value
    return out


def _pair(one: Option, given: Sequence[str]) -> tuple[float, float]:
    """``LOW:HIGH``, two numbers, or one."""
    try:
        found = [float(part) for word in given for part in word.split(":")]
    except ValueError:
        found = []
    if len(found) not in (1, 2):
        raise _fault(one, " ".join(given), "LOW:HIGH or a number, as 400:900")
    return found[0], found[-1]


def _fault(one: Option, got: str, expected: str) -> Exception:
    from bemt.base.errors import Fault, InputError

    return InputError(Fault("", one.option, got, expected))


def parsed(function: Callable[..., Any], argv: Sequence[str], prog: str = "bemt") -> argparse.Namespace:
    """Words of a command line, by the parameters of its action."""
    known = parameters(function)
    typed, read = registry.renamed(about(function).command, argv, {p.option for p in known}, complain), list[str]()
    if {w.partition("=")[0].lower() for w in typed if w.startswith("--")} - {p.option.lower() for p in known}:
        from bemt.base.other_units import words_in_own_units

        typed, read = words_in_own_units(typed, {p.option: p.name for p in known if p.kind == "number"})
    if "--help-all" in typed:
        parser_of(function, prog, everything=True).print_help()
        raise SystemExit(EXIT_OK)
    return cast(argparse.Namespace, parser_of(function, prog).parse_args(typed, argparse.Namespace(converted=read)))


def run(function: Callable[..., Any], argv: Sequence[str], prog: str = "bemt") -> int:
    """Parse, call, show; gives the exit code."""
    told, args = about(function), parsed(function, argv, prog)
    if args.json and hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace")  # RFC 8259, 8.1
    given = values(function, args)
    check_folders(told.command, given)
    check_files({p.name for p in parameters(function) if p.kind == "text"}, given)
    inner = inspect.unwrap(function)  # the faults of the command line name options
    check_counts(
        [p.name for p in parameters(function) if re.search("Count|Cells", str(inner.__annotations__[p.name]))], given
    )
    with progress(args.quiet or args.json) as say, nothing_empty(given.get("out")):
        if PROGRESS in inspect.signature(function).parameters:
            given[PROGRESS] = say
        answer = inner(**given)
    return show(answer, args.json, args.quiet, args.details, args.converted)


def show(answer: Any, as_json: bool, quiet: bool, details: bool, converted: Sequence[str] = ()) -> int:
    """Print an answer, and below it the options that were given in other units."""
    for line in getattr(answer, "complaints", ()):
        complain(line)
    text = ""
    if as_json:
        from bemt.base.tables import json_text

        text = json_text(answer.to_dict())
    elif not quiet:
        whole = getattr(answer, "details", "") if details else ""
        text = whole or (answer.screen() if hasattr(answer, "screen") and sys.stdout.isatty() else answer.text)
        text = "\n".join([text.rstrip("\n"), *converted]) if converted else text
    if text:
        sys.stdout.write(text if text.endswith("\n") else f"{text}\n")
    return int(getattr(answer, "exit_code", EXIT_OK))


def check_files(names: Set[str], given: Mapping[str, Any]) -> None:
    """Refuse a pipe in place of a file: its format is found, then it is read, and it can be read once."""
    from pathlib import Path
    from stat import S_ISFIFO, S_ISSOCK

    from bemt.base.errors import Fault, InputError

    faults = []
    for name in names - {"out_csv", "picture"}:
        value: Any = given.get(name)
        for one in value if isinstance(value, (list, tuple)) else [value]:
            with suppress(OSError, TypeError, ValueError):  # no name of a file
                mode = Path(one).stat().st_mode
                if S_ISFIFO(mode) or S_ISSOCK(mode):
                    hint = "Write it to a file first, cat > FILE"
                    faults.append(Fault(one, "", "a pipe, which can be read once", "a file", hint))
    if faults:
        raise InputError(faults)


@contextmanager
def nothing_empty(out: Any) -> Iterator[None]:
    """Take back the empty folders of a command that has failed or was interrupted."""
    from pathlib import Path

    folder = Path(str(out or "."))
    new = [] if folder.exists() else [folder, *(parent for parent in folder.parents if not parent.exists())]
    try:
        yield
    except BaseException:
        for one in [*sorted(new[0].rglob("*/"), reverse=True), *new] if new else ():
            with suppress(OSError):  # not empty
                one.rmdir()
        raise


FILE_ENDINGS = tuple(".csv .json .txt .md .html .png .pdf .stl .step .stp .obj .3mf".split())
"""Endings of a name that was meant for a file, where a folder is asked for."""


def check_folders(command: str, given: Mapping[str, Any]) -> None:
    """Refuse a file in place of a folder before the work starts, not after it."""
    import os

    from bemt.base.errors import Fault, InputError

    faults = []
    for name in ("out", "work"):
        asked = near = str(given.get(name) or ".")
        if asked.endswith(".toml"):  # a run or a recording is a file
            continue
        while near and not os.path.exists(near):
            near = os.path.dirname(near)
        if near and not os.path.isdir(near):
            hint = f"{command} writes files into it: give a folder, or a name that is not taken"
            faults.append(Fault(f"--{name}", "", f"{near}, a file", "a folder", hint))
        elif not os.path.exists(asked) and asked.lower().endswith(FILE_ENDINGS):
            hint = f"{command} names the files in it: give {os.path.splitext(asked)[0]}"
            faults.append(Fault(f"--{name}", "", f"{asked}, the name of a file", "a folder", hint))
    if faults:
        raise InputError(faults)

"""Command line: scans the commands, calls the chosen one, turns errors into exit codes.

Exit codes: 0 fine; 1 out of tolerance or unconverged; 2 usage or input; 3 internal; 130 interrupted.
"""

from __future__ import annotations

import argparse
import difflib
import gc
import importlib
import importlib.util
import os
import pkgutil
import re
import sys
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any

import bemt.app.commands
from bemt import __version__
from bemt.app.commands._terminal import coloured
from bemt.base import plugins
from bemt.base.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK, Fault, InputError, system_fault

EXIT_INTERRUPTED = 130
GROUPS = ("Propellers and fans", "Recordings", "Drive", "Solids and CFD", "Models and checks")
"""Groups of the help in order; other groups come after them."""
FILE_ENDINGS = tuple(".csv .json .toml .txt .md .html .png .pdf .stl .step .stp .obj .3mf".split())
"""Endings of a name that was meant for a file, where a folder is asked for."""
CODES = "Exit codes: 0 fine, 1 out of tolerance or unconverged, 2 usage or input, 3 internal."


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


class _Parser(argparse.ArgumentParser):
    """Parser that takes full option names, each once, and suggests a correction for a typo."""

    def __init__(self, **more: Any) -> None:
        super().__init__(**{**more, "allow_abbrev": False})
        self.register("action", None, _Once)
        self.register("action", "store", _Once)
        self._words: list[str] = []

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse, and keep the words: what is missing may be there with a typo."""
        self._words = list(args or ())
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> Any:
        if message.startswith("the following arguments are required"):
            options = [option for action in self._actions for option in action.option_strings]
            typed = [word.partition("=")[0] for word in self._words if word.startswith("--")]
            message += "".join(f". Got {w}.{did_you_mean(w, options)}" for w in typed if w not in options)
        number = re.match(r"argument (.+?): invalid (float|int) value: '(.*)'$", message)
        if number:
            expected = "a number, without its unit" if number[2] == "float" else "a whole number, without its unit"
            message = f"{number[1]}: got {number[3] or 'nothing'}; expected {expected}."
        wrong = re.match(r"argument (.+?): invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if wrong:
            name, got, known = wrong.groups()
            choices = [word.strip(" '") for word in known.split(",")]
            what = "command" if name == "COMMAND" else name
            message = f"{what}: got {got}; expected one of {', '.join(choices)}.{did_you_mean(got, choices)}"
            message = plugins.missing(got) or message
        super().error(message)


class _Top(_Parser):
    """Parser of the whole command line."""

    found: dict[str, ModuleType]
    parsers: dict[str, argparse.ArgumentParser]

    def format_help(self) -> str:
        """Commands in their groups, each with an example."""
        groups: dict[str, list[ModuleType]] = {name: [] for name in GROUPS}
        for module in self.found.values():
            groups.setdefault(module.GROUP, []).append(module)
        lines = [f"usage: {self.prog} [-h] [--version] COMMAND ...", "", str(self.description)]
        for name, modules in groups.items():
            lines += ["", name] if modules else []
            for module in modules:
                lines += [f"  {module.NAME:<16}{module.HELP}", f"{'':<18}{self.prog} {module.EXAMPLE}"]
        return "\n".join([*lines, "", f"{self.prog} COMMAND --help lists the options. {CODES}", ""])

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; the command that got an unknown option answers."""
        known, extra = self.parse_known_args(args, namespace)
        if extra:
            parser = self.parsers.get(getattr(known, "command", None) or "", self)
            options = [option for action in parser._actions for option in action.option_strings]
            words = [did_you_mean(word.partition("=")[0], options) for word in extra if word.startswith("-")]
            parser.error(f"unrecognized arguments: {' '.join(extra)}" + "".join(f".{w}" for w in words if w))
        return known


def did_you_mean(got: str, known: Iterable[str]) -> str:
    """`` Did you mean X?`` when a known word is near, else nothing.

    >>> did_you_mean("swep", ["sweep", "report"]), did_you_mean("x", ["sweep"])
    (' Did you mean sweep?', '')
    """
    near = difflib.get_close_matches(got, list(known), 2, 0.6)
    return f" Did you mean {' or '.join(near)}?" if near else ""


def commands() -> dict[str, ModuleType]:
    """Find every file of this folder that defines a command, by the command's name."""
    names = [info.name for info in pkgutil.iter_modules(bemt.app.commands.__path__) if not info.name.startswith("_")]
    files = [importlib.import_module(f"bemt.app.commands.{name}") for name in names if name != "cli"]
    return {file.NAME: file for file in files if hasattr(file, "NAME")}


def build_parser() -> _Top:
    """Make the parser of the whole command line.

    >>> args = build_parser().parse_args(["sweep", "cases/", "--jobs", "2"])
    >>> args.command, args.paths, args.jobs
    ('sweep', ['cases/'], 2)
    """
    what = "Propeller and ducted-fan aerodynamics: BEMT, compared with the K1/K2 model, CFD and bench recordings."
    parser = _Top(prog="bemt", description=what)
    parser.add_argument("--version", action="version", version=f"bemt {__version__}")
    adder = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)
    parser.found, parser.parsers = commands(), {}
    for name, module in parser.found.items():
        # percent signs in help belong to argparse
        one = adder.add_parser(
            name,
            help=module.HELP,
            description=f"{module.HELP[0].upper()}{module.HELP[1:]}.",
            epilog=f"example: {parser.prog} {module.EXAMPLE}",
        )
        module.arguments(one)
        parser.parsers[name] = one
    return parser


def _check_folders(args: argparse.Namespace) -> None:
    """Refuse a file in place of a folder before the work starts, not after it."""
    faults = []
    for name in ("out", "work", "dir"):
        asked = near = getattr(args, name, None) or "."
        while near and not os.path.exists(near):
            near = os.path.dirname(near)
        if near and not os.path.isdir(near):
            hint = f"{args.command} writes files into it: give a folder, or a name that is not taken"
            faults.append(Fault(f"--{name}", "", f"{near}, a file", "a folder", hint))
        elif not os.path.exists(asked) and asked.lower().endswith(FILE_ENDINGS):
            hint = f"{args.command} names the files in it: give {os.path.splitext(asked)[0]}"
            faults.append(Fault(f"--{name}", "", f"{asked}, the name of a file", "a folder", hint))
    if faults:
        raise InputError(faults)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; colour where a terminal has it."""
    gc.set_threshold(50_000, 20, 20)  # looking for cycles where there are few took 5 % of a diagnosis
    with coloured():
        return _main(sys.argv[1:] if argv is None else list(argv))


def _main(argv: list[str]) -> int:
    for stream in (sys.stdout, sys.stderr):  # a terminal without UTF-8 must not end a run
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    parser = build_parser()
    if not argv:
        parser.print_help()
        return EXIT_OK
    args = parser.parse_args(argv)
    if getattr(args, "json", False) and hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace")  # RFC 8259, 8.1
    try:
        _check_folders(args)
        code = commands()[args.command].run(args)
        sys.stdout.flush()
        return EXIT_OK if code is None else int(code)
    except InputError as error:
        print(error, file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of our output is gone, as in `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:  # a system error; others come from libraries
            print(system_fault(error), file=sys.stderr)
            return EXIT_INPUT
        if isinstance(error, ImportError) and (missing := plugins.missing_module(error)):
            print(missing, file=sys.stderr)
            return EXIT_INPUT
        if isinstance(error, ImportError) and (error.name or "").partition(".")[0] == "geometry":
            found = importlib.util.find_spec("geometry")
            where = found.origin if found else "none"
            hint = "Install bemt into a separate environment"
            print(Fault("geometry", "", f"another package, {where}", "the one of bemt", hint), file=sys.stderr)
            return EXIT_INPUT
        import traceback

        traceback.print_exc()
        print(f"internal error of bemt {__version__}; please report it with the lines above", file=sys.stderr)
        return EXIT_INTERNAL

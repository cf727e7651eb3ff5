"""Command line: finds the action, hands it the words, turns errors into exit codes.

Exit codes: 0 fine; 1 out of tolerance or unconverged; 2 usage or input; 3 internal; 130 interrupted.
"""

from __future__ import annotations

import argparse
import gc
import importlib.util
import os
import sys
from collections.abc import Sequence

from bemt import __version__
from bemt.app import registry
from bemt.app.face import Parser, described, parser_of, run, values
from bemt.app.face import parsed as read_words
from bemt.app.registry import COMMANDS, coloured, complain
from bemt.base import plugins
from bemt.base.action import about, did_you_mean, options_of
from bemt.base.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK, Fault, InputError, system_fault

EXIT_INTERRUPTED = 130
LAB = "lab"
CODES = "Exit codes: 0 fine, 1 out of tolerance or unconverged, 2 usage or input, 3 internal."
WHAT = "Propeller and ducted-fan aerodynamics: BEMT, compared with the K1/K2 model, CFD and bench recordings."


def help_text(lab: bool = False) -> str:
    """Commands of the house, or of the laboratory, each with an example."""
    known = registry.homes()
    shown = [name for name in registry.ORDER if name in known]
    names = sorted(set(known) - set(shown)) if lab else shown
    prog = f"bemt {LAB}" if lab else "bemt"
    lines = [f"usage: {prog} [-h]{'' if lab else ' [--version]'} COMMAND ...", "", WHAT, ""]
    for name in names:
        function = registry.find(name)
        words = described(function)[0]
        lines += [f"  {name:<16}{words[0].lower()}{words[1:].rstrip('.')}", f"{'':<18}{prog} {about(function).example}"]
    if not lab:
        rest = ", ".join(sorted(set(known) - set(shown)))
        lines += ["", f"  {LAB:<16}more commands: {rest}"]
        lines += [f"  {'-':<16}{plugins.missing(tool)}" for tool in plugins.absent()]
    return "\n".join([*lines, "", f"{prog} COMMAND --help lists the options that people use. {CODES}", ""])


def whole_parser() -> tuple[argparse.ArgumentParser, list[Parser]]:
    """Parser of the whole command line, for the completion of a shell, and those of its commands."""
    top = argparse.ArgumentParser(prog="bemt", description=WHAT)
    adder = top.add_subparsers(dest="command")
    parts = []
    for name in registry.homes():
        one = parser_of(registry.find(name), everything=True)
        adder._name_parser_map[name] = one
        adder._choices_actions.append(adder._ChoicesPseudoAction(name, (), described(registry.find(name))[0]))
        parts.append(one)
    return top, parts


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; colour where a terminal has it."""
    gc.set_threshold(50_000, 20, 20)  # looking for cycles where there are few took 5 % of a diagnosis
    with coloured():
        return _main(sys.argv[1:] if argv is None else list(argv))


def parsed(argv: Sequence[str]) -> tuple[str, dict[str, object]]:
    """Command and arguments of a line, as its action gets them.

    >>> parsed(["sweep", "cases/", "--jobs", "2"])
    ('sweep', {'cases': ['cases/'], 'jobs': 2})
    """
    words = list(argv[1:] if argv[0] == LAB else argv)
    function = registry.find(COMMANDS.get(words[0], words[0]))
    return about(function).command, values(function, read_words(function, words[1:]))


def _dispatch(argv: list[str]) -> int:
    """Call the action that the first word names."""
    if not argv or argv[0] in ("-h", "--help", "--help-all"):
        print(help_text(), end="")
        return EXIT_OK
    if argv[0] == "--version":
        print(f"bemt {__version__}")
        return EXIT_OK
    lab = argv[0] == LAB
    words = argv[1:] if lab else argv
    if lab and (not words or words[0] in ("-h", "--help")):
        print(help_text(lab=True), end="")
        return EXIT_OK
    known = registry.homes()
    if words[0] in COMMANDS:
        complain(f"bemt: {words[0]} is now {LAB} {COMMANDS[words[0]]}")
        words = [COMMANDS[words[0]], *words[1:]]
    if words[0] not in known:
        gone = plugins.tool_of(words[0])
        if gone:
            complain(plugins.missing(gone))
            return EXIT_INPUT
        shown = [name for name in registry.ORDER if name in known]
        names = sorted(set(known) - set(shown)) if lab else [*shown, LAB]
        prog, near = (f"bemt {LAB}" if lab else "bemt"), did_you_mean(words[0], known)
        what = f"{prog}: error: COMMAND: got {words[0]}; expected one of {', '.join(names)}.{near}"
        print(f"usage: {prog} [-h]{'' if lab else ' [--version]'} COMMAND ...\n{what}", file=sys.stderr)
        return EXIT_INPUT
    return run(registry.find(words[0]), words[1:], f"bemt {LAB}" if lab else "bemt")


def _main(argv: list[str]) -> int:
    for stream in (sys.stdout, sys.stderr):  # a terminal without UTF-8 must not end a run
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    try:
        code = _dispatch(argv)
        sys.stdout.flush()
        return code
    except InputError as error:
        print(InputError([options_of(fault) for fault in error.faults]), file=sys.stderr)
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

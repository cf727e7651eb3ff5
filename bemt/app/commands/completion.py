"""``bemt completion bash``: the script that completes commands and options in a shell."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_OK

NAME = "completion"
HELP = "print the script that completes commands, options and file names in your shell"
GROUP = "Models and checks"
EXAMPLE = "completion bash"
SHELLS = ("bash", "zsh", "tcsh")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of {', '.join(SHELLS)}")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from bemt.app.commands.cli import build_parser
    from bemt.base.errors import needs

    shtab = needs("shtab", "completion")
    parser = build_parser()
    for one in parser.parsers.values():
        for action in one._actions:
            if action.choices is None and action.nargs != 0 and action.type is None:
                vars(action)["complete"] = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE
    print(shtab.complete(parser, shell=args.shell))
    return EXIT_OK

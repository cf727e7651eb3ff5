"""``bemt effects``: every effect of the catalogue, its parameters and their sources, what gives it away."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK

NAME = "effects"
HELP = "list every effect: parameters, ranges, sources, signature"
GROUP = "Models and checks"
EXAMPLE = "effects"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    style = parser.add_mutually_exclusive_group()
    style.add_argument("--markdown", action="store_true", help="print the page docs/effects.md")
    _options.add_json(style, "bemt.effects/1")


def run(args: argparse.Namespace) -> int:
    """Print the catalogue."""
    from bemt.base.tables import json_text
    from bemt.results.report import effects_list

    made = json_text(effects_list.document()) if args.json else effects_list.markdown() if args.markdown else ""
    print(made or effects_list.text() + "\n", end="")
    return EXIT_OK

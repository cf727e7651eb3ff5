"""``bemt cite CASE``: the sources of each effect, table and data set that an answer stands on."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK

NAME = "cite"
HELP = "list the sources that the answer for a case stands on"
GROUP = "Models and checks"
EXAMPLE = "cite cases/prop_8x5"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("case", metavar="CASE", help="case file or its folder, or a label such as 10x5")
    _options.add_json(parser, "bemt.sources/1")


def run(args: argparse.Namespace) -> int:
    """Print the sources."""
    import shutil

    from bemt.app.library.rotors import rotor_of
    from bemt.base.tables import json_text
    from bemt.rotors.case import sources

    case = rotor_of(args.case).case
    width = min(100, shutil.get_terminal_size((100, 24)).columns)
    print(json_text(sources.document(case)) if args.json else sources.text(case, width) + "\n", end="")
    return EXIT_OK

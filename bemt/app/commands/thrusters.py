"""``bemt thrusters``: share force and roll moment among the thrusters of a body."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "thrusters"
HELP = "allocate force and roll moment to the thrusters of a vehicle"
GROUP = "Drive"
EXAMPLE = "thrusters thrusters.toml --force 40"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", metavar="FILE", help="thrusters.toml or its folder")
    parser.add_argument("--force", type=float, metavar="N", help="requested force (default: from the file) [N]")
    parser.add_argument(
        "--moment", type=float, metavar="NM", help="requested roll moment (default: from the file) [N m]"
    )
    parser.add_argument("--out", metavar="DIR", help="write JSON, CSV and a picture to this folder")
    _options.add_json(parser, "bemt.thrusters.result/1")


def run(args: argparse.Namespace) -> int:
    """Allocate, write, print; 1 if the command is beyond the thrusters."""
    from bemt.base.tables import json_text
    from bemt.tools.drive import thrusters_result

    found, shown, met = thrusters_result.share(args.file, args.force, args.moment, args.out)
    print(json_text(found) if args.json else shown, end="")
    return EXIT_OK if met else EXIT_UNCONVERGED

"""``bemt map``: a bench recording becomes a map of pulse width to thrust, and back."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "map"
HELP = "fit a map from pulse width to thrust and its inverse to a bench recording"
GROUP = "Drive"
EXAMPLE = "map bench.csv --out map"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="recordings of one drive, with one or more batteries")
    parser.add_argument(
        "--sign", type=int, choices=(1, -1), default=1, help="-1 reverses the sign of the thrust (default 1)"
    )
    rows = "number of table rows (default 41)"
    parser.add_argument("--nodes", type=_options.positive, default=41, metavar="N", help=rows)
    parser.add_argument("--name", help="name of the files and of the C tables (default: that of the first recording)")
    parser.add_argument("--thrust", type=float, metavar="N", help="print the pulse width for this thrust [N]")
    parser.add_argument("--voltage", type=float, metavar="V", help="battery voltage for --thrust [V]")
    parser.add_argument("--out", metavar="DIR", help="write CSV, JSON, a C header and a picture to this folder")
    _options.add_json(parser, "bemt.map/1")


def run(args: argparse.Namespace) -> int:
    """Fit, write, print; 1 if the drive cannot give the requested thrust."""
    from bemt.base.tables import json_text
    from bemt.tools.drive import map_result

    found = map_result.fit(args.files, args.sign, args.nodes, args.name, args.thrust, args.voltage, args.out)
    print(json_text(found.document) if args.json else map_result.text(found), end="")
    return EXIT_OK if found.reached else EXIT_UNCONVERGED

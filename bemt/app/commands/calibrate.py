"""``bemt calibrate FILES``: K1/K2 refitted on measured propellers, and where the formula holds."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK

NAME = "calibrate"
HELP = "refit K1/K2 on measured propellers, with intervals and scores"
GROUP = "Models and checks"
EXAMPLE = "calibrate uiuc --out calibration"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    which = "files or folders with diameter, pitch, rpm and thrust or CT (default: uiuc, the installed data)"
    parser.add_argument("files", nargs="*", metavar="FILES", help=which)
    parser.add_argument("--test", metavar="FILES", help="held-out data: scored, never fitted", **_options.MANY)
    parser.add_argument("--out", metavar="DIR", help="write tables and JSON to this folder")
    _options.add_json(parser, "bemt.calibration/2")
    _options.add_quiet(parser)


def run(args: argparse.Namespace) -> int:
    """Fit, score, print."""
    from bemt.base.tables import json_text
    from bemt.rotors.k1k2_calibration import document, read, text, write

    points, test = read(args.files, args.test or ())
    with _terminal.progress(args.quiet) as say:
        found = document(points, test, args.files, args.test or (), say)
    if args.out:
        write(found, args.out)
    if not args.quiet or args.json:
        print(json_text(found).rstrip() if args.json else text(found))
    return EXIT_OK

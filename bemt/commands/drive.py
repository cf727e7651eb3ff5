"""``python -m bemt drive``: thrust over pulse width, hover, endurance and response of a rotor with its drive."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED
from bemt.commands import _options

NAME = "drive"
HELP = "battery, ESC, motor and the rotor of a case: thrust over pulse width"
GROUP = "Drive"
EXAMPLE = "drive cases/ds30"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("case", nargs="?", metavar="CASE", help="case file or its folder")
    parser.add_argument("--drive", metavar="FILE", help="drive.toml (default: beside the case)")
    off = "battery_sag, motor_heating, rotor_inertia or inflow_lag; repeatable"
    parser.add_argument("--off", metavar="EFFECT", help=off, **_options.REPEATABLE)
    parser.add_argument("--airspeed", type=float, default=0.0, metavar="V", help="speed of flight [m/s] (default 0)")
    recorded = "compare the model with the recordings in this folder instead"
    parser.add_argument("--validate", metavar="DIR", help=recorded)
    parser.add_argument("--out", metavar="DIR", help="write JSON, CSV and a picture there")
    _options.add_json(parser, "bemt.drive.result/1; with --validate bemt.drive.validation/1")


def run(args: argparse.Namespace) -> int:
    """Solve the drive; 1 when hover or airspeed is beyond it, or a point is unconverged."""
    from bemt.base.tables import json_text

    if args.validate:
        from bemt.drive import validation_folder

        found, shown = validation_folder.compare(args.validate, args.out)
        print(json_text(found) if args.json else shown, end="")
        return EXIT_OK
    from bemt.drive import drive_result

    result = drive_result.solve(args.case, args.drive, args.off, args.airspeed, args.out)
    print(json_text(result.document) if args.json else drive_result.text(result), end="")
    return EXIT_OK if result.reached else EXIT_UNCONVERGED

"""``python -m bemt drive``: thrust over pulse width, hover, endurance and response of a rotor with its drive."""

from __future__ import annotations

import argparse
from pathlib import Path

from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED
from bemt.commands import _options

NAME = "drive"
HELP = "thrust, current and hover of a rotor with its motor, from a label or from a case with a drive.toml"
GROUP = "Drive"
EXAMPLE = "drive 10x4.5 --kv 900 --cells 3"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    what = "case file, its folder, or with --kv a label such as 10x5"
    parser.add_argument("case", nargs="?", metavar="CASE", help=what)
    parser.add_argument(
        "--kv", type=float, metavar="KV", help="speed constant of the motor, if nothing else is known [rev/min/V]"
    )
    parser.add_argument("--cells", type=_options.positive, metavar="S", help="with --kv: LiPo cells in series")
    parser.add_argument("--mass", type=float, metavar="KG", help="with --kv: mass of the vehicle, for hover [kg]")
    many = "with --kv: number of rotors (default 1)"
    parser.add_argument("--rotors", type=_options.positive, default=1, metavar="N", help=many)
    parser.add_argument("--capacity", type=float, metavar="AH", help="with --kv: battery capacity [A h]")
    parser.add_argument("--drive", metavar="FILE", help="drive.toml (default: in the folder of the case)")
    off = "switch off battery_sag, motor_heating, rotor_inertia or inflow_lag; repeatable"
    parser.add_argument("--off", metavar="EFFECT", help=off, **_options.REPEATABLE)
    parser.add_argument("--airspeed", type=float, default=0.0, metavar="V", help="flight speed [m/s] (default 0)")
    recorded = "compare the model with the recordings in this folder instead"
    parser.add_argument("--validate", metavar="DIR", help=recorded)
    parser.add_argument(
        "--out", metavar="DIR", help="write JSON, CSV and a picture to this folder; with --kv: JSON and text"
    )
    _options.add_json(parser, "bemt.drive.result/1; --kv: bemt.drive.estimate/1; --validate: bemt.drive.validation/1")


def run(args: argparse.Namespace) -> int:
    """Solve the drive; 1 if hover or airspeed is beyond it, or a point is unconverged."""
    from bemt.base.tables import json_text, write_atomic

    if args.validate:
        from bemt.drive import validation_folder

        found, shown = validation_folder.compare(args.validate, args.out)
        print(json_text(found) if args.json else shown, end="")
        return EXIT_OK
    if args.kv is not None or args.cells is not None:
        from bemt.drive import new_folder

        estimate = new_folder.estimate_of(
            args.case, args.kv, args.cells, args.mass, args.rotors, args.capacity, args.airspeed
        )
        if args.out:
            for name, content in (("drive.json", json_text(estimate.to_dict())), ("drive.txt", estimate.text)):
                write_atomic(Path(args.out) / name, content)
        print(json_text(estimate.to_dict()) if args.json else estimate.text, end="")
        return EXIT_OK if estimate.reached else EXIT_UNCONVERGED
    from bemt.drive import drive_result

    result = drive_result.solve(args.case, args.drive, args.off, args.airspeed, args.out)
    print(json_text(result.document) if args.json else drive_result.text(result), end="")
    return EXIT_OK if result.reached else EXIT_UNCONVERGED

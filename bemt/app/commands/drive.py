"""``bemt drive``: thrust over pulse width, hover, endurance and response of a rotor with its drive."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "drive"
HELP = "thrust, current and hover of a rotor with its motor, from a label or from a case with a table [drive]"
GROUP = "Drive"
EXAMPLE = "drive 10x4.5 --kv 900 --cells 3"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    what = "case file, its folder, or a label such as 10x5 (default: this folder)"
    parser.add_argument("case", nargs="?", metavar="CASE", help=what)
    _options.add_motor(parser)
    parser.add_argument("--mass", type=float, metavar="KG", help="mass of the vehicle, for hover [kg]")
    many = "number of rotors on the battery (default: from the case, else 1)"
    parser.add_argument("--rotors", type=_options.positive, metavar="N", help=many)
    parser.add_argument("--capacity", type=float, metavar="AH", help="battery capacity, for the flight time [A h]")
    off = "switch off battery_sag, motor_heating, rotor_inertia or inflow_lag; repeatable"
    parser.add_argument("--off", metavar="EFFECT", help=off, **_options.REPEATABLE)
    parser.add_argument("--airspeed", type=float, default=0.0, metavar="V", help="flight speed [m/s] (default 0)")
    parser.add_argument("--out", metavar="DIR", help="write JSON, CSV and a picture to this folder")
    _options.add_json(parser, "bemt.drive.result/2")


def run(args: argparse.Namespace) -> int:
    """Solve the drive; 1 if hover or airspeed is beyond it, or a point is unconverged."""
    from bemt.base.tables import json_text
    from bemt.tools.drive import drive_result

    case = drive_result.case_for(
        args.case, kv=args.kv, cells=args.cells, mass_kg=args.mass, rotors=args.rotors, capacity_Ah=args.capacity
    )
    result = drive_result.solve(case, args.airspeed, args.off)
    if args.out:
        drive_result.write(result, args.out)
    print(json_text(result.to_dict()) if args.json else result.text, end="")
    return EXIT_OK if result.reached else EXIT_UNCONVERGED

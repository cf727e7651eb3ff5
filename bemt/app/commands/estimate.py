"""``bemt estimate 10x5 --rpm 6000``: thrust and power from a label, with bands, K1/K2 beside them."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK

NAME = "estimate"
HELP = "thrust and power from a label such as 10x5, with bands; K1/K2 for comparison"
GROUP = "Propellers and fans"
EXAMPLE = "estimate 10x5 --rpm 6000"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("label", metavar="LABEL", help="as on the propeller: 10x4.7, APC 10x4.7SF, 8x5x3, 5045")
    speed = {"type": float, **_options.MANY}
    parser.add_argument("--rpm", required=True, metavar="N", help="one or more [rev/min]", **speed)
    parser.add_argument("--airspeed", metavar="V", help="one or more (default 0) [m/s]", **speed)
    parser.add_argument("--angle", metavar="A", help="wind and shaft, 0 to 180, one or more (default 0) [deg]", **speed)
    blades = "number of blades (default: from the label, else 2)"
    parser.add_argument("--blades", type=_options.positive, metavar="B", help=blades)
    parser.add_argument("--chord-mm", type=float, metavar="C", help="chord at 0.75 R; narrows the band most")
    twist = "measured pitch, 2 pi r tan(blade angle) at r = 0.75 R"
    parser.add_argument("--measured-pitch-in", type=float, metavar="P", help=twist)
    parser.add_argument("--series", metavar="NAME", help='maker and series, such as "APC Thin Electric" or apce')
    air = "air density [kg/m3] (default 1.225, 1.16 to 1.29 in the band)"
    parser.add_argument("--density", type=float, metavar="RHO", help=air)
    _options.add_json(parser, "bemt.estimate/2")


def run(args: argparse.Namespace) -> int:
    """Print the estimate."""
    import os
    from dataclasses import replace

    from bemt.base.errors import InputError
    from bemt.base.tables import json_text
    from bemt.rotors.case.estimate import document, text

    try:
        found = document(args.label, args.rpm, args.airspeed or (), args.blades, args.chord_mm, args.measured_pitch_in,
                         args.series, args.density, args.angle or ())  # fmt: skip
    except InputError as error:
        if not os.path.exists(args.label):
            raise
        hint = f"A case? bemt sweep {args.label} solves it"
        raise InputError([replace(f, hint=hint) if f.file == "LABEL" else f for f in error.faults]) from None
    print(json_text(found) if args.json else text(found), end="")
    return EXIT_OK

"""``python -m bemt fly``: a flight log in, the rotor's constants and what is wrong with it out."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "fly"
HELP = "identify the rotors of a flight log, and compare it with healthy flights"
GROUP = "Recordings"
EXAMPLE = "fly flight.ulg --mass 1.2 --case 10x4.5"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    kinds = "flight logs, or a folder: PX4 ULog, ArduPilot DataFlash, Crazyflie usdlog, Betaflight or other CSV"
    parser.add_argument("logs", nargs="*", metavar="LOG", help=kinds)
    parser.add_argument("--case", metavar="ROTOR", help="case or label of the propeller, compared with the flight")
    parser.add_argument("--mass", type=float, metavar="KG", help="mass in flight with battery [kg]")
    layout = 'angles with turning, "-45+ 135+ 45- -135-", or quad-x, x8, ...; "list" prints the names'
    parser.add_argument("--layout", default="", metavar="LAYOUT", help=f"{layout} (default: of the log)")
    healthy = "healthy flights of the same vehicle, 3 or more for a verdict; each folder is a session"
    parser.add_argument("--healthy", default=[], metavar="LOG", help=healthy, **_options.MANY)
    day = "whether this flight is of the same day as the (last) healthy ones (default: by date, else open)"
    parser.add_argument("--healthy-day", default="", choices=("same", "other"), help=day)
    known = "mass of the healthy flights [kg]: gives the mass of this one"
    parser.add_argument("--healthy-mass", type=float, metavar="KG", help=known)
    alarm = "accepted share of healthy flights that are accused (default 0.01); more finds smaller damage"
    parser.add_argument("--false-alarm", type=_share, default=0.01, metavar="P", help=alarm)
    learnt = "write the case of --case with the rotor as these flights show it to this folder; needs --mass"
    parser.add_argument("--out-case", metavar="DIR", help=learnt)
    parser.add_argument("--out", dest="picture", metavar="PNG", help="write a picture of the first log to this file")
    parser.add_argument("--csv", metavar="CSV", help="write a table, a row a flight, to this file")
    parser.add_argument("--details", action="store_true", help="print the constants, and what the log cannot show")
    _options.add_json(parser, "bemt.flight/1")
    _options.add_quiet(parser, "no answer")


def _share(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 0.5:
        raise argparse.ArgumentTypeError(f"got {text}; expected a probability above 0 and below 0.5")
    return value


def run(args: argparse.Namespace) -> int:
    """Read, identify, judge, print."""
    from bemt.base.tables import json_text
    from bemt.tools.flight.actions import fly, layouts

    if args.layout == "list":
        print("\n".join(f"{name:<14} {places}" for name, places in layouts().items()))
        return EXIT_OK
    answer = fly(args.logs, case=args.case, mass_kg=args.mass, layout=args.layout, healthy=args.healthy,
                 healthy_day=args.healthy_day, healthy_mass_kg=args.healthy_mass, false_alarm=args.false_alarm,
                 out_case=args.out_case, out_png=args.picture, out_csv=args.csv)  # fmt: skip
    if args.json:
        print(json_text(answer.document()), end="")
    elif not args.quiet:
        print(answer.text(args.details))
    return EXIT_OK if answer.converged else EXIT_UNCONVERGED

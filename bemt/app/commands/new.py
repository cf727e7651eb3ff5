"""``bemt new 10x5``: a commented case folder that runs at once, unknowns as assumptions with ranges."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, Fault, InputError

NAME = "new"
HELP = "write a case folder from a label, stations, a scan or the diameter of a fan"
GROUP = "Propellers and fans"
EXAMPLE = "new 10x5 --kv 1000 --cells 3"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    label = "label of the propeller: 10x5, APC 10x4.7SF, 8x4.5x3, 5045; with --fan only the diameter: 70mm"
    parser.add_argument("label", nargs="?", metavar="LABEL", help=label)
    table = "file with blade stations: CSV r_over_R,chord_over_R,beta_deg (or r_mm,chord_mm); UIUC geometry; APC PE0"
    solid = "scan or CAD model of the blade (STL, OBJ, STEP); LABEL is then the name of the case"
    parser.add_argument("--scan", metavar="FILE", help=solid)
    parser.add_argument("--unit", choices=("mm", "m", "in"), help="with --scan: unit, if the file does not state it")
    parser.add_argument("--stations", metavar="FILE", help=table)
    parser.add_argument("--diameter-mm", type=float, metavar="D", help="with --stations or --fan: diameter [mm]")
    parser.add_argument("--diameter-in", type=float, metavar="D", help="the same in inches")
    fan = "a ducted fan; with --diameter-mm or --diameter-in LABEL is the name of the case"
    parser.add_argument("--fan", action="store_true", help=fan)
    parser.add_argument(
        "--blades", type=_options.positive, metavar="B", help="number of blades (default: from the label, else 2)"
    )
    parser.add_argument(
        "--rpm", type=float, metavar="N", help="speed of the operating point (default: a typical tip speed) [rev/min]"
    )
    parser.add_argument(
        "--airspeed", type=float, default=0.0, metavar="V", help="airspeed of the operating point [m/s] (default 0)"
    )
    parser.add_argument("--series", metavar="NAME", help='maker and series, such as "APC Thin Electric" or apce')
    _options.add_motor(parser)
    parser.add_argument(
        "--campaign", action="store_true", help="also write cfd/campaign.toml: OpenFOAM runs on three grids"
    )
    parser.add_argument("--out", metavar="DIR", help="folder to write (default: named after the label)")


def run(args: argparse.Namespace) -> int:
    """Write the folder and print the next command."""
    import shlex

    from bemt.rotors.case import new_folder

    if args.diameter_in is not None:
        if args.diameter_mm is not None:
            raise InputError(Fault("", "--diameter-mm, --diameter-in", "both", "one of them"))
        args.diameter_mm = args.diameter_in * 25.4
    told = {name: value for name, value in vars(args).items() if name in new_folder.Wanted.__dataclass_fields__}
    folder, files = new_folder.write(new_folder.Wanted(**told, airspeed_m_s=args.airspeed), args.out)
    print(f"{folder.as_posix()}: {', '.join(files)}")
    typed = shlex.quote(folder.as_posix())
    print(f"next: bemt sweep {typed}")
    if args.kv is not None:
        print(f"      bemt drive {typed}")
    if args.campaign:
        print(f"      bemt cfd {typed}/cfd")
    return EXIT_OK

"""``python -m bemt new 10x5``: a commented case folder that runs at once, unknowns as assumptions with ranges."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_OK
from bemt.commands import _options
from bemt.commands._terminal import called

NAME = "new"
HELP = "write a case folder from a label, stations, a scan or a fan's diameter"
GROUP = "Propellers and fans"
EXAMPLE = "new 10x5 --kv 1000 --cells 3"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    label = "diameter x pitch in inches, blades if not 2: 10x5, 8x4.5x3; with --fan the diameter alone: 70mm"
    parser.add_argument("label", nargs="?", metavar="LABEL", help=label)
    table = "blade in a file: CSV r_over_R,chord_over_R,beta_deg (or r_mm,chord_mm); UIUC geometry; APC PE0"
    solid = "blade in a scan or CAD model (STL, OBJ, STEP); LABEL then names the case"
    parser.add_argument("--scan", metavar="FILE", help=solid)
    parser.add_argument("--unit", choices=("mm", "m", "in"), help="with --scan: of a file that does not state it")
    parser.add_argument("--stations", metavar="FILE", help=table)
    parser.add_argument("--diameter-mm", type=float, metavar="D", help="with --stations: diameter [mm]")
    parser.add_argument("--fan", action="store_true", help="a ducted fan")
    parser.add_argument("--blades", type=_options.positive, metavar="B", help="number (default: of the label, else 2)")
    parser.add_argument("--rpm", type=float, metavar="N", help="operating point (default: a usual tip speed) [rev/min]")
    parser.add_argument("--airspeed", type=float, default=0.0, metavar="V", help="operating point [m/s] (default 0)")
    parser.add_argument("--kv", type=float, metavar="KV", help="motor: also write drive.toml [rev/min/V]")
    parser.add_argument("--cells", type=_options.positive, metavar="S", help="LiPo cells in series, with --kv")
    parser.add_argument("--out", metavar="DIR", help="folder (default: the label's name, here)")


def run(args: argparse.Namespace) -> int:
    """Write the folder and say how to go on."""
    import shlex

    from bemt.drive import new_folder

    told = {name: value for name, value in vars(args).items() if name in new_folder.Wanted.__dataclass_fields__}
    folder, files = new_folder.write(new_folder.Wanted(**told, airspeed_m_s=args.airspeed), args.out)
    print(f"{folder.as_posix()}: {', '.join(files)}")
    typed = shlex.quote(folder.as_posix())
    print(f"next: {called()} sweep {typed}")
    if "drive.toml" in files:
        print(f"      {called()} drive {typed}")
    return EXIT_OK

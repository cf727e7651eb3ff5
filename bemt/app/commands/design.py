"""``python -m bemt design``: chord and twist of a blade for a thrust, within limits of stall, strength and size."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "design"
HELP = "design chord and twist of a blade for a thrust; writes a case next to the best label and the ideal"
GROUP = "Propellers and fans"
EXAMPLE = "design --thrust 6 --airspeed 15 --rpm 7000 --diameter-in 10"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--thrust", type=float, metavar="N", help="thrust to reach [N]")
    parser.add_argument(
        "--airspeed", type=float, default=0.0, metavar="V", help="flight speed [m/s] (default 0: static)"
    )
    rpm = "speed of rotation (default: the one of least power) [rev/min]"
    parser.add_argument("--rpm", type=float, metavar="N", help=rpm)
    point = "a point as thrust=6,airspeed=15,rpm=7000,weight=1, weight being its share of the time; may be repeated"
    parser.add_argument("--point", metavar="POINT", help=point, **_options.REPEATABLE)
    parser.add_argument("--diameter-in", type=float, metavar="IN", help="diameter [in]")
    parser.add_argument("--blades", type=_options.positive, metavar="B", help="number of blades (default 2)")
    section = "NACA digits or coordinate files (.dat), from hub to tip, as 4415,4409 (default: 3.5 %% camber)"
    parser.add_argument("--section", metavar="SECTIONS", help=section)
    parser.add_argument("--hub-ratio", type=float, metavar="X", help="hub over tip radius (default 0.15)")
    parser.add_argument("--static-thrust", type=float, metavar="N", help="thrust that it must also reach at rest [N]")
    parser.add_argument("--static-rpm", type=float, metavar="N", help="speed for that (default: any) [rev/min]")
    chord = "least chord (default 5, of small rotors 4 %% of the diameter) [mm]"
    parser.add_argument("--min-chord-mm", type=float, metavar="MM", help=chord)
    thick = "least greatest thickness of the section, for printing [mm]"
    parser.add_argument("--min-thickness-mm", type=float, default=0.0, metavar="MM", help=thick)
    parser.add_argument("--max-tip-mach", type=float, default=0.8, metavar="M", help="tip Mach limit (default 0.8)")
    stall = "share of the section's largest lift that is kept in hand (default 0.15)"
    parser.add_argument("--stall-margin", type=float, default=0.15, metavar="X", help=stall)
    parser.add_argument(
        "--material", default="pla", metavar="NAME", help="pla, petg, pc, pa12, pla_soft, pa6_gf, al6061 (default pla)"
    )
    parser.add_argument("--safety", type=float, default=3.0, metavar="X", help="strength over stress (default 3)")
    parser.add_argument("--density", type=float, metavar="RHO", help="air density (default 1.225) [kg/m3]")
    parser.add_argument("--duct", metavar="CASE", help="design the rotor inside the duct of this case, from its blade")
    robust = "least expected power over rotors as built, not of the drawing"
    parser.add_argument("--robust", action="store_true", help=robust)
    parser.add_argument("--out", metavar="DIR", help="folder to write (default: named after the design)")
    _options.add_json(parser, "bemt.design/1")
    _options.add_quiet(parser, "no progress")


def run(args: argparse.Namespace) -> int:
    """Design, write the case folder and print the comparison."""
    import shlex
    from pathlib import Path

    from bemt.base.errors import Fault, InputError
    from bemt.base.tables import json_text
    from bemt.base.units import INCH
    from bemt.rotors.case import load_case, new_folder
    from bemt.tools.design import design_answer
    from bemt.tools.design.blade_design import design_blade, name_of
    from bemt.tools.design.requirement import DesignPoint, point_of

    points = [point_of(text) for text in args.point]
    if args.thrust is not None:
        points.insert(0, DesignPoint(args.thrust, args.airspeed, args.rpm))
    elif args.rpm is not None or args.airspeed:
        raise InputError(Fault("--thrust", "", "nothing", "a thrust [N] with --airspeed and --rpm"))
    duct = load_case(args.duct) if args.duct else None
    inch = duct.diameter_m / INCH if duct is not None else args.diameter_in
    if args.out or (points and inch):
        new_folder.free_folder(Path(args.out or name_of(points[0], inch * INCH)))
    with _terminal.progress(args.quiet or args.json) as say:
        found = design_blade(
            points, None if args.diameter_in is None else args.diameter_in * INCH, args.blades, section=args.section,
            hub_ratio=args.hub_ratio, density_kg_m3=args.density, duct=duct,
            robust=args.robust, progress=say, static_thrust_N=args.static_thrust, static_rpm=args.static_rpm,
            min_chord_mm=args.min_chord_mm, min_thickness_mm=args.min_thickness_mm, max_tip_mach=args.max_tip_mach,
            stall_margin=args.stall_margin, material=args.material, safety=args.safety,
        )  # fmt: skip
    folder = design_answer.write(found, args.out or found.name)
    if args.json:
        print(json_text(design_answer.document(found)), end="")
    else:
        print(design_answer.text(found), end="")
        typed = shlex.quote(folder.as_posix())
        print(f"{typed}: case.toml, stations.csv, design.png, design.json; next: bemt sweep {typed}")
    return EXIT_OK if found.found.converged else EXIT_UNCONVERGED

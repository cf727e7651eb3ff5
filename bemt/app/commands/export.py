"""``bemt export CASE --out DIR``: a case as solids, as loads for simulators, as disks and blades."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_INPUT, EXIT_OK

if TYPE_CHECKING:
    from bemt.tools.exports.printing import Print

NAME = "export"
HELP = "write a case for CAD, CFD, simulators and design tools"
GROUP = "Solids and CFD"
EXAMPLE = "export cases/prop_8x5 --out solids --format stl step"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("case", metavar="CASE", help="case file, its folder, or a folder of cases")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the files and manifest.json")
    from bemt.base.plugins import missing

    kinds: list[str] = []
    if not missing("exports"):
        from bemt.tools.exports import target_ids

        kinds = target_ids()
    what = f"one or more (default stl): {', '.join(kinds)}"
    parser.add_argument("--format", choices=kinds or None, metavar="TARGET", help=what, **_options.MANY)
    parser.add_argument(
        "--unit", choices=("mm", "m"), default="mm", help="unit of the files (default mm; openfoam is always in m)"
    )
    parser.add_argument(
        "--fillet-mm", type=float, metavar="R", help="fillet of blade and hub (default 0); height of a printed flare"
    )
    thin = "refuse a blade whose sections are thinner (default: no check); a printed blade is made so (default 0.8)"
    parser.add_argument("--min-thickness-mm", type=float, metavar="T", help=thin)
    _printing(parser)
    top = "highest speed of tables and fits; speed of a disk or openfoam (default: from the case) [rev/min]"
    parser.add_argument("--rpm", type=float, metavar="N", help=top)
    wind = "axial speed of disks, blades and openfoam (default: from the case) [m/s]"
    parser.add_argument("--airspeed", type=float, metavar="V", help=wind)
    words = "torque, airspeed, windmill, reynolds, mach, density, rest, duct, sections, rotation"
    held = f"refuse targets that cannot represent it: {words}"
    parser.add_argument("--hold", metavar="WHAT", help=held, **_options.MANY)
    parser.add_argument(
        "--sideslip-deg", type=float, metavar="A", help="openfoam: angle between shaft and wind, 0 to 90"
    )
    grid = "openfoam: cells on the blade are R/2^(level+2), all others scale (default 6; 5 is faster)"
    parser.add_argument("--level", type=float, help=grid)
    domain = "openfoam: free field, or a cylinder of the propeller's diameter"
    parser.add_argument("--domain", choices=("free", "pipe"), help=domain)
    sector = "openfoam: periodic part (default: one blade from three up, else half; full in oblique flow)"
    parser.add_argument("--sector", choices=("half", "blade", "full"), help=sector)
    models = ("kOmegaSST", "realizableKE")
    parser.add_argument("--turbulence", choices=models, help=f"openfoam (default {models[0]})")
    law = parser.add_mutually_exclusive_group()
    fast = "openfoam: rhoSimpleFoam (default above a tip Mach number of 0.5)"
    law.add_argument("--compressible", dest="solver", action="store_const", const="compressible", help=fast)
    slow = "openfoam: simpleFoam"
    law.add_argument("--incompressible", dest="solver", action="store_const", const="incompressible", help=slow)
    _options.add_json(parser, "bemt.export/1")


def _printing(parser: argparse.ArgumentParser) -> None:
    part = parser.add_argument_group("printing (docs/printing.md)")
    one = "one solid for a printer: thick enough, round tip, hub with a bore; stl, step, 3mf or obj"
    part.add_argument("--printable", action="store_true", help=one)
    part.add_argument("--adapter", metavar="NAME", help="bore and recess: ring (quarter inch), m3, m5, m6 or m8 (nut)")
    part.add_argument("--bore-mm", type=float, metavar="D", help="hole through the hub (default: none)")
    pair: dict[str, Any] = {"type": float, "nargs": 2}
    part.add_argument("--recess-mm", metavar=("D", "DEPTH"), help="round recess in the back of the hub", **pair)
    part.add_argument("--hex-mm", metavar=("FLATS", "DEPTH"), help="hexagonal recess in the back of the hub", **pair)
    part.add_argument("--hub-diameter-mm", type=float, metavar="D", help="hub (default: that of the case)")
    part.add_argument("--hub-height-mm", type=float, metavar="H", help="hub (default: what the root needs)")
    part.add_argument("--trailing-edge-mm", type=float, metavar="T", help="trailing edge (default: least thickness)")
    tip = "length of the rounded tip over the chord (default 0.5; 0.1 in a duct)"
    part.add_argument("--tip-round", type=float, metavar="S", help=tip)
    hands = "direction of rotation (default: that of the case)"
    part.add_argument("--hand", choices=("right", "left", "both"), help=hands)


def _request(args: argparse.Namespace) -> Print | None:
    """What is to be printed; None for a rotor as its sections say."""
    from bemt.base.errors import Fault, InputError
    from bemt.tools.exports.printing import Print, asked

    recess, hexagon = (None if pair is None else (pair[0], pair[1]) for pair in (args.recess_mm, args.hex_mm))
    request = Print(None, args.trailing_edge_mm, args.tip_round, None, args.hub_diameter_mm, args.hub_height_mm,
                    args.adapter, args.bore_mm, recess, hexagon, args.hand)  # fmt: skip
    if args.printable:
        return replace(request, min_thickness_mm=args.min_thickness_mm, flare_mm=args.fillet_mm)
    if asked(request):
        raise InputError([Fault("", name, "given", "nothing without --printable") for name in asked(request)])
    return None


def run(args: argparse.Namespace) -> int:
    """Write every valid target of every valid case; 2 if one was refused."""
    from bemt.base.tables import json_text
    from bemt.tools.exports import folder

    request = _request(args)
    given = {"rpm": args.rpm, "airspeed_m_s": args.airspeed, "sideslip_deg": args.sideslip_deg, "level": args.level,
             "domain": args.domain, "sector": args.sector, "turbulence": args.turbulence,
             "solver": args.solver}  # fmt: skip
    made, refused = folder.export_cases(
        args.case,
        args.out,
        args.format or ["stl"],
        args.unit,
        (args.fillet_mm or 0.0) if request is None else 0.0,
        (args.min_thickness_mm or 0.0) if request is None else 0.0,
        given,
        tuple(dict.fromkeys(args.hold or ())),
        request,
    )
    for error in refused:
        _terminal.complain(error)
    if args.json:
        print(json_text({"schema": "bemt.export/1", "cases": [manifest for manifest, _ in made]}), end="")
    else:
        for manifest, where in made:
            print(folder.text(manifest, where))
    return EXIT_INPUT if refused else EXIT_OK

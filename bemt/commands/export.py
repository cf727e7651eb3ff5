"""``python -m bemt export CASE --out DIR``: the solids of a case as STL, STEP, OBJ or an OpenFOAM case."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_INPUT, EXIT_OK
from bemt.commands import _options, _terminal

NAME = "export"
HELP = "write the solids of a case for CAD and CFD"
GROUP = "Solids and CFD"
EXAMPLE = "export cases/prop_8x5 --out solids --format stl step"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("case", metavar="CASE", help="case file, its folder, or a folder of cases")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the files and manifest.json")
    kinds = ("stl", "step", "obj", "openfoam")
    parser.add_argument("--format", choices=kinds, help="one or more (default stl)", **_options.MANY)
    parser.add_argument("--unit", choices=("mm", "m"), default="mm", help="of the files; openfoam is always in m")
    parser.add_argument("--fillet-mm", type=float, default=0.0, metavar="R", help="fillet of blade and hub (default 0)")
    thin = "refuse blades that are thinner somewhere (default 0: none)"
    parser.add_argument("--min-thickness-mm", type=float, default=0.0, metavar="T", help=thin)
    parser.add_argument("--rpm", type=float, metavar="N", help="openfoam: speed (default: the case's) [rev/min]")
    wind = "openfoam: axial speed (default: the case's) [m/s]"
    parser.add_argument("--airspeed", type=float, metavar="V", help=wind)
    parser.add_argument("--sideslip-deg", type=float, default=0.0, metavar="A", help="openfoam: shaft to wind, 0 to 90")
    grid = "openfoam: cells on the blade are R/2^(level+2), all others scale (default 6; 5 is quick)"
    parser.add_argument("--level", type=float, default=6.0, help=grid)
    domain = "openfoam: free field, or a cylinder of the propeller's diameter"
    parser.add_argument("--domain", choices=("free", "pipe"), default="free", help=domain)
    sector = "openfoam: periodic part (default: one blade from three up, else half; full in oblique flow)"
    parser.add_argument("--sector", choices=("half", "blade", "full"), help=sector)
    models = ("kOmegaSST", "realizableKE")
    parser.add_argument("--turbulence", choices=models, default=models[0], help=f"openfoam (default {models[0]})")
    law = parser.add_mutually_exclusive_group()
    fast = "openfoam: rhoSimpleFoam (default above a tip Mach number of 0.5)"
    law.add_argument("--compressible", dest="solver", action="store_const", const="compressible", help=fast)
    slow = "openfoam: simpleFoam"
    law.add_argument("--incompressible", dest="solver", action="store_const", const="incompressible", help=slow)
    _options.add_json(parser, "bemt.export/1")


def run(args: argparse.Namespace) -> int:
    """Write every case that can be; 2 when one was refused."""
    from bemt.base.tables import json_text
    from bemt.exports import solids
    from bemt.exports.openfoam.write import Run

    flow = Run(rpm=args.rpm, airspeed_m_s=args.airspeed, sideslip_deg=args.sideslip_deg, level=args.level,
               domain=args.domain, sector=args.sector, turbulence=args.turbulence, solver=args.solver)  # fmt: skip
    made, refused = solids.export_cases(
        args.case, args.out, args.format or ["stl"], args.unit, args.fillet_mm, args.min_thickness_mm, flow
    )
    for error in refused:
        _terminal.complain(error)
    if args.json:
        print(json_text({"schema": "bemt.export/1", "cases": [manifest for manifest, _ in made]}), end="")
    else:
        for manifest, folder in made:
            print(solids.text(manifest, folder))
    return EXIT_INPUT if refused else EXIT_OK

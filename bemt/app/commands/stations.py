"""``bemt stations FILE``: stations of a CAD model, a scan or a design tool's file, as a case to solve."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK

NAME = "stations"
HELP = "turn the blade of a CAD model, scan or design file into a case"
GROUP = "Solids and CFD"
EXAMPLE = "stations rotor.stl --unit mm --out cases/mine"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", metavar="FILE", help="STL, OBJ, STEP; XROTOR, QPROP, DFDC or an AeroDyn driver")
    parser.add_argument("--unit", choices=("mm", "m", "in"), help="unit of an STL or OBJ that does not state it")
    parser.add_argument("--out", metavar="DIR", help="write case.toml, stations.csv and section files to this folder")
    _options.add_json(parser, "bemt.stations/1")


def run(args: argparse.Namespace) -> int:
    """Cut, write, print."""
    from pathlib import Path

    from bemt.base.tables import json_text
    from bemt.rotors.case import from_blade_file, from_solid

    path = Path(args.file)
    blade = from_blade_file.read_blade(path, args.unit)
    if blade is not None:
        if args.out is not None:
            from_blade_file.write(blade, path, Path(args.out))
        document = from_blade_file.document(blade, path)
        print(json_text(document) if args.json else from_blade_file.text(blade, path, args.out), end="")
        return EXIT_OK
    found, scale, words = from_solid.find_stations(path, args.unit)
    if args.out is not None:
        from_solid.write(found, scale, path, Path(args.out))
    if args.json:
        print(json_text(from_solid.document(found, scale, path, words)), end="")
    else:
        print(from_solid.text(found, scale, path, words, args.out))
    return EXIT_OK

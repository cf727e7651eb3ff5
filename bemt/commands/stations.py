"""``python -m bemt stations FILE``: stations of somebody's CAD model or scan, as a case that can be solved."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_OK
from bemt.commands import _options

NAME = "stations"
HELP = "find and cut the blades of a CAD model or scan: a case to solve"
GROUP = "Solids and CFD"
EXAMPLE = "stations rotor.stl --unit mm --out cases/mine"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", metavar="FILE", help="STL, OBJ or STEP")
    parser.add_argument("--unit", choices=("mm", "m", "in"), help="of an STL or OBJ that does not state it")
    parser.add_argument("--out", metavar="DIR", help="write case.toml, stations.csv and section files there")
    _options.add_json(parser, "bemt.stations/1")


def run(args: argparse.Namespace) -> int:
    """Cut, write, print."""
    from pathlib import Path

    from bemt.base.tables import json_text
    from bemt.case import from_solid

    path = Path(args.file)
    found, scale, words = from_solid.read_stations(path, args.unit)
    if args.out is not None:
        from_solid.write(found, scale, path, Path(args.out))
    if args.json:
        print(json_text(from_solid.document(found, scale, path, words)), end="")
    else:
        print(from_solid.text(found, scale, path, words, args.out))
    return EXIT_OK

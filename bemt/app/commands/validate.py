"""``bemt validate DIR``: BEMT against a folder of measured propellers."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "validate"
HELP = "compare BEMT with a folder of measured propellers (UIUC layout)"
GROUP = "Models and checks"
EXAMPLE = "validate uiuc"


def reynolds(text: str) -> float:
    """Reynolds number of ``fixed:RE``."""
    kind, _, number = text.partition(":")
    try:
        value = float(number)
    except ValueError:
        value = -1.0
    if kind != "fixed" or not 1e3 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"got {text!r}; expected fixed:RE with RE from 1e3 to 1e9, as in fixed:100000")
    return value


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    found = "folder with geometry, static and J files, or uiuc for the installed data"
    parser.add_argument("folders", metavar="DIR", nargs="+", help=found)
    _options.add_json(parser, "bemt.validation/1")
    parser.add_argument("--polar", type=reynolds, metavar="fixed:RE", help="section tables at one Reynolds number")
    parser.add_argument("--off", metavar="EFFECT", help="switch an effect off; repeatable", **_options.REPEATABLE)
    turned = "also turn each blade to the measured zero-thrust J (an experiment that uses the measurement)"
    parser.add_argument("--match-J0", action="store_true", help=turned)
    drawn = "use the stations as given, without the population of rotors as built"
    parser.add_argument("--as-drawn", action="store_true", help=drawn)
    parser.add_argument("--out", metavar="DIR", help="also write the tables to this folder")


def run(args: argparse.Namespace) -> int:
    """Compare; 1 when points did not converge."""
    from bemt.base.tables import json_text
    from bemt.rotors.validate.propellers import effects_without, text, validate, where, write

    effects = effects_without(args.off)
    found = [where(name) for name in args.folders]
    with _terminal.progress() as say:
        document = validate(found, effects, args.polar, say, match_J0=args.match_J0, as_drawn=args.as_drawn)
    if args.out:
        write(document, args.out)
    # an infinite error (not converged) becomes null: JSON has no infinity
    print(json_text(document).rstrip() if args.json else text(document))
    return EXIT_UNCONVERGED if document["unconverged"] else EXIT_OK

"""``bemt calibrate-rotor REFERENCE --case CASE``: a case whose rotor is known from a run of its own."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "calibrate-rotor"
HELP = "learn a rotor's blade as built from a reference run of it"
GROUP = "Recordings"
EXAMPLE = "calibrate-rotor static.csv --case cases/prop_10x5 --out measured_10x5"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    run = "recordings of this rotor on a clean stand or in a tunnel, with nothing else changed"
    parser.add_argument("reference", nargs="+", metavar="REFERENCE", help=run)
    parser.add_argument("--case", required=True, metavar="CASE", help="case of the rotor")
    parser.add_argument("--out", metavar="DIR", help="write the case of the rotor as measured to this folder")
    _options.add_json(parser, "bemt.rotor_calibration/1")
    _options.add_quiet(parser, "neither progress nor answer")


def run(args: argparse.Namespace) -> int:
    """Condition, write, print; 1 if the fit did not converge."""
    from bemt.base.tables import json_text
    from bemt.judge.diagnose.rotor_calibration import calibrate, document, text, write

    with _terminal.progress(args.quiet or args.json) as say:
        case, found = calibrate(args.reference, args.case, say)
    written = write(case, found, args.reference, args.out) if args.out else []
    shown = document(case, found, args.reference)
    if args.json:
        print(json_text(shown), end="")
    elif not args.quiet:
        print(text(shown))
        if written:
            folder = shlex.quote(Path(args.out).as_posix())
            print(f"{Path(args.out).as_posix()}: {', '.join(written)}")
            print(f"next: bemt sweep {folder}")
            if case.file.drive is not None:
                print(f"      bemt drive {folder}")
        else:
            print("nothing written; --out DIR writes the case with this rotor")
    return EXIT_OK if found.found.converged else EXIT_UNCONVERGED

"""Command line: parses, calls one module, turns errors into exit codes.

Exit codes: 0 fine; 1 out of tolerance or unconverged; 2 usage or input; 3 internal; 130 interrupted.
The modules of the subcommands are imported only when they are chosen, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from bemt import __version__
from bemt.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK, InputError

__all__ = ["build_parser", "main"]

EXIT_INTERRUPTED = 130

_MODULES = {"sweep": "bemt.sweep", "validate": "bemt.validate", "reproduce": "bemt.reproduce", "bench": "bemt.bench",
            "import": "bemt.import_files", "export": "bemt.export_case",
            "stations": "bemt.stations"}  # fmt: skip


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {text}; expected a whole number of 1 or more")
    return value


def _polar(text: str) -> float:
    """Reynolds number of ``fixed:RE``."""
    kind, _, number = text.partition(":")
    try:
        value = float(number)
    except ValueError:
        value = -1.0
    if kind != "fixed" or not 1e3 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"got {text!r}; expected fixed:RE with RE from 1e3 to 1e9, as in fixed:100000")
    return value


def build_parser() -> argparse.ArgumentParser:
    """Make the parser of the whole command line.

    Returns
    -------
    argparse.ArgumentParser
        With one sub-parser per command.

    Examples
    --------
    >>> args = build_parser().parse_args(["sweep", "cases/", "--jobs", "2"])
    >>> args.command, args.paths, args.jobs
    ('sweep', ['cases/'], 2)
    """
    parser = argparse.ArgumentParser(
        prog="python -m bemt",
        description="Propeller and ducted-fan aerodynamics: BEMT beside the K1/K2 model, CFD and bench recordings.",
        epilog="Exit codes: 0 fine, 1 out of tolerance or unconverged, 2 usage or input, 3 internal.",
    )
    parser.add_argument("--version", action="version", version=f"bemt {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    sweep = commands.add_parser("sweep", help="solve cases and print them beside their recorded values")
    sweep.add_argument("paths", nargs="+", metavar="CASES", help="case files, or folders of <name>/case.toml")
    sweep.add_argument("--out", metavar="DIR", help="write tables, grids and sweep.json there, and resume from there")
    sweep.add_argument("--json", action="store_true", help="print one JSON document (bemt.sweep/1), no tables")
    jobs = "solve N cases at a time in processes (default: one case, its grid on all cores)"
    sweep.add_argument("--jobs", type=_positive, metavar="N", help=jobs)
    sweep.add_argument("--quiet", action="store_true", help="print neither progress nor tables")
    strict = "exit 1 when a point is unconverged or BEMT is off a reference by more than --tolerance"
    sweep.add_argument("--strict", action="store_true", help=strict)
    tolerance = "tolerance of --strict on thrust, %% of the reference (default 15)"
    sweep.add_argument("--tolerance", type=float, default=15.0, metavar="PCT", help=tolerance)
    sweep.add_argument("--no-resume", action="store_true", help="do not reuse results found in --out")

    validate = commands.add_parser("validate", help="compare with a folder of measured propellers (UIUC layout)")
    validate.add_argument("dir", metavar="DIR", help="folder with geometry, static and J files")
    validate.add_argument("--json", action="store_true", help="print one JSON document (bemt.validation/1)")
    validate.add_argument("--polar", type=_polar, metavar="fixed:RE", help="section tables at one Reynolds number")
    validate.add_argument(
        "--off", action="append", default=[], metavar="EFFECT", help="switch an effect off; repeatable"
    )
    validate.add_argument("--out", metavar="DIR", help="write the tables there as well")

    reproduce = commands.add_parser("reproduce", help="print every number of the source thesis beside ours")
    reproduce.add_argument("--json", action="store_true", help="print one JSON document")

    bench = commands.add_parser("bench", help="measure the time per operating point")
    bench.add_argument("--json", action="store_true", help="print one JSON document (bemt.bench/1)")
    bench.add_argument("--quick", action="store_true", help="fewer repetitions")
    bench.add_argument("--work", metavar="DIR", help="time the work in this folder instead of the shipped one")

    bring = commands.add_parser("import", help="read results of CFD, benches and vendors: means, drift, warnings")
    bring.add_argument("files", nargs="+", metavar="FILE", help="files, or folders that a reader takes whole")
    bring.add_argument("--json", action="store_true", help="print one JSON document (bemt.import/1)")
    bring.add_argument("--format", metavar="NAME", help="reader to use (default: found by content)")
    speed = bring.add_mutually_exclusive_group()
    speed.add_argument("--rpm", type=float, metavar="N", help="speed, for averages over whole revolutions [rev/min]")
    speed.add_argument("--period", type=float, metavar="S", help="duration of a revolution [s]")
    bring.add_argument("--revolutions", type=_positive, metavar="N", help="average the last N (default 4, or half)")
    bring.add_argument("--sign", type=int, choices=(1, -1), default=1, help="-1 turns the loads round (default 1)")
    sector = "the model is one of N equal sectors: loads times N (default 1)"
    bring.add_argument("--sector", type=_positive, default=1, metavar="N", help=sector)
    bring.add_argument("--zones", nargs="+", metavar="ZONE", help="add up the loads of these zones")
    loads = "channel that --sign and --sector apply to; repeatable (default: all in N or Nm)"
    bring.add_argument("--load", action="append", metavar="NAME", help=loads)

    solid = commands.add_parser("export", help="write the solids of a case for CAD and CFD")
    solid.add_argument("case", metavar="CASE", help="case file, its folder, or a folder of cases")
    solid.add_argument("--out", required=True, metavar="DIR", help="folder of the files and manifest.json")
    kinds = ("stl", "step", "obj", "openfoam")
    solid.add_argument("--format", nargs="+", choices=kinds, default=["stl"], help="one or more (default stl)")
    solid.add_argument("--unit", choices=("mm", "m"), default="mm", help="of the files; openfoam is always in m")
    solid.add_argument("--fillet-mm", type=float, default=0.0, metavar="R", help="fillet of blade and hub (default 0)")
    thin = "refuse blades that are thinner somewhere (default 0: none)"
    solid.add_argument("--min-thickness-mm", type=float, default=0.0, metavar="T", help=thin)
    solid.add_argument("--json", action="store_true", help="print one JSON document (bemt.export/1)")

    cut = commands.add_parser("stations", help="find and cut the blades of a CAD model or scan: a case to solve")
    cut.add_argument("file", metavar="FILE", help="STL, OBJ or STEP")
    cut.add_argument("--unit", choices=("mm", "m", "in"), help="of an STL or OBJ that does not state it")
    cut.add_argument("--out", metavar="DIR", help="write case.toml, stations.csv and section files there")
    cut.add_argument("--json", action="store_true", help="print one JSON document (bemt.stations/1)")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit code.
    """
    for stream in (sys.stdout, sys.stderr):  # a terminal that is not UTF-8 must not end a run
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    args = build_parser().parse_args(argv)
    try:
        code = importlib.import_module(_MODULES[args.command]).run(args)
        sys.stdout.flush()
        return EXIT_OK if code is None else int(code)
    except InputError as error:
        print(error, file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone, as in `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except Exception:
        import traceback

        traceback.print_exc()
        print(f"internal error of bemt {__version__}; please report it with the lines above", file=sys.stderr)
        return EXIT_INTERNAL

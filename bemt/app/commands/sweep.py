"""``bemt sweep``: solve cases and print them beside their recorded values."""

from __future__ import annotations

import argparse
import sys

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_UNCONVERGED

NAME = "sweep"
HELP = "solve cases and compare them with recorded values"
GROUP = "Propellers and fans"
EXAMPLE = "sweep cases/"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    _options.add_cases(parser)
    parser.add_argument(
        "--out", metavar="DIR", help="write tables, grids and sweep.json to this folder, and resume from it"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON document (bemt.sweep/1), no tables")
    jobs = "solve N cases in parallel (default: one case, its grid on all cores); with dask: N local workers"
    parser.add_argument("--jobs", type=_options.positive, metavar="N", help=jobs)
    parser.add_argument("--details", action="store_true", help="print every case in full instead of one screen")
    _options.add_quiet(parser)
    strict = "exit 1 if a point is unconverged or BEMT differs from a reference by more than --tolerance"
    parser.add_argument("--strict", action="store_true", help=strict)
    tolerance = "thrust tolerance of --strict, %% of the reference (default 15)"
    parser.add_argument("--tolerance", type=_options.not_negative, default=15.0, metavar="PCT", help=tolerance)
    parser.add_argument("--no-resume", action="store_true", help="do not reuse results found in --out")
    engine = "where to solve grids: this machine or a Dask cluster (default local); the results are identical"
    parser.add_argument("--engine", choices=("local", "dask"), default="local", help=engine)
    address = "with --engine dask: an existing cluster such as tcp://host:8786 (default: processes on this machine)"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=address)
    form = "csv with 7 digits (default), or parquet with full precision"
    parser.add_argument("--grid-format", choices=("csv", "parquet"), default="csv", help=form)


def run(args: argparse.Namespace) -> int:
    """Solve, print, and with ``--strict`` check BEMT against the recorded values."""
    from bemt.base.tables import json_text
    from bemt.results.sweep.batch import off_tolerance, sweep
    from bemt.results.sweep.summary import summary
    from bemt.results.sweep.text import case_text, overview_text
    from bemt.rotors.case import find_cases

    with _terminal.progress(args.quiet) as say:
        found = sweep(args.paths, args.out, jobs=args.jobs, resume=not args.no_resume, progress=say,
                         engine=args.engine, scheduler=args.scheduler, grid_format=args.grid_format)  # fmt: skip
    code = found.exit_code
    for result in found.cases:
        for fault in result.faults:
            _terminal.complain(fault)
    if args.json:
        sys.stdout.write(json_text(found.document()))
    elif not args.quiet and not args.details:
        files = find_cases(args.paths)
        print(summary(found.cases, files, cut=sys.stdout.isatty()))
    elif not args.quiet:
        solved = [case_text(result) for result in found.cases]
        print("\n\n".join([*solved, overview_text(found.cases)]))
    if args.strict:
        reasons = [line for r in found.cases if r.rows for line in off_tolerance(r, args.tolerance)]
        for line in reasons:
            _terminal.complain(line)
        code = max(code, EXIT_UNCONVERGED) if reasons else code
    return code

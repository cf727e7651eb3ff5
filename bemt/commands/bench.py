"""``python -m bemt bench``: time per operating point, ours and the peers'."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED
from bemt.commands import _options, _terminal

NAME = "bench"
HELP = "measure the time per operating point"
GROUP = "Models and checks"
EXAMPLE = "bench --quick"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    _options.add_json(parser, "bemt.bench/1")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--work", metavar="DIR", help="use the benchmark in this folder instead of the shipped one")
    log = "time import and diagnose on a generated log of N rows instead, with memory"
    parser.add_argument("--log", type=_options.positive, metavar="N", help=log)


def run(args: argparse.Namespace) -> int:
    """Print the times; 1 when a point of the work did not converge."""
    import json

    from bemt.compare.bench import large_log, timing, work

    if args.log is not None:
        log = large_log.document(args.log)
        print(json.dumps(log, indent=1, allow_nan=False) if args.json else large_log.table(log))
        return EXIT_OK
    found = timing.document(work.load(args.work), args.quick)
    print(json.dumps(found, indent=1, allow_nan=False) if args.json else timing.table(found))
    if found["converged"] < found["points"]:
        _terminal.complain(f"{found['points'] - found['converged']} points did not converge")
        return EXIT_UNCONVERGED
    return EXIT_OK

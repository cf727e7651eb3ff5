"""``bemt bench``: time per operating point, ours and the peers'."""

from __future__ import annotations

import argparse
from pathlib import Path

from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError
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
    waiting = "time what users wait for instead: answers with bands, a sweep, the first answer of a machine"
    parser.add_argument("--waiting", action="store_true", help=waiting)
    parser.add_argument("--tree", type=Path, metavar="DIR", help="with --waiting: another checkout, in the same run")


def run(args: argparse.Namespace) -> int:
    """Print the times; 1 when a point of the work did not converge."""
    import json

    from bemt.compare.bench import large_log, timing, waiting, work

    if args.tree is not None and not (args.waiting and (args.tree / "bemt" / "__init__.py").is_file()):
        expected = "a checkout that holds bemt/, with --waiting"
        raise InputError(Fault("", "--tree", str(args.tree), expected))
    if args.waiting:
        times = waiting.document(args.tree, args.quick)
        print(json.dumps(times, indent=1, allow_nan=False) if args.json else waiting.table(times))
        return EXIT_OK
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

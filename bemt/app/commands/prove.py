"""``bemt prove``: conceal causes, seal the key, let the diagnosis run on its own, open the key, score."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError

NAME = "prove"
HELP = "hide causes in recordings, diagnose them, score the answers"
GROUP = "Models and checks"
EXAMPLE = "prove --seed 1"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    size = "41 (small, default) or 605 generated items, 68 by CCBlade (extra wisdem), or published recordings"
    parser.add_argument("--size", choices=("small", "full", "ccblade", "real"), default="small", help=size)
    seed = "random seed (default: from the operating system)"
    parser.add_argument("--seed", type=_options.seed, metavar="N", help=seed)
    parser.add_argument("--out", metavar="DIR", help="keep items, key, answers and score in this folder")
    jobs = "parallel diagnoses (default: one per core)"
    parser.add_argument("--jobs", type=_options.positive, metavar="N", help=jobs)
    steps = "with --size real and --out: also take the steps that open answers recommend, if the data allow"
    parser.add_argument("--follow", action="store_true", help=steps)
    more = "then take the runs that open answers recommend, up to N each, on the hidden stand"
    parser.add_argument("--loop", type=_options.positive, metavar="N", help=more)
    parser.add_argument("--fixed", action="store_true", help="with --loop: a fixed programme of runs instead")
    kept = "folders of kept proofs made with the current interval factors: write new factors to --out instead"
    parser.add_argument("--calibrate-intervals", metavar="DIR", help=kept, **_options.MANY)
    _options.add_json(parser, "bemt.proof/1")
    _options.add_quiet(parser, "no tables")


def run(args: argparse.Namespace) -> int:
    """Hide, diagnose, score; 0 if every target is met, 1 if some are missed."""
    from bemt.base.tables import json_text
    from bemt.judge.proof import follow, loop, proof_text
    from bemt.judge.proof.prove import prove

    if args.follow and not (args.out and args.size == "real"):
        got = f"--size {args.size}" + ("" if args.out else " without --out")
        raise InputError(Fault("--follow", "", got, "--size real and --out DIR"))
    if args.loop and (not args.out or args.size == "real"):
        got = f"--size {args.size}" + ("" if args.out else " without --out")
        raise InputError(Fault("--loop", "", got, "generated items and --out DIR"))
    taken = ""
    with _terminal.progress() as say:
        if args.calibrate_intervals:
            return _intervals(args.calibrate_intervals, args.out)
        found = prove(args.out, args.size, args.seed, args.jobs, say, _terminal.complain)
        if args.follow:
            taken = follow.text(follow.follow(Path(args.out), args.jobs or os.cpu_count() or 1, say))
        if args.loop:
            taken = loop.text(loop.loop(Path(args.out), args.loop, args.jobs or os.cpu_count() or 1, args.fixed, say))
    if args.json:
        print(json_text(found.document()), end="")
    elif not args.quiet:
        print("\n\n".join([proof_text.text(found), *([taken] if taken else [])]))
    return EXIT_OK if all(row.met is not False for row in found.score) else EXIT_UNCONVERGED


def _intervals(folders: list[str], out: str | None) -> int:
    """Write the factors on the intervals."""
    from bemt.base.tables import json_text, write_atomic
    from bemt.judge.diagnose.interval_scales import FILE
    from bemt.judge.proof.intervals import calibrate, misses

    sets, found = zip(*(misses(Path(folder)) for folder in folders), strict=True)
    write_atomic(Path(out or ".") / FILE, json_text(calibrate([m for some in found for m in some], sets)))
    return EXIT_OK

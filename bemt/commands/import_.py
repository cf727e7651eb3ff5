"""``python -m bemt import``: what is in a file of results, with honest means, in one table or one JSON document."""

from __future__ import annotations

import argparse

from bemt.commands import _options

NAME = "import"
HELP = "read CFD, bench or vendor data: channels, means, drift, warnings"
GROUP = "Recordings"
EXAMPLE = "import log.csv"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="files, or folders that a reader takes as a whole")
    _options.add_json(parser, "bemt.import/1")
    parser.add_argument("--format", metavar="NAME", help="reader to use (default: detected from the content)")
    speed = parser.add_mutually_exclusive_group()
    speed.add_argument("--rpm", type=float, metavar="N", help="speed, for averages over whole revolutions [rev/min]")
    speed.add_argument("--period", type=float, metavar="S", help="duration of a revolution [s]")
    last = "average the last N revolutions (default 4, or half)"
    parser.add_argument("--revolutions", type=_options.positive, metavar="N", help=last)
    parser.add_argument(
        "--sign", type=int, choices=(1, -1), default=1, help="-1 reverses the sign of the loads (default 1)"
    )
    sector = "the model is one of N equal sectors: multiply loads by N (default 1)"
    parser.add_argument("--sector", type=_options.positive, default=1, metavar="N", help=sector)
    parser.add_argument("--zones", metavar="ZONE", help="sum the loads of these zones", **_options.MANY)
    loads = "channel that --sign and --sector apply to; repeatable (default: all in N or Nm)"
    parser.add_argument("--load", action="append", metavar="NAME", help=loads)


def run(args: argparse.Namespace) -> int:
    """Read and show every file; the worst result sets the exit code."""
    from bemt.base.tables import json_text
    from bemt.recordings import load
    from bemt.recordings.choice import asked

    choice = asked(args.rpm, args.period, args.revolutions, args.sign, args.sector, args.zones or (), args.load or ())
    load.check_format(args.format)
    found = load.document(args.files, args.format, choice)
    print(json_text(found) if args.json else load.text(found), end="")
    return load.exit_code(found)

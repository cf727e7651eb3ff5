"""``bemt plan``: which effects a test plan can see, before anyone measures."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK

NAME = "plan"
HELP = "say which effects a test plan can see, before you measure"
GROUP = "Recordings"
EXAMPLE = "plan --case cases/prop_8x5 --plan points.csv"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--case", required=True, metavar="CASE", help="case file or its folder")
    parser.add_argument("--plan", required=True, metavar="CSV", help="table of points: rpm, airspeed_m_s, time_s, ...")
    off = "leave this effect out of the baseline; repeatable"
    parser.add_argument("--off", metavar="EFFECT", help=off, **_options.REPEATABLE)
    parser.add_argument("--out", metavar="DIR", help="write plan.json to this folder")
    _options.add_json(parser, "bemt.plan/1")
    _options.add_quiet(parser)


def run(args: argparse.Namespace) -> int:
    """Predict, print, write."""
    from pathlib import Path

    from bemt.base.tables import json_text, write_atomic
    from bemt.judge.diagnose import plan
    from bemt.judge.diagnose.load import cases_of

    cases = cases_of([args.case], args.off, 1)
    with _terminal.progress(args.quiet or args.json) as say:
        answer = plan.plan(plan.points(args.plan, cases[0]), cases[0], say)
    rendered = json_text(plan.document(answer))
    if args.json:
        print(rendered, end="")
    elif not args.quiet:
        print(plan.text(answer))
    if args.out:
        write_atomic(Path(args.out) / "plan.json", rendered)
    return EXIT_OK

"""``bemt cfd CAMPAIGN.toml``: run a list of CFD cases, resume where it stopped, record what came out."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "cfd"
HELP = "run a campaign of OpenFOAM cases and record the results"
GROUP = "Solids and CFD"
EXAMPLE = "cfd campaign.toml --ranks 4"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    plans = "campaign.toml or its folder; for a folder of campaigns print a summary"
    parser.add_argument("campaign", metavar="CAMPAIGN", help=plans)
    only = "run only point N, even if it is recorded"
    parser.add_argument("--only", type=_options.positive, metavar="N", help=only)
    ranks = "processes per run (default 2)"
    parser.add_argument("--ranks", type=_options.positive, default=2, metavar="N", help=ranks)
    parser.add_argument("--work", metavar="DIR", help="folder for grids and runs (default: temporary)")
    parser.add_argument("--keep", action="store_true", help="keep the work folder")
    _options.add_json(parser, "bemt.cfd-run/1; for a folder of campaigns bemt.cfd-summary/1")
    _options.add_quiet(parser)


def run(args: argparse.Namespace) -> int:
    """Run what is not recorded yet, or summarise a folder of campaigns; 1 if a point did not converge."""
    from bemt.base.tables import json_text
    from bemt.tools.cfd import campaign as campaigns

    if campaigns.is_folder_of_campaigns(args.campaign):
        from bemt.tools.cfd.summary import summary, summary_text

        found = summary(args.campaign)
        print(json_text(found.document()) if args.json else summary_text(found), end="")
        return EXIT_OK
    record = campaigns.run(
        args.campaign, args.only, args.ranks, args.work, args.keep, None if args.quiet else _terminal.complain
    )
    if args.json:
        print(json_text(campaigns.document(record)), end="")
    elif not args.quiet:
        print(campaigns.text(record))
    return EXIT_OK if all(row.settled for row in record.rows) else EXIT_UNCONVERGED

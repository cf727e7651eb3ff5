"""``bemt data uiuc``: a public database of measured propellers into the user's cache."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK

NAME = "data"
HELP = "download a public database of measured propellers into the cache"
GROUP = "Recordings"
EXAMPLE = "data uiuc"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("kind", choices=("uiuc",), help="uiuc: UIUC Propeller Database")
    parser.add_argument("--from", dest="source", metavar="FILE.zip", help="use this archive instead of downloading it")
    parser.add_argument("--dir", metavar="DIR", help="folder for the data (default: the cache)")
    parser.add_argument("--url", metavar="URL", help="download from this mirror instead of the publisher")
    parser.add_argument("--refresh", action="store_true", help="download again even if the data are there")
    _options.add_json(parser, "bemt.data/1")


def run(args: argparse.Namespace) -> int:
    """Download what is not there yet."""
    from bemt.base.tables import json_text
    from bemt.data.recordings import database

    folder = database.folder_of(args.kind, args.dir)
    with _terminal.progress() as say:

        def bytes_had(have: int, total: int) -> None:
            say(f"{have / 1e6:.1f}{f' of {total / 1e6:.1f}' if total else ''} MB")

        found = database.get(args.kind, folder, args.source, args.url, args.refresh, bytes_had)
    print(json_text(found).rstrip() if args.json else database.text(found))
    return EXIT_OK

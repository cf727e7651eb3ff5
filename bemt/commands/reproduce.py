"""``bemt reproduce``: every number of the source thesis beside ours."""

from __future__ import annotations

import argparse

from bemt.base.errors import EXIT_OK
from bemt.commands import _options

NAME = "reproduce"
HELP = "compare every number of the source thesis with ours"
GROUP = "Models and checks"
EXAMPLE = "reproduce"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    _options.add_json(parser, "bemt.reproduce/1")


def run(args: argparse.Namespace) -> int:
    """Print the reproduction; a number that is not reproduced is a finding, not a failure."""
    import json

    from bemt.compare import reproduce

    folder = reproduce.find_uiuc()
    uiuc = reproduce.uiuc_statistics(folder) if folder else None
    if args.json:
        print(json.dumps(reproduce.document(uiuc), indent=1, allow_nan=False))
    else:
        print(reproduce.table(reproduce.items(uiuc)))
    return EXIT_OK

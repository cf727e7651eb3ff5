"""``python -m bemt report CASES --out DIR``: the validation report as one self-contained HTML file and a summary."""

from __future__ import annotations

import argparse

from bemt.commands import _options, _terminal

NAME = "report"
HELP = "write the validation report: one HTML file, and a summary"
GROUP = "Propellers and fans"
EXAMPLE = "report cases/ --out reports"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    _options.add_cases(parser)
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the report and of the sweep behind it")
    _options.add_quiet(parser, "neither progress nor file names")


def run(args: argparse.Namespace) -> int:
    """Write the report; the exit code is that of the sweep behind it."""
    from bemt.report import HTML_NAME, write

    with _terminal.progress(args.quiet) as say:
        book, files = write(args.paths, args.out, say)
    for page in book["cases"]:
        for fault in page["result"]["faults"]:
            _terminal.complain(fault)
    if not args.quiet:
        for file in files:
            size = f": {file.stat().st_size / 1e6:.2f} MB, {len(book['cases'])} cases" if file.name == HTML_NAME else ""
            print(f"{file}{size}")
    return int(book["exit_code"])

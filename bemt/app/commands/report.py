"""``bemt report CASES --out DIR``: the validation report as one self-contained HTML file and a summary."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options, _terminal

NAME = "report"
HELP = "write the validation report: one HTML file and a summary"
GROUP = "Propellers and fans"
EXAMPLE = "report cases/ --out reports"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    _options.add_cases(parser)
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the report and its sweep")
    own = "recordings of the one case: diagnosed, and shown on its page inside the prediction"
    parser.add_argument("--recording", default=[], metavar="FILE", help=own, **_options.MANY)
    parser.add_argument(
        "--title", metavar="TEXT", help="title (default: that of the case if there is one, else Validation report)"
    )
    parser.add_argument("--author", metavar="TEXT", help="author, shown under the title")
    parser.add_argument("--date", metavar="TEXT", help="date under the title (default: today)")
    parser.add_argument(
        "--commit", metavar="TEXT", help="revision under the title (default: last commit where the cases lie)"
    )
    _options.add_quiet(parser, "neither progress nor file names")


def _about(args: argparse.Namespace) -> dict[str, str]:
    """Title, author, date and, where the cases lie in a git checkout, its commit."""
    import datetime
    from pathlib import Path

    from bemt.base.checkout import commit as checked_out

    about = {"title": args.title or "", "author": args.author or ""}
    about["date"] = args.date if args.date is not None else datetime.date.today().isoformat()
    commit = args.commit if args.commit is not None else checked_out(Path(args.paths[0]))
    return about | ({"revision": f"commit {commit}"} if commit else {})


def run(args: argparse.Namespace) -> int:
    """Write the report; the exit code is that of the sweep behind it."""
    from bemt.results.report import HTML_NAME, write

    paths = [] if args.recording and args.paths == ["."] else args.paths
    paths, args.recording = _options.sorted_out(paths, args.recording) if args.recording else (paths, [])
    args.paths = paths or ["."]
    with _terminal.progress(args.quiet) as say:
        book, files = write(args.paths, args.out, say, _about(args), args.recording)
    for page in book.cases:
        for fault in page.result.faults:
            _terminal.complain(fault)
    if not args.quiet:
        count = len(book.cases)
        for file in files:
            size = f": {file.stat().st_size / 1e6:.2f} MB, {count} case{'s' * (count != 1)}"
            print(f"{file}{size if file.name == HTML_NAME else ''}")
    return book.exit_code

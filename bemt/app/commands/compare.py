"""``bemt compare A B``: what changed between two recordings; ``RUN --case C``: one run and BEMT."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK

if TYPE_CHECKING:
    from bemt.judge.diagnose.contrast import Contrast

NAME = "compare"
HELP = "say what changed between two recordings, or compare one CFD run with BEMT (RUN --case CASE)"
GROUP = "Recordings"
EXAMPLE = "compare monday.csv tuesday.csv --case cases/prop_8x5"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("a", metavar="A", help="first recording (before, or without the change)")
    second = "second recording (after, or with the change); without it A is one CFD run, compared with BEMT of --case"
    parser.add_argument("b", metavar="B", nargs="?", help=second)
    known = "case of the rotor: diagnose B with A as its reference (default: causes that scale like the ratios)"
    parser.add_argument("--case", metavar="CASE", help=known)
    parser.add_argument("--label", metavar="LABEL", help="label such as 10x5; gives the diameter for the advance ratio")
    rows = "rows of {} to use: column=text, column=number, column=low:high, rotor=left; repeatable"
    parser.add_argument("--rows-a", metavar="CONDITION", help=rows.format("A"), **_options.REPEATABLE)
    parser.add_argument("--rows-b", metavar="CONDITION", help=rows.format("B"), **_options.REPEATABLE)
    air = "air of {}, overrides the recording: 22C,1013hPa, or only 22C, or 1.19kg/m3; wind: 18m/s, 35kt"
    parser.add_argument("--air-a", metavar="AIR", help=air.format("A"))
    parser.add_argument("--air-b", metavar="AIR", help=air.format("B"))
    parser.add_argument("--out", metavar="DIR", help="write comparison.json, its text and a picture to this folder")
    parser.add_argument("--no-figures", action="store_true", help="with --out: no picture")
    parser.add_argument("--details", action="store_true", help="print ranking, sub-systems and all notes")
    _options.add_json(parser, "bemt.comparison/1")
    _options.add_quiet(parser, "neither progress nor answer")


def run(args: argparse.Namespace) -> int:
    """Compare, write, print."""
    from bemt.base.tables import json_text
    from bemt.judge.compare import two_grids, two_runs
    from bemt.judge.compare.contrast_text import text
    from bemt.judge.diagnose.contrast import compare

    if args.b is None:
        return _one_run(args)
    grids = two_grids.compare_grids(args.a, args.b, args.rows_a, args.rows_b)
    if grids is not None:
        return _show(args, grids, two_grids.text(grids), two_grids.text(grids))
    runs = two_runs.compare_runs(args.a, args.b, args.rows_a, args.rows_b)
    if runs is not None:
        return _show(args, runs, two_runs.text(runs), two_runs.text(runs))
    with _terminal.progress(args.quiet or args.json) as say:
        answer = compare(
            args.a, args.b, args.case, label=args.label, rows_a=args.rows_a, rows_b=args.rows_b, air_a=args.air_a,
            air_b=args.air_b, progress=say,
        )  # fmt: skip
    if args.out:
        _write(Path(args.out), answer, figures=not args.no_figures)
    if args.case and not (args.rows_a or args.rows_b or args.air_a or args.air_b):
        _draw_first(args, [args.a, args.b])
    if args.json:
        print(json_text(answer.document), end="")
    elif not args.quiet:
        print(text(answer.document, details=args.details))
    return EXIT_OK


def _one_run(args: argparse.Namespace) -> int:
    """One CFD run beside the model of a case."""
    from bemt.base.errors import Fault, InputError
    from bemt.judge.compare import one_run

    if not args.case:
        hint = "Two recordings, A B, need none"
        raise InputError(Fault("--case", "", "one recording and no case", "the case to compare it with", hint))
    with _terminal.progress(args.quiet or args.json) as say:
        document = one_run.compare_run(args.a, args.case, say)
    _draw_first(args, [args.a])
    return _show(args, document, one_run.text(document, details=args.details), one_run.text(document, details=True))


def _draw_first(args: argparse.Namespace, files: list[str]) -> None:
    """With ``--out``, draw the recordings inside the prediction band of the case."""
    if not args.out or args.no_figures:
        return
    from bemt.base.page import FIRST
    from bemt.base.tables import write_atomic
    from bemt.judge.diagnose.figures_recording import first_picture
    from bemt.judge.diagnose.load import load_all

    cases, records = load_all(files, [args.case])
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / f"{FIRST}.png", first_picture(records, cases)[0].png())


def _show(args: argparse.Namespace, document: dict[str, Any], screen: str, whole: str) -> int:
    """Write and print an answer without a picture of its own."""
    from bemt.base.tables import json_text, write_atomic

    if args.out:
        out = Path(args.out)
        out.mkdir(parents=True, exist_ok=True)
        write_atomic(out / "comparison.json", json_text(document))
        write_atomic(out / "comparison.txt", whole + "\n")
    if args.json:
        print(json_text(document), end="")
    elif not args.quiet:
        print(screen)
    return EXIT_OK


def _write(out: Path, answer: Contrast, figures: bool) -> None:
    """Write comparison.json, its text and a picture."""
    from bemt.base.tables import json_text, write_atomic
    from bemt.judge.compare.contrast_text import text

    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / "comparison.json", json_text(answer.document))
    write_atomic(out / "comparison.txt", text(answer.document, details=True) + "\n")
    if figures:
        from bemt.judge.compare.contrast_figure import picture

        write_atomic(out / "comparison.png", picture(answer.change, answer.document))

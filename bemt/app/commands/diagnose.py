"""``bemt diagnose``: recording and case in, the physics that was left out."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bemt.app.commands import _options, _terminal
from bemt.base.errors import EXIT_OK

if TYPE_CHECKING:
    from bemt.judge.diagnose.suggest import Given

NAME = "diagnose"
HELP = "say which physics or stand fault explains why a recording differs from the model"
GROUP = "Recordings"
_CHANNELS = {"thrust": "thrust_N", "torque": "torque_Nm", "speed": "rpm"}
EXAMPLE = "diagnose log.csv --case cases/prop_8x5"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("recordings", nargs="*", metavar="RECORDING", help="tables or logs, analysed together")
    case = "case of all recordings, or one per recording"
    parser.add_argument("--case", required=True, metavar="CASE", help=case, **_options.MANY)
    off = "leave this effect out of the baseline; repeatable"
    parser.add_argument("--off", metavar="EFFECT", help=off, **_options.REPEATABLE)
    known = "recordings without the cause; show how far model and stand differ anyway"
    parser.add_argument("--reference", default=[], metavar="RECORDING", help=known, **_options.MANY)
    theirs = "case of the references where it differs: without an effect that was put into the case (default: CASE)"
    parser.add_argument("--reference-case", metavar="CASE", help=theirs)
    model = "model to compare with the recordings (default bemt; k1k2: thrust only)"
    parser.add_argument("--baseline", choices=("bemt", "k1k2"), default="bemt", help=model)
    only = "consider only these effects (default: all)"
    parser.add_argument("--only", metavar="EFFECT", help=only, **_options.MANY)
    gone = "effects that a check has ruled out"
    parser.add_argument("--ruled-out", default=[], metavar="EFFECT", help=gone, **_options.MANY)
    blade = "blade loads (radial.csv of a campaign), compared with the first case"
    parser.add_argument("--along", metavar="FILE", help=blade)
    seen = "use only these channels (default: all that were measured)"
    parser.add_argument("--channels", choices=tuple(_CHANNELS), help=seen, **_options.MANY)
    speed = "speed for files without one: one for all, or one per file [rev/min]"
    parser.add_argument("--rpm", type=float, default=[], metavar="N", help=speed, **_options.MANY)
    wind = "airspeed for files without one: one for all, or one per file [m/s] (default: from the case)"
    parser.add_argument("--airspeed", type=float, default=[], metavar="V", help=wind, **_options.MANY)
    runs = "what runs of this stand differ by, standard deviation in percent (default: 0.2 to 2, from the readings)"
    parser.add_argument("--repeatability", type=_percent, metavar="PERCENT", help=runs)
    parser.add_argument(
        "--out", metavar="DIR", help="write diagnosis.json, figures and the improved cases to this folder"
    )
    parser.add_argument("--no-figures", action="store_true", help="with --out: no figures")
    _options.add_json(parser, "bemt.diagnosis/1")
    _options.add_quiet(parser, "neither progress nor answer")


def _percent(text: str) -> float:
    """Share of a percentage above 0 and up to 20."""
    value = float(text)
    if not 0.0 < value <= 20.0:
        raise argparse.ArgumentTypeError(f"got {text}; expected a percentage above 0 and up to 20")
    return value / 100.0


def run(args: argparse.Namespace) -> int:
    """Diagnose, write, print."""
    from bemt.base.errors import InputError
    from bemt.base.tables import json_text
    from bemt.judge.diagnose import folder
    from bemt.judge.diagnose.along_blade import along
    from bemt.judge.diagnose.chain import diagnose
    from bemt.judge.diagnose.document import document, text
    from bemt.judge.diagnose.load import cases_of, load_all

    args.case, args.recordings = _options.sorted_out(args.case, args.recordings)
    _both_there(args)
    known = cases_of([args.reference_case], args.off, 1)[0] if args.reference_case else None
    cases, recordings = load_all(args.recordings, args.case, args.reference, args.off, args.only or (),
                                 before=lambda found: folder.check(args.out, found), rpm=args.rpm,
                                 airspeed_m_s=args.airspeed, ruled_out=args.ruled_out,
                                 reference_case=known)  # fmt: skip
    chosen = cases * len(args.recordings) if len(cases) == 1 else cases
    each = cases if known is None else [*chosen, *[known] * len(args.reference)]
    if args.repeatability is not None:
        recordings = [replace(r, repeatability=args.repeatability) for r in recordings]
    with _terminal.progress(args.quiet or args.json) as say:
        channels = [_CHANNELS[c] for c in args.channels or ()] or None
        try:
            answer = diagnose(
                recordings, each, args.only or None, say, baseline=args.baseline, given=_given(args), channels=channels
            )
        except InputError as error:
            if len(args.recordings) > 1 or any(f.where != "readings" for f in error.faults):
                raise
            return _too_few(args, str(error.faults[0].got), say)
    blade = along(cases[0], Path(args.along)) if args.along else {}
    found = document(answer) | {"recordings": list(args.recordings), "cases": [c.name for c in cases]}
    if blade:
        found["along_blade"] = {run: c.document() for run, c in blade.items()}
    if args.out:
        folder.write(args.out, answer, found, cases, figures=not args.no_figures)
    if args.json:
        print(json_text(found), end="")
    elif not args.quiet:
        print("\n\n".join([text(answer), *(c.text() for c in blade.values())]))
    return EXIT_OK


def _both_there(args: argparse.Namespace) -> None:
    """Refuse a command without a recording or without a case."""
    from bemt.base.errors import Fault, InputError

    faults = [] if args.recordings else [Fault("RECORDING", "", "none", "one or more tables or logs")]
    if args.reference_case and not args.reference:
        faults.append(Fault("--reference-case", "", "no reference", "--reference RECORDING beside it"))
    faults += [] if args.case else [Fault("--case", "", "no case", "the case of the rotor, as in cases/prop_8x5")]
    if faults:
        raise InputError(faults)


def _too_few(args: argparse.Namespace, got: str, say: Callable[[str], None] | None) -> int:
    """One point cannot be diagnosed: it is shown with the model, and what would decide."""
    from bemt.base.tables import json_text
    from bemt.judge.compare import one_run

    document = one_run.compare_run(args.recordings[0], args.case[0], say) | {"verdict": "insufficient", "effects": []}
    if args.json:
        print(json_text(document), end="")
    elif not args.quiet:
        print(f"Too few readings for a diagnosis ({got}).\n{one_run.text(document)}")
    return EXIT_OK


def _given(args: argparse.Namespace) -> Given:
    """What was asked, for the command of the next step."""
    from bemt.judge.diagnose.suggest import Given

    words = ["--case", *args.case]
    for option, values in (("--off", args.off), ("--only", args.only or ())):
        words += [w for v in values for w in (option, v)] if option == "--off" else [option, *values] if values else []
    if args.reference_case:
        words += ["--reference-case", args.reference_case]
    if args.repeatability is not None:
        words += ["--repeatability", f"{100.0 * args.repeatability:g}"]
    if args.baseline != "bemt":
        words += ["--baseline", args.baseline]
    return Given(
        tuple(map(shlex.quote, args.recordings)),
        tuple(map(shlex.quote, args.reference)),
        shlex.join(words),
        tuple(args.ruled_out),
    )

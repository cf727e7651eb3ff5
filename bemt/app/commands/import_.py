"""``bemt import``: what is in a file of results, with honest means, in one table or one JSON document."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bemt.app.commands import _options

if TYPE_CHECKING:
    from bemt.judge.compare.first_picture import PredictionView

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
    beside = parser.add_argument_group("beside a case")
    beside.add_argument("--case", metavar="CASE", help="say how the recordings lie in the prediction band of this case")
    beside.add_argument("--picture", metavar="FILE.png", help="with --case: draw the recordings inside the band")
    what = "with --out it is kept in a run.toml, or in a recording.toml for a table of measurements"
    run = parser.add_argument_group("what the files do not say", what)
    run.add_argument("--unit", metavar="NAME=UNIT", help="unit of a quantity or column: thrust=N; repeat it for each",
                     **_options.REPEATABLE)  # fmt: skip
    column = "column of a quantity: thrust=fz; repeat it for each"
    run.add_argument("--column", metavar="NAME=COLUMN", help=column, **_options.REPEATABLE)
    run.add_argument("--sign", metavar="NAME=-1", help="sign of a load: torque=-1; -1 alone: all (default: positive)",
                     **_options.REPEATABLE)  # fmt: skip
    sector = "the model is one of N equal sectors: multiply loads by N"
    run.add_argument("--sector", type=_options.positive, metavar="N", help=sector)
    run.add_argument(
        "--zones", default=[], metavar="ZONE", help="zones whose loads count: blade,hub,duct", **_options.MANY
    )
    run.add_argument("--axis", choices=("x", "y", "z"), help="axis of the shaft (default: the largest force)")
    run.add_argument("--airspeed", type=float, metavar="V", help="speed of flight [m/s]")
    run.add_argument("--density", type=float, metavar="RHO", help="density of the fluid [kg/m3]")
    reference = "what coefficients rest on: area=A,length=L,speed=V,density=RHO [m2, m, m/s, kg/m3]"
    run.add_argument("--reference", default=[], metavar="NAME=X", help=reference, **_options.MANY)
    setup = (
        "how it was computed: cells=2.1e6 grid_level=fine turbulence='k-omega SST' solver=pressure steady=no gci_pct=2"
    )
    run.add_argument("--setup", default=[], metavar="NAME=X", help=setup, **_options.MANY)
    out = "write it here; every command takes it in place of the files"
    run.add_argument("--out", dest="run_toml", metavar="RUN.TOML", help=out)


def run(args: argparse.Namespace) -> int:
    """Read and show every file, and the CFD run that they make; the worst result sets the exit code."""
    from bemt.base.errors import Fault, InputError
    from bemt.base.tables import json_text
    from bemt.data.recordings import cfd_options, load
    from bemt.data.recordings.choice import asked

    if args.picture and not args.case:
        raise InputError(Fault("--picture", "", "no case", "--case CASE, whose band is drawn"))
    choice = asked(args.rpm, args.period, args.revolutions)
    load.check_format(args.format)
    names = ("unit", "column", "sign", "sector", "zones", "axis", "airspeed", "density", "reference", "setup")
    insist = any(getattr(args, name) for name in (*names, "run_toml"))
    if insist and (table := _table(args)):
        from bemt.data.recordings.stated import write_recording

        if not args.run_toml:
            hint = f"Add --out {Path(table).with_name('recording.toml').as_posix()}"
            raise InputError(Fault("", "--out", "nothing", "a recording.toml that keeps what you state", hint))
        wrote = write_recording(table, args.run_toml, args.unit, args.column, args.sign).as_posix()
        print(f"{wrote} written\n\n", end="")
        args.files, args.unit, args.column, args.sign, args.run_toml, insist = [wrote], [], [], [], None, False
    made = cfd_options.run_from(
        args.files, rpm=None if choice.period is None else 60.0 / choice.period, revolutions=args.revolutions,
        airspeed_m_s=args.airspeed, density_kg_m3=args.density, sector=args.sector, axis=args.axis, zones=args.zones,
        unit=args.unit, column=args.column, sign=args.sign, reference=args.reference, setup=args.setup,
    )  # fmt: skip
    found = load.document(args.files, args.format, choice, made, insist)
    wrote = ""
    if args.run_toml and found["runs"]:
        made = made.model_copy(update={"run": made.run.model_copy(update={"files": tuple(found["runs"][-1]["files"])})})
        wrote = cfd_options.write_run(made, args.run_toml).as_posix()
    view = _beside(args, wrote)
    if view is not None:
        found["prediction"] = view.document()
    first = f"{view.sentence}\n\n" if view is not None else ""
    print(json_text(found) if args.json else first + load.text(found, wrote), end="")
    return load.exit_code(found)


def _table(args: argparse.Namespace) -> str | None:
    """The one table of measurements whose columns the options are about; None where they are about a CFD run."""
    from bemt.base.errors import InputError
    from bemt.data import readers
    from bemt.data.readers.cfd_run import KIND as RUN
    from bemt.data.recordings.cfd_files import PROGRAMS

    others = ("sector", "zones", "axis", "airspeed", "density", "reference", "setup")
    if len(args.files) != 1 or any(getattr(args, name) for name in others) or Path(args.files[0]).is_dir():
        return None
    try:
        kind = readers.detect(args.files[0])
    except InputError:
        return None
    return None if kind in PROGRAMS or kind == RUN else str(args.files[0])


def _beside(args: argparse.Namespace, run_toml: str) -> PredictionView | None:
    """Files inside the prediction band of the case, drawn where that is asked."""
    if not args.case:
        return None
    from bemt.base.tables import write_atomic
    from bemt.judge.diagnose.figures_recording import first_picture
    from bemt.judge.diagnose.load import load_all

    speed = [args.rpm] if args.rpm is not None and not run_toml else []
    wind = [args.airspeed] if args.airspeed is not None and not run_toml else []
    files = [run_toml] if run_toml else args.files
    cases, records = load_all(files, [args.case], rpm=speed, airspeed_m_s=wind)
    (view,) = first_picture(records, cases)
    if args.picture:
        write_atomic(Path(args.picture), view.png())
    return view

"""Command line: parses, calls one module, turns errors into exit codes.

Exit codes: 0 fine; 1 out of tolerance or unconverged; 2 usage or input; 3 internal; 130 interrupted.
The modules of the subcommands are imported only when they are chosen, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from bemt import __version__
from bemt.base.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK, Fault, InputError, system_fault

__all__ = ["build_parser", "main"]

EXIT_INTERRUPTED = 130
# Options of several words: `--case A B` and `--case A --case B` are the same, none is dropped without a word.
MANY: dict[str, Any] = {"action": "extend", "nargs": "+"}

_MODULES = {"sweep": "bemt.compare.sweep.command", "report": "bemt.report",
            "validate": "bemt.compare.validate.command", "reproduce": "bemt.compare.reproduce",
            "bench": "bemt.compare.bench.timing",
            "import": "bemt.recordings.load", "export": "bemt.exports.command", "cfd": "bemt.cfd.command",
            "calibrate": "bemt.commands.calibrate", "estimate": "bemt.commands.estimate",
            "data": "bemt.commands.data", "prove": "bemt.proof.prove",
            "effects": "bemt.commands.effects", "diagnose": "bemt.diagnose.command", "plan": "bemt.diagnose.command",
            "stations": "bemt.commands.stations", "map": "bemt.drive.map_command", "motor": "bemt.drive.motor_command",
            "drive": "bemt.drive.drive_command", "thrusters": "bemt.drive.thrusters_command"}  # fmt: skip


class _Once(argparse.Action):
    """Option with one value: given again it is refused, for the last one would win without a word."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        given = namespace.__dict__.setdefault("_given", set())
        if self.dest in given and self.option_strings:
            parser.error(f"argument {option}: got it twice; expected it once")
        given.add(self.dest)
        setattr(namespace, self.dest, values)


class _Parser(argparse.ArgumentParser):
    """Parser that takes options by their whole name, each once."""

    def __init__(self, **more: Any) -> None:
        super().__init__(**{**more, "allow_abbrev": False})
        self.register("action", None, _Once)
        self.register("action", "store", _Once)


def _tolerance(text: str) -> float:
    with suppress(ValueError):
        if 0.0 <= float(text) < float("inf"):
            return float(text)
    raise argparse.ArgumentTypeError(f"got {text}; expected a finite number of 0 or more")


def _seed(text: str) -> int:
    with suppress(ValueError):
        if int(text) >= 0:
            return int(text)
    raise argparse.ArgumentTypeError(f"got {text}; expected a whole number of 0 or more")


def _positive(text: str) -> int:
    with suppress(ValueError):
        if int(text) >= 1:
            return int(text)
    raise argparse.ArgumentTypeError(f"got {text}; expected a whole number of 1 or more")


def _polar(text: str) -> float:
    """Reynolds number of ``fixed:RE``."""
    kind, _, number = text.partition(":")
    try:
        value = float(number)
    except ValueError:
        value = -1.0
    if kind != "fixed" or not 1e3 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"got {text!r}; expected fixed:RE with RE from 1e3 to 1e9, as in fixed:100000")
    return value


def build_parser() -> argparse.ArgumentParser:
    """Make the parser of the whole command line.

    Returns
    -------
    argparse.ArgumentParser
        With one sub-parser per command.

    Examples
    --------
    >>> args = build_parser().parse_args(["sweep", "cases/", "--jobs", "2"])
    >>> args.command, args.paths, args.jobs
    ('sweep', ['cases/'], 2)
    """
    parser = _Parser(
        prog="python -m bemt",
        description="Propeller and ducted-fan aerodynamics: BEMT beside the K1/K2 model, CFD and bench recordings.",
        epilog="Exit codes: 0 fine, 1 out of tolerance or unconverged, 2 usage or input, 3 internal.",
    )
    parser.add_argument("--version", action="version", version=f"bemt {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    sweep = commands.add_parser("sweep", help="solve cases and print them beside their recorded values")
    sweep.add_argument("paths", nargs="+", metavar="CASES", help="case files, or folders of <name>/case.toml")
    sweep.add_argument("--out", metavar="DIR", help="write tables, grids and sweep.json there, and resume from there")
    sweep.add_argument("--json", action="store_true", help="print one JSON document (bemt.sweep/1), no tables")
    jobs = "solve N cases at a time in processes (default: one case, its grid on all cores); dask: N local workers"
    sweep.add_argument("--jobs", type=_positive, metavar="N", help=jobs)
    sweep.add_argument("--quiet", action="store_true", help="print neither progress nor tables")
    strict = "exit 1 when a point is unconverged or BEMT is off a reference by more than --tolerance"
    sweep.add_argument("--strict", action="store_true", help=strict)
    tolerance = "tolerance of --strict on thrust, %% of the reference (default 15)"
    sweep.add_argument("--tolerance", type=_tolerance, default=15.0, metavar="PCT", help=tolerance)
    sweep.add_argument("--no-resume", action="store_true", help="do not reuse results found in --out")
    engine = "where grids are solved: this machine, or a Dask cluster (default local); the answer is the same"
    sweep.add_argument("--engine", choices=("local", "dask"), default="local", help=engine)
    address = "with --engine dask: an existing cluster, as in tcp://host:8786 (default: processes of this machine)"
    sweep.add_argument("--scheduler", metavar="ADDRESS", help=address)
    form = "csv with 7 digits (default), or parquet with all"
    sweep.add_argument("--grid-format", choices=("csv", "parquet"), default="csv", help=form)

    report = commands.add_parser("report", help="write the validation report: one HTML file, and a summary")
    report.add_argument("paths", nargs="+", metavar="CASES", help="case files, or folders of <name>/case.toml")
    report.add_argument("--out", required=True, metavar="DIR", help="folder of the report and of the sweep behind it")
    report.add_argument("--quiet", action="store_true", help="print neither progress nor file names")

    validate = commands.add_parser("validate", help="compare with a folder of measured propellers (UIUC layout)")
    found = "folder with geometry, static and J files, or uiuc for the data found"
    validate.add_argument("dir", metavar="DIR", help=found)
    validate.add_argument("--json", action="store_true", help="print one JSON document (bemt.validation/1)")
    validate.add_argument("--polar", type=_polar, metavar="fixed:RE", help="section tables at one Reynolds number")
    validate.add_argument(
        "--off", action="append", default=[], metavar="EFFECT", help="switch an effect off; repeatable"
    )
    turned = "also with each blade turned to the measured zero-thrust J: an experiment that uses the measurement"
    validate.add_argument("--match-J0", action="store_true", help=turned)
    validate.add_argument("--out", metavar="DIR", help="write the tables there as well")

    reproduce = commands.add_parser("reproduce", help="print every number of the source thesis beside ours")
    reproduce.add_argument("--json", action="store_true", help="print one JSON document (bemt.reproduce/1)")

    bench = commands.add_parser("bench", help="measure the time per operating point")
    bench.add_argument("--json", action="store_true", help="print one JSON document (bemt.bench/1)")
    bench.add_argument("--quick", action="store_true", help="fewer repetitions")
    bench.add_argument("--work", metavar="DIR", help="time the work in this folder instead of the shipped one")

    bring = commands.add_parser("import", help="read results of CFD, benches and vendors: means, drift, warnings")
    bring.add_argument("files", nargs="+", metavar="FILE", help="files, or folders that a reader takes whole")
    bring.add_argument("--json", action="store_true", help="print one JSON document (bemt.import/1)")
    bring.add_argument("--format", metavar="NAME", help="reader to use (default: found by content)")
    speed = bring.add_mutually_exclusive_group()
    speed.add_argument("--rpm", type=float, metavar="N", help="speed, for averages over whole revolutions [rev/min]")
    speed.add_argument("--period", type=float, metavar="S", help="duration of a revolution [s]")
    bring.add_argument("--revolutions", type=_positive, metavar="N", help="average the last N (default 4, or half)")
    bring.add_argument("--sign", type=int, choices=(1, -1), default=1, help="-1 turns the loads round (default 1)")
    sector = "the model is one of N equal sectors: loads times N (default 1)"
    bring.add_argument("--sector", type=_positive, default=1, metavar="N", help=sector)
    bring.add_argument("--zones", metavar="ZONE", help="add up the loads of these zones", **MANY)
    loads = "channel that --sign and --sector apply to; repeatable (default: all in N or Nm)"
    bring.add_argument("--load", action="append", metavar="NAME", help=loads)

    refit = commands.add_parser("calibrate", help="refit K1 and K2 on measured propellers, beside the compact formula")
    which = "files or folders with diameter, pitch, rpm and thrust or CT (default: uiuc, the data found)"
    refit.add_argument("files", nargs="*", metavar="FILES", help=which)
    refit.add_argument("--test", metavar="FILES", help="held out: scored, never fitted", **MANY)
    refit.add_argument("--out", metavar="DIR", help="write the tables, JSON and a figure there")
    refit.add_argument("--json", action="store_true", help="print one JSON document (bemt.calibration/1)")
    refit.add_argument("--quiet", action="store_true", help="print neither progress nor tables")

    guess = commands.add_parser("estimate", help="thrust and power from a label such as 10x5, with bands, beside K1/K2")
    guess.add_argument("label", metavar="LABEL", help="diameter x pitch in inches, blades if not 2: 10x4.7, 8x5x3")
    guess.add_argument("--rpm", type=float, required=True, metavar="N", help="one or more [rev/min]", **MANY)
    guess.add_argument("--airspeed", type=float, metavar="V", help="one or more (default 0) [m/s]", **MANY)
    guess.add_argument("--blades", type=_positive, metavar="B", help="number (default: of the label, else 2)")
    guess.add_argument("--chord-mm", type=float, metavar="C", help="at 0.75 R: by far the best fourth number")
    twist = "2 pi r tan(blade angle) at r = 0.75 R: the fifth"
    guess.add_argument("--measured-pitch-in", type=float, metavar="P", help=twist)
    guess.add_argument("--series", metavar="NAME", help='maker and series, as "APC Thin Electric" or apce')
    guess.add_argument("--density", type=float, default=1.225, metavar="RHO", help="of the air [kg/m3]")
    guess.add_argument("--ducted", action="store_true", help="flagged only: neither formula knows a duct")
    guess.add_argument("--json", action="store_true", help="print one JSON document (bemt.estimate/1)")

    fetch = commands.add_parser("data", help="fetch a public database of measured propellers into the cache")
    fetch.add_argument("kind", choices=("uiuc",), help="uiuc: UIUC Propeller Database")
    fetch.add_argument("--from", dest="source", metavar="FILE.zip", help="take this archive instead of fetching it")
    fetch.add_argument("--dir", metavar="DIR", help="folder for the data (default: the cache)")
    fetch.add_argument("--url", metavar="URL", help="fetch from this mirror instead of the publisher")
    fetch.add_argument("--refresh", action="store_true", help="fetch again what is there already")
    fetch.add_argument("--json", action="store_true", help="print one JSON document (bemt.data/1)")

    solid = commands.add_parser("export", help="write the solids of a case for CAD and CFD")
    solid.add_argument("case", metavar="CASE", help="case file, its folder, or a folder of cases")
    solid.add_argument("--out", required=True, metavar="DIR", help="folder of the files and manifest.json")
    kinds = ("stl", "step", "obj", "openfoam")
    solid.add_argument("--format", choices=kinds, help="one or more (default stl)", **MANY)
    solid.add_argument("--unit", choices=("mm", "m"), default="mm", help="of the files; openfoam is always in m")
    solid.add_argument("--fillet-mm", type=float, default=0.0, metavar="R", help="fillet of blade and hub (default 0)")
    thin = "refuse blades that are thinner somewhere (default 0: none)"
    solid.add_argument("--min-thickness-mm", type=float, default=0.0, metavar="T", help=thin)
    solid.add_argument("--rpm", type=float, metavar="N", help="openfoam: speed (default: the case's) [rev/min]")
    solid.add_argument("--airspeed", type=float, metavar="V", help="openfoam: axial speed (default: the case's) [m/s]")
    solid.add_argument("--sideslip-deg", type=float, default=0.0, metavar="A", help="openfoam: shaft to wind, 0 to 90")
    grid = "openfoam: cells on the blade are R/2^(level+2), all others scale (default 6; 5 is quick)"
    solid.add_argument("--level", type=float, default=6.0, help=grid)
    domain = "openfoam: free field, or a cylinder of the propeller's diameter"
    solid.add_argument("--domain", choices=("free", "pipe"), default="free", help=domain)
    sector = "openfoam: periodic part (default: one blade from three up, else half; full in oblique flow)"
    solid.add_argument("--sector", choices=("half", "blade", "full"), help=sector)
    models = ("kOmegaSST", "realizableKE")
    solid.add_argument("--turbulence", choices=models, default=models[0], help=f"openfoam (default {models[0]})")
    law = solid.add_mutually_exclusive_group()
    law.add_argument("--compressible", dest="solver", action="store_const", const="compressible",
                     help="openfoam: rhoSimpleFoam (default above a tip Mach number of 0.5)")  # fmt: skip
    law.add_argument("--incompressible", dest="solver", action="store_const", const="incompressible",
                     help="openfoam: simpleFoam")  # fmt: skip
    solid.add_argument("--json", action="store_true", help="print one JSON document (bemt.export/1)")

    flow = commands.add_parser("cfd", help="run a campaign of OpenFOAM cases and record what comes out")
    plans = "campaign.toml or its folder; a folder of campaigns is summed up"
    flow.add_argument("campaign", metavar="CAMPAIGN", help=plans)
    flow.add_argument("--only", type=_positive, metavar="N", help="run point N alone, even if it is recorded")
    flow.add_argument("--ranks", type=_positive, default=2, metavar="N", help="processes of a run (default 2)")
    flow.add_argument("--work", metavar="DIR", help="folder of grids and runs (default: a temporary one)")
    flow.add_argument("--keep", action="store_true", help="keep the work folder")
    one = "print one JSON document (bemt.cfd-run/1; of a folder of campaigns bemt.cfd-summary/1)"
    flow.add_argument("--json", action="store_true", help=one)
    flow.add_argument("--quiet", action="store_true", help="print neither progress nor tables")

    physics = commands.add_parser("effects", help="list every physical effect: parameters, ranges, sources, signs")
    style = physics.add_mutually_exclusive_group()
    style.add_argument("--markdown", action="store_true", help="as the page docs/effects.md")
    style.add_argument("--json", action="store_true", help="print one JSON document (bemt.effects/1)")

    proof = commands.add_parser("prove", help="conceal causes, let the diagnosis find them, score it")
    size = "41 or 605 made cases (default small), 68 made by CCBlade (extra wisdem), published recordings as found"
    proof.add_argument("--size", choices=("small", "full", "ccblade", "real"), default="small", help=size)
    proof.add_argument("--seed", type=_seed, metavar="N", help="of everything (default: from the operating system)")
    proof.add_argument("--out", metavar="DIR", help="keep items, key, answers and score there")
    proof.add_argument("--jobs", type=_positive, metavar="N", help="diagnoses at a time (default: one per core)")
    proof.add_argument("--json", action="store_true", help="print one JSON document (bemt.proof/1)")
    proof.add_argument("--quiet", action="store_true", help="print no tables")

    cut = commands.add_parser("stations", help="find and cut the blades of a CAD model or scan: a case to solve")
    cut.add_argument("file", metavar="FILE", help="STL, OBJ or STEP")
    cut.add_argument("--unit", choices=("mm", "m", "in"), help="of an STL or OBJ that does not state it")
    cut.add_argument("--out", metavar="DIR", help="write case.toml, stations.csv and section files there")
    cut.add_argument("--json", action="store_true", help="print one JSON document (bemt.stations/1)")
    _drive_parsers(commands)
    why = commands.add_parser("diagnose", help="say what physics was left out when recording and simulation differ")
    why.add_argument("recordings", nargs="+", metavar="RECORDING", help="tables or logs, analysed together")
    why.add_argument("--case", required=True, metavar="CASE", help="case of all recordings, or one each", **MANY)
    off = "leave out of the baseline; repeatable"
    why.add_argument("--off", action="append", default=[], metavar="EFFECT", help=off)
    known = "recordings without the cause: how far model and stand differ anyway"
    why.add_argument("--reference", default=[], metavar="RECORDING", help=known, **MANY)
    model = "model that is compared with the recordings (default bemt; k1k2: thrust only)"
    why.add_argument("--baseline", choices=("bemt", "k1k2"), default="bemt", help=model)
    why.add_argument("--only", metavar="EFFECT", help="consider these effects only (default: all)", **MANY)
    why.add_argument("--out", metavar="DIR", help="write diagnosis.json, figures and the improved cases there")
    why.add_argument("--no-figures", action="store_true", help="with --out: no figures")
    why.add_argument("--json", action="store_true", help="print one JSON document (bemt.diagnosis/1)")
    why.add_argument("--quiet", action="store_true", help="print neither progress nor answer")

    ahead = commands.add_parser("plan", help="say which effects a test plan can see, before anyone measures")
    ahead.add_argument("--case", required=True, metavar="CASE", help="case file or its folder")
    ahead.add_argument("--plan", required=True, metavar="CSV", help="table of points: rpm, airspeed_m_s, time_s, ...")
    ahead.add_argument("--off", action="append", default=[], metavar="EFFECT", help=off)
    ahead.add_argument("--out", metavar="DIR", help="write plan.json there")
    ahead.add_argument("--json", action="store_true", help="print one JSON document (bemt.plan/1)")
    ahead.add_argument("--quiet", action="store_true", help="print neither progress nor tables")
    return parser


def _drive_parsers(commands: argparse._SubParsersAction[_Parser]) -> None:
    """Add the commands of the drive behind the rotor."""
    chart = commands.add_parser("map", help="bench recording to a map pulse width - thrust and its inverse")
    chart.add_argument("files", nargs="+", metavar="FILE", help="recordings of one drive, of one or more batteries")
    chart.add_argument("--sign", type=int, choices=(1, -1), default=1, help="-1 turns the thrust round (default 1)")
    chart.add_argument("--nodes", type=_positive, default=41, metavar="N", help="rows of the tables (default 41)")
    chart.add_argument("--name", help="name of the files and of the C tables (default: the first recording's)")
    chart.add_argument("--thrust", type=float, metavar="N", help="print the pulse width for this thrust [N]")
    chart.add_argument("--voltage", type=float, metavar="V", help="battery voltage for --thrust [V]")
    chart.add_argument("--out", metavar="DIR", help="write CSV, JSON, a C header and a picture there")
    chart.add_argument("--json", action="store_true", help="print one JSON document (bemt.map/1)")

    motor = commands.add_parser("motor", help="motor constant from data sheet, back-EMF and torque sensor, compared")
    motor.add_argument("file", nargs="?", metavar="FILE", help="motor.toml, or a folder that holds one")
    made = "write generated trials (labelled so) and their motor.toml into DIR"
    motor.add_argument("--generate", metavar="DIR", help=made)
    motor.add_argument("--seed", type=int, metavar="N", help="of --generate (default 0)")
    plant = "with --generate: plant a systematic error, e.g. torque.shunt=1.04; repeatable"
    motor.add_argument("--plant", action="append", default=[], metavar="NAME=SIZE", help=plant)
    motor.add_argument("--out", metavar="DIR", help="write JSON, trials as CSV and a box plot there")
    made = "print one JSON document (bemt.motor.result/1; with --generate alone bemt.motor.generated/1)"
    motor.add_argument("--json", action="store_true", help=made)

    drive = commands.add_parser("drive", help="battery, ESC, motor and the rotor of a case: thrust over pulse width")
    drive.add_argument("case", nargs="?", metavar="CASE", help="case file or its folder")
    drive.add_argument("--drive", metavar="FILE", help="drive.toml (default: beside the case)")
    off = "battery_sag, motor_heating, rotor_inertia or inflow_lag; repeatable"
    drive.add_argument("--off", action="append", default=[], metavar="EFFECT", help=off)
    drive.add_argument("--airspeed", type=float, default=0.0, metavar="V", help="speed of flight [m/s] (default 0)")
    drive.add_argument("--validate", metavar="DIR", help="compare the model with the recordings in this folder instead")
    drive.add_argument("--out", metavar="DIR", help="write JSON, CSV and a picture there")
    told = "print one JSON document (bemt.drive.result/1; with --validate bemt.drive.validation/1)"
    drive.add_argument("--json", action="store_true", help=told)

    body = commands.add_parser("thrusters", help="share force and roll moment among thrusters on a body")
    body.add_argument("file", metavar="FILE", help="thrusters.toml, or a folder that holds one")
    body.add_argument("--force", type=float, metavar="N", help="wanted force (default: the file's) [N]")
    body.add_argument("--moment", type=float, metavar="NM", help="wanted roll moment (default: the file's) [N m]")
    body.add_argument("--out", metavar="DIR", help="write JSON, CSV and a picture there")
    body.add_argument("--json", action="store_true", help="print one JSON document (bemt.thrusters.result/1)")


def _check_folders(args: argparse.Namespace) -> None:
    """Refuse a file where a folder is wanted, before minutes of work end at it."""
    faults = []
    for name in ("out", "work", "dir"):
        near = getattr(args, name, None) or "."
        while near and not os.path.exists(near):
            near = os.path.dirname(near)
        if near and not os.path.isdir(near):
            faults.append(Fault(f"--{name}", "", f"{near}, a file", "a folder"))
    if faults:
        raise InputError(faults)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit code.
    """
    for stream in (sys.stdout, sys.stderr):  # a terminal that is not UTF-8 must not end a run
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    args = build_parser().parse_args(argv)
    if getattr(args, "json", False) and hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace")  # RFC 8259, 8.1
    try:
        _check_folders(args)
        code = importlib.import_module(_MODULES[args.command]).run(args)
        sys.stdout.flush()
        return EXIT_OK if code is None else int(code)
    except InputError as error:
        print(error, file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone, as in `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:  # the system's word; others come from libraries
            print(system_fault(error), file=sys.stderr)
            return EXIT_INPUT
        import traceback

        traceback.print_exc()
        print(f"internal error of bemt {__version__}; please report it with the lines above", file=sys.stderr)
        return EXIT_INTERNAL

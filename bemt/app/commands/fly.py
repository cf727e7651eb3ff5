"""``python -m bemt fly``: a flight log in, the rotor's constants and what is wrong with it out."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

if TYPE_CHECKING:
    from bemt.tools.flight.answer import FlightAnswer

NAME = "fly"
HELP = "identify the rotors of a flight log, and compare it with healthy flights"
GROUP = "Recordings"
EXAMPLE = "fly flight.ulg --mass 1.2 --case 10x4.5"
_FAR = 5.0  # ratio of thrusts at one speed that is no scatter of propellers: half as large again in diameter


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    kinds = "flight logs: PX4 ULog, ArduPilot DataFlash, Crazyflie usdlog, Betaflight or other CSV"
    parser.add_argument("logs", nargs="*", metavar="LOG", help=kinds)
    parser.add_argument("--case", metavar="ROTOR", help="case or label of the propeller, compared with the flight")
    parser.add_argument("--mass", type=float, metavar="KG", help="mass in flight with battery [kg]")
    layout = 'angles with turning, "-45+ 135+ 45- -135-", or quad-x, x8, ...; "list" prints the names'
    parser.add_argument("--layout", default="", metavar="LAYOUT", help=f"{layout} (default: of the log)")
    healthy = "healthy flights of the same vehicle, 3 or more for a verdict"
    parser.add_argument("--healthy", default=[], metavar="LOG", help=healthy, **_options.MANY)
    known = "mass of the healthy flights [kg]: gives the mass of this one"
    parser.add_argument("--healthy-mass", type=float, metavar="KG", help=known)
    alarm = "accepted share of healthy flights that are accused (default 0.01); more finds smaller damage"
    parser.add_argument("--false-alarm", type=_share, default=0.01, metavar="P", help=alarm)
    learnt = "write the case of --case with the rotor as these flights show it to this folder; needs --mass"
    parser.add_argument("--out-case", metavar="DIR", help=learnt)
    parser.add_argument("--out", dest="picture", metavar="PNG", help="write a picture of the first log to this file")
    _options.add_json(parser, "bemt.flight/1")
    _options.add_quiet(parser, "no answer")


def _share(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 0.5:
        raise argparse.ArgumentTypeError(f"got {text}; expected a probability above 0 and below 0.5")
    return value


def run(args: argparse.Namespace) -> int:
    """Read, identify, judge, print."""
    from bemt.base.errors import Fault, InputError
    from bemt.base.tables import json_text
    from bemt.tools.flight.answer import answer_on
    from bemt.tools.flight.read import read_log

    if args.layout == "list":
        from bemt.tools.flight.layout import LAYOUTS

        print("\n".join(f"{name:<14} {places}" for name, places in LAYOUTS.items()))
        return EXIT_OK
    if not args.logs:
        raise InputError(Fault("LOG", "", "no file", "a flight log", "bemt fly flight.ulg"))
    faults: list[Fault] = []
    found = {}
    for path in dict.fromkeys([*args.logs, *args.healthy]):
        try:
            found[path] = read_log(path)
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults)
    healthy = {path: found[path] for path in args.healthy}
    answers = []
    for path in args.logs:
        others = [log for name, log in healthy.items() if name != path]
        answer = answer_on(found[path], others, args.mass, args.layout, args.healthy_mass, args.false_alarm)
        answers.append(_with_model(answer, args.case) if args.case else answer)
    learnt, code = _learn(args, answers) if args.out_case else ("", EXIT_OK)
    if args.picture:
        from bemt.tools.flight.picture import flight_picture

        Path(args.picture).write_bytes(flight_picture(answers[0], args.mass))
    if args.json:
        documents = [a.document() for a in answers]
        print(
            json_text(documents[0] if len(documents) == 1 else {"schema": "bemt.flight/1", "flights": documents}),
            end="",
        )
    elif not args.quiet:
        from bemt.tools.flight.text import text

        print("\n\n".join([*(text(a) for a in answers), *([learnt] if learnt else [])]))
    return code


def _learn(args: argparse.Namespace, answers: list[FlightAnswer]) -> tuple[str, int]:
    """Write the case with the rotor as the flights show it; gives what to print, and the exit code."""
    import shlex

    from bemt.app.library.rotors import rotor_of
    from bemt.base.errors import Fault, InputError
    from bemt.judge.diagnose.rotor_calibration import document, text, write
    from bemt.rotors.case.load import with_changes
    from bemt.tools.flight.rotor_case import learn_from_flights

    if not args.case:
        raise InputError(Fault("--out-case", "", "no --case", "the case or label of the propeller"))
    case = rotor_of(args.case).case
    speeds = [one for a in answers for one in a.found.rotors.get("mean rpm", ())]
    if speeds and not Path(args.case).exists():  # the speed of a label is a guess
        case = with_changes(case, {"operating.rpm": round(sum(speeds) / len(speeds))})
    found = learn_from_flights(case, args.logs, [a.found for a in answers])
    written = write(case, found, args.logs, args.out_case, NAME, "--out-case")
    folder = shlex.quote(Path(args.out_case).as_posix())
    said = document(case, found, args.logs) | {"recommended_airspeed_m_s": None}  # a stand's advice
    code = EXIT_OK if found.found.converged else EXIT_UNCONVERGED
    again = f"bemt fly {shlex.quote(args.logs[0])} --mass {args.mass:g} --case {folder}"
    lines = [
        text(said),
        "These flights show the rotor at hover alone; for torque and fast flight add a stand or tunnel run.",
        f"{folder}: {', '.join(written)}",
        f"next: bemt sweep {folder}",
        f"      {again}",
    ]
    return "\n".join(lines), code


def _with_model(answer: FlightAnswer, case: str) -> FlightAnswer:
    """The answer with the model at the mean speed: hovering, and in the flow that the flight met."""
    from dataclasses import replace

    import numpy as np

    from bemt.app.library.rotors import rotor_of
    from bemt.base.errors import Fault, InputError
    from bemt.tools.flight.answer import Predicted

    speeds = answer.found.rotors.get("mean rpm")
    if speeds is None:
        return answer
    rpm, rotor, flow = sum(speeds) / len(speeds), rotor_of(case), answer.inflow
    points = rotor.solve(rpm=rpm, airspeed_m_s=0.0)
    hover, u = float(points.thrust_N[0]), float(points.u["thrust_N"][0])
    flown = answer.found.constants.get("thrust constant")
    if flown is not None and flown.unit == "N/rpm^2" and not 1.0 / _FAR < flown.value * rpm**2 / hover < _FAR:
        got = f"{flown.value * rpm**2:.3g} N of each rotor at {rpm:.0f} rev/min"
        expected = f"about the {hover:.3g} N of {case}"
        raise InputError(Fault(answer.log.file, "--mass, --case", got, expected, "Mass in kg? The flown propeller?"))
    along, across = np.linspace(*(flow.axial_m_s if flow else (0.0, 0.0)), 9), np.linspace(0.0, 1.0, 9)
    across = across * (flow.inplane_m_s if flow else 0.0)
    axial = rotor.solve(rpm=rpm, airspeed_m_s=np.abs(along), angle_deg=np.where(along < 0.0, 180.0, 0.0)).thrust_N
    inplane = rotor.solve(rpm=rpm, airspeed_m_s=across, angle_deg=90.0).thrust_N
    found = Predicted(hover / rpm**2, u / rpm**2, np.stack([along, axial / hover - 1.0]),
                      np.stack([across, inplane / hover - 1.0]))  # fmt: skip
    return replace(answer, predicted=found)

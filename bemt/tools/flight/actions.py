"""The action on flight logs: read, identify, judge beside healthy flights, and what is kept of it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import Answered, Told, action
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, gathered, refuse

if TYPE_CHECKING:
    import pandas as pd

    from bemt.base.errors import Fault
    from bemt.tools.flight.answer import FlightAnswer
    from bemt.tools.flight.log import FlightLog

__all__ = ["FlightsAnswer", "fly", "layouts"]

StrPath = str | os.PathLike[str]
_FAR = 5.0  # ratio of thrusts at one speed that is no scatter of propellers: half as large again in diameter


@dataclass(frozen=True, eq=False)
class FlightsAnswer(Answered):
    """Answers on one or more flights."""

    flights: tuple[FlightAnswer, ...]  # In the order of the logs
    faults: tuple[Fault, ...] = ()  # Of the files of a folder that are no flight logs
    folder: bool = False  # Whether a folder was given: a table is the text
    learnt: str = ""  # What the case learnt, and where it was written
    converged: bool = True  # Whether that case could be solved
    mass_kg: float | None = None  # Mass that was stated [kg]

    def __repr__(self) -> str:
        """Say the verdict in a line."""
        return f"<flight {', '.join(a.log.file for a in self.flights)}: {self.verdict} {', '.join(self.effects)}>"

    @property
    def verdict(self) -> str:
        """Verdict of the flight; of several, each once, with commas."""
        return ", ".join(dict.fromkeys(a.judged.said.verdict for a in self.flights))

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the verdicts."""
        return tuple(dict.fromkeys(str(e) for a in self.flights for e in a.judged.said.effects))

    @property
    def exit_code(self) -> int:
        """1 if the case that was learnt could not be solved."""
        return EXIT_OK if self.converged else EXIT_UNCONVERGED

    @property
    def text(self) -> str:
        """Three lines for the pilot and what each flight shows; a table for a folder."""
        if not self.folder:
            return self._texts(False)
        parts = [_aligned([_row(a) for a in self.flights]), *(f"{f.file}: {f.got}" for f in self.faults)]
        return "\n".join(p for p in parts if p)

    @property
    def details(self) -> str:
        """The same with the constants, and what a log cannot show."""
        return self._texts(True)

    def _texts(self, details: bool) -> str:
        from bemt.tools.flight.text import text

        return "\n\n".join([*(text(a, details) for a in self.flights), *([self.learnt] if self.learnt else [])])

    def to_pandas(self) -> pd.DataFrame:
        """The table, a row a flight."""
        import pandas as pd

        return pd.DataFrame(self.table())

    def _document(self) -> dict[str, Any]:
        """JSON of schema bemt.flight/1: one flight, or `flights`."""
        documents = [a.document() for a in self.flights]
        if len(documents) == 1 and not self.folder:
            return documents[0]
        refused = [{"file": f.file, "got": f.got, "expected": f.expected, "hint": f.hint} for f in self.faults]
        return {"schema": "bemt.flight/1", "flights": documents, **({"refused": refused} if self.folder else {})}

    def table(self) -> list[dict[str, Any]]:
        """One row a flight: file, format, rotors, seconds in the air, verdict, where to look, constants."""
        return [asdict(_row(a)) for a in self.flights]

    def csv(self) -> str:
        """The table as CSV."""
        from bemt.base.tables import csv_text

        rows = self.table()
        return csv_text(list(rows[0]), rows)

    def figure(self, flight: int = 0, kind: str = "png") -> bytes:
        """Picture of one flight: png, pdf or svg."""
        from bemt.tools.flight.picture import flight_picture

        return flight_picture(self.flights[flight], self.mass_kg, kind)


def layouts() -> dict[str, str]:
    """Layouts by name: angle of each motor from ahead to the left [deg], with + for one that turns to the left."""
    from bemt.tools.flight.layout import LAYOUTS

    return dict(LAYOUTS)


@action(
    "Recordings", "fly flight.ulg --healthy good_1.ulg good_2.ulg good_3.ulg", words=("logs",), shown=True,
    common=("healthy", "mass_kg", "case", "layout", "picture", "out_csv", "healthy_day"),
)  # fmt: skip
def fly(
    logs: StrPath | Sequence[StrPath], *, case: StrPath | None = None, mass_kg: float | None = None, layout: str = "",
    healthy: Sequence[StrPath | Sequence[StrPath]] = (), healthy_day: Literal["same", "other", ""] = "",
    healthy_mass_kg: float | None = None, out_case: StrPath | None = None, picture: StrPath | None = None,
    out_csv: StrPath | None = None,
) -> FlightsAnswer | Told:  # fmt: skip
    """Identify the rotors of flight logs, and compare each with healthy flights.

    Parameters
    ----------
    logs : path or sequence of path
        Flight logs, gzipped or not: PX4 ULog, ArduPilot DataFlash, Crazyflie usdlog, Betaflight or other CSV. Of a
        folder every log in it; files that are none are listed in `faults`.
    case : path or str
        Case or label of the propeller, compared with the flight.
    mass_kg : float
        Mass in flight with battery [kg].
    layout : str
        Name such as quad-x (``list`` gives them all), or angles with turning, "-45+ 135+ 45- -135-"; that of the log
        where it is empty.
    healthy : sequence of path, or of sequences of path
        Healthy flights of the same vehicle, three or more for a verdict. Each folder, and each sequence, is one
        session (one day, one battery in its place); single files are sessions by the dates of the logs, else one.
    healthy_day : {"", "same", "other"}
        Whether the logs are of the last session of `healthy`, or of none; empty: by date, else it is left open.
    healthy_mass_kg : float
        Mass of the healthy flights [kg]: gives the mass of this one.
    out_case : path
        Folder for the case with the rotor as these flights show it; needs the mass.
    picture : path
        File for a picture of the first flight: .png, .pdf or .svg.
    out_csv : path
        File for a table, a row a flight.

    Returns
    -------
    FlightsAnswer
        With ``.verdict``, ``.effects``, ``.text``, ``.details``, ``.to_dict()`` (schema ``bemt.flight/1``),
        ``.table()``, ``.csv()`` and ``.figure()``.

    Raises
    ------
    InputError
        For logs that cannot be read, another number of rotors, an unknown layout, or a mass that cannot have flown.
    """
    if layout == "list":
        return Told(layouts(), "\n".join(f"{name:<14} {places}" for name, places in layouts().items()))
    from bemt.base.canvas import kind_of
    from bemt.base.given import number

    given = [logs] if isinstance(logs, str | os.PathLike) else list(logs)
    for name, mass in (("mass_kg", mass_kg), ("healthy_mass_kg", healthy_mass_kg)):
        if mass is not None:
            number(name, mass)
    kind = "" if picture is None else kind_of(os.fspath(picture))
    refuse(_unusable(given, healthy, out_case, case))
    folder = any(Path(p).is_dir() for p in given)
    answers, refused = _answers(given, _grouped(healthy), folder, mass_kg, layout, healthy_mass_kg, healthy_day)
    if case is not None:
        answers = [_with_model(answer, os.fspath(case)) for answer in answers]
    learnt, converged = "", True
    if out_case is not None:
        learnt, converged = _learn(answers, os.fspath(case or ""), os.fspath(out_case), mass_kg)
    out = FlightsAnswer(tuple(answers), tuple(refused), folder, learnt, converged, mass_kg)
    if picture is not None:
        Path(picture).write_bytes(out.figure(kind=kind))
    if out_csv is not None:
        Path(out_csv).write_text(out.csv(), encoding="utf-8")
    return out


def _unusable(
    given: Sequence[StrPath], healthy: Sequence[StrPath | Sequence[StrPath]], out_case: StrPath | None,
    case: StrPath | None,
) -> list[Fault]:  # fmt: skip
    """What is wrong with the words, before any log is read."""
    from bemt.base.errors import Fault

    faults = [] if given else [Fault("", "logs", "none", "a flight log", "bemt fly flight.ulg")]
    if out_case is not None and case is None:
        faults.append(Fault("--out-case", "", "no --case", "the case or label of the propeller"))
    named = [Path(p) for one in healthy for p in ([one] if isinstance(one, str | os.PathLike) else one)]
    calm = {p.resolve() for p in named if p.is_file()}
    return faults + [
        Fault(os.fspath(p), "", "a flight that is to be its own healthy flight", "other flights with --healthy",
              "Beside itself a flight shows nothing")
        for p in given if Path(p).is_file() and Path(p).resolve() in calm
    ]  # fmt: skip


def _answers(
    given: Sequence[StrPath], calm: Sequence[tuple[str, str]], folder: bool, mass_kg: float | None, layout: str,
    healthy_mass_kg: float | None, healthy_day: str,
) -> tuple[list[FlightAnswer], list[Fault]]:  # fmt: skip
    """Answer on each log beside healthy flights and their sessions; of a folder, also what could not be read."""
    from bemt.base.errors import InputError
    from bemt.tools.flight.answer import answer_on

    mine = [f for p in given for f in _files(p)]
    found, refused = _read(dict.fromkeys([*mine, *(p for p, _ in calm)]))
    strict = [f for f in refused if not folder or f.file in {p for p, _ in calm}]
    if strict or not any(p in found for p in mine):
        raise InputError(strict or refused)
    answers: list[FlightAnswer] = []
    for path in (p for p in mine if p in found):
        others, days, day = _compared_with(path, calm, healthy_day)
        try:
            healthy = [found[p] for p in others]
            answers.append(answer_on(found[path], healthy, mass_kg, layout, healthy_mass_kg, days, day))
        except InputError as error:
            if not folder:
                raise
            refused += error.faults
    if not answers:
        raise InputError(refused)
    return answers, refused


def _compared_with(path: str, calm: Sequence[tuple[str, str]], told: str) -> tuple[list[str], list[str], str]:
    """Healthy flights for a log, their sessions if they are stated, and that of the log, as `told` or by its folder."""
    stated = len({day for _, day in calm}) > 1 or any(day != _LOOSE for _, day in calm)
    here, inside = Path(path).resolve(), str(Path(path).parent)
    others = [(p, day) for p, day in calm if Path(p).resolve() != here]
    day = told or (inside if any(d == inside for _, d in others) else "")
    return [p for p, _ in others], [d for _, d in others] if stated else [], day


_LOOSE = "files"  # session of healthy flights that are given one by one


def _files(path: StrPath) -> list[str]:
    """A log, or the files of a folder."""
    if not Path(path).is_dir():
        return [os.fspath(path)]
    return sorted(str(p) for p in Path(path).iterdir() if p.is_file() and not p.name.startswith("."))


def _grouped(healthy: Sequence[StrPath | Sequence[StrPath]]) -> list[tuple[str, str]]:
    """Files of healthy flights, each with its session."""
    out: list[tuple[str, str]] = []
    for k, one in enumerate(healthy):
        if isinstance(one, str | os.PathLike):
            out += [(f, str(Path(one)) if Path(one).is_dir() else _LOOSE) for f in _files(one)]
        else:
            out += [(f, f"session {k + 1}") for p in one for f in _files(p)]
    return list(dict(out).items())


def _read(paths: Sequence[str] | dict[str, None]) -> tuple[dict[str, FlightLog], list[Fault]]:
    """Logs by their path, and what is wrong with the others."""
    from bemt.tools.flight.read import read_log

    found: dict[str, FlightLog] = {}
    faults: list[Fault] = []
    for path in paths:
        with gathered(faults):
            found[path] = read_log(path)
    return found, faults


def _learn(answers: Sequence[FlightAnswer], label: str, folder: str, mass_kg: float | None) -> tuple[str, bool]:
    """Write the case with the rotor as the flights show it; gives what to print, and whether it could be solved."""
    import shlex

    from bemt.judge.diagnose.rotor_calibration import lines_of, write
    from bemt.rotors.case.load import with_changes
    from bemt.tools.flight.identify import learn_from_flights

    files = [a.log.file for a in answers]
    from bemt.rotors.propeller import rotor_of

    case = rotor_of(label).case
    speeds = [one for a in answers for one in a.found.rotors.get("mean rpm", ())]
    if speeds and not Path(label).exists():  # the speed of a label is a guess
        case = with_changes(case, {"operating.rpm": round(sum(speeds) / len(speeds))})
    found = learn_from_flights(case, files, [a.found for a in answers])
    written = write(case, found, files, folder, "fly", "--out-case")
    place = shlex.quote(Path(folder).as_posix())
    lines = [
        *lines_of(case, found, files, advice=False),  # that is for a stand
        "These flights show the rotor at hover alone; for torque and fast flight add a stand or tunnel run.",
        f"{place}: {', '.join(written)}",
        f"next: bemt sweep {place}",
        f"      bemt fly {shlex.quote(files[0])} --mass-kg {mass_kg:g} --case {place}",
    ]
    return "\n".join(lines), bool(found.found.converged)


def _with_model(answer: FlightAnswer, case: str) -> FlightAnswer:
    """The answer with the model at the mean speed: hovering, and in the flow that the flight met."""
    from dataclasses import replace

    import numpy as np

    from bemt.base.errors import Fault, InputError
    from bemt.tools.flight.answer import Predicted

    speeds = answer.found.rotors.get("mean rpm")
    if speeds is None:
        return answer
    from bemt.rotors.propeller import rotor_of

    rpm, rotor, flow = sum(speeds) / len(speeds), rotor_of(case), answer.inflow
    points = rotor.solve(rpm=rpm, airspeed_m_s=0.0)
    hover, u = float(points.thrust_N[0]), float(points.u_thrust_N[0])
    flown = answer.found.constants.get("thrust constant")
    if flown is not None and flown.unit == "N/rpm^2" and not 1.0 / _FAR < flown.value * rpm**2 / hover < _FAR:
        got = f"{flown.value * rpm**2:.3g} N of each rotor at {rpm:.0f} rev/min"
        expected = f"about the {hover:.3g} N of {case}"
        raise InputError(Fault(answer.log.file, "--mass-kg, --case", got, expected, "Mass in kg? The flown propeller?"))
    along, across = np.linspace(*(flow.axial_m_s if flow else (0.0, 0.0)), 9), np.linspace(0.0, 1.0, 9)
    across = across * (flow.inplane_m_s if flow else 0.0)
    axial = rotor.solve(rpm=rpm, airspeed_m_s=np.abs(along), angle_deg=np.where(along < 0.0, 180.0, 0.0)).thrust_N
    inplane = rotor.solve(rpm=rpm, airspeed_m_s=across, angle_deg=90.0).thrust_N
    found = Predicted(hover / rpm**2, u / rpm**2, np.stack([along, axial / hover - 1.0]),
                      np.stack([across, inplane / hover - 1.0]))  # fmt: skip
    answer = replace(answer, predicted=found)
    if not answer.other_rotor:
        return answer
    step = replace(answer.judged.next, text=f"{answer.other_rotor}; then {answer.judged.next.text or 'fly again'}")
    return replace(answer, judged=replace(answer.judged, next=step))


@dataclass(frozen=True)
class _Row:
    """One flight in the table; None where the log does not show it."""

    file: str
    format: str
    rotors: int | None
    flying_s: float | None
    verdict: str
    effects: str
    look: str
    thrust_constant: float | None
    thrust_constant_half: float | None
    thrust_constant_unit: str | None
    thrust_over: str | None
    mass_kg: float | None
    mass_half_kg: float | None
    hover_command: float | None
    sensors: str
    vibration_m_s2: float | None
    wind_m_s: float | None


def _row(a: FlightAnswer) -> _Row:
    import numpy as np

    from bemt.tools.flight.text import pilot, sensor_text

    k = a.found.constants.get("thrust constant") or a.found.constants.get("thrust per command")
    hover, shake = a.found.constants.get("hover command"), a.vibration
    level = float(np.linalg.norm(shake.rms)) if shake.rms and shake.unit == "m/s2" else float("nan")

    def rounded(value: float) -> float | None:
        return float(f"{value:.4g}") if np.isfinite(value) else None

    over = "speed^2" if "thrust constant" in a.found.constants else "command"
    return _Row(
        file=a.log.file, format=a.log.format, rotors=a.log.rotors or a.log.stated_rotors or None,
        flying_s=rounded(float(a.log.flying.mean() * np.ptp(a.log.t))),
        verdict=a.judged.said.verdict, effects="; ".join(a.judged.said.effects), look=pilot(a)[0],
        thrust_constant=None if k is None else rounded(k.value),
        thrust_constant_half=None if k is None else rounded(k.half),
        thrust_constant_unit=None if k is None else k.unit, thrust_over=None if k is None else over,
        mass_kg=None if a.mass is None else rounded(a.mass.value),
        mass_half_kg=None if a.mass is None else rounded(a.mass.half),
        hover_command=None if hover is None else rounded(hover.value),
        sensors="; ".join(sensor_text(s) for s in a.log.sensors),
        vibration_m_s2=rounded(level), wind_m_s=rounded(a.wind.speed),
    )  # fmt: skip


def _aligned(rows: Sequence[_Row]) -> str:
    """The columns that a screen holds."""
    from bemt.base.tables import text_table

    cells = []
    for r in rows:
        k, half = r.thrust_constant, r.thrust_constant_half
        share = "" if k is None or half is None else f"{100 * half / k:.1f} %"
        constant = "" if k is None else f"{r.thrust_over}: {k:.4g} ± {share} {r.thrust_constant_unit}"
        what = f"{r.verdict}: {r.effects}" if r.effects else r.verdict
        sensor = r.sensors.removeprefix("The speed sensor of ")
        cells.append((Path(r.file).name, str(r.rotors or ""), f"{r.flying_s or 0.0:.0f} s", what, constant, sensor))
    heads = ("file", "rotors", "in the air", "verdict", "thrust over", "sensor")
    return text_table(heads, cells, range(len(heads)))

"""One sitting at a stand: limits, weather, the plan, the first recording, and the loop until a run is not worth it."""

from __future__ import annotations

import base64
import math
import secrets
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.action import Answered
from bemt.base.canvas import CYCLE, GREY, STYLE, blank, frame, png
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError
from bemt.base.page import render
from bemt.base.tables import json_text, write_atomic
from bemt.judge.actions import plan
from bemt.judge.diagnose.folder import beside
from bemt.judge.loss import minutes
from bemt.judge.proof import prove
from bemt.judge.proof.course import Course
from bemt.judge.proof.loop import A_RUN, Points, follow
from bemt.physics import effects
from bemt.rotors.case import load_case
from bemt.tools.stand import sealed
from bemt.tools.stand.guard import Limits
from bemt.tools.stand.hand import Rows, Simulated, Wired, lapsed, wire_of_the_simulated
from bemt.tools.stand.verbs import Stand, Stopped

if TYPE_CHECKING:
    from bemt.rotors.propeller import Propeller

_ARMING_S = 3.0  # At the stop value, until a controller takes commands
_ABOVE = 1.1  # Speed at which the motor is stopped, over the top of the range [1]
_UP, _WINDS = 10, 5  # Speeds of a plan at rest, and winds of one in a tunnel
_AIR = ("temperature_C", "pressure_hPa")  # What is given beside limits
_SIMULATED = {"largest_us": 2000.0, "ramp_us_s": 500.0}  # Limits of a simulated stand, where none are given
_ASKED = {
    "largest_us": "Largest pulse width [us]", "ramp_us_s": "Fastest rise of the pulse width [us/s]",
    "current_A": "Largest current [A]", "temperature_C": "Temperature of the air [C]",
    "pressure_hPa": "Pressure of the air, at the stand [hPa]",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class StandAnswer(Answered):
    """What a sitting found, and how it went."""

    case: str
    course: Course
    stopped: str = ""  # Why the guard stopped it
    there: tuple[str, ...] | None = None  # What was sealed, of a simulated stand
    files: tuple[Path, ...] = ()
    details: str = field(default="", repr=False)  # The log

    @property
    def exit_code(self) -> int:
        """1 if the guard stopped it."""
        return EXIT_UNCONVERGED if self.stopped else EXIT_OK

    @property
    def found(self) -> tuple[str, ...]:
        """Causes that were named, in order."""
        return tuple(self.course.named())

    @property
    def text(self) -> str:
        """What came of it; the rest was told while it happened."""
        told = [line for line in self.details.split("\n") if line.startswith(("stopped: ", "found: ", "unsealed: "))]
        return "\n".join([*told, *(f"story: {f.as_posix()}" for f in self.files if f.suffix == ".html")])

    def _document(self) -> dict[str, Any]:
        """Plain values of schema ``bemt.stand/1``."""
        c = self.course
        answers = [{"verdict": a.verdict, "effects": a.effects, "probability": a.sure} for a in c.answers]
        return {"schema": "bemt.stand/1", "case": self.case, "found": self.found, "stopped": self.stopped,
                "there": self.there, "end": c.end, "steps": c.steps, "minutes": c.minutes,
                "answers": answers}  # fmt: skip


def ask(question: str) -> str:
    """Ask at the terminal."""
    if not sys.stdin.isatty():
        raise InputError(Fault("", "yes", "no terminal", f"somebody who answers: {question}", "Runs are confirmed"))
    sys.stderr.write(f"{question} ")
    sys.stderr.flush()
    return sys.stdin.readline().strip()


def asked(name: str, given: Mapping[str, float | None]) -> float:
    """Number as given, else asked for at the terminal."""
    if (told := given.get(name)) is not None:
        return told
    got = ask(f"{_ASKED[name]}?")
    try:
        return float(got)
    except ValueError:
        raise InputError(Fault("", name, repr(got), "a number")) from None


class AtTheTerminal(Wired):
    """The person at a real stand is asked for what no wire does."""

    def __init__(self, points: Points, air: Mapping[str, float], wind_m_s: float) -> None:
        super().__init__()
        self.points, self.air, self.wind, self.now = points, air, wind_m_s, 0.0

    def set_up(self, kind: str, runs: Sequence[Points], mended: Sequence[str], day: int) -> Rows:
        """Ask for what a run needs; no rows where it cannot be."""
        rows = runs[-1] if kind == "run" else self.points
        if max(r["airspeed_m_s"] for r in rows) > self.wind or max(r["rpm"] for r in rows) > self.stand.limits.rpm:
            return []
        need = "the rotor and the stand as they were before, without what is suspected" if kind == "reference" else ""
        if "pressure_Pa" in rows[0]:
            need = f"air of {rows[0]['temperature_C']:.0f} C and {rows[0]['pressure_Pa'] / 100:.0f} hPa"
        if "wall_distance_m" in rows[0]:
            need = f"a wall {rows[0]['wall_distance_m']:.2f} m behind the rotor"
        return rows if not need or ask(f"Needs {need}. Enter when it is so, s to skip.") != "s" else []

    def place(self, row: Mapping[str, float]) -> Mapping[str, float]:
        """Ask for the wind of a row."""
        if row["airspeed_m_s"] != self.now:
            self.now = row["airspeed_m_s"]
            self.stand.stop()  # nobody goes near a motor that turns
            ask(f"Wind of {self.now:.1f} m/s, then Enter.")
        return {**self.air, **row}

    def there(self, name: str) -> bool:
        """Ask whether a cause is there."""
        check = effects.catalogue()[name].check if name in effects.catalogue() else name
        return ask(f"Look: {check}. Is it so? [y/n]").lower().startswith("y")

    def mend(self, names: Sequence[str]) -> Sequence[str]:
        """Ask to put causes right."""
        ask(f"Mend this, then press Enter: {', '.join(names)}.")
        return names


class _Log:
    """What is told of a sitting while it happens, and how far it has come."""

    def __init__(self, path: Path, say: Callable[[str], None], yes: bool) -> None:
        self.path, self.say, self.yes = path, say, yes
        self.lines: list[str] = []
        self.course, self.stopped = Course("", []), ""

    def tell(self, text: str) -> None:
        """Put a line into the log."""
        self.lines.append(text)
        self.say(f"{text}\n")
        write_atomic(self.path, "\n".join(self.lines) + "\n")

    def planned(self, points: Points, case: Path) -> None:
        """Say what a recording of these points can show."""
        seen = plan({k: [p[k] for p in points] for k in ("rpm", "airspeed_m_s")}, case).detectable
        self.tell(f"plan: {len(points)} points; can show " + ", ".join(k for k, v in seen.items() if v == "yes"))
        self.tell("plan: cannot show " + ", ".join(k for k, v in seen.items() if v == "no"))

    def may(self, kind: str, rows: Rows) -> bool:
        """Announce a run, and ask unless all are confirmed."""
        speeds, winds = ([r[n] for r in rows] for n in ("rpm", "airspeed_m_s"))
        what = {"again": "the recording", "run": "the run asked for", "reference": "a reference"}[kind]
        wind = f", wind {min(winds):.1f} to {max(winds):.1f} m/s" if max(winds) else ", at rest"
        self.tell(f"run: {what}, {len(rows)} points, {min(speeds):.0f} to {max(speeds):.0f} rev/min{wind}, about "
                  f"{minutes('run', len(rows)):.0f} min")  # fmt: skip
        return self.yes or ask("Enter to run, s to skip.") != "s"

    def stop(self, why: str) -> None:
        """Say why the guard stopped it, and how sure the stop is."""
        self.stopped = why
        sure = not why.startswith(("wire lost", "no row", "the guard"))
        self.tell(f"stopped: {why}; {'the output is at its stop value' if sure else 'look: does the motor stand?'}")

    def told(self, course: Course) -> None:
        """Say what the last step and its diagnosis are."""
        self.course = course
        if course.steps:
            aside = ", ".join(course.aside[-1])
            self.tell(f"step: {course.steps[-1]}" + (f" {aside}" if aside else ""))
        last = course.answers[-1]
        if last.confirmed:
            return self.tell(f"said: {', '.join(last.effects)} is there, a look has shown it")
        what = f" {' or '.join(last.effects) if last.verdict == 'class' else ', '.join(last.effects)}".rstrip()
        loss = dict(last.whole.get("expected_loss") or {}).get(last.verdict, math.nan)
        self.tell(f"said: {last.verdict}{what} (probability {last.sure:.2f}, expected loss {loss:.2f})")
        if asks := dict(last.whole.get("next_measurement") or {}).get("text"):
            self.tell(f"next: {asks}")


def plan_of(top_rpm: float, wind_m_s: float) -> list[dict[str, float]]:
    """Points of a first recording: up and down at rest, or speeds by winds."""
    if not wind_m_s:
        up = np.linspace(0.35, 1.0, _UP) * top_rpm
        return [{"rpm": float(n), "airspeed_m_s": 0.0, "run": 0} for n in (*up, *up[-2::-1])]
    speeds, winds = np.linspace(0.4, 1.0, _UP // 2) * top_rpm, np.linspace(0.0, wind_m_s, _WINDS)
    return [{"rpm": float(n), "airspeed_m_s": float(V), "run": k} for k, V in enumerate(winds) for n in speeds]


def sit(
    rotor: Propeller, on: str, address: str, line: str, given: Mapping[str, float | None], *, top_rpm: float | None,
    wind_m_s: float, runs: int, faults: Sequence[str], seed: int | None, lapse: float, yes: bool, out: Path,
    say: Callable[[str], None],
) -> StandAnswer:  # fmt: skip
    """Sit at a stand; everything goes into one folder."""
    top = top_rpm or rotor.case.rpm
    points = plan_of(top, wind_m_s)
    case = rotor.write(out)
    for file in beside(rotor.case) if rotor.case.path.is_file() else ():
        write_atomic(out / file.relative_to(rotor.case.folder), file.read_bytes())
    log = _Log(out / "log.txt", say, yes)
    log.planned(points, case)
    hand: Wired
    with ExitStack() as held:
        limits = _limits(rotor, on, given, top, lapse)
        if on == "simulated":
            own = secrets.randbits(40) if seed is None else seed
            digest = sealed.seal_case(out / "sealed", load_case(case), points, top, faults, own)
            log.tell(f"sealed: what is wrong with the simulated stand, SHA-256 {digest}")
            hand = other = Simulated(out / "sealed", "0000", wire_of_the_simulated(), lapse)
            held.callback(other.close)
            wire = (other.wire, other.address, "")
        else:
            air = {"temperature_C": asked("temperature_C", given), "pressure_Pa": 100.0 * asked("pressure_hPa", given)}
            hand, wire = AtTheTerminal(points, air, wind_m_s), (on, address, line)
        hand.may, hand.keep = log.may, out.as_posix()
        try:
            hand.stand = held.enter_context(Stand(*wire, limits, settle_s=max(2.0 / lapse, 0.3)))
            if on != "simulated":
                hand.stand.rest(_ARMING_S)
            if text := hand.measured("again"):
                write_atomic(out / "recording.csv", text)
                _diagnosed(out, [*prove.question(out), "--top-rpm", f"{top:g}"], hand, runs, log)
        except Stopped as error:
            log.stop(str(error))
    there = sealed.bench_of(out / "sealed", "0000")[1].causes if on == "simulated" else None
    spent = sum(log.course.minutes) + minutes("run", len(points))
    end = log.stopped or log.course.end or "no run"
    log.tell(f"found: {_found(log.course)}; ended by: {end}; {spent:.0f} min of stand time")
    if there is not None:
        log.tell(f"unsealed: there was {', '.join(there) or 'nothing wrong'}")
    files = out / "stand.json", out / "log.txt", *write_story(out, rotor, log.course, hand.made, log.lines)
    answer = StandAnswer(rotor.name, log.course, log.stopped, there, files, "\n".join(log.lines))
    write_atomic(out / "stand.json", json_text(answer.to_dict()))
    return answer


def _diagnosed(out: Path, question: list[str], hand: Wired, runs: int, log: _Log) -> None:
    """Diagnose the first recording and follow what the answers ask for."""
    first, said = prove.asked(out, question)
    if not first:
        raise InputError(Fault(str(out / "recording.csv"), "", said[-300:], "a recording to diagnose"))
    log.told(Course("", [first]))
    log.course = follow(out, first, hand, runs, enough=A_RUN, tell=log.told, words=question)


def _found(course: Course) -> str:
    """What was found, and what was left open."""
    if not course.answers:
        return "nothing, as nothing was measured"
    last, found = course.answers[-1], course.named()
    left = {"class": f"one of {', '.join(last.effects)}", "none": "nothing wrong", "insufficient": "not settled",
            "unknown": "something that is not in the library"}.get(last.verdict, "")  # fmt: skip
    return ", ".join([*found, *([left] if left and (not found or last.verdict == "class") else [])])


def _limits(rotor: Propeller, on: str, given: Mapping[str, float | None], top_rpm: float, lapse: float) -> Limits:
    """Limits as given, from the case, or asked for."""
    drive = rotor.case.file.drive
    found = {n: v for n, v in given.items() if v is not None and n not in _AIR}
    if drive is not None and drive.esc is not None:
        limit = {} if drive.esc.current_limit_A is None else {"current_A": drive.esc.current_limit_A}
        found = {"largest_us": drive.esc.pulse_max_us, **limit, **found}
    if on == "simulated":
        found = {**_SIMULATED, **found}
    else:
        found |= {name: asked(name, found) for name in ("largest_us", "ramp_us_s", "current_A")}
    limits = Limits(**found, rpm=_ABOVE * top_rpm)
    if not limits.stop_us < limits.largest_us <= 2500.0 or limits.ramp_us_s <= 0.0:
        got = f"{limits.largest_us:g} us, {limits.ramp_us_s:g} us/s"
        raise InputError(Fault("", "largest_us, ramp_us_s", got, "1000 to 2500 us and a rise above 0"))
    return lapsed(limits, lapse)


# The story of a sitting: what was run, what was said after each run, and what was decided; HTML and a picture.
_MOST_RUNS, _MOST = 4, 5  # Runs and explanations in a picture


def write_story(
    out: Path, rotor: Propeller, course: Course, made: Sequence[tuple[str, str]], lines: Sequence[str]
) -> tuple[Path, ...]:  # fmt: skip
    """Write story.html and story.png."""
    if not made:
        return ()
    import matplotlib

    with matplotlib.rc_context(STYLE):
        picture = png(_drawn(rotor, course, made[:_MOST_RUNS]))
    told = [tuple(line.partition(": ")[::2]) for line in lines]
    image = base64.b64encode(picture).decode()
    page = render("bemt.tools.stand", "story.html", title=f"{rotor.name} on the stand", lines=told, image=image)
    write_atomic(out / "story.png", picture)
    write_atomic(out / "story.html", page)
    return out / "story.html", out / "story.png"


def _drawn(rotor: Propeller, course: Course, made: Sequence[tuple[str, str]]) -> Any:
    """Loads over those of the model, run by run, beside the probabilities after each answer."""
    figure, ((*loads, ax),) = blank(3.0, 1, 3)
    for k, (kind, text) in enumerate(made):
        rows = np.genfromtxt(text.splitlines(), delimiter=",", names=True)
        points = rotor.solve(rpm=rows["rpm"], airspeed_m_s=rows["airspeed_m_s"], bands=False)
        for one, name in zip(loads, ("thrust_N", "torque_Nm"), strict=True):
            share, u = (100.0 * rows[n] / np.asarray(getattr(points, name)) for n in (name, f"u_{name}"))
            label = f"{k + 1} {'recording' if kind == 'again' else kind}"
            one.errorbar(rows["rpm"], share - 100.0, u, fmt="o", ms=3, lw=0.8, color=CYCLE[k], label=label)
            one.set(xlabel="speed [rev/min]", title=f"{name.partition('_')[0]} off the model [%]")
    for one in loads:
        one.axhline(0.0, color=GREY, lw=0.8)
    said = [{r.effect or "nothing": r.probability for r in a.ranking} for a in course.answers]
    names = list(dict.fromkeys(n for one in said for n in sorted(one, key=lambda n: -one[n])[:3]))[:_MOST]
    for k, answer in enumerate(said):
        at = np.arange(len(names)) + 0.8 * (k + 0.5) / len(said) - 0.4
        share = [answer.get(n, 0.0) for n in names]
        ax.barh(at, share, 0.7 / len(said), color=CYCLE[k % len(CYCLE)], label=f"answer {k + 1}")
    ax.set(yticks=np.arange(len(names)), yticklabels=names, xlim=(0.0, 1.0), title="probability")
    ax.invert_yaxis()
    for one in (*loads, ax):
        frame(one)
    loads[0].legend()
    ax.legend()
    return figure

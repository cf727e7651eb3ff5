"""The judge asks for a run, the hidden stand makes it, the judge answers again: up to so many times.

The command that an answer recommends is run as printed. A reference is the run that was sealed with the item; a run of
new points is measured on the item's own rotor and stand; a check by hand ("hang dead weights on the cells") says if it
is there. The other road is the fixed programme: a reference, then runs at rest, then runs in wind, whatever the
first answer was.
"""

from __future__ import annotations

import json
import math
import shlex
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.tables import json_text, text_table, write_atomic
from bemt.diagnose.suggest import minutes
from bemt.proof import draw, prove, score, seal
from bemt.proof.items import Bench, further_run
from bemt.proof.rigs import Rig

SCHEMA = "bemt.loop/1"
_SETS = ("single", "sensor", "pair", "null", "mismatch", "unlisted")
_DONE = ("named", "sensor")
_NEW, _REFERENCE = "new_run.csv", "reference.csv"
_FIXED_POINTS = 6


@dataclass(frozen=True)
class Course:
    """How one item went."""

    folder: str  # Item
    answers: list[dict[str, Any]]  # First answer, then one after each run
    steps: list[str] = field(default_factory=list)  # What each step was: ``reference``, ``run`` or ``look``
    minutes: list[float] = field(default_factory=list)  # Time of the stand for each run. [min]
    # Why it ended: "named", "confirmed" by a check, a kind of step that is none of the above, "no run", "used up",
    # "failed"
    end: str = ""


@dataclass
class _Item:
    """An item at work: its files, its bench, and the runs made so far."""

    out: Path
    entry: Mapping[str, Any]
    bench: Bench
    box: Path
    runs: list[list[Mapping[str, float]]] = field(default_factory=list)

    def reference(self) -> int:
        """Bring the reference that was sealed with the item; how many points it has, 0 if there is none."""
        file = self.out / prove.ASKED / str(self.entry["folder"]) / _REFERENCE
        if not file.exists():
            return 0
        words = file.read_text("utf-8")
        write_atomic(self.box / _REFERENCE, words)
        return words.count("\n") - 1

    def run(self, points: Sequence[Mapping[str, float]]) -> str:
        """Measure new points; name of the file, "" if the stand cannot."""
        if self.bench.rows.transient or not points:
            return ""
        words = further_run(self.bench, self.entry, [*self.runs, points])
        if not words:
            return ""
        self.runs.append(list(points))
        name = f"run_{len(self.runs)}.csv"
        write_atomic(self.box / name, words)
        return name


def _recommended(item: _Item, answer: Mapping[str, Any]) -> tuple[str, int, list[str]] | str:
    """Take the step that an answer recommends: its kind, points and the command to run; else why there is none."""
    if answer["verdict"] in _DONE:
        return "named"
    step = answer.get("next_measurement") or {}
    if answer["verdict"] == "none":
        return str(step.get("kind") or "no run")
    taken = _step(item, step)
    if taken == "no reference" and step.get("otherwise"):
        return _step(item, step["otherwise"])
    return taken


def _step(item: _Item, step: Mapping[str, Any]) -> tuple[str, int, list[str]] | str:
    """Take one step."""
    kind, commands = str(step.get("kind", "")), step.get("commands") or ()
    if kind not in ("run", "reference", "look") or not commands:
        return kind or "no run"
    words = shlex.split(commands[0])[1:]
    if kind == "look":
        there = step.get("checks") in item.entry["causes"]
        return ("look", 0, [] if there else words) if step.get("checks") else "no run"
    if kind == "reference":
        points = 0 if (item.box / _REFERENCE).exists() else item.reference()
        return ("reference", points, words) if points else "no reference"
    name = item.run(step["points"])
    return ("run", len(step["points"]), [name if w == _NEW else w for w in words]) if name else "no run"


def programme(rig: Rig) -> list[list[dict[str, float]]]:
    """Runs of the fixed programme after the reference: a sweep at rest, then one in wind."""
    top, R = rig.top_rpm, rig.rotor.radius
    still = [{"rpm": float(n), "airspeed_m_s": 0.0} for n in np.linspace(0.3, 1.0, _FIXED_POINTS) * top]
    J = np.linspace(0.1, (0.9 if rig.duct is None else 0.6) * rig.pitch_ratio, _FIXED_POINTS)
    wind = [{"rpm": 0.6 * top, "airspeed_m_s": float(j) * 0.6 * top / 60.0 * 2.0 * R} for j in J]
    return [still, wind]


def _fixed(item: _Item, number: int) -> tuple[str, int, list[str]] | str:
    """Run ``number`` of the fixed programme."""
    kind, points = "reference", 0
    if number == 0:
        points = 0 if (item.box / _REFERENCE).exists() else item.reference()
    else:
        kind, wanted = "run", programme(item.bench.rig)[number - 1]
        points = len(wanted) if item.run(wanted) else 0
    if not points:
        return "no run"
    known = ["--reference", _REFERENCE] if (item.box / _REFERENCE).exists() else []
    runs = [f"run_{k}.csv" for k in range(1, len(item.runs) + 1)]
    return kind, points, ["diagnose", "recording.csv", *runs, *known, "--case", "case.toml"]


def _course(out: Path, entry: Mapping[str, Any], bench: Bench, first: dict[str, Any], runs: int, fixed: bool) -> Course:
    course = Course(str(entry["folder"]), [first])
    with tempfile.TemporaryDirectory(prefix="bemt-") as box:
        item = _Item(out, entry, bench, Path(box))
        for file in (out / "items" / course.folder).iterdir():
            write_atomic(item.box / file.name, file.read_text("utf-8"))
        end = "used up"
        for number in range(runs):
            made = _fixed(item, number) if fixed else _recommended(item, course.answers[-1])
            if isinstance(made, str):
                if fixed and number < 2:  # no reference can be had: the next run of the programme
                    continue
                end = made
                break
            kind, points, words = made
            course.steps.append(kind)
            course.minutes.append(minutes(kind, points))
            if not words:  # the check has found it
                step = course.answers[-1]["next_measurement"]
                looked_for = step["checks"] or step["otherwise"]["checks"]
                course.answers.append({**course.answers[-1], "verdict": "named", "effects": [looked_for]})
                end = "confirmed"
                break
            answer, _ = prove.asked(item.box, words)
            if answer is None:
                end = "failed"
                break
            course.answers.append(answer)
        else:
            end = "named" if course.answers[-1]["verdict"] in _DONE else end
    return Course(course.folder, course.answers, course.steps, course.minutes, end)


def loop(
    out: Path, runs: int = 3, jobs: int = 2, fixed: bool = False, say: Callable[[str], None] | None = None
) -> dict[str, Any]:  # fmt: skip
    """Follow every item of a finished proof for so many runs; answers are kept in ``loop`` or ``loop_fixed``."""
    key = seal.unseal(out)
    kept = out / ("loop_fixed" if fixed else "loop")
    kept.mkdir(exist_ok=True)
    first, _ = np.random.SeedSequence(int(key["seed"])).spawn(2)
    found = {(b.rig.name, b.plan): b for b in draw.benches(draw.SIZES[key["size"]], first)}
    todo = []
    for entry in key["items"]:
        answer = seal.answer(out / "answers" / f"{entry['folder']}.json")
        if entry["set"] in _SETS and answer:
            todo.append((entry, answer))

    def one(task: tuple[Mapping[str, Any], dict[str, Any]]) -> Course:
        entry, answer = task
        file = kept / f"{entry['folder']}.json"
        if file.exists():
            return Course(**json.loads(file.read_text("utf-8")))
        bench = found[entry["rig"], entry["plan"]]
        course = _course(out, entry, Bench(bench.rig, bench.plan, bench.rows), answer, runs, fixed)
        write_atomic(file, json.dumps(asdict(course)))
        return course

    courses = []
    with ThreadPoolExecutor(jobs) as pool:
        for k, course in enumerate(pool.map(one, todo), 1):
            courses.append(course)
            if say:
                say(f"followed {k}/{len(todo)}")
    document = _scored([e for e, _ in todo], courses, runs, fixed)
    write_atomic(out / f"{kept.name}.json", json_text(document))
    write_atomic(out / f"{kept.name}.txt", text(document) + "\n")
    return document


def _scored(entries: Sequence[Mapping[str, Any]], courses: Sequence[Course], runs: int, fixed: bool) -> dict[str, Any]:
    """What was found after each number of runs, and what it cost."""
    after = []
    for k in range(runs + 1):
        judged = [score.judge(e, c.answers[min(k, len(c.answers) - 1)]) for e, c in zip(entries, courses, strict=True)]
        visible = [j for j in judged if j.entry["set"] in ("single", "sensor") and j.visible]
        pairs = [j for j in judged if j.entry["set"] == "pair" and j.visible]
        nothing = [j for j in judged if j.entry["set"] in ("null", "mismatch")]
        caused = [j for j in judged if j.entry["causes"] and j.entry["set"] != "unlisted" and j.claims]
        spent = [sum(c.minutes[:k]) for e, c in zip(entries, courses, strict=True) if e["causes"]]
        after.append({
            "runs": k,
            "found": _count(j.right and j.answer["verdict"] != "class" for j in visible),
            "found_or_class": _count(j.right for j in visible),
            "pairs": _count(score.in_sets(j) for j in pairs),
            "right_when_claimed": _count(j.right for j in caused),
            "nulls_accused": _count(j.claims for j in nothing),
            "unlisted_named": _count(j.claims for j in judged if j.entry["set"] == "unlisted"),
            "minutes": float(np.mean(spent)) if spent else math.nan,
        })  # fmt: skip
    ends: dict[str, int] = {}
    for c in courses:
        ends[c.end] = ends.get(c.end, 0) + 1
    return {"schema": SCHEMA, "programme": "fixed" if fixed else "recommended", "items": len(courses), "after": after,
            "ends": dict(sorted(ends.items()))}  # fmt: skip


def _count(flags: Any) -> list[int]:
    values = [bool(f) for f in flags]
    return [sum(values), len(values)]


def text(document: Mapping[str, Any]) -> str:
    """Table of a loop."""

    def share(pair: Sequence[int]) -> str:
        return f"{pair[0]}/{pair[1]} ({100 * pair[0] / pair[1]:.0f} %)" if pair[1] else "-"

    keys = ("found", "found_or_class", "pairs", "right_when_claimed", "nulls_accused", "unlisted_named")
    rows = [[str(a["runs"]), *(share(a[k]) for k in keys), f"{a['minutes']:.0f}"] for a in document["after"]]
    header = ["runs", "named", "named or in class", "pairs in sets", "right when it claims", "nulls accused",
              "unlisted named", "stand [min]"]  # fmt: skip
    title = {"fixed": "the fixed programme: a reference, a sweep at rest, a sweep in wind",
             "recommended": "the run that each answer recommends"}[document["programme"]]  # fmt: skip
    ends = ", ".join(f"{k} {n}" for k, n in document["ends"].items())
    return "\n".join([
        f"{document['items']} items, {title}", text_table(header, rows, left=(), indent="  "), f"  ended by: {ends}",
    ])  # fmt: skip

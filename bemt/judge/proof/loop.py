"""The judge asks for a run, the hidden stand makes it, the judge answers again: up to so many runs.

The command that an answer recommends is run as printed, after "none" as after any other answer. A reference is the run
that was sealed with the item; a run of new points, or of the same once more, is measured on the item's own rotor and
stand; a check by hand ("hang dead weights on the cells") says if it is there.

A cause that was named is put aside, and the same is asked again: is there a second one? A fault of stand or set-up is
mended, then everything is recorded once more, which is a run. Any other cause stays and goes into the case of the
recordings (``diagnose --out``), which is none; named again, it goes into the case once more with what was found then in
place of what was. A name that is not at work changes nothing on the hidden stand and stays wrong. The course ends where
nothing is left to find, where the same is named over and over, or without runs.

The other road is the fixed programme: a reference, then runs at rest, then runs in wind, whatever the first answer
was. Its answers stand each for itself.
"""

from __future__ import annotations

import json
import shlex
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from itertools import count, pairwise
from pathlib import Path
from typing import Protocol

import numpy as np

from bemt.base.tables import json_text, write_atomic
from bemt.judge.loss import minutes
from bemt.judge.proof import prove, rows, score
from bemt.judge.proof.causes import CAUSES, Rig
from bemt.judge.proof.course import DONE, MODEL, Course, Loop, scored
from bemt.judge.proof.items import Bench, further_run, recorded_again
from bemt.judge.proof.rows import Entry, Step, ToldAnswer
from bemt.physics import effects

_SETS = ("single", "sensor", "pair", "null", "mismatch", "unlisted")
_NEW, _REFERENCE, _CASE = "new_run.csv", "reference.csv", "case.toml"
_FIXED_POINTS = 6
A_RUN = 0.1
"""Cost of a run, in units of an "insufficient": ten of them are worth one answer; declared."""
# Effects of the air that somebody at the stand sets wrong, and right again: barometer, blade angle and alignment.
_SET_UP = ("air_density", "pitch_offset", "oblique_inflow")


@dataclass(frozen=True)
class _Taken:
    """A step that was taken."""

    kind: str  # As in ``Course.steps``
    minutes: float  # [min]
    words: list[str]  # Command to run; none where the check has found the cause
    aside: list[str] = field(default_factory=list)  # Causes put aside


Points = Sequence[Mapping[str, float]]


class Hand(Protocol):
    """What makes the runs that an answer asks for: the hidden stand of an item, or one behind a wire."""

    def measured(self, kind: str, runs: Sequence[Points] = (), mended: Sequence[str] = (), day: int = 0) -> str:
        """Make a run; the text of its recording, "" where the stand cannot.

        ``again``: the points of the recording; ``reference``: these without the causes that can be taken away; ``run``:
        the last of ``runs``. Causes in ``mended`` are no longer there; each ``day`` has noise of its own.
        """
        ...

    def there(self, name: str) -> bool:
        """Look whether a cause is at work."""
        ...

    def mend(self, names: Sequence[str]) -> Sequence[str]:
        """Put causes right; those that were there."""
        ...


Hands = Callable[[Path, Entry], AbstractContextManager[Hand]]


@dataclass(frozen=True)
class _Hidden:
    """The hidden stand of an item of a proof."""

    out: Path
    entry: Entry
    bench: Bench

    def measured(self, kind: str, runs: Sequence[Points] = (), mended: Sequence[str] = (), day: int = 0) -> str:
        if kind == "reference":
            file = self.out / prove.ASKED / self.entry.folder / _REFERENCE
            return file.read_text("utf-8") if file.exists() else ""
        if kind == "again":
            return recorded_again(self.bench, self.entry, mended, day)
        return "" if self.bench.rows.transient else further_run(self.bench, self.entry, runs, mended, day)

    def there(self, name: str) -> bool:
        return name in self.entry.causes

    def mend(self, names: Sequence[str]) -> Sequence[str]:
        return [n for n in names if n in self.entry.causes]


@dataclass
class _Item:
    """An item at work: its files, its stand, the runs made so far, and the command that was answered last."""

    hand: Hand
    box: Path
    left: int  # Runs
    words: list[str] = field(default_factory=list)
    runs: list[Points] = field(default_factory=list)
    days: int = 0  # How often everything was recorded once more
    aside: list[str] = field(default_factory=list)
    mended: list[str] = field(default_factory=list)

    def reference(self) -> int:
        """Bring the reference; how many points it has, 0 if there can be none."""
        words = self.hand.measured("reference")
        if words:
            write_atomic(self.box / _REFERENCE, words)
        return words.count("\n") - 1 if words else 0

    def run(self, points: Points) -> str:
        """Measure new points; name of the file, "" if the stand cannot."""
        words = self.hand.measured("run", [*self.runs, points], self.mended, len(self.mended)) if points else ""
        if not words:
            return ""
        self.runs.append(list(points))
        name = f"run_{len(self.runs)}.csv"
        write_atomic(self.box / name, words)
        return name

    def mend(self, names: Sequence[str]) -> int:
        """Take causes away, those that are there, and record everything once more; how many points that is."""
        self.mended += self.hand.mend(names)
        self.days, points = self.days + 1, 0
        texts = {"recording.csv": self.hand.measured("again", [], self.mended, self.days)}
        for k in range(1, len(self.runs) + 1):
            texts[f"run_{k}.csv"] = self.hand.measured("run", self.runs[:k], self.mended, self.days)
        for name, words in texts.items():
            if not words:
                return 0
            write_atomic(self.box / name, words)
            points += words.count("\n") - 1
        return points

    def model(self, only: Sequence[str]) -> list[str]:
        """Command with what was named in the case of the recordings, as ``diagnose --out`` writes it; [] if it is not.

        ``only`` are effects that a check has found, where the answer did not name them.
        """
        home = f"improved_{len(self.aside)}"
        asked = [*self.words, *(["--only", *only] if only else []), "--out", home, "--no-figures"]
        prove.asked(self.box, asked)
        file = f"{home}/{_CASE}"
        if not (self.box / file).exists():
            return []
        return [file if before == "--case" else w for before, w in pairwise(["", *self.words])]

    def of_its_own(self, words: Sequence[str]) -> list[str]:
        """Command whose reference keeps the first case if it was made without what was put into the other one."""
        known = (CAUSES.get(n) for n in self.aside if not _at_the_stand(n))
        if all(c is not None and not c.removable for c in known):
            return list(words)
        if "--reference" in words and "--reference-case" not in words and _CASE not in words:
            return [*words, "--reference-case", _CASE]
        return list(words)


def _recommended(item: _Item, answer: ToldAnswer) -> _Taken | str:
    """Take the step that follows from an answer; else say why there is none."""
    step = answer.step
    if answer.verdict in DONE:
        return _put_aside(item, answer.effects, answer.confirmed)
    if step.kind == "look" and not step.checks:  # of a class, the fault that is sure is to be put right
        return _put_aside(item, [s[0] for s in answer.sets if len(s) == 1 and _at_the_stand(s[0])], False)
    taken = _step(item, step)
    if taken in ("no reference", "no run", "mend", "case") and step.otherwise:
        taken = _step(item, step.otherwise)
    return "none" if answer.verdict == "none" and taken == "no run" else taken


def _put_aside(item: _Item, names: Sequence[str], by_check: bool) -> _Taken | str:
    """Mend or model what was named, as far as it is new."""
    # what is in the case is fitted as a whole when it is named again; once, since it may hide another cause
    new = [n for n in names if item.aside.count(n) < (1 if _at_the_stand(n) else 2)]
    if not new:
        return "named again" if names else "no run"
    faults = [n for n in new if _at_the_stand(n)]
    if faults and not item.left:
        return "used up"
    others = [n for n in new if n not in faults]
    words = item.model(new if by_check else []) if others else list(item.words)
    if not words:
        return "named"
    item.aside += new
    if not faults:
        return _Taken(MODEL, 0.0, words, new)
    points = item.mend(faults)
    if not points:
        return "no run"
    # what was put right is known to be right
    return _Taken("mend", minutes("look", 0) + minutes("run", points), [*words, "--ruled-out", *faults], new)


def _at_the_stand(name: str) -> bool:
    """Whether somebody at the stand can put a cause right."""
    known = effects.catalogue()
    return name in _SET_UP or (name in known and known[name].kind == "stand")


def _step(item: _Item, step: Step) -> _Taken | str:
    kind, commands = step.kind, step.commands
    if kind not in ("run", "reference", "look") or not commands:
        return kind or "no run"
    if not item.left:
        return "used up"
    words = shlex.split(commands[0])[1:]
    if kind == "look":
        if not step.checks:
            return "no run"
        there = step.checks not in item.mended and item.hand.there(step.checks)
        return _Taken(kind, minutes(kind, 0), [] if there else words)
    if kind == "reference":
        points = 0 if (item.box / _REFERENCE).exists() else item.reference()
        return _Taken(kind, minutes(kind, points), words) if points else "no reference"
    name = item.run(step.points)
    took = minutes(kind, len(step.points))
    return _Taken(kind, took, [name if w == _NEW else w for w in words]) if name else "no run"


def programme(rig: Rig) -> list[list[dict[str, float]]]:
    """Runs of the fixed programme after the reference: a sweep at rest, then one in wind."""
    top, R = rig.top_rpm, rig.rotor.radius
    still = [{"rpm": float(n), "airspeed_m_s": 0.0} for n in np.linspace(0.3, 1.0, _FIXED_POINTS) * top]
    J = np.linspace(0.1, (0.9 if rig.duct is None else 0.6) * rig.pitch_ratio, _FIXED_POINTS)
    wind = [{"rpm": 0.6 * top, "airspeed_m_s": float(j) * 0.6 * top / 60.0 * 2.0 * R} for j in J]
    return [still, wind]


def _fixed(item: _Item, number: int, wanted: Sequence[Points]) -> _Taken | str:
    """Run ``number`` of the fixed programme."""
    kind, points = "reference", 0
    if number == 0:
        points = 0 if (item.box / _REFERENCE).exists() else item.reference()
    else:
        kind, asked = "run", wanted[number - 1]
        points = len(asked) if item.run(asked) else 0
    if not points:
        return "no run"
    known = ["--reference", _REFERENCE] if (item.box / _REFERENCE).exists() else []
    runs = [f"run_{k}.csv" for k in range(1, len(item.runs) + 1)]
    return _Taken(kind, minutes(kind, points), ["diagnose", "recording.csv", *runs, *known, "--case", _CASE])


def _course(
    out: Path, entry: Entry, bench: Bench, first: ToldAnswer, runs: int, fixed: bool, hand: Hand | None = None
) -> Course:  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="bemt-") as box:
        for file in (out / "items" / entry.folder).iterdir():
            write_atomic(Path(box) / file.name, file.read_text("utf-8"))
        if hand is not None:  # everything is measured by it, the first recording, too
            write_atomic(Path(box) / "recording.csv", hand.measured("again"))
            if (Path(box) / _REFERENCE).exists():
                write_atomic(Path(box) / _REFERENCE, hand.measured("reference"))
            first, words = prove.asked(Path(box), prove.question(Path(box)))
            if not first:
                raise RuntimeError(f"item {entry.folder}: {words}")
        wanted = programme(bench.rig) if fixed else None
        enough = 0.0 if hand is None else A_RUN
        found = follow(Path(box), first, hand or _Hidden(out, entry, bench), runs, wanted=wanted, enough=enough)
        return replace(found, folder=entry.folder)


def follow(
    box: Path, first: ToldAnswer, hand: Hand, runs: int, *, wanted: Sequence[Points] | None = None, enough: float = 0.0,
    tell: Callable[[Course], None] | None = None, words: Sequence[str] = (),
) -> Course:  # fmt: skip
    """Take the step that follows from each answer, for so many runs.

    Parameters
    ----------
    box : Path
        Folder with recording.csv, case.toml and perhaps reference.csv, as in ``first``; runs are added.
    first : ToldAnswer
        ToldAnswer on these.
    hand : Hand
        What makes the runs.
    runs : int
        Most runs.
    wanted : sequence, optional
        Runs of a fixed programme instead, after a reference.
    enough : float
        Expected loss of "none" below which no further run is worth its cost. [one "insufficient"]
    tell : callable, optional
        Called with the course after each answer.
    words : sequence of str, optional
        Command that was answered first; that of a proof by default.
    """
    course, item = Course("", [first]), _Item(hand, box, runs, [*words] or prove.question(box))
    for number in count():
        last = course.answers[-1]
        if wanted is not None and number == runs:
            return replace(course, end="used up")
        loss = dict(last.whole.get("expected_loss") or {}).get(last.verdict)
        if wanted is None and last.verdict == "none" and isinstance(loss, int | float) and loss < enough:
            return replace(course, end="none")
        taken = _recommended(item, last) if wanted is None else _fixed(item, number, wanted)
        if isinstance(taken, str):
            if wanted is not None and number < 2:  # no reference can be had: the next run of the programme
                continue
            return replace(course, end=taken)
        item.left -= taken.kind != MODEL
        course.steps.append(taken.kind)
        course.minutes.append(taken.minutes)
        course.aside.append(taken.aside)
        if taken.words:
            item.words = item.of_its_own(taken.words)
            answer, _ = prove.asked(box, item.words)
            if not answer:
                return replace(course, end="failed")
        else:  # the check has found it
            looked_for = last.step.checks or (last.step.otherwise or Step()).checks or ""
            answer = replace(last, verdict="named", effects=(looked_for,), confirmed=True)
        course.answers.append(answer)
        if tell:
            tell(course)
    raise AssertionError("a course has an end")


def loop(
    out: Path, runs: int = 3, jobs: int = 2, fixed: bool = False, say: Callable[[str], None] | None = None,
    hands: Hands | None = None,
) -> Loop:  # fmt: skip
    """Follow every item of a finished proof for so many runs; answers are kept in ``loop`` or ``loop_fixed``.

    With ``hands`` everything is measured by these, in ``loop_wired``; the loop then ends where a run is not worth it.
    """
    key = rows.unseal(out)
    kept = out / "_".join(["loop", *(["fixed"] if fixed else []), *(["wired"] if hands else [])])
    kept.mkdir(exist_ok=True)
    benches = prove.benches_of(key)
    told = ((e, rows.stored(out / "answers" / f"{e.folder}.json").answer) for e in sorted(key.items, key=_rank))
    todo = [(entry, answer) for entry, answer in told if entry.set in _SETS and answer]

    def one(task: tuple[Entry, ToldAnswer]) -> Course:
        entry, answer = task
        file = kept / f"{entry.folder}.json"
        if file.exists():
            return Course.of(json.loads(file.read_text("utf-8")))
        bench = benches[entry.rig, entry.plan]
        mine = Bench(bench.rig, bench.plan, bench.rows)
        with nullcontext() if hands is None else hands(out, entry) as hand:
            course = _course(out, entry, mine, answer, runs, fixed, hand)
        write_atomic(file, json.dumps(course.document()))
        return course

    courses = prove.on_threads(one, todo, jobs, prove.teller("followed", say))
    found = scored([e for e, _ in todo], courses, runs, fixed)
    write_atomic(out / f"{kept.name}.json", json_text(found.document()))
    write_atomic(out / f"{kept.name}.txt", found.text + "\n")
    return found


def _rank(entry: Entry) -> int:
    """Place of an item in the order of work: visible pairs, the others in mixed order, last what no plan can see."""
    if not entry.causes or entry.set == "unlisted":
        return 1
    return (0 if entry.set == "pair" else 1) if score.judge(entry, ToldAnswer()).separation >= score.VISIBLE else 2

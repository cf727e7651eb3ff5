"""How items of a proof went whose recommended steps were taken, and what was found after so many runs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from bemt.base.document import Documented
from bemt.base.tables import text_table
from bemt.judge.proof import score
from bemt.judge.proof.rows import Entry, ToldAnswer

LOOP_SCHEMA = "bemt.loop/1"
DONE = ("named", "sensor")
"""Verdicts that name what is at work."""
MODEL = "model"
"""Step that puts a cause into the case: no run."""


@dataclass(frozen=True)
class Course:
    """How one item went."""

    folder: str  # Item
    answers: list[ToldAnswer]  # First answer, then one after each step
    # What each step was: ``reference``, ``run``, ``look``, ``mend`` (recorded once more without what was named) or
    # ``model`` (into the case, no run)
    steps: list[str] = field(default_factory=list)
    minutes: list[float] = field(default_factory=list)  # Time of the stand for each step. [min]
    aside: list[list[str]] = field(default_factory=list)  # Causes that each step put aside
    # Why it ended: "none" is left to find, "named" and nothing to be done about it, "named again", a kind of step that
    # the loop cannot take, "no run", "used up", "failed"
    end: str = ""

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Course:
        """Course that was kept."""
        return cls(**{**document, "answers": [ToldAnswer.from_document(a) for a in document["answers"]]})

    def document(self) -> Mapping[str, object]:
        """The course to be kept."""
        return {**vars(self), "answers": [a.document() for a in self.answers]}

    def after(self, runs: int) -> int:
        """Place of the last answer that so many runs gave."""
        used = np.cumsum([0, *(step != MODEL for step in self.steps)])
        return int(np.count_nonzero(used[: len(self.answers)] <= runs)) - 1

    def named(self, at: int | None = None) -> list[str]:
        """Causes that were named up to an answer, all by default, in order."""
        last = (self.answers if at is None else self.answers[: at + 1])[-1:]
        said = [*self.aside[:at], *(a.effects for a in last if a.verdict in DONE)]
        return list(dict.fromkeys(n for some in said for n in some))


class After(Documented):
    """What was found after so many runs, each of how many, and the time of the stand [min]."""

    runs: int
    found: tuple[int, int]
    found_or_class: tuple[int, int]
    pairs_named: tuple[int, int]
    pairs: tuple[int, int]
    right_when_claimed: tuple[int, int]
    nulls_accused: tuple[int, int]
    unlisted_named: tuple[int, int]
    minutes: float


class Loop(Documented):
    """Document of a loop."""

    schema: str
    programme: str
    items: int
    after: tuple[After, ...]
    ends: Mapping[str, int]

    @property
    def text(self) -> str:
        """Table of a loop."""

        def share(pair: Sequence[int]) -> str:
            return f"{pair[0]}/{pair[1]} ({100 * pair[0] / pair[1]:.0f} %)" if pair[1] else "-"

        rows = [[str(a.runs), *map(share, (a.found, a.found_or_class, a.pairs_named, a.pairs, a.right_when_claimed,
                 a.nulls_accused, a.unlisted_named)), f"{a.minutes:.0f}"] for a in self.after]  # fmt: skip
        header = ["runs", "named", "named or in class", "pairs named", "pairs in sets", "right when it claims",
                  "nulls accused", "unlisted named", "stand [min]"]  # fmt: skip
        title = {"fixed": "the fixed programme: a reference, a sweep at rest, a sweep in wind",
                 "recommended": "the step that follows from each answer"}[self.programme]  # fmt: skip
        ends = ", ".join(f"{k} {n}" for k, n in self.ends.items())
        return "\n".join([
            f"{self.items} items, {title}", text_table(header, rows, left=(), indent="  "), f"  ended by: {ends}",
        ])  # fmt: skip


def _named(entry: Entry, course: Course, at: int) -> list[str]:
    """What a course has named up to an answer; of names for one cause, which the plan cannot tell apart, one."""
    names = course.named(at)
    allowed = entry.allowed
    if not all(any(n in a for a in allowed) for n in names):
        return names
    of_each = [[n for n in names if n in a] or [""] for a in allowed]
    return max((list(filter(None, dict.fromkeys(some))) for some in product(*of_each)), key=len)


def judge(entry: Entry, course: Course, runs: int) -> tuple[score.Judged, bool]:
    """Judge what a course has said after so many runs, and whether what it named is what is at work.

    Everything that was named counts, and so does the class of the last answer: where nothing is left to find, that is a
    wrong claim, but what was named before stays found.
    """
    at = course.after(runs)
    last, names = course.answers[at], _named(entry, course, at)
    if not names:
        return score.judge(entry, last), False
    sets = tuple((n,) for n in names)
    named = score.judge(entry, replace(last, verdict="named", effects=tuple(names), sets=sets))
    # a class with what was put aside in it asks for no second cause
    if last.verdict != "class" or set(names) & set(last.effects):
        return named, named.right
    there = {c for c, allowed in zip(entry.causes, entry.allowed, strict=True) if not allowed & set(names)}
    right = bool(there & set(last.effects)) and set().union(*entry.allowed) >= set(names)
    said = replace(last, effects=(*names, *last.effects), sets=(*sets, last.effects))
    return replace(named, right=right, answer=said), named.right


def scored(entries: Sequence[Entry], courses: Sequence[Course], runs: int, fixed: bool) -> Loop:
    """What was found after each number of runs, and what it cost."""
    ends = Counter(c.end for c in courses)
    programme = "fixed" if fixed else "recommended"
    after = tuple(_after(list(zip(entries, courses, strict=True)), k) for k in range(runs + 1))
    return Loop(LOOP_SCHEMA, programme, len(courses), after, dict(sorted(ends.items())))


def _after(of_each: Sequence[tuple[Entry, Course]], k: int) -> After:
    judged = [judge(e, c, k) for e, c in of_each]

    def of(*sets: str, seen: bool = False) -> list[tuple[score.Judged, bool]]:
        return [(j, exact) for j, exact in judged if j.entry.set in sets and (j.visible or not seen)]

    visible, pairs = of("single", "sensor", seen=True), of("pair", seen=True)
    caused = [j for j, _ in judged if j.entry.causes and j.entry.set != "unlisted" and j.claims]
    spent = [sum(c.minutes[: c.after(k)]) for e, c in of_each if e.causes]
    return After(
        runs=k,
        found=_count(exact for _, exact in visible),
        found_or_class=_count(exact or j.right for j, exact in visible),
        pairs_named=_count(exact for _, exact in pairs),
        pairs=_count(exact or score.in_sets(j) for j, exact in pairs),
        right_when_claimed=_count(j.right for j in caused),
        nulls_accused=_count(j.claims for j, _ in of("null", "mismatch")),
        unlisted_named=_count(j.claims for j, _ in of("unlisted")),
        minutes=float(np.mean(spent)) if spent else math.nan,
    )  # fmt: skip


def _count(flags: Iterable[bool]) -> tuple[int, int]:
    values = list(flags)
    return sum(values), len(values)

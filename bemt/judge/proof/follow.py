"""The step that a silent answer recommends, taken on published recordings, and what is said then.

A pair is followed where somebody took the step (``pairs.toml``). Of a single recording of a density or unit slip the
step is a reference: every other point as the stand would have read it without the cause.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.document import Documented
from bemt.base.tables import json_text, text_table, write_atomic
from bemt.judge.proof import prove, rows, score
from bemt.judge.proof.items import recording_text
from bemt.judge.proof.real import DENSITY, POUND, WRONG_DENSITY, followed, pair_files
from bemt.judge.proof.rows import Entry

SCHEMA = "bemt.followed/1"
_SILENT = ("none", "unknown", "insufficient")
# Factors on thrust and torque that undo the cause.
_UNDONE = {
    "real density": {"thrust_N": WRONG_DENSITY / DENSITY, "torque_Nm": WRONG_DENSITY / DENSITY},
    "real slip": {"thrust_N": POUND},
}


def with_reference(folder: Path, undone: Mapping[str, float]) -> dict[str, str]:
    """Files of an item with every other point as a reference without the cause."""
    given = {n: (folder / n).read_text("utf-8") for n in ("recording.csv", "case.toml", "stations.csv")}
    rows = list(csv.DictReader(io.StringIO(given["recording.csv"])))
    columns = {k: np.array([float(row[k]) for row in rows]) for k in rows[0]}
    test = {k: v[1::2] for k, v in columns.items()}
    known = {k: v[::2] * undone.get(k, 1.0) for k, v in columns.items()}
    return given | {"recording.csv": recording_text(test), "reference.csv": recording_text(known)}


def _asked_again(out: Path, entry: Entry) -> tuple[str, dict[str, str]] | None:
    """Step and files of an item that was silent; None where nobody took the step."""
    if entry.set in _UNDONE:
        return "a reference without the cause", with_reference(out / "items" / entry.folder, _UNDONE[entry.set])
    if entry.plan == "pair" and not entry.set.endswith("case"):
        for way in followed():
            if " | ".join(way.of) == entry.rig:
                files = pair_files(*way.ab)
                return None if files is None else (way.step, files)
    return None


class FollowedItem(Documented):
    """A silent item, the step that was taken, and the answers before and after it in a word."""

    set: str
    rig: str
    before: str
    step: str
    after: str
    said: Mapping[str, Any]  # Verdict and effects after the step, nothing where it failed
    error: str


class FollowedItems(Documented):
    """Document of the steps."""

    schema: str
    followed: tuple[FollowedItem, ...]


def follow(out: Path, jobs: int = 2, say: Callable[[str], None] | None = None) -> FollowedItems:
    """Take the steps for all silent items of a proof of published recordings."""
    key = rows.unseal(out)
    todo = []
    for entry in key.items:
        answer = rows.stored(out / "answers" / f"{entry.folder}.json").answer
        if not entry.causes or not answer:
            continue
        before = score.answered(score.judge(entry, answer))
        again = _asked_again(out, entry) if before in _SILENT else None
        if again is not None:
            todo.append((entry, before, *again))

    def one(task: tuple[Entry, str, str, dict[str, str]]) -> FollowedItem:
        entry, before, step, files = task
        folder = out / "followed" / entry.folder
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            write_atomic(folder / name, content)
        answer, error = prove.diagnose_folder(folder)
        after = score.answered(score.judge(entry, answer))
        said = {"verdict": answer.verdict, "effects": answer.effects} if answer else {}
        return FollowedItem(entry.set, entry.rig, before, step, after, said, "" if answer else error[-500:])

    found = prove.on_threads(one, todo, jobs, prove.teller("followed", say))
    told = FollowedItems(SCHEMA, tuple(found))
    write_atomic(out / "followed.json", json_text(told.document()))
    write_atomic(out / "followed.txt", text(told) + "\n")
    return told


def text(told: FollowedItems) -> str:
    """Table of the steps."""
    found = told.followed
    words = ("found", "class", "none", "unknown", "insufficient", "wrong", "failed")
    rows = []
    for kind in sorted({r.set for r in found}):
        some = [r.after for r in found if r.set == kind]
        rows.append([kind, str(len(some)), *(str(some.count(w)) for w in words)])
    right = sum(r.after in ("found", "class") for r in found)
    head = f"{len(found)} open answers followed by the step they recommend: {right} right or in a class"
    each = [[r.set, r.rig, r.before, r.step, f"{r.after}: {', '.join(r.said.get('effects', ()))}"]
            for r in found]  # fmt: skip
    return "\n\n".join([
        head, text_table(["set", "followed", *words], rows, left=(0,), indent="  "),
        text_table(["set", "item", "before", "step", "after"], each, left=(0, 1, 2, 3, 4), indent="  "),
    ])  # fmt: skip

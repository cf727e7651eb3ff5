"""The promise of the real pairs: a manifest of what differs, no copy of the data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bemt.data.recordings.load import import_file
from bemt.judge.compare.drive_laws import LAWS
from bemt.judge.diagnose.contrast import compare
from bemt.judge.proof import prove, score
from bemt.judge.proof.items import Item
from bemt.judge.proof.real import draw_pairs, pairs
from bemt.physics.effects import catalogue
from bemt.rotors.case import load_case


@pytest.fixture(scope="module")
def drawn(shared_data: Path) -> list[Item]:
    return list(draw_pairs())


def test_every_pair_says_what_differs_and_where_it_is_known_from() -> None:
    known = {*catalogue(), *(row.id for row in LAWS)}
    found = pairs()
    assert len(found) > 60 and sum(not p.causes for p in found) > 12
    for p in found:
        assert {*p.causes, *p.alike} <= known and p.reason and p.a != p.b


def test_pairs_are_recordings_that_can_be_read_and_do_not_tell_their_cause(drawn: list[Item], tmp_path: Path) -> None:
    assert len(drawn) == len(pairs())
    for k, item in enumerate(drawn[::9]):
        folder = tmp_path / str(k)
        folder.mkdir()
        for name, text in item.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        for name in ("recording.csv", "reference.csv"):
            channels = import_file(str(folder / name)).values
            assert {"thrust_N", "torque_Nm"} & set(channels) and np.isfinite(channels["rpm"]).all()
        if "case.toml" in item.files:
            load_case(folder / "case.toml").rotor()
        words = "".join(item.files.values()).replace('kind = "propeller"', "")
        assert not [c for c in item.entry.causes if c in words]


def test_a_pair_is_answered_by_a_process_of_its_own(drawn: list[Item], tmp_path: Path) -> None:
    item = next(i for i in drawn if i.entry.set == "pair density, recorded")
    for name, text in item.files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    answer, words = prove.diagnose_folder(tmp_path)
    assert answer, words
    assert answer.whole["schema"] == "bemt.comparison/1"
    assert score.answered(score.judge(item.entry, answer)) == "found"


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_runs_of_one_stand_that_nobody_touched_agree(drawn: list[Item], tmp_path: Path, every: int) -> None:
    said = []
    for k, item in enumerate([i for i in drawn if i.entry.set == "pair null"][::every]):
        folder = tmp_path / str(k)
        folder.mkdir()
        for name, text in item.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        said.append(compare(folder / "reference.csv", folder / "recording.csv").verdict)
    assert not {"named", "sensor", "class"} & set(said)
    assert said.count("none") >= 0.8 * len(said)

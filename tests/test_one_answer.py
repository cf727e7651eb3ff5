"""One file, one answer, at every door that compares recordings."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from diagnosing import case, points, recording

import bemt
from bemt.app.cli import main
from bemt.base.errors import EXIT_OK, InputError
from bemt.physics.dataset import Dataset
from bemt.rotors.propeller import rotor_of

CASE = str(Path(__file__).resolve().parent.parent / "cases" / "prop_8x5")
CHANGES: list[tuple[float, float]] = [(1.0, 1.0), (1.08, 1.0), (1.1, 1.1), (0.93, 0.97), (1.0, 0.85)]
MORE = [(a, b) for a in (0.85, 0.95, 1.05, 1.2, 1.5) for b in (0.85, 0.95, 1.0, 1.05, 1.2)]


def written(path: Path, seed: int, thrust: float, torque: float) -> str:
    """A recording of the case with loads off by two factors."""
    r: Dataset = recording(case(), points("static"), seed=seed)
    columns = {k: r[k] for k in ("rpm", "thrust_N", "torque_Nm")}
    columns["thrust_N"], columns["torque_Nm"] = thrust * columns["thrust_N"], torque * columns["torque_Nm"]
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{v:.8g}" for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return str(path)


@pytest.mark.parametrize("change", [*CHANGES[:2], *(pytest.param(c, marks=pytest.mark.slow)
                                                    for c in CHANGES[2:] + MORE)])  # fmt: skip
def test_diagnose_compare_and_the_library_agree(
    change: tuple[float, float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = written(tmp_path / "a.csv", 1, 1.0, 1.0), written(tmp_path / "b.csv", 2, *change)
    said = []
    for words in (["diagnose", b, "--reference", a], ["compare", a, b]):
        assert main([*words, "--case", CASE, "--json"]) == EXIT_OK
        doc = json.loads(capsys.readouterr().out)
        said.append((doc["verdict"], tuple(doc["effects"]), round(doc["probability"], 6)))
    answer = bemt.diagnose(b, bemt.load(CASE), reference=a)
    assert said[0] == said[1]
    assert said[0][:2] == (answer.verdict, answer.effects)
    if change == (1.0, 1.0):
        assert said[0][0] == "none"


def test_a_report_beside_a_reference_says_what_diagnose_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = written(tmp_path / "a.csv", 1, 1.0, 1.0), written(tmp_path / "b.csv", 2, *CHANGES[1])
    assert main(["diagnose", b, "--reference", a, "--case", CASE, "--json"]) == EXIT_OK
    said = json.loads(capsys.readouterr().out)
    out = tmp_path / "out"
    assert main(["report", CASE, "--recording", b, "--reference", a, "--out", str(out), "--quiet"]) == EXIT_OK
    told = json.loads((out / "prop_8x5" / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    assert not {k for k in ("verdict", "effects", "probability", "next_measurement") if told[k] != said[k]}


@pytest.mark.parametrize(("word", "said"), [
    ("nowhere/prop_8x5", "no such file or folder"), ("10x5.toml", "no such file or folder"),
    ("nix", "no folder or case of this name, and no label"), ("10x5ZZ", "label"),
])  # fmt: skip
def test_a_word_that_is_no_rotor_says_what_it_is_not(word: str, said: str) -> None:
    """A path is never a label."""
    with pytest.raises(InputError, match=said):
        rotor_of(word)


def test_a_path_is_no_label_at_the_doors_of_labels(tmp_path: Path) -> None:
    word = "nowhere/prop_8x5"
    for door in (lambda: bemt.estimate(word, 6000), lambda: bemt.new(word, out=tmp_path / "a")):
        with pytest.raises(InputError, match="path is a case"):
            door()


def test_units_that_are_stated_count_as_those_in_the_headings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named, bare = (tmp_path / name for name in ("named", "bare"))
    said = []
    for folder, stated in ((named, []), (bare, ["--unit", "thrust=N", "torque=Nm"])):
        folder.mkdir()
        files = [written(folder / "b.csv", 2, *CHANGES[1]), written(folder / "a.csv", 1, 1.0, 1.0)]
        for file in files if stated else []:
            text = Path(file).read_text("utf-8").replace("thrust_N", "thrust").replace("torque_Nm", "torque")
            Path(file).write_text(text, "utf-8")
        assert main(["diagnose", files[0], "--reference", files[1], "--case", CASE, *stated]) == EXIT_OK
        said.append(capsys.readouterr().out.splitlines()[:3])
    assert said[0] == said[1] and "against the reference" in " ".join(said[0])

"""The promise of the command `diagnose`: one answer in a folder, nobody's own files lost."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from diagnosing import CASES, case, points, recording

from bemt.case import load_case
from bemt.cli import build_parser, main
from bemt.evaluate import prepare


def _recorded(path: Path, noise_seed: int) -> str:
    series = recording(case(), points("grid"), seed=noise_seed)
    columns = {**series.values, **{f"u_{k}": v for k, v in series.u.items()}}
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return str(path)


def test_an_improved_case_stands_as_long_as_its_answer_does(tmp_path: Path) -> None:
    file, out = _recorded(tmp_path / "log.csv", 0), tmp_path / "out"
    plain = ["--out", str(out), "--no-figures", "--quiet"]
    assert main(["diagnose", file, "--case", str(CASES / "prop_8x5"), "--off", "compressibility", *plain]) == 0
    answer = json.loads((out / "diagnosis.json").read_text())
    assert (answer["verdict"], answer["effects"]) == ("named", ["compressibility"])
    assert "compressibility" in [e.id for e in prepare(load_case(out)).effects]
    assert main(["diagnose", file, "--case", str(CASES / "prop_8x5"), *plain]) == 0
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "none"
    assert not (out / "case.toml").exists()


def test_a_case_of_the_users_own_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, own = _recorded(tmp_path / "log.csv", 0), tmp_path / "prop_8x5"
    shutil.copytree(CASES / "prop_8x5", own)
    before = {p.name: p.read_bytes() for p in own.iterdir()}
    arguments = ["diagnose", file, "--case", str(own), "--off", "compressibility", "--out", str(own), "--quiet"]
    assert main(arguments) == 2
    assert "--out: got a folder with a case of its own" in capsys.readouterr().err
    assert {p.name: p.read_bytes() for p in own.iterdir()} == before


def test_an_option_of_several_words_may_be_given_again() -> None:
    """`--case A --case B` took the last one only, and said so nowhere."""
    parse = build_parser().parse_args
    for words in (["--case", "a", "b", "--reference", "q"], ["--case", "a", "--case", "b", "--reference", "q"]):
        args = parse(["diagnose", "x.csv", "y.csv", *words])
        assert (args.case, args.reference, args.recordings) == (["a", "b"], ["q"], ["x.csv", "y.csv"])
    assert parse(["export", "c", "--out", "o", "--format", "stl", "--format", "step"]).format == ["stl", "step"]
    assert parse(["diagnose", "x.csv", "--case", "a"]).reference == []

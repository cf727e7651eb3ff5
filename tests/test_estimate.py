"""The promise of `estimate`: a label in, the answer of the library out, with bands; what is doubtful is said."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

import bemt
from bemt.app import cli
from bemt.base.units import INCH
from bemt.physics import k1k2
from bemt.physics.air import Air


def told(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    assert cli.main(["estimate", *words, "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_the_document_is_the_library_s_answer_with_k1k2_beside_it(capsys: pytest.CaptureFixture[str]) -> None:
    doc = told(capsys, "10x4.7x3", "--rpm", "5000", "100", "--airspeed-m-s", "0", "30")
    assert doc["schema"] == "bemt.estimate/2" and doc["given"]["blades"] == 3
    rows = doc["rows"]
    assert [(r["rpm"], r["airspeed_m_s"]) for r in rows] == [(5000, 0), (5000, 30), (100, 0), (100, 30)]
    points = bemt.propeller("10x4.7x3").solve([5000, 5000, 100, 100], [0, 30, 0, 30])
    simple = k1k2.estimate(10 * INCH, 4.7 * INCH, 5000.0, 30.0, Air.from_density(1.225))
    for i, row in enumerate(rows):
        for name in ("thrust_N", "power_W", "CT", "CP", "J"):
            assert row[name] == pytest.approx(points[name][i], rel=1e-6), name
        for name in ("thrust_N", "power_W"):
            assert row[f"u_{name}"] == pytest.approx(points.u[name][i], rel=1e-6)
            assert row[f"u95_{name}"] > 1.9 * row[f"u_{name}"]
        assert row["flags"] == list(points.flags[i])
    assert any("zero thrust" in flag for flag in rows[3]["flags"])  # J 70
    assert rows[1]["k1k2_thrust_N"] == pytest.approx(simple.thrust_N[0], rel=1e-6)


def test_what_is_doubtful_is_printed_once_with_its_count(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["estimate", "14x8", "--rpm", "20000", "3000"]) == 0
    out = capsys.readouterr().out
    assert out.count("supersonic") == 1 and "1 of 2 points: supersonic" in out and len(out.splitlines()) < 24


def test_what_was_measured_narrows_the_band_and_is_no_unknown(capsys: pytest.CaptureFixture[str]) -> None:
    wide, chord, both = (
        told(capsys, "10x5", "--rpm", "6000", *more)["rows"][0]
        for more in ((), ("--chord-mm", "19"), ("--chord-mm", "19", "--measured-pitch-in", "5.1"))
    )
    assert chord["u_thrust_N"] < 0.8 * wide["u_thrust_N"] and both["u_thrust_N"] < 0.9 * wide["u_thrust_N"]
    steeper = told(capsys, "10x5", "--rpm", "6000", "--measured-pitch-in", "6")["rows"][0]
    flatter = told(capsys, "10x5", "--rpm", "6000", "--measured-pitch-in", "4")["rows"][0]
    assert flatter["thrust_N"] < wide["thrust_N"] < steeper["thrust_N"]


def test_labels_of_one_propeller_give_one_answer(capsys: pytest.CaptureFixture[str]) -> None:
    for one, other in (("10x4.5", "1045"), ("13x6.5", "13x65"), ("5x4.3x3", "HQ5x4.3x3")):
        a, b = (told(capsys, label, "--rpm", "6000") for label in (one, other))
        assert a["rows"] == b["rows"]
    for label in ("5x4.3", "6x4", "5x4.5", "8x5"):
        a, b = (told(capsys, *words, "--rpm", "6000") for words in ((f"{label}x3",), (label, "--blades", "3")))
        assert a["rows"] == b["rows"], label


WRONG = ("8x5x3", "--blades", "2", "--density-kg-m3", "1225")


@pytest.mark.parametrize(("words", "message"), [
    (("10x100", "--rpm", "5000"), "Meant 10x10?"),
    ((*WRONG, "--rpm", "1"), "--blades: got 2; expected 3, as in 8x5x3."),
    ((*WRONG, "--rpm", "1"), "--density-kg-m3: got 1225; expected 0.01 to 10 kg/m3"),
    (("5x3", "--rpm", "-1", "--chord-mm", "300"), "--chord-mm: got 300; expected 0.02 to 0.4 diameters, 2.54 to 50.8"),
    (("5x3", "--rpm", "-1", "--chord-mm", "300"), "--rpm: got -1"),
    (("5x3", "--rpm", "9000", "--series", "nobody"), "--series: got 'nobody'"),
    (("5x3", "--rpm", "1e9", "--airspeed-m-s=-300"), "--rpm: got 1e+09; expected 10 to 300000 rev/min"),
    (("5x3", "--rpm", "1e9", "--airspeed-m-s=-300"), "--airspeed-m-s: got -300; expected -100 to 300 m/s"),
])  # fmt: skip
def test_bad_input_is_refused_all_at_once(
    words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["estimate", *words]) == 2
    said = capsys.readouterr()
    assert message in said.err and not said.out


@pytest.mark.parametrize(("words", "expected"), [
    (("--measured-pitch-in", "127"), "0.1 to 2.5 diameters, 0.8 to 20 in. 127 mm would be 0.62 diameters."),
    (("--measured-pitch-in", "0.127"), "0.1 to 2.5 diameters, 0.8 to 20 in. 0.127 m would be 0.62 diameters."),
    (("--measured-pitch-in", "12.7e6"), "0.1 to 2.5 diameters, 0.8 to 20 in."),
    (("--chord-mm", "0.02"), "0.02 to 0.4 diameters, 4.06 to 81.3 mm. 0.02 m would be 0.098 diameters."),
    (("--chord-mm", "0.8"), "0.02 to 0.4 diameters, 4.06 to 81.3 mm. 0.8 in would be 0.1 diameters."),
    (("--chord-mm", "1.9"), "0.02 to 0.4 diameters, 4.06 to 81.3 mm. 1.9 in would be 0.24 diameters."),
])  # fmt: skip
def test_a_length_in_another_unit_is_refused_with_the_unit_that_fits(
    words: tuple[str, str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["estimate", "8x5", "--rpm", "5000", *words]) == 2
    said = capsys.readouterr()
    assert said.err == f"{words[0]}: got {float(words[1]):g}; expected {expected}\n" and not said.out


def test_numbers_that_are_none_come_all_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["8x5", "--rpm", "5000", "nan", "--airspeed-m-s", "inf", "--density-kg-m3", "nan", "--chord-mm", "nan",
             "--measured-pitch-in", "inf", "--series", "nobody"]  # fmt: skip
    assert cli.main(["estimate", *words]) == 2
    said = capsys.readouterr().err.splitlines()
    heads = ["--density-kg-m3: got nan", "--chord-mm: got nan", "--measured-pitch-in: got inf",
             "--series: got 'nobody'", "--rpm: got nan", "--airspeed-m-s: got inf"]  # fmt: skip
    assert len(said) == len(heads) and all(any(line.startswith(head) for line in said) for head in heads)
    words[words.index("--density-kg-m3") + 1] = "19"
    assert cli.main(["estimate", "8by5", *words[1:-2]]) == 2  # an unreadable label hides nothing
    said = capsys.readouterr().err.splitlines()
    assert any(line.startswith("label") for line in said) and any("--density-kg-m3: got 19" in line for line in said)
    assert len(said) == 6


def test_a_label_without_an_ending_says_once_that_its_kind_of_blade_is_open(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for label, known in (("10x5", ["APC Thin Electric", "Master Airscrew Scimitar"]), ("APC 10x5", ["APC Thin"])):
        for words in (["estimate", label, "--rpm", "6000", "7000"], ["new", label, "--out", str(tmp_path / label)]):
            assert cli.main(words) == 0
            (line,) = [x for x in capsys.readouterr().out.splitlines() if "no ending" in x]
            assert all(word in line for word in ("MR", "SF", *known))
    for label in ("10x5E", "APC 10x4.7SF", "5x4.3x3"):
        assert cli.main(["estimate", label, "--rpm", "6000"]) == 0
        assert "no ending" not in capsys.readouterr().out


def test_at_rest_the_figure_of_merit_stands_where_an_efficiency_would_be_zero() -> None:
    found = bemt.estimate("10x5", 6000, [0.0, 10.0])
    rest, flying = found.to_dict()["rows"]
    ideal = rest["thrust_N"] ** 1.5 / (0.5 * math.pi * 1.225 * (10 * INCH) ** 2) ** 0.5
    assert rest["FM"] == pytest.approx(ideal / rest["power_W"]) and flying["FM"] is None
    assert "FM" in found.text and "FM" not in bemt.estimate("10x5", 6000, 10.0).text
    swept = bemt.sweep([Path("cases/prop_10x5").as_posix()]).details
    assert f"{rest['FM']:.1f}" in swept[swept.index("FM") :]


@pytest.mark.parametrize(("label", "first"), [
    ("10x47", "10x47 read as 10x4.7: "), ("13x65", "13x65 read as 13x6.5: "), ("10x4.7", "10x4.7: "),
    ("APC 10x5E", "APC 10x5E: "),
])  # fmt: skip
def test_the_first_line_says_how_a_label_was_read(label: str, first: str) -> None:
    assert bemt.estimate(label, rpm=5000).text.startswith(first)


@pytest.mark.parametrize(("label", "command"), [("69mm", "bemt new 69mm --fan"), ("DS-30", "bemt new 70mm --fan")])
def test_the_name_or_size_of_a_fan_leads_to_new(label: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["estimate", label, "--rpm", "5000"]) == 2
    assert command in capsys.readouterr().err

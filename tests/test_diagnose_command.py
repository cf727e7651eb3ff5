"""The promise of the command `diagnose`: one answer in a folder, nobody's own files lost."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from diagnosing import CASES, case, points, recording
from hypothesis import given
from hypothesis import strategies as st

import bemt
from bemt.app.cli import main, parsed
from bemt.base.errors import InputError
from bemt.judge.diagnose import assemble, chain, document, other_rotor, record, suggest
from bemt.judge.diagnose.answer import bare, stretches
from bemt.judge.diagnose.load import load
from bemt.physics.dataset import Dataset
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case


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
    assert "compressibility" in [e.id for e in prepare_case(load_case(out)).effects]
    assert main(["diagnose", file, "--case", str(CASES / "prop_8x5"), *plain]) == 0
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] == "none"
    assert not (out / "case.toml").exists()


def test_the_speed_of_the_case_in_place_of_a_recorded_one_is_the_first_remark(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "log.csv"
    file.write_text("airspeed_m_s,thrust_N\n" + "".join(f"{v},{6 - v / 4}\n" for v in range(8)))
    command = ["diagnose", str(file), "--case", str(CASES / "prop_8x5"), "--only", "thrust_gain"]
    assert main(command) == 0
    remarks = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert "log.csv: rpm: not recorded;" in remarks[0] and "rev/min of the case" in remarks[0]
    assert main([*command, "--rpm", "6000"]) == 0
    assert "not recorded; 6000" not in capsys.readouterr().out


def test_a_sweep_takes_a_case_and_its_improved_one_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(CASES / "prop_8x5", tmp_path / "prop_8x5")
    file = _recorded(tmp_path / "log.csv", 0)
    run = [
        "diagnose", file, "--case", str(tmp_path / "prop_8x5"), "--off", "compressibility", "--no-figures", "--quiet",
    ]  # fmt: skip
    assert main([*run, "--out", str(tmp_path / "diagnosis")]) == 0
    assert main(["sweep", str(tmp_path), "--json"]) == 0
    names = [result["name"] for result in json.loads(capsys.readouterr().out)["cases"]]
    assert sorted(names) == ["prop_8x5", "prop_8x5_improved"]


def test_each_case_has_its_improved_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only that of the first was written. Those of an earlier answer go, whatever cases it had."""
    names, out = ["prop_8x5", "prop_10x5"], tmp_path / "out"
    files = []
    for k, name in enumerate(names):
        own = case(name)
        series = recording(own, points("grid", own.diameter_m), seed=k)
        columns = {**series.values, **{f"u_{q}": v for q, v in series.u.items()}}
        files.append(_table(tmp_path / f"{name}.csv", columns))
    both = ["--case", *(str(CASES / n) for n in names)]
    plain = ["--only", "compressibility", "--out", str(out), "--no-figures", "--quiet"]
    assert main(["diagnose", *files, *both, "--off", "compressibility", *plain]) == 0
    assert json.loads((out / "diagnosis.json").read_text())["effects"] == ["compressibility"]
    assert not (out / "case.toml").exists()
    for name in names:
        improved = load_case(out / name)
        assert improved.name == f"{name}_improved" and "compressibility" in [
            e.id for e in prepare_case(improved).effects
        ]
        assert main(["sweep", str(out / name), "--quiet"]) == 0
    # the next answer is of one case: the folders of the two are no answer any more
    alone = ["diagnose", files[0], "--case", str(CASES / names[0]), "--off", "compressibility", *plain]
    assert main(alone) == 0
    assert load_case(out).name == f"{names[0]}_improved"
    assert not any((out / n / "case.toml").exists() for n in names)
    (out / names[1] / "case.toml").write_text((CASES / names[1] / "case.toml").read_text())
    assert main(["diagnose", *files, *both, *plain]) == 2
    assert f"{names[1]}/case.toml; expected a folder without one" in capsys.readouterr().err


def test_cases_of_one_name_have_no_folder_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(CASES / "prop_8x5", tmp_path / "own")
    files = [_table(tmp_path / f"{k}.csv", LOADS) for k in "ab"]
    two = ["--case", str(CASES / "prop_8x5"), str(tmp_path / "own"), "--out", str(tmp_path / "out")]
    assert main(["diagnose", *files, *two, "--quiet"]) == 2
    first = (CASES / "prop_8x5" / "case.toml").as_posix()
    assert f"name: got 'prop_8x5' as in {first}; expected a unique name" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_case_of_the_users_own_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, own = _recorded(tmp_path / "log.csv", 0), tmp_path / "prop_8x5"
    shutil.copytree(CASES / "prop_8x5", own)
    before = {p.name: p.read_bytes() for p in own.iterdir()}
    arguments = ["diagnose", file, "--case", str(own), "--off", "compressibility", "--out", str(own), "--quiet"]
    assert main(arguments) == 2
    assert "--out: got a folder with an existing file" in capsys.readouterr().err
    assert {p.name: p.read_bytes() for p in own.iterdir()} == before


def test_an_option_of_several_words_may_be_given_again() -> None:
    """`--case A --case B` took the last one only, and said so nowhere."""
    for words in (["--case", "a", "b", "--reference", "q"], ["--case", "a", "--case", "b", "--reference", "q"]):
        given = parsed(["diagnose", "x.csv", "y.csv", *words])[1]
        assert given == {"recordings": ["x.csv", "y.csv"], "case": ["a", "b"], "reference": ["q"]}
    assert "reference" not in parsed(["diagnose", "x.csv", "--case", "a"])[1]


def _table(path: Path, columns: dict[str, object]) -> str:
    rows = np.broadcast_arrays(*(np.asarray(v) for v in columns.values()))
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*rows, strict=True))
    return str(path)


RPM = np.linspace(6000.0, 16000.0, 12)
LOADS: dict[str, object] = {"rpm": RPM, "thrust_N": 6.8e-8 * RPM**2, "torque_Nm": 9.5e-10 * RPM**2}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"temperature_K": np.r_[np.full(11, 290.0), 20.0]}, ["temperature_K, point 12: got 20", "Celsius"]),
        ({"temperature_K": 290.0, "pressure_Pa": 29.9}, ["pressure_Pa, point 1, 2, 3, 4, 5 ...: got 29.9"]),
        ({"J": 0.3, "airspeed_m_s": 0.36 * RPM / 60 * 0.2032}, ["J: got airspeed over n D is 1.2 times it"]),
        ({"thrust_N": 1e9}, ["times what the case gives", "unit, or wrong case?"]),
    ],
)
def test_what_cannot_be_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: dict[str, object], words: list[str]
) -> None:
    file = _table(tmp_path / "log.csv", LOADS | change)
    assert main(["diagnose", file, "--case", str(CASES / "prop_8x5"), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert all(w in said for w in words), said


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"torque_Nm": 0.0}, "torque_Nm is 0 in every row: not measured"),
        ({"thrust": 3.0}, "no unit known, none assumed, for 'thrust'"),
        ({"vibration_V": 3.0}, "not used: vibration_V"),
        ({"Power (W)": 30.0}, "power_W: taken as shaft power; if a wattmeter read it"),
        ({"CT": 0.05}, "CT: thrust_N is used, which is"),
        ({"airspeed_furlong": 30.0}, "no unit known, none assumed, for 'airspeed_furlong'"),
    ],
)
def test_nothing_of_a_file_goes_unmentioned(tmp_path: Path, change: dict[str, object], words: str) -> None:
    notes = load(_table(tmp_path / "log.csv", LOADS | change), case()).notes
    assert any(words in note for note in notes), notes


def test_a_zero_that_turns_the_sign_of_low_torques_is_still_a_zero(tmp_path: Path) -> None:
    """The cell is as certain as it was: its zero is what is looked for."""
    rpm = np.linspace(2000.0, 11000.0, 30)
    found, scatter = prepare_case(case()).solve(rpm, 0.0, case().air()), np.random.default_rng(3).normal(1, 0.004, 30)
    torque = found.torque_Nm * scatter - 0.14 * np.max(found.torque_Nm)
    assert np.count_nonzero(torque < 0.0) > 3
    table = {"rpm": rpm, "thrust_N": found.thrust_N * scatter[::-1], "torque_Nm": torque}
    said = bemt.diagnose(_table(tmp_path / "log.csv", table), case=CASES / "prop_8x5")
    assert said.effects == ("torque_zero",), said.text


@pytest.mark.parametrize("heading", ["v Kanal (m/s)", "flow (m/s)", "Anströmung [m/s]"])
def test_a_column_that_may_be_the_airspeed_is_asked_about_at_every_door(
    tmp_path: Path, heading: str, capsys: pytest.CaptureFixture[str]
) -> None:
    n, V = np.repeat([4000.0, 6000.0, 8000.0], 3), np.tile([0.0, 4.0, 8.0], 3)
    table = {"rpm": n, heading: V, "thrust_N": 1e-7 * n**2 * (1.0 - 0.08 * V * 6000.0 / n), "torque_Nm": 2e-9 * n**2}
    a, b = (_table(tmp_path / f"{name}.csv", table) for name in "ab")
    for words in (["import", a], ["diagnose", a, "--case", str(CASES / "prop_8x5")], ["compare", a, b]):
        assert main(words) == (0 if words[0] == "import" else 2)
        told = "".join(capsys.readouterr())
        assert "s it the airspeed? --column airspeed=" in told and "misread" not in told


def test_loads_beside_coefficients_are_used_under_any_of_their_names(tmp_path: Path) -> None:
    columns = {"rpm": RPM, "CT": 0.05, "F (N)": LOADS["thrust_N"], "torque_Nm": LOADS["torque_Nm"]}
    made = load(_table(tmp_path / "log.csv", columns), case())
    np.testing.assert_allclose(made.measured["thrust_N"], LOADS["thrust_N"])
    assert any("CT: thrust_N is used" in note for note in made.notes)


@pytest.mark.parametrize("column, told", [("rpm", 7000.0), ("airspeed_m_s", 3.0)])
def test_a_speed_that_a_table_lacks_is_as_told(tmp_path: Path, column: str, told: float) -> None:
    has = LOADS | {"airspeed_m_s": np.full(RPM.size, 6.0)}
    bare = {k: v for k, v in has.items() if k != column}
    options = {"rpm" if column == "rpm" else "airspeed_m_s": told}
    made = load(_table(tmp_path / "bare.csv", bare), case(), **options)
    assert np.all((made.rpm if column == "rpm" else made.V) == told)
    own = load(_table(tmp_path / "own.csv", has), case(), **options)
    assert not np.any((own.rpm if column == "rpm" else own.V) == told)  # the file knows better
    assert any("ignored" in note for note in own.notes)


def test_humid_air_is_thinner_than_dry(tmp_path: Path) -> None:
    air = {"temperature_K": 311.15, "pressure_Pa": 101325.0}
    files = [_table(tmp_path / f"{h}.csv", LOADS | air | {"humidity_pct": h}) for h in (0, 95)]
    rho = [float(np.mean(load(f, case()).air.rho)) for f in files]
    assert rho == pytest.approx([1.1345, 1.1067], abs=2e-3)


def test_a_reversed_cell_is_said_before_physics_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    series = recording(case(), points("grid"))
    columns = {**series.values, "thrust_N": -series["thrust_N"]}
    assert main(["diagnose", _table(tmp_path / "log.csv", columns), "--case", str(CASES / "prop_8x5"), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["verdict"], answer["effects"]) == ("sensor", ["unit_slip"])
    slip = answer["ranking"][0]["parameters"]
    assert (slip["channel"]["value"], slip["factor"]["value"]) == ("thrust_N", -1.0)
    assert "sign_flipped (thrust_N)" in answer["findings"][0]


def test_rows_of_propellers_of_several_diameters_are_refused(tmp_path: Path) -> None:
    sizes = np.where(np.arange(RPM.size) % 2, 8.0, 9.0)
    with pytest.raises(InputError, match="D_in: got 2 set-ups: 0.2032 m, 0.2286 m"):
        load(_table(tmp_path / "all.csv", LOADS | {"D_in": sizes}), case())


def test_the_log_of_a_stand_gives_the_sense_of_rotation_by_the_sign_of_the_torque(tmp_path: Path) -> None:
    series = recording(case(), points("static"))
    heads = "Time (s),ESC signal (µs),Torque (N·m),Thrust (gf),Motor Electrical Speed (RPM)"
    rows = zip(-series["torque_Nm"], series["thrust_N"] / 9.80665e-3, series["rpm"], strict=True)
    lines = [f"{2.0 * k},{1200 + 10 * k},{q},{t},{n}" for k, (q, t, n) in enumerate(rows)]
    (tmp_path / "StepsTestV2_2022-01-18_153833.csv").write_text("\n".join([heads, *lines]) + "\n", encoding="utf-8")
    made = load(str(tmp_path / "StepsTestV2_2022-01-18_153833.csv"), case())
    assert np.all(made.measured["torque_Nm"] > 0.0) and any("sense of rotation" in n for n in made.notes)


@pytest.mark.parametrize("order", ["speed first", "wind first", "shuffled", "half of the thrusts empty"])
def test_many_points_say_the_same_in_any_order(order: str) -> None:
    """They are averaged with alike ones, as coefficients."""
    rpm, J = (x.ravel() for x in np.meshgrid(np.linspace(4000.0, 20000.0, 30), np.linspace(0.0, 0.5, 9)))
    index = {"wind first": np.lexsort((J, rpm)), "shuffled": np.random.default_rng(1).permutation(rpm.size)}
    rpm, J = (x[index.get(order, np.arange(rpm.size))] for x in (rpm, J))
    T = 1.2 * (rpm / 60) ** 2 * 0.2032**4 * (0.12 - 0.1 * J)
    if order.startswith("half"):
        T[::2] = np.nan
    values = {"rpm": rpm, "airspeed_m_s": J * rpm / 60 * 0.2032, "density_kg_m3": np.full(rpm.size, 1.2), "thrust_N": T,
              "torque_Nm": 0.02 * 1.2 * (rpm / 60) ** 2 * 0.2032**5}  # fmt: skip
    made = record.from_series(Dataset("bench", "x", values), case())
    n, D = made.rpm / 60, 0.2032
    assert len(made) == 150 and np.ptp(made.rpm) > 15000
    CT, J = made.measured["thrust_N"] / (1.2 * n**2 * D**4), made.V / (n * D)
    seen = np.isfinite(CT)
    assert seen.sum() == (75 if order.startswith("half") else 150)  # every second speed
    np.testing.assert_allclose(CT[seen], 0.12 - 0.1 * J[seen], atol=1e-12)


CASE_TEXTS = {
    "several lines": ("[model]\n", '[model]\neffects_off = [\n  "compressibility",  # mine\n]\n'),
    "dotted": ("[model]\nn_crit = 3\ndrag_level = 1.1\nstations = 40\nalso_without", "also_without"),
    "spaces": ("[model]", "[ model ]"),
}


@pytest.mark.parametrize("form", [*CASE_TEXTS, "byte order mark", "references elsewhere"])
def test_the_improved_case_runs_however_the_case_is_written(tmp_path: Path, form: str) -> None:
    own, out = tmp_path / "own", tmp_path / "results" / "out"
    shutil.copytree(CASES / "prop_8x5", own)
    text = (own / "case.toml").read_text()
    old, new = CASE_TEXTS.get(form, ("", ""))
    assert old in text
    text = text.replace(old, new, 1)
    if form == "dotted":
        text = re.sub(r"^also_without.*$", "", text, flags=re.M)
        text = text.replace("[rotor]", "model.n_crit = 3\nmodel.drag_level = 1.1\n\n[rotor]", 1)
    if form == "references elsewhere":
        (own / "measured").mkdir()
        (own / "references.csv").rename(own / "measured" / "shared.csv")
        text = text.replace('references = "references.csv"', 'references = "measured/shared.csv"')
    (own / "case.toml").write_text(("\ufeff" if form == "byte order mark" else "") + text, encoding="utf-8")
    off = [] if form == "several lines" else ["--off", "compressibility"]
    run = ["diagnose", _recorded(tmp_path / "log.csv", 0), "--case", str(own), *off, "--only", "compressibility"]
    assert main([*run, "--out", str(out), "--no-figures", "--quiet"]) == 0
    improved = load_case(out)
    assert "compressibility" in [e.id for e in prepare_case(improved).effects]
    assert improved.get("model.drag_level") == 1.1
    assert {p.name for p in (tmp_path / "results").iterdir()} == {"out"}
    assert main(["sweep", str(out), "--quiet"]) == 0
    # again into its own folder: the input would be replaced by the answer
    assert main(["diagnose", str(tmp_path / "log.csv"), "--case", str(out), "--out", str(out), "--quiet"]) == 2


def test_a_recording_counts_once_and_an_effect_has_a_known_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = _table(tmp_path / "log.csv", LOADS)
    assert main(["diagnose", file, file, "--case", str(CASES / "prop_8x5"), "--only", "compresibility"]) == 2
    said = capsys.readouterr().err
    assert "a recording given twice" in said and "--only: compresibility: got an unknown effect" in said


@pytest.mark.parametrize(
    ("diameter_in", "torque", "words"),
    [(9, 1.0, "diameter, pitch and blades"), (8, 1.25, "torque by +25%")],
)
def test_a_level_that_no_cause_explains_is_said(tmp_path: Path, diameter_in: int, torque: float, words: str) -> None:
    """A recording of another rotor, and a torque that gains and the solver may be off by."""
    series = recording(case(), points("grid"))
    values = {**series.values, "torque_Nm": torque * series["torque_Nm"]}
    other = case().replaced({"rotor.diameter_in": diameter_in, "blade.pitch_in": 5 * diameter_in / 8})
    answer = chain.diagnose([record.from_series(Dataset("bench", "log", values, dict(series.u)), other)], [other])
    assert words in " ".join(document.explanation(answer))


@pytest.mark.parametrize("far", [1.0, 0.5])
def test_the_first_line_says_how_far_the_case_is_off(far: float) -> None:
    """As a median, or how far where only some readings are off."""
    series = recording(case(), points("grid"))
    share = 1.3 if far == 1.0 else np.where(series["rpm"] > 17000.0, 1.3, 1.0)
    values = {**series.values, "thrust_N": series["thrust_N"] * share}
    made = record.from_series(Dataset("bench", "log", values, dict(series.u)), case())
    line = document.headline(replace(chain.diagnose([made], [case()], only=["hub_loss"])))
    told = re.search(r"thrust (up to )?\+(\d+\.\d) %", line)
    assert told is not None and (told[1] is None) == (far == 1.0) and float(told[2]) == pytest.approx(30.0, abs=3.0), (
        line
    )


def test_a_reference_that_the_run_agrees_with_is_the_first_word() -> None:
    """The model may be far off both: what counts is that nothing changed between them."""
    series = recording(case(), points("grid"))
    values = {**series.values, "torque_Nm": 1.3 * series["torque_Nm"]}
    made = record.from_series(Dataset("bench", "log", values, dict(series.u)), case())
    answer = chain.diagnose([made, replace(made, reference=True)], [case()])
    first = document.headline(answer)
    assert first.startswith("No change beyond what two runs differ by (thrust ") and "no cause above 1 %" in first
    figure = r"thrust [+-]0\.\d % and torque [+-]0\.\d % against the reference"
    assert re.search(figure, first), "the figure stands beside it"


def test_a_file_that_cannot_be_right_is_the_first_word(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = _table(tmp_path / "log.csv", LOADS | {"torque_Nm": 0.08})
    assert main(["diagnose", file, "--case", str(CASES / "prop_8x5")]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert "cannot be right: torque_Nm" in first and "guess" not in first


def test_faults_of_all_files_and_the_case_are_said_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = tmp_path / "bare.csv"
    bare.write_text("Drehzahl,Schub,Moment\n" + "".join(f"{n},{n / 3000},0.03\n" for n in range(4000, 9000, 500)))
    slow = _table(tmp_path / "slow.csv", {k: v for k, v in LOADS.items() if k != "rpm"})
    windy = _table(tmp_path / "windy.csv", LOADS | {"thrust_N": 6.8e-8 * RPM * (RPM - 9000.0)})
    assert main(["diagnose", str(bare), slow, windy, "--case", str(CASES / "prop_8x5"), "--quiet"]) == 2
    said = capsys.readouterr().err
    told = (
        "column Drehzahl: got a speed", "--unit Schub=UNIT", "--unit Moment=UNIT",
        "slow.csv: rpm: got no speed of rotation", "windy.csv: airspeed_m_s: got thrust that is negative",
    )  # fmt: skip
    for words in told:
        assert words in said, said
    gone = [
        "diagnose", str(tmp_path / "gone.csv"), "--case", str(tmp_path / "no"), "--reference", str(tmp_path / "nor"),
    ]  # fmt: skip
    assert main(gone) == 2
    said = capsys.readouterr().err
    assert all(f"{tmp_path / name}: got no such file" in said for name in ("gone.csv", "no", "nor")), said


@pytest.mark.parametrize("channel", ["thrust_N", "torque_Nm"])
def test_without_an_explanation_the_first_sentence_is_what_the_recording_shows(channel: str) -> None:
    """A load 15 % up above 13000 rpm, which nothing explains: what calibration leaves of it is low at low speed."""
    series = recording(case(), points("grid"))
    values = {**series.values, channel: series[channel] * np.where(series["rpm"] > 13000.0, 1.15, 1.0)}
    made = record.from_series(Dataset("bench", "log", values, dict(series.u)), case())
    answer = chain.diagnose([made], [case()])
    assert answer.decision.verdict in ("unknown", "insufficient")
    said = document.told(answer)
    (first,), beyond = said.seen, [line for line in said.details if line.startswith("Beyond the uncertainty")]
    word = {"thrust_N": "Thrust", "torque_Nm": "Torque"}[channel]
    told = re.match(
        rf"{word} is high by (\d+\.\d) .*%, at (\d+) to (\d+) rev/min\.$",
        first,
    )
    assert told is not None, first
    slow, fast = map(float, told.groups()[1:])
    assert fast == pytest.approx(np.max(series["rpm"]), rel=0.01)
    assert slow == pytest.approx(np.min(series["rpm"][series["rpm"] > 13000.0]), rel=0.15)
    assert float(told[1]) == pytest.approx(15.0, abs=1.5), "a share of the load itself, as the headline says it"
    where = answer.where
    assert bool(beyond) == ((where.channel, where.size > 0) != (channel, True))


def test_a_load_of_many_times_the_cases_is_a_factor_of_what_the_case_gives() -> None:
    """No share of the readings, which are in another unit: ten times the torque is not high by 90 %."""
    series = recording(case(), points("static"), noise=0.003)
    values = {**series.values, "torque_Nm": 12.0 * series["torque_Nm"]}
    answer = chain.diagnose([record.from_series(Dataset("bench", "log", values), case())], [case()])
    shown = bare(answer.found).sentence(answer.words)
    assert re.match(r"Torque is x1[12](\.\d+)? of what the case gives", shown), shown


def test_a_channel_low_at_one_end_and_high_at_the_other_is_said_so() -> None:
    """Loads a fifth above the case, and a torque cell that reads 4 % of its range too little."""
    series = recording(case(), points("static"), noise=0.003)
    thrust, torque = 1.2 * series["thrust_N"], 1.2 * series["torque_Nm"]
    values = {**series.values, "thrust_N": thrust, "torque_Nm": torque - 0.04 * np.max(torque)}
    answer = chain.diagnose([record.from_series(Dataset("bench", "log", values, dict(series.u)), case())], [case()])
    assert answer.said.effects == ("torque_zero",) and answer.where.size < 0.0
    problem = answer.problem
    mine = problem.channel == 1
    speed, off = problem.covariates["rpm"][problem.point[mine]], (problem.y / problem.f0)[mine] - 1.0
    assert off[np.argmin(speed)] < -0.2 and off[np.argmax(speed)] > 0.05
    slow, fast = answer.where.shown
    assert slow.size < 0.0 < fast.size and slow.rpm[1] < fast.rpm[0]
    for s in (slow, fast):
        there = off[(speed >= s.rpm[0]) & (speed <= s.rpm[1])]
        assert np.min(there) - 1e-9 <= s.size <= np.max(there) + 1e-9 and np.sign(np.median(there)) == np.sign(s.size)
    shown = next(w for w in document.explanation(answer) if w.startswith("Torque is"))
    rest = answer.where.rest(answer.words)
    assert shown.index("low") < shown.index("high") and "low" in rest and "high" not in rest


@given(st.lists(st.integers(-3, 3), min_size=1, max_size=30), st.integers(1, 4))
def test_every_point_is_in_a_stretch_and_no_side_is_left_out(sides: list[int], repeats: int) -> None:
    x = np.repeat(np.arange(len(sides)) * 100.0 + 2000.0, repeats)
    off = np.repeat(0.1 * np.array(sides), repeats)
    found = stretches(x, x, off, np.full(x.size, 1e-3))
    assert all(any(s.low <= v <= s.high for s in found) for v in x)
    if len(sides) <= 12:  # each speed is a group of its own
        told = {np.sign(s.size) for s in found}
        assert {np.sign(v) for v in off if v} <= told
        for s in found:
            there = off[(x >= s.low) & (x <= s.high)]
            assert np.min(there) <= s.size <= np.max(there)


def test_rows_copied_count_once() -> None:
    rpm = np.linspace(5000.0, 15000.0, 20)
    once = {"rpm": rpm, "airspeed_m_s": 0.0 * rpm, "thrust_N": 6.8e-8 * rpm**2}
    twice = {k: np.concatenate([v, v]) for k, v in once.items()}
    made = record.from_series(Dataset("bench", "x", twice), case())
    assert len(made) == 20 and any("20 rows repeat others digit by digit" in n for n in made.notes)
    other = twice | {"time_s": np.arange(40.0)}  # a second run that came out the same
    assert len(record.from_series(Dataset("bench", "x", other), case())) == 40


@pytest.mark.parametrize("what", ["a ramp sampled densely", "many short runs", "many speeds"])
def test_no_recording_keeps_too_many_points(what: str) -> None:
    n = 3000
    rpm = np.linspace(2000.0, 20000.0, n) if what == "many speeds" else 2000.0 + 6.0 * (np.arange(n) * 37 % n)
    values = {"rpm": rpm, "airspeed_m_s": 0.0 * rpm, "thrust_N": 6.8e-8 * rpm**2}
    if what.startswith("a ramp"):
        values["time_s"] = 0.05 * np.arange(n)
    if what.startswith("many short"):
        values["run"] = np.repeat(np.arange(n / 20), 20)
    made = record.from_series(Dataset("bench", "x", values), case())
    assert 100 <= len(made) <= 1.6 * record.MAX_POINTS
    seen = np.isfinite(made.measured["thrust_N"])
    np.testing.assert_allclose(made.measured["thrust_N"][seen], 6.8e-8 * made.rpm[seen] ** 2, rtol=1e-9)


# Pounds and ounce-inches stay within the windows of one recording alone.
ODD_UNITS = [
    ("thrust_N", 1000 / 9.80665, "gf taken for N: multiply by 0.00980665"),
    ("thrust_N", 1 / 4.4482216, "lbf taken for N: multiply by 4.448"),
    ("thrust_N", 1e3, "gf taken for kgf: multiply by 0.001"),
    ("torque_Nm", 100.0, "Ncm taken for Nm: multiply by 0.01"),
    ("torque_Nm", 8.8507458, "lbf in taken for Nm: multiply by 0.112985"),
]


def _of(name: str, seed: int, plan: str = "grid", truth: str = "prop_8x5", **factors: float) -> record.CampaignRecord:
    own = case(truth)
    series = recording(own, points(plan, own.diameter_m), seed=seed)
    values = {k: v * factors.get(k, 1.0) for k, v in series.values.items()}
    return record.from_series(Dataset("bench", name, values), own)


@pytest.mark.parametrize(("channel", "factor", "words"), ODD_UNITS)
@pytest.mark.parametrize("place", [0, 2])
def test_the_one_recording_in_other_units_is_said(channel: str, factor: float, words: str, place: int) -> None:
    """Whatever its place and its plan; all recordings together, or each with the case of its own rotor."""
    plans = ("static", "grid", "air")
    odd = [{channel: factor} if k == place else {} for k in range(3)]
    alone = [_of(f"{k}.csv", k, plans[k], **odd[k]) for k in range(3)]
    others = [_of(f"{k}.csv", k, "static", ("prop_8x5", "prop_10x5", "prop_12x6")[k], **odd[k]) for k in range(3)]
    for records, cases in ((alone, [case()]), (others, [case(n) for n in ("prop_8x5", "prop_10x5", "prop_12x6")])):
        (found,) = assemble.build(records, cases).findings
        assert found.startswith(f"{place}.csv: error: {channel.split('_')[0]}_unit ({channel}): readings over what")
        assert f"Correction: {words}" in found
        assert all(f"{k}.csv" in found for k in range(3)), "and beside which others"


def test_both_loads_off_by_one_factor_are_a_matter_of_the_speed() -> None:
    """Electrical revolutions of a motor with seven pole pairs; and a density that halves both, which is no slip."""
    records = [_of(f"{k}.csv", k, "static") for k in range(2)]
    series = recording(case(), points("static"), seed=2)
    low = {k: v / 49.0 if k in ("thrust_N", "torque_Nm") else v for k, v in series.values.items()}
    records.append(record.from_series(Dataset("bench", "2.csv", low), case()))
    (found,) = assemble.build(records, [case()]).findings
    assert found.startswith("2.csv: error: rpm_electrical (rpm): readings over what the case gives are 0.02")
    assert "taken for mechanical: divide by 7 pole pairs" in found


@pytest.mark.parametrize("pairs", [6, 7, 11])
def test_pole_pairs_are_told_at_the_true_speed(pairs: int) -> None:
    """Seven times too fast the model's tips are near the speed of sound: its loads are not 49 times as large."""
    series = recording(case("prop_10x5"), points("static") | {"rpm": np.linspace(2500.0, 7000.0, 17)})
    fast = replace(series, values={**series.values, "rpm": pairs * series["rpm"]})
    built = assemble.build([record.from_series(fast, case("prop_10x5"))], [case("prop_10x5")])
    assert f"divide by about {pairs} pole pairs" in other_rotor.suspects(built)[0].words


def test_the_formula_is_put_beside_a_recording_with_a_throttle(tmp_path: Path) -> None:
    """K1/K2 knows no torque, so that nothing is said of the drive."""
    rows = "".join(f"{n},{1.3e-7 * n * n},{n / 100.0}\n" for n in range(3000, 9001, 1000))
    (tmp_path / "a.csv").write_text(f"RPM,Thrust (N),Throttle (%)\n{rows}")
    found = bemt.diagnose(tmp_path / "a.csv", str(CASES / "prop_10x5"), baseline="k1k2")
    assert set(found.to_dict()["fit"]) == {"thrust_N"}


def test_of_two_recordings_the_one_nearer_the_case_is_taken_to_be_right() -> None:
    for odd in (0, 1):
        records = [_of(f"{k}.csv", k, thrust_N=1 / 4.4482216 if k == odd else 1.0) for k in range(2)]
        (found,) = assemble.build(records, [case()]).findings
        assert found.startswith(f"{odd}.csv: ") and found.endswith(f"Or {1 - odd}.csv is the one in a different unit")


@pytest.mark.parametrize(
    "other",
    [
        {"thrust_N": 1.3, "torque_Nm": 1.2},  # another session, another stand
        {"thrust_N": 1.9},  # no factor of units
        {"density_kg_m3": 0.5},
        {"airspeed_m_s": 1.4},
    ],
)
def test_recordings_that_differ_otherwise_are_left_in_peace(other: dict[str, float]) -> None:
    records = [_of("a.csv", 0, "static"), _of("b.csv", 1), _of("c.csv", 2, **other)]
    assert assemble.build(records, [case()]).findings == ()


def test_a_recording_without_load_has_no_level() -> None:
    """At the speed of no thrust the ratio to the model is anything: four times, for a model that is a little off."""
    rpm = np.full(6, 15000.0)
    J = np.linspace(0.72, 0.78, 6)
    fading = {"rpm": rpm, "airspeed_m_s": J * rpm / 60 * 0.2032, "thrust_N": np.full(6, 0.5)}
    last = record.from_series(Dataset("bench", "c.csv", fading), case())
    records = [_of("a.csv", 0, "static"), _of("b.csv", 1), last]
    assert assemble.build(records, [case()]).findings == ()


def test_findings_of_several_files_name_their_file_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The parts of one case are merged: their findings stood behind the names of all."""
    files = []
    for k, factor in enumerate((1.0, 1.0, -0.2248089)):
        series = recording(case(), points("static"), seed=k)
        files.append(_table(tmp_path / f"{k}.csv", {**series.values, "thrust_N": factor * series["thrust_N"]}))
    run = ["diagnose", *files, "--case", str(CASES / "prop_8x5"), "--only", "unit_slip", "--json"]
    assert main(run) == 0
    answer = json.loads(capsys.readouterr().out)
    odd, *own = answer["findings"]
    assert odd.startswith("2.csv: error: thrust_unit (thrust_N): ") and "lbf taken for N" in odd
    assert "2.csv: warning: sign_flipped (thrust_N): " in " ".join(own)
    assert all(f.startswith("2.csv: ") for f in own)
    evidence = odd.partition("(thrust_N): ")[2].partition(". Correction: ")[0]
    assert f"It explains what cannot be in 2.csv: {evidence}" in answer["explanation"], answer["explanation"]


def test_real_recordings_of_one_propeller_have_one_unit(shared_data: Path, tmp_path: Path) -> None:
    """Static points and tunnel lines of volume 1, at every speed; and the static ones in pounds."""
    from test_diagnose_real import uiuc

    folder = shared_data / "uiuc" / "volume-1"
    for name in ("apce_10x7", "gwsdd_9x5", "grcp_9x4"):
        own = uiuc(tmp_path, folder, name)
        files = [f for f in sorted(folder.glob(f"{name}_*.txt")) if not f.stem.endswith("geom")]
        records = [load(str(f), own) for f in files]
        assert assemble.build(records, [own]).findings == ()
        static = records[-1]
        pounds = static.measured | {"thrust_N": static.measured["thrust_N"] / 4.4482216}
        (found,) = assemble.build([*records[:-1], replace(static, measured=pounds)], [own]).findings
        assert found.startswith(f"{static.name}: error: thrust_unit") and "lbf taken for N" in found


def test_force_files_of_cfd_go_straight_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Forces and moments as OpenFOAM writes them, one folder a speed; the speeds come with the command."""
    rpm = [8000.0, 12000.0, 16000.0]
    exact = recording(case(), {"rpm": np.array(rpm), "airspeed_m_s": np.zeros(3)}, noise=0.0)
    files = []
    for k, n in enumerate(rpm):
        folder = tmp_path / f"{n:.0f}"
        folder.mkdir()
        for name, value in (("force", -exact["thrust_N"][k]), ("moment", exact["torque_Nm"][k])):
            head = f"# {name.capitalize()}\n# CofR : (0 0 0)\n#\n# Time total_x total_y total_z\n"
            rows = "".join(f"{0.01 * i:g}\t{value:.8g}\t{1e-4 * value:.8g}\t0\n" for i in range(1, 60))
            (folder / f"{name}.dat").write_text(head + rows, encoding="utf-8")
        files.append(str(folder / "force.dat"))
    base = ["diagnose", *files, "--case", str(CASES / "prop_8x5"), "--json", "--quiet"]
    assert main(base) == 2
    assert "--rpm" in capsys.readouterr().err
    assert main([*base, "--rpm", *(f"{n:g}" for n in rpm), "--airspeed-m-s", "0"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["verdict"], said["readings"]) == ("none", 6)
    assert max(abs(s["before"] / said["fit"][c]["mean"]) for c, s in said["fit"].items()) < 0.01


def test_the_headline_claims_what_the_verdict_claims_and_a_study_of_cfd_ends_in_a_run_of_cfd() -> None:
    one = replace(record.from_series(recording(case(), points("static"), seed=1), case()), computed=True)
    found = chain.diagnose([one], [case()], ["thrust_gain", "pitch_offset"])
    claim = replace(found.decision, verdict="class", effects=("thrust_gain", "pitch_offset"))
    silent = replace(found, decision=claim, said=replace(claim, verdict="insufficient", effects=()))
    assert "do not show why" in document.headline(silent)
    assert re.match("Most likely|One of 2 causes", document.headline(replace(silent, said=claim)))
    assert "finer grid" in suggest.suggest(silent.found, []).text
    assert "reference" not in silent.next.text + str(silent.next.otherwise)


def test_the_improved_case_of_a_label_is_that_of_the_label(tmp_path: Path) -> None:
    rotor = bemt.propeller("10x5")
    rpm, J = np.repeat([5000.0, 10000.0, 15000.0], 6), np.tile(np.linspace(0.0, 0.5, 6), 3)
    steep = rotor.case.get("blade.beta_offset_deg") + 1.5
    turned = rotor.replaced({"blade.beta_offset_deg": steep}).solve(rpm, J=J, bands=False)
    found = bemt.diagnose(turned, "10x5", reference=rotor.solve(rpm, J=J, bands=False),
                          only=["pitch_offset", "torque_gain"], out=tmp_path / "out", figures=False)  # fmt: skip
    assert found.verdict == "named"
    assert "pitch_offset" in [e.id for e in prepare_case(load_case(tmp_path / "out")).effects]


def test_a_unit_that_is_named_is_stated_next(tmp_path: Path) -> None:
    """The next command is not the same again: it keeps the unit beside the table, and diagnoses that."""
    rows = bemt.propeller("12x6").solve(np.linspace(3000, 6000, 7), bands=False)
    table = "\n".join(f"{n:.0f},{T:.4f},{100 * Q:.5f}" for n, T, Q in
                      zip(rows.rpm, rows.thrust_N, rows.torque_Nm, strict=True))  # fmt: skip
    (tmp_path / "log.csv").write_text(f"rpm,thrust N,torque N m\n{table}\n")
    text, kept = bemt.diagnose(tmp_path / "log.csv", "12x6").text, (tmp_path / "recording.toml").as_posix()
    assert f"--unit torque=Ncm --out {kept}" in text and f"bemt diagnose {kept} --case 12x6" in text


def test_power_that_may_be_electrical_is_asked_about_before_a_torque_cell(tmp_path: Path) -> None:
    """Electrical watts under "Power (W)": torque is a third too high, and no cell has a fault."""
    p = bemt.propeller("9x6E")
    found = p.solve(np.arange(3000.0, 9001.0, 1000.0), J=np.zeros(7), bands=False)
    rows = zip(found.rpm, found.thrust_N, found.torque_Nm * found.rpm * np.pi / 30.0 / 0.75, strict=True)
    body = "".join(f"{n:.0f},{T:.4f},{P:.2f}\n" for n, T, P in rows)
    (tmp_path / "a.csv").write_text(f"rpm,Thrust (N),Power (W)\n{body}", "utf-8")
    answer = bemt.diagnose(str(tmp_path / "a.csv"), p)
    assert "if a wattmeter read it, name the column electrical_power_W" in " ".join(answer.text.split())
    assert not any("torque" in effect for effect in answer.effects)


def test_pole_pairs_are_stated_where_a_recording_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Electrical revolutions become the speed by an option, of a file and of a frame; a run of CFD has no motor."""
    d = bemt.propeller("10x5").solve(rpm=[4000, 5000, 6000, 7000, 8000])
    for name, heading, pairs in (("plain", "rpm", 1), ("heading", "eRPM", 7), ("silent", "rpm", 7)):
        rows = [f"{pairs * n:.0f},{T:.4f},{Q:.5f}" for n, T, Q in zip(d.rpm, d.thrust_N, d.torque_Nm, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"{heading},thrust_N,torque_Nm", *rows]) + "\n")
    plain = bemt.diagnose(tmp_path / "plain.csv", "10x5", figures=False).to_dict()
    for name in ("heading", "silent"):
        file = tmp_path / f"{name}.csv"
        for recording_ in (file, pd.read_csv(file)):
            found = bemt.diagnose(recording_, "10x5", pole_pairs=7, figures=False)
            assert found.to_dict()["ranking"] == plain["ranking"]
            assert "pole_pairs=7" in str(found) or "--pole-pairs 7" in str(found), "the next command keeps it"
        pair = bemt.compare(file, file.with_name("silent.csv" if name == "heading" else "heading.csv"), pole_pairs=7)
        assert pair.verdict == "none"
    assert main(["diagnose", str(tmp_path / "heading.csv"), "--case", "10x5"]) == 2
    assert "--pole-pairs" in capsys.readouterr().err
    assert main(["diagnose", str(tmp_path / "silent.csv"), "--case", "10x5"]) == 0
    said = " ".join(capsys.readouterr().out.replace("-\n", "-").split())
    about = re.search(r"divide by about (\d+) pole pairs \(half the magnets .*?; --pole-pairs N\)", said)
    assert about and 6 <= int(about[1]) <= 8, "the loads do not know the model to a pair: no count is a fact"
    export = tmp_path / "cl-rfile.out"
    export.write_text('"lift-rfile"\n"Iteration" "lift"\n("Iteration" "lift")\n1 2.5\n2 2.6\n3 2.6\n')
    with pytest.raises(InputError, match="tables of measurements"):
        bemt.diagnose(export, "10x5", pole_pairs=7, figures=False)


@pytest.mark.parametrize("head", ["rpm,thrust (N),V (V),A (A)", "rpm,thrust (N),torque (Nm),A (A)"])
def test_power_that_is_not_used_is_said_to_be_left_out(head: str, tmp_path: Path) -> None:
    """Volts and amperes beside a thrust alone say nothing of the rotor before a run of the same motor does."""
    rows = [(n, 6.6e-8 * n**2, 9e-10 * n**2 if "torque" in head else 15.0, 1e-3 * n) for n in range(6000, 14000, 1000)]
    (tmp_path / "a.csv").write_text(head + "\n" + "".join(",".join(f"{v:.5g}" for v in r) + "\n" for r in rows))
    said = bemt.diagnose(tmp_path / "a.csv", "8x5").text
    assert ("electrical power is left out" in said) == ("torque" not in head)

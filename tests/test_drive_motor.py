"""Motor constant: conventions, waveforms, three methods, systematic errors named."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import motor_trials
import numpy as np
import pytest
from PIL import Image

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.tools.drive import motor_constant, motor_result, outputs
from bemt.tools.drive import motor_constant as mc

S32, S3 = math.sqrt(1.5), math.sqrt(3.0)


def test_conventions_agree_with_power_in_three_windings() -> None:
    """EMF times current summed over three windings is torque times speed, whatever is called voltage and current."""
    omega, ke, amps = 120.0, 0.04, 7.0
    phase = np.arange(3) * 2 * math.pi / 3
    theta = np.linspace(0.0, 2 * math.pi, 50)[:, None] + phase
    torque = float(np.mean(np.sum(ke * omega * np.cos(theta) * amps * np.cos(theta), axis=1))) / omega
    for winding in ("wye", "delta"):
        for between in ("phase", "line"):
            for measure in mc.CURRENTS:
                read = amps * mc.current_factor(measure, between, winding)
                assert mc.ke_to_kt(ke, measure, between, winding) * read == pytest.approx(torque)
    # the line voltage of a wye is the difference of two windings; the line current of a delta of two currents
    line = ke * omega * (np.cos(theta[:, 0]) - np.cos(theta[:, 1]))
    assert np.ptp(line) / (ke * omega) == pytest.approx(mc.voltage_factor("peak_to_peak", "line", "wye"), rel=5e-3)
    power_invariant = math.sqrt(2.0 / 3.0) * np.cos(theta) @ np.exp(1j * phase)
    assert np.abs(power_invariant).max() == pytest.approx(mc.current_factor("q_power_invariant", "phase", "wye"))


def test_the_numbers_of_the_thesis() -> None:
    ke = mc.from_kv(380.0, "delta")
    assert 1.0 / ke == pytest.approx(39.79, abs=0.01) and ke == pytest.approx(0.02513, abs=5e-6)
    assert mc.ke_to_kt(ke, "q_power_invariant", "phase", "delta") == pytest.approx(0.0308, abs=5e-5)
    assert mc.from_kv(380.0, "wye") == pytest.approx(ke / S3)


def test_the_loop_reads_torque_and_knows_its_live_zero() -> None:
    loop = mc.TorqueLoop(250.0, torque_high_Nm=2.0)
    assert loop.torque([1.0, 5.0]) == pytest.approx([0.0, 2.0]) and loop.live_zero_Nm == pytest.approx(0.5)
    # a resistor that is 4 % larger than assumed: slope and zero move together
    volts = (4.0 + 8.0 * np.array([0.0, 1.0])) * 1e-3 * 260.0
    assert loop.torque(volts) == pytest.approx([0.02, 1.06])


@pytest.mark.parametrize("seed", range(5))
def test_a_waveform_gives_speed_and_amplitude_under_noise_and_harmonics(seed: int) -> None:
    rng = np.random.default_rng(seed)
    f, a = rng.uniform(40.0, 400.0), rng.uniform(0.5, 20.0)
    t = np.arange(2500) / 2500.0 * rng.uniform(2.2, 9.0) / f
    wave = np.cos(2 * math.pi * f * t + rng.uniform(0, 6)) + 0.12 * np.cos(6 * math.pi * f * t) + 0.03
    got = mc.fit_waveform(t, a * (wave + 0.02 * rng.standard_normal(len(t))))
    assert got.frequency_Hz == pytest.approx(f, rel=2e-3) and got.amplitude_V == pytest.approx(a, rel=5e-3)
    assert got.harmonics[0] == pytest.approx(0.12, abs=0.01) and got.offset_V == pytest.approx(0.03 * a, abs=0.01 * a)
    assert got.ke(7, "line", "wye") == pytest.approx(a / S3 / (2 * math.pi * f / 7), rel=6e-3)


def test_oscilloscope_files_of_three_kinds(tmp_path: Path) -> None:
    t = np.linspace(-0.02, 0.02, 200)
    v = 3.0 * np.sin(2 * math.pi * 100.0 * t)
    rows = list(zip(t, v, strict=True))
    keysight = "x-axis,1\nsecond,Volt\n" + "".join(f"{a:.6e},{b:.6e}\n" for a, b in rows)
    plain = "Time (ms),CH1 (mV)\n" + "".join(f"{1e3 * a:.6f},{1e3 * b:.4f}\n" for a, b in rows)
    head = [("Record Length", "200"), ("Vertical Units", "V"), ("Horizontal Units", "s")]
    tek = "".join(
        f"{head[i][0] if i < 3 else ''},{head[i][1] if i < 3 else ''},,{a:.6e},{b:.6e},\n"
        for i, (a, b) in enumerate(rows)
    )
    for name, text in (("k", keysight), ("p", plain), ("t", tek)):
        (tmp_path / name).write_text(text)
        got_t, got_v = motor_result.read_waveform(tmp_path / name)
        assert np.allclose(got_t, t, atol=1e-8) and np.allclose(got_v, v, atol=1e-5), name
    (tmp_path / "none").write_text("a,b\n1,2\n2,3\n")
    with pytest.raises(InputError, match="no units"):
        motor_result.read_waveform(tmp_path / "none")


def folder(tmp_path: Path, seed: int, planted: dict[str, float] | None = None) -> Path:
    for name, text in motor_trials.generate(seed, planted).items():
        (tmp_path / name).write_text(text)
    return tmp_path


def verdict(tmp_path: Path, seed: int, planted: dict[str, float] | None = None):  # noqa: ANN201
    trials = motor_result.read(folder(tmp_path, seed, planted))
    return trials, motor_constant.judge(trials.measured)


def test_clean_trials_name_no_error(tmp_path: Path) -> None:
    named = sum(not verdict(tmp_path, seed)[1].agree for seed in range(1, 101))
    assert named <= 2


PLANTED = [
    ("back_emf.offset", 0.1), ("back_emf.offset", -0.2), ("torque.offset", 0.03), ("torque.offset", -0.02),
    ("torque.shunt", 1.04), ("torque.shunt", 0.95),
]  # fmt: skip


@pytest.mark.parametrize(("name", "size"), PLANTED)
def test_planted_offsets_and_resistors_are_named_and_measured(tmp_path: Path, name: str, size: float) -> None:
    right = inside = constant = 0
    for seed in range(1, 13):
        trials, got = verdict(tmp_path, seed, {name: size})
        right += got.named == (name,)
        best = next((e for e in got.explanations if e.names == (name,)), None)
        if best is not None:
            inside += abs(best.sizes[0] - size) <= 3.0 * best.u_sizes[0]
            constant += abs(best.ke * trials.to_kt - 0.0311) <= 3.0 * best.u_ke * trials.to_kt
            assert best.u_sizes[0] < 0.2 * abs(size - (name == "torque.shunt"))
    assert right >= 11 and inside >= 11 and constant >= 11


@pytest.mark.parametrize("method", motor_constant.METHODS)
@pytest.mark.parametrize("word", motor_constant.FACTORS)
def test_planted_convention_factors_are_named(tmp_path: Path, method: str, word: str) -> None:
    for seed in range(1, 4):
        trials, got = verdict(tmp_path, seed, {f"{method}.factor": motor_constant.FACTORS[word]})
        assert got.named == (f"{method}.factor {word}",)
        best = got.explanations[0]
        assert abs(best.ke * trials.to_kt - 0.0311) <= 3.0 * best.u_ke * trials.to_kt


def test_two_errors_at_once_are_both_named(tmp_path: Path) -> None:
    _, got = verdict(tmp_path, 3, {"back_emf.factor": S3, "torque.shunt": 1.05})
    assert set(got.named) == {"back_emf.factor sqrt(3)", "torque.shunt"}


def test_what_cannot_be_told_apart_is_not_named(tmp_path: Path) -> None:
    """Without a third method nobody knows which of two is off by a factor."""
    path = folder(tmp_path, 4, {"torque.factor": 2.0}) / "motor.toml"
    text = path.read_text()
    path.write_text("\n".join(line for line in text.splitlines() if not line.startswith("kv_")))
    got = motor_constant.judge(motor_result.read(path).measured)
    found = {e.names for e in got.explanations}
    assert not got.named and {("torque.factor 2",), ("back_emf.factor 1/2",)} <= found


def test_a_scale_that_is_no_convention_is_called_a_gain(tmp_path: Path) -> None:
    """The live zero tells it from a wrong resistor, its size from a missed factor."""
    _, got = verdict(tmp_path, 5, {"torque.factor": 1.15})
    best = next(e for e in got.explanations if e.names == ("torque.gain",))
    assert abs(best.sizes[0] - 1.15) <= 3.0 * best.u_sizes[0]
    assert all(name.endswith(".gain") for e in got.explanations for name in e.names)


def test_command_shows_the_case_and_labels_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = tmp_path / "made"
    made.mkdir()
    folder(made, 0)
    assert all(
        "generated, not measured" in (made / n).read_text() for n in ("motor.toml", "back_emf.csv", "torque.csv")
    )
    capsys.readouterr()
    assert main(["motor", str(made), "--json", "--out", str(tmp_path / "out")]) == 0
    doc = json.loads(capsys.readouterr().out)
    by = {m["method"]: m for m in doc["methods"]}
    assert by["data_sheet"]["mean"] == pytest.approx(0.0308, abs=5e-5)
    assert (by["back_emf"]["n"], by["torque"]["n"]) == (10, 28)
    assert by["torque"]["interval95"][0] < 0.0311 < by["torque"]["interval95"][1]
    assert "generated" in doc["data"] and doc["agree"] and doc["stated"]["thesis, adopted (28 trials)"] == 0.0311
    assert (tmp_path / "out" / "motor.png").read_bytes()[:4] == b"\x89PNG"
    folder(made, 0, {"torque.shunt": 1.05})
    assert main(["motor", str(made)]) == 1
    assert "torque.shunt 1.0" in capsys.readouterr().out


def test_waveforms_stand_for_trials(tmp_path: Path) -> None:
    path = folder(tmp_path, 6)
    ke = 0.0311 / S32
    for k, rpm in enumerate((1000.0, 1500.0, 2000.0, 2500.0, 3000.0)):
        omega = rpm * math.pi / 30.0
        t = np.arange(400) * 1e-4
        v = ke * omega * np.sin(12 * omega * t)
        (path / f"s{k}.csv").write_text(
            "Time (s),CH1 (V)\n" + "".join(f"{a:.4f},{b:.5f}\n" for a, b in zip(t, v, strict=True))
        )
    text = (
        (path / "motor.toml")
        .read_text()
        .replace('file = "back_emf.csv"', f"waveforms = {[f's{k}.csv' for k in range(5)]}")
    )
    text = text.replace('measure = "peak_to_peak"\n', "").replace(
        'winding = "delta"', 'winding = "delta"\npole_pairs = 12'
    )
    (path / "motor.toml").write_text(text)
    trials = motor_result.read(path)
    assert trials.measured.back_emf is not None
    assert trials.measured.back_emf.slope == pytest.approx(ke, rel=1e-3)


def test_faults_of_motor_toml_come_all_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder(tmp_path, 1) / "motor.toml"
    text = (
        path.read_text().replace('winding = "delta"', 'winding = "star"').replace("shunt_ohm = 250.0", "shunt = 250.0")
    )
    path.write_text(text.replace('measure = "peak_to_peak"', 'measure = "pp"'))
    assert main(["motor", str(path)]) == 2
    words = capsys.readouterr().err
    assert all(w in words for w in ("motor.winding", "torque.shunt", "torque.shunt_ohm", "back_emf.measure"))
    path.write_text(motor_trials.generate(1)["motor.toml"].replace("shunt_ohm = 250.0", "shunt_ohm = 2.5"))
    assert main(["motor", str(path)]) == 2
    assert "mA" in capsys.readouterr().err
    (tmp_path / "torque.csv").write_text("trial,current_A,shunt\n1,2,3\n")
    (tmp_path / "back_emf.csv").write_text("run,rpm,v_V\n1,2,3\n")
    assert main(["motor", str(path)]) == 2
    words = capsys.readouterr().err
    assert "column in V" in words and "no column trial" in words


@pytest.mark.parametrize("link", [False, True])
def test_results_never_replace_trials(tmp_path: Path, capsys: pytest.CaptureFixture[str], link: bool) -> None:
    path = folder(tmp_path, 2)
    if link:  # the same folder under another name
        (tmp_path.parent / f"{tmp_path.name}_link").symlink_to(tmp_path)
    (path / "torque.csv").rename(path / "trials.csv")
    text = (path / "motor.toml").read_text().replace('"torque.csv"', '"trials.csv"')
    (path / "motor.toml").write_text(text)
    before = {p.name: p.read_bytes() for p in path.iterdir()}
    out = str(tmp_path.parent / f"{tmp_path.name}_link") if link else str(path)
    assert main(["motor", str(path), "--out", out]) == 2
    said = capsys.readouterr()
    assert "trials.csv, which this run reads" in said.err and not said.out
    assert {p.name: p.read_bytes() for p in path.iterdir()} == before
    assert main(["motor", str(path), "--out", str(path / "out")]) == 0
    assert main(["motor", str(path), "--out", str(path / "motor.toml" / "deep")]) == 2
    assert "motor.toml, a file; expected a folder" in capsys.readouterr().err


@pytest.mark.parametrize("title", ["Motor", "Motor MN4006 KV380: generated trials, seed 0: nobody measured them, " * 3])
def test_no_title_is_cut(title: str) -> None:
    trials = {"data sheet": np.array([0.0308]), "torque sensor": np.linspace(0.03, 0.032, 5)}
    with Image.open(io.BytesIO(outputs.box_plot(trials, {"adopted": 0.031}, "constant [N m/A]", title))) as page:
        edges = np.asarray(page.convert("L"))[:, [0, -1]]
    assert edges.min() == 255, "ink on the edge"

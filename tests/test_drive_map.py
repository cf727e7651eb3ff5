"""Bench map: monotone, exact on made drives, invertible, exported alike."""

from __future__ import annotations

import csv
import io
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.data import readers as importers
from bemt.data.recordings.reduce import reduce
from bemt.physics.dataset import Dataset
from bemt.tools.drive import bench_map, map_result
from bemt.tools.drive.bench_map import join, map_points, points


def made(pulse: np.ndarray, volts: np.ndarray | float = 12.0, noise: float = 0.0, seed: int = 0) -> Dataset:
    """Steady points of a drive with a dead band, whose thrust goes with the square of the voltage."""
    volts = np.broadcast_to(np.asarray(volts, dtype=float), pulse.shape).copy()
    share = np.clip((pulse - 1080.0) / 920.0, 0.0, None)
    rng = np.random.default_rng(seed)
    thrust = 20.0 * share**1.7 * (volts / 12.0) ** 2 + noise * rng.standard_normal(len(pulse))
    values = {
        "thrust_N": thrust, "rpm": 9000.0 * share**0.85 * volts / 12.0, "current_A": 30.0 * share**2.4,
        "electrical_power_W": 30.0 * share**2.4 * volts, "voltage_V": volts,
    }  # fmt: skip
    return map_points(pulse, values)


LEVELS = np.linspace(1000.0, 2000.0, 21)


def test_the_map_is_monotone_and_near_the_truth_between_levels() -> None:
    chart = bench_map.fit(made(LEVELS, noise=0.05))
    pulse = np.linspace(1000.0, 2000.0, 2001)
    truth = made(pulse).thrust_N
    for name in chart.curves:
        assert np.all(np.diff(chart.at(name, pulse)) >= 0.0), name
    assert np.max(np.abs(chart.at("thrust", pulse) - truth)) < 0.01 * 20.0
    assert not chart.with_voltage and chart.full_thrust_N == pytest.approx(20.0, rel=0.01)


def test_the_inverse_returns_what_the_map_gives() -> None:
    chart = bench_map.fit(made(LEVELS, noise=0.05))
    wanted = np.linspace(0.1, 0.999, 50) * chart.full_thrust_N
    pulse = chart.pulse_for(wanted)
    assert np.allclose(chart.at("thrust", pulse), wanted, atol=1e-6)
    assert np.all(np.diff(pulse) > 0.0)
    assert np.isnan(chart.pulse_for(1.01 * chart.full_thrust_N))
    assert chart.pulse_for(-1.0) == 1000.0
    assert np.isnan(chart.at("thrust", 2001.0)) and np.isnan(chart.at("thrust", 999.0))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.0, 50.0), min_size=4, max_size=20), st.floats(1e-10, 10.0))
def test_any_points_give_a_monotone_map(thrust: list[float], smoothness: float) -> None:
    pulse = np.linspace(1000.0, 2000.0, len(thrust))
    base = made(pulse)
    chart = bench_map.fit(map_points(pulse, {**base.values, "thrust_N": np.array(thrust)}), smoothness)
    values = chart.at("thrust", np.linspace(1000.0, 2000.0, 300))
    assert np.all(np.diff(values) >= -1e-9 * max(1.0, *thrust)) and np.all(np.isfinite(values))


def test_two_batteries_make_voltage_a_parameter() -> None:
    both = join([made(LEVELS, 12.0 - 0.001 * (LEVELS - 1000.0)), made(LEVELS, 16.0 - 0.001 * (LEVELS - 1000.0))])
    chart = bench_map.fit(both)
    assert chart.with_voltage and chart.curves["thrust"].exponent == pytest.approx(2.0, abs=0.02)
    assert chart.curves["rpm"].exponent == pytest.approx(1.0, abs=0.02)
    pulse = float(chart.pulse_for(9.0, 14.0))
    assert made(np.array([pulse]), 14.0).thrust_N[0] == pytest.approx(9.0, abs=0.2)
    one = bench_map.fit(made(LEVELS, 12.0 - 0.001 * (LEVELS - 1000.0)))  # sag alone says nothing of another battery
    assert not one.with_voltage
    with pytest.raises(InputError, match="another battery voltage"):
        one.pulse_for(5.0, 14.0)
    assert one.voltage_at(1500.0) == pytest.approx(11.5, abs=0.02)


def test_held_out_levels_of_a_smooth_drive_are_met() -> None:
    trip = bench_map.held_out(made(LEVELS, noise=0.02))
    assert len(trip.error) == 19 and trip.worst < 0.01
    turning = trip.pulse_us > 1150.0  # below, thrust is flat and any pulse width gives it
    assert np.allclose(trip.pulse_found_us[turning], trip.pulse_us[turning], atol=12.0)


def test_scatter_of_the_readings_is_told_from_that_of_the_esc() -> None:
    rng = np.random.default_rng(1)
    pulse = np.linspace(1100.0, 2000.0, 40)
    kinked = pulse + 40.0 * rng.standard_normal(pulse.size)  # an ESC that obeys badly: speed and thrust move together
    rpm = 10.0 * (kinked - 900.0)
    thrust = 2e-7 * rpm**2
    full = thrust.max()

    def points_of(T: np.ndarray) -> Dataset:
        return map_points(pulse, {"thrust_N": T, "rpm": rpm})

    assert bench_map.held_out(points_of(thrust)).rms > 0.02
    assert np.max(np.abs(map_result.speed_known(points_of(thrust)))) < 1e-12
    noise = 0.01 * full * rng.standard_normal(pulse.size)
    rms = map_result.scatter(points_of(thrust + noise))[2]
    assert 0.007 < rms < 0.025  # the level's own reading and its two neighbours'
    points, *errors = map_result.scatter(map_points(pulse, {"thrust_N": thrust}))
    assert points == 0 and np.isnan(errors).all()


def log(tmp_path: Path, sign: int = 1, extra: str = "") -> Path:
    rows = ["Time (s),ESC signal (us),Thrust (N),Voltage (V),Current (A),Motor Optical Speed (RPM)"]
    t = 0.0
    for pulse in np.linspace(1000.0, 2000.0, 11):
        p = made(np.array([pulse]))
        for _ in range(20):
            t += 0.1
            rows.append(f"{t:.2f},{pulse:.0f},{sign * p.thrust_N[0]:.4f},12.0,{p.current_A[0]:.3f},{p.rpm[0]:.0f}")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows) + "\n" + extra)
    return path


def test_command_writes_tables_that_agree(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = log(tmp_path), tmp_path / "out"
    assert main(["map", str(path), "--out", str(out), "--json", "--thrust-N", "10", "--name", "my drive"]) == 0
    doc = json.loads(capsys.readouterr().out)
    assert doc["schema"] == "bemt.map/1" and doc == json.loads((out / "my drive.map.json").read_text())
    assert doc["steady_points"] == 11 and doc["held_out"]["worst_of_full_thrust"] < 0.02
    table = list(csv.DictReader(io.StringIO((out / "my drive.map.csv").read_text())))
    assert [float(r["thrust_N"]) for r in table] == pytest.approx(doc["forward"]["thrust_N"])
    inverse = list(csv.DictReader(io.StringIO((out / "my drive.inverse.csv").read_text())))
    near = np.interp(10.0, [float(r["thrust_N"]) for r in inverse], [float(r["pulse_us"]) for r in inverse])
    assert near == pytest.approx(doc["answer"]["pulse_us"], abs=2.0)
    assert (out / "my drive.map.png").read_bytes()[:4] == b"\x89PNG"
    assert not list(out.glob(".*"))


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize("batteries", [1, 2])
def test_the_c_header_compiles_and_gives_the_map(tmp_path: Path, batteries: int) -> None:
    chart = bench_map.fit(join([made(LEVELS, 12.0 + 4.0 * k) for k in range(batteries)]))
    (tmp_path / "map.h").write_text(map_result.c_header(chart, "2 fans", 101))
    volts = chart.voltage_ref if batteries == 2 else None
    arg = f", {volts}f" if volts else ""
    calls = "".join(
        f'printf("%.4f %.4f\\n", m_2_fans_pulse({t}.0f{arg}), m_2_fans_thrust({p}.0f{arg}));'
        for t, p in ((1, 1200), (5, 1500), (15, 1900), (1000, 2500))
    )
    program = f'#include <stdio.h>\n#include "map.h"\nint main(void) {{ {calls} return 0; }}\n'
    (tmp_path / "a.c").write_text(program)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-const-variable"]
    subprocess.run(["cc", *flags, "a.c", "-o", "a", "-lm"], cwd=tmp_path, check=True, capture_output=True)
    run = subprocess.run([str(tmp_path / "a")], capture_output=True, text=True, check=True).stdout
    got = np.array([[float(c) for c in line.split()] for line in run.splitlines()])
    assert np.allclose(got[:3, 0], chart.pulse_for([1.0, 5.0, 15.0]), atol=1.5)
    assert np.allclose(got[:3, 1], chart.at("thrust", [1200.0, 1500.0, 1900.0]), atol=0.01)
    assert got[3, 0] == pytest.approx(2000.0) and got[3, 1] == pytest.approx(chart.full_thrust_N, rel=1e-4)  # held


def test_bad_recordings_are_refused_with_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    turned, bare = log(tmp_path, sign=-1), tmp_path / "bare.csv"
    bare.write_text("Time (s),Thrust (N)\n" + "".join(f"{0.1 * k:.1f},{k}\n" for k in range(30)))
    assert main(["map", str(turned), str(bare)]) == 2
    text = capsys.readouterr().err
    assert "--sign -1" in text and "no pulse width and no throttle" in text  # both files at once
    assert main(["map", str(turned), "--sign", "-1"]) == 0


# Where a recording repeats itself worse than 1 %, no map can hold 1 %: reports/drive/README.md lists all of them.
REAL = [
    ("thrust_map/xNova-SR-steps.csv", -1, 0.010),
    ("rcbenchmark/a1_7.csv", 1, 0.010),
    ("rcbenchmark/a4_7.csv", 1, 0.010),
    ("jmajew/grp01__mn2206_gemfanbull6045_3s_table1.csv", 1, 0.010),
    ("jmajew/grp01__f1507_t3140_4s_table1.csv", 1, 0.010),
    ("jmajew/grp01__mn2206_hqprop6x4x3_3s_table1.csv", 1, 0.010),
]


@pytest.mark.parametrize(("file", "sign", "worst"), REAL)
def test_round_trip_on_held_out_plateaus_of_real_recordings(
    shared_data: Path, file: str, sign: int, worst: float
) -> None:
    trip = bench_map.held_out(points(importers.read(shared_data / file), file, sign))
    assert trip.worst <= worst and trip.rms <= 0.5 * worst + 0.001


def test_where_a_round_trip_misses_the_readings_themselves_scatter(shared_data: Path) -> None:
    """Recordings that miss 1 %: with the speed of each level known, and so without ESC and battery, they still do."""
    names = [
        "grp01__dualsky-eco2814c-v2_graupner-12x6_3s_table1",
        "grp01__f1507_hqprop76x8_4s_table4",
        "grp01__mn2206_hqprop6x3-5_3s_table2",
    ]
    files = [shared_data / "jmajew" / f"{name}.csv" for name in names]
    files += [shared_data / "rcbenchmark" / f"StepsTest_2020-{d}.csv" for d in ("05-23_154840", "06-16_212732")]
    for file in files:
        got = points(importers.read(file), file.name)
        assert bench_map.held_out(got).worst > 0.01, file.name
        assert map_result.scatter(got)[1] > 0.01, file.name


def test_five_runs_on_one_emptying_battery_tell_the_voltage(shared_data: Path) -> None:
    files = sorted((shared_data / "jmajew").glob("grp01__mn2206_hqprop6x3-5_3s_table*.csv"))
    runs = join([points(importers.read(f), f.name, 1, i) for i, f in enumerate(files)])
    assert bench_map.fit(runs).with_voltage and bench_map.held_out(runs).rms < 0.008


def test_another_battery_of_a_real_drive_is_told_by_the_voltage(shared_data: Path) -> None:
    runs = [
        points(importers.read(shared_data / "rcbenchmark" / f"a1_{v}.csv"), "", 1, i) for i, v in enumerate((7, 11))
    ]
    chart = bench_map.fit(join(runs))
    assert chart.with_voltage and 1.4 < chart.curves["thrust"].exponent < 2.2
    assert bench_map.held_out(join(runs)).rms < 0.01


def test_recordings_without_a_map_in_them_are_refused(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A motor without propeller, and a run whose supply gave up half-way."""
    bare = shared_data / "jmajew" / "grp01__racestar-br2507s_noprop_3s_table1.csv"
    broken = shared_data / "rcbenchmark" / "StepsTest_2020-06-16_214537.csv"
    for path in (bare, broken):
        assert main(["map", str(path)]) == 2
        assert "from any rising curve" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--thrust-N", "nan"), "--thrust-N: got nan; expected a finite number of 0 or more [N]."),
        (("--thrust-N", "inf"), "--thrust-N: got inf"),
        (("--thrust-N=-5",), "--thrust-N: got -5; expected a finite number of 0 or more [N]. --sign -1"),
        (("--nodes", "1"), "--nodes: got 1; expected 2 or more"),
        (("--name", "../evil"), "--name: got '../evil'"),
        (("--name", ".."), "--name: got '..'"),
        (("--name", ""), "--name: got ''"),
        (("--name", "a\\b"), "--name: got"),
        (("--voltage-V", "12"), "--voltage-V: got 12; expected none without --thrust-N"),
        (("--thrust-N", "5", "--voltage-V", "-3"), "--voltage-V: got -3; expected a finite number above 0 [V]."),
        (("--thrust-N", "5", "--voltage-V", "nan"), "--voltage-V: got nan"),
    ],
)
def test_bad_options_are_refused_and_nothing_is_written(
    tmp_path: Path, words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = log(tmp_path)
    # together with what is wrong with a file
    assert main(["map", str(path), str(tmp_path / "none.csv"), *words, "--out", str(tmp_path / "in" / "out")]) == 2
    said = capsys.readouterr()
    assert message in said.err and "none.csv" in said.err and not said.out
    assert main(["map", str(path), *words, "--out", str(tmp_path / "in" / "out")]) == 2
    assert {p.name for p in tmp_path.iterdir()} == {"log.csv"}


def test_thrust_out_of_reach_is_told_by_the_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(log(tmp_path))
    assert main(["map", path, "--thrust-N", "1e9"]) == 1
    assert "1e+09 N: pulse width more than this drive can give" in capsys.readouterr().out
    assert main(["map", path, "--thrust-N", "1e9", "--json", "--out", str(tmp_path / "out")]) == 1
    doc = json.loads(capsys.readouterr().out)
    assert doc["answer"]["pulse_us"] is None and doc == json.loads((tmp_path / "out" / "log.map.json").read_text())
    assert main(["map", path, "--thrust-N", "0", "--nodes", "2"]) == 0


def test_a_recording_counts_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = log(tmp_path)
    (tmp_path / "link.csv").symlink_to(path)
    for again in (path, tmp_path / "link.csv", tmp_path / "x" / ".." / "log.csv"):
        (tmp_path / "x").mkdir(exist_ok=True)
        assert main(["map", str(path), str(again)]) == 2
        assert f"got the recording of {path} again; expected each recording once." in capsys.readouterr().err
    copy = tmp_path / "copy.csv"  # another file may hold the same readings
    copy.write_text(path.read_text())
    assert main(["map", str(path), str(copy)]) == 0


def test_results_never_replace_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = log(tmp_path).rename(tmp_path / "stand.map.csv")
    before = path.read_bytes()
    assert main(["map", str(path), "--name", "stand", "--out", str(tmp_path)]) == 2
    assert "stand.map.csv, which this run reads" in capsys.readouterr().err
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1
    assert main(["map", str(path), "--name", "fan", "--out", str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("head", "full", "code"), [("throttle", 100, 0), ("throttle (%)", 100, 0), ("throttle", 1000, 2)]
)
def test_a_throttle_without_its_unit_is_percent_where_it_can_be_nothing_else(
    head: str, full: float, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"{full * k / 5:g},{2000 + 2000 * k},{0.2 + 0.7 * k**1.6:.3f}\n" for k in range(1, 6))
    (tmp_path / "log.csv").write_text(f"{head},rpm,thrust_N\n{rows}")
    assert main(["map", str(tmp_path / "log.csv"), "--out", str(tmp_path / "map")]) == code
    if code == 0:
        first = next(line for line in capsys.readouterr().out.splitlines() if line.strip()[:1].isdigit())
        assert float(first.split()[0]) == pytest.approx(1200.0)


def limited(limit_A: float) -> Dataset:
    """A drive whose supply holds 12 V up to a current, and that current above it."""
    pulse = np.linspace(1100.0, 2000.0, 19)
    wanted = made(pulse)
    volts = np.where(wanted.current_A > limit_A, 12.0 * (limit_A / wanted.current_A) ** 0.4, 12.0)
    given = made(pulse, volts)
    return replace(given, values=dict(given.values) | {"current_A": np.minimum(wanted.current_A, limit_A)})


def test_a_supply_in_its_current_limit_bounds_the_map_and_it_is_said() -> None:
    whole, short = limited(100.0), bench_map._below_limit(limited(12.0))
    assert bench_map._below_limit(whole) is whole
    chart = bench_map.fit(short)
    assert 0.0 < np.max(short.current_A) <= 12.0 and chart.pulse_range_us[1] <= 1700.0
    assert not chart.with_voltage and chart.full_thrust_N <= 1.01 * np.max(limited(12.0).thrust_N)
    assert any("current limit" in note and "12 A" in note for note in chart.notes)
    falling = limited(12.0).select(np.arange(19)[::-1])
    assert np.array_equal(np.sort(bench_map._below_limit(falling).pulse_us), short.pulse_us)


def test_an_emptying_battery_is_no_supply_in_its_limit() -> None:
    runs = [made(LEVELS[2:], volts) for volts in np.linspace(12.6, 10.8, 4)]
    log = join([replace(run, provenance={"ramp": False}) for run in runs])
    assert bench_map._below_limit(log) is log


@pytest.mark.parametrize("layout", ["samples", "table"])
def test_the_map_takes_the_zero_at_rest_as_import_does(layout: str, tmp_path: Path) -> None:
    """A stand that reads 0.3 N with the motor stopped, and drifts: at rest the map gives no thrust."""
    pulse = np.concatenate([[1000.0], np.linspace(1100.0, 2000.0, 10), [1000.0]])
    pulse = np.repeat(pulse, 40) if layout == "samples" else pulse
    time = 0.05 * np.arange(pulse.size) if layout == "samples" else 10.0 * np.arange(pulse.size)
    share = np.clip((pulse - 1080.0) / 920.0, 0.0, None)
    truth, zero = 20.0 * share**1.7, 0.3 + 0.2 * time / time[-1]
    rows = zip(time, 1e-6 * pulse, truth + zero, 9000.0 * share**0.85, strict=True)
    file = tmp_path / "t.csv"
    file.write_text(
        "time (s),pulse width (s),thrust (N),rpm\n"
        + "".join(f"{a:.3f},{b:.7f},{c:.5f},{d:.2f}\n" for a, b, c, d in rows)
    )
    found = points(importers.read(file))
    expected = 20.0 * np.clip((found.pulse_us - 1080.0) / 920.0, 0.0, None) ** 1.7
    assert np.max(np.abs(found.thrust_N - expected)) < 0.02
    assert any(note.startswith("thrust_N: zero") for note in found.notes)
    reduced = reduce(importers.read(file))
    at = np.array([np.argmin(np.abs(found.pulse_us - 1e6 * p)) for p in reduced["pwm_s"]])
    assert np.allclose(found.thrust_N[at], reduced.thrust_N, atol=0.02)

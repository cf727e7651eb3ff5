"""Promise: a sweep puts every source side by side, survives a kill, and one bad case never stops the others."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt.base.tables import csv_block, json_text, number_text, plain
from bemt.bem import Model
from bemt.case import load_case
from bemt.case.prepare import prepare_case
from bemt.compare.grid import run as grid_module
from bemt.compare.sweep import batch as sweep_module
from bemt.compare.sweep import fingerprint, sweep
from bemt.compare.sweep.agreement import agreement, known, needed
from bemt.compare.sweep.case import solve_case
from bemt.compare.sweep.summary import summary
from bemt.formula.k1k2 import U_MEASURED

ROOT = Path(__file__).resolve().parents[1]
KGF = 9.80665

CASE = """
schema = "bemt.case/1"
name = "{name}"
references = "references.csv"
[rotor]
kind = "propeller"
blades = 2
diameter_in = 10
hub_ratio = 0.15
[blade]
pitch_in = 5
chord_law = "apc_like"
max_chord_over_R = 0.2
[blade.section]
naca = "4412"
[[polars]]
file = "polar.csv"
r_over_R = 0.75
[operating]
rpm = 6000
[air]
density_kg_m3 = 1.2
[model]
stations = 20
[[assumptions]]
key = "blade.max_chord_over_R"
low = 0.18
high = 0.22
why = "made for a test of the propagation"
[[assumptions]]
key = "rotor.hub_ratio"
low = 0.1
high = 0.2
why = "made for a test of the propagation"
"""
REFERENCES = """quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3
thrust,0.5,kgf,0.01,bench,stand,,6000,0,1.2
thrust,0.45,kgf,unknown,cfd,solver,,6000,0,1.2
torque,0.08,N m,0.002,bench,stand,,6000,0,1.2
thrust,0.30,kgf,unknown,vendor,maker,,5000,,
thrust,0.48,kgf,unknown,k1k2_printed,thesis,,6000,0,1.2
"""
GRID = """
[sweep]
rpm = {start = 3000, stop = 9000, num = 10}
airspeed_m_s = {start = 0, stop = 10, num = 10}
pitch_in = {start = 3, stop = 8, num = 96}
"""


def make_case(folder: Path, name: str = "one", extra: str = "", references: str = REFERENCES) -> Path:
    """Write a case with its own section table, so that no network is loaded."""
    here = folder / name
    here.mkdir(parents=True)
    alpha = np.arange(-20.0, 21.0)
    cl = np.clip(0.1 * (alpha + 4.0), -0.9, 1.3)
    rows = [f"{a:g},{c:.5f},{0.012 + 0.008 * c * c:.5f}" for a, c in zip(alpha, cl, strict=True)]
    (here / "polar.csv").write_text("alpha_deg,cl,cd\n" + "\n".join(rows) + "\n")
    (here / "references.csv").write_text(references)
    (here / "case.toml").write_text(CASE.replace("{name}", name) + extra)
    return here / "case.toml"


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Solve one case as `sweep` does."""
    folder = tmp_path_factory.mktemp("cases")
    make_case(folder)
    document = sweep([folder])
    return dict(document["cases"][0])


def row_of(result: dict[str, Any], source: str, at: int = 0) -> dict[str, Any]:
    """Row of a source."""
    return [row for row in result["rows"] if row["source"] == source][at]  # type: ignore[no-any-return]


def assumed(folder: Path, key: str, low: float, high: float, air: str = "density_kg_m3 = 1.2") -> dict[str, Any]:
    """Solve the case with one more assumption; the references state their own conditions."""
    extra = f'[[assumptions]]\nkey = "{key}"\nlow = {low}\nhigh = {high}\nwhy = "made for a test"\n'
    path = make_case(folder, key.replace(".", "_"), extra)
    text = path.read_text().replace("rpm = 6000", "rpm = 6000\nairspeed_m_s = 3").replace("density_kg_m3 = 1.2", air)
    path.write_text(re.sub(r'\[\[assumptions\]\]\nkey = "(blade|rotor)[^\[]*', "", text))
    return solve_case(load_case(path))


@pytest.mark.parametrize(
    ("key", "low", "high", "model"),
    [
        ("operating.airspeed_m_s", 2.0, 4.0, "bemt"),
        ("operating.airspeed_m_s", 2.0, 4.0, "k1k2"),
        ("operating.rpm", 5900.0, 6100.0, "k1k2"),
        ("air.density_kg_m3", 1.1, 1.3, "k1k2"),
        ("air.density_kg_m3", 1.1, 1.3, "bemt"),
    ],
)
def test_an_assumption_on_a_condition_reaches_both_models(
    tmp_path: Path, key: str, low: float, high: float, model: str
) -> None:
    result = assumed(tmp_path, key, low, high)
    assert row_of(result, model)["u_input"] > 1e-3 * row_of(result, model)["thrust_N"]


def test_an_assumption_on_temperature_leaves_the_density_that_a_reference_states(tmp_path: Path) -> None:
    air = "pressure_hPa = 1013.25\ntemperature_C = 20"
    result = assumed(tmp_path, "air.temperature_C", 0.0, 40.0, air)
    own, reference = (row_of(result, "bemt", i) for i in (0, 1))
    assert own["density_kg_m3"] != pytest.approx(reference["density_kg_m3"])
    assert own["u_input"] > 0.02 * own["thrust_N"]  # density moves by +-7 %
    assert reference["u_input"] < 0.005 * reference["thrust_N"]  # viscosity and Mach number only


REQUIRED = {"source": str, "thrust_N": float, "thrust_kgf": float, "torque_Nm": float, "CT": float, "CP": float,
            "rpm": float, "airspeed_m_s": float, "M_tip": float, "Re": float, "u": float, "flags": list}  # fmt: skip


def test_document_has_the_declared_schema(tmp_path: Path) -> None:
    make_case(tmp_path, "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "case.toml").write_text("schema = 1")
    document = json.loads(json_text(sweep([tmp_path])))
    assert document["schema"] == "bemt.sweep/1"
    assert [case["name"] for case in document["cases"]] == ["a", "b"]
    for case in document["cases"]:
        for row in case["rows"]:
            assert row["source"] in {"bemt", "k1k2", "cfd", "bench", "vendor"}
            for key, kind in REQUIRED.items():
                assert key in row
                assert row[key] is None or isinstance(row[key], (kind, int)), key
            assert math.isclose(row["thrust_N"], row["thrust_kgf"] * KGF, rel_tol=1e-9)


def test_every_source_has_its_row_at_every_operating_point(solved: dict[str, Any]) -> None:
    assert [(r["source"], r["rpm"]) for r in solved["rows"]] == [
        ("bemt", 6000), ("k1k2", 6000), ("bemt", 5000), ("k1k2", 5000),
        ("bench", 6000), ("cfd", 6000), ("vendor", 5000),
    ]  # fmt: skip
    assert [r["source"] for r in solved["other_rows"]] == ["k1k2_printed"]
    assert row_of(solved, "vendor")["density_kg_m3"] == 1.2  # empty cells of the table: as the case says


def test_recorded_coefficients_follow_from_the_recorded_values(solved: dict[str, Any]) -> None:
    row = row_of(solved, "bench")
    n, D = 100.0, 0.254
    assert row["CT"] == pytest.approx(0.5 * KGF / (1.2 * n**2 * D**4), rel=1e-9)
    assert row["CP"] == pytest.approx(2 * math.pi * 0.08 / (1.2 * n**2 * D**5), rel=1e-9)
    assert row["u"] == pytest.approx(0.01 * KGF, rel=1e-9)
    assert row_of(solved, "cfd")["u"] is None


def test_k1k2_is_the_published_formula_at_the_density_of_the_case(solved: dict[str, Any]) -> None:
    v = 6000 / 60 * 0.127
    F = 1.2 * math.pi / 4 * 0.254**2 * v**2 * (2 / 3.29546) ** 1.5
    assert row_of(solved, "k1k2")["thrust_N"] == pytest.approx(F, rel=1e-9)


def test_errors_and_validation_uncertainty_are_those_of_vv20(solved: dict[str, Any]) -> None:
    S = row_of(solved, "bemt")["thrust_N"]
    lines = {(c["model"], c["source"], c["quantity"]): c for c in solved["comparisons"]}
    line = lines["bemt", "bench", "thrust_N"]
    assert line["E"] == pytest.approx(S - 0.5 * KGF, rel=1e-8)
    assert line["E_pct"] == pytest.approx(100 * (S / (0.5 * KGF) - 1), rel=1e-8)
    assert line["u_val"] == pytest.approx(math.hypot(line["u_num"], line["u_input"], line["u_model"], 0.01 * KGF))
    assert line["verdict"] == ("not distinguishable from noise" if abs(line["E"]) <= line["u_val"] else "differs")
    unknown = lines["bemt", "cfd", "thrust_N"]
    assert unknown["u_val"] is None and unknown["u_D"] is None and "u_D unknown" in unknown["verdict"]
    assert row_of(solved, "bench")["bemt_error_pct"] == line["E_pct"]
    assert {c["quantity"] for c in solved["comparisons"] if c["source"] == "bench"} == {"thrust_N", "torque_Nm"}


def test_input_uncertainty_is_that_of_the_uniform_ranges(tmp_path: Path, solved: dict[str, Any]) -> None:
    case = load_case(make_case(tmp_path))

    def thrust(key: str, value: float) -> float:
        return float(prepare_case(case, {key: value}).solve(case.rpm, 0.0, case.air()).thrust_N[0])

    nominal = float(prepare_case(case).solve(case.rpm, 0.0, case.air()).thrust_N[0])
    variance = 0.0
    ends = []
    for key, low, high in (("blade.max_chord_over_R", 0.18, 0.22), ("rotor.hub_ratio", 0.1, 0.2)):
        a, c = thrust(key, low), thrust(key, high)
        ends += [a, c]
        # second moment of the parabola through both ends and the middle, by quadrature
        x = np.linspace(-1, 1, 200_001)
        f = nominal + 0.5 * (c - a) * x + (0.5 * (a + c) - nominal) * x**2
        variance += float(np.trapezoid((f - np.trapezoid(f, x) / 2) ** 2, x) / 2)
    row = row_of(solved, "bemt")
    assert row["u_input"] == pytest.approx(math.sqrt(variance), rel=1e-6)
    assert row["thrust_N_range"] == pytest.approx([min([nominal, *ends]), max([nominal, *ends])], rel=1e-9)
    refined = float(prepare_case(case, None, 40).solve(case.rpm, 0.0, case.air()).thrust_N[0])
    assert row["u_num"] == pytest.approx(abs(refined - nominal), rel=1e-6)
    assert row["u"] == pytest.approx(math.hypot(row["u_input"], row["u_num"], row["u_model"]), rel=1e-9)


def test_assumptions_stand_in_every_output(tmp_path: Path) -> None:
    make_case(tmp_path, "one")
    document = sweep([tmp_path], tmp_path / "out")
    table = (tmp_path / "out" / "one" / "table.txt").read_text()
    for place in (json_text(document), table):
        for words in ("blade.max_chord_over_R", "rotor.hub_ratio", "made for a test of the propagation"):
            assert words in place
    assert "0.18 .. 0.22" in table and "unknown" in table


def test_bad_cases_do_not_stop_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a_syntax", "b_bug", "c_fine", "d_references", "e_fine"):
        make_case(tmp_path, name, references="nonsense\n" if "references" in name else REFERENCES)
    (tmp_path / "a_syntax" / "case.toml").write_text("rpm = = 3")

    def fragile(case: Any, *args: Any) -> Any:
        if case.name == "b_bug":
            raise ZeroDivisionError("planted")
        return solve_case(case, *args)

    monkeypatch.setattr(sweep_module, "solve_case", fragile)
    document = sweep([tmp_path])
    by_name = {case["name"]: case for case in document["cases"]}
    assert {name: case["exit_code"] for name, case in by_name.items()} == {
        "a_syntax": 2, "b_bug": 3, "c_fine": 0, "d_references": 2, "e_fine": 0,
    }  # fmt: skip
    assert document["exit_code"] == 3
    assert by_name["c_fine"]["rows"] and by_name["e_fine"]["rows"]
    assert any("planted" in fault for fault in by_name["b_bug"]["faults"])
    assert by_name["a_syntax"]["faults"][0].endswith(
        "1:7: got no value that TOML knows in `rpm = = 3`; expected valid TOML 1.0."
    )


def test_two_cases_of_one_name_are_refused(tmp_path: Path) -> None:
    make_case(tmp_path, "one")
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    document = sweep([tmp_path])
    assert [case["exit_code"] for case in document["cases"]] == [0, 2]
    assert "a name of its own" in document["cases"][1]["faults"][0]
    text = (tmp_path / "two" / "case.toml").read_text()
    (tmp_path / "two" / "case.toml").write_text(text + "# another case under the name of the first\n")
    sweep([tmp_path], tmp_path / "out")
    stored = json.loads((tmp_path / "out" / document["cases"][0]["name"] / "result.json").read_text())
    mark = fingerprint(load_case(tmp_path / "one").content_hash())
    assert stored["fingerprint"] == mark, "the refused one has left nothing there"


def test_processes_give_what_one_process_gives(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        make_case(tmp_path / "cases", name)
    (tmp_path / "cases" / "b" / "case.toml").write_text("x")
    one = sweep([tmp_path / "cases"], tmp_path / "one")
    three = sweep([tmp_path / "cases"], tmp_path / "two", jobs=3)
    assert json_text(one) == json_text(three)
    assert tree(tmp_path / "one") == tree(tmp_path / "two")


def tree(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_result_is_reused_only_while_nothing_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_case(tmp_path / "cases")
    first = sweep([path], tmp_path / "out")
    calls: list[str] = []

    def counting(case: Any, *args: Any) -> Any:
        calls.append(case.name)
        return solve_case(case, *args)

    monkeypatch.setattr(sweep_module, "solve_case", counting)
    assert json_text(sweep([path], tmp_path / "out")) == json_text(first)
    assert calls == []
    sweep([path], tmp_path / "out", resume=False)
    assert calls == ["one"]
    for name in ("references.csv", "polar.csv"):  # any file that the case names counts
        file = path.parent / name
        file.write_text(file.read_text().replace("0.5,kgf", "0.51,kgf").replace("\n0,0.4", "\n0,0.41"))
        calls.clear()
        sweep([path], tmp_path / "out")
        assert calls == ["one"], name
    (tmp_path / "out" / "one" / "result.json").write_text('{"fingerprint": 1')  # half a file from elsewhere
    calls.clear()
    sweep([path], tmp_path / "out")
    assert calls == ["one"]


def read_grid(path: Path) -> tuple[list[str], np.ndarray]:
    """Header and numbers of a grid."""
    with path.open() as stream:
        rows = list(csv.reader(stream))
    return rows[0], np.array(rows[1:], dtype=float)


def test_grid_holds_every_combination_and_equals_single_points(tmp_path: Path) -> None:
    extra = "[sweep]\nrpm = [3000, 6000]\naltitude_m = [0, 2000]\npitch_in = [4, 5, 6]\nairspeed_m_s = [0, 5]\n"
    case = load_case(make_case(tmp_path / "cases", extra=extra))
    document = sweep([case.path], tmp_path / "out")
    names, rows = read_grid(tmp_path / "out" / "one" / "grid.csv")
    assert names[:4] == ["pitch_in", "altitude_m", "rpm", "airspeed_m_s"]
    combinations = [(p, h, w, v) for p in (4, 5, 6) for h in (0, 2000) for w in (3000, 6000) for v in (0, 5)]
    assert [tuple(row[:4]) for row in rows.tolist()] == combinations
    for row in rows:
        pitch, altitude, rpm, speed = row[:4]
        overrides = {"blade.pitch_in": pitch, "air.altitude_m": altitude}
        single = prepare_case(case, overrides).solve(rpm, speed, case.air(overrides))
        for name, value in zip(names[4:-1], row[4:-1], strict=True):
            assert value == pytest.approx(float(getattr(single, name)[0]), rel=1e-6, abs=1e-90), name
        assert row[-1] == 1
    summary = document["cases"][0]["grid"]
    assert (summary["points"], summary["unconverged"], summary["file"]) == (24, 0, "one/grid.csv")
    assert summary["thrust_N"] == pytest.approx([rows[:, 4].min(), rows[:, 4].max()], rel=1e-6)


def test_interrupted_grid_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_case(tmp_path / "cases", extra=GRID)
    chunks: list[int] = []
    real = grid_module.solve_chunk

    def interrupted(solver: Any, number: int) -> Any:
        if number == 3 and not chunks.count(-1):
            chunks.append(-1)
            raise KeyboardInterrupt
        chunks.append(number)
        return real(solver, number)

    monkeypatch.setattr(grid_module, "solve_chunk", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sweep([path], tmp_path / "out")
    assert not (tmp_path / "out" / "one" / "grid.csv").exists()
    assert not (tmp_path / "out" / "one" / "result.json").exists()
    sweep([path], tmp_path / "out")
    assert chunks == [0, 1, 2, -1, 3, 4, 5]
    sweep([path], tmp_path / "whole")
    assert tree(tmp_path / "out") == tree(tmp_path / "whole")


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_killed_sweep_resumes_and_equals_an_uninterrupted_one(tmp_path: Path) -> None:
    make_case(tmp_path / "cases", "a")
    make_case(tmp_path / "cases", "b", extra=GRID)
    out, whole = tmp_path / "out", tmp_path / "whole"
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "bemt", "sweep", str(tmp_path / "cases"), "--json"]
    process = subprocess.Popen([*command, "--out", str(out)], env=env, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(list(out.glob("b/grid.parts-*/*.json"))) < 2 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.005)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    assert not (out / "b" / "grid.csv").exists() and not (out / "sweep.json").exists()
    (out / "b" / ".grid.csv.99.tmp").write_text("half a file")  # as a kill during a write leaves it
    parts = {p: p.stat().st_mtime_ns for p in out.glob("b/grid.parts-*/00000[01].json")}
    assert len(parts) == 2
    kept = (out / "a" / "result.json").stat().st_mtime_ns
    resumed = subprocess.run([*command, "--out", str(out)], env=env, capture_output=True, check=True)
    assert (out / "a" / "result.json").stat().st_mtime_ns == kept
    fresh = subprocess.run([*command, "--out", str(whole)], env=env, capture_output=True, check=True)
    assert resumed.stdout == fresh.stdout
    assert tree(out) == tree(whole)


@pytest.mark.skipif(os.name == "nt", reason="needs SIGINT")
@pytest.mark.parametrize("jobs", [[], ["--jobs", "2"]])
def test_interrupt_ends_at_once_with_130_and_no_half_file(tmp_path: Path, jobs: list[str]) -> None:
    for name in ("a", "b"):
        make_case(tmp_path / "cases", name, extra=GRID.replace("num = 96", "num = 960"))
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "bemt", "sweep", str(tmp_path / "cases"), "--out", str(tmp_path / "out"), *jobs]
    # in the background of a shell the signal is ignored, and children inherit that
    process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # fmt: skip
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("out/*/grid.parts-*/*.json")) and time.monotonic() < deadline:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert output == "" and errors.splitlines()[-1] == "interrupted" and "Traceback" not in errors
    assert not list(tmp_path.glob("out/*/grid.csv"))


def test_strict_turns_a_large_error_into_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bemt.commands.cli import main

    path = str(make_case(tmp_path))
    assert main(["sweep", path, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["sweep", path, "--quiet", "--strict", "--tolerance", "1e6"]) == 0
    assert main(["sweep", path, "--quiet", "--strict", "--tolerance", "1e-6"]) == 1
    assert "BEMT thrust" in capsys.readouterr().err


def test_unconverged_points_are_counted_and_never_zero(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import dataclasses

    solved = Model.solve

    def failing(*args: Any, **kwargs: Any) -> Any:
        points = solved(*args, **kwargs)
        lost = dict.fromkeys(("thrust_N", "torque_Nm", "power_W", "CT", "CP"), np.full(len(points), np.nan))
        return dataclasses.replace(
            points, values={**points.values, **lost}, flags=(("not converged: planted",),) * len(points)
        )

    monkeypatch.setattr(Model, "solve", failing)
    path = make_case(tmp_path, extra="[sweep]\nrpm = [3000, 6000]\n")
    result = json.loads(json_text(sweep([path], tmp_path / "out")))["cases"][0]
    bemt = row_of(result, "bemt")
    assert bemt["thrust_N"] is None and bemt["converged"] is False and bemt["flags"] == ["not converged: planted"]
    assert result["grid"]["unconverged"] == 2
    _, rows = read_grid(tmp_path / "out" / "one" / "grid.csv")
    assert np.isnan(rows[:, 1]).all() and (rows[:, -1] == 0).all()
    assert sweep_module.off_tolerance(result, 1e9) == [
        "one: unconverged at 6000 rev/min, 0 m/s", "one: unconverged at 5000 rev/min, 0 m/s",
        "one: 2 of 2 grid points unconverged",
    ]  # fmt: skip


def test_csv_block_agrees_with_printf() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=20_000) * 10.0 ** rng.integers(-30, 30, 20_000)
    values = np.concatenate([values, [0.0, 1.0, -1.0, 9.9999999, 99999995.0, 1e22, np.nan, np.inf, -np.inf]])
    lines = csv_block([values]).decode().splitlines()
    assert lines[:-3] == [f"{v:.6e}" for v in values[:-3]]
    assert lines[-3:] == ["nan", "inf", "-inf"]


def test_numbers_for_people_and_for_json() -> None:
    assert [number_text(v) for v in (24.0851, 99999.9, 0.00011, 1e-7, -0.5)] == ["24.09", "100000", "0.0001100",
                                                                                 "1.000e-07", "-0.5000"]  # fmt: skip
    assert plain([np.float64("nan"), np.int64(3), np.bool_(True), (1.23456789012345,)]) == [None, 3, True, [1.23456789]]


@pytest.mark.parametrize(
    ("name", "kgf"), [("prop_8x5", 2.456), ("prop_10x5", 5.363), ("prop_12x6", 11.121), ("prop_14x8", 22.025)]
)
def test_k1k2_of_the_shipped_cases(name: str, kgf: float) -> None:
    from bemt.case.prepare import k1k2_case

    case = load_case(ROOT / "cases" / name)
    made = k1k2_case(case, None, np.array([case.rpm]), np.array([0.0]), case.air())
    assert made.thrust_N[0] / KGF == pytest.approx(kgf, abs=1e-3)


def test_one_screen_says_what_differs_most(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bemt.commands.cli import main

    assert main(["sweep", str(project / "cases")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 45 and max(map(len, lines)) <= 80
    text = "\n".join(lines)
    assert all(name.name in text for name in (project / "cases").iterdir() if (name / "case.toml").exists())
    assert "Differs most: ds30" in text and "--details" in text and "diagnose" in text
    assert main(["sweep", str(project / "cases" / "ds30"), "--details"]) == 0
    assert "assumed, because the source does not give it" in capsys.readouterr().out


def test_a_difference_near_zero_thrust_is_a_share_of_the_largest_and_no_thousand_percent() -> None:
    from bemt.compare.sweep.summary import summary

    row = {"source": "bemt", "label": "bemt", "u": 0.5, "airspeed_m_s": 12.0, "flags": []}
    known = {"u_num": 0.0, "u_input": 0.5, "u_D": math.nan, "u_val": math.nan, "model": "bemt", "quantity": "thrust_N"}
    result = {
        "name": "near", "faults": [], "assumptions": [], "audit": [], "grid": None,
        "rows": [{**row, "rpm": 6000.0, "thrust_N": 2.0}, {**row, "rpm": 9000.0, "thrust_N": 40.0},
                 {**row, "source": "bench", "label": "bench 1", "rpm": 6000.0, "thrust_N": 0.01},
                 {**row, "source": "bench", "label": "bench 2", "rpm": 9000.0, "thrust_N": 41.0}],
        "comparisons": [
            {**known, "reference": "bench 1", "source": "bench", "S": 2.0, "D": 0.01, "E": 1.99, "E_pct": 19900.0},
            {**known, "reference": "bench 2", "source": "bench", "S": 40.0, "D": 41.0, "E": -1.0, "E_pct": -2.4}],
    }  # fmt: skip
    text = summary([result])
    assert "+1.99 (5 %)" in text and "-1 (2 %)" in text and "00 %" not in text


def test_a_screen_of_many_cases_is_still_one_screen() -> None:
    from bemt.compare.sweep.summary import summary

    row = {"source": "bemt", "label": "bemt", "u": 0.5, "airspeed_m_s": 0.0, "flags": ["a flag"], "rpm": 6000.0}
    one = {"faults": [], "assumptions": [], "audit": [], "grid": None, "comparisons": []}
    many = [{**one, "name": f"case_{k}", "rows": [{**row, "thrust_N": float(k)}]} for k in range(100)]
    lost = [{**one, "name": f"bad_{k}", "rows": [], "faults": ["x" * 200]} for k in range(30)]
    lines = summary([*many, *lost]).splitlines()
    assert len(lines) <= 45 and max(map(len, lines)) <= 80
    assert any("more" in line for line in lines)


@pytest.mark.parametrize("E", [-7.0, 0.3, 4.0])
def test_agreement_hangs_on_the_uncertainty_that_is_needed(E: float) -> None:
    c = {"E": E, "D": 20.0, "unit": "N", "u_num": 0.1, "u_input": 0.8, "u_model": 1.5, "u_D": None}
    least = needed(c)
    assert math.hypot(known(c), least) >= abs(E) * (1 - 1e-12)
    assert "u_D unknown" in agreement(c)
    assert agreement({**c, "u_D": 1.001 * least}) == "not distinguishable from noise"
    if least:
        assert agreement({**c, "u_D": 0.999 * least}) == "differs"
    assert math.isnan(needed({**c, "u_model": None})), "a model without an uncertainty decides nothing"


def test_the_formula_has_its_measured_error_and_none_where_nobody_measured_it(solved: dict[str, Any]) -> None:
    line = next(c for c in solved["comparisons"] if c["model"] == "k1k2" and c["quantity"] == "thrust_N")
    assert line["u_model"] == pytest.approx(U_MEASURED * line["S"])
    ducted = {**solved, "kind": "fan"}
    assert "knows their" in " ".join(summary([ducted]).split()) and "K1/K2 gives" not in summary([solved])

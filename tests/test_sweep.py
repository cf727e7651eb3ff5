"""A sweep compares every source, survives a kill, isolates bad cases."""

from __future__ import annotations

import csv
import json
import math
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_case import REFERENCES, make_case

from bemt.app.cli import main
from bemt.base.tables import csv_block, json_text, number_text, plain
from bemt.physics.bem import Model
from bemt.physics.k1k2 import U_MEASURED
from bemt.results.report.diagnosis_block import lead
from bemt.results.sweep import batch, fingerprint
from bemt.results.sweep import batch as sweep_module
from bemt.results.sweep import grid as grid_module
from bemt.results.sweep.answer import _agreement
from bemt.results.sweep.answer import summary as summary_of
from bemt.results.sweep.case import solve_case
from bemt.results.sweep.rows import Comparison, Result, beside
from bemt.results.sweep.store import case_text
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case


def sweep(*args: Any, **options: Any) -> dict[str, Any]:
    """Document of a sweep, as ``--json`` prints it."""
    document: dict[str, Any] = plain(sweep_module.sweep(*args, **options).document())
    return document


def summary(documents: Sequence[dict[str, Any]], **options: Any) -> str:
    return summary_of([Result.from_document(d) for d in documents], **options)


ROOT = Path(__file__).resolve().parents[1]
KGF = 9.80665

GRID = """
[sweep]
rpm = {start = 3000, stop = 9000, num = 10}
airspeed_m_s = {start = 0, stop = 10, num = 10}
pitch_in = {start = 3, stop = 8, num = 96}
"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Solve one case as `sweep` does."""
    folder = tmp_path_factory.mktemp("cases")
    make_case(folder)
    document = sweep([folder])
    return dict(document["cases"][0])


@pytest.fixture(scope="module")
def gridded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, bytes]]:
    """Case with a grid in six chunks, and the files of a sweep of it that nothing disturbed."""
    folder = tmp_path_factory.mktemp("gridded")
    path = make_case(folder / "cases", extra=GRID)
    sweep([path], folder / "whole")
    return path, tree(folder / "whole")


def row_of(result: dict[str, Any], source: str, at: int = 0) -> dict[str, Any]:
    """Row of a source."""
    return [row for row in result["rows"] if row["source"] == source][at]  # type: ignore[no-any-return]


def assumed(folder: Path, key: str, low: float, high: float, air: str = "density_kg_m3 = 1.2") -> dict[str, Any]:
    """Solve the case with one more assumption; the references state their own conditions."""
    extra = f'[[assumptions]]\nkey = "{key}"\nlow = {low}\nhigh = {high}\nwhy = "made for a test"\n'
    path = make_case(folder, key.replace(".", "_"), extra)
    text = path.read_text().replace("rpm = 6000", "rpm = 6000\nairspeed_m_s = 3").replace("density_kg_m3 = 1.2", air)
    path.write_text(re.sub(r'\[\[assumptions\]\]\nkey = "(blade|rotor)[^\[]*', "", text))
    return plain(solve_case(load_case(path)).document())


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


def test_a_recording_stands_beside_bemt_at_its_own_density(tmp_path: Path) -> None:
    """A bench in thin air and CFD at the case's density: two rows of one speed, each with its own recording."""
    told = [f"thrust,{value},N,0.1,{kind},{kind},,6000,0,{rho}" for value, kind, rho in
            ((4.9, "cfd", 1.2), (4.1, "bench", 1.0))]  # fmt: skip
    path = make_case(tmp_path, references="\n".join([REFERENCES.splitlines()[0], *told]) + "\n")
    result = solve_case(load_case(path))
    table = summary_of([result]).splitlines()[:3]
    assert "kg/m3" in table[0] and "T kgf" in case_text(result).split("kg/m3", 2)[2].splitlines()[0]
    assert ["1.200" in table[1], "cfd" in table[1], "bench" in table[1]] == [True, True, False]
    assert ["1.000" in table[2], "cfd" in table[2], "bench" in table[2]] == [True, False, True]
    own = lead(result)
    assert own is not None and [c.source for c in result.comparisons if c.quantity == "thrust_N" and c.model == "bemt"
                                and beside(c, own)] == ["cfd"]  # fmt: skip


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
    assert "a unique name" in document["cases"][1]["faults"][0]
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


def test_interrupted_grid_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gridded: tuple[Path, dict[str, bytes]]
) -> None:
    path, whole = gridded
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
    assert tree(tmp_path / "out") == whole


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_killed_sweep_resumes_and_equals_an_uninterrupted_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_case(tmp_path / "cases", "a")
    make_case(tmp_path / "cases", "b", extra=GRID)
    out, whole = tmp_path / "out", tmp_path / "whole"
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "bemt", "sweep", str(tmp_path / "cases"), "--json"]
    process = subprocess.Popen([*command, "--out", str(out)], env=env, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 600
    while len(list(out.glob("b/grid.parts-*/*.json"))) < 2 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.005)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    assert not (out / "b" / "grid.csv").exists() and not (out / "sweep.json").exists()
    (out / "b" / ".grid.csv.99.tmp").write_text("half a file")  # as a kill during a write leaves it
    parts = {p: p.stat().st_mtime_ns for p in out.glob("b/grid.parts-*/00000[01].json")}
    assert len(parts) == 2
    kept = (out / "a" / "result.json").stat().st_mtime_ns
    assert main([*command[3:], "--out", str(out)]) == 0
    assert (out / "a" / "result.json").stat().st_mtime_ns == kept
    resumed = capsys.readouterr().out
    assert main([*command[3:], "--out", str(whole)]) == 0
    assert resumed == capsys.readouterr().out
    assert tree(out) == tree(whole)


@pytest.mark.skipif(os.name == "nt", reason="needs SIGINT")
def test_interrupt_ends_at_once_with_130_and_no_half_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        make_case(tmp_path / "cases", name, extra=GRID.replace("num = 96", "num = 960"))
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "bemt", "sweep", str(tmp_path / "cases"), "--out", str(tmp_path / "out")]
    command += ["--jobs", "2"]
    # in the background of a shell the signal is ignored, and children inherit that
    process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # fmt: skip
    deadline = time.monotonic() + 600
    begun = partial(tmp_path.glob, "out/*/grid.parts-*/*.json")
    while not list(begun()) and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 130
    assert output == "" and errors.splitlines()[-1] == "interrupted" and "Traceback" not in errors
    assert not list(tmp_path.glob("out/*/grid.csv"))


def test_strict_turns_a_large_error_into_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bemt.app.cli import main

    path = str(make_case(tmp_path))
    assert main(["sweep", path, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["sweep", path, "--quiet", "--strict", "--tolerance-pct", "1e6"]) == 0
    assert main(["sweep", path, "--quiet", "--strict", "--tolerance-pct", "1e-6"]) == 1
    assert "BEMT thrust" in capsys.readouterr().err


def test_unconverged_points_are_counted_and_never_zero(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = Model.channels

    def failing(*args: Any, **kwargs: Any) -> Any:
        values, flags = solved(*args, **kwargs)
        lost = dict.fromkeys(("thrust_N", "torque_Nm", "power_W", "CT", "CP"), np.full(len(flags), np.nan))
        return {**values, **lost}, (("not converged: planted",),) * len(flags)

    monkeypatch.setattr(Model, "channels", failing)
    path = make_case(tmp_path, extra="[sweep]\nrpm = [3000, 6000]\n")
    result = json.loads(json_text(sweep([path], tmp_path / "out")))["cases"][0]
    bemt = row_of(result, "bemt")
    assert bemt["thrust_N"] is None and bemt["converged"] is False and bemt["flags"] == ["not converged: planted"]
    assert result["grid"]["unconverged"] == 2
    _, rows = read_grid(tmp_path / "out" / "one" / "grid.csv")
    assert np.isnan(rows[:, 1]).all() and (rows[:, -1] == 0).all()
    assert sweep_module.off_tolerance(Result.from_document(result), 1e9) == [
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
    from bemt.rotors.case.prepare import k1k2_case

    case = load_case(ROOT / "cases" / name)
    made = k1k2_case(case, None, np.array([case.rpm]), np.array([0.0]), case.air())
    assert made.thrust_N[0] / KGF == pytest.approx(kgf, abs=1e-3)


def test_one_screen_says_what_differs_most(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bemt.app.cli import main

    shipped = ("ds30", "prop_8x5", "prop_10x5", "prop_12x6", "prop_14x8")
    assert main(["sweep", *(str(project / "cases" / name) for name in shipped)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 45 and max(map(len, lines)) <= 80
    text = "\n".join(lines)
    assert all(name in text for name in shipped)
    assert "Largest difference: ds30" in text and "--details" in text and "diagnose" in text
    assert main(["sweep", str(project / "cases" / "ds30"), "--details"]) == 0
    assert "assumed (not stated by the source)" in capsys.readouterr().out


def test_cases_of_one_name_are_told_apart_and_remarks_are_whole_in_a_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from bemt.app.cli import main

    monkeypatch.chdir(tmp_path)
    for folder in ("one", "two"):
        Path(folder).mkdir()
        Path(folder, "case.toml").write_text('schema = "bemt.case/1"\nname = "same"\n')
    assert main(["sweep", "one", "two"]) == 2
    said = capsys.readouterr().out
    assert "same (one/case.toml): not solved" in said and "same (two/case.toml): not solved" in said
    row = {"source": "bemt", "label": "bemt", "u": 0.5, "airspeed_m_s": 0.0, "rpm": 6000.0, "thrust_N": 1.0}
    flag = "a remark of many words " * 8 + "to the end"
    result = {"name": "long", "rows": [{**row, "flags": [flag]}], "faults": [], "assumptions": [], "audit": [],
              "grid": None, "comparisons": []}  # fmt: skip
    assert all(flag in " ".join(summary([result], cut=cut).split()) for cut in (False, True))


def test_no_flag_is_dropped_from_the_screen() -> None:
    row = {"source": "bemt", "label": "bemt", "u": 0.5, "airspeed_m_s": 0.0, "rpm": 6000.0, "thrust_N": 1.0}
    kinds = ("beyond what was measured", "not converged", "supersonic tip")
    flags = [f"{kind}: {i} {'and so on ' * 9}" for i, kind in enumerate(kinds * 5)]
    results = [
        {"name": f"case_{i}", "rows": [{**row, "flags": [flag]}], "faults": [], "assumptions": [], "audit": [],
         "grid": None, "comparisons": []}
        for i, flag in enumerate(flags)
    ]  # fmt: skip
    said = summary(results)
    assert said.count("\n") < 45
    words = " ".join(said.split("!", 1)[1].split())
    counted = [int(n) for n in re.findall(r"(\d+) more: ", words)]
    whole = [flag for flag in flags if flag.split(" and ")[0] + " and so on" in words]
    assert len(whole) + sum(counted) == len(flags) and all(kind in words for kind in kinds)
    assert words.index("not converged") < words.index("beyond what was measured")


def test_a_flagged_point_is_no_plain_agreement() -> None:
    from bemt.results.report.diagnosis_block import stand

    plain = Comparison(S=101.0, D=100.0, u_input=5.0, u_D=0.5)
    flagged = replace(plain, doubts=("supersonic tip",))
    assert stand(plain)[0] == "same" and stand(flagged)[0] != "same" and "supersonic tip" in stand(flagged)[1]
    assert "supersonic tip" in flagged.verdict and "supersonic tip" not in plain.verdict
    far, open_ = (Comparison(S=150.0, D=100.0, u_input=5.0, u_D=u, doubts=flagged.doubts) for u in (0.5, math.nan))
    told = [_agreement(c) for c in (plain, flagged, replace(flagged, u_D=math.nan), far, open_)]
    assert told[0] == "agrees" and told[1] == told[2] == "flagged !" and not any("!" in word for word in told[3:])


def test_a_difference_is_a_share_of_its_recorded_value_and_near_zero_thrust_no_thousand_percent() -> None:

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
    assert "+1.99 " in text and "-1 (-2 %)" in text and "00 %" not in text


def test_a_screen_of_many_cases_is_still_one_screen() -> None:

    row = {"source": "bemt", "label": "bemt", "u": 0.5, "airspeed_m_s": 0.0, "flags": ["a flag"], "rpm": 6000.0}
    one = {"faults": [], "assumptions": [], "audit": [], "grid": None, "comparisons": []}
    many = [{**one, "name": f"case_{k}", "rows": [{**row, "thrust_N": float(k)}]} for k in range(100)]
    lost = [{**one, "name": f"bad_{k}", "rows": [], "faults": ["x" * 200]} for k in range(30)]
    lines = summary([*many, *lost]).splitlines()
    assert len(lines) <= 45 and max(map(len, lines)) <= 80
    assert any("more" in line for line in lines)


@pytest.mark.parametrize("E", [-7.0, 0.3, 4.0])
def test_agreement_hangs_on_the_uncertainty_that_is_needed(E: float) -> None:
    c = Comparison(S=20.0 + E, D=20.0, u_num=0.1, u_input=0.8, u_model=1.5)
    least = c.needed
    assert math.hypot(c.known, least) >= abs(E) * (1 - 1e-12)
    assert "u_D unknown" in c.verdict
    assert replace(c, u_D=1.001 * least).verdict == "not distinguishable from noise"
    if least:
        assert replace(c, u_D=0.999 * least).verdict == "differs"
    assert math.isnan(replace(c, u_model=math.nan).needed), "a model without an uncertainty decides nothing"


def test_the_formula_has_its_measured_error_and_none_where_nobody_measured_it(solved: dict[str, Any]) -> None:
    line = next(c for c in solved["comparisons"] if c["model"] == "k1k2" and c["quantity"] == "thrust_N")
    assert line["u_model"] == pytest.approx(U_MEASURED * line["S"])
    ducted = {**solved, "kind": "fan"}
    assert "open propellers" in " ".join(summary([ducted]).split()) and "K1/K2 gives" not in summary([solved])


# Promise: a folder of results holds what the cases give now, whole, or nothing, and serves one sweep at a time.


AXES = "[sweep]\nrpm = {start = 3000, stop = 9000, num = 50}\n"
needs_sigkill = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the cases that are solved, as they are."""
    names: list[str] = []
    real = batch.solve_case

    def counting(case: Any, *args: Any) -> Any:
        names.append(case.name)
        return real(case, *args)

    monkeypatch.setattr(batch, "solve_case", counting)
    return names


def cut(data: bytes) -> bytes:
    """First half."""
    return data[: len(data) // 2]


def other_digit(data: bytes) -> bytes:
    """Same size, another number: of the last thrust in a grid, of some key in JSON."""
    at = max(data.rfind(digit, 0, len(data) - 40) for digit in (b"1", b"2", b"3", b"4"))
    return data[:at] + b"9" + data[at + 1 :]


def without_rows(data: bytes) -> bytes:
    """Sound JSON of another shape."""
    stored = json.loads(data)
    del stored["result"]["rows"]
    return json.dumps(stored).encode()


def other_thrust(data: bytes) -> bytes:
    """Sound JSON with another answer."""
    stored = json.loads(data)
    stored["result"]["rows"][0]["thrust_N"] += 1.0
    return json.dumps(stored, indent=1).encode()


@pytest.mark.parametrize(
    ("name", "damage", "again"),
    [
        ("grid.csv", cut, True), ("grid.csv", other_digit, True), ("grid.csv", lambda data: data + b"\n", True),
        ("result.json", other_thrust, True), ("result.json", without_rows, True),
        ("result.json", lambda data: b"[]", True), ("table.txt", cut, False), ("table.txt", None, False),
    ],
)  # fmt: skip
def test_what_was_damaged_is_made_again(
    tmp_path: Path, counted: list[str], name: str, damage: Callable[[bytes], bytes] | None, again: bool
) -> None:
    path = make_case(tmp_path / "cases", extra=AXES)
    sweep([path], tmp_path / "out")
    whole = tree(tmp_path / "out")
    counted.clear()
    victim = tmp_path / "out" / "one" / name
    if damage is None:
        victim.unlink()
    else:
        victim.write_bytes(damage(victim.read_bytes()))
        assert victim.read_bytes() != whole[f"one/{name}"]
    sweep([path], tmp_path / "out")
    assert tree(tmp_path / "out") == whole
    assert counted == ["one"] * again


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_a_damaged_chunk_is_solved_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, gridded: tuple[Path, dict[str, bytes]]
) -> None:
    path, whole = gridded
    numbers: list[int] = []
    real = grid_module.solve_chunk

    def interrupted(solver: Any, number: int) -> Any:
        numbers.append(number)
        if numbers == [0, 1, 2]:
            raise KeyboardInterrupt
        return real(solver, number)

    monkeypatch.setattr(grid_module, "solve_chunk", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sweep([path], tmp_path / "out")
    (victim,) = tmp_path.glob(f"out/one/grid.parts-*/000001{suffix}")
    data = victim.read_bytes()
    victim.write_bytes(other_digit(data) if suffix == ".csv" else data.replace(b'"points": ', b'"points": 1'))
    assert victim.read_bytes() != data
    numbers.clear()
    sweep([path], tmp_path / "out")
    assert numbers == [1, 2, 3, 4, 5]
    assert tree(tmp_path / "out") == whole


def test_a_second_sweep_is_refused_and_leaves_the_first_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    gridded: tuple[Path, dict[str, bytes]],
) -> None:  # fmt: skip
    path, alone = gridded
    out = tmp_path / "out"
    real = grid_module.solve_chunk
    codes: list[int] = []

    def meanwhile(solver: Any, number: int) -> Any:
        if number == 3 and not codes:
            before = tree(out)
            codes.append(main(["sweep", str(path), "--out", str(out)]))
            assert tree(out) == before
        return real(solver, number)

    with monkeypatch.context() as patch:
        patch.setattr(grid_module, "solve_chunk", meanwhile)
        assert sweep([path], out)["exit_code"] == 0
    assert codes == [2]
    assert capsys.readouterr() == ("", f"{out}: got a folder in use by another sweep; expected one for this "
                                       "sweep. Wait for the other one, or give another --out.\n")  # fmt: skip
    assert tree(out) == alone


@needs_sigkill
def test_a_killed_sweep_leaves_neither_lock_nor_workers(tmp_path: Path) -> None:
    psutil = pytest.importorskip("psutil")
    for name in ("a", "b"):
        make_case(tmp_path / "cases", name, extra=GRID.replace("num = 96", "num = 960"))
    out = tmp_path / "out"
    call = [sys.executable, "-m", "bemt", "sweep", str(tmp_path / "cases"), "--out", str(out), "--jobs", "2"]
    process = subprocess.Popen(call, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 600
    while len(list(out.glob("?/grid.parts-*/*.json"))) < 2 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.005)
    children = psutil.Process(process.pid).children(recursive=True)
    assert len(children) >= 2
    process.kill()
    process.wait()
    _, alive = psutil.wait_procs(children, timeout=120)
    for child in alive:
        child.kill()
    assert not alive
    (out / "a" / "result.json").write_text("x")
    for name in ("a", "b"):  # the short way to the end
        path = tmp_path / "cases" / name / "case.toml"
        path.write_text(path.read_text().replace("num = 960", "num = 2"))
    sweep([tmp_path / "cases"], out)
    sweep([tmp_path / "cases"], tmp_path / "whole")
    assert tree(out) == tree(tmp_path / "whole")


@needs_sigkill
def test_a_worker_that_dies_does_not_take_other_cases_with_it(tmp_path: Path) -> None:
    for name in "abc":
        make_case(tmp_path / "cases", name)
    killed: list[int] = []

    def kill(line: str) -> None:
        if not killed:
            killed.extend(child.pid for child in multiprocessing.active_children())
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    document = sweep([tmp_path / "cases"], tmp_path / "out", jobs=2, progress=kill)
    assert len(killed) == 2
    assert [case["faults"] for case in document["cases"]] == [[]] * 3
    sweep([tmp_path / "cases"], tmp_path / "whole")
    assert tree(tmp_path / "out") == tree(tmp_path / "whole")


def nothing_left(folder: Path) -> None:
    """An empty file: only its folder has a name."""
    (folder / "case.toml").write_text("")


def broken_syntax(folder: Path) -> None:
    """No TOML."""
    with (folder / "case.toml").open("a") as stream:
        stream.write("rpm = = 3")


def broken_value(folder: Path) -> None:
    """A fault that leaves the name readable."""
    path = folder / "case.toml"
    path.write_text(path.read_text().replace("blades = 2", "blades = -2"))


def broken_references(folder: Path) -> None:
    """A fault that is found when the case is solved."""
    (folder / "references.csv").write_text("nonsense\n")


@pytest.mark.parametrize(
    ("fault", "name"),
    [(nothing_left, "bad"), (broken_syntax, "renamed"), (broken_value, "renamed"), (broken_references, "renamed")],
)
def test_a_case_that_fails_has_no_result(tmp_path: Path, fault: Callable[[Path], None], name: str) -> None:
    bad = make_case(tmp_path / "cases", "bad", extra=AXES)
    bad.write_text(bad.read_text().replace('name = "bad"', f'name = "{name}"'))
    make_case(tmp_path / "cases", "good", extra=AXES)
    out = tmp_path / "out"
    sweep([tmp_path / "cases"], out)
    (out / name / "notes.md").write_text("of the user")
    good = {path: data for path, data in tree(out).items() if path.startswith("good/")}
    assert len(good) == 3
    fault(bad.parent)
    document = sweep([tmp_path / "cases"], out)
    after = tree(out)
    assert {path for path in after if path.startswith(f"{name}/")} == {f"{name}/notes.md"}
    assert {path: data for path, data in after.items() if path.startswith("good/")} == good
    said = {case["name"]: case for case in json.loads(after["sweep.json"])["cases"]}
    assert document["exit_code"] == 2 and said[name]["exit_code"] == 2 and said[name]["faults"]
    assert b"not solved" in after["sweep.txt"]


def test_the_result_of_another_case_is_not_taken_for_that_of_a_faulty_one(tmp_path: Path) -> None:
    nothing_left(make_case(tmp_path / "cases", "one").parent)
    other = make_case(tmp_path / "cases", "two")
    other.write_text(other.read_text().replace('name = "two"', 'name = "one"'))  # the name of the other's folder
    sweep([other], tmp_path / "out")
    kept = (tmp_path / "out" / "one" / "result.json").stat().st_mtime_ns
    assert sweep([tmp_path / "cases"], tmp_path / "out")["exit_code"] == 2
    assert (tmp_path / "out" / "one" / "result.json").stat().st_mtime_ns == kept


def test_files_of_the_user_beside_a_faulty_case_are_not_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_case(tmp_path / "cases").parent
    nothing_left(folder)
    (folder / "table.txt").write_text("of the user")
    before = tree(folder)
    assert sweep([folder], tmp_path / "cases")["exit_code"] == 2
    (tmp_path / "table.txt").write_text("of the user")
    monkeypatch.chdir(folder)
    (folder / "..toml").write_text("")
    before = tree(folder)
    sweep(["../one/case.toml", "case.toml"], ".")
    (tmp_path / "cases" / "table.txt").write_text("of the user")
    sweep(["..toml"], "..")  # its stem is a dot
    assert (tmp_path / "cases" / "table.txt").exists()
    assert {name: data for name, data in tree(folder).items() if not name.startswith("sweep.")} == before


def test_an_interrupted_sweep_leaves_no_result_of_an_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = make_case(tmp_path / "cases", extra=AXES)
    sweep([path], tmp_path / "out")
    path.write_text(path.read_text().replace("rpm = 6000", "rpm = 6100"))

    def interrupted(*args: Any) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(batch, "solve_case", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sweep([path], tmp_path / "out")
    assert tree(tmp_path / "out") == {}


def test_each_case_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):
        make_case(tmp_path, name)
    broken_syntax(make_case(tmp_path, "c").parent)
    read: list[str] = []
    real = batch.load_case

    def counting(path: Path) -> Any:
        read.append(path.parent.name)
        return real(path)

    monkeypatch.setattr(batch, "load_case", counting)
    sweep([tmp_path])
    assert read == ["a", "b", "c"]


@pytest.mark.parametrize("name", ["case.toml", "polar.csv"])
def test_a_case_that_changes_while_it_is_solved_is_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = make_case(tmp_path / "cases", extra=AXES)
    real = batch.solve_case

    def meanwhile(case: Any, *args: Any) -> Any:
        with (path.parent / name).open("a") as stream:
            stream.write("\n")
        return real(case, *args)

    with monkeypatch.context() as patch:
        patch.setattr(batch, "solve_case", meanwhile)
        (found,) = sweep([path], tmp_path / "out")["cases"]
    assert found["exit_code"] == 2
    assert found["faults"] == [f"{path.as_posix()}: got files that changed while they were solved; expected files that "
                               "stay. Run it again."]  # fmt: skip
    assert {file.split("/")[0] for file in tree(tmp_path / "out")} == {"sweep.json", "sweep.csv", "sweep.txt"}
    assert sweep([path], tmp_path / "out")["exit_code"] == 0


def test_names_that_would_share_a_file_are_refused(tmp_path: Path) -> None:
    for folder, name in (("1", "one"), ("2", "ONE"), ("3", "Sweep.JSON")):
        path = make_case(tmp_path / "cases", folder)
        path.write_text(path.read_text().replace(f'name = "{folder}"', f'name = "{name}"'))
    document = sweep([tmp_path / "cases"], tmp_path / "out")
    assert [(case["name"], case["exit_code"]) for case in document["cases"]] == [
        ("one", 0), ("ONE", 2), ("Sweep.JSON", 2),
    ]  # fmt: skip
    assert [case["faults"][0].split(": ", 1)[1] for case in document["cases"][1:]] == [
        f"name: got 'ONE' as in {(tmp_path / 'cases' / '1' / 'case.toml').as_posix()}; expected a unique name.",
        "name: got 'Sweep.JSON'; expected another name. The sweep writes a file of that name.",
    ]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["one", "sweep.csv", "sweep.json", "sweep.txt"]

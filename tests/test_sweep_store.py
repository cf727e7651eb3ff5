"""Promise: a folder of results holds what the cases give now, whole, or nothing, and serves one sweep at a time."""

from __future__ import annotations

import importlib.util
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_sweep import GRID, ROOT, make_case, tree

from bemt.commands.cli import main
from bemt.compare.grid import run as grid_module
from bemt.compare.sweep import batch, sweep

AXES = "[sweep]\nrpm = {start = 3000, stop = 9000, num = 50}\n"
needs_sigkill = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
needs_parquet = pytest.mark.skipif(importlib.util.find_spec("pyarrow") is None, reason="needs the extra 'dask'")


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
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
        ("grid.csv", cut, True),
        ("grid.csv", other_digit, True),
        ("grid.csv", lambda data: data + b"\n", True),
        pytest.param("grid.parquet", cut, True, marks=needs_parquet),
        pytest.param("grid.parquet", other_digit, True, marks=needs_parquet),
        ("result.json", other_thrust, True),
        ("result.json", without_rows, True),
        ("result.json", lambda data: b"[]", True),
        ("table.txt", cut, False),
        ("table.txt", None, False),
    ],
)
def test_what_was_damaged_is_made_again(
    tmp_path: Path, solved: list[str], name: str, damage: Callable[[bytes], bytes] | None, again: bool
) -> None:
    path = make_case(tmp_path / "cases", extra=AXES)
    form = "parquet" if name.endswith("parquet") else "csv"
    sweep([path], tmp_path / "out", grid_format=form)
    whole = tree(tmp_path / "out")
    solved.clear()
    victim = tmp_path / "out" / "one" / name
    if damage is None:
        victim.unlink()
    else:
        victim.write_bytes(damage(victim.read_bytes()))
        assert victim.read_bytes() != whole[f"one/{name}"]
    sweep([path], tmp_path / "out", grid_format=form)
    assert tree(tmp_path / "out") == whole
    assert solved == ["one"] * again


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_a_damaged_chunk_is_solved_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    path = make_case(tmp_path / "cases", extra=GRID)
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
    sweep([path], tmp_path / "whole")
    assert tree(tmp_path / "out") == tree(tmp_path / "whole")


def test_a_second_sweep_is_refused_and_leaves_the_first_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = make_case(tmp_path / "cases", extra=GRID)
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
    assert capsys.readouterr() == ("", f"{out}: got a folder in which another sweep is at work; expected one for this "
                                       "sweep. Wait for the other one, or give another --out.\n")  # fmt: skip
    sweep([path], tmp_path / "alone")
    assert tree(out) == tree(tmp_path / "alone")


@needs_sigkill
def test_a_killed_sweep_leaves_neither_lock_nor_workers(tmp_path: Path) -> None:
    psutil = pytest.importorskip("psutil")
    for name in ("a", "b"):
        make_case(tmp_path / "cases", name, extra=GRID.replace("num = 96", "num = 960"))
    out = tmp_path / "out"
    call = [sys.executable, "-m", "bemt", "sweep", str(tmp_path / "cases"), "--out", str(out), "--jobs", "2"]
    process = subprocess.Popen(call, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(list(out.glob("?/grid.parts-*/*.json"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.005)
    children = psutil.Process(process.pid).children(recursive=True)
    assert len(children) >= 2
    process.kill()
    process.wait()
    _, alive = psutil.wait_procs(children, timeout=20)
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
    for name in "abcd":
        make_case(tmp_path / "cases", name)
    killed: list[int] = []

    def kill(line: str) -> None:
        if not killed:
            killed.extend(child.pid for child in multiprocessing.active_children())
            for pid in killed:
                os.kill(pid, signal.SIGKILL)

    document = sweep([tmp_path / "cases"], tmp_path / "out", jobs=2, progress=kill)
    assert len(killed) == 2
    assert [case["faults"] for case in document["cases"]] == [[]] * 4
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
        f"name: got 'ONE' as in {(tmp_path / 'cases' / '1' / 'case.toml').as_posix()}; expected a name of its own.",
        "name: got 'Sweep.JSON'; expected another name. The sweep writes a file of that name.",
    ]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["one", "sweep.csv", "sweep.json", "sweep.txt"]

"""Promise: a grid is the same, bit for bit, whoever solves it; a worker that dies costs only time."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import signal
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_sweep import make_case, tree

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.base.tables import json_text
from bemt.results.sweep import grid as grid_module
from bemt.results.sweep import sweep
from bemt.results.sweep.grid import Grid, GridSolver
from bemt.rotors.case import load_case

needs_dask = pytest.mark.skipif(
    any(__import__("importlib.util").util.find_spec(name) is None for name in ("distributed",)),
    reason="needs the extra 'dask'",
)
# Dask's own sockets and event loops are closed when the garbage collector comes, which is no matter of ours
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")

GRID = """
[sweep]
rpm = {start = 3000, stop = 9000, num = 20}
airspeed_m_s = {start = 0, stop = 10, num = 20}
pitch_in = {start = 3, stop = 8, num = 6}
"""  # six chunks, of which none begins with a geometry but the first
MILLION = "[sweep]\nrpm = {start = 3000, stop = 9000, num = 1000}\nairspeed_m_s = {start = 0, stop = 10, num = 1000}\n"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small chunks; workers learn them from the work."""
    monkeypatch.setattr(grid_module, "CHUNK", 450)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two worker processes of one thread."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs="CRITICAL"
    ) as made:
        yield made


@needs_dask
def test_a_cluster_gives_the_bytes_of_this_machine(tmp_path: Path, cluster: Any, small: None) -> None:
    make_case(tmp_path / "cases", "a", extra=GRID)
    make_case(tmp_path / "cases", "b")
    here = sweep([tmp_path / "cases"], tmp_path / "here")
    there = sweep([tmp_path / "cases"], tmp_path / "there", engine="dask",
                  scheduler=cluster.scheduler_address)  # fmt: skip
    assert here.cases[0].grid.file == "a/grid.csv" and here.exit_code == 0
    assert json_text(here.document()) == json_text(there.document())
    assert tree(tmp_path / "here") == tree(tmp_path / "there")


@needs_dask
def test_without_a_folder_only_statistics_travel(tmp_path: Path, cluster: Any, small: None) -> None:
    path = make_case(tmp_path, extra=GRID)
    there = sweep([path], engine="dask", scheduler=cluster.scheduler_address)
    assert there.cases[0].grid.points == 2400
    assert json_text(there.document()) == json_text(sweep([path]).document())


@needs_dask
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
@pytest.mark.parametrize(
    ("points", "chunk"), [(100_000, 5000), pytest.param(1_000_000, 50_000, marks=pytest.mark.slow)]
)
def test_a_worker_killed_in_the_middle_costs_only_time(
    tmp_path: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch, points: int, chunk: int
) -> None:
    from distributed import Client

    monkeypatch.setattr(grid_module, "CHUNK", chunk)
    path = make_case(tmp_path / "cases", extra=MILLION.replace("1000}\na", f"{points // 1000}}}\na"))
    with Client(cluster.scheduler_address) as client:
        before = set(client.run(os.getpid).values())
    victim = min(before)
    seen: list[str] = []

    def kill(line: str) -> None:
        if "grid" in line:
            seen.append(line)
            if len(seen) == 3:
                os.kill(victim, signal.SIGKILL)

    there = sweep([path], tmp_path / "there", engine="dask", scheduler=cluster.scheduler_address, progress=kill)
    assert len(seen) == 20  # the worker died with most of the chunks to come
    with Client(cluster.scheduler_address) as client:
        client.wait_for_workers(2, timeout=60)
        after = set(client.run(os.getpid).values())
    assert victim not in after and len(after) == 2
    here = sweep([path], tmp_path / "here")
    assert there.cases[0].grid.points == points
    assert json_text(here.document()) == json_text(there.document())
    assert tree(tmp_path / "here") == tree(tmp_path / "there")


@needs_dask
def test_what_one_engine_began_the_other_ends(
    tmp_path: Path, cluster: Any, small: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = make_case(tmp_path / "cases", extra=GRID)
    real = grid_module.solve_chunk

    def interrupted(solver: Any, number: int) -> Any:
        if number == 3:
            raise KeyboardInterrupt
        return real(solver, number)

    with monkeypatch.context() as patch:
        patch.setattr(grid_module, "solve_chunk", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sweep([path], tmp_path / "out")
    kept = {p: p.stat().st_mtime_ns for p in tmp_path.glob("out/one/grid.parts-*/*.csv")}
    assert len(kept) == 3
    asked: list[int] = []

    def watch(line: str) -> None:
        asked.append(sum(p.stat().st_mtime_ns == at for p, at in kept.items() if p.exists()))

    sweep([path], tmp_path / "out", engine="dask", scheduler=cluster.scheduler_address, progress=watch)
    assert asked[-1] == 3  # untouched to the end
    sweep([path], tmp_path / "whole")
    assert tree(tmp_path / "out") == tree(tmp_path / "whole")


@needs_dask
@pytest.mark.parametrize(("what", "words"), [("_proof", "sample of the grid"), ("program_hash", "program")])
def test_a_worker_that_gives_other_bits_is_refused(
    tmp_path: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch, what: str, words: str
) -> None:
    path = make_case(tmp_path / "cases", extra=GRID)
    monkeypatch.setattr(f"bemt.results.sweep.dask_engine.{what}", lambda *_: "0123456789abcdef")
    found = sweep([path], tmp_path / "out", engine="dask", scheduler=cluster.scheduler_address).cases[0]
    assert found.exit_code == 2 and len(found.faults) == 1
    assert found.faults[0].startswith("worker tcp://") and f": {words}: got other bits" in found.faults[0]
    assert not [p for p in (tmp_path / "out" / "one").rglob("*") if p.is_file()]


@needs_dask
def test_a_worker_needs_no_file_of_this_machine(tmp_path: Path) -> None:
    from bemt.results.sweep.dask_engine import _portable

    path = make_case(tmp_path / "cases", extra=GRID)
    (tmp_path / "shared").mkdir()
    for name in ("up.csv", "absolute.csv"):
        shutil.copy(path.parent / "polar.csv", tmp_path / "shared" / name)
    text = path.read_text().replace('"polar.csv"', '"../../shared/up.csv"')
    path.write_text(
        text + f'[[polars]]\nfile = "{(tmp_path / "shared" / "absolute.csv").as_posix()}"\nr_over_R = 0.3\n'
    )
    case = load_case(path)
    grid = Grid.of(case)
    assert grid is not None
    flat = np.arange(0, grid.size, 331)
    here = GridSolver(case, grid).block(flat)
    moved, files = _portable(case)
    shutil.rmtree(tmp_path / "cases")
    shutil.rmtree(tmp_path / "shared")
    for name, data in files.items():
        (tmp_path / "worker" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "worker" / name).write_bytes(data)
    there = GridSolver(dataclasses.replace(moved, path=tmp_path / "worker" / moved.path), grid).block(flat)
    for name, column in here.columns.items():
        assert np.array_equal(column, there.columns[name], equal_nan=True), name


def test_states_of_the_air_are_forgotten_and_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    extra = "[sweep]\nrpm = [3000, 6000]\naltitude_m = {start = 0, stop = 3000, num = 40}\npitch_in = [4, 5, 6]\n"
    case = load_case(make_case(tmp_path / "cases", extra=extra))
    grid = Grid.of(case)
    assert grid is not None
    whole = grid_module.solve_chunk(GridSolver(case, grid), 0)
    monkeypatch.setattr(grid_module, "MAX_AIRS", 7)
    few = GridSolver(case, grid)
    assert grid_module.solve_chunk(few, 0) == whole
    assert 0 < len(few._airs) <= 7


def test_without_the_extra_the_answer_is_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = make_case(tmp_path / "cases", extra=GRID)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "--engine", "dask"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("--engine dask") and "distributed" in error and "pip install 'bemt[dask]'" in error
    assert not (tmp_path / "out").exists()


def test_options_that_contradict_are_refused_together(tmp_path: Path) -> None:
    path = make_case(tmp_path)
    with pytest.raises(InputError) as error:
        sweep([path], jobs=2, engine="local", scheduler="tcp://host:1")
    assert [fault.where for fault in error.value.faults] == ["--scheduler", "--jobs"]


@needs_dask
def test_a_scheduler_that_does_not_answer_is_a_fault_of_the_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("bemt.results.sweep.dask_engine.PATIENCE", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        assert main(["sweep", str(make_case(tmp_path)), "--engine", "dask", "--scheduler", address]) == 2
    assert capsys.readouterr().err.startswith(f"--scheduler: got {address}")


@needs_dask
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["local", "dask"])
def test_ten_million_points_stay_below_two_gigabytes(tmp_path: Path, engine: str) -> None:
    import psutil

    path = make_case(tmp_path / "cases", extra=MILLION.replace("1000}\na", "10000}\na"))
    command = [sys.executable, "-m", "bemt", "sweep", str(path), "--out", str(tmp_path / "out"), "--quiet",
               "--engine", engine]  # fmt: skip
    process = psutil.Popen(command, env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])})
    peak = 0
    while process.poll() is None:
        total = 0
        for one in (process, *process.children(recursive=True)):
            try:
                total += one.memory_info().rss
            except psutil.Error:  # it has just ended
                continue
        peak = max(peak, total)
        time.sleep(0.2)
    assert process.returncode == 0
    assert 0 < peak < 2e9
    assert json.loads((tmp_path / "out" / "sweep.json").read_text())["cases"][0]["grid"]["points"] == 10_000_000

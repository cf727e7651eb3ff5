"""Grids on a Dask cluster: chunks go out, bytes come back, and a worker that dies costs only time.

A chunk depends on its number alone, so it does not matter who solves it, when, or how often. What a worker needs (the
case with its files, and the section tables of this machine) travels with the work: nothing is shared but the
installed program. Before its first chunk every worker proves that it gives the same numbers, bit for bit, on a sample
of the grid; one that does not (another version, another processor) is refused, never mixed in.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import tempfile
import threading
import uuid
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from bemt.base import cache
from bemt.base.errors import Fault, InputError
from bemt.results.sweep.grid import Grid, GridSolver, Solved, solve_chunk
from bemt.results.sweep.store import program_hash
from bemt.rotors.case import Case
from bemt.rotors.case.schema import CaseFile

IN_FLIGHT = 2
"""Chunks per worker thread that are out at a time: one at work, one waiting; this bounds the memory."""
SAMPLE = 256
"""Points of the first geometry on which a worker proves itself."""
PATIENCE = 60.0
"""Wait for a scheduler, and for its first worker. [s]"""
DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""Run by local workers: an interrupt from the terminal reaches them too, but this process ends them."""


@dataclass(frozen=True)
class _Work:
    """All that a worker needs to solve chunks of one grid."""

    case: Case
    grid: Grid
    files: dict[str, bytes]
    tables: dict[tuple[str, str], dict[str, Any]]
    rows: bool
    program: str
    proof: str


def _proof(solver: GridSolver) -> str:
    """Hash of the exact numbers at points spread over the first geometry."""
    per_geometry = solver.grid.size // solver.grid.geometries
    block = solver.block(np.unique(np.linspace(0, per_geometry - 1, SAMPLE).astype(np.intp)))
    digest = hashlib.sha256()
    for column in (*block.columns.values(), block.converged):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _packed(case: Case, grid: Grid, rows: bool) -> bytes:
    """Work as bytes, with the numbers of this machine as its proof."""
    with cache.used() as tables:
        proof = _proof(GridSolver(case, grid))
    moved, files = _portable(case)
    return pickle.dumps(_Work(moved, grid, files, dict(tables), rows, program_hash(), proof))


def _portable(case: Case) -> tuple[Case, dict[str, bytes]]:
    """Case whose files have names below any folder, wherever they lie here, and their content by such names."""
    place = {path: f"{i}/{path.name}" for i, path in enumerate(case.files()[1:])}

    def moved(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: moved(item) for key, item in value.items()}
        if isinstance(value, list):
            return [moved(item) for item in value]
        return place.get(case.folder / value, value) if isinstance(value, str) else value

    written = moved(case.written)
    there = replace(case, path=Path(case.path.name), written=written, file=CaseFile.model_validate(written), _built={})
    return there, {name: path.read_bytes() for path, name in place.items()}


_own = threading.local()


def _carry(work: bytes) -> bytes:
    """Return the argument: as a task, the scheduler can make the work again when its holders die."""
    return work


def _solver(token: str, packed: bytes) -> GridSolver:
    """Solver of this thread of a worker, proved."""
    held = getattr(_own, "held", None)
    if held is not None and held[0] == token:
        return held[1]  # type: ignore[no-any-return]
    from distributed import get_worker

    worker = get_worker()
    work: _Work = pickle.loads(packed)
    _check(worker.address, "program", program_hash(), work.program, "Install the same version of everything there")
    if held is not None:
        shutil.rmtree(held[2], ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix="bemt-", dir=worker.local_directory))  # goes when the worker goes
    for name, data in work.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    for (kind, key), arrays in work.tables.items():
        cache.cached_arrays(kind, key, lambda arrays=arrays: arrays)  # type: ignore[misc]
    solver = GridSolver(replace(work.case, path=folder / work.case.path), work.grid, 1, work.rows)
    _check(worker.address, "sample of the grid", _proof(solver), work.proof, "Use workers with the same processor")
    _own.held = (token, solver, folder)
    return solver


def _check(address: str, where: str, got: str, expected: str, hint: str) -> None:
    if got != expected:
        wanted = f"those of this machine ({expected[:12]}), so that the answer is the same"
        raise InputError(Fault(f"worker {address}", where, f"other bits ({got[:12]})", wanted, hint))


def _solve(token: str, packed: bytes, number: int) -> Solved:
    """One chunk, on a worker."""
    return number, *solve_chunk(_solver(token, packed), number)


class Cluster:
    """Engine on a Dask cluster: at the address of a scheduler, or local processes, started when first needed.

    Raises InputError when the scheduler does not answer.
    """

    def __init__(self, scheduler: str | None = None, workers: int | None = None) -> None:
        self.scheduler, self.workers = scheduler, workers
        self._client: Any = None
        self._stack = ExitStack()
        if scheduler is not None:
            self._connect()

    def __enter__(self) -> Cluster:
        """Use as a context: leaving closes what was started."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave an existing cluster, end a local one."""
        self._client = None
        self._stack.close()

    def _connect(self) -> Any:
        if self._client is not None:
            return self._client
        from distributed import Client, LocalCluster
        from distributed.utils import silence_logging_cmgr

        self._stack.enter_context(silence_logging_cmgr("CRITICAL"))  # what matters is raised
        if self.scheduler is None:
            cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
            cluster = self._stack.enter_context(LocalCluster(
                n_workers=self.workers or cores, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0",
                silence_logs="CRITICAL", preload=[DEAF],
            ))  # fmt: skip
            self._client = self._stack.enter_context(Client(cluster, set_as_default=False))
            return self._client
        try:
            client = Client(self.scheduler, timeout=PATIENCE, set_as_default=False)
            self._client = self._stack.enter_context(client)
            self._client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, ValueError, TimeoutError) as error:
            self.__exit__(None, None, None)
            got, hint = f"{self.scheduler} ({_first_line(error)})", "Start `dask scheduler` and `dask worker ADDRESS`"
            expected = "the address of a running Dask scheduler with a worker, as in tcp://host:8786"
            raise InputError(Fault("", "--scheduler", got, expected, hint)) from error
        return self._client

    def __call__(self, case: Case, grid: Grid, numbers: Sequence[int], rows: bool) -> Generator[Solved]:
        """Solve chunks; few are out at a time."""
        if not numbers:
            return
        packed = _packed(case, grid, rows)
        client = self._connect()
        from distributed import KilledWorker, as_completed
        from distributed.client import FutureCancelledError
        from distributed.comm import CommClosedError

        token = f"bemt-{uuid.uuid4().hex}"
        work = client.submit(_carry, packed, key=f"{token}-work", pure=False)
        waiting = iter(numbers)
        out: set[Any] = set()
        arrived = as_completed(loop=client.loop)
        try:
            while True:
                room = IN_FLIGHT * max(1, sum(client.nthreads().values())) - len(out)
                for number in islice(waiting, max(0, room)):
                    future = client.submit(_solve, token, work, number, key=f"{token}-{number}", pure=False)
                    out.add(future)
                    arrived.add(future)
                if not out:
                    return
                future = next(arrived)
                out.discard(future)
                solved = future.result()
                future.release()
                yield solved
        except (KilledWorker, FutureCancelledError, CommClosedError, OSError) as error:
            got, hint = f"a cluster that failed ({_first_line(error)})", "What is finished is kept; run it again"
            raise InputError(Fault("", "--engine dask", got, "one that stays", hint)) from error
        except (ImportError, RuntimeError) as error:
            if isinstance(error, RuntimeError) and "deserializ" not in str(error):
                raise
            got = f"a cluster that cannot load the work ({_first_line(error)})"
            expected = "bemt of this version on the scheduler and on every worker"
            raise InputError(Fault("", "--engine dask", got, expected)) from error
        finally:
            client.cancel([*out, work])


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]

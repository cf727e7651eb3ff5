"""Many cases: solve them beside their recorded values, and write results that survive a kill.

Every case is solved for itself: its faults go into its own result and the others go on. With ``--out`` each case gets
a folder with ``result.json``, ``table.txt`` and, when it sweeps axes, ``grid.csv``. A result is
reused when its fingerprint (case, references and other files, program, libraries) and its content are unchanged;
otherwise it is removed before the case is solved. So a case that fails has no result there, and ``sweep.json``,
``sweep.csv`` and ``sweep.txt``, which come last, say why. Cases that the sweep was not asked for keep theirs.
"""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bemt
from bemt.base.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK, Fault, InputError, refuse, system_fault
from bemt.base.tables import plain, remove_stale
from bemt.base.toml_text import Collector
from bemt.results.sweep import store
from bemt.results.sweep.case import solve_case
from bemt.results.sweep.rows import Result, Sweep
from bemt.results.sweep.store import SCHEMA, fingerprint
from bemt.rotors.case import Case, check_name, find_cases, load_case, repeated_names

if TYPE_CHECKING:
    from bemt.results.sweep.grid import Engine

__all__ = ["SCHEMA", "fingerprint", "off_tolerance", "sweep"]

Progress = Callable[[str], None]
_NAME = re.compile(r"""^name\s*=\s*["']([^"']+)["']""", re.M)
Ready = tuple[Case, str]
"""A case and its fingerprint, taken when it was read."""


def _fit(name: str) -> bool:
    """Whether a name can be that of a folder."""
    out = Collector("")
    check_name(out, name)
    return bool(name.strip()) and not out.faults


def _name(path: Path) -> str:
    """Name of a case that may be faulty: what the file says, sound or not, else the name of its folder or file."""
    text = ""
    with suppress(OSError):
        text = path.read_text(encoding="utf-8", errors="replace")
    said = _NAME.search(text.partition("\n[")[0])
    if said is not None and _fit(said[1]):
        return said[1]
    whole = Path(os.path.abspath(path))
    return whole.parent.name if whole.name == "case.toml" else whole.stem


def _failed(path: Path, error: BaseException, name: str = "") -> Result:
    """Result of a case that has none."""
    if isinstance(error, InputError):
        faults, code = [str(fault) for fault in error.faults], EXIT_INPUT
    elif isinstance(error, OSError) and error.strerror:
        faults, code = [str(system_fault(error))], EXIT_INPUT
    else:
        faults = [f"{path.as_posix()}: internal error", *"".join(traceback.format_exception(error)).splitlines()]
        code = EXIT_INTERNAL
    return Result(name or _name(path), faults=tuple(faults), exit_code=code)


def run_case(
    ready: Ready, out: Path | None, resume: bool, threads: int, progress: Callable[[float, str], None] | None = None,
    engine: Engine | None = None,
) -> Result:  # fmt: skip
    """Do everything for one case; never raises but for an interrupt."""
    tell = progress or (lambda share, what: None)
    case, mark = ready
    try:
        folder = None if out is None else out / case.name
        if folder is not None:
            if folder.resolve() == case.folder.resolve():
                got, hint = f"the folder of the case {case.name} itself", "Results would be mixed with its files"
                raise InputError(Fault("--out", "", got, "another folder", hint))
            remove_stale(folder)
            kept = store.reuse(folder, mark) if resume else None
            if kept is not None:
                return kept
            store.remove_result(folder)
        share = 0.5 if case.axes() else 1.0
        result = solve_case(case, threads, lambda i, n, what: tell(share * i / n, what))
        grid = None
        if case.axes():
            from bemt.results.sweep.grid import run_grid

            grid = run_grid(
                case, folder, mark, threads, lambda i, n: tell(0.5 + 0.5 * i / n, f"grid {i}/{n}"), resume, engine
            )
        result = Result.from_document(plain(replace(result, grid=grid).document()))  # as it will be read back
        if fingerprint(case.content_hash()) != mark:  # no telling which of them the numbers are of
            if folder is not None:
                store.remove_result(folder)
            got = "files that changed while they were solved"
            raise InputError(Fault(case.path.as_posix(), "", got, "files that stay", "Run it again"))
        if folder is not None:
            store.keep(folder, mark, result)
        return result
    except Exception as error:
        return _failed(case.path, error, case.name)


def _follow_parent() -> None:
    """Worker process: leaves interrupts to its parent, and ends when that ends, killed or not.

    It would go on writing into a folder that a next sweep takes up.
    """
    import multiprocessing

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(EXIT_INTERNAL)

    threading.Thread(target=wait, daemon=True).start()


def _results(
    cases: Sequence[Ready], out: Path | None, resume: bool, jobs: int | None, bar: Progress, engine: Engine | None,
) -> Iterator[tuple[int, Result]]:  # fmt: skip
    """Results in the order in which they come."""
    if engine is not None or jobs is None or jobs == 1 or len(cases) == 1:  # one process; its grid may use all cores
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        threads = cores if jobs is None or engine is not None else jobs
        for i, ready in enumerate(cases):
            at = f"[{i + 1}/{len(cases)}] {ready[0].name}"
            tell = lambda s, what, at=at: bar(f"{at} {_bar(s)} {what}")  # noqa: E731
            yield i, run_case(ready, out, resume, threads, tell, engine)
        return
    args = (out, resume, 1, None)
    lost = []
    done = 0
    for i, outcome in _in_processes(dict(enumerate(cases)), jobs, args):
        if outcome is None:
            lost.append(i)
            continue
        done += 1
        bar(f"{_bar(done / len(cases))} {done}/{len(cases)} cases")
        yield i, outcome
    for i in lost:  # a worker that dies takes all with it that wait: one by one, it takes its own case only
        ((_, outcome),) = _in_processes({i: cases[i]}, 1, args)
        case = cases[i][0]
        yield i, outcome or _failed(case.path, RuntimeError("the worker process ended"), case.name)


def _in_processes(cases: Mapping[int, Ready], jobs: int, args: tuple[Any, ...]) -> Iterator[tuple[int, Result | None]]:
    """Results from worker processes as they come; None for those that were lost with a process."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(cases)), mp_context=context, initializer=_follow_parent)
    try:
        futures = {pool.submit(run_case, ready, *args): i for i, ready in cases.items()}
        for future in as_completed(futures):
            i = futures[future]
            try:
                yield i, future.result()
            except BrokenProcessPool:
                yield i, None
            except Exception as error:  # on the way here or there
                yield i, _failed(cases[i][0].path, error, cases[i][0].name)
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _bar(share: float) -> str:
    filled = round(20 * min(max(share, 0.0), 1.0))
    return f"[{'#' * filled}{'.' * (20 - filled)}]"


def sweep(
    paths: Sequence[str | Path], out: str | Path | None = None, *, jobs: int | None = None, resume: bool = True,
    progress: Progress | None = None, engine: str = "local", scheduler: str | None = None,
    beside: Sequence[Path] = (),
) -> Sweep:  # fmt: skip
    """Solve cases; `beside`, CFD runs that stand beside each of them."""
    _check_options(engine, scheduler, jobs)
    files = find_cases(paths)
    folder = None if out is None else Path(out)
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(Fault(str(out), "", error.strerror or "no folder", "a folder for results")) from error
    with ExitStack() as stack:
        if folder is not None:
            stack.enter_context(store.locked(folder))
        on: Engine | None = None
        if engine == "dask":
            from bemt.results.sweep.dask_engine import Cluster

            on = stack.enter_context(Cluster(scheduler, jobs))
        if folder is not None:
            store.clear_overview(folder)
        ready, found = _read(files, folder, tuple(beside))
        todo = list(ready)
        tell = progress or (lambda line: None)
        left = [ready[i] for i in todo]
        for i, result in _results(left, folder, resume, jobs, tell, on) if left else ():
            found[todo[i]] = result
        results = tuple(found[i] for i in range(len(files)))
        code = max((r.exit_code for r in results), default=EXIT_OK)
        swept = Sweep(SCHEMA, bemt.__version__, results, code)
        if folder is not None:
            store.keep_overview(folder, swept)
    return swept


def _check_options(engine: str, scheduler: str | None, jobs: int | None) -> None:
    """Refuse options of the grid that do not fit together, all at once."""
    faults = []
    if engine not in ("local", "dask"):
        faults.append(Fault("", "--engine", repr(engine), "local or dask"))
    if scheduler is not None and engine == "local":
        faults.append(Fault("", "--scheduler", scheduler, "nothing with --engine local", "Add --engine dask"))
    if scheduler is not None and jobs is not None:
        expected = "nothing with --scheduler, whose cluster has its workers"
        faults.append(Fault("", "--jobs", str(jobs), expected, "Leave it out"))
    refuse(faults)
    if engine == "dask":
        require_extra("--engine dask", "dask", "distributed")


def _read(
    files: Sequence[Path], out: Path | None, beside: tuple[Path, ...]
) -> tuple[dict[int, Ready], dict[int, Result]]:
    """Cases that can be solved, and results of those that cannot, by their place; each file is read once."""
    ready: dict[int, Ready] = {}
    failed: dict[int, Result] = {}
    for i, path in enumerate(files):
        try:
            case = replace(load_case(path), beside=beside)
            ready[i] = case, fingerprint(case.content_hash())
        except Exception as error:
            failed[i] = _failed(path, error)
    taken = {case.name.casefold() for case, _ in ready.values()}
    for i, result in failed.items():
        name = result.name
        if out is not None and _fit(name) and name.casefold() not in taken:
            if (out / name).resolve() != files[i].parent.resolve():
                store.remove_result(out / name)
    for i, fault in _unfit_names({i: case for i, (case, _) in ready.items()}, out is not None).items():
        failed[i] = _failed(files[i], InputError(fault), ready.pop(i)[0].name)
    return ready, failed


def _unfit_names(cases: Mapping[int, Case], kept: bool) -> dict[int, Fault]:
    """Cases that would write where another one or the sweep itself does."""
    taken = "The sweep writes a file of that name"
    ours = {
        i: Fault(case.path.as_posix(), "name", repr(case.name), "another name", taken)
        for i, case in cases.items()
        if kept and case.name.casefold() in store.OVERVIEW
    }
    return ours | repeated_names(cases)


def off_tolerance(result: Result, tolerance: float) -> list[str]:
    """Why a case fails under --strict."""
    reasons = []
    for row in result.rows:
        if row.source == "bemt" and row.converged is False:
            reasons.append(f"{result.name}: unconverged at {row.rpm:g} rev/min, {row.airspeed_m_s:g} m/s")
        error = row.bemt_error_pct
        if error is not None and abs(error) > tolerance:
            reasons.append(f"{result.name}: BEMT thrust {error:+.1f} % off {row.label}")
    grid = result.grid
    if grid and grid.unconverged:
        reasons.append(f"{result.name}: {grid.unconverged} of {grid.points} grid points unconverged")
    return reasons


def require_extra(option: str, *modules: str) -> None:
    """Refuse an option whose optional packages are not installed."""
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    if missing:
        expected = "the optional packages of the extra 'dask'"
        raise InputError(Fault("", option, f"no {' and no '.join(missing)}", expected, "pip install 'bemt[dask]'"))

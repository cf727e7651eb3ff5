"""``python -m bemt sweep``: solve cases, print them beside their recorded values, write results that survive a kill.

Every case is solved for itself: its faults go into its own result and the others go on. With ``--out`` each case gets
a folder with ``result.json``, ``table.txt`` and, when it sweeps axes, ``grid.csv`` or ``grid.parquet``. A result is
reused when its fingerprint (case, references and other files, program, libraries) is unchanged.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import bemt
from bemt.case import find_cases, load_case
from bemt.errors import EXIT_INPUT, EXIT_INTERNAL, EXIT_OK, EXIT_UNCONVERGED, Fault, InputError
from bemt.grid.formats import FORMATS, require_extra
from bemt.grid.identity import program_hash
from bemt.grid.run import Engine, run_grid
from bemt.sweep.case import solve_case
from bemt.sweep.text import case_text, overview_text, rows_csv
from bemt.tables import json_text, plain, remove_stale, write_atomic

__all__ = ["SCHEMA", "fingerprint", "run", "sweep"]

SCHEMA = "bemt.sweep/1"
Progress = Callable[[str], None]


def fingerprint(content: str) -> str:
    """Identity of everything that decides a result.

    Parameters
    ----------
    content : str
        Hash of the files of the case.

    Returns
    -------
    str
        SHA-256, hexadecimal.
    """
    return hashlib.sha256(f"{SCHEMA} {program_hash()} {content}".encode()).hexdigest()


def _reuse(folder: Path, mark: str, form: str) -> dict[str, Any] | None:
    """Read the result of an earlier run with the same fingerprint, if it is whole."""
    try:
        stored = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        if stored["fingerprint"] != mark:
            return None
        grid = stored["result"].get("grid")
        if grid is not None and not (Path(grid["file"]).name == f"grid.{form}" and (folder / f"grid.{form}").is_file()):
            return None
        return dict(stored["result"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _failed(path: Path, faults: Sequence[str], code: int) -> dict[str, Any]:
    name = path.parent.name if path.name == "case.toml" else path.stem
    empty: dict[str, Any] = {key: [] for key in ("rows", "variants", "other_rows", "comparisons")}
    return {"name": name, "title": "", **empty, "faults": list(faults), "exit_code": code}


def run_case(
    path: Path,
    out: Path | None,
    resume: bool,
    threads: int,
    progress: Callable[[float, str], None] | None = None,
    form: str = "csv",
    engine: Engine | None = None,
) -> dict[str, Any]:
    """Do everything for one case; never raises but for an interrupt.

    Parameters
    ----------
    path : Path
        Case file.
    out : Path or None
        Folder of results.
    resume : bool
        Whether an earlier result or finished parts of a grid are reused.
    threads : int
        Threads of the solver.
    progress : callable, optional
        Called with (share done, what).
    form : str
        Format of the grid.
    engine : Engine, optional
        Who solves the grid; this process by default.

    Returns
    -------
    dict
        Plain result; ``faults`` and ``exit_code`` tell what went wrong.
    """
    tell = progress or (lambda share, what: None)
    try:
        case = load_case(path)
        mark = fingerprint(case.content_hash())
        folder = None if out is None else out / case.name
        if folder is not None:
            if folder.resolve() == case.folder.resolve():
                raise InputError(Fault("--out", "", f"the folder of the case {case.name} itself", "another folder",
                                       "Results would stand among its files"))  # fmt: skip
            remove_stale(folder)
            stored = _reuse(folder, mark, form) if resume else None
            if stored is not None:
                return stored
        with_grid = bool(case.axes())
        share = 0.5 if with_grid else 1.0
        result = solve_case(case, threads, lambda i, n, what: tell(share * i / n, what))
        result["grid"] = run_grid(
            case, folder, mark, threads, lambda i, n: tell(0.5 + 0.5 * i / n, f"grid {i}/{n}"), resume, form, engine
        )
        result["exit_code"] = EXIT_OK
        document: dict[str, Any] = plain(result)
        if folder is not None:
            if not with_grid:
                for other in FORMATS:
                    (folder / f"grid.{other}").unlink(missing_ok=True)
            write_atomic(folder / "table.txt", case_text(document) + "\n")
            write_atomic(folder / "result.json", json_text({"fingerprint": mark, "result": document}))
        return document
    except InputError as error:
        return _failed(path, [str(fault) for fault in error.faults], EXIT_INPUT)
    except Exception:
        return _failed(
            path, [f"{path.as_posix()}: internal error", *traceback.format_exc().splitlines()], EXIT_INTERNAL
        )


def _ignore_interrupt() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _results(
    paths: Sequence[Path],
    out: Path | None,
    resume: bool,
    jobs: int | None,
    bar: Progress,
    form: str,
    engine: Engine | None,
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Results in the order in which they come."""
    if engine is not None or jobs is None or jobs == 1 or len(paths) == 1:  # one process; its grid may use all cores
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        threads = cores if jobs is None or engine is not None else jobs
        for i, path in enumerate(paths):
            at = f"[{i + 1}/{len(paths)}] {path.parent.name or path.stem}"
            tell = lambda s, what, at=at: bar(f"{at} {_bar(s)} {what}")  # noqa: E731
            yield i, run_case(path, out, resume, threads, tell, form, engine)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed

    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(paths)), mp_context=context, initializer=_ignore_interrupt)
    try:
        futures = {pool.submit(run_case, path, out, resume, 1, None, form): i for i, path in enumerate(paths)}
        for n, future in enumerate(as_completed(futures), 1):
            i = futures[future]
            bar(f"{_bar(n / len(paths))} {n}/{len(paths)} cases")
            try:
                yield i, future.result()
            except Exception as error:  # a worker that died takes its case with it, not the sweep
                yield (
                    i,
                    _failed(paths[i], [f"{paths[i].as_posix()}: the worker process ended ({error!r})"], EXIT_INTERNAL),
                )
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _bar(share: float, width: int = 20) -> str:
    filled = round(width * min(max(share, 0.0), 1.0))
    return f"[{'#' * filled}{'.' * (width - filled)}]"


def sweep(
    paths: Sequence[str | Path], out: str | Path | None = None, *, jobs: int | None = None, resume: bool = True,
    progress: Progress | None = None, engine: str = "local", scheduler: str | None = None, grid_format: str = "csv",
) -> dict[str, Any]:  # fmt: skip
    """Solve cases.

    Parameters
    ----------
    paths : sequence of str or Path
        Case files, or folders of cases.
    out : str or Path, optional
        Folder of results.
    jobs : int, optional
        Cases at a time; by default one, with all cores for its grid. With Dask: workers of the local cluster.
    resume : bool
        Whether earlier results are reused.
    progress : callable, optional
        Called with a line of text.
    engine : str
        ``local`` solves grids on this machine, ``dask`` on a Dask cluster; the answer is the same.
    scheduler : str, optional
        Address of an existing Dask cluster; without it Dask runs on processes of this machine.
    grid_format : str
        ``csv``, or ``parquet``, which keeps all digits.

    Returns
    -------
    dict
        Document ``bemt.sweep/1``: ``cases`` in the order found, ``exit_code`` (highest of all).

    Raises
    ------
    InputError
        When a path holds no case, the folder of results cannot be made, options contradict each other or need what
        is not installed, or the scheduler does not answer.
    """
    _check_options(engine, scheduler, grid_format, jobs)
    files = find_cases(paths)
    folder = None if out is None else Path(out)
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(Fault(str(out), "", error.strerror or "no folder", "a folder for results")) from error
    with ExitStack() as stack:
        on: Engine | None = None
        if engine == "dask":
            from bemt.grid.dask_engine import Cluster

            on = stack.enter_context(Cluster(scheduler, jobs))
        tell = progress or (lambda line: None)
        again = _repeats(files)
        rest = [i for i in range(len(files)) if i not in again]
        paths_left = [files[i] for i in rest]
        for i, result in _results(paths_left, folder, resume, jobs, tell, grid_format, on) if rest else ():
            again[rest[i]] = result
    results = [again[i] for i in range(len(files))]
    document = {"schema": SCHEMA, "version": bemt.__version__, "cases": results,
                "exit_code": max((r["exit_code"] for r in results), default=EXIT_OK)}  # fmt: skip
    if folder is not None:
        write_atomic(folder / "sweep.json", json_text(document))
        write_atomic(folder / "sweep.csv", rows_csv(results))
        write_atomic(folder / "sweep.txt", overview_text(results) + "\n")
    return document


def _check_options(engine: str, scheduler: str | None, grid_format: str, jobs: int | None) -> None:
    """Refuse options of the grid that do not fit together, all at once."""
    faults = []
    for option, value, known in (("--engine", engine, ("local", "dask")), ("--grid-format", grid_format, FORMATS)):
        if value not in known:
            faults.append(Fault("", option, repr(value), " or ".join(known)))
    if scheduler is not None and engine == "local":
        faults.append(Fault("", "--scheduler", scheduler, "nothing with --engine local", "Add --engine dask"))
    if scheduler is not None and jobs is not None:
        expected = "nothing with --scheduler, whose cluster has its workers"
        faults.append(Fault("", "--jobs", str(jobs), expected, "Leave it out"))
    if faults:
        raise InputError(faults)
    if grid_format == "parquet":
        require_extra("--grid-format parquet", "pyarrow")
    if engine == "dask":
        require_extra("--engine dask", "dask", "distributed")


def _repeats(files: Sequence[Path]) -> dict[int, dict[str, Any]]:
    """Cases whose name another one has already: they would write into one folder, and are refused unsolved."""
    first: dict[str, Path] = {}
    refused = {}
    for i, path in enumerate(files):
        try:
            name = load_case(path).name
        except InputError:
            continue  # said where it is solved
        earlier = first.setdefault(name, path)
        if earlier != path:
            fault = Fault(path.as_posix(), "name", f"{name!r} as in {earlier.as_posix()}", "a name of its own")
            refused[i] = _failed(path, [str(fault)], EXIT_INPUT)
    return refused


def _off_tolerance(result: Mapping[str, Any], tolerance: float) -> list[str]:
    """Why a case fails under --strict."""
    reasons = []
    for row in result["rows"]:
        if row["source"] == "bemt" and not row.get("converged", True):
            reasons.append(f"{result['name']}: unconverged at {row['rpm']:g} rev/min, {row['airspeed_m_s']:g} m/s")
        error = row.get("bemt_error_pct")
        if error is not None and abs(error) > tolerance:
            reasons.append(f"{result['name']}: BEMT thrust {error:+.1f} % off {row['label']}")
    grid = result.get("grid")
    if grid and grid["unconverged"]:
        reasons.append(f"{result['name']}: {grid['unconverged']} of {grid['points']} grid points unconverged")
    return reasons


def run(args: argparse.Namespace) -> int:
    """Run the subcommand.

    Parameters
    ----------
    args : argparse.Namespace
        As :func:`bemt.cli.build_parser` makes it.

    Returns
    -------
    int
        Exit code.
    """
    show = sys.stderr.isatty() and not args.quiet

    def progress(line: str) -> None:
        if show:
            sys.stderr.write(f"\r\x1b[2K{line[:110]}")
            sys.stderr.flush()

    try:
        document = sweep(args.paths, args.out, jobs=args.jobs, resume=not args.no_resume, progress=progress,
                         engine=args.engine, scheduler=args.scheduler, grid_format=args.grid_format)  # fmt: skip
    finally:
        if show:
            sys.stderr.write("\r\x1b[2K")
    code = int(document["exit_code"])
    for result in document["cases"]:
        for fault in result["faults"]:
            print(fault, file=sys.stderr)
    if args.json:
        sys.stdout.write(json_text(document))
    elif not args.quiet:
        solved = [case_text(result) for result in document["cases"]]
        print("\n\n".join([*solved, overview_text(document["cases"])]))
    if args.strict:
        reasons = [line for r in document["cases"] if r["rows"] for line in _off_tolerance(r, args.tolerance)]
        for line in reasons:
            print(line, file=sys.stderr)
        if reasons:
            code = max(code, EXIT_UNCONVERGED)
    return code

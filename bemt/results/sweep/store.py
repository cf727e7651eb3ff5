"""What a sweep keeps in its folder: results that know their content, of one sweep at a time.

``DIR/<case>`` holds ``result.json``, ``table.txt`` and, when the case sweeps axes, ``grid.csv``.
A result says what it was made from (its fingerprint) and what it was when it was written (SHA-256 of itself and of the
grid); one that was edited, cut off or made from something else is never used. It is removed before the case is solved
anew, so that no reader takes an old one for the answer of a case that has failed or was interrupted.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import bemt
from bemt.base.errors import Fault, InputError
from bemt.base.tables import file_hash, json_text, write_atomic
from bemt.results.sweep.rows import Result, Sweep
from bemt.results.sweep.text import case_text, overview_text, rows_csv

SCHEMA = "bemt.sweep/1"
OVERVIEW = ("sweep.csv", "sweep.txt", "sweep.json")
"""Files over all cases, in the order in which they are written."""
RESULT, TABLE, LOCK = "result.json", "table.txt", ".sweep.lock"


def fingerprint(content: str) -> str:
    """Identity of everything that decides a result."""
    return hashlib.sha256(f"{SCHEMA} {program_hash()} {content}".encode()).hexdigest()


def _seal(stored: Mapping[str, Any]) -> str:
    return hashlib.sha256(json_text(stored).encode(errors="backslashreplace")).hexdigest()


def reuse(folder: Path, mark: str) -> Result | None:
    """Take up the result of an earlier sweep; its table is written anew."""
    try:
        stored = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        seal = stored.pop("sha256")
        if stored["fingerprint"] != mark or seal != _seal(stored):
            return None
        result = Result.from_document(stored["result"])
        if result.grid is not None and file_hash(folder / "grid.csv") != result.grid.sha256:
            return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    write_atomic(folder / TABLE, case_text(result) + "\n")
    return result


def keep(folder: Path, mark: str, result: Result) -> None:
    """Write table and result; the result comes last, so its presence marks completion."""
    stored = {"fingerprint": mark, "result": result.document()}
    write_atomic(folder / TABLE, case_text(result) + "\n")
    write_atomic(folder / RESULT, json_text({**stored, "sha256": _seal(stored)}))


def remove_result(folder: Path) -> None:
    """Remove the result of a case; finished chunks of its grid, which only their fingerprint makes a result, stay."""
    for name in (RESULT, TABLE, "grid.csv"):
        with suppress(FileNotFoundError, NotADirectoryError):
            (folder / name).unlink()


def clear_overview(folder: Path) -> None:
    """Remove the files over all cases, and what a kill left of them: they stand there only when a sweep has ended."""
    for path in (*(folder / name for name in OVERVIEW), *folder.glob(".sweep.*.tmp")):
        path.unlink(missing_ok=True)


def keep_overview(folder: Path, found: Sweep) -> None:
    """Write the files over all cases."""
    texts = (rows_csv(found.cases), overview_text(found.cases) + "\n", json_text(found.document()))
    for name, text in zip(OVERVIEW, texts, strict=True):
        write_atomic(folder / name, text)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a whole folder of results for one sweep; InputError when another one holds it.

    The lock is the system's, on an open file: it ends with the process, however that ends.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        got, hint = "a folder in use by another sweep", "Wait for the other one, or give another --out"
        raise InputError(Fault(str(folder), "", got, "one for this sweep", hint)) from None
    try:
        yield
    finally:
        with suppress(OSError):  # Windows keeps open files: there it stays
            (folder / LOCK).unlink()
        lock.release()


@lru_cache(maxsize=1)
def program_hash() -> str:
    """Hash of the program text and of the libraries that decide numbers."""
    digest = hashlib.sha256(bemt.__version__.encode())
    here = Path(bemt.__file__).parent
    for folder in (here, here.parent / "geometry"):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    for library in ("numpy", "numba", "neuralfoil"):
        try:
            digest.update(f"{library} {importlib.metadata.version(library)}\0".encode())
        except importlib.metadata.PackageNotFoundError:
            digest.update(f"{library} absent\0".encode())
    return digest.hexdigest()

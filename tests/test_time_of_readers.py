"""A reader's time goes with its file's size."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest
from test_recordings_mutated import BASES

from bemt.base.errors import InputError
from bemt.data.recordings.adapt import is_recording, reduction_of
from bemt.data.recordings.load import import_file

LINES = 600
"""Lines, or words of a line, before the doublings."""
LIMIT = 20.0
"""CPU time after which a reader is stopped. [s]"""


def _many(lines: list[bytes], n: int) -> list[bytes]:
    return lines * (n // max(len(lines), 1) + 1)


WAYS: dict[str, Callable[[list[bytes], int], list[bytes]]] = {
    "rows": lambda lines, n: [*lines, *_many(lines[-max(len(lines) // 2, 1) :], n)],
    "headings": lambda lines, n: [*_many(lines[:2], n), *lines[2:]],
    "first lines": lambda lines, n: [*_many(lines[:1], n), *lines[1:]],
    "the file": lambda lines, n: _many(lines, n),
    "a line": lambda lines, n: [lines[0].rstrip(b"\r\n") * min(n // 50, 60) + b"\n", *lines[1:]],
}


def seconds(path: Path) -> float:
    """CPU time of reading and reducing a file, whether or not it is refused."""
    began = time.process_time()
    try:
        got = import_file(path)
        if is_recording(got, False):
            reduction_of(got)
    except InputError:
        pass
    return time.process_time() - began


@pytest.fixture
def limited() -> Iterator[None]:
    """A reader that does not end is stopped: an exponential one is not waited for."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {LIMIT:g} s")

    old = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    signal.signal(signal.SIGPROF, old)


def holds(raw: bytes, name: str, way: str, folder: Path) -> None:
    lines, took = raw.splitlines(keepends=True), []
    if not lines[-1].endswith(b"\n"):
        lines[-1] += b"\n"
    for n in (LINES, 4 * LINES):
        file = folder / name
        file.write_bytes(b"".join(WAYS[way](lines, n)))
        took.append(min(seconds(file) for _ in range(2)))
    assert took[1] < 8.0 * took[0] + 0.15, f"{name}: {took[0]:.3f} s, four times as large {took[1]:.3f} s"


@pytest.mark.usefixtures("limited")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["log.csv", "points.csv", "stand.csv", "maker.csv"])
def test_no_reader_of_a_recording_is_quadratic(name: str, way: str, tmp_path: Path) -> None:
    holds(BASES[name].encode(), name, way, tmp_path)


@cache
def examples(root: Path) -> dict[str, Path]:
    """The smallest file of each folder and ending: each format of the outside files at least once."""
    found: dict[str, Path] = {}
    for file in sorted(root.rglob("*")):
        if file.is_file() and 100 < file.stat().st_size < 200_000 and b"\0" not in file.read_bytes()[:4000]:
            key = f"{file.parent.relative_to(root).as_posix()}*{file.suffix}"
            if key not in found or file.stat().st_size < found[key].stat().st_size:
                found[key] = file
    return found


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("folder", ["cfd_exports", "apc", "blades", "coaxial", "bench", "drivecalc", "jmajew", "uiuc"])
def test_no_reader_of_files_from_elsewhere_is_quadratic(
    folder: str, way: str, shared_data: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if not (shared_data / folder).is_dir():
        pytest.skip(f"no folder {folder}")
    for file in examples(shared_data / folder).values():
        request.getfixturevalue("limited")
        holds(file.read_bytes(), file.name, way, tmp_path)
        signal.setitimer(signal.ITIMER_PROF, LIMIT)


@pytest.mark.usefixtures("limited")
@pytest.mark.parametrize("way", WAYS)
def test_a_table_of_y_plus_is_read_at_once(way: str, tmp_path: Path) -> None:
    head = "# y+ ()\n# Time        \tpatch           \tmin             \tmax             \taverage\n"
    holds((head + "3000\tpropeller\t5.758e+00\t1.391e+03\t9.253e+01\n").encode(), "yPlus.dat", way, tmp_path)

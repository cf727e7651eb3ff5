"""The promise of the tools: each can be taken away, the rest runs on unchanged."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from pathlib import Path

import pytest

from bemt.app.cli import main
from bemt.base import plugins

CALLS = {
    "cfd": ["cfd", "reports/cfd"],
    "design": ["choose", "--thrust", "10", "--cells", "4"],
    "drive": ["drive", "10x5", "--kv", "1000", "--cells", "3"],
    "exports": ["export", "cases/prop_8x5", "--out", "out"],
    "flight": ["fly", "log.csv"],
    "stand": ["stand", "cases/prop_8x5", "--out", "out"],
}
"""An action of each tool."""
SWEEP = ["sweep", "cases/prop_8x5", "cases/ds30", "--json"]
"""The second case has a drive."""
MISSED = "The {0} tool is not installed: put the folder bemt/tools/{0} back"
DIAGNOSE = ["diagnose", "reports/diagnosis/cfd_plate.csv", "--reference", "reports/diagnosis/cfd_reference.csv",
            "--case", "cases/prop_8x5", "--json"]  # fmt: skip


SESSION = """
import io, json, runpy, sys
from contextlib import redirect_stderr, redirect_stdout
out = []
for words in json.loads(sys.argv[1]):
    sys.argv, code = ["bemt", *words], 0
    with redirect_stdout(io.StringIO()) as said, redirect_stderr(io.StringIO()) as warned:
        try:
            runpy.run_module("bemt", run_name="__main__")
        except SystemExit as stop:
            code = stop.code or 0
    out.append((code, said.getvalue(), warned.getvalue()))
print(json.dumps(out))
"""


def run(folder: Path, *commands: list[str]) -> list[tuple[int, str, str]]:
    """Exit code, answer and errors of commands of the package in a folder, one after the other in a process."""
    call = [sys.executable, "-c", SESSION, json.dumps(commands)]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return [(code, said, warned) for code, said, warned in json.loads(done.stdout)]


def without(tools: set[str], project: Path, folder: Path) -> Path:
    """The package with its cases as links, some tools left out."""
    (folder / "bemt" / "tools").mkdir(parents=True)
    for source, target, left_out in (
        (project, folder, {"bemt"}),
        (project / "bemt", folder / "bemt", {"tools", "__pycache__"}),
        (project / "bemt" / "tools", folder / "bemt" / "tools", {*tools, "__pycache__"}),
    ):
        for path in source.iterdir():
            if path.name not in left_out and not path.name.startswith("."):
                os.symlink(path, target / path.name)
    return folder


def rows_and_notes(swept: str) -> tuple[list[object], list[str]]:
    """Rows of a sweep, and what it notes on tools."""
    document = json.loads(swept)
    assert document["exit_code"] == 0
    notes = [note for case in document["cases"] for note in case["notes"] if "not installed" in note]
    return [case["rows"] for case in document["cases"]], notes


@pytest.fixture(scope="module")
def whole(project: Path) -> tuple[list[object], object]:
    """Rows and ranking with all tools, of this process."""
    said = []
    for words in (SWEEP, DIAGNOSE):
        with chdir(project), redirect_stdout(io.StringIO()) as out:
            assert main(words) == 0
        said.append(out.getvalue())
    rows, notes = rows_and_notes(said[0])
    assert not notes
    return rows, json.loads(said[1])["ranking"]


def test_each_tool_of_the_package_is_known(project: Path) -> None:
    folders = {path.parent.name for path in (project / "bemt" / "tools").glob("*/__init__.py")}
    assert folders == set(plugins.TOOLS) == set(CALLS)


ALL = sorted(plugins.TOOLS)


@pytest.mark.parametrize("tools", [ALL, *(pytest.param([one], marks=pytest.mark.slow) for one in ALL)], ids="-".join)
def test_the_rest_runs_on_without_tools(
    tools: list[str], project: Path, tmp_path: Path, whole: tuple[list[object], object]
) -> None:
    """All at once, as a rule; each alone, when there is time."""
    folder = without(set(tools), project, tmp_path)
    report = ["report", "cases/prop_8x5", "--out", "report"]
    assert run(folder, ["--help"])[0][0] == 0, "in a process that knows no other command"
    swept, told, reported, *calls = run(folder, SWEEP, DIAGNOSE, report, *(CALLS[tool] for tool in tools))
    rows, notes = rows_and_notes(swept[1])
    assert (rows, json.loads(told[1])["ranking"]) == whole
    assert len(notes) == ("drive" in tools), "said where a case has a drive"
    assert all(MISSED.format("drive") in note for note in notes)
    assert reported[0] == 0 and (folder / "report" / "report.html").is_file(), reported[2]
    for tool, (code, _, warned) in zip(tools, calls, strict=True):
        assert code == 2 and warned.startswith(MISSED.format(tool)) and len(warned.splitlines()) == 1


@pytest.mark.parametrize("tool", ALL)
def test_what_is_missed_without_one_tool_is_named(tool: str, project: Path, tmp_path: Path) -> None:
    helped, missed = run(without({tool}, project, tmp_path), ["--help"], CALLS[tool])
    assert helped[0] == 0
    assert missed[0] == 2 and missed[2].startswith(MISSED.format(tool)) and len(missed[2].splitlines()) == 1


def test_a_target_of_another_tool_is_missed_by_name(project: Path, tmp_path: Path) -> None:
    export = ["export", "cases/prop_8x5", "--out", "out", "--format"]
    (code, _, foam), (other, _, level) = run(
        without({"cfd"}, project, tmp_path), [*export, "openfoam"], [*export, "qprop", "--level", "5"]
    )
    assert (code, other) == (2, 2) and "The cfd tool is not installed" in foam
    assert "--level: got 5; expected nothing with the format qprop" in level

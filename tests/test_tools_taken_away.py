"""The promise of the tools: each can be taken away, the rest runs on unchanged."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

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
DIAGNOSE = ["diagnose", "reports/diagnosis/cfd_plate.csv", "--reference", "reports/diagnosis/cfd_reference.csv",
            "--case", "cases/prop_8x5", "--json"]  # fmt: skip


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """One command of the package in a folder."""
    return subprocess.run(
        [sys.executable, "-m", "bemt", *words], cwd=folder, capture_output=True, text=True, timeout=600
    )


def without(tool: str, project: Path, folder: Path) -> Path:
    """The package with its cases as links, one tool left out."""
    tools = folder / "bemt" / "tools"
    tools.mkdir(parents=True)
    for source, target, left_out in (
        (project, folder, {"bemt"}),
        (project / "bemt", folder / "bemt", {"tools", "__pycache__"}),
        (project / "bemt" / "tools", tools, {tool, "__pycache__"}),
    ):
        for path in source.iterdir():
            if path.name not in left_out and not path.name.startswith("."):
                os.symlink(path, target / path.name)
    return folder


def answers(folder: Path) -> tuple[list[object], object, list[str]]:
    """Rows of a sweep, the ranking of a diagnosis, the notes on tools."""
    swept, told = (json.loads(run(folder, *words).stdout) for words in (SWEEP, DIAGNOSE))
    notes = [note for case in swept["cases"] for note in case["notes"] if "not installed" in note]
    assert swept["exit_code"] == 0 and told["schema"].startswith("bemt.diagnosis/")
    return [case["rows"] for case in swept["cases"]], told["ranking"], notes


@pytest.fixture(scope="module")
def whole(project: Path) -> tuple[list[object], object, list[str]]:
    """The same with all tools."""
    return answers(project)


def test_each_tool_of_the_package_is_known(project: Path) -> None:
    folders = {path.parent.name for path in (project / "bemt" / "tools").glob("*/offers.py")}
    assert folders == set(plugins.TOOLS) == set(CALLS)


@pytest.mark.parametrize("tool", sorted(plugins.TOOLS))
def test_the_rest_runs_on_without_a_tool(
    tool: str, project: Path, tmp_path: Path, whole: tuple[list[object], object, list[str]]
) -> None:
    folder = without(tool, project, tmp_path)
    sentence = f"The {tool} tool is not installed: put the folder bemt/tools/{tool} back"
    assert run(folder, "--help").returncode == 0
    rows, ranking, notes = answers(folder)
    assert (rows, ranking) == whole[:2] and whole[2] == []
    assert len(notes) == (tool == "drive") and all(sentence in note for note in notes), "said where a case has a drive"
    done = run(folder, "report", "cases/prop_8x5", "--out", "report")
    assert done.returncode == 0 and (folder / "report" / "report.html").is_file(), done.stderr
    done = run(folder, *CALLS[tool])
    assert done.returncode == 2 and done.stderr.startswith(sentence) and len(done.stderr.splitlines()) == 1


def test_a_target_of_another_tool_is_missed_by_name(project: Path, tmp_path: Path) -> None:
    folder = without("cfd", project, tmp_path)
    done = run(folder, "export", "cases/prop_8x5", "--out", "out", "--format", "openfoam")
    assert done.returncode == 2 and "The cfd tool is not installed" in done.stderr
    done = run(folder, "export", "cases/prop_8x5", "--out", "out", "--format", "qprop", "--level", "5")
    assert done.returncode == 2 and "--level: got 5; expected nothing with the format qprop" in done.stderr

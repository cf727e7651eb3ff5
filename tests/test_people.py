"""The promise of docs/people and of the quick start: what is printed runs, in the lines that are claimed."""

from __future__ import annotations

import ast
import json
import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from bemt.app.cli import main

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = sorted((ROOT / "docs" / "people").glob("*.py"))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the scripts need of the project, in a folder that may be written to."""
    for part in ("cases", "reports/diagnosis", "reports/cfd/prop_8x5_incompressible"):
        shutil.copytree(ROOT / part, tmp_path / part)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_answers_and_draws(script: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import matplotlib.pyplot as plt

    runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
    drawn = [path for path in folder.glob("*.png") if path.stat().st_size > 5000]
    assert len(drawn) == 2 and capsys.readouterr().out.strip()


def code_lines(text: str) -> int:
    """Lines without blank ones, comments and docstrings."""
    tree, skipped = ast.parse(text), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef) and ast.get_docstring(node):
            skipped |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    rows = enumerate(text.splitlines(), 1)
    return sum(bool(row.strip()) and not row.lstrip().startswith("#") and k not in skipped for k, row in rows)


def test_the_lines_that_are_claimed_are_those_of_the_scripts() -> None:
    page = (ROOT / "docs" / "people.md").read_text(encoding="utf-8")
    claimed: dict[str, int] = {}
    for name, lines in re.findall(r"^\| [^|]+ \| `(\w+)\.py`,? [^|\d]*(\d+)[^|]* \|", page, flags=re.M):
        claimed[name] = claimed.get(name, 0) + int(lines)
    assert claimed == {path.stem: code_lines(path.read_text(encoding="utf-8")) for path in SCRIPTS}


def alike(line: str, printed: str) -> bool:
    """Whether two lines have the same words, and numbers within 5 %."""
    number = r"\d+(?:\.\d+)?"
    if re.sub(number, "#", line).split() != re.sub(number, "#", printed).split():
        return False
    a, b = ([float(v) for v in re.findall(number, text)] for text in (line, printed))
    return a == pytest.approx(b, rel=0.05)


def test_the_quick_start_runs_as_printed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every command from section 2 on, in one folder; the truth of section 3 is found in section 4 and not without.

    What the page shows is what they print, and the sweep of section 1.
    """
    page = (ROOT / "docs" / "quickstart.md").read_text(encoding="utf-8")
    text = page.partition("\n## 2.")[2]
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.M | re.S)
    commands = [line for block in blocks for line in block.splitlines()]
    assert len(commands) >= 7
    assert main(["sweep", "cases/"]) == 0
    shown = capsys.readouterr().out
    for command in commands:
        words = shlex.split(command)
        if words[0] == "bemt":
            assert main(words[1:]) == 0, command
        else:
            assert words[0] == "python" and words[1].startswith("docs/"), command
            monkeypatch.setattr(sys, "argv", words[1:])
            runpy.run_path(str(ROOT / words[1]), run_name="__main__")
        shown += capsys.readouterr().out
    pictured = [
        line for block in re.findall(r"^```text\n(.*?)^```", page, flags=re.M | re.S) for line in block.splitlines()
    ]
    assert [line for line in pictured if not any(alike(line, own) for own in shown.splitlines())] == []
    told = json.loads(Path("diagnosis/diagnosis.json").read_text(encoding="utf-8"))
    first = told["ranking"][0]
    assert told["effects"][0] == first["effect"] == "pitch_offset" and len(told["effects"]) <= 2
    assert abs(first["parameters"]["offset_deg"]["value"] - 1.5) < 0.3
    assert re.search(r"^ +pitch_offset .* no  ", shown, flags=re.M)
    assert main(["diagnose", "after.csv", "--case", "prop_10x5"]) == 0
    assert "verdict: insufficient" in capsys.readouterr().out


def fluent(path: Path, name: str, value: float) -> None:
    """A report file as Fluent writes it: a history that settles at a value."""
    rows = "".join(f"{k} {value * (1.0 + 0.3 * 0.97**k):.8g}\n" for k in range(1, 601))
    path.write_text(f'"{path.stem}"\n"Iteration" "{name}"\n("Iteration" "{name}")\n{rows}')


def test_the_commands_of_the_cfd_engineer_run_on_fluent_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The block of docs/people.md as printed, with .out files; two grids are told apart before any physics."""
    page = (ROOT / "docs" / "people.md").read_text(encoding="utf-8").partition("## The CFD engineer")[2]
    block = re.findall(r"^```sh\n(.*?)^```", page, flags=re.M | re.S)[0]
    first = shlex.split(block.splitlines()[0])
    runs = {"coarse": (55000, 22.1, "6e5"), "fine": (55000, 23.4, "5e6"), "run1": (35000, 9.4, "5e6"),
            "run2": (45000, 15.6, "5e6"), "run3": (55000, 23.4, "5e6")}  # fmt: skip
    for name, (rpm, thrust, cells) in runs.items():
        fluent(folder / "thrust-rfile.out", "thrust", thrust)
        fluent(folder / "torque-rfile.out", "torque", 0.0104 * thrust)
        words = [{"55000": str(rpm), "run.toml": f"{name}.toml"}.get(w, w) for w in first[1:]]
        assert main([*words, "--setup", f"cells={cells}"]) == 0
    capsys.readouterr()
    shown = {}
    for command in block.splitlines():
        assert main(shlex.split(command)[1:]) == 0, command
        shown[command.split()[1], len(shown)] = capsys.readouterr().out
    assert "23." in shown["compare", 1] and "grid" in shown["compare", 2] and "verdict" in shown["diagnose", 3]

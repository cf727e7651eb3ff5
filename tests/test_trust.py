"""What somebody else's case, checkout or texts may do: be read. docs/believe.md says the same in words."""

from __future__ import annotations

import csv
import io
import os
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bemt.base.checkout import commit
from bemt.base.errors import InputError
from bemt.base.tables import csv_text
from bemt.rotors.case import load_case
from bemt.tools.drive import motor_result

CASES = Path(__file__).resolve().parents[1] / "cases"
HASH = "0123456789abcdef0123456789abcdef01234567"


def checkout(folder: Path, head: str = "ref: refs/heads/main\n", loose: str | None = HASH) -> Path:
    """A folder with a .git made by hand, valid enough for git itself."""
    git = folder / ".git"
    (git / "objects").mkdir(parents=True)
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text(head)
    if loose is not None:
        (git / "refs" / "heads" / "main").write_text(loose + "\n")
    return git


# ---- the checkout of the cases


def test_a_report_runs_nothing_that_the_checkout_of_the_cases_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`git describe --dirty` ran core.fsmonitor of whoever sent the cases."""
    own, ran = tmp_path / "own", tmp_path / "ran"
    git = checkout(own)
    script = tmp_path / "bin" / "git"  # what the configuration names, and git itself: neither may start
    script.parent.mkdir()
    script.write_text(f"#!/bin/sh\ntouch {ran}\necho made-up\n")
    script.chmod(0o755)
    (git / "config").write_text(f"[core]\n\trepositoryformatversion = 0\n\tfsmonitor = {script}\n")
    (git / "hooks").mkdir()
    shutil.copy(script, git / "hooks" / "post-index-change")
    monkeypatch.setenv("PATH", f"{script.parent}{os.pathsep}{os.environ['PATH']}")
    assert commit(own) == HASH[:12]
    assert not ran.exists()


def test_the_commit_is_found_wherever_git_keeps_it(tmp_path: Path) -> None:
    assert commit(tmp_path) == ""
    git = checkout(tmp_path / "loose")
    (tmp_path / "loose" / "cases" / "a").mkdir(parents=True)
    assert commit(tmp_path / "loose" / "cases" / "a") == HASH[:12]
    checkout(tmp_path / "detached", HASH + "\n")
    assert commit(tmp_path / "detached") == HASH[:12]
    packed = checkout(tmp_path / "packed", loose=None)
    assert commit(tmp_path / "packed") == ""
    (packed / "packed-refs").write_text(
        f"# pack-refs with: peeled\n{'f' * 40} refs/heads/other\n{HASH} refs/heads/main\n"
    )
    assert commit(tmp_path / "packed") == HASH[:12]
    linked = git / "worktrees" / "b"
    linked.mkdir(parents=True)
    (linked / "HEAD").write_text("ref: refs/heads/main\n")
    (linked / "commondir").write_text("../..\n")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / ".git").write_text(f"gitdir: {linked}\n")
    assert commit(tmp_path / "b") == HASH[:12]


@pytest.mark.parametrize(
    "head", ["ref: ../../secret\n", "ref: refs/../../../secret\n", "secret words\n", "", "\0", "ref: "]
)
def test_a_checkout_shows_nothing_but_a_hash(tmp_path: Path, head: str) -> None:
    (tmp_path / "secret").write_text(HASH)
    checkout(tmp_path / "a" / "b", head)
    assert commit(tmp_path / "a" / "b") == ""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_in_a_checkout_keeps_nobody_waiting(tmp_path: Path) -> None:
    git = checkout(tmp_path)
    (git / "HEAD").unlink()
    os.mkfifo(git / "HEAD")
    assert commit(tmp_path) == ""


# ---- files that a case names


@pytest.mark.parametrize("form", ["up", "absolute", "link", "far up"])
def test_references_lie_in_the_folder_of_the_case(tmp_path: Path, form: str) -> None:
    """What they hold is printed and put into reports."""
    own = tmp_path / "own"
    shutil.copytree(CASES / "prop_8x5", own)
    secret = tmp_path / "secret.csv"
    secret.write_text("password,hunter2\n")
    (own / "link.csv").symlink_to(secret)
    name = {"up": "../secret.csv", "absolute": secret.as_posix(), "link": "link.csv", "far up": "../../.."}[form]
    text = (own / "case.toml").read_text()
    (own / "case.toml").write_text(text.replace('references = "references.csv"', f'references = "{name}"', 1))
    with pytest.raises(InputError) as caught:
        load_case(own)
    mine = [f for f in caught.value.faults if f.where == "references" and "outside" in f.got]
    assert mine and "hunter2" not in str(caught.value)


def test_a_file_further_down_or_a_case_behind_a_link_is_fine(tmp_path: Path) -> None:
    own = tmp_path / "own"
    shutil.copytree(CASES / "prop_8x5", own)
    (own / "measured").mkdir()
    (own / "references.csv").rename(own / "measured" / "r.csv")
    text = (own / "case.toml").read_text().replace('"references.csv"', '"measured/../measured/r.csv"')
    (own / "case.toml").write_text(text)
    (tmp_path / "link").symlink_to(own)
    assert load_case(own).name == load_case(tmp_path / "link").name == "prop_8x5"


def test_a_motor_names_no_file_outside_its_folder(tmp_path: Path) -> None:
    (tmp_path / "emf.csv").write_text("trial,rpm,V\n1,100,1\n")
    own = tmp_path / "own"
    own.mkdir()
    text = (CASES.parent / "reports" / "drive" / "motor_mn4006" / "motor.toml").read_text()
    text = text.replace('"back_emf.csv"', '"../emf.csv"').replace('"torque.csv"', '"/etc/t.csv"')
    (own / "motor.toml").write_text(text)
    with pytest.raises(InputError) as caught:
        motor_result.read(own)
    assert [f.where for f in caught.value.faults] == ["back_emf.file", "torque.file"]


# ---- texts in tables


@pytest.mark.parametrize("text", ["=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "\t=1+1", "\r=1", "--", "=1+1"])
def test_a_spreadsheet_calculates_no_text_of_a_table(text: str) -> None:
    table = csv_text(["name", text], [{"name": text, text: 1.0}, {"name": [text, "b"]}])
    for row in csv.reader(io.StringIO(table, newline="")):
        assert not any(cell.startswith(("=", "+", "-", "@", "\t", "\r")) for cell in row), row


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=5))
def test_numbers_stay_numbers(values: list[float]) -> None:
    rows = list(csv.DictReader(io.StringIO(csv_text(["v"], [{"v": repr(v)} for v in values]))))
    assert [float(row["v"]) for row in rows] == values

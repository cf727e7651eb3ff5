"""Sixty small wrong changes are noticed; tests/mutants.py has them, and says which survive."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import mutants
import pytest

NAMED = ("PITT_PETERS", "0.1 * cl0", "PWM_MIN", "SCATTER", "SINK", "t[0] == 0.0")
"""What must not survive in any case."""


@pytest.mark.parametrize("mutant", mutants.MUTANTS, ids=lambda m: m.name[:50])
def test_each_wrong_change_still_has_its_place(project: Path, mutant: mutants.Mutant) -> None:
    """A text that moved to another file would go unnoticed until the slow run."""
    assert (project / mutant.file).read_text(encoding="utf-8").count(mutant.text) == 1


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_small_wrong_changes_are_noticed(project: Path, shared_data: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "tests/mutants.py"], cwd=project, env={**os.environ, "BEMT_DATA": str(shared_data)},
        capture_output=True, text=True, check=False, timeout=3600,
    )  # fmt: skip
    found = json.loads(ran.stdout)
    assert found["broken"] == [], "tests that fail without a mutant, or find none, say nothing"
    assert found["killed"] >= 0.95 * found["mutants"] and found["mutants"] >= 60, found["survived"]
    assert [name for name in found["survived"] if any(word in name for word in NAMED)] == []
    assert found["cpu_s"] < 8 * 60.0

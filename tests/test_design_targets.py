"""The promise of docs/design.md: ten targets, none with more power than the best label."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def targets(script: Callable[[str], Any]) -> Any:
    """The script docs/design_targets.py."""
    return script("design_targets")


def _rows(project: Path, targets: Any) -> dict[str, list[str]]:
    text = (project / "docs/design.md").read_text(encoding="utf-8").split(targets.HEAD)[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.split("\n\n")[0].splitlines()]
    return {row[0]: row for row in rows}


def test_the_page_has_every_target_and_no_loss(project: Path, targets: Any) -> None:
    rows = _rows(project, targets)
    assert list(rows) == [target.words for target in targets.TARGETS]
    assert all(float(row[4].rstrip("%")) >= 0.0 and float(row[1]) <= float(row[3]) for row in rows.values())
    assert len(rows) == 10


@pytest.mark.slow
@pytest.mark.parametrize("i", range(10))
def test_a_target_comes_out_as_on_the_page(i: int, project: Path, targets: Any) -> None:
    target = targets.TARGETS[i]
    row = _rows(project, targets)[target.words]
    found = targets.designed(target, **targets.LIKE_A_LABEL)
    assert found.found.converged and found.label.name == row[2]
    assert found.mean_W == pytest.approx(float(row[1]), rel=2e-3)
    assert found.mean_W <= found.label.mean_W

"""The promise of docs/design.md: ten targets, none with more power than the best label."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


def _script(project: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("design_targets", project / "docs/design_targets.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks itself up
    spec.loader.exec_module(module)
    return module


def _rows(project: Path, script: ModuleType) -> dict[str, list[str]]:
    text = (project / "docs/design.md").read_text(encoding="utf-8").split(script.HEAD)[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.split("\n\n")[0].splitlines()]
    return {row[0]: row for row in rows}


def test_the_page_has_every_target_and_no_loss(project: Path) -> None:
    script = _script(project)
    rows = _rows(project, script)
    assert list(rows) == [target.words for target in script.TARGETS]
    assert all(float(row[4].rstrip("%")) >= 0.0 and float(row[1]) <= float(row[3]) for row in rows.values())
    assert len(rows) == 10


@pytest.mark.slow
@pytest.mark.parametrize("i", range(10))
def test_a_target_comes_out_as_on_the_page(i: int, project: Path) -> None:
    script = _script(project)
    target = script.TARGETS[i]
    row = _rows(project, script)[target.words]
    found = script.designed(target, **script.LIKE_A_LABEL)
    assert found.found.converged and found.label.name == row[2]
    assert found.mean_W == pytest.approx(float(row[1]), rel=2e-3)
    assert found.mean_W <= found.label.mean_W

"""The promise of the check: skips without leave, failures or missing tests are not green."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def guard() -> ModuleType:
    spec = importlib.util.spec_from_file_location("ci_guard", Path(__file__).resolve().parents[1] / ".ci" / "guard.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def junit(folder: Path, passed: int, *cases: str) -> Path:
    body = '<testcase name="a"/>' * passed + "".join(f'<testcase name="b">{case}</testcase>' for case in cases)
    (folder / "run.xml").write_text(f"<testsuites><testsuite>{body}</testsuite></testsuites>")
    return folder / "run.xml"


def test_a_run_is_green_only_where_enough_passed_and_nothing_skipped_without_leave(
    guard: ModuleType, tmp_path: Path
) -> None:
    away = '<skipped message="reference data not found at ../shared/data; name their folder in BEMT_DATA"/>'
    assert guard.faults(junit(tmp_path, 6000, away), "fast", data=False) == []
    assert "without leave" in guard.faults(junit(tmp_path, 6000, away), "fast", data=True)[0]
    assert "without leave" in guard.faults(junit(tmp_path, 6000, '<skipped message="later"/>'), "fast", data=False)[0]
    assert "or more must" in guard.faults(junit(tmp_path, 10), "fast", data=False)[0]
    assert "1 tests failed" in guard.faults(junit(tmp_path, 6000, "<failure/>"), "fast", data=False)[0]

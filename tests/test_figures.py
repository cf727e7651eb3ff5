"""Every stated figure is in the committed report that holds it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


def module() -> ModuleType:
    path = Path(__file__).resolve().parents[1] / "docs" / "figures.py"
    spec = importlib.util.spec_from_file_location("stated_figures", path)
    assert spec and spec.loader
    found = importlib.util.module_from_spec(spec)
    sys.modules["stated_figures"] = found
    spec.loader.exec_module(found)
    return found


STATED = module()


@pytest.mark.parametrize("figure", STATED.FIGURES, ids=lambda f: f"{f.page}: {f.sentence[:40]}")
def test_a_figure_is_what_its_report_holds(figure: object) -> None:
    assert STATED.check(figure) == ""


@pytest.mark.parametrize("page", STATED.PARTS)
def test_no_figure_is_without_a_report(page: str) -> None:
    assert STATED.unheld(page) == []


def test_the_page_of_promises_is_what_its_script_makes() -> None:
    docs = Path(STATED.__file__).parent
    sys.path.insert(0, str(docs))
    try:
        import promises
    finally:
        sys.path.remove(str(docs))
    assert (docs / "promises.md").read_text(encoding="utf-8") == promises.made(), "run python docs/promises.py"


def test_the_two_runs_add_up_and_the_last_is_the_committed_one() -> None:
    right, all_, *each = STATED.claims(STATED.load(STATED.PROOF))
    assert (right, all_) == (each[0] + each[2], each[1] + each[3])
    score = STATED.load("reports/proof/proof.json")["score"]
    last = next(row for row in score if row["what"] == "right when it claims")
    assert each[2:] == [last["hits"], last["n"]]

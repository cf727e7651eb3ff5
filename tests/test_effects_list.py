"""The promise of ``python -m bemt effects``: the catalogue and nothing else, in every form it is printed."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bemt import effects
from bemt.commands import cli
from bemt.report import effects_list

NEW = '''
from dataclasses import dataclass

from bemt.effects.base import Effect, Flow, Parameter, Reading


@dataclass(frozen=True)
class MadeUp(Effect):
    """Made up for a test.

    Notes
    -----
    Declared here.
    """

    size: float = 0.5
    form: str = "round"

    id = "made_up"
    title = "made up for a test"
    sign = "nobody has ever seen it"
    kind = "drive"
    parameters = (Parameter("size", "furlong", 0.25, 0.75, "nobody"),)
    on_by_default = False

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Nothing."""

    def variants(self):
        return ({"form": "round"}, {"form": "square"})
'''


@pytest.fixture
def made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """One more file in the package, and no other edit."""
    (tmp_path / "made_up.py").write_text(NEW)
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    effects.catalogue.cache_clear()
    yield
    monkeypatch.undo()
    effects.catalogue.cache_clear()
    sys.modules.pop("bemt.effects.made_up", None)


def printed(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    assert cli.main(["effects", *options]) == 0
    return capsys.readouterr().out


def test_the_page_is_what_the_command_prints(project: Path) -> None:
    page = (project / "docs" / "effects.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^### (\S+)$", page, flags=re.M))  # a new effect may wait for the next edition
    assert len(named) > 30
    assert page == effects_list.markdown(named), "run python -m bemt effects --markdown > docs/effects.md"


def test_every_effect_is_in_every_form(capsys: pytest.CaptureFixture[str]) -> None:
    table, page = printed(capsys), printed(capsys, "--markdown")
    document = json.loads(printed(capsys, "--json"))
    assert document["schema"] == "bemt.effects/1"
    by_id = {e["id"]: e for e in document["effects"]}
    assert len(by_id) == len(document["effects"]) and set(by_id) == set(effects.catalogue())
    for name, cls in effects.catalogue().items():
        assert any(line.split()[:1] == [name] for line in table.splitlines())
        assert f"### {name}\n" in page and f"](#{name}) | {cls.title} | {cls.sign} |" in page
        given = by_id[name]["parameters"]
        assert [(p["name"], p["unit"]) for p in given] == [(p.name, p.unit) for p in cls.parameters]
        ends = [(p["low"], p["high"]) for p in given]
        assert ends == [pytest.approx((p.low, p.high), rel=1e-9) for p in cls.parameters]
        assert all(f"| `{p.name}` | {p.unit} |" in page and p.source in page for p in cls.parameters)
        assert by_id[name]["source"], "no Notes"


def test_a_page_has_no_line_that_breaks_its_table(project: Path) -> None:
    rows = [line for line in (project / "docs" / "effects.md").read_text().splitlines() if line.startswith("|")]
    assert rows and {line.count("|") for line in rows} <= {4, 7}


@pytest.mark.usefixtures("made_up")
def test_a_new_file_is_listed_without_another_edit(capsys: pytest.CaptureFixture[str]) -> None:
    page = printed(capsys, "--markdown")
    assert "### made_up" in page and "| `size` | furlong | 0.5 | 0.25 to 0.75 |" in page
    assert "`form`: `round`, `square`" in page
    assert "made up for a test" in printed(capsys)
    (ours,) = [e for e in effects_list.document()["effects"] if e["id"] == "made_up"]
    assert ours["choices"] == {"form": ["round", "square"]} and ours["kind"] == "drive"


def test_the_new_file_leaves_no_trace() -> None:
    assert "made_up" not in effects.catalogue()

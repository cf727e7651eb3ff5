"""The promise of typed files: wrong values and unknown keys are refused at once."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bemt.base.toml import FieldLimits, Table, limits_of, validated
from bemt.base.toml_text import Collector
from bemt.data.readers.recording_toml import RecordingToml
from bemt.rotors.case.schema import CaseFile
from bemt.tools.cfd.schema import CampaignFile
from bemt.tools.drive.motor_result import MotorToml
from bemt.tools.drive.thrusters_result import ThrustersFile

MODELS: dict[str, type[Table]] = {
    "campaign": CampaignFile, "motor": MotorToml, "recording": RecordingToml, "thrusters": ThrustersFile,
}  # fmt: skip
Path_ = tuple[Any, ...]


def leaves(value: Any, path: Path_ = ()) -> Iterator[Path_]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from leaves(item, (*path, key))
    if not isinstance(value, (dict, list)):
        yield path


def changed(document: dict[str, Any], path: Path_, value: Any, name: str | None = None) -> dict[str, Any]:
    made = copy.deepcopy(document)
    table: Any = made
    for key in path[:-1]:
        table = table[key]
    if name is not None:
        del table[path[-1]]
    table[path[-1] if name is None else name] = value
    return made


def faults(name: str, document: dict[str, Any]) -> dict[str, str]:
    out = Collector(f"{name}.toml")
    assert (validated(MODELS[name], document, out) is None) is bool(out.faults)
    return {fault.where: str(fault) for fault in out.faults}


def dotted(path: Path_) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)[1:]


@pytest.mark.parametrize("name", MODELS)
def test_every_wrong_value_is_refused_at_its_place(name: str, project: Path) -> None:
    sound = tomllib.loads((project / "docs" / "files" / f"{name}.toml").read_text(encoding="utf-8"))
    assert not faults(name, sound)
    bad = sound
    paths = list(leaves(sound))
    for path in paths:
        table = faults(name, changed(sound, path, {"no": "table"}))
        assert any(where.startswith(dotted(path)) for where in table), dotted(path)
        bad = changed(bad, path, float("nan"))
        if not isinstance(path[-1], int):
            where = dotted((*path[:-1], f"{path[-1]}q"))
            found = faults(name, changed(sound, path, 1, f"{path[-1]}q"))[where]
            assert (
                found.startswith(f"{name}.toml: {where}: got an unknown key") and f"Did you mean {path[-1]}?" in found
            )
    assert set(faults(name, bad)) == set(map(dotted, paths))  # all at once


@pytest.mark.parametrize("model", [CaseFile, *MODELS.values()])
def test_every_value_says_what_it_is(model: type[Table]) -> None:
    for key, field in model.named().items():
        inner = model.inner(key)
        if inner is not None:
            test_every_value_says_what_it_is(inner)
        else:
            assert field.description and any(isinstance(item, FieldLimits) for item in field.metadata), (model, key)
            assert limits_of(field).low < limits_of(field).high

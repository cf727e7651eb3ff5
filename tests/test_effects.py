"""The promise of bemt.effects: one file each, found by scanning, documented, and gone without trace when off."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from bemt import duct as duct_model
from bemt import effects, evaluate, solver
from bemt.air import Air
from bemt.case import load_case
from bemt.effects.base import Effect, Parameter
from bemt.errors import InputError
from bemt.polars import Polar
from geometry.airfoil import naca4
from geometry.duct import Stator, around
from geometry.laws import helix
from geometry.rotor import Rotor

CATALOGUE = effects.catalogue()
FOLDER = Path(effects.__file__).parent
HOOKS = ("blade", "inflow", "section", "momentum")
each_effect = pytest.mark.parametrize("name", list(CATALOGUE))


class Trial(NamedTuple):
    """A rotor at operating points; some trial must show every effect."""

    rotor: Rotor
    ducted: bool
    rpm: tuple[float, ...]
    V: tuple[float, ...]


@cache
def trials() -> dict[str, Trial]:
    section = naca4(0.04, 0.4, 0.12)
    propeller = Rotor(helix(0.2032, 0.127, anchors=section), 2)
    steep = Rotor(helix(0.2032, 0.25, anchors=section), 2)
    fan = Rotor(helix(0.069, 0.100, "fan", hub=0.368, anchors=section), 11)
    return {
        "static, cruise, transonic": Trial(propeller, False, (6000.0, 6000.0, 30000.0), (0.0, 8.0, 0.0)),
        "stalled": Trial(steep, False, (6000.0, 6000.0), (0.0, 3.0)),
        "windmill, descent": Trial(propeller, False, (6000.0, 6000.0), (25.0, -6.0)),
        "ducted fan": Trial(fan, True, (40000.0, 40000.0), (0.0, 10.0)),
    }


def solve(trial: Trial, polar: Polar, chosen: Sequence[Effect] | None) -> solver.Solution:
    flow = None
    if trial.ducted:
        duct = around(trial.rotor, 0.06, 0.0004, 0.004, exit_area_ratio=0.95, stator=Stator(5, 0.02))
        flow = duct_model.duct_flow(duct, trial.rotor)
    prep = solver.prepare(trial.rotor, [(0.7, polar)], chosen, flow, n_stations=20)
    return solver.solve(prep, np.array(trial.rpm), np.array(trial.V), Air.from_density(1.225))


def numbers(s: solver.Solution) -> np.ndarray:
    return np.array([s.T, s.Q, s.T_rotor, s.T_duct, s.T_stator, s.V_exit])


def everything() -> tuple[Effect, ...]:
    return tuple(cls() for cls in CATALOGUE.values())


def test_the_catalogue_is_the_folder() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")} - {"__init__", "base"}
    assert set(CATALOGUE) == files
    orders = [cls.order for cls in CATALOGUE.values()]
    assert orders == sorted(orders)
    assert [e.id for e in effects.standard()] == [name for name, cls in CATALOGUE.items() if cls.on_by_default]


@each_effect
def test_one_file_one_effect_of_its_name(name: str) -> None:
    cls = CATALOGUE[name]
    assert cls.id == name
    assert Path(inspect.getfile(cls)).stem == name
    module = importlib.import_module(cls.__module__)
    here = [o for o in vars(module).values() if isinstance(o, type) and o.__module__ == module.__name__]
    assert [o for o in here if issubclass(o, Effect)] == [cls]
    assert any(hook in vars(cls) for hook in HOOKS), "an effect without a hook does nothing"


@each_effect
def test_parameters_are_the_numeric_fields_and_defaults_are_physical(name: str) -> None:
    cls = CATALOGUE[name]
    effect = cls()
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    numeric = {key for key in fields if isinstance(getattr(effect, key), (int, float))}
    assert {p.name for p in cls.parameters} == numeric, "every number needs a range and a source"
    assert len(cls.parameters) == len(numeric)
    for p in cls.parameters:
        assert isinstance(p, Parameter) and p.unit and p.source
        assert np.isfinite([p.low, p.high]).all() and p.low < p.high
        assert p.low <= getattr(effect, p.name) <= p.high, f"{p.name}: default outside its own range"
    assert effect.describe() == {"id": name, **dataclasses.asdict(effect)}


@each_effect
def test_an_effect_is_a_frozen_value(name: str) -> None:
    cls = CATALOGUE[name]
    a, b = cls(), cls()
    assert a == b and hash(a) == hash(b)
    field = next(iter(a.__dataclass_fields__), "id")  # type: ignore[attr-defined]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(a, field, 2.0)
    for p in cls.parameters:
        changed = dataclasses.replace(a, **{p.name: p.low})  # type: ignore[type-var]
        assert (changed == a) is (p.low == getattr(a, p.name))


@each_effect
def test_an_effect_says_where_it_comes_from(name: str) -> None:
    doc = inspect.getdoc(CATALOGUE[name]) or ""
    assert CATALOGUE[name].title
    _, heading, notes = doc.partition("\nNotes\n-----\n")
    assert heading, "no Notes section"
    assert re.search(r"\b(18|19|20)\d\d\b|\bdeclared\b", notes), "neither a source with its year nor a declared rule"


@each_effect
def test_on_changes_something(name: str, polar: Polar) -> None:
    rest = effects.without(everything(), [name])
    shown = []
    for label, trial in trials().items():
        change = numbers(solve(trial, polar, everything())) - numbers(solve(trial, polar, rest))
        if np.any(np.isfinite(change) & (change != 0.0)):
            shown.append(label)
    assert shown, "solve(with) equals solve(without) in every trial"


@each_effect
@pytest.mark.parametrize("label", list(trials()))
def test_off_is_the_baseline_to_the_bit(name: str, label: str, polar: Polar) -> None:
    trial, rest = trials()[label], effects.without(everything(), [name])
    blade_before, polar_before = trial.rotor.key(), polar.key
    baseline = numbers(solve(trial, polar, rest))
    solve(trial, polar, everything())
    assert np.array_equal(numbers(solve(trial, polar, rest)), baseline, equal_nan=True)
    # the whole set less one is the set without it, and no hook has written into the rotor or the tables
    listed = tuple(cls() for key, cls in CATALOGUE.items() if key != name)
    assert np.array_equal(numbers(solve(trial, polar, listed)), baseline, equal_nan=True)
    assert trial.rotor.key() == blade_before
    assert dataclasses.replace(polar).key == polar_before


@each_effect
def test_a_case_switches_an_effect(name: str, project: Path) -> None:
    case = load_case(project / "cases" / "prop_8x5" / "case.toml")

    def ids(key: str) -> list[str]:
        return [e.id for e in evaluate.prepare(case, {key: [name], "model.stations": 10}).prep.effects]

    assert name in ids("model.effects_on") and name not in ids("model.effects_off")
    assert {*ids("model.effects_off"), name} == {*ids("model.effects_on")}


def test_effects_that_must_not_act_do_not(polar: Polar) -> None:
    def acts(name: str, label: str, point: int) -> bool:
        trial = trials()[label]
        trial = trial._replace(rpm=trial.rpm[point : point + 1], V=trial.V[point : point + 1])
        rest = effects.without(everything(), [name])
        off, on = numbers(solve(trial, polar, rest)), numbers(solve(trial, polar, everything()))
        assert np.isfinite(off[:2]).all() and np.isfinite(on[:2]).all()
        return not np.array_equal(off, on, equal_nan=True)

    for point in range(3):
        assert not acts("tip_gap", "static, cruise, transonic", point), "an open rotor has no gap"
    assert acts("tip_gap", "ducted fan", 0)
    for point in range(2):
        assert not acts("high_induction", "static, cruise, transonic", point), "a working propeller is not a windmill"
    assert acts("high_induction", "windmill, descent", 1)
    assert acts("drag_divergence", "static, cruise, transonic", 2)
    assert not acts("drag_divergence", "static, cruise, transonic", 0), "tip Mach 0.19"


def test_unknown_effects_are_refused(project: Path) -> None:
    with pytest.raises(ValueError, match=r"unknown effect tiploss; known: .*tip_loss"):
        effects.without(effects.standard(), ["tiploss"])
    case = load_case(project / "cases" / "prop_8x5" / "case.toml")
    with pytest.raises(InputError, match=r"'tiploss'; expected one of .*Did you mean tip_loss\?"):
        evaluate.prepare(case, {"model.effects_off": ["tiploss"]})


NEW = '''
from dataclasses import dataclass

from bemt.effects.base import Baking, Effect, Parameter


@dataclass(frozen=True)
class {cls}(Effect):
    """Made up for a test."""

    factor: float = 1.25

    id = "{id}"
    title = "made up"
    parameters = (Parameter("factor", "1", 1.0, 1.5, "made up"),)

    def section(self, bake: Baking) -> None:
        bake.cd *= self.factor
'''


@pytest.fixture
def extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A second folder of the package bemt.effects."""
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    effects.catalogue.cache_clear()
    yield tmp_path
    monkeypatch.undo()
    effects.catalogue.cache_clear()
    for path in tmp_path.glob("*.py"):
        sys.modules.pop(f"bemt.effects.{path.stem}", None)


def test_a_new_effect_is_one_new_file(extra: Path, polar: Polar) -> None:
    (extra / "made_up.py").write_text(NEW.format(cls="MadeUp", id="made_up"))
    assert set(effects.catalogue()) == {*CATALOGUE, "made_up"}
    assert "made_up" in [e.id for e in effects.standard()]
    trial = trials()["static, cruise, transonic"]
    off = solve(trial, polar, effects.without(effects.standard(), ["made_up"]))
    on = solve(trial, polar, None)
    assert np.all(on.Q > off.Q)


def test_the_catalogue_forgets_the_new_effect() -> None:
    assert effects.catalogue() == CATALOGUE


def test_two_effects_of_one_id_are_refused(extra: Path) -> None:
    (extra / "made_up_twice.py").write_text(NEW.format(cls="Twice", id="swirl"))
    with pytest.raises(ValueError, match="two effects share the id 'swirl'"):
        effects.catalogue()

"""Effects: one file each, documented, listed, without trace when off."""

from __future__ import annotations

import dataclasses
import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import effects_page
import numpy as np
import pytest

from bemt.app import cli
from bemt.base.errors import InputError
from bemt.physics import effects
from bemt.physics.air import Air
from bemt.physics.bem import duct as duct_model
from bemt.physics.bem import kernel as K
from bemt.physics.bem import model as bem
from bemt.physics.bem import solver
from bemt.physics.effects.base import Array, Effect, Flow, Parameter, Reading, RotorBuild
from bemt.physics.sections.polars import ExtrapolatedTable, Polar, from_tables
from bemt.results.report import effects_list
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case
from geometry.airfoil import naca4
from geometry.duct import Stator, around
from geometry.laws import helix
from geometry.rotor import Rotor

CATALOGUE = effects.catalogue()
FOLDER = Path(effects.__file__).parent
HOOKS = ("blade", "inflow", "section", "momentum", "duct", "flow", "loads", "reading")
# Effects without a value of their parameters that is the same as not having them.
NO_OFF = {
    "cascade", "drag_divergence", "duct", "flapping", "high_induction", "hub_loss", "mounted_backwards", "post_stall",
    "reynolds", "swirl", "tip_gap", "tip_loss",
}  # fmt: skip
AIR = Air.from_density(1.225)
each_effect = pytest.mark.parametrize("name", list(CATALOGUE))


class Trial(NamedTuple):
    """A rotor at recorded points; some trial must show every effect."""

    rotor: Rotor
    ducted: bool
    rpm: tuple[float, ...]
    V: tuple[float, ...]
    extra: Mapping[str, tuple[float, ...]] = {}


RAMP = tuple(float(x) for x in np.linspace(5000.0, 9000.0, 9))
TRANSIENT = {
    "time_s": tuple(0.02 * i for i in range(9)), "pwm_s": tuple(1e-3 + 1e-4 * i for i in range(9)),
    "temperature_K": tuple(293.0 + i for i in range(9)),
}  # fmt: skip
SLOW = {"time_s": (0.0, 60.0, 600.0), "run": (1.0, 1.0, 1.0), "temperature_K": (293.0, 293.0, 299.0)}


@cache
def trials() -> dict[str, Trial]:
    section = naca4(0.04, 0.4, 0.12)
    propeller = Rotor(helix(0.2032, 0.127, hub=0.1, anchors=section), 2)
    steep = Rotor(helix(0.2032, 0.25, anchors=section), 2)
    fan = Rotor(helix(0.069, 0.100, "fan", hub=0.368, anchors=section), 11)
    return {
        "static, cruise, transonic": Trial(propeller, False, (6000.0, 6000.0, 30000.0), (0.0, 8.0, 0.0), SLOW),
        "stalled": Trial(steep, False, (6000.0, 6000.0), (0.0, 3.0)),
        "windmill, descent": Trial(propeller, False, (6000.0, 6000.0), (25.0, -6.0)),
        "ducted fan": Trial(fan, True, (40000.0, 30000.0, 40000.0), (0.0, 0.0, 10.0)),
        "transient": Trial(propeller, False, RAMP, (0.0,) * 9, TRANSIENT),
    }


@cache
def section_table() -> Polar:
    """The closed form of conftest at two Reynolds numbers."""
    alpha = np.radians(np.arange(-20.0, 25.5, 0.5))
    cl = np.clip(5.9 * (alpha + np.radians(4.0)), -0.9, 1.3)
    cl = cl - 0.8 * np.clip(np.abs(alpha) - np.radians(13.0), 0.0, None)
    tables = [ExtrapolatedTable(alpha, cl * k, (0.012 + 0.008 * cl**2) / k, Re) for Re, k in ((3e4, 0.9), (3e5, 1.05))]
    return from_tables(tables, name="closed form", source="made for tests")


def model(label: str) -> bem.Model:
    trial, duct = trials()[label], None
    if trial.ducted:
        shape = around(trial.rotor, 0.06, 0.0004, 0.004, exit_area_ratio=0.95, stator=Stator(5, 0.02))
        duct = duct_model.duct_flow(shape, trial.rotor)
    return bem.Model(trial.rotor, [(0.7, section_table())], duct, 12)


@cache
def kept(label: str) -> tuple[bem.Model, Flow]:
    trial, ours = trials()[label], model(label)
    extra = {k: np.array(v) for k, v in trial.extra.items()}
    base = ours.prepared(effects.standard())
    return ours, bem.flow_of(base, trial.rpm, trial.V, Air.from_density(1.225), extra)


def readings(label: str, chosen: Sequence[Effect], ours: bem.Model | None = None) -> np.ndarray:
    """Thrust, torque, duct thrust and what the instruments show, (6, P)."""
    cached, flow = kept(label)
    loads, met, ok = bem.respond((ours or cached).prepared, chosen, flow)
    nan = np.where(ok, 1.0, np.nan)
    shown = Reading({"thrust_N": loads.T * nan, "torque_Nm": loads.Q * nan, "rpm": flow.rpm.copy()},
                    {"thrust_N": 1.0, "torque_Nm": 0.1, "rpm": 9000.0})  # fmt: skip
    for e in chosen:
        e.reading(shown, met)
    return np.array([loads.T * nan, loads.Q * nan, loads.T_duct * nan, *shown.values.values()])


def rest(name: str) -> tuple[Effect, ...]:
    return effects.without(effects.standard(), [name])


def with_(effect: Effect) -> tuple[Effect, ...]:
    return (*rest(effect.id), effect)


def test_the_catalogue_is_the_folder() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")} - {"__init__", "base"}
    assert {Path(inspect.getfile(cls)).stem for cls in CATALOGUE.values()} == files
    orders = [cls.order for cls in CATALOGUE.values()]
    assert orders == sorted(orders)
    assert [e.id for e in effects.standard()] == [name for name, cls in CATALOGUE.items() if cls.on_by_default]


@each_effect
def test_an_effect_stands_in_the_file_of_its_name_and_has_a_hook(name: str) -> None:
    cls = CATALOGUE[name]
    assert cls.id == name
    stem = Path(inspect.getfile(cls)).stem
    assert name == stem or (name.endswith(f"_{stem}") and cls.fault == stem), "alone, or one channel of a stand fault"
    assert any(getattr(cls, hook) is not getattr(Effect, hook) for hook in HOOKS), "without a hook it does nothing"


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
    assert effect.describe() == {"id": name, **dataclasses.asdict(effect)}  # type: ignore[call-overload]


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
def test_an_effect_speaks_to_an_engineer(name: str) -> None:
    cls = CATALOGUE[name]
    assert cls.kind in ("air", "stand", "drive")
    assert len(cls.sign) > 20 and cls.sign[0].islower() and not cls.sign.endswith(".")
    known = {"time_s", "temperature_K", "pressure_Pa", "voltage_V", "current_A", "pwm_s", "tip_gap_m", "sideslip_rad"}
    assert set(cls.needs) <= known | {"wall_distance_m", "run"}
    needy = Trial(trials()["stalled"].rotor, False, (6000.0,), (5.0,))
    flow = dataclasses.replace(kept("stalled")[1], V=np.array(needy.V * 2))
    if cls.needs:
        assert all(need in cls().applies(flow) for need in cls.needs)
    else:
        assert isinstance(cls().applies(flow), str)


@each_effect
def test_settings_that_a_diagnosis_tries_are_lawful(name: str) -> None:
    cls = CATALOGUE[name]
    given = cls().variants()
    if given is None:
        assert all(p.steps >= 0 for p in cls.parameters)
        return
    ranges = {p.name: p for p in cls.parameters}
    made = [cls(**v) for v in given]
    assert len(set(made)) == len(given) > 1, "a setting twice"
    for v, e in zip(given, made, strict=True):
        assert all(ranges[k].low <= x <= ranges[k].high for k, x in v.items() if k in ranges)
        assert effects.from_text(effects.to_text(e)) == e
    words = {f.name for f in dataclasses.fields(cls)} - set(ranges)  # type: ignore[arg-type]
    for word in words & {"form", "channel"}:
        assert len({v[word] for v in given}) > 1, "one form needs no choice"
        with pytest.raises(ValueError, match=f"{word}='none of them'; expected"):
            cls(**{word: "none of them"})


@each_effect
def test_on_changes_something(name: str) -> None:
    if name == "flapping":
        pytest.skip("acts in wind from the side only: tests/test_oblique.py")
    shown = []
    for label in trials():
        change = readings(label, with_(CATALOGUE[name]())) - readings(label, rest(name))
        if np.any(np.isfinite(change) & (change != 0.0)):
            shown.append(label)
    assert shown, "solve(with) equals solve(without) in every trial"


@each_effect
@pytest.mark.parametrize("label", list(trials()))
def test_off_is_the_baseline_to_the_bit(name: str, label: str) -> None:
    trial = trials()[label]
    blade_before, polar_before = trial.rotor.key(), section_table().key
    recorded = dataclasses.replace(kept(label)[1])
    arrays = {
        f.name: np.copy(v)
        for f in dataclasses.fields(recorded)
        if isinstance(v := getattr(recorded, f.name), np.ndarray)
    }
    baseline = readings(label, rest(name))
    readings(label, with_(CATALOGUE[name]()))
    again = model(label) if bem.acts_on_rotor(CATALOGUE[name]()) else None
    assert np.array_equal(readings(label, rest(name), again), baseline, equal_nan=True)
    # no hook has written into the rotor, the tables or the recording
    assert trial.rotor.key() == blade_before
    assert dataclasses.replace(section_table()).key == polar_before
    assert all(np.array_equal(getattr(recorded, k), v, equal_nan=True) for k, v in arrays.items())


@each_effect
@pytest.mark.parametrize("label", list(trials()))
def test_at_its_off_value_an_effect_is_nothing(name: str, label: str) -> None:
    off = {p.name: p.off for p in CATALOGUE[name].parameters if p.off is not None}
    if not off:
        assert name in NO_OFF, "say at which value it does nothing, or list it here"
        return
    nothing = dataclasses.replace(CATALOGUE[name](), **off)  # type: ignore[type-var]
    np.testing.assert_allclose(readings(label, with_(nothing)), readings(label, rest(name)), rtol=1e-12, atol=0.0)


@each_effect
def test_a_case_switches_an_effect(name: str, project: Path) -> None:
    case = load_case(project / "cases" / "prop_8x5" / "case.toml")

    def ids(key: str) -> list[str]:
        return [e.id for e in prepare_case(case, {key: [name], "model.stations": 10}).effects]

    assert name in ids("model.effects_on") and name not in ids("model.effects_off")
    assert {*ids("model.effects_off"), name} == {*ids("model.effects_on")}


def test_effects_that_must_not_act_do_not() -> None:
    def acts(name: str, label: str) -> list[bool]:
        off, on = readings(label, rest(name)), readings(label, with_(CATALOGUE[name]()))
        assert np.isfinite(off[:2]).all() and np.isfinite(on[:2]).all()
        return [bool(b) for b in np.any(off != on, axis=0)]

    prop = "static, cruise, transonic"
    assert acts("tip_gap", prop) == [False] * 3, "an open rotor has no gap"
    assert all(acts("tip_gap", "ducted fan"))
    assert acts("high_induction", prop) == [False] * 3, "a working propeller is not a windmill"
    assert acts("high_induction", "windmill, descent")[1]
    assert acts("drag_divergence", prop) == [False, False, True], "tip Mach 0.19, 0.19, 0.94"
    for name in ("nacelle", "tunnel_blockage", "oblique_inflow", "airspeed_offset"):
        assert acts(name, prop) == [False, True, False], "nothing without airspeed"
    assert acts("lip_separation", prop) == [False] * 3
    for name in ("rotor_inertia", "inflow_lag"):
        assert acts(name, prop) == [False] * 3, "minutes are no transient"


def test_unknown_effects_are_refused(project: Path) -> None:
    with pytest.raises(ValueError, match=r"unknown effect tiploss; known: .*tip_loss"):
        effects.without(effects.standard(), ["tiploss"])
    case = load_case(project / "cases" / "prop_8x5" / "case.toml")
    with pytest.raises(InputError, match=r"'tiploss'; expected one of .*Did you mean tip_loss\?"):
        prepare_case(case, {"model.effects_off": ["tiploss"]})
    with pytest.raises(InputError, match=r"effects_on\[1\]: got 'swirl\(\)' after 'swirl'; expected each effect once"):
        prepare_case(case, {"model.effects_on": ["swirl()", "swirl()"]})


@dataclasses.dataclass(frozen=True)
class Inflow(Effect):
    """Factors and increments on both onset speeds, for the tests of the hook."""

    fx: float = 1.0
    fy: float = 1.0
    dx: float = 0.0
    dy: float = 0.0
    id = "inflow_by_hand"

    def inflow(self, bake: RotorBuild) -> None:
        """Change the onset speeds."""
        bake.Vx_factor, bake.Vx_add = bake.Vx_factor * self.fx, bake.Vx_add + self.dx
        bake.Vy_factor, bake.Vy_add = bake.Vy_factor * self.fy, bake.Vy_add + self.dy


def test_inflow_scales_and_adds_to_the_onset_speeds() -> None:
    rotor, n, V = trials()["static, cruise, transonic"].rotor, np.array([6000.0, 7000.0]), np.array([4.0, 9.0])

    def loads(effect: Inflow, rpm: Array, speed: Array) -> Array:
        prep = solver.prepare(rotor, [(0.7, section_table())], (*effects.standard(), effect))
        found = solver.solve(prep, rpm, speed, AIR)
        return np.stack([found.T, found.Q])

    plain = Inflow()
    np.testing.assert_allclose(loads(Inflow(fx=0.8, dx=1.5), n, V), loads(plain, n, 0.8 * V + 1.5), rtol=1e-10)
    np.testing.assert_allclose(loads(Inflow(fy=0.9), n, V), loads(plain, 0.9 * n, V), rtol=1e-10)
    assert np.all(loads(Inflow(dy=5.0), n, V) > loads(plain, n, V))


def test_a_nacelle_slows_the_root_most() -> None:
    rotor = trials()["static, cruise, transonic"].rotor
    prep = [solver.prepare(rotor, [(0.7, section_table())], e) for e in ((), (effects.catalogue()["nacelle"](),))]
    free, behind = (solver.solve(p, 6000.0, 8.0, AIR, radial=True) for p in prep)
    lost = free.radial.w[0] - behind.radial.w[0]
    assert np.all(np.diff(8.0 * (1.0 - prep[1].st[:, K.S_AXIAL_FACTOR])) < 0.0), "the deficit falls outboard"
    assert lost[0] > 5.0 * lost[-2] and behind.T > free.T


@dataclasses.dataclass(frozen=True)
class Mistyped(Effect):
    """Sets a number that the kernel does not have."""

    id = "mistyped"

    def momentum(self, bake: RotorBuild) -> None:
        """Mistype."""
        bake.num.tipp = 1.0  # type: ignore[attr-defined]


def test_a_mistyped_kernel_number_is_refused() -> None:
    with pytest.raises(AttributeError, match="tipp"):
        solver.prepare(trials()["stalled"].rotor, [(0.7, section_table())], (*effects.standard(), Mistyped()))


NEW = '''
from dataclasses import dataclass

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class {cls}(Effect):
    """Made up for a test.

    Notes
    -----
    Declared here.
    """

    factor: float = 1.25
    form: str = "round"

    id = "{id}"
    title = "made up for a test"
    sign = "nobody has ever seen it"
    parameters = (Parameter("factor", "furlong", 1.0, 1.5, "nobody"),)

    def section(self, bake: RotorBuild) -> None:
        """More drag."""
        bake.cd *= self.factor

    def variants(self):
        return ({{"form": "round"}}, {{"form": "square"}})
'''


@pytest.fixture
def extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A second folder of the package bemt.physics.effects."""
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    effects.catalogue.cache_clear()
    yield tmp_path
    monkeypatch.undo()
    effects.catalogue.cache_clear()
    for path in tmp_path.glob("*.py"):
        sys.modules.pop(f"bemt.physics.effects.{path.stem}", None)


def test_a_new_effect_is_one_new_file_that_every_list_shows(extra: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (extra / "made_up.py").write_text(NEW.format(cls="MadeUp", id="made_up"))
    assert set(effects.catalogue()) == {*CATALOGUE, "made_up"}
    assert "made_up" in [e.id for e in effects.standard()]
    label = "static, cruise, transonic"
    off, on = readings(label, rest("made_up")), readings(label, effects.standard())
    assert np.all(on[1] > off[1])
    page = effects_page.page()
    assert "### made_up" in page and "* `factor` 1.25 (1 to 1.5 furlong: nobody" in " ".join(page.split())
    assert "* `form` `round`, `square`" in page
    assert "made up for a test" in printed(capsys)
    (ours,) = [e for e in effects_list.document()["effects"] if e["id"] == "made_up"]
    assert ours["choices"] == {"form": ["round", "square"]} and ours["kind"] == "air"


def test_several_effects_of_one_file(extra: Path) -> None:
    (extra / "both.py").write_text(
        NEW.format(cls="Common", id="")
        + "\n".join(f"class {n.title()}(Common):\n    id = {n!r}\n" for n in ("this", "that"))
    )
    assert set(effects.catalogue()) == {*CATALOGUE, "this", "that"}
    assert vars(effects.from_text("this(factor=1.5)")) == {"factor": 1.5, "form": "round"}


@pytest.mark.parametrize("name", ["", "swirl"])
def test_an_effect_without_an_id_of_its_own_is_refused(extra: Path, name: str) -> None:
    (extra / "made_up.py").write_text(NEW.format(cls="MadeUp", id=name))
    with pytest.raises(ValueError, match=f"MadeUp: id '{name}' is empty or taken"):
        effects.catalogue()


# The promise of ``bemt effects``: the catalogue and nothing else, in every form it is printed.


def printed(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    assert cli.main(["effects", *options]) == 0
    return capsys.readouterr().out


def test_the_page_is_what_its_script_writes(project: Path) -> None:
    page = (project / "docs" / "effects.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^### (\S+)$", page, flags=re.M))  # a new effect may wait for the next edition
    assert len(named) > 30
    assert page == effects_page.page(named), "run python docs/effects_page.py"


def test_every_effect_is_in_every_form(capsys: pytest.CaptureFixture[str]) -> None:
    table, page = printed(capsys), effects_page.page()
    document = json.loads(printed(capsys, "--json"))
    assert document["schema"] == "bemt.effects/1"
    by_id = {e["id"]: e for e in document["effects"]}
    assert len(by_id) == len(document["effects"]) and set(by_id) == set(effects.catalogue())
    for name, cls in effects.catalogue().items():
        assert any(line.split()[:1] == [name] for line in table.splitlines())
        assert f"### {name}\n" in page and cls.title[1:] in " ".join(page.split())
        given = by_id[name]["parameters"]
        assert [(p["name"], p["unit"]) for p in given] == [(p.name, p.unit) for p in cls.parameters]
        ends = [(p["low"], p["high"]) for p in given]
        assert ends == [pytest.approx((p.low, p.high), rel=1e-9) for p in cls.parameters]
        flat = " ".join(page.split())
        assert all(f"* `{p.name}` " in page and " ".join(p.source.split()) in flat for p in cls.parameters)
        assert by_id[name]["source"], "no Notes"

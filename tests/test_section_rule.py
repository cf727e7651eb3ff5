"""The section rule against others: what volume 1 can choose."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt.physics import bem
from bemt.physics.effects import catalogue, standard
from bemt.physics.sections import neuralfoil
from bemt.physics.sections import rule as section_rule
from bemt.physics.sections.neuralfoil import tunnel_polar
from bemt.physics.sections.polars import DEFAULT_RE, Polar
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.validate.propellers import validate
from geometry.airfoil import Airfoil, naca
from geometry.laws import helix
from geometry.rotor import Rotor

# What volume 2 is asked for: median and 90th percentile of the error of static CT.
MEDIAN, P90 = 0.06, 0.20


def _draw(rng: np.random.Generator) -> dict[str, float]:
    ranges: dict[str, tuple[float, ...]] = {
        "n_crit": (2, 3, 4, 5), "lift_floor": (0, 0.3, 0.5), "stall_delay": (2, 3, 4, 5),
        "lifting_surface": (0, 0, 0.5, 1), "camber": (-0.01, -0.005, 0, 0.005, 0.01),
        "thickness": (0.05, 0.06, 0.075, 0.09, 0.11), "position": (0.3, 0.4, 0.5, 0.6),
        "drag": (1, 1.1, 1.2), "normal": (0, 1),
    }  # fmt: skip
    return {name: float(rng.choice(values)) for name, values in ranges.items()}


def _install(monkeypatch: pytest.MonkeyPatch, rule: dict[str, float]) -> tuple[Any, ...]:
    """Put a rule in the place of the declared one; returns the effects to go with it."""

    def polar(shape: Airfoil, **_: Any) -> Polar:
        small = tunnel_polar(shape, n_crit=rule["n_crit"], lift_floor=rule["lift_floor"])
        large = tunnel_polar(shape)
        w = np.clip(np.log(DEFAULT_RE / section_rule.SMALL_RE) / np.log(2.0), 0.0, 1.0)[None, :, None]
        cd = (1.0 - w) * small.cd * rule["drag"] + w * large.cd
        return dataclasses.replace(small, cl=(1.0 - w) * small.cl + w * large.cl, cd=cd)

    declared = section_rule.sections

    def sections(family: str | None = None, law: Any = None) -> tuple[section_rule.RuleSection, ...]:
        own = declared(family, law)
        if own[0].shape != "naca4":  # published: no matter of choice
            return own
        new = {"thickness": rule["thickness"], "position": rule["position"]}
        return tuple(dataclasses.replace(s, camber=round(s.camber + rule["camber"], 4), **new) for s in own)

    monkeypatch.setattr(neuralfoil, "neuralfoil_polar", polar)
    monkeypatch.setattr(section_rule, "sections", sections)
    effects = [
        dataclasses.replace(e, coefficient=rule["stall_delay"], normal=rule["normal"]) if e.id == "stall_delay" else e
        for e in standard()
    ]
    if rule["lifting_surface"]:
        effects.append(catalogue()["lifting_surface"](strength=rule["lifting_surface"]))
    return tuple(sorted(effects, key=lambda e: (e.order, e.id)))


def test_the_declared_rule_put_in_its_own_place_changes_nothing(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = sorted((shared_data / "uiuc" / "volume-2").glob("*.txt"))
    names = sorted({"_".join(file.name.split("_")[:2]) for file in files})
    for file in files:  # every third propeller: it holds for each or for none
        if "_".join(file.name.split("_")[:2]) in names[::3]:
            shutil.copy(file, tmp_path)
    declared = validate(tmp_path).document()
    rule = {"n_crit": section_rule.N_CRIT, "lift_floor": 0.0, "stall_delay": 3.0, "lifting_surface": 0.0, "camber": 0.0,
            "thickness": 0.09, "position": 0.4, "drag": section_rule.DRAG_LEVEL, "normal": 1.0}  # fmt: skip
    same = validate(tmp_path, _install(monkeypatch, rule)).document()
    for kind in ("static", "forward"):
        assert same[kind] == declared[kind]


@pytest.fixture(scope="module")
def drawn(shared_data: Path) -> np.ndarray:
    """Static CT of 24 random rules: median error on volume 1, median and 90th percentile on volume 2, (3, 24)."""
    rng = np.random.default_rng(20261122)
    static: list[list[float]] = []
    for rule in (_draw(rng) for _ in range(24)):
        with pytest.MonkeyPatch.context() as patch:
            effects = _install(patch, rule)
            docs = [validate(shared_data / "uiuc" / f"volume-{v}", effects).document() for v in (1, 2)]
        static.append(
            [docs[0]["static"]["CT"]["median_abs"], *(docs[1]["static"]["CT"][k] for k in ("median_abs", "p90_abs"))]
        )
    return np.array(static).T


@pytest.mark.slow
def test_no_rule_drawn_at_random_meets_the_aims_on_volume_2(drawn: np.ndarray) -> None:
    """Held out means that volume 1 chooses; no rule meets both aims on volume 2."""
    _, median, p90 = drawn
    assert not np.any((median <= MEDIAN) & (p90 <= P90))


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="since rotors have a population some rules meet one aim of the two")
def test_no_rule_drawn_at_random_meets_either_aim_on_volume_2(drawn: np.ndarray) -> None:
    first, median, p90 = drawn
    assert np.all((median > MEDIAN) & (p90 > P90))
    assert np.min(median[np.argsort(first)[:6]]) > MEDIAN + 0.005


CASE = """
schema = "bemt.case/1"
name = "as_scripted"
[rotor]
kind = "propeller"
blades = 2
diameter_in = 8
hub_ratio = 0.15
[blade]
pitch_in = 5
chord_law = "apc_like"
[blade.section]
naca = "4412"
[operating]
rpm = 5000
airspeed_m_s = 0
[air]
density_kg_m3 = 1.225
"""


def test_a_script_gives_the_thrust_of_the_case(tmp_path: Path) -> None:
    """The example of the README and a case of the same propeller: one section table, the rule's."""
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    case = load_case(path)
    rotor = Rotor(helix(0.2032, 0.127, anchors=naca("4412")), B=2)
    found = bem.solve(rotor, rpm=5000.0, air=case.air())
    wanted = prepare_case(case).solve(5000.0, 0.0, case.air())
    assert found.kind == wanted.kind == "bemt" and found.values.keys() == wanted.values.keys()
    for channel in ("thrust_N", "torque_Nm", "CT", "Re75"):
        assert found[channel] == pytest.approx(wanted[channel], rel=1e-9)

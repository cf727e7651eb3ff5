"""What is kept between calls is never stale, never without bound, and changes no number; so with large batches."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.base.cache import Kept
from bemt.physics.bem import model as bem
from bemt.physics.effects.compressibility import Compressibility
from bemt.physics.effects.swirl import Swirl
from bemt.rotors.case import lattice
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import propagate


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> Kept[bem.solver.Prepared]:
    kept: Kept[bem.solver.Prepared] = Kept(256e6, bem.PREPARED._size)
    monkeypatch.setattr(bem, "PREPARED", kept)
    return kept


def test_equal_rotors_are_prepared_once_and_changed_ones_anew(fresh: Kept[bem.solver.Prepared]) -> None:
    case = bemt.propeller("10x5").case
    one = prepare_case(case)
    again = prepare_case(bemt.propeller("10x5").case)
    assert one is not again and one.prep is again.prep and fresh.made == 1
    blade = one.rotor.blade
    others = [
        dataclasses.replace(one, rotor=dataclasses.replace(one.rotor, blade=dataclasses.replace(blade, **change)))
        for change in (
            {"chord": blade.chord * (1.0 + 1e-12)},
            {"beta": blade.beta + 1e-12},
            {"Rhub": blade.Rhub * 0.999},
        )
    ]
    others += [dataclasses.replace(one, rotor=dataclasses.replace(one.rotor, B=3))]
    others += [dataclasses.replace(one, n_stations=41), dataclasses.replace(one, mach_max=0.6)]
    others += [one.with_effects([e for e in one.effects if not isinstance(e, Swirl)])]
    slower = Compressibility(amplitude=0.9)
    others += [one.with_effects([slower if e.id == slower.id else e for e in one.effects])]
    x, polar = one.polars[0]
    others += [dataclasses.replace(one, polars=[(x, dataclasses.replace(polar, cd=polar.cd * (1.0 + 1e-12)))])]
    made = {id(m.prep) for m in (one, *others)}
    assert len(made) == 1 + len(others)
    assert one.at_speeds(3000.0, 0.0, case.air()).prep is not one.prep


def test_a_kept_rotor_gives_the_numbers_of_a_new_one(fresh: Kept[bem.solver.Prepared]) -> None:
    p = bemt.propeller("10x5")
    first, second = (p.solve([4000, 6000], [0.0, 6.0]) for _ in range(2))
    fresh.clear()
    third = bemt.propeller("10x5").solve([4000, 6000], [0.0, 6.0])
    for name in ("thrust_N", "torque_Nm", "CT", "CP"):
        assert np.array_equal(first[name], second[name]) and np.array_equal(first[name], third[name])
        assert np.array_equal(first.u[name], second.u[name]) and np.array_equal(first.u[name], third.u[name])


def test_memory_is_bounded_and_threads_share() -> None:
    kept: Kept[bytes] = Kept(1000, len)
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda i: kept.get(i % 50, lambda: bytes([i % 50]) * 100), range(4000)))
    assert found == [bytes([i % 50]) * 100 for i in range(4000)]
    assert kept.size <= 1000 and len(kept) <= 10
    assert kept.get("large", lambda: bytes(2000)) == bytes(2000) and kept.size <= 1000


def test_a_changed_case_is_not_the_kept_one() -> None:
    case = bemt.propeller("10x5").case
    wide, narrow = (case.replaced({"blade.max_chord_over_R": c}) for c in (0.25, 0.15))
    assert case.replaced({"blade.max_chord_over_R": 0.25}) is wide
    assert prepare_case(wide).solidity > prepare_case(case).solidity > prepare_case(narrow).solidity
    cold = case.replaced({"air.temperature_C": -10.0}) if case.file.air.temperature_C is not None else case
    assert cold.air().rho >= case.air().rho


def test_bands_of_many_points_are_those_of_each() -> None:
    p = bemt.propeller("10x5")
    random = np.random.default_rng(4)
    rpm = np.tile(random.uniform(3000.0, 7000.0, 60), 40)  # enough points in few cells
    V = np.tile(random.uniform(0.0, 0.6, 60), 40) * rpm / 60.0 * p.diameter_m
    found, each = p.solve(rpm, V), propagate(p.case, rpm[:60], V[:60]).points
    assert len(found) > lattice.FEW
    for name in ("thrust_N", "torque_Nm", "power_W", "CT", "CP"):
        np.testing.assert_allclose(found[name][:60], each[name], rtol=1e-9)
        np.testing.assert_allclose(found.u[name][:60], each.u[name], rtol=0.02)
        assert np.array_equal(found.u[name][:60], found.u[name][60:120])
    assert found.flags[:60] == each.flags


def test_a_first_answer_imports_no_statistics_tables_or_figures() -> None:
    code = (
        "import sys, bemt\n"
        'bemt.propeller("10x5").solve(6000)\n'
        'late = {"pandas", "matplotlib", "scipy.optimize", "scipy.interpolate", "scipy.stats", "jinja2"}\n'
        "found = sorted(late & set(sys.modules))\n"
        "assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[1])

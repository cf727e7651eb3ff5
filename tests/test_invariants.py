"""The promise of the invariants: what must not matter does not, to the last bit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.duct import DuctFlow
from bemt.physics.effects import Effect, standard, without
from bemt.physics.sections.polars import Polar, linear_polar
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case
from geometry.laws import helix
from geometry.rotor import Blade, Rotor, from_stations

AIR = Air.from_density(1.2)
FIELDS = ("T", "Q", "P", "CT", "CQ", "CP", "J", "T_rotor", "T_duct", "T_stator", "V_exit", "converged")
DUCT = DuctFlow(0.95, 0.05, 0.2, 0.8, 0.0005, 0.08, 0.01)
# thrust, brake, reversed, resting, fast and slow in one batch
RPM = np.tile([3000.0, 6000.0, 9000.0, 25000.0], 30)
V = np.repeat(np.linspace(-8.0, 30.0, 30), 4)


def same(a: solver.Solution, b: solver.Solution) -> bool:
    return all(np.array_equal(getattr(a, f), getattr(b, f), equal_nan=f != "converged") for f in FIELDS)


@pytest.fixture(scope="module", params=["open", "ducted"])
def ready(request: pytest.FixtureRequest, rotor: Rotor, polar: Polar) -> solver.Prepared:
    return solver.prepare(rotor, [(0.7, polar)], duct=DUCT if request.param == "ducted" else None, n_stations=25)


@pytest.fixture(scope="module")
def batch(ready: solver.Prepared) -> solver.Solution:
    return solver.solve(ready, RPM, V, AIR)


def test_the_batch_is_worth_the_name(batch: solver.Solution) -> None:
    assert batch.converged.all()
    assert (batch.T > 0).sum() > 20
    assert (batch.T < 0).sum() > 20


def test_batch_equals_points_bit_for_bit(ready: solver.Prepared, batch: solver.Solution) -> None:
    for i in range(RPM.size):
        assert solver.solve_point(ready, RPM[i], V[i], AIR) == (batch.T_rotor[i], batch.Q[i], True)
    alone = [solver.solve(ready, n, v, AIR) for n, v in zip(RPM, V, strict=True)]
    assert all(np.array_equal(np.concatenate([getattr(s, f) for s in alone]), getattr(batch, f)) for f in FIELDS)


def test_order_and_company_do_not_matter(ready: solver.Prepared, batch: solver.Solution) -> None:
    shuffled = np.random.default_rng(7).permutation(RPM.size)
    s = solver.solve(ready, RPM[shuffled], V[shuffled], AIR)
    assert all(np.array_equal(getattr(s, f), getattr(batch, f)[shuffled]) for f in FIELDS)
    assert [s.flags[i] for i in np.argsort(shuffled)] == list(batch.flags)


@pytest.mark.parametrize("threads", [2, 3, 8])
def test_threads_do_not_matter(ready: solver.Prepared, batch: solver.Solution, threads: int) -> None:
    s = solver.solve(ready, RPM, V, AIR, threads=threads)
    assert same(s, batch)
    assert s.flags == batch.flags


def test_radial_output_does_not_matter_and_sums_up(ready: solver.Prepared, batch: solver.Solution) -> None:
    s = solver.solve(ready, RPM, V, AIR, radial=True)
    assert same(s, batch)
    assert np.allclose(s.radial.dT.sum(axis=1), s.T_rotor, rtol=1e-12, atol=1e-12 * abs(s.T_rotor).max())
    assert np.allclose(s.radial.dQ.sum(axis=1), s.Q, rtol=1e-12, atol=1e-12 * abs(s.Q).max())


def test_a_second_preparation_is_the_same(ready: solver.Prepared, batch: solver.Solution, polar: Polar) -> None:
    again = solver.prepare(ready.rotor, [(0.7, polar)], ready.effects, ready.duct, n_stations=25)
    assert same(solver.solve(again, RPM, V, AIR), batch)


@pytest.mark.parametrize("case", ["ds30", "prop_8x5"])
@pytest.mark.parametrize("rpm", [300.0, 6000.0, 20000.0, 34000.0])
def test_tables_that_are_not_reached_do_not_matter(project: Path, case: str, rpm: float) -> None:
    model = prepare_case(load_case(project / "cases" / case))
    at = rpm, rpm / 1000.0, AIR
    whole, less = model.solve(*at), model.at_speeds(*at).solve(*at)
    assert np.isfinite(whole.thrust_N).all()
    for channel in ("thrust_N", "torque_Nm"):
        assert getattr(less, channel) == pytest.approx(getattr(whole, channel), rel=1e-9)


def test_direction_of_rotation_does_not_matter(rotor: Rotor, polar: Polar) -> None:
    left = dataclasses.replace(rotor, rotation=-rotor.rotation)
    a, b = (solver.solve(solver.prepare(r, [(0.7, polar)]), RPM, V, AIR) for r in (rotor, left))
    assert same(a, b)


def scaled(blade: Blade, factor: float) -> Blade:
    return from_stations(
        blade.r * factor, blade.chord * factor, blade.beta, blade.R * factor, blade.Rhub * factor, blade.anchors
    )


@pytest.mark.parametrize("duct", [None, DUCT], ids=["open", "ducted"])
@pytest.mark.parametrize("factor", [0.1, 3.7])
def test_similarity_at_equal_tip_speed(rotor: Rotor, polar: Polar, duct: DuctFlow | None, factor: float) -> None:
    """Scale, density and, through the Reynolds number that these tables do not know, viscosity do not matter."""
    large = dataclasses.replace(rotor, blade=scaled(rotor.blade, factor))
    big = duct and dataclasses.replace(duct, gap=duct.gap * factor, drag_area=duct.drag_area * factor**2)
    a = solver.solve(solver.prepare(rotor, [(0.7, polar)], duct=duct), RPM, V, AIR)
    other = dataclasses.replace(AIR, rho=0.3 * AIR.rho, mu=7.0 * AIR.mu)
    b = solver.solve(solver.prepare(large, [(0.7, polar)], duct=big), RPM / factor, V, other)
    assert b.converged.all()
    size = 1e-10 * np.abs(a.CT).max()
    assert np.allclose(b.CT, a.CT, rtol=1e-10, atol=size)
    assert np.allclose(b.CP, a.CP, rtol=1e-10, atol=size)
    assert np.allclose(b.V_exit, a.V_exit, rtol=1e-9, atol=1e-9)
    assert b.flags == a.flags


def test_similarity_at_equal_reynolds_and_mach_numbers(rotor: Rotor) -> None:
    slopes = [linear_polar(a) for a in (4.0, 6.0)]
    ramp = np.linspace(0.0, 1.0, slopes[0].Re.size)[None, :, None]
    cl = slopes[0].cl * (1.0 - ramp) + slopes[1].cl * ramp
    polar = dataclasses.replace(slopes[0], cl=cl, cd=slopes[0].cd + 0.01)
    large = dataclasses.replace(rotor, blade=scaled(rotor.blade, 5.0))
    a = solver.solve(solver.prepare(rotor, [(0.7, polar)]), RPM, V, AIR)
    other = dataclasses.replace(AIR, rho=2.0 * AIR.rho, mu=10.0 * AIR.mu)
    b = solver.solve(solver.prepare(large, [(0.7, polar)]), RPM / 5.0, V, other)
    assert np.allclose(b.CT, a.CT, rtol=1e-10, atol=1e-11)
    assert np.allclose(b.CP, a.CP, rtol=1e-10, atol=1e-11)
    # and the Reynolds number does matter to these tables
    c = solver.solve(solver.prepare(large, [(0.7, polar)]), RPM / 5.0, V, AIR)
    assert np.abs(c.CT / a.CT - 1.0).max() > 0.01


@pytest.mark.parametrize("off", [[], ["swirl"], ["high_induction"], ["tip_loss"], ["hub_loss", "compressibility"]])
def test_mirror_in_the_disk(off: list[str]) -> None:
    """Uncambered blades turned the other way in a stream from the other side push the other way, at the same torque."""
    effects: tuple[Effect, ...] = without(standard(), ["stall_delay", *off])  # stall is delayed on one side only
    polar = linear_polar(cd=0.01)
    blade = helix(0.254, 0.127)
    turned = from_stations(blade.r, blade.chord, -blade.beta, blade.R, blade.Rhub)
    a, b = (solver.prepare(Rotor(x, 3), [(0.7, polar)], effects) for x in (blade, turned))
    V = np.linspace(-5.0, 25.0, 61)
    s, t = solver.solve(a, 5000.0, V, AIR), solver.solve(b, 5000.0, -V, AIR)
    assert s.converged.all()
    # the grid of angles is no mirror image of itself, and separated flow is read between its nodes
    assert np.allclose(t.T, -s.T, rtol=1e-10, atol=1e-5 * np.abs(s.T).max())
    assert np.allclose(t.Q, s.Q, rtol=1e-10, atol=1e-5 * np.abs(s.Q).max())
    assert np.allclose(t.V_exit, -s.V_exit, rtol=1e-9, atol=1e-4)


def test_blade_count_matters_only_through_solidity_without_blade_losses(rotor: Rotor, polar: Polar) -> None:
    effects = without(standard(), ["tip_loss", "hub_loss", "cascade", "stall_delay"])
    blade = rotor.blade
    narrow = from_stations(blade.r, blade.chord / 3.0, blade.beta, blade.R, blade.Rhub, blade.anchors)
    a = solver.solve(solver.prepare(rotor, [(0.7, polar)], effects), RPM, V, AIR)
    b = solver.solve(solver.prepare(Rotor(narrow, 3 * rotor.B), [(0.7, polar)], effects), RPM, V, AIR)
    assert np.allclose(b.CT, a.CT, rtol=1e-10, atol=1e-11)
    assert np.allclose(b.CP, a.CP, rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("duct", [None, DUCT], ids=["open", "ducted"])
def test_no_jumps_over_advance_ratio(rotor: Rotor, polar: Polar, duct: DuctFlow | None) -> None:
    """Attached blades: a step of J a hundred times as fine makes steps of CT and CP a hundred times as small."""
    prep = solver.prepare(rotor, [(0.7, polar)], duct=duct)
    J = np.linspace(-0.05, 1.1, 20001)
    s = solver.solve(prep, 6000.0, J * 100.0 * rotor.D, AIR)
    assert s.converged.all()
    for c in (s.CT, s.CP):
        slope = np.abs(np.diff(c)) / (J[1] - J[0])
        assert slope.max() < 0.6
        assert np.abs(np.diff(c, 2)).max() < 2e-7


@pytest.mark.parametrize("ducted", [False, True])
def test_energy_is_not_made(ducted: bool) -> None:
    """Shaft power covers the work on the flow through the disk at every station, on rotors of all kinds."""
    rng = np.random.default_rng(3)
    for _ in range(12):
        B, pitch, cd = int(rng.integers(2, 9)), rng.uniform(0.3, 1.5), rng.uniform(1e-3, 0.03)
        rotor = Rotor(helix(0.3, 0.3 * pitch, max_chord=rng.uniform(0.1, 0.5)), B)
        duct = DuctFlow(rng.uniform(0.7, 1.3)) if ducted else None
        prep = solver.prepare(rotor, [(0.7, linear_polar(cd=cd))], duct=duct, n_stations=20, mach_max=0.6)
        s = solver.solve(prep, 4000.0, rng.uniform(0.0, 25.0, 40), AIR, radial=True)
        r = s.radial
        UT = 4000.0 * np.pi / 30.0 * r.r
        # on the blade: drag takes energy, lift neither takes nor gives
        dT, dD = r.dT, 0.5 * AIR.rho * r.W**2 * r.cd * prep.st[:, 2] * B * prep.st[:, 1]
        gap = r.dQ / r.r * (UT - r.v_t) - dT * r.w - dD * r.W
        assert np.abs(gap).max() < 1e-9 * np.abs(dD * r.W).max()
        if not ducted:
            area = np.pi * (rotor.R**2 - rotor.Rhub**2)
            push = s.T > 0
            v = -0.5 * s.V + np.sqrt(0.25 * s.V**2 + np.maximum(s.T, 0.0) / (2.0 * AIR.rho * area))
            assert np.all(s.P[push] > (s.T * (s.V + v))[push])

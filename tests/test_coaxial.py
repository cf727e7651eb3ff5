"""Promise: two rotors on one axis keep the limits of theory."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

import bemt
from bemt.base.errors import InputError
from bemt.physics.air import Air
from bemt.physics.bem import coaxial, solver
from bemt.physics.bem import model as bem
from bemt.physics.bem.coaxial import Pair
from bemt.physics.effects import standard, without
from bemt.physics.effects.coaxial_neighbour import CoaxialNeighbour
from bemt.physics.sections.polars import linear_polar
from bemt.physics.wake import ahead, contracted
from bemt.rotors.case.load import with_changes
from bemt.rotors.case.propagate import prepared
from geometry.laws import helix
from geometry.rotor import Rotor, from_stations

Array = NDArray[np.float64]
AIR = Air.from_density()
SLOPE = 5.7  # of the lift curve [1/rad]


def ideal(pitch: float = 0.08, chord: float = 0.03, R: float = 0.5) -> solver.Prepared:
    """A rotor of uniform inflow: constant chord, r tan(beta) constant, no drag, loss or swirl; linear lift."""
    r = np.linspace(0.02 * R, R, 60)
    blade = from_stations(r, np.full(r.size, chord), np.minimum(pitch * R / r, 1.2), R, 0.02 * R)
    return solver.prepare(Rotor(blade, 2), [(0.75, linear_polar(SLOPE))], (), n_stations=120)


def usual(pitch_in: float = 5.0, effects: tuple[bemt.physics.effects.Effect, ...] | None = None) -> solver.Prepared:
    rotor = Rotor(helix(10 * 0.0254, pitch_in * 0.0254), 2)
    return solver.prepare(rotor, [(0.75, linear_polar(cd=0.012))], standard() if effects is None else effects)


def solved(pair: Pair, rpm: float = 5000.0, V: float | Array = 0.0, ratio: float | None = 1.0) -> coaxial.PairSolution:
    speed, n = np.broadcast_arrays(np.atleast_1d(np.asarray(V, dtype=float)), rpm)
    air = (np.full(n.size, value) for value in (AIR.rho, AIR.mu, AIR.a_sound))
    return coaxial.solve(pair, n, None if ratio is None else ratio * n, speed, *air)


@pytest.mark.parametrize(("r", "z"), [(0.3, 0.2), (0.9, 0.4), (1.02, 0.05), (1.8, 1.0)])
def test_the_vortex_cylinder_is_the_sum_of_its_rings(r: float, z: float) -> None:
    def ring(at: float) -> float:
        def part(t: float) -> float:
            return (1.0 - r * math.cos(t)) / (1.0 + r * r - 2.0 * r * math.cos(t) + at * at) ** 1.5

        return quad(part, 0.0, math.pi, limit=200)[0] / (2.0 * math.pi)

    exact = 2.0 * quad(lambda s: ring(z + s), 0.0, np.inf, limit=200)[0]
    assert ahead(r, 1.0, z) == pytest.approx(exact, rel=1e-7)
    assert ahead(1e-7, 1.0, z) == pytest.approx(1.0 - z / math.sqrt(1.0 + z**2), rel=1e-6)


def test_without_interference_both_are_alone() -> None:
    one, two = usual(), usual(6.0)
    found = solved(Pair(one, two, 0.1, interference=0.0), ratio=1.2)
    for part, prep, n in ((found.upper, one, 5000.0), (found.lower, two, 6000.0)):
        alone = solver.solve(prep, n, 0.0, AIR)
        assert part.T[0] == alone.T[0] and part.Q[0] == alone.Q[0]


def test_far_apart_both_are_alone() -> None:
    prep = usual()
    alone = solver.solve(prep, 5000.0, 0.0, AIR)
    ratios = []
    for diameters in (1.0, 30.0, 300.0, 3000.0):
        found = solved(Pair(prep, prep, diameters * prep.D))
        ratios.append((found.upper.T[0] / alone.T[0], found.lower.T[0] / alone.T[0]))
    assert abs(ratios[-1][0] - 1.0) < 1e-6 and abs(ratios[-1][1] - 1.0) < 0.01
    assert ratios[0][1] < ratios[1][1] < ratios[2][1] < ratios[3][1] < 1.0


def test_in_one_plane_equal_thrusts_cost_the_root_of_two() -> None:
    """Leishman 2006, Principles of Helicopter Aerodynamics, sec. 2.15.1: two disks in one plane."""
    prep = ideal()
    alone, found = solver.solve(prep, 3000.0, 0.0, AIR), solved(Pair(prep, prep, 0.0), 3000.0)
    assert found.upper.T[0] == pytest.approx(found.lower.T[0], rel=1e-6)
    ideal_power = alone.P[0] * (found.upper.T[0] / alone.T[0]) ** 1.5
    assert (found.upper.P[0] + found.lower.P[0]) / (2.0 * ideal_power) == pytest.approx(math.sqrt(2.0), rel=2e-3)


def test_the_lower_rotor_in_the_developed_wake_is_that_of_leishman_and_ananthan() -> None:
    """Their inflow of an annulus in a stream, closed form of blade elements and momentum (small angles)."""
    prep = ideal(0.06, chord=0.01)
    sigma = 2 * 0.01 / (math.pi * 0.5)
    k = sigma * SLOPE / 16.0

    def inflow(stream: float) -> float:  # over the tip speed
        return math.sqrt((k - 0.5 * stream) ** 2 + sigma * SLOPE * 0.06 / 8.0) - (k - 0.5 * stream)

    upper = inflow(0.0)
    inside, outside = inflow(2.0 * upper), upper
    edge = math.sqrt(upper / inside)  # where the wake arrives, by continuity
    found = solved(Pair(prep, prep, 4.0, wake_radius=math.sqrt(0.5)), 3000.0)

    def thrust(lam: float, a: float, b: float) -> float:
        return 0.5 * sigma * SLOPE * (0.06 - lam) * 0.5 * (b * b - a * a)  # CT, helicopter convention

    lost = thrust(inside, 0.0, edge) + thrust(outside, edge, 1.0)
    measured = found.lower.T[0] / found.upper.T[0]
    assert measured == pytest.approx(lost / thrust(upper, 0.0, 1.0), rel=0.01)


def test_a_hovering_wake_contracts_as_the_tip_vortex_of_landgrebe() -> None:
    z = np.linspace(0.0, 3.0, 301)
    radius = np.array([contracted(x, np.array([0.008]), 0.08, -12.0, 2)[0] for x in z])
    assert radius[0] == 1.0 and radius[-1] == pytest.approx(0.78, abs=1e-3) and np.all(np.diff(radius) < 0.0)
    # the next blade passes at psi = pi, when the vortex has sunk by 0.25 (0.1 - 0.012) pi
    passage = 0.25 * (0.1 - 0.012) * math.pi
    assert np.interp(passage, z, radius) == pytest.approx(0.78 + 0.22 * math.exp(-0.361 * math.pi), abs=1e-3)
    prep = usual()
    loss = [1.0 - solved(Pair(prep, prep, x * prep.D)).lower.T[0] / solver.solve(prep, 5000.0, 0.0, AIR).T[0]
            for x in (0.0, 0.1, 1.0)]  # fmt: skip
    assert loss[1] - loss[0] > 0.5 * (loss[2] - loss[0]) > 0.0  # most of it within a tenth of a diameter


def test_without_swirl_the_sense_does_not_matter_and_with_it_against_is_better() -> None:
    still = usual(effects=without(standard(), ("swirl",)))
    pairs = [solved(Pair(still, still, 0.08, opposite=way)).lower for way in (True, False)]
    assert pairs[0].T[0] == pairs[1].T[0] and pairs[0].Q[0] == pairs[1].Q[0]
    prep = usual()
    against, along = (solved(Pair(prep, prep, 0.08, opposite=way)).lower.T[0] for way in (True, False))
    none = solved(Pair(prep, prep, 0.08, swirl=0.0)).lower.T[0]
    assert against > 1.02 * none > none > 1.02 * along


def test_in_climb_the_lower_rotor_loses_less() -> None:
    prep = usual()
    V = np.array([0.0, 4.0, 6.0, 8.0, 9.5])
    alone, found = solver.solve(prep, 5000.0, V, AIR), solved(Pair(prep, prep, 0.5 * prep.D), V=V)
    lost = alone.T - found.lower.T
    assert found.converged.all() and np.all(np.diff(lost[1:]) < 0.0) and np.all(lost > 0.0)
    assert lost[-1] < 0.3 * lost[0]


def test_balanced_torques_are_those_of_the_speed_that_is_found() -> None:
    one, two = usual(), usual(7.0)
    found = solved(Pair(one, two, 0.06), ratio=None)
    assert found.lower.Q[0] == pytest.approx(found.upper.Q[0], rel=1e-6)
    again = solved(Pair(one, two, 0.06), ratio=found.lower.rpm[0] / 5000.0)
    assert again.lower.T[0] == pytest.approx(found.lower.T[0], rel=1e-6)
    with pytest.raises(ValueError, match="opposite"):
        solved(Pair(one, two, 0.06, opposite=False), ratio=None)


def test_thrust_does_not_jump_along_the_spacing() -> None:
    prep = usual()
    z = np.concatenate([[0.0], np.geomspace(1e-3, 3.0, 80)])
    found = [solved(Pair(prep, prep, x * prep.D)) for x in z]
    loads = np.array([[one.upper.T[0], one.lower.T[0]] for one in found]) / solver.solve(prep, 5000.0, 0.0, AIR).T[0]
    assert np.isfinite(loads).all()
    assert np.abs(np.diff(loads, axis=0)).max() < 0.02


def test_the_answer_does_not_depend_on_the_stations() -> None:
    rotor = Rotor(helix(0.254, 0.127), 2)
    loads = []
    for n in (20, 40, 80, 160):
        prep = solver.prepare(rotor, [(0.75, linear_polar(cd=0.012))], n_stations=n)
        loads.append(solved(Pair(prep, prep, 0.05)).lower.T[0])
    steps = np.abs(np.diff(loads)) / loads[-1]
    assert steps[-1] < 2e-3 and steps[-1] < steps[0]


def test_any_pair_is_solved_or_flagged() -> None:
    rng = np.random.default_rng(3)
    good = 0
    for _ in range(40):
        one, two = (
            solver.prepare(
                Rotor(helix(D, D * rng.uniform(0.3, 1.1)), int(rng.integers(2, 5))), [(0.75, linear_polar(cd=0.015))],
                n_stations=20,
            )
            for D in 0.25 * rng.uniform(0.7, 1.4, 2)
        )  # fmt: skip
        pair = Pair(
            one, two, rng.uniform(0.0, 0.3), bool(rng.integers(2)), rng.uniform(0.71, 0.9), rng.uniform(0.7, 1.3)
        )
        found = solved(pair, rng.uniform(2000, 9000), rng.uniform(0.0, 25.0, 4), rng.uniform(0.5, 1.6))
        loads = np.array([found.upper.T, found.lower.T, found.upper.Q, found.lower.Q])
        assert np.array_equal(np.isfinite(loads).all(axis=0), found.converged)
        good += int(found.converged.sum())
    assert good >= 0.97 * 160


def test_a_point_does_not_depend_on_its_neighbours() -> None:
    pair = prepared(bemt.propeller("10x5").coaxial(0.2).case)
    rpm, V = np.linspace(2000.0, 9000.0, 12), np.linspace(0.0, 12.0, 12)
    whole = pair.solve(rpm, V, AIR)
    for i in (0, 5, 11):
        one = pair.solve(rpm[i], V[i], AIR)
        for name in (*coaxial.LOADS, *coaxial.RATIOS):
            assert one[name][0] == pytest.approx(whole[name][i], rel=1e-9, abs=1e-9)


def test_the_drag_of_the_mount_takes_from_the_thrust_alone() -> None:
    free, carried = (
        bemt.propeller("10x5").coaxial(0.2).replaced({"second_rotor.mount_drag": share}).solve(6000.0, bands=False)
        for share in (0.0, 0.04)
    )
    taken = free["lower_thrust_N"][0] - carried["lower_thrust_N"][0]
    assert taken == pytest.approx(0.04 * free["upper_thrust_N"][0]) and carried.power_W[0] == free.power_W[0]


def test_descent_is_refused_not_guessed() -> None:
    pair = bemt.propeller("10x5").coaxial(0.2)
    found = prepared(pair.case).solve([5000.0, 5000.0], [-2.0, 0.0], AIR)
    assert np.isnan(found.thrust_N[0]) and "descent" in " ".join(found.flags[0])
    assert np.isfinite(found.thrust_N[1])


def test_a_pair_has_bands_by_origin_and_its_own_unknowns() -> None:
    pair = bemt.propeller("10x5").coaxial(0.3)
    assert {f"second_rotor.{k}" for k in ("wake_radius", "interference", "swirl", "mount_drag")} <= set(pair.unknowns)
    found = pair.solve(rpm=6000.0)
    for name in (*coaxial.LOADS, *coaxial.RATIOS, "thrust_N", "power_W"):
        assert found.u[name][0] > 0.0, name
    assert found.thrust_N[0] == pytest.approx(found["upper_thrust_N"][0] + found["lower_thrust_N"][0], rel=1e-12)
    # most of what is not known of the blades cancels in the ratio
    relative = found.u["lower_thrust_N"][0] / found["lower_thrust_N"][0]
    assert found.u["lower_thrust_ratio"][0] / found["lower_thrust_ratio"][0] < 0.6 * relative
    usual = {"wake_radius": 0.78, "interference": 1.0, "swirl": 1.0, "mount_drag": 0.03}
    known = pair.replaced({f"second_rotor.{key}": value for key, value in usual.items()})
    assert known.solve(rpm=6000.0).u["lower_thrust_ratio"][0] < 0.6 * found.u["lower_thrust_ratio"][0]


def test_a_second_rotor_may_be_another_one(tmp_path: Path) -> None:
    same = bemt.propeller("10x5").coaxial(0.2).solve(6000.0, bands=False)
    by_label = bemt.propeller("10x5").coaxial(0.2, second="10x5").solve(6000.0, bands=False)
    assert by_label["lower_thrust_N"][0] == pytest.approx(same["lower_thrust_N"][0], rel=1e-12)
    file = bemt.propeller("9x4.5").write(tmp_path / "lower")
    pair = bemt.propeller("10x5").coaxial(0.2, second=str(file), rpm_ratio=1.1)
    found = pair.solve(6000.0)
    assert found["lower_rpm"][0] == pytest.approx(6600.0) and found.u["lower_thrust_N"][0] > 0.0
    before = pair.case.content_hash()
    file.write_text(file.read_text(encoding="utf-8").replace("pitch_in = 4.5", "pitch_in = 4.7"), encoding="utf-8")
    assert bemt.propeller("10x5").coaxial(0.2, second=str(file), rpm_ratio=1.1).case.content_hash() != before


@pytest.mark.parametrize(
    ("table", "where"),
    [
        ({}, "second_rotor"),
        ({"z_over_D": 0.2, "spacing_mm": 50.0}, "second_rotor"),
        ({"z_over_D": 0.2, "rpm": 5000.0, "rpm_ratio": 1.0}, "second_rotor.rpm_ratio"),
        ({"z_over_D": 0.2, "torque_balance": True, "turns": "same"}, "second_rotor.torque_balance"),
        ({"spacing_mm": 0.08}, "second_rotor.spacing_mm"),
        ({"z_over_D": 0.2, "label": "10x5", "case": "x"}, "second_rotor.label"),
        ({"z_over_D": 0.2, "label": "ten by five"}, "second_rotor.label"),
        ({"z_over_D": 0.2, "case": "no/such"}, "second_rotor.case"),
    ],
)
def test_a_faulty_second_rotor_is_refused_with_its_key(table: dict[str, object], where: str) -> None:
    with pytest.raises(InputError) as caught:
        with_changes(bemt.propeller("10x5").case, {"second_rotor": table})
    assert where in [fault.where for fault in caught.value.faults]


def test_what_knows_one_rotor_only_refuses_a_pair() -> None:
    pair = bemt.propeller("10x5").coaxial(0.2)
    for ask in (
        lambda: pair.along_blade(5000.0),
        lambda: pair.gradient(5000.0),
        lambda: pair.solve(5000.0, 3.0, angle_deg=30.0),
    ):
        with pytest.raises(InputError):
            ask()
    around = pair.replaced({"model.effects_on": ["coaxial_neighbour"]})
    with pytest.raises(InputError, match="coaxial_neighbour"):
        around.solve(5000.0)


def beside(effect: CoaxialNeighbour, V: float | Array, **extra: Array) -> Array:
    """Thrust with a neighbour over that alone, 15x5 at 5,000 rev/min."""
    model = prepared(bemt.propeller("15x5").case)
    assert isinstance(model, bem.Model)
    flow = bem.flow_of(model.prep, 5000.0, V, AIR, extra)
    found, _, ok = bem.respond(model.prepared, (*model.effects, effect), flow)
    assert ok.all()
    return np.asarray(found.T / flow.T0)


def test_the_effect_of_an_unknown_neighbour_follows_the_solved_pair() -> None:
    base = bemt.propeller("15x5")
    bare = {"second_rotor.swirl": 0.0, "second_rotor.mount_drag": 0.0}
    first = []
    for z in (0.05, 0.2, 0.5, 1.0):
        for V in (0.0, 6.0):
            pair = base.coaxial(z).replaced(bare).solve(5000.0, V, bands=False)
            upper, lower = pair["upper_thrust_ratio"][0], pair["lower_thrust_ratio"][0]
            assert beside(CoaxialNeighbour("downstream", 2 * z, float(lower)), V)[0] == pytest.approx(upper, abs=0.015)
            # one onset speed for the whole disk loses less than the core and its rim apart, by a tenth at most
            found = beside(CoaxialNeighbour("upstream", 2 * z, float(upper)), V)[0]
            assert lower < found < lower + 0.11
            first.append(found)
    assert np.all(np.diff(first[::2]) < 0.0) and np.all(np.diff(first[1::2]) < 0.0)  # the wake contracts


def test_no_neighbour_no_effect_and_little_in_a_fast_wind() -> None:
    V = np.array([0.0, 3.0, 6.0, 9.0])
    for side in ("upstream", "downstream"):
        none = beside(CoaxialNeighbour(side, 0.6, 0.0), V)
        stopped = beside(CoaxialNeighbour(side, 0.6), V, second_rotor_rad_s=np.zeros(4))
        np.testing.assert_allclose([none, stopped], 1.0, rtol=1e-9)
        onset = dict.fromkeys((0.1, 1.0, 4.0), np.zeros(4))
        for z in onset:
            flow = bem.flow_of(bemt.propeller("15x5")._model.prep, 5000.0, V, AIR, {})
            CoaxialNeighbour(side, z).flow(flow)
            onset[z] = flow.V - V
            assert np.all(onset[z] > 0.0) and np.all(np.diff(onset[z]) < 0.0)
    assert np.all(onset[4.0] < 0.1 * onset[0.1])  # a suction fades with the distance


@pytest.mark.slow
def test_measured_pairs_lie_in_the_band_of_their_label(script: Callable[[str], ModuleType], shared_data: Path) -> None:
    """Two propellers at six spacings, as measured (docs/coaxial.md)."""
    page = script("coaxial_spacing")
    folder = shared_data / "contrasts" / "coax_spacing_15in_11in"
    for label, inches, rpm in (("15x5", 15, 5000.0), ("11x5", 11, 6000.0)):
        off, together = [], []
        for z, row in page.measured(folder, inches).items():
            found = bemt.propeller(label).coaxial(z).solve(rpm)
            off.append((found["lower_thrust_ratio"][0] - row[1]) / found.u["lower_thrust_ratio"][0])
            together.append(found["thrust_ratio"][0] - 0.5 * (row[0] + row[1]))
        assert np.abs(off).max() < 2.0 and np.median(np.abs(off)) < 1.0 and np.abs(together).max() < 0.03, label

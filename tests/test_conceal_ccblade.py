"""The promise of the second truth: somebody else's code, the same blade; it says when it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.proof import draw, rigs, truth_ccblade, truth_world
from bemt.proof.items import Bench
from bemt.proof.stand import Stand


@pytest.fixture(scope="module")
def bench() -> Bench:
    rng = np.random.default_rng(4)
    return Bench.draw(rigs.draw_rig("open_0", False, rng, "ccblade"), "grid_shuffled", rng)


def test_two_truths_agree_where_both_hold(bench: Bench) -> None:
    """Vortex rotor and momentum theory share sections only; a lightly loaded rotor is the same to both."""
    pytest.importorskip("wisdem.ccblade.ccblade", reason="optional peer wisdem is not installed")
    theirs, _ = bench.measure(bench.plain(), Stand())
    vortex = Bench(replace(bench.rig, rotor=replace(bench.rig.rotor, code="vortex")), bench.plan, bench.rows)
    ours, _ = vortex.measure(vortex.plain(), Stand())
    J = bench.rows.airspeed / (bench.rows.rpm / 60.0 * 2.0 * bench.rig.rotor.radius)
    assert np.all(np.isnan(theirs.thrust[J == 0.0])) and np.all(np.isfinite(theirs.thrust[J > 0.05]))
    flying = J > 0.15
    assert theirs.thrust[flying] == pytest.approx(ours.thrust[flying], rel=0.06)
    assert theirs.torque[flying] == pytest.approx(ours.torque[flying], rel=0.06)


def test_causes_are_those_it_can_express(bench: Bench) -> None:
    allowed = {c.id for c in bench.allowed()}
    assert allowed <= truth_ccblade.EXPRESSIBLE and {"reynolds", "pitch_offset", "thrust_gain"} <= allowed
    plans = {plan for _, plans in draw.SIZES["ccblade"].plans for plan in plans}
    assert plans <= {"grid_shuffled", "grid_ordered", "two_air"}  # most of their points are in flight


@pytest.mark.parametrize("world", [{"blockage": 0.05}, {"oblique": 20.0}, {"nacelle": 0.4}])
def test_a_flow_that_it_does_not_know_is_refused(bench: Bench, world: dict[str, float]) -> None:
    pytest.importorskip("wisdem.ccblade.ccblade", reason="optional peer wisdem is not installed")
    with pytest.raises(ValueError, match="uniform axial flow"):
        truth_world.loads(bench.rig.rotor, replace(bench.plain(), **world), bench.rows)


def test_without_the_extra_it_says_so(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "wisdem.ccblade.ccblade", None)
    with pytest.raises(InputError, match="wisdem"):
        bench.measure(bench.plain(), Stand())

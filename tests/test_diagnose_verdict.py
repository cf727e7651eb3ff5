"""What given probabilities say, and the scores that names must pass."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosing import case, compressibility_missed, diagnose, points, recording
from interval_scales import Off, calibrate

from bemt.judge import loss
from bemt.judge.diagnose import chain, fit, form, knowledge, noise
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.folder import improved_case
from bemt.judge.diagnose.record import from_series
from bemt.judge.explanation import NONE, UNKNOWN, Explanation, Size
from bemt.physics import effects
from bemt.physics.bem import model as bem
from bemt.rotors.propeller import rotor_of


@pytest.fixture(scope="module")
def answer() -> chain.Diagnosis:
    return compressibility_missed()


def explained(words: str) -> Explanation:
    return {"none": NONE, "unknown": UNKNOWN}.get(words, Explanation.of(*words.split("__")))


def told(answer: chain.Diagnosis, **probability: float) -> loss.Decision:
    """Decision if the explanations had these probabilities; "a__b" is a pair."""
    return loss.decide({explained(k): v for k, v in probability.items()})


def test_a_sure_effect_is_named(answer: chain.Diagnosis) -> None:
    said = told(answer, compressibility=0.97, none=0.03)
    assert (said.verdict, said.effects) == ("named", ("compressibility",))


def test_a_second_effect_that_may_be_there_is_mentioned(answer: chain.Diagnosis) -> None:
    said = told(answer, compressibility=0.6, compressibility__thrust_zero=0.38, none=0.02)
    assert (said.verdict, said.effects) == ("class", ("compressibility", "thrust_zero"))
    assert said.probability > 0.95 and said.beside and "left open" in said.why


def test_a_few_explanations_are_an_answer_and_many_are_not(answer: chain.Diagnosis) -> None:
    said = told(answer, compressibility=0.5, thrust_zero=0.45, none=0.05)
    assert (said.verdict, set(said.effects)) == ("class", {"compressibility", "thrust_zero"})
    assert said.probability == pytest.approx(0.95)
    ids = list(effects.catalogue())[:12]
    assert told(answer, **dict.fromkeys(ids, 1.0 / 12.0)).verdict == "insufficient"


@pytest.mark.parametrize("walls", [None, object()])
def test_a_duct_of_the_case_is_on_already(walls: object, answer: chain.Diagnosis) -> None:
    parts = [SimpleNamespace(baseline=p.baseline, model=SimpleNamespace(duct=walls)) for p in answer.problem.parts]
    problem: Any = SimpleNamespace(parts=parts)
    assert ("duct" in knowledge.present(problem)) == (walls is not None)


def test_a_duct_that_is_gone_is_a_cause_of_its_own() -> None:
    """Anybody would see it at the stand; nobody sees it in a file."""
    fan = case("ds30")
    gone = recording(fan, points("static"), (effects.catalogue()["duct"](state="gone"),))
    there = replace(from_series(recording(fan, points("static"), seed=3), fan), reference=True)
    told = chain.diagnose([from_series(gone, fan), there], [fan])
    assert "duct" in told.decision.effects
    assert told.parameters["duct"]["state"].value == "gone"
    improved = tomllib.loads(improved_case(told, fan, fan.path.read_text(encoding="utf-8")))["model"]
    open_rotor = rotor_of(fan).replaced({"model.effects_on": improved["effects_on"]}).solve(20000.0, bands=False)
    assert open_rotor.duct_thrust_N is None or not np.any(open_rotor.duct_thrust_N)


def test_the_nearest_signature_is_a_baseline_of_its_own(answer: chain.Diagnosis) -> None:
    assert form.nearest(answer.found) == "compressibility"


def test_a_cause_of_half_of_the_thrust_is_not_outdone_by_pairs_with_it() -> None:
    """All of its forty pairs lead; each pays for the errors of its laws as the cause alone does."""
    backwards = effects.catalogue()["mounted_backwards"](drag=2.0)
    assert diagnose(recording(case(), points("grid"), (backwards,)), case()).decision.effects == ("mounted_backwards",)


def test_references_are_in_no_block() -> None:
    rpm = np.repeat([4000.0, 6000.0, 8000.0, 10000.0], 3)
    covariates = {"rpm": rpm, "J": np.tile([0.0, 0.3, 0.6], 4), "run": np.zeros(12)}
    problem: Any = SimpleNamespace(
        covariates=covariates, parts=(1, 2), point=np.tile(np.arange(12), 2), free=np.tile(rpm > 5000, 2)
    )
    for _, block in chain.partitions(problem):
        assert np.array_equal(block == chain.REFERENCE, rpm < 5000)
        assert np.unique(block[block >= 0]).size == 3


def test_an_unknown_effect_is_in_the_test_not_in_the_reference() -> None:
    given = points("grid")
    truth = case()
    series = recording(truth, given)
    records = [from_series(series, truth), replace(from_series(series, truth), reference=True)]
    problem = build(records, [truth])
    kernels = noise.rivals(problem)
    assert kernels and 0 < problem.free.sum() < problem.free.size
    for K in (k.covariance for k in kernels):
        assert not K[~problem.free].any() and (np.diag(K)[problem.free] >= 0.0).all() and K[problem.free].any()


def test_intervals_end_at_the_physical_bounds() -> None:
    low, high = np.zeros(3), np.ones(3)
    middle, (a, b) = fit._truncated([(1.0, np.array([0.4, 3.0, -5.0]), np.array([0.05, np.inf, 0.1]))], low, high, 0.9)
    assert middle[0] == pytest.approx(0.4) and b[0] - a[0] == pytest.approx(2 * 1.6449 * 0.05, rel=1e-3)
    # readings that do not see it leave the uniform prior; readings that want it outside leave it at the bound
    np.testing.assert_allclose((a[1], middle[1], b[1]), (0.05, 0.5, 0.95), atol=2e-3)
    assert 0.0 <= a[2] < middle[2] < b[2] < 0.1


def test_a_wrong_airspeed_is_that_of_the_tunnel_not_of_the_wall(answer: chain.Diagnosis) -> None:
    """At rest no factor on the airspeed changes anything, whatever a wall does to the inflow."""
    flow = answer.problem.parts[0].flow
    still = replace(flow, V=np.zeros_like(flow.V))
    wall = effects.catalogue()["ground_effect"](z_over_R=0.6)
    slip = effects.catalogue()["unit_slip"](channel="airspeed_m_s", factor=3.6)
    part = answer.problem.parts[0]

    def thrust(*extra: effects.Effect) -> np.ndarray:
        return bem.respond(part.model.prepared, (*part.baseline, *extra), still)[0].T

    assert np.array_equal(thrust(wall, slip), thrust(wall)) and np.all(thrust(wall) > thrust())


def pair(**changed: Any) -> Any:
    """Two recordings of one rotor and stand, without a case."""
    plain = {"by_density": "", "turned": False, "by_proxy": False, "apart": False, "far_off": False, "wind": ""}
    return SimpleNamespace(**(plain | changed))


def test_intervals_are_widened_by_their_factor_and_end_at_the_range() -> None:
    told = {"untwist": {"turn_deg": Size(1.0, 0.8, 1.3, "deg")}, "rpm_scale": {"factor": Size(2.0, 2.0, 2.0, "1")}}
    s = fit.scale_of("untwist", "turn_deg")
    wide = fit.widened(told)
    assert wide["untwist"]["turn_deg"].low == pytest.approx(1.0 - 0.2 * s)
    assert wide["untwist"]["turn_deg"].high == pytest.approx(1.0 + 0.3 * s)
    assert wide["rpm_scale"] == told["rpm_scale"]  # a ratio has odds, no half-width
    far = {"untwist": {"turn_deg": Size(2.9, 2.0, 3.0, "deg")}}
    assert fit.widened(far)["untwist"]["turn_deg"].high == 3.0


def test_factors_hold_as_often_as_they_say() -> None:
    rng = np.random.default_rng(0)
    scores = np.abs(rng.standard_normal(400)) / 1.0
    found = [Off("untwist.turn_deg", float(v)) for v in scores[:200]]
    factor = calibrate(found, [])["parameters"]["untwist.turn_deg"]["scale"]
    assert np.mean(scores[200:] <= factor) == pytest.approx(0.9, abs=0.06)


def test_the_groups_of_an_answer_are_views_of_one_weighing(answer: chain.Diagnosis) -> None:
    assert answer.readings.values.size == answer.readings.u.size == answer.baseline.values.size
    assert answer.prior.keys() == answer.posterior.probability.keys()
    assert sum(answer.prior.values()) == pytest.approx(1.0) == pytest.approx(sum(answer.posterior.probability.values()))
    assert {c.id for c in answer.explanations} == set(answer.posterior.inclusion)

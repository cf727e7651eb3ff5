"""What is said for given probabilities, and the scores that a name must pass."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosing import case, diagnose, left_out, points, recording

from bemt.judge.diagnose import (
    blocks,
    chain,
    confusion,
    evidence,
    fit,
    interval_scales,
    noise,
    prior,
    rules,
    signatures,
    thresholds,
    verdict,
)
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.record import from_series
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.proof.intervals import calibrate
from bemt.physics import effects
from bemt.physics.bem import model as bem


@pytest.fixture(scope="module")
def answer() -> chain.Diagnosis:
    return diagnose(recording(case(), points("grid")), left_out("compressibility", case()))


def explained(words: str) -> Explanation:
    return {"none": NONE, "unknown": UNKNOWN}.get(words, Explanation.of(*words.split("__")))


def told(answer: chain.Diagnosis, **probability: float) -> verdict.Decision:
    """Decision if the explanations had these probabilities; "a__b" is a pair."""
    given = {explained(k): v for k, v in probability.items()}
    share = dict.fromkeys(answer.found.probability, 0.0) | given
    return rules.decide(verdict.VerdictQuery(replace(answer.found, probability=share), 0.002))


def test_a_sure_effect_is_named(answer: chain.Diagnosis) -> None:
    said = told(answer, compressibility=0.97, none=0.03)
    assert (said.verdict, said.effects) == ("named", ("compressibility",))


def test_a_second_effect_that_may_be_there_is_mentioned(answer: chain.Diagnosis) -> None:
    said = told(answer, compressibility=0.7, compressibility__thrust_zero=0.28, none=0.02)
    assert (said.verdict, said.effects) == ("class", ("compressibility", "thrust_zero"))
    assert said.probability > 0.95 and "left open" in said.why


def test_a_few_explanations_are_an_answer_and_many_are_not(answer: chain.Diagnosis) -> None:
    said = told(answer, compressibility=0.5, thrust_zero=0.45, none=0.05)
    assert (said.verdict, set(said.effects)) == ("class", {"compressibility", "thrust_zero"})
    assert said.probability == pytest.approx(0.95)
    many = {k: 0.2 for k in ("thrust_zero", "torque_gain", "airspeed_offset", "nacelle")}
    assert told(answer, compressibility=0.21, **many).verdict == "insufficient"


def test_what_is_on_already_is_not_what_was_left_out(answer: chain.Diagnosis) -> None:
    assert "tip_loss" in {e.id for e in answer.problem.baseline}
    assert answer.found.log_bayes(Explanation.of("tip_loss")) < thresholds.PROVEN
    assert told(answer, tip_loss=0.99).verdict in ("insufficient", "unknown")


@pytest.mark.parametrize(
    ("setting", "beyond"),
    [({"strength": 3.0, "form": "hayden"}, True), ({"z_over_R": 0.5}, True), ({"strength": 1.2}, False),
     ({"strength": 0.0}, False), ({"strength": 1.0, "z_over_R": 2.0}, False)],
)  # fmt: skip
def test_physics_that_is_on_is_wrong_at_the_end_of_its_range(
    setting: dict[str, Any], beyond: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not where the end of the range is "off", nor at the value that it is on with."""
    found: Any = SimpleNamespace(problem=SimpleNamespace(baseline=(effects.catalogue()["ground_effect"](),)))
    monkeypatch.setattr(fit, "fit", lambda *_: SimpleNamespace(settings=(setting,)))
    asked: Any = SimpleNamespace(found=found, leading=Explanation.of("ground_effect"))
    assert rules._leaves_its_range(asked) == beyond


@pytest.mark.parametrize("end", [True, False])
def test_the_duct_of_the_case_is_on_though_it_is_no_effect(end: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    p = effects.catalogue()["duct"].parameters[0]
    setting = {p.name: p.high if end else 0.5 * (p.low + p.high)}
    monkeypatch.setattr(fit, "fit", lambda *_: SimpleNamespace(settings=(setting,)))
    asked: Any = SimpleNamespace(
        found=SimpleNamespace(problem=SimpleNamespace(baseline=())), leading=Explanation.of("duct")
    )
    assert rules._leaves_its_range(asked) == end


@pytest.mark.parametrize(
    ("first", "adds", "rest", "left"),
    [("unit_slip", 20.0, 3.9, "unit_slip__untwist"), ("unit_slip", 20.0, 4.1, "unit_slip"),
     ("unit_slip", 60.0, 4.1, "unit_slip__untwist"), ("duct", 20.0, 4.1, "duct__untwist")],
)  # fmt: skip
def test_what_is_named_beside_a_slip_explains_its_own(
    first: str, adds: float, rest: float, left: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slip explains so much that any rest is small beside it; the second effect may not hide behind that."""
    pair = Explanation.of(first, "untwist")
    weights = {Explanation.of(first): 1000.0, Explanation.of("untwist"): 5.0, pair: 1000.0 + adds}
    found: Any = SimpleNamespace(problem=None, log_bayes=lambda a, b, real: weights[a] - weights[b])
    monkeypatch.setattr(prior, "present", lambda _: set())
    leading, share = verdict._earned(found, pair, {first: 1.0, "untwist": 0.99}, rest)
    assert leading == explained(left) and share["untwist"] == (0.99 if leading == pair else 0.0)


@pytest.mark.parametrize("walls", [None, object()])
def test_a_duct_of_the_case_is_on_already(walls: object, answer: chain.Diagnosis) -> None:
    parts = [SimpleNamespace(baseline=p.baseline, model=SimpleNamespace(duct=walls)) for p in answer.problem.parts]
    problem: Any = SimpleNamespace(parts=parts)
    assert ("duct" in prior.present(problem)) == (walls is not None)


def test_the_nearest_signature_is_a_baseline_of_its_own(answer: chain.Diagnosis) -> None:
    assert confusion.nearest(answer.found) == "compressibility"


def test_references_are_in_no_block() -> None:
    rpm = np.repeat([4000.0, 6000.0, 8000.0, 10000.0], 3)
    covariates = {"rpm": rpm, "J": np.tile([0.0, 0.3, 0.6], 4), "run": np.zeros(12)}
    problem: Any = SimpleNamespace(
        covariates=covariates, parts=(1, 2), point=np.tile(np.arange(12), 2), free=np.tile(rpm > 5000, 2)
    )
    for _, block in blocks.partitions(problem):
        assert np.array_equal(block == blocks.REFERENCE, rpm < 5000)
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


def asked(**changed: Any) -> Any:
    """What an outcome without a doubt would answer, one effect being sure, but for what is changed."""
    lead = Explanation.of("reynolds")
    plain = {
        "first": lead, "leading": lead, "rest": 0.0, "odds": 100.0, "needed": 8.0, "p_value": 0.002, "gate": 0.01,
        "on": False, "expected": False, "paired": False, "sure": ("reynolds",), "group": ("reynolds",), "beside": (),
        "few": (), "likely": ("reynolds",), "wide": ("reynolds",), "drive_only": False,
        "P": {NONE: 0.0, UNKNOWN: 0.0, lead: 1.0}, "share": {"reynolds": 1.0}, "unlisted": 0.0, "roughness": 1.0,
        "vague": 0.0, "alone": True, "level": 0.0, "another_blade": False, "factor": False, "real": False,
        "parameters": {"reynolds": {}}, "pair": None, "likeliest_none": False, "dropped": False,
    }  # fmt: skip

    def says(word: str, why: str = "", ids: Any = (), *_: Any, **__: Any) -> verdict.Decision:
        return verdict.Decision(word, tuple(ids), lead, 0.95, 0.0, (), why)

    found = SimpleNamespace(log_bayes=lambda _: 100.0, probability={lead: 1.0},
                            problem=SimpleNamespace(parts=(), by_laws=False))  # fmt: skip
    return SimpleNamespace(**({"found": found, "says": says, "names": lambda ids, _: says("named", "", ids),
                               "known_sets": (("reynolds",), ("duct",))} | plain | changed))  # fmt: skip


REYNOLDS = Explanation.of("reynolds")
ROWS: dict[str, dict[str, Any]] = {
    "no effect can be seen": {"first": NONE},
    "as large a mismatch occurs without a cause": {"p_value": 0.2},
    "nearly as large a mismatch occurs without a cause": {"p_value": 0.03},
    "nothing is likelier than anything": {"P": {NONE: 0.6, UNKNOWN: 0.0}},
    "a drive that changed smoothly": {
        "P": {NONE: 0.0, UNKNOWN: 0.6, REYNOLDS: 0.4},
        "vague": 104.0,
        "drive_only": True,
        "alone": False,
    },
    "unknown, and not much better than nothing": {"P": {NONE: 0.0, UNKNOWN: 0.6}, "vague": 4.9},
    "unknown is likelier than all": {"P": {NONE: 0.0, UNKNOWN: 0.6, REYNOLDS: 0.4}, "vague": 20.0},
    "a smooth residual remains": {"rest": 10.5},
    "not much better than nothing": {"odds": 7.0},
    "twin faults": {"leading": Explanation.of("thrust_zero", "torque_drift")},
    "two levels": {"leading": Explanation.of("air_density", "torque_gain")},
    "unknown is nearly as likely": {"unlisted": 0.2},
    "far rougher than stated": {"roughness": 5.0, "alone": True},
    "may as well be absent": {
        "leading": Explanation.of("untwist"),
        "parameters": {"untwist": {"tip_deg": {"low": -0.1, "high": 0.5}}},
    },
    "a wrong unit, but which": {
        "leading": Explanation.of("unit_slip"),
        "parameters": {
            "unit_slip": {
                "channel": {"value": "airspeed_m_s"},
                "factor": {"value": 3.28, "odds": [[3.28, 0.5], [3.6, 0.48]]},
            }
        },
    },
    "another blade, or anything that scales all loads": {"another_blade": True},
    "at the end of its range": {
        "leading": Explanation.of("untwist", "duct"),
        "share": {"untwist": 0.9, "duct": 1.0},
        "parameters": {"untwist": {"tip_deg": {"value": 5.0, "low": 4.0, "high": 5.0}}},
    },
    "on already, and no reference": {
        "on": True,
        "leading": Explanation.of("reynolds", "duct"),
        "parameters": {},
    },
    "two in the air, and no reference": {
        "real": True,
        "leading": Explanation.of("untwist", "oblique_inflow"),
        "parameters": {},
    },
    "several are sure": {"sure": ("reynolds", "duct"), "share": {"reynolds": 0.99, "duct": 0.98}},
    "one is sure": {},
    "one is nearly sure": {"likely": ("reynolds", "duct")},
    "one is sure, another may be there": {"beside": ("duct",)},
    "two at work": {"paired": True},
    "on already, among others": {
        "sure": (),
        "on": True,
        "alone": False,
        "leading": Explanation.of("reynolds", "duct"),
        "parameters": {},
    },
    "look-alikes": {"sure": (), "group": ("reynolds", "torque_zero")},
    "sure with its pairs": {"sure": ()},
}


@pytest.mark.parametrize("name", ROWS)
def test_each_row_of_the_table_answers_when_it_alone_holds(name: str) -> None:
    """The first row that holds is the one that was made to hold; take it away and a later one does."""
    a = asked(**ROWS[name])
    assert next(r.name for r in rules.RULES if not r.revises and r.ask(a) is not None) == name


def test_the_table_says_where_each_row_comes_from_and_the_last_always_holds() -> None:
    assert len({r.name for r in rules.RULES}) == len(rules.RULES) and all(r.source for r in rules.RULES)
    assert [r for r in rules.RULES if not r.revises][-1].ask(asked()) is not None
    assert {r.name for r in rules.RULES} == {*ROWS, *REVISIONS, *BY_MODEL}


def test_two_sure_effects_one_at_the_end_of_its_range_are_a_class_of_two_sets() -> None:
    sure = ROWS["at the end of its range"] | {"share": {"untwist": 0.99, "duct": 1.0}}
    a = asked(**sure, P={NONE: 0.0, UNKNOWN: 0.0, Explanation.of("untwist", "duct"): 0.99})
    said = next(r.ask(a) for r in rules.RULES if r.name == "at the end of its range")
    assert said is not None and (said.verdict, set(said.sets)) == ("class", {("untwist",), ("duct",)})


def test_a_pair_has_one_set_for_each_cause() -> None:
    """Look-alikes of one cause share its set, whatever stands beside them."""
    one, two = {"air_density": 0.6, "rpm_scale": 0.4}, {"thrust_zero": 0.96, "thrust_drift": 0.03, "nacelle": 0.01}
    share = {Explanation.of(a, b): p * q for a, p in one.items() for b, q in two.items()}
    share |= {Explanation.of("air_density"): 0.2, NONE: 0.1, Explanation.of("air_density", "rpm_scale"): 1e-3}
    sets = verdict.credible_sets(share, Explanation.of("air_density", "thrust_zero"))
    assert {frozenset(s) for s in sets} == {frozenset(one), frozenset({"thrust_zero"})}


def test_one_of_each_set_holds_nearly_all_of_two_causes() -> None:
    """Pairs with nothing in common with the leading one count, too; a tail that no set can hold is not padded with."""
    pairs = {("nacelle", "torque_gain"): 0.72, ("pitch_offset", "thrust_gain"): 0.13, ("nacelle", "thrust_gain"): 0.11}
    share = {Explanation.of(*k): v for k, v in pairs.items()} | {Explanation.of("nacelle"): 0.04}
    a, b = verdict.credible_sets(share, Explanation.of("nacelle", "torque_gain"))
    assert sum(v for (i, j), v in pairs.items() if (i in a) != (j in a) and (i in b) != (j in b)) >= 0.95 * 0.96
    alone = verdict.credible_sets(share, Explanation.of("nacelle", "torque_gain"), "nacelle")
    assert alone[0] == ("nacelle",) and set(alone[1]) == {"torque_gain", "thrust_gain"}
    tail = {Explanation.of("duct", i): 5e-4 for i in ("tip_cut", "section", "reynolds", "untwist", "nacelle")}
    few = verdict.credible_sets(
        tail | {Explanation.of("duct", "thrust_zero"): 0.05}, Explanation.of("duct", "thrust_zero")
    )
    assert few == (("duct",), ("thrust_zero",))


def _said(word: str, *ids: str, by: str = "model") -> verdict.Decision:
    return verdict.Decision(word, ids, Explanation.of(*ids), 0.95, 0.0, (), "", by=by)


def revised(name: str, said: verdict.Decision, **changed: Any) -> verdict.Decision | None:
    """What one revising rule makes of an answer, all else being in order."""
    part = SimpleNamespace(record=SimpleNamespace(reference=False, air_recorded=False))
    problem = SimpleNamespace(level={"thrust_N": 0.0}, scatter={}, findings=(), parts=(part,), by_laws=False)
    slip = {"unit_slip": {"channel": {"value": "density_kg_m3"}}}
    plain: dict[str, Any] = {
        "answer": said, "of_loads": said, "drive": None, "load_moves": False, "change": None, "alone": False,
        "pair": None,
        "P": {NONE: 0.1, Explanation.of("oblique_inflow"): 0.4},
        "refined": lambda _: (SimpleNamespace(signature=np.array([0.2])), slip),
        "found": SimpleNamespace(problem=problem, spans={"oblique_inflow": None}),
    }  # fmt: skip
    for k in ("level", "scatter", "findings"):
        if k in changed:
            setattr(problem, k, changed.pop(k))
    a: Any = SimpleNamespace(**(plain | changed))
    return next(r.ask(a) for r in rules.RULES if r.name == name)


def ratios(word: str, *ids: str, drive: str = "") -> Any:
    loads = SimpleNamespace(verdict=word, effects=ids, probability={"none": 0.9, **dict.fromkeys(ids, 0.4)}, why="seen")
    motor = SimpleNamespace(verdict="named", effects=(drive,), probability={drive: 0.9}, why="seen")
    return SimpleNamespace(loads=loads, drive=motor, leading=motor if drive else loads, ratios={}, channels={})


def pair(**changed: Any) -> Any:
    """Two recordings of one rotor and stand, without a case."""
    plain = {"by_density": "", "turned": False, "by_proxy": False, "apart": False, "far_off": False, "wind": ""}
    return SimpleNamespace(**(plain | changed))


REVISIONS: dict[str, tuple[verdict.Decision, dict[str, Any], str]] = {
    "another rotor than the case's": (_said("named", "duct"), {"level": {"thrust_N": 4.0}}, "insufficient"),
    "repeats differ as those of no stand": (_said("named", "duct"), {"scatter": {"thrust_N": 0.3}}, "insufficient"),
    "a recording contradicts itself": (_said("unknown"), {"findings": ("log.csv: error: so",)}, "insufficient"),
    "a wrong density that nobody recorded": (_said("sensor", "unit_slip"), {}, "insufficient"),
    "the drive changed, the loads say nothing": (_said("none"), {"drive": _said("named", "battery_sag")}, "named"),
    "the drive changed as well": (_said("sensor", "thrust_gain"), {"drive": _said("named", "battery_sag")}, "named"),
    "the ratios to the reference show no change": (_said("unknown"), {"change": ratios("none")}, "none"),
    "the loads agree, the drive does not": (_said("none"), {"change": ratios("none", drive="battery_sag")}, "named"),
    "the ratios to the reference answer": (
        _said("insufficient"),
        {"change": ratios("class", "duct")},
        "class",
    ),
    "two recordings without a case: thrust of the other sign": (
        _said("sensor", "unit_slip"), {"pair": pair(turned=True)}, "sensor",
    ),
    "two recordings without a case: electrical power for torque": (
        _said("named", "untwist"), {"pair": pair(by_proxy=True)}, "insufficient",
    ),
    "two recordings without a case: nothing shared, or no one stand": (
        _said("named", "duct"), {"pair": pair(apart=True)}, "insufficient",
    ),
    "two recordings without a case: the densities that both tell": (
        _said("none"), {"pair": pair(by_density="thinner air")}, "named",
    ),
}  # fmt: skip
# Rules that need a solved problem or a file: tested on one.
BY_MODEL = (
    "an exact relation in the file", "a wrong unit of the airspeed, or the wind",
    "another propeller, or what changes this one",
    "does not predict", "on, and out of its range", "a few are left", "many are left",
    "the ratios to the reference forbid a none",
)  # fmt: skip


@pytest.mark.parametrize("name", REVISIONS)
def test_each_revision_answers_when_it_alone_holds(name: str) -> None:
    said, changed, word = REVISIONS[name]
    found = revised(name, said, **changed)
    assert found is not None and found.verdict == word
    assert revised(name, _said("none")) is None


def test_a_change_of_pole_pairs_is_one_though_the_speeds_share_nothing() -> None:
    rule = "two recordings without a case: nothing shared, or no one stand"
    assert revised(rule, _said("sensor", "rpm_scale"), pair=pair(apart=True, far_off=True)) is None
    assert revised(rule, _said("none"), pair=pair(wind="no airspeed")) is None


def test_a_factor_of_three_that_is_a_slip_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert revised("another rotor than the case's", _said("sensor", "unit_slip"), level={"thrust_N": 4.0}) is None


def test_ratios_answer_with_what_the_model_holds_likely_and_no_law_describes() -> None:
    found = revised("the ratios to the reference answer", _said("insufficient"), change=ratios("named", "thrust_gain"))
    assert found is not None and found.effects == ("thrust_gain", "oblique_inflow") and found.by == "ratios"


def test_what_takes_load_off_the_motor_is_no_fault_of_the_drive() -> None:
    """A recording with recirculation was called a hot motor: the speed at a pulse width rose as the load fell."""
    drive = _said("named", "motor_heating")
    for word in ("unknown", "insufficient"):
        assert revised("the drive changed, the loads say nothing", _said(word), drive=drive, load_moves=True) is None
    both = revised("the drive changed as well", _said("named", "pitch_offset"), drive=drive)
    assert both is not None and both.effects == ("pitch_offset", "motor_heating")
    assert revised("the drive changed as well", _said("named", "pitch_offset"), drive=drive, load_moves=True) is None


def test_air_that_changes_with_time_moves_the_load(answer: chain.Diagnosis) -> None:
    share = dict.fromkeys(answer.found.probability, 0.0) | {Explanation.of("recirculation"): 0.6, NONE: 0.4}
    query = verdict.VerdictQuery(replace(answer.found, probability=share), 0.002)
    query.steps.append(_said("insufficient"))
    assert query.load_moves
    query.steps.append(_said("named", "pitch_offset"))
    assert not query.load_moves


def test_intervals_are_widened_by_their_factor_and_end_at_the_range() -> None:
    told = {"untwist": {"tip_deg": {"value": 1.0, "low": 0.8, "high": 1.3, "unit": "deg"}},
            "rpm_scale": {"factor": {"value": 2.0, "low": 2.0, "high": 2.0, "unit": "1"}}}  # fmt: skip
    s = interval_scales.scale_of("untwist", "tip_deg")
    wide = interval_scales.widened(told)
    assert wide["untwist"]["tip_deg"]["low"] == pytest.approx(1.0 - 0.2 * s)
    assert wide["untwist"]["tip_deg"]["high"] == pytest.approx(1.0 + 0.3 * s)
    assert wide["rpm_scale"] == told["rpm_scale"]  # a ratio has odds, no half-width
    far = {"untwist": {"tip_deg": {"value": 4.9, "low": 4.0, "high": 5.0, "unit": "deg"}}}
    assert interval_scales.widened(far)["untwist"]["tip_deg"]["high"] == 5.0


def test_factors_hold_as_often_as_they_say() -> None:
    rng = np.random.default_rng(0)
    scores = np.abs(rng.standard_normal(400)) / 1.0
    found = [{"effect": "untwist", "parameter": "tip_deg", "score": float(v)} for v in scores[:200]]
    factor = calibrate(found, [])["parameters"]["untwist.tip_deg"]["scale"]
    assert np.mean(scores[200:] <= factor) == pytest.approx(0.9, abs=0.06)


def test_a_number_that_may_as_well_be_off_is_not_pinned_to_its_end() -> None:
    low = {"value": 0.7, "low": 0.7, "high": 1.1}
    assert not rules.at_end("section", {"drag": low})
    assert rules.at_end("section", {"drag": {**low, "high": 0.9}})


def test_two_effects_are_weighed_as_they_act_together(answer: chain.Diagnosis) -> None:
    found, state = answer.found, answer.found.states[0]
    assert state.mixed
    for pair, (extra, i, j) in state.mixed.items():
        a, b = (found.of(k).settings[c - found.spans[k].start] for k, c in zip(pair, (i, j), strict=True))
        solved = [signatures.effect_of(k, s) for k, s in zip(pair, (a, b), strict=True)]
        parts = [found.problem.signature((e,)) for e in solved]
        together = found.problem.signature(tuple(solved)) - sum(parts)
        np.testing.assert_allclose(extra, state.white.changes(together), atol=1e-9)
        rest = state.r - state.S[:, i] - state.S[:, j] - extra
        A, B = (found.spans[k] for k in pair)
        total = state.both(pair, found.spans, found.log_w)[i - A.start, j - B.start]
        expected = 0.5 * state.r @ state.r - 0.5 * rest @ rest + found.log_w[i] + found.log_w[j]
        assert total == pytest.approx(expected, abs=1e-6)


def test_none_one_effect_and_two_are_judged_under_their_best_covariances() -> None:
    one, two = Explanation.of("untwist"), Explanation.of("untwist", "thrust_zero")
    best = {NONE: 0.0, one: 70.0, two: 100.0}
    each = {k: noise.Hyper(1.0, 0.0, 0.01 * n, 1.0, 0.25) for n, k in enumerate(best, 1)}
    kept = evidence._leading({each[k]: {**dict.fromkeys(best, -50.0), k: z} for k, z in best.items()})
    assert set(kept) == set(each.values())


def test_the_groups_of_an_answer_are_views_of_one_weighing(answer: chain.Diagnosis) -> None:
    assert answer.readings.values.size == answer.readings.u.size == answer.baseline.values.size
    assert answer.prior.keys() == answer.posterior.probability.keys()
    assert sum(answer.prior.values()) == pytest.approx(1.0) == pytest.approx(sum(answer.posterior.probability.values()))
    assert {c.id for c in answer.explanations} == set(answer.posterior.inclusion)

"""The promise of `diagnose`: it names what the plan shows, and nothing else."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from diagnosing import case, compressibility_missed, diagnose, left_out, points, recording

from bemt.judge.diagnose import assemble, chain, document, figures, form, noise, plan, posterior, record, signatures
from bemt.judge.explanation import UNKNOWN, Explanation
from bemt.physics import effects
from bemt.physics.dataset import Dataset

GRID = points("grid")


@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_is_named_where_nothing_is_left_out(seed: int) -> None:
    answer = diagnose(recording(case(), GRID, seed=seed), case())
    assert answer.decision.verdict == "none", document.text(answer)
    assert not answer.decision.effects


def test_correlated_noise_alone_names_nothing() -> None:
    answer = diagnose(recording(case(), GRID, seed=3, ar=0.8), case())
    assert answer.decision.verdict in ("none", "insufficient"), document.text(answer)


def test_compressibility_left_out_is_named_located_and_mended() -> None:
    answer = compressibility_missed()
    assert (answer.decision.verdict, answer.decision.effects) == ("named", ("compressibility",)), document.text(answer)
    assert answer.where is not None and answer.where.variable == "M_tip"
    assert answer.where.low > 0.3, "Mach number acts at the fast end"
    for score in answer.scores.values():
        assert score["holdout_after"] < 0.5 * score["holdout_before"]
        assert score["holdout_after"] < 1.3 * score["noise"]
    value = answer.parameters["compressibility"]["amplitude"]
    assert value.low - 0.05 <= 1.0 <= value.high + 0.05


def test_an_inviscid_law_errs_over_advance_ratio_only() -> None:
    """Similarity: at one advance ratio the error of such a law is the same at every speed and density."""
    given = points("air")
    built = assemble.build([record.from_series(recording(case(), given), case())], [case()])
    J = np.round(built.covariates["J"][built.point], 6)
    for name, free in (
        ("tip_loss", False),
        ("ground_effect", False),
        ("duct", False),
        ("lip_separation", False),
        ("reynolds", True),
    ):
        modes = noise.smooth_modes(built, (), noise.law_of(effects.catalogue()[name]))
        shown = modes @ modes.T  # the covariance, whatever the signs of its modes
        thrust = np.flatnonzero(built.channel == 0)
        spread = [np.ptp(shown[np.ix_(thrust[J[thrust] == x], thrust)], axis=0).max() for x in np.unique(J)]
        assert (max(spread) > 0.5) == free and (free or max(spread) < 1e-6), name
    assert noise.law_of(effects.catalogue()["thrust_gain"]) == ()
    # both turn the zero-lift line: the law of the one is no better known than that of the other
    assert noise.law_of(effects.catalogue()["section"]) == noise.law_of(effects.catalogue()["pitch_offset"]) == ()


@pytest.mark.parametrize("slope", [0.0, 2e-4, -1e-3])
def test_noise_of_the_thermometer_is_no_air(slope: float) -> None:
    """Predicted loads follow the air, and it does not flicker; what really changes stays."""
    t = np.linspace(0.0, 600.0, 60)
    truth = 290.0 + slope * t
    given = {"rpm": np.tile(np.linspace(4000.0, 9000.0, 6), 10), "time_s": t, "thrust_N": np.ones(60)}

    def air(temperature: np.ndarray) -> np.ndarray:
        values = {**given, "temperature_K": temperature}
        return np.asarray(record.from_series(Dataset("bench", "x", values), case()).air.temperature_K)

    noisy = truth + 0.1 * np.random.default_rng(3).standard_normal(60)
    assert np.sqrt(np.mean((air(noisy) - truth) ** 2)) < 0.35 * 0.1
    steps = truth + np.where(t > 200.0, 4.0, 0.0) + np.where(t > 400.0, -7.0, 0.0)  # a door, then a heater
    assert np.array_equal(air(steps), steps)


def test_settings_that_are_joined_stand_for_what_they_were_solved_with() -> None:
    """Where a recording cannot tell two onsets from each other, neither of them becomes the default."""
    given = {k: v[:6] for k, v in points("static").items()}
    duct = case("ds30")
    built = assemble.build([record.from_series(recording(duct, given), duct)], [duct])
    (lip,) = signatures.candidates(built, ["lip_separation"])[0]
    for k, setting in enumerate(lip.settings):
        again = built.signature((signatures.effect_of("lip_separation", setting),))
        np.testing.assert_allclose(again, lip.signatures[:, k], atol=1e-9 * np.abs(built.y).max())


@pytest.mark.parametrize("walls", [None, (0.1, 0.4)])
def test_a_parameter_that_the_recording_replaces_is_no_parameter(walls: tuple[float, float] | None) -> None:
    """The recorded distance of a wall stands for the assumed one; what the readings do not know is not reported."""
    given = dict(points("static"))
    if walls:
        given["wall_distance_m"] = np.linspace(*walls, given["rpm"].size)
    built = assemble.build([record.from_series(recording(case(), given), case())], [case()])
    (wall,) = signatures.candidates(built, ["ground_effect"])[0]
    assert wall.weight.sum() == pytest.approx(1.0)
    assert any("z_over_R" in s for s in wall.settings) == (walls is None)
    assert all({"form", "strength"} <= s.keys() for s in wall.settings)
    # at rest there is no wind for a plate to dam
    assert not any("plate_radius_over_R" in s for s in wall.settings if s["strength"] != 1.0)


class Tube(effects.catalogue()["ground_effect"]):  # type: ignore[misc]
    """The wall as the image of an ideal vortex tube (Knight and Hefner 1941, NACA TN 835), a third of it."""

    def relief(self, z_over_R: np.ndarray) -> np.ndarray:
        z = np.where(np.isnan(z_over_R), np.inf, z_over_R)
        return 0.35 * (1.0 - 2.0 / np.sqrt(1.0 + z**-2) + 2.0 / np.sqrt(4.0 + z**-2))


class Near(Tube):
    """Twice as much of it."""

    def relief(self, z_over_R: np.ndarray) -> np.ndarray:
        return 2.0 * super().relief(z_over_R)


def test_a_wall_with_a_law_of_its_own_is_the_wall() -> None:
    """No effect but the wall follows its recorded distance, so something unknown along it is the wall, too."""
    given = dict(points("static")) | {"wall_distance_m": np.tile([0.07, 0.1, 0.15, 0.3, 0.8], 4)[:17]}
    answer = diagnose(recording(case(), given, (Tube(),)), case())
    assert answer.decision.effects == ("ground_effect",), document.text(answer)
    assert answer.found.probability[UNKNOWN] < 0.01


class Strong(Tube):
    """Four times as much of it."""

    def relief(self, z_over_R: np.ndarray) -> np.ndarray:
        return 4.0 * super().relief(z_over_R)


WALL = dict(points("static")) | {"wall_distance_m": np.tile([0.07, 0.1, 0.15, 0.3, 0.8], 4)[:17]}
BEFORE_A_WALL = case().replaced({"model.effects_on": ["ground_effect"]})


def test_more_of_a_wall_that_the_case_has_on_is_the_error_of_its_law() -> None:
    """A recorded wall was not left out, however far its published law is off."""
    given = WALL | {"wall_distance_m": np.tile([0.1, 0.15, 0.2, 0.3, 0.8], 4)[:17]}  # most of them where it still grows
    answer = diagnose(recording(BEFORE_A_WALL, given, (Strong(),), noise=0.003), BEFORE_A_WALL)
    assert answer.found.log_bayes(Explanation.of("ground_effect")) > 5.0
    assert not answer.decision.effects, document.text(answer)


@pytest.mark.parametrize("walls", [[0.07, 0.1, 0.15, 0.3, 0.8], [0.12, 0.16, 0.2, 0.3, 0.8]])
def test_an_instrument_that_changes_nothing_is_no_evidence(walls: list[float]) -> None:
    """Nor where the settings that fit best are too small to count, as those of a wall farther away."""
    given = WALL | {"wall_distance_m": np.tile(walls, 4)[:17]}
    built = assemble.build([record.from_series(recording(BEFORE_A_WALL, given, noise=0.002), BEFORE_A_WALL)],
                           [BEFORE_A_WALL])  # fmt: skip
    found, _ = signatures.candidates(built, ["ground_effect", "cross_talk"])
    wall, both = Explanation.of("ground_effect"), Explanation.of("ground_effect", "cross_talk")
    (ground,) = (c for c in found if c.id == "ground_effect")
    largest = int(np.argmax(np.sum(ground.signatures**2, axis=0)))
    width, error = form.columns(built, ground, largest, form.form_modes(built, found)["ground_effect"])
    for column in (*error[:, :width].T, *-error[:, :width].T):
        weighed = posterior.weigh(replace(built, y=built.f0 + 0.6 * column), found)
        assert weighed.log_bayes(both, over=wall) < 0.0


@pytest.mark.parametrize("wall", [Tube, Near])
def test_a_reference_without_a_wall_leaves_its_distance_a_variable(wall: type[Tube]) -> None:
    """What only the run records is what changed it."""
    given = dict(points("static")) | {"wall_distance_m": np.tile([0.07, 0.1, 0.15, 0.3, 0.8], 4)[:17]}
    run = record.from_series(recording(case(), given, (wall(),)), case())
    free = replace(record.from_series(recording(case(), points("static"), seed=3), case()), reference=True)
    answer = chain.diagnose([run, free], [case()])
    assert answer.decision.effects == ("ground_effect",), document.text(answer)
    assert answer.marked is not None and answer.marked.variable == "wall_distance_m"
    assert figures.residual(answer).axes[0].get_xlabel().startswith("wall distance")


def test_torque_in_other_units_is_a_slip_of_units() -> None:
    series = recording(case(), GRID)
    wrong = Dataset("bench", "slipped", {**series.values, "thrust_N": series["thrust_N"] / 9.80665}, dict(series.u))
    answer = diagnose(wrong, case())
    assert answer.decision.verdict == "sensor", document.text(answer)
    assert answer.decision.effects == ("unit_slip",)


def test_a_shuffled_covariate_takes_the_claim_away() -> None:
    series = recording(case(), GRID)
    order = np.random.default_rng(5).permutation(len(series))
    shuffled = {k: (v[order] if k == "rpm" else v) for k, v in series.values.items()}
    # loads stay with the true speed as coefficients, so that only the link to the speed is cut
    factor = (series["rpm"][order] / series["rpm"]) ** 2
    shuffled |= {k: series[k] * factor for k in ("thrust_N", "torque_Nm")}
    shuffled["airspeed_m_s"] = series["airspeed_m_s"] * series["rpm"][order] / series["rpm"]
    u = {k: series.u[k] * factor for k in ("thrust_N", "torque_Nm")}
    answer = diagnose(Dataset("bench", "shuffled", shuffled, u), left_out("compressibility", case()))
    assert "compressibility" not in answer.decision.effects, document.text(answer)


def test_the_document_keeps_its_schema() -> None:
    answer = compressibility_missed()
    doc = json.loads(json.dumps(document.document(answer)))
    assert doc["schema"] == "bemt.diagnosis/1"
    assert {
        "verdict", "effects", "ranking", "location", "fit", "classes", "next_measurement", "p_value", "explanation",
    } <= set(doc)  # fmt: skip
    assert set(doc["location"]) >= {"channel", "variable", "low", "high", "size", "z"}
    assert all(
        set(f) >= {"before", "after", "noise", "gp_only", "holdout_before", "holdout_after"}
        for f in doc["fit"].values()
    )
    assert all(set(r) == {"effect", "probability", "parameters"} for r in doc["ranking"])
    assert sum(r["probability"] for r in doc["ranking"]) <= 1.0 + 1e-9
    assert set(doc["next_measurement"]) >= {"text", "points", "separates"}


def test_a_plan_with_pulse_widths_sees_the_drive() -> None:
    """Speed is a channel of such a plan, though nothing was measured yet."""
    rpm = np.tile([9000.0, 14000.0, 20000.0], 4)
    given = {"rpm": rpm, "airspeed_m_s": 0.0 * rpm, "density_kg_m3": np.full(rpm.size, 1.225),
             "time_s": 60.0 * np.arange(rpm.size), "pwm_s": 1e-3 + rpm / 24e6, "thrust_N": np.ones(rpm.size),
             "torque_Nm": np.ones(rpm.size)}  # fmt: skip
    seen = plan.plan(record.from_series(Dataset("bench", "drive", given), case()), case())
    assert {"battery_sag", "motor_heating"} <= set(seen.confusion.ids)
    assert (seen.sight["battery_sag"], seen.sight["motor_heating"]) == ("visible", "marginal")


def test_a_plan_knows_what_it_can_see() -> None:
    static, grid = (
        plan.plan(record.from_series(Dataset("bench", p, {**points(p), "thrust_N": np.ones_like(points(p)["rpm"]),
                                                         "torque_Nm": np.ones_like(points(p)["rpm"])}), case()), case())
        for p in ("static", "grid")
    )  # fmt: skip
    seen = [sum(w == "visible" for w in p.sight.values()) for p in (static, grid)]
    assert seen[1] > seen[0], "a grid over speed and advance ratio sees more than a static sweep"
    assert "airspeed_offset" in static.absent and static.sight["airspeed_offset"] == "invisible"
    doc = grid.to_dict()
    assert doc["schema"] == "bemt.plan/1" and set(doc["sight"].values()) <= {"visible", "marginal", "invisible"}

"""Loads of another rotor are a question, not missing physics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosing import CASES, case, diagnose, points, recording

from bemt.judge.compare.one_run import compare_run
from bemt.judge.diagnose import chain, other_rotor
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.load import load
from bemt.judge.diagnose.record import from_series
from bemt.judge.explanation import DOUBT
from bemt.physics.dataset import Dataset
from bemt.rotors.case import load_case


def slipped(what: str) -> Dataset:
    guess, given = case(), points("static")
    if what == "diameter":
        return recording(guess.replaced({"rotor.diameter_in": 12.0}), given, noise=0.005)
    if what == "radius":
        return recording(guess.replaced({"rotor.diameter_in": 4.0}), given, noise=0.005)
    series = recording(guess, given, noise=0.005)
    if what == "poles":
        return Dataset("bench", "log", {**series.values, "rpm": series.values["rpm"] * 7.0}, dict(series.u))
    return Dataset("bench", "log", {**series.values, "thrust_N": series.values["thrust_N"] / 9.80665}, {})


@pytest.mark.parametrize(
    ("what", "words"), [("diameter", "diameter 0.2"), ("radius", "twice the diameter"), ("poles", "7 pole")]
)
def test_a_rotor_off_by_a_factor_is_a_question_with_the_likely_slip(what: str, words: str) -> None:
    problem = build([from_series(slipped(what), case())], [case()])
    ranked = other_rotor.suspects(problem)
    assert any(words in s.words for s in ranked[:3]), ranked[:5]
    assert np.all(np.diff([s.distance for s in ranked]) >= 0.0)
    answer = chain.diagnose([from_series(slipped(what), case())], [case()])
    assert answer.problem.findings[0] == other_rotor.finding(problem)
    if what != "poles":  # a ratio of pole pairs is a cause of its own, and may be named
        assert (answer.decision.verdict, answer.decision.effects) == ("insufficient", ())


def test_one_channel_in_another_unit_stays_a_finding_of_its_own() -> None:
    answer = chain.diagnose([from_series(slipped("unit"), case())], [case()])
    assert answer.decision.effects == ("unit_slip",)
    # a tenth of the load is low by nine tenths of the largest value, not by 900 %
    assert all(abs(share) <= 1.0 for share, _ in answer.off.values()) and abs(answer.where.size) <= 1.0


@pytest.mark.parametrize("factor", [1 / 8.8507458, 0.2248, 8.8507458])
def test_a_coefficient_has_no_unit(factor: float, tmp_path: Path) -> None:
    """Off by the ratio of two units, it is still another rotor, to diagnose and to compare."""
    values = recording(case(), points("grid"), noise=0.005).derive(case().diameter_m).values
    rows = np.column_stack([values["rpm"], values["J"], values["CT"], factor * values["CQ"]])
    file = tmp_path / "chart.csv"
    file.write_text("rpm,J,K_T,K_Q\n" + "".join(",".join(f"{x:.6g}" for x in row) + "\n" for row in rows))
    answer = chain.diagnose([load(str(file), case())], [case()])
    assert "unit_slip" not in answer.decision.effects
    assert not any("taken for Nm" in s.words for s in other_rotor.suspects(answer.problem))
    assert "taken for" not in compare_run(str(file), case()).sentence


def test_a_unit_is_told_where_the_rotor_is_another_one_as_well(tmp_path: Path) -> None:
    """Newtons under grams, of a rotor of 40 % of the loads: no law holds to a per cent there, the level tells."""
    values = recording(case(), points("static"), noise=0.005).values
    rows = zip(values["rpm"], 0.4 * values["thrust_N"], 0.5 * values["torque_Nm"], strict=True)
    file = tmp_path / "log.csv"
    file.write_text("rpm,thrust_g,torque_Nm\n" + "".join(f"{n:.0f},{T:.4f},{Q:.6f}\n" for n, T, Q in rows))
    answer = chain.diagnose([load(str(file), case())], [case()])
    assert answer.decision.effects == ("unit_slip",)
    assert answer.parameters["unit_slip"]["channel"].value == "thrust_N"
    assert answer.parameters["unit_slip"]["unit"].value == "taken for gf"


@pytest.mark.parametrize(("power", "named", "not_named"), [(1.0, "thrust_gain", "air_density"),
                                                          (0.7, "air_density", "thrust_gain")])  # fmt: skip
def test_electrical_power_stands_for_a_torque_that_nobody_recorded(power: float, named: str, not_named: str) -> None:
    """Thrust is 30 % low in both: with the power unchanged it is the cell, with the power as low it is the air."""
    base, given = case(), points("static")

    def run(thrust: float, load: float, seed: int) -> Dataset:
        values = dict(recording(base, given, noise=0.005, seed=seed).values)
        shaft = values.pop("torque_Nm") * values["rpm"] * np.pi / 30.0
        values |= {"thrust_N": thrust * values["thrust_N"], "voltage_V": np.full(len(shaft), 11.1)}
        del values["density_kg_m3"]
        return Dataset("bench", "log", {**values, "electrical_power_W": load * shaft / 0.7}, {})

    test, reference = (from_series(s, base) for s in (run(0.7, power, 0), run(1.0, 1.0, 1)))
    answer = chain.diagnose([test, replace(reference, reference=True)], [base])
    assert named in answer.decision.effects
    assert not_named not in answer.decision.effects


def test_a_speed_in_another_unit_is_solved_at_the_speed_that_it_was() -> None:
    """Tables for the recorded speeds only would leave a rest, and a second cause for it."""
    base = case()
    series, plain = recording(base, points("grid"), noise=0.005), recording(base, points("grid"), noise=0.005, seed=1)
    slow = Dataset("bench", "log", {**series.values, "rpm": series.values["rpm"] * np.pi / 30.0}, dict(series.u))
    answer = chain.diagnose([from_series(slow, base), replace(from_series(plain, base), reference=True)], [base])
    assert answer.decision.effects == ("unit_slip",)
    assert answer.parameters["unit_slip"]["unit"].value == "rad/s"


@pytest.mark.parametrize(("plan", "thrust", "torque", "said"), [
    ("grid", 0.78, 0.78, "air_density"), ("static", 0.815, 0.676, "propeller"), ("grid", 0.815, 0.676, "torque_gain"),
])  # fmt: skip
def test_density_moves_thrust_and_torque_by_the_same_share(plan: str, thrust: float, torque: float, said: str) -> None:
    """Two shares are no density alone: at rest another propeller does that, alike at all advance ratios two faults."""
    base, given = case(), points(plan)
    plain, other = recording(base, given, noise=0.005), recording(base, given, noise=0.005, seed=1)
    moved = {"thrust_N": other.values["thrust_N"] * thrust, "torque_Nm": other.values["torque_Nm"] * torque}
    test = from_series(Dataset("bench", "other", {**other.values, **moved}, dict(other.u)), base)
    answer = chain.diagnose([test, replace(from_series(plain, base), reference=True)], [base])
    assert said in answer.decision.effects and (answer.decision.effects == ("air_density",)) == (thrust == torque)
    assert ("propeller" in answer.decision.effects) == (said == "propeller")


def test_no_open_rotor_needs_less_power_than_an_ideal_one_of_its_size() -> None:
    """Half of the torque at 1.6 times the thrust: a figure of merit of 1.9 of the case's size, of 1.0 of twice that."""
    base = case()
    plain = recording(base, points("static"), noise=0.0).values
    better = {**plain, "thrust_N": 1.6 * plain["thrust_N"], "torque_Nm": 0.5 * plain["torque_Nm"]}
    sizes = [
        np.exp(other_rotor.Another.of(build([from_series(Dataset("bench", "log", values), base)], [base]))[1].size)
        for values in (plain, better)
    ]
    assert sizes[0].min() < 0.9 < 1.5 < sizes[1].min() < sizes[1].max() == sizes[0].max()


def test_a_rotor_that_is_the_case_is_not_asked_for() -> None:
    assert other_rotor.finding(build([from_series(recording(case(), points("grid")), case())], [case()])) == ""


def test_repeats_that_differ_as_no_stand_does_name_nothing() -> None:
    """The neighbour's speed changes from row to row and is not recorded: its mean is no density and no gain."""
    base, given = case(), points("static")
    plain, rng = recording(base, given, noise=0.0), np.random.default_rng(1)
    values = {k: np.tile(v, 6) for k, v in plain.values.items() if k != "time_s"}
    values["thrust_N"] = values["thrust_N"] * rng.uniform(0.3, 1.0, values["rpm"].size)
    test = from_series(Dataset("bench", "map", values), base)
    reference = replace(from_series(plain, base), reference=True)
    answer = chain.diagnose([test, reference], [base])
    assert answer.decision.effects == () and any("not recorded" in f for f in answer.problem.findings)


def test_an_exact_relation_names_the_fault_that_the_loads_leave_open(tmp_path: Path) -> None:
    """Two counters of one shaft are 6/7 apart: a speed of 7/6 was called inconsistent and nothing was named."""
    rng = np.random.default_rng(0)
    n = np.linspace(65.0, 150.0, 12)
    T, Q = 0.105 * 1.2 * n**2 * 0.254**4, 0.0075 * 1.2 * n**2 * 0.254**5
    rows = zip(60.0 * n, 70.0 * n, *(v * (1.0 + 0.003 * rng.standard_normal(12)) for v in (T, Q)), strict=True)
    text = "".join(",".join(f"{x:.7g}" for x in row) + "\n" for row in rows)
    (tmp_path / "log.csv").write_text("electrical_rpm,optical_rpm,thrust_N,torque_Nm\n" + text, encoding="utf-8")
    known = load_case(CASES / "prop_10x5")
    said = chain.diagnose([load(str(tmp_path / "log.csv"), known)], [known]).said
    assert (said.verdict, said.effects) == ("sensor", ("rpm_scale",)) and "must be 1" in said.why


@pytest.mark.parametrize(("inch", "plan"), [(12.0, "grid"), (8.0, "static")])
def test_loads_of_another_size_are_no_slip_of_the_speed(inch: float, plan: str) -> None:
    """Two thirds of a speed fits twice the loads within the solver's error; a rotor of another size fits as well."""
    guess = case("prop_10x5")
    other = {"rotor.diameter_in": inch, "blade.pitch_in": 0.6 * inch}
    said = diagnose(recording(guess.replaced(other), points(plan, 0.254), noise=0.005), guess)
    assert not {"rpm_scale", "air_density"} & set(said.decision.effects), said.decision
    assert said.decision.verdict == "insufficient"
    assert said.found.probability[DOUBT] > 0.3


@pytest.mark.parametrize("pulse", [False, True])
def test_another_diameter_than_the_reference_has_is_another_propeller(pulse: bool) -> None:
    """Also where loads and drive are judged apart."""
    guess, given = case("prop_10x5"), points("grid", 0.254)
    other = guess.replaced({"rotor.diameter_in": 9.0, "blade.pitch_in": 4.5})
    runs = [recording(rotor, given, noise=0.005, seed=k) for k, rotor in enumerate((guess, other))]
    added = {"pwm_s": 1e-3 + 4e-8 * given["rpm"]} if pulse else {}
    runs = [replace(run, values={**run.values, **added}) for run in runs]
    records = [replace(from_series(run, guess), reference=k == 0) for k, run in enumerate(runs)]
    answer = chain.diagnose(records, [guess])
    said = (answer.loads or answer).decision
    assert said.verdict in ("named", "class")
    assert "propeller" in said.effects, said
    assert not {"pitch_offset", "section", "air_density"} & set(said.effects), said
    assert "diameter" in answer.next.text and not answer.parameters

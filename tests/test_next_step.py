"""Every verdict says what to do and type next."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest
from diagnosing import case, compressibility_missed, points, recording

import bemt
from bemt.base.errors import InputError
from bemt.judge import loss
from bemt.judge.diagnose import chain, knowledge, other_rotor, posterior, suggest
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.document import text
from bemt.judge.diagnose.problem import Part
from bemt.judge.diagnose.record import Record, from_series
from bemt.judge.explanation import NONE, UNKNOWN
from bemt.physics.dataset import Dataset
from bemt.rotors.latents import AsBuilt


def of(series: Dataset, reference: bool = False, findings: tuple[str, ...] = ()) -> Record:
    return replace(from_series(series, case()), reference=reference, findings=findings)


def told(*records: Record) -> chain.Diagnosis:
    return chain.diagnose(records, [case()])


def step(d: chain.Diagnosis) -> list[str]:
    """Lines from "Next:" on that say what to do and what to type."""
    lines = text(d).split("\n")
    first = next(i for i, line in enumerate(lines) if line.strip().startswith("Next: "))
    return [
        lines[first].strip(),
        *(line.strip() for line in lines[first:] if line.strip().startswith("bemt")),
    ]


REAL = AsBuilt(angle_deg=1.0, lift=-0.06, drag=0.2, camber_deg=0.5)


@pytest.fixture(scope="module")
def grid() -> dict[str, np.ndarray]:
    return points("grid")


def test_a_blade_as_far_off_as_real_ones_are_is_no_cause(grid: dict[str, np.ndarray]) -> None:
    said = told(of(recording(case(), grid, (REAL,))))
    assert said.decision.verdict in ("none", "insufficient")
    assert "Next: " in step(said)[0] and step(said)[1].startswith("bemt ")


def test_beside_a_reference_at_other_speeds_it_is_none_either(grid: dict[str, np.ndarray]) -> None:
    slow = grid["rpm"] < 14000.0
    known, test = ({k: v[rows] for k, v in grid.items()} for rows in (slow, ~slow))
    said = told(of(recording(case(), test, (REAL,), seed=1)), of(recording(case(), known, (REAL,)), reference=True))
    assert said.decision.verdict == "none"
    assert "no further run" in step(said)[0]


@pytest.fixture(scope="module")
def compared() -> chain.Diagnosis:
    return compressibility_missed()


def test_a_named_effect_has_a_step_and_a_command(compared: chain.Diagnosis) -> None:
    assert compared.decision.verdict == "named"
    assert len(step(compared)) > 1


def test_a_recording_that_contradicts_itself_is_mended_first(grid: dict[str, np.ndarray]) -> None:
    wrong = "log.csv: error: power_above_input (torque x speed): 1.5 times. Correction: unit or gain of the torque"
    problem = cast("chain.Problem", SimpleNamespace(findings=(wrong,), scatter={}, level={"thrust_N": 0.0}, parts=(),
                                                     other_setup=""))  # fmt: skip
    found = SimpleNamespace(problem=problem, probability={UNKNOWN: 0.98, NONE: 0.02})
    said = loss.decide(knowledge.combined(cast("posterior.Evidence", found)))
    assert said.verdict == "insufficient"
    assert "unit or gain of the torque" in other_rotor.to_mend(problem)


def test_the_loads_of_another_rotor_bring_the_question_first(grid: dict[str, np.ndarray]) -> None:
    series = recording(case(), grid)
    series = replace(
        series, values={**series.values, "thrust_N": 5.0 * series["thrust_N"], "torque_Nm": 7.0 * series["torque_Nm"]}
    )
    said = told(of(series))
    assert said.decision.verdict == "insufficient"
    assert "this rotor" in step(said)[0] and step(said)[1].startswith("bemt import")


def test_a_level_beside_a_reference_asks_for_the_weather_of_both_days() -> None:
    given = points("static")
    first = recording(case(), given)
    later = replace(first, values={**first.values, "thrust_N": 1.035 * first["thrust_N"]})
    said = told(
        *(replace(of(s, r).only(("thrust_N",)), air_recorded=False) for s, r in ((later, False), (first, True)))
    )
    assert said.decision.verdict in ("none", "insufficient")
    assert "temperature and pressure" in step(said)[0] and "--air-a" in step(said)[1]


@pytest.mark.parametrize(
    ("loads", "factor", "found", "words"),
    [
        (("thrust_N",), -1.0, "the other sign", "reverse the sign of thrust_N"),
        (("thrust_N", "torque_Nm"), -1.0, "the other sign", "reverse the sign of both loads"),
        (("thrust_N",), 1.0 / 9.80665, "kgf", "check the unit"),
    ],
)
def test_a_slip_of_unit_or_sign_is_put_right_without_a_run(
    loads: tuple[str, ...], factor: float, found: str, words: str
) -> None:
    series = recording(case(), points("static"))
    said = told(of(replace(series, values={**series.values, **{k: factor * series[k] for k in loads}})))
    assert (said.decision.verdict, said.decision.effects) == ("sensor", ("unit_slip",))
    assert said.parameters["unit_slip"]["unit"].value == found
    assert (said.next.kind, said.next.points) == ("look", ()) and words in step(said)[0]
    assert "tells" not in text(said) and "new_run" not in step(said)[1]


@pytest.mark.parametrize(
    ("now", "after", "odds", "kind", "lead"),
    [
        (15.1, 15.7, 0.5, "look", "cross_talk"), (15.1, 60.0, 0.5, "look", "cross_talk"),
        (2.5, 9.0, 0.5, "run", "cross_talk"), (2.5, 2.6, 0.5, "look", "cross_talk"),
        (7.6, 7.61, 0.001, "", "compressibility"), (7.6, 12.0, 0.001, "", "compressibility"),
        (7.6, 12.0, 0.5, "run", "compressibility"),
    ],
)  # fmt: skip
def test_a_run_is_recommended_where_it_is_worth_its_time(
    monkeypatch: pytest.MonkeyPatch, compared: chain.Diagnosis, now: float, after: float, odds: float, kind: str,
    lead: str,
) -> None:  # fmt: skip
    """Two explanations so far apart now and with a run; the second is that likely."""
    alone = len(compared.problem.parts[0].record)
    monkeypatch.setattr(suggest, "_options", lambda part, of=suggest._options: of(part)[:1])
    monkeypatch.setattr(
        suggest,
        "_distances",
        lambda plan, *_: (now if plan.covariates["rpm"].size == alone else after) * (1.0 - np.eye(2)),
    )
    rival = "hub_loss" if lead == "compressibility" else "rpm_scale"
    settings = {"rpm_scale": {"factor": 1.02, "eps": 0.0}}
    pair = [suggest.Rival(lead, {}, 1.0 - odds), suggest.Rival(rival, settings.get(rival, {}), odds)]
    chosen = suggest.suggest(compared.found, pair)
    assert chosen.kind == kind
    if kind == "run":
        assert chosen.separates == (lead, rival) and chosen.points and 0.0 < chosen.gain <= 1.0
    else:
        assert not chosen.separates and not chosen.points


def test_the_unknown_asks_for_a_reference_and_a_cheap_run_goes_before_a_dear_one(
    monkeypatch: pytest.MonkeyPatch, compared: chain.Diagnosis
) -> None:
    """Where a run and a reference tell as much, the shorter one is chosen, unless nothing listed may be at work."""
    record = replace(compared.problem.parts[0].record, reference=False)
    problem = suggest.assemble((replace(compared.problem.parts[0], record=record),))
    alone = problem.y.size
    monkeypatch.setattr(suggest, "_options", lambda part, of=suggest._options: of(part)[:1])
    monkeypatch.setattr(suggest, "_check", lambda *_: "")
    monkeypatch.setattr(
        suggest, "_distances", lambda plan, *_: (2.0 if plan.y.size == alone else 9.0) * (1.0 - np.eye(2))
    )
    found = replace(compared.found, problem=problem)
    pair = [suggest.Rival("compressibility", {}, 0.5), suggest.Rival("hub_loss", {}, 0.5)]
    assert suggest.suggest(found, pair, 0.0, reference=True).kind == "run"
    assert suggest.suggest(found, pair, 99.0, reference=True).kind == "reference"


def asked(part: Part) -> str:
    return "; ".join(o.text for o in suggest._options(part))


def test_a_bench_is_not_asked_for_wind_nor_a_tunnel_to_open_a_door(compared: chain.Diagnosis) -> None:
    tunnel = compared.problem.parts[0]
    bench = replace(tunnel, flow=replace(tunnel.flow, V=np.zeros_like(tunnel.flow.V)))
    assert "in wind" in asked(tunnel) and "in wind" not in asked(bench)
    flown = replace(tunnel.record, V=np.maximum(tunnel.record.V, 1.0))
    still = replace(tunnel.record, V=np.zeros_like(tunnel.record.V))
    assert "door" in suggest._check("recirculation", still) and not suggest._check("recirculation", flown)


def test_a_repeat_is_weighed_by_the_readings_as_they_would_be_after_it(compared: chain.Diagnosis) -> None:
    """Each repeat tells less than the one before, and where it tells too little nobody is asked for it."""
    pair = [suggest.Rival("compressibility", {}, 0.5), suggest.Rival("", {}, 0.5)]
    of = [None if not r.effect else suggest.effect_of(r.effect, dict(r.settings)) for r in pair]
    plan, hyper = suggest.assemble(compared.problem.parts[:1]), compared.found.states[0].hyper
    told = [suggest._distances(plan, of, hyper)[0, 1]]
    for _ in range(3):
        repeat = suggest._options(plan.parts[0])[-1]
        assert "once more" in repeat.text and repeat.rpm.size == len(compared.problem.parts[0].record)
        plan = suggest._extended(plan, repeat)
        told.append(suggest._distances(plan, of, hyper)[0, 1])
    steps = np.diff(told)
    assert np.all(steps > 0.0) and steps[2] < steps[1] < steps[0]


def test_a_plan_goes_on_without_a_channel_that_has_no_reading(grid: dict[str, np.ndarray]) -> None:
    """A torque that is empty in the file: no run would read it, and its noise is nobody's median."""
    series = recording(case(), grid)
    record = replace(of(series), measured={**of(series).measured, "torque_Nm": np.full(len(series), np.nan)})
    plan = build([record], [case()])
    more = suggest._extended(plan, suggest._options(plan.parts[0])[-1])
    assert more.y.size > plan.y.size and {*more.channel} == {*plan.channel}
    assert np.isfinite(more.u).all()


@pytest.mark.parametrize("checks", ["", "rpm_scale"])
def test_the_next_command_is_not_the_one_that_was_just_typed(checks: str) -> None:
    given = suggest.Given(("b.csv",), ("a.csv",), "--case 10x5", ruled_out=("thrust_zero",))
    found = chain._commands(suggest.Suggestion("look at it", "look", checks=checks), given)
    assert given.command() not in found and len(found) == bool(checks)


def test_loads_without_a_number_are_said_to_have_none() -> None:
    nan = np.full(5, np.nan)
    table = pd.DataFrame({"rpm": np.linspace(3e3, 6e3, 5), "thrust_N": nan, "torque_Nm": nan})
    with pytest.raises(InputError, match="no number in any row") as refused:
        bemt.diagnose(table, "10x5")
    assert "thrust_N and torque_Nm" in str(refused.value) and "expected a thrust" not in str(refused.value)


def test_no_repeat_is_asked_for_that_tells_nothing(monkeypatch: pytest.MonkeyPatch, compared: chain.Diagnosis) -> None:
    monkeypatch.setattr(suggest, "_distances", lambda *_: 0.5 * (1.0 - np.eye(2)))
    monkeypatch.setattr(suggest, "_check", lambda *_: "")
    pair = [suggest.Rival("compressibility", {}, 0.5), suggest.Rival("hub_loss", {}, 0.5)]
    chosen = suggest.suggest(compared.found, pair)
    assert (chosen.kind, chosen.points) == ("", ()) and "once more would not" in chosen.text


@pytest.mark.parametrize("factor", [1.5, 0.7])
def test_a_wider_blade_is_among_the_rotors_that_fit_the_loads(grid: dict[str, np.ndarray], factor: float) -> None:
    wide = recording(case(), grid, (other_rotor._Chord(factor),))
    problem = build([of(wide)], [case()])
    assert f"chord {100.0 * (factor - 1.0):+.0f} %" in other_rotor.nearest_rotors(problem)


@pytest.mark.parametrize(("top", "faster"), [(np.inf, True), (1.02, False)])
def test_no_run_is_asked_for_beyond_what_the_stand_may_do(compared: chain.Diagnosis, top: float, faster: bool) -> None:
    part = compared.problem.parts[0]
    record = replace(part.record, top_rpm=top * float(part.record.rpm.max()))
    flow = SimpleNamespace(R=part.flow.R, J=part.flow.J, M_tip=np.array([0.3]), ducted=False)
    runs = [option.rpm.max() for option in suggest._options(SimpleNamespace(record=record, flow=flow))]
    assert bool(max(runs) > 1.02 * record.rpm.max()) is faster


@pytest.mark.parametrize(("torque", "first"), [(True, "hang dead weights on the cell"), (False, "read barometer")])
def test_a_low_thrust_without_a_reference_does_not_begin_with_the_blades(torque: bool, first: str) -> None:
    """Anybody at the stand would see cut blades: the cell and the air are looked at."""
    d = bemt.propeller("10x5").solve(rpm=[4000, 5000, 6000, 7000, 8000, 9000])
    frame = {"rpm": d.rpm, "thrust_N": 0.7 * d.thrust_N} | ({"torque_Nm": d.torque_Nm} if torque else {})
    text = bemt.diagnose(pd.DataFrame(frame), "10x5", figures=False).text
    _, said = " ".join(text.split()).split("without such a reference: ")
    assert first in said and "measure the diameter" not in said

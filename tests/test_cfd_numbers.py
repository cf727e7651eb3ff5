"""Numbers of CFD: whole revolutions, grid order and index, what stays unknown."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bemt.base.averaging import keep_last, relation, revolution_average, steady_average, time_steps
from bemt.base.errors import InputError
from bemt.base.tables import json_text
from bemt.data.recordings import audit as au
from bemt.data.recordings.audit import STATUSES, Audit, AuditLine, CfdFacts, audit, combined, facts_of, setup_in
from bemt.data.recordings.grid_study import grid_study, ratios


@settings(max_examples=60, deadline=None)
@given(
    st.floats(0.01, 10.0), st.integers(40, 400), st.integers(1, 6), st.integers(1, 5), st.floats(0, 6.28),
    st.floats(1.0, 3.0),
)  # fmt: skip
def test_a_periodic_load_has_its_mean_whatever_the_step(
    period: float, per_turn: int, turns: int, harmonic: int, phase: float, change: float
) -> None:
    steps = np.full(per_turn * (turns + 2), period / per_turn)
    steps[: len(steps) // 3] *= 1.0 + 0.3 * (change - 1.0)  # another step at first
    t = np.cumsum(steps)
    value = 7.0 + 2.0 * np.sin(2.0 * np.pi * harmonic * t / period + phase)
    average = revolution_average(t, value, period, turns)
    assert average.mean == pytest.approx(7.0, abs=2.0 * 3 * harmonic / per_turn / turns)
    assert average.revolutions == turns and average.end == t[-1]
    assert average.start == pytest.approx(t[-1] - turns * period)


def test_a_step_that_changes_inside_the_window_weighs_by_time() -> None:
    dt = np.concatenate([np.full(100, 0.01), np.full(500, 0.002)])  # 1 s each, the second with five times the rows
    t = np.cumsum(dt)
    value = np.where(t < 1.0 + 1e-9, 1.0, 3.0)
    average = revolution_average(t, value, 1.0, 2)
    assert average.mean == pytest.approx(2.0, abs=1e-12) and np.mean(value) > 2.6
    assert average.per_revolution == pytest.approx((1.0, 3.0)) and average.drift == pytest.approx(1.0)


def test_the_incomplete_revolution_and_the_start_up_are_dropped() -> None:
    t = np.arange(1, 976) * 0.01  # 9.75 s of 1 s
    value = np.where(t <= 5.75 + 1e-9, 1e6, 4.0)
    average = revolution_average(t, value, 1.0)
    assert average.revolutions == 4 and average.rows == 400 and average.mean == pytest.approx(4.0)
    assert revolution_average(t, value, 1.0, 5).mean == pytest.approx((4 * 4.0 + 1e6) / 5)


def test_a_revolution_need_not_be_a_whole_number_of_steps() -> None:
    t = 0.001923 * np.arange(1, 2000)
    average = revolution_average(t, np.ones_like(t), 239.6 * 0.001923, 1)
    assert average.rows == 240 and average.mean == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("n", "period", "want", "problem"),
    [
        (50, 1.0, None, "0.5 revolutions recorded, 1 wanted"),
        (300, 1.0, 4, "3 revolutions recorded, 4 wanted"),
        (300, 0.05, None, "5 rows in a revolution"),
        (1, 1.0, None, "no revolution"),
    ],
)
def test_no_mean_without_revolutions(n: int, period: float, want: int | None, problem: str) -> None:
    average = revolution_average(0.01 * np.arange(1, n + 1), np.ones(n), period, want)
    assert average.mean is None and problem in average.problem


def test_gaps_and_nan_in_the_window_are_no_mean() -> None:
    t = 0.01 * np.arange(1, 401)
    value = np.ones(400)
    value[10] = np.nan
    assert revolution_average(t, value, 1.0, 2).mean == 1.0  # before the window
    value[300] = np.nan
    assert revolution_average(t, value, 1.0, 2).problem == "NaN in the averaged part"
    keep = np.r_[0:250, 280:400]
    assert "a gap of 0.31 s" in revolution_average(t[keep], np.ones(370), 1.0, 2).problem
    far = np.append(t[:-1], 4000.0)  # a damaged last time
    assert revolution_average(far, np.ones(400), 1.0, 2).mean is None


def test_few_rows_are_doubtful() -> None:
    average = revolution_average(0.05 * np.arange(1, 101), np.ones(100), 1.0)
    assert average.mean == 1.0 and average.problem == "only 20 rows in a revolution"


@pytest.mark.parametrize(
    ("time", "period", "turns", "message"),
    [
        ([1.0, 2.0], 0.0, None, "period"), ([1.0, 2.0], math.nan, None, "period"),
        ([1.0, 2.0], 1.0, 0, "revolutions"), ([2.0, 1.0], 1.0, None, "do not ascend"),
        ([1.0, 1.0], 1.0, None, "do not ascend"), ([1.0, math.inf], 1.0, None, "do not ascend"),
        ([1.0], 1.0, None, "shape"),
    ],
)  # fmt: skip
def test_wrong_arguments(time: list[float], period: float, turns: int | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        revolution_average(time, [1.0, 1.0], period, turns)


def test_steady_drift_is_that_of_the_trend_not_of_the_noise() -> None:
    noise = 0.05 * np.cos(np.arange(1000) * 2.4)
    assert abs(steady_average(5.0 + noise).drift or 1.0) < 1e-3
    moving = steady_average(5.0 + noise + 0.001 * np.arange(1000))
    assert moving.drift == pytest.approx(0.2 / 5.9, rel=0.02) and moving.rows == 200
    turned = steady_average(-5.0 - noise - 0.001 * np.arange(1000))  # grows in size all the same
    assert (turned.drift, turned.spread) == (moving.drift, moving.spread)
    assert steady_average([]).mean is None and steady_average([1e308, 1e308, -1e308]).mean == pytest.approx(1e308 / 3)
    assert steady_average([1.0, np.nan]).mean is None and steady_average([0.0] * 5).drift is None


@settings(max_examples=200, deadline=None)
@given(st.lists(st.one_of(st.integers(0, 30).map(float), st.just(math.nan)), max_size=40))
def test_what_is_kept_always_ascends_and_is_the_last_of_its_step(clock: list[float]) -> None:
    index, notes = keep_last(clock)
    kept = np.asarray(clock)[index]
    assert np.all(np.diff(kept) > 0) and len(set(index.tolist())) == len(index)
    if len(index) < len(clock):
        assert notes
    for i in index:
        if i + 1 < len(clock) and clock[i + 1] == clock[i]:
            raise AssertionError("an earlier one of two equal rows was kept")


def test_a_restart_gives_up_the_branch_and_one_stray_row_does_not() -> None:
    index, notes = keep_last([1, 2, 3, 4, 5, 6, 3, 4], "Time Step")
    assert index.tolist() == [0, 1, 6, 7] and "restart: Time Step goes back from 6 to 3" in notes[0]
    clock = np.arange(100.0)
    clock[60] = 6.0
    index, notes = keep_last(clock)
    assert len(index) == 99 and "1 row with step out of order left out" in notes


def test_time_steps() -> None:
    np.testing.assert_allclose(time_steps([0.5, 1.0, 1.5]), 0.5)
    assert time_steps([0.0, 1.0]).tolist() == [0.0, 1.0] and time_steps([3.0]).tolist() == [1.0]


def test_restart_files_with_another_clock_are_told_apart() -> None:
    s, t = np.arange(1, 50), 0.001923 * np.arange(1, 50)
    assert relation((s, t), (s[:30], 0.0005 * s[:30])) == "other clock"
    assert relation((s, t), (s + 49, t + t[-1])) == "continues"
    assert relation((s, t), (s + 20, t + t[19])) == "overlaps"
    assert relation((s, t), (s + 20, t)) == "other clock"
    assert relation((s, t), (s + 49, t + 100.0)) == "other clock"
    assert relation((s, t), ([], [])) == "other clock"


def test_the_published_screw(shared_data: Path) -> None:
    path = shared_data / "cfd_exports" / "screw" / "report-def-0-rfile_1_1.out"
    _, torque, time = np.loadtxt(path, skiprows=3).T
    period = 239.6 * 0.001923
    assert f"{revolution_average(time, torque, period, 4).mean:.5f}" == "-0.17547"
    assert f"{revolution_average(time, torque, period, 1).mean:.5f}" == "-0.17097"
    assert f"{steady_average(torque, 1.0).mean:.5f}" == "-0.14100"
    assert revolution_average(time, torque, period).revolutions == 4


# Grid studies: order, extrapolation and index of published values; what is implausible is flagged.


def test_published_value() -> None:
    s = grid_study([0.97050, 0.96854, 0.96178], [2.0, 2.0])
    assert f"{s.order:.4f}" == "1.7862" and f"{s.extrapolated:.5f}" == "0.97130"
    assert f"{s.gci_fine:.4%}" == "0.1031%" and f"{s.gci_coarse:.4%}" == "0.3562%"
    assert s.flags == () and s.asymptotic == pytest.approx(1.0, abs=0.005)


def test_celik_example_with_unequal_ratios() -> None:
    """Celik et al. 2008, table 1, first column: N = 18000, 8000, 4500 in two dimensions; p = 1.53, GCI 2.2 %."""
    s = grid_study([6.063, 5.972, 5.863], [1.5, 4.0 / 3.0])
    assert s.order == pytest.approx(1.53, abs=0.01) and s.extrapolated == pytest.approx(6.1685, abs=5e-4)
    assert s.gci_fine == pytest.approx(0.022, abs=5e-4)


@settings(max_examples=150, deadline=None)
@given(
    st.floats(0.6, 2.9), st.floats(1.3, 3.0), st.floats(1.3, 3.0), st.floats(0.1, 100.0), st.floats(-0.05, 0.05),
    st.sampled_from((1.0, -1.0)),
)  # fmt: skip
def test_exact_power_laws_come_back(p: float, r21: float, r32: float, f0: float, c: float, sign: float) -> None:
    assume(abs(c) > 1e-4)
    values = [sign * f0 * (1.0 + c * h**p) for h in (1.0, r21, r21 * r32)]
    assume(abs(values[2] / values[0]) > 0.1)
    s = grid_study(values, [r21, r32])
    assert s.order == pytest.approx(p, rel=1e-5) and s.extrapolated == pytest.approx(sign * f0, rel=1e-5)
    assert s.flags == () and s.gci_fine == pytest.approx(1.25 * abs(c / (1.0 + c)), rel=1e-4)
    assert s.u_relative == pytest.approx(s.gci_fine / 1.15)


def test_two_grids_assume_the_order_and_pay_for_it() -> None:
    s = grid_study([10.0, 9.0], [2.0])
    assert s.gci_fine == pytest.approx(3.0 * 0.1 / 3.0) and s.order == 2.0 and s.gci_coarse is None
    assert s.flags == ("two grids: order 2 is assumed",)


@pytest.mark.parametrize(
    ("values", "r", "flag"),
    [
        ([1.0, 1.1, 1.05], [2, 2], "oscillatory"), ([1.0, 1.1, 1.15], [2, 2], "divergent"),
        ([1.0, 1.001, 1.2], [2, 2], "implausible order 7.6"), ([1.0, 1.1, 1.21], [2, 2], "implausible order 0.1"),
        ([1.0, 1.0, 1.1], [2, 2], "agree exactly"), ([1.0, 1.1, 1.1], [2, 2], "agree exactly"),
        ([1.0, 1.001, 1.0025], [1.2, 1.2], "ratio 1.2 below 1.3"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_flagged_and_costs_uncertainty(values: list[float], r: list[float], flag: str) -> None:
    s = grid_study(values, r)
    assert any(flag in text for text in s.flags), s.flags
    if "ratio" not in flag:
        assert s.u_relative >= 3.0 * (max(values) - min(values)) / values[0] / 1.15 - 1e-12
    if s.order is None:
        assert s.gci_fine is None and s.extrapolated is None


@pytest.mark.parametrize(
    ("values", "r", "message"),
    [
        ([1.0, 2.0, 3.0], [2.0, 0.5], "List the finest grid first"), ([0.0, 2.0], [2.0], "other than zero"),
        ([1.0, math.nan], [2.0], "finite values"), ([1.0, 2.0], [1.0], "numbers above 1"),
    ],
)  # fmt: skip
def test_wrong_input(values: list[float], r: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        grid_study(values, r)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.floats(-1e300, 1e300).filter(bool), min_size=2, max_size=3),
    st.floats(1.0001, 100),
    st.floats(1.0001, 100),
)
def test_any_finite_values_give_a_study(values: list[float], r21: float, r32: float) -> None:
    s = grid_study(values, [r21, r32][: len(values) - 1])
    assert s.u_relative >= 0.0 and not math.isnan(s.u_relative)


# Promise: every setting of a CFD run becomes a line with a consequence, and what nobody stated stays unknown.


TOPICS = [
    "domain against disk", "compressibility against tip Mach", "grid study", "iterative drift",
    "balance of mass and momentum", "wall treatment against y+", "turbulence model", "where the thrust was read",
    "frozen rotor against inflow",
]  # fmt: skip
GOOD = CfdFacts(
    M_tip=0.625, J=0.0, pitch_over_D=0.625, CT=0.1, domain_over_D=5.0, compressible=True, grids=3, u_grid=0.012,
    cells=847e3, drift=0.002, mass_balance=-0.001, momentum_balance=0.003, wall="automatic", y_plus=51.0,
    turbulence="k-omega SST", thrust_from="forces", steady_mrf=True,
)  # fmt: skip
THESIS = (
    "Fluent; rotating cell zone in a cylinder of the propeller's diameter, realizable k-epsilon with scalable wall "
    "functions; thrust read at one node; no mesh count and no grid study"
)


def line(facts: CfdFacts, topic: str) -> AuditLine:
    return next(item for item in audit(facts) if item.topic == topic)


@pytest.mark.parametrize("facts", [CfdFacts(), GOOD, replace(GOOD, ducted=True), facts_of(setup_in(THESIS).get, False)])
def test_every_audit_has_every_topic_once(facts: CfdFacts) -> None:
    lines = audit(facts)
    assert [item.topic for item in lines] == TOPICS
    for item in lines:
        assert item.status in STATUSES and item.finding and item.consequence
        assert math.isnan(item.u_relative) or 0.0 <= item.u_relative < 1.0


def test_nothing_stated_is_all_unknown() -> None:
    lines = audit(CfdFacts(steady_mrf=None))
    assert {item.status for item in lines} == {"not stated"}
    assert all(math.isnan(item.u_relative) for item in lines)
    whole, known = combined(lines)
    assert math.isnan(whole) and known == 0.0


def test_a_run_with_everything_known_has_a_number() -> None:
    lines = audit(GOOD)
    assert {item.status for item in lines} == {"fine"}
    whole, known = combined(lines)
    parts = [item.u_relative for item in lines]
    assert whole == known == pytest.approx(math.sqrt(sum(p * p for p in parts)))
    assert whole > max(0.012, 0.002, au.TURBULENCE)


def test_the_thesis_is_found_out() -> None:
    facts = facts_of(setup_in(THESIS).get, False, M_tip=0.625, pitch_over_D=0.625, CT=0.11)
    assert (facts.domain_over_D, facts.grids, facts.thrust_from) == (1.0, 0, "node")
    assert (facts.wall, facts.turbulence, facts.steady_mrf) == ("scalable", "realizable k-epsilon", True)
    assert facts.compressible is None, "the thesis does not say"
    faults = {item.topic for item in audit(facts) if item.status == "fault"}
    assert faults == {"domain against disk", "grid study", "where the thrust was read"}
    assert math.isnan(combined(audit(facts))[0])


@pytest.mark.parametrize(
    ("compressible", "M", "status", "u"),
    [
        (True, 1.09, "fine", 0.0), (False, 0.2, "fine", 0.063 * (0.2 / 0.625) ** 2),
        (False, 0.45, "doubtful", 0.063 * (0.45 / 0.625) ** 2), (False, 0.625, "fault", 0.063),
        (False, 0.94, "fault", math.nan), (None, 0.625, "not stated", 0.063 / math.sqrt(3)),
        (None, 0.94, "not stated", math.nan), (None, 0.2, "fine", 0.063 * (0.2 / 0.625) ** 2),
    ],
)  # fmt: skip
def test_compressibility_follows_the_tip_mach_number(
    compressible: bool | None, M: float, status: str, u: float
) -> None:
    item = line(replace(GOOD, compressible=compressible, M_tip=M), TOPICS[1])
    assert item.status == status
    assert item.u_relative == pytest.approx(u, nan_ok=True)


def test_blockage_falls_with_the_square_of_the_domain_and_flight_joins_rest() -> None:
    at = {size: line(replace(GOOD, domain_over_D=size), TOPICS[0]).u_relative for size in (3.0, 6.0, 12.0)}
    assert at[3.0] / at[6.0] == pytest.approx(4.0) and at[6.0] / at[12.0] == pytest.approx(4.0)
    slow = line(replace(GOOD, J=1e-6), TOPICS[0]).u_relative
    assert slow == pytest.approx(line(GOOD, TOPICS[0]).u_relative, rel=1e-4), "the limit at rest"
    # static, by hand: J off by a/(2 sqrt 2) sqrt(4 CT / pi), over J0 = 1.19 P/D
    by_hand = (1 / 25) / (2 * math.sqrt(2)) * math.sqrt(0.4 / math.pi) / (1.19 * 0.625)
    assert line(GOOD, TOPICS[0]).u_relative == pytest.approx(by_hand)


@pytest.mark.parametrize("size", [1.0, 1.3, 1.9])
def test_no_number_is_made_up_where_the_correction_does_not_hold(size: float) -> None:
    assert math.isnan(line(replace(GOOD, domain_over_D=size), TOPICS[0]).u_relative)


@pytest.mark.parametrize(
    ("wall", "y_plus", "status"),
    [
        ("function", 60.0, "fine"), ("function", 12.0, "doubtful"), ("scalable", 400.0, "fault"),
        ("automatic", 2.0, "fine"), ("automatic", 16.0, "doubtful"), ("resolved", 0.8, "fine"),
        ("resolved", 25.0, "fault"), ("", 50.0, "not stated"), ("function", math.nan, "not stated"),
    ],
)  # fmt: skip
def test_wall_treatment_goes_with_its_first_cell(wall: str, y_plus: float, status: str) -> None:
    assert line(replace(GOOD, wall=wall, y_plus=y_plus), TOPICS[5]).status == status


@pytest.mark.parametrize(
    ("skew", "steady", "status"), [(0.0, True, "fine"), (30.0, True, "fault"), (30.0, False, "fine")]
)
def test_a_frozen_rotor_does_not_see_skewed_inflow(skew: float, steady: bool, status: str) -> None:
    assert line(replace(GOOD, skew_deg=skew, steady_mrf=steady), TOPICS[8]).status == status


@pytest.mark.parametrize(
    ("mass", "momentum", "status", "u"),
    [
        (0.001, -0.004, "fine", 0.004), (0.11, 0.001, "fault", math.nan), (0.001, -0.13, "fault", math.nan),
        (math.nan, 0.13, "fault", math.nan), (0.001, math.nan, "not stated", math.nan),
        (math.nan, math.nan, "not stated", math.nan),
    ],
)  # fmt: skip
def test_a_flow_that_does_not_balance_is_a_fault(mass: float, momentum: float, status: str, u: float) -> None:
    item = line(replace(GOOD, mass_balance=mass, momentum_balance=momentum), TOPICS[4])
    assert item.status == status and item.u_relative == pytest.approx(u, nan_ok=True)


def test_incompressible_flow_at_a_moderate_tip_mach_number_is_no_fault_in_a_duct_either() -> None:
    low, fast = (line(replace(GOOD, ducted=True, compressible=False, M_tip=M), TOPICS[1]) for M in (0.33, 0.6))
    assert low.status == "doubtful" and "1.8%" in low.consequence and math.isnan(low.u_relative)
    assert fast.status == "fault" and "no rule measured for ducted rotors" in fast.consequence


def test_drift_and_grid_are_taken_as_they_are() -> None:
    assert line(replace(GOOD, drift=-0.03), TOPICS[3]) == replace(
        line(replace(GOOD, drift=0.03), TOPICS[3]), finding="thrust drifts by -3.00% over the averaged part"
    )
    assert line(replace(GOOD, drift=0.03), TOPICS[3]).u_relative == 0.03
    assert line(replace(GOOD, u_grid=0.05), TOPICS[2]).status == "doubtful"
    assert line(replace(GOOD, u_grid=math.nan, grids=None), TOPICS[2]).status == "not stated"


def test_rules_of_an_open_propeller_are_not_used_for_a_duct() -> None:
    ducted = replace(GOOD, ducted=True, compressible=False, y_plus=12.0)
    for topic in (TOPICS[0], TOPICS[1], TOPICS[5], TOPICS[6]):
        assert math.isnan(line(ducted, topic).u_relative), topic


@pytest.mark.parametrize(
    ("stated", "field", "value"),
    [
        ({"solver": "incompressible"}, "compressible", False), ({"drift_thrust": 0.004}, "drift", 0.004),
        ({"balance_mass": 0.002}, "mass_balance", 0.002), ({"balance_momentum": 0.12}, "momentum_balance", 0.12),
        ({"domain": "free"}, "domain_over_D", 5.0), ({"cells": 249000.0}, "cells", 249000.0),
        ({"yplus_avg": 51.0}, "y_plus", 51.0), ({"sideslip_deg": 30.0}, "skew_deg", 30.0),
        (setup_in("sliding mesh"), "steady_mrf", False), (setup_in("compressible"), "compressible", True),
    ],
)  # fmt: skip
def test_what_a_run_states_becomes_its_facts(stated: dict[str, object], field: str, value: object) -> None:
    assert getattr(facts_of(stated.get, False), field) == value


def test_other_words_say_nothing() -> None:
    assert setup_in("a nice picture; ran on Tuesday; the propeller is 8 in") == {}


@pytest.mark.parametrize("CT", [0.11, math.nan])
def test_a_recorded_value_is_audited_by_its_remark(CT: float) -> None:
    facts = facts_of(setup_in(THESIS).get, False, M_tip=0.63, J=0.0, pitch_over_D=0.625, CT=CT, ducted=False)
    found = Audit.of("cfd 2.6 kgf", facts)
    assert found.reference == "cfd 2.6 kgf" and [line.topic for line in found.lines] == TOPICS
    assert Audit.from_document(json.loads(json_text(found.document()))).lines[0].status == found.lines[0].status


def test_the_uncertainty_does_not_jump_where_an_order_passes_the_limit() -> None:
    """Torque of three grids: u rose from 0.5 to 7.4 % as the coarse value moved by one in a thousand."""
    coarse = np.linspace(0.0935, 0.0960, 101)
    found = [grid_study([0.0914, 0.0921, c], ratios([7.6e6, 2.9e6, 1.1e6])) for c in coarse]
    orders, u = np.array([s.order for s in found]), np.array([s.u_relative for s in found])
    assert orders.min() < 3.0 < orders.max() and np.abs(np.diff(u)).max() < 0.003

"""The promise of averages: whole revolutions by time, honest drift, later rows win, clocks are never mixed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt.base.averaging import keep_last, relation, revolution_average, steady_average, time_steps
from bemt.base.errors import InputError


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
        ([1.0, 2.0], 0.0, None, "period"),
        ([1.0, 2.0], math.nan, None, "period"),
        ([1.0, 2.0], 1.0, 0, "revolutions"),
        ([2.0, 1.0], 1.0, None, "do not ascend"),
        ([1.0, 1.0], 1.0, None, "do not ascend"),
        ([1.0, math.inf], 1.0, None, "do not ascend"),
        ([1.0], 1.0, None, "shape"),
    ],
)
def test_wrong_arguments(time: list[float], period: float, turns: int | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        revolution_average(time, [1.0, 1.0], period, turns)


def test_steady_drift_is_that_of_the_trend_not_of_the_noise() -> None:
    noise = 0.05 * np.cos(np.arange(1000) * 2.4)
    assert abs(steady_average(5.0 + noise).drift or 1.0) < 1e-3
    moving = steady_average(5.0 + noise + 0.001 * np.arange(1000))
    assert moving.drift == pytest.approx(0.2 / 5.9, rel=0.02) and moving.rows == 200
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
    assert len(index) == 99 and "1 rows with step out of order left out" in notes


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

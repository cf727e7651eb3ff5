"""Plateaus: known steps are found where they are, with their means, and every row is accounted for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt import readers as importers
from bemt.base.errors import InputError
from bemt.recordings.plateaus import Plateaus, find, standard_error

RATE = 50.0


def staircase(
    levels: list[float], seconds: float = 3.0, noise: float = 0.01, tau: float = 0.1, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, command and first-order response with white noise."""
    rng = np.random.default_rng(seed)
    command = np.repeat(levels, int(seconds * RATE))
    out = np.empty(len(command))
    state = levels[0]
    for k, goal in enumerate(command):
        state += (goal - state) * (1 - math.exp(-1 / (RATE * tau)))
        out[k] = state
    return np.arange(len(command)) / RATE, command, out + noise * rng.standard_normal(len(command))


def accounted(got: Plateaus) -> bool:
    """Every row once: in a plateau or in what was dropped."""
    rows = np.zeros(got.rows, dtype=int)
    for part in (*got.plateaus, *got.dropped):
        rows[part.start : part.stop] += 1
    return bool(np.all(rows == 1))


@pytest.mark.parametrize("with_command", [True, False])
def test_known_steps_are_found_with_their_means(with_command: bool) -> None:
    levels = [0.0, 1.0, 2.0, 4.0, 3.0, 1.5, 0.0]
    t, command, thrust = staircase(levels)
    got = find(t, {"thrust_N": thrust}, "thrust_N", command if with_command else None)
    assert len(got.plateaus) == len(levels) and accounted(got)
    assert np.allclose(got.channel("thrust_N"), levels, atol=0.008)
    assert [p.direction for p in got.plateaus] == ["first", "up", "up", "up", "down", "down", "down"]
    assert all(abs(p.sd["thrust_N"] - 0.01) < 0.004 for p in got.plateaus)
    # the truth lies within four standard errors and what is left of the settling
    for p, goal in zip(got.plateaus, levels, strict=True):
        assert abs(p.mean["thrust_N"] - goal) < 4 * p.u["thrust_N"] + 0.002
    assert len(got.direction("up")) == 4 and len(got.direction("down")) == 3


def test_settling_is_cut_and_reported() -> None:
    t, command, thrust = staircase([0.0, 5.0], seconds=6.0, tau=0.5, noise=0.005)
    got = find(t, {"thrust_N": thrust}, "thrust_N", command)
    second = got.plateaus[1]
    cut = next(d for d in got.dropped if d.reason == "settling" and d.stop == second.start)
    assert 1.5 < (cut.stop - cut.start) / RATE < 3.5  # 5 exp(-t/0.5) is below 1 % of 5 N from 2.3 s on
    assert abs(second.mean["thrust_N"] - 5.0) < 0.02


def test_hysteresis_stays_visible() -> None:
    t, command, thrust = staircase([1.0, 2.0, 3.0, 2.0, 1.0])
    warm = thrust - 0.1 * (np.arange(len(t)) >= 3 * 150)  # loses thrust on the way down
    got = find(t, {"thrust_N": warm}, "thrust_N", command)
    up, down = ({p.command: p.mean["thrust_N"] for p in got.direction(way)} for way in ("up", "down"))
    assert up[2.0] - down[2.0] == pytest.approx(0.1, abs=0.01)


def test_outliers_are_dropped_by_channel_and_named() -> None:
    t, command, thrust = staircase([1.0, 2.0])
    spiked = thrust.copy()
    spiked[[60, 220]] = 50.0, -50.0
    got = find(t, {"thrust_N": spiked, "torque_Nm": thrust}, "thrust_N", command)
    assert [p.outliers for p in got.plateaus] == [{"thrust_N": (60,)}, {"thrust_N": (220,)}]
    assert np.allclose(got.channel("thrust_N"), [1.0, 2.0], atol=0.01)
    assert got.plateaus[0].n["torque_Nm"] == got.plateaus[0].n["thrust_N"] + 1


def test_a_ramp_is_no_plateau() -> None:
    t = np.arange(400) / RATE
    ramp = np.clip(t - 2.0, 0.0, 4.0)
    noisy = ramp + 0.002 * np.random.default_rng(1).standard_normal(400)
    by_command = find(t, {"thrust_N": noisy}, "thrust_N", ramp)
    assert [p.mean["thrust_N"] for p in by_command.plateaus] == pytest.approx([0.0, 4.0], abs=0.01)
    assert any(d.reason == "the command changes" and d.stop - d.start > 150 for d in by_command.dropped)
    by_signal = find(t, {"thrust_N": noisy}, "thrust_N")
    steady = [p for p in by_signal.plateaus if not p.flags]
    assert [p.mean["thrust_N"] for p in steady] == pytest.approx([0.0, 4.0], abs=0.02)
    assert accounted(by_command) and accounted(by_signal)


def test_a_level_that_drifts_is_flagged() -> None:
    t, command, thrust = staircase([1.0, 2.0])
    got = find(t, {"thrust_N": thrust + 0.05 * t}, "thrust_N", command)
    assert all("drifts" in p.flags or "not settled" in p.flags for p in got.plateaus)
    assert not any(p.flags for p in find(t, {"thrust_N": thrust}, "thrust_N", command).plateaus)


def test_sparse_channels_keep_their_own_samples() -> None:
    t, command, thrust = staircase([1.0, 2.0, 3.0])
    sparse = np.where(np.arange(len(t)) % 6 == 0, thrust, np.nan)
    got = find(t, {"thrust_N": sparse, "rpm": 1000.0 * thrust}, "thrust_N", command)
    assert len(got.plateaus) == 3 and accounted(got)
    assert all(p.n["rpm"] > 4 * p.n["thrust_N"] for p in got.plateaus)


def test_rows_whose_time_falls_are_left_out_and_noted() -> None:
    t, command, thrust = staircase([1.0, 2.0])
    t[40] = -3.0
    thrust[40] = 1.4
    got = find(t, {"thrust_N": thrust}, "thrust_N", command)
    assert got.notes == ("rows left out because their time falls: 40",) and accounted(got)
    with pytest.raises(InputError, match="split it where its clock restarts"):
        find(np.concatenate([t, t]), {"thrust_N": np.concatenate([thrust, thrust])}, "thrust_N")


def test_what_cannot_be_reduced_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        find([0.0, math.nan], {"thrust_N": [1.0, 2.0], "rpm": [1.0]}, "torque_Nm")
    assert [f.where for f in caught.value.faults] == ["plateaus", "signal", "time_s"]
    with pytest.raises(InputError, match="no values"):
        find(None, {"thrust_N": [math.nan, math.nan]}, "thrust_N")
    assert find(None, {"thrust_N": [1.0, 2.0]}, "thrust_N").notes == ("no plateau was found",)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(-10, 10, width=16), min_size=0, max_size=80),
    st.lists(st.integers(0, 3), min_size=80, max_size=80),
    st.booleans(),
)
def test_any_recording_is_accounted_for(values: list[float], command: list[int], with_command: bool) -> None:
    if not values:
        return
    n = len(values)
    got = find(None, {"x": values}, "x", sorted(command[:n]) if with_command else None)
    assert accounted(got)
    assert all(math.isfinite(p.mean["x"]) and min(values) <= p.mean["x"] <= max(values) for p in got.plateaus)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.01, 1000.0), st.floats(-50.0, 50.0))
def test_units_and_zero_do_not_change_what_is_found(scale: float, shift: float) -> None:
    t, command, thrust = staircase([1.0, 2.0, 3.0, 2.0], seconds=1.5)
    one = find(t, {"x": thrust}, "x", command)
    other = find(t, {"x": scale * thrust}, "x", command)
    assert [(p.start, p.stop) for p in one.plateaus] == [(p.start, p.stop) for p in other.plateaus]
    assert np.allclose(other.channel("x"), scale * one.channel("x"), rtol=1e-9)
    moved = find(t, {"x": thrust + shift}, "x", command)
    assert np.allclose(moved.channel("x"), one.channel("x") + shift, atol=0.05)


def test_the_standard_error_counts_correlated_samples_as_fewer() -> None:
    rng = np.random.default_rng(3)
    r, n = 0.8, 400
    means, claimed, naive = [], [], []
    for _ in range(300):
        x = np.empty(n)
        x[0] = rng.standard_normal()
        for k in range(1, n):
            x[k] = r * x[k - 1] + math.sqrt(1 - r * r) * rng.standard_normal()
        means.append(x.mean())
        claimed.append(standard_error(x))
        naive.append(x.std(ddof=1) / math.sqrt(n))
    true = np.std(means)
    assert 0.85 < np.median(claimed) / true < 1.15
    assert np.median(naive) / true < 0.5


def test_the_raw_record_of_a_stand_gives_its_six_throttle_steps(shared_data: Path) -> None:
    """The published tables of that stand are of other runs, so the record is held against itself only."""
    record = importers.read(shared_data / "jmajew" / "raw" / "curr_cal.csv")
    data = dict(record.values)
    known = find(None, data, "thrust_N", data["pulse_width_s"])
    commands = [round(p.command * 1e6) for p in known.plateaus if p.command]
    assert commands == [1000, 1200, 1400, 1450, 1500, 1550, 1600, 1000]
    blind = find(None, data, "thrust_N")  # the same steps without knowing the command
    assert len(blind.plateaus) == 8 and accounted(known) and accounted(blind)
    assert np.allclose(blind.channel("thrust_N"), known.channel("thrust_N"), rtol=0.002, atol=0.002)
    # the sample of 5 kgf cm in the middle of the fifth step is left out of its means
    assert 831 in known.plateaus[4].outliers["torque_Nm"]
    k = known.channel("thrust_N")[2:7] / known.channel("rpm")[2:7] ** 2
    assert np.ptp(k) / k.mean() < 0.04  # thrust goes with the square of the speed


def test_the_steps_of_a_published_log_are_found(shared_data: Path) -> None:
    log = importers.read(shared_data / "thrust_map" / "xNova-SR-steps.csv")
    data = dict(log.values)
    got = find(data["time_s"], data, "thrust_N", data["pulse_width_s"])
    top = [p for p in got.plateaus if p.command and p.command > 1.12e-3]
    assert [round(p.command * 1e6) for p in top if p.command] == [*range(1150, 1601, 50)]
    rest = np.array([p.mean["thrust_N"] for p in got.plateaus if p.command and round(p.command * 1e6) == 1100])
    assert len(rest) == 10 and np.std(rest) < 0.012  # [N] the same command ten times over
    assert accounted(got)


def test_steps_of_a_continuous_log_without_a_command_are_found(shared_data: Path) -> None:
    log = importers.read(shared_data / "rcbenchmark" / "Log_2019-11-05_171350.csv")
    data = dict(log.values)
    got = find(data["time_s"], data, "thrust_N")
    assert accounted(got) and len(got.plateaus) == 23
    steady = [p for p in got.plateaus if not p.flags and p.mean["thrust_N"] > 3.0]
    assert len(steady) == 13
    k = np.array([p.mean["thrust_N"] / p.mean["electrical_rpm"] ** 2 for p in steady])
    assert np.max(np.abs(k / np.median(k) - 1)) < 0.1  # thrust goes nearly with the square of the speed


@pytest.mark.parametrize("seed", range(12))
def test_noise_makes_no_plateaus(seed: int) -> None:
    rng = np.random.default_rng(seed)
    levels = [0.0, *rng.choice(np.arange(1, 10), 5, replace=False).tolist()]
    noise, tau = float(rng.uniform(0.002, 0.08)), float(rng.uniform(0.02, 0.15))
    t, _, thrust = staircase(levels, noise=noise, tau=tau, seed=seed)
    got = find(t, {"thrust_N": thrust}, "thrust_N")
    assert len(got.plateaus) == len(levels) and accounted(got)
    assert np.allclose(got.channel("thrust_N"), levels, atol=0.05)

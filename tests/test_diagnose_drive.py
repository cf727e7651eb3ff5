"""With a reference the drive is measured against the reference's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosing import case, points, recording

from bemt.judge.diagnose import chain
from bemt.judge.diagnose.record import Record, from_series


def run(seed: int, factor: float = 1.0, bow: float = 0.0, volts: float = np.nan) -> Record:
    """A static run whose speed at a pulse width is a law of its own, times a factor; the bus voltage it records."""
    given = points("static")
    pulse = np.linspace(0.0012, 0.0019, given["rpm"].size)
    share = (pulse - 0.001) / 0.001
    given["rpm"] = 24000.0 * factor * share / (1.0 + 0.25 * share + bow * share**2)
    given["rpm"] *= 1.0 + 0.002 * np.random.default_rng(seed).standard_normal(pulse.size)
    series = recording(case(), given, seed=seed)
    more = {"pulse_width_s": pulse, "pwm_s": pulse}
    if np.isfinite(volts):
        meter = 1.0 + 0.001 * np.random.default_rng(seed).standard_normal(share.size)
        more["voltage_V"] = volts * (1.0 - 0.05 * share) * meter
    return from_series(replace(series, values={**series.values, **more}), case())


def long(seed: int, hot: float = 0.0) -> Record:
    """Five pulse widths, again and again, in 40 min; the share of the speed that a hot motor loses."""
    pulse, t = np.tile(np.linspace(0.0014, 0.0019, 5), 12), 40.0 * np.arange(60)
    share = (pulse - 0.001) / 0.001
    rpm = 24000.0 * share / (1.0 + 0.25 * share) * (1.0 + 0.001 * np.random.default_rng(seed).standard_normal(60))
    rpm *= 1.0 - hot * (1.0 - np.exp(-t / 300.0))
    given = {"rpm": rpm, "airspeed_m_s": np.zeros(60), "density_kg_m3": np.full(60, 1.225), "time_s": t}
    series = recording(case(), given, seed=seed)
    return from_series(replace(series, values={**series.values, "pwm_s": pulse}), case())


@pytest.mark.parametrize("seed", [4, pytest.param(5, marks=pytest.mark.slow)])
def test_the_scatter_of_a_speed_follows_nothing(seed: int) -> None:
    """Readings of 0.1 % are no law over the speed that was read."""
    said = chain.diagnose([long(seed)], [case()])
    assert said.systems["drive"]["verdict"] == "none"


def test_what_loads_would_show_counts_in_the_speed() -> None:
    """Loads grow with the square of the speed: half of what counts in them counts in it."""
    said = chain.diagnose([long(2, hot=0.006), replace(long(1), reference=True)], [case()])
    assert "motor_heating" in said.systems["drive"]["effects"]


@pytest.fixture(scope="module")
def reference() -> Record:
    return replace(run(1), reference=True)


@pytest.mark.parametrize("factor", [0.86, 1.14, 1.3])
def test_another_supply_is_named_beside_a_reference(reference: Record, factor: float) -> None:
    said = chain.diagnose([run(2, factor), reference], [case()])
    assert said.said.verdict in ("named", "class") and "supply_voltage" in said.said.effects
    assert said.systems["air"]["verdict"] == "none"


def test_a_pulse_at_which_the_reference_does_not_turn_is_not_compared(reference: Record) -> None:
    """Another controller turns at 0.9 ms, where the curve of the reference goes through zero."""
    short = run(2)
    short.extra["pwm_s"][0] = 0.0009
    said = chain.diagnose([short, reference], [case()])
    assert said.drive is not None and np.isfinite(said.drive.problem.f0).all()
    assert min(said.drive.problem.covariates["rpm"]) > 0.0


def test_a_recorded_voltage_needs_no_look_and_no_guess() -> None:
    """A voltmeter tells what lost voltage is worth: its shares are no parameters, and nobody is sent to read it."""
    before = replace(run(1, volts=16.0), reference=True)
    answer = chain.diagnose([run(2, 0.88, volts=14.0), before], [case()])
    assert answer.said.verdict in ("named", "class") and "battery_sag" in answer.said.effects
    assert not {"sag", "discharge"} & set(answer.parameters["battery_sag"])
    assert answer.drive is not None and "supply_voltage" in answer.drive.absent
    assert answer.next.kind != "look" and "voltage" not in answer.next.text


def test_the_same_drive_is_no_cause(reference: Record) -> None:
    said = chain.diagnose([run(3), reference], [case()])
    assert not said.said.effects and said.systems["drive"]["verdict"] == "none"

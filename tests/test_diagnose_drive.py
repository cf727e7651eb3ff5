"""With a reference the drive is measured against the reference's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosing import case, points, recording

from bemt.judge.diagnose import chain
from bemt.judge.diagnose.record import Record, from_series


def run(seed: int, factor: float = 1.0, bow: float = 0.0) -> Record:
    """A static run whose speed at a pulse width is a law of its own, times a factor."""
    given = points("static")
    pulse = np.linspace(0.0012, 0.0019, given["rpm"].size)
    share = (pulse - 0.001) / 0.001
    given["rpm"] = 24000.0 * factor * share / (1.0 + 0.25 * share + bow * share**2)
    given["rpm"] *= 1.0 + 0.002 * np.random.default_rng(seed).standard_normal(pulse.size)
    series = recording(case(), given, seed=seed)
    return from_series(replace(series, values={**series.values, "pulse_width_s": pulse, "pwm_s": pulse}), case())


@pytest.fixture(scope="module")
def reference() -> Record:
    return replace(run(1), reference=True)


@pytest.mark.parametrize("factor", [0.86, 1.14, 1.3])
def test_another_supply_is_named_beside_a_reference(reference: Record, factor: float) -> None:
    said = chain.diagnose([run(2, factor), reference], [case()])
    assert said.said.verdict in ("named", "class") and "supply_voltage" in said.said.effects
    assert said.systems["air"]["verdict"] == "none"


def test_the_same_drive_is_no_cause(reference: Record) -> None:
    said = chain.diagnose([run(3), reference], [case()])
    assert not said.said.effects and said.systems["drive"]["verdict"] == "none"

"""A rotor that is not as its case says, shown by a reference: what a flipped sign then is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from diagnosing import case, points

from bemt.judge.diagnose import chain, record
from bemt.physics.dataset import Dataset

_D, _RHO = 0.2032, 1.225


def _bench(seed: int, sign: float = 1.0) -> Dataset:
    """Static loads of a rotor with a fifth more thrust and a third more torque than the case, 0.6 % scatter."""
    given, rng = points("static"), np.random.default_rng(seed)
    n = given["rpm"] / 60.0
    thrust = 0.115 * (given["rpm"] / 14000.0) ** 0.06 * _RHO * n**2 * _D**4
    torque = 0.0475 / (2.0 * np.pi) * _RHO * n**2 * _D**5
    T, Q = (x * (1.0 + 0.006 * rng.standard_normal(n.size)) for x in (thrust, torque))
    return Dataset("bench", "made", {**given, "thrust_N": sign * T, "torque_Nm": Q})


def _beside_reference(series: Dataset) -> chain.Diagnosis:
    base = case()
    known = replace(record.from_series(_bench(7), base), reference=True)
    return chain.diagnose([record.from_series(series, base), known], [base])


def test_a_flipped_sign_is_that_of_the_rotor_that_was_measured() -> None:
    """Twice what the case is off by was left over, and a propeller mounted backwards had to explain it."""
    answer = _beside_reference(_bench(3, -1.0))
    assert answer.decision.effects == ("unit_slip",)
    assert answer.best.settings[0]["factor"] == -1.0

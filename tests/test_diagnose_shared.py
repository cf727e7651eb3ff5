"""Physics that the case leaves out: a reference has it as well, unless what made the reference can switch it off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosing import case, left_out, points, recording

from bemt.judge.diagnose import chain, document
from bemt.judge.diagnose.answer import Diagnosis
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.record import from_series
from bemt.physics.dataset import Dataset
from bemt.physics.effects.base import Effect
from bemt.physics.effects.gain import ThrustGain
from bemt.rotors.case import Case

LACKS = left_out("compressibility", case())
TRIED = ("compressibility", "thrust_gain", "untwist", "section", "pitch_offset", "rpm_scale", "air_density")


def asked(truth: Case, known: Case, extra: tuple[Effect, ...] = ()) -> Diagnosis:
    test = from_series(recording(truth, points("grid"), extra, noise=0.004, seed=1), LACKS)
    reference = from_series(recording(known, points("grid"), noise=0.004, seed=2), LACKS)
    return chain.diagnose([test, replace(reference, reference=True)], [LACKS], only=TRIED)


def test_what_both_runs_have_is_named_and_said_to_be_in_both() -> None:
    answer = asked(case(), case())
    assert answer.decision.effects == ("compressibility",)
    assert document.document(answer)["in_reference"] == ["compressibility"]
    assert "the reference shows it as well" in document.headline(answer)


def test_what_the_reference_was_made_without_is_the_recordings_alone() -> None:
    answer = asked(case(), LACKS)
    assert answer.decision.effects == ("compressibility",)
    assert document.document(answer)["in_reference"] == []


def test_nothing_is_named_where_neither_run_has_it() -> None:
    assert asked(LACKS, LACKS).decision.effects == ()


def test_a_change_is_found_beside_what_both_runs_have() -> None:
    answer = asked(case(), case(), (ThrustGain(0.06),))
    assert set(answer.decision.effects) == {"compressibility", "thrust_gain"}
    assert document.document(answer)["in_reference"] == ["compressibility"]


@pytest.mark.parametrize("unit", [0.2248089, 1000.0])
def test_real_rotors_scatter_by_a_share_of_what_is_read_whatever_its_unit(unit: float) -> None:
    series = recording(case(), points("grid"), noise=0.004)
    other = Dataset("bench", "log", {**series.values, "thrust_N": unit * series.values["thrust_N"]}, {})
    shares = []
    for data in (replace(series, u={}), other):
        problem = build([from_series(data, case())], [case()])
        load = problem.channel == 0
        shares.append(np.sqrt(np.diag(problem.of_real_rotors))[load] / np.abs(problem.y[load]))
    assert np.allclose(shares[1], shares[0], rtol=0.02)

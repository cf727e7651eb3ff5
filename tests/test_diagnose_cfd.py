"""`diagnose` on our own CFD, its label hidden.

CFD and BEMT differ in any case.  The runs without the cause are given as reference: that difference is theirs, and only
what the cause adds is to be explained.  Slow: a minute.
"""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.judge.diagnose import chain, document, record
from bemt.judge.diagnose.answer import Diagnosis
from bemt.judge.diagnose.record import Record
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case, load_case

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent
# What `cfd` writes that a stand would record as well; the tip gap and the wall are measured, the wind's angle is hidden
SEEN = ("rpm", "airspeed_m_s", "thrust_N", "torque_Nm", "density_kg_m3", "wall_distance_m")
ABSOLUTE = frozenset({"compressibility", "drag_divergence"})


def rows(campaign: str, **wanted: float) -> list[dict[str, str]]:
    with (ROOT / "reports" / "cfd" / campaign / "recording.csv").open(encoding="utf-8") as stream:
        found = [row for row in csv.DictReader(stream) if row["converged"] == "1"]
    return [row for row in found if all(np.isclose(float(row[k]), v, atol=1e-6) for k, v in wanted.items())]


def taken(found: list[dict[str, str]], case: Case, reference: bool = False) -> Record:
    """Runs as readings; the grid's error is common to all runs of a level and goes with the reference."""
    names = [k for k in SEEN if any(row[k] for row in found)]
    values = {k: np.array([float(row[k] or "nan") for row in found]) for k in names}
    u = {}
    for k, q in (("thrust_N", "thrust"), ("torque_Nm", "torque")):
        share = [max(abs(float(row[f"drift_{q}"])), float(row[f"scatter_{q}"]), 1e-3) for row in found]
        u[k] = np.array(share) * values[k]
    return replace(record.from_series(Dataset("cfd", "recording", values, u), case), reference=reference)


def told(left_out: frozenset[str], found: list[dict[str, str]], reference: list[dict[str, str]]) -> Diagnosis:
    case = load_case(ROOT / "cases" / "prop_8x5" / "case.toml").replaced(
        {"model.effects_off": sorted(left_out), "blade.known_from": "cad"}  # the grids were made of this very case
    )
    return chain.diagnose([taken(found, case), taken(reference, case, reference=True)], [case])


FREE = "prop_8x5_incompressible"
QUESTIONS = {
    "compressibility": lambda: (rows("prop_8x5_compressible"), rows(FREE)),
    "ground_effect": lambda: (rows("prop_8x5_plate"), rows(FREE)),
    "duct": lambda: (rows("prop_8x5_duct"), rows(FREE)),
    "pitch_offset": lambda: (rows("prop_8x5_pitch"), rows(FREE)),
    "oblique_inflow": lambda: (
        [r for r in rows("prop_8x5_skew") if float(r["sideslip_deg"]) > 0], rows("prop_8x5_skew", sideslip_deg=0.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("cause", ["compressibility", "pitch_offset", "ground_effect", "duct"])
def test_what_a_campaign_has_is_told(cause: str) -> None:
    answer = told(ABSOLUTE, *QUESTIONS[cause]())
    assert cause in answer.said.effects, document.text(answer)


@pytest.mark.parametrize("cause", list(QUESTIONS))
def test_nothing_else_is_told_of_a_campaign(cause: str) -> None:
    """A frozen rotor hardly shows the angle of the wind (under 2 % at J 0.2)."""
    answer = told(ABSOLUTE, *QUESTIONS[cause]())
    assert not answer.said.effects or cause in answer.said.effects, document.text(answer)


def test_nothing_is_named_on_the_campaign_without_a_cause() -> None:
    """Two speeds of the same rotor beside the other two."""
    fast = [r for r in rows(FREE) if float(r["rpm"]) > 14000]
    slow = [r for r in rows(FREE) if float(r["rpm"]) < 14000]
    answer = told(ABSOLUTE, fast, slow)
    assert not answer.decision.effects, document.text(answer)

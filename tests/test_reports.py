"""The committed reports are what the commands generate today."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bemt.compare.validate.propellers import validate

# Section tables come from a network whose releases differ in the last digits.
TOLERANCE = 2e-3


def test_committed_sweep_is_what_the_cases_give(project: Path) -> None:
    call = [sys.executable, "-m", "bemt", "sweep", "cases/", "--json", "--quiet"]
    fresh = json.loads(subprocess.run(call, cwd=project, capture_output=True, text=True, check=True).stdout)
    kept = json.loads((project / "reports" / "sweep.json").read_text(encoding="utf-8"))
    assert [c["name"] for c in fresh["cases"]] == [c["name"] for c in kept["cases"]]
    for new, old in zip(fresh["cases"], kept["cases"], strict=True):
        assert len(new["rows"]) == len(old["rows"])
        for a, b in zip(new["rows"], old["rows"], strict=True):
            assert (a["source"], a["label"]) == (b["source"], b["label"])
            for key in ("thrust_N", "torque_Nm", "CT", "CP", "M_tip", "Re", "u"):
                if b[key] is None:
                    assert a[key] is None
                else:
                    assert a[key] == pytest.approx(b[key], rel=5 * TOLERANCE if key == "u" else TOLERANCE), key


@pytest.mark.parametrize("volume", [1, 2])
def test_committed_validation_is_what_the_data_give(project: Path, shared_data: Path, volume: int) -> None:
    folder = project / "reports" / "validation" / f"uiuc_volume_{volume}"
    kept = json.loads((folder / "validation.json").read_text(encoding="utf-8"))
    fresh = validate(shared_data / "uiuc" / f"volume-{volume}", match_J0=True)
    for old, new in ((kept, fresh), (kept["matched_J0"], fresh["matched_J0"])):
        for kind in ("static", "forward"):
            assert new[kind]["points"] == old[kind]["points"]
            for q in ("CT", "CP"):
                for name, value in old[kind][q].items():
                    assert new[kind][q][name] == pytest.approx(value, abs=TOLERANCE)

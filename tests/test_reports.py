"""The committed reports are what the commands generate today."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bemt.app.cli import main
from bemt.rotors.validate.propellers import validate

# Section tables come from a network whose releases differ in the last digits.
TOLERANCE = 2e-3


def test_committed_sweep_is_what_the_cases_give(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(project)
    assert main(["sweep", "cases/", "--json", "--quiet"]) == 0
    fresh = json.loads(capsys.readouterr().out)
    kept = json.loads((project / "reports" / "sweep.json").read_text(encoding="utf-8"))
    shipped = [c["name"] for c in kept["cases"]]
    found = [c for c in fresh["cases"] if c["name"] in shipped]  # a case of one's own may lie beside them
    assert [c["name"] for c in found] == shipped
    for new, old in zip(found, kept["cases"], strict=True):
        assert len(new["rows"]) == len(old["rows"])
        for a, b in zip(new["rows"], old["rows"], strict=True):
            assert (a["source"], a["label"]) == (b["source"], b["label"])
            for key in ("thrust_N", "torque_Nm", "CT", "CP", "M_tip", "Re", "u"):
                if b[key] is None:
                    assert a[key] is None
                else:
                    assert a[key] == pytest.approx(b[key], rel=5 * TOLERANCE if key == "u" else TOLERANCE), key


# Both volumes are in the population; families left out whole are in reports/validation/left_out. The bounds are what
# the solver reaches: of the targets of 6 % (CT), 10 % (CP) and 20 % (90th percentile of CT), volume 1 in flight misses
# the first and volume 2 in flight the last. Families weigh alike, so volume 1 (half APC) lost half a point and volume 2
# won two.
@pytest.mark.parametrize(
    ("volume", "static", "forward"),
    [
        pytest.param(1, (0.045, 0.115, 0.060), (0.070, 0.20, 0.067), marks=pytest.mark.slow),
        (2, (0.065, 0.20, 0.085), (0.065, 0.25, 0.080)),
    ],
)
def test_committed_validation_is_what_the_data_give_and_within_its_bounds(
    project: Path, shared_data: Path, volume: int, static: tuple[float, ...], forward: tuple[float, ...]
) -> None:
    folder = project / "reports" / "validation" / f"uiuc_volume_{volume}"
    kept = json.loads((folder / "validation.json").read_text(encoding="utf-8"))
    fresh = validate(shared_data / "uiuc" / f"volume-{volume}", match_J0=True).document()
    assert fresh["unconverged"] == 0 and not fresh["faults"]
    for kind, bound in (("static", static), ("forward", forward)):
        assert fresh[kind]["CT"]["median_abs"] < bound[0]
        assert fresh[kind]["CT"]["p90_abs"] < bound[1]
        assert fresh[kind]["CP"]["median_abs"] < bound[2]
    for old, new in ((kept, fresh), (kept["matched_J0"], fresh["matched_J0"])):
        for kind in ("static", "forward"):
            assert new[kind]["points"] == old[kind]["points"]
            for q in ("CT", "CP"):
                for name, value in old[kind][q].items():
                    assert new[kind][q][name] == pytest.approx(value, abs=TOLERANCE)

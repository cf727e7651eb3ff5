"""What stands beside an answer: the reference, whose loads say what the case leaves open, and the band of the case."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bemt import diagnose, propeller
from bemt.app.cli import main
from bemt.base.errors import EXIT_OK

ROOT = Path(__file__).resolve().parent.parent
D = 0.254


def written(path: Path, seed: int, thrust: float = 1.0, torque: float = 1.0, level: float = 1.0) -> str:
    """A 10 in propeller whose CT bends as that of no blade element code, at rest."""
    rng = np.random.default_rng(seed)
    n = np.linspace(50.0, 125.0, 15)
    CT = level * thrust * 0.105 * (1.0 + 0.12 * np.sin(n / 9.0))
    CQ = level * torque * 0.0075 * (1.0 + 0.12 * np.cos(n / 7.0))
    T, Q = CT * 1.2 * n**2 * D**4, CQ * 1.2 * n**2 * D**5
    noisy = [v * (1.0 + 0.004 * rng.standard_normal(15)) for v in (T, Q)]
    rows = "".join(f"{60 * a:.1f},{b:.5f},{c:.6f}\n" for a, b, c in zip(n, *noisy, strict=True))
    path.write_text("rpm,thrust_N,torque_Nm\n" + rows, "utf-8")
    return str(path)


def asked(capsys: pytest.CaptureFixture[str], a: str, b: str, *more: str) -> dict[str, Any]:
    case = str(ROOT / "cases" / "prop_10x5")
    assert main(["diagnose", b, "--reference", a, "--case", case, "--json", *more]) == EXIT_OK
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_loads_that_clearly_changed_are_a_class_where_the_case_cannot_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = written(tmp_path / "a.csv", 1), written(tmp_path / "b.csv", 2, 1.2, 0.85)
    found = asked(capsys, a, b)
    assert found["verdict"] == "class" and "duct" in found["effects"]
    assert "thrust +" in found["headline"] and "torque -" in found["headline"]
    assert found["next_measurement"]["text"]
    capsys.readouterr()
    assert main(["diagnose", b, "--reference", a, "--case", str(ROOT / "cases" / "prop_10x5")]) == EXIT_OK
    shown = capsys.readouterr().out
    assert "verdict: class" in shown and "against the reference" in shown


def test_two_recordings_that_agree_name_nothing_however_far_they_are_off_the_case(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both are of a rotor whose loads are an eighth of the case's: no slip of one of them."""
    a, b = (written(tmp_path / f"{k}.csv", k, level=0.12) for k in (1, 2))
    found = asked(capsys, a, b)
    assert not found["effects"], found["headline"]
    case = str(ROOT / "cases" / "prop_10x5")
    assert main(["diagnose", b, "--reference", a, "--case", case, "--details"]) == EXIT_OK
    said = " ".join(capsys.readouterr().out.split())
    assert "this rotor?" not in said, "the reference shows the rotor"
    assert said.count("The case is not this rotor (reference: ") == 1


def test_a_load_that_changed_its_sign_is_not_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ratios compare sizes, so they must not say that such recordings agree."""
    found = asked(capsys, written(tmp_path / "a.csv", 1), written(tmp_path / "b.csv", 2, thrust=-1.0))
    assert found["verdict"] != "none" and "No change" not in found["headline"], found["headline"]


@pytest.mark.parametrize(("share", "asks"), [(0.5, True), (1.0, False)])
def test_loads_that_all_lie_beside_the_band_ask_for_the_rotor_and_those_inside_do_not(share: float, asks: bool) -> None:
    """No reading inside the band of the case is another rotor sooner than any cause; all inside hide the level."""
    rotor, rng = propeller("10x5"), np.random.default_rng(1)
    rpm = np.linspace(4000.0, 11000.0, 14)
    loads = rotor.solve(rpm, bands=False)
    read = {name: share * loads[name] * (1.0 + 0.01 * rng.standard_normal(14)) for name in ("thrust_N", "torque_Nm")}
    answer = diagnose(pd.DataFrame({"rpm": rpm, **read}), rotor)
    assert not answer.effects
    inside = "0 of 14" if asks else "14 of 14"
    assert answer.beside.count(inside) == 2 and answer.beside.endswith("?") is asks
    assert answer.text.replace("\n", " ").startswith(answer.beside)

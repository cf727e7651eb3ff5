"""``bemt validate``: statistics with known answers, the declared rule on real propellers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.base.tables import json_text
from bemt.data.readers import uiuc
from bemt.physics import effects
from bemt.physics.sections import rule as section_rule
from bemt.rotors.validate import points, propellers

R_R = np.linspace(0.15, 1.0, 18)
C_R = 0.12 + 0.08 * np.sin(np.pi * R_R) - 0.06 * R_R
BETA = np.degrees(np.arctan(0.5 / (np.pi * R_R)))


def _folder(path: Path, thrust: float = 1.0, power: float = 1.0, turned_deg: float = 0.0) -> Path:
    """UIUC folder of a 10x5 whose "measurements" are our own solution times given factors, at turned blades."""
    geometry = "r/R   c/R     beta\n" + "".join(
        f"{a:.2f}  {b:.5f}  {c:.4f}\n" for a, b, c in zip(R_R, C_R, BETA, strict=True)
    )
    (path / "some_10x5_geom.txt").write_text(geometry)
    (path / "some_10x5_static_0001xx.txt").write_text("RPM CT CP\n3000.0 0.1 0.04\n5000.0 0.1 0.04\n")
    (path / "some_10x5_0002xx_5000.txt").write_text(
        "J CT CP eta\n" + "".join(f"{J:.3f} 0.1 0.04 {2.5 * J:.4f}\n" for J in np.linspace(0.1, 0.7, 13))
    )
    propeller = uiuc.scan_folder(path).propellers[0]
    g = propeller.geometry
    assert g is not None
    true = (g.r_R, g.c_R, np.radians(g.beta_deg + turned_deg))
    rows = points.compare(propeller, effects.standard(), true)
    CT, CP = rows.CT_bemt / thrust, rows.CP_bemt / power
    static = "".join(f"{n:.1f} {a:.9f} {b:.9f}\n" for n, a, b in zip(rows.rpm[:2], CT[:2], CP[:2], strict=True))
    (path / "some_10x5_static_0001xx.txt").write_text("RPM CT CP\n" + static)
    line = "".join(
        f"{J:.6f} {a:.9f} {b:.9f} {max(J * a / b, 0):.6f}\n" for J, a, b in zip(rows.J[2:], CT[2:], CP[2:], strict=True)
    )
    (path / "some_10x5_0002xx_5000.txt").write_text("J CT CP eta\n" + line)
    return path


def test_planted_errors_come_out(tmp_path: Path) -> None:
    doc = propellers.validate(_folder(tmp_path, thrust=1.10, power=0.95)).document()
    for kind in ("static", "forward"):
        assert doc["as_drawn"][kind]["propellers"] == 1
        assert doc["as_drawn"][kind]["CT"]["bias"] == pytest.approx(0.10, abs=1e-6)
        assert doc["as_drawn"][kind]["CT"]["median_abs"] == pytest.approx(0.10, abs=1e-6)
        assert doc["as_drawn"][kind]["CP"]["bias"] == pytest.approx(-0.05, abs=1e-6)
        assert doc["as_drawn"][kind]["CP"]["p90_abs"] == pytest.approx(0.05, abs=1e-6)
    assert doc["zero_thrust_J"]["median_abs"] < 1e-6
    assert doc["schema"] == "bemt.validation/1" and doc["unconverged"] == 0


def test_a_planted_blade_angle_is_found_and_kept_apart(tmp_path: Path) -> None:
    folder = _folder(tmp_path, power=0.95, turned_deg=-1.5)
    plain, found = propellers.validate(folder).document(), propellers.validate(folder, match_J0=True)
    doc = found.document()
    turned = doc.pop("matched_J0")
    assert turned["propellers"] == 1 and turned["shift_deg_p10_p50_p90"][1] == pytest.approx(-1.5, abs=0.02)
    for kind in ("static", "forward"):
        assert plain[kind]["CT"]["bias"] > 0.08
        assert turned[kind]["CT"]["median_abs"] < 0.003
        assert turned[kind]["CP"]["bias"] == pytest.approx(-0.05, abs=0.003)
        assert turned[kind]["points"] == plain[kind]["points"]
    assert doc["propellers"][0].pop("matched_J0")["shift_deg"] == turned["shift_deg_p10_p50_p90"][1]
    assert doc == plain
    assert "turned to measured J0, 1" in propellers.text(found)


def test_a_zero_thrust_J_that_no_blade_angle_gives_is_not_matched() -> None:
    assert np.isnan(propellers.shift_to(float("nan"), lambda d: 0.7 + 0.05 * d))
    assert np.isnan(propellers.shift_to(0.7, lambda d: 0.9 if d > -2.0 else float("nan")))
    assert propellers.shift_to(0.7, lambda d: 0.7) == 0.0


def test_forward_points_stop_at_the_share_of_zero_thrust_J(tmp_path: Path) -> None:
    doc = propellers.validate(_folder(tmp_path)).document()
    J0 = doc["propellers"][0]["J0"]
    J = np.linspace(0.1, 0.7, 13)
    assert doc["forward"]["points"] == np.count_nonzero(J <= points.J_SHARE * J0)


def test_rotors_as_built_come_with_what_their_intervals_hold(tmp_path: Path) -> None:
    """A propeller that is exactly as the solver has it lies inside every interval; one far off lies outside."""
    (tmp_path / "good").mkdir()
    (tmp_path / "bad").mkdir()
    good = propellers.validate(_folder(tmp_path / "good")).document()
    bad = propellers.validate(_folder(tmp_path / "bad", thrust=1.6, power=1.6)).document()
    for kind in ("static", "forward"):
        for q in ("CT", "CP"):
            assert good[kind][q]["coverage"] == {"68": 1.0, "95": 1.0} and 0.01 < good[kind][q]["width68"] < 0.5
            assert bad[kind][q]["coverage"]["68"] < 0.3
    drawn = propellers.validate(tmp_path / "good", effects.without(effects.standard(), ["swirl"])).document()
    assert "coverage" not in drawn["static"]["CT"] and "as_drawn" not in drawn


def test_unconverged_points_count_as_infinitely_wrong() -> None:
    bad = points.statistics(np.array([0.01, np.nan, np.nan]))
    assert bad.median_abs == np.inf
    assert json.loads(json_text(bad.document())) == {"median_abs": None, "p90_abs": None, "bias": 0.01}


def test_unconverged_points_are_never_shown_as_zero(tmp_path: Path) -> None:
    doc = propellers.validate(_folder(tmp_path))
    nothing = points.statistics(np.array([np.nan, np.nan]))
    doc = replace(doc, static=replace(doc.static, CT=nothing))
    line = next(row for row in propellers.text(doc).splitlines() if row.startswith("all points"))
    assert line.split("|")[1].split() == ["inf", "inf", "-"]


def test_command_prints_json_and_names_unknown_effects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _folder(tmp_path)
    call = ["validate", str(tmp_path)]
    assert main([*call, "--json", "--off", "stall_delay"]) == 0
    doc = json.loads(capsys.readouterr().out)
    assert set(doc["static"]) == {"propellers", "points", "CT", "CP"}
    assert "stall_delay" not in [e["id"] for e in doc["effects"]]
    assert main([*call, "--off", "nonsense"]) == 2
    said = capsys.readouterr().err
    assert "nonsense" in said and "Traceback" not in said


def test_a_file_for_the_folder_is_called_a_file(tmp_path: Path) -> None:
    (tmp_path / "file.txt").write_text("x")
    for name, got in (("file.txt", "a file"), ("absent", "no such folder")):
        with pytest.raises(InputError) as caught:
            propellers.validate(tmp_path / name)
        assert str(caught.value) == f"{tmp_path / name}: got {got}; expected a folder in UIUC layout. Check the path."


def test_rule_is_one_table_for_small_and_one_for_large_reynolds_numbers() -> None:
    from bemt.physics.sections.neuralfoil import neuralfoil_polar, tunnel_polar
    from bemt.physics.sections.polars import DEFAULT_RE

    shape = section_rule.airfoil(section_rule.sections()[0])
    rule = neuralfoil_polar(shape)
    small = tunnel_polar(shape, n_crit=section_rule.N_CRIT, lift_floor=0.0)
    large = tunnel_polar(shape, n_crit=section_rule.N_CRIT_LARGE)
    low, high = DEFAULT_RE < section_rule.SMALL_RE, DEFAULT_RE > 2 * section_rule.SMALL_RE
    np.testing.assert_allclose(rule.cd[:, low], section_rule.DRAG_LEVEL * small.cd[:, low])
    np.testing.assert_allclose(rule.cl[:, low], small.cl[:, low])
    np.testing.assert_allclose(rule.cl[:, high], large.cl[:, high])

"""Thrusters on a body: commands met where they can be, the nearest by priority where not, the numbers of the case."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bemt.base.errors import InputError
from bemt.commands.cli import main
from bemt.drive.thrusters import Thruster, allocate, attainable, effectiveness, moment_at

PAIR = [Thruster(0.2, 27.0), Thruster(-0.2, 27.0)]


def test_the_numbers_of_the_thesis() -> None:
    assert moment_at(0.2, 27.0) == pytest.approx(5.4)
    assert np.allclose(moment_at([0.1, 0.3], 27.0), [2.7, 8.1])
    got = allocate(PAIR, 27.0, 5.4)
    assert got.met and got.thrust_N == pytest.approx([27.0, 0.0], abs=1e-6)
    assert allocate(PAIR, 40.0, 2.0).thrust_N == pytest.approx([25.0, 15.0])


def test_two_thrusters_have_one_answer() -> None:
    for force, moment in ((10.0, 1.0), (30.0, -2.0), (54.0, 0.0), (0.0, 0.0)):
        got = allocate(PAIR, force, moment)
        assert got.met
        assert got.thrust_N == pytest.approx([force / 2 + moment / 0.4, force / 2 - moment / 0.4], abs=1e-6)


def test_beyond_the_limits_priority_decides() -> None:
    moment_first = allocate(PAIR, 58.8, 2.0, "moment")
    assert not moment_first.met and moment_first.moment_Nm == pytest.approx(2.0)
    assert moment_first.force_N == pytest.approx(54.0 - 2.0 / 0.2) and moment_first.saturated.tolist() == [True, False]
    force_first = allocate(PAIR, 58.8, 2.0, "force")
    assert force_first.force_N == pytest.approx(54.0) and force_first.moment_Nm == pytest.approx(0.0, abs=1e-6)
    assert allocate(PAIR, 0.0, 9.0).moment_Nm == pytest.approx(5.4)
    assert allocate(PAIR, 20.0, 9.0, "force").moment_Nm == pytest.approx(4.0)


def test_more_thrusters_share_with_the_least_squares() -> None:
    four = [Thruster(y, 10.0) for y in (0.3, 0.1, -0.1, -0.3)]
    got = allocate(four, 20.0, 1.0)
    exact = np.linalg.pinv(effectiveness(four)) @ [20.0, 1.0]  # no limit acts
    assert got.met and got.thrust_N == pytest.approx(exact, abs=1e-6)


def test_canted_and_lifted_thrusters() -> None:
    b = effectiveness([Thruster(0.2, 27.0, z_m=0.1, cant_rad=math.radians(30.0))])
    assert b[:, 0] == pytest.approx([math.cos(math.pi / 6), 0.2 * math.cos(math.pi / 6) - 0.1 * 0.5])


finite = st.floats(-1.0, 1.0)
bodies = st.lists(st.tuples(finite, st.floats(0.5, 50.0), st.floats(-0.9, 0.4)), min_size=1, max_size=5)


@settings(max_examples=60, deadline=None)
@given(bodies, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.sampled_from(["moment", "force"]))
@example([(3.6e-20, 1.0, 0.0)], 0.0, 0.0, "moment")  # an arm that is rounding
def test_any_body_stays_within_its_limits_and_meets_what_is_attainable(
    body: list[tuple[float, float, float]], f: float, m: float, priority: str
) -> None:
    group = [Thruster(y, top, top * low) for y, top, low in body]
    corners = attainable(group)
    assert np.allclose(corners[0], corners[-1], atol=1e-9)
    got = allocate(group, f * 50.0, m * 20.0, priority)
    assert all(t.thrust_min_N - 1e-9 <= v <= t.thrust_max_N + 1e-9 for t, v in zip(group, got.thrust_N, strict=True))
    assert np.allclose(effectiveness(group) @ got.thrust_N, [got.force_N, got.moment_Nm], atol=1e-9)
    row, low, high = (
        (1, corners[:, 1].min(), corners[:, 1].max())
        if priority == "moment"
        else (0, corners[:, 0].min(), corners[:, 0].max())
    )
    nearest = np.clip((f * 50.0, m * 20.0)[row], low, high)
    assert (got.force_N, got.moment_Nm)[row] == pytest.approx(nearest, abs=2e-5 * max(1.0, high - low))
    # what thrusts give is met when asked for
    inside = effectiveness(group) @ np.array([0.5 * (t.thrust_min_N + t.thrust_max_N) for t in group])
    assert allocate(group, *map(float, inside), priority).met


def test_command(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = str(project / "cases" / "ds30")
    assert main(["thrusters", case, "--json", "--out", str(tmp_path)]) == 0
    doc = json.loads(capsys.readouterr().out)
    at = next(row for row in doc["mounting"] if abs(row["distance_m"] - 0.2) < 1e-9)
    assert at["moment_one_Nm"] == pytest.approx(5.4) and at["moment_one_kgf_m"] == pytest.approx(0.5506, abs=1e-4)
    assert {p.name for p in tmp_path.iterdir()} == {"thrusters.json", "mounting.csv", "thrusters.png"}
    assert main(["thrusters", case, "--force", "58.8"]) == 1  # 6 kgf are beyond two of 27 N
    assert "beyond the thrusters" in capsys.readouterr().out


def test_faults_come_all_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "thrusters.toml"
    path.write_text('schema = "bemt.thrusters/1"\n[body]\nnam = "x"\n[[thruster]]\ny = 0.2\nthrust_max_N = -3\n')
    assert main(["thrusters", str(path)]) == 2
    words = capsys.readouterr().err
    assert all(w in words for w in ("body.nam", "thruster[0].y", "thruster[0].thrust_max_N"))
    assert main(["thrusters", str(path), "--force=nan", "--moment=-1e300"]) == 2
    words = capsys.readouterr().err
    limits = "expected a number from -1e+06 to 1e+06"
    assert f"--force: got nan; {limits} N." in words and f"--moment: got -1e+300; {limits} N m." in words
    assert "thruster[0].thrust_max_N" in words
    with pytest.raises(InputError, match="moment or force"):
        allocate(PAIR, 1.0, 0.0, "both")
    with pytest.raises(InputError, match="one or more"):
        allocate([], 1.0, 0.0)


def test_results_never_replace_the_file_that_was_read(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mounting.csv"  # an odd name, but the user's
    text = (project / "cases" / "ds30" / "thrusters.toml").read_text()
    path.write_text(text)
    assert main(["thrusters", str(path), "--out", str(tmp_path)]) == 2
    assert "which this run reads" in capsys.readouterr().err
    assert path.read_text() == text and len(list(tmp_path.iterdir())) == 1

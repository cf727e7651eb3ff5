"""The promise of the first picture: a recording is drawn and counted inside its band."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.judge.compare.first_picture import against_band
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case, load_case
from bemt.rotors.case.propagate import propagate


@pytest.fixture(scope="module")
def case(project: Path) -> Case:
    return load_case(project / "cases" / "prop_8x5" / "case.toml")


def points(case: Case, rpm: np.ndarray, V: np.ndarray, shift: float, torque: bool = True) -> Dataset:
    """Readings so many half widths of the band above the model."""
    rho = np.full(rpm.size, 1.2)
    solved = propagate(case, rpm, V, rho)
    loads = ("thrust_N", "torque_Nm") if torque else ("thrust_N",)
    values = {c: solved.points[c] + shift * solved.half_width95(c) for c in loads}
    return Dataset("bench", "run", {"rpm": rpm, "airspeed_m_s": V, "density_kg_m3": rho, **values})


@pytest.mark.parametrize(("shift", "share"), [(0.0, 1.0), (0.9, 1.0), (-0.9, 1.0), (1.1, 0.0), (-1.1, 0.0)])
@pytest.mark.parametrize("plan", ["static", "flight", "grid", "one"])
def test_a_reading_counts_as_inside_exactly_where_the_band_is(
    case: Case, plan: str, shift: float, share: float
) -> None:
    n, J = {
        "static": (np.linspace(4000.0, 16000.0, 7), np.zeros(7)),
        "flight": (np.full(6, 9000.0), np.linspace(0.0, 0.6, 6)),
        "grid": tuple(a.ravel() for a in np.meshgrid([8000.0, 15000.0], [0.1, 0.3, 0.5])),
        "one": (np.array([12000.0]), np.zeros(1)),
    }[plan]
    view = against_band(case, [points(case, n, J * n / 60.0 * case.diameter_m, shift)])
    flies = plan in ("flight", "grid")
    assert (view.over, view.channels) == (("J", ("CT", "CP")) if flies else ("rpm", ("thrust_N", "torque_Nm")))
    for channel in view.channels:
        inside, total, median = view.inside(channel)
        assert (inside, total) == (round(share * n.size), n.size)
        assert np.sign(round(median, 9)) == np.sign(shift)
    assert view.sentence.endswith("they are 0 % and 0 % from the model.") == (not shift), view.sentence
    # the drawn band covers the points, and holds the model's values where it runs through their conditions
    x = view.curve[view.over]
    own = view.recorded[0][view.over]
    assert x[0] <= own.min() + 1e-9 and x[-1] >= own.max() - 1e-9
    if plan != "grid":
        at = np.interp(own, x, view.curve[view.channels[0]])
        assert at == pytest.approx(view.model[0][view.channels[0]], rel=0.01)
    assert view.png().startswith(b"\x89PNG")


def test_recordings_with_different_channels_share_one_picture(case: Case) -> None:
    n = np.linspace(5000.0, 9000.0, 4)
    both, thrust = points(case, n, np.zeros(4), 0.0), points(case, n, np.zeros(4), 2.0, torque=False)
    view = against_band(case, [both, thrust])
    assert view.inside("thrust_N")[:2] == (4, 8) and view.inside("torque_Nm")[:2] == (4, 4)
    assert view.document()["channels"]["torque_Nm"]["readings"] == 4
    assert view.png() == view.png()


def test_nothing_to_show_is_refused(case: Case) -> None:
    n = np.array([5000.0, 6000.0])
    still = {"rpm": n, "airspeed_m_s": 0 * n, "density_kg_m3": 0 * n + 1.2}
    empty = Dataset("bench", "run", still | {"thrust_N": np.nan * n})
    with pytest.raises(InputError):
        against_band(case, [empty])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("log") / "log.csv"
    rows = ((6000, 2.1, 0.031), (8000, 3.9, 0.056), (10000, 6.2, 0.087), (12000, 9.1, 0.127), (14000, 12.6, 0.176))
    file.write_text("rpm,thrust (N),torque (Nm)\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
    return file


def test_import_shows_a_recording_beside_a_case(
    project: Path, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "first.png"
    where = str(project / "cases" / "prop_8x5")
    assert main(["import", str(log), "--case", where, "--picture", str(picture), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["prediction"]
    assert told["channels"]["thrust_N"] == pytest.approx({"inside": 5, "readings": 5, "median_change": 0.0}, abs=0.05)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["import", str(log), "--picture", str(picture)]) == 2


@pytest.mark.parametrize("order", [("LOG", "--case", "CASE"), ("--case", "CASE", "LOG")])
def test_diagnose_takes_its_arguments_in_any_order_and_draws_the_first_picture(
    project: Path, log: Path, tmp_path: Path, order: tuple[str, ...]
) -> None:
    words = {"LOG": str(log), "CASE": str(project / "cases" / "prop_8x5")}
    assert main(["diagnose", *(words.get(w, w) for w in order), "--out", str(tmp_path), "--quiet"]) == 0
    assert (tmp_path / "recording.png").is_file()
    assert json.loads((tmp_path / "diagnosis.json").read_text())["recordings"] == [str(log)]


@pytest.mark.parametrize("words", [["LOG"], ["--case", "CASE"]])
def test_diagnose_without_recording_or_case_is_a_usage_error(project: Path, log: Path, words: list[str]) -> None:
    known = {"LOG": str(log), "CASE": str(project / "cases" / "prop_8x5")}
    try:
        code = main(["diagnose", *(known.get(w, w) for w in words)])
    except SystemExit as stop:
        code = int(stop.code or 0)
    assert code == 2


def test_a_report_holds_the_runs_of_its_user(log: Path, tmp_path: Path) -> None:
    assert main(["new", "8x5", "--out", str(tmp_path / "case")]) == 0
    out = tmp_path / "out"
    assert main(["report", str(tmp_path / "case"), "--recording", str(log), "--out", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "nothing recorded" not in page.lower()
    assert page.index('alt="Recording and prediction"') < page.index("<h3>Geometry</h3>")


@pytest.mark.parametrize(("kind", "head"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_a_picture_is_png_pdf_or_svg_and_the_same_each_time(kind: str, head: bytes, case: Case) -> None:
    n = np.linspace(5000.0, 9000.0, 4)
    view = against_band(case, [points(case, n, np.zeros(4), 0.0)])
    assert view.picture(kind).startswith(head) and view.picture(kind) == view.picture(kind)


def test_the_title_ends_its_lines_with_its_phrases(case: Case) -> None:
    n = np.linspace(5000.0, 9000.0, 4)
    view = against_band(case, [points(case, n, np.zeros(4), 0.0)])
    assert view._title().splitlines() == [case.name, "readings in the 95 % band: 4 of 4 thrust, 4 of 4 torque"]


def test_static_and_flight_points_have_marks_of_their_own_and_a_key_in_full(case: Case) -> None:
    """No name in the key is cut, however long, and the key lies inside the picture."""
    n, J = np.full(9, 9000.0), np.r_[np.zeros(3), np.linspace(0.1, 0.6, 6)]
    found = points(case, n, J * n / 60.0 * case.diameter_m, 0.1)
    name = "a_recording_with_a_name_of_more_than_sixty_letters_in_one_word_2026.csv and 3 more"
    figure = against_band(case, [replace(found, name=name)]).figure()
    figure.canvas.draw()
    (key,) = figure.legends
    told = ["".join(text.get_text().split()) for text in key.get_texts()]
    whole = "".join(name.split())
    assert sum(text.startswith(whole) for text in told) == 2 and len(set(told)) == len(told)
    box = key.get_window_extent()
    assert box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= figure.bbox.x1
    marks = {(bar.lines[0].get_marker(), bar.lines[0].get_color()): bar.lines[0].get_xdata()
             for bar in figure.axes[0].containers}  # fmt: skip
    assert sorted(len(x) for x in marks.values()) == [3, 6]

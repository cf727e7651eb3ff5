"""The promise of the figures of a diagnosis: each with something to show is written and shows it."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from matplotlib.figure import Figure

from bemt.base import canvas
from bemt.judge.diagnose import chain, figures, figures_effects, fit, form, record
from bemt.judge.explanation import NONE, Explanation
from bemt.physics.dataset import Dataset
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case

ALL = set(figures.NAMES)
LEFT_OUT = "compressibility"


@pytest.fixture(scope="module")
def named(project: Path) -> chain.Diagnosis:
    """The solver's own points with 1 % noise against a case without the Mach number."""
    case = load_case(project / "cases" / "prop_8x5" / "case.toml")
    rpm, J = (a.ravel() for a in np.meshgrid([8000.0, 15000.0, 22000.0], [0.0, 0.2, 0.4, 0.6]))
    V = J * rpm / 60.0 * case.diameter_m
    points = prepare_case(case, None, 24).solve(rpm, V, case.air())
    noise = np.random.default_rng(1).standard_normal((2, rpm.size))
    u = {"thrust_N": 0.01 * points.thrust_N, "torque_Nm": 0.01 * points.torque_Nm}
    values = {"rpm": rpm, "airspeed_m_s": V, "density_kg_m3": np.full(rpm.size, 1.225),
              "thrust_N": points.thrust_N + noise[0] * u["thrust_N"],
              "torque_Nm": points.torque_Nm + noise[1] * u["torque_Nm"]}  # fmt: skip
    without = case.replaced({"model.effects_off": [LEFT_OUT]})
    only = [LEFT_OUT, "hub_loss", "pitch_offset", "thrust_gain"]
    return chain.diagnose([record.from_series(Dataset("bench", "own", values, u), without)], [without], only)


def seen_as(answer: chain.Diagnosis, verdict: str, effects: tuple[str, ...]) -> chain.Diagnosis:
    """The same readings with another answer."""
    name = Explanation.of(*(effects[:2] if verdict == "named" else effects[:1]))
    best = fit.fit(answer.found, name)
    decision = replace(answer.decision, verdict=verdict, effects=effects, leading=name)
    parameters = fit.intervals(answer.found, name) if best.ids else {}
    where = None if verdict == "none" else answer.where
    return replace(answer, decision=decision, best=best, parameters=parameters, where=where)


@pytest.mark.parametrize(
    ("verdict", "effects", "expected"),
    [
        ("named", (LEFT_OUT,), ALL),
        ("named", (LEFT_OUT, "thrust_gain"), ALL),
        ("class", ("pitch_offset", LEFT_OUT), ALL),
        ("sensor", ("thrust_gain",), ALL - {"radius"}),
        ("none", (), ALL - {"radius", "posterior"}),
    ],
    ids=["named", "pair", "class", "sensor", "none"],
)
def test_what_there_is_to_show_is_written(
    named: chain.Diagnosis, tmp_path: Path, verdict: str, effects: tuple[str, ...], expected: set[str]
) -> None:
    from PIL import Image

    answer = seen_as(named, verdict, effects)
    if len(effects) == 2 and verdict == "named":  # ids of a pair are in the order of the catalogue
        assert answer.best.ids == effects
    for stem in ALL:
        (tmp_path / f"{stem}.png").write_bytes(b"of an earlier answer")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        written = figures.draw(answer, tmp_path)
    # the matrix needs two effects that the plan sees
    seen = {"confusion"} if np.sum(answer.alike.size >= form.ALIKE) >= 2 else set()
    assert {p.stem for p in written if p.suffix == ".png"} == (expected - {"confusion"}) | (expected & seen)
    assert sorted(written) == sorted(tmp_path.iterdir())
    for path in written:
        assert 2000 < path.stat().st_size <= figures.LARGEST, path.name
        if path.suffix == ".png":
            with Image.open(path) as image:
                assert image.width == 1200
                assert image.convert("RGB").getpixel((0, 0)) == (255, 255, 255)


def dots(axis: object) -> np.ndarray:
    """Readings drawn in a panel, (N, 2)."""
    drawn = [line.get_xydata() for line in axis.lines if line.get_marker() == "."]  # type: ignore[attr-defined]
    return np.concatenate(drawn) if drawn else np.zeros((0, 2))


def test_the_lines_of_the_residual_are_what_its_heading_says(named: chain.Diagnosis) -> None:
    figure, where, problem = figures.residual(named), named.marked, named.problem
    assert where is not None
    axis = next(a for a in figure.axes if "marked region" in a.get_title().replace("\n", " "))
    c = record.CHANNELS.index(where.channel)
    here = (problem.channel == c) & problem.free
    at = problem.covariates[where.variable][problem.point][here]
    inside = (at >= where.low) & (at <= where.high)
    expected = 100.0 * (where.mismatch / problem.largest)[here]
    assert np.sort(dots(axis)[:, 1]) == pytest.approx(np.sort(expected))
    assert expected[inside].mean() == pytest.approx(100.0 * where.size)


def test_the_residual_shows_the_run_and_not_its_reference(
    named: chain.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = np.arange(named.problem.y.size) % 2 == 0
    monkeypatch.setattr(type(named.problem), "free", property(lambda self: free))
    drawn = sum(len(dots(a)) for a in figures.residual(named).axes[:2])
    assert drawn == free.sum() < free.size


@pytest.mark.parametrize(("verdict", "word"), [("unknown", "not confirmed"), ("named", "improved")])
def test_nothing_is_called_improved_where_nothing_is_named(named: chain.Diagnosis, verdict: str, word: str) -> None:
    answer = seen_as(named, verdict, (LEFT_OUT,))
    labels = [str(line.get_label()) for line in figures._before_after(answer).axes[0].lines]
    assert any(word in label for label in labels)
    assert verdict == "named" or not any("improved" in label for label in labels)


def test_the_same_answer_gives_the_same_files_and_leaves_no_figure_open(named: chain.Diagnosis, tmp_path: Path) -> None:
    from matplotlib import pyplot as plt

    before = plt.get_fignums()  # of other tests
    first, second = (figures.draw(named, tmp_path / name) for name in ("a", "b"))
    assert [p.name for p in first] == [p.name for p in second]
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]
    assert plt.get_fignums() == before


@pytest.mark.parametrize(
    "odds", [(0.0, 0.009, -0.25, -0.333), (0.0, 57.2), (0.0, 214.0, -3.1), (0.0, 1.04), (0.0, 0.0)]
)
def test_labels_of_the_ranking_do_not_run_into_each_other(named: chain.Diagnosis, odds: tuple[float, ...]) -> None:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    what = (NONE, *map(Explanation.of, ("untwist", "pitch_offset", "thrust_gain")))
    weights = dict(zip(what, odds, strict=False))
    found = SimpleNamespace(probability=dict.fromkeys(weights, 1 / len(weights)), log_bayes=weights.__getitem__)
    with matplotlib.rc_context(figures.STYLE):
        figure = figures_effects.ranking(SimpleNamespace(found=found, decision=named.decision, p_value=0.2))  # type: ignore[arg-type]
        canvas_ = FigureCanvasAgg(figure)
        canvas_.draw()
        for axis in figure.axes:
            low, high = axis.get_xlim()
            shown = [t for x, t in zip(axis.get_xticks(), axis.get_xticklabels(), strict=True) if low <= x <= high]
            boxes = sorted((t.get_window_extent(canvas_.get_renderer()) for t in shown), key=lambda b: b.x0)
            assert len(boxes) >= 2
            assert all(b.x0 - a.x1 > 3 for a, b in zip(boxes, boxes[1:], strict=False))


def test_the_loads_on_the_blade_add_up_to_the_signature(named: chain.Diagnosis) -> None:
    answer = seen_as(named, "named", (LEFT_OUT,))
    found = figures_effects.blade_loads(answer)
    assert found is not None
    reading, r, dr, curves = found
    assert np.all(np.diff(r) > 0)
    point = answer.problem.point[reading]
    for channel, change in enumerate((curves[1] - curves[0]) @ dr):
        row = np.flatnonzero((answer.problem.point == point) & (answer.problem.channel == channel))
        assert change == pytest.approx(answer.best.signature[row[0]], rel=1e-9)


@pytest.mark.parametrize("name", ["pitch_offset", "thrust_gain", "pitch_offset+thrust_gain"])
def test_the_posterior_that_is_drawn_is_the_one_of_the_intervals(named: chain.Diagnosis, name: str) -> None:
    what = Explanation.of(*name.split("+"))
    weights = fit.weights(named.found, what)
    intervals = fit.intervals(named.found, what)
    assert set(weights) == set(intervals) == what.ids
    for i, p in weights.items():
        assert p.sum() == pytest.approx(1.0)
        ((key, interval),) = intervals[i].items()
        x = np.array([s[key] for s in named.found.of(i).settings])
        middle = np.cumsum(p) - 0.5 * p
        for end, share in (("low", 0.05), ("value", 0.5), ("high", 0.95)):
            assert np.interp(getattr(interval, end), x, middle) == pytest.approx(
                np.clip(share, middle[0], middle[-1]), abs=1e-6
            )


@pytest.mark.parametrize("columns", [1, 2, 3, 4])
def test_titles_of_panels_do_not_touch(columns: int) -> None:
    import matplotlib

    name = "StepsTest_2020-06-16_212137_of_the_second_stand.csv, 20000 to 21000 rev/min"
    with matplotlib.rc_context(canvas.STYLE):
        figure, axes = canvas.blank(3.0, 1, columns)
        for axis in axes[0]:
            axis.set_title(figures._title(name, columns))
        figure.canvas.draw()
        boxes = [axis.title.get_window_extent() for axis in axes[0]]
    assert all(left.x1 < right.x0 for left, right in zip(boxes[:-1], boxes[1:], strict=True))
    assert boxes[0].x0 >= 0.0 and boxes[-1].x1 <= figure.bbox.x1


def test_every_recording_has_a_line_among_those_shown() -> None:
    """A diagnosed recording of one speed beside a reference of many lines."""
    assert figures._chosen([0, 1, 1, 1, 1, 1], [2, 4, 4, 4, 4, 4]) == [0, 1, 3, 5]
    assert figures._chosen([0] * 6, [4] * 6) == [0, 2, 3, 5]
    assert figures._chosen([0, 1], [1, 1]) == [0, 1]


def test_a_reference_has_no_held_out_curve(named: chain.Diagnosis, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its readings are never left out: what is predicted for them is the case before calibration."""
    slow = named.problem.covariates["rpm"][named.problem.point] < 10000.0
    monkeypatch.setattr(type(named.problem), "free", property(lambda self: ~slow))
    axes = figures._before_after(named).axes
    assert {axis.get_title() for axis in axes} >= {"8000 rev/min", "15000 rev/min", "22000 rev/min"}
    held = {a.get_title(): next(line for line in a.lines if "held out" in str(line.get_label())) for a in axes[:3]}
    assert [np.size(held[f"{n} rev/min"].get_xdata()) for n in (8000, 15000, 22000)] == [0, 4, 4]


def rows_of(figure: Figure) -> set[str]:
    return {label.get_text().removesuffix(", as found") for label in figure.axes[0].get_yticklabels()}


def test_effects_that_lead_the_ranking_are_in_the_matrix_before_others(
    named: chain.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = named.alike.ids
    monkeypatch.setattr(figures_effects, "_MOST_EFFECTS", 2)
    pair = ("pitch_offset", "thrust_gain")
    odds = {Explanation.of(*pair): 0.6, Explanation.of(LEFT_OUT): 0.3, NONE: 0.1}
    alike = replace(named.alike, size=np.array([5.0 if i in pair else 9.0 for i in ids]))
    drawn = figures_effects.matrix(replace(named, alike=alike, found=replace(named.found, probability=odds)))
    assert drawn is not None and rows_of(drawn) == set(pair)


def test_a_leading_effect_too_faint_at_usual_strength_is_shown_as_found_or_said(
    named: chain.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = named.alike.ids
    odds = {Explanation.of(LEFT_OUT): 0.6, NONE: 0.4}
    alike = replace(named.alike, size=np.array([0.5 if i == LEFT_OUT else 9.0 for i in ids]))
    faint = replace(named, alike=alike, found=replace(named.found, probability=odds))
    for strength in (9.0, 1.0):
        known = replace(faint.alike, size=np.array([strength if i == LEFT_OUT else 9.0 for i in ids]))
        monkeypatch.setattr(form, "confusion", lambda found, at, known=known: known)
        drawn = figures_effects.matrix(faint)
        assert drawn is not None
        shown, said = LEFT_OUT in rows_of(drawn), LEFT_OUT in drawn.get_suptitle()
        assert (shown, said) == ((True, False) if strength > form.ALIKE else (False, True))


class OneRecord(list[float]):
    """Points of one recording."""

    name, extra = "all", ()


def test_a_static_sweep_beside_runs_in_wind_is_one_line_over_the_speed() -> None:
    J = np.r_[np.linspace(0.1, 0.9, 9), np.zeros(7)]
    rpm = np.r_[np.full(9, 5003.0), np.linspace(2000.0, 7000.0, 7)]
    parts = [SimpleNamespace(record=OneRecord(rpm))]
    answer = SimpleNamespace(problem=SimpleNamespace(parts=parts, covariates={"J": J, "rpm": rpm}))
    found = figures._groups(cast("chain.Diagnosis", answer), "J")
    assert [(line.words, line.over, int(line.points.sum())) for line in found] == [
        ("5003 rev/min", "J", 9), ("J = 0.00", "rpm", 7),
    ]  # fmt: skip

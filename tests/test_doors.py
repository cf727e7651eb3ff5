"""The promise of one rotor, one answer: every door gives the same value, band and words."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bemt
from bemt.base.errors import InputError
from bemt.judge.compare.one_run import compare_run
from bemt.judge.diagnose import assemble, record
from bemt.physics.dataset import Dataset
from bemt.results.report import gather
from bemt.results.sweep.case import solve_case
from bemt.results.sweep.grid import Grid, GridSolver
from bemt.rotors.case import Case, load_case
from bemt.rotors.case.estimate import of_label as estimate
from bemt.rotors.case.prepare import k1k2_case
from bemt.rotors.case.propagate import propagate
from bemt.tools.cfd.openfoam.write import Run, settings_of
from bemt.tools.drive import drive_result
from bemt.tools.drive.drive_result import solve as solve_drive
from bemt.tools.exports.base import Job
from bemt.tools.exports.performance import band_of, performance_of

LABEL, ROOT = "10x5", Path(__file__).resolve().parents[1]
RPM, V = (6000.0, 6000.0, 100.0, 15000.0), (0.0, 8.0, 30.0, 5.0)
"""Hover, flight, far beyond zero thrust, and a tip faster than any that was measured."""
ANGLE = 50.0
READING = Dataset("bench", "run", {"rpm": [6000.0] * 3, "airspeed_m_s": [8.0] * 3, "density_kg_m3": [1.225] * 3,
                                   "thrust_N": [3.0, 3.1, 3.0], "time_s": [0.0, 1.0, 2.0]})  # fmt: skip
CONDITIONS = """
[[assumptions]]
key = "air.density_kg_m3"
low = 1.1
high = 1.3
why = "weather"

[[assumptions]]
key = "operating.airspeed_m_s"
low = 3.0
high = 5.0
why = "wind"

[[assumptions]]
key = "operating.rpm"
low = 5800
high = 6200
why = "droop"
"""
OWN = """schema = "bemt.case/1"
name = "own"
[rotor]
kind = "propeller"
blades = 2
diameter_in = 10
hub_ratio = 0.15
[blade]
chord_law = "apc_like"
max_chord_over_R = 0.2
pitch_in = 5
beta_offset_deg = 0.7
[blade.section]
camber = 0.035
thickness = 0.09
[air]
density_kg_m3 = 1.2
[operating]
rpm = 6000
airspeed_m_s = 4
"""
Answer = list[tuple[float, float, float, float, tuple[str, ...]]]
"""Thrust [N], its standard uncertainty, torque [N m], its standard uncertainty and the flags, point by point."""


def _of(points: Dataset) -> Answer:
    cells = (points.thrust_N, points.u["thrust_N"], points.torque_Nm, points.u["torque_Nm"])
    return list(zip(*(c.tolist() for c in cells), points.flags, strict=True))


def _library(case: Case, rpm: Any, V: Any) -> Answer:
    return _of(bemt.load(case.path).solve(rpm, V))


def _sweep(case: Case, rpm: Any, V: Any) -> Answer:
    """Points of a sweep are those of its references."""
    head = "quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3\n"
    rows = "".join(f"thrust,1,N,unknown,bench,stand,,{n!r},{v!r},\n" for n, v in zip(rpm, V, strict=True))
    (case.folder / "references.csv").write_text(head + rows)
    if load_case(case.path).references_path is None:
        case.path.write_text(case.path.read_text().replace("\nname =", '\nreferences = "references.csv"\nname =', 1))
    found = solve_case(load_case(case.path))
    at = {(r.rpm, r.airspeed_m_s): r for r in found.of("bemt")}
    rows_of = [at[n, v] for n, v in zip(rpm, V, strict=True)]
    # its rows have no band of the torque; the comparisons have, where one was recorded
    return [(r.thrust_N, r.u, r.torque_Nm, np.nan, r.flags) for r in rows_of]


def _export(case: Case, rpm: Any, V: Any) -> Answer:
    out: Answer = []
    for n, v in zip(rpm, V, strict=True):
        b = band_of(case, n, (v, v))
        T, Q = b.thrust_N[0], b.torque_Nm[0]
        out.append((T, b.thrust[0] * abs(T), Q, b.torque[0] * abs(Q), b.flags))
    return out


def _report(case: Case, rpm: Any, V: Any) -> Answer:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gather, "_grids", lambda *_: (np.array(rpm), np.array(V), 0))
        found = gather.case_curves(case)
    at = found.over_rpm
    words = propagate(case, rpm, V, bands=False).points.flags
    assert all(any(kind in told for told in found.flags) for f in words for kind in f) or len(words) > 1
    return [(at.thrust_N[i], at.u["thrust_N"][i], at.torque_Nm[i], at.u["torque_Nm"][i], words[i])
            for i in range(len(words))]  # fmt: skip


def _estimate(case: Case, rpm: Any, V: Any) -> Answer:
    rows = [
        estimate(LABEL, [n], [v], angle_deg=[case.angle_deg]).to_dict()["rows"][0] for n, v in zip(rpm, V, strict=True)
    ]
    return [(r["thrust_N"], r["u_thrust_N"], np.nan, np.nan, tuple(r["flags"])) for r in rows]


DOORS: Mapping[str, Callable[[Case, Any, Any], Answer]] = {
    "library": _library, "sweep": _sweep, "export": _export, "report": _report, "estimate": _estimate,
}  # fmt: skip


@pytest.fixture(scope="module")
def label(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """Case that `new` writes for a label."""
    return load_case(bemt.propeller(LABEL).write(tmp_path_factory.mktemp("label") / "case"))


@pytest.fixture(scope="module")
def oblique(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """The same, with wind at an angle."""
    file = bemt.propeller(LABEL).write(tmp_path_factory.mktemp("oblique") / "case")
    file.write_text(file.read_text().replace("[operating]", f"[operating]\nangle_deg = {ANGLE:g}"))
    return load_case(file)


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """Case whose air and operating point are the unknowns."""
    file = tmp_path_factory.mktemp("own") / "case.toml"
    file.write_text(OWN + CONDITIONS)
    return load_case(file)


@pytest.fixture(scope="module")
def truth(label: Case) -> Answer:
    return _of(propagate(label, RPM, V).points)


def _same(got: Answer, expected: Answer) -> None:
    for one, other in zip(got, expected, strict=True):
        for a, b in zip(one[:4], other[:4], strict=True):
            assert np.isnan(a) or a == pytest.approx(b, rel=1e-9)
        assert one[4] == other[4]


@pytest.mark.parametrize("door", DOORS)
def test_every_door_gives_the_same_value_band_and_words(door: str, label: Case, truth: Answer) -> None:
    _same(DOORS[door](label, RPM, V), truth)


@pytest.mark.parametrize("door", [d for d in DOORS if d != "estimate"])
def test_an_unknown_air_or_operating_point_acts_at_every_door(door: str, own: Case) -> None:
    rpm, V = (6000.0, 6000.0, 9000.0), (4.0, 0.0, 7.0)
    expected = _of(propagate(own, rpm, V).points)
    _same(DOORS[door](own, rpm, V), expected)


@pytest.mark.parametrize("door", DOORS)
def test_every_door_solves_at_the_angle_of_the_case(door: str, oblique: Case, label: Case) -> None:
    rpm, V = (6000.0, 6000.0, 9000.0), (0.0, 8.0, 15.0)
    expected = _of(propagate(label, rpm, V, angle_deg=ANGLE).points)
    _same(DOORS[door](oblique, rpm, V), expected)
    axial = _of(propagate(label, rpm, V).points)
    assert expected[0] == axial[0] and all(a[0] > 1.2 * b[0] for a, b in zip(expected[1:], axial[1:], strict=True))


def _in_flight(case: Case) -> Case:
    return case.replaced({"operating.airspeed_m_s": 8.0})


AXIAL: Mapping[str, Callable[[Case, Path], Any]] = {
    "drive": lambda case, _: solve_drive(case, 8.0),
    "performance table": lambda case, _: performance_of(case, 6000.0),
    "airspeed of an export": lambda case, _: Job(case).airspeed,
    "openfoam": lambda case, _: settings_of(case, Run()),
    "along the blade": lambda case, _: gather.radial_curves(case),
    "gradient": lambda case, _: bemt.load(case.path).gradient(6000.0),
    "diagnose": lambda case, _: assemble.build([record.from_series(READING, case)], [case]),
}


@pytest.mark.parametrize("door", AXIAL)
def test_doors_that_know_axial_flow_only_refuse_an_angle(door: str, oblique: Case, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"operating\.angle_deg: got 50 deg"):
        AXIAL[door](_in_flight(oblique), tmp_path)


def test_a_drive_at_rest_has_no_wind_to_turn(oblique: Case, label: Case) -> None:
    with_motor, other = (bemt.drive(c.path.as_posix(), kv=1000, cells=4).full for c in (oblique, label))
    assert with_motor["thrust_N"] == other["thrust_N"]


def test_k1k2_has_no_answer_at_an_angle(oblique: Case) -> None:
    air, V = oblique.air(), np.array([0.0, 8.0])
    found = k1k2_case(oblique, None, np.full(2, 6000.0), V, air)
    axial = k1k2_case(oblique, None, np.full(2, 6000.0), V, air, 0.0)
    assert found.thrust_N[0] == axial.thrust_N[0] and np.isnan(found.thrust_N[1]) and found.flags[1]


def test_a_grid_over_the_angle_is_the_library_point_by_point(oblique: Case) -> None:
    case = oblique.replaced({"operating.angle_deg": 0.0, "sweep.angle_deg": [0.0, 90.0, 180.0],
                             "sweep.airspeed_m_s": [0.0, 8.0]})  # fmt: skip
    grid = Grid.of(case)
    assert grid is not None and grid.names == ("airspeed_m_s", "angle_deg")
    got = GridSolver(case, grid).block(np.arange(grid.size)).columns
    V, angle = np.repeat([0.0, 8.0], 3), np.tile([0.0, 90.0, 180.0], 2)
    expected = bemt.load(oblique.path).solve(case.rpm, V, angle_deg=angle, bands=False)
    for name in ("thrust_N", "torque_Nm", "J", "H_force_N"):
        np.testing.assert_allclose(got[name], expected[name], rtol=1e-6, atol=1e-9)  # tables of other speeds
    alone = GridSolver(case, grid).block(np.array([5])).columns  # descent without oblique company
    assert alone["J"] == pytest.approx(expected["J"][5]) and alone["H_force_N"] == 0.0


def test_an_unknown_angle_widens_the_band_where_the_point_shares_it(oblique: Case, tmp_path: Path) -> None:
    text = oblique.path.read_text().replace('references = "references.csv"', "")
    more = '\n[[assumptions]]\nkey = "operating.angle_deg"\nlow = 40\nhigh = 60\nwhy = "pitch of the vehicle"\n'
    (tmp_path / "case.toml").write_text(text + more)
    case = load_case(tmp_path / "case.toml")
    moved = {m.unknown.key: m for m in propagate(case, 6000.0, 8.0).moved}["operating.angle_deg"]
    low, high = (propagate(oblique, 6000.0, 8.0, angle_deg=a, bands=False).points.thrust_N for a in (40.0, 60.0))
    assert (moved.runs[0]["thrust_N"], moved.runs[1]["thrust_N"]) == (low, high) and moved.u["thrust_N"] > 0.0
    elsewhere = propagate(case, 6000.0, 8.0, angle_deg=10.0).moved
    assert {m.unknown.key: m for m in elsewhere}["operating.angle_deg"].u["thrust_N"] == 0.0


@pytest.mark.parametrize(("channel", "factor"), [("sideslip_deg", 1.0), ("sideslip_rad", np.pi / 180.0)])
def test_one_run_is_compared_at_its_recorded_angle(channel: str, factor: float, label: Case, tmp_path: Path) -> None:
    angles = (0.0, 60.0)
    rows = "".join(f"6000,10,1.225,{angle * factor:.12g},3,0.06\n" for angle in angles)
    (tmp_path / "cfd.csv").write_text(f"rpm,airspeed_m_s,density_kg_m3,{channel},thrust_N,torque_Nm\n{rows}")
    points = compare_run(tmp_path / "cfd.csv", label).points
    expected = propagate(label, 6000.0, 10.0, 1.225, angle_deg=angles, bands=False).points
    assert [point.loads["thrust_N"].bemt for point in points] == pytest.approx(list(expected.thrust_N), rel=1e-7)


@pytest.mark.parametrize("table", ["operating]\nangle_deg = 30", "sweep]\nangle_deg = [0, 30]"])
def test_a_ducted_rotor_at_an_angle_is_refused(table: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "cases" / "ds30", tmp_path / "ds30")
    file, (name, _, line) = tmp_path / "ds30" / "case.toml", table.partition("]\n")
    text = file.read_text()
    head = f"[{name}]"
    file.write_text(text.replace(head, f"{head}\n{line}") if head in text else f"{text}\n{head}\n{line}\n")
    with pytest.raises(InputError, match=rf"{name}\.angle_deg: got 30 deg on a ducted rotor"):
        load_case(file)


@pytest.mark.parametrize("value", ["-1", "181", '"30"'])
def test_an_angle_that_is_none_is_refused(value: str, oblique: Case, tmp_path: Path) -> None:
    text = oblique.path.read_text().replace('references = "references.csv"', "")
    (tmp_path / "case.toml").write_text(text.replace("angle_deg = 50", f"angle_deg = {value}"))
    with pytest.raises(InputError, match=r"operating\.angle_deg"):
        load_case(tmp_path / "case.toml")


def test_parts_of_a_band_are_those_unknowns_that_the_point_shares_with_the_case(own: Case) -> None:
    at = propagate(own, [6000.0, 6000.0, 9000.0], [4.0, 0.0, 7.0], [1.2, 1.2, 1.0])
    u = {one.unknown.key: one.u["thrust_N"] for one in at.moved}
    T = at.points.thrust_N
    assert np.all(u["operating.rpm"][:2] > 0.0) and u["operating.rpm"][2] == 0.0
    assert u["operating.airspeed_m_s"][0] > 0.0 and np.all(u["operating.airspeed_m_s"][1:] == 0.0)
    assert u["air.density_kg_m3"][2] == 0.0
    # at rest thrust goes with the density and the square of the speed, up to Reynolds and Mach number
    assert u["air.density_kg_m3"][1] / T[1] == pytest.approx(0.2 / 1.2 / np.sqrt(12.0), rel=0.1)
    assert u["operating.rpm"][1] / T[1] == pytest.approx(2.0 * 400.0 / 6000.0 / np.sqrt(12.0), rel=0.1)
    total = np.sqrt(sum(part["thrust_N"] ** 2 for part in at.points.u_by.values()))
    np.testing.assert_allclose(at.points.u["thrust_N"], total)
    np.testing.assert_allclose(at.points.u_by["input"]["thrust_N"], np.sqrt(sum(v**2 for v in u.values())))


def test_a_point_does_not_depend_on_its_company(label: Case, truth: Answer) -> None:
    _same(_of(propagate(label, RPM[1:2], V[1:2]).points), truth[1:2])


def test_bands_go_through_any_function_of_the_loads(own: Case) -> None:
    at = propagate(own, [6000.0, 9000.0], [4.0, 0.0])
    values, u = at.carry(lambda loads: {"same": loads["thrust_N"], "twice": 2.0 * loads["thrust_N"]})
    np.testing.assert_array_equal(values["same"], at.points.thrust_N)
    for origin, part in at.points.u_by.items():
        np.testing.assert_allclose(u[origin]["same"], part["thrust_N"], atol=1e-12)
        np.testing.assert_allclose(u[origin]["twice"], 2.0 * part["thrust_N"], atol=1e-12)


def test_the_drive_asks_the_same_rotor() -> None:
    found = bemt.drive(LABEL, kv=1000, cells=6)
    full = found.full["rpm"].value
    rotor = bemt.propeller(LABEL).solve(full, 0.0)
    assert found.full["thrust_N"].value == pytest.approx(rotor.thrust_N[0], rel=2e-3)
    assert set(rotor.flags[0]) <= set(found.notes) and rotor.flags[0]
    bare = drive_result.full_throttle(found.case)
    assert bare["thrust_N"].value == pytest.approx(found.full["thrust_N"].value, rel=2e-3)
    assert bare["thrust_N"].u == pytest.approx(found.full["thrust_N"].u, rel=2e-2)


OUTSIDE: Mapping[str, tuple[str, float, float, str]] = {
    "J 70": ("10x5", 100.0, 30.0, "zero thrust"), "Re 5,000": ("10x5", 430.0, 0.0, ""),
    "Re 1,000": ("10x5", 86.0, 0.0, "Re "), "4 in": ("4x2.5", 9000.0, 0.0, ""),
    "28 in": ("28x9", 3000.0, 0.0, "diameter"), "3 blades": ("8x4.5x3", 6000.0, 0.0, ""),
    "6 blades": ("8x4.5x6", 6000.0, 0.0, "6 blades"), "Mach 0.9": ("10x5", 23000.0, 0.0, "tip Mach"),
    "supersonic": ("10x5", 27000.0, 0.0, "supersonic"),
}  # fmt: skip
"""Label, rev/min, m/s and what is said, if anything."""


@cache
def _words(label: str, rpm: float, V: float, folder: Path) -> dict[str, tuple[str, ...]]:
    p = bemt.propeller(label)
    case = load_case(p.write(folder / f"{label}_{rpm:g}"))
    reading = Dataset("bench", "run", {"rpm": [rpm] * 3, "airspeed_m_s": [V] * 3, "density_kg_m3": [1.225] * 3,
                                       "thrust_N": np.full(3, float(p.solve(rpm, V, bands=False).thrust_N[0])),
                                       "time_s": [0.0, 1.0, 2.0]})  # fmt: skip
    diagnosed = assemble.build([record.from_series(reading, case)], [case]).validity
    return {
        "solve": p.solve(rpm, V, bands=False).flags[0],
        "sweep": _sweep(case, [rpm], [V])[0][4],
        "estimate": tuple(estimate(label, [rpm], [V]).to_dict()["rows"][0]["flags"]),
        "diagnose": tuple(words.removeprefix("3 of 3 points of the recording: ") for words in diagnosed),
    }


@pytest.mark.parametrize("what", OUTSIDE)
def test_where_no_rotor_was_measured_the_same_words_stand_at_every_door(
    what: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    label, rpm, V, expected = OUTSIDE[what]
    words = _words(label, rpm, V, tmp_path_factory.mktemp("words"))
    assert len(set(words.values())) == 1, words
    said = " ".join(words["solve"])
    assert (expected in said) if expected else not said


def test_a_fan_has_the_same_flags_at_every_door() -> None:
    path = ROOT / "cases" / "ds30"
    fan = bemt.load(path)
    words = fan.solve(55000.0, 0.0, bands=False).flags
    assert "beyond what was measured" in " ".join(words[0])
    (said,) = [w for w in bemt.drive("5x3", kv=2600, cells=4).notes if w.startswith("beyond what was measured")]
    assert re.fullmatch(
        r".*: tip Mach 0\.\d+ \(rotors up to 0\.\d+\), so that the model's own uncertainty is \d+ % wider", said
    )
    assert solve_case(load_case(path)).rows[0].flags == words[0]
    assert band_of(load_case(path), 55000.0, (0.0, 0.0)).flags == words[0]


def test_far_beyond_zero_thrust_the_band_is_wider_than_the_value_and_not_to_be_trusted(truth: Answer) -> None:
    hover, flight, beyond, _ = truth
    assert not hover[4] and not flight[4] and hover[1] < 0.3 * hover[0]
    assert beyond[1] > abs(beyond[0]) and "do not trust" in " ".join(beyond[4])


@pytest.mark.parametrize(
    ("rotor", "reading"), [("APC 10x5E", None), ("10x5MR", None), ("5x4x3", None), ("10x5", "rpm=8000,thrust_g=900")]
)
def test_a_name_a_suffix_and_a_reading_give_one_rotor_at_every_door(
    rotor: str, reading: str | None, tmp_path: Path
) -> None:
    rpm = 8000.0
    truth = bemt.estimate(rotor, rpm, reading=reading).to_dict()["rows"][0]["thrust_N"]
    if reading is not None:
        assert truth != pytest.approx(bemt.estimate(rotor, rpm).to_dict()["rows"][0]["thrust_N"], rel=0.01)
    bemt.new(rotor, reading=reading, out=tmp_path / "case")
    written = load_case(tmp_path / "case")
    assert bemt.propeller(rotor, reading=reading).solve(rpm, bands=False).thrust_N[0] == pytest.approx(truth, rel=1e-9)
    assert propagate(written, rpm, 0.0, bands=False).points.thrust_N[0] == pytest.approx(truth, rel=1e-9)

    def lifts(speed: float) -> float:
        return float(bemt.estimate(rotor, speed, reading=reading).to_dict()["rows"][0]["thrust_N"])

    full = {k: band.value for k, band in bemt.drive(rotor, kv=1000, cells=3, reading=reading).full.items()}
    assert full["thrust_N"] == pytest.approx(lifts(full["rpm"]), rel=2e-3)
    first = bemt.choose(0.6 * truth, 4, labels=rotor, reading=reading).table.iloc[0]
    assert lifts(first.rpm) == pytest.approx(0.6 * truth, rel=2e-3)

"""Headings mean the same everywhere, several grids are one point with u."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.data.readers.cfd import unique
from bemt.data.recordings.cfd_options import run_from, write_run
from bemt.data.recordings.cfd_run import assemble, run_at
from bemt.data.recordings.cfd_setup import CfdRun, grid_floor
from bemt.data.recordings.channels import named
from bemt.data.recordings.grid_study import grid_study, ratios
from bemt.data.recordings.grids import LoadStudy, are_grids, by_grid, together
from bemt.data.recordings.load import as_dataset, import_file, import_files
from bemt.judge.actions import compare
from bemt.judge.diagnose.load import load_all
from bemt.judge.import_files import import_
from bemt.physics.dataset import Dataset
from bemt.results.report.diagnosis_block import study_parts
from bemt.rotors.case import load_case

SPEEDS, LOADS = (0.0, 5.0, 10.0, 15.0), (7.6, 6.0, 4.0, 1.5)
"""Airspeeds [m/s] and thrusts [N] of every table made here."""


def workbench(heads: list[tuple[str, str]]) -> str:
    told = ",".join(f"P{k} - {name} [{unit}]" if unit else f"P{k} - {name}" for k, (name, unit) in enumerate(heads, 1))
    names = ",".join(f"P{k}" for k in range(1, len(heads) + 1))
    return f"# The parameters defined in the project are:\n# ,{told}\nName,{names}\n" + rows("DP {k},")


def cfd_post(heads: list[tuple[str, str]]) -> str:
    return "[Name]\nruns\n\n[Data]\n" + ", ".join(f"{n} [ {u} ]" if u else n for n, u in heads) + "\n" + rows()


def table(heads: list[tuple[str, str]]) -> str:
    return ",".join(f"{n} [{u}]" if u else n for n, u in heads) + "\n" + rows()


def rows(first: str = "") -> str:
    pairs = enumerate(zip(SPEEDS, LOADS, strict=True))
    return "".join(first.format(k=k) + f"6000,{V},{T},{0.02 * T:.4g}\n" for k, (V, T) in pairs)


def points(path: Path) -> Dataset:
    """Points of a file, by the door that every command uses."""
    return run_at(str(path)) or named(as_dataset(import_file(path)))


@pytest.mark.parametrize("program", [workbench, cfd_post, table])
@pytest.mark.parametrize("unit", ["m s^-1", "m/s"])
@pytest.mark.parametrize("name", ["V", "U", "v", "Velocity", "velocity", "Vinf", "U_inf", "V0", "Airspeed", "Wind",
                                  "freestream velocity", "Geschwindigkeit"])  # fmt: skip
def test_an_airspeed_is_an_airspeed_in_every_reader(
    tmp_path: Path, program: Callable[..., str], name: str, unit: str
) -> None:
    (tmp_path / "a.csv").write_text(program([("rpm", "rev min^-1" if program is not table else "rpm"), (name, unit),
                                             ("thrust", "N"), ("torque", "N m")]))  # fmt: skip
    assert points(tmp_path / "a.csv")["airspeed_m_s"] == pytest.approx(SPEEDS)


@pytest.mark.parametrize("program", [workbench, cfd_post, table])
@pytest.mark.parametrize("thrust", ["T", "F", "Thrust", "thrust force"])
@pytest.mark.parametrize("torque", ["Q", "M", "Torque"])
def test_letters_with_their_units_are_the_loads(
    tmp_path: Path, program: Callable[..., str], thrust: str, torque: str
) -> None:
    heads = [("n", "rev min^-1" if program is not table else "rpm"), ("J", ""), (thrust, "N"), (torque, "N m")]
    (tmp_path / "a.csv").write_text(program(heads))
    found = points(tmp_path / "a.csv")
    assert found["thrust_N"] == pytest.approx(LOADS)
    assert found["torque_Nm"] == pytest.approx(0.02 * np.array(LOADS))
    assert found["J"] == pytest.approx(SPEEDS)
    assert found["rpm"] == pytest.approx([6000] * 4)


@pytest.mark.parametrize("name", ["tip speed", "v_tip", "exit velocity", "axial velocity", "wall shear velocity"])
def test_another_speed_is_no_airspeed_and_is_named(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.csv").write_text(
        workbench([("rpm", "rev min^-1"), (name, "m s^-1"), ("thrust", "N"), ("torque", "N m")])
    )
    found = run_at(str(tmp_path / "a.csv"))
    assert found is not None and "airspeed_m_s" not in found
    assert any(name in note and "no repeats" in note for note in found.notes)


def test_an_airspeed_without_a_unit_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(workbench([("rpm", "rev min^-1"), ("V", ""), ("thrust", "N"), ("torque", "N m")]))
    with pytest.raises(InputError, match="unit of the airspeed"):
        run_at(str(tmp_path / "a.csv"))
    run = run_from([str(tmp_path / "a.csv")], unit=["airspeed=m/s"])
    assert assemble(run)["airspeed_m_s"] == pytest.approx(SPEEDS)


def test_an_unknown_zone_is_one_line_with_those_there_are(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        workbench([("rpm", "rev min^-1"), ("V", "m/s"), ("thrust (blade)", "N"), ("thrust (duct)", "N")])
    )
    with pytest.raises(InputError) as caught:
        assemble(run_from([str(tmp_path / "a.csv")], zones=["fan"]))
    (fault,) = caught.value.faults
    assert "fan" in fault.got and "blade" in fault.hint and "duct" in fault.hint


GRIDS = {0.5e6: 7.05, 1.7e6: 7.42, 5.8e6: 7.57}
"""Cells and thrust [N]: order 2.22, 7.671 N, u 1.5 %."""


def histories(folder: Path, grids: dict[float, float] = GRIDS) -> list[str]:
    out = []
    for cells, thrust in grids.items():
        k = np.arange(1, 301)
        T = thrust * (1.0 - np.exp(-k / 10.0))
        body = "".join(f"{i} {a:.9g} {b:.9g}\n" for i, a, b in zip(k, T, 0.015 * T, strict=True))
        path = folder / f"t_{cells:.0f}.out"
        path.write_text('"t"\n"Iteration" "thrust etc.."\n("Iteration" "thrust" "torque")\n' + body)
        out.append(str(path))
    return out


@pytest.fixture
def runs(tmp_path: Path) -> list[str]:
    """A run.toml for each grid."""
    made = []
    for file, cells in zip(histories(tmp_path), GRIDS, strict=True):
        run = run_from([file], rpm=6000.0, unit=["thrust=N", "torque=N m"], setup=[f"cells={cells:g}"])
        made.append(str(write_run(run, str(tmp_path / f"run_{cells:.0f}.toml"))))
    return made


@pytest.fixture
def tables(tmp_path: Path) -> list[str]:
    """A table for each grid, with the cells in a column."""
    made = [tmp_path / f"table_{cells:.0f}.csv" for cells in GRIDS]
    for path, (cells, T) in zip(made, GRIDS.items(), strict=True):
        path.write_text(f"rpm,thrust [N],torque [Nm],cells\n6000,{T},{0.015 * T},{cells:.0f}\n")
    return list(map(str, made))


def is_the_study(found: Dataset) -> None:
    assert len(found) == 1
    thrust = next(s for s in found.studies if s.channel == "thrust_N")
    assert thrust.order == pytest.approx(2.22, abs=0.005)
    assert thrust.extrapolated == pytest.approx(7.671, abs=0.001)
    assert found["thrust_N"][0] == pytest.approx(7.57, rel=1e-4)
    assert found.u["thrust_N"][0] / 7.57 == pytest.approx(0.0146, abs=0.0003)
    assert not any("no grid study" in note for note in found.notes)


def test_three_runs_are_one_study_by_every_way_to_say_so(tmp_path: Path, runs: list[str], tables: list[str]) -> None:
    options = {"rpm": 6000.0, "unit": ["thrust=N", "torque=N m"]}
    by_list = run_from(histories(tmp_path), **options, setup=["cells=0.5e6,1.7e6,5.8e6"])
    for k, run in enumerate((run_from(runs), by_list, run_from(tables))):
        is_the_study(assemble(run))
        path = write_run(run, str(tmp_path / f"study_{k}.toml"))
        is_the_study(import_file(path))
        assert import_files([str(path)]).document()["runs"][0]["studies"]
    is_the_study(together([import_file(r) for r in runs]))
    lines = [f"6000,{T},{0.015 * T},{n:.0f}" for n, T in GRIDS.items()]
    (tmp_path / "t.csv").write_text("rpm,thrust [N],torque [Nm],cells\n" + "\n".join(lines) + "\n")
    is_the_study(import_file(tmp_path / "t.csv"))
    told = "# ,P1 - rpm [rev min^-1],P2 - T [N],P3 - Q [N m],P4 - number of cells\nName,P1,P2,P3,P4\n"
    (tmp_path / "d.csv").write_text(told + "\n".join(f"DP {k},{line}" for k, line in enumerate(lines)) + "\n")
    found = run_at(str(tmp_path / "d.csv"))
    assert found is not None
    is_the_study(found)


def test_three_grids_are_no_repeats_where_a_diagnosis_reads_them(
    project: Path, runs: list[str], tables: list[str]
) -> None:
    case = str(project / "cases" / "prop_8x5")
    for files in (runs, tables):
        (record,) = load_all(files, [case])[1]
        assert len(record) == 1
        assert record.gain["thrust_N"] == pytest.approx(0.0146, abs=0.0003)
        (alone,) = load_all(files[:1], [case])[1]
        assert alone.gain["thrust_N"] == pytest.approx(grid_floor("thrust_N", False), rel=1e-3)
    assert load_case(Path(case) / "case.toml").name == "prop_8x5"


def test_what_is_stated_counts_beside_a_case(project: Path, tmp_path: Path) -> None:
    """Exports without units are not forgotten on the way to the band, and need no file in between."""
    file = histories(tmp_path)[-1]
    case, told = project / "cases" / "prop_8x5", {"thrust": "N", "torque": "N m"}
    seen = import_(file, case=case, rpm=6000.0, unit=told).to_dict()["prediction"]
    assert seen["channels"]["thrust_N"]["readings"] == 1
    wrong = import_(file, case=case, rpm=6000.0, unit=told | {"thrust": "mN"}).to_dict()["prediction"]
    right, small = (1.0 + d["channels"]["thrust_N"]["median_change"] for d in (seen, wrong))
    assert small == pytest.approx(1e-3 * right, rel=1e-3)
    found = compare(file, case=case, rpm=6000.0, unit=told).to_dict()
    (point,) = found["points"]
    assert point["loads"]["thrust_N"]["cfd"] == pytest.approx(7.57, rel=1e-4)
    assert point["loads"]["thrust_N"]["u_cfd"] == pytest.approx(7.57 * grid_floor("thrust_N", False), rel=1e-3)
    thousandth = compare(file, case=case, rpm=6000.0, unit={"thrust": "mN", "torque": "N m"}).to_dict()
    assert thousandth["points"][0]["loads"]["thrust_N"]["cfd"] == pytest.approx(7.57e-3, rel=1e-4)


def test_a_condition_on_one_grid_owes_what_the_grid_costs_elsewhere() -> None:
    d = CfdRun("cfd", "a", {"rpm": [6e3] * 4, "airspeed_m_s": [0, 0, 0, 9.0], "thrust_N": [7.05, 7.42, 7.57, 4.0]})
    found = by_grid(d, np.array([0.5e6, 1.7e6, 5.8e6, 5.8e6]))
    assert found["thrust_N"] == pytest.approx([7.57, 4.0])
    assert found.u["thrust_N"] / found["thrust_N"] == pytest.approx([0.0146, 0.0146], abs=3e-4)


@pytest.mark.parametrize(
    ("values", "word"),
    [((7.05, 7.6, 7.4), "oscillatory"), ((7.0, 7.1, 7.4), "divergent"), ((5.0, 7.56, 7.57), "implausible")],
)
def test_grids_that_do_not_converge_are_worth_three_times_their_spread(values: tuple[float, ...], word: str) -> None:
    d = CfdRun("cfd", "a", {"rpm": [6e3] * 3, "thrust_N": list(values)})
    found = by_grid(d, np.array([1e6, 8e6, 64e6]))
    assert any(word in note for note in found.notes)
    spread = (max(values) - min(values)) / values[2]
    assert found.u["thrust_N"][0] / found["thrust_N"][0] == pytest.approx(3.0 * spread / 1.15, rel=1e-6)


@pytest.mark.parametrize("order", [1.0, 1.7, 2.0])
def test_the_order_and_the_limit_of_a_power_law_come_back(order: float) -> None:
    cells = np.array([0.4e6, 1.5e6, 7e6])
    d = CfdRun("cfd", "a", {"rpm": [6e3] * 3, "thrust_N": 7.0 * (1.0 - 30.0 * cells ** (-order / 3.0))})
    (study,) = by_grid(d, cells).studies
    assert study.order == pytest.approx(order, rel=1e-6)
    assert study.extrapolated == pytest.approx(7.0, rel=1e-6)


def test_one_grid_keeps_the_floor_and_runs_of_unlike_conditions_are_no_study(tmp_path: Path, runs: list[str]) -> None:
    one, two, _ = (import_file(r) for r in runs)
    assert one.u["thrust_N"][0] / one["thrust_N"][0] == pytest.approx(grid_floor("thrust_N", False), rel=1e-3)
    fast = replace(two, name="b", values={**two.values, "rpm": two["rpm"] * 1.1})
    assert are_grids([one, two]) and not are_grids([one, fast]) and not are_grids([one, one])
    with pytest.raises(InputError, match="not stated"):
        together([one, CfdRun("cfd", "c", two.values)])


@pytest.mark.parametrize(
    "wrong",
    ["[run]\nrpm = 6000\n", '[[grids]]\nfiles = ["a"]\n', '[run]\nfiles = ["a"]\n' + 2 * '[[grids]]\nfiles = ["a"]\n'],
)
def test_what_is_neither_a_run_nor_grids_is_refused(tmp_path: Path, wrong: str) -> None:
    (tmp_path / "run.toml").write_text(wrong)
    with pytest.raises(InputError, match="exports of one run|two or more"):
        import_file(tmp_path / "run.toml")


def test_numbers_that_no_grid_gives_are_no_study() -> None:
    d = CfdRun("cfd", "a", {"rpm": [6e3] * 2, "thrust_N": [0.0, 7.5], "torque_Nm": [0.1, math.nan]})
    found = by_grid(d, np.array([1e6, 8e6]))
    assert found.studies == ()
    assert found.u["thrust_N"][0] == pytest.approx(7.5 * grid_floor("thrust_N", False))


def test_a_heading_that_is_repeated_ten_thousand_times_costs_no_more_than_another() -> None:
    """Names made unique one by one would take minutes."""
    start = time.process_time()
    made = unique(["x"] * 30_000 + ["x#7", "y"])
    assert time.process_time() - start < 5.0
    assert len(set(made)) == len(made) and made[:3] == ["x", "x#2", "x#3"] and made[-2:] == ["x#7", "y"]
    assert made[6] == "x#8"  # a heading of the file keeps its name


def test_a_study_in_the_folder_of_a_case_stands_for_the_runs_that_it_names(
    project: Path, tmp_path: Path, runs: list[str]
) -> None:
    (tmp_path / "case.toml").write_bytes((project / "cases" / "prop_8x5" / "case.toml").read_bytes())
    (tmp_path / "references.csv").write_bytes((project / "cases" / "prop_8x5" / "references.csv").read_bytes())
    case = load_case(tmp_path / "case.toml")
    assert [p.name for p in case.run_paths] == sorted(Path(r).name for r in runs)
    study = write_run(run_from(runs), str(tmp_path / "study.toml"))
    assert case.run_paths == (study,)
    assert {Path(r).name for r in runs} | {"study.toml"} <= {p.name for p in case.files()}
    (_, figures), *_ = study_parts([s.document() for s in import_file(study).studies])
    assert len(figures) == 2 and "order 2.22, 7.67" in figures[0].note


def test_a_table_of_grids_is_kept_as_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "512000,6000,4.90,0.0861\n1730000,6000,5.15,0.0850\n5840000,6000,5.25,0.0845\n"
    Path("grids.csv").write_text("cells,rpm,thrust_N,torque_Nm\n" + rows)
    Path("bare.csv").write_text("cells,thrust_N,torque_Nm\n" + rows.replace("6000,", ""))
    told = import_("grids.csv", out="study.toml").text
    assert "study.toml written. Next: bemt compare study.toml" in told and "no unit known" not in told
    assert "--rpm 6000" in import_("bare.csv", rpm=6000.0).text.split("Next:")[1]
    import_("bare.csv", rpm=6000.0, out="stated.toml")  # the file keeps the speed that no column has
    read = [import_(name).to_dict()["runs"][0] for name in ("grids.csv", "study.toml", "stated.toml")]
    assert read[0]["points"] == read[1]["points"] == read[2]["points"] != []


def test_a_recording_keeps_speeds_that_no_column_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("rpm,thrust (N)\n4000,1\n6000,2\n8000,4\n")
    import_("a.csv", airspeed_m_s=5.0, rpm=9000.0, out="kept.toml")
    kept = import_file("kept.toml")
    assert kept["airspeed_m_s"] == pytest.approx([5.0] * 3) and kept["rpm"] == pytest.approx([4e3, 6e3, 8e3])
    assert any("rpm: ignored" in note for note in kept.notes)


@pytest.mark.parametrize("head", ["cell size (mm)", "cell_size", "Base Size [mm]", "element_size", "dx_mm"])
def test_a_table_of_cell_sizes_is_the_study_of_their_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, head: str
) -> None:
    """Celik 2008: h is the cube root of volume over cells; only its ratios count."""
    monkeypatch.chdir(tmp_path)
    loads, h = ("7.57", "7.42", "7.05"), (1.0, 1.5, 2.25)
    for name, column, values in (("n.csv", "cells", [8e6 / v**3 for v in h]), ("h.csv", head, h)):
        rows = "".join(f"{v!r},6000,{T}\n" for v, T in zip(values, loads, strict=True))
        Path(name).write_text(f"{column},rpm,thrust (N)\n{rows}")
    by_count, by_size = (import_file(name) for name in ("n.csv", "h.csv"))
    assert by_size["thrust_N"] == by_count["thrust_N"] and len(by_size) == 1
    assert by_size.u["thrust_N"] == pytest.approx(by_count.u["thrust_N"], rel=1e-9)
    (one,), (other,) = (d.studies for d in (by_size, by_count))
    assert (one.order, one.extrapolated) == pytest.approx((other.order, other.extrapolated))
    assert one.h == pytest.approx(other.h) and not one.cells and "cells of 1, 1.5, 2.25" in one.sentence()
    import_("h.csv", out="study.toml")
    assert import_file("study.toml").u["thrust_N"] == by_size.u["thrust_N"]
    (_, (figure,)), *_ = study_parts([one.document()])
    assert "order 2.23" in figure.note


@pytest.mark.parametrize(("head", "cells"), [("power (W)", 4), ("torque (Nm)", 4), ("temperature (C)", 2_000_000)])
def test_the_cells_of_a_battery_are_no_grid_and_no_column_is_lost(tmp_path: Path, head: str, cells: int) -> None:
    (tmp_path / "bench.csv").write_text(f"rpm,thrust (N),{head},cells\n4000,3.1,20,{cells}\n6000,7.0,21,{cells}\n")
    assert not isinstance(import_file(tmp_path / "bench.csv"), CfdRun)


@pytest.mark.parametrize("size", [1, 100])
def test_a_height_is_no_size_of_cells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{h * size},6000,{T}\n" for h, T in ((1, 7.57), (1.5, 7.42), (2.25, 7.05)))
    Path("ground.csv").write_text("h [mm],rpm,thrust (N)\n" + rows)
    told = import_("ground.csv")
    assert "a height, or the size of cells?" in told.text and len(import_file("ground.csv")) == 3


@pytest.mark.parametrize(
    "text",
    [
        "Design Points,rpm [rev min^-1],Vinf [m s^-1],thrust [lbf],torque [ozf in]\nDP0,6000,4,1,10\n",
        "Name,P1 - rpm [rpm],P2 - Vinf [m/s],P3 - thrust-op [lbf],P4 - torque-op [ozf in]\nDP 0,6000,4,1,10\n",
        "# a project\nName,P1 - rpm,P2 - Vinf,P3 - thrust,P4 - torque\nUnits,rpm,m/s,lbf,ozf in\nDP 0,6000,4,1,10\n",
        "Name,rpm [rpm],V [m/s],thrust [lbf],torque [ozf in]\nDP0,6000,4,1,10\n",
    ],
)
def test_a_table_of_workbench_has_its_units_in_the_headings_or_in_a_row(tmp_path: Path, text: str) -> None:
    (tmp_path / "dp.csv").write_text(text)
    found = run_at(str(tmp_path / "dp.csv"))
    assert found is not None and found["rpm"] == pytest.approx([6000]) and found["airspeed_m_s"] == pytest.approx([4])
    assert found["thrust_N"] == pytest.approx([4.4482216]) and found["torque_Nm"] == pytest.approx(
        [0.0706155], rel=1e-5
    )
    with pytest.raises(InputError, match="got N, where the file says lbf"):
        assemble(run_from([str(tmp_path / "dp.csv")], unit=["thrust=N"]))
    with pytest.raises(InputError, match="got 0, where the rows have 4"):
        run_at(str(tmp_path / "dp.csv"), airspeed_m_s=0.0)


def zoned(folder: Path, name: str, blade: float, hub: float, cells: float, rpm: float, zones: str) -> str:
    head = '"t"\n"Iteration" "t etc.."\n("Iteration" "thrust(blade)" "thrust(hub)" "torque")\n'
    (folder / f"{name}.out").write_text(head + "".join(f"{k} {blade} {hub} 0.1\n" for k in range(300)))
    run = run_from([str(folder / f"{name}.out")], rpm=rpm, zones=[zones], unit=["thrust=N", "torque=N m"],
                   setup=[f"cells={cells}"])  # fmt: skip
    return str(write_run(run, str(folder / f"{name}.toml")))


def test_grids_of_one_study_have_one_speed_and_the_same_zones(tmp_path: Path) -> None:
    fine = zoned(tmp_path, "fine", 5.3, 0.1, 4e6, 6000.0, "blade,hub")
    bare = zoned(tmp_path, "bare", 5.1, 0.1, 1e6, 6000.0, "blade")
    fast = zoned(tmp_path, "fast", 5.2, 0.1, 1e6, 6500.0, "blade,hub")
    with pytest.raises(InputError, match=r"bare.toml: zones: got thrust of blade; expected blade \+ hub, as fine"):
        together([import_file(fine), import_file(bare)])
    with pytest.raises(InputError, match=r"fast.toml: got 6500 rev/min; expected .*6000 rev/min"):
        together([import_file(fine), import_file(fast)])
    good = zoned(tmp_path, "coarse", 5.1, 0.1, 1e6, 6000.0, "blade,hub")
    assert together([import_file(fine), import_file(good)])["thrust_N"] == pytest.approx([5.4])


def test_what_a_run_holds_beside_its_load_is_named_before_a_unit(tmp_path: Path, project: Path) -> None:
    """The duct's zone left out, half of the thrust: no unit is wrong."""
    head = '"t"\n"Iteration" "t etc.."\n("Iteration" "thrust-rotor" "thrust-duct" "torque")\n'
    (tmp_path / "t.out").write_text(head + "".join(f"{k} 13.1 12.2 -0.27\n" for k in range(300)))
    run = run_from([str(tmp_path / "t.out")], rpm=55000.0, zones=["thrust-rotor"], unit=["thrust=N", "torque=N m"])
    made = write_run(run, str(tmp_path / "run.toml"))
    found = compare(made, case=project / "cases" / "ds30", figures=False)
    assert "Thrust with thrust-duct is 25.30 N: check the zones" in str(found.to_dict()["sentence"])
    with pytest.raises(InputError, match="got a column of pressure for the thrust"):
        (tmp_path / "fan.csv").write_text("Design Points,rpm [rpm],total-pressure-op,torque [N m]\nDP0,6000,25,0.06\n")
        assemble(run_from([str(tmp_path / "fan.csv")], column=["thrust=total-pressure-op"], unit=["thrust=N"]))


@pytest.mark.parametrize("head", ["K_T [-]", "Kt [ ]", "KT", "K_T", "C_T", "thrust coefficient K_T"])
@pytest.mark.parametrize("ten", ["10K_Q [-]", "10*KQ", "10 Kq", "K_Q"])
@pytest.mark.parametrize("program", [workbench, cfd_post, table])
def test_coefficients_of_a_ship_are_made_loads_by_the_case(
    project: Path, tmp_path: Path, program: Callable[..., str], head: str, ten: str
) -> None:
    """K_T = T/(rho n^2 D^4) and K_Q = Q/(rho n^2 D^5) are CT and CQ; a unit that is stated for them is refused."""
    factor = 0.1 if ten.startswith("10") else 1.0
    rows = "".join(f"{J},{T},{Q / factor:.6g}\n" for J, T, Q in ((0.0, 0.11, 0.01), (0.3, 0.08, 0.009)))
    bare = program([("J", ""), (head, ""), (ten, "")]).rstrip("\n").split("\n")
    lead = [f"DP {k}," if program is workbench else "" for k in range(2)]
    text = "\n".join([*bare[:-4], *(a + b for a, b in zip(lead, rows.splitlines(), strict=True))]) + "\n"
    (tmp_path / "a.csv").write_text(text)
    found = points(tmp_path / "a.csv")
    assert found["J"] == pytest.approx([0.0, 0.3]) and "rpm" not in found
    assert found["CT"] == pytest.approx([0.11, 0.08]) and found["CQ"] == pytest.approx([0.01, 0.009])
    if head == "K_T [-]" and ten == "K_Q":
        file, case = tmp_path / "a.csv", load_case(project / "cases" / "prop_8x5")
        one = compare(file, case=case, rpm=6000.0, figures=False).to_dict()["points"][1]
        n, D = 100.0, case.diameter_m
        assert one["loads"]["thrust_N"]["cfd"] == pytest.approx(0.08 * case.air().rho * n**2 * D**4, rel=1e-6)
        assert one["airspeed_m_s"] == pytest.approx(0.3 * n * D)
        with pytest.raises(InputError, match="Leave (it|out its unit).* by density, speed and diameter of the case"):
            compare(file, case=case, rpm=6000.0, unit={"K_T [-]" if program is table else "K_T": "N"})


def test_a_constant_of_a_motor_is_no_coefficient_and_an_airspeed_needs_the_speed(tmp_path: Path, project: Path) -> None:
    rows = "4,100,0.08,0.009\n8,100,0.06,0.008\n"
    (tmp_path / "a.csv").write_text("V [m s^-1],n [s^-1],Kt [N m/A],K_T\n" + rows)
    assert import_file(tmp_path / "a.csv").unit("CT") == "-" and len(import_file(tmp_path / "a.csv").values) == 4
    with pytest.raises(InputError, match="a speed and a load"):  # what n counts is not said
        compare(tmp_path / "a.csv", case=project / "cases" / "prop_8x5")


@pytest.mark.parametrize("order", ["by grid", "by kind"])
def test_a_grid_has_one_file_of_each_kind(tmp_path: Path, order: str) -> None:
    thrusts = histories(tmp_path)
    torques = []
    for file in thrusts:
        text = Path(file).read_text().replace('"t"', '"q"').replace('"thrust" "torque")', '"Q" "torque-op")')
        torques.append(str(Path(file).with_name("q" + Path(file).name)))
        Path(torques[-1]).write_text(text)
    pairs = [f for pair in zip(thrusts, torques, strict=True) for f in pair]
    files = pairs if order == "by grid" else [*thrusts, *torques]
    told = {"rpm": 6000.0, "unit": ["thrust=N", "torque-op=N m"]}
    run = run_from(files, **told, setup=["cells=0.5e6,1.7e6,5.8e6"])
    assert [g.files for g in run.grids] == list(zip(thrusts, torques, strict=True))
    is_the_study(assemble(run))
    each = "0.5e6,0.5e6,1.7e6,1.7e6,5.8e6,5.8e6" if order == "by grid" else "0.5e6,1.7e6,5.8e6,0.5e6,1.7e6,5.8e6"
    assert run_from(files, **told, setup=[f"cells={each}"]).grids == run.grids
    with pytest.raises(InputError, match="5 files"):
        run_from(files[:5], **told, setup=["cells=0.5e6,1.7e6,5.8e6"])


def test_values_that_do_not_differ_are_no_study_of_the_grid() -> None:
    d = CfdRun("cfd", "a", {"rpm": [6e3] * 3, "thrust_N": [7.5] * 3, "torque_Nm": [0.107, 0.111, 0.1125]})
    found = by_grid(d, np.array([0.5e6, 1.7e6, 5.8e6]))
    assert found.u["thrust_N"][0] == pytest.approx(7.5 * grid_floor("thrust_N", False))
    assert found.u["torque_Nm"][0] < 0.02 * 0.1125
    assert any("7.5, 7.5, 7.5 N; the values do not differ" in note for note in found.notes)


def test_a_table_of_grids_is_shown_as_the_study_that_it_is(tmp_path: Path) -> None:
    (tmp_path / "g.csv").write_text("cells,rpm,thrust [N]\n" + "".join(f"{n},6000,{T}\n" for n, T in GRIDS.items()))
    assert "order 2.22" in import_(tmp_path / "g.csv").text


@pytest.mark.parametrize(
    ("factor", "fluid"), [(998.0 / 1.225, "water"), (1.0 / 1.225, "a fluid of 1 kg/m3"), (1.7, "")]
)
def test_another_density_is_the_first_thing_to_check(project: Path, tmp_path: Path, factor: float, fluid: str) -> None:
    case = load_case(project / "cases" / "prop_8x5")
    from bemt.rotors.case.propagate import propagate

    n = np.array([4000.0, 8000.0])
    d = propagate(case, n, 0.0 * n, case.air().rho + 0.0 * n).points
    head, rows = "rpm,thrust [N],torque [N m],cells", zip(n, d["thrust_N"], d["torque_Nm"], strict=True)
    lines = [f"{a},{factor * T:.6g},{factor * Q:.6g},2e6" for a, T, Q in rows]
    (tmp_path / "a.csv").write_text("\n".join([head, *lines]) + "\n")
    said = compare(tmp_path / "a.csv", case=case, figures=False).to_dict()["sentence"]
    assert ("first check the density" in said) == bool(fluid) and fluid in said
    (tmp_path / "a.csv").write_text("\n".join([f"{head},rho [kg/m3]", *(f"{line},1.225" for line in lines)]) + "\n")
    assert "density" not in compare(tmp_path / "a.csv", case=case, figures=False).to_dict()["sentence"]


def test_a_column_can_be_left_out(tmp_path: Path) -> None:
    text = workbench([("rpm", "rev min^-1"), ("angle", "degree"), ("thrust", "N"), ("thrust 2", "N")])
    (tmp_path / "a.csv").write_text(text)
    found = assemble(run_from([str(tmp_path / "a.csv")], ignore=["angle", "thrust 2"]))
    assert found["thrust_N"] == pytest.approx(LOADS) and not any("not used" in note for note in found.notes)
    with pytest.raises(InputError, match="'wibble'"):
        assemble(run_from([str(tmp_path / "a.csv")], ignore=["wibble"]))
    (tmp_path / "b.csv").write_text("rpm,thrust (N),balance (N)\n4000,1,7\n6000,2,8\n8000,4,9\n")
    import_(
        tmp_path / "b.csv", ignore=["thrust (N)"], column={"thrust": "balance (N)"}, out=tmp_path / "recording.toml"
    )
    kept = import_file(tmp_path / "recording.toml")
    assert kept["thrust_N"] == pytest.approx([7.0, 8.0, 9.0]) and set(kept.values) == {"rpm", "thrust_N"}


def test_a_grid_index_of_one_load_says_nothing_of_the_other(tmp_path: Path) -> None:
    options = {"rpm": 6000.0, "unit": ["thrust=N", "torque=N m"]}
    one = histories(tmp_path)[0]
    thrust = assemble(run_from([one], **options, setup=["gci_pct=1.15"]))
    both = assemble(run_from([one], **options, setup=["gci_pct=1.15", "gci_torque_pct=2.3"]))
    for run, torque in ((thrust, grid_floor("torque_Nm", False)), (both, 0.02)):
        assert run.u["thrust_N"][0] / run["thrust_N"][0] == pytest.approx(0.01, rel=0.01)
        assert run.u["torque_Nm"][0] / run["torque_Nm"][0] == pytest.approx(torque, rel=0.01)


def test_grids_that_nobody_told_apart_are_asked_for_first(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        assemble(run_from(histories(tmp_path), rpm=6000.0, unit=["thrust=N", "torque=N m"]))
    (fault,) = caught.value.faults
    assert "clock" not in fault.got and fault.hint.startswith("One condition on several grids: --setup cells=")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((9.99, 9.96, 9.84), ("; order 2.00, ", "GCI 0.13 %, u")),
        ((9.999, 9.968, 8.976), ("; order 5.00, ", "GCI 0.01 % not used, u 17.8 %")),
        ((10.0, 9.9), ("; assumed order 2, ", "GCI 1.00 %, u")),
    ],
    ids=["observed", "implausible", "assumed"],
)
def test_a_sentence_tells_an_observed_order_from_an_assumed_one_and_an_index_that_is_not_used(
    values: tuple[float, ...], words: tuple[str, ...]
) -> None:
    cells = (8e6, 1e6, 125e3)[: len(values)]
    s = grid_study(values, ratios(cells))
    told = s.u_relative, s.order, s.extrapolated, s.gci_fine, s.gci_coarse, s.asymptotic, s.flags
    said = LoadStudy("thrust_N", cells, s.values, *told, rpm=6000.0).sentence()
    assert all(word in said for word in words), said

"""The promise of a CFD run: files of any program become one recording."""
# ruff: noqa: E501 - samples as they look in files

from __future__ import annotations

import csv
import json
import math
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt import diagnose
from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.data.readers.cfd_run import RunToml, toml_text
from bemt.data.recordings.cfd_run import assemble
from bemt.data.recordings.cfd_setup import GRID_FLOOR, conditions_that_differ, grid_floor
from bemt.data.recordings.load import import_files
from bemt.judge.compare import one_run, slips
from bemt.physics.dataset import Dataset
from bemt.rotors.case.load import Assumption
from bemt.rotors.case.propagate import Moved

T, Q, RPM = 3.8, 0.062, 8000.0
"""Thrust [N], torque [N m] and speed of every run made here."""
PERIOD = 60.0 / RPM


def times(turns: float = 8.0, per_turn: int = 60) -> np.ndarray:
    return PERIOD / per_turn * np.arange(1, int(turns * per_turn) + 1)


def course(t: np.ndarray, mean: float) -> np.ndarray:
    """A start-up that dies out, and a ripple of the blade passage."""
    return mean * (1.0 + 0.04 * np.sin(4 * math.pi * t / PERIOD) + 3.0 * np.exp(-t / (0.12 * PERIOD)))


def rfile(name: str, values: np.ndarray, t: np.ndarray | None) -> str:
    clock = "Time Step" if t is not None else "Iteration"
    names = f'"{clock}" "{name}"' + (' "flow-time"' if t is not None else "")
    rows = [f"{k} {v:.7g}" + (f" {t[k - 1]:.7g}" if t is not None else "") for k, v in enumerate(values, 1)]
    return f'"{name}-rfile"\n"{clock}" "{name} etc.."\n({names})\n' + "\n".join(rows) + "\n"


def fluent(put: Callable[..., Path], zones: bool = False) -> list[str]:
    t = times()
    put("thrust.out", rfile("thrust", course(t, -T), t))
    put("torque.out", rfile("torque", course(t, Q), t))
    return ["thrust.out", "torque.out"]


def steady(mean: float, n: int = 500) -> np.ndarray:
    k = np.arange(1, n + 1)
    return mean * (1.0 - np.exp(-k / 20.0))


def foam(put: Callable[..., Path]) -> list[str]:
    for file, axis in (("force", T), ("moment", -Q)):
        names = " ".join(f"{p}_{a}" for p in ("total", "pressure", "viscous") for a in "xyz")
        rows = "".join(
            f"{k}\t0.01 -0.01 {v:.8e}\t0.01 -0.01 {0.9 * v:.8e}\t0 0 {0.1 * v:.8e}\n"
            for k, v in enumerate(steady(axis), 1)
        )
        put(f"postProcessing/forces/0/{file}.dat", f"# {file.title()}\n# CofR : (0 0 0)\n#\n# Time \t{names}\n{rows}")
    put("postProcessing/outlet/0/surfaceFieldValue.dat",
        "# Region type : patch outlet\n# Faces : 432\n# Area : 1.0e-02\n# Time\tareaAverage(p)\n" + "".join(f"{k}\t5.0\n" for k in range(1, 501)))  # fmt: skip
    return ["."]


def star(put: Callable[..., Path], timed: bool = False) -> list[str]:
    t = times()
    for name, unit, what, mean in (("Thrust 1", "N", "Thrust", T), ("Torque 1", "N-m", "Moment", Q)):
        head = '"Physical Time: Physical Time (s)"' if timed else '"Iteration"'
        clock, v = (t, course(t, mean)) if timed else (np.arange(1.0, 501), steady(mean))
        rows = "".join(f"{c:.8g},{x:.8g}\n" for c, x in zip(clock, v, strict=True))
        put(f"{name.split()[0].lower()}.csv", f'{head},"{name} Monitor: {what} ({unit})"\n{rows}')
    return ["thrust.csv", "torque.csv"]


AREA, LENGTH, SPEED, RHO = 0.03, 0.1, 80.0, 1.225
FORCE = 0.5 * RHO * SPEED**2 * AREA


def su2(put: Callable[..., Path]) -> list[str]:
    head = '"Time_Iter","Outer_Iter","Inner_Iter",     "rms[Rho]"     ,   "RefForce"   ,   "CFx"   ,   "CFy"   ,   "CFz"   ,   "CMx"   ,   "CMy"   ,   "CMz"   \n'
    rows = zip(steady(T / FORCE), steady(Q / FORCE / LENGTH), strict=True)
    put(
        "history.csv",
        head
        + "".join(f"0, 0, {k}, -5.0, {FORCE:.9g}, 0, 0, {f:.9g}, 0, 0, {m:.9g}\n" for k, (f, m) in enumerate(rows)),
    )
    return ["history.csv"]


def flow360(put: Callable[..., Path]) -> list[str]:
    rows = zip(steady(T / FORCE), steady(Q / FORCE / LENGTH), strict=True)
    text = "physical_step, pseudo_step, CL, CD, CFx, CFy, CFz, CMx, CMy, CMz, HeatTransfer\n"
    put(
        "total_forces_v2.csv",
        text
        + "".join(
            f"0, {10 * k}, 0, 0, 0, 0, {f:.9g}, 0, 0, {m:.9g}, 0,\n".replace(", 0,\n", ", 0\n")
            for k, (f, m) in enumerate(rows)
        ),
    )
    return ["total_forces_v2.csv"]


def post(put: Callable[..., Path]) -> list[str]:
    rows = "".join(f"{n}, {T * (n / RPM) ** 2:.7g}, {Q * (n / RPM) ** 2:.7g}\n" for n in (4000, 6000, 8000))
    put("chart.csv", f"[Name]\nTable 1\n\n[Data]\nrpm [ rev min^-1 ], Thrust [ N ], Torque [ J ]\n{rows}")
    return ["chart.csv"]


def expressions(put: Callable[..., Path]) -> list[str]:
    put(
        "values.csv",
        f"Expression, Value\nThrust, {T:.7g} [kg m s^-2]\nShaft torque, {Q:.7g} [kg m^2 s^-2]\nrpm, {RPM:.7g} [rev min^-1]\n",
    )
    return ["values.csv"]


def workbench(put: Callable[..., Path]) -> list[str]:
    head = "# 5/22/2017 3:33:44 PM\n# The parameters defined in the project are:\n# ,P1 - rpm [rev min^-1],P2 - thrust-op [N],P3 - torque-op [N m]\n#\n# The following header line defines the name of the columns by reference to the parameters.\nName,P1,P2,P3\n"
    rows = "".join(
        f"DP {k},{n},{-T * (n / RPM) ** 2:.7g},{Q * (n / RPM) ** 2:.7g}\n" for k, n in enumerate((4000, 6000, 8000))
    )
    put("points.csv", head + rows + "DP 3,10000,,\n")
    return ["points.csv"]


def force_report(put: Callable[..., Path]) -> list[str]:
    text = '                  "Force Report"\n'
    for title, unit, total in (
        ("Forces - Direction Vector (0 0 1)", "Forces [N]", T),
        ("Moments - Moment Center (0 0 0) Moment Axis (0 0 1)", "Moments [N m]", Q),
    ):
        zones = {"blade": 0.7 * total, "hub": 0.1 * total, "duct": 0.2 * total}
        rows = [f"{z}    {0.9 * v:.8g}   {0.1 * v:.8g}   {v:.8g}" for z, v in [*zones.items(), ("Net", total)]]
        rule = "------ ------ ------ ------"
        text += (
            f"\n{title}\n          {unit}\nZone      Pressure   Viscous   Total\n"
            + "\n".join([*rows[:3], rule, rows[3]])
            + "\n"
        )
    put("report.txt", text)
    return ["report.txt"]


REFERENCE = f"area={AREA},length={LENGTH},speed={SPEED},density={RHO}"
RUNS: dict[str, tuple[Callable[..., list[str]], list[str]]] = {
    "Fluent, transient": (fluent, ["--rpm", "8000", "--unit", "thrust=N", "--unit", "torque=N m"]),
    "Fluent force report": (force_report, ["--rpm", "8000", "--zones", "blade", "hub", "duct"]),
    "CFD-Post": (post, []),
    "CFD-Post expressions": (expressions, []),
    "Workbench": (workbench, []),
    "STAR-CCM+ by iteration": (star, ["--rpm", "8000"]),
    "STAR-CCM+ by time": (lambda put: star(put, timed=True), ["--rpm", "8000"]),
    "OpenFOAM": (foam, ["--rpm", "8000"]),
    "OpenFOAM postProcessing": (lambda put: foam(put) and ["postProcessing"], ["--rpm", "8000", "--sector", "1"]),
    "OpenFOAM function object": (lambda put: foam(put) and ["postProcessing/forces"], ["--rpm", "8000"]),
    "SU2": (su2, ["--rpm", "8000", "--reference", f"length={LENGTH}"]),
    "Flow360": (flow360, ["--rpm", "8000", "--reference", REFERENCE]),
}
"""Program: how its files are made, options of its import."""


@pytest.fixture
def put(put: Callable[[str, str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], Path]:
    """The same from within that folder."""
    monkeypatch.chdir(tmp_path)
    return put


@pytest.mark.parametrize("name", RUNS)
def test_every_program_becomes_the_same_run(
    name: str, put: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, options = RUNS[name]
    assert main(["import", *make(put), *options, "--airspeed-m-s", "0", "--out", "out/run.toml", "--json"]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    last = run["points"][-1]
    duct = "report" in name
    assert (last["rpm"], last["airspeed_m_s"]) == (RPM, 0.0)
    assert last["thrust_N"] == pytest.approx(T, rel=1e-4)
    assert last["torque_Nm"] == pytest.approx(0.8 * Q if duct else Q, rel=1e-4)
    assert last.get("duct_thrust_N") == (pytest.approx(0.2 * T) if duct else None)
    assert last["u_thrust_N"] >= GRID_FLOOR["rest"]["thrust_N"] * T * 0.999
    written = load_run("out/run.toml")  # what was written is the same run, from another folder
    assert written["thrust_N"][-1] == pytest.approx(last["thrust_N"], rel=1e-8)
    assert written["torque_Nm"][-1] == pytest.approx(last["torque_Nm"], rel=1e-8)


def load_run(path: str) -> Any:
    from bemt.data.recordings.load import import_file

    return import_file(path)


def test_what_no_file_says_is_asked_for_all_at_once_and_as_it_is_typed(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    files = fluent(put)
    assert main(["import", *files]) == 0
    said = capsys.readouterr().out
    assert '--unit thrust="N"' in said and '--unit torque="N m"' in said and "--rpm N" in said
    assert main(["import", *files, "--rpm", "8000", "--unit", "thrust=N"]) == 2
    assert "torque.out: torque: got no unit" in capsys.readouterr().err
    assert main(["import", *files, "--rpm", "8000", "--unit", "thrust=kg"]) == 2
    assert "write kgf" in capsys.readouterr().err
    put("flow.csv", "")
    with pytest.raises(InputError, match="--reference area=A,length=L,speed=V"):
        run_of(flow360(put), {"rpm": RPM})


def run_of(files: list[str], head: dict[str, Any], **more: Any) -> Any:
    return assemble(RunToml.model_validate({"run": {"files": tuple(files), **head}, **more}), Path(), "run")


UNITS = {"columns": {"thrust": {"unit": "N"}, "torque": {"unit": "N m"}}}


def test_options_of_a_run_name_the_folder_that_holds_none(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    put("mine/notes.txt", "no numbers here\n")
    assert main(["import", "mine", "--unit", "thrust=N", "--sector", "3"]) == 2
    said = capsys.readouterr().err
    assert "mine: " in said and "postProcessing" in said


def test_zones_and_units_are_asked_for_with_the_speed(put: Callable[..., Path]) -> None:
    rows = "".join(f"{k} {0.8 * T:.7g} {0.2 * T:.7g} {t:.7g}\n" for k, t in enumerate(times(), 1))
    put(
        "t.out",
        f'"t-rfile"\n"Time Step" "thrust(blade) etc.."\n("Time Step" "thrust(blade)" "thrust(hub)" "flow-time")\n{rows}',
    )
    with pytest.raises(InputError) as caught:
        assemble(RunToml.model_validate({"run": {"files": ("t.out",)}}))
    assert {f.where for f in caught.value.faults} == {"rpm", "zones", "thrust(blade)"}


def test_a_damaged_file_does_not_hide_what_another_lacks(put: Callable[..., Path]) -> None:
    put("thrust.csv", '"Iteration","Thrust 1 Monitor: Thrust (N)"\n' + "1,x\n" * 9)
    put("torque.csv", '"Iteration","Torque 1 Monitor: Moment"\n' + "".join(f"{k},{Q:.8g}\n" for k in range(1, 99)))
    with pytest.raises(InputError) as caught:
        assemble(RunToml.model_validate({"run": {"files": ("thrust.csv", "torque.csv"), "rpm": RPM}}))
    assert {f.file for f in caught.value.faults} == {"thrust.csv", "torque.csv"}


def test_unit_sign_and_sector_are_applied_once(put: Callable[..., Path]) -> None:
    files = fluent(put)
    plain = run_of(files, {"rpm": RPM}, **UNITS)
    assert (float(plain["thrust_N"][0]), float(plain["torque_Nm"][0])) == pytest.approx((T, Q), rel=1e-4)
    assert any("taken as positive" in n for n in plain.notes)  # the thrust was projected backwards, and that is said
    told = {"columns": {"thrust": {"unit": "lbf", "sign": 1}, "torque": {"unit": "N m", "sign": -1}}}
    own = run_of(files, {"rpm": RPM, "sector": 3}, **told)
    assert own["thrust_N"][0] == pytest.approx(-3 * T * 4.4482216, rel=1e-4)
    assert own["torque_Nm"][0] == pytest.approx(-3 * Q, rel=1e-4)
    assert own.u["thrust_N"][0] == pytest.approx(3 * 4.4482216 * plain.u["thrust_N"][0], rel=1e-3)


def test_files_that_we_fail_to_join_say_so(put: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each file can be read, so none of their own entries tells of it."""

    def broken(*_: object) -> Dataset:
        raise KeyError("thrust_N")

    monkeypatch.setattr("bemt.data.recordings.cfd_run.assemble", broken)
    found = import_files(fluent(put))
    assert not found.runs and all(file.error is None for file in found.files)
    assert found.to_do is not None and "KeyError" in found.to_do


def test_a_column_is_named_by_its_unit(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    t = times()
    put("a.out", rfile("report-def-0", course(t, T), t))
    put("b.out", rfile("report-def-1", course(t, Q), t))
    args = ["--rpm", "8000", "--unit", "report-def-0=N", "--unit", "report-def-1=N m", "--out", "run.toml"]
    assert main(["import", "a.out", "b.out", *args]) == 0
    assert load_run("run.toml")["torque_Nm"][0] == pytest.approx(Q, rel=1e-4)
    capsys.readouterr()
    assert main(["import", "a.out", "--rpm", "8000"]) == 0
    assert '--unit "report-def-0=N"' in capsys.readouterr().out


def test_files_that_are_not_one_run_are_refused(put: Callable[..., Path]) -> None:
    t = times()
    put("thrust.out", rfile("thrust", course(t, T), t))
    put("torque.out", rfile("torque", course(t, Q), t + 100.0))
    with pytest.raises(InputError, match="not one run|files of one run"):
        run_of(["thrust.out", "torque.out"], {"rpm": RPM}, **UNITS)
    put("thrust_1_1.out", rfile("thrust", course(t, 2 * T), t * 0.5))
    with pytest.raises(InputError, match="another clock"):
        run_of(["thrust.out", "thrust_1_1.out"], {"rpm": RPM}, **UNITS)


def test_a_history_that_goes_on_in_a_second_file_is_joined(put: Callable[..., Path]) -> None:
    whole = steady(T)
    put("thrust.out", rfile("thrust", whole, None))
    rows = rfile("thrust", whole, None).splitlines(keepends=True)
    put("a.out", "".join(rows[:203]))
    put("b.out", "".join(rows[:3] + rows[203:]))
    one, two = run_of(["thrust.out"], {"rpm": RPM}, **UNITS), run_of(["a.out", "b.out"], {"rpm": RPM}, **UNITS)
    assert one["thrust_N"][0] == two["thrust_N"][0] and any("joined at step 201" in n for n in two.notes)


def test_a_speed_in_the_file_is_not_replaced(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    post(put)
    assert run_of(["chart.csv"], {})["rpm"].tolist() == [4000.0, 6000.0, 8000.0]
    for text in (Path("chart.csv").read_text(), Path("chart.csv").read_text().replace("[ rev min^-1 ]", "[ furlong ]")):
        put("chart.csv", text)
        with pytest.raises(InputError, match="4000, 6000, 8000"):
            run_of(["chart.csv"], {"rpm": 8000.0})


def test_zones_that_count_are_asked_for(put: Callable[..., Path]) -> None:
    text = rfile("thrust(blade)", steady(0.8 * T), None)
    names = text.splitlines(keepends=True)
    rows = "".join(f"{k} {0.8 * T:.6g} {0.2 * T:.6g}\n" for k in range(1, 200))
    put("thrust.out", names[0] + names[1] + '("Iteration" "thrust(blade)" "thrust(shroud)")\n' + rows)
    with pytest.raises(InputError, match="--zones blade,shroud"):
        run_of(["thrust.out"], {"rpm": RPM}, **UNITS)
    run = run_of(["thrust.out"], {"rpm": RPM, "zones": ("blade", "shroud")}, **UNITS)
    assert (float(run["thrust_N"][0]), float(run["duct_thrust_N"][0])) == pytest.approx((T, 0.2 * T), rel=1e-5)
    with pytest.raises(InputError, match="Zones: blade, shroud"):
        run_of(["thrust.out"], {"rpm": RPM, "zones": ("blade", "hub")}, **UNITS)


@pytest.mark.parametrize(("other", "duct"), [("shroud", 0.2), ("nacelle", 0.3)])
def test_a_nacelle_is_the_duct_only_where_no_other_zone_is(put: Callable[..., Path], other: str, duct: float) -> None:
    names = ("blade", other, "nacelle") if other != "nacelle" else ("blade", "nacelle")
    head = "".join(rfile("thrust(blade)", steady(0.8 * T), None).splitlines(keepends=True)[:2])
    shares = (0.7, 0.2, 0.1) if len(names) == 3 else (0.7, 0.3)
    columns = " ".join(f'"thrust({z})"' for z in names)
    rows = "".join(f"{k} " + " ".join(f"{s * T:.6g}" for s in shares) + "\n" for k in range(1, 200))
    put("thrust.out", f'{head}("Iteration" {columns})\n{rows}')
    run = run_of(["thrust.out"], {"rpm": RPM, "zones": names}, **UNITS)
    assert (float(run["thrust_N"][0]), float(run["duct_thrust_N"][0])) == pytest.approx((T, duct * T), rel=1e-5)


def test_the_start_up_is_cut_and_a_run_that_moves_says_so(put: Callable[..., Path]) -> None:
    k = np.arange(1.0, 301.0)
    put("thrust.out", rfile("thrust", T * (1.0 + 0.001 * k), None))
    run = run_of(["thrust.out"], {"rpm": RPM}, **UNITS)
    drift = run.drift["thrust_N"]
    assert drift == pytest.approx(0.059 / 1.27, rel=0.02) and any("not settled: thrust" in n for n in run.notes)
    assert run.u["thrust_N"][0] > drift * T
    put("against.out", rfile("thrust", -T * (1.0 + 0.001 * k), None))  # the same load along the other axis
    for columns in (UNITS["columns"], {"thrust": {"unit": "N", "sign": 1}}):
        other = run_of(["against.out"], {"rpm": RPM}, columns=columns)
        assert other.drift == run.drift and (other.u["thrust_N"] == run.u["thrust_N"]).all()
    put("thrust.out", rfile("thrust", T * np.exp(-k / 30.0), None))
    with pytest.raises(InputError, match="a run that has converged"):
        run_of(["thrust.out"], {"rpm": RPM}, **UNITS)
    t = times(turns=0.6)
    put("thrust.out", rfile("thrust", course(t, T), t))
    with pytest.raises(InputError, match="revolutions recorded"):
        run_of(["thrust.out"], {"rpm": RPM}, **UNITS)


def test_propeller_info_of_openfoam_gives_coefficients(put: Callable[..., Path]) -> None:
    rows = "".join(f"{k}\t25\t2.5\t0.5\t0.2\t0.3\t0.53\n" for k in range(1, 40))
    put(
        "propellerPerformance.dat",
        f"# Propeller performance\n# Radius : 0.1\n#\n# Time\tn\tURef\tJ\tKT\t10*KQ\teta0\n{rows}",
    )
    run = run_of(["propellerPerformance.dat"], {})
    found = {k: float(v[0]) for k, v in run.values.items()}
    assert found == pytest.approx({"rpm": 1500.0, "airspeed_m_s": 2.5, "CT": 0.2, "CQ": 0.03, "J": 0.5})
    assert run.u["CT"][0] == pytest.approx(grid_floor("CT", True) * 0.2)


Y_PLUS = "# y+ ()\n# Time\tpatch\tmin\tmax\taverage\n500\tblade\t5.8\t1392\t92.5\n"


def test_y_plus_counts_as_it_is_given_and_cells_above_the_log_layer_are_said(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Beside the forces, named with them, or a monitor in the file of the loads: all three say the same of the wall."""
    foam(put)
    for name in ("force", "moment"):
        shutil.copy(f"postProcessing/forces/0/{name}.dat", f"{name}.dat")
    put("yPlus.dat", Y_PLUS)
    heads = [f"{w} Monitor: {w}" for w in ("Thrust (N)", "Torque (N-m)", "Wall Y+ Avg", "Wall Y+ Max")]
    rows = "".join(f"{k},{T},{Q},92.5,1392\n" for k in range(1, 201))
    put("star.csv", ",".join(f'"{h}"' for h in ("Iteration", *heads)) + "\n" + rows)
    for files in (["force.dat", "moment.dat"], ["force.dat", "moment.dat", "yPlus.dat"], ["star.csv"]):
        assert main(["import", *files, "--rpm", f"{RPM}", "--setup", "wall=function", "--out", "run.toml"]) == 0
        assert "y+ of walls" not in capsys.readouterr().out
        assert main(["compare", "run.toml", "--case", "10x5"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "wall functions, mean y+ 92.5, up to 1392" in said and "above the log layer" in said


def test_what_an_audit_calls_not_stated_can_be_stated_by_the_key_that_it_names(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    foam(put)
    told = ["postProcessing", "--rpm", f"{RPM}", "--out", "run.toml", "--setup"]
    assert main(["import", *told, "domian=3"]) == 2 and "got an unknown key, domian" in capsys.readouterr().err
    values = {"domain_over_D": "8", "compressible": "yes", "balance_mass": "0.001", "balance_momentum": "-0.002",
              "wall": "function", "y_plus": "60", "turbulence": "k-omega SST"}  # fmt: skip
    assert main(["import", *told, "grids=1"]) == 0
    capsys.readouterr()
    open_ = one_run.text(one_run.compare_run("run.toml", "10x5"))
    assert all(key in open_.partition("--setup KEY=VALUE")[2] for key in values)
    assert main(["import", *told, "grids=1", *(f"{k}={v}" for k, v in values.items())]) == 0
    found = one_run.compare_run("run.toml", "10x5")
    assert not [line.topic for line in found.audit if line.status == "not stated"]
    assert "--setup KEY=VALUE" not in one_run.text(found)


def test_a_written_run_is_read_back() -> None:
    document = {"run": {"files": ("a b.out", "täglich.out"), "rpm": 8000.0, "zones": ("blade:1", "hub")},
                "columns": {"torque": {"column": 'q"1', "sign": -1}}, "setup": {"steady": False, "cells": 2.5e6}}  # fmt: skip
    import tomllib

    made = RunToml.model_validate(document)
    assert (
        RunToml.model_validate(
            _tuples(tomllib.loads(toml_text(made.model_dump(exclude_unset=True, exclude_none=True), "A run")))
        )
        == made
    )


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _tuples(v) for k, v in value.items()}
    return tuple(value) if isinstance(value, list) else value


def test_a_run_toml_says_all_its_faults(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    put(
        "run.toml",
        '[run]\nfiles = ["absent.out"]\nsector = 0\n[columns]\nthrust = { unit = "kg", sign = 2 }\ntork = {}\n',
    )
    assert main(["import", "run.toml"]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in ("run.sector", "columns.thrust", "columns.tork"))


@pytest.mark.parametrize(
    ("head", "word"),
    [(b"\x89HDF\r\n\x1a\n" + bytes(64), "HDF5"), (b"FORMAT\ntype: ensight gold\n\nGEOMETRY\nmodel: a.geo\n", "EnSight"),
     (b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n", "VTK"), (b'<?xml version="1.0"?>\n<VTKFile type="PolyData">\n', "VTK")],
)  # fmt: skip
def test_fields_get_one_sentence_with_the_export_to_make(
    head: bytes, word: str, put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    put("field.dat", "").write_bytes(head)
    assert main(["import", "field.dat"]) == 2
    said = capsys.readouterr().err
    assert word in said and "report file of thrust and torque (Fluent)" in said and len(said.splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [("history.csv", '"Inner_Iter","rms[Rho]","rms[RhoE]"\n' + "".join(f"{k},-{k},-2.5\n" for k in range(9)), "residuals"),
     ("yPlus.dat", "# y+ ()\n# Time\tpatch\tmin\tmax\taverage\n" + "".join(f"{k} blade 2 88 31\n" for k in range(9)), "y+")],
)  # fmt: skip
@pytest.mark.parametrize("more", [[], ["--rpm", "6000", "--out", "run.toml"]])
def test_what_holds_no_loads_is_refused_as_what_it_is(
    name: str, text: str, word: str, more: list[str], put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    put(name, text)
    assert main(["import", name, *more]) == 2
    said = capsys.readouterr()
    assert f"got {word}" in said.err and "=N" not in said.err and not said.out


def test_several_runs_are_no_run(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    head = "# Force\n# Time\ttotal_x total_y total_z\n"
    for n in (6000, 8000, 10000):
        rows = "".join(f"{k} 0 0 {n}\n" for k in range(1, 60))
        put(f"of_{n}/postProcessing/forces/0/force.dat", head + rows)
    assert main(["import", "of_6000", "of_8000", "of_10000"]) == 2
    said = capsys.readouterr()
    assert not said.out and said.err.count("Other runs: import each") == 1 == len(said.err.splitlines())


def test_a_unit_or_a_sign_that_no_rotor_has_is_said(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    put("T.out", rfile("thrust", steady(11.4), None))
    put("Q.out", rfile("torque", steady(0.205), None))
    told = {}
    for unit, sign in (("N m", "1"), ("Nmm", "1"), ("N m", "-1")):
        words = ["--unit", "thrust=N", f"torque={unit}", "--rpm", "10000", "--sign", f"torque={sign}"]
        assert main(["import", "T.out", "Q.out", *words]) == 0
        told[unit, sign] = capsys.readouterr().out
    assert ["figure of merit" in text for text in told.values()] == [False, True, False]
    assert ["by the sign" in text for text in told.values()] == [False, False, True]


def test_the_grid_is_named_before_any_physics(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    files = fluent(put)
    for name, cells in (("coarse", "1e6"), ("fine", "4e6")):
        args = [
            "--rpm", "8000", "--unit", "thrust=N", "--unit", "torque=N m", "--setup", f"cells={cells}",
            f"grid_level={name}",
        ]  # fmt: skip
        assert main(["import", *files, *args, "--out", f"{name}.toml"]) == 0
    a, b = load_run("coarse.toml"), load_run("fine.toml")
    assert conditions_that_differ(a, b) == {"grid_level": ("coarse", "fine"), "cells": ("1,000,000", "4,000,000")}
    assert conditions_that_differ(a, a) == {}
    capsys.readouterr()
    assert main(["compare", "coarse.toml", "fine.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["verdict"], found["effects"]) == ("insufficient", []) and found["rule"].startswith(
        "the grid differs: level coarse and fine"
    )
    assert found["ratios"]["thrust_N"]["ratio"] == pytest.approx(1.0)


def test_two_runs_of_one_point_are_compared_with_both_errors_and_name_nothing(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    files = fluent(put)
    for name, rpm in (("a", "8000"), ("b", "8010"), ("c", "9000")):
        units = ["--unit", "thrust=N", "--unit", "torque=N m"]
        assert main(["import", *files, "--rpm", rpm, *units, "--out", f"{name}.toml"]) == 0
    capsys.readouterr()
    assert main(["compare", "a.toml", "b.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["verdict"], found["effects"]) == ("insufficient", [])
    load = found["points"][0]["loads"]["thrust_N"]
    assert load["A"] > 0.0 and load["difference"] == pytest.approx(load["B"] - load["A"])
    assert load["u_both"] == pytest.approx(math.hypot(load["u_A"], load["u_B"])) and load["u_A"] > 0.0
    assert main(["compare", "a.toml", "c.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["points"] == [], "another speed is another point"
    assert main(["compare", "a.toml", "a.toml"]) == 2
    assert "twice" in capsys.readouterr().err


def test_two_grids_of_an_own_campaign_are_named(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(project / "reports/cfd/prop_8x5_rest/recording.csv")
    assert main(["compare", path, path, "--rows-a", "level=5", "--rows-b", "level=6", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rule"].startswith("the grid differs: level 5 and 6")
    assert found["ratios"]["thrust_N"]["ratio"] == pytest.approx(23.01206 / 21.37395, rel=1e-5)


def test_the_floor_is_what_our_own_grids_differ_by(project: Path) -> None:
    """Changes from each grid to the next one of the same set-up, at rest and in flight."""
    same = ("rpm", "airspeed_m_s", "solver", "gas", "sector", "turbulence", "tip_gap_mm")
    changes: dict[str, list[tuple[float, float]]] = {"rest": [], "flight": []}
    for name in ("prop_8x5_grid", "prop_8x5_rest", "ds30_spinner", "ds30_vanes"):
        groups: dict[tuple[str, ...], dict[float, tuple[float, float]]] = {}
        with (project / "reports/cfd" / name / "recording.csv").open(newline="") as stream:
            for row in csv.DictReader(stream):
                if row["converged"] == "1":
                    key = tuple(row[k] for k in same)
                    groups.setdefault(key, {})[float(row["level"])] = (float(row["thrust_N"]), float(row["torque_Nm"]))
        for levels in groups.values():
            found = [levels[k] for k in sorted(levels)]
            changes["rest"] += [(b[0] / a[0] - 1, b[1] / a[1] - 1) for a, b in zip(found, found[1:], strict=False)]
    # one level, cells arranged in two ways (prop_8x5_zone; reports/cfd/README.md)
    changes["rest"].append((21.37 / 23.96 - 1, 0.362 / 0.418 - 1))
    changes["flight"].append((14.97 / 16.64 - 1, 0.314 / 0.342 - 1))
    assert len(changes["rest"]) == 10
    for state, pairs in changes.items():
        thrust, torque = np.sqrt(np.mean(np.square(pairs), axis=0))
        assert GRID_FLOOR[state]["thrust_N"] == pytest.approx(thrust, abs=6e-4)
        assert GRID_FLOOR[state]["torque_Nm"] == pytest.approx(torque, abs=6e-4)


def ds30(put: Callable[..., Path], folder: str = "") -> list[str]:
    """The fan of the thesis as a transient run of Fluent writes it: two zones in one file, 55,000 rev/min, 1 deg a step."""
    period = 60.0 / 55000.0
    t = period / 360.0 * np.arange(1, 360 * 6 + 1)
    ripple = 1.0 + 0.01 * np.sin(2 * math.pi * 11 * t / period) + 4.0 * np.exp(-t / (0.3 * period))
    rows = "".join(
        f"{k} {-17.0 * r:.7g} {-6.5 * r:.7g} {c:.7g}\n" for k, (r, c) in enumerate(zip(ripple, t, strict=True), 1)
    )
    head = (
        '"thrust-rfile"\n"Time Step" "thrust(rotor) etc.."\n("Time Step" "thrust(rotor)" "thrust(duct)" "flow-time")\n'
    )
    put(f"{folder}thrust-rfile.out", head + rows)
    put(f"{folder}torque-rfile.out", rfile("torque", 0.285 * ripple, t))
    return [f"{folder}thrust-rfile.out", f"{folder}torque-rfile.out"]


DS30 = ["--rpm", "55000", "--unit", "thrust=N", "--unit", "torque=N m", "--zones", "rotor,duct", "--airspeed-m-s", "0"]


def test_one_point_stands_beside_bemt_on_one_screen(
    put: Callable[..., Path], project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = str(project / "cases" / "ds30")
    assert main(["import", *ds30(put), *DS30, "--out", "run.toml"]) == 0
    capsys.readouterr()
    assert main(["compare", "run.toml", "--case", case, "--out", "out", "--quiet"]) == 0
    found = json.loads(Path("out/comparison.json").read_text())
    (point,) = found["points"]
    loads = point["loads"]
    assert loads["thrust_N"]["cfd"] == pytest.approx(23.5, rel=1e-3) and loads["torque_Nm"]["cfd"] == pytest.approx(
        0.285, rel=1e-3
    )
    assert loads["duct_share"]["cfd"] == pytest.approx(6.5 / 23.5, rel=1e-3)
    for load in loads.values():
        assert load["u_cfd"] > 0 and load["u_bemt"] > 0 and set(load["u_bemt_by"]) == {"input", "model", "numerics"}
        assert load["u_both"] == pytest.approx(math.hypot(load["u_cfd"], load["u_bemt"]))
    assert {"grid study", "domain against disk"} <= {line["topic"] for line in found["audit"]}
    assert Path("out/recording.png").read_bytes().startswith(b"\x89PNG")
    from bemt.judge.compare import one_run

    screen = one_run.text(one_run.compare_run("run.toml", case))
    assert len(screen.splitlines()) <= 40 and max(map(len, screen.splitlines())) <= 120
    assert "no grid study: at least" in screen and "No cause is named from one point" in screen
    assert not {"verdict", "effects"} & found.keys()


@pytest.mark.parametrize(
    ("torque", "sign", "words"), [("Nmm", "1", "factor of 1000"), ("N m", "-1", "signs are opposite"), ("N m", "1", "")]
)
def test_what_is_a_unit_or_a_sign_is_no_physics(
    torque: str, sign: str, words: str, put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    files = [put("T.out", rfile("thrust", steady(13.0), None)), put("Q.out", rfile("torque", steady(0.205), None))]
    told = ["--rpm", "10000", "--unit", "thrust=N", f"torque={torque}", "--sign", f"torque={sign}"]
    assert main(["import", *map(str, files), *told, "--out", "run.toml"]) == 0
    capsys.readouterr()
    assert main(["compare", "run.toml", "--case", "10x5"]) == 0
    head = " ".join(capsys.readouterr().out.partition("\n\n")[0].split())
    assert words in head and ("agree" in head) == (not words)


def test_a_fan_whose_run_does_not_split_its_thrust_keeps_the_limits_of_a_fan(
    put: Callable[..., Path], project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [
        str(put("T.out", rfile("thrust", steady(23.5), None))),
        str(put("Q.out", rfile("torque", steady(0.285), None))),
    ]
    case = ["--case", str(project / "cases" / "ds30")]
    told = ["--rpm", "55000", "--unit", "thrust=N", "--unit", "torque=N m"]
    assert main(["import", *files, *told, "--out", "run.toml"]) == 0
    for command in (["compare", "run.toml"], ["import", "run.toml"], ["diagnose", "run.toml"]):
        capsys.readouterr()
        main([*command, *case])
        assert "must be" not in capsys.readouterr().out


def test_a_bench_is_no_cfd_and_has_the_u_of_a_stand(put: Callable[..., Path]) -> None:
    from bemt.judge.compare import one_run

    file = put("bench.csv", "rpm,thrust_gf\n6000,500\n7000,690\n")
    found = one_run.compare_run(str(file), "10x5")
    for load in (point.loads["thrust_N"] for point in found.points):
        assert load.u_cfd == pytest.approx(0.05 * load.cfd)
    assert "CFD" not in one_run.text(found) and any("u of the recording: not stated" in n for n in found.notes)


def test_diagnose_takes_exports_with_what_they_do_not_say(
    put: Callable[..., Path], project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = str(project / "cases" / "ds30")
    assert main(["diagnose", *ds30(put), *DS30, "--case", case, "--json"]) == 0
    (point,) = json.loads(capsys.readouterr().out)["points"]
    assert point["loads"]["thrust_N"]["cfd"] == pytest.approx(23.5, rel=1e-3)
    assert point["loads"]["torque_Nm"]["cfd"] == pytest.approx(0.285, rel=1e-3)


@pytest.mark.slow
def test_the_fan_of_the_thesis_goes_the_whole_road(
    put: Callable[..., Path], project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = tmp_path / "ds30"
    shutil.copytree(project / "cases" / "ds30", case)
    assert main(["import", *ds30(put), *DS30, "--out", str(case / "run.toml")]) == 0
    assert main(["compare", str(case / "run.toml"), "--case", str(case)]) == 0
    capsys.readouterr()
    assert main(["diagnose", str(case / "run.toml"), "--case", str(case), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "insufficient"
    assert main(["sweep", str(case), "--json"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["cases"]
    (row,) = [r for r in result["rows"] if r["source"] == "cfd" and r["origin"] == "run.toml"]
    assert row["thrust_N"] == pytest.approx(23.5, rel=1e-3) and row["torque_Nm"] == pytest.approx(0.285, rel=1e-3)
    assert f"cfd {row['origin']}" in [a["reference"] for a in result["audit"]], "one audit a run, by its file"
    assert main(["report", str(case), "--out", "page", "--quiet"]) == 0
    assert "run.toml" in next(Path("page").glob("*.html")).read_text()


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in RUNS if n != "Fluent, transient"])
def test_every_program_goes_from_import_to_report(
    name: str, put: Callable[..., Path], project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, options = RUNS[name]
    case = str(project / "cases" / "prop_8x5")
    assert main(["import", *make(put), *options, "--out", "run.toml"]) == 0
    assert main(["compare", "run.toml", "--case", case]) == 0
    assert main(["diagnose", "run.toml", "--case", case]) == 0
    assert main(["report", case, "--recording", "run.toml", "--out", "page", "--quiet"]) < 2
    assert 'alt="Recording and prediction"' in Path("page/report.html").read_text()


def test_the_shared_exports_become_runs(shared_data: Path) -> None:
    folder = shared_data / "cfd_exports"
    screw = {"columns": {"torque": {"column": "report-def-0", "unit": "N m"}}}
    run = assemble(
        RunToml.model_validate({"run": {"files": ("screw/report-def-0-rfile_1_1.out",), "rpm": 130.2}, **screw}), folder
    )
    assert run["torque_Nm"][0] == pytest.approx(0.17547, abs=5e-6)
    run = assemble(
        RunToml.model_validate(
            {"run": {"files": ("openfoam_propeller/force.dat", "openfoam_propeller/moment.dat"), "rpm": 900.0}}
        ),
        folder,
    )
    assert run["thrust_N"][0] == pytest.approx(878.467, rel=1e-4) and run.u["thrust_N"][0] > 0.072 * 878.0
    points = {"columns": {"rpm": {"unit": "rad/s"}, "torque": {"unit": "N m"}}}
    run = assemble(RunToml.model_validate({"run": {"files": ("axial_fan/DesignPoints.csv",)}, **points}), folder)
    assert run["rpm"] == pytest.approx(1485.24, rel=1e-4) and run["torque_Nm"][0] == 0.0597
    run = assemble(
        RunToml.model_validate({"run": {"files": ("force_report/FX", "force_report/MX"), "rpm": 100.0}}), folder
    )
    assert run["thrust_N"][0] == pytest.approx(412.506, rel=1e-5)
    sphere = {"files": ("openfoam_old/0/forces.dat", "openfoam_old/100/forces.dat"), "rpm": 100.0, "axis": "x"}
    with pytest.raises(InputError, match="a run that has converged"):  # two starts of one history, joined
        assemble(RunToml.model_validate({"run": sphere}), folder)
    with pytest.raises(InputError, match="from the same start"):
        files = ("screw/report-def-0-rfile.out", "screw/report-def-0-rfile_1_1.out")
        assemble(RunToml.model_validate({"run": {"files": files, "rpm": 130.2}, **screw}), folder)


def test_a_run_is_replaced_and_no_other_file(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    files = fluent(put)
    args = ["import", *files, "--rpm", "8000", "--unit", "thrust=N", "--unit", "torque=N m", "--airspeed-m-s", "0"]
    assert main([*args, "--out", "run.toml"]) == 0
    first = Path("run.toml").read_text()
    assert main([*args, "--density-kg-m3", "1.1", "--out", "run.toml"]) == 0 and Path("run.toml").read_text() != first
    case = put("case.toml", 'schema = "bemt.case/1"\n')
    assert main([*args, "--out", "case.toml"]) == 2 and "no run" in capsys.readouterr().err
    assert case.read_text() == 'schema = "bemt.case/1"\n'


# ---- the first sentence of one run


def _told(ratios: dict[str, list[float]], unit_open: frozenset[str] = frozenset(), u: float = 0.1) -> str:
    """First sentence for points whose CFD is these times BEMT, each side known to a share of its value."""
    n = max(map(len, ratios.values()))

    def load(ratio: float, size: float = 1.0) -> one_run.BothLoads:
        both = size * u * math.hypot(ratio, 1.0)
        E = size * (1.0 - ratio)
        return one_run.BothLoads(ratio * size, u * abs(ratio) * size, size, u * size, {}, E, both,
                                one_run._verdict(E, both))  # fmt: skip

    points = [one_run.PointOfRun("", 6000.0, 0.0, 1.2, 0.0, {k: load(v[i]) for k, v in ratios.items()}, ())
              for i in range(n)]  # fmt: skip
    return one_run._sentence(points, "CFD", slips.LeftOpen(unit_open))


def test_a_unit_is_named_only_where_it_was_open_and_fits_every_point() -> None:
    both = frozenset({"thrust_N", "torque_Nm"})
    kgf = {"thrust_N": [1 / 9.80665, 1.03 / 9.80665]}
    assert "kgf" in _told(kgf, both) and "check the unit" in _told(kgf, both)
    lbf = {"thrust_N": [1 / 2.2046, 1 / 2.2046]}
    assert "check the unit" in _told(lbf, both)
    assert "check the unit" not in _told(lbf)  # the file stated it, and a rotor may be off by as much
    assert "check the unit" in _told(kgf)  # no rotor is: what is stated may be wrong
    for ratios in ([18.7, 18.7], [1.77, 1.4], [1 / 9.80665, 1 / 6.0]):
        assert "check the unit" not in _told({"thrust_N": ratios}, both)
    two = _told({"thrust_N": [18.7, 18.7], "torque_Nm": [25.4, 25.4]}, both)
    assert "check the unit" not in two  # a unit of one load leaves the other unexplained
    assert _told({"thrust_N": [4.448, 4.448], "torque_Nm": [1.356 * 12, 1.356 * 12]}, both).count("taken for") <= 1


def test_loads_that_are_off_by_one_factor_are_no_unit_of_one_of_them() -> None:
    """PPTC beside a case of another size, a full model told to be one of seven sectors, rad/s given as rev/min."""
    both = frozenset({"thrust_N", "torque_Nm"})
    for thrust, torque, words in ((4.448, 4.3, "diameter"), (7.1, 6.8, "sector"), (1 / 4.4, 1 / 4.6, "diameter"),
                                  (88.0, 93.0, "rad/s taken for rev/min")):  # fmt: skip
        for units_open in (both, frozenset[str]()):
            told = _told({"thrust_N": [thrust] * 2, "torque_Nm": [torque] * 2}, units_open)
            assert words in told and "check the unit" not in told and ("then the units" in told) == bool(units_open)


def test_coefficients_have_no_unit() -> None:
    given = Dataset("bench", "a", {"CT": [0.1], "CP": [0.05]}, provenance={"format": "uiuc"})
    assert not slips.open_units(given)
    stated = Dataset("bench", "a", {"thrust_N": [1.0], "torque_Nm": [1.0]},
                     provenance={"format": "table", "headings": {"thrust_N": "thrust [lbf]", "torque_Nm": "Q"}})  # fmt: skip
    assert slips.open_units(stated) == {"torque_Nm"}


def test_a_point_near_zero_thrust_does_not_make_the_headline() -> None:
    """Seven of ten agree; the ratio at the smallest load says little."""

    def point(cfd: float, bemt: float) -> one_run.PointOfRun:
        load = one_run.BothLoads(cfd, 0.1, bemt, 0.4, {}, bemt - cfd, 0.41, one_run._verdict(bemt - cfd, 0.41))
        return one_run.PointOfRun("", 6000.0, 0.0, 1.2, 0.0, {"thrust_N": load}, ())

    points = [*(point(5.0 + k, 5.1 + k) for k in range(7)), *(point(0.6, 0.05) for _ in range(3))]
    told = one_run._sentence(points, "CFD", slips.LeftOpen())
    assert "agree in 7 of 10 values" in told and "-5 % of the largest thrust" in told and "9" not in told


def _points(ratios: Sequence[float], u: float = 1.0) -> list[one_run.PointOfRun]:
    loads = [one_run.BothLoads(10.0, 0.2, 10.0 * r, u, {"input": u, "model": 0.1}, 10.0 * (r - 1.0),
                               math.hypot(0.2, u), one_run._verdict(10.0 * (r - 1.0), math.hypot(0.2, u)))
             for r in ratios]  # fmt: skip
    return [one_run.PointOfRun("", 6000.0, k, 1.2, 0.0, {"thrust_N": v}, ()) for k, v in enumerate(loads)]


def test_the_point_that_the_sentence_speaks_of_is_on_the_screen() -> None:
    """Of many points the one of the largest difference is shown, whichever it is."""
    for worst in range(12):
        points = _points([1.4 if k == worst else 1.0 for k in range(12)])
        found = one_run.RunComparison("run", "case", "cfd", {}, tuple(points), (), 0.0, {}, (),
                                      one_run._sentence(points, "CFD", slips.LeftOpen()), "")  # fmt: skip
        told = one_run.text(found)
        assert "+40 %" in told.splitlines()[0] and any("differs" in line for line in told.splitlines()[3:])


def test_bands_that_hide_a_difference_name_what_would_narrow_them() -> None:
    """The unknown of the largest part, with the width that is left without it; silent where the run differs."""
    moved = [Moved(Assumption(f"blade.{name}", 0.5, (0.0, 1.0), False, ""), (), {"thrust_N": np.array([u])})
             for name, u in (("camber", 0.3), ("chord", 0.9))]  # fmt: skip
    told = one_run._narrower(_points([1.05]), moved)
    assert "chord" in told and f"{np.sqrt(1.0 + 0.04 - 0.81):.2g}" in told
    assert not one_run._narrower(_points([1.5]), moved)
    assert not one_run._narrower(_points([1.01], 0.1), moved)  # the band of the run is the wider


FAN = {"rotor_blades": (45.6, -1.15), "spinner": (-1.05, -0.001), "stator_vanes": (-2.2, 1.01),
       "duct_inner": (21.9, 0.01), "duct_lip": (4.9, 0.0), "motor_pod": (-0.6, 0.001)}  # fmt: skip
"""Force and moment of each zone of a ducted fan with vanes [N], [N m]."""


def zones_report(
    put: Callable[..., Path], zones: dict[str, tuple[float, float]], axis: str = "0 0 1", no_force: str = ""
) -> list[str]:
    for k, (name, kind, unit) in enumerate((("forces", "Forces", "N"), ("moments", "Moments", "N m"))):
        way = "Direction Vector (0 0 1)" if k == 0 else f"Moment Center (0 0 0) Moment Axis ({axis})"
        rows = [(z, v[k]) for z, v in zones.items() if k or z != no_force]
        body = "".join(f"{z:16} {0.9 * v:.6g}  {0.1 * v:.6g}  {v:.6g}\n" for z, v in rows)
        net = sum(v for _, v in rows)
        put(f"{name}.txt", f"{kind} - {way}\n          {kind} [{unit}]\nZone      Pressure   Viscous   Total\n{body}"
            f"------ ------ ------ ------\nNet  {0.9 * net:.6g} {0.1 * net:.6g} {net:.6g}\n")  # fmt: skip
    return ["forces.txt", "moments.txt"]


@pytest.mark.parametrize("names", [{}, {"stator_vanes": "ogv"}, {"stator_vanes": "wall-5"}])
def test_the_torque_is_that_of_what_turns_and_the_thrust_that_of_all(
    put: Callable[..., Path], names: dict[str, str]
) -> None:
    files = zones_report(put, {names.get(z, z): v for z, v in FAN.items()})
    run = run_of(files, {"rpm": 29000.0})
    assert run["torque_Nm"][0] == pytest.approx(1.151)
    assert run["thrust_N"][0] == pytest.approx(sum(T for T, _ in FAN.values()))
    assert run["duct_thrust_N"][0] == pytest.approx(26.8)
    assert any(names.get("stator_vanes", "stator_vanes") in n for n in run.notes if "torque" in n)


def test_forces_and_moments_are_of_one_shaft_and_of_the_same_zones(put: Callable[..., Path]) -> None:
    blades = {"blade_1": (3.2, 0.064), "blade_2": (3.2, 0.064), "hub": (-0.1, 0.0003)}
    with pytest.raises(InputError, match=r"about \(1 0 0\), where the force is along \(0 0 1\)"):
        run_of(zones_report(put, blades, "1 0 0"), {"rpm": 6000.0})
    with pytest.raises(InputError, match="a moment of blade_2 and no force of it"):
        run_of(zones_report(put, blades, no_force="blade_2"), {"rpm": 6000.0})
    run = run_of(zones_report(put, blades, "0 0 -2"), {"rpm": 6000.0})
    assert run["thrust_N"][0] == pytest.approx(6.3) and run["torque_Nm"][0] == pytest.approx(0.1283)


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (["--column", "thrust=Thrust"], "a column of mass for the thrust"),
        (["--column", "torque=Thrust"], "a column of mass for the torque"),
        (["--unit", "Thrust=kg"], "write kgf"),
        (["--unit", "Thrust=m/s"], "a unit of force"),
        (["--unit", "Thrust=kgf"], ""),
        (["--unit", "thrust=kgf"], ""),
    ],
)
def test_a_unit_that_no_thrust_has_is_asked_for_and_what_is_stated_then_counts(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str], told: list[str], expected: str
) -> None:
    rows = "".join(f"{k},{T},{Q}\n" for k in range(1, 99))
    put("run.csv", f'"Iteration","Thrust Monitor: Thrust (kg)","Torque Monitor: Torque (N-m)"\n{rows}')
    assert main(["import", "run.csv", "--rpm", "8000", *told, "--out", "run.toml"]) == (2 if expected else 0)
    assert expected in capsys.readouterr().err
    if not expected:
        assert load_run("run.toml")["thrust_N"][0] == pytest.approx(9.80665 * T)


def test_one_revolution_has_no_drift(put: Callable[..., Path]) -> None:
    """Of a start that is still going on nothing says so but the revolutions before."""
    t = np.linspace(0.0, 1.1 * 60.0 / RPM, 400)
    rows = "".join(f"{at:.8g},{T * (1.0 - np.exp(-at / t[-1])):.8g},{Q}\n" for at in t)
    put("run.csv", f'"Physical Time (s)","Thrust Monitor: Thrust (N)","Torque Monitor: Torque (N-m)"\n{rows}')
    run = run_of(["run.csv"], {"rpm": RPM})
    assert "thrust_N" not in run.drift and "nothing says that it has settled" in run.averaged["thrust_N"]


def test_rows_that_differ_in_what_nobody_read_are_no_repeats(tmp_path: Path, project: Path) -> None:
    rows = "".join(f"DP {k},6000,{5 * k},{5 - k},0.1\n" for k in range(4))
    (tmp_path / "a.csv").write_text(f"Design Points,rpm [rpm],P7 [m s^-1],thrust [N],torque [N m]\n{rows}")
    case = str(project / "cases" / "prop_8x5")
    with pytest.raises(InputError, match="P7: got rows that differ in nothing else"):
        diagnose(str(tmp_path / "a.csv"), case)
    (tmp_path / "a.csv").write_text((tmp_path / "a.csv").read_text().replace("P7", "velocity_inlet"))
    assert run_of([str(tmp_path / "a.csv")], {})["airspeed_m_s"].max() == 15.0


def test_zones_of_which_nothing_tells_what_turns_are_asked_for(put: Callable[..., Path]) -> None:
    files = zones_report(put, {f"wall-{k}": v for k, v in enumerate(FAN.values())})
    with pytest.raises(InputError, match="--rotor-zones wall-0"):
        run_of(files, {"rpm": 29000.0})
    run = run_of(files, {"rpm": 29000.0, "rotor_zones": ("wall-0", "wall-1")})
    assert run["torque_Nm"][0] == pytest.approx(1.151)
    files = zones_report(put, {"blade_upper": (5.0, -0.1), "blade_lower": (4.0, 0.09)})  # two shafts
    with pytest.raises(InputError, match="--rotor-zones"):
        run_of(files, {"rpm": 6000.0})
    files = zones_report(put, {"wall-1": (5.0, -0.1), "wall-2": (0.1, -0.002)})  # all turn one way
    assert run_of(files, {"rpm": 6000.0})["torque_Nm"][0] == pytest.approx(0.102)


def test_forces_of_another_density_are_made_those_of_the_run(put: Callable[..., Path]) -> None:
    files = [f"postProcessing/forces/0/{name}.dat" for name in ("force", "moment")]
    foam(put)
    plain = run_of(files, {"rpm": RPM})
    assert any("--reference density" in n for n in plain.notes)
    told = run_of(files, {"rpm": RPM, "density_kg_m3": 1.2}, reference={"density_kg_m3": 1.0})
    for channel in ("thrust_N", "torque_Nm"):
        assert told[channel][0] == pytest.approx(1.2 * plain[channel][0])
        assert told.u[channel][0] == pytest.approx(1.2 * plain.u[channel][0])
    assert not any("--reference density" in n for n in told.notes)
    with pytest.raises(InputError, match="--density-kg-m3"):
        run_of(files, {"rpm": RPM}, reference={"density_kg_m3": 1.0})
    with pytest.raises(InputError, match="no load here rests on it"):  # what is stated has an effect, or is refused
        run_of(files, {"rpm": RPM}, reference={"area_m2": 1.0})


def test_a_rotor_that_brakes_in_flight_is_not_turned_into_one_that_pulls(put: Callable[..., Path]) -> None:
    put("thrust.out", rfile("thrust", steady(-1.2), None))
    put("torque.out", rfile("torque", steady(-0.006), None))
    flight = {"rpm": 6000.0, "airspeed_m_s": 20.0}  # a pull would be 24 W of a shaft of 3.8 W
    with pytest.raises(InputError, match="--sign torque=1 keeps it"):
        run_of(["thrust.out", "torque.out"], flight, **UNITS)
    driven = {"columns": {"thrust": {"unit": "N"}, "torque": {"unit": "N m", "sign": 1}}}
    run = run_of(["thrust.out", "torque.out"], flight, **driven)
    assert run["thrust_N"][0] == pytest.approx(-1.2, rel=1e-3) and not any("merit" in n for n in run.notes)
    with pytest.raises(InputError, match="--sign thrust=1 keeps it"):  # 2.4 W of 3.8 W: either may be
        run_of(["thrust.out", "torque.out"], {"rpm": 6000.0, "airspeed_m_s": 2.0}, **UNITS)
    put("still.out", rfile("torque", steady(0.0), None))
    with pytest.raises(InputError, match="--sign thrust=1 keeps it"):
        run_of(["thrust.out", "still.out"], flight, **UNITS)
    put("thrust.out", rfile("thrust", steady(1.2), None))  # a pull takes power of the shaft
    run = run_of(["thrust.out", "torque.out"], {"rpm": 6000.0, "airspeed_m_s": 2.0}, **UNITS)
    assert run["torque_Nm"][0] == pytest.approx(0.006, rel=1e-3)


def test_coefficients_of_a_solver_are_loads_by_its_reference_values(put: Callable[..., Path]) -> None:
    put("ct.out", rfile("ct", steady(T / FORCE), None))
    put("cq.out", rfile("cq", steady(Q / FORCE / LENGTH), None))
    with pytest.raises(InputError, match="--reference area=A"):
        run_of(["ct.out", "cq.out"], {"rpm": RPM})
    columns = {"thrust": {"column": "ct"}, "torque": {"column": "cq"}}
    told = {"area_m2": AREA, "length_m": LENGTH, "speed_m_s": SPEED, "density_kg_m3": RHO}
    run = run_of(["ct.out", "cq.out"], {"rpm": RPM}, columns=columns, reference=told)
    assert (run["thrust_N"][0], run["torque_Nm"][0]) == pytest.approx((T, Q), rel=1e-4)


def test_two_folders_of_exports_are_compared_at_the_speed_that_is_typed(
    put: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foam(put)
    for name in ("one", "two"):
        shutil.copytree("postProcessing", tmp_path / name / "postProcessing")
    force = next((tmp_path / "two").rglob("force*.dat"))
    force.write_text(force.read_text() + "# another run\n")
    folders = ["one/postProcessing", "two/postProcessing"]
    assert main(["compare", *folders]) == 2
    assert "--rpm" in capsys.readouterr().err
    assert main(["compare", *folders, "--rpm", "8000", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [point["rpm"] for point in told["points"]] == [8000.0]
    assert all(load["A"] > 0.0 and load["difference"] == 0.0 for load in told["points"][0]["loads"].values())
    assert main(["compare", folders[0], "--case", "10x5", "--rpm", "8000"]) in (0, 1)
    assert f"bemt diagnose {folders[0]} " in " ".join(capsys.readouterr().out.split())

"""The promise of ``bemt import``: one schema for every format, nothing joined or guessed."""
# ruff: noqa: E501 - samples as they look in files

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bemt
from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.data.recordings.adapt import Choice
from bemt.data.recordings.cfd_options import run_from
from bemt.data.recordings.channels import named
from bemt.data.recordings.check import check
from bemt.data.recordings.load import import_file, import_files

PERIOD = 0.5


def history(turns: float = 6.0, per_turn: int = 50, start: float = 0.0, first: int = 1) -> str:
    """Torque -0.2 with a blade-passing ripple and a start-up; volume, which is no load."""
    text = '"q-rfile"\n"Time Step" "torque etc.."\n("Time Step" "torque" "volume" "flow-time")\n'
    for k in range(int(turns * per_turn)):
        t = start + (k + 1) * PERIOD / per_turn
        q = -0.2 - 0.01 * math.sin(2 * math.pi * 2 * t / PERIOD) - (5.0 if k < 3 else 0.0)
        text += f"{k + first} {q:.12g} 0.25 {t:.12g}\n"
    return text


def call(capsys: pytest.CaptureFixture[str], *args: object) -> tuple[int, dict[str, Any]]:
    code = main(["import", *map(str, args), "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_schema(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    code, found = call(capsys, put("q.out", history()), "--rpm", "120")
    assert code == 0 and found["schema"] == "bemt.import/1"
    (file,) = found["files"]
    keys = ["path", "format", "kind", "rows", "channels", "warnings", "error", "findings", "reduction"]
    assert list(file) == keys and file["findings"] == [] and file["reduction"] is None
    assert (file["format"], file["kind"], file["rows"], file["error"]) == ("fluent_report", "cfd", 300, None)
    assert all(list(c) == ["unit", "mean", "averaged_over", "drift"] for c in file["channels"].values())
    torque = file["channels"]["torque"]
    assert torque["mean"] == pytest.approx(-0.2, abs=1e-9) and abs(torque["drift"]) < 1e-9
    assert torque["averaged_over"] == "last 3 revolutions (1.5 to 3 s, 150 rows)"
    assert file["channels"]["time_s"] == {"unit": "s", "mean": None, "averaged_over": "", "drift": None}


def test_period_and_revolutions(put: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    path = put("q.out", history())
    _, one = call(capsys, path, "--period-s", "0.5", "--revolutions", "1")
    assert one["files"][0]["channels"]["torque"]["averaged_over"].startswith("last 1 revolution (2.5 to 3 s, 50 rows")
    _, many = call(capsys, path, "--period-s", "0.5", "--revolutions", "6")
    assert many["files"][0]["channels"]["torque"]["mean"] == pytest.approx(-0.2 - 3 * 5.0 / 300)  # start-up and all
    _, more = call(capsys, path, "--period-s", "0.5", "--revolutions", "7")
    assert more["files"][0]["channels"]["torque"]["mean"] is None
    assert any("6 revolutions recorded, 7 wanted" in w for w in more["files"][0]["warnings"])


def test_without_a_speed_the_mean_says_that_it_holds_the_start_up(put: Callable[..., Path]) -> None:
    (file,) = import_files([put("q.out", history())]).document()["files"]
    assert file["channels"]["torque"]["averaged_over"] == "all 300 rows, start-up included"
    assert any("give --rpm or --period-s" in w for w in file["warnings"])
    assert any(w.startswith("not settled") and "torque" in w for w in file["warnings"])


def test_a_steady_run_does_not_use_the_speed_and_must_have_settled(put: Callable[..., Path]) -> None:
    rows = "".join(f"{k} {5.0 + 0.01 * k}\n" for k in range(1, 201))
    path = put("t.out", '"t"\n"Iteration" "thrust"\n("Iteration" "thrust")\n' + rows)
    (file,) = import_files([path], choice=Choice(period=0.1)).document()["files"]
    assert file["channels"]["thrust"]["averaged_over"] == "last 40 rows"
    assert any("the speed of rotation is not used" in w for w in file["warnings"])
    assert any(w.startswith("not settled") and "thrust +5.73%" in w for w in file["warnings"])


def test_restart_files_on_another_clock_are_never_joined(put: Callable[..., Path]) -> None:
    a = put("q-rfile.out", history())
    b = put("q-rfile_1_1.out", history(per_turn=80))  # the same steps at other times
    found = import_files([a, b], choice=Choice(period=PERIOD)).document()
    assert [f["rows"] for f in found["files"]] == [300, 480]
    assert not found["runs"] and "on another clock; expected files of one run" in found["to_do"]


def test_openfoam_start_folders_are_one_run(put: Callable[..., Path]) -> None:
    head = "# Force\n# Time\ttotal_x total_y total_z\n"
    one = put("forces/0/force.dat", head + "".join(f"{0.01 * k:g} 1 0 0\n" for k in range(1, 30)))
    two = put("forces/0.2/force.dat", head + "".join(f"{0.2 + 0.01 * k:g} 2 0 0\n" for k in range(1, 30)))
    run = run_from([str(one), str(two)], rpm=6000.0)
    (made,) = import_files([one, two], run=run).runs
    assert made["thrust_N"][0] == pytest.approx(2.0) and any("joined at step 0.21" in note for note in made.notes)


def test_a_refused_file_is_2_and_the_others_are_shown(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    good, bad = put("q.out", history()), put("x.bin", "FoamFile\n{\n version 2.0;\n}\n")
    code, found = call(capsys, bad, good, good.parent / "absent.out")
    assert code == 2
    assert "an OpenFOAM dictionary or field" in found["files"][0]["error"] and found["files"][1]["error"] is None
    assert "absent.out: got no such file" in found["files"][2]["error"] and found["files"][2]["channels"] == {}
    assert main(["import", str(good)]) == 0
    text = capsys.readouterr().out
    assert "fluent_report (cfd), 300 rows" in text and "  ! report files state no units" in text


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--rpm", "0"], "--rpm: got 0"),
        (["--rpm", "nan"], "--rpm: got nan"),
        (["--period-s", "-1"], "--period-s: got -1"),
        (["--revolutions", "2"], "--revolutions: got no speed"),
        (["--format", "nonsense"], "--format: got 'nonsense'; expected one of"),
        (["--sector", "1000"], "--sector: got 1000"),
        (["--sign", "2"], "--sign: got 2"),
        (["--unit", "torque"], "--unit: got torque; expected NAME=VALUE"),
        (["--unit", "torque=N"], "--unit torque: got 'N'; expected a unit of torque"),
        (["--setup", "colour=red"], "--setup: got an unknown key"),
    ],
)
def test_wrong_options(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str], args: list[str], message: str
) -> None:
    assert main(["import", str(put("q.out", history())), *args]) == 2
    assert message in capsys.readouterr().err


def test_a_damaged_head_is_not_taken_for_a_plain_table(put: Callable[..., Path]) -> None:
    text = history()
    for cut in (70, 75, 78):
        (file,) = import_files([put("q.out", text[cut:])]).document()["files"]
        assert file["error"] and not file["channels"], cut


def test_other_formats_are_shown_as_well(put: Callable[..., Path], project: Path) -> None:
    static = put("apce_10x5_static_kt0827.txt", "RPM CT CP\n2000 0.10 0.05\n3000 0.11 0.05\n")
    blade = put(
        "apce_10x5_geom.txt",
        "r/R c/R beta\n" + "".join(f"{0.15 + 0.05 * k:.2f} 0.12 {40 - 1.5 * k}\n" for k in range(18)),
    )
    cases = sorted((project / "cases").glob("*/references.csv"))
    found = import_files([static, blade, *cases]).document()["files"]
    assert [f["error"] for f in found] == [None] * len(found)
    assert (found[0]["kind"], found[0]["rows"], found[1]["kind"], found[1]["rows"]) == ("bench", 2, "geometry", 18)
    assert all(c["mean"] is None for c in found[0]["channels"].values())
    assert all("thrust_N" in f["channels"] for f in found[2:]) and len(cases) >= 5


def test_means_are_over_time_when_the_step_changes(put: Callable[..., Path]) -> None:
    times = np.cumsum(np.r_[np.full(200, 0.01), np.full(500, 0.002)])
    text = '"t"\n"x etc.."\n("Time Step" "q" "flow-time")\n'
    text += "".join(f"{k} {1 if t <= 2 + 1e-9 else 3} {t:.6f}\n" for k, t in enumerate(times))
    record = import_file(put("t.out", text), choice=Choice(1.0, 2))
    assert record.provenance["means"]["q"].value == pytest.approx(2.0)
    assert any("means of single revolutions differ" in w for w in record.notes)


def test_a_table_with_a_column_of_time_is_averaged_over_revolutions(put: Callable[..., Path]) -> None:
    t = 0.001 * np.arange(1, 401)
    rows = "".join(f"{x:.3f},{2.0 + np.sin(2.0 * np.pi * x / 0.05):.9f}\n" for x in t)
    mean = import_file(put("t.csv", "time_s,force_N\n" + rows), choice=Choice(0.05, 2)).provenance["means"]["force_N"]
    assert mean.value == pytest.approx(2.0) and mean.over.startswith("last 2 revolutions")


def test_the_published_screw(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = shared_data / "cfd_exports" / "screw" / "report-def-0-rfile_1_1.out"
    for args, mean in (
        (["--rpm", "130.2"], -0.17547),
        (["--rpm", "130.2", "--revolutions", "1"], -0.17097),
        ([], -0.14100),
    ):
        _, found = call(capsys, path, *args)
        assert round(found["files"][0]["channels"]["report-def-0"]["mean"], 5) == mean


def test_a_reader_that_fails_loses_its_own_file_only(
    put: Callable[..., Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from bemt.data.readers import histories

    def broken(self: object, path: object) -> None:
        raise IndexError("list index out of range")

    other = put("log.csv", "rpm,thrust_N\n8000,3.2\n10000,5.0\n")
    paths = [put("q.out", history()), other, put("absent", "") / "x"]
    monkeypatch.setattr(histories.Layout, "read", broken)
    code, found = call(capsys, *paths)
    assert code == 3  # the worst of all: a failure of ours, a file that was read, a path that is none
    first, second, third = found["files"]
    assert "IndexError" in first["error"] and "report it" in first["error"]
    assert second["error"] is None and second["rows"] == 2
    assert third["error"] is not None and "internal" not in third["error"]


def test_a_file_of_another_command_is_handed_over(tmp_path: Path) -> None:
    (tmp_path / "log.bbl").write_bytes(b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n" + bytes(99))
    with pytest.raises(InputError, match="Betaflight .*bemt fly"):
        import_file(tmp_path / "log.bbl")
    rows = "".join(f"{k},{1000 * k},{300 + k},{310 + k}\n" for k in range(40))
    (tmp_path / "log.csv").write_text(
        '"Firmware revision","Betaflight 4.4.2"\nloopIteration,time,motor[0],motor[1]\n' + rows
    )
    for read in (import_file, lambda file: bemt.diagnose(file, "10x5")):
        with pytest.raises(InputError, match="Betaflight .*bemt fly"):
            read(tmp_path / "log.csv")


@pytest.mark.parametrize("heading", ["weight (g)", "Weight", "Gewicht [g]", "poids"])
def test_what_a_kitchen_scale_is_called_is_asked_for(
    heading: str, put: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Not taken, as a mass may be meant; not asked where a thrust is there, and no part's weight is one."""
    rows = "".join(f"{n},{1.2e-5 * n * n:.5g},{1e-9 * n * n:.4g}\n" for n in range(3000, 9000, 500))
    file = put("scale.csv", f"rpm,{heading},torque (N.m)\n{rows}")
    asked = import_files([str(file)])
    record = asked.files[0].record
    assert record is not None and "thrust_N" not in named(record).values
    assert f"--unit {shlex.quote(heading)}=UNIT" in asked.text()
    _, found = call(capsys, file, "--unit", f"{heading}=gf")
    assert "thrust_N" in found["files"][0]["channels"]
    both = put("both.csv", f"rpm,{heading},thrust (N)\n{rows}")
    part = put("part.csv", f"rpm,motor {heading},torque (N.m)\n{rows}")
    assert "=UNIT" not in import_files([str(both)]).text() + import_files([str(part)]).text()


def test_import_takes_the_speed_that_diagnose_takes(put: Callable[..., Path]) -> None:
    """An angular speed, and the electrical speed where the optical sensor saw nothing; errors stand first."""
    n = np.arange(300.0, 700.0, 40.0)
    rows = np.transpose([n, 8e-3 * n**2, 1.3e-4 * n**2])
    table = "omega [rad/s],T [mN],Q [mN.m]\n" + "".join(",".join(f"{v:.6g}" for v in row) + "\n" for row in rows)
    eyes = "Motor Electrical Speed (RPM),Motor Optical Speed (RPM),Thrust (N),Torque (N.m)\n" + "".join(
        f"{v * 9.5493:.6g},0,{8e-6 * v * v:.6g},{1.3e-7 * v * v:.6g}\n" for v in n
    )
    for name, text in (("si.csv", table), ("eyes.csv", eyes)):
        path = str(put(name, text))
        found = import_files([path])
        assert found.files[0].reduced["rpm"] == pytest.approx(n * 30 / np.pi, rel=1e-4)
        assert f"bemt diagnose {path}" in found.text()
    strong = "rpm,thrust (N),torque (N.m),voltage (V),current (A)\n" + "".join(
        f"{v * 9.5493:.6g},{9e-6 * v**1.98:.6g},{1.3e-7 * v * v:.6g},10,{2e-9 * v**3:.6g}\n" for v in n
    )
    lines = import_files([str(put("strong.csv", strong))]).text().splitlines()
    assert "power_above_input" in lines[3] and "cannot be right: torque x speed" in lines[1]


@pytest.mark.parametrize(("heads", "air"), [
    ("Temp (F),Pressure (inHg)", (64.4, 29.09)), ("Lufttemperatur (C),Luftdruck (hPa)", (18.0, 985.1)),
    ("temperature (C),pressure (kPa)", (18.0, 98.51)),
])  # fmt: skip
def test_temperature_and_pressure_are_the_airs_however_they_are_headed(
    heads: str, air: tuple[float, float], put: Callable[..., Path]
) -> None:
    n = np.arange(3000.0, 7000.0, 500.0)
    rows = "".join(f"{v:g},{8e-8 * v**2:.6g},{1.3e-9 * v**2.01:.6g},{air[0]:g},{air[1]:g}\n" for v in n)
    path = put("air.csv", f"rpm,thrust (N),torque (Nm),{heads}\n{rows}")
    reduced = import_files([str(path)]).files[0].reduced
    assert reduced["density_kg_m3"] == pytest.approx(98510.0 / (287.05 * 291.15), rel=1e-3)


def test_fahrenheit_under_celsius_is_an_error_that_says_so(put: Callable[..., Path]) -> None:
    n = np.arange(3000.0, 7000.0, 500.0)
    rows = "".join(f"{v:g},{8e-8 * v**2:.6g},{1.3e-9 * v**2.01:.6g},64.4,985\n" for v in n)
    path = put("air.csv", f"rpm,thrust (N),torque (Nm),air temperature (C),air pressure (hPa)\n{rows}")
    text = import_files([str(path)]).text()
    assert "64.4 F is 18 C" in text and "Fahrenheit taken for Celsius" in text.splitlines()[2]


def test_a_sign_turns_the_load_that_the_reader_sees_whatever_it_is_headed(tmp_path: Path) -> None:
    """What import suggests of a negative Fz is what its option takes; -1 alone turns each load of the table."""
    rows = [(3000, -1.1, -0.023), (4000, -2.0, -0.041), (5000, -3.1, -0.062)]
    file = tmp_path / "cell.csv"
    file.write_text("RPM,Fz (N),Mz (Nm)\n" + "".join(f"{n},{T},{Q}\n" for n, T, Q in rows))
    bemt.import_(file, sign={"thrust": "-1"}, out=tmp_path / "one.toml")
    bemt.import_(file, sign={"": "-1"}, out=tmp_path / "all.toml")
    one, both = bemt.read(tmp_path / "one.toml"), bemt.read(tmp_path / "all.toml")
    assert np.allclose(one.thrust_N, [1.1, 2.0, 3.1]) and np.allclose(one.torque_Nm, [-0.023, -0.041, -0.062])
    assert np.allclose(both.thrust_N, [1.1, 2.0, 3.1]) and np.allclose(both.torque_Nm, [0.023, 0.041, 0.062])


def test_a_table_of_coefficients_is_shown_row_by_row(tmp_path: Path) -> None:
    file = tmp_path / "static.csv"
    file.write_text("rpm;CT;CP\n3000;0,0951;0,0420\n4000;0,0958;0,0415\n")
    told = bemt.import_(file).text
    assert all(number in told for number in ("0.0951", "0.0415", "4000"))


TUNNEL = [(3006, 0, 2.50, 0.0516), (2998, 2.98, 2.16, 0.0514), (2999, 5.96, 1.56, 0.0454), (2999, 7.99, 0.89, 0.0340),
          (2999, 10.02, 0.18, 0.0199), (3999, 0, 4.56, 0.0929), (4002, 2.97, 4.08, 0.0960), (4008, 5.99, 3.33, 0.0914),
          (3996, 7.99, 2.69, 0.0810), (4000, 10.03, 1.83, 0.0681), (4995, 0, 6.98, 0.1422), (5004, 2.98, 6.49, 0.1487),
          (5000, 6.07, 5.77, 0.1457), (5006, 7.99, 4.96, 0.1393), (5003, 9.99, 4.13, 0.1264)]  # fmt: skip


def _tunnel(file: Path, rows: list[tuple[float, ...]]) -> dict[str, Any]:
    """What import says of a table of a tunnel."""
    head = "rpm,airspeed m/s,thrust N,torque N m\n"
    file.write_text(head + "\n".join(",".join(map(str, row)) for row in rows))
    return bemt.import_(file).to_dict()["files"][0]


def test_a_sensor_that_sticks_in_part_of_a_table_is_named_and_hides_no_slip_of_a_unit(tmp_path: Path) -> None:
    """Its rows are no repeats; typed set points and good readings are no fault; a unit is judged without three at rest."""
    stuck = [row if i < 10 else (row[0], 10.03, *row[2:]) for i, row in enumerate(TUNNEL)]
    both = [(n, V, T, round(100 * Q, 3)) for n, V, T, Q in stuck]
    cell = [row if i < 10 else (row[0], row[1], 6.98, row[3]) for i, row in enumerate(TUNNEL)]
    four = [row if i < 11 else (row[0], row[1], 6.98, row[3]) for i, row in enumerate(TUNNEL)]
    typed = [(n, round(V / 2) * 2, T, Q) for n, V, T, Q in TUNNEL]
    one_V = [(n, 8.0, T, Q) for n, V, T, Q in TUNNEL if round(V) == 8] * 3
    told = {name: _tunnel(tmp_path / f"{name}.csv", rows) for name, rows in
            (("sound", TUNNEL), ("stuck", stuck), ("both", both), ("cell", cell), ("four", four), ("typed", typed), ("one", one_V))}  # fmt: skip
    found = {name: {f["id"]: f for f in one["findings"]} for name, one in told.items()}
    assert all(not found[name] for name in ("sound", "typed", "one"))
    assert found["stuck"].keys() == {"stuck_sensor"} and found["stuck"]["stuck_sensor"]["rows"] == [10, 11, 12, 13, 14]
    assert found["cell"]["stuck_sensor"]["channel"] == found["four"]["stuck_sensor"]["channel"] == "thrust_N"
    assert found["both"].keys() == {"stuck_sensor", "torque_unit"}
    assert "Ncm taken for Nm" in found["both"]["torque_unit"]["correction"]
    assert len(told["stuck"]["reduction"]["points"]) == 10
    assert not any("repeats scatter" in note for note in told["stuck"]["reduction"]["notes"])


def test_the_air_alone_makes_a_recording(tmp_path: Path) -> None:
    """Headings that say all need no [columns]: [air] gives the density for coefficients."""
    _tunnel(tmp_path / "good.csv", TUNNEL)
    (tmp_path / "good.toml").write_text('[recording]\nfile = "good.csv"\n[air]\ndensity_kg_m3 = 1.19\n')
    read = bemt.read(tmp_path / "good.toml").derive(0.3048)
    assert read["CT"][0] == pytest.approx(2.50 / (1.19 * 50.1**2 * 0.3048**4), rel=1e-3)
    with pytest.raises(bemt.InputError, match="density_kg_m3"):
        bemt.read(tmp_path / "good.csv").plot("rpm", ["CT", "CP"])


@pytest.mark.parametrize("heading", ["watts", "power (W)", "Leistung [W]"])
def test_watts_beside_volts_are_what_the_supply_gave(tmp_path: Path, heading: str) -> None:
    """A shaft has its power by a torque; with one, a bare power stays open. A noise of some per cent changes nothing."""
    rows = [(3000, 1.1, 11.1, 12), (4000, 1.9, 11.0, 26), (5000, 3.0, 10.9, 48), (6000, 4.3, 10.8, 80)]
    file = tmp_path / "bench.csv"
    file.write_text(f"rpm,thrust_N,volts,{heading}\n" + "".join(f"{','.join(map(str, r))}\n" for r in rows))
    points = named(import_file(file))
    assert points["electrical_power_W"].tolist() == [12, 26, 48, 80] and "power_W" not in points
    metered = [(*row, row[3] / row[2] * k) for row, k in zip(rows, (1.03, 0.96, 1.0, 1.02), strict=True)]
    file.write_text(f"rpm,thrust_N,volts,{heading},amps\n" + "".join(f"{','.join(map(str, r))}\n" for r in metered))
    assert named(import_file(file))["electrical_power_W"].tolist() == [12, 26, 48, 80]
    file.write_text("rpm,thrust_N,Watt\n" + "".join(f"{n},{T},{P}\n" for n, T, _, P in rows))
    assert named(import_file(file))["electrical_power_W"].tolist() == [12, 26, 48, 80]  # what an instrument shows
    file.write_text(f"rpm,torque_Nm,volts,{heading}\n" + "".join(f"{','.join(map(str, r))}\n" for r in rows))
    assert "electrical_power_W" not in named(import_file(file))


@pytest.mark.parametrize("told", ["lift=g", "LIFT=gf", "Grams=g", "grams=g", "Thrust=g"])
def test_a_unit_is_taken_by_a_heading_or_a_quantity_in_any_case(tmp_path: Path, told: str) -> None:
    file, head = tmp_path / "bench.csv", "Grams" if told.casefold().startswith("grams") else "lift"
    file.write_text(f"rpm,{head},torque_Nm\n3000,110,0.01\n4000,196,0.02\n5000,306,0.03\n")
    stated = ["--column", f"thrust={head}"] if told.startswith("Thrust") else []
    assert main(["import", str(file), "--unit", told, *stated, "--out", str(tmp_path / "kept.toml")]) == 0
    assert named(import_file(tmp_path / "kept.toml"))["thrust_N"] == pytest.approx(
        np.array([110, 196, 306]) * 9.80665e-3
    )
    assert main(["import", str(file), "--unit", told.replace("=g", "=parsec")]) == 2


def test_what_needs_no_action_has_a_mark_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sound recording has no exclamation mark; one without the unit of its thrust is not to be diagnosed yet."""
    file = tmp_path / "good.csv"
    scatter = np.random.default_rng(1).normal(1.0, 0.01, (11, 5))
    rows = [(1200 + 60 * k, 6e-10 * n**2 * a, 4e-9 * n**2 * b, 16.0 * c, 1.0 + 6e-8 * n**2 * d, n, n * (0.999 + 0.001 * e))
            for k, n, (a, b, c, d, e) in zip(range(11), np.linspace(3000.0, 9000.0, 11), scatter, strict=True)]  # fmt: skip
    head = "ESC signal (µs),Torque (N·m),Thrust (kgf),Voltage (V),Current (A),Motor Electrical Speed (RPM)," \
           "Motor Optical Speed (RPM)"  # fmt: skip
    body = "".join(",".join(f"{v:.5g}" for v in row) + "\n" for row in rows)
    file.write_text(f"{head}\n{body}", encoding="utf-8")
    assert main(["import", str(file)]) == 0
    said = capsys.readouterr().out
    assert "  ! " not in said and "Next: bemt diagnose" in said
    file.write_text(f"{head}\n{body}".replace("Thrust (kgf)", "Thrust"), encoding="utf-8")
    assert main(["import", str(file)]) == 0
    said = capsys.readouterr().out
    (step,) = [line for line in said.splitlines() if line.startswith("Next: ")]
    assert "--unit Thrust=UNIT" in step and "diagnose" not in step
    words = shlex.split(step.removeprefix("Next: bemt ").partition("   (")[0].replace("UNIT", "kgf"))
    assert main(words) == 0 and "thrust_N" in capsys.readouterr().out


@pytest.mark.parametrize(("heading", "found"), [("10K_Q", False), ("K_Q", True)])
def test_a_torque_coefficient_ten_times_too_large_is_said(tmp_path: Path, heading: str, found: bool) -> None:
    """As ships' propellers are tabled: 10 K_Q under the heading K_Q leaves a tenth of the merit that any rotor has."""
    rows = [(0.0, 0.105, 0.065), (0.2, 0.09, 0.061), (0.4, 0.062, 0.05), (0.5, 0.044, 0.04)]
    (tmp_path / "k.csv").write_text(f"J,K_T,{heading}\n" + "".join(f"{','.join(map(str, r))}\n" for r in rows))
    said = {f.id: f for f in check(import_file(tmp_path / "k.csv"))}
    assert ("coefficient_tenfold" in said) == found
    assert not found or "multiply by 0.1" in said["coefficient_tenfold"].correction


@pytest.mark.parametrize(
    ("head", "sign", "step"),
    [
        ("Gas in %;Schub in Gramm;Leistung in Watt;Spannung in Volt", 1, "bemt compare a.csv ANOTHER_RUN "),
        ("Gas in %;Schub in Gramm;Leistung in Watt;Drehzahl pro Minute", 1, "bemt diagnose a.csv --case CASE "),
        ("Gas in %;Schub in Gramm;Leistung in Watt;RPM", -1, "bemt diagnose a.csv --case CASE --sign thrust=-1 "),
        ("Gas in %;Schub in Lot;Leistung in Watt;Spannung in Volt", 1, "bemt import a.csv --unit 'Schub in Lot'=UNIT "),
    ],
)
def test_the_next_step_is_one_that_goes_on(
    head: str, sign: int, step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Units in words; no speed, a load of the other sign, a unit that nobody knows: what it prints takes it further."""
    monkeypatch.chdir(tmp_path)
    rows = [
        f"{10 * k};{sign * 12 * k * k};{2 * k**3};{15.6 - 0.01 * k if 'Volt' in head else 1000 * k}"
        for k in range(3, 11)
    ]
    Path("a.csv").write_text("\n".join([head, *rows, ""]), encoding="utf-8")
    assert main(["import", "a.csv"]) == 0
    assert f"Next: {step}" in capsys.readouterr().out
    if "Lot" in head:
        Path("b.csv").write_text("\n".join([head, *rows[1:], ""]), encoding="utf-8")
        assert main(["compare", "a.csv", "b.csv"]) == 2
        assert "a.csv: got no load and no speed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table, "9 points, 4000 to 8000 rev/min, thrust and torque; nothing contradicts itself."),
        (lambda table: table.assign(torque_Nm=9.80665 * table.torque_Nm), "; in doubt: "),
        (lambda table: table.assign(volts=12.0, amps=6e-4 * table.rpm), "torque x speed."),
        (lambda table: table.assign(thrust_N=table.thrust_N.where(table.rpm < 7800.0)),
         "no number in thrust_N (line 10)."),
    ],
    ids=["sound", "unit", "power", "cell"],
)  # fmt: skip
def test_it_says_first_whether_a_recording_is_sound(
    tmp_path: Path, change: Callable[[pd.DataFrame], pd.DataFrame], words: str
) -> None:
    n = np.arange(4000.0, 8001.0, 500.0)
    table = pd.DataFrame({"thrust_N": np.round(8.6e-8 * n**2.02, 3), "torque_Nm": np.round(1.3e-9 * n**2, 4), "rpm": n})
    change(table).to_csv(tmp_path / "run.csv", index=False)
    answer = bemt.import_(tmp_path / "run.csv")
    said, *_ = " ".join(answer.text.splitlines()[1:3]).partition(" channels:")
    assert said.split()[:2] == ["9", "points,"] and words in " ".join(said.split())
    assert ("nothing contradicts" in said) is words.endswith("itself.")


@pytest.mark.parametrize(
    ("told", "asked"),
    [
        ("--unit thrust=g", "Schub=gf --unit Drehzahl=UNIT"),
        ("--unit Schub=g --sign thrust=-1 --density-kg-m3 1.2", "Schub=gf --sign thrust=-1 --unit Drehzahl=UNIT"),
        ("--unit Schub=g --out kept.toml", "Schub=gf --unit Drehzahl=UNIT"),
    ],
)
def test_the_next_step_repeats_what_was_stated(
    told: str, asked: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file that the step writes knows all of it: unit of the thrust, sign, density."""
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{10 * k};{12 * k * k};{1000 * k}\n" for k in range(3, 11))
    Path("a.csv").write_text(f"Gas;Schub;Drehzahl\n{rows}", encoding="utf-8")
    assert main(["import", "a.csv", *told.split()]) == 0
    said = capsys.readouterr().out
    (step,) = [line[line.index("bemt import") :] for line in said.splitlines() if "=UNIT" in line]
    assert f"--unit {asked} --out " in step and ("--density-kg-m3 1.2" in step) == ("density" in told)
    assert main(shlex.split(step.partition("   (")[0].replace("UNIT", "rpm"))[1:]) == 0
    got = import_file(shlex.split(step)[shlex.split(step).index("--out") + 1])
    sign = -1.0 if "sign" in told else 1.0
    assert np.allclose(got["thrust_N"], sign * 12e-3 * 9.80665 * np.arange(3, 11) ** 2) and got["rpm"][-1] == 10000.0


@pytest.mark.parametrize("heading", ["scale grams", "Scale (g)", "Waage [g]"])
def test_a_kitchen_scale_is_a_thrust_and_without_a_speed_what_works_is_named(
    heading: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"{10 * k},{15 * k},{12 * k * k}\n" for k in range(2, 9))
    file = tmp_path / "kitchen.csv"
    file.write_text(f"throttle %,watts,{heading}\n{rows}", encoding="utf-8")
    assert np.allclose(import_file(file)["thrust_N"], 12e-3 * 9.80665 * np.arange(2, 9) ** 2)
    assert main(["diagnose", str(file), "--case", "10x5"]) == 2
    assert "`bemt compare A B` of two runs, at equal power" in capsys.readouterr().err


def test_a_measured_propeller_is_said_to_be_fitted_to_its_measurement(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "APC 10x5E", "--rpm", "6000"]) == 0
    assert "fitted to its measurement in the UIUC" in capsys.readouterr().out


@pytest.mark.parametrize("speed", ["", ";rpm"])
def test_two_propellers_in_one_file_are_compared_by_the_rows_of_each(
    speed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = [(50, 376, "HQ 5x4"), (75, 730, "HQ 5x4"), (100, 1148, "HQ 5x4"),
            (50, 323, "Gemfan"), (75, 640, "Gemfan"), (100, 996, "Gemfan")]  # fmt: skip
    lines = [f"{t};{g};{name}" + (f";{90 * t}" if speed else "") for t, g, name in rows]
    Path("my both.csv").write_text("\n".join([f"Throttle %;Thrust (g);Prop{speed}", *lines]) + "\n")
    step = "bemt compare 'my both.csv' 'my both.csv' --rows-a 'Prop=HQ 5x4' --rows-b Prop=Gemfan"
    assert main(["import", "my both.csv"]) == 0
    assert f"Next: {step}" in capsys.readouterr().out
    assert main(["compare", "my both.csv"]) == 2
    assert step in capsys.readouterr().err
    assert main(shlex.split(step)[1:]) in (0, 1)
    assert "thrust -1" in capsys.readouterr().out.splitlines()[0]

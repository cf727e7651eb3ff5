"""Recordings of stands: read whole, or refused with the reason; nothing vanishes in silence."""

from __future__ import annotations

import gzip
import random
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt.base import units
from bemt.base.errors import InputError
from bemt.base.units import G0
from bemt.data import readers as importers
from bemt.data.readers import _large, generic_csv, rcbenchmark
from bemt.data.readers.headings import heading, surely_shaft_speed
from bemt.data.readers.split import NO_VALUE
from bemt.data.recordings.channels import named
from bemt.data.recordings.check import check
from bemt.data.recordings.load import import_file
from bemt.data.recordings.reduce import reduce, reduction
from bemt.physics.dataset import Dataset

RC_HEAD = (
    "Time (s),ESC signal (µs),Servo 1 (µs),AccX (g),Torque (N·m),Thrust (gf),Voltage (V),Current (A),"
    "Motor Electrical Speed (RPM),Motor Optical Speed (RPM),Electrical Power (W),Mechanical Power (W),"
    "Motor Efficiency (%),Overall Efficiency (gf/W),App message,"
)


def rc_text(rows: int = 30, optical: float = 0.0, force: str = "gf", torque: float = 1.0, step_s: float = 3.5) -> str:
    """Step test of a made-up propeller."""
    out = [RC_HEAD.replace("Thrust (gf)", f"Thrust ({force})")]
    for k in range(rows):
        rpm = 3000.0 + 400.0 * k
        newton = 4e-8 * rpm**2
        moment = torque * 6e-10 * rpm**2
        shaft = abs(moment) * rpm * units.RPM
        thrust = newton / units.UNITS[force].factor
        cells = [k * step_s, 1100 + 25 * k, "", 0.01, moment, thrust, 11.0, shaft / 0.7 / 11.0, rpm, rpm * optical,
                 shaft / 0.7, shaft, 70.0, thrust / (shaft / 0.7), "", ""]  # fmt: skip
        out.append(",".join(c if isinstance(c, str) else f"{c:.10g}" for c in cells))
    return "\ufeff" + "\n".join(out) + "\n"


def table_text(rows: int = 9) -> str:
    """Table in the form of the thrust_tool stand."""
    out = ["out,th,th_err,tq,tq_err,rpm,rpm_err,v,v_err,a,a_err,pin,theff"]
    for k in range(rows):
        rpm = 4000.0 + 1000.0 * k
        th, v, a = 4.0e-6 * rpm**2, 12.0 - 0.1 * k, 0.5 + 0.8 * k
        cells = [20.0 + 10 * k, th, 0.5, 5e-6 * rpm**2, 1.0, rpm, 20.0, v, 0.004, a, 0.03, v * a, th / (v * a)]
        out.append(",".join(f"{c:.6g}" for c in cells))
    return "\n".join(out) + "\n"


def raw_text(rows: int = 40, pairs: float = 7.0) -> str:
    """Raw record of the same stand."""
    out = ["Motor Output,Strain Gauge Thrust,ESCT RPM,Motor Level [%],Thrust [G],Torque [G cm],RPM [1/min],Vref"]
    for k in range(rows):
        level = 1200 if k < rows // 2 else 1400
        esc = (400 if level == 1200 else 600) + k % 3
        rpm = esc * 100.0 / pairs
        thrust = 2.5e-6 * rpm**2
        out.append(f"{level},{71000 + k},{esc},{(level - 1000) / 10},{thrust:.6g},{1.5 * thrust:.6g},{rpm:.7g},2530")
    return "\n".join(out) + "\n"


def plain_text(mark: str = ",", rows: int = 12) -> str:
    out = [mark.join(["time_s", "Thrust (gf)", "Q(Nm)", "RPM", "note", "omega"])]
    for k in range(rows):
        cells = [f"{0.1 * k:.3f}", f"{50.0 + k:.2f}", f"{0.01 + 0.001 * k:.4f}", f"{3000 + 10 * k}", "ok", f"{314 + k}"]
        out.append(mark.join(cells))
    return "\n".join(out) + "\n"


def bare_text(rows: int = 10) -> str:
    return "".join(f"{1100 + 50 * k} {0.01 * k:.4f} {0.5 * k:.4f} {1000 + 200 * k}\n" for k in range(rows))


Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def put(text: str | bytes, name: str = "run.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return put


def said(imported: Dataset, words: str) -> list[str]:
    return [text for text in imported.notes if words in text]


# ---------------------------------------------------------------- headings and units


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("Thrust (gf)", "thrust_N", "N"), ("Thrust (N)", "thrust_N", "N"), ("Thrust [lbf]", "thrust_N", "N"),
        ("Torque (N·m)", "torque_Nm", "Nm"), ("Torque (lbf·in)", "torque_Nm", "Nm"), ("T(gf)", "T_N", "N"),
        ("ESC signal (µs)", "pulse_width_s", "s"), ("ESC signal (μs)", "pulse_width_s", "s"), ("RPM", "rpm", "rpm"),
        ("Motor Electrical Speed (RPM)", "electrical_rpm", "rpm"), ("eRPM", "electrical_rpm", "rpm"),
        ("Motor Optical Speed (RPM)", "optical_rpm", "rpm"), ("RPM_B", "B_rpm", "rpm"), ("rpm_A", "A_rpm", "rpm"),
        ("beta_deg", "beta_rad", "rad"), ("temp_C", "temperature_K", "K"), ("airspeed_m_s", "airspeed_m_s", "m_s"),
        ("Airspeed (km/h)", "airspeed_m_s", "m_s"), ("Motor Efficiency (%)", "motor_efficiency", "-"), ("J", "J", "-"),
        ("Overall Efficiency (gf/W)", "overall_efficiency_N_W", "N/W"), ("CT_total=T/(rho n2 D4)", "CT_total", "-"),
        ("CT(rotor convention T/(rho A (Omega R)^2))", "CT_rotor", "-"), ("chord_mm(D=240mm)", "chord_m", "m"),
        ("AccX (g)", "acceleration_x_m_s2", "m/s2"), ("motor_weight_g", "motor_weight_kg", "kg"),
        ("Motor Optical Speed (rad/s)", "optical_rpm", "rpm"), ("n_rad_s", "n_rad_s", "rad_s"),
        ("omega", "omega", ""), ("Thrust", "Thrust", ""), ("x", "x", ""), ("Speed (Hz)", "Speed_Hz", ""),
        ("thrust_A", "thrust_A", ""), ("T_A", "T_A", ""), ("I_A", "I_A", "A"), ("P_in", "P_m", "m"),
    ],
)  # fmt: skip
def test_a_heading_says_name_and_unit(text: str, name: str, unit: str) -> None:
    got = heading(text)
    assert (got.name, got.unit_name) == (name, unit)


@pytest.mark.parametrize(("text", "factor"), [("u_temp_C", 1.0), ("u_temp (F)", 5.0 / 9.0), ("u_temp_K", 1.0)])
def test_an_uncertainty_of_a_temperature_is_a_difference(text: str, factor: float) -> None:
    got = heading(text)
    assert got.name == "u_temp_K" and got.unit is not None
    assert (got.unit.factor, got.unit.offset) == (pytest.approx(factor), 0.0)
    assert heading("temp_C").unit.offset == pytest.approx(273.15)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("Thrust force [N]", "thrust_N", "N"), ("Static Thrust (lbf)", "thrust_N", "N"),
        ("F_thrust [gf]", "thrust_N", "N"), ("mean thrust [N]", "thrust_N", "N"),
        ("Propeller Torque (mNm)", "torque_Nm", "Nm"),
        ("Torque (in-lb)", "torque_Nm", "Nm"), ("Torque [oz-in]", "torque_Nm", "Nm"),
        ("RPM Upper", "upper_rpm", "rpm"),
        ("Total Thrust [N]", "total_thrust_N", "N"), ("Thrust Upper (N)", "thrust_upper_N", "N"),
    ],
)  # fmt: skip
def test_words_beside_thrust_and_torque_change_nothing(text: str, name: str, unit: str) -> None:
    """Tables of theses qualify their headings; a total of several rotors is another quantity."""
    got = heading(text)
    assert (got.name, got.unit_name) == (name, unit)


@pytest.mark.parametrize(
    ("text", "force"),
    [("Thrust (kg)", 9.80665), ("load_g", 9.80665e-3), ("Thrust (lb)", 4.4482216), ("T [G]", 9.80665e-3),
     ("Load cell [oz]", 0.27801385), ("Propeller thrust kg", 9.80665), ("F (kg)", 9.80665), ("thrust_lb", 4.4482216)],
)  # fmt: skip
def test_a_mass_in_a_column_of_thrust_is_what_it_weighs(text: str, force: float, write: Write) -> None:
    got = importers.read(write(f"Time (s),{text},RPM\n" + "".join(f"{k},{k + 1},{3000 + k}\n" for k in range(5))))
    thrust = named(got)["thrust_N"]
    assert np.allclose(thrust, force * np.arange(1.0, 6.0), rtol=1e-7) and said(got, "-force")


@pytest.mark.parametrize(
    ("text", "cell", "channel", "value"),
    [
        ("kRPM", "5", "rpm", 5000.0), ("RPM x1000", "5", "rpm", 5000.0), ("rpm (k)", "5", "rpm", 5000.0),
        ("Speed [1000 rpm]", "5", "rpm", 5000.0), ("U/min", "5000", "rpm", 5000.0), ("1/min", "5000", "rpm", 5000.0),
        ("rpm [ rev min^-1 ]", "5000", "rpm", 5000.0), ("Prop RPM", "5000", "rpm", 5000.0),
        ("Motor RPM", "5000", "rpm", 5000.0), ("ESC RPM", "5000", "rpm", 5000.0),
        ("Rotation frequency (Hz)", "100", "rpm", 6000.0), ("omega (rad/s)", "100", "rpm", 954.9297),
        ("RPM (electrical)", "35000", "electrical_rpm", 35000.0), ("Optical RPM", "5000", "optical_rpm", 5000.0),
        ("Ambient temperature (C)", "15", "temperature_K", 288.15), ("Tamb [K]", "290", "temperature_K", 290.0),
        ("T_amb (°C)", "15", "temperature_K", 288.15), ("Air temp (F)", "59", "temperature_K", 288.15),
        ("OAT (C)", "15", "temperature_K", 288.15), ("Room temp. [degC]", "15", "temperature_K", 288.15),
        ("Umgebungstemperatur (°C)", "15", "temperature_K", 288.15), ("Baro (mbar)", "1013", "pressure_Pa", 101300.0),
        ("Ambient pressure (hPa)", "1013", "pressure_Pa", 101300.0), ("p_amb [Pa]", "101300", "pressure_Pa", 101300.0),
        ("Barometric pressure (inHg)", "29.92", "pressure_Pa", 101320.76),
        ("Atmospheric pressure [mmHg]", "760", "pressure_Pa", 101325.0),
        ("Air pressure (kPa)", "101.3", "pressure_Pa", 1.013e5),
        ("RH (%)", "45", "humidity", 0.45), ("Relative humidity [%]", "45", "humidity", 0.45),
        ("Air density (kg/m3)", "1.2", "density_kg_m3", 1.2), ("rho [kg/m^3]", "1.2", "density_kg_m3", 1.2),
        ("Torque (kg-cm)", "1", "torque_Nm", 0.0980665), ("Torque (g·cm)", "1000", "torque_Nm", 0.0980665),
        ("Throttle (%)", "50", "throttle", 0.5), ("PWM (us)", "1500", "pwm_s", 1.5e-3),
        ("Wind speed (km/h)", "36", "airspeed_m_s", 10.0), ("Pull (g)", "1000", "thrust_N", 9.80665),
    ],
)  # fmt: skip
def test_a_column_as_people_head_it_is_the_channel_in_si(
    text: str, cell: str, channel: str, value: float, write: Write
) -> None:
    got = named(importers.read(write(f"{text},x_A\n" + f"{cell},1\n" * 3)))
    assert np.allclose(got[channel], value, rtol=1e-5)


def test_a_pressure_reduced_to_sea_level_is_not_that_of_the_air(write: Write) -> None:
    got = importers.read(write("rpm,QNH (hPa)\n" + "5000,1013\n" * 3))
    assert "pressure_Pa" not in named(got) and said(got, "sea level")


def test_what_warms_within_a_run_is_a_part_and_not_the_air_of_a_cold_day(write: Write) -> None:
    rows = [(run, 5000 + k, 20.0 - 25.0 * run + 0.1 * k) for run in (0, 1) for k in range(8)]
    air = write("run,rpm,temperature_C,x_A\n" + "".join(f"{a},{b},{c},1\n" for a, b, c in rows))
    assert np.ptp(named(importers.read(air))["temperature_K"]) == pytest.approx(25.7)
    part = write("run,rpm,temperature_C,x_A\n" + "".join(f"0,{b},{20 + 30 * a},1\n" for a, b, _ in rows))
    assert "temperature_K" not in named(importers.read(part))


def _packed(folder: Path, form: str, rows: list[list[object]], more: int = 0) -> Path:
    """A table as gzip or as a workbook."""
    text = "\n".join(",".join(map(str, row)) for row in rows) + "\n"
    if form == "gz":
        (folder / "log.csv.gz").write_bytes(gzip.compress(text.encode()))
        return folder / "log.csv.gz"
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.create_sheet("notes").append(["calm day", "stand 2"])
    for k in range(more):
        sheet = book.create_sheet(f"run {k}")
        for row in rows:
            sheet.append(row)
    book.save(folder / "log.xlsx")
    return folder / "log.xlsx"


@pytest.mark.parametrize("form", ["gz", "xlsx"])
def test_a_packed_table_is_the_table(form: str, tmp_path: Path) -> None:
    rows: list[list[object]] = [["RPM", "Thrust (g)"], *([3000 + k, 100.5 + k] for k in range(6))]
    got = importers.read(_packed(tmp_path, form, rows))
    assert np.allclose(got["rpm"], 3000.0 + np.arange(6))
    assert np.allclose(got["thrust_N"], 9.80665e-3 * (100.5 + np.arange(6)))


def test_a_workbook_with_two_tables_is_not_guessed_at(tmp_path: Path) -> None:
    rows: list[list[object]] = [["RPM", "Thrust (g)"], *([3000 + k, 100.5 + k] for k in range(6))]
    with pytest.raises(InputError, match="run 0"):
        importers.read(_packed(tmp_path, "xlsx", rows, more=1))


def test_a_damaged_workbook_is_refused(tmp_path: Path) -> None:
    whole = _packed(tmp_path, "xlsx", [["RPM", "T (N)"], [1, 2.5], [2, 3.5]])
    (tmp_path / "cut.xlsx").write_bytes(whole.read_bytes()[:-200])
    with pytest.raises(InputError, match="damaged"):
        importers.read(tmp_path / "cut.xlsx")


@pytest.mark.parametrize("mark", ["#DIV/0!", "#N/A", "-", "#VALUE!"])
def test_what_a_spreadsheet_could_not_compute_is_an_empty_cell(mark: str, write: Write) -> None:
    cells = ["1.5", mark, mark, "2.5", mark, "3.5"]  # more than the share of odd cells that makes a column text
    got = importers.read(write("rpm,thrust_N\n" + "".join(f"{3000 + k},{c}\n" for k, c in enumerate(cells))))
    assert np.allclose(got["thrust_N"], [1.5, np.nan, np.nan, 2.5, np.nan, 3.5], equal_nan=True)
    assert mark == "-" or said(got, "3 cells")


def test_the_same_run_in_any_unit_is_the_same_thrust(write: Write) -> None:
    ways = [importers.read(write(rc_text(force=unit), f"{unit}.csv")) for unit in ("gf", "N", "kgf", "lbf", "ozf")]
    for way in ways[1:]:
        assert np.allclose(way["thrust_N"], ways[0]["thrust_N"], rtol=1e-9)


def test_one_quantity_in_two_units_that_disagree_is_reported(write: Write) -> None:
    rows = "".join(f"{k},{100 + k},{(100 + k) * 0.00980665 * slip}\n" for k in range(6) for slip in [1.0])
    assert not said(importers.read(write("time_s,T(gf),T(N)\n" + rows)), "times")
    rows = "".join(f"{k},{100 + k},{(100 + k) * 0.001}\n" for k in range(6))  # the second column is kgf, not N
    got = importers.read(write("time_s,T(gf),T(N)\n" + rows, "slip.csv"))
    (text,) = said(got, "times 'T(gf)'")
    assert "kgf <-> N" in text and "nothing was converted" in text


# ---------------------------------------------------------------- registry


def test_the_fallback_loses_against_every_particular_format(write: Write) -> None:
    for text, kind in ((rc_text(), "rcbenchmark"), (table_text(), "jmajew"), (raw_text(), "jmajew"),
                       (plain_text(), "table"), (plain_text("\t"), "table"), (bare_text(), "table")):  # fmt: skip
        path = write(text, f"{kind}.txt")
        assert importers.detect(path) == kind
    assert generic_csv.sniff(rc_text()) and generic_csv.sniff(table_text())  # it claims them too, and yields


@pytest.mark.parametrize("text", ["", "\n\n", "A text, with commas.\nNo numbers, here.\n", "a,b\n", "{}", "<xml/>"])
def test_what_is_no_table_is_refused(text: str, write: Write) -> None:
    with pytest.raises(InputError):
        importers.read(write(text))


def test_a_binary_file_is_refused_as_such(write: Write) -> None:
    with pytest.raises(InputError, match="a damaged zip archive or workbook.*save the sheet as CSV"):
        importers.read(write(b"PK\x03\x04\x00\x00\x00rest", "book.xlsx"))
    with pytest.raises(InputError, match="binary data.*Export the data as plain text"):
        importers.read(write(b"\x01\x02\x00\x00\x00rest", "log.bin"))


# ---------------------------------------------------------------- RCbenchmark


def test_a_step_test_is_read_whole(write: Write) -> None:
    got = rcbenchmark.read(write(rc_text()))
    assert (got.provenance["format"], got.kind, len(got)) == ("rcbenchmark", "bench", 30)
    assert got.provenance["mode"] == "steps" and len(got.provenance["sha256"]) == 64
    rpm = 3000.0 + 400.0 * np.arange(30)
    assert np.allclose(got["thrust_N"], 4e-8 * rpm**2)
    assert np.allclose(got["pulse_width_s"], (1100 + 25 * np.arange(30)) * 1e-6)
    assert got.lines == tuple(range(2, 32))
    assert said(got, "'Servo 1 (µs)'")  # an empty column is named


def test_the_two_speeds_are_kept_apart(write: Write) -> None:
    got = rcbenchmark.read(write(rc_text(optical=0.0)))
    assert "rpm" not in got.values
    assert said(got, "optical_rpm is 0 in every row")
    assert np.all(got["optical_rpm"] == 0.0)
    got = rcbenchmark.read(write(rc_text(optical=1 / 7), "poles.csv"))
    assert np.allclose(got["electrical_rpm"], 7 * got["optical_rpm"]) and said(got, "derived from the motor's phases")
    (ratio,) = [f for f in check(got) if f.id == "rpm_ratio"]
    assert ratio.severity == "error" and "7 pole pairs" in ratio.correction
    same = rcbenchmark.read(write(rc_text(optical=1.0), "same.csv"))
    assert not said(same, "motor's phases") and "rpm_ratio" not in {f.id for f in check(same)}


def test_rpm_zero_and_spikes_are_kept_and_flagged(write: Write) -> None:
    lines = rc_text().split("\n")
    column = RC_HEAD.split(",").index("Motor Electrical Speed (RPM)")

    def put(row: int, value: str) -> None:
        cells = lines[row + 1].split(",")
        cells[column] = value
        lines[row + 1] = ",".join(cells)

    put(0, "66434")  # a misreading in the first row, where neighbours cannot tell
    put(12, "0")
    put(20, "99999")
    got = rcbenchmark.read(write("\n".join(lines)))
    assert len(got) == 30
    assert {k: f for k, f in enumerate(got.flags) if f} == {
        0: ("spike of electrical_rpm",), 12: ("electrical_rpm is 0 under thrust",), 20: ("spike of electrical_rpm",),
    }  # fmt: skip
    assert got["electrical_rpm"][[0, 12, 20]].tolist() == [66434.0, 0.0, 99999.0]


@pytest.mark.parametrize(("times", "flagged"), [(2.0, False), (2.4, False), (2.7, True), (3.5, True)])
def test_a_first_speed_is_misread_where_its_thrust_needs_a_fraction_of_it(
    write: Write, times: float, flagged: bool
) -> None:
    """At the start of a ramp neighbours cannot tell: 2.5 times what the rest of the file needs for that thrust."""
    lines = rc_text().split("\n")
    cells = lines[1].split(",")
    cells[RC_HEAD.split(",").index("Motor Electrical Speed (RPM)")] = f"{3000.0 * times:g}"
    lines[1] = ",".join(cells)
    assert (rcbenchmark.read(write("\n".join(lines))).flags[0] == ("spike of electrical_rpm",)) == flagged


def test_a_flag_of_a_row_is_one_of_its_point(write: Write) -> None:
    """A spike that is kept says so in the table of points; what a reduction drops is not called kept."""
    lines = rc_text(4).split("\n")
    cells = lines[1].split(",")
    cells[RC_HEAD.split(",").index("Motor Electrical Speed (RPM)")] = "400000"
    lines[1] = ",".join(cells)
    got = rcbenchmark.read(write("\n".join(lines)))
    assert said(got, "spike of electrical_rpm in 1 row (line 2): flagged") and not said(got, "kept")
    points = reduce(got)
    assert points["rpm"][0] == 400000.0 and points.flags[0] == ("spike of electrical_rpm",)
    assert not any(points.flags[1:])


def test_a_stopped_motor_whose_load_cell_is_off_is_not_under_thrust(write: Write) -> None:
    column = {name: RC_HEAD.split(",").index(name) for name in ("Motor Electrical Speed (RPM)", "Current (A)")}
    lines = rc_text().split("\n")
    for row, ampere in ((12, None), (13, "0")):
        cells = lines[row + 1].split(",")
        cells[column["Motor Electrical Speed (RPM)"]] = "0"
        cells[column["Current (A)"]] = ampere or cells[column["Current (A)"]]
        lines[row + 1] = ",".join(cells)
    got = rcbenchmark.read(write("\n".join(lines)))
    assert got.flags[12] == ("electrical_rpm is 0 under thrust",) and got.flags[13] == ("electrical_rpm is 0",)


def test_a_motor_that_stops_under_command_is_said_once(write: Write) -> None:
    """Steps after which nothing turns, and a cell whose zero drifts: 0 is right there, and no load is a thrust."""
    names = ("Motor Electrical Speed (RPM)", "Current (A)", "Electrical Power (W)", "Torque (N·m)", "Thrust (gf)")
    lines = rc_text(12).rstrip("\n").split("\n")
    top = max(float(line.split(",")[RC_HEAD.split(",").index(names[-1])]) for line in lines[1:])
    for k in range(10, 13):
        cells = lines[k].split(",")
        for name, value in zip(names, (0.0, 0.001, 0.01, 0.0, 0.09 * top), strict=True):
            cells[RC_HEAD.split(",").index(name)] = f"{value:g}"
        lines[k] = ",".join(cells)
    got = rcbenchmark.read(write("\n".join(lines)))
    (flag,) = {f for flags in got.flags for f in flags}
    assert [len(f) for f in got.flags] == [0] * 9 + [1] * 3 and "stopped" in flag and "thrust" not in flag
    assert sum("electrical_rpm is 0" in w for w in got.notes) == 1


def test_signs_and_backward_time_are_reported_not_repaired(write: Write) -> None:
    text = rc_text(torque=-1.0).replace("\n3.5,", "\n-0.2,")
    got = rcbenchmark.read(write(text))
    assert ("sign_flipped", "torque_Nm") in {(f.id, f.channel) for f in check(got)} and np.all(got["torque_Nm"] < 0)
    assert got.flags[1] == ("time goes backwards",) and got["time_s"][1] == -0.2


def test_a_continuous_record_keeps_its_sparse_channels(write: Write) -> None:
    lines = rc_text(200, step_s=0.02).split("\n")
    for k in range(1, 201):
        if k % 5:
            cells = lines[k].split(",")
            cells[4] = cells[5] = ""
            lines[k] = ",".join(cells)
    got = rcbenchmark.read(write("\n".join(lines)))
    assert got.provenance["mode"] == "continuous" and len(got) == 200
    assert np.count_nonzero(np.isfinite(got["thrust_N"])) == 40
    assert np.count_nonzero(np.isfinite(got["electrical_rpm"])) == 200


# ---------------------------------------------------------------- thrust_tool


def test_tables_carry_their_stated_errors(write: Write) -> None:
    got = importers.read(write(table_text(), "grp01__motor1_prop-9x7_4s_duct_table2.csv"))
    assert len(got) == 9 and got.unit("thrust_err_N") == "N"
    assert np.allclose(got["thrust_err_N"], 0.5 * units.KGF * 1e-3)
    assert np.allclose(got["torque_Nm"], 5e-11 * units.KGF * got["rpm"] ** 2, rtol=1e-5)
    assert got.provenance["propeller"] == "prop-9x7" and got.provenance["duct"] == "yes"
    assert got.provenance["battery_cells"] == "4" and not got.notes


def test_units_that_the_table_contradicts_are_doubted(write: Write) -> None:
    lines = table_text().split("\n")
    milli = [",".join([*c[:9], f"{float(c[9]) * 1000:g}", *c[10:]]) for c in (t.split(",") for t in lines[1:-1])]
    found = check(importers.read(write("\n".join([lines[0], *milli]) + "\n")))  # current in mA
    (slip,) = [f for f in found if f.id == "current_unit"]
    assert slip.severity == "error" and "electrical power over voltage x current is 0.001, must be 1" in slip.evidence
    assert slip.correction.startswith("current_A: mA taken for A: multiply by 0.001")
    theff = [",".join([*c[:12], f"{float(c[12]) / 9.80665:g}"]) for c in (t.split(",") for t in lines[1:-1])]
    found = check(importers.read(write("\n".join([lines[0], *theff]) + "\n", "b.csv")))  # efficacy in another unit
    assert any(f.severity == "error" and "thrust over (efficacy x electrical power)" in f.evidence for f in found)


def test_rpm_of_the_raw_record_is_traced_to_telemetry(write: Write) -> None:
    got = importers.read(write(raw_text()))
    assert got.provenance["form"] == "raw" and said(got, "over 7 pole pairs, not a separate sensor")
    assert got.unit("Strain_Gauge_Thrust") == "" and got.unit("ESCT_RPM") == ""
    assert not said(importers.read(write(raw_text().replace(",600,", ",500,"), "b.csv")), "telemetry of")


# ---------------------------------------------------------------- any table


@pytest.mark.parametrize("mark", [",", ";", "\t", "|"])
def test_any_delimiter_gives_the_same_table(mark: str, write: Write) -> None:
    got = importers.read(write(plain_text(mark)))
    assert list(got.values) == ["time_s", "thrust_N", "Q_Nm", "rpm", "omega"] and got.kind == "bench"
    assert np.allclose(got["thrust_N"], (50.0 + np.arange(12)) * units.KGF * 1e-3)
    assert got.unit("omega") == "" and said(got, "'omega'") and got.texts["note"] == ("ok",) * 12


def test_a_table_without_headings_has_no_units(write: Write) -> None:
    got = importers.read(write(bare_text()))
    assert len(got) == 10 and [got.unit(k) for k in got.values] == [""] * 4
    assert said(got, "no heading line") and said(got, "no unit known, none assumed")


def test_a_line_of_units_below_the_headings_counts(write: Write) -> None:
    rows = "".join(f"{k},{k},{2 * k},{300 + k}\n" for k in range(9))
    got = importers.read(write("Time,Thrust,Torque,Speed\n(s),(kgf),Nm,rad/s\n" + rows))
    assert [got.unit(k) for k in got.values] == ["s", "N", "Nm", "rad_s"] and len(got) == 9
    assert np.allclose(got["thrust_N"], units.KGF * np.arange(9)) and said(got, "line 2 holds units")


def test_units_inside_cells_count_where_all_are_the_same(write: Write) -> None:
    got = importers.read(write("time_s,U,Gas\n" + "".join(f"{k},{11 + k / 10} V,{10 * k}%\n" for k in range(5))))
    assert named(got)["voltage_V"][2] == 11.2 and said(got, "its cells say the unit, V")
    assert got["throttle"].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    got = importers.read(
        write("time_s,U\n" + "".join(f"{k},{11 + k / 10} {'V' if k % 2 else 'mV'}\n" for k in range(5)))
    )
    assert "U" in got.texts and said(got, "has units in its cells ('11.0 mV')")


def test_decimal_commas_are_read_where_they_can_be_nothing_else(write: Write) -> None:
    points = importers.read(write(plain_text(";")))
    commas = importers.read(write(plain_text(";").replace(".", ",")))
    assert said(commas, "decimal commas read as decimal points") and not said(points, "decimal commas")
    assert all(np.array_equal(commas[k], v) for k, v in points.values.items())


def test_decimal_commas_in_quotes_are_read_and_one_point_among_them_is_named(write: Write) -> None:
    rows = [("3504", "3,517"), ("4511", "5,910"), ("5500", "8,825"), ("6500", "12,40"), ("7000", "14,38")]
    quoted = "\n".join(['"rpm","thrust [N]"', *(f'"{n}","{T}"' for n, T in rows)])
    assert importers.read(write(quoted))["thrust_N"].tolist() == [3.517, 5.91, 8.825, 12.4, 14.38]
    with pytest.raises(InputError, match="'8.825' at 4:2 among decimal commas"):
        importers.read(write(quoted.replace("8,825", "8.825")))


def test_a_temperature_and_a_pressure_are_headed_as_a_thrust_is() -> None:
    names = ("thrust N", "temp C", "pressure hPa", "thrust C", "current A")
    assert [heading(name).unit_name for name in names] == ["N", "K", "Pa", "", ""]


def test_doubtful_commas_are_refused_with_a_hint(write: Write) -> None:
    text = plain_text(";").replace(".", ",").replace("ok", "0.5")  # a number with a point beside them
    with pytest.raises(InputError, match='State decimal = ","') as caught:
        importers.read(write(text))
    assert len(caught.value.faults) == 3  # one per column, all at once


def test_a_bad_cell_is_named_and_kept_as_nan(write: Write) -> None:
    got = importers.read(write(plain_text(rows=40).replace("3050", "3O50")))
    assert len(got) == 40 and np.isnan(got["rpm"][5]) and got.flags[5] == ("rpm: no number",)
    assert said(got, "'3O50' at 7:4")


def test_lines_of_another_length_are_all_refused(write: Write) -> None:
    lines = plain_text().split("\n")
    lines[3] += ",7"
    lines[6] = lines[6].rsplit(",", 2)[0]
    with pytest.raises(InputError) as caught:
        importers.read(write("\n".join(lines)))
    assert [fault.where for fault in caught.value.faults] == ["4", "7"]


def test_a_last_line_that_was_cut_is_kept_and_flagged(write: Write) -> None:
    got = importers.read(write(plain_text()[:-18]))
    assert len(got) == 12 and got.flags[-1][0] == "line cut off at the end of the file"
    assert np.isfinite(got["time_s"][-1]) and np.isnan(got["omega"][-1])


# ---------------------------------------------------------------- mutations

BASES: dict[str, str] = {
    "steps.csv": rc_text(12), "continuous.csv": rc_text(25, optical=1.0, step_s=0.02), "table.csv": table_text(),
    "raw.csv": raw_text(20), "plain.csv": plain_text(), "semicolon.csv": plain_text(";"), "bare.txt": bare_text(),
    "geometry.txt": "r/R c/R twist_deg\n" + "".join(f"0.{k} 0.1 {30 - k}\n" for k in range(2, 9)),
}  # fmt: skip
GARBAGE = [
    "nan", "inf", "-inf", "1e999", "1,5", "--", "#", '"', "\x00", "é", "\ufeff", "\u2028", "\x1c", "\r", "=", "]",
    "1_000", "0x10", "٣", "9" * 400, "-", "+", ";", "\t", "|", "%", "(", "kg", " ", "", "\n", "1.2.3",
]  # fmt: skip


def mutate(text: str, rng: random.Random) -> bytes:
    """One to four random injuries of a text, at last of its bytes."""
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text) + 1)
        lines = text.split("\n")
        row = rng.randrange(len(lines))
        match rng.randrange(9):
            case 0:
                text = text[:at] + rng.choice(GARBAGE) + text[at:]
            case 1:
                text = text[:at] + text[at + rng.randint(1, 30) :]
            case 2:
                text = text[:at]
            case 3:
                lines.insert(rng.randrange(len(lines) + 1), lines[row])
                text = "\n".join(lines)
            case 4:
                del lines[row]
                text = "\n".join(lines)
            case 5:
                cells = lines[row].split(",")
                cells[rng.randrange(len(cells))] = rng.choice(GARBAGE)
                lines[row] = ",".join(cells)
                text = "\n".join(lines)
            case 6:
                other = rng.choice([",", ";", "\t", "\r\n", " ", "."])
                text = text.replace(rng.choice(",;.\n \t"), other, rng.choice([1, -1]))
            case 7:
                lines[row] = "".join(rng.sample(lines[row], len(lines[row])))
                text = "\n".join(lines)
            case _:
                text = text[:at] + "".join(rng.choice('0123456789.,eE-+nN "') for _ in range(5)) + text[at:]
    raw = text.encode("utf-8", "surrogatepass")
    if rng.random() < 0.1 and raw:
        at = rng.randrange(len(raw))
        raw = raw[:at] + bytes([rng.randrange(256)]) + raw[at + 1 :]
    return raw


COMMENT = re.compile(r"\s*[#%](?!\s*[,;|])")  # "%;1/min;N" holds units


def unexplained(imported: Dataset, raw: bytes) -> list[str]:
    """What a table lost without a word: lines that are no row, and cells that are neither number, text nor flag."""
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    used = [k for k, t in enumerate(lines, 1) if t.strip() and not COMMENT.match(t)]
    lost = []
    bare = [k for k in used if not lines[k - 1].strip(" \t;,|")]
    if bare and not any(re.match(rf"{len(bare)} lines? of empty cells", t) for t in imported.notes):
        lost.append("lines of empty cells")
    used = [k for k in used if k not in bare]
    if any(re.search(r"lines? above the headings", t) for t in imported.notes):  # they have fewer cells than the rows
        mark = max(",;\t", key=lines[imported.lines[0] - 1].count)
        first = next(k for k in used if lines[k - 1].count(mark) >= lines[imported.lines[0] - 1].count(mark))
        used = [k for k in used if k >= first]
    in_a_comment = any("headings are the comment" in t for t in imported.notes)
    without_heading = in_a_comment or any("no heading line" in t for t in imported.notes)
    expected = used if without_heading else used[1:]
    if any("holds units" in t for t in imported.notes):
        del expected[0]
    out = sum(int(n) for t in imported.notes for n in re.findall(r"(\d+) lines? left out", t))
    if out and len(imported.lines) == len(expected) - out:
        expected = [k for k in expected if k in set(imported.lines)]
    if list(imported.lines) != expected:
        lost.append(f"lines {expected} became rows {list(imported.lines)}")
    comments = sum(bool(COMMENT.match(t)) for t in lines) - in_a_comment
    if comments and not any(f"{comments} comment lines" in text for text in imported.notes):
        lost.append("comments")
    for name, values in imported.values.items():
        empty = np.isnan(values)
        for row in np.flatnonzero(empty):
            line = lines[imported.lines[row] - 1]
            cells = [] if '"' in line else line.split(",")
            junk = [c for c in cells if c.strip() and c.strip().lower() not in NO_VALUE and importers.number(c) is None]
            if junk and not imported.flags[row] and not imported.texts and "," in lines[0]:
                lost.append(f"{name}: row {row} {junk}")
    if any(np.any(np.isinf(v)) for v in imported.values.values()):
        lost.append("infinite values")
    return lost


def try_mutated(count: int, seed: int, folder: Path, bases: dict[str, str]) -> Counter[str]:
    rng = random.Random(seed)
    outcome: Counter[str] = Counter()
    for k in range(count):
        name = rng.choice(sorted(bases))
        raw = mutate(bases[name], rng)
        path = folder / name
        path.write_bytes(raw)
        try:
            got: Any = importers.read(path)
        except InputError as error:
            assert error.faults and all(f.file and f.got and f.expected for f in error.faults), (k, raw)
            outcome["refused"] += 1
            continue
        outcome[type(got).__name__] += 1
        if isinstance(got, Dataset) and got.provenance["format"] in ("rcbenchmark", "jmajew", "table"):
            assert not unexplained(got, raw), (k, raw)
            assert set(got.values) | set(got.texts) and len(got.flags) == len(got)
            outcome["warned"] += bool(got.notes)
    return outcome


def test_mutated_recordings_are_read_or_refused(tmp_path: Path) -> None:
    outcome = try_mutated(400, 4, tmp_path, BASES)
    assert outcome["refused"] + outcome["Dataset"] >= 390  # others look like UIUC tables after their injuries
    assert min(outcome["refused"], outcome["Dataset"]) > 50  # both ends are reached


@pytest.mark.slow
def test_ten_thousand_mutated_recordings(tmp_path: Path, shared_data: Path) -> None:
    real = dict(BASES)
    folders = ("rcbenchmark", "jmajew", "thrust_map", "thrust_step", "mit_copter_rcbenchmark", "tmotor28_tr594", "x22a")
    for folder in folders:
        for file in sorted((shared_data / folder).rglob("*")):
            if file.is_file() and file.stat().st_size < 20_000 and b"\0" not in file.read_bytes():
                real[f"{folder}-{file.name}"] = file.read_text(encoding="utf-8-sig")
    outcome = try_mutated(10_000, 5, tmp_path, real)
    assert min(outcome["refused"], outcome["Dataset"]) > 1000


# ---------------------------------------------------------------- published recordings

# folder: (imported, refused); what is refused there is text, a book of cells, a list of files, or has no rpm
COUNTS = {
    "apc": (22, 0), "caradonna_tung": (1, 0), "drivecalc": (2, 0), "ducted_marine": (4, 0),
    "flowunsteady_apc10x7": (5, 3), "jmajew": (58, 0), "mit_copter_rcbenchmark": (2, 1), "motocalc_edf": (3, 0),
    "rcbenchmark": (19, 2), "thrust_map": (2, 0), "thrust_step": (2, 0), "tmotor28_tr594": (2, 4), "uiuc": (999, 0),
    "x22a": (3, 0),
}  # fmt: skip


@pytest.mark.parametrize("folder", sorted(COUNTS))
def test_every_published_file_is_imported_or_refused_with_the_reason(folder: str, shared_data: Path) -> None:
    if not (shared_data / folder).is_dir():
        pytest.skip(f"no folder {folder} in the reference data")
    read = refused = 0
    for file in sorted((shared_data / folder).rglob("*")):
        if not file.is_file():
            continue
        try:
            got = importers.read(file)
        except InputError as error:
            assert all(f.got and f.expected for f in error.faults), file
            refused += 1
            continue
        read += 1
        if isinstance(got, Dataset) and got.provenance["format"] in ("rcbenchmark", "jmajew", "table"):
            assert not unexplained(got, file.read_bytes()), file
            for name in got.values:
                label = got.provenance["headings"].get(name, "") or name.replace("_", " ")
                assert got.unit(name) or said(got, "no unit known, none assumed"), (file, name, label)
    assert (read, refused) == COUNTS[folder]


def test_the_published_logs_show_their_known_faults(shared_data: Path) -> None:
    logs = [importers.read(f) for f in sorted((shared_data / "rcbenchmark").glob("*.csv"))]
    assert all(said(log, "optical_rpm is 0 in every row") for log in logs)  # no probe was used at all
    rpm = np.concatenate([log["electrical_rpm"] for log in logs])
    flags = [f for log in logs for f in log.flags]
    assert {rpm[k] for k, f in enumerate(flags) if "spike of electrical_rpm" in f} >= {61525.0, 66434.0}
    assert all(any("is 0" in w for w in flags[k]) for k in np.flatnonzero(rpm == 0.0))
    raw = importers.read(shared_data / "jmajew" / "raw" / "curr_cal.csv")
    assert said(raw, "over 7 pole pairs, not a separate sensor")
    assert [k for k, f in enumerate(raw.flags) if "spike of torque_Nm" in f] == [831]


GRAMS = ["Thrust (g)", "thrust_g", "Schub_g", "Thrust g", "thrust [g]", "Schub (g)", "Poussée (g)", "Empuje [g]",
         "Motor thrust (grams)"]  # fmt: skip


@pytest.mark.parametrize("text", GRAMS)
def test_grams_of_thrust_are_gram_force_and_said_to_be(text: str, write: Write) -> None:
    got = importers.read(write(f"RPM,{text}\n" + "".join(f"{3000 + k},{k + 1}\n" for k in range(5))))
    name = next(n for n in got.values if n.endswith("thrust_N"))
    assert np.allclose(got[name], 9.80665e-3 * np.arange(1.0, 6.0))
    assert said(got, "gram-force")


@pytest.mark.parametrize(
    "heads",
    ["Drehzahl [1/min];Schub [N];Drehmoment [Nm];Spannung [V];Strom [A]",
     "Régime (tr/min);Poussée (N);Couple (N.m);Tension (V);Courant (A)",
     "Velocidad (rpm);Empuje (N);Par (Nm);Tensión (V);Corriente (A)"],
)  # fmt: skip
def test_stands_speak_german_french_and_spanish(heads: str, write: Write) -> None:
    got = importers.read(write(f"{heads}\n4000;3,1;0,04;11,8;2,1\n6000;7,2;0,09;11,6;6,1\n"))
    assert list(got.values) == ["rpm", "thrust_N", "torque_Nm", "voltage_V", "current_A"]
    assert got["thrust_N"].tolist() == [3.1, 7.2]


def test_power_that_is_volts_times_amps_is_electrical(write: Write) -> None:
    rows = "4000,3.1,24.78,11.8,2.1\n6000,7.2,70.76,11.6,6.1\n8000,12.6,158.2,11.3,14.0\n"
    got = importers.read(write(f"rpm,thrust_N,power_W,voltage_V,current_A\n{rows}"))
    assert "electrical_power_W" in got.values and "power_W" not in got.values and said(got, "electrical power")
    shaft = importers.read(write("rpm,power_W,voltage_V,current_A\n4000,18,11.8,2.1\n6000,54,11.6,6.1\n", "b.csv"))
    assert "power_W" in shaft.values


def test_several_set_ups_in_one_file_are_said_and_not_diagnosed_together(write: Write, project: Path) -> None:
    from bemt.judge.diagnose.load import load
    from bemt.rotors.case import load_case

    rows = "".join(f"{name},{rpm},{rpm / 1000}\n" for name in ("APC 10x5", "APC 11x5.5") for rpm in (4000, 6000, 8000))
    file = write(f"Propeller,rpm,thrust_N\n{rows}")
    assert said(importers.read(file), "2 set-ups in one file")
    with pytest.raises(InputError, match="one propeller with one motor"):
        load(str(file), load_case(project / "cases" / "prop_10x5"))


def test_a_heading_that_is_not_understood_gets_its_nearest_meaning_and_the_line_to_write(write: Write) -> None:
    got = importers.read(write("rpm,Trust,wibble\n4000,3,1\n6000,7,2\n"))
    assert said(got, "'Trust' thrust") and said(got, '[columns] thrust = { column = "Trust", unit = "..." }')
    line = '[recording]\nfile = "t.csv"\n[columns]\nthrust = { column = "Trust", unit = "..." }\n'
    with pytest.raises(InputError, match="gf"):  # followed to the letter, it asks for the unit
        importers.read(write(line, "r.toml"))


@pytest.mark.parametrize(("more", "lines"), [
    ("", ("'speed' rpm or airspeed", 'rpm = { column = "speed", unit = "..." }',
          'airspeed = { column = "speed", unit = "..." }')),
    ("airspeed_m_s", ("'speed' rpm.",)), ("rpm", ("'speed' airspeed.",)),
])  # fmt: skip
def test_a_bare_speed_is_offered_as_the_one_that_is_missing(more: str, lines: tuple[str, ...], write: Write) -> None:
    got = importers.read(write(f"speed,thrust_N,{more or 'torque_Nm'}\n400,3,4000\n600,7,6000\n"))
    assert all(said(got, line) for line in lines)


@pytest.mark.parametrize(("heading", "cell", "words"), [
    ("speed", "{}", "a speed without a unit"), ("n (1/s)", "{}", "a speed without a unit"),
    ("speed", "{} wibble", "a speed as text"), ("rpm_12_magnets", "{}", "a speed under a name of its own"),
])  # fmt: skip
def test_a_speed_in_doubt_is_never_replaced_by_that_of_the_case(
    heading: str, cell: str, words: str, write: Write, project: Path
) -> None:
    from bemt.judge.diagnose.load import load
    from bemt.rotors.case import load_case

    rows = "".join(f"{cell.format(n)},{n * n / 1e5:.3f},{n * n / 4e6:.4f}\n" for n in range(500, 1500, 100))
    file, case = str(write(f"{heading},thrust_N,torque_Nm\n{rows}")), load_case(project / "cases" / "prop_10x5")
    with pytest.raises(InputError) as caught:
        load(file, case)
    (fault,) = caught.value.faults
    assert fault.file == file and fault.where == f"column {heading}" and fault.got.startswith(words)
    if words == "a speed without a unit" and surely_shaft_speed(heading):  # ten readings that lack their unit alone
        with pytest.raises(InputError, match="one source of the speed"):
            load(file, case, rpm=6000.0)
    else:
        assert load(file, case, rpm=6000.0).rpm.tolist() == [6000.0] * 10, "stated, it is no guess"


@pytest.mark.parametrize("head", [
    "value_N_or_Nm", "reading_ozf_or_ozf_in", "load (N or Nm)", "load [gf or N]",
    "thrust_N_or_gf", "speed rpm or rad_s",
    "thrust_N_or_torque_Nm",
])  # fmt: skip
def test_a_heading_with_two_units_has_none(head: str, write: Write) -> None:
    got = importers.read(write(f"rpm,{head}\n4000,3\n6000,7\n"))
    (name,) = set(got.values) - {"rpm"}
    assert got.unit(name) == "" and got[name].tolist() == [3.0, 7.0]
    assert said(got, repr(head)) and said(got, "one column holds one unit")


def test_a_recording_toml_that_is_there_is_the_file_to_give(write: Write, project: Path) -> None:
    from bemt.judge.diagnose.load import load
    from bemt.rotors.case import load_case

    file = write("speed,thrust_N,torque_Nm\n400,3,0.04\n600,7,0.09\n800,12,0.16\n")
    told = file.with_name("recording.toml")
    told.write_text(f'[recording]\nfile = "{file.name}"\n[columns]\nrpm = {{ column = "speed", unit = "rad_s" }}\n')
    case = load_case(project / "cases" / "prop_10x5")
    for given in (file, file.parent):
        with pytest.raises(InputError, match=f"(?i)give ({re.escape(told.as_posix())}|that instead)") as caught:
            load(str(given), case)
        assert told.as_posix() in str(caught.value)
    assert load(str(told), case).rpm[0] == pytest.approx(400 / units.RPM)


def test_a_speed_under_a_name_of_its_own_comes_with_the_line_to_write(write: Write) -> None:
    got = importers.read(write("rpm_12_magnets,thrust_N\n4000,1\n8000,4\n"))
    assert said(got, '[columns] rpm = { column = "rpm_12_magnets", unit = "rpm" }')
    for known in ("rpm", "rpm_A,rpm_B"):
        text = f"{known},thrust_N\n" + "".join(
            f"{','.join([n] * (known.count(',') + 1))},1\n" for n in ("4000", "8000")
        )
        assert not said(importers.read(write(text, "b.csv")), "speed of the rotor")


def test_electrical_rpm_is_asked_about_only_where_the_numbers_leave_doubt(write: Write) -> None:
    text = "rpm,thrust_N\n{},1\n{},4\n"
    slow, fast = (importers.read(write(text.format(top / 2, top), f"{top}.csv")) for top in (9000, 60000))
    assert not said(slow, "electrical") and said(fast, "electrical")


def _with_odd_cells(text: str, mark: str = ",") -> str:
    """A word, an empty cell, a number in quotes and one without end, each in a row of its own."""
    lines = [line.split(mark) for line in text.splitlines()]
    for row, column, cell in ((60, 1, "ERR"), (75, 2, ""), (90, 3, '"1.25"'), (130, 1, "inf"), (150, 2, "n/a")):
        lines[row][column] = cell
    return "\n".join(mark.join(cells) for cells in lines) + "\n"


def _log(mark: str = ",", rows: int = 300) -> str:
    columns = (
        (f"{0.01 * k:.2f}", f"{3000 + k * 7 % 13}", f"{0.5 + k * 5 % 11 / 100}", f"0.0{k % 9}") for k in range(rows)
    )
    heads = mark.join(["time_s", "rpm", "thrust_kgf", "Q_Nm" if mark == " " else "Q (Nm)"])
    return "\n".join([heads, *map(mark.join, columns)]) + "\n"


LARGE_LOGS = {
    "plain": _log(), "semicolons": _log(";"), "decimal commas": _log(";").replace(".", ","), "blanks": _log(" "),
    "tabs and a comment": "# stand 7\n" + _log("\t"), "windows": _log().replace("\n", "\r\n"),
    "odd cells": _with_odd_cells(_log()), "cut": _log()[:-9], "no end": _log()[:-1],
    "short line": _log() + "3.0,3000\n",
    "long line": _log().replace("\n1.00,", "\n9,1.00,"), "comment below": _log().replace("\n1.00,", "\n# x\n1.00,"),
    "empty line": _log().replace("\n1.00,", "\n\n1.00,"), "spaces": _log().replace(",", " , "),
    "heads above": "Stand 7\n3 May\n" + _log(), "units below": _log().replace("Q (Nm)\n", "Q\n(s),(rpm),(kgf),(Nm)\n"),
    "a column of words": _log().replace("\n", ",ok\n"), "late words": _log().replace("\n2.", "\nx2."),
}  # fmt: skip


CELL_BY_CELL = ("short line", "long line", "comment below", "empty line", "a column of words", "late words")


@pytest.mark.parametrize("name", LARGE_LOGS)
def test_a_large_log_reads_as_a_small_one(name: str, write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of a few lines, so that every kind of block is met."""
    path = write(LARGE_LOGS[name])

    def read() -> Dataset | str:
        try:
            return importers.read(path, "table")
        except InputError as error:
            return str(error)

    small = read()
    monkeypatch.setattr(_large, "LARGE", 0)
    monkeypatch.setattr(_large, "BLOCK", 700)
    monkeypatch.setattr(_large, "HEAD", 1000)
    assert (_large.large_table(path) is None) == (name in CELL_BY_CELL)
    large = read()
    if isinstance(small, str) or isinstance(large, str):
        assert large == small
        return
    assert list(large.values) == list(small.values) and large.notes == small.notes and large.flags == small.flags
    assert tuple(large.lines) == tuple(small.lines) and large.provenance == small.provenance
    for key, v in small.values.items():
        np.testing.assert_allclose(large[key], v, rtol=1e-14, err_msg=key)


def test_a_clock_may_count_from_1970(write: Write) -> None:
    body = "".join(f"{1.7e9 + 0.02 * k:.2f},{3000 + k % 3},{2.0 + 0.01 * (k % 5)}\n" for k in range(500))
    got = reduction(reduce(importers.read(write("time_s,rpm,thrust_N\n" + body))))
    assert got.mode == "samples" and not any(lost.channel == "time_s" for lost in got.dropped)


# Shapes of files found in public repositories: read as they are, or refused with what to do. All text is made up.


def bench(rows: int = 30, mark: str = ",") -> list[str]:
    """Lines of a table: time, thrust, speed."""
    body = [mark.join((f"{0.5 * k:g}", f"{0.1 * k * k:.4g}", f"{300 * k}")) for k in range(rows)]
    return [mark.join(("Time (s)", "Thrust (N)", "RPM")), *body]


# ---------------------------------------------------------------- vendors' tables


PER3 = """   12x6(TEST)      (12x6(TEST).dat)
   v2022-0915

   ====== PERFORMANCE DATA (versus advance ratio and MPH) ======

   PROP RPM =       3000

   V  J  Pe  Ct  Cp  PWR  Torque  Thrust  PWR  Torque  Thrust  THR/PWR  Mach  Reyn  FOM
   (mph)  (Adv_Ratio)  -  -  -  (Hp)  (In-Lbf)  (Lbf)  (W)  (N-m)  (N)  (g/W)  -  -  -
   0.00  0.0000  0.0000  0.1000  0.0400  0.010  0.700  0.500  8.700  0.083  2.347  27.4  0.14  60000.  0.60
  17.04  0.5000  0.7000  0.0500  0.0300  0.010  0.600  0.300  7.700  0.070  1.347  17.4  0.14  61000.  0.30
  20.00  0.5867
"""


def test_a_point_at_which_the_vendors_code_failed_is_a_flagged_row(write: Write) -> None:
    got = import_file(write(PER3, "PER3_12x6(TEST).dat"))
    assert (got.kind, len(got)) == ("vendor", 3)
    thrust = got["thrust_N"]
    assert thrust[:2].tolist() == [2.347, 1.347] and np.isnan(thrust[2]) and got["J"][2] == 0.5867
    assert said(got, "NaN in the file") and said(got, "2 blades, D 0.3048 m, pitch 0.1524 m")
    with pytest.raises(InputError, match="Repair or delete the row"):
        import_file(write(PER3.replace("0.5867\n", "0.5867 0.6\n"), "cut.dat"))


# ---------------------------------------------------------------- headings


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("Thrust - gf", "thrust_N", "N"), ("Torque - N*m", "torque_Nm", "Nm"), ("Thrust, N", "thrust_N", "N"),
        ("Thrust in N", "thrust_N", "N"), ("thrust kgf", "thrust_N", "N"), ("Thrust / N", "thrust_N", "N"),
        ("I/A", "I_A", "A"), ("U/V", "voltage_V", "V"), ("T/K", "T_K", "K"), ("P/W", "P_W", "W"),
        ("Torque (N.m)", "torque_Nm", "Nm"), ("Torque [kNm]", "torque_Nm", "Nm"), ("Torque (kN·m)", "torque_Nm", "Nm"),
        ("Thrust (Newtons)", "thrust_N", "N"), ("Torque (N-mm)", "torque_Nm", "Nm"), ("Temp (ºC)", "temp_K", "K"),
        ("Omega [rad s^-1]", "omega_rad_s", "rad_s"), ("ESC signal (Âµs)", "pulse_width_s", "s"),
        ("ESC throttle (μs)", "pulse_width_s", "s"), ("Throttle (us)", "pulse_width_s", "s"),
        ("Volts", "voltage_V", "V"),
        ("Amps", "current_A", "A"), ("Watts", "P_W", "W"), ("Watt", "P_W", "W"), ("Ampere", "current_A", "A"),
        ("Rotation speed (rpm)", "rpm", "rpm"), ("Ct", "CT", "-"),
        ("time_since_start_s", "time_s", "s"), ("Electrical Speed (eRPM)", "electrical_rpm", "rpm"),
        ("Vibration (m/s²)", "vibration_m_s2", "m/s2"),
        # ratios, rotors and ambiguous units stay what they are
        ("r/R", "r/R", "-"), ("P/D", "P/D", "-"), ("Thrust A", "Thrust_A", ""), ("Current A", "Current_A", ""),
        ("Q/N", "Q/N", ""), ("n (1/s)", "n_1/s", ""), ("Thrust - g", "thrust_N", "N"), ("Force - X", "Force_X", ""),
    ],
)  # fmt: skip
def test_headings_as_people_write_them(text: str, name: str, unit: str) -> None:
    got = heading(text)
    assert (got.name, got.unit_name) == (name, unit)


def test_a_quantity_over_its_unit_is_no_ratio() -> None:
    assert heading("Thrust (gf)").unit == heading("Thrust/gf").unit
    assert "ratio" in heading("Q/N").doubt


# ---------------------------------------------------------------- tables of bench logs


def test_lines_above_the_headings_are_named_and_left_out(write: Write) -> None:
    plain = import_file(write("\n".join(bench()) + "\n", "plain.csv"))
    got = import_file(write("\n".join(["Prop 10x5, Bob", "3 May", *bench()]) + "\n"))
    assert len(got) == len(plain) and said(got, "2 lines above the headings left out: 'Prop 10x5, Bob', '3 May'")
    for name, values in plain.values.items():
        assert np.array_equal(got[name], values)


def test_a_damaged_line_of_headings_is_no_text_above_a_table(write: Write) -> None:
    lines = bench()
    lines[0] = "Time (s),Thrust (N) RPM"
    with pytest.raises(InputError):
        import_file(write("\n".join(lines) + "\n"))


@pytest.mark.parametrize("change", ["sep", "utf-16", "empty cells", "semicolons"])
def test_what_spreadsheets_do_to_a_table_changes_no_number(change: str, write: Write) -> None:
    plain = import_file(write("\n".join(bench()) + "\n", "plain.csv"))
    lines = bench(mark=";" if change in ("sep", "semicolons") else ",")
    lines = ["sep=;", *lines] if change == "sep" else [*lines, ",,", ",,"] if change == "empty cells" else lines
    text = "\r\n".join(lines) + "\r\n"
    got = import_file(write(text.encode("utf-16") if change == "utf-16" else text))
    assert (got.provenance["format"], len(got), list(got.values)) == (
        plain.provenance["format"],
        len(plain),
        list(plain.values),
    )
    assert all(np.array_equal(got[k], v) for k, v in plain.values.items())


def test_few_lines_of_another_length_are_kept_without_values(write: Write) -> None:
    lines = bench(60)
    lines[7] += ",3500,-156"
    got = import_file(write("\n".join(lines) + "\n"))
    assert len(got) == 60 and got.flags[6] == ("not 3 cells",) and said(got, "not 3 cells in 1 row (line 8)")
    assert all(np.isnan(v[6]) and np.isfinite(v[7]) for v in got.values.values())
    with pytest.raises(InputError, match="expected 3 as in line 1"):  # in a short table one is too many
        import_file(write("\n".join(lines[:15]) + "\n"))


def test_a_clock_is_the_time_of_a_log_that_has_no_other(write: Write) -> None:
    text = "PC time,Thrust (N),RPM\n" + "".join(f"23:59:{58 + k},1.5,3000\n" for k in range(2))
    got = import_file(write(text + "00:00:00.25,1.6,3010\n"))
    assert got["time_s"].tolist() == [0.0, 1.0, 2.25] and got.unit("time_s") == "s"
    text = "timestamp,Time (s),RPM\n" + "".join(f"2024-05-01 12:00:0{k},{k / 2},3000\n" for k in range(5))
    got = import_file(write(text))
    assert got["time_s"][-1] == 2.0 and got["timestamp_s"][-1] == 4.0
    text = "when,Thrust (N),RPM\n" + "".join(f"0{k}/05/2024 12:00,1.5,3000\n" for k in range(1, 6))
    got = import_file(write(text))  # day or month first?
    assert "when" in got.texts and said(got, "text, kept as such, in 1 column: 'when'")


def test_a_comma_between_thousands_is_not_taken_for_a_decimal_one(write: Write) -> None:
    with pytest.raises(InputError, match="A comma between thousands"):
        import_file(write('rpm,thrust_N\n"1,000",1\n"2,000",4\n"3,000",9\n'))
    got = import_file(write('rpm,thrust_N\n"1,000",1.5\n"2,000",4.5\n"3,000",9.5\n'))  # points are there for decimals
    assert got["rpm"].tolist() == [1000.0, 2000.0, 3000.0] and said(got, "thousands")


def test_cp_beside_ct_is_that_of_the_power(write: Write) -> None:
    body = "".join(f"{0.1 * k:.1f},{0.1 - 0.01 * k:.3f},{0.05:.3f}\n" for k in range(6))
    assert {"J", "CT", "CP"} <= import_file(write("J,Ct,Cp\n" + body)).values.keys()
    assert "Cp" in import_file(write("x/c,y/c,Cp\n" + body)).values


STAND = ("Time (s),ESC A (µs),Thrust A (N),Torque A (N·m),Motor Optical Speed A (RPM),"
         "Thrust B (N),Motor Optical Speed B (RPM)")  # fmt: skip
FLIGHT = ("Time (s),Powertrain 1 - ESC throttle (μs),Powertrain 1 - force Fz (thrust) (kgf),"
          "Powertrain 1 - torque MZ (torque) (N⋅m),Powertrain 1 - rotation speed (rpm)")  # fmt: skip


def stand(head: str, rest: str = "") -> str:
    rows = (
        f"{2 * k},{1100 + 40 * k},{0.03 * k * k:.4f},{0.001 * k * k + 1e-5 * k:.5f},{400 * k}" for k in range(1, 14)
    )
    return head + "\n" + "".join(f"{row}{rest}\n" for row in rows)


def test_the_one_motor_that_turned_gets_the_plain_names(write: Write) -> None:
    got = import_file(write(stand(STAND, ",0,0")))
    assert (
        got.provenance["format"] == "rcbenchmark"
        and {"thrust_N", "torque_Nm", "optical_rpm", "pulse_width_s"} <= got.values.keys()
    )
    assert said(got, "only motor A turned") and got.provenance["headings"]["thrust_N"] == "Thrust A (N)"
    both = import_file(write(stand(STAND, ",1.5,3000")))
    assert "thrust_N" not in both.values and said(both, "motors A and B turned: name the columns of one")


def test_the_log_of_a_flight_stand_is_a_bench_recording(write: Write) -> None:
    got = import_file(write(stand(FLIGHT)))
    assert (got.provenance["format"], got.kind) == ("rcbenchmark", "bench")
    assert list(got.values) == ["time_s", "pulse_width_s", "thrust_N", "torque_Nm", "rpm"]
    assert got["thrust_N"][1] == pytest.approx(0.12 * 9.80665)
    assert said(got, "rpm: the file names neither its sensor nor the number of poles")


# ---------------------------------------------------------------- polars


SITE = "Xfoil polar. Reynolds number fixed. Mach  number fixed\nPolar key,xf-x-50000\nAirfoil,x-il\n"
SITE += "Reynolds number,50000\nNcrit,7\nMach,0.1\nMax Cl/Cd,37.4\n\nAlpha,Cl,Cd,Cdp,Cm,Top_Xtr,Bot_Xtr\n"
XFLR5 = " xflr5 v6.47\n\n Calculated polar for: x-il\n\n 1 1 Reynolds number fixed          Mach number fixed\n\n"
XFLR5 += " Mach =   0.100     Re =     0.050 e 6     Ncrit =   7.000\n\nalpha,CL,CD,CDp,Cm,Top Xtr,Bot Xtr\n"


@pytest.mark.parametrize("head", [SITE, XFLR5])
def test_polars_with_commas_are_those_of_xfoil(head: str, write: Write) -> None:
    body = [(a, 0.1 * a, 0.012 + 1e-4 * a * a) for a in range(-8, 15)]
    commas = import_file(write(head + "".join(f"{a},{cl:.4f},{cd:.5f},0.005,0,1,1\n" for a, cl, cd in body)))
    blanks = XFLR5.replace(
        "alpha,CL,CD,CDp,Cm,Top Xtr,Bot Xtr", "  alpha    CL   CD   CDp  CM   Top_Xtr  Bot_Xtr\n ---- ----"
    )
    save = import_file(
        write(blanks + "".join(f" {a} {cl:.4f} {cd:.5f} 0.005 0 1 1\n" for a, cl, cd in body), "save.txt")
    )
    assert commas.provenance["format"] == save.provenance["format"] == "polar_xfoil"
    assert set(commas["Re"].tolist()) == {50000.0}
    assert np.array_equal(commas["cl"], save["cl"]) and said(commas, "Ncrit 7")


def test_a_polar_of_the_site_without_its_reynolds_number_is_refused(write: Write) -> None:
    body = "".join(f"{a},{0.1 * a:.4f},0.012,0.005,0,1,1\n" for a in range(-8, 15))
    with pytest.raises(InputError, match="Calculated polar for"):
        import_file(write(SITE.replace("Reynolds number,50000\n", "") + body))


# ---------------------------------------------------------------- exports of solvers


def test_a_direction_is_no_unit_of_a_force_report(write: Write) -> None:
    text = "Forces - Direction Vector (0 0 -1)\nZone  Pressure Viscous Total Pressure Viscous Total\n"
    with pytest.raises(InputError, match="6 columns under 0 groups"):  # the line of units is missing
        import_file(write(text + "blade  10 1 11 1.0 0.1 1.1\nNet  10 1 11 1.0 0.1 1.1\n", "f.txt"))


def test_a_time_in_milliseconds_is_no_clock_in_seconds(write: Write) -> None:
    head = '"f"\n"Time Step" "F etc.."\n("Time Step" "F [N]" "flow-time [{}]")\n'
    body = "".join(f"{k} {1 + k / 100} {k}\n" for k in range(1, 30))
    got = import_file(write(head.format("ms") + body, "f.out"))
    assert got.unit("F [N]") == "N" and got.provenance["clock"] != "time"
    assert import_file(write(head.format("s") + body, "f.out")).provenance["clock"] == "time"


def test_bins_are_refused_and_a_residual_that_is_not_solved_is_nan(write: Write) -> None:
    bins = "# bins      : 2\n# Time          \tforces[0](pressure,viscous) moments[0](pressure,viscous)\n"
    with pytest.raises(InputError, match="bins along a direction"):
        import_file(write(bins + "0.1 \t((1 2 3) (0 0 0)) ((1 1 1) (0 0 0))\n", "bins.dat"))
    text = "# Residuals   \n# Time        \tp\tUz\n" + "".join(f"{k}\t{1 / k:.5f}\tN/A\n" for k in range(1, 20))
    got = import_file(write(text, "r.dat"))
    means = got.provenance["means"]
    assert "p" in means and "Uz" not in means and np.all(np.isnan(got["Uz"]))


# ---------------------------------------------------------------- no results at all


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Time,Thrust,RPM\n", "one line and no rows"), ("rpm\n100\n200\n300\n", "a single column"),
        ("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 210\n", "git lfs pull"),
        ('{"rpm": [1, 2]}', "JSON"), ("<!DOCTYPE html><html><body>404</body></html>", "a web page"),
        ("Time (s),RPM\n0,1\n".encode("utf-16-le"), "UTF-16 without its mark"),
        ("   v1\n ==== APC Propeller STATIC Performance Predictions ===\n 10x5.dat\n RPM THRUST\n 1 2\n", "PER3_"),
        ("Force vector: (1 0 0)\n      pressure  viscous  total\nzone name  force force\nnet 1 2\n", "Fluent 6"),
    ],
)  # fmt: skip
def test_what_a_file_is_instead_is_said(text: str | bytes, words: str, write: Write) -> None:
    with pytest.raises(InputError, match=words):
        import_file(write(text))


def test_a_round_root_is_a_polar_and_swapped_columns_are_none(write: Write) -> None:
    text = "alpha_deg,cl,cd\n" + "".join(f"{a},{{}},0.5\n" for a in range(-180, 181, 9))
    got = import_file(write(text.format(*["0.0"] * 41), "round.csv"))
    assert got.kind == "polar" and np.allclose(got["cd"], 0.5, rtol=1e-6)
    with pytest.raises(InputError, match="least cd"):
        import_file(write(text.format(*["0.05"] * 41), "swapped.csv"))


def test_a_c81_table_of_other_columns_is_named(write: Write) -> None:
    text = "NACA 0012".ljust(30) + " 2 2 2 2 0 0\n  0.   0.2 0.4\n-180. 0. 0.\n180. 0. 0.\n"
    with pytest.raises(InputError, match="Fields are 7 characters wide"):
        import_file(write(text, "x.c81"))


def test_forces_that_are_all_zero_are_asked_about(write: Write) -> None:
    text = "# Force coefficients\n# Time\tCd\tCl\n" + "".join(f"{k}\t0\t{{}}\n" for k in range(1, 9))
    assert said(import_file(write(text.replace("{}", "0"), "z.dat")), "every value is 0")
    assert not said(import_file(write(text.replace("{}", "0.1"), "y.dat")), "every value is 0")


# The promise of the readers of paired recordings: SI per rotor, what a file does not say as a warning, faults told.


COAXIAL = (
    "PWM Left,PWM Right,Thrust Left [g],Torque Left [Nm],Thrust Right [g],Torque Right [Nm],"
    "Speed Left [rpm],Speed Right [rpm],Time [s]"
)


def coaxial(right_turns: bool) -> str:
    rows = ["1000,1000,19.5,0.004,14.0,-0.008,0,0,10", "1070,1000,0.05,0,0,0,0,0,20"]
    for k in range(8):
        n = 3000 + 400 * k
        right = 0.95 * n if right_turns else 0.0
        left = (1400 + 50 * k, 3e-5 * n**2, -4e-9 * n**2)
        other = (1400 if right_turns else 1000, 2e-5 * right**2, 3.9e-9 * right**2)
        cells = [left[0], other[0], left[1], left[2], other[1], other[2], n, right, 30 + k]
        rows.append(",".join(str(c) for c in cells))
    return "\n".join([COAXIAL, *rows]) + "\n"


def test_one_rotor_that_turned_gets_the_plain_names(tmp_path: Path) -> None:
    path = tmp_path / "15in_single.csv"
    path.write_text(coaxial(False), "utf-8")
    got = import_file(path)
    assert got.provenance["format"] == "coaxial_stand"
    assert got.provenance["constants"]["diameter_m"] == pytest.approx(15 * 0.0254)
    assert got["thrust_N"][2] == pytest.approx(3e-5 * 3000**2 * G0 / 1000.0)
    assert got["torque_Nm"][2] > 0.0 and any("sign" in w for w in got.notes)
    assert np.isnan(got["thrust_N"][0]), "a reading before the tare is no zero"


def test_two_rotors_keep_their_sides(tmp_path: Path) -> None:
    path = tmp_path / "map.csv"
    path.write_text(coaxial(True), "utf-8")
    got = import_file(path)
    assert {"thrust_left_N", "thrust_right_N", "left_rpm", "right_rpm"} <= got.values.keys()
    assert got["speed_ratio"][3] == pytest.approx(0.95)


def test_four_propellers_on_a_scale_are_read_per_propeller(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    lines = []
    for k in range(8):
        n = 1000 * k
        cells = [20000 + 4000 * k, 4.0 - 0.05 * k, 10000 + n, 12000 + n, 10000 + n, 12000 + n, 8 + 3 * k]
        lines.append(",".join(str(c) for c in cells))
    path.write_text("\n".join(["pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]", *lines]) + "\n", "utf-8")
    got = import_file(path)
    assert got.provenance["format"] == "crazyflie_bench"
    assert got["thrust_N"][0] == pytest.approx(8e-3 * G0 / 4)
    assert got["rpm"][0] == pytest.approx(np.sqrt((10000**2 + 12000**2) / 2))
    assert got["throttle"][0] == pytest.approx(20000 / 65535)


def flight(rows: int = 20, version: int = 2) -> bytes:
    names = [f"rpm.m{k}(H)" for k in range(1, 5)] + ["acc.z(f)", "pm.vbatMV(H)"]
    data = (
        struct.pack("<BHH", 0xBC, version, 1)
        + struct.pack("<H", 7)
        + b"fixedFrequency\0"
        + struct.pack("<H", len(names))
    )
    data += b"".join(n.encode() + b"\0" for n in names)
    for k in range(rows):
        data += struct.pack("<HQ" if version == 2 else "<HI", 7, 1000 * k)
        data += struct.pack("<HHHHfH", 20000, 20000, 20000, 20000, 1.0, 3700)
    return data + struct.pack("<I", zlib.crc32(data))


@pytest.mark.parametrize("version", [1, 2])
def test_a_flight_log_is_read_whole_or_refused(tmp_path: Path, version: int) -> None:
    path = tmp_path / "flight.usdlog"
    path.write_bytes(flight(version=version))
    got = import_file(path)
    assert got.provenance["format"] == "crazyflie_log" and len(got) == 20
    assert got["time_s"][-1] == pytest.approx(0.019)
    assert got["acceleration_z_m_s2"][0] == pytest.approx(G0)
    assert got["voltage_V"][0] == pytest.approx(3.7)
    packed = tmp_path / "flight.usdlog.gz"
    packed.write_bytes(gzip.compress(flight(version=version)))
    assert len(import_file(packed)) == 20
    damaged = bytearray(path.read_bytes())
    damaged[-20] ^= 0xFF
    path.write_bytes(bytes(damaged))
    with pytest.raises(InputError, match="checksum"):
        import_file(path)
    path.write_bytes(flight()[:40])
    with pytest.raises(InputError):
        import_file(path)


STANDS = {  # a table of each stand whose headings are known, {} the unit of a column
    "coaxial_stand": ("PWM Left [us],PWM Right [us],Thrust Left [g],Thrust Right [g],Torque Left [{}],Speed Left [rpm],"
                      "Speed Right [rpm]", "1500,1000,100,0,0.{k}5,5000,0",
                      "torque_Nm", {"Nm": 1.0, "Nmm": 1e-3, "gf cm": 9.80665e-5}, "V"),
    "jmajew": ("Motor Output,ESCT RPM,Thrust [{}],Torque [G cm],RPM [1/min]", "1200,400,1.{k},2.5,5714",
               "thrust_N", {"G": 9.80665e-3, "N": 1.0, "kgf": 9.80665}, "A"),
    "crazyflie_bench": ("pwm,vbat[{}],rpm1,rpm2,rpm3,rpm4,weight[g]", "30000,3.{k},9000,9000,9000,9000,20",
                        "voltage_V", {"V": 1.0, "mV": 1e-3}, "N"),
}  # fmt: skip


@pytest.mark.parametrize("stand", STANDS)
def test_a_unit_in_the_heading_of_a_stand_is_converted_or_refused(stand: str, write: Write) -> None:
    head, row, channel, factors, wrong = STANDS[stand]
    rows = "".join(row.format(k=k) + "\n" for k in range(1, 8))

    def column(unit: str) -> np.ndarray:
        got = importers.read(write(f"{head.format(unit)}\n{rows}", f"{stand}.csv"))
        assert got.provenance["format"] == stand
        return got[channel]

    first = column(next(iter(factors)))
    for unit, factor in factors.items():
        assert np.allclose(column(unit) / factor, first / next(iter(factors.values())), rtol=1e-9, equal_nan=True), unit
    with pytest.raises(InputError, match=f"{wrong}.*a unit such as"):
        column(wrong)


@pytest.mark.parametrize(
    ("head", "cell", "channel", "value"),
    [("Efficiency (kgf/W)", "0.008", "efficiency_N_W", 0.008 * 9.80665), ("Prop speed (Hz)", "80", "rpm", 4800.0),
     ("Propeller speed (1/s)", "80", "rpm", 4800.0)],
)  # fmt: skip
def test_units_of_headings_that_a_mutant_changed(
    head: str, cell: str, channel: str, value: float, write: Write
) -> None:
    read = importers.read(write(f"{head},x_A\n" + f"{cell},1\n" * 3))
    got = {**read.values, **named(read).values}
    assert np.allclose(got[channel], value, rtol=1e-6)


def test_loads_before_the_tare_are_left_out(write: Write) -> None:
    head, row, channel, *_ = STANDS["coaxial_stand"]
    first = "1000,1000,3,3,0.3,10,10\n"
    got = importers.read(write(head.format("Nm") + "\n" + first + "".join(row.format(k=k) + "\n" for k in range(1, 6))))
    assert np.isnan(got[channel][0]) and np.isfinite(got[channel][1:]).all() and said(got, "before the tare")


@pytest.mark.parametrize(
    ("rows", "words"),
    [("4000,1.9\n5000,abc\n6000,4.3\n", "'abc' at 3:2"),
     ("4000,inf\n5000,3\n6000,-inf\n8000,7.8\n", "'inf' at 2:2"),
     ("4000,1.9\n5000\n6000,4.3\n8000,7.9\n", "3: got 1 cell"),
     ("4000,1.9\n5000,3,1\n6000,4.3\n8000,7.9\n", "3: got 3 cells")],
)  # fmt: skip
def test_one_bad_cell_or_row_is_named_and_hides_no_column(rows: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "bench.csv"
    file.write_text("rpm,thrust_N\n" + rows)
    try:
        found = importers.read(file)
    except InputError as error:
        assert words in str(error)
    else:
        assert words in " ".join(found.notes) and np.isfinite(found.thrust_N).sum() == 2


def test_the_letters_of_a_drive_are_its_volts_amperes_and_watts(tmp_path: Path) -> None:
    file = tmp_path / "bench.csv"
    file.write_text("rpm,thrust_g,V,A,W\n5000,300,11.1,3,33.3\n6000,440,11,5,55\n7000,600,10.9,8,87.2\n")
    assert {"voltage_V", "current_A", "electrical_power_W"} <= importers.read(file).values.keys()
    file.write_text("rpm,thrust_g,V\n5000,300,0\n6000,440,5\n")
    assert "voltage_V" not in importers.read(file)


def test_a_stand_file_with_decimal_commas_is_read(tmp_path: Path) -> None:
    head = "Time (s);ESC signal (µs);Torque (N·m);Thrust (gf);Voltage (V);Current (A);Motor Optical Speed (RPM)"
    rows = [f"{k / 4:.3f};1000;-0.00039;{100 + k}.09;11.399;0.050;{3000 + k}" for k in range(20)]
    points, commas = tmp_path / "points.csv", tmp_path / "commas.csv"
    points.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    commas.write_text("\n".join([head, *(row.replace(".", ",") for row in rows)]) + "\n", encoding="utf-8")
    a, b = importers.read(points), importers.read(commas)
    assert a.provenance["format"] == b.provenance["format"] == "rcbenchmark"
    assert all(np.array_equal(a[k], b[k]) for k in ("thrust_N", "torque_Nm", "optical_rpm"))


@pytest.mark.parametrize(
    "air", [("Luftdruck [hPa];985", "Temperatur [°C];18"), ("Pressure: 985 hPa", "Temperature;18 °C")]
)
def test_air_above_the_headings_is_that_of_all_rows(tmp_path: Path, air: tuple[str, ...]) -> None:
    file = tmp_path / "stand.csv"
    rows = ("U/min;Schub in N", "3344;1,44", "4176;2,27", "5025;3,34", "")
    file.write_text("\n".join(["Specimen;10x5", *air, "", *rows]), encoding="utf-8")
    found = importers.read(file)
    assert found["pressure_Pa"] == pytest.approx([98500.0] * 3)
    assert found["temperature_K"] == pytest.approx([291.15] * 3)


@pytest.mark.parametrize(("air", "known"), [("Pressure [Pa];101,325", False), ("Pressure [Pa];98500", True)])
def test_air_above_the_headings_is_read_as_its_table_is(tmp_path: Path, air: str, known: bool) -> None:
    """With decimal points a comma is none: 101,325 Pa is neither 101 Pa nor guessed."""
    file = tmp_path / "stand.csv"
    rows = ("rpm;thrust (N)", "3344;1.44", "4176;2.27", "5025;3.34", "")
    file.write_text("\n".join([air, "", *rows]), encoding="utf-8")
    found = importers.read(file)
    assert ("pressure_Pa" in found) == known and found["thrust_N"] == pytest.approx([1.44, 2.27, 3.34])

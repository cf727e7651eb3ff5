# ruff: noqa: E501
"""Tables, labels and blades of strangers: read right, or refused helpfully."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.data import readers
from bemt.data.readers.stations import read_stations
from bemt.data.recordings.channels import named
from bemt.data.recordings.load import as_stated, import_file
from bemt.rotors.case.words import is_case
from geometry.common import GeometryError
from geometry.designation import parse_designation

SPEEDS = np.array([2500.0, 3300.0, 4100.0, 5000.0, 5900.0, 6800.0, 7600.0, 8300.0])
THRUST, TORQUE = 1.39e-7 * SPEEDS**2, 2.52e-9 * SPEEDS**2
GF, VOLTS = 9.80665e-3, 14.8
POWER = TORQUE * SPEEDS * np.pi / 30.0 / 0.75
AMPS = POWER / VOLTS

HEADINGS = [  # heading, cell, channel, value in SI
    ("Thrust(G)", "1000", "thrust_N", 9.80665), ("THRUST(GRAMS)", "1000", "thrust_N", 9.80665),
    ("Thrust / kgf", "1", "thrust_N", 9.80665), ("thrustN", "5", "thrust_N", 5.0),
    ("Thrust [daN]", "1", "thrust_N", 10.0),
    ("Thrust (corrected) [N]", "5", "thrust_N", 5.0), ("Standschub (g)", "1000", "thrust_N", 9.80665),
    ("Schub in N", "5", "thrust_N", 5.0), ("Poussée statique (N)", "5", "thrust_N", 5.0),
    ("Empuje estático [g]", "1000", "thrust_N", 9.80665), ("Spinta (kg)", "1", "thrust_N", 9.80665),
    ("推力(g)", "1000", "thrust_N", 9.80665), ("拉力（kg）", "1", "thrust_N", 9.80665),
    ("Тяга (г)", "1000", "thrust_N", 9.80665),
    ("Schub / Thrust [N]", "5", "thrust_N", 5.0), ("推力 Thrust (g)", "1000", "thrust_N", 9.80665),
    ("Poussée (Thrust) [N]", "5", "thrust_N", 5.0), ("Drehzahl / RPM", "5000", "rpm", 5000.0),
    ("Drehzahl (min⁻¹)", "5000", "rpm", 5000.0), ("Drehzahl in 1/min", "5000", "rpm", 5000.0),
    ("Régime moteur hélice (tr/min)", "5000", None, 0.0), ("Giri/min", "5000", "rpm", 5000.0),
    ("转速(r/min)", "5000", "rpm", 5000.0),
    ("Avg RPM", "5000", "rpm", 5000.0), ("n (rev/s)", "100", "rpm", 6000.0), ("Ω [rad/s]", "100", "rpm", 954.9297),
    ("Torque（N*m）", "0.1", "torque_Nm", 0.1), ("Drehmoment Ncm", "10", "torque_Nm", 0.1),
    ("Couple (mN.m)", "100", "torque_Nm", 0.1),
    ("Coppia [N m]", "0.1", "torque_Nm", 0.1), ("Par de torsión (Nm)", "0.1", "torque_Nm", 0.1),
    ("扭矩(N·m)", "0.1", "torque_Nm", 0.1),
    ("Torque (kg*cm)", "1", "torque_Nm", 0.0980665), ("Battery voltage (V)", "12", "voltage_V", 12.0),
    ("VOLTAGE [v]", "12", "voltage_V", 12.0),
    ("Amperage (A)", "3", "current_A", 3.0), ("Corrente (A)", "3", "current_A", 3.0), ("电流(A)", "3", "current_A", 3.0),
    ("Power Input (W)", "60", "electrical_power_W", 60.0),
    ("Puissance électrique (W)", "60", "electrical_power_W", 60.0),
    ("Wellenleistung [W]", "60", "power_W", 60.0), ("输出功率(W)", "60", "power_W", 60.0),
    ("Shaft power (hp)", "1", "power_W", 745.6999),
    ("Température ambiante (°C)", "15", "temperature_K", 288.15), ("环境温度(℃)", "15", "temperature_K", 288.15),
    ("Pression atmosphérique (hPa)", "1013", "pressure_Pa", 101300.0), ("大气压(kPa)", "101.3", "pressure_Pa", 101300.0),
    ("ρ [kg/m³]", "1.2", "density_kg_m3", 1.2), ("Umidità (%)", "45", "humidity", 0.45),
    ("Manetta (%)", "50", "throttle", 0.5),
    ("油门(%)", "50", "throttle", 0.5), ("Throttle Position (%)", "50", "throttle", 0.5),
    ("Throttle", "50", "throttle", 0.5),
    ("Impulsbreite [µs]", "1500", "pwm_s", 1.5e-3), ("Windgeschwindigkeit [km/h]", "36", "airspeed_m_s", 10.0),
    ("Vitesse du vent (m/s)", "10", "airspeed_m_s", 10.0), ("V∞ (m/s)", "10", "airspeed_m_s", 10.0),
    ("Zeit (s)", "3", "time_s", 3.0),
    ("t [s]", "3", "time_s", 3.0), ("Thrust coefficient", "0.1", "CT", 0.1), ("Leistungsbeiwert", "0.05", "CP", 0.05),
    ("Advance ratio J", "0.4", "J", 0.4),
    # another quantity, or a unit that does not go with the words: never taken
    ("Tension (N)", "5", None, 0.0), ("Motor weight (g)", "5", None, 0.0), ("Vibration (g)", "5", None, 0.0),
    ("Thrust error (N)", "5", None, 0.0), ("Tip speed (m/s)", "50", None, 0.0), ("Motor temp (°C)", "40", None, 0.0),
    ("Thrust A", "5", None, 0.0), ("Efficiency (g/W)", "8", None, 0.0), ("Side force (N)", "5", None, 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("text", "cell", "channel", "value"), HEADINGS)
def test_a_heading_is_the_channel_or_none(
    text: str, cell: str, channel: str | None, value: float, tmp_path: Path
) -> None:
    (tmp_path / "t.csv").write_text(f"{text};run\n" + f"{cell};1\n{cell};1\n{cell};1\n", encoding="utf-8")
    got = named(readers.read(tmp_path / "t.csv"))
    if channel is None:
        assert set(got.values) <= {"run", "motor_rpm"}
    else:
        assert np.allclose(got[channel], value, rtol=1e-5)


# ---------------------------------------------------------------- whole tables


def _rows(*columns: object, mark: str = ",", decimal: str = ".") -> str:
    lines = zip(
        *(c if isinstance(c, list) else [f"{v:.5g}" for v in np.asarray(c, dtype=float)] for c in columns), strict=True
    )
    return "".join(mark.join(cell.replace(".", decimal) for cell in line) + "\n" for line in lines)


def _grouped(values: np.ndarray, thousands: str, decimal: str, digits: int = 0) -> list[str]:
    return [f"{v:,.{digits}f}".replace(",", "~").replace(".", decimal).replace("~", thousands) for v in values]


PERCENT = [f"{40 + 5 * k}%" for k in range(8)]
LVM = "LabVIEW Measurement\t\nWriter_Version\t2\n***End_of_Header***\t\n\t\nChannels\t3\t\t\t\nSamples\t8\t8\t8\t\n" \
      "Y_Unit_Label\tN\tN m\trpm\nX0\t0.0\t0.0\t0.0\t\nDelta_X\t0.1\t0.1\t0.1\t\n***End_of_Header***\t\t\t\t\n" \
      "X_Value\tThrust\tTorque\tSpeed\tComment\n"  # fmt: skip
TABLES: dict[str, bytes] = {
    "data sheet, cells in percent, a remark below": (
        "MN3508 KV580 Test Report,,,,,,,,\n\nType,Propeller,Throttle,Voltage (V),Thrust (g),Torque (N*m),Current (A),RPM,"
        "Operating Temperature (℃)\n"
        + _rows(["MN3508", *[""] * 7], ["10x5", *[""] * 7], PERCENT, VOLTS + 0 * SPEEDS, THRUST / GF, TORQUE, AMPS, SPEEDS,
                [*[""] * 7, "45"])
        + "Notes: motor surface temperature,,,,,,,,\n").encode(),
    "German, Windows-1252, units below, dots between thousands, a mean": (
        "Prüfstand;;;;\nDatum:;12.03.2024;;;\nDrehzahl;Schub;Drehmoment;Spannung;Luftdruck\n[1/min];[N];[Nm];[V];[hPa]\n"
        + "".join(f"{n};{t:.2f};{q:.4f};14.8;1~013.2\n".replace(".", ",").replace("~", ".")
                  for n, t, q in zip(_grouped(SPEEDS, "~", ","), THRUST, TORQUE, strict=True))
        + "Mittelwert;4,2;0,08;14,8;1.013,2\n").encode("cp1252"),
    "Chinese, GBK": ("油门(%),电压(V),电流(A),推力(g),转速(RPM),扭矩(N*m),温度(℃)\n" + _rows(
        30 + 10 * np.arange(8), VOLTS + 0 * SPEEDS, AMPS, THRUST / GF, SPEEDS, TORQUE, 30 + 5 * np.arange(8))).encode("gbk"),
    "Japanese, Shift-JIS": ("時間(s),スロットル(%),回転数(rpm),推力(gf),トルク(mNm)\n" + _rows(
        np.arange(8.0), 30 + 10 * np.arange(8), SPEEDS, THRUST / GF, TORQUE * 1e3)).encode("shift_jis"),
    "Russian, Windows-1251": ("Обороты (об/мин);Тяга (г);Момент (Н·м);Ток (А)\n" + _rows(
        SPEEDS, THRUST / GF, TORQUE, AMPS, mark=";", decimal=",")).encode("cp1251"),
    "headings in two languages and a line of units, UTF-16": (
        "Drehzahl\tSchub\tDrehmoment\tZeit\nRotation speed\tThrust\tTorque\tTime\nrpm\tN\tNm\ts\n"
        + _rows(SPEEDS, THRUST, TORQUE, np.arange(8.0), mark="\t")).encode("utf-16"),
    "units in the cells, commas between thousands": (
        "THROTTLE RANGE,AMPERAGE (A),POWER INPUT (W),THRUST OUTPUT,RPM (rev/min),Torque (Nm)\n" + _rows(
            PERCENT, [f"{a:.1f} A" for a in AMPS], [f"{p:.0f} W" for p in POWER], [f"{t / GF:.0f} g" for t in THRUST],
            [f'"{n:,.0f}"' for n in SPEEDS], TORQUE)).encode(),
    "LabVIEW": (LVM + _rows(np.arange(8.0), THRUST, TORQUE, SPEEDS, mark="\t")).encode(),
    "headings in a comment": ("# t (s), F (N), M (Nm), n (rpm)\n" + _rows(np.arange(8.0), THRUST, TORQUE, SPEEDS)).encode(),
    "blanks between columns, headings with blanks": (
        "Essai hélice 10x5\n\nRégime (tr/min)   Poussée (g)   Couple (mN.m)   Tension (V)\n"
        + _rows(SPEEDS, THRUST / GF, TORQUE * 1e3, VOLTS + 0 * SPEEDS, mark="    ")).encode("latin-1"),
    "blank columns, headings that come again": (
        "Manetta (%);;Giri (giri/min);Spinta (g);;Coppia (Nm)\n"
        + _rows(PERCENT[:4], [""] * 4, SPEEDS[:4], THRUST[:4] / GF, [""] * 4, TORQUE[:4], mark=";", decimal=",")
        + "Manetta (%);;Giri (giri/min);Spinta (g);;Coppia (Nm)\n"
        + _rows(PERCENT[4:], [""] * 4, SPEEDS[4:], THRUST[4:] / GF, [""] * 4, TORQUE[4:], mark=";", decimal=",")
        + ";;;;;\n").encode("utf-8-sig"),
    "apostrophes between thousands": ("Drehzahl U/min;Schub kg;Drehmoment Ncm\n" + _rows(
        _grouped(SPEEDS, "'", ","), THRUST / 9.80665, TORQUE * 100, mark=";")).encode("latin-1"),
    "per cent sign first among the units": ("Throttle,Current,Voltage,Thrust,RPM,Torque\n%,A,V,g,rpm,Nm\n" + _rows(
        30 + 10 * np.arange(8), AMPS, VOLTS + 0 * SPEEDS, THRUST / GF, SPEEDS, TORQUE)).encode(),
    "one force and one moment": ("Point,Fz [N],Mz [Nm],n [rpm]\n" + _rows(np.arange(8.0), THRUST, TORQUE, SPEEDS)).encode(),
}  # fmt: skip


@pytest.mark.parametrize("name", list(TABLES))
def test_a_table_of_a_stranger_is_read(name: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_bytes(TABLES[name])
    got = named(import_file(tmp_path / "t.csv"))
    assert np.allclose(got["rpm"], SPEEDS, rtol=1e-3) and len(got) == 8
    assert np.allclose(got["thrust_N"], THRUST, rtol=0.01, atol=0.006)
    assert np.allclose(got["torque_Nm"], TORQUE, rtol=0.01)
    assert "temperature_K" not in got, "that of a motor"
    if "current_A" in got:
        assert np.allclose(got["current_A"], AMPS, rtol=0.01, atol=0.06)


@pytest.mark.parametrize(("text", "units"), [
    ("Throttle,Voltage,Current,Thrust,RPM,Torque\n" + _rows(PERCENT, VOLTS + 0 * SPEEDS, AMPS, THRUST / GF, SPEEDS, TORQUE),
     ("V", "A", "g", "N*m")),
    ("Point,Fx [N],Fy [N],Fz [N],Mx [Nm],Mz [Nm],n [1/s]\n" + _rows(
        np.arange(8.0), 0 * SPEEDS - 0.02, 0.01 * SPEEDS / 8e3, THRUST, 0 * SPEEDS + 1e-3, TORQUE, SPEEDS / 60), ("rev/s",)),
    ("Drehzahl;Schub;Drehmoment\n" + _rows(SPEEDS, THRUST, TORQUE, mark=";", decimal=","), ("U/min", "N", "Nm")),
])  # fmt: skip
def test_the_command_that_a_hint_names_gives_the_right_numbers(
    text: str, units: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Only the word UNIT is the user's to replace; with it left there, nothing is written."""
    (tmp_path / "t.csv").write_text(text)
    (step,) = (
        found[0] for note in import_file(tmp_path / "t.csv").notes if (found := re.search(r"bemt import .*", note))
    )
    assert main(shlex.split(step)[1:]) == 2 and not (tmp_path / "recording.toml").exists()
    assert "expected" in capsys.readouterr().err
    for unit in units:
        step = step.replace("=UNIT", f"={unit}", 1)
    assert "UNIT" not in step and main(shlex.split(step)[1:]) == 0
    got = named(import_file(tmp_path / "recording.toml"))
    assert np.allclose(got["rpm"], SPEEDS, rtol=1e-3)
    assert np.allclose(got["thrust_N"], THRUST, rtol=1e-3) and np.allclose(got["torque_Nm"], TORQUE, rtol=1e-3)


# ---------------------------------------------------------------- labels


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ('10"x5"', "10x5"), ('10" x 5"', "10x5"), ("10″×5″", "10x5"), ("10 x 5", "10x5"), ("10*5", "10x5"), ("10X5E", "10x5"),
        ("10in x 5in", "10x5"), ("10 by 5", "10x5"), ("254x127mm", "10x5"), ("10x5x3", "10x5x3"), ("5x4.5x3", "5x4.5x3"),
        ("10x5 3-blade", "10x5x3"), ("26x10 3B", "26x10x3"), ("1045", "10x4.5"), ("9450", "9.4x5"), ("T5143S", "5.1x4.3x3"),
        ("Gemfan 51466", "5.1x4.66x3"), ("15x5CF", "15x5"), ("T-Motor 28x9.2", "28x9.2"),
    ],
)  # fmt: skip
def test_a_label_as_typed(text: str, size: str) -> None:
    assert parse_designation(text).size == size


@pytest.mark.parametrize(
    ("text", "meant"),
    [("10x4,5", ["10x4.5"]), ("10/5", ["10x5"]), ("3x10x5", ["10x5x3"]), ("MF2211", ["2.2x1.1", "22x11"]),
     ("254x127", ["254x127mm"]), ("10", []), ("MS1101", [])],
)  # fmt: skip
def test_a_label_in_doubt_is_refused_with_labels_that_are_read(text: str, meant: list[str]) -> None:
    with pytest.raises(GeometryError) as caught:
        parse_designation(text)
    for label in meant:
        assert label in str(caught.value)
        parse_designation(label)


# ---------------------------------------------------------------- blades

TIP = 0.127
X = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
C = np.array([0.12, 0.15, 0.17, 0.18, 0.17, 0.15, 0.13, 0.1, 0.05])
BETA = np.array([32.0, 27.0, 22.0, 18.0, 15.0, 13.0, 11.5, 10.0, 9.0])
PITCH = 2.0 * np.pi * X * TIP * np.tan(np.radians(BETA))
STATIONS: dict[str, bytes] = {
    "shares": ("r/R,c/R,beta (deg)\n" + _rows(X, C, BETA)).encode(),
    "millimetres, decimal commas, Windows-1252": ("r [mm];Chord [mm];Beta [°]\n" + _rows(
        X * TIP * 1e3, C * TIP * 1e3, BETA, mark=";", decimal=",")).encode("cp1252"),
    "inches": ("Radius (in),Chord (in),Blade angle (deg)\n" + _rows(X * TIP / 0.0254, C * TIP / 0.0254, BETA)).encode(),
    "chord over D": ("r/R\tc/D\tbeta_deg\n" + _rows(X, C / 2, BETA, mark="\t")).encode(),
    "German, a line of units, UTF-16": ("Radius;Sehne;Einstellwinkel\nmm;mm;°\n" + _rows(
        X * TIP * 1e3, C * TIP * 1e3, BETA, mark=";", decimal=",")).encode("utf-16"),
    "French": ("rayon (mm),corde (mm),calage (°)\n" + _rows(X * TIP * 1e3, C * TIP * 1e3, BETA)).encode("latin-1"),
    "Chinese": ("半径(mm),弦长(mm),桨叶角(°)\n" + _rows(X * TIP * 1e3, C * TIP * 1e3, BETA)).encode("gbk"),
    "radians between blanks": ("x/R   c/R   theta (rad)\n" + _rows(X, C, np.radians(BETA), mark="   ")).encode(),
    "local pitch": ("r_mm,chord_mm,pitch_in\n" + _rows(X * TIP * 1e3, C * TIP * 1e3, PITCH / 0.0254)).encode(),
    "pitch over D": ("r/R,c/R,P/D\n" + _rows(X, C, PITCH / 2 / TIP)).encode(),
    "2r/D": ("2r/D,2c/D,beta deg\n" + _rows(X, C, BETA)).encode(),
    "percent": ("r/R (%),c/R (%),beta (deg)\n" + _rows(100 * X, 100 * C, BETA)).encode(),
    "titles above": ("My propeller 10x5,,\nmeasured by Bob,,\nr/R,c/R,beta (deg)\n" + _rows(X, C, BETA)).encode(),
}  # fmt: skip


@pytest.mark.parametrize("name", list(STATIONS))
def test_stations_as_people_write_them(name: str, tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_bytes(STATIONS[name])
    x, c, beta = read_stations(tmp_path / "s.csv", TIP)[:3]
    assert (
        np.allclose(x, X, rtol=1e-3) and np.allclose(c, C, rtol=1e-3) and np.allclose(np.degrees(beta), BETA, rtol=1e-3)
    )


REFUSED: dict[str, tuple[str, str, Callable[[str], str]]] = {
    "no units": ("r,c,beta\n" + _rows(X * TIP * 1e3, C * TIP * 1e3, BETA), r"r \(mm\), c \(mm\)",
                 lambda t: t.replace("r,c,beta", "r (mm),c (mm),beta (deg)")),
    "twist": ("r/R,c/R,Twist (deg)\n" + _rows(X, C, BETA), "beta_deg", lambda t: t.replace("Twist (deg)", "beta_deg")),
    "chord over D called c/R": ("r/R,c/R,beta (deg)\n" + _rows(X, 10 * C, BETA), "chord_over_D|tip radius",
                                lambda t: "r/R,c/R,beta (deg)\n" + _rows(X, C, BETA)),
    "radians called degrees": ("r/R,c/R,beta (deg)\n" + _rows(X, C, np.radians(BETA)), "radians",
                               lambda t: t.replace("(deg)", "(rad)")),
}  # fmt: skip


@pytest.mark.parametrize("name", list(REFUSED))
def test_stations_in_doubt_are_refused_and_the_hint_is_right(name: str, tmp_path: Path) -> None:
    text, hint, follow = REFUSED[name]
    (tmp_path / "s.csv").write_text(text)
    with pytest.raises(InputError, match=hint):
        read_stations(tmp_path / "s.csv", TIP)
    (tmp_path / "s.csv").write_text(follow(text))
    x, c, beta = read_stations(tmp_path / "s.csv", TIP)[:3]
    assert (
        np.allclose(x, X, rtol=1e-3) and np.allclose(c, C, rtol=1e-3) and np.allclose(np.degrees(beta), BETA, rtol=1e-3)
    )


def test_a_case_is_told_from_a_recording_by_what_it_holds(tmp_path: Path) -> None:
    """Both may have a table of the rotor; keys may be dotted."""
    texts = {
        "a": 'name = "x"\nrotor.blades = 2\n',
        "b": "[rotor]\nblades = 2\n",
        "c": '[recording]\nfile = "x"\n[rotor]\n',
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.toml").write_text(text)
    assert [is_case(str(tmp_path / f"{name}.toml")) for name in texts] == [True, True, False]


HEADED = """{speed},{thrust},{torque}
4000,200,0.03
5000,310,0.047
6000,450,0.068
7000,610,0.092
"""


def test_a_misspelt_heading_is_asked_about_with_the_option_that_reads_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A speed or all loads stop the run, a load beside another is named; the option alone reads the unit in brackets."""
    file, right = tmp_path / "bench.csv", {"speed": "RPM", "thrust": "Thrust (g)", "torque": "Torque (Nm)"}

    def diagnosed(*options: str, **headings: str) -> tuple[int, str]:
        file.write_text(HEADED.format(**(right | headings)))
        code = main(["diagnose", str(file), "--case", "10x5", "--json", *options])
        said = capsys.readouterr()
        if code:
            return code, said.err
        return code, " ".join(json.loads(said.out)["findings"])

    code, said = diagnosed(thrust="Thurst (g)", torque="Torqe (Nm)")
    assert code == 2 and "'RPM', 'Thurst (g)', 'Torqe (Nm)'" in said
    assert "--column thrust='Thurst (g)'" in said and "--column torque='Torqe (Nm)'" in said
    code, said = diagnosed(speed="RMP")
    assert code == 2 and "--column rpm=RMP" in said and "--rpm" in said
    code, said = diagnosed(thrust="Thurst (g)")
    assert code == 0 and "--column thrust='Thurst (g)'" in said
    code, said = diagnosed("--column", "thrust=Thurst (g)", thrust="Thurst (g)")
    assert code == 0 and "thrust" not in said
    assert diagnosed()[1] == diagnosed(torque="Temp")[1] == ""


def test_a_column_named_for_its_quantity_keeps_the_unit_in_its_brackets(tmp_path: Path) -> None:
    file = tmp_path / "bench.csv"
    file.write_text(HEADED.format(speed="RPM", thrust="Thurst (g)", torque="Torque (Nm)"))
    (read,) = as_stated([str(file)], {"column": ["thrust=Thurst (g)"]})
    assert np.allclose(read.thrust_N, 9.80665e-3 * np.array([200, 310, 450, 610]))


@pytest.mark.parametrize("mark", [";", "\t", "  "])
def test_decimal_commas_without_headings_are_read_as_points_are(tmp_path: Path, mark: str) -> None:
    """Which column is which the user says."""
    rows = [(4000.5, 1.1, 0.016), (6000.0, 2.4, 0.034), (8000.0, 4.3, 0.061)]
    found = {}
    for name, decimal in (("points", "."), ("commas", ",")):
        cells = (mark.join(f"{v:.3f}" for v in row).replace(".", decimal) for row in rows)
        (tmp_path / f"{name}.txt").write_text("\n".join(cells) + "\n", encoding="utf-8")
        kept = tmp_path / f"{name}.toml"
        bemt.import_(tmp_path / f"{name}.txt", column={"rpm": "1", "thrust": "2", "torque": "3"},
                     unit={"rpm": "rpm", "thrust": "N", "torque": "Nm"}, out=kept)  # fmt: skip
        found[name] = bemt.read(kept)
    assert found["commas"].thrust_N.tolist() == found["points"].thrust_N.tolist() == [1.1, 2.4, 4.3]
    assert found["commas"].rpm[0] == 4000.5 and found["commas"].torque_Nm[2] == 0.061


def test_a_lone_point_among_decimal_commas_is_refused_with_its_place(tmp_path: Path) -> None:
    """5.910 beside 6,669 is 5910 or 5.91; a column of whole thousands, and one that proves its groups, are read."""
    file = tmp_path / "bench.csv"
    rows = ["4.000;2,085;985,5", "5.000;3,321;1.234,5", "6.000;{};2.000", "7.000;6,669;2.500,5"]
    text = "\n".join(["Drehzahl (1/min);Schub (N);Leistung (W)", *rows]) + "\n"
    file.write_text(text.format("5,910"))
    read = named(import_file(file))
    assert read.rpm.tolist() == [4000.0, 5000.0, 6000.0, 7000.0] and read.thrust_N[2] == 5.91
    assert read["electrical_power_W"].tolist() == [985.5, 1234.5, 2000.0, 2500.5]
    file.write_text(text.format("5.910"))
    with pytest.raises(InputError, match="bench.csv: 4:2: got '5.910' among the decimal commas"):
        import_file(file)

"""Shapes of files found in public repositories: read as they are, or refused with what to do. All text is made up."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.dataset import Dataset
from bemt.readers._headings import heading
from bemt.recordings.load import import_file

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
        ("I/A", "I_A", "A"), ("U/V", "U_V", "V"), ("T/K", "T_K", "K"), ("P/W", "P_W", "W"),
        ("Torque (N.m)", "torque_Nm", "Nm"),
        ("Thrust (Newtons)", "thrust_N", "N"), ("Torque (N-mm)", "torque_Nm", "Nm"), ("Temp (ºC)", "temp_K", "K"),
        ("Omega [rad s^-1]", "omega_rad_s", "rad_s"), ("ESC signal (Âµs)", "pulse_width_s", "s"),
        ("ESC throttle (μs)", "pulse_width_s", "s"), ("Throttle (us)", "pulse_width_s", "s"),
        ("Volts", "voltage_V", "V"),
        ("Amps", "current_A", "A"), ("Watts", "P_W", "W"), ("Rotation speed (rpm)", "rpm", "rpm"), ("Ct", "CT", "-"),
        ("time_since_start_s", "time_s", "s"), ("Electrical Speed (eRPM)", "electrical_rpm", "rpm"),
        ("Vibration (m/s²)", "vibration_m_s2", "m/s2"),
        # ratios, rotors and ambiguous units stay what they are
        ("r/R", "r/R", "-"), ("P/D", "P/D", "-"), ("Thrust A", "Thrust_A", ""), ("Current A", "Current_A", ""),
        ("Q/N", "Q/N", ""), ("n (1/s)", "n_1/s", ""), ("Thrust - g", "Thrust_g", ""), ("Force - X", "Force_X", ""),
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
    assert "when" in got.texts and said(got, "text, kept as such, in 1 columns: 'when'")


def test_a_comma_between_thousands_is_not_taken_for_a_decimal_one(write: Write) -> None:
    with pytest.raises(InputError, match="A comma between thousands"):
        import_file(write('rpm,thrust_N\n"1,000",1.5\n"2,000",4.5\n"3,000",9.5\n'))


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


def test_a_label_of_a_curve_may_be_bare(write: Write) -> None:
    text = '(title "F")\n(labels "Flow Time" "cl")\n\n((xy/key/label particle-1)\n0\t1\n0.1\t2\n0.2\t3\n)\n'
    assert "cl(particle-1)" in import_file(write(text, "f.xy")).values


def test_a_time_in_milliseconds_is_no_clock_in_seconds(write: Write) -> None:
    text = '(title "F")\n(labels "Flow Time (ms)" "cl")\n\n((xy/key/label "a")\n0\t1\n1\t2\n2\t3\n)\n'
    got = import_file(write(text, "f.xy"))
    assert got.unit("Flow Time (ms)(a)") == "ms" and "time_s(a)" not in got.values
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

"""Promises of known rotors: by name, one reading, class, and motor."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.app import cli
from bemt.base.errors import InputError
from bemt.base.units import G0, INCH
from bemt.data.readers.uiuc_names import FAMILIES
from bemt.judge.compare.one_run import compare_run
from bemt.physics.bem.model import MOST_PREPARED, PREPARED
from bemt.results.report.diagnosis_block import answer, verdict
from bemt.results.sweep.answer import summary
from bemt.results.sweep.case import solve_case
from bemt.rotors.case import Case, case_of, estimate, fresh, lattice, load_case
from bemt.rotors.case.load import with_changes
from bemt.rotors.case.motor import class_resistance, full_speed, known_mass_g, named_motor
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import propagate
from bemt.rotors.case.reading import parse_reading, with_reading
from bemt.rotors.conditioning import CAMPAIGN
from bemt.rotors.measured import find, measured_rotors, records
from bemt.rotors.model import coefficients
from bemt.rotors.propeller import rotor_of
from bemt.rotors.validate.points import measured
from bemt.tools.drive import drive_result
from geometry.common import GeometryError
from geometry.designation import parse_designation


def labelled(label: str, **more: str) -> Case:
    return case_of(fresh.label_text(label, **more), ends=False)  # type: ignore[arg-type]


# ---- names


@pytest.mark.parametrize(
    ("text", "kind", "width", "reverse", "maker"),
    [
        ("APC 10x12WE", "electric", 1, False, "APC"), ("APC 20.5x10.5WPN", "pattern", 1, False, "APC"),
        ("APC 9x4.5MRF-RH", "multirotor", 0, False, "APC"), ("APC 8x3.7SFR", "reversible", 0, False, "APC"),
        ("APC 5x4R-RH", "reversible", 0, False, "APC"), ("8045R SF", "slow_flyer", 0, True, ""),
        ("APC 8.75x9.25NN", None, -2, False, "APC"), ("APC 18x7WP", None, 1, True, "APC"),
        ("APC E V2 12x6", "electric", 0, False, "APC"), ("Tarot TL2822 18x5.5", None, 0, False, "Tarot TL2822"),
        ("Sport Klemm-2015V6 17.5x12.3", "sport", 0, False, "Sport Klemm-2015V6"),
        ("10x4.7 SF APC", "slow_flyer", 0, False, "APC"),
        ("Master Airscrew 3BL 9x7", None, 0, False, "Master Airscrew"),
    ],
)  # fmt: skip
def test_names_as_makers_and_databases_write_them(
    text: str, kind: str | None, width: int, reverse: bool, maker: str
) -> None:
    told = parse_designation(text)
    assert (told.blade_class, told.width, told.reverse, told.maker) == (kind, width, reverse, maker)


def test_a_name_with_two_sizes_is_refused() -> None:
    with pytest.raises(GeometryError, match="several sizes"):
        parse_designation("AeroCAM 18x6 18x4")


# ---- measured propellers


def test_a_measured_propeller_is_one_under_all_its_names() -> None:
    names = ("gwsdd_9x5", "GWS Direct Drive 9x5", "GWS HD 9x5", "gws direct drive 9 x 5")
    found = [labelled(name) for name in names]
    assert {case.file.blade.as_built.measured for case in found} == {"gwsdd_9x5"}  # type: ignore[union-attr]
    loads = [propagate(case, 5000.0, 6.0, bands=False).points.thrust_N[0] for case in found]
    assert np.ptp(loads) == 0.0
    assert [find(parse_designation(other)) for other in ("9x5", "APC 10x5", "GWS 9x5x3", "Nobody 9x5")] == [None] * 4


def test_every_listed_propeller_is_found_by_its_label() -> None:
    for one in measured_rotors():
        hit = find(parse_designation(one.label))
        assert one.family in FAMILIES and hit is not None
        assert (hit.family, hit.blades) == (one.family, one.blades) and one.name in one.source


@pytest.mark.parametrize("name", ["apce_10x5", "apcsp_10x8", "gwssf_9x7", "nr640_9_15deg_3b"])
def test_the_shipped_numbers_are_those_of_this_solver(name: str) -> None:
    """Else `reports/studies/measured_rotors.py` has to be run again."""
    one = records()[name]
    solve = coefficients(prepare_case(labelled(one.label)), labelled(one.label).air())
    here = solve(one.mean, one.rpm, one.at.J, np.arange(one.rpm.size))
    assert here == pytest.approx(one.at.f, rel=2e-3, abs=1e-4)


def test_the_other_measurement_halves_the_error(shared_data: Path) -> None:
    from bemt.data.readers import uiuc

    errors = []
    for p in uiuc.scan_folder(shared_data / "uiuc" / "volume-1").propellers:
        if p.name not in ("gwsdd_9x5", "apcsf_10x4.7", "apce_10x7"):
            continue
        static, rpm, J, CT, CP = measured(p)
        keep = (CT > 0.4 * CT.max()) & (CP > 0.0)
        for known in (True, False):
            case = case_of(fresh.label_text(p.name, measured=known), ends=False)
            V = J[keep] * rpm[keep] / 60.0 * case.diameter_m
            found = propagate(case, rpm[keep], V, 1.225).points
            miss = np.abs(np.array([found.CT / CT[keep], found.CP / CP[keep]]) - 1.0)
            errors.append([np.median(miss[:, kind], axis=1) for kind in (static[keep], ~static[keep])])
            if known:
                assert np.all((found.u["CT"] / found.CT)[static[keep]] > CAMPAIGN[0, 0])
    with_, without = np.array(errors[::2]), np.array(errors[1::2])
    assert np.all(np.median(with_, axis=0) < [[0.06, 0.02], [0.03, 0.03]])
    assert with_.mean() < 0.5 * without.mean()


# ---- one reading


def test_one_hover_makes_the_rotor_this_one() -> None:
    text = "rpm=5400, thrust_g=430"
    plain, own = labelled("10x5"), labelled("10x5", reading=text)
    before, after = (propagate(case, [5400.0, 7000.0], 0.0) for case in (plain, own))
    assert after.points.thrust_N[0] == pytest.approx(0.430 * G0, rel=0.01)
    # the same stand shows it again; another campaign differs
    assert (
        after.u_reading("CT")[0] < 0.5 * before.u_reading("CT")[0]
        and after.points.u["CT"][0] > after.u_reading("CT")[0]
    )
    assert after.points.u["CT"][1] < before.points.u["CT"][1]
    other = propagate(with_reading(plain, {"rpm": 5400, "thrust_g": 430}), [5400.0, 7000.0], 0.0)
    assert other.points.thrust_N == pytest.approx(after.points.thrust_N, rel=1e-9)
    row = estimate.of_label("10x5", [5400.0], reading=text).to_dict()["rows"][0]
    assert row["thrust_N"] == pytest.approx(after.points.thrust_N[0], rel=1e-9)
    drive = drive_result.with_drive(with_reading(rotor_of("10x5").case, text), kv=900, cells=3)
    assert propagate(drive, 5400.0, 0.0, bands=False).points.thrust_N[0] == pytest.approx(row["thrust_N"], rel=1e-9)


@pytest.mark.parametrize("times", [0.65, 1.45])
def test_what_is_expected_lies_between_the_label_and_a_far_reading(times: float) -> None:
    label = estimate.of_label("10x4.5", [6147.0]).thrust_N[0]
    told = estimate.of_label("10x4.5", [6147.0], reading={"rpm": 6147, "thrust_N": times * label}).thrust_N[0]
    assert 0.9 < (told - label) / (times * label - label) <= 1.0


@pytest.mark.parametrize(("power_W", "said"), [(71.6, False), (96.5, True)])
def test_a_power_that_no_such_shaft_takes_is_asked_for_its_motor(power_W: float, said: bool) -> None:
    doubt = labelled("10x4.5 SF", reading=f"rpm=6147,thrust_g=681,power_W={power_W}").as_built().doubt
    assert ("wattmeter" in doubt) == said


def test_a_reading_of_a_measured_propeller_keeps_what_was_measured() -> None:
    alone, measured_, both = (
        propagate(labelled(label, **more), 5400.0, 8.0)
        for label, more in (("10x5", {"reading": "rpm=5400,thrust_g=410"}), ("APC 10x5E", {}),
                            ("APC 10x5E", {"reading": "rpm=5400,thrust_g=410"}))
    )  # fmt: skip
    u = [float(found.points.u["CP"][0]) for found in (alone, measured_, both)]
    assert u[2] < 0.7 * u[0] and u[2] < 1.5 * u[1]


@pytest.mark.parametrize(
    ("text", "got"),
    [("rpm=5400", "a thrust"), ("thrust_g=400", "a speed"), ("rpm=5400,thrust_cm=4", "thrust_N"), ("5400,410", "rpm="),
     ("rpm=5400,thrust_g=x", "NUMBER"), ("", "rpm=")],
)  # fmt: skip
def test_what_is_no_reading_is_refused(text: str, got: str) -> None:
    with pytest.raises(InputError, match=got):
        parse_reading(text)


# ---- classes


@pytest.mark.parametrize(("door", "reading"), [
    ("estimate", "rpm=6000,thrust_g=4000"), ("new", "rpm=6000,thrust_g=4000"), ("estimate", "rpm=6000,thrust_g=5"),
    ("new", "rpm=54000,thrust_g=500"),
])  # fmt: skip
def test_a_reading_of_another_rotor_is_refused(
    door: str, reading: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ["--rpm", "6000"] if door == "estimate" else ["--out", str(tmp_path / "case")]
    assert cli.main([door, "10x5", *more, "--reading", reading]) == 2
    said = capsys.readouterr()
    assert "within a factor of 3" in said.err and not said.out
    assert "taken for N" not in said.err, "grams were typed"
    assert ("1 digit too many in the thrust?" in said.err) == ("thrust_g=4000" in reading)
    assert not (tmp_path / "case").exists()


def test_a_reading_far_outside_the_band_is_doubted_and_one_inside_it_is_not() -> None:
    seen = [estimate.of_label("10x5", 6000, reading=f"rpm=6000,thrust_g={g}").text for g in (450, 900)]
    assert ["standard deviations off" in text for text in seen] == [False, True]


def test_a_class_counts() -> None:
    CT = {label: propagate(labelled(label), 6000.0, 0.0, bands=False).points.CT[0]
          for label in ("10x4.5", "10x4.5MR", "10x4.5E", "10x4.5SF", "10x4.5W", "10x4.5N", "10x4.5R-RH")}  # fmt: skip
    assert CT["10x4.5R-RH"] < CT["10x4.5N"] < CT["10x4.5"] < CT["10x4.5W"] < CT["10x4.5MR"] < CT["10x4.5SF"]
    bands = {label: propagate(labelled(label), 6000.0, 0.0).points for label in ("10x4.5", "10x4.5E")}
    assert bands["10x4.5E"].u["CT"][0] < 0.9 * bands["10x4.5"].u["CT"][0]


def test_three_blades_of_racers_are_those_of_a_stand(shared_data: Path) -> None:
    miss = []
    for number, label in ((1, "Cyclone 5x4x3"), (2, "Cyclone 5x4.5x3"), (3, "Gemfan 5x4.5x3")):
        with (shared_data / "rcbenchmark" / f"a{number}_11.csv").open(encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
        rpm, gf = (
            np.array([float(r[key] or 0) for r in rows]) for key in ("Motor Electrical Speed (RPM)", "Thrust (gf)")
        )
        keep = rpm > 0.5 * rpm.max()
        CT = gf[keep] * 1e-3 * G0 / (1.225 * (rpm[keep] / 60.0) ** 2 * (5 * INCH) ** 4)
        found = propagate(labelled(label), rpm[keep], 0.0, 1.225)
        miss.append(float(np.median(np.abs(found.points.CT / CT - 1.0))))
        assert np.all(np.abs(found.points.CT - CT) < found.reading95("CT"))
    assert np.median(miss) < 0.12


# ---- the motor


def test_one_motor_turns_a_smaller_propeller_faster() -> None:
    small, large = (
        drive_result.solve(drive_result.with_drive(rotor_of(label).case, kv=920, cells=3, motor_mass_g=80))
        for label in ("9x4", "12x6")
    )
    assert small.drive.motor.resistance_ohm == pytest.approx(large.drive.motor.resistance_ohm)
    for one in (small, large):  # by hand: k (I - I0) is the torque at the speed that U - R I leaves
        motor, n = one.drive.motor, one.full["rpm"].value
        volts = float(one.drive.battery.voc(0.5)) - one.drive.battery_ohm * one.full["battery_A"].value
        amps = (volts - n / 920.0) / motor.resistance_ohm
        assert amps == pytest.approx(one.full["battery_A"].value, rel=0.01)
        load = propagate(one.case, n, 0.0, bands=False).points.torque_Nm[0]
        assert float(motor.k()) * (amps - motor.no_load_A) == pytest.approx(load, rel=0.01)
        assert full_speed(one.case) == pytest.approx(n, rel=2e-3)
    assert small.full["rpm"].value > 1.2 * large.full["rpm"].value
    assert small.full["battery_A"].value < 0.5 * large.full["battery_A"].value


def test_the_class_of_a_motor_is_its_mass_if_known() -> None:
    table = drive_result.with_drive(rotor_of("9x4").case, kv=920, cells=3).file.drive
    heavy = drive_result.with_drive(rotor_of("9x4").case, kv=920, cells=3, motor_mass_g=120).file.drive
    assert table is not None and heavy is not None
    assert class_resistance(10.0, 920.0, known_mass_g(heavy.motor)) < class_resistance(10.0)
    assert np.isnan(known_mass_g(table.motor))


@pytest.mark.parametrize("V", [0.0, 15.0])
def test_a_motor_of_which_only_kv_is_known_is_one_to_choose_and_to_drive(V: float) -> None:
    """Full throttle is one number, and the motor the same one at rest and in flight."""
    still, flying = (bemt.drive("10x6", kv=1100, cells=3, airspeed_m_s=v) for v in (0.0, V))
    assert flying.drive.motor == still.drive.motor and flying.drive.battery == still.drive.battery
    row = bemt.choose(4.0, 3, labels=["10x6"], kv=1100, airspeed_m_s=V).to_pandas().iloc[0]
    assert row.full_thrust_N == pytest.approx(flying.full["thrust_N"].value, rel=0.01)
    assert row.peak_A == pytest.approx(flying.full["battery_A"].value, rel=0.01)
    case = drive_result.with_drive(rotor_of("10x6").case, kv=1100, cells=3)
    there = with_changes(case, {"operating.airspeed_m_s": V})
    assert full_speed(there) == pytest.approx(flying.full["rpm"].value, rel=3e-3)


def test_a_motor_by_name() -> None:
    pytest.importorskip("pythrust", reason="the optional package setuav-pythrust is not installed")
    one = named_motor("T-Motor MN2212 920")
    assert one.kv == 920.0 and one.resistance_mohm and one.no_load_A and "Apache-2.0" in one.source
    motor = drive_result.solve(
        drive_result.with_drive(rotor_of("9x4.5").case, "T-Motor MN2212 920", cells=3)
    ).drive.motor
    assert motor.kv_rpm_V == 920.0 and motor.resistance_ohm == pytest.approx(1e-3 * one.resistance_mohm)
    with pytest.raises(InputError, match="KV780"):
        named_motor("MN2212")


# ---- waiting


def test_a_new_speed_needs_no_new_tables() -> None:
    case = labelled("10x5")
    lattice.solve(case, np.array([6000.0]), np.zeros(1), None)
    made = PREPARED.made
    for rpm in (3000.0, 4321.0, 9000.0, 11000.0):
        lattice.solve(case, np.array([rpm]), np.zeros(1), None)
    assert PREPARED.made == made and PREPARED.size <= PREPARED.most and MOST_PREPARED <= 200e6


def test_a_comparison_with_what_the_rotor_was_fitted_to_is_said_to_be_no_check(tmp_path: Path) -> None:
    """A rotor as UIUC measured it agrees with UIUC's readings because it was fitted to them."""
    for name, label in (("known", "APC SF 10x4.7"), ("label", "10x4.7")):
        bemt.new(label, out=tmp_path / name)
    (tmp_path / "run.csv").write_text("rpm,thrust [N],torque [N m]\n5000,4.3,0.07\n6000,6.2,0.1\n7000,8.6,0.14\n")
    paths = [tmp_path / name / "case.toml" for name in ("known", "label")]
    known, label = (compare_run(str(tmp_path / "run.csv"), load_case(path)) for path in paths)
    assert "no independent check" in known.notes[0] and "apcsf_10x4.7" in known.notes[0]
    assert not any("no independent check" in note for note in label.notes)
    (tmp_path / "known" / "references.csv").write_text(
        "quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3\n"
        "thrust,6.2,N,0.2,bench,UIUC,,6000,0,1.225\n"
    )
    text = paths[0].read_text()
    paths[0].write_text(text.replace('name = "', 'references = "references.csv"\nname = "', 1))
    result = solve_case(load_case(paths[0]))
    for told in (summary([result]), answer(result), verdict(result)[2]):
        assert "no independent check" in " ".join(told.split())

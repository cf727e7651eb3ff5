"""Drives and thrusters: closed forms, energy, limits, real maps and steps."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import drive_identify
import drive_recordings
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.physics import effects
from bemt.rotors.case import load_case
from bemt.rotors.propeller import rotor_of
from bemt.tools.drive import drive_model, drive_result, mission
from bemt.tools.drive.bench_map import map_points
from bemt.tools.drive.drive_model import EFFECTS, Battery, Drive, Esc, Motor
from bemt.tools.drive.thrusters_result import Thruster, allocate, attainable, effectiveness, moment_at

FLAT = dict(soc_table=(0.0, 1.0), ocv_V=(3.7, 3.7))
PULSE = np.linspace(1050.0, 2000.0, 20)


def coefficients(CT: float, CQ: float, D: float, *more: float) -> drive_model.RotorMap:
    """Rotor of constant coefficients in 1.225 kg/m3; more: inertia, solidity."""
    turn = (2.0 * math.pi) ** 2
    return drive_model.quadratic(1.225 * CT * D**4 / turn, 1.225 * CQ * D**5 / turn, D, 1.225, *more)


def drive(**changes: object) -> Drive:
    """Ordinary 4S drive of an 8 in propeller."""
    parts = {
        "battery": Battery(4, 0.02, 2.2),
        "esc": Esc(resistance_ohm=0.005, idle_A=0.05),
        "motor": Motor(1100.0, 0.06, 0.8, 1.2e-5, 25.0, 4.0),
        "rotor": coefficients(0.11, 0.0082, 0.2032, 1.5e-5, 0.09),
    }
    return Drive(**{**parts, **changes})  # type: ignore[arg-type]


def test_without_load_the_motor_turns_at_kv_times_voltage() -> None:
    free = drive(
        battery=Battery(4, 0.0, **FLAT), motor=Motor(1000.0, 0.1, 0.0), rotor=drive_model.quadratic(0.0, 0.0, 0.2)
    )
    assert np.allclose(free.steady(PULSE).rpm, 1000.0 * 14.8 * (PULSE - 1000.0) / 1000.0, rtol=1e-9)


def test_steady_speed_is_the_root_of_the_quadratic() -> None:
    """k^2/R omega + kQ omega^2 + k I0 = k d V/R for constant coefficients."""
    d = drive(battery=Battery(4, 0.0, **FLAT), esc=Esc())
    k, R, kQ = float(d.motor.k()), 0.06, float(d.rotor.torque(1.0))
    c = k * 14.8 * (PULSE - 1000.0) / 1000.0 / R - k * 0.8
    b = k * k / R
    omega = (-b + np.sqrt(b * b + 4.0 * kQ * np.maximum(c, 0.0))) / (2.0 * kQ)
    assert np.allclose(d.steady(PULSE).rpm, omega * 30.0 / math.pi, rtol=1e-9)


def test_power_is_accounted_for() -> None:
    d = drive()
    s = d.steady(PULSE)
    omega = s.rpm * math.pi / 30.0
    copper = s.motor_A**2 * (0.06 + 0.005)
    friction = float(d.motor.k()) * 0.8 * omega
    assert np.allclose(s.power_W, s.torque_Nm * omega + copper + friction + 0.05 * s.voltage_V, rtol=1e-9)
    assert np.allclose(s.voltage_V, d.battery.voc(1.0) - 0.02 * s.battery_A)
    assert np.all((s.efficiency > 0.0) & (s.efficiency < 1.0)) and np.all(np.diff(s.thrust_N) > 0.0)


def test_the_current_limit_holds_and_says_so() -> None:
    free, tied = drive(), drive(esc=Esc(resistance_ohm=0.005, idle_A=0.05, current_limit_A=15.0))
    a, b = free.steady(PULSE), tied.steady(PULSE)
    assert np.max(a.battery_A) > 20.0 and np.max(b.battery_A) == pytest.approx(15.0, rel=1e-6)
    assert np.array_equal(b.limited, a.battery_A > 15.0) and np.allclose(b.rpm[~b.limited], a.rpm[~b.limited])


def test_too_small_a_duty_does_not_start_the_motor() -> None:
    s = drive(motor=Motor(1100.0, 0.5, 2.0)).steady([1000.0, 1020.0, 1200.0])
    assert list(s.rpm[:2] == 0.0) == [True, True] and s.rpm[2] > 0.0 and np.all(s.converged)


def test_pulse_for_is_the_inverse() -> None:
    d = drive()
    for wanted in (0.5, 3.0, 9.0):
        assert d.steady(d.pulse_for(wanted)).thrust_N[0] == pytest.approx(wanted, rel=1e-6)
    assert math.isnan(d.pulse_for(1000.0))


def test_beyond_the_rotor_table_is_nan_and_flagged() -> None:
    table = replace(drive().rotor, omega_max=500.0)
    s = drive(rotor=table).steady([1100.0, 2000.0])
    assert s.converged.tolist() == [True, False] and np.isnan(s.thrust_N[1]) and np.isnan(s.rpm[1])


def test_speed_without_load_rises_with_the_motor_time_constant() -> None:
    """J R / k^2: the textbook time constant of a motor without load."""
    J = 2e-5
    free = drive(
        battery=Battery(4, 0.0, **FLAT),
        esc=Esc(),
        motor=Motor(1100.0, 0.06, 0.0, J),
        rotor=drive_model.quadratic(0.0, 0.0, 0.2),
    )
    tau = J * 0.06 / float(free.motor.k()) ** 2
    t = np.linspace(0.0, 12.0 * tau, 6001)
    got = mission.simulate(free, [(0.0, 1200.0), (2.0 * tau, 1800.0)], t[-1], t)
    assert mission.time_to(t, got.rpm, 2.0 * tau) == pytest.approx(tau, rel=2e-3)


def test_a_rotor_without_brake_coasts_down_on_its_drag() -> None:
    """J dOmega/dt = -k_Q Omega^2: Omega_0 / (1 + k_Q Omega_0 t / J); any throttle brings the brake back."""
    kQ, J, t = 2e-8, 1e-5, np.linspace(0.0, 0.5, 501)
    coasting = drive(
        battery=Battery(4, 0.0, **FLAT),
        esc=Esc(brake_on_stop=0.0),
        motor=Motor(1100.0, 0.06, 0.0, J),
        rotor=drive_model.quadratic(1e-6, kQ, 0.2),
    )
    stop = [(0.0, 1600.0), (0.1, 1000.0)]
    got = mission.simulate(coasting, stop, 0.5, t)
    start = got.rpm[0] * np.pi / 30.0
    expected = got.rpm[0] / (1.0 + kQ * start * np.maximum(t - 0.1, 0.0) / J)
    assert got.rpm == pytest.approx(expected, rel=1e-4)
    idle = mission.simulate(coasting, [stop[0], (0.1, 1000.001)], 0.5, t)
    braked = mission.simulate(replace(coasting, esc=Esc()), stop, 0.5, t)
    assert idle.rpm[-1] < 0.1 * got.rpm[-1]
    assert idle.rpm[150:400] == pytest.approx(braked.rpm[150:400], rel=1e-2, abs=20)
    half = mission.simulate(replace(coasting, esc=Esc(brake_on_stop=0.5)), stop, 0.5, t)
    assert braked.rpm[150] < half.rpm[150] < got.rpm[150]


def test_a_long_step_ends_in_the_steady_state() -> None:
    d = replace(drive(), off=frozenset({"motor_heating"}), battery=Battery(4, 0.02))
    got = mission.simulate(d, [(0.0, 1300.0), (0.2, 1700.0)], 1.5)
    assert got.converged and got.thrust_N[-1] == pytest.approx(d.steady(1700.0).thrust_N[0], rel=1e-5)
    assert got.thrust_N[0] == pytest.approx(d.steady(1300.0).thrust_N[0], rel=1e-9)


def test_charge_heat_and_energy_are_conserved() -> None:
    d = drive()
    got = mission.simulate(d, [(0.0, 1600.0)], 30.0, np.linspace(0.0, 30.0, 601))
    drawn = np.trapezoid(got.battery_A, got.time_s) / 3600.0 / 2.2
    assert 1.0 - got.soc[-1] == pytest.approx(drawn, rel=1e-4)
    loss = d.motor.resistance(got.temperature_C) * got.motor_A**2
    kept = 25.0 * (got.temperature_C[-1] - 25.0) + np.trapezoid((got.temperature_C - 25.0) / 4.0, got.time_s)
    assert kept == pytest.approx(np.trapezoid(loss, got.time_s), rel=1e-4)


def test_each_effect_does_what_its_name_says_and_nothing_when_off() -> None:
    assert set(EFFECTS) <= set(effects.catalogue())  # the ids of the diagnosis
    d = drive()
    steps, end = [(0.0, 1200.0), (0.05, 1700.0)], 3.0
    t = np.linspace(0.0, end, 3001)
    full = mission.simulate(d, steps, end, t)
    off = {name: mission.simulate(d.without(name), steps, end, t) for name in EFFECTS}
    early, late = (t > 0.05) & (t < 0.12), t > 2.5
    assert np.all(off["battery_sag"].thrust_N[late] > full.thrust_N[late]) and np.all(off["battery_sag"].soc == 1.0)
    assert np.all(off["motor_heating"].temperature_C == 25.0) and full.temperature_C[-1] > 26.0
    assert mission.time_to(t, off["rotor_inertia"].thrust_N, 0.05) < 0.1 * mission.time_to(t, full.thrust_N, 0.05)
    # the inflow comes late: thrust at a given speed is higher while it rises
    over = full.thrust_N - d.rotor.thrust(full.rpm * math.pi / 30.0)
    none = off["inflow_lag"].thrust_N - d.rotor.thrust(off["inflow_lag"].rpm * math.pi / 30.0)
    assert np.max(over[early]) > 0.02 * full.thrust_N[-1] and np.allclose(none, 0.0, atol=1e-9)
    with pytest.raises(ValueError, match="expected battery_sag"):
        d.without("gravity")


def test_sag_and_heat_change_the_speed_as_the_effects_of_the_diagnosis_say() -> None:
    """(1 - lost)(1 + u) = b y + u r y^2 / b: battery_sag (b = r = 1) and motor_heating (lost = 0)."""
    d = drive(battery=Battery(4, 0.0, **FLAT), esc=Esc(), motor=Motor(1100.0, 0.06, 0.0))
    base = d.steady(PULSE)
    u = 0.06 * base.torque_Nm / float(d.motor.k()) ** 2 / (base.rpm * math.pi / 30.0)
    low = replace(d, battery=Battery(4, 0.0, soc_table=(0.0, 1.0), ocv_V=(3.33, 3.33))).steady(PULSE)
    c = 0.9 * (1.0 + u)
    assert np.allclose(low.rpm / base.rpm, 2.0 * c / (1.0 + np.sqrt(1.0 + 4.0 * u * c)), rtol=1e-9)
    warm = d.steady(PULSE, temperature_C=65.0)
    b, r = 1.0 - 0.001 * 40.0, 1.0 + 0.0039 * 40.0
    y = 2.0 * (1.0 + u) / (b + np.sqrt(b**2 + 4.0 * (u * r / b) * (1.0 + u)))
    assert np.allclose(warm.rpm / base.rpm, y, rtol=1e-9)


def test_hover_and_endurance() -> None:
    d = drive()
    h = mission.hover(d, 1.2, 4, 1.0)
    assert d.steady(h.pulse_us).thrust_N[0] == pytest.approx(1.2 * 9.80665 / 4)
    time, end = mission.endurance(d, 1.2, 4, 1.0, 0.2)
    assert end == pytest.approx(0.2) and time == pytest.approx(3600 * 2.2 * 0.8 / h.battery_A, rel=0.15)
    flat = drive(battery=Battery(4, 0.02, 2.2, **FLAT))  # constant voltage: exactly charge over current
    amps = mission.hover(flat, 1.2, 4, 1.0).battery_A
    assert mission.endurance(flat, 1.2, 4, 1.0, 0.2)[0] == pytest.approx(3600 * 2.2 * 0.8 / amps, rel=1e-6)
    most = float(d.steady(2000.0, 0.6).thrust_N[0]) * 4 / 9.80665  # a mass that needs a charge of 60 %
    assert mission.endurance(d, most, 4, 1.0, 0.2)[1] == pytest.approx(0.6, abs=1e-3)
    assert math.isnan(mission.endurance(d, 100.0, 4, 1.0, 0.2)[0])


@pytest.mark.parametrize("ripple", [math.inf, 0.4])
def test_a_planted_drive_is_found_from_its_thrust_map(ripple: float) -> None:
    truth = drive(
        battery=Battery(1, 0.03, soc_table=(0.0, 1.0), ocv_V=(15.0, 15.0)),
        esc=Esc(1040.0, 1940.0, braking=math.isinf(ripple), ripple_ohm=ripple),
    )
    s = truth.steady(PULSE)
    recorded = {"thrust_N": s.thrust_N, "rpm": s.rpm, "current_A": s.battery_A, "voltage_V": s.voltage_V}
    points = map_points(PULSE, recorded)
    fit = drive_identify.fit_map(points, {"kv_rpm_V": 1100.0, "no_load_A": 0.8}, s.torque_Nm)
    assert fit.fitted["pulse_min_us"] == pytest.approx(1040.0, abs=2.0)
    assert fit.fitted["pulse_max_us"] == pytest.approx(1940.0, abs=2.0)
    assert fit.fitted.get("ripple_ohm", math.inf) == pytest.approx(ripple, rel=0.02)
    assert fit.drive.esc.braking == math.isinf(ripple)
    assert fit.fitted["resistance_ohm"] == pytest.approx(0.06, abs=0.002)
    assert fit.fitted["battery_ohm"] == pytest.approx(0.03, rel=1e-6)
    off = fit.drive.steady(points.pulse_us).thrust_N - points.thrust_N
    assert np.max(np.abs(off)) < 1e-3 * fit.full_thrust_N


def test_a_planted_inertia_is_found_from_a_step() -> None:
    d = drive(motor=Motor(1100.0, 0.06, 0.8, 3e-5))
    t = np.arange(0.0, 1.0, 0.01)
    rotor = replace(d.rotor, inertia_kg_m2=0.0)
    got = mission.simulate(replace(d, rotor=rotor), [(0.0, 1200.0), (0.305, 1600.0)], t[-1], t)
    inertia, _ = drive_identify.fit_inertia(d, t, got.thrust_N, 1200.0, 1600.0)
    assert inertia == pytest.approx(3e-5, rel=0.03)


def test_the_rotor_of_a_case_is_the_solver_s(project: Path) -> None:
    from bemt.rotors.case.prepare import prepare_case

    case = load_case(project / "cases" / "prop_8x5" / "case.toml")
    rpm = np.array([4000.0, 9000.0, 20000.0])
    points = prepare_case(case).solve(rpm, 0.0, case.air())
    at, V = drive_model.points(case.diameter_m, 20000.0, 0.0)
    loads = prepare_case(case).solve(at, V, case.air())
    table = drive_model.from_loads(case, at, V, loads.thrust_N, loads.torque_Nm, 1.225)
    assert np.allclose(table.thrust(rpm * math.pi / 30.0), points.thrust_N, rtol=5e-3)
    assert np.allclose(table.torque(rpm * math.pi / 30.0), points.torque_Nm, rtol=5e-3)
    assert table.slope_law is not None and np.all(table.slope_law(rpm * math.pi / 30.0) < 0.0)


def test_command_on_the_fan(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["drive", str(project / "cases" / "ds30"), "--json", "--out", str(out)]) == 1  # it cannot hover
    doc = json.loads(capsys.readouterr().out)
    assert doc["schema"] == "bemt.drive.result/2" and doc["hover"]["throttle"]["value"] is None
    assert doc["hover"]["thrust_N"]["value"] == pytest.approx(6.5 * 9.80665 / 2)
    assert "drive.motor.resistance_mohm" in doc["unknowns"] and len(doc["steady"]["thrust_N"]) == 21
    assert {p.name for p in out.iterdir()} == {"drive.json", "drive.csv", "drive.png"}


def fan(project: Path, folder: Path, *changes: tuple[str, str]) -> str:
    """Copy of the fan's case with parts of its text changed."""
    text = (project / "cases" / "ds30" / "case.toml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text(text.replace('references = "references.csv"\n', ""))
    return str(folder)


def test_faults_of_the_drive_come_all_at_once(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = ("resistance_mohm = 12.5", "resistance_mohm = 0.0125")
    bad = fan(project, tmp_path / "bad", ("cells = 6", "cells = 0"), small, ("thermal_K_W = 1.0 ", "thermal = 1 "))
    assert main(["drive", bad]) == 2
    words = capsys.readouterr().err
    assert all(w in words for w in ("drive.cells", "motor.resistance_mohm", "Write milliohm", "motor.thermal"))
    both = fan(project, tmp_path / "both", ("no_load_A = 3.5", "no_load_A = 3.5\nidle_share = 0.1"))
    assert main(["drive", both]) == 2
    assert "drive.motor.idle_share: got 0.1; expected nothing" in capsys.readouterr().err
    assert main(["drive", str(project / "cases" / "ds30"), "--off", "wind"]) == 2
    assert main(["drive", str(project / "cases" / "prop_8x5")]) == 2  # no motor
    assert "--kv: got nothing" in capsys.readouterr().err


def test_steps_need_something_that_turns() -> None:
    with pytest.raises(InputError, match="inertia_kg_m2"):
        still = drive(motor=Motor(1100.0, 0.06), rotor=coefficients(0.1, 0.01, 0.2))
        mission.simulate(still, [(0.0, 1200.0)], 1.0)


def test_through_diodes_the_current_stops_and_power_is_still_accounted_for() -> None:
    """Where the ripple is larger than the current; the textbook's M = 2/(1 + sqrt(1 + 4 K/d^2)) without resistance."""
    esc = Esc(idle_A=0.05, braking=False, ripple_ohm=0.4)
    d = drive(esc=esc)
    s = d.steady(PULSE)
    omega = s.rpm * math.pi / 30.0
    k, amps, bus = float(d.motor.k()), s.motor_A, s.battery_A - 0.05
    share = s.duty * amps / bus  # of the period in which the current flows
    stops = share < 1.0 - 1e-9
    assert stops[0] and not stops[-1] and np.all(s.rpm[stops] > drive(esc=Esc(idle_A=0.05)).steady(PULSE).rpm[stops])
    assert np.allclose(share, np.minimum(1.0, s.duty + amps * 0.4 / (s.duty * s.voltage_V)))
    assert np.allclose(s.voltage_V * bus, k * omega * amps + 0.06 * amps**2 / share)
    ideal = drive(battery=Battery(4, 0.0, **FLAT), esc=replace(esc, idle_A=0.0), motor=Motor(1100.0, 1e-6, 0.8))
    s = ideal.steady(PULSE)
    ratio = s.rpm / 1100.0 / 14.8
    stops = ratio > s.duty + 1e-6
    K = 0.4 / (ratio * 14.8 / s.motor_A)
    assert 3 < np.count_nonzero(stops) < 19
    assert np.allclose(ratio[stops], 2.0 / (1.0 + np.sqrt(1.0 + 4.0 * K[stops] / s.duty[stops] ** 2)), rtol=1e-4)


def test_a_shorted_motor_brakes_strongest_where_reactance_equals_resistance() -> None:
    """I = k Omega R/(R^2 + X^2)."""
    d = drive(esc=Esc(), motor=Motor(1100.0, 0.06, 0.8, reactance_ohm_s=6e-5))
    omega = np.linspace(10.0, 4000.0, 400)
    amps, bus, _ = d.currents(np.zeros(400), omega, np.full(400, 16.8), np.full(400, 25.0))
    assert np.allclose(amps, -float(d.motor.k()) * omega * 0.06 / (0.06**2 + (6e-5 * omega) ** 2))
    assert omega[np.argmin(amps)] == pytest.approx(0.06 / 6e-5, rel=0.02) and np.all(bus == 0.0)


def test_one_motor_and_esc_with_two_propellers(shared_data: Path, tmp_path: Path) -> None:
    """The recordings with 10 and 14 in, fitted apart, give one resistance and one ripple, and hold within 5 %."""
    name = "mit_copter_rcbenchmark"
    (tmp_path / name).symlink_to((shared_data / name).resolve())
    ten, fourteen = drive_recordings.maps(tmp_path)
    assert ten.worst < 0.05 and fourteen.worst < 0.05
    for key in ("ripple_ohm", "resistance_ohm"):
        assert ten.fitted[key] == pytest.approx(fourteen.fitted[key], rel=0.1)


@pytest.mark.slow
def test_real_thrust_maps_within_five_percent(shared_data: Path, tmp_path: Path) -> None:
    for folder in ("jmajew", "thrust_map"):
        (tmp_path / folder).symlink_to((shared_data / folder).resolve())
    found = {m.name: m.worst for m in drive_recordings.maps(tmp_path)}
    for name in ("xNova steps (to 1600 us)", "xNova ramp (to 1800 us)"):
        assert found[name] < 0.05, name
    apart = [worst for name, worst in found.items() if name.startswith("jmajew")]
    assert len(apart) == 10 and max(apart) < 0.05


def test_no_drive_without_a_solution_is_fitted(shared_data: Path) -> None:
    points, torque = drive_recordings._read(shared_data / "rcbenchmark" / "StepsTest_2020-06-16_212137.csv")
    assert np.isfinite(drive_identify.fit_map(points, None, torque).drive.steady(points.pulse_us).thrust_N).all()


@pytest.mark.slow
def test_time_constants_of_real_steps(shared_data: Path) -> None:
    """All five within 20 %: rises, the falls to no throttle (softer brake) and the fall to idle (full brake)."""
    checks, fitted = drive_recordings.steps(shared_data)
    assert [c.log[:4] for c in checks] == ["0500", "0500", "incr", "incr", "incr"] and all(c.resolved for c in checks)
    assert all(abs(c.ratio - 1.0) < 0.2 for c in checks)
    assert 0.6 < fitted.esc.brake_on_stop < 0.8


@pytest.mark.parametrize("airspeed", ["nan", "inf", "-inf", "-300", "-100.1", "300.1", "1e+09"])
def test_an_airspeed_that_nothing_flies_at_is_refused_with_all_other_faults(
    project: Path, tmp_path: Path, airspeed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    case, out = str(project / "cases" / "ds30"), tmp_path / "out"
    assert main(["drive", case, f"--airspeed-m-s={airspeed}", "--off", "wind", "--out", str(out)]) == 2
    words = capsys.readouterr().err
    assert f"--airspeed-m-s: got {airspeed}; expected a number from -100 to 300 m/s" in words
    assert ("km/h?" in words) == (airspeed == "300.1")
    assert "--off: got 'wind'" in words and not out.exists()


@pytest.mark.parametrize(("airspeed", "known"), [(100.0, True), (300.0, False)])
def test_an_airspeed_beyond_the_drive_is_answered(project: Path, tmp_path: Path, airspeed: float, known: bool) -> None:
    result = drive_result.solve(load_case(project / "cases" / "ds30" / "case.toml"), airspeed)
    drive_result.write(result, tmp_path / "out")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"drive.json", "drive.csv", "drive.png"}
    doc, words = json.loads((tmp_path / "out" / "drive.json").read_text()), result.text
    assert not result.reached and doc["response"] == [] and doc["hover"]["throttle"]["value"] is None
    full = doc["steady"]["thrust_N"][-1]
    # 100 m/s turns the fan faster than the battery does: drag; above, faster than its table reaches
    assert (full is not None and full < 0.0) if known else full is None
    assert doc["steady"]["converged"][-1] is known
    assert f"at {airspeed:g} m/s" in doc["notes"][-1] and "does not hold this airspeed" in doc["notes"][-1]
    assert "does not hold this airspeed" in words and "runs away" not in words
    assert ("gives an unknown maximum" in words) is not known and " nan " not in words


def test_results_never_replace_the_case(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fan(project, tmp_path)
    file = (tmp_path / "case.toml").rename(tmp_path / "drive.json")  # TOML inside: the name is the user's
    before = file.read_text()
    assert main(["drive", str(file), "--out", str(tmp_path)]) == 2
    assert "drive.json, which this run reads" in capsys.readouterr().err
    assert file.read_text() == before and len(list(tmp_path.iterdir())) == 1


# Thrusters on a body: commands met where they can be, the nearest by priority where not, the numbers of the case.


PAIR = [Thruster(0.2, 27.0), Thruster(-0.2, 27.0)]


def test_the_numbers_of_the_thesis() -> None:
    assert moment_at(0.2, 27.0) == pytest.approx(5.4)
    assert np.allclose(moment_at([0.1, 0.3], 27.0), [2.7, 8.1])
    got = allocate(PAIR, 27.0, 5.4)
    assert got.met and got.thrust_N == pytest.approx([27.0, 0.0], abs=1e-6)
    assert allocate(PAIR, 40.0, 2.0).thrust_N == pytest.approx([25.0, 15.0])


def test_two_thrusters_have_one_answer() -> None:
    for force, moment in ((10.0, 1.0), (30.0, -2.0), (54.0, 0.0), (0.0, 0.0)):
        got = allocate(PAIR, force, moment)
        assert got.met
        assert got.thrust_N == pytest.approx([force / 2 + moment / 0.4, force / 2 - moment / 0.4], abs=1e-6)


def test_beyond_the_limits_priority_decides() -> None:
    moment_first = allocate(PAIR, 58.8, 2.0, "moment")
    assert not moment_first.met and moment_first.moment_Nm == pytest.approx(2.0)
    assert moment_first.force_N == pytest.approx(54.0 - 2.0 / 0.2) and moment_first.saturated.tolist() == [True, False]
    force_first = allocate(PAIR, 58.8, 2.0, "force")
    assert force_first.force_N == pytest.approx(54.0) and force_first.moment_Nm == pytest.approx(0.0, abs=1e-6)
    assert allocate(PAIR, 0.0, 9.0).moment_Nm == pytest.approx(5.4)
    assert allocate(PAIR, 20.0, 9.0, "force").moment_Nm == pytest.approx(4.0)


def test_more_thrusters_share_with_the_least_squares() -> None:
    four = [Thruster(y, 10.0) for y in (0.3, 0.1, -0.1, -0.3)]
    got = allocate(four, 20.0, 1.0)
    exact = np.linalg.pinv(effectiveness(four)) @ [20.0, 1.0]  # no limit acts
    assert got.met and got.thrust_N == pytest.approx(exact, abs=1e-6)


def test_canted_and_lifted_thrusters() -> None:
    b = effectiveness([Thruster(0.2, 27.0, z_m=0.1, cant_rad=math.radians(30.0))])
    assert b[:, 0] == pytest.approx([math.cos(math.pi / 6), 0.2 * math.cos(math.pi / 6) - 0.1 * 0.5])


finite = st.floats(-1.0, 1.0)
bodies = st.lists(st.tuples(finite, st.floats(0.5, 50.0), st.floats(-0.9, 0.4)), min_size=1, max_size=5)


@settings(max_examples=60, deadline=None)
@given(bodies, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.sampled_from(["moment", "force"]))
@example([(3.6e-20, 1.0, 0.0)], 0.0, 0.0, "moment")  # an arm that is rounding
def test_any_body_stays_within_its_limits_and_meets_what_is_attainable(
    body: list[tuple[float, float, float]], f: float, m: float, priority: str
) -> None:
    group = [Thruster(y, top, top * low) for y, top, low in body]
    corners = attainable(group)
    assert np.allclose(corners[0], corners[-1], atol=1e-9)
    got = allocate(group, f * 50.0, m * 20.0, priority)
    assert all(t.thrust_min_N - 1e-9 <= v <= t.thrust_max_N + 1e-9 for t, v in zip(group, got.thrust_N, strict=True))
    assert np.allclose(effectiveness(group) @ got.thrust_N, [got.force_N, got.moment_Nm], atol=1e-9)
    row, low, high = (
        (1, corners[:, 1].min(), corners[:, 1].max())
        if priority == "moment"
        else (0, corners[:, 0].min(), corners[:, 0].max())
    )
    nearest = np.clip((f * 50.0, m * 20.0)[row], low, high)
    assert (got.force_N, got.moment_Nm)[row] == pytest.approx(nearest, abs=2e-5 * max(1.0, high - low))
    # what thrusts give is met when asked for
    inside = effectiveness(group) @ np.array([0.5 * (t.thrust_min_N + t.thrust_max_N) for t in group])
    assert allocate(group, *map(float, inside), priority).met


def test_command(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = str(project / "cases" / "ds30")
    assert main(["thrusters", case, "--json", "--out", str(tmp_path)]) == 0
    doc = json.loads(capsys.readouterr().out)
    at = next(row for row in doc["mounting"] if abs(row["distance_m"] - 0.2) < 1e-9)
    assert at["moment_one_Nm"] == pytest.approx(5.4) and at["moment_one_kgf_m"] == pytest.approx(0.5506, abs=1e-4)
    assert {p.name for p in tmp_path.iterdir()} == {"thrusters.json", "mounting.csv", "thrusters.png"}
    assert main(["thrusters", case, "--force-N", "58.8"]) == 1  # 6 kgf are beyond two of 27 N
    assert "beyond the thrusters" in capsys.readouterr().out


def test_faults_come_all_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "thrusters.toml"
    path.write_text('schema = "bemt.thrusters/1"\n[body]\nnam = "x"\n[[thruster]]\ny = 0.2\nthrust_max_N = -3\n')
    assert main(["thrusters", str(path)]) == 2
    words = capsys.readouterr().err
    assert all(w in words for w in ("body.nam", "thruster[0].y", "thruster[0].thrust_max_N"))
    assert main(["thrusters", str(path), "--force-N=nan", "--moment-Nm=-1e300"]) == 2
    words = capsys.readouterr().err
    limits = "expected a number from -1e+06 to 1e+06"
    assert f"--force-N: got nan; {limits} N." in words and f"--moment-Nm: got -1e+300; {limits} N m." in words
    assert "thruster[0].thrust_max_N" in words
    with pytest.raises(InputError, match="moment or force"):
        allocate(PAIR, 1.0, 0.0, "both")
    with pytest.raises(InputError, match="one or more"):
        allocate([], 1.0, 0.0)


def test_results_never_replace_the_file_that_was_read(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mounting.csv"  # an odd name, but the user's
    text = (project / "cases" / "ds30" / "thrusters.toml").read_text()
    path.write_text(text)
    assert main(["thrusters", str(path), "--out", str(tmp_path)]) == 2
    assert "which this run reads" in capsys.readouterr().err
    assert path.read_text() == text and len(list(tmp_path.iterdir())) == 1


def test_the_motors_sheet_takes_the_place_of_what_is_typical(tmp_path: Path) -> None:
    """By options or in the case, whose assumptions may stay: the same answer."""
    folder = tmp_path / "mine"
    assert main(["new", "9x6", "--kv", "900", "--cells", "3", "--out", str(folder)]) == 0
    case = load_case(folder)
    by_option = drive_result.solve(drive_result.with_drive(case, resistance_mohm=80.0, no_load_A=0.6))
    text = (folder / "case.toml").read_text()
    for key, said in (("size", "resistance_mohm = 80"), ("idle_share", "no_load_A = 0.6")):
        (line,) = [x for x in text.splitlines() if x.startswith(f"{key} = ")]
        text = text.replace(line, said)
    (folder / "case.toml").write_text(text)
    by_case = drive_result.solve(load_case(folder))
    assert by_case.full["battery_A"].value == pytest.approx(by_option.full["battery_A"].value, rel=1e-9)
    assert by_case.full["battery_A"].u < 0.9 * drive_result.solve(case).full["battery_A"].u
    assert [n.split()[3] for n in by_case.notes[:2]] == ["drive.motor.size", "drive.motor.idle_share"]


def test_a_mass_in_grams_is_called_so() -> None:
    case = rotor_of("5x4.3x3").case
    heavy, light = (
        drive_result.solve(drive_result.with_drive(case, kv=2400, cells=4, mass_kg=m, rotors=4)) for m in (650, 6.5)
    )
    assert "grams" in heavy.notes[0] and not any("grams" in note for note in light.notes)

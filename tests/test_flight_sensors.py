"""The promise on speed sensors, sessions and logs without motors: nothing impossible is fitted, days are not damage."""

from __future__ import annotations

import gzip
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_files import Hover, dataflash, ulog

from bemt.base.errors import InputError
from bemt.base.units import G0
from bemt.tools.flight.actions import fly
from bemt.tools.flight.answer import answer_on
from bemt.tools.flight.balance import DAY, SESSION, at_equal_voltage, axes_of, features, healthy_flight
from bemt.tools.flight.identify import identify
from bemt.tools.flight.judge import judge, posterior
from bemt.tools.flight.layout import LAYOUTS, layout_of, mixed
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.read import kind_of, read_log
from bemt.tools.flight.repeat import sessions
from bemt.tools.flight.speed_sensor import checked
from bemt.tools.flight.text import pilot
from bemt.tools.flight.thrust_curve import thrust_curve
from bemt.tools.flight.vibration import Vibration


def hover(layout: str = "quad-x", **more: object) -> FlightLog:
    """A flight in memory, whose total thrust is the weight of 1.5 kg."""
    flight = Hover(layout, seconds=12.0, **more)  # type: ignore[arg-type]
    t = np.arange(0.0, flight.seconds, 0.02)
    command, rpm = flight.drives(t)
    return FlightLog("f", "made", t, command=command, rpm=rpm, layout=layout)


def sick(log: FlightLog, motor: int, factor: float, lost: float = 0.0) -> FlightLog:
    """The same with a sensor that reads a share of the speed and drops out."""
    assert log.rpm is not None
    rpm = log.rpm.copy()
    rpm[:, motor] *= factor
    rpm[np.random.default_rng(1).random(log.t.size) < lost, motor] = 0.0
    return replace(log, rpm=rpm)


@pytest.mark.parametrize("layout", ["quad-x", "hexa-x", "x8"])
@pytest.mark.parametrize(("factor", "count", "lost"),
                         [(0.5, "1/2", 0.0), (0.5, "1/2", 0.85), (1 / 3, "1/3", 0.3), (2.0, "2", 0.0), (1.0, "", 0.3),
                          (0.0, "", 0.0)])  # fmt: skip
@pytest.mark.parametrize("commands", [True, False])
def test_a_sensor_at_fault_is_named_and_repaired(
    layout: str, factor: float, count: str, lost: float, commands: bool
) -> None:
    """Whatever it reads, the thrust constant is that of the whole flight within its band, and no other is named."""
    log = hover(layout)
    truth = identify(log, 1.5).constants["thrust constant"].value
    bad = sick(log if commands else replace(log, command=None), 2, factor, lost)
    answer = answer_on(bad, mass_kg=1.5)
    (sensor,) = answer.log.sensors
    assert sensor.motor == 3 and sensor.count == count and sensor.ratio == pytest.approx(factor, rel=0.04)
    assert sensor.lost == pytest.approx(1.0 if factor == 0.0 else lost, abs=0.02)
    k = answer.found.constants["thrust constant"]
    assert abs(k.value / truth - 1.0) < 0.02 and abs(k.value - truth) < k.half + 0.003 * truth
    assert not any("rotor 3" in name for name in answer.found.constants), "no constant of a repaired channel"
    assert not answer.speeds and any("sensor of motor 3" in line for line in pilot(answer))


@pytest.mark.parametrize("layout", ["quad-x", "hexa-x", "x8"])
@pytest.mark.parametrize("loss", [0.0, 0.15, 0.3])
def test_no_sound_sensor_is_accused(layout: str, loss: float) -> None:
    """Nor that of a damaged rotor, of a motor that turns 18 % slower at its command, or of a speed alone."""
    log = hover(layout, loss=((1, loss),))
    assert log.command is not None
    weak = log.command * (1.0 + 0.5 * (np.arange(log.rotors) == 0))  # the loads balance, at a higher command
    for one in (log, replace(log, command=None), replace(log, command=weak)):
        assert not checked(one).sensors


def test_a_motor_that_stands_is_no_sensor() -> None:
    """Eight rotors fly on seven: the loads balance without the one that reads nothing."""
    log, layout = hover("octo-x"), layout_of("octo-x", 8)
    assert log.rpm is not None and layout is not None
    from bemt.tools.flight.layout import effect_matrix

    A = effect_matrix(layout)
    rest = np.delete(np.arange(8), 4)
    thrust = np.zeros(8)
    thrust[rest] = np.linalg.pinv(A[:, rest]) @ (A @ np.ones(8))
    rpm = 6000.0 * np.sqrt(thrust) * np.ones((log.t.size, 1))
    command = 0.4 * np.where(thrust > 0.0, thrust, 1.0) * np.ones((log.t.size, 1))
    assert not checked(replace(log, rpm=rpm, command=command)).sensors


IMRC = {
    "brushed_34.7g_jana20": (1, 0.0347), "brushed_34.7g_jana25": (1, 0.0347), "payload_44.4g_eckart51": (3, 0.0444),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(IMRC))
def test_recorded_sensors_at_fault(shared_data: Path, name: str) -> None:
    """Named with the ratio; thrust constant within 3 % of the sound flights, mass within 4 %, no motor accused."""
    folder, (motor, mass) = shared_data / "flight_logs", IMRC[name]
    stem = name.rpartition("_")[0]
    others = folder.glob(f"cf21_{stem.replace('payload', 'brushless_payload')}_*")
    files = [*(folder / "imrc").glob(f"{stem}_*"), *others]
    sound = [p for p in files if p.stem not in IMRC and p.suffix == ".usdlog"]
    answer = fly(folder / "imrc" / f"{name}.usdlog", mass_kg=mass, healthy=sound, healthy_mass_kg=mass).flights[0]
    (sensor,) = answer.log.sensors
    assert sensor.motor == motor and sensor.count == "1/2" and abs(sensor.ratio - 0.5) < 0.02
    k = [identify(checked(read_log(p)), mass).constants["thrust constant"].value for p in sound]
    assert abs(answer.found.constants["thrust constant"].value / np.mean(k) - 1.0) < 0.03
    assert answer.mass is not None and abs(answer.mass.value / mass - 1.0) < 0.04
    assert not any("motor" in effect for effect in answer.judged.said.effects) and not answer.speeds


def test_recorded_sound_sensors_are_left_alone(shared_data: Path) -> None:
    """In every other flight with speeds, with and without its commands."""
    folder = shared_data / "flight_logs"
    files = [p for p in (*folder.glob("cf21*.usdlog"), *(folder / "imrc").glob("*")) if p.stem not in IMRC]
    for file in files:
        log = read_log(file)
        assert not checked(log).sensors and not checked(replace(log, command=None)).sensors, file


def by_name(folder: Path) -> dict[str, np.ndarray]:
    """Features of the flights of a folder."""
    return {p.name: x for p in sorted(folder.glob("*")) if (x := features(read_log(p))) is not None}


def test_recorded_flights_of_another_day(shared_data: Path) -> None:
    """A cut of 0.5 mm of another day is no damage; pairs of 2 mm and more are both seen by flights of their day."""
    flights, layout = by_name(shared_data / "flight_logs" / "crazypad_E9"), layout_of("crazyflie", 4)
    calm = [x for name, x in flights.items() if name.startswith("normal")]
    small = {name: x for name, x in flights.items() if "0.5mm_46.5mm" in name}
    for x in small.values():
        left_open, other = judge(x, calm, layout, day=""), judge(x, calm, layout, day=None)
        assert left_open.said.verdict in ("none", "insufficient") and other.said.verdict == "none"
        assert left_open.said.verdict == "none" or "day" in left_open.said.why
    for name, x in flights.items():
        if name.startswith(("cut_M2_2.0", "cut_M2_3.0")):
            both = {"damaged blade, motor 1", "damaged blade, motor 2"}
            assert both <= set(judge(x, [*small.values()], layout, day=0).said.effects), name
            days = [0] * len(calm) + [1] * len(small)
            assert both <= set(judge(x, [*calm, *small.values()], layout, days=days, day=1).said.effects), name


def test_a_name_is_right_by_flights_of_other_sessions(project: Path) -> None:
    """In 95 % or more, and the page says what the report does (reports/studies/flight_sessions.py)."""
    found = re.search(r"when it names: (\d+) of (\d+)", (project / "reports" / "flight" / "sessions.txt").read_text())
    assert found is not None and int(found[1]) >= 0.95 * int(found[2]) > 0.0
    assert f"{found[1]} of {found[2]} names were right" in (project / "docs" / "flight_logs.md").read_text()


def test_sessions_shape_the_prediction() -> None:
    """Within a session a flight is predicted closely, in another as wide as sessions differ, by prior and by data."""
    rng, axes = np.random.default_rng(2), axes_of(layout_of("quad-x", 4), 4)
    back = np.linalg.pinv(axes)

    def flights(shift: np.ndarray, n: int) -> list[np.ndarray]:
        return [back @ (shift + 0.003 * rng.normal(size=3)) for _ in range(n)]

    one = np.array(flights(np.zeros(3), 5))
    same, other = healthy_flight(one, axes, True), healthy_flight(one, axes, True, [0] * 5, None)
    assert np.all(same.sd < 0.008) and np.all(other.sd > np.array(SESSION)) and np.allclose(same.other_sd, other.sd)
    far = [s * np.array(SESSION) * 4.0 for s in (-1.0, 1.0, -1.0, 1.0)]
    many = np.array([x for shift in far for x in flights(shift, 3)])
    days = [k // 3 for k in range(12)]
    assert np.all(healthy_flight(many, axes, True, days, None).sd > 1.5 * other.sd)
    last = healthy_flight(many, axes, True, days, 3)
    np.testing.assert_allclose(last.mean, far[3], atol=0.01)


def test_healthy_flights_of_other_days_are_accused_as_rarely_as_stated() -> None:
    """Over 150 vehicles with three sessions of three flights: one of a fourth, and one whose day is not known."""
    rng, layout = np.random.default_rng(3), layout_of("quad-x", 4)
    back, hits, open_hits = np.linalg.pinv(axes_of(layout, 4)), 0, 0
    for _ in range(150):
        days = rng.normal(size=(4, 3)) * SESSION
        calm = [back @ (days[k // 3] + 0.006 * rng.normal(size=3)) for k in range(9)]
        x = back @ (days[3] + 0.006 * rng.normal(size=3))
        known = posterior(x, np.array(calm), layout, days=[k // 3 for k in range(9)], day=None)
        hits += known.said.verdict in ("named", "class", "unknown")
        open_hits += posterior(x, np.array(calm[:3]), layout, day="").said.verdict == "named"
    assert hits <= 6 and open_hits <= 6


def test_days_by_statement_and_by_date() -> None:
    """What is stated goes before what the logs or their names hold; nothing is guessed."""

    def log(file: str, date: str = "") -> FlightLog:
        return FlightLog(file, "made", np.arange(9.0), date=date)

    a, b = log("a.bin", "2026-05-01"), log("log_7_2026-5-2-10-11-12.ulg")
    assert sessions(log("c", "2026-05-02"), [a, b]).day == 1 and sessions(log("c"), [a, b]).day == ""
    assert sessions(log("c", "2026-05-03"), [a, b]).day is None
    assert sessions(log("c"), [a, b], day="same").day == 1 and sessions(log("c"), [a, b], day="other").day is None
    assert sessions(log("c"), [log("x"), log("y")]).days == (0, 0)
    assert sessions(log("c"), [log("x"), log("y")], ["monday", "friday"], "monday").day == 0


def test_leaving_sessions_out(tmp_path: Path) -> None:
    """Two folders are two sessions, and the error rate leaves a whole one out."""
    for day in range(2):
        (tmp_path / f"day{day}").mkdir()
        for k in range(3):
            data = dataflash(Hover(seconds=12.0, seed=10 * day + k))
            (tmp_path / f"day{day}" / f"{k}.bin").write_bytes(data)
    (tmp_path / "now.bin").write_bytes(dataflash(Hover(seconds=12.0, seed=99)))
    pytest.importorskip("pymavlink")
    answer = fly(tmp_path / "now.bin", healthy=[tmp_path / "day0", tmp_path / "day1"], healthy_day="same").flights[0]
    said = answer.document()
    assert said["sessions"] == {"of_healthy": [0, 0, 0, 1, 1, 1], "by": "stated", "of_this": 1}
    assert said["error_rate"]["left_out"] == "session" and said["error_rate"]["healthy"] == 6


@pytest.mark.parametrize("layout", ["quad-x", "quad-plus", "hexa-x", "x8"])
def test_commands_of_a_mixer_balance_its_demands(layout: str) -> None:
    """A demand in one axis moves the loads of that axis alone, to the side it asks for."""
    from bemt.tools.flight.layout import effect_matrix

    placed = layout_of(layout, len(LAYOUTS[layout].split()))
    assert placed is not None
    for axis in range(3):
        torque = np.zeros((1, 3))
        torque[0, axis] = 0.1
        loads = effect_matrix(placed) @ (mixed(placed, np.array([0.5]), torque, (0.5, 0.5, 0.5))[0] - 0.5)
        assert loads[axis] > 0.05 and np.allclose(np.delete(loads, axis), 0.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["ardupilot", "px4", "crazyflie"])
def test_demands_stand_in_for_motors(kind: str, tmp_path: Path) -> None:
    """The commands are those of the mixer, the damaged rotor is found, and the log says where they come from."""
    pytest.importorskip("pymavlink")
    pytest.importorskip("pyulog")

    def written(flight: Hover) -> FlightLog:
        file = tmp_path / "log"
        if kind == "crazyflie":
            t = np.arange(0.0, flight.seconds, 0.02)
            heads = ["timestamp", *(f"controller.cmd_{a}" for a in ("roll", "pitch", "yaw", "thrust"))]
            rows = np.column_stack([1000.0 * t, 65535.0 * flight.demands(t, (0.5, 0.5, 1.0))])
            file.write_text("\n".join([",".join(heads), *(",".join(map(str, r)) for r in rows)]))
        else:
            file.write_bytes(dataflash(flight, motors=False) if kind == "ardupilot" else ulog(flight, motors=False))
        return read_log(file)

    layout = "crazyflie" if kind == "crazyflie" else "quad-x"
    flights = [Hover(layout, seconds=12.0, seed=k) for k in range(4)]
    cut = written(Hover(layout, seconds=12.0, seed=9, loss=((2, 0.25),)))
    calm = [written(f) for f in flights]
    truth = flights[0].drives(np.arange(0.0, 12.0, 0.02))[0]
    assert calm[0].command is not None and calm[0].mixed and calm[0].rpm is None
    np.testing.assert_allclose(calm[0].command[-1], truth[-1], rtol=1e-3)
    got = answer_on(cut, calm, day="same")
    assert got.judged.said.effects[0] == "damaged blade, motor 3" and got.demand
    if kind == "ardupilot":
        assert cut.date == "2024-04-24" and got.vibration.rms == (3.0, 4.0, 5.0) and got.vibration.stated


def test_recorded_logs_without_motors(shared_data: Path) -> None:
    """They say what they show, with a number, and no rotors are counted as none."""
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    folder = shared_data / "flight_logs"
    octo = fly(folder / "air_octoquad_00000012.BIN")
    assert "0 rotors" not in octo.details and "8 rotors" in octo.text and "VIBE" in str(octo)
    assert octo.flights[0].vibration.stated and max(octo.flights[0].vibration.rms) < 1.0
    cut = fly(folder / "udesa_quad_cut_15mm_one_blade_log13.ulg.gz").flights[0]
    assert cut.log.rotors == 4 and cut.log.mixed and cut.log.file.endswith(".gz")
    assert 80.0 < cut.vibration.line_hz < 95.0 and cut.vibration.line > 10.0
    assert cut.vibration.high and pilot(cut)[0].startswith("Do not fly") and "29 m/s2" in pilot(cut)[1]
    assert not octo.flights[0].vibration.high and not pilot(octo.flights[0])[0].startswith("Do not fly")
    assert 0.01 < cut.demand[2] < 0.06, "trim in yaw, without the seconds in which it spins"


@pytest.mark.parametrize("stated", [True, False])
def test_a_level_is_compared_in_the_measure_that_its_limit_is_for(stated: bool) -> None:
    """VIBE of one axis; of accelerations the peaks of z, from a weight upwards, and of x or y, from nothing."""
    shake = Vibration(rms=(1.0, 2.0, 4.0), stated=stated, rate_hz=200.0)
    most = 30.0 / 4.0 if stated else G0 / (np.sqrt(2.0) * 6.0)
    for k, high in ((0.99, False), (1.01, True)):
        assert replace(shake, rms=tuple(k * most * v for v in shake.rms)).high is high
        assert not replace(shake, rms=tuple(k * most * v for v in shake.rms), unit="rad/s").high


@pytest.mark.parametrize("expo", [0.0, 0.4, 0.7])
def test_curve_of_an_autopilot(expo: float) -> None:
    """Share of the square within its band, and the hover throttle of that curve."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 60.0, 0.02)
    x = 0.45 + 0.04 * np.stack([np.sin(2 * np.pi * f * t + p) for f, p in rng.uniform(0.1, 0.4, (4, 2))], axis=1)
    thrust = (1.0 - expo) * x + expo * x**2
    rpm = 9000.0 * np.sqrt(thrust) * (1.0 + 0.002 * rng.normal(size=x.shape))
    log = FlightLog("f", "PX4 ULog", t, command=x, rpm=rpm, layout="px4-x")
    got = thrust_curve(log)
    assert abs(got["THR_MDL_FAC"].value - expo) < 0.03 and 0.1 < got["THR_MDL_FAC"].half < 0.5
    assert abs(got["MPC_THR_HOVER"].value - thrust.mean()) < 0.01 + got["MPC_THR_HOVER"].half / 4.0


@pytest.mark.parametrize("heads", [
    "t_s,rpm1,rpm2,rpm3,rpm4", "time,motor_1_rpm,motor_2_rpm,motor_3_rpm,motor_4_rpm",
    "Time [s],Motor 1 [RPM],Motor 2 [RPM],Motor 3 [RPM],Motor 4 [RPM]", "t_ms,esc1_rpm,esc2_rpm,esc3_rpm,esc4_rpm",
])  # fmt: skip
def test_speeds_alone_give_the_thrust_constant(heads: str, tmp_path: Path) -> None:
    """A CSV of time and speeds."""
    log = hover()
    assert log.rpm is not None
    clock = log.t * (1e3 if "_ms" in heads else 1.0)
    rows = [",".join(f"{v:.4f}" for v in (a, *b)) for a, b in zip(clock, log.rpm, strict=True)]
    (tmp_path / "s.csv").write_text("\n".join([heads, *rows]))
    k = identify(read_log(tmp_path / "s.csv"), 1.5).constants["thrust constant"]
    assert k.value == pytest.approx(1.5 * 9.80665 / float(np.sum(log.rpm**2, axis=1).mean()), rel=0.01)
    (tmp_path / "odd.csv").write_text("\n".join(["Time [s],A,B,C,D", *rows]))
    with pytest.raises(InputError, match="rpm1"):  # what is read is named
        read_log(tmp_path / "odd.csv")
    with pytest.raises(InputError, match="own healthy flight"):
        fly(tmp_path / "s.csv", healthy=[tmp_path / "s.csv"])


def test_what_is_packed_has_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Refused as soon as the limit is passed; what is cut is read as far as it goes."""
    data = dataflash(Hover(seconds=12.0))
    pytest.importorskip("pymavlink")
    packed = gzip.compress(data, 1)
    (tmp_path / "a.bin.gz").write_bytes(packed)
    assert read_log(tmp_path / "a.bin.gz").rotors == 4 and kind_of(tmp_path / "a.bin.gz").startswith("ArduPilot")
    (tmp_path / "cut.gz").write_bytes(packed[: len(packed) // 2])
    assert "gzip" in read_log(tmp_path / "cut.gz").ends
    monkeypatch.setattr("bemt.base.packed.MAX_BYTES", 100_000)
    with pytest.raises(InputError):
        read_log(tmp_path / "a.bin.gz")


def test_a_folder_is_a_table(tmp_path: Path) -> None:
    """A row a flight; what is no log is told, and does not stop the others."""
    pytest.importorskip("pymavlink")
    (tmp_path / "a.bin").write_bytes(dataflash(Hover(seconds=12.0)))
    (tmp_path / "b.bin").write_bytes(dataflash(Hover(seconds=12.0, seed=3)))
    (tmp_path / "c.bbl").write_bytes(b"H Product:Blackbox flight data recorder\n\0\0")
    answer = fly(tmp_path, mass_kg=1.5, out_csv=tmp_path / "t.csv")
    assert [Path(r["file"]).name for r in answer.table()] == ["a.bin", "b.bin"] and len(answer.faults) == 1
    assert len((tmp_path / "t.csv").read_text().splitlines()) == 3 and "c.bbl" in str(answer)
    one = fly(tmp_path / "a.bin")
    assert one.verdict == one.to_dict()["decision"]["verdict"] and "--healthy" in one.text and "--" not in str(one)
    with pytest.raises(InputError, match="blackbox_decode"):
        fly(tmp_path / "c.bbl")


def test_the_first_line_is_for_a_pilot(tmp_path: Path) -> None:
    """Where to look, by how much, and what would do it."""
    calm = [hover(seed=k) for k in range(4)]
    got = pilot(answer_on(hover(seed=9, loss=((2, 0.25),)), calm, day="same"))
    assert got[0].startswith("Look at motor 3: it works ") and "damaged blade" in got[0] and got[2].startswith("Next: ")
    assert len(got) == 3 and "motor" not in pilot(answer_on(hover(seed=9), calm, day="same"))[0].split(":")[0]
    assert DAY not in got[0]


def test_recorded_totals_at_one_voltage(shared_data: Path) -> None:
    """Commands of one vehicle differ by 3 % as its battery does; what its motors get by 0.5 % at most."""
    files = [p for p in (shared_data / "flight_logs").rglob("*brushed_34.7g*.usdlog") if p.stem not in IMRC]
    logs = [read_log(p) for p in sorted(files)]
    raw = [x for log in logs if (x := features(log)) is not None]
    even = at_equal_voltage(logs, raw)
    assert np.std([x.mean() for x in raw]) > 0.02 and np.std([x.mean() for x in even]) < 0.005
    for x, y in zip(raw, even, strict=True):
        assert np.allclose(x - x.mean(), y - y.mean()), "shares stay"


def test_commands_that_hold_the_voltage_already_stay(shared_data: Path) -> None:
    """A Crazyflie that logs both says so; of another, flights at one voltage leave it open, and a stuck one is none."""
    log = read_log(shared_data / "flight_logs" / "crazypad_E8" / "normal_flight__log01.usdlog")
    assert log.duty == 0.0 and log.voltage is not None
    x, low = np.zeros(4), replace(log, voltage=0.9 * log.voltage)
    assert np.allclose(at_equal_voltage([log, low], [x, x])[1], 0.0)
    open_ = replace(log, duty=0.5)
    assert np.allclose(at_equal_voltage([open_, low], [x, x])[1], 0.5 * np.log(0.9))
    stuck = replace(open_, voltage=0.0 * log.voltage + 3.7)
    assert np.allclose(at_equal_voltage([stuck, low], [x, x])[1], 0.0)

"""The promise of the flight logs: constants come back, healthy flights are not accused, damaged files are refused."""

from __future__ import annotations

import gzip
import json
import runpy
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flight_files import broken_copies

import bemt
from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.rotors.case import load_case
from bemt.rotors.propeller import rotor_of
from bemt.tools.flight import picture
from bemt.tools.flight.answer import FlightAnswer, answer_on
from bemt.tools.flight.balance import BUILD, axes_of, blade, features
from bemt.tools.flight.change import change_in
from bemt.tools.flight.identify import identify
from bemt.tools.flight.judge import BesideBalance, FlightVerdict, judge, posterior
from bemt.tools.flight.layout import LAYOUTS, effect_matrix, layout_of, mass_faults
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.picture import flight_picture
from bemt.tools.flight.read import read_log
from bemt.tools.flight.speed_sensor import checked
from bemt.tools.flight.text import pilot, stated_size, text
from bemt.tools.flight.thrust_curve import inflow, motor_lag, simulator_constants
from bemt.tools.flight.vibration import vibration
from bemt.tools.flight.wind import wind


@pytest.fixture(scope="module")
def script(project: Path) -> dict[str, Any]:
    """The script that writes flights."""
    return runpy.run_path(str(project / "docs" / "flight_log.py"))


@pytest.fixture(scope="module")
def flights(script: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its folder."""
    folder = tmp_path_factory.mktemp("flights")
    script["main"](str(folder))
    return folder


def healthy(folder: Path) -> list[FlightLog]:
    """Flights before the damage."""
    return [read_log(p) for p in sorted(folder.glob("before_*"))]


def test_thrust_constant_is_that_of_the_script(script: dict[str, Any], flights: Path) -> None:
    """The band holds the truth, and is narrow."""
    found = identify(read_log(flights / "before_1.usdlog"), script["MASS"]).constants["thrust constant"]
    assert abs(found.value - script["K"]) < max(found.half, 0.005 * script["K"])
    assert found.half < 0.02 * script["K"]


def test_constants_for_a_simulator(script: dict[str, Any], flights: Path) -> None:
    """In rad/s; the band holds the truth and what flights differ by."""
    log = read_log(flights / "before_1.usdlog")
    got = simulator_constants(log, identify(log, script["MASS"]))
    k = got["thrust constant"]
    assert k.unit == "N/(rad/s)^2" and abs(k.value - script["K"] * (30.0 / np.pi) ** 2) < k.half
    assert 0.015 < k.half / k.value < 0.04
    carried = log.rotors * k.value * got["hover speed"].value ** 2
    assert carried == pytest.approx(9.80665 * script["MASS"], rel=1e-6), "the speed at which this constant hovers"
    assert "motor time constant" not in got, "these motors follow at once"


@pytest.mark.parametrize("induced", [4.0, 5.5, 8.0])
@pytest.mark.parametrize("seen", [True, False])
def test_thrust_constant_is_that_of_hover(induced: float, seen: bool) -> None:
    """Air across the disks lifts a flight; with and without an accelerometer the band holds the hover's constant."""
    t = np.arange(0.0, 40.0, 0.01)
    v = np.stack([2.0 * np.sin(0.7 * t), 1.5 * np.cos(0.9 * t), 0.0 * t], axis=1)
    flow = np.sum(v**2, axis=1) / induced**2
    left = np.sqrt(np.sqrt(1.0 + flow**2 / 4.0) - flow / 2.0)
    np.testing.assert_allclose(left**2 * (left**2 + flow), 1.0)
    k, rng = 2e-10, np.random.default_rng(3)
    square = 9.80665 / (4.0 * k * (1.0 + 0.7 * (1.0 - left)))
    rpm = np.sqrt(square)[:, None] * (1.0 + 0.002 * rng.normal(size=(t.size, 4)))
    lift = np.stack([0.0 * t, 0.0 * t, 9.80665 + 0.05 * rng.normal(size=t.size)], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (t.size, 1))
    log = FlightLog("f", "made", t, rpm=rpm, velocity=v, axis=up, acceleration=lift if seen else None)
    found, still = (identify(x, 1.0).constants["thrust constant"] for x in (log, replace(log, velocity=0.0 * v)))
    assert abs(found.value - k) < found.half < 0.05 * k and found.value < still.value
    assert not seen or abs(found.value / k - 1.0) < 0.005


@pytest.mark.parametrize("tau", [0.03, 0.1])
def test_motor_lag_is_found_or_not_stated(tau: float) -> None:
    """A lag comes back within its band; speed that moves by itself, or a log without speeds, has none."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 20.0, 0.005)
    command = 0.5 + 0.05 * np.cumsum(rng.normal(size=(t.size, 4)), axis=0) / np.sqrt(t.size)
    command += 0.02 * np.repeat(rng.normal(size=(t.size // 50, 4)), 50, axis=0)
    rpm = np.empty_like(command)
    rpm[0] = 20000.0 * command[0]
    keep = np.exp(-0.005 / tau)
    for k in range(1, t.size):
        rpm[k] = keep * rpm[k - 1] + (1.0 - keep) * 20000.0 * command[k]
    noisy = rpm + 30.0 * rng.normal(size=rpm.shape)
    found = motor_lag(FlightLog("f", "made", t, command=command, rpm=noisy))
    assert found is not None and abs(found.value - tau) < max(found.half, 0.02 * tau) and found.half < 0.3 * tau
    assert motor_lag(FlightLog("f", "made", t, command=command)) is None
    alone = 10000.0 + 500.0 * rng.normal(size=rpm.shape)
    assert motor_lag(FlightLog("f", "made", t, command=command, rpm=alone)) is None


def test_rotor_of_a_flight_becomes_a_case(
    script: dict[str, Any], flights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It solves and sweeps as any case, with a narrower band that holds the truth; without mass nothing is written."""
    out, call = tmp_path / "known", ["fly", str(flights / "before_1.usdlog"), "--out-case", str(tmp_path / "known")]
    assert main(call) == 2 and main([*call, "--case", "1.8x1.2"]) == 2 and not out.exists()
    assert main([*call, "--case", "1.8x1.2", "--mass-kg", str(script["MASS"])]) == 0
    wide, known = rotor_of("1.8x1.2"), rotor_of(str(out))
    rpm = identify(read_log(flights / "before_1.usdlog")).rotors["mean rpm"][0]
    a, b = (r.solve(rpm=rpm, airspeed_m_s=0.0) for r in (wide, known))
    assert abs(b.thrust_N[0] - script["K"] * rpm**2) < 2.0 * b.u["thrust_N"][0]
    assert b.u["thrust_N"][0] < 0.6 * a.u["thrust_N"][0]
    assert main(["sweep", str(out), "--json"]) == 0 and "prop_1.8x1.2_measured" in capsys.readouterr().out


def test_mass_follows_from_healthy_flights(script: dict[str, Any], flights: Path, tmp_path: Path) -> None:
    """A payload of 20 % is weighed."""
    (tmp_path / "heavy").write_bytes(script["flight"](5, mass=1.2 * script["MASS"]))
    got = answer_on(read_log(tmp_path / "heavy"), healthy(flights), healthy_mass_kg=script["MASS"])
    assert got.mass is not None and got.mass.value == pytest.approx(1.2 * script["MASS"], rel=0.01)


def test_cut_blade_is_found_whatever_the_name(flights: Path, tmp_path: Path) -> None:
    """Content decides, and the right motor is named."""
    (tmp_path / "normal.txt").write_bytes((flights / "after.usdlog").read_bytes())
    got = answer_on(read_log(tmp_path / "normal.txt"), healthy(flights), day="same").judged
    assert (got.said.verdict, got.said.effects) == ("named", ("damaged blade, motor 3",))
    assert got.accused == 0 and got.healthy == 6 and 0.0 <= got.rate95[0] < got.rate95[1] < 1.0


def test_without_healthy_flights_nothing_is_named(flights: Path) -> None:
    """One flight alone: what healthy vehicles show is the scale, and an uneven build is among the causes."""
    alone = answer_on(read_log(flights / "before_1.usdlog")).judged
    assert alone.said.verdict == "insufficient" and 0.1 < alone.visible < 0.4
    calm = read_log(flights / "before_1.usdlog")
    assert calm.command is not None
    got = answer_on(replace(calm, command=calm.command * [1.0, 1.0, 1.4, 1.0])).judged
    assert got.said.verdict == "class" and {"damaged blade, motor 3", BUILD} <= set(got.said.effects)
    few = answer_on(read_log(flights / "after.usdlog"), healthy(flights)[:2]).judged
    assert few.said.verdict == "class" and "damaged blade, motor 3" in few.said.effects


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_every_layout_balances_and_every_motor_is_found(name: str) -> None:
    """Equal rotors make thrust alone; a loss as the mixer balances it is traced to its motor."""
    layout = layout_of(name, len(LAYOUTS[name].split()))
    assert layout is not None
    A = effect_matrix(layout)
    np.testing.assert_allclose(A @ np.ones(A.shape[1]), [0.0, 0.0, 0.0, A.shape[1]], atol=1e-9)
    rng = np.random.default_rng(1)
    calm = [0.01 * rng.normal(size=A.shape[1]) for _ in range(6)]
    P = np.linalg.pinv(A) @ A
    for k in range(0, A.shape[1], A.shape[1] // 4 or 1):  # four of them, or all
        got = posterior(np.mean(calm, axis=0) + 0.3 * P[:, k], np.array(calm), layout, day="")
        assert got.said.verdict in ("named", "class") and f"damaged blade, motor {k + 1}" in got.said.effects


@pytest.fixture(scope="module")
def sound() -> dict[int, list[str]]:
    """Verdicts on 200 vehicles of 4 and of 8 rotors, whose roll, pitch and yaw scatter as unlike as recorded ones."""
    out: dict[int, list[str]] = {}
    for rotors in (4, 8):
        rng = np.random.default_rng(7)
        layout = layout_of("px4-x" if rotors == 4 else "octo-x", rotors)
        unlike, said = np.array([0.4, 1.7, 0.8]), []
        for _ in range(200):
            spread = 0.01 * (rng.normal(size=(7, 3)) * unlike) @ np.linalg.pinv(axes_of(layout, rotors)).T
            said.append(posterior(spread[0], spread[1:], layout).said.verdict)
        out[rotors] = said
    return out


EIGHT = pytest.mark.xfail(strict=True, reason="10 of 200 are insufficient or accused: 28 pairs share the probability")


@pytest.mark.parametrize("rotors", [4, pytest.param(8, marks=EIGHT)])
def test_healthy_flights_are_none_as_often_as_stated(rotors: int, sound: dict[int, list[str]]) -> None:
    """The bound allows for chance."""
    assert sum(verdict != "none" for verdict in sound[rotors]) <= 8


@pytest.mark.parametrize("rotors", [4, 8])
def test_healthy_flights_are_seldom_accused(rotors: int, sound: dict[int, list[str]]) -> None:
    """One in a hundred, and chance."""
    assert sum(verdict not in ("none", "insufficient") for verdict in sound[rotors]) <= 4


@pytest.mark.parametrize("by", ["force", "axis"])
def test_wind_from_slope_and_mean(by: str) -> None:
    """The law gives its own wind back: from a residual force, and from the tilt that balances it."""
    t = np.arange(0.0, 60.0, 0.02)
    v = np.stack([np.sin(t), 0.0 * t, 0.0 * t], axis=1)

    def blown(w: float) -> FlightLog:
        relative = w - v[:, 0]
        force = np.zeros_like(v)
        force[:, 0] = 0.3 * relative + 0.02 * relative * np.abs(relative)
        if by == "force":
            return FlightLog("f", "made", t, velocity=v, force=force)
        up = np.stack([(np.cos(t) - force[:, 0]) / 9.80665, 0.0 * t, 1.0 + 0.0 * t], axis=1)
        return FlightLog("f", "made", t, velocity=v, axis=up / np.linalg.norm(up, axis=1, keepdims=True))

    for w in (4.0, 8.0, -12.0):
        found = wind(blown(w), [blown(0.0)])
        assert found.speed == pytest.approx(abs(w), abs=0.5)
        assert abs(found.heading_deg) == pytest.approx(0.0 if w > 0 else 180.0, abs=0.1)
    assert wind(blown(0.0), [blown(0.0)]).speed == pytest.approx(0.0, abs=0.1)
    assert np.isnan(wind(replace(blown(3.0), force=None, axis=None), [blown(0.0)]).speed)


def test_other_rotors_are_refused(flights: Path) -> None:
    """A layout or a healthy flight of another vehicle."""
    log = read_log(flights / "after.usdlog")
    with pytest.raises(InputError):
        answer_on(log, layout="octo-x")
    eight = replace(log, command=np.ones((log.t.size, 8)), rpm=None)
    with pytest.raises(InputError):
        answer_on(log, [eight])
    with pytest.raises(InputError, match="a log of another"):
        answer_on(log, [replace(log, format="another")])


def betaflight(rotors: int = 4) -> str:
    """A table as blackbox_decode writes it."""
    head = "loopIteration,time (us)," + ",".join(f"motor[{i}]" for i in range(rotors)) + ",vbatLatest (V)"
    rows = [f"{k},{k * 4000}," + ",".join(str(1400 + i + k % 7) for i in range(rotors)) + ",15.9" for k in range(600)]
    return "\n".join(['"motor_poles",14', head, *rows])


def cells() -> bytes:
    """A table with arrays in its cells, packed."""
    rows = ["t,v,R,pwm,fa"]
    for k in range(600):
        parts = [[0.1, 0.0, 0.0], [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [1000 + k % 5] * 4, [0.0, 0.0, 0.1]]
        rows.append(f"{0.02 * k}," + ",".join(f'"{json.dumps(p)}"' for p in parts))
    return gzip.compress("\n".join(rows).encode(), mtime=0)


@pytest.mark.parametrize("count", [60, pytest.param(1500, marks=pytest.mark.slow)])
def test_damaged_copies_never_raise_anything_else(count: int, flights: Path, tmp_path: Path) -> None:
    """Refused with a fault, or read as far as they go."""
    samples = [(flights / "after.usdlog").read_bytes(), betaflight().encode(), cells()]
    assert 0 < broken_copies(samples, count, tmp_path / "log") < count


@pytest.mark.parametrize("count", [30, pytest.param(900, marks=pytest.mark.slow)])
def test_damaged_recordings_never_raise_anything_else(count: int, shared_data: Path, tmp_path: Path) -> None:
    """The formats that libraries read, a packed one, and logs of both makers of a Crazyflie's."""
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    folder = shared_data / "flight_logs"
    names = ("*.ulg", "*.BIN", "udesa*.gz", "crazypad_E8/normal*01.usdlog", "crazypad*.csv", "imrc/*jana20.usdlog")
    samples = [p.read_bytes() for name in names for p in sorted(folder.glob(name))]
    broken_copies(samples, count, tmp_path / "log")


def test_a_cut_log_says_where_it_ends(flights: Path, tmp_path: Path) -> None:
    """With the place."""
    data = (flights / "after.usdlog").read_bytes()
    (tmp_path / "cut").write_bytes(data[: len(data) // 2])
    got = read_log(tmp_path / "cut")
    assert got.ends and 5.0 < got.t[-1] < 7.0


@pytest.mark.parametrize("rotors", [4, 6, 8])
def test_betaflight_tables_keep_each_rotor(rotors: int, tmp_path: Path) -> None:
    """Any number of rotors."""
    (tmp_path / "log.csv").write_text(betaflight(rotors))
    log = read_log(tmp_path / "log.csv")
    assert log.rotors == rotors and log.command_unit == "1" and log.voltage is not None and log.command is not None
    assert log.t[1] == pytest.approx(0.004) and log.command[0, 0] == pytest.approx(0.4)


@pytest.mark.parametrize("quote", ['"', "", " "], ids=["explorer", "plain", "decode"])
def test_betaflight_headings_of_each_tool(quote: str, tmp_path: Path) -> None:
    """Quoted names with rows of settings before them, as the explorer exports; or blanks, as blackbox_decode does."""
    around = ("", " ") if quote == " " else (quote, quote)

    def row(*cells: object) -> str:
        return ",".join(f"{around[0]}{c}{around[1]}" for c in cells)

    time = "time (us)" if quote == " " else "time"
    names = [f"{stem}[{i}]" for stem in ("motor", "eRPM") for i in range(4)]
    lines = (
        [row("Firmware revision", "Betaflight 4.4.2 (2cf7d0a1d) STM32F7X2"), row("motor_poles", 14),
         row("motorOutput", "158,2047"), row("yaw_motors_reversed", 1)] if quote == '"' else []
    )  # fmt: skip
    volts = "1590" if quote == '"' else "15.9"
    lines.append(row("loopIteration", time, *names, "vbatLatest"))
    lines += [f"{k},{k * 2000},{','.join(str(900 + i + k % 3) for i in range(4))},2000,2000,2000,2000,{volts}"
              for k in range(400)]  # fmt: skip
    (tmp_path / "log.csv").write_text("\n".join(lines))
    log = read_log(tmp_path / "log.csv")
    assert log.command is not None and log.t[1] == pytest.approx(0.002)
    assert log.voltage is not None and log.voltage[0] == pytest.approx(15.9)
    if quote == '"':
        assert log.layout == "betaflight-x-rev" and log.rpm is not None
        assert log.rpm[0, 0] == pytest.approx(200000 / 7) and log.command[0, 0] == pytest.approx((900 - 158) / 1889)
    else:
        assert log.layout == "betaflight-x" and log.rpm is None, "no poles, no speed"


def test_command_prints_and_writes(flights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Text, JSON, picture, exit codes."""
    before = [str(p) for p in sorted(flights.glob("before_*"))]
    call = ["fly", str(flights / "after.usdlog"), "--mass-kg", "0.035", "--healthy-day", "same", "--healthy", *before]
    assert main([*call, "--json", "--out", str(tmp_path / "a.png")]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "bemt.flight/1" and said["decision"]["effects"] == ["damaged blade, motor 3"]
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert main(call) == 0 and "N/(rad/s)^2" in capsys.readouterr().out, "who states the mass asks for constants"
    (tmp_path / "no.bin").write_bytes(b"\0" * 100)
    assert main(["fly", str(tmp_path / "no.bin")]) == 2


def answered(folder: Path, name: str, **more: Any) -> FlightAnswer:
    """An answer on a recording."""
    return answer_on(read_log(folder / name), **more)


def test_every_recording_is_read(shared_data: Path) -> None:
    """With rotors where motors were logged."""
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    files = [p for p in (shared_data / "flight_logs").rglob("*.*") if p.suffix != ".md"]
    assert files
    for file in files:
        log = read_log(file)
        assert log.t.size >= 20 and log.rotors in (0, 4), file


def test_recorded_thrust_constants_repeat(shared_data: Path) -> None:
    """Standard deviation 0.5 % or less; the payload within 4 %; the brushed one within the bench's band."""
    folder = shared_data / "flight_logs"
    for stem in ("brushed_34.7g", "brushless_37g", "payload_44.4g"):
        logs = [checked(read_log(p)) for p in folder.rglob(f"*{stem}*.usdlog")]
        k = [identify(log).constants["thrust constant"].value for log in logs if not log.sensors]
        assert len(k) > 2 and np.std(k, ddof=1) <= 0.005 * np.mean(k), stem
    calm = [read_log(p) for p in folder.glob("cf21_brushless_37g_*.usdlog")]
    got = answered(folder, "cf21_brushless_payload_44.4g_eckart07.usdlog", healthy=calm, healthy_mass_kg=0.037)
    assert got.mass is not None and abs(got.mass.value - 0.0444) < min(got.mass.half, 0.04 * 0.0444)
    assert got.judged.said.verdict == "none" and got.judged.total_moved
    assert f"{100 * got.judged.total:.0f} %" in text(got).splitlines()[0]  # not below the line that nothing is wrong
    brushed = [read_log(p) for p in sorted(folder.glob("cf21_brushed_34.7g_*.usdlog"))]
    for k, log in enumerate(brushed):
        mass = answer_on(log, [*brushed[:k], *brushed[k + 1 :]], healthy_mass_kg=0.0347).mass
        assert mass is not None and abs(mass.value - 0.0347) < mass.half < 0.04 * 0.0347
    bench = identify(read_log(next(folder.glob("cf21_brushed_34.7g_circle*.usdlog"))), 0.0347)
    grams = 1000.0 * bench.constants["thrust constant"].value / 9.80665
    assert 2.1e-8 < grams < 2.3e-8


def test_recorded_mass_by_commands_alone(shared_data: Path) -> None:
    """Without speeds the band holds the battery and a thrust curve that is not known: in nine of eleven or more."""
    folder, held = shared_data / "flight_logs", 0
    without = {p.stem: replace(read_log(p), rpm=None) for p in sorted(folder.rglob("*37g_*.usdlog"))}
    for p in (*folder.rglob("*payload_44.4g*.usdlog"), *folder.rglob("*brushed_34.7g*.usdlog")):
        heavy, mass = "payload" in p.stem, 0.0444 if "payload" in p.stem else 0.0347
        same = {q.stem: replace(read_log(q), rpm=None) for q in folder.rglob("*brushed_34.7g*.usdlog") if q != p}
        calm = [*(without if heavy else same).values()]
        got = answer_on(replace(read_log(p), rpm=None), calm, healthy_mass_kg=0.037 if heavy else 0.0347).mass
        assert got is not None and got.half < 0.2 * got.value
        held += abs(got.value - mass) < got.half
    assert held >= 9


THREE_MM = ("cut_propeller_M3_3mm", "cut_propeller_M3_1.5mm_", "cut_propeller_M3_2mm_", "cut_propeller_M3_4mm_")


@pytest.fixture(scope="module")
def flown(shared_data: Path) -> dict[str, tuple[np.ndarray, float]]:
    """Features and levels of vibration of CrazyPAD E8."""
    logs = {p.stem: read_log(p) for p in sorted((shared_data / "flight_logs" / "crazypad_E8").glob("*"))}
    return {name: (x, vibration(log).level) for name, log in logs.items() if (x := features(log)) is not None}


def by_healthy(flown: dict[str, tuple[np.ndarray, float]], name: str, day: str, shakes: bool = True) -> FlightVerdict:
    """One of these by the healthy ones."""
    x, level = flown[name]
    calm, levels = zip(*(v for k, v in flown.items() if k.startswith("normal")), strict=True)
    beside = BesideBalance(level=level, levels=levels) if shakes else None
    return judge(x, calm, layout_of("crazyflie", 4), beside=beside, day=0 if day else "")


@pytest.fixture(scope="module")
def cut(flown: dict[str, tuple[np.ndarray, float]]) -> dict[str, dict[str, FlightVerdict]]:
    """All by the healthy flights, with the day open and stated."""
    return {day: {name: by_healthy(flown, name, day) for name in flown} for day in ("", "same")}


def test_recorded_quadrotor_with_cut_blades(cut: dict[str, dict[str, FlightVerdict]]) -> None:
    """No sound flight accused, never another motor's blade; by flights of the day motor 3 in 8 of 10 or more."""
    for day, answers in cut.items():
        for name, got in answers.items():
            assert got.accused == 0
            weighed = name.startswith("weight_on_string")
            assert name.startswith("cut") or got.said.verdict == ("insufficient" if weighed else "none"), name
            assert not got.said.effects or got.said.effects[0] == "damaged blade, motor 3", name
        large = [got for name, got in answers.items() if name.startswith(THREE_MM)]
        assert sum(bool(got.said.effects) for got in large) >= (8 if day else 5)


def test_a_cause_that_is_likely_but_not_sure_is_said_to_be(flown: dict[str, tuple[np.ndarray, float]]) -> None:
    """No rival is made up, the day is asked for where it is open, and the likely motor is the first to be looked at.

    By the balance alone; that the flight shakes three times as much as the healthy ones makes it sure.
    """
    name = "cut_propeller_M3_3mm__log01"
    assert by_healthy(flown, name, "same").said.effects == ("damaged blade, motor 3",)
    for day in ("", "same"):
        got = by_healthy(flown, name, day, shakes=False)
        assert got.said.verdict == "insufficient" and got.probability[got.said.leading] > 0.5
        assert "several" not in got.said.why and "motor 3" in got.said.why and "motor 3" in got.next.text
        assert ("--healthy-day" in got.next.text) == (not day)


@pytest.mark.xfail(strict=True, reason="a weight on a string near motor 3 moves the total drive as well: insufficient")
def test_recorded_weights_on_a_string_are_none(cut: dict[str, dict[str, FlightVerdict]]) -> None:
    """Nor is any other flight without a cut."""
    assert all(got.said.verdict == "none" for name, got in cut[""].items() if not name.startswith("cut"))


@pytest.mark.xfail(strict=True, reason="another day is as likely beforehand: 0.75 to 0.85, and a claim costs more")
def test_recorded_cuts_from_3_mm_on_with_the_day_open(cut: dict[str, dict[str, FlightVerdict]]) -> None:
    """Motor 3 in 8 of 10 or more."""
    assert sum(bool(got.said.effects) for name, got in cut[""].items() if name.startswith(THREE_MM)) >= 8


def test_recorded_cuts_moved_to_two_motors(shared_data: Path) -> None:
    """No rotor is named that is whole; both are named or in the class in two of three or more.

    What a cut changed at motor 3 is turned to two motors and added: a flight of two cut propellers, as nearly as
    recordings of one give it.
    """
    folder = shared_data / "flight_logs" / "crazypad_E8"
    calm = np.array([features(read_log(p)) for p in sorted(folder.glob("normal*"))])
    cuts = [features(read_log(folder / f"cut_propeller_M3_{c}.usdlog")) - calm.mean(axis=0)
            for c in ("3mm_3mm_41mm__log00", "4mm_3.5mm_39.5mm__log01", "2mm_2mm_43mm__log03")]  # fmt: skip
    layout, both, tried = layout_of("crazyflie", 4), 0, 0
    for (a, one), (b, other) in product(product(range(4), cuts), repeat=2):
        if a == b:
            continue
        x = calm.mean(axis=0) + np.roll(one, a - 2) + np.roll(other, b - 2)
        said = posterior(x, calm, layout).said
        cut = {blade(a + 1), blade(b + 1)}
        assert said.verdict != "named" or set(said.effects) == cut
        both, tried = both + (cut <= set(said.effects)), tried + 1
    assert both >= 2 * tried / 3


def test_recorded_flights_alone(shared_data: Path) -> None:
    """No healthy flight is accused without others, and no change is seen in a flight without one."""
    folder = shared_data / "flight_logs"
    for file in (*sorted(folder.glob("cf21*.usdlog")), *sorted((folder / "crazypad_E8").glob("*"))):
        log = read_log(file)
        layout, mine = layout_of(log.layout, 4), features(log)
        assert mine is not None and change_in(log, layout) is None, file
        got = judge(mine, [], layout)
        assert got.said.verdict == "insufficient" or "damaged blade, motor 3" in got.said.effects, file
        assert got.said.verdict == "insufficient" or file.name.startswith("cut"), file


@pytest.mark.xfail(
    strict=True, reason="an uneven build leads, motor 3 is next with 0.1 to 0.3, and a claim asks for 0.9"
)
def test_recorded_cuts_are_seen_alone(shared_data: Path) -> None:
    """Without any healthy flight, in three flights or more."""
    files = sorted((shared_data / "flight_logs" / "crazypad_E8").glob("cut*"))
    read = [x for p in files if (x := features(read_log(p))) is not None]
    assert sum(judge(x, [], layout_of("crazyflie", 4)).said.verdict == "class" for x in read) >= 3


def spliced(a: FlightLog, b: FlightLog) -> FlightLog:
    """The first half of a flight and the second half of another."""
    i, j = np.flatnonzero(a.flying), np.flatnonzero(b.flying)
    first, last = slice(i[0], i[i.size // 2]), slice(j[j.size // 2], j[-1])
    t = np.concatenate([a.t[first], a.t[first][-1] + 0.01 + b.t[last] - b.t[last][0]])
    both = {}
    for key in ("command", "velocity", "position", "voltage"):
        x, y = getattr(a, key), getattr(b, key)
        both[key] = np.concatenate([x[first], y[last]])
    return FlightLog("f", "made", t, **both, layout=a.layout)


@pytest.mark.parametrize("cut", ["2mm_2mm_43mm__log03", "3mm_3mm_41mm__log00", "4mm_3.5mm_39.5mm__log01"])
def test_recorded_blade_lost_in_flight(shared_data: Path, cut: str) -> None:
    """A healthy flight that goes on as one with a cut blade: the time within a second, and the motor."""
    folder = shared_data / "flight_logs" / "crazypad_E8"
    log = spliced(read_log(folder / "normal_flight__log03.usdlog"), read_log(folder / f"cut_propeller_M3_{cut}.usdlog"))
    got = change_in(log, layout_of(log.layout, 4))
    assert got is not None and got.kind == "step" and got.causes[0] == "damaged blade, motor 3"
    flying = np.flatnonzero(read_log(folder / "normal_flight__log03.usdlog").flying)
    assert abs(got.at_s - read_log(folder / "normal_flight__log03.usdlog").t[flying[flying.size // 2]]) < 1.0
    assert got.size > 0.1


def test_recorded_thrust_in_moving_air(shared_data: Path) -> None:
    """A brushless Crazyflie that climbs and descends: less thrust in a climb, as the model has it."""
    flow = inflow(read_log(shared_data / "flight_logs" / "cf21_brushless_37g_eckart12.usdlog"))
    assert flow is not None and flow.axial is not None
    top = rotor_of("1.8x1.2").solve(rpm=60.0 * flow.turns, airspeed_m_s=[0.0, flow.axial_m_s[1]]).thrust_N
    assert abs(flow.axial[0] - (top[1] / top[0] - 1.0)) < flow.axial[1] < 0.01


@pytest.mark.parametrize(("name", "speed"), [("35wind", 4.2), ("70wind", 8.5), ("100wind", 12.1), ("70p20sint", 8.5)])
def test_recorded_wind(shared_data: Path, name: str, speed: float) -> None:
    """Within 2 m/s and the band, in steady wind and in gusts at the frequency of the flight."""
    folder = shared_data / "flight_logs" / "neural_fly"
    answer = answered(folder, f"baseline_{name}.csv.gz", healthy=[read_log(folder / "baseline_nowind.csv.gz")])
    got = answer.wind
    assert abs(got.speed - speed) < got.half
    assert abs(got.speed - speed) < 2.0
    told = f"{got.speed:.1f} ± {got.half:.1f} m/s"
    assert got.sure and told in pilot(answer)[0]
    for less in (
        replace(got, half=got.speed),
        replace(got, speed=1.0, half=0.1),
    ):  # not sure, and no more than a breeze
        assert "m/s" not in pilot(replace(answer, wind=less))[0]


def test_recorded_wind_by_the_drag_of_the_other_flights(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each left out: 60 to 80 % of thirds of flights in one standard deviation, 90 % in two; bias 0.7 m/s at most."""
    known = {"35wind": (4.2, 0.128), "70wind": (8.5, 0.044), "70p20sint": (8.5, 0.060), "100wind": (12.1, 0.078)}
    logs = {
        k: read_log(shared_data / "flight_logs" / "neural_fly" / f"baseline_{k}.csv.gz") for k in [*known, "nowind"]
    }
    miss, z = [], []
    for k, (speed, _) in known.items():
        others = [share for j, (_, share) in known.items() if j != k]  # r of each by its wind, as wind.py has it
        monkeypatch.setattr("bemt.tools.flight.wind._SHARE", float(np.exp(np.mean(np.log(others)))))
        log = logs[k]
        miss.append(wind(log, [logs["nowind"]]).speed - speed)
        assert log.velocity is not None and log.axis is not None
        for rows in np.array_split(np.arange(log.t.size), 3):
            third = FlightLog("f", "made", log.t[rows], velocity=log.velocity[rows], axis=log.axis[rows])
            got = wind(third, [logs["nowind"]])
            z.append(1.96 * abs(got.speed - speed) / got.half)
    assert 0.6 <= np.mean(np.array(z) < 1.0) <= 0.8 and np.mean(np.array(z) < 1.96) >= 0.9
    assert abs(np.mean(miss)) <= 0.7 and max(np.abs(miss)) < 1.0


def test_recorded_calm_is_calm(shared_data: Path) -> None:
    """One half of a flight without wind judged by the other, and flights indoors."""
    log = read_log(shared_data / "flight_logs" / "neural_fly" / "baseline_nowind.csv.gz")
    assert log.velocity is not None and log.axis is not None
    n = log.t.size // 2
    halves = [FlightLog("f", "made", log.t[s], velocity=log.velocity[s], axis=log.axis[s])
              for s in (slice(0, n), slice(n, None))]  # fmt: skip
    got = wind(halves[0], halves[1:])
    assert got.speed < min(got.half, 1.0)
    for stem in ("cf21_brushed_34.7g_*.usdlog", "cf21_brushless_37g_*.usdlog"):
        logs = [read_log(p) for p in sorted((shared_data / "flight_logs").glob(stem))]
        assert wind(logs[0], logs[1:]).speed < min(wind(logs[0], logs[1:]).half, 1.0)


def test_picture_of_a_log_without_motors() -> None:
    """It says so instead of failing."""
    t = np.arange(0.0, 5.0, 0.01)
    assert flight_picture(answer_on(FlightLog("f", "made", t))).startswith(b"\x89PNG")


@pytest.mark.parametrize(("mass", "refused"), [(0.02, False), (0.2, False), (20.0, True), (1500.0, True), (0.0, True)])
def test_a_mass_that_the_battery_cannot_lift_is_refused(mass: float, refused: bool, flights: Path) -> None:
    """A small quadrotor on one cell: 20 kg would take kilowatts; 200 g is odd, but not impossible."""
    assert bool(mass_faults(read_log(flights / "before_1.usdlog"), mass, "--mass-kg")) is refused


@pytest.mark.parametrize("amps", [10.0, 40.0])
def test_the_mass_that_is_just_refused_takes_the_power_that_the_log_allows(amps: float) -> None:
    """Momentum theory on disks whose tips run at Mach 0.5, with twice the logged current."""
    t, ones = np.arange(0.0, 10.0, 0.01), np.ones(1000)
    log = FlightLog("x", "x", t, rpm=3000.0 * np.ones((1000, 4)), voltage=22.0 * ones, battery_current=amps * ones)
    area = 4 * np.pi / 4 * (170.0 / (np.pi * 50.0)) ** 2
    lifted = (2.0 * 1.225 * area * (2.0 * 22.0 * amps) ** 2) ** (1 / 3) / 9.80665
    assert mass_faults(log, 1.01 * lifted, "--mass-kg") and not mass_faults(log, 0.99 * lifted, "--mass-kg")


def test_a_case_from_flights_is_solved_at_the_speed_flown(flights: Path, tmp_path: Path) -> None:
    out = tmp_path / "known"
    words = [str(flights / "before_1.usdlog"), "--mass-kg", "0.035", "--case", "1.8x1", "--out-case", str(out)]
    main(["fly", *words, "--quiet"])
    log = read_log(flights / "before_1.usdlog")
    assert log.rpm is not None
    assert load_case(out / "case.toml").rpm == pytest.approx(log.rpm[log.flying].mean(), rel=0.01)


def test_the_table_of_flights_says_what_each_thrust_is_over() -> None:
    """N/kg of a command and N/rpm^2/kg of a speed stand in one column: each says which."""
    from bemt.tools.flight.actions import _aligned, _Row

    one = _Row("a", "csv", 4, 9.0, "none", "", "", 4.0, 0.04, "N/kg", "command", None, None, None, "", None, None)
    told = _aligned([one, replace(one, thrust_over="speed^2")])
    assert [("command" in line, "speed^2" in line) for line in told.splitlines()[1:]] == [(True, False), (False, True)]


def test_the_picture_has_a_gap_where_nothing_was_in_the_air() -> None:
    """Means over cells of equal time: none is drawn across six seconds on the ground, and elsewhere they are right."""
    t = np.concatenate([np.arange(0.0, 8.0, 0.01), np.arange(14.0, 20.0, 0.01)])
    when, mean = picture.over_time(t, np.stack([2.0 + 0.0 * t, t], axis=1))
    on = (when < 7.5) | (when > 14.5)
    assert np.all(np.isnan(mean[(when > 8.5) & (when < 13.5)])) and ((when > 8.5) & (when < 13.5)).sum() >= 8
    np.testing.assert_allclose(mean[on], np.stack([2.0 + 0.0 * when, when], axis=1)[on], atol=0.02)


@pytest.mark.parametrize(("kind", "head"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_a_flight_is_drawn_as_png_pdf_or_svg(kind: str, head: bytes, flights: Path) -> None:
    answer = answer_on(read_log(flights / "before_1.usdlog"))
    assert flight_picture(answer, kind=kind).startswith(head)


@pytest.mark.parametrize("healthy", [0, 5])
def test_the_bar_of_a_motor_and_the_stated_size_are_one_number(healthy: int) -> None:
    """A rotor driven 25 % harder, beside the others: its bar says so, though its share of the whole changes by less."""
    calm = [np.random.default_rng(k).normal(0.0, 0.002, 4) for k in range(healthy)]
    j = judge(np.array([0.0, 0.0, 0.25, 0.0]), calm, layout_of("quad-x", 4))
    bars = picture.bars_of(j)
    assert bars[2] == pytest.approx(0.25, abs=0.005) and np.sum(bars) == pytest.approx(0.0, abs=1e-9)
    if (stated := stated_size(j)) is not None:
        assert abs(bars[2] - stated.size) < stated.half


def test_a_thrust_that_no_such_propeller_has_is_asked_about(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Speeds counted twice are a question of pole pairs and of the propeller, in the text and as the next step."""
    t, noise = np.arange(0.0, 20.0, 0.01), np.random.default_rng(5)
    weight = 4.0 * float(bemt.propeller("10x4.5").solve(rpm=5000.0).thrust_N[0]) / 9.80665
    for factor, asked in ((2.0, True), (1.0, False)):
        rpm = 5000.0 * factor * (1.0 + 0.003 * noise.standard_normal((t.size, 4)))
        file = tmp_path / f"{factor:g}.csv"
        rows = np.column_stack([t, rpm])
        np.savetxt(file, rows, delimiter=",", header="t_s,rpm1,rpm2,rpm3,rpm4", comments="", fmt="%.6g")
        assert main(["fly", str(file), "--mass-kg", f"{weight:.4g}", "--case", "10x4.5"]) == 0
        said = capsys.readouterr().out
        step = next(line for line in said.splitlines() if line.startswith("Next: "))
        assert ("Is it this rotor?" in step) == asked == ("pole pairs" in said)
        found = bemt.fly(file, mass_kg=weight, case="10x4.5").flights[0]
        ratio, _ = found.over_case
        assert ratio == pytest.approx(factor**-2, rel=0.1)  # CT grows with the Reynolds number
        assert not asked or f"{ratio**0.5:.2f} times the logged speeds" in found.other_rotor

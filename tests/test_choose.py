"""Promises of ``choose``: agrees with ``drive``, ranks as stated, refuses what cannot be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import bemt
from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.rotors.case.motor import NamedMotor
from bemt.rotors.propeller import rotor_of
from bemt.tools.design import motors_file
from bemt.tools.design.answer import best_of_each
from bemt.tools.design.motors_file import KnownMotor, read_motors
from bemt.tools.design.search import POWER_BAND
from bemt.tools.drive import drive_result

FEW = ("9x6", "10x4.5", "11x5.5", "10x7")


def choose(*args, **options):
    return bemt.choose(*args, **options).table


@pytest.fixture(scope="module")
def few():
    return choose(6.0, 3, labels=FEW, kv=(600.0, 1600.0))


@pytest.mark.parametrize("label, kv, cells", [("10x4.5", 900.0, 3), ("15x5", 400.0, 6), ("6x4x3", 2300.0, 4)])
def test_hover_and_full_throttle_are_those_of_drive(label: str, kv: float, cells: int) -> None:
    case = drive_result.with_drive(rotor_of(label).case, kv=kv, cells=cells)
    throttle = drive_result.full_throttle(case, bands=False)
    full = throttle["thrust_N"].value
    mass = 0.4 * full / 9.80665
    found = choose(0.9 * full, cells, labels=[label], motors=[KnownMotor("M", kv)], mass_kg=mass).iloc[0]
    hover = drive_result.solve(drive_result.with_drive(case, mass_kg=found.at_N / 9.80665)).hover
    assert found.full_thrust_N == pytest.approx(full, rel=0.01)
    assert found.peak_A == pytest.approx(throttle["battery_A"].value, rel=0.02)  # what the controller has to stand
    assert found.rpm == pytest.approx(hover["rpm"].value, rel=0.003)
    assert found.power_W == pytest.approx(hover["power_W"].value, rel=0.01)
    assert found.current_A == pytest.approx(hover["battery_A"].value, rel=0.01)
    assert found.u_power_W == pytest.approx(POWER_BAND * hover["power_W"].u, rel=0.3)


def test_power_in_flight_is_above_momentum_theory() -> None:
    T, V = 10.0, 25.0
    found = choose(T, 6, labels=["8x3.5x3", "9x4x3", "9x6", "10x7"], kv=(500.0, 1500.0), airspeed_m_s=V)
    power = found.dropna(subset=["power_W"])
    area = np.array([math.pi / 4 * (0.0254 * float(label.split("x")[0])) ** 2 for label in power.label])
    induced = np.sqrt(0.25 * V**2 + T / (2.0 * 1.225 * area)) - 0.5 * V
    assert len(power) and (power.power_W > T * (V + induced)).all()


def test_the_first_is_the_smallest_near_the_least_power_and_the_least_is_the_second(few) -> None:
    sure = few[few.probability >= 0.9]
    first, rest = sure.iloc[0], sure.iloc[1:]
    near = sure[sure.mean_W <= 1.05 * sure.mean_W.min()]
    assert first.diameter_in == near.diameter_in.min() and first.mean_W <= 1.05 * sure.mean_W.min()
    assert np.all(np.diff(rest.mean_W) >= 0.0) and (few.why.iloc[1:] != "").all()
    assert set(few.index[: len(sure)]) == set(sure.index)


def test_hover_lifts_the_propulsion_and_what_a_large_rotor_weighs_makes_the_optimum_finite() -> None:
    ask = {
        "cells": 4, "mass_kg": 2.0, "rotors": 4, "labels": ["10x4.5", "15x5", "22x7.5", "32x11"],
        "kv": (100.0, 1200.0),
    }  # fmt: skip
    best = choose(**ask, rest_kg=1.2).drop_duplicates("label").set_index("label")
    lifted = (best.at_N / 9.80665 - 0.001 * best.propulsion_g) * 4
    assert lifted.to_numpy() == pytest.approx(0.6 * 2.0)
    assert best.propulsion_g["32x11"] > 2.0 * best.propulsion_g["15x5"] > 2.0 * best.propulsion_g["10x4.5"]
    assert best.power_W["32x11"] > best.power_W["15x5"] < best.power_W["10x4.5"]
    more = choose(**ask, rest_kg=1.4).set_index("label").loc["15x5"]
    assert more.at_N.max() > best.at_N["15x5"]


@pytest.mark.parametrize("more", [{}, {"motors": [KnownMotor("M", 900.0)]}])
def test_the_first_hovers_the_mass_that_was_asked_for_as_drive_does(more) -> None:
    found = bemt.choose(cells=4, mass_kg=1.4, rotors=4, max_diameter_in=10.0, capacity_Ah=5.0,
                        **{"labels": ["9x4", "10x4.5"]} | more)  # fmt: skip
    first = found.table.iloc[0]
    assert first.mass_kg == pytest.approx(1.4, rel=0.003) and "hover of 1.4 kg" in str(found).splitlines()[0]
    rest = found.table.mass_kg - 4e-3 * found.table.propulsion_g
    assert rest.to_numpy() == pytest.approx(rest[0], rel=1e-3)  # a heavier motor is carried, not taken off the payload
    told = bemt.drive(first.label, kv=first.kv, cells=4, mass_kg=1.4, rotors=4, capacity_Ah=5.0)
    same = 0.02 if more else 0.1  # one motor; with K_v alone `choose` has one as large as the thrust asks for
    assert first.power_W == pytest.approx(told.hover["power_W"].value, rel=same)
    assert first.minutes == pytest.approx(told.hover["minutes"].value, rel=same)


def test_a_frame_limits_the_diameter() -> None:
    found = choose(6.0, 4, arm_mm=110.0, rotors=4, mass_kg=0.6, kv=(1500.0, 3500.0))
    assert found.diameter_in.max() * 25.4 <= 2.0 * 110.0 * math.sin(math.pi / 4.0) / 1.05


def test_fans_and_water_are_answered_below_the_ideal_of_momentum_theory() -> None:
    for ask, rho in (({"fan": True, "cells": 6, "max_diameter_in": 2.8}, 1.225),
                     ({"fluid": "water", "cells": 4, "labels": ["3x2x3", "3x2.5x3", "4x3"]}, 999.1)):  # fmt: skip
        found = choose(18.0, **ask).dropna(subset=["power_W"])
        area = np.pi / 4.0 * (0.0254 * found.diameter_in) ** 2
        # a duct of the annulus without loss: half of the induced power of an open disk
        ideal = 18.0**1.5 / np.sqrt((4.0 if rho < 2.0 else 2.0) * rho * area)
        assert (found.probability > 0.9).any() and (found.power_W > ideal).all()
    assert choose(400.0, 4, labels=["3x2x3"], fluid="water", kv=(300.0, 3000.0)).why.str.contains("cavitate").all()


def test_a_coaxial_pair_needs_more_than_two_rotors_apart() -> None:
    ask = {"cells": 4, "labels": ["12x5"], "kv": 600.0}
    apart, pair = choose(6.0, **ask).iloc[0], choose(6.0, rotors=2, coaxial=True, **ask).iloc[0]
    assert 1.05 < pair.power_W / apart.power_W < 1.42  # sqrt(2): both in the wake of one disk


def test_a_higher_target_is_never_more_probable() -> None:
    motors = [KnownMotor(f"{kv:.0f}", kv) for kv in np.geomspace(600.0, 1600.0, 12)]
    less, more = (choose(T, 3, labels=FEW, motors=motors) for T in (6.0, 8.0))
    both = less.merge(more, on=["label", "motor"])
    assert (both.probability_y <= both.probability_x + 1e-12).all()
    assert (both.full_thrust_N_x - both.full_thrust_N_y).abs().max() < 1e-6 * both.full_thrust_N_x.max()


def test_the_front_falls_with_size(few) -> None:
    edge = bemt.choose(6.0, 3, labels=FEW, kv=(600.0, 1600.0)).front()
    assert np.all(np.diff(edge.diameter_in) > 0) and np.all(np.diff(edge.power_W) < 0)
    assert len(best_of_each(few)) == few.label.nunique()


def test_time_is_part_of_the_target() -> None:
    ask = {"labels": ["11x5.5"], "kv": (900.0, 900.0), "mass_kg": 1.2, "rotors": 4, "capacity_Ah": 5.0}
    free = choose(None, 3, **ask).iloc[0]
    assert choose(None, 3, minutes=0.5 * free.minutes, **ask).probability.iloc[0] > 0.9 * free.probability
    assert choose(None, 3, minutes=3.0 * free.minutes, **ask).probability.iloc[0] == 0.0


def test_a_known_motor_narrows_the_power() -> None:
    label, kv = ["10x4.5"], 900.0
    typical = choose(5.0, 3, labels=label, motors=[KnownMotor("M", kv)]).iloc[0]
    known = choose(5.0, 3, labels=label, motors=[KnownMotor("M", kv, 0.1, 0.9)]).iloc[0]
    assert known.u_power_W < typical.u_power_W and known.motor == "M"
    worse = choose(5.0, 3, labels=label, motors=[KnownMotor("M", kv, 0.3, 0.9)]).iloc[0]
    assert worse.power_W > known.power_W and worse.full_thrust_N < known.full_thrust_N


@pytest.mark.slow
def test_the_stated_probability_is_met_by_makers_not_calibrated_on(shared_data, project) -> None:
    import importlib.util

    spec = importlib.util.spec_from_file_location("choose_truth", project / "docs" / "choose_truth.py")
    truth = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(truth)
    table = truth.points(shared_data / "drivecalc", 30)
    for known in (False, True):
        stated, met = truth.answers(table, known).mean(axis=0)
        assert abs(stated - met) < 0.15


def test_an_unreachable_target_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["choose", "--thrust-N", "60", "--cells", "3", "--kv", "900", "--labels", "10x4.5", "9x6"]
    assert main(words) == 1
    assert "none meets it" in capsys.readouterr().out


@pytest.mark.parametrize(
    "request_, where",
    [
        ({"thrust_N": 0.0, "cells": 3}, "thrust-N"), ({"thrust_N": -3.0, "cells": 3}, "thrust-N"),
        ({"thrust_N": math.nan, "cells": 3}, "thrust-N"), ({"cells": 3}, "thrust-N"), ({"thrust_N": 5.0}, "cells"),
        ({"thrust_N": 5.0, "cells": 0}, "cells"), ({"thrust_N": 5.0, "cells": 3, "max_tip_mach": 1.2}, "max-tip-mach"),
        ({"thrust_N": 5.0, "cells": 3, "blades": (200,)}, "blades"),
        ({"thrust_N": 5.0, "cells": 3, "kv": (1, 2)}, "kv"),
        ({"thrust_N": 5.0, "cells": 3, "max_diameter_in": 254.0}, "max-diameter-in"),
        ({"thrust_N": 5.0, "cells": 3, "minutes": 9.0}, "capacity-Ah"),
        ({"thrust_N": 5.0, "cells": 3, "capacity_Ah": 5000.0, "mass_kg": 1.0}, "thrust-N|capacity-Ah"),
        ({"thrust_N": 1.0, "cells": 3, "mass_kg": 10.0}, "thrust-N"),
        ({"thrust_N": 4000.0, "cells": 6, "max_diameter_in": 10.0}, "thrust-N"),
        ({"thrust_N": 5.0, "cells": 3, "airspeed_m_s": 200.0}, "airspeed-m-s"),
        ({"thrust_N": 5.0, "cells": 3, "sure": 1.5}, "sure"),
        ({"thrust_N": 5.0, "cells": 3, "labels": ["10y5"]}, ""), ({"thrust_N": 5.0, "cells": 3, "labels": ""}, ""),
        ({"thrust_N": "5", "cells": 3}, "thrust-N"), ({"thrust_N": math.inf, "cells": 3}, "thrust-N"),
        ({"thrust_N": 5.0, "cells": 3.5}, "cells"), ({"thrust_N": 5.0, "cells": -3}, "cells"),
        ({"thrust_N": 5.0, "cells": 3, "kv": "900"}, "kv"), ({"thrust_N": 5.0, "cells": 3, "kv": (9, 99, 999)}, "kv"),
        ({"thrust_N": 5.0, "cells": 3, "kv": math.nan}, "kv"), ({"thrust_N": 5.0, "cells": 3, "blades": 0}, "blades"),
        ({"thrust_N": 5.0, "cells": 3, "max_diameter_in": -3.0}, "max-diameter-in"),
        ({"thrust_N": 5.0, "cells": 3, "airspeed_m_s": -1.0}, "airspeed-m-s"),
        ({"mass_kg": 1500.0, "cells": 3}, "mass-kg"),
        ({"mass_kg": 1.5, "cells": 3, "rotors": 0}, "rotors"), ({"thrust_N": 0.02, "cells": 3}, "thrust-N"),
        ({"thrust_N": 5.0, "cells": 3, "capacity_Ah": -1.0}, "capacity-Ah"),
        ({"thrust_N": 5.0, "cells": 3, "sure": 90.0}, "sure"),
        ({"thrust_N": 5.0, "cells": 3, "motors": "none.csv"}, ""),
        ({"thrust_N": 5.0, "cells": 3, "fluid": "oil"}, "fluid"),
        ({"thrust_N": 5.0, "cells": 3, "fan": True, "fluid": "water"}, "fan"),
        ({"thrust_N": 5.0, "cells": 3, "coaxial": True, "rotors": 3}, "rotors"),
        ({"thrust_N": 5.0, "cells": 3, "rest_kg": 1.0}, "rest-kg"),
        ({"thrust_N": 5.0, "cells": 3, "arm_mm": 0.2}, "arm-mm"),
    ],
)  # fmt: skip
def test_odd_requests_are_refused(request_, where: str) -> None:
    with pytest.raises(InputError) as error:
        choose(**request_)
    if where:
        assert {f.where for f in error.value.faults} <= {word.replace("-", "_") for word in where.split("|")}


def test_a_thrust_outside_the_standard_sizes_names_the_range_that_they_carry() -> None:
    with pytest.raises(InputError) as error:
        choose(3000.0, 6, max_diameter_in=18.0)
    least, most = (float(v) for v in error.value.faults[0].expected.split(" N")[0].split(" to "))
    assert len(choose(0.95 * most, 20, max_diameter_in=18.0, kv=300.0)) and least < most < 3000.0


HEAD = "name,kv,resistance_mohm,no_load_A\n"


@pytest.mark.parametrize(
    "text",
    [
        HEAD + "A,900,90,0.8\nB,400,,\n", "Name,KV,Resistance_mOhm,No_Load_A,price\nA,900,90,0.8,12\n\nB,400,,,\n",
        "\ufeff" + HEAD.replace(",", ";") + "A;900;90;0,8\nB;400;;\n",
        "kv\tno_load_A\tresistance_mohm\tname\n900\t0,8\t90,0\tA\n400\t\t\tB\n",
    ],
)  # fmt: skip
def test_a_file_of_motors_is_read(text: str, tmp_path) -> None:
    file = tmp_path / "motors.csv"
    file.write_text(text, encoding="utf-8")
    a, b = read_motors(file)
    assert (a.name, a.kv, a.resistance_ohm, a.no_load_A) == ("A", 900.0, pytest.approx(0.09), 0.8)
    assert b.kv == 400.0 and math.isnan(b.resistance_ohm) and math.isnan(b.no_load_A)


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("", 1), ("\n \n", 1), (HEAD, 1), ("name,kv\nA,900\n", 2), (HEAD + "A,9,0.01,nan\nB,x,5,-1\n", 5),
        (HEAD + "A,900,0.09,0.8\n", 1), (HEAD + "A,900,90,800\n", 1), (HEAD + "A,0.9,90,0.8\n", 1),
        (HEAD + "A,900,90,0,8\n", 1), (HEAD + "A,-900,inf,0.8\nB,,90,0.8\n", 3), (b"\xff\xfe\x00", 1),
    ],
)  # fmt: skip
def test_a_doubtful_file_of_motors_is_refused_with_all_its_faults(text: str | bytes, faults: int, tmp_path) -> None:
    file = tmp_path / "motors.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        read_motors(file)
    assert len(error.value.faults) == faults


@pytest.mark.parametrize("motor", [KnownMotor("M", 900.0), KnownMotor("M", 900.0, 0.1)])
def test_the_nominal_thrust_is_met_as_often_as_not(motor: KnownMotor) -> None:
    nominal = choose(3.0, 3, labels="10x4.5", motors=[motor]).full_thrust_N.iloc[0]
    assert choose(nominal, 3, labels="10x4.5", motors=[motor]).probability.iloc[0] == pytest.approx(0.5, abs=0.08)


def test_the_command_writes_document_table_and_picture(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    motors = tmp_path / "motors.csv"
    motors.write_text("name,kv,resistance_mohm,no_load_A\nM,900,80,0.6\n")
    words = ["choose", "--thrust-N", "6", "--cells", "3", "--labels", *FEW]
    assert main([*words, "--motors", str(tmp_path / "none.csv")]) == 2
    assert main([*words, "--motors", str(motors), "--out", str(tmp_path / "o")]) == 0
    assert {f.name for f in (tmp_path / "o").iterdir()} == {"choose.json", "choose.csv", "choose.png"}
    assert "P(met)" in capsys.readouterr().out


def test_motors_on_sale_are_named_where_their_list_is_installed() -> None:
    pytest.importorskip("pythrust", reason="extra motors")
    found = bemt.choose(mass_kg=1.4, cells=4, rotors=4, labels=["12x4.5", "13x4.5"])
    stock = found.on_sale.to_dict("records")
    assert len(stock) == len({row["maker"] for row in stock}) > 1
    for row in stock:
        assert row["label"] == found.table.label[0] and row["probability"] >= 0.9
        assert row["peak_A"] <= row["max_current_A"] and row["asked_N"] <= row["full_thrust_N"]
        assert row["motor"] in found.text
    assert "Apache-2.0" in found.text and found.to_dict()["on_sale"][0]["motor"] == stock[0]["motor"]
    usual = stock[0]  # the one to buy: the K_v of the first line is hardly on sale
    (buy,) = [line for line in found.text.splitlines() if line.startswith("On sale is ")]
    assert found.text.splitlines().index(buy) <= 2 and f"{usual['motor']} ({usual['kv']:.0f} rev/min/V)" in buy
    light, heavy = sorted(stock, key=lambda row: row["motor_g"])[:: len(stock) - 1]
    more = 1e-3 * 9.80665 * (heavy["motor_g"] - light["motor_g"])  # each lifts itself
    assert heavy["at_N"] - light["at_N"] == pytest.approx(more, rel=0.1)
    same = {"labels": [heavy["label"]], "motors": heavy["motor"], "rest_kg": found.target.rest_kg}
    named = bemt.choose(mass_kg=1.4, cells=4, rotors=4, **same)
    assert named.power_W.iloc[0] == pytest.approx(heavy["power_W"], rel=1e-3)
    assert named.on_sale.empty
    with pytest.raises(InputError, match="no motor has"):
        bemt.choose(8.0, 3, motors="Nobody 9999 12345")


def test_a_motor_is_held_against_the_amperes_and_watts_of_its_maker(monkeypatch: pytest.MonkeyPatch) -> None:
    """One on sale is left out; one that is given is tried, and what it takes too much is said beside it."""
    asked: dict[str, Any] = {"thrust_N": 6.0, "cells": 3, "labels": ["11x5.5"]}
    even = choose(**asked, kv=(700, 1500)).iloc[0]

    def stock(watts: float, amperes: float) -> tuple[NamedMotor, ...]:
        told = 1.1 * even.kv, 80.0, 0.6, even.motor_g, "a list: M", "Maker", amperes, watts
        return (NamedMotor("M", *told),)

    for watts, amperes, left in ((9e3, 900.0, 1), (60.0, 900.0, 0), (9e3, 0.85 * even.peak_A, 0)):
        monkeypatch.setattr("bemt.tools.design.motors_file.motors_on_sale", lambda w=watts, a=amperes: stock(w, a))
        assert len(bemt.choose(**asked, kv=(700, 1500)).on_sale) == left
        motor = KnownMotor("M", 1.1 * even.kv, 0.08, 0.6, even.motor_g, amperes, "Maker", watts)
        one = bemt.choose(**asked, motors=[motor])
        unit = "" if left else "W of 60" if watts < 100.0 else "A of"
        assert ("at full throttle" in one.table.why.iloc[0]) == (not left) and unit in one.text.splitlines()[0]


def test_three_blades_of_a_racer_need_more_power_than_two() -> None:
    """As on the RS2205S, 4.5 to 8.6 % more: what is on sale with three blades has more drag than the drawing."""
    table = choose(3.0, 4, labels=["5x4", "5x4x3"], kv=2600.0).set_index("label")
    assert table.power_W["5x4x3"] > table.power_W["5x4"]


def test_an_answer_says_what_stands_in_the_way(capsys: pytest.CaptureFixture[str]) -> None:
    label = ["--labels", "17x6", "--rotors", "4", "--mass-kg", "1.2", "--cells", "4"]
    assert main(["choose", *label, "--rest-kg", "0.72", "--capacity-Ah", "5", "--minutes", "33"]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    assert "nearest is 17x6" in first and "time" in first
    assert main(["choose", *label, "--kv", "80", "200"]) == 1
    assert "200 is the largest K_v that was tried" in capsys.readouterr().out
    assert main(["choose", "--mass-kg", "0.03", "--rotors", "4", "--cells", "1", "--max-diameter-in", "1.6"]) == 2
    assert "--max-diameter-in" in capsys.readouterr().err  # not the thrust, which a small rotor makes


def test_a_motor_that_is_recommended_is_one_that_drive_does_not_call_unusual() -> None:
    """Racers of 5 in on 4S have 2300 to 2750 rev/min/V: what is far above is not tried, a fast one is told."""
    found = bemt.choose(10.0, 4, labels=["5x3", "5x4"])
    first, fastest = found.table.iloc[0], found.table.loc[found.table.kv.idxmax()]
    for pair in (first, fastest):
        (note,) = [n for n in bemt.drive(pair.label, kv=pair.kv, cells=4).notes if "combination" in n]
        assert "common for racing" in note
    assert "! a fast combination, common for racing" in found.text and "even chance from" in found.text.splitlines()[0]
    assert "--kv LOW:HIGH tries others" not in found.text
    told = bemt.choose(10.0, 4, labels="5x3", kv=3673.0)
    (note,) = [n for n in bemt.drive("5x3", kv=3673.0, cells=4).notes if "combination" in n]
    assert "unusual combination" in note and f"! {note}" in told.text
    assert "combination" not in bemt.choose(8.0, 3, labels="10x4.5", kv=(700, 1500)).text


def test_the_motor_to_buy_is_named_beside_the_ideal_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest of those on sale, above the table; without any, nothing."""
    asked: dict[str, Any] = {"thrust_N": 8.0, "cells": 3, "labels": "10x4.5", "kv": (700, 1500)}
    first = choose(**asked).iloc[0]
    offers = [KnownMotor(f"Maker {k} {first.kv * k:.0f}", first.kv * k, 0.12, 0.8, first.motor_g, 90.0, f"M{k}")
              for k in (1.0, 1.05)]  # fmt: skip
    monkeypatch.setattr(motors_file, "on_sale", lambda *_: offers)
    found = bemt.choose(**asked)
    best = found.on_sale.iloc[0]
    (buy,) = [line for line in found.text.splitlines()[:4] if line.startswith("On sale is ")]
    assert len(found.on_sale) == 2 and f"{best.motor} ({best.kv:.0f} rev/min/V)" in buy
    assert f"{best.full_thrust_N:.3g} N at full throttle" in buy
    monkeypatch.setattr(motors_file, "on_sale", lambda *_: [])
    assert "On sale is" not in bemt.choose(**asked).text

"""Sanity before physics: each planted fault is found and named; a clean recording is left in peace."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.app.cli import main
from bemt.base import units
from bemt.base.errors import InputError
from bemt.data.recordings.check import Finding, check
from bemt.data.recordings.load import import_file
from bemt.judge.diagnose import other_rotor
from bemt.physics.dataset import Dataset

INCH = units.INCH
KGF, LBF = units.KGF, units.LBF


def stand(rows: int = 15, seed: int = 0, diameter: float = 10 * INCH, noise: float = 0.004) -> dict[str, np.ndarray]:
    """A made-up stand: constant CT and CQ, a motor with 72 % efficiency, noise on every sensor."""
    rng = np.random.default_rng(seed)

    def noisy(v: np.ndarray) -> np.ndarray:
        return v * (1 + noise * rng.standard_normal(rows))

    rpm = np.linspace(2500.0, 8500.0, rows)
    n = rpm / 60
    thrust, torque = 0.105 * 1.18 * n**2 * diameter**4, 0.0075 * 1.18 * n**2 * diameter**5
    power = torque * n * 2 * math.pi
    voltage = 16.0 - 0.1 * np.arange(rows)
    return {
        "time_s": 4.0 * np.arange(rows), "pulse_width_s": np.linspace(1.1e-3, 1.9e-3, rows), "rpm": noisy(rpm),
        "thrust_N": noisy(thrust), "torque_Nm": noisy(torque), "voltage_V": noisy(voltage),
        "current_A": noisy(power / 0.72 / voltage), "temperature_K": np.full(rows, 294.0),
        "pressure_Pa": np.full(rows, 100900.0),
    }  # fmt: skip


def recording(values: dict[str, np.ndarray]) -> Dataset:
    own = {k: unit.suffix if (unit := units.split_suffix(k)[1]) else "" for k in values}
    return Dataset("bench", "table", values, lines=range(2, len(next(iter(values.values()))) + 2), units=own)


def said(found: tuple[Finding, ...], id_: str, channel: str = "") -> list[Finding]:
    return [f for f in found if f.id == id_ and channel in f.channel]


# ---------------------------------------------------------------- made-up stand


@pytest.mark.parametrize("diameter", [3 * INCH, 5 * INCH, 10 * INCH, 18 * INCH, 28 * INCH])
@pytest.mark.parametrize("told", [True, False])
def test_a_clean_recording_has_no_findings(diameter: float, told: bool) -> None:
    values = stand(diameter=diameter)
    values["rpm"] = values["rpm"] * (10 * INCH / diameter)
    scale = (10 * INCH / diameter) ** 2
    values["thrust_N"], values["torque_Nm"] = values["thrust_N"] * scale, values["torque_Nm"] * scale
    values["current_A"] = values["current_A"] * scale * (10 * INCH / diameter)
    assert check(recording(values), diameter_m=diameter if told else None) == ()


SLIPS = [
    ("thrust_N", 1 / KGF, "thrust_unit", "kgf taken for N"),
    ("thrust_N", 1000 / KGF, "thrust_unit", "gf taken for N"),
    ("thrust_N", 1 / LBF, "thrust_unit", "lbf taken for N"), ("thrust_N", KGF, "thrust_unit", "N taken for kgf"),
    ("thrust_N", 1000.0, "thrust_unit", "gf taken for kgf"), ("thrust_N", 1e-3, "thrust_unit", "kgf taken for gf"),
    ("torque_Nm", 1000.0, "torque_unit", "mNm taken for Nm"),
    ("torque_Nm", 100 / KGF, "torque_unit", "kgf cm taken for Nm"),
    ("torque_Nm", 1 / (LBF * INCH), "torque_unit", "lbf in taken for Nm"),
    ("rpm", 7.0, "rpm_electrical", "7 pole pairs"), ("rpm", 14.0, "rpm_electrical", "14 pole pairs"),
    ("rpm", units.RPM, "rpm_unit", "rad/s taken for rev/min"),
    ("rpm", 1 / 60, "rpm_unit", "rev/s (Hz) taken for rev/min"),
]  # fmt: skip


@pytest.mark.parametrize("pitch", [None, 6 * INCH])
@pytest.mark.parametrize(("channel", "factor", "id_", "words"), SLIPS)
def test_a_slip_of_a_unit_is_named_with_its_factor(
    channel: str, factor: float, id_: str, words: str, pitch: float | None
) -> None:
    values = stand()
    values[channel] = values[channel] * factor
    found = check(recording(values), diameter_m=10 * INCH, pitch_m=pitch)
    named = [f for f in found if f.id.endswith(("unit", "electrical")) and "diameter" not in f.channel]
    assert len(named) == 1, found
    text = named[0].correction
    told = re.search(r"over (\d+) to (\d+) pole pairs", text)
    pairs = round(factor)
    inside = told is not None and int(told[1]) <= pairs <= int(told[2])
    assert words in text or (id_ == "rpm_electrical" and inside), text
    assert f"{channel}: " in text and re.search(r"is [-\d.e+]+, must be", named[0].evidence)


@pytest.mark.parametrize(("channel", "factor", "id_", "words"), [s for s in SLIPS if s[0] != "rpm"])
def test_the_file_s_own_products_name_the_slip_exactly(channel: str, factor: float, id_: str, words: str) -> None:
    """Shaft power and efficacy as the stand's software wrote them: one answer, no alternatives, no diameter needed."""
    values = stand()
    shaft = values["torque_Nm"] * values["rpm"] * units.RPM
    values["power_W"] = shaft
    values["electrical_power_W"] = values["voltage_V"] * values["current_A"]
    values["efficacy_N_W"] = values["thrust_N"] / values["electrical_power_W"]
    values[channel] = values[channel] * factor
    got = recording(values)
    got = replace(got, units={**got.units, "efficacy_N_W": "N/W"})
    (finding,) = [f for f in check(got) if f.id == id_]
    assert words in finding.correction.split("Fits as well")[0] and finding.severity == "error"


@pytest.mark.parametrize(
    ("factor", "words"), [(7.0, "divide by 7"), (units.RPM, "rad/s taken"), (1 / 60, "rev/s (Hz)")]
)
def test_a_speed_that_the_shaft_power_contradicts(factor: float, words: str) -> None:
    values = stand()
    values["power_W"] = values["torque_Nm"] * values["rpm"] * units.RPM
    values["rpm"] = values["rpm"] * factor
    (finding,) = [f for f in check(recording(values)) if f.id.startswith("rpm")]
    assert words in finding.correction.split("Fits as well")[0]


@pytest.mark.parametrize("efficiency", [0.35, 0.6, 0.74, 0.85])
@pytest.mark.parametrize("over_load", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("battery", [False, True])
def test_power_of_a_wattmeter_beside_the_torque(efficiency: float, over_load: float, battery: bool) -> None:
    """Its ratio to torque x speed is an efficiency; at 0.74 that is nearly a foot-pound, and the torque was blamed."""
    values = stand()
    share = efficiency * (1.0 + over_load * np.linspace(1.0, -1.0, 15))
    values["power_W"] = values["torque_Nm"] * values["rpm"] * units.RPM / share
    values["voltage_V"], values["current_A"] = np.full(15, 15.0), values["power_W"] / 15.0
    values["voltage_V"][::2] = 15.3
    if not battery:
        del values["voltage_V"], values["current_A"]
    noise = 1.0 + 0.003 * np.random.default_rng(1).standard_normal(15)
    found = check(recording(values | {"power_W": values["power_W"] * noise}), diameter_m=10 * INCH)
    (finding,) = found
    assert (finding.id, finding.channel, finding.severity) == ("power_electrical", "power_W", "warning")
    assert f"torque x speed is {efficiency:.2g}"[:-1] in finding.evidence
    assert finding.correction.startswith("is it electrical power? Then name the column electrical_power_W")
    # the unit comes second, and only where it fits
    assert ("torque_Nm: lbf ft" in finding.correction) == (efficiency == 0.74 and over_load < 0.1)


def test_a_foot_pound_to_the_last_digit_and_a_shaft_power_are_no_wattmeter() -> None:
    values = stand()
    values["power_W"] = values["torque_Nm"] * values["rpm"] * units.RPM
    pounds = values | {"torque_Nm": values["torque_Nm"] / units.UNITS["lbf_ft"].factor}
    (finding,) = check(recording(pounds), diameter_m=10 * INCH)
    assert finding.id == "torque_unit" and "lbf ft taken for Nm" in finding.correction
    # torque of a poor gain beside a power of the shaft: the battery gives more than either
    poor = values | {"torque_Nm": 0.8 * values["torque_Nm"] * (1 + 0.01 * np.sin(np.arange(15)))}
    assert not said(check(recording(poor), diameter_m=10 * INCH), "power_electrical")


def test_electrical_beside_optical_speed() -> None:
    values = stand()
    speed = values.pop("rpm")
    other = speed * (1 + 1e-3 * np.sin(np.arange(15)))
    assert check(recording(values | {"optical_rpm": speed, "electrical_rpm": other})) == ()
    both = recording(values | {"optical_rpm": speed, "electrical_rpm": 7.0 * other})
    (finding,) = check(both)
    assert finding.id == "rpm_electrical" and finding.channel == "electrical_rpm"
    assert "divide by 7" in finding.correction and "one speed over the other is 0.1429" in finding.evidence


@pytest.mark.parametrize(("true", "set_"), [(6, 7), (7, 6), (3, 2), (12, 11)])
def test_two_speeds_whose_ratio_is_that_of_two_windings_name_the_count(true: int, set_: int) -> None:
    """A controller that is set to another motor's pole pairs: no load says so, the optical counter does."""
    values = stand()
    speed = values.pop("rpm")
    seen = {"optical_rpm": speed, "electrical_rpm": speed * true / set_ * (1 + 1e-3 * np.sin(np.arange(15)))}
    (finding,) = check(recording(values | seen), diameter_m=10 * INCH)
    assert finding.severity == "error" and finding.id == "rpm_ratio", finding
    assert (
        f"set to {set_} instead of {true}" in finding.correction
        or f"set to {true} instead of {set_}" in finding.correction
    )


def test_loads_that_are_off_by_any_factor_are_no_miscounted_speed() -> None:
    """Small numbers have a ratio near anything: only a second speed is evidence of one."""
    for factor in (2.0, 1.5, 0.6):
        values = stand()
        values["thrust_N"] = values["thrust_N"] * factor
        values["torque_Nm"] = values["torque_Nm"] * factor
        assert not any("instead of" in f.correction for f in check(recording(values), diameter_m=10 * INCH))


@pytest.mark.parametrize("factor", [25.4, 1 / 25.4, 1 / INCH, 1e3])
def test_a_diameter_in_another_unit(factor: float) -> None:
    found = check(recording(stand()), diameter_m=10 * INCH * factor)
    assert any("diameter" in f.channel and f"{1 / factor:.3g}"[:4] in f.correction for f in found), found


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("tip_gap_m", 0.5, "mm taken for m"),
        ("tip_gap_m", 0.02 / INCH, "in taken for m"),
        ("wall_distance_m", 1500.0, "mm taken"),
    ],
)
def test_lengths_in_another_unit(name: str, value: float, words: str) -> None:
    values = stand() | {name: np.full(15, value)}
    (finding,) = check(recording(values), diameter_m=10 * INCH)
    assert finding.id == "length_unit" and finding.channel == name and words in finding.correction
    good = {"tip_gap_m": 5e-4, "wall_distance_m": 1.5}[name]
    assert check(recording(values | {name: np.full(15, good)}), diameter_m=10 * INCH) == ()


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("temperature_K", lambda v: v - 273.15, "add 273.15"), ("pressure_Pa", lambda v: v / 100, "hPa taken for Pa"),
        ("pressure_Pa", lambda v: v / 1000, "kPa taken for Pa"),
    ],
)  # fmt: skip
def test_the_air_in_another_unit(name: str, change: Callable[[np.ndarray], np.ndarray], words: str) -> None:
    values = stand()
    values[name] = change(values[name])
    (finding,) = check(recording(values), diameter_m=10 * INCH)
    assert finding.id == "air_unit" and words in finding.correction


@pytest.mark.parametrize("channel", ["thrust_N", "torque_Nm", "current_A", "rpm"])
def test_signs(channel: str) -> None:
    values = stand()
    values[channel] = -values[channel]
    (finding,) = said(check(recording(values), diameter_m=10 * INCH), "sign_flipped", channel)
    assert finding.rows == () and "multiply by -1" in finding.correction
    values[channel] = -values[channel]
    values[channel][9:12] *= -1
    (finding,) = said(check(recording(values), diameter_m=10 * INCH), "sign_flipped", channel)
    assert finding.rows == (9, 10, 11) and "lines 11, 12, 13" in finding.evidence


def test_negative_thrust() -> None:
    values = stand()
    values["thrust_N"][7] = -0.3 * values["thrust_N"].max() / 5
    (finding,) = check(recording(values), diameter_m=10 * INCH)
    assert (finding.id, finding.rows) == ("negative_thrust", (7,))
    flying = values | {"airspeed_m_s": np.where(np.arange(15) == 7, 30.0, 0.0)}  # above the pitch speed: physics
    assert not said(check(recording(flying), diameter_m=10 * INCH), "negative_thrust")


@pytest.mark.parametrize("share", [0.0, 0.12])
def test_thrust_that_is_negative_at_low_speed_is_wind_and_no_sign(share: float) -> None:
    """A windmill, some speeds misread; rows of any speed with the other sign stay what they are."""
    values = stand(rows=60, seed=2)
    n = values["rpm"] / 60.0
    values["thrust_N"] = values["thrust_N"] * (1.0 - 70.0 / n)
    values["rpm"] = np.where(np.random.default_rng(3).random(60) < share, 14000.0, values["rpm"])
    found = check(recording(values))
    assert not said(found, "sign_flipped") and "in wind" in said(found, "negative_thrust")[0].evidence
    stated = check(recording(values | {"airspeed_m_s": np.full(60, 12.0)}))
    assert not said(stated, "negative_thrust") and not said(stated, "sign_flipped")
    turned = stand(rows=60, seed=2)
    turned["thrust_N"] = np.where(np.arange(60) % 3 == 0, -1.0, 1.0) * turned["thrust_N"]
    assert said(check(recording(turned)), "sign_flipped")


def test_a_few_misread_rows_of_a_log_are_no_contradiction() -> None:
    n = 200
    rpm = np.linspace(4000.0, 8000.0, n)
    torque = 2e-9 * rpm**2
    values = {"rpm": rpm, "torque_Nm": torque, "electrical_power_W": 1.4 * torque * rpm * units.RPM}
    for rows, severity in ((8, "warning"), (80, "error")):
        odd = values["torque_Nm"].copy()
        odd[n - rows :] *= 2.0
        (finding,) = said(check(recording(values | {"torque_Nm": odd})), "power_above_input")
        assert finding.severity == severity


def test_flagged_spikes_are_no_contradiction() -> None:
    """A log flags what one sample misread; a slip of the whole column is none."""
    rpm = np.linspace(4000.0, 8000.0, 60)
    odd = rpm.copy()
    odd[::10] = 40000.0
    flags = tuple(("spike of rpm",) if k % 10 == 0 else () for k in range(60))
    log = replace(recording({"rpm": odd, "thrust_N": 1e-7 * rpm**2}), flags=flags)
    assert not said(check(log, diameter_m=10 * INCH), "tip_mach")
    everywhere = replace(recording({"rpm": 8.0 * rpm, "thrust_N": 1e-7 * rpm**2}), flags=(("spike of rpm",),) * 60)
    assert check(everywhere, diameter_m=10 * INCH)


def test_power_above_the_electrical_input() -> None:
    values = stand()
    values["current_A"] = values["current_A"] * 0.6
    (finding,) = said(check(recording(values), diameter_m=10 * INCH), "power_above_input")
    assert "1.2" in finding.evidence and finding.severity == "error"
    values = stand()
    values["current_A"][12] *= 0.5
    (finding,) = check(recording(values), diameter_m=10 * INCH)
    assert (finding.id, finding.rows) == ("power_above_input", (12,))


@pytest.mark.parametrize("gain", [0.6, 1.0])
def test_a_current_that_is_low_at_part_throttle_is_left_out_and_the_loads_go_on(gain: float, tmp_path: Path) -> None:
    """Where a gain is wrong as well as where it is not; a gain alone is not known to be the current's."""
    values = stand(rows=20)
    only = check(recording(values | {"current_A": 0.6 * values["current_A"]}))
    assert [f.channel for f in said(only, "power_above_input")] == ["torque x speed"]
    chopped = 1.0 - 0.5 * np.sin(math.pi * np.linspace(0.0, 1.0, 20)) ** 2
    values["current_A"] = gain * chopped * values["current_A"]
    (finding,) = said(check(recording(values)), "power_above_input")
    assert finding.channel == "current_A" and finding.severity == "error"
    file = tmp_path / "log.csv"
    text = [",".join(values), *(",".join(f"{v:.8g}" for v in row) for row in zip(*values.values(), strict=True))]
    file.write_text("\n".join(text) + "\n")
    answer = bemt.diagnose(file, "10x5", only=["thrust_gain"]).diagnosis
    (part,) = answer.problem.parts
    assert not {"current_A", "electrical_power_W"} & part.record.extra.keys() and "voltage_V" in part.record.extra
    assert not other_rotor.impossible(answer.problem) and answer.next.kind != "mend"


def test_a_figure_of_merit_above_one_with_the_limit_of_a_duct() -> None:
    values = stand()
    values["torque_Nm"] = values["torque_Nm"] * 0.5  # FM 0.67 becomes 1.15
    found = check(recording(values), diameter_m=10 * INCH)
    assert said(found, "fm_above_1") and "an open one stays below 1" in said(found, "fm_above_1")[0].evidence
    assert check(recording(values), diameter_m=10 * INCH, ducted=True) == ()
    values["torque_Nm"] = values["torque_Nm"] * 0.6
    assert said(check(recording(values), diameter_m=10 * INCH, ducted=True), "fm_above_1")
    assert not said(check(recording(values)), "fm_above_1")  # unknown diameter: nothing can be known


def test_duplicated_channels() -> None:
    for one, two in (("torque_Nm", "thrust_N"), ("current_A", "voltage_V"), ("thrust_N", "rpm")):
        values = stand()
        values[one] = values[two] * (1.0 if one != "thrust_N" else KGF)
        found = said(check(recording(values)), "duplicate_column")
        assert len(found) == 1 and {one, two} == {found[0].channel, *re.findall(r"as (\w+)", found[0].evidence)}


@pytest.mark.parametrize("channel", ["thrust_N", "torque_Nm", "rpm", "current_A"])
def test_constant_columns_and_dead_sensors(channel: str) -> None:
    values = stand()
    values[channel] = np.full(15, float(np.median(values[channel])))
    (finding,) = said(check(recording(values), diameter_m=10 * INCH), "constant_column")
    assert finding.channel == channel and finding.severity == "error"
    values[channel] = np.zeros(15)
    (finding,) = said(check(recording(values), diameter_m=10 * INCH), "dead_sensor")
    assert finding.channel == channel and finding.severity == "note"


@pytest.mark.parametrize("factor", [1000.0, 1.0 / 9.80665])
def test_a_unit_that_changes_within_a_column(factor: float) -> None:
    values = stand()
    values["torque_Nm"] = np.where(np.arange(15) < 7, 1.0, factor) * values["torque_Nm"]
    (finding,) = said(check(recording(values)), "units_within")
    assert finding.rows == tuple(range(7, 15)) and "line 9" in finding.evidence
    values["torque_Nm"] = 0.02 + stand()["torque_Nm"]  # a zero is no unit
    assert not said(check(recording(values)), "units_within")


def test_a_wrong_speed_of_some_rows_is_no_unit_of_a_load() -> None:
    values = stand()
    values["rpm"] = np.where(np.arange(15) < 4, 3.5, 1.0) * values["rpm"]  # as counters read at idle
    findings = check(recording(values))
    (finding,) = said(findings, "speed_within")
    assert finding.rows == tuple(range(4)) and not said(findings, "units_within")


def test_a_line_of_constant_speed_is_no_stuck_sensor() -> None:
    J = np.linspace(0.1, 0.7, 13)
    line = Dataset("bench", "line", {"rpm": np.full(13, 5000.0), "J": J, "CT": 0.1 - 0.1 * J, "CP": 0.05 - 0.02 * J})
    assert check(line) == ()


@pytest.mark.parametrize("factor", [0.1, 0.5, 2.0, 3.9, 10.0])
@pytest.mark.parametrize("rows", [5, 8, 20])
def test_one_mistyped_reading_of_a_table_is_found_and_its_neighbours_are_not(factor: float, rows: int) -> None:
    made = stand(rows)
    table = {k: made[k].copy() for k in ("rpm", "thrust_N")}
    assert not said(check(recording(table)), "misread")
    table["thrust_N"] += 0.2 * table["thrust_N"].max()  # a shifted zero is no mistyped reading
    assert not said(check(recording(table)), "misread")
    wrong = {k: made[k].copy() for k in ("rpm", "thrust_N")}
    wrong["thrust_N"][-2] *= factor
    (found,) = said(check(recording(wrong)), "misread")
    assert found.rows == (rows - 2,) and f"line {rows}" in found.evidence


@pytest.mark.parametrize("factor", [0.1, 2.0, 10.0])
def test_one_mistyped_reading_of_a_tunnel_is_found_and_a_windmill_is_none(factor: float) -> None:
    n, J = np.repeat([3500.0, 4500.0, 5500.0], 7), np.tile(np.linspace(0.0, 0.75, 7), 3)  # no thrust at J 0.65
    noise = 1.0 + 0.01 * np.random.default_rng(2).standard_normal(21)
    table = {"rpm": n, "airspeed_m_s": J * n / 60.0 * 0.3, "thrust_N": 1e-7 * n**2 * (0.65 - J) * (1.0 + J) * noise}
    assert not said(check(recording(table)), "misread")
    table["thrust_N"][9] *= factor
    (found,) = said(check(recording(table)), "misread")
    assert found.rows == (9,) and "m/s" in found.evidence


def test_time_going_backwards() -> None:
    values = stand()
    values["time_s"][8:] -= 20.0
    (finding,) = check(recording(values), diameter_m=10 * INCH)
    assert (finding.id, finding.rows, finding.severity) == ("time_backwards", (8,), "error")
    assert "line 10" in finding.evidence and "sort the rows" in finding.correction
    runs = values | {"run": np.where(np.arange(15) < 8, 1.0, 2.0)}  # another run has its own clock
    assert check(recording(runs), diameter_m=10 * INCH) == ()


def stepped(interval: float, lag: float, late: int = 0) -> dict[str, np.ndarray]:
    """A log of steps of the pulse width, each held over 40 rows; the speed follows with a time constant."""
    command = np.repeat([1.1e-3, 1.5e-3, 1.3e-3, 1.8e-3, 1.2e-3], 40)
    rpm = 1.2e7 * (command - 0.9e-3)
    for i in range(1, rpm.size):
        rpm[i] += (rpm[i - 1] - rpm[i]) * math.exp(-interval / lag)
    rpm = np.r_[np.full(late, rpm[0]), rpm[: rpm.size - late]] * (1 + 1e-3 * np.sin(np.arange(rpm.size)))
    return {"time_s": interval * np.arange(rpm.size), "pulse_width_s": command, "rpm": rpm, "thrust_N": 1.2e-7 * rpm**2}


@pytest.mark.parametrize(("scale", "words"), [(1e3, "ms taken for s"), (1e6, "us taken for s")])
@pytest.mark.parametrize("response", ["rpm", "thrust_N"])
def test_a_rotor_that_takes_minutes_to_follow_has_another_unit_of_time(scale: float, words: str, response: str) -> None:
    values = stepped(0.02, 0.12)
    values["time_s"] *= scale
    del values[{"rpm": "thrust_N", "thrust_N": "rpm"}[response]]
    (found,) = said(check(recording(values)), "time_unit")
    assert found.channel == "time_s" and found.evidence.startswith(f"{response} has followed 4 steps of the command")
    assert words in found.correction


@pytest.mark.parametrize(
    ("interval", "lag", "late"),
    [
        (0.02, 0.12, 0),  # the same log in seconds
        (30.0, 0.12, 0),  # points written down by hand
        (30.0, 0.12, 1),  # read at the moment of the command
        (1000.0, 0.5, 1),  # one point in a quarter of an hour
        (1.0, 3.0, 0),  # a slow controller
        (20.0, 4.0, 1),
    ],
)
def test_slow_recordings_keep_their_seconds(interval: float, lag: float, late: int) -> None:
    assert not said(check(recording(stepped(interval, lag, late))), "time_unit")


def test_nothing_is_said_where_nothing_can_be_known() -> None:
    values = stand()
    assert check(recording({"thrust_N": values["thrust_N"] * KGF})) == ()
    assert check(recording({"rpm": values["rpm"], "thrust_N": values["thrust_N"] / KGF})) == ()
    assert check(Dataset("table", "table", {"x": [1.0, 2.0]}, units={"x": ""})) == ()
    assert check(Dataset("table", "table", {"thrust_N": [np.nan]})) == ()


def test_nothing_is_changed() -> None:
    values = stand()
    values["thrust_N"] = values["thrust_N"] / KGF
    got = recording(values)
    before = {k: v.copy() for k, v in got.values.items()}
    assert check(got, diameter_m=10 * INCH)
    assert all(np.array_equal(before[k], v) for k, v in got.values.items())


def test_several_faults_are_all_found() -> None:
    values = stand()
    values["thrust_N"] = -values["thrust_N"]
    values["time_s"][5] = -1.0
    values["voltage_V"] = np.full(15, 15.0)
    values["optical_rpm"] = np.zeros(15)
    ids = {f.id for f in check(recording(values), diameter_m=10 * INCH)}
    assert ids == {"sign_flipped", "time_backwards", "constant_column", "dead_sensor"}


# ---------------------------------------------------------------- published recordings

STEPS = "rcbenchmark/StepsTest_2020-05-22_102946.csv"
LOG = "rcbenchmark/Log_2019-11-05_171350.csv"
XNOVA = "thrust_map/xNova-SR-steps.csv"
DUALSKY = "jmajew/grp01__dualsky-eco2814c-v2_graupner-10x6_4s_table1.csv"
MN2206 = "jmajew/grp01__mn2206_hqprop6x3-5_3s_table2.csv"
TMOTOR = "tmotor28_tr594/tmotor28_data.csv"
SIZE = {DUALSKY: (10 * INCH, 6 * INCH), MN2206: (6 * INCH, 3.5 * INCH), TMOTOR: (28 * INCH, 9.2 * INCH)}
"""Diameter and pitch where the name of the file tells them."""
THRUST = {STEPS: "Thrust (gf)", LOG: "Thrust (gf)", DUALSKY: "th", MN2206: "th", TMOTOR: "T(gf)"}
TORQUE = {STEPS: "Torque (N·m)", LOG: "Torque (N·m)", DUALSKY: "tq", MN2206: "tq", TMOTOR: "Q(Nm)"}
SPEED = {
    STEPS: "Motor Electrical Speed (RPM)", LOG: "Motor Electrical Speed (RPM)", DUALSKY: "rpm", MN2206: "rpm",
    TMOTOR: "RPM",
}  # fmt: skip
CURRENT = {STEPS: "Current (A)", DUALSKY: "a", LOG: "Current (A)"}
TIME = {STEPS: "Time (s)", LOG: "Time (s)", XNOVA: "Time (s)"}
SAME_AS = {TMOTOR: {"T(gf)": ("T(N)",)}}
"""Columns that repeat another one: who mistakes a unit mistakes both."""

DOCUMENTED = {
    "jmajew": {"power_above_input", "power_unit"},
    "rcbenchmark": {"dead_sensor", "time_backwards", "sign_flipped", "power_above_input"},
    "thrust_map": {"dead_sensor", "time_backwards", "sign_flipped"},
}
"""Real faults of the published files.

jmajew: with the small motors, torque x speed exceeds the electrical power at part throttle (up to 1.7 times, back below
1 at full throttle), and `Power Out` of the raw record is torque x rev/s. rcbenchmark: no optical probe, a first time
stamp that is late, torque of a left-hand rotor, two misread speeds of one log. thrust_map: a thrust stand that pulls.
"""

Change = Callable[[np.ndarray], np.ndarray]


def planted(source: Path, folder: Path, name: str, changes: dict[str, Change | str]) -> Dataset:
    """The file with some columns changed (a function) or overwritten by another one (its heading)."""
    text = source.read_text(encoding="utf-8-sig")
    mark = ";" if ";" in text.split("\n", 1)[0] else ","
    lines = [line.split(mark) for line in text.rstrip("\n").split("\n")]
    head = [cell.strip() for cell in lines[0]]
    for heading, change in list(changes.items()):
        for twin in SAME_AS.get(name, {}).get(heading, ()):
            changes[twin] = change
    for heading, change in changes.items():
        at = head.index(heading)
        if isinstance(change, str):
            for row in lines[1:]:
                row[at] = row[head.index(change)]
            continue
        rows = [row for row in lines[1:] if row[at].strip()]
        for row, value in zip(rows, change(np.array([float(r[at]) for r in rows])), strict=True):
            row[at] = f"{value:.10g}"
    path = folder / source.name
    path.write_text("\n".join(mark.join(row) for row in lines) + "\n", encoding="utf-8")
    return import_file(path)


def times(factor: float) -> Change:
    return lambda v: v * factor


def flip(first: int, last: int) -> Change:
    return lambda v: np.where((np.arange(len(v)) >= first) & (np.arange(len(v)) < last), -v, v)


def stuck(v: np.ndarray) -> np.ndarray:
    return np.full(len(v), float(np.median(v)))


def jump_back(v: np.ndarray) -> np.ndarray:
    out = v.copy()
    out[len(v) // 2 :] -= 0.4 * (v[-1] - v[0])
    return out


def _cases() -> list[tuple[str, str, str, dict[str, Change | str], str, str]]:
    out: list[tuple[str, str, str, dict[str, Change | str], str, str]] = []
    for f in (STEPS, DUALSKY, TMOTOR):
        T, Q, n = THRUST[f], TORQUE[f], SPEED[f]
        gf = units.UNITS["gf"].factor
        for words, factor in (("N for gf", gf), ("kgf for gf", 1e-3), ("lbf for gf", gf / LBF)):
            out.append((f"thrust: {words}", f, "thrust_unit", {T: times(factor)}, "thrust", words.split()[0]))
        for words, unit in (("mNm", "mNm"), ("kgf cm", "kgf_cm"), ("lbf in", "lbf_in")):
            factor = units.UNITS["Nm"].factor / units.UNITS[unit].factor
            out.append((f"torque: {words}", f, "torque_unit", {Q: times(factor)}, "torque", words))
        out.append(("electrical rpm, 7 pole pairs", f, "rpm_electrical", {n: times(7.0)}, "rpm", "pole pairs"))
        out.append(("electrical rpm, 11 pole pairs", f, "rpm_electrical", {n: times(11.0)}, "rpm", "pole pairs"))
        out.append(("rad/s for rpm", f, "rpm_unit", {n: times(units.RPM)}, "rpm", "rad/s"))
        out.append(("rev/s for rpm", f, "rpm_unit", {n: times(1 / 60)}, "rpm", "rev/s"))
        out.append(("thrust of the other sign", f, "sign_flipped", {T: times(-1.0)}, "thrust", "-1"))
        out.append(("thrust of the other sign in rows", f, "sign_flipped", {T: flip(5, 8)}, "thrust", "those rows"))
        out.append(("torque of the other sign", f, "sign_flipped", {Q: times(-1.0)}, "torque", "-1"))
        low: Change = lambda v: np.where(np.arange(len(v)) == 5, -0.08 * v.max(), v)  # noqa: E731
        out.append(("negative thrust", f, "negative_thrust", {T: low}, "thrust", "still air"))
        out.append(("torque column is a copy", f, "duplicate_column", {Q: T}, "", "copy"))
        for what, column in (("thrust", T), ("torque", Q), ("speed", n)):
            out.append((f"constant {what}", f, "constant_column", {column: stuck}, "", "stuck"))
    for f in (STEPS, DUALSKY, LOG):
        power = "pin" if f == DUALSKY else "Electrical Power (W)"
        less: dict[str, Change | str] = {CURRENT[f]: times(0.3), power: times(0.3)}
        out.append(("power above the input", f, "power_above_input", less, "", "unit or gain"))
    for f in (STEPS, LOG, XNOVA):
        out.append(("time going backwards", f, "time_backwards", {TIME[f]: jump_back}, "time", "clock"))
    for f in (DUALSKY, MN2206, TMOTOR):
        out.append(("figure of merit above 1", f, "fm_above_1", {TORQUE[f]: times(0.3)}, "", "gain"))
    return out


@pytest.mark.parametrize(
    ("what", "file", "id_", "changes", "channel", "words"), _cases(), ids=lambda v: v if isinstance(v, str) else ""
)
def test_each_planted_fault_is_found_in_real_files(
    what: str,
    file: str,
    id_: str,
    changes: dict[str, Change | str],
    channel: str,
    words: str,
    shared_data: Path,
    tmp_path: Path,
) -> None:
    D, pitch = SIZE.get(file, (None, None))
    source = shared_data / file
    if not source.is_file():
        pytest.skip(f"{file} is not in the reference data")
    original = {
        (f.id, f.channel) for f in check(import_file(source), diameter_m=D, pitch_m=pitch) if f.severity == "error"
    }
    found = check(planted(source, tmp_path, file, dict(changes)), diameter_m=D, pitch_m=pitch)
    channel = {"thrust": "T_N", "torque": "Q_Nm"}.get(channel, channel) if file == TMOTOR else channel
    named = [
        f
        for f in found
        if channel in f.channel and words in f.correction and (f.id == id_ or id_.endswith(("unit", "electrical")))
    ]
    assert named, (what, [str(f) for f in found])
    assert (id_, named[0].channel) not in original


def test_the_originals_have_the_documented_findings_and_no_others(shared_data: Path) -> None:
    seen: dict[str, dict[str, int]] = {}
    for folder in sorted({*DOCUMENTED, "mit_copter_rcbenchmark", "thrust_step", "tmotor28_tr594", "uiuc", "x22a"}):
        files = sorted(f for f in (shared_data / folder).rglob("*") if f.is_file())
        for file in files[:: 10 if folder == "uiuc" else 1]:
            try:
                found = check(import_file(file))
            except InputError:
                continue
            for finding in found:
                assert finding.id in DOCUMENTED.get(folder, set()), (file.name, str(finding))
                kinds = seen.setdefault(folder, {})
                kinds[finding.id] = kinds.get(finding.id, 0) + 1
    assert seen["rcbenchmark"]["dead_sensor"] == 17 and seen["jmajew"]["power_unit"] == 1
    assert seen["jmajew"]["power_above_input"] == 28 and seen["thrust_map"]["sign_flipped"] == 4


def test_the_names_of_propellers_tell_sizes_with_which_nothing_is_found(shared_data: Path) -> None:
    for file, (diameter, pitch) in SIZE.items():
        found = {f.id for f in check(import_file(shared_data / file), diameter_m=diameter, pitch_m=pitch)}
        assert found <= ({"power_above_input"} if file == MN2206 else set()), file


def test_a_rotor_in_water_is_judged_by_the_diameter_and_the_fluid_of_its_case(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither a guessed diameter nor the density of air makes a slip of a unit of sound loads; with no case, one is."""
    file = bemt.propeller("10x10", rpm=900).write(tmp_path / "ship")
    text = re.sub(r"(?m)^density_kg_m3 = .*", 'fluid = "water"', file.read_text())
    whole, *assumptions = text.split("[[assumptions]]")
    file.write_text("[[assumptions]]".join([whole, *(a for a in assumptions if "air.density" not in a)]))
    case, at = str(file), np.array([700.0, 800.0, 900.0, 1000.0])
    d = bemt.load(case).solve(rpm=at, airspeed_m_s=2.0)
    lines = [f"{n:.0f},2,{T:.4f},{Q:.5f}" for n, T, Q in zip(at, d.thrust_N, d.torque_Nm, strict=True)]
    (tmp_path / "tank.csv").write_text("\n".join(["n (rpm),V (m/s),Thrust (N),Torque (Nm)", *lines]) + "\n")
    for name, v in (("thrust", d.thrust_N[2]), ("torque", d.torque_Nm[2])):
        rows = "".join(f"{i} {v:.5f}\n" for i in range(1, 40))
        (tmp_path / f"{name}.out").write_text(f'"{name}"\n"Iteration" "{name}"\n("Iteration" "{name}")\n{rows}')
    cfd = [str(tmp_path / "thrust.out"), str(tmp_path / "torque.out"), "--rpm", "900", "--airspeed-m-s", "2"]
    cfd += ["--unit", "thrust=N", "torque=Nm"]
    for files in ([str(tmp_path / "tank.csv")], cfd):
        assert main(["import", *files]) == 0
        assert "diameter guessed" in capsys.readouterr().out
        assert main(["import", *files, "--case", case]) == 0
        assert "Suggestion" not in capsys.readouterr().out
    assert main(["diagnose", str(tmp_path / "tank.csv"), "--case", case, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []


def test_loads_of_two_rows_that_were_exchanged_are_left_out_and_their_lines_named() -> None:
    """Both stand out of the curve of all others, which is judged by its median."""
    values = {k: v for k, v in stand(rows=9).items() if k != "time_s"}
    for channel in ("thrust_N", "torque_Nm"):
        values[channel][[3, 6]] = values[channel][[6, 3]]
    found = said(check(recording(values)), "misread")
    assert {f.channel: f.rows for f in found} == {"thrust_N": (3, 6), "torque_Nm": (3, 6)}
    assert all("loads of lines 5 and 8 exchanged" in f.correction for f in found)
    values["thrust_N"][1] *= 3.0  # a third is no exchange, and too many of nine to say who is right
    assert not said(check(recording(values)), "misread", "thrust_N")

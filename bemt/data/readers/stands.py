"""Stands by name: thrust_tool, a coaxial stand, a Crazyflie on a scale.

Tables of the thrust_tool stand (J. Majewski), throttle steps with an error per channel, have one row per throttle
step and headings without units::

    out,th,th_err,tq,tq_err,rpm,rpm_err,v,v_err,a,a_err,pin,theff

out [%], th [gf], tq [gf cm], rpm [1/min], v [V], a [A], pin [W], theff [gf/W]; ``_err`` is the stated error in the unit
of its channel. That these units hold shows in pin = v a and theff = th/pin, which the checks of any recording look at.

Raw records have one row per sample and no time; their headings name units as ``Thrust [G]`` (gram-force), counts of the
converters have none. ``RPM [1/min]`` is no sensor of its own: it is ``ESCT RPM`` (telemetry, hundreds of electrical
revolutions per minute) over the pole pairs; the factor is found in the file and reported.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bemt.base import units
from bemt.data.readers import first_cells
from bemt.data.readers.headings import Heading, slug
from bemt.data.readers.recording import Builder
from bemt.data.readers.samples import Channel
from bemt.physics.dataset import Dataset

_JMAJEW_TABLE = {
    "out": ("throttle", "pct"), "th": ("thrust", "gf"), "tq": ("torque", "gf_cm"), "rpm": ("", "rpm"),
    "v": ("voltage", "V"), "a": ("current", "A"), "pin": ("electrical_power", "W"), "theff": ("efficacy", "gf/W"),
}  # fmt: skip
_JMAJEW_RAW = {  # in the raw record the same words without a unit head the counts
    "Motor Level": ("throttle", "pct"), "Thrust": ("thrust", "gf"), "Torque": ("torque", "gf_cm"), "RPM": ("", "rpm"),
    "VoltBatt": ("voltage", "V"), "CurrBatt": ("current", "A"), "Power In": ("electrical_power", "W"),
    "Power Out": ("mechanical_power", "W"), "Efficiency": ("motor_efficiency", "pct"),
    "Thrust Efficiency": ("efficacy", "gf/W"),
}  # fmt: skip
_JMAJEW = {
    **_JMAJEW_TABLE, "Motor Output": ("pulse_width", "us"), **{f"{k} [": usual for k, usual in _JMAJEW_RAW.items()},
    **{f"{k}_err": (f"{name}_err".lstrip("_"), unit) for k, (name, unit) in _JMAJEW_TABLE.items() if k != "theff"},
}  # fmt: skip


def _base(text: str) -> str:
    return text.partition("[")[0].strip()


def _jmajew(build: Builder) -> Dataset:
    raw = "ESCT RPM" in build.table.headings
    said = {"stand": "thrust_tool (J. Majewski)", "form": "raw" if raw else "table",
            **_name(Path(build.table.source.name).stem)}  # fmt: skip
    with np.errstate(over="ignore", invalid="ignore"):  # damaged cells may hold any number
        (_check_raw if raw else _check_table)(build)
    build.flag(np.flatnonzero(build.channels["thrust_N"].values < 0.0), "thrust_N is negative")
    build.flag(np.flatnonzero(build.channels["rpm"].values == 0.0), "rpm is 0")
    if said.get("propeller") == "none":
        build.warnings.append("recorded without a propeller: a tare of the stand, not performance data")
    build.check_magnitudes()
    return build.finish(said)


def _name(stem: str) -> dict[str, str]:
    """Motor, propeller, cells and duct as the file name tells them."""
    low = stem.lower()
    out = {"run_name": stem}
    if cells := re.search(r"_(\d)s(_|$)", low):
        out["battery_cells"] = cells[1]
    if re.search(r"no-?prop", low):
        out["propeller"] = "none"
    elif found := re.search(r"__([^_]+)_([^_]+)_\d+s", low):
        out["motor"], out["propeller"] = found[1], found[2]
    if re.search(r"(^|_)duct(_|$)", low):
        out["duct"] = "yes"
    return out


def _check_table(build: Builder) -> None:
    """Flag errors that no reading has, and a throttle that falls."""
    c = {name: channel.values for name, channel in build.channels.items()}
    for name in [n for n in c if "_err_" in n or n.endswith("err_rpm")]:
        build.flag(np.flatnonzero(c[name] < 0.0), f"{name} is negative")
        main = name.replace("_err_", "_").replace("err_rpm", "rpm")
        if main in c:
            wide = np.flatnonzero(c[name] > 20.0 * max(float(np.nanmedian(c[name])), 1e-12))
            build.flag(wide, f"stated error of {main} above 20 times its median")
    if "throttle" in c:
        build.flag(np.flatnonzero(np.diff(c["throttle"], prepend=-np.inf) <= 0.0), "throttle does not rise")


def _check_raw(build: Builder) -> None:
    c = {name: channel.values for name, channel in build.channels.items()}
    telemetry, rpm = c.get("ESCT_RPM"), c["rpm"]
    if telemetry is not None:
        good = (telemetry > 0) & (rpm > 0)
        if np.count_nonzero(good) >= 3:
            ratio = rpm[good] / telemetry[good]
            usual = float(np.median(ratio))
            if float(np.max(np.abs(ratio / usual - 1.0))) < 1e-3:
                pairs = 100.0 / usual
                text = f"rpm is ESCT RPM x {usual:.5g} in all rows: ESC telemetry"
                near = abs(pairs - round(pairs)) < 0.01
                whole = f" of electrical speed over {round(pairs)} pole pairs" if near else ""
                build.warnings.append(text + whole + ", not a separate sensor")
    build.warnings.append("no time in a raw record: rows are in order of sampling")
    build.flag_spikes("thrust_N", "torque_Nm", "rpm")


# Tables of the New Dexterity coaxial stand: two rotors, ``Left`` upstream and ``Right`` downstream, a row per setting.
#
# PWM [us], thrust [g: gram-force], torque [Nm, its sign is the sense of rotation], voltage, current and optical speed
# per side, in these units where the heading states no other (IEEE 9720993, An Open-Source Benchmarking Platform for
# Coaxial Rotor Systems). If only one side turned, its columns get the plain names; two that turned keep ``left`` and
# ``right``. The first row is read before the tare: its loads are left out.

_SIDES = ("left", "right")
_COAXIAL_COLUMNS = {
    "PWM": ("pulse_width", "us"), "Thrust": ("thrust", "gf"), "Torque": ("torque", "Nm"), "Voltage": ("voltage", "V"),
    "Current": ("current", "A"), "Speed": ("", "rpm"),
}  # fmt: skip
_DIAMETER = re.compile(r"(?:^|_)(\d+(?:\.\d+)?)in_")


def _coaxial(build: Builder) -> Dataset:
    _tare_row(build)
    for side in _SIDES:
        _turned_positive(build, side)
    left, right = (build.channels[f"{s}_rpm"].values for s in _SIDES)
    turned = [s for s, v in zip(_SIDES, (left, right), strict=True) if np.nan_to_num(v).max(initial=0.0) > 0.0]
    if len(turned) == 2:
        with np.errstate(divide="ignore", invalid="ignore"):
            build.channels["speed_ratio"] = Channel(np.where(left > 0.0, right / left, np.nan), "-")
    if len(turned) == 1:
        _plain(build, turned[0])
        build.warnings.append(f"only the {turned[0]} rotor turned: its columns have the plain names")
    else:
        build.warnings.append("both rotors turned: choose one with rotor=left (upstream) or rotor=right (downstream)")
    build.warnings.append("air density is not in the file")
    build.flag_time()
    build.check_magnitudes()
    told = _DIAMETER.search(Path(build.table.source.name).name)
    constants = {"diameter_m": float(told[1]) * units.INCH} if told else None
    return build.finish({"stand": "New Dexterity coaxial platform"}, constants=constants)


def _tare_row(build: Builder) -> None:
    """Leave out the loads of the first row, which is read before the zero is taken."""
    pulses = [build.channels[f"pulse_width_{s}_s"].values for s in _SIDES]
    if not all(p.size > 2 and p[0] <= 1.0005e-3 for p in pulses):
        return
    for name, channel in build.channels.items():
        if name.startswith(("thrust_", "torque_")) or name.endswith("_rpm"):
            values = channel.values.copy()
            values[0] = np.nan
            build.channels[name] = Channel(values, channel.unit)
    build.flag([0], "read before the tare", "; its loads and speeds are left out")


def _turned_positive(build: Builder, side: str) -> None:
    """Torque of the sense in which a rotor turned, positive."""
    name = f"torque_{side}_Nm"
    values = build.at(name)
    if values is not None and np.nansum(values) < 0.0:
        build.channels[name] = Channel(-values, build.channels[name].unit)
        build.warnings.append(f"{name}: the sign, which is the sense of rotation here, was turned")


def _plain(build: Builder, side: str) -> None:
    """Columns of the rotor that turned under plain names."""
    other = next(s for s in _SIDES if s != side)
    for name in list(build.channels):
        parts = name.split("_")
        if other in parts:
            del build.channels[name], build.headings[name]
        elif side in parts:
            build.rename(name, "_".join(p for p in parts if p != side))


# Bench tables of a Crazyflie on a scale: total thrust of four propellers, their optical speeds, command and battery.
#
# Columns ``pwm`` (0 to 65535), ``vbat[V]``, ``rpm1`` to ``rpm4``, ``weight`` or ``weight[g]`` or ``thrust[g]`` (total,
# in gram-force), and with a power analyser ``v[V]``, ``i[A]``, ``p[W]`` of the supply (tables of Bitcraze and of IMRC,
# TU Berlin). Loads are per propeller: a fourth of the total, at the root mean square of the four speeds, since thrust
# goes with the square.

FULL = 65535.0
"""Largest command. [counts]"""
_SPEEDS = ("1_rpm", "2_rpm", "3_rpm", "4_rpm")


def _crazyflie(build: Builder) -> Dataset:
    build.channels["throttle"] = Channel(build.channels["throttle"].values * (1.0 / FULL), "-")
    build.declared["throttle"] = 1.0 / FULL
    speeds = np.array([build.channels.pop(name).values for name in _SPEEDS])
    build.channels["rpm"] = Channel(np.sqrt(np.mean(speeds**2, axis=0)), "rpm")
    build.channels["thrust_N"] = Channel(build.channels.pop("total_thrust_N").values / 4.0, "N")
    if (power := build.channels.pop("supply_power_W", None)) is not None:
        build.channels["electrical_power_W"] = Channel(power.values / 4.0, "W")
    build.headings = {k: v for k, v in build.headings.items() if k in build.channels}
    build.flag_speeds("rpm")
    with np.errstate(invalid="ignore"):
        spread = np.ptp(speeds, axis=0) > 0.25 * np.maximum(speeds.max(axis=0), 1.0)
    build.flag(np.flatnonzero(spread), "speeds of the four propellers differ by more than a quarter")
    build.warnings.append("loads are a fourth of the total of four propellers, at the rms of their speeds")
    build.warnings.append("weight and thrust are taken as gram-force; air density is not in the file")
    return build.finish({"stand": "Crazyflie on a scale"})


# Stands whose tables have columns of known names: what is their own follows when the columns are read.


@dataclass(frozen=True)
class StandTable:
    """A reader of the tables of one stand."""

    KIND: str
    marks: tuple[set[str], ...]  # Headings without their units that tell it: all of one of these sets
    # Heading without its unit, or up to the bracket of one that must have it: name of the channel, usual unit
    columns: Mapping[str, tuple[str, str]]
    needs: tuple[str, ...]
    finish: Callable[[Builder], Dataset]
    others: str = ""  # What columns of other headings are; "": left out

    def sniff(self, head: bytes | str) -> bool:
        """Tell whether the first line has this stand's headings."""
        cells = set(map(_base, first_cells(head)))
        return any(mark <= cells for mark in self.marks)

    def read(self, path: str | os.PathLike[str]) -> Dataset:
        """Read a table."""
        build = Builder.of_stand(path, self.KIND)
        for k, text in enumerate(build.table.headings):
            base = _base(text)
            usual = self.columns.get(base) or (self.columns.get(f"{base} [") if base != text else None)
            if usual is not None:
                build.add_usual(k, *usual)
            elif self.others:
                build.add(k, Heading(text, slug(text) or "column", None, self.others))
        build.table.source.check()
        build.need(*self.needs)
        build.table.source.check()
        return self.finish(build)


READERS = (
    StandTable(
        "jmajew", (set("out th th_err tq tq_err rpm".split()), {"Motor Output", "ESCT RPM", "Thrust", "Torque"}),
        _JMAJEW, ("thrust_N", "torque_Nm", "rpm"), _jmajew, "counts or telemetry",
    ),
    StandTable(
        "coaxial_stand", ({f"{what} {side}" for what in ("PWM", "Thrust", "Speed") for side in ("Left", "Right")},),
        {f"{what} {side.title()}": (f"{name}_{side}".lstrip("_"), unit)
         for what, (name, unit) in _COAXIAL_COLUMNS.items() for side in _SIDES} | {"Time": ("time", "s")},
        tuple(f"{name}{side}{unit}" for name, unit in (("pulse_width_", "_s"), ("thrust_", "_N"), ("", "_rpm"))
              for side in _SIDES),
        _coaxial,
    ),
    StandTable(
        "crazyflie_bench", tuple({"pwm", "rpm1", "rpm2", "rpm3", "rpm4", load} for load in ("weight", "thrust")),
        {"pwm": ("throttle", "-"), "vbat": ("voltage", "V"), "v": ("supply_voltage", "V"),
         "i": ("supply_current", "A"), "p": ("supply_power", "W"), "weight": ("total_thrust", "gf"),
         "thrust": ("total_thrust", "gf"), **{f"rpm{k}": (str(k), "rpm") for k in (1, 2, 3, 4)}},
        ("total_thrust_N", "throttle", *_SPEEDS), _crazyflie,
    ),
)  # fmt: skip

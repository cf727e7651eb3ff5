"""Bench tables of a Crazyflie on a scale: total thrust of four propellers, their optical speeds, command and battery.

Columns ``pwm`` (0 to 65535), ``vbat[V]``, ``rpm1`` to ``rpm4``, ``weight`` or ``weight[g]`` or ``thrust[g]`` (total, in
gram-force), and with a power analyser ``v[V]``, ``i[A]``, ``p[W]`` of the supply (tables of Bitcraze and of IMRC,
TU Berlin). Loads are per propeller: a fourth of the total, at the root mean square of the four speeds, since thrust
goes with the square.
"""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

from bemt.base import units
from bemt.data.readers import first_cells
from bemt.data.readers.columns import Channel
from bemt.data.readers.headings import known
from bemt.data.readers.recording import Builder
from bemt.physics.dataset import Dataset

KIND = "crazyflie_bench"
FULL = 65535.0
"""Largest command. [counts]"""
_COLUMNS = {
    "pwm": ("throttle", "-"), "vbat": ("voltage", "V"), "v": ("supply_voltage", "V"), "i": ("supply_current", "A"),
    "p": ("supply_power", "W"), "weight": ("total_thrust", "gf"), "thrust": ("total_thrust", "gf"),
} | {f"rpm{k}": (str(k), "rpm") for k in (1, 2, 3, 4)}  # fmt: skip
_SPEEDS = ("1_rpm", "2_rpm", "3_rpm", "4_rpm")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line has a command, four speeds and a total thrust.

    >>> sniff("pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]\n"), sniff("pwm,rpm,thrust[g]\n")
    (True, False)
    """
    cells = set(map(_base, first_cells(head)))
    return {"pwm", "rpm1", "rpm2", "rpm3", "rpm4"} <= cells and bool({"weight", "thrust"} & cells)


def _base(text: str) -> str:
    return text.partition("[")[0].strip()


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a table."""
    build = Builder.of_stand(path, KIND)
    for k, text in enumerate(h.strip() for h in build.table.headings):
        if text == "pwm":
            build.add(k, replace(known(text, *_COLUMNS["pwm"]), unit=units.Unit("", "none", 1.0 / FULL)))
        elif _base(text) in _COLUMNS:
            build.add_usual(k, *_COLUMNS[_base(text)])
    build.check()
    build.need("total_thrust_N", "throttle", *_SPEEDS)
    build.check()
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

"""Bench tables of a Crazyflie on a scale: total thrust of four propellers, their optical speeds, command and battery.

Columns ``pwm`` (0 to 65535), ``vbat[V]``, ``rpm1`` to ``rpm4``, ``weight`` or ``weight[g]`` or ``thrust[g]`` (total, in
gram-force), and with a power analyser ``v[V]``, ``i[A]``, ``p[W]`` of the supply (tables of Bitcraze and of IMRC,
TU Berlin). Loads are per propeller: a fourth of the total, at the root mean square of the four speeds, since thrust
goes with the square.
"""

from __future__ import annotations

import os

import numpy as np

from bemt.base import units
from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset
from bemt.readers import head_text, load_text
from bemt.readers._columns import Channel
from bemt.readers._headings import Heading
from bemt.readers._recording import Builder
from bemt.readers._split import split_table

KIND = "crazyflie_bench"
FULL = 65535.0
"""Largest command. [counts]"""
_LOADS = ("weight", "weight[g]", "thrust[g]")
_SPEEDS = ("rpm1", "rpm2", "rpm3", "rpm4")
_MORE = {"vbat[V]": ("voltage", "V"), "v[V]": ("supply_voltage", "V"), "i[A]": ("supply_current", "A")}


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line has a command, four speeds and a total thrust.

    >>> sniff("pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]\n"), sniff("pwm,rpm,thrust[g]\n")
    (True, False)
    """
    text = head_text(head)
    cells = {c.strip() for c in text.splitlines()[0].split(",")} if text.strip() else set()
    return {"pwm", *_SPEEDS} <= cells and bool(cells & set(_LOADS))


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a table."""
    source = load_text(path)
    table = split_table(source, header=True)
    build = Builder(table, KIND)
    twice = sorted({h for h in table.headings if h and table.headings.count(h) > 1})
    build.faults += [Fault(source.name, "1", f"a second column {name!r}", "each column once") for name in twice]
    for k, text in enumerate(h.strip() for h in table.headings):
        if text in _SPEEDS:
            build.add(k, Heading(text, f"{text[-1]}_rpm", units.UNITS["rpm"]))
        elif text in _LOADS:
            build.add(k, Heading(text, "total_thrust_N", units.UNITS["gf"]))
        elif text == "p[W]":
            build.add(k, Heading(text, "supply_power_W", units.UNITS["W"]))
        elif text in _MORE:
            name, unit = _MORE[text]
            build.add(k, Heading(text, f"{name}_{unit}", units.UNITS[unit]))
        elif text == "pwm":
            build.add(k, Heading(text, "throttle", units.Unit("", "none", 1.0 / FULL)))
    missing = [n for n in ("total_thrust_N", "throttle", *(f"{k}_rpm" for k in "1234")) if n not in build.channels]
    build.faults += [Fault(source.name, "1", f"no numbers for {n}", "a column of numbers") for n in missing]
    if build.faults:
        raise InputError(build.faults)
    speeds = np.array([build.channels.pop(f"{k}_rpm").values for k in "1234"])
    total = build.channels.pop("total_thrust_N").values
    build.channels["rpm"] = Channel(np.sqrt(np.mean(speeds**2, axis=0)), "rpm")
    build.channels["thrust_N"] = Channel(total / 4.0, "N")
    power = build.channels.pop("supply_power_W", None)
    if power is not None:
        build.channels["electrical_power_W"] = Channel(power.values / 4.0, "W")
    build.headings = {k: v for k, v in build.headings.items() if k in build.channels}
    build.flag(np.flatnonzero(build.channels["rpm"].values == 0.0), "rpm is 0")
    with np.errstate(invalid="ignore"):
        spread = np.ptp(speeds, axis=0) > 0.25 * np.maximum(speeds.max(axis=0), 1.0)
    build.flag(np.flatnonzero(spread), "speeds of the four propellers differ by more than a quarter")
    build.warnings.append("loads are a fourth of the total of four propellers, at the rms of their speeds")
    build.warnings.append("weight and thrust are taken as gram-force; air density is not in the file")
    return build.finish({"stand": "Crazyflie on a scale"})

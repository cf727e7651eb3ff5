"""Tables of the New Dexterity coaxial stand: two rotors, ``Left`` upstream and ``Right`` downstream, a row per setting.

PWM [us], thrust [g: gram-force], torque [Nm, its sign is the sense of rotation], voltage, current and optical speed per
side, in these units where the heading states no other (IEEE 9720993, An Open-Source Benchmarking Platform for Coaxial
Rotor Systems). If only one side turned, its columns get the plain names; two that turned keep ``left`` and ``right``.
The first row is read before the tare: its loads are left out.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from bemt.base import units
from bemt.data.readers import first_cells
from bemt.data.readers.columns import Channel
from bemt.data.readers.recording import Builder
from bemt.physics.dataset import Dataset

KIND = "coaxial_stand"
_SIDES = ("left", "right")
_COLUMNS = {
    "PWM": ("pulse_width", "us"), "Thrust": ("thrust", "gf"), "Torque": ("torque", "Nm"), "Voltage": ("voltage", "V"),
    "Current": ("current", "A"), "Speed": ("", "rpm"),
}  # fmt: skip
_HEAD = re.compile(r"(PWM|Thrust|Torque|Voltage|Current|Speed) (Left|Right)(?: \[[^\]]*\])?")
_DIAMETER = re.compile(r"(?:^|_)(\d+(?:\.\d+)?)in_")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line names both sides of this stand.

    >>> sniff("PWM Left,PWM Right,Thrust Left [g],Thrust Right [g],Speed Left [rpm],Speed Right [rpm]\n")
    True
    """
    found = {m.groups() for c in first_cells(head) if (m := _HEAD.fullmatch(c))}
    return {(what, side) for what in ("PWM", "Thrust", "Speed") for side in ("Left", "Right")} <= found


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a table."""
    build = Builder.of_stand(path, KIND)
    for k, text in enumerate(build.table.headings):
        if found := _HEAD.fullmatch(text.strip()):
            name, unit = _COLUMNS[found[1]]
            build.add_usual(k, f"{name}_{found[2].lower()}".lstrip("_"), unit)
        elif re.fullmatch(r"Time(?: \[[^\]]*\])?", text.strip()):
            build.add_usual(k, "time", "s")
    build.check()
    needed = [f"{k}_{side}_{unit}" for k, unit in (("pulse_width", "s"), ("thrust", "N")) for side in _SIDES]
    for name in (*needed, *(f"{side}_rpm" for side in _SIDES)):
        if name not in build.channels:
            build.fault(name, "an empty column", "numbers")
    build.check()
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

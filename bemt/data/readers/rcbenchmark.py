r"""Logs of RCbenchmark / Tyto thrust stands: step tests and continuous records.

Comma-separated, one heading line that names the units::

    Time (s),ESC signal (µs),...,Thrust (gf),...,Motor Electrical Speed (RPM),Motor Optical Speed (RPM),...,App message,

* Two speeds are kept apart and never mixed: ``electrical_rpm`` (from the motor's phases, divided by the number of
  poles that was set in the stand's software and is not in the file) and ``optical_rpm`` (tape and probe). None of them
  is called ``rpm``: a ``recording.toml`` says which one to trust. A probe that never saw a mark reads 0 throughout.
* In a step test every row is the mean of one step and the first time stamps may step back; in a continuous record the
  slow channels (thrust, torque) are empty in most rows.
* The Flight Stand software writes ``Powertrain 1 - rotation speed (rpm)``: one speed, whose sensor it does not name.
* Two motors on one stand are ``Thrust A``, ``Thrust B``, or powertrains 1 and 2. If only one of them turned, its
  columns get the plain names; two that turned keep their letters, and the user says which one a recording is about.
* Rows with 0 rpm, spikes, and times that go backwards are kept and flagged.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.readers import head_text, number
from bemt.data.readers._large import NumberTable
from bemt.data.readers.headings import heading
from bemt.data.readers.recording import Builder
from bemt.data.readers.samples import MISREAD, MOST_RPM_PER_V, against_load, spikes, stopped
from bemt.data.readers.split import SplitTable
from bemt.physics.dataset import Dataset

KIND = "rcbenchmark"
_SPEEDS = ("electrical_rpm", "optical_rpm")
_POWERTRAIN = re.compile(r"Powertrain (\d+) - (.+)")
_LETTER = re.compile(r"((?:ESC|Torque|Thrust|Voltage|Current|Motor|Electrical|Mechanical|Propeller|Overall|Vibration)"
                     r"\b.*?) ([A-D])(\s*\(.*\))?")  # fmt: skip
_HEAD = re.compile(r"(ESC( signal)?( [A-D])?|Motor (Electrical|Optical) Speed( [A-D])?|App message)\b")


def sniff(head: bytes | str) -> bool:
    r"""Tell whether the first line names time and the stand's own channels.

    >>> sniff("Time (s),ESC signal (µs),Thrust (gf),Motor Optical Speed (RPM)\n"), sniff("Time (s),Thrust (gf)\n")
    (True, False)
    >>> sniff("Time (s),Powertrain 1 - voltage (V),Powertrain 1 - current (A)\n")
    True
    """
    text = head_text(head)
    line = text.splitlines()[0] if text.strip() else ""
    cells = [c.strip().strip('"') for c in re.split(r"[,;\t]", line)]
    own = sum(bool(_HEAD.match(c) or _POWERTRAIN.fullmatch(c)) for c in cells)
    return any(c.startswith("Time (") for c in cells) and own >= 2


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read one log. ["mode"]"""
    build = Builder.of_stand(path, KIND)
    table, source = build.table, build.table.source
    source.check()
    sides = [_side(text) for text in table.headings]
    turned = [side for side in dict.fromkeys(side for _, side in sides if side) if _turned(table, sides, side)]
    for k, (text, (plain, side)) in enumerate(zip(table.headings, sides, strict=True)):
        if text == "App message" or not text:
            _messages(build, k, text)
        else:
            build.add(k, replace(heading(plain if [side] == turned else text), text=text))
    if len(turned) > 1:
        build.warnings.append(f"motors {' and '.join(turned)} turned: name the columns of one in a recording.toml")
    elif turned and len({side for _, side in sides if side}) > 1:
        build.warnings.append(f"only motor {turned[0]} turned: its columns have the plain names")
    if "time_s" not in build.channels and not source.faults:
        source.add("1", "no numbers in Time (s)", "the time of every row")
    source.check()
    said = {"stand": "RCbenchmark / Tyto", "mode": _mode(build)}
    build.flag_time()
    _speeds(build)
    if said["mode"] == "continuous":
        build.flag_spikes("thrust_N", "torque_Nm", "current_A", "voltage_V")
    build.check_magnitudes()
    return build.finish(said)


def _side(text: str) -> tuple[str, str]:
    """Heading without the motor that it is about, and that motor ("" when it names none)."""
    if found := _POWERTRAIN.fullmatch(text):
        return found[2], found[1]
    if found := _LETTER.fullmatch(text):
        return found[1] + (found[3] or ""), found[2]
    return text, ""


def _turned(table: SplitTable | NumberTable, sides: Sequence[tuple[str, str]], side: str) -> bool:
    """Whether a motor turned: its speed, or without one its thrust, was ever other than 0."""
    for words in ("speed", "thrust"):
        own = [k for k, (text, s) in enumerate(sides) if s == side and words in text.lower()]
        values = [v for k in own for cell in table.cells(k) if (v := number(cell)) is not None]
        if values:
            return any(v != 0.0 for v in values)
    return False


def _messages(build: Builder, k: int, text: str) -> None:
    """Messages of the stand's software, row by row."""
    cells = tuple(build.table.cells(k))
    if any(cells):
        build.texts["app_message" if text else f"column_{k + 1}"] = cells
        rows = [i for i, cell in enumerate(cells) if cell]
        note = f"messages of the stand in {number_of(len(rows), 'row')}, kept as text: {cells[rows[0]][:60]!r} ..."
        build.warnings.append(note)


def _mode(build: Builder) -> str:
    t, pulse = build.channels["time_s"].values, build.at("pulse_width_s")
    if len(t) < 2:
        return "steps"
    step = np.diff(t[np.isfinite(t)])
    slow = step.size > 0 and float(np.median(step)) > 0.5
    if pulse is None:
        return "steps" if slow else "continuous"
    moved = np.diff(pulse[np.isfinite(pulse)]) != 0
    return "steps" if slow and moved.size and float(np.mean(moved)) > 0.8 else "continuous"


def _speeds(build: Builder) -> None:
    """Flags of the speeds, each for itself, and what the file does not say of them."""
    seen = False
    for name in [n for n in build.channels if n.startswith(_SPEEDS) or n == "rpm"]:
        v = build.channels[name].values
        if np.any(v[np.isfinite(v)] != 0.0):
            seen = True
            _flag_speed(build, name)
        else:
            build.warnings.append(f"{name} is 0 in every row: the sensor measured nothing; ignored")
    electrical = next((n for n in build.channels if n.startswith("electrical_rpm")), None)
    if electrical and seen and not _agree(*(build.at(n) for n in _SPEEDS)):
        build.warnings.append(
            f"{electrical} is derived from the motor's phases with the number of poles set in the stand's software, "
            "which the file does not state; check it against an optical speed, or state it in a recording.toml"
        )
    if "rpm" in build.channels and seen:
        note = "rpm: the file names neither its sensor nor the number of poles set in the stand's software"
        build.warnings.append(note)


def _flag_speed(build: Builder, name: str) -> None:
    """Flag values of a speed that it cannot have had."""
    v, load, volt = build.channels[name].values, build.at("thrust_N"), build.at("voltage_V")
    zero, command = v == 0.0, build.at("pulse_width_s")
    if command is not None:
        halted = stopped(v, command, {k: c.values for k, c in build.channels.items()})
        build.flag(np.flatnonzero(halted), f"{name} is 0: motor stopped under command")
        zero &= ~halted
    if load is not None and np.any(np.isfinite(load)):
        loaded = zero & (np.abs(load) > 0.05 * np.nanmax(np.abs(load))) & ~_no_current(build)
        build.flag(np.flatnonzero(loaded), f"{name} is 0 under thrust")
        zero &= ~loaded
    build.flag(np.flatnonzero(zero), f"{name} is 0")
    build.flag(np.flatnonzero(v < 0.0), f"{name} is negative")
    moving = np.where(v > 0.0, v, np.nan)
    wild = spikes(moving) | _wild(moving, load)
    if volt is not None:
        wild |= moving > MOST_RPM_PER_V * np.where(volt > 0.5, volt, np.inf)
    build.flag(np.flatnonzero(wild), f"spike of {name}")


def _agree(electric: Array | None, optical: Array | None) -> bool:
    """Whether two sensors of the speed say the same."""
    if electric is None or optical is None or np.count_nonzero(good := (electric > 0) & (optical > 0)) < 3:
        return False
    return abs(float(np.median(electric[good] / optical[good])) - 1.0) < 0.05


def _no_current(build: Builder) -> np.ndarray:
    """Rows in which the motor draws no current: a load there is the zero of the cell."""
    ampere = build.at("current_A")
    if ampere is None or not np.any(np.isfinite(ampere)):
        return np.zeros(len(build.table), dtype=bool)
    return np.asarray(np.abs(ampere) <= 0.005 * np.nanmax(np.abs(ampere)))


def _wild(v: Array, load: Array | None) -> np.ndarray:
    """Speeds far above what the thrust of the same row allows, also at the start of a ramp."""
    out = np.zeros(len(v), dtype=bool)
    if load is not None:
        good = np.isfinite(v) & np.isfinite(load) & (load > 0.02 * np.nanmax(np.abs(np.append(load, 0.0))))
        if np.count_nonzero(good) >= 5:
            out[good] = against_load(v[good], load[good]) < 1.0 / MISREAD
    return out

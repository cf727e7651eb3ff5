"""Any table of numbers: comma, semicolon, tab, bar or blanks between cells, units in the headings.

Units are read from ``Thrust (gf)``, ``Thrust [gf]``, ``thrust_gf`` and a few names without dimension (``J``, ``CT``).
A heading without unit, or a table without headings, gives channels of unit "" and a warning: nothing is assumed. This
reader is a fallback: it takes a file only when no reader of a particular format claims it. A ``recording.toml``
beside the file (see :mod:`bemt.data.readers.recording_toml`) says what headings do not.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.base.tables import few
from bemt.data.readers import head_text, load_text
from bemt.data.readers._large import NumberTable, large_table
from bemt.data.readers._words import NEUTRAL, english
from bemt.data.readers.headings import USUAL, Heading, counts_electrical, heading, may_be, slug
from bemt.data.readers.left_open import one_step
from bemt.data.readers.recording import Builder, plausible
from bemt.data.readers.samples import Channel
from bemt.data.readers.split import (
    SplitTable,
    column_numbers,
    decimal_mark,
    find_start,
    heading_cells,
    is_comment,
    is_number,
    split_line,
    split_table,
    with_unit,
)
from bemt.physics.dataset import Dataset

KIND = "table"
FALLBACK = True
_MARKS = frozenset("0 1 2 3 4 5 6 7 8 9 g n kgf gf lbf kn nm knm mnm ncm cm mm kg lb oz gram grams gramm".split())
"""Numbers of a sensor, and units, that a heading may have beside its words."""
SETUP = re.compile(r"prop|motor|combination|setup|set-up|config|rotor|luftschraube|helice|h[ée]lice")
"""Headings of text that name what was on the stand."""
SIZE = re.compile(r"(prop(eller)?_?)?(d|dia|diam|diameter|pitch)_m$", re.IGNORECASE)
"""Channels that say how large it was."""
DOUBTFUL_RPM = 20000.0
"""Speed above which a column called rpm may count electrical revolutions."""


def _full_lines(text: str) -> list[str]:
    """Lines of a head that say something, but for the last one, which its end may cut."""
    lines = [t for t in text.splitlines() if t.strip() and not is_comment(t)]
    return lines[:-1] if len(text) >= 4096 and len(lines) > 2 else lines


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a text is a table with a column of numbers.

    >>> sniff("time;thrust_N\n0.0;1.2\n0.1;1.3\n"), sniff("A text, with commas,\nand no numbers.\n")
    (True, False)
    """
    text = head_text(head)
    lines = _full_lines(text)
    if len(lines) < 2 or lines[0].lstrip().startswith(("[", "{", "<", "!", "/*", "//")):
        return False
    lines = [t for t in lines if t.strip(" \t;,|")]
    start, mark = find_start(lines[:60])
    lines = lines[start:]
    if len(lines) < 2:
        return False
    split = [split_line(t, mark) for t in lines[:50]]
    if mark == " " and any(len(c) < 2 or sum(map(is_number, c)) < 0.8 * len(c) for c in split[1:20]):
        return False
    split[0] = heading_cells(lines[0], mark, len(split[1]))
    width = len(split[0])
    alike = sum(abs(len(cells) - width) <= 1 for cells in split[1:])
    numbers = sum(any(map(is_number, row)) for row in split[1:])
    return width > 1 and min(alike, numbers) >= 0.5 * (len(split) - 1)


def read(path: str | os.PathLike[str]) -> Dataset:
    """Read a table."""
    large = large_table(path)
    if large is None:
        table = split_table(load_text(path))
        imported = convert(table, decimal_mark(table))
    else:
        imported = convert(*large)
    beside = Path(path).with_name("recording.toml")
    if beside.is_file() and Path(path).name in beside.read_text(encoding="utf-8", errors="replace"):
        more = f"{beside.name} in the same folder names this file: import {beside.name} to use it"
        imported = replace(imported, notes=(*imported.notes, more))
    return imported


_AIR = ("temperature_K", "pressure_Pa", "density_kg_m3")


def _air_above(build: Builder) -> None:
    """Air that a line above the headings states, as ``Pressure [hPa];985`` or ``Pressure: 985 hPa``."""
    if isinstance(build.table, NumberTable):
        return
    for line, text in build.table.above:
        cells = [c for part in split_line(text, build.table.delimiter) for c in part.strip().split(": ") if c.strip()]
        if len(cells) != 2:
            continue
        value, unit = with_unit(cells[1].strip()) or (cells[1].strip(), "")
        head = heading(f"{cells[0].strip(' :')} ({unit})" if unit else cells[0].strip())
        (known,), bad, _ = column_numbers([value], build.decimal)
        if head.unit is None or bad or head.name not in _AIR or head.name in build.channels:
            continue
        filled = np.full(len(build.table), known * head.unit.factor + head.unit.offset)
        build.channels[head.name], build.headings[head.name] = Channel(filled, head.unit_name), head.text
        build.warnings.append(f"{head.text} {value} is that of all rows (line {line})")


def convert(table: SplitTable | NumberTable, decimal: str = ".") -> Dataset:
    """Make channels of a split table."""
    build = Builder(table, KIND, kind="table", decimal=decimal)
    for k, head in enumerate(heads_of(table)):
        build.add(k, head)
    _air_above(build)
    if not table.headings:
        options = ("--column rpm=1 thrust=2", "--unit rpm=rpm thrust=N")
        step = one_step(Path(build.table.source.name).as_posix(), options)
        build.warnings.append(f"no heading line: columns are numbered. With your own numbers and units: {step}")
    build.flag_time()
    speeds = [n for n in build.channels if n.rpartition("_")[2] == "rpm"]
    build.flag_speeds(*speeds)
    if "rpm" in speeds and np.nanmax(build.channels["rpm"].values, initial=0.0) > DOUBTFUL_RPM:
        build.warnings.append("rpm: the file does not say whether mechanical or electrical; taken as written")
    if "time_s" in build.channels:
        build.flag_spikes(*(k for k, c in build.channels.items() if k != "time_s" and c.unit not in ("", "-")))
    only_ones(build)
    own = build.headings[speeds[0]] if len(speeds) == 1 else ""  # of the only speed
    if own and speeds[0] not in ("rpm", "electrical_rpm", "optical_rpm", "motor_rpm", "ESC_rpm"):
        line = f'[columns] rpm = {{ column = "{own}", unit = "rpm" }}'
        text = f"{own!r} is not taken for the speed of the rotor; if it is, head it rpm, or write {line}"
        build.warnings.append(text)
    electrical(build)
    if own and counts_electrical(own):
        build.warnings.append(f"{own!r} counts electrical revolutions: the speed of the rotor is that over pole pairs")
        build.asks.append("--pole-pairs PAIRS")
    for name, kinds in setups(build.texts).items():
        build.warnings.append(f"{len(kinds)} set-ups in one file, distinguished by {name!r}: {few(kinds)}")
    build.check_magnitudes()
    loads = {"thrust_N", "torque_Nm"} & build.channels.keys()
    if loads and (speeds or {"time_s", "pulse_width_s", "throttle"} & build.channels.keys()):
        build.kind = "bench"
    return build.finish()


_DRIVE = {"V": "voltage (V)", "A": "current (A)", "W": "power (W)"}


def heads_of(table: SplitTable | NumberTable) -> list[Heading]:
    """What the headings of all columns say, beside one another."""
    heads = [heading(t) if t else Heading("", f"column_{k + 1}", None) for k, t in enumerate(table.headings)]
    heads = heads or [Heading("", f"column_{k + 1}", None) for k in range(table.width)]
    if any(head.name == "CT" for head in heads):  # beside a thrust coefficient, Cp is that of the power
        heads = [replace(h, name={"Cp": "CP", "Cq": "CQ"}.get(h.name, h.name)) for h in heads]
    if any(head.name == "CT" and head.text.upper().startswith("K") for head in heads):  # a ship's C_T is a loading
        heads = [replace(h, name=slug(h.text), unit=None) if h.text.upper().startswith("C") else h for h in heads]
    if {"V", "A"} <= {head.text.upper() for head in heads}:  # the units of what a drive takes
        heads = [replace(heading(_DRIVE.get(h.text.upper(), h.text)), text=h.text) if h.text else h for h in heads]
    return _apart(heads)


def _apart(heads: list[Heading]) -> list[Heading]:
    """Headings of one quantity in one table: the shortest is it, others with more words keep them in their names."""
    words = [frozenset(english(re.split(r"[(\[]", head.text)[0])) for head in heads]
    out = []
    for head, own in zip(heads, words, strict=True):
        shorter = any(o.name == head.name and w < own for o, w in zip(heads, words, strict=True))
        if shorter and head.unit is not None and head.unit_name not in ("rpm", "-", ""):
            base = re.sub(r"[(\[].*", "", head.text)
            head = replace(head, name=f"{slug(base.lower())}_{head.unit_name.replace('/', '_')}")
        out.append(head)
    return out


_ONLY = {  # channel: words that the heading of the only column in its unit may have
    "thrust_N": "thrust force load cell loadcell lift pull axial f fx fy fz x y z reading scale balance",
    "torque_Nm": "torque m mx my mz q x y z motor reading reaction balance",
    "voltage_V": "voltage u v motor main power mean",
    "current_A": "current i motor main power mean",
}  # fmt: skip
_AIR_UNITS = (("airspeed", "m_s", "J"), ("pressure", "Pa", "density_kg_m3"), ("temperature", "K", "density_kg_m3"))
"""Quantities of the air, their units, and the channels that make up for them."""


def only_ones(build: Builder) -> None:
    """A load that no column is headed for is that of the only column in its unit whose words leave it open.

    Of the air, where a wrong guess is not seen, such a column is asked about.
    """
    for name, words in _ONLY.items():
        quantity, unit = name.rsplit("_", 1)
        same = [k for k, c in build.channels.items() if c.unit == unit and k != "duct_thrust_N"]
        usual = {unit.lower(), *words.split(), *NEUTRAL, *_MARKS}
        ours = [k for k in same if usual.issuperset(english(build.headings[k]))]
        if name in same or not ours or any(USUAL.get(k) == name for k in build.channels):
            continue
        if len(same) == 1:
            label = build.rename(ours[0], name)
            build.warnings.append(f"{label!r} is taken for the {quantity}: the only column in {unit}")
        else:
            shown, most = ", ".join(repr(build.headings[k]) for k in ours[:6]), build.ask(quantity, ours)
            build.warnings.append(f"which of {shown} is the {quantity}? {most!r} is the largest")
    told = {USUAL.get(k, k) for k in build.channels}
    if told & {"rpm", *_ONLY}:
        _ask_for_air(build, told)


def _ask_for_air(build: Builder, told: set[str]) -> None:
    """Ask about columns that may be the airspeed or the state of the air, where nothing makes up for it."""
    for quantity, unit, other in _AIR_UNITS:
        name = f"{quantity}_{unit}"
        ours = [k for k, c in build.channels.items() if c.unit == unit and may_be(quantity, build.headings[k])]
        ours = [k for k in ours if plausible(name, build.channels[k].values)]
        if ours and not {name, other} & told:
            build.ask(quantity, ours)


def electrical(build: Builder) -> None:
    """Call a power that is voltage times current electrical: that of the shaft is less."""
    have = build.channels
    name = next((n for n in ("power_W", "P_W") if n in have), None)
    if name is None or not {"voltage_V", "current_A"} <= have.keys() or "electrical_power_W" in have:
        return
    product = have["voltage_V"].values * have["current_A"].values
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(have[name].values / product - 1.0)[product > 0.0]
    if off.size and np.nanmedian(off) < 0.01 and np.nanmax(off) < 0.05:
        build.rename(name, "electrical_power_W")
        build.warnings.append(f"{name} is voltage times current: electrical power, not that of the shaft")


def setups(
    texts: Mapping[str, Sequence[str]], values: Mapping[str, NDArray[np.float64]] | None = None
) -> dict[str, list[str]]:
    """Columns that tell several propellers or motors apart, by a word or by diameter and pitch, and what they name."""
    found = {}
    for name, column in (values or {}).items():
        sizes = np.unique(column[np.isfinite(column) & (column > 0.0)])
        if SIZE.match(name) and 1 < sizes.size <= max(2, column.size // 2):
            found[name] = [f"{v:.4g} m" for v in sizes]
    for name, cells in texts.items():
        kinds = list(dict.fromkeys(c.strip() for c in cells if c.strip()))
        if SETUP.search(name.lower()) and 1 < len(kinds) <= max(2, len(cells) // 2):
            found[name] = kinds
    return found

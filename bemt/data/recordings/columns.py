"""Columns that are copies, stuck, dead, or out of order; units of lengths and of the air."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.base.units import ZERO_CELSIUS
from bemt.data.readers.samples import LONE_SD, STICKS, lone, stuck
from bemt.data.recordings.findings import (
    Facts,
    Finding,
    check_for,
    where_of,
)
from bemt.physics.air import AIR_C, LIQUID

SENSORS = (
    "thrust_N", "duct_thrust_N", "torque_Nm", "voltage_V", "current_A", "electrical_rpm", "optical_rpm", "rpm",
    "temperature_K", "airspeed_m_s", "pressure_Pa",
)  # fmt: skip
"""Channels with a sensor of their own."""
STUCK = ("thrust_N", "duct_thrust_N", "torque_Nm", "current_A", "power_W", "electrical_power_W", "rpm",
         "electrical_rpm", "optical_rpm", "voltage_V")  # fmt: skip
"""Channels that cannot stay the same while others change."""
SLOWEST_S = 10.0
"""Time in which any rotor has followed a step of its command by two thirds, slow controllers included. [s]"""
# Rows of either unit, least factor between two units, and most that a load over the square of the speed varies in one.
_FEW, _JUMP, _STEADY = 3, 9.0, 3.0
HELD, STEPS = 6, 2
"""Rows for which a command is held after a step; steps that are looked at, at least. [1]"""


def _varies(v: Array) -> bool:
    """Whether a channel changes by more than 5 % of its size."""
    v = v[np.isfinite(v)]
    if v.size < 3:
        return False
    low, high = np.percentile(v, [5.0, 95.0])
    return bool(high - low > 0.05 * max(abs(high), abs(low)))


def _same(a: Array, b: Array) -> float | None:
    """Constant ratio b / a over five distinct values or more, else None."""
    both = np.isfinite(a) & np.isfinite(b)
    if np.count_nonzero(both) < 5 or np.any(np.isfinite(a) != np.isfinite(b)):
        return None
    x, y = a[both], b[both]
    if len(np.unique(x)) < 5 or not np.any(x != 0.0):
        return None
    k = int(np.argmax(np.abs(x)))
    ratio = float(y[k] / x[k])
    close = np.abs(y - ratio * x) <= 1e-9 * np.abs(ratio * x[k])
    return ratio if bool(np.all(close)) and ratio != 0.0 else None


@check_for("duplicates")
def duplicates(facts: Facts) -> Iterator[Finding]:
    """Two channels with the same numbers."""
    by_file = {facts.named(k): k for k in SENSORS if k in facts.values}
    names = [k for k in facts.raw if not k.startswith("u_")]
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            one, two = facts.raw[a], facts.raw[b]
            sensors = a in by_file and b in by_file and facts.unit.get(a) and facts.unit.get(b)
            ratio = _same(one, two)
            if ratio is None or b.startswith(a + "_") and b[len(a) + 1 :].isdigit():
                continue  # a column in two units is compared by the importer
            if a == "electrical_rpm" and "rpm" in b and abs(1.0 / ratio - max(2, round(1.0 / ratio))) < 1e-6:
                continue  # divided by the pole pairs, no second sensor
            equal = ratio == 1.0 and facts.unit.get(a) == facts.unit.get(b) == ""
            if sensors or equal:
                text = f"the same numbers as {a}" + ("" if ratio == 1.0 else f" times {ratio:.6g}")
                text += f" in all {int(np.isfinite(one).sum())} rows: two sensors never agree to the last digit"
                fix = f"one of the two is a copy: find the column that belongs to {b} or {a}, leave the other out"
                yield Finding("duplicate_column", b, text, fix, (), "error")


@check_for("constant")
def constant(facts: Facts) -> Iterator[Finding]:
    """A channel that stays the same while others change; all zeros mean that there was no sensor."""
    asked = ("rpm", "thrust_N", "torque_Nm", "current_A", "pwm_s", "throttle", "power_W", "voltage_V", "CT")
    moving = [k for k in asked if k in facts.values and _varies(facts.values[k])]
    if not moving or len(facts) < 5:
        return
    seen: set[str] = set()
    for name in STUCK:
        v, own = facts.values.get(name), facts.named(name)
        if v is None or own in seen or own not in facts.raw:
            continue
        finite = v[np.isfinite(v)]
        others = ", ".join(facts.named(k) for k in moving if k != name)
        if finite.size < 5 or float(np.ptp(finite)) > 0.0 or not others:
            continue
        if name == "rpm" and not facts.still.all():
            continue  # a line of constant speed through the advance ratios
        seen.add(own)
        if finite[0] == 0.0:
            text = f"0 in all {finite.size} rows while {others} change: that sensor saw nothing"
            yield Finding("dead_sensor", own, text, "leave the column out", (), "note")
        else:
            text = f"{finite[0]:.6g} in all {finite.size} rows while {others} change"
            fix = "the sensor is stuck, or the column was filled in: leave it out or record it again"
            severity = "note" if name == "voltage_V" else "error"  # a set value of a supply
            yield Finding("constant_column", own, text, fix, (), severity)


@check_for("unnamed")
def unnamed(facts: Facts) -> Iterator[Finding]:
    """A column that may be the airspeed, or the state of the air, and has no heading that says so."""
    for name, text, fix in facts.asked.values():
        yield Finding("unnamed_column", name, text, fix, (), "warning")


@check_for("misread")
def misread(facts: Facts) -> Iterator[Finding]:
    """A single load of a table of points that lies far off the curve of the others."""
    rpm, V = facts.rpm, facts.airspeed_m_s
    states = ("wall_distance_m", "tip_gap_m", "second_rotor_rad_s", "density_kg_m3", "pressure_Pa")
    if rpm is None or facts.bare or "time_s" in facts.values or "airspeed" in facts.asked:
        return
    flow = None
    if not facts.still.all():
        flow = facts.J if V is None else V / rpm * 1e3  # of the order of one
    if any(_varies(facts.values[k]) for k in states if k in facts.values):
        return
    for name, v in facts.known("thrust_N", "torque_Nm"):
        if not np.any(np.nan_to_num(v)):
            continue
        size = np.abs(np.nan_to_num(v))
        good = (np.nan_to_num(rpm) > 0.0) & ~stuck(name, facts.values)
        if flow is None:
            rows = np.flatnonzero(good & (size > 0.05 * float(np.median(size[size > 0.0]))))
            times = lone(rpm[rows], size[rows])
        else:
            rows = np.flatnonzero(good & np.isfinite(flow) & np.isfinite(v))
            sense = float(np.sign(np.sum(v[rows])))  # of no row: 0
            times = lone(rpm[rows], v[rows] * sense, flow[rows])
        odd, why = times != 1.0, "mistyped, or a loose contact? Measure it again"
        if np.count_nonzero(odd) == 2 and abs(float(np.log(times[odd]).sum())) < 2.0 * LONE_SD:
            why = f"were the loads of lines {' and '.join(str(facts.lines[i]) for i in rows[odd])} exchanged? Look"
        told = []
        for i, off in zip(rows[odd].tolist(), times[odd].tolist(), strict=True):
            at = f"{rpm[i]:.0f} rev/min"
            at += "" if flow is None else f" and J {flow[i]:.2g}" if V is None else f" and {V[i]:.3g} m/s"
            told.append(f"{v[i]:.4g} in line {facts.lines[i]} is {off:.3g} times what the others give at {at}")
        if told:
            fix = f"{why}; `diagnose` and `compare` leave it out"
            yield Finding("misread", facts.named(name), ", and ".join(told), fix, tuple(rows[odd].tolist()), "warning")


@check_for("stuck")
def sticks(facts: Facts) -> Iterator[Finding]:
    """A sensor that repeats one reading in part of a table of points."""
    for name, _ in facts.known(*STICKS):
        rows = np.flatnonzero(stuck(name, facts.values))
        if rows.size:
            whole = np.append(rows[0] - 1, rows)
            changes = [
                f"{facts.named(k)} goes from {np.nanmin(facts.values[k][whole]):.4g} to "
                f"{np.nanmax(facts.values[k][whole]):.4g}"
                for k in (*STICKS, "rpm")
                if k != name and k in facts.values and _varies(facts.values[k][whole])
            ]
            where = f"{whole.size} rows ({where_of(facts, whole)})"
            text = f"{facts.values[name][rows[0]]:.6g} to the last digit in {where} while {' and '.join(changes)}"
            left = "those rows" if name == "airspeed_m_s" else "those readings"
            fix = f"is the sensor stuck? Measure these points again; {left} are left out, all but the first"
            yield Finding("stuck_sensor", facts.named(name), text, fix, tuple(rows.tolist()), "warning")


@check_for("units_within")
def units_within(facts: Facts) -> Iterator[Finding]:
    """A load over the square of the speed that jumps by a power of ten, or more, from one row on: two units.

    A wrong speed moves every load: where electrical power over the cube of the speed jumps the same way, it is that.
    """
    rpm = facts.rpm
    if rpm is None or facts.bare:
        return
    electric = facts.filled.get("electrical_power_W")
    for name, v in facts.known("thrust_N", "torque_Nm"):
        level = np.log(np.abs(v) / rpm**2)
        powers = level * np.nan if electric is None else np.log(np.abs(electric) / rpm**3)
        rows = np.flatnonzero(np.isfinite(level))
        if rows.size < 2 * _FEW or not facts.still[rows].all():
            continue
        y = level[rows]
        k = _FEW + int(np.argmax(np.abs(np.diff(y))[_FEW - 1 : 1 - _FEW]))  # the greatest jump
        parts = y[:k], y[k:]
        jump = float(np.median(parts[1]) - np.median(parts[0]))
        if abs(jump) <= np.log(_JUMP) or any(np.ptp(part) >= np.log(_STEADY) for part in parts):
            continue
        line = facts.lines[int(rows[k])]
        power = float(np.median(powers[rows[k:]]) - np.median(powers[rows[:k]]))
        if power * np.sign(jump) > np.log(_STEADY):
            few = rows[:k] if 2 * k < rows.size else rows[k:]
            lines = f"lines {facts.lines[int(few[0])]} to {facts.lines[int(few[-1])]}"
            text = f"{lines}: {name} over its square and the electrical power over its cube jump at line {line}"
            fix = "the speed in these rows is wrong, as counters are at idle: leave them out"
            yield Finding("speed_within", facts.named("rpm"), text, fix, tuple(int(r) for r in few), "error")
            return
        text = f"over the square of the speed {np.exp(jump):.3g} times what it was, from line {line} on"
        fix = "the unit changes within the column: write both parts in one unit"
        yield Finding("units_within", facts.named(name), text, fix, tuple(int(r) for r in rows[k:]), "error")


@check_for("time")
def time_backwards(facts: Facts) -> Iterator[Finding]:
    """Time that falls."""
    t = facts.time_s
    if t is None:
        return
    rows = np.flatnonzero(np.isfinite(t))
    if len(rows) < 2:
        return
    run = facts.values.get("run")
    back = np.diff(t[rows]) < 0.0
    if run is not None:
        back &= np.diff(run[rows]) == 0.0
    odd = rows[1:][back]
    if odd.size:
        lines = ", ".join(str(facts.lines[int(r)]) for r in odd[:6]) + (" ..." if odd.size > 6 else "")
        fall = float(np.min(np.diff(t[rows])[back]))
        first = odd.size == 1 and odd[0] <= 2 and abs(fall) < 1.0
        text = f"time falls in {number_of(odd.size, 'row')} (line {lines}), by {-fall:.4g} s at most"
        fix = (
            "leave those rows out" if first else "sort the rows by time, or split the file where its clock starts again"
        )
        why = "note" if first else "error"  # the first sample of a log is often stamped late
        yield Finding("time_backwards", facts.named("time_s"), text, fix, tuple(int(r) for r in odd), why)


@check_for("slow_rotor")
def slow_rotor(facts: Facts) -> Iterator[Finding]:
    """Time in a smaller unit than its heading: the rotor follows steps of its command over minutes.

    Rows far apart alone say nothing, since points written down by hand are. But one that took the new speed is there
    by the next row; none needs more than `SLOWEST_S`, whatever its size.
    """
    t, told, command = facts.time_s, [*facts.known("rpm", "thrust_N")], [*facts.known("pwm_s", "throttle")]
    if t is None or not command or not told:
        return
    (response, y), (_, c) = told[0], command[0]
    rows = np.flatnonzero(np.isfinite(t) & np.isfinite(c) & np.isfinite(y))
    t, c, y = t[rows], c[rows], np.abs(y[rows])
    if rows.size < 2 * HELD or float(np.ptp(c)) == 0.0 or float(np.ptp(y)) == 0.0:
        return
    level = (c - c.min()) / np.ptp(c)
    first = np.flatnonzero(np.abs(np.diff(level)) > 0.1) + 1  # the row that has a new command first
    followed, waited = [], []
    for i in first[(first >= 2) & (first <= rows.size - HELD)]:
        held = level[i : i + HELD]
        before, after = float(np.median(y[i - 2 : i])), float(np.median(y[i + HELD - 2 : i + HELD]))
        steady = float(np.ptp(held)) < 0.01 and abs(level[i - 2] - level[i - 1]) < 0.01
        if steady and abs(after - before) > 0.1 * float(np.max(y)):
            # the first row may be read at the moment of the command: one whole interval later counts
            followed.append((float(y[i + 1]) - before) / (after - before))
            waited.append(float(t[i + 1] - t[i]))
    if len(followed) < STEPS or float(np.median(waited)) < SLOWEST_S or float(np.median(followed)) > 1.0 - np.exp(-1.0):
        return
    text = f"{response} has followed {len(followed)} steps of the command by {np.median(followed):.0%} only, "
    text += f"{np.median(waited):.4g} s after them, in the median; a rotor takes less than {SLOWEST_S:g} s"
    units = [e for e in unit_errors.errors("time") if e.stated == "s"]
    fix = next((e for e in units if e.repair * float(np.median(waited)) < SLOWEST_S), units[-1]).words
    yield Finding("time_unit", facts.named("time_s"), text, fix, (), "warning")


@check_for("lengths")
def lengths(facts: Facts) -> Iterator[Finding]:
    """Lengths that only another unit makes sense of."""
    D, pitch = facts.diameter_m, facts.pitch_m
    asked: list[tuple[str, float, float, float]] = []
    if D is not None:
        asked.append(("diameter_m", D, 0.015, 12.0))
        if pitch is not None:
            asked.append(("pitch_m", pitch, 0.15 * D, 3.0 * D))
    scale = D if D is not None and 0.015 <= D <= 12.0 else None
    for name, low, high, of in (
        ("tip_gap_m", 1e-5, 0.03, (5e-5, 0.125)),
        ("wall_distance_m", 0.02, 100.0, (0.05, 500.0)),
    ):
        v = facts.get(name)
        if v is not None and (top := float(np.nanmax(np.abs(v)))) > 0.0:
            asked.append((name, top, *((low, high) if scale is None else (of[0] * scale, of[1] * scale))))
    for name, value, low, high in asked:
        if low <= value <= high:
            continue
        fits = [e.words for e in unit_errors.errors("length", rarest=0.5) if low <= value * e.repair <= high]
        rotor = f" for a rotor of {D:.4g} m" if D is not None and name != "diameter_m" else ""
        text = f"{value:.5g} m is outside {low:.3g} to {high:.3g} m{rotor}"
        yield Finding("length_unit", facts.named(name), text, "; or ".join(fits) or "check the length", (), "warning")


@check_for("air")
def air_units(facts: Facts) -> Iterator[Finding]:
    """Pressure, temperature and humidity in another unit than their heading says."""
    cold, hot = (c + ZERO_CELSIUS for c in AIR_C)
    asked = (("pressure_Pa", "pressure", 3e4, 1.2e5), ("temperature_K", "temperature", cold, hot),
             ("density_kg_m3", "density", 0.2, 2.0), ("humidity", "fraction", 0.0, 1.0))  # fmt: skip
    for name, kind, low, high in asked:
        v = facts.get(name)
        if v is None:
            continue
        value = float(np.nanmedian(v))
        if low <= value <= high or (name == "density_kg_m3" and LIQUID[0] <= value <= LIQUID[1]):
            continue
        fits = [e.words for e in unit_errors.errors(kind) if low <= value * e.repair + e.offset <= high]
        text = f"median {value:.5g} is outside {low:g} to {high:g}"
        fatal = "error" if kind in ("pressure", "temperature") else "warning"  # no air is so: its density is false
        yield Finding("air_unit", facts.named(name), text, "; or ".join(fits) or "check the sensor", (), fatal)

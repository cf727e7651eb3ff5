"""What the samples of one column say of themselves: clocks, single samples that jump, speeds that no load goes with."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import PureWindowsPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.averaging import Mean
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.channels import channel_fault, unit_in

# Columns as a reader gathers them, and the `Dataset` of samples or points that it returns.


@dataclass(frozen=True, eq=False)
class Channel:
    """One column of a file, while it is read."""

    values: Array  # (N,) values in ``unit``, NaN where the file has none
    unit: str = ""  # Unit of the values, "" when the file states none and none may be assumed
    mean: Mean | None = None  # What stands for the channel, in its unit; None when nothing does


def dataset(
    form: str, kind: str, channels: Mapping[str, Channel], notes: Sequence[str] = (),
    provenance: Mapping[str, Any] | None = None, *, flags: Sequence[tuple[str, ...]] = (), lines: Sequence[int] = (),
    texts: Mapping[str, Sequence[str]] | None = None, headings: Mapping[str, str] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Dataset:  # fmt: skip
    """Make the dataset of a file: columns of another length than the longest end in NaN.

    `headings` are those of the file by channel, `constants` numbers that hold for all of it (``density_kg_m3``).

    >>> d = dataset("table", "bench", {"rpm": Channel(np.array([4e3, 5e3]), "rpm"), "x": Channel(np.array([1.0]))})
    >>> d.unit("rpm"), d.unit("x"), d["x"]
    ('rpm', '', array([ 1., nan]))
    """
    rows = max((len(c.values) for c in channels.values()), default=0)
    values, own = {}, {}
    for name, channel in channels.items():
        values[name] = _column(channel.values, rows)
        if channel_fault(name) or unit_in(name) != channel.unit:
            own[name] = channel.unit
    about = {**(provenance or {}), "format": form}
    means = {name: channel.mean for name, channel in channels.items() if channel.mean is not None}
    more = {"headings": headings, "constants": constants, "means": means}
    about |= {key: dict(given) for key, given in more.items() if given}
    name = PureWindowsPath(str(about.get("file", ""))).name or form
    return Dataset(kind, name, values, flags=tuple(flags), provenance=about, notes=tuple(notes), units=own,
                   lines=lines, texts={k: tuple(v) for k, v in (texts or {}).items()})  # fmt: skip


def _column(values: Array, rows: int) -> Array:
    """Read-only column of full length; what is not finite is no number."""
    v = np.asarray(values, dtype=float)
    if v.size < rows:
        v = np.concatenate([v, np.full(rows - v.size, np.nan)])
    if np.isinf(v).any():
        v = np.where(np.isinf(v), np.nan, v)
    v.setflags(write=False)
    return v


def channels_of(d: Dataset) -> dict[str, Channel]:
    """Columns of a part of a file, to be named anew in the whole."""
    means = d.means
    return {name: Channel(v, d.unit(name), means.get(name)) for name, v in d.values.items()}


BLOCK = 1 << 17
"""Samples that are searched for spikes at once."""
HALF, TIMES = 3, 2.0
"""Neighbours on each side of a spike, and ranges of theirs that it leaves."""
MISREAD = 2.5
"""Times that a speed may differ from what the load of its row needs, before it counts as misread. [1]"""
LONE, LONE_SDS, LONE_SD = 1.5, 8.0, 0.03
"""Factor, and robust standard deviations of at least so much, by which a single reading is off the others. [1]"""
FEW, BREAKDOWN = 0.1, 0.25
"""Share of readings off the others from which it is not said who is right, neighbours and single ones: the median of
all slopes holds up to 29 % (Rousseeuw and Leroy 1987, ch. 2; not checked). [1]"""
FEWEST_OF_CURVE, MOST_OF_CURVE, SAME_SPEED = 5, 400, 0.02
"""Readings that make a curve, those of no table of points, and the share by which equal speeds differ. [1]"""
FEWEST_IN_FLOW, SMALL_OFF = 10, 0.2
"""Readings that make a curve over an airspeed too, and the share of its top that a single one may be off by. [1]"""
MOST_RPM_PER_V = 8000.0
"""Speed over supply voltage that no usual motor reaches. [(rev/min)/V]"""
STICKS = ("airspeed_m_s", "thrust_N", "torque_Nm")  # readings of a table that `stuck` judges
HELD, DIGITS, NEAR = 4, 100.0, 0.01
"""Equal readings in a row that chance does not give, in none of 1,299 published tables; steps of its last digit in a
reading that shows it; equal speeds and readings to a share. [1]"""
MOVES = 0.05
"""Change of a load over the square of the speed, of the largest, that its own noise does not make. [1]"""
_CLOCK = re.compile(r"(?:(\d{4})-(\d\d)-(\d\d)[ T])?(\d{1,2}):(\d\d):(\d\d)(?:\.(\d+))?(?:Z|[+-]\d\d:?\d\d)?")
DAY = 86400.0


def clock_seconds(cells: Sequence[str]) -> Array | None:
    """Read ``12:30:05.25`` or ``2024-05-01T12:30:05``; other orders of day and month are ambiguous and stay text, (N,)
    [s].

    >>> clock_seconds(["23:59:59.5", "", "00:00:01.0"]), clock_seconds(["1:2", "x"]) is None
    (array([0. , nan, 1.5]), True)
    """
    out = np.full(len(cells), np.nan)
    dated: set[bool] = set()
    for i, cell in enumerate(cells):
        if not cell:
            continue
        match = _CLOCK.fullmatch(cell)
        if match is None:
            return None
        year, month, day, hour, minute, second = (int(part or 0) for part in match.groups()[:6])
        dated.add(bool(match[1]))
        try:
            date = datetime(year, month, day) if match[1] else datetime(2000, 1, 1)
        except ValueError:
            return None
        if hour > 23 or minute > 59 or second > 60:
            return None
        at = date - datetime(2000, 1, 1) + timedelta(hours=hour, minutes=minute, seconds=second)
        out[i] = at.total_seconds() + float(f"0.{match[7] or 0}")
    known = np.flatnonzero(np.isfinite(out))
    if not known.size or len(dated) > 1:
        return None
    if not dated.pop():
        out[known[1:]] += DAY * np.cumsum(np.diff(out[known]) < -0.5 * DAY)
    out -= out[known[0]]
    return out


def spikes(values: Array) -> NDArray[np.bool_]:
    """Single samples that jump away from all their neighbours and back, (N,).

    A sample is a spike when it lies outside the range of its neighbours by more than `TIMES` that range and by more
    than a quarter of the spread of the whole channel. At an end, one side has no neighbours; there the jump must exceed
    the spread of the whole channel, since a start-up looks like one.

    >>> spikes(np.array([1.0, 1.1, 1.2, 9.0, 1.4, 1.5, 1.6, 1.7])).nonzero()[0]
    array([3])
    """
    out = np.zeros(values.shape, dtype=bool)
    rows = np.flatnonzero(np.isfinite(values))
    if len(rows) < 6:
        return out
    v = values if len(rows) == len(values) else values[rows]
    low, high = np.percentile(v, [5.0, 95.0])
    top = max(abs(float(np.min(v))), abs(float(np.max(v))))
    spread = max(float(high - low), 1e-12 * top)
    for a in range(0, len(v), BLOCK):
        far = _far(v, a, min(a + BLOCK, len(v)), spread)
        out[rows[a : a + BLOCK][far]] = True
    return out


def _far(v: Array, a: int, b: int, spread: float) -> NDArray[np.bool_]:
    """Spikes among the samples from a to b."""
    at = max(a - HALF, 0)
    part = v[at : b + HALF]
    lo, hi = np.full(len(part), np.nan), np.full(len(part), np.nan)
    for k in range(1, HALF + 1):  # neighbours on either side, as far as there are any
        for own, other in ((slice(k, None), slice(None, -k)), (slice(None, -k), slice(k, None))):
            np.fmin(lo[own], part[other], out=lo[own])
            np.fmax(hi[own], part[other], out=hi[own])
    part, lo, hi = (x[a - at : b - at] for x in (part, lo, hi))
    share = np.full(b - a, 0.25)
    if a == 0:
        share[0] = 1.0
    if b == len(v):
        share[-1] = 1.0
    return np.maximum(part - hi, lo - part) > np.maximum(TIMES * (hi - lo), share * spread)


def lone(speed: Array, load: Array, flow: Array | None = None) -> Array:
    """Times that single readings of a load are what a smooth curve of the others gives, (N,); 1 where nothing is odd.

    The curve is a power of the speed by the median of all slopes (Theil and Sen; Sen, Journal of the American
    Statistical Association 63, 1968, p. 1379, not checked); in a ``flow``, airspeed over speed or as good, a parabola
    over that too, by least absolute residuals. Beyond the others nothing is judged.

    >>> lone(np.array([5.7, 5.7, 6.1, 6.8, 7.4]), np.array([350.0, 1350.0, 420.0, 500.0, 590.0])).round(1)
    array([1. , 3.6, 1. , 1. , 1. ])
    >>> n, J = np.full(12, 5000.0), np.tile(np.linspace(0.0, 0.5, 6), 2)
    >>> lone(n, n**2 * (1.0 - J) * np.where(np.arange(12) == 3, 10.0, 1.0), J).round(1)[2:5]
    array([ 1., 10.,  1.])
    """
    times = np.ones(speed.size)
    if not (FEWEST_OF_CURVE if flow is None else FEWEST_IN_FLOW) <= speed.size <= MOST_OF_CURVE:
        return times
    x, y = np.log(speed), load / speed**2
    dx, judged = x[:, None] - x, y > 0.0
    if flow is None:
        y = np.log(y)
        dy, apart = y[:, None] - y, dx > SAME_SPEED
        off = y - x * (np.median(dy[apart] / dx[apart]) if apart.any() else 0.0)
    else:
        curve = _least_absolute(np.column_stack([np.ones(x.size), flow, flow**2, x - x.mean()]), y)
        off = np.log(np.where(judged & (curve > 0.0), y, np.nan) / np.where(curve > 0.0, curve, 1.0))
        judged = np.abs(y - curve) > SMALL_OFF * curve.max()
    off = off - np.nanmedian(off)
    sd = max(1.4826 * float(np.nanmedian(np.abs(off))), LONE_SD)
    odd = judged & (np.abs(off) > max(float(np.log(LONE)), LONE_SDS * sd))
    in_turn = odd[np.argsort(speed, kind="stable")]
    bend = flow is not None or bool(np.any(in_turn[1:] & in_turn[:-1]))  # neighbours that are off are no single ones
    if np.count_nonzero(odd) > max(1, int((FEW if bend else BREAKDOWN) * speed.size)):
        return times
    others = ~np.eye(speed.size, dtype=bool)
    for between, same in ((dx, SAME_SPEED), *(() if flow is None else ((flow[:, None] - flow, SAME_SPEED),))):
        odd &= np.any(others & (between > -same), axis=1) & np.any(others & (between < same), axis=1)
    times[odd] = np.exp(off[odd])
    return times


def _least_absolute(A: Array, y: Array) -> Array:
    """Curve of the least sum of absolute residuals, by weights in turn, (N,)."""
    weight, size = np.ones(y.size), 1e-3 * float(np.median(np.abs(y)))
    for _ in range(30):
        root = np.sqrt(weight)
        curve = A @ np.linalg.lstsq(A * root[:, None], y * root, rcond=None)[0]
        weight = 1.0 / np.maximum(np.abs(y - curve), size)
    return np.asarray(curve)


def stopped(speed: Array, command: Array, values: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Rows at which the motor stopped though the command turned it before, (N,).

    The speed reads 0 there, and every load of ``values``, the current among them, is below that of all rows that turn.

    >>> loads = {"thrust_N": np.array([1.0, 2.0, -0.1]), "current_A": np.array([2.0, 5.0, 0.02])}
    >>> stopped(np.array([4e3, 6e3, 0.0]), np.array([1.2, 1.4, 1.5]), loads).tolist()
    [False, False, True]
    """
    loads = [values[k] for k in ("current_A", "electrical_power_W", "thrust_N", "torque_Nm") if k in values]
    turns = speed > 0.0
    if not turns.any() or not values.keys() & {"current_A", "electrical_power_W"}:
        return np.zeros(speed.size, dtype=bool)
    low = np.all([np.abs(v) < np.fmin.reduce(np.abs(v[turns])) for v in loads], axis=0)
    before = np.fmin.accumulate(np.where(turns, command, np.inf))
    return np.asarray((speed == 0.0) & low & (command >= before))


def against_load(speed: Array, load: Array) -> Array:
    """Root of a load over its speed, relative to the median of the rows, (N,); a speed is misread far from 1.

    Loads go with the square of the speed: outside 1 / `MISREAD` to `MISREAD` the two of one row do not belong together.
    """
    k = np.sqrt(load) / speed
    return np.asarray(k / np.median(k))


def _last_digit(seen: Array, steps: Array) -> float:
    """Step of the last decimal of some readings; where another unit has hidden it, the least between two of them."""
    tens = (10.0**-k for k in range(7))
    found = (step for step in tens if np.all(np.abs(seen / step - np.round(seen / step)) < 1e-6))
    return next(found, float(steps.min()) if steps.size else np.inf)


def stuck(name: str, values: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Readings of a table of points that repeat the one before to the last digit while what moves them changes, (N,).

    Airspeed: at one speed of rotation it fixes the loads; they change all the same. A load: airspeed or speed change,
    and the other load with them. Only one stretch of a column sticks; a set point that was typed in comes back in
    others, or has no readings near it with other digits. The first of the stretch may be a reading, and is not named.

    >>> n, V = np.full(10, 5000.0), np.array([0, 2.01, 4.0, 6.02, 6.0, 8.03, 8.03, 8.03, 8.03])
    >>> stuck("airspeed_m_s", {"rpm": n, "airspeed_m_s": np.append(V, 8.03), "thrust_N": 9.0 - np.arange(10)}).nonzero()
    (array([6, 7, 8, 9]),)
    """
    v, rpm = values[name], values.get("rpm")
    out = np.zeros(v.size, dtype=bool)
    if rpm is None or "time_s" in values or not HELD < v.size <= MOST_OF_CURVE:
        return out
    edges = [0, *(np.flatnonzero(v[1:] != v[:-1]) + 1).tolist(), v.size]
    held = [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b - a > 2 and v[a] != 0.0]
    if len(held) != 1 or held[0].stop - held[0].start < HELD:
        return out
    rows, seen = held[0], np.unique(np.abs(v[np.isfinite(v)]))
    steps = np.diff(seen)
    loads = [values[k] for k in ("thrust_N", "torque_Nm") if k in values and k != name]
    if name == "airspeed_m_s":
        readings = bool(np.any(steps <= NEAR * seen[1:]))
        one_speed = np.abs(rpm[rows, None] / rpm[rows] - 1.0) <= NEAR
        scaled = [load / rpm**2 for load in loads]
        moves = [np.any(one_speed & (np.abs(k[rows, None] - k[rows]) > MOVES * np.nanmax(np.abs(k)))) for k in scaled]
    else:
        readings = abs(float(v[rows.start])) >= DIGITS * _last_digit(seen, steps)
        flow = values.get("airspeed_m_s", np.zeros(v.size))
        state = [x for x in (rpm, flow) if np.ptp(x[rows]) > MOVES * np.nanmax(np.abs(x))]
        moves = [np.ptp(load[rows]) > MOVES * np.nanmax(np.abs(load)) for load in loads if state]
    out[rows.start + 1 : rows.stop] = readings and any(moves)
    return out

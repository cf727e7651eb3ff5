r"""Averages of recorded histories: whole revolutions by time, the settled part of a steady run, drift, repeated steps.

A row of a history is what a solver wrote at the END of a step, so it stands for the time step before it. The average
over N revolutions is that of the rows whose time lies in (t_end - N T, t_end], weighted by their time steps; with a
constant step this is the plain mean of those rows. Counting rows instead of time goes wrong as soon as the step
changes, and a revolution seldom is a whole number of steps. What is left over at the start (start-up and the
incomplete revolution) is dropped.

Drift is the change from the first to the last averaged revolution over the magnitude of the mean. A mean with a large
drift describes a run that has not settled, whatever its residuals say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.base.tables import number_of

DEFAULT_REVOLUTIONS = 4
"""Revolutions that are averaged when nothing is asked for, at most half of what the run has."""
MIN_ROWS = 12
"""Rows in a revolution below which an average is refused (30 deg a step)."""
FEW_ROWS = 36
"""Rows in a revolution below which an average is doubtful (10 deg a step)."""
PERIODIC = 0.02
"""Difference of the means of single revolutions above which a history is not periodic. [1]"""
STEADY_SHARE = 0.2
"""Last part of a steady run that its mean is taken over."""


class Mean(NamedTuple):
    """What stands for a channel, in its unit; what it was taken over, in words; drift over that part or None [1]."""

    value: float
    over: str
    drift: float | None = None


@dataclass(frozen=True)
class Average:
    """Mean over a part of a history."""

    mean: float | None  # The mean, in the unit of the values; None when there is none, and `problem` says why
    rows: int  # Rows averaged
    revolutions: int  # Whole revolutions averaged; 0 for a steady run
    # Time span averaged. [s] (rows of a steady run)
    start: float
    end: float
    drift: float | None = None  # Change over the mean [1], positive where it grows in size; None when it cannot be told
    spread: float | None = None  # Largest minus smallest value in the span relative to the mean [1]
    per_revolution: tuple[float, ...] = ()  # Mean of each averaged revolution, in time order [unit of the values]
    problem: str = ""  # Why there is no mean, or what makes it doubtful; empty when nothing does

    @property
    def span(self) -> str:
        """Revolutions that were averaged, with their times and rows, in words."""
        rows = f"{self.start:.6g} to {self.end:.6g} s, {number_of(self.rows, 'row')}"
        return f"last {number_of(self.revolutions, 'revolution')} ({rows})"

    @property
    def unlike(self) -> float:
        """Largest less smallest mean of a revolution over the mean [1]; 0 where that is less than `PERIODIC`."""
        turns = self.per_revolution
        size = (max(turns) - min(turns)) / abs(self.mean) if turns and self.mean else 0.0
        return size if size > PERIODIC else 0.0


def _mean(values: Array, weights: Array) -> float | None:
    """Weighted mean that neither overflows nor hides a NaN."""
    total = float(np.sum(weights))
    if not values.size or not np.all(np.isfinite(values)) or not total > 0.0 or not math.isfinite(total):
        return None
    scale = float(np.max(np.abs(values))) or 1.0
    return float(np.sum(values / scale * (weights / total)) * scale)


def _relative(change: float, mean: float | None) -> float | None:
    if mean is None or mean == 0.0:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        value = float(np.float64(change) / np.float64(mean))
    return value if math.isfinite(value) else None


def _spread(values: Array, mean: float) -> float | None:
    with np.errstate(over="ignore", invalid="ignore"):
        return _relative(float(np.max(values) - np.min(values)), abs(mean))


def time_steps(time: ArrayLike) -> Array:
    """Give the time step that each row stands for, (N,) [s].

    >>> time_steps([0.0, 0.5, 1.0, 3.0]).tolist()
    [0.0, 0.5, 0.5, 2.0]
    """
    t = np.asarray(time, dtype=float)
    if t.size < 2:
        return np.ones_like(t)
    dt = np.diff(t)
    return np.concatenate([[0.0 if t[0] == 0.0 else min(dt[0], t[0]) if t[0] > 0 else dt[0]], dt])


def _check_history(t: Array, v: Array, period: float, revolutions: int | None) -> None:
    faults = []
    if not (math.isfinite(period) and period > 0.0):
        faults.append(Fault("", "period", f"{period:g}", "a positive time in seconds"))
    if revolutions is not None and revolutions < 1:
        faults.append(Fault("", "revolutions", str(revolutions), "1 or more"))
    if t.ndim != 1 or t.shape != v.shape:
        faults.append(Fault("", "time", f"shape {t.shape} for values of shape {v.shape}", "equal lengths"))
    elif t.size and not (np.all(np.isfinite(t)) and np.all(np.diff(t) > 0.0)):
        faults.append(Fault("", "time", "times that do not ascend", "strictly ascending times", "Use keep_last first"))
    refuse(faults)


def revolution_average(time: ArrayLike, values: ArrayLike, period: float, revolutions: int | None = None) -> Average:
    """Average over the last whole revolutions, by time.

    >>> import numpy as np
    >>> t = np.cumsum(np.where(np.arange(900) < 300, 0.004, 0.002))          # the step halves at 1.2 s
    >>> a = revolution_average(t, 5.0 + np.cos(2 * np.pi * t / 0.5) + 0.2 * np.exp(-t / 0.1), period=0.5)
    >>> round(a.mean, 4), a.revolutions, a.rows, abs(a.drift) < 1e-4
    (5.0, 2, 500, True)
    """
    t, v = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    _check_history(t, v, period, revolutions)
    none = Average(None, 0, 0, math.nan, math.nan)
    if t.size < 2:
        return replace(none, problem=f"{number_of(t.size, 'row')}: no revolution")
    dt = time_steps(t)
    slack = 1e-6 * float(np.median(dt[1:]))
    length = float(t[-1] - t[0] + dt[0])
    whole = math.floor(min(length / period * (1.0 + 1e-9) + slack / period, 1e9))
    count = min(DEFAULT_REVOLUTIONS, max(1, whole // 2)) if revolutions is None else revolutions
    if whole < count:
        return replace(none, problem=f"{length / period:.3g} revolutions recorded, {count} wanted")
    edges = float(t[-1]) - period * np.arange(count, -1, -1.0)
    cuts = [*np.searchsorted(t, edges[:-1] + slack, side="right"), t.size]
    part = slice(cuts[0], t.size)
    rows = t.size - int(cuts[0])
    found = replace(none, rows=rows, revolutions=count, start=float(edges[0]), end=float(t[-1]))
    gap = float(np.max(dt[part])) if rows else math.inf
    if rows < MIN_ROWS * count or min(np.diff(cuts)) < 2:
        why = f"{rows / count:.3g} rows in a revolution; {MIN_ROWS} or more are needed (are these iterations?)"
        return replace(found, problem=why)
    if gap > 0.1 * period:
        return replace(found, problem=f"a gap of {gap:.4g} s in the averaged part, {gap / period:.2g} revolutions")
    mean = _mean(v[part], dt[part])
    if mean is None:
        return replace(found, problem="NaN in the averaged part")
    turns = [_mean(v[a:b], dt[a:b]) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]
    first: float | None = turns[0]
    if count == 1:  # one revolution drifts against the one before it
        before = int(np.searchsorted(t, edges[0] - period + slack, side="right"))
        first = _mean(v[before : cuts[0]], dt[before : cuts[0]]) if whole > 1 else None
    last = turns[-1]
    drift = None if first is None or last is None else _relative(last - first, mean)
    few = f"only {rows / count:.3g} rows in a revolution" if rows < FEW_ROWS * count else ""
    return replace(found, mean=mean, drift=drift, spread=_spread(v[part], mean), problem=few,
                 per_revolution=tuple(x for x in turns if x is not None))  # fmt: skip


def steady_average(values: ArrayLike, share: float = STEADY_SHARE) -> Average:
    """Average over the last part of a run that has no time.

    >>> import numpy as np
    >>> a = steady_average(1.0 + np.exp(-np.arange(400) / 20.0))
    >>> round(a.mean, 6), a.rows, abs(a.drift) < 1e-5
    (1.0, 80, True)
    """
    v = np.asarray(values, dtype=float)
    rows = min(v.size, max(10, math.ceil(share * v.size)))
    part = v[v.size - rows :]
    base = Average(None, rows, 0, float(v.size - rows), float(v.size))
    mean = _mean(part, np.ones(rows))
    if mean is None:
        return replace(base, problem="NaN in the averaged part" if rows else "no rows")
    drift = None
    if rows >= 3:
        scale = float(np.max(np.abs(part))) or 1.0
        x = np.arange(rows) - 0.5 * (rows - 1)
        slope = float(np.sum(x * (part / scale)) / np.sum(x * x))
        drift = _relative(slope * (rows - 1), mean / scale)
    return replace(base, mean=mean, drift=drift, spread=_spread(part, mean))


def keep_last(clock: ArrayLike, name: str = "step") -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Find the rows that hold when a history repeats or goes back: the later one wins.

    A run that was restarted from an earlier state writes its steps again; everything that was recorded from that step
    on belongs to an abandoned branch and is dropped. A single row out of order is damage, not a restart: it is
    dropped itself.

    >>> keep_last([1, 2, 3, 4, 3, 4, 5])[0].tolist()
    [0, 1, 4, 5, 6]
    >>> keep_last([1, 2, 30, 4, 5])[0].tolist(), keep_last([11, 12, 3, 14, 15])[0].tolist()
    ([0, 1, 3, 4], [0, 1, 3, 4])
    """
    c = np.asarray(clock, dtype=float)
    finite = np.flatnonzero(np.isfinite(c))
    notes = (
        [f"{number_of(c.size - finite.size, 'row')} without a number for {name} left out"]
        if finite.size < c.size
        else []
    )
    if finite.size > 1 and not np.all(np.diff(c[finite]) > 0.0):
        finite, more = _ascending(c, finite, name)
        notes += more
    return finite, tuple(notes)


def _ascending(c: Array, order: NDArray[np.intp], name: str) -> tuple[NDArray[np.intp], list[str]]:
    kept: list[int] = []
    repeated = damaged = 0
    backs: list[str] = []
    rows = order.tolist()
    for k, i in enumerate(rows):
        if kept and c[i] <= c[kept[-1]]:
            later = c[rows[k + 1]] if k + 1 < len(rows) else math.nan
            if c[i] == c[kept[-1]]:
                repeated += 1
                kept[-1] = i
                continue
            if later > c[kept[-1]] and len(kept) > 1 and k + 1 < len(rows):  # goes on as before: this row is damage
                damaged += 1
                continue
            top = c[kept[-1]]
            dropped = 0
            while kept and c[kept[-1]] >= c[i]:
                kept.pop()
                dropped += 1
            if dropped == 1 and (not kept or c[i] > c[kept[-1]]) and kept and later > c[i]:
                damaged += 1  # one row ran ahead
            else:
                backs.append(f"from {top:.10g} to {c[i]:.10g} ({dropped} earlier rows dropped, the later ones hold)")
        kept.append(i)
    notes = []
    if repeated:
        notes.append(f"{repeated} repeated {name} rows: the last one of each holds")
    if damaged:
        notes.append(f"{number_of(damaged, 'row')} with {name} out of order left out")
    if backs:
        more = f" and {len(backs) - 3} times more" if len(backs) > 3 else ""
        notes.append(f"restart: {name} goes back {'; '.join(backs[:3])}{more}")
    return np.array(kept, dtype=np.intp), notes


def relation(first: Sequence[ArrayLike], second: Sequence[ArrayLike]) -> str:
    """Tell how the history of a restart file relates to that of the file before it.

    >>> a = ([1, 2, 3], [0.1, 0.2, 0.3])
    >>> relation(a, ([4, 5], [0.4, 0.5])), relation(a, ([3, 4], [0.3, 0.4])), relation(a, ([1, 2], [0.01, 0.02]))
    ('continues', 'overlaps', 'other clock')
    """
    (s1, t1), (s2, t2) = ((np.asarray(x, dtype=float) for x in pair) for pair in (first, second))
    if not s1.size or not s2.size:
        return "other clock"
    timed = t1.size == s1.size and t2.size == s2.size
    common, i, j = np.intersect1d(s1, s2, return_indices=True)
    if common.size:
        step = float(np.median(np.diff(t1))) if timed and t1.size > 1 else math.inf
        tolerance = max(1e-3 * step, 1e-6 * float(np.max(np.abs(t1)))) if timed else 0.0
        same = timed and bool(np.all(np.abs(t1[i] - t2[j]) <= tolerance)) and s2[0] > s1[0]
        return "overlaps" if same else "other clock"
    if s2[0] > s1[-1] and (not timed or t2[0] > t1[-1]):
        if timed and t1.size > 1:
            rate = (t1[-1] - t1[0]) / (s1[-1] - s1[0])
            expected = t1[-1] + rate * (s2[0] - s1[-1])
            if t2[0] - t1[-1] > 10.0 * max(expected - t1[-1], 0.0):
                return "other clock"
        return "continues"
    return "other clock"

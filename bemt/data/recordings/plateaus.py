"""Plateaus: the steady parts of a recording, as means with what is needed to judge them.

From a time series to steady points, in the order below; each sample ends in one plateau or in one entry of what was
dropped, with the reason.

1. *Steps.* With a command (pulse width, throttle), a step is where the command changes, and a stretch in which it
   changes all the time is a ramp. Without one, a step is where the medians of the `WINDOW` samples before and after
   differ by more than `LEAST_STEP`, by more than five standard errors of the whole recording and three of the samples
   beside it.
2. *Settling.* The start of a stretch is cut until the running median stays within the band of the second half of the
   stretch (twice its robust spread, or 1 % of its level). Without a command, the end is cut likewise where the samples
   of its last window already follow the next step.
3. *Outliers.* Within what is left, samples further than six robust standard deviations from the running median are
   dropped, each channel for itself, and counted.
4. *Verdict.* A plateau that is too short is dropped; one whose level still moves is kept and flagged ``drifts``.

Rows whose time falls are left out and noted. Points reached from below and from above are told apart (``direction``),
so that hysteresis stays visible.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.base.tables import number_of

OUTLIER = 6.0
"""Robust standard deviations from which a sample is an outlier."""
BLOCK = 1 << 16
"""Windows whose medians are taken at once: a log may have millions of rows."""
WINDOW = 8
"""Samples on each side of a possible step."""
LEAST_STEP = 0.01
"""Smallest step that separates plateaus, as a share of the range of the signal. [1]"""
LEAST_SAMPLES = 5
"""Samples that a plateau must keep after the cuts."""
DRIFT = 0.02
"""Change over a plateau, relative to its level, from which it is flagged. [1]"""
LOCAL = 3.0
"""Standard errors, from the spread of the samples beside it, that a step must exceed."""


@dataclass(frozen=True, eq=False)
class Plateau:
    """One steady stretch."""

    # Rows, `stop` not included, after the cuts
    start: int
    stop: int
    # Times of the first and last row [s], or row numbers when there is no time
    t0: float
    t1: float
    command: float | None  # Command during the stretch, in its unit
    direction: str  # ``up`` or ``down`` from the stretch before; ``first`` when there is none
    # Mean and standard error of the mean by channel, in its unit; the standard error counts samples that follow each
    # other closely as fewer than they are (see `standard_error`)
    mean: Mapping[str, float]
    u: Mapping[str, float]
    outliers: Mapping[str, tuple[int, ...]]  # Rows dropped by channel; empty ones are left out
    flags: tuple[str, ...] = ()  # ``drifts``, ``not settled``


@dataclass(frozen=True)
class Dropped:
    """Rows that belong to no plateau: `start` to `stop` (not included), and why."""

    start: int
    stop: int
    reason: str


@dataclass(frozen=True, eq=False)
class Plateaus:
    """All plateaus of a recording, and what was dropped; together they hold every row once."""

    plateaus: tuple[Plateau, ...]
    dropped: tuple[Dropped, ...]
    rows: int
    notes: tuple[str, ...] = field(default=())


def standard_error(values: ArrayLike) -> float:
    """Standard error of the mean of samples that may follow each other closely. [unit of the samples]

    First-order autoregressive noise; the formula is the large-sample limit.

    >>> round(standard_error([1.0, 3.0, 1.0, 3.0]), 6)
    0.57735
    """
    v = np.asarray(values, dtype=float)
    n = len(v)
    if n < 2:
        return math.nan
    d = v - v.mean()
    power = _product(d, d)
    sd = math.sqrt(power / (n - 1))
    r = _product(d[1:], d[:-1]) / power if power > 0 else 0.0
    r = min(max(r, 0.0), 1.0 - 1e-9)
    return sd / math.sqrt(max(n * (1.0 - r) / (1.0 + r), 1.0))


def _product(a: Array, b: Array) -> float:
    """Inner product without the threads of BLAS, which cost more than they bring here."""
    return float(np.einsum("i,i->", a, b))


def _spread(v: Array) -> float:
    """Robust standard deviation that is not 0 for quantised samples."""
    if len(v) < 2:
        return 0.0
    lo, middle, hi = np.percentile(v, [15.87, 50.0, 84.13])
    seen = max(1.4826 * float(np.median(np.abs(v - middle))), 0.5 * float(hi - lo))
    sd = float(np.std(v))
    if sd <= seen:
        return seen
    distinct = np.diff(np.unique(v))
    grain = float(distinct.min()) / math.sqrt(12.0) if distinct.size else 0.0
    return max(seen, min(grain, sd))


def _running_median(v: Array, half: int) -> Array:
    n = len(v)
    half = min(half, max((n - 1) // 2, 0))
    if half == 0:
        return v.copy()
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(v, half, mode="edge"), 2 * half + 1)
    return np.concatenate([np.median(windows[a : a + BLOCK], axis=1) for a in range(0, n, BLOCK)])


def find(
    time_s: ArrayLike | None, channels: Mapping[str, ArrayLike], signal: str, command: ArrayLike | None = None,
) -> Plateaus:  # fmt: skip
    """Find the plateaus of a recording.

    >>> t = np.arange(60) * 0.1
    >>> got = find(t, {"thrust_N": np.where(t < 3.0, 1.0, 2.0)}, "thrust_N")
    >>> [(p.mean["thrust_N"], p.direction) for p in got.plateaus]
    [(1.0, 'first'), (2.0, 'up')]
    """
    data = {name: np.asarray(v, dtype=float) for name, v in channels.items()}
    t, faults = _checked(time_s, data, signal, command)
    refuse(faults)
    n = len(t)
    notes: list[str] = []
    if back := _backwards(t):
        notes.append(f"rows dropped because their time decreases: {', '.join(map(str, back))}")
        t = np.maximum.accumulate(t)
        data = {name: np.where(np.isin(np.arange(n), back), np.nan, v) for name, v in data.items()}
    good = np.isfinite(data[signal])
    used = np.flatnonzero(good) if not good.all() else np.arange(n)
    dropped: list[Dropped] = []
    if command is not None:
        stretches, moving = _by_command(np.asarray(command, dtype=float))
    else:
        stretches, moving = _by_signal(data[signal] if good.all() else data[signal][used])
        rows = np.append(used, n)
        stretches = [(int(rows[a]) if a else 0, int(rows[b])) for a, b in stretches]
        moving = [Dropped(int(rows[d.start]) if d.start else 0, int(rows[d.stop]), d.reason) for d in moving]
    dropped += moving
    found: list[Plateau] = []
    levels: list[float] = []
    span = float(np.nanmax(data[signal]) - np.nanmin(data[signal]))
    for start, stop in stretches:
        plateau, cuts = _reduce(t, data, signal, command, start, stop, span)
        dropped += cuts
        if plateau is None:
            continue
        level = plateau.command if plateau.command is not None else plateau.mean[signal]
        way = "first" if not levels else "up" if level >= levels[-1] else "down"
        levels.append(level)
        found.append(replace(plateau, direction=way))
    order = sorted((d for d in dropped if d.stop > d.start), key=lambda d: d.start)
    if not found:
        notes.append("no plateau was found")
    return Plateaus(tuple(found), tuple(order), n, tuple(notes))


def _checked(
    time_s: ArrayLike | None, data: Mapping[str, Array], signal: str, command: ArrayLike | None
) -> tuple[Array, list[Fault]]:
    faults = []
    n = len(next(iter(data.values()))) if data else 0
    t = np.arange(n, dtype=float) if time_s is None else np.asarray(time_s, dtype=float)
    lengths = {name: len(v) for name, v in data.items()} | {"time_s": len(t)}
    if command is not None:
        lengths["command"] = len(np.asarray(command))
    wrong = [f"{name} has {length}" for name, length in lengths.items() if length != n]
    if wrong:
        faults.append(Fault("", "plateaus", ", ".join(wrong), f"{number_of(n, 'value')} each"))
    if signal not in data:
        faults.append(Fault("", "signal", repr(signal), f"one of {', '.join(sorted(data))}"))
    elif not np.any(np.isfinite(data[signal])):
        faults.append(Fault("", signal, "no values", "a channel with values"))
    if not np.all(np.isfinite(t)):
        faults.append(Fault("", "time_s", "a value that is not finite", "finite times"))
    elif len(back := _backwards(t)) > max(2, n // 100):
        got = f"time that falls in {number_of(len(back), 'row')}, first row {back[0]}"
        faults.append(Fault("", "time_s", got, "times in order", "Sort the file, or split it where its clock restarts"))
    return t, faults


def _backwards(t: Array) -> list[int]:
    """Rows whose time lies before that of an earlier row."""
    return [int(row) for row in np.flatnonzero(t < np.maximum.accumulate(t))]


def _by_command(command: Array) -> tuple[list[tuple[int, int]], list[Dropped]]:
    """Stretches of constant command; those too short are ramps."""
    same = np.isclose(command[1:], command[:-1], rtol=1e-9, atol=0.0) | (np.isnan(command[1:]) & np.isnan(command[:-1]))
    edges = [0, *(np.flatnonzero(~same) + 1).tolist(), len(command)]
    stretches: list[tuple[int, int]] = []
    dropped: list[Dropped] = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        if np.isnan(command[a]):
            reason = "no command"
        elif b - a < LEAST_SAMPLES:
            reason = "the command changes"
        else:
            stretches.append((a, b))
            continue
        if dropped and dropped[-1].stop == a and dropped[-1].reason == reason:
            dropped[-1] = Dropped(dropped[-1].start, b, reason)
        else:
            dropped.append(Dropped(a, b, reason))
    return stretches, dropped


def _jumps(v: Array, w: int) -> tuple[Array, Array]:
    """Step between the medians of the windows beside each place, and what the noise there makes of it, (n + 1,)."""
    n = len(v)
    windows = np.lib.stride_tricks.sliding_window_view(v, w)
    medians, sway = np.empty(len(windows)), np.empty(len(windows))
    for a in range(0, len(windows), BLOCK):
        part = windows[a : a + BLOCK]
        medians[a : a + BLOCK] = middle = np.median(part, axis=1)
        sway[a : a + BLOCK] = 1.4826 * np.median(np.abs(part - middle[:, None]), axis=1)
    jump, local = np.zeros(n + 1), np.zeros(n + 1)
    inside = slice(w, n - w + 1)
    np.subtract(medians[w:], medians[: n - 2 * w + 1], out=jump[inside])
    np.abs(jump, out=jump)
    np.maximum(sway[w:], sway[: n - 2 * w + 1], out=local[inside])
    local *= LOCAL * 1.2533 * math.sqrt(2.0 / w)
    return jump, local


def levels(v: Array) -> list[tuple[int, int]]:
    """Stretches between the steps of samples: first row, and the row behind the last.

    >>> levels(np.repeat([1.0, 2.0, 4.0], 20))
    [(0, 20), (20, 40), (40, 60)]
    """
    return _by_signal(v)[0]


def _by_signal(v: Array) -> tuple[list[tuple[int, int]], list[Dropped]]:
    """Stretches between jumps of the medians of neighbouring windows."""
    n, w = len(v), WINDOW
    if n < 2 * w:
        return [(0, n)], []
    jump, local = _jumps(v, w)
    noise = 1.4826 * float(np.median(np.abs(np.diff(v) - np.median(np.diff(v))))) / math.sqrt(2.0)
    lo, hi = np.percentile(v, [1.0, 99.0])
    least = max(LEAST_STEP * float(hi - lo), 5.0 * 1.2533 * noise * math.sqrt(2.0 / w))
    if least <= 0.0:
        return [(0, n)], []
    moving = jump > least
    stretches: list[tuple[int, int]] = []
    dropped: list[Dropped] = []
    at = 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(int)))
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if not np.any(jump[a:b] > local[a:b]):  # no more than the noise beside it
            continue
        if b - a <= 3 * w:  # one step; medians jump as much some samples beside it
            peak = a + int(np.argmax(jump[a:b]))
            first = last = _split(v, max(at, peak - w), min(peak + w, n))
        else:  # the level moves all the time
            first, last = min(a + w // 2, n), min(b - w // 2, n)
        if first > at:
            stretches.append((at, first))
        if last > first:
            dropped.append(Dropped(first, last, "the level moves"))
        at = last
    if at < n:
        stretches.append((at, n))
    return stretches, dropped


def _split(v: Array, start: int, stop: int) -> int:
    """Place that leaves the least squares about the means of both sides."""
    x, k = v[start:stop] - v[start], np.arange(1, stop - start)
    left = np.cumsum(x)[:-1]
    return start + 1 + int(np.argmax(left**2 / k + (np.sum(x) - left) ** 2 / (x.size - k)))


def _settled(v: Array) -> tuple[int, bool]:
    """Samples to cut at the start of a stretch, and whether it settles at all."""
    n = len(v)
    if n < 4:
        return 0, True
    tail = v[n // 2 :]
    centre, sd = float(np.median(tail)), _spread(tail)
    band = max(2.0 * sd / math.sqrt(min(WINDOW, n // 2)) + 1e-12, 0.01 * abs(centre))
    smooth = _running_median(v, WINDOW // 4)
    outside = np.flatnonzero(np.abs(smooth - centre) > band + 2.0 * sd)
    early = outside[outside < n // 2]
    cut = int(early[-1]) + 1 if early.size else 0
    return cut, cut < n // 2


def _leaving(v: Array, cut: int) -> int:
    """Samples at the end of a stretch that already follow the next step (at most a window)."""
    body = v[cut:]
    if len(body) < 3 * WINDOW:
        return 0
    rest = body[:-WINDOW]
    band = max(OUTLIER * _spread(rest[-3 * WINDOW :]), 0.01 * abs(float(np.median(rest))))
    outside = np.flatnonzero(np.abs(body[-WINDOW:] - np.median(rest[-3 * WINDOW :])) > band)
    late = WINDOW - int(outside[0]) if outside.size else 0
    return late if late and outside.size >= 0.5 * late else 0  # a single outlier is no step


def _outliers(v: Array) -> NDArray[np.intp]:
    """Samples far from their neighbours."""
    if len(v) < 7:
        return np.empty(0, dtype=np.intp)
    rest = v - _running_median(v, 3)
    size = np.abs(rest)
    band = max(_spread(rest), 1e-12 * float(np.max(np.abs(v))))
    if float(size.max()) > OUTLIER * band:
        band = max(band, _spread(v) / 3.0)
    return np.flatnonzero(size > OUTLIER * band)


def _reduce(
    t: Array, data: Mapping[str, Array], signal: str, command: ArrayLike | None, start: int, stop: int, span: float,
) -> tuple[Plateau | None, list[Dropped]]:  # fmt: skip
    rows = start + np.flatnonzero(np.isfinite(data[signal][start:stop]))
    if len(rows) < LEAST_SAMPLES:
        return None, [Dropped(start, stop, f"fewer than {LEAST_SAMPLES} samples")]
    cut, settles = _settled(data[signal][rows])
    if cut >= len(rows):
        return None, [Dropped(start, stop, "shorter than the settling")]
    first, end = (int(rows[cut]) if cut else start), stop
    if command is None and (late := _leaving(data[signal][rows], cut)):
        stop = int(rows[len(rows) - late])
    if len(rows) - cut < LEAST_SAMPLES or stop <= first:
        return None, [Dropped(start, end, "too short after settling")]
    mean, u, out, change = {}, {}, {}, 0.0
    for name, values in data.items():
        good = np.isfinite(values[first:stop])
        if not good.any():
            continue
        kept, when = values[first:stop], t[first:stop]
        if not good.all():
            kept, when = kept[good], when[good]
        far = _outliers(kept)
        if far.size:
            out[name] = tuple((first + np.flatnonzero(good)[far]).tolist())
            kept, when = np.delete(kept, far), np.delete(when, far)
        mean[name], u[name] = float(np.mean(kept)), standard_error(kept)
        lasts = float(when[-1] - when[0])
        if name == signal and len(kept) > 2 and lasts > 0.0:  # by a straight line
            x = when - when.mean()
            change = abs(_product(x, kept) / _product(x, x) * lasts)
    flags = [] if settles else ["not settled"]
    # a drift counts when it also stands out of the noise and is no trifle beside the whole signal
    if change > max(DRIFT * abs(mean.get(signal, 0.0)), 3.0 * u.get(signal, 0.0), 0.005 * span):
        flags.append("drifts")
    level = None if command is None else float(np.asarray(command, dtype=float)[start])
    cuts = [Dropped(start, first, "settling"), Dropped(stop, end, "the next step begins")]
    plateau = Plateau(first, stop, float(t[first]), float(t[stop - 1]), level, "first", mean, u, out, tuple(flags))
    return plateau, cuts

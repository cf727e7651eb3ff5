"""Vibration at the shaft and blade frequencies of each rotor: imbalance, a damaged or taped blade.

An unbalanced rotor shakes the body once a turn, unequal blades too; B equal blades in uneven air B times a turn. The
logged speeds give the angle of each rotor but for its start, so in windows of one to four seconds the accelerometer is
regressed on sine and cosine of all rotors' angles at once (order tracking; Vold and Leuridan, SAE 931288, 1993; not
checked there). Rotors whose angles stay together over a window cannot be told apart, and a window in which the speeds
were not good enough to follow the phase holds less than the spectrum's line: both are left out.

Without speeds the strongest line between 20 Hz and the Nyquist frequency is told; which rotor it is, is not known.

What turns faster than the sensor sees is folded below the Nyquist frequency, so the level of all above 20 Hz still
tells whether a rotor shakes, and how much more than in healthy flights, though not which one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.flight.balance import ALARM
from bemt.tools.flight.log import FlightLog

_WINDOWS_S, _MOST_S, _LOW_HZ, _LEAST = (1.0, 2.0, 4.0), 120.0, 20.0, 3  # lengths tried; longest used; least windows
_APART, _FOLLOWED = 5.0, 0.5  # largest condition number of the angles; least share of the line's power [1]
_SIDE = 3  # half width of a band in bins: the lobe of the window and a speed that is off by one bin
_SPREAD, _FREE = 0.35, 4
"""Scatter of the log of an amplitude between healthy flights, and the degrees of freedom it counts as. Levels of three
Crazyflies (IMRC: brushed, brushless, with a payload) scatter by 0.35, 0.07 and 0.18: the least steady one counts."""
_MOST = float(np.log(10.0))  # by how much a rotor at fault raises the log of a level, at most (declared)
_FLOOR = {"m/s2": 0.2, "rad/s": 0.02}
"""Amplitude below which no rotor is unbalanced in any way that matters (an assumption)."""
STATED_MOST = 30.0
"""VIBE up to which an autopilot does well, on each axis [m/s2]."""


@dataclass(frozen=True)
class Vibration:
    """What the accelerometer shows of the rotors."""

    rate_hz: float = float("nan")  # Samples a second; NaN without an accelerometer or gyro [Hz]
    shaft_hz: float = float("nan")  # Mean speed of the rotors; NaN without speeds [Hz]
    # Of each rotor at once and at twice a turn; NaN where it is above the Nyquist frequency or not told apart [`unit`]
    amplitude: tuple[float, ...] = ()
    blade: tuple[float, ...] = ()
    # Strongest line above 20 Hz and its amplitude, for a log without speeds [Hz, `unit`]
    line_hz: float = float("nan")
    line: float = float("nan")
    twice: float = float("nan")  # At twice that line; NaN above the Nyquist frequency [`unit`]
    rms: tuple[float, ...] = ()  # Of each axis above 20 Hz; or as the autopilot states it, in flight [`unit`]
    stated: bool = False  # Whether the autopilot states it (VIBE)
    unit: str = "m/s2"  # m/s2, or rad/s of a gyro
    missing: str = ""  # What the log cannot show, and why

    @property
    def level(self) -> float:
        """Logarithm of the root mean square of all axes, no less than a sensor's noise; NaN where there is none."""
        least = 0.1 * _FLOOR[self.unit]
        return float(np.log(max(float(np.linalg.norm(self.rms)), least))) if self.rms else float("nan")

    @property
    def high(self) -> bool:
        """Whether it is more than the rules of autopilots allow, each for the measure that it is made for.

        ArduPilot states VIBE, a standard deviation, and accepts less than 30 m/s2 on each axis (Measuring Vibration).
        PX4 looks at the accelerations: too high where those of z, which carries the weight, reach those of x or y (Log
        Analysis using Flight Review), as a sine of the root mean squares here would. Neither was checked here.
        """
        if self.unit != "m/s2" or not self.rms:
            return False
        x, y, z = self.rms
        return bool(max(self.rms) >= STATED_MOST if self.stated else np.sqrt(2.0) * (z + max(x, y)) >= G0)

    def alike(self, other: Vibration) -> bool:
        """Whether the levels of both are of one kind: same unit, both stated or neither, same rate within a tenth."""
        same = (self.unit, self.stated) == (other.unit, other.stated)
        return same and (self.stated or abs(self.rate_hz / other.rate_hz - 1.0) < 0.1)


def vibration(log: FlightLog) -> Vibration:
    """Vibration in flight; throughout the log where nobody knows when it flew."""
    found = _found(log)
    if log.vibe is None:
        return found
    here = log.flying if log.flying.any() else np.ones(log.t.size, dtype=bool)
    return replace(found, rms=tuple(map(float, log.vibe[here].mean(axis=0))), stated=True)


def _too_few(rate: float, windows: int) -> str:
    """Samples that show nothing, in words; empty where there are enough."""
    if rate < 4.0 * _LOW_HZ:
        return f"{rate:.0f} samples a second of the accelerometer"
    return "under 3 s of samples" if windows < _LEAST else ""


def _found(log: FlightLog) -> Vibration:
    """Amplitudes at the rotors' frequencies in flight, in the unit of the sensor: raw accelerations, or rates.

    Rotors are told apart where their speeds are logged.
    """
    on = log.flying
    speeds = None if log.rpm is None else log.rpm / 60.0
    shaft = float(np.median(speeds[on])) if speeds is not None and on.any() else float("nan")
    if not shaft > 1.0:
        speeds, shaft = None, float("nan")
    if log.raw is None or log.raw[0].size < 2:
        return Vibration(shaft_hz=shaft, missing="no accelerometer in the log")
    t, v = log.raw
    step = float(np.median(np.diff(t)))
    rate = 1.0 / step
    nyquist = 0.5 * rate
    windows = _windows(log, t, step, _WINDOWS_S[0])
    few = _too_few(rate, len(windows))
    rms = () if few else _rms(v, windows, step)
    if np.isfinite(shaft) and shaft > 0.97 * nyquist:
        why = (f"the shaft turns at {shaft:.0f} Hz and the {'accelerometer' if log.raw_unit == 'm/s2' else 'gyro'} has "
               f"{rate:.0f} samples a second, which show up to {0.97 * nyquist:.0f} Hz")  # fmt: skip
        return Vibration(rate, shaft, rms=rms, unit=log.raw_unit, missing=why)
    if few:
        return Vibration(rate, shaft, unit=log.raw_unit, missing=f"{few} are too few")
    f, power = _spectrum(v, windows, step)
    if speeds is None or not np.isfinite(shaft):
        mean = power.mean(axis=0)
        above = np.flatnonzero((f > _LOW_HZ) & (f < nyquist - 2.0 * _SIDE * f[1]))
        peak = int(above[np.argmax(mean[above])])
        double = 2 * peak
        seen = double < mean.size - 3 * _SIDE
        twice_ = _line(mean, double - 2 * _SIDE, double + 2 * _SIDE) if seen else float("nan")
        return Vibration(rate, shaft, line_hz=float(f[peak]), line=_line(mean, peak - _SIDE, peak + _SIDE),
                         twice=twice_, rms=rms, unit=log.raw_unit,
                         missing="which rotor shakes: log the speed of each")  # fmt: skip
    turns = np.stack([np.interp(t, log.t, s) for s in speeds.T], axis=1)
    span = np.array([[turns[w].min(), turns[w].max()] for w in windows]) / f[1]
    total = float(np.mean([_line(p, int(low) - _SIDE, int(high) + 1 + _SIDE) ** 2
                           for p, (low, high) in zip(power, span, strict=True)]))  # fmt: skip
    once, twice, why = _by_rotor(v, t, turns, [_windows(log, t, step, s) for s in _WINDOWS_S], total, rate / shaft)
    return Vibration(rate, shaft, once, twice, line_hz=shaft, line=float(np.sqrt(total)), unit=log.raw_unit,
                     rms=rms, missing=f"which rotor shakes: {why}" if why else "")  # fmt: skip


def _rms(v: Array, windows: list[slice], step: float) -> tuple[float, ...]:
    """Root mean square of each axis above 20 Hz."""
    size = windows[0].stop - windows[0].start
    high = np.fft.rfftfreq(size, step) > _LOW_HZ
    squares = [2.0 * np.sum(np.abs(np.fft.rfft(v[w], axis=0)[high]) ** 2, axis=0) / size**2 for w in windows]
    return tuple(map(float, np.sqrt(np.mean(squares, axis=0))))


def _by_rotor(
    v: Array, t: Array, turns: Array, windows: list[list[slice]], total: float, per_turn: float
) -> tuple[tuple[float, ...], tuple[float, ...], str]:
    """Amplitudes once and twice a turn in windows of the length that holds most; or why not. Samples `per_turn`."""
    steps = 0.5 * (turns[1:] + turns[:-1]) * np.diff(t)[:, None]
    angle = 2.0 * np.pi * np.concatenate([np.zeros((1, turns.shape[1])), np.cumsum(steps, axis=0)])
    smooth = max(int(2.0 * per_turn), 2)
    tried = [(found, use) for use in windows if (found := _tracked(v, angle, use, smooth)) is not None]
    if not tried:
        return (), (), "all turn at the same speed"
    once, use = max(tried, key=lambda one: float(np.sum(one[0] ** 2)))
    if float(np.sum(once**2)) < max(_FOLLOWED * total, 1e-12):
        return (), (), "the speeds are too coarse to follow the phase"
    twice = _tracked(v, 2.0 * angle, use, max(smooth // 2, 2)) if per_turn > 4.0 / 0.97 else None
    unknown = (float("nan"),) * turns.shape[1]
    return tuple(map(float, once)), unknown if twice is None else tuple(map(float, twice)), ""


def _spectrum(v: Array, windows: list[slice], step: float) -> tuple[Array, Array]:
    """Frequencies, and the power of all axes in each window; a line of amplitude A sums to A^2."""
    size = windows[0].stop - windows[0].start
    shape = np.hanning(size)
    # Over its lobe a line of amplitude A sums to A^2 n sum(w^2) / 4.
    scale = 4.0 / (size * np.sum(shape**2))
    power = [scale * np.sum(np.abs(np.fft.rfft(shape[:, None] * (v[w] - v[w].mean(axis=0)), axis=0)) ** 2, axis=1)
             for w in windows]  # fmt: skip
    return np.asarray(np.fft.rfftfreq(size, step), dtype=float), np.array(power, dtype=float)


def _tracked(v: Array, angle: Array, windows: list[slice], smooth: int) -> Array | None:
    """Amplitude of each rotor, (B,), less what noise gives; None where the angles stay together."""
    squares = []
    for w in windows:
        X = np.concatenate([np.cos(angle[w]), np.sin(angle[w])], axis=1)
        y = v[w] - np.stack([np.convolve(c, np.ones(smooth) / smooth, "same") for c in v[w].T], axis=1)
        y, X = y[smooth:-smooth], X[smooth:-smooth]
        normal = X.T @ X
        low, high = np.linalg.eigvalsh(normal)[[0, -1]]
        if y.shape[0] < 2 * X.shape[1] or not high < _APART**2 * low:
            continue
        gram = np.linalg.inv(normal)
        b = gram @ X.T @ y
        noise = np.sum((y - X @ b) ** 2) / max(y.shape[0] - X.shape[1], 1) * np.diag(gram)
        B = angle.shape[1]
        parts = np.sum(b**2, axis=1) - noise
        squares.append(parts[:B] + parts[B:])
    return np.sqrt(np.clip(np.mean(squares, axis=0), 0.0, None)) if len(squares) >= _LEAST else None


def _windows(log: FlightLog, t: Array, step: float, length: float) -> list[slice]:
    """Gapless windows in the air; shorter ones where the sensor was sampled in bursts."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(t) > 1.5 * step) + 1, [t.size]])
    long = np.diff(edges) >= 128
    if not long.any():
        return []
    size = min(int(length / step), int(np.median(np.diff(edges)[long])))
    if size < 16:
        return []
    flying = log.flying if log.drive is not None or log.thrust is not None else np.ones(log.t.size, dtype=bool)
    air = np.interp(t, log.t, flying.astype(float)) > 0.5
    parts = [slice(k, k + size) for a, b in zip(edges[:-1][long], edges[1:][long], strict=True)
             for k in range(a, b + 1 - size, size)]  # fmt: skip
    return [p for p in parts if air[p].all()][: max(int(_MOST_S / (size * step)), 1)]


def _line(power: Array, low: int, high: int) -> float:
    """Amplitude within a band of bins, less the floor on both sides of it."""
    low, high = max(low, 1), min(high + 1, power.size)
    beside = np.concatenate([power[max(low - 12, 1) : low], power[high : high + 12]])
    floor = float(np.median(beside)) if beside.size else 0.0
    return float(np.sqrt(max(float(np.sum(power[low:high])) - floor * (high - low), 0.0)))


def shaken(mine: Vibration, healthy: Sequence[Vibration]) -> tuple[tuple[int, float, bool], ...]:
    """Rotors that shake more than in healthy flights, or than the others where none is given.

    Rotor (0 is the first; -1: all together, where they cannot be told apart), ratio of its amplitude at the shaft
    frequency [1], whether healthy flights say so.
    """
    from scipy import stats

    def read(v: Vibration) -> Array:
        logs: Array = np.log(np.maximum(np.array([*v.amplitude, v.line]), _FLOOR[v.unit]))
        return logs

    logs = read(mine)
    calm = [r for h in healthy if h.unit == mine.unit and (r := read(h)).size == logs.size]
    alone = [read(h)[-1] for h in healthy if h.unit == mine.unit]
    out: list[tuple[int, float, bool]] = []
    for k in range(logs.size):
        total = k == logs.size - 1
        past = np.array(alone if total else [c[k] for c in calm])
        past = past[np.isfinite(past)]
        rest = np.delete(logs[:-1], k) if not total and not healthy else np.zeros(0)
        before = past if past.size else rest[np.isfinite(rest)]
        if not np.isfinite(logs[k]) or before.size < (1 if past.size else 2) or (total and out):
            continue
        mean, sd, free = _next(before)
        change = float(logs[k] - mean)
        if change > float(stats.t.ppf(1.0 - ALARM / logs.size, free)) * sd:
            out.append((-1 if total else k, float(np.exp(change)), bool(past.size)))
    return tuple(out)


def _next(before: Array) -> tuple[float, float, int]:
    """Mean and standard deviation of the log of the next healthy flight's amplitude, and the degrees of freedom."""
    n, mean = before.size, float(before.mean())
    free = _FREE + n - 1
    square = (_FREE * _SPREAD**2 + float(np.sum((before - mean) ** 2))) / free * (1.0 + 1.0 / n)
    return mean, float(np.sqrt(square)), free


def level_odds(level: float, healthy: Sequence[float], seen: float) -> float:
    """Logarithm of how much likelier a level is with a rotor at fault than with none; 0 where nothing is known.

    A fault raises it in the share `seen` of the cases [1], by any factor up to ten; else it is as in healthy flights.
    """
    from scipy import stats

    before = np.array([v for v in healthy if np.isfinite(v)])
    if not np.isfinite(level) or not before.size:
        return 0.0
    mean, sd, free = _next(before)
    z = (level - mean) / sd
    calm = float(stats.t.pdf(z, free)) / sd
    raised = float(stats.t.sf(z - _MOST / sd, free) - stats.t.sf(z, free)) / _MOST
    return float(np.log((1.0 - seen) + seen * raised / calm))

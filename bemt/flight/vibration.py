"""Vibration at the shaft and blade frequencies of each rotor: imbalance, a damaged or taped blade.

An unbalanced rotor shakes the body once a turn, unequal blades too; B equal blades in uneven air B times a turn. The
spectrum of the accelerometer is taken in windows of a second (Hann; Welch 1967), and each rotor is given the power in
the band of its own speed in that window, less the floor beside it. Where two rotors turn at the same speed within the
resolution, their share cannot be told apart, and the window is left out for both; with rotors that always turn alike
only the sum is known.

Without speeds the strongest line between 20 Hz and the Nyquist frequency is told; which rotor it is, is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.diagnose.thresholds import GATE
from bemt.flight.log import FlightLog

__all__ = ["Vibration", "shaken", "vibration"]

Array = NDArray[np.float64]
_WINDOW_S, _MOST_S, _LOW_HZ, _LEAST = 1.0, 300.0, 20.0, 3  # window; longest used; lowest line; windows a rotor needs
_SIDE = 3  # half width of a band in bins: the lobe of the window and a speed that is off by one bin
_SPREAD, _FREE = 0.35, 4
"""Scatter of the log of an amplitude between healthy flights, and the degrees of freedom it counts as: an assumption,
not checked (a factor of 1.4; no recording here holds vibration at the shaft frequency)."""


@dataclass(frozen=True)
class Vibration:
    """What the accelerometer shows of the rotors.

    Attributes
    ----------
    rate_hz : float
        Samples a second; NaN without an accelerometer or gyro [Hz].
    shaft_hz : float
        Mean speed of the rotors; NaN without speeds [Hz].
    amplitude, blade : tuple of float
        Of each rotor at once and at twice a turn; NaN where it is above the Nyquist frequency or not told apart
        [`unit`].
    line_hz, line : float
        Strongest line above 20 Hz and its amplitude, for a log without speeds [Hz, `unit`].
    unit : str
        m/s2, or rad/s of a gyro.
    missing : str
        What the log cannot show, and why.
    """

    rate_hz: float
    shaft_hz: float
    amplitude: tuple[float, ...] = ()
    blade: tuple[float, ...] = ()
    line_hz: float = float("nan")
    line: float = float("nan")
    unit: str = "m/s2"
    missing: str = ""


def vibration(log: FlightLog) -> Vibration:
    """Amplitudes at the rotors' frequencies, in flight.

    Parameters
    ----------
    log : FlightLog
        With raw accelerations (or rates), and speeds where the rotors are to be told apart.

    Returns
    -------
    Vibration
        In the unit of the sensor.
    """
    on = log.flying
    speeds = None if log.rpm is None else log.rpm / 60.0
    shaft = float(np.median(speeds[on])) if speeds is not None and on.any() else float("nan")
    if log.raw is None:
        return Vibration(float("nan"), shaft, missing="no accelerometer in the log")
    t, v = log.raw
    step = float(np.median(np.diff(t)))
    rate = 1.0 / step
    nyquist = 0.5 * rate
    if np.isfinite(shaft) and shaft > 0.97 * nyquist:
        why = (f"the shaft turns at {shaft:.0f} Hz and the {'accelerometer' if log.raw_unit == 'm/s2' else 'gyro'} has "
               f"{rate:.0f} samples a second, which show up to {0.97 * nyquist:.0f} Hz")  # fmt: skip
        return Vibration(rate, shaft, unit=log.raw_unit, missing=why)
    windows = _windows(log, t, step)
    if len(windows) < _LEAST or nyquist < 2.0 * _LOW_HZ:
        why = f"{rate:.0f} samples a second of the accelerometer" if nyquist < 2.0 * _LOW_HZ else "under 3 s of samples"
        return Vibration(rate, shaft, unit=log.raw_unit, missing=f"{why} are too few")
    size = windows[0].stop - windows[0].start
    shape = np.hanning(size)
    f = np.fft.rfftfreq(size, step)
    # Sum over the lobe of a line of amplitude A is A^2 n sum(w^2) / 4.
    scale = 4.0 / (size * np.sum(shape**2))
    power = np.array([
        scale * np.sum(np.abs(np.fft.rfft(shape[:, None] * (v[w] - v[w].mean(axis=0)), axis=0)) ** 2, axis=1)
        for w in windows
    ])  # fmt: skip
    if speeds is None or not np.isfinite(shaft):
        mean = power.mean(axis=0)
        above = np.flatnonzero((f > _LOW_HZ) & (f < nyquist - 2.0 * _SIDE / (size * step)))
        peak = int(above[np.argmax(mean[above])])
        got = _line(mean, peak, mean.size)
        return Vibration(rate, shaft, line_hz=float(f[peak]), line=got, unit=log.raw_unit,
                         missing="which rotor shakes: log the speed of each")  # fmt: skip
    n = np.array([[np.interp(t[w], log.t, s).mean() for s in speeds.T] for w in windows])
    bins = n * size * step
    once, twice = _of_rotors(power, bins), _of_rotors(power, 2.0 * bins)
    if np.any(np.isfinite(once)):
        return Vibration(rate, shaft, once, twice, unit=log.raw_unit)
    got = float(np.sqrt(np.mean([_line(p, int(round(b)), f.size) ** 2 for p, b in zip(power, bins.mean(axis=1),
                                                                                      strict=True)])))  # fmt: skip
    return Vibration(rate, shaft, line_hz=shaft, line=got, unit=log.raw_unit,
                     missing="which rotor shakes: all turn at the same speed")  # fmt: skip


def _windows(log: FlightLog, t: Array, step: float) -> list[slice]:
    """Gapless windows in the air; shorter ones where the sensor was sampled in bursts."""
    breaks = np.flatnonzero(np.diff(t) > 1.5 * step) + 1
    runs = [r for r in np.split(np.arange(t.size), breaks) if r.size >= 128]
    if not runs:
        return []
    size = min(int(_WINDOW_S / step), int(np.median([r.size for r in runs])))
    air = np.interp(t, log.t, log.flying.astype(float)) > 0.5
    out = []
    for run in runs:
        for begin in range(run[0], run[-1] + 2 - size, size):
            part = slice(begin, begin + size)
            if air[part].all():
                out.append(part)
    return out[: max(int(_MOST_S / (size * step)), 1)]


def _line(power: Array, centre: int, bins: int) -> float:
    """Amplitude of a line within a band, less the floor on both sides of it."""
    low, high = max(centre - _SIDE, 1), min(centre + _SIDE + 1, bins)
    beside = np.concatenate([power[max(low - 12, 1) : low], power[high : high + 12]])
    floor = float(np.median(beside)) if beside.size else 0.0
    return float(np.sqrt(max(float(np.sum(power[low:high])) - floor * (high - low), 0.0)))


def _of_rotors(power: Array, centre: Array) -> tuple[float, ...]:
    """Amplitude of each rotor over the windows in which it stands alone; NaN where there are too few."""
    W, B = centre.shape
    bins, out = power.shape[1], []
    for k in range(B):
        others = np.delete(centre, k, axis=1)
        alone = np.all(np.abs(others - centre[:, [k]]) > 2.0 * _SIDE, axis=1) & (centre[:, k] < bins - 1 - _SIDE)
        found = [_line(power[w], int(round(centre[w, k])), bins) ** 2 for w in np.flatnonzero(alone)]
        out.append(float(np.sqrt(np.mean(found))) if len(found) >= _LEAST else float("nan"))
    return tuple(out)


def shaken(mine: Vibration, healthy: Sequence[Vibration]) -> tuple[tuple[int, float, bool], ...]:
    """Rotors that shake more than in healthy flights, or than the others where none is given.

    Parameters
    ----------
    mine : Vibration
        Of the flight.
    healthy : sequence of Vibration
        Of healthy flights of the same vehicle.

    Returns
    -------
    tuple of (int, float, bool)
        Rotor (0 is the first), ratio of its amplitude at the shaft frequency [1], whether healthy flights say so.
    """
    from scipy import stats

    own = np.array(mine.amplitude, dtype=float)
    if not np.any(own > 0.0):
        return ()
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(own)
        calm = np.array([np.log(h.amplitude) for h in healthy if len(h.amplitude) == own.size])
    out = []
    for k in range(own.size):
        past = calm[:, k][np.isfinite(calm[:, k])] if calm.size else np.zeros(0)
        rest = np.delete(logs, k)
        rest = rest[np.isfinite(rest)]
        if not np.isfinite(logs[k]) or (not past.size and rest.size < 2):
            continue
        before = past if past.size else rest
        n = before.size
        square = float(np.sum((before - before.mean()) ** 2))
        free = _FREE + n - 1
        sd = np.sqrt((_FREE * _SPREAD**2 + square) / free * (1.0 + 1.0 / n))
        bar = float(stats.t.ppf(1.0 - GATE / own.size, free))
        if logs[k] - before.mean() > bar * sd:
            out.append((k, float(np.exp(logs[k] - before.mean())), bool(past.size)))
    return tuple(out)

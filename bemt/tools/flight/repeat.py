"""How far a constant differs from flight to flight of one vehicle, beyond what the blocks of one flight show.

Prior: thrust constants of four recorded flights of a brushed Crazyflie 2.1 of one mass had a standard deviation of
0.7 % (three degrees of freedom) where the blocks of each flight say 0.1 to 0.3 %. Without what air across the disks
adds (:mod:`bemt.tools.flight.identify`) six of them have 0.45 %, eight of a brushless one 0.21 % and four with a
payload 0.11 %; but the payload still weighs 2 % too little, so the prior stays. Own flights are pooled with it (scaled
inverse chi-squared; Gelman et al., Bayesian Data Analysis, 3rd ed., section 2.6).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.tools.flight.log import FlightLog

SCATTER = 0.007
"""Standard deviation of the thrust constant between flights of one vehicle [1]."""
SCATTER_FREE = 3
"""Its degrees of freedom: four flights."""


def flight_scatter(values: ArrayLike) -> tuple[float, float]:
    """Relative standard deviation of a constant between flights, and Student's factor of its 95 % interval.

    One value, or none, leaves the prior.

    >>> flight_scatter([1.0])[0]
    0.007
    >>> flight_scatter([1.0, 1.0, 1.0, 1.0])[0] < 0.007
    True
    """
    from scipy import stats

    v = np.atleast_1d(np.asarray(values, dtype=float))
    own = max(v.size - 1, 0)
    square = float(np.sum((v / v.mean() - 1.0) ** 2)) if own else 0.0
    free = SCATTER_FREE + own
    sd = SCATTER if not own else float(np.sqrt((SCATTER_FREE * SCATTER**2 + square) / free))
    return sd, float(stats.t.ppf(0.975, free))


# Uncertainty of a time series from pieces of it: samples of one flight are not independent, its tenths nearly are.
#
# Batch means (Law, Simulation Modeling and Analysis, ch. 9), and for a regression the delete-a-group jackknife (Kott,
# J. Official Statistics 17, 2001; neither checked there).
BATCHES = 10
"""Pieces of a flight."""


def u_of_mean(values: ArrayLike) -> float:
    """Standard uncertainty of the mean of a series in order of time, 10 values or more.

    >>> u_of_mean(np.ones(40))
    0.0
    """
    means = [b.mean() for b in np.array_split(np.asarray(values, dtype=float), BATCHES)]
    return float(np.std(means, ddof=1) / np.sqrt(BATCHES))


def half_width(of_batches: ArrayLike) -> float:
    """Half width of the 95 % interval of a mean, from its value in each batch.

    >>> round(half_width([1.0, 2.0, 3.0]), 3)
    2.484
    """
    from scipy import stats

    v = np.asarray(of_batches, dtype=float)
    return float(stats.t.ppf(0.975, v.size - 1) * v.std(ddof=1) / np.sqrt(v.size))


def jackknifed(X: Array, y: Array) -> tuple[Array, Array]:
    """Least squares of readings in order of time, with standard uncertainties from ten fits that each lack a tenth.

    >>> x = np.linspace(0.0, 1.0, 50)
    >>> jackknifed(x[:, None], 2.0 * x)[0]
    array([2.])
    """

    def fitted(keep: NDArray[np.bool_]) -> Array:
        return np.asarray(np.linalg.lstsq(X[keep], y[keep], rcond=None)[0], dtype=float)

    every = np.ones(y.size, dtype=bool)
    parts = []
    for p in np.array_split(np.arange(y.size), BATCHES):
        keep = every.copy()
        keep[p] = False
        parts.append(fitted(keep))
    spread = np.array(parts) - np.mean(parts, axis=0)
    return fitted(every), np.asarray(np.sqrt((BATCHES - 1) * np.mean(spread**2, axis=0)))


def regressed(X: Array, y: Array) -> tuple[Array, Array]:
    """The same with half widths of 95 %."""
    from scipy import stats

    whole, u = jackknifed(X, y)
    return whole, float(stats.t.ppf(0.975, BATCHES - 1)) * u


def block_means(t: Array, width: float, *series: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """Numbers of the blocks of a series in order of time that are at least half full; means in them of (N, k) each."""
    number = np.floor((t - t[0]) / width).astype(int)
    count = np.bincount(number)
    full = np.flatnonzero(count >= max(0.5 * np.median(count[count > 0]), 2))
    sums = [[np.bincount(number, weights=c)[full] for c in v.T] for v in series]
    return full, [(np.reshape(s, (-1, full.size)) / count[full]).T.copy() for s in sums]


# Which healthy flights belong to one session, and whether the judged flight does: as stated, or by date.
#
# A battery taken out and put back, or a propeller exchanged, moves the trim; within a session it stays.
_DATE = re.compile(r"(?<!\d)(20\d\d)[-_.]?(0?[1-9]|1[0-2])[-_.]?(0?[1-9]|[12]\d|3[01])(?!\d)")


@dataclass(frozen=True)
class Sessions:
    """Session of each flight."""

    days: tuple[int, ...]  # Of the healthy flights, numbered
    day: int | None | str  # Of the judged one; None: another; empty: nobody knows
    by: str  # What tells: "stated", "date", or empty where nothing does


def sessions(flight: FlightLog, healthy: Sequence[FlightLog], stated: Sequence[str] = (), day: str = "") -> Sessions:
    """Group healthy flights, and place the judged one.

    Parameters
    ----------
    flight, healthy : FlightLog and sequence of FlightLog
        The judged flight and the healthy ones.
    stated : sequence of str
        Session of each healthy flight as the user groups them; empty for none, then dates tell where all have one.
    day : str
        "same": the judged flight is of the last session; "other": of none; or a session of `stated`; empty where the
        user does not say: then its date tells.
    """
    dates, mine = [_date(h) for h in healthy], ""
    if len(stated) == len(healthy) and len(set(stated)) > 1:
        labels, by = list(stated), "stated"
    elif healthy and all(dates):
        labels, by, mine = dates, "date", _date(flight)
    else:
        labels, by = list(stated) if len(stated) == len(healthy) else [""] * len(healthy), ""
    names = list(dict.fromkeys(labels))
    days = tuple(names.index(x) for x in labels)
    if day == "same" and days:
        return Sessions(days, days[-1], by or "stated")
    if day and day in names:
        return Sessions(days, names.index(day), by or "stated")
    if day == "other" or (mine and mine not in names):
        return Sessions(days, None, by or "stated")
    return Sessions(days, names.index(mine) if mine else "", by)


def _date(log: FlightLog) -> str:
    """Day by the log, or by the name of the file or its folder."""
    if log.date:
        return log.date
    path = Path(log.file)
    found = _DATE.search(path.name) or _DATE.search(path.parent.name)
    return f"{found[1]}-{int(found[2]):02}-{int(found[3]):02}" if found else ""

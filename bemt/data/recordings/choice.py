"""Averages of one history over whole revolutions, whose duration only the user knows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from bemt.base.averaging import Average, Mean, keep_last, revolution_average
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of
from bemt.physics.dataset import Dataset


@dataclass(frozen=True)
class Choice:
    """What only the user knows."""

    period: float | None = None  # Duration of a revolution [s]; None: no average over revolutions
    revolutions: int | None = None  # How many; None takes 4, or half of the run


def averaged(record: Dataset, period: float, revolutions: int | None = None) -> Dataset:
    """Replace the means of a history by those over its last whole revolutions.

    >>> import numpy as np
    >>> t = np.arange(1, 401) * 0.01
    >>> r = Dataset("cfd", "x", {"time_s": t, "q": 2 + np.sin(2 * np.pi * t)}, units={"q": ""},
    ...             provenance={"clock": "time", "time_channel": "time_s", "clock_channels": "time_s"})
    >>> mean = averaged(r, 1.0).provenance["means"]["q"]
    >>> round(mean.value, 9), mean.over
    (2.0, 'last 2 revolutions (2 to 4 s, 200 rows)')
    """
    name = record.provenance.get("time_channel", "time_s")
    own = {name, *record.provenance.get("clock_channels", "").split("\t")}
    if name not in record:
        note = "no column of time: the speed of rotation is not used"
        return replace(record, notes=(*record.notes, note))
    time = record[name]
    told = record.provenance.get("means", {})
    index, notes = keep_last(time, name)
    problems: dict[str, list[str]] = {}
    scatter: dict[str, float] = {}
    means: dict[str, Mean] = {}
    for key, values in record.values.items():
        if key in own or (key not in told and record.unit(key) == "s"):
            continue
        average = revolution_average(time[index], values[index], period, revolutions)
        turns = average.per_revolution
        if average.mean and turns and max(turns) - min(turns) > 0.02 * abs(average.mean):
            scatter[key] = (max(turns) - min(turns)) / abs(average.mean)
        if average.problem:
            problems.setdefault(average.problem, []).append(key)
        if average.mean is not None:
            means[key] = Mean(average.mean, _span(average), average.drift)
    more = [
        f"{'no mean' if 'only' not in text else 'doubtful mean'} of {', '.join(keys)}: {text}"
        for text, keys in problems.items()
    ]
    if scatter:
        worst = ", ".join(f"{key} {value:.2%}" for key, value in list(scatter.items())[:6])
        more.append(f"means of single revolutions differ: {worst}")
    return replace(record, provenance={**record.provenance, "means": means}, notes=(*record.notes, *notes, *more))


def _span(average: Average) -> str:
    turns = f"{average.revolutions} revolution" + ("s" if average.revolutions > 1 else "")
    return f"last {turns} ({average.start:.6g} to {average.end:.6g} s, {number_of(average.rows, 'row')})"


def asked(rpm: float | None = None, period: float | None = None, revolutions: int | None = None) -> Choice:
    """Make a choice of options, or refuse them, all faults at once."""
    faults = []
    if rpm is not None and not (math.isfinite(rpm) and 0.01 <= rpm <= 1e6):
        faults.append(Fault("", "--rpm", f"{rpm:g}", "a number from 0.01 to 1e6 rev/min"))
    if period is not None and not (math.isfinite(period) and 6e-5 <= period <= 6e3):
        faults.append(Fault("", "--period-s", f"{period:g}", "a time from 6e-5 to 6000 s"))
    if rpm is not None and period is not None:
        faults.append(Fault("", "--rpm, --period-s", "both", "one of them"))
    if revolutions is not None and not 1 <= revolutions <= 10**6:
        faults.append(Fault("", "--revolutions", str(revolutions), "a whole number of 1 or more"))
    if revolutions is not None and rpm is None and period is None:
        faults.append(Fault("", "--revolutions", "no speed", "--rpm or --period-s as well"))
    if faults:
        raise InputError(faults)
    return Choice(60.0 / rpm if rpm is not None else period, revolutions)

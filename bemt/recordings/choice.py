"""What only the user knows of a file of results - speed, sign, sector, zones - applied to its record, never guessed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.averaging import Average, Mean, keep_last, revolution_average
from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Choice:
    """What only the user knows."""

    period: float | None = None  # Duration of a revolution [s]; None: no average over revolutions
    revolutions: int | None = None  # How many; None takes 4, or half of the run
    sign: int = 1  # +1 or -1 for the loads
    sector: int = 1  # Number of equal sectors of which the model is one; loads are multiplied by it
    zones: tuple[str, ...] = ()  # Zones whose loads are added up; empty: none are
    loads: tuple[str, ...] = ()  # Channels that sign and sector apply to; empty: all in N or Nm


def averaged(record: Dataset, period: float, revolutions: int | None = None) -> Dataset:
    """Replace the means of a history by those over its last whole revolutions.

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
    return f"last {turns} ({average.start:.6g} to {average.end:.6g} s, {average.rows} rows)"


def chosen(record: Dataset, choice: Choice) -> Dataset:
    """Apply zones, sector and sign, in this order."""
    values, own = dict(record.values), dict(record.units)
    means: dict[str, Mean] = dict(record.provenance.get("means", {}))
    notes = list(record.notes)
    file = record.provenance.get("file", "")
    if choice.zones:
        _add_zones(record, choice.zones, file, values, means, own)
    factor = choice.sign * choice.sector
    if factor != 1:
        absent = [name for name in choice.loads if name not in values]
        if absent:
            hint = f"Channels: {', '.join(list(values)[:12])}"
            raise InputError(Fault(file, "--load", ", ".join(absent), "names of channels", hint))
        loads = choice.loads or tuple(n for n in values if own.get(n, record.unit(n)) in ("N", "Nm"))
        if not loads:
            hint = "Name them: --load NAME"
            raise InputError(Fault(file, "--sign, --sector", "no channel in N or Nm", "loads to apply them to", hint))
        for name in loads:
            values[name] = values[name] * factor
            if (old := means.get(name)) is not None:
                means[name] = Mean(old.value * factor, f"{old.over}, times {factor}", old.drift)
        text = f"sign {choice.sign:+d}, {choice.sector} sectors, as given: {len(loads)} channels times {factor}"
        notes.append(text + ("; holds only for axisymmetric flow" if choice.sector > 1 else ""))
    about = {**record.provenance, **({"means": means} if means else {})}
    return replace(record, values=values, units=own, provenance=about, notes=tuple(notes))


def _add_zones(
    record: Dataset,
    zones: Sequence[str],
    file: str,
    values: dict[str, Array],
    means: dict[str, Mean],
    own: dict[str, str],
) -> None:
    """Add the sums over the zones that count."""
    groups: dict[str, dict[str, str]] = {}
    for name in record.values:
        match = re.fullmatch(r"(.+?)\(([^()]*)\)", name)
        if record.provenance.get("format") == "openfoam_forces":  # Cd(f), Cd(r): front and rear, no zones
            continue
        if match and "center_of_pressure" not in name and "y_plus" not in name:
            groups.setdefault(match[1], {})[match[2]] = name
    known = list(dict.fromkeys(zone for group in groups.values() for zone in group))
    absent = [zone for zone in zones if zone not in known]
    if absent:
        hint = f"Zones: {', '.join(known)}" if known else "This file does not tell zones apart"
        raise InputError(Fault(file, "--zones", ", ".join(absent), "zones of the file", hint))
    if "Net" in zones and len(zones) > 1:
        raise InputError(Fault(file, "--zones", "Net with other zones", "Net alone, or zones", "Net holds them all"))
    for base, group in groups.items():
        parts = [group[zone] for zone in zones if zone in group]
        if len(parts) != len(zones) or len(zones) < 2:
            continue
        label = f"{base}({'+'.join(zones)})"
        values[label], own[label] = np.sum([values[p] for p in parts], axis=0), record.unit(parts[0])
        found = [means[p] for p in parts if p in means]
        if len(found) < len(parts):
            continue
        mean, drift = math.fsum(m.value for m in found), None
        if mean and all(m.drift is not None for m in found):  # drift is change / |mean|
            drift = sum((m.drift or 0.0) * abs(m.value) for m in found) / abs(mean)
        means[label] = Mean(mean, f"{found[0].over}, sum of {len(parts)} zones", drift)


def asked(
    rpm: float | None = None,
    period: float | None = None,
    revolutions: int | None = None,
    sign: int = 1,
    sector: int = 1,
    zones: Sequence[str] = (),
    loads: Sequence[str] = (),
) -> Choice:
    """Make a choice of options, or refuse them, all faults at once."""
    faults = []
    if rpm is not None and not (math.isfinite(rpm) and 0.01 <= rpm <= 1e6):
        faults.append(Fault("", "--rpm", f"{rpm:g}", "a number from 0.01 to 1e6 rev/min"))
    if period is not None and not (math.isfinite(period) and 6e-5 <= period <= 6e3):
        faults.append(Fault("", "--period", f"{period:g}", "a time from 6e-5 to 6000 s"))
    if rpm is not None and period is not None:
        faults.append(Fault("", "--rpm, --period", "both", "one of them"))
    if revolutions is not None and not 1 <= revolutions <= 10**6:
        faults.append(Fault("", "--revolutions", str(revolutions), "a whole number of 1 or more"))
    if revolutions is not None and rpm is None and period is None:
        faults.append(Fault("", "--revolutions", "no speed", "--rpm or --period as well"))
    if sign not in (1, -1):
        faults.append(Fault("", "--sign", str(sign), "+1 or -1"))
    if not 1 <= sector <= 100:
        faults.append(Fault("", "--sector", str(sector), "the number of equal sectors, 1 to 100"))
    if loads and sign == sector == 1:
        faults.append(Fault("", "--load", ", ".join(loads), "--sign -1 or --sector N as well, which it belongs to"))
    if faults:
        raise InputError(faults)
    return Choice(60.0 / rpm if rpm is not None else period, revolutions, sign, sector, tuple(zones), tuple(loads))

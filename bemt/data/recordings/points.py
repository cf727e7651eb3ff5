"""From rows to points: plateaus of a record of samples, or the rows of a table of steady points.

Every row ends in one point, in one stretch at rest, or in one entry of what was dropped, with the reason. Is a table a
record of samples, or a list of steady points? The rule, in this order:

1. rows with their own uncertainty (``u_...`` columns, stated errors) are points: somebody has averaged already;
2. fewer than twelve rows are points;
3. rows that differ from their neighbours by more than 2 % of the range in every load and speed, where no command is
   held, are points in any order (of fewer than 400 rows; a log has more);
4. with time: a median step of 0.2 s or less makes samples; up to 2 s still, when the command is held for five rows or
   more in most rows, or up to 0.5 s when there is no command; anything slower makes points, and so does a command that
   changes from row to row (a slow ramp: quasi-steady);
5. without time: a command that is held like that makes samples, and so do stairs: most rows in stretches of 16 or
   more between two steps, in which nothing goes on changing; else points;
6. more than 50,000 rows are samples in any case: nobody has so many steady points.

Rest is where nothing turns: the speed reads 0, or no sensor tells and the command is 0 %, and no more current flows
than 0.5 % of the largest (1000 us and 0 % are rest by themselves). A speed of 0 while current flows is a sensor that
failed, or a motor that stopped under command: every load is below what it was in all rows that turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array, middle
from bemt.base.errors import Fault, InputError
from bemt.data.readers.samples import MISREAD, STICKS, against_load, stopped, stuck
from bemt.data.recordings import plateaus
from bemt.data.recordings.channels import LOADS, DroppedCells, file_name, lost, moves, runs_of, stated
from bemt.physics.dataset import Dataset

Rows = NDArray[np.intp]
SIGNALS = ("thrust_N", "torque_Nm", "rpm", "power_W", "current_A", "electrical_power_W", "CT", "CP")
"""Channels that decide about steps, first one first."""
SLOWEST = 1e-3
"""Speed below which a number is no reading. [rev/min]"""
FEWEST = 12
MOST_POINTS, UNLIKE = 400, 0.02
LOG = 50_000
FAST_S, MIDDLE_S, SLOW_S = 0.2, 0.5, 2.0
HELD = 5
STEADY = 0.02
"""Change from the first to the second half of a level, of the largest reading, that a sweep exceeds: declared. [1]"""
IDLE_S = 1.0005e-3
TARED = ("thrust_N", "duct_thrust_N", "torque_Nm")
"""Channels of load cells."""
STALLED = "motor stopped under command (lost step or cut off): not a point"
_SKIP = ("time_s", "run", "electrical_rpm", "optical_rpm")
_COMMANDS = ("pwm_s", "throttle")


def command_of(rec: Dataset) -> tuple[str, Array] | None:
    """Find the command."""
    told = ((name, rec.values[name]) for name in _COMMANDS if name in rec.values)
    return next(((name, v) for name, v in told if np.any(np.isfinite(v))), None)


def _held(command: Array) -> bool:
    """Whether most rows belong to stretches of five or more with one command."""
    edges = np.flatnonzero(np.diff(command) != 0.0) + 1
    lengths = np.diff(np.concatenate([[0], edges, [len(command)]]))
    return bool(lengths[lengths >= HELD].sum() > 0.5 * len(command))


def _unlike(rec: Dataset) -> bool:
    """Whether neighbouring rows differ in everything that was measured."""
    steps = []
    for v in (rec.values[k] for k in ("rpm", "thrust_N", "torque_Nm", "power_W", "current_A") if k in rec.values):
        v = v[np.isfinite(v)]
        span = float(np.ptp(np.percentile(v, [5.0, 95.0]))) if v.size >= FEWEST else 0.0
        if span > 0.0:
            steps.append(float(np.median(np.abs(np.diff(v)))) / span)
    return bool(steps) and min(steps) > UNLIKE


def _stairs(rec: Dataset) -> bool:
    """Whether most rows stand on levels, each as long as what shows a step, on which no load goes on changing.

    Of 1,793 published files without clock or command none is such a table of points.
    """
    told = [v for s in SIGNALS if (v := rec.values.get(s)) is not None and moves(v)]
    rows = np.flatnonzero(np.isfinite(told[0])) if told else np.empty(0, dtype=np.intp)
    if rows.size < 2 * plateaus.WINDOW:
        return False
    long = [rows[a:b] for a, b in plateaus.levels(told[0][rows]) if b - a >= 2 * plateaus.WINDOW]
    if len(long) < 2 or sum(map(len, long)) < 0.5 * rows.size:
        return False
    halves = [[np.diff([middle(v[half]) for half in np.array_split(on, 2)])[0] for on in long] for v in told]
    return all(not np.nanmedian(np.abs(h)) > STEADY * np.nanmax(np.abs(v)) for h, v in zip(halves, told, strict=True))


def _by_step(step: float, rows: int, commanded: bool, held: bool) -> tuple[bool, str]:
    """Decide by the median time step [s], and by a command, if there is one, that is held or changes."""
    words = f"the median time step is {step:.3g} s"
    if step <= (FAST_S if commanded else MIDDLE_S):
        return True, f"rows are samples: {words}"
    if step <= SLOW_S and held:
        return True, f"rows are samples: {words} and the command is held"
    if rows > LOG:
        return True, f"rows are samples: more than {LOG}"
    more = ", and the command changes" if commanded and not held else ""
    return False, f"rows are points: {words}{more}" + (" (a slow ramp: quasi-steady)" if step <= MIDDLE_S else "")


def is_samples(rec: Dataset) -> tuple[bool, str]:
    """Decide what the rows are."""
    if stated(rec):
        return False, "rows are points: they have their own uncertainties"
    if len(rec) < FEWEST:
        return False, f"rows are points: fewer than {FEWEST}"
    found = command_of(rec)
    held = found is not None and _held(found[1])
    if len(rec) < MOST_POINTS and not held and _unlike(rec):
        return False, "rows are points: neighbours differ in every load and speed"
    t = rec.values.get("time_s")
    t = t[np.isfinite(t)] if t is not None else None
    if t is not None and len(t) > 0.5 * len(rec):
        return _by_step(float(np.median(np.abs(np.diff(t)))), len(rec), found is not None, held)
    if held:
        return True, "rows are samples: no time, but the command is held over many rows"
    if t is None and found is None and _stairs(rec):
        return True, "rows are samples: no time, but they stand in stairs"
    if len(rec) > LOG:
        return True, f"rows are samples: more than {LOG}"
    return False, "rows are points: no time, and no command that is held"


def at_rest(rec: Dataset) -> NDArray[np.bool_]:
    """Rows at which nothing turns, (N,)."""
    n = len(rec)
    found = command_of(rec)
    idle = np.zeros(n, dtype=bool)
    if found is not None:
        idle = found[1] <= (IDLE_S if found[0] == "pwm_s" else 0.0)
    speed = rec.values.get("rpm")
    told = speed is not None and bool(np.any(np.abs(np.nan_to_num(speed)) > 0.0))
    still = (speed == 0.0) if told and speed is not None else idle
    current = rec.values.get("current_A")
    if current is not None and np.any(np.isfinite(current)):
        top = float(np.nanmax(np.abs(current)))
        return np.asarray(still & ((np.abs(current) <= 0.005 * top) | idle))
    if found is not None:
        return np.asarray(still & idle)
    quiet = np.zeros(n, dtype=bool)
    for name in ("thrust_N", "torque_Nm"):
        v = rec.values.get(name)
        if v is not None and np.any(np.isfinite(v)):
            quiet |= np.abs(v) > 0.02 * float(np.nanmax(np.abs(v)))
    return np.asarray(still & ~quiet)


def stalled(rec: Dataset) -> NDArray[np.bool_]:
    """Rows at which the motor stopped though the command turned it before, (N,)."""
    command, speed = command_of(rec), rec.values.get("rpm")
    if command is None or speed is None:
        return np.zeros(len(rec), dtype=bool)
    return stopped(speed, command[1], rec.values)


@dataclass(frozen=True)
class Rest:
    """Means at rest: `when` (time or row), mean and standard error by channel."""

    when: float
    mean: Mapping[str, float]
    u: Mapping[str, float]


@dataclass(frozen=True)
class Point:
    """One steady point: means, standard uncertainties (uncorrelated part), rows, when, run, direction, flags."""

    values: Mapping[str, float]
    u: Mapping[str, float]
    rows: Rows
    when: float
    run: float
    direction: str
    flags: tuple[str, ...] = ()


@dataclass
class Found:
    """Points, stretches at rest by run, what was dropped, notes."""

    points: list[Point] = field(default_factory=list)
    rests: dict[float, list[Rest]] = field(default_factory=dict)
    lost: list[DroppedCells] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def _clean(rec: Dataset, still: NDArray[np.bool_], found: Found) -> dict[str, Array]:
    """Copies of the channels without readings of a speed sensor that failed where the rotor does not stand still."""
    data = {name: v for name, v in rec.values.items() if name not in _SKIP}
    if (rpm := data.get("rpm")) is not None:
        failed = np.flatnonzero((rpm == 0.0) & ~still)
        found.lost += lost(rec, failed, "rpm", "reads 0 while the rotor turns: not a reading")
        slow = np.flatnonzero((np.abs(rpm) < SLOWEST) & (rpm != 0.0))
        for i in slow:
            found.lost += lost(rec, [i], "rpm", f"{rpm[i]:.3g} rev/min is not a rotor speed")
        data["rpm"] = _without(rpm, [*failed, *slow])
    return data


def _without(values: Array, rows: Sequence[int]) -> Array:
    """Channel without some of its values; itself when there are none to leave out."""
    if not rows:
        return values
    out = values.copy()
    out[rows] = np.nan
    return out


def _rest(rec: Dataset, rows: Rows, data: Mapping[str, Array], when: float, run: float, found: Found) -> None:
    """Keep the means of a stretch at rest, whose rows are no points."""
    mean, u = {}, {}
    for name, v in data.items():
        own = v[rows]
        own = own[np.isfinite(own)]
        if own.size:
            mean[name], u[name] = float(np.median(own)), plateaus.standard_error(own)
    found.rests.setdefault(run, []).append(Rest(when, mean, u))
    found.lost += lost(rec, rows, "", "motor stopped: zero of the stand, not a point")


def _signal(rec: Dataset, name: str) -> str:
    """Channel that shows the steps: the first that moves, else the first with a value."""
    told = [s for s in SIGNALS if s in rec.values and np.any(np.isfinite(rec.values[s]))]
    if not told:
        raise InputError(Fault(name, "", "no load with a value", f"one of {', '.join(SIGNALS)}"))
    return next((s for s in told if moves(rec.values[s])), told[0])


def _stated_u(told: Mapping[str, Array], rows: Rows, scatter: Mapping[str, float]) -> dict[str, float]:
    """Uncertainty of means whose rows state theirs: it averages down, but no further than the scatter shows."""
    out = {}
    for key, e in told.items():
        own = e[rows][np.isfinite(e[rows])]
        if own.size:
            seen = scatter.get(key, 0.0)
            out[key] = max(float(np.sqrt(np.mean(own**2) / own.size)), seen if math.isfinite(seen) else 0.0)
    return out


def from_samples(rec: Dataset, name: str) -> Found:
    """Plateaus of every run."""
    found = Found()
    signal = _signal(rec, name)
    rest = at_rest(rec)
    stops = stalled(rec) & ~rest
    data = _clean(rec, rest | stops, found)
    _spikes(rec, data, found)
    runs, told = runs_of(rec), stated(rec)
    labels, first = np.unique(runs, return_index=True)
    for run in labels[np.argsort(first)].tolist():
        rows = np.flatnonzero(runs == run)
        rows, t = clock_of(rec, rows, found)
        part = {key: some for key, v in data.items() if np.any(np.isfinite(some := _part(v, rows)))}
        if signal not in part:
            found.lost += lost(rec, rows, "", f"a run without {signal}")
            continue
        command = command_of(rec)
        own = command[1][rows] if command is not None and np.any(np.isfinite(command[1][rows])) else None
        try:
            got = plateaus.find(t, part, signal, own)
        except InputError as error:
            raise InputError([Fault(name, f.where, f.got, f.expected, f.hint) for f in error.faults]) from error
        found.notes += [f"run {run:g}: {n}" if labels.size > 1 else n for n in got.notes]
        for d in got.dropped:
            found.lost += lost(rec, rows[d.start : d.stop], "", d.reason)
        for p in got.plateaus:
            own_rows = rows[p.start : p.stop]
            middle = 0.5 * (p.t0 + p.t1)
            if np.mean(stops[own_rows]) > 0.5:
                found.lost += lost(rec, own_rows, "", STALLED)
                continue
            if np.mean(rest[own_rows]) > 0.5:
                still, moving = own_rows[rest[own_rows]], own_rows[~rest[own_rows]]
                _rest(rec, still, data, middle, run, found)
                found.lost += lost(rec, moving, "", "stopping or starting")
                continue
            for channel, outliers in p.outliers.items():
                reason = f"outlier: more than {plateaus.OUTLIER:g} robust standard deviations from its neighbours"
                found.lost += lost(rec, rows[list(outliers)], channel, reason)
            u = {key: e for key, e in p.u.items() if e > 1e-12 * abs(p.mean[key]) and key not in _COMMANDS}
            u |= _stated_u(told, own_rows, u)
            values = dict(p.mean)
            if t is not None:
                values["time_s"] = middle
            found.points.append(Point(values, u, own_rows, middle, run, p.direction, p.flags))
    return found


def _spikes(rec: Dataset, data: dict[str, Array], found: Found) -> None:
    """Leave out what the importer flagged as a jump away from all neighbours."""
    by_file: dict[str, list[str]] = {}
    for key in data:
        by_file.setdefault(file_name(rec, key), []).append(key)
    gone: dict[str, list[int]] = {}
    for i in [i for i, flags in enumerate(rec.flags) if flags]:
        for flag in rec.flags[i]:
            for key in by_file.get(flag.removeprefix("spike of "), []) if flag.startswith("spike of ") else []:
                if np.isfinite(data[key][i]):
                    gone.setdefault(key, []).append(i)
    for key, rows in gone.items():
        data[key] = _without(data[key], rows)
        found.lost += lost(rec, rows, key, "spike: jumps away from all its neighbours and back")


def clock_of(rec: Dataset, rows: NDArray[np.intp], found: Found) -> tuple[NDArray[np.intp], Array | None]:
    """Rows with a time, and the times; None: rows count."""
    t = rec.values.get("time_s")
    if t is None or np.mean(np.isfinite(t[rows])) < 0.5:
        return rows, None
    none = rows[~np.isfinite(t[rows])]
    found.lost += lost(rec, none, "", "no time")
    kept = rows[np.isfinite(t[rows])]
    return kept, _part(t, kept)


def _part(values: Array, rows: Rows) -> Array:
    """Values of some rows; no copy for all of them."""
    return values if len(rows) == len(values) else values[rows]


def from_rows(rec: Dataset) -> Found:
    """Each row a point."""
    found = Found()
    rest = at_rest(rec)
    stops = stalled(rec) & ~rest
    found.lost += lost(rec, np.flatnonzero(stops), "", STALLED)
    data = _clean(rec, rest | stops, found)
    _wild(rec, data, rest, found)
    gone = _stuck(rec, data, found, stops)
    copied = _copied(data, len(rec)) & ~rest & ~gone
    found.lost += lost(rec, np.flatnonzero(copied), "", "repeats the row before to the last digit")
    time = rec.values.get("time_s")
    loads = [data[name] for name in LOADS if name in data]
    empty = ~np.any([np.isfinite(v) for v in loads], axis=0) if loads else np.ones(len(rec), dtype=bool)
    found.lost += lost(rec, np.flatnonzero(empty), "", "no load, power or coefficient in this row")
    empty |= copied | gone
    runs, told = runs_of(rec), stated(rec)
    before: dict[float, float] = {}
    at: dict[float, list[int]] = {}
    level_of = data.get("rpm", command_of(rec)[1] if command_of(rec) is not None else None)  # type: ignore[index]
    for i in np.flatnonzero(~empty):
        run = float(runs[i])
        when = float(time[i]) if time is not None and math.isfinite(time[i]) else float(i)
        if rest[i]:
            at.setdefault(run, []).append(int(i))
            continue
        _close(rec, data, time, at, run, found)
        level = float(level_of[i]) if level_of is not None else math.nan
        way = "first" if run not in before else "up" if level >= before[run] else "down"
        before[run] = level if math.isfinite(level) else before.get(run, level)
        values = {name: float(v[i]) for name, v in data.items()}
        if time is not None:
            values["time_s"] = float(time[i])
        u = {name: float(v[i]) for name, v in told.items()}
        found.points.append(Point(values, u, np.array([i]), when, run, way, tuple(rec.flags[i])))
    for run in list(at):
        _close(rec, data, time, at, run, found)
    return found


def _stuck(rec: Dataset, data: dict[str, Array], found: Found, gone: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Leave out loads that stick; the rows of an airspeed that does are none without it: these and `gone`, (N,)."""
    before, gone = gone, gone.copy()
    for name in (k for k in STICKS if k in rec.values):
        rows = np.flatnonzero(stuck(name, rec.values) & ~before)
        whole = name == "airspeed_m_s"
        reason = f"{name} repeats the row before to the last digit while what moves it changes: stuck?"
        found.lost += lost(rec, rows, "" if whole else name, reason)
        if whole:
            gone[rows] = True
        else:
            data[name] = _without(data[name], rows.tolist())
    return gone


def _copied(data: Mapping[str, Array], rows: int) -> NDArray[np.bool_]:
    """Rows that repeat three readings or more, and all else but the command, of the row before, (N,)."""
    moving = {name: v for name, v in data.items() if name not in _COMMANDS and moves(v)}
    out = np.zeros(rows, dtype=bool)
    if len(moving.keys() & set(SIGNALS)) >= 3:  # two rounded readings may well be alike
        out[1:] = np.all([v[1:] == v[:-1] for v in moving.values()], axis=0)
    return out


def _close(
    rec: Dataset, data: Mapping[str, Array], time: Array | None, at: dict[float, list[int]], run: float, found: Found
) -> None:
    """End a stretch at rest."""
    rows = np.array(at.pop(run, []), dtype=np.intp)
    if rows.size:
        times = time[rows] if time is not None else rows.astype(float)
        when = float(np.mean(times)) if np.all(np.isfinite(times)) else float(np.mean(rows))
        _rest(rec, rows, data, when, run, found)


def _wild(rec: Dataset, data: dict[str, Array], rest: NDArray[np.bool_], found: Found) -> None:
    """Leave out readings of a static table that the rest of their row contradicts.

    The misreading is of the one load where the other agrees with the speed, else of the speed.
    """
    speed, v = data.get("rpm"), data.get("airspeed_m_s")
    loads = {k: np.abs(data[k]) for k in ("thrust_N", "torque_Nm") if k in data and moves(data[k])}
    if speed is None or not loads or (v is not None and np.any(np.abs(np.nan_to_num(v)) > 0.5)):
        return
    good = np.isfinite(speed) & (speed > 0.0) & ~rest
    for size in loads.values():
        good &= np.isfinite(size) & (size > 0.05 * float(np.nanquantile(np.append(size, 0.0), 0.9)))
    if np.count_nonzero(good) < 6:
        return
    with np.errstate(all="ignore"):
        times = {name: against_load(speed[good], size[good]) for name, size in loads.items()}
    wild = {name: (r > MISREAD) | (r < 1.0 / MISREAD) for name, r in times.items()}
    every = np.logical_and.reduce(list(wild.values()))
    for name, odd in wild.items():
        for j in np.flatnonzero(odd & ~every):
            i = int(np.flatnonzero(good)[j])
            reason = f"misread: {times[name][j] ** 2:.3g} times what its row and the rest show"
            found.lost += lost(rec, [i], name, reason)
            data[name] = _without(data[name], [i])
    ratio = next(iter(times.values()))
    for j in np.flatnonzero(every):
        i = int(np.flatnonzero(good)[j])
        found.lost += lost(rec, [i], "rpm", f"misread: {1.0 / ratio[j]:.3g} times what the load of its row needs")
        data["rpm"] = _without(data["rpm"], [i])

"""Whether the speed that was logged of each rotor can be that rotor's: the first question to a flight with speeds.

A sensor that misses blades reads k/m of the speed: it counts. It may drop out, too. Nothing else makes a rotor turn at
half the speed of the others at their command while the vehicle flies on: a damaged blade or a weak motor changes speed
over drive by a third at most, and the loads of a body in steady flight balance. So of each rotor the hypotheses are
sound, k/m, and another number, and the evidence is

* the speed over the square root of the command beside that of the rotors which are sound, in the rows where it reads;
* the balance: with the thrusts that the reading implies, or those of the repaired one, roll, pitch and yaw are as far
  from even as in healthy vehicles (:data:`bemt.tools.flight.balance.TRIM`), or as a damaged rotor leaves them;
* the share of rows in which it reads nothing that could be a speed of its mode (zeros, counts that decay).

The repaired speed is the mean of what these leave: the reading times m/k, the command, the balance. Rows without a
reading follow the command.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.tools.flight.balance import ALARM, TRIM, TRIM_FREE, axes_of
from bemt.tools.flight.layout import layout_of
from bemt.tools.flight.log import FlightLog, SpeedSensor

_COUNTS = tuple(Fraction(k, m) for k, m in ((1, 2), (1, 3), (2, 3), (1, 4), (3, 2), (2, 1), (3, 1)))
"""Blades seen over blades that pass: of two, three and four, and doubled edges."""
_SURE = 0.95  # probability from which a sensor is at fault [1]
_SHARE = 0.1  # flights whose sensor of one given motor is at fault, beforehand: an assumption [1]
_OTHER = 0.02  # of these, readings that are no such fraction: a counter counts [1]
_SICK, _SICK_SHARE = 0.35, 0.1  # range of log speed over drive that a fault of blade or motor reaches, and its share
_STOPPED = 1e-3  # rotors that stand in flight, of those that read so: six rotors can fly on five [1]
_LEVEL, _ALONE, _COUNT, _EXPONENT = 0.013, 0.03, 0.015, 0.2
"""Standard deviation of log speed over the root of the command between the motors of a sound vehicle (four motors of
two Crazyflies 2.1: brushed 1.3 %, brushless 0.4 %); of the speed alone (half the trim of the thrusts, 6 %); of a count
(an assumption); of the exponent, 1/2 (an assumption, as in :mod:`bemt.tools.flight.speed_sensor`) [1]."""
_MODE = 0.28  # log distance from its mode up to which a row reads: half the way to the next count
_DROPS = 0.01  # share of lost rows from which a sensor drops out [1]
_RANGE = float(np.log(30.0))  # of log readings that are no fraction
_GRID = np.linspace(-0.4, 0.4, 201)  # log level of a repaired speed beside the others
_LOSSES = np.linspace(0.05, 0.7, 8)  # log losses of the thrust constant of a damaged rotor


def checked(log: FlightLog) -> FlightLog:
    """The log with every speed that cannot be its rotor's repaired, and said in `sensors`.

    A log without speeds, without a flight or with fewer than three rotors is returned as it is.
    """
    on = log.flying
    if log.rpm is None or log.sensors or log.rotors < 3 or log.rpm.shape[1] < 3 or on.sum() < 50:
        return log
    B = log.rpm.shape[1]
    root = np.ones((int(on.sum()), B))
    command = log.command if log.command is not None and log.command.shape[1] == B else None
    if command is not None and np.all(command[on].mean(axis=0) > 0.0):
        root = np.sqrt(np.maximum(command[on], 1e-3 * float(command[on].mean())))
    else:
        command = None
    reading = log.rpm[on] / root
    drive = np.log(root.mean(axis=0) ** 2)
    u = np.hypot(_LEVEL if command is not None else _ALONE, _EXPONENT * (drive - drive.mean()))
    placed = layout_of(log.layout, B) if log.layout else None
    best = max((_reading(reading, root, u, placed, r) for r in range(B)), key=lambda one: one.likelihood)
    if not best.faults:
        return log
    return _repaired(log, on, reading, root, best)


@dataclass(frozen=True, eq=False)
class _Reading:
    """What one reference rotor makes of the others."""

    likelihood: float
    # Rotors at fault: its fraction (None: no fraction), level of the repaired speed, its standard uncertainty
    faults: dict[int, tuple[Fraction | None, float, float]]
    lost: NDArray[np.bool_]  # (N, B) Rows that read nothing
    middle: Array  # (N,) Speed over the root of the command of the sound rotors


def _reading(reading: Array, root: Array, u: Array, placed: Array | None, reference: int) -> _Reading:
    """Hypotheses of all rotors when one of them is sound."""
    B = reading.shape[1]
    level = np.array([_mode(reading[:, i], reading[:, reference]) for i in range(B)])
    faults: dict[int, tuple[Fraction | None, float, float]] = {}
    total, thrust = 0.0, np.mean(root**2, axis=0)
    axes = axes_of(placed, B)
    trim = np.array(TRIM) if placed is not None and len(axes) == 3 else np.full(len(axes), max(TRIM))
    for i in (k for k in range(B) if k != reference):
        x = float(level[i])
        # Log density of roll, pitch and yaw over the level of this rotor; a level out of reach is no number.
        shares = np.where(np.isfinite(level), np.exp(2.0 * np.clip(level, -9.0, 3.0)), 1.0) * thrust
        grid = np.append(_GRID, max(x, -9.0))
        every = np.broadcast_to(shares, (grid.size, B)).copy()
        every[:, i] = np.exp(2.0 * grid) * thrust[i]
        balance = _balance(every, axes / trim[:, None])
        like_others = balance[:-1] + _log_normal(_GRID, u[i])
        sick = _SICK_SHARE / (2.0 * _SICK) if abs(x) < _SICK else _STOPPED * (x < -1.0)
        sound = (1.0 - _SHARE) * ((1.0 - _SICK_SHARE) * float(np.exp(_log_normal(x, u[i]))) + sick)
        logs: dict[Fraction | None, float] = {Fraction(1): float(np.log(max(sound, 1e-300)) + balance[-1])}
        over: dict[Fraction | None, Array] = {None: like_others + np.log(_SHARE * _OTHER / _RANGE)}
        for f in _COUNTS if np.isfinite(x) else ():
            # Blades are missed more often than edges are doubled.
            share = _SHARE * (1.0 - _OTHER) * (0.8 / 4 if f < 1 else 0.2 / 3)
            over[f] = like_others + _log_normal(x - float(np.log(float(f))) - _GRID, _COUNT) + np.log(share)
        for count, v in over.items():
            logs[count] = float(v.max() + np.log(np.sum(np.exp(v - v.max())) * (_GRID[1] - _GRID[0])))
        top = max(logs.values())
        evidence = top + float(np.log(sum(np.exp(v - top) for v in logs.values())))
        if np.exp(logs[Fraction(1)] - evidence) < 1.0 - _SURE:
            best = max(over, key=lambda f: logs[f])
            # The level is the mean over all ways to be at fault.
            weight = np.sum([np.exp(v - logs[best]) for v in over.values()], axis=0)
            mean = float(weight @ _GRID / weight.sum())
            faults[i] = best, mean, float(np.sqrt(weight @ (_GRID - mean) ** 2 / weight.sum()))
            level[i] = mean
        total += evidence
    sound_ones = [i for i in range(B) if i not in faults]
    lost = np.zeros(reading.shape, dtype=bool)
    middle = np.median(reading[:, sound_ones], axis=1)
    for i in range(B):
        zeros = reading[:, i] <= 0.0
        if i in faults:
            mode = _mode(reading[:, i], middle)
            with np.errstate(divide="ignore", invalid="ignore"):
                away = np.log(np.maximum(reading[:, i], 0.0) / middle)
            lost[:, i] = ~(np.abs(away - mode) < _MODE) if np.isfinite(mode) else True
        elif zeros.mean() > _DROPS and not (zeros[-1] and np.count_nonzero(np.diff(zeros)) < 2):
            # A sound rotor that is flown hard leaves its mode, too; it does not read nothing. One that reads nothing
            # to the end stands.
            faults[i], lost[:, i] = (Fraction(1), _mode(reading[:, i], middle), float(u[i])), zeros
    return _Reading(total, faults, lost, middle)


def _balance(thrust: Array, rows: Array) -> Array:
    """Log density (G,) of roll, pitch and yaw for thrusts (G, B), rows (k, B) of unit scatter.

    One rotor may be damaged: then its thrust is less than its speed says.
    """
    B = thrust.shape[1]
    gone = 1.0 - np.exp(-_LOSSES[:, None])
    lost = np.concatenate([np.ones((1, B)), *(1.0 - np.eye(B)[[j]] * gone for j in range(B))])
    weight = np.log([1.0 - _SICK_SHARE, *np.full(len(lost) - 1, _SICK_SHARE / (len(lost) - 1))])
    every = thrust[:, None, :] * lost
    y = (every / every.mean(axis=2, keepdims=True) - 1.0) @ rows.T
    density = weight - 0.5 * (TRIM_FREE + len(rows)) * np.log1p(np.sum(y**2, axis=2) / TRIM_FREE)
    top = density.max(axis=1)
    return np.asarray(top + np.log(np.exp(density - top[:, None]).sum(axis=1)), dtype=float)


def _log_normal(x: Array | float, sd: float) -> Any:
    return -0.5 * (np.asarray(x) / sd) ** 2 - np.log(np.sqrt(2.0 * np.pi) * sd)


def _mode(mine: Array, other: Array) -> float:
    """Log of the ratio that most of the rows read; -inf where none reads."""
    good = (mine > 0.0) & (other > 0.0)
    if good.sum() < 20:
        return -np.inf
    x = np.log(mine[good] / other[good])
    edges = np.arange(x.min() - 0.05, x.max() + 0.15, 0.05)
    counts = np.convolve(np.histogram(x, edges)[0], [1, 1, 1], "same")
    peak = edges[int(np.argmax(counts))] + 0.025
    return float(np.median(x[np.abs(x - peak) < 0.1]))


def _repaired(log: FlightLog, on: NDArray[np.bool_], reading: Array, root: Array, best: _Reading) -> FlightLog:
    """The log with the speeds that the evidence leaves."""
    assert log.rpm is not None
    rpm, out = log.rpm.copy(), []
    for i, (f, level, u) in best.faults.items():
        x, lost = _mode(reading[:, i], best.middle), best.lost[:, i]
        reads = f is not None and np.isfinite(x)
        factor = float(np.exp(level - x)) if reads else 0.0
        follows = np.exp(level) * best.middle * root[:, i]
        rpm[:, i] *= factor
        rpm[on, i] = np.where(lost, follows, rpm[on, i]) if reads else follows
        ratio = float(np.exp(x - level)) if np.isfinite(x) else 0.0
        out.append(SpeedSensor(i + 1, "" if f is None or f == 1 else str(f), ratio, float(lost.mean()),
                               float(np.mean(reading[:, i] <= 0.0)), u))  # fmt: skip
    return replace(log, rpm=rpm, sensors=tuple(out))


# Speed of each motor at its drive, against healthy flights: what the balance of the body cannot tell apart.
#
# A blade that lost area loads its motor less, so the motor turns faster at the same command; a worn motor, bearing or
# controller turns slower. A weight changes neither. The reading is log(rpm) - 1/2 log(command) of each motor less the
# mean of all (the battery's voltage drops out); the exponent is that of thrust in proportion to the command and is
# good to 0.2, which counts with the change of the command.
_SCATTER, _FREE, _BY_COMMAND, _U_EXPONENT = 0.011, 4, 0.5, 0.2
"""Standard deviation between healthy flights (six flights of two Crazyflies 2.1: brushed 1.3 %, brushless 0.24 %), the
degrees of freedom it counts as, and the exponent with its uncertainty (an assumption)."""


def speed_changes(log: FlightLog, healthy: Sequence[FlightLog]) -> tuple[tuple[int, float], ...]:
    """Motors (0 is the first) that turn faster or slower at their drive than in healthy flights, by what share [1].

    Empty without speeds and commands in all logs. A speed that was repaired accuses no motor.
    """
    from scipy import stats

    mine = _speed_for_command(log)
    calm = [r for h in healthy if (r := _speed_for_command(h)) is not None]
    if mine is None or not calm:
        return ()
    past, commands = np.array([c for c, _ in calm]), np.array([c for _, c in calm])
    n, B = past.shape
    free = _FREE + (n - 1) * (B - 1)
    square = (_FREE * _SCATTER**2 + float(np.sum((past - past.mean(axis=0)) ** 2))) / free * (1.0 + 1.0 / n)
    change, moved = mine[0] - past.mean(axis=0), mine[1] - commands.mean(axis=0)
    bar = float(stats.t.ppf(1.0 - ALARM / (2 * B), free))
    sd = np.sqrt(square + (_U_EXPONENT * moved) ** 2)
    repaired = {s.motor - 1 for one in (log, *healthy) for s in one.sensors}
    return tuple((k, float(change[k])) for k in range(B) if abs(change[k]) > bar * sd[k] and k not in repaired)


def _speed_for_command(log: FlightLog) -> tuple[Array, Array] | None:
    on = log.flying
    if log.rpm is None or log.command is None or on.sum() < 50:
        return None
    rpm, command = log.rpm[on].mean(axis=0), log.command[on].mean(axis=0)
    if rpm.shape != command.shape or not (np.all(rpm > 0.0) and np.all(command > 0.0)):
        return None
    x = np.log(rpm) - _BY_COMMAND * np.log(command)
    c = np.log(command)
    return x - x.mean(), c - c.mean()

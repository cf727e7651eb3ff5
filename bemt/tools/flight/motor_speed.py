"""Speed of each motor at its drive, against healthy flights: what the balance of the body cannot tell apart.

A blade that lost area loads its motor less, so the motor turns faster at the same command; a worn motor, bearing or
controller turns slower. A weight changes neither. The reading is log(rpm) - 1/2 log(command) of each motor less the
mean of all (the battery's voltage drops out); the exponent is that of thrust in proportion to the command and is good
to 0.2, which counts with the change of the command.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.flight.balance import ALARM
from bemt.tools.flight.log import FlightLog

_SCATTER, _FREE, _EXPONENT, _U_EXPONENT = 0.011, 4, 0.5, 0.2
"""Standard deviation between healthy flights (six flights of two Crazyflies 2.1: brushed 1.3 %, brushless 0.24 %), the
degrees of freedom it counts as, and the exponent with its uncertainty (an assumption)."""


def speed_changes(log: FlightLog, healthy: Sequence[FlightLog]) -> tuple[tuple[int, float], ...]:
    """Motors (0 is the first) that turn faster or slower at their drive than in healthy flights, by what share [1].

    Empty without speeds and commands in all logs. A speed that was repaired accuses no motor.
    """
    from scipy import stats

    mine = _reading(log)
    calm = [r for h in healthy if (r := _reading(h)) is not None]
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


def _reading(log: FlightLog) -> tuple[Array, Array] | None:
    on = log.flying
    if log.rpm is None or log.command is None or on.sum() < 50:
        return None
    rpm, command = log.rpm[on].mean(axis=0), log.command[on].mean(axis=0)
    if rpm.shape != command.shape or not (np.all(rpm > 0.0) and np.all(command > 0.0)):
        return None
    x = np.log(rpm) - _EXPONENT * np.log(command)
    c = np.log(command)
    return x - x.mean(), c - c.mean()

"""The signature of a rigid body: a body that flies steadily balances its loads, and the drives show how.

A rotor that lost thrust at equal drive is driven harder until the loads balance again; of all commands that the mixer
can give these are P e_k, P = A+ A, A the matrix of the layout (for a quadrotor e_k itself: one rotor, and so roll,
pitch, yaw and total at once). A weight under an arm needs roll, pitch and total but no yaw:
A+ diag(1, 1, 0, 1) A e_k.

Readings: roll, pitch and yaw parts of the logs of the motors' mean drives. A flight x and the healthy ones x_i share
the trim m of their vehicle: x_i ~ N(m, s^2), m ~ N(0, w^2). s^2 of a reading is the healthy flights' own, pooled with
that of all readings and of other vehicles (scaled inverse chi-squared; Gelman et al., Bayesian Data Analysis, 3rd ed.,
section 2.6); w hardly matters once there is a healthy flight. How much the readings share was chosen by the log score
of left-out healthy flights of three vehicles (docs/flight_logs.md).

Flight to flight: six flights of two Crazyflies 2.1, brushed (4) and brushless (2), IMRCLab/crazyflie-data-collection
@ 4d777a5a: standard deviations of roll, pitch, yaw 0.30, 1.27, 0.63 % and 0.05, 0.57, 0.12 %, pooled 0.75 %. One
vehicle differs from the other by a factor of 2.5, so the pooled value weighs as four degrees of freedom, not twelve.
CrazyPAD E8 (1.89, 0.97, 1.12 %) is left out: it is what the judge is tried on.

Day to day (battery out and in, propellers exchanged): a session moves the trim by u ~ N(0, t^2), the same in all its
flights, so x_i = m + u_session + e_i. Pairs of sessions of CrazyPAD and of the two Crazyflies differ by 1.2 to 3.1 % a
reading: t is 1.2 % in roll and pitch, as far as vehicles differ, and 2.2 % in yaw, which a tilted motor moves most.
It counts as four degrees of freedom and is pooled with what the sessions show where there are two or more.

Vehicle to vehicle: means of those two, of CrazyPAD E8 (Data 9:79, 2024) and of the quadrotor of Neural-Fly
(aerorobotics/neural-fly @ 0ed50246) in still air: roll 0.8, 0.1, 2.3, 0.7 %, pitch -1.5, -1.0, 0.2, -1.3 %,
yaw 2.9, 0.2, 11.2, 3.5 %.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.flight.layout import effect_matrix
from bemt.tools.flight.log import FlightLog

ALARM = 0.01
"""Probability that a flag beside the balance (a speed, a shake, a change in flight) is raised where nothing is wrong
[1]."""

LARGEST = 0.5
"""Change of a rotor's drive up to which sizes are alike beforehand: beyond, a motor has no more [1]."""
SCATTER, SCATTER_FREE = 0.0075, 4
"""Standard deviation of a reading between flights of one vehicle [1], and the degrees of freedom it counts as."""
TRIM = (0.012, 0.012, 0.060)
"""Root mean square of roll, pitch and yaw over healthy vehicles [1]."""
TRIM_FREE = 4
"""Vehicles behind it."""
SESSION, SESSION_FREE = (0.012, 0.012, 0.022), 4
"""Standard deviation of roll, pitch and yaw between sessions of one vehicle [1], and its degrees of freedom."""
TOTAL, TOTAL_FREE, LOADED = 0.015, 4, 0.1
"""Standard deviation of the total drive between flights of one vehicle: CrazyPAD E9 0.4 % within a day and 1.5 % from
day to day, E8 2.0 %; Crazyflies at equal voltage 0.3 to 0.8 %; the degrees of freedom that it counts as; and where
mass, battery or air are others than in the healthy flights (declared) [1]."""
BLADE, WEIGHT, WIND = "damaged blade, motor ", "weight ", "wind or forward flight"
WEAK, IMBALANCE = "weak motor, bearing or controller, motor ", "imbalance or tape, "
DAY = "another day than the healthy flights"
BUILD, WIDE = "an uneven build of this vehicle", "flights of this vehicle differ more than usual"
_COMMON = 6  # flights as which the common scatter weighs against that of a reading (docs/flight_logs.md)


def blade(motor: int) -> str:
    """Cause by the number of the motor, from one."""
    return f"{BLADE}{motor}"


def features(log: FlightLog) -> Array | None:
    """Log of the mean command of each rotor in flight, or of its squared speed, (B,) [1]; None without a flight."""
    on = log.flying
    if on.sum() < 50:
        return None
    if log.drive is None:
        return None
    mean = log.drive[on].mean(axis=0)
    return np.log(mean) if np.all(mean > 0.0) else None


def battery_volts(log: FlightLog) -> float | None:
    """Mean voltage of the battery in flight [V]; None where none was measured beside commands: one that never moves."""
    v = np.zeros(0) if log.voltage is None or log.command is None else log.voltage[log.flying]
    return float(v.mean()) if v.size and np.ptp(v) > 1e-9 and v.mean() > 0.0 else None


def at_equal_voltage(flights: Sequence[FlightLog], x: Sequence[Array]) -> list[Array]:
    """Features x, (B,) each, of flights of one vehicle, as at the battery voltage of the first; healthy but for that.

    A command that is the share of the battery's voltage at a motor grows as that sags; one that the autopilot scales by
    it does not. Which it is, the log's `duty` and the totals of the healthy flights say, whose scatter is pooled with
    :data:`TOTAL`. Unchanged where a voltage is missing.
    """
    read = [battery_volts(f) for f in flights]
    if len(x) < 2 or any(v is None for v in read):
        return list(x)
    volts = np.array(read, dtype=float)
    lower = np.log(volts / volts[0])
    totals = np.array([v.mean() for v in x[1:]])
    by = [(len(totals) - 1) * float(np.var(totals + share * lower[1:])) for share in (0.0, 1.0)]
    free, prior = len(totals) - 1 + TOTAL_FREE, flights[0].duty
    scaled, share = (1.0 + np.array(by) / (TOTAL_FREE * TOTAL**2)) ** (-0.5 * free) * [1.0 - prior, prior]
    return [v + u * float(share / (scaled + share)) for v, u in zip(x, lower, strict=True)]


def axes_of(layout: Array | None, rotors: int) -> Array:
    """Rows (k, B) that take roll, pitch and yaw from the logs of the drives; without a layout any without the total.

    They are orthogonal to the total; the root mean square of a row is 1/B [1].
    """
    inner = np.eye(rotors) - 1.0 / rotors
    if layout is None:
        free: Array = np.linalg.svd(inner)[2][: rotors - 1] / np.sqrt(rotors)
        return free
    rows = effect_matrix(layout)[:3] @ inner
    q, r = np.linalg.qr(rows.T)
    found: Array = (q * np.sign(np.diag(r))).T[np.abs(np.diag(r)) > 1e-9] / np.sqrt(rotors)
    return found


def directions(B: int, layout: Array | None) -> dict[str, Array]:
    """Change of the logs of the drives by each cause, (B,), for unit change of that rotor's drive."""
    out = {blade(k + 1): np.eye(B)[k] for k in range(B)}
    if layout is not None:
        A = effect_matrix(layout)
        back = np.linalg.pinv(A)
        out = {name: back @ A @ d for name, d in out.items()}
        places: dict[tuple[float, ...], list[int]] = {}
        for k in range(B):
            places.setdefault(tuple(np.round(A[:2, k], 6)), []).append(k + 1)
        level = back @ np.diag([1.0, 1.0, 0.0, 1.0])
        for motors in places.values():
            where = f"motor {motors[0]}" if len(motors) == 1 else f"motors {' and '.join(map(str, motors))}"
            out[f"{WEIGHT}near {where}"] = level @ A[:, motors[0] - 1]
        for i, j in _neighbours([motors[0] - 1 for motors in places.values()], layout[:, 0]):
            a, b = sorted((i + 1, j + 1))
            out[f"{WEIGHT}between motors {a} and {b}"] = level @ (A[:, i] + A[:, j]) / 2.0
    return out


def _neighbours(motors: list[int], angle: Array) -> list[tuple[int, int]]:
    """Motors side by side with more than 50 degrees between them."""
    order = sorted(motors, key=lambda k: float(angle[k]) % (2.0 * np.pi))
    pairs = list(zip(order, [*order[1:], order[0]], strict=True))
    return [(i, j) for i, j in pairs if np.radians(50.0) < (angle[j] - angle[i]) % (2.0 * np.pi) < np.radians(170.0)]


@dataclass(frozen=True, eq=False)
class HealthyFlight:
    """The readings of a healthy flight as the others predict them."""

    # (k,) Of the readings [1]
    mean: Array
    sd: Array
    free: float  # Degrees of freedom behind sd
    # (k,) The same of a flight of another day [1]
    other_mean: Array
    other_sd: Array
    other_free: float


def healthy_flight(
    calm: Array, axes: Array, known: bool, days: Sequence[int] = (), day: int | None = 0, usual: float = SCATTER
) -> HealthyFlight:
    """Predict the next healthy flight from the features (n, B) of none, one or more.

    `known`: whether the layout is known, so that the readings on the axes of :func:`axes_of` are roll, pitch and yaw.
    `days` numbers the session of each flight (all one where it is empty), `day` is that of the next flight; None: one
    of none of them. `usual` is the standard deviation of a reading that other vehicles have [1].
    """
    n, k = len(calm), len(axes)
    x, label = calm @ axes.T, np.array(days if len(days) == n else [0] * n, dtype=int)
    groups = [x[label == g] for g in np.unique(label)]
    G = len(groups)
    own = sum((np.sum((g - g.mean(axis=0)) ** 2, axis=0) for g in groups), np.zeros(k))
    within = n - G if n else 0
    common = (float(own.sum()) + SCATTER_FREE * usual**2) / (k * within + SCATTER_FREE)
    free = within + _COMMON
    s2 = (own + _COMMON * common) / free
    trim, session = (np.array(v)[:k] if known and k == 3 else np.full(k, max(v)) for v in (TRIM, SESSION))
    means, sizes = np.array([g.mean(axis=0) for g in groups]).reshape(G, k), np.array([len(g) for g in groups])
    # Between sessions: one factor on all readings, pooled; what the flights of a session scatter is no part of it.
    moved = np.sum((means - means.mean(axis=0)) ** 2, axis=0) / session**2 if G > 1 else np.zeros(k)
    noise = (G - 1) * s2 * np.mean(1.0 / sizes) / session**2 if G > 1 else np.zeros(k)
    between = SESSION_FREE + k * max(G - 1, 0)
    factor = (SESSION_FREE + float(np.maximum(moved - noise, 0.0).sum())) / between

    def predicted(s: Array, w: Array, t: Array, here: int | None) -> tuple[Array, Array]:
        """Mean and variance of the next flight, (..., k), from variances within, of vehicles, and between sessions."""
        parts = [1.0 / (t + s / size) for size in sizes]
        of_mean = 1.0 / (sum(parts, 1.0 / w))
        mean = of_mean * sum((p * m for p, m in zip(parts, means, strict=True)), np.zeros(k))
        if here is None:
            return mean, of_mean + t + s
        keep = t / (t + s / sizes[here])
        return mean + keep * (means[here] - mean), s + t * (1.0 - keep) + (1.0 - keep) ** 2 * of_mean

    numbers = list(np.unique(label))
    here = numbers.index(day) if n and day in numbers else None
    # Without any healthy flight nobody asks for days: the trim of vehicles holds them.
    t2 = factor * session**2 if n else np.zeros(k)
    mean, var = predicted(s2, trim**2, t2, here)
    other_mean, other = predicted(s2, trim**2, t2, None)
    least = min(free, between)
    return HealthyFlight(mean, np.sqrt(var), (free if here is not None else least) if n else TRIM_FREE, other_mean,
                         np.sqrt(other), least if n else TRIM_FREE)  # fmt: skip


def differ(calm: Array, axes: Array, known: bool, common: float = SCATTER, days: bool = False) -> float:
    """Log density of how healthy flights (n, B) of one session differ, but for a constant of n [1].

    `common` is the standard deviation of a reading that is usual [1]; `days`: each is of a session of its own.
    """
    n, k = len(calm), len(axes)
    if n < 2:
        return 0.0
    x = calm @ axes.T
    t = np.array(SESSION)[:k] if known and k == 3 else np.full(k, max(SESSION))
    square = common**2 + (t**2 if days else np.zeros(k))
    misfit = float(np.sum((x - x.mean(axis=0)) ** 2 / square))
    free = SCATTER_FREE + k * (n - 1)
    return -0.5 * float((n - 1) * np.log(square).sum() + free * np.log1p(misfit / SCATTER_FREE))

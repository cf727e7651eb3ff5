"""Is a table a record of samples, or a list of steady points? And which rows are the stand at rest?

The rule, in this order:

1. rows with their own uncertainty (``u_...`` columns, stated errors) are points: somebody has averaged already;
2. fewer than twelve rows are points;
3. rows that differ from their neighbours by more than 2 % of the range in every load and speed, where no command is
   held, are points in any order (of fewer than 400 rows; a log has more);
4. with time: a median step of 0.2 s or less makes samples; up to 2 s still, when the command is held for five rows or
   more in most rows, or up to 0.5 s when there is no command; anything slower makes points, and so does a command that
   changes from row to row (a slow ramp: quasi-steady);
5. without time: a command that is held like that makes samples, else points;
6. more than 50,000 rows are samples in any case: nobody has so many steady points.

Rest is where nothing turns: the speed reads 0, or no sensor tells and the command is 0 %, and no more current flows
than 0.5 % of the largest (1000 us and 0 % are rest by themselves). A speed of 0 while current flows is a sensor that
failed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bemt.dataset import Dataset
from bemt.recordings.channels import stated

Array = NDArray[np.float64]
FEWEST = 12
MOST_POINTS, UNLIKE = 400, 0.02
LOG = 50_000
FAST_S, MIDDLE_S, SLOW_S = 0.2, 0.5, 2.0
HELD = 5
IDLE_S = 1.0005e-3


def command_of(rec: Dataset) -> tuple[str, Array] | None:
    """Find the command."""
    for name in ("pwm_s", "throttle"):
        v = rec.values.get(name)
        if v is not None and np.any(np.isfinite(v)):
            return name, v
    return None


def _held(command: Array) -> bool:
    """Whether most rows belong to stretches of five or more with one command."""
    edges = np.flatnonzero(np.diff(command) != 0.0) + 1
    lengths = np.diff(np.concatenate([[0], edges, [len(command)]]))
    return bool(lengths[lengths >= HELD].sum() > 0.5 * len(command))


def _unlike(rec: Dataset) -> bool:
    """Whether neighbouring rows differ in everything that was measured."""
    steps = []
    for name in ("rpm", "thrust_N", "torque_Nm", "power_W", "current_A"):
        v = rec.values.get(name)
        v = v[np.isfinite(v)] if v is not None else np.empty(0)
        span = float(np.ptp(np.percentile(v, [5.0, 95.0]))) if v.size >= FEWEST else 0.0
        if span > 0.0:
            steps.append(float(np.median(np.abs(np.diff(v)))) / span)
    return bool(steps) and min(steps) > UNLIKE


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
        step = float(np.median(np.abs(np.diff(t))))
        words = f"the median time step is {step:.3g} s"
        if step <= (FAST_S if found is not None else MIDDLE_S):
            return True, f"rows are samples: {words}"
        if step <= SLOW_S and held:
            return True, f"rows are samples: {words} and the command is held"
        if len(rec) > LOG:
            return True, f"rows are samples: more than {LOG}"
        more = "" if found is None else ", and the command changes" if not held else ""
        return False, f"rows are points: {words}{more}" + (" (a slow ramp: quasi-steady)" if step <= MIDDLE_S else "")
    if held:
        return True, "rows are samples: no time, but the command is held over many rows"
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

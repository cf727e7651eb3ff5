"""What of a round trip the stand itself scatters: thrust over speed squared, which ESC and battery do not move."""

from __future__ import annotations

from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.dataset import Dataset

LEAST_THRUST = 0.05
"""Share of the greatest thrust below which a level does not speak for T/rpm^2: there it is mostly zero point."""


def speed_known(points: Dataset) -> Array:
    """Errors of the same held-out levels if their speed were known: what is left is not the map's, (M,) [1].

    A propeller at rest has thrust = k rpm^2, with k almost constant (Reynolds number). Each level's k is read between
    the nearest levels below and above in speed; its thrust then misses by this much. It holds the scatter of the
    readings of thrust and speed, whatever ESC and battery do.
    """
    thrust, rpm = points.thrust_N, points.rpm
    usable = np.isfinite(thrust) & np.isfinite(rpm) & (rpm > 0.0)
    if not np.any(usable):
        return np.empty(0)
    full = float(np.max(thrust[usable]))
    usable &= thrust > LEAST_THRUST * full
    errors = []
    for run in np.unique(points.run[usable]):
        own = np.flatnonzero(usable & (points.run == run))
        own = own[np.argsort(rpm[own])]
        n = rpm[own]
        k = thrust[own] / n**2
        for i in range(1, own.size - 1):
            # a level of the very same speed is a repeat: it counts as a neighbour on both sides
            share = (n[i] - n[i - 1]) / (n[i + 1] - n[i - 1]) if n[i + 1] > n[i - 1] else 0.5
            between = (1.0 - share) * k[i - 1] + share * k[i + 1]
            errors.append((between * n[i] ** 2 - thrust[own[i]]) / full)
    return np.array(errors)


def document(points: Dataset) -> dict[str, Any]:
    """Summary of `speed_known`. [1]"""
    e = speed_known(points)
    worst, rms = (float(np.max(np.abs(e))), float(np.sqrt(np.mean(e**2)))) if e.size else (None, None)
    return {"points": int(e.size), "worst_of_full_thrust": worst, "rms_of_full_thrust": rms}

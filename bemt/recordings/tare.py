"""What a stand shows without load, subtracted: from rows at rest, linear in time.

The uncertainty of what is subtracted is shared by all points of a run, so it goes to the correlated part ``zero``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TARED = ("thrust_N", "duct_thrust_N", "torque_Nm")
"""Channels of load cells."""


@dataclass(frozen=True)
class Rest:
    """Means at rest: `when` (time or row), mean and standard error by channel."""

    when: float
    mean: Mapping[str, float]
    u: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class TareZero:
    """What to subtract: (N,) by channel; its uncertainty, shared by the points; drift over the rests; notes."""

    value: Mapping[str, Array]
    u: Mapping[str, float]
    drift: Mapping[str, float]
    notes: tuple[str, ...]


def from_rest(when: Array, rests: Sequence[Rest], full_scale: Mapping[str, float]) -> TareZero:
    """Zero of every point from the stretches at rest, linear in time between them and held outside.

    >>> rests = [Rest(0.0, {"thrust_N": 0.1}, {}), Rest(10.0, {"thrust_N": 0.3}, {})]
    >>> zero = from_rest(np.array([5.0, 20.0]), rests, {"thrust_N": 10.0})
    >>> zero.value["thrust_N"].round(3).tolist(), round(zero.drift["thrust_N"], 3)
    ([0.2, 0.3], 0.2)
    """
    value: dict[str, Array] = {}
    u: dict[str, float] = {}
    drift: dict[str, float] = {}
    notes = []
    order = sorted(rests, key=lambda r: r.when)
    for name in TARED:
        known = [r for r in order if math.isfinite(r.mean.get(name, math.nan))]
        if not known:
            continue
        times, means = [r.when for r in known], [r.mean[name] for r in known]
        value[name] = np.interp(when, times, means)
        errors = [r.u.get(name, math.nan) for r in known]
        good = [e for e in errors if math.isfinite(e)]
        u[name] = math.sqrt(sum(e * e for e in good) / len(good)) if good else 0.0
        top = full_scale.get(name, math.nan)
        unit = name.rsplit("_", 1)[1]
        share = f" ({abs(means[-1]) / top:.2%} of the largest)" if top > 0.0 else ""
        if len(known) > 1:
            drift[name] = means[-1] - means[0]
            u[name] = math.hypot(u[name], (max(means) - min(means)) / math.sqrt(12.0))
            part = f", {drift[name] / top:+.2%} of the largest" if top > 0.0 else ""
            notes.append(
                f"{name}: zero {means[0]:.4g} {unit} at first and {means[-1]:.4g} {unit} at last rest "
                f"({len(known)} stretches): drift {drift[name]:+.3g} {unit}{part}; subtracted, linear in time"
            )
        else:
            notes.append(f"{name}: zero {means[0]:.4g} {unit} at rest{share} subtracted; drift unknown (one rest only)")
    return TareZero(value, u, drift, tuple(notes))

"""Zero of the load cells, from the stretches at rest: what is subtracted from a recording, and what it is worth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.data.recordings.channels import runs_of
from bemt.data.recordings.points import TARED, Found, Rest, clock_of, from_rows, from_samples, is_samples
from bemt.physics.dataset import Dataset


@dataclass(frozen=True, eq=False)
class TareZero:
    """What to subtract: (N,) by channel; its uncertainty, shared by the points; notes, with its drift."""

    value: Mapping[str, Array]
    u: Mapping[str, float]
    notes: tuple[str, ...]


def from_rest(when: Array, rests: Sequence[Rest], full_scale: Mapping[str, float]) -> TareZero:
    """Zero of every point from the stretches at rest, linear in time between them and held outside.

    >>> rests = [Rest(0.0, {"thrust_N": 0.1}, {}), Rest(10.0, {"thrust_N": 0.3}, {})]
    >>> zero = from_rest(np.array([5.0, 20.0]), rests, {"thrust_N": 10.0})
    >>> zero.value["thrust_N"].round(3).tolist()
    [0.2, 0.3]
    """
    value: dict[str, Array] = {}
    u: dict[str, float] = {}
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
            drift = means[-1] - means[0]
            u[name] = math.hypot(u[name], (max(means) - min(means)) / math.sqrt(12.0))
            part = f", {drift / top:+.2%} of the largest" if top > 0.0 else ""
            notes.append(
                f"{name}: zero {means[0]:.4g} {unit} at first and {means[-1]:.4g} {unit} at last rest "
                f"({len(known)} stretches): drift {drift:+.3g} {unit}{part}; subtracted, linear in time"
            )
        else:
            notes.append(f"{name}: zero {means[0]:.4g} {unit} at rest{share} subtracted; drift unknown (one rest only)")
    return TareZero(value, u, tuple(notes))


def tared(rec: Dataset, name: str) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Load cells of a recording row by row, (N,), less their zero at rest as `reduce` takes it; what was subtracted.

    `rec` has the usual names; a run without a motor stop keeps its readings.
    """
    samples, _ = is_samples(rec)
    found = from_samples(rec, name) if samples else from_rows(rec)
    values = {key: rec.values[key].copy() for key in TARED if key in rec.values}
    top = {key: float(np.nanmax(np.abs(v), initial=0.0)) for key, v in values.items()}
    runs, notes = runs_of(rec), list[str]()
    for run, rests in found.rests.items():
        rows = np.flatnonzero(runs == run)
        timed, t = clock_of(rec, rows, Found())
        if t is not None:
            when = np.interp(rows, timed, t)
        else:
            when = np.arange(rows.size, dtype=float) if samples else rows.astype(float)
        zero = from_rest(when, rests, top)
        for key, v in zero.value.items():
            if key in values:
                values[key][rows] -= v
        notes += [n for n in zero.notes if n.split(":")[0] in values]
    return values, tuple(notes)

"""Noise of a channel from its repeats: sqrt((a y)^2 + (b FS)^2) by restricted maximum likelihood.

Points of one recording at one condition differ by noise, by what their runs differ by (gain, zero) and by drift.  These
and the mean of each condition are projected out; the likelihood of what is left gives a and b (restricted maximum
likelihood: Patterson and Thompson 1971, Biometrika 58:545, eq. 6).  Nothing is said with fewer than ten repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import Restricted

FEWEST = 10
"""Repeats, less what is projected out, from which on they give the noise [1]."""
# Same condition: largest difference of ln rpm, J, ln density and ln distances.  Loads are compared with the model at
# their own speeds, so that what changes within a condition is only how far the model is off.
_NEAR_SPEED, _NEAR_J, _NEAR_AIR, _NEAR_LENGTH = 0.04, 0.02, 0.01, 0.01
# Where the repeats cannot tell a share of the reading from a share of full scale: 0.5 % and 0.1 %, each within a factor
# of about four.  Declared; load cells and torque cells of hobby stands.
_USUAL, _SPREAD = np.log([5e-3, 1e-3]), 1.5
# Least change of the load that has a direction, share of the largest.
_STEP = 0.002
# Terms over the load of what stays behind while it falls.
_TERMS = 3
# No stand is better than this, whatever digits repeat.
_BEST = np.array([2e-4, 1e-4])
# The data must be this much likelier (natural logarithm) before stated uncertainties are enlarged.
_DOUBT = 3.0


def fell(load: Array, run: Array, place: Array) -> Array:
    """Probability that the load of a point fell to there, (P,) [1].

    What went before the first point of a run is not known; a smaller step than counts leaves the direction as it was.
    """
    order = np.lexsort((place, run))
    first = np.diff(run[order], prepend=np.nan) != 0.0
    step = np.diff(np.nan_to_num(load[order]), prepend=0.0)
    counts = np.abs(step) > _STEP * float(np.max(np.nan_to_num(load), initial=0.0))
    last = np.maximum.accumulate(np.where(first | counts, np.arange(order.size), 0))
    out = np.empty(order.size)
    out[order] = np.where(first, 0.5, np.where(step < 0.0, 1.0, 0.0))[last]
    return out


def conditions(
    rpm: Array, J: Array, rho: Array, lengths: Sequence[Array] = (), part: Array | None = None
) -> NDArray[np.intp]:
    """Label of the condition of each point, (P,); -1 where a point has no repeat."""
    part = np.zeros(rpm.size) if part is None else part
    scaled = [np.log(rpm) / _NEAR_SPEED, J / _NEAR_J, np.log(rho) / _NEAR_AIR]
    scaled += [np.nan_to_num(np.log(np.maximum(x, 1e-9)), nan=99.0) / _NEAR_LENGTH for x in lengths]
    X = np.column_stack([*scaled, part * 1e6])
    label = np.full(rpm.size, -1, dtype=np.intp)
    free = np.ones(rpm.size, dtype=bool)
    for i in np.argsort(rpm, kind="stable"):
        group = free & free[i] & (np.abs(X - X[i]).max(axis=1) <= 1.0)
        if group.sum() > 1:
            label[group] = label.max() + 1
        free[group] = False
    return label


def projected_out(
    label: NDArray[np.intp], size: Array, model: Array, full: Array, run: Array, place: Array, falling: Array
) -> Array:  # fmt: skip
    """Columns of what repeats may differ by besides noise, (N, k).

    Conditions; gain, zero and drift of each run; and what stays behind where the load is ``falling``, since
    repeatability is that of readings under rising load (ISO 376:2011, reversibility is apart; not checked).
    """
    columns = [np.where(label == g, size, 0.0) for g in np.unique(label)]
    for r in np.unique(run):
        mine = run == r
        late = (place - place[mine].mean()) / max(float(np.ptp(place[mine])), 1e-12)
        columns += [np.where(mine, shape, 0.0) for shape in (model, full, full * late)]
    share = model / np.where(full > 0.0, full, 1.0)
    columns += [falling * full * share**k for k in range(_TERMS)]
    return np.stack(columns, axis=1)


def noise_sizes(
    e: Array, y: Array, full: Array, fixed: Array, stated: Array | None = None
) -> tuple[float, float, int] | None:
    """Find a and b beside what is stated. [1]"""
    left = Restricted.of(e, fixed, stated, y, full)
    if left is None or left.z.size < FEWEST:
        return None
    a, b = _likeliest(left.misfit)
    if stated is not None and left.misfit(0.0, 0.0) < left.misfit(a, b) + _DOUBT:
        a, b = 0.0, 0.0
    return a, b, int(left.z.size)


def spread_sizes(y: Array, unit: Array, block: NDArray[np.intp]) -> tuple[float, float] | None:
    """Find a and b from many points averaged in blocks of one condition, whose loads go with `unit`; else None."""
    count = np.bincount(block).astype(float)
    mean = (np.bincount(block, y / unit) / np.maximum(count, 1.0))[block] * unit
    dof = float(np.sum(np.maximum(count - 1.0, 0.0)))
    if dof < FEWEST:
        return None
    many = count[block] > 1
    share = 1.0 - 1.0 / count[block][many]
    e, level, full = (y - mean)[many], mean[many], float(np.max(np.abs(y)))

    def misfit(a: float, b: float) -> float:
        v = ((a * level) ** 2 + (b * full) ** 2) * share
        # blocks lose one degree of freedom each, shared out among their points
        return float(0.5 * np.sum(e**2 / v) + 0.5 * np.sum(share * np.log(v)))

    return _likeliest(misfit)


def _likeliest(misfit: Callable[[float, float], float]) -> tuple[float, float]:
    from scipy.optimize import minimize

    def total(x: Array) -> float:
        return misfit(*(float(v) for v in np.exp(x))) + 0.5 * float(np.sum(((x - _USUAL) / _SPREAD) ** 2))

    starts = (_USUAL, _USUAL + np.array([0.0, 1.5]), _USUAL + np.array([1.5, 0.0]))
    found = [minimize(total, s, method="Nelder-Mead", options={"xatol": 0.02, "fatol": 0.01}) for s in starts]
    a, b = np.maximum(np.exp(min(found, key=lambda m: float(m.fun)).x), _BEST)
    return float(a), float(b)

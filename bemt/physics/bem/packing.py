"""Section tables and effects become the arrays of the compiled kernel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.bem import kernel as K
from bemt.physics.bem import residual as res
from bemt.physics.effects.base import RotorBuild
from bemt.physics.sections.polars import (
    ALPHA_COARSE_STEP,
    ALPHA_FINE_HI,
    ALPHA_FINE_LO,
    ALPHA_FINE_STEP,
    ALPHA_GRID,
    DEFAULT_RE,
    RE_FIXED,
    fixed_re,
)

if TYPE_CHECKING:
    from bemt.physics.sections.polars import Polar

# Squared Mach number grid: uniform, so that the kernel needs neither root nor search.
M2_STEP = 0.1

# A loss exponent that leaves F = 1 at any inflow angle.
_LOSS_OFF = 1e9

_FINE_LO = round((ALPHA_FINE_LO + math.pi) / ALPHA_COARSE_STEP)
_FINE_HI = _FINE_LO + round((ALPHA_FINE_HI - ALPHA_FINE_LO) / ALPHA_FINE_STEP)


def mach_nodes(mach_max: float) -> int:
    """How many Mach numbers are tabulated, two or more [1]."""
    return max(2, math.ceil(mach_max**2 / M2_STEP) + 1)


def mach_grid(mach_max: float) -> Array:
    """Squares of the tabulated Mach numbers [1]."""
    return np.arange(mach_nodes(mach_max), dtype=np.float64) * M2_STEP


def re_nodes(re_range: tuple[float, float] | None, re: Array = DEFAULT_RE) -> tuple[int, int]:
    """First and last node of the Reynolds axis that a range needs [1]."""
    if re_range is None or re.size == 1:
        return 0, re.size - 1
    first = min(max(int(np.searchsorted(re, re_range[0], side="right")) - 1, 0), re.size - 2)
    return first, max(int(np.searchsorted(re, re_range[1])), first + 1)


# Rotors are prepared for blocks of nodes, so that a new speed mostly finds one ready: Mach 0.74, 1.02 and all.
_MACH_BLOCKS, _RE_BLOCK = (7, 12), 4


def block(mach: float, re_range: tuple[float, float], re: Array = DEFAULT_RE) -> tuple[float, tuple[float, float]]:
    """Largest Mach number and ends of the Reynolds numbers of the block of tables that holds what is asked for [1]."""
    first, last = re_nodes(re_range, re)
    first, last = first - first % _RE_BLOCK, min(-(-(last + 2) // _RE_BLOCK) * _RE_BLOCK - 2, re.size - 1)
    nodes = next((n for n in _MACH_BLOCKS if n >= mach_nodes(mach)), None)
    return math.inf if nodes is None else math.sqrt((nodes - 1.5) * M2_STEP), (float(re[first]), float(re[last]))


def common_grid(
    polars: Sequence[Polar], M: Array, re_range: tuple[float, float] | None = None
) -> tuple[Array, Array, Array]:
    """Reynolds axis (of ``re_range`` only) and cl, cd of all polars as (P, Nm, Nr, Na); one number stays one."""
    re = DEFAULT_RE if any(p.Re.size > 1 for p in polars) else polars[0].Re[:1]
    first, last = re_nodes(re_range, re)
    re = re[first : last + 1]
    cl = np.empty((len(polars), M.size, re.size, ALPHA_GRID.size))
    cd = np.empty_like(cl)
    for i, p in enumerate(polars):
        cl[i], cd[i] = _resampled(p, tuple(re), tuple(M) if p.M.size > 1 else ())
    return re, cl, cd


@lru_cache(maxsize=64)
def _resampled(polar: Polar, re: tuple[float, ...], M: tuple[float, ...]) -> tuple[Array, Array]:
    q = polar.on_grid(ALPHA_GRID, np.array(re), np.array(M) if M else polar.M)
    return q.cl.transpose(2, 1, 0), q.cd.transpose(2, 1, 0)


@lru_cache(maxsize=64)
def at_fixed_re(polar: Polar) -> Polar:
    """Polar without Reynolds number; kept, for rotors that are prepared again and again."""
    return fixed_re(polar, RE_FIXED)


def zero_and_slope(alpha: Array, cl: Array) -> tuple[Array, Array]:
    """Zero-lift angle [rad] and slope [1/rad] over the 5 degrees above it, per polar and Reynolds number."""
    window = np.abs(alpha) < np.radians(14.0)
    a = alpha[window]
    y = cl[..., window]
    # last upward crossing below the strongest lift: thin sections may cross more than once in stalled flow
    up = (y[..., :-1] <= 0.0) & (y[..., 1:] > 0.0)
    last = up.shape[-1] - 1 - np.argmax(up[..., ::-1], axis=-1)
    i = np.where(up.any(axis=-1), last, int(np.argmin(np.abs(a))))[..., None]
    y0 = np.take_along_axis(y, i, -1)[..., 0]
    y1 = np.take_along_axis(y, i + 1, -1)[..., 0]
    i = i[..., 0]
    a0 = a[i] - np.where(y1 != y0, y0 / np.where(y1 != y0, y1 - y0, 1.0), 0.0) * (a[1] - a[0])
    j = np.minimum(i + round(math.radians(5.0) / (a[1] - a[0])), a.size - 1)
    slope = np.take_along_axis(y, j[..., None], -1)[..., 0] / np.maximum(a[j] - a0, 1e-6)
    return a0, np.clip(slope, 1.0, 8.0)


def blend_weights(rR: Array, x: Array) -> Array:
    """(N, P) weights of P anchors at N stations: linear in r/R, held at the ends."""
    return np.stack([np.interp(rR, x, row) for row in np.eye(x.size)], axis=1)


def pack_stations(bake: RotorBuild, num: Array) -> Array:
    """Station columns of the kernel, (N, 14)."""
    st = np.empty((bake.r.size, K.N_STATION))
    st[:, K.S_R], st[:, K.S_DR], st[:, K.S_CHORD] = bake.r, bake.dr, bake.chord
    st[:, K.S_BETA], st[:, K.S_SIGMA] = bake.beta, bake.sigma
    # the kernel takes the root of the Prandtl exponent
    tip, hub = num[res.N_TIP], num[res.N_HUB]
    to_tip = tip * 0.5 * bake.B * np.maximum(bake.R - bake.r, 0.0) / bake.r
    to_hub = hub * 0.5 * bake.B * np.maximum(bake.r - bake.Rhub, 0.0) / max(bake.Rhub, 1e-9)
    st[:, K.S_TIP] = np.sqrt(to_tip) if tip > 0.0 else _LOSS_OFF
    st[:, K.S_HUB] = np.sqrt(to_hub) if hub > 0.0 else _LOSS_OFF
    st[:, K.S_LOGC] = np.log(np.maximum(bake.chord, 1e-9))
    # straight lift curve for the first guess: incompressible, middle Reynolds number, -1 to 5 deg
    a, b = np.radians(-1.0), np.radians(5.0)
    lift = bake.cl[:, 0, bake.Re.size // 2]
    cl_a, cl_b = lift[:, np.searchsorted(bake.alpha, a)], lift[:, np.searchsorted(bake.alpha, b)]
    slope = np.clip((cl_b - cl_a) / (b - a), 1.0, 12.0)
    st[:, K.S_CLA] = slope
    st[:, K.S_ALPHA0] = 0.5 * (a + b) - 0.5 * (cl_a + cl_b) / slope
    st[:, K.S_AXIAL], st[:, K.S_TANG] = bake.Vx_add, bake.Vy_add
    st[:, K.S_AXIAL_FACTOR], st[:, K.S_TANG_FACTOR] = bake.Vx_factor, bake.Vy_factor
    return st


def pack_tables(bake: RotorBuild) -> Array:
    """Rows of (angle, (cl, cd)) per station: every Mach and Reynolds number, or these and, apart, those."""
    n, n_t, n_r, n_a = bake.cl.shape
    apart = n_t < bake.M2.size
    out = np.empty((n, n_t * n_r + (bake.M2.size if apart else 0), n_a, 2))
    tables = out[:, : n_t * n_r].reshape(n, n_t, n_r, n_a, 2)
    tables[..., 0], tables[..., 1] = bake.cl, bake.cd
    if apart:
        out[:, n_r:, :, 0] = 1.0 if bake.mach_lift is None else bake.mach_lift[:, :, 0]
        out[:, n_r:, :, 1] = 0.0 if bake.mach_drag is None else bake.mach_drag[:, :, 0]
    return out


def pack_grid(bake: RotorBuild) -> Array:
    """Grid numbers of the kernel in the order of its comment on ``par``."""
    n_r, n_a = bake.cl.shape[2:]
    n_m = bake.M2.size
    apart = bake.cl.shape[1] < n_m
    log_re = np.log(bake.Re)
    return np.array([
        ALPHA_FINE_LO, ALPHA_FINE_HI, 1.0 / ALPHA_FINE_STEP, 1.0 / ALPHA_COARSE_STEP, _FINE_LO, _FINE_HI, n_a - 2,
        log_re[0], (n_r - 1) / (log_re[-1] - log_re[0]) if n_r > 1 else 0.0, max(n_r - 1, 1),
        1.0 / M2_STEP if n_m > 1 else 0.0, max(n_m - 1, 1),
        # an axis of one node has stride zero, so that its upper neighbour is itself
        2 * n_a * (1 if apart else n_r) if n_m > 1 else 0, 2 * n_a if n_r > 1 else 0,
        2 * n_a * (n_m + n_r if apart else n_m * n_r), bake.B, 2 * n_a * n_r,
    ])  # fmt: skip

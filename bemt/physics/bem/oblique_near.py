"""Loads in oblique flow of rotors that are like one that is solved, at the same points: bands ask for many of them.

A rotor with a moved unknown starts from the roots of the one as drawn and takes secant steps; what these change in its
loads is added to those of the full solution.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, disable-error-code="attr-defined"
# (numba erases signatures)

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.physics.bem import kernel as K
from bemt.physics.bem import oblique, residual, vecmath
from bemt.physics.bem.kernel import (
    _ROWS,
    LANES,
    O_MASS,
    O_Q,
    O_T,
    O_WHERE,
    S_AXIAL,
    S_AXIAL_FACTOR,
    S_BETA,
    S_CHORD,
    S_DR,
    S_HUB,
    S_LOGC,
    S_R,
    S_SIGMA,
    S_TANG,
    S_TANG_FACTOR,
    S_TIP,
    _stack,
    carray,
)
from bemt.physics.bem.oblique import (
    AZIMUTHS,
    P_BACK,
    P_CONE,
    P_MU,
    P_OMEGA,
    P_RHO,
    P_SIDE,
    P_TOWARD,
    P_V,
    _balance,
    _blade,
    _mean,
    _numbers,
    _whole,
    azimuths,
    run,
)
from bemt.physics.bem.vecmath import atan2, fingerprint, inlined, njit, ready, wide

BLOCK = 8
"""Annuli that are solved side by side [1]."""
SKIP = 5
"""One of so many annuli is solved of a rotor that is near another one [1]."""
_THERE = 1e-6  # so near a root is at it [rad]
_NEAR, _STEPS = 3e-3, 4  # the loads' secant goes on to a root so near [rad] after so many steps at most [1]


# Rows of the scratch memory, `BLOCK` annuli wide: as in the axial kernel, annuli side by side are SIMD lanes.
(_UT, _UP, _BETA, _SG4, _TIP, _HUB, _LRE, _BASE, _X, _TURN, _PHI, _STEP, _SLOPE, _DONE, _W, _FM, _S, _C, _GRAD, _LOUD,
 _RES, _AN, _AT, _RES0, _AN0, _AT0, _FLOW0, _THRUST, _FORCE, _FLOW) = (BLOCK * i for i in range(30))  # fmt: skip


@inlined
def _load(w, first, last, skip, point, roots, st, stride, R):
    """Fill the scratch rows of a block of annuli; lanes beyond the last annulus repeat it."""
    wide()
    log_rho_mu = math.log(point[P_RHO] / point[P_MU])
    for k in range(BLOCK):
        i = first + skip * k
        i = i if i < last else last
        UT = point[P_OMEGA] * st[i, S_R] * st[i, S_TANG_FACTOR] + st[i, S_TANG]
        UP = point[P_V] * st[i, S_AXIAL_FACTOR] + st[i, S_AXIAL]
        w[_UT + k] = UT
        w[_UP + k] = UP
        w[_BETA + k] = st[i, S_BETA]
        w[_SG4 + k] = 0.25 * st[i, S_SIGMA]
        w[_TIP + k] = st[i, S_TIP]
        w[_HUB + k] = st[i, S_HUB]
        w[_LRE + k] = log_rho_mu + st[i, S_LOGC]
        w[_BASE + k] = stride * i
        w[_X + k] = st[i, S_R] / R
        w[_TURN + k] = point[P_OMEGA] * st[i, S_R]
        w[_PHI + k] = roots[i, 0] + atan2(UP, UT)
        w[_SLOPE + k] = roots[i, 1] * abs(UT)
        w[_STEP + k] = 0.0
        w[_DONE + k] = 0.0
        w[_LOUD + k] = 0.0
        w[_RES + k] = 0.0
        w[_AN + k] = 0.0
        w[_AT + k] = 0.0
        w[_FM + k] = 0.0
        w[_W + k] = 0.0


@inlined
def _sums(lookup, w, point, tab, g, fx, cs, sn):
    """Loads of a block of annuli at their angles, summed over the azimuths, and their residuals."""
    wide()
    Vy = point[P_SIDE]
    cone, back, toward = point[P_CONE], point[P_BACK], point[P_TOWARD]
    n = cs.shape[0]
    for k in range(BLOCK):
        w[_RES0 + k] = w[_RES + k]
        w[_AN0 + k] = w[_AN + k]
        w[_AT0 + k] = w[_AT + k]
        w[_FLOW0 + k] = w[_FM + k] * w[_W + k]
        w[_PHI + k] += w[_STEP + k]
        _, W, FM, _, s, c, grad, _, loud = _mean(
            lookup, w[_PHI + k], w[_UT + k], w[_UP + k], Vy, w[_X + k], w[_BETA + k], w[_SG4 + k], w[_TIP + k],
            w[_HUB + k], w[_LRE + k], np.int32(w[_BASE + k]), tab, g, fx,
        )  # fmt: skip
        w[_W + k] = W
        w[_FM + k] = FM
        w[_S + k] = s
        w[_C + k] = c
        w[_GRAD + k] = grad
        w[_LOUD + k] = 1.0 if loud and w[_DONE + k] == 0.0 else w[_LOUD + k]
        w[_AN + k] = 0.0
        w[_AT + k] = 0.0
    for j in range(n):
        for k in range(BLOCK):
            dT, dF = _blade(
                lookup, w[_W + k], w[_S + k], w[_C + k], w[_UT + k], w[_UP + k], Vy, w[_GRAD + k],
                (cone, back, toward, w[_TURN + k]), w[_BETA + k], cs[j], sn[j], w[_LRE + k],
                np.int32(w[_BASE + k]), tab, g,
            )  # fmt: skip
            w[_AN + k] += dT
            w[_AT + k] += dF
    for k in range(BLOCK):
        w[_RES + k] = _balance(
            w[_AN + k], w[_AT + k], w[_SG4 + k], n, w[_W + k], w[_FM + k], w[_S + k], w[_C + k], w[_UT + k],
            w[_UP + k], fx,
        )  # fmt: skip


@inlined
def _secant(w, later):
    """Next steps of a block; annuli near enough to their roots keep the loads there; returns how many are not."""
    wide()
    busy = 0
    for k in range(BLOCK):
        res = w[_RES + k]
        share = res / (w[_RES0 + k] - res) if (later and res != 0.0) else 0.0
        left = share * w[_STEP + k] if later else math.inf
        slope = (res - w[_RES0 + k]) / w[_STEP + k] if later else w[_SLOPE + k]
        close = abs(left) < _NEAR
        step = -res / slope
        there = not close and abs(step) < _THERE
        share = 0.0 if there else share
        first = (close or there) and w[_DONE + k] == 0.0
        w[_THRUST + k] = w[_AN + k] + share * (w[_AN + k] - w[_AN0 + k]) if first else w[_THRUST + k]
        w[_FORCE + k] = w[_AT + k] + share * (w[_AT + k] - w[_AT0 + k]) if first else w[_FORCE + k]
        flow = w[_FM + k] * w[_W + k]
        w[_FLOW + k] = flow + share * (flow - w[_FLOW0 + k]) if first else w[_FLOW + k]
        w[_DONE + k] = 1.0 if first else w[_DONE + k]
        w[_STEP + k] = step
        w[_SLOPE + k] = slope
        busy += 1 if w[_DONE + k] == 0.0 else 0
    return busy


@inlined
def _near(lookup, w, point, roots, st, tab, par, cs, sn, R, skip, out):
    """Thrust, torque and mass flow of a rotor like one whose roots are known, from every skip-th annulus.

    O_WHERE becomes 0 where few steps do not come near a root, or the other rotor has none that is ordinary.
    """
    wide()
    fx, g, stride, B = _numbers(point, par)
    n = cs.shape[0]
    out[:] = 0.0
    out[O_WHERE] = -1.0
    start = skip // 2
    many = (st.shape[0] - start + skip - 1) // skip
    for first in range(0, many, BLOCK):
        _load(w, start + skip * first, start + skip * (many - 1), skip, point, roots, st, stride, R)
        for step in range(_STEPS + 1):
            _sums(lookup, w, point, tab, g, fx, cs, sn)
            if _secant(w, step > 0) == 0:
                break
        for k in range(min(BLOCK, many - first)):
            i = start + skip * (first + k)
            out[O_WHERE] = 0.0 if w[_LOUD + k] > 0.0 or w[_DONE + k] == 0.0 else out[O_WHERE]
            scale = 0.5 * point[P_RHO] * st[i, S_CHORD] * st[i, S_DR] * B * skip / n
            out[O_T] += w[_THRUST + k] * scale
            out[O_Q] += w[_FORCE + k] * scale * st[i, S_R]
            out[O_MASS] += point[P_RHO] * w[_FLOW + k] * 2.0 * math.pi * st[i, S_R] * st[i, S_DR] * skip


def _entries(stamp: int) -> dict[str, Any]:
    """Entry points; a closure over ``stamp`` renews numba's cache when functions of other files change."""

    @njit
    def plain(points, roots, st, tab, par, cs, sn, R, skip, out):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _near(residual.lookup_plain, w, points[p], roots[p], st, tab, par, cs, sn, R, skip, out[p])

    @njit
    def full(points, roots, st, tab, par, cs, sn, R, skip, out):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _near(residual.lookup_full, w, points[p], roots[p], st, tab, par, cs, sn, R, skip, out[p])

    @njit
    def factored(points, roots, st, tab, par, cs, sn, R, skip, out):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _near(residual.lookup_factored, w, points[p], roots[p], st, tab, par, cs, sn, R, skip, out[p])

    return {"plain": plain, "full": full, "factored": factored}


_ENTRIES = _entries(fingerprint(oblique, residual, vecmath, K))


class Near:
    """Loads of rotors that are like one that is solved, at the same points: secant steps from its roots.

    The first rotor is solved in full. Others add to its loads what these steps change in every `SKIP`-th annulus; where
    the steps end at no root, the point is solved in full.
    """

    def __init__(self) -> None:
        self._roots = self._whole = self._own = np.empty((0, 0))
        self._far: NDArray[np.bool_] = np.empty(0, np.bool_)

    def run(self, layout: str, points: Array, st: Array, tab: Array, par: Array, R: float) -> tuple[Array, Array]:
        """Columns of the kernel (P, N_OUT); hub loads (P, 4), of the first rotor alone."""
        given = st, tab, par
        if self._roots.shape[:2] != (points.shape[0], st.shape[0]):
            self._roots = np.full((points.shape[0], st.shape[0], 2), np.nan)
            self._whole, hub, _ = run(layout, points, *given, R, roots=self._roots)
            self._own = self._step(layout, points, *given, R)
            self._far = np.asarray(np.isnan(self._roots[..., 0]).any(axis=1))
            return self._whole.copy(), hub
        found, own = self._step(layout, points, *given, R), self._own
        far = self._far | (found[:, O_WHERE] >= 0.0) | ~np.isfinite(found[:, O_T])
        out, hub = self._whole.copy(), np.full((points.shape[0], 4), np.nan)
        for k in (O_T, O_Q, O_MASS):
            out[:, k] += found[:, k] - own[:, k]
        if np.any(far):
            out[far], hub[far], _ = run(layout, points[far], *given, R)
        return out, hub

    def _step(self, layout: str, points: Array, st: Array, tab: Array, par: Array, R: float) -> Array:
        few = azimuths(AZIMUTHS // 2)
        out = np.empty((points.shape[0], K.N_OUT))
        entry = ready(_ENTRIES[layout])
        entry(_whole(points), self._roots, st, tab, par, np.cos(few), np.sin(few), R, SKIP, out)
        return out

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
    _annulus,
    _numbers,
    _whole,
    azimuths,
    run,
)
from bemt.physics.bem.vecmath import atan2, fingerprint, inlined, njit, ready, wide

SKIP = 5
"""One of so many annuli is solved of a rotor that is near another one [1]."""
_THERE = 1e-6  # so near a root is at it [rad]
_NEAR, _STEPS = 3e-3, 4  # the loads' secant goes on to a root so near [rad] after so many steps at most [1]


@inlined
def _near(lookup, point, roots, st, tab, par, cs, sn, R, skip, out):
    """Thrust, torque and mass flow of a rotor like one whose roots are known, from every skip-th annulus.

    O_WHERE becomes 0 where few steps do not come near a root, or the other rotor has none that is ordinary.
    """
    wide()
    fx, g, stride, B = _numbers(point, par)
    n = cs.shape[0]
    log_rho_mu = math.log(point[P_RHO] / point[P_MU])
    Vy = point[P_SIDE]
    out[:] = 0.0
    out[O_WHERE] = -1.0
    for i in range(skip // 2, st.shape[0], skip):
        r = st[i, S_R]
        UT = point[P_OMEGA] * r * st[i, S_TANG_FACTOR] + st[i, S_TANG]
        UP = point[P_V] * st[i, S_AXIAL_FACTOR] + st[i, S_AXIAL]
        phi = roots[i, 0] + atan2(UP, UT)
        slope = roots[i, 1] * abs(UT)
        flap = (point[P_CONE], point[P_BACK], point[P_TOWARD], point[P_OMEGA] * r)
        lre = log_rho_mu + st[i, S_LOGC]
        base = np.int32(stride * i)
        step = 0.0
        left = math.inf
        res, an, at, flow, share = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(_STEPS + 1):
            before, an0, at0, flow0 = res, an, at, flow
            phi += step
            res, _, W, FM, _, _, _, _, _, loud, an, at = _annulus(
                lookup, phi, UT, UP, Vy, r / R, flap, st[i, S_BETA], 0.25 * st[i, S_SIGMA], st[i, S_TIP], st[i, S_HUB],
                lre, base, tab, g, fx, cs, sn, n,
            )  # fmt: skip
            flow = FM * W
            out[O_WHERE] = 0.0 if loud else out[O_WHERE]
            if k > 0:
                share = res / (before - res) if res != 0.0 else 0.0
                left = share * step
                slope = (res - before) / step
                if abs(left) < _NEAR:
                    break
            step = -res / slope
            if abs(step) < _THERE:
                left, share = 0.0, 0.0
                break
        if not (abs(left) < _NEAR):
            out[O_WHERE] = 0.0
        scale = 0.5 * point[P_RHO] * st[i, S_CHORD] * st[i, S_DR] * B * skip / n
        out[O_T] += (an + share * (an - an0)) * scale
        out[O_Q] += (at + share * (at - at0)) * scale * r
        out[O_MASS] += point[P_RHO] * (flow + share * (flow - flow0)) * 2.0 * math.pi * r * st[i, S_DR] * skip


def _entries(stamp: int) -> dict[str, Any]:
    """Entry points; a closure over ``stamp`` renews numba's cache when functions of other files change."""

    @njit
    def plain(points, roots, st, tab, par, cs, sn, R, skip, out):
        for p in range(points.shape[0] if stamp >= 0 else 0):
            _near(residual.lookup_plain, points[p], roots[p], st, tab, par, cs, sn, R, skip, out[p])

    @njit
    def full(points, roots, st, tab, par, cs, sn, R, skip, out):
        for p in range(points.shape[0] if stamp >= 0 else 0):
            _near(residual.lookup_full, points[p], roots[p], st, tab, par, cs, sn, R, skip, out[p])

    @njit
    def factored(points, roots, st, tab, par, cs, sn, R, skip, out):
        for p in range(points.shape[0] if stamp >= 0 else 0):
            _near(residual.lookup_factored, points[p], roots[p], st, tab, par, cs, sn, R, skip, out[p])

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

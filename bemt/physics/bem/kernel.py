"""Compiled blade-element-momentum kernel: find the inflow angle of every station, integrate over the blade.

Nothing here knows files, units or effects: every effect has already been baked into plain arrays and a few numbers by
:mod:`bemt.physics.bem.solver`; the physics is in :mod:`bemt.physics.bem.residual`.

The stations of one point are solved side by side (SIMD lanes) by Newton steps inside a bracket that always holds a
root, starting from the unstalled side.  A station that needs more than a few steps is finished alone, by the same
steps.  Every operating point is solved for itself: its result depends neither on the batch nor on its place in it.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, disable-error-code="attr-defined"
# (numba erases signatures)

from __future__ import annotations

import math
import sys
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numba import carray, types
from numba.core import cgutils

from bemt.base.cache import always_compile
from bemt.physics.bem import residual
from bemt.physics.bem import vecmath as vecmath
from bemt.physics.bem.residual import (
    N_BRIDGE,
    N_DUCTED,
    N_LEAK,
    N_LEFT,
    N_LENGTH,
    N_NUM,
    N_STATOR,
    N_STREAM,
    N_SWIRL,
    N_WAKE,
    RE_HELD,
    RE_LEFT,
    Y_BRAKE,
    Y_RING,
    ducted_rotor,
    jet_speed,
    lookup_factored,
    lookup_full,
    lookup_plain,
    mass_share,
    mean_share,
    open_rotor,
)
from bemt.physics.bem.vecmath import atan2, fingerprint, inlined, intrinsic, njit, ready, wide

# Point and station status, in the order of severity; bemt.physics.bem.solver turns them into words.
OK, NOT_CONVERGED, JUMP, NOT_FINITE = range(4)

# Columns of ``st``, of the packed points, of ``out`` and of ``radial``.
(S_R, S_DR, S_CHORD, S_BETA, S_SIGMA, S_TIP, S_HUB, S_LOGC, S_ALPHA0, S_CLA, S_AXIAL, S_TANG, S_AXIAL_FACTOR,
 S_TANG_FACTOR) = range(14)  # fmt: skip
N_STATION = 14
P_OMEGA, P_V, P_RHO, P_MU, P_SOUND = range(5)
N_POINT = 5
O_T, O_Q, O_MASS, O_JET, O_STATOR, O_STATUS, O_WHERE, O_BRIDGED, O_STAGNANT, O_REVERSED, O_SPIN, O_WHIRL = range(12)
N_OUT = 12
N_RADIAL = 11

# Grid numbers behind ``num`` in ``par``: two-zone angle grid lo, hi, 1/fine, 1/coarse, index of lo, of hi, last cell;
# Reynolds grid ln Re_0, 1/step, last node; Mach number grid 1/step of M^2, last node; strides of the tables along M^2,
# Re and station; blade count; start of the Mach tables behind the station's others, where they are apart.
N_GRID = 17

# Newton's last step, along which the state is carried [rad].
TOL_OPEN = 1e-7
TOL_DUCTED = 1e-9
MAX_VECTOR = 7
MAX_SCALAR = 200
_HALF_PI = 0.5 * math.pi

# Rows of the scratch memory, LANES wide.  It lives on the stack: the compiler then knows that tables do not overlap it.
LANES = 64
_ROWS = 24
(_UT, _UP, _IUP, _BETA, _SG4, _TIP, _HUB, _LRE, _BASE, _LO, _HI, _PHI, _STEP, _CL, _CD, _DCL, _DCD, _F, _X, _S, _C, _G,
 _BAD, _BUSY) = (LANES * i for i in range(_ROWS))  # fmt: skip


@intrinsic
def _stack(typingctx, stamp):
    """Pointer to the scratch memory; the argument is not used."""

    def codegen(context, builder, signature, args):
        size = context.get_constant(types.intp, _ROWS * LANES)
        return cgutils.alloca_once(builder, context.get_value_type(types.float64), size)

    return types.CPointer(types.float64)(stamp), codegen


@inlined
def _evaluate(element, lookup, w, k, tab, g, fx):
    """One residual of lane k, one bracketed Newton step; returns the size of the step."""
    phi = w[_PHI + k]
    res, slope, cl, cd, dcl, dcd, F, dF, X, dX, s, c = element(
        lookup, phi, w[_UT + k], w[_UP + k], w[_IUP + k], w[_BETA + k], w[_SG4 + k], w[_TIP + k], w[_HUB + k],
        w[_LRE + k], np.int32(w[_BASE + k]), tab, g, fx,
    )  # fmt: skip
    lo = phi if res < 0.0 else w[_LO + k]
    hi = phi if res > 0.0 else w[_HI + k]
    d = -res / slope
    new = phi + d
    size = abs(d)
    # Newton's step if it is uphill, stays inside and halves the last one (or is down to rounding); else bisection
    good = slope > 0.0 and new >= lo and new <= hi and (2.0 * size < w[_STEP + k] or size < 1e-12)
    d = d if good else 0.5 * (lo + hi) - phi
    d = 0.0 if res == 0.0 else d
    d = d if abs(res) < 1e300 else math.nan
    size = abs(d)
    w[_LO + k] = lo
    w[_HI + k] = hi
    w[_PHI + k] = phi + d
    w[_STEP + k] = size
    # carried along the last step; the error is of its second order
    w[_CL + k] = cl + dcl * d
    w[_CD + k] = cd + dcd * d
    w[_F + k] = F + dF * d
    w[_X + k] = X + dX * d
    w[_S + k] = s + c * d
    w[_C + k] = c - s * d
    w[_G + k] = res
    return size


@inlined
def _finish(element, lookup, w, k, tab, g, fx):
    """Finish one lane alone; returns its status.  Every two steps halve the bracket or the step: it always ends."""
    for _ in range(MAX_SCALAR):
        size = _evaluate(element, lookup, w, k, tab, g, fx)
        if not (size >= 1e-13):
            break
    if not (size < 1e-11):
        return NOT_CONVERGED if size >= 1e-11 else NOT_FINITE
    scale = w[_UT + k] + abs(w[_UP + k]) if fx[N_DUCTED] == 0.0 else 1.0
    return JUMP if abs(w[_G + k]) > 1e-5 * scale else OK


@inlined
def _load(w, n_pad, first, st, Omega, V, log_rho_mu, stride):
    """Fill the scratch rows that describe the stations; lanes beyond the last station repeat it."""
    wide()
    last = st.shape[0] - 1
    for k in range(n_pad):
        i = first + k
        i = i if i < last else last
        w[_UT + k] = Omega * st[i, S_R] * st[i, S_TANG_FACTOR] + st[i, S_TANG]
        UP = V * st[i, S_AXIAL_FACTOR] + st[i, S_AXIAL]
        w[_UP + k] = UP
        w[_IUP + k] = 1.0 / UP if UP != 0.0 else 0.0
        w[_BETA + k] = st[i, S_BETA]
        w[_SG4 + k] = 0.25 * st[i, S_SIGMA]
        w[_TIP + k] = st[i, S_TIP]
        w[_HUB + k] = st[i, S_HUB]
        w[_LRE + k] = log_rho_mu + st[i, S_LOGC]
        w[_BASE + k] = stride * i
        w[_CL + k] = st[i, S_ALPHA0]
        w[_CD + k] = st[i, S_CLA]


@inlined
def _guess_open(w, n_pad, fx):
    """Brackets and first guesses: straight lift curve, F = 1; (phi_in + psi) psi + q psi = q (alpha_in - alpha0)."""
    wide()
    for k in range(n_pad):
        UT = w[_UT + k]
        UP = w[_UP + k]
        phi_in = atan2(UP, UT)
        q = w[_SG4 + k] * w[_CD + k]
        lift = w[_BETA + k] - phi_in - w[_CL + k]
        i_U = 1.0 / math.sqrt(UT * UT + UP * UP)
        s = UP * i_U
        c = abs(UT) * i_U
        brake = lift < 0.0 and s > 0.0
        b = q - s if (lift < 0.0 and not brake) else q + s
        e = 4.0 * c * q * abs(lift)
        disc = b * b - e if brake else b * b + e
        disc = disc if disc > 0.0 else 0.0
        psi = 2.0 * q * lift / (b + math.sqrt(disc) + 1e-12)
        psi = psi if psi < 1.5 else 1.5
        psi = psi if psi > -1.5 else -1.5
        middle = phi_in if fx[N_SWIRL] > 0.0 else 0.0
        lo = middle - _HALF_PI
        hi = middle + _HALF_PI
        phi = phi_in + psi
        phi = phi if phi < hi else hi - 0.01
        phi = phi if phi > lo else lo + 0.01
        bare = w[_SG4 + k] == 0.0
        # a station without chord does nothing to the flow
        w[_PHI + k] = phi_in if bare else phi
        w[_LO + k] = phi_in if bare else lo
        w[_HI + k] = phi_in if bare else hi
        w[_STEP + k] = 0.0 if bare else math.pi


@inlined
def _guess_ducted(w, n_pad, fx):
    """Brackets and first guesses: straight lift curve, no swirl; K phi^2 + A phi = A (beta - alpha0) + (UP/UT)^2."""
    wide()
    for k in range(n_pad):
        lam = w[_UP + k] / w[_UT + k]
        A = 4.0 * w[_SG4 + k] * w[_CD + k]
        lift = A * (w[_BETA + k] - w[_CL + k])
        # with the onset from behind, begin where the rotor still drives the flow its own way
        e = lift if (lift > 0.0 and lam < 0.0) else lift + lam * abs(lam)
        phi = 2.0 * e / (A + math.sqrt(A * A + 4.0 * fx[N_WAKE] * fx[N_WAKE] * abs(e)) + 1e-12)
        phi = phi if phi < 1.4 else 1.4
        phi = phi if phi > -1.4 else -1.4
        bare = w[_SG4 + k] == 0.0 and lam == 0.0
        w[_PHI + k] = phi
        w[_LO + k] = 0.0 if bare else -math.pi
        w[_HI + k] = 0.0 if bare else math.pi
        w[_STEP + k] = 0.0 if bare else math.pi


@inlined
def _point(element, guess, lookup, w, point, st, tab, par, out, radial):
    """Solve every station of one operating point and integrate."""
    wide()
    # share of the stream that has left the nose of a duct
    gone = (RE_HELD - abs(point[P_V]) * par[N_LENGTH] * point[P_RHO] / point[P_MU]) / (RE_HELD - RE_LEFT)
    gone = gone if gone < 1.0 else 1.0
    stream = par[N_STREAM] + (gone * par[N_LEFT] if gone > 0.0 else 0.0)
    fx = (par[0], par[1], par[2], par[3], par[4], par[5], par[6], par[7], par[8], par[9], par[10], par[11], stream,
          par[13])  # fmt: skip
    o = N_NUM
    mach2 = par[o + 10] / (point[P_SOUND] * point[P_SOUND])
    g = (par[o], par[o + 1], par[o + 2], par[o + 3], par[o + 4], par[o + 5], par[o + 6], par[o + 7], par[o + 8],
         par[o + 9], mach2, par[o + 11], par[o + 12], par[o + 13], par[o + 16])  # fmt: skip
    stride = par[o + 14]
    B = par[o + 15]
    n = st.shape[0]
    Omega = point[P_OMEGA]
    V = point[P_V]
    rho = point[P_RHO]
    T = 0.0
    Q = 0.0
    mass = 0.0
    jet = 0.0
    stator = 0.0
    spin = 0.0
    whirl = 0.0
    worst = OK
    where = -1
    bridged = 0
    stagnant = 0
    reversed_ = 0
    log_rho_mu = math.log(rho / point[P_MU])
    ducted = fx[N_DUCTED] > 0.0
    swirl = fx[N_SWIRL] > 0.0
    tol = TOL_DUCTED if ducted else TOL_OPEN
    for first in range(0, n, LANES):
        lanes = min(LANES, n - first)
        n_pad = (lanes + 7) // 8 * 8
        _load(w, n_pad, first, st, Omega, V, log_rho_mu, stride)
        guess(w, n_pad, fx)
        for b in range(n_pad // 8):
            w[_BUSY + b] = 1.0
        left = 1
        for _ in range(MAX_VECTOR):
            left = 0
            for b in range(n_pad // 8):
                if w[_BUSY + b] > 0.0:
                    busy = 0
                    for k in range(8 * b, 8 * b + 8):
                        size = _evaluate(element, lookup, w, k, tab, g, fx)
                        busy += 0 if size < tol else 1
                    w[_BUSY + b] = busy
                    left += busy
            if left == 0:
                break
        for k in range(n_pad):
            w[_BAD + k] = 0.0
        if left > 0:
            for k in range(lanes):
                if not (w[_STEP + k] < tol):
                    status = _finish(element, lookup, w, k, tab, g, fx)
                    w[_BAD + k] = status
                    if status > worst:
                        worst = status
                        where = first + k
        for k in range(lanes):
            i = first + k
            s = w[_S + k]
            c = w[_C + k]
            cl = w[_CL + k]
            cd = w[_CD + k]
            F = w[_F + k]
            X = w[_X + k]
            UT = w[_UT + k]
            UP = w[_UP + k]
            area = 2.0 * math.pi * st[i, S_R] * st[i, S_DR]
            if ducted:
                W = UT / X
                flow = 0.0
            else:
                drag = 1.0 + w[_SG4 + k] * cd / max(X, 1e-12)
                W = (UT * c + UP * s) / drag if swirl else UT / c
                flow = X * W
            axial = W * s
            v_t = UT - W * c if swirl else 0.0
            leaves = axial
            dT = 0.5 * rho * W * W * st[i, S_CHORD] * B * st[i, S_DR] * (cl * c - cd * s)
            dQ = 0.5 * rho * W * W * st[i, S_CHORD] * B * st[i, S_DR] * (cl * s + cd * c) * st[i, S_R]
            if ducted:
                dT *= 1.0 - fx[N_LEAK]
                # means of the annulus
                G, _ = mean_share(F, fx[N_WAKE])
                mean = G * axial + (1.0 - G) * (1.0 + fx[N_STREAM]) / fx[N_WAKE] * UP
                v_t *= F * mass_share(axial, mean)
                axial = mean
                flow = abs(axial)
                leaves, _, _ = jet_speed(axial, UP, fx)
            lost = w[_BAD + k] > 0.0
            if not lost:
                T += dT
                Q += dQ
                mass += rho * flow * area
                jet += rho * flow * leaves * area
                if ducted:
                    spin += 4.0 * v_t * v_t * st[i, S_DR] / st[i, S_R]
                    whirl += 4.0 * rho * flow * v_t * v_t * area
                    turned = max(v_t, 0.0)
                    stator += fx[N_STATOR] * 2.0 * rho * turned * turned * area
                    reversed_ += 1 if axial < 0.0 else 0
                elif fx[N_BRIDGE] > 0.0 and UP != 0.0:
                    y = s * (UT * c + UP * s) / UP
                    bridged += 1 if Y_RING < y < Y_BRAKE else 0
                # the drag term of W's denominator exceeds the rest of it
                stagnant += 1 if swirl and w[_SG4 + k] * cd > F * abs(s) else 0
            if radial.shape[0] == n:
                row = radial[i]
                row[0] = w[_PHI + k]
                row[1] = w[_BETA + k] - w[_PHI + k]
                row[2] = cl
                row[3] = cd
                row[4] = W
                row[5] = axial
                row[6] = v_t
                row[7] = F
                row[8] = dT
                row[9] = dQ
                if lost:
                    for j in range(10):
                        row[j] = np.nan
                row[10] = w[_BAD + k]
    out[O_T] = T
    out[O_Q] = Q
    out[O_MASS] = mass
    out[O_JET] = jet
    out[O_STATOR] = stator
    out[O_STATUS] = worst
    out[O_WHERE] = where
    out[O_BRIDGED] = bridged
    out[O_STAGNANT] = stagnant
    out[O_REVERSED] = reversed_
    out[O_SPIN] = spin
    out[O_WHIRL] = whirl


def _entries(stamp: int) -> dict[tuple[bool, str], Any]:
    """Entry points of the kernel.

    Numba's disk cache sees changes of this file only.  A closure over ``stamp`` makes it see those of the functions
    from other files that are compiled in.
    """

    @njit
    def open_plain(points, st, tab, par, out, radial):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _point(open_rotor, _guess_open, lookup_plain, w, points[p], st, tab, par, out[p], radial[p])

    @njit
    def open_full(points, st, tab, par, out, radial):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _point(open_rotor, _guess_open, lookup_full, w, points[p], st, tab, par, out[p], radial[p])

    @njit
    def ducted_plain(points, st, tab, par, out, radial):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _point(ducted_rotor, _guess_ducted, lookup_plain, w, points[p], st, tab, par, out[p], radial[p])

    @njit
    def ducted_full(points, st, tab, par, out, radial):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _point(ducted_rotor, _guess_ducted, lookup_full, w, points[p], st, tab, par, out[p], radial[p])

    @njit
    def open_factored(points, st, tab, par, out, radial):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _point(open_rotor, _guess_open, lookup_factored, w, points[p], st, tab, par, out[p], radial[p])

    @njit
    def ducted_factored(points, st, tab, par, out, radial):
        wide()
        w = carray(_stack(stamp), (_ROWS * LANES,), np.float64)
        for p in range(points.shape[0]):
            _point(ducted_rotor, _guess_ducted, lookup_factored, w, points[p], st, tab, par, out[p], radial[p])

    return {
        (False, "plain"): open_plain, (False, "full"): open_full, (False, "factored"): open_factored,
        (True, "plain"): ducted_plain, (True, "full"): ducted_full, (True, "factored"): ducted_factored,
    }  # fmt: skip


_PARTS: dict[tuple[bool, str], tuple[str, str, str]] = {
    (ducted, tables): (f"{kind}_rotor", f"_guess_{kind}", f"lookup_{tables}")
    for ducted, kind in ((False, "open"), (True, "ducted")) for tables in ("plain", "full", "factored")
}  # fmt: skip

INTERPRETED = 6000
"""Blade elements times points that a process interprets before it compiles, which takes as long as 15,000."""


@cache
def _source() -> dict[str, Any]:
    """The functions of the kernel as plain Python, in a namespace of their own."""
    space: dict[str, Any] = {}
    for module in (vecmath, residual, sys.modules[__name__]):
        space |= vars(module)
    for name, item in list(space.items()):
        source = getattr(item, "py_func", None)
        if source is not None:
            # numpy's numbers divide by zero as the compiled ones do
            code = source.__code__
            consts = tuple(np.float64(c) if type(c) is float else c for c in code.co_consts)
            space[name] = FunctionType(code.replace(co_consts=consts), space, name, source.__defaults__)
        elif type(item) is float:
            space[name] = np.float64(item)
    space.update(log=np.log, wide=lambda: None)
    return space


def interpret(ducted: bool, tables: str, points, st, tab, par, out, radial) -> None:
    """Solve a few points without compiling: the same steps, equal to rounding."""
    space = _source()
    element, guess, lookup = (space[name] for name in _PARTS[ducted, tables])
    w = np.zeros(_ROWS * LANES)
    with np.errstate(all="ignore"):
        for p in range(points.shape[0]):
            space["_point"](element, guess, lookup, w, points[p], st, tab, par, out[p], radial[p])


class KernelEntry:
    """Entry point of the kernel for one kind of rotor and tables.

    Compiling takes seconds, more than all that a first question needs: as long as no compiled code lies on the disk,
    the first few points are interpreted.
    """

    def __init__(self, ducted: bool, tables: str, compiled) -> None:
        self.kind, self.compiled = (ducted, tables), compiled
        self._fast = always_compile()
        self._left = INTERPRETED

    def __call__(self, points, st, tab, par, out, radial) -> None:
        """Solve a batch of operating points."""
        if not self._fast:
            self._left -= points.shape[0] * st.shape[0]
            self._fast = self._left < 0 or bool(self.compiled.signatures) or _on_disk(self.compiled)
        if self._fast:
            ready(self.compiled)(points, st, tab, par, out, radial)
        else:
            interpret(*self.kind, points, st, tab, par, out, radial)


def _on_disk(compiled) -> bool:
    """Whether numba's cache holds compiled code of this source."""
    try:
        return bool(compiled._cache._cache_file._load_index())
    except Exception:  # numba's own, and private: if in doubt, it is not there
        return False


_ENTRIES = {kind: KernelEntry(*kind, made) for kind, made in _entries(fingerprint(residual, vecmath)).items()}


def entry(ducted: bool, tables: str) -> KernelEntry:
    """Entry point that solves a batch of operating points."""
    return _ENTRIES[ducted, tables]

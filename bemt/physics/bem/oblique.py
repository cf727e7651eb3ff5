"""Blade elements in oblique flow, compiled: annuli balanced with the loads averaged over the azimuth.

SI, radians.  The axial kernel (:mod:`bemt.physics.bem.kernel`) is not touched: points without in-plane wind go there.
``UT`` and ``UP`` are the mean tangential and axial onset speeds of an annulus, ``V_y`` the in-plane wind, ``psi`` the
azimuth of a blade, 0 downstream and 90 deg on the advancing side.  Per azimuth::

    u_t = W cos(phi) + V_y sin(psi)          w_psi = UP + v (1 + K r/R cos(psi)),   v = W sin(phi) - UP

``phi`` and ``W`` belong to the mean flow of the annulus, as in :mod:`bemt.physics.bem.residual`; with the averages over
psi ``a = sigma/4 <W_psi^2 cn> / W^2`` and ``b = sigma/4 <W_psi^2 ct> / W^2`` its residual keeps its form::

    g(phi) = F M (UT sin(phi) - UP cos(phi)) - (a UT + b UP)
    W      = (UT cos(phi) + UP sin(phi)) / (1 + sigma cd / (4 F M)),   cd at the mean flow

Mass flow: M W = sqrt(m^2 + V_y^2) (Glauert 1926, ARC R&M 1111, the same v for a wing and a rotor; Johnson 1980,
Helicopter Theory, sec. 4-1.1), with m the axial mass flow: abs(w), or in the turbulent windmill and vortex-ring states
the curve of :func:`bemt.physics.bem.residual.mass_flow`.  Without in-plane wind that is the axial annulus.  The curve
of descent fades to abs(w) as (1 - (V_y / 0.95 v_h)^2)^2: the end is Johnson's (2005, NASA/TP-2005-213477), the shape
own.

Prandtl's factor is that of the mean flow.  The speed of the far wake counts along that at the disk, over the latter:
((2 w - UP) w + V_y^2) / (w^2 + V_y^2).  Where a blade meets more wind from the side than from its own rotation there
are no helices, and 1 - F fades as 1 / (1 + (V_y / W)^4) (own choice; no published rule was found).

Gradient: K = 15 pi/32 tan(chi/2) (Pitt and Peters 1981, Vertica 5:21, in the form of Moriarty and Hansen 2005, AeroDyn
Theory Manual, NREL/EL-500-36881, skewed wake correction; equation numbers not checked), per annulus, with
tan(chi/2) = V_y / (sqrt(w^2 + V_y^2) + abs(w)).  Left out: the gradient that hub moments induce themselves (moments
come out too large on a stiff rotor), radial flow along the blade.  Blades on hinges: :func:`flap`.
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
from bemt.physics.bem import residual, vecmath
from bemt.physics.bem.kernel import (
    JUMP,
    NOT_CONVERGED,
    NOT_FINITE,
    O_BRIDGED,
    O_MASS,
    O_Q,
    O_STAGNANT,
    O_STATUS,
    O_T,
    O_WHERE,
    OK,
    S_ALPHA0,
    S_AXIAL,
    S_AXIAL_FACTOR,
    S_BETA,
    S_CHORD,
    S_CLA,
    S_DR,
    S_HUB,
    S_LOGC,
    S_R,
    S_SIGMA,
    S_TANG,
    S_TANG_FACTOR,
    S_TIP,
)
from bemt.physics.bem.residual import N_BRIDGE, N_FAR, N_NUM, N_SWIRL, Y_BRAKE, Y_RING, loss, mass_flow
from bemt.physics.bem.vecmath import atan2, fingerprint, inlined, njit, ready, sincos, wide

P_OMEGA, P_V, P_RHO, P_MU, P_SOUND, P_SIDE, P_CONE, P_BACK, P_TOWARD = range(9)
N_POINT = 9
AZIMUTHS = 16
"""Stations round the azimuth where loads are integrated; annuli are balanced at every second one [1]."""
H_FORCE, Y_FORCE, ROLL, PITCH = range(4)
"""Columns of the hub loads: H downstream, Y to the advancing side [N]; roll lifts the advancing side, pitch the
upstream side [N m]."""
SHEETS = 0.05
"""Share of the side wind, squared, in the spacing of the vortex sheets: without any, F rises to 1 and falls again where
the flow through the disk turns, and the balance has three roots (own choice, the least that leaves one) [1]."""
RING = 0.95
"""Side wind over the induced speed of hover at which no vortex ring is left (Johnson 2005, NASA/TP-2005-213477) [1]."""
PITT_PETERS = 15.0 * math.pi / 32.0
_TOL = 1e-7  # the last secant step [rad]
_MAX = 120
_MAX_FLAP = 30


@inlined
def _flapping(flap, Vy, c, s):
    """Speed downwards through a blade from its flapping, b = cone - back cos(psi) - toward sin(psi): r b' + V_y b cos.

    ``flap`` holds the three angles and ``r Omega`` (Leishman 2006, sec. 4.5 and 4.7; Johnson 1980, sec. 5-2).
    """
    return flap[3] * (flap[1] * s - flap[2] * c) + Vy * c * (flap[0] - flap[1] * c - flap[2] * s)


@inlined
def _blade(lookup, W, s, c, UT, UP, Vy, grad, flap, beta, cs, sn, lre, base, tab, g):
    """Thrust and force against the rotation of a blade element at one azimuth, over rho chord dr / 2. [m2/s2]"""
    ut = W * c + Vy * sn
    wk = W * s + grad * cs + _flapping(flap, Vy, cs, sn)
    W2 = ut * ut + wk * wk
    # Re and Mach number leave out the drag term, as in the axial kernel
    along = (UT + Vy * sn) * ut + UP * wk
    ref = along * along / (W2 + 1e-30)
    cl, cd, _, _, _, _ = lookup(beta - atan2(wk, ut), lre, ref, base, tab, g)
    size = math.sqrt(W2)
    return size * (cl * ut - cd * wk), size * (cl * wk + cd * ut)


@inlined
def _mean(lookup, phi, UT, UP, Vy, x, beta, sg4, tip, hub, lre, base, tab, g, fx):
    """Mean flow of one annulus: drag term, W, F M, W0, sine and cosine, gradient, F, whether the curve of descent."""
    s, c = sincos(phi)
    swirl = fx[N_SWIRL]
    W0 = UT * c + UP * s
    W0 = W0 if W0 > 1e-9 else 1e-9
    sa = abs(s)
    ss = s if sa > 1e-9 else (1e-9 if s >= 0.0 else -1e-9)
    w0 = ss * W0
    # Prandtl's factor, as of the axial rotor; speed of the far wake along that at the disk, over the latter
    turn = ((2.0 * w0 - UP) * w0 + Vy * Vy) / (w0 * w0 + Vy * Vy)
    turn = turn if turn < 3.0 else 3.0
    turn = turn if turn > 0.3 else 0.3
    s2 = ss * ss + SHEETS * Vy * Vy / (W0 * W0)
    p = turn * turn * turn * s2 if fx[N_FAR] > 0.0 else s2
    whole = c * c + p if fx[N_FAR] > 0.0 else 1.0
    root = math.sqrt(math.sqrt(whole / p))
    Ft, _ = loss(tip * root)
    Fh, _ = loss(hub * root)
    F = (Ft if Ft > 1e-6 else 1e-6) * (Fh if Fh > 1e-6 else 1e-6)
    t = Vy / W0
    t *= t
    t *= t
    F = 1.0 - (1.0 - F) / (1.0 + t)
    y = w0 / UP if UP != 0.0 else 2.0
    zone = fx[N_BRIDGE] > 0.0 and UP != 0.0 and y < 0.6 and y > Y_RING
    f, _ = mass_flow(y)
    M = abs(UP) * f / W0 if zone else sa
    size = Vy * Vy / (RING * RING * abs(w0 - UP) * math.sqrt(w0 * w0 + Vy * Vy) + 1e-30)
    ring = 1.0 - size if size < 1.0 else 0.0
    M = sa + ring * ring * (M - sa)
    loud = zone and y < Y_BRAKE and ring > 0.0
    across = Vy / W0
    M = math.sqrt(M * M + across * across)
    FM = F * M
    _, cd, _, _, _, _ = lookup(beta - phi, lre, W0 * W0, base, tab, g)
    q = sg4 * cd / FM if swirl > 0.0 else 0.0
    W = W0 / (1.0 + q) if swirl > 0.0 else UT / (c if c > 1e-9 else 1e-9)
    w = W * s
    v = w - UP
    grad = PITT_PETERS * Vy / (math.sqrt(w * w + Vy * Vy) + abs(w) + 1e-12) * x * v
    return q, W, FM, W0, s, c, grad, F, loud


@inlined
def _balance(an, at, sg4, n, W, FM, s, c, UT, UP, fx):
    """Residual of an annulus from the sums of its loads over n azimuths. [m/s]"""
    scale = sg4 / (n * W * W)
    return FM * (UT * s - UP * c) - scale * (an * UT + at * UP * fx[N_SWIRL])


@inlined
def _annulus(lookup, phi, UT, UP, Vy, x, flap, beta, sg4, tip, hub, lre, base, tab, g, fx, cs, sn, n):
    """Residual and slope of its first guess [m/s] of one annulus, loads averaged over n azimuths."""
    _, W, FM, W0, s, c, grad, _, _ = _mean(lookup, phi, UT, UP, Vy, x, beta, sg4, tip, hub, lre, base, tab, g, fx)
    an = 0.0
    at = 0.0
    for k in range(n):
        dT, dF = _blade(lookup, W, s, c, UT, UP, Vy, grad, flap, beta, cs[k], sn[k], lre, base, tab, g)
        an += dT
        at += dF
    return _balance(an, at, sg4, n, W, FM, s, c, UT, UP, fx), FM * W0


@inlined
def _root(lookup, UT, UP, Vy, x, flap, near, i, st, lre, base, tab, g, fx, cs, sn, n):
    """Inflow angle of one annulus: bracketed secant steps; returns angle and status."""
    sg4 = 0.25 * st[i, S_SIGMA]
    beta = st[i, S_BETA]
    phi_in = atan2(UP, UT)
    # first guess as of the axial rotor, with the mass flow that the in-plane wind adds
    k = sg4 * st[i, S_CLA]
    lift = beta - phi_in - st[i, S_ALPHA0]
    i_U = 1.0 / math.sqrt(UT * UT + UP * UP)
    flow = math.sqrt(UP * UP + Vy * Vy) * i_U * (1.0 if UP >= 0.0 else -1.0)
    brake = lift < 0.0 and UP > 0.0
    b = k - flow if (lift < 0.0 and not brake) else k + flow
    e = 4.0 * abs(UT) * i_U * k * abs(lift)
    disc = b * b - e if brake else b * b + e
    psi = 2.0 * k * lift / (b + math.sqrt(disc if disc > 0.0 else 0.0) + 1e-12)
    psi = min(max(psi, -1.5), 1.5)
    middle = phi_in if fx[N_SWIRL] > 0.0 else 0.0
    # towards W0 = 0 the load of the wind from the side, over W0^2, outgrows the momentum: no root belongs there
    low = 3.0 * sg4 * Vy * i_U
    half = math.acos(low if low < 0.7 else 0.7)
    lo = middle - half
    hi = middle + half
    phi = near[0] if near[0] > lo + 0.01 and near[0] < hi - 0.01 else min(max(phi_in + psi, lo + 0.01), hi - 0.01)
    last = math.pi
    before = 0.0
    before_phi = 0.0
    status = NOT_CONVERGED
    for it in range(_MAX):
        res, stiff = _annulus(
            lookup, phi, UT, UP, Vy, x, flap, beta, sg4, st[i, S_TIP], st[i, S_HUB], lre, base, tab, g, fx, cs, sn, n
        )
        if not (abs(res) < 1e300):
            status = NOT_FINITE
            break
        lo = phi if res < 0.0 else lo
        hi = phi if res > 0.0 else hi
        if it > 0:
            slope = (res - before) / (phi - before_phi)
        elif near[1] > 0.0:
            slope = near[1] * abs(UT)
        else:
            slope = stiff + k * abs(UT)
        before = res
        before_phi = phi
        step = -res / slope if slope > 0.0 else math.inf
        new = phi + step
        if not (new >= lo and new <= hi and (2.0 * abs(step) < last or it < 2)):
            new = 0.5 * (lo + hi)
            step = new - phi
        last = abs(step)
        phi = new
        if last < _TOL:
            status = OK if abs(res) < 1e-5 * (UT + abs(UP) + Vy) else JUMP
            break
    return phi, status, slope / abs(UT)


@inlined
def _numbers(point, par):
    """Switches of the residual, grid of the tables at a point, length of a station's tables, blades."""
    fx = (par[0], par[1], par[2], par[3], par[4], par[5], par[6], par[7], par[8], par[9], par[10], par[11], par[12])
    o = N_NUM
    mach2 = par[o + 10] / (point[P_SOUND] * point[P_SOUND])
    g = (par[o], par[o + 1], par[o + 2], par[o + 3], par[o + 4], par[o + 5], par[o + 6], par[o + 7], par[o + 8],
         par[o + 9], mach2, par[o + 11], par[o + 12], par[o + 13], par[o + 16])  # fmt: skip
    stride = par[o + 14]
    B = par[o + 15]
    return fx, g, stride, B


@inlined
def _point(lookup, point, st, tab, par, rounds, R, out, hub, disk, roots):
    """Solve every annulus of one operating point and integrate over blade and azimuth."""
    wide()
    fx, g, stride, B = _numbers(point, par)
    cs, sn, few_cs, few_sn = rounds
    n = cs.shape[0]
    few = few_cs.shape[0]
    log_rho_mu = math.log(point[P_RHO] / point[P_MU])
    Vy = point[P_SIDE]
    out[:] = 0.0
    hub[:] = 0.0
    out[O_WHERE] = -1.0
    # root and slope of the station before, where it is of an ordinary state
    last_alpha = math.nan
    step_alpha = 0.0
    last_slope = 0.0
    for i in range(st.shape[0]):
        r = st[i, S_R]
        UT = point[P_OMEGA] * r * st[i, S_TANG_FACTOR] + st[i, S_TANG]
        UP = point[P_V] * st[i, S_AXIAL_FACTOR] + st[i, S_AXIAL]
        lre = log_rho_mu + st[i, S_LOGC]
        base = np.int32(stride * i)
        x = r / R
        flap = (point[P_CONE], point[P_BACK], point[P_TOWARD], point[P_OMEGA] * r)
        phi = atan2(UP, UT)
        status = OK
        if st[i, S_SIGMA] > 0.0:
            near = (st[i, S_BETA] - last_alpha - step_alpha, last_slope)
            phi, status, last_slope = _root(
                lookup, UT, UP, Vy, x, flap, near, i, st, lre, base, tab, g, fx, few_cs, few_sn, few
            )
        if status != OK:
            if status > out[O_STATUS]:
                out[O_STATUS] = status
                out[O_WHERE] = i
            continue
        q, W, FM, _, s, c, grad, F, zone = _mean(
            lookup, phi, UT, UP, Vy, x, st[i, S_BETA], 0.25 * st[i, S_SIGMA], st[i, S_TIP], st[i, S_HUB], lre, base,
            tab, g, fx,
        )  # fmt: skip
        out[O_MASS] += point[P_RHO] * FM * W * 2.0 * math.pi * r * st[i, S_DR]
        out[O_BRIDGED] += 1.0 if zone else 0.0
        out[O_STAGNANT] += 1.0 if q * FM > F * math.sqrt(s * s + (Vy / W) ** 2) else 0.0
        if roots.shape[0] > 0 and not zone:
            roots[i, 0] = phi - atan2(UP, UT)
            roots[i, 1] = last_slope if st[i, S_SIGMA] > 0.0 else 1.0
        alpha = st[i, S_BETA] - phi
        step_alpha = alpha - last_alpha
        step_alpha = step_alpha if abs(step_alpha) < 0.1 else 0.0
        # blades that brake or fly in their own wake have several roots: the next station starts afresh
        last_alpha = alpha if alpha > st[i, S_ALPHA0] and not zone else math.nan
        scale = 0.5 * point[P_RHO] * st[i, S_CHORD] * st[i, S_DR] * B / n
        T = 0.0
        swirl = 0.0
        H = 0.0
        Y = 0.0
        T_sin = 0.0
        T_cos = 0.0
        for k in range(n):  # nothing is stored here: with it the loop would not become SIMD code
            dT, dF = _blade(lookup, W, s, c, UT, UP, Vy, grad, flap, st[i, S_BETA], cs[k], sn[k], lre, base, tab, g)
            tilt = dT * (flap[0] - flap[1] * cs[k] - flap[2] * sn[k])
            T += dT
            swirl += dF
            H += dF * sn[k] - tilt * cs[k]
            Y -= dF * cs[k] + tilt * sn[k]
            T_sin += dT * sn[k]
            T_cos += dT * cs[k]
        out[O_T] += T * scale
        out[O_Q] += swirl * scale * r
        hub[H_FORCE] += H * scale
        hub[Y_FORCE] += Y * scale
        hub[ROLL] += T_sin * scale * r
        hub[PITCH] -= T_cos * scale * r
        for k in range(disk.shape[1] if disk.shape[0] > 0 else 0):
            dT, _ = _blade(lookup, W, s, c, UT, UP, Vy, grad, flap, st[i, S_BETA], cs[k], sn[k], lre, base, tab, g)
            disk[i, k] = dT * scale * n / (2.0 * math.pi * r * st[i, S_DR])


def _entries(stamp: int) -> dict[str, Any]:
    """Entry points; a closure over ``stamp`` renews numba's cache when functions of other files change."""

    @njit
    def plain(points, st, tab, par, rounds, R, out, hub, disk, roots):
        for p in range(points.shape[0] if stamp >= 0 else 0):
            _point(residual.lookup_plain, points[p], st, tab, par, rounds, R, out[p], hub[p], disk[p], roots[p])

    @njit
    def full(points, st, tab, par, rounds, R, out, hub, disk, roots):
        for p in range(points.shape[0] if stamp >= 0 else 0):
            _point(residual.lookup_full, points[p], st, tab, par, rounds, R, out[p], hub[p], disk[p], roots[p])

    @njit
    def factored(points, st, tab, par, rounds, R, out, hub, disk, roots):
        for p in range(points.shape[0] if stamp >= 0 else 0):
            _point(residual.lookup_factored, points[p], st, tab, par, rounds, R, out[p], hub[p], disk[p], roots[p])

    return {"plain": plain, "full": full, "factored": factored}


_ENTRIES = _entries(fingerprint(residual, vecmath, K))


def azimuths(n: int = AZIMUTHS) -> NDArray[np.float64]:
    """Azimuths of the blades, 0 downstream, (n,) [rad]."""
    return np.asarray(np.arange(n) * (2.0 * math.pi / n), dtype=float)


def flap(
    layout: str, points: Array, st: Array, tab: Array, par: Array, R: float, cone: float, disk: bool = False
) -> tuple[Array, Array, Array]:
    """Solve points as :func:`run` with blades that flap about hinges on the shaft, ``cone`` their coning angle [rad].

    With b = cone - back cos(psi) - toward sin(psi), inertia and centrifugal moments of the first harmonic cancel, and
    the aerodynamic moments about the hinges must vanish: Newton's method with the slopes of the rigid rotor.
    """
    P = points.shape[0]
    at = np.concatenate([points[:, :P_CONE], np.full((P, 1), cone), np.zeros((P, 2))], axis=1)
    step = np.eye(2) * 0.01
    found = run(layout, at, st, tab, par, R)
    slopes = np.empty((P, 2, 2))
    for i in range(2):
        moved = at.copy()
        moved[:, P_BACK:] += step[i]
        slopes[:, :, i] = (run(layout, moved, st, tab, par, R)[1][:, ROLL:] - found[1][:, ROLL:]) / 0.01
    slopes[~np.isfinite(np.linalg.cond(slopes))] = np.eye(2)
    left = np.ones(P, dtype=bool)
    for _ in range(_MAX_FLAP):
        change = np.linalg.solve(slopes, found[1][:, ROLL:, None])[..., 0]
        at[:, P_BACK:] -= np.where(left[:, None], np.clip(change, -0.1, 0.1), 0.0)
        left = left & (np.abs(change).max(axis=1) > 1e-7)
        if not np.any(left):
            break
        part = run(layout, at[left], st, tab, par, R)
        for whole, new in zip(found, part, strict=True):
            whole[left] = new
    found = run(layout, at, st, tab, par, R, disk=disk)
    found[0][left, O_STATUS] = np.maximum(found[0][left, O_STATUS], NOT_CONVERGED)
    return found


def run(
    layout: str, points: Array, st: Array, tab: Array, par: Array, R: float, n: int = AZIMUTHS, disk: bool = False,
    roots: Array | None = None,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Solve points (P, 6), or (P, 9) with flapping angles.

    Returns columns of the kernel (P, N_OUT), hub loads (P, 4), disk loading (P, N, n) [N/m2]. ``roots`` (P, N, 2) takes
    the inflow angles [rad] and the slopes of the residual over the speed of rotation, where it is of an ordinary state.
    """
    points = _whole(points)
    psi, few = azimuths(n), azimuths(n // 2)
    out = np.empty((points.shape[0], K.N_OUT))
    hub = np.empty((points.shape[0], 4))
    maps = np.zeros((points.shape[0], st.shape[0] if disk else 0, n))
    found = np.empty((points.shape[0], 0, 2)) if roots is None else roots
    rounds = np.cos(psi), np.sin(psi), np.cos(few), np.sin(few)
    ready(_ENTRIES[layout])(points, st, tab, par, rounds, R, out, hub, maps, found)
    return out, hub, maps


def _whole(points: Array) -> Array:
    """Points with flapping angles, zeros where there are none."""
    return np.ascontiguousarray(np.pad(points, ((0, 0), (0, N_POINT - points.shape[1]))))

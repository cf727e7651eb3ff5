"""Compiled blade-element-momentum kernel: one residual, one root-finder, one integration.

Nothing here knows files, units or effects: every effect has already been baked into plain arrays and a few
numbers by :mod:`bemt.solver`.  All functions are scalar, allocation-free and release the GIL, so a batch may be cut
into threads by the caller.

Conventions (SI, radians).  ``UT`` is the tangential and ``UP`` the axial onset speed at a blade element, ``phi`` the
inflow angle, ``alpha = beta - phi``, ``cn`` along the thrust, ``ct`` along the torque.  ``sigma = B c / (2 pi r)``.

Open rotor.  With ``m`` the mass flow per area over density, thrust and torque balances of one annulus are::

    F m (w - UP) = sigma/4 W^2 cn        F m v_t = sigma/4 W^2 ct        w = W sin(phi),  W cos(phi) = UT - v_t

and elimination of W leaves a residual without a singularity at hover (Ning 2014 eq. 6-13 in another form)::

    g(phi) = F M (UT sin(phi) - UP cos(phi)) - sigma/4 (cn UT + ct UP),    M = m / W

In the propeller and windmill state M = abs(sin(phi)).  From the turbulent windmill state (axial induction factor of
a turbine above 0.4) through hover in descent, M follows the bridge of :func:`mass_flow`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit as _njit

# Point and station status, in the order of severity; bemt.solver turns them into words.
OK = 0
NO_BRACKET = 1
NOT_CONVERGED = 2

_FAST = {"contract", "reassoc", "nsz", "arcp"}  # keeps NaN and infinity as they are


def njit(inline: str = "never") -> Any:
    """One way of compiling for the whole kernel."""
    return _njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST, inline=inline)


TWO_OVER_PI = 2.0 / math.pi
PHI_TOL = 1e-11
MAX_ITER = 60
_EPS = 1e-9

# Indices of the numbers that effects may set (array ``num``).
N_TIP, N_HUB, N_SWIRL, N_BRIDGE, N_DUCTED, N_WAKE, N_LIP, N_STATOR, N_GAP, N_LEAK, N_FAR = range(11)
N_NUM = 11
N_OUT = 8
N_RADIAL = 11


@njit("always")
def _sincos(x):
    return math.sin(x), math.cos(x)


@njit()
def mass_flow(y):
    """Mass flow per area over ``rho |UP|`` as a function of ``y = w / UP`` (open rotor).

    ``y >= 0.6``: momentum theory, ``y``.  ``0 <= y < 0.6``: Buhl (2005) eq. 18 with F = 1,
    CT = 8/9 - 4/9 a + 14/9 a^2 with a = 1 - y, tangent to momentum theory at a = 0.4.  ``-1 <= y < 0``: cubic Hermite
    bridge to the helicopter branch (own choice, C1; vortex-ring state, flagged by the solver).  ``y < -1``: ``-y``.
    """
    if y >= 0.6:
        return y
    if y >= 0.0:
        a = 1.0 - y
        return (8.0 / (9.0 * a) - 4.0 / 9.0 + 14.0 / 9.0 * a) / 4.0
    if y >= -1.0:
        t = -y
        t2 = t * t
        t3 = t2 * t
        return 0.5 * (2 * t3 - 3 * t2 + 1) + (1.0 / 6.0) * (t3 - 2 * t2 + t) + (3 * t2 - 2 * t3) + (t3 - t2)
    return -y


# Prandtl factor F(u), u = sqrt(f): smooth in u, so a cubic Hermite table of it is exact to 1e-11 and needs neither exp
# nor acos in the inner loop.  Columns F, dF/du.
_U_MAX = 4.5
_U_STEP = _U_MAX / 900.0


def _prandtl_table() -> Any:
    u = np.arange(902) * _U_STEP
    f = u * u
    F = TWO_OVER_PI * np.arccos(np.exp(-f))
    root = np.sqrt(-np.expm1(-2.0 * f[1:]))
    slope = np.empty_like(u)
    slope[1:] = TWO_OVER_PI * np.exp(-f[1:]) / root * 2.0 * u[1:]
    slope[0] = TWO_OVER_PI * math.sqrt(2.0)
    return np.stack([F, slope], axis=1)


_PRANDTL = _prandtl_table()


@njit("always")
def _loss(u):
    """Prandtl factor (2/pi) acos(exp(-u^2)) and its derivative with respect to u."""
    if u >= _U_MAX:
        return 1.0, 0.0
    x = u * (1.0 / _U_STEP)
    i = int(x)
    t = x - i
    f0 = _PRANDTL[i, 0]
    f1 = _PRANDTL[i + 1, 0]
    m0 = _PRANDTL[i, 1] * _U_STEP
    m1 = _PRANDTL[i + 1, 1] * _U_STEP
    a = 2.0 * (f0 - f1) + m0 + m1
    b = 3.0 * (f1 - f0) - 2.0 * m0 - m1
    return ((a * t + b) * t + m0) * t + f0, ((3.0 * a * t + 2.0 * b) * t + m0) * (1.0 / _U_STEP)


@njit("always")
def _alpha_index(alpha, agrid):
    """Lower index, weight and reciprocal spacing on the two-zone angle grid ``agrid`` (see bemt.solver)."""
    # agrid = [lo, hi, 1/fine, 1/coarse, i_lo, i_hi, n]
    if alpha < agrid[0]:
        inv = agrid[3]
        x = (alpha + math.pi) * inv
    elif alpha <= agrid[1]:
        inv = agrid[2]
        x = (alpha - agrid[0]) * inv + agrid[4]
    else:
        inv = agrid[3]
        x = (alpha - agrid[1]) * inv + agrid[5]
    i = int(x)
    if i < 0:
        i = 0
    top = int(agrid[6]) - 2
    if i > top:
        i = top
    return i, x - i, inv


@njit("always")
def _lookup(tab, k, alpha, lre0, W2, m2, agrid, rgrid):
    """cl, cd and their slopes in alpha at station ``k``; linear in alpha, log Re and Mach squared."""
    i, wa, inv = _alpha_index(alpha, agrid)
    # rgrid = [log_re0, 1/dlog_re, n_re, 1/dm2, n_m]
    nr = int(rgrid[2])
    nm = int(rgrid[4])
    j = 0
    wr = 0.0
    if nr > 1:
        x = (lre0 + 0.5 * math.log(max(W2, 1e-12)) - rgrid[0]) * rgrid[1]
        x = min(max(x, 0.0), nr - 1.0)
        j = min(int(x), nr - 2)
        wr = x - j
    m = 0
    wm = 0.0
    if nm > 1:
        x = min(m2 * rgrid[3], nm - 1.0)
        m = min(int(x), nm - 2)
        wm = x - m
    l0 = tab[k, m, j, i, 0]
    l1 = tab[k, m, j, i + 1, 0]
    d0 = tab[k, m, j, i, 1]
    d1 = tab[k, m, j, i + 1, 1]
    if wr > 0.0:
        l0 += wr * (tab[k, m, j + 1, i, 0] - l0)
        l1 += wr * (tab[k, m, j + 1, i + 1, 0] - l1)
        d0 += wr * (tab[k, m, j + 1, i, 1] - d0)
        d1 += wr * (tab[k, m, j + 1, i + 1, 1] - d1)
    if wm > 0.0:
        a0 = tab[k, m + 1, j, i, 0]
        a1 = tab[k, m + 1, j, i + 1, 0]
        b0 = tab[k, m + 1, j, i, 1]
        b1 = tab[k, m + 1, j, i + 1, 1]
        if wr > 0.0:
            a0 += wr * (tab[k, m + 1, j + 1, i, 0] - a0)
            a1 += wr * (tab[k, m + 1, j + 1, i + 1, 0] - a1)
            b0 += wr * (tab[k, m + 1, j + 1, i, 1] - b0)
            b1 += wr * (tab[k, m + 1, j + 1, i + 1, 1] - b1)
        l0 += wm * (a0 - l0)
        l1 += wm * (a1 - l1)
        d0 += wm * (b0 - d0)
        d1 += wm * (b1 - d1)
    return l0 + wa * (l1 - l0), d0 + wa * (d1 - d0), (l1 - l0) * inv, (d1 - d0) * inv


@njit("always")
def _wrap(alpha):
    if alpha > math.pi:
        return alpha - 2.0 * math.pi
    if alpha < -math.pi:
        return alpha + 2.0 * math.pi
    return alpha


@njit()
def _open(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2):
    """Residual g(phi), dg/dphi and the element state of an open rotor."""
    s, c = _sincos(phi)
    sa = abs(s)
    sa_safe = max(sa, _EPS)
    W0 = UT * c + UP * s  # exact but for the drag term: the induced velocity is normal to W
    W2 = max(W0 * W0, 1e-12)
    cl, cd, cla, cda = _lookup(
        tab, k, _wrap(st[k, 3] - phi), lre0, W2, W2 * inv_a2, agrid, rgrid
    )
    cn = cl * c - cd * s
    ct = cl * s + cd * c
    F = 1.0
    dF = 0.0
    # st[:, 5:7] hold sqrt(f |sin phi|) of tip and hub, NaN-free and huge where the factor is off
    sw = sa_safe
    dlog = c / s if sa > _EPS else 0.0
    if num[N_FAR] > 0.0:
        # pitch of the vortex sheets in the far wake: tan(phi_w) = tan(phi) q^1.5, q = (2 w - V) / w
        w0 = s * W0
        q = 2.0
        dq = 0.0
        if UP != 0.0 and abs(w0) > 1e-9:
            ratio = UP / w0
            q = 2.0 - ratio
            if q > 2.0:
                q = 2.0
            elif q < 0.3:
                q = 0.3
            else:
                dq = ratio * (UT * (c * c - s * s) + 2.0 * UP * s * c) / w0
        rho = q * math.sqrt(q)
        inv = 1.0 / math.sqrt(c * c + rho * rho * sa_safe * sa_safe)
        sw = rho * sa_safe * inv
        dlog = (1.5 * dq / q + (1.0 / (s * c) if abs(s * c) > _EPS else 0.0)) * (c * inv) ** 2
    root = math.sqrt(1.0 / sw)
    u = st[k, 5] * root
    if u < _U_MAX:
        F, slope = _loss(u)
        F = max(F, 1e-6)
        dF = -0.5 * slope * u * dlog
    u = st[k, 6] * root
    if u < _U_MAX:
        Fh, slope = _loss(u)
        Fh = max(Fh, 1e-6)
        dF = dF * Fh - 0.5 * F * slope * u * dlog
        F *= Fh
    M = sa
    dM = c if s >= 0.0 else -c
    if num[N_BRIDGE] > 0.0 and UP != 0.0:
        y = s * W0 / UP
        if -1.0 < y < 0.6:
            W = max(abs(W0), 1e-9)
            M = mass_flow(y) * abs(UP) / W
            dM = 0.0  # a safeguarded step does not need it here
    swirl = num[N_SWIRL]
    q = 0.25 * st[k, 4]
    h = UT * s - UP * c
    g = F * M * h - q * (cn * UT + swirl * ct * UP)
    dcn = -cla * c - cl * s + cda * s - cd * c
    dct = -cla * s + cl * c - cda * c - cd * s
    dg = (dF * M + F * dM) * h + F * M * (UT * c + UP * s) - q * (dcn * UT + swirl * dct * UP)
    return g, dg, cl, cd, cla, cda, F, M, s, c


@njit()
def _ducted(phi, k, UT, V, st, tab, agrid, rgrid, num, lre0, inv_a2):
    """Residual of a ducted annulus (see bemt.duct for the derivation); phi > 0 only.

    With x = sigma ct / (4 F s), t = c + x, W = UT / t:
    G = UT^2 (F s^2 K - sigma cn (1 - leak) - 4 eta_s F x^2) + F K_lip max(UT s - V t, 0)^2 - F V^2 t^2,
    K = 1/sigma_w^2 + K_wall.
    """
    s, c = _sincos(phi)
    s = max(s, _EPS)
    root = math.sqrt(1.0 / s)
    Fp, _ = _loss(st[k, 5] * root)
    Fh, _ = _loss(st[k, 6] * root)
    # num[N_GAP]: 0 sealed by the wall, 1 open tip
    F = max(1.0 - num[N_GAP] * (1.0 - Fp), 1e-6) * max(Fh, 1e-6)
    alpha = _wrap(st[k, 3] - phi)
    sg = st[k, 4]
    W = UT * c
    cl, cd, _, _ = _lookup(tab, k, alpha, lre0, W * W, W * W * inv_a2, agrid, rgrid)
    ct = cl * s + cd * c
    W = UT / max(c + sg * ct / (4.0 * F * s), 0.05)
    cl, cd, _, _ = _lookup(tab, k, alpha, lre0, W * W, W * W * inv_a2, agrid, rgrid)
    cn = cl * c - cd * s
    ct = cl * s + cd * c
    x = sg * ct / (4.0 * F * s)
    t = c + x
    suck = max(UT * s - V * t, 0.0)
    G = UT * UT * (F * s * s * num[N_WAKE] - sg * cn * (1.0 - num[N_LEAK]) - 4.0 * num[N_STATOR] * F * x * x)
    G += F * (num[N_LIP] * suck * suck - V * V * t * t)
    return G, cl, cd, F, t


@njit()
def _residual(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2):
    if num[N_DUCTED] > 0.0:
        return _ducted(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)[0]
    return _open(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)[0]


@njit()
def _chandrupatla(a, b, fa, fb, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2):
    """Bracketed root (Chandrupatla 1997); fa and fb have opposite signs. Returns root and success."""
    c = a
    fc = fa
    t = 0.5
    for _ in range(200):
        x = a + t * (b - a)
        fx = _residual(x, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
        if (fx > 0.0) == (fa > 0.0):
            c = a
            fc = fa
        else:
            c = b
            b = a
            fc = fb
            fb = fa
        a = x
        fa = fx
        xm = a if abs(fa) < abs(fb) else b
        fm = fa if abs(fa) < abs(fb) else fb
        span = abs(b - a)
        tol = 2.0 * 1e-15 * abs(xm) + 1e-13
        if fm == 0.0 or span < tol:
            return xm, True
        xi = (a - b) / (c - b)
        ph = (fa - fb) / (fc - fb)
        if ph * ph < xi and (1 - ph) * (1 - ph) < 1 - xi:
            t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        else:
            t = 0.5
        tl = 0.5 * tol / span
        t = min(max(t, tl), 1.0 - tl)
    return a, False


@njit()
def _bracket(k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2):
    """The one bracket rule, from physics: which quadrant the flow through the element lies in.

    Open: g just above phi = 0 negative (positive loading against the onset flow) puts the root above zero, otherwise
    below; the quadrant next to zero first, the reversed one behind it.  Inside a quadrant the root nearest to the
    unstalled side (highest phi for positive lift) is found by stepping down from the far end, so that several roots
    near stall always give the same answer.
    """
    half = 0.5 * math.pi
    if num[N_DUCTED] > 0.0:
        lo = 1e-6
        hi = half
        flo = _residual(lo, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
        fhi = _residual(hi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
        if flo < 0.0 < fhi:
            return lo, hi, flo, fhi, True
        return lo, hi, flo, fhi, False
    f0 = _residual(0.0, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
    if f0 == 0.0:
        return 0.0, 0.0, f0, f0, True
    sign = 1.0 if f0 < 0.0 else -1.0
    near = 0.0
    fnear = f0
    far = sign * half
    ffar = _residual(far, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
    if (ffar > 0.0) == (fnear > 0.0):
        near, fnear = far, ffar
        far = sign * (math.pi - 1e-9)
        ffar = _residual(far, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
        if (ffar > 0.0) == (fnear > 0.0):
            return near, far, fnear, ffar, False
        return near, far, fnear, ffar, True
    # Step down from the windward end; the onset angle bounds the unstalled root from below.
    n = 12
    b = far
    fb = ffar
    for i in range(1, n):
        a = far + (near - far) * i / n
        fa = _residual(a, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
        if (fa > 0.0) != (fb > 0.0):
            return a, b, fa, fb, True
        b = a
        fb = fa
    return near, b, fnear, fb, True


@njit()
def _newton(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2, step_old):
    """Newton from a good guess; gives up (False) at the first sign of trouble, never loops."""
    for _ in range(8):
        g, dg, cl, cd, cla, cda, F, M, s, c = _open(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
        if dg <= 0.0:
            break
        d = g / dg
        if abs(d) > 0.5 * step_old:
            break
        if abs(d) < 1e-5:
            # carry the state along the last step instead of evaluating once more; the error is of order d^2
            return phi - d, True, cl + cla * d, cd + cda * d, F, M, s - c * d, c + s * d
        if phi * (phi - d) <= 0.0:
            break
        phi -= d
        step_old = abs(d)
    return phi, False, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0


@njit()
def _start(k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2):
    """First guess at the first station: straight lift curve through the table at 4 deg, no swirl, no losses.

    F sin(phi) (UT sin - UP cos) = sigma/4 UT cl with small angles is a quadratic in phi.
    """
    beta = st[k, 3]
    cl, _, cla, _ = _lookup(tab, k, 0.07, lre0, UT * UT, UT * UT * inv_a2, agrid, rgrid)
    a0 = 0.07 - cl / max(cla, 1.0)
    q = 0.25 * st[k, 4] * max(cla, 1.0)
    lam = UP / UT
    b = q - lam
    disc = b * b + 4.0 * q * (beta - a0)
    if disc <= 0.0:
        return 0.0
    return 0.5 * (-b + math.sqrt(disc))


@njit()
def solve_point(Omega, V, rho, mu, a_sound, st, inflow, tab, agrid, rgrid, num, B, out, radial):
    """Solve every station of one operating point and integrate.

    Parameters
    ----------
    Omega, V, rho, mu, a_sound : float
        Rotation speed [rad/s], axial onset speed [m/s], air density [kg/m3], viscosity [Pa s], sound speed [m/s].
    st : (N, 8) float
        r, dr, chord [m], beta [rad], local solidity, tip and hub loss exponent times sin(phi), log(chord).
    inflow : (N, 2) float
        Added axial and tangential onset speed at each station [m/s].
    tab : (N, Nm, Nr, Na, 2) float
        Section tables cl, cd.
    out : (8,) float
        T, Q, mass flow, mass flow times disk speed, stator thrust, worst status, its station, number of stations in
        the turbulent windmill or vortex-ring state.
    radial : (N, 11) or (0, 11) float
        Filled when it has rows: phi, alpha, cl, cd, W, w, v_t, F, dT, dQ, status.
    """
    n = st.shape[0]
    T = 0.0
    Q = 0.0
    mdot = 0.0
    jet = 0.0
    stat = 0.0
    worst = 0
    where = -1
    bits = 0
    inv_a2 = 1.0 / (a_sound * a_sound)
    ducted = num[N_DUCTED] > 0.0
    keep = radial.shape[0] == n
    have = 0
    p1 = 0.0
    p2 = 0.0
    r1 = 0.0
    r2 = 0.0
    log_rho_mu = math.log(rho / mu)
    # From the best loaded part of the blade to the root, then from there to the tip.
    mid = (2 * n) // 3
    first_p = 0.0
    first_r = 0.0
    st_phi_in = 0.0
    st_r_in = 1.0
    have_in = 0
    for j in range(n):
        if j <= mid:
            k = mid - j
        else:
            k = j
            if j == mid + 1:
                p2 = st_phi_in
                r2 = st_r_in
                p1 = first_p
                r1 = first_r
                have = have_in
        r = st[k, 0]
        UT = Omega * r + inflow[k, 1]
        UP = V + inflow[k, 0]
        lre0 = log_rho_mu + st[k, 7]
        status = OK
        done = False
        phi = 0.0
        cl = 0.0
        cd = 0.0
        F = 1.0
        M = 1.0
        t = 1.0
        s = 0.0
        c = 1.0
        if not ducted:
            if have == 0:
                phi = _start(k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
                limit = 0.3
            elif have == 1:
                phi = p1 * r1 / r  # helix
                limit = 0.2
            else:
                # in the tip direction phi bends little, towards the root it follows a helix: extrapolate r phi
                phi = (p1 * r1 + (p1 * r1 - p2 * r2) * (r - r1) / (r1 - r2)) / r
                limit = 0.2
            if 1e-3 < abs(phi) < 1.4:
                phi, done, cl, cd, F, M, s, c = _newton(
                    phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2, limit
                )
        if not done:
            lo, hi, flo, fhi, ok = _bracket(k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
            if not ok:
                status = NO_BRACKET
            else:
                if lo == hi:
                    phi = lo
                else:
                    phi, ok = _chandrupatla(lo, hi, flo, fhi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
                    if not ok:
                        status = NOT_CONVERGED
                if ducted:
                    _, cl, cd, F, t = _ducted(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
                else:
                    _, _, cl, cd, _, _, F, M, s, c = _open(phi, k, UT, UP, st, tab, agrid, rgrid, num, lre0, inv_a2)
                s, c = _sincos(phi)
        if status != OK:
            if status > worst:
                worst = status
                where = k
            have = 0
            if keep:
                for i in range(10):
                    radial[k, i] = np.nan
                radial[k, 10] = status
            continue
        cn = cl * c - cd * s
        ct = cl * s + cd * c
        sg = st[k, 4]
        if ducted:
            W = UT / t
            w = W * s
            vt = UT - W * c
            area = 2.0 * math.pi * r * st[k, 1]
            dm = rho * F * w * area
            st_t = num[N_STATOR] * 2.0 * rho * F * vt * vt * area
            mdot += dm
            jet += dm * w
            stat += st_t
        else:
            W = (UT * c + UP * s) / (1.0 + 0.25 * sg * cd / (F * max(M, _EPS)) * num[N_SWIRL])
            w = W * s
            vt = UT - W * c if num[N_SWIRL] > 0.0 else 0.0
            mdot += rho * F * w * 2.0 * math.pi * r * st[k, 1]
            if UP != 0.0:
                y = w / UP
                if -1.0 < y < 0.6:
                    bits += 1
        qd = 0.5 * rho * W * W * st[k, 2] * B * st[k, 1]
        dT = qd * cn * (1.0 - num[N_LEAK]) if ducted else qd * cn
        dQ = qd * ct * r
        T += dT
        Q += dQ
        p2 = p1
        r2 = r1
        p1 = phi
        r1 = r
        have = min(have + 1, 2)
        if j == 0:
            first_p = phi
            first_r = r
            have_in = 1
        if j == 1:
            st_phi_in = phi
            st_r_in = r
            have_in = have
        if keep:
            radial[k, 0] = phi
            radial[k, 1] = _wrap(st[k, 3] - phi)
            radial[k, 2] = cl
            radial[k, 3] = cd
            radial[k, 4] = W
            radial[k, 5] = w
            radial[k, 6] = vt
            radial[k, 7] = F
            radial[k, 8] = dT
            radial[k, 9] = dQ
            radial[k, 10] = status
    out[0] = T
    out[1] = Q
    out[2] = mdot
    out[3] = jet
    out[4] = stat
    out[5] = worst
    out[6] = where
    out[7] = bits


@njit()
def solve_batch(Omega, V, rho, mu, a_sound, st, inflow, tab, agrid, rgrid, num, B, out, radial):
    """Run :func:`solve_point` over points; ``radial`` is (npts, N, 11) or (npts, 0, 11)."""
    for i in range(Omega.shape[0]):
        solve_point(
            Omega[i], V[i], rho[i], mu[i], a_sound[i], st, inflow, tab, agrid, rgrid, num, B, out[i], radial[i]
        )

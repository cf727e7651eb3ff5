"""Residuals of one blade element, compiled: what must vanish at the right inflow angle, and its slope.

Everything here is branch-free and inlined: the lanes of :mod:`bemt.physics.bem.kernel` are the stations of a blade and
run as SIMD code.  SI, radians.  ``UT`` is the tangential and ``UP`` the axial onset speed at the element, ``phi`` the
inflow angle, ``alpha = beta - phi``, ``cn`` along the thrust, ``ct`` along the torque, ``sigma = B c / (2 pi r)``,
``w = W sin(phi)`` the axial speed through the disk, ``v_t`` half of the swirl behind it.

Open rotor.  With ``m`` the mass flow per area over density, thrust and torque balances of one annulus are::

    F m (w - UP) = sigma/4 W^2 cn        F m v_t = sigma/4 W^2 ct        W cos(phi) = UT - v_t

and elimination of W leaves a residual without a singularity at hover (Ning 2014 eq. 6-13 in another form)::

    g(phi) = F M (UT sin(phi) - UP cos(phi)) - sigma/4 (cn UT + ct UP),    M = m / W

In the propeller and windmill state M = abs(sin(phi)); from the turbulent windmill state (axial induction factor of a
turbine above 0.5) through the vortex-ring state, M follows the measured curve of :func:`mass_flow`.  With ``U`` and
``phi_in`` the size and direction of the onset flow and ``psi = phi - phi_in``::

    g / U = (F M + sigma/4 cd) sin(psi) - sigma/4 cl cos(psi)
    W     = U cos(psi) / (1 + sigma cd / (4 F M))

so g < 0 at psi = -90 deg and g > 0 at +90 deg for any table with cd > 0: a root with W > 0 always exists between.
Re, Mach number and the mass flow of the bridge take ``W0 = U cos(psi)``, which leaves out the drag term.

Without swirl v_t = 0, W = UT / cos(phi), and the terms of ``ct`` drop; the bracket is -90 to 90 deg of phi.

Ducted rotor (:mod:`bemt.physics.bem.duct` derives it).  With ``x = sigma ct / (4 F |s|)``, s = sin(phi), the torque
balance reads ``W t = UT, t = cos(phi) + x, v_t = W x``.  Speeds times t / UT, lam = V / UT: the mean of the annulus ``w
= G s + (1 - G) w_V lam t``, w_V = (1 + k_V) / k_w, the jet ``j = k_w w - k_V lam t`` with the bend of
:mod:`bemt.physics.bem.duct`; and Bernoulli's equation across the disk, times (t / UT)^2, becomes::

    g = j |j| + K_wall w |w| + K_lip max(w - lam t, 0)^2 - lam |lam| t^2 - 4 eta (F max(x, 0) s / w)^2
        - sigma cn (1 - leak)

F is the wake's: the mean of the speed that its sheets induce over that on them.  A blade is where they begin and sees
half of the difference, in a duct as in the open, and the speed that walls induce as it is::

    w_b - w = (1/F - 1) (V_j - V) / 2,   so   w - w_V V = G (w_b - w_V V),   1/G = 1 + (1/F - 1) k_w / 2

which is F for the open rotor (k_w = 2, k_V = 1) and 2 F / (1 + F) in a pipe; the bend is left out of G.
The stator's vanes are set for the swirl of a driving rotor and turn no other.  t > 0 around phi = 0; where it reaches
zero (W grows without bound) g is positive for phi > 0 and negative for phi < 0, so here too a root always exists; a
negative one is flow reversed through the duct.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, disable-error-code="attr-defined"
# (numba erases signatures)

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bemt.physics.bem.vecmath import inlined, log, sincos

# Indices of the numbers that effects and duct may set (array ``num``).
N_TIP, N_HUB, N_SWIRL, N_BRIDGE, N_DUCTED, N_WAKE, N_LIP, N_STATOR, N_GAP, N_LEAK, N_FAR, N_WALL, N_STREAM = range(13)
N_BEND, N_LEFT, N_LENGTH = 13, 14, 15
N_NUM = 16

# Reynolds numbers of V and a duct's length between which the stream comes to follow the outer nose at light load:
# NeuralFoil on the section of nozzle 19A at -8 deg, cd 0.094, 0.091, 0.036 and 0.018 at 2e5, 4e5, 5e5 and 1e6.
RE_LEFT, RE_HELD = 4e5, 6e5

_EPS = 1e-9
_TWO_PI = 2.0 * math.pi

# Prandtl factor F(u), u = sqrt(f): smooth in u, so a cubic Hermite table of it is exact to 1e-11 and needs neither exp
# nor acos in the inner loop.  Rows F, dF/du; 1 - F is 1e-9 where the table ends.
_U_MAX = 4.5
_U_STEP = _U_MAX / 900.0
_U_INV = 1.0 / _U_STEP


def _prandtl_table() -> Any:
    u = np.arange(902) * _U_STEP
    f = u * u
    F = (2.0 / math.pi) * np.arccos(np.exp(-f))
    slope = np.full_like(u, (2.0 / math.pi) * math.sqrt(2.0))
    slope[1:] = (4.0 / math.pi) * u[1:] * np.exp(-f[1:]) / np.sqrt(-np.expm1(-2.0 * f[1:]))
    F[900:] = 1.0
    slope[900:] = 0.0
    return np.ascontiguousarray(np.stack([F, slope * _U_STEP], axis=1).ravel())


_PRANDTL = _prandtl_table()


@inlined
def loss(u):
    """Prandtl factor (2/pi) acos(exp(-u^2)) and its derivative with respect to u; not a number counts as large."""
    x = (u if u < _U_MAX else _U_MAX) * _U_INV
    i = np.int32(x)
    t = x - i
    k = np.uint64(2 * i)
    f0 = _PRANDTL[k]
    m0 = _PRANDTL[k + np.uint64(1)]
    f1 = _PRANDTL[k + np.uint64(2)]
    m1 = _PRANDTL[k + np.uint64(3)]
    a = 2.0 * (f0 - f1) + m0 + m1
    b = 3.0 * (f1 - f0) - 2.0 * m0 - m1
    return ((a * t + b) * t + m0) * t + f0, ((3.0 * a * t + 2.0 * b) * t + m0) * _U_INV


# Induced speed over that of hover at the same thrust, over the sink rate likewise, as measured: Leishman (2006),
# Principles of Helicopter Aerodynamics, 2nd ed., sec. 2.14.3, with kappa = 1. Public codes that cite it have the same
# coefficients up to a sink rate of 2, with kappa 0.974 to 1.15; the book itself was not checked.
_DESCENT = (1.0, 1.125, -1.372, 1.718, -0.655)
_S_STEP = 1e-3
# Momentum theory holds to a sink rate of x = 0.45, where the vortex ring begins (Johnson 2005, NASA/TP-2005-213477,
# p. 24); from there to x = 1 it passes to the curve (own choice). A wall below acts as such a slow descent.
_S_RING = 0.45 / (0.225 + math.sqrt(0.225**2 + 1.0))


def _mass_table() -> tuple[Any, float]:
    """Mass flow in descent over the induced speed, over s = abs(UP) / v, and the s where momentum theory takes over."""
    x = np.linspace(0.0, 2.01, 20101)
    v = np.polynomial.polynomial.polyval(x, _DESCENT)
    s, share = x / v, v**-2.0
    end = float(np.interp(0.0, (s - 1.0 - share)[20000:], s[20000:]))  # the windmill state has m = abs(UP) - v
    at = np.arange(2503) * _S_STEP
    b = np.clip((at - _S_RING) / (float(np.interp(1.0, x, s)) - _S_RING), 0.0, 1.0)
    b = b * b * (3.0 - 2.0 * b)
    ring = (1.0 - b) * np.abs(at - 1.0) + b * np.interp(at, s, share)
    return np.where(at < end, ring, at - 1.0), end


_MASS, _S_BRAKE = _mass_table()
Y_BRAKE = 1.0 - 1.0 / _S_BRAKE
Y_RING = 1.0 - 1.0 / _S_RING


@inlined
def mass_flow(y):
    """Mass flow per area over ``rho |UP|`` for ``y = w / UP`` up to 0.6, and its derivative.

    The measured curve of helicopter rotors in descent, from the vortex-ring state (y = -1.8) to the windmill state
    (y = 0.488), and momentum theory on both sides, hover being y at minus infinity.  As ``m v`` is the square of the
    induced speed in hover, ``m = v / x_v^2``, with ``v = w - UP`` and x_v = v over that speed.  A propeller that brakes
    in wind from the front is the mirror image of a rotor in descent.
    """
    a = 1.0 - y
    i_a = 1.0 / (a if a > 0.4 else 0.4)
    x = i_a * (1.0 / _S_STEP)
    i = np.int32(x)
    k = np.uint64(i)
    g = _MASS[k]
    dg = _MASS[k + np.uint64(1)] - g
    g += (x - i) * dg
    return g * a, dg * (1.0 / _S_STEP) * i_a - g


@inlined
def _alpha_cell(alpha, g):
    """Lower index, weight and reciprocal spacing on the two-zone angle grid, any turn of alpha."""
    alpha = alpha - _TWO_PI * math.floor(alpha * (1.0 / _TWO_PI) + 0.5)
    low = alpha < g[0]
    high = alpha > g[1]
    inv = g[3] if (low or high) else g[2]
    start = -math.pi if low else (g[1] if high else g[0])
    first = 0.0 if low else (g[5] if high else g[4])
    x = (alpha - start) * inv + first
    e = x if x > 0.0 else 0.0
    e = e if e < g[6] else g[6]
    i = np.int32(e)
    return i, x - i, inv


@inlined
def lookup_plain(alpha, lre0, W2, base, tab, g):
    """cl, cd, their slopes in alpha and (none here) in ln W, from tables without Reynolds and Mach axes.

    ``lre0`` is ln(rho chord / mu), ``base`` where the station's tables start in the flat array ``tab``, ``g`` the grid
    numbers packed by :mod:`bemt.physics.bem.kernel`.
    """
    i, wa, inv = _alpha_cell(alpha, g)
    p = np.uint64(base + 2 * i)
    l0 = tab[p]
    d0 = tab[p + np.uint64(1)]
    dl = tab[p + np.uint64(2)] - l0
    dd = tab[p + np.uint64(3)] - d0
    return l0 + wa * dl, d0 + wa * dd, dl * inv, dd * inv, 0.0, 0.0


@inlined
def _flow_cell(lre0, W2, g):
    """Lower index, weight and slope in ln W on the axes of ln Re and of the squared Mach number, held at their ends."""
    x = (lre0 + 0.5 * log(W2 if W2 > 1e-12 else 1e-12) - g[7]) * g[8]
    r_slope = g[8] if (x > 0.0 and x < g[9]) else 0.0
    x = x if x > 0.0 else 0.0
    x = x if x < g[9] else g[9]
    e = x if x < g[9] - 1.0 else g[9] - 1.0
    j = np.int32(e)
    wr = x - j
    y = W2 * g[10]
    m_slope = 2.0 * y if y < g[11] else 0.0
    y = y if y < g[11] else g[11]
    e = y if y < g[11] - 1.0 else g[11] - 1.0
    m = np.int32(e)
    wm = y - m
    return j, wr, r_slope, m, wm, m_slope


@inlined
def lookup_full(alpha, lre0, W2, base, tab, g):
    """Like :func:`lookup_plain`, linear in alpha, ln Re and Mach number squared, held at the ends of both."""
    i, wa, inv = _alpha_cell(alpha, g)
    j, wr, r_slope, m, wm, m_slope = _flow_cell(lre0, W2, g)
    p0 = base + m * np.int32(g[12]) + j * np.int32(g[13]) + 2 * i
    l00, sl00, d00, sd00 = _cell(tab, p0, wa)
    l01, sl01, d01, sd01 = _cell(tab, p0 + np.int32(g[13]), wa)
    p0 = p0 + np.int32(g[12])
    l10, sl10, d10, sd10 = _cell(tab, p0, wa)
    l11, sl11, d11, sd11 = _cell(tab, p0 + np.int32(g[13]), wa)
    l0 = l00 + wm * (l10 - l00)
    l1 = l01 + wm * (l11 - l01)
    d0 = d00 + wm * (d10 - d00)
    d1 = d01 + wm * (d11 - d01)
    sl0 = sl00 + wm * (sl10 - sl00)
    sl1 = sl01 + wm * (sl11 - sl01)
    sd0 = sd00 + wm * (sd10 - sd00)
    sd1 = sd01 + wm * (sd11 - sd01)
    lm = l10 - l00 + wr * (l11 - l01 - l10 + l00)
    dm = d10 - d00 + wr * (d11 - d01 - d10 + d00)
    return (l0 + wr * (l1 - l0), d0 + wr * (d1 - d0), (sl0 + wr * (sl1 - sl0)) * inv, (sd0 + wr * (sd1 - sd0)) * inv,
            r_slope * (l1 - l0) + m_slope * lm, r_slope * (d1 - d0) + m_slope * dm)  # fmt: skip


@inlined
def lookup_factored(alpha, lre0, W2, base, tab, g):
    """Like :func:`lookup_full`, from cl0(Re) times a factor of Mach number, and cd0(Re) plus an addition of it."""
    i, wa, inv = _alpha_cell(alpha, g)
    j, wr, r_slope, m, wm, m_slope = _flow_cell(lre0, W2, g)
    p0 = base + j * np.int32(g[13]) + 2 * i
    q0 = base + np.int32(g[14]) + m * np.int32(g[12]) + 2 * i
    a0, a1, d0, sd0 = _ends(tab, p0)
    b0, b1, d1, sd1 = _ends(tab, p0 + np.int32(g[13]))
    k0, k1, e0, se0 = _ends(tab, q0)
    n0, n1, e1, se1 = _ends(tab, q0 + np.int32(g[12]))
    # at either angle: a product of straight lines in ln Re and in the squared Mach number
    dr0 = b0 - a0
    dr1 = b1 - a1
    dm0 = n0 - k0
    dm1 = n1 - k1
    r0 = a0 + wr * dr0
    r1 = a1 + wr * dr1
    m0 = k0 + wm * dm0
    m1 = k1 + wm * dm1
    l0 = r0 * m0
    dl = r1 * m1 - l0
    lr0 = dr0 * m0
    lr = lr0 + wa * (dr1 * m1 - lr0)
    lm0 = r0 * dm0
    lm = lm0 + wa * (r1 * dm1 - lm0)
    dr = d1 - d0 + wa * (sd1 - sd0)
    dm = e1 - e0 + wa * (se1 - se0)
    dd = sd0 + wr * (sd1 - sd0) + se0 + wm * (se1 - se0)
    return (l0 + wa * dl, d0 + wa * sd0 + wr * dr + e0 + wa * se0 + wm * dm, dl * inv, dd * inv,
            r_slope * lr + m_slope * lm, r_slope * dr + m_slope * dm)  # fmt: skip


@inlined
def _ends(tab, p0):
    p = np.uint64(p0)
    d0 = tab[p + np.uint64(1)]
    return tab[p], tab[p + np.uint64(2)], d0, tab[p + np.uint64(3)] - d0


@inlined
def _cell(tab, p0, wa):
    p = np.uint64(p0)
    l0 = tab[p]
    d0 = tab[p + np.uint64(1)]
    dl = tab[p + np.uint64(2)] - l0
    dd = tab[p + np.uint64(3)] - d0
    return l0 + wa * dl, dl, d0 + wa * dd, dd


@inlined
def mean_share(F, k_w):
    """Share G of the rotor's own axial speed at the blade that is the mean of the annulus, and dG/dF."""
    i_G = 1.0 + 0.5 * (1.0 / F - 1.0) * k_w
    return 1.0 / i_G, 0.5 * k_w / (F * F * i_G * i_G)


@inlined
def mass_share(s, w):
    """Axial speed at the blade over the mean of the annulus, held between 0 and 3."""
    q = s / w if s * w > 0.0 else 0.0
    return q if q < 3.0 else 3.0


@inlined
def jet_speed(w, V, fx):
    """Speed of the jet far behind for a mean speed w of the annulus in a stream V, and its slopes in both."""
    k_w = fx[N_WAKE]
    idle = 1.0 + fx[N_STREAM]
    y = k_w * w
    rise = y - idle * V
    i_size = 1.0 / math.sqrt(y * y + V * V + 1e-30)
    part = fx[N_BEND] * i_size if V > 0.0 else 0.0
    over = part * V * rise * i_size * i_size
    by_w = k_w * (1.0 + part * V - over * y)
    by_V = 1.0 - idle + part * (rise - idle * V) - over * V
    return V + rise * (1.0 + part * V), by_w, by_V


@inlined
def open_rotor(lookup, phi, UT, UP, i_UP, beta, sg4, tip, hub, lre0, base, tab, g, fx):
    """Residual of an open rotor at one element. [m/s]"""
    s, c = sincos(phi)
    sa = abs(s)
    swirl = fx[N_SWIRL]
    along = UT * c + UP * s
    across = UT * s - UP * c
    # one division for 1/sin, 1/W0 and 1/w0
    ss = s if sa > _EPS else (_EPS if s >= 0.0 else -_EPS)
    W0 = along if along > _EPS else _EPS
    w0 = ss * W0
    i_w = 1.0 / w0
    dlnW = -across * ss * i_w
    cl, cd, cla, cda, clw, cdw = lookup(beta - phi, lre0, W0 * W0, base, tab, g)
    dcl = clw * dlnW - cla
    dcd = cdw * dlnW - cda
    dw0 = c * W0 - ss * across
    # Prandtl: u = u0 Y^(1/4), Y = 1 / sin^2 of the sheet angle at the disk, or tan(phi_w) = tan(phi) q^1.5 behind it
    ratio = UP * i_w
    q = 2.0 - ratio
    dq = ratio * dw0 * i_w if (q > 0.3 and q < 3.0) else 0.0
    # 3 where descent leaves momentum theory (y = -1), 0.3 where the turbulent windmill does (y = 0.6)
    q = q if q < 3.0 else 3.0
    q = q if q > 0.3 else 0.3
    far = fx[N_FAR] > 0.0
    q2s = q * q * ss
    p = q2s * q * ss if far else ss * ss
    dp = q2s * (3.0 * dq * ss + 2.0 * q * c) if far else 2.0 * ss * c
    n = c * c + p if far else 1.0
    dn = dp - 2.0 * c * s if far else 0.0
    r = 1.0 / (p * n)
    root = math.sqrt(math.sqrt(n * n * r))
    dln = 0.25 * r * (dn * p - dp * n)
    u = tip * root
    Ft, slope = loss(u)
    Ft = Ft if Ft > 1e-6 else 1e-6
    dFt = slope * u * dln if u < _U_MAX else 0.0
    u = hub * root
    Fh, slope = loss(u)
    Fh = Fh if Fh > 1e-6 else 1e-6
    dFh = slope * u * dln if u < _U_MAX else 0.0
    F = Ft * Fh
    dF = dFt * Fh + Ft * dFh
    y = w0 * i_UP
    zone = fx[N_BRIDGE] > 0.0 and i_UP != 0.0 and y < 0.6 and y > Y_RING
    f, df = mass_flow(y)
    m = abs(UP) * (ss * i_w)
    M = f * m if zone else sa
    dM = m * (df * dw0 * i_UP - f * dlnW) if zone else (c if s >= 0.0 else -c)
    ctUP = swirl * UP
    cn = cl * c - cd * s
    ct = cl * s + cd * c
    dcn = dcl * c - cl * s - dcd * s - cd * c
    dct = dcl * s + cl * c + dcd * c - cd * s
    FM = F * M
    dFM = dF * M + F * dM
    res = FM * across - sg4 * (cn * UT + ct * ctUP)
    slope = dFM * across + FM * along - sg4 * (dcn * UT + dct * ctUP)
    return res, slope, cl, cd, dcl, dcd, F, dF, FM, dFM, s, c


@inlined
def ducted_rotor(lookup, phi, UT, UP, i_UP, beta, sg4, tip, hub, lre0, base, tab, g, fx):
    """Residual of a ducted annulus over UT; parameters as :func:`open_rotor`, t in the place of F M."""
    s, c = sincos(phi)
    sa = abs(s)
    sa = sa if sa > _EPS else _EPS
    sign = 1.0 if s >= 0.0 else -1.0
    i_s = 1.0 / sa
    root = math.sqrt(i_s)
    dln = -0.5 * c * sign * i_s
    u = tip * root
    Ft, slope = loss(u)
    # 0 sealed by the wall, 1 open tip
    Ft = 1.0 - fx[N_GAP] * (1.0 - Ft)
    Ft = Ft if Ft > 1e-6 else 1e-6
    dFt = fx[N_GAP] * slope * u * dln if u < _U_MAX else 0.0
    u = hub * root
    Fh, slope = loss(u)
    Fh = Fh if Fh > 1e-6 else 1e-6
    dFh = slope * u * dln if u < _U_MAX else 0.0
    F = Ft * Fh
    dF = dFt * Fh + Ft * dFh
    # an annulus that the blades leave alone has no speed of its own
    free = F > 1e-3
    F = F if free else 1e-3
    dF = dF if free else 0.0
    load = fx[N_SWIRL] * sg4 / F * i_s
    dload = -load * (dF / F + c * sign * i_s)
    # Re and Mach number need W, which needs ct: once without swirl, then with it
    free = c > 0.25
    W = UT / (c if free else 0.25)
    dlnW = s / c if free else 0.0
    cl, cd, cla, cda, clw, cdw = lookup(beta - phi, lre0, W * W, base, tab, g)
    ct = cl * s + cd * c
    dct = (clw * dlnW - cla) * s + cl * c + (cdw * dlnW - cda) * c - cd * s
    t = c + load * ct
    free = t > 0.25
    t = t if free else 0.25
    W = UT / t
    dlnW = (s - dload * ct - load * dct) / t if free else 0.0
    cl, cd, cla, cda, clw, cdw = lookup(beta - phi, lre0, W * W, base, tab, g)
    dcl = clw * dlnW - cla
    dcd = cdw * dlnW - cda
    cn = cl * c - cd * s
    ct = cl * s + cd * c
    dcn = dcl * c - cl * s - dcd * s - cd * c
    dct = dcl * s + cl * c + dcd * c - cd * s
    x = load * ct
    dx = load * dct + dload * ct
    t = c + x
    dt = dx - s
    xp = x if x > 0.0 else 0.0
    lam = UP / UT
    idle = (1.0 + fx[N_STREAM]) / fx[N_WAKE] * lam
    G, dG = mean_share(F, fx[N_WAKE])
    w = G * s + (1.0 - G) * idle * t
    dw = dG * dF * (s - idle * t) + G * c + (1.0 - G) * idle * dt
    suck = w - lam * t
    suck = suck if suck > 0.0 else 0.0
    jet, djet_w, djet_V = jet_speed(w, lam * t, fx)
    wall = fx[N_WALL]
    lip = fx[N_LIP]
    eta = 4.0 * fx[N_STATOR]
    keep = 4.0 * sg4 * (1.0 - fx[N_LEAK])
    ram = lam * abs(lam)
    # mean swirl behind the blades, which carries their torque with the mean flow
    q = mass_share(s, w)
    free = q > 0.0 and q < 3.0
    dq = (c - q * dw) / w if free else 0.0
    turned = F * xp * q
    dturned = (F * dx + dF * xp) * q + F * xp * dq
    res = jet * abs(jet) + wall * w * abs(w) - eta * turned * turned + lip * suck * suck - ram * t * t - keep * cn
    slope = abs(jet) * (djet_w * dw + djet_V * lam * dt) + wall * abs(w) * dw - eta * turned * dturned
    slope = 2.0 * (slope + lip * suck * (dw - lam * dt) - ram * t * dt) - keep * dcn
    low = t < 1e-3
    res = sign if low else res
    slope = 0.0 if low else slope
    return res, slope, cl, cd, dcl, dcd, F, dF, t, dt, s, c

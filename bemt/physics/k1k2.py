"""The K1/K2 model: thrust of an open propeller from diameter, pitch and speed alone.

With the pitch speed v_p = n p and the disk area A::

    F = rho A (v_p^2 - v_p V) (K1 D/p)^K2,      K1 = 1/3.29546,  K2 = 1.5

It knows neither chord, section, blade count, Reynolds nor Mach number, and no duct.  It is kept because it is widely
used, and as the yardstick that a blade element solver has to beat.

References
----------
.. [1] G. Staples, "Propeller Static & Dynamic Thrust Calculation", part 1, 16 July 2013, and part 2 ("How did I come
       up with this equation?"), 12 April 2014, electricrcaircraftguy.com.  K2 was set by trial, K1 by goal seek on 149
       vendor points (not published).  Claim: static, 68 % of points within 13 %, 95 % within 26 %; thrust in flight
       15 to 30 % too low.
.. [2] T. Cahill, "System Identification of Thrust and Torque Characteristics for a Bipedal Robot with Integrated
       Propulsion", MS thesis, Northeastern University, 2025: uses [1]; its final printed equation is dimensionally
       wrong, see ``reports/studies/thesis.py``.
.. [3] F. E. Weick, "Full Scale Tests on a Thin Metal Propeller at Various Tip Speeds", NACA Report 302, 1928: effect of
       tip speed on efficiency negligible from 0.6 to 0.9 of the speed of sound (read in the summary).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.dataset import Dataset

K1 = 1.0 / 3.29546
"""Coefficient of D/p [-], reference [1]."""
K2 = 1.5
"""Exponent [-], reference [1]."""
RHO_FIXED = 1.225
"""Density that the sources fix [kg/m3]; an argument here."""
D_OVER_P_USABLE = (0.5, 2.5)
"""Usable range of D/p stated by [1] [-]."""
D_OVER_P_BEST = (0.8, 1.8)
"""Best range of D/p stated by [1] [-]."""
U_MEASURED = 0.196
"""Standard deviation of F/measured on 4122 static points of 248 UIUC propellers, nominal D and p, nothing fitted [-];
`reports/studies/reproduce.py` recomputes it where the data are."""
M_TIP_LIMIT = 0.9
"""Tip Mach number above which a model without Mach number is flagged [-]: upper end of the tests of [3]."""
ZERO_THRUST_MEASURED = 1.19
"""Measured zero-thrust J over P/D, mean over UIUC propellers [-]; the formula says 1."""
FLIGHT_RATIO = ((0.1, 0.3, 0.5, 0.7, 0.9), (0.86, 0.77, 0.64, 0.53, 0.31))
"""Median F/measured in flight [-] over J/(P/D) [-], bins of 0.2, 9257 points of 128 UIUC propellers of volumes 1-2,
nominal D and p; `reports/studies/reproduce.py` recomputes it where the data are."""


def corrected_equation(rho: Any, area: Any, v_pitch: Any, V: Any, d_over_p: Any, K1: float = K1, K2: float = K2) -> Any:
    """K1/K2 equation in its right form, every term inside the bracket. [N]

    >>> round(corrected_equation(1.225, 1.0, 10.0, 5.0, 3.29546), 3)
    61.25
    """
    return rho * area * (v_pitch**2 - v_pitch * V) * (K1 * d_over_p) ** K2


def _check(D: Array, pitch: Array, rpm: Array, V: Array, rho: Array, hub: Array) -> None:
    tests = (
        ("diameter_m", D, (D > 0) & (D < 100), "a positive length", "Inches or millimetres given?"),
        ("pitch_m", pitch, (pitch > 0) & (pitch < 100), "a positive length", "Inches or millimetres given?"),
        ("rpm", rpm, rpm >= 0, "0 rev/min or more", "The model has no sense of rotation"),
        ("airspeed_m_s", V, np.isfinite(V), "a finite speed", ""),
        ("rho", rho, (rho > 0) & np.isfinite(rho), "a positive density", ""),
        ("hub_diameter_m", hub, hub >= 0, "0 or more", ""),
    )
    faults = [
        Fault("", name, f"{float(x[~np.broadcast_to(ok, x.shape)].ravel()[0]):g}", expected, hint)
        for name, x, ok, expected, hint in tests
        if not np.all(ok & np.isfinite(x))
    ]
    if not faults and np.any(hub >= D):
        faults.append(Fault("", "hub_diameter_m", f"{float(np.max(hub)):g}", "less than the diameter"))
    refuse(faults)


def pitch_speed(rpm: ArrayLike, pitch_m: ArrayLike) -> Any:
    """Advance of a screw in still air. [m/s]

    >>> pitch_speed(6000.0, 0.127)
    12.7
    """
    return co.airspeed(1.0, np.asarray(rpm, dtype=float) / 60.0, pitch_m)


def zero_thrust_J(diameter_m: ArrayLike, pitch_m: ArrayLike) -> Any:
    """Advance ratio at which the formula gives no thrust. [-]

    Measured on UIUC propellers it is 1.19 P/D on average: zero lift is not zero blade angle on a cambered section.

    >>> zero_thrust_J(0.2032, 0.127)
    0.625
    """
    out = np.asarray(pitch_m, dtype=float) / np.asarray(diameter_m, dtype=float)
    return float(out) if out.ndim == 0 else out


def thrust(
    diameter_m: ArrayLike, pitch_m: ArrayLike, rpm: ArrayLike, V: ArrayLike = 0.0, rho: ArrayLike = RHO_FIXED,
    hub_diameter_m: ArrayLike = 0.0, K1: float = K1, K2: float = K2,
) -> Any:  # fmt: skip
    """Thrust by the K1/K2 model, with fitted constants if they are given. [N]

    Reference [1] of the module, final equation of part 1.  Its worked example: 10x6 at 10 500 rev/min, 1619 gf.

    >>> round(1000 * thrust(10 * 0.0254, 6 * 0.0254, 10500.0) / 9.80665)
    1619
    >>> [round(thrust(d * 0.0254, p * 0.0254, 20000.0) / 9.80665, 3) for d, p in ((8, 5), (10, 5), (12, 6), (14, 8))]
    [2.456, 5.363, 11.121, 22.025]
    """
    D, p, w, v, r, h = (np.asarray(x, dtype=float) for x in (diameter_m, pitch_m, rpm, V, rho, hub_diameter_m))
    _check(D, p, w, v, r, h)
    F = corrected_equation(r, np.pi / 4.0 * (D**2 - h**2), w / 60.0 * p, v, D / p, K1, K2)
    return float(F) if np.ndim(F) == 0 else F


def validity_flags(d_over_p: float, M_tip: float = 0.0, J: float = 0.0, ducted: bool = False) -> tuple[str, ...]:
    """Say why the model should not be trusted at a point.

    >>> validity_flags(1.6, 0.63)
    ()
    >>> validity_flags(1.75, 1.09)
    ('tip Mach 1.09 is supersonic: K1/K2 has no Mach number effects',)
    """
    out = []
    low, high = D_OVER_P_USABLE
    best_low, best_high = D_OVER_P_BEST
    tol = 1e-9
    if not low - tol <= d_over_p <= high + tol:
        out.append(f"D/p {d_over_p:.2f} outside the usable range {low:g}-{high:g}")
    elif not best_low - tol <= d_over_p <= best_high + tol:
        out.append(f"D/p {d_over_p:.2f} outside the best range {best_low:g}-{best_high:g}")
    if M_tip >= 1.0:
        out.append(f"tip Mach {M_tip:.2f} is supersonic: K1/K2 has no Mach number effects")
    elif M_tip > M_TIP_LIMIT:
        out.append(f"tip Mach {M_tip:.2f} above {M_TIP_LIMIT:g}: K1/K2 has no Mach number effects")
    if ducted:
        out.append("ducted: K1/K2 is a fit to open propellers (no duct, cascade or stator)")
    x = J * d_over_p
    if x < 0.0:
        out.append("airspeed from behind: outside the model")
    elif x > 1.0 + tol:
        out.append(f"above the pitch speed: thrust negative, measured zero-thrust J is {ZERO_THRUST_MEASURED} P/D")
    elif x > 0.0:
        ratio = float(np.interp(x, *FLIGHT_RATIO))
        out.append(f"J/(P/D) {x:.2f}: in flight K1/K2 reads low, about {ratio:.2f} of measured (UIUC median)")
    return tuple(out)


def estimate(
    diameter_m: ArrayLike, pitch_m: ArrayLike, rpm: ArrayLike, V: ArrayLike = 0.0, air: Air | None = None,
    hub_diameter_m: ArrayLike = 0.0, ducted: bool = False, K1: float = K1, K2: float = K2, share: float = U_MEASURED,
) -> Dataset:  # fmt: skip
    """Thrust by the K1/K2 model with coefficients, uncertainty (`share` of the static thrust) and flags.

    >>> from bemt.base.units import KGF
    >>> e = estimate(14 * 0.0254, 8 * 0.0254, 20000.0)
    >>> (e.thrust_N / KGF).round(3), e.flags[0]
    (array([22.025]), ('tip Mach 1.09 is supersonic: K1/K2 has no Mach number effects',))
    """
    air = Air.from_density() if air is None else air
    names = (diameter_m, pitch_m, rpm, V, air.rho, air.a_sound, hub_diameter_m)
    D, p, w, v, rho, a, h = (np.ravel(x) for x in np.broadcast_arrays(*(np.asarray(x, float) for x in names)))
    F = np.asarray(thrust(D, p, w, v, rho, h, K1, K2), dtype=float)
    n = w / 60.0
    J = np.asarray(co.J(v, n, D))
    M = np.asarray(co.M_tip(n, D, a))
    # without rotation J is NaN: the sign of V decides then
    J_flag = np.where(np.isnan(J), np.copysign(np.where(v == 0, 0.0, np.inf), v), J)
    flags = tuple(validity_flags(d, m, j, ducted) for d, m, j in zip(D / p, M, J_flag, strict=True))
    u = np.where((v == 0) & (not ducted), share * F, np.nan)
    values = {"thrust_N": F, "rpm": w, "airspeed_m_s": v, "density_kg_m3": rho, "CT": co.CT(F, rho, n, D), "J": J,
              "M_tip": M}  # fmt: skip
    return Dataset("k1k2", "K1/K2", values, {"thrust_N": np.abs(u)}, flags)

"""Coefficients of a propeller or rotor, and the conversions between the two conventions.

PROPELLER convention (used everywhere in this project): CT = T/(rho n^2 D^4), CQ = Q/(rho n^2 D^5),
CP = P/(rho n^3 D^5) = 2 pi CQ, J = V/(n D), with n in revolutions per second.
HELICOPTER convention (suffix ``_rotor``): CT_rotor = T/(rho A (Omega R)^2), CP_rotor = P/(rho A (Omega R)^3),
CQ_rotor = Q/(rho A (Omega R)^2 R) = CP_rotor.

Arguments broadcast: thrust T [N], torque Q [N m], shaft power P [W], density rho [kg/m3], n [rev/s], diameter D [m],
axial airspeed V [m/s], speed of sound a_sound [m/s], viscosity mu [Pa s], chord [m].  A coefficient at n <= 0 is NaN.

References
----------
.. [1] B. W. McCormick, "Aerodynamics, Aeronautics and Flight Mechanics", 2nd ed., Wiley, 1995, ch. 6 (propeller
       coefficients; not checked against the book).
.. [2] J. G. Leishman, "Principles of Helicopter Aerodynamics", 2nd ed., Cambridge, 2006, secs. 2.3, 2.8 (rotor
       coefficients, figure of merit; not checked against the book).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

CT_PER_ROTOR = math.pi**3 / 4.0
"""CT / CT_rotor [-]: A (Omega R)^2 = (pi^3/4) n^2 D^4."""
CP_PER_ROTOR = math.pi**4 / 4.0
"""CP / CP_rotor [-]: A (Omega R)^3 = (pi^4/4) n^3 D^5."""
CQ_PER_ROTOR = math.pi**3 / 8.0
"""CQ / CQ_rotor [-]: A (Omega R)^2 R = (pi^3/8) n^2 D^5."""


def _f(x: ArrayLike) -> np.ndarray:
    return np.asarray(x, dtype=float)


def _out(x: np.ndarray) -> Any:
    """Give a float for scalar input, an array otherwise."""
    return float(x) if np.ndim(x) == 0 else x


def _ratio(num: ArrayLike, den: ArrayLike, valid: ArrayLike) -> Any:
    num, den, valid = np.broadcast_arrays(_f(num), _f(den), np.asarray(valid, dtype=bool))
    return _out(np.divide(num, den, out=np.full(num.shape, np.nan), where=valid))


def CT(T: ArrayLike, rho: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Thrust coefficient CT = T/(rho n^2 D^4); NaN where n <= 0.

    >>> round(CT(2.60 * 9.80665, 1.225, 20000 / 60, 8 * 0.0254), 3)
    0.11
    """
    rho, n, D = _f(rho), _f(n), _f(D)
    return _ratio(T, rho * n**2 * D**4, n > 0)


def CQ(Q: ArrayLike, rho: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Torque coefficient CQ = Q/(rho n^2 D^5); NaN where n <= 0.

    >>> CQ(0.5, 1.0, 10.0, 1.0)
    0.005
    """
    rho, n, D = _f(rho), _f(n), _f(D)
    return _ratio(Q, rho * n**2 * D**5, n > 0)


def CP(P: ArrayLike, rho: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Power coefficient CP = P/(rho n^3 D^5); NaN where n <= 0.

    >>> CP(50.0, 1.0, 10.0, 1.0)
    0.05
    """
    rho, n, D = _f(rho), _f(n), _f(D)
    return _ratio(P, rho * n**3 * D**5, n > 0)


def thrust(CT: ArrayLike, rho: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Thrust from its coefficient; the inverse of `CT`.

    >>> thrust(0.1, 1.0, 10.0, 1.0)
    10.0
    """
    return _out(_f(CT) * _f(rho) * _f(n) ** 2 * _f(D) ** 4)


def torque(CQ: ArrayLike, rho: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Torque from its coefficient; the inverse of `CQ`.

    >>> torque(0.01, 1.0, 10.0, 1.0)
    1.0
    """
    return _out(_f(CQ) * _f(rho) * _f(n) ** 2 * _f(D) ** 5)


def power(CP: ArrayLike, rho: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Power from its coefficient; the inverse of `CP`.

    >>> power(0.05, 1.0, 10.0, 1.0)
    50.0
    """
    return _out(_f(CP) * _f(rho) * _f(n) ** 3 * _f(D) ** 5)


def CP_from_CQ(CQ: ArrayLike) -> Any:
    """Power coefficient from the torque coefficient, CP = 2 pi CQ.

    >>> round(CP_from_CQ(0.01), 6)
    0.062832
    """
    return _out(2.0 * math.pi * _f(CQ))


def CQ_from_CP(CP: ArrayLike) -> Any:
    """Torque coefficient from the power coefficient, CQ = CP/(2 pi).

    >>> round(CQ_from_CP(0.05), 6)
    0.007958
    """
    return _out(_f(CP) / (2.0 * math.pi))


def J(V: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Advance ratio J = V/(n D); NaN where n <= 0.

    >>> J(15.0, 100.0, 0.25)
    0.6
    """
    n, D = _f(n), _f(D)
    return _ratio(V, n * D, n > 0)


def airspeed(J: ArrayLike, n: ArrayLike, D: ArrayLike) -> Any:
    """Airspeed from the advance ratio; the inverse of `J`.

    >>> airspeed(0.6, 100.0, 0.25)
    15.0
    """
    return _out(_f(J) * _f(n) * _f(D))


def eta(J: ArrayLike, CT: ArrayLike, CP: ArrayLike) -> Any:
    """Propulsive efficiency.

    J CT/CP where the shaft takes power (CP > 0); exactly 0 at J = 0; negative where the propeller brakes
    (CT < 0); NaN where the shaft gives power (CP <= 0), because T V/P is then no efficiency.

    At J = 0 the useful power T V is zero: use `FM` there.

    >>> eta([0.0, 0.5, 0.9, 1.2], [0.10, 0.05, -0.01, -0.05], [0.04, 0.035, 0.01, -0.02]).round(3)
    array([ 0.   ,  0.714, -0.9  ,    nan])
    """
    J, CT, CP = np.broadcast_arrays(_f(J), _f(CT), _f(CP))
    out = np.divide(J * CT, CP, out=np.full(J.shape, np.nan), where=CP > 0)
    known = np.isfinite(CT) & np.isfinite(CP)
    return _out(np.where((J == 0) & known, 0.0, out))


def eta_limit(J: ArrayLike, CT: ArrayLike) -> Any:
    """Greatest efficiency of an open rotor at a thrust, V/(V + v) of momentum theory; 1 without thrust.

    2/(1 + sqrt(1 + 8 CT/(pi J^2))), from T = 2 rho A (V + v) v (Glauert, "Airplane Propellers", in Durand,
    "Aerodynamic Theory" IV, 1935). A duct with a wide exit may pass it, but not 1: use CT = 0 there.

    >>> eta_limit([0.0, 0.5, 0.5, 0.5], [0.1, 0.1, 0.0, -0.1]).round(3)
    array([0.   , 0.826, 1.   , 1.   ])
    """
    J, CT = np.broadcast_arrays(np.abs(_f(J)), np.fmax(_f(CT), 0.0))
    return _out(np.where(CT > 0.0, 2.0 * J / (J + np.sqrt(J**2 + 8.0 * CT / math.pi) + (CT == 0.0)), 1.0))


def FM(CT: ArrayLike, CP: ArrayLike, J: ArrayLike = 0.0) -> Any:
    """Figure of merit T^1.5/(P sqrt(2 rho A)) = sqrt(2/pi) CT^1.5/CP; NaN where CT < 0 or CP <= 0, and in flight.

    A ducted rotor may exceed 1: its own ideal power is lower.

    >>> round(FM(0.1, 0.04), 4)
    0.6308
    """
    CT, CP, J = _f(CT), _f(CP), _f(J)
    return _ratio(math.sqrt(2.0 / math.pi) * np.maximum(CT, 0.0) ** 1.5, CP, (CP > 0) & (CT >= 0) & (J == 0.0))


def M_tip(n: ArrayLike, D: ArrayLike, a_sound: ArrayLike) -> Any:
    """Rotational tip Mach number.

    >>> round(M_tip(20000 / 60, 14 * 0.0254, 340.3), 2)
    1.09
    """
    return _out(math.pi * _f(n) * _f(D) / _f(a_sound))


def M_tip_helical(n: ArrayLike, D: ArrayLike, a_sound: ArrayLike, V: ArrayLike) -> Any:
    """Helical tip Mach number sqrt((pi n D)^2 + V^2)/a; induced velocity left out.

    >>> round(M_tip_helical(100.0, 1.0, 340.0, 100.0), 4)
    0.9697
    """
    return _out(np.hypot(math.pi * _f(n) * _f(D), _f(V)) / _f(a_sound))


def Re75(chord75: ArrayLike, n: ArrayLike, D: ArrayLike, V: ArrayLike, rho: ArrayLike, mu: ArrayLike) -> Any:
    """Reynolds number at 0.75 R: rho W c/mu with W = sqrt((0.75 pi n D)^2 + V^2); induced velocity left out.

    >>> round(Re75(0.02, 100.0, 0.254, 0.0, 1.225, 1.7894e-5))
    81941
    """
    W = np.hypot(0.75 * math.pi * _f(n) * _f(D), _f(V))
    return _out(_f(rho) * W * _f(chord75) / _f(mu))

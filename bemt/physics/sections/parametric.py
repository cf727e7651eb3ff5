"""Sections of few numbers, as XROTOR, DFDC and QPROP hold them: cl and cd from them, and their fit to a table.

Incompressible: each program applies its own Prandtl-Glauert factor and drag rise; here effects do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.physics.sections.polars import Polar, first_stall

LOW, HIGH = np.radians(-16.0), np.radians(22.0)
"""Angles of attack that a fit of lift looks at [rad]."""
WIDEST_STALL = 0.3
"""Greatest dcl_stall of a fit. A wider stall reaches into the linear range: slope and zero-lift angle are then numbers
that fit the stall, no longer those of the section, which XROTOR and DFDC scale by Mach number and solidity [-]."""


@dataclass(frozen=True)
class XrotorSection:
    """Section of XROTOR and DFDC; radians inside, the files count ``a0_deg`` in degrees.

    M. Drela and H. Youngren, XROTOR 7.55 (subroutine CLCDCM) at Mach number 0, with
    ``cla = dclda (alpha - a0)`` and the limiter ``L = d ln((1 + exp((cla - clmax)/d)) / (1 + exp((clmin - cla)/d)))``::

        cl = cla - (1 - f) L,   f = dclda_stall / dclda,   d = dcl_stall
        cd = (cdmin + dcdcl2 (cl - clcdmin)^2) (Re / reref)^reexp + 2 ((1 - f) L / dclda)^2
    """

    a0: float
    dclda: float
    clmax: float
    clmin: float
    dclda_stall: float
    dcl_stall: float
    cdmin: float
    clcdmin: float
    dcdcl2: float
    reref: float
    reexp: float
    cmcon: float = 0.0
    mcrit: float = 0.8

    def lift(self, alpha: ArrayLike) -> tuple[Array, Array]:
        """Lift coefficient, and the limiter that stall takes off [-]."""
        d, cla = self.dcl_stall, self.dclda * (np.asarray(alpha, dtype=float) - self.a0)
        limiter = d * (np.logaddexp(0.0, (cla - self.clmax) / d) - np.logaddexp(0.0, (self.clmin - cla) / d))
        return cla - (1.0 - self.dclda_stall / self.dclda) * limiter, np.asarray(limiter)

    def cl_cd(self, alpha: ArrayLike, Re: ArrayLike) -> tuple[Array, Array]:
        """Coefficients at angles [rad] and Reynolds numbers, broadcast [-]."""
        cl, limiter = self.lift(alpha)
        stall = (1.0 - self.dclda_stall / self.dclda) * limiter / self.dclda
        scale = (np.asarray(Re, dtype=float) / self.reref) ** self.reexp
        cd = (self.cdmin + self.dcdcl2 * (cl - self.clcdmin) ** 2) * scale + 2.0 * stall**2
        return np.broadcast_to(cl, cd.shape), cd


@dataclass(frozen=True)
class QpropSection:
    """Section of QPROP.

    M. Drela, QPROP 1.22 (propeller file, subroutines CDFUN and DCDFUN) at Mach number 0::

        cl = cl0 + cla alpha, clipped to clmin .. clmax
        cd = (cd0 + cd2 (cl - clcd0)^2) (Re / reref)^reexp,   cd2 = cd2u above clcd0, cd2l below

    and 2 sin(alpha - alpha_cd0)^2 more where cl is clipped, with ``alpha_cd0 = (clcd0 - cl0) / cla``.
    """

    cl0: float
    cla: float
    clmin: float
    clmax: float
    cd0: float
    cd2u: float
    cd2l: float
    clcd0: float
    reref: float
    reexp: float

    def cl_cd(self, alpha: ArrayLike, Re: ArrayLike) -> tuple[Array, Array]:
        """Coefficients at angles [rad] and Reynolds numbers, broadcast [-]."""
        alpha = np.asarray(alpha, dtype=float)
        free = self.cl0 + self.cla * alpha
        cl = np.clip(free, self.clmin, self.clmax)
        cd2 = np.where(cl > self.clcd0, self.cd2u, self.cd2l)
        scale = (np.asarray(Re, dtype=float) / self.reref) ** self.reexp
        stalled = np.where(cl == free, 0.0, 2.0 * np.sin(alpha - (self.clcd0 - self.cl0) / self.cla) ** 2)
        cd = (self.cd0 + cd2 * (cl - self.clcd0) ** 2) * scale + stalled
        return np.broadcast_to(cl, cd.shape), cd


def _samples(polar: Polar, Re: float) -> tuple[Array, Array, Array, Array, float, float]:
    """Angles of a fit, cl at a Reynolds number, cd at the two nodes around it, and these nodes."""
    alpha = polar.alpha[(polar.alpha >= LOW) & (polar.alpha <= HIGH)]
    cl = polar.lookup(alpha, Re)[0]
    if polar.Re.size == 1:
        cd = polar.lookup(alpha, Re)[1]
        return alpha, cl, cd, cd, Re, Re
    k = int(np.clip(np.searchsorted(polar.Re, Re), 1, polar.Re.size - 1))
    low, high = float(polar.Re[k - 1]), float(polar.Re[k])
    return alpha, cl, polar.lookup(alpha, low)[1], polar.lookup(alpha, high)[1], low, high


def _power(below: Array, above: Array, low: float, high: float, Re: float) -> tuple[Array, float]:
    """Drag at a Reynolds number by the power law through two nodes at each angle, and the median exponent."""
    if low == high:
        return below, 0.0
    exponent = np.log(above / below) / np.log(high / low)
    return np.asarray(below * (Re / low) ** exponent), float(np.median(exponent))


def _linear(polar: Polar, alpha: Array, cl: Array, Re: float) -> tuple[float, float, int, int]:
    """Slope [1/rad], angle of zero lift [rad], index of the positive and of the negative stall within the angles."""
    slope, a0 = polar.cl_alpha(Re), polar.alpha0(Re)
    start = int(np.argmin(np.abs(alpha - a0)))
    return slope, a0, start + int(first_stall(cl[start:])), start - int(first_stall(-cl[start::-1]))


def _solve(residual: Callable[[Array], Array], start: list[float], low: list[float], high: list[float]) -> Array:
    from scipy.optimize import least_squares

    start_ = np.clip(start, np.array(low) + 1e-9, np.array(high) - 1e-9)
    found = least_squares(
        residual, start_, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac", max_nfev=4000
    )
    return np.asarray(found.x, dtype=float)


def fit_xrotor(polar: Polar, Re: float) -> XrotorSection:
    """Fit a section of XROTOR to a table at one Reynolds number; least squares of cl, then of cd before stall."""
    alpha, cl, below, above, low, high = _samples(polar, Re)
    slope, a0, up, down = _linear(polar, alpha, cl, Re)
    top, bottom = float(cl[up]), float(cl[down])
    make: Any = XrotorSection

    def lift(p: Array) -> Array:
        return np.asarray(make(*p, 0.01, 0.0, 0.0, Re, 0.0).lift(alpha)[0] - cl)

    start = [a0, slope, top, bottom, 0.1, 0.1]
    p = _solve(lift, start, [-0.6, 1.0, 0.05, -4.0, -3.0, 5e-3], [0.6, 14.0, 4.0, -0.01, 3.0, WIDEST_STALL])
    used = np.zeros(alpha.size, dtype=bool)
    used[down : up + 1] = True
    got, limiter = make(*p, 0.01, 0.0, 0.0, Re, 0.0).lift(alpha[used])
    stall = 2.0 * ((1.0 - p[4] / p[1]) * limiter / p[1]) ** 2
    least_share = 0.1  # of drag that stays attached, where the stall of the fit takes more than there is
    kept = [np.maximum(cd[used] - stall, least_share * cd[used]) for cd in (below, above)]
    attached, reexp = _power(kept[0], kept[1], low, high, Re)
    weight = 1.0 / attached
    A = np.stack([np.ones(got.size), got, got**2], axis=1) * weight[:, None]
    c = np.linalg.lstsq(A, attached * weight, rcond=None)[0]
    if c[2] > 1e-9:
        middle = float(-0.5 * c[1] / c[2])
        least, bend = float(c[0] - c[2] * middle**2), float(c[2])
    else:
        middle, least, bend = 0.0, float(np.mean(attached)), 0.0
    a = [float(v) for v in p]
    return XrotorSection(a[0], a[1], a[2], a[3], a[4], a[5], max(least, 1e-5), middle, bend, float(Re), reexp)


def fit_qprop(polar: Polar, Re: float) -> QpropSection:
    """Fit a section of QPROP to a table at one Reynolds number."""
    alpha, cl, below, above, low, high = _samples(polar, Re)
    cd, _ = _power(below, above, low, high, Re)
    slope, a0, up, down = _linear(polar, alpha, cl, Re)
    top, bottom = float(cl[up]), float(cl[down])
    used = np.zeros(alpha.size, dtype=bool)
    used[down : up + 1] = True
    inner = (cl > bottom + 0.05) & (cl < top - 0.05) & (np.abs(alpha - a0) < np.radians(7.0))
    if np.count_nonzero(inner) >= 3:
        slope, zero = (float(v) for v in np.polyfit(alpha[inner], cl[inner], 1))
    else:
        zero = -slope * a0
    model = np.clip(zero + slope * alpha, bottom, top)
    free = used & (model == zero + slope * alpha)
    free = free if np.count_nonzero(free) > 5 else used
    start = float(cl[free][np.argmin(cd[free])])

    def drag(p: Array) -> Array:
        bend = np.where(model[free] > p[3], p[1], p[2])
        return np.asarray((p[0] + bend * (model[free] - p[3]) ** 2 - cd[free]) / cd[free])

    p = _solve(drag, [float(cd[free].min()), 0.02, 0.02, start], [1e-5, 0.0, 0.0, -1.5], [0.5, 3.0, 3.0, 2.0])
    reexp = _power(below[free], above[free], low, high, Re)[1]
    d = [float(v) for v in p]
    return QpropSection(zero, slope, bottom, top, d[0], d[1], d[2], d[3], float(Re), reexp)


def numbers(section: XrotorSection | QpropSection) -> dict[str, float]:
    """Parameters by name."""
    return dict(zip((f.name for f in fields(section)), astuple(section), strict=True))

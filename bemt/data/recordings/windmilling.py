"""Wind that a recording does not state: below some speed of rotation the propeller is a windmill."""

from __future__ import annotations

import numpy as np

from bemt.base.arrays import Array

# Thrust this small, share of the largest, has no sign; fewest readings of either sign; share of these on the wrong side
# of the zero, as misread speeds are; thrust coefficients next to the zero, share of the largest, that are no jump.
_SMALL, _FEWEST, _ASTRAY, _JUMP = 0.05, 3, 0.2, 0.75


def zero_thrust_speed(rpm: Array, thrust: Array) -> float | None:
    """Speed at which thrust changes its sign as in wind; None if it has one sign or does not follow the speed.

    At one airspeed CT falls with 1/n, through zero; the speed that divides the signs best is taken; NaN is left out.

    >>> n = np.linspace(2000.0, 6000.0, 9)
    >>> zero_thrust_speed(n, n**2 - 3700.0 * n)
    3750.0
    >>> zero_thrust_speed(n, np.where(n < 3700.0, -(n**2), n**2)) is None
    True
    """
    good = np.isfinite(rpm) & np.isfinite(thrust) & (rpm > 0.0)
    top = float(np.percentile(np.abs(thrust[good]), 95)) if good.any() else 0.0
    good &= np.abs(thrust) > _SMALL * top
    order = np.argsort(rpm[good], kind="stable")
    n, T = rpm[good][order], thrust[good][order]
    if top <= 0.0 or min(np.sum(T < 0.0), np.sum(T > 0.0)) < _FEWEST:
        return None
    astray = np.cumsum(T > 0.0)[:-1] + np.cumsum((T < 0.0)[::-1])[::-1][1:]
    k = int(np.argmin(astray)) + 1
    size, few = np.abs(T) / n**2, max(1, n.size // 20)
    near = float(np.median(size[max(k - few, 0) : k + few]))
    if astray[k - 1] > _ASTRAY * n.size or near > _JUMP * float(np.percentile(size, 90)):
        return None
    return float(0.5 * (n[k - 1] + n[k]))

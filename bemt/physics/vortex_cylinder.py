"""What the wake of a rotor induces ahead of and behind its disk: the semi-infinite vortex cylinder.

The wake of a uniformly loaded disk is a cylinder of ring vortices from the disk to infinity; v is the axial velocity
that it induces in the disk.  Ahead of the disk, at radius r and distance z, it induces (Branlard and Gaunaa 2015,
"Cylindrical vortex wake model: right cylinder", Wind Energy 18(11), eq. 7-8 as numbered in E. Branlard's own code; the
paper was not checked, the formula is tested against Biot and Savart)::

    u / v = H(R - r) - z k / (2 pi sqrt(r R)) [K(m) + (R - r) / (R + r) Pi(n, m)]
    m = k^2 = 4 r R / ((R + r)^2 + z^2)        n = 4 r R / (R + r)^2

and as far behind it 2 v H(R - r) less the same.  On the axis that is v (1 -/+ z / sqrt(R^2 + z^2)) (McCormick 1967,
Aerodynamics of V/STOL Flight; not checked against the book).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array


def ahead(r: ArrayLike, R: ArrayLike, z: float) -> Array:
    """Axial velocity at radius r, a distance z ahead of a disk of radius R [m], over that in the disk [1].

    >>> ahead(0.5, 1.0, 0.0).item(), ahead(1.5, 1.0, 0.0).item(), round(ahead(1e-9, 1.0, 1.0).item(), 6)
    (1.0, 0.0, 0.292893)
    """
    from scipy.special import ellipk, elliprf, elliprj

    r, R = np.broadcast_arrays(np.asarray(r, dtype=float), np.asarray(R, dtype=float))
    inside: Array = np.heaviside(R - r, 0.5)
    if z <= 0.0:
        return inside
    both = np.maximum(r * R, 1e-30 * R * R)
    m = 4.0 * both / ((R + r) ** 2 + z * z)
    n = np.minimum(4.0 * both / (R + r) ** 2, 1.0 - 1e-14)
    third = elliprf(0.0, 1.0 - m, 1.0) + n / 3.0 * elliprj(0.0, 1.0 - m, 1.0, 1.0 - n)
    edge = (R - r) / (R + r)
    third = np.where(edge == 0.0, 0.0, edge * third)
    return np.asarray(inside - z * np.sqrt(m / both) / (2.0 * math.pi) * (ellipk(m) + third))

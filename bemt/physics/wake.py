"""The wake of a rotor at a second one behind it: how far it has contracted, and how fast it is.

Without air from outside each streamtube would arrive with ``v (1 + s)`` more than the wind, s from 0 at the disk to 1
far behind, and with the area that continuity gives, w / (V + v (1 + s) + v_lower).  ``w = V + v`` is the axial velocity
in the disk, v_lower what the second rotor adds.  Measured wakes are wider: in hover they end at k R, k = 0.78
(Landgrebe 1972, J. AHS 17(4)) to 0.82 (Leishman and Ananthan 2008, J. AHS 53(1), not checked), 0.707 by momentum
theory.  Such a wake has taken air along: its area is larger by ``1 + (2 k^2 - 1) s``, and its velocity u so much
smaller that its momentum, (V + u) u times area, stays.  In a wind that factor counts by v / w (own choice).  Beyond 6.2
of its diameters the wake is a turbulent jet whose speed falls as 1/z (Albertson, Dai, Jensen and Rouse 1950, Trans.
ASCE 115, not checked).

How fast the wake contracts: a cylinder, which is not let contract, gives v (1 + s) = 2 v - A, with A of
:func:`bemt.physics.wake.ahead`, and s = 0.2 at 0.1 diameters.  In hover the measured wake is all but
contracted there (:func:`contracted`), so that s = 0.75.  Between the two, s goes linearly with v / w, from the cylinder
of a lightly loaded rotor to the measured wake of hover (own choice).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array

WAKE_RADIUS = 0.78
"""Radius of the developed wake in hover over that of its rotor: Landgrebe 1972, J. American Helicopter Society 17(4),
not checked; Leishman and Ananthan 2008, J. AHS 53(1), give 0.82 (not checked); momentum theory 0.707 [1]."""
SWIRL = 0.5
"""Share of the swirl behind a rotor that reaches one in its wake: all of it by the balance of angular momentum, none
where motors and arms between the rotors straighten the flow; the middle, declared [1]."""
MOUNT_DRAG = 0.03
"""Drag of what carries a rotor in the wake of another one, over the thrust of that one: motor and arm cover 2 to 6 % of
the disk, drag coefficient 1, dynamic pressure 0.6 to 1 of the disk loading; declared [1]."""
JET = 6.2
"""Length of a jet over its diameter from which its speed falls as 1/z (Albertson et al. 1950, Trans. ASCE 115) [1]."""


def contracted(
    z_over_R: float, CT: Array, sigma: float, twist_deg: float, blades: int, final: float = WAKE_RADIUS
) -> Array:
    """Radius of the wake of hovering rotors a distance z behind the disk, over theirs, (P,) [1].

    Landgrebe 1972, J. AHS 17(4), tip vortex at wake age psi, CT in the helicopter convention (paper not checked; the
    coefficients are those of several public codes)::

        r/R = k + (1 - k) exp(-(0.145 + 27 CT) psi)                 k = 0.78, here ``final``
        z/R = 0.25 (CT/sigma + 0.001 twist) psi                     up to the passage of the next blade, 2 pi / blades
              ... + (1.41 + 0.0141 twist) sqrt(CT/2) (psi - 2 pi / blades)                             beyond

    ``twist_deg`` is linear, tip less root; here twice that of the outer half of the blade. It is held within the -16 to
    0 deg of usual helicopters, and the vortex at a quarter of its speed without twist or more (own choices).

    >>> contracted(0.2, np.array([0.009]), 0.06, -12.0, 2).round(2)
    array([0.82])
    """
    CT = np.maximum(CT, 1e-6)
    twist = min(max(twist_deg, -16.0), 0.0)
    first = 0.25 * np.maximum(CT / sigma + 0.001 * twist, 0.25 * CT / sigma)
    later = (1.41 + 0.0141 * twist) * np.sqrt(0.5 * CT)
    passage = 2.0 * math.pi / blades
    age = np.minimum(z_over_R / first, passage) + np.maximum(z_over_R - first * passage, 0.0) / later
    return np.asarray(final + (1.0 - final) * np.exp(-(0.145 + 27.0 * CT) * age))


def hover_gain(radius: Array, final: float = WAKE_RADIUS) -> Array:
    """What hover has added to the induced velocity where the wake has a radius, s in v (1 + s) [1].

    ``radius`` is that of the wake over its rotor's, ``final`` that of the developed wake [1].

    >>> hover_gain(np.array([1.0, 0.78])).round(12).tolist()
    [0.0, 1.0]
    """
    square = radius**2
    return np.asarray((1.0 - square) / (square - (2.0 * final**2 - 1.0)))


def streamtubes(
    v: Array, V: Array, w: Array, faster: Array, hovering: Array, drawn: Array, z_over_R: float,
    final: float = WAKE_RADIUS,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Streamtubes of a wake behind its disk: velocity above the wind [m/s], area over that in the disk [1].

    Velocities, broadcast together: ``v`` induced in the disk, ``V`` of the wind, ``w`` through the disk, ``faster``
    what a cylinder adds behind it, ``drawn`` what a rotor there adds [m/s]; ``hovering`` is :func:`hover_gain`. The
    third result is what is left of a property per mass that the wake shares with the air that it takes along [1].
    """
    if z_over_R <= 0.0:
        return v, np.ones_like(v), np.ones_like(v)
    with np.errstate(divide="ignore", invalid="ignore"):
        grown = np.clip(np.where(v != 0.0, faster / v, 0.0), 0.0, 1.0)
        slip = np.clip(np.where(w > 0.0, v / w, 0.0), 0.0, 1.0)
    grown = grown + slip * np.maximum(hovering - grown, 0.0)
    ideal = v * (1.0 + grown)
    # area over that without air taken along: of the developed wake, then of a jet
    jet = max(z_over_R / (JET * 2.0 * final), 1.0) ** 2
    more = (1.0 + (2.0 * final**2 - 1.0) * grown * slip) * (1.0 + (jet - 1.0) * slip)
    momentum = (V + ideal) * ideal / more
    add = np.where(ideal > 0.0, np.sqrt(np.maximum(0.25 * V * V + momentum, 0.0)) - 0.5 * V, ideal)
    area = np.maximum(w, 1e-9) / np.maximum(V + ideal + drawn, 1e-9)
    # at the ends of the blades, where nothing is induced, the flow of the neighbours would seem to spread it
    area = np.where(v >= 0.0, np.minimum(area, 1.0), np.minimum(area, 4.0)) * more
    kept = (V + ideal) / np.maximum((V + add) * more, 1e-9)
    return add, area, kept


# What the wake of a rotor induces ahead of and behind its disk: the semi-infinite vortex cylinder.
#
# The wake of a uniformly loaded disk is a cylinder of ring vortices from the disk to infinity; v is the axial velocity
# that it induces in the disk.  Ahead of the disk, at radius r and distance z, it induces (Branlard and Gaunaa 2015,
# "Cylindrical vortex wake model: right cylinder", Wind Energy 18(11), eq. 7-8 as numbered in E. Branlard's own code;
# the paper was not checked, the formula is tested against Biot and Savart)::
#
#     u / v = H(R - r) - z k / (2 pi sqrt(r R)) [K(m) + (R - r) / (R + r) Pi(n, m)]
#     m = k^2 = 4 r R / ((R + r)^2 + z^2)        n = 4 r R / (R + r)^2
#
# and as far behind it 2 v H(R - r) less the same.  On the axis that is v (1 -/+ z / sqrt(R^2 + z^2)) (McCormick 1967,
# Aerodynamics of V/STOL Flight; not checked against the book).


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

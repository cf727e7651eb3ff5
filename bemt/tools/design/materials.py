"""What a blade is made of, and the stress in it: centrifugal force and bending, station by station.

A straight blade without rake: the pull of all that turns further out, and the moments of its thrust and torque, act on
the section's area and second moments of area (Euler-Bernoulli beam; Gere, Mechanics of Materials, ch. 5). The flapwise
and edgewise parts are added at their worst points, which no section has in one place: a bound from above. Twist couples
nothing here, and nothing relieves bending.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil


@dataclass(frozen=True)
class Material:
    """What a blade is made of: density [kg/m3], strength in its weakest direction [MPa], and where that is from."""

    name: str
    density: float
    strength_MPa: float
    source: str


MATERIALS = {
    m.name: m
    for m in (
        Material("pla", 1240.0, 35.0, "printed PLA, 35 to 45 MPa upright, 50 to 65 flat (additive.tools)"),
        Material("petg", 1270.0, 25.0, "printed PETG, 25 to 38 MPa upright, 44 to 56 flat (additive.tools)"),
        Material("pc", 1200.0, 35.0, "printed polycarbonate, 35 to 52 MPa upright, 58 to 75 flat (additive.tools)"),
        Material("pa12", 930.0, 43.0, "sintered PA12, 43 MPa (3D Systems, in PMC10406103, table 2); density of EOS "
                                      "PA 2200 (not checked)"),
        Material("pla_soft", 1310.0, 12.2, "printed matt PLA, 12.2 MPa upright, 23.2 flat (PolyTerra PLA sheet V5.3)"),
        Material("pa6_gf", 1270.0, 140.0, "glass-fibre nylon as moulded, 140 MPa at yield (CR-3D data sheet PA 6 G4)"),
        Material("al6061", 2700.0, 276.0, "aluminium 6061-T6, yield (ASM handbook value, not checked)"),
    )
}  # fmt: skip
"""Materials by name. Printed plastics count with the lower end across the layers."""
SAFETY = 3.0
"""Strength over stress that is asked for: declared, for fatigue, notches, creep and prints worse than test bars [1]."""


@dataclass(frozen=True, eq=False)
class SectionStrength:
    """Shape numbers of sections along a blade, (N,): of unit chord, about the centroid, along and across the chord.

    ``area`` over c^2, ``flap`` and ``edge`` second moments over c^4, ``y`` and ``x`` outermost distances over c [1].
    """

    area: Array
    flap: Array
    edge: Array
    y: Array
    x: Array


def strength(anchors: list[tuple[float, Airfoil]], weights: Array) -> SectionStrength:
    """Shape numbers at stations; ``weights`` (N, sections) blends those of the anchors.

    >>> from geometry.airfoil import plate
    >>> one = strength([(0.5, plate(0.0, 0.1))], np.ones((1, 1)))
    >>> bool(0.06 < one.area[0] < 0.1), bool(one.edge[0] > 20.0 * one.flap[0])
    (True, True)
    """
    rows = np.array([_numbers(np.asarray(a.x), np.asarray(a.y)) for _, a in anchors])
    return SectionStrength(*(weights @ rows).T)


def _numbers(x: Array, y: Array) -> tuple[float, float, float, float, float]:
    """Area, second moments about the centroid and outermost distances of a polygon (Green's theorem)."""
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y1 - x1 * y
    area = 0.5 * cross.sum()
    cx, cy = ((x + x1) * cross).sum() / (6.0 * area), ((y + y1) * cross).sum() / (6.0 * area)
    flap = ((y**2 + y * y1 + y1**2) * cross).sum() / 12.0 - area * cy**2
    edge = ((x**2 + x * x1 + x1**2) * cross).sum() / 12.0 - area * cx**2
    return abs(area), abs(flap), abs(edge), float(np.abs(y - cy).max()), float(np.abs(x - cx).max())


@dataclass(frozen=True, eq=False)
class Stress:
    """Stress at stations of one blade at a point, (N,) [Pa], and its derivatives by all chords and angles, (N, N)."""

    value: Array
    by_chord: Array
    by_beta: Array


def stress(
    shape: SectionStrength, density: float, blades: int, omega: float, r: Array, dr: Array, chord: Array, beta: Array,
    loads: Array, by_chord: Array | None = None, by_beta: Array | None = None,
) -> Stress:  # fmt: skip
    """Stress from the thrust [N] and torque [N m] of all blades' elements, (2, N), with their own derivatives.

    >>> one = SectionStrength(*(np.full(2, v) for v in (0.1, 1e-5, 1e-3, 0.05, 0.5)))
    >>> r, dr = np.array([0.05, 0.10]), np.array([0.05, 0.05])
    >>> found = stress(one, 1000.0, 2, 100.0, r, dr, np.full(2, 0.02), np.zeros(2), np.zeros((2, 2)))
    >>> (found.value / (1000.0 * 100.0**2)).round(6)  # half of the own element, and what is outside of it
    array([0.00625, 0.0025 ])
    """
    outer = np.triu(np.ones((r.size, r.size)), 1) + 0.5 * np.eye(r.size)
    arm = np.maximum(r[None, :] - r[:, None], 0.0) / blades
    twist = arm / r[None, :]  # torque acts as a force at its radius
    s, c = np.sin(beta), np.cos(beta)
    pull = outer * (density * omega**2 * r * dr * shape.area)[None, :]
    up, back = arm @ loads[0], twist @ loads[1]
    flap, edge = up * c + back * s, back * c - up * s
    k_flap, k_edge = shape.y / shape.flap, shape.x / shape.edge
    inertia = (pull @ chord**2) / (shape.area * chord**2)
    bending = (np.abs(flap) * k_flap + np.abs(edge) * k_edge) / chord**3
    value = inertia + bending
    n = np.zeros((r.size, r.size))
    if by_chord is None or by_beta is None:
        return Stress(value, n, n)
    sign_f, sign_e = np.sign(flap) * k_flap / chord**3, np.sign(edge) * k_edge / chord**3

    def moved(d: Array) -> Array:
        d_up, d_back = arm * d[0][None, :], twist * d[1][None, :]
        return np.asarray(
            sign_f[:, None] * (d_up * c[:, None] + d_back * s[:, None])
            + sign_e[:, None] * (d_back * c[:, None] - d_up * s[:, None])
        )

    own_c = np.diag(-2.0 * inertia / chord - 3.0 * bending / chord)
    own_b = np.diag(sign_f * edge - sign_e * flap)
    pulled = pull * (2.0 * chord)[None, :] / (shape.area * chord**2)[:, None]
    return Stress(value, moved(by_chord) + own_c + pulled, moved(by_beta) + own_b)

"""Duct of the truth: a wall of ring vortices with the jet's vortex tube behind it.

The wall carries ring vortices that cancel the flow through it; from the trailing edge on, a semi-infinite tube of
strength w (jet over outer speed) goes straight back.  What the rings do at the rotor disk is linear in w and in the
speed of flight, and is solved once per duct shape.  The jet's speed follows from Bernoulli across the rotor, the whole
thrust from the mass flow that the rings let through: T = rho A (V + u) w.

References
----------
.. [1] D. Kuechemann, J. Weber, "Aerodynamics of Propulsion", 1953, ch. 3-4 (ring-vortex method; not checked).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bemt.base.arrays import Array

_PHI = (np.arange(96) + 0.5) * (2.0 * np.pi / 96)


@dataclass(frozen=True)
class TruthDuct:
    """Shape of a duct; lengths over the tip radius."""

    # Length; rotor plane behind the lip. [-]
    length: float
    position: float
    gap: float = 0.01  # Tip clearance over the tip radius. [-]
    exit_ratio: float = 1.0  # Exit area over the area of the rotor annulus. [-]
    lip_radius: float = 0.1  # Radius of the lip over the tip radius. [-]


def ring_speed(x: Array, z: Array, a: Array) -> tuple[Array, Array]:
    """Axial and radial speed of unit ring vortices. [-]"""
    x, z, a = np.broadcast_arrays(x, z, a)
    cos = np.cos(_PHI)
    s2 = (a**2 + x**2 + z**2)[..., None] - 2.0 * (a * x)[..., None] * cos
    k = a[..., None] / np.maximum(s2, 1e-8) ** 1.5 / (2.0 * _PHI.size)
    return np.sum(k * (a[..., None] - x[..., None] * cos), axis=-1), np.sum(k * z[..., None] * cos, axis=-1)


def tube_speed(x: Array, z: Array, a: float) -> tuple[Array, Array]:
    """Axial and radial speed of a semi-infinite vortex tube of unit strength that begins at z = 0 and goes to +z."""
    x, z = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float))
    cos = np.cos(_PHI)
    s2 = np.maximum((a**2 + x**2)[..., None] - 2.0 * a * x[..., None] * cos, 1e-8)
    root = np.sqrt(s2 + z[..., None] ** 2)
    axial = np.mean(a * (a - x[..., None] * cos) / s2 * (1.0 + z[..., None] / root), axis=-1) / 2.0
    radial = -np.mean(a * cos / root, axis=-1) / 2.0
    return axial, radial


@lru_cache(maxsize=64)
def disk_speeds(duct: TruthDuct, hub: float, x: tuple[float, ...]) -> tuple[Array, Array]:
    """Axial speed at the rotor disk per jet excess w and per speed of flight. [-]"""
    wall = 1.0 + duct.gap
    # the hub ends behind the rotor: the jet fills a circle of the exit's area
    leave = np.sqrt(duct.exit_ratio * (wall**2 - hub**2) + hub**2)
    m = 40
    ends = duct.length * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, m + 1)))
    aft = max(duct.length - duct.position, 1e-6)

    def radius(z: Array) -> Array:
        # a rounded lip opens the mouth; behind the rotor the wall goes straight to the exit
        mouth = duct.lip_radius * np.maximum(1.0 - z / max(duct.lip_radius, 1e-9), 0.0) ** 2
        return np.asarray(wall + mouth + (leave - wall) * np.clip((z - duct.position) / aft, 0.0, 1.0))

    rings, points = ends[:-1] + 0.25 * np.diff(ends), ends[:-1] + 0.75 * np.diff(ends)
    slope = (radius(points + 1e-4) - radius(points - 1e-4)) / 2e-4
    axial, radial = ring_speed(radius(points)[:, None], points[:, None] - rings[None, :], radius(rings)[None, :])
    matrix = radial - slope[:, None] * axial
    ta, tr = tube_speed(radius(points), points - duct.length, float(radius(np.array(duct.length))))
    right = np.stack([-(tr - slope * ta), slope], axis=1)  # for w = 1 and for V = 1
    # the strength per length at the trailing edge runs on into the tube; wider of two conditions, by least squares
    kutta = np.zeros((1, m))
    kutta[0, -1] = 1.0
    scale = 10.0
    matrix = np.vstack([matrix, scale * kutta])
    right = np.vstack([right, [[scale * np.diff(ends)[-1], 0.0]]])
    strengths = np.linalg.lstsq(matrix, right, rcond=None)[0]
    at = np.asarray(x)
    axial, _ = ring_speed(at[:, None], duct.position - rings[None, :], radius(rings)[None, :])
    tube = tube_speed(at, np.full(at.size, duct.position - duct.length), float(radius(np.array(duct.length))))[0]
    out = axial @ strengths
    return out[:, 0] + tube, out[:, 1]


def seal(gap_over_span: Array, scale: float) -> Array:
    """Strength of the images of the tip vortices in the wall behind a gap. [-]

    Notes
    -----
    1 / (1 + g / 0.03): half of the image is lost at 3 % of the span (declared; gives one to two points of thrust per
    point of gap over span).
    """
    return np.asarray(1.0 / (1.0 + scale * np.asarray(gap_over_span) / 0.03))

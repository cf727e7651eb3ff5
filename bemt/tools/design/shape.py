"""Chord and twist of a blade by a few control points, smooth between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from geometry.rotor import Blade, Stations

CONTROLS = 5
"""Control points of the chord, and as many of the blade angle."""
TURN = 0.2
"""Blade angle that counts as much as the whole logarithm of a chord [rad]."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Blades around a start: ``ln(chord / R)`` is a cubic spline, the blade angle that of the start plus another."""

    # (N,) Blade elements [m]
    r: Array
    dr: Array
    # Tip and hub [m]
    R: float
    Rhub: float
    nodes: Array  # (K,) r/R of the control points
    basis: Array  # (N + 2, K) Splines of unit control points, at the hub, the elements and the tip
    beta0: Array  # (N + 2,) Blade angle of the start there [rad]

    @staticmethod
    def around(blade: Blade, elements: int) -> tuple[Shape, Array]:
        """Shape whose start is a blade, and the control values that are nearest to it, (2 K,)."""
        from scipy.interpolate import CubicSpline

        s = blade.midpoints(elements, spacing="cosine")
        R, Rhub = blade.R, blade.Rhub
        x = np.r_[Rhub, s.r, R] / R
        hub = Rhub / R
        nodes = hub + (1.0 - hub) * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, CONTROLS))
        basis = np.asarray(CubicSpline(nodes, np.eye(CONTROLS), bc_type="natural")(x))
        chord, beta = blade.at(x * R)
        weight = np.sqrt(np.r_[1e-3, s.dr / R, 1e-3])  # ends of no width
        fit = np.linalg.lstsq(basis * weight[:, None], np.log(chord / R) * weight, rcond=None)[0]
        return Shape(s.r, s.dr, R, Rhub, nodes, basis, beta), np.r_[fit, np.zeros(CONTROLS)]

    @property
    def inner(self) -> Array:
        """Splines at the elements, (N, K)."""
        return self.basis[1:-1]

    def ln_chord(self, x: Array) -> Array:
        """Logarithm of chord over R at hub, elements and tip, (N + 2,)."""
        return np.asarray(self.basis @ x[:CONTROLS])

    def stations(self, x: Array) -> Stations:
        """Blade elements of control values."""
        chord = self.R * np.exp(self.ln_chord(x)[1:-1])
        return Stations(self.r, self.dr, chord, self.beta0[1:-1] + TURN * (self.inner @ x[CONTROLS : 2 * CONTROLS]))

    def table(self, x: Array) -> tuple[Array, Array, Array]:
        """Columns r/R, chord/R and blade angle [rad] from hub to tip: the blade that the elements are cut from."""
        r = np.r_[self.Rhub, self.r, self.R] / self.R
        beta = self.beta0 + TURN * (self.basis @ x[CONTROLS : 2 * CONTROLS])
        return r, np.exp(self.ln_chord(x)), beta

    def pull_back(self, by_chord: Array, by_beta: Array, chord: Array) -> Array:
        """Derivatives by control values, (..., 2 K), of those by chords and angles of the elements, (..., N)."""
        return np.concatenate([(by_chord * chord) @ self.inner, TURN * (by_beta @ self.inner)], axis=-1)

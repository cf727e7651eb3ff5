"""Blades of minimum induced loss, and the ideal limits next to which a design stands.

A blade loses least when the sheets that it sheds move back as if they were rigid (Betz 1919), with one displacement
speed v'. The design follows Larrabee (1979, SAE 790585) in the form of Adkins and Liebeck (1994, J. Propulsion and
Power 10(5), 676-682), here A&L, with zeta = v'/V. Their equations are written with v' instead of zeta, so that nothing
is divided by the airspeed and hover needs no theory of its own::

    tan(phi) = (V + v'/2) / (Omega r)                                       A&L 20, 21
    F = (2/pi) acos(exp(-(B/2) (1 - r/R) / sin(phi_tip)))                   A&L 18, 19
    Gamma = 2 pi r v' F sin(phi) cos(phi) / B                               circulation of a blade, A&L 5, 6
    W c = 2 Gamma / cl                                                      A&L 16
    W sin(phi) = V + v'/2 cos(phi)^2 (1 - eps tan(phi))                     A&L 17 with 7a
    dT = B rho W Gamma cos(phi) (1 - eps tan(phi)) dr
    dQ = B rho W Gamma sin(phi) (1 + eps / tan(phi)) r dr                   A&L 1

with eps = cd/cl. A&L integrate these in powers of zeta (11 to 15); here v' is bracketed: the same root.
The numbers of the equations are those that open codes of the method quote; the paper itself was not read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.bem.duct import DuctFlow
from geometry.rotor import Blade, Stations

Section = Callable[[Array], tuple[Array, Array, Array]]
"""Reynolds numbers of the elements, (N,), to lift coefficient, angle of attack [rad] and drag over lift there."""

_STEPS = 6  # of the Reynolds number, which depends on W c only


@dataclass(frozen=True, eq=False)
class MinimumLoss:
    """A blade of minimum induced loss."""

    # (N,) Radii and chord [m], blade angle and inflow angle [rad]
    r: Array
    chord: Array
    beta: Array
    phi: Array
    # (N,) Circulation of a blade [m2/s], speed of the section [m/s]
    circulation: Array
    W: Array
    displacement: float  # Speed v' of the vortex sheets [m/s]
    # Of all blades
    thrust_N: float
    power_W: float


def minimum_loss(
    target: float, airspeed_m_s: float, rpm: float, blades: int, R: float, Rhub: float, section: Section,
    rho: float = 1.225, mu: float = 1.79e-5, *, power: bool = False, n: int = 200,
) -> MinimumLoss | None:  # fmt: skip
    """Blade of minimum induced loss for a thrust [N] or a power [W]; None if no blade on this disk reaches it.

    Examples
    --------
    >>> def ideal(Re):
    ...     return np.full_like(Re, 0.5), np.radians(np.full_like(Re, 4.0)), np.zeros_like(Re)
    >>> found = minimum_loss(6.0, 15.0, 7000.0, 2, 0.127, 0.02, ideal)
    >>> round(found.thrust_N, 6), bool(actuator_disk(6.0, 15.0, 0.127, 0.02) < found.power_W)
    (6.0, True)
    """
    from scipy.optimize import brentq

    edges = Rhub + (R - Rhub) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, n + 1)))
    r, dr = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    Omega = rpm * math.pi / 30.0

    def blade(v: float) -> MinimumLoss:
        phi = np.arctan2(airspeed_m_s + 0.5 * v, Omega * r)
        tip = math.atan2(airspeed_m_s + 0.5 * v, Omega * R)
        F = 2.0 / math.pi * np.arccos(np.exp(-0.5 * blades * (1.0 - r / R) / math.sin(tip)))
        s, c = np.sin(phi), np.cos(phi)
        gamma = 2.0 * math.pi * r * v * F * s * c / blades
        cl, alpha, eps = section(np.full_like(r, 1e5))
        for _ in range(_STEPS):
            cl, alpha, eps = section(np.maximum(rho * 2.0 * gamma / cl / mu, 1.0))
        W = (airspeed_m_s + 0.5 * v * c**2 * (1.0 - eps * s / c)) / s
        dT = blades * rho * W * gamma * (c - eps * s) * dr
        dQ = blades * rho * W * gamma * (s + eps * c) * r * dr
        T, P = float(dT.sum()), Omega * float(dQ.sum())
        return MinimumLoss(r, 2.0 * gamma / (cl * W), alpha + phi, phi, gamma, W, v, T, P)

    def reached(v: float) -> float:
        found = blade(v)
        return found.power_W if power else found.thrust_N

    low, high = 0.0, 1e-3 * Omega * R
    while reached(high) < target:
        if high > 8.0 * Omega * R or (not power and high > Omega * R and reached(high) < reached(low)):
            return None
        low, high = high, 1.5 * high
    return blade(float(brentq(lambda v: reached(v) / target - 1.0, low or 1e-9 * high, high, xtol=1e-12 * high)))


def without_drag(Re: Array) -> tuple[Array, Array, Array]:
    """Section without drag: the Betz optimum, whose power no lift coefficient changes."""
    return np.full_like(Re, 0.5), np.zeros_like(Re), np.zeros_like(Re)


def actuator_disk(thrust_N: float, airspeed_m_s: float, R: float, Rhub: float, rho: float = 1.225) -> float:
    """Power of the ideal actuator disk on the swept annulus: thrust times the speed through it. [W]

    >>> round(actuator_disk(10.0, 0.0, 0.127, 0.0), 1)
    89.8
    """
    area = math.pi * (R**2 - Rhub**2)
    return thrust_N * (0.5 * airspeed_m_s + math.sqrt(0.25 * airspeed_m_s**2 + thrust_N / (2.0 * rho * area)))


def ducted_disk(thrust_N: float, airspeed_m_s: float, flow: DuctFlow, rho: float = 1.225) -> float:
    """Power of an ideal disk in a duct of the same exit, without losses and swirl: energy of the jet. [W]

    Continuity and momentum as in :mod:`bemt.physics.bem.duct`.
    """
    from scipy.optimize import brentq

    V, k = airspeed_m_s, flow.wake_ratio * flow.contraction
    idle = flow.wake_ratio * flow.capture * V

    def jet(w: float) -> float:
        return float(flow.jet_speed(np.asarray(w), np.asarray(V)))

    fast = idle + math.sqrt(k * thrust_N / (rho * flow.area)) + 1e-6
    w = float(brentq(lambda w: rho * flow.area * w * (jet(w) - V) - thrust_N, idle, 2.0 * fast))
    return 0.5 * rho * flow.area * w * (jet(w) ** 2 - V**2)


# Chord and twist of a blade by a few control points, smooth between them.

CONTROLS = 5
"""Control points of the chord, and as many of the blade angle."""
TURN = 0.2
"""Blade angle that counts as much as the whole logarithm of a chord [rad]."""


@dataclass(frozen=True, eq=False)
class BladeShape:
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
    def around(blade: Blade, elements: int) -> tuple[BladeShape, Array]:
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
        return BladeShape(s.r, s.dr, R, Rhub, nodes, basis, beta), np.r_[fit, np.zeros(CONTROLS)]

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

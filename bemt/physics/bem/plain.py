"""The whole method in plain numpy, for reading: an open rotor at one operating point, without any speed.

The kernel solves the same equations in compiled code with tables, a duct and more effects; tests/test_plain.py compares
them. SI, radians. ``alpha = beta - phi``, ``sigma = B c / (2 pi r)``, ``cn`` along the thrust, ``ct`` along the torque.

References
----------
.. [1] H. Glauert, "Airplane Propellers", in Durand, Aerodynamic Theory IV, 1935, ch. VII.
.. [2] S. A. Ning, "A simple solution method for the blade element momentum equations with guaranteed convergence", Wind
       Energy 17:1327, 2014, doi:10.1002/we.1636: one residual in phi; eq. 4-6 for the loss factors.
.. [3] J. G. Leishman, Principles of Helicopter Aerodynamics, 2nd ed., 2006, sec. 2.14.3 (not checked): descent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.bem.residual import Y_BRAKE

Section = Callable[[Array, Array, Array], tuple[Array, Array]]


class PlainBlade(NamedTuple):
    """Blade elements of a rotor: (N,) radius [m], width [m], chord [m], blade angle [rad]; blades, hub and tip [m]."""

    r: Array
    dr: Array
    chord: Array
    beta: Array
    B: int
    Rhub: float
    R: float


class PlainLoads(NamedTuple):
    """Thrust [N], torque [N m], (N,) inflow angle [rad], (N,) loss factor [1], (N,) speed at the section [m/s]."""

    T: float
    Q: float
    phi: Array
    F: Array
    W: Array


def prandtl(f: Array) -> Array:
    """Loss factor (2/pi) acos(exp(-f)), [2] eq. 4."""
    return np.maximum(2.0 / np.pi * np.arccos(np.exp(-f)), 1e-6)


def mass_flow(y: Array) -> Array:
    """Mass flow per area over ``rho |V|`` for ``y = w / V`` (w: axial speed through the disk).

    Momentum theory gives abs(y). It fails between the vortex-ring state and the windmill state (y = 0.488), where the
    measured curve [3] takes over, from a sink rate of 0.45 to 1 times the induced speed of hover step by step.
    """
    x = np.linspace(0.0, 2.01, 20101)  # sink rate, v: induced speed, over the induced speed of hover
    v = np.polynomial.polynomial.polyval(x, [1.0, 1.125, -1.372, 1.718, -0.655])
    s = 1.0 / np.maximum(1.0 - y, 0.4)
    first, last = 0.45 / (0.225 + np.sqrt(0.225**2 + 1.0)), 1.0 / v[10000]
    b = np.clip((s - first) / (last - first), 0.0, 1.0)
    b = b**2 * (3.0 - 2.0 * b)
    curve = (1.0 - y) * ((1.0 - b) * np.abs(s - 1.0) + b * np.interp(s, x / v, v**-2.0))
    return np.where(y < Y_BRAKE, curve, np.abs(y))


def solve_plain(
    blade: PlainBlade, section: Section, Omega: float, V: float, rho: float = 1.225, mu: float = 1.81e-5,
    a_sound: float = 340.3,
) -> PlainLoads:  # fmt: skip
    """Solve one operating point: speed of rotation [rad/s], axial speed [m/s], air [kg/m3], [Pa s], [m/s].

    ``section(alpha, Re, M)`` gives lift and drag coefficient of every element.

    Examples
    --------
    A small propeller with straight lift curves, at rest and in flight:

    >>> r = np.linspace(0.02, 0.125, 22)[:-1] + 0.0025
    >>> blade = PlainBlade(r, np.full(21, 0.005), np.full(21, 0.02), np.arctan(0.127 / (2 * np.pi * r)), 2, 0.02, 0.127)
    >>> line = lambda alpha, Re, M: (2 * np.pi * np.sin(alpha + 0.05), np.full_like(alpha, 0.02))
    >>> [round(solve_plain(blade, line, 628.3, V).T, 2) for V in (0.0, 8.0)]
    [4.8, 2.86]
    """
    r, dr, c, beta, B, Rhub, R = blade
    sigma4 = B * c / (2.0 * np.pi * r) / 4.0
    UT = Omega * r  # onset speed in the plane of rotation; V is that along the axis
    phi_in, U = np.arctan2(V, UT), np.hypot(UT, V)

    def element(phi: Array) -> tuple[Array, ...]:
        s, co = np.sin(phi), np.cos(phi)
        s = np.where(np.abs(s) > 1e-9, s, np.copysign(1e-9, s))
        W = np.maximum(U * np.cos(phi - phi_in), 1e-9)  # without drag, for Re and Mach number
        w = W * s
        # sheets of the far wake: tan(phi_w) = tan(phi) q^1.5 with q = (V + 2 v) / (V + v), v = w - V
        q = np.clip(2.0 - V / w, 0.3, 3.0)
        sin_w = np.sqrt(s**2 * q**3 / (co**2 + s**2 * q**3))
        F = prandtl(B * (R - r) / (2.0 * r * sin_w)) * prandtl(B * (r - Rhub) / (2.0 * Rhub * sin_w))
        M = np.abs(s) if V == 0.0 else mass_flow(w / V) * abs(V) / W  # mass flow per area over rho W
        cl, cd = section(beta - phi, rho * W * c / mu, W / a_sound)
        cn, ct = cl * co - cd * s, cl * s + cd * co
        # thrust: F M (w - V) = sigma/4 W cn; torque: F M v_t = sigma/4 W ct; W cos(phi) = UT - v_t. W eliminated:
        residual = F * M * (UT * s - V * co) - sigma4 * (cn * UT + ct * V)
        return residual, W / (1.0 + sigma4 * cd / (F * M)), F, cn, ct

    # residual < 0 at phi_in - 90 deg and > 0 at + 90 deg for any section with drag: bisect
    low, high = phi_in - np.pi / 2.0, phi_in + np.pi / 2.0
    for _ in range(60):
        phi = 0.5 * (low + high)
        negative = element(phi)[0] < 0.0
        low, high = np.where(negative, phi, low), np.where(negative, high, phi)
    phi = 0.5 * (low + high)
    _, W, F, cn, ct = element(phi)
    q = 0.5 * rho * W**2 * c * B * dr
    return PlainLoads(float(np.sum(q * cn)), float(np.sum(q * ct * r)), phi, F, W)

"""Section model of the truth: thin-aerofoil zero lift, Kirchhoff flow past a moving separation point, flat plate.

Nothing here is tabulated by a panel or boundary-layer code and nothing is shared with the solver's section tables.

References
----------
.. [1] I. H. Abbott, A. E. von Doenhoff, "Theory of Wing Sections", 1959, ch. 4 and 6 (NACA four-digit mean line).
.. [2] J. G. Leishman, T. S. Beddoes, "A semi-empirical model for dynamic stall", J. AHS 34(3), 1989: separation point
       f(alpha), cn = a (alpha - alpha0) ((1 + sqrt f) / 2)^2.
.. [3] S. F. Hoerner, "Fluid-Dynamic Lift" ch. 21 and "Fluid-Dynamic Drag" ch. 3: cn of a stalled plate,
       cd90 = 1.98 (1 - 0.41 (1 - exp(-17 / AR))).
.. [4] Z. Du, M. S. Selig, "A 3-D stall-delay model for horizontal axis wind turbine performance prediction",
       AIAA-98-0021, 1998: gain of lift.
.. [5] T. von Karman, J. Aeronautical Sciences 8(9), 1941; H.-S. Tsien 1939: pressure at subsonic Mach numbers.
.. [6] C. D. Harris, "Two-dimensional aerodynamic characteristics of the NACA 0012 airfoil", NASA TM-81927, 1981: shape
       of the drag rise.

Equation numbers and tabulated values not checked against the papers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array

# Small moulded or carved blades with early transition: profile drag of a 9 % section at its ideal lift, share of the
# potential zero-lift angle and lift slope that viscosity leaves, onset of separation [deg], over Reynolds number.
_RE = np.log([1e4, 2e4, 5e4, 1e5, 2e5, 5e5, 1e6, 3e6, 1e7])
_CD0 = np.log([0.052, 0.0365, 0.0222, 0.0160, 0.0121, 0.0088, 0.0073, 0.0063, 0.0058])
_ZERO = np.array([0.70, 0.80, 0.88, 0.92, 0.94, 0.96, 0.97, 0.98, 0.98])
_SLOPE = np.array([0.82, 0.85, 0.87, 0.88, 0.88, 0.88, 0.88, 0.885, 0.89])
_ONSET = np.array([7.8, 8.6, 9.6, 10.3, 10.9, 11.6, 12.2, 13.2, 14.0])
# Drag-divergence Mach number of 6, 9, 12, 15 and 20 % sections at cl = 0.2
_DD_T = np.array([0.06, 0.09, 0.12, 0.15, 0.20])
_DD_M = np.array([0.835, 0.795, 0.76, 0.725, 0.67])


@dataclass(frozen=True)
class TrueSection:
    """Section of a blade, one value per panel or one for all."""

    # (N,) NACA four-digit parameters over the chord. [-]
    camber: float = 0.035
    position: float = 0.4
    thickness: float = 0.09


@dataclass(frozen=True)
class SectionPhysics:
    """What the sections feel; the defaults are a smooth, real blade in real air."""

    reynolds: float = 1.0  # Exponent on Re / Re_ref: 1 is real, 0 is a Reynolds number that never changes. [-]
    reference_re: float = 1e5  # Re_ref. [-]
    # Scales, 1 is real and 0 is none. [-]
    compressibility: float = 1.0
    drag_divergence: float = 1.0
    stall_delay: float = 1.0
    post_stall: float = 1.0  # Scale of the plate's cd at 90 deg. [-]
    camber: float = 0.0  # Added camber over the chord. [-]
    roughness: float = 0.0  # Relative growth of the profile drag; separation comes earlier by 12 deg times it. [-]
    # Lift lost below a Reynolds number where a laminar bubble bursts. [-]
    bubble_cl: float = 0.0
    bubble_re: float = 1e5
    # Factors on profile drag and lift slope: what no two blades share. [-]
    drag_level: float = 1.0
    slope_level: float = 1.0


def zero_lift_angle(camber: Array, position: Array) -> Array:
    """Zero-lift angle of a NACA four-digit mean line by thin-aerofoil theory. [rad]

    Notes
    -----
    Reference [1] of the module: alpha0 = -1/pi int dz/dx (cos t - 1) dt, x = (1 - cos t) / 2, in closed form for the
    two parabolas.

    Examples
    --------
    >>> round(float(np.degrees(zero_lift_angle(np.array(0.04), np.array(0.4)))), 2)
    -4.15
    """
    m, p = np.asarray(camber, float), np.asarray(position, float)
    t = np.arccos(1.0 - 2.0 * p)

    def part(lo: Array | float, hi: Array | float) -> Array:
        # int (2p - 1 + cos t) (cos t - 1) dt
        def primitive(x: Array | float) -> Array:
            return np.asarray((2 * p - 2) * np.sin(x) - (2 * p - 1) * x + 0.5 * x + 0.25 * np.sin(2 * np.asarray(x)))

        return primitive(hi) - primitive(lo)

    return np.asarray(-(m / np.pi) * (part(0.0, t) / p**2 + part(t, np.pi) / (1.0 - p) ** 2))


def _step(x: Array) -> Array:
    """Smooth step from 0 at x = 0 to 1 at x = 1."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def loads(
    alpha: Array, re: Array, mach: Array, c_r: Array, speed_ratio: Array, aspect: float, section: TrueSection,
    physics: SectionPhysics,
) -> tuple[Array, Array]:  # fmt: skip
    """Lift and drag coefficients. [-]"""
    camber = np.asarray(section.camber) + physics.camber
    thick = np.asarray(section.thickness)
    ref = physics.reference_re
    log_re = np.log(ref) + physics.reynolds * np.log(np.maximum(re, 100.0) / ref)
    alpha0 = zero_lift_angle(camber, np.asarray(section.position)) * np.interp(log_re, _RE, _ZERO)
    slope = 2.0 * np.pi * (1.0 + 0.77 * thick) * np.interp(log_re, _RE, _SLOPE) * physics.slope_level
    a = (alpha + np.pi) % (2.0 * np.pi) - np.pi
    up = a >= alpha0
    onset = np.interp(log_re, _RE, _ONSET) + 30.0 * np.clip(thick - 0.09, -0.04, 0.06) - 12.0 * physics.roughness
    onset = np.radians(np.where(up, onset, onset - 95.0 * np.abs(camber)))
    over = np.abs(a) - onset
    f = np.where(over <= 0.0, 1.0 - 0.3 * np.exp(np.minimum(over, 0.0) / np.radians(2.2)),
                 0.04 + 0.66 * np.exp(-np.maximum(over, 0.0) / np.radians(5.5)))  # fmt: skip
    root = np.sqrt(f)
    potential = slope * np.sin(a - alpha0)
    cl = potential * (0.5 * (1.0 + root)) ** 2
    ideal = 12.0 * camber
    cd0 = np.exp(np.interp(log_re, _RE, _CD0)) * (
        1.0 + 2.5 * (thick - 0.09) + 60.0 * np.maximum(thick - 0.12, 0.0) ** 2
    )
    cd0 = cd0 * (1.0 + physics.roughness) * physics.drag_level
    cd = cd0 * (1.0 + 1.2 * np.minimum(np.abs(cl - ideal), 1.2) ** 2) + 0.8 * (1.0 - root) * np.abs(cl * np.sin(a))
    if physics.bubble_cl:
        burst = 0.5 * (1.0 - np.tanh((np.log(np.maximum(re, 100.0)) - np.log(physics.bubble_re)) / 0.08))
        cl, cd = cl - physics.bubble_cl * burst, cd + 0.12 * physics.bubble_cl * burst
    if physics.stall_delay:
        cl = cl + physics.stall_delay * _du_selig(a, c_r, speed_ratio) * np.maximum(potential - cl, 0.0) * up
    cl, cd = _compressible(cl, cd, mach, thick, a, physics)
    sine = np.abs(np.sin(a))
    cd90 = 1.98 * (1.0 - 0.41 * (1.0 - np.exp(-17.0 / aspect))) * physics.post_stall
    normal = cd90 * sine / (0.56 + 0.44 * sine)
    w = _step((np.abs(a) - onset - np.radians(7.0)) / np.radians(14.0))
    plate = normal * np.cos(a) * np.sign(np.where(a == 0.0, 1.0, a))
    return np.asarray((1.0 - w) * cl + w * plate), np.asarray((1.0 - w) * cd + w * (normal * sine + cd0))


def _du_selig(a: Array, c_r: Array, speed_ratio: Array) -> Array:
    """Share of the lost lift that rotation gives back; reference [4], a = b = d = 1."""
    chord = np.clip(c_r, 1e-6, 0.999)
    # d R / (Lambda r): r/R is not needed apart from c/r when the exponent is taken at r = 0.5 R, as the authors plot it
    power = chord ** (2.0 / speed_ratio)
    gain = (1.6 * chord / 0.1267 * (1.0 - power) / (1.0 + power) - 1.0) / (2.0 * np.pi)
    return np.asarray(np.clip(gain, 0.0, 1.0) * (1.0 - _step((a - np.radians(25.0)) / np.radians(20.0))))


def _compressible(
    cl: Array, cd: Array, mach: Array, thick: Array, a: Array, physics: SectionPhysics
) -> tuple[Array, Array]:
    m_dd = np.interp(thick, _DD_T, _DD_M) - 0.11 * np.clip(np.abs(cl) - 0.2, -0.2, 1.0)
    if physics.compressibility:
        m = np.clip(np.minimum(mach, m_dd + 0.05), 0.0, 0.9)
        beta = np.sqrt(1.0 - m * m)
        # suction that carries the lift is about half of cl: Karman-Tsien with Cp0 = -|cl| / 2
        gain = 1.0 / (beta - m * m / (1.0 + beta) * np.minimum(np.abs(cl), 1.2) / 4.0)
        stall = 1.0 - 0.3 * _step((mach - m_dd - 0.05) / 0.15)
        attached = 1.0 - _step((np.abs(a) - np.radians(14.0)) / np.radians(14.0))
        cl = cl * (1.0 + physics.compressibility * (gain * stall - 1.0) * attached)
    if physics.drag_divergence:
        x = np.maximum(mach - m_dd + 0.07, 0.0)
        cd = cd + physics.drag_divergence * np.minimum(5.8 * x**3, 0.12)
    return cl, cd

"""Duct correction: what a duct, its lip, its exit and a stator do to the momentum balance of a rotor.

Control volume (McCormick 1967, "Aerodynamics of V/STOL Flight", ch. 9; Pereira 2008, PhD thesis Univ. of Maryland,
sec. 2.2, eq. 2.20-2.40; notation ours).  With ``w`` the mean axial speed of an annulus of the disk, ``sigma_w =
A_exit / A_disk`` and the jet far behind, at the pressure of the stream, at ``V_j``::

    w = sigma_w q(V, V_j)                                 continuity
    dT_rotor + dT_stator = 1/2 rho (V_j^2 - V^2) dA       Bernoulli on both sides of the disk
    dT_total = rho w (V_j - V) dA                         momentum of the whole system

The mean speed q through the exit is ``c_0 V_j`` at rest and ``c_V V`` where the rotor adds nothing to the stream: the
jet's area there is that share of the exit's.  Both are 1 for a long straight pipe; else they and what lies between
follow from the walls (:mod:`bemt.physics.bem.duct_stream`).  At rest T_rotor / T_total
= 1 / (2 sigma_w c_0); 1/2 gives back the open rotor.  Losses enter Bernoulli as ``1/2 rho (K_wall w^2 + K_lip (w -
V)^2)``.  A stator turns the swirl ``2 v_t`` behind the rotor back into pressure, ``dT_stator = eta_s 1/2 rho (2 v_t)^2
dA``.  The annuli are independent of each other, as in the open rotor.

Swirl that is left lowers the pressure in the jet.  A stream tube keeps r v_t on its way from the rotor's annulus to
the jet, where radial equilibrium gives the pressure (H. Glauert in W.F. Durand ed., Aerodynamic Theory IV, div. L,
ch. VII, 1935; J.H. Horlock 1958, Axial Flow Compressors, ch. 4; neither checked).  Take a uniform swirl s behind the
rotor and radii r -> sqrt(y) by equal shares of area, y_c < y < Y.  With s^2 E the rise of the swirl's energy and s^2 P
the fall of p / rho below the stream's::

    E(y) = 1/2 (r^2 / y - 1)       P(y) = 1/2 int_y^Y r^2 / y'^2 dy'       w_e^2 = V_j^2 + 2 s^2 (P - E)
    T = int rho (w_e^2 - V w_e - s^2 P) dA - rho s^2 P(y_c) pi (y_c - y_body)

The swirl is not quite uniform: with E goes the s^2 that has its energy, with P the one that has its fall of pressure
from tip to hub, s^2 ln(R / Rhub) = int (2 v_t)^2 dr / r.
To first order in s^2 and with the mass flow of a stream without swirl, the jet needs less area by its greater speed,
and what it leaves is a core of dead air, y_c = (A_jet / pi) (s / V_j)^2 mean(P - E), unless the body in the exit is
wider.  Then swirl takes ::

    D_swirl = (1 - eta_s) rho s^2 (A_jet mean(E) + pi (y_c - y_body) P(y_c))

the energy of the spin-up where the body closes and the jet contracts, and the suction on the core.  A body that
reaches the exit (y_body > 0) goes on behind it, and its tail is not known.  What a diffuser gives back by slowing the
swirl down is not counted (mean(E) at least 0: declared).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.physics.bem.residual import RE_HELD, RE_LEFT

if TYPE_CHECKING:
    from geometry.duct import Duct
    from geometry.rotor import Rotor

# Rounded entrance, loss over 1/2 rho w^2 against lip radius / hydraulic diameter.  Nominal: Crane TP-410, p. A-29;
# upper end: Idelchik (2007), Handbook of Hydraulic Resistance, 4th ed., diagram 3-4 (both from memory, not checked);
# lower end: none, from r/D 0.05 on; a lip that does not separate has friction only, which the walls' holds already.
_LIP_R_D = np.array([0.0, 0.02, 0.04, 0.06, 0.10, 0.15])
_LIP_K = np.array([0.50, 0.28, 0.24, 0.15, 0.09, 0.04])
_LIP_R_D_HIGH = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.12, 0.16, 0.20])
_LIP_K_HIGH = np.array([0.50, 0.43, 0.36, 0.31, 0.26, 0.22, 0.20, 0.15, 0.09, 0.06, 0.03])

# Outer wall behind its widest place: the stream follows it up to the first angle and has left it at the second, where
# it neither squeezes the jet nor gives its pressure back: base pressure (the two angles are declared).
_BOATTAIL = math.radians(18.0), math.radians(24.0)
# A stream that has left the outer nose squeezes the jet less: share of what a wall does that it has left altogether.
# Set on the torque of nozzle 19A at pitch 1.0, whose error then changes least with the load; no other pitch, no thrust.
_UNSQUEEZED = 0.2

# Steps at most in which the core of a swirling jet settles; each takes off most of what is left.
_CORE_STEPS = 12

# Turbulent skin friction of duct walls at Re of 1e5 to 1e7, Prandtl's 0.455/log10(Re)^2.58 between 0.007 and 0.003.
WALL_FRICTION, WALL_FRICTION_RANGE = 0.005, (0.003, 0.007)
# Profile drag of a ring aerofoil over friction of its wetted side: Hoerner (1965), Fluid-Dynamic Drag, ch. 6,
# 1 + 2 t/c for t/c about 0.12.
FORM_FACTOR = 1.25
# Share of the swirl's dynamic pressure that a stator of ordinary solidity turns back into pressure.
STATOR_RECOVERY = 0.8


class LipLoss(NamedTuple):
    """Loss over 1/2 rho w^2 and the range that sources give."""

    nominal: float
    low: float
    high: float


def lip_loss(radius_over_diameter: float) -> LipLoss:
    """Inlet loss of a rounded duct lip at rest. [1]

    Notes
    -----
    Crane TP-410; Idelchik (2007), diagram 3-4 (not checked against the books).

    >>> tuple(round(k, 2) for k in lip_loss(0.1))
    (0.09, 0.0, 0.12)
    """
    x = max(radius_over_diameter, 0.0)
    low = float(np.interp(x, [0.0, 0.05], [0.50, 0.0]))
    nominal, high = (float(np.interp(x, *table)) for table in ((_LIP_R_D, _LIP_K), (_LIP_R_D_HIGH, _LIP_K_HIGH)))
    return LipLoss(nominal, min(low, nominal), max(high, nominal))


@dataclass(frozen=True)
class DuctFlow:
    """The numbers by which a duct enters the momentum balance."""

    wake_ratio: float  # sigma_w, exit area over the rotor's annulus [1]
    # Loss coefficients on w^2 and (w - V)^2 [1]
    wall_loss: float = 0.0
    lip_loss: float = 0.0
    stator: float = 0.0  # Share of the swirl's dynamic pressure recovered behind the rotor, 0 without a stator [1]
    gap: float = 0.0  # Tip gap [m]
    span: float = 1.0  # Blade height, R - Rhub [m]
    drag_area: float = 0.0  # Drag of the outer wall over 1/2 rho V^2 [m2]
    # Area of the jet over the exit's, at rest (c_0) and where the rotor adds nothing to the stream (c_V) [1]
    contraction: float = 1.0
    capture: float = 1.0
    # Departure of the jet's speed from a straight line between the two, see :mod:`bemt.physics.bem.duct_stream` [1]
    bend: float = 0.0
    area: float = float("nan")  # Swept annulus, pi (R^2 - Rhub^2) [m2]
    # Radius of the body in the exit plane; NaN leaves out what swirl does to the jet [m]
    exit_hub: float = float("nan")
    length: float = 0.0  # Of the duct [m]
    # V / V_j, rising, and the drag of an outer wall that the stream leaves at its nose over 1/2 rho V^2 [m2]; () if the
    # shape is not known
    nose_drag: tuple[tuple[float, float], ...] = ()
    nose_capture: float = 0.0  # What `capture` gains then [1]

    def left(self, V: Array, viscosity: ArrayLike) -> Array:
        """Share of the stream that leaves the outer nose at a kinematic viscosity [m2/s]; as the kernel's. [1]"""
        Re = np.abs(V) * self.length / np.maximum(viscosity, 1e-12)
        return np.asarray(np.interp(Re, (RE_LEFT, RE_HELD), (1.0, 0.0)))

    def drag(self, V: Array, jet: Array, viscosity: ArrayLike) -> Array:
        """Drag of the outer wall over the density, at jets [m/s] and a kinematic viscosity [m2/s]. [m4/s2]"""
        area: Array | float = self.drag_area
        if self.nose_drag:
            with np.errstate(divide="ignore", invalid="ignore"):
                nu = np.where(jet > 0.0, V / jet, 0.0)
            area = area + self.left(V, viscosity) * np.interp(nu, *np.transpose(self.nose_drag))
        return np.asarray(0.5 * V * np.abs(V) * area)

    def jet_speed(self, w: Array, V: Array, viscosity: ArrayLike = 0.0) -> Array:
        """Speed of the jet far behind for a mean speed w through the disk; as the kernel's. [m/s]"""
        capture = self.capture + self.nose_capture * self.left(V, viscosity)
        y = w / (self.wake_ratio * self.contraction)
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = np.where(V > 0.0, self.bend * V / np.hypot(y, V), 0.0)
        return np.asarray(V + (y - capture / self.contraction * V) * (1.0 + bend))

    def balance(self, w: Array, V: Array, viscosity: ArrayLike) -> tuple[Array, Array]:
        """Thrust over density and swept area, and the duct's share of it, at a speed through the disk; no swirl."""
        jet = self.jet_speed(w, V, viscosity)
        T = w * (jet - V) - self.drag(V, jet, viscosity) / self.area
        own = 0.5 * (jet**2 - V**2 + self.wall_loss * w**2 + self.lip_loss * (w - V) ** 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(T), np.asarray(1.0 - own / T)

    def share_at(self, thrust: Array, V: Array, viscosity: ArrayLike = 1.5e-5) -> Array:
        """Share of the duct at a thrust over density [m4/s2], an airspeed [m/s] and a kinematic viscosity [m2/s], (P,).

        NaN where none is left.
        """
        wanted = np.asarray(thrust) / self.area
        capture = self.capture + self.nose_capture * self.left(V, viscosity)
        low = self.wake_ratio * capture * np.abs(V)  # the rotor adds nothing
        high = low + 4.0 * np.sqrt(np.abs(wanted)) + 1e-9
        lost = self.balance(low, V, viscosity)[0] > wanted
        for _ in range(60):
            w = 0.5 * (low + high)
            above = self.balance(w, V, viscosity)[0] > wanted
            low, high = np.where(above, low, w), np.where(above, w, high)
        return np.where(lost, np.nan, self.balance(0.5 * (low + high), V, viscosity)[1])

    def total(self, rho: Array, V: Array, mu: Array, out: Array) -> tuple[Array, Array, Array]:
        """Thrust of rotor, stator and duct together."""
        mdot, jet, stator = out[:, 2], out[:, 3], out[:, 4]
        with np.errstate(divide="ignore", invalid="ignore"):
            V_jet = np.where(mdot > 0.0, jet / mdot, np.nan)
        T = jet - mdot * V - rho * self.drag(V, V_jet, mu / rho)
        with np.errstate(divide="ignore", invalid="ignore"):
            v_exit = np.where(mdot > 0.0, np.copysign(mdot / (rho * self.area * self.wake_ratio), jet), np.nan)
        return T - self._swirl_drag(rho, mdot, jet, out[:, 10], out[:, 11]), stator, v_exit

    def _swirl_drag(self, rho: Array, mdot: Array, jet: Array, spin: Array, whirl: Array) -> Array:
        """Thrust that the swirl left in the jet takes; the head of this module has the formula. [N]"""
        if math.isnan(self.exit_hub):
            return np.zeros_like(mdot)
        tip2 = (0.5 * (self.area / (math.pi * self.span) + self.span)) ** 2
        hub2 = tip2 - self.area / math.pi
        runs = (mdot > 0.0) & (jet > 0.0)
        m = np.where(runs, mdot, 1.0)
        Vj = np.where(runs, jet / m, 1.0)
        left = np.where(runs, 1.0 - self.stator, 0.0)
        s2_E, s2_P = left * whirl / m, left * spin / (0.5 * math.log(tip2 / hub2))
        y_jet = m / (np.pi * rho * Vj)
        body = self.exit_hub**2 * np.pi * y_jet / (self.wake_ratio * self.area)
        edge, core = body + y_jet, np.maximum(body, 1e-6 * y_jet)
        for step in range(_CORE_STEPS + 1):
            wide = edge - core
            slope = (tip2 - hub2) / wide
            foot = hub2 - core * slope
            ln = np.log(edge / core)
            E = 0.5 * (foot * ln / wide + slope - 1.0)
            P = 0.5 * (foot * (ln / wide - 1.0 / edge) + slope * (1.0 - core * ln / wide))
            gain = (s2_P * P - s2_E * E) / Vj**2
            found = np.maximum(body, np.clip(gain, 1e-6, 0.5) * y_jet)
            if step == _CORE_STEPS or np.array_equal(found, core):
                break
            core = found
        suction = 0.5 * (foot * (1.0 / core - 1.0 / edge) + slope * ln)
        D = y_jet * s2_E * np.maximum(E, 0.0) + (core - body) * s2_P * suction
        return np.asarray(np.pi * rho * D)


def hydraulic_diameter(duct: Duct, rotor: Rotor) -> float:
    """Twice the height of the passage [m]."""
    return 2.0 * (duct.inner_radius - rotor.Rhub)


def duct_flow(duct: Duct, rotor: Rotor, wall_friction: float = WALL_FRICTION) -> DuctFlow:
    """Momentum numbers of a duct around a rotor, with the friction coefficient of its walls [1]."""
    from bemt.physics.bem.duct_stream import BASE_PRESSURE, NOSE_NU, jet_area  # which an open rotor does not need

    duct.check(rotor)
    hydraulic = hydraulic_diameter(duct, rotor)
    outer = duct.inner_radius + duct.lip_radius
    jet = jet_area(duct, rotor.Rhub)
    left, base = _boattail(duct)
    nose: tuple[tuple[float, float], ...] = ()
    if duct.outer_radius is not None and wall_friction > 0.0:  # of a known shape, in a stream with a boundary layer
        facing = math.pi * (duct.outer_radius**2 - float(duct.exit_radius or 0.0) ** 2)  # with the trailing edge
        behind = BASE_PRESSURE * max(facing - left * base, 0.0)
        area = duct.inner_radius**2
        nose = tuple((nu, behind + lost * area) for nu, lost in zip(NOSE_NU, jet.nose, strict=True))
    return DuctFlow(
        wake_ratio=duct.exit_area / rotor.annulus_area,
        wall_loss=wall_friction * 4.0 * duct.length / hydraulic,
        lip_loss=lip_loss(duct.lip_radius / hydraulic).nominal,
        stator=STATOR_RECOVERY if duct.stator is not None else 0.0,
        gap=duct.gap,
        span=rotor.R - rotor.Rhub,
        drag_area=wall_friction * FORM_FACTOR * 2.0 * math.pi * outer * duct.length + left * BASE_PRESSURE * base,
        contraction=jet.at_rest,
        capture=jet.in_stream + left * (jet.at_rest - jet.in_stream),
        bend=(1.0 - left) * jet.bend,
        area=rotor.annulus_area,
        exit_hub=duct.exit_hub_radius,
        length=duct.length,
        nose_drag=nose,
        nose_capture=_UNSQUEEZED * (1.0 - left) * (jet.at_rest - jet.in_stream) if nose else 0.0,
    )


def _boattail(duct: Duct) -> tuple[float, float]:
    """Share of the stream that has left the outer wall behind its widest place, and the area facing back [m2]."""
    x = np.linspace(0.0, duct.length, 201)
    r = duct.outer(x)
    widest = int(np.argmax(r))
    angle = math.atan2(float(r[widest] - r[-1]), max(float(x[-1] - x[widest]), 1e-9))
    left = (angle - _BOATTAIL[0]) / (_BOATTAIL[1] - _BOATTAIL[0])
    return min(max(left, 0.0), 1.0), math.pi * float(r[widest] ** 2 - r[-1] ** 2)

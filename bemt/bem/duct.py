"""Duct correction: what a duct, its lip, its exit and a stator do to the momentum balance of a rotor.

Control volume (McCormick 1967, "Aerodynamics of V/STOL Flight", ch. 9; Pereira 2008, PhD thesis Univ. of Maryland,
sec. 2.2, eq. 2.20-2.40; notation ours).  The jet leaves at the exit with free-stream pressure and does not contract
further, so with ``w`` the axial speed at the disk and ``sigma_w = A_exit / A_disk``::

    V_j = w / sigma_w                                     continuity
    dT_rotor + dT_stator = 1/2 rho (V_j^2 - V^2) dA       Bernoulli on both sides of the disk
    dT_total = rho w (V_j - V) dA                         momentum of the whole system

At rest T_rotor / T_total = 1 / (2 sigma_w); sigma_w = 1/2 gives back the open rotor.  Losses enter Bernoulli as
``1/2 rho (K_wall w^2 + K_lip (w - V)^2)``.  A stator turns the swirl ``2 v_t`` behind the rotor back into pressure,
``dT_stator = eta_s 1/2 rho (2 v_t)^2 dA``.  The annuli are independent of each other, as in the open rotor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from geometry.duct import Duct
    from geometry.rotor import Rotor

Array = NDArray[np.float64]

# Bellmouth in an end wall, loss over 1/2 rho w^2 against lip radius / diameter: Idelchik (2007), Handbook of Hydraulic
# Resistance, 4th ed., diagram 3-4 (values from memory of the diagram, not checked against the book).
_LIP_R_D = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.12, 0.16, 0.20])
_LIP_K = np.array([0.50, 0.43, 0.36, 0.31, 0.26, 0.22, 0.20, 0.15, 0.09, 0.06, 0.03])

# Turbulent skin friction of duct walls at Re of 1e5 to 1e7, Prandtl's 0.455/log10(Re)^2.58 between 0.007 and 0.003.
WALL_FRICTION = 0.005
# Profile drag of a ring aerofoil over friction of its wetted side: Hoerner (1965), Fluid-Dynamic Drag, ch. 6,
# 1 + 2 t/c for t/c about 0.12.
FORM_FACTOR = 1.25
# Share of the swirl's dynamic pressure that a stator of ordinary solidity turns back into pressure.
STATOR_RECOVERY = 0.8


def lip_loss(radius_over_diameter: float) -> float:
    """Inlet loss of a rounded duct lip at rest.

    Parameters
    ----------
    radius_over_diameter : float
        Lip radius over inner diameter [1].

    Returns
    -------
    float
        Loss of total pressure over 1/2 rho w^2 [1].

    Notes
    -----
    Idelchik (2007), diagram 3-4 (not checked against the book).

    >>> lip_loss(0.05)
    0.22
    """
    return float(np.interp(max(radius_over_diameter, 0.0), _LIP_R_D, _LIP_K))


@dataclass(frozen=True)
class DuctFlow:
    """The numbers by which a duct enters the momentum balance.

    Attributes
    ----------
    wake_ratio : float
        sigma_w, exit area over the rotor's annulus [1].
    wall_loss, lip_loss : float
        Loss coefficients on w^2 and (w - V)^2 [1].
    stator : float
        Share of the swirl's dynamic pressure recovered behind the rotor, 0 without a stator [1].
    gap : float
        Tip gap [m].
    span : float
        Blade height, R - Rhub [m].
    drag_area : float
        Drag of the outer wall over 1/2 rho V^2 [m2].
    """

    wake_ratio: float
    wall_loss: float = 0.0
    lip_loss: float = 0.0
    stator: float = 0.0
    gap: float = 0.0
    span: float = 1.0
    drag_area: float = 0.0

    def total(self, rho: Array, V: Array, out: Array) -> tuple[Array, Array, Array]:
        """Thrust of rotor, stator and duct together.

        Parameters
        ----------
        rho, V : (P,) float
            Density [kg/m3], onset speed [m/s].
        out : (P, 8) float
            Kernel output [N, N m, kg/s, kg m/s2, ...], see :func:`bemt.bem.kernel.entry`.

        Returns
        -------
        tuple of (P,) float
            Total thrust [N], stator thrust [N], mass-averaged exit speed [m/s].
        """
        mdot, mdot_w, stator = out[:, 2], out[:, 3], out[:, 4]
        jet = mdot_w / self.wake_ratio
        T = jet - mdot * V - 0.5 * rho * V * np.abs(V) * self.drag_area
        with np.errstate(divide="ignore", invalid="ignore"):
            v_exit = np.where(mdot > 0, jet / mdot, np.nan)
        return T, stator, v_exit


def duct_flow(duct: Duct, rotor: Rotor) -> DuctFlow:
    """Momentum numbers of a duct around a rotor.

    Parameters
    ----------
    duct : geometry.duct.DuctEffect
        Duct.
    rotor : geometry.rotor.Rotor
        Rotor inside it.

    Returns
    -------
    DuctFlow
        For :func:`bemt.bem.solver.prepare`.

    Raises
    ------
    ValueError
        If the duct does not fit the rotor.
    """
    duct.check(rotor)
    annulus = math.pi * (rotor.R**2 - rotor.Rhub**2)
    hydraulic = 2.0 * (duct.inner_radius - rotor.Rhub)
    outer = duct.inner_radius + duct.lip_radius
    return DuctFlow(
        wake_ratio=duct.exit_area / annulus,
        wall_loss=WALL_FRICTION * 4.0 * duct.length / hydraulic,
        lip_loss=lip_loss(duct.lip_radius / (2.0 * duct.inner_radius)),
        stator=STATOR_RECOVERY if duct.stator is not None else 0.0,
        gap=duct.gap,
        span=rotor.R - rotor.Rhub,
        drag_area=WALL_FRICTION * FORM_FACTOR * 2.0 * math.pi * outer * duct.length,
    )

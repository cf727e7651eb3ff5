"""Mutual interference of blades at high solidity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.effects.base import Baking, Effect, Parameter

Array = NDArray[np.float64]


def weinig_factor(solidity: Array, stagger: Array) -> Array:
    """Lift-slope ratio of an infinite row of flat plates to a single one.

    Parameters
    ----------
    solidity : (N,) float
        Chord over spacing [1].
    stagger : (N,) float
        Angle between chord and the normal of the row (the rotor axis) [rad].

    Returns
    -------
    (N,) float
        K in cl = 2 pi K sin(alpha), alpha against the mean of the velocities before and behind the row [1].

    Notes
    -----
    Conformal mapping of the row on a circle, Weinig (1935), "Die Stroemung um die Schaufeln von Turbomaschinen"; in
    the form of Scholz (1965), "Aerodynamik der Schaufelgitter", ch. 3.  Checked in the tests against a vortex sheet
    solution and the closed forms (2/pi s) tanh(pi s / 2) at stagger 0 and (2/pi s) tan(pi s / 2) at 90 deg.

    >>> round(float(weinig_factor(np.array([1.0]), np.array([0.0]))[0]), 4)
    0.5839
    """
    s = np.maximum(np.asarray(solidity, dtype=float), 1e-4)
    lam = np.clip(np.asarray(stagger, dtype=float), -1.55, 1.55)
    s, lam = np.broadcast_arrays(s, lam)
    lo = np.full(s.shape, 1e-9)  # log(R)
    hi = np.full(s.shape, 12.0)
    for _ in range(80):
        mid = 0.5 * (lo + hi)
        large = _row_solidity(np.exp(mid), lam) > s
        lo = np.where(large, mid, lo)
        hi = np.where(large, hi, mid)
    R = np.exp(0.5 * (lo + hi))
    chi = np.arctan(np.tan(lam) * (R**2 - 1.0) / (R**2 + 1.0))
    return np.asarray(4.0 * R * np.cos(chi) / (np.pi * s * np.cos(lam) * (R**2 + 1.0)))


def _row_solidity(R: Array, lam: Array) -> Array:
    chi = np.arctan(np.tan(lam) * (R**2 - 1.0) / (R**2 + 1.0))
    c = 2.0 * R * np.cos(chi)
    log = np.log((R**2 + c + 1.0) / (R**2 - c + 1.0))
    return np.asarray((np.cos(lam) * log + 2.0 * np.sin(lam) * np.arctan2(2.0 * R * np.sin(chi), R**2 - 1.0)) / np.pi)


@dataclass(frozen=True)
class Cascade(Effect):
    """Lift of a blade in a row: cl = K(solidity, stagger) cl_isolated, K from Weinig's flat-plate row.

    Notes
    -----
    The row turns the flow at most to the blades' own exit angle, which isolated sections do not know: at solidity 1
    they would turn it half as far again.  Applied to every rotor; at the solidity of a two-blade propeller (below
    0.1) K differs from 1 by less than 1 %.  K is held between 0.2 and 1.3: in-line plates (K growing without
    bound towards solidity 1) do not happen on rotors that pump.  A ducted row also pays for the walls: Howell (1945),
    Proc. IMechE 153:441, secondary loss 0.018 cl^2 and annulus loss 0.020 s/h, with spacing s and blade height h (as
    quoted in Cohen, Rogers and Saravanamuttoo, Gas Turbine Theory, sec. 5.9; not checked against the paper).
    """

    secondary: float = 0.018
    annulus: float = 0.020

    id = "cascade"
    inviscid = True
    title = "interference between blades at high solidity"
    sign = "less lift where blades overlap; only rotors of solidity above about 0.3 show it"
    diagnosed = False
    parameters = (
        Parameter("secondary", "1", 0.010, 0.030, "Howell 1945: 0.018", steps=0),
        Parameter("annulus", "1", 0.010, 0.030, "Howell 1945: 0.020", steps=0),
    )
    order = 30

    def section(self, bake: Baking) -> None:
        """Scale lift."""
        K = np.clip(weinig_factor(bake.sigma, 0.5 * np.pi - bake.beta), 0.2, 1.3)
        bake.cl *= K[:, None, None, None]
        if bake.ducted:
            pitch_over_height = 2.0 * np.pi * bake.r / bake.B / (bake.R - bake.Rhub)
            # a correlation of compressor rows: faded out below their solidity
            row = np.clip((bake.sigma - 0.3) / 0.3, 0.0, 1.0)
            wall = self.annulus * pitch_over_height
            bake.cd += row[:, None, None, None] * (self.secondary * bake.cl**2 + wall[:, None, None, None])

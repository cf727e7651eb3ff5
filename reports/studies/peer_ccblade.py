"""CCBlade of WISDEM (extra ``wisdem``): S. A. Ning, Wind Energy 17(9), 2014, DOI 10.1002/we.1636."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bemt.physics.air import Air
    from bemt.physics.sections.polars import Polar
    from geometry.rotor import Rotor

Array = NDArray[np.float64]

TITLE = "CCBlade"
STATIONS = 30
SLOW_J = (0.02, 0.04)
"""It gives no loads at rest; there its results at these advance ratios are carried on in a straight line [1]."""


@dataclass(frozen=True)
class _TurbineFoil:
    """Section in CCBlade's sense: a turbine's, which is a propeller's turned over; its Reynolds number is CCBlade's."""

    alpha: Array
    ln_Re: Array
    cl: Array
    cd: Array

    def evaluate(self, alpha: float, Re: float, return_cm: bool = False) -> tuple[float, ...]:  # noqa: N803
        """Lift and drag coefficients; CCBlade calls this."""
        i = min(max(int(np.searchsorted(self.ln_Re, np.log(max(Re, 1.0)))) - 1, 0), self.ln_Re.size - 2)
        w = float(np.clip((np.log(max(Re, 1.0)) - self.ln_Re[i]) / (self.ln_Re[i + 1] - self.ln_Re[i]), 0.0, 1.0))
        cl, cd = (
            (1.0 - w) * np.interp(-alpha, self.alpha, t[:, i]) + w * np.interp(-alpha, self.alpha, t[:, i + 1])
            for t in (self.cl, self.cd)
        )
        return (-float(cl), float(cd), 0.0) if return_cm else (-float(cl), float(cd))


def solve(rotor: Rotor, tables: Sequence[tuple[float, Polar]], rpm: Array, J: Array, air: Air) -> Array:
    """CT and CP at points, (2, P), NaN where CCBlade gives none."""
    from wisdem.ccblade.ccblade import CCBlade  # extra wisdem

    s = rotor.blade.midpoints(STATIONS)
    at = np.array([x for x, _ in tables])
    grids = [p.on_grid() for _, p in tables]
    foils = []
    for r in s.r / rotor.R:
        weights = [float(np.interp(r, at, row)) for row in np.eye(at.size)]
        cl, cd = (sum(w * getattr(g, q)[:, :, 0] for w, g in zip(weights, grids, strict=True)) for q in ("cl", "cd"))
        foils.append(_TurbineFoil(grids[0].alpha, np.log(grids[0].Re), np.asarray(cl), np.asarray(cd)))
    where = (s.r, s.chord, np.degrees(s.beta), foils, rotor.Rhub, rotor.R, rotor.B)
    blade = CCBlade(*where, air.rho, air.mu, shearExp=0.0)

    def one(n_rpm: float, advance: float) -> tuple[float, float]:
        n = n_rpm / 60.0
        got = blade.evaluate([advance * n * rotor.D], [n_rpm], [0.0])
        loads = got[0] if isinstance(got, tuple) else got
        T, Q = -float(np.ravel(loads["T"])[0]), -float(np.ravel(loads["Q"])[0])
        unit = air.rho * n**2 * rotor.D**4
        return (T / unit, 2.0 * np.pi * Q / (unit * rotor.D)) if T != 0.0 else (np.nan, np.nan)

    out = np.empty((2, rpm.size))
    for k in range(rpm.size):
        if J[k] >= SLOW_J[0]:
            out[:, k] = one(rpm[k], J[k])
        else:
            a, b = (np.array(one(rpm[k], j)) for j in SLOW_J)
            out[:, k] = a + (a - b) * (SLOW_J[0] - J[k]) / (SLOW_J[1] - SLOW_J[0])
    return out

"""Derivatives of thrust and torque by every blade element's chord and angle, and by the operating point.

The annuli of a blade do not know of each other: all chords (or all angles) are moved at once, and the change of each
element's own load is the derivative of the sum by that element's input. So all stations cost four solves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.bem import solver
from bemt.bem.model import Model, acts_on_points, acts_on_rotor

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.bem.solver import Prepared
    from bemt.effects import Effect
    from geometry.blade import Stations

__all__ = ["Gradient", "gradient"]

Array = NDArray[np.float64]

STEP = 1e-6
"""Relative step of the central differences; of blade angles in radians, of airspeed in tip speeds."""


@dataclass(frozen=True, eq=False)
class Gradient:
    """Loads at one point, and how they change.

    Attributes
    ----------
    stations : Stations
        Blade elements. [m], [rad]
    thrust_N, torque_Nm : float
        Rotor thrust (without duct and stator) [N] and shaft torque [N m].
    chord, beta : (2, N) float
        Derivatives of thrust and torque by each element's chord [N/m], [N m/m] and blade angle [N/rad], [N m/rad].
    rpm, airspeed, density : (2,) float
        Derivatives of thrust and torque by rev/min, m/s, kg/m3 (viscosity, speed of sound held) [N/unit], [N m/unit].
    """

    stations: Stations
    thrust_N: float
    torque_Nm: float
    chord: Array
    beta: Array
    rpm: Array
    airspeed: Array
    density: Array

    @property
    def pitch(self) -> Array:
        """Derivatives by an angle that the whole blade turns [N/rad], [N m/rad]."""
        return np.asarray(self.beta.sum(axis=1))


def gradient(
    model: Model,
    effects: Sequence[Effect],
    rpm: float,
    airspeed_m_s: float,
    air: Air,
    stations: Stations | None = None,
    step: float = STEP,
) -> Gradient:
    """Differentiate the rotor's thrust and torque at one point.

    Notes
    -----
    Section tables are linear between their nodes: a derivative is that of the cell in which the element works and jumps
    by some 0.4 % from cell to cell.

    Examples
    --------
    >>> from bemt.air import Air
    >>> from bemt.sections.polars import linear_polar
    >>> from geometry.laws import helix
    >>> from geometry.rotor import Rotor
    >>> model = Model(Rotor(helix(0.254, 0.127), 2), [(0.75, linear_polar(cd=0.01))])
    >>> g = gradient(model, (), 6000.0, 5.0, Air.from_density())
    >>> g.chord.shape, bool(g.pitch[0] > 0), bool(g.airspeed[0] < 0)
    ((2, 40), True, True)
    """
    around = [e.id for e in effects if acts_on_points(e)]
    if around:
        raise InputError(Fault("", "effects", ", ".join(around), "effects inside the rotor", "Differentiate without"))
    here = stations if stations is not None else model.rotor.blade.midpoints(model.n_stations, spacing="cosine")
    base = _prepared(model, effects, here)
    thrust, torque = _elements(base, rpm, airspeed_m_s, air)

    def by(low: Stations, high: Stations, width: Array) -> Array:
        a, b = (np.stack(_elements(_prepared(model, effects, s), rpm, airspeed_m_s, air)) for s in (low, high))
        return np.asarray((b - a) / width)

    dc, db = step * here.chord, np.full(here.beta.shape, step)
    chord = by(here._replace(chord=here.chord - dc), here._replace(chord=here.chord + dc), 2.0 * dc)
    beta = by(here._replace(beta=here.beta - db), here._replace(beta=here.beta + db), 2.0 * db)
    dn, dV, drho = step * rpm, step * rpm * np.pi / 30.0 * model.rotor.R, step * air.rho
    rest = [
        (rpm - dn, airspeed_m_s, air.rho),
        (rpm + dn, airspeed_m_s, air.rho),
        (rpm, airspeed_m_s - dV, air.rho),
        (rpm, airspeed_m_s + dV, air.rho),
        (rpm, airspeed_m_s, air.rho - drho),
        (rpm, airspeed_m_s, air.rho + drho),
    ]
    loads = np.array([[v.sum() for v in _elements(base, n, V, replace(air, rho=float(rho)))] for n, V, rho in rest])
    slopes = [(loads[2 * k + 1] - loads[2 * k]) / (2.0 * d) for k, d in enumerate((dn, dV, drho))]
    return Gradient(here, float(thrust.sum()), float(torque.sum()), chord, beta, *slopes)


def _prepared(model: Model, effects: Sequence[Effect], stations: Stations) -> Prepared:
    chosen = tuple(sorted((e for e in effects if acts_on_rotor(e)), key=lambda e: (e.order, e.id)))
    return solver.prepare(
        model.rotor,
        model.polars,
        chosen,
        model.duct,
        stations=stations,
        mach_max=model.mach_max,
        re_range=model.re_range,
    )


def _elements(prep: Prepared, rpm: float, V: float, air: Air) -> tuple[Array, Array]:
    """Thrust [N] and torque [N m] of each element, all blades."""
    s = solver.solve(prep, rpm, V, air, radial=True)
    if not s.converged[0]:
        raise InputError(Fault("", f"{rpm:g} rev/min, {V:g} m/s", "; ".join(s.flags[0]), "a converged point"))
    return s.radial["dT"][0], s.radial["dQ"][0]

"""Derivatives of thrust and torque by every blade element's chord and angle, and by the operating point.

The annuli of a blade do not know of each other: all chords (or all angles) are moved at once, and the change of each
element's own load is the derivative of the sum by that element's input. So all stations cost four solves. The
moved rotors are prepared once per geometry; every further operating point costs eleven solves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.physics.bem import kernel as K
from bemt.physics.bem import solver
from bemt.physics.bem.model import Model, acts_on_points, acts_on_rotor

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.solver import Prepared
    from bemt.physics.effects import Effect
    from geometry.rotor import Stations

STEP = 1e-6
"""Relative step of the central differences; of blade angles in radians, of airspeed in tip speeds."""
_RAD_PER_RPM = math.pi / 30.0


@dataclass(frozen=True, eq=False)
class Gradient:
    """Loads at one point, and how they change."""

    stations: Stations  # Blade elements. [m], [rad]
    # Rotor thrust (without duct and stator) [N] and shaft torque [N m]
    thrust_N: float
    torque_Nm: float
    # (2, N) Derivatives of thrust and torque by each element's chord [N/m], [N m/m] and blade angle [N/rad], [N m/rad]
    chord: Array
    beta: Array
    # (2,) Derivatives of thrust and torque by rev/min, m/s, kg/m3 (viscosity, speed of sound held) [N/unit], [N m/unit]
    rpm: Array
    airspeed: Array
    density: Array

    @property
    def pitch(self) -> Array:
        """Derivatives by an angle that the whole blade turns [N/rad], [N m/rad]."""
        return np.asarray(self.beta.sum(axis=1))


def gradient(
    model: Model, effects: Sequence[Effect], rpm: float, airspeed_m_s: float, air: Air,
    stations: Stations | None = None, step: float = STEP,
) -> Gradient:  # fmt: skip
    """Differentiate the rotor's thrust and torque at one point.

    Notes
    -----
    Section tables are linear between their nodes: a derivative is that of the cell in which the element works and jumps
    by some 0.4 % from cell to cell.

    Examples
    --------
    >>> from bemt.physics.air import Air
    >>> from bemt.physics.sections.polars import linear_polar
    >>> from geometry.laws import helix
    >>> from geometry.rotor import Rotor
    >>> model = Model(Rotor(helix(0.254, 0.127), 2), [(0.75, linear_polar(cd=0.01))])
    >>> g = gradient(model, (), 6000.0, 5.0, Air.from_density())
    >>> g.chord.shape, bool(g.pitch[0] > 0), bool(g.airspeed[0] < 0)
    ((2, 40), True, True)
    """
    rotors = moved(model, effects, stations, step)
    tip = rpm * _RAD_PER_RPM * model.rotor.R
    dn, dV, drho = step * rpm, step * tip, step * air.rho
    rates, speeds, densities = (np.array([[0, 1, -1, 0, 0, 0, 0], [0, 0, 0, 1, -1, 0, 0], [0, 0, 0, 0, 0, 1, -1]])
                                * [[dn], [dV], [drho]] + [[rpm], [airspeed_m_s], [air.rho]])  # fmt: skip
    around_point = elements(rotors.base, rates, speeds, densities, air)
    sums = around_point.sum(axis=2)
    here = ([rpm], [airspeed_m_s], [air.rho], air)
    chord, beta = (
        (elements(high, *here)[:, 0] - elements(low, *here)[:, 0]) / width
        for low, high, width in (rotors.chord, rotors.beta)
    )
    by = [(sums[:, 2 * k + 1] - sums[:, 2 * k + 2]) / (2.0 * d) for k, d in enumerate((dn, dV, drho))]
    return Gradient(rotors.base.stations, float(sums[0, 0]), float(sums[1, 0]), chord, beta, *by)


def loads(
    model: Model, effects: Sequence[Effect], rpm: float, airspeed_m_s: float, air: Air, stations: Stations
) -> tuple[float, float]:
    """Thrust [N] and torque [N m] of the rotor with these stations."""
    both = elements(only(model, effects, stations), [rpm], [airspeed_m_s], [air.rho], air)
    return float(both[0].sum()), float(both[1].sum())


class PerturbedRotors(NamedTuple):
    """The rotor, and rotors whose chords (angles) are all a little smaller and larger, with the distance between."""

    base: Prepared
    chord: tuple[Prepared, Prepared, Array]
    beta: tuple[Prepared, Prepared, Array]


def moved(
    model: Model, effects: Sequence[Effect], stations: Stations | None = None, step: float = STEP
) -> PerturbedRotors:
    """Rotors around the one to be differentiated: what differs between them is the derivative, element by element."""
    chosen = _inside(effects)
    s = stations if stations is not None else model.rotor.blade.midpoints(model.n_stations, spacing="cosine")

    def made(s: Stations) -> Prepared:
        return model.prepared(chosen, stations=s)

    def pair(key: str, width: Array) -> tuple[Prepared, Prepared, Array]:
        low, high = (made(s._replace(**{key: getattr(s, key) + sign * width})) for sign in (-1.0, 1.0))
        return low, high, 2.0 * width

    return PerturbedRotors(made(s), pair("chord", step * s.chord), pair("beta", np.full(s.beta.shape, step)))


def only(model: Model, effects: Sequence[Effect], stations: Stations) -> Prepared:
    """Rotor with these stations."""
    return model.prepared(_inside(effects), stations=stations)


def _inside(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects in the solver's order; those around the rotor are refused."""
    around = [e.id for e in effects if acts_on_points(e)]
    if around:
        raise InputError(Fault("", "effects", ", ".join(around), "effects inside the rotor", "Differentiate without"))
    return tuple(sorted((e for e in effects if acts_on_rotor(e)), key=lambda e: (e.order, e.id)))


def elements(
    prep: Prepared, rpm: ArrayLike, V: ArrayLike, rho: ArrayLike, air: Air, names: Sequence[str] = ("dT", "dQ")
) -> Array:
    """Columns of :class:`bemt.physics.bem.solver.Radial` at points, (K, P, N); thrust and torque are those of all
    blades.

    rpm [rev/min], V [m/s], rho [kg/m3]. InputError where a point does not converge.
    """
    points = np.empty((len(np.atleast_1d(rpm)), K.N_POINT))
    points[:, K.P_OMEGA], points[:, K.P_V], points[:, K.P_RHO] = np.multiply(rpm, _RAD_PER_RPM), V, rho
    points[:, K.P_MU], points[:, K.P_SOUND] = air.mu, air.a_sound
    out = np.empty((points.shape[0], K.N_OUT))
    radial = np.empty((points.shape[0], prep.st.shape[0], K.N_RADIAL))
    entry, *constant = prep.kernel
    entry(points, *constant, out, radial)
    loads = np.stack([radial[:, :, solver.Radial._fields.index(name)] for name in names])
    if np.any(out[:, K.O_STATUS] != K.OK) or not np.all(np.isfinite(loads)):
        s = solver.solve(prep, np.asarray(rpm), np.asarray(V), air)
        where = f"{np.ravel(rpm)[0]:g} rev/min, {np.ravel(V)[0]:g} m/s"
        raise InputError(Fault("", where, "; ".join(w for f in s.flags for w in f) or "no load", "a converged point"))
    return loads

"""What real rotors differ by from the solver, as the population of measured propellers shows it (`bemt.rotors`).

Without a reference nothing else says how far blade and solver may be off: of 26 propellers of UIUC, flown as published,
calibration alone called 14 unknown and named a cause of 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.judge.diagnose.record import CHANNELS
from bemt.rotors.model import air_of_points, beta75_deg, coefficients
from bemt.rotors.population import population
from bemt.rotors.predict import sense

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Part, Problem

_AIR = ("rho", "mu", "a_sound", "temperature_K")
# Coefficient at rest of a rotor that has none, so that shares of it are finite.
_NOTHING = 1e-12


def covariance(problem: Problem) -> Array:
    """Covariance of the readings over rotors of which as much is known as of the case's, (M, M)."""
    out, X = np.zeros((problem.y.size, problem.y.size)), problem.covariates
    first = np.cumsum([0, *(len(p.record) for p in problem.parts)])
    for key in dict.fromkeys(p.key for p in problem.parts):
        mine = [i for i, p in enumerate(problem.parts) if p.key == key]
        points = np.concatenate([np.arange(first[i], first[i + 1]) for i in mine])
        C = _of_points([problem.parts[i] for i in mine], *(X[k][points] for k in ("rpm", "J", "Re")))
        place = np.full(first[-1], -1)
        place[points] = np.arange(points.size)
        rows = np.flatnonzero((place[problem.point] >= 0) & (problem.channel < CHANNELS.index("rpm")))
        column = problem.channel[rows] * points.size + place[problem.point[rows]]
        out[np.ix_(rows, rows)] = C[np.ix_(column, column)]
    return out * problem.stretch[:, None] * problem.stretch[None, :]


def _of_points(parts: Sequence[Part], rpm: Array, J: Array, Re: Array) -> Array:
    """Of one rotor at the points of some recordings, thrust [N] first, then torque [N m], (2 P, 2 P)."""
    p, known, model = population(), parts[0].as_built, parts[0].model
    assert known is not None
    state = {k: np.concatenate([getattr(q.record.air, k) for q in parts]) for k in _AIR}
    here = sense(
        coefficients(model, air_of_points(state)), model.diameter_m, beta75_deg(model), rpm, J, Re, known.drawn
    )
    f, top, T = (np.nan_to_num(v) for v in (here.f, here.top, here.T))
    here = replace(here, f=f, top=np.where(top == 0.0, _NOTHING, top), T=T)
    # that the population is not centred at the case is one more thing that is not known of this rotor
    usual = p.bias(here).reshape(-1)
    C = p.rest(here)
    if not any(q.record.reference for q in parts):  # it shows the blade itself
        slopes = T.transpose(0, 2, 1).reshape(2 * rpm.size, -1)
        C += slopes @ known.prior.cov @ slopes.T
        usual += slopes @ (known.prior.mean - known.drawn)
    C += np.outer(usual, usual)
    thrust = state["rho"] * (rpm / 60.0) ** 2 * model.diameter_m**4
    unit = np.concatenate([thrust, thrust * model.diameter_m / (2.0 * np.pi)])
    return np.asarray(C * unit[:, None] * unit[None, :])

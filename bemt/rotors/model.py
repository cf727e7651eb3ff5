"""A model of a rotor with other latent numbers: what the population expects of it, and what a run of it adds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.physics import coefficients as co
from bemt.rotors.latents import AsBuilt, Prior, Sensed, as_built
from bemt.rotors.population import population
from bemt.rotors.predict import Prediction, Solve, predict, sense

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.model import Model
    from bemt.rotors.conditioning import ReferenceRun
    from bemt.rotors.latents import Prior


def air_fields(air: Air) -> dict[str, Array]:
    """Properties of the air as arrays."""
    return {k: np.atleast_1d(np.asarray(getattr(air, k), float)) for k in ("rho", "mu", "a_sound", "temperature_K")}


def air_of_points(fields: Mapping[str, Array]) -> Air:
    """Air whose properties are arrays."""
    return cast("Air", SimpleNamespace(**fields))


def coefficients(model: Model, air: Air) -> Solve:
    """CT and CP of a model with any latent numbers, without what a run taught; air of one state or one a point."""
    model = model if model.learned is None else replace(model, learned=None)
    drawn = tuple(e for e in model.effects if not isinstance(e, AsBuilt))
    states = air_fields(air)

    @lru_cache(maxsize=32)
    def built(z: bytes) -> Model:
        numbers = np.frombuffer(z)
        if numbers.any():
            return model.with_effects((*drawn, as_built(numbers)))
        return model if len(drawn) == len(model.effects) else model.with_effects(drawn)

    def solve(z: Array, rpm: Array, J: Array, which: NDArray[np.intp]) -> Array:
        at = air_of_points({k: v[which] if v.size > 1 else v for k, v in states.items()})
        found, _ = built(z.tobytes()).channels(rpm, J * rpm / 60.0 * model.diameter_m, at, 1)
        return np.array([found["CT"], found["CP"]])

    return solve


def beta75_deg(model: Model) -> float:
    """Blade angle at 0.75 R as drawn [deg]."""
    return math.degrees(float(model.rotor.blade.at(0.75 * model.rotor.R)[1]))


@dataclass(frozen=True, eq=False)
class RealRotor:
    """A real rotor at any points: expectation, tangents and covariance of CT and CP, before or after a run of it.

    Notes
    -----
    Readings of rotors of this description have the mean `expected` and, at size 1 of the heavy tails (`Prior.sizes`,
    `Population.rest_sizes`), the covariance ``T prior.cov T^T + rest``, T and rest as `tangents` and `rest` give them.
    """

    solve: Solve  # The solver with any latent numbers
    # Diameter [m]; blade angle at 0.75 R as drawn [deg]
    diameter_m: float
    beta75_deg: float
    prior: Prior  # What is known of the latent numbers, after the run if there is one
    drawn: Array  # (K,) Latent numbers with which slopes are taken [units of `bemt.rotors.latents.NAMES`]
    reference: ReferenceRun | None = None  # The run's rows
    ducted: bool = False

    @staticmethod
    def of(model: Model, air: Air, prior: Prior, drawn: Array, reference: ReferenceRun | None = None) -> RealRotor:
        """Rotor of a model in air of one state or one per point."""
        D, beta = model.diameter_m, beta75_deg(model)
        return RealRotor(coefficients(model, air), D, beta, prior, drawn, reference, model.duct is not None)

    def at(self, rpm: Array, J: Array, Re: Array, f: Array | None = None) -> Sensed:
        """The solver at points, (P,) each: rpm [rev/min], advance ratio and Reynolds number at 0.75 R [1].

        ``f`` is what it gives there, (2, P) of CT and CP, where that is known.
        """
        return sense(self.solve, self.diameter_m, self.beta75_deg, rpm, J, Re, self.drawn, f)

    def expected(self, at: Sensed) -> Array:
        """Expectation of CT and CP with the solver taken as linear around ``drawn``, (2, P) [1]."""
        return predict(population(self.ducted), self._from_drawn, at, None, self.reference).mean

    @property
    def _from_drawn(self) -> Prior:
        return replace(self.prior, mean=self.prior.mean - self.drawn)

    def tangents(self, at: Sensed) -> Array:
        """Slopes with the latent numbers, less what the run tells of them, CT rows first, (2 P, K) [1 over units]."""
        T = at.T if self.reference is None else self.reference.near(population(self.ducted), at)[1]
        return np.asarray(T.transpose(0, 2, 1).reshape(2 * at.J.size, -1))

    def rest(self, at: Sensed, other: Sensed | None = None) -> Array:
        """Covariance of what no latent number explains, between points of this rotor, CT rows first, (2 P, 2 Q) [1]."""
        p, run = population(self.ducted), self.reference
        return p.rest(at, other) if run is None else run.rest(p, at, other)

    def covariance(self, at: Sensed, other: Sensed | None = None) -> Array:
        """Covariance of CT and CP over rotors of this description at size 1, CT rows first, (2 P, 2 Q) [1]."""
        S = self.tangents(at if other is None else other)
        return np.asarray(self.tangents(at) @ self.prior.cov @ S.T + self.rest(at, other))

    def predict(self, at: Sensed, mean: Array | None = None) -> Prediction:
        """Expectation and scatter at points; ``mean`` (2, P): the solver at the prior's mean, where that was solved."""
        return predict(population(self.ducted), self._from_drawn, at, mean, self.reference)


_NODES_J, _NODES_RE, _OCTAVES = 81, 5, 1.0
_PAST_RUN = 0.6
"""The table ends this far beyond the run's advance ratios, where a run tells nothing any more [1]."""


@dataclass(frozen=True, eq=False)
class Learned:
    """Change of CT and CP over advance ratio and Reynolds number; beyond the table as at its end."""

    J: Array  # (N,) Advance ratios [1]
    ln_Re: Array  # (M,) Logarithm of the Reynolds number at 0.75 R of the rotation alone [1]
    change: Array  # (2, M, N) What is added to CT and CP [1]

    def __call__(self, J: Array, Re: Array) -> Array:
        """Change of CT and CP at points (P,), bilinear, (2, P)."""
        along = np.array([[np.interp(J, self.J, row) for row in one] for one in self.change])
        place = np.interp(np.log(Re), self.ln_Re, np.arange(float(self.ln_Re.size)))
        low = np.minimum(place.astype(np.intp), self.ln_Re.size - 2)
        points, share = np.arange(J.size), place - low
        return np.asarray((1.0 - share) * along[:, low, points] + share * along[:, low + 1, points])


def with_run(model: Model, air: Air, prior: Prior, drawn: Array, run: ReferenceRun) -> Model:
    """Model that adds what a run of this rotor tells of the solver's rest, so that it gives the expected loads."""
    rotor = RealRotor.of(model, air, prior, drawn, run)
    D, J = model.diameter_m, np.linspace(run.at.J.min() - _PAST_RUN, run.at.J.max() + _PAST_RUN, _NODES_J)
    still = run.at.Re * 0.75 * np.pi / np.hypot(0.75 * np.pi, run.at.J)
    ln_Re = np.linspace(np.log(still.min()) - _OCTAVES * np.log(2.0), np.log(still.max()) + _OCTAVES * np.log(2.0),
                        _NODES_RE)  # fmt: skip
    state = air_fields(air)
    rho, mu = float(state["rho"][0]), float(state["mu"][0])
    n_Re = float(co.Re75(model.chord75_m, 1.0, D, 0.0, rho, mu))
    n, j = (v.ravel() for v in np.meshgrid(np.exp(ln_Re) / n_Re, J, indexing="ij"))
    Re = np.asarray(co.Re75(model.chord75_m, n, D, j * n * D, rho, mu))
    at = rotor.at(60.0 * n, j, Re)
    change = np.nan_to_num(rotor.expected(at) - at.f).reshape(2, _NODES_RE, _NODES_J)
    return replace(model, learned=Learned(J, ln_Re, change))

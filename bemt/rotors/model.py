"""A model of a rotor with other latent numbers, and what the population expects of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from bemt.rotors.latents import AsBuilt, Prior, as_built
from bemt.rotors.population import population
from bemt.rotors.predict import Prediction, Solve, predict, sense

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.bem.model import Model
    from bemt.dataset import Dataset
    from bemt.rotors.reference import ReferenceRun

Array = NDArray[np.float64]


def air_fields(air: Air) -> dict[str, Array]:
    """Properties of the air as arrays."""
    return {k: np.atleast_1d(np.asarray(getattr(air, k), float)) for k in ("rho", "mu", "a_sound", "temperature_K")}


def air_of_points(fields: Mapping[str, Array]) -> Air:
    """Air whose properties are arrays."""
    return cast("Air", SimpleNamespace(**fields))


def coefficients(model: Model, air: Air) -> Solve:
    """CT and CP of a model with any latent numbers; air of one state or one per point."""
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
        found = built(z.tobytes()).solve(rpm, J * rpm / 60.0 * model.diameter_m, at)
        return np.array([found.CT, found.CP])

    return solve


def predict_model(
    model: Model, prior: Prior, points: Dataset, air: Air, drawn: Array, reference: ReferenceRun | None = None
) -> Prediction:
    """Expectation and scatter of CT and CP of a rotor as built at points that were solved as ``drawn``."""
    solve = coefficients(model, air)
    at = sense(solve, model.diameter_m, points.rpm, points.J, points.Re75, drawn)
    mean = solve(prior.mean, points.rpm, points.J, np.arange(points.rpm.size))
    return predict(population(), prior, at, mean, reference)

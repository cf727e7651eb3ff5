"""The model's own error for a coaxial pair: each rotor's from the population, carried through their exchange.

A rotor of a pair is taken as one alone in the mean axial onset that it meets: the population says how far measured
rotors are from the solver there, in CT and CP.  An error of the upper thrust also changes what the lower rotor meets,
by the square root of that thrust.  Rotors of one case err alike (their errors add up in the total), others apart.
Thrust ratios, in which most of that cancels, follow the latent numbers of the blades through the solved pair.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.physics.bem.coaxial import RATIOS, PairModel
from bemt.rotors.latents import AsBuilt, as_built

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.model import Model
    from bemt.physics.dataset import Dataset
    from bemt.rotors.case.load import Case
    from bemt.rotors.latents import Prior

Loads = dict[str, Array]


@dataclass(frozen=True, eq=False)
class PairError:
    """What is needed of a solved pair to tell its model error."""

    cases: tuple[Case, Case]
    model: PairModel
    found: Dataset
    air: Air
    alone: tuple[Dataset, Dataset]  # Each rotor alone in the mean onset that it meets
    factors: tuple[Array, Array]  # On its error, where fewer rotors were measured
    words: tuple[tuple[str, ...], ...]  # Why, per point

    @staticmethod
    def of(case: Case, model: PairModel, found: Dataset, air: Air) -> PairError:
        """Both rotors of a solved pair."""
        from bemt.rotors.case.propagate import validity_of

        lower = case.second()
        alone, factors, words = [], [], []
        for one, rotor, side in ((case, model.upper, "upper"), (lower, model.lower, "lower")):
            rpm = found.rpm if side == "upper" else found.lower_rpm
            rpm = np.where(np.isfinite(rpm), rpm, found.rpm)
            met = rotor.solve(rpm, np.nan_to_num(found[f"{side}_onset_m_s"]), air)
            factor, why = validity_of(one, met.J, met.Re75, met.M_tip)
            alone.append(met)
            factors.append(factor)
            words.append(why)
        joined = tuple(tuple(dict.fromkeys((*a, *b))) for a, b in zip(*words, strict=True))
        return PairError((case, lower), model, found, air, (alone[0], alone[1]), (factors[0], factors[1]), joined)

    @property
    def alike(self) -> bool:
        """Whether both rotors have the blades of one case."""
        told = self.cases[0].file.second_rotor
        return told is not None and told.label is None and told.case is None

    def widths(self) -> tuple[Loads, Loads]:
        """Half widths of the 68 and 95 % intervals of all channels."""
        from bemt.rotors.case.propagate import loads_of, model_error

        narrow: list[Loads] = []
        wide: list[Loads] = []
        for case, model, met, factor in zip(self.cases, self.model.rotors, self.alone, self.factors, strict=True):
            for out, u in zip((narrow, wide), model_error(case, model, met, self.air), strict=True):
                out.append(loads_of(met, model.diameter_m, factor * u))
        ratios = self._ratios()
        return self._joined(narrow[0], narrow[1], ratios), self._joined(wide[0], wide[1], 2.0 * ratios)

    def _joined(self, upper: Loads, lower: Loads, ratios: Array) -> Loads:
        """Channels of the pair from those of its rotors."""
        found, met = self.found, self.alone[1]
        step = 1e-3 * np.maximum(met.rpm / 60.0 * self.model.lower.diameter_m, 1.0)
        up, down = (self.model.lower.solve(met.rpm, met.airspeed_m_s + s, self.air) for s in (step, -step))
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 0.5 * np.abs(upper["thrust_N"] / found.upper_thrust_N)
        gust = np.where(np.isfinite(share), share, 0.0) * np.abs(met.airspeed_m_s - found.airspeed_m_s)
        T = [upper["thrust_N"], np.hypot(lower["thrust_N"], gust * np.abs(up.thrust_N - down.thrust_N) / (2.0 * step))]
        Q = [
            upper["torque_Nm"],
            np.hypot(lower["torque_Nm"], gust * np.abs(up.torque_Nm - down.torque_Nm) / (2 * step)),
        ]
        add = (lambda a, b: a + b) if self.alike else np.hypot
        thrust = add(*T)
        power = add(*(q * rpm for q, rpm in zip(Q, (found.rpm, met.rpm), strict=True))) * np.pi / 30.0
        with np.errstate(divide="ignore", invalid="ignore"):
            CT, CP = (np.abs(found[k] * u / found[of]) for k, of, u in
                      (("CT", "thrust_N", thrust), ("CP", "power_W", power)))  # fmt: skip
            eta = np.abs(found.eta) * np.hypot(thrust / found.thrust_N, power / found.power_W)
            V, out = found.airspeed_m_s, found.exhaust_speed_m_s
            exhaust = np.abs((out - V) / (2.0 * out - V) * out * thrust / found.thrust_N)
        loads = {
            "thrust_N": thrust, "torque_Nm": power / (found.rpm * np.pi / 30.0), "power_W": power, "CT": CT, "CP": CP,
            "eta": np.where(np.isfinite(eta), eta, np.nan), "duct_share": np.zeros_like(thrust),
            "exhaust_speed_m_s": np.where(np.isfinite(exhaust), exhaust, np.nan), "upper_thrust_N": T[0],
            "upper_torque_Nm": Q[0], "lower_thrust_N": T[1], "lower_torque_Nm": Q[1],
            "reaction_torque_Nm": np.hypot(*Q),
        }  # fmt: skip
        return loads | dict(zip(RATIOS, ratios, strict=True))

    def _ratios(self) -> Array:
        """Standard uncertainties of the thrust ratios from the latent numbers of the blades, (3, P) [1]."""
        known = [case.as_built() for case in self.cases]
        square = np.zeros((len(RATIOS), len(self.found)))
        for k in range(1 if self.alike else 2):
            prior = known[k].prior
            for axis in _axes(prior):
                ends = []
                for sign in (-1.0, 1.0):
                    z = known[k].drawn + sign * axis
                    rotors = [_moved(m, z) if self.alike or i == k else m for i, m in enumerate(self.model.rotors)]
                    pair = replace(self.model, upper=rotors[0], lower=rotors[1])
                    made = pair.solve(self.found.rpm, self.found.airspeed_m_s, self.air)
                    ends.append(np.array([made[name] for name in RATIOS]))
                step = 0.5 * (ends[1] - ends[0])
                # one end that has no solution tells nothing of this number; the others do
                square += np.where(np.isfinite(step), step, 0.0) ** 2
        return np.asarray(np.sqrt(square))


def _axes(prior: Prior) -> Array:
    """Independent directions of the latent numbers, one standard deviation each, (K, K) [units of `NAMES`]."""
    values, vectors = np.linalg.eigh(prior.cov)
    size = np.sqrt(float(prior.weights @ prior.sizes**2))
    return np.asarray(size * (vectors * np.sqrt(np.maximum(values, 0.0))).T)


def _moved(model: Model, z: Array) -> Model:
    """A model with other latent numbers."""
    drawn = tuple(e for e in model.effects if not isinstance(e, AsBuilt))
    return model.with_effects((*drawn, as_built(z)))

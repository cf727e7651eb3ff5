"""What a reference run says of the solver's rest near its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.rotors.conditioning import Conditioned
from bemt.rotors.population import Population

Array = NDArray[np.float64]


SESSION = 0.01
"""Gain of a stand that all points of a run share, where the recording does not state it: retests of a propeller in one
tunnel repeat CT to about a percent (Brandt and Selig 2011, AIAA 2011-1255, not checked) [1]."""
_BLIND = 1e6
_FEWEST = 5


def scatter(values: Array, order: Array) -> float:
    """Scatter of single readings along a smooth run: root mean square of second differences over the square root of 6.

    Zero with fewer than five. A smooth curve leaves next to none, so that what differs from reading to reading is not
    taken for the solver's rest (von Neumann et al., Annals of Mathematical Statistics 12, 1941, for first differences;
    not checked).
    """
    along = values[np.argsort(order)]
    along = along[np.isfinite(along)]
    return 0.0 if along.size < _FEWEST else float(np.sqrt(np.mean(np.diff(along, 2) ** 2) / 6.0))


def noise_of_run(
    p: Population, diameter_m: float, at: tuple[Array, Array], f: Array, top: Array, y: Array, single: Array,
    gain: tuple[float, float] = (SESSION, SESSION),
) -> Array:  # fmt: skip
    """Covariance of a run's readings without the latent numbers: rest, single readings, what a session shares.

    ``at`` is (J over the zero-thrust J, Re), each (P,); ``f``, ``top``, ``y`` and ``single`` (2, P) are computed
    coefficients, those at rest, readings (NaN: not taken) and their standard deviations.  The result is (2 P, 2 P), CT
    first; a reading that is missing keeps its row, with a variance beyond all others.
    """
    noise = p.rest(diameter_m, *at, f, top) + np.diag(single.reshape(-1) ** 2)
    for i, g in enumerate(gain):
        common = np.zeros_like(y)
        common[i] = g * np.nan_to_num(y[i])
        noise += np.outer(common.reshape(-1), common.reshape(-1))
    good = np.isfinite(y.reshape(-1)) & np.isfinite(f.reshape(-1)) & np.isfinite(noise.diagonal())
    return np.asarray(np.where(np.outer(good, good), noise, 0.0) + np.diag(np.where(good, 0.0, _BLIND)))


@dataclass(frozen=True, eq=False)
class ReferenceRun:
    """Rows of a reference run after conditioning, M points (or bins), CT rows first.

    Attributes
    ----------
    x, Re : (M,) float
        J over the solver's zero-thrust J; Reynolds number at 0.75 R [1].
    amplitude : (2 M,) float
        Standard deviation of the rest there [1].
    left : (2 M,) float
        Readings less the solver at the posterior mean [1].
    noise : (2 M, 2 M) float
        Covariance without the latent numbers: rest, instrument [1].
    T : (2 M, K) float
        Slopes with the latent numbers [1 over their units].
    size : float
        Size of the rest of this rotor, as `Population.rest_sizes` count it; predictions are never narrower for it [1].
    """

    x: Array
    Re: Array
    amplitude: Array
    left: Array
    noise: Array
    T: Array
    size: float = 1.0

    def near(self, p: Population, x: Array, Re: Array, rest_sd: Array, T: Array) -> tuple[Array, Array, Array]:
        """Shift of the expectation, slopes and remaining rest at other points: (2, P), (2, K, P), (2, P).

        The Gaussian process given the run: with k the covariance to its rows and N theirs, k N^-1 left, T - k N^-1 T_r
        and sd^2 - k N^-1 k^T (Rasmussen and Williams 2006, eq. 2.23 and 2.24; the slopes as their eq. 2.41).
        """
        P = x.size
        k = p.nearness(x, Re, self.x, self.Re) * np.outer(rest_sd.reshape(-1), self.amplitude)
        gain = np.linalg.solve(self.noise, k.T).T
        shift = (gain @ self.left).reshape(2, P)
        slopes = T - (gain @ self.T).reshape(2, P, -1).transpose(0, 2, 1)
        variance = rest_sd.reshape(-1) ** 2 - np.einsum("ij,ij->i", gain, k)
        return shift, slopes, np.sqrt(np.maximum(variance, 0.0)).reshape(2, P)

    @staticmethod
    def given(x: Array, Re: Array, amplitude: Array, noise: Array, y: Array, found: Conditioned) -> ReferenceRun:
        """Reference of a conditioned rotor; rows that are not finite tell nothing."""
        good = np.isfinite(y) & np.isfinite(found.f)
        left = np.where(good, y - found.f - found.T @ (found.mean - found.at), 0.0)
        slopes = np.where(good[:, None], found.T, 0.0)
        return ReferenceRun(x, Re, np.where(good, amplitude, 0.0), left, found.excess * noise, slopes, found.noise_size)

    def document(self) -> dict[str, Any]:
        """Plain values for the file."""
        return {name: np.asarray(getattr(self, name)).tolist() for name in self.__dataclass_fields__}

    @staticmethod
    def of(document: Mapping[str, Any]) -> ReferenceRun:
        """Reference of a file."""
        names = [name for name in ReferenceRun.__dataclass_fields__ if name != "size"]
        arrays = {name: np.array(document[name], dtype=float) for name in names}
        return ReferenceRun(**arrays, size=float(document["size"]))

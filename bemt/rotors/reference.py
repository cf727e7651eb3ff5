"""What a reference run says of the solver's rest near its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.rotors.conditioning import Conditioned
from bemt.rotors.latents import Sensed
from bemt.rotors.population import AT_REST_J, SMALL_IN, Population

SESSION = 0.01
"""Gain of a stand that all points of a run share, where the recording does not state it: retests of a propeller in one
tunnel repeat CT to about a percent (Brandt and Selig 2011, AIAA 2011-1255, not checked) [1]."""
CAMPAIGN = np.array([[0.057, 0.013], [0.027, 0.024]])
"""Gain on CT and CP that all readings of a campaign share, at rest and in flight: a rotor put on another stand, or
mounted anew.  Two volumes of UIUC give one propeller static CT that differ by 5.2 to 5.6 % in the median, CP by 0.9 to
1.6, in flight by 2.4 to 2.7 and 1.4 to 3.2 %; a median difference d of two is a standard deviation of d / 0.954 of
each [1]."""
SPECIMEN = np.array([[0.037, 0.068], [0.10, 0.068]])
"""The same from one piece to the next of propellers below 7 in: medians of eight pairs of GWS 2.5x0.8 and 5x4.3 and of
Crazyflie propellers in UIUC volume 2, which differ by up to 13, 45, 37 and 42 %.  Of larger ones no second piece was
measured, unless in another campaign [1]."""
STAND = np.array([0.05, 0.15])
"""Gain on thrust and torque of a stand that nobody calibrated: fifty propellers of Drive Calculator lie 4.6 and 9.4 %
in the median, 9 and 28 % at the 90th percentile, from the shipped fit of what UIUC measured under the same name [1]."""
IN_FLIGHT_J = 0.1
"""Advance ratio beyond which a point is in flight: none of the part of the rest that belongs to hover is left [1]."""
_BLIND = 1e6
_FEWEST = 5


def apart(diameter_m: float) -> Array:
    """Gains on CT and CP, (2, 2) at rest and in flight, by which another piece in another campaign differs [1]."""
    return np.hypot(CAMPAIGN, SPECIMEN) if diameter_m < SMALL_IN * 0.0254 * (1.0 - 1e-9) else CAMPAIGN


def gains_at(gains: Array, J: Array) -> Array:
    """Gains at rest and in flight, (2, 2), at advance ratios (P,): of CT and CP, (2, P) [1]."""
    still = np.exp(-((J / AT_REST_J) ** 2))
    return np.asarray(still * gains[0][:, None] + (1.0 - still) * gains[1][:, None])


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
    p: Population, at: Sensed, y: Array, single: Array, gain: tuple[float, float] = (SESSION, SESSION),
    others: Array | None = None, theirs: NDArray[np.bool_] | None = None,
) -> Array:  # fmt: skip
    """Covariance of a run's readings without the latent numbers: rest, single readings, what a session shares.

    ``y`` and ``single`` (2, P) are readings (NaN: not taken) and their standard deviations.  The result is (2 P, 2 P),
    CT first; a reading that is missing keeps its row, with a variance beyond all others.  ``others``, (2, 2) as
    `apart`: gains that the points ``theirs`` (all by default) share, of another piece or another campaign.
    """
    noise = p.rest(at) + np.diag(single.reshape(-1) ** 2)
    for i, g in enumerate(gain):
        common = np.zeros_like(y)
        common[i] = g * np.nan_to_num(y[i])
        noise += np.outer(common.reshape(-1), common.reshape(-1))
    still, foreign = np.abs(at.J) < IN_FLIGHT_J, np.ones(at.J.size, bool) if theirs is None else theirs
    for kind, there in zip(() if others is None else others, (still & foreign, ~still & foreign), strict=False):
        for i, g in enumerate(kind):
            common = np.zeros_like(y)
            common[i] = g * there * np.nan_to_num(y[i])
            noise += np.outer(common.reshape(-1), common.reshape(-1))
    good = np.isfinite(y.reshape(-1)) & np.isfinite(at.f.reshape(-1)) & np.isfinite(noise.diagonal())
    return np.asarray(np.where(np.outer(good, good), noise, 0.0) + np.diag(np.where(good, 0.0, _BLIND)))


@dataclass(frozen=True, eq=False)
class ReferenceRun:
    """Rows of a reference run after conditioning, M points (or bins), CT rows first."""

    at: Sensed  # The solver at the points of the run, its slopes at the posterior
    left: Array  # (2 M,) Readings less the solver at the posterior mean; zero where nothing was read [1]
    noise: Array  # (2 M, 2 M) Covariance without the latent numbers: rest, instrument [1]
    # Size of the rest of this rotor, as `Population.rest_sizes` count it; predictions are never narrower for it [1]
    size: float = 1.0

    @property
    def in_flight(self) -> bool:
        """Whether the run has a point in flight; at rest alone it tells little of it, as hover and flight differ."""
        return bool(np.any(np.abs(self.at.J) > IN_FLIGHT_J))

    def near(self, p: Population, at: Sensed) -> tuple[Array, Array, Array]:
        """Shift of the expectation, slopes and remaining rest at other points: (2, P), (2, K, P), (2, P).

        The Gaussian process given the run: with k the covariance to its rows and N theirs, k N^-1 left, T - k N^-1 T_r
        and sd^2 - k N^-1 k^T (Rasmussen and Williams 2006, eq. 2.23 and 2.24; the slopes as their eq. 2.41).
        """
        P = at.J.size
        k = p.rest(at, self.at)
        gain = np.linalg.solve(self.noise, k.T).T
        shift = (gain @ self.left).reshape(2, P)
        run = self.at.T.transpose(0, 2, 1).reshape(self.left.size, -1)
        slopes = at.T - (gain @ run).reshape(2, P, -1).transpose(0, 2, 1)
        variance = p.rest_sd(at).reshape(-1) ** 2 - np.einsum("ij,ij->i", gain, k)
        return shift, slopes, np.sqrt(np.maximum(variance, 0.0)).reshape(2, P)

    def rest(self, p: Population, at: Sensed, other: Sensed | None = None) -> Array:
        """Covariance of the rest between points once the run is known, (2 P, 2 Q)."""
        k = p.rest(at, self.at)
        q = k if other is None else p.rest(other, self.at)
        return np.asarray(p.rest(at, other) - k @ np.linalg.solve(self.noise, q.T))

    @staticmethod
    def given(at: Sensed, noise: Array, y: Array, found: Conditioned) -> ReferenceRun:
        """Reference of a conditioned rotor; rows that are not finite tell nothing."""
        good = np.isfinite(y) & np.isfinite(found.f)
        left = np.where(good, y - found.f - found.T @ (found.mean - found.at), 0.0)
        T = np.where(good[:, None], found.T, 0.0).reshape(2, at.J.size, -1).transpose(0, 2, 1)
        f, top = (np.where(np.isfinite(v), v, 0.0) for v in (at.f, at.top))
        return ReferenceRun(replace(at, f=f, top=top, T=T), left, found.excess * noise, found.noise_size)

    def document(self) -> dict[str, Any]:
        """Plain values for the file."""
        at = {name: np.asarray(value).tolist() for name, value in vars(self.at).items()}
        return {"at": at, "left": self.left.tolist(), "noise": self.noise.tolist(), "size": self.size}

    @staticmethod
    def of(document: Mapping[str, Any]) -> ReferenceRun:
        """Reference of a file."""
        at = Sensed(float(document["at"]["diameter_m"]), *(
            np.array(document["at"][f.name], dtype=float) for f in fields(Sensed)[1:]
        ))  # fmt: skip
        left, noise = (np.array(document[name], dtype=float) for name in ("left", "noise"))
        return ReferenceRun(at, left, noise, float(document["size"]))

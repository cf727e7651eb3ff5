"""What a run of a rotor adds to the solver at any point: the expectation of the solver's rest, as a table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt import coefficients as co
from bemt.rotors.model import RealRotor, air_fields

if TYPE_CHECKING:
    from bemt.air import Air
    from bemt.bem.model import Model
    from bemt.rotors.latents import Prior
    from bemt.rotors.reference import ReferenceRun

__all__ = ["Learned", "with_run"]

Array = NDArray[np.float64]

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

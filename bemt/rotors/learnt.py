"""How far the population reaches: what it learnt from, and how much wider its answer is declared to be beyond that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DUCT = 1.5
"""Factor on u_model of a ducted rotor, declared: no duct was in the population [1]."""
FREE_MACH = 0.5
"""Tip Mach number up to which nothing is widened, though the measured ones end at 0.28: sections at 0.75 R then see
0.38, where the Prandtl-Glauert factor is 8 % and in the solver, declared [1]."""
MOST = 2.0
"""Largest factor of any other departure, declared [1]."""


@dataclass(frozen=True)
class Learnt:
    """Ranges of the propellers that a population was fitted to.

    Attributes
    ----------
    diameter_m : (float, float)
        Smallest and largest diameter [m].
    M_tip : float
        Largest rotational tip Mach number [1].
    """

    diameter_m: tuple[float, float]
    M_tip: float

    def beyond(self, diameter_m: float, M_tip: Array, ducted: bool) -> tuple[Array, tuple[str, ...]]:
        """Factor on u_model at points, (P,), and for each why it is wider, or nothing.

        Declared, as nothing measured says it: 1.5 for a duct; the square root of the ratio of diameters; linear in the
        tip Mach number from `FREE_MACH`, 2 at the speed of sound. Each but the duct's ends at 2; together they are
        multiplied.
        """
        known = max(self.M_tip, FREE_MACH)
        low, high = self.diameter_m
        away = max(low / diameter_m, diameter_m / high, 1.0)
        size = min(away**0.5, MOST)
        fast = np.clip(1.0 + (M_tip - known) / (1.0 - known), 1.0, MOST)
        same = [f"diameter {diameter_m:.3g} m (data: {low:.2g} to {high:.2g})"] if away > 1.01 else []
        same += ["a duct"] if ducted else []
        factor = (DUCT if ducted else 1.0) * (size if away > 1.01 else 1.0) * fast
        flags = []
        for i in range(M_tip.size):
            why = [*same, *([f"tip Mach {M_tip[i]:.2f} (data: up to {self.M_tip:.2f})"] if M_tip[i] > known else [])]
            flags.append(f"u_model times {factor[i]:.2g}, outside the measured rotors: {', '.join(why)}" if why else "")
        return np.asarray(factor, dtype=float), tuple(flags)

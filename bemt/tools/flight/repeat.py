"""How far a constant differs from flight to flight of one vehicle, beyond what the blocks of one flight show.

Prior: thrust constants of four recorded flights of a brushed Crazyflie 2.1 of one mass have a standard deviation of
0.7 % (three degrees of freedom) where the blocks of each flight say 0.1 to 0.3 %. What moves it is not known: battery,
height over the floor, wear. Own flights are pooled with it (scaled inverse chi-squared; Gelman et al., Bayesian Data
Analysis, 3rd ed., section 2.6).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

SCATTER = 0.007
"""Standard deviation of the thrust constant between flights of one vehicle [1]."""
SCATTER_FREE = 3
"""Its degrees of freedom: four flights."""


def flight_scatter(values: ArrayLike) -> tuple[float, float]:
    """Relative standard deviation of a constant between flights, and Student's factor of its 95 % interval.

    One value, or none, leaves the prior.

    >>> flight_scatter([1.0])[0]
    0.007
    >>> flight_scatter([1.0, 1.0, 1.0, 1.0])[0] < 0.007
    True
    """
    from scipy import stats

    v = np.atleast_1d(np.asarray(values, dtype=float))
    own = max(v.size - 1, 0)
    square = float(np.sum((v / v.mean() - 1.0) ** 2)) if own else 0.0
    free = SCATTER_FREE + own
    sd = SCATTER if not own else float(np.sqrt((SCATTER_FREE * SCATTER**2 + square) / free))
    return sd, float(stats.t.ppf(0.975, free))

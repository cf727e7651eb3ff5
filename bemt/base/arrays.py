"""The arrays of numbers that every room passes on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "middle"]

Array = NDArray[np.float64]


def middle(values: Array) -> float:
    """Median of what is finite; NaN of nothing."""
    good = values[np.isfinite(values)]
    return float(np.median(good)) if good.size else float("nan")

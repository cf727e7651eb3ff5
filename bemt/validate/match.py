"""The experiment of ``--match-J0``: what is left once each blade is turned to its measured zero-thrust J."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bemt.validate.points import Rows, Stations, compare

if TYPE_CHECKING:
    from bemt.effects import Effect
    from bemt.readers.uiuc import UiucPropeller

# A blade angle that is further off than this is no error of setting or section any more.
REACH_DEG = 6.0
_STEP_DEG = 1.0
_CLOSE = 1e-4


def shift_to(J0: float, J0_of: Callable[[float], float]) -> float:
    """Blade angle shift that brings the zero-thrust advance ratio to the measured one."""
    from scipy.optimize import brentq

    last, at = J0_of(0.0) - J0, 0.0
    if not np.isfinite(last):
        return float("nan")
    step = -np.copysign(_STEP_DEG, last)
    while abs(last) > _CLOSE and abs(at) < REACH_DEG:
        now = J0_of(at + step) - J0
        if not np.isfinite(now):
            return float("nan")
        if now * last <= 0.0:
            return float(brentq(lambda d: J0_of(d) - J0, at, at + step, xtol=1e-3))
        last, at = now, at + step
    return float(at) if abs(last) <= _CLOSE else float("nan")


def matched(
    propeller: UiucPropeller, effects: Sequence[Effect], fixed_re: float | None, stations: Stations, J0: float
) -> tuple[float, Rows] | None:
    """Solve one propeller with its blades turned to the measured zero-thrust advance ratio. [deg]"""
    x, c, beta = stations

    def at(shift_deg: float) -> Rows:
        return compare(propeller, effects, fixed_re, (x, c, beta + np.radians(shift_deg)))

    shift = shift_to(J0, lambda d: at(d).J0_bemt)
    return (shift, at(shift)) if np.isfinite(shift) else None

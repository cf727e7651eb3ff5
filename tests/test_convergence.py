"""The promise of convergence: the error falls with the square of the station count.

``order`` compares successive doublings: e(n) - e(2n) over e(2n) - e(4n), no reference solution needed.
"""

from __future__ import annotations

import numpy as np
import pytest

from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.duct import DuctFlow
from bemt.physics.sections.polars import Polar, linear_polar
from geometry.laws import helix
from geometry.rotor import Rotor

AIR = Air.from_density(1.2)
DUCT = DuctFlow(0.95, 0.05, 0.2, 0.8, 0.0005, 0.08, 0.01)
COUNTS = (10, 20, 40, 80, 160, 320)
MACH_MAX = 0.6  # small tables


def loads(rotor: Rotor, polar: Polar, J: float, duct: DuctFlow | None) -> np.ndarray:
    """Thrust and torque over the station counts, (len(COUNTS), 2)."""
    rows = []
    for n in COUNTS:
        prep = solver.prepare(rotor, [(0.7, polar)], duct=duct, n_stations=n, mach_max=MACH_MAX)
        s = solver.solve(prep, 6000.0, J * 100.0 * rotor.D, AIR)
        rows.append((s.T[0], s.Q[0]))
    return np.array(rows)


@pytest.mark.parametrize("duct", [None, DUCT], ids=["open", "ducted"])
@pytest.mark.parametrize("J", [0.0, 0.4])
@pytest.mark.parametrize("pitch", [0.5, 1.0])
def test_second_order_on_a_smooth_blade(pitch: float, J: float, duct: DuctFlow | None) -> None:
    D = 0.2032
    rows = loads(Rotor(helix(D, pitch * D), 2), linear_polar(cd=0.01), J, duct)
    steps = np.abs(np.diff(rows, axis=0))
    order = np.log2(steps[:-1] / steps[1:])
    assert order.min() >= 1.8, order
    assert order.max() <= 2.3, order


@pytest.mark.parametrize("J", [0.0, 0.4])
def test_second_order_through_a_stall(rotor: Rotor, polar: Polar, J: float) -> None:
    """A kink in the lift curve moves from station to station: second order on the whole, not at each doubling."""
    steps = np.abs(np.diff(loads(rotor, polar, J, None), axis=0))
    fitted = -np.polyfit(np.log2(COUNTS[:-1]), np.log2(steps), 1)[0]
    assert fitted.min() >= 1.7, fitted


def test_forty_stations_are_within_a_thousandth(rotor: Rotor, polar: Polar) -> None:
    for J in (0.0, 0.4):
        rows = loads(rotor, polar, J, None)
        best = rows[-1] + (rows[-1] - rows[-2]) / 3.0
        assert np.abs(rows[2] / best - 1.0).max() < 1e-3

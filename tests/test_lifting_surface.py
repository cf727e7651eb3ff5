"""The promise of the lifting-surface effect: its closed form is what a vortex lattice says.

The lattice knows neither blade elements nor the effect: horseshoe vortices of each blade on a helicoid of given
advance, Biot-Savart on straight segments, no flow through the blade.  The lifting line has the same wake.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.duct import DuctFlow
from bemt.physics.effects import standard
from bemt.physics.effects.lifting_surface import LiftingSurface, slope_ratio
from bemt.physics.effects.tip_loss import TipLoss
from bemt.physics.sections.polars import ALPHA_GRID, linear_polar
from geometry.laws import helix
from geometry.rotor import Rotor, from_stations

HUB, AIR = 0.15, Air.from_density(1.2)


def _segments(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Velocity at points (P, 3) of vortex segments (S, 3) of circulation one, (P, S, 3)."""
    u, v = start[None] - points[:, None], end[None] - points[:, None]
    nu, nv, dot = np.linalg.norm(u, axis=-1), np.linalg.norm(v, axis=-1), np.sum(u * v, axis=-1)
    k = (nu + nv) / (nu * nv * (nu * nv + dot) + 1e-8 * nu * nv) / (4.0 * np.pi)
    return np.asarray(np.cross(u, v) * k[..., None])


def _helix(r: np.ndarray | float, age: np.ndarray, h: float, azimuth: float = 0.0) -> np.ndarray:
    return np.stack([r * np.cos(azimuth - age), r * np.sin(azimuth - age), h * age], axis=-1)


def _downwash(
    edges: np.ndarray, x: np.ndarray, c: float, B: int, h: float, bound: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Normal speed at chord fractions ``at`` of the strips from horseshoes at the fractions ``bound``."""
    ages = np.concatenate([[0.0], np.cumsum(np.geomspace(0.01, 0.2, 40))])
    ages = np.concatenate([ages, np.arange(ages[-1] + 0.25, 4.0 / h, 0.25)])
    points, normals = [], []
    for f in at:
        age = (f - 0.25) * c / np.hypot(x, h)
        phi = np.arctan2(h, x)
        points.append(_helix(x, age, h))
        normals.append(np.stack([np.sin(age) * np.sin(phi), np.cos(age) * np.sin(phi), np.cos(phi)], axis=-1))
    p, n = np.concatenate(points), np.concatenate(normals)
    columns = []
    for f in bound:
        age = (f - 0.25) * c / np.hypot(edges, h)
        speed = np.zeros((p.shape[0], x.size, 3))
        for azimuth in 2.0 * np.pi * np.arange(B) / B:
            line = _helix(edges, age, h, azimuth)
            ends = [_helix(r, a + ages, h, azimuth) for r, a in zip(edges, age, strict=True)]
            trail = np.stack([_segments(p, q[:-1], q[1:]).sum(axis=1) for q in ends], axis=1)
            speed += _segments(p, line[:-1], line[1:]) + trail[:, 1:] - trail[:, :-1]
        columns.append(-np.sum(speed * n[:, None, :], axis=-1))
    return np.concatenate(columns, axis=1)


@cache
def lattice(c: float, B: int, h: float, rows: int = 3, strips: int = 14) -> tuple[np.ndarray, np.ndarray, float]:
    """Distances from the tip [chords], lift slope over that of a lifting line, thrust over that of a lifting line."""
    half = np.arange(2 * strips + 1) * (np.pi / (2 * strips))
    x = HUB + (1.0 - HUB) * 0.5 * (1.0 - np.cos(half))
    edges, x = x[::2], x[1::2]
    W, f = np.hypot(x, h), np.arange(rows) / rows
    surface = _downwash(edges, x, c, B, h, f + 0.25 / rows, f + 0.75 / rows)
    gamma = np.linalg.solve(surface, np.tile(W, rows)).reshape(rows, -1).sum(axis=0)  # angle 1 everywhere
    line = _downwash(edges, x, c, B, h, np.array([0.25]), np.array([0.25 + 1e-9]))
    ratio = gamma / (np.pi * c * (W - line @ gamma))
    alone = np.linalg.solve(np.eye(x.size) / (np.pi * c) + line, W)
    weight = x * np.diff(edges)
    return (1.0 - x) / c, ratio, float(gamma @ weight / (alone @ weight))


@pytest.mark.parametrize(("c", "B", "h"), [(0.1667, 2, 0.075), (0.2, 2, 0.12), (0.2, 2, 0.25), (0.15, 4, 0.1)])
def test_the_closed_form_is_the_lattice_whatever_blades_and_advance(c: float, B: int, h: float) -> None:
    distance, ratio, thrust = lattice(c, B, h)
    tip = distance < 2.0
    assert np.count_nonzero(tip) > 5
    np.testing.assert_allclose(slope_ratio(distance[tip]), ratio[tip], atol=0.03)
    assert 0.89 < thrust < 0.95


def test_the_lattice_does_not_depend_on_its_panels() -> None:
    distance, ratio, _ = lattice(0.2, 2, 0.12)
    more, fine, _ = lattice(0.2, 2, 0.12, rows=6, strips=20)
    at = np.array([0.1, 0.3, 0.6, 1.0, 1.5])
    coarse, finer = (np.interp(at, d[::-1], r[::-1]) for d, r in ((distance, ratio), (more, fine)))
    np.testing.assert_allclose(coarse, finer, atol=0.02)


def _prepared(chord: float, *effects: LiftingSurface | TipLoss, duct: DuctFlow | None = None) -> solver.Prepared:
    x = np.array([HUB, 1.0])
    blade = from_stations(x, np.full(2, chord), np.radians([8.0, 8.0]), 1.0, HUB)
    return solver.prepare(Rotor(blade, 2), [(0.7, linear_polar(6.0, cd=0.01))], effects, duct, n_stations=30)


def test_tables_are_those_of_the_smaller_angle() -> None:
    on, off = _prepared(0.2, LiftingSurface()), _prepared(0.2)
    r, small = on.stations.r, np.abs(ALPHA_GRID) < np.radians(5.0)
    wanted = slope_ratio((1.0 - r) / 0.2)[:, None] * off.tables[:, 0, 0, small, 0]
    np.testing.assert_allclose(on.tables[:, 0, 0, small, 0], wanted, atol=1e-9)
    far = np.abs(ALPHA_GRID) > np.radians(40.0)
    np.testing.assert_allclose(on.tables[..., far, :], off.tables[..., far, :], rtol=1e-12)


def test_stations_still_converge_in_second_order() -> None:
    counts = (10, 20, 40, 80, 160)
    loads = []
    for n in counts:
        prep = solver.prepare(
            Rotor(helix(0.2032, 0.127), 2), [(0.7, linear_polar(cd=0.01))], (*standard(), LiftingSurface()),
            n_stations=n, mach_max=0.6,
        )  # fmt: skip
        s = solver.solve(prep, 6000.0, 0.0, AIR)
        loads.append((s.T[0], s.Q[0]))
    steps = np.abs(np.diff(loads, axis=0))
    assert np.log2(steps[:-1] / steps[1:]).min() >= 1.8


def test_thin_blades_and_blades_in_a_duct_do_not_feel_it() -> None:
    def lost(chord: float, duct: DuctFlow | None = None) -> float:
        T = [
            solver.solve(_prepared(chord, TipLoss(), *more, duct=duct), 600.0, 0.0, AIR).T[0]
            for more in ((), (LiftingSurface(),))
        ]
        return float(1.0 - T[1] / T[0])

    shares = [lost(c) for c in (0.3, 0.1, 0.03, 0.01)]
    assert shares == sorted(shares, reverse=True) and shares[-1] < 0.01
    assert 0.03 < lost(0.1667) < 0.10
    assert lost(0.2, DuctFlow(0.95)) == 0.0

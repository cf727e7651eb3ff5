"""Section tables are read as stored, interpolated multilinearly, checked, mixed and resampled without surprise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bemt.sections import polars as P
from bemt.sections.extrapolation import ExtrapolatedTable, from_tables
from bemt.sections.neuralfoil import tunnel_polar
from bemt.sections.polars import ALPHA_GRID, DEFAULT_RE, Polar
from geometry.airfoil import naca

pytestmark = pytest.mark.usefixtures("own_cache")


def deg(*angles: float) -> np.ndarray:
    """Degrees as radians."""
    return np.deg2rad(np.array(angles, dtype=float))


def test_shared_grids_are_indexed_by_arithmetic() -> None:
    coarse_below = round((P.ALPHA_FINE_LO + math.pi) / P.ALPHA_COARSE_STEP)
    fine = round((P.ALPHA_FINE_HI - P.ALPHA_FINE_LO) / P.ALPHA_FINE_STEP)
    k = np.arange(ALPHA_GRID.size)
    lower = -math.pi + k * P.ALPHA_COARSE_STEP
    middle = P.ALPHA_FINE_LO + (k - coarse_below) * P.ALPHA_FINE_STEP
    upper = P.ALPHA_FINE_HI + (k - coarse_below - fine) * P.ALPHA_COARSE_STEP
    expected = np.where(k <= coarse_below, lower, np.where(k <= coarse_below + fine, middle, upper))
    np.testing.assert_allclose(ALPHA_GRID, expected, atol=1e-12)
    assert ALPHA_GRID[0] == -math.pi and ALPHA_GRID[-1] == math.pi
    np.testing.assert_allclose(np.log(DEFAULT_RE), P.LOG_RE0 + P.DLOG_RE * np.arange(DEFAULT_RE.size), atol=1e-12)
    for edge in (P.ALPHA_FINE_LO, P.ALPHA_FINE_HI):
        assert math.remainder(edge, P.ALPHA_COARSE_STEP) == pytest.approx(0.0, abs=1e-12)


def smooth_polar(re: np.ndarray, mach: np.ndarray) -> Polar:
    """Table that is linear in ln Re and in Mach at every angle."""
    a, r, m = np.meshgrid(ALPHA_GRID, np.log(re), mach, indexing="ij")
    return Polar(ALPHA_GRID, re, mach, np.sin(2 * a) * (r + 3 * m), (1.1 - np.cos(2 * a)) * (2 * r + m))


def test_lookup_is_exact_at_nodes_and_multilinear_between() -> None:
    p = smooth_polar(DEFAULT_RE, np.array([0.0, 0.5, 0.9]))
    a, r, m = np.meshgrid(p.alpha, p.Re, p.M, indexing="ij")
    for got, table in zip(p.lookup(a, r, m), (p.cl, p.cd), strict=True):
        np.testing.assert_allclose(got, table, rtol=0, atol=1e-12)
    at, Re, M = 0.5 * (ALPHA_GRID[40] + ALPHA_GRID[41]), 3.3e4, 0.7
    mean = 0.5 * (np.sin(2 * ALPHA_GRID[40]) + np.sin(2 * ALPHA_GRID[41]))
    assert p.lookup(at, Re, M)[0] == pytest.approx(mean * (math.log(Re) + 3 * M), abs=1e-12)


def test_lookup_wraps_alpha_and_holds_re_and_mach() -> None:
    p = smooth_polar(DEFAULT_RE, np.array([0.0, 0.5]))
    a = np.linspace(-3.0, 3.0, 37)
    for turns in (-1, 1, 2):
        np.testing.assert_allclose(p.lookup(a + 2 * math.pi * turns, 1e5), p.lookup(a, 1e5), atol=1e-12)
    assert np.array_equal(p.lookup(a, 10.0), p.lookup(a, DEFAULT_RE[0]))
    assert np.array_equal(p.lookup(a, 1e9, 3.0), p.lookup(a, DEFAULT_RE[-1], 0.5))
    assert p.lookup(a[:, None], DEFAULT_RE[None, :])[0].shape == (37, DEFAULT_RE.size)


def test_derived_quantities_of_a_known_curve() -> None:
    a = np.deg2rad(np.arange(-20.0, 20.5, 0.5))
    rise = np.where(a < deg(12)[0], a, 2 * deg(12)[0] - a)
    p = from_tables([ExtrapolatedTable(a, 6.0 * (np.maximum(rise, deg(-11)[0]) + deg(3)[0]), 0.01 + a**2)])
    assert p.alpha0(1e5) == pytest.approx(deg(-3)[0], abs=1e-9)
    assert p.cl_alpha(1e5) == pytest.approx(6.0, abs=1e-6)
    assert p.stall(1e5) == pytest.approx((deg(12)[0], 6.0 * deg(15)[0]), abs=1e-6)
    assert p.stall(1e5, side=-1)[1] == pytest.approx(-6.0 * deg(8)[0], abs=1e-6)


def test_bad_tables_are_refused() -> None:
    good = P.linear_polar()
    bad = {
        "cd": good.cd * 0.0,
        "cl": np.where(good.alpha[:, None, None] > 3.1, 1.0, good.cl),
        "alpha": good.alpha[::-1],
        "Re": good.Re[:3],
        "confidence": np.zeros(3),
    }
    for field, value in bad.items():
        parts = {f: getattr(good, f) for f in ("alpha", "Re", "M", "cl", "cd")} | {field: value}
        with pytest.raises(ValueError, match="expected"):
            Polar(**parts)
    with pytest.raises(ValueError, match="read-only"):
        good.cl[0, 0, 0] = 1.0


def test_on_grid_is_idempotent_and_announces_what_it_holds() -> None:
    p = smooth_polar(np.array([5e4, 5e5]), np.array([0.0, 0.5]))
    q = p.on_grid()
    assert q.is_shared and q.on_grid() is q and any("held constant" in n for n in q.notes)
    np.testing.assert_allclose(q.lookup(0.2, 2e5, 0.2), p.lookup(0.2, 2e5, 0.2), rtol=2e-3)


def test_fixed_re_removes_reynolds_and_nothing_else() -> None:
    p = tunnel_polar(naca("4412"))
    q = P.fixed_re(p, 1.3e5)
    a = np.linspace(-math.pi, math.pi, 199)
    want = np.array(p.lookup(p.alpha, 1.3e5))
    for Re in (1e3, 4e4, 1.3e5, 1e7):
        np.testing.assert_allclose(q.lookup(p.alpha, Re), want, atol=1e-12)
        np.testing.assert_allclose(q.lookup(a, Re), p.lookup(a, 1.3e5), atol=1e-12)
    assert q.is_shared and q.key != p.key


def test_blend_is_linear_and_meets_its_ends() -> None:
    a, b = tunnel_polar(naca("4412")), tunnel_polar(naca("0012"))
    assert P.blend(a, b, 0.0).key == a.key and P.blend(a, b, 1.0).key == b.key
    mid = P.blend(a, b, 0.25)
    np.testing.assert_allclose(mid.cl, 0.75 * a.cl + 0.25 * b.cl, atol=1e-15)
    np.testing.assert_allclose(mid.cd, 0.75 * a.cd + 0.25 * b.cd, atol=1e-15)


def test_linear_polar_is_ideal() -> None:
    p = P.linear_polar(alpha0=deg(-2)[0], cd=0.01)
    a = np.deg2rad(np.arange(-29.5, 40.0, 0.5))
    np.testing.assert_allclose(p.lookup(a, 1e5)[0], 2 * math.pi * (a - deg(-2)[0]), atol=1e-12)
    assert p.alpha0(1e5) == pytest.approx(deg(-2)[0]) and p.cl_alpha(1e5) == pytest.approx(2 * math.pi)

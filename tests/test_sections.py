"""Section tables: read as stored, on to +-180 degrees without jump."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from bemt.physics.sections import polars as P
from bemt.physics.sections.neuralfoil import tunnel_polar
from bemt.physics.sections.polars import (
    ALPHA_GRID,
    DEFAULT_RE,
    METHODS,
    ExtrapolatedTable,
    Polar,
    extend,
    from_tables,
    viterna_cd_max,
)
from geometry.airfoil import Airfoil, naca, naca4

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


def test_zero_lift_is_the_crossing_nearest_to_the_chord_line() -> None:
    """A stalled section may rise through zero again, at -12 degrees here; the crossing is linear between nodes."""
    a = np.deg2rad(np.arange(-20.0, 20.5, 1.0))
    cl = 5.0 * (a + np.deg2rad(2.6))
    early = a < np.deg2rad(-8.5)
    cl[early] = 5.0 * (a[early] + np.deg2rad(12.0))
    p = from_tables([ExtrapolatedTable(a, cl, np.full(a.size, 0.02))])
    assert p.alpha0(1e5) == pytest.approx(np.deg2rad(-2.6), abs=1e-9)
    mirrored = from_tables([ExtrapolatedTable(a, -cl[::-1], np.full(a.size, 0.02))])
    assert mirrored.alpha0(1e5) == pytest.approx(np.deg2rad(2.6), abs=1e-9)


def test_bad_tables_are_refused() -> None:
    good = P.linear_polar()
    bad = {
        "cd": good.cd * 0.0, "cl": np.where(good.alpha[:, None, None] > 3.1, 1.0, good.cl), "alpha": good.alpha[::-1],
        "Re": good.Re[:3], "confidence": np.zeros(3),
    }  # fmt: skip
    for field, value in bad.items():
        parts = {f: getattr(good, f) for f in ("alpha", "Re", "M", "cl", "cd")} | {field: value}
        with pytest.raises(ValueError, match="expected"):
            Polar(**parts)
    with pytest.raises(ValueError, match="read-only"):
        good.cl[0, 0, 0] = 1.0


def test_on_grid_is_idempotent_and_announces_what_it_holds() -> None:
    p = smooth_polar(np.array([5e4, 5e5]), np.array([0.0, 0.5]))
    q = p.on_grid()
    assert q.on_grid() is q and any("held constant" in n for n in q.notes)
    np.testing.assert_allclose(q.lookup(0.2, 2e5, 0.2), p.lookup(0.2, 2e5, 0.2), rtol=2e-3)


def test_fixed_re_removes_reynolds_and_nothing_else() -> None:
    p = tunnel_polar(naca("4412"))
    q = P.fixed_re(p, 1.3e5)
    a = np.linspace(-math.pi, math.pi, 199)
    want = np.array(p.lookup(p.alpha, 1.3e5))
    for Re in (1e3, 4e4, 1.3e5, 1e7):
        np.testing.assert_allclose(q.lookup(p.alpha, Re), want, atol=1e-12)
        np.testing.assert_allclose(q.lookup(a, Re), p.lookup(a, 1.3e5), atol=1e-12)
    assert q.on_grid() is q and q.key != p.key


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


# Tables from NeuralFoil are closed, positive, sane over Reynolds number, and NeuralFoil's own where it is sound.


SECTIONS = {
    "0012": naca("0012"), "4412": naca("4412"), "2415": naca("2415"), "thin": naca4(0.04, 0.4, 0.06),
    "sharp": naca4(0.06, 0.4, 0.04), "23015": naca("23015"),
}  # fmt: skip
# as outlines: NeuralFoil itself is asked, not the shipped table of its answers
SECTIONS = {name: dataclasses.replace(shape, four_digit=None) for name, shape in SECTIONS.items()}


@pytest.fixture(scope="module", params=sorted(SECTIONS))
def section(request: pytest.FixtureRequest, own_cache: Path) -> tuple[str, Airfoil, Polar]:
    """Name, shape and polar of one section."""
    shape = SECTIONS[request.param]
    return request.param, shape, tunnel_polar(shape)


def test_tunnel_polar_is_closed_and_positive(section: tuple[str, Airfoil, Polar]) -> None:
    _, shape, p = section
    assert p.on_grid() is p and p.M.tolist() == [0.0]
    assert np.array_equal(p.cl[0], p.cl[-1]) and np.array_equal(p.cd[0], p.cd[-1])
    assert p.cd.min() > 0.0 and np.abs(p.cl).max() < 2.5
    assert p.confidence is not None and p.confidence.min() >= 0.0 and p.confidence.max() <= 1.0
    assert np.all(p.confidence[np.abs(p.alpha) > deg(22.01)[0]] == 0.0)
    for polar, cd_max in ((p, 1.29), (tunnel_polar(shape, cd_max=1.8), 1.8)):
        np.testing.assert_allclose(polar.lookup(deg(-90, 90)[:, None], DEFAULT_RE)[1], cd_max, rtol=1e-9)


def test_neuralfoil_numbers_are_untouched_where_it_is_sound(section: tuple[str, Airfoil, Polar]) -> None:
    import neuralfoil as nf

    name, shape, p = section
    j = np.flatnonzero(DEFAULT_RE > 4e5)
    at = np.arange(-1.0, 5.01, 0.5)
    a, r = np.meshgrid(at, DEFAULT_RE[j], indexing="ij")
    raw = nf.get_aero_from_coordinates(np.column_stack([shape.x, shape.y]), a.ravel(), r.ravel(), model_size="xlarge")
    cl, cd = p.lookup(np.deg2rad(a), r)
    np.testing.assert_allclose(cl, np.reshape(raw["CL"], a.shape), atol=1e-9, err_msg=name)
    np.testing.assert_allclose(cd, np.reshape(raw["CD"], a.shape), atol=1e-9, err_msg=name)


def test_lift_slope_and_zero_lift_angle_are_those_of_thin_airfoils(section: tuple[str, Airfoil, Polar]) -> None:
    name, _, p = section
    # thin-airfoil theory of the mean line [deg]: Abbott & von Doenhoff, NACA four- and five-digit lines
    theory = {"0012": 0.0, "4412": -4.15, "2415": -2.08, "thin": -4.15, "sharp": -6.23, "23015": -1.09}[name]
    for Re in (1e6, 3e6):
        assert 0.95 < p.cl_alpha(Re) / (2 * math.pi) < (1.3 if name == "sharp" else 1.1)
        assert math.degrees(p.alpha0(Re)) == pytest.approx(theory, abs=1.5 if name == "sharp" else 0.4)
        angle, cl_max = p.stall(Re)
        assert 5.0 < math.degrees(angle) < 25.0 and 0.9 < cl_max < 2.1


def test_drag_falls_with_reynolds_number_and_stays_above_blasius(section: tuple[str, Airfoil, Polar]) -> None:
    _, _, p = section
    least = p.cd[:, :, 0].min(axis=0)
    low = DEFAULT_RE < 4e5
    assert np.all(np.diff(least[low]) < 0.0)
    slope = np.polyfit(np.log(DEFAULT_RE[low]), np.log(least[low]), 1)[0]
    assert -0.75 < slope < -0.3
    assert np.all(least >= 2.656 / np.sqrt(DEFAULT_RE) - 1e-15)


def test_low_reynolds_lift_keeps_its_share(section: tuple[str, Airfoil, Polar]) -> None:
    _, shape, p = section
    at = deg(*np.arange(0.0, 5.1, 0.5))
    reference = tunnel_polar(shape, re=np.array([3e5])).lookup(at, 3e5)[0]
    for Re in DEFAULT_RE[DEFAULT_RE < 3e5]:
        assert np.all(p.lookup(at, Re)[0] >= 0.5 * reference - 0.1 - 1e-9)
    free = tunnel_polar(shape, lift_floor=0.0)
    same = DEFAULT_RE > 3e5
    assert np.array_equal(free.cl[:, same], p.cl[:, same])


def test_bound_on_low_reynolds_lift_is_needed_and_can_be_switched_off() -> None:
    free = tunnel_polar(SECTIONS["2415"], lift_floor=0.0)
    assert free.lookup(0.0, 2e4)[0] < 0.0 < tunnel_polar(SECTIONS["2415"]).lookup(0.0, 2e4)[0]


@pytest.mark.parametrize("method", METHODS)
def test_symmetric_section_is_antisymmetric(method: str) -> None:
    p = tunnel_polar(SECTIONS["0012"], method=method)
    angles = np.round(np.rad2deg(ALPHA_GRID), 6)
    both = ALPHA_GRID[np.isin(angles, -angles)][:, None]  # nodes of the grid on both sides
    assert both.size > 170
    cl, cd = p.lookup(both, DEFAULT_RE)
    mirrored = p.lookup(-both, DEFAULT_RE)
    np.testing.assert_allclose(mirrored[0], -cl, atol=1e-6)
    np.testing.assert_allclose(mirrored[1], cd, atol=1e-6)


def test_past_stall_limits_the_use_of_neuralfoil() -> None:
    short = tunnel_polar(SECTIONS["4412"], past_stall=deg(1)[0])
    long = tunnel_polar(SECTIONS["4412"])
    assert short.confidence is not None and long.confidence is not None
    assert (short.confidence > 0).sum() < (long.confidence > 0).sum()
    stall, cl_max = short.stall(1e6)
    assert np.all(short.lookup(np.linspace(stall, deg(60)[0], 99), 1e6)[0] <= cl_max + 1e-12)


def test_lower_n_crit_and_trips_bring_transition_forward() -> None:
    j = np.flatnonzero(DEFAULT_RE > 1e6)[0]
    free, early, tripped = (
        tunnel_polar(SECTIONS["0012"], **kw).cd[:, j, 0].min()
        for kw in ({}, {"n_crit": 3.0}, {"xtr_upper": 0.05, "xtr_lower": 0.05})
    )
    assert free < early < tripped


def test_bad_settings_are_refused() -> None:
    for kw, word in (({"method": "none"}, "viterna, normal"), ({"re": np.array([2e5, 1e5])}, "ascending")):
        with pytest.raises(ValueError, match=word):
            tunnel_polar(SECTIONS["0012"], **kw)


def test_below_the_network_lift_stays_and_friction_is_laminar() -> None:
    """From Re 1e4 down: cl as at 1e4, least cd as 1 / sqrt(Re), no friction across the flow at 90 deg."""
    p = tunnel_polar(naca4(0.035, 0.4, 0.09), n_crit=3.0)
    edge = int(np.argmin(np.abs(DEFAULT_RE - 1e4)))
    assert DEFAULT_RE[edge] == pytest.approx(1e4, rel=1e-12) and edge == 3
    assert np.array_equal(p.cl[:, :edge], np.repeat(p.cl[:, edge : edge + 1], edge, axis=1))
    fine = np.abs(ALPHA_GRID) < np.deg2rad(20)
    least = p.cd[fine, : edge + 1, 0].min(axis=0) * np.sqrt(DEFAULT_RE[: edge + 1])
    assert least == pytest.approx(least[-1], rel=3e-3)
    assert np.all(p.confidence[:, :edge] == 0.0)


# Section data go on to +-180 degrees without a jump, as the cited model says, and stay what they are inside.


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("half", [0.0, deg(2)[0]])
def test_extension_is_continuous_and_periodic(method: str, half: float) -> None:
    a = np.deg2rad(np.arange(-20.0, 20.5, 0.5))
    cl, cd = 5.0 * np.sin(a + 0.05), 0.01 + 0.8 * np.sin(a) ** 2
    lo, hi = deg(-11, 14)
    step = 1e-5
    out = np.unique(np.r_[np.linspace(-math.pi, math.pi, 20001), *(np.array([lo, hi, -lo - math.pi, math.pi - hi,
                    -math.pi / 2, math.pi / 2])[:, None] + np.array([-step, 0.0, step])).T])  # fmt: skip
    got = extend(a, cl, cd, lo=lo, hi=hi, cd_max=1.3, out=out, half=half, method=method)
    for value in got:
        assert np.all(np.abs(np.diff(value)) <= 25.0 * np.diff(out) + 1e-12)
        assert value[0] == value[-1]
    assert got[1].min() > 0.0
    at_90 = np.isclose(np.abs(out), math.pi / 2, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got[1][at_90], 1.3, rtol=1e-9)


def test_extension_is_viterna_corrigan_beyond_the_match_and_data_inside() -> None:
    a = np.deg2rad(np.arange(-20.0, 20.5, 0.5))
    cl, cd = 5.0 * np.sin(a + 0.05), 0.01 + 0.8 * np.sin(a) ** 2
    hi, top = float(a[-1]), 1.29
    out = np.r_[a, deg(25, 40, 60, 85)]
    got_cl, got_cd = extend(a, cl, cd, lo=float(a[0]), hi=hi, cd_max=top, out=out)
    np.testing.assert_allclose(got_cl[: a.size], cl, atol=1e-12)
    np.testing.assert_allclose(got_cd[: a.size], cd, atol=1e-12)
    s, c = math.sin(hi), math.cos(hi)
    x = out[a.size :]
    a2 = (cl[-1] - top * s * c) * s / c**2
    b2 = (cd[-1] - top * s**2) / c
    np.testing.assert_allclose(got_cl[a.size :], top / 2 * np.sin(2 * x) + a2 * np.cos(x) ** 2 / np.sin(x), rtol=1e-12)
    np.testing.assert_allclose(got_cd[a.size :], top * np.sin(x) ** 2 + b2 * np.cos(x), rtol=1e-12)


def test_normal_method_tends_to_a_force_normal_to_the_chord() -> None:
    a = np.deg2rad(np.arange(-16.0, 16.5, 0.5))
    cl, cd = 5.0 * np.sin(a), 0.01 + 0.3 * a**2
    x = deg(16, 20, 30, 45, 60)
    lift, drag = extend(a, cl, cd, lo=a[0], hi=a[-1], cd_max=1.3, out=x, method="normal")
    viterna = extend(a, cl, cd, lo=a[0], hi=a[-1], cd_max=1.3, out=x)
    assert np.array_equal(lift, viterna[0]) and drag[0] == pytest.approx(viterna[1][0], rel=1e-12)
    suction = lift * np.tan(x) - drag
    assert np.all(np.diff(np.abs(suction)) < 0.0) and abs(suction[-1]) < 1e-3


def test_viterna_cd_max_follows_the_aspect_ratio() -> None:
    assert viterna_cd_max(0.0) == 1.11
    assert viterna_cd_max(50.0) == pytest.approx(2.01) == viterna_cd_max(80.0)


def test_tables_keep_their_data_and_are_mirrored_where_none_are() -> None:
    a = np.deg2rad(np.arange(-2.0, 14.5, 1.0))
    tables = [ExtrapolatedTable(a, 5.5 * a + 0.3, 0.02 + a**2, Re) for Re in (1e5, 4e5)]
    p = from_tables(tables, name="x", cd_max=1.3)
    for t in tables:
        np.testing.assert_allclose(p.lookup(a, t.Re), (t.cl, t.cd), atol=1e-9)
    cl, cd = p.lookup(-a[-1], 1e5)
    assert float(cl) == pytest.approx(-0.7 * tables[0].cl[-1], abs=1e-9)
    assert float(cd) == pytest.approx(tables[0].cd[-1])
    assert any("mirrored" in n for n in p.notes) and any("before the stall" in n for n in p.notes)


def test_tables_that_cannot_be_continued_are_refused() -> None:
    a = np.deg2rad(np.arange(-2.0, 14.5, 1.0))
    good = ExtrapolatedTable(a, 5.5 * a, 0.02 + a**2)
    for bad in (
        [ExtrapolatedTable(a[5:], good.cl[5:], good.cd[5:])], [ExtrapolatedTable(a[:6], good.cl[:6], good.cd[:6])],
        [ExtrapolatedTable(a[::-1], good.cl, good.cd)], [good, good],
        [good, ExtrapolatedTable(a, good.cl, good.cd, 2e5, 0.5)],
    ):  # fmt: skip
        with pytest.raises(ValueError, match="expected"):
            from_tables(bad)

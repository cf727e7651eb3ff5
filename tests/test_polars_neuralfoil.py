"""Tables from NeuralFoil are closed, positive, sane over Reynolds number, and NeuralFoil's own where it is sound."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bemt.sections.extrapolation import METHODS
from bemt.sections.neuralfoil import tunnel_polar
from bemt.sections.polars import ALPHA_GRID, DEFAULT_RE, Polar
from geometry.airfoil import Airfoil, naca, naca4

SECTIONS = {
    "0012": naca("0012"),
    "4412": naca("4412"),
    "2415": naca("2415"),
    "thin": naca4(0.04, 0.4, 0.06),
    "sharp": naca4(0.06, 0.4, 0.04),
    "23015": naca("23015"),
}
pytestmark = pytest.mark.usefixtures("own_cache")


def deg(*angles: float) -> np.ndarray:
    """Degrees as radians."""
    return np.deg2rad(np.array(angles, dtype=float))


@pytest.fixture(scope="module", params=sorted(SECTIONS))
def section(request: pytest.FixtureRequest, own_cache: Path) -> tuple[str, Airfoil, Polar]:
    """Name, shape and polar of one section."""
    shape = SECTIONS[request.param]
    return request.param, shape, tunnel_polar(shape)


def test_tunnel_polar_is_closed_and_positive(section: tuple[str, Airfoil, Polar]) -> None:
    _, shape, p = section
    assert p.is_shared and p.M.tolist() == [0.0]
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

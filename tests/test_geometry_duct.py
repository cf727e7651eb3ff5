"""Ducts: areas and ratios in closed form, walls that fit the rotor and never cross, faults all at once."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.common import GeometryError
from geometry.duct import Duct, Stator, around
from geometry.laws import helix
from geometry.rotor import Rotor

ROTOR = Rotor(helix(0.069, 0.1, "fan", hub=25.4 / 69), 8)
DUCT = around(ROTOR, 0.060, 0.0004, 0.003, exit_area_ratio=0.85, exit_hub_radius=0.010, stator=Stator(5, 0.02, 0.035))


def test_areas_of_the_ds30() -> None:
    assert DUCT.annulus_area(ROTOR) == pytest.approx(math.pi / 4 * (0.069**2 - 0.0254**2))
    assert DUCT.annulus_area(ROTOR) == pytest.approx(3.233e-3, rel=2e-4)
    assert DUCT.passage_area(ROTOR) == pytest.approx(math.pi * (0.0349**2 - 0.0127**2))
    assert DUCT.exit_area == pytest.approx(0.85 * DUCT.annulus_area(ROTOR))
    assert DUCT.exit_area == pytest.approx(math.pi * (DUCT.exit_radius**2 - 0.010**2))  # type: ignore[operator]
    assert DUCT.area_ratio(ROTOR) == pytest.approx(0.85)


def test_ratios() -> None:
    assert DUCT.gap_over_span(ROTOR) == pytest.approx(0.4 / (34.5 - 12.7))


@pytest.mark.parametrize("gap", [0.0, 0.0004, 0.002])
def test_a_straight_duct_passes_what_it_takes_in(gap: float) -> None:
    duct = around(ROTOR, 0.06, gap, exit_hub_radius=ROTOR.Rhub)
    assert duct.exit_area == pytest.approx(duct.passage_area(ROTOR), rel=1e-14)
    assert (duct.area_ratio(ROTOR) == pytest.approx(1.0, rel=1e-14)) == (gap == 0.0)  # the gap belongs to the passage
    np.testing.assert_allclose(duct.inner(np.linspace(0, 0.06, 20)), ROTOR.R + gap, rtol=1e-14)


ducts = st.builds(
    lambda k, length, lip, cone, te, x, aspect: Duct(
        k, length * k, lip * k, 0.01 * k, cone * k, 0.1 * k, x * length * k, lip_aspect=aspect, te_thickness=te * k
    ),
    st.floats(0.01, 2),
    st.floats(0.6, 5),
    st.just(0.0) | st.floats(0.005, 0.25),
    st.floats(0.5, 1.6),
    st.floats(0.001, 0.2),
    st.floats(0.1, 0.9),
    st.floats(0.3, 2.0),
)


@settings(max_examples=100, deadline=None)
@given(ducts)
def test_walls(duct: Duct) -> None:
    inner, outer = duct.profile(81)
    x = inner[:, 0]
    np.testing.assert_array_equal(x, outer[:, 0])
    assert (np.diff(x) > 0).all()
    assert (x[0], x[-1]) == (0.0, duct.length)
    tiny = 1e-12 * duct.inner_radius
    assert inner[-1, 1] == pytest.approx(duct.exit_radius)
    behind = x >= duct.lip_length
    assert (outer[behind, 1] - inner[behind, 1] >= duct.te_thickness - tiny).all()  # type: ignore[operator]
    assert (outer[:, 1] >= inner[:, 1] - tiny).all()
    if duct.lip_radius > 0:
        assert inner[0, 1] == pytest.approx(outer[0, 1], rel=1e-12) == duct.inner_radius + duct.lip_radius
    bore = (x >= duct.lip_length) & (x <= duct.bore_end)
    np.testing.assert_allclose(inner[bore, 1], duct.inner_radius, rtol=1e-12)
    if duct.rotor_x >= duct.lip_length:  # type: ignore[operator]
        assert duct.inner(duct.rotor_x) == pytest.approx(duct.inner_radius)  # type: ignore[arg-type]
        assert duct.rotor_x in x
    lip = x < duct.lip_length
    if lip.any():  # a quarter ellipse
        along = (duct.lip_length - x[lip]) / duct.lip_length
        across = (duct.inner_radius + duct.lip_radius - inner[lip, 1]) / duct.lip_radius
        np.testing.assert_allclose(along**2 + across**2, 1.0, rtol=1e-6)


@pytest.mark.parametrize("k", [0.1, 3.0])
def test_scaling_is_a_similarity(k: float) -> None:
    big, rotor = DUCT.scaled(k), ROTOR.scaled(k)
    big.check(rotor)
    for ratio in ("area_ratio", "gap_over_span"):
        assert getattr(big, ratio)(rotor) == pytest.approx(getattr(DUCT, ratio)(ROTOR), rel=1e-12)
    for a, b in zip(DUCT.profile(), big.profile(), strict=True):
        np.testing.assert_allclose(b, k * a, rtol=1e-9)
    assert big.stator == Stator(5, 0.02 * k, 0.035 * k)
    np.testing.assert_allclose(big.stator.sigma(0.025 * k), DUCT.stator.sigma(0.025), rtol=1e-12)  # type: ignore[union-attr]


def test_a_diffuser_is_straight() -> None:
    duct = Duct(0.1, 0.3, 0.01, 0.001, exit_radius=0.12, rotor_x=0.1, diffuser_x=0.1)
    assert float(duct.inner(0.2)) == pytest.approx(0.11)


def test_stator_solidity() -> None:
    np.testing.assert_allclose(Stator(5, 0.02).sigma([0.02, 0.04]), [0.1 / (0.04 * np.pi), 0.1 / (0.08 * np.pi)])


def test_fit_to_the_rotor() -> None:
    DUCT.check(ROTOR)
    replace(DUCT, inner_radius=0.03491).check(ROTOR)  # drawings round
    with pytest.raises(GeometryError) as error:
        replace(DUCT, inner_radius=0.0335).check(ROTOR)
    assert str(error.value) == (
        "duct.inner_radius: got 0.0335 m; expected tip radius plus gap, 0.0345 + 0.0004 = 0.0349 m. "
        "The blades cut the wall."
    )


def test_all_faults_at_once() -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011
        Duct(0.035, 0.06, -0.001, -0.0004, 0.2, 0.3, 0.07, lip_aspect=20, diffuser_x=0.1, te_thickness=math.nan)
    assert str(error.value) == (
        "duct.lip_radius: got -0.001 m; expected a number from 0 to 0.07 m.\n"
        "duct.gap: got -0.0004 m; expected a number from 0 to 0.007 m. A bore smaller than the rotor cuts the blades.\n"
        "duct.exit_radius: got 0.2 m; expected a number from 0.007 to 0.105 m.\n"
        "duct.exit_hub_radius: got 0.3 m; expected a number from 0 to 0.198 m.\n"
        "duct.rotor_x: got 0.07 m; expected a number from 0 to 0.06 m. Counted from the leading edge of the lip.\n"
        "duct.lip_aspect: got 20; expected a number from 0.2 to 10.\n"
        "duct.te_thickness: got nan m; expected a number from 0 to 0.035 m.\n"
        "duct.diffuser_x: got 0.1 m; expected a number from 0 to 0.06 m."
    )
    with pytest.raises(GeometryError) as error:
        Duct(350, math.nan)
    assert str(error.value) == (
        "duct.inner_radius: got 350 m; expected a positive number of metres. Given in millimetres?\n"
        "duct.length: got nan m; expected a positive number of metres."
    )
    with pytest.raises(GeometryError, match="a lip 0.08 m long; expected a lip shorter than the duct, 0.06 m"):
        Duct(0.2, 0.06, 0.08)
    with pytest.raises(GeometryError, match="exit_area_ratio: got 0; expected a number from 0.1 to 5"):
        around(ROTOR, 0.06, 0.0004, exit_area_ratio=0.0)


def test_faults_of_a_stator() -> None:
    with pytest.raises(GeometryError) as error:
        Stator(0, -0.02, beta=90.0)
    assert str(error.value) == (
        "stator.B: got 0; expected a whole number of vanes from 1 to 200.\n"
        "stator.chord: got -0.02 m; expected a positive number.\n"
        "stator.beta: got 90 rad; expected a number from 0 to 3.14159 rad. Given in degrees?"
    )

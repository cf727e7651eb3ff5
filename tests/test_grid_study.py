"""The promise of bemt.recordings.grid_study: order, extrapolation and index of published values; what is implausible is flagged."""
# ruff: noqa: E501 - tables of values

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bemt.base.errors import InputError
from bemt.recordings.grid_study import grid_study, ratios


def test_published_value() -> None:
    s = grid_study([0.97050, 0.96854, 0.96178], [2.0, 2.0])
    assert f"{s.order:.4f}" == "1.7862" and f"{s.extrapolated:.5f}" == "0.97130"
    assert f"{s.gci_fine:.4%}" == "0.1031%" and f"{s.gci_coarse:.4%}" == "0.3562%"
    assert s.safety == 1.25 and s.flags == () and s.asymptotic == pytest.approx(1.0, abs=0.005)


def test_celik_example_with_unequal_ratios() -> None:
    """Celik et al. 2008, table 1, first column: N = 18000, 8000, 4500 in two dimensions; p = 1.53, GCI 2.2 %."""
    s = grid_study([6.063, 5.972, 5.863], ratios([18000, 8000, 4500], 2))
    assert s.ratios == pytest.approx((1.5, 4.0 / 3.0))
    assert s.order == pytest.approx(1.53, abs=0.01) and s.extrapolated == pytest.approx(6.1685, abs=5e-4)
    assert s.gci_fine == pytest.approx(0.022, abs=5e-4)


@settings(max_examples=150, deadline=None)
@given(
    st.floats(0.6, 2.9), st.floats(1.3, 3.0), st.floats(1.3, 3.0), st.floats(0.1, 100.0), st.floats(-0.05, 0.05),
    st.sampled_from((1.0, -1.0)),
)  # fmt: skip
def test_exact_power_laws_come_back(p: float, r21: float, r32: float, f0: float, c: float, sign: float) -> None:
    assume(abs(c) > 1e-4)
    values = [sign * f0 * (1.0 + c * h**p) for h in (1.0, r21, r21 * r32)]
    assume(abs(values[2] / values[0]) > 0.1)
    s = grid_study(values, [r21, r32])
    assert s.order == pytest.approx(p, rel=1e-5) and s.extrapolated == pytest.approx(sign * f0, rel=1e-5)
    assert s.flags == () and s.gci_fine == pytest.approx(1.25 * abs(c / (1.0 + c)), rel=1e-4)
    assert s.u_relative == pytest.approx(s.gci_fine / 1.15)


def test_two_grids_assume_the_order_and_pay_for_it() -> None:
    s = grid_study([10.0, 9.0], [2.0])
    assert s.gci_fine == pytest.approx(3.0 * 0.1 / 3.0) and s.order == 2.0 and s.gci_coarse is None
    assert s.flags == ("two grids: order 2 is assumed",) and s.safety == 3.0


@pytest.mark.parametrize(
    ("values", "r", "flag"),
    [
        ([1.0, 1.1, 1.05], [2, 2], "oscillatory"),
        ([1.0, 1.1, 1.15], [2, 2], "divergent"),
        ([1.0, 1.001, 1.2], [2, 2], "implausible order 7.6"),
        ([1.0, 1.1, 1.21], [2, 2], "implausible order 0.1"),
        ([1.0, 1.0, 1.1], [2, 2], "agree exactly"),
        ([1.0, 1.1, 1.1], [2, 2], "agree exactly"),
        ([1.0, 1.001, 1.0025], [1.2, 1.2], "ratio 1.2 below 1.3"),
    ],
)
def test_what_is_wrong_is_flagged_and_costs_uncertainty(values: list[float], r: list[float], flag: str) -> None:
    s = grid_study(values, r)
    assert any(flag in text for text in s.flags), s.flags
    if "ratio" not in flag:
        assert s.u_relative >= 3.0 * (max(values) - min(values)) / values[0] / 1.15 - 1e-12
    if s.order is None:
        assert s.gci_fine is None and s.extrapolated is None


@pytest.mark.parametrize(
    ("values", "r", "message"),
    [
        ([1.0], [], "1 grids"),
        ([1.0, 2.0, 3.0], [2.0], "1 ratios for 3 grids"),
        ([1.0, 2.0, 3.0], [2.0, 0.5], "List the finest grid first"),
        ([0.0, 2.0], [2.0], "other than zero"),
        ([1.0, math.nan], [2.0], "finite values"),
        ([1.0, 2.0], [1.0], "numbers above 1"),
    ],
)
def test_wrong_input(values: list[float], r: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        grid_study(values, r)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.floats(-1e300, 1e300).filter(bool), min_size=2, max_size=3),
    st.floats(1.0001, 100),
    st.floats(1.0001, 100),
)
def test_any_finite_values_give_a_study(values: list[float], r21: float, r32: float) -> None:
    s = grid_study(values, [r21, r32][: len(values) - 1])
    assert s.u_relative >= 0.0 and not math.isnan(s.u_relative)

"""Coefficients: definitions, inverses, conventions, limits; for scalars and arrays alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bemt.physics import coefficients as co

positive = st.floats(1e-3, 1e3)
signed = st.floats(-1e3, 1e3)


@given(signed, positive, positive, positive)
def test_coefficients_invert(x, rho, n, D):
    assert co.thrust(co.CT(x, rho, n, D), rho, n, D) == pytest.approx(x, rel=1e-12)
    assert co.torque(co.CQ(x, rho, n, D), rho, n, D) == pytest.approx(x, rel=1e-12)
    assert co.power(co.CP(x, rho, n, D), rho, n, D) == pytest.approx(x, rel=1e-12)
    assert co.airspeed(co.J(x, n, D), n, D) == pytest.approx(x, rel=1e-12)
    assert co.CQ_from_CP(co.CP_from_CQ(x)) == pytest.approx(x, rel=1e-12)


@given(signed, positive, positive, positive)
def test_power_is_torque_times_angular_speed(Q, rho, n, D):
    assert co.CP(Q * 2 * math.pi * n, rho, n, D) == pytest.approx(co.CP_from_CQ(co.CQ(Q, rho, n, D)), rel=1e-12)


@given(positive, positive, positive, positive)
def test_helicopter_convention_from_first_principles(T, rho, n, D):
    A, tip = math.pi * D**2 / 4, math.pi * n * D
    P = T * 7.3
    CT_rotor, CP_rotor = T / (rho * A * tip**2), P / (rho * A * tip**3)
    CQ_rotor = P / (2 * math.pi * n) / (rho * A * tip**2 * D / 2)
    assert CQ_rotor == pytest.approx(CP_rotor, rel=1e-12)
    assert co.CT_PER_ROTOR * CT_rotor == pytest.approx(co.CT(T, rho, n, D), rel=1e-12)
    assert co.CP_PER_ROTOR * CP_rotor == pytest.approx(co.CP(P, rho, n, D), rel=1e-12)
    assert co.CQ_PER_ROTOR * CQ_rotor == pytest.approx(co.CQ_from_CP(co.CP(P, rho, n, D)), rel=1e-12)


@given(positive, positive, st.floats(0.05, 3))
def test_ideal_rotor_has_a_figure_of_merit_of_one(rho, T, D):
    A, n = math.pi * D**2 / 4, 50.0
    P = T * math.sqrt(T / (2 * rho * A))
    assert co.FM(co.CT(T, rho, n, D), co.CP(P, rho, n, D)) == pytest.approx(1.0, rel=1e-10)


@given(st.floats(1e-8, 3), signed, positive)
def test_efficiency_is_useful_over_shaft_power(J, CT, CP):
    assert co.eta(J, CT, CP) == pytest.approx(J * CT / CP, rel=1e-12)


def test_efficiency_in_the_four_states():
    assert co.eta(0.0, 0.1, 0.04) == 0.0  # at rest: exactly zero, not CT/CP
    assert co.eta(0.5, 0.05, 0.04) == pytest.approx(0.625)
    assert co.eta(1.0, -0.01, 0.01) == -1.0  # brake: shaft drives, thrust drags
    assert math.isnan(co.eta(1.5, -0.1, -0.05))  # windmill: +3 would look like an efficiency
    assert math.isnan(co.eta(0.8, 0.05, 0.0))
    assert math.isnan(co.eta(0.0, math.nan, 0.04))  # an unconverged point is not 0
    assert math.isnan(co.eta(math.nan, 0.1, 0.04))


@pytest.mark.parametrize(("CT", "CP"), [(-0.01, 0.04), (0.1, 0.0), (0.1, -0.02), (math.nan, 0.04)])
def test_no_figure_of_merit_without_thrust_and_power(CT, CP):
    assert math.isnan(co.FM(CT, CP))


@pytest.mark.parametrize("n", [0.0, -1.0])
@pytest.mark.parametrize("function", [co.CT, co.CQ, co.CP])
def test_no_coefficient_without_rotation(function, n):
    assert math.isnan(function(1.0, 1.225, n, 0.25))
    assert math.isnan(co.J(10.0, n, 0.25))


# Rotational tip Mach number of 8, 10, 12, 14 in at 20 000 rev/min, a = 340.3 m/s, as stated by the source thesis.
@pytest.mark.parametrize(("d_in", "M"), [(8, 0.63), (10, 0.78), (12, 0.94), (14, 1.09)])
def test_tip_mach_numbers_as_stated(d_in, M):
    assert round(co.M_tip(20000 / 60, d_in * 0.0254, 340.3), 2) == M


@given(positive, positive, signed)
def test_helical_tip_speed_is_the_resultant(n, D, V):
    a = 340.0
    assert co.M_tip_helical(n, D, a, 0.0) == pytest.approx(co.M_tip(n, D, a), rel=1e-12)
    assert co.M_tip_helical(n, D, a, V) ** 2 == pytest.approx(co.M_tip(n, D, a) ** 2 + (V / a) ** 2, rel=1e-10)


@given(positive, positive, positive, signed)
def test_reynolds_number_scales(c, n, D, V):
    Re = co.Re75(c, n, D, V, 1.2, 1.8e-5)
    assert co.Re75(2 * c, n, D, V, 1.2, 1.8e-5) == pytest.approx(2 * Re, rel=1e-12)
    assert co.Re75(c, 2 * n, D, 2 * V, 1.2, 1.8e-5) == pytest.approx(2 * Re, rel=1e-12)
    assert co.Re75(c, n, D, 0.0, 1.2, 1.8e-5) == pytest.approx(1.2 * 0.75 * math.pi * n * D * c / 1.8e-5, rel=1e-12)


def test_arrays_equal_scalars():
    T, n, V = np.array([1.0, -2.0, 3.0]), np.array([50.0, 0.0, 70.0]), np.array([0.0, 5.0, 9.0])
    for function, args in (
        (co.CT, (T, 1.2, n, 0.3)), (co.CP, (T, 1.2, n, 0.3)), (co.J, (V, n, 0.3)),
        (co.M_tip_helical, (n, 0.3, 340.0, V)),
        (co.eta, (V / 10, T / 10, 0.05)), (co.FM, (T / 10, 0.05)),
    ):  # fmt: skip
        whole = function(*args)
        each = [function(*(a[i] if isinstance(a, np.ndarray) else a for a in args)) for i in range(3)]
        assert whole.shape == (3,)
        assert all(isinstance(e, float) for e in each)
        np.testing.assert_array_equal(whole, each)


def test_arguments_broadcast():
    assert co.J(np.zeros((4, 1)), np.ones(3), 0.3).shape == (4, 3)
    assert co.eta(np.zeros((4, 1)), np.ones(3), 0.3).shape == (4, 3)


@given(st.floats(0.01, 3.0), st.floats(1e-4, 1.0), positive)
def test_the_limit_of_efficiency_is_the_ideal_disk(J, CT, D):
    """Thrust from T = 2 rho A (V + v) v with the efficiency V/(V + v)."""
    V = J * D
    v = V * (1.0 / co.eta_limit(J, CT) - 1.0)
    assert 2.0 * math.pi / 4.0 * D**2 * (V + v) * v == pytest.approx(co.thrust(CT, 1.0, 1.0, D), rel=1e-6)

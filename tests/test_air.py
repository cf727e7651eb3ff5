"""Air: standard atmosphere tables, moist air, refusals."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bemt.base.errors import InputError
from bemt.physics.air import GAMMA, R_DRY, Air, isa_pressure, saturation_pressure, sutherland

# ISO 2533 / U.S. Standard Atmosphere 1976, by geopotential altitude: H [m], T [K], p [Pa], rho [kg/m3], a [m/s].
ISA = [
    (-1000, 294.65, 113929.0, 1.34702, 344.111), (0, 288.15, 101325.0, 1.22500, 340.294),
    (1000, 281.65, 89874.6, 1.11164, 336.434), (2000, 275.15, 79495.2, 1.00649, 332.529),
    (5000, 255.65, 54019.9, 0.736116, 320.529), (8000, 236.15, 35599.8, 0.525168, 308.063),
    (11000, 216.65, 22632.1, 0.363918, 295.070), (15000, 216.65, 12044.6, 0.193674, 295.070),
    (20000, 216.65, 5474.89, 0.0880349, 295.070), (25000, 221.65, 2511.02, 0.0394658, 298.455),
    (32000, 228.65, 868.019, 0.0132250, 303.131),
]  # fmt: skip


@pytest.mark.parametrize(("H", "T", "p", "rho", "a"), ISA)
def test_standard_atmosphere_table(H, T, p, rho, a):
    air = Air.isa(H)
    assert isa_pressure(H) == pytest.approx((p, T), rel=2e-5)
    assert air.temperature_K == pytest.approx(T, abs=1e-9)
    assert air.rho == pytest.approx(rho, rel=2e-5)
    assert air.a_sound == pytest.approx(a, rel=2e-5)


# U.S. Standard Atmosphere 1976, table of dynamic viscosity: T [K], mu [1e-5 Pa s].
@pytest.mark.parametrize(("T", "mu"), [(288.15, 1.7894), (216.65, 1.4216), (255.676, 1.6282)])
def test_viscosity_of_the_standard_atmosphere(T, mu):
    assert sutherland(T) * 1e5 == pytest.approx(mu, abs=1e-4)


@given(st.floats(-4999, 31999))
def test_pressure_is_hydrostatic(H):
    # a step so short that the bend of the temperature at the tropopause does not count
    dp = (isa_pressure(H + 0.005)[0] - isa_pressure(H - 0.005)[0]) / 0.01
    assert dp == pytest.approx(-9.80665 * Air.isa(H).rho, rel=1e-6)


def test_layers_meet():
    for edge in (11000.0, 20000.0):
        below, above = isa_pressure(edge - 1e-6), isa_pressure(edge + 1e-6)
        assert below == pytest.approx(above, rel=1e-9)


@given(st.floats(-1000, 15000), st.floats(-30, 30))
def test_a_temperature_deviation_keeps_the_pressure(H, dT):
    standard, other = Air.isa(H), Air.isa(H, dT)
    assert other.rho * other.temperature_K == pytest.approx(standard.rho * standard.temperature_K, rel=1e-12)
    assert other.temperature_K - standard.temperature_K == pytest.approx(dT, abs=1e-9)
    assert other.a_sound**2 == pytest.approx(GAMMA * R_DRY * other.temperature_K, rel=1e-12)


def test_density_alone_means_fifteen_degrees():
    air = Air.from_density()
    assert (air.rho, air.temperature_K) == (1.225, 288.15)
    assert air.a_sound == pytest.approx(Air.isa().a_sound, rel=1e-12)
    assert air.mu == pytest.approx(Air.isa().mu, rel=1e-12)
    assert Air.from_density(0.9).a_sound == air.a_sound
    assert air.nu == pytest.approx(1.4607e-5, rel=1e-4)  # U.S. Standard Atmosphere 1976, sea level


def test_dry_air_by_cipm_is_within_the_real_gas_factor_of_the_ideal_gas():
    air = Air.from_state(101325.0, 15.0, 0.0)
    assert air.rho == pytest.approx(1.2250, abs=6e-4)  # Z(288 K, 101 kPa) = 0.9996
    assert 1.0002 < air.rho / Air.isa().rho < 1.0006
    assert air.a_sound == pytest.approx(Air.isa().a_sound, rel=3e-4)


@given(st.floats(9.0e4, 1.1e5), st.floats(10, 30), st.floats(0, 80))
def test_density_of_moist_air_by_the_approximation_of_oiml(p, t, h):
    """OIML R 111-1 (2004), eq. E.3-1, an independent fit to CIPM with a stated relative uncertainty of 2e-4."""
    approximate = (0.34848 * p / 100 - 0.009 * h * math.exp(0.061 * t)) / (273.15 + t)
    assert Air.from_state(p, t, h).rho == pytest.approx(approximate, rel=4e-4)


def test_saturation_pressure_at_known_points():
    assert saturation_pressure(273.16) == pytest.approx(611.657, rel=1e-3)  # triple point
    assert saturation_pressure(293.15) == pytest.approx(2339.3, rel=1e-3)  # Wexler 1976
    assert saturation_pressure(303.15) == pytest.approx(4246.9, rel=1e-3)


@given(st.floats(8e4, 1.05e5), st.floats(0, 40), st.floats(0, 99))
def test_humidity_lightens_air_and_speeds_sound(p, t, h):
    dry, moist, wet = (Air.from_state(p, t, x) for x in (0.0, h, h + 1.0))
    assert wet.rho < moist.rho <= dry.rho
    assert wet.a_sound > moist.a_sound >= dry.a_sound


def test_all_faults_of_a_reading_at_once():
    with pytest.raises(InputError) as error:
        Air.from_state(1013.25, 293.15, 150.0)
    assert str(error.value).splitlines() == [
        "air.pressure_Pa: got 1013.25; expected 10000 to 120000 Pa. hPa given?",
        "air.temperature_C: got 293.15; expected -60 to 60 degC. Kelvin given? 293.15 K is 20 C.",
        "air.humidity_pct: got 150; expected 0 to 100 %. Relative humidity in per cent.",
    ]


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, "1.2", None])
def test_no_state_without_positive_finite_numbers(bad):
    with pytest.raises(InputError, match=r"air\.rho: got .*; expected a positive finite number"):
        Air(bad, 1.8e-5, 340.0)
    with pytest.raises(InputError) as error:
        Air(bad, bad, bad, bad)
    assert len(error.value.faults) == 4


@pytest.mark.parametrize("H", [-6000.0, 33000.0, math.nan])
def test_altitudes_outside_the_layers_are_refused(H):
    with pytest.raises(InputError, match="altitude_m: got .*expected -5000 to 32000 m. Feet given"):
        Air.isa(H)


def test_stack_joins_states():
    both = Air.stack([Air.isa(0.0), Air.isa(3000.0)])
    assert np.array_equal(both.rho, [Air.isa(0.0).rho, Air.isa(3000.0).rho])
    assert np.array_equal(both.temperature, [288.15, Air.isa(3000.0).temperature_K])
    with pytest.raises(InputError):
        Air.stack([])


def test_water_is_as_dense_and_viscous_as_tabulated() -> None:
    """ITTC 7.5-02-01-03: fresh 999.10, 997.05 kg/m3; 1.1386, 0.8927 mm2/s at 15, 25 C; sea 1026.02, 1.1892 at 15 C."""
    for t, salt, rho, nu in ((15.0, 0.0, 999.10, 1.1386e-6), (25.0, 0.0, 997.05, 0.8927e-6),
                             (15.0, 35.165, 1026.02, 1.1892e-6)):  # fmt: skip
        water = Air.water(t, salt)
        assert water.rho == pytest.approx(rho, rel=1e-3) and water.nu == pytest.approx(nu, rel=1e-3)
    assert Air.from_density(998.2, 20.0).mu == pytest.approx(Air.water(20.0).mu)
    with pytest.raises(InputError) as told:
        Air.water(290.0, 60.0)
    assert len(told.value.faults) == 2

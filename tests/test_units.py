"""Units: exact definitions, round trips, suffixes, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bemt.base import units as u
from bemt.base.errors import InputError


# NIST SP 811 (2008), appendix B.8: factors as printed there.
@pytest.mark.parametrize(
    ("unit", "si", "rel"),
    [
        ("in", 2.54e-2, 0), ("ft", 3.048e-1, 0), ("kgf", 9.80665, 0), ("lb", 4.5359237e-1, 0), ("lbf", 4.448222, 1e-6),
        ("ozf", 2.780139e-1, 1e-6), ("lbf_in", 1.129848e-1, 1e-6), ("lbf_ft", 1.355818, 1e-6),
        ("ozf_in", 7.061552e-3, 1e-6), ("hp", 7.456999e2, 1e-6), ("kt", 5.144444e-1, 1e-6), ("mph", 4.4704e-1, 1e-12),
        ("km_h", 2.777778e-1, 1e-6), ("rpm", 1.047198e-1, 1e-6), ("deg", 1.745329e-2, 1e-6), ("bar", 1e5, 0),
        ("kNm", 1e3, 0),
    ],
)  # fmt: skip
def test_factors_are_the_published_ones(unit, si, rel):
    assert u.to_si(1.0, unit) == pytest.approx(si, rel=rel or 1e-15)


def test_temperatures_at_their_fixed_points():
    assert u.to_si(0.0, "C") == 273.15
    assert u.to_si(32.0, "F") == pytest.approx(273.15, abs=1e-12)
    assert u.to_si(212.0, "F") == pytest.approx(373.15, abs=1e-12)
    assert u.convert(-40.0, "C", "F") == pytest.approx(-40.0, abs=1e-12)


@given(st.sampled_from(sorted(u.UNITS)), st.floats(-1e6, 1e6))
def test_round_trip_of_every_unit(unit, value):
    assert u.from_si(u.to_si(value, unit), unit) == pytest.approx(value, rel=1e-12, abs=1e-9)


@given(st.data(), st.floats(-1e3, 1e3))
def test_conversion_through_any_third_unit_is_the_direct_one(data, value):
    dimension = data.draw(st.sampled_from(sorted({x.dimension for x in u.UNITS.values()})))
    a, b, c = (data.draw(st.sampled_from(u.suffixes(dimension))) for _ in range(3))
    direct = u.convert(value, a, c)
    assert u.convert(u.convert(value, a, b), b, c) == pytest.approx(
        direct, rel=1e-9, abs=1e-9 * u.UNITS[c].factor ** -1
    )


def test_arrays_convert_element_by_element():
    assert np.array_equal(u.to_si(np.array([1.0, 2.0]), "in"), [u.to_si(1.0, "in"), u.to_si(2.0, "in")])


def test_every_dimension_lists_its_si_unit_first():
    for dimension in {x.dimension for x in u.UNITS.values()} - {"fraction"}:
        first = u.UNITS[u.suffixes(dimension)[0]]
        assert (first.factor, first.offset) == (1.0, 0.0), dimension


@pytest.mark.parametrize(
    ("key", "name", "suffix"),
    [
        ("diameter_in", "diameter", "in"), ("airspeed_m_s", "airspeed", "m_s"), ("density_kg_m3", "density", "kg_m3"),
        ("torque_lbf_in", "torque", "lbf_in"), ("torque_gf_cm", "torque", "gf_cm"), ("rpm", "rpm", "rpm"),
        ("speed_rpm", "speed", "rpm"), ("thrust_N", "thrust", "N"), ("omega_rad_s", "omega", "rad_s"),
        ("twist_0_75_deg", "twist_0_75", "deg"),
    ],
)  # fmt: skip
def test_the_longest_suffix_wins(key, name, suffix):
    base, unit = u.split_suffix(key)
    assert (base, unit.suffix) == (name, suffix)


@pytest.mark.parametrize("key", ["blades", "thrust_n", "m", "M_tip", "", "diameter_inch", "thrust_KGF"])
def test_no_suffix_is_guessed(key):
    assert u.split_suffix(key) == (key, None)


def test_units_of_different_dimension_are_refused():
    with pytest.raises(InputError, match=r"unit: got 'kgf' \(force\) -> 'kg' \(mass\); expected two units of the same"):
        u.convert(1.0, "kgf", "kg")
    with pytest.raises(InputError, match="unit: got 'furlong'; expected one of A, "):
        u.to_si(1.0, "furlong")

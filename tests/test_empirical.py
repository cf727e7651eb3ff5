"""K1/K2 model: published values, invariants, the printed equation's defect, flags."""

import math

import numpy as np
import pytest
import thesis as th
from hypothesis import given
from hypothesis import strategies as st

from bemt.base.errors import InputError
from bemt.physics import k1k2 as k
from bemt.physics.air import Air

INCH, KGF = 0.0254, 9.80665
lengths = st.floats(0.02, 3.0)
rpms = st.floats(100.0, 60000.0)


# Recomputed from the thesis's equation at 20 000 rev/min, 1.225 kg/m3, at rest.
@pytest.mark.parametrize(("d", "p", "kgf"), [(8, 5, 2.456), (10, 5, 5.363), (12, 6, 11.121), (14, 8, 22.025)])
def test_the_four_propellers(d, p, kgf):
    F = k.thrust(d * INCH, p * INCH, 20000.0)
    assert F / KGF == pytest.approx(kgf, abs=5e-4)
    e = k.estimate(d * INCH, p * INCH, 20000.0)
    assert e.thrust_N[0] / KGF == F / KGF
    assert e.CT[0] == pytest.approx(F / (1.225 * (20000 / 60) ** 2 * (d * INCH) ** 4), rel=1e-12)


def test_the_worked_example_of_its_author():
    # Staples, part 1: 10x6 at 10 500 rev/min gives 1619 g, and no thrust near 60 mph.
    assert k.thrust(10 * INCH, 6 * INCH, 10500.0) / KGF * 1000 == pytest.approx(1619, abs=0.5)
    assert k.pitch_speed(10500.0, 6 * INCH) / 0.44704 == pytest.approx(60, abs=0.5)


def test_his_constants_as_he_prints_them():
    # Staples's expanded form: F = 1.225 pi (0.0254 d)^2/4 [(RPM 0.0254 p/60)^2 - (...) V0] (d/(3.29546 p))^1.5
    d, p, rpm, V0 = 11.0, 7.0, 9000.0, 8.0
    vp = rpm * 0.0254 * p / 60
    F = 1.225 * math.pi * (0.0254 * d) ** 2 / 4 * (vp**2 - vp * V0) * (d / (3.29546 * p)) ** 1.5
    assert k.thrust(d * INCH, p * INCH, rpm, V0) == pytest.approx(F, rel=1e-12)


@given(lengths, lengths, rpms, st.floats(-50, 200), st.floats(0.2, 1.4))
def test_it_is_linear_in_density_and_in_annulus_area(D, p, rpm, V, rho):
    F = k.thrust(D, p, rpm, V)
    assert k.thrust(D, p, rpm, V, rho) == pytest.approx(F * rho / 1.225, rel=1e-12)
    assert k.thrust(D, p, rpm, V, hub_diameter_m=0.6 * D) == pytest.approx(F * (1 - 0.36), rel=1e-10)


@given(lengths, lengths, rpms, st.floats(0, 1.5), st.floats(0.2, 5.0))
def test_similarity(D, p, rpm, x, scale):
    V = x * k.pitch_speed(rpm, p)
    F, still = k.thrust(D, p, rpm, V), k.thrust(D, p, rpm, 0.0)  # near the pitch speed F is a small difference
    assert k.thrust(D * scale, p * scale, rpm, V * scale) / scale**4 == pytest.approx(F, rel=1e-9, abs=1e-14 * still)
    assert k.thrust(D, p, rpm * scale, V * scale) / scale**2 == pytest.approx(F, rel=1e-9, abs=1e-14 * still)


@given(lengths, lengths, rpms)
def test_thrust_vanishes_at_the_pitch_speed_and_is_negative_above(D, p, rpm):
    vp = k.pitch_speed(rpm, p)
    static = k.thrust(D, p, rpm)
    assert k.thrust(D, p, rpm, vp) == pytest.approx(0.0, abs=1e-12 * static)
    assert k.thrust(D, p, rpm, 1.5 * vp) == pytest.approx(-0.5 * static, rel=1e-9)
    assert vp / (rpm / 60 * D) == pytest.approx(k.zero_thrust_J(D, p), rel=1e-12)
    e = k.estimate(D, p, rpm, [0.99 * vp, 1.01 * vp])
    assert [any("above the pitch speed" in f for f in flags) for flags in e.flags] == [False, True]


bases = st.tuples(st.floats(0.01, 100), st.floats(0.01, 100), st.floats(0.01, 100))


@given(bases)
def test_the_right_form_does_not_depend_on_the_units(base):
    assert abs(th.unit_defect(k.corrected_equation, *base)) < 1e-9


@given(st.floats(1.05, 50), st.booleans())
def test_the_printed_form_does(factor, up):
    """Its second term is (m/s)^2, not newtons: it scales with L^2/T^2 instead of M L/T^2."""
    f = factor if up else 1 / factor
    assert abs(th.unit_defect(th.printed_equation, mass=f)) > 1e-3
    assert abs(th.unit_defect(th.printed_equation, length=f)) > 1e-3
    assert abs(th.unit_defect(th.printed_equation, time=f)) < 1e-9  # both terms carry T^-2


def test_the_printed_form_is_right_only_at_rest():
    at_rest, moving = (1.225, 0.05, 40.0, 0.0, 1.6), (1.225, 0.05, 40.0, 10.0, 1.6)
    assert th.printed_equation(*at_rest) == k.corrected_equation(*at_rest)
    assert th.printed_equation(*moving) < 0 < k.corrected_equation(*moving)


def test_flags_at_the_edges_of_the_stated_ranges():
    assert [len(k.validity_flags(x)) for x in (0.49, 0.5, 0.79, 0.8, 1.8, 1.81, 2.5, 2.51)] == [1, 1, 1, 0, 0, 1, 1, 1]
    assert "usable range 0.5-2.5" in k.validity_flags(2.51)[0]
    assert "best range 0.8-1.8" in k.validity_flags(2.5)[0]
    assert k.validity_flags(8 / 5) == ()
    assert k.validity_flags(1.2, 0.9) == ()
    assert "above 0.9" in k.validity_flags(1.2, 0.94)[0]
    assert "supersonic" in k.validity_flags(1.2, 1.0)[0]
    assert "ducted" in k.validity_flags(1.2, ducted=True)[0]
    assert "from behind" in k.validity_flags(1.2, J=-0.1)[0]


def test_only_the_14x8_is_supersonic():
    e = k.estimate(np.array([8, 10, 12, 14]) * INCH, np.array([5, 5, 6, 8]) * INCH, 20000.0)
    assert [any("supersonic" in f for f in flags) for flags in e.flags] == [False, False, False, True]
    assert [any("above 0.9" in f for f in flags) for flags in e.flags] == [False, False, True, False]


def test_the_in_flight_flag_tells_how_low_the_model_reads():
    D, p = 0.254, 0.1905
    for x, ratio in ((0.1, "0.86"), (0.5, "0.64"), (0.9, "0.31")):
        flags = k.validity_flags(D / p, J=x * p / D)
        assert len(flags) == 1 and f"about {ratio} of measured" in flags[0]


def test_tip_mach_follows_the_air():
    cold, warm = Air.isa(11000.0), Air.isa(0.0)
    cases = [k.estimate(0.3, 0.2, 18000.0, air=a) for a in (cold, warm)]
    assert cases[0].M_tip[0] / cases[1].M_tip[0] == pytest.approx(warm.a_sound / cold.a_sound, rel=1e-12)
    assert cases[0].thrust_N[0] / cases[1].thrust_N[0] == pytest.approx(cold.rho / warm.rho, rel=1e-12)


def test_uncertainty_is_known_only_where_it_was_measured():
    e = k.estimate(0.254, 0.127, 6000.0, [0.0, 5.0])
    assert e.u["thrust_N"][0] == pytest.approx(0.196 * e.thrust_N[0])
    assert math.isnan(e.u["thrust_N"][1])
    assert math.isnan(k.estimate(0.254, 0.127, 6000.0, ducted=True).u["thrust_N"][0])


def test_stopped_rotor():
    e = k.estimate(0.254, 0.127, 0.0, [0.0, 10.0])
    assert e.thrust_N.tolist() == [0.0, 0.0]
    assert np.isnan(e.CT).all() and np.isnan(e.J).all()
    assert "above the pitch speed" in " ".join(e.flags[1])


def test_all_faults_at_once():
    with pytest.raises(InputError) as error:
        k.thrust(-0.2, 0.0, -1.0, math.nan, 0.0, -0.1)
    assert [f.where for f in error.value.faults] == [
        "diameter_m", "pitch_m", "rpm", "airspeed_m_s", "rho", "hub_diameter_m",
    ]  # fmt: skip
    with pytest.raises(InputError, match="hub_diameter_m: got 0.2; expected less than the diameter"):
        k.thrust(0.2, 0.1, 1000.0, hub_diameter_m=0.2)
    with pytest.raises(InputError, match="diameter_m: got 254; .*Inches or millimetres given"):
        k.thrust(254.0, 0.1, 1000.0)

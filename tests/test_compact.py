"""Compact formula: momentum and blade integral both hold, limits, similarity, flags; errors on UIUC data."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from bemt.formula import compact, estimate, gather, refit, score
from bemt.formula.points import FitPoints
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt import coefficients as co
from bemt.air import Air
from bemt.base.errors import InputError

INCH = 0.0254
QUICK = settings(deadline=None, max_examples=40)
ratios = st.floats(0.2, 1.5)
advances = st.floats(0.0, 1.5)
solidities = st.floats(0.02, 0.4)
reynolds = st.floats(5e3, 1e6)


def test_it_has_eight_constants():
    assert len(dataclasses.fields(compact.Constants)) == 8


@QUICK
@given(ratios, advances, solidities, reynolds)
def test_thrust_is_that_of_the_blade_integral_and_of_momentum(pd, J, s, Re):
    # A helix blade integrated numerically in a uniform inflow, without stall; r is the formula's loss at low Re.
    c = dataclasses.replace(compact.CONSTANTS, loading_max=1e9)
    r = 1.0 / (1.0 + np.sqrt(c.re_scale / Re))
    C = float(compact.coefficients(pd, J, s, Re, c)[0]) / co.CT_PER_ROTOR / r
    li = -J / np.pi / 2 + np.sqrt((J / np.pi / 2) ** 2 + C / 2) if C >= 0 else None
    x, w = np.polynomial.legendre.leggauss(8)
    x, w = (x + 1) / 2, w / 2
    if li is not None:
        alpha = c.pitch_factor * pd / np.pi / x + c.zero_lift * r**4 - (J / np.pi + li) / x
        assert C == pytest.approx(np.sum(w * s / 2 * compact.LIFT_SLOPE * alpha * x**2), abs=1e-12)
    # above zero thrust the slipstream is slower than the flight
    J0 = c.pitch_factor * pd + 2 * np.pi * c.zero_lift * r**4 / 3
    assert (C > 0) == (J0 > J) or C == pytest.approx(0.0, abs=1e-9)


@QUICK
@given(ratios, solidities, reynolds)
def test_zero_thrust_where_the_docstring_says(pd, s, Re):
    c = compact.CONSTANTS
    r = 1.0 / (1.0 + np.sqrt(c.re_scale / Re))
    J0 = c.pitch_factor * pd + 2 * np.pi * c.zero_lift * r**4 / 3
    assert compact.coefficients(pd, J0, s, Re)[0] == pytest.approx(0.0, abs=1e-12)


@QUICK
@given(ratios, solidities, reynolds)
def test_thrust_falls_with_advance(pd, s, Re):
    CT, _ = compact.coefficients(pd, np.linspace(0.0, 1.2 * pd, 60), s, Re)
    assert np.all(np.diff(CT) <= 1e-12)


@QUICK
@given(ratios, advances, solidities, reynolds)
def test_no_more_thrust_than_ideal_for_its_power(pd, J, s, Re):
    CT, CP = (float(v) for v in compact.coefficients(pd, J, s, Re))
    if CT > 0:
        ideal = CT * (J / 2 + np.sqrt((J / 2) ** 2 + 2 * CT / np.pi))  # T (V + vi) of an actuator disk
        assert CP > ideal


def test_no_chord_no_thrust_and_many_blades_the_momentum_limit():
    c = dataclasses.replace(compact.CONSTANTS, loading_max=1e9)
    assert compact.coefficients(0.6, 0.1, 1e-9, 1e5, c)[0] == pytest.approx(0.0, abs=1e-8)
    # infinitely many blades turn the flow into the helix of zero lift
    r = 1.0 / (1.0 + np.sqrt(c.re_scale / 1e5))
    theta = c.pitch_factor * 0.6 / np.pi + 2 * c.zero_lift * r**4 / 3
    limit = 2 * (theta - 0.1 / np.pi) * theta * r * co.CT_PER_ROTOR
    assert compact.coefficients(0.6, 0.1, 1e9, 1e5, c)[0] == pytest.approx(limit, rel=1e-6)


@QUICK
@given(st.floats(0.05, 2.0), ratios, st.floats(1000, 20000), st.floats(0.0, 0.8), st.floats(0.3, 3.0))
def test_similarity_at_equal_reynolds_number(D, pd, rpm, x, scale):
    air = Air.from_density()
    e = [estimate.estimate(D * k, pd * D * k, 2, rpm / k**2, x * pd * D * k * rpm / k**2 / 60, air, 0.07 * D * k)
         for k in (1.0, scale)]  # fmt: skip
    assert e[1].CT == pytest.approx(e[0].CT, rel=1e-9)
    assert e[1].CP == pytest.approx(e[0].CP, rel=1e-9)
    assert e[1].thrust_N == pytest.approx(e[0].thrust_N, rel=1e-9)  # n^2 D^4 is the same


def test_batch_is_scalar():
    rpm, V = np.array([3000.0, 6000.0, 0.0, 5000.0]), np.array([0.0, 5.0, 0.0, 30.0])
    many = estimate.estimate(0.254, 0.127, 2, rpm, V)
    for i in range(4):
        one = estimate.estimate(0.254, 0.127, 2, rpm[i], V[i])
        for field in dataclasses.fields(many):
            a, b = getattr(many, field.name)[i], getattr(one, field.name)[0]
            assert a == b or (a != a and b != b), field.name


def test_at_rest_without_rotation_there_is_no_thrust_and_in_wind_no_answer():
    e = estimate.estimate(0.254, 0.127, 2, 0.0, [0.0, 5.0])
    assert e.thrust_N[0] == 0.0 and np.isnan(e.thrust_N[1]) and e.flags[1]


def test_the_chord_given_replaces_the_typical_one_and_narrows_the_band():
    typical = estimate.estimate(0.254, 0.127, 2, 6000.0)
    given_ = estimate.estimate(0.254, 0.127, 2, 6000.0, chord_m=compact.default_chord(0.254))
    assert given_.thrust_N == pytest.approx(typical.thrust_N, rel=1e-12)
    assert given_.u_thrust_N[0] < 0.75 * typical.u_thrust_N[0]
    assert typical.u_thrust_N[0] < typical.u95_thrust_N[0]


def test_a_measured_pitch_counts_as_much_as_the_label():
    known = {"chord_m": 0.02}
    e = estimate.estimate(0.254, 0.127, 2, 6000.0, **known, measured_pitch_m=0.147)
    mean = estimate.estimate(0.254, 0.137, 2, 6000.0, **known)
    assert e.CT == pytest.approx(mean.CT, rel=1e-12) and e.CP == pytest.approx(mean.CP, rel=1e-12)
    same = estimate.estimate(0.254, 0.127, 2, 6000.0, **known, measured_pitch_m=0.127)
    label = estimate.estimate(0.254, 0.127, 2, 6000.0, **known)
    assert same.CT == pytest.approx(label.CT, rel=1e-12)
    assert same.u_thrust_N[0] < label.u_thrust_N[0]


def test_a_series_changes_thrust_less_at_rest_and_power_everywhere():
    """At rest the whole of a0 made thrust of some series worse than without it."""
    at = (0.5, np.array([0.0, 0.1, 0.25, 0.5]), 0.1, 5e4)
    plain, own = compact.coefficients(*at), compact.series_coefficients(*at, 0.05)
    whole = compact.coefficients(*at, zero_lift=0.05)
    assert plain[0][0] < own[0][0] < whole[0][0] and own[0][2:] == pytest.approx(whole[0][2:])
    assert np.all(own[1] == whole[1])


def test_a_series_shifts_zero_thrust_and_the_typical_chord():
    kwargs = {"diameter_m": 0.254, "pitch_m": 0.127, "blades": 2, "rpm": 6000.0}
    plain, slow = estimate.estimate(**kwargs), estimate.estimate(**kwargs, series="APC slow flyer")
    own = compact.SERIES["apcsf"]
    assert slow.Re == pytest.approx(own.chord * plain.Re, rel=1e-12) and slow.CT > plain.CT
    chord = 0.5 * 0.254 * 0.2
    Re = float(estimate.estimate(**kwargs, chord_m=chord).Re[0])
    c, r = compact.CONSTANTS, 1.0 / (1.0 + np.sqrt(compact.CONSTANTS.re_scale / Re))
    J0 = c.pitch_factor * 0.5 + 2 * np.pi * (c.zero_lift + own.zero_lift) * r**4 / 3
    assert compact.coefficients(0.5, J0, 0.1, Re, zero_lift=own.zero_lift)[0] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(InputError, match=r"apcsf \(APC Slow Flyer\)"):
        estimate.estimate(**kwargs, series="nobody")


def test_more_blades_give_more_thrust_but_less_each():
    T = [estimate.estimate(0.254, 0.1, b, 6000.0).thrust_N[0] for b in (2, 3, 4)]
    assert T[0] < T[1] < T[2] and T[2] < 2 * T[0]


@pytest.mark.parametrize(
    ("kwargs", "flag"),
    [
        ({"diameter_m": 14 * INCH, "pitch_m": 8 * INCH, "rpm": 20000.0}, "tip Mach 1.09 is supersonic: extrapolated"),
        ({"rpm": 18000.0, "diameter_m": 12 * INCH}, "tip Mach 0.84 above 0.7: extrapolated"),
        ({"rpm": 12000.0}, "tip Mach 0.47 beyond the data"),
        ({"blades": 3}, "3 blades: every propeller of the calibration has 2"),
        ({"ducted": True}, "ducted: a fit to open propellers"),
        ({"airspeed_m_s": -1.0}, "airspeed from behind"),
        ({"airspeed_m_s": 40.0}, "beyond zero thrust"),
        ({"diameter_m": 3 * INCH, "pitch_m": 2 * INCH}, "give the chord, small propellers are wider"),
        ({"pitch_m": 20 * INCH}, "P/D 2.00 outside the data"),
    ],
)
def test_outside_the_data_is_flagged(kwargs, flag):
    base = {"diameter_m": 10 * INCH, "pitch_m": 5 * INCH, "blades": 2, "rpm": 6000.0}
    assert estimate.estimate(**base).flags == ((),)
    e = estimate.estimate(**(base | kwargs))
    assert any(flag in text for text in e.flags[0]), e.flags
    if any(key in flag for key in ("Mach 1.09", "above", "ducted", "behind", "beyond zero")):
        assert np.isnan(e.u_thrust_N[0]) and np.isnan(e.u95_power_W[0])
    assert np.isfinite(e.thrust_N[0])


def test_all_faults_at_once():
    with pytest.raises(InputError) as caught:
        estimate.estimate(-0.2, 500.0, 2.5, -1.0, np.nan, chord_m=-0.5, measured_pitch_m=-0.1, series="nobody")
    assert {f.where for f in caught.value.faults} == {
        "diameter_m", "pitch_m", "blades", "rpm", "airspeed_m_s", "chord_m", "measured_pitch_m", "series",
    }  # fmt: skip


# --- on the data: calibrated on volume 1, volume 2 held out ---


@pytest.fixture(scope="module")
def volumes(shared_data: Path) -> dict[int, FitPoints]:
    folder = shared_data / "uiuc"
    if not folder.is_dir():
        pytest.skip(f"no UIUC data at {folder}")
    return {v: gather.load([folder / f"volume-{v}"]) for v in (1, 2)}


def shares(points: FitPoints, CT: np.ndarray) -> dict[str, object]:
    found = score.score(points, {"m": CT})
    bands = [row["models"]["m"]["median"] for row in found["J/(P/D)"][:4]]
    return {"static": found["static"]["models"]["m"], "flight": bands}


def test_the_published_constants_and_bands_come_from_volume_1(volumes):
    points = volumes[1]
    fitted = refit.fit(points)
    assert fitted is not None and (fitted.propellers, fitted.chords) == (51, 92)
    for field in dataclasses.fields(compact.Constants):
        a, b = getattr(fitted.constants, field.name), getattr(compact.CONSTANTS, field.name)
        assert a == pytest.approx(b, rel=0.01), field.name
    assert fitted.series.keys() == compact.SERIES.keys()
    for key, own in fitted.series.items():
        assert own.zero_lift == pytest.approx(compact.SERIES[key].zero_lift, abs=0.001), key
        assert own.chord == pytest.approx(compact.SERIES[key].chord, abs=0.005), key
    makers = np.unique([p.maker for p in points.propellers], return_inverse=True)[1][points.index]
    out = refit.left_out(points, fitted, makers)
    for known in refit.GIVEN:
        made = [np.where(refit.has(points, known), v, np.nan) for v in out[known]]
        for key, widths in refit.bands(points, *made, fitted, known).items():
            assert widths == pytest.approx(compact.BANDS[known][key], abs=0.004), (known, key)
    # Makers left out, chord known: at rest 84 % within 13 %, K1/K2 61 %; in flight the median stays within 5 %.
    have = refit.has(points, "chord")
    for known in ("chord", "pitch"):
        held = shares(points.select(have), out[known][0][have])
        assert held["static"]["within_13"] > 0.83 and held["static"]["within_26"] > 0.96
        assert all(0.95 < m < 1.05 for m in held["flight"])
    # and three numbers of a maker never seen: 70 %, K1/K2 57 %
    assert shares(points, out["label"][0])["static"]["within_13"] > 0.69


def test_volume_2_held_out(volumes):
    # What is reached. In flight as aimed at (0.9 to 1.1). At rest not (70 %): the inputs themselves carry no more, see
    # test_calibrate; half of the propellers are 2-5 in, below Re 30,000.
    points = volumes[2]
    held = shares(points, refit.predict(points)[0])
    assert held["static"]["within_13"] == pytest.approx(0.578, abs=0.01)
    assert held["static"]["within_26"] == pytest.approx(0.835, abs=0.01)
    assert held["flight"] == pytest.approx([1.01, 1.05, 1.07, 1.10], abs=0.01)
    assert all(0.9 < median < 1.1 for median in held["flight"])
    held = shares(points, refit.predict(points, given="pitch")[0])
    assert held["static"]["within_13"] == pytest.approx(0.64, abs=0.01)
    assert held["static"]["within_26"] == pytest.approx(0.886, abs=0.01)
    large = points.select(points.of("diameter_m") > compact.DIAMETER_RANGE[0])
    held = shares(large, refit.predict(large)[0])
    assert held["static"]["within_13"] > 0.66 and held["static"]["within_26"] > 0.92

"""Section data go on to +-180 degrees without a jump, as the cited model says, and stay what they are inside."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bemt.sections.extrapolation import METHODS, ExtrapolatedTable, extend, from_tables, viterna_cd_max


def deg(*angles: float) -> np.ndarray:
    """Degrees as radians."""
    return np.deg2rad(np.array(angles, dtype=float))


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

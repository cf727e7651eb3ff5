"""Sections, blades, rotors and ducts: as named and published, bad input refused."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator  # type: ignore[import-untyped]

from bemt.physics.sections import rule as section_rule
from geometry.airfoil import PUBLISHED, Airfoil, blend, naca, naca4, parse_dat, plate, published, thickened
from geometry.common import GeometryError, pchip
from geometry.designation import parse_designation
from geometry.duct import Duct, Stator, around
from geometry.laws import CHORD_LAWS, PITCH_LAWS, chord_over_R, from_laws, helix
from geometry.rotor import Blade, Rotor, from_stations

INCH = 0.0254
chord_laws = pytest.mark.parametrize("law", CHORD_LAWS)
pitch_laws = pytest.mark.parametrize("law", PITCH_LAWS)


def stations() -> Blade:
    r = np.linspace(0.02, 0.1, 9)
    return from_stations(
        r, 0.02 - 0.1 * (r - 0.05) ** 2, np.arctan(0.1 / (2 * np.pi * r)), 0.1, 0.015,
        [(0.2, naca("0018")), (0.6, naca("4412")), (1.0, naca("2408"))], sweep=0.1 * (r - 0.02), rake=0.05 * (r - 0.02),
        name="test",
    )  # fmt: skip


# elements ------------------------------------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(
    st.floats(0.01, 50), st.floats(0.01, 0.9), st.integers(1, 300), st.sampled_from(["uniform", "cosine"]), st.randoms()
)
def test_widths_add_up_exactly_in_any_order(D: float, hub: float, n: int, spacing: str, random: Random) -> None:
    blade = helix(D, 0.5 * D, "constant", hub, n=5)
    r, dr, chord, beta = blade.midpoints(n, spacing)
    assert dr.shape == r.shape == chord.shape == beta.shape == (n,)
    shuffled = list(dr)
    random.shuffle(shuffled)
    assert sum(shuffled) == dr.sum() == math.fsum(dr) == blade.R - blade.Rhub
    assert (dr > 0).all()
    assert (np.diff(r) > 0).all()
    assert blade.Rhub < r[0]
    assert r[-1] < blade.R
    np.testing.assert_allclose(r, blade.Rhub + np.cumsum(dr) - 0.5 * dr, rtol=1e-12)


def test_spacing() -> None:
    blade = helix(0.2, 0.1, hub=0.2)
    uniform, cosine = blade.midpoints(20), blade.midpoints(20, "cosine")
    np.testing.assert_allclose(uniform.dr, 0.08 / 20, rtol=1e-12)
    np.testing.assert_allclose(cosine.dr, cosine.dr[::-1], rtol=1e-9)
    assert cosine.dr[0] < 0.1 * cosine.dr[10]


@pytest.mark.parametrize("spacing", ["uniform", "cosine"])
@pytest.mark.parametrize("law", ["apc_like", "linear_taper", "fan"])
def test_blade_area_converges_at_second_order(law: str, spacing: str) -> None:
    blade = helix(0.2032, 0.127, law, n=201)
    area = [float(np.sum(s.chord * s.dr)) for s in (blade.midpoints(n, spacing) for n in (10, 20, 40, 2560))]
    if law == "linear_taper":
        np.testing.assert_allclose(area, area[-1], rtol=1e-12)  # the midpoint rule is exact on straight lines
        return
    errors = np.abs(np.array(area[:3]) - area[3])
    assert math.log2(errors[0] / errors[1]) > 1.8
    assert math.log2(errors[1] / errors[2]) > 1.8


def test_values_are_met_at_stations_kept_between_them_and_held_outside() -> None:
    b = stations()
    blade = from_stations(b.r, b.chord, b.beta, b.R, b.Rhub)
    np.testing.assert_allclose(blade.at(b.r)[0], b.chord, rtol=1e-14)
    np.testing.assert_allclose(blade.at(b.r)[1], b.beta, rtol=1e-14)
    inside = np.linspace(b.r[0], b.r[-1], 400)
    beta = blade.at(inside)[1]
    assert (np.diff(beta) < 0).all()  # monotone data stay monotone: no overshoot
    for r, k in ((0.0, 0), (b.Rhub, 0), (0.2, -1)):
        assert [float(v) for v in blade.at(r)] == pytest.approx([b.chord[k], b.beta[k]], rel=1e-14)


# shape ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("D", "P"), [(8, 5), (10, 5), (12, 6), (14, 8)])
def test_helix_has_one_pitch(D: float, P: float) -> None:
    blade = helix(D * INCH, P * INCH)
    np.testing.assert_allclose(2 * np.pi * blade.r * np.tan(blade.beta), P * INCH, rtol=1e-12)
    for x in (0.3, 0.5, 0.75, 0.95):  # between stations too
        assert blade.pitch_m(x) == pytest.approx(P * INCH, rel=2e-5)
    assert blade.R == pytest.approx(0.5 * D * INCH)
    assert blade.with_pitch_offset(0.03).beta == pytest.approx(blade.beta + 0.03)


def test_sections_blend_between_anchors_and_are_held_outside() -> None:
    blade = stations()
    sections = [section for _, section in blade.anchors]
    assert [blade.section(x * 0.1) for x in (0.2, 0.6, 1.0)] == sections
    assert blade.section(0.015) is sections[0]
    assert blade.section(0.04).thickness == pytest.approx(0.15, abs=1e-3)
    assert blade.section(0.05).camber == pytest.approx(0.03, abs=3e-4)
    whole = helix(0.2, 0.1, anchors=naca("4412"))
    assert whole.section(0.03) is whole.section(0.1)
    with pytest.raises(GeometryError, match="anchors: got none; expected one section or more"):
        helix(0.2, 0.1).section(0.05)


def test_section_outline_is_turned_scaled_and_shifted() -> None:
    blade = stations()
    r = 0.06
    chord, beta = (float(v) for v in blade.at(r))
    outline = blade.section_curve(r)
    nose, tail = outline[80], 0.5 * (outline[0] + outline[-1])
    ahead = nose - tail
    assert np.hypot(*ahead) == pytest.approx(chord, rel=1e-3)
    assert math.atan2(ahead[1], ahead[0]) == pytest.approx(beta, abs=1e-3)  # leading edge ahead and upstream
    axis = tail + 0.75 * ahead
    np.testing.assert_allclose(axis, [-0.1 * (r - 0.02), -0.05 * (r - 0.02)], rtol=0, atol=1e-3 * chord)
    x, y = outline.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert abs(area) == pytest.approx(blade.section(r).area * chord**2, rel=1e-12)
    upper, lower = outline[40], outline[120]
    assert (upper - lower) @ np.array([-math.sin(beta), math.cos(beta)]) > 0  # suction side upstream
    assert blade.section_curve(r, 61).shape == (61, 2)


def test_key_follows_the_shape_alone() -> None:
    blade = stations()
    assert pickle.loads(pickle.dumps(blade)).key() == blade.key() == stations().key()
    others = [blade.with_pitch_offset(1e-6), replace(blade, R=1.001 * blade.R)]
    others.append(from_stations(blade.r, blade.chord, blade.beta, blade.R, blade.Rhub, naca("4412")))
    assert len({b.key() for b in [blade, *others]}) == 4
    with pytest.raises(ValueError, match="read-only"):
        blade.chord[0] = 1.0


# laws ----------------------------------------------------------------------------------------------------------------


@chord_laws
def test_chord_laws_scale_and_stay_positive(law: str) -> None:
    x = np.linspace(0.15, 1.0, 500)
    declared = CHORD_LAWS[law].parameters["max_chord"]
    c = chord_over_R(law, x)
    assert (c > 0).all()
    assert c.max() <= declared * (1 + 1e-4)
    np.testing.assert_allclose(chord_over_R(law, x, max_chord=2 * declared), 2 * c, rtol=1e-14)
    from_laws(0.2, law, pitch={"pitch": 0.1})  # a blade comes of it


def test_apc_like_has_the_declared_shape() -> None:
    x = np.linspace(0.1, 1.0, 1001)
    c = chord_over_R("apc_like", x)
    assert c.max() == pytest.approx(0.195, rel=1e-4)
    assert 0.40 <= x[c.argmax()] <= 0.45
    np.testing.assert_allclose(chord_over_R("apc_like", [0.15, 0.75, 1.0]), [0.13, 0.13, 0.04], atol=0.002)
    slope = np.diff(c)
    assert np.count_nonzero(np.diff(np.sign(slope))) == 1  # one maximum, no wiggle
    assert np.count_nonzero(np.diff(np.sign(np.diff(slope)))) <= 3


def test_other_chord_laws_in_closed_form() -> None:
    x = np.array([0.2, 0.6, 0.95])
    np.testing.assert_allclose(chord_over_R("elliptic", x, max_chord=0.2), 0.2 * np.sqrt(1 - x**2), rtol=1e-14)
    np.testing.assert_allclose(chord_over_R("constant", x, max_chord=0.2), 0.2, rtol=1e-14)
    taper = chord_over_R("linear_taper", [0.2, 0.6, 1.0], 0.2, max_chord=0.2, taper=0.4)
    np.testing.assert_allclose(taper, [0.2, 0.14, 0.08], rtol=1e-14)
    np.testing.assert_allclose(chord_over_R("fan", [0.4, 0.7, 1.0], 0.4, max_chord=0.4), [0.36, 0.4, 0.36], rtol=1e-14)


@pitch_laws
def test_pitch_laws_make_blades(law: str) -> None:
    blade = from_laws(0.2032, "apc_like", law, pitch={"pitch": 0.127})
    assert (blade.beta >= 0).all()
    assert (np.diff(blade.beta) <= 1e-15).all()


def test_pitch_laws_in_closed_form() -> None:
    hub, R = 0.2, 0.1016
    relieved = from_laws(2 * R, "constant", "tip_relieved", hub, pitch={"pitch": 0.127, "relief": 0.2, "start": 0.6})
    true = helix(2 * R, 0.127, "constant", hub)
    inner = relieved.r <= 0.6 * R
    np.testing.assert_allclose(relieved.beta[inner], true.beta[inner], rtol=1e-14)
    assert relieved.pitch_m(1.0) == pytest.approx(0.8 * 0.127)
    none = from_laws(2 * R, "constant", "tip_relieved", hub, pitch={"pitch": 0.127, "relief": 0.0})
    np.testing.assert_allclose(none.beta, true.beta, rtol=1e-14)


def test_apc_like_lies_among_measured_small_propellers(shared_data: Path) -> None:
    error = []
    for path in sorted((shared_data / "uiuc" / "volume-1").glob("apce_*_geom.txt")):
        x, c, _ = np.loadtxt(path, skiprows=1).T
        error.append(float(np.sqrt(np.mean((chord_over_R("apc_like", x) - c) ** 2))))
    assert len(error) >= 5
    assert np.median(error) < 0.01
    assert max(error) < 0.04


# designations --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("8x5", (8, 5, None, None)), ("10x4.7", (10, 4.7, None, None)), ("13.4x13.5", (13.4, 13.5, None, None)),
        ("8x5x3", (8, 5, 3, None)), (" 8 X 5 ", (8, 5, None, None)), ("11×7-3", (11, 7, 3, None)),
        ("5.25*4.75", (5.25, 4.75, None, None)), ("72x50", (72, 50, None, None)),
        ("10x5E", (10, 5, None, "electric")), ("10x4.5MR", (10, 4.5, None, "multirotor")),
        ("APC 10x4.5MR", (10, 4.5, None, "multirotor")), ("10x4.7SF", (10, 4.7, None, "slow_flyer")),
        ("GWS 10x4.7 Slow Flyer", (10, 4.7, None, "slow_flyer")), ("APC 7x5EP", (7, 5, None, "electric")),
        ("T-Motor 28x9.2", (28, 9.2, None, None)), ("T-Motor G28x9.2", (28, 9.2, None, None)),
        ("Aeronaut CAM folding 12x6.5", (12, 6.5, None, "folding")), ("6x4E-B4", (6, 4, 4, "electric")),
        ("5045", (5, 4.5, None, "fpv")), ("5045x3", (5, 4.5, 3, "fpv")), ("1045", (10, 4.5, None, None)),
        ("DJI 9450", (9.4, 5, None, None)),
        ("HQ5x4.3x3", (5, 4.3, 3, "fpv")), ("HQProp 5x4.3x3V1S", (5, 4.3, 3, "fpv")),
        ("Gemfan 51466", (5.1, 4.66, 3, "fpv")), ("Gemfan 5152S-3", (5.1, 5.2, 3, "fpv")),
        ("5x4.5x3", (5, 4.5, 3, "fpv")), ("13x65", (13, 6.5, None, None)), ("10x47", (10, 4.7, None, None)),
    ],
)  # fmt: skip
def test_designations(text: str, expected: tuple[float, float, int | None, str | None]) -> None:
    found = parse_designation(text)
    assert (found.diameter_in, found.pitch_in, found.blades, found.blade_class) == expected


def test_a_pusher_and_its_maker() -> None:
    found = parse_designation("APC 10x4.5MRP")
    assert found.reverse and found.maker == "APC" and not parse_designation("APC 10x4.5MR").reverse


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("8", "unreadable text"), ("10x4,7", "Decimal point"), ("-8x5", "unreadable text"), ("10 on 5", "unreadable"),
        ("10x5Q", "a suffix 'Q'"), ("5x50", "Meant 5x5?"), ("10x100", "Meant 10x10?"), ("8x5x40", "40 blades"),
        ("134x135", "Millimetres need division by 25.4"), ("254x127", "254 in"), ("0x5", "0 in"),
        ("12005", "digits that fit no propeller"),
    ],
)  # fmt: skip
def test_absurd_designations_are_refused(text: str, got: str) -> None:
    with pytest.raises(GeometryError) as error:
        parse_designation(text)
    assert str(error.value).startswith(repr(text)) and got in str(error.value)


# faults --------------------------------------------------------------------------------------------------------------


def test_all_faults_at_once() -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011
        from_stations(
            [0.02, 0.05, 0.04, 0.2], [0.01, 0.0, 0.01, 0.01], [30, 25, 20, 10], 0.1, 0.12,
            [(0.9, naca("0012")), (0.2, naca("0012"))], sweep=[0, 1], rake=[0, 0, math.nan, 0],
            axis=25,
        )  # fmt: skip
    assert str(error.value) == (
        "Rhub: got 0.12 m; expected a hub radius from 0 to below R = 0.1 m.\n"
        "r[2]: got 0.04 m after 0.05 m; expected strictly ascending radii.\n"
        "r: got 0.2 m; expected radii up to R = 0.1 m.\n"
        "chord[1]: got 0 m; expected a positive number.\n"
        "beta[0]: got 30 rad; expected radians from -pi/2 to pi/2. Given in degrees? Multiply by pi/180.\n"
        "sweep: got shape (2,); expected one value per station, (4,).\n"
        "rake[2]: got nan; expected a finite number.\n"
        "axis: got 25; expected a number from 0 to 1.\n"
        "anchors: got r/R = [0.9, 0.2]; expected ascending r/R from 0 to 1. Anchors sit at r/R, not at r."
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"r": [0.1, 0.05, 0.02]}, "Listed from the tip inwards? Reverse all columns."),
        ({"r": [0.2, 0.5, 1.0]}, "r: got 1 m; expected radii up to R = 0.1 m. Given as r/R? Multiply by R = 0.1 m."),
        ({"r": [-0.01, 0.05, 0.1]}, "r: got -0.01 m; expected radii of 0 or more."),
        ({"r": ["a", 0.05, 0.1]}, "r: got ['a', 0.05, 0.1]; expected numbers."),
        ({"r": [0.1]}, "r: got an array of shape (1,); expected two stations or more."),
        (
            {"chord": [10, 12, 8]},
            "chord[1]: got 12 m; expected up to five tip radii (0.5 m). Given in millimetres or inches?",
        ),
        ({"chord": [0.01, math.inf, 0.01]}, "chord[1]: got inf; expected a finite number."),
        ({"beta": [0.5, 0.4, -1.58]}, "beta[2]: got -1.58 rad; expected radians from -pi/2 to pi/2."),
        ({"R": math.nan}, "R: got nan m; expected a positive tip radius in metres."),
        ({"R": 101.6}, "R: got 101.6 m; expected a tip radius in metres, up to 100 m. Given in millimetres or inches?"),
        ({"Rhub": -0.01}, "Rhub: got -0.01 m; expected a hub radius from 0 to below R = 0.1 m."),
    ],
)
def test_single_faults(change: dict[str, object], message: str) -> None:
    good: dict[str, object] = {"r": [0.02, 0.05, 0.1], "chord": [0.01] * 3, "beta": [0.5, 0.4, 0.3], "R": 0.1}
    good["Rhub"] = 0.01
    from_stations(**good)  # type: ignore[arg-type]
    with pytest.raises(GeometryError) as error:
        from_stations(**{**good, **change})  # type: ignore[arg-type]
    assert message in str(error.value)


def test_faults_of_laws() -> None:
    with pytest.raises(GeometryError) as error:
        from_laws(203.2, "apc_lke", "tip_relieved", 1.2, pitch={"relief": 0.5})
    assert str(error.value) == (
        "diameter: got 203.2 m; expected a number from 0.001 to 200 m. Given in millimetres or inches?\n"
        "hub: got 1.2; expected a number from 0.01 to 0.95. The hub is given as Rhub/R.\n"
        "chord_law: got 'apc_lke'; expected one of apc_like, elliptic, constant, linear_taper, fan.\n"
        "pitch_law.pitch: got nothing; expected a number."
    )
    with pytest.raises(GeometryError, match="pitch: got 5 m; .*Both diameter and pitch are in metres"):
        helix(0.2032, 5)
    with pytest.raises(GeometryError, match="greatest chord over R, above 0, up to 5. Chord in millimetres"):
        helix(0.2032, 0.127, max_chord=20)
    with pytest.raises(GeometryError, match="spacing: got 'sine'; expected 'uniform' or 'cosine'"):
        helix(0.2032, 0.127).midpoints(10, "sine")


# rotor ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("B", [1, 2, 5, 14])
def test_solidities_of_a_constant_chord(B: int) -> None:
    R, c, hub = 1.143, 0.1905, 0.2
    blade = helix(2 * R, 0.75, "constant", hub, max_chord=c / R)
    rotor = Rotor(blade, B)
    assert rotor.solidity == pytest.approx(B * c * (1 - hub) / (math.pi * R), rel=1e-9)


def test_rotor_dimensions() -> None:
    rotor = Rotor(helix(0.2032, 0.127, hub=0.2), 2, -1, "r", spinner_length=0.02)
    assert (rotor.R, rotor.D) == pytest.approx((0.1016, 0.2032))
    assert rotor.Rhub == pytest.approx(0.02032)
    assert rotor.span == pytest.approx(0.8 * 0.1016)
    assert rotor.annulus_area == pytest.approx(math.pi * (0.1016**2 - 0.02032**2))
    chord, beta = rotor.blade.at(rotor.Rhub)
    assert rotor.hub_extent == pytest.approx(float(chord * np.sin(beta)))
    assert len({rotor.key(), rotor.with_pitch_offset(0.01).key(), Rotor(rotor.blade, 3).key()}) == 3
    assert rotor.key() == Rotor(rotor.blade, 2, -1, "another name", spinner_length=0.02).key()


def test_faults_of_a_rotor() -> None:
    with pytest.raises(GeometryError) as error:
        Rotor(helix(0.2032, 0.127), 2.5, 0, spinner_length=-0.01)  # type: ignore[arg-type]
    assert str(error.value) == (
        "B: got 2.5; expected a whole number of blades from 1 to 100.\n"
        "rotation: got 0; expected +1 or -1.\n"
        "spinner_length: got -0.01 m; expected a number from 0 to 1.016 m."
    )


# Sections are what their names and files say, keep their shape through every operation, and refuse bad input.


# Ordinates in percent of the chord, Abbott and von Doenhoff, Theory of Wing Sections, appendix III, as commonly
# reprinted (not checked against the book; two decimals, and the tables of the 1930s carry slips of about 0.02).
TABLE_4412 = """
 2.5 3.39 -1.95
 5.0 4.73 -2.49
10.0 6.59 -2.86
20.0 8.80 -2.74
30.0 9.76 -2.26
40.0 9.80 -1.80
50.0 9.19 -1.40
60.0 8.14 -1.00
70.0 6.69 -0.65
80.0 4.89 -0.39
90.0 2.71 -0.22
"""
TABLE_23012 = """
 2.5 3.61 -1.71
 5.0 4.91 -2.26
10.0 6.43 -2.92
15.0 7.19 -3.50
20.0 7.50 -3.97
25.0 7.60 -4.28
30.0 7.55 -4.46
40.0 7.14 -4.48
50.0 6.41 -4.17
60.0 5.47 -3.67
70.0 4.36 -3.00
80.0 3.08 -2.16
90.0 1.68 -1.23
"""
SHAPES = {
    "0012": naca("0012"), "4412": naca("4412"), "23012": naca("23012"), "23112": naca("23112"),
    "closed": naca4(0.03, 0.45, 0.09, te_gap=0.0), "plate": plate(0.06, 0.03), "negative": naca4(-0.04, 0.4, 0.12),
}  # fmt: skip
shapes = pytest.mark.parametrize("section", SHAPES.values(), ids=SHAPES.keys())
cambers = st.floats(-0.12, 0.12).map(lambda v: round(v, 4))
positions = st.floats(0.2, 0.7)
thicknesses = st.floats(0.02, 0.25)


def dat(section: Airfoil, title: str = "title") -> str:
    return title + "\n" + "\n".join(f"{x:.8f} {y:.8f}" for x, y in zip(section.x, section.y, strict=True))


def deviation(a: Airfoil, b: Airfoil) -> float:
    """Greatest difference of the sides, the first 0.1 % of the chord aside."""
    x = np.linspace(0.001, 0.999, 500)
    return float(max(np.abs(p - q).max() for p, q in zip(a.surfaces(x), b.surfaces(x), strict=True)))


@pytest.mark.parametrize(("digits", "table"), [("4412", TABLE_4412), ("23012", TABLE_23012)])
def test_published_ordinates(digits: str, table: str) -> None:
    x, upper, lower = np.array([line.split() for line in table.split("\n") if line], dtype=float).T / 100
    got = naca(digits).surfaces(x)
    np.testing.assert_allclose(got[0], upper, rtol=0, atol=3e-4)
    np.testing.assert_allclose(got[1], lower, rtol=0, atol=3e-4)


@pytest.mark.parametrize("n", [81, 161, 321])
def test_sides_interpolate_the_four_digit_formula(n: int) -> None:
    x = np.linspace(0.0005, 0.999, 2000)
    half = 0.6 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1015 * x**4)
    upper, lower = naca4(0.0, 0.4, 0.12, n).surfaces(x)
    np.testing.assert_allclose(upper, half, rtol=0, atol=1e-4 * 80 / n)
    np.testing.assert_array_equal(upper, -lower)


@settings(max_examples=40, deadline=None)
@given(cambers, positions, thicknesses)
def test_four_digit_parameters_are_measured_back(camber: float, position: float, thickness: float) -> None:
    section = naca4(camber, position, thickness)
    # Thickness is laid across the camber line and measured across the chord: longer by 1 / cos(slope) at most.
    steepest = 2 * camber / min(position, 1 - position)
    assert thickness * 0.998 <= section.thickness <= thickness * (1.003 + steepest**2)
    assert section.camber == pytest.approx(camber, abs=2e-4 + 0.04 * abs(camber))
    assert section.te_gap == pytest.approx(0.021 * thickness, rel=1e-6)


@settings(max_examples=20, deadline=None)
@given(cambers, positions, thicknesses)
def test_mirror(camber: float, position: float, thickness: float) -> None:
    a, b = naca4(camber, position, thickness), naca4(-camber, position, thickness)
    np.testing.assert_allclose(a.y, -b.y[::-1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(a.x, b.x[::-1], rtol=0, atol=1e-15)
    assert a.area == pytest.approx(b.area, rel=1e-12)


def test_area_equals_the_integral_of_the_thickness_law() -> None:
    t = 0.12
    exact = 10 * t * (0.2969 * 2 / 3 - 0.126 / 2 - 0.3516 / 3 + 0.2843 / 4 - 0.1015 / 5)
    errors = [abs(naca4(0, 0.4, t, n).area / exact - 1) for n in (41, 81, 161)]
    assert errors[-1] < 3e-4
    assert math.log2(errors[1] / errors[2]) > 1.9  # second order in the number of points


def test_trailing_edge_gap_is_set_without_moving_the_rest() -> None:
    assert naca4(0.04, 0.4, 0.12, te_gap=0.0).te_gap == pytest.approx(0.0, abs=1e-15)
    assert naca4(0.04, 0.4, 0.12, te_gap=0.01).te_gap == pytest.approx(0.01)
    assert naca4(0.04, 0.4, 0.12, te_gap=0.00252).key() == naca4(0.04, 0.4, 0.12).key()


def test_names() -> None:
    assert naca4(0.04, 0.4, 0.12).name == "naca4:0.040,0.40,0.120"
    assert naca(" NACA-2412 ").name == "naca2412"
    np.testing.assert_array_equal(naca("2412").y, naca4(0.02, 0.4, 0.12).y)


@pytest.mark.parametrize("code", "21001 22001 23001 24001 25001 43001 22101 23101 24101 25101".split())
def test_five_digit_lines_have_their_design_lift_and_the_reflexed_ones_no_moment(code: str) -> None:
    # Thin airfoil theory: design cl = pi A1, cm about the quarter chord = -pi (A1 - A2) / 4.
    theta = (np.arange(2000) + 0.5) * np.pi / 2000
    x, section = 0.5 * (1 - np.cos(theta)), naca(code, n=1601)
    low, high = np.maximum(x - 1e-4, 0), np.minimum(x + 1e-4, 1)
    slope = (np.mean(section.surfaces(high), axis=0) - np.mean(section.surfaces(low), axis=0)) / (high - low)
    a1, a2 = (2 * np.mean(slope * np.cos(k * theta)) for k in (1, 2))
    assert np.pi * a1 == pytest.approx(0.15 * int(code[0]), rel=0.025)
    moment = -np.pi / 4 * (a1 - a2)
    assert abs(moment) < 0.0015 if code[2] == "1" else moment < -0.003


@pytest.mark.parametrize("camber", [-0.08, -0.02, 0.0, 0.03, 0.05, 0.10])
@pytest.mark.parametrize("thickness", [0.01, 0.03, 0.08])
def test_plate_is_an_arc_of_constant_thickness(camber: float, thickness: float) -> None:
    section = plate(camber, thickness)
    assert section.camber == pytest.approx(camber, abs=1e-5)
    assert section.te_gap == pytest.approx(0.0, abs=1e-15)
    x = np.linspace(thickness, 1 - thickness, 101)
    upper, lower = section.surfaces(x)
    np.testing.assert_allclose(upper - lower, thickness, rtol=0, atol=2e-5)
    mean = 0.5 * (upper + lower)
    if camber:  # every mid point lies at one distance from one centre
        radius = (0.25 + camber**2) / (2 * camber)
        np.testing.assert_allclose(np.hypot(x - 0.5, mean - (camber - radius)), abs(radius), rtol=0, atol=5e-5)


@shapes
def test_repanelling_keeps_the_shape(section: Airfoil) -> None:
    new = section.repanel(241)
    assert new.x.size == 241
    assert deviation(section, new) < 5e-5
    assert new.te_gap == pytest.approx(section.te_gap, abs=1e-9)
    assert new.area == pytest.approx(section.area, rel=1e-3)
    assert int(np.argmin(new.x)) == 120


@shapes
def test_blend_is_linear_and_starts_and_ends_at_its_parents(section: Airfoil) -> None:
    other = naca("0018")
    assert blend(section, other, 0.0) is section
    assert blend(section, other, 1.0) is other
    w, x = 0.3, np.linspace(0.02, 0.98, 200)
    expected = [(1 - w) * a + w * b for a, b in zip(section.surfaces(x), other.surfaces(x), strict=True)]
    # the parents' sides do not start at exactly the same x, hence not to rounding
    np.testing.assert_allclose(blend(section, other, w).surfaces(x), expected, rtol=0, atol=3e-4)
    assert deviation(blend(section, other, w), blend(other, section, 1 - w)) < 1e-12


@shapes
def test_key_of_a_section_follows_the_shape_alone(section: Airfoil) -> None:
    assert Airfoil("another name", section.x, section.y).key() == section.key()
    assert pickle.loads(pickle.dumps(section)).key() == section.key()
    assert Airfoil(section.name, section.x, section.y + 1e-9).key() == section.key()
    assert Airfoil(section.name, section.x, section.y * 1.001).key() != section.key()
    with pytest.raises(ValueError, match="read-only"):
        section.x[0] = 2.0


def lednicer(section: Airfoil, counts: bool) -> str:
    i = int(np.argmin(section.x))
    sides = [(section.x[i::-1], section.y[i::-1]), (section.x[i:], section.y[i:])]
    blocks = ["\n".join(f" {x:.8f}  {y:.8f}" for x, y in zip(*side, strict=True)) for side in sides]
    head = f"\n {len(sides[0][0])}.  {len(sides[1][0])}.\n\n" if counts else "\n"
    return "title" + head + "\n\n".join(blocks) + "\n"


@shapes
@pytest.mark.parametrize(
    "write",
    [
        dat, lambda s: dat(s).replace("\n", "\r\n"), lambda s: "\ufeff" + dat(s).replace(" ", ",  "),
        lambda s: "\n".join(dat(s).splitlines()[1:]), lambda s: "23012\n" + "\n".join(dat(s).splitlines()[1:]),
        lambda s: "title\n" + "\n".join(reversed(dat(s).splitlines()[1:])), lambda s: lednicer(s, True),
        lambda s: lednicer(s, False),
    ],
    ids=["selig", "crlf", "bom, commas", "no title", "number title", "lower first", "lednicer", "lednicer, no counts"],
)  # fmt: skip
def test_files_come_back(section: Airfoil, write) -> None:  # type: ignore[no-untyped-def]
    back = parse_dat(write(section), "name")
    assert back.name == "name"
    assert deviation(section, back) < 1e-7


def test_loop_that_starts_at_the_nose_is_read() -> None:
    section = naca4(0.04, 0.4, 0.12, te_gap=0.0)
    i = int(np.argmin(section.x))
    rows = dat(section).splitlines()[1:]
    text = "\n".join(rows[i::-1] + rows[:i:-1] + [rows[i]])
    assert deviation(parse_dat(text), section) < 1e-4


def test_title_names_the_section() -> None:
    assert parse_dat(dat(naca("2412"), "Clark Y (smoothed)")).name == "Clark Y (smoothed)"
    assert parse_dat(dat(naca("2412"), "0.0 1.0").split("\n", 1)[1]).name == "section"


def edited(change: dict[int, str]) -> str:
    rows = dat(naca("2412", n=41)).splitlines()
    return "\n".join(change.get(i, row) for i, row in enumerate(rows, 1))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "section file: got 0 points; expected 7 points or more. Is it a coordinate file?"),
        (
            edited({5: "0.9 O.02", 9: "0.7 0.1 0.2", 11: "nan 0.1"}),
            "line 5: got '0.9 O.02'; expected two numbers, x and y.\n"
            "line 9: got '0.7 0.1 0.2'; expected two finite numbers, x and y.\n"
            "line 11: got 'nan 0.1'; expected two finite numbers, x and y.",
        ),
        (
            "\n".join(f"{100 * x:.4f} {100 * y:.4f}" for x, y in zip(naca("0012").x, naca("0012").y, strict=True)),
            "section file: got x from 0 to 100; expected x from 0 to 1 (unit chord). "
            "Coordinates in percent or millimetres? Divide by the chord.",
        ),
        (
            lednicer(naca("2412", n=41), True).rsplit("\n", 4)[0],
            "section file: got 39 points; expected 21 + 21 as its second line says. Truncated file?",
        ),
    ],
    ids=["empty", "three bad lines", "percent", "truncated"],
)
def test_faults_of_a_file(text: str, message: str) -> None:
    with pytest.raises(GeometryError) as error:
        parse_dat(text)
    assert str(error.value) == message


def test_crossing_sides_are_refused() -> None:
    section = naca("0012")
    y = np.where((section.x > 0.4) & (section.x < 0.6), -section.y, section.y)
    with pytest.raises(GeometryError, match="a lower side above the upper side at x = 0\\.[45]"):
        parse_dat("t\n" + "\n".join(f"{a} {b}" for a, b in zip(section.x, y, strict=True)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: naca4(4, 4, 12),
            "camber: got 4; expected a number from -0.25 to 0.25. Fractions of the chord: 4 % is 0.04.\n"
            "position: got 4; expected a number from 0.05 to 0.95. Tenths of the chord: 4 is 0.4.\n"
            "thickness: got 12; expected a number from 0.005 to 0.6. Fractions of the chord: 4 % is 0.04.",
        ),
        (lambda: naca4(0, 0.4, math.nan), "thickness: got nan; expected a number from 0.005 to 0.6."),
        (lambda: naca("clark y"), "naca: got 'clark y'; expected a NACA four- or five-digit designation such as 4412 "
         "or 23012."),
        (lambda: naca("4012"), "naca: got '4012'; expected a NACA four- or five-digit designation such as 4412 or "
         "23012. Camber needs a position: the second digit is 0."),
        (lambda: naca("26012"), "naca: got '26012'; expected a NACA four- or five-digit designation such as 4412 or "
         "23012. Known camber lines: 10 to 50 plain, 21 to 51 reflexed."),
        (lambda: naca("0000"), "naca: got '0000'; expected a thickness above 00. For a thin plate use plate()."),
        (lambda: naca4(0, 0.4, 0.12, n=80), "n: got 80; expected an odd number of points, 21 or more."),
        (lambda: blend(naca("0012"), naca("0015"), 1.2), "w: got 1.2; expected a number from 0 to 1."),
        (lambda: Airfoil("a", np.array([1.0, 0, 1]), np.zeros(2)), "airfoil 'a': got arrays x (3,) and y (2,); "
         "expected two equal 1-D arrays of 7 points or more."),
        (lambda: Airfoil("a", naca("0012").x[::-1], naca("0012").y[::-1]), "airfoil 'a': got points that run lower "
         "side first; expected trailing edge, upper side, leading edge, lower side. Reverse the list."),
        (lambda: Airfoil("a", naca("0012").x * 25.4, naca("0012").y), "airfoil 'a': got x from 0 to 25.4; expected x "
         "from 0 to 1 (unit chord). Coordinates in percent or millimetres? Divide by the chord."),
    ],
)  # fmt: skip
def test_faults_of_parameters(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(GeometryError) as error:
        make()
    assert str(error.value) == message
    assert pickle.loads(pickle.dumps(error.value)).faults == error.value.faults


@settings(max_examples=60, deadline=None)
# ordinates in steps of 1e-9: where a slope underflows, scipy's own weights lose their meaning
@given(
    st.lists(
        st.tuples(st.floats(0.01, 3), st.integers(-5 * 10**9, 5 * 10**9).map(lambda i: i * 1e-9)),
        min_size=2,
        max_size=12,
    )
)
def test_interpolation_is_that_of_scipy_and_clamped(steps: list[tuple[float, float]]) -> None:
    x = np.cumsum([dx for dx, _ in steps])
    y = np.array([v for _, v in steps])
    q = np.linspace(x[0], x[-1], 101)
    np.testing.assert_allclose(pchip(x, y, q), PchipInterpolator(x, y)(q), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(pchip(x, y, [x[0] - 1, x[-1] + 1]), y[[0, -1]], rtol=1e-12, atol=1e-12)
    both = np.stack([y, -2 * y], axis=1)
    np.testing.assert_allclose(pchip(x, both, q)[:, 1], -2 * pchip(x, y, q), rtol=1e-9, atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.floats(-0.25, 0.25), st.floats(0.05, 0.95), st.floats(0.005, 0.6), st.floats(0.002, 0.3), st.floats(0, 1))
def test_every_declared_parameter_makes_a_section(m: float, p: float, t: float, plate_t: float, w: float) -> None:
    mixed = blend(naca4(m, p, t), plate(m, plate_t), w).repanel(101)
    assert mixed.area > 0
    assert np.isfinite([mixed.thickness, mixed.camber, mixed.te_gap]).all()


# Published sections: the numbers their authors state, and the same shapes from another collection.


def test_sda1075_has_the_blunt_edge_of_the_printed_blades() -> None:
    section = published("sda1075")
    assert section.thickness == pytest.approx(0.12, abs=2e-4)  # 12 % thick with the edge that printing asked for
    assert section.te_gap == pytest.approx(0.011, abs=5e-4)


def test_clark_y_is_that_of_the_uiuc_collection() -> None:
    import aerosandbox

    other = aerosandbox.Airfoil("clarky")
    x = np.linspace(0.02, 0.98, 49)
    upper, lower = published("clark_y").surfaces(x)
    for ours, theirs in ((upper, other.upper_coordinates()[::-1]), (lower, other.lower_coordinates())):
        assert np.max(np.abs(ours - np.interp(x, *theirs.T))) < 0.003  # theirs was smoothed


def test_clark_y_lies_on_its_chord_not_on_its_flat_bottom() -> None:
    section = published("clark_y")
    nose = section.y[np.argmin(section.x)]
    assert abs(nose) < 1e-3 and 0.5 * (section.y[0] + section.y[-1]) == pytest.approx(0.0, abs=1e-12)
    x = np.array([0.4, 0.9])
    flat = section.surfaces(x)[1]
    assert np.degrees(np.arctan(np.diff(flat)[0] / np.diff(x)[0])) == pytest.approx(1.97, abs=0.05)


@pytest.mark.parametrize("name", PUBLISHED)
def test_scaling_keeps_the_shape(name: str) -> None:
    section = published(name)
    assert thickened(section, section.thickness).y == pytest.approx(section.y, rel=1e-12, abs=1e-15)
    thin = thickened(section, 0.05)
    assert thin.thickness == pytest.approx(0.05, rel=1e-9)
    assert thin.camber / section.camber == pytest.approx(0.05 / section.thickness, rel=1e-6)


def test_faults_are_said() -> None:
    with pytest.raises(GeometryError, match="'clarkx'; expected sda1075 or clark_y"):
        published("clarkx")
    with pytest.raises(GeometryError, match="4 % is 0.04"):
        thickened(naca("0012"), 12.0)


def test_a_thickness_file_replaces_the_law_of_its_family_and_of_no_other() -> None:
    law = ([0.3, 0.6, 0.95], [0.3671, 0.10, 0.08])
    told = section_rule.sections("nr640", law)
    assert [s.thickness for s in told][:2] == [0.25, 0.25]  # thicker is hub
    assert told[-1].thickness == pytest.approx(0.08)
    assert section_rule.airfoil(told[-1]).thickness == pytest.approx(0.08, rel=1e-9)
    assert section_rule.airfoil(told[-1]).camber == pytest.approx(told[-1].camber, rel=0.01)
    for family in ("da4002", "apcsf", None):
        assert section_rule.sections(family, law) == section_rule.sections(family)
    assert section_rule.section_at(0.75, "nr640").r_R == pytest.approx(0.75, abs=0.08)


# Ducts: areas and ratios in closed form, walls that fit the rotor and never cross, faults all at once.


ROTOR = Rotor(helix(0.069, 0.1, "fan", hub=25.4 / 69), 8)
DUCT = around(ROTOR, 0.060, 0.0004, 0.003, exit_area_ratio=0.85, exit_hub_radius=0.010, stator=Stator(5, 0.02, 0.035))


def test_areas_of_the_ds30() -> None:
    assert ROTOR.annulus_area == pytest.approx(3.233e-3, rel=2e-4)
    assert DUCT.exit_area == pytest.approx(0.85 * math.pi / 4 * (0.069**2 - 0.0254**2))
    assert DUCT.exit_area == pytest.approx(math.pi * (DUCT.exit_radius**2 - 0.010**2))  # type: ignore[operator]


@pytest.mark.parametrize("gap", [0.0, 0.0004, 0.002])
def test_a_straight_duct_passes_what_it_takes_in(gap: float) -> None:
    duct = around(ROTOR, 0.06, gap, exit_hub_radius=ROTOR.Rhub)
    assert duct.exit_area == pytest.approx(math.pi * (duct.inner_radius**2 - ROTOR.Rhub**2), rel=1e-14)
    assert (duct.exit_area / ROTOR.annulus_area == pytest.approx(1.0, rel=1e-14)) == (
        gap == 0.0
    )  # the gap belongs to the passage
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


def test_a_diffuser_is_straight() -> None:
    duct = Duct(0.1, 0.3, 0.01, 0.001, exit_radius=0.12, rotor_x=0.1, diffuser_x=0.1)
    assert float(duct.inner(0.2)) == pytest.approx(0.11)


def test_fit_to_the_rotor() -> None:
    DUCT.check(ROTOR)
    replace(DUCT, inner_radius=0.03491).check(ROTOR)  # drawings round
    with pytest.raises(GeometryError) as error:
        replace(DUCT, inner_radius=0.0335).check(ROTOR)
    assert str(error.value) == (
        "duct.inner_radius: got 0.0335 m; expected tip radius plus gap, 0.0345 + 0.0004 = 0.0349 m. "
        "The blades cut the wall."
    )


def test_all_faults_of_a_duct_at_once() -> None:
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

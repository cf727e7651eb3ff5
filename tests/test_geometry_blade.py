"""Blades and rotors: stations in, exact elements out; laws and designations mean what they say; faults all at once."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.airfoil import naca
from geometry.blade import Blade, from_stations
from geometry.common import GeometryError
from geometry.designation import parse_designation
from geometry.laws import CHORD_LAWS, PITCH_LAWS, chord_over_R, from_laws, helix
from geometry.rotor import Rotor

INCH = 0.0254
PITCH = {
    "helix": {"pitch": 0.127},
    "linear_twist": {"beta_root": 0.6, "beta_tip": 0.2},
    "constant_beta": {"beta": 0.14},
    "tip_relieved": {"pitch": 0.127},
}
chord_laws = pytest.mark.parametrize("law", CHORD_LAWS)
pitch_laws = pytest.mark.parametrize("law", PITCH_LAWS)


def stations() -> Blade:
    r = np.linspace(0.02, 0.1, 9)
    return from_stations(
        r, 0.02 - 0.1 * (r - 0.05) ** 2, np.arctan(0.1 / (2 * np.pi * r)), 0.1, 0.015,
        [(0.2, naca("0018")), (0.6, naca("4412")), (1.0, naca("2408"))], sweep=0.1 * (r - 0.02), rake=0.05 * (r - 0.02),
        name="test",
    )  # fmt: skip


def test_every_pitch_law_is_covered_here() -> None:
    assert set(PITCH) == set(PITCH_LAWS)


# elements ------------------------------------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(
    st.floats(0.01, 50), st.floats(0.01, 0.9), st.integers(1, 300), st.sampled_from(["uniform", "cosine"]), st.randoms()
)
def test_widths_add_up_exactly_in_any_order(D: float, hub: float, n: int, spacing: str, random: Random) -> None:
    blade = from_laws(D, "constant", "constant_beta", hub, pitch={"beta": 0.2}, n=5)
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


@pytest.mark.parametrize("interpolation", ["pchip", "linear"])
def test_values_are_met_at_stations_kept_between_them_and_held_outside(interpolation: str) -> None:
    b = stations()
    blade = from_stations(b.r, b.chord, b.beta, b.R, b.Rhub, interpolation=interpolation)
    np.testing.assert_allclose(blade.at(b.r)[0], b.chord, rtol=1e-14)
    np.testing.assert_allclose(blade.at(b.r)[1], b.beta, rtol=1e-14)
    inside = np.linspace(b.r[0], b.r[-1], 400)
    beta = blade.at(inside)[1]
    assert (np.diff(beta) < 0).all()  # monotone data stay monotone: no overshoot
    for r, k in ((0.0, 0), (b.Rhub, 0), (0.2, -1)):
        assert [float(v) for v in blade.at(r)] == pytest.approx([b.chord[k], b.beta[k]], rel=1e-14)
    middle = 0.5 * (b.r[3] + b.r[4])
    straight = 0.5 * (b.beta[3] + b.beta[4])
    assert (float(blade.at(middle)[1]) == pytest.approx(straight, rel=1e-14)) == (interpolation == "linear")


# shape ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("D", "P"), [(8, 5), (10, 5), (12, 6), (14, 8)])
def test_helix_has_one_pitch(D: float, P: float) -> None:
    blade = helix(D * INCH, P * INCH)
    np.testing.assert_allclose(2 * np.pi * blade.r * np.tan(blade.beta), P * INCH, rtol=1e-12)
    for x in (0.3, 0.5, 0.75, 0.95):  # between stations too
        assert blade.pitch_m(x) == pytest.approx(P * INCH, rel=2e-5)
    assert blade.R == pytest.approx(0.5 * D * INCH)
    assert helix(D * INCH, P * INCH, dbeta=0.03).beta == pytest.approx(blade.beta + 0.03)


def test_scaling_is_a_similarity() -> None:
    a, k = stations(), 3.7
    b = a.scaled(k)
    for x, y, power in zip(a.midpoints(15), b.midpoints(15), (1, 1, 1, 0), strict=True):
        np.testing.assert_allclose(y, x * k**power, rtol=1e-10)
    np.testing.assert_allclose(b.section_curve(k * 0.05), k * a.section_curve(0.05), rtol=1e-9, atol=1e-15)
    assert b.pitch_m() == pytest.approx(k * a.pitch_m())
    assert Rotor(b, 3).solidity == pytest.approx(Rotor(a, 3).solidity, rel=1e-10)


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
    others = [blade.with_pitch_offset(1e-6), blade.scaled(1.001)]
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
    assert c.max() <= declared.default * (1 + 1e-4)
    np.testing.assert_allclose(chord_over_R(law, x, max_chord=2 * declared.default), 2 * c, rtol=1e-14)
    for parameter in CHORD_LAWS[law].parameters.values():
        assert parameter.low <= parameter.default <= parameter.high
    assert CHORD_LAWS[law].text
    assert CHORD_LAWS[law].source
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
    blade = from_laws(0.2032, "apc_like", law, pitch=PITCH[law])
    assert (blade.beta >= 0).all()
    assert (np.diff(blade.beta) <= 1e-15).all()
    assert PITCH_LAWS[law].text
    assert PITCH_LAWS[law].source


def test_pitch_laws_in_closed_form() -> None:
    hub, R = 0.2, 0.1016
    twist = from_laws(2 * R, "constant", "linear_twist", hub, pitch=PITCH["linear_twist"])
    np.testing.assert_allclose(twist.beta, 0.6 - 0.4 * (twist.r / R - hub) / (1 - hub), rtol=1e-12)
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
        ("8x5", (8, 5, None)), ("10x4.7", (10, 4.7, None)), ("13.4x13.5", (13.4, 13.5, None)), ("8x5x3", (8, 5, 3)),
        (" 8 X 5 ", (8, 5, None)), ("11×7-3", (11, 7, 3)), ("5.25*4.75", (5.25, 4.75, None)), ("72x50", (72, 50, None)),
    ],
)  # fmt: skip
def test_designations(text: str, expected: tuple[float, float, int | None]) -> None:
    assert parse_designation(text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("8", "got unreadable text; expected diameter x pitch in inches, such as 8x5, 10x4.7 or 8x5x3."),
        ("10x4,7", "got unreadable text; expected diameter x pitch in inches, such as 8x5, 10x4.7 or 8x5x3. "
         "Decimal point, not comma."),
        ("-8x5", "got unreadable text; expected diameter x pitch in inches, such as 8x5, 10x4.7 or 8x5x3."),
        ("10x5E", "got a suffix 'E'; expected diameter x pitch in inches, such as 8x5, 10x4.7 or 8x5x3. "
         "Leave the letters out."),
        ("10x47", "got pitch/diameter 4.7; expected a ratio from 0.1 to 2.5. Meant 10x4.7?"),
        ("5x50", "got pitch/diameter 10; expected a ratio from 0.1 to 2.5. Meant 5x5?"),
        ("134x135", "got 134 in; expected a number from 0.5 to 120 in. Meant 13.4? Millimetres need division by 25.4."),
        ("8x5x40", "got 40 blades; expected a number from 1 to 16 blades."),
        ("0x5", "got 0 in; expected a number from 0.5 to 120 in.\n"
         "'0x5': got pitch/diameter inf; expected a ratio from 0.1 to 2.5. Diameter comes first."),
    ],
)  # fmt: skip
def test_absurd_designations_are_refused(text: str, message: str) -> None:
    with pytest.raises(GeometryError) as error:
        parse_designation(text)
    assert str(error.value) == f"{text!r}: {message}"


# faults --------------------------------------------------------------------------------------------------------------


def test_all_faults_at_once() -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011
        from_stations(
            [0.02, 0.05, 0.04, 0.2], [0.01, 0.0, 0.01, 0.01], [30, 25, 20, 10], 0.1, 0.12,
            [(0.9, naca("0012")), (0.2, naca("0012"))], sweep=[0, 1], rake=[0, 0, math.nan, 0],
            interpolation="spline", axis=25,
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
        "interpolation: got 'spline'; expected 'pchip' or 'linear'.\n"
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
        from_laws(203.2, "apc_lke", "tip_relieved", 1.2, pitch={"relief": 1.5, "taper": 1.0})
    assert str(error.value) == (
        "diameter: got 203.2 m; expected a number from 0.001 to 200 m. Given in millimetres or inches?\n"
        "hub: got 1.2; expected a number from 0.01 to 0.95. The hub is given as Rhub/R.\n"
        "chord_law: got 'apc_lke'; expected one of apc_like, elliptic, constant, linear_taper, fan.\n"
        "pitch_law.taper: got taper; expected a parameter of 'tip_relieved': pitch, relief, start.\n"
        "pitch_law.pitch: got nothing; expected a number in m.\n"
        "pitch_law.relief: got 1.5; expected a number from 0 to below 1."
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
    blade = from_laws(2 * R, "constant", "constant_beta", hub, chord={"max_chord": c / R}, pitch={"beta": 0.14})
    rotor = Rotor(blade, B)
    assert rotor.solidity == pytest.approx(B * c * (1 - hub) / (math.pi * R), rel=1e-9)
    np.testing.assert_allclose(rotor.sigma([0.5, 1.0]), [B * c / math.pi, B * c / (2 * math.pi)], rtol=1e-12)
    # the mean of sigma over the annulus is blade area over annulus area
    st_ = rotor.blade.midpoints(500)
    mean = np.sum(rotor.sigma(st_.r) * 2 * np.pi * st_.r * st_.dr) / rotor.annulus_area
    assert mean == pytest.approx(B * c / (math.pi * R * (1 + hub)), rel=1e-9)


def test_rotor_dimensions() -> None:
    rotor = Rotor(helix(0.2032, 0.127, hub=0.2), 2, -1, "r", spinner_length=0.02)
    assert (rotor.R, rotor.D) == pytest.approx((0.1016, 0.2032))
    assert rotor.Rhub == pytest.approx(0.02032)
    assert rotor.span == pytest.approx(0.8 * 0.1016)
    assert rotor.disk_area - rotor.annulus_area == pytest.approx(math.pi * 0.02032**2)
    chord, beta = rotor.blade.at(rotor.Rhub)
    assert rotor.hub_extent == pytest.approx(float(chord * np.sin(beta)))
    big = rotor.scaled(2.0)
    assert (big.D, big.spinner_length, big.hub_extent) == pytest.approx((0.4064, 0.04, 2 * rotor.hub_extent))
    assert len({rotor.key(), big.key(), rotor.with_pitch_offset(0.01).key(), Rotor(rotor.blade, 3).key()}) == 4
    assert rotor.key() == Rotor(rotor.blade, 2, -1, "another name", spinner_length=0.02).key()


def test_faults_of_a_rotor() -> None:
    with pytest.raises(GeometryError) as error:
        Rotor(helix(0.2032, 0.127), 2.5, 0, spinner_length=-0.01)  # type: ignore[arg-type]
    assert str(error.value) == (
        "B: got 2.5; expected a whole number of blades from 1 to 100.\n"
        "rotation: got 0; expected +1 or -1.\n"
        "spinner_length: got -0.01 m; expected a number from 0 to 1.016 m."
    )

"""Sections are what their names and files say, keep their shape through every operation, and refuse bad input."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator  # type: ignore[import-untyped]

from geometry.airfoil import Airfoil, blend, naca, naca4, plate
from geometry.airfoil_file import parse_dat
from geometry.common import GeometryError, pchip

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
    "0012": naca("0012"),
    "4412": naca("4412"),
    "23012": naca("23012"),
    "23112": naca("23112"),
    "closed": naca4(0.03, 0.45, 0.09, te_gap=0.0),
    "plate": plate(0.06, 0.03),
    "negative": naca4(-0.04, 0.4, 0.12),
}
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
def test_key_follows_the_shape_alone(section: Airfoil) -> None:
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
        dat,
        lambda s: dat(s).replace("\n", "\r\n"),
        lambda s: "\ufeff" + dat(s).replace(" ", ",  "),
        lambda s: "\n".join(dat(s).splitlines()[1:]),
        lambda s: "23012\n" + "\n".join(dat(s).splitlines()[1:]),
        lambda s: "title\n" + "\n".join(reversed(dat(s).splitlines()[1:])),
        lambda s: lednicer(s, True),
        lambda s: lednicer(s, False),
    ],
    ids=["selig", "crlf", "bom, commas", "no title", "number title", "lower first", "lednicer", "lednicer, no counts"],
)
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

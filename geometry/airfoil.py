"""Sections: their coordinates, NACA families, thin plates, blending and repanelling.

Every section is an :class:`Airfoil`: a closed loop in Selig order (trailing edge, upper side, leading edge, lower
side, trailing edge) with unit chord along +x and the suction side of a lifting section at +y.
Files hold them in Selig or Lednicer form.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from geometry.common import Array, Faults, GeometryError, frozen, pchip, pchip_slopes


def _spaced(n: int) -> Array:
    """Chord fractions 0..1 with half-cosine spacing, n points."""
    out: Array = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, n)))
    return out


@dataclass(frozen=True, eq=False)
class Airfoil:
    """A section with unit chord; arrays are read-only.

    Raises GeometryError: if the loop is not finite, not in Selig order, not of unit chord, or crosses itself.

    >>> section = naca4(0.04, 0.40, 0.12)
    >>> section.name, round(section.thickness, 3), round(section.camber, 4), round(section.te_gap, 4)
    ('naca4:0.040,0.40,0.120', 0.12, 0.04, 0.0025)
    """

    name: str  # For people; the identity of the shape is :meth:`key`
    # (N,) coordinates in Selig order over the chord [-]
    x: Array
    y: Array
    # Camber, its position and thickness of a NACA four-digit section with its own trailing edge; None for any other [-]
    four_digit: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", frozen(self.x))
        object.__setattr__(self, "y", frozen(self.y))
        faults, where = Faults(), f"airfoil '{self.name}'"
        if self.x.ndim != 1 or self.x.shape != self.y.shape or self.x.size < 7:
            got = f"arrays x {self.x.shape} and y {self.y.shape}"
            faults.add(where, got, "two equal 1-D arrays of 7 points or more")
        elif not (np.isfinite(self.x).all() and np.isfinite(self.y).all()):
            faults.add(where, "NaN or infinite coordinates", "finite numbers")
        else:
            chord = float(np.ptp(self.x))
            # Blunt noses of thick cambered sections reach ahead of x = 0, where the camber line starts.
            if not 0.9 < chord < 1.2 or abs(float(self.x.min())) > 0.15:
                hint = "Coordinates in percent or millimetres? Divide by the chord" if chord > 1.5 else ""
                span = f"x from {self.x.min():g} to {self.x.max():g}"
                faults.add(where, span, "x from 0 to 1 (unit chord)", hint)
            elif self.area <= 0:
                order = "trailing edge, upper side, leading edge, lower side"
                faults.add(where, "points that run lower side first", order, "Reverse the list")
            elif not 2 <= int(np.argmin(self.x)) <= self.x.size - 3:
                faults.add(where, "a leading edge at the end of the list", "Selig order (trailing edge first and last)")
            else:
                s = _spaced(41)[1:-1]
                upper, lower = self.surfaces(s)
                if (upper < lower - 1e-6).any():
                    at = s[int(np.argmin(upper - lower))]
                    faults.add(where, f"a lower side above the upper side at x = {at:.3f}", "sides that do not cross")
        faults.check()

    @cached_property
    def _sides(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """(x, y) of the upper and the lower side, leading edge first, x strictly ascending."""
        i = int(np.argmin(self.x))
        out = []
        for x, y in ((self.x[i::-1], self.y[i::-1]), (self.x[i:], self.y[i:])):
            keep = np.concatenate([[True], x[1:] > np.maximum.accumulate(x)[:-1] + 1e-9])
            out.append((x[keep], y[keep]))
        return out[0], out[1]

    @cached_property
    def _angles(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """(angle, slopes of y over it) of the points of both sides."""
        out = []
        for x, y in self._sides:
            theta = np.arccos(np.clip(1.0 - 2.0 * (x - x[0]) / (x[-1] - x[0]), -1.0, 1.0))
            out.append((theta, pchip_slopes(theta, y.reshape(len(y), 1))))
        return out[0], out[1]

    def _side(self, which: int, s: ArrayLike) -> tuple[Array, Array]:
        """Points of one side at fractions s of its own x extent; PCHIP in the angle, which is smooth at the nose."""
        (x, y), (theta, slopes) = self._sides[which], self._angles[which]
        s = np.clip(np.asarray(s, dtype=np.float64), 0.0, 1.0)
        return x[0] + (x[-1] - x[0]) * s, pchip(theta, y, np.arccos(1.0 - 2.0 * s), slopes)

    def surfaces(self, x: ArrayLike) -> tuple[Array, Array]:
        """Interpolate both sides. [-]"""
        x = np.asarray(x, dtype=np.float64)
        out = []
        for which in (0, 1):
            xs = self._sides[which][0]
            out.append(self._side(which, (x - xs[0]) / (xs[-1] - xs[0]))[1])
        return out[0], out[1]

    @cached_property
    def _lines(self) -> tuple[Array, Array, Array]:
        x = _spaced(401)
        upper, lower = self.surfaces(x)
        return x, upper - lower, 0.5 * (upper + lower)

    @property
    def thickness(self) -> float:
        """Greatest thickness over chord, measured across the chord [-]."""
        return float(self._lines[1].max())

    @property
    def camber(self) -> float:
        """Greatest distance of the mid line from the line (0, 0) to the trailing edge, with its sign [-]."""
        x, _, mean = self._lines
        line = mean - 0.5 * (self.y[0] + self.y[-1]) * x
        return float(line[int(np.argmax(np.abs(line)))])

    @property
    def te_gap(self) -> float:
        """Trailing edge thickness over chord [-]."""
        return float(np.hypot(self.x[0] - self.x[-1], self.y[0] - self.y[-1]))

    @property
    def area(self) -> float:
        """Area over chord squared (positive in Selig order) [-]."""
        return float(0.5 * np.sum(self.x * np.roll(self.y, -1) - np.roll(self.x, -1) * self.y))

    def key(self) -> str:
        """Return the SHA-256 (hex) of the coordinates rounded to 1e-6: equal shapes, equal keys."""
        points = np.rint(np.stack([self.x, self.y]) * 1e6).astype("<i8")
        return hashlib.sha256(points.tobytes()).hexdigest()

    def repanel(self, n: int = 161) -> Airfoil:
        """Resample both sides with cosine spacing."""
        found = self._resampled.get(n)
        if found is None:  # a blade asks for the same points at each of its rings
            s = _spaced(_half(n))
            (xu, yu), (xl, yl) = self._side(0, s), self._side(1, s)
            found = self._resampled[n] = Airfoil(self.name, _join(xu, xl), _join(yu, yl))
        return found

    @cached_property
    def _resampled(self) -> dict[int, Airfoil]:
        """Results of :meth:`repanel` by number of points."""
        return {}

    def __repr__(self) -> str:
        return f"Airfoil({self.name!r}, {self.x.size} points, t/c {self.thickness:.4f}, camber {self.camber:+.4f})"


def _half(n: int) -> int:
    """Points per side for n points in all."""
    if n < 21 or n % 2 == 0:
        raise GeometryError([("n", str(n), "an odd number of points, 21 or more", "")])
    return n // 2 + 1


def _join(upper: Array, lower: Array) -> Array:
    """Make a Selig loop of two sides that start at one leading edge."""
    return np.concatenate([upper[::-1], lower[1:]])


def _from_lines(
    name: str, x: Array, mean: Array, slope: Array, half: Array, four_digit: tuple[float, float, float] | None = None
) -> Airfoil:
    """Lay half thicknesses across the camber line (Abbott and von Doenhoff, eq. 6.1)."""
    theta = np.arctan(slope)
    xu, xl = x - half * np.sin(theta), x + half * np.sin(theta)
    yu, yl = mean + half * np.cos(theta), mean - half * np.cos(theta)
    return Airfoil(name, _join(xu, xl), _join(yu, yl), four_digit)


def _naca_half(x: Array, thickness: float, te_gap: float | None) -> Array:
    """NACA four-digit half thickness; a wedge sets the trailing edge gap when one is asked for."""
    half = 5 * thickness * (0.2969 * np.sqrt(x) + x * (-0.1260 + x * (-0.3516 + x * (0.2843 - 0.1015 * x))))
    return half if te_gap is None else half + x * (0.5 * te_gap - half[-1])


def naca4(camber: float, position: float, thickness: float, n: int = 161, te_gap: float | None = None) -> Airfoil:
    """Make a NACA four-digit section from real numbers.

    I. H. Abbott and A. E. von Doenhoff, Theory of Wing Sections, Dover 1959, section 6.4 (not checked against the
    book).

    >>> round(naca4(0.0, 0.4, 0.12, te_gap=0.0).area, 4)
    0.0809
    """
    faults = Faults()
    hint = "Fractions of the chord: 4 % is 0.04"
    faults.number("camber", camber, -0.25, 0.25, hint=hint if abs(camber) >= 1 else "")
    if camber != 0.0:
        faults.number("position", position, 0.05, 0.95, hint="Tenths of the chord: 4 is 0.4" if position >= 1 else "")
    faults.number("thickness", thickness, 0.005, 0.6, hint=hint if thickness >= 1 else "")
    if te_gap is not None:
        faults.number("te_gap", te_gap, 0.0, 0.1)
    faults.check()
    x = _spaced(_half(n))
    p = position
    if camber == 0.0:
        mean, slope = np.zeros_like(x), np.zeros_like(x)
    else:
        scale = np.where(x < p, camber / p**2, camber / (1 - p) ** 2)
        mean = np.where(x < p, scale * x * (2 * p - x), scale * (1 - 2 * p + x * (2 * p - x)))
        slope = 2 * scale * (p - x)
    name = f"naca4:{camber:.3f},{position:.2f},{thickness:.3f}"
    own = (float(camber), float(position), float(thickness)) if te_gap is None else None
    return _from_lines(name, x, mean, slope, _naca_half(x, thickness, te_gap), own)


# Camber lines of the five-digit family at design cl 0.3: second digit -> (r, k1) plain, (r, k1, k2/k1) reflexed.
_FIVE = {1: (0.0580, 361.4), 2: (0.1260, 51.64), 3: (0.2025, 15.957), 4: (0.2900, 6.643), 5: (0.3910, 3.230)}
_REFLEX = {2: (0.1300, 51.99, 0.000764), 3: (0.2170, 15.793, 0.00677), 4: (0.3180, 6.520, 0.0303), 5: (0.4410, 3.191, 0.1355)}  # fmt: skip  # noqa: E501


def naca(digits: str, n: int = 161) -> Airfoil:
    """Make a NACA four- or five-digit section from its designation.

    E. N. Jacobs and R. M. Pinkerton, NACA Report 537 (1935), plain lines; C. L. Ladson et al., NASA TM-4741 (1996),
    reflexed lines (constants as commonly reprinted; not checked against the reports).

    >>> naca("NACA 4412").name, round(naca("23012").camber, 3)
    ('naca4412', 0.018)
    """
    match = re.fullmatch(r"\s*(?:naca)?[\s_-]*(\d{4,5})\s*", digits, re.IGNORECASE)
    expected = "a NACA four- or five-digit designation such as 4412 or 23012"
    if match is None:
        raise GeometryError([("naca", repr(digits), expected, "")])
    code = match[1]
    t = int(code[-2:]) / 100
    if t == 0:
        raise GeometryError([("naca", repr(digits), "a thickness above 00", "For a thin plate use plate()")])
    if len(code) == 4:
        m, p = int(code[0]) / 100, int(code[1]) / 10
        if m > 0 and p == 0:
            raise GeometryError([("naca", repr(digits), expected, "Camber needs a position: the second digit is 0")])
        shape = naca4(m, p or 0.4, t, n)
        return replace(shape, name=f"naca{code}")
    line, kind, cl = int(code[1]), int(code[2]), 0.15 * int(code[0])
    if cl == 0 or kind > 1 or line not in (_FIVE, _REFLEX)[kind]:
        raise GeometryError([("naca", repr(digits), expected, "Known camber lines: 10 to 50 plain, 21 to 51 reflexed")])
    x = _spaced(_half(n))
    if kind == 0:
        r, k1 = _FIVE[line]
        mean = np.where(x < r, x**3 - 3 * r * x**2 + r**2 * (3 - r) * x, r**3 * (1 - x))
        slope = np.where(x < r, 3 * x**2 - 6 * r * x + r**2 * (3 - r), -(r**3))
    else:
        r, k1, k21 = _REFLEX[line]
        k = np.where(x < r, 1.0, k21)
        mean = k * (x - r) ** 3 - k21 * (1 - r) ** 3 * x - r**3 * x + r**3
        slope = 3 * k * (x - r) ** 2 - k21 * (1 - r) ** 3 - r**3
    scale = k1 / 6 * cl / 0.3
    return _from_lines(f"naca{code}", x, scale * mean, scale * slope, _naca_half(x, t, None))


def plate(camber: float, thickness: float, n: int = 161) -> Airfoil:
    """Make a flat or circular-arc plate of constant thickness with rounded edges.

    >>> section = plate(0.05, 0.02)
    >>> round(section.camber, 3), round(section.thickness, 3), section.te_gap
    (0.05, 0.02, 0.0)
    """
    faults = Faults()
    hint = "Fractions of the chord: 4 % is 0.04"
    faults.number("camber", camber, -0.25, 0.25, hint=hint if abs(camber) >= 1 else "")
    faults.number("thickness", thickness, 0.002, 0.3, hint=hint if thickness >= 1 else "")
    faults.check()
    edge = 0.5 * thickness
    # A quarter of the points go round each edge: the cosine spacing alone would leave thin plates with a sharp corner.
    m = _half(n)
    k = m // 4
    nose = edge * (1 - np.cos(np.linspace(0, np.pi / 2, k + 1)))
    s = np.concatenate([nose[:-1], edge + (1 - 2 * edge) * _spaced(m - 2 * k), 1 - nose[-2::-1]])
    out = np.minimum(np.minimum(s, 1 - s), edge)
    half = np.sqrt(np.maximum(out * (2 * edge - out), 0.0))
    d, curvature = s - 0.5, 2 * camber / (0.25 + camber**2)
    mean = camber - d**2 * curvature / (1 + np.sqrt(1 - (d * curvature) ** 2))  # arc through (0, 0) and (1, 0)
    mean[[0, -1]] = 0.0
    # Thickness is laid across the chord, so that nose, tail, camber and thickness are exact (2 % thin at 5 % camber).
    return Airfoil(f"plate:{camber:.3f},{thickness:.3f}", _join(s, s), _join(mean + half, mean - half))


def blend(a: Airfoil, b: Airfoil, w: float) -> Airfoil:
    """Blend two sections linearly, side by side at equal chord fractions.

    >>> round(blend(naca("0010"), naca("0020"), 0.5).thickness, 4)
    0.15
    """
    faults = Faults()
    faults.number("w", w, 0.0, 1.0)
    faults.check()
    if w == 0.0 or a is b:
        return a
    if w == 1.0:
        return b
    n = max(a.x.size, b.x.size)
    pa, pb = (section.repanel(n + (n + 1) % 2 if n > 20 else 21) for section in (a, b))
    name = f"{1 - w:.3f}*{a.name}+{w:.3f}*{b.name}"
    return Airfoil(name, (1 - w) * pa.x + w * pb.x, (1 - w) * pa.y + w * pb.y)


def _numbers(text: str, faults: Faults) -> tuple[str, list[tuple[int, float, float]]]:
    """Read title and number pairs with their line numbers; note what is neither."""
    title = ""
    rows: list[tuple[int, float, float]] = []
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            if not title and not rows:
                title = line.strip()
            else:
                faults.add(f"line {number}", repr(line.strip()), "two numbers, x and y")
            continue
        if len(values) != 2 and not title and not rows:
            title = line.strip()  # such as "23012"
        elif len(values) != 2 or not all(map(math.isfinite, values)):
            faults.add(f"line {number}", repr(line.strip()), "two finite numbers, x and y")
        else:
            rows.append((number, values[0], values[1]))
    return title, rows


def _from_tail(points: Array, upper: int | None) -> Array:
    """Points in Selig order, around the section from its tail; `upper` is the Lednicer count of the first side."""
    if upper is None and points[0, 0] >= 0.5 * points[:, 0].max():
        return points
    fall = np.diff(points[:, 0])
    if upper is None and fall.min() > -0.5:  # a loop that starts at the nose
        cut = int(np.argmax(points[:, 0]))
        return np.vstack([points[cut:], points[: cut + 1]])
    # Lednicer; without counts the second side starts where x falls back to the nose
    cut = upper if upper is not None else int(np.argmin(fall)) + 1
    return np.vstack([points[:cut][::-1], points[cut:]])


def parse_dat(text: str, name: str = "") -> Airfoil:
    r"""Read a section file in Selig or Lednicer form.

    >>> from geometry.airfoil import naca
    >>> section = naca("2412")
    >>> text = "my section" + "".join(f"\n{x:.6f} {y:.6f}" for x, y in zip(section.x, section.y))
    >>> parse_dat(text).name, round(parse_dat(text).thickness, 3)
    ('my section', 0.12)
    """
    faults = Faults()
    title, rows = _numbers(text, faults)
    counts: tuple[int, int] | None = None
    if rows and rows[0][1] > 1.5 and rows[0][2] > 1.5 and all(v == int(v) for v in rows[0][1:]):
        counts = (int(rows[0][1]), int(rows[0][2]))
        rows = rows[1:]
    if len(rows) < 7 and not faults.found:
        faults.add("section file", f"{len(rows)} points", "7 points or more", "Is it a coordinate file?")
    if counts is not None and sum(counts) != len(rows) and not faults.found:
        wanted = f"{counts[0]} + {counts[1]} as its second line says"
        faults.add("section file", f"{len(rows)} points", wanted, "Truncated file?")
    faults.check()
    points = np.array([row[1:] for row in rows])
    if not (abs(points[:, 0].max() - 1) <= 0.02 and abs(points[:, 0].min()) <= 0.02):
        hint = "Coordinates in percent or millimetres? Divide by the chord" if points[:, 0].max() > 1.5 else ""
        got = f"x from {points[:, 0].min():g} to {points[:, 0].max():g}"
        faults.add("section file", got, "x from 0 to 1 (unit chord)", hint)
    faults.check()
    points = _from_tail(points, counts[0] if counts is not None else None)
    points = points[np.concatenate([[True], np.abs(np.diff(points, axis=0)).max(axis=1) > 1e-9])]
    x, y = points.T
    if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0:
        x, y = x[::-1], y[::-1]
    return Airfoil(name or title or "section", x, y)


# Sections with published coordinates that whole families of propellers use.

# Deters, Ananda and Selig (2014), Reynolds Number Effects on the Performance of Small-Scale Propellers, AIAA 2014-2151,
# appendix A, table 4 (read from a transcription, not from the paper): x, y in Selig order.  The trailing edge is blunt
# (0.011) so that 5 in blades could be printed.
# fmt: off
_SDA1075 = (
    (1.000137, 0.005557), (0.996593, 0.005916), (0.986424, 0.007201), (0.970307, 0.009369), (0.948605, 0.012241),
    (0.921585, 0.015743), (0.889621, 0.019963), (0.853243, 0.024878), (0.813012, 0.030409), (0.769531, 0.036448),
    (0.72343, 0.042837), (0.675369, 0.049377), (0.625945, 0.055764), (0.575694, 0.061768), (0.525145, 0.067169),
    (0.474806, 0.071778), (0.425168, 0.075411), (0.376692, 0.077929), (0.329814, 0.0792), (0.284932, 0.079143),
    (0.242417, 0.077694), (0.202594, 0.074839), (0.165758, 0.070588), (0.132147, 0.06501), (0.101982, 0.058221),
    (0.075425, 0.050381), (0.052643, 0.041731), (0.033775, 0.032527), (0.01896, 0.023081), (0.008287, 0.013758),
    (0.001894, 0.005047), (0.00028, -0.001921), (0.004701, -0.007905), (0.015056, -0.014217), (0.030301, -0.020208),
    (0.050355, -0.025609), (0.075069, -0.03029), (0.104265, -0.034146), (0.137711, -0.03714), (0.175126, -0.039253),
    (0.216177, -0.040503), (0.260479, -0.040926), (0.307602, -0.040585), (0.357073, -0.039554),
    (0.408381, -0.037928), (0.460985, -0.035812), (0.514304, -0.033341), (0.567727, -0.030638),
    (0.620617, -0.027832), (0.672308, -0.025029), (0.72215, -0.0223), (0.76951, -0.019711), (0.813783, -0.017302),
    (0.854396, -0.015105), (0.890816, -0.013128), (0.922559, -0.011366), (0.949178, -0.009777),
    (0.970411, -0.008207), (0.986204, -0.006742), (0.996295, -0.005793), (0.999851, -0.005553),
)
# NACA's Clark Y (Report 431, 1932, table of ordinates; from memory, not checked): x, upper and lower side above the
# flat bottom.  [%]
_CLARK_Y = (
    (0.0, 3.50, 3.50), (1.25, 5.45, 1.93), (2.5, 6.50, 1.47), (5.0, 7.90, 0.93), (7.5, 8.85, 0.63), (10.0, 9.60, 0.42),
    (15.0, 10.68, 0.15), (20.0, 11.36, 0.03), (30.0, 11.70, 0.0), (40.0, 11.40, 0.0), (50.0, 10.52, 0.0),
    (60.0, 9.15, 0.0), (70.0, 7.35, 0.0), (80.0, 5.22, 0.0), (90.0, 2.80, 0.0), (95.0, 1.49, 0.0), (100.0, 0.12, 0.0),
)
# fmt: on
PUBLISHED = ("sda1075", "clark_y")
"""Names that :func:`published` knows."""


def published(name: str) -> Airfoil:
    """Make a published section.

    >>> for name in PUBLISHED:
    ...     print(name, round(published(name).thickness, 3), round(published(name).camber, 3))
    sda1075 0.12 0.02
    clark_y 0.117 0.036
    """
    if name == "sda1075":
        x, y = np.array(_SDA1075).T
        return Airfoil(name, x, y)
    if name != "clark_y":
        raise GeometryError([("published section", repr(name), " or ".join(PUBLISHED), "")])
    s, upper, lower = 0.01 * np.array(_CLARK_Y).T
    x = _spaced(81)
    # both sides leave the nose like a root
    high, low = (pchip(np.sqrt(s), side, np.sqrt(x)) for side in (upper, lower))
    nose, tail = np.array([0.0, upper[0]]), np.array([1.0, 0.5 * (upper[-1] + lower[-1])])
    along, dx, dy = tail - nose, np.r_[x[::-1], x[1:]] - nose[0], np.r_[high[::-1], low[1:]] - nose[1]
    c, s = along / float(along @ along)  # turned and stretched so that the chord lies from 0 to 1 along x
    return Airfoil(name, c * dx + s * dy, c * dy - s * dx)


def thickened(section: Airfoil, thickness: float) -> Airfoil:
    """Scale the ordinates of a section to a thickness; its camber goes along.

    >>> thin = thickened(published("clark_y"), 0.0585)
    >>> round(thin.thickness, 4), round(thin.camber / published("clark_y").camber, 4)
    (0.0585, 0.5)
    """
    faults = Faults()
    hint = "Fractions of the chord: 4 % is 0.04" if thickness >= 1 else ""
    faults.number("thickness", thickness, 0.002, 0.6, hint=hint)
    faults.check()
    return Airfoil(f"{section.name}:{thickness:.4f}", section.x, section.y * (thickness / section.thickness))

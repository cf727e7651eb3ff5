"""A rotor made of plastic: edges that a printer can lay down, a rounded tip, a root that flares into a hub with a bore.

The mean line, chord and blade angle of a section stay. Its half thickness t becomes (t^p + s^p)^(1/p), where s is that
of a strip of the least thickness with round edges; so no place is thinner than the strip, and what is thicker stays.
Thickness is meant across the surface, not across the chord: s is widened by the slope of the mean line and by the tilt
that twist, sweep and rake give the surface along the span. Lengths in metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geometry.common import Array, Faults, GeometryError, offset
from geometry.rotor import Blade, Rotor

SHARPNESS = 12.0
"""p: the larger it is, the narrower the transition from strip to section; at its middle 6 % is added [1]."""
SLOPE = 3.0
"""Greatest fall of the chord towards the tip [m/m]: the trailing edge is then swept by 60 deg."""
TIP = 0.3
"""Thickness at the very tip over that before its edge is rounded [1]."""
PIVOT = 0.4
"""Chord fraction that stays in its place while the tip narrows [1]."""
LEAST_CHORD = 3.0
"""Least chord over the least thickness [1]."""
HEXAGON = 6
ROUND = 1.5
"""Length over height of the round edges: an ellipse keeps its width where the edge is swept by up to 48 deg [1]."""


@dataclass(frozen=True)
class Printed:
    """What a printed rotor must have.

    >>> Printed(8e-4).edge, Printed(8e-4, trailing_edge=1e-3).edge
    (0.0008, 0.001)
    """

    min_thickness: float = 8e-4  # of the blade, anywhere [m]
    trailing_edge: float | None = None  # its thickness; None is the least thickness [m]
    tip_length: float = 0.5  # of the rounded part of the blade, over the chord at the tip [-]
    blend: float | None = None  # height over the hub at which the flare of the root begins; None is a rule [m]
    round_edge: bool = True  # whether the edge of the very tip is rounded too
    bore: float = 0.0  # diameter of the hole through the hub; 0 is none [m]
    recess: tuple[float, float] = (0.0, 0.0)  # diameter and depth of a round recess in the back [m]
    hexagon: tuple[float, float] = (0.0, 0.0)  # width across flats and depth of a recess for a nut in the back [m]

    def __post_init__(self) -> None:
        faults = Faults()
        thick = "Millimetres? Divide by 1000"
        faults.number("min_thickness", self.min_thickness, 1e-4, 0.02, "m", thick if self.min_thickness > 0.02 else "")
        if self.trailing_edge is not None:
            faults.number("trailing_edge", self.trailing_edge, self.min_thickness, 0.02, "m", "No part may be thinner")
        faults.number("tip_length", self.tip_length, 0.05, 3.0)
        if self.blend is not None:
            faults.number("blend", self.blend, 0.0, 1.0, "m")
        faults.number("bore", self.bore, 0.0, 1.0, "m")
        for name, (width, depth) in (("recess", self.recess), ("hexagon", self.hexagon)):
            if (width, depth) != (0.0, 0.0) and not (width > self.bore and 0.0 < depth < 1.0):
                got = f"{width * 1e3:g} mm wide and {depth * 1e3:g} mm deep"
                faults.add(name, got, f"wider than the bore of {self.bore * 1e3:g} mm, and a depth")
        if self.recess[0] > 0.0 and self.hexagon[0] > 0.0:
            faults.add("hexagon", "a second recess", "one recess, round or hexagonal")
        faults.check()

    @property
    def edge(self) -> float:
        """Thickness of the trailing edge [m]."""
        return self.min_thickness if self.trailing_edge is None else self.trailing_edge

    def thicker(self, factor: float) -> Printed:
        """The same with all thicknesses times a factor [-]."""
        edge = None if self.trailing_edge is None else self.trailing_edge * factor
        return replace(self, min_thickness=self.min_thickness * factor, trailing_edge=edge)


ADAPTERS: dict[str, dict[str, Any]] = {
    "ring": {"bore": 6.35e-3, "recess": (9.5e-3, 3.1e-3)}, "m3": {"bore": 3.2e-3, "hexagon": (5.7e-3, 2.6e-3)},
    "m5": {"bore": 5.2e-3, "hexagon": (8.2e-3, 4.9e-3)}, "m6": {"bore": 6.2e-3, "hexagon": (10.2e-3, 5.4e-3)},
    "m8": {"bore": 8.2e-3, "hexagon": (13.2e-3, 7.0e-3)},
}  # fmt: skip
"""Holes for what propellers are mounted on. ``ring``: a quarter-inch bore and a recess for adapter rings, declared from
one propeller on sale, 9.5 mm wide and 3.1 mm deep. ``m3`` to ``m8``: a bolt and its nut by ISO 4032 (across flats
5.5, 8, 10, 13 mm; height 2.4, 4.7, 5.2, 6.8 mm; not checked against the standard) with 0.2 mm to spare."""


def settled(rotor: Rotor, printed: Printed) -> Printed:
    """Fill in the flare of the root, as high as the root is thick where the next blade leaves room for it.

    >>> from geometry.airfoil import naca
    >>> from geometry.laws import helix
    >>> two = Rotor(helix(0.2, 0.12, anchors=naca("4412")), 2)
    >>> round(settled(two, Printed()).blend, 4)
    0.0016
    """
    if printed.blend is not None or not rotor.blade.anchors:
        return printed
    blade = rotor.blade
    chord, beta = (float(v) for v in blade.at(blade.Rhub))
    thick = max(chord * blade.section(blade.Rhub).thickness, printed.min_thickness)
    room = 2 * math.pi * blade.Rhub / rotor.B * abs(math.sin(beta)) - thick
    return replace(printed, blend=min(thick, 0.4 * max(room, 0.0), 0.3 * rotor.span))


def _tip(blade: Blade, printed: Printed) -> tuple[float, float]:
    """Radial length of the rounding [m] and the chord at its end over that before it."""
    chord = float(blade.at(blade.R)[0])
    length = min(printed.tip_length * chord, 0.5 * (blade.R - blade.Rhub))
    steep = 0.5 * SLOPE * length / chord
    end = math.sqrt(steep**2 + 1.0) - steep  # where 1/e - e, the slope of the ellipse, is `SLOPE` times length / chord
    return length, min(max(end, LEAST_CHORD * printed.min_thickness / chord), 0.99)


def seeds(blade: Blade, printed: Printed) -> Array:
    """Radii that rings must have so that straight lines between them follow the rounding and the flare. [m]"""
    length, _ = _tip(blade, printed)
    tip = blade.R - length + length * np.sin(np.linspace(0.0, np.pi / 2, 25))
    edge = blade.R - ROUND * 0.5 * printed.min_thickness * (1.0 - np.sin(np.linspace(0.0, np.pi / 2, 9)))
    root = blade.Rhub + (printed.blend or 0.0) * np.linspace(0.0, 1.0, 9)
    return np.concatenate([tip, edge if printed.round_edge else tip[:0], root[root < blade.R]])


def _narrowed(blade: Blade, r: float, printed: Printed) -> float:
    """Chord over that of the blade: an ellipse towards the tip; beyond it the curve goes on, for what is cut there."""
    length, end = _tip(blade, printed)
    s = (r - (blade.R - length)) / length
    if s <= 0.0:
        return 1.0
    if s <= 1.0:
        return math.sqrt(1.0 - (1.0 - end**2) * s**2)
    return end * (0.8 + 0.2 * math.exp(-5.0 * (1.0 - end**2) / end**2 * (s - 1.0)))


def _rise(height: float, blend: float) -> float:
    """How far the flare stands off the blade: a parabola, 45 deg at the hub, which prints without support."""
    if blend <= 0.0 or height >= blend:
        return 0.0
    if height >= 0.0:
        return 0.5 * blend * (1.0 - height / blend) ** 2
    return blend * (0.5 + 0.3 * (1.0 - math.exp(height / (0.3 * blend))))


def outline(blade: Blade, r: float, n: int, printed: Printed) -> Array:
    """Give the outline of the printed blade at a radius, unrolled from its cylinder; both edges are round. [m]"""
    at = min(max(r, blade.Rhub), blade.R)
    full, beta, sweep, rake = (float(v) for v in blade._at(at))
    chord = full * _narrowed(blade, r, printed)
    if chord < (LEAST_CHORD if r <= blade.R else 1.0) * printed.min_thickness * (1.0 - 1e-9):
        got = f"{chord * 1e3:.3g} mm at r/R = {r / blade.R:.2f}"
        wanted = f"at least {LEAST_CHORD:g} times the least thickness of {printed.min_thickness * 1e3:g} mm"
        raise GeometryError([("chord", got, wanted, "A thinner print or a wider blade")])
    inside, half_edge = blade.R - r, ROUND * 0.5 * printed.min_thickness
    tip = math.sqrt(1.0 - TIP**2) * min(max(1.0 - inside / half_edge, 0.0), 1.0) if printed.round_edge else 0.0
    ends = _edges(blade, r, chord, printed)
    s = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, n // 2 + 1)))
    short = 1.0 - math.sqrt(1.0 - tip**2)  # corners of the planform are round as well
    s = short * ends[0] + (1.0 - short * (ends[0] + ends[1])) * s
    upper, lower = blade.section(at).surfaces(s)
    mean, half = 0.5 * (upper + lower), np.maximum(0.5 * (upper - lower), 0.0)
    old = (half - 0.5 * s * float(np.ptp(blade.section(at).surfaces(1.0)))).clip(0.0)
    along = (blade.axis - PIVOT) * full + (PIVOT - s) * chord
    least, edge = 0.5 * printed.min_thickness / chord, 0.5 * printed.edge / chord
    into = np.maximum(1.0 - s / ends[0], 1.0 - (1.0 - s) / ends[1]).clip(0.0)
    strip = (least + (edge - least) * s**4) * np.sqrt(np.clip(1.0 - into**2, 0.0, None))
    camber, up = _slopes(blade, r, s, along, mean, printed)
    strip *= np.sqrt(1.0 + camber**2 + up**2)
    half = (old**SHARPNESS + strip**SHARPNESS) ** (1.0 / SHARPNESS)
    # Laid across the mean surface, not across the chord, thickness moves the middle between the sides.
    mean = mean + 0.5 * np.gradient(half**2 - old**2, s) * camber
    if tip > 0.0:
        half *= np.sqrt(np.clip(1.0 - into**2 - tip**2, 0.0, None) / np.maximum(1.0 - into**2, 1e-12))
    half[[0, -1]] = 0.0
    across = np.concatenate([(mean + half)[::-1], (mean - half)[1:]]) * chord
    along = np.concatenate([along[::-1], along[1:]])
    tangential = along * math.cos(beta) - across * math.sin(beta) - sweep
    axial = along * math.sin(beta) + across * math.cos(beta) - rake
    loop = offset(np.stack([tangential, axial], axis=1)[:-1], _rise(r - blade.Rhub, printed.blend or 0.0))
    return np.vstack([loop, loop[:1]])


def _motion(blade: Blade, r: float, printed: Printed) -> tuple[Array, Array]:
    """Chord, blade angle, sweep, rake and narrowed chord at a radius, (5,), and how they change with it, (5,)."""
    step = 1e-4 * blade.R
    low, high = max(r - step, blade.Rhub), min(r + step, blade.R)
    if high - low < 0.5 * step:
        low, high = (blade.Rhub, blade.Rhub + step) if r < blade.R else (blade.R - step, blade.R)
    at = np.array([[*blade._at(x), blade._at(x)[0] * _narrowed(blade, x, printed)] for x in (low, high)])
    return 0.5 * (at[0] + at[1]), (at[1] - at[0]) / (high - low)


def _forward(s: Array, along: Array, r: float, at: Array, change: Array, axis: float) -> tuple[Array, Array, Array]:
    """Speeds with r: of a place of the chord forward along it, of the cylinder's arc, and of a fraction s on it."""
    turn = change[2] + (along * np.cos(at[1]) - at[2]) / r  # arcs keep their length while the cylinder grows
    slide = (PIVOT - s) * change[4] + (axis - PIVOT) * change[0]
    return -np.cos(at[1]) * turn - np.sin(at[1]) * change[3], turn, slide


def _edges(blade: Blade, r: float, chord: float, printed: Printed) -> tuple[float, float]:
    """Length of the round leading and trailing edge over the chord: longer where the edge is swept."""
    at, change = _motion(blade, r, printed)
    s = np.array([0.0, 1.0])
    along = (blade.axis - PIVOT) * at[0] + (PIVOT - s) * chord
    forward, _, slide = _forward(s, along, r, at, change, blade.axis)
    more = 0.5 * ROUND / chord * np.sqrt(1.0 + (forward + slide) ** 2)
    return min(float(more[0]) * printed.min_thickness, 0.5), min(float(more[1]) * printed.edge, 0.5)


def _slopes(blade: Blade, r: float, s: Array, along: Array, mean: Array, printed: Printed) -> tuple[Array, Array]:
    """Slopes of the surface of the mean lines along chord and span."""
    at, change = _motion(blade, r, printed)
    camber = np.gradient(mean, s)
    forward, turn, slide = _forward(s, along, r, at, change, blade.axis)
    up = along * change[1] + np.sin(at[1]) * turn - np.cos(at[1]) * change[3]
    return camber, up + change[4] * mean + camber * (forward + slide)


def root_depth(rotor: Rotor, printed: Printed) -> float:
    """How far the blade reaches into the hub [m]."""
    return min(max(0.12 * rotor.Rhub, 3.0 * printed.min_thickness), 0.5 * rotor.Rhub)


def framed(root: Array, printed: Printed) -> Array:
    """Root outline with a rim of the hub ahead of and behind it, which the flare runs into. [m]"""
    rim = 1.5 * printed.min_thickness * np.array([[0.0, -1.0], [0.0, 1.0]])
    return np.vstack([root, root[np.argmin(root[:, 1])] + rim[0], root[np.argmax(root[:, 1])] + rim[1]])


def cutters(printed: Printed, profile: Array, segments: int) -> list[tuple[str, Array, int]]:
    """Prisms that are taken out of the hub: name, (radius, z) profile, number of sides; faults when they do not fit.

    The profile is that of the hub from its back to its front; the recess opens to the back. The radius of a hexagon is
    that of a circle of its area, as `geometry.solid.revolve` takes it.
    """
    back, front, radius = float(profile[:, 1].min()), float(profile[:, 1].max()), float(profile[:, 0].max())
    faults, out = Faults(), []
    wall = 2.0 * printed.min_thickness
    corner, same = printed.hexagon[0] / math.sqrt(3.0), printed.hexagon[0] * math.sqrt(math.sqrt(3.0) / (2.0 * math.pi))
    for name, width in (("bore", printed.bore), ("recess", printed.recess[0]), ("hexagon", 2.0 * corner)):
        if width > 0.0 and 0.5 * width + wall > radius:
            wanted = (
                f"at most {2e3 * (radius - wall):.4g} mm in a hub of {2e3 * radius:.4g} mm: a wall of twice the least"
            )
            faults.add(name, f"{width * 1e3:.4g} mm", f"{wanted} thickness stays", "A larger hub or a smaller hole")
    depth = max(printed.recess[1], printed.hexagon[1])
    rim = float(profile[profile[:, 0] > 0.99 * radius, 1].max()) - back
    if depth > 0.0 and depth + wall > rim:
        faults.add("recess", f"{depth * 1e3:.4g} mm deep", f"at most {1e3 * (rim - wall):.4g} mm in this hub", "")
    faults.check()
    over = 0.1 * (front - back)

    def prism(radius: float, low: float, high: float) -> Array:
        return np.array([(0.0, low), (radius, low), (radius, high), (0.0, high)])

    if printed.bore > 0.0:
        out.append(("bore", prism(0.5 * printed.bore, back - over, front + over), segments))
    if printed.recess[1] > 0.0:
        out.append(("bore", prism(0.5 * printed.recess[0], back - over, back + printed.recess[1]), segments))
    if printed.hexagon[1] > 0.0:
        out.append(("bore", prism(same, back - over, back + printed.hexagon[1]), HEXAGON))
    return out

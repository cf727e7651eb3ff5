"""From the outline of a cut blade to its section: leading and trailing edge, chord line, thickness, camber."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from geometry.airfoil import Airfoil
from geometry.common import Array, GeometryError


class Cut(NamedTuple):
    """One section: chord in the outline's unit, beta [rad], the rest over the chord [-], the unit-chord shape."""

    chord: float
    beta: float
    thickness: float
    camber: float
    camber_position: float
    section: Airfoil


def loop_area(loop: Array) -> float:
    """Signed area of an outline. [that unit squared]"""
    x, y = (loop - loop.mean(axis=0)).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _farthest(loop: Array) -> tuple[int, int]:
    """Indices of the two points that lie farthest from each other."""
    angle = np.linspace(0, np.pi, 64, endpoint=False)
    reach = loop @ np.stack([np.cos(angle), np.sin(angle)])
    some = np.unique(np.concatenate([reach.argmax(axis=0), reach.argmin(axis=0)]))
    apart = ((loop[some, None] - loop[None, some]) ** 2).sum(axis=-1)
    i, j = np.unravel_index(int(apart.argmax()), apart.shape)
    return int(some[i]), int(some[j])


def _sides(loop: Array) -> tuple[Array, Array]:
    """Split a counter-clockwise outline, chord along x, into its upper and lower side, both with ascending x."""
    i, j = int(loop[:, 0].argmin()), int(loop[:, 0].argmax())
    around = np.roll(loop, -i, axis=0)
    cut = (j - i) % len(loop)
    lower, upper = around[: cut + 1], np.vstack([around[cut:], around[:1]])[::-1]
    out = []
    for side in (upper, lower):
        keep = np.concatenate([[True], side[1:, 0] > np.maximum.accumulate(side[:, 0])[:-1] + 1e-9])
        out.append(side[keep])
    return out[0], out[1]


def _lines(loop: Array, x: Array) -> tuple[Array, Array]:
    """Half thickness and mean line at x of an outline along x."""
    upper, lower = (np.interp(x, side[:, 0], side[:, 1]) for side in _sides(loop))
    return 0.5 * (upper - lower), 0.5 * (upper + lower)


def _along(loop: Array, nose: Array, tail: Array) -> Array:
    """Outline in the frame with the nose at (0, 0) and the tail at (1, 0), counter-clockwise."""
    d = tail - nose
    size = float(d @ d)
    p = loop - nose
    out: Array = np.stack([p @ d, p @ np.array([-d[1], d[0]])], axis=1) / size
    return out if loop_area(out) > 0 else out[::-1]


def nose_first(loop: Array) -> tuple[Array, Array, float]:
    """Tell the leading from the trailing edge: the greater thickness lies nearer to the leading edge."""
    i, j = _farthest(loop)
    nose, tail = loop[i], loop[j]
    x = np.linspace(0.02, 0.98, 97)
    half, _ = _lines(_along(loop, nose, tail), x)
    clear = 0.5 - float(np.sum(half * x) / max(float(np.sum(half)), 1e-300))
    return (nose, tail, clear) if clear >= 0 else (tail, nose, -clear)


def _refine(loop: Array, nose: Array, tail: Array) -> tuple[Array, Array]:
    """Move both ends onto the ends of the mean line.

    Near the nose the middle between the sides stands off the mean line by half the slope of the squared half thickness
    times the slope of the mean line, because thickness is laid across the mean line, not across the chord.
    """
    shape = _along(loop, nose, tail)
    low, high = float(shape[:, 0].min()), float(shape[:, 0].max())
    x = low + np.linspace(0.012, 0.10, 23)
    half, mean = _lines(shape, x)
    u = x - low
    b1 = float(np.linalg.lstsq(np.stack([u, u**2, u**3], 1), half**2, rcond=None)[0][0])
    a0, a1, _ = np.linalg.lstsq(np.stack([np.ones_like(u), u, u**2], 1), mean, rcond=None)[0]
    first = np.array([low, a0 - 0.5 * b1 * a1])
    x = high - np.linspace(0.012, 0.08, 18)
    _, mean = _lines(shape, x)
    slope, offset = np.polyfit(x - high, mean, 1)
    second = np.array([high, offset])
    d = tail - nose
    side = np.array([-d[1], d[0]])
    if loop_area(np.stack([(loop - nose) @ d, (loop - nose) @ side], 1)) == 0:
        raise GeometryError([("section", "an outline without area", "an outline", "")])
    return nose + first[0] * d + first[1] * side, nose + second[0] * d + second[1] * side


def fit_section(loop: Array, n: int = 121) -> Cut | None:
    """Measure a section.

    >>> from geometry.airfoil import naca
    >>> s = naca("4412")
    >>> cut = fit_section(0.1 * np.stack([-s.x, s.y], axis=1))
    >>> round(cut.chord, 4), abs(cut.beta) < 1e-3, round(cut.thickness, 3), round(cut.camber, 3)
    (0.1, True, 0.12, 0.04)
    """
    if len(loop) < 7 or loop_area(loop) == 0:
        return None
    nose, tail, clear = nose_first(loop)
    if clear < 0.02 and nose[0] < tail[0]:  # alike at both ends: the caller's sense of motion decides
        nose, tail = tail, nose
    for _ in range(2):
        nose, tail = _refine(loop, nose, tail)
    d = nose - tail
    chord = float(np.linalg.norm(d))
    beta = math.atan2(float(d[1]), float(d[0]))
    shape = _along(loop, nose, tail)
    # x runs from nose to tail; the suction side is +y when motion is +t and thrust +z, which a turned frame keeps.
    shape = shape * [1.0, -1.0]
    if loop_area(shape) < 0:
        shape = shape[::-1]
    x = 0.5 * (1 - np.cos(np.linspace(0, np.pi, 201)))[1:-1]
    half, mean = _lines(shape, x)
    k = int(np.abs(mean).argmax())
    section = _as_airfoil(shape, n)
    if section is None:
        return None
    return Cut(chord, beta, 2 * float(half.max()), float(mean[k]), float(x[k]), section)


def _as_airfoil(shape: Array, n: int) -> Airfoil | None:
    """Selig loop of a counter-clockwise outline along x."""
    upper, lower = _sides(shape)
    x = np.concatenate([upper[::-1, 0], lower[1:, 0]])
    y = np.concatenate([upper[::-1, 1], lower[1:, 1]])
    if upper[-1, 0] < lower[-1, 0] - 1e-9:  # a cut trailing edge: both sides reach the end
        x, y = np.append(lower[-1, 0], x), np.append(upper[-1, 1], y)
    try:
        return Airfoil("cut", x, y).repanel(n)
    except GeometryError:
        return None

"""Find the shaft of a rotor in a mesh of unknown place and orientation, and what of the mesh is the rotor.

The shaft is the principal direction of inertia about which the cuts of all blades are alike to third moments.
"""

from __future__ import annotations

import math
from collections import defaultdict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.airfoil import Airfoil
from geometry.common import Array, GeometryError

# From the outline of a cut blade to its section: leading and trailing edge, chord line, thickness, camber.


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


Faces = NDArray[np.int64]


def loops(points: Array, faces: Faces, r: float) -> tuple[list[Array], int]:
    """Cut a mesh by the cylinder of radius r around the z axis.

    Every edge is met exactly; lines are joined by the edges that faces share, not by nearness.
    """
    square = points[:, 0] ** 2 + points[:, 1] ** 2
    inside = square < r * r
    touched = faces[np.isin(inside[faces].sum(axis=1), (1, 2))]
    if not len(touched):
        return [], 0
    state = inside[touched]
    lone = np.where(state.sum(axis=1) == 1, state.argmax(axis=1), (~state).argmax(axis=1))
    row = np.arange(len(touched))
    apex, next_, last = touched[row, lone], touched[row, (lone + 1) % 3], touched[row, (lone + 2) % 3]
    edges = np.concatenate([np.stack([apex, next_], 1), np.stack([apex, last], 1)])
    key = edges.min(axis=1) * len(points) + edges.max(axis=1)
    unique, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    ends = np.sort(edges[first], axis=1)
    a, d = points[ends[:, 0]], points[ends[:, 1]] - points[ends[:, 0]]
    qa, qb = (d[:, :2] ** 2).sum(axis=1), (a[:, :2] * d[:, :2]).sum(axis=1)
    qc = square[ends[:, 0]] - r * r
    root = np.sqrt(np.maximum(qb**2 - qa * qc, 0.0))
    # One end lies inside, one outside: qc tells which of the two roots is between them.
    t = np.where(qc < 0, -qb + root, -qb - root) / np.maximum(qa, 1e-300)
    hit = a + np.clip(t, 0.0, 1.0)[:, None] * d
    return _trace(hit, inverse.reshape(2, -1).T, r)


def _trace(hit: Array, pairs: Faces, r: float) -> tuple[list[Array], int]:
    """Join segments between hits into closed unrolled lines."""
    beside: dict[int, list[int]] = defaultdict(list)
    for i, j in pairs.tolist():
        beside[i].append(j)
        beside[j].append(i)
    seen: set[int] = set()
    closed, others = [], 0
    for start in beside:
        if start in seen:
            continue
        chain, here = [start], start
        seen.add(start)
        while True:
            ahead = [k for k in beside[here] if k not in seen]
            if not ahead:
                break
            here = ahead[0]
            seen.add(here)
            chain.append(here)
        if len(chain) < 6:
            continue
        if start not in beside[here]:
            others += 1
            continue
        line = hit[chain]
        angle = np.arctan2(line[:, 1], line[:, 0])
        step = (np.diff(np.append(angle, angle[0])) + math.pi) % (2 * math.pi) - math.pi
        if abs(step.sum()) > 1.0:
            others += 1
            continue
        turned = angle[0] + np.concatenate([[0.0], np.cumsum(step[:-1])])
        closed.append(np.stack([r * turned, line[:, 2]], axis=1))
    return closed, others


def blades(points: Array, faces: Faces, r: float) -> list[Array] | None:
    """Cut the blades at a radius. [the same unit]"""
    found, others = loops(points, faces, r)
    if others or len(found) < 2:
        return None
    size = np.array([abs(loop_area(loop)) for loop in found])
    keep = [loop for loop, area in zip(found, size, strict=True) if area > 0.3 * size.max()]
    return keep if len(keep) >= 2 else None


PROBES = (0.45, 0.6, 0.75, 0.88, 0.955)  # r/R at which candidates for the axis are tried


def _moments(loop: Array) -> Array:
    """Shape of an outline up to its place round the axis: area, z and central moments to the third degree."""
    x, y = loop.T
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y1 - x1 * y
    area = 0.5 * cross.sum()
    centre = np.array([((x + x1) * cross).sum(), ((y + y1) * cross).sum()]) / (6 * area)
    size = float(np.ptp(loop, axis=0).max())
    # Gauss points on the edges: moments by the divergence theorem, exact for third degree.
    t, w = np.polynomial.legendre.leggauss(3)
    t, w = 0.5 * (t + 1), 0.5 * w
    u = ((x - centre[0])[:, None] + t * (x1 - x)[:, None]) / size
    v = ((y - centre[1])[:, None] + t * (y1 - y)[:, None]) / size
    dv = ((y1 - y) / size)[:, None] * w
    out = []
    for i, j in ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)):
        out.append(float((u ** (i + 1) / (i + 1) * v**j * dv).sum()) * size**2 / area)
    return np.array([abs(area) / size**2, *out, centre[1] / size, centre[0]])


def _spread(points: Array, faces: Faces, tip: float) -> tuple[int, float]:
    """Number of blades about the z axis and how far they differ; (0, inf) when it is no axis of a rotor."""
    counts, worst = [], []
    for share in PROBES[::-1]:
        found = blades(points, faces, share * tip)
        if found is None:
            if share == PROBES[-1]:  # no free tips: the wall of a duct, a rim, or the wrong axis
                return 0, math.inf
            continue
        table = np.array([_moments(loop) for loop in found])
        if np.median(table[:, 0]) > 0.35:  # area over length squared: blocks, not blades
            return 0, math.inf
        angle = np.sort(table[:, -1] / (share * tip) % (2 * math.pi))
        step = np.diff(np.append(angle, angle[0] + 2 * math.pi)) * len(found) / (2 * math.pi)
        scale = np.array([table[:, 0].mean(), *[0.02] * 3, *[0.005] * 4, 1.0])
        counts.append(len(found))
        worst.append(max(float((np.ptp(table[:, :-1], axis=0) / scale).max()), float(np.abs(step - 1).max())))
    if len(counts) < 2:
        return 0, math.inf
    most = max(set(counts), key=counts.count)
    if counts.count(most) < 2:
        return 0, math.inf
    return most, max(w for w, c in zip(worst, counts, strict=True) if c == most)


def _inertia(points: Array, faces: Faces) -> tuple[Array, Array]:
    """Centroid and principal directions (rows) of the enclosed volume, or of the surface when that is open."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    origin = points.mean(axis=0)
    a, b, c = a - origin, b - origin, c - origin
    w = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    fourth = (a + b + c, 4.0, 20.0)
    if abs(w.sum()) < 1e-6 * np.abs(w).sum():
        w = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        fourth = (a + b + c, 3.0, 12.0)
    total, parts, scale = fourth
    centre = (w[:, None] * total).sum(axis=0) / (parts * w.sum())
    second = sum(np.einsum("i,ij,ik->jk", w, p, p) for p in (a, b, c, total)) / (scale * w.sum())
    _, vectors = np.linalg.eigh(second - np.outer(centre, centre))
    return centre + origin, vectors.T


def frame(axis: Array) -> Array:
    """Make a rotation matrix whose rows are two directions across the axis, and the axis. [-]"""
    axis = axis / np.linalg.norm(axis)
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(other, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis])


def _bodies(points: Array, faces: Faces) -> list[Faces]:
    """Faces of each connected body, large ones first."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(edges), bool), edges.T), shape=(len(points),) * 2)
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    parts = [faces[label == k] for k in np.unique(label)]
    return sorted(parts, key=lambda part: -float(np.ptp(points[np.unique(part)], axis=0).max()))


def _alike(points: Array, parts: list[Faces]) -> list[Faces]:
    """Join bodies of equal volume and area."""
    groups: dict[int, list[Faces]] = {}
    sizes: list[Array] = []
    for part in parts:
        a, b, c = (points[part[:, k]] - points[part[0, 0]] for k in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        size = np.array([abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6, area])
        for k, other in enumerate(sizes):
            if (np.abs(size - other) < 0.02 * other).all():
                groups[k].append(part)
                break
        else:
            groups[len(sizes)] = [part]
            sizes.append(size)
    return [np.concatenate(group) for group in groups.values() if len(group) > 1]


def _is_vane(points: Array, faces: Faces, centre: Array, axis: Array) -> bool:
    """Whether sections stand along the shaft, as the vanes of a stator do."""
    local = (points - centre) @ frame(axis).T
    tip = float(np.hypot(local[:, 0], local[:, 1])[np.unique(faces)].max())
    for share in (0.75, 0.6, 0.88):
        found = blades(local, faces, share * tip)
        if found is not None:
            nose, tail, _ = nose_first(found[0])
            return bool(abs(nose[0] - tail[0]) < 0.12 * abs(nose[1] - tail[1]))
    return False


def _best_axis(points: Array, faces: Faces) -> tuple[float, int, Array, Array]:
    """Try the principal directions; spread, blades, centre, axis."""
    centre, directions = _inertia(points, faces)
    tried = []
    for axis in directions:
        local = (points - centre) @ frame(axis).T
        used = np.unique(faces)
        tip = float(np.hypot(local[used, 0], local[used, 1]).max())
        count, spread = _spread(local, faces, tip)
        tried.append((spread, count, centre, axis))
    return min(tried, key=lambda row: row[0])


def _refined(points: Array, faces: Faces, centre: Array, axis: Array) -> tuple[Array, Array]:
    """Axis from the blades alone: equal points of different blades differ across the axis only."""
    rows = frame(axis)
    local = (points - centre) @ rows.T
    tip = float(np.hypot(local[:, 0], local[:, 1])[np.unique(faces)].max())
    scatter, middles = np.zeros((3, 3)), []
    for share in np.linspace(0.4, 0.9, 11):
        found = blades(local, faces, share * tip)
        if found is None:
            continue
        ends = [nose_first(loop) for loop in found]
        for k in (0, 1):
            s, z = np.array([end[k] for end in ends]).T
            p = np.stack([share * tip * np.cos(s / (share * tip)), share * tip * np.sin(s / (share * tip)), z], axis=1)
            middles.append(p.mean(axis=0))
            scatter += (p - p.mean(axis=0)).T @ (p - p.mean(axis=0))
    if len(middles) < 6:
        return centre, axis
    normal = np.linalg.eigh(scatter)[1][:, 0] @ rows
    return centre + np.mean(middles, axis=0) @ rows, normal * math.copysign(1.0, float(normal @ axis))


def pick(points: Array, faces: Faces) -> tuple[Faces, int, float, Array, Array, list[str]]:
    """Separate the rotor from what stands beside it and find its axis."""
    parts = _bodies(points, faces)
    large = [p for p in parts if len(p) >= 20]
    options: list[tuple[Faces, str]] = [(faces, "")]
    if 1 < len(large) <= 60:
        for k in range(min(3, len(large) - 1)):
            rest = np.concatenate(large[k + 1 :])
            options.append((rest, f"the {k + 1} largest of the file's bodies (a duct or stator?) were left out"))
        options += [
            (group, "equal bodies of the file were taken for the blades, the others left out")
            for group in _alike(points, large)
        ]
        options += [(p, "the other bodies of the file (a duct or stator?) were left out") for p in large]
    best: tuple[float, int, Array, Array] | None = None
    chosen, note = faces, ""
    for candidate, text in options:
        row = _best_axis(points, candidate)
        if not row[1]:
            continue
        if _is_vane(points, candidate, row[2], row[3]):
            row = (row[0] + 0.4, *row[1:])
        if best is None or row[0] < 0.5 * best[0]:
            best, chosen, note = row, candidate, text
            if row[0] < 0.02:
                break
    if best is None or best[0] > 0.5:
        got = f"{len(parts)} bodies, none with two or more equal blades that stand free about an axis"
        wanted, hint = (
            "a propeller or fan with free blade tips",
            "A single blade, a closed rim or an open mesh cannot be read",
        )
        raise GeometryError([("mesh", got, wanted, hint)])
    spread, count, centre, axis = best
    if spread > 1e-3:  # a hub that is not alike on all sides moves the centroid: ask the blades alone
        moved, turned = centre, axis
        for _ in range(3):
            moved, turned = _refined(points, chosen, moved, turned)
            local = (points - moved) @ frame(turned).T
            used = np.unique(chosen)
            again, less = _spread(local, chosen, float(np.hypot(local[used, 0], local[used, 1]).max()))
            if again == count and less < spread:
                spread, centre, axis = less, moved, turned
    return chosen, count, spread, centre, axis, [note] if note else []

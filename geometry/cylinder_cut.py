"""Cut a mesh by cylinders around the z axis: exact hits on edges, joined by the edges that faces share."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from geometry.common import Array
from geometry.section_fit import loop_area

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

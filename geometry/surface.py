"""Surfaces of a rotor and its duct as grids of points: what a viewer draws, without solids and their libraries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.common import Array, GeometryError
from geometry.duct import Duct
from geometry.mesh import hub_profile, rings
from geometry.mesh_duct import centre_body, duct_profile, plan_stator, vane_rows
from geometry.rotor import Rotor
from geometry.solid import Options

COARSE = Options(n=41)
RINGS = 29
TURN = 61
"""Points round the axis."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A grid of points, repeated around the z axis."""

    name: str  # ``blade``, ``hub``, ``duct`` or ``stator``
    points: Array  # Neighbours in the grid are neighbours on the surface [m]
    copies: int = 1  # How often it stands round the axis, evenly


def _turned(name: str, profile: Array, start: float = 0.0, end: float = 2 * math.pi) -> Surface:
    """Turn a profile of (radius, z) round the axis."""
    a = np.linspace(start, end, TURN)[:, None]
    r, z = profile.T
    return Surface(name, np.stack(np.broadcast_arrays(r * np.cos(a), r * np.sin(a), z), axis=-1))


def _split(rows: Array, step: float) -> Array:
    """Put rows between rows that lie farther apart than a step, so that far and near facets sort well."""
    gap = np.linalg.norm(np.diff(rows, axis=0), axis=-1).reshape(len(rows) - 1, -1).max(axis=1)
    at = np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(np.ceil(gap / step)))])
    k = np.minimum(at.astype(int), len(rows) - 2)
    w = (at - k).reshape(-1, *[1] * (rows.ndim - 1))
    out: Array = rows[k] + w * (rows[k + 1] - rows[k])
    return out


def _capped(rows: Array) -> Array:
    """Close a row of outlines and its last end, which falls onto its own middle line."""
    lid = 0.5 * (rows[-1] + rows[-1, ::-1])
    whole = np.concatenate([rows, lid[None]])
    return np.concatenate([whole, whole[:, :1]], axis=1)


def surfaces(rotor: Rotor, duct: Duct | None = None) -> list[Surface]:
    """Give the surfaces of blades and hub, and of a duct cut open on the side of -y, with its vanes.

    >>> from geometry.airfoil import naca
    >>> from geometry.laws import helix
    >>> found = surfaces(Rotor(helix(0.2032, 0.127, anchors=naca("4412")), 2))
    >>> [(s.name, s.copies) for s in found], round(float(np.abs(found[0].points[..., :2]).max()), 4)
    ([('blade', 2), ('hub', 1)], 0.1016)
    """
    blade = rotor.blade
    if not blade.anchors:
        raise GeometryError([("anchors", "none", "one section or more", "A surface needs sections")])
    root = max(blade.Rhub, 0.02 * blade.R)
    r = np.concatenate([[0.9 * root], root + (blade.R - root) * np.sin(np.linspace(0, np.pi / 2, RINGS))])
    r[-1] = blade.R
    curves = rings(blade, r, COARSE)
    turn = rotor.rotation * curves[..., 0] / r[:, None]
    points = np.stack([r[:, None] * np.cos(turn), r[:, None] * np.sin(turn), curves[..., 1]], axis=-1)
    hub = hub_profile(rotor, curves[1])
    step = 0.12 * blade.R
    found = [Surface("blade", _capped(points), rotor.B), _turned("hub", _split(hub, step))]
    if duct is None:
        return found
    wall = duct_profile(duct, 33)
    wall = _split(np.vstack([wall, wall[:1]]), step)
    cut = [np.stack([r * np.cos(a), r * np.sin(a), z], axis=-1) for r, z, a in ((*wall.T, 0.0), (*wall.T, np.pi))]
    found.append(_turned("duct", wall, 0.0, math.pi))
    found += [Surface("cut", np.stack([edge, edge[::-1]])) for edge in cut]
    plan = plan_stator(duct, float(hub[:, 1].min()), rotor.Rhub)
    if plan is not None:
        found += [
            Surface("stator", _capped(_split(vane_rows(duct, plan, COARSE), step)), plan.stator.B),
            _turned("stator", _split(centre_body(duct, plan), step)),
        ]
    return found

"""Jet of a ducted rotor in potential flow: how much the exit passes, at rest and in a stream.

Ring vortices on the walls of duct and body, constant stream function on each (zero on the body), and on the cylinder
that the jet leaves the trailing edge by (Kuechemann and Weber 1953, Aerodynamics of Propulsion, ch. 4 and 6; Gibson
1974, IMechE; neither checked: the equations are those of the vortex ring).  The sheet of the jet has the strength
Vj - V that it has far behind, and its shape is not iterated: the flow through the exit is then linear in V and Vj.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.duct import Duct

Array = NDArray[np.float64]

# Fewer than a hundred unknowns: beyond it a linear solver starts threads, which cost more than they save.
WALL_PANELS, BODY_PANELS = 26, 7
# Jet: panels grow by this ratio up to so many exit radii, beyond which a tube does nothing at the exit.
_GROWTH, _REACH = 1.18, 40.0
# Noses of hubs over their radius, tails beyond the exit over the radius there: declared.
NOSE, TAIL = 1.5, 3.0
# Outside of these no duct is known; the potential flow of a shape that closes its own exit.
_RANGE = (0.5, 1.5)
_FAR = np.polynomial.legendre.leggauss(3)
_NEAR = np.polynomial.legendre.leggauss(10)


class JetArea(NamedTuple):
    """Area of the jet far behind over the exit's: ``at_rest``, and ``in_stream`` where the rotor adds nothing."""

    at_rest: float
    in_stream: float


def jet_area(duct: Duct, hub_radius: float) -> JetArea:
    """Jet area over exit area; flow through the exit = exit area x (in_stream V + at_rest (Vj - V)). [1]"""
    walls = (duct.length, duct.lip_radius, duct.lip_length, duct.exit_radius, duct.exit_hub_radius, duct.rotor_x,
             duct.bore_end, duct.te_thickness, hub_radius)  # fmt: skip
    over_bore = tuple(round(float(v or 0.0) / duct.inner_radius, 9) for v in walls)
    return _solved(*over_bore)


@lru_cache(maxsize=512)
def _solved(
    length: float, lip: float, lip_length: float, exit_radius: float, exit_hub: float, rotor_x: float, bore_end: float,
    te: float, hub: float,
) -> JetArea:  # fmt: skip
    duct = Duct(1.0, length, lip, 0.0, exit_radius, exit_hub, rotor_x, None, lip_length / lip if lip > 0.0 else 1.0,
                bore_end, te)  # fmt: skip
    wall = _wall(duct)
    bodies = [wall] + ([_body(duct, hub)] if hub > 0.0 else [])
    at = np.concatenate([0.5 * (b[1:] + b[:-1]) for b in bodies])
    n, m = at.shape[0], wall.shape[0] - 1
    jet_radius = wall[0, 1]
    first = float(np.hypot(*(wall[-1] - wall[-2])))
    steps = int(np.ceil(np.log1p(_REACH * jet_radius * (_GROWTH - 1.0) / first) / np.log(_GROWTH)))
    x = length + first * np.concatenate([[0.0], np.cumsum(_GROWTH ** np.arange(steps))])
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = np.concatenate([_stream(at, b) for b in bodies], axis=1)
    A[:m, n] = -1.0
    A[n, [0, m - 1]] = 1.0  # both sides of the trailing edge feed the jet's sheet
    rhs = np.zeros((n + 1, 2))
    rhs[:n, 0] = -0.5 * at[:, 1] ** 2
    rhs[:n, 1] = -_stream(at, np.stack([x, np.full(x.size, jet_radius)], axis=1)).sum(axis=1)
    rhs[n, 1] = 1.0
    through = 2.0 * np.pi * np.linalg.solve(A, rhs)[n] / duct.exit_area
    in_stream, at_rest = np.clip(through, *_RANGE)
    return JetArea(float(at_rest), float(in_stream))


def _wall(duct: Duct) -> Array:
    """Outline from the trailing edge along the bore to the lip and back outside, (N, 2)."""
    x = duct.length * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, WALL_PANELS + 1)))
    inner, outer = duct.inner(x), duct.outer(x)
    shut = 0.5 * (outer[-1] - inner[-1]) * x / duct.length
    bore, shell = np.stack([x, inner + shut], axis=1), np.stack([x, outer - shut], axis=1)
    meet = int(outer[0] - inner[0] < 1e-9)
    return np.concatenate([bore[::-1], shell[meet:]])


def _body(duct: Duct, hub: float) -> Array:
    """Body from its nose to its tail: half ellipse, cylinder through the rotor, taper to the exit, half ellipse."""
    rotor, end = float(duct.rotor_x or 0.0), duct.length
    quarter = np.linspace(0.0, 0.5 * np.pi, BODY_PANELS + 1)
    front = rotor - hub
    nose = np.stack([front - NOSE * hub * np.cos(quarter), hub * np.sin(quarter)], axis=1)
    behind = min(rotor + hub, 0.5 * (rotor + end))
    if duct.exit_hub_radius > 1e-6:
        r = duct.exit_hub_radius
        straight = np.linspace(front, behind, BODY_PANELS)[1:]
        taper = np.linspace(behind, end, BODY_PANELS)[1:]
        parts = [np.stack([straight, np.full(straight.size, hub)], axis=1),
                 np.stack([taper, hub + (r - hub) * (taper - behind) / (end - behind)], axis=1),
                 np.stack([end + TAIL * r * np.sin(quarter), r * np.cos(quarter)], axis=1)[1:]]  # fmt: skip
    else:
        straight = np.linspace(front, behind, BODY_PANELS)[1:]
        tail = np.stack([behind + (end - behind) * np.sin(quarter), hub * np.cos(quarter)], axis=1)[1:]
        parts = [np.stack([straight, np.full(straight.size, hub)], axis=1), tail]
    out = np.concatenate([nose, *parts])
    out[:, 1] = np.maximum(out[:, 1], 1e-4 * hub)
    return np.asarray(out)


def _stream(at: Array, nodes: Array) -> Array:
    """Stokes stream function at (M, 2) points per unit strength of each panel between nodes, (M, N)."""
    a, b = nodes[:-1], nodes[1:]
    L = np.hypot(*(b - a).T)
    middle = 0.5 * (a + b)
    x, r = at[:, None, 0], at[:, None, 1]
    out = np.zeros((at.shape[0], L.size))
    for t, w in zip(0.5 * (1.0 + _FAR[0]), 0.5 * _FAR[1], strict=True):
        q = a + t * (b - a)
        out += w * L * _ring(x, r, q[None, :, 0], q[None, :, 1])
    away = np.hypot(x - middle[None, :, 0], r - middle[None, :, 1])
    i, j = np.nonzero(away < 3.0 * L[None, :])
    near = np.zeros(i.size)
    for t, w in zip(0.5 * (1.0 + _NEAR[0]), 0.5 * _NEAR[1], strict=True):
        q = a[j] + t * (b[j] - a[j])
        near += w * L[j] * _ring(at[i, 0], at[i, 1], q[:, 0], q[:, 1])
    out[i, j] = near
    own = away[i, j] < 1e-9 * L[j]
    i, j = i[own], j[own]
    # a panel on itself: psi = (r / 2 pi) (ln(8 r / d) - 2) at the distance d
    out[i, j] = L[j] * middle[j, 1] / (2.0 * np.pi) * (np.log(16.0 * middle[j, 1] / L[j]) - 1.0)
    return out


def _ring(x: Array, r: Array, x1: Array, r1: Array) -> Array:
    """Stream function of a ring of unit circulation (Lamb 1932, Hydrodynamics, art. 161)."""
    from scipy.special import ellipe, ellipk

    m = np.clip(4.0 * r * r1 / ((x - x1) ** 2 + (r + r1) ** 2), 1e-12, 1.0 - 1e-15)
    k = np.sqrt(m)
    return np.asarray(np.sqrt(r * r1) / (2.0 * np.pi) * ((2.0 / k - k) * ellipk(m) - 2.0 / k * ellipe(m)))

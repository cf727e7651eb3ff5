"""Jet of a ducted rotor in potential flow: how much the exit passes, at rest and in flight.

Ring vortices on the walls of duct and body, constant stream function on each (zero on the body), and on the cylinder
that the jet leaves the trailing edge by (Kuechemann and Weber 1953, Aerodynamics of Propulsion, ch. 4 and 6; Gibson
1974, IMechE; neither checked: the equations are those of the vortex ring).  The duct is thereby a thick ring wing in
the stream that rotor and jet induce, with its circulation from the Kutta condition.

The sheet between jet and stream carries the jump of total head.  Bernoulli's equation on both sides of it, at one
pressure, gives its strength where its two sides move at ``V_m`` in the mean ::

    gamma(s) = (V_j^2 - V^2) / (2 V_m(s))

(Drela and Youngren 2005, Axisymmetric Analysis and Design of Ducted Rotors, the wake of DFDC; Bontempo and Manna 2013,
J. Fluid Mech. 728:163; equation numbers not checked).  Far behind V_m is (V_j + V) / 2 and gamma V_j - V; at the exit
the sheet is slower and stronger, by 5 to 60 % in flight, and sucks more through the duct.  Its shape is not iterated:
a cylinder from the trailing edge.  A sheet that follows its stream changes the mass flow by 0.6 % at most, and the
pressures on the walls then agree with the jet's momentum within 1.7 % (reports/studies/duct_jet.py).

The mean speed q through the exit is c_0 V_j at rest and c_V V where the rotor adds nothing.  Between the two ::

    V_j = V + (y - c_V / c_0 V) (1 + bend V / sqrt(y^2 + V^2))        y = q / c_0

which follows the solved flow within 0.5 %.

At light load the flow goes round the outer nose, and its suction there carries the drag of the rest of the wall.  A
boundary layer that leaves the nose puts base pressure in the place of that suction (the leading edge's suction lost;
Kuechemann and Weber 1953, ch. 4, not checked): `JetArea.nose` has what is lost.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from bemt.base.arrays import Array
from geometry.duct import Duct

# Fewer than a hundred unknowns: beyond it a linear solver starts threads, which cost more than they save.
WALL_PANELS, BODY_PANELS = 26, 7
# Jet: panels grow by this ratio up to so many exit radii, beyond which a tube does nothing at the exit.
_GROWTH, _REACH = 1.18, 40.0
# Beyond so many exit radii the sheet has the strength that it has far behind.
_SETTLED = 10.0
# Speed ratios V / V_j at which the bend is fitted, and steps in which the sheet finds its strength.
_NU = (0.2, 0.4, 0.6, 0.8)
_STEPS, _TOL = 200, 1e-9
# A sheet is never slower than this share of the sum of both speeds: keeps the first steps bounded.
_SLOWEST = 0.15
# Noses of hubs over their radius, tails beyond the exit over the radius there: declared.
NOSE, TAIL = 1.5, 3.0
# Fall of pressure behind a wall that the stream has left, over 1/2 rho V^2 (Hoerner 1965, Fluid-Dynamic Drag, ch. 3;
# not checked).
BASE_PRESSURE = 0.15
# Speed ratios V / V_j at which the suction of the outer nose is kept; there is none in a slower stream.
NOSE_NU = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
# Outside of these no duct is known; the potential flow of a shape that closes its own exit.
_RANGE = (0.5, 1.5)
_FAR = np.polynomial.legendre.leggauss(3)
_NEAR = np.polynomial.legendre.leggauss(10)


class JetArea(NamedTuple):
    """Area of the jet far behind over the exit's: ``at_rest``, and ``in_stream`` where the rotor adds nothing.

    ``bend`` is how far the jet's speed between the two is from a straight line; see the head of the module. ``nose``
    is the drag over 1/2 rho V^2 times the bore's radius squared of an outer nose whose suction is lost, at `NOSE_NU`;
    () where the outer wall is not stated.
    """

    at_rest: float
    in_stream: float
    bend: float
    nose: tuple[float, ...]


def jet_area(duct: Duct, hub_radius: float) -> JetArea:
    """Jet area over exit area, and the bend of the jet's speed over the flow through the exit. [1]"""
    walls = (duct.length, duct.lip_radius, duct.lip_length, duct.exit_radius, duct.exit_hub_radius, duct.rotor_x,
             duct.bore_end, duct.te_thickness, hub_radius, duct.outer_radius)  # fmt: skip
    over_bore = tuple(round(float(v or 0.0) / duct.inner_radius, 9) for v in walls)
    return _solved(*over_bore)


@lru_cache(maxsize=512)
def _solved(
    length: float, lip: float, lip_length: float, exit_radius: float, exit_hub: float, rotor_x: float, bore_end: float,
    te: float, hub: float, outer: float,
) -> JetArea:  # fmt: skip
    duct = Duct(1.0, length, lip, 0.0, exit_radius, exit_hub, rotor_x, None, lip_length / lip if lip > 0.0 else 1.0,
                bore_end, te, outer or None)  # fmt: skip
    stream = Stream.around(duct, hub)
    in_stream, at_rest = (float(np.clip(stream.through(nu) / duct.exit_area, *_RANGE)) for nu in (1.0, 0.0))
    nu = np.array(_NU)
    y = np.array([stream.through(v) for v in _NU]) / duct.exit_area / at_rest
    straight = y - in_stream / at_rest * nu
    off, per = 1.0 - nu - straight, straight * nu / np.hypot(y, nu)
    nose = tuple(stream.lost(v) for v in NOSE_NU) if outer else ()
    return JetArea(at_rest, in_stream, float(np.clip(off @ per / (per @ per), -0.5, 0.5)), nose)


class Stream(NamedTuple):
    """Flow through a duct as far as it is linear: what the stream and each ring of the jet's sheet do."""

    exit_in_stream: float  # Stream function of the duct's wall in a stream of 1, no jet
    exit_of_sheet: Array  # The same of each panel of the sheet alone, (S,)
    sheet_in_stream: Array  # Mean velocity on the sheet in a stream of 1, no jet, (S, 2)
    sheet_of_sheet: Array  # The same of each panel alone, (S, S, 2)
    settled: Array  # Panels far behind, (S,)
    nose: Array  # Speed along the panels of the outer nose in a stream of 1 and of each panel of the sheet, (K, 1 + S)
    nose_area: Array  # What these panels close of the view from ahead, (K,)

    @classmethod
    def around(cls, duct: Duct, hub: float) -> Stream:
        """Solve walls and body for the stream and for each panel of the sheet."""
        wall = _wall(duct)
        bodies = [wall] + ([_body(duct, hub)] if hub > 0.0 else [])
        at = np.concatenate([0.5 * (b[1:] + b[:-1]) for b in bodies])
        n, m = at.shape[0], wall.shape[0] - 1
        radius = wall[0, 1]
        first = float(np.hypot(*(wall[-1] - wall[-2])))
        steps = int(np.ceil(np.log1p(_REACH * radius * (_GROWTH - 1.0) / first) / np.log(_GROWTH)))
        x = duct.length + first * np.concatenate([[0.0], np.cumsum(_GROWTH ** np.arange(steps))])
        sheet = np.stack([x, np.full(x.size, radius)], axis=1)
        on = 0.5 * (sheet[1:] + sheet[:-1])
        A = np.zeros((n + 1, n + 1))
        A[:n, :n] = np.concatenate([_stream(at, b) for b in bodies], axis=1)
        A[:m, n] = -1.0
        A[n, [0, m - 1]] = 1.0  # both sides of the trailing edge feed the jet's sheet
        rhs = np.zeros((n + 1, 1 + steps))
        rhs[:n, 0] = -0.5 * at[:, 1] ** 2
        rhs[:n, 1:] = -_stream(at, sheet)
        rhs[n, 1] = 1.0
        found = np.linalg.solve(A, rhs)
        by_walls = np.einsum("skx,kc->scx", np.concatenate([_velocity(on, b) for b in bodies], axis=1), found[:n])
        by_walls[:, 0, 0] += 1.0
        by_walls[:, 1:] += _velocity(on, sheet)
        settled = on[:, 0] - x[0] > _SETTLED * radius
        nose = slice(int(np.argmin(wall[:, 0])), int(np.argmax(wall[:, 1])))
        area = np.pi * np.diff(wall[:, 1] ** 2)[nose]
        return cls(float(found[n, 0]), found[n, 1:], by_walls[:, 0], by_walls[:, 1:], settled, found[nose], area)

    def strength(self, nu: float) -> Array:
        """Strength of the sheet's panels in a stream of ``nu`` with a jet of 1, (S,)."""
        head, far = 0.5 * (1.0 - nu * nu), 1.0 - nu
        gamma = np.full(self.settled.size, far)
        for _ in range(_STEPS):
            mean = np.hypot(*(nu * self.sheet_in_stream + np.einsum("sjx,j->sx", self.sheet_of_sheet, gamma)).T)
            new = np.where(self.settled, far, head / np.maximum(mean, _SLOWEST * (1.0 + nu)))
            step = 0.5 * (new - gamma)
            gamma = gamma + step
            if np.max(np.abs(step)) < _TOL:
                break
        return gamma

    def through(self, nu: float) -> float:
        """Volume flow through the exit in a stream of ``nu`` with a jet of 1."""
        return float(2.0 * np.pi * (nu * self.exit_in_stream + self.exit_of_sheet @ self.strength(nu)))

    def lost(self, nu: float) -> float:
        """Suction of the outer nose beyond base pressure, over 1/2 rho V^2, in a stream of ``nu`` with a jet of 1."""
        speed = self.nose[:, 0] * nu + self.nose[:, 1:] @ self.strength(nu)
        return float(np.maximum((speed / nu) ** 2 - 1.0 - BASE_PRESSURE, 0.0) @ self.nose_area)


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


def _velocity(at: Array, nodes: Array) -> Array:
    """Axial and radial velocity at (M, 2) points per unit strength of each panel, on it the mean, (M, N, 2)."""
    a, b = nodes[:-1], nodes[1:]
    L = np.hypot(*(b - a).T)
    middle = 0.5 * (a + b)
    x, r = at[:, None, 0], at[:, None, 1]
    out = np.zeros((at.shape[0], L.size, 2))
    for t, w in zip(0.5 * (1.0 + _FAR[0]), 0.5 * _FAR[1], strict=True):
        q = a + t * (b - a)
        out += (w * L)[:, None] * _ring_velocity(x, r, q[None, :, 0], q[None, :, 1])
    away = np.hypot(x - middle[None, :, 0], r - middle[None, :, 1])
    own = away < 1e-9 * L[None, :]
    i, j = np.nonzero((away < 3.0 * L[None, :]) & ~own)
    near = np.zeros((i.size, 2))
    for t, w in zip(0.5 * (1.0 + _NEAR[0]), 0.5 * _NEAR[1], strict=True):
        q = a[j] + t * (b[j] - a[j])
        near += (w * L[j])[:, None] * _ring_velocity(at[i, 0], at[i, 1], q[:, 0], q[:, 1])
    out[i, j] = near
    i, j = np.nonzero(own)
    # a cylinder on itself: u = (ln(8 r / d) - 1) / (4 pi r) at the axial distance d
    out[i, j, 0] = L[j] / (4.0 * np.pi * middle[j, 1]) * np.log(16.0 * middle[j, 1] / L[j])
    out[i, j, 1] = 0.0
    return out


def _ring_velocity(x: Array, r: Array, x1: Array, r1: Array) -> Array:
    """Axial and radial velocity of a ring of unit circulation (Lamb 1932, Hydrodynamics, art. 161, differentiated)."""
    from scipy.special import ellipe, ellipk

    dx = x - x1
    far, near = (r + r1) ** 2 + dx**2, np.maximum((r - r1) ** 2 + dx**2, 1e-18)
    m = np.clip(4.0 * r * r1 / far, 0.0, 1.0 - 1e-15)
    K, E, size = ellipk(m), ellipe(m), 0.5 / (np.pi * np.sqrt(far))
    along = size * (K + (r1**2 - r**2 - dx**2) / near * E)
    return np.stack([along, size * dx / r * ((r1**2 + r**2 + dx**2) / near * E - K)], axis=-1)

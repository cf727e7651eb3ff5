"""Lift of an endless row of equal sections in potential flow: exact for plates, by vortex panels for any section.

A row has the spacing ``t``; ``solidity`` is chord / t, ``stagger`` the angle from the row's normal (the rotor axis) to
the chord. Angles of attack count from the mean of the velocities far ahead of the row and far behind it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil

PANELS = 72
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(3)


class RowLift(NamedTuple):
    """cl = 2 pi slope sin(alpha - zero)."""

    slope: float
    zero: float


def weinig_factor(solidity: Array, stagger: Array) -> Array:
    """Lift-slope ratio of an infinite row of flat plates to a single one, (N,) [1].

    Conformal mapping of the row on a circle, Weinig (1935), "Die Stroemung um die Schaufeln von Turbomaschinen"; in
    the form of Scholz (1965), "Aerodynamik der Schaufelgitter", ch. 3.  Checked in the tests against a vortex sheet
    solution and the closed forms (2/pi s) tanh(pi s / 2) at stagger 0 and (2/pi s) tan(pi s / 2) at 90 deg.

    >>> round(float(weinig_factor(np.array([1.0]), np.array([0.0]))[0]), 4)
    0.5839
    """
    s = np.maximum(np.asarray(solidity, dtype=float), 1e-4)
    lam = np.clip(np.asarray(stagger, dtype=float), -1.55, 1.55)
    s, lam = np.broadcast_arrays(s, lam)
    lo = np.full(s.shape, 1e-9)  # log(R)
    hi = np.full(s.shape, 12.0)
    for _ in range(80):
        mid = 0.5 * (lo + hi)
        large = _plate_solidity(np.exp(mid), lam) > s
        lo = np.where(large, mid, lo)
        hi = np.where(large, hi, mid)
    R = np.exp(0.5 * (lo + hi))
    chi = np.arctan(np.tan(lam) * (R**2 - 1.0) / (R**2 + 1.0))
    return np.asarray(4.0 * R * np.cos(chi) / (np.pi * s * np.cos(lam) * (R**2 + 1.0)))


def _plate_solidity(R: Array, lam: Array) -> Array:
    chi = np.arctan(np.tan(lam) * (R**2 - 1.0) / (R**2 + 1.0))
    c = 2.0 * R * np.cos(chi)
    log = np.log((R**2 + c + 1.0) / (R**2 - c + 1.0))
    return np.asarray((np.cos(lam) * log + 2.0 * np.sin(lam) * np.arctan2(2.0 * R * np.sin(chi), R**2 - 1.0)) / np.pi)


class _Shape:
    """A section that hashes by its shape, so that equal ones are solved once."""

    def __init__(self, section: Airfoil) -> None:
        self.section = section
        self.key = section.key()

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shape) and self.key == other.key


@lru_cache(maxsize=256)
def _panels(shape: _Shape) -> tuple[NDArray[np.complex128], Array]:
    """Outline from the trailing edge (closed) over the upper side and back, and its influence on itself."""
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, PANELS // 2 + 1)))
    upper, lower = shape.section.surfaces(x)
    shut = 0.5 * x * (upper[-1] - lower[-1])
    upper, lower = upper - shut, lower + shut
    z = np.concatenate([x[::-1] + 1j * upper[::-1], x[1:] + 1j * lower[1:]])
    return z, _own(z)


def _own(z: NDArray[np.complex128]) -> Array:
    """(N, N) stream function at the nodes per unit vorticity at the nodes, linear between them, times 2 pi."""
    a, d = z[:-1], np.diff(z)
    L = np.abs(d)
    local = (z[:, None] - a[None, :]) * np.conj(d / L)[None, :]
    X, Y = local.real, np.abs(local.imag)

    def first(u: Array) -> Array:
        w = u**2 + Y**2
        return np.asarray(0.5 * u * np.log(np.maximum(w, 1e-300)) - u + Y * np.arctan2(u, Y))

    def second(u: Array) -> Array:
        w = u**2 + Y**2
        return np.asarray(0.25 * (w * np.log(np.maximum(w, 1e-300)) - u**2))

    G0 = first(X) - first(X - L)
    G1 = (X * G0 - (second(X) - second(X - L))) / L
    out = np.zeros((z.size, z.size))
    out[:, :-1] += G0 - G1
    out[:, 1:] += G1
    return out


def _others(z: NDArray[np.complex128], period: complex) -> Array:
    """What all other blades add to :func:`_own`: log |sinh(zeta) / zeta|, zeta = pi (z - z') i / period."""
    turned = (1j * np.pi / period) * z
    a, d = turned[:-1], np.diff(turned)
    L = np.abs(np.diff(z))
    u, v = turned.real[:, None], turned.imag[:, None]
    sin, cos = np.sin(v), np.cos(v)
    out = np.zeros((z.size, z.size))
    for x, w in zip(0.5 * (1.0 + _GAUSS_X), 0.5 * _GAUSS_W, strict=True):
        at = a + x * d
        across = u - at.real
        size2 = across**2 + (v - at.imag) ** 2
        # |sinh(p + i q)|^2 = sinh^2 p + sin^2 q; the sine of a difference needs none of each pair
        ratio2 = np.sinh(across) ** 2 + (sin * np.cos(at.imag) - cos * np.sin(at.imag)) ** 2
        ratio2 /= np.maximum(size2, 1e-12)
        ratio2[size2 < 1e-12] = 1.0
        value = np.log(ratio2, out=ratio2) * (0.5 * w * L)
        out[:, :-1] += (1.0 - x) * value
        out[:, 1:] += x * value
    return out


@lru_cache(maxsize=16384)
def _solve(shape: _Shape, solidity: float, stagger: float) -> RowLift:
    z, own = _panels(shape)
    n = z.size
    psi = own.copy()
    if solidity > 0.0:
        # the row runs along +i in the frame of the rotor; the chord lies along +1 here
        psi += _others(z, 1j * np.exp(-1j * stagger) / solidity)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = psi / (2.0 * np.pi)
    A[:n, n] = -1.0
    rhs = np.zeros((n + 1, 2))
    rhs[:n, 0], rhs[:n, 1] = -z.imag, z.real
    # both ends of the outline are one point: its second equation gives way to a smooth mean of both sides
    A[n - 1, :] = 0.0
    A[n - 1, [0, 1, 2, n - 3, n - 2, n - 1]] = 1.0, -2.0, 1.0, -1.0, 2.0, -1.0
    rhs[n - 1] = 0.0
    A[n, [0, n - 1]] = 1.0
    gamma = np.linalg.solve(A, rhs)[:n]
    L = np.abs(np.diff(z))
    along, across = 2.0 * (0.5 * (gamma[1:] + gamma[:-1]) * L[:, None]).sum(axis=0)
    return RowLift(float(np.hypot(along, across) / (2.0 * np.pi)), float(-np.arctan2(along, across)))


def row_lift(section: Airfoil, solidity: float, stagger: float) -> RowLift:
    """Lift of a section in a row, in potential flow.

    Vortex panels of linear strength on the outline, constant stream function on it, equal and opposite strength at
    the trailing edge (Drela 1989, Lect. Notes Eng. 54, eq. 1-6, for one section); the other blades of the row add
    log |sinh(zeta) / zeta| to the kernel (Martensen 1959, Arch. Rat. Mech. Anal. 3:235, has its derivative).

    >>> import numpy as np
    >>> from geometry.airfoil import naca4
    >>> section = naca4(0.05, 0.45, 0.09)
    >>> for solidity in (0.0, 1.0):
    ...     slope, zero = row_lift(section, solidity, np.radians(58.0))
    ...     print(round(slope, 2), round(float(np.degrees(zero)), 1))
    1.08 -5.5
    1.02 -3.8
    """
    return _solve(_Shape(section), float(solidity), float(stagger))


# Nodes of `row_shift`: solidity, stagger [rad]. The shape between them is smooth; each is solved once.
_STEP = 0.125, np.radians(5.0)
_LAST = 32, 17  # of nodes, as multiples of the steps: solidity 4, stagger 85 deg
# Passages narrower than this many thicknesses of the blade are no rotor: the row is held where they would be.
_NARROWEST = 1.5


def row_shift(section: Airfoil, solidity: Array, stagger: Array) -> tuple[Array, Array]:
    """Slope of the row over that of the section alone (N,) and shift of the zero-lift angle (N,) [rad].

    Cubic between rows solved at fixed nodes, so that a station does not depend on its neighbours; held at solidity 4,
    stagger 85 deg and where blades would nearly touch.
    """
    x, y = (np.asarray(v, dtype=float) for v in (solidity, stagger))
    slope, zero = _shifts(_Shape(section), x.tobytes(), y.tobytes())
    return slope.copy(), zero.copy()


@lru_cache(maxsize=256)
def _shifts(shape: _Shape, solidity: bytes, stagger: bytes) -> tuple[Array, Array]:
    """The same of one blade, which is asked for again with every effect on it."""
    x = np.clip(np.frombuffer(solidity), 0.0, _LAST[0] * _STEP[0]) / _STEP[0]
    y = np.clip(np.frombuffer(stagger), -_LAST[1] * _STEP[1], _LAST[1] * _STEP[1]) / _STEP[1]
    i = np.clip(np.floor(x).astype(int) - 1, 0, _LAST[0] - 3)
    j = np.clip(np.floor(y).astype(int) - 1, -_LAST[1], _LAST[1] - 3)
    wx, wy = _cubic(x - i), _cubic(y - j)
    m, n = np.broadcast_arrays(i[:, None, None] + np.arange(4)[:, None], j[:, None, None] + np.arange(4))
    own = _solved(shape)
    new = np.isnan(own[m, n, 0])
    for node in set(zip(m[new].tolist(), n[new].tolist(), strict=True)):
        own[node] = _node(shape, *node)
    value, out = own[m, n], np.zeros((2, x.size))
    for k in range(4):
        for at in range(4):
            out += (wx[k] * wy[at])[None, :] * value[:, k, at].T
    return out[0], out[1]


@lru_cache(maxsize=256)
def _solved(shape: _Shape) -> Array:
    """Values of :func:`_node` at its two numbers, negative ones from the end; NaN where nobody asked yet."""
    return np.full((_LAST[0] + 1, 2 * _LAST[1] + 1, 2), np.nan)


def _cubic(t: Array) -> Array:
    """(4, N) Lagrange weights of the nodes 0 to 3."""
    a, b, c = t - 1.0, t - 2.0, t - 3.0
    return np.array([-a * b * c / 6.0, t * b * c / 2.0, -t * a * c / 2.0, t * a * b / 6.0])


def _node(shape: _Shape, i: int, j: int) -> tuple[float, float]:
    stagger = j * _STEP[1]
    solidity = min(i * _STEP[0], float(np.cos(stagger)) / (_NARROWEST * max(shape.section.thickness, 0.02)))
    alone, row = _solve(shape, 0.0, 0.0), _solve(shape, solidity, stagger)
    return row.slope / alone.slope, row.zero - alone.zero

"""Wake of the truth: discrete helical vortices behind each blade, and what they induce at the lifting lines.

Each blade sheds one filament per panel edge.  All filaments of a rotor share one advance h per radian (a regular
helicoid, Betz's condition) and one contraction; both follow the load, so the influence of a wake is a table over (h,
load) that depends on the blade count and the panel radii only.  Biot-Savart on straight segments; the part of
the wake beyond `REACH` radii counts as a vortex tube.

References
----------
.. [1] A. J. Landgrebe, "The wake geometry of a hovering helicopter rotor and its influence on rotor performance",
       J. American Helicopter Society 17(4), 1972: r/R = A + (1 - A) exp(-Lambda psi), A = 0.78, and a wake that
       speeds up behind the next blade (coefficients not checked against the paper).
.. [2] A. Betz, "Schraubenpropeller mit geringstem Energieverlust", 1919.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bemt.base.arrays import Array

H_GRID: Array = np.geomspace(0.02, 2.0, 21)
"""Advance of the wake per radian over the tip radius. [-]"""
LOADS: Array = np.array([0.0, 0.2, 0.45, 0.72, 1.0])
"""Share of the induced speed in the speed of the wake: 0 cruise, 1 hover. [-]"""
REACH = 5.0
HOVER_CONTRACTION = 0.78  # [1]
# Axial speed over the mean induced one, before and after the next blade has passed.  The tip vortex dwells under its
# blade [1: 0.25 CT/sigma over sqrt(CT/2), CT/sigma of 0.05 to 0.15]; then it goes at half the speed of the stream that
# it bounds, which continuity gives: 1 / contraction^2.  The inner sheet goes with that stream.
STREAM = 1.0 / HOVER_CONTRACTION**2
TIP_SPEEDS = (0.3, 0.5 * STREAM)
SHEET_SPEEDS = (1.1, STREAM)
ROLL_UP = (0.78, 0.92)  # r/R where filaments belong to the sheet and to the tip vortex
_RATE = 0.35  # Lambda of [1] is 0.145 + 27 CT_rotor per radian, at CT_rotor = 0.0076
_CORE = 0.01  # viscous core over tip radius


def edges_and_centres(hub: float, panels: int) -> tuple[Array, Array]:
    """Panel edges and control radii from hub to tip, finer at both ends."""
    half = np.arange(2 * panels + 1) * (np.pi / (2 * panels))
    x = hub + (1.0 - hub) * 0.5 * (1.0 - np.cos(half))
    return x[::2], x[1::2]


def _ages(h: float) -> Array:
    """Wake ages of the segment ends [rad]: fine behind the blade, coarser where the wake is far."""
    near = np.concatenate(([0.0], np.cumsum(np.geomspace(0.02, 0.25, 60))))
    last = max(REACH / h, near[-1] + 1.0)
    return np.concatenate((near, np.linspace(near[-1], last, max(int((last - near[-1]) / 0.45), 2) + 1)[1:]))


def _path(edges: Array, psi: Array, blades: int, load: float) -> tuple[Array, Array]:
    """Radius over the one at birth and axial way over h, (E, S), of the filaments at the given wake ages."""
    final = 1.0 - (1.0 - HOVER_CONTRACTION) * (1.0 - np.sqrt(1.0 / (1.0 + load))) / (1.0 - np.sqrt(0.5))
    shrink = final + (1.0 - final) * np.exp(-_RATE * psi)
    late = np.maximum(psi - 2.0 * np.pi / blades, 0.0)
    tip = TIP_SPEEDS[0] * (psi - late) + TIP_SPEEDS[1] * late
    sheet = SHEET_SPEEDS[0] * (psi - late) + SHEET_SPEEDS[1] * late
    w = np.clip((edges - ROLL_UP[0]) / (ROLL_UP[1] - ROLL_UP[0]), 0.0, 1.0)[:, None]
    way = (1.0 - load) * psi[None, :] + load * (w * tip[None, :] + (1.0 - w) * sheet[None, :])
    return np.broadcast_to(shrink, way.shape), way


def _influence(x: Array, edges: Array, births: Array, blades: int, h: float, load: float) -> tuple[Array, Array]:
    """Axial and tangential speed at radii x from unit filaments (N, E), length unit R, per unit circulation.

    ``births`` are the radii where the filaments begin; ``edges`` decide how they move.
    """
    psi = _ages(h)
    shrink, way = _path(edges, psi, blades, load)
    r, z = births[:, None] * shrink, h * way
    axial, tangential = np.zeros((x.size, edges.size)), np.zeros((x.size, edges.size))
    for b in range(blades):
        angle = 2.0 * np.pi * b / blades - psi
        px, py = r * np.cos(angle), r * np.sin(angle)
        ax, ay, az = px[:, :-1], py[:, :-1], z[:, :-1]
        dx, dy, dz = np.diff(px), np.diff(py), np.diff(z)
        for i, radius in enumerate(x):
            # from the point to both ends; Biot-Savart of a straight segment with a core
            ux, uy, uz = ax - radius, ay, az
            vx, vy, vz = ux + dx, uy + dy, uz + dz
            cy, cz = uz * vx - ux * vz, ux * vy - uy * vx
            nu, nv = np.sqrt(ux * ux + uy * uy + uz * uz), np.sqrt(vx * vx + vy * vy + vz * vz)
            dot = ux * vx + uy * vy + uz * vz
            k = (nu + nv) / (nu * nv * (nu * nv + dot) + _CORE**2 * (nu * nv)) / (4.0 * np.pi)
            axial[i] += np.sum(k * cz, axis=1)
            tangential[i] += np.sum(k * cy, axis=1)
    # beyond the reach: a tube of rings, on its axis
    slope = (z[:, -1] - z[:, -2]) / (psi[-1] - psi[-2])
    tail = 0.5 * blades / (2.0 * np.pi * np.maximum(slope, 1e-9)) * (1.0 - z[:, -1] / np.hypot(z[:, -1], r[:, -1]))
    return -axial + tail[None, :], -tangential


def _horseshoe(filament: Array) -> Array:
    """Panels from filaments: circulation of a panel leaves at its outer edge and comes in at its inner one."""
    return filament[:, 1:] - filament[:, :-1]


@lru_cache(maxsize=64)
def wake_tables(hub: float, panels: int, blades: int, hovers: bool) -> tuple[Array, Array]:
    """Influence of the panels on each other over wake advance and load. [-]"""
    edges, x = edges_and_centres(hub, panels)
    loads = LOADS if hovers else np.array([0.0])
    out = np.empty((2, H_GRID.size, loads.size, panels, panels))
    for i, h in enumerate(H_GRID):
        for j, c in enumerate(loads):
            a, t = _influence(x, edges, edges, blades, float(h), float(c))
            out[0, i, j], out[1, i, j] = _horseshoe(a) * h, _horseshoe(t) * h
    return out[0], out[1]


@lru_cache(maxsize=32)
def image_tables(hub: float, panels: int, blades: int, wall: float) -> tuple[Array, Array]:
    """Influence of the image of the wake in a coaxial wall, without its mean axial flow.

    Notes
    -----
    The image of a filament at r is one of opposite sense at wall^2 / r.  Inside the tube of the images the mean axial
    speed is uniform and belongs to the duct's own rings, so it is taken out here.
    """
    edges, x = edges_and_centres(hub, panels)
    image = wall**2 / edges
    out = np.empty((2, H_GRID.size, 1, panels, panels))
    for i, h in enumerate(H_GRID):
        a, t = _influence(x, edges, image, blades, float(h), 0.0)
        mean = 0.5 * blades / (2.0 * np.pi * h)
        out[0, i, 0], out[1, i, 0] = -_horseshoe(a - mean) * h, -_horseshoe(t) * h
    return out[0], out[1]


def interpolate(table: Array, h: Array, load: Array) -> Array:
    """Influence matrices at the wakes of P points, (P, N, N) [-]."""
    u = np.clip(np.log(h / H_GRID[0]) / np.log(H_GRID[1] / H_GRID[0]), 0.0, H_GRID.size - 1.0001)
    i = u.astype(np.intp)
    f = (u - i)[:, None, None]
    if table.shape[1] == 1:
        out = (1.0 - f) * table[i, 0] + f * table[i + 1, 0]
    else:
        w = np.clip(np.interp(load, LOADS, np.arange(LOADS.size)), 0.0, LOADS.size - 1.0001)
        j = w.astype(np.intp)
        g = (w - j)[:, None, None]
        out = (1.0 - f) * ((1.0 - g) * table[i, j] + g * table[i, j + 1])
        out += f * ((1.0 - g) * table[i + 1, j] + g * table[i + 1, j + 1])
    return np.asarray(out / np.clip(h, H_GRID[0], H_GRID[-1])[:, None, None])

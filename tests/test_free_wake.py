"""The promise of the induced flow: loads of a free wake, 3 to 8 %.

Bound vortices on each blade, trailing vortices that start at its trailing edge and go where the flow takes them,
Biot-Savart on straight segments, section lift 2 pi: nothing of it is the solver's.  It settles after ten turns and then
swings, at rest, by one to three per cent; means are over the last turns.  Slow: two minutes.
"""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.effects import standard
from bemt.physics.sections.polars import linear_polar
from geometry.laws import chord_over_R
from geometry.rotor import Rotor, from_stations

pytestmark = pytest.mark.slow

HUB, SLOPE, STRIPS, PER_TURN, KEPT, CORE = 0.18, 6.16, 16, 24, 6, 0.05
OMEGA, AIR = 20.0, Air.from_density(1.2)
Array = np.ndarray


@njit(fastmath=True, error_model="numpy")  # coordinates in rows and no check for zero: the inner loop is vectorised
def _induced(points: Array, start: Array, end: Array, strength: Array, core: float, blades: int) -> Array:
    """Velocity (P, 3) of segments (S, 3) and their copies on the other blades."""
    out, p, q = np.zeros((len(points), 3)), np.ascontiguousarray(start.T), np.ascontiguousarray(end.T)
    for i in range(len(points)):
        for b in range(blades):
            c, s = np.cos(2.0 * np.pi * b / blades), np.sin(2.0 * np.pi * b / blades)
            # the copy is turned back, with the point
            px, py, pz = c * points[i, 0] + s * points[i, 1], c * points[i, 1] - s * points[i, 0], points[i, 2]
            ux = uy = uz = 0.0
            for k in range(len(strength)):
                ax, ay, az = px - p[0, k], py - p[1, k], pz - p[2, k]
                bx, by, bz = px - q[0, k], py - q[1, k], pz - q[2, k]
                a, e = np.sqrt(ax * ax + ay * ay + az * az), np.sqrt(bx * bx + by * by + bz * bz)
                along = (ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2
                near = a * e * (a * e + ax * bx + ay * by + az * bz) + core * core * along + 1e-14
                f = strength[k] * (a + e) / near / (4.0 * np.pi)
                ux += f * (ay * bz - az * by)
                uy += f * (az * bx - ax * bz)
                uz += f * (ax * by - ay * bx)
            out[i, 0] += c * ux - s * uy
            out[i, 1] += s * ux + c * uy
            out[i, 2] += uz
    return out


def _trailing(bound: Array) -> Array:
    """Strengths of the trailing vortices (..., N + 1) of bound ones (..., N), both away from the root."""
    edge = np.zeros((*bound.shape[:-1], 1))
    return -np.diff(bound, axis=-1, prepend=edge, append=edge)


def free_wake(
    B: int, edges: Array, chord: Array, beta: Array, alpha0: float, J: float, turns: int
) -> tuple[float, float]:
    """CT and CQ in rotor convention, radius and turning rate one, mean over the last turns."""
    r, dr, climb = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges), J / np.pi
    at_edges = np.interp(edges, r, chord), np.interp(edges, r, beta)
    behind, below = 0.75 * at_edges[0] * np.cos(at_edges[1]), 0.75 * at_edges[0] * np.sin(at_edges[1])
    dt, up = 2.0 * np.pi / PER_TURN, np.array([0.0, 0.0, 1.0])
    aged = np.zeros((0, edges.size, 3))  # wake, newest first
    shed = np.zeros((0, r.size))  # bound vortices when each row of it was new
    bound, history = np.zeros(r.size), []
    for step in range(turns * PER_TURN):
        out = np.array([np.cos(step * dt), np.sin(step * dt), 0.0])
        ahead = np.array([-out[1], out[0], 0.0])
        line = edges[:, None] * out
        wake = np.concatenate([(line - behind[:, None] * ahead - below[:, None] * up)[None], aged])
        old = _trailing(shed[1:]).ravel()
        at = r[:, None] * out
        far = _induced(at, wake[1:-1].reshape(-1, 3), wake[2:].reshape(-1, 3), old, CORE, B) if old.size else 0.0 * at
        legs = [line, *wake[: min(2, len(wake))]]
        near = np.zeros((r.size, 3, r.size))
        for j in range(r.size):
            one = np.eye(r.size)[j]
            pairs = [(a, b, _trailing(one)) for a, b in zip(legs[:-1], legs[1:], strict=True)]
            pairs.append((line[:-1], line[1:], one))
            for a, b, strength in pairs:
                near[:, :, j] += _induced(at, a, b, strength, 1e-3, B)
        for _ in range(30):  # Newton, on gamma = W c cl / 2
            u = far + near @ bound
            ut, un = r - u @ ahead, climb - u @ up
            W, alpha = np.hypot(ut, un), beta - np.arctan2(un, ut) - alpha0
            dut, dun = -np.einsum("ikj,k->ij", near, ahead), -near[:, 2]
            dW = (ut[:, None] * dut + un[:, None] * dun) / W[:, None]
            dphi = (ut[:, None] * dun - un[:, None] * dut) / (W * W)[:, None]
            slope = 0.5 * SLOPE * chord[:, None] * (dW * alpha[:, None] - W[:, None] * dphi)
            change = np.linalg.solve(np.eye(r.size) - slope, 0.5 * SLOPE * chord * W * alpha - bound)
            bound = bound + change
            if np.max(np.abs(change)) < 1e-9:
                break
        history.append((B * np.sum(bound * ut * dr) / np.pi, B * np.sum(bound * un * r * dr) / np.pi))
        # the row at the trailing edge carries today's strength, with the segments that lead to it
        segments = [(line[:-1], line[1:], bound), (line, wake[0], _trailing(bound))]
        rows = np.concatenate([bound[None], shed[1:]]) if len(shed) else shed
        segments.append((wake[:-1].reshape(-1, 3), wake[1:].reshape(-1, 3), _trailing(rows).ravel()))
        keep = wake[: KEPT * PER_TURN]
        speed = _induced(keep.reshape(-1, 3), *(np.concatenate(q) for q in zip(*segments, strict=True)), CORE, B)
        aged = keep + (speed.reshape(keep.shape) - climb * up) * dt
        shed = np.concatenate([bound[None], rows])[: KEPT * PER_TURN]
    CT, CQ = np.mean(history[-(turns - 8) * PER_TURN :], axis=0)
    return float(CT), float(CQ)


def annuli(B: int, r: Array, chord: Array, beta: Array, alpha0: float, J: float) -> tuple[float, float]:
    """The same from the solver."""
    keep = ("tip_loss", "hub_loss", "swirl", "high_induction")
    effects = [e for e in standard() if e.id in keep]
    prep = solver.prepare(
        Rotor(from_stations(r, chord, beta, 1.0, HUB), B), [(0.75, linear_polar(SLOPE, alpha0))], effects
    )
    sol = solver.solve(prep, OMEGA * 30.0 / np.pi, J * OMEGA / np.pi, AIR)
    unit = AIR.rho * np.pi * OMEGA**2
    return float(sol.T[0] / unit), float(sol.Q[0] / unit)


@pytest.mark.parametrize(
    ("B", "J", "shape"),
    [(2, 0.0, "flat"), (4, 0.0, "flat"), (2, 0.0, 0.5), (2, 0.3, 0.5), (2, 0.0, 0.8), (4, 0.0, 0.5), (4, 0.3, 0.5)],
)
def test_momentum_in_annuli_gives_the_loads_of_a_free_wake(B: int, J: float, shape: float | str) -> None:
    x = np.linspace(0.0, 1.0, STRIPS + 1)
    edges = HUB + (1.0 - HUB) * (1.0 - (1.0 - x) ** 1.6)
    r = 0.5 * (edges[1:] + edges[:-1])
    if isinstance(shape, str):  # hovering model rotor of Caradonna and Tung at 8 deg
        chord, beta, alpha0 = np.full(r.size, 1.0 / 6.0), np.full(r.size, np.radians(8.0)), 0.0
    else:  # propeller of constant pitch over diameter
        chord, beta = chord_over_R("apc_like", r, HUB), np.arctan(shape / (np.pi * r))
        alpha0 = np.radians(-3.5)
    free, ours = free_wake(B, edges, chord, beta, alpha0, J, 18), annuli(B, r, chord, beta, alpha0, J)
    # in flight within 1.6 %; at rest the wake contracts, which annuli do not know: free over ours 0.94 to 1.03 in
    # thrust, 0.93 to 1.02 in torque, lowest with four blades
    assert ours == pytest.approx(free, rel=0.03 if J else 0.08)

"""Meshes of ducts and stators: solids of revolution, straight vanes, a centre body that carries them.

Frame as in :mod:`geometry.mesh`: z upstream along the shaft, the blades' pitch axis at z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.airfoil import Airfoil, naca4
from geometry.common import Array, GeometryError
from geometry.duct import Duct, Stator
from geometry.solid import Mesh, Options, as_solid, check_closed, join, profile_volume, revolve, skin

CLEARANCE = 0.04  # axial distance of hub and centre body over the bore radius
THICKNESS = 0.10  # symmetric NACA section of vanes that have none: an assumption


@dataclass(frozen=True, eq=False)
class StatorPlan:
    """Where the vanes and their centre body lie."""

    stator: Stator
    front: float  # Leading edge behind the lip [m]
    back: float  # Trailing edge behind the lip [m]
    body_front: float  # Start of the centre body behind the lip [m]
    body_radius: float  # Of the centre body [m]
    section: Airfoil

    def outline(self, n: int) -> Array:
        """Return the vane's outline (n, 2): tangential coordinate and distance x behind the lip [m]."""
        s = self.section.repanel(n)
        chord, beta = self.stator.chord, self.stator.beta
        along, across = chord * s.x, chord * s.y
        x = self.front + along * math.sin(beta) - across * math.cos(beta)
        out: Array = np.stack([-along * math.cos(beta) - across * math.sin(beta), x], axis=1)
        out[:, 0] -= 0.5 * (out[:, 0].max() + out[:, 0].min())
        return out


def duct_profile(duct: Duct, n: int = 81) -> Array:
    """Closed outline of the duct's wall. [m]"""
    inner, outer = duct.profile(n)
    wall = outer[:, 1] - inner[:, 1]
    shared = wall[0] < 1e-9 * duct.inner_radius
    if wall[1:].min() <= 1e-6 * duct.inner_radius:
        raise GeometryError([("duct", f"a wall {wall[1:].min() * 1e3:.3g} mm thick", "a wall of positive thickness",
                              "Give te_thickness")])  # fmt: skip
    walls = np.vstack([inner[::-1], outer[1:] if shared else outer])
    before, after = walls - np.roll(walls, 1, axis=0), np.roll(walls, -1, axis=0) - walls
    bend = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    walls = walls[bend > 1e-12 * duct.length**2]  # points on straight walls say nothing
    out: Array = np.stack([walls[:, 1], duct._rotor - walls[:, 0]], axis=1)
    return out


def plan_stator(duct: Duct, hub_back: float, hub_radius: float) -> StatorPlan | None:
    """Place vanes and centre body behind the rotor."""
    if duct.stator is None:
        return None
    stator = duct.stator
    section = stator.section or naca4(0.0, 0.4, THICKNESS)
    gap = CLEARANCE * duct.inner_radius
    body = duct._rotor - hub_back + gap
    depth = stator.chord * abs(math.sin(stator.beta))
    room = duct.length - body
    front = body + min(gap, 0.25 * max(room - depth, 0.0)) if stator.x is None else stator.x
    back = front + depth
    if front < body or back > duct.length:
        at = f"vanes from {front * 1e3:.4g} to {back * 1e3:.4g} mm behind the lip"
        room_text = f"{body * 1e3:.4g} to {duct.length * 1e3:.4g} mm, between hub and exit"
        raise GeometryError([("stator", at, room_text, "A shorter vane chord or a longer duct")])
    return StatorPlan(stator, front, back, body, hub_radius, section)


def centre_body(duct: Duct, plan: StatorPlan) -> Array:
    """Outline of the body that carries the vanes: a cylinder, then an ellipse to the exit. [m]"""
    end, radius = duct.exit_hub_radius, plan.body_radius
    start = max(plan.body_front, 0.5 * (plan.front + plan.back))
    t = np.linspace(0.0, np.pi / 2, 33)[1:]
    x = start + (duct.length - start) * np.sin(t)
    r = end + (radius - end) * np.cos(t)
    r[-1] = end
    points = [(0.0, plan.body_front), (radius, plan.body_front), (radius, start), *zip(r, x, strict=True)]
    if end > 0:
        points.append((0.0, duct.length))
    out = np.array(points)
    out[:, 1] = duct._rotor - out[:, 1]
    return out


def duct_mesh(duct: Duct, plan: StatorPlan | None, options: Options | None = None) -> tuple[Mesh, float]:
    """Mesh the duct, with vanes and centre body when there is a stator.

    >>> mesh, volume = duct_mesh(Duct(0.035, 0.06, 0.004, 0.0004), None)
    >>> mesh.names, abs(mesh.volume / volume - 1) < 1e-4
    (('duct',), True)
    """
    options = options or Options()
    count = options.segments * 3 // 2
    if plan is not None:
        count = plan.stator.B * math.ceil(count / plan.stator.B)
    profile = duct_profile(duct)
    vertices, faces = revolve(profile, count)
    volume = profile_volume(profile)
    if plan is None:
        mesh = Mesh(vertices, faces, np.zeros(len(faces), np.int64), ("duct",))
        check_closed(mesh, "duct", bodies=1)
        return mesh, volume
    wall = as_solid(vertices, faces, "duct")
    vane = as_solid(*skin(vane_rows(duct, plan, options)), "stator")
    body = as_solid(*revolve(centre_body(duct, plan), count // 2), "stator")
    copies = [("stator", vane.rotate([0.0, 0.0, 360.0 * k / plan.stator.B])) for k in range(plan.stator.B)]
    mesh = join([("duct", wall), *copies, ("stator", body)], "duct")
    check_closed(mesh, "duct with stator", bodies=1)
    return mesh, volume


def _body_radius(duct: Duct, plan: StatorPlan, x: Array) -> Array:
    profile = centre_body(duct, plan)[1:]
    if duct.exit_hub_radius > 0:
        profile = profile[:-1]
    out: Array = np.interp(x, duct._rotor - profile[:, 1], profile[:, 0])
    return out


def vane_rows(duct: Duct, plan: StatorPlan, options: Options) -> Array:
    """Outlines of one vane, (3, m, 3): inside the body, between, and in the middle of the wall. [m]"""
    section = plan.outline(options.n)
    if np.linalg.norm(section[0] - section[-1]) < 1e-6 * plan.stator.chord:
        section = section[:-1]
    t, x = section.T
    foot = 0.7 * _body_radius(duct, plan, x)
    tip = 0.5 * (duct.inner(x) + duct.outer(x))
    wide = float(np.abs(t).max())
    if wide > 0.9 * float(foot.min()):
        raise GeometryError([("stator", f"vanes {2 * wide * 1e3:.3g} mm wide at a body of radius "
                              f"{plan.body_radius * 1e3:.3g} mm", "vanes that stand on the body",
                              "A shorter vane chord or a wider hub")])  # fmt: skip
    rows = []
    for w in (0.0, 0.5, 1.0):
        rho = (1 - w) * foot + w * tip
        rows.append(np.stack([np.sqrt(rho**2 - t**2), t, duct._rotor - x], axis=1))
    return np.stack(rows)

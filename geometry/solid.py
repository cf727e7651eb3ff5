"""Closed triangle meshes with named surfaces: skins, solids of revolution, exact unions, the checks of a solid.

Lengths in metres; the shaft is the z axis. The union is that of manifold3d, the checks are those of trimesh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.airfoil import Airfoil, naca4
from geometry.common import Array, Faults, GeometryError, needs
from geometry.duct import Duct, Stator

if TYPE_CHECKING:
    from geometry.printed import Printed


Faces = NDArray[np.int64]


@dataclass(frozen=True)
class Options:
    """How fine a solid is made, and what it must keep.

    >>> Options(n=61).tolerance
    0.0004
    """

    n: int = 101  # Points of a section, odd, 21 or more
    # Greatest error of chord and blade angle between two rings, of their value; 2e-3 or less keeps the promise [-]
    tolerance: float = 4e-4
    segments: int = 240  # Facets round hub and duct, at least
    fillet: float = 0.0  # Radius of the fillet between blade and hub; 0 is none [m]
    min_thickness: float = 0.0  # Smallest section thickness that is let pass; 0 lets all pass [m]
    printed: Printed | None = None  # What a printer needs; None leaves the rotor as its sections say

    def __post_init__(self) -> None:
        faults = Faults()
        if self.n < 21 or self.n % 2 == 0:
            faults.add("n", f"{self.n}", "an odd number of points, 21 or more")
        faults.number("tolerance", self.tolerance, 1e-6, 0.05)
        faults.number("segments", self.segments, 12, 20000)
        faults.number("fillet", self.fillet, 0.0, 1.0, "m")
        faults.number("min_thickness", self.min_thickness, 0.0, 1.0, "m")
        faults.check()


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh whose faces carry names."""

    vertices: Array  # (N, 3) corners [m]
    faces: Faces  # (M, 3) corners of each face, counter-clockwise seen from outside
    group: NDArray[np.int64]  # (M,) index into `names` of each face
    names: tuple[str, ...]  # Surfaces: blade, hub, duct, stator

    @property
    def volume(self) -> float:
        """Enclosed volume by the divergence theorem [m^3]."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)

    def area(self, name: str) -> float:
        """Return the area of one named surface [m^2]."""
        a, b, c = (self.vertices[self.faces[self.group == self.names.index(name), k]] for k in range(3))
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    def part(self, name: str) -> Faces:
        """Return the faces of one named surface."""
        out: Faces = self.faces[self.group == self.names.index(name)]
        return out

    def trimesh(self) -> Any:
        """Return the mesh as a ``trimesh.Trimesh``, vertices untouched."""
        trimesh = needs("trimesh", "cad")

        return trimesh.Trimesh(self.vertices, self.faces, process=False)


def skin(points: Array) -> tuple[Array, Faces]:
    """Mesh rings of one topology, with caps at both ends; the result is oriented outwards."""
    rows, m = points.shape[:2]
    index = np.arange(rows * m).reshape(rows, m)
    a, b = index[:-1], index[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = [np.stack([a, a1, b1], -1).reshape(-1, 3), np.stack([a, b1, b], -1).reshape(-1, 3)]
    k = np.arange((m + 1) // 2)  # pairs k and -1-k; an even m is a sharp edge, whose pair is itself
    last = (m - 1 - k) if m % 2 else (m - k) % m
    cap = []
    for i in range(len(k) - 1):
        cap += [(k[i], last[i + 1], k[i + 1]), (k[i], last[i], last[i + 1])]
    if m % 2 == 0:
        cap.append((k[-1], last[-1], m // 2))
    strip = np.array([t for t in cap if len(set(t)) == 3])
    faces += [index[0][strip], index[-1][strip[:, ::-1]]]
    vertices, out = points.reshape(-1, 3), np.concatenate(faces)
    if Mesh(vertices, out, np.zeros(len(out), np.int64), ("",)).volume < 0:
        out = out[:, ::-1]
    return vertices, out


def revolve(profile: Array, segments: int) -> tuple[Array, Faces]:
    """Mesh the solid of revolution of a closed profile; points on the axis become poles."""
    scale = math.sqrt((2 * math.pi / segments) / math.sin(2 * math.pi / segments))  # keeps areas, hence volumes
    angle = 2 * math.pi * np.arange(segments) / segments
    ids, vertices = [], []
    count = 0
    for rho, z in profile:
        if rho < 1e-12:
            ids.append(np.full(segments, count))
            vertices.append(np.array([[0.0, 0.0, z]]))
        else:
            ids.append(count + np.arange(segments))
            ring = [rho * scale * np.cos(angle), rho * scale * np.sin(angle), np.full(segments, z)]
            vertices.append(np.stack(ring, axis=1))
        count += len(vertices[-1])
    faces = []
    for a, b in zip(ids, ids[1:] + ids[:1], strict=True):
        a1, b1 = np.roll(a, -1), np.roll(b, -1)
        faces += [np.stack([a, a1, b1], 1), np.stack([a, b1, b], 1)]
    out = np.concatenate(faces)
    out = out[(out[:, 0] != out[:, 1]) & (out[:, 1] != out[:, 2]) & (out[:, 2] != out[:, 0])]
    points = np.concatenate(vertices)
    if Mesh(points, out, np.zeros(len(out), np.int64), ("",)).volume < 0:
        out = out[:, ::-1]
    return points, out


def profile_volume(profile: Array) -> float:
    """Exact volume of revolution of a closed profile, a sum of cone frusta. [m^3]

    >>> round(profile_volume(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]])) / math.pi, 9)
    2.0
    """
    r, z = profile.T
    r1, z1 = np.roll(r, -1), np.roll(z, -1)
    return abs(float(np.pi / 3 * np.sum((z1 - z) * (r * r + r * r1 + r1 * r1))))


def as_solid(vertices: Array, faces: Faces, where: str) -> Any:
    """Make a ``manifold3d.Manifold`` of a closed surface."""
    manifold3d = needs("manifold3d", "cad")

    data = manifold3d.Mesh64(np.ascontiguousarray(vertices, dtype=np.float64), faces.astype(np.uint64))
    solid = manifold3d.Manifold(data)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        got = f"a surface that closes no volume ({solid.status().name})"
        raise GeometryError([(where, got, "a closed surface", "")])
    return solid.as_original()


def join(parts: Sequence[tuple[str, Any]], where: str, cut: Sequence[tuple[str, Any]] = ()) -> Mesh:
    """Join named solids and take others away; every face keeps the name of the solid that it comes from."""
    manifold3d = needs("manifold3d", "cad")

    total = manifold3d.Manifold.batch_boolean([solid for _, solid in parts], manifold3d.OpType.Add)
    for _, solid in cut:
        total -= solid
    parts = [*parts, *cut]
    if total.is_empty():
        raise GeometryError([(where, "solids whose union is empty", "solids that can be joined", "")])
    # Slivers below what files resolve would open a file's mesh when its corners are merged.
    box = np.array(total.bounding_box())
    total = total.simplify(1e-6 * float((box[3:] - box[:3]).max()))
    data = total.to_mesh64()
    names = tuple(dict.fromkeys(name for name, _ in parts))
    by_id = {solid.original_id(): names.index(name) for name, solid in parts}
    faces = np.asarray(data.tri_verts, dtype=np.int64)
    group = np.zeros(len(faces), np.int64)
    edges = np.asarray(data.run_index, dtype=np.int64) // 3
    for start, stop, key in zip(edges[:-1], edges[1:], data.run_original_id, strict=True):
        group[start:stop] = by_id[int(key)]
    vertices = np.asarray(data.vert_properties, dtype=np.float64)[:, :3]
    # Vertices that differ in their properties alone are one.
    root = np.arange(len(vertices))
    root[np.asarray(data.merge_from_vert, dtype=np.int64)] = np.asarray(data.merge_to_vert, dtype=np.int64)
    used, faces = np.unique(root[faces], return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3), group, names)


_SHORT = 0.03  # of a ray that crosses the whole mesh: 98 % of the places of a blade are thinner


def ray_thickness(vertices: Array, faces: Faces, points: Array, outward: Array) -> Array:
    """Length of the way through a closed mesh, straight in from points on its surface. (N,) [m]"""
    solid = as_solid(vertices, faces, "blade")
    reach = 2.0 * float(np.ptp(vertices, axis=0).max())
    skip = 1e-7 * reach
    out = np.full(len(points), math.inf)
    for i, (point, normal) in enumerate(zip(points, outward, strict=True)):
        for far in (_SHORT * reach, reach):  # a short ray meets few facets, and mostly the other side
            hits = solid.ray_cast(point - skip * normal, point - far * normal)
            if hits:
                out[i] = skip + min(hit.distance for hit in hits) * (far - skip)
                break
    return out


def check_closed(mesh: Mesh, where: str, bodies: int | None = None) -> None:
    """Check with trimesh that a mesh is a solid."""
    solid = mesh.trimesh()
    faults = Faults()
    if not np.isfinite(mesh.vertices).all():
        faults.add(where, "coordinates that are no numbers", "finite numbers")
    if not solid.is_watertight:
        faults.add(where, "a mesh with open edges", "a watertight mesh")
    if not solid.is_winding_consistent:
        faults.add(where, "faces that disagree on what is outside", "one winding")
    if mesh.volume <= 0:
        faults.add(where, f"a volume of {mesh.volume:g} m^3", "a positive volume")
    if bodies is not None and not faults.found and solid.body_count != bodies:
        faults.add(where, f"{solid.body_count} separate bodies", f"{bodies}", "Parts that do not touch?")
    faults.check()


# Meshes of ducts and stators: solids of revolution, straight vanes, a centre body that carries them.
#
# Frame as in :mod:`geometry.mesh`: z upstream along the shaft, the blades' pitch axis at z = 0.

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

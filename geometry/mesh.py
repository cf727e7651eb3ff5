"""Triangle meshes of rotors, ducts and stators, made of numbers: sections wrapped on cylinders, joined exactly.

Frame of every solid: the shaft is the z axis, z points in the direction of thrust (upstream), the pitch axis of blade 1
is the x axis. A duct's coordinate x (downstream from its lip) is ``z = rotor_x - x``. Lengths in metres.

A section of radius r lies on the cylinder of radius r, as blade element theory takes it: its chord is an arc. Volumes
are therefore integrals of section areas over r exactly, and the tip has the radius R everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.airfoil import Array, Faults, GeometryError, naca4
from geometry.blade import Blade
from geometry.duct import Duct
from geometry.rotor import Rotor

__all__ = ["Mesh", "Model", "Options", "build", "check_closed", "duct_mesh", "radii", "rotor_mesh", "wrapped_outline"]

Faces = NDArray[np.int64]
VOLUME_TOLERANCE = 5e-3
STATOR_CLEARANCE = 0.05  # axial distance of hub and centre body over R; an assumption where the stator has no position
STATOR_THICKNESS = 0.10  # symmetric NACA section where the stator has none


@dataclass(frozen=True)
class Options:
    """How fine a solid is made, and what it must keep.

    Parameters
    ----------
    n : int
        Points of a section, odd, 21 or more.
    tolerance : float
        Greatest error of chord and blade angle between two rings, of their value; 2e-3 or less keeps the promise. [-]
    segments : int
        Facets round hub and duct, at least.
    fillet : float
        Radius of the fillet between blade and hub; 0 is none. [m]
    min_thickness : float
        Smallest section thickness that is let pass; 0 lets all pass. [m]

    Examples
    --------
    >>> Options(n=61).tolerance
    0.0004
    """

    n: int = 101
    tolerance: float = 4e-4
    segments: int = 240
    fillet: float = 0.0
    min_thickness: float = 0.0

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
    """A closed triangle mesh whose faces carry names.

    Parameters
    ----------
    vertices : (N, 3) float
        Corners. [m]
    faces : (M, 3) int
        Corners of each face, counter-clockwise seen from outside.
    group : (M,) int
        Index into `names` of each face.
    names : tuple of str
        Surfaces: blade, hub, duct, stator.
    """

    vertices: Array
    faces: Faces
    group: NDArray[np.int64]
    names: tuple[str, ...]

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
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)


@dataclass(frozen=True, eq=False)
class Model:
    """Everything that is exported: the turning solid and the standing one.

    Parameters
    ----------
    rotor : Mesh
        Blades and hub.
    duct : Mesh or None
        Duct and stator.
    checks : mapping of str to float
        What was measured on the meshes, lengths in metres, volumes in cubic metres.
    """

    rotor: Mesh
    duct: Mesh | None = None
    checks: Mapping[str, float] = field(default_factory=dict)

    @property
    def parts(self) -> list[Mesh]:
        """The meshes that are there."""
        return [self.rotor] if self.duct is None else [self.rotor, self.duct]


def _offset(outline: Array, distance: float) -> Array:
    """Move a closed outline outwards along its normals (mean of the two edges at a corner, mitre up to 2)."""
    edge = np.roll(outline, -1, axis=0) - outline
    length = np.linalg.norm(edge, axis=1, keepdims=True)
    unit = edge / np.maximum(length, 1e-300)
    normal = np.stack([unit[:, 1], -unit[:, 0]], axis=1)
    area = np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1])
    normal *= math.copysign(1.0, area)
    both = normal + np.roll(normal, 1, axis=0)
    size = np.linalg.norm(both, axis=1, keepdims=True)
    out: Array = outline + distance * both / np.maximum(size, 1e-9) * np.minimum(2 / np.maximum(size, 1e-9), 2.0)
    return out


def wrapped_outline(blade: Blade, r: float, options: Options) -> Array:
    """Give the outline of the solid blade at a radius, unrolled from its cylinder, fillet included.

    Parameters
    ----------
    blade : Blade
        The blade.
    r : float
        Radius; below the hub radius the section there is kept. [m]
    options : Options
        Points and fillet.

    Returns
    -------
    (n, 2) float
        Arc (positive in the direction the blade moves) and axial coordinate, in Selig order; a sharp trailing edge is
        the first and the last point. [m]
    """
    at = min(max(r, blade.Rhub), blade.R)
    curve = blade.section_curve(at, options.n)
    height = max(r - blade.Rhub, 0.0)
    if height < options.fillet:
        rise = options.fillet - math.sqrt(options.fillet**2 - (options.fillet - height) ** 2)
        sharp = _sharp(curve)
        moved = _offset(curve[:-1] if sharp else curve, rise)
        curve = np.vstack([moved, moved[:1]]) if sharp else moved
    return curve


def _sharp(curve: Array) -> bool:
    size = float(np.ptp(curve, axis=0).max())
    return float(np.linalg.norm(curve[0] - curve[-1])) < 1e-6 * size


def _area(curve: Array) -> float:
    x, y = curve.T
    return abs(0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def radii(blade: Blade, options: Options | None = None) -> Array:
    """Choose the radii of the rings so that straight lines between them keep chord and blade angle.

    Parameters
    ----------
    blade : Blade
        The blade.
    options : Options or None
        Tolerance and fillet.

    Returns
    -------
    (N,) float
        Ascending from Rhub to R. [m]

    Examples
    --------
    >>> from geometry.blade import helix
    >>> ring = radii(helix(0.2032, 0.127))
    >>> bool(ring[0] == 0.15 * 0.1016), bool(ring[-1] == 0.1016), 20 < len(ring) < 100
    (True, True, True)
    """
    options = options or Options()
    inner = [x * blade.R for x, _ in blade.anchors if blade.Rhub < x * blade.R < blade.R]
    seeds = [*np.linspace(blade.Rhub, blade.R, 17), *inner]
    if options.fillet > 0:
        rise = options.fillet * (1 - np.cos(np.linspace(0, np.pi / 2, 9)))
        seeds += [blade.Rhub + float(h) for h in rise if blade.Rhub + h < blade.R]
    ring = np.unique(np.array(seeds))
    ring = ring[np.concatenate([[True], np.diff(ring) > 1e-9 * blade.R])]
    ring[-1] = blade.R
    for _ in range(6):
        mid = 0.5 * (ring[1:] + ring[:-1])
        (c, beta), (c0, b0) = blade.at(mid), blade.at(ring)
        # A wrapped surface also bends by the turn of the blade per step; the limit on the step bounds that.
        wrong = np.abs(0.5 * (c0[1:] + c0[:-1]) / c - 1) > options.tolerance
        wrong |= np.abs(0.5 * (b0[1:] + b0[:-1]) - beta) > options.tolerance * np.maximum(np.abs(beta), 0.05)
        if not wrong.any():
            break
        ring = np.sort(np.concatenate([ring, mid[wrong]]))
    return ring


def _rings(blade: Blade, r: Array, options: Options) -> Array:
    """Outlines (N, m, 2) at radii, one topology: all sharp (last point dropped) or all blunt."""
    curves = np.stack([wrapped_outline(blade, float(x), options) for x in r])
    sharp = np.array([_sharp(curve) for curve in curves])
    if sharp.all():
        return curves[:, :-1]
    for k in np.flatnonzero(sharp):  # one anchor sharp, another blunt: a gap of 2e-4 chord keeps the topology
        size = float(np.ptp(curves[k], axis=0).max())
        nose = curves[k][options.n // 2] - curves[k][0]
        across = np.array([-nose[1], nose[0]]) / np.linalg.norm(nose)
        side = math.copysign(1e-4 * size, float((curves[k][1] - curves[k][-2]) @ across))
        curves[k][0] += side * across
        curves[k][-1] -= side * across
    return curves


def _skin(points: Array, closed_ends: bool = True) -> tuple[Array, Faces]:
    """Mesh rings (N, m, 3) of one topology with caps at both ends; the result is oriented outwards."""
    rows, m = points.shape[:2]
    index = np.arange(rows * m).reshape(rows, m)
    a, b = index[:-1], index[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = [np.stack([a, a1, b1], -1).reshape(-1, 3), np.stack([a, b1, b], -1).reshape(-1, 3)]
    if closed_ends:
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


def _revolve(profile: Array, segments: int) -> tuple[Array, Faces]:
    """Solid of revolution of a closed profile (k, 2) of radius and z; points on the axis become poles."""
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


def hub_profile(rotor: Rotor, root: Array) -> Array:
    """Radius and z of the hub and spinner, from the back on the axis to the nose on the axis.

    Parameters
    ----------
    rotor : Rotor
        The rotor.
    root : (n, 2) float
        Outline at the hub; the hub covers its axial extent. [m]

    Returns
    -------
    (k, 2) float
        Radius and z. [m]

    Raises
    ------
    GeometryError
        When a given hub length does not cover the blade's root.
    """
    low, high = float(root[:, 1].min()), float(root[:, 1].max())
    need, middle = high - low, 0.5 * (low + high)
    length = rotor.hub_extent if rotor.hub_length is not None else max(rotor.hub_extent, 1.04 * need + 0.02 * rotor.Rhub)
    if length < need:
        raise GeometryError([("hub_length", f"{length:g} m", f"at least {need:g} m, which the blade's root takes",
                              "Leave it out to have it fitted")])  # fmt: skip
    back, front = middle - 0.5 * length, middle + 0.5 * length
    points = [(0.0, back), (rotor.Rhub, back), (rotor.Rhub, front)]
    if rotor.spinner_length > 0:
        t = np.linspace(0, np.pi / 2, 33)[1:-1]
        points += [(rotor.Rhub * math.cos(a), front + rotor.spinner_length * math.sin(a)) for a in t]
        points.append((0.0, front + rotor.spinner_length))
    else:
        points.append((0.0, front))
    return np.array(points)


def _profile_volume(profile: Array) -> float:
    """Exact volume of revolution of a closed profile (radius, z) (Pappus)."""
    r, z = profile.T
    r1, z1 = np.roll(r, -1), np.roll(z, -1)
    return abs(float(np.pi / 3 * np.sum((z1 - z) * (r * r + r * r1 + r1 * r1))))


def _solid(vertices: Array, faces: Faces, where: str) -> Any:
    import manifold3d

    data = manifold3d.Mesh64(np.ascontiguousarray(vertices, dtype=np.float64), faces.astype(np.uint64))
    solid = manifold3d.Manifold(data)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        raise GeometryError([(where, f"a surface that closes no volume ({solid.status().name})", "a closed surface", "")])
    return solid.as_original()


def _join(parts: Sequence[tuple[str, Any]], where: str) -> Mesh:
    """Union of named solids; every face keeps the name of the solid that it comes from."""
    import manifold3d

    total = manifold3d.Manifold.batch_boolean([solid for _, solid in parts], manifold3d.OpType.Add)
    if total.is_empty():
        raise GeometryError([(where, "solids whose union is empty", "solids that can be joined", "")])
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


def rotor_mesh(rotor: Rotor, options: Options | None = None) -> Mesh:
    """Mesh the blades and the hub as one solid.

    Parameters
    ----------
    rotor : Rotor
        The rotor; its blade has sections.
    options : Options or None
        How fine.

    Returns
    -------
    Mesh
        Surfaces ``blade`` and ``hub``; checked.

    Raises
    ------
    GeometryError
        When the numbers make no sound solid, with the reason.
    """
    return _rotor(rotor, options or Options())[0]


def _rotor(rotor: Rotor, options: Options) -> tuple[Mesh, dict[str, float]]:
    blade = rotor.blade
    faults = Faults()
    if not blade.anchors:
        faults.add("anchors", "none", "one section or more", "A solid needs sections")
    if blade.Rhub < 0.01 * blade.R:
        faults.add("Rhub", f"{blade.Rhub:g} m", f"at least 1 % of R, {0.01 * blade.R:g} m", "Blades need a hub")
    if options.fillet > 0.5 * rotor.span:
        faults.add("fillet", f"{options.fillet:g} m", f"at most half of the blade's length, {0.5 * rotor.span:g} m")
    faults.check()
    outer = radii(blade, options)
    depth = min(0.12 * blade.Rhub, 0.5 * blade.Rhub)
    ring = np.concatenate([[blade.Rhub - depth], outer])
    curves = _rings(blade, ring, options)
    _check_sections(rotor, outer, curves[1:], options)
    turn = rotor.rotation * curves[..., 0] / ring[:, None]
    points = np.stack([ring[:, None] * np.cos(turn), ring[:, None] * np.sin(turn), curves[..., 1]], axis=-1)
    solid = _solid(*_skin(points), "blade")
    profile = hub_profile(rotor, curves[0])
    segments = rotor.B * math.ceil(options.segments / rotor.B)
    hub = _solid(*_revolve(profile, segments), "hub")
    copies = [("blade", solid.rotate([0.0, 0.0, 360.0 * k / rotor.B])) for k in range(rotor.B)]
    mesh = _join([*copies, ("hub", hub)], "rotor")
    sections = _sections_volume(blade, outer, options)
    expected = _profile_volume(profile) + rotor.B * sections
    check_closed(mesh, "rotor", bodies=1)
    if abs(mesh.volume / expected - 1) > VOLUME_TOLERANCE:
        gap = 100 * (mesh.volume / expected - 1)
        raise GeometryError([("rotor", f"a solid whose volume is {gap:+.2f} % off the integral of its sections",
                              "blades that do not run into each other", "Fewer blades, less chord or a larger hub")])  # fmt: skip
    tip = float(np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]).max())
    if abs(tip / rotor.R - 1) > 1e-6:
        raise GeometryError([("rotor", f"a tip radius of {tip:g} m", f"R = {rotor.R:g} m", "")])
    thick = [float(_thickness(curve)) for curve in curves[1:]]
    checks = {
        "volume_rotor_mesh": mesh.volume, "volume_rotor_sections": expected, "volume_blade_sections": sections,
        "tip_radius": tip, "min_section_thickness": min(thick),
        "min_trailing_edge": float(min(np.linalg.norm(c[0] - c[-1]) if curves.shape[1] % 2 else 0.0 for c in curves[1:])),
    }  # fmt: skip
    return mesh, checks


def _thickness(curve: Array) -> float:
    """Greatest thickness of an outline across its chord, by pairs of points."""
    m = len(curve)
    k = np.arange(1, m // 2)
    gap = curve[k] - curve[(m - 1 - k) if m % 2 else (m - k)]
    chord = curve[m // 2] - 0.5 * (curve[0] + curve[-1])
    return float(np.abs(gap[:, 0] * chord[1] - gap[:, 1] * chord[0]).max() / np.linalg.norm(chord))


def _check_sections(rotor: Rotor, r: Array, curves: Array, options: Options) -> None:
    """Thickness, and sections that close round the cylinder."""
    faults = Faults()
    span = np.ptp(curves[..., 0], axis=1) / r
    if span.max() >= 2 * math.pi:
        k = int(span.argmax())
        faults.add("chord", f"a section that goes round its cylinder at r = {r[k]:g} m", "a shorter chord")
    thick = np.array([_thickness(curve) for curve in curves])
    if thick.min() < options.min_thickness:
        k = int(thick.argmin())
        got = f"{thick[k] * 1e3:.4g} mm at r/R = {r[k] / rotor.R:.2f}"
        faults.add("thickness", got, f"at least min_thickness, {options.min_thickness * 1e3:g} mm")
    faults.check()


def _sections_volume(blade: Blade, ring: Array, options: Options) -> float:
    """Integral of the section areas from hub to tip, finer than the mesh: Gauss points between rings, all points."""
    fine = Options(201, options.tolerance, options.segments, options.fillet)
    half, mid = 0.5 * np.diff(ring), 0.5 * (ring[1:] + ring[:-1])
    total = 0.0
    for x, w in zip(*np.polynomial.legendre.leggauss(2), strict=True):
        areas = [_area(wrapped_outline(blade, float(r), fine)) for r in mid + half * x]
        total += w * float(np.dot(half, areas))
    return total


def check_closed(mesh: Mesh, where: str, bodies: int | None = None) -> None:
    """Check with trimesh that a mesh is a solid.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    where : str
        Name for messages.
    bodies : int or None
        How many separate bodies there must be; None does not ask.

    Raises
    ------
    GeometryError
        With everything that is wrong.
    """
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

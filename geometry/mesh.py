"""Triangle meshes of rotors and ducts, made of numbers: sections wrapped on cylinders, joined exactly.

Frame of every solid: the shaft is the z axis, z points in the direction of thrust (upstream), the pitch axis of blade 1
is the x axis. A duct's coordinate x (downstream from its lip) is ``z = rotor_x - x``. Lengths in metres.

A section of radius r lies on the cylinder of radius r, as blade element theory takes it: its chord is an arc. Volumes
are therefore integrals of section areas over r exactly, and the tip has the radius R everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from geometry.common import Array, Faults, GeometryError, offset
from geometry.duct import Duct
from geometry.printed import Printed, cutters, framed, outline, root_depth, seeds, settled
from geometry.rotor import Blade, Rotor
from geometry.solid import (
    Mesh,
    Options,
    as_solid,
    centre_body,
    check_closed,
    duct_mesh,
    duct_profile,
    join,
    plan_stator,
    profile_volume,
    ray_thickness,
    revolve,
    skin,
    vane_rows,
)

__all__ = [
    "Mesh", "MeshModel", "Options", "blade_volume", "build", "hub_profile", "rings", "radii", "rotor_mesh",
    "wrapped_outline",
]  # fmt: skip

VOLUME_TOLERANCE = 5e-3
BETWEEN = 1.02
"""Least thickness that the rays must find over the one asked for: for what lies between the rays [1]."""
MOST_THICK = 3.0
"""Times the thickness asked for beyond which a blade does not follow any more [1]."""
TRIES = 4
"""Meshes of a printed rotor until it is thick enough."""


@dataclass(frozen=True, eq=False)
class MeshModel:
    """Everything that is exported: the turning solid and the standing one."""

    rotor: Mesh  # Blades and hub
    duct: Mesh | None = None  # Duct and stator
    # What was measured on the meshes, lengths in metres, volumes in cubic metres
    checks: Mapping[str, float] = field(default_factory=dict)
    options: Options = field(default_factory=Options)  # As meshed: those of a printed rotor are thick enough now

    @property
    def parts(self) -> list[Mesh]:
        """The meshes that are there."""
        return [self.rotor] if self.duct is None else [self.rotor, self.duct]


def wrapped_outline(blade: Blade, r: float, options: Options) -> Array:
    """Give the outline of the solid blade at a radius, unrolled from its cylinder, fillet included. [m]"""
    if options.printed is not None:
        return outline(blade, r, options.n, options.printed)
    at = min(max(r, blade.Rhub), blade.R)
    curve = blade.section_curve(at, options.n)
    height = max(r - blade.Rhub, 0.0)
    if height < options.fillet:
        rise = options.fillet - math.sqrt(options.fillet**2 - (options.fillet - height) ** 2)
        sharp = _sharp(curve)
        moved = offset(curve[:-1] if sharp else curve, rise)
        curve = np.vstack([moved, moved[:1]]) if sharp else moved
    return curve


def _sharp(curve: Array) -> bool:
    size = float(np.ptp(curve, axis=0).max())
    return float(np.linalg.norm(curve[0] - curve[-1])) < 1e-6 * size


def _area(curve: Array) -> float:
    x, y = curve.T
    return abs(0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def radii(blade: Blade, options: Options | None = None) -> Array:
    """Choose the radii of the rings so that straight lines between them keep chord and blade angle, (N,) [m].

    >>> from geometry.laws import helix
    >>> ring = radii(helix(0.2032, 0.127))
    >>> bool(ring[0] == 0.15 * 0.1016), bool(ring[-1] == 0.1016), 20 < len(ring) < 100
    (True, True, True)
    """
    options = options or Options()
    inner = [x * blade.R for x, _ in blade.anchors if blade.Rhub < x * blade.R < blade.R]
    some = [*np.linspace(blade.Rhub, blade.R, 17), *inner]
    if options.printed is not None:
        some += seeds(blade, options.printed).tolist()
    if options.fillet > 0:
        rise = options.fillet * (1 - np.cos(np.linspace(0, np.pi / 2, 9)))
        some += [blade.Rhub + float(h) for h in rise if blade.Rhub + h < blade.R]
    ring = np.unique(np.array(some))
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


def rings(blade: Blade, r: Array, options: Options) -> Array:
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


def hub_profile(rotor: Rotor, root: Array) -> Array:
    """Radius and z of the hub and spinner, from the back on the axis to the nose on the axis. [m]"""
    low, high = float(root[:, 1].min()), float(root[:, 1].max())
    need, middle = high - low, 0.5 * (low + high)
    length = (
        rotor.hub_extent if rotor.hub_length is not None else max(rotor.hub_extent, 1.04 * need + 0.02 * rotor.Rhub)
    )
    if length < need:
        wanted = f"at least {1e3 * need:.4g} mm, which the blade's root takes"
        raise GeometryError([("hub_length", f"{1e3 * length:.4g} mm", wanted, "Leave it out to have it fitted")])
    back, front = middle - 0.5 * length, middle + 0.5 * length
    points = [(0.0, back), (rotor.Rhub, back), (rotor.Rhub, front)]
    if rotor.spinner_length > 0:
        t = np.linspace(0, np.pi / 2, 33)[1:-1]
        points += [(rotor.Rhub * math.cos(a), front + rotor.spinner_length * math.sin(a)) for a in t]
        points.append((0.0, front + rotor.spinner_length))
    else:
        points.append((0.0, front))
    return np.array(points)


def rotor_mesh(rotor: Rotor, options: Options | None = None) -> Mesh:
    """Mesh the blades and the hub as one solid."""
    return _rotor(rotor, options or Options())[0]


def _rotor(rotor: Rotor, options: Options) -> tuple[Mesh, dict[str, float], Options]:
    blade, printed = rotor.blade, options.printed
    faults = Faults()
    if not blade.anchors:
        faults.add("anchors", "none", "one section or more", "A solid needs sections")
    if blade.Rhub < 0.01 * blade.R:
        faults.add("Rhub", f"{blade.Rhub:g} m", f"at least 1 % of R, {0.01 * blade.R:g} m", "Blades need a hub")
    if options.fillet > 0.5 * rotor.span:
        faults.add("fillet", f"{options.fillet:g} m", f"at most half of the blade's length, {0.5 * rotor.span:g} m")
    faults.check()
    if printed is None:
        outer, curves, points = _skinned(rotor, options, 0.12 * blade.Rhub)
    else:
        options, outer, curves, points, thin = _thick_enough(rotor, options, printed)
        printed = options.printed
    _check_sections(rotor, outer, curves[1:], options)
    solid = as_solid(*skin(points), "blade")
    profile = hub_profile(rotor, curves[0] if printed is None else framed(curves[0], printed))
    segments = rotor.B * math.ceil(options.segments / rotor.B)
    hub = as_solid(*revolve(profile, segments), "hub")
    copies = [("blade", solid.rotate([0.0, 0.0, 360.0 * k / rotor.B])) for k in range(rotor.B)]
    holes = [] if printed is None else cutters(printed, profile, options.segments)
    cut = [(name, as_solid(*revolve(shape, sides), name)) for name, shape, sides in holes]
    mesh = join([*copies, ("hub", hub)], "rotor", cut)
    sections = _integral(blade, outer, options)
    taken = join([("hub", hub)], "hub", cut).volume - hub.volume() if cut else 0.0
    expected = profile_volume(profile) + taken + rotor.B * sections
    check_closed(mesh, "rotor", bodies=1)
    if abs(mesh.volume / expected - 1) > VOLUME_TOLERANCE:
        gap = 100 * (mesh.volume / expected - 1)
        got = f"a solid whose volume is {gap:+.2f} % off the integral of its sections"
        wanted, hint = "blades that do not run into each other", "Fewer blades, less chord or a larger hub"
        raise GeometryError([("rotor", got, wanted, hint)])
    tip = float(np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]).max())
    if abs(tip / rotor.R - 1) > 1e-6:
        raise GeometryError([("rotor", f"a tip radius of {tip:g} m", f"R = {rotor.R:g} m", "")])
    thick = [float(_thickness(curve)) for curve in curves[1:]]
    edge = min(np.linalg.norm(c[0] - c[-1]) if curves.shape[1] % 2 else 0.0 for c in curves[1:])
    checks = {
        "volume_rotor_mesh": mesh.volume, "volume_rotor_sections": expected, "volume_blade_sections": sections,
        "tip_radius": tip, "min_section_thickness": min(thick), "min_trailing_edge": float(edge),
    }  # fmt: skip
    if printed is not None:
        del checks["min_section_thickness"], checks["min_trailing_edge"]  # of the rounded tip, where they mean nothing
        checks |= {"min_thickness": thin, "trailing_edge": printed.edge, "flare": printed.blend or 0.0}
    return mesh, checks, options


def _skinned(rotor: Rotor, options: Options, depth: float) -> tuple[Array, Array, Array]:
    """Radii of the free rings, outlines (N + 1, m, 2) with one inside the hub before them, and their points."""
    outer = radii(rotor.blade, options)
    ring = np.concatenate([[rotor.Rhub - depth], outer])
    curves = rings(rotor.blade, ring, options)
    turn = rotor.rotation * curves[..., 0] / ring[:, None]
    return (
        outer,
        curves,
        np.stack([ring[:, None] * np.cos(turn), ring[:, None] * np.sin(turn), curves[..., 1]], axis=-1),
    )


def _thick_enough(rotor: Rotor, options: Options, printed: Printed) -> tuple[Options, Array, Array, Array, float]:
    """Make the blade a little thicker until no place is too thin; with the least thickness that was found. [m]

    By rays from the middle of facets straight into the blade.
    """
    made = settled(rotor, printed)
    root = wrapped_outline(rotor.blade, rotor.Rhub - root_depth(rotor, made), replace(options, printed=made))
    cutters(made, hub_profile(rotor, framed(root, made)), options.segments)  # its faults come first
    for _ in range(TRIES):
        options = replace(options, printed=made)
        outer, curves, points = _skinned(rotor, options, root_depth(rotor, made))
        vertices, faces = skin(points)
        m = points.shape[1]
        # Above the hub, one of two triangles of every third facet: 3 divides no usual number of points.
        corners = vertices[faces[m : (len(points) - 1) * m : 3]]
        middle, across = corners.mean(axis=1), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        thick = ray_thickness(vertices, faces, middle, across / np.linalg.norm(across, axis=1, keepdims=True))
        k = int(np.argmin(thick))
        thin, at = float(thick[k]), float(np.hypot(*middle[k, :2])) / rotor.R
        if thin >= BETWEEN * printed.min_thickness:
            return options, outer, curves, points, thin
        more = 1.002 * BETWEEN * printed.min_thickness / thin
        if not made.min_thickness * more < MOST_THICK * printed.min_thickness:  # it no longer follows
            break
        made = made.thicker(more)
    got = f"{thin * 1e3:.3g} mm at r/R = {at:.2f}"
    raise GeometryError([("thickness", got, f"at least min_thickness, {printed.min_thickness * 1e3:g} mm", "")])


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


def blade_volume(blade: Blade, options: Options | None = None) -> float:
    """Integrate the section areas of one blade from hub to tip, fillet included. [m^3]"""
    options = options or Options()
    return _integral(blade, radii(blade, options), options)


def _integral(blade: Blade, ring: Array, options: Options) -> float:
    """Integral of the section areas from hub to tip, finer than the mesh: Gauss points between rings, all points."""
    fine = replace(options, n=201)
    half, mid = 0.5 * np.diff(ring), 0.5 * (ring[1:] + ring[:-1])
    total = 0.0
    for x, w in zip(*np.polynomial.legendre.leggauss(2), strict=True):
        areas = [_area(wrapped_outline(blade, float(r), fine)) for r in mid + half * x]
        total += w * float(np.dot(half, areas))
    return total


def build(rotor: Rotor, duct: Duct | None = None, options: Options | None = None) -> MeshModel:
    """Mesh a rotor and its duct and check how they fit.

    >>> from geometry.airfoil import naca
    >>> from geometry.laws import helix
    >>> model = build(Rotor(helix(0.2032, 0.127, anchors=naca("4412")), 2), options=Options(n=41))
    >>> model.rotor.names, round(model.checks["tip_radius"], 4)
    (('blade', 'hub'), 0.1016)
    """
    options = options or Options()
    mesh, checks, options = _rotor(rotor, options)
    if duct is None:
        return MeshModel(mesh, None, checks, options)
    duct.check(rotor)
    rho, z = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]), mesh.vertices[:, 2]
    hub = np.unique(mesh.part("hub"))
    plan = plan_stator(duct, float(z[hub].min()), rotor.Rhub)
    standing, wall = duct_mesh(duct, plan, options)
    checks |= {"volume_duct_mesh": standing.volume, "volume_wall_sections": wall}
    if plan is None:
        if abs(standing.volume / wall - 1) > VOLUME_TOLERANCE:
            raise GeometryError([("duct", f"a mesh of {standing.volume:g} m^3", f"{wall:g} m^3", "")])
    x = duct._rotor - z
    inside = (x >= 0) & (x <= duct.length)
    room = duct.inner(x[inside]) - rho[inside]
    gap = float(room.min()) if inside.any() else math.inf
    # The facets of a bore lie closer to the axis than its circle.
    facet = duct.inner_radius * (math.pi / (1.5 * options.segments)) ** 2 / 2
    if gap <= 2 * facet:
        k = int(np.argmin(room))
        got = f"{gap * 1e3:.4g} mm between blades and wall, {x[inside][k] * 1e3:.4g} mm behind the lip"
        wanted = f"more than {2 * facet * 1e3:.2g} mm, what facets take"
        hint = "A larger gap, or a diffuser or nozzle that starts behind the blades"
        raise GeometryError([("duct.gap", got, wanted, hint)])
    if abs(x[rho > 0.98 * rotor.R] - 0.5 * duct.length).max() > 0.5 * duct.length:
        got, hint = f"{duct._rotor * 1e3:.4g} mm, blade tips outside the duct", "Move the rotor or lengthen the duct"
        raise GeometryError([("duct.rotor_x", got, "blade tips inside the duct", hint)])
    checks["gap"] = gap
    return MeshModel(mesh, standing, checks, options)


# Surfaces of a rotor and its duct as grids of points: what a viewer draws, without solids and their libraries.

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

"""CAD solids (cadquery): the same blades, hubs, ducts and stators as the meshes, as smooth surfaces for STEP.

The sections of :mod:`geometry.mesh` lie on cylinders, which lofts do not take. The blade is therefore cut by planes
across its pitch axis: for every point of an outline the radius is found at which the wrapped blade meets the plane.
A loft through these planar sections is the same blade. Frame as in :mod:`geometry.mesh`; CAD lengths in millimetres.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from geometry.common import Array, Faults, GeometryError, needs
from geometry.duct import Duct
from geometry.mesh import Options, blade_volume, hub_profile, radii, wrapped_outline
from geometry.printed import HEXAGON, cutters, framed, root_depth
from geometry.rotor import Rotor
from geometry.solid import Mesh, StatorPlan, centre_body, duct_profile, plan_stator, profile_volume

MM = 1000.0
TOLERANCE = 5e-3
SOUND = 1.5e-3  # volume error of a fused solid above which the next try may be better: some surfaces then cross
_POINTS, _NEAR = 45, 1e-4
_POINTED = 0.01  # chord over R from which on to the tip a section is the last one: a loft takes no point
TRIED = ((45, 8e-3), (45, 15e-3), (61, 8e-3), (45, 3e-3), (37, 8e-3))
"""Points of a section and least distance of sections over R, tried in turn where blades are printed or do not loft as
they are: the CAD kernel fuses most of them, and says nothing when it loses a blade."""


@contextmanager
def kernel(where: str, wanted: str, hint: str) -> Iterator[None]:
    """Tell what the CAD kernel failed at; it raises its own kinds."""
    try:
        yield
    except GeometryError:
        raise
    except Exception as error:
        got = f"a failure of the CAD kernel ({type(error).__name__}: {str(error)[:80]})"
        raise GeometryError([(where, got, wanted, hint)]) from error


@dataclass(frozen=True, eq=False)
class Parts:
    """CAD solids of a rotor and its duct."""

    # Surface name (blade, hub, duct, stator), name of the part (blade_1 and so on), cadquery solid in millimetres
    solids: tuple[tuple[str, str, Any], ...]
    volumes: dict[str, float] = field(default_factory=dict)  # Volume by surface name [m^3]

    @property
    def rotor_volume(self) -> float:
        """Volume of blades and hub [m^3]."""
        return self.volumes["blade"] + self.volumes["hub"]


def planar_sections(
    rotor: Rotor, options: Options | None = None, count: int = _POINTS, apart: float = _NEAR
) -> list[tuple[float, Array]]:
    """Cut the wrapped blade by planes across its pitch axis. [m]

    A point with arc t(rho) lies at x = rho cos(t/rho), y = rho sin(t/rho); x grows with rho while the arc stays below a
    quarter turn, so that the radius is found by interpolation on a fine table of radii. A section has `count`
    points; planes are no nearer to each other than `apart` times the tip radius.
    """
    blade = rotor.blade
    options = options or Options()
    printed = options.printed
    grid = replace(options, n=count, tolerance=20 * options.tolerance)
    rho = radii(blade, grid)
    rho = np.sort(np.concatenate([rho, 0.5 * (rho[1:] + rho[:-1])]))
    step = 0.02 * rotor.R
    fine = replace(options, n=count)
    curves = np.stack([wrapped_outline(blade, float(r), fine) for r in rho])
    whole = np.flatnonzero(np.linalg.norm(np.ptp(curves, axis=1), axis=1) > _POINTED * rotor.R)
    curves[whole[-1] + 1 :] = curves[whole[-1]]
    angle = curves[..., 0] / rho[:, None]
    if np.abs(angle).max() > 1.3:
        got = f"a section that reaches {math.degrees(np.abs(angle).max()):.0f} deg round the shaft"
        raise GeometryError([("chord", got, "75 deg or less for a CAD solid", "Less chord or a larger hub")])
    # Inside the hub the root section goes on; outside the tip the last two rings are continued.
    outside, slope = [], (curves[-1] - curves[-2]) / (rho[-1] - rho[-2])
    reach = rotor.R * (1 / math.cos(float(np.abs(angle[-1]).max())) - 1) + step
    for k in range(1, 9):
        outside.append(
            curves[-1] + slope * reach * k / 8
            if printed is None
            else wrapped_outline(blade, float(rho[-1]) + reach * k / 8, fine)
        )
    lowest = 0.75 * rotor.Rhub * math.cos(min(float(np.abs(angle[0]).max()) * 1.35, 1.4))
    inside = np.linspace(max(lowest, 0.3 * rotor.Rhub), rho[0], 9)[:-1]
    table = np.concatenate([inside, rho, rho[-1] + reach * np.arange(1, 9) / 8])
    within = (
        np.repeat(curves[:1], len(inside), axis=0)
        if printed is None
        else np.stack([wrapped_outline(blade, float(r), fine) for r in inside])
    )
    curves = np.concatenate([within, curves, np.stack(outside)])
    angle = curves[..., 0] / table[:, None]
    x, y = table[:, None] * np.cos(angle), table[:, None] * np.sin(angle) * rotor.rotation
    bottom, top = float(x[0].max()), float(x[-1].min())
    root = _inner_plane(curves[0], rotor.Rhub)
    if root < bottom or top < rotor.R:
        hint = "Less chord, a larger hub, or a mesh (STL, 3MF, OBJ) instead of STEP"
        raise GeometryError([("chord", "a blade too wide for its hub", "a root that ends inside the hub", hint)])
    planes = np.unique(np.concatenate([[root], rho[(rho > 1.01 * root) & (rho < rotor.R)], [rotor.R + 0.4 * step]]))
    if printed is None:
        planes = _apart(planes, apart * rotor.R)
    else:
        high = rotor.Rhub + (printed.blend or 0.0)
        flare = np.linspace(root, high, 1 + math.ceil((high - root) / max(0.2 * (high - rotor.Rhub), 2e-3 * rotor.R)))
        planes = np.concatenate([flare[:-1], _apart(np.concatenate([[high], planes[planes > high]]), apart * rotor.R)])
    out = [(float(plane), np.empty((curves.shape[1], 2))) for plane in planes]
    radius = table.tolist()  # plain numbers: there are a few at a time, which arrays are slow at
    for j in range(curves.shape[1]):
        along, across, axial = x[:, j].tolist(), y[:, j].tolist(), curves[:, j, 1].tolist()
        for (plane, section), start in zip(out, np.interp(planes, x[:, j], table).tolist(), strict=True):
            at = start
            for _ in range(2):  # the straight table misses the plane by a trifle: two corrections along the path
                at += plane - _cubic(radius, along, at)
            section[j] = _cubic(radius, across, at), _cubic(radius, axial, at)
    return out


def _apart(planes: Array, least: float) -> Array:
    """Planes that are no nearer to each other than a distance; first and last stay."""
    kept = [float(planes[0])]
    for plane in planes[1:-1]:
        if plane - kept[-1] > least and planes[-1] - plane > least:
            kept.append(float(plane))
    return np.array([*kept, float(planes[-1])])


def _cubic(x: list[float], y: list[float], at: float) -> float:
    """Interpolate by the cubic through the four nearest points."""
    i = min(max(bisect_left(x, at) - 2, 0), len(x) - 4)
    a, b, c, d = x[i : i + 4]
    w, s, t, u = at - a, at - b, at - c, at - d
    return (
        y[i] * (s / (a - b) * (t / (a - c)) * (u / (a - d)))
        + y[i + 1] * (w / (b - a) * (t / (b - c)) * (u / (b - d)))
        + y[i + 2] * (w / (c - a) * (s / (c - b)) * (u / (c - d)))
        + y[i + 3] * (w / (d - a) * (s / (d - b)) * (t / (d - c)))
    )


def _inner_plane(root: Array, hub: float) -> float:
    """Plane whose whole section lies inside the hub, with some room."""
    wide = float(np.abs(root[:, 0]).max())
    return hub * min(0.94 * math.cos(min(1.15 * wide / hub, 1.45)), 0.9)


def _loft(sections: list[tuple[float, Array]]) -> Any:
    """Smooth loft of two splines per section and, where it is blunt, the trailing edge's line."""
    cq = needs("cadquery", "cad")

    blunt = all(np.linalg.norm(s[0] - s[-1]) > 1e-6 * float(np.ptp(s, axis=0).max()) for _, s in sections)
    # The same parameters for every section: otherwise the loft's surface takes the knots of all sections together.
    middle = sections[len(sections) // 2][1]
    run = np.concatenate([[0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(middle, axis=0), axis=1)))])
    half = len(middle) // 2
    first, second = (run[: half + 1] / run[half]).tolist(), ((run[half:] - run[half]) / (run[-1] - run[half])).tolist()
    wires = []
    for plane, section in sections:
        points = [cq.Vector(plane * MM, float(y) * MM, float(z) * MM) for y, z in section]
        if not blunt:
            points[-1] = points[0] = (points[0] + points[-1]) * 0.5
        nose = len(points) // 2
        edges = [
            cq.Edge.makeSpline(points[: nose + 1], parameters=first),
            cq.Edge.makeSpline(points[nose:], parameters=second),
        ]
        if blunt:
            edges.append(cq.Edge.makeLine(points[-1], points[0]))
        wires.append(cq.Wire.assembleEdges(edges))
    return cq.Solid.makeLoft(wires, False)


def _turned(profile: Array, copies: int) -> Any:
    """Solid of revolution of a closed profile of radius and z [m] around z; straight where three points are.

    Its seam lies midway between the `copies` blades or vanes that stand on it, the first at x: with the edges of a vane
    on a seam the kernel's boolean gives nothing.
    """
    cq = needs("cadquery", "cad")

    points = [cq.Vector(float(r) * MM, 0.0, float(z) * MM) for r, z in profile]
    edges, i, count = [], 0, len(points)
    # Dense runs of points are splines, the rest lines: a bore must be a straight line.
    gap = np.linalg.norm(np.roll(profile, -1, axis=0) - profile, axis=1)
    small = gap < 0.12 * float(np.ptp(profile, axis=0).max())
    start = int(np.argmin(small)) + 1 if not small.all() else 0
    order = [(start + k) % count for k in range(count)]
    while i < count:
        j = i
        while j < count and small[order[j]]:
            j += 1
        if j - i >= 4:
            run = [points[order[k]] for k in range(i, j)] + [points[(order[j - 1] + 1) % count]]
            edges.append(cq.Edge.makeSpline(run))
            i = j
        else:
            edges.append(cq.Edge.makeLine(points[order[i]], points[(order[i] + 1) % count]))
            i += 1
    face = cq.Face.makeFromWires(cq.Wire.assembleEdges(edges))
    axis = cq.Vector(0, 0, 1)
    return _fixed(cq.Solid.revolve(face, 360.0, cq.Vector(), axis).rotate(cq.Vector(), axis, 180.0 / copies))


def _one(shape: Any, where: str) -> Any:
    """Take the one solid of a shape; it must be valid."""
    found = [s for s in shape.Solids() if s.Volume() > 0]
    if not found:
        raise GeometryError([(where, "no solid", "a solid", "The sections cannot be lofted: less twist or chord?")])
    best = max(found, key=lambda s: float(s.Volume()))
    if sum(s.Volume() for s in found) > 1.001 * best.Volume() or not best.isValid():
        raise GeometryError([(where, f"{len(found)} pieces, valid: {best.isValid()}", "one valid solid", "")])
    return best


def _fixed(solid: Any) -> Any:
    """Turn a solid inside out when its volume is negative."""
    return solid if solid.Volume() > 0 else type(solid)(solid.wrapped.Reversed())


def blade_solid(rotor: Rotor, options: Options | None = None) -> tuple[Any, Array]:
    """Make blade 1 as a CAD solid that ends exactly at hub and tip cylinder."""
    cq = needs("cadquery", "cad")

    options = options or Options()
    if not rotor.blade.anchors:
        raise GeometryError([("anchors", "none", "one section or more", "A solid needs sections")])
    profile = hub_profile(rotor, wrapped_outline(rotor.blade, rotor.Rhub, options))

    def solid(count: int, apart: float) -> Any:
        with kernel("blade", "sections that can be lofted", "Use the mesh formats, which need no loft"):
            loft = _fixed(_loft(planar_sections(rotor, options, count, apart)))
            low, high = 2 * float(profile[:, 1].min()) * MM - rotor.R * MM, 2 * rotor.R * MM + 4 * rotor.R * MM
            low_point = cq.Vector(0, 0, low)
            tip = cq.Solid.makeCylinder(rotor.R * MM, high, low_point)
            core = cq.Solid.makeCylinder(rotor.Rhub * MM, high, low_point)
            return _one(loft.intersect(tip).cut(core), "blade")

    whole = blade_volume(rotor.blade, options)
    hint = "Use the mesh formats, which need no loft"
    return _tried(solid, whole, ((_POINTS, _NEAR), *TRIED), TOLERANCE, hint), profile


def _tried(
    make: Callable[[int, float], Any], volume: float, ways: Sequence[tuple[int, float]], good: float, hint: str
) -> Any:  # fmt: skip
    """First solid of some numbers of points and distances of planes whose volume [m^3] is off by less than ``good``.

    Else the nearest within `TOLERANCE`: a smooth loft of many planes may fold between them, or be open.
    """
    last, close = GeometryError([]), []
    for count, apart in ways:
        try:
            solid = make(count, apart)
        except GeometryError as error:
            last = error
            continue
        off = solid.Volume() / MM**3 / volume - 1
        if abs(off) < good:
            return solid
        if abs(off) < TOLERANCE:
            close.append((abs(off), solid))
        got = f"a CAD solid whose volume is {100 * off:+.2f} % off the integral of its sections"
        last = GeometryError([("blade", got, f"at most {100 * TOLERANCE:g} %", hint)])
    if close:
        return min(close, key=lambda pair: pair[0])[1]
    raise last


def printed_solid(rotor: Rotor, options: Options, volume: float) -> Any:
    """Make a printed rotor as one CAD solid: blades fused with the hub, the holes cut.

    `options` and `volume` [m^3] are those of its mesh. The edge of the very tip stays sharp.
    """
    assert options.printed is not None
    sharp = replace(options, printed=replace(options.printed, round_edge=False))
    volume += rotor.B * (blade_volume(rotor.blade, sharp) - blade_volume(rotor.blade, options))
    return _tried(lambda count, apart: _printed_solid(rotor, sharp, count, apart), volume, TRIED, SOUND,
                  "Use stl or 3mf, which need no loft")  # fmt: skip


def _printed_solid(rotor: Rotor, options: Options, count: int, apart: float) -> Any:
    cq = needs("cadquery", "cad")

    assert options.printed is not None
    root = wrapped_outline(rotor.blade, rotor.Rhub - root_depth(rotor, options.printed), options)
    profile = hub_profile(rotor, framed(root, options.printed))
    with kernel("blade", "sections that can be lofted", "Use stl or 3mf, which need no loft"):
        loft = _fixed(_loft(planar_sections(rotor, options, count, apart)))
        foot, axis = cq.Vector(0, 0, -2 * rotor.R * MM), cq.Vector(0, 0, 1)
        tip = cq.Solid.makeCylinder(rotor.R * MM, 4 * rotor.R * MM, foot).rotate(cq.Vector(), axis, 90.0)
        blade = _one(loft.intersect(tip), "blade")
        solid = _turned(profile, rotor.B)
        for k in range(rotor.B):
            solid = solid.fuse(blade.rotate(cq.Vector(), axis, 360.0 * k / rotor.B))
        for _, shape, sides in cutters(options.printed, profile, options.segments):
            radius, bottom, top = float(shape[:, 0].max()) * MM, float(shape[0, 1]) * MM, float(shape[-1, 1]) * MM
            if sides == HEXAGON:
                corner = radius * math.sqrt((2 * math.pi / sides) / math.sin(2 * math.pi / sides))
                hole = cq.Workplane(origin=(0, 0, bottom)).polygon(sides, 2 * corner).extrude(top - bottom).val()
            else:
                hole = cq.Solid.makeCylinder(radius, top - bottom, cq.Vector(0, 0, bottom))
            solid = solid.cut(hole)
        return _one(solid.clean(), "rotor")


def _stator_solids(duct: Duct, plan: StatorPlan) -> list[tuple[str, str, Any]]:
    cq = needs("cadquery", "cad")

    body = _turned(centre_body(duct, plan), plan.stator.B)
    outline = plan.outline(41)
    wide = float(np.abs(outline[:, 0]).max())
    if wide > 0.9 * plan.body_radius:
        raise GeometryError([("stator", f"vanes {2 * wide * MM:.3g} mm wide", "vanes that stand on the body", "")])
    top = 1.3 * float(duct.outer(np.linspace(0, duct.length, 50)).max())
    flat = np.stack([outline[:, 0], duct._rotor - outline[:, 1]], axis=1)
    vane = _fixed(_loft([(0.05 * plan.body_radius, flat), (top, flat)]))
    inner = duct.profile(81)[0]
    room = np.array([(0.0, duct._rotor), *((r, duct._rotor - x) for x, r in inner), (0.0, duct._rotor - duct.length)])
    between = _turned(_thin(room), plan.stator.B).cut(body)
    vane = _one(vane.intersect(between), "stator")
    out = [("stator", "centre_body", body)]
    for k in range(plan.stator.B):
        turned = vane.rotate(cq.Vector(), cq.Vector(0, 0, 1), 360.0 * k / plan.stator.B)  # copied: faces have names
        out.append(("stator", f"vane_{k + 1}", turned))
    return out


def _thin(points: Array) -> Array:
    """Drop points on straight lines."""
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    bend = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    out: Array = points[bend > 1e-12 * float(np.ptp(points)) ** 2]
    return out


def solids(rotor: Rotor, duct: Duct | None = None, options: Options | None = None) -> Parts:
    """Make the CAD solids of a rotor and its duct: parts that touch, none that overlap."""
    cq = needs("cadquery", "cad")

    options = options or Options()
    blade, profile = blade_solid(rotor, options)
    found: list[tuple[str, str, Any]] = []
    for k in range(rotor.B):
        turned = blade.rotate(cq.Vector(), cq.Vector(0, 0, 1), 360.0 * k / rotor.B)
        found.append(("blade", f"blade_{k + 1}", turned))
    exact = [("hub", profile)]
    found.append(("hub", "hub", _turned(profile, rotor.B)))
    if duct is not None:
        duct.check(rotor)
        wall = duct_profile(duct)
        exact.append(("duct", wall))
        found.append(("duct", "duct", _turned(wall, 1 if duct.stator is None else duct.stator.B)))
        plan = plan_stator(duct, float(profile[:, 1].min()), rotor.Rhub)
        if plan is not None:
            found += _stator_solids(duct, plan)
    volumes: dict[str, float] = {}
    for name, _, solid in found:
        volumes[name] = volumes.get(name, 0.0) + solid.Volume() / MM**3
    faults = Faults()
    for name, outline in exact:
        if abs(volumes[name] / profile_volume(outline) - 1) > TOLERANCE:
            faults.add(name, f"a CAD volume of {volumes[name]:g} m^3", f"{profile_volume(outline):g} m^3")
    faults.check()
    return Parts(tuple(found), volumes)


COLOURS = {"blade": (0.2, 0.3, 0.6), "hub": (0.4, 0.4, 0.4), "duct": (0.8, 0.8, 0.8), "stator": (0.6, 0.6, 0.6),
           "flow": (0.9, 0.95, 1.0), "rotating_zone": (1.0, 0.9, 0.8)}  # fmt: skip
FAR = ("far_field_inlet", "far_field_outlet", "far_field_side")
"""Names of the box round the flow: ahead of the rotor, behind it, beside it."""


def assembly(parts: Parts, name: str, rotor: Rotor | None = None, duct: Duct | None = None) -> Any:
    """Gather the solids in a named ``cadquery.Assembly`` for STEP; with their rotor every face has a name, too."""
    cq = needs("cadquery", "cad")

    out = cq.Assembly(name=name)
    for surface, part, solid in parts.solids:
        out.add(solid, name=part, color=cq.Color(*COLOURS[surface]))
    for part, face, word in named_faces(parts, rotor, duct) if rotor is not None else ():
        out.objects[part].addSubshape(face, name=word, layer=word)
    return out


def named_faces(parts: Parts, rotor: Rotor, duct: Duct | None = None) -> list[tuple[str, Any, str]]:
    """Part, face and name of all faces: what a mesher picks boundaries by.

    ``blade_1``, ``blade_1_tip``, ``blade_1_root`` (in the hub), ``hub``, ``duct_lip``, ``duct_inner``, ``duct_outer``,
    ``duct_exit``, ``centre_body``, ``vane_2``.
    """
    out = []
    for surface, part, solid in parts.solids:
        for face in solid.Faces():
            at = np.array([v.toTuple() for v in face.Vertices()]) / MM
            radius, z = np.hypot(at[:, 0], at[:, 1]), at[:, 2]
            word = part
            if surface == "blade" and face.geomType() == "CYLINDER":
                word = f"{part}_tip" if radius.mean() > 0.5 * (rotor.R + rotor.Rhub) else f"{part}_root"
            elif surface == "duct" and duct is not None:
                word = _wall_name(duct, radius, duct._rotor - z)
            out.append((part, face, word))
    return out


def _wall_name(duct: Duct, radius: Array, x: Array) -> str:
    """Name of a face of the duct by its corners."""
    near = 1e-4 * duct.length
    if x.max() <= duct.lip_length + near:
        return "duct_lip"
    if x.min() >= duct.length - near:
        return "duct_exit"
    middle = 0.5 * (duct.inner(x) + duct.outer(x))
    return "duct_inner" if np.sum(radius - middle) < 0.0 else "duct_outer"


WIDE = 10.0
"""Width of the far field in diameters [1]."""


def flow_domain(
    parts: Parts, rotor: Rotor, duct: Duct | None = None, wide: float = WIDE
) -> tuple[Any, list[tuple[Any, str]]]:
    """Air round a rotor and its duct as one solid in millimetres, a box less the parts, and its faces with their names.

    `wide` is the width of the box in diameters [1]; it reaches half of it upstream (+z) and all of it downstream.
    Names as `named_faces` has them, and ``far_field_inlet``, ``far_field_outlet``, ``far_field_side``.
    """
    cq = needs("cadquery", "cad")

    D = rotor.D * MM
    low = cq.Vector(-0.5 * wide * D, -0.5 * wide * D, -wide * D)
    box = cq.Solid.makeBox(wide * D, wide * D, 1.5 * wide * D, low)
    air = _one(box.cut(*(solid for _, _, solid in parts.solids)), "flow")
    walls = [(face, word, face.BoundingBox()) for _, face, word in named_faces(parts, rotor, duct)]
    out = []
    for face in air.Faces():
        span = face.BoundingBox()
        if span.xlen > 0.9 * wide * D or span.ylen > 0.9 * wide * D:
            flat = span.zlen < 1e-3 * D
            out.append((face, FAR[2] if not flat else FAR[0] if span.center.z > 0.0 else FAR[1]))
            continue
        points, corners = face.tessellate(0.01 * D, 0.3)
        spots = [[points[i] for i in c] for c in corners]
        a, b, c = max(spots, key=lambda s: float((s[1] - s[0]).cross(s[2] - s[0]).Length))
        spot = cq.Vertex.makeVertex(*((a + b + c) * (1.0 / 3.0)).toTuple())
        here = spot.Center()
        close = [(w.distance(spot), word) for w, word, box_ in walls if _near(box_, here, 0.02 * D)]
        out.append((face, min(close)[1] if close else "wall"))
    lost = {word for _, word, _ in walls if not word.endswith("_root")} - {word for _, word in out}
    if lost or any(word == "wall" for _, word in out):  # the kernel loses a part without a word
        got = f"air without {', '.join(sorted(lost)) or 'a name for every face'}"
        raise GeometryError([("flow", got, "a boundary of every part", "Use step, and cut the box in the mesher")])
    return air, out


ZONE = ("zone_upstream", "zone_downstream", "zone_side")
"""Names of the faces of a rotating zone."""
_MARGIN, _OPEN = 0.15, 1.1


def rotating_zone(
    parts: Parts, rotor: Rotor, duct: Duct | None = None
) -> tuple[Any, list[tuple[Any, str]], tuple[float, float, float]]:
    """Cylinder that turns with the rotor, for MRF or a sliding mesh: its solid in millimetres, its faces, its size [m].

    The size is the radius, and the height of both ends above the rotor's plane. The cylinder holds blades and hub with
    0.15 R on either side, and reaches to 1.1 R, or to the middle of the gap in a duct. Towards vanes it ends halfway.
    Nothing is cut out of it: a mesher takes it as a body of the air, or as the surface of a zone of cells.
    """
    cq = needs("cadquery", "cad")

    def span(*surfaces: str) -> tuple[float, float]:
        boxes = [solid.BoundingBox() for surface, _, solid in parts.solids if surface in surfaces]
        return (min(b.zmin for b in boxes) / MM, max(b.zmax for b in boxes) / MM) if boxes else (-math.inf, -math.inf)

    (low, high), margin = span("blade", "hub"), _MARGIN * rotor.R
    vanes = span("stator")[1]
    bottom = low - margin if vanes < low - 2.0 * margin else 0.5 * (low + min(vanes, low))
    if vanes > low:  # a body that the hub stands on
        bottom = low
    top, radius = high + margin, _OPEN * rotor.R if duct is None else rotor.R + 0.5 * duct.gap
    solid = cq.Solid.makeCylinder(radius * MM, (top - bottom) * MM, cq.Vector(0, 0, bottom * MM))
    ends = {True: ZONE[0], False: ZONE[1]}
    faces = [
        (f, ZONE[2] if f.geomType() == "CYLINDER" else ends[f.Center().z > 0.5 * (top + bottom) * MM])
        for f in solid.Faces()
    ]
    return solid, faces, (radius, bottom, top)


def _near(box: Any, at: Any, by: float) -> bool:
    """Whether a point is in a bounding box, or nearly."""
    return bool(
        box.xmin - by < at.x < box.xmax + by
        and box.ymin - by < at.y < box.ymax + by
        and box.zmin - by < at.z < box.zmax + by
    )


def tessellate(shape: Any, tolerance: float, angle: float = 0.1) -> Mesh:
    """Mesh CAD solids; each stays a body of its own. [m]

    Older triangles are removed first: without that the CAD kernel returns them, whatever the tolerance.
    """
    cq = needs("cadquery", "cad")
    from OCP.BRepTools import BRepTools  # type: ignore[import-untyped]
    from OCP.TopLoc import TopLoc_Location  # type: ignore[import-untyped]

    vertices: list[Array] = []
    faces: list[Any] = []
    done: list[tuple[Any, Array, Any]] = []  # equal parts of an assembly are meshed once
    count = 0
    for solid in shape.Solids():
        known = next((row for row in done if row[0].IsPartner(solid.wrapped)), None)
        if known is None:
            bare = solid.wrapped.Located(TopLoc_Location())
            BRepTools.Clean_s(bare)
            points, triangles = cq.Shape.cast(bare).tessellate(tolerance * MM, angle)
            raw = np.array([p.toTuple() for p in points]) / MM
            near, index = np.unique(np.round(raw / (1e-3 * tolerance)), axis=0, return_inverse=True)
            corner = np.zeros((len(near), 3))
            corner[index.ravel()] = raw
            flat = index.ravel()[np.array(triangles, dtype=np.int64)]
            flat = flat[(flat[:, 0] != flat[:, 1]) & (flat[:, 1] != flat[:, 2]) & (flat[:, 2] != flat[:, 0])]
            if solid.wrapped.Orientation() != bare.Orientation():
                flat = flat[:, ::-1]
            known = (solid.wrapped, corner, flat)
            done.append(known)
        move = solid.wrapped.Location().Transformation()
        matrix = np.array([[move.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)])
        vertices.append(known[1] @ matrix[:, :3].T + matrix[:, 3] / MM)
        faces.append(known[2] + count)
        count += len(known[1])
    if not faces:
        raise GeometryError([("CAD file", "no solid", "one solid or more", "Surfaces alone enclose no volume")])
    joined = np.concatenate(faces)
    return Mesh(np.concatenate(vertices), joined, np.zeros(len(joined), np.int64), ("solid",))

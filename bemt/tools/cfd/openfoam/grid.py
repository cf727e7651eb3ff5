"""Grid of a case: a cylinder or a sector of one in hexahedra, refined and cut by snappyHexMesh.

The base grid is made of kites round the shaft (sectors of at most 120 deg, so that no corner is flat) and rings of
hexahedra outside. With many blades the kites shrink into the hub. Sectors are periodic by ``cyclicAMI``; parallel
snappyHexMesh aborts with such patches present, therefore they are plain at first and made by createPatch afterwards.

The rotating zone ends on planes of the base grid and, at the periodic sides, on one of its radii. Its cells are chosen
by their centres, and only there are they chosen alike on both sides however each is refined. Ends elsewhere made 11 %
of the mass flow of an eleven-bladed fan.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from bemt.base.foam_text import Entries, dictionary, vector
from bemt.tools.cfd.openfoam.settings import PIPE_RADIUS, Settings

SURFACE_LEVEL = 6
LINES = "lines.obj"
LINE_LEVEL = 4
GROWTH = 1.25
KITES = 1.3
"""Radius of the kites round the shaft over R; the rotating zone of an open rotor ends there too."""


def extent(s: Settings) -> tuple[float, float, float]:
    """Size of the domain. [m]"""
    if s.domain == "pipe":
        return PIPE_RADIUS * s.R, -8 * s.R, 5 * s.R
    size = max([s.R, *([s.duct.radius] if s.duct else []), 0.4 * s.plate_radius])
    low = -10 * size if s.plate_z is None else min(-6 * size, s.plate_z - 4 * size)
    return (6.0 if s.sideslip else 5.0) * size, low, 6 * size


MEAN_Y_PLUS = (0.28, 0.87)
"""Mean y+ over the blades of open rotors at rest, over that of `y_plus`: own runs (reports/cfd); in flight less. [1]"""
CELLS_PER_BLADE, MORE_A_LEVEL = 34_600, 3.6
"""Cells of a free open rotor at level 5, and factor from a level to the next: own runs (reports/cfd). [1]"""


def first_cell(s: Settings) -> float:
    """Height of the cells on the blades; the grid has no layers. [m]"""
    return float(s.base_cell / 2**SURFACE_LEVEL)


def y_plus(s: Settings, chord_m: float) -> float:
    """Distance of the first cell's centre from the blade at 0.75 R, of a chord, in wall units [1].

    Friction of a turbulent boundary layer on a flat plate, cf = 0.0592 Re^(-1/5) (H. Schlichting, "Boundary-Layer
    Theory", ch. XXI; not checked), at the chord's Reynolds number and the speed of the section.
    """
    W = math.hypot(0.75 * abs(s.omega) * s.R, s.V)
    cf = 0.0592 * (s.rho * W * chord_m / s.mu) ** -0.2
    return s.rho * W * math.sqrt(0.5 * cf) * 0.5 * first_cell(s) / s.mu


def cells(s: Settings) -> float:
    """Number of cells; NaN for what no own run measured. [1]"""
    if s.domain != "free" or s.duct is not None or s.body is not None or _narrow(s)[0]:
        return math.nan
    return float(CELLS_PER_BLADE * s.B / s.sectors * MORE_A_LEVEL ** (s.level - 5.0))


def _graded(length: float, first: float) -> tuple[int, float]:
    """Count and ratio of last to first of cells that grow away from one that is `first` wide."""
    count = max(1, round(math.log(1 + length * (GROWTH - 1) / first) / math.log(GROWTH)))
    return count, GROWTH ** (count - 1)


def _narrow(s: Settings) -> tuple[int, int]:
    """Halvings that the base cells of a narrow sector have already, and their number across half of it.

    The cells of a narrow sector are as wide as it allows, and as long and as high; the levels of refinement count from
    there. (0, 0) when the kites round the shaft can be larger than the rotor.
    """
    step = 2 * math.pi / s.sectors
    if s.sectors <= 2 or step >= math.radians(80):
        return 0, 0
    half = 0.4 * step * s.R
    across = max(1, round(half / s.base_cell))
    return max(0, round(math.log2(s.base_cell * across / half))), across


def _kites(s: Settings, radius: float, step: float, cell: float) -> tuple[float, float, int]:
    """Radius of the kites round the shaft and of their outer corners [m], and cells along their sides."""
    turning, across, planes = mrf_zone(s)[0], _narrow(s)[1], s.zone == "grid"
    inner = 0.6 * radius if s.domain == "pipe" else turning if planes else KITES * s.R
    if across:
        inner = 0.6 * s.Rhub
    mid = inner * (0.75 * math.sqrt(2.0) if step > 1.3 else 1 / math.cos(0.5 * step))
    fitting = math.ceil(inner / cell - 1e-9) if planes else round(inner / cell)
    return inner, mid, across or max(2, fitting, math.ceil(0.5 * step * max(s.R, inner) / cell))


def _outward(s: Settings, radius: float, inner: float, cell: float) -> tuple[int, str]:
    """Rings outside the kites, and their grading."""
    if s.domain == "pipe":
        return max(2, round((radius - inner) / cell)), "1"
    turning = mrf_zone(s)[0]
    if _narrow(s)[1] and s.zone == "grid":
        near_rings, near_ratio = _graded(turning - inner, cell)
        far_rings, far_ratio = _graded(radius - turning, cell * near_ratio * GROWTH)
        out = (f"(({turning - inner:.17g} {near_rings} {near_ratio:.6g}) "
               f"({radius - turning:.17g} {far_rings} {far_ratio:.6g}))")  # fmt: skip
        return near_rings + far_rings, out
    rings, ratio = _graded(radius - inner, cell)
    return rings, f"{ratio:.6g}"


def _upward(s: Settings, low: float, high: float, cell: float) -> tuple[int, str]:
    """Layers and their grading: even through rotor, bodies and rotating zone, growing beyond."""
    others = [body for body in (s.duct, s.body) if body is not None]
    near = [min([s.rotor.low, -1.5 * s.R, *(b.low - 0.3 * s.R for b in others)]),
            max([s.rotor.high, 0.75 * s.R, *(b.high + 0.3 * s.R for b in others)])]  # fmt: skip
    if s.plate_z is not None:
        near[0] = min(near[0], s.plate_z - 0.5 * s.R)
    stops, digits = near, 6
    if s.zone == "grid":
        _, zone_low, zone_high = mrf_zone(s)
        stops = [min(near[0], zone_low - 0.1 * s.R), zone_low, zone_high, max(near[1], zone_high + 0.1 * s.R)]
        digits = 17
    below, ratio_below = _graded(stops[0] - low, cell)
    above, ratio_above = _graded(high - stops[-1], cell)
    even = [(b - a, max(1, round((b - a) / cell)), 1.0) for a, b in itertools.pairwise(stops)]
    parts = [(stops[0] - low, below, 1 / ratio_below), *even, (high - stops[-1], above, ratio_above)]
    grading = " ".join(f"({length:.{digits}g} {cells} {ratio:.6g})" for length, cells, ratio in parts)
    return sum(cells for _, cells, _ in parts), f"({grading})"


def block_mesh(s: Settings) -> str:
    """Write ``blockMeshDict``."""
    radius, low, high = extent(s)
    planes = s.zone == "grid"
    if planes:
        low, high = _written(low), _written(high)
    angle = 2 * math.pi / s.sectors
    parts = math.ceil(angle / math.radians(120) - 1e-9) if s.sectors > 2 else 4 // s.sectors
    step = angle / parts
    cell = s.base_cell / 2 ** _narrow(s)[0]
    inner, mid, n = _kites(s, radius, step, cell)
    rings, out = _outward(s, radius, inner, cell)
    layers, z_grading = _upward(s, low, high, cell)
    turns = [-0.5 * angle + k * step for k in range(parts + (s.sectors > 1))]
    between = [t + 0.5 * step for t in turns[:parts]]
    points = [(0.0, 0.0)]
    for r, at in ((inner, turns), (mid, between), (radius, turns), (radius, between)):
        points += [(r * math.cos(t), r * math.sin(t)) for t in at]
    count, ends = len(points), len(turns)
    A = [1 + k % ends for k in range(parts + 1)]
    M = range(1 + ends, 1 + ends + parts)
    P = [1 + ends + parts + k % ends for k in range(parts + 1)]
    Q = range(1 + 2 * ends + parts, count)

    def lifted(*ids: int) -> tuple[int, ...]:
        return tuple(i + count for i in ids)

    def upright(a: int, b: int) -> tuple[int, ...]:
        return a, b, *lifted(b, a)

    blocks, arcs, side, floor = "", "", list[tuple[int, ...]](), list[tuple[int, ...]]()
    for k in range(parts):
        kite, first, second = (0, A[k], M[k], A[k + 1]), (A[k], P[k], Q[k], M[k]), (M[k], Q[k], P[k + 1], A[k + 1])
        for ids, cells, grading in ((kite, n, "1"), (first, rings, out), (second, rings, out)):
            blocks += (f"    hex {_ids(*ids, *lifted(*ids))} ({cells} {n} {layers}) "
                       f"simpleGrading ({grading} 1 {z_grading})\n")  # fmt: skip
            floor.append(ids)
        for a, b, t in ((P[k], Q[k], turns[0] + (k + 0.25) * step), (Q[k], P[k + 1], turns[0] + (k + 0.75) * step)):
            side.append(upright(a, b))
            for shift, z in ((0, low), (count, high)):
                on_arc = vector(radius * math.cos(t), radius * math.sin(t), z)
                arcs += f"    arc {a + shift} {b + shift} {on_arc}\n"
    spelled = _whole if planes else vector
    vertices = "".join(f"    {spelled(x, y, z)}\n" for z in (low, high) for x, y in points)
    patches: dict[str, list[tuple[int, ...]]] = {
        "inlet": [lifted(*ids) for ids in floor],
        "outlet": floor,
        "side": side,
    }
    if s.sectors > 1:
        patches |= {f"periodic{i}": [upright(0, A[k]), upright(A[k], P[k])] for i, k in ((1, 0), (2, parts))}
    boundary = "".join(_patch(name, faces) for name, faces in patches.items())
    head = dictionary("blockMeshDict", {"convertToMeters": 1}, note=f"base cell {cell:.4g} m")
    return (f"{head}\nvertices\n(\n{vertices});\n\nblocks\n(\n{blocks});\n\nedges\n(\n{arcs});\n\n"
            f"boundary\n(\n{boundary});\n\nmergePatchPairs\n(\n);\n")  # fmt: skip


def _ids(*ids: int) -> str:
    return f"({' '.join(map(str, ids))})"


def _patch(name: str, faces: Sequence[tuple[int, ...]]) -> str:
    rows = "".join(f"            {_ids(*ids)}\n" for ids in faces)
    return f"    {name}\n    {{\n        type patch;\n        faces\n        (\n{rows}        );\n    }}\n"


def mrf_zone(s: Settings) -> tuple[float, float, float]:
    """Cylinder that turns with the rotor. [m]

    It may reach into a duct's wall, which does not turn with it, but never beyond one. Its ends are planes of the base
    grid unless the settings say ``margin``, and are numbers of nine digits: the text of a case holds them whole.
    The tip of a long nose stays outside and at rest: what a zone leaks at the facets of its walls goes with its length.
    """
    margin = 0.15 * s.R
    low, high = s.rotor.low - margin, min(s.rotor.high, s.blades.high + margin) + margin
    if s.body is not None:
        low = max(low, 0.5 * (s.rotor.low + s.body.high))
    if s.plate_z is not None:
        low = max(low, 0.5 * (s.rotor.low + s.plate_z))
    if s.duct is not None:
        radius = 0.5 * (s.R + s.gap + s.duct.radius)
    else:
        radius = (1.5 if s.domain == "pipe" else KITES if s.zone == "grid" else 1.1) * s.R
    return (_written(radius), _written(low), _written(high)) if s.zone == "grid" else (radius, low, high)


def _whole(*components: float) -> str:
    """A vector with all its digits."""
    return f"({' '.join(f'{c + 0.0:.17g}' for c in components)})"


def _written(value: float) -> float:
    """The number that nine digits of text say."""
    return float(f"{value:.9g}")


def lines(s: Settings) -> str:
    """Write lines along the blades' pitch axes and in the duct's wall, from which refinement starts.

    snappyHexMesh looks for surfaces between the centres of neighbouring cells. A blade is thinner and narrower than the
    base cells and would be overlooked.
    """
    chains = []
    for k in range(s.B):
        turn = 2 * math.pi * k / s.B
        radii = [s.Rhub + (0.98 * s.R - s.Rhub) * i / 8 for i in range(9)]
        chains.append([(r * math.cos(turn), r * math.sin(turn), 0.0) for r in radii])
    if s.duct is not None:
        r = 0.5 * (s.R + s.gap + s.duct.radius)
        for f in (0.02, 0.25, 0.5, 0.75, 0.98):
            z = s.duct.low + f * (s.duct.high - s.duct.low)
            chains.append([(r * math.cos(t), r * math.sin(t), z) for t in (math.pi * i / 36 for i in range(73))])
    points, rows, count = "", "", 0
    for chain in chains:
        points += "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in chain)
        rows += "".join(f"l {count + i} {count + i + 1}\n" for i in range(1, len(chain)))
        count += len(chain)
    return points + rows


def _cylinder(low: float, high: float, radius: float) -> dict[str, object]:
    return {"type": "searchableCylinder", "point1": vector(0, 0, low), "point2": vector(0, 0, high), "radius": radius}


def _tips(s: Settings) -> dict[str, Entries]:
    """Boxes round the clearance of every blade in the domain."""
    out: dict[str, Entries] = {}
    inside = s.B // s.sectors
    depth = max(s.gap, 0.01 * s.R)
    wide = 2 * s.R * math.sin(min(s.blades.tip_half_angle + 0.02, 1.2))
    sag = s.R * (1 - math.cos(min(s.blades.tip_half_angle + 0.02, 1.2)))
    start, span = s.R - depth - sag, 2 * depth + s.gap + sag
    high = s.blades.tip_high - s.blades.tip_low + 4 * s.gap
    for k in range(inside):
        turn = 2 * math.pi * k / s.B
        e1, e2 = (math.cos(turn), math.sin(turn)), (-math.sin(turn), math.cos(turn))
        origin = [start * e1[i] - 0.5 * wide * e2[i] for i in (0, 1)]
        out[f"tip{k + 1}"] = {
            "type": "searchableRotatedBox", "span": vector(span, wide, high), "e1": vector(*e1, 0),
            "e3": vector(0, 0, 1), "origin": vector(*origin, s.blades.tip_low - 2 * s.gap),
        }  # fmt: skip
    return out


def snappy(s: Settings) -> str:
    """Write ``snappyHexMeshDict``."""
    R, cell = s.R, s.base_cell
    geometry: dict[str, object] = {f"{name}.stl": {"type": "triSurfaceMesh", "name": name} for name in s.surfaces}
    thick = 0.12 * R
    if s.plate_z is not None:
        geometry["plate"] = _cylinder(s.plate_z - thick, s.plate_z, s.plate_radius)
    reach = 1.15 * R if s.duct is None else s.duct.radius + 0.1 * R
    tail = s.plate_z if s.plate_z is not None else -4 * R
    geometry["disk"] = _cylinder(s.blades.low - 0.08 * R, s.blades.high + 0.08 * R, min(1.08 * R, reach))
    geometry["stream"] = _cylinder(max(-2.0 * R, tail), 0.35 * R, reach)
    geometry["wake"] = _cylinder(tail, 0.8 * R, 1.2 * reach)
    regions = {"disk": 3, "stream": 2, "wake": 1}
    level = {"blade": (SURFACE_LEVEL - 1, SURFACE_LEVEL), "hub": (4, 4), "duct": (3, 4), "stator": (4, 5),
             "centrebody": (4, 4), "plate": (2, 2)}  # fmt: skip
    if s.duct is not None and s.gap > 0:
        fine = math.ceil(math.log2(3 * cell / s.gap) - 0.25)
        boxes = _tips(s)
        geometry |= boxes
        regions |= dict.fromkeys(boxes, min(max(fine, SURFACE_LEVEL - 1), SURFACE_LEVEL + 1))
    shift = _narrow(s)[0]
    regions = {name: max(0, depth - shift) for name, depth in regions.items()}
    level = {name: (max(0, a - shift), max(0, b - shift)) for name, (a, b) in level.items()}
    surfaces = {name: {"level": level[name], "patchInfo": {"type": "wall"}}
                for name in (*s.surfaces, *(["plate"] if s.plate_z is not None else []))}  # fmt: skip
    radius, _, high = extent(s)
    inside = (
        0.537 * min(radius, R),
        0.0131 * R,
        0.5 * (high + max(b.high for b in (s.rotor, s.duct) if b)) + 0.0123 * R,
    )
    entries = {
        "castellatedMesh": True, "snap": True, "addLayers": False, "geometry": geometry,
        "castellatedMeshControls": {
            "maxLocalCells": 20000000, "maxGlobalCells": 40000000, "minRefinementCells": 0, "maxLoadUnbalance": 0.2,
            "nCellsBetweenLevels": 2, "resolveFeatureAngle": 20, "allowFreeStandingZoneFaces": True,
            "features": f"( {{ file \"{LINES}\"; level {LINE_LEVEL - shift}; }} )",
            "refinementSurfaces": surfaces,
            "refinementRegions": {k: {"mode": "inside", "levels": [(1e15, n)]} for k, n in regions.items()},
            "locationInMesh": vector(*inside),
        },
        "snapControls": {
            "nSmoothPatch": 3, "tolerance": 2.0, "nSolveIter": 40, "nRelaxIter": 5, "nFeatureSnapIter": 10,
            "implicitFeatureSnap": True, "explicitFeatureSnap": False, "multiRegionFeatureSnap": False,
        },
        "addLayersControls": {
            "relativeSizes": True, "layers": {}, "expansionRatio": 1.2, "finalLayerThickness": 0.5, "minThickness": 0.1,
            "nGrow": 0, "featureAngle": 60, "nRelaxIter": 3, "nSmoothSurfaceNormals": 1, "nSmoothNormals": 3,
            "nSmoothThickness": 10, "maxFaceThicknessRatio": 0.5, "maxThicknessToMedialRatio": 0.3,
            "minMedianAxisAngle": 90, "nBufferCellsNoExtrude": 0, "nLayerIter": 20,
        },
        "meshQualityControls": {
            "maxNonOrtho": 65, "maxBoundarySkewness": 20, "maxInternalSkewness": 4, "maxConcave": 80, "minVol": 1e-20,
            "minTetQuality": 1e-15, "minArea": -1, "minTwist": 0.02, "minDeterminant": 0.001, "minFaceWeight": 0.05,
            "minVolRatio": 0.01, "minTriangleTwist": -1, "nSmoothScale": 4, "errorReduction": 0.75,
            "relaxed": {"maxNonOrtho": 75},
        },
        "mergeTolerance": 1e-6,
    }  # fmt: skip
    return dictionary("snappyHexMeshDict", entries)


def topo_set(s: Settings) -> str:
    """Write ``topoSetDict``: the cells that turn."""
    radius, low, high = mrf_zone(s)
    where = {"p1": vector(0, 0, low), "p2": vector(0, 0, high), "radius": radius}
    actions: list[Entries] = [
        {"name": "turning", "type": "cellSet", "action": "new", "source": "cylinderToCell", **where},
        {"name": "turning", "type": "cellZoneSet", "action": "new", "source": "setToCellZone", "set": "turning"},
    ]
    body = "".join("    { " + " ".join(f"{k} {v if isinstance(v, str) else f'{v:.9g}'};" for k, v in a.items()) + " }\n"
                   for a in actions)  # fmt: skip
    return dictionary("topoSetDict", {}) + f"actions\n(\n{body});\n"


def create_patch(s: Settings) -> str:
    """Write ``createPatchDict``: the periodic sides."""
    rows = ""
    pairs = (("side1", "side2", "periodic1"), ("side2", "side1", "periodic2")) if s.sectors > 1 else ()
    for name, other, source in pairs:
        # side1 is the lower side: turned by plus the angle it falls on side2
        angle = 360 / s.sectors
        rows += (f"    {{\n        name {name};\n        patchInfo\n        {{\n            type cyclicAMI;\n"
                 f"            neighbourPatch {other};\n            transform rotational;\n"
                 f"            rotationAxis (0 0 1);\n            rotationCentre (0 0 0);\n"
                 f"            rotationAngle {angle:.9g};\n            lowWeightCorrection 0.2;\n"
                 f"            matchTolerance 0.0001;\n        }}\n"
                 f"        constructFrom patches;\n        patches ({source});\n    }}\n")  # fmt: skip
    return dictionary("createPatchDict", {"pointSync": False}) + f"patches\n(\n{rows});\n"


def set_fields(s: Settings) -> str:
    """Write ``setFieldsDict``: the run starts with a slipstream behind the disk."""
    tail = -5 * s.R if s.plate_z is None else s.plate_z
    front, radius = (0.1 * s.R, 0.85 * s.R) if s.duct is None else (s.duct.high, s.R)
    body = (f"defaultFieldValues\n(\n);\n\nregions\n(\n    cylinderToCell\n    {{\n        p1 {vector(0, 0, tail)};\n"
            f"        p2 {vector(0, 0, front)};\n        radius {radius:.9g};\n        fieldValues\n        (\n"
            f"            volVectorFieldValue U {vector(0, 0, -s.slipstream)}\n        );\n    }}\n);\n")  # fmt: skip
    return dictionary("setFieldsDict", {}) + body

"""OpenFOAM ``rotorDisk``: the load of BEMT prescribed through constant tables with fixed inflow, in a case that runs.

With ordinary tables ``rotorDisk`` is wrong for propellers: lift acts along the axis and drag in the plane, so that the
part cl sin(phi) of the torque is missing. Here cl and cd of a station are what its thrust and torque make of the
dynamic pressure that ``rotorDisk`` forms from the fixed inflow: ``q = (V^2 + (W r)^2) / 2``, per metre of span
``cl = T' / (q rho c B)``, ``cd = Q' / (r q rho c B)``, with a chord of 1 m.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.foam_text import dictionary, vector
from bemt.tools.exports.base import DiskExport, Files, Job
from bemt.tools.exports.performance import Loading

FAR = 8.0
"""Radius of the domain [R]."""
AHEAD, BEHIND = 8.0, 14.0
"""Ends of the domain [R]."""
THICK = 0.05
"""Height of the layer of cells that carries the load [R]."""
AROUND, ACROSS = 24, 48
"""Cells around a quarter and from hub to tip; a polygon of 96 sides shifts the load inwards by 0.05 % of r."""
TIP_CELL = 0.05
"""Last over first cell from hub to tip: the load falls to zero within the last hundredths of R."""
INTENSITY = 0.01

_SCRIPT = """#!/bin/sh
# Mesh and run; the load stands in log.simpleFoam from the first step: "Effective lift" is the thrust [N].
set -e
cd "$(dirname "$0")"
if [ -z "$WM_PROJECT_DIR" ] && [ -d /usr/share/openfoam ]; then export WM_PROJECT_DIR=/usr/share/openfoam; fi
blockMesh > log.blockMesh
simpleFoam > log.simpleFoam
"""


class RotorDiskExport(DiskExport):
    """A case of simpleFoam whose fvOptions carry the loads of one operating point."""

    id = "rotor-disk"
    title = "OpenFOAM rotorDisk with BEMT's load"
    holds = "T'(r), Q'(r) of one operating point, prescribed; the flow does not change them"
    features = frozenset({"torque", "rest", "reynolds", "mach", "rotation", "duct"})  # the load is that of the rotor
    conventions = (
        "axis +z along the thrust, free stream along -z, origin in the disk, metres; profile rows are (deg Cd Cl), "
        "blade rows (profile (r deg chord)); the solver prints lift = thrust/rho, its drag is no torque"
    )
    source = "OpenFOAM 1912 rotorDiskSource (calculate): f = q c B A/(2 pi r), force (0, -f Cd, f Cl)"
    told = (
        "cl and cd are loads over q, not section data: they hold at this rpm, airspeed and density alone",
        "in a mesh of your own: topoSetDict makes the zone; no cell centre on the axis; only cells with a face on the "
        "zone's +axis side are loaded; tipEffect stays above 1",
    )

    def write(self, job: Job) -> Files:
        """Whole case: ``./Allrun`` makes the mesh and runs."""
        p = job.loading
        nu = p.mu / p.rho
        speed = math.hypot(p.airspeed_m_s, math.sqrt(max(p.thrust_N, 0.0) / (2.0 * p.rho * math.pi * p.R**2)))
        k = 1.5 * (INTENSITY * speed) ** 2
        levels = {"k": k, "omega": k / (5.0 * nu), "nut": 5.0 * nu}
        return {
            "system/fvOptions": dictionary("fvOptions", {"disk": source(p)}, note=f"{job.case.name}, load by BEMT"),
            "system/blockMeshDict": _mesh(p),
            "system/controlDict": _control(),
            "system/fvSchemes": _schemes(),
            "system/fvSolution": _solution(),
            "system/topoSetDict": _zone(p),
            "constant/transportProperties": dictionary(
                "transportProperties", {"transportModel": "Newtonian", "nu": f"{nu:.9g}"}
            ),
            "constant/turbulenceProperties": dictionary(
                "turbulenceProperties",
                {"simulationType": "RAS", "RAS": {"RASModel": "kOmegaSST", "turbulence": "on", "printCoeffs": "off"}},
            ),
            **{f"0/{name}": text for name, text in _fields(p, levels).items()},
            "Allrun": _SCRIPT,
        }

    def notes(self, job: Job) -> list[str]:
        """What rotorDisk does and does not."""
        left = "left-handed rotor: rpm is positive and cd negative, which turns the torque round"
        return [*super().notes(job), *([left] if job.loading.sense < 0 else [])]

    def totals(self, job: Job, files: Files) -> tuple[float | None, float | None]:
        """Integrals of the written tables from hub to tip."""
        p = job.loading
        r, t, q = tables(p)
        fine = np.linspace(p.Rhub, p.R, 20001)
        return (float(np.trapezoid(np.interp(fine, r, t), fine)), float(np.trapezoid(np.interp(fine, r, q), fine)))


def tables(p: Loading) -> tuple[Array, Array, Array]:
    """Radii [m] from hub to tip, thrust and torque per metre [N/m], [N] of all blades, linear between radii.

    Scaled by one factor each, so that their integrals are the loads of the rotor.
    """
    r = np.concatenate([[p.Rhub], p.r, [p.R]])
    out = []
    for load, total in ((p.dT / p.dr, p.thrust_N), (p.dQ / p.dr, p.torque_Nm)):
        ends = np.concatenate([[load[0]], load, [load[-1]]])
        out.append(ends * total / float(np.trapezoid(ends, r)))
    return r, out[0], out[1]


def source(p: Loading) -> dict[str, Any]:
    """The entry of fvOptions."""
    coarse, thrust, torque = tables(p)
    r = np.sort(np.concatenate([coarse, 0.5 * (coarse[1:] + coarse[:-1])]))  # rotorDisk takes cl linear, not the load
    thrust, torque = np.interp(r, coarse, thrust), np.interp(r, coarse, torque)
    q = 0.5 * p.rho * (p.airspeed_m_s**2 + (p.omega * r) ** 2)
    cl = thrust / (q * p.blades)
    cd = p.sense * torque / (r * q * p.blades)
    inside = p.Rhub * (1.0 - 1e-6)
    rows = ["(none (0 0 1))", f"(none ({inside:.9g} 0 1))"]
    rows += [f"(s{i} ({x:.12g} 0 1))" for i, x in enumerate(r)]
    profiles = {"none": _constant(0.0, 0.0)} | {
        f"s{i}": _constant(a, b) for i, (a, b) in enumerate(zip(cl, cd, strict=True))
    }
    return {
        "type": "rotorDisk", "selectionMode": "cellZone", "cellZone": "rotorDisk", "fields": "(U)",
        "nBlades": p.blades, "tipEffect": 1.01, "inletFlowType": "fixed",
        "inletVelocity": vector(0.0, 0.0, -p.airspeed_m_s), "geometryMode": "specified", "origin": "(0 0 0)",
        "axis": "(0 0 1)", "refDirection": "(1 0 0)", "rpm": f"{p.rpm:.12g}", "trimModel": "fixedTrim",
        "rhoRef": f"{p.rho:.9g}", "rhoInf": 1, "fixedTrimCoeffs": {"theta0": 0, "theta1c": 0, "theta1s": 0},
        "flapCoeffs": {"beta0": 0, "beta1c": 0, "beta2s": 0}, "blade": {"data": f"({' '.join(rows)})"},
        "profiles": profiles,
    }  # fmt: skip


def _constant(cl: float, cd: float) -> dict[str, str]:
    return {"type": "lookup", "data": f"((-180 {cd:.12g} {cl:.12g}) (180 {cd:.12g} {cl:.12g}))"}


def _zone(p: Loading) -> str:
    h = 0.5 * THICK * p.R
    text = dictionary("topoSetDict", {}, note="only for a mesh of your own: blockMesh makes the zone here")
    return f"""{text}actions
(
    {{
        name rotorDisk;
        type cellZoneSet;
        action new;
        source cylinderToCell;
        p1 {vector(0, 0, -h)}; p2 {vector(0, 0, h)}; radius {p.R:.9g};
    }}
);
"""


def _mesh(p: Loading) -> str:
    """O-grid whose rings are hub and tip: the disk's area is exact but for the polygon."""
    R = p.R
    z = [-BEHIND * R, -0.5 * THICK * R, 0.5 * THICK * R, AHEAD * R]
    rings = [0.55 * p.Rhub, p.Rhub, R, FAR * R]
    angles = [math.radians(45.0 + 90.0 * k) for k in range(4)]
    points = [f"({a * math.cos(t):.9g} {a * math.sin(t):.9g} {h:.9g})" for h in z for a in rings for t in angles]

    def at(level: int, ring: int, quarter: int) -> int:
        return (level * len(rings) + ring) * 4 + quarter % 4

    g = TIP_CELL ** (1.0 / (ACROSS - 1))
    last = (R - p.Rhub) * TIP_CELL * (1.0 - g) / (1.0 - g**ACROSS)
    radial = [2, ACROSS, 24]
    axial = [40, 1, 24]
    growth = [1.0, TIP_CELL, _ratio((FAR - 1.0) * R, last, radial[2])]
    up = [1.0 / _ratio(z[1] - z[0], THICK * R, axial[0]), 1.0, _ratio(z[3] - z[2], THICK * R, axial[2])]
    blocks, edges = [], []
    for level in range(3):

        def corners(a: list[tuple[int, int]], low: int = level) -> str:
            return " ".join(str(at(h, ring, quarter)) for h in (low, low + 1) for ring, quarter in a)

        core = corners([(0, 0), (0, 1), (0, 2), (0, 3)])
        blocks.append(f"hex ({core}) ({AROUND} {AROUND} {axial[level]}) simpleGrading (1 1 {up[level]:.9g})")
        for ring in range(3):
            for k in range(4):
                ids = corners([(ring, k), (ring + 1, k), (ring + 1, k + 1), (ring, k + 1)])
                zone = " rotorDisk" if level == 1 and ring == 1 else ""
                blocks.append(
                    f"hex ({ids}){zone} ({radial[ring]} {AROUND} {axial[level]}) "
                    f"simpleGrading ({growth[ring]:.9g} 1 {up[level]:.9g})"
                )
    for level, h in enumerate(z):
        for ring in range(1, 4):
            for k in range(4):
                t = angles[k] + math.pi / 4.0
                mid = f"({rings[ring] * math.cos(t):.9g} {rings[ring] * math.sin(t):.9g} {h:.9g})"
                edges.append(f"arc {at(level, ring, k)} {at(level, ring, k + 1)} {mid}")

    def cap(level: int) -> str:
        faces = [f"({' '.join(str(at(level, 0, k)) for k in range(4))})"]
        faces += [
            f"({at(level, ring, k)} {at(level, ring + 1, k)} {at(level, ring + 1, k + 1)} {at(level, ring, k + 1)})"
            for ring in range(3)
            for k in range(4)
        ]
        return " ".join(faces)

    side = " ".join(
        f"({at(lv, 3, k)} {at(lv, 3, k + 1)} {at(lv + 1, 3, k + 1)} {at(lv + 1, 3, k)})"
        for lv in range(3)
        for k in range(4)
    )
    patches = "\n".join(
        f"    {name} {{ type patch; faces ({faces}); }}"
        for name, faces in (("inlet", cap(3)), ("outlet", cap(0)), ("side", side))
    )
    body = "\n".join(
        [
            "convertToMeters 1;", f"vertices ({' '.join(points)});", "blocks\n(", *(f"    {b}" for b in blocks), ");",
            "edges\n(", *(f"    {e}" for e in edges), ");", f"boundary\n(\n{patches}\n);",
        ]
    )  # fmt: skip
    return (
        dictionary("blockMeshDict", {}, note="O-grid: square core inside the hub, rings at hub and tip") + body + "\n"
    )


def _ratio(length: float, first: float, cells: int) -> float:
    """Last over first cell of a geometric row of so many cells that fills a length."""
    low, high = 1.0 + 1e-9, 3.0
    for _ in range(80):
        g = 0.5 * (low + high)
        low, high = (g, high) if first * (g**cells - 1.0) / (g - 1.0) < length else (low, g)
    return float(g ** (cells - 1))


def _fields(p: Loading, levels: dict[str, float]) -> dict[str, str]:
    V = p.airspeed_m_s
    wind = f"uniform {vector(0, 0, -V)}"
    quiet_U = {"type": "pressureInletOutletVelocity", "value": "uniform (0 0 0)"}
    quiet_p = {"type": "totalPressure", "p0": "uniform 0", "value": "uniform 0"}
    if V > 0.0:
        U = {
            "inlet": {"type": "fixedValue", "value": wind},
            "outlet": {"type": "inletOutlet", "inletValue": wind, "value": wind},
            "side": {"type": "freestreamVelocity", "freestreamValue": wind, "value": wind},
        }
        P = {
            "inlet": {"type": "zeroGradient"},
            "outlet": {"type": "fixedValue", "value": "uniform 0"},
            "side": {"type": "freestreamPressure", "freestreamValue": "uniform 0", "value": "uniform 0"},
        }
    else:
        U = dict.fromkeys(("inlet", "outlet", "side"), quiet_U)
        P = dict.fromkeys(("inlet", "outlet", "side"), quiet_p)
    kinds = {
        "U": ("volVectorField", "[0 1 -1 0 0 0 0]"), "p": ("volScalarField", "[0 2 -2 0 0 0 0]"),
        "k": ("volScalarField", "[0 2 -2 0 0 0 0]"), "omega": ("volScalarField", "[0 0 -1 0 0 0 0]"),
        "nut": ("volScalarField", "[0 2 -1 0 0 0 0]"),
    }  # fmt: skip
    out = {}
    for name, (kind, dims) in kinds.items():
        if name == "U":
            start, patches = wind, U
        elif name == "p":
            start, patches = "uniform 0", P
        else:
            start = f"uniform {levels[name]:.9g}"
            flow = {"type": "inletOutlet", "inletValue": start, "value": start}
            patches = dict.fromkeys(
                ("inlet", "outlet", "side"), {"type": "calculated", "value": start} if name == "nut" else flow
            )
        out[name] = dictionary(name, {"dimensions": dims, "internalField": start, "boundaryField": patches}, kind)
    return out


def _control() -> str:
    return dictionary(
        "controlDict",
        {
            "application": "simpleFoam", "startFrom": "startTime", "startTime": 0, "stopAt": "endTime",
            "endTime": 400, "deltaT": 1, "writeControl": "timeStep", "writeInterval": 400, "writeFormat": "ascii",
            "writePrecision": 9, "timeFormat": "general", "runTimeModifiable": False,
        },
    )  # fmt: skip


def _schemes() -> str:
    upwind = "bounded Gauss upwind"
    return dictionary(
        "fvSchemes",
        {
            "ddtSchemes": {"default": "steadyState"},
            "gradSchemes": {"default": "Gauss linear", "limited": "cellLimited Gauss linear 1"},
            "divSchemes": {
                "default": "none", "div(phi,U)": "bounded Gauss linearUpwind limited", "div(phi,k)": upwind,
                "div(phi,omega)": upwind, "div((nuEff*dev2(T(grad(U)))))": "Gauss linear",
            },
            "laplacianSchemes": {"default": "Gauss linear corrected"},
            "interpolationSchemes": {"default": "linear"},
            "snGradSchemes": {"default": "corrected"},
            "wallDist": {"method": "meshWave"},
        },
    )  # fmt: skip


def _solution() -> str:
    smooth = {"solver": "smoothSolver", "smoother": "symGaussSeidel", "tolerance": 1e-9, "relTol": 0.1}
    return dictionary(
        "fvSolution",
        {
            "solvers": {
                "p": {"solver": "GAMG", "smoother": "GaussSeidel", "tolerance": 1e-9, "relTol": 0.05},
                '"(U|k|omega)"': smooth,
            },
            "SIMPLE": {"nNonOrthogonalCorrectors": 0, "consistent": False, "pRefCell": 0, "pRefValue": 0},
            "relaxationFactors": {"fields": {"p": 0.3}, "equations": {"U": 0.6, '"(k|omega)"': 0.5}},
        },
    )

"""The OpenFOAM case of a case file: surfaces, dictionaries and ``Allrun``, ready to run."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, needs, refuse
from bemt.base.foam_text import Entries, dictionary, vector
from bemt.base.tables import write_atomic
from bemt.base.toml import check_field, entry
from bemt.base.toml_text import Collector
from bemt.rotors.case import Case
from bemt.rotors.case.schema import PointTable
from bemt.tools.cfd.openfoam.grid import (
    MEAN_Y_PLUS,
    block_mesh,
    cells,
    create_patch,
    first_cell,
    lines,
    set_fields,
    snappy,
    topo_set,
    y_plus,
)
from bemt.tools.cfd.openfoam.run import all_run, control
from bemt.tools.cfd.openfoam.settings import (
    DOMAINS,
    MACH_COMPRESSIBLE,
    SECTORS,
    TURBULENCE,
    Body,
    RunSweep,
    Settings,
    sector_choice,
)
from geometry.common import GeometryError
from geometry.export import MANIFEST, export
from geometry.mesh import Options, build
from geometry.solid import centre_body, plan_stator, revolve

if TYPE_CHECKING:
    from geometry.duct import Duct
    from geometry.mesh import MeshModel
    from geometry.rotor import Rotor


# Flow of a case: fields with their boundary conditions, models, schemes, the frame that turns.
#
# Incompressible runs take simpleFoam. Compressible runs take rhoSimpleFoam with one of two gases:
#
# ``isentropic``
#     ``adiabaticPerfectFluid``: density follows pressure along the isentrope, rho = rho0 (p/p0)^(1/gamma). The energy
#     equation has no say. Right for attached flow up to weak shocks.
# ``perfect``
#     Density from the energy equation. In a turning frame that equation needs the work of pressure on moving walls,
#     div(p Omega x r); version 1912 lacks the term (later ESI versions have ``fvc::div(MRF.phi(), p)`` in ``EEqn.H``),
#     so the gas at a blade COOLS by U^2/2cp instead of warming by that much. Kept to show what it does.

CP = 1005.0
PRANDTL = 0.71
GAMMA = 1.4
INTENSITY = 0.01
VISCOSITY_RATIO = 5.0
DIMENSIONS = {
    "U": "[0 1 -1 0 0 0 0]", "p": "[0 2 -2 0 0 0 0]", "k": "[0 2 -2 0 0 0 0]", "omega": "[0 0 -1 0 0 0 0]",
    "epsilon": "[0 2 -3 0 0 0 0]", "nut": "[0 2 -1 0 0 0 0]", "T": "[0 0 0 1 0 0 0]", "alphat": "[1 -1 -1 0 0 0 0]",
}  # fmt: skip


Patch = Mapping[str, Entries]
"""Conditions on a patch, by field."""


def _outer(s: Settings) -> Mapping[str, Patch]:
    """Conditions of U and p on inlet, outlet and side."""
    wind, still = f"uniform {vector(*s.wind)}", "uniform (0 0 0)"
    p = f"uniform {s.pressure:.9g}" if s.compressible else "uniform 0"
    total: dict[str, object] = {"type": "totalPressure", "p0": p, "value": p}
    if s.compressible:
        total |= {"rho": "rho", "psi": "none", "gamma": 1}
    quiet: Patch = {"U": {"type": "pressureInletOutletVelocity", "value": still}, "p": total}
    slip: Patch = {"U": {"type": "slip"}, "p": {"type": "zeroGradient"}}
    if s.V == 0:
        return {"inlet": quiet, "outlet": quiet, "side": slip if s.domain == "pipe" else quiet}
    inlet = {"U": {"type": "fixedValue", "value": wind}, "p": {"type": "zeroGradient"}}
    outlet = {"U": {"type": "inletOutlet", "inletValue": wind, "value": wind}, "p": {"type": "fixedValue", "value": p}}
    far = {"U": {"type": "freestreamVelocity", "freestreamValue": wind, "value": wind},
           "p": {"type": "freestreamPressure", "freestreamValue": p, "value": p}}  # fmt: skip
    return {"inlet": inlet, "outlet": outlet, "side": slip if s.domain == "pipe" else far}


def _levels(s: Settings) -> dict[str, float]:
    """Turbulence far away: 1 % of the speed in the disk, five times the molecular viscosity."""
    nu = s.mu / s.rho
    k = 1.5 * (INTENSITY * max(s.V, s.slipstream)) ** 2
    omega = k / (VISCOSITY_RATIO * nu)
    return {"k": k, "omega": omega, "epsilon": 0.09 * k * omega, "nut": VISCOSITY_RATIO * nu}


def fields(s: Settings) -> dict[str, str]:
    """Write the initial fields."""
    outer, level = _outer(s), _levels(s)
    scalar = "omega" if s.turbulence == "kOmegaSST" else "epsilon"
    names = ["U", "p", "k", scalar, "nut", *(["T", "alphat"] if s.compressible else [])]
    walls = [*s.surfaces, *(["plate"] if s.plate_z is not None else [])]
    out = {}
    for name in names:
        start = {"U": f"uniform {vector(*s.wind)}", "p": f"uniform {s.pressure:.9g}" if s.compressible else "uniform 0",
                 "T": f"uniform {s.temperature:.9g}", "alphat": "uniform 0"}.get(name)  # fmt: skip
        start = start or f"uniform {level[name]:.6g}"
        conditions: dict[str, Entries] = {
            "U": {"type": "fixedValue", "value": "uniform (0 0 0)"}, "p": {"type": "zeroGradient"},
            "k": {"type": "kqRWallFunction", "value": start}, "omega": {"type": "omegaWallFunction", "value": start},
            "epsilon": {"type": "epsilonWallFunction", "value": start},
            "nut": {"type": "nutkWallFunction", "value": "uniform 0"}, "T": {"type": "zeroGradient"},
            "alphat": {"type": "compressible::alphatWallFunction", "Prt": 0.85, "value": "uniform 0"},
        }  # fmt: skip
        boundary: dict[str, object] = {}
        for patch, known in outer.items():
            if name in known:
                boundary[patch] = known[name]
            elif name in ("nut", "alphat"):
                boundary[patch] = {"type": "calculated", "value": start}
            elif known["U"]["type"] == "slip":
                boundary[patch] = {"type": "slip"}
            else:
                boundary[patch] = {"type": "inletOutlet", "inletValue": start, "value": start}
        boundary |= dict.fromkeys(walls, conditions[name])
        if s.sectors > 1:
            boundary |= {"side1": {"type": "cyclicAMI", "value": start}, "side2": {"type": "cyclicAMI", "value": start}}
        boundary['"proc.*"'] = {"type": "processor", "value": start}
        dimensions = "[1 -1 -2 0 0 0 0]" if name == "p" and s.compressible else DIMENSIONS[name]
        kind = "volVectorField" if name == "U" else "volScalarField"
        entries = {"dimensions": dimensions, "internalField": start, "boundaryField": boundary}
        out[name] = dictionary(name, entries, kind)
    return out


def constants(s: Settings) -> dict[str, str]:
    """Write the files of ``constant``."""
    # Periodic sides too: cyclicAMI does not count as coupled here, and the flow through it would be set to zero
    standing = [*s.walls, *(["side"] if s.domain == "pipe" else []), *(["side1", "side2"] if s.sectors > 1 else [])]
    zone = {"cellZone": "turning", "active": True, "nonRotatingPatches": standing, "origin": vector(0, 0, 0),
            "axis": vector(0, 0, 1), "omega": s.omega}  # fmt: skip
    ras = {"RASModel": s.turbulence, "turbulence": True, "printCoeffs": False}
    out = {
        "MRFProperties": dictionary("MRFProperties", {"rotor": zone}, note=f"{s.rpm:g} rev/min"),
        "turbulenceProperties": dictionary("turbulenceProperties", {"simulationType": "RAS", "RAS": ras}),
    }
    if not s.compressible:
        transport = {"transportModel": "Newtonian", "nu": s.mu / s.rho}
        return out | {"transportProperties": dictionary("transportProperties", transport)}
    isentropic = s.gas == "isentropic"
    kind = {
        "type": "heRhoThermo" if isentropic else "hePsiThermo", "mixture": "pureMixture", "transport": "const",
        "thermo": "hConst", "equationOfState": "adiabaticPerfectFluid" if isentropic else "perfectGas",
        "specie": "specie", "energy": "sensibleEnthalpy",
    }  # fmt: skip
    mixture: dict[str, object] = {
        "specie": {"molWeight": 8314.46 / 287.05},
        "thermodynamics": {"Cp": CP, "Hf": 0},
        "transport": {"mu": s.mu, "Pr": PRANDTL},
    }
    if isentropic:
        mixture["equationOfState"] = {"p0": s.pressure, "rho0": s.rho, "gamma": GAMMA, "B": 0}
    limit = {"type": "limitTemperature", "active": True, "selectionMode": "all", "min": 0.6 * s.temperature,
             "max": 1.6 * s.temperature}  # fmt: skip
    out["thermophysicalProperties"] = dictionary("thermophysicalProperties", {"thermoType": kind, "mixture": mixture})
    return out | {"fvOptions": dictionary("fvOptions", {"limit": limit})}


def schemes(s: Settings) -> str:
    """Write ``fvSchemes``: second order for momentum, first for turbulence."""
    upwind = "bounded Gauss upwind"
    div: dict[str, object] = {"default": "none", "div(phi,U)": "bounded Gauss linearUpwind limited",
                           **{f"div(phi,{name})": upwind for name in ("k", "omega", "epsilon")}}  # fmt: skip
    if s.compressible:
        div |= {"div(phi,h)": upwind, "div(phi,K)": upwind, "div(phi,Ekp)": upwind,
                "div(((rho*nuEff)*dev2(T(grad(U)))))": "Gauss linear"}  # fmt: skip
    else:
        div |= {"div((nuEff*dev2(T(grad(U)))))": "Gauss linear"}
    return dictionary("fvSchemes", {
        "ddtSchemes": {"default": "steadyState"},
        "gradSchemes": {"default": "cellLimited Gauss linear 1", "grad(p)": "Gauss linear",
                        "limited": "cellLimited Gauss linear 1"},
        "divSchemes": div, "laplacianSchemes": {"default": "Gauss linear limited corrected 0.33"},
        "interpolationSchemes": {"default": "linear"}, "snGradSchemes": {"default": "limited corrected 0.33"},
        "wallDist": {"method": "meshWave"},
    })  # fmt: skip


def solution(s: Settings) -> str:
    """Write ``fvSolution``: SIMPLE with p 0.3 and U 0.6; SIMPLEC diverged."""
    smooth = {"solver": "smoothSolver", "smoother": "symGaussSeidel", "tolerance": 1e-9, "relTol": 0.1}
    simple: dict[str, object] = {"nNonOrthogonalCorrectors": 0, "consistent": False}
    relax: dict[str, object] = {"p": 0.3}
    if s.compressible:
        simple |= {"pMinFactor": 0.3, "pMaxFactor": 2.0, "transonic": False}
        relax["rho"] = 0.3
    return dictionary("fvSolution", {
        "solvers": {
            "p": {"solver": "GAMG", "smoother": "GaussSeidel", "tolerance": 1e-9, "relTol": 0.1, "maxIter": 30},
            '"(U|k|omega|epsilon|h)"': smooth,
        },
        "SIMPLE": simple,
        "relaxationFactors": {"fields": relax, "equations": {"U": 0.6, '"(k|omega|epsilon|h)"': 0.5}},
    })  # fmt: skip


def case_files(s: Settings, title: str = "") -> dict[str, str]:
    """Write every file of a case, the surfaces in ``constant/triSurface`` aside."""
    title = title or f"rotor of {2e3 * s.R:g} mm, {s.B} blades, {s.rpm:g} rev/min, {s.V:g} m/s"
    out = {
        "system/blockMeshDict": block_mesh(s), "system/snappyHexMeshDict": snappy(s), "system/topoSetDict": topo_set(s),
        "system/createPatchDict": create_patch(s), "system/setFieldsDict": set_fields(s),
        "system/controlDict": control(s),
        "system/fvSchemes": schemes(s), "system/fvSolution": solution(s), "Allrun": all_run(s, title),
        "constant/triSurface/lines.obj": lines(s),
    }  # fmt: skip
    out |= {f"0.orig/{name}": text for name, text in fields(s).items()}
    return out | {f"constant/{name}": text for name, text in constants(s).items()}


FACETS = 96  # of the centre body


class RunTable(PointTable):
    """What an export may ask of a :class:`Run`; None is its default."""

    sideslip_deg: float | None = entry("angle between shaft and wind", "deg", 0, 90)
    level: float | None = entry("fineness of the grid", "", 4, 9)
    solver: Literal["incompressible", "compressible"] | None = entry("by the tip Mach number if omitted")
    sector: str | None = entry("meshed part of the disk; the smallest possible if omitted", choices=SECTORS)
    domain: str | None = entry("free air, or a pipe of the rotor's diameter", choices=DOMAINS)
    turbulence: str | None = entry("model", choices=TURBULENCE)


@dataclass(frozen=True)
class Run:
    """What is asked of a CFD run; the case gives the rest."""

    # Operating point; None is the case's [rev/min, m/s]
    rpm: float | None = None
    airspeed_m_s: float | None = None
    # Angle between shaft and wind, 0 to 90. With a frozen rotor (MRF) this is an approximation: the blades are seen at
    # one azimuth only [deg]
    sideslip_deg: float = 0.0
    # ``incompressible`` or ``compressible``; None decides by the helical tip Mach number, compressible above 0.5
    solver: str | None = None
    # Where a round plate stands behind the rotor, and its radius [R]
    wall_distance_over_R: float | None = None
    plate_radius_over_R: float = 2.0
    sector: str | None = None  # None is the smallest that fits
    # As in :class:`bemt.tools.cfd.openfoam.settings.Settings`
    gas: str = Settings.gas
    domain: str = Settings.domain
    turbulence: str = Settings.turbulence
    level: float = Settings.level
    iterations: int = Settings.iterations
    average: int = Settings.average
    ranks: int = Settings.ranks
    zone: str = Settings.zone


def check_run(run: Run, file: str = "") -> list[Fault]:
    """Find the numbers of a run that are not finite or out of range, and unknown words.

    >>> for fault in check_run(Run(rpm=float("nan"), level=20.0)): print(fault)
    rpm: got nan; expected a number from 10 to 300000 rev/min.
    level: got 20; expected a number from 4 to 9.
    """
    out = Collector(file)
    for key in RunTable.named():
        value = getattr(run, key)
        if value is not None:
            check_field(out, key, RunTable, key, value)
    return out.faults


def _standing(duct: Duct | None, parts: int) -> tuple[Duct | None, bool]:
    """Duct that fits into a sector, and whether its vanes had to be left out."""
    if duct is None or duct.stator is None or duct.stator.B % parts == 0:
        return duct, False
    return replace(duct, stator=None), True


def _outline(rotor: Rotor, duct: Duct, model: MeshModel) -> np.ndarray | None:
    """Outline of the centre body that carries the vanes."""
    mesh = model.rotor
    back = float(mesh.vertices[np.unique(mesh.part("hub")), 2].min())
    plan = plan_stator(duct, back, rotor.Rhub)
    return None if plan is None else centre_body(duct, plan)


@lru_cache(maxsize=4)
def _mesh(rotor: Rotor, duct: Duct | None, options: Options | None) -> MeshModel:
    """Mesh of a rotor, which is one object per geometry: the points of a campaign share it."""
    return build(rotor, duct, options)


def _solids(
    case: Case, rotor: Rotor, sector: str, options: Options | None
) -> tuple[Duct | None, MeshModel, np.ndarray | None, bool]:
    """Duct that fits into the sector, mesh, outline of the centre body, and whether the vanes had to be left out."""
    whole = case.duct()
    duct, left_out = _standing(whole, {"half": 2, "blade": rotor.B}.get(sector, 1))
    try:
        model = _mesh(rotor, duct, options)
        body = None if whole is None else _outline(rotor, whole, model)
    except GeometryError as error:
        raise InputError([Fault(case.path.as_posix(), *fault) for fault in error.faults]) from error
    return duct, model, body, left_out


def _extent(z: np.ndarray, radius: float) -> Body:
    """Body between the ends along the shaft."""
    return Body(float(z.min()), float(z.max()), float(radius))


def _sweep(model: MeshModel, rotor: Rotor) -> RunSweep:
    """Where the blades and their tips turn."""
    blade = model.rotor.vertices[np.unique(model.rotor.part("blade"))]
    tip = blade[np.hypot(blade[:, 0], blade[:, 1]) > 0.985 * rotor.R]
    azimuth = np.arctan2(tip[:, 1], tip[:, 0])
    first = np.abs(azimuth) < math.pi / max(rotor.B, 2)
    return RunSweep(float(blade[:, 2].min()), float(blade[:, 2].max()), float(tip[:, 2].min()), float(tip[:, 2].max()),
                    float(np.abs(azimuth[first]).max()))  # fmt: skip


def _grid_words(s: Settings, chord_m: float) -> str:
    """What the grid will be, before it is made."""
    count, y = cells(s), y_plus(s, chord_m)
    size = "" if math.isnan(count) else f"about {float(f'{count:.2g}'):,.0f} cells; "
    low, high = MEAN_Y_PLUS
    mean = f" (the mean over blades: {low:.1g} to {high:.1g} of it in own runs at rest, less in flight)"
    near = f"first cell {1e3 * first_cell(s):.2g} mm high, y+ near {y:.2g} at 0.75 R by the friction of a flat plate"
    return f"expected grid: {size}{near}{mean}; the level sets both"


def _notes(s: Settings, mach: float, left_out: bool, chord_m: float) -> list[str]:
    """What a reader of the run has to know."""
    said = {
        _grid_words(s, chord_m): True,
        f"tip Mach number {mach:.3f}: {'compressible' if s.compressible else 'incompressible'}": True,
        "the vanes do not fit into the sector: left out, their centre body is there": left_out,
        "oblique flow with a frozen rotor is an approximation: one azimuth of the blades": bool(s.sideslip),
        "energy equation without the work of the turning frame: temperatures at the blade are wrong":
            s.compressible and s.gas == "perfect",
    }  # fmt: skip
    return [note for note, holds in said.items() if holds]


@dataclass(frozen=True, eq=False)
class RunShapes:
    """Shapes of a run, the outline of the centre body behind the rotor, and what a reader has to know."""

    rotor: Rotor
    duct: Duct | None
    tail: Array | None
    notes: list[str]
    model: MeshModel


def settings_of(case: Case, run: Run, options: Options | None = None) -> tuple[Settings, RunShapes]:
    """Work out the settings of a run."""
    file = case.path.as_posix()
    faults = check_run(run, file=file)
    refuse(faults)
    rotor, air = case.rotor(), case.air()
    rpm = case.rpm if run.rpm is None else run.rpm
    V = case.airspeed_m_s if run.airspeed_m_s is None else run.airspeed_m_s
    if case.angle_deg and run.sideslip_deg != case.angle_deg:
        got, hint = f"{case.angle_deg:g} deg", f"The run has {run.sideslip_deg:g} deg: give both the same angle"
        raise InputError(Fault(file, "operating.angle_deg", got, "0, or that of the run", hint))
    sideslip = math.radians(run.sideslip_deg)
    sector = run.sector or sector_choice(rotor.B, sideslip)
    duct, model, body, left_out = _solids(case, rotor, sector, options)
    points, chord = model.rotor.vertices, float(rotor.blade.at(0.75 * rotor.R)[0])
    surfaces = [name for part in model.parts for name in part.names]
    solid = None if model.duct is None else model.duct.vertices
    around = None if solid is None else _extent(solid[:, 2], np.hypot(*solid[:, :2].T).max())
    inner = None if body is None else _extent(body[:, 1], body[:, 0].max())
    tail = body if left_out else None  # else it is of one piece with vanes and duct
    if tail is not None:
        surfaces.append("centrebody")
    rho, mu, a = float(air.rho), float(air.mu), float(air.a_sound)
    temperature = a * a / (1.4 * 287.05)
    mach = math.hypot(rpm * math.pi / 30 * rotor.R, V) / a
    compressible = mach > MACH_COMPRESSIBLE if run.solver is None else run.solver == "compressible"
    plate = None if run.wall_distance_over_R is None else -run.wall_distance_over_R * rotor.R
    try:
        settings = Settings(
            R=rotor.R, Rhub=rotor.Rhub, B=rotor.B, rotation=rotor.rotation,
            rotor=_extent(points[:, 2], rotor.R), blades=_sweep(model, rotor), rpm=rpm, rho=rho,
            mu=mu, a_sound=a, temperature=temperature, V=V, sideslip=sideslip, sector=sector, domain=run.domain,
            level=run.level, turbulence=run.turbulence, compressible=compressible, gas=run.gas, duct=around, body=inner,
            gap=0.0 if duct is None else duct.gap, plate_z=plate, plate_radius=run.plate_radius_over_R * rotor.R,
            pitch=2 * math.pi * 0.75 * rotor.R * math.tan(float(rotor.blade.at(0.75 * rotor.R)[1])),
            iterations=run.iterations, average=run.average, ranks=run.ranks, zone=run.zone,
            surfaces=tuple(surfaces),
        )  # fmt: skip
    except InputError as error:
        raise InputError([replace(fault, file=fault.file or file) for fault in error.faults]) from error
    return settings, RunShapes(rotor, duct, tail, _notes(settings, mach, left_out, chord), model)


def write_openfoam(case: Case, out: Path, run: Run, options: Options | None = None) -> dict[str, Any]:
    """Write a whole case: ``cd OUT && ./Allrun`` runs it."""
    settings, parts = settings_of(case, run, options)
    manifest = export(parts.rotor, parts.duct, out, ["openfoam"], name=case.name, options=options, model=parts.model)
    if parts.tail is not None:
        trimesh = needs("trimesh", "cad")

        solid = trimesh.Trimesh(*revolve(parts.tail, FACETS), process=False)
        data = str(solid.export(file_type="stl_ascii")).encode()
        path = "constant/triSurface/centrebody.stl"
        write_atomic(out / path, data)
        surface = {"name": "centrebody", "triangles": len(solid.faces), "area_m2": float(solid.area)}
        manifest["files"].append({"path": path, "format": "openfoam", "unit": "m", "watertight": True,
                                  "surfaces": [surface], "bytes": len(data),
                                  "sha256": hashlib.sha256(data).hexdigest()})  # fmt: skip
    files = case_files(settings, case.title)
    for name, text in files.items():
        write_atomic(out / name, text)
    os.chmod(out / "Allrun", 0o755)
    manifest["openfoam"] = {
        "version": 1912, "solver": "rhoSimpleFoam" if settings.compressible else "simpleFoam",
        "gas": settings.gas if settings.compressible else "incompressible", "turbulence": settings.turbulence,
        "sector": settings.sector, "sectors": settings.sectors, "domain": settings.domain, "level": settings.level,
        "rpm": settings.rpm, "airspeed_m_s": settings.V, "sideslip_deg": run.sideslip_deg,
        "density_kg_m3": settings.rho, "iterations": settings.iterations, "averaged": settings.average,
        "notes": parts.notes,
        "files": {name: hashlib.sha256(text.encode()).hexdigest() for name, text in sorted(files.items())},
    }  # fmt: skip
    write_atomic(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    return manifest

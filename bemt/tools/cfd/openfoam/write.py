"""The OpenFOAM case of a case file: surfaces, dictionaries and ``Allrun``, ready to run."""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bemt.base.errors import Fault, InputError, needs
from bemt.base.tables import write_atomic
from bemt.base.toml import check_field, entry
from bemt.base.toml_text import Collector
from bemt.rotors.case import Case
from bemt.rotors.case.schema import PointTable
from bemt.tools.cfd.openfoam.flow import constants, fields, schemes, solution
from bemt.tools.cfd.openfoam.grid import block_mesh, create_patch, lines, set_fields, snappy, topo_set
from bemt.tools.cfd.openfoam.run import all_run, control
from bemt.tools.cfd.openfoam.settings import (
    DOMAINS,
    MACH_COMPRESSIBLE,
    SECTORS,
    TURBULENCE,
    Body,
    Settings,
    Sweep,
    sector_choice,
)
from geometry.common import GeometryError
from geometry.export import MANIFEST, export
from geometry.mesh import Options, build
from geometry.mesh_duct import centre_body, plan_stator
from geometry.solid import revolve

if TYPE_CHECKING:
    from geometry.duct import Duct
    from geometry.mesh import MeshModel
    from geometry.rotor import Rotor


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
    gas: str = "isentropic"  # As in :class:`bemt.tools.cfd.openfoam.settings.Settings`
    sector: str | None = None  # As there; `sector` None is the smallest that fits
    domain: str = "free"  # As there; `sector` None is the smallest that fits
    turbulence: str = "kOmegaSST"  # As there; `sector` None is the smallest that fits
    level: float = 6.0  # As there; `sector` None is the smallest that fits
    # Where a round plate stands behind the rotor, and its radius [R]
    wall_distance_over_R: float | None = None
    plate_radius_over_R: float = 2.0
    iterations: int = 400  # As there; `sector` None is the smallest that fits
    average: int = 100  # As there; `sector` None is the smallest that fits
    ranks: int = 2  # As there; `sector` None is the smallest that fits
    zone: str = "grid"  # As there; `sector` None is the smallest that fits


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


def settings_of(case: Case, run: Run, options: Options | None = None) -> tuple[Settings, dict[str, Any]]:
    """Work out the settings of a run."""
    file = case.path.as_posix()
    faults = check_run(run, file=file)
    if faults:
        raise InputError(faults)
    rotor, whole, air = case.rotor(), case.duct(), case.air()
    rpm = case.rpm if run.rpm is None else run.rpm
    V = case.airspeed_m_s if run.airspeed_m_s is None else run.airspeed_m_s
    if case.angle_deg and run.sideslip_deg != case.angle_deg:
        got, hint = f"{case.angle_deg:g} deg", f"The run has {run.sideslip_deg:g} deg: give both the same angle"
        raise InputError(Fault(file, "operating.angle_deg", got, "0, or that of the run", hint))
    sideslip = math.radians(run.sideslip_deg)
    sector = run.sector or sector_choice(rotor.B, sideslip)
    parts = {"half": 2, "blade": rotor.B}.get(sector, 1)
    duct, left_out = _standing(whole, parts)
    try:
        model = _mesh(rotor, duct, options)
        body = None if whole is None else _outline(rotor, whole, model)
    except GeometryError as error:
        raise InputError([Fault(file, *fault) for fault in error.faults]) from error
    points = model.rotor.vertices
    blade = points[np.unique(model.rotor.part("blade"))]
    tip = blade[np.hypot(blade[:, 0], blade[:, 1]) > 0.985 * rotor.R]
    azimuth = np.arctan2(tip[:, 1], tip[:, 0])
    first = np.abs(azimuth) < math.pi / max(rotor.B, 2)
    sweep = Sweep(float(blade[:, 2].min()), float(blade[:, 2].max()), float(tip[:, 2].min()), float(tip[:, 2].max()),
                  float(np.abs(azimuth[first]).max()))  # fmt: skip
    surfaces = [name for part in model.parts for name in part.names]
    around = None
    if model.duct is not None:
        z = model.duct.vertices[:, 2]
        around = Body(float(z.min()), float(z.max()), float(np.hypot(*model.duct.vertices[:, :2].T).max()))
    inner = None
    if body is not None:
        inner = Body(float(body[:, 1].min()), float(body[:, 1].max()), float(body[:, 0].max()))
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
            rotor=Body(float(points[:, 2].min()), float(points[:, 2].max()), rotor.R), blades=sweep, rpm=rpm, rho=rho,
            mu=mu, a_sound=a, temperature=temperature, V=V, sideslip=sideslip, sector=sector, domain=run.domain,
            level=run.level, turbulence=run.turbulence, compressible=compressible, gas=run.gas, duct=around, body=inner,
            gap=0.0 if duct is None else duct.gap, plate_z=plate, plate_radius=run.plate_radius_over_R * rotor.R,
            pitch=2 * math.pi * 0.75 * rotor.R * math.tan(float(rotor.blade.at(0.75 * rotor.R)[1])),
            iterations=run.iterations, average=run.average, ranks=run.ranks, zone=run.zone,
            surfaces=tuple(surfaces),
        )  # fmt: skip
    except InputError as error:
        raise InputError([replace(fault, file=fault.file or file) for fault in error.faults]) from error
    notes = [f"tip Mach number {mach:.3f}: {'compressible' if compressible else 'incompressible'}"]
    if left_out:
        notes.append("the vanes do not fit into the sector: left out, their centre body is there")
    if sideslip:
        notes.append("oblique flow with a frozen rotor is an approximation: one azimuth of the blades")
    if compressible and run.gas == "perfect":
        notes.append("energy equation without the work of the turning frame: temperatures at the blade are wrong")
    return settings, {"rotor": rotor, "duct": duct, "tail": tail, "notes": notes, "model": model}


def write_openfoam(case: Case, out: Path, run: Run, options: Options | None = None) -> dict[str, Any]:
    """Write a whole case: ``cd OUT && ./Allrun`` runs it."""
    settings, parts = settings_of(case, run, options)
    manifest = export(
        parts["rotor"], parts["duct"], out, ["openfoam"], name=case.name, options=options, model=parts["model"]
    )
    if parts["tail"] is not None:
        trimesh = needs("trimesh", "cad")

        solid = trimesh.Trimesh(*revolve(parts["tail"], FACETS), process=False)
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
        "notes": parts["notes"],
        "files": {name: hashlib.sha256(text.encode()).hexdigest() for name, text in sorted(files.items())},
    }  # fmt: skip
    write_atomic(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    return manifest

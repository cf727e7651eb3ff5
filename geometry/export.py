"""Files of solids: STL, OBJ, 3MF, STEP and OpenFOAM surfaces with a manifest; reading STL, OBJ and STEP back.

Everything is written under a temporary name, read back and checked, then renamed: a file that is there is sound.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.common import Array, Faults, GeometryError, needs
from geometry.duct import Duct
from geometry.mesh import MeshModel, Options, build
from geometry.rotor import Rotor
from geometry.solid import Mesh

FORMATS = ("stl", "step", "flow", "zone", "obj", "3mf", "openfoam")
UNITS = {"mm": 1e-3, "m": 1.0, "in": 0.0254}
SCHEMA = "geometry.export/1"
MANIFEST = "manifest.json"
VOLUME_TOLERANCE = 5e-3
FRAME = "z: shaft, towards thrust (upstream); x: pitch axis of blade 1; origin: pitch axes meet the shaft"
READ_TOLERANCE = 2e-6  # of the size of the part, when CAD surfaces are meshed


class Written(NamedTuple):
    """A file as the manifest lists it."""

    path: str
    format: str
    unit: str
    watertight: bool | str
    surfaces: Sequence[Mapping[str, object]]
    solids: list[str] | None = None
    faces: list[str] | None = None

    def document(self, work: Path) -> dict[str, Any]:
        """Plain values, with what is in the file."""
        data = (work / self.path).read_bytes()
        told = {key: value for key, value in self._asdict().items() if value is not None}
        return told | {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def export(
    rotor: Rotor, duct: Duct | None, out: Path, formats: Sequence[str], *, name: str = "rotor", unit: str = "mm",
    options: Options | None = None, model: MeshModel | None = None, box: float | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Write the solids of a rotor and its duct; `model` is their mesh with these options, if there is one already.

    `box` is the width of the far field over the diameter, of the format flow [1].
    """
    faults = Faults()
    for word in formats:
        if word not in FORMATS:
            faults.add("format", repr(word), f"some of {', '.join(FORMATS)}")
    if unit not in ("mm", "m"):
        faults.add("unit", repr(unit), "mm or m")
    faults.check()
    options = options or Options()
    model = build(rotor, duct, options) if model is None else model
    fresh = not out.exists()
    out.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(prefix=".export-", dir=out))
    try:
        files: list[Written] = []
        volumes = {k: v for k, v in model.checks.items() if k.startswith("volume")}
        for word in dict.fromkeys(formats):
            files += _written(word, rotor, duct, work, name, unit, model, volumes, box)
        manifest = {
            "schema": SCHEMA, "name": name, "blades": rotor.B, "rotation": "right" if rotor.rotation > 0 else "left",
            "diameter_m": rotor.D, "hub_diameter_m": 2 * rotor.Rhub, "frame": FRAME,
            "tessellation": {"section_points": options.n, "chord_and_angle_tolerance": options.tolerance,
                             "facets_round_hub": rotor.B * -(-options.segments // rotor.B)},
            "fillet_m": options.fillet, "volumes_m3": volumes,
            "checks_m": {k: v for k, v in model.checks.items() if not k.startswith("volume")},
            "files": [file.document(work) for file in files],
        }  # fmt: skip
        (work / MANIFEST).write_text(json.dumps(_rounded(manifest), indent=1) + "\n", encoding="utf-8")
        (out / MANIFEST).unlink(missing_ok=True)  # a manifest never speaks of files that are being replaced
        for item in [*(file.path for file in files), MANIFEST]:
            (out / item).parent.mkdir(parents=True, exist_ok=True)
            os.replace(work / item, out / item)
        return manifest
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        if fresh and not any(out.iterdir()):
            out.rmdir()
        raise
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _written(
    word: str, rotor: Rotor, duct: Duct | None, work: Path, name: str, unit: str, model: MeshModel,
    volumes: dict[str, float], box: float | None,
) -> list[Written]:  # fmt: skip
    """Write one format."""
    if word == "openfoam":
        return _openfoam(model, work)
    if word == "3mf":
        return [_three_mf(model, work, name)]
    if word not in ("step", "flow", "zone"):
        return [_meshes(model, work, name, word, unit)]
    from geometry.cad import kernel

    with kernel(word, "a solid that it makes", "Use stl, obj, 3mf or openfoam, which need no kernel"):
        if word == "step":
            return [_step(rotor, duct, work, name, unit, model, volumes)]
        if word == "zone":
            return _zone(rotor, duct, work, name, unit, model)
        return _flow(rotor, duct, work, name, unit, model, box)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return float(f"{float(value):.9g}") if isinstance(value, (float, np.floating)) else value


def _surface(part: Mesh, name: str, written: NDArray[np.int64]) -> dict[str, object]:
    return {"name": name, "triangles": len(written), "area_m2": part.area(name)}


def _stl(vertices: Array, faces: NDArray[np.int64], title: str) -> str:
    """One named solid of an ASCII STL; nine digits, so that a corner is the same text wherever it occurs."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    row = "facet normal %.5g %.5g %.5g\nouter loop\n" + "vertex %.9g %.9g %.9g\n" * 3 + "endloop\nendfacet\n"
    body = (row * len(faces)) % tuple(np.concatenate([normal, a, b, c], axis=1).ravel().tolist())
    return f"solid {title}\n{body}endsolid {title}\n"


def _clean(part: Mesh, scale: float) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Vertices as the files hold them (nine digits), faces that are still triangles, their groups."""
    values = part.vertices / scale
    values = np.where(np.abs(values) < 1e-9 * float(np.abs(values).max()), 0.0, values)
    cell = float(np.abs(values).max()) * 2e-7  # ten times what the reader merges: nothing is left for it
    _, first, index = np.unique(np.round(values / cell), axis=0, return_index=True, return_inverse=True)
    faces = index.ravel()[part.faces]
    keep = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return np.round(values / cell)[first] * cell, faces[keep], part.group[keep]


def _weld(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Merge corners that differ by less than single precision resolves; drop the triangles that vanish."""
    cell = max(float(np.abs(vertices).max()), 1e-300) * 2e-8
    _, first, index = np.unique(np.round(vertices / cell), axis=0, return_index=True, return_inverse=True)
    faces = index.ravel()[faces]
    keep = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices[first], faces[keep]


def _meshes(model: MeshModel, work: Path, name: str, kind: str, unit: str) -> Written:
    """STL with one named solid per surface, or OBJ with one group per surface."""
    pieces = [f"# unit: {unit}\n# {FRAME}\n"] if kind == "obj" else []
    count, surfaces = 0, []
    for part in model.parts:
        vertices, faces, group = _clean(part, UNITS[unit])
        if kind == "obj":
            pieces.append(("v %.9g %.9g %.9g\n" * len(vertices)) % tuple(vertices.ravel().tolist()))
        for k, surface in enumerate(part.names):
            chosen = faces[group == k]
            surfaces.append(_surface(part, surface, chosen))
            if kind == "obj":
                rows = ("f %d %d %d\n" * len(chosen)) % tuple((chosen + 1 + count).ravel().tolist())
                pieces.append(f"g {surface}\n{rows}")
            else:
                pieces.append(_stl(vertices, chosen, f"{surface} unit={unit}"))
        count += len(vertices)
    path = work / f"{name}.{kind}"
    path.write_text("".join(pieces), encoding="ascii")
    expected = sum(part.volume for part in model.parts)
    _check_file([path], UNITS[unit], expected, len(model.parts))
    closed = True if kind == "obj" or sum(len(part.names) for part in model.parts) == 1 else "the named solids together"
    return Written(path.name, kind, unit, closed, surfaces)


_THREE_MF = {
    "[Content_Types].xml": '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
    "_rels/.rels": '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>',
}


def _three_mf(model: MeshModel, work: Path, name: str) -> Written:
    """3MF, always in millimetres: one object per solid (3MF Consortium, core specification 1.3; not checked)."""
    pieces, items, surfaces = [], [], []
    for number, part in enumerate(model.parts, 1):
        vertices, faces, group = _clean(part, UNITS["mm"])
        surfaces += [_surface(part, name, faces[group == k]) for k, name in enumerate(part.names)]
        rows = ('<vertex x="%.9g" y="%.9g" z="%.9g"/>' * len(vertices)) % tuple(vertices.ravel().tolist())
        triangles = ('<triangle v1="%d" v2="%d" v3="%d"/>' * len(faces)) % tuple(faces.ravel().tolist())
        pieces.append(
            f'<object id="{number}" type="model"><mesh><vertices>{rows}</vertices>'
            f"<triangles>{triangles}</triangles></mesh></object>"
        )
        items.append(f'<item objectid="{number}"/>')
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f"<resources>{''.join(pieces)}</resources><build>{''.join(items)}</build></model>"
    )
    path = work / f"{name}.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for entry, content in (_THREE_MF | {"3D/3dmodel.model": text}).items():
            packed.writestr(zipfile.ZipInfo(entry), content, zipfile.ZIP_DEFLATED)  # no date: equal rotors, equal files
    return Written(path.name, "3mf", "mm", True, surfaces)


def _openfoam(model: MeshModel, work: Path) -> list[Written]:
    folder = work / "constant" / "triSurface"
    folder.mkdir(parents=True)
    out, paths = [], []
    for part in model.parts:
        vertices, faces, group = _clean(part, 1.0)
        for k, surface in enumerate(part.names):
            path = folder / f"{surface}.stl"
            chosen = faces[group == k]
            path.write_text(_stl(vertices, chosen, surface), encoding="ascii")
            paths.append(path)
            at, closed = path.relative_to(work).as_posix(), "together with the other surfaces"
            out.append(Written(at, "openfoam", "m", closed, [_surface(part, surface, chosen)]))
    _check_file(paths, 1.0, sum(part.volume for part in model.parts), len(model.parts))
    return out


def _check_file(paths: Sequence[Path], scale: float, volume: float, bodies: int) -> None:
    """Read files back; together they must be the closed solids that were meant."""
    trimesh = needs("trimesh", "cad")

    read = [read_solid(path) for path in paths]
    start = np.cumsum([0, *(len(v) for v, _, _ in read)])
    faces = np.concatenate([f + n for (_, f, _), n in zip(read, start, strict=False)])
    vertices, faces = _weld(np.concatenate([v for v, _, _ in read]), faces)
    solid = trimesh.Trimesh(vertices, faces, process=False)
    where, faults = ", ".join(path.name for path in paths), Faults()
    if not (solid.is_watertight and solid.is_winding_consistent):
        faults.add(where, "a file with open or twisted edges when read back", "closed solids")
    if abs(solid.volume * scale**3 / volume - 1) > 1e-5:
        faults.add(where, f"{solid.volume * scale**3:g} m^3 when read back", f"{volume:g} m^3")
    if not faults.found and solid.body_count != bodies:
        faults.add(where, f"{solid.body_count} bodies when read back", f"{bodies}")
    faults.check()


def _step(
    rotor: Rotor, duct: Duct | None, work: Path, name: str, unit: str, model: MeshModel, volumes: dict[str, float]
) -> Written:
    """Named solids; read back, each must be valid and have the volume of the mesh within 0.5 %."""
    cq = needs("cadquery", "cad")

    from geometry.cad import Parts, assembly, named_faces, printed_solid, solids

    options = model.options
    if options.printed is None:
        parts = solids(rotor, duct, options)
    else:
        one = printed_solid(rotor, options, model.rotor.volume)
        parts = Parts((("hub", "rotor", one),), {"blade": 0.0, "hub": one.Volume() * 1e-9})
    volumes["volume_rotor_cad"] = parts.rotor_volume
    meshed = volumes["volume_rotor_mesh"]
    path = work / f"{name}.step"
    faced = options.printed is None
    _write_step(assembly(parts, name, rotor if faced else None, duct), path, unit)
    back: list[Any] = cq.importers.importStep(str(path)).solids().vals()
    total = sum(solid.Volume() for solid in back) * 1e-9
    faults = Faults()
    if len(back) != len(parts.solids) or not all(solid.isValid() for solid in back):
        faults.add(path.name, f"{len(back)} solids when read back", f"{len(parts.solids)} valid ones")
    if abs(total / sum(parts.volumes.values()) - 1) > 1e-4:
        faults.add(path.name, f"{total:g} m^3 when read back", f"{sum(parts.volumes.values()):g} m^3")
    if abs(parts.rotor_volume / meshed - 1) > VOLUME_TOLERANCE:
        faults.add(path.name, f"a rotor of {parts.rotor_volume:g} m^3", f"that of the mesh, {meshed:g} m^3")
    faults.check()
    surfaces = [{"name": key, "volume_m3": value} for key, value in parts.volumes.items() if value > 0.0]
    faces = sorted({word for _, _, word in named_faces(parts, rotor, duct)}) if faced else []
    return Written(path.name, "step", unit, True, surfaces, [part for _, part, _ in parts.solids], faces)


def _flow(
    rotor: Rotor, duct: Duct | None, work: Path, name: str, unit: str, model: MeshModel, box: float | None
) -> list[Written]:  # fmt: skip
    """Air round the parts, in a box, its faces named."""
    from geometry.cad import WIDE, flow_domain, solids

    _aerodynamic("flow", model)
    wide = box or WIDE
    air, faces = flow_domain(solids(rotor, duct, model.options), rotor, duct, wide)
    says = (f"far field {wide:g} D wide ({wide * rotor.D:.4g} m), {0.5 * wide:g} D ahead of the rotor, "
            f"{wide:g} D behind it")  # fmt: skip
    return [_one_body(work, f"{name}_flow.step", "flow", "flow", air, faces, unit, says)]


def _zone(
    rotor: Rotor, duct: Duct | None, work: Path, name: str, unit: str, model: MeshModel
) -> list[Written]:  # fmt: skip
    """Cylinder that turns with the rotor, as STEP and as STL of three named solids."""
    from geometry.cad import rotating_zone, solids

    _aerodynamic("zone", model)
    solid, faces, (radius, low, high) = rotating_zone(solids(rotor, duct, model.options), rotor, duct)
    says = f"cylinder of radius {radius:.5g} m, from z {low:.5g} to {high:.5g} m"
    body = _one_body(work, f"{name}_zone.step", "zone", "rotating_zone", solid, faces, unit, says)
    text, path = [], work / f"{name}_zone.stl"
    for face, word in faces:
        corners, triangles = face.tessellate(1e-4 * radius * 1e3, 0.05)
        vertices = np.array([v.toTuple() for v in corners]) * 1e-3 / UNITS[unit]
        text.append(_stl(vertices, np.array(triangles, dtype=np.int64), f"{word} unit={unit}"))
    path.write_text("".join(text), encoding="ascii")
    named = [{"name": word} for _, word in faces]
    return [body, Written(path.name, "zone", unit, "the named solids together", named)]


def _aerodynamic(word: str, model: MeshModel) -> None:
    """Refuse a printed rotor where the shape in the air is meant."""
    if model.options.printed is not None:
        raise GeometryError([(word, "a printed rotor", "the aerodynamic shape", "Leave out the options of printing")])


def _one_body(
    work: Path, file: str, form: str, body: str, air: Any, faces: Sequence[tuple[Any, str]], unit: str, says: str
) -> Written:  # fmt: skip
    """Write a solid with its faces named; read back it must be one valid solid of the same volume."""
    cq = needs("cadquery", "cad")

    from geometry.cad import COLOURS

    whole = cq.Assembly(name=file.rsplit("_", 1)[0])
    whole.add(air, name=body, color=cq.Color(*COLOURS[body]))
    for face, word in faces:
        whole.objects[body].addSubshape(face, name=word, layer=word)
    path = work / file
    _write_step(whole, path, unit)
    back = cq.importers.importStep(str(path)).solids().vals()
    if len(back) != 1 or not back[0].isValid() or abs(back[0].Volume() / air.Volume() - 1.0) > 1e-4:
        got = f"{len(back)} solids when read back"
        raise GeometryError([(path.name, got, "one valid solid of the same volume", "")])
    surfaces = [{"name": body, "volume_m3": air.Volume() * 1e-9, "extent": says}]
    return Written(path.name, form, unit, True, surfaces, [body], sorted({word for _, word in faces}))


def _write_step(whole: Any, path: Path, unit: str) -> None:
    """Write an assembly with the names of its faces; the same shape gives the same file."""
    from cadquery.occ_impl.exporters.assembly import exportStepMeta

    export_parts: Any = exportStepMeta
    export_parts(whole, str(path), outputUnit=unit.upper())
    text = path.read_text(encoding="utf-8", errors="replace")
    text = re.sub(r"\d{4}-\d\d-\d\dT[\d:]{8}", "2000-01-01T00:00:00", text, count=1)
    mark, number = "NEXT_ASSEMBLY_USAGE_OCCURRENCE('", count(1)  # the kernel counts on from file to file
    path.write_text(re.sub(rf"{re.escape(mark)}\d+", lambda _: f"{mark}{next(number)}", text), encoding="utf-8")


def _said_unit(path: Path) -> str | None:
    """Unit that a file of this module states in its head."""
    with path.open("rb") as stream:
        head = stream.read(300).decode("latin-1")
    found = re.search(r"^solid \w+ unit=(mm|m|in)\s|^# unit: (mm|m|in)\s", head, re.M)
    return None if found is None else found[1] or found[2]


def read_solid(path: Path) -> tuple[Array, NDArray[np.int64], str | None]:
    """Read the triangles of an STL, OBJ or STEP file."""
    kind = path.suffix.lower()
    where = path.as_posix()
    if kind not in (".stl", ".obj", ".step", ".stp"):
        raise GeometryError([(where, f"the ending {kind or 'none'!r}", ".stl, .obj, .step or .stp", "")])
    if not path.is_file():
        raise GeometryError([(where, "no file", "an STL, OBJ or STEP file", "Check the path")])
    try:
        if kind in (".step", ".stp"):
            return _read_step(path)
        trimesh = needs("trimesh", "cad")

        with path.open("rb") as stream:
            loaded: Any = trimesh.load(stream, file_type=kind[1:], force="mesh", process=False)
        vertices = np.asarray(loaded.vertices, dtype=np.float64)
        faces = np.asarray(loaded.faces, dtype=np.int64)
    except GeometryError:
        raise
    except Exception as error:  # readers of other people's files raise every kind
        text = f"content that cannot be read ({type(error).__name__}: {str(error)[:80]})"
        raise GeometryError([(where, text, f"a sound {kind[1:].upper()} file", "Truncated?")]) from error
    if len(faces) < 20 or not np.isfinite(vertices).all():
        raise GeometryError([(where, f"{len(faces)} triangles", "a mesh of 20 triangles or more", "Truncated?")])
    vertices, faces = _weld(vertices, faces)
    return vertices, faces, _said_unit(path)


def _read_step(path: Path) -> tuple[Array, NDArray[np.int64], str | None]:
    cq = needs("cadquery", "cad")

    from geometry.cad import tessellate

    found: list[Any] = cq.importers.importStep(str(path)).solids().vals()
    shape = cq.Compound.makeCompound(found)
    if not shape.Solids():
        raise GeometryError([(path.as_posix(), "no solid", "one solid or more", "Surfaces alone enclose no volume")])
    size = shape.BoundingBox().DiagonalLength / 1000
    mesh = tessellate(shape, READ_TOLERANCE * size)
    return mesh.vertices, mesh.faces, "m"
